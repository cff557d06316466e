"""Stiffness matrices and load vectors.

The degree of freedom of component c at node k is ``k d + c``. Nodes of order 2 are the vertices and then the
edge midpoints of the mesh.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
import skfem
from numpy.typing import NDArray

from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.fem.elements import scaled_gradients, shape_values, voigt_index
from hemivar.mechanics.conditions import Pressure, Traction, VectorData, evaluate_scalar, evaluate_vector
from hemivar.mechanics.material import Material
from hemivar.mesh.keys import EDGES
from hemivar.mesh.mesh import Mesh

__all__ = [
    "EdgeBlocks",
    "linear_stiffness",
    "load_vector",
    "quadrature_rule",
    "region_masks",
    "stiffness_matrix",
    "tensors",
]

#: Cells whose loads are formed, and nodes whose rows are formed, at a time; in how many portions blocks are summed.
_CHUNK = 1 << 17
_ROWS = 1 << 13
_PORTIONS = 16
_REFERENCE = {1: skfem.refdom.RefLine, 2: skfem.refdom.RefTri, 3: skfem.refdom.RefTet}


def quadrature_rule(dim: int, degree: int) -> tuple[Array, Array]:
    """A quadrature rule on the simplex that is exact for polynomials of the given degree.

    Returns
    -------
    barycentric : array, shape (q, d + 1)
    weights : array, shape (q,)
        They sum to one.
    """
    points, weights = skfem.quadrature.get_quadrature(_REFERENCE[dim], degree)
    return np.column_stack([1.0 - points.sum(axis=0), points.T]), np.asarray(weights) * math.factorial(dim)


def region_masks(mesh: Mesh) -> dict[str, BoolArray]:
    """Which cells belong to which region, each of shape (M,)."""
    masks = {}
    for name, ids in mesh.regions.items():
        mask = np.zeros(mesh.number_of_cells, dtype=bool)
        mask[ids] = True
        masks[name] = mask
    return masks


def stiffness_matrix(mesh: Mesh, material: Material, order: int = 1) -> sp.csr_array:
    """Stiffness matrix of linear elasticity, ``v'K u = int eps(v) : C eps(u)``.

    Parameters
    ----------
    mesh : Mesh
    material : Material
        Varying coefficients are integrated by a rule of degree 2 (order 1) or 4 (order 2).
    order : int
        1 or 2.

    Returns
    -------
    sparse array, shape (nodes * d, nodes * d)

    Raises
    ------
    ProblemError
        If the material is not positive definite somewhere.
    """
    return linear_stiffness(mesh, material).matrix() if order == 1 else _form_stiffness(mesh, material, order)


def tensors(
    mesh: Mesh,
    material: Material,
    degree: int,
    cells: slice | IntArray = slice(None),
    vertices: IntArray | None = None,
) -> tuple[Array, Array]:
    """Elasticity matrices at quadrature points of some cells, shape (k, q, v, v), and weights of the rule, shape (q,).

    A homogeneous material gives a single matrix, shape (1, 1, v, v).  The rule takes the vertices of a cell as they
    stand in ``mesh.cells``, or in ``vertices``, shape (k, d + 1).
    """
    if material.homogeneous:
        return material.stiffness_tensor(mesh.points[:1])[None], np.ones(1)
    barycentric, weights = quadrature_rule(mesh.dim, degree)
    rule = len(weights)
    corners = mesh.points[mesh.cells[cells] if vertices is None else vertices]
    points = np.einsum("qk,mkd->mqd", barycentric, corners)
    masks = {name: np.repeat(mask[cells], rule) for name, mask in region_masks(mesh).items()}
    tensor = material.stiffness_tensor(points.reshape(-1, mesh.dim), masks)
    return tensor.reshape(len(points), rule, *tensor.shape[1:]), weights


@dataclass(frozen=True, eq=False)
class EdgeBlocks:
    """A symmetric matrix of d x d blocks that couples nodes joined by an edge.

    Attributes
    ----------
    diagonal : array, shape (N, d, d)
        Block of every node.
    upper : array, shape (E, d, d)
        Block of every edge, rows of its first node and columns of its second one.
    edges : int array, shape (E, 2)
        Nodes of the edges, smaller number first, sorted.
    """

    diagonal: Array
    upper: Array
    edges: IntArray

    def times(self, field: Array) -> Array:
        """Product with nodal vectors, shape (N, d)."""
        product: Array = np.einsum("nij,nj->ni", self.diagonal, field)
        moving = np.any(field != 0.0, axis=1)
        low, high = self.edges.T
        for rows, columns, form in ((low, high, "eij,ej->ei"), (high, low, "eji,ej->ei")):
            edge = np.flatnonzero(moving[columns])
            force = np.einsum(form, self.upper[edge], field[columns[edge]])
            for c in range(field.shape[1]):
                product[:, c] += np.bincount(rows[edge], weights=force[:, c], minlength=len(field))
        return product

    def columns(self, dofs: IntArray) -> sp.csr_array:
        """The columns of some (distinct) components ``node d + c``, shape (N d, k)."""
        count, dim = self.diagonal.shape[:2]
        place = np.full(count * dim, -1, dtype=np.int64)
        place[dofs] = np.arange(len(dofs))
        wanted = np.zeros(count, dtype=bool)
        wanted[dofs // dim] = True
        low, high = self.edges.T
        before, behind = np.flatnonzero(wanted[high]), np.flatnonzero(wanted[low])
        nodes = np.flatnonzero(wanted)
        row = np.concatenate([nodes, low[before], high[behind]])
        column = np.concatenate([nodes, high[before], low[behind]])
        blocks = np.concatenate([self.diagonal[nodes], self.upper[before], self.upper[behind].transpose(0, 2, 1)])
        axis = np.arange(dim)
        rows = np.broadcast_to(row[:, None, None] * dim + axis[:, None], blocks.shape)
        columns = place[np.broadcast_to(column[:, None, None] * dim + axis, blocks.shape)]
        keep = columns >= 0
        return sp.csr_array((blocks[keep], (rows[keep], columns[keep])), shape=(count * dim, len(dofs)))

    def turn(self, directions: Array) -> None:
        """Go over to other components at every node, in place.

        Parameters
        ----------
        directions : array, shape (N, d, d)
            ``directions[n, c]`` is the vector of component c at node n.
        """
        other = np.any(directions != np.eye(directions.shape[1]), axis=(1, 2))
        nodes = np.flatnonzero(other)
        block = directions[nodes] @ self.diagonal[nodes] @ directions[nodes].transpose(0, 2, 1)
        self.diagonal[nodes] = 0.5 * (block + block.transpose(0, 2, 1))
        low, high = self.edges.T
        edge = np.flatnonzero(other[low])
        self.upper[edge] = directions[low[edge]] @ self.upper[edge]
        edge = np.flatnonzero(other[high])
        self.upper[edge] = self.upper[edge] @ directions[high[edge]].transpose(0, 2, 1)

    def matrix(self, free: BoolArray | None = None) -> sp.csr_array:
        """Rows and columns of the free components, in the order of nodes; indices are sorted.

        Parameters
        ----------
        free : bool array, shape (N, d), or None
            None takes all components.
        """
        count, dim = self.diagonal.shape[:2]
        free = np.ones((count, dim), dtype=bool) if free is None else free
        nodes = np.flatnonzero(free.any(axis=1))
        starts, columns, source = self._rows(nodes)
        free = free[nodes]
        width = free.sum(axis=1)
        lengths = np.repeat(np.add.reduceat(width[columns], starts[:-1]), width) if len(nodes) else width
        entries, unknowns = int(lengths.sum()), int(width.sum())
        index = np.int32 if max(entries, unknowns) < np.iinfo(np.int32).max else np.int64
        indptr = np.zeros(unknowns + 1, dtype=index)
        np.cumsum(lengths, out=indptr[1:])
        indices, data = np.empty(entries, dtype=index), np.empty(entries)
        every = bool(free.all())
        number: NDArray[np.integer] = np.cumsum(free.ravel(), dtype=index)
        number -= 1
        done = 0
        for first in range(0, len(nodes), _ROWS):
            last = min(first + _ROWS, len(nodes))
            part = slice(starts[first], starts[last])
            blocks = self._gather(source[part], nodes[first:last])
            rows = starts[first : last + 1] - starts[first]
            shape = ((last - first) * dim, len(nodes) * dim)
            here = sp.bsr_array((blocks, columns[part], rows.astype(np.int32)), shape=shape).tocsr()
            values, where = here.data, here.indices
            if not every:
                keep = free.ravel()[where]
                keep &= np.repeat(free[first:last].ravel(), np.diff(here.indptr))
                values, where = values[keep], number[where[keep]]
            data[done : done + len(values)], indices[done : done + len(values)] = values, where
            done += len(values)
        return sp.csr_array((data, indices, indptr), shape=(unknowns, unknowns))

    def _rows(self, nodes: IntArray) -> tuple[IntArray, NDArray[np.int32], NDArray[np.int32]]:
        """Rows of blocks between these nodes: where each starts, columns, and where blocks come from.

        A block comes from edge ``e``, transposed if its source is ``E + e``; on the diagonal the source is ``2 E``. The
        edges being sorted, the upper triangle is a csr matrix as it stands, and turning it round sorts the lower one.
        """
        count, total = len(nodes), len(self.edges)
        number = np.full(len(self.diagonal), -1, dtype=np.int32)
        number[nodes] = np.arange(count, dtype=np.int32)
        low, high = number[self.edges[:, 0]], number[self.edges[:, 1]]
        edge = np.arange(total, dtype=np.int32)
        if count < len(self.diagonal):
            inside = (low >= 0) & (high >= 0)
            low, high, edge = low[inside], high[inside], edge[inside]
        above = np.zeros(count + 1, dtype=np.int32)
        np.cumsum(np.bincount(low, minlength=count), out=above[1:])
        lower = sp.csr_array((edge, high, above), shape=(count, count)).tocsc()
        below = lower.indptr.astype(np.int32, copy=False)
        row = np.arange(count, dtype=np.int32)
        starts = above.astype(np.int64) + below + np.arange(count + 1)
        columns, source = np.empty(starts[-1], dtype=np.int32), np.empty(starts[-1], dtype=np.int32)
        middle = below[1:] + above[:-1] + row
        columns[middle], source[middle] = row, 2 * total
        place = np.arange(len(edge)) + np.repeat(above[:-1] + row, np.diff(below))
        columns[place], source[place] = lower.indices, lower.data + np.int32(total)
        place = np.arange(len(edge)) + np.repeat(below[1:] + row + 1, np.diff(above))
        columns[place], source[place] = high, edge
        return starts, columns, source

    def _gather(self, source: NDArray[np.int32], nodes: IntArray) -> Array:
        """Blocks from their sources, those on the diagonal being of these nodes."""
        total = len(self.upper)
        kind, edge = np.divmod(source, max(total, 1))
        diagonal, below = kind == 2, kind == 1
        blocks = self.upper[edge] if total else np.empty((len(source), *self.diagonal.shape[1:]))
        blocks[below] = blocks[below].transpose(0, 2, 1)
        blocks[diagonal] = self.diagonal[nodes]
        return blocks


def linear_stiffness(mesh: Mesh, material: Material) -> EdgeBlocks:
    """Stiffness of linear elements by nodes and edges.

    With ``h_a = sqrt(|T|) grad phi_a`` component (i, j) of the block of an edge is the sum of ``C_ikjl h_a,k h_b,l``
    over its cells. If C is the same everywhere, it multiplies the sums of ``h_a,k h_b,l``. No matrix per element is
    formed. The blocks of a row sum to zero, which gives those on the diagonal.

    Parameters
    ----------
    mesh : Mesh
    material : Material
    """
    dim, count = mesh.dim, mesh.number_of_cells
    upper = np.zeros((len(mesh.edges), dim, dim))
    step = max(count // _PORTIONS + 1, 1 << 14)
    for start in range(0, count, step):
        part = slice(start, start + step)
        edge = mesh.cell_edges[part].T
        first, last = int(edge.min()), int(edge.max()) + 1
        place = (edge - first).ravel()
        tensor = None
        if not material.homogeneous:
            values, weights = tensors(mesh, material, 2, part)
            tensor = np.einsum("q,mqvw->mvw", weights, values)
        for (i, j), values in _components(mesh, part, tensor):
            upper[first:last, i, j] += np.bincount(place, weights=values.ravel(), minlength=last - first)
    for i in range(dim):
        for j in range(i + 1, dim):
            both, skew = upper[:, i, j].copy(), upper[:, j, i].copy()
            upper[:, i, j] += skew
            np.subtract(both, skew, out=upper[:, j, i])
    if material.homogeneous:
        voigt = voigt_index(dim)
        four = material.stiffness_tensor(mesh.points[:1])[0][voigt[:, :, None, None], voigt]  # i, k, j, l
        change = np.ascontiguousarray(four.transpose(1, 3, 0, 2).reshape(dim * dim, dim * dim))
        flat = upper.reshape(-1, dim * dim)
        for start in range(0, len(flat), _CHUNK):
            flat[start : start + _CHUNK] = flat[start : start + _CHUNK] @ change
    return EdgeBlocks(_closing_blocks(upper, mesh.edges, mesh.number_of_nodes), upper, mesh.edges)


def _components(mesh: Mesh, part: slice, tensor: Array | None) -> Iterator[tuple[tuple[int, int], Array]]:
    """What some cells add to the blocks of their edges, one component of all blocks at a time.

    At (i, j), i < j, stands half the sum of components (i, j) and (j, i), at (j, i) half their difference, whose sign
    is that for the edge from its smaller to its larger node.

    Parameters
    ----------
    part : slice
        The cells.
    tensor : array, shape (k, v, v), or None
        Elasticity matrices. None leaves them out: component (k, l) is then that of ``h_a h_b'``.

    Yields
    ------
    component : pair of ints
    values : array, shape (edges of a cell, k)
    """
    dim, pairs = mesh.dim, EDGES[mesh.dim]
    cells = mesh.cells[part].T
    sides = scaled_gradients(mesh, part, np.sqrt(mesh.volumes[part]))
    ahead = np.array([np.where(cells[a] < cells[b], 0.5, -0.5) for a, b in pairs])
    one, other = (np.array(ends) for ends in zip(*pairs, strict=True))
    voigt = voigt_index(dim)
    used: BoolArray | None = None if tensor is None else np.any(tensor != 0.0, axis=0)

    def component(i: int, j: int) -> Array:
        if tensor is None or used is None:
            return np.asarray(sides[one, i] * sides[other, j])
        flux = np.zeros((dim + 1, dim, len(tensor)))
        for k in range(dim):
            for m in range(dim):
                entry = voigt[i, k], voigt[j, m]
                if used[entry]:
                    flux[:, k] += tensor[:, *entry] * sides[:, m]
        return np.asarray(sum(sides[one, k] * flux[other, k] for k in range(dim)))

    for i in range(dim):
        yield (i, i), component(i, i)
        for j in range(i + 1, dim):
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


def _form_stiffness(mesh: Mesh, material: Material, order: int) -> sp.csr_array:
    """Any order, by scikit-fem."""
    dim = mesh.dim
    library_mesh = _library_mesh(mesh)
    tensor, _ = tensors(mesh, material, 2 * order, vertices=library_mesh.t.T)  # it may sort the vertices of a cell
    constant = tensor.shape[0] == 1
    kinds: dict[tuple[int, int], Callable[[], skfem.Element]] = {
        (2, 1): skfem.ElementTriP1,
        (2, 2): skfem.ElementTriP2,
        (3, 1): skfem.ElementTetP1,
        (3, 2): skfem.ElementTetP2,
    }
    element = skfem.ElementVector(kinds[dim, order]())
    degree = 2 * (order - 1) if constant else 2 * order
    basis = skfem.Basis(library_mesh, element, intorder=max(degree, 1))
    coefficient = tensor[0, 0][..., None, None] if constant else np.moveaxis(tensor, (0, 1), (2, 3))
    terms = [(int(i), int(j)) for i, j in np.argwhere(np.any(coefficient != 0.0, axis=(2, 3)))]

    @skfem.BilinearForm  # type: ignore[untyped-decorator]
    def energy(u: skfem.DiscreteField, v: skfem.DiscreteField, w: Mapping[str, Array]) -> Array:
        strain, virtual = _voigt_strain(u.grad), _voigt_strain(v.grad)
        return np.asarray(sum(coefficient[i, j] * virtual[i] * strain[j] for i, j in terms))

    matrix = energy.assemble(basis).tocoo()
    number = _library_numbering(mesh, library_mesh, basis, order)
    size = len(mesh.nodes(order)) * dim
    return sp.csr_array((matrix.data, (number[matrix.row], number[matrix.col])), shape=(size, size))


def _voigt_strain(gradient: Array) -> list[Array]:
    dim = len(gradient)
    shear = [(0, 1)] if dim == 2 else [(1, 2), (0, 2), (0, 1)]
    return [gradient[i, i] for i in range(dim)] + [gradient[i, j] + gradient[j, i] for i, j in shear]


def _library_mesh(mesh: Mesh) -> skfem.Mesh:
    kind = skfem.MeshTri if mesh.dim == 2 else skfem.MeshTet
    return kind(np.ascontiguousarray(mesh.points.T), np.ascontiguousarray(mesh.cells.T))


def _library_numbering(mesh: Mesh, library_mesh: skfem.Mesh, basis: skfem.Basis, order: int) -> IntArray:
    """Our number of each of scikit-fem's degrees of freedom."""
    dim, count = mesh.dim, mesh.number_of_nodes
    number = np.empty(basis.N, dtype=np.int64)
    component = np.arange(dim)[:, None]
    number[basis.nodal_dofs] = np.arange(count) * dim + component
    if order == 2:
        pairs, dofs = (library_mesh.facets, basis.facet_dofs) if dim == 2 else (library_mesh.edges, basis.edge_dofs)
        low, high = np.sort(pairs.astype(np.int64), axis=0)
        edge = np.searchsorted(mesh.edges[:, 0] * count + mesh.edges[:, 1], low * count + high)
        number[dofs] = (count + edge) * dim + component
    return number


