"""Conditions on a place, such as ``x > 39.9 and y < 2``."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from functools import reduce

import numpy as np

from hemivar.basics.arguments import expect
from hemivar.basics.types import Array, BoolArray
from hemivar.errors import ProblemError
from hemivar.formula.formula import Formula
from hemivar.formula.reader import shown

__all__ = ["Condition"]

_COMPARED = {"<": np.less, "<=": np.less_equal, ">": np.greater, ">=": np.greater_equal}
_SIGNS = re.compile(r"(<=|>=|<|>)")
#: One comparison, or a chain of them such as ``1 < x <= 2``: formulas and the signs between them.
_Chain = tuple[list[Formula], list[str]]


@dataclass(frozen=True)
class Condition:
    """Where formulas of the place compare so: by ``< <= > >=``, joined by ``and`` and ``or`` (which binds less)."""

    text: str
    where: str = ""
    _clauses: list[list[_Chain]] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        text = expect(self.text, str, f"{self.where}: a condition", "give a text, such as 'x > 1'")
        clauses = [[self._chain(part) for part in re.split(r"\band\b", clause)] for clause in re.split(r"\bor\b", text)]
        object.__setattr__(self, "_clauses", clauses)

    def _chain(self, text: str) -> _Chain:
        words = _SIGNS.split(text)
        if len(words) < 3 or "==" in text:
            raise ProblemError(
                f"{self.where}: '{shown(text.strip())}' is not a condition; compare by < or >, such as 'x > 39.9', and "
                "write abs(x - 1) < 1e-6 for 'equal'"
            )
        return [Formula(word.strip(), self.where) for word in words[::2]], words[1::2]

    def __call__(self, points: Array) -> BoolArray:
        """Whether it holds at points (k, d), (k,)."""
        every = [[self._holds(chain, points) for chain in clause] for clause in self._clauses]
        return reduce(np.logical_or, [reduce(np.logical_and, clause) for clause in every])

    def _holds(self, chain: _Chain, points: Array) -> BoolArray:
        values, signs = [formula(points) for formula in chain[0]], chain[1]
        sides = zip(values[:-1], signs, values[1:], strict=True)
        return reduce(np.logical_and, [_COMPARED[sign](left, right) for left, sign, right in sides])
