"""Matrices by scikit-fem alone, in our numbering: what ours are compared with."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import scipy.sparse as sp
import skfem

from hemivar.basics.types import Array
from hemivar.mesh import Mesh

ELEMENTS = {
    (2, 1): skfem.ElementTriP1,
    (2, 2): skfem.ElementTriP2,
    (3, 1): skfem.ElementTetP1,
    (3, 2): skfem.ElementTetP2,
}


def library_matrix(mesh: Mesh, order: int, form: Callable[[Any, Any, Any], Any], degree: int) -> sp.csr_array:
    """The matrix of a form of u, v and w, shape (nodes * d, nodes * d)."""
    kind = skfem.MeshTri if mesh.dim == 2 else skfem.MeshTet
    library = kind(np.ascontiguousarray(mesh.points.T), np.ascontiguousarray(mesh.cells.T))
    basis = skfem.Basis(library, skfem.ElementVector(ELEMENTS[mesh.dim, order]()), intorder=degree)
    matrix = skfem.BilinearForm(form).assemble(basis).tocoo()
    dim, count = mesh.dim, mesh.number_of_nodes
    number = np.empty(basis.N, dtype=np.int64)
    component = np.arange(dim)[:, None]
    number[basis.nodal_dofs] = np.arange(count) * dim + component
    if order == 2:
        pairs, dofs = (library.facets, basis.facet_dofs) if dim == 2 else (library.edges, basis.edge_dofs)
        low, high = np.sort(pairs.astype(np.int64), axis=0)
        edge = np.searchsorted(mesh.edges[:, 0] * count + mesh.edges[:, 1], low * count + high)
        number[dofs] = (count + edge) * dim + component
    size = len(mesh.nodes(order)) * dim
    return sp.csr_array((matrix.data, (number[matrix.row], number[matrix.col])), shape=(size, size))


def library_elasticity(mesh: Mesh, tensor: Callable[[Array], Array] | Array, order: int, degree: int) -> sp.csr_array:
    """Stiffness of an elasticity matrix (v, v), or a function of points (k, d) that returns (k, v, v)."""
    shear = [(0, 1)] if mesh.dim == 2 else [(1, 2), (0, 2), (0, 1)]

    def strain(u: Any) -> list[Any]:
        gradient = u.grad
        return [gradient[i, i] for i in range(mesh.dim)] + [gradient[i, j] + gradient[j, i] for i, j in shear]

    def form(u: Any, v: Any, w: Any) -> Any:
        places = w.x.reshape(mesh.dim, -1).T
        C = np.broadcast_to(tensor(places) if callable(tensor) else tensor, (len(places), *(len(strain(u)),) * 2))
        C = np.moveaxis(C, 0, -1).reshape(*C.shape[1:], *w.x.shape[1:])
        pairs = [(a, b) for a in range(len(C)) for b in range(len(C))]
        return sum(C[a, b] * strain(v)[a] * strain(u)[b] for a, b in pairs)

    return library_matrix(mesh, order, form, degree)
