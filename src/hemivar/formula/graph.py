"""Expressions as graphs whose nodes share their common parts.

Values, derivatives and branches, and enclosures by :mod:`hemivar.formula.enclosure`, are computed node by node, so that
the work grows with the number of different parts and not with the length of what is written out.
"""

from __future__ import annotations

import ast
import functools
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import cast

import numpy as np

from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.errors import ProblemError

__all__ = ["OPERATIONS", "Graph", "Leaf", "Step", "Value"]

#: A number, or the name of a variable.
Leaf = float | str
#: A node, its operation, its arguments, its leaf, and the nodes that nobody needs after it.
Step = tuple[int, str, tuple[int, ...], Leaf, tuple[int, ...]]
#: What a node is worth, or whether a condition holds, at one place or at several.
Value = Array | BoolArray | np.float64 | np.bool_

#: Nodes that a graph may have, derivatives included.
_MOST_NODES = 6_000
#: Longest text, in nodes, that is written out.
_LONGEST_TEXT = 150

_SYMBOLS: Mapping[str, ast.operator] = {
    "+": ast.Add(),
    "-": ast.Sub(),
    "*": ast.Mult(),
    "/": ast.Div(),
    "^": ast.Pow(),
}
#: What an operator or a function of a formula does to arrays.
OPERATIONS: Mapping[str, np.ufunc] = {
    "+": np.add,
    "-": np.subtract,
    "*": np.multiply,
    "/": np.divide,
    "^": np.power,
    "neg": np.negative,
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
    "<": np.less,
    "<=": np.less_equal,
    ">": np.greater,
    ">=": np.greater_equal,
    "and": np.logical_and,
}
_COMPARISONS = frozenset({"<", "<=", ">", ">="})
_SWITCHES = frozenset({"abs", "min", "max", "piecewise"})


