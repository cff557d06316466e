"""One thread for dense linear algebra while multigrid works: its dense matrices are too small to be shared out."""

from __future__ import annotations

from contextlib import AbstractContextManager, nullcontext
from functools import lru_cache
from typing import Any

__all__ = ["one_thread"]


@lru_cache
def _controller() -> Any:
    from threadpoolctl import ThreadpoolController

    return ThreadpoolController()


def one_thread(wanted: bool = True) -> AbstractContextManager[Any]:
    """A context in which BLAS takes one thread, if ``wanted``.

    With two threads on two cores, products of vectors and factorisations of matrices of a few hundred rows take
    longer than with one, for the threads wait for each other: a contact solve at 1/h = 512 takes half as long again.
    """
    limit: AbstractContextManager[Any] = _controller().limit(limits=1, user_api="blas") if wanted else nullcontext()
    return limit
