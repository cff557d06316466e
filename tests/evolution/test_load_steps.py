"""Load steps: each begins with the friction history of the one before."""

from __future__ import annotations

import pickle
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hemivar as hv
from hemivar.basics.types import Array
from hemivar.errors import ProblemError
from hemivar.mechanics import Step

YOUNG, FRICTION, LENGTH, PULL = 70000.0, 2.0, 100.0, 120.0


def sheet(cells: int, length: float = 1.0, stress: float = 1.0, **more: Any) -> hv.ContactProblem:
    """A strip that lies on a table, which resists each of its parts by at most the same force, pulled at one end."""
    steps = [
        Step(name, tractions={"right": (part * PULL * stress, 0.0)})
        for name, part in (("pull", 1.0), ("release", 0.0), ("again", 0.5))
    ]
    given: dict[str, Any] = {
        "mesh": hv.rectangle((LENGTH * length, 10.0 * length), (cells, 1)),
        "material": hv.Material.young(YOUNG * stress, 0.0),
        "contact": {"area": hv.Contact(hv.laws.NoContact(), hv.Tresca(FRICTION * stress / length))},
        "supports": {"bottom": "roller", "top": "roller"},
        "steps": steps,
    }
    return hv.ContactProblem(**given | more)


def forces_at_ends(problem: hv.ContactProblem, **options: Any) -> Array:
    """How far the pulled end is after each step."""
    history = hv.march(hv.Evolution(problem), **options)
    assert history.finished
    assert len(history.steps) == len(history.frames)
    far = int(np.argmax(problem.mesh.points[:, 0]))
    return np.array([frame.displacement[far, 0] for frame in history.frames])


def test_a_strip_that_is_pulled_and_released_keeps_half_of_its_way() -> None:
    """In closed form: under the stress s the end goes s^2 / (2 E g), g being what resists; each change ds that turns
    round takes it ds^2 / (4 E g) back."""
    first, change = PULL**2 / (2.0 * YOUNG * FRICTION), PULL**2 / (4.0 * YOUNG * FRICTION)
    exact = np.array([first, first - change, first - change + 0.25 * change])
    errors = [np.abs(forces_at_ends(sheet(cells)) / exact - 1.0).max() for cells in (50, 200)]
    assert errors[1] < 7e-4
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.1)
    whole = hv.solve(sheet(50).at_time(2.0)).displacement  # alone, it knows of no pull
    assert np.abs(whole).max() <= 1e-12 * first


def test_load_steps_do_not_depend_on_units() -> None:
    assert forces_at_ends(sheet(30, 1e-3, 1e6)) == pytest.approx(1e-3 * forces_at_ends(sheet(30)), rel=1e-9)


def test_increments_of_a_step_end_where_one_does_if_all_slide_one_way() -> None:
    assert forces_at_ends(sheet(30), step=0.25)[::4] == pytest.approx(forces_at_ends(sheet(30)), rel=1e-9)


def test_steps_are_the_same_as_loads_that_are_formulas_of_t() -> None:
    path = f"{PULL} * (1 - max(0, t - 1) + 1.5 * max(0, t - 2))"
    timed = sheet(30, steps=(), tractions={"right": (path, 0.0)})
    history = hv.march(hv.Evolution(timed, start=1.0), until=3.0, step=1.0)
    steps = hv.march(hv.Evolution(sheet(30)))
    for one, other in zip(steps.frames, history.frames, strict=True):
        assert np.abs(one.displacement - other.displacement).max() <= 1e-12 * np.abs(other.displacement).max()


def plates(dim: int, unit: float = 1.0, **more: Any) -> hv.ContactProblem:
    """A soft plate on a stiff one, pressed together first; then pulled by 43 % of what friction can bear."""
    size = (8.0 * unit, unit) if dim == 2 else (4.0 * unit, 2.0 * unit, unit)
    cells, up = ((16, 2), (0.0, unit)) if dim == 2 else ((6, 3, 2), (0.0, 0.0, unit))
    mesh_of: Any = hv.rectangle if dim == 2 else hv.box
    mesh = hv.Mesh.assembled({"upper": mesh_of(size, cells, origin=up), "lower": mesh_of(size, cells)})
    materials = {"upper": hv.Material.young(2e3 / unit**2, 0.45), "lower": hv.Material.young(2e5 / unit**2, 0.3)}
    press, side = 10.0 / unit**2, (0.0,) * (dim - 2)
    given: dict[str, Any] = {
        "mesh": mesh,
        "material": hv.Material.by_region(materials),
        "contact": {"upper:bottom": hv.Contact(hv.Signorini(), hv.Coulomb(0.1), against="lower:top")},
        "supports": {"lower:bottom": "clamped"},
        "steps": [
            Step("clamp", tractions={"upper:top": (0.0, *side, -press)}),
            Step("pull", tractions={"upper:top": (0.043 * press, *side, -press)}),
        ],
    }
    return hv.ContactProblem(**given | more)


