"""Whether a stiffness matrix is positive definite: its lowest eigenvalue or Rayleigh quotient, by its numbers.

All eigenvalues are those of ``D^-1/2 K D^-1/2``, D the diagonal of K, so that units and scale do not matter.  Rounding
moves them by about :func:`rounding`; what lies within that of zero counts as zero, neither definite nor indefinite.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spla

from hemivar.basics.types import Array
from hemivar.errors import ProblemError
from hemivar.linear.levels import COARSEST
from hemivar.linear.products import portions, product

__all__ = [
    "EIGENVALUE",
    "FEW",
    "REPEATED",
    "below_zero",
    "indefinite",
    "lowest_quotient",
    "positive",
    "positive_pivots",
    "quotient",
    "refuse_indefinite",
    "rounding",
]

#: Rows up to which the eigenvalue that is sought is taken from all, for Lanczos' method takes as long.
FEW = 40
#: Rows up to which every step of an iteration may solve with a dense matrix.
REPEATED = 1500
#: Relative accuracy of an eigenvalue; a bound is raised by as much.
EIGENVALUE = 1e-8
#: What rounding in the entries may amount to, in units of the last place of the largest row.
_ULPS = 64.0


def rounding(matrix: sp.csr_array, diagonal: Array | None = None) -> float:
    """What rounding may make of an eigenvalue that is zero."""
    root = np.sqrt(matrix.diagonal() if diagonal is None else diagonal)
    sums = [float((product(part, 1.0 / root) / root[rows]).max()) for rows, part in portions(matrix, np.abs)]
    return float(_ULPS * np.finfo(float).eps * np.max(sums, initial=1.0))


def quotient(matrix: sp.csr_array, vector: Array, diagonal: Array | None = None) -> float:
    """Rayleigh quotient ``v'K v / v'D v``: K has an eigenvalue that is no larger."""
    d = matrix.diagonal() if diagonal is None else diagonal
    v = vector / max(float(np.abs(vector).max(initial=0.0)), np.finfo(float).tiny)
    size = float(v @ (d * v))
    return float(v @ (matrix @ v)) / size if size > 0.0 else 0.0


def lowest_quotient(matrix: sp.csr_array, steps: int = 40) -> float:
    """An upper bound of the smallest eigenvalue, near to it: exact for small matrices, by Lanczos steps for others."""
    diagonal = matrix.diagonal()
    root = np.sqrt(diagonal)
    n = root.size
    if n == 0:
        return 1.0
    if n <= COARSEST:
        _, vectors = np.linalg.eigh(matrix.toarray() / np.outer(root, root))
        return quotient(matrix, vectors[:, 0] / root, diagonal)
    scaled = spla.LinearOperator((n, n), matvec=lambda x: (matrix @ (x.ravel() / root)) / root, dtype=float)
    start = np.random.default_rng(13).standard_normal(n)
    try:
        _, vectors = spla.eigsh(scaled, k=1, which="SA", v0=start, ncv=min(steps, n - 1), maxiter=4, tol=1e-3)
    except spla.ArpackNoConvergence as error:
        vectors = error.eigenvectors
    if not vectors.size:
        vectors = _lanczos(scaled, start, steps)[:, None]
    return quotient(matrix, vectors[:, 0] / root, diagonal)


def _lanczos(operator: spla.LinearOperator, start: Array, steps: int) -> Array:
    """The lowest Ritz vector after so many steps, the basis being kept orthogonal."""
    basis = [start / np.linalg.norm(start)]
    for _ in range(steps):
        w = operator @ basis[-1]
        for _ in range(2):
            w = w - np.array(basis).T @ (np.array(basis) @ w)
        size = float(np.linalg.norm(w))
        if size < 1e-12:
            break
        basis.append(w / size)
    Q = np.array(basis).T
    image = np.stack([operator @ q for q in Q.T], axis=1)
    projected = Q.T @ image
    return np.asarray(Q @ np.linalg.eigh(0.5 * (projected + projected.T))[1][:, 0])


def positive(matrix: Array) -> bool:
    """Whether a dense symmetric matrix (n, n) has a factor of Cholesky."""
    try:
        np.linalg.cholesky(matrix)
    except np.linalg.LinAlgError:
        return False
    return True


def positive_pivots(factor: spla.SuperLU) -> bool:
    """Whether the pivots of a symmetric factorisation are positive, so that the matrix is definite up to rounding.

    That follows only if no rows were exchanged; False where they were.
    """
    return bool(np.array_equal(factor.perm_r, factor.perm_c) and np.all(factor.U.diagonal() > 0.0))


def indefinite(matrix: sp.csr_array) -> float | None:
    """An eigenvalue below zero by more than rounding, None if there is none; costs a factorisation."""
    guard = rounding(matrix)
    diagonal = matrix.diagonal()
    root = np.sqrt(diagonal)
    n = root.size
    if n <= COARSEST:
        lowest = lowest_quotient(matrix)
        return lowest if lowest < -guard else None
    shifted = sp.csc_array(matrix + sp.diags_array(guard * diagonal))
    options = {"SymmetricMode": True, "Equil": False}
    lowest = 0.0
    try:
        factor = spla.splu(shifted, "MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=options)
        if positive_pivots(factor):
            return None
        # the negative eigenvalue next to zero is the lowest of the inverse
        inverse = spla.LinearOperator((n, n), matvec=lambda x: root * factor.solve(root * x.ravel()), dtype=float)
        start = np.random.default_rng(13).standard_normal(n)
        _, vectors = spla.eigsh(inverse, k=1, which="SA", v0=start, tol=1e-3)
        lowest = quotient(matrix, vectors[:, 0] / root, diagonal)
    except (RuntimeError, spla.ArpackError):
        pass
    if lowest >= -guard:
        lowest = lowest_quotient(matrix, 200)
    return lowest if lowest < -guard else None


def below_zero(matrix: sp.csr_array, eigenvalue: float, diagonal: Array | None = None) -> float | None:
    """An eigenvalue of a matrix that is below zero by more than rounding, or None."""
    return eigenvalue if eigenvalue < -rounding(matrix, diagonal) else None


def refuse_indefinite(lowest: float | None) -> None:
    """Refuse a stiffness matrix with a negative eigenvalue.

    Raises ProblemError: naming the eigenvalue.
    """
    if lowest is not None:
        raise ProblemError(
            f"the stiffness is not positive semidefinite (scaled to a unit diagonal, its lowest eigenvalue is at most "
            f"{lowest:.3g}); check the signs and the assembly of the matrix"
        )
