"""Conformance kit: is a law, a user's own too, consistent with itself?

from hemivar.laws.testing import check_law, check_vector_law
check_law(MyLaw(...))
check_vector_law(MixedMode(...).at(None), reach=0.05)
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from hemivar.basics.arguments import expecting, positive
from hemivar.basics.conformance import ConformanceError, ConformanceReport, Step, failures_of
from hemivar.basics.first_use import cached_property
from hemivar.basics.types import Array, IntArray
from hemivar.laws.consistency import Samples
from hemivar.laws.contact_law import ContactLaw
from hemivar.laws.friction.friction_law import Friction
from hemivar.laws.scalar_graph import prox_slope
from hemivar.laws.superpotential import Superpotential
from hemivar.laws.vector_law import (
    VectorLaw,
    frozen_at,
    prox,
    prox_jacobian,
    spread,
    weak_convexity_at,
)

__all__ = ["LawError", "LawReport", "check_graph", "check_law", "check_vector_law"]

#: Places and local problems that are tried; lines and columns of the grid on which minimisers are looked for.
_PLACES, _PROBLEMS, _GRID = 400, 60, 161


class LawError(ConformanceError):
    """A law contradicts itself; the message lists how."""


@dataclass(frozen=True)
class LawReport(ConformanceReport):
    """What the kit tried and found about a law."""

    subject: ClassVar[str] = "law"
    error: ClassVar[type[ConformanceError]] = LawError


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
        ("prox is the global minimiser", checker.prox),
        *checker.questions.minimisers(),
        *([("the law is even", checker.even)] if friction else []),
    )
    return LawReport(scalar.name, *failures_of(steps)).or_raised(raises)


def check_vector_law(
    law: VectorLaw, *, reach: float, components: int = 2, seed: int = 0, raises: bool = True
) -> LawReport:
    """Check the answers of a law against its value, at random places and on a grid of openings and slips.

    Parameters
    ----------
    law : VectorLaw
        With resolved parameters, the same at all contact points; its bound depends on no state.
    reach : float
        Places up to this size are tried.
    components : int
        2 in the plane, 3 in space.
    seed : int
        Of the random places.
    raises : bool
        Raise if something is wrong; with False the report says so.

    Raises
    ------
    LawError
        With the list of failures.
    """
    asked = _Questions(law, reach, components, np.random.default_rng(seed))
    steps = (
        ("the value is zero at r = 0", asked.origin),
        ("the gradient is that of the value", asked.gradient),
        ("the hessian is that of the gradient", asked.hessian),
        ("alpha makes the law convex", asked.convexity),
        *asked.minimisers(),
    )
    return LawReport(law.name, *failures_of(steps)).or_raised(raises)


def check_graph(law: VectorLaw, *, reach: float, components: int = 2, seed: int = 0, raises: bool = True) -> LawReport:
    """Check :meth:`VectorLaw.on_graph` of a law, one whose bound or mode depends on the state too.

    Parameters, errors: see :func:`check_vector_law`.
    """
    chart = _Chart.of(law, reach, components, _PLACES, np.random.default_rng(seed))
    return LawReport(law.name, *failures_of(_graph_steps(lambda: chart))).or_raised(raises)


def _graph_steps(chart: Callable[[], _Chart]) -> tuple[Step, ...]:
    return (
        ("on_graph finds pairs of the law", lambda: chart().pairs()),
        ("on_graph is Lipschitz", lambda: chart().lipschitz()),
        ("the jacobian of on_graph is its derivative", lambda: chart().jacobian()),
    )


def _differences(of: Callable[[Array], Array], at: Array, step: float) -> Array:
    """Central differences of an answer along each component of places (m, c)."""
    return np.stack([(of(at + s) - of(at - s)) / (2.0 * step) for s in step * np.eye(at.shape[1])], axis=-1)


@dataclass(frozen=True, eq=False)
class _Chart:
    """Random places of Minty's chart, ``p`` and ``a``, and the questions about them."""

    law: VectorLaw
    p: Array  # (m, c)
    a: Array  # (m, 2)
    alpha: Array  # (2,), with the Lipschitz constant of a law that depends on the whole state
    size: float  # of multipliers
    random: np.random.Generator

    @staticmethod
    def of(law: VectorLaw, reach: float, components: int, places: int, random: np.random.Generator) -> _Chart:
        alpha = np.array([float(np.max(part)) for part in weak_convexity_at(law, np.zeros((1, components)))])
        if law.depends_on_whole_state:
            alpha = alpha + float(np.max(law.lipschitz))
        r = random.uniform(-reach, reach, (places, components))
        inside = law.admissible(r)
        size = float(np.abs(frozen_at(law, inside).nearest_multiplier(inside, np.zeros_like(r))).max()) or 1.0
        finite = np.where(np.isfinite(alpha), alpha, 10.0 * size / reach)
        a = finite + np.maximum(finite, size / reach) * 10.0 ** random.uniform(-1.0, 1.0, (places, 2))
        p = spread(a, components) * r + size * random.uniform(-1.5, 1.5, r.shape)
        return _Chart(law, p, a, alpha, size, random)

    def pairs(self) -> str | None:
        on, a = self.law.on_graph(self.p, self.a), spread(self.a, self.p.shape[1])
        large = np.abs(self.p).max() + self.size
        if np.abs(a * on.r + on.multiplier - self.p).max() > 1e-12 * large:
            return "a r + lam is not p"
        off = self.law.frozen(on.r, on.multiplier).graph_distance(on.r, on.multiplier, 1.0 / self.a)
        i = int(np.argmax(off))
        return None if off[i] <= 1e-8 * large else f"at p = {self.p[i]}, a = {self.a[i]} it differs by {off[i]:.3g}"

    def lipschitz(self) -> str | None:
        """Of parts that do not see one another: in the length a - alpha of each."""
        if self.law.state_dependent and not self.law.depends_on_whole_state:
            return None  # the bound goes with the normal part: checked by the derivative
        if not np.isfinite(self.alpha).all():
            return None
        on, c = self.law.on_graph(self.p, self.a), self.p.shape[1]
        for size in (1e-6, 1e-3, 0.1, 1.0):
            step = size * self.size * self.random.normal(size=self.p.shape)
            r = self.law.on_graph(self.p + step, self.a).r - on.r
            room = spread(self.a - self.alpha, c)
            if self.law.depends_on_whole_state:
                room = np.broadcast_to(room.min(axis=1, keepdims=True), r.shape)
            # monotone: (a - alpha) |dr|^2 <= dp . dr, in the norm of each component
            over = (room * r**2).sum(axis=1) - (step * r).sum(axis=1)
            i = int(np.argmax(over))
            if over[i] > 1e-8 * size * self.size * float(np.abs(r).max() + np.abs(on.r).max()):
                return f"between p = {self.p[i]} and {(self.p + step)[i]}, a = {self.a[i]}"
        return None

    def jacobian(self) -> str | None:
        rates = _differences(lambda p: self.law.on_graph(p, self.a).r, self.p, 1e-6 * self.size)
        stated = self.law.on_graph(self.p, self.a).jacobian
        off = np.abs(rates - stated).max(axis=(1, 2)) * self.a.min(axis=1)
        largest = 1.0 + np.abs(rates).max(axis=(1, 2)) * self.a.min(axis=1)
        wrong = (off > 1e-4 * largest) & (largest < 1e3)  # at a kink, or a jump, there is no derivative
        i = int(np.argmax(np.where(wrong, off, 0.0)))
        return None if wrong.mean() <= 0.03 else f"at p = {self.p[i]}, a = {self.a[i]}: {stated[i]}, not {rates[i]}"


