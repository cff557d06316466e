"""Conformance kit for scalar laws: is a law, a user's own too, consistent with itself?

from hemivar.laws.testing import check_law
check_law(MyLaw(...))
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from hemivar.basics.arguments import expecting, positive
from hemivar.basics.conformance import failures_of
from hemivar.basics.types import Array, IntArray
from hemivar.laws.consistency import Samples
from hemivar.laws.contact_law import ContactLaw
from hemivar.laws.friction.friction_law import Friction
from hemivar.laws.scalar_graph import prox_slope
from hemivar.laws.superpotential import Superpotential
from hemivar.laws.vector_testing import LawError, LawReport, Questions

__all__ = ["LawError", "LawReport", "check_law"]


@expecting(law=Superpotential | Friction, reach=positive, seed=int, friction=bool, raises=bool)
def check_law(
    law: Superpotential | Friction,
    *,
    reach: float | None = None,
    seed: int = 0,
    friction: bool = False,
    raises: bool = True,
) -> LawReport:
    """Check every answer of a law against its value, on a dense grid and at random places, and as a law of a point.

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
        return report.or_raised(raises)
    steps = (
        (first, checker.shapes),
        ("the value is continuous and zero at r = 0", checker.continuity),
        ("no kink is missing among the knots", checker.kinks),
        ("the derivative is that of the value", checker.derivative),
        ("the curvature is that of the derivative", checker.curvature),
        ("the subdifferential at knots reaches from one derivative to the other", checker.subdifferential),
        ("alpha is large enough", checker.alpha_enough),
        ("alpha is not needlessly large", checker.alpha_needed),
        ("the growth constants bound the subdifferential", checker.growth),
        ("scaled, take and at agree with the law", checker.copies),
        ("all contact points at once give what each gives alone", checker.vectors),
        *checker.questions.minimisers(),
        *([("the law is even", checker.even)] if friction else []),
    )
    return LawReport(scalar.name, *failures_of(steps)).or_raised(raises)


class _Alone(ContactLaw):
    """A normal law alone, whatever is wrong with it."""

    def __post_init__(self) -> None:
        """Nothing is refused: the kit says what is wrong."""

    def prox(self, x: Array, tau: Array) -> Array:
        return self.normal.prox(x[:, 0], tau[:, 0])[:, None]


