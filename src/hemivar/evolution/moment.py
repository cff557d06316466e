"""The state of an evolution at one time."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from hemivar.basics.portable import Portable
from hemivar.basics.types import Array
from hemivar.evolution.ledger import Ledger

if TYPE_CHECKING:
    from hemivar.evolution.heat_book import Warmth

__all__ = ["Moment", "Motion", "Stretching"]


@dataclass(frozen=True, eq=False)
class Motion(Portable):
    """Something that moves, with its rate and acceleration; arrays of one shape.

    Attributes
    ----------
    place, velocity, acceleration : arrays
    """

    place: Array
    velocity: Array
    acceleration: Array


@dataclass(frozen=True, eq=False)
class Stretching(Portable):
    """How forces of a body have changed in a step that its velocity is that of: where the next step begins.

    Attributes
    ----------
    step : float
        Length of the step.
    force : array (n,)
        Of the elastic one: ``K (u - u_before)``, which is ``step K v``.
    multiplier : array (m, c)
        Of the multiplier.
    """

    step: float
    force: Array
    multiplier: Array


@dataclass(frozen=True, eq=False)
class Moment(Portable):
    """All that the future of an evolution depends on.  A step is a function from one moment to the next.

    Attributes
    ----------
    time : float
    index : int
        Steps taken so far.
    body : Motion
        Unknowns and prescribed displacements, (n + k,).
    local : Motion
        Penetration and slip of the contact points relative to their foundation, (m, c).
    multiplier : array (m, c)
        Force per area of the body on the foundation at the last stage: pressure (column 0), and minus the friction.
    branches : tuple of arrays (n + k,)
        Displacement that each branch of the material remembers.
    memory : mapping
        States of the memories of contact boundaries, by their names: arrays by name.
    ledger : Ledger
        Energies, and all work and losses so far.
    heat : Warmth or None
        Temperatures and the balance of heat, of a body with heat.
    stretching : Stretching or None
        Of the last step, where it is known; it spares the next step a product and Newton's equations.
    """

    time: float
    index: int
    body: Motion
    local: Motion
    multiplier: Array
    branches: tuple[Array, ...] = ()
    memory: Mapping[str, Mapping[str, Array]] = field(default_factory=dict)
    ledger: Ledger = field(default_factory=Ledger)
    heat: Warmth | None = None
    stretching: Stretching | None = None
