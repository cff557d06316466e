"""The march: events, restarts, rejected steps, bounds of the error in time, refusals."""

from __future__ import annotations

import dataclasses
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hemivar as hv
from hemivar.basics.types import Array
from hemivar.errors import FileError, ProblemError
from hemivar.evolution import Evolution, History, March, Save, Scheme, Touch, When, march
from hemivar.evolution.discrete import discretize_evolution
from hemivar.evolution.initial import initial_state
from hemivar.evolution.march import marching
from hemivar.evolution.stepper import TimeStepper
from hemivar.formula import Formula, FormulaArray
from hemivar.solvers import Controls
from tests import bodies
from tests.evolution.messages import said_of
from tests.samples import slow


def beam(inertia: bool = True, load: float = -0.5, **contact: Any) -> Evolution:
    """A clamped body above a foundation, with viscosity and a branch."""
    material = hv.Material.lame(
        4,
        4,
        density=1.0,
        viscosity=(0.4, 0.4),
        branches=[hv.materials.Branch(lame=(2, 2), time=0.5)] if inertia else (),
    )
    given = {"normal": hv.Compliance(20.0), "friction": hv.Tresca(0.05), "gap": 0.02} | contact
    problem = bodies.strip(hv.Contact(**given), (6, 3), material=material, body_force=(0.0, load))
    return Evolution(problem, inertia=inertia)


@pytest.mark.parametrize(
    ("scheme", "step"),
    [
        (hv.evolution.ImplicitEuler(), hv.evolution.AdaptiveStep(3e-3)),
        (hv.evolution.GeneralizedAlpha(0.8), 0.05),
        slow(hv.evolution.ImplicitEuler(), 0.05),
        slow(hv.evolution.GeneralizedAlpha(0.8), hv.evolution.AdaptiveStep(3e-3)),
    ],
    ids=lambda value: getattr(value, "name", None),
)
def test_a_march_goes_on_as_if_it_had_never_stopped(tmp_path: Path, scheme: Scheme, step: Any) -> None:
    options: dict[str, Any] = {"scheme": scheme, "step": step, "events": [Touch()], "save": Save(0.2)}
    whole = march(beam(), 0.6, **options)
    kept = hv.evolution.Checkpoint(tmp_path / "run.ckpt", 0.0)
    begun = marching(beam(), March(0.6, checkpoint=kept, **options))
    for _ in range(5):
        next(begun)
    begun.close()
    resumed = march(beam(), 0.6, checkpoint=kept, resume=True, **options)
    assert resumed.events == whole.events
    assert len(whole.events) == 1
    for name in whole.columns:
        np.testing.assert_array_equal(resumed[name], whole[name], err_msg=name)
    np.testing.assert_array_equal(resumed.state.body.displacement, whole.state.body.displacement)
    assert [frame.time for frame in resumed.frames] == [frame.time for frame in whole.frames]
    with pytest.raises(FileError, match="another evolution"):
        march(beam(load=-0.6), 0.6, checkpoint=kept, resume=True, **options)
    with pytest.raises(FileError, match="another method;"):
        march(beam(), 0.6, checkpoint=kept, resume=True, method=hv.solvers.NonsmoothMultigrid(), **options)
    kept.file.write_bytes(b"not a checkpoint")
    with pytest.raises(FileError, match="not a checkpoint"):
        march(beam(), 0.6, checkpoint=kept, resume=True, **options)


def test_residuals_of_a_body_at_rest_are_held_against_what_acts() -> None:
    """It creeps to rest under its weight: nothing is left of the load then, and all is in balance."""
    problem = bodies.strip(
        hv.Contact(hv.Compliance(1e4), gap=1e-3),
        (6, 3),
        size=(1.0, 0.5),
        lame=(100.0, 100.0),
        viscosity=(1.0, 1.0),
        supports={"top": hv.Clamped()},
        body_force=(0.0, -1.0),
    )
    history = march(Evolution(problem), 2.0, step=0.05)
    assert history["residual"].max() <= 1e-9


