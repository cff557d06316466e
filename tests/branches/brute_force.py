"""Small random problems of every kind, and all their solutions by brute force: grids over the graphs of the laws.

Nothing here asks the library for anything but to build the laws: graphs are polylines (or a formula) of this module; a
solution is where ``F = A r + w lambda - g`` changes sign in all components within a cell, made sharp by Newton steps.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np

from hemivar.basics.types import Array
from hemivar.discrete import DiscreteProblem
from hemivar.laws import ContactLaw, Friction, PenetrationBound, SlipTable, SlipWeakening, table_law

_FAR = 60.0


@dataclass(frozen=True)
class Curve:
    """A graph ``(r, lambda)`` over a parameter: a polyline, or friction that weakens by an exponential."""

    corners: Array
    r: Array
    lam: Array
    weakening: tuple[float, float, float] | None = None  # static, kinetic, rate

    def __call__(self, theta: Array) -> tuple[Array, Array]:
        if self.weakening is None:
            return np.interp(theta, self.corners, self.r), np.interp(theta, self.corners, self.lam)
        static, kinetic, rate = self.weakening
        r = np.sign(theta) * np.maximum(np.abs(theta) - 1.0, 0.0)
        force = kinetic + (static - kinetic) * np.exp(-rate * np.abs(r))
        return r, np.where(np.abs(theta) <= 1.0, theta * static, np.sign(theta) * force)

    def grid(self, each: int) -> Array:
        parts = [np.linspace(a, b, each + 1) for a, b in itertools.pairwise(self.corners)]
        if self.weakening is not None:
            near = 1.0 + np.geomspace(1e-5, _FAR, 12 * each)
            parts += [near, -near]
        return np.unique(np.concatenate(parts))


def polyline(r: Array, lam: Array, slopes: tuple[float, float]) -> Curve:
    """The graph through the points, going on with two slopes."""
    r = np.concatenate([[r[0] - _FAR], r, [r[-1] + _FAR]])
    lam = np.concatenate([[lam[0] - slopes[0] * _FAR], lam, [lam[-1] + slopes[1] * _FAR]])
    unit = max(float(np.abs(np.diff(lam)).max()), 1e-300)
    steps = np.hypot(np.diff(r), np.diff(lam) / unit)
    return Curve(np.concatenate([[0.0], np.cumsum(np.maximum(steps, 1e-9))]), r, lam)


@dataclass(frozen=True)
class Case:
    """A problem with B = 1 and what brute force needs of it."""

    problem: DiscreteProblem
    A: Array
    g: Array
    weights: Array
    curves: tuple[Curve, ...]
    bound: tuple[Array, Array] | None  # of the friction of the one point, by its penetration

    def F(self, theta: list[Array]) -> list[Array]:  # noqa: N802
        pairs = [curve(t) for curve, t in zip(self.curves, theta, strict=True)]
        out = []
        for i, (_, lam) in enumerate(pairs):
            if self.bound is not None and i == 1:
                lam = lam * np.interp(pairs[0][0], *self.bound)
            out.append(sum(self.A[i, j] * pairs[j][0] for j in range(len(pairs))) + self.weights[i] * lam - self.g[i])
        return out

    def solutions(self) -> list[Array]:
        """Local displacements (n,) of the solutions that the grid shows."""
        n = len(self.curves)
        grids = [curve.grid({1: 400, 2: 60, 3: 9}[n]) for curve in self.curves]
        mesh = np.meshgrid(*grids, indexing="ij", sparse=True)
        crossed = np.ones([g.size - 1 for g in grids], dtype=bool)
        for value in self.F(list(mesh)):
            value = np.broadcast_to(value, [g.size for g in grids])
            corners = [
                value[tuple(slice(k, k + s - 1) for k, s in zip(shift, value.shape, strict=True))]
                for shift in itertools.product((0, 1), repeat=n)
            ]
            crossed &= (np.minimum.reduce(corners) <= 0.0) & (np.maximum.reduce(corners) >= 0.0)
        found: list[Array] = []
        for cell in np.argwhere(crossed):
            theta = np.array([0.5 * (g[k] + g[k + 1]) for g, k in zip(grids, cell, strict=True)])
            width = np.array([g[k + 1] - g[k] for g, k in zip(grids, cell, strict=True)])
            root = self._newton(theta, width)
            if root is None:
                continue
            r = np.array([float(curve(t)[0]) for curve, t in zip(self.curves, root, strict=True)])
            if not any(np.abs(r - other).max() <= 1e-6 * (1.0 + np.abs(r).max()) for other in found):
                found.append(r)
        return found

    def _newton(self, theta: Array, width: Array) -> Array | None:
        n = theta.size

        def F(x: Array) -> Array:  # noqa: N802
            return np.array([float(v) for v in self.F(list(x))])

        # the size of what F is made of: between two corners of a graph, that of their numbers
        sums = [np.abs(self.g), np.abs(self.A).sum(axis=1)]
        sums += [
            np.array([np.abs(np.interp(t + s * w, c.corners, c.lam)) * weight for c, t, w, weight in rows])
            for s in (-40.0, 0.0, 40.0)
            for rows in [list(zip(self.curves, theta, width, self.weights, strict=True))]
        ]
        allowed = 1e-11 * np.abs(self.g) + 1e-13 * np.maximum.reduce(sums)
        start = theta
        for _ in range(40):
            value = F(theta)
            if np.all(np.abs(value) <= allowed):
                return theta
            J = np.empty((n, n))
            for j in range(n):
                h = 1e-6 * width[j] * np.eye(n)[j]
                J[:, j] = (F(theta + h) - F(theta - h)) / (2e-6 * width[j])
            try:
                theta = theta - np.linalg.solve(J, value)
            except np.linalg.LinAlgError:
                return None
            if not np.all(np.abs(theta - start) <= 3.0 * width):
                return None
        return None


def random_normal(random: np.random.Generator) -> tuple[object, Curve]:
    """A table with vertical jumps up and down, softening pieces, flat ends."""
    count = int(random.integers(1, 4))
    places = np.sort(random.uniform(-1.0, 1.0, size=count)) + 0.05 * np.arange(count)
    r = np.repeat(places, random.integers(1, 3, size=count))
    if r.size < 2:
        r = np.append(r, r[-1] + 0.3)
    lam = random.normal(size=r.size) * random.choice([0.5, 2.0])
    linear = bool(random.integers(0, 2))
    ends = (0.0, 0.0)
    if linear:
        first, last = (np.diff(lam)[k] / np.diff(r)[k] if np.diff(r)[k] > 0 else np.nan for k in (0, -1))
        linear = bool(np.isfinite(first) and np.isfinite(last) and first >= 0.0 and last >= 0.0)
        ends = (float(first), float(last)) if linear else ends
    return table_law(r, lam, extend="linear" if linear else "constant"), polyline(r, lam, ends)


def random_friction(random: np.random.Generator) -> tuple[Friction, Curve, tuple[Array, Array] | None, float]:
    """Friction that weakens, jumps or strengthens, with a bound that may depend on the penetration."""
    bound: tuple[Array, Array] | None = None
    scale = float(random.uniform(0.05, 0.8))
    given: object = scale
    if random.integers(0, 2):
        s = np.sort(random.uniform(-0.2, 1.0, size=3)) + np.array([0.0, 0.1, 0.2])
        h = random.uniform(0.0, 0.6, size=3) * np.array([float(random.integers(0, 2)), 1.0, 1.0])
        bound, given, scale = (s, h), PenetrationBound((s, h)), 1.0
    if random.integers(0, 2):
        static, kinetic = random.uniform(0.3, 1.2), random.uniform(0.1, 0.9)
        rate = float(10.0 ** random.uniform(-1.0, 2.5))
        curve = Curve(np.array([-1.0 - _FAR, -1.0, 1.0, 1.0 + _FAR]), np.zeros(4), np.zeros(4), (static, kinetic, rate))
        return SlipWeakening(given, static, kinetic, rate), curve, bound, scale
    slips = np.concatenate([[0.0], np.sort(random.uniform(0.01, 1.0, size=2)) + np.array([0.0, 0.05])])
    values = random.uniform(0.0, 1.2, size=3)
    r = np.concatenate([-slips[::-1], slips])
    return (
        SlipTable(given, slips, values),
        polyline(r, np.concatenate([-values[::-1], values]), (0.0, 0.0)),
        bound,
        scale,
    )


def gentle_case(random: np.random.Generator) -> Case:
    """One point that hardly softens by itself, on friction with a small bound that grows with the penetration."""
    A = np.diag(random.uniform(0.5, 2.0, size=2))
    A[0, 1] = A[1, 0] = random.choice([0.0, 0.2])
    k = float(random.uniform(0.2, 2.0))
    slope = float(random.uniform(0.02, 0.4))
    s, h = np.array([0.0, 5.0]), np.array([0.0, 5.0 * slope])
    static, kinetic = 1.0, float(random.uniform(0.3, 0.9))
    rate = float(10.0 ** random.uniform(-1.0, 2.5))
    load = np.array([random.uniform(-0.5, 2.0), 0.0])
    # about what the friction can bear
    load[1] = slope * max(load[0], 0.1) / (A[0, 0] + k) * random.uniform(0.3, 1.2)
    law = ContactLaw(
        table_law([-1.0, 0.0, 1.0], [0.0, 0.0, k], extend="linear"),
        SlipWeakening(PenetrationBound((s, h)), static, kinetic, rate),
    )
    normal = polyline(np.array([-1.0, 0.0, 1.0]), np.array([0.0, 0.0, k]), (0.0, k))
    curve = Curve(np.array([-1.0 - _FAR, -1.0, 1.0, 1.0 + _FAR]), np.zeros(4), np.zeros(4), (static, kinetic, rate))
    problem = DiscreteProblem.of_arrays(A, load, np.eye(2), np.ones(1), np.zeros(1), law)
    return Case(problem, A, load, np.ones(2), (normal, curve), (s, h))


def steep_case(random: np.random.Generator) -> Case:
    """Laws whose knots carry forces that are large against the load, loads of nothing, and knots at rest."""
    n = int(random.integers(1, 4))
    A = np.diag(random.uniform(0.5, 2.0, size=n))
    A += 0.2 * (random.normal(size=n) @ random.normal(size=n)) ** 2 * np.ones((n, n))
    load = random.normal(size=n) * random.choice([0.0, 1.0])
    gap = random.uniform(0.0, 0.3, size=n) * float(random.integers(0, 2))
    laws, curves = [], []
    for _ in range(n):
        size = float(10.0 ** random.uniform(2.0, 9.0))
        places = np.sort(random.uniform(0.0, 0.5, size=2)) + np.array([0.0, 0.05])
        kind = int(random.integers(0, 3))
        if kind == 0:  # a wedge up and down again
            r, lam = np.array([0.0, *places]), np.array([0.0, size, 0.0])
        elif kind == 1:  # a large jump at rest, as that of a friction bound
            r, lam = np.array([0.0, 0.0]), np.array([-size, size])
        else:
            r, lam = np.array([-places[0], 0.0, places[1], places[1]]), np.array([-1.0, 0.0, size, 0.5])
        laws.append((ContactLaw(table_law(r, lam)), 1))
        curves.append(polyline(r, lam, (0.0, 0.0)))
    weights = random.uniform(0.5, 2.0, size=n)
    problem = DiscreteProblem.of_arrays(A, load, np.eye(n), weights, gap, ContactLaw.concatenate(laws))
    return Case(problem, A, load - A @ gap, weights, tuple(curves), None)


def random_case(seed: int) -> Case:
    """One to three points in one dimension, or one point with friction in two."""
    random = np.random.default_rng(seed)
    if seed % 4 == 2:
        return gentle_case(random)
    if seed % 4 == 3:
        return steep_case(random)
    slides = bool(random.integers(0, 2))
    n = 2 if slides else int(random.integers(1, 4))
    root = random.normal(size=(n, n))
    A = root @ root.T / n * random.choice([0.3, 1.0]) + np.diag(random.uniform(0.2, 1.5, size=n))
    load = random.normal(size=n) * random.choice([0.1, 1.0, 3.0])
    gap = random.normal(size=1 if slides else n) * random.choice([0.0, 0.3])
    if slides:
        normal, first = random_normal(random)
        law_t, second, bound, scale = random_friction(random)
        weight = np.full(1, random.uniform(0.5, 2.0))
        problem = DiscreteProblem.of_arrays(A, load, np.eye(2), weight, gap, ContactLaw(normal, law_t))
        g = load - A @ np.array([gap[0], 0.0])
        w = np.array([weight[0], weight[0] * scale])
        return Case(problem, A, g, w, (first, second), bound)
    pairs = [random_normal(random) for _ in range(n)]
    weights = random.uniform(0.5, 2.0, size=n)
    law = ContactLaw.concatenate([(ContactLaw(law), 1) for law, _ in pairs])
    problem = DiscreteProblem.of_arrays(A, load, np.eye(n), weights, gap, law)
    return Case(problem, A, load - A @ gap, weights, tuple(curve for _, curve in pairs), None)
