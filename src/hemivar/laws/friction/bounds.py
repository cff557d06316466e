"""State-dependent friction bounds (Coulomb and others): by the penetration or the pressure of the contact point.

With such a bound the law is a function of two arguments, J(w, v): it is frozen at a state w, which leaves an
ordinary law in v (:meth:`hemivar.laws.ContactLaw.frozen`), and the state is iterated.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from hemivar.basics.arrays import real_array
from hemivar.basics.first_use import cached_property
from hemivar.basics.portable import PickleMixin
from hemivar.basics.types import Array, BoolArray, IntArray, Parameter
from hemivar.errors import ProblemError
from hemivar.formula import Formula
from hemivar.formula.formula import ScalarFormula
from hemivar.formula.poles import Pole, pole_of_pieces
from hemivar.formula.smooth import WIDE, supremum_of_pieces
from hemivar.laws.parameters import checked_reach, evaluate
from hemivar.laws.proof import SAMPLED, Evidence, Proof, in_class_of, worst

__all__ = ["CoulombBound", "PenetrationBound", "StackedBound", "StateBound", "stack_bounds"]

#: What messages call it.
_COEFFICIENT = "coefficient of the Coulomb friction bound"


class StateBound(PickleMixin, ABC):
    """A friction bound h_tau(penetration, pressure) >= 0 at every contact point."""

    @abstractmethod
    def at(self, points: Array | None) -> StateBound:
        """The bound with every parameter evaluated at ``points (m, d)``."""

    @abstractmethod
    def take(self, index: IntArray) -> StateBound:
        """The bound at some of the contact points."""

    @abstractmethod
    def value(self, penetration: Array, pressure: Array) -> Array:
        """Bound in a state, shape (m,); never negative."""

    @property
    def least(self) -> Array:
        """What the bound is at least, whatever the state, shape (m or 1,)."""
        return np.zeros(1)

    @property
    def per_pressure(self) -> Array:
        """What a pressure raises the bound by at least, as a multiple of it, shape (m or 1,)."""
        return np.zeros(1)

    @property
    def proportional(self) -> bool:
        """Whether it is that multiple of the pressure, and zero where there is none."""
        return False

    @property
    def knots(self) -> Array:
        """Penetrations at which the derivative of the bound may jump, shape (m or 1, K); unused entries are +inf."""
        return np.zeros((1, 0))

    @property
    def straight(self) -> bool:
        """Whether it is known to be linear in the penetration between these."""
        return False

    @property
    @abstractmethod
    def lipschitz(self) -> Array:
        """Lipschitz constant in the penetration, shape (m or 1,); inf where the bound jumps or needs the pressure."""

    @property
    def proof(self) -> Proof:
        """How that constant is known: from samples, or up to some penetration only, it may be too small."""
        return in_class_of(self)

    @property
    def differentiable(self) -> bool:
        """Whether :meth:`slopes` answers: the bound does not jump, and its derivatives are known.

        Then Newton's equation contains the bound; else the bound is frozen, in a fixed point.
        """
        return False

    def slopes(self, penetration: Array, pressure: Array) -> tuple[Array, Array]:
        """Derivatives of the bound in penetration and pressure, (m,) each; at a kink those of one side.

        Raises
        ------
        ProblemError
            The bound is not :attr:`differentiable`.
        """
        raise _no_slopes()


@dataclass(frozen=True, eq=False)
class CoulombBound(StateBound):
    """Coulomb's law, quasi-variational: friction at most ``coefficient * max(pressure, 0)``.

    Parameters
    ----------
    coefficient : Parameter
        Friction coefficient mu >= 0.
    """

    coefficient: Parameter

    def __post_init__(self) -> None:
        if isinstance(self.coefficient, str):
            object.__setattr__(self, "coefficient", Formula(self.coefficient, _COEFFICIENT))

    def _coefficient(self, points: Array | None) -> Array:
        return evaluate(self.coefficient, points, _COEFFICIENT, 0.0)

    @cached_property
    def _known(self) -> Array:
        return self._coefficient(None)

    def at(self, points: Array | None) -> CoulombBound:
        return CoulombBound(self._coefficient(points))

    def take(self, index: IntArray) -> CoulombBound:
        mu = self._known
        return self if mu.size == 1 else CoulombBound(mu[index])

    def value(self, penetration: Array, pressure: Array) -> Array:
        return np.asarray(self._known * np.maximum(np.asarray(pressure, dtype=float), 0.0))

    @property
    def per_pressure(self) -> Array:
        return self._known

    @property
    def proportional(self) -> bool:
        return True

    @property
    def lipschitz(self) -> Array:
        return np.where(self._known > 0.0, np.inf, 0.0)

    @property
    def differentiable(self) -> bool:
        return True

    def slopes(self, penetration: Array, pressure: Array) -> tuple[Array, Array]:
        return np.zeros(np.shape(pressure)), np.where(pressure > 0.0, self._known, 0.0)


@dataclass(frozen=True, eq=False)
class PenetrationBound(StateBound):
    """Friction bound that depends on the penetration s.

    Parameters
    ----------
    source : table, text or function
        ``(s, bound)``, two sequences of equal length with s increasing (a repeated s is a jump), constant beyond the
        ends and linear in between; or a formula of s such as ``"min(8*s, 0.8)"``; or a Python function
        ``s (m,) -> bound (m,)``. Where s < 0 (no contact), negative values of a formula or function count as zero.
    reach : float
        For formulas and functions: penetrations up to which kinks are looked for and the bound is tried out.
    file : Path, optional
        Where a table comes from.

    Raises
    ------
    ProblemError
        A table that does not increase, is too short or is negative somewhere; a formula that is not understood; a
        formula or a function that, within the reach, is not finite or is negative at some s >= 0.  Beyond the reach
        :meth:`value` raises it.

    Notes
    -----
    The Lipschitz constant of a table is exact, and that of a formula a bound over all penetrations, found by interval
    arithmetic on its derivative.  Where no such bound is found it holds on ``[-reach, reach]`` only, and that of a
    function is the steepest slope that was met there: :attr:`proof` says so.
    """

    source: str | ScalarFormula | Callable[[Array], ArrayLike] | tuple[ArrayLike, ArrayLike]
    reach: float = 10.0
    file: Path | None = field(default=None, compare=False)
    _evaluate: Callable[[Array], Array] = field(init=False, repr=False)
    _lipschitz: float = field(init=False, repr=False)
    _proof: Proof = field(init=False, repr=False, default=Proof())

    def __post_init__(self) -> None:
        source = self.source
        checked_reach(self.reach, "the friction bound")
        if isinstance(source, str):
            source = ScalarFormula(source, "s", "friction bound")
            object.__setattr__(self, "source", source)
        if callable(source):
            object.__setattr__(self, "_evaluate", source)
            steepest = self._measured()
            proved = _proved(source, self.reach) if isinstance(source, ScalarFormula) else None
            if proved is not None and (steepest < np.inf or proved[0] < np.inf):
                steepest = max(proved[0], 0.0 if proved[1] else steepest)
            object.__setattr__(self, "_lipschitz", steepest)
            if proved is not None and (proved[1] or steepest == np.inf):
                object.__setattr__(self, "_proof", Proof(Evidence.BY_INTERVALS))
            elif steepest < np.inf:
                object.__setattr__(self, "_proof", SAMPLED)
            return
        try:
            first, second = source
        except (TypeError, ValueError):
            raise ProblemError(
                "a friction bound must be a table, a formula or a function; give (s, bound), text, or callable"
            ) from None
        s = real_array(first, "s of the friction bound", finite=False)
        bound = real_array(second, "the friction bound", finite=False)
        if s.ndim != 1 or s.shape != bound.shape or s.size < 1:
            raise ProblemError(f"friction bound: s has shape {s.shape} and bound {bound.shape}; give two equal lists")
        _check_rows(s, bound)
        width = np.diff(s)
        with np.errstate(divide="ignore", invalid="ignore"):
            slope = np.where(width > 0.0, np.abs(np.diff(bound)) / width, np.where(np.diff(bound) == 0.0, 0.0, np.inf))
        object.__setattr__(self, "_evaluate", partial(_interpolate, s, bound))
        object.__setattr__(self, "_lipschitz", float(np.max(slope, initial=0.0)))

    def _measured(self) -> float:
        """Steepest slope on a grid; inf where halving the grid doubles it (a jump)."""
        grid = np.unique(np.concatenate([np.linspace(-1, 1, 4001), np.geomspace(1e-6, 1, 2000)])) * self.reach
        values = self._checked(grid)
        slopes = np.abs(np.diff(values)) / np.diff(grid)
        for i in np.argsort(slopes)[-5:]:
            low, high = grid[i], grid[i + 1]
            rise = abs(values[i + 1] - values[i])
            for _ in range(40):
                middle = 0.5 * (low + high)
                if middle in (low, high):
                    break
                ends = self._checked(np.array([low, middle, high]))
                low, high = (low, middle) if abs(ends[1] - ends[0]) >= abs(ends[2] - ends[1]) else (middle, high)
            left = abs(float(np.diff(self._checked(np.array([low, high])))[0]))
            if rise > 0.0 and left > 1e-3 * rise and left > 1e-9 * np.abs(values).max():
                return np.inf
        return float(np.max(slopes, initial=0.0))

    def _checked(self, s: Array) -> Array:
        s = np.asarray(s, dtype=float)
        try:
            values = real_array(self._evaluate(s), "the value of the friction bound", finite=False)
            values = np.broadcast_to(values, s.shape)
        except (TypeError, ValueError) as error:
            if isinstance(error, ProblemError):
                raise
            raise ProblemError(
                f"the friction bound does not return one number for each penetration ({error}); "
                f"its function must accept and return arrays of shape (m,)"
            ) from None
        rounding = 1e-12 * np.abs(values).max(initial=0.0, where=np.isfinite(values))
        values = np.where((values < 0.0) & ((s < 0.0) | (values > -rounding)), 0.0, values)
        bad = ~np.isfinite(values) | (values < 0.0)
        if bad.any():
            i = int(np.argmax(np.where(bad, np.nan_to_num(-values, nan=np.inf), -np.inf)))
            raise ProblemError(
                f"the friction bound is {values.ravel()[i]:g} at penetration {s.ravel()[i]:g}; "
                f"it must be finite, and at least 0 where the body penetrates"
            )
        return values

    def at(self, points: Array | None) -> PenetrationBound:
        return self

    def take(self, index: IntArray) -> PenetrationBound:
        return self

    def value(self, penetration: Array, pressure: Array) -> Array:
        return self._checked(penetration)

    @property
    def lipschitz(self) -> Array:
        return np.array([self._lipschitz])

    @property
    def proof(self) -> Proof:
        return self._proof

    @property
    def differentiable(self) -> bool:
        """Whether it is a table or a formula, and has a Lipschitz constant."""
        known = not callable(self.source) or isinstance(self.source, ScalarFormula)
        return known and self._lipschitz < np.inf

    @property
    def knots(self) -> Array:
        if callable(self.source) and not isinstance(self.source, ScalarFormula):
            return np.zeros((1, 0))
        places = self._pieces[0]
        return np.append(places, 0.0)[None] if callable(self.source) else places[None]  # cut off where it is negative

    @property
    def straight(self) -> bool:
        if isinstance(self.source, ScalarFormula):
            switches, sure = self.source.switches(self.reach)
            ends = np.concatenate([[-2.0 * self.reach], switches, [2.0 * self.reach]])
            branches = self.source.branches(0.5 * (ends[1:] + ends[:-1]))
            return sure and all(branch.graph.constant(branch.derivative().node) for branch in branches)
        return not callable(self.source)

    @cached_property
    def _pieces(self) -> tuple[Array, list[Callable[[Array], Array]]]:
        """Where the derivative may jump, and the derivative on each piece between these places."""
        if isinstance(self.source, ScalarFormula):
            places, _ = self.source.switches(self.reach)
            ends = np.concatenate([[-2.0 * WIDE * self.reach], places, [2.0 * WIDE * self.reach]])
            branches = self.source.branches(0.5 * (ends[1:] + ends[:-1]))
            return places, [branch.derivative() for branch in branches]
        if callable(self.source):
            raise _no_slopes()
        s, bound = (np.asarray(column, dtype=float) for column in self.source)
        with np.errstate(invalid="ignore"):  # of a row that is given twice, which no penetration lies on
            rates = [0.0, *(np.diff(bound) / np.diff(s)), 0.0]
        return s, [partial(np.full_like, fill_value=rate) for rate in rates]

    def slopes(self, penetration: Array, pressure: Array) -> tuple[Array, Array]:
        s = np.asarray(penetration, dtype=float)
        places, rates = self._pieces
        piece, out = np.searchsorted(places, s), np.zeros(s.shape)
        for index in np.unique(piece).tolist():
            here = piece == index
            out[here] = rates[index](s[here])
        cut = (s < 0.0) & (self.value(s, s) == 0.0)  # negative values count as zero there
        return np.where(cut, 0.0, out), np.zeros(s.shape)


def _no_slopes() -> ProblemError:
    return ProblemError("the derivatives of the friction bound are not known; take FixedPoint(inner=...)")


def _check_rows(s: Array, bound: Array) -> None:
    """Refuse a table at its first bad row."""
    rules: list[tuple[BoolArray, Callable[[int], str]]] = [
        (~(np.isfinite(s) & np.isfinite(bound)), lambda i: f"{s[i]}, {bound[i]} are not finite numbers"),
        (bound < 0.0, lambda i: f"the bound {bound[i]:g} is negative; a friction bound is at least 0"),
        (np.append(False, s[1:] < s[:-1]), lambda i: f"s = {s[i]:g} comes after {s[i - 1]:g}; s must not fall"),
        (
            np.append([False] * 2, s[2:] == s[:-2])[: s.size],
            lambda i: f"s = {s[i]:g} a third time; two rows make a jump",
        ),
    ]
    broken = [(int(np.argmax(bad)), words) for bad, words in rules if bad.any()]
    if broken:
        row, words = min(broken, key=lambda fault: fault[0])
        raise ProblemError(f"friction bound, row {row + 1}: {words(row)}")


def _refuse_pole(formula: ScalarFormula, pole: Pole | None) -> None:
    """Refuse a formula for a place that was found."""
    if pole is not None and pole.sure:
        where = "; write max(s, 0) for s where there is no contact" if pole.place < 0.0 else ""
        raise ProblemError(f"{formula.shown} {pole.words('s')}{where}")


def _proved(formula: ScalarFormula, reach: float) -> tuple[float, bool]:
    """A Lipschitz constant of a formula and whether it holds everywhere, or within the reach only.

    Negative values are cut to zero, which makes no slope steeper; inf where the formula jumps.
    """
    switches, sure = formula.switches(reach)
    ends = np.concatenate([[-np.inf], switches, [np.inf]])
    inner = np.concatenate([[-2.0 * WIDE * reach], switches, [2.0 * WIDE * reach]])
    branches = formula.branches(0.5 * (inner[1:] + inner[:-1]))
    near = np.clip(ends, -reach, reach)
    _refuse_pole(formula, pole_of_pieces(branches, near, reach))
    for i, switch in enumerate(switches):
        at = np.array([switch])
        left, right = (max(float(branch(at)[0]), 0.0) for branch in branches[i : i + 2])
        if not abs(right - left) <= 1e-9 * (abs(left) + abs(right)) + 1e-300:
            return np.inf, True
    first, last = np.searchsorted(switches, 0.0, side="right"), np.searchsorted(switches, reach, side="left")
    contact, pushed = branches[first : last + 1], np.clip(ends[first : last + 2], 0.0, reach)
    lowest = supremum_of_pieces(contact, pushed, reach, order=0, sign=-1.0)
    rounding = 1e-12 * supremum_of_pieces(contact, pushed, reach, order=0, sign=1.0).seen
    if lowest.seen > rounding:
        raise ProblemError(
            f"{formula.shown}: the friction bound is {-lowest.seen:g} at penetration {lowest.place:g}; it must be at "
            f"least 0 where the body penetrates"
        )
    for within in (ends, near):
        suprema = [supremum_of_pieces(branches, within, reach, order=1, sign=sign) for sign in (1.0, -1.0)]
        bound, seen = max(supremum.bound for supremum in suprema), max(supremum.seen for supremum in suprema)
        if bound < np.inf and (bound <= 1.01 * seen or within is near):
            return bound, sure and within is ends
    return max(supremum.seen for supremum in suprema), False


def _interpolate(s: Array, bound: Array, x: Array) -> Array:
    """Piecewise linear table, constant beyond the ends, from the left at jumps."""
    i = np.searchsorted(s, x, side="left")
    low, high = np.clip(i - 1, 0, s.size - 1), np.clip(i, 0, s.size - 1)
    width = s[high] - s[low]
    t = np.where(width > 0.0, (x - s[low]) / np.where(width > 0.0, width, 1.0), 1.0)
    return np.asarray(bound[low] + np.clip(t, 0.0, 1.0) * (bound[high] - bound[low]))


@dataclass(frozen=True, eq=False)
class _PlainBound(StateBound):
    """A bound that does not depend on the state, among others that do."""

    bound: Array

    def at(self, points: Array | None) -> _PlainBound:
        return self

    def take(self, index: IntArray) -> _PlainBound:
        return self if self.bound.size == 1 else _PlainBound(self.bound[index])

    def value(self, penetration: Array, pressure: Array) -> Array:
        return np.broadcast_to(self.bound, np.shape(penetration))

    @property
    def least(self) -> Array:
        return self.bound

    @property
    def straight(self) -> bool:
        return True

    @property
    def lipschitz(self) -> Array:
        return np.zeros(1)

    @property
    def differentiable(self) -> bool:
        return True

    def slopes(self, penetration: Array, pressure: Array) -> tuple[Array, Array]:
        return np.zeros(np.shape(penetration)), np.zeros(np.shape(penetration))


@dataclass(frozen=True, eq=False)
class StackedBound(StateBound):
    """Bound ``parts[i]`` at the contact points ``indices[i]``; together the indices cover 0..m-1 once."""

    parts: tuple[StateBound, ...]
    indices: tuple[IntArray, ...]

    @property
    def _count(self) -> int:
        return int(sum(index.size for index in self.indices))

    def at(self, points: Array | None) -> StackedBound:
        return self

    def take(self, index: IntArray) -> StackedBound:
        owner = np.empty(self._count, dtype=np.int64)
        where = np.empty(self._count, dtype=np.int64)
        for k, rows in enumerate(self.indices):
            owner[rows], where[rows] = k, np.arange(rows.size)
        index = np.atleast_1d(np.asarray(index, dtype=np.int64))
        chosen = [(k, np.flatnonzero(owner[index] == k)) for k in range(len(self.parts))]
        chosen = [(k, here) for k, here in chosen if here.size]
        parts = tuple(self.parts[k].take(where[index[here]]) for k, here in chosen)
        return replace(self, parts=parts, indices=tuple(here for _, here in chosen))

    def value(self, penetration: Array, pressure: Array) -> Array:
        out = np.empty(self._count)
        for part, index in zip(self.parts, self.indices, strict=True):
            out[index] = part.value(penetration[index], pressure[index])
        return out

    @property
    def least(self) -> Array:
        return self._of_parts([part.least for part in self.parts])

    @property
    def per_pressure(self) -> Array:
        return self._of_parts([part.per_pressure for part in self.parts])

    @property
    def proportional(self) -> bool:
        return all(part.proportional for part in self.parts)

    def _of_parts(self, values: Sequence[Array]) -> Array:
        out = np.empty(self._count)
        for value, index in zip(values, self.indices, strict=True):
            out[index] = value
        return out

    @property
    def straight(self) -> bool:
        return all(part.straight for part in self.parts)

    @property
    def knots(self) -> Array:
        tables = [part.knots for part in self.parts]
        out = np.full((self._count, max(table.shape[1] for table in tables)), np.inf)
        for table, index in zip(tables, self.indices, strict=True):
            out[index, : table.shape[1]] = table
        return out

    @property
    def differentiable(self) -> bool:
        return all(part.differentiable for part in self.parts)

    def slopes(self, penetration: Array, pressure: Array) -> tuple[Array, Array]:
        out = np.empty((2, self._count))
        for part, index in zip(self.parts, self.indices, strict=True):
            out[:, index] = part.slopes(penetration[index], pressure[index])
        return out[0], out[1]

    @property
    def proof(self) -> Proof:
        return worst(part.proof for part in self.parts)

    @property
    def lipschitz(self) -> Array:
        return self._of_parts([part.lipschitz for part in self.parts])


def stack_bounds(bounds: Sequence[tuple[StateBound | Array, int]]) -> StateBound:
    """One bound from bounds for consecutive blocks of contact points, given as ``(bound, number of points)``."""
    parts = [(b if isinstance(b, StateBound) else _PlainBound(np.atleast_1d(b)), count) for b, count in bounds if count]
    if len(parts) == 1:
        return parts[0][0]
    ends = np.cumsum([count for _, count in parts])
    indices = tuple(np.arange(end - count, end) for end, (_, count) in zip(ends, parts, strict=True))
    return StackedBound(tuple(bound for bound, _ in parts), indices)
