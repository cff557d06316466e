"""The public names of ``hemivar.survey`` and where each comes from; loaded on first use."""

from .active_set import ExactInner as ExactInner
from .active_set import NewtonKrylov as NewtonKrylov
from .active_set import PrimalDualActiveSet as PrimalDualActiveSet
from .augmented_lagrangian import AugmentedLagrangian as AugmentedLagrangian
from .augmented_lagrangian import AugmentedLagrangianNewton as AugmentedLagrangianNewton
from .augmented_lagrangian import RootFinder as RootFinder
from .bundle import ProximalBundle as ProximalBundle
from .lbfgs import LBFGS as LBFGS
from .powell import Powell as Powell
from .survey_runs import SurveyEvent as SurveyEvent
from .survey_runs import SurveyOptions as SurveyOptions
from .survey_runs import SurveyRuns as SurveyRuns
from .survey_runs import survey as survey