def load_vector(
    mesh: Mesh,
    order: int = 1,
    body_force: VectorData | float = 0.0,
    tractions: Mapping[str, Traction] | None = None,
) -> Array:
    """Load vector ``F'v = int b . v + int_boundary t . v``.

    Parameters
    ----------
    mesh : Mesh
    order : int
        1 or 2.
    body_force : vector, shape (d,), or callable
        Integrated exactly if constant, else by a rule of degree 4.
    tractions : mapping of boundary name to vector, callable or Pressure
        Integrated by a rule of degree 5.

    Returns
    -------
    array, shape (nodes * d,)
    """
    nodes = len(mesh.nodes(order))
    load = np.zeros((nodes, mesh.dim))
    if callable(body_force):
        _add_load(
            load, mesh.points, mesh.cells, mesh.cell_nodes(order), mesh.volumes, order, 4,
            lambda points, _: evaluate_vector(body_force, points, "body_force"),
        )  # fmt: skip
    elif np.any(np.asarray(body_force) != 0):
        barycentric, weights = quadrature_rule(mesh.dim, order)
        share = np.zeros(nodes)
        for node, part in zip(mesh.cell_nodes(order).T, weights @ shape_values(order, barycentric), strict=True):
            share += part * np.bincount(node, weights=mesh.volumes, minlength=nodes)
        load += share[:, None] * evaluate_vector(body_force, mesh.points[:1], "body_force")
    for name, traction in sorted((tractions or {}).items()):  # in whatever order they are stated: the same sum
        facets = mesh.boundaries[name]
        normals, measures = mesh.facet_normals(facets)
        what = f"tractions['{name}']"

        def values(points: Array, facet: IntArray, traction: Traction = traction, what: str = what,
                   normals: Array = normals) -> Array:  # fmt: skip
            if isinstance(traction, Pressure):
                return -evaluate_scalar(traction.value, points, what)[:, None] * normals[facet]
            return evaluate_vector(traction, points, what)

        _add_load(load, mesh.points, facets, mesh.facet_nodes(facets, order), measures, order, 5, values)
    return load.ravel()


def _add_load(
    load: Array,
    points: Array,
    simplices: IntArray,
    nodes: IntArray,
    measures: Array,
    order: int,
    degree: int,
    values: Callable[[Array, IntArray], Array],
) -> None:
    """Add the integrals of ``values`` times the shape functions over simplices."""
    barycentric, weights = quadrature_rule(simplices.shape[1] - 1, degree)
    shapes = shape_values(order, barycentric)
    dim = load.shape[1]
    for start in range(0, len(simplices), _CHUNK):
        part = slice(start, start + _CHUNK)
        places = np.einsum("qk,mkd->mqd", barycentric, points[simplices[part]])
        owner = np.repeat(np.arange(start, start + len(places)), len(weights))
        force = values(places.reshape(-1, dim), owner).reshape(places.shape)
        local = np.einsum("q,qk,mqd,m->mkd", weights, shapes, force, measures[part], optimize=True)
        for c in range(dim):
            load[:, c] += np.bincount(nodes[part].ravel(), weights=local[:, :, c].ravel(), minlength=len(load))