def test_a_checkpoint_beyond_the_end_is_told(tmp_path: Path) -> None:
    """What it holds is returned, with a word of it, which later marches do not repeat."""
    kept = tmp_path / "run.ckpt"
    march(beam(), 0.2, step=0.05, checkpoint=kept)
    early = march(beam(), 0.1, step=0.05, checkpoint=kept, resume=True)
    assert early.times[-1] == 0.2
    assert "the checkpoint is at t = 0.2, beyond the end at 0.1" in early.messages[-1]
    assert said_of(march(beam(), 0.3, step=0.05, checkpoint=kept, resume=True)) == ()


def test_a_rejected_step_leaves_no_trace() -> None:
    discrete = discretize_evolution(beam())
    advance = TimeStepper.of(discrete, hv.evolution.GeneralizedAlpha(0.8), None, Controls())
    state = initial_state(advance)
    first = advance.take(state, 0.1).state
    for step in (0.4, 0.05, 0.013):
        advance.take(state, step)
    again = advance.take(state, 0.1).state
    np.testing.assert_array_equal(again.body.displacement, first.body.displacement)
    np.testing.assert_array_equal(again.multiplier, first.multiplier)
    assert again.ledger == first.ledger


def test_a_falling_block_touches_when_it_should() -> None:
    """A block falls freely by the gap 0.05: t = sqrt(0.1)."""
    contact = hv.Contact(hv.Compliance(400.0), gap=0.05)
    problem = bodies.square(contact, 2, lame=(400.0, 400.0), density=1.0, supports={}, body_force=(0.0, -1.0))
    half = When(function=lambda discrete, state: state.time - 0.123, label="half way")
    stop = Touch("stop")
    history = march(
        Evolution(problem, inertia=True), 1.0, step=0.03, scheme=hv.evolution.Midpoint(), events=[half, stop]
    )
    assert history.ended == "event: touch"
    (first, name), (touched, _) = history.events
    assert (name, first) == ("half way", pytest.approx(0.123, abs=1e-7))
    assert touched == pytest.approx(np.sqrt(0.1), abs=1e-7)
    assert history.state.time == touched


def test_bounds_of_the_error_in_time_hold() -> None:
    """Against a run with steps 40 times shorter, at every time that both have; laws of the rate, and of the place."""
    rng = np.random.default_rng(7)
    for case in range(4):
        bound, load = 0.02 + 0.2 * rng.random(), -0.2 - rng.random()
        if case % 2:
            evolution = beam(False, load, normal=hv.laws.Bilateral(), friction=hv.Tresca(bound), gap=0.0)
            norm = "stiffness"
        else:
            evolution = beam(
                False, load, friction=hv.laws.NoFriction(), normal=hv.laws.ThresholdCompliance(0.1 * bound)
            )
            norm = "viscosity"
        coarse = march(evolution, 0.4, step=0.1, save=Save(0.1))
        fine = march(evolution, 0.4, step=0.1 / 40, save=Save(0.1))
        assert coarse.time_error.norm == norm, coarse.time_error.why
        operator = getattr(coarse.discrete, norm)
        largest = 0.0
        for one, other in zip(coarse.frames, fine.frames, strict=True):
            assert one.time == pytest.approx(other.time)
            off = coarse.discrete.restrict(one.displacement - other.displacement, np.zeros(0))
            largest = max(largest, np.sqrt(2.0 * operator.energy(off)))
        assert largest <= coarse["time_error"].max()
        assert largest > 1e-3 * coarse["time_error"].max()  # no empty claim either
        assert march(evolution, 0.4, step=0.05).time_error.bound < 0.75 * coarse.time_error.bound


