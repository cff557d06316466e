"""All stationary points of a problem whose laws are piecewise quadratic: every combination of segments is tried."""

from __future__ import annotations

import numpy as np

from hemivar._typing import Array, IntArray
from hemivar.branches.chain import Chain

__all__ = ["enumerate_points"]

_CHUNK = 4096


def enumerate_points(chain: Chain) -> tuple[list[tuple[Array, IntArray]], bool]:
    """Stationary points ``(theta, segment)``, and whether there is a continuum of them (then one of it is given).

    On each combination of segments F is affine: one linear system and a check of the ends.
    """
    n = chain.size
    if n == 0:
        return [(np.zeros(0), np.zeros(0, dtype=np.int64))], False
    rows = np.arange(n)
    kink = chain.kink
    rate = np.where(kink, 0.0, 1.0)
    slope = np.zeros(kink.shape)
    lam = np.zeros(kink.shape)
    displacement = np.where(kink, chain.knot, chain.value)
    for s in range(kink.shape[1]):
        segment = np.minimum(np.full(n, s), chain.count - 1)
        _, values, _, slopes = chain.evaluate(chain.pick(chain.origin, segment), segment)
        lam[:, s], slope[:, s] = values, slopes
    tolerance = 1e-10 * chain.length
    size = float(np.abs(chain.force).max()) + float(np.abs(chain.matrix).max()) * chain.length
    found: list[tuple[Array, IntArray]] = []
    continuum = False
    total = int(chain.combinations)
    for first in range(0, total, _CHUNK):
        number = np.arange(first, min(first + _CHUNK, total))
        choice = np.stack(np.unravel_index(number, tuple(chain.count)), axis=1)
        J = chain.matrix[None] * rate[rows, choice][:, None, :]
        J[:, rows, rows] += chain.weights * slope[rows, choice]
        rhs = chain.force - displacement[rows, choice] @ chain.matrix - chain.weights * lam[rows, choice]
        step, singular = _solve(J, rhs)
        continuum_here = np.zeros(len(number), dtype=bool)
        for b in np.flatnonzero(singular):
            step[b] = np.linalg.lstsq(J[b], rhs[b], rcond=1e-12)[0]
            consistent = np.abs(J[b] @ step[b] - rhs[b]).max() <= 1e-10 * size
            step[b] = step[b] if consistent else np.nan
            continuum_here[b] = consistent
        theta = chain.origin[rows, choice] + step
        with np.errstate(invalid="ignore"):
            good = (theta >= chain.start[rows, choice] - tolerance) & (theta <= chain.end[rows, choice] + tolerance)
        for b in np.flatnonzero(good.all(axis=1)):
            ends = chain.start[rows, choice[b]], chain.end[rows, choice[b]]
            found.append((np.clip(theta[b], *ends), choice[b].astype(np.int64)))
            continuum |= bool(continuum_here[b])
    return found, continuum


def _solve(J: Array, rhs: Array) -> tuple[Array, Array]:
    """Solutions of many small systems, and which of them are singular (these are left at nan)."""
    size = np.abs(J).max(axis=(1, 2))
    # numpy refuses the whole batch for one singular matrix; a determinant tells which ones to take out
    scale = np.abs(J).max(axis=2)
    scaled = J / np.where(scale > 0.0, scale, 1.0)[:, :, None]
    singular = (np.abs(np.linalg.det(scaled)) <= 1e-13) | (size == 0.0)
    out = np.full(rhs.shape, np.nan)
    regular = ~singular
    out[regular] = np.linalg.solve(J[regular], rhs[regular][:, :, None])[:, :, 0]
    return out, singular
