"""What glue has lost, point by point: closed forms of a point on springs, and where results say it."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np
import pytest

import hemivar as hv
from hemivar.files import write_csv, write_json, write_vtu
from hemivar.laws import BilinearCohesion, MixedMode, Signorini, Tresca
from tests.bodies import glued_plate
from tests.laws.coupled.test_opening_debonding import ENERGY, LAST, RATIO, STIFFNESS, STRENGTH, curve

#: Glue below and a plain foundation at the side.
BESIDE = {
    "bottom": hv.Contact(MixedMode(BilinearCohesion(STRENGTH, ENERGY, STIFFNESS), RATIO)),
    "right": hv.Contact(Signorini(), Tresca(0.4)),
}


def test_damage_is_drawn_and_the_pull_of_glue_is_peel() -> None:
    """The largest pull of a block that hangs on glue alone, with a panel for its damage."""
    mesh = hv.rectangle((1.0, 0.5), (8, 4))
    contact = {"bottom": hv.Contact(MixedMode(BilinearCohesion(STRENGTH, ENERGY, STIFFNESS), RATIO))}
    hanging = hv.ContactProblem(mesh, hv.Material.young(3000.0, 0.3), contact, body_force=(0.0, STRENGTH))
    solution = hv.solve(hanging).raise_for_status()
    assert (solution.pressure < 0.0).all()
    rows = dict(solution.summary().rows)
    assert float(rows["max peel"]) == pytest.approx(-solution.pressure.min(), rel=1e-5)
    assert "max pressure" not in rows
    figure = hv.report.plot_contact(hv.solve(glued_plate(BESIDE, (-60.0, 60.0))))
    assert [panel.get_ylabel() for panel in figure.axes if "damage" in panel.get_ylabel()] == ["damage"]


def test_results_say_it(tmp_path: Path) -> None:
    solution = hv.solve(glued_plate(BESIDE, (-60.0, 60.0)))
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
