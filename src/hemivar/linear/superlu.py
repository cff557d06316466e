"""SuperLU's sparse factors, made where Ctrl-C is answered, and given back where they were made."""

from __future__ import annotations

import os
import threading
import weakref
from collections.abc import Callable
from queue import SimpleQueue

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spla

from hemivar.basics.types import Array, IntArray
from hemivar.linear.condensed_load import singular_interior
from hemivar.linear.definite import positive_pivots

__all__ = ["LUFactors", "abandoned_work", "superlu"]

#: Matrices up to this size are factorised in less time than a thread of its own is worth.
_QUICK = 5_000
#: What the last task finds.
_END = object()


class _Maker:
    """A thread that makes factors and drops them.

    SciPy keeps a list of what SuperLU has allocated for each thread: in another one nothing is given back.
    """

    def __init__(self) -> None:
        self._tasks: SimpleQueue[Callable[[], object]] = SimpleQueue()
        self._thread = threading.Thread(target=self._serve, daemon=True)
        self._thread.start()
        weakref.finalize(self, self._end)  # runs when Python shuts down, after those of the factors

    def _serve(self) -> None:
        while self._tasks.get()() is not _END:
            pass

    def _end(self) -> None:
        self._tasks.put(lambda: _END)
        self._thread.join()

    def result(self, work: Callable[[], spla.SuperLU]) -> list[spla.SuperLU]:
        """What some work finds, alone in a list; after an interruption it is left to itself and dropped.

        The library cannot be stopped in the middle.  Python must not shut down beside it: the end of the process waits.
        """
        done, factors, failed = threading.Event(), [], []  # type: ignore[var-annotated]

        def run() -> None:
            try:
                factors.append(work())
            except BaseException as error:
                failed.append(error)
            done.set()

        try:
            self._tasks.put(run)
            done.wait()
        except KeyboardInterrupt:
            _abandoned.append(done)
            raise
        if failed:
            raise failed[0]
        return factors

    def drop(self, made: list[spla.SuperLU]) -> None:
        """Empty a list of factors that were made here."""
        self._tasks.put(made.clear)


#: Ends of factorisations that were interrupted; the thread at work, none before the first and after a fork.
_abandoned: list[threading.Event] = []
_maker: _Maker | None = None


def _forget() -> None:
    global _maker
    _maker = None


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_forget)


def abandoned_work() -> bool:
    """Whether a factorisation that was interrupted is still running; a process that cannot wait ends by os._exit."""
    return not all(done.is_set() for done in _abandoned)


class LUFactors:
    """Factors of a matrix (n, n); what they hold is given back with them.

    ``columns, rows (n,)``: permutations, where those of the matrix have gone.
    """

    def __init__(self, made: list[spla.SuperLU], maker: _Maker | None = None) -> None:
        self._made = made
        self.n = int(made[0].shape[0])
        self.columns: IntArray = np.array(made[0].perm_c)  # what they hold themselves would keep them all
        self.rows: IntArray = np.array(made[0].perm_r)
        if maker is not None:
            # Not at the end of the process, where a thread may still solve with them.
            weakref.finalize(self, maker.drop, made).atexit = False

    @property
    def symmetric(self) -> bool:
        """Whether no rows were exchanged."""
        return np.array_equal(self.rows, self.columns)

    @property
    def positive(self) -> bool:
        """Whether the matrix is positive definite, as far as rounding lets one see."""
        return positive_pivots(self._made[0])

    def triangles(self) -> tuple[sp.csc_array, sp.csc_array]:
        """L and U."""
        return self._made[0].L, self._made[0].U

    def solve(self, rhs: Array) -> Array:
        """``matrix^-1 rhs``, of a vector (n,) or columns (n, k)."""
        return np.asarray(self._made[0].solve(rhs))


def superlu(matrix: sp.csc_array, ordering: str) -> LUFactors:
    """The factors of a symmetric matrix, ``ordering`` as for :func:`scipy.sparse.linalg.splu`.

    Raises ProblemError: it is singular; MemoryError: the factors need more memory than there is.
    """
    global _maker

    def factorise() -> spla.SuperLU:
        return spla.splu(
            matrix,
            permc_spec=ordering,
            diag_pivot_thresh=0.0,
            options={"SymmetricMode": True, "Equil": False},
        )

    try:
        if matrix.shape[0] <= _QUICK and threading.current_thread() is threading.main_thread():
            return LUFactors([factorise()])
        maker = _maker = _maker or _Maker()
        try:
            return LUFactors(maker.result(factorise), maker)
        except KeyboardInterrupt:
            _maker = None  # the next one does not wait for what was left
            raise
    except RuntimeError as error:
        if "singular" in str(error):
            raise singular_interior() from error
        if "memory" in str(error).lower() or "malloc" in str(error).lower():
            raise MemoryError(str(error)) from error
        raise
