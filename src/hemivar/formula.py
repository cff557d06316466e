"""Formulas of x, y, z in problem files, read safely: only arithmetic and a few functions, no Python."""

from __future__ import annotations

import ast
import difflib
import re
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

import numpy as np

from hemivar._typing import Array
from hemivar.errors import ProblemError

__all__ = ["CONSTANTS", "FUNCTIONS", "VARIABLES", "Formula", "FormulaArray"]

#: Coordinates that a formula may use.
VARIABLES = ("x", "y", "z")

#: Constants that a formula may use.
CONSTANTS: Mapping[str, float] = MappingProxyType({"pi": float(np.pi)})

#: Functions that a formula may use; ``min`` and ``max`` take two or more arguments, the others one.
FUNCTIONS: Mapping[str, Callable[..., Any]] = MappingProxyType(
    {
        "sin": np.sin,
        "cos": np.cos,
        "tan": np.tan,
        "tanh": np.tanh,
        "exp": np.exp,
        "log": np.log,
        "sqrt": np.sqrt,
        "abs": np.abs,
        "min": np.minimum,
        "max": np.maximum,
    }
)

_OPERATORS: Mapping[type[ast.AST], Callable[[Any, Any], Any]] = {
    ast.Add: np.add,
    ast.Sub: np.subtract,
    ast.Mult: np.multiply,
    ast.Div: np.divide,
    ast.Pow: np.power,
}
_FOREIGN = re.compile(r"[^A-Za-z0-9_+\-*/^()., ]")
_LONGEST = 1000
_DEEPEST = 200


@dataclass(frozen=True)
class Formula:
    """A number that varies in space, such as ``0.1 * x * (1 - x)``.

    Powers are written ``**`` or ``^``; see :data:`VARIABLES`, :data:`CONSTANTS` and :data:`FUNCTIONS` for the
    names.  There are no comparisons; ``min``, ``max`` and ``abs`` make kinks.

    Parameters
    ----------
    text : str
        The formula.
    where : str
        Where it stands, put before every message.
    minimum : float, optional
        Smallest value allowed.

    Raises
    ------
    ProblemError
        If the text is not a formula; the message names the character.  Calling the formula raises it if a
        value is not finite or too small; the message names the point.
    """

    text: str
    where: str = ""
    minimum: float | None = None
    _tree: ast.expr = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "_tree", _Reader(self.text, self._prefix).tree())

    @property
    def _prefix(self) -> str:
        return f"{self.where}: " if self.where else ""

    @property
    def variables(self) -> frozenset[str]:
        """Names of the coordinates that occur in the formula."""
        names = {node.id for node in ast.walk(self._tree) if isinstance(node, ast.Name)}
        return frozenset(names & set(VARIABLES))

    def __call__(self, points: Array) -> Array:
        """Values at points.

        Parameters
        ----------
        points : array, shape (k, d)

        Returns
        -------
        array, shape (k,)
        """
        points = np.asarray(points, dtype=float)
        at = dict(zip(VARIABLES, points.T, strict=False))
        missing = sorted(self.variables - set(at))
        if missing:
            raise ProblemError(
                f"{self._prefix}formula '{self.text}' uses {missing[0]}, but the points have only "
                f"{points.shape[1]} coordinates; use {', '.join(at)}"
            )
        with np.errstate(all="ignore"):
            values = np.asarray(_value(self._tree, at), dtype=float)
        values = np.broadcast_to(values, (len(points),)).copy()
        self._check(values, points, ~np.isfinite(values), "give a formula that is finite there")
        if self.minimum is not None:
            self._check(values, points, values < self.minimum, f"it must be at least {self.minimum:g}")
        return values

    def _check(self, values: Array, points: Array, bad: Any, remedy: str) -> None:
        if bad.any():
            first = int(np.argmax(bad))
            place = ", ".join(f"{name} = {c:.6g}" for name, c in zip(VARIABLES, points[first], strict=False))
            raise ProblemError(f"{self._prefix}formula '{self.text}' is {values[first]:.6g} at {place}; {remedy}")


@dataclass(frozen=True)
class FormulaArray:
    """A vector or matrix whose entries are numbers and formulas.

    Parameters
    ----------
    entries : sequence of float or Formula
        In row-major order.
    shape : tuple of int
        Shape of the value at one point.
    """

    entries: Sequence[float | Formula]
    shape: tuple[int, ...]

    def __call__(self, points: Array) -> Array:
        """Values at points, shape (k, d); shape (k, *shape)."""
        columns = [
            entry(points) if isinstance(entry, Formula) else np.full(len(points), float(entry))
            for entry in self.entries
        ]
        return np.stack(columns, axis=-1).reshape(len(points), *self.shape)