class _Questions:
    """Samples of a law that is the same at all contact points, and the questions about them.

    Parameters
    ----------
    law : VectorLaw
    reach : float
        Places up to this size are tried.
    components : int
    random : Generator
    line : array (k,), optional
        Penetrations among which minimisers are looked for, of a law of these alone: fine, with all of its knots.
    """

    def __init__(
        self, law: VectorLaw, reach: float, components: int, random: np.random.Generator, line: Array | None = None
    ) -> None:
        self.law, self.reach, self.random, self.c, self.line = law, reach, random, components, line
        ends = law.penetrations
        self.r = random.uniform(-reach, reach, (_PLACES if line is None else _PROBLEMS, components))
        self.r[:, 0] = np.clip(self.r[:, 0], ends.lower, ends.upper)
        self.slope = float(np.abs(law.linearise(self.r).gradient).max()) or 1.0
        if line is None:
            softest = max(float(alpha.max()) for alpha in law.weak_convexity)
            least, stiffness, most = 0.0, max(softest, self.slope / reach), 1.5
        else:
            least = -min(float(np.min(law.asymptotic_curvature(sign)[0])) for sign in (-1.0, 1.0))
            stiffness, most = self.slope / reach, 2.0
        self.a = max(least, 0.0) + stiffness * 10.0 ** random.uniform(0.5 - most, most, (_PROBLEMS, 2))
        self.b = spread(self.a, components) * self.r[:_PROBLEMS]
        self.b += self.slope * random.uniform(-1.0, 1.0, self.b.shape)

    def minimisers(self) -> tuple[Step, ...]:
        """The questions about minimisers and pairs, which a law answers by its value alone."""
        return (
            ("local_argmin is the global minimiser", self.argmin),
            ("local_minimiser is a stationary point that is not higher", self.local_minimiser),
            ("prox_jacobian is the derivative of prox", self.jacobian),
            ("the nearest multiplier is an element", self.nearest),
            *_graph_steps(lambda: self._chart),
            ("the recession is the growth rate far away", self.recession),
        )

    @cached_property
    def _chart(self) -> _Chart:
        return _Chart.of(self.law, self.reach, self.c, len(self.r), self.random)

    def origin(self) -> str | None:
        value = float(self.law.value(np.zeros((1, self.c)))[0])
        return None if abs(value) <= 1e-12 * self.slope * self.reach else f"j(0) = {value:.6g}"

    def _inside(self, step: float) -> Array:
        """Smooth places away from the ends of the pieces."""
        sides = np.stack(np.meshgrid(*[[-1.0, 0.0, 1.0]] * self.c), axis=-1).reshape(-1, self.c)
        corners = [self.r + step * side for side in sides]
        stays = [np.abs(self.law.clamp(self.r, corner) - corner).max(axis=1) < 1e-3 * step for corner in corners]
        return np.asarray(np.all(stays, axis=0) & self.law.linearise(self.r).smooth.all(axis=1))

    def gradient(self) -> str | None:
        step = 1e-6 * self.reach
        off = np.abs(_differences(self.law.value, self.r, step) - self.law.linearise(self.r).gradient).max(axis=1)
        return self._worst(np.where(self._inside(step), off, 0.0), 1e-4 * self.slope)

    def hessian(self) -> str | None:
        step = 1e-6 * self.reach
        line = self.law.linearise(self.r)
        differences = _differences(lambda r: self.law.linearise(r).gradient, self.r, step)
        off = np.abs(differences - line.hessian).max(axis=(1, 2))
        return self._worst(np.where(self._inside(step), off, 0.0), 1e-4 * float(np.abs(line.hessian).max()) + 1e-300)

    def _worst(self, off: Array, allowed: float) -> str | None:
        i = int(np.argmax(off))
        return None if off[i] <= allowed else f"at r = {self.r[i]} it differs by {off[i]:.4g}"

    def convexity(self) -> str | None:
        alpha = spread(np.stack([np.broadcast_to(a, (_PLACES,)) for a in self.law.weak_convexity], axis=1), self.c)
        if not np.isfinite(alpha).all():
            return None

        def raised(r: Array) -> Array:
            return np.asarray(self.law.value(r) + 0.5 * (alpha * r**2).sum(axis=1))

        ends, part = self.r[::-1], self.random.uniform(0.0, 1.0, _PLACES)
        between = part[:, None] * self.r + (1.0 - part)[:, None] * ends
        above = part * raised(self.r) + (1.0 - part) * raised(ends) - raised(between)
        return self._worst(-above, 1e-9 * self.slope * self.reach)

    def _energy(self, r: Array) -> Array:
        return np.asarray((0.5 * spread(self.a, self.c) * r**2 - self.b * r).sum(axis=1) + self.law.value(r))

    def argmin(self) -> str | None:
        return self.minimises(self.law.local_argmin(self.a, self.b))

    def minimises(self, r: Array) -> str | None:
        """Whether places (_PROBLEMS, c) are minimisers: none beside them or on a grid is lower, and on the graph."""
        if np.shape(r) != self.b.shape:
            return f"it has shape {np.shape(r)} for {self.b.shape}"
        energy = self._energy(r)
        if not np.isfinite(energy).all():
            return "it is not finite"
        for _ in range(_PLACES if self.line is None else 0):
            beside = r + self.random.normal(size=r.shape) * 10.0 ** self.random.uniform(-6.0, 0.0) * self.reach
            beside[:, 0] = np.clip(beside[:, 0], self.law.penetrations.lower, self.law.penetrations.upper)
            lower = energy - self._energy(beside)
            if (lower > 1e-9 * self.slope * self.reach).any():
                return self._lower(int(np.argmax(lower)), r, beside)
        places, least = self._best
        wrong = ~(energy <= least + 1e-9 * (np.abs(least) + self.slope * self.reach))
        return self._lower(int(np.argmax(wrong)), r, places) if wrong.any() else self._off_graph(r)

    def _lower(self, i: int, r: Array, other: Array) -> str:
        return f"for a = {self.a[i]}, b = {self.b[i]} it gives r = {r[i]}, but r = {other[i]} is lower"

    @cached_property
    def _best(self) -> tuple[Array, Array]:
        """The place (_PROBLEMS, c) of least energy on a grid for every local problem, and that energy."""
        places, least = np.empty(self.b.shape), np.empty(_PROBLEMS)
        for i in range(_PROBLEMS):
            grid, energy = self._on_grid(i)
            best = int(np.argmin(energy))
            places[i], least[i] = grid[best], energy[best]
        return places, least

    def _on_grid(self, i: int) -> tuple[Array, Array]:
        """Places (k, c), and the energies of a local problem there."""
        if self.line is not None:
            a, b = self.a[i, 0], self.b[i, 0]
            return self.line[:, None], 0.5 * a * self.line**2 - b * self.line + self._on_line
        pull = float(np.linalg.norm(self.b[i, 1:]))
        heading = self.b[i, 1:] / pull  # the slip of least energy lies along the force
        far = 1.5 * np.maximum(self.reach, np.abs([self.b[i, 0], pull]) / self.a[i])
        normal, ends = np.linspace(-far[0], far[0], 2 * _GRID - 1), self.law.penetrations
        normal = normal[(normal >= ends.lower.min()) & (normal <= ends.upper.max())]
        w, s = np.meshgrid(normal, np.linspace(0.0, far[1], _GRID), indexing="ij")
        places = np.column_stack([w.ravel(), s.ravel()[:, None] * heading])
        energy = 0.5 * (self.a[i, 0] * w**2 + self.a[i, 1] * s**2).ravel() - places @ self.b[i]
        return places, energy + self.law.take(np.zeros(1, dtype=np.int64)).value(places)

    @cached_property
    def _on_line(self) -> Array:
        assert self.line is not None
        return self.law.value(self.line[:, None])

    def _off_graph(self, r: Array) -> str | None:
        """Whether places are off the graph: of scalar laws each by its own size, for their forces differ much."""
        lam = self.b - spread(self.a, self.c) * r
        off = self.law.graph_distance(r, lam, 1.0 / self.a)
        size = 1e-7 * np.abs(self.b).max() if self.line is None else 1e-6 * np.abs(self.b).max(axis=1)
        wrong = off > size + (1e-7 if self.line is None else 1e-6) * self.slope
        if not wrong.any():
            return None
        i = int(np.argmax(np.where(wrong, off, 0.0)))
        return f"for a = {self.a[i]}, b = {self.b[i]} it gives r = {r[i]}, which is {off[i]:.3g} off the graph"

    def local_minimiser(self) -> str | None:
        start = self.r[:_PROBLEMS]
        end = self.law.local_minimiser(self.a, self.b, start)
        if not (self._energy(end) <= self._energy(start) + 1e-12 * self.slope * self.reach).all():
            return "the energy rises"
        return self._off_graph(end)

    def jacobian(self) -> str | None:
        tau, x = 1.0 / self.a, self.random.uniform(-self.reach, self.reach, (_PROBLEMS, self.c))
        differences = _differences(lambda x: prox(self.law, x, tau), x, 1e-7 * self.reach)
        off = np.abs(differences - prox_jacobian(self.law, x, tau)).max(axis=(1, 2))
        most = np.abs(differences).max(axis=(1, 2))
        wrong = (off > 1e-3 * (1.0 + most)) & (most < 50.0)  # beyond, prox jumps, or is about to
        return None if wrong.mean() <= 0.05 else f"it differs by {off[wrong].max():.3g}"

    def nearest(self) -> str | None:
        lam = self.slope * self.random.uniform(-2.0, 2.0, self.r.shape)
        off = self.law.distance(self.r, self.law.nearest_multiplier(self.r, lam))
        return self._worst(off, 1e-12 * self.slope)

    def recession(self) -> str | None:
        far, exact = np.array([1e4, 1e6]) * self.reach, 1e-3 if self.line is None else 1e-2
        up, down, slip = (float(np.max(rate)) for rate in self.law.rates)
        for rate, direction in ((up, 1.0), (down, -1.0), (slip, 0.0)):
            if not direction and self.c == 1:
                continue
            turn = np.linspace(0.0, np.pi, 361) if self.c == 3 and not direction else np.zeros(1)
            ways = np.zeros((turn.size, self.c))
            ways[:, 0 if direction else 1] = direction or np.cos(turn)
            if turn.size > 1:
                ways[:, 2] = np.sin(turn)
            single = self.law.take(np.zeros(turn.size, dtype=np.int64))
            near, grown = (single.value(size * ways) / size for size in far)
            most = int(np.argmax(grown))
            if np.isfinite(rate):
                wrong = not abs(grown[most] - rate) <= exact * self.slope + 1e-3 * abs(rate)
            else:  # it grows ever faster, if it is finite
                faster = np.isinf(grown[most]) or abs(grown[most]) > 1.5 * abs(near[most])
                wrong = np.sign(grown[most]) != np.sign(rate) or not faster
            if wrong:
                return f"along {ways[most]} j grows by {grown[most]:.4g} per length, not {rate:.4g}"
        return None


class _Alone(ContactLaw):
    """A normal law alone, whatever is wrong with it."""

    def __post_init__(self) -> None:
        """Nothing is refused: the kit says what is wrong."""


class _Checker(Samples):
    """Samples of a law at its first contact point, and the questions about them."""

    def __init__(self, law: Superpotential, reach: float | None, seed: int) -> None:
        single = law.take(np.array([0])) if law.knots.shape[0] > 1 else law
        knots = single.knots[0][np.isfinite(single.knots[0])]
        size = float(reach or 3.0 * float(np.abs(knots).max(initial=0.0)) or 1.0)
        super().__init__(single, size)
        self.whole, self.random = law, np.random.default_rng(seed)
        self.questions = _Questions(_Alone(single), size, 1, self.random, self.grid)

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

    def prox(self) -> str | None:
        a, b = self.questions.a[:, 0], self.questions.b[:, 0]
        return self.questions.minimises(self.law.prox(b / a, 1.0 / a)[:, None])

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
