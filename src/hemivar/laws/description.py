"""What there is to say about a law: formula, kinks, constants."""

from __future__ import annotations

import math
from dataclasses import dataclass

__all__ = ["LawDescription", "LawKink"]


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
        way = "up" if self.jump > 0.0 else "down"
        return f"jump {way} from {self.left:.6g} to {self.right:.6g} at r = {self.place:.6g}"


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
        Whether alpha, or c0 and c1, were found by sampling; otherwise they hold for every r.
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

    @property
    def constants_sampled(self) -> bool:
        """Whether one of the constants was found by sampling."""
        return self.alpha_sampled or self.growth_sampled

    @property
    def law_class(self) -> str:
        """``"convex"``, ``"weakly convex"`` or ``"jumps down"``."""
        if math.isinf(self.alpha):
            return "jumps down"
        return "weakly convex" if self.alpha > 0.0 else "convex"

    @property
    def lines(self) -> tuple[str, ...]:
        """The description, line by line."""
        sampled = " (sampled)" if self.alpha_sampled else ""
        places = ", ".join(f"{place:.6g}" for place in self.alpha_places)
        if math.isinf(self.alpha):
            alpha = f"alpha = inf: the derivative jumps down at r = {places}"
        elif places:
            alpha = f"alpha = {self.alpha:.6g}{sampled}, attained at or next to r = {places}"
        else:
            alpha = f"alpha = {self.alpha:.6g}{sampled}"
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
