"""The two states of contact points, told apart at 1e-9 of the largest displacement and multiplier."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import meshio
import numpy as np
import pytest

import hemivar as hv
from hemivar.files import solution_record
from hemivar.files.film import read_film
from hemivar.files.snapshot import moving_states
from hemivar.solvers.contact_states import KINDS, state_words
from tests import bodies
from tests.solvers.test_contact_state import (
    BONDED,
    CONTACT,
    DEBONDED,
    FREE,
    GLUE,
    OPEN,
    SLIP,
    SOFTENING,
    springs,
)


def test_five_glued_points_at_the_friction_bound_slip_and_are_bonded() -> None:
    loads = np.column_stack([np.full(5, -1.0), np.full(5, 3.0)])
    found = hv.solve(springs(hv.laws.ContactLaw(GLUE, hv.Tresca(0.5)), loads)).raise_for_status()
    np.testing.assert_allclose(found.friction, -0.5)
    assert found.normal_state.tolist() == [BONDED] * 5
    assert found.tangential_state.tolist() == [SLIP] * 5
    assert state_words(*found.states.counts) == "5 bonded; 5 slip"
    assert "5 points: 5 bonded; 5 slip" in repr(found)
    contact = solution_record(found)["contact"]
    assert contact["normal_state"] == ["bonded"] * 5  # type: ignore[index]
    assert contact["tangential_state"] == ["slip"] * 5  # type: ignore[index]
    assert found.contact_length == 5.0


def column(pulled: list[float], contact: hv.Contact, **more: object) -> hv.Evolution:
    """A spring of stiffness 100 whose top is where it is told to be at t = 0, 1, 2, ..."""

    def top(x: np.ndarray, t: float) -> np.ndarray:
        return np.full(len(x), np.interp(t, np.arange(len(pulled)), pulled))

    problem = bodies.column(contact, 100.0, top=hv.Fixed(y=top))
    return hv.Evolution(problem)


def test_glue_with_a_memory_stays_softened_and_broken(tmp_path: Path) -> None:
    """Pulled beyond the peak, let go, then off: irreversible glue is not bonded again below its largest opening."""
    pulled = column([0.0, 0.3, 1.5, 0.3, 3.0, 1.0, -0.1], hv.Contact(GLUE, memory=(hv.laws.Secant(),)))
    found = hv.march(pulled, 6.0, step=0.5, save=hv.evolution.Save(every=1.0))
    assert found.finished
    largest = 145.0 / 98.0  # 100 (1.5 - w) = 5 - 2 w
    secant = (5.0 - 2.0 * largest) / largest
    assert found.frames[3].local[:, 0] == pytest.approx(-0.3 * 100.0 / (100.0 + secant))
    film = read_film(found.write(tmp_path / "run.pvd")[0])
    expected = (BONDED, SOFTENING, SOFTENING, DEBONDED, DEBONDED, CONTACT)
    for number, state in enumerate(expected, start=1):
        states = moving_states(found.discrete, found.frames[number])
        assert states.normal.tolist() == [state] * 2
        assert states.tangential.tolist() == [FREE] * 2
        assert film.frame(number).states.numbers.tolist() == states.numbers.tolist()


def test_glue_without_a_memory_is_that_of_its_opening() -> None:
    elastic = hv.Contact(GLUE, memory=())
    found = hv.march(column([0.0, 0.3, 1.5, 0.3], elastic), 3.0, step=0.5, save=hv.evolution.Save(every=1.0))
    seen = [moving_states(found.discrete, frame).normal[0] for frame in found.frames[1:]]
    assert seen == [BONDED, SOFTENING, BONDED]


def test_a_bond_that_fades_softens_and_breaks() -> None:
    """Beneath its energy, 4 w^2 = 1e-3, it is whole."""
    bond = hv.Contact(hv.Signorini(), memory=(hv.laws.Bonding(4.0, 1e-3, 1e-3),))
    found = hv.march(column([0.0, 0.01, 0.2], bond), 2.0, step=0.5, save=hv.evolution.Save(every=1.0))
    frame = found.frames[-1]
    broken = replace(frame, multiplier=0.0 * frame.multiplier, memory={"0.bond": np.zeros(2)})
    seen = [moving_states(found.discrete, one).normal[0] for one in (*found.frames[1:], broken)]
    assert seen == [BONDED, SOFTENING, DEBONDED]


def test_a_point_above_a_foundation_that_has_crept_is_open() -> None:
    """It lies deeper than the foundation was at first, and not as deep as it has become."""
    crept = hv.Contact(hv.Compliance(20.0), hv.Tresca(0.1), memory=(hv.laws.ViscousFoundation(2.0),))
    found = hv.march(column([0.0, -0.3, -0.3, -0.02], crept), 3.0, step=0.5, save=hv.evolution.Save(every=1.0))
    assert (found.frames[-1].local[:, 0] > 0.01).all()
    assert [moving_states(found.discrete, frame).normal[0] for frame in found.frames[1:]] == [CONTACT, CONTACT, OPEN]


def test_points_at_midpoints_of_facets_have_states_that_there_are(tmp_path: Path) -> None:
    """A node between two facets has the states of one of them, not a mean of numbers that are names."""
    strip = bodies.strip(
        hv.Signorini(),
        (8, 2),
        size=(4.0, 1.0),
        lame=(40.0, 40.0),
        body_force=(0.0, -1.0),
        tractions={"right": (0.0, 2.0)},
        quadrature=hv.mechanics.Quadrature.MIDPOINT,
    )
    found = hv.solve(strip)
    assert set(found.states.codes.tolist()) == {0, 6}
    read = meshio.read(found.to_vtu(tmp_path / "strip.vtu")).point_data
    assert set(read["state"].tolist()) == {-1, 0, 6}
    assert set(read["tangential_state"].tolist()) == {-1, 0}


def test_films_read_files_with_and_without_the_second_state(tmp_path: Path) -> None:
    contact = hv.Contact(hv.Adhesive(8.0, 0.4, 4.0, 60.0), hv.Tresca(0.05))
    strip = bodies.strip(
        contact, (8, 2), size=(4.0, 1.0), lame=(40.0, 40.0), body_force=(0.0, -1.0), tractions={"right": (1.5, 1.6)}
    )
    found = hv.solve(strip)
    labels = [KINDS[number].label for number in found.states.numbers]
    assert {"contact, slip", "bonded, slip", "debonded"} <= set(labels)
    path = tmp_path / "run.pvd"
    path.write_text('<VTKFile><Collection><DataSet timestep="0" file="a.vtu"/></Collection></VTKFile>')
    for second in (True, False):
        grid = meshio.read(found.to_vtu(tmp_path / "a.vtu"))
        if not second:
            del grid.point_data["tangential_state"]
            grid.write(tmp_path / "a.vtu")
        frame = read_film(path).frame(0)
        order, others = np.argsort(frame.places[:, 0]), np.argsort(found.contact_table["x"][:, 0])
        expected = [labels[number] for number in others]
        if not second:
            expected = [label.replace("d, slip", "d").replace("softening, slip", "softening") for label in expected]
        assert [KINDS[number].label for number in frame.states.numbers[order]] == expected