def _value(node: ast.expr, at: Mapping[str, Array]) -> Any:
    """Value of a checked tree."""
    match node:
        case ast.Constant(value=int() | float() as number):
            return np.float64(number)
        case ast.Name(id=name):
            return at[name] if name in at else CONSTANTS[name]
        case ast.UnaryOp(op=sign, operand=operand):
            inner = _value(operand, at)
            return -inner if isinstance(sign, ast.USub) else inner
        case ast.BinOp(left=left, op=operator, right=right):
            return _OPERATORS[type(operator)](_value(left, at), _value(right, at))
        case ast.Call(func=ast.Name(id=name), args=arguments):
            values = [_value(argument, at) for argument in arguments]
            result = FUNCTIONS[name](*values[:2])
            for value in values[2:]:
                result = FUNCTIONS[name](result, value)
            return result
    raise AssertionError(f"unchecked node {node!r}")  # pragma: no cover


class _Reader:
    """Parses a text and checks every node against what is allowed."""

    def __init__(self, text: str, prefix: str) -> None:
        self.text = text
        self.prefix = prefix
        code, self.places = "", []
        for place, character in enumerate(text):
            piece = "**" if character == "^" else " " if character.isspace() else character
            code += piece
            self.places += [place] * len(piece)
        self.skipped = len(code) - len(code.lstrip())
        self.code = code.strip()

    def error(self, what: str, column: int | None = None) -> ProblemError:
        """The error to raise; ``column`` counts from zero in the code that is parsed."""
        place = ""
        if column is not None and self.places:
            index = min(max(column + self.skipped, 0), len(self.places) - 1)
            place = f" at character {self.places[index] + 1}"
        shown = self.text if len(self.text) <= 60 else self.text[:57] + "..."
        shown = "".join(c if c.isprintable() else " " for c in shown)
        return ProblemError(f"{self.prefix}formula '{shown}'{place}: {what}")

    def tree(self) -> ast.expr:
        if not self.code:
            raise self.error("it is empty; give a number or a formula of x and y")
        if len(self.code) > _LONGEST:
            raise self.error(f"it has {len(self.code)} characters; at most {_LONGEST} are read")
        foreign = _FOREIGN.search(self.code)
        if foreign:
            raise self.error(
                f"{foreign.group()!r} does not belong in a formula; use + - * / ^ ( ) and functions",
                foreign.start(),
            )
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                tree = ast.parse(self.code, mode="eval").body
            self.check(tree, 0)
            with np.errstate(all="ignore"):
                _value(tree, {name: np.ones(1) for name in VARIABLES})
        except SyntaxError as error:
            reason = (error.msg or "invalid syntax").split(". ")[0]
            raise self.error(
                f"not understood ({reason}); write products with * and close every bracket",
                (error.offset or len(self.code)) - 1,
            ) from None
        except (RecursionError, MemoryError):
            raise self.error("it is nested too deeply; simplify it") from None
        return tree

    def check(self, node: ast.expr, depth: int) -> None:
        if depth > _DEEPEST:
            raise self.error("it is nested too deeply; simplify it")
        match node:
            case ast.Constant(value=bool()):
                raise self.error("True and False are not numbers", node.col_offset)
            case ast.Constant(value=int() | float() as value):
                try:
                    finite = bool(np.isfinite(float(value)))
                except OverflowError:
                    finite = False
                if not finite:
                    raise self.error("the number is too large", node.col_offset)
            case ast.Name(id=name):
                self.check_name(name, node.col_offset)
            case ast.UnaryOp(op=ast.USub() | ast.UAdd(), operand=operand):
                self.check(operand, depth + 1)
            case ast.BinOp(left=left, op=operator, right=right):
                if type(operator) not in _OPERATORS:
                    raise self.error("operator not known; use + - * / ^", left.end_col_offset)
                self.check(left, depth + 1)
                self.check(right, depth + 1)
            case ast.Call(func=ast.Name(id=name), args=arguments, keywords=[]):
                self.check_call(name, len(arguments), node.col_offset)
                for argument in arguments:
                    self.check(argument, depth + 1)
            case _:
                raise self.error("only numbers, x, y, z, pi, + - * / ^ and functions are allowed", node.col_offset)

    def check_name(self, name: str, column: int) -> None:
        known = [*VARIABLES, *CONSTANTS]
        if name in known:
            return
        if name in FUNCTIONS:
            raise self.error(f"'{name}' is a function; write {name}(...)", column)
        raise self.error(f"'{name}' is not known{_hint(name, [*known, *FUNCTIONS])}", column)

    def check_call(self, name: str, count: int, column: int) -> None:
        if name not in FUNCTIONS:
            if name in (*VARIABLES, *CONSTANTS):
                raise self.error(f"'{name}' is not a function; write products with *", column)
            raise self.error(f"function '{name}' is not known{_hint(name, [*FUNCTIONS])}", column)
        several = name in ("min", "max")
        if count < 2 if several else count != 1:
            wanted = "two or more arguments" if several else "one argument"
            raise self.error(f"{name} takes {wanted}, not {count}", column)


def _hint(name: str, known: Sequence[str]) -> str:
    close = difflib.get_close_matches(name, known, n=1)
    return f"; did you mean '{close[0]}'?" if close else f"; use {', '.join(known)}"
