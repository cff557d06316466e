"""Formulas in problem files, read safely: only arithmetic and a few functions, no Python.

:class:`Formula` is a function of the place x, y, z; :class:`ScalarFormula` a function of one variable that may be
given piece by piece and is differentiated symbolically, for laws and friction bounds.
"""

from __future__ import annotations

import ast
import difflib
import functools
import itertools
import re
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

import numpy as np

from hemivar.basics.types import Array
from hemivar.errors import ProblemError
from hemivar.formula.graph import OPERATIONS, Graph
from hemivar.formula.smooth import WIDE, SmoothFormula

__all__ = ["CONSTANTS", "FUNCTIONS", "VARIABLES", "Formula", "FormulaArray", "ScalarFormula"]

#: Coordinates that a formula may use.
VARIABLES = ("x", "y", "z")

#: Constants that a formula may use.
CONSTANTS: Mapping[str, float] = MappingProxyType({"pi": float(np.pi)})

#: Functions that a formula may use; ``min`` and ``max`` take two or more arguments, the others one.
FUNCTIONS: Mapping[str, Callable[..., Any]] = MappingProxyType(
    {name: OPERATIONS[name] for name in ("sin", "cos", "tan", "tanh", "exp", "log", "sqrt", "abs", "min", "max")}
)

