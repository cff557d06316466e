"""The interface of a contact law j(r) of the displacement vector r at a point: subdifferential, prox, constants."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from hemivar.basics.arrays import ROUNDED
from hemivar.basics.portable import PickleMixin
from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.laws.crossings import Crossings, level_places
from hemivar.laws.minimisers import FAR
from hemivar.laws.proof import Constant, Proof, beside, in_class_of, of_alpha
from hemivar.laws.sides import Sides, lengths, most_resisted, polar, rest_forces, sides_of
from hemivar.laws.superpotential import Interval, taken

__all__ = [
    "Chart",
    "Linearisation",
    "OnGraph",
    "Sides",
    "VectorLaw",
    "alpha_is_one",
    "at_normal_kink",
    "curve_above_at",
    "frozen_at",
    "is_convex",
    "is_curve",
    "lengths",
    "polar",
    "prox",
    "prox_jacobian",
    "pulls",
    "snapped",
    "softens",
    "splits",
    "spread",
    "stores_slip",
    "weak_convexity_at",
]


@dataclass(frozen=True, eq=False)
class OnGraph:
    """The pairs of a law in Minty's chart ``p = a r + lam``, and how they move with p."""

    r: Array  # (m, c)
    multiplier: Array  # (m, c)
    jacobian: Array  # of r in p, (m, c, c), symmetric for a potential; of the multiplier: 1 - a times it


@dataclass(frozen=True, eq=False)
class Linearisation:
    """First and second derivative of a contact law on the pieces where it is smooth.

    Attributes
    ----------
    smooth : bool array (m, 2)
        Whether the normal and the tangential part are differentiable at r.
    gradient : array (m, c)
        Derivative of the smooth parts, zero elsewhere.
    hessian : array (m, c, c)
        Second derivative of the smooth parts, zero elsewhere.
    """

    smooth: BoolArray
    gradient: Array
    hessian: Array


@dataclass(frozen=True, eq=False)
class Chart:
    """:meth:`VectorLaw.on_graph` with one stiffness."""

    law: VectorLaw
    stiffness: Array  # a, (m, 2)

    def at(self, p: Array, near: Array | None = None) -> OnGraph:
        """The pair at ``p (m, c)``.

        With ``near (m, c)``, the displacement in p, it may be that of the tangent to the graph there: the same pair
        where ``near`` is on the graph, and else one that costs less.
        """
        return self.law.on_graph(p, self.stiffness)

    def graph_distance(self, r: Array, lam: Array, tau: Array) -> Array:
        """As :meth:`VectorLaw.graph_distance`, (m, 1) or of each component; ``tau (m, c)``."""
        pair = tau[:, [0, min(1, tau.shape[1] - 1)]]
        return self.law.frozen(r, lam).graph_distance(r, lam, pair)[:, None]

    def bounded(self, part: float) -> Chart | None:
        """The chart with a part of a bound that depends on the state; None where there is none."""
        return None

    def least_multiplier(self, r: Array) -> Array:
        """The element (m, c) of the subdifferential at r (m, c), in the domain, that is nearest to zero."""
        zero = np.zeros_like(r)
        return self.law.frozen(r, zero).nearest_multiplier(r, zero)


