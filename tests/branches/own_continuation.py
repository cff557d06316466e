"""A continuation of its own for load paths of contact points: arrays alone, no code of the library.

Unknowns are displacement, multiplier and load, x = (r, lambda, t), of ``A r + w lambda = t f`` and of one equation for
each component: (r, lambda) is on the graph of the law.  There is no number along the graph, and no corner is looked
for.  A point follows the last one on a sphere, so that the path may turn by any angle at a corner.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

Array = np.ndarray
#: What is zero on the graph of a law, (c,), of one point's displacement and multiplier (c,) each.
Graph = Callable[[Array, Array], Array]


def frictional(normal: Callable[[float], float], bound: Callable[[float, float], float], scale: float) -> Graph:
    """A normal law ``lambda = normal(r)``, and friction up to a bound of pressure and size of the slip."""

    def off(r: Array, lam: Array) -> Array:
        q = lam[1:] + scale * r[1:]
        size, limit = float(np.linalg.norm(q)), bound(max(float(lam[0]), 0.0), float(np.linalg.norm(r[1:])))
        return np.append(lam[0] - normal(float(r[0])), lam[1:] - q * min(1.0, limit / size if size > 0.0 else 1.0))

    return off


def rigid(scale: float) -> Graph:
    """No penetration, no pull, no friction."""
    return lambda r, lam: np.append(lam[0] - max(lam[0] + scale * r[0], 0.0), lam[1:])


def glue(stiffness: float, ratio: float, compression: float, ends: Callable[[float], tuple[float, float]]) -> Graph:
    """Bilinear glue, its onset and its end in the effective opening by the mode, the share of the slip in it."""

    def off(r: Array, lam: Array) -> Array:
        opening, slip = max(-float(r[0]), 0.0), r[1:]
        sheared = float(ratio**2 * slip @ slip)
        rho = np.sqrt(opening**2 + sheared)
        onset, end = ends(sheared / rho**2 if rho > 0.0 else 0.0)
        kept = 1.0 if rho <= onset else max(onset * (end - rho) / (rho * (end - onset)), 0.0)
        pull = kept * stiffness
        return np.append(lam[0] - compression * max(r[0], 0.0) + pull * opening, lam[1:] - pull * ratio**2 * slip)

    return off


@dataclass(frozen=True, eq=False)
class Continuation:
    """Points of one law on a body ``A r + w lambda = t f``; lengths and multipliers are of the order of one."""

    A: Array
    f: Array
    weights: Array
    graph: Graph
    components: int

    def off(self, x: Array) -> Array:
        """What is out of balance, and off the graphs."""
        n, c = self.f.size, self.components
        r, lam = x[:n].reshape(-1, c), x[n : 2 * n].reshape(-1, c)
        balance = self.A @ x[:n] + (self.weights[:, None] * lam).ravel() - x[-1] * self.f
        return np.concatenate([balance, *(self.graph(one, other) for one, other in zip(r, lam, strict=True))])

    def slope(self, x: Array) -> Array:
        """Its derivative, by differences at every contact point."""
        n, c = self.f.size, self.components
        J = np.zeros((2 * n, 2 * n + 1))
        J[:n, :n], J[:n, n : 2 * n], J[:n, -1] = self.A, np.diag(np.repeat(self.weights, c)), -self.f
        for start in range(0, n, c):
            pair = np.concatenate([x[start : start + c], x[n + start : n + start + c]])
            for k in range(2 * c):
                step = np.zeros(2 * c)
                step[k] = 1e-7
                ends = [self.graph(one[:c], one[c:]) for one in (pair + step, pair - step)]
                column = start + k if k < c else n + start + k - c
                J[n + start : n + start + c, column] = (ends[0] - ends[1]) / 2e-7
        return J

    def beside(self, x: Array, guess: Array, length: float) -> Array | None:
        """A zero at a distance from x, by Newton's method from a guess."""
        y = guess
        for _ in range(25):
            away = y - x
            F = np.append(self.off(y), away @ away / length - length)
            if np.abs(F).max() <= 1e-12:
                return y
            try:
                y = y - np.linalg.solve(np.vstack([self.slope(y), 2.0 * away / length]), F)
            except np.linalg.LinAlgError:
                return None
            if not np.abs(y - x).max() < 5.0 * length:
                return None
        return None

    def onward(self, x: Array, way: Array, length: float, random: np.random.Generator) -> Array | None:
        """The zero at a distance from x that lies most ahead: from guesses ahead, and others on the sphere."""
        ahead = self.beside(x, x + length * way, length)
        if ahead is not None and (ahead - x) @ way > 0.9 * length:
            return ahead
        guesses = []
        for _ in range(40):  # the ways of the pieces around
            v = np.linalg.svd(self.slope(x + length * random.choice([0.01, 1.0]) * random.normal(size=x.size)))[2][-1]
            guesses += [v, -v]
        found = [self.beside(x, x + length * guess, length) for guess in guesses]
        zeros = [y for y in (ahead, *found) if y is not None and (y - x) @ way > -0.98 * length]
        return max(zeros, key=lambda y: float((y - x) @ way), default=None)

    def follow(self, upto: float, length: float, most: int = 4000, seed: int = 0) -> Array:
        """Points (k, 2 n + 1) from rest until the load leaves ``[0, upto]``; fewer where it gets stuck."""
        random = np.random.default_rng(seed)
        x = np.zeros(2 * self.f.size + 1)
        points, step = [x], length
        J = self.slope(x + 1e-9)
        way = np.linalg.svd(J)[2][-1]
        way = way * np.sign(way[-1] or 1.0)
        while len(points) < most and 0.0 <= points[-1][-1] <= upto:
            found = self.onward(points[-1], way, step, random)
            if found is None:
                step *= 0.3
                if step < 1e-4 * length:
                    break
                continue
            way = (found - points[-1]) / np.linalg.norm(found - points[-1])
            points.append(found)
            step = min(length, 1.5 * step)
        return np.array(points)


def turns(t: Array, least: float) -> list[float]:
    """Values at which a sequence turns by at least this much."""
    kept: list[float] = []
    for value in t[[i for i in range(1, t.size - 1) if (t[i] - t[i - 1]) * (t[i + 1] - t[i]) < 0.0]]:
        kept.append(float(value))
        if len(kept) > 1 and abs(kept[-1] - kept[-2]) < least:
            del kept[-2:]
    return kept


def distances(points: Array, line: Array) -> Array:
    """How far points (k, n) are from a polygon (l, n)."""
    start, ways = line[:-1], np.diff(line, axis=0)
    size = np.maximum((ways**2).sum(axis=1), 1e-300)
    out = np.empty(len(points))
    for i, point in enumerate(points):
        part = np.clip(((point - start) * ways).sum(axis=1) / size, 0.0, 1.0)
        out[i] = np.sqrt(((start + part[:, None] * ways - point) ** 2).sum(axis=1).min())
    return out
