"""Normal laws by name: monotone ones, and foundations that break."""

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
    "Bilateral",
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
