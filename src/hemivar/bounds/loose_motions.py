"""By which rigid motions the solutions of a convex problem may differ that nothing but contact holds.

Two solutions u and ``u + rho``, rho rigid, have the same stress and so the same contact force xi, in dj at both.
Where a pressure that is not zero leaves one penetration, ``rho_nu = 0`` wherever xi presses.  On contact facets of one
part of the body in one plane rho_nu is affine: it vanishes there, or nothing presses there.  Let B be these planes,
each of one part, that are pressed, and ``R_B`` the motions whose normal part vanishes on them.  The pressures do no
work along these, so that equilibrium says

    |L(rho)|  <=  int F |rho_tau|        for all rho in R_B,

F the most that friction resists.  So solutions differ by motions of the R_B for which this holds, and a set of planes
for which it does not is not that which is pressed.
"""

from __future__ import annotations

from itertools import combinations

import numpy as np
import scipy.linalg as la

from hemivar.basics.arrays import SAME
from hemivar.basics.types import Array
from hemivar.bounds.bare_body import has_constant_normals
from hemivar.bounds.contact_traces import ContactTraces
from hemivar.laws import ContactLaw, Superpotential
from hemivar.laws.minimisers import piece_bounds
from hemivar.laws.scalar_graph import ENDLESS

__all__ = ["loose_motions"]

#: Planes up to which all sets of them are tried.
_PLANES = 6
#: Digits to which normals and places of planes are one, of the extent of the body.
_DIGITS = 8


def loose_motions(traces: ContactTraces, moves: Array, works: Array, size: float) -> Array:
    """Coefficients (n, m) of rigid motions; by no others solutions may differ.

    Shapes: ``moves`` (k, q, c, n), ``works`` (n,).
    """
    count = moves.shape[-1]
    law, every = traces.law, np.eye(count)
    known = has_constant_normals(traces.data.problem) and not traces.data.varying.unknown.any()
    if not (count and known and isinstance(law, ContactLaw) and _tells(law.normal)):
        return every
    planes = _planes(traces)
    if planes.max() >= _PLANES:
        return every
    resisted = _resistance(law, traces.weights.shape)
    loose, scale = [np.zeros((count, 0))], float(np.abs(moves).max())
    for number in range(planes.max() + 2):
        for pressed in combinations(range(planes.max() + 1), number):
            along = _vanishing(moves[np.isin(planes, pressed), :, 0].reshape(-1, count), scale)
            if along.shape[1] and _balances(along, traces, moves, resisted, works, size):
                loose.append(along)
    return _plain(np.hstack(loose))


def _tells(law: Superpotential) -> bool:
    """Whether a pressure that is not zero leaves one penetration: j' rises wherever it is not zero.

    On a piece j'' is monotone.
    """
    for number in range(law.knots.shape[-1] + 1):
        piece = np.full(law.rows, number)
        low, high = piece_bounds(law, piece)
        near = np.where(np.isfinite(low), low, np.where(np.isfinite(high), high, 0.0))
        for end, sign in ((low, -1.0), (high, 1.0)):
            at = np.where(np.isfinite(end), end, near + sign * ENDLESS * (1.0 + np.abs(near)))
            level = (law.piece_curvature(piece, at) <= 0.0) & (law.piece_derivative(piece, at) != 0.0)
            if np.any(level & (low < high)):
                return False
    return True


def _planes(traces: ContactTraces) -> Array:
    """One number for all facets (k,) of a part, or of two that touch, in a plane with one contact normal."""
    table, normals = traces.data.table, traces.frames[:, 0, 0]
    own, owners = table.normals_of(traces.facets), table.owners[traces.facets]
    points = table.mesh.points
    at = np.einsum("kd,kd->k", own, points[table.facets[traces.facets, 0]] - points.mean(axis=0))
    parts = np.where(owners >= 0, table.mesh.parts.cell[owners], -1)
    keys = np.column_stack([normals, own, at / float(np.ptp(points, axis=0).max()), parts])
    return np.asarray(np.unique(np.round(keys, _DIGITS) + 0.0, axis=0, return_inverse=True)[1].ravel())


def _resistance(law: ContactLaw, shape: tuple[int, ...]) -> Array:
    """The most that friction resists at the points (k, q); inf where it grows with the slip."""
    constant, rate = (np.broadcast_to(one, shape[0] * shape[1]).reshape(shape) for one in law.growth[1])
    return np.where((rate == 0.0) & np.isfinite(constant), constant, np.inf)


def _vanishing(rows: Array, scale: float) -> Array:
    """Orthonormal coefficients (n, m) of the motions that vanish on rows (p, n), but for rounding of a scale."""
    if not len(rows):
        return np.eye(rows.shape[1])
    _, sizes, axes = np.linalg.svd(np.linalg.qr(rows, mode="r"))
    rank = np.count_nonzero(sizes > SAME * scale * np.sqrt(len(rows)))
    return np.asarray(axes[rank:].T)


def _plain(columns: Array) -> Array:
    """A basis (n, m) of the space of some columns, each with a one where the others have none."""
    axes, sizes, _ = np.linalg.svd(columns, full_matrices=False)
    rows = axes[:, sizes > SAME].T
    if not len(rows):
        return np.asarray(rows.T)
    ones = np.sort(la.qr(rows, mode="r", pivoting=True)[1][: len(rows)])
    basis = np.linalg.solve(rows[:, ones], rows).T
    return np.asarray(np.where(np.abs(basis) > SAME, basis, 0.0))


def _balances(along: Array, traces: ContactTraces, moves: Array, resisted: Array, works: Array, size: float) -> bool:
    """Whether friction may balance the loads along motions with these coefficients (n, m), as far as is looked.

    Slips of rigid motions are largest at corners of facets, which are among the points.
    """
    slips = moves[:, :, 1:] @ along
    still = along @ _vanishing(slips[resisted > 0.0].reshape(-1, along.shape[1]), float(np.abs(moves).max()))
    tried = np.column_stack([along, along @ (along.T @ works), still @ (still.T @ works)])
    sizes = np.linalg.norm(moves[:, :, 1:] @ tried, axis=2)
    with np.errstate(invalid="ignore"):
        most = np.where(sizes > 0.0, resisted[:, :, None] * sizes, 0.0).max(axis=1)
    friction = traces.weights.sum(axis=1) @ most
    return bool((np.abs(works @ tried) <= friction + SAME * size * np.linalg.norm(tried, axis=0)).all())
