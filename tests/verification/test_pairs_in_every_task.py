"""Two bars with glue between them in each task: paths, limit loads, studies, sweeps, fits, marches, films, the studio.

Without lateral strain the bars are two springs in series with the law of the glue: ``d = C F + w`` and ``F = t(w)``.
"""

from __future__ import annotations

import csv
import json
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest

import hemivar as hv
from hemivar import cli
from hemivar.basics.types import Array
from hemivar.branches import follow_path
from hemivar.evolution import Evolution, march
from hemivar.fem import LoadLine
from hemivar.files.changes import read_change
from hemivar.files.film import film_of
from hemivar.files.problem_file import parse_problem_file
from hemivar.identification import FitOptions, Measurements
from hemivar.studio.jobs import Bench
from hemivar.studio.requests import Request

STIFF, STRENGTH, SOFTENING = 40.0, 0.8, 16.0
#: Openings at which the glue is strongest, and from which on it is broken.
BEGINS = STRENGTH / STIFF
ENDS = BEGINS + STRENGTH / SOFTENING
GLUE = {"stiffness": STIFF, "strength": STRENGTH, "softening": SOFTENING}
YOUNG = {"upper": 20.0, "lower": 40.0}
#: Opening of both bars per force, heights and width 1: less than 1/SOFTENING would not snap.
SOFT = 1.0 / YOUNG["upper"] + 1.0 / YOUNG["lower"]

FILE = """
[mesh.upper]
rectangle = [1.0, 1.0]
cells = [2, 1]
shift = [0.0, 1.0]

[mesh.lower]
rectangle = [1.0, 1.0]
cells = [3, 1]

[material.regions.upper]
young = 20.0
poisson = 0.0

[material.regions.lower]
young = 40.0
poisson = 0.0

[supports]
"lower:bottom" = "clamped"
"upper:top" = { displacement = [0.0, 0.04] }

[contact."upper:bottom"]
against = "lower:top"
normal = { law = "adhesive", stiffness = 40.0, strength = 0.8, softening = 16.0 }
"""


def traction(w: Array) -> Array:
    return np.where(w <= BEGINS, STIFF * w, np.clip(STRENGTH - SOFTENING * (w - BEGINS), 0.0, None))


def bars(
    pull: float = 0.1, glue: Mapping[str, float] = GLUE, slave: str | None = None, unit: float = 1.0
) -> hv.ContactProblem:
    """The bars, their upper end pulled; lengths in units of another size, forces per area as they are."""
    mesh = hv.Mesh.assembled(
        {
            "upper": hv.rectangle((unit, unit), (2, 1), origin=(0.0, unit)),
            "lower": hv.rectangle((unit, unit), (3, 1)),
        }
    )
    law = hv.Adhesive(glue["stiffness"] / unit, glue["strength"], glue["softening"] / unit)
    return hv.ContactProblem(
        mesh,
        hv.Material.by_region({name: hv.Material.young(E, 0.0) for name, E in YOUNG.items()}),
        {"upper:bottom": hv.Contact(law, against="lower:top", slave=slave)},
        {"lower:bottom": hv.Clamped(), "upper:top": hv.Fixed(x=0.0, y=pull * unit)},
    )


@pytest.mark.parametrize("slave", ["upper:bottom", "lower:top"])
@pytest.mark.parametrize("unit", [1.0, 1e3])
def test_a_path_snaps_back_where_the_bars_are_softer_than_the_glue(slave: str, unit: float) -> None:
    assert SOFT * SOFTENING > 1.0
    line = LoadLine.of(bars(0.1, slave=slave, unit=unit))
    path = follow_path(line.loaded, unloaded=line.unloaded)
    assert path.reached_end, path.ended
    opening = -path.local[:, :, 0] / unit
    even = np.ptp(opening, axis=1) <= 1e-9
    assert even.sum() >= 4
    w = opening[even, 0]
    np.testing.assert_allclose(0.1 * path.load_factor[even], SOFT * traction(w) + w, atol=1e-10)
    turns = [0.1 * fold.load_factor for fold in path.folds]
    assert turns[0] == pytest.approx(SOFT * STRENGTH + BEGINS, rel=1e-9)
    assert path.first_instability == pytest.approx((SOFT * STRENGTH + BEGINS) / 0.1, rel=1e-9)


def test_the_limit_load_is_strength_times_area() -> None:
    pulled = bars()
    supports = {"lower:bottom": hv.Clamped()} | {f"{part}:left": hv.Fixed(x=0.0) for part in YOUNG}
    by_force = hv.ContactProblem(
        pulled.mesh, pulled.material, pulled.contact, supports, tractions={"upper:top": (0.0, 1.0)}
    )
    path = follow_path(LoadLine.of(by_force).loaded, (0.0, 3.0))
    assert path.limit_load == pytest.approx(STRENGTH, rel=1e-9)


def test_a_study_of_meshes_is_exact_on_each() -> None:
    """The strain of each bar is constant, so every mesh has the exact force."""
    found = hv.study(bars(0.04), 3)
    pull = 0.04 / (SOFT + 1.0 / STIFF)
    for level in found.levels:
        np.testing.assert_allclose(level.solution.pressure, -pull, rtol=1e-9)
        np.testing.assert_allclose(level.solution.contact_forces["lower:top"], [0.0, pull], atol=1e-9)


@pytest.fixture
def file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "bars.toml"
    path.write_text(FILE)
    return path


