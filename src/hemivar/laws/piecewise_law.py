"""Laws made of pieces of other laws: multiplied, moved, one beside another, summed, and joined at places."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from hemivar.basics.arrays import real_array
from hemivar.basics.deadline import check_time
from hemivar.basics.first_use import cached_property
from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.errors import ProblemError
from hemivar.laws.parameters import common_rows
from hemivar.laws.proof import Constant, Proof, worst
from hemivar.laws.superpotential import Interval, Superpotential, row
from hemivar.laws.turns import falls_between, steepest_fall

__all__ = [
    "PiecewiseLaw",
    "Seams",
    "Term",
    "count_knots",
    "gathered_debonding",
    "moved",
    "moved_ends",
    "pick",
    "scaled",
    "separated",
    "stack",
    "stacked",
    "taken_apart",
]

#: The kind of number that columns hold.
Entry = TypeVar("Entry", bound=np.generic)


@dataclass(frozen=True, eq=False)
class Term:
    """What one law adds to the derivative of another one: ``weight j'(theta r + shift)``.

    Numbers are columns ``(m or 1, 1 or K + 1)``, the same on all pieces or not; theta is ``(m or 1, 1)``, above 0.
    """

    law: Superpotential
    piece: IntArray | None = None  # of it on each piece, (m or 1, K + 1), -1 where it does not act; None: the same
    weight: Array = field(default_factory=lambda: np.ones((1, 1)))
    theta: Array = field(default_factory=lambda: np.ones((1, 1)))
    shift: Array = field(default_factory=lambda: np.zeros((1, 1)))
    rows: IntArray | None = None  # contact points at which it acts, alone; None: at all

    @cached_property
    def everywhere(self) -> bool:
        """Whether it acts on every piece."""
        return self.piece is None or bool((self.piece >= 0).all())

    @cached_property
    def moves(self) -> bool:
        """Whether its argument is another one."""
        return bool((self.theta != 1.0).any() or self.shift.any())

    @cached_property
    def weighs(self) -> bool:
        """Whether its weight is another one than 1."""
        return bool((self.weight != 1.0).any())

    @property
    def plain(self) -> bool:
        """Whether it is the law itself, on all pieces."""
        return self.everywhere and not self.moves and not self.weighs

    def own(self, piece: IntArray) -> IntArray:
        """Its own pieces; some piece where it does not act."""
        if self.rows is not None:
            return np.minimum(piece, self.law.knots.shape[-1])
        own = piece if self.piece is None else pick(self.piece, piece)
        return own if self.everywhere else np.maximum(own, 0)

    def argument(self, piece: IntArray, r: Array) -> Array:
        return np.asarray(self.theta[:, 0] * r + _chosen(self.shift, piece)) if self.moves else r

    def acting(self, piece: IntArray, values: Array, power: int) -> Array:
        """Values of the law times ``weight theta^power`` where it acts, else zero."""
        if self.moves and power:
            values = values * self.theta[:, 0] if power > 0 else values / self.theta[:, 0]
        values = _times(_chosen(self.weight, piece), values) if self.weighs else values
        return values if self.everywhere else np.where(pick(cast(IntArray, self.piece), piece) >= 0, values, 0.0)

    def ask(self, question: str, power: int, piece: IntArray, r: Array) -> Array:
        """What ``piece_value``, ``piece_derivative`` or ``piece_curvature`` says of its pieces."""
        return self.acting(piece, getattr(self.law, question)(self.own(piece), self.argument(piece, r)), power)

    def line(self, piece: IntArray, r: Array) -> tuple[Array, Array]:
        slope, bend = self.law.piece_line(self.own(piece), self.argument(piece, r))
        return self.acting(piece, slope, 0), self.acting(piece, bend, 1)

    def back(self, r: Array) -> Array:
        """Where a law that moves has places of this one, (m or 1, K) or of one for each point (m,)."""
        shift, theta = (x if r.ndim > 1 else x[:, 0] for x in (self.shift, self.theta))
        return np.asarray((r - shift) / theta) if self.moves else r

    @property
    def knots(self) -> Array:
        """The knots of the law, where they come to lie."""
        knots = self.back(self.law.knots)
        return knots if self.law.searched or not self.moves else separated(knots)

    @property
    def ends(self) -> Interval:
        """The domain of the law, likewise."""
        if self.moves and not self.law.searched:
            return moved_ends(self.law, self.knots)
        return Interval(self.back(self.law.domain.lower), self.back(self.law.domain.upper))

    def side(self, slopes: Array) -> Array:
        """Derivatives at knots, (m or 1, K) or (m,); infinite at the ends of the domain whatever the weight is."""
        if not self.weighs:
            return slopes
        with np.errstate(invalid="ignore"):
            return np.where(np.isinf(slopes), slopes, (self.weight if slopes.ndim > 1 else self.weight[:, 0]) * slopes)

    # ---- constants ---------------------------------------------------------------------------------------

    def reach(self, limit: float) -> float:
        """Up to which displacements the argument is within a limit."""
        return (
            limit
            if np.isinf(limit)
            else max(float(((limit - np.abs(self.shift)) / self.theta).min(initial=np.inf)), 0.0)
        )

    def alpha_within(self, piece: IntArray, reach: float) -> Array:
        farthest = float((self.theta * reach + np.abs(self.shift)).max(initial=0.0))
        return self.acting(piece, self.law.proof("alpha").value(farthest)[0], 1)

    @property
    def growth(self) -> tuple[Array, Array]:
        """c0 and c1 on the pieces, columns."""
        c0, c1 = (constant[:, None] for constant in self.law.growth)
        with np.errstate(invalid="ignore"):
            c0 = np.where(np.isfinite(c1), c0 + c1 * np.abs(self.shift), np.inf) if self.moves else c0
        weight = self.weight if self.piece is None else np.where(self.piece >= 0, self.weight, 0.0)
        return _times(weight, c0), _times(weight, c1 * self.theta)

    def falls(self, i: int, low: Array, high: Array) -> Array:
        """A bound of what -j'' gains by it on part of piece i, where ``low < high``."""
        if self.law.convex:
            return np.zeros(low.shape)
        piece = np.full(low.shape, i, dtype=np.int64)
        ends = (self.argument(piece, end) for end in (low, high))
        return self.acting(piece, falls_between(self.law, self.own(piece), *ends), 1)

    def formula(self, piece: int) -> str | None:
        """j' on a piece as text, empty if it is not known; None if it does not act."""
        own = piece if self.piece is None else int(self.piece[0, piece])
        if own < 0:
            return None
        text, numbers = self.law.piece_formula(own), (self.theta, self.shift, self.weight)
        theta, shift, weight = (float(x[0, min(piece, x.shape[1] - 1)]) for x in numbers)
        if text and self.moves:
            text = f"({text}) at {'' if theta == 1.0 else f'{theta:.6g} '}r{f' {shift:+.6g}' if shift else ''}"
        return text if weight == 1.0 or not text else f"{weight:.6g} ({text})"


