"""Stored energy of a nonlinear body, integrated: value, internal forces (residual) and tangent stiffness at a field."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp

from hemivar.basics.first_use import cached_property
from hemivar.basics.portable import PickleMixin
from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.fem.assembly import portions, stiffness_blocks
from hemivar.fem.constitutive import ConstitutiveLaw, EnergyLaw
from hemivar.fem.edge_blocks import EdgeBlocks, NodeGraph, node_graph
from hemivar.fem.elements import scaled_gradients, shape_derivatives
from hemivar.fem.mass import stated_bedding, with_ground
from hemivar.fem.mortar_basis import JumpUnknowns
from hemivar.fem.quadrature import at_quadrature_points, quadrature_rule
from hemivar.fem.springs import stated_springs
from hemivar.fem.unknowns import basis_of, matrix_of
from hemivar.mechanics.statement import ContactProblem
from hemivar.mesh.mesh import Mesh

__all__ = ["BeddedEnergy", "EnergyIntegral", "NodalEnergy", "bedded_energy"]


@dataclass(frozen=True, eq=False)
class NodalEnergy(PickleMixin):
    """``int W(strain(U))`` of nodal values U (nodes, c).

    Where W is the same all over a cell and elements are linear, one point of quadrature is exact; else the rule is of
    degree 2 (order 1) or 4 (order 2).
    """

    mesh: Mesh
    order: int
    law: EnergyLaw

    @cached_property
    def graph(self) -> NodeGraph:
        """Which nodes couple."""
        return node_graph(self.mesh, self.order)

    @cached_property
    def degree(self) -> int:
        """Of the rule of quadrature."""
        return 1 if self.order == 1 and self.law.uniform else 2 * self.order

    @cached_property
    def rule(self) -> tuple[Array, Array]:
        """Barycentric points (q, d + 1) and weights (q,)."""
        return quadrature_rule(self.mesh.dim, self.degree)

    def value(self, field: Array) -> float:
        """The energy."""
        total = 0.0
        for part in portions(self.mesh, self.order):
            density, weights = self.at(self.law.density.energy, self.strains(field, part)[0], part)
            total += float(self.mesh.volumes[part] @ (density @ weights))
        return total

    def forces(self, field: Array, cells: IntArray | None = None) -> Array:
        """Its derivative (nodes, c): the internal forces of all cells or of some."""
        count, components, strains = len(field), field.shape[1], self.law.strains
        total = np.zeros((components, count))
        nodes_of = self.mesh.cell_nodes(self.order)
        for part in portions(self.mesh, self.order) if cells is None else [cells]:
            strain, shapes = self.strains(field, part)
            stress, weights = self.at(self.law.density.stress, strain, part)
            nodes, volumes = nodes_of[part].T.ravel(), self.mesh.volumes[part]
            pulls = [[w * volumes * stress[:, q, s] for s in range(stress.shape[2])] for q, w in enumerate(weights)]
            for i in range(components):
                local = np.zeros((len(shapes[0]), len(volumes)))
                for h, pull in zip(shapes, pulls, strict=True):
                    for k in range(strains.shape[1]):
                        local += h[:, k] * pull[strains[i, k]]
                total[i] += np.bincount(nodes, local.ravel(), minlength=count)
        return np.ascontiguousarray(total.T)

    def blocks(self, field: Array) -> EdgeBlocks:
        """Its second derivative by nodes and edges: the stiffness at the field."""
        strains = self.law.strains
        return stiffness_blocks(self.mesh, _TangentLaw(strains, _not_by_points, False, self, field), self.graph)

    def bound(self, upper: bool) -> EdgeBlocks:
        """The stiffness of the upper tensor, or of the lower one."""
        density, law = self.law.density, self.law
        tensor = density.upper_tensor if upper else density.lower_tensor
        return stiffness_blocks(self.mesh, ConstitutiveLaw(law.strains, tensor, law.homogeneous), self.graph)

    @property
    def bounded_below(self) -> bool:
        """Whether a lower tensor is known in all cells."""
        tensors = (
            at_quadrature_points(self.mesh, self.degree, self.law.density.lower_tensor, part)[0]
            for part in portions(self.mesh, self.order)
        )
        return all(bool((np.einsum("mqii->mqi", tensor) > 0.0).all()) for tensor in tensors)

    def strains(self, field: Array, part: slice | IntArray) -> tuple[Array, list[Array]]:
        """Strains (k q, v) of some cells, by cells and points, one component after another in memory; and at each point
        the gradients (L, d, k) of the shape functions."""
        slopes = scaled_gradients(self.mesh, part, self.mesh.volumes[part])
        values = field.T[:, self.mesh.cell_nodes(self.order)[part].T]
        flat, shapes = slopes.reshape(len(slopes), -1), []
        strain = np.zeros((int(self.law.strains.max()) + 1, slopes.shape[2], len(self.rule[1])))
        for q, point in enumerate(self.rule[0]):
            h = slopes
            if self.order > 1:
                h = (shape_derivatives(self.order, point) @ flat).reshape(-1, *slopes.shape[1:])
            shapes.append(h)
            for (i, k), row in np.ndenumerate(self.law.strains):
                for node in range(len(h)):
                    strain[row, :, q] += h[node, k] * values[i, node]
        return strain.reshape(len(strain), -1).T, shapes

    def at(
        self, density: Callable[[Array, Array, dict[str, BoolArray]], Array], strain: Array, part: slice | IntArray
    ) -> tuple[Array, Array]:
        """A function of points, strains and regions at the points of some cells, (k, q, ...); and their weights."""
        if self.law.homogeneous:  # the points do not matter
            values = density(np.broadcast_to(self.mesh.points[:1], (len(strain), self.mesh.dim)), strain, {})
            return values.reshape(-1, len(self.rule[1]), *values.shape[1:]), self.rule[1]
        return at_quadrature_points(self.mesh, self.degree, lambda points, masks: density(points, strain, masks), part)


@dataclass(frozen=True, eq=False)
class BeddedEnergy(PickleMixin):
    """A stored energy of nodal values (nodes, c) with that of a bedding and of springs."""

    nodal: NodalEnergy
    ground: EdgeBlocks | None = None  # the stiffness of these, in components along the axes

    def value(self, field: Array) -> float:
        """The energy."""
        own = 0.0 if self.ground is None else 0.5 * float(np.vdot(field, self.ground.times(field)))
        return self.nodal.value(field) + own

    def forces(self, field: Array) -> Array:
        """Its derivative (nodes, c): internal forces and those of the bedding."""
        forces = self.nodal.forces(field)
        return forces if self.ground is None else forces + self.ground.times(field)

    def blocks(self, field: Array) -> EdgeBlocks:
        """Its second derivative by nodes and edges."""
        return self._with_ground(self.nodal.blocks(field))

    def bound(self, upper: bool) -> EdgeBlocks:
        """The stiffness of the upper tensor, or of the lower one."""
        return self._with_ground(self.nodal.bound(upper))

    def _with_ground(self, blocks: EdgeBlocks) -> EdgeBlocks:
        if self.ground is not None:
            np.add(blocks.diagonal, self.ground.diagonal, out=blocks.diagonal)
            np.add(blocks.upper, self.ground.upper, out=blocks.upper)
        return blocks


def bedded_energy(problem: ContactProblem) -> BeddedEnergy:
    """The energy of nodal values, with that of a bedding and of springs."""
    mesh = problem.mesh
    nodal = NodalEnergy(mesh, problem.order, EnergyLaw.of(problem.material, mesh.dim))
    free = stated_bedding(problem).none and not stated_springs(problem)
    ground = None if free else with_ground(problem, nodal.graph.zeros(problem.components), nodal.graph)
    return BeddedEnergy(nodal, ground)


@dataclass(frozen=True, eq=False)
class EnergyIntegral(PickleMixin):
    """The energy of the unknowns u (n,), ``int W(strain(P u + u0))``, with that of a bedding."""

    body: BeddedEnergy
    basis: sp.csr_array  # (nodes * c, n): P
    prescribed: Array  # (nodes, c): u0
    directions: Array | None  # (nodes, c, c): those of the components of every node
    free: BoolArray  # (nodes, c): which of them are unknowns
    jumps: JumpUnknowns | None = None  # unknowns that are jumps between bodies, in the place of some of these

    @property
    def unknowns(self) -> int:
        """Number of unknowns n."""
        return int(self.basis.shape[1])

    @property
    def origin(self) -> Array:
        """What is displaced at unknowns zero, by unknowns (n,): ``P'u0``, jumps made of it."""
        if self.jumps is None:
            return np.asarray(self.basis.T @ self.prescribed.ravel())
        assert self.directions is not None
        nodal = basis_of(self.directions, self.free)
        return np.asarray(self.jumps.back[self.jumps.kept] @ (nodal.T @ self.prescribed.ravel()))

    def field(self, u: Array) -> Array:
        """Nodal values ``P u + u0``, shape (nodes, c)."""
        return np.asarray((self.basis @ u).reshape(self.free.shape) + self.prescribed)

    def value(self, u: Array) -> float:
        """The energy at unknowns (n,)."""
        return self.field_value(self.field(u))

    def field_value(self, values: Array) -> float:
        """The energy of nodal values (nodes, c)."""
        return self.body.value(values)

    def forces(self, u: Array) -> Array:
        """Internal forces and those of the bedding on all nodes, (nodes, c)."""
        return self.field_forces(self.field(u))

    def field_forces(self, values: Array) -> Array:
        """Those of nodal values (nodes, c)."""
        return self.body.forces(values)

    def gradient(self, u: Array) -> Array:
        """Its derivative (n,)."""
        return np.asarray(self.basis.T @ self.forces(u).ravel())

    def from_field(self, values: Array) -> EnergyIntegral:
        """The same energy by the change of the unknowns from nodal values (nodes, c) on."""
        return replace(self, prescribed=values)

    def unstrained(self) -> tuple[sp.csr_array, Array]:
        """The stiffness (n, n) of the body without strain, and the forces (n,) of the prescribed values on it."""
        blocks = self.body.blocks(np.zeros(self.free.shape))
        force = self.basis.T @ blocks.times(self.prescribed).ravel()
        return self._reduced(blocks), np.asarray(force)

    def blocks(self, u: Array) -> EdgeBlocks:
        """Its second derivative by nodes and edges, in components along the axes."""
        return self.body.blocks(self.field(u))

    def hessian(self, u: Array) -> sp.csr_array:
        """Its second derivative (n, n), on the sparsity of the stiffness of a linear body."""
        return self._reduced(self.blocks(u))

    def lower(self) -> sp.csr_array | None:
        """The stiffness of the lower tensor (n, n); None where it is not known everywhere."""
        return self._reduced(self.body.bound(upper=False)) if self.body.nodal.bounded_below else None

    def upper(self) -> sp.csr_array:
        """The stiffness of the upper tensor (n, n)."""
        return self._reduced(self.body.bound(upper=True))

    def _reduced(self, blocks: EdgeBlocks) -> sp.csr_array:
        """The matrix (n, n) of blocks, which are used up."""
        return matrix_of(blocks, self.directions, self.free, self.jumps)


@dataclass(frozen=True, eq=False)
class _TangentLaw(ConstitutiveLaw):
    """The derivative of the stress at the strains of a field (nodes, c), at the points of the rule of the energy."""

    energy: NodalEnergy
    field: Array

    def on(
        self, mesh: Mesh, degree: int, cells: slice | IntArray = slice(None), vertices: IntArray | None = None
    ) -> tuple[Array, Array]:
        return self.energy.at(self.energy.law.density.tangent, self.energy.strains(self.field, cells)[0], cells)


def _not_by_points(points: Array, regions: object) -> Array:
    raise NotImplementedError("the derivative of the stress follows the field, cell by cell")
