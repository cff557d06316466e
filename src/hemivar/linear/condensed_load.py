"""A load condensed onto the unknowns that a factorisation keeps, and the error where nothing else holds the others."""

from __future__ import annotations

from dataclasses import dataclass

from hemivar.basics.types import Array
from hemivar.errors import ProblemError

__all__ = ["CondensedLoad", "singular_interior"]


@dataclass(frozen=True, eq=False)
class CondensedLoad:
    """A load f, taken over to the kept unknowns."""

    load: Array  # (n,)
    force: Array  # (k,): ``f_C - K_CI K_II^-1 f_I``
    work: float  # ``f_I' K_II^-1 f_I``
    inner: Array | None = (
        None  # (n - k,): what a sweep through one half of the factors leaves of the rest, if it was one
    )


def singular_interior() -> ProblemError:
    """What is wrong where the unknowns that are not kept can move freely."""
    return ProblemError(
        "the stiffness matrix is singular apart from the contact boundary: a part of the body can move freely; "
        "add a support, or remove unconnected cells"
    )