def slipping(local: Array, multiplier: Array) -> Array:
    return np.asarray(np.linalg.norm(multiplier[:, 1:], axis=1) >= 0.1 * multiplier[:, 0] * (1.0 - 1e-9))


@pytest.mark.parametrize("dim", [2, 3])
def test_plates_that_are_clamped_first_do_not_slip_everywhere_when_they_are_pulled(dim: int) -> None:
    problem = plates(dim)
    history = hv.march(hv.Evolution(problem))
    clamped, pulled = history.frames
    count = len(clamped.local)
    assert slipping(clamped.local, clamped.multiplier).sum() >= count - 1  # the soft plate spreads
    assert slipping(pulled.local, pulled.multiplier).sum() <= 0.65 * count
    at_once = hv.solve(problem.at_time(2.0))
    assert (at_once.states.codes == 2).sum() >= count - 1
    row = history.steps[-1].values
    assert row["normal_force"] == pytest.approx(80.0, rel=1e-8)
    weights = history.discrete.problem.contact.weights
    assert np.linalg.norm(weights @ pulled.multiplier[:, 1:]) == pytest.approx(0.043 * 80.0, rel=1e-8)
    small = hv.march(hv.Evolution(plates(dim, 1e-3)))
    for one, other in zip(history.frames, small.frames, strict=True):
        assert np.abs(one.displacement - 1e3 * other.displacement).max() <= 1e-9 * np.abs(one.displacement).max()


def test_the_row_of_the_first_step_says_how_it_was_solved() -> None:
    history = hv.march(hv.Evolution(sheet(20)))
    alone = hv.solve(sheet(20).at_time(1.0))
    assert np.abs(history.frames[0].displacement - alone.displacement).max() <= 1e-9 * np.abs(alone.displacement).max()
    assert history.steps[0].residual > 0.0
    assert history.steps[0].solver_steps > 0
    assert history.steps[0].margin > 0.0
    assert len(history.taken) == 3
    assert history.to_dict()["steps"] == 3


def test_supports_and_initial_stress_change_from_step_to_step() -> None:
    """A block between rollers whose top is let down and whose stress is there already, without friction."""
    young, down, stress = 10.0, 0.1, -2.0
    problem = hv.ContactProblem(
        hv.rectangle((1.0, 1.0), 4), hv.Material.young(young, 0.0), {"bottom": hv.Contact(hv.Compliance(40.0))},
        {"left": "roller", "right": "roller", "top": hv.Fixed(y=0.0)},
        steps=[
            Step("down", supports={"top": hv.Fixed(y=-down)}),
            Step("stress", initial_stress=stress),
            Step("up", supports={"top": hv.Fixed(y=0.0)}, ramp=False),
        ],
    )  # fmt: skip
    history = hv.march(hv.Evolution(problem), step=0.5)
    # springs in series: young (down - s) - stress = 40 s for the way s of the bottom
    pressed = [40.0 * (young * d - s0) / (40.0 + young) for d, s0 in ((down, 0.0), (down, stress), (0.0, stress))]
    force = history["normal_force"]
    assert force[[0, 2, 4]] == pytest.approx(pressed, rel=1e-8)
    assert force[1] == pytest.approx(0.5 * (pressed[0] + pressed[1]), rel=1e-8)  # it grows evenly
    assert force[3] == pytest.approx(pressed[2], rel=1e-8)  # it jumps


def test_steps_may_begin_with_an_interference_fit() -> None:
    """A block that is pressed against its foundation by its height alone, then lifted by half of that."""
    problem = hv.ContactProblem(
        hv.rectangle((1.0, 1.0), 4), hv.Material.young(10.0, 0.0),
        {"bottom": hv.Contact(hv.Signorini(), hv.Coulomb(0.3), gap=-0.01)},
        {"left": "roller", "right": "roller", "top": hv.Fixed(y=0.0)},
        steps=[Step("fit"), Step("lift", supports={"top": hv.Fixed(y=0.005)})],
    )  # fmt: skip
    history = hv.march(hv.Evolution(problem))
    assert history["normal_force"] == pytest.approx([0.1, 0.05], rel=1e-9)
    assert np.isfinite([row.values["elastic"] for row in history.steps]).all()


