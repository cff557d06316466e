"""A march over ranks is the serial one, step by step, and goes on from its checkpoint as if it had never stopped."""

from __future__ import annotations

import json
import shutil
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hemivar.basics.generators import result_of
from hemivar.basics.types import Array
from hemivar.evolution import History
from hemivar.evolution.march import marching
from tests.ranks.evolutions import CASES, COUPLED, ENDING
from tests.ranks.running import mpirun

pytest.importorskip("petsc4py")
pytest.importorskip("mpi4py")
if shutil.which("mpirun") is None:
    pytest.skip("mpirun is not installed", allow_module_level=True)

pytestmark = pytest.mark.mpi

#: Columns that are no numbers of the solution, or that are not looked for over ranks.
_OTHER = ("solver_steps", "residual", "time_error", "largest_step", "gap")


@cache
def _over_ranks(ranks: int, *arguments: str) -> dict[str, Any]:
    done = mpirun(ranks, "-m", "tests.ranks.marched", *arguments, limit=600.0)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout.splitlines()[-1])  # type: ignore[no-any-return]


@cache
def _serial(name: str) -> History:
    case = (CASES | COUPLED | ENDING)[name]
    return result_of(marching(case.state(case.mesh(0)), case.plan()))


def _sorted(rows: Array, keys: int) -> Array:
    """Rows in the order of their first entries, coordinates with what rounding leaves of them."""
    return rows[np.lexsort(np.round(rows[:, :keys], 9).T)]


def _agree(found: Array, wanted: Array, what: str) -> None:
    size = np.abs(wanted).max()
    assert size > 0.0, what
    assert np.abs(found - wanted).max() <= 1e-9 * size, what


@pytest.mark.parametrize(
    ("name", "ranks"), [*((name, 2) for name in CASES), ("thrown", 1), ("block", 3), ("thrown", 3), ("cube", 3)]
)
def test_the_march_is_the_serial_one(name: str, ranks: int) -> None:
    _ends_as_in_serial(name, _over_ranks(ranks, *(CASES if ranks == 2 else [name]))[name])


def _ends_as_in_serial(name: str, said: dict[str, Any]) -> None:
    serial = _serial(name)
    assert said["ended"] == serial.ended == "finished"
    discrete, state = serial.discrete, serial.state
    mesh, contact = discrete.field.mesh, discrete.problem.contact
    assert contact.points is not None
    place, velocity = discrete.full(state.body.displacement), discrete.full(state.body.velocity)
    dim = mesh.dim
    nodes = _sorted(np.array(said["nodes"]), dim)
    wanted = _sorted(np.hstack([mesh.points, place, velocity]), dim)
    np.testing.assert_allclose(nodes[:, :dim], wanted[:, :dim], atol=1e-12)
    _agree(nodes[:, dim : 2 * dim], wanted[:, dim : 2 * dim], "displacement")
    _agree(nodes[:, 2 * dim :], wanted[:, 2 * dim :], "velocity")
    marks = _sorted(np.array(said["contact"]), 1 + dim)
    wanted = _sorted(
        np.hstack([contact.boundary[:, None], contact.points, state.local.displacement, state.multiplier]), 1 + dim
    )
    np.testing.assert_allclose(marks[:, : 1 + dim], wanted[:, : 1 + dim], atol=1e-12)
    _agree(marks[:, 1 + dim : 1 + 2 * dim], wanted[:, 1 + dim : 1 + 2 * dim], "penetration and slip")
    _agree(marks[:, 1 + 2 * dim :], wanted[:, 1 + 2 * dim :], "multiplier")


@pytest.mark.parametrize("name", CASES)
def test_the_table_is_the_serial_one(name: str) -> None:
    """Energies against the largest of them: what is lost in one step is small beside what is there."""
    _tells_as_in_serial(name, _over_ranks(2, *CASES)[name])


@pytest.mark.parametrize("name", COUPLED)
def test_laws_that_couple_opening_and_slip_march_as_in_serial(name: str) -> None:
    """Some ranks have no part of the foundation whose law does so."""
    said, serial = _over_ranks(3, *COUPLED)[name], _serial(name)
    _ends_as_in_serial(name, said)
    _tells_as_in_serial(name, said)
    # glue was opened beyond its strength and went back along the secant, bonds broke
    assert (serial.ledger["memory"] > 1e-4) == (name in ("glue", "glue with friction", "plastic bond"))
    assert np.abs(serial["friction_force"]).max() > 1e-3


def _tells_as_in_serial(name: str, said: dict[str, Any]) -> None:
    serial = _serial(name)
    assert tuple(said["columns"]) == serial.columns
    table = dict(zip(said["columns"], map(np.array, said["table"]), strict=True))
    assert len(table["time"]) == len(serial.steps)
    energies = [column for column in serial.ledger if column != "gap"]
    energy = max(float(np.abs(serial[column]).max()) for column in energies)
    for column in serial.columns:
        if column in _OTHER:
            continue
        wanted = serial[column]
        if column == "margin" and (wanted[1:] < 1.0).any():  # an eigenvalue, found another way
            np.testing.assert_allclose(table[column], wanted, atol=1e-3)
            continue
        size = energy if column in energies else float(np.nanmax(np.abs(wanted), initial=0.0))
        np.testing.assert_allclose(table[column], wanted, rtol=0.0, atol=1e-9 * size, err_msg=column)
    assert np.abs(table["gap"]).max() <= 1e-9 * energy
    events = serial.events
    assert [name for _, name in said["events"]] == [name for _, name in events]
    for (time, _), (wanted_time, _) in zip(said["events"], events, strict=True):
        assert time == pytest.approx(wanted_time, rel=1e-9)


