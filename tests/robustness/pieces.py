"""All solutions of a contact problem with a few points: every combination of the pieces of their laws is tried.

In the plane a contact point has a penetration, a slip and two forces, ``(r, s, p, q)``.  On a piece, or at a kink, its
laws are two linear equations and some inequalities in these; with ``r = r0 - S lam`` of the body a combination is one
small linear system.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

import numpy as np

from tests.robustness.expression import UnknownError
from tests.robustness.graphs import Graph

__all__ = ["Found", "Friction", "Line", "Points", "alpha_of", "damped", "lines_of", "mirrored"]

#: Combinations that are tried at most.
_MOST = 60_000


@dataclass(frozen=True)
class Line:
    """A part of a graph: ``force = base + slope place`` between two places, or a kink with forces between two.

    ``slope`` is None at a kink, whose place is ``low``; then ``base`` and ``high`` are its least and largest force.
    """

    low: float
    high: float
    base: float
    slope: float | None = None


def lines_of(graph: Graph) -> list[Line]:
    """The parts of a graph that is straight between its knots.

    Raises
    ------
    UnknownError
        It is not.
    """
    if graph.potential is not None:
        raise UnknownError("a law that is not straight on its pieces")
    pieces: list[tuple[float, float, float, float]] = []
    for piece, a, b in zip(graph.pieces, [-math.inf, *graph.knots], [*graph.knots, math.inf], strict=True):
        low, high = max(a, graph.lower), min(b, graph.upper)
        if not low < high:
            continue
        first = low if math.isfinite(low) else high - 1.0 if math.isfinite(high) else 0.0
        last = high if math.isfinite(high) else first + 1.0
        at = [piece((1.0 - part) * first + part * last) for part in (0.25, 0.5, 0.75)]
        slope = 2.0 * (at[2] - at[0]) / (last - first)
        if abs(at[0] - 2.0 * at[1] + at[2]) > 1e-9 * max(map(abs, at)):
            raise UnknownError("a law that is not straight on its pieces")
        pieces.append((low, high, at[1] - slope * 0.5 * (first + last), slope))
    found = [Line(*piece) for piece in pieces]
    ends = [abs(base + slope * end) for *both, base, slope in pieces for end in both if math.isfinite(end)]
    rounding = 1e-12 * max(ends, default=0.0)
    for left, right in itertools.pairwise(pieces):
        forces = sorted(base + slope * left[1] for _, _, base, slope in (left, right))
        if forces[1] - forces[0] > rounding:
            found.append(Line(left[1], forces[1], forces[0]))
    for end, force in ((graph.lower, -math.inf), (graph.upper, math.inf)):
        if math.isfinite(end):
            beside = [base + slope * end for low, high, base, slope in pieces if end in (low, high)]
            known = beside[0] if beside else -force  # no piece at all: any force
            found.append(Line(end, max(known, force), min(known, force)))
    return found


def damped(lines: list[Line], stiffness: float, start: float) -> list[Line]:
    """The graph with ``stiffness max(0, place - start)`` added to the force."""
    if not stiffness:
        return lines
    found = []
    for line in lines:
        more = stiffness * max(0.0, line.low - start)
        if line.slope is None:
            found.append(Line(line.low, line.high + more, line.base + more))
            continue
        if line.low < start:
            found.append(Line(line.low, min(line.high, start), line.base, line.slope))
        if line.high > start:
            found.append(Line(max(line.low, start), line.high, line.base - stiffness * start, line.slope + stiffness))
    return found


def mirrored(lines: list[Line]) -> list[Line]:
    """The graph of a friction, given for slips >= 0, on both sides."""
    found, rest = [], 0.0
    for line in lines:
        if line.slope is None:
            found += [line, Line(-line.low, -line.base, -line.high)]
        elif line.high > 0.0:
            low = max(line.low, 0.0)
            found += [Line(low, line.high, line.base, line.slope), Line(-line.high, -low, -line.base, line.slope)]
            rest = line.base if low == 0.0 else rest
    return [line for line in found if line.slope is not None or line.low != 0.0] + [Line(0.0, rest, -rest)]


def alpha_of(lines: list[Line]) -> float:
    """By how much the force falls at most, over the way; inf at a jump downwards."""
    worst = 0.0
    for line in lines:
        if line.slope is not None:
            worst = max(worst, -line.slope)
            continue
        before = [one.base + one.slope * line.low for one in lines if one.slope is not None and one.high == line.low]
        after = [one.base + one.slope * line.low for one in lines if one.slope is not None and one.low == line.low]
        if before and after and after[0] < before[0]:
            return math.inf
    return worst


@dataclass(frozen=True)
class Friction:
    """Friction at a point: a known graph of the slip, or a bound that grows with the pressure or the penetration."""

    lines: list[Line] | None = None
    pressure: float = 0.0
    penetration: float = 0.0


@dataclass(frozen=True)
class Found:
    """Solutions that were found.

    ``places`` and ``forces`` are (k, 2 m), ``missed`` (k,) says by how much inequalities are missed, as parts of the
    units, and ``doubt`` whether a singular combination may hold a continuum of others.
    """

    places: np.ndarray
    forces: np.ndarray
    missed: np.ndarray
    doubt: bool

    def apart(self, length: float) -> float:
        """How far solutions are from the first one, as a part of a length; those count that miss nothing."""
        sure = self.places[self.missed <= 1e-12]
        return float(np.abs(sure - sure[0]).max()) / length if len(sure) else 0.0


class Points:
    """Contact points on a body that is known by ``r = r0 - S lam``, components (penetration, slip) of each in turn.

    Parameters
    ----------
    compliance : array (2 m, 2 m)
        S.
    normal : list of the graphs of the normal force
    friction : list of Friction
        None where a support holds the slip.
    """

    def __init__(self, compliance: np.ndarray, normal: list[list[Line]], friction: list[Friction | None]) -> None:
        self.count = len(normal)
        self.compliance = compliance
        self.tables = [self._of_point(n, f) for n, f in zip(normal, friction, strict=True)]
        self.combinations = math.prod(len(equations) for equations, _ in self.tables)

    @staticmethod
    def _of_point(normal: list[Line], friction: Friction | None) -> tuple[np.ndarray, np.ndarray]:
        """Equations (c, 2, 5) and inequalities (c, k, 5) of each combination, in ``(r, s, p, q)`` and a right side."""
        pairs = []
        for first, first_limits in map(_rows, normal):
            if friction is None:
                pairs.append(([first, [0, 0, 0, 1, 0]], first_limits))
                continue
            if friction.lines is not None:
                for second, limits in map(_rows, friction.lines):
                    turned = [_of_slip(row) for row in limits]
                    pairs.append(([first, _of_slip(second)], first_limits + turned))
                continue
            a, b = friction.pressure, friction.penetration
            acts = [-b, 0, -a, 0, 0]  # the bound, a p + b r >= 0
            pairs.append(([first, [0, 1, 0, 0, 0]], [*first_limits, acts, [-b, 0, -a, 1, 0], [-b, 0, -a, -1, 0]]))
            for sign in (1.0, -1.0):
                slips = [-sign * b, 0, -sign * a, 1, 0]
                pairs.append(([first, slips], [*first_limits, acts, [0, -sign, 0, 0, 0]]))
            pairs.append(([first, [0, 0, 0, 1, 0]], [*first_limits, [b, 0, a, 0, 0]]))
        most = max(1, *(len(limits) for _, limits in pairs))
        none = [0, 0, 0, 0, 1]
        equations = np.array([rows for rows, _ in pairs], dtype=float)
        return equations, np.array([rows + [none] * (most - len(rows)) for _, rows in pairs], dtype=float)

    def _scaled(self, length: float, force: float) -> list[tuple[np.ndarray, np.ndarray]]:
        """The same in units of a length and of a force, the largest factor of each row being 1."""
        units = np.array([length, length, force, force, 1.0])
        found = []
        for tables in self.tables:
            scaled = []
            for rows in tables:
                rows = rows * units
                size = np.abs(rows[..., :4]).max(axis=-1, keepdims=True)
                scaled.append(rows / np.where(size > 0.0, size, 1.0))
            found.append((scaled[0], scaled[1]))
        return found

    def allows(self, r: np.ndarray, lam: np.ndarray, length: float, force: float) -> np.ndarray:
        """By how much places (2 m,) and forces (2 m,) miss the law of each point, as a part of the units, (m,)."""
        missed = []
        for number, (equations, limits) in enumerate(self._scaled(length, force)):
            own = slice(2 * number, 2 * number + 2)
            here = np.concatenate([r[own] / length, lam[own] / force, [-1.0]])
            off = np.maximum(np.abs(equations @ here).max(axis=1), (limits @ here).max(axis=1, initial=0.0))
            missed.append(float(off.min()))
        return np.array(missed)

    def solutions(self, r0: np.ndarray, length: float, force: float) -> Found:
        """All solutions, in units of a length and of a force.

        Raises
        ------
        UnknownError
            There are too many combinations.
        """
        if self.combinations > _MOST:
            raise UnknownError(f"{self.combinations} combinations of pieces")
        n, tables = 2 * self.count, self._scaled(length, force)
        S, x0 = self.compliance * force / length, r0 / length
        choice = np.indices([len(equations) for equations, _ in tables]).reshape(self.count, -1)
        A, right = np.zeros((choice.shape[1], n, n)), np.zeros((choice.shape[1], n))
        for number, (equations, _) in enumerate(tables):
            own = slice(2 * number, 2 * number + 2)
            block = -equations[:, :, :2] @ S[own]
            block[:, :, own] += equations[:, :, 2:4]
            A[:, own] = block[choice[number]]
            right[:, own] = (equations[:, :, 4] - equations[:, :, :2] @ x0[own])[choice[number]]
        size = np.abs(A).max(axis=2)
        size[size == 0.0] = 1.0
        A, right = A / size[:, :, None], right / size
        singular = np.abs(np.linalg.det(A)) < 1e-11
        y = np.linalg.solve(np.where(singular[:, None, None], np.eye(n), A), right[:, :, None])[:, :, 0]
        x = x0 - y @ S.T
        missed = np.zeros(len(y))
        for number, (_, limits) in enumerate(tables):
            own = slice(2 * number, 2 * number + 2)
            here = np.concatenate([x[:, own], y[:, own], -np.ones((len(y), 1))], axis=1)
            missed = np.maximum(missed, np.einsum("ckj,cj->ck", limits[choice[number]], here).max(axis=1))
        holds = ~singular & (missed <= 1e-8)
        doubt = any(
            np.abs(A[k] @ np.linalg.lstsq(A[k], right[k], rcond=1e-10)[0] - right[k]).max() < 1e-8
            for k in np.flatnonzero(singular)[:2000]
        )
        return Found(x[holds] * length, y[holds] * force, missed[holds], doubt)


def _rows(line: Line) -> tuple[list[float], list[list[float]]]:
    """The equation and the inequalities of a part of a graph, in ``(r, s, p, q)`` and a right side."""
    if line.slope is None:
        ends = ((1.0, line.high), (-1.0, -line.base))
        return [1.0, 0.0, 0.0, 0.0, line.low], [[0.0, 0.0, s, 0.0, e] for s, e in ends if math.isfinite(e)]
    ends = ((1.0, line.high), (-1.0, -line.low))
    return [-line.slope, 0.0, 1.0, 0.0, line.base], [[s, 0.0, 0.0, 0.0, e] for s, e in ends if math.isfinite(e)]


def _of_slip(row: list[float]) -> list[float]:
    """A row about penetration and pressure as one about slip and friction."""
    return [0.0, row[0], 0.0, row[2], row[4]]
