"""Friction is the force of the foundation on the body, in every output; pressure is positive in compression.

A block, clamped at its right side, is pulled to the left and pressed down. Below it slips to the left at every contact
point, so friction on the body is known: at each point it is the bound, and points to the right.
"""

from __future__ import annotations

import csv
import json
from dataclasses import replace
from pathlib import Path

import meshio
import numpy as np
import pytest

import hemivar as hv
from hemivar import cli
from hemivar.basics.types import Array
from hemivar.evolution import march
from hemivar.files import read_solution, write_csv
from hemivar.files.film import film_of
from hemivar.report import plot_contact, plot_path, plot_solution
from tests import bodies

BOUND = 0.05
TEXT = f"""
[mesh]
rectangle = [1.0, 1.0]
cells = [6, 6]
[material]
lame = [4.0, 4.0]
density = 0.01
[loads]
body = ["-1 * min(1, 4*t)", "-0.5 * min(1, 4*t)"]
[supports]
right = "clamped"
[contact.bottom]
normal = {{ law = "compliance", stiffness = 10.0 }}
friction = {{ law = "tresca", bound = {BOUND} }}
"""
AT_REST = TEXT.replace("-1 * min(1, 4*t)", "-1").replace("-0.5 * min(1, 4*t)", "-0.5")


def drawn_to_the_left(dim: int = 2) -> hv.ContactProblem:
    return bodies.body(
        hv.rectangle((1.0, 1.0), 6) if dim == 2 else hv.box((1.0, 1.0, 1.0), 3),
        hv.Contact(hv.Compliance(10.0), hv.Tresca(BOUND)),
        supports={"right": hv.Clamped()},
        body_force=(-1.0, -0.5) if dim == 2 else (-1.0, 0.0, -0.5),
    )


@pytest.fixture(scope="module")
def plane() -> hv.Solution:
    return hv.solve(drawn_to_the_left()).raise_for_status()


@pytest.fixture(scope="module")
def solid() -> hv.Solution:
    return hv.solve(drawn_to_the_left(3)).raise_for_status()


@pytest.fixture
def problem(tmp_path: Path) -> Path:
    path = tmp_path / "pulled.toml"
    path.write_text(AT_REST, encoding="utf-8")
    return path


def test_in_python(plane: hv.Solution) -> None:
    assert (plane.slip < 0.0).all()
    np.testing.assert_allclose(plane.friction, BOUND)
    np.testing.assert_allclose(plane.multiplier[:, 1], -BOUND)
    np.testing.assert_allclose(plane.friction_vectors, np.broadcast_to([BOUND, 0.0], plane.friction_vectors.shape))
    assert (plane.pressure > 0.0).any()
    np.testing.assert_allclose(plane.tractions, np.column_stack([plane.friction, plane.pressure]))
    whole = BOUND * plane.contact.weights.sum()
    assert plane.friction_force == pytest.approx([whole])
    assert plane.force == pytest.approx([whole, plane.normal_force])
    bottom = plane.on("bottom")
    np.testing.assert_array_equal(bottom.friction, plane.friction)
    assert bottom.friction_force == pytest.approx([whole])
    assert bottom.force == pytest.approx([whole, plane.normal_force])
    assert plane.contact_table["friction"] == pytest.approx(BOUND)
    assert plane.contact_table["force"][:, 0] == pytest.approx(BOUND * plane.contact.weights)
    # equilibrium of the whole body: what pulls, what the support does, and what the foundation does
    assert plane.reactions["right"] + plane.force == pytest.approx([1.0, 0.5])


def test_friction_of_nothing_is_zero_without_a_sign() -> None:
    solution = hv.solve(hv.discretize(drawn_to_the_left()).with_(load=np.zeros(84))).raise_for_status()
    assert not np.signbit(solution.friction).any()


