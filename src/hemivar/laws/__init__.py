"""Superpotentials: the answer of the foundation, normal and tangential."""

from hemivar.laws.base import Interval, Superpotential
from hemivar.laws.contact import ContactLaw, Linearisation
from hemivar.laws.friction import Friction, NoFriction, Tresca
from hemivar.laws.named import Bilateral, Compliance, NoContact, Signorini, SurveyLaw
from hemivar.laws.piecewise import PiecewiseQuadratic

__all__ = [
    "Bilateral",
    "Compliance",
    "ContactLaw",
    "Friction",
    "Interval",
    "Linearisation",
    "NoContact",
    "NoFriction",
    "PiecewiseQuadratic",
    "Signorini",
    "Superpotential",
    "SurveyLaw",
    "Tresca",
]
