"""The interface of a superpotential: Clarke subdifferential, prox and constants, which follow from its pieces.

A superpotential is a scalar function j(r), smooth between *knots*.  A law supplies its knots and, on every
piece between two knots, its derivative and curvature; the Clarke subdifferential, the distance to the graph, the
proximal map and the global minimiser of the local problem (:mod:`hemivar.laws.minimisers`) are derived, exactly, for
convex and for nonmonotone laws alike.

All methods are vectorised over contact points: arguments have shape ``(m,)`` (or any shape that broadcasts
with it), parameters are numbers or arrays of shape ``(m,)``.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, fields, is_dataclass, replace
from typing import TypeVar, cast

import numpy as np

from hemivar.basics.first_use import IMPORTS, cached_property
from hemivar.basics.portable import PickleMixin
from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.errors import ProblemError
from hemivar.laws import minimisers
from hemivar.laws.compiled_law import LaidOut, lay_out
from hemivar.laws.description import LawDescription, describe
from hemivar.laws.minimisers import FAR, MANY
from hemivar.laws.proof import Constant, Proof, in_class_of, of_alpha

__all__ = ["Interval", "Superpotential", "entry", "row", "taken"]

Part = TypeVar("Part")


@dataclass(frozen=True, eq=False)
class Interval:
    """Closed intervals ``[lower, upper]``, one for each contact point; bounds may be infinite.

    Attributes
    ----------
    lower : array
        Shape (m,).
    upper : array
        Shape (m,).
    """

    lower: Array
    upper: Array

    def distance(self, x: Array) -> Array:
        """Distance of each ``x`` to its interval."""
        return np.maximum(np.maximum(self.lower - x, x - self.upper), 0.0)

    def contains(self, x: Array, tolerance: float = 0.0) -> BoolArray:
        """Whether each ``x`` lies in its interval, up to ``tolerance``."""
        return self.distance(x) <= tolerance


def entry(table: Array, index: IntArray) -> Array:
    """The entry of each row of a table (m or 1, K) that belongs to its index."""
    if index.ndim and table.shape[:-1] == (1,):
        return np.asarray(table[0].take(index))
    if index.ndim == 1 and len(table) == index.size:
        return np.asarray(table[np.arange(index.size), index])
    shape = np.broadcast_shapes(index.shape, table.shape[:-1])
    table = np.broadcast_to(table, (*shape, table.shape[-1]))
    return np.asarray(np.take_along_axis(table, np.broadcast_to(index, shape)[..., None], axis=-1)[..., 0])


class Superpotential(PickleMixin, ABC):
    """A scalar law j, one for each contact point.

    Pieces are numbered 0..K: piece ``i`` lies between knot ``i - 1`` and knot ``i`` (the first and the last one
    are unbounded, or outside the domain).  Outside ``[lower, upper]`` the value is +inf.

    On every piece the curvature j'' must be monotone (or constant); where it turns round, put a knot, which need
    not be a kink.  Then ``a r - b + j'(r)`` bends at most once on a piece, and all local minimisers are found.
    """

    #: Short name used in messages, files and tables.
    name: str = "law"

    #: Whether the library made it from a law that has been looked at, so that its shape is not looked at again.
    examined: bool = False

    @property
    def stated(self) -> Mapping[str, object] | None:
        """The law by its name and parameters, ``{"law": "survey", "q_max": 0.3}``; None if it has no such name.

        Names are those of :mod:`hemivar.laws.registry`. A table from a file has its path under ``file``; one that was
        given as numbers has its two columns under ``rows``.
        """
        return None

    def proof(self, constant: Constant) -> Proof:
        """How alpha, or the growth, is known; as the class states it by default."""
        known = in_class_of(self)
        return of_alpha(known, lambda _: self.weak_convexity) if constant == "alpha" else known

    # ---- what a law supplies -------------------------------------------------------------------------

    @property
    @abstractmethod
    def knots(self) -> Array:
        """Knots in increasing order, shape ``(m or 1, K)`` with K >= 1; unused trailing entries are +inf."""

    @property
    def domain(self) -> Interval:
        """Where j is finite; bounds of shape ``(m or 1,)``, each of them infinite or a knot; everywhere by default."""
        return Interval(np.array([-np.inf]), np.array([np.inf]))

    @abstractmethod
    def piece_value(self, piece: IntArray, r: Array) -> Array:
        """The formula of j that belongs to each ``piece``, at ``r``; j(0) = 0 where 0 is in the domain."""

    @abstractmethod
    def piece_derivative(self, piece: IntArray, r: Array) -> Array:
        """The formula of j' that belongs to each ``piece``, at ``r``."""

    @abstractmethod
    def piece_curvature(self, piece: IntArray, r: Array) -> Array:
        """The formula of j'' that belongs to each ``piece``, at ``r``."""

    def piece_line(self, piece: IntArray, r: Array) -> tuple[Array, Array]:
        """:meth:`piece_derivative` and :meth:`piece_curvature`, of laws for which both together cost less."""
        return self.piece_derivative(piece, r), self.piece_curvature(piece, r)

    @property
    @abstractmethod
    def weak_convexity(self) -> Array:
        """Smallest alpha >= 0 with j + alpha/2 r^2 convex, shape ``(m or 1,)``; inf at downward jumps.

        Where no alpha is known for every r it is that of the reach of its :meth:`proof`.
        """

    @abstractmethod
    def recession(self, sign: Array) -> Array:
        """Growth rate lim j(t s)/t, t -> inf, in each direction ``s``; may be +inf."""

    # ---- what a law may know better ------------------------------------------------------------------

    @property
    def growth(self) -> tuple[Array, Array]:
        """Constants ``(c0, c1)`` of |dj(r)| <= c0 + c1 |r|, infinite where there are none, or none are known."""
        return np.full(1, np.inf), np.zeros(1)

    def at(self, points: Array | None) -> Superpotential:
        """The law with every parameter evaluated at ``points (m, d)``; itself where all of them are numbers."""
        if points is not None and self.rows not in (1, len(points)):
            raise ProblemError(f"law '{self.name}' is made for {self.rows} contact points, but there are {len(points)}")
        return self

    def scaled(self, factor: Array | float) -> Superpotential:
        """The law ``factor * j``, with one factor >= 0 for each contact point."""
        with IMPORTS:
            from hemivar.laws.piecewise_law import scaled  # only here: what it makes is a law itself

        return scaled(self, factor)

    def take(self, index: IntArray) -> Superpotential:
        """The law at some of the contact points; by default of a dataclass, whose numbers are (m, ...) or (1, ...)."""
        return self if self.rows == 1 else _each_taken(self, index)

    @property
    def is_glue(self) -> bool:
        """Whether it is glue: :meth:`debonding` says what it has lost."""
        return False

    def debonding(self, r: Array) -> dict[str, Array]:
        """``damage`` and ``dissipated`` of glue at ``r (m,)``; see :meth:`VectorLaw.debonding`."""
        return {}

    def asymptotic_curvature(self, sign: float) -> Array:
        """lim 2 j(t s)/t^2, t -> inf, for ``s = +1`` or ``-1``, shape (m or 1,); +inf where j ends or grows faster.

        Zero unless the recession is infinite; then, unless a law knows better, measured far away.
        """
        rate = np.atleast_1d(self.recession(np.array([sign])))
        bound = self.domain
        ends = np.isfinite(bound.upper if sign > 0.0 else bound.lower)
        if np.all(np.isfinite(rate)):
            return np.where(ends, np.inf, 0.0)
        far = np.full(self.rows, sign * FAR)
        with np.errstate(all="ignore"):
            measured = 2.0 * self.value(far) / far**2
            further = self.value(10.0 * far) * 0.02 / far**2
        measured = np.where(np.isnan(measured), rate, measured)
        superlinear = np.abs(further) > 2.0 * np.abs(measured) + 1e-6
        measured = np.where(superlinear & np.isfinite(measured), np.copysign(np.inf, measured), measured)
        return np.where(ends, np.inf, np.where(np.isfinite(rate), 0.0, measured))

    def piece_formula(self, piece: int) -> str:
        """The derivative j' on a piece as text, for a law with parameters of one contact point; may be empty."""
        return ""

    # ---- many knots, alike at every point: they are searched, not gone through -----------------------------

    @property
    def rows(self) -> int:
        """Number of rows of the knots: 1 where they are the same at all points."""
        return int(self.knots.shape[0])

    @property
    def searched(self) -> int:
        """Number of knots if they are many, in a row for all points, and found by bisection; else 0."""
        knots = self.knots
        return knots.shape[-1] if knots.shape[0] == 1 and knots.shape[-1] > MANY else 0

    def place_of(self, knot: IntArray) -> Array:
        """Where one knot for each point lies, (m,)."""
        return entry(self.knots, knot)

    def slopes_at(self, knot: IntArray) -> tuple[Array, Array]:
        """Derivatives to the left and to the right of one knot for each point, (m,)."""
        left, right = self.knot_slopes()
        return entry(left, knot), entry(right, knot)

    # ---- what follows --------------------------------------------------------------------------------

    def piece_of(self, r: Array) -> IntArray:
        """Index of the piece that holds each ``r``; at a knot, the piece to its left."""
        r = np.asarray(r, dtype=float)
        if self.searched:
            return np.asarray(np.searchsorted(self.knots[0], r, side="left"), dtype=np.int64)
        return np.asarray(np.sum(r[..., None] > self.knots, axis=-1), dtype=np.int64)

    def knot_slopes(self) -> tuple[Array, Array]:
        """Derivatives to the left and to the right of each knot, ``(m or 1, K)`` each; -inf, +inf at domain ends."""
        return self._slopes

    @cached_property
    def _slopes(self) -> tuple[Array, Array]:
        return self._knot_sides()

    def _knot_sides(self) -> tuple[Array, Array]:
        """:meth:`knot_slopes`, which are kept."""
        knots = self.knots
        index = np.broadcast_to(np.arange(knots.shape[-1]), knots.shape)
        finite = np.isfinite(knots)
        at = np.where(finite, knots, 0.0)
        left = np.empty(knots.shape)
        right = np.empty(knots.shape)
        for i in range(knots.shape[-1]):
            left[..., i] = self.piece_derivative(index[..., i], at[..., i])
            right[..., i] = self.piece_derivative(index[..., i] + 1, at[..., i])
        bound = self.domain
        left = np.where(knots <= bound.lower[..., None], -np.inf, left)
        right = np.where(knots >= bound.upper[..., None], np.inf, right)
        return np.where(finite, left, 0.0), np.where(finite, right, 0.0)

    @cached_property
    def _bends(self) -> Array:
        """j'' of every piece, ``(m or 1, K + 1)``, where j' is :attr:`straight` on them."""
        knots = self.knots
        at = np.where(np.isfinite(knots), knots, 0.0)
        pieces = range(knots.shape[-1] + 1)
        curvatures = [self.piece_curvature(np.full(len(at), i, dtype=np.int64), at[:, max(i - 1, 0)]) for i in pieces]
        return np.stack(curvatures, axis=-1)

    def value(self, r: Array) -> Array:
        """j(r); +inf outside the domain."""
        r = np.asarray(r, dtype=float)
        bound = self.domain
        inside = np.clip(r, bound.lower, bound.upper)
        value = self.piece_value(self.piece_of(inside), inside)
        return np.where((r < bound.lower) | (r > bound.upper), np.inf, value)

    def at_kink(self, r: Array) -> BoolArray:
        """Whether each ``r`` sits exactly on a kink, so that j has no derivative there."""
        r = np.asarray(r, dtype=float)
        here, left, right = self._knot_at(r)
        return np.asarray(here & (left != right))

    def _knot_at(self, r: Array) -> tuple[BoolArray, Array, Array]:
        """Whether each r is a knot, and the derivatives on both sides of it, or of all knots that coincide there."""
        knot = np.minimum(self.piece_of(r), (self.searched or self.knots.shape[-1]) - 1)
        here = np.asarray((self.place_of(knot) == r) & np.isfinite(r))
        left, right = self.slopes_at(knot)
        if here.any() and not self.searched:
            last = np.maximum(np.count_nonzero(self.knots <= r[..., None], axis=-1) - 1, 0)
            right = np.where(here, self.slopes_at(last)[1], right)
        return here, left, right

    def derivative(self, r: Array) -> Array:
        """j'(r); at a kink, the one-sided derivative from the left."""
        r = np.asarray(r, dtype=float)
        return self.piece_derivative(self.piece_of(r), r)

    def curvature(self, r: Array) -> Array:
        """j''(r) of the piece that holds ``r``."""
        r = np.asarray(r, dtype=float)
        return self.piece_curvature(self.piece_of(r), r)

    def subdifferential(self, r: Array) -> Interval:
        """Clarke subdifferential dj(r), an interval for each point (empty, ``[inf, -inf]``, outside the domain)."""
        r = np.asarray(r, dtype=float)
        low = high = self.derivative(r)
        here, left, right = self._knot_at(r)
        if here.any():
            low, high = np.where(here, np.minimum(left, right), low), np.where(here, np.maximum(left, right), high)
        ends = self.domain
        outside = (r < ends.lower) | (r > ends.upper)
        return Interval(np.where(outside, np.inf, low), np.where(outside, -np.inf, high))

    def distance(self, r: Array, lam: Array) -> Array:
        """Distance of the multiplier ``lam`` to dj(r); inf outside the domain."""
        return self.subdifferential(r).distance(np.asarray(lam, dtype=float))

    def graph_distance(self, r: Array, lam: Array, tau: Array | float) -> Array:
        """How far ``(r, lam)`` is from a pair that satisfies the law exactly, in units of ``lam``.

        The smallest over r' in {r, knots} of ``hypot(r - r', tau * dist(lam, dj(r'))) / tau``, an upper bound of
        the distance to the graph of dj in the norm in which ``tau`` makes displacement and multiplier alike.  It is
        a backward error: zero exactly on the graph, and small when r misses a kink by rounding only.
        """
        return minimisers.nearest_pair(self, r, lam, tau)[1]

    # ---- the local problem ---------------------------------------------------------------------------

    def local_minimisers(self, a: Array, b: Array) -> tuple[Array, Array]:
        """All local minimisers of ``a/2 r^2 - b r + j(r)``.

        Parameters
        ----------
        a, b : arrays (m,)
            Curvature ``a >= 0`` and force of the local problem.

        Returns
        -------
        points, energies : arrays (m, 2K + 1)
            Candidates (interior of each piece, then each knot) and their energies, +inf where a candidate is not
            a local minimiser.
        """
        return minimisers.local_minimisers(self, a, b)

    def local_argmin(self, a: Array, b: Array) -> Array:
        """Global minimiser of ``a/2 r^2 - b r + j(r)``; nan where the energy has no minimum."""
        return minimisers.local_argmin(self, a, b)

    def coercive_against(self, a: Array | float) -> BoolArray:
        """Whether ``a/2 r^2 - b r + j(r)`` is bounded below for every b, given the curvature ``a >= 0`` (m,).

        With ``a = inf`` it always is; a law that answers with False at some point needs a stiffer body.
        """
        a = np.asarray(a, dtype=float)
        outward = np.minimum(self.asymptotic_curvature(1.0), self.asymptotic_curvature(-1.0))
        return np.asarray(a + outward > 0.0)

    @cached_property
    def convex(self) -> bool:
        """Whether the law is convex at all points."""
        return bool((self.weak_convexity == 0.0).all())

    @property
    def straight(self) -> bool:
        """Whether j' is straight on every piece."""
        return False

    @cached_property
    def laid_out(self) -> LaidOut | None:
        """The law as the compiled kernels read it, with resolved parameters; None where they do not know it."""
        return lay_out(self)

    def stationary_point(
        self, piece: IntArray, a: Array, b: Array, low: Array, high: Array, admissible: BoolArray
    ) -> tuple[Array, BoolArray]:
        """Zero of ``a r - b + j'(r)`` inside each piece, where it changes sign from minus to plus."""
        return minimisers.stationary_point(self, piece, a, b, low, high, admissible)

    def prox(self, x: Array, tau: Array | float) -> Array:
        """Proximal map: the global minimiser of ``j(r) + (r - x)^2/(2 tau)``."""
        x = np.asarray(x, dtype=float)
        return self.local_argmin(np.broadcast_to(1.0 / np.asarray(tau, dtype=float), x.shape), x / tau)

    def describe(self, point: int = 0) -> LawDescription:
        """Formula, kinks and constants of the law at one contact point."""
        return describe(self, point)


def row(values: Part, index: IntArray) -> Part:
    """The numbers (1, ...) or (m, ...) at some of the contact points."""
    known = cast(Array, values)
    return values if len(known) == 1 else cast(Part, known[index])


def taken(part: Part, index: IntArray) -> Part:
    """What a law consists of, at some of the contact points: laws, numbers, and what holds such."""
    if isinstance(part, Superpotential):
        return cast(Part, part.take(index)) if part.rows > 1 else part
    if isinstance(part, np.ndarray):
        return row(part, index)
    if isinstance(part, tuple):
        return cast(Part, tuple(taken(part_of_it, index) for part_of_it in part))
    return _each_taken(part, index) if is_dataclass(part) and not isinstance(part, type) else part


def _each_taken(whole: Part, index: IntArray) -> Part:
    named = ((field.name, getattr(whole, field.name)) for field in fields(whole) if field.init)  # type: ignore[arg-type]
    return replace(whole, **{name: taken(part, index) for name, part in named})  # type: ignore[type-var]
