"""Laws of the user's own: a formula as text, or a Python function."""

from __future__ import annotations

import itertools
from abc import abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from hemivar.basics.arrays import real_array
from hemivar.basics.portable import Portable
from hemivar.basics.types import Array, IntArray
from hemivar.errors import ProblemError
from hemivar.formula import ScalarFormula
from hemivar.formula.smooth import SmoothFormula, Supremum, supremum_of_pieces
from hemivar.laws.base import Interval, Superpotential
from hemivar.laws.consistency import check_consistency
from hemivar.laws.scaled import ScaledLaw

__all__ = ["FormulaLaw", "FunctionLaw"]

_Scalar = Callable[[Array], Array]
_FAR = (1.0, 3.0, 10.0, 100.0, 1e4, 1e6)
#: Kinks and turns of the curvature that a formula may have.
_MOST_KNOTS = 1000
#: Turns from which on it is made sure that a finer look finds no more.
_MANY_TURNS = 50
_EVERYWHERE = " for every r (use piecewise, max(r, 0) or abs(r))"


@dataclass(frozen=True)
class _Piece(Portable):
    """Value, derivative and curvature on one piece."""

    value: _Scalar
    derivative: _Scalar
    curvature: _Scalar
    text: str = ""


class _OwnLaw(Superpotential):
    """A law, the same at every contact point, that is given by a list of smooth pieces."""

    constants_sampled = True
    reach: float
    even: bool

    @abstractmethod
    def _pieces(self) -> tuple[Array, tuple[_Piece, ...]]:
        """Knots and the pieces between them; for an even law those for r > 0 (the knot zero left out)."""

    @cached_property
    def _own(self) -> tuple[Array, tuple[_Piece, ...]]:
        knots, pieces = self._pieces()
        return (knots, pieces) if self.even or knots.size else (np.zeros(1), pieces * 2)

    @cached_property
    def _knots(self) -> Array:
        knots = self._own[0]
        return np.concatenate([-knots[::-1], [0.0], knots]) if self.even else knots

    @property
    def knots(self) -> Array:
        return self._knots[None, :]

    @property
    def domain(self) -> Interval:
        return Interval(np.array([-np.inf]), np.array([np.inf]))

    def _mirrored(self, piece: int) -> tuple[_Piece, float]:
        """A piece of the whole line, and -1 if it is the mirror image of a piece for r > 0."""
        pieces = self._own[1]
        if not self.even:
            return pieces[piece], 1.0
        return (pieces[piece - len(pieces)], 1.0) if piece >= len(pieces) else (pieces[len(pieces) - 1 - piece], -1.0)

    def _evaluate(self, piece: IntArray, r: Array, order: int) -> Array:
        piece, r = np.broadcast_arrays(np.asarray(piece), np.asarray(r, dtype=float))
        out = np.empty(r.shape)
        which = self._kinds[piece]
        for kind in np.unique(which):
            here = which == kind
            smooth, sign = self._different[kind]
            part = (smooth.value, smooth.derivative, smooth.curvature)[order]
            out[here] = (sign if order == 1 else 1.0) * part(sign * r[here])
        return out

    @cached_property
    def _different(self) -> list[tuple[_Piece, float]]:
        """The pieces of the whole line, each once."""
        all_ = [self._mirrored(i) for i in range(self._knots.size + 1)]
        return list({(id(smooth), sign): (smooth, sign) for smooth, sign in all_}.values())

    @cached_property
    def _kinds(self) -> IntArray:
        """Number of each piece among those that differ."""
        number = {(id(smooth), sign): k for k, (smooth, sign) in enumerate(self._different)}
        all_ = (self._mirrored(i) for i in range(self._knots.size + 1))
        return np.array([number[id(smooth), sign] for smooth, sign in all_], dtype=np.int64)

    @cached_property
    def _at_zero(self) -> float:
        zero = np.zeros(1)
        return float(self._evaluate(self.piece_of(zero), zero, 0)[0])

    def piece_value(self, piece: IntArray, r: Array) -> Array:
        return self._evaluate(piece, r, 0) - self._at_zero

    def piece_derivative(self, piece: IntArray, r: Array) -> Array:
        return self._evaluate(piece, r, 1)

    def piece_curvature(self, piece: IntArray, r: Array) -> Array:
        return self._evaluate(piece, r, 2)

    def piece_formula(self, piece: int) -> str:
        smooth, sign = self._mirrored(piece)
        if not smooth.text or sign > 0.0:
            return smooth.text
        return f"-({smooth.text}) at |r|"

    @cached_property
    def _slopes(self) -> tuple[Array, Array]:
        left, right = super().knot_slopes()
        size = 1e-9 * (1.0 + np.abs(left) + np.abs(right))
        return left, np.where(np.abs(right - left) <= size, left, right)  # no kinks by rounding

    def knot_slopes(self) -> tuple[Array, Array]:
        return self._slopes

    @cached_property
    def _samples(self) -> tuple[Array, IntArray]:
        """Places all over the reach, the knots from both sides and far out, and the pieces they belong to."""
        knots = self._knots
        far = np.array(_FAR) * max(self.reach, 2.0 * float(np.abs(knots).max()))
        r = np.unique(np.concatenate([-far, np.linspace(-self.reach, self.reach, 2001), far]))
        piece = np.asarray(np.searchsorted(knots, r, side="left"), dtype=np.int64)
        both = np.arange(knots.size, dtype=np.int64)
        return np.concatenate([r, knots, knots]), np.concatenate([piece, both, both + 1])

    @cached_property
    def _alpha(self) -> float:
        left, right = self.knot_slopes()
        if np.any(right < left):
            return np.inf
        r, piece = self._samples
        with np.errstate(all="ignore"):
            curvature = self._evaluate(piece, r, 2)
        return float(max(0.0, -np.min(curvature[~np.isnan(curvature)], initial=0.0)))

    @property
    def weak_convexity(self) -> Array:
        return np.array([self._alpha])

    @cached_property
    def _growth(self) -> tuple[float, float]:
        r, piece = self._samples
        with np.errstate(all="ignore"):
            size = np.abs(self._evaluate(piece, r, 1))
        if not np.isfinite(size).all():
            return np.inf, np.inf
        slopes = []
        for sign in (-1.0, 1.0):
            out = np.flatnonzero(sign * r >= np.abs(r).max() / 200.0)
            out = out[np.argsort(np.abs(r[out]))][[0, -1]]
            rate = size[out] / np.abs(r[out])
            if rate[1] > 1.5 * rate[0]:
                return np.inf, np.inf
            slopes.append(rate[1])
        c1 = max(slopes)
        if c1 * self.reach < 1e-5 * size[np.abs(r) <= self.reach].max(initial=0.0):
            c1 = 0.0
        top = int(np.argmax(size - c1 * np.abs(r)))
        step = self.reach / 1000.0
        close = r[top] + np.linspace(-step, step, 801)
        with np.errstate(all="ignore"):
            near = np.abs(self.derivative(close)) - c1 * np.abs(close)
        highest = max(float(np.max(size - c1 * np.abs(r))), float(np.max(near[np.isfinite(near)], initial=0.0)))
        return highest * (1.0 + 1e-9), float(c1)

    @property
    def growth(self) -> tuple[Array, Array]:
        c0, c1 = self._growth
        return np.array([c0]), np.array([c1])

    @cached_property
    def _rates(self) -> tuple[float, float]:
        found = []
        last = self._knots.size
        far = np.array([1e4, 1e6]) * max(self.reach, float(np.abs(self._knots).max()))
        near, _ = self._growth
        for sign, piece in ((-1.0, 0), (1.0, last)):
            with np.errstate(all="ignore"):
                slope = sign * self._evaluate(np.full(2, piece), sign * far, 1)
            if not np.isfinite(slope).all():
                with np.errstate(all="ignore"):
                    found.append(float(np.copysign(np.inf, self._evaluate(np.array([piece]), sign * far[:1], 0)[0])))
            elif abs(slope[1]) > 3.0 * abs(slope[0]) and abs(slope[1]) * self.reach > 1e-6:
                found.append(float(np.copysign(np.inf, slope[1])))
            else:
                small = np.isfinite(near) and abs(slope[1]) < 1e-5 * near
                found.append(0.0 if small else float(slope[1]))
        return found[0], found[1]

    def recession(self, sign: Array) -> Array:
        sign = np.asarray(sign, dtype=float)
        down, up = self._rates
        with np.errstate(invalid="ignore"):
            return np.where(sign > 0.0, sign * up, np.where(sign < 0.0, -sign * down, 0.0))

    def at(self, points: Array | None) -> _OwnLaw:
        return self

    def take(self, index: IntArray) -> _OwnLaw:
        return self

    def scaled(self, factor: Array | float) -> ScaledLaw:
        return ScaledLaw(self, np.atleast_1d(real_array(factor, f"the factor of law '{self.name}'", finite=False)))

    # ---- for those who supply pieces -----------------------------------------------------------------------

    def _inside(self, low: float, high: float, count: int) -> Array:
        """Places inside a piece, dense towards its ends."""
        reach = max(self.reach, 2.0 * max((abs(x) for x in (low, high) if np.isfinite(x)), default=0.0))
        low = low if np.isfinite(low) else -1.5 * reach
        high = high if np.isfinite(high) else 1.5 * reach
        even = (np.arange(count) + 0.5) / count
        close = np.geomspace(1e-7, 0.3, count)
        return low + (high - low) * np.unique(np.concatenate([even, close, 1.0 - close]))


