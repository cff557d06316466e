"""The gallery's nonmonotone problems: solutions, branches, units."""

import importlib.util
import runpy
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import matplotlib
import matplotlib.pyplot as plt
import numpy as np
import pytest

from hemivar.branches import find_solutions, follow_path
from hemivar.certificates import certify, smallness
from hemivar.discrete import residual
from hemivar.errors import ProblemError
from hemivar.fem import LoadLine, discretize
from hemivar.files.problem_file import read_problem
from hemivar.gallery import (
    broken_foundation,
    delamination,
    shear_block_slips,
    shear_column,
    survey_logarithmic,
)
from hemivar.laws import Capped, NoContact
from hemivar.mechanics import ContactProblem
from hemivar.solvers import METHODS, FixedPoint, LoadStepping, NonsmoothNewton, Search, Status, solve
from hemivar.systems import Workspace
from tests import bodies
from tests.samples import slow

ROOT = Path(__file__).parents[1]
STAY = FixedPoint(NonsmoothNewton(search=Search.DOWNHILL))


# ---- Jureczka and Ochal 2019 --------------------------------------------------------------------------------


def free_body(problem: ContactProblem) -> np.ndarray:
    without = bodies.body(
        problem.mesh, NoContact(), material=problem.material, supports=problem.supports, body_force=problem.body_force
    )
    return solve(discretize(without)).unknowns


def test_laws_of_the_foundation_that_breaks() -> None:
    contact = broken_foundation(2).contact["bottom"]
    s = np.array([-0.1, 0.0, 0.05, 0.1, 0.3])
    np.testing.assert_allclose(contact.normal.value(s), [0.0, 0.0, 0.025, 0.1, 0.1], atol=1e-15)
    assert isinstance(contact.normal, Capped)
    assert np.isinf(contact.normal.weak_convexity).all()
    bound = contact.friction.bound.value(s, np.zeros(5))  # type: ignore[union-attr]
    np.testing.assert_allclose(bound, [0.0, 0.0, 0.4, 0.8, 0.8])
    np.testing.assert_allclose(contact.friction.profile.value(np.array([-2.0, 2.0])), np.log(3.0))


def test_supported_and_broken_through() -> None:
    """Two solutions of one problem, each stationary for the bound that it has itself."""
    problem = discretize(broken_foundation(8))
    supported = solve(problem, FixedPoint(LoadStepping(steps=4)))
    broken = solve(problem, STAY, initial=free_body(broken_foundation(8)))
    for solution in (supported, broken):
        assert solution.status is Status.CONVERGED
        assert residual(problem, solution.unknowns, solution.multiplier).relative < 1e-8
        assert solution.contraction is None or solution.contraction < 0.2
    assert supported.contraction is not None
    assert supported.penetration.max() == pytest.approx(0.042974, abs=2e-6)
    assert (supported.penetration > 0.0).all()
    np.testing.assert_allclose(supported.pressure, 20.0 * supported.penetration, rtol=1e-7)
    slip = np.abs(supported.slip[:, 0])
    np.testing.assert_allclose(np.abs(supported.friction[:, 0]), 8.0 * supported.penetration / (1.0 + slip), rtol=1e-6)
    assert broken.penetration.max() > 1.6
    assert np.abs(broken.pressure[broken.penetration > 0.1]).max() < 1e-9
    assert broken.energy < supported.energy


@pytest.mark.parametrize(("n", "load"), [(4, 2.348005), slow(8, 2.327331)])
def test_load_at_which_the_foundation_gives_way(n: int, load: float) -> None:
    """The supported branch ends where its largest penetration is 0.1."""
    problem = discretize(broken_foundation(n))
    line, workspace = LoadLine(problem), Workspace()
    guess = None
    for factor in (1.0, 1.8, 2.2, 0.5 * (2.2 + load), load - 1e-2, load - 1e-3, load - 1e-4):
        partial = line.at(factor)
        solution = solve(partial, STAY, initial=guess, workspace=workspace).raise_for_status()
        guess = solution.unknowns
        assert solution.penetration.max() < 0.1
    assert solution.penetration.max() == pytest.approx(0.1, abs=2e-5)
    beyond = line.at(load + 1e-4)
    assert solve(beyond, STAY, initial=guess, workspace=workspace).penetration.max() > 1.0


# ---- delamination -------------------------------------------------------------------------------------------