REFUSED: dict[str, tuple[Any, str]] = {
    "inertia without density": (
        lambda: Evolution(_static(), inertia=True),
        "density",
    ),
    "velocity without inertia": (lambda: Evolution(_static(), velocity=(0.0, 1.0)), "no inertia"),
    "no problem": (lambda: Evolution("block.toml"), "ContactProblem"),  # type: ignore[arg-type]
    "velocity of the wrong size": (lambda: Evolution(beam().problem, inertia=True, velocity=(1.0,)), "shape"),
    "infinite start": (lambda: Evolution(_static(), start=np.inf), "finite"),
    "unknown mass": (lambda: Evolution(_static(), mass="lumped"), "consistent"),  # type: ignore[arg-type]
    "until before the start": (lambda: march(_moving(), -1.0), "later"),
    "a probe without a name": (
        lambda: hv.evolution.Save(probes={"": (1.0, 0.0)}),
        "a name of probes is ''; give one that the columns",
    ),
    "no step": (lambda: march(_moving(), 1.0, step=0.0), "positive"),
    "a step longer than all": (lambda: march(_moving(), 1.0, step=2.0), "longer"),
    "Newmark without mass": (lambda: march(_moving(), 1.0, scheme=hv.evolution.Newmark()), "bodies with mass"),
    "SDIRK2 with mass": (lambda: march(beam(), 1.0, scheme=hv.evolution.SDIRK2()), "without mass"),
    "Moreau-Jean on springs": (lambda: march(beam(), 1.0, scheme=hv.evolution.MoreauJean()), "rigid obstacles"),
    "unstable Newmark": (lambda: hv.evolution.Newmark(0.1, 0.5), "not stable"),
    "rho": (lambda: hv.evolution.GeneralizedAlpha(1.5), r"\[0, 1\]"),
    "impact with gain": (lambda: hv.evolution.MoreauJean(1.0, 0.8), "gain energy"),
    "scheme by name": (lambda: march(_moving(), 1.0, scheme="newmark"), "scheme"),
    "unknown jump": (lambda: march(_moving(), 1.0, jump="up"), "choose one of"),
    "event that is none": (lambda: march(_moving(), 1.0, events=["touch"]), "Touch"),
    "one event": (lambda: march(_moving(), 1.0, events=Touch()), "list"),
    "one stop": (lambda: march(_moving(), 1.0, stops=0.5), "list of times"),
    "no seconds": (lambda: march(_moving(), 1.0, max_time="3"), "seconds"),
    "seconds that are none": (lambda: march(_moving(), 1.0, max_time=np.nan), "seconds"),
    "probes without names": (lambda: Save(probes=[(0.0, 0.0)]), "names"),  # type: ignore[arg-type]
    "event without function": (lambda: When(), "needs a function"),
    "event that does nothing": (lambda: Touch("shout"), "record"),  # type: ignore[arg-type]
    "resume without file": (lambda: march(_moving(), 1.0, resume=True), "checkpoint"),
    "probe outside": (lambda: march(_moving(), 1.0, save=Save(probes={"p": (9.0, 9.0)})), "outside"),
    "probe in space": (lambda: march(_moving(), 1.0, save=Save(probes={"p": (0.0, 0.0, 0.0)})), "coordinates"),
    "save nothing": (lambda: Save(every=0.0), "time > 0"),
    "rtol": (lambda: hv.evolution.AdaptiveStep(2.0), "between 0 and 1"),
    "rtol below rounding": (lambda: hv.evolution.AdaptiveStep(1e-300), "take at least 1e-14"),
    "limits": (lambda: hv.evolution.AdaptiveStep(1e-3, least=1.0, most=0.1), "larger than"),
    "a body that nothing holds": (lambda: march(Evolution(_loose()), 1.0), "move|rigid|held|support"),
    "a contradiction": (
        lambda: march(Evolution(_static(), displacement=(0.0, 1.0)), 1.0),
        "contradicts",
    ),
}


def _static() -> hv.ContactProblem:
    from hemivar import gallery

    return gallery.survey("5.1", 4)


def _moving() -> Evolution:
    return beam(False)


def _loose() -> hv.ContactProblem:
    return bodies.square(hv.Compliance(1.0), 8, lame=(1, 1), viscosity=(1, 1), supports={}, body_force=(1.0, 0.0))


@pytest.mark.parametrize("case", REFUSED)
def test_what_cannot_be_is_refused_in_words(case: str) -> None:
    make, words = REFUSED[case]
    with pytest.raises(ProblemError, match=words):
        make()


def test_a_checkpoint_that_cannot_be_written_is_told_before_the_first_step(tmp_path: Path) -> None:
    for file in (tmp_path, tmp_path / "nowhere" / "run.ckpt"):
        steps = marching(beam(), March(0.2, step=0.1, checkpoint=hv.evolution.Checkpoint(file)))
        with pytest.raises(FileError, match="cannot write"):
            next(steps)
    assert not list(tmp_path.iterdir())


