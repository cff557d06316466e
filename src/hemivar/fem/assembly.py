"""Assembly of stiffness (blocks of nodes and edges) and load vectors, for c components and elements of order 1 or 2.

The degree of freedom of component i at node k is ``k c + i``. Nodes of order 2 are the vertices and then the edge
midpoints of the mesh.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence

import numpy as np
import scipy.sparse as sp

from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.fem.constitutive import ConstitutiveLaw, elastic
from hemivar.fem.edge_blocks import EdgeBlocks, NodeGraph, node_graph
from hemivar.fem.elements import scaled_gradients, shape_derivatives, shape_values
from hemivar.fem.initial_load import initial_load
from hemivar.fem.plates import plate_load
from hemivar.fem.quadrature import quadrature_rule
from hemivar.fem.rings import hoop_matrices
from hemivar.kernels.mesh_sums import BlockGraph
from hemivar.mechanics.conditions import (
    DataField,
    Pressure,
    ScalarData,
    Traction,
    VectorData,
)
from hemivar.mechanics.kinematics import BodyKinematics
from hemivar.mechanics.material import Material
from hemivar.mechanics.statement import ContactProblem
from hemivar.mesh.boundary_rule import boundary_rule
from hemivar.mesh.keys import PORTION
from hemivar.mesh.mesh import Mesh

__all__ = [
    "Density",
    "integrated_load",
    "load_vector",
    "pair_products",
    "portions",
    "stated_load",
    "stiffness_blocks",
    "stiffness_matrix",
]

#: In how many portions cells are summed up, and the least number of cells in one, by order: what is formed of one is
#: small beside the matrix.
_PORTIONS = 16
_LEAST = {1: 1 << 14, 2: 1 << 12}


#: Weight of a quadrature point, derivatives of the shape functions and matrices: see :func:`pair_products`.
QuadraturePoint = tuple[float, Array, Array | None]


def portions(mesh: Mesh, order: int) -> list[slice]:
    """The cells by portions, for which what is formed of one fits into little memory."""
    step = max(mesh.number_of_cells // _PORTIONS + 1, _LEAST[order])
    return [slice(start, start + step) for start in range(0, mesh.number_of_cells, step)]


def stiffness_matrix(mesh: Mesh, material: Material, order: int = 1) -> sp.csr_array:
    """Stiffness matrix of linear elasticity, ``v'K u = int eps(v) : C eps(u)``, shape (nodes * d, nodes * d)."""
    return stiffness_blocks(mesh, elastic(material, mesh.dim), node_graph(mesh, order)).matrix()


def stiffness_blocks(mesh: Mesh, law: ConstitutiveLaw, graph: NodeGraph) -> EdgeBlocks:
    """Stiffness ``int strain(v) : stress(u)`` by nodes and edges.

    With ``h_a = sqrt(|T|) grad phi_a`` component (i, j) of the block of an edge is the sum of ``w C_ikjl h_a,k h_b,l``
    over quadrature points and cells. If C is the same everywhere, and there are as many components as derivatives, it
    multiplies the sums of ``w h_a,k h_b,l``. No matrix per element is formed. The blocks of a row sum to zero, which
    gives those on the diagonal.
    """
    components, dim = law.strains.shape
    late = law.homogeneous and components == dim
    upper = np.zeros((len(graph.edges), components, components))
    compiled = BlockGraph.of(graph.edges, graph.count, components) if graph.order == 1 else None
    if compiled is not None:
        _add_compiled(compiled, mesh, law, upper)
        return _with_hoop(EdgeBlocks(compiled.close(upper), upper, graph.edges), mesh, law, graph)
    for part in portions(mesh, graph.order):
        edge = graph.cell_edges[part].T
        first, last = int(edge.min()), int(edge.max()) + 1
        number = (edge - first).ravel()
        points = _at_points(mesh, law, graph.order, part, late)
        for (i, j), values in pair_products(points, law.strains, graph, part):
            upper[first:last, i, j] += np.bincount(number, weights=values.ravel(), minlength=last - first)
    for i in range(components):
        for j in range(i + 1, components):
            both, skew = upper[:, i, j].copy(), upper[:, j, i].copy()
            upper[:, i, j] += skew
            np.subtract(both, skew, out=upper[:, j, i])
    if late:
        matrix = law.matrices(mesh.points[:1], None)[0]
        four = matrix[law.strains[:, :, None, None], law.strains]  # i, k, j, l
        change = np.ascontiguousarray(four.transpose(1, 3, 0, 2).reshape(dim * dim, dim * dim))
        flat = upper.reshape(-1, dim * dim)
        for start in range(0, len(flat), PORTION):
            flat[start : start + PORTION] = flat[start : start + PORTION] @ change
    return _with_hoop(
        EdgeBlocks(_closing_blocks(upper, graph.edges, graph.count), upper, graph.edges), mesh, law, graph
    )


