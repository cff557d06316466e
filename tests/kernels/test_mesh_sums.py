"""Edges and matrices of meshes by the compiled kernels, against those of NumPy."""

from __future__ import annotations

import pickle
from collections.abc import Callable, Iterator
from itertools import pairwise

import numpy as np
import pytest

import hemivar as hv
from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.fem.assembly import stiffness_blocks
from hemivar.fem.constitutive import ConstitutiveLaw, EnergyLaw, elastic
from hemivar.fem.edge_blocks import EdgeBlocks, node_graph
from hemivar.fem.energy_integral import NodalEnergy
from hemivar.kernels import kernels
from hemivar.kernels.mesh_sums import BlockGraph, mesh_edges
from hemivar.mesh import Mesh, box, rectangle
from hemivar.mesh.keys import EDGES, distinct_pairs

from ..mesh.meshes import cube, distorted

pytestmark = pytest.mark.skipif(kernels() is None, reason="the kernels are not compiled here")

MESHES: dict[str, Callable[[], Mesh]] = {
    "square": lambda: distorted(rectangle((2, 1), (40, 33), "cross")),
    "cube": lambda: distorted(cube(9)),
    "triangle": lambda: Mesh(np.array([[0.0, 0.0], [1.0, 0.2], [0.3, 2.0]]), np.array([[0, 1, 2]])),
    "tetrahedron": lambda: Mesh(np.vstack([np.zeros(3), np.diag([1.0, 2.0, 3.0])]), np.array([[0, 1, 2, 3]])),
}


@pytest.fixture
def without(monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[[Callable[[], object]], object]]:
    """Calls a function without the compiled kernels."""

    def call(work: Callable[[], object]) -> object:
        with monkeypatch.context() as patch:
            patch.setenv("HEMIVAR_KERNELS", "none")
            kernels.cache_clear()
            found = work()
        kernels.cache_clear()
        assert kernels() is not None
        return found

    yield call
    kernels.cache_clear()


def by_numpy(cells: IntArray) -> tuple[IntArray, IntArray]:
    """Edges, and those of the cells, (P, M)."""
    ends = zip(*EDGES[cells.shape[1] - 1], strict=True)
    edges, number = distinct_pairs(*(np.concatenate([cells[:, a] for a in one]) for one in ends))
    return edges, number.reshape(-1, len(cells))


