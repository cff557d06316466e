"""Potentials of the penetration r and the length s >= 0 of the slip: by a formula, or by Python functions.

What they are worth at r = 0 and s = 0 is that of the side asked for: places nearer to zero than a tiny part of the
reach are moved there, so that conditions such as ``r < 0`` choose one side and quotients stay finite.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from hemivar.basics.types import Array
from hemivar.errors import ProblemError
from hemivar.formula.graph import Graph
from hemivar.formula.poles import pole_in_box, pole_words
from hemivar.formula.reader import Reader, shown

__all__ = ["FormulaPotential", "FunctionPotential", "PlanePotential", "PotentialFunction"]

#: What a user gives: arrays r and s of one shape in, values out.
PotentialFunction = Callable[[Array, Array], ArrayLike]
#: Step of central differences, as a part of the reach: near the cube root of rounding, where their error is least.
_STEP = 1e-6
#: Poles nearer to r = 0 or s = 0 than this part of the reach are not looked for.
_NEAR = 1e-9


class PlanePotential(Protocol):
    """f(r, s) with derivatives; arrays of one shape, with ``r != 0`` and ``s > 0``."""

    @property
    def shown(self) -> str:
        """What messages call it."""

    @property
    def exact(self) -> bool:
        """Whether second derivatives are exact, not found by differences."""

    def value(self, r: Array, s: Array) -> Array:
        """f, of the shape of r."""

    def gradient(self, r: Array, s: Array) -> tuple[Array, Array]:
        """f_r and f_s."""

    def hessian(self, r: Array, s: Array) -> tuple[Array, Array, Array]:
        """f_rr, f_rs and f_ss."""


@dataclass(frozen=True, eq=False)
class FormulaPotential:
    """A formula of r and s, with derivatives in symbols."""

    text: str
    where: str = ""
    graph: Graph = field(init=False, repr=False)
    #: f, f_r, f_s, f_rr, f_rs, f_ss.
    nodes: tuple[int, ...] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        prefix = f"{self.where}: " if self.where else ""
        graph, node = Reader(self.text, prefix, ("r", "s"), pieces=True).graph()
        object.__setattr__(self, "graph", graph)
        object.__setattr__(self, "nodes", self.derivatives(node))

    def derivatives(self, node: int) -> tuple[int, ...]:
        """A node with its derivatives up to the second."""
        of = self.graph.derivative
        by_r, by_s = of(node, "r"), of(node, "s")
        return node, by_r, by_s, of(by_r, "r"), of(by_r, "s"), of(by_s, "s")

    @property
    def shown(self) -> str:
        return f"{self.where}: formula '{shown(self.text)}'" if self.where else f"formula '{shown(self.text)}'"

    @property
    def exact(self) -> bool:
        return True

    def refuse_pole(self, reach: float, rigid: bool) -> None:
        """Refuse a pole away from r = 0 and s = 0, up to the reach."""
        near = _NEAR * reach
        line = np.geomspace(near, reach, 20)
        r, s = (x.ravel() for x in np.meshgrid(line, line))
        for sign in (-1.0,) if rigid else (-1.0, 1.0):
            branches = np.unique(self.graph.branches_at(self.nodes[0], {"r": sign * r, "s": s}))
            node = int(branches[0]) if branches.size == 1 else self.nodes[0]
            low, high = sorted((sign * near, sign * reach))
            sides = {"r": (low, high), "s": (near, reach)}
            pole = pole_in_box(self.graph, node, sides, lambda at: at[:, 1] > 0.0)
            if pole is not None:
                raise ProblemError(f"{self.shown} {pole_words(pole)}; or take a smaller reach")

    def _of(self, node: int, r: Array, s: Array) -> Array:
        with np.errstate(all="ignore"):
            values = np.asarray(self.graph.value(node, {"r": r, "s": s}), dtype=float)
        return np.broadcast_to(values, r.shape)

    def value(self, r: Array, s: Array) -> Array:
        return self._of(self.nodes[0], r, s)

    def gradient(self, r: Array, s: Array) -> tuple[Array, Array]:
        return self._of(self.nodes[1], r, s), self._of(self.nodes[2], r, s)

    def hessian(self, r: Array, s: Array) -> tuple[Array, Array, Array]:
        return self._of(self.nodes[3], r, s), self._of(self.nodes[4], r, s), self._of(self.nodes[5], r, s)


@dataclass(frozen=True, eq=False)
class FunctionPotential:
    """Python functions of r and s; second derivatives that are not given by differences on one side of 0."""

    potential: PotentialFunction
    slopes: PotentialFunction  # f_r and f_s
    bends: PotentialFunction | None  # f_rr, f_rs and f_ss
    reach: float
    name: str

    @property
    def shown(self) -> str:
        return f"the potential of law '{self.name}'"

    @property
    def exact(self) -> bool:
        return self.bends is not None

    def _called(self, function: PotentialFunction, what: str, count: int, r: Array, s: Array) -> list[Array]:
        """What a function returns, as so many arrays of the shape of r."""
        try:
            with np.errstate(all="ignore"):
                given = function(r, s)
            parts = [given] if count == 1 else list(given)  # type: ignore[arg-type]
            if len(parts) != count:
                raise TypeError(f"{len(parts)} arrays")
            if any(np.iscomplexobj(part) for part in parts):
                raise TypeError("complex numbers")
            return [np.broadcast_to(np.asarray(part, dtype=float), r.shape) for part in parts]
        except ProblemError:
            raise
        except Exception as error:
            wanted = "one array" if count == 1 else f"{count} arrays"
            raise ProblemError(
                f"the {what} of law '{self.name}' must return {wanted} of the shape of r and s ({error})"
            ) from error

    def value(self, r: Array, s: Array) -> Array:
        return self._called(self.potential, "potential", 1, r, s)[0]

    def gradient(self, r: Array, s: Array) -> tuple[Array, Array]:
        by_r, by_s = self._called(self.slopes, "gradient", 2, r, s)
        return by_r, by_s

    def hessian(self, r: Array, s: Array) -> tuple[Array, Array, Array]:
        if self.bends is not None:
            rr, rs, ss = self._called(self.bends, "hessian", 3, r, s)
            return rr, rs, ss
        h = _STEP * np.maximum(self.reach, np.maximum(np.abs(r), s))
        side = np.where(r < 0.0, -1.0, 1.0)
        first, last = np.maximum(side * r - h, 0.25 * np.minimum(side * r, h)), side * r + h
        low, high = np.maximum(s - h, 0.25 * np.minimum(s, h)), s + h
        along_r = [self.gradient(side * x, s) for x in (first, last)]
        along_s = [self.gradient(r, x) for x in (low, high)]
        rr = side * (along_r[1][0] - along_r[0][0]) / (last - first)
        ss = (along_s[1][1] - along_s[0][1]) / (high - low)
        rs = (along_s[1][0] - along_s[0][0]) / (high - low)
        return rr, rs, ss
