"""Consistency checks at samples: whether value, derivative, curvature and alpha of a user's law fit together."""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from typing import ClassVar
from weakref import WeakSet

import numpy as np

from hemivar.basics.conformance import change_and_integral
from hemivar.basics.types import Array
from hemivar.errors import ProblemError
from hemivar.laws.superpotential import Superpotential

__all__ = ["REMEDY", "Samples", "check_consistency", "check_own"]

#: Parts of a cell that is looked at more closely, and cells with the largest rise that may hold a jump; with a quarter
#: of either tests/laws refuse the same.
_FINER, _MOST = 64, 12


class Samples:
    """A law of one contact point on cells, parts of its pieces, and what is wrong with it there, in words.

    Places up to ``reach`` are tried; messages say ``whose`` after *the derivative*.
    """

    #: Places of the grid, in equal steps and on both sides of each knot, from how near on.
    places: ClassVar[tuple[int, int, float]] = (3001, 120, 1e-7)
    #: What a mean rate may be off by, relative to itself and to the largest; the value at zero; noise of values.
    exact: ClassVar[tuple[float, float, float, float]] = (1e-4, 1e-5, 1e-9, 1e-12)
    #: What the fall of the derivative may be off by, relative to alpha and to the law, and cells too short for it.
    falls: ClassVar[tuple[float, float, float]] = (1e-5, 1e-6, 1e-6)
    #: What counts as a jump: rise of a cell and what is left of it, in slopes, and what is left relative to the rise.
    jumps: ClassVar[tuple[float, float, float]] = (1e-6, 1e-5, 1e-3)
    #: Whether the cell that looks worst is looked at more closely: a narrow feature is no fault.
    closer: ClassVar[bool] = False

    def __init__(self, law: Superpotential, reach: float, whose: str = "") -> None:
        self.law, self.reach, self.whose = law, reach, whose
        self.knots = law.knots[0][np.isfinite(law.knots[0])]
        self.ends = float(law.domain.lower.ravel()[0]), float(law.domain.upper.ravel()[0])
        self.low, self.high = np.clip(self.ends, -reach, reach).tolist()
        even, count, nearest = self.places
        close = reach * np.geomspace(nearest, 0.3, count)
        beside = self.knots[np.abs(self.knots) <= reach][:, None] + np.concatenate([-close, close])
        grid = np.unique(np.concatenate([np.linspace(self.low, self.high, even), self.knots, beside.ravel()]))
        self.grid = grid[(grid >= self.low) & (grid <= self.high)]
        width = np.diff(self.grid)  # none of a law that allows one place only
        start, width = self.grid[:-1][width > 1e-12 * reach], width[width > 1e-12 * reach]
        self.start, self.width = start + 1e-9 * width, (1.0 - 2e-9) * width
        sizes = np.abs(law.derivative(self.start + 0.5 * self.width))
        self.slope = max(float(sizes[np.isfinite(sizes)].max(initial=0.0)), 1e-300)

    def zero(self) -> str | None:
        at = float(np.clip(0.0, self.low, self.high))
        value = float(self.law.value(np.array([at]))[0])
        if abs(value) <= self.exact[2] * self.slope * self.reach + 1e-300:
            return None
        return f"the value{self.whose} is {value:.6g} at r = {at:.6g}; subtract it, so that it is 0"

    def kinks(self) -> str | None:
        """Jumps of the derivative inside pieces, found by halving the cells in which it rises most."""
        low, high, d = self.start, self.start + self.width, self.law.derivative
        rise = np.abs(d(high) - d(low))
        most = np.argsort(rise)[-_MOST:]
        most = most[rise[most] > self.jumps[0] * self.slope]
        low, high = low[most], high[most]
        first, last = d(low), d(high)
        for _ in range(30):
            middle = 0.5 * (low + high)
            between = d(middle)
            left = np.abs(between - first) >= np.abs(last - between)
            low, high = np.where(left, low, middle), np.where(left, middle, high)
            first, last = np.where(left, first, between), np.where(left, between, last)
        rest = np.abs(last - first)
        jumps = (rest > self.jumps[1] * self.slope) & (rest > self.jumps[2] * rise[most])
        if not jumps.any():
            return None
        i = int(np.argmax(jumps))
        return (
            f"the derivative{self.whose} jumps by {rest[i]:.6g} at r = {low[i]:.6g}, which is none of its kinks; list "
            "every place where it jumps in kinks"
        )

    def derivative(self) -> str | None:
        return self._integrates(self.law.value, self.law.derivative, "the derivative")

    def curvature(self) -> str | None:
        return self._integrates(self.law.derivative, self.law.curvature, "the curvature")

    def _integrates(self, of: Callable[[Array], Array], rate: Callable[[Array], Array], what: str) -> str | None:
        def off(start: Array, width: Array) -> tuple[Array, Array, Array]:
            """Mean rise and mean rate, and by how much more than is allowed they differ."""
            change, integral = change_and_integral(of, lambda r, step: rate(r) * step, start, width)
            rise, mean = change / width, integral / width
            noise = self.exact[3] * (np.abs(of(start)) + np.abs(of(start + width))) / width
            allowed = self.exact[0] * np.abs(mean) + self.exact[1] * np.abs(mean[np.isfinite(mean)]).max(initial=0.0)
            return rise, mean, np.abs(rise - mean) - allowed - noise

        start, width = self.start, self.width
        if not width.size:
            return None
        rise, mean, wrong = off(start, width)
        if np.isnan(wrong).any():
            wrong = np.where(np.isnan(wrong), -np.inf if self.closer else np.inf, wrong)
        i = int(np.argmax(wrong))
        if not wrong[i] > 0.0:
            return None
        if self.closer:
            start, width = start[i] + width[i] * np.arange(_FINER) / _FINER, np.full(_FINER, width[i] / _FINER)
            rise, mean, wrong = off(start, width)
            if np.count_nonzero(wrong > 0.0) <= _FINER // 4:
                return None
            i = int(np.argmax(wrong))
        ends = f"r = {start[i]:.6g} and {start[i] + width[i]:.6g}"
        return f"{what}{self.whose} is {mean[i]:.6g} between {ends}, but it should be {rise[i]:.6g}"

    def softest(self) -> tuple[float, str]:
        """The largest fall of the derivative per length, inf at a downward jump, and where it is."""
        inner, step = self.knots[(self.low < self.knots) & (self.knots < self.high)], 1e-9 * self.reach
        drop = self.law.derivative(inner - step) - self.law.derivative(inner + step)
        bends = np.abs(self.law.curvature(inner + step)) + np.abs(self.law.curvature(inner - step))
        down = drop > 1e-7 * self.slope + 4.0 * step * bends
        if down.any():
            return np.inf, f"jumps down at r = {inner[np.argmax(down)]:.6g}: give alpha = inf"
        wide = self.width > self.falls[2] * self.reach
        if not wide.any():
            return 0.0, ""
        low, high = self.start[wide], self.start[wide] + self.width[wide]
        fall = (self.law.derivative(low) - self.law.derivative(high)) / (high - low)
        i = int(np.argmax(fall))
        words = (
            f"falls by {fall[i]:.6g} per length between r = {low[i]:.6g} and {high[i]:.6g}; alpha must be at least that"
        )
        return float(max(fall[i], 0.0)), words

    def falls_within(self, alpha: float) -> str | None:
        """Whether a weak convexity is large enough."""
        softest, words = self.softest()
        if softest <= alpha * (1.0 + self.falls[0]) + self.falls[1] * self.slope / self.reach:
            return None
        return f"alpha{self.whose} is {alpha:.6g}, but its derivative {words}"


