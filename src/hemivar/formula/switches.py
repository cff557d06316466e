"""Kinks and jumps of a formula of one variable: zeros of what abs, min, max and conditions compare."""

from __future__ import annotations

import numpy as np

from hemivar.basics.types import Array
from hemivar.errors import ProblemError
from hemivar.formula.graph import Graph
from hemivar.formula.smooth import WIDE, SmoothFormula

__all__ = ["Switches"]

#: Places at which the branches of a formula may change, twice the knots of a law, and branches of one part.
_MOST_SWITCHES, _MOST_BRANCHES = 2000, 200


class Switches:
    """The places where the branches of every part of a formula may change, each found once."""

    def __init__(self, graph: Graph, variable: str, reach: float, shown: str) -> None:
        self.graph, self.variable, self.reach, self.shown = graph, variable, reach, shown
        self.wide = 2.0 * WIDE * reach
        self.sure = True
        self._breaks: dict[int, Array] = {}
        self._zeros: dict[int, Array] = {}

    def breaks(self, node: int) -> Array:
        """Places where the branch of a part may change."""
        if node not in self._breaks:
            parts = [self.zeros(difference) for difference in self.graph.switching(node)]
            places = _merged(np.concatenate([np.zeros(0), *parts]))
            if places.size > _MOST_SWITCHES:
                raise ProblemError(
                    f"{self.shown} changes its branch at more than {_MOST_SWITCHES} places up to the reach "
                    f"{self.reach:g}; take a smaller reach, or give a table"
                )
            self._breaks[node] = places
        return self._breaks[node]

    def zeros(self, node: int) -> Array:
        """Zeros of what a switch compares, in the intervals in which its branches hold."""
        if node in self._zeros:
            return self._zeros[node]
        ends = np.concatenate([[-self.wide], self.breaks(node), [self.wide]])
        at_middle = self.graph.branches(node, self.variable, 0.5 * (ends[1:] + ends[:-1]))
        branches = np.unique(at_middle)
        if branches.size > _MOST_BRANCHES:
            raise ProblemError(f"{self.shown} has more than {_MOST_BRANCHES} branches; simplify it, or give a table")
        roots = [np.zeros(0)]
        for branch in branches.tolist():
            smooth = SmoothFormula(self.graph, branch, self.variable)
            places = smooth.zeros(self.reach)
            if places is None:
                self.sure = False
                places = _sign_changes(smooth, self.reach)
            for low, high in zip(ends[:-1][at_middle == branch], ends[1:][at_middle == branch], strict=True):
                slack = 1e-12 * max(1.0, *(abs(x) for x in (low, high) if abs(x) < self.wide), 0.0)
                roots.append(places[(places >= low - slack) & (places <= high + slack)])
        self._zeros[node] = _merged(np.concatenate(roots))
        return self._zeros[node]


def _merged(places: Array) -> Array:
    """Sorted, and those that differ by rounding only taken together."""
    places = np.sort(places)
    keep = np.ones(places.size, dtype=bool)
    keep[1:] = np.diff(places) > 1e-12 * np.maximum(1.0, np.abs(places[1:]))
    return np.asarray(places[keep])


def _sign_changes(smooth: SmoothFormula, reach: float) -> Array:
    """Zeros where the sign changes between places on a linear and on a logarithmic scale."""
    fine = np.geomspace(1e-9 * reach, reach, 1500)
    grid = np.unique(np.concatenate([-fine, np.linspace(-reach, reach, 20_001), fine]))
    values = smooth(grid)
    roots = grid[values == 0.0] if np.count_nonzero(values == 0.0) < 50 else np.zeros(0)
    changes = np.flatnonzero(values[:-1] * values[1:] < 0.0)
    return np.concatenate([roots, smooth.crossings(grid[changes], grid[changes + 1])])
