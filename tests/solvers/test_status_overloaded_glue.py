"""Glue beyond its load: a bracket of what it carries, for every law, and no advice that leads in a circle."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import hemivar as hv
from hemivar.discrete.point_kind import PointKind
from hemivar.fem import LoadLine
from hemivar.laws import BenzeggaghKenane, BilinearCohesion, MixedMode, ModeDependentGlue, SlipTable
from hemivar.mesh import Mesh
from hemivar.solvers import METHODS, LoadStepping, NonsmoothNewton, Search, Status, solve
from tests.samples import slow

STRENGTH = 2.0
SLIP = SlipTable(STRENGTH, [0.0, 0.1, 0.5], [0.0, 1.0, 0.0])
#: In every one a block that is pulled off evenly bears the strength.
GLUES = {
    "adhesive": hv.Contact(hv.Adhesive(24.0, STRENGTH, 6.0, 72.0), SLIP),
    "brittle": hv.Contact(hv.Adhesive(24.0, STRENGTH), SLIP),
    "mixed-mode": hv.Contact(MixedMode(BilinearCohesion(STRENGTH, 0.5, 24.0), 1.0)),
    "mode-dependent": hv.Contact(ModeDependentGlue(STRENGTH, STRENGTH, 24.0, BenzeggaghKenane(0.5, 0.9, 2.0))),
}
PLANE, SPACE = hv.rectangle((1.0, 1.0), 4), hv.box((1.0, 1.0, 1.0), 2)


def glued_only(glue: str, pull: tuple[float, ...], mesh: Mesh = PLANE) -> hv.ContactProblem:
    """A block that nothing but glue holds, with a force on its whole volume."""
    return hv.ContactProblem(
        mesh=mesh, material=hv.Material.lame(4e3, 4e3), contact={"bottom": GLUES[glue]}, body_force=pull
    )


@pytest.mark.parametrize("glue", GLUES)
@pytest.mark.parametrize("times", [slow(1.02), 2.3, slow(300.0)])
@pytest.mark.parametrize("mesh", [PLANE, pytest.param(SPACE, marks=pytest.mark.slow)], ids=["plane", "space"])
def test_what_glue_carries_is_bracketed(glue: str, times: float, mesh: Mesh) -> None:
    """A stiff block that is pulled off evenly: strength times area."""
    pull = (*(0.0,) * (mesh.dim - 1), times * STRENGTH)
    found = solve(glued_only(glue, pull, mesh))
    assert found.status is Status.NOT_CARRIED
    assert found.carried is not None
    low, high = found.carried
    assert low * times <= 1.0 + 1e-9
    assert high * times >= 1.0 - 1e-3
    assert high - low <= 0.01 * high
    assert np.abs(found.unknowns).max() < 1.0  # the last equilibrium, not where the body has gone
    assert f"`hemivar solve --load-factor {low:.4g}`" in found.remedy
    line = LoadLine(found.problem)
    assert solve(line.at(low)).status is Status.CONVERGED
    assert solve(line.at(1.001 * high)).status is Status.NOT_CARRIED


@pytest.mark.parametrize("glue", GLUES)
def test_an_iterate_that_runs_away_is_recognised(glue: str) -> None:
    """From a start of one's own no load grows: the solve ends by what it sees."""
    problem = hv.discretize(glued_only(glue, (0.3, 2.3 * STRENGTH)))
    found = solve(problem, initial=np.zeros(problem.unknowns))
    assert found.status is Status.NOT_CARRIED
    assert found.steps < 100


def test_a_solve_that_carries_its_load_says_nothing_of_it() -> None:
    found = solve(glued_only("mixed-mode", (0.0, 0.5 * STRENGTH)))
    assert found.carried is None
    assert found.remarks == ()


def test_units_do_not_change_what_is_carried() -> None:
    found = solve(glued_only("mixed-mode", (0.7, 2.3 * STRENGTH)))
    glue = hv.Contact(MixedMode(BilinearCohesion(STRENGTH * 1e-6, 0.5e-3, 24e-9), 1.0))
    mesh = hv.rectangle((1e3, 1e3), 4)
    theirs = replace(
        glued_only("mixed-mode", (0.7e-9, 2.3e-9 * STRENGTH), mesh),
        material=hv.Material.lame(0.004, 0.004),
        contact={"bottom": glue},
    )
    assert solve(theirs).carried == found.carried


# ---- displacements that are prescribed ---------------------------------------------------------------------------