@pytest.mark.parametrize("name", MESHES)
def test_edges_are_those_that_sorting_finds(name: str) -> None:
    cells, rng = MESHES[name]().cells, np.random.default_rng(0)
    mixed = rng.permutation(5 + cells.max())[cells]  # and some nodes without cells
    for one in (cells, mixed, mixed[rng.permutation(len(cells))][: 1 + len(cells) // 2]):
        found = mesh_edges(np.ascontiguousarray(one), int(one.max()) + 3)
        assert found is not None
        for mine, expected in zip(found, by_numpy(one), strict=True):
            np.testing.assert_array_equal(mine, expected)


def test_a_node_with_many_cells_and_no_cells_at_all() -> None:
    n = 3000
    fan = np.stack([np.full(n, n + 1), np.arange(n), np.arange(1, n + 1)], axis=1)
    found = mesh_edges(fan, n + 2)
    assert found is not None
    for mine, expected in zip(found, by_numpy(fan), strict=True):
        np.testing.assert_array_equal(mine, expected)
    empty = mesh_edges(np.zeros((0, 4), dtype=np.int64), 0)
    assert empty is not None
    assert (empty[0].shape, empty[1].shape) == ((0, 2), (6, 0))


def varying(dim: int, size: int) -> ConstitutiveLaw:
    """A full matrix that is another one in every cell; of one component where its size is that of the gradient."""
    root = np.random.default_rng(1).standard_normal((size, size))
    C = root @ root.T + np.eye(size)

    def matrices(points: Array, regions: object) -> Array:
        return (1.0 + points[:, 0] ** 2)[:, None, None] * C

    strains = np.arange(dim)[None] if size == dim else elastic(hv.Material.lame(1.0, 1.0), dim).strains
    return ConstitutiveLaw(strains, matrices, False)


def laws(dim: int) -> dict[str, ConstitutiveLaw]:
    tensor = varying(dim, dim * (dim + 1) // 2).matrices(np.zeros((1, dim)), None)[0]
    flux = varying(dim, dim).matrices(np.zeros((1, dim)), None)
    layers = hv.Material.lame(lambda x: 1.0 + (x[:, 0] > 0.5), lambda x: 2.0 + 3.0 * (x[:, 1] > 0.4))
    return {
        "isotropic": elastic(hv.Material.lame(3.0, 4.0), dim),
        "tensor": elastic(hv.Material.tensor(tensor), dim),
        "layers": elastic(layers, dim),
        "varying tensor": varying(dim, dim * (dim + 1) // 2),
        "flux": ConstitutiveLaw(np.arange(dim)[None], lambda points, _: flux, True),
        "varying flux": varying(dim, dim),
    }


def same_blocks(found: EdgeBlocks, expected: EdgeBlocks, mesh: Mesh) -> None:
    """But for rounding, as far as each block may feel it: rows of small cells have small entries."""
    size = np.sqrt(np.einsum("ncc->n", expected.diagonal))
    low, high = expected.edges.T
    np.testing.assert_array_less(np.abs(found.upper - expected.upper).max((1, 2)), 2e-15 * size[low] * size[high])
    np.testing.assert_array_less(np.abs(found.diagonal - expected.diagonal).max((1, 2)), 4e-15 * size**2)
    np.testing.assert_array_equal(found.diagonal, found.diagonal.transpose(0, 2, 1))
    K = found.matrix()
    assert abs(K - K.T).max() == 0.0


@pytest.mark.parametrize("law", laws(2))
@pytest.mark.parametrize("name", MESHES)
def test_blocks_are_those_of_numpy(name: str, law: str, without: Callable[[Callable[[], object]], object]) -> None:
    mesh = MESHES[name]()
    stated, graph = laws(mesh.dim)[law], node_graph(mesh, 1)
    expected = without(lambda: stiffness_blocks(mesh, stated, graph))
    assert isinstance(expected, EdgeBlocks)
    same_blocks(stiffness_blocks(mesh, stated, graph), expected, mesh)


@pytest.mark.parametrize("law", ["varying tensor", "varying flux"])
@pytest.mark.parametrize("name", ["square", "cube"])
def test_cells_by_portions_have_the_sums_of_all(name: str, law: str) -> None:
    """To the last bit, for cells are added in their order."""
    mesh = MESHES[name]()
    stated, count = laws(mesh.dim)[law], mesh.number_of_cells
    graph = BlockGraph.of(mesh.edges, mesh.number_of_nodes, mesh.dim)
    assert graph is not None
    sums = []
    for ends in ([0, count], [0, 7, count // 3, count]):
        upper = np.zeros((len(mesh.edges), len(stated.strains), len(stated.strains)))
        for first, last in pairwise(ends):
            part = slice(first, last)
            matrices = np.ascontiguousarray(stated.on(mesh, 1, part)[0][:, 0])
            graph.add(mesh.points, mesh.cells, part, mesh.volumes[part], stated.strains, matrices, upper)
        sums.append(upper)
    np.testing.assert_array_equal(*sums)


@pytest.mark.parametrize("name", ["square", "cube"])
def test_tangents_of_a_body_that_is_not_linear(name: str, without: Callable[[Callable[[], object]], object]) -> None:
    mesh = MESHES[name]()
    energy = NodalEnergy(mesh, 1, EnergyLaw.of(hv.Material.hencky(20 / 3, 4.0, 0.25, 0.02), mesh.dim))
    field = 0.05 * np.random.default_rng(2).standard_normal(mesh.points.shape)
    expected = without(lambda: energy.blocks(field))
    assert isinstance(expected, EdgeBlocks)
    same_blocks(energy.blocks(field), expected, mesh)


@pytest.mark.parametrize("free", ["all", "some", "nodes", "none"])
@pytest.mark.parametrize("components", [1, 2, 3])
def test_rows_have_the_bits_of_the_blocks(
    components: int, free: str, without: Callable[[Callable[[], object]], object]
) -> None:
    """Also of nodes that no edge ends in."""
    mesh, rng = MESHES["cube"](), np.random.default_rng(3)
    count, shape = mesh.number_of_nodes + 4, (components, components)
    diagonal = rng.standard_normal((count, *shape))
    blocks = EdgeBlocks(
        diagonal + diagonal.transpose(0, 2, 1), rng.standard_normal((len(mesh.edges), *shape)), mesh.edges
    )
    chosen: dict[str, BoolArray] = {
        "all": np.ones((count, components), dtype=bool),
        "some": rng.random((count, components)) < 0.6,
        "nodes": np.repeat(rng.random(count) < 0.6, components).reshape(count, components),
        "none": np.zeros((count, components), dtype=bool),
    }
    expected = without(lambda: blocks.matrix(chosen[free]))
    found = blocks.matrix(chosen[free])
    for name in ("shape", "indptr", "indices", "data"):
        np.testing.assert_array_equal(getattr(found, name), getattr(expected, name))
        assert found.indices.dtype == found.indptr.dtype == np.int32
    assert abs(found - found.T).max() == 0.0 if found.nnz else free == "none"


def test_bits_do_not_depend_on_the_number_of_threads() -> None:
    library = kernels()
    assert library is not None
    found = []
    for count in (1, 2, 3):
        library.call.hv_set_threads(count)
        bits = []
        for mesh in (rectangle(cells=60).moved(np.diag([1.0, 0.7])), box(cells=14)):
            again = Mesh(mesh.points, mesh.cells)
            bits += [again.edges.tobytes(), again.cell_edges.tobytes()]
            for law in laws(mesh.dim).values():
                K = stiffness_blocks(again, law, node_graph(again, 1)).matrix()
                bits += [K.indptr.tobytes(), K.indices.tobytes(), K.data.tobytes()]
        found.append(bits)
    library.call.hv_set_threads(hv.kernels.threads())
    assert found[0] == found[1] == found[2]


def test_wrong_arrays_are_refused_at_the_door() -> None:
    mesh = MESHES["cube"]()
    count, cells, edges = mesh.number_of_nodes, np.array(mesh.cells), np.array(mesh.edges)
    strains, library = elastic(hv.Material.lame(1.0, 1.0), 3).strains, kernels()
    assert library is not None

    def moved(array: IntArray, place: tuple[int, int], value: int) -> IntArray:
        other = array.copy()
        other[place] = value
        return other

    for wrong in (
        cells.astype(np.int32),
        np.asfortranarray(cells),
        np.repeat(cells, 2, axis=0)[::2],
        cells[:, :2].copy(),
        cells.ravel(),
        moved(cells, (3, 1), -1),
        moved(cells, (3, 1), count),
        moved(cells, (3, 1), 2**40),
    ):
        with pytest.raises(ValueError, match=r"cells must|nodes of cells must"):
            mesh_edges(wrong, count)
    for wrong in (
        edges.astype(np.int32),
        edges[:, ::-1],
        edges[:, ::-1].copy(),
        edges[::-1].copy(),
        np.repeat(edges, 2, axis=0),
        edges.ravel(),
        moved(edges, (5, 0), -1),
        moved(edges, (len(edges) - 1, 1), count),
    ):
        with pytest.raises(ValueError, match="edges must"):
            BlockGraph(library, wrong, count)
    graph = BlockGraph.of(edges, count, 3)
    assert graph is not None
    right = {
        "points": np.array(mesh.points),
        "cells": cells,
        "part": slice(10, 30),
        "volumes": np.array(mesh.volumes[10:30]),
        "strains": strains,
        "matrices": np.broadcast_to(np.eye(6), (20, 6, 6)).copy(),
        "upper": np.zeros((len(edges), 3, 3)),
    }
    graph.add(**right)
    frozen = right["upper"].view()
    frozen.flags.writeable = False
    for name, changes in {
        "points": [right["points"][:-1], right["points"].astype(np.float32), np.asfortranarray(right["points"])],
        "cells": [cells.astype(np.int32), cells[:, :3].copy(), moved(cells, (12, 1), -1), moved(cells, (12, 1), count)],
        "part": [slice(10, 31), slice(len(cells) - 10, len(cells) + 10)],
        "volumes": [right["volumes"][:-1], right["volumes"].astype(np.float32), np.zeros(40)[::2]],
        "strains": [strains[:2], strains + 1, strains - 1, strains[:, :2], np.zeros((3, 3, 1), dtype=int)],
        "matrices": [right["matrices"][:19], right["matrices"][:, :5], right["matrices"][0], np.ones((20, 5, 5))],
        "upper": [right["upper"][:-1], frozen, np.zeros((len(edges), 2, 2)), np.zeros((len(edges), 3, 6))[:, :, ::2]],
    }.items():
        for change in changes:
            with pytest.raises(ValueError, match="must"):
                graph.add(**(right | {name: change}))
    # Two nodes that no edge joins.
    far = moved(cells, (12, 0), int(np.setdiff1d(np.arange(count), edges[(edges == cells[12, 1]).any(axis=1)])[0]))
    with pytest.raises(ValueError, match="those of the graph"):
        graph.add(**(right | {"cells": far}))
    upper, diagonal = right["upper"], np.zeros((count, 3, 3))
    free = np.ones((count, 3), dtype=bool)
    for blocks in (upper[:-1], upper.astype(np.float32), upper[:, :, :2], upper.transpose(0, 2, 1)):
        with pytest.raises(ValueError, match="blocks of edges must"):
            graph.close(blocks)
        with pytest.raises(ValueError, match="blocks of edges must"):
            graph.rows(diagonal, blocks, free)
    for nodes in (diagonal[:-1], diagonal[:, :, 0], diagonal.astype(np.float32)):
        with pytest.raises(ValueError, match="blocks of nodes must"):
            graph.rows(nodes, upper, free)
    for chosen in (free[:-1], free.astype(np.int8), free[:, :2], free.ravel()):
        with pytest.raises(ValueError, match="free components must"):
            graph.rows(diagonal, upper, chosen)
    with pytest.raises(TypeError, match="this process"):
        pickle.dumps(graph)