def _joined(where: str, knots: Array, pieces: Sequence[_Piece], reach: float, step: float = 0.0) -> None:
    """Refuse a potential that is not continuous, seen from ``step`` to the left and to the right of its knots."""
    for i, knot in enumerate(knots):
        with np.errstate(all="ignore"):
            left = float(pieces[i].value(np.array([knot - step]))[0])
            right = float(pieces[i + 1].value(np.array([knot + step]))[0])
            slopes = [abs(float(pieces[k].derivative(np.array([knot]))[0])) for k in (i, i + 1)]
            far = [float(pieces[i + k].value(np.array([knot + (2 * k - 1) * 0.01 * reach]))[0]) for k in (0, 1)]
        rises = sum(abs(x) for x in (far[0] - left, far[1] - right) if np.isfinite(x))
        rounding = (1e-6 if step else 1e-9) * (abs(left) + abs(right) + rises + 1e-3 * reach * sum(slopes))
        if not abs(right - left) <= rounding + 4.0 * step * sum(slopes):
            raise ProblemError(
                f"{where} is {left:.6g} to the left and {right:.6g} to the right of r = {knot:.6g}; "
                f"a potential must be continuous (only its derivative may jump)"
            )


@dataclass(frozen=True, eq=False)
class _FormulaLaw(_OwnLaw):
    """The law that :func:`FormulaLaw` makes."""

    text: str
    kinks_at: Sequence[float] = ()
    reach: float = 10.0
    even: bool = False
    name: str = "formula"
    where: str = ""
    _formula: ScalarFormula = field(init=False, repr=False)

    def __post_init__(self) -> None:
        if not (np.isfinite(self.reach) and self.reach > 0.0):
            raise ProblemError(f"reach of law '{self.name}' is {self.reach}; it must be a positive length")
        object.__setattr__(self, "_formula", ScalarFormula(self.text, "r", self.where))
        _ = self._own

    @property
    def stated(self) -> Mapping[str, object]:
        return {"law": "formula", "potential": self.text, "kinks": self.kinks_at, "reach": self.reach}

    @property
    def _start(self) -> float:
        return 0.0 if self.even else -np.inf

    @cached_property
    def _branches(self) -> tuple[Array, list[SmoothFormula], bool]:
        """Places where one branch gives way to another, the branches, and whether no place is missing."""
        formula = self._formula
        switches, sure = formula.switches(self.reach)
        if self.even:
            switches = switches[switches > 1e-12 * self.reach]
        ends = np.concatenate([[self._start], switches, [np.inf]])
        branches = formula.branches(np.array([_middle(low, high) for low, high in itertools.pairwise(ends)]))
        keep = [i for i in range(len(switches)) if branches[i].node != branches[i + 1].node]
        return switches[keep], [branches[0], *(branches[i + 1] for i in keep)], sure

    def _pieces(self) -> tuple[Array, tuple[_Piece, ...]]:
        shown = self._formula.shown
        switches, branches, _ = self._branches
        ends = np.concatenate([[self._start], switches, [np.inf]])
        count = int(np.clip(40_000 // len(branches), 60, 1000))
        knots = [switches, np.array([k for k in map(float, self.kinks_at) if k > 0.0 or not self.even])]
        plain: dict[int, _Piece] = {}
        for node in dict.fromkeys(branch.node for branch in branches):
            here = [i for i, branch in enumerate(branches) if branch.node == node]
            smooth = branches[here[0]]
            slope = smooth.derivative()
            bend = slope.derivative()
            plain[node] = _Piece(smooth, slope, bend, str(slope))
            low, high = ends[here], ends[np.array(here) + 1]
            inside = [self._inside(a, b, count) for a, b in zip(low.tolist(), high.tolist(), strict=True)]
            places = np.concatenate(inside)
            corners = np.concatenate([low[np.isfinite(low)], high[np.isfinite(high)]])
            for what, part, at in (("", smooth, places), ("the derivative of ", slope, np.append(places, corners))):
                bad = ~np.isfinite(part(at))
                if bad.any():
                    raise ProblemError(
                        f"{what}{shown} is not finite at r = {at[np.argmax(bad)]:.4g}; give a formula"
                        + (" that is finite for every r >= 0" if self.even else _EVERYWHERE)
                    )
            turns = _turns(bend.derivative(), inside)
            if turns.size > _MANY_TURNS:
                finer = [self._inside(a, b, 2 * count) for a, b in zip(low.tolist(), high.tolist(), strict=True)]
                if abs(_turns(bend.derivative(), finer).size - turns.size) > 0.02 * turns.size:
                    raise ProblemError(
                        f"the curvature of {shown} turns round too often up to the reach {self.reach:g} for every turn "
                        f"to be found; take a smaller reach, or give a table"
                    )
            knots.append(turns)
        _joined(shown, switches, [plain[branch.node] for branch in branches], self.reach)
        table = np.unique(np.concatenate(knots))
        if table.size > _MOST_KNOTS:
            raise ProblemError(
                f"{shown} has {table.size} kinks and turns of its curvature up to the reach {self.reach:g}; at most "
                f"{_MOST_KNOTS} are allowed: take a smaller reach, or give a table"
            )
        self._check_slopes()
        low = np.concatenate([[self._start], table])
        high = np.concatenate([table, [np.inf]])
        middle = [_middle(a, b) for a, b in zip(low.tolist(), high.tolist(), strict=True)]
        return table, tuple(plain[branches[i].node] for i in np.searchsorted(switches, middle).tolist())

    def _supremum(self, order: int, sign: float, far: bool, slack: float = 0.0) -> Supremum:
        """Enclosed supremum of ``sign`` times a derivative over all pieces, within the reach or also far away."""
        switches, branches, _ = self._branches
        ends = np.concatenate([[self._start], switches, [np.inf]])
        if not far:
            most = max(self.reach, 2.0 * float(np.abs(switches).max(initial=0.0)))
            ends = np.clip(ends, -most, most)
        return supremum_of_pieces(branches, ends, self.reach, order=order, sign=sign, slack=slack)

    def _check_slopes(self) -> None:
        """Refuse a derivative that grows without bound at some place within the reach."""
        for sign in (1.0, -1.0):
            found = self._supremum(1, sign, far=False)
            if np.isfinite(found.bound):
                continue
            _, branches, _ = self._branches
            for smooth in {branch.node: branch.derivative() for branch in branches}.values():
                for side in (1.0, -1.0):
                    size = np.abs(smooth(found.place + side * self.reach * np.array([1e-6, 1e-9, 1e-12])))
                    if np.isfinite(size).all() and size[2] > 1.2 * size[1] > 1.2 * 1.2 * size[0]:
                        raise ProblemError(
                            f"the derivative of {self._formula.shown} grows without bound at r = {found.place:.4g}; a "
                            f"law needs a finite slope everywhere (but at jumps of its derivative)"
                        )

    @property
    def constants_sampled(self) -> bool:  # type: ignore[override]
        """Whether a constant is sampled, for want of a bound that is proved."""
        return self.alpha_sampled or self.growth_sampled

    @cached_property
    def _alpha_and_doubt(self) -> tuple[float, bool]:
        """alpha, and whether it is no more than sampled: the bound of -j'' over the whole line, where one was found."""
        sampled = float(_OwnLaw._alpha.func(self))  # type: ignore[attr-defined]
        if np.isinf(sampled):
            return sampled, False
        r, piece = self._samples
        size = np.abs(self._evaluate(piece, r, 2))
        scale = float(np.max(size[np.isfinite(size)], initial=0.0))
        found = self._supremum(2, -1.0, far=True, slack=1e-12 * scale)
        seen = max(sampled, found.seen)
        if self._branches[2] and seen <= found.bound <= 1.01 * seen + 1e-6 * scale:
            return found.bound, False
        return seen, True

    @property
    def _alpha(self) -> float:  # type: ignore[override]
        return self._alpha_and_doubt[0]

    @property
    def alpha_sampled(self) -> bool:
        return self._alpha_and_doubt[1]

    @cached_property
    def _growth_and_doubt(self) -> tuple[tuple[float, float], bool]:
        """c0 and c1, and whether they are sampled: else c0 bounds |j'| over the whole line."""
        sampled: tuple[float, float] = _OwnLaw._growth.func(self)  # type: ignore[attr-defined]
        if np.isinf(sampled[0]):
            return sampled, False
        found = [self._supremum(1, sign, far=True) for sign in (1.0, -1.0)]
        proved, seen = max(one.bound for one in found), max(one.seen for one in found)
        if self._branches[2] and proved <= 1.01 * seen:
            return (proved, 0.0), False
        return sampled, True

    @property
    def _growth(self) -> tuple[float, float]:  # type: ignore[override]
        return self._growth_and_doubt[0]

    @property
    def growth_sampled(self) -> bool:
        return self._growth_and_doubt[1]


def _middle(low: Any, high: Any) -> float:
    """A place between two ends, of which each may be infinite."""
    low, high = float(low), float(high)
    if np.isfinite(low) and np.isfinite(high):
        return float(0.5 * (low + high))
    if np.isfinite(low):
        return float(low + 1.0 + abs(low))
    return float(high - 1.0 - abs(high)) if np.isfinite(high) else 0.37


def _turns(third: SmoothFormula, inside: Sequence[Array]) -> Array:
    """Where a curvature turns round: sign changes of its derivative between the places inside each piece."""
    if third.constant:
        return np.zeros(0)
    places = np.concatenate(inside)
    piece = np.repeat(np.arange(len(inside)), [at.size for at in inside])
    values = third(places)
    values = np.where(np.isfinite(values), values, 0.0)
    values[np.abs(values) < 1e-10 * np.abs(values).max(initial=0.0)] = 0.0
    nonzero = np.flatnonzero(values)
    first, last = nonzero[:-1], nonzero[1:]
    turns = (piece[first] == piece[last]) & (values[first] * values[last] < 0.0)
    if np.count_nonzero(turns) > _MOST_KNOTS:
        return np.asarray(places[first[turns]])
    found = third.crossings(places[first[turns]], places[last[turns]])
    return np.where(np.abs(found) > 1e-12 * float(np.abs(places).max()), found, 0.0)


#: Weights at -2, -1, 0, 1, 2 of the interpolating polynomial in powers of t.
_STENCIL = np.linalg.inv(np.vander(np.arange(-2.0, 3.0), increasing=True))
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(12)
_PANELS = 8


@dataclass(frozen=True, eq=False)
class _FunctionLaw(_OwnLaw):
    """The law that :func:`FunctionLaw` makes."""

    potential: Callable[[Array], Any] | None = None
    derivative_function: Callable[[Array], Any] | None = None
    curvature_function: Callable[[Array], Any] | None = None
    kinks_at: Sequence[float] = ()
    reach: float = 10.0
    even: bool = False
    name: str = "function"

    def __post_init__(self) -> None:
        if self.potential is None and self.derivative_function is None:
            raise ProblemError(f"law '{self.name}' has no function; give its potential or its derivative")
        if not (np.isfinite(self.reach) and self.reach > 0.0):
            raise ProblemError(f"reach of law '{self.name}' is {self.reach}; it must be a positive length")
        kinks = np.asarray(self.kinks_at, dtype=float)
        if kinks.ndim != 1 or not np.isfinite(kinks).all():
            raise ProblemError(f"kinks of law '{self.name}' must be a list of finite numbers, not {self.kinks_at!r}")
        _ = self._own
        if self.curvature_function is None:
            remedy = "it is computed by differences, which are too coarse here: give a function for it too"
            check_consistency(self, self.reach, remedy=remedy)
        else:
            check_consistency(self, self.reach)

    def _called(self, function: Callable[[Any], Any], r: Array) -> Array:
        try:
            given = np.asarray(function(r))
            if np.iscomplexobj(given):
                raise ProblemError(f"a function of law '{self.name}' returns complex numbers; it must return real ones")
            values = np.asarray(given, dtype=float)
            if values.shape != r.shape:
                values = np.broadcast_to(values, r.shape)
        except ProblemError:
            raise
        except (TypeError, ValueError):
            try:
                values = np.array([float(function(x)) for x in r.ravel().tolist()]).reshape(r.shape)
            except Exception as error:
                raise ProblemError(f"a function of law '{self.name}' failed at a number r: {error}") from error
        return values

    def _pieces(self) -> tuple[Array, tuple[_Piece, ...]]:
        start = 0.0 if self.even else -np.inf
        kinks = np.unique(np.asarray(self.kinks_at, dtype=float))
        if self.even:
            kinks = kinks[kinks > 0.0]
        elif kinks.size == 0:
            kinks = np.zeros(1)
        ends = np.concatenate([[start], kinks, [np.inf]])
        gaps = np.diff(np.unique(np.concatenate([ends[np.isfinite(ends)], [0.0]])))
        scale = float(min([0.1 * self.reach, *gaps]))
        plain = [self._piece(float(ends[i]), float(ends[i + 1]), scale) for i in range(len(ends) - 1)]
        if self.potential is None:
            plain = _anchored(plain, kinks, self.even)
        for i, piece in enumerate(plain):
            r = self._inside(float(ends[i]), float(ends[i + 1]), 60)
            for part in (piece.value, piece.derivative):
                bad = ~np.isfinite(part(r))
                if bad.any():
                    raise ProblemError(
                        f"law '{self.name}' is not finite at r = {r[np.argmax(bad)]:.6g}; mend its function"
                    )
        _joined(f"the potential of law '{self.name}'", kinks, plain, self.reach, 1e-11 * scale)
        turns: list[float] = []
        for i, piece in enumerate(plain):
            r = self._inside(float(ends[i]), float(ends[i + 1]), 300)
            rounding = 1e-5 * float(np.abs(piece.derivative(r)).max()) / self.reach
            turns += _extrema(r, piece.curvature(r), rounding)
        table = np.unique(np.concatenate([kinks, turns]))
        low = np.concatenate([[start], table])
        high = np.concatenate([table, [np.inf]])
        return table, tuple(plain[int(np.sum(kinks < _middle(a, b)))] for a, b in zip(low, high, strict=True))

    def _piece(self, low: float, high: float, scale: float) -> _Piece:
        """Functions that stay inside ``(low, high)``."""
        margin = 1e-9 * scale

        def differences(function: Callable[[Array], Any], r: Array, orders: tuple[int, ...]) -> list[Array]:
            """Derivatives of the polynomial through five values around r, all of them inside the piece."""
            step = np.minimum(3e-3 * np.maximum(scale, np.abs(r)), 0.24 * (high - low) - 0.5 * margin)
            centre = np.clip(r, low + 2.0 * step + margin, high - 2.0 * step - margin)
            values = np.stack([self._called(function, centre + k * step) for k in range(-2, 3)])
            coefficients = np.tensordot(_STENCIL, values, axes=1)
            t = (r - centre) / step
            first = sum(k * coefficients[k] * t ** (k - 1) for k in range(1, 5)) / step
            second = sum(k * (k - 1) * coefficients[k] * t ** (k - 2) for k in range(2, 5)) / step**2
            return [np.asarray((first, second)[order - 1]) for order in orders]

        def curvature(r: Array) -> Array:
            r = np.asarray(r, dtype=float)
            if self.curvature_function is not None:
                return self._called(self.curvature_function, np.clip(r, low + margin, high - margin))
            if self.derivative_function is not None:
                return differences(self.derivative_function, r, (1,))[0]
            assert self.potential is not None
            return differences(self.potential, r, (2,))[0]

        def derivative(r: Array) -> Array:
            r = np.asarray(r, dtype=float)
            if self.derivative_function is None:
                assert self.potential is not None
                return differences(self.potential, r, (1,))[0]
            inside = np.clip(r, low + margin, high - margin)
            values = self._called(self.derivative_function, inside)
            moved = r != inside
            return values if not moved.any() else values + np.where(moved, (r - inside) * curvature(inside), 0.0)

        def value(r: Array) -> Array:
            r = np.asarray(r, dtype=float)
            if self.potential is not None:
                return self._called(self.potential, r)
            anchor = low if np.isfinite(low) else high
            ends = anchor + (r - anchor)[..., None] * np.linspace(0.0, 1.0, _PANELS + 1)
            half = 0.5 * np.diff(ends, axis=-1)
            middle = 0.5 * (ends[..., 1:] + ends[..., :-1])
            at = middle[..., None] + half[..., None] * _NODES
            return np.asarray(np.einsum("...pk,k,...p->...", derivative(at), _WEIGHTS, half))

        return _Piece(value, derivative, curvature)


def _anchored(plain: list[_Piece], kinks: Array, even: bool) -> list[_Piece]:
    """Pieces whose values, each an integral from its own end, are joined to one continuous potential."""
    joined: list[_Piece] = []
    base = 0.0
    for i, piece in enumerate(plain):
        if i > 0:
            previous = kinks[i - 1 : i]
            base = float(joined[-1].value(previous)[0])
        joined.append(_shifted(piece, base))
    return joined


def _shifted(piece: _Piece, base: float) -> _Piece:
    return _Piece(lambda r: piece.value(r) + base, piece.derivative, piece.curvature, piece.text)


def _extrema(r: Array, curvature: Array, rounding: float) -> list[float]:
    """Places where a sampled curvature turns round by more than its noise."""
    if r.size < 3:
        return []
    size = float(np.ptp(curvature))
    noise = 1e-4 * size + 1e-6 * float(np.abs(curvature).max()) + rounding
    found, best, direction = [], 0, 0
    for i in range(1, r.size):
        change = curvature[i] - curvature[best]
        if direction == 0:
            if abs(change) > noise:
                direction, best = (1 if change > 0.0 else -1), i
        elif change * direction > 0.0:
            best = i
        elif abs(change) > noise:
            found.append(float(r[best]))
            direction, best = -direction, i
    return found


def FormulaLaw(  # noqa: N802 - a law, named as the others are
    text: str,
    *,
    kinks: Sequence[float] = (),
    reach: float = 10.0,
    even: bool = False,
    name: str = "formula",
    where: str = "",
) -> Superpotential:
    """A law whose potential is a formula in the variable r, such as ``"7/10*abs(r) - 3/10*exp(-abs(r))"``.

    Derivatives are symbolic. Kinks are found from abs, min, max and the conditions of piecewise; alpha and the
    growth constants by sampling ``[-reach, reach]`` and some places beyond. The formula may have any value at
    r = 0; it is shifted to j(0) = 0.

    Parameters
    ----------
    text : str
        See :class:`hemivar.formula.ScalarFormula`.
    kinks : sequence of float
        Further knots.
    reach : float
        Length up to which kinks and constants are looked for: larger than any displacement that matters.
    even : bool
        The formula holds for r >= 0 and j(-r) = j(r): for friction.

    Raises
    ------
    ProblemError
        If the text is not a formula (with the character), is not finite somewhere, or not continuous.
    """
    return _FormulaLaw(text, tuple(kinks), reach, even, name, where)


def FunctionLaw(  # noqa: N802 - a law, named as the others are
    potential: Callable[[Array], Any] | None = None,
    derivative: Callable[[Array], Any] | None = None,
    curvature: Callable[[Array], Any] | None = None,
    *,
    kinks: Sequence[float] = (),
    reach: float = 10.0,
    even: bool = False,
    name: str = "function",
) -> Superpotential:
    """A law given by a Python function for the potential, or for its derivative.

    What is not given is computed: derivatives by central differences of fourth order that never reach across a
    kink, the potential by Gauss quadrature of the derivative.

    Parameters
    ----------
    potential : callable, optional
        j, r (m,) -> (m,); one of potential and derivative must be given.
    derivative : callable, optional
        j'; its value at a kink does not matter.
    curvature : callable, optional
        j''.
    kinks : sequence of float
        Every place where j' or j'' jumps. ``hemivar.laws.testing.check_law`` finds kinks that are missing here.
    reach : float
        Length up to which the constants are sampled: larger than any displacement that matters.
    even : bool
        The functions hold for r >= 0 and j(-r) = j(r): for friction.

    Raises
    ------
    ProblemError
        If neither function is given, or one returns something else than finite numbers, or samples show that they do
        not belong to each other: a derivative that is not that of the potential, a curvature that is not that of the
        derivative, a kink that is not listed.
    """
    return _FunctionLaw(potential, derivative, curvature, kinks, reach, even, name)
