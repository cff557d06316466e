"""Quantities of interest as functionals of the displacement, and what of them the energy norm controls.

For a field w of the body the principle of virtual work, with q the force of the foundation, reversed, says

    a(u, w) - L(w) + <q, w> = work of the supports' forces on w.

A contact force (w = e on its boundary, at rest elsewhere where something holds or touches) and a reaction (w = e on the
support) are so ``a(u, w) - L(w)``, and differ from it by ``<q, omega>`` where w cannot be what it should: near the ends
of contact boundaries, where w falls to what is held. Of all such fields that of least energy on the mesh is taken. The
mean displacement over a part of the boundary is ``a(z, u)`` with z the answer to a unit traction.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hemivar.basics.arrays import SAME
from hemivar.basics.types import Array, IntArray
from hemivar.bounds.bare_body import contact_sides
from hemivar.bounds.body_data import BodyData
from hemivar.bounds.goals import Goal, GoalKind
from hemivar.discrete.problem import DiscreteProblem
from hemivar.errors import ProblemError
from hemivar.fem.supports import stated_supports
from hemivar.linear.factorisation import factorise
from hemivar.mechanics.kinematics import voigt_index
from hemivar.mechanics.statement import ContactProblem

__all__ = ["Functional", "functionals", "linear_forces", "nodal_forces", "strained", "work"]


@dataclass(frozen=True, eq=False)
class Functional:
    """One component of a quantity of interest."""

    axis: int
    field: Array  # (N, d): w
    tractions: Array  # (F, d, d): moments of the traction whose work a mean displacement is
    rest: Array  # (F, d, d)
    why: str = ""  # why nothing bounds it

    @property
    def force(self) -> bool:
        """Whether it is a force."""
        return not self.tractions.any()


def nodal_forces(data: BodyData, stress: Array) -> Array:
    """``int s : eps(phi)``, shape (N, d), of stresses (M, d, d) that are constant on cells."""
    table = data.table
    local = np.einsum("m,mij,maj->mai", table.volumes, stress, table.gradients, optimize=True)
    return _summed(table.cells, local, table.mesh.number_of_nodes)


def linear_forces(data: BodyData, moments: Array) -> Array:
    """Nodal forces (N, d) of the moments (F, d, d) of tractions."""
    return _summed(data.table.facets, moments, data.table.mesh.number_of_nodes)


def work(data: BodyData, field: Array) -> float:
    """``a(u, w) - L(w)`` for a field (N, d), u the displacement of the data."""
    table = data.table
    gradient = np.einsum("mai,maj->mij", field[table.cells], table.gradients, optimize=True)
    inner = np.einsum("m,mij,mij->", table.volumes, data.stress, gradient, optimize=True)
    loads = np.einsum("mai,mai->", data.loads, field[table.cells])
    return float(inner - loads - np.einsum("fai,fai->", data.outer_loads, field[table.facets[table.outer]]))


def _summed(members: IntArray, local: Array, count: int) -> Array:
    out = np.zeros((count, local.shape[-1]))
    for c in range(local.shape[-1]):
        out[:, c] = np.bincount(members.ravel(), weights=local[..., c].ravel(), minlength=count)
    return out


def functionals(goal: Goal, data: BodyData, discrete: DiscreteProblem) -> tuple[Functional, ...]:
    """The components of a goal."""
    if goal.kind is GoalKind.DISPLACEMENT:
        return tuple(_mean(goal, data, axis) for axis in goal.axes)
    assert discrete.field is not None
    basis, lift, K = discrete.field.basis, discrete.field.lift, discrete.stiffness
    facets = np.flatnonzero(data.contact >= 0)
    touching = np.zeros(data.table.mesh.number_of_nodes, dtype=bool)
    for side in (data.table.facets, data.table.others):
        touching[side[facets]] = True
    dim = data.table.dim
    rows = np.repeat(touching, dim).astype(float)
    given = np.asarray(abs(basis).T @ rows) > SAME
    free = np.flatnonzero(~given)
    factor = factorise(K[free][:, free], np.zeros(0, dtype=np.int64)) if free.size else None
    components = []
    for axis in goal.axes:
        wanted, fixed, jump = _wanted(goal, data, axis)
        values = lift @ (np.where(touching[:, None], wanted, 0.0) - fixed).ravel()
        y = np.where(given, values, 0.0)
        start = fixed + np.asarray(basis @ y).reshape(fixed.shape)
        if factor is not None:
            push = np.asarray(basis.T @ nodal_forces(data, strained(data, start)[1]).ravel())
            y[free] = -factor.solve_interior(push[free])
        field = fixed + np.asarray(basis @ y).reshape(fixed.shape)
        rest = np.zeros(data.facet_loads.shape)
        rest[facets] = data.jump(field, facets) - jump[facets, None]
        loose = np.eye(dim) - data.freed(facets)
        rest[facets] = np.einsum("fij,faj->fai", loose, rest[facets])
        rest[np.abs(rest) < SAME] = 0.0
        components.append(Functional(axis, field, np.zeros(rest.shape), rest, _hindrance(goal, data, axis, field)))
    return tuple(components)


def strained(data: BodyData, field: Array) -> tuple[Array, Array]:
    """``eps(w)`` and ``C eps(w)``, shape (M, d, d) both, of a nodal field, with the mean of C over each cell."""
    table = data.table
    gradient = np.einsum("mai,maj->mij", field[table.cells], table.gradients)
    strain = 0.5 * (gradient + gradient.transpose(0, 2, 1))
    index = voigt_index(table.dim)
    mean = np.einsum("q,mqvw->mvw", data.weights, data.tensors)[:, index[:, :, None, None], index]
    mean = np.broadcast_to(mean, (len(strain), *mean.shape[1:]))
    return strain, np.einsum("mijkl,mkl->mij", mean, strain, optimize=True)


def _contact(goal: Goal, problem: ContactProblem) -> tuple[int, bool]:
    """The number of the contact whose force is asked for, and whether that on the side without contact points is."""
    every = [contact_sides(problem, name) for name in problem.contact]
    number = next(number for number, sides in enumerate(every) if goal.boundary in sides)
    return number, goal.boundary != every[number][0]


def _wanted(goal: Goal, data: BodyData, axis: int) -> tuple[Array, Array, Array]:
    """What w should be at contact nodes (N, d), what it is in the directions that are held (N, d), and what contact
    facets should see of it (F, d)."""
    mesh, dim = data.table.mesh, data.table.dim
    wanted, fixed, jump = np.zeros(mesh.points.shape), np.zeros(mesh.points.shape), np.zeros((len(data.contact), dim))
    if goal.kind is GoalKind.CONTACT_FORCE:
        number, other = _contact(goal, data.problem)
        on = data.contact == number
        wanted[np.unique((data.table.others if other else data.table.facets)[on])] = np.eye(dim)[axis]
        jump[on] = (-1.0 if other else 1.0) * np.eye(dim)[axis]
        return wanted, fixed, jump
    supports = stated_supports(data.problem)
    number = supports.names.index(goal.boundary) if goal.boundary in supports.names else -1
    own = np.where((supports.owner == number)[:, :, None], supports.directions, 0.0)
    return wanted, np.einsum("nqd,nq->nd", own, own[:, :, axis]), jump


def _hindrance(goal: Goal, data: BodyData, axis: int, field: Array) -> str:
    """Why forces of supports, which nothing bounds, take part; empty where they do not."""
    table, unit = data.table, np.eye(data.table.dim)[axis]
    outer = np.flatnonzero(~table.interior & data.unknown.any(axis=(1, 2)))
    should = np.zeros((len(outer), table.dim))
    if goal.kind is GoalKind.CONTACT_FORCE:
        here = data.contact[outer] == _contact(goal, data.problem)[0]
        if np.abs(np.einsum("fij,j->fi", data.freed(outer), unit)[here]).max(initial=0.0) > SAME:
            return f"a support constrains contact '{goal.boundary}' along {'xyz'[axis]}, where force of both is one"
    else:
        own = table.numbers(data.problem.mesh.boundaries[goal.boundary])
        should[np.isin(outer, own)] = unit
    off = np.einsum("fij,faj->fai", data.freed(outer), field[table.facets[outer]] - should[:, None])
    if np.abs(off).max(initial=0.0) > SAME:
        return f"support '{goal.boundary}' meets another one, whose force at their common end has no bound"
    return ""


def _mean(goal: Goal, data: BodyData, axis: int) -> Functional:
    """The mean displacement over a part of the boundary, as the work of a traction."""
    table = data.table
    dim = table.dim
    facets = np.unique(table.numbers(data.problem.mesh.boundaries[goal.boundary]))
    if table.cut[facets].any():
        raise ProblemError(
            f"bodies touch on '{goal.boundary}', where no mean displacement is bounded; name a boundary where none do"
        )
    measures = table.measures[facets]
    tractions = np.zeros(data.facet_loads.shape)
    tractions[facets, :, axis] = (measures / measures.sum() / dim)[:, None]
    none = np.zeros(table.mesh.points.shape)
    return Functional(axis, none, tractions, np.zeros(tractions.shape))