def test_the_glue_has_three_teeth() -> None:
    glue = delamination(1).contact["bottom"].normal
    opening = np.array([0.25e-3, 0.75e-3, 1.5e-3, 2.5e-3])
    np.testing.assert_allclose(-glue.derivative(-opening), [15e3, 25e3, 20e3, 0.0])
    left, right = glue.knot_slopes()
    assert np.count_nonzero(right - left < 0.0) == 3


@pytest.mark.parametrize("factor", [0.5, 1.0, 1.1])
def test_delamination_in_two_systems_of_units(factor: float) -> None:
    si = solve(LoadLine(discretize(delamination(2))).at(factor)).raise_for_status()
    mm = solve(LoadLine(discretize(delamination(2, length=1e3, stress=1e-3))).at(factor)).raise_for_status()
    np.testing.assert_allclose(mm.penetration, 1e3 * si.penetration, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(mm.pressure, 1e-3 * si.pressure, rtol=1e-7, atol=1e-7)
    assert mm.steps == si.steps


def test_delamination_before_the_first_tooth_is_linear() -> None:
    line = LoadLine(discretize(delamination(2)))
    first, second = solve(line.at(0.3)).raise_for_status(), solve(line.at(0.9)).raise_for_status()
    assert -second.penetration.min() < 0.5e-3
    np.testing.assert_allclose(second.unknowns, 3.0 * first.unknowns, atol=1e-12)


def test_path_of_the_delamination_breaks_three_teeth() -> None:
    """The tip passes 0.5, 1 and 2 mm in corners of the path; the first one follows from the linear range."""
    problem = discretize(delamination(2))
    path = follow_path(problem, (0.0, 1.5))
    assert problem.contact.points is not None
    tip = int(np.argmax(problem.contact.points[:, 0]))
    opening = -path.local[:, tip, 0]
    found = []
    for tooth in (0.5e-3, 1e-3, 2e-3):
        near = np.flatnonzero(np.abs(opening - tooth) < 1e-6 * tooth)
        assert near.size >= 2, "the tip stays at the tooth while its tension drops"
        found.append(float(path.load_factor[near].max()))
    linear = solve(LoadLine(problem).at(0.5)).raise_for_status()
    assert found[0] == pytest.approx(0.5 * 0.5e-3 / -linear.penetration[tip], rel=1e-6)
    np.testing.assert_allclose(found, [0.9276, 1.0494, 1.0068], atol=1e-4)


# ---- friction that weakens ----------------------------------------------------------------------------------


@pytest.mark.parametrize("bound", [0.1, 0.25, 0.5])
def test_survey_with_logarithmic_friction_has_one_solution(bound: float) -> None:
    problem = discretize(survey_logarithmic(bound, 16))
    solution = solve(problem).raise_for_status()
    what = certify(problem, solution.unknowns, solution.multiplier)
    assert what.unique
    # c is proportional to alpha_tau = bound.
    assert what.margin == pytest.approx(1.0 - 0.1901 * bound, abs=2e-4)
    assert what.error_bound_relative < 1e-6
    slip = np.abs(solution.slip[:, 0])
    moved = slip > 1e-9
    assert moved.any()
    np.testing.assert_allclose(np.abs(solution.friction[moved, 0]), bound / (1.0 + slip[moved]), rtol=1e-7)


def test_margin_of_logarithmic_friction_ends_at_some_bound() -> None:
    assert smallness(discretize(survey_logarithmic(5.2, 16))).margin > 0.0
    assert smallness(discretize(survey_logarithmic(5.3, 16))).margin < 0.0


def test_slips_by_lambert_solve_their_equation() -> None:
    assert shear_block_slips(4.0, 0.3, 0.5) == pytest.approx((0.181215413909818,), abs=1e-15)
    assert shear_block_slips(4.0, 0.1, 0.5) == (0.0,)
    three = shear_block_slips(4.0, 0.248, 1.0, rate=20.0)
    assert len(three) == 3
    for w in three[1:]:
        assert 4.0 * (0.248 - w) == pytest.approx(0.7 + 0.3 * np.exp(-20.0 * w), abs=1e-14)
    with pytest.raises(ProblemError, match="static above kinetic"):
        shear_block_slips(4.0, 0.3, 0.5, static=0.5)


@pytest.mark.parametrize(
    ("bound", "rate", "free", "kinds"),
    [
        (0.5, 1.0, 0.3, ["local minimiser"]),
        (0.5, 1.0, 0.1, ["local minimiser"]),
        pytest.param(1.0, 20.0, 0.248, ["local minimiser", "maximum", "local minimiser"], marks=pytest.mark.slow),
        pytest.param(1.0, 20.0, 0.26, ["local minimiser"], marks=pytest.mark.slow),
    ],
)
def test_all_slips_of_the_shear_column(bound: float, rate: float, free: float, kinds: list[str]) -> None:
    """E3 by its arrays: sticking, both branches of Lambert's function, their kinds."""
    exact = shear_block_slips(4.0, free, bound, rate=rate)
    found = sorted(find_solutions(shear_column(bound, load=8.0 * free, rate=rate)), key=lambda s: float(s.slip[0, 0]))
    assert len(found) == len(exact)
    np.testing.assert_allclose([s.slip[0, 0] for s in found], exact, atol=1e-12)
    assert [s.kind for s in found] == kinds
    y = np.arange(8) / 8.0
    for solution, slip in zip(found, exact, strict=True):
        force = 4.0 * (free - slip)
        np.testing.assert_allclose(solution.unknowns, slip + (force * y - 4.0 * free * y**2) / 4.0, atol=1e-12)
        assert solution.friction[0, 0] == pytest.approx(-force, abs=1e-11)


# ---- examples, problem files, methods -----------------------------------------------------------------------


def load(path: Path) -> ModuleType:
    spec = importlib.util.spec_from_file_location(f"loaded_{path.stem}", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


def run_example(name: str) -> dict[str, Any]:
    """What an example has defined when it has run."""
    matplotlib.use("Agg")
    found = runpy.run_path(str(ROOT / "examples" / f"{name}.py"), run_name="__main__")
    plt.close("all")
    return found


@pytest.mark.slow
def test_example_of_the_weakening_friction() -> None:
    found = run_example("weakening_friction")
    assert found["worst"] < 1e-12
    assert len(found["roots"]) == 6
    assert found["margins"][1.0] == pytest.approx(0.8101, abs=1e-4)
    slips = found["slips"]
    assert slips[0.1] > slips[0.25] > slips[0.5] > 0.0 == slips[1.0]


@pytest.mark.slow
def test_example_of_the_delamination() -> None:
    found = run_example("delamination")
    assert found["units"] < 1e-9
    assert [found["FACTORS"][i] for i in found["jumps"]] == [0.94, 1.06]
    assert found["teeth"] == pytest.approx([0.9276, 1.0494, 1.0068], abs=1e-4)


@pytest.mark.slow
def test_example_of_the_foundation_that_breaks() -> None:
    found = run_example("broken_foundation")
    assert found["supported"].energy == pytest.approx(-0.139150, abs=1e-6)
    assert found["broken"].energy < -0.35
    loads = [*found["loads"].values(), found["breaking_load"](16)]
    assert loads == pytest.approx([2.348005, 2.327331, 2.324275], abs=2e-6)


def test_problem_files_state_the_same_problems() -> None:
    folder = ROOT / "examples" / "problems"
    for name, problem in (
        ("broken_foundation", broken_foundation(16)),
        ("delamination", delamination(2)),
        ("survey_logarithmic", survey_logarithmic(0.25, 32)),
    ):
        from_file = solve(discretize(read_problem(folder / f"{name}.toml"))).raise_for_status()
        direct = solve(discretize(problem)).raise_for_status()
        np.testing.assert_allclose(from_file.displacement, direct.displacement, rtol=1e-7, atol=1e-12)


@pytest.mark.parametrize("normal", ["softening, steep", "capped", "adhesive, softening"])
def test_no_method_is_wrong_and_says_converged(normal: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """A part of the method table: the rest by ``python benchmarks/method_table.py --check``."""
    table = load(ROOT / "benchmarks" / "method_table.py")
    monkeypatch.setattr(table, "NORMAL", {normal: table.NORMAL[normal]})
    monkeypatch.setattr(table, "FRICTION", {name: table.FRICTION[name] for name in ("none", "logarithmic")})
    runs = table.run_all(3, 2.0)
    assert len(runs) == 3 * len(METHODS)
    assert not [run for run in runs if run.wrong]
    assert all(run.solved for run in runs if run.method == "newton")
    assert all(len(run.words) > 30 for run in runs if run.outcome == "refuses")