class Graph:
    """The nodes of some expressions; every one is a number that is larger than those of its arguments."""

    def __init__(self, prefix: str = "") -> None:
        self.prefix = prefix
        #: Nodes times intervals enclosed for the present question; whoever encloses adds to it, and stops in time.
        self.work = 0.0
        self._nodes: list[tuple[str, tuple[int, ...], Leaf]] = []
        self._varies: list[bool] = []
        self._index: dict[tuple[str, tuple[int, ...], Leaf], int] = {}
        self._derivatives: dict[str | None, dict[int, int]] = {}
        self._programs: dict[int, list[Step]] = {}
        self._gathered: dict[int, int] = {}
        self._factors: dict[int, Counter[int]] = {}

    # ---- making nodes ----------------------------------------------------------------------------------------

    def node(self, op: str, *arguments: int, leaf: Leaf = 0.0) -> int:
        """The node of an operation, as it is written: an old one if there is one."""
        key = (op, arguments, leaf if leaf == leaf else "nan")
        known = self._index.get(key)
        if known is not None:
            return known
        if len(self._nodes) >= _MOST_NODES:
            raise ProblemError(
                f"{self.prefix}the formula and its derivatives have more than {_MOST_NODES} parts; simplify it, or "
                f"give a table"
            )
        self._nodes.append((op, arguments, leaf))
        self._varies.append(op == "name" or any(self._varies[a] for a in arguments))
        self._index[key] = len(self._nodes) - 1
        return len(self._nodes) - 1

    def number(self, value: float) -> int:
        """The node of a number."""
        return self.node("number", leaf=float(value) + 0.0)

    def name(self, name: str) -> int:
        """The node of a variable."""
        return self.node("name", leaf=name)

    def constant(self, node: int) -> bool:
        """Whether no variable occurs."""
        return not self._varies[node]

    def names(self, node: int) -> frozenset[str]:
        """The variables that occur."""
        return frozenset(str(leaf) for _, op, _, leaf, _ in self.program(node) if op == "name")

    def _plain(self, node: int) -> float | None:
        op, _, leaf = self._nodes[node]
        return float(leaf) if op == "number" else None

    def _negated(self, node: int) -> int | None:
        """What a node is the negative of."""
        op, arguments, _ = self._nodes[node]
        return arguments[0] if op == "neg" else None

    def negative(self, a: int) -> int:
        """-a, simplified."""
        plain, inner = self._plain(a), self._negated(a)
        if plain is not None:
            return self.number(-plain)
        return inner if inner is not None else self.node("neg", a)

    def plus(self, a: int, b: int) -> int:
        """a + b, simplified."""
        x, y, inner = self._plain(a), self._plain(b), self._negated(b)
        if x == 0.0:
            return b
        if y == 0.0:
            return a
        if inner is not None:
            return self.minus(a, inner)
        return self.number(x + y) if x is not None and y is not None else self.node("+", a, b)

    def minus(self, a: int, b: int) -> int:
        """a - b, simplified."""
        x, y, inner = self._plain(a), self._plain(b), self._negated(b)
        if y == 0.0:
            return a
        if a == b:
            return self.number(0.0)
        if x == 0.0:
            return self.negative(b)
        if inner is not None:
            return self.plus(a, inner)
        return self.number(x - y) if x is not None and y is not None else self.node("-", a, b)

    def times(self, a: int, b: int) -> int:
        """a b, simplified; a number comes first."""
        x, y = self._plain(a), self._plain(b)
        if x == 0.0 or y == 0.0:
            return self.number(0.0)
        if x == 1.0:
            return b
        if y == 1.0:
            return a
        if y is not None and x is None:
            a, b, x, y = b, a, y, x
        if x == -1.0:
            return self.negative(b)
        for left, right in ((a, b), (b, a)):
            if (inner := self._negated(left)) is not None:
                return self.negative(self.times(inner, right))
        op, arguments, _ = self._nodes[b]
        if x is not None and op == "*" and (first := self._plain(arguments[0])) is not None:
            return self.times(self.number(x * first), arguments[1])
        return self.number(x * y) if x is not None and y is not None else self.node("*", a, b)

    def over(self, a: int, b: int) -> int:
        """a / b, simplified."""
        if self._plain(a) == 0.0:
            return self.number(0.0)
        return a if self._plain(b) == 1.0 else self.node("/", a, b)

    def power(self, a: int, b: int) -> int:
        """a^b, simplified."""
        exponent = self._plain(b)
        if exponent == 0.0:
            return self.number(1.0)
        return a if exponent == 1.0 else self.node("^", a, b)

    def size(self, node: int) -> int:
        """Number of different parts."""
        return len(self.program(node))

    # ---- for intervals ---------------------------------------------------------------------------------------

    def gathered(self, node: int) -> int:
        """The same with a power in place of factors that are alike: bounds of ``u * u`` do not know that both are one.

        An expression stays as it is where the graph would grow too large.
        """
        known = self._gathered
        if node not in known:
            if 2 * (len(self._nodes) + self.size(node)) > _MOST_NODES:
                return node
            for i, op, arguments, leaf, _ in self.program(node):
                if i not in known:
                    known[i] = self._with_powers(op, [known[a] for a in arguments], leaf)
        return known[node]

    def _with_powers(self, op: str, arguments: Sequence[int], leaf: Leaf) -> int:
        node = self.node(op, *arguments, leaf=leaf)
        inner = [self._factors.get(a, Counter([a])) for a in arguments]
        if op == "*":
            factors = inner[0] + inner[1]
            if max(factors.values()) > 1:
                powers = [self.power(base, self.number(count)) for base, count in factors.items()]
                node = functools.reduce(lambda a, b: self.node("*", a, b), powers)
        elif op == "neg":
            factors = inner[0] + Counter([self.number(-1.0)])
        elif op == "/" and self.constant(arguments[1]):
            factors = inner[0] + Counter([self.node("/", self.number(1.0), arguments[1])])
        elif op == "^" and (n := self._plain(arguments[1])) is not None and n == round(n) and n > 0.0:
            factors = Counter({base: count * int(n) for base, count in inner[0].items()})
        else:
            factors = Counter([node])
        self._factors[node] = factors
        return node

    # ---- values ----------------------------------------------------------------------------------------------

    def program(self, node: int) -> list[Step]:
        """The nodes below a node in order, each with the nodes that nobody needs after it."""
        known = self._programs.get(node)
        if known is not None:
            return known
        needed, stack = {node}, [node]
        while stack:
            for argument in self._nodes[stack.pop()][1]:
                if argument not in needed:
                    needed.add(argument)
                    stack.append(argument)
        order = sorted(needed)
        last = {argument: i for i in order for argument in self._nodes[i][1]}
        program = [
            (i, *self._nodes[i], tuple(a for a in dict.fromkeys(self._nodes[i][1]) if last[a] == i)) for i in order
        ]
        self._programs[node] = program
        return program

    def value(self, node: int, at: Mapping[str, Array]) -> Value:
        """The value for values of the variables: numbers or arrays of one shape; nan where there is none."""
        kept: dict[int, Value] = {}
        for i, op, arguments, leaf, done in self.program(node):
            kept[i] = _applied(op, leaf, [kept[a] for a in arguments], at)
            for a in done:
                del kept[a]
        return kept[node]

    def text(self, node: int) -> str:
        """The expression as it is written; ``...`` where that is long."""
        sizes: dict[int, int] = {}
        for i, _, arguments, _, _ in self.program(node):
            sizes[i] = 1 + sum(sizes[a] for a in arguments)
        if sizes[node] > _LONGEST_TEXT:
            return "..."
        return ast.unparse(ast.fix_missing_locations(self._tree(node))).replace("**", "^")

    def _tree(self, node: int) -> ast.expr:
        op, arguments, leaf = self._nodes[node]
        if op == "number":
            return ast.Constant(value=float(leaf))
        if op == "name":
            return ast.Name(id=str(leaf), ctx=ast.Load())
        inner = [self._tree(a) for a in arguments]
        if op == "neg":
            return ast.UnaryOp(op=ast.USub(), operand=inner[0])
        if op in _SYMBOLS:
            return ast.BinOp(left=inner[0], op=_SYMBOLS[op], right=inner[1])
        return ast.Call(func=ast.Name(id=op, ctx=ast.Load()), args=inner, keywords=[])

    # ---- derivatives -----------------------------------------------------------------------------------------

    def derivative(self, node: int, by: str | None = None) -> int:
        """The derivative of an expression in its only variable, or in one of several, in symbols.

        That of ``abs``, ``min`` and ``max`` is that of the branch taken; at a kink, of one of both.
        """
        known = self._derivatives.setdefault(by, {})
        if node in known:
            return known[node]
        for i, op, arguments, leaf, _ in self.program(node):
            if i in known:
                continue
            if not self._varies[i]:
                known[i] = self.number(0.0)
            elif op == "name":
                known[i] = self.number(1.0 if by is None or leaf == by else 0.0)
            else:
                known[i] = self._derived(i, op, arguments, [known[a] for a in arguments])
        return known[node]

    def _derived(self, node: int, op: str, arguments: Sequence[int], rates: Sequence[int]) -> int:
        one, two = self.number(1.0), self.number(2.0)
        if op == "piecewise":
            return self._chosen(arguments, {k: rate for k, rate in enumerate(rates) if k % 2 or k == len(rates) - 1})
        if op in _COMPARISONS or op in ("and", "true"):
            return self.number(0.0)  # of no use: conditions stay as they are
        if op in ("min", "max"):
            first = self.node("<=" if op == "min" else ">=", *arguments)
            return self._chosen((first, *arguments), {1: rates[0], 2: rates[1]})
        if op in ("+", "-", "*", "/", "^"):
            (a, b), (da, db) = arguments, rates
            if op == "+":
                return self.plus(da, db)
            if op == "-":
                return self.minus(da, db)
            if op == "*":
                return self.plus(self.times(da, b), self.times(a, db))
            if op == "/":
                first = self.over(da, b)
                if not self._varies[b]:
                    return first
                return self.minus(first, self.over(self.times(a, db), self.power(b, two)))
            if not self._varies[b]:
                return self.times(self.times(b, self.power(a, self.minus(b, one))), da)
            by_exponent = self.times(db, self.node("log", a))
            return self.times(node, self.plus(by_exponent, self.over(self.times(b, da), a)))
        (u,), (du,) = arguments, rates
        match op:
            case "neg":
                return self.negative(du)
            case "sin":
                outer = self.node("cos", u)
            case "cos":
                outer = self.negative(self.node("sin", u))
            case "tan":
                outer = self.plus(one, self.power(node, two))
            case "tanh":
                outer = self.minus(one, self.power(node, two))
            case "exp":
                outer = node
            case "log":
                return self.over(du, u)
            case "abs":
                return self._chosen((self.node(">=", u, self.number(0.0)), u, u), {1: du, 2: self.negative(du)})
            case "sqrt":
                return self.over(du, self.times(two, node))
            case _:  # pragma: no cover
                raise AssertionError(f"no derivative of {op}")
        return self.times(outer, du)

    def _chosen(self, arguments: Sequence[int], values: Mapping[int, int]) -> int:
        """What piecewise is with other values; one of them where they are all the same."""
        if len(set(values.values())) == 1 and len(arguments) % 2:
            return next(iter(values.values()))
        return self.node("piecewise", *(values.get(k, argument) for k, argument in enumerate(arguments)))

    # ---- switches --------------------------------------------------------------------------------------------

    def switching(self, node: int) -> list[int]:
        """Nodes whose zeros are the places where a switch below a node may change."""
        switches: dict[int, None] = {}
        for _, op, arguments, _, _ in self.program(node):
            if op == "abs":
                switches[arguments[0]] = None
            elif op in ("min", "max") or op in _COMPARISONS:
                switches[self.minus(*arguments)] = None
        return list(switches)

    def branches(self, node: int, variable: str, places: Array) -> IntArray:
        """The nodes without switches that hold at some places, one for each of them."""
        return self.branches_at(node, {variable: places})

    def branches_at(self, node: int, at: Mapping[str, Array]) -> IntArray:
        """As :meth:`branches`, for values (k,) of several variables."""
        program, size = self.program(node), next(iter(at.values())).size
        if not any(op in _SWITCHES for _, op, _, _, _ in program):
            return np.full(size, node, dtype=np.int64)
        kept: dict[int, Value] = {}
        taken: list[tuple[int, str, tuple[int, ...], IntArray]] = []
        with np.errstate(all="ignore"):
            for i, op, arguments, leaf, _ in program:
                inner = [kept[a] for a in arguments]
                value = _applied(op, leaf, inner, at)
                kept[i] = cast(Array, np.broadcast_to(value, (size,)))
                if op == "abs":
                    taken.append((i, op, arguments, np.where(inner[0] >= 0.0, 0, 1)))
                elif op in ("min", "max"):
                    second = inner[1] < inner[0] if op == "min" else inner[1] > inner[0]
                    taken.append((i, op, arguments, np.where(second, 1, 0)))
                elif op == "piecewise":
                    taken.append((i, op, arguments, _first_true(inner, size)))
        choices = np.stack([choice for *_, choice in taken], axis=1)
        rows, which = np.unique(choices, axis=0, return_inverse=True)
        resolved = [
            self._resolved(program, {i: int(c) for (i, *_), c in zip(taken, row, strict=True)}, node) for row in rows
        ]
        return np.array(resolved, dtype=np.int64)[which.ravel()]

    def _resolved(self, program: Sequence[Step], choice: Mapping[int, int], node: int) -> int:
        new: dict[int, int] = {}
        for i, op, arguments, leaf, _ in program:
            if i in choice:
                take = choice[i]
                if op == "abs":
                    new[i] = self.negative(new[arguments[0]]) if take else new[arguments[0]]
                elif op == "piecewise":
                    new[i] = new[arguments[take]] if take >= 0 else self.node("number", leaf=float("nan"))
                else:
                    new[i] = new[arguments[take]]
            elif op == "neg":
                new[i] = self.negative(new[arguments[0]])
            elif op in _COMPARISONS or op in ("and", "true"):
                new[i] = i
            else:
                new[i] = self.node(op, *(new[a] for a in arguments), leaf=leaf)
        return new[node]


def _applied(op: str, leaf: Leaf, inner: list[Value], at: Mapping[str, Array]) -> Value:
    if op == "number":
        return np.float64(leaf)
    if op == "name":
        return at[str(leaf)]
    if op == "true":
        return np.bool_(True)
    if op == "piecewise":
        chosen: Value = np.float64("nan")
        pairs = len(inner) // 2
        if len(inner) % 2:
            chosen = inner[-1]
        for k in reversed(range(pairs)):
            chosen = np.where(inner[2 * k], inner[2 * k + 1], chosen)
        return chosen
    value: Value = OPERATIONS[op](*inner)
    return value


def _first_true(inner: Sequence[Value], size: int) -> IntArray:
    """Which argument of piecewise (condition, value, condition, value, ..., last) holds; -1 for none."""
    out = np.full(size, len(inner) - 1 if len(inner) % 2 else -1, dtype=np.int64)
    for k in reversed(range(len(inner) // 2)):
        out = np.where(np.broadcast_to(inner[2 * k], (size,)), 2 * k + 1, out)
    return out
