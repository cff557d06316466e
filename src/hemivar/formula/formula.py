"""Formulas of place and time, and those of one variable, given piece by piece, for laws and friction bounds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from hemivar.basics.arguments import one_line
from hemivar.basics.types import Array, BoolArray
from hemivar.errors import ProblemError
from hemivar.formula.expansion import Expansion, expansion
from hemivar.formula.graph import Graph
from hemivar.formula.poles import pole_of_pieces
from hemivar.formula.reader import TIME, VARIABLES, Reader, shown
from hemivar.formula.slopes import slopes
from hemivar.formula.smooth import SmoothFormula
from hemivar.formula.switches import Switches

__all__ = ["Formula", "FormulaArray", "ScalarFormula"]


@dataclass(frozen=True)
class Formula:
    """A number that varies in space, such as ``0.1 * x * (1 - x)``, or in time, such as ``min(t, 1)``.

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
        value is not finite or too small, where the message names the point, or if it uses t and no time is given.
    """

    text: str
    where: str = ""
    minimum: float | None = None
    _graph: Graph = field(init=False, repr=False, compare=False)
    _node: int = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        one_line(self.where, "where")
        graph, node = Reader(self.text, self._prefix, (*VARIABLES, TIME)).graph()
        object.__setattr__(self, "_graph", graph)
        object.__setattr__(self, "_node", node)

    @property
    def _prefix(self) -> str:
        return f"{self.where}: " if self.where else ""

    @property
    def variables(self) -> frozenset[str]:
        """Names of the coordinates, and of the time, that occur in the formula."""
        return self._graph.names(self._node)

    def kinks_in_time(self, start: float, end: float) -> tuple[Array, bool]:
        """Times at which the branch of an ``abs``, ``min`` or ``max`` may change everywhere at once.

        What is compared there depends on t alone; where it depends on the place as well, the kink moves through the
        body, and no time is given.

        Parameters
        ----------
        start, end : float

        Returns
        -------
        times : array (k,)
            Increasing, between start and end.
        sure : bool
            Whether none is missing; False where what is compared is too intricate, or changes too often.
        """
        reach = max(abs(start), abs(end))
        alone = [node for node in self._graph.switching(self._node) if self._graph.names(node) == frozenset({TIME})]
        if not alone or not 0.0 < reach < np.inf:
            return np.zeros(0), True
        switches = Switches(self._graph, TIME, reach, f"{self._prefix}formula '{shown(self.text)}'")
        try:
            times = np.unique(np.concatenate([switches.zeros(node) for node in alone]))
        except ProblemError:
            return np.zeros(0), False
        return times[(times > start) & (times < end)], switches.sure

    def refuse_pole_in_time(self, start: float, end: float) -> None:
        """Refuse a formula of t alone that has a pole, or no value, between two times.

        Raises
        ------
        ProblemError
            With the time.
        """
        reach = max(abs(start), abs(end))
        if self.variables != frozenset({TIME}) or not 0.0 < reach < np.inf:
            return
        name = f"{self._prefix}formula '{shown(self.text)}'"
        try:
            places = Switches(self._graph, TIME, reach, name).breaks(self._node)
        except ProblemError:  # it changes its branch too often to be looked at
            return
        ends = np.concatenate([[start], places[(places > start) & (places < end)], [end]])
        nodes = self._graph.branches(self._node, TIME, 0.5 * (ends[1:] + ends[:-1])).tolist()
        pieces = [SmoothFormula(self._graph, node, TIME) for node in nodes]
        pole = pole_of_pieces(pieces, ends, reach)
        if pole is not None and pole.sure:
            raise ProblemError(f"{name} {pole.words(TIME, 'an end of the time')}")

    def __call__(self, points: Array, t: float | None = None) -> Array:
        """Values (k,) at points (k, d), and at a time if the formula uses t."""
        points = np.asarray(points, dtype=float)
        at = dict(zip(VARIABLES, points.T, strict=False))
        if t is not None:
            at[TIME] = np.array(float(t))
        missing = sorted(self.variables - set(at))
        if missing == [TIME]:
            raise ProblemError(
                f"{self._prefix}formula '{self.text}' uses t, but no time is given; take the problem at one time "
                "(problem.at_time), or a formula of the place alone"
            )
        if missing:
            raise ProblemError(
                f"{self._prefix}formula '{self.text}' uses {missing[0]}, but the points have only "
                f"{points.shape[1]} coordinates; use {', '.join(at)}"
            )
        with np.errstate(all="ignore"):
            values = np.asarray(self._graph.value(self._node, at), dtype=float)
        values = np.broadcast_to(values, (len(points),)).copy()
        when = t if TIME in self.variables else None
        self._check(values, points, ~np.isfinite(values), "give a formula that is finite there", when)
        if self.minimum is not None:
            self._check(values, points, values < self.minimum, f"it must be at least {self.minimum:g}", when)
        return values

    def gradient(self, points: Array) -> Array:
        """Derivatives by the coordinates, exact but for rounding; at kinks the mean of both sides.

        Parameters
        ----------
        points : array, shape (k, d)

        Returns
        -------
        array, shape (k, d)

        Raises
        ------
        ProblemError
            As a call; or a derivative is not finite.
        """
        self(points)
        points = np.asarray(points, dtype=float)
        at = dict(zip(VARIABLES, points.T, strict=False))
        with np.errstate(all="ignore"):
            partial = slopes(self._graph, self._node, at, list(at))
        rates = np.column_stack([np.broadcast_to(rate, (len(points),)) for rate in partial])
        bad = ~np.isfinite(rates).all(axis=1)
        if bad.any():
            words = ", ".join(f"{name} = {c:.6g}" for name, c in zip(VARIABLES, points[np.argmax(bad)], strict=False))
            raise ProblemError(f"{self._prefix}formula '{self.text}' has no finite derivative at {words}")
        return rates

    def expansion(self, corners: Array, t: float | None = None) -> Expansion:
        """Quadratic polynomials near to the formula on simplices, with a proved bound of the difference.

        Parameters
        ----------
        corners : array, shape (k, p + 1, d)
            Of k simplices of dimension p.
        t : float, optional
            The time, if the formula uses it.
        """
        places: dict[str, Array | float] = dict(zip(VARIABLES, np.moveaxis(corners, 2, 0), strict=False))
        if t is not None:
            places[TIME] = float(t)
        return expansion(self._graph, self._node, places)

    def _check(self, values: Array, points: Array, bad: BoolArray, remedy: str, t: float | None) -> None:
        if bad.any():
            first = int(np.argmax(bad))
            named = [*zip(VARIABLES, points[first], strict=False), *([(TIME, t)] if t is not None else [])]
            words = ", ".join(f"{name} = {c:.6g}" for name, c in named)
            raise ProblemError(f"{self._prefix}formula '{self.text}' is {values[first]:.6g} at {words}; {remedy}")


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

    @property
    def variables(self) -> frozenset[str]:
        """Names of the coordinates, and of the time, that occur in the entries."""
        return frozenset().union(*(entry.variables for entry in self.entries if isinstance(entry, Formula)))

    def __call__(self, points: Array, t: float | None = None) -> Array:
        """Values at points, shape (k, d), and at a time if an entry uses t; shape (k, *shape)."""
        columns = [
            entry(points, t) if isinstance(entry, Formula) else np.full(len(points), float(entry))
            for entry in self.entries
        ]
        return np.stack(columns, axis=-1).reshape(len(points), *self.shape)


@dataclass(frozen=True)
class ScalarFormula:
    """A function of one variable, such as ``piecewise((0, r < 0), (10*r^2, r < 0.1), (0.1, True))``.

    The functions are those of :class:`Formula` and ``piecewise((value, condition), ..., last)``, whose conditions
    compare (``<  <=  >  >=``, also ``0 <= r < 1``) and are tried from the left; the last entry may be a plain value,
    which holds everywhere else, and so does the condition ``True``.
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
        """Where branches may change: zeros of what abs, min, max and conditions compare, and whether none is missing.

        They lie within the reach, and far beyond where what is compared is linear; one is missing at most where a
        difference is too intricate, and was sampled.
        """
        own = Switches(self.graph, self.variable, reach, self.shown)
        return own.breaks(self.node), own.sure

    def branches(self, places: Array) -> list[SmoothFormula]:
        """The functions without switches that hold around some places."""
        nodes = self.graph.branches(self.node, self.variable, np.asarray(places, dtype=float))
        return [SmoothFormula(self.graph, node, self.variable) for node in nodes.tolist()]

    def branch(self, at: float) -> SmoothFormula:
        """The function without switches that holds around ``place``."""
        return self.branches(np.array([at]))[0]
