"""Marches whose load factor is unknown: through the peak and the snap-back of dead-loaded joints."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import hemivar as hv
from hemivar.basics.types import Array
from hemivar.errors import ProblemError
from hemivar.evolution import AdaptiveStep, Checkpoint, Evolution, History, Save, march
from hemivar.mesh import rectangle
from tests import bodies

TIGHT = hv.Controls(rtol=1e-12)
#: Stiffness 24, strength 2.4 at the opening 0.1; the column above it is a spring of 12.
STIFF, STRENGTH, FIRST, SPRING = 24.0, 2.4, 0.1, 12.0


def lifted(x: Array, t: float) -> Array:
    return np.tile([0.0, t], (len(x), 1))


def glued_column(fall: float, load: object = lifted) -> hv.ContactProblem:
    """A column on glue that softens by ``fall``, pulled at its free top by a dead load of t."""
    contact = hv.Contact(hv.Adhesive(STIFF, STRENGTH, fall, 72.0))
    return bodies.column(contact, stiffness=SPRING, top=None, tractions={"top": load})  # type: ignore[dict-item]


def followed(fall: float, until: float, step: float, control: object, **more: object) -> History:
    options = {"save": Save(probes={"top": (0.5, 1.0)}), "controls": TIGHT} | more
    problem = options.pop("problem", None) or glued_column(fall)
    return march(Evolution(problem), until, step=step, control=control, **options)  # type: ignore[arg-type]


def check_the_way(history: History, fall: float) -> Array:
    """Each row lies on the curve of the glue, above it the spring, and has lost what a triangle of the law is."""
    opening = np.array([-frame.local[0, 0] for frame in history.frames])
    last = FIRST + STRENGTH / fall
    carried = np.where(opening <= FIRST, STIFF * opening, np.maximum(fall * (last - opening), 0.0))
    lost = 0.5 * STRENGTH * (np.clip(opening, FIRST, last) - FIRST) / (last - FIRST) * last
    loads = history["load_factor"]
    np.testing.assert_allclose(loads, carried, atol=1e-12)
    np.testing.assert_allclose(history["top.u_y"], opening + loads / SPRING, atol=1e-12)
    np.testing.assert_allclose(history["memory"], lost, atol=1e-12)
    return loads


@pytest.mark.parametrize("fall", [6.0, 36.0])
@pytest.mark.parametrize("control", ["dissipation", {"opening": "bottom"}])
def test_a_dead_load_on_a_spring_is_followed_until_the_glue_has_broken(fall: float, control: object) -> None:
    """With a fall of 36 beside a spring of 12 the end of the spring goes back while the glue opens: a snap-back."""
    by_opening = control != "dissipation"
    until, step = (FIRST + STRENGTH / fall + 0.1, 0.01) if by_opening else (6.0, 0.1)
    history = followed(fall, until, step, control)
    assert history.ended == "broken"
    assert history.messages[-1].startswith("broken at t = ")
    loads = check_the_way(history, fall)
    assert loads.max() == pytest.approx(STRENGTH, rel=1e-12)
    assert loads[-1] <= 0.01 * STRENGTH
    assert history["memory"][-1] == pytest.approx(0.5 * STRENGTH * (FIRST + STRENGTH / fall), rel=0.01)
    back = np.diff(history["top.u_y"][:-1]) < 0.0
    assert back.any() == (fall > SPRING)
    assert not history["jumped"].any()


@pytest.mark.parametrize("fall", [6.0, 36.0])
@pytest.mark.parametrize("step", [0.27, 0.7, 1.1])
def test_steps_that_do_not_meet_the_peak_lead_over_it(fall: float, step: float) -> None:
    history = followed(fall, 4.0, step, "dissipation")
    assert history.ended == "finished"
    loads = check_the_way(history, fall)
    assert STRENGTH - step < loads.max() <= STRENGTH
    assert loads[-1] < 0.75 * STRENGTH


@pytest.mark.parametrize(("fall", "dissipates"), [(1.0, 0.3), (6.0, 0.25), (36.0, 1.0 / 12.0)])
def test_while_nothing_dissipates_time_is_the_load_factor_and_then_energy_or_a_load_that_falls(
    fall: float, dissipates: float
) -> None:
    """At the rate 2 E/factor of the peak, E the energy of spring and glue: 2.4 (1/24 + 1/12) = 0.3.

    Or as the load falls with the time, where that is less: of the energy 2.4 (0.1 + 2.4/fall)/2 that part.
    """
    history = followed(fall, 4.0, 0.1, "dissipation")
    times, loads = history.times, history["load_factor"]
    elastic = times <= STRENGTH * (1.0 + 1e-9)
    np.testing.assert_allclose(loads[elastic], times[elastic], atol=1e-12)
    energy = 0.5 * STRENGTH * (FIRST + STRENGTH / fall)
    assert min(0.3, energy / STRENGTH) == pytest.approx(dissipates)
    np.testing.assert_allclose(history["memory"][~elastic], dissipates * (times[~elastic] - STRENGTH), rtol=1e-9)


def test_the_load_factor_of_a_moved_support_may_fall_as_well() -> None:
    """The same column, its top moved by t: with a fall of 36 no time leads on where the spring has to go back."""
    held = hv.Fixed(y=lambda x, t: np.full(len(x), t))
    contact = hv.Contact(hv.Adhesive(STIFF, STRENGTH, 36.0, 72.0))
    moved = Evolution(bodies.column(contact, stiffness=SPRING, top=held))
    history = march(moved, 0.8, step=0.02, control="dissipation", controls=TIGHT)
    assert history.ended == "broken"
    opening = np.array([-frame.local[0, 0] for frame in history.frames])
    carried = np.where(opening <= FIRST, STIFF * opening, 36.0 * (FIRST + STRENGTH / 36.0 - opening).clip(0.0))
    np.testing.assert_allclose(history["load_factor"], opening + carried / SPRING, atol=1e-11)
    assert (np.diff(history["load_factor"]) < -1e-6).sum() > 2


def in_units(force: float, length: float, slope: float = 1.0, first: float = 0.0) -> hv.ContactProblem:
    """The column with a fall of 6, its strength 2.4 and size 1 in other units, under ``first + slope t``."""
    compared = force / length
    glue = hv.Adhesive(STIFF * compared, STRENGTH * force, 6.0 * compared, 72.0 * compared)
    return bodies.column(
        hv.Contact(glue), stiffness=SPRING * force, size=(length, length), top=None,
        tractions={"top": lambda x, t: np.tile([0.0, force * (first + slope * t)], (len(x), 1))},
    )  # fmt: skip


@pytest.mark.parametrize("units", [(1e6, 1.0), (1e6, 1e-3), (1e9, 1e-6), (1.0, 1e3)])
def test_units_do_not_matter(units: tuple[float, float]) -> None:
    """In Pa, mm and micrometres instead of MPa and m: the same factors, to rounding."""
    found = [march(Evolution(in_units(*one)), 3.0, step=0.1, control="dissipation") for one in ((1.0, 1.0), units)]
    assert [one.ended for one in found] == ["finished", "finished"]
    np.testing.assert_allclose(found[0]["load_factor"], found[1]["load_factor"], rtol=1e-8, atol=1e-10)


@pytest.mark.parametrize("first", [1.0, -1.0])
@pytest.mark.parametrize(
    ("control", "until", "step"), [("dissipation", 7.0, 0.1), ({"opening": "bottom"}, 0.9, 0.07 / 0.24)]
)
def test_glue_is_broken_where_it_carries_nothing_not_where_the_load_factor_is_that_of_the_start(
    first: float, control: object, until: float, step: float
) -> None:
    """Under 1 + t glue still carries 1 where the load factor has come back to 0."""
    history = followed(6.0, until, step, control, problem=in_units(1.0, 1.0, first=first))
    opening = np.array([-frame.local[0, 0] for frame in history.frames])
    carried = np.where(opening <= FIRST, STIFF * opening, 6.0 * (0.5 - opening).clip(0.0))
    carried[opening < 0.0] *= 72.0 / STIFF
    assert history.ended == "broken"
    np.testing.assert_allclose(history["load_factor"] + first, carried, atol=1e-11)
    assert carried[-1] <= 0.01 * STRENGTH < carried[-2]


@pytest.mark.parametrize("units", [(1.0, 1.0, 1e-6), (1e6, 1e-3, 1e-6), (1e9, 1e-6, 1e-9), (1e6, 1e-3, 1e6)])
def test_an_opening_that_is_given_has_another_unit_than_the_load_factor(units: tuple[float, float, float]) -> None:
    """Loads of t in Pa beside openings in m: nothing depends on how the numbers compare."""
    force, length, slope = units
    history = march(
        Evolution(in_units(force, length, slope)), 0.6 * length, step=0.05 * length, control={"opening": "bottom"}
    )
    opening = np.array([-frame.local[0, 0] for frame in history.frames]) / length
    carried = np.where(opening <= FIRST, STIFF * opening, 6.0 * (0.5 - opening).clip(0.0))
    assert history.ended == "broken"
    np.testing.assert_allclose(history["load_factor"] * slope, carried, atol=1e-10)
    np.testing.assert_allclose(opening, history.times / length, atol=1e-10)


def lifted_aside(fall: float, force: float = 1.0, length: float = 1.0, side: str = "right") -> hv.ContactProblem:
    """A body on glue, lifted at one side."""
    compared = force / length
    contact = hv.Contact(hv.Adhesive(STIFF * compared, STRENGTH * force, fall * compared, 72.0 * compared))
    return hv.ContactProblem(
        rectangle((2.0 * length, 0.5 * length), (4, 2)), hv.Material.lame(40.0 * force, 40.0 * force),
        {"bottom": contact}, {"left" if side == "right" else "right": hv.Roller()},
        tractions={side: lambda x, t: np.tile([0.0, force * t], (len(x), 1))},
    )  # fmt: skip


@pytest.mark.parametrize("other", [{"side": "left"}, {"force": 1e6, "length": 1e-3}])
def test_a_boundary_opens_as_the_load_grows_wherever_it_does(other: dict[str, object]) -> None:
    """At the side that is lifted: neither the order of points nor units choose the sign of the load."""
    found = []
    for given in ({}, other):
        body, length = lifted_aside(36.0, **given), given.get("length", 1.0)  # type: ignore[arg-type]
        found.append(
            march(Evolution(body), 0.12 * length, step=0.04 * length, control={"opening": "bottom"})  # type: ignore[operator]
        )
    factors = [history["load_factor"] for history in found]
    assert (factors[0][1:] > 0.5).all()
    np.testing.assert_allclose(factors[1], factors[0], rtol=0.05 if "side" in other else 1e-8)


def test_a_load_that_closes_the_boundary_whose_opening_is_given_is_refused() -> None:
    pressed = Evolution(glued_column(6.0, lambda x, t: lifted(x, -t)))
    with pytest.raises(ProblemError, match="needs loads that open 'bottom' as t grows"):
        march(pressed, 0.3, step=0.02, control={"opening": "bottom"})


def waving(x: Array, t: float) -> Array:
    return lifted(x, t + 0.3 * np.sin(2.0 * np.pi * t))


def test_a_load_that_bends_between_or_beyond_the_times_looked_at_is_refused() -> None:
    with pytest.raises(ProblemError, match="bends over t, at t = "):
        march(Evolution(glued_column(6.0, waving)), 1.0, step=0.1, control="dissipation")
    capped = glued_column(6.0, lambda x, t: lifted(x, min(t, 0.5)))
    history = march(Evolution(capped), 0.3, step=0.02, control={"opening": "bottom"})
    assert history.ended == "refused"
    assert "bends over t, at t = 0.96" in history.messages[-1]
    np.testing.assert_allclose(history["load_factor"], [0.0, 0.48], rtol=1e-12)


def test_a_march_that_goes_on_from_its_checkpoint_is_the_same(tmp_path: Path) -> None:
    kept = {"checkpoint": Checkpoint(tmp_path / "run.ckpt", 0.0)}
    whole = followed(36.0, 3.0, 0.1, "dissipation")
    followed(36.0, 3.0, 0.1, "dissipation", max_time=0.05, **kept)
    again = followed(36.0, 3.0, 0.1, "dissipation", resume=True, **kept)
    for name in whole.columns:
        np.testing.assert_array_equal(again[name], whole[name])


@pytest.mark.parametrize("fall", [36.0, 200.0])
def test_brittle_glue_that_is_whole_does_not_count_as_broken(fall: float) -> None:
    """A body lifted at one side: where its way is lost the march says so, and no step falls back to the start."""
    history = march(Evolution(lifted_aside(fall)), 6.0, step=0.1, control="dissipation")
    energy = 2.0 * 0.5 * STRENGTH * (FIRST + STRENGTH / fall)
    assert history["load_factor"].max() > 2.0
    assert history.ended != "broken" or history["memory"][-1] > 0.98 * energy
    assert np.diff(history["load_factor"]).min() >= -0.11 * (1.0 + 1e-9)


def plain(**more: object) -> hv.ContactProblem:
    contact = hv.Contact(hv.Adhesive(STIFF, STRENGTH, 6.0, 72.0))
    return bodies.column(contact, top=None, tractions={"top": lifted}, **more)  # type: ignore[arg-type]


CASES = {
    "mass": (lambda: Evolution(plain(density=1.0), inertia=True), {}, "has mass"),
    "viscosity": (lambda: Evolution(plain(viscosity=(1.0, 1.0))), {}, "has viscosity"),
    "branches": (
        lambda: Evolution(plain(branches=[hv.materials.Branch(lame=(1.0, 1.0), time=0.5)])),
        {}, "branches of this one relax",
    ),
    "heat": (lambda: Evolution(plain(), heat=hv.mechanics.Heat(1.0, 1.0)), {}, "has heat"),
    "scheme": (lambda: Evolution(plain()), {"scheme": "sdirk2"}, "goes with the scheme implicit-euler"),
    "adaptive": (lambda: Evolution(plain()), {"step": AdaptiveStep(1e-3)}, "give a length of steps"),
    "jump": (lambda: Evolution(plain()), {"jump": "arc-length"}, "jump = 'arc-length' would choose one"),
    "bent": (lambda: Evolution(glued_column(6.0, lambda x, t: np.tile([0.0, t * t], (len(x), 1)))), {}, "bends over t"),
    "constant": (lambda: Evolution(glued_column(6.0, (0.0, 1.0))), {}, "grows with t"),
    "damping": (
        lambda: Evolution(bodies.column(
            hv.Contact(hv.Compliance(1.0), damping=hv.Compliance(1.0)), top=None, tractions={"top": lifted}
        )),
        {}, "has a damping",
    ),
    "healing": (
        lambda: Evolution(bodies.column(
            hv.Contact(hv.Adhesive(STIFF, STRENGTH, 6.0, 72.0), memory=()), top=None, tractions={"top": lifted}
        )),
        {}, "nothing dissipates",
    ),
    "boundary": (lambda: Evolution(plain()), {"control": {"opening": "tip"}}, "tip"),
    "word": (lambda: Evolution(plain()), {"control": "disipation"}, "give 'dissipation', or"),
    "mapping": (lambda: Evolution(plain()), {"control": {"slip": "bottom"}}, "give 'dissipation', or"),
}  # fmt: skip


@pytest.mark.parametrize("case", CASES)
def test_what_does_not_go_with_an_unknown_load_factor_is_refused_in_a_sentence(case: str) -> None:
    made, more, said = CASES[case]
    with pytest.raises(ProblemError, match=said):
        march(made(), 1.0, **{"step": 0.1, "control": "dissipation"} | more)  # type: ignore[arg-type]