@dataclass(frozen=True, eq=False)
class Seams:
    """Where the terms of a law are joined, if its pieces are not those of its terms."""

    places: Array  # knots (m, K), +inf where unused
    below: Array  # j' below and above the knots, inside the domain
    above: Array
    ends: Interval  # the domain
    springs: Array | None = None  # stiffness beside the terms on each piece, (m, K + 1)
    cuts: Array = field(default_factory=lambda: np.zeros((1, 0)))  # where other terms begin to act


@dataclass(frozen=True, eq=False)
class PiecewiseLaw(Superpotential):
    """A law whose derivative on every piece is the sum of its terms.

    Without seams it is one law, multiplied and moved, or several at contact points of their own.  Many knots are not
    copied for each point: they are searched where that law has them.
    """

    terms: tuple[Term, ...]
    name: str = "law"
    seams: Seams | None = None

    @property
    def parts(self) -> tuple[tuple[Superpotential, IntArray], ...]:
        """Laws at contact points of their own, and these; empty if there is but one law."""
        return tuple((term.law, term.rows) for term in self.terms if term.rows is not None)

    @cached_property
    def apart(self) -> bool:
        """Whether its laws act at contact points of their own."""
        return self.terms[0].rows is not None

    @cached_property
    def single(self) -> Term | None:
        """Its term, if it is one law multiplied and moved."""
        return None if self.seams is not None or self.apart else self.terms[0]

    @property
    def plain(self) -> bool:
        """Whether it is a sum: every law acts everywhere, at r itself."""
        return self.seams is not None and self.seams.springs is None and all(term.plain for term in self.terms)

    def _sum(self, ask: Callable[..., Array], *given: Array | IntArray) -> Array:
        """The sum of what all terms say, or what each says of its contact points."""
        if not self.apart:
            values = [ask(term, *given) for term in self.terms]
            return values[0] if len(values) == 1 else np.asarray(sum(values))
        whole = [np.broadcast_to(np.asarray(x), (self.rows,)) for x in given]
        out = np.empty(self.rows)
        for term in self.terms:
            out[term.rows] = ask(term, *(x[term.rows] for x in whole))
        return out

    def _columns(self, of: Callable[[Term], Array], fill: float) -> Array:
        """The sum of columns of all terms, or those of each at its contact points, as a table."""
        tables = [of(term) for term in self.terms]
        if not self.apart:
            whole = tables[0] if len(tables) == 1 else np.asarray(sum(tables))
            return np.broadcast_to(whole, (self.rows, whole.shape[-1]))
        out = np.full((self.rows, max(table.shape[-1] for table in tables)), fill)
        for term, table in zip(self.terms, tables, strict=True):
            out[term.rows, : table.shape[-1]] = table
        return out

    # ---- where the knots lie -----------------------------------------------------------------------------

    @cached_property
    def rows(self) -> int:  # type: ignore[override]
        """Number of contact points, 1 if all are alike."""
        if self.seams is not None:
            return len(self.seams.places)
        if self.apart:
            return sum(index.size for _, index in self.parts)
        term = self.terms[0]
        sizes = (len(part) for part in (term.weight, term.theta, term.shift))
        return common_rows(f"law '{self.name}'", term.law.rows, *sizes)

    @property
    def searched(self) -> int:
        return super().searched if self.single is None else self.single.law.searched

    def place_of(self, knot: IntArray) -> Array:
        term = self.single
        return super().place_of(knot) if term is None or not self.searched else term.back(term.law.place_of(knot))

    def slopes_at(self, knot: IntArray) -> tuple[Array, Array]:
        if (term := self.single) is None:
            return super().slopes_at(knot)
        left, right = term.law.slopes_at(knot)
        return term.side(left), term.side(right)

    def piece_of(self, r: Array) -> IntArray:
        term = self.single
        if term is None or not self.searched:
            return super().piece_of(r)
        r = np.asarray(r, dtype=float)
        near = term.law.piece_of(term.argument(np.zeros(1, dtype=np.int64), r))
        if term.moves:  # the knot is where it is said to be, whatever rounding makes of its argument
            near = near + ((near < self.searched) & (self.place_of(np.minimum(near, self.searched - 1)) < r))
            near = near - ((near > 0) & (self.place_of(np.maximum(near - 1, 0)) >= r))
        return near

    @cached_property
    def knots(self) -> Array:  # type: ignore[override]
        """Where its pieces end, see there."""
        return self._columns(lambda term: term.knots, np.inf) if self.seams is None else self.seams.places

    @cached_property
    def domain(self) -> Interval:  # type: ignore[override]
        """Where j is finite, see there."""
        if self.seams is not None:
            return self.seams.ends
        return Interval(self._sum(lambda term: term.ends.lower), self._sum(lambda term: term.ends.upper))

    def _knot_sides(self) -> tuple[Array, Array]:
        if self.seams is None:
            left = self._columns(lambda term: term.side(term.law.knot_slopes()[0]), 0.0)
            return left, self._columns(lambda term: term.side(term.law.knot_slopes()[1]), 0.0)
        places, ends, finite = self.seams.places, self.seams.ends, np.isfinite(self.seams.places)
        below = np.where(places <= ends.lower[..., None], -np.inf, self.seams.below)
        above = np.where(places >= ends.upper[..., None], np.inf, self.seams.above)
        return np.where(finite, below, 0.0), np.where(finite, above, 0.0)

    # ---- on the pieces -----------------------------------------------------------------------------------

    def _asked(self, question: str, power: int, piece: IntArray, r: Array) -> Array:
        if self.single is not None:
            return self.single.ask(question, power, piece, r)
        check_time()  # its laws may be sums of others, many deep
        piece, r = np.asarray(piece), np.asarray(r)
        return self._sprung(
            self._sum(lambda term, on, at: term.ask(question, power, on, at), piece, r), power, piece, r
        )

    def _sprung(self, values: Array, power: int, piece: IntArray, r: Array) -> Array:
        if self.seams is None or self.seams.springs is None:
            return values
        along = (0.5 * np.square(r), r, np.ones(1))[power + 1]
        return np.asarray(values + pick(self.seams.springs, piece) * along)

    @cached_property
    def _level(self) -> Array:
        """What is added to the value on each piece (m, 1 or K + 1), so that j is continuous, and zero at zero."""
        origin = np.clip(np.zeros(self.rows), self.domain.lower, self.domain.upper)
        piece = self.piece_of(origin)
        level: Array = np.zeros((self.rows, 1))
        if self.seams is not None and self.seams.cuts.size:
            level = self._steps(self.seams)
        return np.asarray(level - (self._asked("piece_value", -1, piece, origin) + _chosen(level, piece))[:, None])

    def _steps(self, seams: Seams) -> Array:
        """What makes the value continuous at the cuts, on each piece (m, K + 1)."""
        totals, last = [np.zeros(self.rows)], np.full(self.rows, -np.inf)
        for cut in np.broadcast_to(seams.cuts, (self.rows, seams.cuts.shape[-1])).T:
            joined = np.isfinite(cut) & (cut > last)
            at, last = np.where(joined, cut, 0.0), cut
            left, right = (
                self._asked("piece_value", -1, count_knots(seams.places, at[:, None], including=side)[:, 0], at)
                for side in (False, True)
            )
            totals.append(totals[-1] + np.where(joined, left - right, 0.0))
        start = np.concatenate([np.full((self.rows, 1), -np.inf), seams.places], axis=-1)
        return pick(np.stack(totals, axis=-1), np.sum(start[:, :, None] >= seams.cuts[:, None, :], axis=-1))

    def piece_value(self, piece: IntArray, r: Array) -> Array:
        value = self._asked("piece_value", -1, piece, r)
        if self.seams is None and not self.terms[0].moves:
            return value
        return np.asarray(value + _chosen(self._level, np.asarray(piece)))

    def piece_derivative(self, piece: IntArray, r: Array) -> Array:
        return self._asked("piece_derivative", 0, piece, r)

    def piece_curvature(self, piece: IntArray, r: Array) -> Array:
        return self._asked("piece_curvature", 1, piece, r)

    def piece_line(self, piece: IntArray, r: Array) -> tuple[Array, Array]:
        if self.apart:
            return super().piece_line(piece, r)
        lines = [term.line(piece, r) for term in self.terms]
        if self.seams is None:
            return lines[0]
        slope, bend = (np.asarray(sum(parts)) for parts in zip(*lines, strict=True))
        return self._sprung(slope, 0, piece, r), self._sprung(bend, 1, piece, r)

    @property
    def straight(self) -> bool:
        return all(term.law.straight for term in self.terms)

    def local_argmin(self, a: Array, b: Array) -> Array:
        if not self.apart:
            return super().local_argmin(a, b)
        return self._sum(lambda term, a, b: term.law.local_argmin(a, b), a, b)

    def piece_formula(self, piece: int) -> str:
        known = [text for term in self.terms if (text := term.formula(piece)) is not None]
        if not all(known):
            return ""
        if self.seams is not None and self.seams.springs is not None and self.seams.springs[0, piece]:
            known.append(f"{float(self.seams.springs[0, piece]):.6g} r")
        if len(known) == 1:
            return known[0]
        return " + ".join(f"({text})" for text in known if text != "0") or "0"

    def debonding(self, r: Array) -> dict[str, Array]:
        if not self.apart:
            return {}
        r = np.broadcast_to(np.asarray(r, dtype=float), (self.rows,))
        return gathered_debonding([law.debonding(r[i]) for law, i in self.parts], [i for _, i in self.parts])

    # ---- constants ---------------------------------------------------------------------------------------

    def proof(self, constant: Constant) -> Proof:
        proofs = [term.law.proof(constant) for term in self.terms]
        reach = min(term.reach(known.reach[0]) for term, known in zip(self.terms, proofs, strict=True))
        return replace(worst(proofs), reach=(reach,), values=(self._alpha_within,) if constant == "alpha" else ())

    @cached_property
    def weak_convexity(self) -> Array:  # type: ignore[override]
        """alpha, see there."""
        if self.seams is not None:
            return self._alpha_up_to(self.seams, self.proof("alpha").reach[0] or np.inf)
        return self._far(1.0, lambda law: law.weak_convexity, 1)

    def _alpha_within(self, reach: float) -> Array:
        if reach == np.inf:
            return self.weak_convexity
        if self.seams is None:
            return self._sum(lambda term, last: term.alpha_within(last, reach), np.zeros(self.rows, dtype=np.int64))
        return self._alpha_up_to(self.seams, reach) if reach <= self.proof("alpha").reach[0] else np.full(1, np.inf)

    def _alpha_up_to(self, seams: Seams, reach: float) -> Array:
        knots, (left, right) = seams.places, self._slopes
        bound = Interval(np.maximum(seams.ends.lower, -reach), np.minimum(seams.ends.upper, reach))
        inner = (knots > bound.lower[..., None]) & (knots < bound.upper[..., None])
        down = np.any(inner & (right < left), axis=-1)
        steepest, far = np.zeros(len(knots)), np.full((1, len(knots)), np.inf)
        ends = np.clip(np.concatenate([-far, knots.T, far]), bound.lower, bound.upper)
        for i in range(knots.shape[-1] + 1):
            low, high = ends[i], ends[i + 1]
            if self.plain:
                pieces = [np.full(len(knots), i) if term.piece is None else term.piece[:, i] for term in self.terms]
                fall = steepest_fall([term.law for term in self.terms], pieces, low, high)
            else:
                fall = np.where(low < high, sum(term.falls(i, low, high) for term in self.terms), 0.0)
            steepest = np.maximum(steepest, fall)
        return np.where(down, np.inf, steepest)

    @property
    def growth(self) -> tuple[Array, Array]:
        """The largest constants of all pieces."""
        ended = np.isfinite(self.domain.lower) | np.isfinite(self.domain.upper)
        c0, c1 = self._columns(lambda term: term.growth[0], 0.0), self._columns(lambda term: term.growth[1], 0.0)
        return np.where(ended, np.inf, c0.max(axis=-1)), np.where(ended, np.inf, c1.max(axis=-1))

    def _far(self, sign: float, ask: Callable[[Superpotential], Array], power: int) -> Array:
        """The sum of what the laws say that act on the last piece in a direction, (m or 1,)."""
        last = np.zeros(self.rows, dtype=np.int64)
        if self.seams is not None and sign > 0.0:
            last = np.isfinite(self.seams.places).sum(axis=-1)
        with np.errstate(invalid="ignore"):
            return self._sum(lambda term, piece: term.acting(piece, ask(term.law), power) + np.zeros(piece.shape), last)

    def recession(self, sign: Array) -> Array:
        sign = np.asarray(sign, dtype=float)
        with np.errstate(invalid="ignore"):
            return np.where(sign == 0.0, 0.0, np.abs(sign) * np.where(sign > 0.0, self._rate(1.0), self._rate(-1.0)))

    def _rate(self, sign: float) -> Array:
        rate = self._far(sign, lambda law: law.recession(np.array([sign])), 0)
        if np.isnan(rate).any():
            rate = np.where(np.isnan(rate), np.copysign(np.inf, self.asymptotic_curvature(sign)), rate)
        return rate

    def asymptotic_curvature(self, sign: float) -> Array:
        total = self._far(sign, lambda law: law.asymptotic_curvature(sign), 1)
        ended = np.isfinite(self.domain.upper if sign > 0.0 else self.domain.lower)
        return np.where(ended | np.isnan(total), np.inf, total)

    # ---- other points, other laws ------------------------------------------------------------------------

    def at(self, points: Array | None) -> Superpotential:
        term = self.single
        return super().at(points) if term is None else replace(self, terms=(replace(term, law=term.law.at(points)),))

    def take(self, index: IntArray) -> Superpotential:
        if not self.apart:
            return super().take(index)
        chosen = taken_apart([own for _, own in self.parts], index)
        made = [(self.parts[k][0].take(own), here) for k, own, here in chosen]
        return made[0][0] if len(made) == 1 else stacked(made, self.name)


