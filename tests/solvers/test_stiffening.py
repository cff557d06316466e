"""Bodies that the stress of their load stiffens or softens: columns by closed forms, the lap joint by beams."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import hemivar as hv
from hemivar.discrete.residual import residual
from hemivar.errors import ProblemError
from hemivar.fem.reactions import support_reactions
from hemivar.fem.stress_stiffness import stressed_problem
from hemivar.solvers.solve import solving
from hemivar.solvers.stiffening import Ordinary
from hemivar.systems.workspace import Workspace
from tests.samples import slow
from tests.solvers.beam_columns import LapJoint

#: A cantilever: Young's modulus, length, thickness, and Euler's load with the shear of a rectangle.
YOUNG, LENGTH, THICK = 1000.0, 20.0, 1.0
BENDS = YOUNG * THICK**3 / 12.0
EULER = np.pi**2 * BENDS / (4.0 * LENGTH**2)
BUCKLES = EULER / (1.0 + EULER / (5.0 / 6.0 * 0.5 * YOUNG * THICK))
JOINT = LapJoint()


def pushed_cantilever(
    pushed: float, aside: float = 1e-5, cells: tuple[int, int] = (20, 1), **changed: object
) -> hv.ContactProblem:
    """A cantilever without lateral contraction, pushed along its axis, with a small force across at its end."""
    stated = {"order": 2, "stiffening": True, "contact": {}, "supports": {"left": hv.Clamped()}}
    tractions = {"right": (-pushed / THICK, aside / THICK)}
    mesh, material = hv.rectangle((LENGTH, THICK), cells), hv.Material.young(YOUNG, 0.0)
    return hv.ContactProblem(mesh, material, **(stated | changed), tractions=tractions)  # type: ignore[arg-type]


@pytest.mark.parametrize("part", [-2.0, 0.5, 0.9])
def test_a_column_bends_as_by_the_closed_form(part: float) -> None:
    """The deflection of a beam-column, ``q (tan kL / k - L) / P``, and with hyperbolic functions under tension.

    The load that buckles it is that of Engesser, to 0.1 %: the nearer the load is, the more that matters.
    """
    pushed = part * BUCKLES
    solution = hv.solve(pushed_cantilever(pushed)).raise_for_status()
    along = np.sqrt(abs(part * EULER) / BENDS)
    bent = (np.tan(along * LENGTH) if part > 0.0 else np.tanh(along * LENGTH)) / along
    assert solution.displacement[:, 1].max() == pytest.approx(
        1e-5 * (bent - LENGTH) / (part * EULER), rel=max(2e-3, 1e-3 / (1.0 - part))
    )
    assert solution.reactions["left"] == pytest.approx([pushed, -1e-5], rel=1e-6)


@pytest.mark.parametrize("dim", [2, pytest.param(3, marks=pytest.mark.slow)])
def test_a_column_above_its_load_is_refused_with_the_factor_at_which_it_buckles(dim: int) -> None:
    """Euler's load with Engesser's shear, to 1 %, however far above it the load is."""
    for times in (1.1, 20.0):
        problem = pushed_cantilever(times * BUCKLES)
        if dim == 3:
            mesh = hv.box((LENGTH, 1.0, 1.0), (20, 1, 1))
            problem = replace(problem, mesh=mesh, tractions={"right": (-times * BUCKLES, 1e-5, 0.0)})
        with pytest.raises(ProblemError, match="the body buckles under its load, at about") as refused:
            hv.solve(problem)
        factor = float(str(refused.value).split("at about ")[1].split()[0])
        assert factor * times == pytest.approx(1.0, abs=0.01)


@pytest.mark.parametrize("method", ["newton", "multigrid"])
def test_a_straight_column_above_its_load_is_no_answer(method: str) -> None:
    """It is in balance, but not definite."""
    mesh = hv.rectangle((LENGTH, THICK), (20, 2), pattern="cross").marked({"side": f"y < 1e-9 and x > {LENGTH - 1.01}"})
    free = {"side": hv.Contact(hv.laws.NoContact())}
    straight = replace(pushed_cantilever(3.0 * EULER, 0.0), mesh=mesh, contact=free, order=1)
    with pytest.raises(ProblemError, match="the body buckles under its load"):
        hv.solve(straight, method=method)


@pytest.mark.parametrize("method", ["newton", "multigrid"])
@pytest.mark.parametrize(("part", "definite"), [(0.9, True), (1.1, False)])
def test_what_a_method_has_set_up_tells_whether_a_stiffness_is_definite(
    method: str, part: float, definite: bool
) -> None:
    """By the condensed body, and by multigrid of the body without its stress."""
    mesh = hv.rectangle((LENGTH, THICK), (20, 2)).marked({"side": f"y < 1e-9 and x > {LENGTH - 1.01}"})
    plain = hv.discretize(
        replace(pushed_cantilever(BUCKLES, 0.0), mesh=mesh, contact={"side": hv.Contact(hv.laws.NoContact())})
    )
    solution, kept = hv.solve(replace(plain.origin, stiffening=False)), Workspace()
    stressed = stressed_problem(plain, part * solution.unknowns)
    if method == "newton":
        kept.condensed(stressed)
    ordinary = Ordinary(solving, method, kept)
    assert ordinary.definite(replace(solution, problem=stressed), plain) == definite


def test_a_prop_that_presses_holds_a_column() -> None:
    """A rigid stop beside the end of a column raises its load from Euler's to 20.19 EI / L^2.

    Its stiffness alone is not definite, so that no word of one solution is said.
    """
    mesh = hv.rectangle((LENGTH, THICK), (20, 2)).marked({"side": f"y < 1e-9 and x > {LENGTH - 1.01}"})
    with_stop = replace(pushed_cantilever(2.0 * EULER, -1e-3), mesh=mesh, contact={"side": hv.Contact(hv.Signorini())})
    solution = hv.solve(with_stop).raise_for_status()
    assert solution.normal_force > 0.0
    certificate = solution.certify()
    assert (certificate.unique, str(certificate.kind)) == (None, "local minimiser")
    assert "rigid motions" not in str(certificate)
    assert "supports alone do not constrain" not in str(certificate)
    assert (certificate.smallness.survey_condition, certificate.smallness.survey_margin) == (None, None)
    with pytest.raises(ProblemError, match="buckles"):
        hv.solve(pushed_cantilever(2.0 * EULER, -1e-6))


def test_the_residual_is_that_with_the_stress_of_the_answer() -> None:
    """``f - (K + K_s(u)) u``, evaluated apart."""
    problem = pushed_cantilever(0.5 * BUCKLES, 0.01)
    solution = hv.solve(problem)
    plain = hv.discretize(problem)
    stressed = stressed_problem(plain, solution.unknowns)
    left = plain.load - stressed.stiffness @ solution.unknowns
    assert np.abs(left).max() <= 1e-8 * np.abs(plain.load).max()


@pytest.mark.parametrize("method", ["newton", "multigrid"])
def test_methods_agree(method: str) -> None:
    """Contact under tension: the body and its multigrid levels have the stress."""
    mesh = hv.rectangle((8.0, 1.0), (8, 2)).refined(2)
    problem = hv.ContactProblem(
        mesh, hv.Material.young(1000.0, 0.3), {"bottom": hv.Contact(hv.Signorini(), hv.Tresca(0.05), gap=0.05)},
        {"left": hv.Clamped()}, tractions={"right": (20.0, 0.0), "top": (0.0, -0.3)}, stiffening=True,
    )  # fmt: skip
    solution, other = hv.solve(problem, method=method), hv.solve(problem, method="newton")
    assert solution.status is hv.Status.CONVERGED
    assert solution.displacement == pytest.approx(other.displacement, abs=1e-7 * np.abs(other.displacement).max())
    soft = hv.solve(replace(problem, stiffening=False))
    assert np.abs(soft.displacement - solution.displacement).max() > 0.02 * np.abs(soft.displacement[:, 1]).max()


@pytest.mark.parametrize("force", [60.0, -5.0])
def test_a_lap_joint_bends_as_beams_that_the_same_glue_joins(force: float) -> None:
    """The moment beside the overlap on a coarse mesh, under tension and compression; see :mod:`.beam_columns`."""
    assert abs(JOINT.by_elements(force, (80, 2))) == pytest.approx(JOINT.by_beams(force, 1.25, size=0.25), rel=0.02)


@pytest.mark.parametrize("cells", [slow((80, 2)), slow((160, 3)), slow((320, 4))])
@pytest.mark.parametrize("force", [-10.0, 15.0, 120.0, 200.0])
def test_a_lap_joint_on_three_meshes(cells: tuple[int, int], force: float) -> None:
    """Within 2 % of beam-columns; without stiffening their k does not depend on the force."""
    beams = JOINT.by_beams(force, JOINT.length / cells[0])
    assert abs(JOINT.by_elements(force, cells)) == pytest.approx(beams, rel=0.02)
    straight = JOINT.by_beams(force, JOINT.length / cells[0], stiffening=False)
    assert abs(JOINT.by_elements(force, cells, stiffening=False)) == pytest.approx(straight, rel=0.02)
    assert abs(beams / straight - 1.0) > 0.02


def test_beams_tend_to_goland_and_reissner() -> None:
    """Long plates and an overlap that bends as one beam: a stiff glue, whose k theirs is to 5 %."""
    long = replace(JOINT, length=400.0, overlap=25.0, peel=1e6, shear=1e6)
    for force in (30.0, 120.0):
        assert long.by_beams(force, 0.5, size=0.5) == pytest.approx(long.goland_reissner(force), rel=0.05)


def pressed_bar() -> hv.ContactProblem:
    """A block that is held on its left and pressed on a foundation."""
    mesh = hv.rectangle((4.0, 1.0), (4, 1))
    return hv.ContactProblem(
        mesh, hv.Material.young(1000.0, 0.3), {"bottom": hv.Contact(hv.Signorini())},
        {"left": hv.Clamped()}, tractions={"top": (0.0, -1.0)}, stiffening=True,
    )  # fmt: skip


def test_claims_are_those_of_the_stress_that_is_held() -> None:
    """No word of the only solution of a problem that has no energy."""
    certificate = hv.solve(pressed_bar()).certify()
    assert certificate.unique == "the only one with this stress"
    assert certificate.kind is hv.certificates.PointKind.LOCAL_MINIMISER
    assert "with the stress of its load held as it is here" in str(certificate)


def leaning(part: float, slope: float, **changed: object) -> hv.ContactProblem:
    """A column on a coarse mesh under a part of Euler's load that comes in at a slope."""
    return pushed_cantilever(part * EULER, slope * part * EULER, (8, 1), **changed)


