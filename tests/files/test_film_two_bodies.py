"""Results of two bodies that touch each other: forces, files and pictures show both sides."""

from __future__ import annotations

import json
from pathlib import Path

import meshio
import numpy as np
import pytest

import hemivar as hv
from hemivar.bounds import goal_named
from hemivar.errors import ProblemError
from hemivar.evolution import Evolution, march
from hemivar.fem.reactions import internal_forces, nodal_contact_forces
from hemivar.files import read_problem, write_problem, write_vtu
from hemivar.files.film import film_of, read_film
from hemivar.report.film_pictures import FilmColour, PlanePicture

PRESS, SHIFT = 0.02, 0.01


def blocks(slave: str | None = None, gap: float = 0.0, held: bool = False, order: int = 1) -> hv.ContactProblem:
    """A block pressed on a wider one and shifted; nodes do not match, and the boundary below hangs over."""
    upper, lower = hv.rectangle((1.0, 0.5), (6, 3), origin=(0.2, 0.5 + gap)), hv.rectangle((1.4, 0.5), (7, 3))
    supports = {"lower:bottom": hv.Clamped(), "upper:top": hv.Fixed(x=0.0 if held else SHIFT, y=-PRESS - gap)}
    return hv.ContactProblem(
        hv.Mesh.assembled({"upper": upper, "lower": lower}),
        hv.Material.young(10.0, 0.3),
        {"upper:bottom": hv.Contact(hv.Signorini(), hv.Tresca(0.05), against="lower:top", slave=slave)},
        supports | ({"upper:left": hv.Roller()} if held else {}),
        order=order,
    )


@pytest.mark.parametrize("slave", ["upper:bottom", "lower:top"])
@pytest.mark.parametrize("order", [1, 2])
def test_forces_on_both_sides_are_opposite_and_balance_each_body(slave: str, order: int) -> None:
    problem = blocks(slave, order=order)
    solution = hv.solve(problem).raise_for_status()
    upper, lower = (solution.contact_forces[name] for name in ("upper:bottom", "lower:top"))
    np.testing.assert_allclose(upper, -lower, rtol=0.0, atol=1e-14)
    assert upper[1] > 0.0
    assert solution.normal_force == pytest.approx(upper[1], rel=1e-12)
    np.testing.assert_allclose(solution.reactions["upper:top"], -upper, atol=1e-12)
    np.testing.assert_allclose(solution.reactions["lower:bottom"], -lower, atol=1e-12)
    forces = nodal_contact_forces(solution.problem, solution.multiplier)
    inner = internal_forces(problem, solution.displacement, np.arange(problem.mesh.number_of_cells))
    held = np.abs(solution.problem.field.basis.toarray()).sum(axis=1).reshape(forces.shape) == 0.0  # type: ignore[union-attr]
    np.testing.assert_allclose(np.where(held, 0.0, inner - forces), 0.0, atol=1e-12)


def test_where_the_side_with_points_is_held_the_other_feels_what_its_body_does() -> None:
    """A roller holds the left end of the slave along x: friction there acts on the master alone, and on the roller."""
    solution = hv.solve(blocks("upper:bottom", held=True)).raise_for_status()
    np.testing.assert_allclose(sum(solution.reactions.values()), 0.0, atol=1e-12)
    ones = np.ones(solution.contact.shape)
    forces = solution.problem.field.basis.T @ nodal_contact_forces(solution.problem, ones).ravel()  # type: ignore[union-attr]
    np.testing.assert_allclose(forces, -solution.contact.force(ones), atol=1e-13)


def test_columns_and_goals_do_not_depend_on_the_side_with_the_points() -> None:
    one, other = (hv.solve(blocks(slave)).raise_for_status() for slave in ("upper:bottom", "lower:top"))
    np.testing.assert_allclose(one.contact_forces["upper:bottom"], other.contact_forces["upper:bottom"], rtol=0.05)
    np.testing.assert_allclose(one.friction_force, other.friction_force, rtol=0.05)
    for name in ("upper:bottom", "lower:top"):
        assert goal_named(blocks(), f"contact.{name}.force.x").boundary == name
    with pytest.raises(ProblemError, match=r"contact\.lower:top\.force"):
        goal_named(blocks(), "contact.lower:up.force")


def test_records_and_summaries_name_both_sides(tmp_path: Path) -> None:
    solution = hv.solve(blocks()).raise_for_status()
    record = json.loads(solution.to_json(tmp_path / "found.json").read_text())
    assert set(record["contact_forces"]) == {"upper:bottom", "lower:top"}
    assert solution.contact.places == ("upper:bottom against lower:top",)
    said = str(solution.summary())
    assert "contact forces    upper:bottom (" in said
    assert "                  lower:top (" in said
    assert "max penetration   0\n" in said, "rounding is no penetration"


