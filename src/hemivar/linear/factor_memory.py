"""How much memory a condensation will take (fill-in of the factors, Schur complement), and how much there is."""

from __future__ import annotations

import math

from hemivar.basics.memory import available_bytes, size_in_words
from hemivar.errors import MethodError
from hemivar.linear.pardiso import pardiso_available

__all__ = ["available_bytes", "check_memory", "factorisation_bytes", "shortage"]

#: By dimension, for SuperLU with minimum degree (benchmarks/factor_memory.py): bytes over ``n log2 n`` in 2D and over
#: ``n^1.5`` in 3D (nested dissection would give n^(4/3)), and the number of dense matrices on the contact unknowns.
_SUPERLU = {2: (130.0, 4.0), 3: (222.0, 8.0)}
#: The same for PARDISO with METIS, over ``n^(4/3)`` in 3D.
_PARDISO = {2: (58.0, 4.0), 3: (190.0, 8.0)}
#: What the prediction is multiplied by before it is held against the memory that is free: the largest underestimate
#: seen, and a little.
_SAFETY = 1.25


def factorisation_bytes(unknowns: int, dimension: int, contact: int, many: bool = False) -> float:
    """Bytes that condensing a problem and solving it by :class:`NonsmoothNewton` take beyond the problem itself.

    A fit to measurements with linear elements on uniform meshes, by the factorisation that :func:`factorise` takes
    here; it was off by at most 25 % in 2D up to 1.05 million unknowns and 10 % in 3D up to 0.1 million.

    ``unknowns, contact``: unknowns n, and those of them on the contact boundary; ``dimension``: of the body; ``many``:
    for many loads, as of :func:`factorise`.
    """
    pardiso = pardiso_available() and not (many and dimension == 2)
    factor, dense = (_PARDISO if pardiso else _SUPERLU).get(dimension, (100.0, 8.0))
    n = float(max(unknowns, 2))
    growth = n * math.log2(n) if dimension == 2 else n ** (4.0 / 3.0 if pardiso else 1.5) if dimension == 3 else n
    return factor * growth + dense * 8.0 * float(contact) ** 2


def check_memory(unknowns: int, dimension: int, contact: int, many: bool = False) -> None:
    """Refuse a condensation that would not fit.

    Raises MethodError: the prediction, with a safety factor, is more than what is available.
    """
    free = available_bytes()
    needed = _SAFETY * factorisation_bytes(unknowns, dimension, contact, many)
    if free is not None and needed > free:
        raise MethodError(
            f"the factorisation of {unknowns} unknowns, {contact} of them on the contact boundary, needs about "
            f"{size_in_words(needed)} of memory, and {size_in_words(free)} are free; {_REMEDY}"
        )


def shortage(unknowns: int, contact: int, condensed: bool = True) -> MethodError:
    """The error for a problem that still ran out of memory; ``condensed`` if it was to be factorised."""
    remedy = _REMEDY if condensed else "take fewer cells, or a machine with more memory"
    return MethodError(f"memory ran out for {unknowns} unknowns, {contact} of them on the contact boundary; {remedy}")


_REMEDY = "take the multigrid method (--method multigrid), which needs no factorisation of this size, or fewer cells"
