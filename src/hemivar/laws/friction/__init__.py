"""Friction: even profiles of the slip, bounds that may depend on the state, and the laws that they make."""

from hemivar.laws.friction.bounds import CoulombBound, PenetrationBound, StateBound
from hemivar.laws.friction.friction_law import Friction, OrthotropicFriction, SlipMeasure, friction_in_increments
from hemivar.laws.friction.named_frictions import (
    Coulomb,
    ExponentialDecay,
    Logarithmic,
    NoFriction,
    SlipTable,
    SlipWeakening,
    StaticKinetic,
    Tresca,
)
from hemivar.laws.friction.profiles import (
    ABSOLUTE_VALUE,
    ExponentialWeakening,
    LogarithmicWeakening,
    StaticKineticProfile,
)

__all__ = [
    "ABSOLUTE_VALUE",
    "Coulomb",
    "CoulombBound",
    "ExponentialDecay",
    "ExponentialWeakening",
    "Friction",
    "Logarithmic",
    "LogarithmicWeakening",
    "NoFriction",
    "OrthotropicFriction",
    "PenetrationBound",
    "SlipMeasure",
    "SlipTable",
    "SlipWeakening",
    "StateBound",
    "StaticKinetic",
    "StaticKineticProfile",
    "Tresca",
    "friction_in_increments",
]