class VectorLaw(PickleMixin, ABC):
    """A law j(r) at every contact point; what solvers and certificates ask of it.

    Local displacements ``r`` have shape ``(m, c)``: column 0 is the penetration r_nu, the others, if there are any, the
    slip r_tau.  Multipliers have the same shape: force per area of the body on the foundation, which is the pressure
    (column 0) and minus the friction.  Numbers for the normal and the tangential part, such as a compliance, have shape
    ``(m, 2)``; where c = 1 the second one is not looked at.
    """

    name: str

    @property
    def tangential_name(self) -> str:
        """Name of what resists slip, used in messages."""
        return self.name

    @property
    def stated(self) -> Mapping[str, object] | None:
        """The law by its name and parameters, as problem files state it; None if it has no such name."""
        return None

    @property
    def not_separable(self) -> str:
        """Why it is no normal law with radial friction, in words; empty of a :class:`~hemivar.laws.ContactLaw`."""
        return f"law '{self.name}' couples opening and slip"

    def at(self, points: Array | None) -> VectorLaw:
        """The law with every parameter evaluated at ``points (m, d)``; itself where all of them are numbers."""
        return self

    def in_frames(self, frames: Array) -> VectorLaw:
        """The law where ``frames (m, c, d)`` are the unit vectors of local components: directions are turned into them.

        Raises
        ------
        ProblemError
            A direction of the law is none of the surface.
        """
        return self

    def take(self, index: IntArray) -> VectorLaw:
        """The law at some of the contact points; by default of a dataclass, whose numbers are (m, ...) or (1, ...)."""
        return taken(self, index)

    # ---- in time ----------------------------------------------------------------------------------------

    @property
    def follows_slip(self) -> bool:
        """Whether it is a law of the place: its slip counts from the beginning of a march, not of a step."""
        return True

    def in_increments(self, rate: float) -> VectorLaw:
        """The law of a step: what is a law of the slip rate as one of the slip increment, ``rate`` times which is the
        rate; a law of the place is itself."""
        return self

    def at_rest(self) -> VectorLaw:
        """The law of a body that does not slip, whose friction is as strong as it is at the rate 0."""
        return self

    def stored_energy(self, r: Array) -> Array:
        """Energy (m,) that the law stores at ``r (m, c)`` in time: all of :meth:`value` but that of friction."""
        return self.value(r)

    @property
    def remembers(self) -> bool:
        """Whether it is glue, which in time remembers the largest opening unless it is asked not to."""
        return False

    # ---- at a displacement ------------------------------------------------------------------------------

    def pressures(self, r: Array) -> Interval:
        """Pressures of the law at ``r (m, c)``, cut at the ends of its domain."""
        far = np.zeros(r.shape)
        far[:, 0] = np.inf
        return Interval(*(self.nearest_multiplier(r, push)[:, 0] for push in (-far, far)))

    def is_function(self, components: int) -> bool:
        """Whether there is one multiplier at each displacement, which changes continuously, as far as is known."""
        return False

    # ---- whether it depends on the state ----------------------------------------------------------------

    @property
    def state_dependent(self) -> bool:
        """Whether the friction bound, or the whole law, depends on the state, so that J(w, v) has two arguments."""
        return False

    @property
    def depends_on_whole_state(self) -> bool:
        """Whether all tractions depend on the state, as on the mode of glue, and not the friction bound alone.

        :attr:`lipschitz` is then the constant of the tractions in the whole local displacement.
        """
        return False

    def frozen(self, r: Array, lam: Array) -> VectorLaw:
        """The ordinary law J(w, .) that holds in a state w; the law itself if it does not depend on the state.

        Parameters
        ----------
        r, lam : arrays (m, c)
            Local displacement and multiplier of the state; penetration and pressure are their first columns.
        """
        return self

    @property
    def lipschitz(self) -> Array:
        """Lipschitz constant of the friction bound in the penetration, shape (m or 1,); 0 if it has none.

        See ``depends_on_whole_state``.
        """
        return np.zeros(1)

    @property
    def steering(self) -> Array:
        """Lipschitz constant of the tractions in the state, (m or 1,); inf where they may jump.

        Of friction in the penetration: that of the bound times the steepest profile.
        """
        return self.lipschitz

    @abstractmethod
    def value(self, r: Array) -> Array:
        """j(r), shape (m,); +inf outside the domain."""

    def distance(self, r: Array, lam: Array) -> Array:
        """Distance of the multiplier to the Clarke subdifferential dj(r), shape (m,)."""
        off, ends = lengths(lam - self.nearest_multiplier(r, lam)), self.penetrations
        return np.where((r[:, 0] < ends.lower) | (r[:, 0] > ends.upper), np.inf, off)

    def kinks(self, r: Array) -> tuple[Array, Array]:
        """The penetration (m,) and the slip (m, c - 1) next to ``r (m, c)`` at which the law may have a kink."""
        knots = np.broadcast_to(self.penetration_knots, (len(r), self.penetration_knots.shape[1]))
        nearest = np.argmin(np.abs(r[:, :1] - knots), axis=1)[:, None]
        return np.take_along_axis(knots, nearest, axis=1)[:, 0], np.zeros(r[:, 1:].shape)

    def _offers(self, r: Array, lam: Array, tau: Array) -> tuple[Array, Array]:
        """``r`` itself, and with the penetration, the slip and both at their kinks, (k, m, c); how well a pair fits."""
        places, gaps = [r], [np.zeros(len(r))]
        normal, slip = self.kinks(r)
        for k, kink in enumerate((normal[:, None], slip)):
            there, part = np.isfinite(kink), slice(k, None if k else 1)
            for r_near, gap in list(zip(places, gaps, strict=True)) if there.any() else ():
                places.append(r_near.copy())
                places[-1][:, part] = np.where(there, kink, r_near[:, part])
                gaps.append(np.hypot(gap, lengths(r[:, part] - places[-1][:, part]) / tau[:, k]))
        off = [np.hypot(gap, self.distance(r_there, lam)) for gap, r_there in zip(gaps, places, strict=True)]
        return np.stack(places), np.stack(off)

    def graph_distance(self, r: Array, lam: Array, tau: Array) -> Array:
        """Distance of ``(r, lam)`` to an exact pair of the law, in units of ``lam``; see the scalar law.

        Parameters
        ----------
        r, lam : arrays (m, c)
        tau : array (m, 2)
            Compliance (length per force per area) that weighs displacement against multiplier, for the normal and
            the tangential part.
        """
        return np.asarray(frozen_at(self, r)._offers(r, lam, tau)[1].min(axis=0))

    def crossings(self, r: Array, direction: Array) -> Crossings | None:
        """Where the law bends along ``r + t direction``, ``(m, c)`` each; None where it is not quadratic in between."""
        return None

    def kinks_along(self, start: Array, end: Array, bend: Array) -> Array:
        """Where the law may bend on ways ``start + t (end - start) - t (1 - t) bend``, ``(m, c)`` each.

        Returns
        -------
        array, shape (m, K)
            t; nan, or beyond 0 to 1, where it does not. A law may leave out the bend of a way, and kinks: integrals
            that are bounded between these places hold nonetheless, and are less sharp.
        """
        return level_places(self.penetration_knots, start[:, 0], end[:, 0], bend[:, 0])

    @abstractmethod
    def nearest_multiplier(self, r: Array, lam: Array) -> Array:
        """The element of dj(r) nearest to ``lam``, (m, c); outside its domain r counts as at the end of it."""

    @abstractmethod
    def local_argmin(self, a: Array, b: Array) -> Array:
        """Minimiser of ``a_n/2 r_n^2 + a_t/2 |r_t|^2 - b.r + j(r)``; ``a (m, 2)``, ``b (m, c)`` -> ``(m, c)``."""

    @abstractmethod
    def linearise(self, r: Array) -> Linearisation:
        """Derivatives of the parts that are smooth at ``r``."""

    def clamp(self, start: Array, end: Array) -> Array:
        """``end (m, c)``, cut back to the smooth pieces on which ``start (m, c)`` lies; by default between kinks."""
        out, knots, r = self.admissible(end), self.penetration_knots, start[:, :1]
        low = np.where(knots < r, knots, -np.inf).max(axis=1, initial=-np.inf)
        out[:, 0] = np.clip(out[:, 0], low, np.where(knots > r, knots, np.inf).min(axis=1, initial=np.inf))
        slip = self.kinks(start)[1]
        back = np.einsum("mi,mi->m", start[:, 1:] - slip, end[:, 1:] - slip) <= 0.0  # and where there is none: nan
        out[back, 1:] = slip[back]
        return out

    def admissible(self, r: Array) -> Array:
        """The local displacement nearest to ``r (m, c)`` in the domain of the laws."""
        out, ends = np.array(r, dtype=float), self.penetrations
        out[:, 0] = np.clip(out[:, 0], ends.lower, ends.upper)
        return out

    @abstractmethod
    def recession(self, direction: Array) -> Array:
        """Growth rate of j along each ``direction (m, c)``, shape (m,); may be +inf.

        Friction whose bound depends on the state counts nothing: it may vanish.
        """

    @property
    def rates(self) -> tuple[Array, Array, Array]:
        """Growth rates far away, (m or 1,) each: with the penetration, with the opening, with the length of the slip.

        The rate along a direction is at most what these give; friction whose bound depends on the state counts 0.
        """
        up, down, slip = (self.recession(np.array([direction])) for direction in ([1.0, 0.0], [-1.0, 0.0], [0.0, 1.0]))
        return up, down, slip

    def rubbed(self, slips: Array, size: float = np.inf) -> Array:
        """Slips ``(m, c - 1, a)`` of some motions, scaled: their length is the work of friction under a unit pressure.

        It is the friction that a pressure is sure to bring with it far away, or, where a ``size`` is given, the most of
        it on ways of that length from rest.
        """
        return np.zeros_like(slips)

    def strongest(self, rest: Array, size: float) -> tuple[Array, Array, Array]:
        """The most that the law resists on ways of length ``size`` from ``rest (m, c)``, (m,)."""
        return most_resisted(self, rest, size)

    def asymptotic_curvature(self, sign: float) -> tuple[Array, Array]:
        """Curvature far away in the direction of one sign, of the normal and of the tangential part, (m or 1,)."""
        far = [sign * FAR * np.eye(2)[k : k + 1] for k in range(2)]
        with np.errstate(all="ignore"):
            normal, tangential = (
                np.where(np.isfinite(self.recession(at / FAR)), 0.0, 2.0 * self.value(at) / FAR**2) for at in far
            )
        return normal, tangential

    @property
    @abstractmethod
    def weak_convexity(self) -> tuple[Array, Array]:
        """alpha of the normal and of the tangential part, each of shape (m or 1,): with ``alpha_n/2 r_n^2 +
        alpha_t/2 |r_t|^2`` added, j is convex."""

    def proof(self, constant: Constant) -> Proof:
        """How alpha of both parts, growth or :attr:`VectorLaw.lipschitz` is known; by default as the class states."""
        known = in_class_of(self)
        return of_alpha(beside(known, known), lambda part: self.weak_convexity[part]) if constant == "alpha" else known

    @property
    def growth(self) -> tuple[tuple[Array, Array], tuple[Array, Array]]:
        """c0 and c1 of the normal and of the tangential part, (m or 1,) each; inf where none are known.

        The multiplier is at most ``c0 + c1 |r_n|`` along the normal, and ``c0 + c1 |r_t|`` across it.
        """
        unknown = (np.full(1, np.inf), np.zeros(1))
        return unknown, unknown

    @property
    def follows_state(self) -> bool:
        """Whether Newton's equation can contain how a bound depends on the state."""
        return False

    @property
    def penetrations(self) -> Interval:
        """The penetrations that the law allows."""
        return Interval(np.full(1, -np.inf), np.full(1, np.inf))

    @property
    def penetration_knots(self) -> Array:
        """Penetrations without slip at which the law changes, increasing, (m or 1, K); unused entries are +inf."""
        return np.zeros((1, 1))

    @property
    def rubs(self) -> BoolArray:
        """Whether something may resist slip, bool (m or 1,)."""
        return np.ones(1, dtype=bool)

    # ---- where a pair lies ------------------------------------------------------------------------------

    def local_minimiser(self, a: Array, b: Array, r: Array) -> Array:
        """The local minimiser of the problem of :meth:`local_argmin` that is reached from ``r (m, c)`` downhill.

        By steps that are held back so much that each has one minimiser.
        """
        alphas = np.stack([np.broadcast_to(alpha, (len(r),)) for alpha in self.weak_convexity], axis=1)
        more = np.where(a > alphas, 0.0, 2.0 * alphas - a)
        for _ in range(400):
            last, r = r, self.local_argmin(a + more, b + spread(more, r.shape[1]) * r)
            if (np.abs(r - last) <= ROUNDED * np.abs(r)).all() or not more.any():
                break
        return r

    def fitted(self, r: Array, lam: Array, tau: Array) -> Array:
        """Where the law fits a pair best, (m, c): ``r`` itself or, part by part, a knot; as :meth:`graph_distance`."""
        places, off = frozen_at(self, r)._offers(r, lam, tau)
        return np.asarray(places[np.argmin(off, axis=0), np.arange(len(r))])

    def sides(self, r: Array, lam: Array, active: BoolArray, tau: Array, slack: float) -> list[Sides]:
        """The directions of all points in which the law has two sides, or bends, at ``r (m, c)``.

        Parameters
        ----------
        r, lam : arrays (m, c)
            A pair, ``r`` as :meth:`fitted` puts it.
        active : bool array (m, c)
            Components that can move.
        tau : array (m, 2)
        slack : float
            What is nothing, of a multiplier.
        """
        return sides_of(frozen_at(self, r), r, lam, active, tau, slack)

    def moves(self, r: Array, small: float) -> BoolArray:
        """Which points count as moving sideways, (m,): those with a slip above ``small``."""
        return np.asarray(np.linalg.norm(r[:, 1:], axis=1) > small)

    def past_peak(self, r: Array, pull: Array | None = None, near: float = 0.0, slack: float = 0.0) -> BoolArray:
        """Whether the law has let go of some of its ``pull (m,)``; see :func:`~hemivar.laws.scalar_graph.past_peak`.

        Unless a law knows better, where it is open and pulls less the more it opens.
        """
        return np.asarray((r[:, 0] < 0.0) & (self.linearise(r).hessian[:, 0, 0] < 0.0))

    def debonding(self, r: Array) -> dict[str, Array]:
        """What glue has lost at ``r (m, c)``, (m,) each; nan where there is no glue, empty if there is none.

        ``damage`` is the share of the initial stiffness that is lost, 0 intact and 1 broken; ``dissipated`` the energy
        per area that unloading along the secant would not give back; ``mode_ratio`` the share of the slip in the square
        of the effective opening, of laws that couple.
        """
        return {}

    def resistance(self, r: Array, lam: Array) -> Array:
        """The most that resists a slip at a pair (m, c) that does not slip, (m or 1,); 0 where it is free."""
        slip = lam[:, 1:]
        return rest_forces(self, r, slip, np.ones(slip.shape, dtype=bool))[1] if slip.size else np.zeros(1)

    def on_graph(self, p: Array, a: Array) -> OnGraph:
        """The pair of the law at ``p = a r + lam``, for every point (Minty's chart of the graph).

        Where a is larger than :attr:`weak_convexity`, part by part, there is one such pair, and it is Lipschitz in p:
        ``r`` with the constant ``1/(a - alpha)``.  Where a is not, it is the pair of least energy.

        Parameters
        ----------
        p : array (m, c)
            Force per area.
        a : array (m, 2)
            Stiffness (force per area and length) for the normal and the tangential part.
        """
        each = spread(a, p.shape[1])
        r = self.local_argmin(a, p)
        line = self.linearise(r)
        free = np.repeat(line.smooth, [1, p.shape[1] - 1], axis=1)
        stiff = line.hessian + np.where(free, each, 1.0)[:, :, None] * np.eye(p.shape[1])
        jacobian = np.where(free[:, :, None] & free[:, None, :], np.linalg.inv(stiff), 0.0)
        return OnGraph(r, p - each * r, jacobian)

    @property
    def curve_above(self) -> tuple[Array, Array]:
        """Stiffness for the normal and the tangential part, above which :meth:`on_graph` has one answer, (m,) or (1,).

        It is :attr:`weak_convexity`, of the penetration alone where the friction bound depends on the state. For laws
        of the whole state it is the larger one and their Lipschitz constant.
        """
        normal, tangential = self.weak_convexity
        if not self.depends_on_whole_state:
            return normal, tangential
        both = np.maximum(normal, tangential) + self.lipschitz
        return both, both

    def chart(self, a: Array, components: int) -> Chart | None:
        """:meth:`on_graph` with one stiffness, for many questions; None where it tells nothing.

        So it is where the law is no curve (:func:`is_curve`), or a bound that depends on the state has no derivative.
        """
        known = self.follows_state or not self.state_dependent
        return Chart(self, a) if known and is_curve(self, a, components) else None


