"""Is a potential of penetration and slip a law, and how weakly convex?  Samples, and proofs by interval arithmetic.

A law of this kind has a continuous gradient, but for a jump upwards at r = 0 and a slope f_s >= 0 at s = 0.  Then
``f + alpha_n/2 r^2 + alpha_t/2 s^2`` is convex in the penetration and the vector of the slip where the matrix
``[[f_rr + alpha_n, f_rs], [f_rs, f_ss + alpha_t]]`` is at least zero.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from hemivar.basics.first_use import IMPORTS
from hemivar.basics.types import Array, BoolArray
from hemivar.errors import ProblemError
from hemivar.formula.curvature import enclosed_range
from hemivar.formula.enclosure import enclosed_on_boxes
from hemivar.formula.intervals import Pair
from hemivar.laws.coupled.plane_potential import FormulaPotential, PlanePotential

__all__ = ["best_ratio", "check_plane_potential", "least_eigenvalues", "proved_alpha", "sample_places", "tiny"]

#: Places on every line that is looked at, and lines; with a quarter of the places tests/laws/coupled refuse the same.
_PLACES, _LINES = 240, 13
#: Parts of each line that are halved; with 6 tests/laws/coupled refuse the same.
_LOOKED = 24
#: How far a rise may differ from the integral of the slope: of the rise there, and of the largest slope; with a tenth
#: of both tests/laws/coupled refuse the same.
_ALLOWED = (0.02, 1e-3)
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(5)
#: A place nearer to zero than this part of the reach counts as zero. Jumps below this part of a slope are none: any
#: value from 1e-9 to 1e-5 gives the same answers in tests/laws/coupled.
_TINY, _JUMP = 1e-60, 1e-7
#: A bound is taken where it is at most so much above what was seen, 10 %, as CoupledFormulaLaw says; with 1.02 alpha of
#: a Gaussian is not shown.
_TIGHT = 1.1


def tiny(reach: float) -> float:
    """What replaces zero in the variables, so that conditions choose a side."""
    return _TINY * reach


def _line(reach: float, count: int = _PLACES) -> Array:
    """Places from 0 to the reach, dense towards 0."""
    even = np.linspace(0.0, 1.0, count)
    close = np.geomspace(1e-6, 1.0, count // 2)
    parts = np.unique(np.concatenate([even, close]))
    parts[0] = _TINY
    return np.asarray(reach * parts)


def sample_places(reach: float, rigid: bool, count: int = 61) -> tuple[Array, Array]:
    """Penetrations and slips (k,) on a grid up to the reach, on both sides of r = 0 and dense towards 0."""
    line = _line(reach, count)
    r, s = np.meshgrid(-line[::-1] if rigid else np.concatenate([-line[::-1], line]), line, indexing="ij")
    return r.ravel(), s.ravel()


def check_plane_potential(f: PlanePotential, reach: float, rigid: bool) -> tuple[bool, bool, float]:
    """Refuse a potential that is no law.

    Else whether the derivative jumps at r = 0, whether something resists the first slip, and the largest slope seen.
    """
    r, s = sample_places(reach, rigid)
    value, (by_r, by_s) = f.value(r, s), f.gradient(r, s)
    rr, rs, ss = f.hessian(r, s)
    for what, part in (("", value), ("the gradient of ", by_r + by_s), ("the second derivative of ", rr + rs + ss)):
        bad = ~np.isfinite(part)
        if bad.any():
            i = int(np.argmax(bad))
            raise ProblemError(
                f"{what}{f.shown} is not finite at r = {_shown(r[i], reach)}, s = {_shown(s[i], reach)}; give a "
                "potential that is smooth on either side of r = 0 and for s >= 0"
            )
    size = float(max(np.abs(by_r).max(), np.abs(by_s).max()))
    zero = _TINY * reach
    # the slip is a length
    at = np.unique(r)
    first = f.gradient(at, np.full(at.size, zero))[1]
    if (first < -_JUMP * size).any():
        i = int(np.argmin(first))
        raise ProblemError(
            f"{f.shown} falls with the slip at s = 0 (by {-first[i]:.4g} per length at r = {_shown(at[i], reach)}); "
            "take a potential that does not fall there, such as one of s^2"
        )
    kinked = _jump_at_zero(f, reach, size) if not rigid else False
    for places in _lines(reach, rigid):
        _check_line(f, places, reach, size)
    return kinked, bool((first > _JUMP * size).any()), size


def _shown(r: float, reach: float) -> str:
    return f"{0.0 if abs(r) <= 1e-9 * reach else r:.4g}"


def _jump_at_zero(f: PlanePotential, reach: float, size: float) -> bool:
    s = _line(reach)
    zero = np.full(s.size, _TINY * reach)
    below, above = f.value(-zero, s), f.value(zero, s)
    if (np.abs(above - below) > _JUMP * size * reach).any():
        i = int(np.argmax(np.abs(above - below)))
        raise ProblemError(f"{f.shown} jumps at r = 0, s = {s[i]:.4g}; give a potential that is continuous")
    jump = f.gradient(zero, s)[0] - f.gradient(-zero, s)[0]
    if (jump < -_JUMP * size).any():
        i = int(np.argmin(jump))
        raise ProblemError(
            f"the derivative of {f.shown} by r falls by {-jump[i]:.4g} at r = 0, s = {_shown(s[i], reach)}; give "
            f"the drop a slope instead"
        )
    return bool((jump > _JUMP * size).any())


def _lines(reach: float, rigid: bool) -> list[Array]:
    """Places (k, 2) along lines: along r on either side of 0, along s, and aslant."""
    line, some = _line(reach), _line(reach, _LINES)
    lines = []
    for side in (-1.0,) if rigid else (-1.0, 1.0):
        for fixed in some:
            lines.append(np.column_stack([side * line, np.full(line.size, fixed)]))
            lines.append(np.column_stack([np.full(line.size, side * fixed), line]))
        lines += [line[:, None] * np.array([side, slope]) / max(1.0, slope) for slope in (0.3, 1.0, 3.0)]
    return lines


def _check_line(f: PlanePotential, places: Array, reach: float, size: float) -> None:
    """Refuse a gradient that jumps along a line, one that is not that of the value, and a value that jumps."""
    start, end = places[:-1], places[1:]
    low, high = (np.stack(f.gradient(x[:, 0], x[:, 1]), axis=1) for x in (start, end))
    looked = np.argsort(-np.abs(high - low).max(axis=1))[:_LOOKED]
    first, last, low, high = start[looked], end[looked], low[looked], high[looked]
    for _ in range(44):  # the ends of a part are 1e-16 of the reach apart then
        middle = 0.5 * (first + last)
        at_middle = np.stack(f.gradient(middle[:, 0], middle[:, 1]), axis=1)
        left = (np.abs(at_middle - low).max(axis=1) >= np.abs(high - at_middle).max(axis=1))[:, None]
        first, last = np.where(left, first, middle), np.where(left, middle, last)
        low, high = np.where(left, low, at_middle), np.where(left, at_middle, high)
    jump = np.abs(high - low).max(axis=1)
    if (jump > 10.0 * _JUMP * size).any():
        i = int(np.argmax(jump))
        raise ProblemError(
            f"the derivative of {f.shown} jumps by {jump[i]:.4g} at r = {_shown(first[i, 0], reach)}, s = "
            f"{_shown(first[i, 1], reach)}; it may jump at r = 0 only: give the change a slope"
        )
    middle, half = 0.5 * (start + end), 0.5 * (end - start)
    at = middle[:, None, :] + half[:, None, :] * _NODES[:, None]
    flat = at.reshape(-1, 2)
    slope = np.stack(f.gradient(flat[:, 0], flat[:, 1]), axis=1).reshape(at.shape)
    rise = (np.einsum("knd,kd->kn", slope, half) * _WEIGHTS).sum(axis=1)
    value = f.value(places[:, 0], places[:, 1])
    steps = np.linalg.norm(end - start, axis=1)
    most = np.abs(slope).sum(axis=2).max(axis=1) * steps
    rounding = 64.0 * np.finfo(float).eps * np.abs(value).max()
    off = np.abs(np.diff(value) - rise) - _ALLOWED[0] * most - _ALLOWED[1] * size * steps - rounding
    if (off > 0.0).any():
        i = int(np.argmax(off))
        raise ProblemError(
            f"{f.shown} rises by {np.diff(value)[i]:.4g} from r = {_shown(start[i, 0], reach)}, s = "
            f"{_shown(start[i, 1], reach)} to r = {_shown(end[i, 0], reach)}, s = {_shown(end[i, 1], reach)}, but its "
            f"gradient says {rise[i]:.4g}; correct the gradient"
        )


# ---- convexity ------------------------------------------------------------------------------------------------


def least_eigenvalues(hessian: tuple[Array, Array, Array], ratio: float) -> Array:
    """Least eigenvalue of ``[[rr, rs/ratio], [rs/ratio, ss/ratio^2]]``, (k,)."""
    rr, rs, ss = hessian[0], hessian[1] / ratio, hessian[2] / ratio**2
    return np.asarray(0.5 * (rr + ss) - np.hypot(0.5 * (rr - ss), rs))


def best_ratio(hessian: tuple[Array, Array, Array]) -> float:
    """The root of alpha_t over alpha_n for which both together are least, as parts of the largest stiffnesses."""
    largest = [float(np.abs(part).max()) for part in hessian]
    stiff = [max(part, 1e-2 * max(largest), 1e-300) for part in (largest[0], largest[2])]
    start = float(np.sqrt(stiff[1] / stiff[0]))

    def both(log: float) -> float:
        ratio = start * float(np.exp(log))
        alpha = max(0.0, -float(least_eigenvalues(hessian, ratio).min()))
        return alpha / stiff[0] + ratio**2 * alpha / stiff[1]

    with IMPORTS:
        from scipy.optimize import minimize_scalar  # only here: SciPy takes long to load it

    logs = np.linspace(-7.0, 7.0, 57)
    best = float(logs[int(np.argmin([both(log) for log in logs.tolist()]))])
    least = minimize_scalar(both, bounds=(best - 0.25, best + 0.25), method="bounded", options={"xatol": 1e-9})
    return start * float(np.exp(least.x if least.fun <= both(best) else best))


def proved_alpha(f: FormulaPotential, reach: float, rigid: bool, ratio: float, seen: float) -> float:
    """A bound of alpha_n for all r and s up to the reach, shown by intervals; inf where none is found near ``seen``.

    The branches of abs, min, max and piecewise must lie at r = 0 and s = 0 only, where the derivative by r must rise.
    """
    sides = (-1.0,) if rigid else (-1.0, 1.0)
    nodes = [_smooth_node(f, reach, side) for side in sides]
    if any(node is None for node in nodes):
        return np.inf
    whole = [f.derivatives(node) for node in nodes if node is not None]
    if not rigid and whole[0][0] != whole[1][0] and not _rises(f, whole, reach):
        return np.inf
    if not all(_rests(f, own[2], reach, side) for own, side in zip(whole, sides, strict=True)):
        return np.inf
    bound = 0.0
    for own, side in zip(whole, sides, strict=True):
        low, high = (-reach, 0.0) if side < 0.0 else (0.0, reach)
        with np.errstate(over="ignore"):
            enclosed = enclosed_range(
                _least_on_boxes(f, own, ratio), np.array([low, 0.0]), np.array([high, reach]), _everywhere
            )
        bound = max(bound, -enclosed.lower)
    scale = max(seen, _JUMP * float(np.abs(f.hessian(*sample_places(reach, rigid, 9))[0]).max()))
    return bound if bound <= _TIGHT * seen + 0.01 * scale else np.inf


def _everywhere(at: Array) -> BoolArray:
    return np.ones(len(at), dtype=bool)


def _least_on_boxes(f: FormulaPotential, own: tuple[int, ...], ratio: float) -> Callable[[Array, Array], Pair]:
    def bounds(low: Array, high: Array) -> Pair:
        """Bounds of the least eigenvalue, scaled, and at most 0, on boxes between corners (k, 2)."""
        sides = {"r": (low[:, 0], high[:, 0]), "s": (low[:, 1], high[:, 1])}
        below, above = [], []
        for node, scale in zip(own[3:], (1.0, ratio, ratio**2), strict=True):
            enclosed = enclosed_on_boxes(f.graph, node, sides)
            below.append(enclosed[0] / scale)
            above.append(enclosed[1] / scale)
        with np.errstate(invalid="ignore"):
            cross = np.maximum(np.abs(below[1]), np.abs(above[1]))
            least = np.where((below[1] <= 0.0) & (above[1] >= 0.0), 0.0, np.minimum(np.abs(below[1]), np.abs(above[1])))
            # the least eigenvalue rises with both diagonal entries and falls with the size of the other
            ends = [
                0.5 * (p + q) - np.hypot(0.5 * (p - q), c) * (1.0 + sign * 1e-14) - sign * 1e-14 * np.abs(p + q)
                for p, q, c, sign in ((below[0], below[2], cross, 1.0), (above[0], above[2], least, -1.0))
            ]
            ends[0] = np.where(cross == 0.0, np.minimum(below[0], below[2]), ends[0])
        sure = np.isfinite(ends[0]) & np.isfinite(ends[1])
        return np.where(sure, np.minimum(ends[0], 0.0), -np.inf), np.where(sure, np.minimum(ends[1], 0.0), np.inf)

    return bounds


def _smooth_node(f: FormulaPotential, reach: float, side: float) -> int | None:
    """The branch that holds for all r of one side and all s within the reach, if that is one and shown."""
    near = _TINY * reach
    r, s = side * np.geomspace(near, reach, 40), np.geomspace(near, reach, 40)[::-1]
    branches = np.unique(f.graph.branches_at(f.nodes[0], {"r": r, "s": s}))
    if branches.size != 1:
        return None
    ends = np.sort(np.array([0.0, side * reach]))
    sides = {"r": (ends[:1], ends[1:]), "s": (np.zeros(1), np.array([reach]))}
    for node in f.graph.switching(f.nodes[0]):
        below, above = enclosed_on_boxes(f.graph, node, sides)
        if not (below[0] >= 0.0 or above[0] <= 0.0):
            return None
    return int(branches[0])


def _at_edge(f: FormulaPotential, node: int, r: Pair, s: Pair) -> Pair:
    return enclosed_on_boxes(f.graph, node, {"r": r, "s": s})


def _rises(f: FormulaPotential, whole: list[tuple[int, ...]], reach: float) -> bool:
    """Whether the derivative by r is shown not to fall at r = 0, and the potential not to jump."""
    ends = np.linspace(0.0, reach, 401)
    zero, s = (np.zeros(400), np.zeros(400)), (ends[:-1], ends[1:])
    (left, _), (_, right) = _at_edge(f, whole[1][1], zero, s), _at_edge(f, whole[0][1], zero, s)
    return bool((left >= right).all())


def _rests(f: FormulaPotential, node: int, reach: float, side: float) -> bool:
    """Whether f_s is shown to be at least 0 at s = 0."""
    ends = np.sort(side * np.linspace(0.0, reach, 401))
    below, _ = _at_edge(f, node, (ends[:-1], ends[1:]), (np.zeros(400), np.zeros(400)))
    return bool((below >= 0.0).all())
