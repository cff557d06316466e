"""A quick look, from samples, at whether what a user gave for a law fits together; the kit in testing looks closer."""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from weakref import WeakSet

import numpy as np

from hemivar.basics.types import Array, IntArray
from hemivar.errors import ProblemError
from hemivar.laws.superpotential import Superpotential

__all__ = ["check_consistency", "check_own"]

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(5)
#: Parts of every piece, pieces looked at, and parts of a part that looks wrong.
_CELLS = 24
_MOST_PIECES = 40
_FINER = 64
#: How far a rise may differ from the integral of the rate: of the rate there, of the largest rate.
_ALLOWED = (0.02, 1e-3)

_REMEDY = "correct the functions, or leave one of them out"

_Function = Callable[[IntArray, Array], Array]

_SEEN: WeakSet[Superpotential] = WeakSet()


def check_own(law: Superpotential) -> None:
    """Look at a law of a class that is not hemivar's, once, if its parameters are numbers.

    Raises
    ------
    ProblemError
        See :func:`check_consistency`.
    """
    if type(law).__module__.startswith("hemivar."):
        return
    try:
        if law in _SEEN:
            return
    except TypeError:  # a class that cannot be hashed is looked at again
        pass
    try:
        one = law.take(np.array([0])) if law.knots.shape[0] > 1 else law
        reach = 3.0 * float(np.abs(one.knots[np.isfinite(one.knots)]).max(initial=0.0)) or 1.0
        one.value(np.zeros(1))
    except Exception:  # parameters that are not known yet, or a law that only the kit can describe
        return
    check_consistency(one, reach, alpha=float(np.atleast_1d(one.weak_convexity)[0]))
    with contextlib.suppress(TypeError):
        _SEEN.add(law)


def check_consistency(law: Superpotential, reach: float, alpha: float | None = None, remedy: str = _REMEDY) -> None:
    """Refuse a law of one contact point whose value, derivative and curvature do not belong to each other.

    Parameters
    ----------
    law : Superpotential
    reach : float
        Places between ``-reach`` and ``reach`` are tried.
    alpha : float, optional
        Weak convexity as the user states it, to be checked too.
    remedy : str
        What to do about a curvature that does not fit.

    Raises
    ------
    ProblemError
        The derivative is not that of the value, the curvature not that of the derivative, j(0) is not zero, or the
        derivative falls faster than alpha allows; the message names the place.
    """
    piece, low, high = _cells(law, reach)
    if not piece.size:
        return
    who = f"law '{law.name}'"
    with np.errstate(all="ignore"):
        _check_slopes(law, reach, who)
        _check_jumps(law, (piece, low, high), who)
        _compare(law.piece_value, law.piece_derivative, (piece, low, high), f"the derivative of {who}", _REMEDY)
        _compare(law.piece_derivative, law.piece_curvature, (piece, low, high), f"the curvature of {who}", remedy)
        origin = np.clip(np.zeros(1), law.domain.lower, law.domain.upper)
        start = float(law.value(origin)[0])
        size = float(np.abs(law.piece_derivative(piece, 0.5 * (low + high))).max())
        if not abs(start) <= 1e-6 * size * reach + 1e-300:
            raise ProblemError(
                f"the value of {who} is {start:.6g} at r = {origin[0]:.6g}; subtract it, so that it is 0"
            )
        if alpha is None or np.isinf(alpha):
            return
        fall = (law.piece_derivative(piece, low) - law.piece_derivative(piece, high)) / (high - low)
        left, right = law.knot_slopes()
        inner = np.isfinite(law.knots[0]) & np.isfinite(left[0]) & np.isfinite(right[0])
        down = inner & (left[0] - right[0] > 1e-6 * size)
    if down.any():
        raise ProblemError(
            f"alpha of {who} is {alpha:g}, but its derivative jumps down at r = {law.knots[0][np.argmax(down)]:.6g}: "
            "give alpha = inf"
        )
    wide = high - low > 1e-4 * reach
    worst = int(np.argmax(np.where(wide, fall, -np.inf)))
    if wide.any() and fall[worst] > alpha * 1.01 + 1e-4 * size / reach:
        raise ProblemError(
            f"alpha of {who} is {alpha:g}, but its derivative falls by {fall[worst]:.6g} per length between "
            f"r = {low[worst]:.6g} and {high[worst]:.6g}; alpha must be at least that"
        )


def _check_slopes(law: Superpotential, reach: float, who: str) -> None:
    """Refuse a value that rises ever more steeply next to a knot or to zero."""
    knots = law.knots[0][np.isfinite(law.knots[0])][:_MOST_PIECES]
    lower, upper = float(law.domain.lower.ravel()[0]), float(law.domain.upper.ravel()[0])
    steps = reach * np.array([1e-3, 1e-5, 1e-7, 1e-9])
    places = knots if (np.abs(knots) <= steps[0]).any() else np.append(knots, 0.0)  # a knot beside zero stands for it
    for place in np.unique(places):
        for side in (-1.0, 1.0):
            at = place + side * steps
            if not lower <= at[0] <= upper:
                continue
            rate = np.abs((law.value(at) - law.value(np.full(steps.size, place))) / steps)
            if np.all(rate[1:] > 1.3 * rate[:-1]):
                raise ProblemError(
                    f"the derivative of {who} grows without bound at r = {place:.6g}; a law needs a finite slope "
                    f"everywhere (but at jumps of its derivative)"
                )


