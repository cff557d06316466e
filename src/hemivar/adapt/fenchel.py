"""The gap of Fenchel's inequality on contact facets, where the force itself, clipped, is taken for a multiplier.

With ``jh = j + alpha/2 |.|^2`` convex, ``y = zeta + alpha r`` and ``jh*`` its conjugate

    D = jh(r) + jh*(y) - y . r  >=  0,

zero where zeta is in dj(r). The supremum in ``jh*(y) = sup_s (y . s - jh(s))`` is a local problem that laws solve
exactly. Radial laws: that of the profile at ``|y|``.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hemivar.adapt.contact_traces import ContactTraces
from hemivar.basics.types import Array
from hemivar.laws import Superpotential

__all__ = ["FenchelGap", "fenchel_gap"]

#: Slope, over that of the largest force at the largest displacement, that changes no minimum.
_SLIGHT = 1e-12


@dataclass(frozen=True, eq=False)
class FenchelGap:
    """Contact facets with the clipped force for a multiplier, (k,) each.

    Attributes
    ----------
    normal, tangential : arrays
        Integrals of the squares of what clipping takes away.
    normal_gap, tangential_gap : arrays
        Integrals of D; inf where the conjugate is.
    """

    normal: Array
    tangential: Array
    normal_gap: Array
    tangential_gap: Array


def fenchel_gap(traces: ContactTraces, forces: Array) -> FenchelGap:
    """The gap of forces in local components (k, q, d) at the points of the contact facets."""
    shape = traces.weights.shape
    law = traces.law
    r, xi = traces.local.reshape(-1, forces.shape[-1]), forces.reshape(-1, forces.shape[-1])
    zeta = xi.copy()
    every = np.ones(len(r))
    points = traces.data.problem.mesh.points
    extent = float((points.max(axis=0) - points.min(axis=0)).max())
    alpha = np.broadcast_to(law.normal.weak_convexity, every.shape)
    low = np.where(alpha > 0.0, -np.inf, -law.normal.recession(-every))
    high = np.where(alpha > 0.0, np.inf, law.normal.recession(every))
    zeta[:, 0] = np.clip(xi[:, 0], low, high)
    y = zeta[:, 0] + alpha * r[:, 0]
    normal = _gap(law.normal, alpha, r[:, 0], y, y * r[:, 0], extent)

    scalar = law.tangential
    alpha = np.broadcast_to(scalar.weak_convexity, every.shape)
    size = np.sqrt(np.einsum("mi,mi->m", xi[:, 1:], xi[:, 1:]))
    most = np.where(alpha > 0.0, np.inf, scalar.recession(every))
    zeta[:, 1:] *= np.where(size > most, most / np.where(size > 0.0, size, 1.0), 1.0)[:, None]
    vector = zeta[:, 1:] + alpha[:, None] * r[:, 1:]
    slip = np.sqrt(np.einsum("mi,mi->m", r[:, 1:], r[:, 1:]))
    strength = np.sqrt(np.einsum("mi,mi->m", vector, vector))
    strength = np.where(alpha > 0.0, strength, np.minimum(strength, most))
    tangential = _gap(scalar, alpha, slip, strength, np.einsum("mi,mi->m", vector, r[:, 1:]), extent)
    off = traces.square(forces - zeta.reshape(forces.shape))
    return FenchelGap(*off, traces.integral(normal.reshape(shape)), traces.integral(tangential.reshape(shape)))


def _gap(law: Superpotential, alpha: Array, r: Array, y: Array, product: Array, size: float) -> Array:
    """``jh(r) - y . r`` less the least value of ``jh(s) - |y| s``; inf where there is none.

    ``size`` is the extent of the body, to tell what is far."""
    # the search for a zero of a convex, curved j' alone needs a slope: a slight one, whose share is added to the gap
    slight = _SLIGHT * np.abs(y).max(initial=0.0) / max(float(np.abs(r).max(initial=0.0)), size)
    more = np.where(alpha == 0.0, 0.0 if law.straight else slight, 0.0)
    s = law.local_argmin(alpha + more, y)
    fine = np.isfinite(s) & (np.abs(s) < 1.0 / np.finfo(float).eps * size)
    s = np.where(fine, s, 0.0)
    least = law.value(s) + 0.5 * (alpha - more) * s**2 - y * s
    gap = law.value(r) + 0.5 * alpha * r**2 - product - least
    return np.where(fine, np.maximum(gap, 0.0), np.inf)
