"""What an admissible stress of a body must fulfil: loads of cells and facets, and what the supports leave unknown.

All integrals are those of the discretisation, rule by rule, so that the equilibrium of the nodes that a discrete
solution fulfils is that of the data here.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from hemivar.basics.arrays import real_array
from hemivar.basics.types import Array, IntArray
from hemivar.errors import ProblemError
from hemivar.fem.assembly import quadrature_rule, tensors
from hemivar.fem.elements import shape_derivatives, shape_values, voigt_index
from hemivar.fem.facet_table import FacetTable, facet_table, facet_vertices
from hemivar.fem.held_facets import held_facets
from hemivar.fem.split_element import facet_mass, pulled_back
from hemivar.mechanics.bedding import bedding_of
from hemivar.mechanics.conditions import Pressure, evaluate_scalar, evaluate_vector
from hemivar.mechanics.statement import ContactProblem
from hemivar.mesh.keys import EDGES

__all__ = ["BodyData", "body_data"]

#: Part of a modulus by which it may vary within a cell and count as constant.
_CONSTANT = 1e-13


@dataclass(frozen=True, eq=False)
class BodyData:
    """Data of a body for the stresses of one displacement.

    The l nodes of a cell and the k nodes of a facet are its vertices and, with quadratic elements, its midpoints behind
    them: l = d + 1 and k = d, or 6 and 3.

    Attributes
    ----------
    problem : ContactProblem
    table : FacetTable
    displacement : array, shape (nodes, d)
    cell_nodes : int array, shape (M, l)
        Of the cells with their vertices sorted.
    facet_nodes : int array, shape (F, k)
    strains : array, shape (M, d + 1, d, d)
        Of the displacement at the vertices of the cells, between which it is linear.
    stresses : array, shape (M, d + 1, d, d)
        The linear part of ``C eps`` on each cell, at its vertices; all of it where C is constant on the cell.
    tensors : array, shape (M or 1, q or 1, v, v)
        Elasticity matrices at the points of the rule of the stiffness, and ``weights``, shape (q or 1,), of the rule.
    weights : array, shape (q or 1,)
    forces : array, shape (M, l, d)
        ``int_T C eps grad phi_a``.
    loads : array, shape (M, l, d)
        ``int_T f0 phi_a``.
    facet_loads : array, shape (F, k, d)
        ``int_F f_N phi_a`` of the tractions that are given.
    unknown : array, shape (F, d, d)
        Projections on the components of the traction that nothing prescribes: all of them inside, those along which
        supports hold the body on its boundary.
    contact : int array, shape (F,)
        The place of the contact boundary in ``problem.contact``, or -1.
    """

    problem: ContactProblem
    table: FacetTable
    displacement: Array
    cell_nodes: IntArray
    facet_nodes: IntArray
    strains: Array
    stresses: Array
    tensors: Array
    weights: Array
    forces: Array
    loads: Array
    facet_loads: Array
    unknown: Array
    contact: IntArray

    @property
    def order(self) -> int:
        """Degree of the displacement."""
        return self.problem.order

    @property
    def strain(self) -> Array:
        """Mean strain of each cell, shape (M, d, d)."""
        return np.asarray(self.strains.mean(axis=1))

    @property
    def stress(self) -> Array:
        """Mean over each cell of ``C eps``, shape (M, d, d)."""
        return np.asarray(self.stresses.mean(axis=1))

    @cached_property
    def varies(self) -> bool:
        """Whether the elasticity matrix varies within cells."""
        return _varies(self.tensors)

    @cached_property
    def compliance(self) -> Array:
        """Inverses of the mean elasticity matrices, shape (M or 1, v, v)."""
        return np.linalg.inv(np.einsum("q,mqvw->mvw", self.weights, self.tensors))

    @cached_property
    def reference_compliance(self) -> Array:
        """The same on the reference simplex, shape (M, v, v)."""
        return pulled_back(self.compliance, self.table.jacobian, self.table.sizes)

    @property
    def energy(self) -> float:
        """``|u|_a^2 = int C eps : eps``."""
        return max(float(np.einsum("mad,mad->", self.forces, self.displacement[self.cell_nodes])), 0.0)

    @cached_property
    def cell_moments(self) -> Array:
        """Moments of the tractions of ``stresses`` on the facets of each cell, outward, shape (M, d + 1, k, d)."""
        table, dim = self.table, self.table.dim
        # int_F s nu phi = s (|F| nu) int phi / |F|, and |F| nu = -d |T| grad
        if self.order == 1:
            return np.asarray(np.broadcast_to(-self.forces[:, :, None], (len(self.forces), dim + 1, dim, dim)))
        normals = (-dim * table.volumes)[:, None, None] * table.gradients
        members, mixed = facet_vertices(dim), facet_mass(dim, self.order) @ _linear_values(dim - 1).T
        every = np.einsum("mvij,mfj->mfvi", self.stresses, normals)
        on_facets = every[:, np.arange(dim + 1)[:, None], members]
        return np.asarray(np.einsum("av,mfvi->mfai", mixed, on_facets))

    def places(self, facets: IntArray) -> Array:
        """Places (..., k, d) of the nodes of facets."""
        return np.asarray(self._nodes[self.facet_nodes[facets]])

    @cached_property
    def _nodes(self) -> Array:
        return self.problem.mesh.nodes(self.order)

    def moved(self, displacement: Array) -> BodyData:
        """The data of another displacement (nodes, d) of the same problem."""
        order, nodes = self.order, displacement[self.cell_nodes]
        strains, stresses, forces = _stresses(self.table, order, nodes, self.tensors, self.weights)
        return replace(self, displacement=displacement, strains=strains, stresses=stresses, forces=forces)

    def linear(self, loads: Array) -> Array:
        """Loads (M, d + 1, d) against linear functions of those against the functions of the nodes, (M, l, d)."""
        if self.order == 1:
            return loads
        return np.asarray(np.einsum("va,mai->mvi", _linear_values(self.table.dim), loads))


def _linear_values(dim: int) -> Array:
    """Values (d + 1, l) of the linear functions of the vertices at the nodes of order 2."""
    corners = np.eye(dim + 1)
    pairs = EDGES[dim] if dim > 1 else ((0, 1),)
    return np.vstack([corners, [0.5 * (corners[a] + corners[b]) for a, b in pairs]]).T


def _varies(tensors: Array) -> bool:
    first = tensors[:, :1]
    return bool(np.abs(tensors - first).max() > _CONSTANT * np.abs(first).max())


def body_data(problem: ContactProblem, displacement: Array) -> BodyData:
    """The data of a problem with linear elements, or quadratic ones in the plane, and a displacement, (nodes, d).

    Raises
    ------
    ProblemError
        Elements are quadratic in space, the body has a bedding, or the displacement has another shape.
    """
    mesh, order = problem.mesh, problem.order
    if order != 1 and mesh.dim != 2:
        raise ProblemError("admissible stresses are made of linear elements in space; take order = 1")
    if not bedding_of(problem.bedding).none:
        raise ProblemError("admissible stresses are made of bodies without bedding; leave the bedding out")
    u = real_array(displacement, "the displacement")
    count = mesh.number_of_nodes + (len(mesh.edges) if order == 2 else 0)
    if u.shape != (count, mesh.dim):
        raise ProblemError(f"the displacement has shape {u.shape}; a field of order {order} on this mesh has shape "
                           f"{(count, mesh.dim)}")  # fmt: skip
    table = facet_table(mesh)
    facet_nodes = np.asarray(mesh.facet_nodes(table.facets, order))
    cell_nodes = table.cells
    if order == 2:
        middle = np.empty(table.cells.shape, dtype=np.int64)
        middle[:, facet_vertices(2, 2)[:, 2] - 3] = facet_nodes[table.cell_facets][:, :, 2]
        cell_nodes = np.hstack([table.cells, middle])
    tensor, weights = tensors(mesh, problem.material, 2 * order, vertices=None if order == 1 else table.cells)
    strains, stresses, forces = _stresses(table, order, u[cell_nodes], tensor, weights)
    contact = np.full(len(table.facets), -1, dtype=np.int64)
    for number, name in enumerate(problem.contact):
        contact[table.numbers(mesh.boundaries[name])] = number
    return BodyData(
        problem, table, u, cell_nodes, facet_nodes, strains, stresses, tensor, weights, forces,
        _cell_loads(problem, cell_nodes), _facet_loads(problem, table, facet_nodes), _unknown(problem, table), contact,
    )  # fmt: skip


def _stresses(table: FacetTable, order: int, u: Array, tensor: Array, weights: Array) -> tuple[Array, Array, Array]:
    """Strains and the linear part of the stresses at the vertices (M, d + 1, d, d), and forces (M, l, d)."""
    dim, corners = table.dim, table.dim + 1
    index = voigt_index(dim)
    shape = (len(u), corners, dim, dim)

    def strain(point: Array) -> Array:
        slopes = table.gradients
        if order > 1:
            slopes = np.einsum("ab,mbj->maj", shape_derivatives(order, point), slopes)
        gradient = u.transpose(0, 2, 1) @ slopes
        return np.asarray(0.5 * (gradient + gradient.transpose(0, 2, 1)))

    def stress(matrix: Array, strain: Array) -> Array:
        full = np.broadcast_to(matrix[:, index[:, :, None, None], index], (len(u), *(dim,) * 4))
        return np.asarray(np.einsum("mijkl,m...kl->m...ij", full, strain, optimize=True))

    constant = order == 1 or not _varies(tensor)
    mean = np.einsum("q,mqvw->mvw", weights, tensor)
    if order == 1:
        strains = strain(np.full(corners, 1.0 / corners))
        stresses = stress(mean, strains)
        forces = (table.volumes[:, None, None] * table.gradients) @ stresses  # which are symmetric
        return np.broadcast_to(strains[:, None], shape), np.broadcast_to(stresses[:, None], shape), forces
    strains = np.stack([strain(corner) for corner in np.eye(corners)], axis=1)
    points, weights = quadrature_rule(dim, 2 if constant else 2 * order)
    stresses, forces, moments = stress(mean, strains), np.zeros(u.shape), np.zeros(shape)
    for q, (point, weight) in enumerate(zip(points, weights, strict=True)):
        here = np.einsum("a,maij->mij", point, stresses)
        if not constant:
            here = stress(tensor[:, q], np.einsum("a,maij->mij", point, strains))
        slopes = np.einsum("ab,mbj->maj", shape_derivatives(order, point), table.gradients)
        forces += weight * np.einsum("m,mij,maj->mai", table.volumes, here, slopes, optimize=True)
        moments += weight * point[:, None, None] * here[:, None]
    if not constant:  # against the mass matrix of linear functions
        stresses = corners * ((corners + 1) * moments - moments.sum(axis=1, keepdims=True))
    return strains, stresses, forces


def _cell_loads(problem: ContactProblem, cell_nodes: IntArray) -> Array:
    mesh, force = problem.mesh, problem.body_force
    dim, order = mesh.dim, problem.order
    barycentric, weights = quadrature_rule(dim, 4 if callable(force) else order)
    shapes = shape_values(order, barycentric)
    if not callable(force):
        value = evaluate_vector(force, mesh.points[:1], "body_force")[0]
        shares = np.full(dim + 1, 1.0 / (dim + 1)) if order == 1 else weights @ shapes
        return np.asarray(mesh.volumes[:, None, None] * shares[:, None] * value)
    places = np.einsum("qa,mad->mqd", barycentric, mesh.points[mesh.cells])
    values = evaluate_vector(force, places.reshape(-1, dim), "body_force").reshape(places.shape)
    local = np.einsum("q,qa,mqd,m->mad", weights, shapes, values, mesh.volumes, optimize=True)
    return _reordered(local, mesh.cell_nodes(order), cell_nodes)


def _reordered(values: Array, nodes: IntArray, wanted: IntArray) -> Array:
    """Values (k, l, d) at nodes (k, l) in another order of the same nodes."""
    place = np.take_along_axis(np.argsort(nodes, axis=1), np.argsort(np.argsort(wanted, axis=1), axis=1), axis=1)
    return np.asarray(np.take_along_axis(values, place[:, :, None], axis=1))


def _facet_loads(problem: ContactProblem, table: FacetTable, facet_nodes: IntArray) -> Array:
    mesh, order = problem.mesh, problem.order
    dim = mesh.dim
    loads = np.zeros((*facet_nodes.shape, dim))
    barycentric, weights = quadrature_rule(dim - 1, 5)
    for name, traction in problem.tractions.items():
        facets = mesh.boundaries[name]
        normals, measures = mesh.facet_normals(facets)
        places = np.einsum("qa,kad->kqd", barycentric, mesh.points[facets])
        flat, what = places.reshape(-1, dim), f"tractions['{name}']"
        if isinstance(traction, Pressure):
            values = -evaluate_scalar(traction.value, flat, what)[:, None] * np.repeat(normals, len(weights), axis=0)
        else:
            values = evaluate_vector(traction, flat, what)
        shapes = shape_values(order, barycentric)
        local = np.einsum("q,qa,kqd,k->kad", weights, shapes, values.reshape(places.shape), measures)
        number = table.numbers(facets)
        loads[number] += _reordered(local, mesh.facet_nodes(facets, order), facet_nodes[number])
    return loads


def _unknown(problem: ContactProblem, table: FacetTable) -> Array:
    unknown = held_facets(problem, table)
    unknown[table.interior] = np.eye(table.dim)
    return unknown
