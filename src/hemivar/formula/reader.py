"""Parser of formulas: only arithmetic and a few functions, no Python is run."""

from __future__ import annotations

import ast
import difflib
import functools
import itertools
import re
import warnings
from collections.abc import Mapping, Sequence
from types import MappingProxyType

import numpy as np

from hemivar.basics.arguments import expect
from hemivar.errors import ProblemError
from hemivar.formula.graph import OPERATIONS, Graph

__all__ = ["CONSTANTS", "FUNCTIONS", "TIME", "VARIABLES", "Reader", "shown"]

#: Coordinates that a formula may use.
VARIABLES = ("x", "y", "z")
#: The time, in formulas of what may change with it.
TIME = "t"

#: Constants that a formula may use.
CONSTANTS: Mapping[str, float] = MappingProxyType({"pi": float(np.pi)})

#: Functions that a formula may use; ``min`` and ``max`` take two or more arguments, the others one.
FUNCTIONS: Mapping[str, np.ufunc] = MappingProxyType(
    {name: OPERATIONS[name] for name in ("sin", "cos", "tan", "tanh", "exp", "log", "sqrt", "abs", "min", "max")}
)

_OPERATORS: Mapping[type[ast.AST], str] = {ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/", ast.Pow: "^"}
_COMPARISONS: Mapping[type[ast.AST], str] = {ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">="}
_PIECEWISE = "piecewise"
_FOREIGN = re.compile(r"[^A-Za-z0-9_+\-*/^()., ]")
_FOREIGN_TO_PIECES = re.compile(r"[^A-Za-z0-9_+\-*/^()., <>=]")
#: Characters of a formula, and how deeply it may be nested: far below what Python recurses to, 1000.
_LONGEST, _DEEPEST = 1000, 200


class Reader:
    """Parses a text and checks every node against what is allowed."""

    def __init__(self, text: str, prefix: str, variables: Sequence[str] = VARIABLES, pieces: bool = False) -> None:
        self.text = expect(text, str, f"{prefix}a formula", "give a text, such as '0.1 * x'")
        self.prefix = prefix
        self.variables = tuple(variables)
        self.pieces = pieces
        code, self.places = "", []
        for index, character in enumerate(text):
            piece = "**" if character == "^" else " " if character.isspace() else character
            code += piece
            self.places += [index] * len(piece)
        self.skipped = len(code) - len(code.lstrip())
        self.code = code.strip()

    def error(self, what: str, column: int | None = None) -> ProblemError:
        """The error to raise; ``column`` counts from zero in the code that is parsed."""
        where = ""
        if column is not None and self.places:
            index = min(max(column + self.skipped, 0), len(self.places) - 1)
            where = f" at character {self.places[index] + 1}"
        return ProblemError(f"{self.prefix}formula '{shown(self.text)}'{where}: {what}")

    def graph(self) -> tuple[Graph, int]:
        """The formula as a node of a graph."""
        tree = self.tree()
        graph = Graph(f"{self.prefix}formula '{shown(self.text)}': ")
        return graph, _planted(tree, graph)

    def tree(self) -> ast.expr:
        if not self.code:
            raise self.error(f"it is empty; give a number or a formula of {' and '.join(self.variables[:2])}")
        if len(self.code) > _LONGEST:
            raise self.error(f"it has {len(self.code)} characters; at most {_LONGEST} are read: shorten it")
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
                raise self.error("True and False are not numbers; write 1 and 0", node.col_offset)
            case ast.Constant(value=int() | float() as value):
                written = self.code[node.col_offset : node.end_col_offset]
                if not re.fullmatch(r"[0-9.]+(?:[eE][+-]?[0-9]+)?", written):
                    raise self.error(f"'{written}' is not a number; write it in decimal digits", node.col_offset)
                try:
                    finite = bool(np.isfinite(float(value)))
                except OverflowError:
                    finite = False
                if not finite:
                    raise self.error("the number is too large; take other units", node.col_offset)
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
                raise self.error("comparisons are allowed in piecewise((value, condition), ...) only", node.col_offset)
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
                    f"this entry of {_PIECEWISE} is never reached because the one before it holds everywhere (True); "
                    f"put it first, or leave it out",
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
                    raise self.error("this is not a condition; write one with < <= > >=, or True", other.col_offset)

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
                functools.reduce(lambda a, b: graph.node(name, a, b), [_planted(branch, graph) for branch in several])
                if (len(several) > 1)
                else graph.node(name, _planted(several[0], graph))
            )
    raise AssertionError(f"unchecked node {tree!r}")  # pragma: no cover


def shown(text: str) -> str:
    """A formula as it may stand in a message."""
    short = text if len(text) <= 60 else text[:57] + "..."
    return "".join(c if c.isprintable() else " " for c in short)


def _hint(name: str, known: Sequence[str]) -> str:
    close = difflib.get_close_matches(name, known, n=1)
    return f"; did you mean '{close[0]}'?" if close else f"; use {', '.join(known)}"