def _with_hoop(blocks: EdgeBlocks, mesh: Mesh, law: ConstitutiveLaw, graph: NodeGraph) -> EdgeBlocks:
    """What the strain around the axis adds to the blocks, in place; nothing without axial symmetry."""
    if law.hoop is None:
        return blocks
    one, other = graph.local
    for part in portions(mesh, graph.order):
        local = hoop_matrices(mesh, graph.order, law.hoop, law.strains, part)
        nodes = graph.cells[part]
        corner = np.arange(nodes.shape[1])
        np.add.at(blocks.diagonal, nodes, local[:, corner, :, corner].swapaxes(0, 1))
        pairs = local[:, one, :, other].swapaxes(0, 1)
        ahead = (nodes[:, one] < nodes[:, other])[:, :, None, None]
        np.add.at(blocks.upper, graph.cell_edges[part], np.where(ahead, pairs, pairs.swapaxes(2, 3)))
    return blocks


def _add_compiled(graph: BlockGraph, mesh: Mesh, law: ConstitutiveLaw, upper: Array) -> None:
    """The sums of all cells, added to the blocks of the edges."""
    points, cells = np.ascontiguousarray(mesh.points), np.ascontiguousarray(mesh.cells)
    for part in [slice(0, len(cells))] if law.homogeneous else portions(mesh, 1):
        matrices, weights = law.on(mesh, 2, part)
        mean = np.ascontiguousarray(np.einsum("q,mqvw->mvw", weights, matrices))
        graph.add(points, cells, part, mesh.volumes[part], law.strains, mean, upper)


def _at_points(mesh: Mesh, law: ConstitutiveLaw, order: int, part: slice, late: bool) -> list[QuadraturePoint]:
    """What :func:`pair_products` takes of some cells; linear elements have one point, with the mean of the matrices."""
    gradients = scaled_gradients(mesh, part, np.sqrt(mesh.volumes[part]))
    matrices, weights = law.on(mesh, 2 * order, part)
    if order == 1:
        mean = None if late else np.einsum("q,mqvw->mvw", weights, matrices)
        return [(1.0, gradients, mean)]
    barycentric, weights = quadrature_rule(mesh.dim, 2 * (order - 1) if law.homogeneous else 2 * order)
    flat = gradients.reshape(len(gradients), -1)
    points: list[QuadraturePoint] = []
    for q, (point, weight) in enumerate(zip(barycentric, weights, strict=True)):
        h = shape_derivatives(order, point) @ flat
        matrix = None if late else matrices[:, 0 if law.homogeneous else q]
        points.append((float(weight), h.reshape(-1, *gradients.shape[1:]), matrix))
    return points


def pair_products(
    points: Sequence[QuadraturePoint], strains: IntArray, graph: NodeGraph, part: slice
) -> Iterator[tuple[tuple[int, int], Array]]:
    """What some cells add to the blocks of their edges, one component of all blocks at a time.

    At (i, j), i < j, stands half the sum of components (i, j) and (j, i), at (j, i) half their difference, whose sign
    is that for the edge from its smaller to its larger node.

    Shapes: ``strains`` (c, e).
    """
    one, other = graph.local
    components, derivatives = strains.shape
    used: list[BoolArray] = [np.ones(0, bool) if C is None else np.any(C != 0.0, axis=0) for *_, C in points]

    def component(i: int, j: int) -> Array:
        total: Array | None = None
        for (weight, h, matrix), nonzero in zip(points, used, strict=True):
            if matrix is None:
                value = h[one, i] * h[other, j]
            else:
                flux = np.zeros(h.shape)
                for k in range(derivatives):
                    for m in range(derivatives):
                        entry = strains[i, k], strains[j, m]
                        if nonzero[entry]:
                            flux[:, k] += matrix[:, *entry] * h[:, m]
                value = sum(h[one, k] * flux[other, k] for k in range(derivatives))
            value = value if weight == 1.0 else weight * value
            total = value if total is None else total + value
        return np.asarray(total)

    nodes = graph.cells[part].T
    for i in range(components):
        yield (i, i), component(i, i)
        for j in range(i + 1, components):
            ahead = np.where(nodes[one] < nodes[other], 0.5, -0.5)
            direct, mirrored = component(i, j), component(j, i)
            yield (i, j), 0.5 * (direct + mirrored)
            yield (j, i), ahead * (direct - mirrored)


def _closing_blocks(upper: Array, edges: IntArray, count: int) -> Array:
    """Blocks on the diagonal that make the blocks of every row sum to zero, symmetrised, shape (N, d, d)."""
    dim = upper.shape[1]
    diagonal = np.empty((count, dim, dim))
    for i in range(dim):
        for j in range(i, dim):
            both = 0.5 * (upper[:, i, j] + upper[:, j, i])
            total = np.bincount(edges[:, 0], weights=both, minlength=count)
            total += np.bincount(edges[:, 1], weights=both, minlength=count)
            diagonal[:, i, j] = diagonal[:, j, i] = -total
    return diagonal


#: What acts per volume or area, in c components: the same vector (c,) everywhere, or a function of points (n, d) and of
#: the numbers (n,) of their cells or facets that returns shape (n, c).
Density = Array | Callable[[Array, IntArray], Array]