def test_interruption_and_time_leave_what_there_is() -> None:
    begun = marching(beam(), March(1.0, step=0.1))
    next(begun)
    with pytest.raises(StopIteration) as end:
        begun.send(True)
    history = end.value.value
    assert history.ended == "interrupted"
    assert history.state.time == pytest.approx(0.1)
    assert march(beam(), 1.0, step=0.1, max_time=0.0).ended == "max_time"


def test_frames_are_interpolated() -> None:
    history = march(beam(), 0.4, step=0.1)
    first, second = history.frames[1:3]
    middle: Array = 0.5 * (first.displacement + second.displacement)
    np.testing.assert_allclose(history.at(0.15).displacement, middle, atol=1e-14)
    with pytest.raises(ProblemError, match="outside"):
        history.at(0.5)


def kinked(force: str, until: float = 2.0, **options: Any) -> History:
    """A body whose load is a formula of the time."""
    problem = bodies.square(
        hv.Compliance(1.0),
        1,
        lame=(1.0, 1.0),
        viscosity=(1.0, 1.0),
        supports={"top": hv.Clamped()},
        tractions={"right": FormulaArray((Formula(force), 0.0), (2,))},
    )
    return march(Evolution(problem), until, **options)


def test_kinks_of_formulas_are_met_exactly() -> None:
    times = kinked("min(t, 1) + max(0, t - 1.3) - 2*abs(sin(2*t) - x/10)", step=0.3).times
    assert 1.0 in times  # to the last bit
    assert np.abs(times - 1.3).min() < 1e-14
    assert len(times) == 9  # 0, .3, .6, .9, 1, 1.3, 1.6, 1.9, 2: the third moves through the body and is none
    nested = kinked("min(abs(t - 0.5), 0.25)", step=0.4).times
    for kink in (0.25, 0.5, 0.75):
        assert np.abs(nested - kink).min() < 1e-14
    named = kinked("min(t, 1)", step=0.3, stops=(1.0 + 1e-13,)).times
    assert np.diff(named).min() > 1e-3  # a kink that is a stop already is not met twice
    dense = kinked("abs(sin(4000*t))", 1.0, step=0.5)
    assert any("kinks in time, which are not step ends" in message for message in dense.messages)
    assert len(dense.times) == 3


def test_kinks_of_what_warms_a_body_are_met_exactly() -> None:
    problem = bodies.square(hv.Compliance(1.0), 1, lame=(1.0, 1.0), supports={"top": hv.Clamped()})
    heat = hv.mechanics.Heat(
        1.0, 1.0, source=Formula("min(t, 0.17)"), supports={"top": Formula("min(t, 0.33)")},
        fluxes={"left": Formula("max(t, 0.57)")},
        contact={"bottom": hv.mechanics.HeatContact(1.0, Formula("abs(t - 0.71)"))},
    )  # fmt: skip
    times = march(Evolution(problem, heat=heat), 1.0, step=0.25).times
    assert all(np.abs(times - kink).min() < 1e-14 for kink in (0.17, 0.33, 0.57, 0.71))


@pytest.mark.parametrize("unit", [1.0, 1e-3])
def test_adaptive_steps_see_a_body_that_slides_as_a_whole(unit: float) -> None:
    """It stops after v0^2/(2 mu g): its deceleration is constant, so that velocities and deformations have no error."""
    problem = bodies.strip(
        hv.Contact(hv.laws.Bilateral(), hv.Tresca(0.3)),
        (2, 1),
        size=(1.0 * unit, 0.2 * unit),
        lame=(1e4, 1e4),
        density=5.0 / unit**2,
        supports={"top": hv.Fixed(y=0.0)},
    )
    evolution = Evolution(problem, inertia=True, velocity=(1.0 * unit, 0.0))
    way, errors, counts = 1.0 / 0.6 * unit, [], []
    for rtol in (1e-3, 1e-4):
        history = march(
            evolution, 3.0, step=hv.evolution.AdaptiveStep(rtol), save=Save(probes={"c": (0.5 * unit, 0.1 * unit)})
        )
        exact = 3.0 * unit - 0.15 * 9.0 * unit
        errors.append(abs(history["c.u_x"][-1] - exact) / way)
        counts.append(len(history.steps))
    assert errors[0] < 0.06
    assert errors[1] < 0.5 * errors[0]
    assert counts[1] < 300


