"""Normal laws by name: monotone ones, and foundations that break."""

from hemivar.laws.normal.barton_bandis import BartonBandis
from hemivar.laws.normal.bolts import Bolt
from hemivar.laws.normal.breaking import Adhesive, Capped, Layered, SawTooth, Softening
from hemivar.laws.normal.monotone import (
    Bilateral,
    Compliance,
    FinitePenetration,
    NoContact,
    Signorini,
    ThresholdCompliance,
    Tie,
)

__all__ = [
    "Adhesive",
    "BartonBandis",
    "Bilateral",
    "Bolt",
    "Capped",
    "Compliance",
    "FinitePenetration",
    "Layered",
    "NoContact",
    "SawTooth",
    "Signorini",
    "Softening",
    "ThresholdCompliance",
    "Tie",
]