class _Checker(Samples):
    """Samples of a law at its first contact point, and the questions about them."""

    def __init__(self, law: Superpotential, reach: float | None, seed: int) -> None:
        single = law.take(np.array([0])) if law.knots.shape[0] > 1 else law
        knots = single.knots[0][np.isfinite(single.knots[0])]
        size = float(reach or 3.0 * float(np.abs(knots).max(initial=0.0)) or 1.0)
        super().__init__(single, size)
        self.whole, self.random = law, np.random.default_rng(seed)
        self.questions = Questions(_Alone(single), size, 1, self.random, self.grid)

    def shapes(self) -> str | None:
        r = np.linspace(self.low, self.high, 7)
        for name in ("value", "derivative", "curvature"):
            values = np.asarray(getattr(self.law, name)(r))
            if values.shape != r.shape:
                return f"{name} returns shape {values.shape} for {r.size} places"
            inside = (r > self.low) & (r < self.high)
            if not np.isfinite(values[inside]).all():
                bad = int(np.argmax(inside & ~np.isfinite(values)))
                return f"{name} is {values[bad]} at r = {r[bad]:g}"
        knots = self.law.knots
        if knots.ndim != 2 or (np.diff(self.knots) <= 0.0).any() or self.knots.size == 0:
            return f"knots are {knots}; give at least one, increasing, in shape (m or 1, K)"
        return None

    def continuity(self) -> str | None:
        inner = np.flatnonzero((self.low < self.knots) & (self.knots < self.high))
        left, right = (self.law.piece_value(inner + side, self.knots[inner]) for side in (0, 1))
        wrong = ~(np.abs(left - right) <= 1e-8 * self.slope * self.reach)
        if wrong.any():
            i = int(np.argmax(wrong))
            knot = self.knots[inner[i]]
            return f"at the knot {knot:.6g} it is {left[i]:.6g} from the left and {right[i]:.6g} from the right"
        return self.zero()

    def subdifferential(self) -> str | None:
        step, interval = 1e-7 * self.reach, self.law.subdifferential(self.knots)
        stated = np.stack([interval.lower, interval.upper], axis=1)
        near = self.knots[:, None] + step * np.array([-1.0, 1.0])
        slope, bend = (of(near.ravel()).reshape(near.shape) for of in (self.law.derivative, self.law.curvature))
        slope = slope - (near - self.knots[:, None]) * bend
        outside = np.where(np.abs(near) <= self.reach, np.array([-np.inf, np.inf]), stated)
        wanted = np.sort(np.where((near >= self.low) & (near <= self.high), slope, outside), axis=1)
        wrong = ((stated != wanted) & ~(np.abs(stated - wanted) <= 1e-4 * self.slope)).any(axis=1)
        if not wrong.any():
            return None
        i = int(np.argmax(wrong))
        lower, upper = stated[i]
        return (
            f"at r = {self.knots[i]:.6g} it is [{lower:.6g}, {upper:.6g}], not [{wanted[i, 0]:.6g}, {wanted[i, 1]:.6g}]"
        )

    def alpha_enough(self) -> str | None:
        return self.falls_within(float(self.law.weak_convexity[0]))

    def alpha_needed(self) -> str | None:
        alpha, (softest, _) = float(self.law.weak_convexity[0]), self.softest()
        if alpha > 1.05 * softest + 1e-6 * self.slope / self.reach:
            return f"alpha = {alpha:.6g}, but {softest:.6g} is enough up to |r| = {self.reach:.6g}"
        return None

    def growth(self) -> str | None:
        c0, c1 = (float(np.atleast_1d(c)[0]) for c in self.law.growth)
        if not np.isfinite(c0 + c1):
            return None
        r = np.concatenate([self.grid, 3.0 * self.grid])
        r = r[(r >= self.ends[0]) & (r <= self.ends[1])]
        interval = self.law.subdifferential(r)
        size = np.maximum(np.abs(interval.lower), np.abs(interval.upper))
        wrong = size > (c0 + c1 * np.abs(r)) * (1.0 + 1e-6) + 1e-9 * self.slope
        if wrong.any():
            i = int(np.argmax(wrong))
            return f"|dj| = {size[i]:.6g} at r = {r[i]:.6g}, but c0 + c1 |r| = {c0 + c1 * abs(r[i]):.6g}"
        return None

    def copies(self) -> str | None:
        r = self.random.choice(self.grid, 40)
        values, slopes = self.law.value(r), self.law.derivative(r)
        points = np.zeros((1, 2))
        for name, other, factor in (
            ("scaled(2)", self.law.scaled(2.0), 2.0),
            ("scaled(np.full(40, 0.5))", self.law.scaled(np.full(40, 0.5)), 0.5),
            ("take([0])", self.law.take(np.array([0])), 1.0),
            ("at(points)", self.law.at(points), 1.0),
        ):
            for what, expected in (("value", values), ("derivative", slopes)):
                got = getattr(other, what)(r)
                if np.shape(got) != r.shape or not np.allclose(
                    got, factor * expected, rtol=1e-9, atol=1e-12 * self.slope
                ):
                    return f"{name} has another {what} than {factor:g} times that of the law"
        a = self.questions.a[:40, 0]
        b = a * self.questions.r[:40, 0]
        r1, r2 = self.law.local_argmin(a, b), self.law.scaled(3.0).local_argmin(3.0 * a, 3.0 * b)
        e1, e2 = (0.5 * a * x**2 - b * x + self.law.value(x) for x in (r1, r2))
        if not np.allclose(e1, e2, rtol=1e-7, atol=1e-9 * self.slope * self.reach):
            return "scaled(3) does not have the minimisers of the law"
        return None

    def vectors(self) -> str | None:
        rows = max(self.whole.knots.shape[0], 12 if self.whole.knots.shape[0] == 1 else 0)
        r = self.random.choice(self.grid, rows)
        a = np.resize(self.questions.a[:, 0], rows)
        b = a * self.random.uniform(-1.0, 1.0, rows) * self.reach
        answers: dict[str, Callable[[Superpotential, IntArray], Array]] = {
            "value": lambda law, i: law.value(r[i]),
            "derivative": lambda law, i: law.derivative(r[i]),
            "distance": lambda law, i: law.distance(r[i], b[i]),
            "local_argmin": lambda law, i: law.local_argmin(a[i], b[i]),
            "prox_slope": lambda law, i: prox_slope(law, r[i], 1.0 / a[i]),
        }
        everywhere = np.arange(rows)
        for name, answer in answers.items():
            together = np.asarray(answer(self.whole, everywhere))
            if together.shape != (rows,):
                return f"{name} returns shape {together.shape} for {rows} contact points"
            for j in everywhere[:: max(1, rows // 12)]:
                part = self.whole.take(np.array([j])) if self.whole.knots.shape[0] > 1 else self.whole
                alone = np.asarray(answer(part, np.array([j])))[0]
                same = together[j] == alone or abs(together[j] - alone) <= 1e-7 * (abs(alone) + 1e-300)
                if not (same or abs(together[j] - alone) <= 1e-9 * self.reach):
                    return f"{name} at contact point {j} is {together[j]:.8g} among others and {alone:.8g} alone"
        return None

    def even(self) -> str | None:
        r = self.grid[self.grid >= 0.0]
        ahead, behind = self.law.value(r), self.law.value(-r)
        wrong = ~(np.abs(ahead - behind) <= 1e-8 * self.slope * self.reach)
        if wrong.any():
            i = int(np.argmax(wrong))
            return f"j({r[i]:.6g}) = {ahead[i]:.6g}, but j({-r[i]:.6g}) = {behind[i]:.6g}"
        return None