BEGUN = """
import sys
import numpy as np
import hemivar as hv
from hemivar.errors import FileError
from hemivar.evolution import Checkpoint, Evolution, March
from hemivar.evolution.march import marching

pad = [object() for _ in range({pad})]
level = {level}
problem = hv.ContactProblem(
    mesh=hv.rectangle((1.0, 1.0), 2),
    material=hv.Material.lame(1.0, 1.0, viscosity=(1.0, 1.0)),
    supports={{"top": hv.Clamped()}},
    tractions={{"right": lambda x, t: np.stack([level * t + 0.0 * x[:, 0], 0.0 * x[:, 0]], axis=1)}},
    contact={{"bottom": hv.Contact(hv.laws.Bilateral(), hv.Tresca(0.05))}},
)
plan = March(0.5, step=0.1, checkpoint=Checkpoint(sys.argv[1], 0.0), resume={resume})
steps = marching(Evolution(problem), plan)
taken = 0
try:
    while taken < {most}:
        next(steps)
        taken += 1
    steps.close()
except StopIteration as end:
    history = end.value
    print(taken, float(history.time_error.bound).hex(), history.state.body.displacement.tobytes().hex())
except FileError as error:
    print(error)
"""


def _begun(path: Path, **options: Any) -> str:
    code = BEGUN.format(**{"pad": 0, "level": 0.3, "resume": True, "most": 99, **options})
    return subprocess.run([sys.executable, "-c", code, str(path)], capture_output=True, text=True, check=True).stdout


@pytest.mark.slow
def test_another_process_goes_on_bit_for_bit_with_its_bound(tmp_path: Path) -> None:
    """The load is a lambda, whose address is another one in every process."""
    whole = _begun(tmp_path / "whole.ckpt", resume=False).split()
    assert whole[0] == "5"
    assert np.isfinite(float.fromhex(whole[1]))
    _begun(tmp_path / "part.ckpt", resume=False, most=2)
    resumed = _begun(tmp_path / "part.ckpt", pad=54321).split()
    assert resumed[0] == "4"  # the checkpoint is that of the first step: the second was not gone on from
    assert resumed[1:] == whole[1:]
    _begun(tmp_path / "other.ckpt", resume=False, most=2)
    assert "another evolution" in _begun(tmp_path / "other.ckpt", level=0.31)


def test_a_checkpoint_knows_all_numbers_of_an_array_and_all_kinks(tmp_path: Path) -> None:
    shape = np.linspace(0.0, 0.01, 3000)

    def evolution(values: Array) -> Evolution:
        def load(x: Array, t: float) -> Array:
            return np.stack([0.0 * x[:, 0], -t * np.interp(x[:, 0], np.linspace(0.0, 2.0, 3000), values)], axis=1)

        problem = dataclasses.replace(beam(False).problem, body_force=load)
        return Evolution(problem)

    kept = hv.evolution.Checkpoint(tmp_path / "run.ckpt", 0.0)
    march(evolution(shape), 0.2, step=0.1, checkpoint=kept)
    assert march(evolution(shape), 0.2, step=0.1, checkpoint=kept, resume=True).finished
    other = shape.copy()
    other[1501] += 1e-12  # between all points at which loads are computed
    with pytest.raises(FileError, match="another evolution"):
        march(evolution(other), 0.2, step=0.1, checkpoint=kept, resume=True)
    kinked("min(t, 1)", step=0.5, checkpoint=kept)
    with pytest.raises(FileError, match="another choice of steps, events or loads"):
        kinked("min(t, 1)", step=0.5, checkpoint=kept, resume=True, stops=(0.75,))
    with pytest.raises(FileError, match="another evolution"):
        kinked("min(t, 1.2)", step=0.5, checkpoint=kept, resume=True)


