"""All stationary points by enumeration of active sets: laws are piecewise quadratic, every combination is tried.

On a combination the law is affine where a component moves and free where it is held at a kink, so that one linear
system for the components that move gives all of it.  Every point comes with a bound of its rounding error, and every
test against the end of a segment has three answers: inside, outside by more than the error, or not to be told.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from hemivar.basics.first_use import IMPORTS
from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.certificates.bound import equilibrium_multiplier
from hemivar.systems.chain import Chain

__all__ = ["Candidate", "Enumeration", "enumerate_points"]

#: Combinations whose systems are solved together: their matrices take 32 KiB for each squared component.
_CHUNK = 4096
_EPS = float(np.finfo(float).eps)
#: Eigenvalues of the scaled system this small, relative to the largest one, count as zero.
_SINGULAR = 64.0 * _EPS
#: Combinations with a singular and consistent system that are looked at, each by a linear program;
#: more are counted as undecided, and the set of solutions is then not complete. 50 and 5 000 give the same answers in
#: tests/branches.
_LINES = 500


@dataclass(frozen=True, eq=False)
class Candidate:
    """A point that fulfils the law of its combination up to rounding."""

    r: Array  # (n,): of the free components, at the ends of their segments where rounding alone had it beyond
    lam: Array  # (n,)
    segment: IntArray  # (n,)
    error: Array  # (n,): bound of the rounding error of r
    rounding: float  # a force: what law and stiffness, rounded, can leave in the residual of the point


@dataclass(frozen=True, eq=False)
class Enumeration:
    """What the combinations gave."""

    candidates: list[Candidate]
    continuum: bool  # whether a combination has a continuum of solutions, of which one is given
    undecided: int  # combinations with so many solutions that not all were looked at


def enumerate_points(chain: Chain, check: Callable[[], None] = lambda: None) -> Enumeration:
    """Try every combination of segments, all affine; ``check`` is called now and then and ends it by what it raises."""
    n = chain.size
    if n == 0:
        empty = np.zeros(0)
        return Enumeration([Candidate(empty, empty, np.zeros(0, dtype=np.int64), empty, 0.0)], False, 0)
    tables = _Tables(chain)
    candidates: list[Candidate] = []
    continuum, undecided, lines = False, 0, 0
    total = int(chain.combinations)
    for first in range(0, total, _CHUNK):
        check()
        number = np.arange(first, min(first + _CHUNK, total))
        choice = np.stack(np.unravel_index(number, tuple(chain.count)), axis=1)
        batch = tables.solve(choice)
        for b in np.flatnonzero(batch.possible):
            if batch.singular[b]:
                lines += 1
                if lines > _LINES:
                    undecided += 1
                    continue
                line = tables.on_a_line(batch, int(b))
                if line is not None:
                    continuum = True
                    candidates.append(line)
                continue
            candidates.append(tables.candidate(choice[b], batch.r[b], batch.lam[b], batch.error[b]))
    return Enumeration(candidates, continuum, undecided)


@dataclass(frozen=True, eq=False)
class _Batch:
    """Points of some combinations, one row for each."""

    choice: IntArray
    r: Array
    lam: Array
    error: Array
    possible: BoolArray
    singular: BoolArray
    values: Array
    vectors: Array
    scale: Array


class _Tables:
    """Ends and slopes of the segments, (n, S) each."""

    def __init__(self, chain: Chain) -> None:
        self.chain = chain
        n, kink = chain.size, chain.kink
        self.rows = np.arange(n)
        base, slope = chain.affine_pieces
        self.kink = kink
        self.origin = np.where(kink, chain.knot, chain.value)  # r: of a kink, or of a point of a piece
        self.base, self.slope = base, slope  # lambda there, and its slope
        self.low, self.high = np.where(kink, chain.knot, chain.low), np.where(kink, chain.knot, chain.high)
        self.least = np.where(kink, np.minimum(chain.low, chain.high), -np.inf)
        self.most = np.where(kink, np.maximum(chain.low, chain.high), np.inf)
        self.accuracy = _accuracy(chain)
        own = np.abs(np.diagonal(chain.matrix))
        self.floor = np.maximum(own, chain.system.diagonal.ravel()[chain.system.free])

    def solve(self, choice: IntArray) -> _Batch:
        chain, rows, eps = self.chain, self.rows, self.accuracy
        A, w, g = chain.matrix, chain.weights, chain.force
        size_of = np.abs(A)
        kink = self.kink[rows, choice]
        origin, base, slope = self.origin[rows, choice], self.base[rows, choice], self.slope[rows, choice]
        slope, base = np.where(kink, 0.0, slope), np.where(kink, 0.0, base)
        moving = ~kink
        J = A[None] * (moving[:, :, None] & moving[:, None, :])
        diagonal = np.einsum("bii->bi", J)
        diagonal += np.where(moving, w * slope, 0.0)
        scale = 1.0 / np.sqrt(np.maximum(np.abs(diagonal), self.floor))
        diagonal[kink] = (scale**-2.0)[kink]
        values, vectors = np.linalg.eigh(scale[:, :, None] * J * scale[:, None, :])
        small = np.abs(values) <= _SINGULAR * chain.size * np.abs(values).max(axis=1, keepdims=True)
        singular = small.any(axis=1)
        with np.errstate(divide="ignore"):
            inverse_values = np.where(small, 0.0, 1.0 / values)
        # x = V diag(1/values) V' rhs, all in scaled unknowns
        rhs = np.where(moving, g - origin @ A - w * base, 0.0)
        parts = np.einsum("bij,bi->bj", vectors, scale * rhs)
        y = scale * np.einsum("bij,bj->bi", vectors, inverse_values * parts)
        # one step of refinement, for the residual of a scaled solve is what counts
        rest = np.where(moving, rhs - np.einsum("bij,bj->bi", J, y), 0.0)
        y += scale * np.einsum("bij,bj->bi", vectors, inverse_values * np.einsum("bij,bi->bj", vectors, scale * rest))
        y = np.where(moving, y, 0.0)
        r = origin + y
        doubt = eps * (
            np.abs(g) + np.abs(r) @ size_of + np.abs(origin) @ size_of + w * (np.abs(base) + np.abs(slope * y))
        )
        spread = np.abs(vectors) * np.abs(inverse_values)[:, None, :]
        error = scale * np.einsum("bij,bkj,bk->bi", spread, np.abs(vectors), scale * np.where(moving, doubt, 0.0))
        error = np.where(moving, error + _EPS * (np.abs(r) + np.abs(origin)), 0.0)
        force = g - r @ A
        lam = np.where(kink, force / w, base + slope * y)
        lam_error = (doubt + error @ size_of) / w
        with np.errstate(invalid="ignore"):
            fits = np.where(
                kink,
                (lam >= self.least[rows, choice] - lam_error) & (lam <= self.most[rows, choice] + lam_error),
                (r >= self.low[rows, choice] - error) & (r <= self.high[rows, choice] + error),
            ).all(axis=1)
        # a singular system has solutions if the right-hand side is in its range, whatever the place of one of them
        left = np.abs(np.where(small, parts, 0.0)).max(axis=1, initial=0.0)
        allowed = 8.0 * np.sqrt(chain.size) * np.linalg.norm(scale * np.where(moving, doubt, 0.0), axis=1)
        consistent = left <= allowed
        return _Batch(
            choice, r, lam, error, np.where(singular, consistent, fits), singular, values, vectors, scale
        )  # fmt: skip

    def candidate(self, choice: IntArray, r: Array, lam: Array, error: Array) -> Candidate:
        """The point, put on its segments."""
        chain, rows = self.chain, self.rows
        kink, low, high = (table[rows, choice] for table in (self.kink, self.low, self.high))
        inside = np.where(kink, low, np.clip(r, low, high))
        error = error + np.abs(inside - r)
        step = inside - self.origin[rows, choice]
        least, most = self.least[rows, choice], self.most[rows, choice]
        lam = np.where(kink, np.clip(lam, least, most), self.base[rows, choice] + self.slope[rows, choice] * step)
        size = np.abs(chain.force) + np.abs(chain.matrix) @ np.abs(inside)
        of_law = np.abs(self.base[rows, choice]) + np.abs(self.slope[rows, choice]) * np.abs(step)
        of_law += np.abs(self.slope[rows, choice]) * np.abs(inside)
        rounding = float(self.accuracy * np.linalg.norm(size + chain.weights * np.where(kink, np.abs(lam), of_law)))
        return Candidate(inside, lam, choice.astype(np.int64), error, rounding)

    def on_a_line(self, batch: _Batch, b: int) -> Candidate | None:
        """A point of a combination that has a continuum of them; None where all of it is off the segments."""
        with IMPORTS:
            from scipy.optimize import linprog

        chain, rows, choice = self.chain, self.rows, batch.choice[b]
        small = np.abs(batch.values[b]) <= _SINGULAR * chain.size * np.abs(batch.values[b]).max()
        free = batch.scale[b][:, None] * batch.vectors[b][:, small]
        free[self.kink[rows, choice]] = 0.0
        length = chain.length
        # rows: what must lie between its ends, (r or lambda) = start + move z, as lengths
        kink = self.kink[rows, choice]
        compliance = 1.0 / self.floor
        move = np.where(kink[:, None], -(chain.matrix @ free) * compliance[:, None], free)
        start = np.where(kink, batch.lam[b] * chain.weights * compliance, batch.r[b])
        factor = np.where(kink, chain.weights * compliance, 1.0)
        with np.errstate(invalid="ignore"):
            low = np.where(kink, self.least[rows, choice] * factor, self.low[rows, choice])
            high = np.where(kink, self.most[rows, choice] * factor, self.high[rows, choice])
        slack = 1e-10 * length
        above, below = np.isfinite(high), np.isfinite(low)
        limits = np.concatenate([move[above], -move[below]])
        room = np.concatenate([(high - start)[above], (start - low)[below]]) + slack
        size = max(float(np.abs(free).max()), np.finfo(float).tiny)
        cost = np.zeros(free.shape[1] + 1)
        cost[-1] = -1.0  # as far inside as possible, but no farther than a length
        optimum = linprog(
            cost,
            A_ub=np.hstack([limits / size, np.ones((len(limits), 1))]) if len(limits) else None,
            b_ub=room / length if len(limits) else None,
            bounds=[(None, None)] * free.shape[1] + [(0.0, 1.0)],
        )
        if optimum.status == 2:
            return None
        z = optimum.x[:-1] * length / size if optimum.status == 0 else np.zeros(free.shape[1])
        r = batch.r[b] + free @ z
        lam = np.where(kink, (chain.force - chain.matrix @ r) / chain.weights, 0.0)
        return self.candidate(choice, r, lam, np.full(chain.size, slack))


def _accuracy(chain: Chain) -> float:
    """Relative accuracy of the condensed stiffness and force: measured against the problem itself, at least 32 eps."""
    system = chain.system
    least = 32.0 * _EPS * max(chain.size, 4)
    random = np.random.default_rng(11)
    worst = 0.0
    for _ in range(2):
        r = system.fixed.copy()
        r.ravel()[system.free] = chain.length * random.uniform(-1.0, 1.0, size=chain.size)
        force = system.out_of_balance(r)
        lam = force / system.weights[:, None]
        u, _ = system.recover(r, np.where(system.active, lam, 0.0))
        exact = equilibrium_multiplier(system.problem, u) * system.weights[:, None]
        off = np.abs(force - exact)[system.active]
        size = np.abs(system.load) + np.abs(system.matrix) @ np.abs(r.ravel())
        worst = max(worst, float((off / np.maximum(size[system.free], np.finfo(float).tiny)).max(initial=0.0)))
    return max(least, 8.0 * worst)
