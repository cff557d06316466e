"""Which facets stand in columns along normals: a tree of boxes, walked by all columns at once."""

from __future__ import annotations

import numpy as np

from hemivar.basics.types import Array, IntArray

__all__ = ["FacetTree"]

#: Boxes from which the walk down the tree begins, and bits of a place along an axis.
_TOP, _BITS = 8, 16


class FacetTree:
    """Facets along a curve that fills space (Morton 1966), with boxes around pairs, pairs of pairs and so on."""

    def __init__(self, corners: Array) -> None:
        """``corners (n, d, d)`` of the facets."""
        self._order = _along_curve(corners.mean(axis=1))
        low, high = corners.min(axis=1)[self._order], corners.max(axis=1)[self._order]
        self._boxes = [_boxes(low, high)]
        while len(low) > _TOP:
            pairs = np.arange(0, len(low), 2)
            low, high = np.minimum.reduceat(low, pairs), np.maximum.reduceat(high, pairs)
            self._boxes.append(_boxes(low, high))

    def near(
        self, middle: Array, axis: Array, radius: Array, between: tuple[Array, Array] | None = None
    ) -> tuple[IntArray, IntArray]:
        """Pairs (p,) of columns and facets that may lie in them; none that does is left out.

        A column (k,) is round: all places within ``radius`` of the line through ``middle (k, d)`` along the unit vector
        ``axis (k, d)``, with no end, or ``between`` two places along it.
        """
        columns, tops = len(middle), len(self._boxes[-1][1])
        first, box = np.repeat(np.arange(columns), tops), np.tile(np.arange(tops), columns)
        for level in range(len(self._boxes) - 1, -1, -1):
            centre, half, size = self._boxes[level]
            offset, turn = centre[box] - middle[first], axis[first]
            along = np.einsum("pd,pd->p", offset, turn)
            if between is not None:
                reach = np.einsum("pd,pd->p", half[box], np.abs(turn))
                met = (along + reach >= between[0][first]) & (along - reach <= between[1][first])
                first, box, offset, along = first[met], box[met], offset[met], along[met]
            across = np.einsum("pd,pd->p", offset, offset) - along * along
            met = across <= (radius[first] + size[box]) ** 2
            first, box = first[met], box[met]
            if level:
                first, box = np.repeat(first, 2), np.repeat(2 * box, 2)
                box[1::2] += 1
                there = box < len(self._boxes[level - 1][1])
                first, box = first[there], box[there]
        return first, self._order[box]


def _boxes(low: Array, high: Array) -> tuple[Array, Array, Array]:
    """Middles, half widths and half diagonals of boxes; a little wider, so that rounding leaves nothing out."""
    middle, half = 0.5 * (low + high), 0.5 * (high - low)
    half = half + 1e-9 * half.max(axis=1, keepdims=True) + 8.0 * np.finfo(float).eps * np.abs(middle)
    return middle, half, np.linalg.norm(half, axis=1)


def _along_curve(middle: Array) -> IntArray:
    """The order (n,) of places by Morton's curve."""
    low, dim = middle.min(axis=0), middle.shape[1]
    size = float(np.ptp(middle, axis=0).max())
    cell = ((middle - low) * (((1 << _BITS) - 1) / (size or 1.0))).astype(np.int64)
    key = np.zeros(len(middle), dtype=np.int64)
    for bit in range(_BITS):
        for a in range(dim):
            key |= ((cell[:, a] >> bit) & 1) << (bit * dim + a)
    return np.argsort(key, kind="stable")