def test_another_load_has_its_own_stress() -> None:
    """The problem of a solution is the one that was stated: another load is one of it."""
    solution = hv.solve(leaning(0.5, 0.03))
    known = solution.problem
    again = hv.solve(known.with_(load=1.6 * known.load)).raise_for_status()
    assert again.displacement == pytest.approx(hv.solve(leaning(0.8, 0.03)).displacement, rel=1e-6, abs=1e-9)
    assert again.displacement[:, 1].max() > 2.0 * 1.6 * solution.displacement[:, 1].max()


def test_what_is_kept_of_a_solution_has_its_stress() -> None:
    """Reactions and residual of a discrete problem and a displacement alone."""
    problem = leaning(0.6, 0.03)
    solution, discrete = hv.solve(problem), hv.discretize(problem)
    by_hand = [0.6 * EULER, -0.03 * 0.6 * EULER]
    assert support_reactions(discrete, solution.displacement, solution.multiplier)["left"] == pytest.approx(by_hand)
    assert residual(discrete, solution.unknowns, solution.multiplier).relative < 1e-8
    plain = hv.solve(replace(problem, stiffening=False))
    assert residual(discrete, plain.unknowns, plain.multiplier).relative > 1e-3


def glued_block() -> hv.ContactProblem:
    """A block on glue whose gap is closed by more than nothing."""
    glue = hv.laws.MixedMode(hv.laws.BilinearCohesion(stiffness=210.0, strength=3.0, energy=0.5))
    return hv.ContactProblem(
        hv.rectangle((4.0, 1.0), (8, 2)), hv.Material.young(100.0, 0.3), {"bottom": hv.Contact(glue, gap=-0.002)},
        {"top": hv.Clamped()}, body_force=(0.02, 0.0), stiffening=True,
    )  # fmt: skip


