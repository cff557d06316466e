"""A law in words: formula on each piece, kinks, weak convexity, growth and recession."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from hemivar.laws.minimisers import FAR, piece_bounds

if TYPE_CHECKING:
    from hemivar.laws.superpotential import Superpotential

__all__ = ["LawDescription", "LawKink", "describe"]


@dataclass(frozen=True)
class LawKink:
    """A jump of the derivative j'.

    Attributes
    ----------
    place : float
        Where it jumps.
    left, right : float
        j' on both sides; -inf and +inf at the ends of the domain.
    """

    place: float
    left: float
    right: float

    @property
    def jump(self) -> float:
        """Height of the jump; negative where the law gives way at once."""
        return self.right - self.left

    def __str__(self) -> str:
        if math.isinf(self.jump):
            return f"j ends at r = {self.place:.6g}"
        direction = "up" if self.jump > 0.0 else "down"
        return f"jump {direction} from {self.left:.6g} to {self.right:.6g} at r = {self.place:.6g}"


@dataclass(frozen=True)
class LawDescription:
    """Formula and constants of a law at one contact point; ``str()`` writes them out.

    Attributes
    ----------
    name : str
    pieces : tuple of str
        The derivative on every piece, as text.
    domain : pair of float
        Where j is finite.
    knots : tuple of float
        Ends of the pieces.
    kinks : tuple of LawKink
        Knots at which j' jumps.
    alpha : float
        Weak convexity: the smallest number for which ``j + alpha/2 r^2`` is convex; inf at downward jumps.
    alpha_places : tuple of float
        Where alpha is attained: the downward jumps, else a place (or the end nearest to it) of least curvature.
    c0, c1 : float
        ``|dj(r)| <= c0 + c1 |r|``; infinite where there are no such constants.
    recession : pair of float
        Growth rates of j towards -inf and +inf.
    coercive_above : float
        ``a/2 r^2 - b r + j(r)`` is bounded below for every b if the curvature a exceeds this number.
    alpha_sampled, growth_sampled : bool
        Whether alpha is not proved for every r, or c0 and c1 were found by sampling; otherwise they hold for every r.
    alpha_reach : float
        |r| up to which alpha is proved: inf where it holds for every r, 0 where it is sampled.
    falls_far_out : bool
        Whether the derivative falls without bound far out, so that no alpha holds for every r.
    """

    name: str
    pieces: tuple[str, ...]
    domain: tuple[float, float]
    knots: tuple[float, ...]
    kinks: tuple[LawKink, ...]
    alpha: float
    alpha_places: tuple[float, ...]
    c0: float
    c1: float
    recession: tuple[float, float]
    coercive_above: float
    alpha_sampled: bool
    growth_sampled: bool
    alpha_reach: float = math.inf
    falls_far_out: bool = False

    @property
    def constants_sampled(self) -> bool:
        """Whether one of the constants was found by sampling."""
        return self.alpha_sampled or self.growth_sampled

    @property
    def law_class(self) -> str:
        """``"convex"``, ``"weakly convex"`` (each perhaps ``"... within the reach"``), or ``"jumps down"``."""
        if any(kink.jump < 0.0 for kink in self.kinks):
            return "jumps down"
        if math.isinf(self.alpha):
            return "falls without bound"
        within = self.falls_far_out or 0.0 < self.alpha_reach < math.inf
        return f"{'weakly convex' if self.alpha > 0.0 else 'convex'}{' within the reach' if within else ''}"

    @property
    def lines(self) -> tuple[str, ...]:
        """The description, line by line."""
        sampled = "" if self.alpha_reach == math.inf else f" for |r| <= {self.alpha_reach:.6g}"
        sampled = sampled if self.alpha_reach > 0.0 else " (sampled)"
        places = ", ".join(f"{r:.6g}" for r in self.alpha_places)
        if math.isinf(self.alpha):
            why = "falls without bound far out" if self.law_class != "jumps down" else f"jumps down at r = {places}"
            alpha = f"alpha = inf: the derivative {why}"
        elif places:
            alpha = f"alpha = {self.alpha:.6g}{sampled}, attained at or next to r = {places}"
        else:
            alpha = f"alpha = {self.alpha:.6g}{sampled}"
        if self.falls_far_out and math.isfinite(self.alpha):
            alpha += "; the derivative falls without bound far out"
        growth = (
            f"|dj(r)| <= {self.c0:.6g} + {self.c1:.6g} |r|{' (sampled)' if self.growth_sampled else ''}"
            if math.isfinite(self.c0) and math.isfinite(self.c1)
            else "no constants c0, c1 with |dj(r)| <= c0 + c1 |r|"
        )
        low, high = self.domain
        ends = ([f"r >= {low:.6g}"] if math.isfinite(low) else []) + (
            [f"r <= {high:.6g}"] if math.isfinite(high) else []
        )
        coercive = (
            "bounded below with any elastic body"
            if self.coercive_above == 0.0
            else "not bounded below, however stiff the body is"
            if math.isinf(self.coercive_above)
            else f"bounded below only if the body is stiffer than {self.coercive_above:.6g} per area"
        )
        return (
            *self.pieces,
            *([f"j is finite for {' and '.join(ends)} only"] if ends else []),
            *(str(kink) for kink in self.kinks),
            f"class: {self.law_class}",
            alpha,
            growth,
            f"growth rate of j: {self.recession[0]:.6g} towards -inf, {self.recession[1]:.6g} towards +inf; {coercive}",
        )

    def __str__(self) -> str:
        return "\n".join((self.name, *("    " + line for line in self.lines)))


def describe(law: Superpotential, point: int = 0) -> LawDescription:
    """Formula, kinks and constants of the law at one contact point."""
    law = law.take(np.array([point]))
    knots = law.knots[0]
    left, right = (side[0] for side in law.knot_slopes())
    places = [i for i in range(knots.size) if np.isfinite(knots[i])]
    kinks = tuple(LawKink(float(knots[i]), float(left[i]), float(right[i])) for i in places if left[i] != right[i])
    lower, upper = float(law.domain.lower.ravel()[0]), float(law.domain.upper.ravel()[0])
    alpha = float(law.weak_convexity[0])
    falls = tuple(kink.place for kink in kinks if kink.jump < 0.0)
    pieces: list[tuple[str, float, float]] = []
    steepest, where = 0.0, None
    known = law.proof("alpha")
    within = known.reach[0] or np.inf
    for i in range(len(places) + 1):
        piece = np.array([i])
        low, high = (float(end[0]) for end in piece_bounds(law, piece))
        if low >= high:
            continue
        for r in (max(low, -within), min(high, within)):
            if not low <= r <= high:
                continue
            with np.errstate(all="ignore"):
                curvature = float(law.piece_curvature(piece, np.array([np.clip(r, -FAR, FAR)]))[0])
            if curvature < steepest:
                steepest, where = curvature, (low if np.isfinite(low) else high) if not np.isfinite(r) else r
        formula = law.piece_formula(i)
        if formula and pieces and pieces[-1][0] == formula and left[i - 1] == right[i - 1]:
            pieces[-1] = (formula, pieces[-1][1], high)
        elif formula:
            pieces.append((formula, low, high))
    c0, c1 = (float(np.atleast_1d(c)[0]) for c in law.growth)
    rates = [float(np.atleast_1d(law.recession(np.array([sign])))[0]) for sign in (-1.0, 1.0)]
    rates = [rate + 0.0 for rate in rates]
    outward = min(float(np.atleast_1d(law.asymptotic_curvature(sign))[0]) for sign in (-1.0, 1.0))
    return LawDescription(
        name=law.name,
        pieces=tuple(_piece_line(*piece) for piece in pieces),
        domain=(lower, upper),
        knots=tuple(float(knots[i]) for i in places),
        kinks=kinks,
        alpha=alpha,
        alpha_places=falls if falls else () if where is None else (float(where),),
        c0=c0,
        c1=c1,
        recession=(rates[0], rates[1]),
        coercive_above=max(0.0, -outward),
        alpha_sampled=not known.sure,
        growth_sampled=not law.proof("growth").sure,
        alpha_reach=known.reach[0],
        falls_far_out=_falls_far_out(law, alpha),
    )


def _falls_far_out(law: Superpotential, alpha: float) -> bool:
    """Whether the derivative of a law at one contact point falls the faster the farther out it is, beyond alpha."""
    if law.proof("alpha").sure and not math.isinf(alpha):
        return False
    for sign in (-1.0, 1.0):
        far = sign * FAR * np.array([1.0, 10.0])
        with np.errstate(all="ignore"):
            near, farther = (-law.curvature(far[k : k + 1])[0] for k in (0, 1))
        if farther == np.inf or (farther > 2.0 * near and farther > 2.0 * (alpha if math.isfinite(alpha) else 0.0)):
            return True
    return False


def _piece_line(formula: str, low: float, high: float) -> str:
    ends = (f"{low:.6g} < " if np.isfinite(low) else "", f" < {high:.6g}" if np.isfinite(high) else "")
    return f"j'(r) = {formula}" + (f"   for {ends[0]}r{ends[1]}" if any(ends) else "")
