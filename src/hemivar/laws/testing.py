"""A conformance kit: is a law, a user's own too, consistent with itself?

from hemivar.laws.testing import check_law
check_law(MyLaw(...))
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from hemivar.basics.conformance import ConformanceReport, failures_of
from hemivar.basics.types import Array, IntArray
from hemivar.errors import HemivarError
from hemivar.laws.friction.friction_law import Friction
from hemivar.laws.superpotential import Superpotential

__all__ = ["LawError", "LawReport", "check_law"]

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(5)


class LawError(HemivarError, AssertionError):
    """A law contradicts itself; the message lists how."""


@dataclass(frozen=True)
class LawReport(ConformanceReport):
    """What the kit tried and found about a law."""

    subject: ClassVar[str] = "law"


def check_law(
    law: Superpotential | Friction,
    *,
    reach: float | None = None,
    seed: int = 0,
    friction: bool = False,
    raises: bool = True,
) -> LawReport:
    """Check every answer of a law against its value, on a dense grid and at random places.

    Parameters
    ----------
    law : Superpotential or Friction
        With resolved parameters (``law.at(points)``); of a friction law with several contact points, or one whose
        bound depends on the state, the profile at the first point is checked.
    reach : float, optional
        Places between ``-reach`` and ``reach`` are tried; three times the largest knot by default.
    seed : int
        Of the random places.
    friction : bool
        Demand that a superpotential is even, as a friction profile must be.
    raises : bool
        Raise if something is wrong; with False the report says so.

    Returns
    -------
    LawReport

    Raises
    ------
    LawError
        With the list of failures.
    """
    if isinstance(law, Friction):
        scalar, friction = (law.profile if law.state_dependent else law.radial), True
    else:
        scalar = law
    first = "the law answers with finite numbers of the right shape"
    try:
        with np.errstate(all="ignore"):
            checker = _Checker(scalar, reach, seed)
    except Exception as error:
        report = LawReport(scalar.name, (first,), (f"{first}: it is not: {type(error).__name__}: {error}",))
        if raises:
            raise LawError(str(report)) from error
        return report
    steps: list[tuple[str, Callable[[], str | None]]] = [
        (first, checker.shapes),
        ("the value is continuous and zero at r = 0", checker.continuity),
        ("no kink is missing among the knots", checker.missing_kinks),
        ("the derivative is that of the value", checker.derivative),
        ("the curvature is that of the derivative", checker.curvature),
        ("the subdifferential at knots reaches from one derivative to the other", checker.subdifferential),
        ("local_argmin is the global minimiser", checker.local_argmin),
        ("prox is the global minimiser", checker.prox),
        ("alpha is large enough", checker.alpha_enough),
        ("alpha is not needlessly large", checker.alpha_needed),
        ("the growth constants bound the subdifferential", checker.growth),
        ("the recession is the growth rate far away", checker.recession),
        ("scaled, take and at agree with the law", checker.copies),
        ("all contact points at once give what each gives alone", checker.vectors),
    ]
    if friction:
        steps.append(("the law is even", checker.even))
    report = LawReport(scalar.name, *failures_of(steps))
    if raises and not report.passed:
        raise LawError(str(report))
    return report


@dataclass
class _Checker:
    """Samples of a law at its first contact point, and the questions about them."""

    law: Superpotential
    reach: float | None
    seed: int
    one: Superpotential = field(init=False)

    def __post_init__(self) -> None:
        self.one = self.law.take(np.array([0])) if self.law.knots.shape[0] > 1 else self.law
        knots = self.one.knots[0]
        self.knots = knots[np.isfinite(knots)]
        largest = float(np.abs(self.knots).max(initial=0.0))
        self.size = float(self.reach or (3.0 * largest if largest > 0.0 else 1.0))
        domain = self.one.domain
        self.low = max(-self.size, float(domain.lower.ravel()[0]))
        self.high = min(self.size, float(domain.upper.ravel()[0]))
        close = np.geomspace(1e-7, 0.3, 120) * self.size
        around = [knot + sign * close for knot in self.knots[np.abs(self.knots) <= self.size] for sign in (-1.0, 1.0)]
        grid = np.concatenate([np.linspace(self.low, self.high, 3001), self.knots, *around])
        self.grid = np.unique(grid[(grid >= self.low) & (grid <= self.high)])
        if self.grid.size == 1:  # a law that allows one place only
            self.cells = np.zeros((0, 2))
        else:
            cells = np.stack([self.grid[:-1], self.grid[1:]], axis=1)
            self.cells = cells[cells[:, 1] - cells[:, 0] > 1e-12 * self.size]
        self.values = np.array(self.one.value(self.grid), dtype=float)
        self.slope = max(float(np.abs(self._gauss(self.one.derivative)[0]).max(initial=0.0)), 1e-300)
        self.random = np.random.default_rng(self.seed)

    def _gauss(self, function: Callable[[Array], Array]) -> tuple[Array, Array]:
        """Values at the Gauss points of every cell, and their means."""
        middle, half = self.cells.mean(axis=1), 0.5 * np.diff(self.cells, axis=1)[:, 0]
        at = middle[:, None] + half[:, None] * _NODES
        values = np.asarray(function(at.ravel())).reshape(at.shape)
        return values, 0.5 * values @ _WEIGHTS

    def shapes(self) -> str | None:
        r = np.linspace(self.low, self.high, 7)
        for name in ("value", "derivative", "curvature"):
            values = np.asarray(getattr(self.one, name)(r))
            if values.shape != r.shape:
                return f"{name} returns shape {values.shape} for {r.size} places"
            inside = (r > self.low) & (r < self.high)
            if not np.isfinite(values[inside]).all():
                bad = int(np.argmax(inside & ~np.isfinite(values)))
                return f"{name} is {values[bad]} at r = {r[bad]:g}"
        knots = self.one.knots
        if knots.ndim != 2 or (np.diff(self.knots) <= 0.0).any() or self.knots.size == 0:
            return f"knots are {knots}; give at least one, increasing, in shape (m or 1, K)"
        return None

    def continuity(self) -> str | None:
        zero = float(np.clip(0.0, self.low, self.high))
        start = float(self.one.value(np.array([zero]))[0])
        size = self.slope * self.size
        if abs(start) > 1e-9 * size:
            return f"j({zero:g}) = {start:.6g}"
        for i, knot in enumerate(self.knots):
            if not self.low < knot < self.high:
                continue
            left, right = (float(self.one.piece_value(np.array([k]), np.array([knot]))[0]) for k in (i, i + 1))
            if not abs(left - right) <= 1e-8 * size:
                return f"at the knot {knot:.6g} it is {left:.6g} from the left and {right:.6g} from the right"
        return None

    def missing_kinks(self) -> str | None:
        if not len(self.cells):
            return None
        d = self.one.derivative
        width = 1e-6 * (self.cells[:, 1] - self.cells[:, 0])
        rise = np.abs(d(self.cells[:, 1] - width) - d(self.cells[:, 0] + width))
        for i in np.argsort(rise)[-12:]:
            low, high = self.cells[i, 0] + width[i], self.cells[i, 1] - width[i]
            if not rise[i] > 1e-6 * self.slope:
                continue
            for _ in range(60):
                middle = 0.5 * (low + high)
                if high - low < 1e-9 * self.size:
                    break
                at = d(np.array([low, middle, high]))
                low, high = (low, middle) if abs(at[1] - at[0]) >= abs(at[2] - at[1]) else (middle, high)
            left = abs(float(np.diff(d(np.array([low, high])))[0]))
            if left > 1e-3 * rise[i] and left > 1e-5 * self.slope:
                return (
                    f"the derivative jumps by {left:.4g} at r = {middle:.8g}, which is not a knot; add it to the kinks"
                )
        return None

    def _integrates(self, of: Callable[[Array], Array], rate: Callable[[Array], Array], what: str) -> str | None:
        if not len(self.cells):
            return None
        width = self.cells[:, 1] - self.cells[:, 0]
        margin = 1e-9 * width
        low, high = self.cells[:, 0] + margin, self.cells[:, 1] - margin
        rise = (of(high) - of(low)) / (high - low)
        _, mean = self._gauss(rate)
        size = float(np.abs(of(self.cells.mean(axis=1))).max())
        rates = float(np.abs(mean).max())
        allowed = 1e-5 * rates + 1e-12 * size / width + 1e-4 * np.abs(mean)
        wrong = np.abs(rise - mean) - allowed
        i = int(np.argmax(wrong))
        if wrong[i] > 0.0 or np.isnan(wrong).any():
            i = int(np.argmax(np.isnan(wrong))) if np.isnan(wrong).any() else i
            return f"between r = {low[i]:.6g} and {high[i]:.6g} {what} is {mean[i]:.6g}, but it should be {rise[i]:.6g}"
        return None

    def derivative(self) -> str | None:
        return self._integrates(self.one.value, self.one.derivative, "the derivative")

    def curvature(self) -> str | None:
        return self._integrates(self.one.derivative, self.one.curvature, "the curvature")

    def subdifferential(self) -> str | None:
        for knot in self.knots:
            at = np.array([knot])
            interval = self.one.subdifferential(at)
            found = (float(interval.lower[0]), float(interval.upper[0]))
            step = 1e-7 * self.size
            sides = []
            for sign in (-1.0, 1.0):
                near = np.array([knot + sign * step])
                if self.low <= near[0] <= self.high:
                    slope = float(self.one.derivative(near)[0]) - sign * step * float(self.one.curvature(near)[0])
                    sides.append(slope)
                else:
                    sides.append(sign * np.inf if abs(near[0]) <= self.size else found[int(sign > 0)])
            wanted = (min(sides), max(sides))
            for f, w in zip(found, wanted, strict=True):
                if f != w and not abs(f - w) <= 1e-4 * self.slope:
                    told = f"[{found[0]:.6g}, {found[1]:.6g}]"
                    return f"at r = {knot:.6g} it is {told}, not [{wanted[0]:.6g}, {wanted[1]:.6g}]"
        return None

    def _stiffness(self) -> Array:
        """Random curvatures on the scale of the law, above what it needs to be coercive."""
        least = max(0.0, -min(float(np.atleast_1d(self.one.asymptotic_curvature(s))[0]) for s in (-1.0, 1.0)))
        return np.asarray(least + self.slope / self.size * 10.0 ** self.random.uniform(-1.5, 2.0, 60))

    def _minimises(self, a: Array, b: Array, r: Array, what: str) -> str | None:
        if np.shape(r) != a.shape:
            return f"{what} has shape {np.shape(r)} for {a.size} places"
        found = 0.5 * a * r**2 - b * r + self.one.value(r)
        on_grid = 0.5 * a[:, None] * self.grid**2 - b[:, None] * self.grid + self.values
        best = on_grid.min(axis=1)
        allowed = 1e-9 * (np.abs(best) + self.slope * self.size)
        wrong = ~(found <= best + allowed)
        if wrong.any():
            i = int(np.argmax(wrong))
            other = self.grid[np.argmin(on_grid[i])]
            return (
                f"for a = {a[i]:.6g}, b = {b[i]:.6g} it gives r = {r[i]:.6g}, but r = {other:.6g} is lower "
                f"({found[i]:.8g} > {best[i]:.8g})"
            )
        off = self.one.graph_distance(r, b - a * r, 1.0 / a)
        wrong = ~(off <= 1e-6 * (np.abs(b) + self.slope))
        if wrong.any():
            i = int(np.argmax(wrong))
            return (
                f"for a = {a[i]:.6g}, b = {b[i]:.6g} it gives r = {r[i]:.10g}, where b - a r is {off[i]:.2g} off "
                f"the subdifferential"
            )
        return None

    def local_argmin(self) -> str | None:
        a = self._stiffness()
        b = a * self.random.uniform(-1.0, 1.0, a.size) * self.size + self.slope * self.random.uniform(-1.0, 1.0, a.size)
        return self._minimises(a, b, self.one.local_argmin(a, b), "local_argmin")

    def prox(self) -> str | None:
        a = self._stiffness()
        x = self.random.uniform(-1.0, 1.0, a.size) * self.size + self.slope / a * self.random.uniform(-1.0, 1.0, a.size)
        return self._minimises(a, a * x, self.one.prox(x, 1.0 / a), "prox")

    def _softest(self) -> tuple[float, float]:
        """Largest fall of the derivative per length within the pieces, and where; inf at a downward jump."""
        for knot in self.knots:
            if self.low < knot < self.high:
                step = 1e-9 * self.size
                ahead, behind = np.array([knot + step]), np.array([knot - step])
                ends = float(self.one.derivative(ahead)[0]), float(self.one.derivative(behind)[0])
                curvatures = abs(float(self.one.curvature(ahead)[0])) + abs(float(self.one.curvature(behind)[0]))
                if ends[1] - ends[0] > 1e-7 * self.slope + 4.0 * step * curvatures:
                    return np.inf, float(knot)
        if not len(self.cells):
            return 0.0, 0.0
        width = self.cells[:, 1] - self.cells[:, 0]
        low, high = self.cells[:, 0] + 1e-9 * width, self.cells[:, 1] - 1e-9 * width
        wide = width > 1e-6 * self.size
        fall = -(self.one.derivative(high) - self.one.derivative(low)) / (high - low)
        i = int(np.argmax(np.where(wide, fall, -np.inf)))
        return float(max(fall[i], 0.0)), float(low[i])

    def _noise(self) -> float:
        return 1e-6 * self.slope / self.size

    def alpha_enough(self) -> str | None:
        alpha = float(self.one.weak_convexity[0])
        softest, where = self._softest()
        if softest > alpha * (1.0 + 1e-5) + self._noise():
            if np.isinf(softest):
                return f"alpha = {alpha:.6g}, but the derivative jumps down at r = {where:.6g}: alpha must be inf"
            return f"alpha = {alpha:.6g}, but the derivative falls by {softest:.6g} per length at r = {where:.6g}"
        return None

    def alpha_needed(self) -> str | None:
        alpha = float(self.one.weak_convexity[0])
        softest, _ = self._softest()
        if alpha > 1.05 * softest + self._noise():
            return f"alpha = {alpha:.6g}, but {softest:.6g} is enough up to |r| = {self.size:.6g}"
        return None

    def growth(self) -> str | None:
        c0, c1 = (float(np.atleast_1d(c)[0]) for c in self.one.growth)
        if not np.isfinite(c0 + c1):
            return None
        r = np.concatenate([self.grid, 3.0 * self.grid])
        r = r[(r >= float(self.one.domain.lower.ravel()[0])) & (r <= float(self.one.domain.upper.ravel()[0]))]
        interval = self.one.subdifferential(r)
        size = np.maximum(np.abs(interval.lower), np.abs(interval.upper))
        wrong = size > (c0 + c1 * np.abs(r)) * (1.0 + 1e-6) + 1e-9 * self.slope
        if wrong.any():
            i = int(np.argmax(wrong))
            return f"|dj| = {size[i]:.6g} at r = {r[i]:.6g}, but c0 + c1 |r| = {c0 + c1 * abs(r[i]):.6g}"
        return None

    def recession(self) -> str | None:
        for sign in (-1.0, 1.0):
            told = float(np.atleast_1d(self.one.recession(np.array([sign])))[0])
            far = np.array([1e4, 1e6]) * self.size
            rate = self.one.value(sign * far) / far
            if np.isfinite(told) and not abs(rate[1] - told) <= 1e-2 * self.slope + 1e-3 * abs(told):
                return f"towards {sign:+.0f} inf it is {told:.6g}, but j(r)/r = {rate[1]:.6g} at |r| = {far[1]:.3g}"
            if np.isinf(told) and not (np.sign(told) * rate[1] > 0.0 and abs(rate[1]) > 1.5 * abs(rate[0])):
                if np.isinf(rate[1]) and np.sign(rate[1]) == np.sign(told):
                    continue
                return f"towards {sign:+.0f} inf it is {told:.6g}, but j(r)/r = {rate[1]:.6g} at |r| = {far[1]:.3g}"
        return None

    def copies(self) -> str | None:
        r = self.random.choice(self.grid, 40)
        values, slopes = self.one.value(r), self.one.derivative(r)
        points = np.zeros((1, 2))
        for name, other, factor in (
            ("scaled(2)", self.one.scaled(2.0), 2.0),
            ("scaled(np.full(40, 0.5))", self.one.scaled(np.full(40, 0.5)), 0.5),
            ("take([0])", self.one.take(np.array([0])), 1.0),
            ("at(points)", self.one.at(points), 1.0),
        ):
            for what, expected in (("value", values), ("derivative", slopes)):
                got = getattr(other, what)(r)
                if np.shape(got) != r.shape or not np.allclose(
                    got, factor * expected, rtol=1e-9, atol=1e-12 * self.slope
                ):
                    return f"{name} has another {what} than {factor:g} times that of the law"
        a = self._stiffness()[:40]
        b = a * self.random.uniform(-1.0, 1.0, 40) * self.size
        r1, r2 = self.one.local_argmin(a, b), self.one.scaled(3.0).local_argmin(3.0 * a, 3.0 * b)
        e1, e2 = (0.5 * a * x**2 - b * x + self.one.value(x) for x in (r1, r2))
        if not np.allclose(e1, e2, rtol=1e-7, atol=1e-9 * self.slope * self.size):
            return "scaled(3) does not have the minimisers of the law"
        return None

    def vectors(self) -> str | None:
        rows = max(self.law.knots.shape[0], 12 if self.law.knots.shape[0] == 1 else 0)
        r = self.random.choice(self.grid, rows)
        a = np.resize(self._stiffness(), rows)
        b = a * self.random.uniform(-1.0, 1.0, rows) * self.size
        answers: dict[str, Callable[[Superpotential, IntArray], Array]] = {
            "value": lambda law, i: law.value(r[i]),
            "derivative": lambda law, i: law.derivative(r[i]),
            "distance": lambda law, i: law.distance(r[i], b[i]),
            "local_argmin": lambda law, i: law.local_argmin(a[i], b[i]),
            "prox_slope": lambda law, i: law.prox_slope(r[i], 1.0 / a[i]),
        }
        everywhere = np.arange(rows)
        for name, answer in answers.items():
            together = np.asarray(answer(self.law, everywhere))
            if together.shape != (rows,):
                return f"{name} returns shape {together.shape} for {rows} contact points"
            for j in everywhere[:: max(1, rows // 12)]:
                part = self.law.take(np.array([j])) if self.law.knots.shape[0] > 1 else self.law
                alone = np.asarray(answer(part, np.array([j])))[0]
                same = together[j] == alone or abs(together[j] - alone) <= 1e-7 * (abs(alone) + 1e-300)
                if not (same or abs(together[j] - alone) <= 1e-9 * self.size):
                    return f"{name} at contact point {j} is {together[j]:.8g} among others and {alone:.8g} alone"
        return None

    def even(self) -> str | None:
        r = self.grid[self.grid >= 0.0]
        ahead, behind = self.one.value(r), self.one.value(-r)
        wrong = ~(np.abs(ahead - behind) <= 1e-8 * self.slope * self.size)
        if wrong.any():
            i = int(np.argmax(wrong))
            return f"j({r[i]:.6g}) = {ahead[i]:.6g}, but j({-r[i]:.6g}) = {behind[i]:.6g}"
        return None
