"""The method stands alone: it states, solves, certifies and marches where no package that uses it is installed."""

from __future__ import annotations

import json
import subprocess
import sys

import numpy as np
import pytest

import hemivar as hv
from hemivar.certificates import smallness
from tests import bodies, stranger
from tests.evolution.test_jumps import DOWN, LOSS, UP, cycle
from tests.method_alone import USES
from tests.sources import PACKAGE, ROOT

ALONE = """
import json, sys
from tests.method_alone import USES, Missing
sys.meta_path.insert(0, Missing(USES))
from tests import stranger
found = [stranger.numbers(), stranger.answers()]
print(json.dumps([*found, [name for name in sys.modules if name.startswith("hemivar.")]]))
"""

Ran = tuple[dict[str, float], dict[str, str], list[str]]


@pytest.fixture(scope="module")
def alone() -> Ran:
    done = subprocess.run(
        [sys.executable, "-c", ALONE], capture_output=True, text=True, timeout=120, check=False, cwd=ROOT
    )
    assert done.returncode == 0, done.stderr
    numbers, answers, modules = json.loads(done.stdout)
    return numbers, answers, modules


def test_its_numbers_are_those_of_the_whole(alone: Ran) -> None:
    numbers, _, modules = alone
    whole = stranger.numbers()
    assert numbers.keys() == whole.keys()
    for name, number in numbers.items():
        assert number == pytest.approx(whole[name], rel=1e-12), name
    assert not [name for name in modules if name.split(".")[1] in USES]


def test_each_hook_says_what_is_missing(alone: Ran) -> None:
    answers = alone[1]
    hooks = {entry: target.split(".")[0] for entry, target in hv._DEFINED_ABOVE.items() if target.split(".")[0] in USES}
    own = {entry for entry in hooks if entry.startswith(("Fit.", "engine."))}  # of packages that are missing themselves
    assert len(hv._DEFINED_ABOVE) <= 27
    assert hooks.keys() - own <= answers.keys()
    for entry in hooks.keys() - own - {"smallness.trace_bound"}:
        assert answers[entry].endswith(
            f"part of hemivar.{hooks[entry]}, which is not installed here; install all of hemivar"
        ), answers[entry]
    assert answers["certificate.certify"].startswith("exact=True is part of")
    assert answers["stage_solver.follow_minimisers"].startswith("jump = 'arc-length' is part of")
    assert answers["ReprMixin.plot"].startswith("Certificate.plot is part of")
    survey = "the methods of the survey are part of hemivar.survey, which is not installed here; install all of hemivar"
    assert answers["direct-powell"] == f"method 'direct-powell' is not known (known: newton, multigrid); {survey}"


def test_a_bound_that_nobody_computes_is_not_known(alone: Ran) -> None:
    answers = alone[1]
    assert answers["smallness.trace_bound"] == "None, None"
    assert answers["claim"].startswith("holds on this mesh; for the continuous body it is not known, margin ")


def test_names_of_the_library_say_where_they_are(alone: Ran) -> None:
    answers = alone[1]
    assert (
        answers["follow_path"]
        == "hemivar.follow_path is part of hemivar.branches, which is not installed here; install all of hemivar"
    )
    assert (
        answers["read_problem"]
        == "hemivar.read_problem is part of hemivar.files, which is not installed here; install all of hemivar"
    )
    assert answers["report"] == "hemivar.report is not installed here; install all of hemivar"
    assert answers["survey_report"] == "module 'hemivar' has no attribute 'survey_report'"
    assert answers["Signorin"] == "module 'hemivar' has no attribute 'Signorin'"


def test_what_uses_the_method_is_all_that_is_there_beside_it() -> None:
    method = {"basics", "certificates", "discrete", "evolution", "fem", "formula", "kernels", "laws", "linear",
              "mechanics", "mesh", "solvers", "systems"}  # fmt: skip
    assert {path.parent.name for path in PACKAGE.glob("*/__init__.py")} == method | {*USES}


SOFT = hv.Softening(3.0, 0.1, 0.25)
RING = hv.Material.lame(4.0, 4.0, plane="axisymmetric")
SOFTENING = {
    "plane": bodies.square(hv.Contact(SOFT), 2),
    "scalar": hv.ScalarProblem(
        hv.rectangle((1.0, 1.0), 2), coefficient=1.0, supports={"left": 0.0}, contact={"right": hv.ScalarContact(SOFT)}
    ),
    "axisymmetric": bodies.body(hv.rectangle((1.0, 1.0), 2), hv.Contact(SOFT), material=RING),
}


@pytest.mark.parametrize("kind", ["plane", "scalar"])
def test_with_the_whole_installed_the_constant_of_the_body_is_known(kind: str) -> None:
    """It lies above that of a mesh, which finer meshes approach from below."""
    found = smallness(hv.discretize(SOFTENING[kind]))
    assert found.trace_constant is not None
    assert found.trace_bound is not None
    assert found.m_A is not None
    assert found.trace_constant * (1.0 - 1e-7) <= found.trace_bound <= 1.5 * found.trace_constant
    assert found.survey_margin == pytest.approx(1.0 - 0.25 * found.trace_bound**2 / found.m_A)
    assert found.survey_condition is True


def test_of_a_body_of_revolution_the_condition_is_that_of_the_mesh() -> None:
    found = smallness(hv.discretize(SOFTENING["axisymmetric"]))
    assert (found.trace_bound, found.survey_condition) == (None, True)


def test_with_the_whole_installed_there_are_nine_methods() -> None:
    assert len(hv.solvers.METHODS) == 9


def test_with_the_whole_installed_jumps_follow_paths_and_seek_the_lowest_energy() -> None:
    followed, _ = cycle("arc-length", 0.08)
    assert followed["jumps"][-1] == pytest.approx(LOSS)  # whatever the step
    lowest, pushed = cycle("global", 0.08)
    np.testing.assert_allclose(pushed[lowest["jumped"] > 0.0], [0.32, 0.24])  # about the load of Maxwell
    assert 0.24 < (UP * DOWN) ** 0.5 < 0.32
