"""Forward-mode differentiation: first derivatives of expressions in several variables, with their values."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from hemivar.basics.types import Array
from hemivar.formula.graph import OPERATIONS, Graph

__all__ = ["slopes"]


def slopes(graph: Graph, node: int, at: Mapping[str, Array], names: Sequence[str]) -> list[Array]:
    """The derivatives of an expression by some variables, one array for each; nan where there is none.

    At a kink of ``abs``, ``min`` or ``max`` it is the mean of both sides.
    """
    value: dict[int, Array] = {}
    rates: dict[int, list[Array]] = {}
    for i, op, arguments, leaf, done in graph.program(node):
        inner = [value[a] for a in arguments]
        if op in ("number", "name"):
            value[i] = np.asarray(at[str(leaf)] if op == "name" else float(leaf), dtype=float)
            rates[i] = [np.asarray(float(op == "name" and leaf == name)) for name in names]
        else:
            value[i] = np.asarray(OPERATIONS[op](*inner), dtype=float)
            shares = _shares(op, inner, value[i], [not graph.constant(a) for a in arguments])
            pairs = [[share * rate for rate in rates[a]] for share, a in zip(shares, arguments, strict=True)]
            rates[i] = [sum(parts, np.zeros(())) for parts in zip(*pairs, strict=True)]
        for a in done:
            del value[a], rates[a]
    return rates[node]


def _shares(op: str, inner: Sequence[Array], value: Array, varies: Sequence[bool]) -> list[Array]:
    """How fast an operation goes with each of its arguments; 0 for those that are constant."""
    one = np.ones(())
    if len(inner) == 1:
        (u,) = inner
        by_function: Mapping[str, Array] = {
            "neg": -one,
            "sin": np.cos(u),
            "cos": -np.sin(u),
            "tan": 1.0 + value**2,
            "tanh": 1.0 - value**2,
            "exp": value,
            "log": 1.0 / u if op == "log" else one,
            "sqrt": 0.5 / value if op == "sqrt" else one,
            "abs": np.sign(u),
        }
        return [by_function[op]]
    a, b = inner
    match op:
        case "+":
            return [one, one]
        case "-":
            return [one, -one]
        case "*":
            return [b, a]
        case "/":
            return [1.0 / b, -value / b]
        case "^":
            by_base = b * np.power(a, b - 1.0) if varies[0] else np.zeros(())
            return [by_base, value * np.log(a) if varies[1] else np.zeros(())]
        case _:
            first = 0.5 + 0.5 * (np.sign(b - a) if op == "min" else np.sign(a - b))
            return [first, 1.0 - first]
