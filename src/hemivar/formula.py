"""Formulas in problem files, read safely: only arithmetic and a few functions, no Python.

:class:`Formula` is a function of the place x, y, z; :class:`ScalarFormula` a function of one variable that may be
given piece by piece and is differentiated symbolically, for laws and friction bounds.
"""

from __future__ import annotations

import ast
import difflib
import itertools
import re
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

import numpy as np

from hemivar._typing import Array
from hemivar.errors import ProblemError

__all__ = ["CONSTANTS", "FUNCTIONS", "VARIABLES", "Formula", "FormulaArray", "ScalarFormula", "SmoothFormula"]

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
_COMPARISONS: Mapping[type[ast.AST], Callable[[Any, Any], Any]] = {
    ast.Lt: np.less,
    ast.LtE: np.less_equal,
    ast.Gt: np.greater,
    ast.GtE: np.greater_equal,
}
_PIECEWISE = "piecewise"
_WIDE = 1e6  # how much farther than the reach switches are found that are linear
_FOREIGN = re.compile(r"[^A-Za-z0-9_+\-*/^()., ]")
_FOREIGN_TO_PIECES = re.compile(r"[^A-Za-z0-9_+\-*/^()., <>=]")
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


@dataclass(frozen=True, eq=False)
class SmoothFormula:
    """A function of one variable without switches, and its derivatives.

    Parameters
    ----------
    tree : ast.expr
        A checked tree without abs, min, max and piecewise.
    variable : str
    """

    tree: ast.expr
    variable: str

    def __call__(self, r: Array) -> Array:
        """Values at ``r``, of its shape; not finite where the formula is not."""
        r = np.asarray(r, dtype=float)
        with np.errstate(all="ignore"):
            return np.broadcast_to(np.asarray(_value(self.tree, {self.variable: r}), dtype=float), r.shape)

    def derivative(self) -> SmoothFormula:
        """The derivative, in symbols."""
        return SmoothFormula(_differentiated(self.tree, self.variable), self.variable)

    @property
    def constant(self) -> bool:
        """Whether the variable does not occur."""
        return not _depends(self.tree, self.variable)

    def __str__(self) -> str:
        return re.sub(r"(\d)\.0\b", r"\1", ast.unparse(self.tree).replace("**", "^"))


@dataclass(frozen=True)
class ScalarFormula:
    """A function of one variable, such as ``piecewise((0, r < 0), (10*r^2, r < 0.1), (0.1, True))``.

    The functions are those of :class:`Formula` and ``piecewise((value, condition), ..., last)``, whose conditions
    compare (``<  <=  >  >=``, also ``0 <= r < 1``) and are tried from the left; the last entry may be a plain value,
    which holds everywhere else, and so does the condition ``True``.

    Parameters
    ----------
    text : str
        The formula.
    variable : str
        Name of the variable.
    where : str
        Where it stands, put before every message.

    Raises
    ------
    ProblemError
        If the text is not a formula; the message names the character.
    """

    text: str
    variable: str = "r"
    where: str = ""
    _tree: ast.expr = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        reader = _Reader(self.text, self.prefix, (self.variable,), pieces=True)
        object.__setattr__(self, "_tree", reader.tree())

    @property
    def prefix(self) -> str:
        """What stands before every message."""
        return f"{self.where}: " if self.where else ""

    def __call__(self, r: Array) -> Array:
        """Values at ``r``, of its shape; not finite where the formula is not."""
        return SmoothFormula(self._tree, self.variable)(r)

    def switches(self, reach: float) -> Array:
        """Where branches may change: zeros of what abs, min, max and conditions compare, in increasing order.

        They are exact where that is linear, and found on a fine grid of ``[-reach, reach]`` otherwise.
        """
        found: list[float] = []
        for difference in _switching(self._tree):
            for smooth in self._alternatives(difference, reach):
                found += _zeros(smooth, reach)
        found.sort()
        kept: list[float] = []
        for place in found:
            if not kept or place - kept[-1] > 1e-12 * max(1.0, abs(place)):
                kept.append(place)
        return np.array(kept)

    def _alternatives(self, tree: ast.expr, reach: float) -> list[SmoothFormula]:
        """A switching function itself, or its branches if it holds switches of its own."""
        inner = _switching(tree)
        if not inner:
            return [SmoothFormula(tree, self.variable)]
        places = [z for d in inner for smooth in self._alternatives(d, reach) for z in _zeros(smooth, reach)]
        ends = np.concatenate([[-2.0 * _WIDE * reach], np.unique(places), [2.0 * _WIDE * reach]])
        return [SmoothFormula(_resolved(tree, {self.variable: m}), self.variable) for m in 0.5 * (ends[1:] + ends[:-1])]

    def branch(self, place: float) -> SmoothFormula:
        """The function without switches that holds around ``place``."""
        return SmoothFormula(_resolved(self._tree, {self.variable: np.float64(place)}), self.variable)


