"""How a solution changes with the parameters of its law.

A solution has ``S r + W lam = f`` on the condensed body, and ``r = prox(r + tau lam)`` at each contact point, with a
step tau that is small enough for a law that softens.  Both are differentiated: with P the derivative of the proximal
map and g its change with a parameter, ``((1 - P) + P tau W^-1 S) dr = g``.  At a kink P is zero in the components that
are held, and the equation says that they follow the kink.  Where the solution map has a kink itself the derivative is
one-sided.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from hemivar.basics.types import Array
from hemivar.laws import VectorLaw
from hemivar.laws.vector_law import prox_jacobian, spread
from hemivar.systems.condensed import CondensedProblem

__all__ = ["derivative_by_law"]

#: Part of the largest step of the proximal map that is taken of a law that softens.
_CONVEX = 0.4
#: Part of the compliance where a law falls at once, and no step is small enough at the place of the fall itself.
_BRITTLE = 1e-3


def derivative_by_law(
    system: CondensedProblem, r: Array, multiplier: Array, changed: Sequence[tuple[VectorLaw, float]]
) -> Array:
    """Derivative of the local displacements of a solution by parameters of its law.

    Parameters
    ----------
    system : CondensedProblem
        The condensed body with the law.
    r, multiplier : arrays (m, d)
        The solution at the contact points.
    changed : sequence of (VectorLaw, float)
        For each parameter the law with that parameter changed a little, and by how much.

    Returns
    -------
    array, shape (m, d, p)
        Infinite where the solution is no isolated one, as at a fold.
    """
    m, d = r.shape
    tau = _steps(system)
    wide = spread(tau, d)
    x = r + wide * multiplier
    P = prox_jacobian(system.law, x, tau)
    base = system.law.prox(x, tau)
    right = np.stack([((law.prox(x, tau) - base) / step).ravel() for law, step in changed], axis=1)
    S = np.asarray(system.matrix).reshape(m, d, m * d)
    flow = np.einsum("jab,jbk->jak", P * wide[:, None, :] / system.weights[:, None, None], S).reshape(m * d, m * d)
    held = np.zeros((m, d, m, d))
    points = np.arange(m)
    held[points, :, points, :] = np.eye(d) - P
    whole = held.reshape(m * d, m * d) + flow
    fixed = np.flatnonzero(~system.active.ravel())
    whole[fixed], right[fixed] = np.eye(m * d)[fixed], 0.0
    try:
        found = np.linalg.solve(whole, right)
    except np.linalg.LinAlgError:
        found = np.full_like(right, np.inf)
    return np.asarray(found.reshape(m, d, len(changed)))


def _steps(system: CondensedProblem) -> Array:
    """Steps tau (m, 2): the compliance of each point, less where its law softens."""
    m, d = system.shape
    stiffness = np.diag(system.matrix).reshape(m, d) / system.weights[:, None]
    sizes = np.column_stack([stiffness[:, 0], stiffness[:, 1:].max(axis=1) if d > 1 else stiffness[:, 0]])
    softening = np.column_stack([np.broadcast_to(alpha, m) for alpha in system.law.weak_convexity]).max(axis=1)
    needed = np.where(np.isfinite(softening), softening / _CONVEX, sizes.max(axis=1) / _BRITTLE)
    return np.asarray(1.0 / np.maximum(sizes, needed[:, None]))
