"""What an admissible stress of a body must fulfil: loads of cells and facets, and what the supports leave unknown.

Integrals of stresses are those of the discretisation, rule by rule, so that the equilibrium of the nodes that a
discrete solution fulfils is that of the data here. Loads are those that were stated; what the assembled ones miss is
known.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import TypeVar, cast

import numpy as np

from hemivar.basics.arrays import real_array
from hemivar.basics.first_use import cached_property
from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.bounds.bare_body import held_facets
from hemivar.bounds.cell_kinds import CellKinds, cell_kinds
from hemivar.bounds.facet_table import FacetTable, facet_table, facet_vertices
from hemivar.bounds.joined_sides import joined_sides
from hemivar.bounds.load_values import LoadValues, load_values
from hemivar.bounds.roundings import CONSTANT
from hemivar.bounds.split_element import facet_mass, pulled_back, voigt
from hemivar.errors import ProblemError
from hemivar.fem.constitutive import elastic
from hemivar.fem.elements import shape_derivatives, shape_values
from hemivar.fem.quadrature import quadrature_rule, region_masks
from hemivar.kernels.cell_strains import cell_strains
from hemivar.mechanics.composed_material import lower_elasticity
from hemivar.mechanics.conditions import DataField, Pressure, stated_values
from hemivar.mechanics.kinematics import voigt_index
from hemivar.mechanics.material import Material
from hemivar.mechanics.statement import ContactProblem
from hemivar.mesh.keys import EDGES
from hemivar.mesh.mesh import Mesh
from hemivar.systems.workspace import Workspace

__all__ = ["BodyData", "CellEnergy", "VaryingLoads", "body_data", "cell_energy", "exact_loads"]

T = TypeVar("T")
#: Of points, strains and masks of regions.
_Values = Callable[[Array, Array, Mapping[str, BoolArray] | None], Array]


@dataclass(frozen=True, eq=False)
class VaryingLoads:
    """Loads that are functions of the place."""

    body: LoadValues | None
    tractions: Mapping[str, tuple[IntArray, LoadValues]]  # (facets, LoadValues)
    #: By how much the loads of the nodes are more than those of the discrete problem, which is assembled by a rule.
    missed: Array  # (nodes, d)
    #: By how much the loads against the linear functions of the vertices may be off; 0 at midpoints.
    unknown: Array  # (nodes,)

    @classmethod
    def none(cls, missed: Array) -> VaryingLoads:
        """No such load, with as many nodes as there are in ``missed``."""
        return cls(None, {}, np.zeros(missed.shape), np.zeros(len(missed)))

    @property
    def doubts(self) -> list[str]:
        """Why what is known of them is no bound, one sentence each."""
        named = [] if self.body is None else [("body_force", self.body)]
        named += [(f"tractions['{name}']", values) for name, (_, values) in self.tractions.items()]
        return [f"{name} {values.doubt}" for name, values in named if values.doubt]


class Kept(dict[object, object]):
    """What can be made again: it does not travel to other processes."""

    def __reduce__(self) -> tuple[type[Kept], tuple[()]]:
        return Kept, ()


@dataclass(frozen=True, eq=False)
class BodyData:
    """Data of a body for the stresses of one displacement.

    The l nodes of a cell and the k nodes of a facet are its vertices and, with quadratic elements, its midpoints behind
    them: l = d + 1 and k = d, or 6 and 3.
    """

    problem: ContactProblem
    table: FacetTable
    displacement: Array  # (nodes, d)
    #: Of the cells with their vertices sorted.
    cell_nodes: IntArray  # (M, l)
    facet_nodes: IntArray  # (F, k)
    #: The same on the other side where two bodies touch; those of ``facet_nodes`` elsewhere.
    opposite: IntArray  # (F, k)
    #: The linear part of ``C eps`` on each cell, at its vertices; all of it where C is constant on the cell. Of a
    #: material that is not linear ``W'(eps)``.
    stresses: Array  # (M, d + 1, d, d)
    #: Elasticity matrices at the points of the rule of the stiffness, and ``weights``, shape (q or 1,), of the rule; of
    #: a material that is not linear its lower tensor C_low.
    tensors: Array  # (M or 1, q or 1, v, v)
    weights: Array  # (q or 1,)
    #: ``int_T C eps grad phi_a``.
    forces: Array  # (M, l, d)
    #: ``int_T f0 phi_a``.
    loads: Array  # (M, l, d)
    #: ``int_F f_N phi_a`` of the tractions that are given, on the facets that are not inside.
    outer_loads: Array  # (b, k, d)
    #: The loads that are no constants.
    varying: VaryingLoads
    #: Projections on the components of tractions that nothing prescribes, all of them inside and those along which
    #: supports hold the body on its boundary; and which of them is that of each facet.
    projections: Array  # (p, d, d)
    projected: IntArray  # (F,)
    #: The place of the contact boundary in ``problem.contact``, or -1.
    contact: IntArray  # (F,)
    #: The stored energy of a material that is not linear.
    stored: CellEnergy | None = None
    #: What belongs to mesh and material, under names; see :meth:`once`.
    kept: Kept = field(default_factory=Kept, compare=False, repr=False)

    @property
    def order(self) -> int:
        """Degree of the displacement."""
        return self.problem.order

    @cached_property
    def strains(self) -> Array:
        """Of the displacement at the vertices of the cells, between which it is linear, shape (M, d + 1, d, d)."""
        return _strains(self.table, self.order, self.displacement, self.cell_nodes)

    @property
    def strain(self) -> Array:
        """Mean strain of each cell, shape (M, d, d)."""
        return self._mean(self.strains)

    @property
    def stress(self) -> Array:
        """Mean over each cell of ``C eps``, shape (M, d, d)."""
        return self._mean(self.stresses)

    def _mean(self, values: Array) -> Array:
        return np.asarray(values[:, 0] if self.order == 1 else values.mean(axis=1))

    @property
    def engineering(self) -> Array:
        """Mean strain of each cell as a vector with engineering shear strains, shape (M, v)."""
        return _engineering(self.strain)

    @cached_property
    def varies(self) -> bool:
        """Whether the elasticity matrix varies within cells."""
        return _varies(self.tensors)

    @cached_property
    def compliance(self) -> Array:
        """Inverses of the mean elasticity matrices, shape (M or 1, v, v)."""
        return np.linalg.inv(np.einsum("q,mqvw->mvw", self.weights, self.tensors))

    @cached_property
    def sweep_compliance(self) -> Array:
        """By which patches are improved, (M or 1, v, v): of a material that is not linear the inverse tangents."""
        if self.stored is None:
            return self.compliance
        return np.asarray(np.linalg.inv(self.stored.tangent(self.engineering[:, None])[:, 0]))

    @cached_property
    def reference_compliance(self) -> Array:
        """The same on the reference simplex, shape (M, v, v)."""
        return pulled_back(self.sweep_compliance, self.table.jacobian, self.table.sizes)

    @cached_property
    def kinds(self) -> CellKinds:
        """The kinds of cells by these matrices."""
        if self.stored is not None:  # which depends on the displacement
            return cell_kinds(self.table, self.sweep_compliance)
        return self.once("kinds", lambda: cell_kinds(self.table, self.compliance))

    def once(self, key: object, make: Callable[[], T]) -> T:
        """What depends on the mesh, on a linear material and on the key alone: made on the first call.

        Data of other displacements, loads and laws share it, and bounds that share a workspace. Threads that ask at
        once may each make it.
        """
        if key not in self.kept:
            self.kept[key] = make()
        return cast(T, self.kept[key])

    @property
    def energy(self) -> float:
        """``|u|_a^2 = int C eps : eps``."""
        if self.stored is None:
            return max(float(np.einsum("mad,mad->", self.forces, self.displacement[self.cell_nodes])), 0.0)
        mean, strain = np.einsum("q,mqvw->mvw", self.weights, self.tensors), self.engineering
        mean = np.broadcast_to(mean, (len(strain), *mean.shape[1:]))
        return float(np.einsum("m,mv,mvw,mw->", self.table.volumes, strain, mean, strain, optimize=True))

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

    def jump(self, values: Array, facets: IntArray) -> Array:
        """What is seen at the nodes of contact facets of a field (nodes, ...): that of the body, (k, l, ...).

        Where two bodies touch it is that of the first less that of the second.
        """
        jump = values[self.facet_nodes[facets]]
        cut = self.table.cut[facets]
        jump[cut] -= values[self.opposite[facets[cut]]]
        return np.asarray(jump)

    def loads_on(self, facets: IntArray) -> Array:
        """``int_F f_N phi_a`` (..., k, d) of facets that are not inside."""
        return np.asarray(self.outer_loads[self.table.outer_places[facets]])

    @property
    def facet_loads(self) -> Array:
        """Those of all facets, (F, k, d)."""
        loads = np.zeros((len(self.table.facets), *self.outer_loads.shape[1:]))
        loads[self.table.outer] = self.outer_loads
        return loads

    def freed(self, facets: IntArray | slice) -> Array:
        """Projections (..., d, d) on the components of the tractions of facets that nothing prescribes."""
        return np.asarray(self.projections[self.projected[facets]])

    @property
    def unknown(self) -> Array:
        """Those of all facets, (F, d, d)."""
        return self.freed(slice(None))

    def at_nodes(self, facets: IntArray, moments: Array) -> Array:
        """Nodal sums (nodes, d) of moments (k, l, d) on facets; where two bodies touch also the opposite ones."""
        sums = np.zeros(self.displacement.shape)
        np.add.at(sums, self.facet_nodes[facets], moments)
        cut = self.table.cut[facets]
        np.subtract.at(sums, self.opposite[facets[cut]], moments[cut])
        return sums

    def under(self, moments: Array) -> BodyData:
        """The data without contact, under contact tractions of these moments (F, k, d) as loads."""
        loads = self.outer_loads + moments[self.table.outer]
        return replace(self, outer_loads=loads, contact=np.full(len(self.contact), -1))

    @cached_property
    def _nodes(self) -> Array:
        return self.problem.mesh.nodes(self.order)

    def at(self, displacement: Array) -> BodyData:
        """The same where it is that of this displacement already, :meth:`moved` otherwise."""
        return self if np.array_equal(displacement, self.displacement) else self.moved(displacement)

    def moved(self, displacement: Array) -> BodyData:
        """The data of another displacement (nodes, d) of the same problem."""
        stresses, forces = _stresses(
            self.table, self.order, displacement, self.cell_nodes, self.tensors, self.weights, self.stored
        )
        return replace(self, displacement=displacement, stresses=stresses, forces=forces)

    def linear(self, loads: Array) -> Array:
        """Loads (M, d + 1, d) against linear functions of those against the functions of the nodes, (M, l, d)."""
        if self.order == 1:
            return loads
        return np.asarray(np.einsum("va,mai->mvi", _linear_values(self.table.dim), loads))


def exact_loads(data: BodyData) -> BodyData:
    """The data of a displacement that is not taken for one of the discrete problem: no load counts as missed there."""
    varying = data.varying
    return replace(data, varying=replace(varying, missed=np.zeros(varying.missed.shape)))


def _linear_values(dim: int) -> Array:
    """Values (d + 1, l) of the linear functions of the vertices at the nodes of order 2."""
    corners = np.eye(dim + 1)
    pairs = EDGES[dim] if dim > 1 else ((0, 1),)
    return np.vstack([corners, [0.5 * (corners[a] + corners[b]) for a, b in pairs]]).T


def _engineering(strain: Array) -> Array:
    """Strains (M, d, d) as vectors (M, v) with engineering shear strains."""
    vectors = voigt(strain)
    vectors[:, strain.shape[1] :] *= 2.0
    return vectors


def _varies(tensors: Array) -> bool:
    first = tensors[:, :1]
    return bool(np.abs(tensors - first).max() > CONSTANT * np.abs(first).max())


def body_data(problem: ContactProblem, displacement: Array, workspace: Workspace | None = None) -> BodyData:
    """The data of a problem with linear elements, or quadratic ones in the plane, and a displacement, (nodes, d).

    A workspace keeps what belongs to mesh and material.
    """
    mesh, order, material = problem.mesh, problem.order, problem.material
    if order != 1 and not material.linear:
        raise ProblemError(
            "the distance to the exact solution of a body that is not linear is bounded with linear elements; take "
            "order = 1"
        )
    if order != 1 and mesh.dim != 2:
        raise ProblemError("in 3D admissible stresses are made of linear elements; use order = 1")
    if callable(problem.bedding) or problem.bedding:
        raise ProblemError("admissible stresses are made of bodies without bedding; leave the bedding out")
    if len(problem.held_boundaries) < len(problem.supports):
        raise ProblemError(
            "admissible stresses are made of bodies held on boundaries, not at points, by springs or plates; hold a "
            "boundary, or compare with a finer mesh"
        )
    if problem.ties:
        raise ProblemError(
            "admissible stresses are made of bodies without ties; make one mesh of what is tied, or compare with a "
            "finer mesh"
        )
    if problem.initially_stressed:
        raise ProblemError(
            "admissible stresses are made of bodies without initial stress or strain; leave it out, or compare with a "
            "finer mesh"
        )
    u = real_array(displacement, "the displacement")
    count = mesh.number_of_nodes + (len(mesh.edges) if order == 2 else 0)
    if u.shape != (count, mesh.dim):
        raise ProblemError(f"the displacement has shape {u.shape}; a field of order {order} on this mesh has shape "
                           f"{(count, mesh.dim)}")  # fmt: skip
    sides = joined_sides(problem) or ()
    cells = (mesh.points, mesh.cells, *sides)
    table = facet_table(mesh, *sides) if workspace is None else workspace.once(
        "facets", cells, lambda: facet_table(mesh, *sides)
    ).on(mesh)  # fmt: skip
    facet_nodes, opposite = (np.asarray(mesh.facet_nodes(facets, order)) for facets in (table.facets, table.others))
    cell_nodes = table.cells
    if order == 2:
        middle = np.empty(table.cells.shape, dtype=np.int64)
        first = table.signs > 0.0
        midpoints = np.where(first, facet_nodes[table.cell_facets, 2], opposite[table.cell_facets, 2])
        middle[:, facet_vertices(2, 2)[:, 2] - 3] = midpoints
        cell_nodes = np.hstack([table.cells, middle])
    law = elastic(lower_elasticity(material), mesh.dim)
    tensor, weights = law.on(mesh, 2 * order, vertices=None if order == 1 else table.cells)
    stored = None if material.linear else cell_energy(material, mesh, table.cells, 2 * order)
    stresses, forces = _stresses(table, order, u, cell_nodes, tensor, weights, stored)
    kept = Kept()
    if workspace is not None and stored is None:
        kept = workspace.once("patches", (*cells, tensor, weights, np.array(order)), Kept)
    contact = np.full(len(table.facets), -1, dtype=np.int64)
    for number, name in enumerate(problem.contact):
        contact[table.numbers(mesh.boundaries[name])] = number
    return BodyData(
        problem, table, u, cell_nodes, facet_nodes, opposite, stresses, tensor, weights, forces,
        *_loads(problem, table, cell_nodes, facet_nodes, count), *_projections(problem, table), contact, stored, kept,
    )  # fmt: skip


def _stresses(
    table: FacetTable,
    order: int,
    displacement: Array,
    cell_nodes: IntArray,
    tensor: Array,
    weights: Array,
    stored: CellEnergy | None,
) -> tuple[Array, Array]:
    """The linear part of the stresses at the vertices (M, d + 1, d, d), and forces (M, l, d)."""
    dim, corners = table.dim, table.dim + 1
    index = voigt_index(dim)
    shape = (len(cell_nodes), corners, dim, dim)
    mean = np.einsum("q,mqvw->mvw", weights, tensor)
    if order == 1 and stored is None:
        compiled = cell_strains(displacement, cell_nodes, table.gradients, table.sizes, mean)
        if compiled is not None:
            stresses, forces = compiled
            return np.broadcast_to(stresses[:, None], shape), forces
    strains = _strains(table, order, displacement, cell_nodes)

    def stress(matrix: Array, strain: Array) -> Array:
        full = np.broadcast_to(matrix[:, index[:, :, None, None], index], (len(cell_nodes), *(dim,) * 4))
        return np.asarray(np.einsum("mijkl,m...kl->m...ij", full, strain, optimize=True))

    constant = order == 1 or not _varies(tensor)
    if order == 1:
        if stored is None:
            stresses = stress(mean, strains[:, 0])
        else:
            stresses = stored.stress(_engineering(strains[:, 0])[:, None])[:, 0][:, index]
        forces = (table.volumes[:, None, None] * table.gradients) @ stresses  # which are symmetric
        return np.broadcast_to(stresses[:, None], shape), forces
    points, weights = quadrature_rule(dim, 2 if constant else 2 * order)
    stresses, forces, moments = stress(mean, strains), np.zeros((*cell_nodes.shape, dim)), np.zeros(shape)
    for q, (point, weight) in enumerate(zip(points, weights, strict=True)):
        here = np.einsum("a,maij->mij", point, stresses)
        if not constant:
            here = stress(tensor[:, q], np.einsum("a,maij->mij", point, strains))
        slopes = np.einsum("ab,mbj->maj", shape_derivatives(order, point), table.gradients)
        forces += weight * np.einsum("m,mij,maj->mai", table.volumes, here, slopes, optimize=True)
        moments += weight * point[:, None, None] * here[:, None]
    if not constant:  # against the mass matrix of linear functions
        stresses = corners * ((corners + 1) * moments - moments.sum(axis=1, keepdims=True))
    return stresses, forces


def _strains(table: FacetTable, order: int, displacement: Array, cell_nodes: IntArray) -> Array:
    """Of a displacement at the vertices of the cells, shape (M, d + 1, d, d)."""
    u, corners = displacement[cell_nodes], table.dim + 1

    def strain(point: Array) -> Array:
        slopes = table.gradients
        if order > 1:
            slopes = np.einsum("ab,mbj->maj", shape_derivatives(order, point), slopes)
        gradient = u.transpose(0, 2, 1) @ slopes
        return np.asarray(0.5 * (gradient + gradient.transpose(0, 2, 1)))

    if order == 1:
        constant = strain(np.full(corners, 1.0 / corners))[:, None]
        return np.broadcast_to(constant, (len(u), corners, table.dim, table.dim))
    return np.stack([strain(corner) for corner in np.eye(corners)], axis=1)


def _loads(
    problem: ContactProblem, table: FacetTable, cell_nodes: IntArray, facet_nodes: IntArray, count: int
) -> tuple[Array, Array, VaryingLoads]:
    """Loads of cells (M, l, d) and of outer facets (b, k, d), and what of them varies."""
    mesh, order, force = problem.mesh, problem.order, problem.body_force
    dim = mesh.dim
    body = None
    cells, pushed = np.zeros((*cell_nodes.shape, dim)), np.zeros((len(table.outer), facet_nodes.shape[1], dim))
    missed, unknown = np.zeros((count, dim)), np.zeros(count)
    if callable(force):
        corners = mesh.points[table.cells]
        body = load_values(force, corners, table.volumes, "body_force")
        cells += body.moments(len(cells), order)
        point, weight = quadrature_rule(dim, 4)
        places = np.einsum("qa,mad->mqd", point, corners)
        values = DataField(force, "body_force", dim).at(places.reshape(-1, dim)).reshape(places.shape)
        _add_missed(missed, cell_nodes, cells, point, weight, table.volumes, order, values)
        np.add.at(unknown, table.cells, body.unknown(len(cells)))
    else:
        value = DataField(force, "body_force", dim).at(mesh.points[:1])[0]
        barycentric, weights = quadrature_rule(dim, order)
        shares = np.full(dim + 1, 1.0 / (dim + 1)) if order == 1 else weights @ shape_values(order, barycentric)
        flat = np.outer(shares, value).ravel()  # one long row for each cell, which NumPy multiplies fast
        np.multiply(table.volumes[:, None], flat, out=cells.reshape(len(cells), -1))
    tractions = {}
    point, weight = quadrature_rule(dim - 1, 5)
    shares = weight @ shape_values(order, point)
    for name, traction in problem.tractions.items():
        (given,), what = stated_values(traction).values(), f"tractions['{name}']"
        number = np.unique(table.numbers(mesh.boundaries[name]))
        row = table.outer_places[number]
        measures, normals = table.measures[number], table.normals_of(number)
        pushes = isinstance(traction, Pressure)
        if not callable(given):
            flat = mesh.points[table.facets[number, 0]]
            force = (
                -DataField(given, what).at(flat)[:, None] * normals if pushes else DataField(given, what, dim).at(flat)
            )
            pushed[row] += measures[:, None, None] * shares[:, None] * force[:, None]
            continue
        corners = mesh.points[table.facets[number]]
        loads = load_values(given, corners, measures, what, normals if pushes else None)
        own = loads.moments(len(number), order)
        pushed[row] += own
        tractions[name] = number, loads
        places = np.einsum("qa,kad->kqd", point, corners)
        flat = places.reshape(-1, dim)
        if pushes:
            values = -DataField(given, what).at(flat).reshape(places.shape[:2])[:, :, None] * normals[:, None]
        else:
            values = DataField(given, what, dim).at(flat).reshape(places.shape)
        _add_missed(missed, facet_nodes[number], own, point, weight, measures, order, values)
        np.add.at(unknown, table.facets[number], loads.unknown(len(number)))
    return cells, pushed, VaryingLoads(body, tractions, missed, unknown)


def _add_missed(
    missed: Array, nodes: IntArray, loads: Array, point: Array, weight: Array, measures: Array, order: int,
    values: Array,
) -> None:  # fmt: skip
    """Add to nodes what loads (k, l, d) are more than the rule of the assembly finds by values (k, q, d)."""
    local = np.einsum("q,qa,kqd,k->kad", weight, shape_values(order, point), values, measures, optimize=True)
    np.add.at(missed, nodes, loads - local)


def _projections(problem: ContactProblem, table: FacetTable) -> tuple[Array, IntArray]:
    """The one of all facets inside and those of the others, and which of them is that of each facet."""
    held, which = held_facets(problem, table, table.outer), np.zeros(len(table.facets), dtype=np.int64)
    which[table.outer] = 1 + np.arange(len(table.outer))
    return np.concatenate([np.eye(table.dim)[None], held]), which


@dataclass(frozen=True, eq=False)
class CellEnergy:
    """A stored energy W at places of cells: where it varies within a cell, its mean by a rule of integration."""

    material: Material
    places: Array  # (M, p, d)
    weights: Array  # (p,)
    regions: Mapping[str, BoolArray]  # (M,)

    def at(self, cells: slice) -> CellEnergy:
        """Of some cells."""
        regions = {name: mask[cells] for name, mask in self.regions.items()}
        return CellEnergy(self.material, self.places[cells], self.weights, regions)

    def value(self, strain: Array) -> Array:
        """W (M, q) at strains (M, q, v), with engineering shear strains."""
        return self._mean(self.material.energy, strain)

    def stress(self, strain: Array) -> Array:
        """Its derivative (M, q, v) by the strain."""
        return self._mean(self.material.stress, strain)

    def tangent(self, strain: Array) -> Array:
        """Its second derivative (M, q, v, v)."""
        return self._mean(self.material.tangent, strain)

    def lower(self) -> Array:
        """C_low of each cell, shape (M, v, v)."""
        strain = np.zeros((len(self.places), 1, 1))
        tensors = self._mean(lambda places, _, regions: self.material.lower_tensor(places, regions), strain)
        return np.asarray(tensors[:, 0])

    def _mean(self, values: _Values, strain: Array) -> Array:
        count, many, _ = strain.shape
        masks = {name: np.repeat(mask, many) for name, mask in self.regions.items()}
        flat = strain.reshape(count * many, -1)
        total: Array | None = None
        for points, weight in zip(self.places.transpose(1, 0, 2), self.weights, strict=True):
            part = weight * values(np.repeat(points, many, axis=0), flat, masks)
            total = part if total is None else total + part
        assert total is not None
        return np.asarray(total.reshape(count, many, *total.shape[1:]))


def cell_energy(material: Material, mesh: Mesh, vertices: IntArray, degree: int) -> CellEnergy:
    """That of cells, given by their vertices (M, d + 1): seen at centroids where the material is uniform."""
    barycentric, weights = quadrature_rule(mesh.dim, 1 if material.uniform else degree)
    places = np.einsum("pa,mad->mpd", barycentric, mesh.points[vertices])
    return CellEnergy(material, places, weights, region_masks(mesh))
