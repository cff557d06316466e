"""Stiffness of cells whose stresses are in equilibrium: the energy in the displacements of facets and of cells.

For displacements U, linear on each facet, and V, linear on the cell, the work of a stress of the split element is
``sum m . (U - V) + int s : eps(V)``.  The stiffness ``A H^-1 A'``, H the complementary energy in the degrees of freedom
of the element and A this work, is that of a body whose stresses answer forces on facets, the moments of tractions, and
on cells, linear ones, exactly: the least complementary energy of a load is half its work.  With no force on cells V is
eliminated beforehand.  It is singular on rigid motions alone.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import scipy.linalg as la

from hemivar.basics.types import Array
from hemivar.certificates.continuous.facet_table import facet_vertices
from hemivar.certificates.continuous.split_element import split_element, voigt

__all__ = ["equilibrated_blocks"]


def equilibrated_blocks(compliance: Array, jacobian: Array, *, loaded: bool = False) -> Array:
    """Stiffness matrices of cells.

    ``compliance`` is (M, v, v); ``jacobian`` is (M, d, d); returns (M, k, k). In ``U[i, a]``, vertex a of facet i, and
    if loaded ``V[a]`` at the vertices of the cell; all components of each one after another, ``k = d d (d + 1)``, and
    ``d (d + 1)`` more.
    """
    dim = jacobian.shape[-1]
    rows, columns = split_element(dim).upper
    basis, energies = _loaded(dim) if loaded else _balanced(dim)
    n = energies.shape[-1]
    H = (compliance[:, rows, columns] @ energies.reshape(len(energies), -1)).reshape(len(compliance), n, n)
    blocks = basis @ np.linalg.solve(H, np.broadcast_to(basis.T, (len(H), *basis.T.shape)))
    blocks = blocks.reshape(len(H), -1, dim, basis.shape[0] // dim, dim)  # displacements are pulled back by B'
    blocks = np.einsum("majbl,mij->maibl", blocks, jacobian, optimize=True)
    blocks = np.einsum("majbl,mkl->majbk", blocks, jacobian, optimize=True).reshape(len(H), *2 * basis.shape[:1])
    return np.asarray(0.5 * (blocks + blocks.transpose(0, 2, 1)))


@cache
def _balanced(dim: int) -> tuple[Array, Array]:
    """A basis of the moments in balance, and the energies in it."""
    element = split_element(dim)
    corners = np.vstack([np.zeros(dim), np.eye(dim)])
    x = corners[facet_vertices(dim)] - corners.mean(axis=0)
    conditions = []
    for i in range(dim):
        push = np.zeros((dim + 1, dim, dim))
        push[:, :, i] = 1.0
        conditions.append(push.ravel())
        for j in range(i):
            turn = np.zeros((dim + 1, dim, dim))
            turn[:, :, j], turn[:, :, i] = x[:, :, i], -x[:, :, j]
            conditions.append(turn.ravel())
    basis = la.null_space(np.array(conditions))
    return basis, basis.T @ element.energies @ basis


@cache
def _loaded(dim: int) -> tuple[Array, Array]:
    """The work A of all degrees of freedom, and the energies in them."""
    element = split_element(dim)
    number = element.values.shape[-1]
    products = np.einsum("bapk,ac,bcql->pqkl", element.values, element.mass, element.values)
    p, q = element.upper
    energies = np.where((p == q)[:, None, None], 1.0, 2.0) * 0.5 * (products[p, q] + products[p, q].transpose(0, 2, 1))
    moments = element.moments
    work: Array = np.zeros((moments + dim * (dim + 1), number))
    work[:moments, :moments] = np.eye(moments)
    gradients = np.vstack([-np.ones(dim), np.eye(dim)])
    shear = np.where(np.arange(number - moments) < dim, 1.0, 2.0)
    for a in range(dim + 1):
        for c in range(dim):
            row = moments + a * dim + c
            for i, members in enumerate(facet_vertices(dim)):
                for place in np.flatnonzero(members == a):
                    work[row, (i * dim + int(place)) * dim + c] -= 1.0
            work[row, moments:] = shear * voigt(np.outer(np.eye(dim)[c], gradients[a]))
    return work, energies
