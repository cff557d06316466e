"""Marches of a few points on glue that remembers, by an enumeration of the pieces of its curve."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

import hemivar as hv
from hemivar.basics.types import Array
from hemivar.laws import VectorLaw
from hemivar.laws.coupled import BenzeggaghKenane, BilinearCohesion, MixedMode, ModeDependentGlue
from tests.bodies import Pattern

__all__ = ["BrokenGlueError", "Glue", "few_points", "marched_by_hand"]

#: Pieces of the curve of a point: along the secant, beyond it, broken; and whether it is shut.
_PIECES = list(itertools.product(("back", "on", "off"), (False, True)))


class BrokenGlueError(Exception):
    """No piece, or more than one."""


@dataclass
class Glue:
    """Bilinear glue in numbers: of one fracture energy, or of two with Benzeggagh and Kenane's exponent."""

    stiffness: float
    strength: float
    energy: float
    ratio: float
    compression: float
    shear_energy: float = 0.0
    exponent: float = 2.0
    shear_strength: float = field(init=False)

    def __post_init__(self) -> None:
        self.shear_strength = self.ratio * self.strength  # of one energy
        if self.shear_energy:  # the stiffness ratio of Turon
            self.shear_strength = self.ratio * self.strength * np.sqrt(self.shear_energy / self.energy)

    @property
    def law(self) -> VectorLaw:
        shut = hv.Compliance(self.compression)
        if not self.shear_energy:
            return MixedMode(BilinearCohesion(self.strength, self.energy, self.stiffness), self.ratio, shut)
        criterion = BenzeggaghKenane(self.energy, self.shear_energy, self.exponent)
        return ModeDependentGlue(
            self.strength, self.shear_strength, self.stiffness, criterion, self.stiffness * self.ratio**2, shut
        )

    def rho(self, r: Array) -> float:
        return float(np.hypot(max(-r[0], 0.0), self.ratio * r[1]))

    def mode(self, r: Array) -> float:
        return (self.ratio * r[1] / max(self.rho(r), 1e-300)) ** 2 if self.shear_energy else 0.0

    def curve(self, mode: float) -> tuple[float, float]:
        """rho of the first damage, whose squares mix, and of the break, ``2 G/(K rho_0)``."""
        share, first = mode**self.exponent, self.strength / self.stiffness
        if not self.shear_energy:
            return first, 2.0 * self.energy / self.strength
        second = self.shear_strength / (self.ratio * self.stiffness)
        begins = float(np.sqrt(first**2 + (second**2 - first**2) * share))
        energy = self.energy + (self.shear_energy - self.energy) * share
        return begins, 2.0 * energy / (self.stiffness * begins)

    def secant(self, rho: float, mode: float) -> float:
        """Traction over rho, on the curve."""
        first, last = self.curve(mode)
        if rho <= first:
            return self.stiffness
        return max(self.stiffness * first * (last - rho) / ((last - first) * rho), 0.0)


@dataclass
class _Point:
    """What a point remembers."""

    reached: float = 0.0
    mode: float | None = None


def few_points(
    glue: Glue, count: int, path: Sequence[Sequence[float]], young: float, pattern: Pattern = "right"
) -> hv.ContactProblem:
    """A strip held at three sides, which move together; its free points are those in the middle of its bottom."""
    times, ways = np.arange(len(path)), np.asarray(path, dtype=float)

    def move(x: Array, t: float) -> Array:
        return np.tile([np.interp(t, times, ways[:, 0]), np.interp(t, times, ways[:, 1])], (len(x), 1))

    held = hv.Prescribed(move)
    return hv.ContactProblem(
        hv.rectangle((1.0, 0.5), (count + 1, 1), pattern),
        hv.Material.young(young, 0.25),
        {"bottom": hv.Contact(glue.law)},
        {"top": held, "left": held, "right": held},
    )


