"""Loads that vary, at the points of a rule on small parts of cells or facets, and how far they may be from that.

A load that is made of formulas is near to polynomials of degree 2 on every part, with a proved bound of the difference
(:mod:`hemivar.formula.expansion`); parts are cut until what is unknown of the load is a small part of it, or of what it
does inside of cells. A function of Python is known at the points alone.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hemivar.basics.arrays import CACHED, SAME
from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.fem.elements import shape_values
from hemivar.fem.quadrature import quadrature_rule
from hemivar.formula import Formula, FormulaArray
from hemivar.formula.expansion import Expansion
from hemivar.mechanics.conditions import DataField
from hemivar.mechanics.instants import Instant
from hemivar.mesh.keys import EDGES

__all__ = ["LoadValues", "load_values"]

#: What may be unknown of a load, over its size, and over what it does inside of cells times their size in the body.
_KNOWN, _INSIDE = 5e-5, 0.02
#: Parts that are expanded beyond the simplices themselves, at most.
_MOST = 1 << 15
#: Parts at a time.
_CHUNK = CACHED // 32
#: Part of the unknown that a round of cutting may leave as it is.
_LEFT = 0.1
_FUNCTION = "is a function of Python, which is evaluated at points only; a formula would be bounded"
_UNBOUNDED = "has no known bound near some points, and is evaluated at points only"
#: Degree of the rules, by the dimension of the simplex: a polynomial of degree 4 is exact, weights are positive.
_DEGREE = {1: 5, 2: 4, 3: 5}


@dataclass(frozen=True, eq=False)
class LoadValues:
    """A load on k parts of n simplices of dimension p."""

    #: The simplex of each part.
    owner: IntArray  # (k,)
    #: The piece of a cell, cut at its centroid, in which the part lies; 0 on facets.
    piece: IntArray  # (k,)
    #: Of the parts, in barycentric coordinates of their simplices.
    corners: Array  # (k, p + 1, p + 1)
    #: Of the parts.
    measures: Array  # (k,)
    #: At the points of ``rule``.
    values: Array  # (k, q, d)
    #: By how much the load may differ from the polynomial through the values.
    off: Array  # (k,)
    #: Why nothing is known between the points, in words that follow the name of the load; ``off`` is 0 then. Empty
    #: where there is a bound.
    doubt: str

    @property
    def rule(self) -> tuple[Array, Array]:
        """Barycentric points (q, p + 1) in a part, and weights (q,)."""
        return _rule(self.corners.shape[1] - 1)

    def parts(self) -> list[slice]:
        """Portions of the parts that are looked at together."""
        return [slice(start, start + _CHUNK) for start in range(0, len(self.owner), _CHUNK)]

    def points(self, part: slice) -> Array:
        """Barycentric coordinates (k, q, p + 1), in their simplices, of the points of some parts."""
        return np.asarray(np.einsum("qa,kab->kqb", self.rule[0], self.corners[part]))

    def moments(self, count: int, order: int) -> Array:
        """Integrals (n, l, d) against the shape functions of n simplices."""
        moments = None
        for part in self.parts():
            shapes = shape_values(order, self.points(part))
            weights = self.measures[part, None] * self.rule[1]
            own = np.einsum("kq,kql,kqd->kld", weights, shapes, self.values[part], optimize=True)
            moments = np.zeros((count, *own.shape[1:])) if moments is None else moments
            np.add.at(moments, self.owner[part], own)
        assert moments is not None
        return moments

    def unknown(self, count: int) -> Array:
        """By how much the integrals against the barycentric coordinates may be off, shape (n, p + 1)."""
        unknown = np.zeros((count, self.corners.shape[2]))
        np.add.at(unknown, self.owner, (self.off * self.measures)[:, None] * self.corners.mean(axis=1))
        return unknown

    def linear(self, measures: Array) -> Array:
        """Bounds (n,) of the size in L2 of the linear part of what is unknown, for simplices of these measures."""
        p = self.corners.shape[2] - 1
        moments = (self.unknown(len(measures)) ** 2).sum(axis=1)
        return np.asarray(np.sqrt(np.minimum((p + 1) * (p + 2) / measures * moments, self.square(len(measures)))))

    def square(self, count: int) -> Array:
        """Bounds (n,) of the square in L2 of what is unknown."""
        return np.asarray(np.bincount(self.owner, self.off**2 * self.measures, minlength=count), dtype=float)


def load_values(value: object, corners: Array, measures: Array, what: str, normals: Array | None = None) -> LoadValues:
    """A load that varies, on simplices.

    ``corners`` is (n, p + 1, d); ``measures`` is (n,); ``normals`` is (n, d).
    """
    entries, time = _entries(value)
    doubt = _FUNCTION
    if entries is not None:
        known = _known(entries, time, corners, measures, normals)
        if known is not None:
            return known
        doubt = _UNBOUNDED
    cells = corners.shape[1] > corners.shape[2]
    n, p, dim = len(corners), corners.shape[1] - 1, corners.shape[2]
    pieces = [_piece(p, i) for i in range(p + 1)] if cells else [np.eye(p + 1)]
    owner, piece = np.tile(np.arange(n), len(pieces)), np.repeat(np.arange(len(pieces)), n)
    at = np.concatenate([np.broadcast_to(own, (n, p + 1, p + 1)) for own in pieces])
    places = np.einsum("qa,kab,kbd->kqd", _rule(p)[0], at, corners[owner], optimize=True)
    flat = places.reshape(-1, dim)
    if normals is None:
        values = DataField(value, what, dim).at(flat).reshape(places.shape)
    else:
        values = -DataField(value, what).at(flat).reshape(places.shape[:2])[:, :, None] * normals[owner, None]
    return LoadValues(owner, piece, at, measures[owner] / len(pieces), values, np.zeros(len(owner)), doubt)


def _entries(value: object) -> tuple[tuple[float | Formula, ...] | None, float | None]:
    """The formulas of a load, and the time; None for a function of Python."""
    given, time = (value.value, value.time) if isinstance(value, Instant) else (value, None)
    if isinstance(given, Formula):
        return (given,), time
    return (tuple(given.entries) if isinstance(given, FormulaArray) else None), time


def _rule(p: int) -> tuple[Array, Array]:
    return quadrature_rule(p, _DEGREE[p])


def _piece(p: int, i: int) -> Array:
    """Barycentric coordinates of the corners of piece i of a simplex, which the centroid cuts."""
    own = np.eye(p + 1)
    own[i] = 1.0 / (p + 1)
    return own


@dataclass(frozen=True, eq=False)
class _Parts:
    """Parts with polynomials of degree 2 on each: c of them, for the components of the load."""

    owner: IntArray
    piece: IntArray
    corners: Array
    measures: Array
    value: Array
    slope: Array
    bend: Array
    off: Array

    def take(self, chosen: BoolArray) -> _Parts:
        return _Parts(*(getattr(self, name)[chosen] for name in self.__dataclass_fields__))

    def joined(self, other: _Parts) -> _Parts:
        names = self.__dataclass_fields__
        return _Parts(*(np.concatenate([getattr(self, name), getattr(other, name)]) for name in names))

    def at(self, barycentric: Array) -> Array:
        """Values (k, q, c) at points (q, p + 1) of the parts."""
        every = range(self.value.shape[1])
        parts = (Expansion(self.value[:, c], self.slope[:, c], self.bend[:, c], self.off) for c in every)
        return np.stack([part.at(barycentric) for part in parts], axis=2)


def _known(
    entries: tuple[float | Formula, ...], time: float | None, corners: Array, measures: Array, normals: Array | None
) -> LoadValues | None:
    """Formulas, expanded on parts that are small enough; None where no bound of them is found."""
    n, p = len(corners), corners.shape[1] - 1
    cells = p == corners.shape[2]
    diameter = float(np.linalg.norm(np.ptp(corners, axis=(0, 1))))
    inside = _INSIDE * (measures.mean() ** (1.0 / p) / diameter)

    def expanded(owner: IntArray, piece: IntArray, at: Array) -> _Parts:
        parts = []
        for start in range(0, len(owner), _CHUNK):
            part = slice(start, start + _CHUNK)
            parts.append(_expanded(entries, time, np.einsum("kab,kbd->kad", at[part], corners[owner[part]])))
        value, slope, bend, off = (np.concatenate(one) for one in zip(*parts, strict=True))
        share = np.abs(np.linalg.det(at))
        return _Parts(owner, piece, at, share * measures[owner], value, slope, bend, off)

    whole = -1 if cells else 0
    parts = expanded(np.arange(n), np.full(n, whole), np.broadcast_to(np.eye(p + 1), (n, p + 1, p + 1)))
    spent = 0
    for _ in range(60):  # halved more often, corners of a part are one in double precision
        chosen = _worst(parts, measures, inside, (_MOST - spent) // (p + 1))
        if not chosen.any():
            break
        fresh = expanded(*_cut(parts.take(chosen), corners))
        parts, spent = parts.take(~chosen).joined(fresh), spent + len(fresh.owner)
    return _at_points(parts, normals) if np.isfinite(parts.off).all() else None


def _expanded(
    entries: tuple[float | Formula, ...], time: float | None, corners: Array
) -> tuple[Array, Array, Array, Array]:
    """Value (k, c), slope (k, c, p), bend (k, c, p, p) and off (k,) of all components on simplices."""
    k, p = len(corners), corners.shape[1] - 1
    value, slope, bend = np.zeros((k, len(entries))), np.zeros((k, len(entries), p)), np.zeros((k, len(entries), p, p))
    square = np.zeros(k)
    for c, entry in enumerate(entries):
        if not isinstance(entry, Formula):
            value[:, c] = entry
            continue
        polynomial = entry.expansion(corners, time)
        value[:, c], slope[:, c], bend[:, c] = polynomial.value, polynomial.slope, polynomial.bend
        square += polynomial.off**2
    return value, slope, bend, np.sqrt(square)


def _worst(parts: _Parts, measures: Array, inside: float, most: int) -> BoolArray:
    """The parts that are to be cut: those of which nothing is known, else the fewest that hold most of the unknown."""
    chosen = np.zeros(len(parts.off), dtype=bool)
    if not (known := np.isfinite(parts.off)).all():
        chosen[np.flatnonzero(~known)[: max(most, 0)]] = True
        return chosen
    count = len(measures)

    def mean(values: Array) -> Array:
        """Of simplices, at their parts."""
        return np.asarray((np.bincount(parts.owner, parts.measures * values, minlength=count) / measures)[parts.owner])

    share = parts.measures * parts.off * mean(parts.off)
    size = float(parts.measures @ (parts.value**2).sum(axis=1))
    if share.sum() <= max(_KNOWN**2 * size, inside**2 * _variance(parts, [mean(part) for part in parts.value.T])):
        return chosen
    order = np.argsort(-share, kind="stable")
    left = share.sum() - np.cumsum(share[order])
    chosen[order[: max(min(int(np.argmax(left <= _LEFT * share.sum())) + 1, most), 0)]] = True
    return chosen


def _variance(parts: _Parts, means: list[Array]) -> float:
    """``int |f - mean f|^2`` of the linear parts, the means those of the simplices."""
    p = parts.slope.shape[2]
    apart = sum((part - mean) ** 2 for part, mean in zip(parts.value.T, means, strict=True))
    slopes = (parts.slope**2).sum(axis=(1, 2)) - (parts.slope.sum(axis=2) ** 2).sum(axis=1) / (p + 1)
    return float(parts.measures @ (apart + slopes / ((p + 1) * (p + 2))))


def _cut(parts: _Parts, corners: Array) -> tuple[IntArray, IntArray, Array]:
    """Owners, pieces and corners of halves: whole cells are cut at their centroids, others across a longest edge."""
    p = parts.corners.shape[1] - 1
    whole = parts.piece < 0
    owner, piece, at = [], [], []
    for i in range(p + 1) if whole.any() else ():
        owner.append(parts.owner[whole])
        piece.append(np.full(len(owner[-1]), i))
        at.append(np.broadcast_to(_piece(p, i), (len(owner[-1]), p + 1, p + 1)))
    rest = parts.corners[~whole]
    places = np.einsum("kab,kbd->kad", rest, corners[parts.owner[~whole]])
    pairs = np.array(EDGES[p] if p > 1 else ((0, 1),))
    length = np.linalg.norm(places[:, pairs[:, 0]] - places[:, pairs[:, 1]], axis=2)
    ends = pairs[np.argmax(length >= (1.0 - SAME) * length.max(axis=1, keepdims=True), axis=1)]
    every = np.arange(len(rest))
    middle = 0.5 * (rest[every, ends[:, 0]] + rest[every, ends[:, 1]])
    for end in ends.T:
        half = rest.copy()
        half[every, end] = middle
        owner.append(parts.owner[~whole])
        piece.append(parts.piece[~whole])
        at.append(half)
    return np.concatenate(owner), np.concatenate(piece), np.concatenate(at)


def _at_points(parts: _Parts, normals: Array | None) -> LoadValues:
    """Values at the points of the rule, on cells that were not cut on their pieces."""
    p = parts.corners.shape[1] - 1
    point, _ = _rule(p)
    whole = parts.piece < 0
    cut = parts.take(~whole)
    pieces = [(cut.owner, cut.piece, cut.corners, cut.measures, cut.at(point), cut.off)]
    rest = parts.take(whole)
    for i in range(p + 1) if whole.any() else ():
        own = _piece(p, i)
        at = np.broadcast_to(own, rest.corners.shape)
        values = rest.at(point @ own)
        pieces.append((rest.owner, np.full(len(at), i), at, rest.measures / (p + 1), values, rest.off))
    owner, piece, at, measures, values, off = (np.concatenate(one) for one in zip(*pieces, strict=True))
    if normals is not None:
        values = -values * normals[owner][:, None]
    return LoadValues(owner, piece, at, measures, values, off, "")
