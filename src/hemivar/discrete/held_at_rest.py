"""Bodies that their foundation holds at rest, up to a limit: glue that breaks, friction that weakens.

Far away such a foundation pulls no more, so that the energy has no lower bound along a rigid motion, and
:func:`hemivar.discrete.recession.decide` says that the body is not held.  An equilibrium near rest exists all the
same as long as the load is small enough.  Multipliers in equilibrium with a load f balance its work along each motion
s,

    f's = sum_j w_j lambda_j . B_j s  <=  sum_j w_j sup { j'(r; B_j s) : r on the way from rest along B_j s },

and the right side is positively homogeneous and a sum of hinges and lengths, as a growth is.  If the difference is
positive along all motions for a small part of the load, the foundation resists all of them at rest, and the body is
held up to a limit.  If it is not, nothing holds the body even at rest.

Friction that the pressure bounds, ``|lam_t| <= mu lam_n``, takes part in either last, for it has no energy: forces of
its cone do no work along motions with ``v_n + mu |v_t| <= 0``, and as much along others as the foundation can press.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sp

from hemivar.basics.arrays import COUNTS
from hemivar.basics.types import Array
from hemivar.discrete.recession import (
    SLACK,
    Coercivity,
    CoercivityResult,
    RecessionFunction,
    decide,
    growth_along,
    hinges,
)
from hemivar.discrete.rigid_modes import RigidModes
from hemivar.laws import VectorLaw
from hemivar.laws.vector_law import softens

if TYPE_CHECKING:
    from hemivar.discrete.contact import ContactPoints
    from hemivar.discrete.loading import Loading
    from hemivar.discrete.space import Field

__all__ = [
    "AT_LIMIT",
    "BY_FRICTION",
    "IDLE",
    "NO_ENERGY",
    "NO_MINIMUM",
    "PERHAPS_NO_MINIMUM",
    "Hold",
    "geometric_slack",
    "growths",
    "holds",
    "limit_of",
]

#: What is said of bodies that are held at rest only.
NO_MINIMUM = "constrained by the foundation up to a limit load; the energy has no minimum"
PERHAPS_NO_MINIMUM = "constrained by the foundation up to a limit load; whether the energy has a minimum is not known"
NO_ENERGY = "constrained by the foundation up to a limit load; the law has no energy"
#: What is said of bodies that only friction holds which the pressure bounds, and of those at its limit.
BY_FRICTION = (
    "constrained by friction that grows with the pressure: forces within its cone balance the load, but an "
    "equilibrium is not proved before the solve"
)
#: What is said of bodies on which nothing acts, and which contact alone holds.
IDLE = "no load presses the body onto its foundation: this equilibrium is one of many"
AT_LIMIT = (
    "at the limit of friction that grows with the pressure: whether forces within its cone balance the load was not "
    "decided before the solve"
)


@dataclass(frozen=True, eq=False)
class Hold:
    """How a group of parts is held."""

    result: CoercivityResult
    touched: RecessionFunction  # what its contact resists, without friction that the pressure bounds
    limit: str | None = None  # the sentence for what its foundation holds at rest only
    balanced: bool | None = None

    @property
    def held(self) -> bool:
        """Whether it is."""
        return self.result.verdict is Coercivity.HELD or self.limit is not None or self.balanced is not None


def holds(field: Field, contact: ContactPoints, loading: Loading, forces: Array, motions: RigidModes) -> Iterator[Hold]:
    """How each group of parts is held.

    By the recession of its laws; else at rest, by the most that they resist; else by either with friction that the
    pressure bounds, ``|lam_t| <= mu lam_n``.  A load is in the interior of what the cones of all points and the other
    forces balance exactly if that growth is positive.  What is refused is not balanced by cones either that are a
    little wider; what lies between is let pass.

    Shapes: ``forces`` (nodes * d,).
    """
    for group in _groups(field, contact, loading, forces, motions):
        yield group.hold()


def growths(
    field: Field, contact: ContactPoints, loading: Loading, forces: Array, motions: RigidModes
) -> list[RecessionFunction]:
    """Growth of the energy along the motions of each group of parts, by the recession of the laws."""
    return [group.growth() for group in _groups(field, contact, loading, forces, motions)]


@dataclass(frozen=True, eq=False)
class _Group:
    """A group of parts: their contact points, and how the energy grows along their motions."""

    law: VectorLaw
    rest: Array  # local displacements (k, d)
    size: float  # of the body
    local: Array  # local motions (k, d, a)
    weights: Array
    work: Array
    load: float
    slack: float
    has_energy: bool  # whether all laws of the body have one

    def growth(self, friction: bool = False) -> RecessionFunction:
        """Far away."""
        return growth_along(self.law, self.local, self.weights, self.work, self.load, self.slack, friction)

    def resistance(self, friction: bool = False) -> RecessionFunction:
        """The most that the laws resist on the way from rest, less the work of a part of the load."""
        up, down, slip = (self.weights * most for most in self.law.strongest(self.rest, self.size))
        rubbed = self.law.rubbed(self.local[:, 1:], self.size) if friction else None
        return hinges(self.local, up, down, slip, COUNTS * self.work, COUNTS * self.load, self.slack, rubbed)

    @property
    def softens(self) -> bool:
        """Whether laws resist more at rest than far away; the recession decides where they are convex."""
        return bool(len(self.local)) and softens(self.law)

    def hold(self) -> Hold:
        """How it is held."""
        growth = touched = self.growth()
        result = decide(growth)
        if result.verdict is Coercivity.HELD:
            return Hold(result, growth)
        limit = NO_MINIMUM if result.verdict is Coercivity.FALLS else PERHAPS_NO_MINIMUM
        limit = limit if self.has_energy else NO_ENERGY
        if self.softens:
            touched = self.resistance()
            if _holds(touched):
                return Hold(result, touched, limit)
        rubs = self.growth(friction=True)
        by_friction = decide(rubs) if rubs.friction.count else result
        if by_friction.verdict is Coercivity.HELD:
            return Hold(result, touched, balanced=True)
        if self.softens:
            at_rest = decide(self.resistance(friction=True))
            if at_rest.verdict is Coercivity.HELD:
                return Hold(result, touched, limit, balanced=True)
            by_friction = replace(at_rest, growth=at_rest.growth / COUNTS)
        if _holds(replace(rubs, friction=rubs.friction.widened(COUNTS))):
            return Hold(result, touched, balanced=False)
        return Hold(result if by_friction.direction is None else by_friction, touched)


def _holds(growth: RecessionFunction) -> bool:
    return decide(growth).verdict is Coercivity.HELD


def limit_of(field: Field, contact: ContactPoints, loading: Loading, motions: RigidModes) -> str | None:
    """The sentence for a body that its foundation holds at rest only; None if it is held, or not even at rest."""
    holding = list(holds(field, contact, loading, field.lift.T @ loading.load, motions))
    if not all(hold.held for hold in holding):
        return None
    limits = [hold.limit for hold in holding if hold.limit]
    return NO_MINIMUM if NO_MINIMUM in limits else limits[0] if limits else None


def geometric_slack(points: Array | None, weights: Array) -> float:
    """What rounding of the coordinates makes of a tangential motion of size one."""
    if points is None or not len(points):
        return SLACK
    length = float(weights.min()) ** (1.0 / max(points.shape[1] - 1, 1))
    noise = 64.0 * float(np.finfo(float).eps) * float(np.abs(points).max()) / length
    return float(min(max(SLACK, noise), 1e-6))


def _groups(
    field: Field, contact: ContactPoints, loading: Loading, forces: Array, motions: RigidModes
) -> Iterator[_Group]:
    if not motions.count:
        return
    m, d = contact.count, contact.components
    local = sp.csc_array(contact.trace @ (field.lift @ motions.motions))
    slack, size = geometric_slack(contact.points, contact.weights), float(np.ptp(field.nodes, axis=0).max())
    for group in motions.groups:
        moved = motions.motions[:, group.columns]
        work = np.asarray(moved.T @ forces)
        own = np.unique(moved.indices)
        load = float(np.abs(forces[own]) @ abs(moved).max(axis=1).toarray().ravel()[own])
        seen = local[:, group.columns]
        points = np.unique(seen.indices // d).astype(np.int64)
        law = loading.law.take(points) if len(points) else loading.law
        rows = seen.toarray().reshape(m, d, work.size)[points]
        has_energy = not loading.law.depends_on_whole_state
        yield _Group(law, -loading.offset[points], size, rows, contact.weights[points], work, load, slack, has_energy)
