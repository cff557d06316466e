"""Bodies that their foundation holds at rest, up to a limit: glue that breaks, friction that weakens.

Far away such a foundation pulls no more, so that the energy has no lower bound along a rigid motion, and
:func:`hemivar.coercivity.recession.decide` says that the body is not held.  An equilibrium near rest exists all the
same as long as the load is small enough.  Multipliers in equilibrium with a load f balance its work along each motion
s,

    f's = sum_j w_j lambda_j . B_j s  <=  sum_j w_j sup { j'(r; B_j s) : r on the way from rest along B_j s },

and the right side is positively homogeneous and a sum of hinges and lengths, as a growth is.  If the difference is
positive along all motions for a small part of the load, the foundation resists all of them at rest, and the body is
held up to a limit.  If it is not, nothing holds the body even at rest.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sp

from hemivar.basics.types import Array, IntArray
from hemivar.coercivity.recession import SLACK, Coercivity, RecessionFunction, decide, growth_along, hinges
from hemivar.coercivity.rigid_modes import RigidModes
from hemivar.laws import VectorLaw

if TYPE_CHECKING:
    from hemivar.discrete.contact import ContactPoints
    from hemivar.discrete.loading import Loading
    from hemivar.discrete.space import Field

__all__ = [
    "BY_FRICTION",
    "IDLE",
    "NO_MINIMUM",
    "PERHAPS_NO_MINIMUM",
    "geometric_slack",
    "growths",
    "limit_of",
    "resistances",
    "with_friction",
]

#: What is said of bodies that are held at rest only.
NO_MINIMUM = "constrained by the foundation up to a limit load; the energy has no minimum"
PERHAPS_NO_MINIMUM = "constrained by the foundation up to a limit load; whether the energy has a minimum is not known"
#: What is said of bodies that only friction holds which the pressure bounds.
BY_FRICTION = (
    "constrained by friction that grows with the pressure: forces within its cone balance the load, but an "
    "equilibrium is not proved before the solve"
)
#: What is said of bodies on which nothing acts, and which contact alone holds.
IDLE = "no load presses the body onto its foundation: this equilibrium is one of many"
#: Directions of slip in space along which friction counts that grows with the pressure.
_DIRECTIONS = 16
#: Part of the load against which a foundation must hold a body at rest.
_SMALL = 1e-6


def growths(
    field: Field, contact: ContactPoints, law: VectorLaw, forces: Array, motions: RigidModes
) -> list[RecessionFunction]:
    """Growth of the energy along the motions of each group of parts, by the recession of the laws.

    Parameters
    ----------
    field : Field
    contact : ContactPoints
    law : VectorLaw
    forces : array (nodes * d,)
        Nodal loads.
    motions : RigidModes
    """
    slack = geometric_slack(contact.points, contact.weights)
    return [
        growth_along(law.take(points) if len(points) else law, rows, contact.weights[points], work, load, slack)
        for points, rows, work, load in _grouped(field, contact, forces, motions)
    ]


def resistances(
    field: Field, contact: ContactPoints, loading: Loading, forces: Array, motions: RigidModes, part: float = _SMALL
) -> list[RecessionFunction | None]:
    """The most that the laws resist on the way from rest, less the work of a part of the load, for each group.

    None for groups whose laws are convex: the recession decides there.
    """
    slack, size = geometric_slack(contact.points, contact.weights), float(np.ptp(field.nodes, axis=0).max())
    found: list[RecessionFunction | None] = []
    law = loading.law
    for points, rows, work, load in _grouped(field, contact, forces, motions):
        own = law.take(points) if len(points) else law
        if not len(points) or not own.softens:
            found.append(None)
            continue
        rest, weights = -loading.offset[points], contact.weights[points]
        up, down, slip = (weights * most for most in own.strongest(rest, size))
        found.append(hinges(rows, up, down, slip, part * work, part * load, slack))
    return found


def with_friction(
    field: Field, contact: ContactPoints, law: VectorLaw, forces: Array, motions: RigidModes
) -> list[RecessionFunction | None]:
    """Growths with friction that the pressure bounds, ``|lam_t| <= mu lam_n``, for each group; None where none acts.

    Forces of that cone do no work along motions with ``v_n + mu |v_t| <= 0``, and can do any along others.  So a load
    is in the interior of what all cones and the other forces balance exactly if this growth is positive.  In space the
    cone is that over a polygon inside of the circle.
    """
    slack = geometric_slack(contact.points, contact.weights)
    found: list[RecessionFunction | None] = []
    for points, rows, work, load in _grouped(field, contact, forces, motions):
        own = law.take(points) if len(points) else law
        rate = np.broadcast_to(own.friction_per_pressure, len(points))
        growth = growth_along(own, rows, contact.weights[points], work, load, slack)
        up = np.broadcast_to(own.rates[0], len(points))
        rubs = np.flatnonzero((rate > 0.0) & np.isposinf(up))
        if not rubs.size or rows.shape[1] < 2:
            found.append(None)
            continue
        turns = 2.0 * np.pi * np.arange(_DIRECTIONS) / _DIRECTIONS
        ways = np.array([[1.0], [-1.0]]) if rows.shape[1] == 2 else np.stack([np.cos(turns), np.sin(turns)], axis=1)
        slips = rate[rubs, None, None] * np.einsum("wc,kca->kwa", ways, rows[rubs, 1:])
        cone = (rows[rubs, :1] + slips).reshape(-1, work.size)
        found.append(
            replace(
                growth,
                rows=np.concatenate([growth.rows, cone]),
                up=np.concatenate([growth.up, np.full(len(cone), np.inf)]),
                down=np.concatenate([growth.down, np.zeros(len(cone))]),
            )
        )
    return found


def limit_of(field: Field, contact: ContactPoints, loading: Loading, motions: RigidModes) -> str | None:
    """The sentence for a body that its foundation holds at rest only; None if it is held, or not even at rest."""
    forces = field.lift.T @ loading.load
    limit: str | None = None
    pairs = zip(
        growths(field, contact, loading.law, forces, motions),
        resistances(field, contact, loading, forces, motions),
        strict=True,
    )
    for growth, resistance in pairs:
        hold = decide(growth)
        if hold.verdict is Coercivity.HELD:
            continue
        if resistance is None or decide(resistance).verdict is not Coercivity.HELD:
            return None
        limit = NO_MINIMUM if hold.verdict is Coercivity.FALLS else limit or PERHAPS_NO_MINIMUM
    return limit


def geometric_slack(points: Array | None, weights: Array) -> float:
    """What rounding of the coordinates makes of a tangential motion of size one."""
    if points is None or not len(points):
        return SLACK
    length = float(weights.min()) ** (1.0 / max(points.shape[1] - 1, 1))
    noise = 64.0 * float(np.finfo(float).eps) * float(np.abs(points).max()) / length
    return float(min(max(SLACK, noise), 1e-6))


def _grouped(
    field: Field, contact: ContactPoints, forces: Array, motions: RigidModes
) -> Iterator[tuple[IntArray, Array, Array, float]]:
    """Of each group of parts: its contact points (k,), their local motions (k, d, a), work of the load along these (a,)
    and the size of what cancels in it."""
    if not motions.count:
        return
    m, d = contact.count, contact.components
    local = sp.csc_array(contact.trace @ (field.lift @ motions.motions))
    for group in motions.groups:
        moved = motions.motions[:, group.columns]
        work = np.asarray(moved.T @ forces)
        own = np.unique(moved.indices)
        size = float(np.abs(forces[own]) @ abs(moved).max(axis=1).toarray().ravel()[own])
        seen = local[:, group.columns]
        points = np.unique(seen.indices // d).astype(np.int64)
        yield points, seen.toarray().reshape(m, d, work.size)[points], work, size
