"""Laws that couple opening and slip."""

from hemivar.laws.coupled.cohesion import BilinearCohesion, ExponentialCohesion, TrapezoidalCohesion, cohesion_table
from hemivar.laws.coupled.criteria import BenzeggaghKenane, FractureCriterion, PowerCriterion
from hemivar.laws.coupled.joined import JoinedLaw, join_laws
from hemivar.laws.coupled.mixed_mode import MixedMode
from hemivar.laws.coupled.mode_dependent import ModeDependentGlue
from hemivar.laws.coupled.orthotropic import OrthotropicLaw, bounded
from hemivar.laws.coupled.own_coupled import OwnCoupledLaw
from hemivar.laws.coupled.own_coupled_makers import CoupledFormulaLaw, CoupledFunctionLaw

__all__ = [
    "BenzeggaghKenane",
    "BilinearCohesion",
    "CoupledFormulaLaw",
    "CoupledFunctionLaw",
    "ExponentialCohesion",
    "FractureCriterion",
    "JoinedLaw",
    "MixedMode",
    "ModeDependentGlue",
    "OrthotropicLaw",
    "OwnCoupledLaw",
    "PowerCriterion",
    "TrapezoidalCohesion",
    "bounded",
    "cohesion_table",
    "join_laws",
]