# ---- how they are made -----------------------------------------------------------------------------------


def scaled(law: Superpotential, factor: Array | float) -> Superpotential:
    """The law ``factor * j``; see :meth:`Superpotential.scaled`."""
    factor = np.atleast_1d(real_array(factor, f"the factor of law '{law.name}'", finite=False))
    if not np.all(factor >= 0.0):
        raise ProblemError(f"law '{law.name}' is scaled by {factor.min():g}; a factor must be at least 0")
    if isinstance(law, PiecewiseLaw) and law.apart:
        return stacked([(part.scaled(row(factor, index)), index) for part, index in law.parts], law.name)
    term = _term_of(law)
    return PiecewiseLaw((replace(term, weight=term.weight * factor[:, None]),), law.name)


def moved(law: Superpotential, theta: Array, c: Array) -> PiecewiseLaw:
    """The law ``j(theta r + c)/theta``, numbers (m,) or (1,); see :func:`~hemivar.laws.affine`."""
    term, theta, c = _term_of(law), theta[:, None], c[:, None]
    return PiecewiseLaw((replace(term, theta=term.theta * theta, shift=term.theta * c + term.shift),), law.name)


def _term_of(law: Superpotential) -> Term:
    term = law.single if isinstance(law, PiecewiseLaw) else None
    return Term(law) if term is None else term