def test_in_space(solid: hv.Solution) -> None:
    np.testing.assert_allclose(np.linalg.norm(solid.friction, axis=1), BOUND, rtol=1e-9)
    work = np.einsum("md,md->m", solid.friction, solid.slip)
    np.testing.assert_allclose(work, -BOUND * np.linalg.norm(solid.slip, axis=1), rtol=1e-6)
    assert (solid.friction_vectors[:, 0] > 0.6 * BOUND).all()
    assert solid.force[0] > 0.0
    assert solid.contact.weights @ solid.friction_vectors == pytest.approx([solid.force[0], solid.force[1], 0.0])
    grouped = solid.contact.weights @ solid.friction
    assert solid.friction_force == pytest.approx(grouped)


def test_in_files(plane: hv.Solution, solid: hv.Solution, tmp_path: Path) -> None:
    for solution in (plane, solid):
        for suffix in ("", "_contact"):
            solution.to_vtu(tmp_path / "r.vtu")
            data = meshio.read(tmp_path / f"r{suffix}.vtu").point_data
            here = data["state"] >= 0
            assert here.sum() == solution.problem.contact_points
            assert (data["friction"][here, 0] > 0.0).all()
            assert not data["friction"][~here].any()
            assert (np.einsum("md,md->m", data["friction"], data["slip"])[here] < 0.0).all()
            np.testing.assert_allclose(
                np.linalg.norm(data["contact_force"] - data["friction"], axis=1), np.abs(data["pressure"]), atol=1e-15
            )
    rows = list(csv.DictReader(write_csv(plane, tmp_path / "r.csv").open(encoding="utf-8")))
    assert [float(row["friction"]) for row in rows] == pytest.approx([BOUND] * len(rows))
    record = json.loads(plane.to_json(tmp_path / "r.json").read_text(encoding="utf-8"))
    assert record["contact"]["friction"] == pytest.approx([BOUND] * plane.problem.contact_points)
    assert record["resultants"]["friction_force"] == pytest.approx(plane.friction_force)
    assert record["resultants"]["force"][0] > 0.0
    assert record["boundaries"]["bottom"]["force"][0] > 0.0


@pytest.mark.parametrize("dim", [2, 3])
def test_a_multiplier_that_is_read_back_keeps_its_sign(
    dim: int, plane: hv.Solution, solid: hv.Solution, tmp_path: Path
) -> None:
    solution = plane if dim == 2 else solid
    unknowns, multiplier = read_solution(solution.to_json(tmp_path / "r.json"), solution.problem)
    assert multiplier is not None
    np.testing.assert_array_equal(multiplier, solution.multiplier)
    assert hv.discrete.residual(solution.problem, unknowns, multiplier).relative < 1e-8


def test_in_pictures(plane: hv.Solution) -> None:
    from matplotlib.quiver import Quiver

    lines = [line for panel in plot_contact(plane).axes for line in panel.lines]
    (curve,) = (line for line in lines if line.get_label() == "friction on the body")
    np.testing.assert_allclose(np.asarray(curve.get_ydata(), dtype=float), BOUND)
    (quiver,) = plot_solution(plane).axes[0].findobj(Quiver)
    assert (np.asarray(quiver.U) > 0.0).all()


def test_along_a_path(plane: hv.Solution) -> None:
    path = hv.follow_path(plane.problem)
    assert path.friction_force[-1] == pytest.approx(plane.friction_force)
    assert plot_path(path, quantity="friction-force") is not None
    assert path.to_dataframe()["friction_force"].iloc[-1] == pytest.approx(plane.friction_force[0])