def splits(law: VectorLaw) -> bool:
    """Whether it is a :class:`~hemivar.laws.ContactLaw`: j is a part of the penetration plus a part of the slip."""
    return not law.not_separable


def stores_slip(law: VectorLaw) -> bool:
    """Whether what a law does on a slip is stored, and not dissipated."""
    return law.follows_slip and (law.depends_on_whole_state or not law.state_dependent)


def pulls(law: VectorLaw, r: Array) -> BoolArray:
    """Whether a law can pull at ``r (m, c)``, cut at the ends of its domain."""
    return np.asarray(law.pressures(r).lower < 0.0)


def is_convex(law: VectorLaw) -> bool:
    """Whether a law is convex at all points, and that is proved."""
    return not softens(law) and law.proof("alpha").sure


def softens(law: VectorLaw) -> bool:
    """Whether some part of a law is not convex, whatever a bound that depends on the state may be."""
    return any(bool((alpha > 0.0).any()) for alpha in law.weak_convexity)


def alpha_is_one(law: VectorLaw) -> bool:
    """Whether alpha is the same in all states: friction whose bound depends on the state has no finite one else."""
    if not law.state_dependent or law.depends_on_whole_state:
        return not law.state_dependent
    return bool(np.isfinite(law.weak_convexity[1]).all())


