"""Superpotentials: the answer of the foundation, normal and tangential."""

from hemivar.laws.analytic import FormulaLaw, FunctionLaw
from hemivar.laws.base import Interval, Superpotential
from hemivar.laws.bounds import CoulombBound, PenetrationBound, StateBound
from hemivar.laws.contact import ContactLaw, Linearisation
from hemivar.laws.description import LawDescription, LawKink
from hemivar.laws.friction import Friction, NoFriction, Tresca
from hemivar.laws.named import Bilateral, Compliance, NoContact, Signorini, SurveyLaw
from hemivar.laws.nonmonotone import (
    Adhesive,
    Capped,
    FinitePenetration,
    Layered,
    Logarithmic,
    SawTooth,
    SlipTable,
    SlipWeakening,
    Softening,
    StaticKinetic,
)
from hemivar.laws.piecewise import PiecewiseQuadratic
from hemivar.laws.tables import read_law_table, table_law

__all__ = [
    "Adhesive",
    "Bilateral",
    "Capped",
    "Compliance",
    "ContactLaw",
    "CoulombBound",
    "FinitePenetration",
    "FormulaLaw",
    "Friction",
    "FunctionLaw",
    "Interval",
    "LawDescription",
    "LawKink",
    "Layered",
    "Linearisation",
    "Logarithmic",
    "NoContact",
    "NoFriction",
    "PenetrationBound",
    "PiecewiseQuadratic",
    "SawTooth",
    "Signorini",
    "SlipTable",
    "SlipWeakening",
    "Softening",
    "StateBound",
    "StaticKinetic",
    "Superpotential",
    "SurveyLaw",
    "Tresca",
    "read_law_table",
    "table_law",
]