def _switching(tree: ast.expr) -> list[ast.expr]:
    """What the switches of a tree compare with zero."""
    found: list[ast.expr] = []
    for node in ast.walk(tree):
        match node:
            case ast.Call(func=ast.Name(id="abs"), args=[inner]):
                found.append(inner)
            case ast.Call(func=ast.Name(id="min" | "max"), args=several):
                found += [_minus(a, b) for i, a in enumerate(several) for b in several[i + 1 :]]
            case ast.Compare(left=left, comparators=others):
                sides = [left, *others]
                found += [_minus(a, b) for a, b in itertools.pairwise(sides)]
    return found


def _zeros(smooth: SmoothFormula, reach: float) -> list[float]:
    """Zeros in ``[-reach, reach]``: exactly for linear functions, else from sign changes on a fine grid."""
    slope = smooth.derivative()
    if slope.derivative().constant and slope.constant:
        at_zero, rate = float(smooth(np.zeros(1))[0]), float(slope(np.zeros(1))[0])
        place = -at_zero / rate if rate != 0.0 and np.isfinite(rate) else np.inf
        return [place + 0.0] if abs(place) <= _WIDE * reach else []
    grid = _grid(reach)
    values = smooth(grid)
    found = [float(r) for r in grid[values == 0.0]] if np.count_nonzero(values == 0.0) < 50 else []
    for i in np.flatnonzero(values[:-1] * values[1:] < 0.0):
        low, high = float(grid[i]), float(grid[i + 1])
        for _ in range(200):
            middle = 0.5 * (low + high)
            if middle in (low, high):
                break
            same = float(smooth(np.array([middle]))[0]) * values[i] > 0.0
            low, high = (middle, high) if same else (low, middle)
        found.append(0.5 * (low + high))
    return found


def _grid(reach: float) -> Array:
    """Places on a linear and on a logarithmic scale, zero among them."""
    fine = np.geomspace(1e-9 * reach, reach, 1500)
    return np.unique(np.concatenate([-fine, np.linspace(-reach, reach, 4001), fine]))


def _resolved(node: ast.expr, at: Mapping[str, Any]) -> ast.expr:
    """The tree with every switch replaced by the branch it takes at a place."""
    match node:
        case ast.UnaryOp(op=sign, operand=operand):
            inner = _resolved(operand, at)
            return _negative(inner) if isinstance(sign, ast.USub) else inner
        case ast.BinOp(left=left, op=operator, right=right):
            return ast.BinOp(left=_resolved(left, at), op=operator, right=_resolved(right, at))
        case ast.Call(func=ast.Name(id="abs"), args=[inner]):
            kept = _resolved(inner, at)
            return kept if _value(inner, at) >= 0.0 else _negative(kept)
        case ast.Call(func=ast.Name(id="min" | "max" as name), args=several):
            values = [float(_value(one, at)) for one in several]
            pick = np.argmin(values) if name == "min" else np.argmax(values)
            return _resolved(several[int(pick)], at)
        case ast.Call(func=ast.Name(id="piecewise"), args=entries):
            for entry in entries:
                if not isinstance(entry, ast.Tuple):
                    return _resolved(entry, at)
                if np.all(_value(entry.elts[1], at)):
                    return _resolved(entry.elts[0], at)
            return ast.Constant(value=float("nan"))
        case ast.Call(func=name_node, args=[inner]):
            return ast.Call(func=name_node, args=[_resolved(inner, at)], keywords=[])
    return node


def _depends(node: ast.expr, variable: str) -> bool:
    return any(isinstance(part, ast.Name) and part.id == variable for part in ast.walk(node))


def _is(node: ast.expr, number: float) -> bool:
    return isinstance(node, ast.Constant) and node.value == number


def _number(value: float) -> ast.expr:
    return ast.Constant(value=value)


def _both(a: ast.expr, b: ast.expr) -> tuple[float, float] | None:
    if isinstance(a, ast.Constant) and isinstance(b, ast.Constant):
        return float(a.value), float(b.value)  # type: ignore[arg-type]
    return None


def _negative(a: ast.expr) -> ast.expr:
    if isinstance(a, ast.Constant):
        return _number(-float(a.value))  # type: ignore[arg-type]
    if isinstance(a, ast.UnaryOp) and isinstance(a.op, ast.USub):
        return a.operand
    return ast.UnaryOp(op=ast.USub(), operand=a)