def test_the_cases_are_ones() -> None:
    """Contact is made and lost, bodies stick and slide, events happen: what they are there for."""
    block, slider, thrown = _serial("block"), _serial("slider"), _serial("thrown")
    assert block["contact_measure"].max() > 0.5
    assert block["friction_force"].min() < -1e-3 < 1e-3 < block["friction_force"].max()
    assert min(block.ledger[entry] for entry in ("viscous", "branch_loss", "friction")) > 1e-5
    assert slider.ledger["friction"] > 1e-4
    assert min(thrown["bottom.normal_force"].max(), thrown["right.normal_force"].max()) > 0.1
    assert thrown.ledger["friction"] > 1e-5
    assert _serial("impact").ledger["friction"] > 0.0
    assert min(_serial("two stages, memory").ledger[entry] for entry in ("friction", "damping")) > 1e-7
    assert [name for _, name in _serial("block, adaptive").events] == ["touch"]
    assert len(set(np.round(_serial("block, adaptive")["step"][1:], 12))) > 2
    torn = _serial("jumps")
    assert torn["jumped"].sum() == 2
    assert torn.ledger["jumps"] > 0.01
    assert _serial("viscous jumps")["margin"][1:].max() < 0.0
    said = _over_ranks(2, *CASES)
    assert [said[name]["levels"] for name in ("block", "thrown, implicit Euler", "cube")] == [2, 2, 1]


def test_all_ranks_say_why_a_march_ends() -> None:
    """Also those without contact points, of which one may be the first, whose words are printed."""
    said, serial = _over_ranks(2, "slips at once")["slips at once"], _serial("slips at once")
    assert "finished" not in (said["ended"], serial.ended)
    assert said["table"][0] == serial["time"].tolist()
    assert "may not carry the initial load at rest" in serial.messages[-1]
    assert all("may not carry the initial load at rest" in messages[-1] for messages in said["messages"])


def test_matrices_and_cycles_outlive_their_step() -> None:
    """Bodies are assembled once on every mesh, whatever the steps; a cycle is set up where contact changes."""
    said = _over_ranks(2, *CASES)
    assert [said[name]["done"]["assembled"] for name in ("block", "thrown", "cube")] == [2, 1, 1]
    for name in ("thrown", "thrown, implicit Euler"):  # mostly in flight
        assert said[name]["done"]["set up"] <= (len(said[name]["table"][0]) - 1) // 2


def test_a_jump_takes_few_steps_where_points_rest_on_laws_that_soften() -> None:
    """Against a resistance of 15 times the stiffness it creeps there: 400 problems of one step and more."""
    said, serial = _over_ranks(2, *CASES)["peeled"], _serial("peeled")
    assert serial["margin"][1:].max() < -12.0
    assert serial["jumped"].sum() == 1
    assert said["done"]["solved"] < 60 * len(serial.steps[1:])


@pytest.mark.parametrize(("name", "steps"), [("block", 4), ("thrown", 7), ("block, adaptive", 5), ("braked", 4)])
def test_a_march_goes_on_bit_for_bit(name: str, steps: int, tmp_path: Path) -> None:
    file = tmp_path / "run.ckpt"
    whole = dict(_over_ranks(2, name)[name])
    part = _over_ranks(2, name, "--checkpoint", str(file), "--steps", str(steps))[name]
    assert part["ended"] == "interrupted"
    assert len(part["table"][0]) == steps + 1
    resumed = _over_ranks(2, name, "--checkpoint", str(file), "--resume")[name]
    del resumed["done"], whole["done"]
    assert json.dumps(resumed) == json.dumps(whole)


def test_checkpoints_of_others_are_refused(tmp_path: Path) -> None:
    file = tmp_path / "run.ckpt"
    _over_ranks(2, "slider", "--checkpoint", str(file), "--steps", "2")
    for ranks, name, words in (
        (3, "slider", "was written on 2 ranks, these are 3"),
        (2, "thrown", "belongs to another evolution"),
    ):
        done = mpirun(ranks, "-m", "tests.ranks.marched", name, "--checkpoint", file, "--resume")
        assert done.returncode == 2, done.stderr
        assert done.stderr.count("hemivar: error: ") == 1
        assert words in done.stderr
    file.write_bytes(file.read_bytes()[:-4000])
    done = mpirun(2, "-m", "tests.ranks.marched", "slider", "--checkpoint", file, "--resume")
    assert done.returncode == 2, done.stderr
    assert "not a checkpoint" in done.stderr
