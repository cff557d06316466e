"""Sensitivities: the derivative of the solution map by the parameters of the law.

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
from hemivar.laws.vector_law import prox, prox_jacobian, spread
from hemivar.systems.condensed import CondensedProblem

__all__ = ["derivative_by_law"]

#: Part of the largest step for which the proximal map of a law that softens has one value: below one, and its Lipschitz
#: constant is 1/(1 - 0.4). 0.1 and 0.8 give the same fits in tests/identification.
_CONVEX = 0.4
#: Part of the compliance that is the step where a law falls at once; at the fall itself no step is small enough. 1e-2
#: and 1e-4 give the same fits in tests/identification.
_BRITTLE = 1e-3


def derivative_by_law(
    system: CondensedProblem, r: Array, multiplier: Array, changed: Sequence[tuple[VectorLaw, float]]
) -> Array:
    """Derivative (m, d, p) of the local displacements of a solution by parameters of its law.

    ``r, multiplier (m, d)``: the solution. ``changed``: for each parameter the law with it changed a little, and by how
    much. Infinite where the solution is no isolated one, as at a fold.
    """
    m, d = r.shape
    tau = _steps(system)
    wide = spread(tau, d)
    x = r + wide * multiplier
    P = prox_jacobian(system.law, x, tau)
    base = prox(system.law, x, tau)
    right = np.stack([((prox(law, x, tau) - base) / step).ravel() for law, step in changed], axis=1)
    S = np.asarray(system.matrix).reshape(m, d, m * d)
    flow = np.einsum("jab,jbk->jak", P * wide[:, None, :] / system.weights[:, None, None], S).reshape(m * d, m * d)
    own = np.zeros((m, d, m, d))
    points = np.arange(m)
    own[points, :, points, :] = np.eye(d) - P
    whole = own.reshape(m * d, m * d) + flow
    fixed = np.flatnonzero(~system.active.ravel())
    whole[fixed], right[fixed] = np.eye(m * d)[fixed], 0.0
    try:
        change = np.linalg.solve(whole, right)
    except np.linalg.LinAlgError:
        change = np.full_like(right, np.inf)
    return np.asarray(change.reshape(m, d, len(changed)))


def _steps(system: CondensedProblem) -> Array:
    """Steps tau (m, 2): the compliance of each point, less where its law softens."""
    stiffness = 1.0 / system.compliance
    softening = np.maximum(*(np.broadcast_to(alpha, len(stiffness)) for alpha in system.law.weak_convexity))
    needed = np.where(np.isfinite(softening), softening / _CONVEX, stiffness.max(axis=1) / _BRITTLE)
    return np.asarray(1.0 / np.maximum(stiffness, needed[:, None]))