def _inner(a: ast.expr) -> ast.expr | None:
    """What a tree is the negative of."""
    return a.operand if isinstance(a, ast.UnaryOp) and isinstance(a.op, ast.USub) else None


def _plus(a: ast.expr, b: ast.expr) -> ast.expr:
    if _is(a, 0):
        return b
    if _is(b, 0):
        return a
    if (negative := _inner(b)) is not None:
        return ast.BinOp(left=a, op=ast.Sub(), right=negative)
    numbers = _both(a, b)
    return _number(sum(numbers)) if numbers else ast.BinOp(left=a, op=ast.Add(), right=b)


def _minus(a: ast.expr, b: ast.expr) -> ast.expr:
    if _is(b, 0):
        return a
    if _is(a, 0):
        return _negative(b)
    if (negative := _inner(b)) is not None:
        return _plus(a, negative)
    numbers = _both(a, b)
    return _number(numbers[0] - numbers[1]) if numbers else ast.BinOp(left=a, op=ast.Sub(), right=b)


def _times(a: ast.expr, b: ast.expr) -> ast.expr:
    if _is(a, 0) or _is(b, 0):
        return _number(0.0)
    if _is(a, 1):
        return b
    if _is(b, 1):
        return a
    if isinstance(b, ast.Constant) and not isinstance(a, ast.Constant):
        a, b = b, a
    if _is(a, -1):
        return _negative(b)
    for one, other in ((a, b), (b, a)):
        if (negative := _inner(one)) is not None:
            return _negative(_times(negative, other))
    match a, b:
        case ast.Constant(), ast.BinOp(left=ast.Constant() as first, op=ast.Mult(), right=rest):
            return _times(_times(a, first), rest)
    numbers = _both(a, b)
    return _number(numbers[0] * numbers[1]) if numbers else ast.BinOp(left=a, op=ast.Mult(), right=b)


def _over(a: ast.expr, b: ast.expr) -> ast.expr:
    if _is(a, 0):
        return _number(0.0)
    return a if _is(b, 1) else ast.BinOp(left=a, op=ast.Div(), right=b)


def _power(a: ast.expr, b: ast.expr) -> ast.expr:
    if _is(b, 0):
        return _number(1.0)
    return a if _is(b, 1) else ast.BinOp(left=a, op=ast.Pow(), right=b)


def _function(name: str, inner: ast.expr) -> ast.expr:
    return ast.Call(func=ast.Name(id=name, ctx=ast.Load()), args=[inner], keywords=[])


def _differentiated(node: ast.expr, v: str) -> ast.expr:
    """Derivative of a tree without switches in the variable ``v``."""
    if not _depends(node, v):
        return _number(0.0)
    match node:
        case ast.Name():
            return _number(1.0)
        case ast.UnaryOp(op=sign, operand=operand):
            inner = _differentiated(operand, v)
            return _negative(inner) if isinstance(sign, ast.USub) else inner
        case ast.BinOp(left=a, op=ast.Add(), right=b):
            return _plus(_differentiated(a, v), _differentiated(b, v))
        case ast.BinOp(left=a, op=ast.Sub(), right=b):
            return _minus(_differentiated(a, v), _differentiated(b, v))
        case ast.BinOp(left=a, op=ast.Mult(), right=b):
            return _plus(_times(_differentiated(a, v), b), _times(a, _differentiated(b, v)))
        case ast.BinOp(left=a, op=ast.Div(), right=b):
            first = _over(_differentiated(a, v), b)
            if not _depends(b, v):
                return first
            return _minus(first, _over(_times(a, _differentiated(b, v)), _power(b, _number(2))))
        case ast.BinOp(left=a, op=ast.Pow(), right=b):
            if not _depends(b, v):
                return _times(_times(b, _power(a, _minus(b, _number(1)))), _differentiated(a, v))
            by_exponent = _times(_differentiated(b, v), _function("log", a))
            by_base = _over(_times(b, _differentiated(a, v)), a)
            return _times(node, _plus(by_exponent, by_base))
        case ast.Call(func=ast.Name(id=name), args=[u]):
            inner = _differentiated(u, v)
            match name:
                case "sin":
                    outer = _function("cos", u)
                case "cos":
                    outer = _negative(_function("sin", u))
                case "tan":
                    outer = _plus(_number(1.0), _power(node, _number(2)))
                case "tanh":
                    outer = _minus(_number(1.0), _power(node, _number(2)))
                case "exp":
                    outer = node
                case "log":
                    return _over(inner, u)
                case "sqrt":
                    return _over(inner, _times(_number(2.0), node))
                case _:  # pragma: no cover
                    raise AssertionError(f"no derivative of {name}")
            return _times(outer, inner)
    raise AssertionError(f"unchecked node {node!r}")  # pragma: no cover