def stacked(laws: Sequence[tuple[Superpotential, IntArray]], name: str) -> PiecewiseLaw:
    """Laws at contact points of their own, which together are 0..m-1 once."""
    return PiecewiseLaw(tuple(Term(law, rows=index) for law, index in laws), name)


def stack(laws: Sequence[tuple[Superpotential, int]]) -> Superpotential:
    """One law from laws for consecutive blocks of contact points, given as ``(law, number of points)``."""
    laws = [(law, count) for law, count in laws if count > 0]
    if len(laws) == 1:
        return laws[0][0]
    ends = np.cumsum([count for _, count in laws])
    points = [(law, np.arange(end - count, end)) for end, (law, count) in zip(ends, laws, strict=True)]
    return stacked(points, " + ".join(dict.fromkeys(law.name for law, _ in laws)))


def taken_apart(parts: Sequence[IntArray], index: IntArray) -> list[tuple[int, IntArray, IntArray]]:
    """Of points in parts some: the number of each part left, which of its points, and the numbers these then have."""
    where, owner = np.empty((2, sum(own.size for own in parts)), dtype=np.int64)
    for k, own in enumerate(parts):
        owner[own], where[own] = k, np.arange(own.size)
    index = np.atleast_1d(np.asarray(index, dtype=np.int64))
    chosen = [(k, np.flatnonzero(owner[index] == k)) for k in range(len(parts))]
    return [(k, where[index[here]], here) for k, here in chosen if here.size]