def marched_by_hand(
    glue: Glue, problem: hv.ContactProblem, times: Sequence[float]
) -> Iterator[tuple[Array, list[float]]]:
    """Local displacements (m, 2) of all contact points at times, and the largest rho of each so far."""
    guess, points = None, None
    for time in times:
        now = hv.discretize(problem.at_time(time), check_coercivity=False)
        B, K = now.contact.trace.toarray(), now.stiffness.toarray()
        points = [_Point() for _ in range(now.contact_points)] if points is None else points
        u = np.zeros(len(K)) if guess is None else guess
        guess = u = _equilibrium(glue, now, K, B, points, u)
        r = (B @ u).reshape(-1, 2) - now.offset
        for one, place in zip(points, r, strict=True):
            rho, mode = glue.rho(place), glue.mode(place)
            if one.mode is None and rho > glue.curve(mode)[0]:
                one.mode = mode
            last = np.inf if one.mode is None else glue.curve(one.mode)[1]
            one.reached = min(max(one.reached, rho), last)
        yield r, [one.reached for one in points]


def _equilibrium(glue: Glue, now: hv.DiscreteProblem, K: Array, B: Array, points: list[_Point], start: Array) -> Array:
    """The unknowns for which each free point lies on the piece that it was taken to lie on."""
    free = np.flatnonzero(B.reshape(-1, 2, len(K)).any(axis=(1, 2)))
    for chosen in itertools.product(_PIECES, repeat=free.size):
        u = _newton(glue, now, K, B, points, start, dict(zip(free.tolist(), chosen, strict=True)))
        if u is not None:
            return u
    raise BrokenGlueError


def _traction(glue: Glue, point: _Point, r: Array, piece: str, shut: bool) -> Array:
    mode = glue.mode(r) if point.mode is None else point.mode
    back = glue.stiffness if point.mode is None else glue.secant(point.reached, mode)
    rho = np.hypot(0.0 if shut else r[0], glue.ratio * r[1])
    first, last = glue.curve(mode)
    on = glue.stiffness * first * (last - rho) / ((last - first) * max(rho, 1e-300))
    m = {"back": back, "on": on, "off": 0.0}[piece]
    return np.array([glue.compression * r[0] if shut else m * r[0], glue.ratio**2 * m * r[1]])


def _lies(glue: Glue, point: _Point, r: Array, piece: str, shut: bool) -> bool:
    mode = glue.mode(r) if point.mode is None else point.mode
    first, last = glue.curve(mode)
    ends = {"back": (-1.0, max(first, point.reached if point.mode is not None else 0.0))}
    ends |= {"on": (ends["back"][1], last), "off": (max(ends["back"][1], last), np.inf)}
    low, high = ends[piece]
    return bool((r[0] >= 0.0) == shut and low - 1e-12 <= glue.rho(r) <= high + 1e-12)


def _newton(
    glue: Glue, now: hv.DiscreteProblem, K: Array, B: Array, points: list[_Point], start: Array,
    chosen: dict[int, tuple[str, bool]],
) -> Array | None:  # fmt: skip
    weights, load, offset = now.contact.weights, now.load, now.offset

    def left(u: Array) -> Array:
        r, out = (B @ u).reshape(-1, 2) - offset, K @ u - load
        for i, (piece, shut) in chosen.items():
            out = out + B[2 * i : 2 * i + 2].T @ (weights[i] * _traction(glue, points[i], r[i], piece, shut))
        return np.asarray(out)

    u, step = start, 1e-7
    for _ in range(40):
        off = left(u)
        ways = step * np.eye(len(u))
        J = np.stack([(left(u + way) - left(u - way)) / (2.0 * step) for way in ways], axis=1)
        try:
            change = np.linalg.solve(J, off)
        except np.linalg.LinAlgError:
            return None
        u = u - change
        if not np.isfinite(u).all() or np.abs(u).max() > 1e3:
            return None
        if np.abs(change).max() <= 1e-12:
            r = (B @ u).reshape(-1, 2) - offset
            stands = all(_lies(glue, points[i], r[i], *piece) for i, piece in chosen.items())
            return u if stands else None
    return None