_OPERATORS: Mapping[type[ast.AST], str] = {ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/", ast.Pow: "^"}
_COMPARISONS: Mapping[type[ast.AST], str] = {ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">="}
_PIECEWISE = "piecewise"
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
    _graph: Graph = field(init=False, repr=False, compare=False)
    _node: int = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        graph, node = _Reader(self.text, self._prefix).graph()
        object.__setattr__(self, "_graph", graph)
        object.__setattr__(self, "_node", node)

    @property
    def _prefix(self) -> str:
        return f"{self.where}: " if self.where else ""

    @property
    def variables(self) -> frozenset[str]:
        """Names of the coordinates that occur in the formula."""
        return self._graph.names(self._node)

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
            values = np.asarray(self._graph.value(self._node, at), dtype=float)
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
    graph: Graph = field(init=False, repr=False, compare=False)
    node: int = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        graph, node = _Reader(self.text, self.prefix, (self.variable,), pieces=True).graph()
        object.__setattr__(self, "graph", graph)
        object.__setattr__(self, "node", node)

    @property
    def prefix(self) -> str:
        """What stands before every message."""
        return f"{self.where}: " if self.where else ""

    @property
    def shown(self) -> str:
        """Name of the formula in messages."""
        return f"{self.prefix}formula '{_shown(self.text)}'"

    def __call__(self, r: Array) -> Array:
        """Values at ``r``, of its shape; not finite where the formula is not."""
        return SmoothFormula(self.graph, self.node, self.variable)(r)

    def switches(self, reach: float) -> tuple[Array, bool]:
        """Where branches may change: zeros of what abs, min, max and conditions compare.

        Returns
        -------
        places : array (k,)
            Increasing; within ``[-reach, reach]``, and far beyond where what is compared is linear.
        sure : bool
            Whether none is missing; False where one of the differences is too intricate, and was sampled.

        Raises
        ------
        ProblemError
            If there are too many of them.
        """
        found = _Switches(self, reach)
        return found.breaks(self.node), found.sure

    def branches(self, places: Array) -> list[SmoothFormula]:
        """The functions without switches that hold around some places."""
        nodes = self.graph.branches(self.node, self.variable, np.asarray(places, dtype=float))
        return [SmoothFormula(self.graph, node, self.variable) for node in nodes.tolist()]

    def branch(self, place: float) -> SmoothFormula:
        """The function without switches that holds around ``place``."""
        return self.branches(np.array([place]))[0]


#: Places at which the branches of a formula may change, and branches of one part, that are followed.
_MOST_SWITCHES = 2000
_MOST_BRANCHES = 200


class _Switches:
    """The places where the branches of every part of a formula may change, each found once."""

    def __init__(self, formula: ScalarFormula, reach: float) -> None:
        self.formula, self.graph, self.reach = formula, formula.graph, reach
        self.wide = 2.0 * WIDE * reach
        self.sure = True
        self._breaks: dict[int, Array] = {}
        self._zeros: dict[int, Array] = {}

    def breaks(self, node: int) -> Array:
        """Places where the branch of a part may change."""
        if node not in self._breaks:
            parts = [self.zeros(difference) for difference in self.graph.switching(node)]
            found = _merged(np.concatenate([np.zeros(0), *parts]))
            if found.size > _MOST_SWITCHES:
                raise ProblemError(
                    f"{self.formula.shown} changes its branch at more than {_MOST_SWITCHES} places up to the reach "
                    f"{self.reach:g}; take a smaller reach, or give a table"
                )
            self._breaks[node] = found
        return self._breaks[node]

    def zeros(self, node: int) -> Array:
        """Zeros of what a switch compares, in the intervals in which its branches hold."""
        if node in self._zeros:
            return self._zeros[node]
        ends = np.concatenate([[-self.wide], self.breaks(node), [self.wide]])
        held = self.graph.branches(node, self.formula.variable, 0.5 * (ends[1:] + ends[:-1]))
        branches = np.unique(held)
        if branches.size > _MOST_BRANCHES:
            raise ProblemError(
                f"{self.formula.shown} has more than {_MOST_BRANCHES} branches; simplify it, or give a table"
            )
        found = [np.zeros(0)]
        for branch in branches.tolist():
            smooth = SmoothFormula(self.graph, branch, self.formula.variable)
            places = smooth.zeros(self.reach)
            if places is None:
                self.sure = False
                places = _sign_changes(smooth, self.reach)
            for low, high in zip(ends[:-1][held == branch], ends[1:][held == branch], strict=True):
                slack = 1e-12 * max(1.0, *(abs(x) for x in (low, high) if abs(x) < self.wide), 0.0)
                found.append(places[(places >= low - slack) & (places <= high + slack)])
        self._zeros[node] = _merged(np.concatenate(found))
        return self._zeros[node]


def _merged(places: Array) -> Array:
    """Sorted, and those that differ by rounding only taken together."""
    places = np.sort(places)
    keep = np.ones(places.size, dtype=bool)
    keep[1:] = np.diff(places) > 1e-12 * np.maximum(1.0, np.abs(places[1:]))
    return np.asarray(places[keep])


def _sign_changes(smooth: SmoothFormula, reach: float) -> Array:
    """Zeros where the sign changes between places on a linear and on a logarithmic scale."""
    fine = np.geomspace(1e-9 * reach, reach, 1500)
    grid = np.unique(np.concatenate([-fine, np.linspace(-reach, reach, 20_001), fine]))
    values = smooth(grid)
    found = grid[values == 0.0] if np.count_nonzero(values == 0.0) < 50 else np.zeros(0)
    changes = np.flatnonzero(values[:-1] * values[1:] < 0.0)
    return np.concatenate([found, smooth.crossings(grid[changes], grid[changes + 1])])


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
        return ProblemError(f"{self.prefix}formula '{_shown(self.text)}'{place}: {what}")

    def graph(self) -> tuple[Graph, int]:
        """The formula as a node of a graph."""
        tree = self.tree()
        graph = Graph(f"{self.prefix}formula '{_shown(self.text)}': ")
        return graph, _planted(tree, graph)

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
        everywhere = False
        for number, entry in enumerate(entries):
            if everywhere:
                raise self.error(
                    f"this entry of {_PIECEWISE} is never reached, for the one before it holds everywhere (True); put "
                    f"it first, or leave it out",
                    entry.col_offset,
                )
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
                    everywhere = True
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


def _planted(tree: ast.expr, graph: Graph) -> int:
    """The node of a checked tree, as it is written."""
    match tree:
        case ast.Constant(value=bool()):
            return graph.node("true")
        case ast.Constant(value=int() | float() as number):
            return graph.number(number)
        case ast.Name(id=name):
            return graph.number(CONSTANTS[name]) if name in CONSTANTS else graph.name(name)
        case ast.UnaryOp(op=sign, operand=operand):
            inner = _planted(operand, graph)
            return graph.node("neg", inner) if isinstance(sign, ast.USub) else inner
        case ast.BinOp(left=left, op=operator, right=right):
            return graph.node(_OPERATORS[type(operator)], _planted(left, graph), _planted(right, graph))
        case ast.Compare(left=first, ops=operators, comparators=others):
            sides = [_planted(side, graph) for side in (first, *others)]
            holds = [
                graph.node(_COMPARISONS[type(operator)], *pair)
                for operator, pair in zip(operators, itertools.pairwise(sides), strict=True)
            ]
            return functools.reduce(lambda a, b: graph.node("and", a, b), holds)
        case ast.Call(func=ast.Name(id="piecewise"), args=entries):
            arguments: list[int] = []
            for entry in entries:
                if isinstance(entry, ast.Tuple):
                    value, condition = entry.elts
                    arguments += [_planted(condition, graph), _planted(value, graph)]
                else:
                    arguments.append(_planted(entry, graph))
            return graph.node("piecewise", *arguments)
        case ast.Call(func=ast.Name(id=name), args=several):
            return (
                functools.reduce(lambda a, b: graph.node(name, a, b), [_planted(one, graph) for one in several])
                if (len(several) > 1)
                else graph.node(name, _planted(several[0], graph))
            )
    raise AssertionError(f"unchecked node {tree!r}")  # pragma: no cover


def _shown(text: str) -> str:
    """A formula as it may stand in a message."""
    short = text if len(text) <= 60 else text[:57] + "..."
    return "".join(c if c.isprintable() else " " for c in short)


def _hint(name: str, known: Sequence[str]) -> str:
    close = difflib.get_close_matches(name, known, n=1)
    return f"; did you mean '{close[0]}'?" if close else f"; use {', '.join(known)}"