def gathered_debonding(parts: Sequence[dict[str, Array]], indices: Sequence[IntArray]) -> dict[str, Array]:
    """What the parts of a law say of their contact points, as one; nan where a part says nothing of it."""
    count = sum(index.size for index in indices)
    out = {name: np.full(count, np.nan) for part in parts for name in part}
    for part, index in zip(parts, indices, strict=True):
        for name, values in part.items():
            out[name][index] = values
    return out


# ---- columns ---------------------------------------------------------------------------------------------


def pick(columns: NDArray[Entry], index: IntArray) -> NDArray[Entry]:
    """``columns (m or 1, K)`` at one index for each place (n,), or at several for each row (m, n)."""
    if len(columns) == 1:
        return cast("NDArray[Entry]", columns[0].take(index))
    rows = np.arange(len(columns))
    if index.ndim == 2:
        return columns[rows[:, None], index]
    return columns[rows, index]  # of one index for each row, or for all


def _chosen(columns: Array, piece: IntArray) -> Array:
    """Columns on pieces, or the one that is the same on all."""
    return columns[:, 0] if columns.shape[1] == 1 else pick(columns, piece)


def _times(factor: Array, values: Array) -> Array:
    """The product, where 0 times infinity is 0."""
    if factor.all():
        return np.asarray(factor * values)
    with np.errstate(invalid="ignore"):
        return np.where(factor != 0.0, factor * values, 0.0)


