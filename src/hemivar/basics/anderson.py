"""Anderson's mixing: fixed points from a few values of a map that need not contract."""

from __future__ import annotations

import numpy as np
import scipy.linalg as la

from hemivar.basics.types import Array

__all__ = ["Anderson"]

#: Combinations of changes that are smaller parts of the largest one are rounding.
_ROUNDED = 1e-12


class Anderson:
    """Where to evaluate a map next, for a fixed point of it (Anderson, 10.1145/321296.321305).

    Of all combinations of the places so far the one whose change by the map would be the least, were the map affine,
    goes on by its change.  For affine maps this does as well as GMRES (Walker and Ni, 10.1137/10078356X): how many
    places are needed is told by how many directions do not contract, and not by how strongly they do not.
    """

    def __init__(self) -> None:
        self._places: list[Array] = []
        self._changes: list[Array] = []

    def after(self, place: Array, change: Array) -> Array:
        """The next place (n,), after one (n,) that the map changes by ``change`` (n,)."""
        self._places.append(place)
        self._changes.append(change)
        del self._places[: -place.size - 1], self._changes[: -place.size - 1]  # more say nothing new
        if len(self._places) == 1:
            return place + change
        turns = np.diff(np.column_stack(self._changes))
        sizes = np.linalg.norm(turns, axis=0)
        turns /= np.where(sizes > 0.0, sizes, 1.0)
        weights = la.lstsq(turns, change, cond=_ROUNDED, lapack_driver="gelsy", check_finite=False)[0]
        weights /= np.where(sizes > 0.0, sizes, 1.0)
        steps = np.diff(np.column_stack(self._places))
        return np.asarray(place + change - (steps + np.diff(np.column_stack(self._changes))) @ weights)
