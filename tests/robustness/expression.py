"""Formulas by code of our own, number by number with :mod:`math`."""

from __future__ import annotations

import ast
import math
from collections.abc import Mapping
from typing import Any

__all__ = ["UnknownError", "parse", "value"]

_FUNCTIONS = {
    "sin": math.sin, "cos": math.cos, "tan": math.tan, "tanh": math.tanh, "exp": math.exp, "log": math.log,
    "sqrt": math.sqrt, "abs": abs, "min": min, "max": max,
}  # fmt: skip
_COMPARE = {
    ast.Lt: lambda a, b: a < b, ast.LtE: lambda a, b: a <= b, ast.Gt: lambda a, b: a > b, ast.GtE: lambda a, b: a >= b,
}  # fmt: skip


class UnknownError(Exception):
    """Not a formula that this evaluator understands."""


def parse(text: str) -> ast.expr:
    """The tree of a formula."""
    try:
        return ast.parse(text.replace("^", "**").strip(), mode="eval").body
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        raise UnknownError(str(error)) from None


def value(tree: ast.expr, at: Mapping[str, float]) -> float:
    """The value of a formula; nan where it has none."""
    try:
        result = _value(tree, at)
        return float(result) if not isinstance(result, complex) else math.nan
    except (ArithmeticError, ValueError):
        return math.nan
    except RecursionError:
        raise UnknownError("too deep") from None


def _value(node: ast.expr, at: Mapping[str, float]) -> Any:
    match node:
        case ast.Constant(value=bool() as known):
            return known
        case ast.Constant(value=int() | float() as number):
            return float(number)
        case ast.Name(id="pi"):
            return math.pi
        case ast.Name(id=name) if name in at:
            return at[name]
        case ast.UnaryOp(op=ast.USub(), operand=inner):
            return -_value(inner, at)
        case ast.UnaryOp(op=ast.UAdd(), operand=inner):
            return _value(inner, at)
        case ast.BinOp(left=left, op=operator, right=right):
            a, b = _value(left, at), _value(right, at)
            match operator:
                case ast.Add():
                    return a + b
                case ast.Sub():
                    return a - b
                case ast.Mult():
                    return a * b
                case ast.Div():
                    return a / b
                case ast.Pow():
                    return a**b
        case ast.Compare(left=left, ops=operators, comparators=others):
            sides = [_value(side, at) for side in (left, *others)]
            return all(_COMPARE[type(o)](a, b) for o, a, b in zip(operators, sides, sides[1:], strict=False))
        case ast.Call(func=ast.Name(id="piecewise"), args=entries):
            for entry in entries:
                if not isinstance(entry, ast.Tuple):
                    return _value(entry, at)
                if _value(entry.elts[1], at):
                    return _value(entry.elts[0], at)
            return math.nan
        case ast.Call(func=ast.Name(id=name), args=several, keywords=[]) if name in _FUNCTIONS:
            return _FUNCTIONS[name](*(_value(one, at) for one in several))
    raise UnknownError(ast.dump(node)[:60])
