"""What glue has lost, point by point: closed forms of a point on springs, and where results say it."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np
import pytest

import hemivar as hv
from hemivar.files import write_csv, write_json, write_vtu
from hemivar.laws import Adhesive, BilinearCohesion, ContactLaw, MixedMode, Signorini, Tresca

STRENGTH, ENERGY, STIFFNESS, RATIO = 30.0, 0.5, 1e4, 1.5
FIRST, LAST = STRENGTH / STIFFNESS, 2.0 * ENERGY / STRENGTH


def curve(rho: float) -> tuple[float, float, float]:
    """Traction, damage and dissipated energy of the bilinear curve, by hand."""
    if rho <= FIRST:
        return STIFFNESS * rho, 0.0, 0.0
    traction = max(STRENGTH * (LAST - rho) / (LAST - FIRST), 0.0)
    stored = 0.5 * traction * rho
    return traction, 1.0 - traction / (STIFFNESS * rho), ENERGY - 0.5 * traction * (LAST - rho) * (rho < LAST) - stored


@pytest.mark.parametrize("rho", [0.0, 0.5 * FIRST, FIRST, 2.0 * FIRST, 0.5 * LAST, LAST, 2.0 * LAST])
@pytest.mark.parametrize("angle", [0.0, 0.7, 0.5 * np.pi])
def test_mixed_mode_says_what_it_lost(rho: float, angle: float) -> None:
    law = MixedMode(BilinearCohesion(STRENGTH, ENERGY, STIFFNESS), RATIO).at(None)
    found = law.debonding(np.array([[-rho * np.cos(angle), rho * np.sin(angle) / RATIO]]))
    _, damage, dissipated = curve(rho)
    assert found["damage"][0] == pytest.approx(damage, abs=1e-12)
    assert found["dissipated"][0] == pytest.approx(dissipated, abs=1e-12)
    if rho > 0.0:
        assert found["mode_ratio"][0] == pytest.approx(np.sin(angle) ** 2, abs=1e-12)
    else:
        assert np.isnan(found["mode_ratio"][0])


@pytest.mark.parametrize("rho", [-1.0, 0.0, 0.5 * FIRST, 2.0 * FIRST, 0.5 * LAST, 2.0 * LAST])
def test_an_adhesive_says_what_it_lost(rho: float) -> None:
    law = ContactLaw(Adhesive(STIFFNESS, STRENGTH, compression=10.0, energy=ENERGY)).at(None)
    found = law.debonding(np.array([[-rho, 0.0]]))
    _, damage, dissipated = curve(max(rho, 0.0))
    assert found["damage"][0] == pytest.approx(damage, abs=1e-12)
    assert found["dissipated"][0] == pytest.approx(dissipated, abs=1e-12)
    assert "mode_ratio" not in found


def test_brittle_glue_loses_what_it_stored() -> None:
    found = ContactLaw(Adhesive(STIFFNESS, STRENGTH)).at(None).debonding(np.array([[-0.9 * FIRST], [-1.1 * FIRST]]))
    assert found["damage"] == pytest.approx([0.0, 1.0])
    assert found["dissipated"] == pytest.approx([0.0, 0.5 * STRENGTH * FIRST], abs=1e-12)


def glued() -> hv.ContactProblem:
    """A block with glue below and a plain foundation at its side."""
    return hv.ContactProblem(
        hv.rectangle((1.0, 0.5), (8, 4)),
        hv.Material.young(3000.0, 0.3),
        {
            "bottom": hv.Contact(MixedMode(BilinearCohesion(STRENGTH, ENERGY, STIFFNESS), RATIO)),
            "right": hv.Contact(Signorini(), Tresca(0.4)),
        },
        {"left": hv.Clamped()},
        tractions={"top": (-60.0, 60.0)},
    )


def test_results_say_it(tmp_path: Path) -> None:
    solution = hv.solve(glued())
    found = solution.debonding
    below = solution.contact.on("bottom")
    assert set(found) == {"damage", "dissipated", "mode_ratio"}
    assert np.isnan(found["damage"]).sum() == solution.contact.count - below.size
    assert found["damage"][below].max() > 0.0
    rho = np.hypot(np.maximum(-solution.local[below, 0], 0.0), RATIO * solution.local[below, 1])
    assert found["dissipated"][below] == pytest.approx([curve(one)[2] for one in rho], abs=1e-10)
    assert solution.on("bottom").debonding["damage"] == pytest.approx(found["damage"][below])
    assert solution.contact_table["damage"][below] == pytest.approx(found["damage"][below])
    record = json.loads(write_json(solution, tmp_path / "s.json").read_text())
    assert [record["contact"]["damage"][i] for i in below] == pytest.approx(found["damage"][below])
    rows = list(csv.DictReader(write_csv(solution, tmp_path / "s.csv").open()))
    assert [float(rows[i]["dissipated"]) for i in below] == pytest.approx(found["dissipated"][below])
    body, contact = write_vtu(solution, tmp_path / "s.vtu")
    for path in (body, contact):
        assert path is not None
        text = path.read_bytes()
        assert all(f'Name="{name}"'.encode() in text for name in found)
    assert "opening at most" in str(solution.summary()) + repr(solution) + str(solution)


def test_laws_without_glue_say_nothing() -> None:
    problem = hv.ContactProblem(
        hv.rectangle((1.0, 0.5), (4, 2)), hv.Material.young(3000.0, 0.3), {"bottom": hv.Contact(Signorini())},
        {"left": hv.Clamped()}, tractions={"top": (0.0, -1.0)},
    )  # fmt: skip
    solution = hv.solve(problem)
    assert solution.debonding == {}
    assert "damage" not in (solution.contact_table.dtype.names or ())


def test_the_summary_says_how_far_glue_is() -> None:
    """A stiff block is pulled off by more than the glue bears: the fracture energy is spent on its whole length.

    Nothing is glued on its right side, which moves on a wall that lies far away.
    """
    problem = hv.ContactProblem(
        mesh=hv.rectangle((2.0, 1.0), (4, 2)),
        material=hv.Material.lame(4e6, 4e6),
        supports={"top": hv.Fixed(x=0.0, y=2.0 * LAST)},
        contact={
            "bottom": hv.Contact(MixedMode(BilinearCohesion(STRENGTH, ENERGY, STIFFNESS), RATIO)),
            "right": hv.Contact(Signorini(), gap=100.0),
        },
    )
    rows = dict(hv.solve(problem).summary().rows)
    assert float(rows["max opening"]) == pytest.approx(2.0 * LAST, rel=1e-6)
    assert rows["damage"] == "at most 1"
    assert float(rows["dissipated"]) == pytest.approx(2.0 * ENERGY, rel=1e-9)
    assert rows["least opening"].startswith(rows["max opening"][:6])
