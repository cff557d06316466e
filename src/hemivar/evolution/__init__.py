"""Evolution: contact problems in time, each step of which is a static problem."""

from hemivar.evolution.bonded_steps import BondedStep, bonded_steps
from hemivar.evolution.evolution_problem import Evolution, Mass
from hemivar.evolution.history import Frame, History, Row
from hemivar.evolution.jumps import SelectionRule
from hemivar.evolution.march import StepEvent, march, marching
from hemivar.evolution.march_events import BondBroken, Event, MarginLost, Release, Slip, Touch, When
from hemivar.evolution.march_state import Checkpoint
from hemivar.evolution.plan import March
from hemivar.evolution.save import Save
from hemivar.evolution.schemes import (
    BDF2,
    SCHEMES,
    SDIRK2,
    GeneralizedAlpha,
    ImplicitEuler,
    Midpoint,
    MoreauJean,
    Newmark,
    Scheme,
)
from hemivar.evolution.steps import AdaptiveStep, FixedStep, StepSizeController

__all__ = [
    "BDF2",
    "SCHEMES",
    "SDIRK2",
    "AdaptiveStep",
    "BondBroken",
    "BondedStep",
    "Checkpoint",
    "Event",
    "Evolution",
    "FixedStep",
    "Frame",
    "GeneralizedAlpha",
    "History",
    "ImplicitEuler",
    "March",
    "MarginLost",
    "Mass",
    "Midpoint",
    "MoreauJean",
    "Newmark",
    "Release",
    "Row",
    "Save",
    "Scheme",
    "SelectionRule",
    "Slip",
    "StepEvent",
    "StepSizeController",
    "Touch",
    "When",
    "bonded_steps",
    "march",
    "marching",
]
