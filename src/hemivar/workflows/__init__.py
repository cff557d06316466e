"""Use cases: each takes a problem and options, yields events while it works, and returns a value.

    for event in hemivar.workflows.run(problem):
        ...
    result = hemivar.workflows.result_of(hemivar.workflows.run(problem))

Nothing here prints or ends the process, or writes a file but where options name one to go on from: the command, a
notebook and a window show the same work.  :func:`study` and :func:`sweep` are :func:`studying` and :func:`sweeping` run
to their end.
"""

from hemivar.basics.generators import result_of
from hemivar.branches import PathOptions, PathProgress, SearchProgress, SolutionsOptions
from hemivar.solvers import Progress
from hemivar.workflows.adapting import AdaptOptions, AdaptResult, Refined, adapt
from hemivar.workflows.certification import CertifyOptions, certify
from hemivar.workflows.comparison import Attempt, CompareOptions, Comparison, Condensed, compare, energy_norm_difference
from hemivar.workflows.diagnosis import Diagnosis, Part, diagnose
from hemivar.workflows.equilibria import path, solutions
from hemivar.workflows.events import (
    CertificateEvent,
    Event,
    FoundEvent,
    MethodEvent,
    Notice,
    Phase,
    StartEvent,
    WarningEvent,
    Work,
)
from hemivar.workflows.identification import identify, identifying
from hemivar.workflows.law_study import LawStudy, study_law
from hemivar.workflows.marching import ProgressEvent, ReadyEvent, evolution_of, march, plan_of
from hemivar.workflows.solving import RunOptions, RunResult, run
from hemivar.workflows.study import Study, StudyLevel, StudyOptions, study, studying
from hemivar.workflows.survey_runs import SurveyEvent, SurveyOptions, SurveyRuns, survey
from hemivar.workflows.sweep import Sweep, SweepAxis, SweepEvent, SweepOptions, read_axis, sweep, sweeping

__all__ = [
    "AdaptOptions",
    "AdaptResult",
    "Attempt",
    "CertificateEvent",
    "CertifyOptions",
    "CompareOptions",
    "Comparison",
    "Condensed",
    "Diagnosis",
    "Event",
    "FoundEvent",
    "LawStudy",
    "MethodEvent",
    "Notice",
    "Part",
    "PathOptions",
    "PathProgress",
    "Phase",
    "Progress",
    "ProgressEvent",
    "ReadyEvent",
    "Refined",
    "RunOptions",
    "RunResult",
    "SearchProgress",
    "SolutionsOptions",
    "StartEvent",
    "Study",
    "StudyLevel",
    "StudyOptions",
    "SurveyEvent",
    "SurveyOptions",
    "SurveyRuns",
    "Sweep",
    "SweepAxis",
    "SweepEvent",
    "SweepOptions",
    "WarningEvent",
    "Work",
    "adapt",
    "certify",
    "compare",
    "diagnose",
    "energy_norm_difference",
    "evolution_of",
    "identify",
    "identifying",
    "march",
    "path",
    "plan_of",
    "read_axis",
    "result_of",
    "run",
    "solutions",
    "study",
    "study_law",
    "studying",
    "survey",
    "sweep",
    "sweeping",
]
