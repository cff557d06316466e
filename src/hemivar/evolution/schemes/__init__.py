"""Schemes: how a step of time becomes one static problem, or two."""

from hemivar.evolution.schemes.scheme import RateFormula, Scheme, StageRule
from hemivar.evolution.schemes.standard import (
    BDF2,
    SDIRK2,
    GeneralizedAlpha,
    ImplicitEuler,
    Midpoint,
    MoreauJean,
    Newmark,
)

__all__ = [
    "BDF2",
    "SDIRK2",
    "GeneralizedAlpha",
    "ImplicitEuler",
    "Midpoint",
    "MoreauJean",
    "Newmark",
    "RateFormula",
    "Scheme",
    "StageRule",
]
