"""Laws as a list of smooth pieces with value, derivative and curvature: what formulas and Python functions share."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from hemivar.basics.first_use import cached_property
from hemivar.basics.portable import PickleMixin
from hemivar.basics.types import Array, IntArray
from hemivar.errors import ProblemError
from hemivar.laws.proof import SAMPLED, Constant, Proof, of_alpha
from hemivar.laws.superpotential import Superpotential

__all__ = ["ArrayFunction", "LawPiece", "OwnLaw", "check_joined", "middle_of"]

#: A function of an array, of its shape.
ArrayFunction = Callable[[Array], Array]
#: Where constants are sampled far out, in units of the reach: ten times as far or as near, tests/laws find the same.
_FAR = (1.0, 3.0, 10.0, 100.0, 1e4, 1e6)


@dataclass(frozen=True)
class LawPiece(PickleMixin):
    """Value, derivative and curvature on one piece."""

    value: ArrayFunction
    derivative: ArrayFunction
    curvature: ArrayFunction
    text: str = ""


class OwnLaw(Superpotential):
    """A law, the same at every contact point, that is given by a list of smooth pieces."""

    reach: float
    even: bool

    def proof(self, constant: Constant) -> Proof:
        return of_alpha(SAMPLED, lambda _: self.weak_convexity) if constant == "alpha" else SAMPLED

    @abstractmethod
    def _pieces(self) -> tuple[Array, tuple[LawPiece, ...]]:
        """Knots and the pieces between them; for an even law those for r > 0 (the knot zero left out)."""

    @cached_property
    def _own(self) -> tuple[Array, tuple[LawPiece, ...]]:
        """Knots and pieces of the whole line."""
        knots, pieces = self._pieces()
        if not self.even:
            return (knots, pieces) if knots.size else (np.zeros(1), pieces * 2)
        mirrored = {id(piece): _mirrored(piece) for piece in pieces}
        return np.concatenate([-knots[::-1], [0.0], knots]), (*(mirrored[id(part)] for part in pieces[::-1]), *pieces)

    @property
    def _knots(self) -> Array:
        return self._own[0]

    @property
    def knots(self) -> Array:
        return self._knots[None, :]

    @cached_property
    def _kinds(self) -> tuple[list[LawPiece], IntArray]:
        """The pieces that differ, and the number of each piece among them."""
        different = {id(piece): piece for piece in self._own[1]}
        number = {key: kind for kind, key in enumerate(different)}
        return list(different.values()), np.array([number[id(piece)] for piece in self._own[1]], dtype=np.int64)

    def _evaluate(self, piece: IntArray, r: Array, order: int) -> Array:
        piece, r = np.broadcast_arrays(np.asarray(piece), np.asarray(r, dtype=float))
        out, (different, kinds) = np.empty(r.shape), self._kinds
        which = kinds[piece]
        for kind in np.unique(which):
            here, smooth = which == kind, different[kind]
            out[here] = (smooth.value, smooth.derivative, smooth.curvature)[order](r[here])
        return out

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
        return self._own[1][piece].text

    def _knot_sides(self) -> tuple[Array, Array]:
        left, right = super()._knot_sides()
        size = 1e-9 * (1.0 + np.abs(left) + np.abs(right))
        return left, np.where(np.abs(right - left) <= size, left, right)  # no kinks by rounding

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
        """alpha at samples: of all, or of those within the reach where the derivative falls without bound far out."""
        left, right = self.knot_slopes()
        if np.any(right < left):
            return np.inf
        r, piece = self._samples
        with np.errstate(all="ignore"):
            falls = np.nan_to_num(-self._evaluate(piece, r, 2), nan=0.0, posinf=np.inf, neginf=0.0)
        inner, outer = np.abs(r) <= self.reach, np.abs(r) >= _FAR[-2] * self.reach
        largest = float(falls.max(initial=0.0))
        if largest == np.inf or falls[outer].max() > 2.0 * falls[~outer].max():
            return float(falls[inner].max(initial=0.0))
        return largest

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
        rates = []
        last = self._knots.size
        far = np.array([1e4, 1e6]) * max(self.reach, float(np.abs(self._knots).max()))
        near, _ = self._growth
        for sign, piece in ((-1.0, 0), (1.0, last)):
            with np.errstate(all="ignore"):
                slope = sign * self._evaluate(np.full(2, piece), sign * far, 1)
            if not np.isfinite(slope).all():
                with np.errstate(all="ignore"):
                    rates.append(float(np.copysign(np.inf, self._evaluate(np.array([piece]), sign * far[:1], 0)[0])))
            elif abs(slope[1]) > 3.0 * abs(slope[0]) and abs(slope[1]) * self.reach > 1e-6:
                rates.append(float(np.copysign(np.inf, slope[1])))
            else:
                small = np.isfinite(near) and abs(slope[1]) < 1e-5 * near
                rates.append(0.0 if small else float(slope[1]))
        return rates[0], rates[1]

    def recession(self, sign: Array) -> Array:
        sign = np.asarray(sign, dtype=float)
        down, up = self._rates
        with np.errstate(invalid="ignore"):
            return np.where(sign > 0.0, sign * up, np.where(sign < 0.0, -sign * down, 0.0))

    # ---- for those who supply pieces -----------------------------------------------------------------------

    def _inside(self, low: float, high: float, count: int) -> Array:
        """Places inside a piece, dense towards its ends."""
        reach = max(self.reach, 2.0 * max((abs(x) for x in (low, high) if np.isfinite(x)), default=0.0))
        low = low if np.isfinite(low) else -1.5 * reach
        high = high if np.isfinite(high) else 1.5 * reach
        even = (np.arange(count) + 0.5) / count
        close = np.geomspace(1e-7, 0.3, count)
        return low + (high - low) * np.unique(np.concatenate([even, close, 1.0 - close]))


def _mirrored(piece: LawPiece) -> LawPiece:
    """The piece of an even law on the other side of zero."""
    return LawPiece(
        lambda r: piece.value(-r),
        lambda r: -piece.derivative(-r),
        lambda r: piece.curvature(-r),
        piece.text and f"-({piece.text}) at |r|",
    )


def check_joined(where: str, knots: Array, pieces: Sequence[LawPiece], reach: float, step: float = 0.0) -> None:
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


def middle_of(low: float, high: float) -> float:
    """A place between two ends, of which each may be infinite."""
    if np.isfinite(low) and np.isfinite(high):
        return float(0.5 * (low + high))
    if np.isfinite(low):
        return float(low + 1.0 + abs(low))
    return float(high - 1.0 - abs(high)) if np.isfinite(high) else 0.37