def count_knots(knots: Array, places: Array, *, including: bool) -> IntArray:
    """How many knots (m or 1, K) lie below each place (m, n); with ``including``, or at it."""
    if knots.shape[0] == 1:
        passed = np.searchsorted(knots[0], places, side="right" if including else "left")
        return np.asarray(passed, dtype=np.int64)
    rows = np.broadcast_shapes(knots.shape[:1], places.shape[:1])
    count = np.zeros((*rows, places.shape[-1]), dtype=np.int64)
    for k in range(knots.shape[-1]):
        column = knots[:, k : k + 1]
        count += (column <= places) if including else (column < places)
    return count


def separated(knots: Array) -> Array:
    """Knots that rounding has made equal, moved apart as little as can be."""
    apart: BoolArray = (knots[:, 1:] > knots[:, :-1]) | np.isinf(knots[:, 1:])
    if apart.all():
        return knots
    knots = knots.copy()
    for i in range(1, knots.shape[-1]):
        knots[:, i] = np.maximum(knots[:, i], np.nextafter(knots[:, i - 1], np.inf))
    return knots


def moved_ends(law: Superpotential, places: Array) -> Interval:
    """The domain of a law whose knots have come to other places (m, K): its ends are the same knots."""
    knots, ends = law.knots, law.domain
    lower = np.where(knots == ends.lower[:, None], places, -np.inf).max(axis=-1)
    return Interval(lower, np.where(knots == ends.upper[:, None], places, np.inf).min(axis=-1))
