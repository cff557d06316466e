"""The gap of Fenchel's inequality on contact facets, where a multiplier near to the force itself is taken.

With ``jh = j + alpha/2 |.|^2`` convex, ``y = zeta + alpha r`` and ``jh*`` its conjugate

    D = jh(r) + jh*(y) - y . r  >=  0,

zero where zeta is in dj(r). Of all zeta that with the least ``|xi - zeta|^2 / (2 a) + D`` is, by Moreau,

    zeta = xi + a (r - p),    p = argmin j(p) + (alpha + a)/2 |p|^2 - (xi + (alpha + a) r) . p,

a local problem that laws solve exactly, and ``D = jh(r) - jh(p) - y . (r - p)`` because y is in djh(p). For small a
zeta is xi, clipped to where the conjugate is finite; for large a it is the nearest element of dj(r).

Normal and tangential part of each facet may do either: keep an element of dj(r), or pay a gap.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from hemivar.basics.types import Array, BoolArray
from hemivar.certificates.continuous.contact_traces import ContactTraces
from hemivar.laws import Superpotential

__all__ = ["FenchelGap", "fenchel_gap", "following"]

#: Change of the force, over the largest, by which it is seen whether the multiplier follows.
_STEP = 1e-6


@dataclass(frozen=True, eq=False)
class FenchelGap:
    """Contact facets with a multiplier that leaves dj(r) at a price.

    Attributes
    ----------
    weight : float
        a.
    multiplier : array, shape (k, q, d)
        zeta at the points, in local components.
    normal, tangential : arrays, shape (k,)
        Integrals of the squares of ``xi - zeta``.
    normal_gap, tangential_gap : arrays, shape (k,)
        Integrals of D.
    """

    weight: float
    multiplier: Array
    normal: Array
    tangential: Array
    normal_gap: Array
    tangential_gap: Array

    def only(
        self, paying: tuple[BoolArray, BoolArray], traces: ContactTraces, forces: Array, exact: Array
    ) -> FenchelGap:
        """The same with ``exact (k, q, d)``, which is in dj(r), but for the ``paying`` normal and tangential parts."""
        normal, tangential = paying
        if normal.all() and tangential.all():
            return self
        pays = np.column_stack([normal, *[tangential] * (forces.shape[-1] - 1)])[:, None]
        zeta = np.where(pays, self.multiplier, exact)
        square = traces.square(forces - zeta)
        gaps = (
            np.where(part, gap, 0.0) for part, gap in zip(paying, (self.normal_gap, self.tangential_gap), strict=True)
        )
        return FenchelGap(self.weight, zeta, *square, *gaps)


def fenchel_gap(traces: ContactTraces, forces: Array, weight: float) -> FenchelGap:
    """The gap of the multiplier nearest to forces in local components (k, q, d), at the points of the contact facets.

    Parameters
    ----------
    traces : ContactTraces
        Where a weak convexity constant of its law is infinite, the part is of no use.
    forces : array, shape (k, q, d)
    weight : float
        a, a positive stiffness per area.
    """
    law, shape = traces.law, traces.weights.shape
    r, xi = traces.local.reshape(-1, forces.shape[-1]), forces.reshape(-1, forces.shape[-1])
    alpha, every = _convexity(traces)
    p = law.local_argmin(alpha + weight, xi + (every + weight) * r)
    zeta = xi + weight * (r - p)
    work = (zeta + every * r) * (r - p)
    normal = _fall(law.normal, alpha[:, 0], r[:, 0], p[:, 0]) - work[:, 0]
    sizes = (np.sqrt(np.einsum("mi,mi->m", part[:, 1:], part[:, 1:])) for part in (r, p))
    tangential = _fall(law.tangential, alpha[:, 1], *sizes) - work[:, 1:].sum(axis=1)
    zeta = zeta.reshape(forces.shape)
    gaps = (traces.integral(np.maximum(part, 0.0).reshape(shape)) for part in (normal, tangential))
    return FenchelGap(weight, zeta, *traces.square(forces - zeta), *gaps)


def following(forces: Array, multiplier: Callable[[Array], Array]) -> Array:
    """The part (k, q, 2) of a small change of forces (k, q, d), normal and tangential, that a multiplier follows.

    The tangential one is that along the force, which is the least.
    """
    size = np.sqrt(np.einsum("fqi,fqi->fq", forces[..., 1:], forces[..., 1:]))[..., None]
    way = np.ones(forces.shape)
    way[..., 1:] = np.where(size > 0.0, forces[..., 1:] / np.where(size > 0.0, size, 1.0), way[..., 1:])
    step = _STEP * float(np.abs(forces).max(initial=0.0))
    if step == 0.0:
        return np.zeros((*forces.shape[:2], 2))
    change = way * (multiplier(forces + step * way) - multiplier(forces - step * way)) / (2.0 * step)
    return np.asarray(np.clip(np.stack([change[..., 0], change[..., 1:].sum(axis=2)], axis=2), 0.0, 1.0))


def _convexity(traces: ContactTraces) -> tuple[Array, Array]:
    """Weak convexity constants, of the normal and the tangential law (m, 2), and of all components (m, d)."""
    alpha = np.column_stack([np.broadcast_to(part, traces.weights.size) for part in traces.law.weak_convexity])
    alpha = np.where(np.isfinite(alpha), alpha, 0.0)
    return alpha, np.column_stack([alpha[:, :1], np.repeat(alpha[:, 1:], traces.local.shape[-1] - 1, axis=1)])


def _fall(law: Superpotential, alpha: Array, r: Array, p: Array) -> Array:
    """``jh(r) - jh(p)``."""
    return np.asarray(law.value(r) - law.value(p) + 0.5 * alpha * (r - p) * (r + p))
