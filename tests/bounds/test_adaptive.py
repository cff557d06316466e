"""Adaptive solves: the distance that is asked for is reached, on fewer cells, and it is a bound all the way."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

import hemivar as hv
from hemivar.bounds import AdaptiveSolution, solve_adaptive
from hemivar.bounds import adaptive as loop
from hemivar.bounds.adaptive import AdaptOptions, solving_adaptive
from hemivar.errors import MethodError, ProblemError
from hemivar.fem.assembly import stiffness_matrix
from hemivar.fem.transfer import interpolate
from hemivar.gallery import survey, survey_cube
from hemivar.gallery.known import weighted_block
from hemivar.mesh import rectangle
from tests import bodies


@pytest.fixture(scope="module")
def softening() -> AdaptiveSolution:
    """A foundation whose friction weakens, on a body with a strong corner at its support."""
    problem = bodies.square(
        hv.Contact(hv.Compliance(10.0), hv.SlipWeakening(0.1, 1.0, 0.5, 20.0)), 4, body_force=(0.9, -0.3)
    )
    return solve_adaptive(problem, rtol=0.08)


def test_a_guaranteed_distance_is_reached(softening: AdaptiveSolution) -> None:
    assert softening.reached
    assert softening.ended == "reached"
    assert softening.distance.relative <= 0.08
    for level in softening.levels:
        assert level.solution.status is hv.Status.CONVERGED
        assert level.distance.guaranteed
        assert 0.0 < level.distance.constant < 1.0
        assert level.indicator.sum() >= 0.999 * level.distance.parts.misfit**2
    assert "reached" in repr(softening)
    rows = softening.rows()
    assert [row["unknowns"] for row in rows] == [level.unknowns for level in softening.levels]
    assert rows[-1]["relative_bound"] == softening.distance.relative


def test_the_bound_holds_on_every_mesh(softening: AdaptiveSolution) -> None:
    """Against the solution with quadratic elements on the last mesh refined once more, which is nested in all."""
    last = softening.solution.problem
    assert isinstance(last.origin, hv.ContactProblem)
    fine = replace(last.origin, mesh=last.origin.mesh.refined(), order=2)
    reference = hv.solve(fine)
    assert reference.status is hv.Status.CONVERGED
    field = reference.problem.field
    assert field is not None
    K = stiffness_matrix(fine.mesh, fine.material, 2)
    for level in softening.levels:
        own = level.problem.field
        assert own is not None
        off = (reference.displacement - interpolate(own, level.solution.displacement, field)).ravel()
        error = math.sqrt(off @ (K @ off))
        assert error <= level.distance.distance
        assert level.distance.distance * (1.0 - level.distance.constant) < 2.0 * error


def test_a_known_solution() -> None:
    known = weighted_block(n=2)
    found = solve_adaptive(known.problem, rtol=0.03)
    assert found.reached
    for level in found.levels:
        own = level.problem.field
        assert own is not None
        assert isinstance(level.problem.origin, hv.ContactProblem)
        fine = replace(level.problem.origin, mesh=level.problem.origin.mesh.refined(), order=2)
        nodes = fine.mesh.nodes(2)
        off = (known.displacement(nodes) - interpolate(own, level.solution.displacement, nodes)).ravel()
        error = math.sqrt(off @ (stiffness_matrix(fine.mesh, fine.material, 2) @ off))
        assert error <= level.distance.distance < 1.6 * error


@pytest.mark.slow
@pytest.mark.parametrize("data", ["figure1", "figure3", "5.1"])
def test_linear_elements_converge_at_their_best_rate(data: str) -> None:
    """One half in the number of unknowns, whatever the corners do; uniform meshes have less."""
    found = solve_adaptive(survey(data, 4), rtol=1e-6, max_unknowns=6000)
    assert found.ended == "max_unknowns"
    assert 0.46 < found.rate < 0.6


@pytest.mark.slow
@pytest.mark.parametrize("data", ["figure2", "5.1"])
def test_quadratic_elements_converge_at_their_best_rate(data: str) -> None:
    """One in the number of unknowns; uniform meshes have about a half."""
    found = solve_adaptive(replace(survey(data, 4), order=2), rtol=1e-6, max_unknowns=16000)
    assert found.ended == "max_unknowns"
    assert 0.95 < found.rate < 1.15


def test_quadratic_elements_need_fewer_unknowns() -> None:
    """The bound holds on every mesh, against the last one refined once more; some per thousand are soon reached."""
    problem = replace(survey("5.1", 4), order=2, contact={"bottom": hv.Contact(hv.Signorini(), hv.Tresca(0.1))})
    found = solve_adaptive(problem, rtol=0.005)
    assert found.reached
    assert found.distance.guaranteed, found.distance.reasons
    assert found.solution.problem.unknowns < 2500
    last = found.solution.problem.origin
    assert isinstance(last, hv.ContactProblem)
    fine = replace(last, mesh=last.mesh.refined())
    reference = hv.solve(fine)
    field = reference.problem.field
    assert field is not None
    K = stiffness_matrix(fine.mesh, fine.material, 2)
    for level in found.levels:
        own = level.problem.field
        assert own is not None
        off = (reference.displacement - interpolate(own, level.solution.displacement, field)).ravel()
        error = math.sqrt(off @ (K @ off))
        assert error <= level.distance.distance < 2.0 * error


def test_it_refines_where_the_error_is(softening: AdaptiveSolution) -> None:
    mesh = softening.solution.problem.field.mesh  # type: ignore[union-attr]
    assert mesh.volumes.min() < mesh.volumes.max() / 15.0
    smallest = mesh.points[mesh.cells].mean(axis=1)[mesh.volumes < 1.01 * mesh.volumes.min()]
    ends = np.array([[0.0, 0.0], [0.0, 1.0]])  # of the clamped edge
    assert np.linalg.norm(smallest[:, None] - ends, axis=2).min(axis=1).max() < 0.1


def test_where_it_ends() -> None:
    problem = survey("5.1", 4)
    assert solve_adaptive(problem, rtol=1e-9, max_unknowns=100).ended == "max_unknowns"
    assert solve_adaptive(problem, rtol=1e-9, max_time=1e-9).ended == "max_time"
    running = solving_adaptive(problem, AdaptOptions(rtol=1e-9))
    next(running)
    with pytest.raises(StopIteration) as ended:
        running.send(True)
    assert ended.value.value.ended == "stopped"
    assert len(ended.value.value.levels) == 1
    assert math.isnan(ended.value.value.rate)


def test_a_body_without_margin_has_no_bound() -> None:
    law = hv.Contact(hv.Compliance(10.0), hv.SlipWeakening(0.1, 1.0, 0.2, 2000.0))
    problem = replace(survey("5.1", 4), contact={"bottom": law}, body_force=(0.9, -0.3))
    found = solve_adaptive(problem)
    assert found.ended == "no bound"
    assert not found.reached
    assert not found.distance.guaranteed
    assert "softens too much" in " ".join(found.distance.reasons)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"rtol": 0.0}, "rtol = 0.0; give a positive number"),
        ({"rtol": -1.0}, "rtol = -1.0; give a positive number"),
        ({"share": 2.0}, "cells, at most 1"),
        ({"share": 0.0}, "share = 0.0; give a positive number"),
        ({"max_time": float("nan")}, "give a positive number"),
        ({"max_memory": 0.0}, "max_memory = 0.0; give a positive number"),
        ({"max_unknowns": 0}, "max_unknowns = 0; give a positive number"),
        ({"goal": "force"}, "goal 'force' is not known"),
        ({"rtol": "small"}, "rtol"),
    ],
)
def test_options_are_checked(options: dict[str, object], message: str) -> None:
    with pytest.raises(ProblemError, match=message):
        solve_adaptive(survey("5.1", 4), **options)  # type: ignore[arg-type]


def test_quadratic_elements_and_other_things_are_refused() -> None:
    with pytest.raises(ProblemError, match="linear elements only; use order = 1"):
        solve_adaptive(replace(survey_cube("5.1", 2), order=2, contact={}))
    with pytest.raises(ProblemError, match="give a ContactProblem"):
        solve_adaptive(hv.discretize(survey("5.1", 4)))  # type: ignore[arg-type]


def test_an_interruption_keeps_what_was_finished(monkeypatch: pytest.MonkeyPatch) -> None:
    whole, calls = loop.solve, []

    def interrupted(*args: object, **options: object) -> hv.Solution:
        calls.append(1)
        if len(calls) == 3:
            raise KeyboardInterrupt
        return whole(*args, **options)  # type: ignore[arg-type]

    monkeypatch.setattr(loop, "solve", interrupted)
    found = solve_adaptive(survey("5.1", 4), rtol=1e-3)
    assert found.ended == "interrupted"
    assert len(found.levels) == 2
    calls[:] = [1, 1]
    with pytest.raises(KeyboardInterrupt):  # there is nothing to keep
        solve_adaptive(survey("5.1", 4), rtol=1e-3)


def test_memory_that_does_not_suffice_is_an_end(monkeypatch: pytest.MonkeyPatch) -> None:
    found = solve_adaptive(survey("5.1", 4), rtol=1e-3, max_memory=1e5)
    assert found.ended == "max_memory"
    assert "the next mesh needs about" in found.remedy
    monkeypatch.setattr(loop, "available_bytes", lambda: 1e5)
    assert solve_adaptive(survey("5.1", 4), rtol=1e-3).ended == "max_memory"
    whole, calls = loop.exact_distance, []

    def greedy(*args: object, **options: object) -> object:
        calls.append(1)
        if len(calls) == 2:
            raise MemoryError
        return whole(*args, **options)  # type: ignore[arg-type]

    monkeypatch.setattr(loop, "available_bytes", lambda: None)
    monkeypatch.setattr(loop, "exact_distance", greedy)
    found = solve_adaptive(survey("5.1", 4), rtol=1e-3)
    assert (found.ended, len(found.levels)) == ("max_memory", 1)


def test_a_mesh_without_a_bound_leaves_those_before_it(monkeypatch: pytest.MonkeyPatch) -> None:
    whole, calls = loop.exact_distance, []

    def fails(*args: object, **options: object) -> object:
        calls.append(1)
        if len(calls) == 2:
            raise MethodError("1000 cycles leave too much")
        return whole(*args, **options)  # type: ignore[arg-type]

    monkeypatch.setattr(loop, "exact_distance", fails)
    found = solve_adaptive(survey("5.1", 4), rtol=1e-3)
    assert (found.ended, len(found.levels)) == ("no bound", 1)
    assert found.distance.guaranteed
    assert "on the next mesh: 1000 cycles leave too much" in found.remedy


def test_what_is_only_estimated_is_not_called_reached() -> None:
    stated = survey("5.1", 4)
    ((name, contact),) = stated.contact.items()
    problem = replace(stated, contact={name: replace(contact, gap=lambda x: 0.01 * x[:, 0] ** 2)})
    found = solve_adaptive(problem, rtol=0.3)
    assert found.ended == "estimated"
    assert not found.reached
    assert found.distance.relative <= 0.3
    assert "not guaranteed" in found.remedy
    assert not found.record()["guaranteed"]
    assert "the gap of contact" in found.record()["reasons"][0]


def test_a_solve_that_does_not_converge_ends_it() -> None:
    found = solve_adaptive(survey("5.1", 4), rtol=1e-3, controls=hv.Controls(max_steps=1))
    assert found.ended == "not converged"
    assert "max_steps" in found.remedy


def test_nothing_is_refined_where_nothing_happens() -> None:
    """Without loads the solution is zero, and so is its distance: it went on without end."""
    problem = replace(survey("5.1", 4), body_force=(0.0, 0.0), contact={"bottom": hv.Contact(hv.Compliance(2.0))})
    found = solve_adaptive(problem, max_unknowns=500)
    assert (found.ended, len(found.levels)) == ("reached", 1)
    assert (found.distance.distance, found.distance.relative) == (0.0, 0.0)
    assert found.rows()[0]["misfit"] == 0.0
    figure = found.plot()
    assert "(zero)" in figure.axes[0].get_legend().get_texts()[0].get_text()
    figure.canvas.draw()


def test_a_patch_that_is_exact_to_rounding_is_a_bound() -> None:
    """Misfit and what nodes lack are rounding both: neither makes it an estimate."""
    problem = bodies.square(
        hv.Compliance(1.0), 4, material=hv.Material.young(1.0, 0.0), tractions={"right": (1.0, 0.0)}
    )
    found = solve_adaptive(problem)
    assert found.reached
    assert found.distance.relative < 1e-12


@pytest.mark.parametrize("size", [1.0, 1e3])
def test_meshes_end_where_only_the_solves_err(size: float) -> None:
    """A body that is moved without strain: all that is left is rounding, and it went on to the last mesh that fits."""
    mesh = rectangle((size, size), 4, pattern="right")
    moved = hv.Prescribed((0.1 * size, 0.2 * size))
    found = solve_adaptive(bodies.body(mesh, supports={"left": moved}))
    assert (found.ended, len(found.levels)) == ("algebraic", 1)
    assert "without strain" in found.remedy
    assert found.distance.parts.algebraic > 0.01 * found.distance.energy_norm
    pulled = bodies.body(mesh, supports={"left": moved}, body_force=(0.0, 1e-3 / size))
    assert solve_adaptive(pulled, rtol=0.2).ended == "reached"


@pytest.mark.parametrize(("limit", "meshes"), [(4.9, 1), (5.1, 2)])
def test_the_next_mesh_is_predicted_to_take_longer_as_it_has_more_cells(
    limit: float, meshes: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By a clock on which the first mesh takes a second: the next one, with four times as many cells, takes four."""

    class Clock:
        def __init__(self) -> None:
            self.seconds = 0.0

        def perf_counter(self) -> float:
            return self.seconds

    clock, solved = Clock(), hv.solve

    def solve(*given: object, **options: object) -> hv.Solution:
        clock.seconds += 1.0
        return solved(*given, **options)  # type: ignore[arg-type]

    monkeypatch.setattr(loop, "time", clock)
    monkeypatch.setattr(loop, "solve", solve)
    problem = replace(survey("5.1", 4), contact={"bottom": hv.Contact(hv.Compliance(10.0))})
    run = solve_adaptive(problem, rtol=1e-6, share=1.0, max_time=limit)
    assert all(len(level.distance.cells) == 4 * len(run.levels[0].distance.cells) for level in run.levels[1:])
    assert len(run.levels) == meshes
    assert run.ended == "max_time"
