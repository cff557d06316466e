"""Laws that are transformed in the tests: every kind there is, convex and not, rigid, smooth and by tables."""

from __future__ import annotations

import numpy as np

from hemivar.laws import (
    Bilateral,
    Compliance,
    NoContact,
    Signorini,
    Superpotential,
    ThresholdCompliance,
    Tresca,
)
from hemivar.laws.testing import check_law

from ..catalogue import LAWS, REACH

__all__ = ["FRICTION", "NORMAL", "conforms"]

NORMAL: dict[str, Superpotential] = {name: law for name, law in LAWS.items() if name not in REACH} | {
    "survey": ThresholdCompliance(0.3, 2.0),
    "survey, two points": ThresholdCompliance(np.array([0.3, 0.7]), 2.0),
    "signorini": Signorini(),
    "bilateral": Bilateral(),
    "none": NoContact(),
    "spring": Compliance(3.0),
    "power": Compliance(5.0, 2.5),
}

#: Even ones.
FRICTION: dict[str, Superpotential] = {"tresca": Tresca(0.5).radial} | {
    name: LAWS[name]
    for name in (
        "slip weakening",
        "slip strengthening",
        "logarithmic",
        "static-kinetic",
        "slip table",
        "survey's friction",
        "logarithm",
        "own potential",
    )
}


def conforms(law: Superpotential, friction: bool = False) -> None:
    """The law passes every check of the kit, at every one of its contact points."""
    for i in range(law.knots.shape[0]):
        check_law(law.take(np.array([i])) if i else law, friction=friction)
