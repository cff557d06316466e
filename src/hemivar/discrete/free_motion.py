"""Bodies that are free to move, refused in words: which part, along which motion, and what would hold it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from hemivar.basics.arrays import COUNTS
from hemivar.basics.types import Array
from hemivar.discrete.held_at_rest import AT_LIMIT, BY_FRICTION, IDLE, NO_MINIMUM, growths, holds
from hemivar.discrete.recession import Coercivity, CoercivityResult, RecessionFunction, rests
from hemivar.discrete.rigid_modes import Mechanism, RigidModes, rigid_basis
from hemivar.errors import SupportError

if TYPE_CHECKING:
    from hemivar.discrete.problem import DiscreteProblem
    from hemivar.discrete.space import Field
    from hemivar.mesh.mesh import Mesh

__all__ = ["describe", "free_growth", "refuse", "refuse_free_motion"]


def refuse_free_motion(problem: DiscreteProblem, load: Array | None = None) -> DiscreteProblem:
    """Refuse a body that is not held.

    Its energy does not grow along each motion without deformation, and its foundation does not resist each at rest.
    A body whose load friction can balance that grows with the pressure is let pass with a warning.
    A body on which nothing acts is let pass where contact resists each motion one way: it is in balance where it is.

    Shapes: ``load`` (nodes * d,). Returned: the problem, known to be held, or to be held up to a limit, where its
    motions are known.
    """
    if problem.field is None or not problem.field.kernel_known:
        return problem
    field, contact, motions = problem.field, problem.contact, problem.model.free_motions
    forces = field.lift.T @ problem.load if load is None else load
    limits: list[str] = []
    balanced: list[bool] = []
    idle: str | None = None
    holding = holds(field, contact, problem.loading, forces, motions)
    for group, hold in zip(motions.groups, holding, strict=True):
        grows = hold.result.verdict is Coercivity.HELD
        if not grows and hold.limit is None and problem.unmoved and rests(hold.touched):
            idle = IDLE
            continue
        if not hold.held:
            raise _refusal(problem, motions, group, hold.result)
        limits += [hold.limit] if hold.limit else []
        balanced += [] if hold.balanced is None else [hold.balanced]
    friction = (BY_FRICTION if one else AT_LIMIT for one in balanced)
    problem = problem.fitted(warnings=tuple(dict.fromkeys((*problem.warnings, *friction, *open_glue(problem)))))
    limit = NO_MINIMUM if NO_MINIMUM in limits else next(iter(limits), None)
    return problem.known_to_be_held(limit, idle, any(balanced) if balanced else None)


def free_growth(problem: DiscreteProblem, motions: RigidModes) -> list[RecessionFunction]:
    """Growth of the energy along the motions of each group of parts."""
    assert problem.field is not None
    forces = problem.field.lift.T @ problem.load
    return growths(problem.field, problem.contact, problem.loading, forces, motions)


_REMEDY = "add a support or a law that constrains it"


def refuse(hold: CoercivityResult, motion: str, who: str = "the body", remedy: str = _REMEDY) -> None:
    """Refuse a body that is not held."""
    if hold.verdict is Coercivity.HELD:
        return
    if hold.verdict is Coercivity.FALLS:
        raise SupportError(
            f"{who} is free to move: the loads exceed what supports and laws resist along the rigid motion {motion} "
            f"(energy falls by {-hold.growth:.3g} per unit of motion); {remedy}"
        )
    if hold.verdict is Coercivity.BALANCED:
        raise SupportError(
            f"{who} is free to move: nothing constrains the rigid motion {motion} (along it the loads are in "
            f"balance with what supports and laws can resist); {remedy}"
        )
    raise SupportError(
        f"it is undecided whether {who} is free to move, because its laws pull without bound far away; {remedy}, "
        f"or pass "
        f"check_coercivity=False to discretize"
    )


def describe(coefficients: Array) -> str:
    """A rigid motion, 3 or 6 coefficients of :func:`rigid_basis`, or a constant, one coefficient, in words."""
    if len(coefficients) == 1:
        return "(adding a constant)"
    dim = 2 if len(coefficients) == 3 else 3
    names = rigid_basis(np.eye(dim), (np.zeros(dim), np.ones(dim)))[1]
    coefficients = np.where(np.abs(coefficients) < 1e-3 * np.abs(coefficients).max(), 0.0, coefficients)
    words = []
    if np.any(coefficients[:dim]):
        words.append(f"translation {_vector(coefficients[:dim])}")
    turns = [name for name, value in zip(names[dim:], coefficients[dim:], strict=True) if value]
    if turns:
        words.append("rotation" + " and".join(turns))
    return "(" + " with ".join(words) + ")"


def _refusal(problem: DiscreteProblem, motions: RigidModes, group: Mechanism, hold: CoercivityResult) -> SupportError:
    field = problem.field
    assert field is not None
    part, motion, along = int(group.parts[0]), "", []
    if hold.direction is not None:
        moved = group.coefficients @ hold.direction
        size = float(np.abs(moved).max())
        fastest = int(np.argmax(np.linalg.norm(moved, axis=1)))
        part, motion = int(group.parts[fastest]), describe(moved[fastest] / size)
        along = [int(k) for k in group.parts[np.abs(moved).max(axis=1) > COUNTS * size] if k != part]
        hold = replace(hold, growth=hold.growth / size)
    who, remedy = _words(field, motions, group, part, along)
    remedy += "".join(f"; {advice}" for advice in open_glue(problem))
    m, c = problem.contact_points, problem.contact.components
    if m and problem.law.rubbed(np.ones((m, c - 1, 1))).any():
        remedy += (
            " (friction that depends on the solution counts only up to what the pressure provides: where it slides, "
            "such a motion lifts the body by the coefficient of friction)"
        )
    try:
        refuse(hold, motion, who, remedy)
    except SupportError as error:
        return error
    raise AssertionError


def open_glue(problem: DiscreteProblem) -> Iterator[str]:
    """What is said of boundaries whose glue has let go at every point before anything moves."""
    if not problem.contact_points:
        return
    rest, contact = -problem.offset, problem.contact
    damage = problem.law.debonding(rest).get("damage", np.full(len(rest), np.nan))
    for boundary, name in zip(contact.places, contact.names, strict=True):
        index = contact.on(name)
        if index.size and (damage[index] == 1.0).all():
            gap = -float(rest[index, 0].max())
            yield (
                f"the glue of '{boundary}' begins open by {gap:.4g} and holds nothing; where that is the thickness of "
                f"the layer give gap = {-gap:.4g}"
            )


def _words(
    field: Field, motions: RigidModes, group: Mechanism, part: int, along: Sequence[int] = ()
) -> tuple[str, str]:
    """Who moves, which parts move along with it, and what would hold it."""
    if motions.parts.count == 1:
        return "the body", _REMEDY
    mesh, centre = field.mesh, _vector(motions.parts.place(field.mesh, part))
    who = f"{_called(motions, mesh, part)} of the body, around x = {centre},"
    if group.hinges.size:
        places = _listed([_vector(x) for x in field.nodes[group.hinges]])
        who += f" which is joined to others at x = {places} only,"
    if len(along):
        who += f" together with {_listed([_called(motions, mesh, other) for other in along])},"
    names = _listed([f"'{name}'" for name in motions.parts.boundaries(mesh, part)])
    where = f" on one of its boundaries ({names})" if names else ""
    joined = "state what it touches (against = ...), or give it common facets with the others"
    return who, f"{_REMEDY}{where}, {joined} (nodes at one place must be one node)"


def _called(motions: RigidModes, mesh: Mesh, part: int) -> str:
    name = motions.parts.name(mesh, part)
    return f"part {part + 1} of {motions.parts.count}" if name is None else f"part '{name}'"


def _listed(words: Sequence[str], most: int = 3) -> str:
    more = len(words) - most
    return ", ".join(words[:most]) + (f" and {more} more" if more > 0 else "")


def _vector(values: Array) -> str:
    return "(" + ", ".join(f"{value + 0.0:.6g}" for value in values) + ")"