def _check_jumps(law: Superpotential, cells: tuple[IntArray, Array, Array], who: str) -> None:
    """Refuse a jump of the derivative inside a piece, found by halving the cells in which it rises most."""
    piece, low, high = cells
    rise = np.abs(law.piece_derivative(piece, high) - law.piece_derivative(piece, low))
    size = float(np.abs(law.piece_derivative(piece, 0.5 * (low + high))).max())
    most = np.argsort(rise)[-8:]
    most = most[rise[most] > 1e-3 * size]
    if not most.size:
        return
    piece, low, high, whole = piece[most], low[most], high[most], rise[most]
    width = high - low
    first, last = law.piece_derivative(piece, low), law.piece_derivative(piece, high)
    for _ in range(30):
        middle = 0.5 * (low + high)
        between = law.piece_derivative(piece, middle)
        left = np.abs(between - first) >= np.abs(last - between)
        low, high = np.where(left, low, middle), np.where(left, middle, high)
        first, last = np.where(left, first, between), np.where(left, between, last)
    rest = np.abs(last - first)
    jumps = (rest > 0.1 * whole) & (high - low < 1e-8 * width)
    if jumps.any():
        i = int(np.argmax(jumps))
        raise ProblemError(
            f"the derivative of {who} jumps by {rest[i]:.6g} at r = {low[i]:.6g}, which is none of its kinks; list "
            f"every place where it jumps in kinks"
        )


def _cells(law: Superpotential, reach: float) -> tuple[IntArray, Array, Array]:
    """Parts of the pieces within the reach: number of the piece, and ends."""
    knots = law.knots[0][np.isfinite(law.knots[0])]
    lower, upper = float(law.domain.lower.ravel()[0]), float(law.domain.upper.ravel()[0])
    ends = np.concatenate([[-reach], np.clip(knots, -reach, reach), [reach]])
    numbers = np.flatnonzero(np.diff(np.clip(ends, lower, upper)) > 1e-9 * reach)
    if numbers.size > _MOST_PIECES:
        numbers = numbers[np.linspace(0, numbers.size - 1, _MOST_PIECES).astype(np.int64)]
    ends = np.clip(ends, lower, upper)
    share = np.unique(np.concatenate([np.linspace(0.0, 1.0, _CELLS // 2 + 1), np.geomspace(1e-4, 0.04, _CELLS // 4)]))
    start, width = ends[numbers], ends[numbers + 1] - ends[numbers]
    at = start[:, None] + width[:, None] * (1e-9 + (1.0 - 2e-9) * share)
    piece = np.repeat(numbers.astype(np.int64), share.size - 1)
    return piece, at[:, :-1].ravel(), at[:, 1:].ravel()


def _mismatch(of: _Function, rate: _Function, cells: tuple[IntArray, Array, Array]) -> tuple[Array, Array, Array]:
    """Mean rise over each cell, mean of the rate, and how far they differ beyond what is allowed."""
    piece, low, high = cells
    rise = (np.asarray(of(piece, high)) - of(piece, low)) / (high - low)
    middle, half = 0.5 * (low + high), 0.5 * (high - low)
    rates = np.stack([np.broadcast_to(rate(piece, middle + half * t), middle.shape) for t in _NODES])
    mean = 0.5 * _WEIGHTS @ rates
    size = np.abs(rates).max(axis=0)
    noise = 1e-11 * (np.abs(of(piece, low)) + np.abs(of(piece, high))) / (high - low)
    allowed = _ALLOWED[0] * size + _ALLOWED[1] * float(size[np.isfinite(size)].max(initial=0.0)) + noise
    return rise, mean, np.abs(rise - mean) - allowed


def _compare(of: _Function, rate: _Function, cells: tuple[IntArray, Array, Array], what: str, remedy: str) -> None:
    """Refuse a rate that is not that of the function, where a finer look confirms it."""
    piece, low, high = cells
    _, _, wrong = _mismatch(of, rate, cells)
    worst = int(np.argmax(np.nan_to_num(wrong, nan=-np.inf)))
    if not wrong[worst] > 0.0:
        return
    ends = np.linspace(low[worst], high[worst], _FINER + 1)
    fine = (np.full(_FINER, piece[worst]), ends[:-1], ends[1:])
    rise, mean, still = _mismatch(of, rate, fine)
    if np.count_nonzero(still > 0.0) <= _FINER // 4:  # a narrow feature, which the coarse cell stepped over
        return
    i = int(np.argmax(still))
    raise ProblemError(
        f"{what} is {mean[i]:.6g} between r = {fine[1][i]:.6g} and {fine[2][i]:.6g}, but it should be {rise[i]:.6g}; "
        f"{remedy}"
    )