def test_a_march_through_steps_goes_on_from_a_checkpoint(tmp_path: Path) -> None:
    evolution = hv.Evolution(sheet(20))
    kept = tmp_path / "steps.ckpt"
    first = hv.march(evolution, 2.0, checkpoint=kept)
    assert first.times.tolist() == [1.0, 2.0]
    rest = hv.march(evolution, checkpoint=kept, resume=True)
    whole = hv.march(evolution)
    assert rest.times.tolist() == [1.0, 2.0, 3.0]
    assert np.array_equal(rest.frames[-1].displacement, whole.frames[-1].displacement)


def test_a_problem_with_steps_is_pickled_and_put_on_another_mesh() -> None:
    problem = sheet(20)
    again = pickle.loads(pickle.dumps(problem))
    assert forces_at_ends(again) == pytest.approx(forces_at_ends(problem), rel=1e-12)
    assert forces_at_ends(problem.on(problem.mesh.refined())) == pytest.approx(forces_at_ends(problem), rel=1e-2)


def test_a_body_of_revolution_keeps_what_friction_held_when_it_is_let_go() -> None:
    """A disc that is pressed on a plane and spreads; friction keeps a part of the way when the sides push back."""
    problem = hv.ContactProblem(
        hv.rectangle((1.0, 0.2), (8, 2)), hv.Material.young(100.0, 0.3, plane="axisymmetric"),
        {"bottom": hv.Contact(hv.Signorini(), hv.Coulomb(0.2))}, {"left": "roller"},
        steps=[
            Step("press", tractions={"top": hv.Pressure(1.0)}),
            Step("squeeze", tractions={"right": hv.Pressure(0.05)}),
        ],
    )  # fmt: skip
    history = hv.march(hv.Evolution(problem))
    pressed, squeezed = history.frames
    bound = 0.2 * squeezed.multiplier[:, 0]
    inside = np.abs(squeezed.multiplier[:, 1]) < bound * (1.0 - 1e-9)
    assert inside[1:].any()
    assert pressed.local[inside, 1] == pytest.approx(squeezed.local[inside, 1], abs=1e-12)


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ({"steps": [Step("one")]}, "a single step is a static problem"),
        ({"steps": [Step("one"), Step("one")]}, "two steps are called 'one'"),
        ({"steps": [Step("one"), "two"]}, "a step is the text 'two'|a step is 'two'"),
        (
            {"steps": [Step("one"), Step("two", supports={"left": hv.Clamped()})]},
            "step 'two' supports 'left', which the problem does not",
        ),
        (
            {"steps": [Step("one"), Step("two", tractions={"lid": (1.0, 0.0)})]},
            "step 'two': tractions names boundary 'lid', which the mesh does not have",
        ),
        (
            {"steps": [Step("one", tractions={"top": (1.0, 0.0)}), Step("two", tractions={"top": hv.Pressure(1)})]},
            r"step 'two': tractions\['top'\] prescribes something else than before",
        ),
        ({"body_force": ("t", 0.0)}, "something depends on t beside the steps"),
        (
            {"steps": [Step("one", initial_stress=np.eye(2)), Step("two", initial_stress=1.0)]},
            "step 'two': initial_stress has another form than before",
        ),
    ],
)  # fmt: skip
def test_steps_that_make_no_sense_are_refused(more: dict[str, Any], words: str) -> None:
    with pytest.raises(ProblemError, match=words):
        sheet(4, **more)


def test_what_has_no_steps_refuses_them_before_any_work() -> None:
    problem = sheet(4)
    words = "the problem has 3 load steps, and this is for one"
    for work in (hv.solve, hv.discretize):
        with pytest.raises(ProblemError, match=words):
            work(problem)
    with pytest.raises(ProblemError, match="load steps have no duration, which mass or viscosity needs"):
        hv.Evolution(replace(problem, material=hv.Material.young(1.0, 0.0, density=1.0)), inertia=True)
    with pytest.raises(ProblemError, match="there are 3 load steps, and until is 4"):
        hv.march(hv.Evolution(problem), 4.0)
    with pytest.raises(ProblemError, match="until is missing"):
        hv.march(hv.Evolution(sheet(4, steps=())))
    with pytest.raises(ProblemError, match="steps of the scheme midpoint end in none; take implicit-euler"):
        hv.march(hv.Evolution(problem), scheme="midpoint")
    with pytest.raises(ProblemError, match="control finds the load, and load steps state it"):
        hv.march(hv.Evolution(problem), control="dissipation")
