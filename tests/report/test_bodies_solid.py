"""Pictures of three-dimensional bodies show the numbers of the solution."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from matplotlib.axes import Axes

from hemivar.fem import discretize
from hemivar.gallery import survey_cube
from hemivar.laws import Signorini, ThresholdCompliance, Tresca
from hemivar.mechanics import Contact, Prescribed, Sphere
from hemivar.mesh import box
from hemivar.report import plot_contact, plot_solution, save
from hemivar.report.bodies import sharp_edges, viewing_direction
from hemivar.solvers import Solution, TangentialState, solve

from .test_picture_figures import texts


@pytest.fixture(scope="module")
def cube() -> Solution:
    """Some points stick and some slip."""
    return solve(discretize(survey_cube("5.1", 4))).raise_for_status()


def test_a_box_has_twelve_sharp_edges() -> None:
    mesh = box((1.0, 2.0, 3.0), (2, 3, 4))
    ends = mesh.points[sharp_edges(mesh)]
    assert np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1).sum() == pytest.approx(4 * (1 + 2 + 3))
    on_faces = [(np.isclose(ends[..., k], 0) | np.isclose(ends[..., k], k + 1)).all(axis=1) for k in range(3)]
    assert (np.sum(on_faces, axis=0) == 2).all()


def test_the_viewer_sees_the_contact_boundary(cube: Solution) -> None:
    assert viewing_direction(cube.problem)[2] < 0.0  # from below


def test_surface_is_that_of_the_deformed_body(cube: Solution, tmp_path: Path) -> None:
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

    figure = plot_solution(cube, scale=2.0, title="A title", unit="mm", stress_unit="MPa")
    words = texts(figure)
    for expected in (
        "A title",
        "x (mm)",
        "z (mm)",
        "von Mises stress (MPa)",
        "displacement times 2",
        "contact, stick (",
        "contact, slip (",
    ):
        assert expected in words
    (surface,) = figure.findobj(Poly3DCollection)
    assert surface.get_array().shape == (6 * 4 * 4 * 2,)
    axes = figure.axes[0]
    moved = cube.problem.field.mesh.points + 2.0 * cube.displacement
    assert axes.get_zlim()[0] == pytest.approx(moved[:, 2].min())
    save(figure, tmp_path / "cube.png", dpi=40)


def test_many_facets_are_drawn_without_lines_between_them(
    cube: Solution, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from matplotlib.colors import to_hex
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

    monkeypatch.setattr("hemivar.report.drawn_body.MANY_CELLS", 10)
    figure = plot_solution(cube)
    save(figure, tmp_path / "cube.png", dpi=40)
    (surface,) = figure.findobj(Poly3DCollection)
    colours = [to_hex(colour) for colour in surface.get_facecolor()]
    stress = surface.get_array()
    assert len(set(stress)) > 50
    assert sorted(colours) == sorted(to_hex(colour) for colour in surface.cmap(surface.norm(stress)))  # far ones first
    assert [to_hex(colour) for colour in surface.get_edgecolor()] == colours


def test_maps_show_pressure_states_and_slip(cube: Solution, tmp_path: Path) -> None:
    from matplotlib.collections import TriMesh
    from matplotlib.quiver import Quiver

    figure = plot_contact(cube, title="A title", unit="mm", stress_unit="MPa")
    words = texts(figure)
    slipping = cube.tangential_state == TangentialState.SLIP
    for expected in (
        "A title: bottom", "pressure (MPa)", "friction, magnitude (MPa)", "penetration (mm)",
        f"contact, slip ({np.count_nonzero(slipping)})", f"slip up to {np.linalg.norm(cube.slip, axis=1).max():.3g} mm",
    ):  # fmt: skip
        assert expected in words
    (quiver,) = figure.findobj(Quiver)
    u = cube.displacement[np.isclose(cube.problem.field.mesh.points[:, 2], 0.0)]
    along = u[np.linalg.norm(u[:, :2], axis=1) > 1e-9][:, :2]
    np.testing.assert_allclose(np.column_stack([quiver.U, quiver.V]), along, atol=1e-12)
    pressure = next(c for c in figure.findobj(TriMesh) if c.get_array() is not None).get_array()
    assert len(pressure) == 3 * 2 * 4 * 4  # the corners of each triangle
    assert cube.pressure.min() <= pressure.min() <= pressure.max() <= cube.pressure.max()
    save(figure, tmp_path / "maps.png", dpi=40)


def test_maps_show_the_part_that_touches(tmp_path: Path) -> None:
    block = replace(
        survey_cube("5.1", 12),
        contact={"bottom": Contact(Signorini(), Tresca(0.01), obstacle=Sphere((0.3, 0.6, -4.0), 4.0))},
        supports={"top": Prescribed((0.0, 0.0, -0.005))},
        body_force=(0.0, 0.0, 0.0),
    )
    solution = solve(discretize(block)).raise_for_status()
    figure = plot_contact(solution)
    assert "bottom, part that touches" in texts(figure)
    touching = solution.problem.contact.points[solution.states.closed][:, :2]
    width = np.ptp(touching, axis=0).max()
    assert 0.0 < width < 0.5
    for panel in figure.findobj(Axes):
        if panel.get_xlabel() == "x":
            for side, values in zip((panel.get_xlim(), panel.get_ylim()), touching.T, strict=True):
                assert side[0] < values.min() <= values.max() < side[1]
                assert side[1] - side[0] == pytest.approx(2.0 * width)
    save(figure, tmp_path / "maps.png", dpi=40)


def test_maps_of_two_boundaries() -> None:
    """Each is seen along its own normal, and shows its own values."""
    contact = Contact(ThresholdCompliance(0.3, 2.0), Tresca(0.5))
    problem = replace(survey_cube("5.1", 3), contact={"bottom": contact, "right": contact})
    solution = solve(discretize(problem))
    figure = plot_contact(solution)
    labels = [(panel.get_xlabel(), panel.get_ylabel()) for panel in figure.findobj(Axes) if panel.get_xlabel()]
    assert labels == [("x", "y")] * 4 + [("y", "z")] * 4
    words = texts(figure)
    for name in ("bottom", "right"):
        assert name in words
        for kind, here in solution.on(name).states.present.items():
            assert f"{kind.label} ({np.count_nonzero(here)})" in words
    assert "bonded" not in words


def test_maps_of_a_slanted_boundary() -> None:
    """Turning the body turns nothing in the maps but their names: areas and pressures stay."""
    from matplotlib.collections import TriMesh

    turn = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))[0]
    turn *= np.linalg.det(turn)
    straight = survey_cube("5.1", 3)
    turned = replace(straight, mesh=straight.mesh.moved(turn), body_force=tuple(turn @ np.array(straight.body_force)))
    shown = []
    for problem in (straight, turned):
        figure = plot_contact(solve(discretize(problem)))
        (first, *_) = (part for part in figure.findobj(TriMesh) if part.get_array() is not None)
        corners = np.array([path.vertices[:3] for path in first.get_paths()])
        sides = corners[:, 1:] - corners[:, :1]
        shown.append((np.sort(first.get_array()), 0.5 * abs(np.linalg.det(sides)).sum()))
    np.testing.assert_allclose(shown[0][0], shown[1][0], atol=1e-9)
    assert shown[0][1] == pytest.approx(shown[1][1]) == pytest.approx(1.0)
    axis_names = {panel.get_xlabel() for panel in figure.findobj(Axes)} | {p.get_ylabel() for p in figure.findobj(Axes)}
    directions = [
        [float(part) for part in name.removeprefix("along (").removesuffix(")").split(", ")]
        for name in sorted(axis_names)
        if name.startswith("along ")
    ]
    assert len(directions) == 2
    np.testing.assert_allclose(np.array(directions) @ np.array(directions).T, np.eye(2), atol=0.02)
    np.testing.assert_allclose(np.array(directions) @ turn[:, 2], 0.0, atol=0.02)  # both in the turned plane z = 0


def test_no_friction_has_a_scale_without_numbers() -> None:
    """Around zero a scale would run from -0.1 to 0.1, for a magnitude."""
    problem = replace(survey_cube("5.1", 3), contact={"bottom": Contact(ThresholdCompliance(0.3, 2.0))})
    figure = plot_contact(solve(discretize(problem)))
    (bar,) = (panel for panel in figure.findobj(Axes) if panel.get_ylabel() == "friction, magnitude")
    figure.draw_without_rendering()
    assert [label.get_text() for label in bar.get_yticklabels()] == ["0 everywhere"]
    assert bar.get_ylim()[0] == 0.0
