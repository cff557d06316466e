"""The sum of several laws at one contact point: springs beside dashpots, glue beside contact, memory beside both."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from hemivar.basics.types import Array, IntArray
from hemivar.errors import ProblemError
from hemivar.laws.piecewise import PiecewiseQuadratic
from hemivar.laws.stacked import StackedLaw
from hemivar.laws.superpotential import Interval, Superpotential
from hemivar.laws.transformed.exact_table import MANY, count_knots, merged, table_of
from hemivar.laws.transformed.law_graph import LawGraph, Term, beside, law_graph
from hemivar.laws.transformed.transformed_law import by_parts, check_law
from hemivar.laws.transformed.turns import turns

__all__ = ["plus"]


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
    terms = [term for one in (law, *others) for term in _terms(one)]
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
            smooth = [_summed(tables), *smooth]
    return _summed(smooth)


def _terms(law: Superpotential) -> tuple[Superpotential, ...]:
    return law.made_of if isinstance(law, LawGraph) and law.plain else (law,)


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


def _summed(terms: Sequence[Superpotential]) -> Superpotential:
    if len(terms) == 1:
        return terms[0]
    ends = Interval(*_ends(terms))
    knots = _joined(terms)
    extra = turns(terms, knots, _pieces(terms, knots), ends)
    if extra is not None:
        knots = merged(np.concatenate([np.broadcast_to(knots, (len(extra), knots.shape[-1])), extra], axis=-1))
    origin = np.clip(np.zeros(len(knots)), ends.lower, ends.upper)[:, None]
    parts = [Term(term, piece, origin) for term, piece in zip(terms, _pieces(terms, knots), strict=True)]
    at, (below, above, size) = np.where(np.isfinite(knots), knots, 0.0), np.zeros((3, *knots.shape))
    for part in parts:
        before, after = beside(part.law, at, part.piece[:, :-1], part.piece[:, 1:])
        with np.errstate(invalid="ignore"):
            below, above = below + before, above + after
        size = np.maximum(size, np.maximum(np.abs(before), np.abs(after)))
    with np.errstate(invalid="ignore"):
        same = np.isfinite(size) & (np.abs(above - below) <= 4.0 * np.finfo(float).eps * size)
    sides = below, np.where(same, below, above)
    return law_graph(knots, parts, sides, ends, " + ".join(dict.fromkeys(one.name for one in terms)))


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
