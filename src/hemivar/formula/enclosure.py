"""Interval enclosures of an expression, rounding included; on rays by how fast its parts grow and decay."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence

import numpy as np

from hemivar.basics.types import Array, BoolArray
from hemivar.formula.graph import Graph, Leaf
from hemivar.formula.intervals import ENCLOSED, Pair, mended, power

__all__ = ["enclosed", "enclosed_on_boxes", "enclosed_parts", "tail", "without_pole"]

#: (c, p, q) for the bound ``exp(c) |r|^p exp(-q |r|)``.
_Growth = tuple[float, float, float]


def enclosed(graph: Graph, node: int, low: Array, high: Array) -> tuple[Array, Array]:
    """Bounds of an expression in one variable over intervals, rounding included.

    Shapes: ``low`` (k,), ``high`` (k,); returns (k,). Returned: the values in the interval lie between them; both are
    infinite where nothing can be said, also where the expression has no value everywhere.
    """
    kept: dict[int, Pair] = {}
    with np.errstate(all="ignore"):
        node = graph.gathered(node)
        for i, op, arguments, leaf, done in graph.program(node):
            kept[i] = _one_enclosed(graph, op, leaf, arguments, kept, low, high)
            for a in done:
                del kept[a]
    return kept[node]


def enclosed_on_boxes(graph: Graph, node: int, sides: Mapping[str, Pair]) -> Pair:
    """Bounds of an expression in several variables on boxes, rounding included.

    Shapes: ``sides`` (k,); returns (k,). Returned: as :func:`enclosed`.
    """
    own: Pair = (np.zeros(0), np.zeros(0))
    for _, _, _, own in enclosed_parts(graph, node, sides):  # noqa: B007 - the last is that of the whole
        pass
    return own


def enclosed_parts(
    graph: Graph, node: int, sides: Mapping[str, Pair]
) -> Iterator[tuple[str, tuple[int, ...], list[Pair], Pair]]:
    """The parts of an expression in order: operation, arguments, the bounds of these and its own on boxes."""
    kept: dict[int, Pair] = {}
    low, high = next(iter(sides.values()))
    for i, op, arguments, leaf, done in graph.program(graph.gathered(node)):
        with np.errstate(all="ignore"):
            enclosed = sides[str(leaf)] if op == "name" else _one_enclosed(graph, op, leaf, arguments, kept, low, high)
        yield op, arguments, [kept[a] for a in arguments], enclosed
        kept[i] = enclosed
        for a in done:
            del kept[a]


def without_pole(graph: Graph, node: int, sides: Mapping[str, Pair]) -> BoolArray:
    """Whether every part of an expression is shown to be finite and continuous on boxes, but for its switches.

    Shapes: ``sides`` (k,); returns (k,).
    """
    shown = np.ones(next(iter(sides.values()))[0].shape, dtype=bool)
    if not any(_may_fail(graph, op, arguments) for _, op, arguments, _, _ in graph.program(node)):
        return shown
    for op, arguments, bounds, _ in enclosed_parts(graph, node, sides):
        if _may_fail(graph, op, arguments):
            exponent = float(graph.value(arguments[1], {})) if op == "^" and graph.constant(arguments[1]) else None
            with np.errstate(invalid="ignore"):
                shown &= _REGULAR[op](bounds, exponent)
    return shown


def _may_fail(graph: Graph, op: str, arguments: Sequence[int]) -> bool:
    """Whether an operation has no value, or a pole, for some value of its arguments."""
    if op == "^" and graph.constant(arguments[1]):
        exponent = float(graph.value(arguments[1], {}))
        return not (exponent >= 0.0 and exponent == round(exponent)) and not graph.constant(arguments[0])
    return op in _REGULAR and not graph.constant(arguments[-1 if op == "/" else 0])


def _power(bounds: Sequence[Pair], exponent: float | None) -> BoolArray:
    low = bounds[0][0]
    if exponent is None or (exponent < 0.0 and exponent != round(exponent)):
        return np.asarray(low > 0.0)
    return np.asarray(low >= 0.0) if exponent > 0.0 else _not_zero(bounds[0])


def _not_zero(of: Pair) -> BoolArray:
    return np.asarray((of[0] > 0.0) | (of[1] < 0.0))


def _one_branch(bounds: Sequence[Pair], _: float | None) -> BoolArray:
    """Whether a tangent stays between two of its poles."""
    low, high = bounds[0]
    margin = 1e-14 * (1.0 + np.maximum(np.abs(low), np.abs(high)))
    first, last = np.floor((low - margin) / np.pi + 0.5), np.floor((high + margin) / np.pi + 0.5)
    return np.asarray((first == last) & (margin < 0.1))


_REGULAR: Mapping[str, Callable[[Sequence[Pair], float | None], BoolArray]] = {
    "/": lambda bounds, _: _not_zero(bounds[1]),
    "^": _power,
    "tan": _one_branch,
    "log": lambda bounds, _: np.asarray(bounds[0][0] > 0.0),
    "sqrt": lambda bounds, _: np.asarray(bounds[0][0] >= 0.0),
}


def _one_enclosed(
    graph: Graph,
    op: str,
    leaf: Leaf,
    arguments: Sequence[int],
    kept: Mapping[int, Pair],
    low: Array,
    high: Array,
) -> Pair:
    """Bounds of one operation from those of its arguments."""
    if op == "number":
        value = np.full(low.shape, float(leaf))
        return mended(value, value)
    if op == "name":
        return low, high
    if op == "^":
        exponent = arguments[1]
        known = float(graph.value(exponent, {})) if graph.constant(exponent) else None
        return mended(*power(kept[arguments[0]], kept[exponent], known))
    below, above = mended(*ENCLOSED[op](*(kept[a] for a in arguments)))
    if op in ("sin", "cos", "tanh"):
        return np.clip(below, -1.0, 1.0), np.clip(above, -1.0, 1.0)
    return below, above


def tail(graph: Graph, node: int, low: float, high: float) -> float:
    """Upper bound on ``[low, inf)`` or ``(-inf, high]``, from how fast the parts grow and decay.

    Infinite where that says nothing.
    """
    start, sign = (low, 1.0) if np.isinf(high) else (high, -1.0)
    if not (np.isfinite(start) and sign * start > 0.0):
        return np.inf
    ends, at_start = (np.array([low]), np.array([high])), np.array([start])
    near = abs(start)
    kept: dict[int, _Growth | None] = {}
    least: dict[int, _Growth | None] = {}
    bounds: dict[int, Pair] = {}
    with np.errstate(all="ignore"):
        node = graph.gathered(node)
        for i, op, arguments, leaf, _ in graph.program(node):
            bounds[i] = _one_enclosed(graph, op, leaf, arguments, bounds, *ends)
            below, above = (float(x[0]) for x in bounds[i])
            inner, under = [kept[a] for a in arguments], [least[a] for a in arguments]
            most = [_flat(max(abs(below), abs(above), np.finfo(float).tiny))]
            fewest = [_flat(max(below, -above, 0.0))]
            if op == "name":
                most.append((0.0, 1.0, 0.0))
                fewest.append((0.0, 1.0, 0.0))
            elif op == "exp":
                rate = enclosed(graph, graph.derivative(arguments[0]), *ends)
                fall = -float(rate[1][0]) if sign > 0.0 else float(rate[0][0])
                first = float(enclosed(graph, arguments[0], at_start, at_start)[1][0])
                if 0.0 < fall < np.inf and np.isfinite(first):
                    most.append((first + fall * near, 0.0, fall))
            elif op in ("neg", "abs"):
                most.append(inner[0])
                fewest.append(under[0])
            elif op in ("+", "-"):
                most.append(_sum(inner[0], inner[1], near))
                x, y = (bounds[a] for a in arguments)
                y = y if op == "+" else (-y[1], -y[0])
                if (x[0][0] >= 0.0 and y[0][0] >= 0.0) or (x[1][0] <= 0.0 and y[1][0] <= 0.0):  # none is lost
                    fewest += under
            elif op == "*":
                most.append(_product_of(inner[0], inner[1], 1.0))
                fewest.append(_product_of(under[0], under[1], 1.0))
            elif op == "/":
                most.append(_product_of(inner[0], under[1], -1.0))
                fewest.append(_product_of(under[0], inner[1], -1.0))
            elif op in ("^", "sqrt"):
                n = 0.5 if op == "sqrt" else 0.0
                if op == "^" and graph.constant(arguments[1]):
                    n = float(graph.value(arguments[1], {}))
                if n == round(n) or bounds[arguments[0]][0][0] >= 0.0:
                    for out, base in ((most, inner[0]), (fewest, under[0])):
                        if n > 0.0 and base is not None:
                            out.append((n * base[0], n * base[1], n * base[2]))
            kept[i] = max((g for g in most if g), key=lambda g: (g[2], -g[1], -g[0]), default=None)
            least[i] = max((g for g in fewest if g), key=lambda g: (-g[2], g[1], g[0]), default=None)
            most_here = _greatest(kept[i], near)
            bounds[i] = (np.maximum(bounds[i][0], -most_here), np.minimum(bounds[i][1], most_here))
    return float(bounds[node][1][0])


def _greatest(growth: _Growth | None, start: float) -> float:
    """Largest value of ``exp(c) r^p exp(-q r)`` for ``r >= start``."""
    if growth is None or (growth[2] <= 0.0 and growth[1] > 0.0) or growth[2] < 0.0:
        return np.inf
    c, p, q = growth
    r = max(start, p / q if q > 0.0 else 0.0)
    power = p * float(np.log(r))
    exponent = c + power - q * r
    exponent += 1e-12 * (1.0 + abs(c) + abs(power) + q * r)
    return float(np.exp(max(exponent, -700.0))) if exponent < 700.0 else np.inf


def _flat(size: float) -> _Growth | None:
    return (float(np.log(size)), 0.0, 0.0) if 0.0 < size < np.inf else None


def _product_of(x: _Growth | None, y: _Growth | None, power: float) -> _Growth | None:
    """The bound of a product, or of a quotient (power -1)."""
    return None if x is None or y is None else (x[0] + power * y[0], x[1] + power * y[1], x[2] + power * y[2])


def _sum(x: _Growth | None, y: _Growth | None, start: float) -> _Growth | None:
    """The bound of a sum for ``|r| >= start``."""
    if x is None or y is None:
        return None
    power, fall, log = max(x[1], y[1]), min(x[2], y[2]), float(np.log(start))
    first, second = (c + (p - power) * log - (q - fall) * start for c, p, q in (x, y))
    return float(np.logaddexp(first, second)), power, fall