def frozen_at(law: VectorLaw, r: Array) -> VectorLaw:
    """A law as :meth:`VectorLaw.frozen` at ``r (m, c)`` and its pressure there: the one nearest to zero."""
    if not law.state_dependent:
        return law
    lam, ends = np.zeros(r.shape), law.pressures(r)
    lam[:, 0] = np.clip(0.0, ends.lower, ends.upper)
    return law.frozen(r, lam)


def at_normal_kink(law: VectorLaw, r: Array) -> BoolArray:
    """Whether the penetration of ``r (m, c)`` sits on a kink of a law, (m,)."""
    return ~frozen_at(law, r).linearise(r).smooth[:, 0]


def snapped(law: VectorLaw, r: Array, near: float) -> Array:
    """``r (m, c)`` with the parts that miss a kink of a law by no more than ``near`` put on it."""
    out, law = r.copy(), frozen_at(law, r)
    normal, slip = law.kinks(r)
    out[:, 0] = np.where(np.abs(r[:, 0] - normal) <= near, normal, r[:, 0])
    out[:, 0] = np.where(at_normal_kink(law, out), out[:, 0], r[:, 0])
    if r.shape[1] > 1:
        out[:, 1:] = np.where((lengths(r[:, 1:] - slip) <= near)[:, None], slip, r[:, 1:])
    return out