def test_files_for_paraview_have_both_sides(tmp_path: Path) -> None:
    solution = hv.solve(blocks("upper:bottom")).raise_for_status()
    body, contact = write_vtu(solution, tmp_path / "body.vtu")
    assert contact is not None
    read, mesh = meshio.read(body), solution.problem.field.mesh  # type: ignore[union-attr]
    assert set(np.unique(read.cell_data["part"][0])) == {0, 1}
    data, on = read.point_data, {name: np.unique(mesh.boundaries[name]) for name in ("upper:bottom", "lower:top")}
    slave, master = on["upper:bottom"], on["lower:top"]
    master = master[data["boundary"][master] >= 0]
    assert len(master) == 6, "nodes 0.2 and 1.2 are ends of what is covered"
    assert (data["state"][slave] >= 0).all()
    assert (data["state"][master] == -1).all()
    assert data["pressure"][slave].min() <= data["pressure"][master].min()
    assert data["pressure"][master].max() <= data["pressure"][slave].max()
    assert (data["contact_force"][slave, 1] > 0.0).all()
    assert (data["contact_force"][master, 1] < 0.0).all()
    assert len(meshio.read(contact).cells[0].data) == 6 + 7


def test_constant_pressure_is_constant_on_both_sides(tmp_path: Path) -> None:
    """Bodies without lateral strain: the pressure is the strain of both in series."""
    upper, lower = hv.rectangle((1.0, 0.5), (6, 2), origin=(0.0, 0.5)), hv.rectangle((1.0, 0.5), (4, 2))
    problem = hv.ContactProblem(
        hv.Mesh.assembled({"upper": upper, "lower": lower}),
        hv.Material.young(10.0, 0.0),
        {"upper:bottom": hv.Contact(hv.Signorini(), against="lower:top")},
        {
            "lower:bottom": hv.Roller(), "upper:top": hv.Fixed(y=-PRESS),
            "upper:left": hv.Roller(), "lower:left": hv.Roller(),
        },
    )  # fmt: skip
    read = meshio.read(write_vtu(hv.solve(problem).raise_for_status(), tmp_path / "body.vtu")[0])
    on = read.point_data["boundary"] >= 0
    assert np.count_nonzero(on) == 7 + 5
    np.testing.assert_allclose(read.point_data["pressure"][on], 10.0 * PRESS, rtol=1e-10)


def test_pictures_draw_both_bodies_and_no_foundation(tmp_path: Path) -> None:
    figure = hv.solve(blocks()).raise_for_status().plot()
    said = [text.get_text() for axes in figure.axes for text in axes.get_legend().get_texts()]  # type: ignore[union-attr]
    assert "foundation" not in said
    assert "body at rest" in said
    both = [text.get_text() for text in hv.report.plot_problem(blocks()).axes[0].get_legend().get_texts()]  # type: ignore[union-attr]
    assert both[-2:] == ["contact: upper:bottom", "contact: lower:top"]


def test_bodies_apart_are_drawn_where_they_are() -> None:
    """Blown up with the displacement, the gap would close before the bodies touch."""
    picture = hv.report.deformed.DeformedBody.of(hv.solve(blocks(gap=0.1)).raise_for_status(), "auto")
    assert picture.factor == 1.0
    assert hv.report.deformed.DeformedBody.of(hv.solve(blocks()).raise_for_status(), "auto").factor > 1.0


def test_films_are_those_of_their_files_and_draw_no_foundation(tmp_path: Path) -> None:
    history = march(Evolution(blocks(), inertia=False), 0.2, step=0.1)
    history.write(tmp_path / "run.pvd")
    films = film_of(history), read_film(tmp_path / "run.pvd")
    for film in films:
        assert film.paired is not None
        assert film.paired.all()
        picture = PlanePicture(film, [0, 1], 1.0, ("", ""), FilmColour.NONE)
        picture.show(film.frame(1))
        assert picture.foundation.artists == []
    for of in ("places", "moved", "force"):
        np.testing.assert_allclose(*(getattr(film.frame(1), of) for film in films), atol=1e-12)


def test_problem_files_say_what_touches_what(tmp_path: Path) -> None:
    problem = blocks("lower:top")
    path = write_problem(problem, tmp_path / "pair.toml")
    again = read_problem(path)
    assert again.contact["upper:bottom"].against == "lower:top"
    assert again.pair("upper:bottom") == ("lower:top", "upper:bottom")
    np.testing.assert_allclose(hv.solve(again).displacement, hv.solve(problem).displacement, atol=1e-14)