#: Knots next to which a value may rise ever more steeply: each takes 0.3 ms of an AMD EPYC.
_MOST_KNOTS = 40

REMEDY = "correct the functions, or leave one of them out"

_SEEN: WeakSet[Superpotential] = WeakSet()


def check_own(law: Superpotential) -> None:
    """Look at a law of a class that is not hemivar's, once, if its parameters are numbers."""
    if type(law).__module__.startswith("hemivar."):
        return
    try:
        if law in _SEEN:
            return
    except TypeError:  # a class that cannot be hashed is looked at again
        pass
    try:
        single = law.take(np.array([0])) if law.knots.shape[0] > 1 else law
        reach = 3.0 * float(np.abs(single.knots[np.isfinite(single.knots)]).max(initial=0.0)) or 1.0
        single.value(np.zeros(1))
    except Exception:  # parameters that are not known yet, or a law that only the kit can describe
        return
    check_consistency(single, reach, alpha=float(np.atleast_1d(single.weak_convexity)[0]))
    with contextlib.suppress(TypeError):
        _SEEN.add(law)


def check_consistency(
    law: Superpotential, reach: float, alpha: float | None = None, remedies: tuple[str, str] = (REMEDY, REMEDY)
) -> None:
    """Refuse a law of one contact point whose value, derivative and curvature do not belong to each other.

    Places up to ``reach`` are tried, and ``alpha`` as the user states it; messages name the place.  ``remedies`` are
    for a wrong derivative and for a wrong curvature.
    """
    with np.errstate(all="ignore"):
        look = _QuickLook(law, reach, f" of law '{law.name}'")
        questions = (
            (look.slopes, ""),
            (look.kinks, ""),
            (look.derivative, f"; {remedies[0]}"),
            (look.curvature, f"; {remedies[1]}"),
            (look.zero, ""),
            (lambda: None if alpha is None else look.falls_within(alpha), ""),
        )
        for question, todo in questions:
            if wrong := question():
                raise ProblemError(f"{wrong}{todo}")


class _QuickLook(Samples):
    """Few cells, on which a rate is known roughly."""

    places: ClassVar[tuple[int, int, float]] = (25, 6, 1e-4)
    exact: ClassVar[tuple[float, float, float, float]] = (0.02, 1e-3, 1e-6, 1e-11)
    falls: ClassVar[tuple[float, float, float]] = (1e-2, 1e-4, 1e-4)
    jumps: ClassVar[tuple[float, float, float]] = (1e-3, 0.0, 0.1)
    closer: ClassVar[bool] = True

    def slopes(self) -> str | None:
        """A value that rises ever more steeply next to a knot or to zero."""
        knots, law = self.knots[:_MOST_KNOTS], self.law
        steps = self.reach * np.array([1e-3, 1e-5, 1e-7, 1e-9])
        beside = (np.abs(knots) <= steps[0]).any()  # a knot beside zero stands for it
        places = knots if beside else np.append(knots, 0.0)
        for corner in np.unique(places):
            for side in (-1.0, 1.0):
                at = corner + side * steps
                if not self.ends[0] <= at[0] <= self.ends[1]:
                    continue
                value = law.value(np.full(steps.size, corner))
                rate = np.abs(law.value(at) - value) / steps
                if np.all(rate[1:] > 1.3 * rate[:-1] + (8.0 * np.finfo(float).eps * np.abs(value) / steps)[1:]):
                    return (
                        f"the derivative{self.whose} grows without bound at r = {corner:.6g}; a law needs a finite "
                        "slope everywhere (but at jumps of its derivative)"
                    )
        return None