def test_a_sweep_over_a_name_with_a_colon(file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Margins of two springs in series: ``1 - softening C``; with three solutions where the glue may be broken."""
    key = "contact.upper:bottom.normal.softening"
    assert cli.main(["sweep", str(file), "--set", f"{key}=4:12:3", "--csv", "a.csv"]) == 0
    rows = list(csv.DictReader(Path("a.csv").read_text().splitlines()))
    assert [float(row[key]) for row in rows] == [4.0, 8.0, 12.0]
    np.testing.assert_allclose([float(row["margin"]) for row in rows], 1.0 - SOFT * np.array([4.0, 8.0, 12.0]))
    assert [row["solutions"] for row in rows] == ["1", "1", "1"]


def test_commands_tell_of_both_sides(file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pull = 0.04 / (SOFT + 1.0 / 20.0)
    change = ["--set", "contact.upper:bottom.normal.stiffness=20", "--set", "contact.upper:bottom.normal.strength=2"]
    assert cli.main(["solve", str(file), *change, "--json", "a.json"]) == 0
    out = capsys.readouterr().out
    assert "on lower:top against upper:bottom" in out
    told = json.loads(Path("a.json").read_text())
    np.testing.assert_allclose(told["contact_forces"]["upper:bottom"], [0.0, -pull], atol=1e-9)
    np.testing.assert_allclose(told["contact_forces"]["lower:top"], [0.0, pull], atol=1e-9)
    ends = ["--end-at", "opening:upper:bottom=0.008"]
    assert cli.main(["path", str(file), *ends, "--json", "path.json"]) == 0
    end = json.loads(Path("path.json").read_text())["points"][-1]
    assert end["load_factor"] * 0.04 == pytest.approx(0.008 + SOFT * STIFF * 0.008, rel=1e-9)
    file.write_text(f"{FILE}\n[time]\nuntil = 1.0\nstep = 0.5\n")
    moved = '"upper:top".displacement=[0.0, "0.02*t"]'
    assert cli.main(["march", str(file), "--set", f"supports.{moved}", "--table", "march.csv"]) == 0
    rows = list(csv.DictReader(Path("march.csv").read_text().splitlines()))
    force = -0.02 * np.array([0.0, 0.5, 1.0]) / (SOFT + 1.0 / STIFF)
    np.testing.assert_allclose([float(row["normal_force"]) for row in rows], force, atol=1e-9)


def test_the_glue_is_found_from_the_curve_of_a_pair() -> None:
    """Forces in closed form, on the softening branch as well."""
    soft_glue = GLUE | {"softening": 8.0}

    def state(values: Mapping[str, float]) -> hv.ContactProblem:
        return bars(values["pull"], soft_glue | {key: values[key] for key in soft_glue})

    pulls = np.array([0.01, 0.06, 0.085, 0.1, 0.11])
    peak = SOFT * STRENGTH + BEGINS
    falls = (STRENGTH + 8.0 * BEGINS - 8.0 * pulls) / (1.0 - 8.0 * SOFT)
    force = np.where(pulls <= peak, pulls / (SOFT + 1.0 / STIFF), falls)
    assert (force > 0.0).all()
    measured = Measurements({"pull": pulls}, {"contact.lower:top.force.y": force})
    ranges = {key: (0.5 * value, 2.0 * value) for key, value in soft_glue.items()}
    found = hv.identification.identify(state, measured, ranges, FitOptions(starts=1))
    for key, value in soft_glue.items():
        assert found.value(key) == pytest.approx(value, rel=1e-6), key


def test_a_march_breaks_the_glue_and_its_film_shows_both_bars(tmp_path: Path) -> None:
    """Pulled evenly until nothing holds; the glue remembers its damage, and what it dissipates is its energy."""
    soft_glue = GLUE | {"softening": 8.0}
    stated = bars(0.0, soft_glue)
    supports = {"lower:bottom": hv.Clamped(), "upper:top": hv.Fixed(x=0.0, y=lambda x, t: 0.15 * t + 0.0 * x[:, 0])}
    problem = hv.ContactProblem(stated.mesh, stated.material, stated.contact, supports)
    history = march(Evolution(problem), 1.0, step=0.1)
    pulls = 0.15 * history.times
    peak, broken = SOFT * STRENGTH + BEGINS, BEGINS + STRENGTH / 8.0
    falls = np.clip((STRENGTH + 8.0 * BEGINS - 8.0 * pulls) / (1.0 - 8.0 * SOFT), 0.0, None)
    force = np.where(pulls <= peak, pulls / (SOFT + 1.0 / STIFF), np.where(pulls < broken, falls, 0.0))
    np.testing.assert_allclose(-history["normal_force"], force, atol=1e-9)
    assert history.ledger["memory"] == pytest.approx(0.5 * STRENGTH * broken, rel=1e-8)
    film = film_of(history)
    assert film.paired is not None
    assert film.paired.all()
    last = film.frame(len(film.times) - 1)
    np.testing.assert_allclose((film.points + last.displacement)[:, 1].max(), 0.15 + 2.0, atol=1e-9)


def test_the_studio_takes_changes_with_colons(file: Path) -> None:
    changed = parse_problem_file(FILE, changes=[read_change("contact.upper:bottom.normal.stiffness=20")])
    text = FILE.replace("stiffness = 40.0", "stiffness = 20.0")
    messages = list(Bench(file.parent).answer(Request("solve", 1, text), lambda: False))
    picture = next(one for one in messages if one.head["type"] == "picture")
    solution = hv.solve(changed.problem)
    np.testing.assert_allclose(picture.arrays["pressure"], solution.pressure, rtol=1e-9)
    shape = next(one for one in messages if one.head["type"] == "shape")
    (boundary,) = shape.head["boundaries"]  # type: ignore[misc]
    assert boundary["name"] == "upper:bottom"
    assert boundary["pair"]
    json.dumps([one.head for one in messages])
