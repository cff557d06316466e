"""Which facets of one mesh of a boundary lie over those of another."""

from __future__ import annotations

import numpy as np

from hemivar.basics.types import Array, BoolArray

__all__ = ["facet_cover"]

#: Part of a facet by which another one must lie over it.
_OVER = 1e-6
#: Part of the boundary within which a facet is flat.
_FLAT = 1e-9


def facet_cover(mine: Array, others: Array) -> BoolArray:
    """Whether facets may have inner points in common, shape (k, m): never False where they have.

    They are told by their boxes, so that in space some are found that are only near.

    ``mine`` is (k, d, d); ``others`` is (m, d, d).
    """
    low, high = mine.min(axis=1), mine.max(axis=1)
    below, above = others.min(axis=1), others.max(axis=1)
    flat = _FLAT * float(np.ptp(mine.reshape(-1, mine.shape[2]), axis=0).max(initial=0.0))
    found = np.ones((len(mine), len(others)), dtype=bool)
    for axis in range(mine.shape[2]):
        least = np.minimum(high[:, None, axis] - low[:, None, axis], above[:, axis] - below[:, axis])
        common = np.minimum(high[:, None, axis], above[:, axis]) - np.maximum(low[:, None, axis], below[:, axis])
        found &= common >= _OVER * least - flat
    return found
