"""Formulas of the place x, y, z, and those of one variable, given piece by piece, for laws and friction bounds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from hemivar.basics.types import Array, BoolArray
from hemivar.errors import ProblemError
from hemivar.formula.graph import Graph
from hemivar.formula.reader import VARIABLES, Reader, shown
from hemivar.formula.smooth import SmoothFormula
from hemivar.formula.switches import Switches

__all__ = ["Formula", "FormulaArray", "ScalarFormula"]


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
        graph, node = Reader(self.text, self._prefix).graph()
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

    def _check(self, values: Array, points: Array, bad: BoolArray, remedy: str) -> None:
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
        graph, node = Reader(self.text, self.prefix, (self.variable,), pieces=True).graph()
        object.__setattr__(self, "graph", graph)
        object.__setattr__(self, "node", node)

    @property
    def prefix(self) -> str:
        """What stands before every message."""
        return f"{self.where}: " if self.where else ""

    @property
    def shown(self) -> str:
        """Name of the formula in messages."""
        return f"{self.prefix}formula '{shown(self.text)}'"

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
        found = Switches(self.graph, self.variable, reach, self.shown)
        return found.breaks(self.node), found.sure

    def branches(self, places: Array) -> list[SmoothFormula]:
        """The functions without switches that hold around some places."""
        nodes = self.graph.branches(self.node, self.variable, np.asarray(places, dtype=float))
        return [SmoothFormula(self.graph, node, self.variable) for node in nodes.tolist()]

    def branch(self, place: float) -> SmoothFormula:
        """The function without switches that holds around ``place``."""
        return self.branches(np.array([place]))[0]
