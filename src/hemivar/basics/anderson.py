"""Anderson's mixing: fixed points from a few values of a map that need not contract."""

from __future__ import annotations

import math

import numpy as np
import scipy.linalg as la

from hemivar.basics.types import Array

__all__ = ["Anderson"]

#: Combinations of changes that are smaller parts of the largest one are rounding.
_ROUNDED = 1e-12
#: Evaluations without a smaller change than before after which kinks of the map are taken to mislead what is mixed.
_PATIENCE = 40
#: Evaluations near the place with the least change, until all is mixed again from the best of them.
_WALK = 10
#: Part of the change that is gone by there at first, and what it is changed by where that was too far, or well.
_PART, _SHORTER, _LONGER = 0.25, 0.25, 2.0


class Anderson:
    """Where to evaluate a map next, for a fixed point of it (Anderson, 10.1145/321296.321305).

    Of all combinations of the places so far the one whose change by the map would be the least, were the map affine,
    goes on by its change.  For affine maps this does as well as GMRES (Walker and Ni, 10.1137/10078356X): how
    many places are needed follows from how many directions do not contract, and not by how strongly they do not.

    Kinks of a map may mislead it in circles: where the least change has long been the same, parts of the change at that
    place are tried, and then all is mixed again.
    """

    def __init__(self) -> None:
        self._iterates: list[Array] = []
        self._changes: list[Array] = []
        self._least, self._best = math.inf, (np.zeros(0), np.zeros(0))
        self._idle = self._walk = 0
        self._part = _PART

    def after(self, iterate: Array, change: Array) -> Array:
        """The next place (n,), after one (n,) that the map changes by ``change`` (n,)."""
        size = float(np.linalg.norm(change))
        if size < self._least:
            self._least, self._best, self._idle = size, (iterate, change), 0
            self._part = min(1.0, _LONGER * self._part)
        else:
            self._idle += 1
            self._part *= _SHORTER
        if self._walk:
            self._walk -= 1
            if not self._walk:
                iterate, change = self._best
                self._idle = 0
        elif self._idle >= _PATIENCE:
            self._walk, self._part = _WALK, _PART
            self._iterates.clear()
            self._changes.clear()
        if self._walk:
            best, direction = self._best
            return best + self._part * direction
        return self._mixed(iterate, change)

    def _mixed(self, iterate: Array, change: Array) -> Array:
        """The place that all places so far tell."""
        self._iterates.append(iterate)
        self._changes.append(change)
        del self._iterates[: -iterate.size - 1], self._changes[: -iterate.size - 1]  # more say nothing new
        if len(self._iterates) == 1:
            return iterate + change
        turns = np.diff(np.column_stack(self._changes))
        sizes = np.linalg.norm(turns, axis=0)
        turns /= np.where(sizes > 0.0, sizes, 1.0)
        weights = la.lstsq(turns, change, cond=_ROUNDED, lapack_driver="gelsy", check_finite=False)[0]
        weights /= np.where(sizes > 0.0, sizes, 1.0)
        steps = np.diff(np.column_stack(self._iterates))
        return np.asarray(iterate + change - (steps + np.diff(np.column_stack(self._changes))) @ weights)
