"""Superpotentials: the answer of the foundation, normal and tangential.

What a scalar law must answer is in :mod:`~hemivar.laws.superpotential`, what the law of a contact point must in
:mod:`~hemivar.laws.vector_law`; :mod:`~hemivar.laws.contact_law` is the one that splits into scalar laws.  Laws by name
lie in ``normal`` and ``friction``, those that couple opening and slip in ``coupled``, tables, formulas and functions in
``own``, and what they are made of (``piecewise``, ``scaled``, ``stacked``) here.  Laws made of laws lie in
``transformed``, and in ``memory`` what contact points remember from one time step to the next.  ``registry`` knows the
laws by name for problem files, and ``testing`` checks a law of one's own.
"""

from hemivar.laws.contact_law import ContactLaw, separable
from hemivar.laws.coupled import (
    BilinearCohesion,
    CoupledFormulaLaw,
    CoupledFunctionLaw,
    ExponentialCohesion,
    MixedMode,
    OrthotropicLaw,
    OwnCoupledLaw,
    TrapezoidalCohesion,
    cohesion_table,
    join_laws,
)
from hemivar.laws.description import LawDescription, LawKink
from hemivar.laws.friction import (
    Coulomb,
    CoulombBound,
    Friction,
    Logarithmic,
    NoFriction,
    OrthotropicFriction,
    PenetrationBound,
    SlipTable,
    SlipWeakening,
    StateBound,
    StaticKinetic,
    Tresca,
)
from hemivar.laws.memory import (
    Bonding,
    DampedContact,
    LocalStep,
    Memory,
    MemoryChain,
    MemoryState,
    PenetrationMemory,
    RateAndState,
    Secant,
    SlipSum,
    ViscousFoundation,
    Wear,
    friction_in_increments,
    law_of_step,
)
from hemivar.laws.normal import (
    Adhesive,
    Bilateral,
    Capped,
    Compliance,
    FinitePenetration,
    Layered,
    NoContact,
    SawTooth,
    Signorini,
    Softening,
    ThresholdCompliance,
)
from hemivar.laws.own import FormulaLaw, FunctionLaw, read_law_table, table_law
from hemivar.laws.piecewise import PiecewiseQuadratic
from hemivar.laws.superpotential import Interval, Superpotential
from hemivar.laws.transformed import affine, averaged, bonded, envelope, plus, pushing, secant, slipped
from hemivar.laws.vector_law import Linearisation, VectorLaw

__all__ = [
    "Adhesive",
    "Bilateral",
    "BilinearCohesion",
    "Bonding",
    "Capped",
    "Compliance",
    "ContactLaw",
    "Coulomb",
    "CoulombBound",
    "CoupledFormulaLaw",
    "CoupledFunctionLaw",
    "DampedContact",
    "ExponentialCohesion",
    "FinitePenetration",
    "FormulaLaw",
    "Friction",
    "FunctionLaw",
    "Interval",
    "LawDescription",
    "LawKink",
    "Layered",
    "Linearisation",
    "LocalStep",
    "Logarithmic",
    "Memory",
    "MemoryChain",
    "MemoryState",
    "MixedMode",
    "NoContact",
    "NoFriction",
    "OrthotropicFriction",
    "OrthotropicLaw",
    "OwnCoupledLaw",
    "PenetrationBound",
    "PenetrationMemory",
    "PiecewiseQuadratic",
    "RateAndState",
    "SawTooth",
    "Secant",
    "Signorini",
    "SlipSum",
    "SlipTable",
    "SlipWeakening",
    "Softening",
    "StateBound",
    "StaticKinetic",
    "Superpotential",
    "ThresholdCompliance",
    "TrapezoidalCohesion",
    "Tresca",
    "VectorLaw",
    "ViscousFoundation",
    "Wear",
    "affine",
    "averaged",
    "bonded",
    "cohesion_table",
    "envelope",
    "friction_in_increments",
    "join_laws",
    "law_of_step",
    "plus",
    "pushing",
    "read_law_table",
    "secant",
    "separable",
    "slipped",
    "table_law",
]
