"""The one check of arrays that users give, and the one norm."""

from __future__ import annotations

import math
from numbers import Complex, Real
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from hemivar.basics.arguments import described
from hemivar.basics.first_use import IMPORTS
from hemivar.basics.types import AnyArray, Array
from hemivar.errors import ProblemError

if TYPE_CHECKING:
    import scipy.sparse as sp

__all__ = [
    "CACHED",
    "COUNTS",
    "DIGITS",
    "LARGEST",
    "NULL",
    "PLAIN_SQUARES",
    "ROUNDED",
    "SAME",
    "SOLVED",
    "norm",
    "real_array",
    "real_matrix",
    "unmasked",
]

#: Part of the largest of their kind by which two numbers (coordinates, loads, prescribed values) may differ and be the
#: same: far above rounding (1e-16), far below what anybody means.
SAME = 1e-9
#: As many decimals are left of such numbers, over the largest, where they are sorted.
DIGITS = 9
#: Part of the largest of what a solve leaves that tells nothing: the default tolerance of one.
SOLVED = 1e-9
#: Part of the largest from which something counts that follows from what was solved for: a thousand times what a solve
#: leaves.  With half of it, and of the other parts here, tests/discrete find the same, but that half as much of a
#: residual is excused that rounding explains.
COUNTS = 1e-6
#: Part of the largest of what is summed up that is rounding: 4500 times that of one number, which a sum of as many
#: products may reach, and products of a few matrices on a mesh stay below.  Any value from 1e-14 on gives the same
#: answers in tests/fem, and any one up to 1e-9 in tests/laws/coupled.
ROUNDED = 1e-12
#: Part of the largest pivot, eigenvalue or entry below which one counts as zero: rounding of up to a million terms.
NULL = 1e-10
#: Lengths, times, entries and material constants are smaller than this, and larger than its inverse, so that their
#: products by three are numbers.
LARGEST = 1e100
#: Numbers that are worked on at a time: 2 MiB, about what a core caches.
CACHED = 1 << 18
#: Squares of norms between which no square of an entry that counts over- or underflows.
PLAIN_SQUARES = 1e-240, 1e240
#: What NumPy's kinds of entries that are no numbers are called.
_KINDS = {"S": "text", "U": "text", "b": "truth values"}


def real_array(value: object, name: str, ndim: int | None = None, *, finite: bool = True, own: bool = False) -> Array:
    """An array of floats made of what a user gave."""
    given = _checked(value, name)
    try:
        array = np.asarray(given, dtype=float)
    except (TypeError, ValueError, OverflowError) as error:
        raise ProblemError(f"{name} is not an array of numbers: {error}") from error
    if ndim is not None and array.ndim != ndim:
        raise ProblemError(f"{name} has shape {array.shape}; it must have {ndim} {'axis' if ndim == 1 else 'axes'}")
    if finite and not np.isfinite(array).all():
        index = np.unravel_index(int(np.flatnonzero(~np.isfinite(array).ravel())[0]), array.shape)
        where = f"[{', '.join(map(str, index))}]" if index else ""
        raise ProblemError(f"{name}{where} = {array[index]}; every number must be finite")
    if own and (array.flags.writeable or np.may_share_memory(array, given)):
        array = array.copy()
        array.flags.writeable = False
    return array


def real_matrix(value: object, name: str, *, own: bool = False) -> sp.csr_array:
    """A sparse matrix of finite floats, duplicates summed, made of a dense one or of any of SciPy's."""
    with IMPORTS:
        import scipy.sparse as sp  # only here: laws and the command do without it

    if not sp.issparse(value):
        dense = real_array(value, name)
        if dense.ndim > 2:
            raise ProblemError(f"{name} has shape {dense.shape}; it must have 2 axes")
        return sp.csr_array(np.atleast_2d(dense))
    sparse: sp.sparray = value
    _check_structure(sparse, name)
    _checked(sparse.data if sparse.format not in ("lil", "dok") else sparse.tocoo().data, name)
    try:
        given = isinstance(sparse, sp.csr_array) and sparse.dtype == np.float64
        matrix = sparse if given else sp.csr_array(sparse).astype(np.float64, copy=False)
    except (TypeError, ValueError) as error:
        raise ProblemError(f"{name} is not a matrix of numbers: {error}") from error
    if own or not matrix.has_canonical_format:
        matrix = matrix.copy()
        matrix.sum_duplicates()
    bad = np.flatnonzero(~np.isfinite(matrix.data))
    if bad.size:
        row = int(np.searchsorted(matrix.indptr, bad[0], side="right")) - 1
        entry = f"{name}[{row}, {matrix.indices[bad[0]]}]"
        raise ProblemError(f"{entry} = {matrix.data[bad[0]]}; every number must be finite")
    return matrix