def test_glue_with_interference_does_not_buckle() -> None:
    """It moves by the interference, and carries its load."""
    problem = glued_block()
    solution = hv.solve(problem).raise_for_status()
    plain = hv.solve(replace(problem, stiffening=False))
    assert solution.displacement == pytest.approx(plain.displacement, abs=0.01 * np.abs(plain.displacement).max())


@pytest.mark.parametrize("part", [0.95, slow(1.02), slow(1.1)])
@pytest.mark.parametrize("slope", [1.0 / 30.0, 1.0 / 300.0])
def test_a_column_that_bends_far_is_in_balance_beyond_the_load_of_a_straight_one(part: float, slope: float) -> None:
    """``(K + K_s(u)) u = f``, the matrix being definite: its bending relieves its end."""
    problem = leaning(part, slope)
    solution = hv.solve(problem).raise_for_status()
    plain = hv.discretize(problem)
    own = stressed_problem(plain, solution.unknowns).stiffness
    assert np.linalg.norm(own @ solution.unknowns - plain.load) <= 1e-8 * np.linalg.norm(plain.load)
    assert np.linalg.eigvalsh(own.toarray())[0] > 0.0


@pytest.mark.slow
def test_what_does_not_settle_is_no_solution_and_said_not_to_buckle() -> None:
    """Beyond the load up to which equilibria are found nothing is claimed: not that it buckles, nor a solution."""
    problem = leaning(2.0, 1.0 / 30.0)
    solution = hv.solve(problem)
    own = stressed_problem(hv.discretize(problem), solution.unknowns).stiffness
    left = np.linalg.norm(own @ solution.unknowns - solution.problem.load) / np.linalg.norm(solution.problem.load)
    assert solution.status is hv.Status.MAX_STEPS
    assert solution.residual.relative == pytest.approx(left, rel=0.01)
    assert not solution.certify().stationary
    assert solution.carried is not None
    assert 0.5 < solution.carried[0] < solution.carried[1] < 1.0
    assert "the stress of the load and the answer do not settle" in solution.remedy
    assert "Controls.max_steps" not in solution.remedy


