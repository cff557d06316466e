"""Stiffness of cells with quadratic displacements, from matrices of the reference simplex."""

from __future__ import annotations

import math
from functools import cache

import numpy as np

from hemivar.basics.types import Array
from hemivar.certificates.continuous.split_element import pairs_of, voigt_map
from hemivar.fem.elements import shape_derivatives
from hemivar.fem.quadrature import quadrature_rule

__all__ = ["quadratic_blocks"]


def quadratic_blocks(stiffness: Array, jacobian: Array) -> Array:
    """Stiffness matrices (M, k, k) of quadratic displacements, all components of each node one after another.

    With ``x = B x^ + b`` and ``v^ = B'v`` strains become ``B' eps B``.

    ``stiffness`` is (M or 1, v, v); ``jacobian`` is (M, d, d).
    """
    dim = jacobian.shape[-1]
    change = voigt_map(np.asarray(np.linalg.inv(jacobian), dtype=float))
    size = np.abs(np.linalg.det(jacobian))
    pulled = (change @ stiffness @ change.transpose(0, 2, 1)) * size[:, None, None]
    reference = _reference(dim)
    rows, columns = np.triu_indices(pulled.shape[-1])
    nodes = reference.shape[-1] // dim
    blocks = pulled[:, rows, columns] @ reference.reshape(len(reference), -1)
    blocks = blocks.reshape(len(pulled), nodes, dim, nodes, dim)
    blocks = np.einsum("majbl,mij->maibl", blocks, jacobian, optimize=True)
    blocks = np.einsum("majbl,mkl->majbk", blocks, jacobian, optimize=True)
    return np.asarray(blocks.reshape(len(pulled), nodes * dim, nodes * dim))


@cache
def _reference(dim: int) -> Array:
    """The matrix of the reference simplex for each entry of the upper triangle of the elasticity matrix."""
    pairs = pairs_of(dim)
    gradients = np.vstack([-np.ones(dim), np.eye(dim)])
    total: Array | float = 0.0
    for barycentric, weight in zip(*quadrature_rule(dim, 2), strict=True):
        slope = shape_derivatives(2, barycentric) @ gradients
        strain = np.zeros((len(pairs), len(slope), dim))
        for row, (i, j) in enumerate(pairs):
            strain[row, :, i] += slope[:, j]
            if i != j:
                strain[row, :, j] += slope[:, i]
        flat = strain.reshape(len(pairs), -1)
        total = total + weight / math.factorial(dim) * np.einsum("pa,qb->pqab", flat, flat)
    products = np.asarray(total)
    p, q = np.triu_indices(len(pairs))
    factor = np.where((p == q)[:, None, None], 1.0, 2.0)
    return np.asarray(factor * 0.5 * (products[p, q] + products[p, q].transpose(0, 2, 1)))
