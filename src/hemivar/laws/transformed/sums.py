"""The sum of several laws at one contact point: springs beside dashpots, glue beside contact, memory beside both."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hemivar.basics.first_use import cached_property
from hemivar.basics.types import Array, IntArray
from hemivar.errors import ProblemError
from hemivar.laws.piecewise import PiecewiseQuadratic
from hemivar.laws.stacked import StackedLaw
from hemivar.laws.superpotential import Interval, Superpotential
from hemivar.laws.transformed.exact_table import MANY, count_knots, filled, merged, pick, separated, table, table_of
from hemivar.laws.transformed.transformed_law import TransformedLaw, by_parts, check_law
from hemivar.laws.transformed.turns import steepest_fall, turns

__all__ = ["SummedLaw", "plus"]


def plus(law: Superpotential, *others: Superpotential) -> Superpotential:
    """The sum of laws at the same contact points; with resolved parameters.

    The knots are those of all terms.  Its alpha is found piece by piece: it is at most the sum of theirs, less where
    one term is convex enough where another one falls, and finite where an upward jump outweighs a downward one.

    Parameters
    ----------
    law : Superpotential
    *others : Superpotential

    Returns
    -------
    Superpotential

    Raises
    ------
    ProblemError
        There is no r that all terms allow.
    """
    for one in (law, *others):
        check_law(one)
    terms = [term for one in (law, *others) for term in (one.terms if isinstance(one, SummedLaw) else (one,))]
    stacked = next((term for term in terms if isinstance(term, StackedLaw)), None)
    if stacked is not None:
        made = by_parts(stacked, lambda part, index: plus(*(_of(one, stacked, part, index) for one in terms)))
        assert made is not None
        return made
    tables = [found for found in map(table_of, terms) if found is not None]
    smooth = [term for term in terms if table_of(term) is None]
    _check_common(terms)
    if len(tables) > 1 or (tables and smooth):
        tables = [one for one in tables if not _idle(one)] or tables[:1]
    if smooth:
        tables = [one for one in tables if not _idle(one)]
    if tables:
        rows = max(one.knots.shape[0] for one in tables)
        if rows > 1 and max(one.knots.shape[-1] for one in tables) > MANY:
            smooth, tables = [*tables, *smooth], []
        else:
            smooth = [_summed_tables(tables), *smooth]
    return smooth[0] if len(smooth) == 1 else SummedLaw(tuple(smooth))


def _of(term: Superpotential, own: StackedLaw, part: Superpotential, index: IntArray) -> Superpotential:
    if term is own:
        return part
    return term.take(index) if term.knots.shape[0] > 1 or isinstance(term, StackedLaw) else term


def _idle(law: PiecewiseQuadratic) -> bool:
    """Whether a table is zero everywhere."""
    free = np.isneginf(law.lower).all() and np.isposinf(law.upper).all()
    return bool(free and not law.slopes.any() and not law._left.any() and not law._right.any())


def _check_common(terms: Sequence[Superpotential]) -> None:
    lower, upper = _ends(terms)
    if (lower > upper).any():
        names = " and ".join(f"'{term.name}'" for term in terms)
        raise ProblemError(f"no displacement is allowed by all of the laws {names}, which are summed; leave one out")


def _ends(terms: Sequence[Superpotential]) -> tuple[Array, Array]:
    lower, upper = np.full(1, -np.inf), np.full(1, np.inf)
    for term in terms:
        lower, upper = np.maximum(lower, term.domain.lower), np.minimum(upper, term.domain.upper)
    return lower, upper


def _joined(laws: Sequence[Superpotential]) -> Array:
    """The knots of all laws that lie in the domain of the sum."""
    lower, upper = _ends(laws)
    rows = max(lower.size, upper.size, *(law.knots.shape[0] for law in laws))
    knots = np.concatenate([np.broadcast_to(law.knots, (rows, law.knots.shape[-1])) for law in laws], axis=-1)
    inside = (knots >= lower[:, None]) & (knots <= upper[:, None])
    inside[~inside.any(axis=-1)] = True  # one knot at least, even if the law ends before it
    return merged(np.where(inside, knots, np.inf))


def _name(terms: Sequence[Superpotential]) -> str:
    return " + ".join(dict.fromkeys(term.name for term in terms))


def _summed_tables(terms: Sequence[PiecewiseQuadratic]) -> PiecewiseQuadratic:
    if len(terms) == 1:
        return terms[0]
    places = separated(_joined(terms))
    knots = filled(places)
    rows, count = knots.shape
    slopes, below, above = np.zeros((rows, count + 1)), np.zeros((rows, count)), np.zeros((rows, count))
    size = np.zeros((rows, count))
    for term in terms:
        left, right = count_knots(term.knots, knots, including=False), count_knots(term.knots, knots, including=True)
        slopes[:, 0] += term.slopes[:, 0]
        slopes[:, 1:] += pick(term.slopes, right)
        before, after = _beside(term, knots, left, right)
        below += before
        above += after
        size = np.maximum(size, np.maximum(np.abs(before), np.abs(after)))
    above = np.where(np.abs(above - below) <= 4.0 * np.finfo(float).eps * size, below, above)
    lower, upper = _ends(terms)
    return table(places, slopes, below, above, (lower, upper), _name(terms))


def _beside(term: PiecewiseQuadratic, knots: Array, left: IntArray, right: IntArray) -> tuple[Array, Array]:
    """j' of a term just below and above each merged knot, where ``left`` and ``right`` of its own knots lie below."""
    own = np.minimum(left, term.knots.shape[-1] - 1)
    at = pick(term.breakpoints, np.maximum(left - 1, 0))
    slope = np.where(left == 0, pick(term._left, np.zeros_like(left)), pick(term._right, np.maximum(left - 1, 0)))
    between = slope + pick(term.slopes, left) * (knots - at)
    here = right > left
    return np.where(here, pick(term._left, own), between), np.where(here, pick(term._right, own), between)


