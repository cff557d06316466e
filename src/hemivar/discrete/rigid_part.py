"""The part of a displacement that deforms nothing, of bodies that supports do not hold."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from hemivar.basics.arrays import SAME
from hemivar.basics.types import Array

__all__ = ["RigidPart"]


@dataclass(frozen=True, eq=False)
class RigidPart:
    """The projection of displacements onto the motions that deform nothing.

    The forces of a stiffness along them are zero but for its rounding, which is no resistance: a body that only
    friction holds would slide until it balances what friction leaves.  So they are taken off before a product.
    """

    basis: sp.csr_array  # (n, a): orthonormal columns
    groups: tuple[slice, ...] = ()  # the columns of each group of motions

    @classmethod
    def of(cls, motions: sp.sparray, groups: Sequence[slice]) -> RigidPart:
        """Of some motions (n, a), those of different groups moving nothing in common."""
        columns, blocks, slices, count = sp.csc_array(motions), [], [], 0
        for group in groups:
            own = columns[:, group]
            seen = np.unique(own.indices)
            left, sizes, _ = np.linalg.svd(own[seen].toarray(), full_matrices=False)
            left = left[:, sizes > SAME * sizes.max(initial=0.0)]
            entries = np.repeat(seen, left.shape[1]), np.tile(np.arange(left.shape[1]), seen.size)
            blocks.append(sp.csc_array((left.ravel(), entries), shape=(columns.shape[0], left.shape[1])))
            slices.append(slice(count, count + left.shape[1]))
            count += left.shape[1]
        return cls(sp.csr_array(sp.hstack(blocks)), tuple(slices)) if count else cls.none(columns.shape[0])

    @classmethod
    def none(cls, unknowns: int) -> RigidPart:
        """Of no motions."""
        return cls(sp.csr_array((unknowns, 0)))

    @property
    def count(self) -> int:
        """How many motions there are."""
        return int(self.basis.shape[1])

    def __call__(self, x: Array) -> Array:
        """The part of a displacement (n,)."""
        return np.asarray(self.basis @ (self.basis.T @ x))

    def without(self, x: Array, far: float, origin: Array | float = 0.0) -> tuple[Array, Array]:
        """``x (n,)`` without the rigid part of the displacement ``x + origin``, and the sizes (n,) of what is left.

        Among these a rigid motion counts as ``far`` as gaps, displacements of supports and laws ask for it: one that
        goes beyond, as where a body slides away, does not excuse what it leaves.
        """
        if not self.count:
            return x, np.abs(x)
        rigid = self(x + origin)
        most, strained = float(np.abs(rigid).max(initial=0.0)), x - rigid
        return strained, np.abs(strained) + (min(1.0, far / most) if most > 0.0 else 0.0) * np.abs(rigid)