def unmasked(value: object, name: str) -> object:
    """What was given, if it is no masked array."""
    if isinstance(value, np.ma.MaskedArray):
        raise ProblemError(f"{name} is a masked array, whose mask would be lost; fill it in, .filled(...)")
    return value


def _check_structure(matrix: sp.sparray, name: str) -> None:
    """Refuse a matrix whose rows or columns lead outside of it: SciPy reads memory there without a look."""
    where: list[tuple[AnyArray, int]]
    if matrix.format in ("csr", "csc", "bsr"):
        rows, columns = matrix.shape if matrix.format != "csc" else matrix.shape[::-1]
        if matrix.format == "bsr":
            rows, columns = rows // matrix.blocksize[0], columns // matrix.blocksize[1]
        starts, where = matrix.indptr, [(matrix.indices, columns)]
        stored = min(len(matrix.indices), len(matrix.data))
        if len(starts) != rows + 1 or starts[0] != 0 or (np.diff(starts) < 0).any() or starts[-1] > stored:
            raise ProblemError(f"{name} is a damaged sparse matrix: its row pointers do not fit; build it again")
    elif matrix.format == "coo":
        if len({len(matrix.row), len(matrix.col), len(matrix.data)}) != 1:
            raise ProblemError(f"{name} is a damaged sparse matrix: its lists differ in length; build it again")
        where = [(matrix.row, matrix.shape[0]), (matrix.col, matrix.shape[1])]
    else:
        return
    for index, count in where:
        if index.size and not 0 <= index.min() <= index.max() < count:
            worst = index.min() if index.min() < 0 else index.max()
            raise ProblemError(
                f"{name} is a damaged sparse matrix: it has an entry at {worst} of {count}; build it again"
            )


def _checked(value: object, name: str) -> AnyArray:
    """The array of what was given, if its entries may be real numbers."""
    value = unmasked(value, name)
    if hasattr(value, "tocsr"):
        raise ProblemError(f"{name} is a sparse matrix; give an array, .toarray()")
    try:
        given = np.asarray(value)
    except (TypeError, ValueError) as error:
        raise ProblemError(f"{name} is not an array of numbers: {error}") from error
    kind = given.dtype.kind
    entries: list[object] = list(given.ravel()) if kind == "O" else []
    if kind == "c" or any(isinstance(entry, Complex) and not isinstance(entry, Real) for entry in entries):
        raise ProblemError(f"{name} is complex; give real numbers (use .real to drop the imaginary part)")
    wrong = [entry for entry in entries if not isinstance(entry, Real) or isinstance(entry, bool)]
    if kind not in "iufO" or wrong or _holds_truth_values(value):
        what = f"is {_KINDS.get(kind, given.dtype.name)}" if kind not in "iufO" else "holds a truth value"
        raise ProblemError(f"{name} is not an array of numbers: it {f'holds {described(wrong[0])}' if wrong else what}")
    return given


def _holds_truth_values(value: object) -> bool:
    """Whether lists hold True or False, which NumPy takes for numbers where numbers stand beside them."""
    return isinstance(value, bool | np.bool_) or (
        isinstance(value, list | tuple) and any(map(_holds_truth_values, value))
    )


def norm(vector: ArrayLike) -> float:
    """Euclidean norm of all entries, without overflow or underflow on the way; inf or nan only if an entry is.

    It is ``s |x / s|`` with ``s`` the power of two next to the largest entry, so that nothing is rounded twice.
    """
    x = np.asarray(vector, dtype=float).ravel()
    square = float(np.vdot(x, x))  # which warns of no overflow
    if PLAIN_SQUARES[0] < square < PLAIN_SQUARES[1]:
        return math.sqrt(square)
    largest = float(np.abs(x).max(initial=0.0))
    if largest == 0.0 or not np.isfinite(largest):
        return largest
    exponent = int(np.frexp(largest)[1])
    if -400 < exponent < 400:
        return float(np.sqrt(x @ x))
    with np.errstate(over="ignore", under="ignore"):
        scaled = np.ldexp(x, -exponent)
        return float(np.ldexp(np.sqrt(scaled @ scaled), exponent))
