"""Contact unknowns of a level smoothed point by point, where contact is much stiffer than the body."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from hemivar.basics.types import Array, IntArray
from hemivar.linear.pyamg_kernels import kernels

if TYPE_CHECKING:
    from hemivar.linear.truncated_level import Level, TruncatedLevel

__all__ = ["PointSmoother", "Points"]


class Points:
    """Where the contact unknowns of a level stand in blocks of one contact point each; never changed."""

    def __init__(self, level: Level, points: IntArray) -> None:
        _, number = np.unique(points, return_inverse=True)
        order = np.argsort(number, kind="stable")
        start = np.searchsorted(number[order], np.arange(number.max() + 1))
        place = np.empty_like(number)
        place[order] = np.arange(number.size) - start[number[order]]
        self.size, self.count = int(place.max()) + 1, int(number.max()) + 1
        #: The row of each contact unknown in the blocks.
        self.slots = slots = number * self.size + place
        inside = np.full(level.matrix.shape[0], -1)
        inside[level.contact] = np.arange(level.contact.size)
        column = inside[level.columns]
        #: Which of the entries of the contact rows are between contact unknowns, and between which.
        self.entries = np.flatnonzero(column >= 0)
        self.rows, self.columns = level.rows[self.entries], column[self.entries]
        empty = np.setdiff1d(np.arange(self.count * self.size), slots)
        row, col = np.append(slots[self.rows], empty), np.append(slots[self.columns], empty)
        keys, block = np.unique(row // self.size * self.count + col // self.size, return_inverse=True)
        #: The place of each of them among the numbers of the blocks; behind them those of rows that stand for nothing.
        self.flat = (block * self.size + row % self.size) * self.size + col % self.size
        self.indices = (keys % self.count).astype(np.int32)
        self.indptr = np.searchsorted(keys, np.arange(self.count + 1) * self.count).astype(np.int32)
        self.diagonal = np.searchsorted(keys, np.arange(self.count) * (self.count + 1))


class PointSmoother:
    """The contact unknowns of a level by themselves, smoothed point by point.

    Friction that has hardly begun to slip is very stiff across the direction of slip, which lies anywhere between the
    unknowns of the point: one at a time they would hardly move.
    """

    def __init__(self, changed: TruncatedLevel, points: Points) -> None:
        level, values = changed.level, changed.values
        self.rows = changed.rows
        self.contact, self.points = level.contact, points
        size = points.size
        entries = np.append(values[points.entries], np.ones(points.flat.size - points.entries.size))
        # Columns of held unknowns meet zeros only; left in, they would put the rounding of the inverse there.
        entries[: points.entries.size][changed.held[points.columns] & (points.rows != points.columns)] = 0.0
        self.data = np.zeros(points.indices.size * size**2)
        self.data[points.flat] = entries
        self.inverse = np.linalg.inv(self.data.reshape(-1, size, size)[points.diagonal]).ravel()

    def smooth(self, x: Array, right: Array, forward: bool) -> None:
        """One sweep over the points, in place."""
        points = self.points
        rest, step = np.zeros(points.count * points.size), np.zeros(points.count * points.size)
        rest[points.slots] = right[self.contact] - self.rows @ x
        span = (0, points.count, 1) if forward else (points.count - 1, -1, -1)
        kernels().block_gauss_seidel(
            points.indptr, points.indices, self.data, step, rest, self.inverse, *span, points.size
        )
        x[self.contact] += step[points.slots]