def notched(deflection: float) -> hv.ContactProblem:
    """Half a notched beam, bent at its middle; glue along its axis behind the notch alone holds it along."""
    half, height, notch, strength, energy = 51.0, 1.56, 39.3, 150.0, 1.719
    cells = (204, 4)
    long, thick = 2.0 * half / cells[0], height / cells[1]
    mesh = hv.rectangle((2.0 * half, height), cells).with_boundaries(
        {
            "glue": lambda x: (x[:, 1] < 1e-9) & (x[:, 0] > notch),
            "left foot": lambda x: (x[:, 1] < 1e-9) & (x[:, 0] < long),
            "right foot": lambda x: (x[:, 0] > 2.0 * half - 1e-9) & (x[:, 1] < thick),
            "nose": lambda x: (x[:, 1] > height - 1e-9) & (np.abs(x[:, 0] - half) < long),
        }
    )
    slips = [0.0, strength / 2e4, energy / strength]
    return hv.ContactProblem(
        mesh=mesh,
        material=hv.Material.young(122700.0, 0.3, plane="stress"),
        supports={"left foot": hv.Fixed(y=0.0), "right foot": hv.Fixed(y=0.0), "nose": hv.Fixed(y=-deflection)},
        contact={"glue": hv.Contact(hv.Compliance(1e-6), SlipTable(strength, slips, [0.0, 1.0, 0.0]))},
    )


def test_small_steps_find_the_equilibrium_of_a_beam_whose_notch_has_grown() -> None:
    found = solve(notched(0.9 * 3.67)).raise_for_status()
    assert (np.abs(found.slip) > 1.719 / 150.0).sum() > 10
    assert found.certify().kind is PointKind.LOCAL_MINIMISER
    assert found.residual.relative < 1e-9


def test_prescribed_displacements_grow_with_the_load() -> None:
    line = LoadLine.to(hv.discretize(notched(2.0)))
    for factor in (0.0, 0.25, 1.0):
        expected, there = hv.discretize(notched(2.0 * factor)), line.at(factor)
        np.testing.assert_allclose(there.load, expected.load, atol=1e-9 * np.abs(line.loaded.load).max())
        np.testing.assert_allclose(there.offset, expected.offset, atol=1e-12)
        assert there.field is not None
        assert expected.field is not None
        np.testing.assert_allclose(there.field.prescribed, expected.field.prescribed, atol=1e-12)


def test_load_steps_pass_where_points_let_go_one_after_the_other() -> None:
    """A step that fails is halved, and those after it grow again."""
    found = solve(notched(0.9 * 3.67), LoadStepping(NonsmoothNewton(search=Search.DOWNHILL), steps=2))
    assert found.status is Status.CONVERGED


def test_the_width_of_the_bracket_is_an_option() -> None:
    problem = hv.discretize(glued_only("mixed-mode", (0.0, 2.3 * STRENGTH)))
    method = LoadStepping(METHODS["newton"].local_descent(), width=0.2)
    found = solve(problem, method)
    assert found.carried is not None
    low, high = found.carried
    assert low <= 1.0 / 2.3 <= high
    assert 0.01 * high < high - low <= 0.2 * high
    with pytest.raises(hv.errors.ProblemError, match=r"LoadStepping\.width is 2"):
        LoadStepping(width=2.0)


def test_every_load_of_the_steps_is_that_of_a_part_of_the_statement() -> None:
    """Displacements are prescribed at contact points, too: with half of the load they are half as large."""

    def held(factor: float) -> hv.DiscreteProblem:
        stated = hv.ContactProblem(
            mesh=PLANE,
            material=hv.Material.lame(4.0, 4.0),
            supports={"left": hv.Fixed(x=0.02 * factor)},
            contact={"bottom": hv.Contact(hv.Adhesive(24.0, 20.0, 6.0, 72.0), hv.Tresca(0.1))},
            tractions={"top": (0.1 * factor, -0.2 * factor)},
        )
        return hv.discretize(stated)

    seen: list[hv.DiscreteProblem] = []

    class Watching(NonsmoothNewton):
        def begin(self, system: object, start: object, budget: object) -> object:
            seen.append(system.problem)  # type: ignore[attr-defined]
            return super().begin(system, start, budget)  # type: ignore[arg-type]

    assert solve(held(1.0), LoadStepping(Watching(), steps=2)).status is Status.CONVERGED
    for problem, factor in zip(seen, (0.0, 0.5, 1.0), strict=False):
        expected = held(factor)
        np.testing.assert_allclose(problem.load, expected.load, atol=1e-15)
        np.testing.assert_allclose(problem.offset, expected.offset, atol=1e-15)
        assert problem.constant == pytest.approx(expected.constant, abs=1e-15)
    assert np.abs(held(1.0).offset).max() > 0.01


def test_a_load_that_failed_from_afar_is_tried_from_close_by() -> None:
    method = LoadStepping(width=0.01)
    assert method._next(0.5, np.inf, 0.1) == 0.6
    assert method._next(0.95, np.inf, 0.1) == 1.0
    assert method._next(0.5, 0.6, 0.1) == 0.55
    assert method._next(0.595, 0.6, 0.1) == 0.6
