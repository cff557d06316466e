"""Marches held against enumeration, and the enumeration held against what is known by hand."""

from __future__ import annotations

import copy
import itertools
import math
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.robustness.elasticity import Body, mass
from tests.robustness.graphs import normal_graph
from tests.robustness.judge import FAULTS, table
from tests.robustness.moving import examine_march
from tests.robustness.physics import Verdict
from tests.robustness.pieces import Friction, Line, Points, alpha_of, damped, lines_of, mirrored
from tests.robustness.pool import run_cases
from tests.robustness.toml import dump

CASES = 180

pytestmark = pytest.mark.skipif(
    not Path("/proc/self").is_dir(), reason="limits and states of processes are those of Linux"
)


@pytest.mark.slow
def test_steps_of_random_evolutions_are_those_of_enumeration() -> None:
    outcomes = list(run_cases(seed=24, numbers=range(CASES), jobs=2, family="evolution"))
    print(table(outcomes))
    bad = [o for o in outcomes if o.verdict in FAULTS]
    said = "\n".join(f"{o.name} {o.verdict}: {o.faults[o.verdict][:200]} ({o.note[:100]})" for o in bad)
    assert not bad, f"{table(outcomes)}\n{said}"
    # one that examines nothing would pass as well
    assert sum(o.verdict == "accepted, examined" for o in outcomes) > 0.5 * CASES


# ---- enumeration by hand -------------------------------------------------------------------------------------------

SPRING = np.array([[1.0, 0.0], [0.0, 1.0]])  # a body of stiffness 1 in both directions
LOOSE = [Friction([Line(-math.inf, math.inf, 0.0, 0.0)])]


def test_a_softening_spring_has_three_solutions_by_enumeration() -> None:
    """``r + j'(r) = r0`` with k = 2 up to 0.1, then falling by 4: rising, falling, and beyond 0.15."""
    lines = lines_of(
        normal_graph({"law": "softening", "stiffness": 2.0, "limit": 0.1, "softening": 4.0}, float, Path())
    )
    found = Points(SPRING, [lines], LOOSE).solutions(np.array([0.2, 0.0]), 1.0, 1.0)
    places = np.unique(np.round(found.places[:, 0], 12))
    np.testing.assert_allclose(places, sorted([0.2 / 3.0, (0.2 - 0.6) / (1.0 - 4.0), 0.2]), rtol=1e-10)
    assert not found.doubt
    assert alpha_of(lines) == pytest.approx(4.0)
    assert (
        alpha_of(lines_of(normal_graph({"law": "capped", "stiffness": 2.0, "limit": 0.1}, float, Path()))) == math.inf
    )


@pytest.mark.parametrize("pull", [0.1, 0.4, -0.4])
def test_coulomb_sticks_or_slips_by_enumeration(pull: float) -> None:
    """Rigid ground pressed with 1 and friction 0.3: the slip is what the pull has beyond 0.3."""
    lines = lines_of(normal_graph("signorini", float, Path()))
    found = Points(SPRING, [lines], [Friction(None, pressure=0.3)]).solutions(np.array([1.0, pull]), 1.0, 1.0)
    slip = math.copysign(max(abs(pull) - 0.3, 0.0), pull)
    np.testing.assert_allclose(found.places, [[0.0, slip]], atol=1e-12)
    np.testing.assert_allclose(found.forces, [[1.0, pull - slip]], atol=1e-12)
    lifted = Points(SPRING, [lines], [Friction(None, pressure=0.3)]).solutions(np.array([-1.0, pull]), 1.0, 1.0)
    np.testing.assert_allclose(np.unique(np.round(lifted.places, 12), axis=0), [[-1.0, pull]], atol=1e-12)


def test_two_points_have_the_products_of_their_solutions() -> None:
    """Two that hold nothing of each other, with three solutions each."""
    law = {"law": "softening", "stiffness": 2.0, "limit": 0.1, "softening": 4.0}
    lines = lines_of(normal_graph(law, float, Path()))
    found = Points(np.eye(4), [lines] * 2, LOOSE * 2).solutions(np.array([0.2, 0.0, 0.2, 0.0]), 1.0, 1.0)
    alone = [0.2 / 3.0, 0.4 / 3.0, 0.2]
    expected = sorted(itertools.product(alone, alone))
    np.testing.assert_allclose(sorted({(round(p[0], 10), round(p[2], 10)) for p in found.places}), expected, rtol=1e-8)
    assert found.apart(0.2) == pytest.approx((0.2 - 0.2 / 3.0) / 0.2)


def test_graphs_with_damping_and_on_both_sides() -> None:
    (free, contact, kink) = sorted(
        damped(lines_of(normal_graph({"law": "survey", "q_max": 1.0, "p_const": 2.0}, float, Path())), 3.0, 0.5),
        key=lambda line: (line.slope is None, line.low),
    )[::1][:3]
    assert (free.slope, contact.slope) == (0.0, 2.0)
    assert (contact.low, contact.high, kink.slope, kink.base) == (0.0, 0.5, 5.0, 1.0 - 1.5)
    both = mirrored([Line(0.0, math.inf, 0.7, 0.0)])
    assert {(line.low, line.high, line.base, line.slope) for line in both} == {
        (0.0, math.inf, 0.7, 0.0), (-math.inf, 0.0, -0.7, 0.0), (0.0, 0.7, -0.7, None),
    }  # fmt: skip