def is_curve(law: VectorLaw, a: Array, components: int) -> bool:
    """Whether :meth:`VectorLaw.on_graph` has one answer: ``a (m, 2)`` is :attr:`VectorLaw.curve_above`."""
    least = law.curve_above[: min(components, 2)]
    return all(bool((a[:, k] > bound).all()) for k, bound in enumerate(least))


def prox(law: VectorLaw, x: Array, tau: Array) -> Array:
    """Proximal map of a law with step ``tau (m, 2)`` for the normal and the tangential part."""
    return law.local_argmin(1.0 / tau, x / spread(tau, x.shape[1]))


def weak_convexity_at(law: VectorLaw, r: Array) -> tuple[Array, Array]:
    """alpha of both parts of a law, frozen at the pressure of the normal law."""
    return (law if alpha_is_one(law) else frozen_at(law, r)).weak_convexity


def curve_above_at(law: VectorLaw, r: Array, lam: Array) -> tuple[Array, Array]:
    """:attr:`VectorLaw.curve_above` with a friction bound as it is in a state ``(m, c)``."""
    return (law if law.depends_on_whole_state else law.frozen(r, lam)).curve_above


def prox_jacobian(law: VectorLaw, x: Array, tau: Array) -> Array:
    """Generalised derivative of the prox of a law, one ``(c, c)`` block for each point."""
    each = 1.0 / spread(tau, x.shape[1])
    return law.on_graph(each * x, 1.0 / tau).jacobian * each[:, None, :]


def spread(tau: Array, c: int) -> Array:
    """(m, 2) normal and tangential numbers as (m, c)."""
    return np.concatenate([tau[:, :1], np.repeat(tau[:, 1:2], c - 1, axis=1)], axis=1)
