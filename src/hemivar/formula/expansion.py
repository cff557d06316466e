"""Taylor models of expressions on simplices: quadratic polynomials with a proved remainder, rounding included.

Value, first and second derivatives go through the graph together, each as an interval over the whole simplex. With the
point ``x = x_c + E xi``, ``xi`` the barycentric coordinates of all vertices but the first less those of the centroid,
Taylor's formula at the centroid gives

    |f - (f_c + g_c xi + 1/2 xi' H xi)| <= 1/2 sum rad(H_ij) max|xi_i xi_j|,     H the middle of the interval.

At a kink of ``abs``, ``min`` or ``max`` there are bounds of the first derivatives only, where a derivative is infinite
bounds of the value only: the best of the three is taken.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from hemivar.basics.types import Array
from hemivar.formula.graph import Graph
from hemivar.formula.intervals import ENCLOSED, Pair, mended, power

__all__ = ["Expansion", "expansion"]

#: What every variable is on simplices: its values at their corners, shape (k, p + 1), or one number.
_Places = Mapping[str, "Array | float"]


@dataclass(frozen=True, eq=False)
class Expansion:
    """Polynomials of degree 2 on k simplices with p + 1 corners."""

    value: Array  # (k,): at the centroid
    slope: Array  # (k, p): by the barycentric coordinates of all corners but the first
    bend: Array  # (k, p, p): second derivatives by these
    off: Array  # (k,): by how much the expression may differ on the simplex

    def at(self, barycentric: Array) -> Array:
        """Values (k, q) at points (q, p + 1) of the simplices."""
        xi = barycentric[:, 1:] - 1.0 / barycentric.shape[1]
        squares = 0.5 * np.einsum("qi,qj->qij", xi, xi)
        return np.asarray(self.value[:, None] + self.slope @ xi.T + np.einsum("kij,qij->kq", self.bend, squares))


@dataclass(frozen=True, eq=False)
class _Jet:
    """Intervals of a value (k,), of its first derivatives (p, k) and of its second ones (s, k); None is zero."""

    value: Pair
    slope: Pair | None = None
    bend: Pair | None = None


def expansion(graph: Graph, node: int, places: _Places) -> Expansion:
    """Polynomials near to an expression.

    Shapes: ``places`` (k, p + 1).
    """
    shape = next(value.shape for value in places.values() if isinstance(value, np.ndarray))
    count, p = shape[0], shape[1] - 1
    with np.errstate(all="ignore"):
        jet = _through(graph, node, {name: _variable(value, count, True) for name, value in places.items()}, p)
        middle = _through(graph, node, {name: _variable(value, count, False) for name, value in places.items()}, p)
        return _best(jet, middle, count, p)


def _variable(value: Array | float, count: int, whole: bool) -> _Jet:
    """A variable over the simplices, or at their centroids."""
    if not isinstance(value, np.ndarray):
        return _Jet((np.full(count, value), np.full(count, value)))
    slope = (value[:, 1:] - value[:, :1]).T
    ends = (value.min(axis=1), value.max(axis=1)) if whole else (value.mean(axis=1),) * 2
    return _Jet(mended(*ends), mended(slope, slope))


def _best(jet: _Jet, middle: _Jet, count: int, p: int) -> Expansion:
    """The polynomial of the degree that is nearest."""
    far = p / (p + 1.0)  # the largest |xi_i|
    low, high = jet.value
    slope = _filled(jet.slope, p, count)
    bend = _filled(jet.bend, p * (p + 1) // 2, count)
    at, first = middle.value, _filled(middle.slope, p, count)
    pairs = list(zip(*np.triu_indices(p), strict=True))
    most = np.array([0.5 * far * far if i == j else far / (p + 1.0) for i, j in pairs])

    offs = [_radius(low, high)]
    offs.append(_radius(*at) + far * _radius(*slope).sum(axis=0))
    offs.append(_radius(*at) + far * _radius(*first).sum(axis=0) + most @ _radius(*bend))
    off = np.array([np.where(np.isnan(width), np.inf, width) for width in offs])
    degree = np.argmin(off, axis=0)
    value = np.where(degree == 0, _middle(low, high), _middle(*at))
    slopes = np.where(degree == 0, 0.0, np.where(degree == 1, _middle(*slope), _middle(*first)))
    bends = np.zeros((count, p, p))
    for (i, j), part in zip(pairs, np.where(degree == 2, _middle(*bend), 0.0), strict=True):
        bends[:, i, j] = bends[:, j, i] = part
    return Expansion(value, slopes.T, bends, off[degree, np.arange(count)])


def _filled(pair: Pair | None, rows: int, count: int) -> Pair:
    zero = np.zeros((rows, count))
    return (zero, zero) if pair is None else pair


def _radius(low: Array, high: Array) -> Array:
    return np.asarray(np.where(np.isfinite(low) & np.isfinite(high), 0.5 * (high - low), np.inf))


def _middle(low: Array, high: Array) -> Array:
    middle = 0.5 * low + 0.5 * high
    return np.asarray(np.where(np.isfinite(middle), middle, 0.0))


# ---- through the graph ------------------------------------------------------------------------------------


def _through(graph: Graph, node: int, at: Mapping[str, _Jet], p: int) -> _Jet:
    count = len(next(iter(at.values())).value[0])
    kept: dict[int, _Jet] = {}
    node = graph.gathered(node)
    for i, op, arguments, leaf, done in graph.program(node):
        if op == "number":
            value = np.full(count, float(leaf))
            kept[i] = _Jet(mended(value, value))
        elif op == "name":
            kept[i] = at[str(leaf)]
        else:
            exponent = None
            if op == "^" and graph.constant(arguments[1]):
                exponent = float(graph.value(arguments[1], {}))
            kept[i] = _operated(op, [kept[a] for a in arguments], exponent, p)
        for a in done:
            del kept[a]
    return kept[node]


def _operated(op: str, inner: Sequence[_Jet], exponent: float | None, p: int) -> _Jet:
    if op in ("+", "-"):
        return _Jet(*(_sum(op, x, y) for x, y in zip(*map(_parts, inner), strict=True)))  # type: ignore[arg-type]
    if op == "*":
        return _product(inner[0], inner[1], p)
    if op == "/":
        return _product(inner[0], _composed(inner[1], "inverse", None, p), p)
    if op == "^":
        if exponent is not None:
            return _composed(inner[0], "^", exponent, p)
        logarithm = _product(inner[1], _composed(inner[0], "log", None, p), p)
        jet = _composed(logarithm, "exp", None, p)
        return _Jet(mended(*power(inner[0].value, inner[1].value, None)), jet.slope, jet.bend)
    if op in ("min", "max"):
        return _chosen(op, inner[0], inner[1])
    if op in ENCLOSED and len(inner) == 1:
        return _composed(inner[0], op, None, p)
    raise AssertionError(f"no enclosure of {op}")  # pragma: no cover - comparisons do not occur in formulas of place


def _parts(jet: _Jet) -> tuple[Pair, Pair | None, Pair | None]:
    return jet.value, jet.slope, jet.bend


def _sum(op: str, x: Pair | None, y: Pair | None) -> Pair | None:
    if y is None:
        return x
    if x is None:
        return y if op == "+" else (-y[1], -y[0])
    return mended(*ENCLOSED[op](x, y))


def _times(x: Pair, y: Pair | None) -> Pair | None:
    return None if y is None else mended(*ENCLOSED["*"](x, y))


def _outer(x: Pair | None, y: Pair | None, p: int) -> Pair | None:
    """``x_i y_j + x_j y_i`` for all pairs; for x itself in place of y the half, ``x_i x_j``."""
    if x is None or y is None:
        return None
    rows, columns = np.triu_indices(p)
    product = mended(*ENCLOSED["*"]((x[0][rows], x[1][rows]), (y[0][columns], y[1][columns])))
    if x is y:
        same = rows == columns
        product[0][same] = np.maximum(product[0][same], 0.0)
        return product
    swapped = mended(*ENCLOSED["*"]((x[0][columns], x[1][columns]), (y[0][rows], y[1][rows])))
    return mended(product[0] + swapped[0], product[1] + swapped[1])


def _product(x: _Jet, y: _Jet, p: int) -> _Jet:
    value = mended(*ENCLOSED["*"](x.value, y.value))
    slope = _sum("+", _times(x.value, y.slope), _times(y.value, x.slope))
    bend = _sum("+", _times(x.value, y.bend), _times(y.value, x.bend))
    return _Jet(value, slope, _sum("+", bend, _outer(x.slope, y.slope, p)))


def _composed(u: _Jet, op: str, exponent: float | None, p: int) -> _Jet:
    """A function of one variable: ``f' u_i`` and ``f' u_ij + f'' u_i u_j``."""
    value, first, second = _function(op, u.value, exponent)
    if u.slope is None:
        return _Jet(value)
    bend = _sum("+", _times(first, u.bend), _times(second, _outer(u.slope, u.slope, p)))
    return _Jet(value, _times(first, u.slope), bend)


def _function(op: str, u: Pair, exponent: float | None) -> tuple[Pair, Pair, Pair]:
    """Bounds of a function and its two derivatives."""
    if op == "^":
        assert exponent is not None
        return _powers(u, exponent)
    if op == "inverse":
        unit = np.ones_like(u[0])
        value = _do("/", (unit, unit), u)
        square = _powers(value, 2.0)[0]
        return value, _negative(square), _scaled(2.0, _do("*", square, value))
    value = mended(*ENCLOSED[op](u))
    unit, zero = np.ones_like(u[0]), np.zeros_like(u[0])
    if op in ("sin", "cos", "tanh"):
        value = np.clip(value[0], -1.0, 1.0), np.clip(value[1], -1.0, 1.0)
    match op:
        case "neg":
            return value, (-unit, -unit), (zero, zero)
        case "sin":
            return value, _do("cos", u), _negative(value)
        case "cos":
            return value, _negative(_do("sin", u)), _negative(value)
        case "tan" | "tanh":
            square = _powers(value, 2.0)[0]
            first = _do("+" if op == "tan" else "-", (unit, unit), square)
            if op == "tanh":
                first = np.clip(first[0], 0.0, 1.0), np.clip(first[1], 0.0, 1.0)
            return value, first, _scaled(2.0 if op == "tan" else -2.0, _do("*", value, first))
        case "exp":
            return value, value, value
        case "log":
            first = _function("inverse", u, None)[0]
            return value, first, _negative(_powers(first, 2.0)[0])
        case "sqrt":
            first = _scaled(0.5, _do("/", (unit, unit), value))
            return value, first, _scaled(-0.5, _do("/", first, u))
        case _:  # abs
            up, down = u[0] >= 0.0, u[1] <= 0.0
            sign = np.where(up, 1.0, -1.0), np.where(down, -1.0, 1.0)
            known = up | down
            return value, sign, (np.where(known, 0.0, -np.inf), np.where(known, 0.0, np.inf))


def _powers(u: Pair, n: float) -> tuple[Pair, Pair, Pair]:
    """``u^n`` and its derivatives."""

    def of(m: float) -> Pair:
        if m == 0.0:
            return np.ones_like(u[0]), np.ones_like(u[0])
        return u if m == 1.0 else mended(*power(u, u, m))

    def factor(c: float, m: float) -> Pair:
        return (np.zeros_like(u[0]),) * 2 if c == 0.0 else _scaled(c, of(m))

    return of(n), factor(n, n - 1.0), factor(n * (n - 1.0), n - 2.0)


def _do(op: str, *arguments: Pair) -> Pair:
    return mended(*ENCLOSED[op](*arguments))


def _scaled(c: float, x: Pair) -> Pair:
    return mended(c * x[0], c * x[1]) if c >= 0.0 else mended(c * x[1], c * x[0])


def _negative(x: Pair) -> Pair:
    return -x[1], -x[0]


def _chosen(op: str, a: _Jet, b: _Jet) -> _Jet:
    """min or max: one of both where it is known which, else between both, with a kink."""
    value = _do(op, a.value, b.value)
    if op == "min":
        first, second = a.value[1] <= b.value[0], b.value[1] <= a.value[0]
    else:
        first, second = a.value[0] >= b.value[1], b.value[0] >= a.value[1]

    def of(x: Pair | None, y: Pair | None, kink: bool) -> Pair | None:
        if x is None and y is None and not kink:
            return None
        pairs = [pair for pair in (x, y) if pair is not None]
        shape = pairs[0][0].shape if pairs else ()
        x, y = ((np.zeros(shape),) * 2 if pair is None else pair for pair in (x, y))
        low = np.full(shape, -np.inf) if kink else np.minimum(x[0], y[0])
        high = np.full(shape, np.inf) if kink else np.maximum(x[1], y[1])
        return tuple(np.where(first, x[i], np.where(second, y[i], end)) for i, end in enumerate((low, high)))  # type: ignore[return-value]

    slope = of(a.slope, b.slope, False)
    if slope is None:
        return _Jet(value)
    p = len(slope[0])
    none = (np.zeros((p * (p + 1) // 2, slope[0].shape[1])),) * 2
    return _Jet(value, slope, of(a.bend or none, b.bend or none, True))