def load_vector(
    mesh: Mesh,
    order: int = 1,
    body_force: VectorData | ScalarData = 0.0,
    tractions: Mapping[str, Traction] | None = None,
    components: int | None = None,
    names: tuple[str, str] = ("body_force", "tractions"),
    body: BodyKinematics | None = None,
) -> Array:
    """Load vector ``F'v = int b . v + int_boundary t . v`` of fields of c components.

    Shapes: ``body_force`` (d,); returns (nodes * c,).
    """
    components = mesh.dim if components is None else components

    def density(load: VectorData | ScalarData, what: str) -> Density:
        field = DataField(load, what, components)
        if field.alike:
            return field.at(mesh.points[:1]).reshape(-1)
        return lambda points, _: field.at(points).reshape(len(points), -1)

    def on(name: str, traction: Traction) -> Density:
        if not isinstance(traction, Pressure):
            return density(traction, f"{names[1]}['{name}']")
        value, normals = traction.value, boundary_rule(mesh, name).normals
        return lambda points, facet: -DataField(value, f"tractions['{name}']").at(points)[:, None] * normals[facet]

    stated = {name: on(name, traction) for name, traction in (tractions or {}).items()}
    return integrated_load(mesh, order, components, density(body_force, names[0]), stated, body)


def stated_load(problem: ContactProblem, initial: Array | None = None) -> Array:
    """The load vector of a statement, shape (nodes * c,); ``initial`` is its part of initial stress, if it is known."""
    loads, names = (problem.body_force, problem.tractions), problem.load_names
    load = load_vector(problem.mesh, problem.order, *loads, problem.components, names, problem.kinematics)
    load += plate_load(problem, len(load) // problem.components)
    if not problem.initially_stressed:
        return load
    return load + (initial_load(problem) if initial is None else initial)


def integrated_load(
    mesh: Mesh,
    order: int,
    components: int,
    inside: Density,
    boundaries: Mapping[str, Density],
    body: BodyKinematics | None = None,
) -> Array:
    """Integrals of densities times the shape functions of each component, shape (nodes * c,)."""
    load = np.zeros((mesh.number_of_nodes + (len(mesh.edges) if order == 2 else 0), components))
    _add_load(load, mesh.points, mesh.cells, mesh.cell_nodes(order), mesh.volumes, order, 4, _measured(inside, body))
    for name, density in sorted(boundaries.items()):  # in whatever order they are stated: the same sum
        rule = boundary_rule(mesh, name, order)
        _add_load(load, mesh.points, rule.facets, rule.nodes, rule.weights, order, 5, _measured(density, body))
    return load.ravel()


def _measured(density: Density, body: BodyKinematics | None) -> Density:
    """A density times the measure of a body."""
    if body is None or not body.ring or (not callable(density) and not np.any(density)):
        return density
    return body.over(density if callable(density) else lambda points, _: np.tile(density, (len(points), 1)))


def _add_load(
    load: Array,
    points: Array,
    simplices: IntArray,
    nodes: IntArray,
    measures: Array,
    order: int,
    degree: int,
    density: Density,
) -> None:
    """Add the integrals of a density times the shape functions over simplices."""
    barycentric, weights = quadrature_rule(simplices.shape[1] - 1, degree if callable(density) else order)
    shapes = shape_values(order, barycentric)
    if not callable(density):
        if np.any(density != 0.0):
            share = np.zeros(len(load))
            for node, part in zip(nodes.T, weights @ shapes, strict=True):
                share += part * np.bincount(node, weights=measures, minlength=len(load))
            load += share[:, None] * density
        return
    for start in range(0, len(simplices), PORTION):
        part = slice(start, start + PORTION)
        owner = np.arange(start, start + len(nodes[part]))
        local = _integrals(points, simplices[part], owner, barycentric, weights[:, None] * shapes, density)
        for component, own in zip(load.T, local, strict=True):
            own *= measures[part, None]
            component += np.bincount(nodes[part].ravel(), weights=own.ravel(), minlength=len(load))


def _integrals(
    points: Array,
    simplices: IntArray,
    number: IntArray,
    barycentric: Array,
    table: Array,
    density: Callable[[Array, IntArray], Array],
) -> Array:
    """Mean values of a density times the shape functions on simplices of these numbers, shape (c, k, L).

    Shapes: ``table`` (q, L), the shape functions times the weights of the rule.
    """
    means, step = [], max(PORTION // (points.shape[1] * len(table)), 1)
    for start in range(0, len(simplices), step):
        part = slice(start, start + step)
        # One coordinate after the other in memory, as functions take them.
        places = np.empty((points.shape[1], len(number[part]), len(table)))
        for x, own in zip(points.T, places, strict=True):
            np.matmul(x[simplices[part]], barycentric.T, out=own)
        force = density(places.reshape(len(places), -1).T, np.repeat(number[part], len(table))).T
        means.append(force.reshape(len(force), -1, len(table)) @ table)
    return np.concatenate(means, axis=1)
