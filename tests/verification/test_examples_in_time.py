"""The example files in time: all of them march by the command, and each shows what theory says of it."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import hemivar as hv
from hemivar.basics.generators import result_of
from hemivar.cli import main
from hemivar.evolution import History
from hemivar.files.film import read_film
from hemivar.files.history_table import read_history_table
from hemivar.files.problem_file import ProblemFile, read_problem_file
from hemivar.files.snapshot import moving_states
from hemivar.solvers import TangentialState
from hemivar.workflows import march as work
from hemivar.workflows.marching import evolution_of, plan_of

ROOT = Path(__file__).parents[2]
PROBLEMS = ROOT / "examples" / "problems"
NAMES = ("relaxation", "bounce", "delayed_failure", "stick_slip", "bar_impact", "wear")


def example_file(name: str) -> ProblemFile:
    return read_problem_file(PROBLEMS / f"{name}.toml")


def marched(problem: ProblemFile) -> History:
    return result_of(work(evolution_of(problem), plan_of(problem)), lambda event: False)


@cache
def history(name: str) -> History:
    found = marched(example_file(name))
    assert found.finished
    largest = max(abs(value) for entry, value in found.ledger.items() if entry != "gap")
    assert abs(found.ledger["gap"]) < 1e-8 * largest
    return found


def test_all_examples_in_time_are_here() -> None:
    timed = {path.stem for path in PROBLEMS.glob("*.toml") if "[time]" in path.read_text(encoding="utf-8")}
    assert timed >= set(NAMES)
    for name in NAMES:
        assert (PROBLEMS / f"{name}.toml").read_text(encoding="utf-8").startswith("# ")


@pytest.mark.parametrize("name", NAMES)
def test_the_command_marches_it(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Some steps of each, with the table and the frames."""
    monkeypatch.chdir(tmp_path)
    steps = example_file(name).time.march.step  # type: ignore[union-attr]
    assert isinstance(steps, hv.evolution.FixedStep)
    step = steps.step
    options = ["--until", f"{4 * step:g}", "--every", f"{2 * step:g}", "--output", "a", "-q"]
    assert main(["march", str(PROBLEMS / f"{name}.toml"), *options]) == 0
    for times, wanted in (
        (read_history_table("a.csv")["time"], step * np.arange(5)),
        (read_film("a.pvd").times, step * np.arange(0, 5, 2)),
    ):  # kinks of the data are met besides
        assert np.abs(times[:, None] - wanted).min(axis=0) == pytest.approx(0.0, abs=1e-8)


def test_each_has_its_film_in_the_docs() -> None:
    page = (ROOT / "docs" / "evolution-examples.md").read_text(encoding="utf-8")
    script = (ROOT / "docs" / "animations.py").read_text(encoding="utf-8")
    for name in NAMES:
        film = ROOT / "docs" / "images" / f"{name}.gif"
        assert re.search(rf"!\[[^\]]{{20,}}\]\(images/{name}\.gif\)", page), name
        assert f'"{name}"' in script
        assert film.read_bytes()[:6] == b"GIF89a"
        assert film.stat().st_size < 700_000  # some 40 frames of 630 pixels with a title


def test_relaxation() -> None:
    """Standard solid of 6 and 6 on a spring of 2: P = P1 + (P0 - P1) exp(-t/T*), T* = T (k0 + p)/(kinf + p)."""
    k_inf, k_0, p, period, depth = 6.0, 12.0, 2.0, 0.5, 0.1
    slow = period * (k_0 + p) / (k_inf + p)
    first, last = (k * p * depth / (k + p) for k in (k_0, k_inf))
    found = history("relaxation")
    exact = last + (first - last) * np.exp(-found.times / slow)
    assert exact[-1] == pytest.approx(0.156834, abs=5e-7)
    # the file moves the support within the first step: half a step of delay
    assert found["normal_force"][1:] == pytest.approx(exact[1:], abs=0.6 * 0.01 * (first - last) / slow)


@pytest.mark.slow
def test_bounce() -> None:
    """It falls freely through the gap, and comes back lower for what friction and viscosity have taken."""
    found = history("bounce")
    touched = found.times[np.argmax(found["contact_measure"] > 0.0)]
    assert touched == pytest.approx(math.sqrt(2.0 * 0.05 / 1.0), abs=1.5 * 0.005)
    lost = found["friction"] + found["viscous"]
    assert np.all(np.diff(lost) > -1e-12)
    peaks = [found["normal_force"][(found.times > a) & (found.times < b)].max() for a, b in ((0.2, 0.7), (1.0, 1.5))]
    assert peaks[1] < peaks[0]


