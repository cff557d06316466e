"""Load path (proportional loading): the problems between the unloaded body and the loaded one."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from dataclasses import dataclass, replace
from typing import cast

import numpy as np

from hemivar.basics.arguments import described, suggest
from hemivar.basics.first_use import cached_property
from hemivar.basics.types import Array
from hemivar.discrete.potential import Potential
from hemivar.discrete.problem import DiscreteProblem
from hemivar.discrete.space import Space
from hemivar.errors import ProblemError
from hemivar.fem.assembly import stated_load
from hemivar.fem.discretize import discretize
from hemivar.fem.reactions import support_reactions
from hemivar.mechanics import ContactProblem
from hemivar.mechanics.conditions import RigidPlate, at_rest
from hemivar.mechanics.load_steps import between_fields

__all__ = ["LoadLine", "load_names"]

#: The name of the body force among those of the loads, which are of boundaries.
_BODY = "body"


@dataclass(frozen=True, eq=False)
class LoadLine:
    """Load, gap and offset ``(1 - t) unloaded + t loaded`` for the load factor t.

    Parameters
    ----------
    loaded : DiscreteProblem
        The problem at t = 1.
    unloaded : DiscreteProblem, optional
        The problem at t = 0, on the same mesh with the same law; by default the loaded one with its load f taken away.
        Where displacements are prescribed give the problem with these at zero, then they grow with t as well.
    cross : float
        The part of the energy that is linear in t: minus the work of the constant loads on the prescribed
        displacements, which grow.

    Raises
    ------
    ProblemError
        The two problems differ in size.
    """

    loaded: DiscreteProblem
    unloaded: DiscreteProblem | None = None
    cross: float = 0.0

    def __post_init__(self) -> None:
        zero = self.unloaded
        loaded = self.loaded
        if zero is not None and (zero.unknowns, zero.contact.count) != (loaded.unknowns, loaded.contact.count):
            raise ProblemError(
                "the unloaded problem differs in size from the loaded one; use the same mesh and supports"
            )

    @classmethod
    def of(cls, problem: ContactProblem) -> LoadLine:
        """The line from the body at rest to the problem: forces and prescribed displacements grow together."""
        return cls.to(discretize(problem))

    @classmethod
    def to(cls, problem: DiscreteProblem, constant: Collection[str] = ()) -> LoadLine:
        """The line to a discrete problem: its load grows, with the displacements that its statement prescribes.

        Parameters
        ----------
        problem : DiscreteProblem
            The problem at t = 1.
        constant : names
            Loads that have their full size for all t: ``"body"`` and names of boundaries with a traction.

        Raises
        ------
        ProblemError
            A constant load is not a load of the problem, or the problem has no statement that names its loads.
        """
        stated = problem.origin
        if stated is None:
            if constant:
                raise ProblemError("constant loads are named in a ContactProblem; give one, or unloaded=")
            return cls(problem)
        _check_loads(stated, constant)
        moves = any(at_rest(support, stated.mesh.dim) is not support for support in stated.supports.values())
        stays = bool(constant) or (stated.initially_stressed and not stated.initial_scaled)
        if not (moves or stays):
            return cls(problem)
        rest = discretize(_unloaded(stated, constant), check_coercivity=False)
        if not (moves and stays):
            return cls(problem, rest)
        growing = stated if stated.initial_scaled else _relaxed(stated)
        grown = discretize(_with_loads(growing, _loads(stated) - set(constant)), check_coercivity=False)
        return cls(problem, rest, _stored(problem) - _stored(rest) - _stored(grown))

    def check_grows(self) -> None:
        """Refuse a line along which nothing changes.

        Raises
        ------
        ProblemError
            There is no load, and no prescribed displacement, that grows.
        """
        loaded, zero = self.loaded, self.unloaded
        if zero is None:
            changes = bool(loaded.load.any())
        else:
            pairs = [(loaded.load, zero.load), (loaded.offset, zero.offset)]
            if loaded.field is not None and zero.field is not None:
                pairs.append((loaded.field.prescribed, zero.field.prescribed))
            changes = not all(np.array_equal(one, other) for one, other in pairs)
        if not changes:
            raise ProblemError(
                "nothing grows with the load factor: no load is left beside the constant ones, and no displacement is "
                "prescribed; add one, or solve once"
            )

    def at(self, factor: float) -> DiscreteProblem:
        """The problem at load factor ``factor``; matrices are shared.

        Where displacements are prescribed it has a model of its own, whose field has that part of them.
        """
        if factor == 1.0:
            return self.loaded
        if not 0.0 <= abs(factor) < np.inf:
            raise ProblemError(f"the load factor is {factor}; give a finite number")
        stated = self.loaded.origin
        if stated is None or not (stated.initial_scaled and stated.initially_stressed):
            return self._at(factor)
        problem = self._at(factor)
        names = ("initial_stress", "initial_strain")
        scaled = {name: between_fields(0.0, getattr(stated, name), factor, name) for name in names}
        # What the stress is made of: it has that part of its initial stress.
        return problem.fitted(replace(problem.model, origin=replace(stated, **scaled)))  # type: ignore[arg-type]

    def _at(self, factor: float) -> DiscreteProblem:
        loaded, zero = self.loaded, self.unloaded
        if zero is None:
            return loaded.under(factor * loaded.load)
        if isinstance(loaded.bulk, Potential) and isinstance(zero.bulk, Potential):
            return self._nonlinear(factor, zero)
        return self._displaced(factor, zero).under(
            (1.0 - factor) * zero.load + factor * loaded.load,
            # The energy of prescribed displacements is quadratic in them.
            constant=self._constant(factor, zero),
            offset=(1.0 - factor) * zero.offset + factor * loaded.offset,
        )

    def reactions(self, factor: float, displacement: Array, multiplier: Array) -> dict[str, Array]:
        """Force of each support on the body at a load factor; see :func:`hemivar.fem.support_reactions`."""
        begin, end = self._nodal_loads
        load = (1.0 - factor) * begin + factor * end
        return support_reactions(self.at(factor), displacement, multiplier, load)

    @cached_property
    def _nodal_loads(self) -> tuple[Array, Array]:
        """Loads (nodes * c,) of the nodes at both ends."""
        stated, rest = self.loaded.origin, None if self.unloaded is None else self.unloaded.origin
        if stated is None or (self.unloaded is not None and rest is None):
            raise ProblemError("a problem made of arrays has no supports by name; state it, and discretize it")
        end = stated_load(stated)
        return np.zeros_like(end) if rest is None else stated_load(rest), end

    def _constant(self, factor: float, zero: DiscreteProblem) -> float:
        """Energy of the prescribed displacements, but for what a nonlinear body stores in them."""
        begin, end = _stored(zero), _stored(self.loaded)
        return begin + factor * self.cross + factor**2 * (end - begin - self.cross)

    def _displaced(self, factor: float, zero: DiscreteProblem) -> DiscreteProblem:
        """The loaded problem, its field with a part of the prescribed displacements."""
        field, first = self.loaded.field, zero.field
        if field is None or first is None or np.array_equal(field.prescribed, first.prescribed):
            return self.loaded
        field = replace(field, prescribed=(1.0 - factor) * first.prescribed + factor * field.prescribed)
        return self.loaded.fitted(replace(self.loaded.model, space=Space((field,))))

    def _nonlinear(self, factor: float, zero: DiscreteProblem) -> DiscreteProblem:
        """That of a body that is not linear: what prescribed displacements leave of forces and energy follows W."""
        loaded, displaced, parts = self.loaded, self._displaced(factor, zero), (zero.bulk, self.loaded.bulk)
        field = displaced.field
        assert field is not None
        first, last = cast(tuple[Potential, Potential], parts)
        bulk = Potential(last.energy.from_field(field.prescribed.reshape(len(field.nodes), -1)))
        model = replace(displaced.model, bulk=bulk)
        forces = (1.0 - factor) * (zero.load + first.initial_forces) + factor * (loaded.load + last.initial_forces)
        return loaded.fitted(model).under(
            forces - bulk.initial_forces,
            constant=bulk.initial_value + self._constant(factor, zero),
            offset=(1.0 - factor) * zero.offset + factor * loaded.offset,
        )


def load_names(names: Iterable[str]) -> tuple[str, ...]:
    """Names of loads as options keep them."""
    given = None if isinstance(names, str) or not isinstance(names, Iterable) else tuple(names)
    if given is None or not all(isinstance(name, str) for name in given):
        raise ProblemError(f"constant is {described(names)}; give names of loads, such as ['body', 'top']")
    return given


def _stored(problem: DiscreteProblem) -> float:
    """The constant of its energy that is quadratic in loads and prescribed displacements together."""
    return problem.constant - (problem.bulk.initial_value if isinstance(problem.bulk, Potential) else 0.0)


def _loads(problem: ContactProblem) -> set[str]:
    plates = {name: one.loads.values() for name, one in problem.supports.items() if isinstance(one, RigidPlate)}
    pushed = {name for name, loads in plates.items() if any(map(_acts, loads))}
    return {*problem.tractions} | pushed | ({_BODY} if _acts(problem.body_force) else set())


def _acts(load: object) -> bool:
    return callable(load) or bool(np.any(np.asarray(load)))


def _check_loads(problem: ContactProblem, names: Collection[str]) -> None:
    """Refuse names of loads that a statement does not have, and ``"body"`` where a boundary has that name."""
    known = sorted(_loads(problem))
    for name in names:
        if name not in known:
            has = f"its loads are {', '.join(known)}" if known else "it has none"
            raise ProblemError(f"the problem has no load '{name}'{suggest(name, known)}; {has}")
    if _BODY in names and _BODY in problem.tractions:
        raise ProblemError("'body' is the body force and a boundary with a traction; give that boundary another name")


def _with_loads(problem: ContactProblem, names: Collection[str]) -> ContactProblem:
    """The statement with these loads alone."""
    tractions = {name: traction for name, traction in problem.tractions.items() if name in names}
    supports = {
        name: replace(one, force=0.0, moment=0.0) if isinstance(one, RigidPlate) and name not in names else one
        for name, one in problem.supports.items()
    }
    force = problem.body_force if _BODY in names else 0.0
    return replace(problem, body_force=force, tractions=tractions, supports=supports)


def _unloaded(problem: ContactProblem, constant: Collection[str]) -> ContactProblem:
    """The statement with its constant loads alone, and without prescribed displacements."""
    left = _with_loads(problem, constant)
    rest = replace(left, supports={name: at_rest(one, problem.mesh.dim) for name, one in left.supports.items()})
    return _relaxed(rest) if problem.initial_scaled else rest


def _relaxed(problem: ContactProblem) -> ContactProblem:
    """The statement without initial stress."""
    return replace(problem, initial_stress=0.0, initial_strain=0.0)
