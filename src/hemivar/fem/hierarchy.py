"""Geometric multigrid: the coarser discrete problem (linear elements, or the coarser mesh) and its prolongation."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import cast

import numpy as np
import scipy.sparse as sp

from hemivar.basics.arrays import ROUNDED
from hemivar.basics.types import Array, IntArray
from hemivar.discrete.contact import ContactPoints
from hemivar.discrete.operator_family import Composition, OperatorFamily, Tangent
from hemivar.discrete.potential import Potential
from hemivar.discrete.problem import DiscreteProblem
from hemivar.discrete.space import Field
from hemivar.fem.contact_points import BoundaryContact
from hemivar.fem.discretize import coarse_problem
from hemivar.fem.dynamics import body_family
from hemivar.fem.stress_stiffness import Stressed, stressed_problem
from hemivar.fem.supports import on_coarser
from hemivar.mesh.mesh import Mesh

__all__ = ["Coarser", "coarser", "family_of", "has_coarser", "tangent_problem"]


@dataclass(frozen=True, eq=False)
class Coarser:
    """A coarser problem and the way from its unknowns to those of the finer one.

    Below elements of order 2 in space are linear ones on the same mesh.
    """

    problem: DiscreteProblem  # the same one on the mesh that was refined
    prolongation: sp.csr_array  # (n, n_coarse), of changes: prescribed displacements are left out
    field: Field  # of the finer problem
    shared: IntArray  # the contact point of the finer problem at the place of each of the coarser one
    pairs: Mapping[str, BoundaryContact]  # contact points of two bodies on the coarser mesh, by boundary
    #: Fine unknowns (n,) of what prescribed displacements are carried on into, where that is no part of the field.
    shift: Array | None = None
    interpolation: sp.csr_array | None = None  # (nodes, coarse nodes); None where unknowns of one mesh are left out

    def on_coarse_mesh(self, finer: DiscreteProblem) -> DiscreteProblem:
        """The coarser problem with load, gap and law of another problem on the finer mesh."""
        return self.problem.under(
            self.prolongation.T @ _stated_load(finer) - _initial_forces(self.problem),
            offset=finer.offset[self.shared],
            law=finer.law.take(self.shared),
        )

    def restrict(self, unknowns: Array) -> Array:
        """Coarse unknowns of the displacement field given by fine ones (n,), taken at the nodes that both meshes have.

        They need not have been prolonged from anything.
        """
        coarse = self.problem.field
        assert coarse is not None
        assert self.interpolation is not None
        same = _nodes_of_both(self.interpolation)
        return coarse.restrict(self.field.full(unknowns)[same])

    def interpolate(self, unknowns: Array) -> Array:
        """Fine unknowns (n,) of the coarse displacement field given by its unknowns."""
        coarse = self.problem.field
        assert coarse is not None
        if self.interpolation is None:
            return np.asarray(self.prolongation @ unknowns)
        return self.field.restrict(self.interpolation @ coarse.full(unknowns))


def _below(field: Field) -> tuple[Mesh, sp.csr_array] | None:
    """The mesh of linear elements below those of a field, and how nodal values of the field follow from theirs."""
    mesh = field.mesh
    if field.order == 1:
        return None if mesh.parent is None else (mesh.parent.mesh, mesh.parent.interpolation)
    if mesh.dim == 2:
        return None
    vertices = sp.eye_array(mesh.number_of_nodes, format="csr")
    middles = sp.csr_array(0.5 * (vertices[mesh.edges[:, 0]] + vertices[mesh.edges[:, 1]]))
    return mesh, sp.csr_array(sp.vstack([vertices, middles]))


def has_coarser(problem: DiscreteProblem) -> bool:
    """Whether there are coarser linear elements below those of a problem."""
    field = problem.field
    if field is None or problem.origin is None:
        return False
    return field.mesh.parent is not None if field.order == 1 else field.mesh.dim == 3


def coarser(problem: DiscreteProblem) -> Coarser | None:
    """The same contact problem with the next coarser linear elements; None where there are none.

    Stiffness and weights are those of the coarser mesh, the load is what the prolongation makes of the finer one, and
    gap and law are taken over at the nodes that both meshes share: so a load, a gap or a law that was changed after
    discretisation counts as well.  The matrix of a step in time is combined as on the finer mesh, and not assembled.
    """
    field, statement = problem.field, problem.origin
    if not has_coarser(problem):
        return None
    assert field is not None
    assert statement is not None
    if isinstance(problem.model.parts, Composition):
        return _coarser_in_time(problem, problem.model.parts)
    if isinstance(problem.model.parts, Tangent):
        return _coarser_tangent(problem, problem.model.parts)
    if isinstance(problem.model.parts, Stressed):
        return _coarser_stressed(problem, problem.model.parts)
    below = _below(field)
    assert below is not None
    mesh, interpolation = below
    shared = _nodes_of_both(interpolation)
    nodal = sp.csr_array(sp.kron(interpolation, sp.eye_array(field.components), format="csr"))
    pairs = _pairs(problem, interpolation, nodal)
    start = field.prescribed.reshape(-1, field.components)[shared]
    coarse = coarse_problem(on_coarser(statement, mesh), start, pairs)
    assert coarse.field is not None
    prolongation = sp.csr_array(field.lift @ nodal @ coarse.field.basis)
    prolongation.data[np.abs(prolongation.data) < ROUNDED] = 0.0
    prolongation.eliminate_zeros()
    points = _shared_points(problem.contact, coarse.contact, interpolation)
    step = Coarser(coarse, prolongation, field, points, pairs, interpolation=interpolation)
    return replace(step, problem=step.on_coarse_mesh(problem))


def _pairs(problem: DiscreteProblem, interpolation: sp.csr_array, nodal: sp.csr_array) -> dict[str, BoundaryContact]:
    """Contact points of two bodies on the coarser mesh, by boundary.

    They are those of the finer mesh at the nodes that both meshes have: a jump of coarse displacements is what the
    finer mesh makes of it, and no coarse mortar projection is needed, of a surface that may have moved away.
    ``interpolation`` is that of values at nodes, and ``nodal`` of displacements.
    """
    field, statement, contact = problem.field, problem.origin, problem.contact
    assert field is not None
    assert statement is not None
    coarse_pairs = {}
    shared = _nodes_of_both(interpolation)
    number = np.full(interpolation.shape[0], -1)
    number[shared] = np.arange(shared.size)
    for name in contact.names:
        if not statement.contact[name].against:
            continue
        every = contact.on(name)
        weights = interpolation[contact.node[every]].T @ contact.weights[every]
        points = contact.take(every[number[contact.node[every]] >= 0])
        if not points.count:
            continue
        node = number[points.node]
        trace = sp.csr_array(points.trace @ field.lift @ nodal)
        blocked = (np.diff(points.trace.indptr) == 0).reshape(points.shape)
        assert points.mean is not None
        mean = sp.csr_array(points.mean @ interpolation)
        points = replace(points, trace=trace, weights=weights[node], node=node, mean=mean)
        law = statement.contact[name].law.at(points.points)
        rest = np.zeros(points.count)
        still = np.zeros((points.count, points.components - 1 if points.frames is None else field.mesh.dim))
        coarse_pairs[name] = BoundaryContact(points, rest, still, law, blocked, pair=True)
    return coarse_pairs


def _coarser_tangent(problem: DiscreteProblem, tangent: Tangent) -> Coarser | None:
    """That of a linear body in the place of another one: the other one is made on the coarser mesh once."""
    bulk = cast(Potential, tangent.problem.bulk)
    step = cast("Coarser | None", bulk.known.once("coarser", lambda: coarser(tangent.problem)))
    if step is None:
        return None
    coarse = tangent_problem(step.problem, step.restrict(tangent.unknowns))
    assert problem.field is not None
    step = replace(step, problem=coarse, field=problem.field)
    return replace(step, problem=step.on_coarse_mesh(problem))


def _coarser_stressed(problem: DiscreteProblem, parts: Stressed) -> Coarser | None:
    """That of a body under stress: the stress is that of the same displacement."""
    step = coarser(parts.problem)
    if step is None:
        return None
    step = replace(step, problem=stressed_problem(step.problem, step.restrict(parts.unknowns)))
    return replace(step, problem=step.on_coarse_mesh(problem))


def tangent_problem(problem: DiscreteProblem, u: Array) -> DiscreteProblem:
    """The problem with the linear body that has the stiffness of its body at unknowns (n,)."""
    bulk = cast(Potential, problem.bulk)
    return problem.fitted(replace(problem.model, bulk=bulk.tangent(u), parts=Tangent(problem, u)))


def _stated_load(problem: DiscreteProblem) -> Array:
    """The load (n,) apart from the internal forces of the prescribed displacements, of a body that is not linear."""
    bulk = problem.bulk
    return problem.load + bulk.initial_forces if isinstance(bulk, Potential) else problem.load


def _initial_forces(problem: DiscreteProblem) -> Array | float:
    return problem.bulk.initial_forces if isinstance(problem.bulk, Potential) else 0.0


def _coarser_in_time(problem: DiscreteProblem, parts: Composition) -> Coarser | None:
    """That of a step in time: the family on the coarser mesh is made once for all steps."""
    known = parts.family.known.once("coarser", lambda: _coarser_family(parts.family))
    if known is None:
        return None
    step, family = cast(tuple[Coarser, OperatorFamily], known)
    assert problem.field is not None
    assert step.interpolation is not None
    shared = _nodes_of_both(step.interpolation)
    coarse = step.problem.fitted(parts.of(family, shared).model(problem.model.resisted))
    step = replace(step, problem=coarse, field=problem.field)
    return replace(step, problem=step.on_coarse_mesh(problem))


def _coarser_family(family: OperatorFamily) -> tuple[Coarser, OperatorFamily] | None:
    step = coarser(family.problem)
    return None if step is None else (step, family_of(step.problem, family.mass is not None, step.pairs))


def family_of(
    problem: DiscreteProblem, inertia: bool, pairs: Mapping[str, BoundaryContact] | None = None
) -> OperatorFamily:
    """The matrices in time of an elastic body that was discretised, with its mass if that is asked for.

    ``pairs`` are the contact points of two bodies on a coarser mesh.
    """
    stated = problem.origin
    assert stated is not None
    return body_family(stated, problem, with_mass=inertia, pairs=pairs)


def _shared_points(fine: ContactPoints, coarse: ContactPoints, interpolation: sp.csr_array) -> IntArray:
    """The finer contact point at the node and on the boundary of each coarser one."""
    same = _nodes_of_both(interpolation)
    many = len(fine.names) + 1
    keys = fine.node * many + fine.boundary
    order = np.argsort(keys)
    wanted = same[coarse.node] * many + coarse.boundary
    return np.asarray(order[np.searchsorted(keys[order], wanted)], dtype=np.int64)


def _nodes_of_both(interpolation: sp.csr_array) -> IntArray:
    """The finer node at the place of each coarser one."""
    kept = np.flatnonzero(np.diff(interpolation.indptr) == 1)
    same = np.full(interpolation.shape[1], -1)
    same[interpolation.indices[interpolation.indptr[kept]]] = kept
    return same