@pytest.mark.slow
def test_delayed_failure() -> None:
    """Below the load that the glue bears at last the strip creeps to the static solution; above it fails, and late."""
    problem = example_file("delayed_failure")
    statement = problem.problem
    assert isinstance(statement, hv.ContactProblem)
    low = replace(problem, problem=replace(statement, tractions={"right": (0.0, 0.23)}))
    rests = marched(low)
    glue = replace(statement.contact["bottom"], memory=())
    still = replace(statement, tractions={"right": (0.0, 0.23)}, contact={"bottom": glue})
    at_rest = hv.solve(hv.discretize(still)).raise_for_status()
    tip = int(np.argmin(np.linalg.norm(statement.mesh.points - [3.0, 0.0], axis=1)))
    assert rests["tip.u_y"][-1] == pytest.approx(at_rest.displacement[tip, 1], rel=2e-3)

    fails = history("delayed_failure")
    opened = fails["tip.u_y"]
    broken = 0.25 / 50.0 + 0.25 / 2.5
    late = fails.times[np.argmax(opened > broken)]
    assert 45.0 < late < 65.0  # about ten times the retardation time of 5
    rate = np.diff(opened) / np.diff(fails.times)
    slowest = float(rate[: np.argmax(opened > 0.5 * broken)].min())
    assert rate[: len(rate) // 2].max() > 5.0 * slowest
    assert rate[len(rate) // 2 :].max() > 5.0 * slowest
    assert fails.frames[-1].multiplier[-5:, 0] == pytest.approx(0.0, abs=1e-12)


@pytest.mark.slow
def test_stick_slip() -> None:
    """The period of one mass on one spring: it sticks 2 dF/(k V), and slips as long as its mode of shear swings."""
    mu, width, height, V, drop = 40.0, 2.0, 1.0, 0.1, 0.6 * 0.5 * 2.0
    k, omega = mu * width / height, 0.5 * math.pi * math.sqrt(mu) / height
    sticks = 2.0 * drop / (k * V)
    slips = 2.0 / omega * (math.pi - math.atan(drop / (V * k / omega)))
    found = history("stick_slip")
    states = [moving_states(found.discrete, frame).tangential for frame in found.frames]
    stuck = np.array([np.mean(state == TangentialState.STICK) > 0.5 for state in states])
    times = np.array([frame.time for frame in found.frames])
    begun = times[1:][stuck[1:] & ~stuck[:-1] & (times[1:] > 1.0)]
    assert len(begun) >= 3
    assert np.diff(begun) == pytest.approx(sticks + slips, rel=0.12)
    friction = -found["friction_force"]  # the ground moves the foot back
    assert 0.6 * 1.0 * 2.0 >= friction[found.times > 1.0].max() > 0.8 * 1.2  # static, nearly everywhere at once
    assert friction[found.times > 1.0].min() == pytest.approx(0.6 * 0.5 * 2.0, rel=0.1)  # kinetic


@pytest.mark.slow
def test_bar_impact() -> None:
    """The wall feels rho c v0 for as long as the wave needs to the free end and back: 2 L/c."""
    found = history("bar_impact")
    force, times = found["normal_force"], found.times
    pressed = force > 0.5 * 0.05
    first, last = times[np.argmax(pressed)], times[len(times) - 1 - np.argmax(pressed[::-1])]
    assert first == pytest.approx(0.1 / 0.05, abs=0.15)
    assert last - first == pytest.approx(2.0 * 8.0, rel=0.03)
    assert force[pressed].mean() == pytest.approx(0.05, rel=0.03)
    momentum = 8.0 * 0.05
    assert np.trapezoid(force, times) == pytest.approx(2.0 * momentum, rel=0.03)
    assert found.ledger["kinetic"] + found.ledger["elastic"] > 0.98 * 0.5 * 8.0 * 0.05**2


@pytest.mark.slow
def test_wear() -> None:
    """Archard: the volume that is lost is the coefficient times load times way, however the pressure is spread."""
    found = history("wear")
    contact = found.discrete.problem.contact
    # the start is an equilibrium under the load that is on from then: to reach it the block slips, and wears, a little
    depths = [next(v for name, v in found.frames[k].memory.items() if name.endswith("depth")) for k in (0, -1)]
    depth = depths[1] - depths[0]
    assert 0.0 < contact.weights @ depths[0] < 0.001 * contact.weights @ depth
    ways = [np.abs(b.local[:, 1] - a.local[:, 1]) for a, b in zip(found.frames, found.frames[1:], strict=False)]
    pressures = [frame.multiplier[:, 0] for frame in found.frames[1:]]
    work = sum(contact.weights @ (p * way) for p, way in zip(pressures, ways, strict=True))
    assert contact.weights @ depth == pytest.approx(0.1 * work, rel=1e-6)
    assert work == pytest.approx(2.0 * 2 * 4 * 0.2, rel=0.05)  # of the top; the foot lags where the block tilts
    assert found["normal_force"][1:] == pytest.approx(2.0, rel=1e-6)
    measure = found["contact_measure"]
    assert measure[1] < 1.2
    assert measure[-1] == pytest.approx(2.0)

    def spread(pressure: np.ndarray) -> float:
        mean = contact.weights @ pressure / contact.weights.sum()
        return float(math.sqrt(contact.weights @ (pressure - mean) ** 2 / contact.weights.sum()) / mean)

    spreads = [spread(frame.multiplier[:, 0]) for frame in found.frames[1:]]
    assert spreads[0] > 0.8
    assert spreads[-1] < 0.1
