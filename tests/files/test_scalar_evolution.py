"""Scalar problems in time: what they refuse, restarts, files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import hemivar as hv
from hemivar.evolution import Evolution, march
from hemivar.files.not_expressible import difference
from hemivar.files.problem_file import parse_problem_file
from hemivar.mechanics.material_words import ScalarKind
from hemivar.workflows.marching import evolution_of
from tests.cli.test_scalar_march import FILE
from tests.evolution.test_scalar_evolution import MESH, membrane


def test_a_file_says_what_the_library_says(tmp_path: Path) -> None:
    found = parse_problem_file(FILE)
    hv.write_problem(found, tmp_path / "heat.toml")
    again = parse_problem_file((tmp_path / "heat.toml").read_text())
    assert difference(found.problem, again.problem) is None
    assert difference(found.time, again.time) is None
    history = march(evolution_of(found), 0.5, step=0.1, save=hv.evolution.Save(probes={"corner": (1.0, 1.0)}))
    assert history["corner.u"][0] == pytest.approx(0.3)
    by_hand = hv.ScalarProblem(
        hv.rectangle((1.0, 1.0), 4), 0.5,
        {"bottom": hv.ScalarContact(hv.Compliance(2.0), lambda x, t: np.full(len(x), 0.2 * t))},
        supports={"left": lambda x, t: np.full(len(x), 0.1 * t)}, source=lambda x, t: np.full(len(x), np.sin(t)),
        fluxes={"right": lambda x, t: t * x[:, 1]}, kind=ScalarKind.HEAT, capacity=lambda x: 1.0 + x[:, 0],
    )  # fmt: skip
    same = march(Evolution(by_hand, displacement=lambda x: 0.3 * x[:, 0]), 0.5, step=0.1)
    np.testing.assert_allclose(history.frames[-1].displacement, same.frames[-1].displacement, rtol=1e-13)


def test_regions_of_a_file(tmp_path: Path) -> None:
    cells = MESH.cells
    halves = hv.Mesh(MESH.points, cells, MESH.boundaries, {"low": np.arange(16), "high": np.arange(16, 32)})
    stated = membrane(mesh=halves, coefficient={"low": 1.0, "high": 2.0}, density={"low": 3.0, "high": 4.0})
    hv.write_problem(stated, tmp_path / "halves.toml", beside=True)
    assert difference(stated, hv.read_problem(tmp_path / "halves.toml")) is None
    text = (tmp_path / "halves.toml").read_text()
    for wrong, words in (
        (text.replace("density = 4.0", ""), "density: is missing; give it in every"),
        (
            text.replace("[material.regions.low]", "[material]\ndensity = 1.0\n[material.regions.low]"),
            "give one of the two",
        ),
    ):
        assert wrong != text
        with pytest.raises(hv.errors.ProblemError, match=words):
            parse_problem_file(wrong, tmp_path)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("step = 0.1", "step = 0.1\ninertia = true", "heat has none; remove it"),
        ("temperature = ", "displacement = ", "displacement"),
        ('capacity = "1 + x"', "density = 1", "density"),
        ('capacity = "1 + x"', "capacity = -1", "capacity"),
        ('capacity = "1 + x"', 'capacity = "1 + t"', "cannot change with time"),
        ('temperature = "0.3*x"', "temperature = [1.0, 2.0]", "temperature"),
        ("step = 0.1", 'step = 0.1\nscheme = "newmark"', "is for bodies with inertia"),
    ],
)
def test_what_files_refuse(old: str, new: str, words: str) -> None:
    assert old in FILE
    with pytest.raises(hv.errors.ProblemError, match=words):
        parse_problem_file(FILE.replace(old, new))