def _value(node: ast.expr, at: Mapping[str, Any]) -> Any:
    """Value of a checked tree."""
    match node:
        case ast.Constant(value=bool() as truth):
            return np.bool_(truth)
        case ast.Compare(left=first, ops=operators, comparators=others):
            sides = [_value(side, at) for side in (first, *others)]
            holds: Any = np.bool_(True)
            for operator, low, high in zip(operators, sides, sides[1:], strict=False):
                holds = holds & _COMPARISONS[type(operator)](low, high)
            return holds
        case ast.Call(func=ast.Name(id="piecewise"), args=entries):
            chosen: Any = np.float64("nan")
            for entry in reversed(entries):
                if isinstance(entry, ast.Tuple):
                    chosen = np.where(_value(entry.elts[1], at), _value(entry.elts[0], at), chosen)
                else:
                    chosen = _value(entry, at)
            return chosen
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

    def __init__(self, text: str, prefix: str, variables: Sequence[str] = VARIABLES, pieces: bool = False) -> None:
        self.text = text
        self.prefix = prefix
        self.variables = tuple(variables)
        self.pieces = pieces
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
            raise self.error(f"it is empty; give a number or a formula of {' and '.join(self.variables[:2])}")
        if len(self.code) > _LONGEST:
            raise self.error(f"it has {len(self.code)} characters; at most {_LONGEST} are read")
        foreign = (_FOREIGN_TO_PIECES if self.pieces else _FOREIGN).search(self.code)
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
                _value(tree, {name: np.ones(1) for name in self.variables})
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
            case ast.Call(func=ast.Name(id="piecewise"), args=entries, keywords=[]) if self.pieces:
                self.check_pieces(entries, node.col_offset, depth)
            case ast.Call(func=ast.Name(id=name), args=arguments, keywords=[]):
                self.check_call(name, len(arguments), node.col_offset)
                for argument in arguments:
                    self.check(argument, depth + 1)
            case ast.Compare() if self.pieces:
                raise self.error("a comparison stands in piecewise((value, condition), ...) only", node.col_offset)
            case _:
                names = ", ".join(self.variables)
                raise self.error(f"only numbers, {names}, pi, + - * / ^ and functions are allowed", node.col_offset)

    def check_pieces(self, entries: Sequence[ast.expr], column: int, depth: int) -> None:
        example = "write piecewise((value, condition), ..., (value, True))"
        if not entries:
            raise self.error(f"{_PIECEWISE} has no entry; {example}", column)
        for number, entry in enumerate(entries):
            if not isinstance(entry, ast.Tuple):
                if number < len(entries) - 1 or number == 0:
                    raise self.error(f"this entry of {_PIECEWISE} has no condition; {example}", entry.col_offset)
                self.check(entry, depth + 1)
                continue
            if len(entry.elts) != 2:
                raise self.error(f"an entry of {_PIECEWISE} is (value, condition); {example}", entry.col_offset)
            self.check(entry.elts[0], depth + 1)
            match entry.elts[1]:
                case ast.Constant(value=True):
                    pass
                case ast.Compare(left=left, ops=operators, comparators=others) if all(
                    type(operator) in _COMPARISONS for operator in operators
                ):
                    for side in (left, *others):
                        self.check(side, depth + 1)
                case other:
                    raise self.error("a condition compares with < <= > >=, or is True", other.col_offset)

    def check_name(self, name: str, column: int) -> None:
        known = [*self.variables, *CONSTANTS]
        if name in known:
            return
        if name in FUNCTIONS:
            raise self.error(f"'{name}' is a function; write {name}(...)", column)
        raise self.error(f"'{name}' is not known{_hint(name, [*known, *FUNCTIONS])}", column)

    def check_call(self, name: str, count: int, column: int) -> None:
        known = [*FUNCTIONS, *([_PIECEWISE] if self.pieces else [])]
        if name not in FUNCTIONS:
            if name in (*self.variables, *CONSTANTS):
                raise self.error(f"'{name}' is not a function; write products with *", column)
            raise self.error(f"function '{name}' is not known{_hint(name, known)}", column)
        several = name in ("min", "max")
        if count < 2 if several else count != 1:
            wanted = "two or more arguments" if several else "one argument"
            raise self.error(f"{name} takes {wanted}, not {count}", column)


def _hint(name: str, known: Sequence[str]) -> str:
    close = difflib.get_close_matches(name, known, n=1)
    return f"; did you mean '{close[0]}'?" if close else f"; use {', '.join(known)}"