@pytest.mark.parametrize("order", [1, 2])
def test_mass_has_the_energy_of_turning(order: int) -> None:
    """A triangle (0, 0), (2, 0), (0, 1) that turns about the origin: ``int x^2 + y^2 = 2/3 + 1/12 4 1/2``."""
    corners = np.array([[0.0, 0.0], [2.0, 0.0], [0.0, 1.0]])
    middles = np.array([(corners[a] + corners[b]) / 2.0 for a, b in ((0, 1), (1, 2), (0, 2))])
    nodes = corners if order == 1 else np.vstack([corners, middles])
    turn = np.column_stack([-nodes[:, 1], nodes[:, 0]]).ravel()
    # int x^2 = b^3 h / 12, int y^2 = b h^3 / 12
    expected = (2.0**3 + 2.0) / 12.0
    assert turn @ (mass(Body(nodes, np.arange(len(nodes))[None])) @ turn) == pytest.approx(expected, rel=1e-12)


# ---- marches that are not those of their file ----------------------------------------------------------------------


def _stated(scheme: str = "implicit-euler", **contact: Any) -> dict[str, Any]:
    massive = scheme != "sdirk2"
    bottom = {
        "normal": {"law": "adhesive", "stiffness": 9.0, "strength": 0.2, "softening": 2.0, "compression": 20.0},
        "friction": {"law": "coulomb", "coefficient": 0.4},
        **contact,
    }
    material = {"lame": [4.0, 4.0], "viscosity": [0.3, 0.4]}
    if massive:
        material |= {"density": 0.5, "branches": [{"lame": [1.0, 2.0], "time": 0.3}]}
    return {
        "mesh": {"rectangle": [1.0, 1.0], "cells": [2, 1]},
        "material": material,
        "loads": {"body": ["1.5 * sin(5 * t)", "2.5 * sin(7 * t)"]},
        "supports": {"left": "clamped"},
        "contact": {"bottom": bottom},
        "time": {"until": 0.7, "step": 0.1, "scheme": scheme, "inertia": massive},
        "output": {"every": 0.001},
    }  # fmt: skip


_MARCHED: dict[str, Path] = {}


def _marched(data: dict[str, Any], folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """March once for all tests of a problem; every test has files of its own."""
    from hemivar.cli import main

    text = dump(data)
    if text not in _MARCHED:
        (folder / "problem.toml").write_text(text)
        files = {"--json": "march.json", "--fields": "run.pvd"}
        words = [word for name, file in files.items() for word in (name, str(folder / file))]
        assert main(["march", str(folder / "problem.toml"), *words, "--quiet"]) == 0, capsys.readouterr()
        capsys.readouterr()
        _MARCHED[text] = folder / "kept"
        shutil.copytree(folder, _MARCHED[text])
    shutil.copytree(_MARCHED[text], folder, dirs_exist_ok=True)


def _examined(folder: Path) -> Verdict:
    verdict = Verdict()
    examine_march(folder, "problem.toml", "march.json", "run.pvd", verdict)
    return verdict


_SECANT = {"memory": [{"kind": "secant"}], "friction": {"law": "tresca", "bound": 0.1}}


def _bottom(name: str, value: Any) -> Callable[[dict[str, Any]], None]:
    return lambda data: data["contact"]["bottom"].update({name: value})


@pytest.mark.parametrize(
    ("data", "change"),
    [
        (_stated(), lambda d: d["material"].update(density=0.51)),
        (_stated(), lambda d: d["material"].update(viscosity=[0.3, 0.41])),
        (_stated(), lambda d: d["material"].update(branches=[{"lame": [1.0, 2.0], "time": 0.31}])),
        (_stated(), lambda d: d["loads"].update(body=["1.5 * sin(5 * t)", "2.5 * sin(7.01 * t)"])),
        (_stated(), _bottom("friction", {"law": "coulomb", "coefficient": 0.39})),
        (_stated(), _bottom("gap", 1e-3)),
        (_stated(), _bottom("damping", {"law": "compliance", "stiffness": 0.1})),
        (_stated(**_SECANT), _bottom("memory", [])),
        (_stated(friction={"law": "tresca", "bound": 0.1}), _bottom("friction", {"law": "tresca", "bound": 0.11})),
        pytest.param(
            _stated("newmark"), lambda d: d["time"].update(scheme={"name": "newmark", "gamma": 0.55, "beta": 0.3}),
            marks=pytest.mark.slow,
        ),
        (_stated("generalized-alpha"), lambda d: d["time"].update(scheme={"name": "generalized-alpha", "rho": 0.7})),
        pytest.param(_stated("midpoint"), lambda d: d["time"].update(scheme="newmark"), marks=pytest.mark.slow),
        (_stated("sdirk2"), _bottom("friction", "none")),
    ],
)  # fmt: skip
def test_a_march_of_another_problem_is_found(
    data: dict[str, Any], change: Callable[[dict[str, Any]], None], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    _marched(data, tmp_path, capsys)
    right = _examined(tmp_path)
    assert not right.wrong
    assert "laws" in right.examined
    other = copy.deepcopy(data)
    change(other)
    (tmp_path / "problem.toml").write_text(dump(other))
    assert _examined(tmp_path).wrong


@pytest.mark.parametrize(
    ("column", "factor", "complaint"),
    [("margin", 1.01, "margin"), ("viscous", 1.001, "viscous"), ("work", 0.999, "work"), ("kinetic", 1.001, "kinetic")],
)
def test_a_spoilt_table_of_a_march_is_found(
    column: str, factor: float, complaint: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    import json

    _marched(_stated(**_SECANT), tmp_path, capsys)
    record = json.loads((tmp_path / "march.json").read_text())
    record["table"][column] = [None if v is None else factor * v for v in record["table"][column]]
    (tmp_path / "march.json").write_text(json.dumps(record))
    assert any(complaint in wrong for wrong in _examined(tmp_path).wrong)
