"""Coarse levels of a matrix whose mesh nobody coarsened: meshes of one's own, in any order of their nodes."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse as sp
import scipy.sparse.linalg as spla

import hemivar as hv
from hemivar.fem.near_kernel import node_slots
from hemivar.linear.algebraic import near_each_other
from hemivar.linear.compiled import NodeSlots
from hemivar.linear.levels import COARSEST
from hemivar.mesh import Mesh, box
from hemivar.systems.body_on_levels import ElasticMultigrid
from tests import bodies
from tests.own_mesh import bracket_on_a_plate


def entries(matrices: list[sp.csr_array]) -> int:
    return sum(matrix.nnz for matrix in matrices)


@pytest.mark.parametrize(
    "size", [3.5, pytest.param(2.5, marks=pytest.mark.slow), pytest.param(1.8, marks=pytest.mark.slow)]
)
def test_a_body_from_gmsh_takes_as_many_cycles_as_one_of_the_library(size: float) -> None:
    """The work of a cycle is about that of the entries of all matrices and transfers, and of the coarsest inverse."""
    problem = hv.discretize(bracket_on_a_plate(size))
    elastic = ElasticMultigrid.of(problem)
    found, cycles = elastic.solve(problem.load, 1e-10)
    expected = spla.spsolve(sp.csc_array(problem.stiffness), problem.load)
    np.testing.assert_allclose(found, expected, atol=1e-8 * np.abs(expected).max())
    assert cycles <= 25
    levels = elastic.levels
    assert levels.sizes[0] <= COARSEST
    own = levels.matrix(len(levels.sizes) - 1)
    assert entries([level.matrix for level in levels.levels]) <= 2.0 * own.nnz
    assert entries([one.prolongation for one in levels.transfers]) <= own.nnz


def scattered(mesh: Mesh, seed: int) -> Mesh:
    """The same mesh with its nodes in any order."""
    number = np.random.default_rng(seed).permutation(len(mesh.points))
    points = np.empty_like(mesh.points)
    points[number] = mesh.points
    boundaries = {name: number[facets] for name, facets in mesh.boundaries.items()}
    return Mesh(points, number[mesh.cells], boundaries)


def test_the_order_of_the_nodes_costs_nothing() -> None:
    mesh = box((3.0, 1.0, 1.0), (17, 7, 7))  # odd: nothing is known of a coarser mesh
    cycles = []
    for one in (mesh, scattered(mesh, 0), scattered(mesh, 1)):
        problem = hv.discretize(bodies.body(one, tractions={"right": (0.0, 0.0, -1.0)}))
        cycles.append(ElasticMultigrid.of(problem).solve(problem.load, 1e-10)[1])
    assert max(cycles) <= min(cycles) + 2


def test_nodes_are_put_in_order_only_where_they_are_scattered() -> None:
    problem = hv.discretize(bracket_on_a_plate(3.5))
    given = node_slots(problem.field, problem.stiffness)
    assert given is not None
    K = problem.stiffness
    assert near_each_other(given, K) is given  # they were
    shuffled = np.random.default_rng(2).permutation(given.nodes)
    places = shuffled[given.places // given.size] * given.size + given.places % given.size
    again = near_each_other(NodeSlots(places, given.size, given.nodes, given.signs), K)
    assert again.serves(problem.unknowns)
    np.testing.assert_array_equal(again.places % 3, given.places % 3)
    np.testing.assert_array_equal(again.signs, given.signs)

    def spread(slots: NodeSlots) -> float:
        pairs = K.tocoo()
        node = slots.places // slots.size
        return float(np.abs(node[pairs.row] - node[pairs.col]).mean())

    assert spread(again) <= 1.1 * spread(given)
