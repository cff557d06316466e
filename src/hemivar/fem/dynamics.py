"""Matrices of a problem in time: stiffness, damping (viscosity), mass and those of branches, on one sparsity."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import cast

import numpy as np
import scipy.sparse as sp

from hemivar.basics.arguments import expect
from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.discrete.bulk import Quadratic
from hemivar.discrete.operator_family import OperatorFamily
from hemivar.discrete.operators import Multiple, Operator, of_arrays
from hemivar.discrete.potential import Potential
from hemivar.discrete.problem import DiscreteProblem
from hemivar.errors import ProblemError
from hemivar.fem.assembly import stiffness_blocks
from hemivar.fem.constitutive import ConstitutiveLaw, relaxing, viscous
from hemivar.fem.contact_points import BoundaryContact
from hemivar.fem.discretize import discretize
from hemivar.fem.edge_blocks import EdgeBlocks, node_graph
from hemivar.fem.energy_integral import EnergyIntegral
from hemivar.fem.mass import MassDensity, body_blocks, inertia, mass_blocks, per_volume
from hemivar.fem.mortar_basis import JumpUnknowns
from hemivar.fem.plates import stated_plates
from hemivar.fem.supports import supported_nodes
from hemivar.fem.unknowns import NodalConditions, matrix_of, nodal_conditions
from hemivar.mechanics.conditions import ScalarData, Support, stated_values
from hemivar.mechanics.statement import ContactProblem

__all__ = ["Reduction", "body_family", "moved_components"]


class Reduction:
    """Makes operators of a body of the blocks of its nodes and edges, on the sparsity of its stiffness."""

    def __init__(
        self,
        problem: DiscreteProblem,
        moved: IntArray,
        free: BoolArray,
        directions: Array | None = None,
        jumps: JumpUnknowns | None = None,
    ) -> None:
        assert problem.field is not None
        self.problem, self.moved, self.free, self.directions, self.jumps = problem, moved, free, directions, jumps
        if problem.unknowns != (int(free.sum()) if jumps is None else jumps.kept.size):
            raise ProblemError("the discrete problem does not belong to this problem; discretize this one")

    def stiffness(self, make: Callable[[], EdgeBlocks]) -> Operator:
        """The operator of the stiffness, which is that of the problem: that at rest of a body that is not linear.

        Its blocks are made where a support moves.
        """
        bulk = self.problem.bulk
        if isinstance(bulk, Potential):
            make = partial(cast(EnergyIntegral, bulk.energy).blocks, np.zeros(bulk.unknowns))
        return Operator(self.pattern, *self._coupled(make() if self.moved.size else None))

    @property
    def pattern(self) -> sp.csr_array:
        """The stiffness, on whose sparsity the others stand."""
        bulk = self.problem.bulk
        assert isinstance(bulk, Quadratic | Potential)
        return bulk.at_rest.stiffness

    def part(self, blocks: EdgeBlocks, of: Operator | None = None) -> Operator:
        """Another operator, a multiple of the one ``of`` if it is one up to rounding. The blocks are used up."""
        coupling, fixed = self._coupled(blocks)
        pattern, data = self.pattern, matrix_of(blocks, self.directions, self.free, self.jumps).data
        if of is not None:
            whole = Operator(of_arrays(data, pattern.indices, pattern.indptr), coupling, fixed)
            factor = whole.multiple_of(of)
            if factor is not None:
                return Multiple(of, factor)
        return Operator.like(pattern, data, coupling, fixed)

    def _coupled(self, blocks: EdgeBlocks | None) -> tuple[sp.csr_array, sp.csr_array]:
        assert self.problem.field is not None
        basis, count = self.problem.field.basis, len(self.moved)
        if blocks is None or not count:
            return sp.csr_array((basis.shape[1], count)), sp.csr_array((count, count))
        columns = blocks.columns(self.moved)
        return sp.csr_array(basis.T @ columns), sp.csr_array(columns[self.moved])


def body_family(
    problem: ContactProblem,
    discrete: DiscreteProblem | None = None,
    *,
    with_mass: bool = True,
    pairs: Mapping[str, BoundaryContact] | None = None,
) -> OperatorFamily:
    """The matrices of a problem: the stiffness is that of :func:`discretize`, the others stand on the same sparsity.

    The viscosity of heat is its capacity.
    """
    problem = expect(problem, ContactProblem, "what to make matrices of", "give the ContactProblem")
    discrete = discretize(problem, check_coercivity=False, evolving=True) if discrete is None else discrete
    material, mesh = problem.material, problem.mesh
    conditions, graph = nodal_conditions(problem, pairs), node_graph(mesh, problem.order)
    moved = moved_components(problem, conditions)
    reduction = Reduction(discrete, moved, conditions.free, conditions.directions, conditions.jumps)
    stiffness = reduction.stiffness(lambda: body_blocks(problem, graph))

    def made(law: ConstitutiveLaw) -> Operator:
        return reduction.part(stiffness_blocks(mesh, law, graph), stiffness)

    def massive(density: MassDensity) -> Operator:
        return reduction.part(mass_blocks(mesh, density, graph, graph.zeros(problem.components)))

    viscosity = made(viscous(material, mesh.dim)) if material.viscous else None
    if problem.material.capacity is not None:
        viscosity = massive(per_volume(problem.material.capacity, "capacity"))
    mass = massive(inertia(material)) if with_mass and material.inert else None
    times = material.relaxation_times
    branches = tuple((time, made(relaxing(material, i, mesh.dim))) for i, time in enumerate(times))
    return OperatorFamily(discrete, stiffness, viscosity, mass, branches, moved)


def moved_components(problem: ContactProblem, conditions: NodalConditions) -> IntArray:
    """Nodal components along which a support may move its node, or one that follows it; of heat all that are held."""
    # the balance of heat asks for all of them
    names = [name for name, support in problem.supports.items() if problem.thermal or _moves(support)]
    if not names:
        return np.zeros(0, dtype=np.int64)
    nodes = np.unique(np.concatenate([supported_nodes(problem, name)[0] for name in names]))
    at_nodes = np.zeros(conditions.free.shape, dtype=bool)
    at_nodes[nodes] = np.abs(conditions.supports.directions[nodes]).max(axis=1) > 0.0
    moved = at_nodes.ravel()
    if (followers := conditions.followers) is not None:
        plates = [plate.nodes for plate in stated_plates(problem) if plate.name in names]
        touched = abs(followers.rows) @ moved + np.isin(followers.node, np.concatenate([nodes[:0], *plates]))
        moved = moved | (abs(followers.move) @ touched > 0.0)
    return np.flatnonzero(moved)


def _moves(support: Support | ScalarData) -> bool:
    """Whether a support may displace what it holds."""
    return any(callable(value) or bool(np.any(np.asarray(value))) for value in stated_values(support).values())