@pytest.mark.parametrize(
    ("contact", "words"),
    [
        ({"normal": hv.Softening(Formula("20 - 50*t"), 0.1, 1.0)}, "contact 'bottom' at t = 0.4: stiffness of law"),
        ({"friction": hv.Tresca(Formula("0.1 - 0.3*t"))}, "contact 'bottom' at t = 0.4: bound of friction law"),
        (
            {"damping": hv.Compliance(Formula("1 - 3*t"))},
            "damping of contact 'bottom' at t = 0.4: stiffness of law 'compliance' is -0.2 at x =",
        ),
    ],
    ids=["normal", "friction", "damping"],
)
def test_parameters_that_vanish_are_named_with_their_boundary_and_time(contact: dict[str, Any], words: str) -> None:
    history = march(beam(inertia=False, **contact), 0.5, step=0.1)
    assert history.ended == "refused"
    assert history.state.time == pytest.approx(0.3)
    assert history.messages[-1].startswith(words)


def test_scalar_laws_that_vanish_are_named_with_their_area() -> None:
    problem = hv.ScalarProblem(
        mesh=hv.rectangle((1.0, 1.0), 2),
        coefficient=1.0,
        area=hv.ScalarContact(hv.Compliance(Formula("1 - 2*t"))),
        supports={"left": 0.0},
    )
    with pytest.raises(ProblemError, match=r"contact 'area' at t = 1: stiffness of law 'compliance' is -1"):
        hv.discretize(problem.at_time(1.0))


def test_steps_that_are_looked_for_need_no_law_beyond_the_end() -> None:
    """``largest_step`` looks at longer steps, at whose end the springs would pull."""
    history = march(beam(inertia=False, normal=hv.Softening(Formula("20 - 50*t"), 0.1, 1.0)), 0.3, step=0.1)
    assert history.finished, history.messages
    assert (history["largest_step"][1:] < 0.4 - history.times[:-1] + 0.01).all()


@pytest.mark.parametrize("law", [hv.Compliance(20.0), hv.Signorini()])
def test_a_step_that_is_solved_has_the_residual_that_was_asked_for(law: hv.laws.Superpotential) -> None:
    """The number in the table is held against what the tolerance is held against: a third of it was left out."""
    problem = bodies.strip(
        hv.Contact(law, hv.Coulomb(0.4)),
        (12, 6),
        viscosity=(0.4, 0.3),
        tractions={
            "top": lambda x, t: np.stack(
                [0.3 * np.sin(6.0 * t) + 0.0 * x[:, 0], -0.2 * t - 0.1 * x[:, 0] - 0.05], axis=1
            )
        },
    )
    history = hv.march(hv.Evolution(problem), 0.5, step=0.05, controls=hv.Controls(rtol=1e-11))
    assert history.finished
    assert history["residual"].max() <= 1e-11


def test_a_march_goes_on_to_a_later_end_beyond_kinks_and_stops(tmp_path: Path) -> None:
    """A kink at t = 1.2 and a stop at t = 1.3 lie between the first end and the later one."""
    kept, whole = hv.evolution.Checkpoint(tmp_path / "run.ckpt"), hv.evolution.Checkpoint(tmp_path / "whole.ckpt")
    options: dict[str, Any] = {"step": 0.25, "stops": (0.6, 1.3)}
    problem = dataclasses.replace(
        beam(False).problem, body_force=FormulaArray((0.0, Formula("-0.1 * min(t, 1.2)")), (2,))
    )
    march(Evolution(problem), 1.0, checkpoint=kept, **options)
    resumed = march(Evolution(problem), 2.0, checkpoint=kept, resume=True, **options)
    once = march(Evolution(problem), 2.0, checkpoint=whole, **{**options, "stops": (0.6, 1.0, 1.3)})
    assert resumed.finished
    assert {1.2, 1.3} <= set(resumed.times)
    assert np.array_equal(resumed.times, once.times)
    assert np.array_equal(resumed.state.body.displacement, once.state.body.displacement)
    with pytest.raises(FileError, match="another choice of steps, events or loads"):
        march(Evolution(problem), 2.0, checkpoint=kept, resume=True, step=0.25, stops=(0.7, 1.3))