@dataclass(frozen=True, eq=False)
class SummedLaw(TransformedLaw):
    """The sum of laws of which at least one is no table."""

    terms: tuple[Superpotential, ...]

    @property
    def name(self) -> str:  # type: ignore[override]
        """Names of the terms."""
        return _name(self.terms)

    @property
    def made_of(self) -> tuple[Superpotential, ...]:
        return self.terms

    @cached_property
    def _merged(self) -> tuple[Array, tuple[IntArray, ...]]:
        """The knots, and for every term which of its pieces each piece is a part of."""
        knots = _joined(self.terms)
        extra = turns(self.terms, knots, _pieces(self.terms, knots), Interval(*_ends(self.terms)))
        if extra is not None:
            knots = merged(np.concatenate([np.broadcast_to(knots, (len(extra), knots.shape[-1])), extra], axis=-1))
        return knots, _pieces(self.terms, knots)

    @property
    def knots(self) -> Array:
        return self._merged[0]

    @property
    def domain(self) -> Interval:
        return self._domain

    @cached_property
    def _domain(self) -> Interval:
        return Interval(*_ends(self.terms))

    @cached_property
    def _at_zero(self) -> Array:
        origin = np.clip(np.zeros(self.knots.shape[0]), *_ends(self.terms))
        return np.asarray(sum(term.value(origin) for term in self.terms))

    def piece_value(self, piece: IntArray, r: Array) -> Array:
        terms = zip(self.terms, self._merged[1], strict=True)
        total = np.asarray(sum(term.piece_value(pick(own, np.asarray(piece)), r) for term, own in terms))
        return np.asarray(total - self._at_zero)

    def piece_derivative(self, piece: IntArray, r: Array) -> Array:
        terms = zip(self.terms, self._merged[1], strict=True)
        return np.asarray(sum(term.piece_derivative(pick(own, np.asarray(piece)), r) for term, own in terms))

    def piece_curvature(self, piece: IntArray, r: Array) -> Array:
        terms = zip(self.terms, self._merged[1], strict=True)
        return np.asarray(sum(term.piece_curvature(pick(own, np.asarray(piece)), r) for term, own in terms))

    @cached_property
    def _slopes(self) -> tuple[Array, Array]:
        knots, maps = self._merged
        rows, count = knots.shape
        below, above, size = np.zeros((rows, count)), np.zeros((rows, count)), np.zeros((rows, count))
        finite = np.isfinite(knots)
        at = np.where(finite, knots, 0.0)
        for term, own in zip(self.terms, maps, strict=True):
            left, right = term.knot_slopes()
            for i in range(count):
                before, after = own[:, i], own[:, i + 1]
                here = after > before
                smooth = term.piece_derivative(before, at[:, i])
                lower = np.where(here, pick(left, np.minimum(before, left.shape[-1] - 1)), smooth)
                upper = np.where(here, pick(right, np.maximum(after - 1, 0)), smooth)
                with np.errstate(invalid="ignore"):
                    below[:, i] += lower
                    above[:, i] += upper
                size[:, i] = np.maximum(size[:, i], np.maximum(np.abs(lower), np.abs(upper)))
        with np.errstate(invalid="ignore"):
            same = np.isfinite(size) & (np.abs(above - below) <= 4.0 * np.finfo(float).eps * size)
        above = np.where(same, below, above)
        bound = self.domain
        below = np.where(knots <= bound.lower[..., None], -np.inf, below)
        above = np.where(knots >= bound.upper[..., None], np.inf, above)
        return np.where(finite, below, 0.0), np.where(finite, above, 0.0)

    def knot_slopes(self) -> tuple[Array, Array]:
        return self._slopes

    @property
    def straight(self) -> bool:
        return all(term.straight for term in self.terms)

    def piece_formula(self, piece: int) -> str:
        texts = [term.piece_formula(int(own[0, piece])) for term, own in zip(self.terms, self._merged[1], strict=True)]
        return (" + ".join(f"({text})" for text in texts if text != "0") or "0") if all(texts) else ""

    @property
    def weak_convexity(self) -> Array:
        return self._alpha

    def derivative_error(self, r: Array) -> Array:
        return np.asarray(sum(term.derivative_error(r) for term in self.terms))

    @property
    def alpha_reach(self) -> float:
        return min(term.alpha_reach for term in self.terms)

    def weak_convexity_within(self, reach: float) -> Array:
        return self._alpha_within(reach) if reach <= self.alpha_reach else np.full(1, np.inf)

    @cached_property
    def _alpha(self) -> Array:
        return self._alpha_within(self.alpha_reach or np.inf)

    def _alpha_within(self, reach: float) -> Array:
        knots, maps = self._merged
        left, right = self._slopes
        whole = self.domain
        bound = Interval(np.maximum(whole.lower, -reach), np.minimum(whole.upper, reach))
        inner = (knots > bound.lower[..., None]) & (knots < bound.upper[..., None])
        down = np.any(inner & (right < left), axis=-1)
        worst, far = np.zeros(knots.shape[0]), np.full((1, knots.shape[0]), np.inf)
        ends = np.clip(np.concatenate([-far, knots.T, far]), bound.lower, bound.upper)
        for i in range(knots.shape[-1] + 1):
            low, high = ends[i], ends[i + 1]
            worst = np.maximum(worst, steepest_fall(self.terms, [own[:, i] for own in maps], low, high))
        return np.where(down, np.inf, worst)

    @property
    def growth(self) -> tuple[Array, Array]:
        constants = [term.growth for term in self.terms]
        return np.asarray(sum(c0 for c0, _ in constants)), np.asarray(sum(c1 for _, c1 in constants))

    def recession(self, sign: Array) -> Array:
        sign = np.asarray(sign, dtype=float)
        with np.errstate(invalid="ignore"):
            total = np.asarray(sum(term.recession(sign) for term in self.terms))
            bent = np.where(sign > 0.0, self.asymptotic_curvature(1.0), self.asymptotic_curvature(-1.0))
            return np.where(np.isnan(total), np.copysign(np.inf, bent), total)

    def asymptotic_curvature(self, sign: float) -> Array:
        with np.errstate(invalid="ignore"):
            total = np.asarray(sum(term.asymptotic_curvature(sign) for term in self.terms))
        bound = self.domain
        ends = np.isfinite(bound.upper if sign > 0.0 else bound.lower)
        return np.where(ends, np.inf, np.where(np.isnan(total), np.inf, total))

    def take(self, index: IntArray) -> SummedLaw:
        return SummedLaw(tuple(term.take(index) if term.knots.shape[0] > 1 else term for term in self.terms))


def _pieces(terms: Sequence[Superpotential], knots: Array) -> tuple[IntArray, ...]:
    """Which piece of each term every piece between knots (m, K) is a part of, (m, K + 1) each."""
    rows = knots.shape[0]
    found = []
    for term in terms:
        inner = count_knots(term.knots, knots, including=True)
        inner = np.where(np.isfinite(knots), inner, term.knots.shape[-1])
        first = np.broadcast_to(count_knots(term.knots, knots[:, :1], including=False), (rows, 1))
        found.append(np.concatenate([first, np.broadcast_to(inner, knots.shape)], axis=-1))
    return tuple(found)