def test_of_the_command(problem: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = [tmp_path / "r.json", tmp_path / "r.vtu", tmp_path / "path.json"]
    assert cli.main(["solve", str(problem), "--json", str(out[0]), "--vtu", str(out[1])]) == 0
    shown = capsys.readouterr().out
    (line,) = (line for line in shown.splitlines() if line.startswith("friction force"))
    assert float(line.split()[-1]) == pytest.approx(BOUND * (1.0 - 1.0 / 12.0))
    assert min(json.loads(out[0].read_text())["contact"]["friction"]) == pytest.approx(BOUND)
    assert cli.main(["certify", str(problem), "--solution", str(out[0])]) == 0
    assert "read from the file" in capsys.readouterr().out
    assert cli.main(["path", str(problem), "--quantity", "friction-force", "--json", str(out[2])]) == 0
    point = json.loads(out[2].read_text())["points"][-1]
    assert point["friction_force"] == pytest.approx([BOUND * (1.0 - 1.0 / 12.0)])
    assert point["value"] == pytest.approx(point["friction_force"][0])


def test_in_time(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    problem = tmp_path / "moving.toml"
    problem.write_text(TEXT + "[time]\nuntil = 0.25\nstep = 0.0125\n[output]\nevery = 0.25\n", encoding="utf-8")
    table, record, fields = tmp_path / "m.csv", tmp_path / "m.json", tmp_path / "m.pvd"
    arguments = ["march", str(problem), "--table", str(table), "--json", str(record), "--fields", str(fields), "-q"]
    assert cli.main(arguments) == 0, capsys.readouterr().err
    last = list(csv.DictReader(table.open(encoding="utf-8")))[-1]
    assert float(last["friction_force"]) == pytest.approx(BOUND * (1.0 - 1.0 / 12.0))
    assert float(last["normal_force"]) > 0.0
    assert float(last["friction"]) > 0.0  # what has been lost by it
    assert json.loads(record.read_text())["table"]["friction_force"][-1] == pytest.approx(float(last["friction_force"]))
    written = sorted((tmp_path / "m").glob("*[0-9].vtu"))[-1]
    data = meshio.read(written).point_data
    sliding = data["state"] == 2
    assert sliding.any()
    np.testing.assert_allclose(data["friction"][sliding, 0], BOUND)


def test_in_histories_of_python() -> None:
    def load(points: Array, t: float) -> Array:
        """From zero on: what slips at once under a load of the start comes before the energy balance."""
        return np.tile([-t, -0.5 * t], (len(points), 1))

    evolution = hv.Evolution(replace(drawn_to_the_left(), body_force=load), inertia=False)
    history = march(evolution, until=1.0, step=1.0, save=hv.evolution.Save(every=1.0))
    assert history["friction_force"][-1] == pytest.approx(BOUND * (1.0 - 1.0 / 12.0))
    film = film_of(history)
    assert (film.frame(len(film.times) - 1).force[:, 0] > 0.0).all()
    assert history.ledger["friction"] > 0.0


def test_of_a_scalar_problem(tmp_path: Path) -> None:
    """Antiplane shear: the fluxes pull the block towards negative z over all of its height; the base rubs."""
    problem = hv.ScalarProblem(
        hv.rectangle((2.0, 1.0), (8, 4)), 2.0, contact={"bottom": hv.ScalarContact(hv.Tresca(BOUND))},
        supports={"top": 0.0}, source=-1.0, kind="antiplane",  # type: ignore[arg-type]
    )  # fmt: skip
    solution = hv.solve(problem).raise_for_status()
    assert (solution.slip < 0.0).all()
    np.testing.assert_allclose(solution.friction, BOUND)
    assert solution.friction_force == pytest.approx([2.0 * BOUND])
    data = meshio.read(solution.to_vtu(tmp_path / "r.vtu")).point_data
    np.testing.assert_allclose(data["friction"][data["state"] >= 0], BOUND)
    everywhere = hv.ScalarProblem(
        hv.rectangle((2.0, 1.0), (8, 4)), 2.0, area=hv.ScalarContact(hv.Tresca(BOUND)),
        supports={"top": 0.0}, source=-1.0, kind="antiplane",  # type: ignore[arg-type]
    )  # fmt: skip
    from matplotlib.collections import TriMesh

    first = plot_contact(hv.solve(everywhere).raise_for_status()).axes[0]
    (colours,) = first.findobj(TriMesh)
    values: Array = np.asarray(colours.get_array())  # type: ignore[attr-defined]
    assert values.max() == pytest.approx(BOUND)
    assert values.min() >= 0.0
