"""The local problem of one contact point, minimised by walking downhill instead of globally."""

from __future__ import annotations

import numpy as np

from hemivar.basics.types import Array
from hemivar.laws import ContactLaw, Superpotential

__all__ = ["downhill_minimiser", "one_sided_slopes"]


def one_sided_slopes(law: Superpotential, r: Array) -> tuple[Array, Array]:
    """Derivatives of j to the left and to the right of each ``r (m,)``; -inf and +inf at the ends of the domain."""
    left = law.derivative(r)
    right = law.piece_derivative(np.asarray(np.sum(r[..., None] >= law.knots, axis=-1), dtype=np.int64), r)
    bound = law.domain
    return np.where(r <= bound.lower, -np.inf, left), np.where(r >= bound.upper, np.inf, right)


def downhill_minimiser(law: ContactLaw, a: Array, b: Array, r: Array) -> Array:
    """The local minimiser of ``a_n/2 r_n^2 + a_t/2 |r_t|^2 - b.r + j(r)`` that is reached from ``r`` downhill.

    Parameters
    ----------
    a : array (m, 2)
        Curvature of the normal and of the tangential part.
    b, r : arrays (m, d)
        Force and starting point, the latter in the domain of the law.
    """
    out = np.empty(r.shape)
    out[:, 0] = _scalar(law.normal, a[:, 0], b[:, 0], r[:, 0])
    if r.shape[1] == 2:
        out[:, 1] = _scalar(law.tangential, a[:, 1], b[:, 1], r[:, 1])
    elif r.shape[1] > 2:
        # Turning the slip into the direction of the force lowers the energy; what is left is radial.
        size = np.linalg.norm(b[:, 1:], axis=1)
        old = np.linalg.norm(r[:, 1:], axis=1)
        own = r[:, 1:] / np.where(old > 0.0, old, 1.0)[:, None]
        own[:, 0] = np.where(old > 0.0, own[:, 0], 1.0)
        heading = np.where(size[:, None] > 0.0, b[:, 1:] / np.where(size > 0.0, size, 1.0)[:, None], own)
        out[:, 1:] = np.maximum(_scalar(law.tangential, a[:, 1], size, old), 0.0)[:, None] * heading
    return out


def _scalar(law: Superpotential, a: Array, b: Array, r: Array) -> Array:
    points, energies = law.local_minimisers(a, b)
    left, right = one_sided_slopes(law, r)
    rising, falling = a * r - b + left, a * r - b + right
    valid = np.isfinite(energies)
    # A minimiser that misses r by rounding is the one next to r.
    rounding = 1e-13 * (np.abs(r) + np.abs(b) / np.maximum(a, 1e-300))[..., None]
    after = np.where(valid & (points >= r[..., None] - rounding), points, np.inf).min(axis=-1)
    before = np.where(valid & (points <= r[..., None] + rounding), points, -np.inf).max(axis=-1)
    go_right, go_left = falling < 0.0, rising > 0.0
    lowest = np.where(go_right, -falling, 0.0) >= np.where(go_left, rising, 0.0)
    target = np.where(go_right & (lowest | ~go_left), after, np.where(go_left, before, r))
    return np.where(np.isfinite(target), target, np.nan)
