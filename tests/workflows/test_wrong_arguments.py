"""Every public function of the workflows with arguments of wrong kinds: it returns, or raises an error in words."""

from __future__ import annotations

import inspect
import warnings
from collections.abc import Callable
from pathlib import Path

import pytest

import hemivar as hv
from hemivar import workflows
from hemivar.files.problem_file import ProblemFile
from hemivar.files.settings import SolverSettings
from hemivar.identification.identifying import identify, identifying
from hemivar.survey import survey
from hemivar.workflows.comparison import energy_norm_difference
from hemivar.workflows.marching import evolution_of, plan_of
from hemivar.workflows.sweep import read_axis
from tests.test_wrong_arguments import PROBLEM, WRONG, trouble

EVOLUTION = hv.Evolution(PROBLEM)
KEY = "contact.bottom.normal.stiffness"
SOLUTION = hv.solve(PROBLEM)
DISCRETE = hv.discretize(PROBLEM)


STATED = ProblemFile(PROBLEM, SolverSettings())


def same_problem(values: object) -> hv.ContactProblem:
    """A problem for any parameters."""
    return PROBLEM


MEASURED = hv.identification.Measurements({"a": [0.1, 0.2, 0.3]}, {"contact.bottom.force.y": [0.1, 0.2, 0.4]})
#: Every function of the package, what the command calls besides, and the use cases of other packages.
FUNCTIONS: dict[str, Callable[..., object]] = {
    one.__name__: one
    for one in (
        *(getattr(workflows, name) for name in workflows.__all__),
        *(energy_norm_difference, evolution_of, identify, identifying, plan_of, read_axis, survey),
    )
    if inspect.isfunction(one)
}
#: What stands for the arguments that must be given, by the function and their name.
RIGHT: dict[str, dict[str, object]] = {
    "adapt": {"problem": PROBLEM},
    "certify": {"problem": PROBLEM},
    "compare": {"problem": PROBLEM},
    "diagnose": {"limit": 0.1},
    "energy_norm_difference": {"one": SOLUTION, "other": SOLUTION},
    "evolution_of": {"stated": STATED},
    "identify": {"problem": same_problem, "data": MEASURED, "parameters": {"k": (0.5, 2.0)}},
    "identifying": {"problem": same_problem, "data": MEASURED, "parameters": {"k": (0.5, 2.0)}},
    "march": {"evolution": EVOLUTION, "plan": hv.evolution.March(1.0, step=1.0)},
    "bracket": {"problem": PROBLEM},
    "path": {"problem": PROBLEM},
    "plan_of": {"stated": STATED},
    "read_axis": {"text": "a=1:2:3"},
    "result_of": {"work": workflows.run(PROBLEM)},
    "run": {"problem": PROBLEM},
    "solutions": {"problem": PROBLEM},
    "study": {"problem": PROBLEM, "refine": 1},
    "study_levels": {
        "make": lambda level: DISCRETE,
        "refine": 1,
        "measure": lambda found, made: {"energy": found.energy},
    },
    "study_law": {"name": "softening"},
    "study_time": {
        "evolution": EVOLUTION,
        "plan": hv.evolution.March(1.0, step=1.0),
        "options": workflows.TimeStudyOptions(1),
    },
    "studying": {"problem": PROBLEM},
    "survey": {"options": None},
    "sweep": {"problem": same_problem, "axes": {"a": [1.0]}},
    "sweeping": {"problem": same_problem, "axes": {"a": [1.0]}},
}
#: Arguments that are not tried: without options the survey runs for minutes, and tools are those of an engine.
LEFT_OUT = {("survey", "options"), ("march", "tools")}
#: What is given beside the usual wrong values.
MORE: dict[str, tuple[object, ...]] = {
    "axes": ({"a": 1}, {"a": "xy"}, {"a": []}, {1: [1.0]}, [("a", [1.0])]),
    "parameters": ({"k": 10}, {"k": ("a", "b")}, {"k": (1.0,)}, {"k": (2.0, 1.0)}, {}, [("k", 1.0, 2.0)]),
}


def test_every_function_is_tried() -> None:
    assert FUNCTIONS.keys() == RIGHT.keys()


@pytest.mark.parametrize("name", RIGHT)
def test_wrong_arguments_are_refused_in_words(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    function = FUNCTIONS[name]

    def call(**given: object) -> object:
        made = function(**given)
        return workflows.result_of(made) if inspect.isgenerator(made) else made

    raw = []
    parameters = inspect.signature(function).parameters.values()
    for one in (one for one in parameters if one.kind is not one.VAR_KEYWORD and (name, one.name) not in LEFT_OUT):
        for value in (*WRONG, *MORE.get(one.name, ())):
            given = {**RIGHT[name], one.name: value}
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                if told := trouble(call, given):
                    raw.append(f"{one.name} = {value!r:.60}: {told}")
    assert not raw, "\n".join(raw)


@pytest.mark.parametrize("option", ["checkpoint", "scheme", "step", "save", "stops", "events", "jump", "method"])
def test_wrong_options_of_a_march_are_refused_in_words(option: str) -> None:
    raw = []
    for value in (*WRONG, 3):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            if value is not None and (told := trouble(hv.evolution.March, {"until": 1.0, option: value})):
                raw.append(f"{option} = {value!r:.60}: {told}")
    assert not raw, "\n".join(raw)


def test_a_scheme_is_given_by_its_name() -> None:
    assert isinstance(hv.evolution.March(1.0, scheme="moreau-jean").scheme, hv.evolution.MoreauJean)
    with pytest.raises(hv.HemivarError, match="did you mean 'newmark'"):
        hv.evolution.March(1.0, scheme="newmrk")
