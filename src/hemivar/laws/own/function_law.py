"""Laws given by Python functions: the derivative j', and perhaps the potential and the curvature."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import cast

import numpy as np
from numpy.typing import ArrayLike

from hemivar.basics.arguments import one_line, quoted
from hemivar.basics.types import Array, BoolArray
from hemivar.errors import ProblemError
from hemivar.laws.consistency import REMEDY, check_consistency
from hemivar.laws.own.own_law import LawPiece, OwnLaw, check_joined, middle_of
from hemivar.laws.parameters import checked_reach
from hemivar.laws.superpotential import Superpotential

__all__ = ["FunctionLaw", "differences"]

#: Weights at -2, -1, 0, 1, 2 of the interpolating polynomial in powers of t.
_STENCIL = np.linalg.inv(np.vander(np.arange(-2.0, 3.0), increasing=True))
#: The first step, as a part of the length of the piece or of the distance to zero; steps, and what each is
#: shorter by.
_FIRST, _SHORTER = 0.1, 4.0
#: Levels that are enough for most places, and the error up to which they are: a part of the rise over a step.
_USUAL, _LEVELS, _ENOUGH = range(1, 5), range(13), 2e-11
#: Roundings in a value, and what noise in values becomes in the derivative of the polynomial.
_ROUNDING, _NOISE = 2.0 * float(np.finfo(float).eps), 3.0
#: The end of a piece is left out by at most this part of its scale, and of the step: it may belong to the next.
_BESIDE, _BESIDE_STEP = 1e-9, 1e-3


def differences(function: Callable[[Array], Array], r: Array, low: float, high: float, scale: float) -> Array:
    """The derivative of a function inside a piece from ``low`` to ``high``, from differences of its values.

    The function has values (k,) at places (k,) and differs over the length ``scale``; places ``r`` outside of the piece
    are taken from the polynomial at its end.
    """
    shape, r = np.shape(r), np.ravel(np.asarray(r, dtype=float))
    rates, enough = _on_levels(function, r, low, high, scale, _USUAL)
    rest = np.flatnonzero(~enough)
    if rest.size:
        rates[rest] = _on_levels(function, r[rest], low, high, scale, _LEVELS)[0]
    return rates.reshape(shape)


def _on_levels(
    function: Callable[[Array], Array], r: Array, low: float, high: float, scale: float, levels: range
) -> tuple[Array, BoolArray]:
    """Derivatives (k,) at places (k,), and whether their errors are small, from steps of some levels."""
    longest = np.minimum(_FIRST * np.maximum(scale, np.abs(r)), 0.24 * (high - low))
    step = longest / _SHORTER ** np.array(levels)[:, None]
    margin = np.minimum(_BESIDE * scale, _BESIDE_STEP * step)
    centre = np.clip(r, low + 2.0 * step + margin, high - 2.0 * step - margin)
    stencil = centre + np.arange(-2.0, 3.0)[:, None, None] * step
    values = function(stencil.ravel()).reshape(stencil.shape)
    t, c = (r - centre) / step, np.tensordot(_STENCIL, values, axes=1)
    plain = (c[1] + t * (2.0 * c[2] + t * (3.0 * c[3] + t * 4.0 * c[4]))) / step
    bend = (2.0 * c[2] + t * (6.0 * c[3] + t * 12.0 * c[4])) / step**2
    change = np.diff(plain, axis=0, prepend=plain[:1])
    rates = plain + change / (_SHORTER**4 - 1.0)
    error = np.abs(np.diff(rates, axis=0, prepend=np.inf))
    error = np.maximum(error, step * np.abs(np.diff(bend, axis=0, prepend=bend[:1])))  # narrower than the step
    rise = np.ptp(values, axis=0)
    slope_seen = np.logical_or.accumulate(np.abs(rates) > 10.0 * error, axis=0)
    grainy = (rise == 0.0) & np.vstack([np.zeros((1, r.size), dtype=bool), slope_seen[:-1]])
    least = np.where(rise > 0.0, rise, np.inf).min(axis=0)
    grain = np.where(grainy.any(axis=0), least, 0.0)
    rounding = np.maximum(_ROUNDING * (np.abs(values).max(axis=0) + np.abs(r * plain)), grain) / step
    error = np.maximum(error, _NOISE * rounding)
    error[:-1] = np.maximum(error[:-1], error[1:] / _SHORTER)  # a small change may be luck where noise grows
    best = np.argmin(error, axis=0)[None]
    rate, off = (np.take_along_axis(part, best, axis=0)[0] for part in (rates, error))
    return rate, off <= _ENOUGH * rise[0] / step[0]


#: What a user gives: a function of an array, or, if it cannot take one, of a number.
GivenFunction = Callable[..., ArrayLike]

#: Gauss's rule on each of eight parts from the end of a piece; a law for which it is too coarse is refused.
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(12)
#: Samples in which turns of the curvature are looked for at most, and what a curve may leave a straight line by; with
#: 0.1 tests/laws find the same turns.
_MOST_SAMPLES, _BENT = 4000, 0.02


@dataclass(frozen=True, eq=False)
class _FunctionLaw(OwnLaw):
    """The law that :func:`FunctionLaw` makes."""

    potential: GivenFunction | None
    derivative_function: GivenFunction
    curvature_function: GivenFunction | None = None
    kinks_at: Sequence[float] = ()
    reach: float = 10.0
    even: bool = False
    name: str = "function"

    def __post_init__(self) -> None:
        checked_reach(self.reach, f"law '{self.name}'")
        kinks = np.asarray(self.kinks_at, dtype=float)
        if kinks.ndim != 1 or not np.isfinite(kinks).all():
            raise ProblemError(
                f"kinks of law '{self.name}' must be a list of finite numbers, not {quoted(self.kinks_at)}"
            )
        _ = self._own
        integrated = "its potential is integrated, too coarsely here: give a function for it too, or a smaller reach"
        by_differences = "it is computed by differences, which are too coarse here: give a function for it too"
        check_consistency(
            self,
            self.reach,
            remedies=(
                integrated if self.potential is None else REMEDY,
                by_differences if self.curvature_function is None else REMEDY,
            ),
        )

    def _called(self, function: GivenFunction, r: Array) -> Array:
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
                values = np.array([float(cast(float, function(x))) for x in r.ravel().tolist()]).reshape(r.shape)
            except Exception as error:
                raise ProblemError(f"a function of law '{self.name}' failed at a number r: {error}") from error
        return values

    def _pieces(self) -> tuple[Array, tuple[LawPiece, ...]]:
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
                        f"law '{self.name}' is not finite at r = {r[np.argmax(bad)]:.6g}; correct its function"
                    )
        check_joined(f"the potential of law '{self.name}'", kinks, plain, self.reach, 1e-11 * scale)
        turns: list[float] = []
        for i, piece in enumerate(plain):
            r, curvature = _refined(self._inside(float(ends[i]), float(ends[i + 1]), 300), piece.curvature)
            rounding = 1e-5 * float(np.abs(piece.derivative(r)).max()) / self.reach
            turns += _extrema(r, curvature, rounding)
        table = np.unique(np.concatenate([kinks, turns]))
        low = np.concatenate([[start], table])
        high = np.concatenate([table, [np.inf]])
        return table, tuple(plain[int(np.sum(kinks < middle_of(a, b)))] for a, b in zip(low, high, strict=True))

    def _piece(self, low: float, high: float, scale: float) -> LawPiece:
        """Functions that stay inside ``(low, high)``."""
        margin = _BESIDE * scale

        def curvature(r: Array) -> Array:
            r = np.asarray(r, dtype=float)
            if self.curvature_function is None:
                return differences(lambda x: self._called(self.derivative_function, x), r, low, high, scale)
            return self._called(self.curvature_function, np.clip(r, low + margin, high - margin))

        def derivative(r: Array) -> Array:
            r = np.asarray(r, dtype=float)
            inside = np.clip(r, low + margin, high - margin)
            values = self._called(self.derivative_function, inside)
            moved = r != inside
            if moved.any():
                values = values.copy()
                values[moved] += (r - inside)[moved] * curvature(inside[moved])
            return values

        def value(r: Array) -> Array:
            r = np.asarray(r, dtype=float)
            if self.potential is not None:
                return self._called(self.potential, r)
            anchor = low if np.isfinite(low) else high
            ends = anchor + (r - anchor)[..., None] * np.linspace(0.0, 1.0, 9)
            half = 0.5 * np.diff(ends, axis=-1)
            middle = 0.5 * (ends[..., 1:] + ends[..., :-1])
            at = middle[..., None] + half[..., None] * _NODES
            return np.asarray(np.einsum("...pk,k,...p->...", derivative(at), _WEIGHTS, half))

        return LawPiece(value, derivative, curvature)


def _refined(r: Array, of: Callable[[Array], Array]) -> tuple[Array, Array]:
    """Places in increasing order and a function there, halved where it bends, as far as samples see that it does."""
    values = of(r)
    size = float(np.ptp(values[np.isfinite(values)])) if np.isfinite(values).any() else 0.0
    left = np.arange(r.size - 1)
    while left.size and r.size + left.size <= _MOST_SAMPLES:
        middle = 0.5 * (r[left] + r[left + 1])
        at_middle = of(middle)
        bent = np.abs(at_middle - 0.5 * (values[left] + values[left + 1])) > _BENT * size
        bent &= r[left + 1] - r[left] > 1e-9 * np.abs(r[left]) + 1e-300
        new = left[bent]
        r, values = np.insert(r, new + 1, middle[bent]), np.insert(values, new + 1, at_middle[bent])
        left = np.concatenate([new, new + 1]) + np.tile(np.arange(new.size), 2)
        left.sort()
    return r, values


def _anchored(plain: list[LawPiece], kinks: Array, even: bool) -> list[LawPiece]:
    """Pieces whose values, each an integral from its own end, are joined to one continuous potential."""
    joined: list[LawPiece] = []
    base = 0.0
    for i, piece in enumerate(plain):
        if i > 0:
            previous = kinks[i - 1 : i]
            base = float(joined[-1].value(previous)[0])
        joined.append(_shifted(piece, base))
    return joined


def _shifted(piece: LawPiece, base: float) -> LawPiece:
    return LawPiece(lambda r: piece.value(r) + base, piece.derivative, piece.curvature, piece.text)


def _extrema(r: Array, curvature: Array, rounding: float) -> list[float]:
    """Places where a sampled curvature turns round by more than its noise."""
    if r.size < 3:
        return []
    size = float(np.ptp(curvature))
    noise = 1e-4 * size + 1e-6 * float(np.abs(curvature).max()) + rounding
    turns, best, direction = [], 0, 0
    for i in range(1, r.size):
        change = curvature[i] - curvature[best]
        if direction == 0:
            if abs(change) > noise:
                direction, best = (1 if change > 0.0 else -1), i
        elif change * direction > 0.0:
            best = i
        elif abs(change) > noise:
            turns.append(float(r[best]))
            direction, best = -direction, i
    return turns


def FunctionLaw(  # noqa: N802 - a law, named as the others are
    potential: GivenFunction | None = None,
    derivative: GivenFunction | None = None,
    curvature: GivenFunction | None = None,
    *,
    kinks: Sequence[float] = (),
    reach: float = 10.0,
    even: bool = False,
    name: str = "function",
) -> Superpotential:
    """A law given by a Python function for the derivative of its potential.

    What else is not given is computed: the potential by Gauss quadrature, the curvature by extrapolated differences
    that never reach across a kink, with steps that suit the width of the function at every place. Who has the potential
    only writes it as a formula, for :func:`FormulaLaw`.

    Parameters
    ----------
    potential : callable, optional
        j, r (m,) -> (m,).
    derivative : callable
        j'; its value at a kink does not matter.
    curvature : callable, optional
        j''.
    kinks : sequence of float
        Every place where j' or j'' jumps. ``hemivar.laws.testing.check_law`` finds kinks that are missing here.
    reach : float
        Length up to which the constants and turns of the curvature are sampled: larger than any displacement that
        matters.  Samples follow what they see; a turn that lies between two of them by itself is missed.
    even : bool
        The functions hold for r >= 0 and j(-r) = j(r): for friction.
    name : str
        What the law is called in messages.

    Returns
    -------
    Superpotential

    Raises
    ------
    ProblemError
        If the derivative is not given, or a function returns something else than finite numbers, or samples show that
        they do not belong to each other: a derivative that is not that of the potential, a curvature that is not that
        of the derivative, a kink that is not listed.

    Examples
    --------
    >>> import numpy as np
    >>> import hemivar as hv
    >>> law = hv.laws.FunctionLaw(derivative=lambda r: np.where(r > 0.0, 3.0 * r, 0.0), kinks=[0.0])
    >>> law.derivative([-1.0, 0.5])
    array([0. , 1.5])
    """
    one_line(name, "the name of a law")
    if derivative is None:
        raise ProblemError(
            f"law '{name}' has no derivative; give derivative=, the function j', or write the potential as a formula: "
            "FormulaLaw('...')"
        )
    return _FunctionLaw(potential, derivative, curvature, kinks, reach, even, name)
