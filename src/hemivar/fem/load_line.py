"""A load that grows: the problems between the unloaded body and the loaded one."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import cast

import numpy as np

from hemivar.discrete.potential import Potential
from hemivar.discrete.problem import DiscreteProblem
from hemivar.discrete.space import Space
from hemivar.errors import ProblemError
from hemivar.fem.discretize import discretize
from hemivar.mechanics import Clamped, ContactProblem, Fixed, Prescribed, Roller
from hemivar.mechanics.conditions import ScalarData, Support

__all__ = ["LoadLine"]


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

    Raises
    ------
    ProblemError
        The two problems differ in size.
    """

    loaded: DiscreteProblem
    unloaded: DiscreteProblem | None = None

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
        loaded = discretize(problem)
        rest = _unloaded(problem)
        return cls(loaded, None if rest is None else discretize(rest))

    @classmethod
    def to(cls, problem: DiscreteProblem) -> LoadLine:
        """The line from rest to a discrete problem; displacements that its statement prescribes grow with its load."""
        stated = problem.origin
        rest = None if stated is None else _unloaded(stated)
        return cls(problem, None if rest is None else discretize(rest, check_coercivity=False))

    def at(self, factor: float) -> DiscreteProblem:
        """The problem at load factor ``factor``; matrices are shared.

        Where displacements are prescribed it has a model of its own, whose field has that part of them.
        """
        if factor == 1.0:
            return self.loaded
        if not 0.0 <= abs(factor) < np.inf:
            raise ProblemError(f"the load factor is {factor}; give a finite number")
        loaded, zero = self.loaded, self.unloaded
        if zero is None:
            return loaded.with_(load=factor * loaded.load)
        if isinstance(loaded.bulk, Potential) and isinstance(zero.bulk, Potential):
            return self._nonlinear(factor, zero)
        return self._displaced(factor, zero).with_(
            load=(1.0 - factor) * zero.load + factor * loaded.load,
            # The energy of prescribed displacements is quadratic in them.
            constant=zero.constant + factor**2 * (loaded.constant - zero.constant),
            offset=(1.0 - factor) * zero.offset + factor * loaded.offset,
        )

    def _displaced(self, factor: float, zero: DiscreteProblem) -> DiscreteProblem:
        """The loaded problem, its field with a part of the prescribed displacements."""
        field, first = self.loaded.field, zero.field
        if field is None or first is None or np.array_equal(field.prescribed, first.prescribed):
            return self.loaded
        field = replace(field, prescribed=(1.0 - factor) * first.prescribed + factor * field.prescribed)
        return replace(self.loaded, model=replace(self.loaded.model, space=Space((field,))), law_known=True)

    def _nonlinear(self, factor: float, zero: DiscreteProblem) -> DiscreteProblem:
        """That of a body that is not linear: what prescribed displacements leave of forces and energy follows W."""
        loaded, displaced, parts = self.loaded, self._displaced(factor, zero), (zero.bulk, self.loaded.bulk)
        field = displaced.field
        assert field is not None
        first, last = cast(tuple[Potential, Potential], parts)
        bulk = Potential(last.energy.from_field(field.prescribed.reshape(len(field.nodes), -1)))
        model = replace(displaced.model, bulk=bulk)
        forces = (1.0 - factor) * (zero.load + first.initial_forces) + factor * (loaded.load + last.initial_forces)
        # The work of loads on prescribed displacements is quadratic in both; what these store is not.
        begin, end = zero.constant - first.initial_value, loaded.constant - last.initial_value
        return replace(loaded, model=model, law_known=True).with_(
            load=forces - bulk.initial_forces,
            constant=bulk.initial_value + begin + factor**2 * (end - begin),
            offset=(1.0 - factor) * zero.offset + factor * loaded.offset,
        )


def _unloaded(problem: ContactProblem) -> ContactProblem | None:
    """The statement without loads and prescribed displacements; None where it prescribes no displacement."""
    held = {name: _at_rest(support, problem.mesh.dim) for name, support in problem.supports.items()}
    if all(held[name] is support for name, support in problem.supports.items()):
        return None
    return replace(problem, supports=held, body_force=0.0, tractions={})


def _at_rest(support: Support | ScalarData, dim: int) -> Support | ScalarData:
    """The support with its prescribed displacements taken away; itself if it has none."""
    if isinstance(support, Prescribed):
        return Prescribed(np.zeros(dim))
    if isinstance(support, Fixed):
        values = (support.x, support.y, support.z)
        zero = [None if value is None else 0.0 for value in values]
        moves = any(callable(value) or (value is not None and np.any(value)) for value in values)
        return Fixed(*zero) if moves else support
    if isinstance(support, Clamped | Roller):
        return support
    return 0.0 if callable(support) or support else support