@pytest.mark.parametrize("method", ["multigrid", "newton"])
def test_a_tolerance_that_one_solve_misses_is_met_by_the_next(method: str) -> None:
    """A thin beam under tension, which multigrid of the body without its stress solves less sharply."""
    problem = hv.ContactProblem(
        hv.rectangle((20.0, 0.5), (10, 1)).refined(2), hv.Material.young(1000.0, 0.3),
        {"bottom": hv.Contact(hv.Signorini(), gap=50.0)}, {"left": hv.Clamped()},
        tractions={"right": (10.0, 2.0)}, stiffening=True,
    )  # fmt: skip
    solution = hv.solve(problem, method=method).raise_for_status()
    assert residual(hv.discretize(problem), solution.unknowns, solution.multiplier).relative < 1e-8


def test_the_limit_of_steps_is_one_for_all_solves() -> None:
    """A cantilever on a foundation with Coulomb's friction."""
    problem = hv.ContactProblem(
        hv.rectangle((8.0, 1.0), (16, 2)), hv.Material.young(1000.0, 0.3),
        {"bottom": hv.Contact(hv.Signorini(), hv.Coulomb(0.3), gap=0.01)}, {"left": hv.Clamped()},
        tractions={"right": (-1.0, 0.1), "top": (0.0, -0.5)}, stiffening=True,
    )  # fmt: skip
    free = hv.solve(problem).raise_for_status()
    assert free.steps > 4
    short = hv.solve(problem, max_steps=4)
    assert short.steps <= 4
    assert short.status is hv.Status.MAX_STEPS
    left = residual(hv.discretize(problem), short.unknowns, short.multiplier).relative
    assert 1e-8 < left == pytest.approx(short.residual.relative)
    assert not short.certify().stationary
