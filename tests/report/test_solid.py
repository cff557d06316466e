"""Pictures of three-dimensional bodies show the numbers of the solution."""

import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.axes import Axes

from hemivar.errors import ProblemError
from hemivar.fem import discretize
from hemivar.gallery import survey_cube
from hemivar.laws import Signorini, SurveyLaw, Tresca
from hemivar.mechanics import Contact, Prescribed, Sphere
from hemivar.mesh import box
from hemivar.report import plot_contact, plot_solution, render_solution, save
from hemivar.report.solid_body import sharp_edges, viewing_direction
from hemivar.solvers import ContactState, solve

from .test_figures import texts


@pytest.fixture(scope="module")
def cube():
    """Some points stick and some slip."""
    return solve(discretize(survey_cube("5.1", 4))).raise_for_status()


def test_a_box_has_twelve_sharp_edges():
    mesh = box((1.0, 2.0, 3.0), (2, 3, 4))
    ends = mesh.points[sharp_edges(mesh)]
    assert np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1).sum() == pytest.approx(4 * (1 + 2 + 3))
    on_faces = [(np.isclose(ends[..., k], 0) | np.isclose(ends[..., k], k + 1)).all(axis=1) for k in range(3)]
    assert (np.sum(on_faces, axis=0) == 2).all()


def test_the_viewer_sees_the_contact_boundary(cube):
    assert viewing_direction(cube.problem)[2] < 0.0  # from below


def test_surface_is_that_of_the_deformed_body(cube, tmp_path):
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

    figure = plot_solution(cube, scale=2.0, title="A title", unit="mm", stress_unit="MPa")
    words = texts(figure)
    for expected in (
        "A title",
        "x (mm)",
        "z (mm)",
        "von Mises stress (MPa)",
        "displacement times 2",
        "stick (",
        "slip (",
    ):
        assert expected in words
    (surface,) = figure.findobj(Poly3DCollection)
    assert surface.get_array().shape == (6 * 4 * 4 * 2,)
    axes = figure.axes[0]
    moved = cube.problem.field.mesh.points + 2.0 * cube.displacement
    assert axes.get_zlim()[0] == pytest.approx(moved[:, 2].min())
    save(figure, tmp_path / "cube.png", dpi=40)


def test_many_facets_are_drawn_without_lines_between_them(cube, tmp_path, monkeypatch):
    from matplotlib.colors import to_hex
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

    monkeypatch.setattr("hemivar.report.solid_body.MANY_FACETS", 10)
    figure = plot_solution(cube)
    save(figure, tmp_path / "cube.png", dpi=40)
    (surface,) = figure.findobj(Poly3DCollection)
    colours = [to_hex(colour) for colour in surface.get_facecolor()]
    stress = surface.get_array()
    assert len(set(stress)) > 50
    assert sorted(colours) == sorted(to_hex(colour) for colour in surface.cmap(surface.norm(stress)))  # far ones first
    assert [to_hex(colour) for colour in surface.get_edgecolor()] == colours


def test_maps_show_pressure_states_and_slip(cube, tmp_path):
    from matplotlib.collections import PolyCollection
    from matplotlib.quiver import Quiver

    figure = plot_contact(cube, title="A title", unit="mm", stress_unit="MPa")
    words = texts(figure)
    slipping = cube.state == ContactState.SLIP
    for expected in (
        "A title: bottom", "pressure (MPa)", "friction, magnitude (MPa)", "penetration (mm)",
        f"slip ({np.count_nonzero(slipping)})", f"slip up to {np.linalg.norm(cube.slip, axis=1).max():.3g} mm",
    ):  # fmt: skip
        assert expected in words
    (quiver,) = figure.findobj(Quiver)
    u = cube.displacement[np.isclose(cube.problem.field.mesh.points[:, 2], 0.0)]
    along = u[np.linalg.norm(u[:, :2], axis=1) > 1e-9][:, :2]
    np.testing.assert_allclose(np.column_stack([quiver.U, quiver.V]), along, atol=1e-12)
    pressure = next(c for c in figure.findobj(PolyCollection) if c.get_array() is not None).get_array()
    assert len(pressure) == 2 * 4 * 4
    assert cube.pressure.min() <= pressure.min() <= pressure.max() <= cube.pressure.max()
    save(figure, tmp_path / "maps.png", dpi=40)


def test_maps_show_the_part_that_touches(tmp_path):
    block = replace(
        survey_cube("5.1", 12),
        contact={"bottom": Contact(Signorini(), Tresca(0.01), obstacle=Sphere((0.3, 0.6, -4.0), 4.0))},
        supports={"top": Prescribed((0.0, 0.0, -0.005))},
        body_force=(0.0, 0.0, 0.0),
    )
    solution = solve(discretize(block)).raise_for_status()
    figure = plot_contact(solution)
    assert "bottom, part that touches" in texts(figure)
    touching = solution.problem.points[solution.state != ContactState.OPEN][:, :2]
    width = np.ptp(touching, axis=0).max()
    assert 0.0 < width < 0.5
    for panel in figure.findobj(Axes):
        if panel.get_xlabel() == "x":
            for side, values in zip((panel.get_xlim(), panel.get_ylim()), touching.T, strict=True):
                assert side[0] < values.min() <= values.max() < side[1]
                assert side[1] - side[0] == pytest.approx(2.0 * width)
    save(figure, tmp_path / "maps.png", dpi=40)


def test_two_boundaries_and_a_slanted_one(cube, tmp_path):
    contact = Contact(SurveyLaw(0.3, 2.0), Tresca(0.5))
    turn = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))[0]
    turn *= np.linalg.det(turn)
    problem = survey_cube("5.1", 3)
    for change in (
        {"contact": {"bottom": contact, "right": contact}},
        {"mesh": problem.mesh.moved(turn)},
    ):
        solution = solve(discretize(replace(problem, **change)))
        save(plot_contact(solution), tmp_path / "maps.png", dpi=40)
        save(plot_solution(solution, scale="auto"), tmp_path / "body.png", dpi=40)


def test_rendering_with_pyvista(cube, tmp_path):
    """In its own process: a graphics library that cannot draw without a display may end it."""
    pytest.importorskip("pyvista")
    path = tmp_path / "new" / "cube.png"
    program = (
        "import sys\nimport hemivar as hv\nfrom hemivar.gallery import survey_cube\n"
        "from hemivar.report import render_solution\n"
        "solution = hv.solve(hv.discretize(survey_cube('5.1', 4)))\n"
        "render_solution(solution, sys.argv[1], scale='auto', size=(400, 300))"
    )
    done = subprocess.run([sys.executable, "-c", program, str(path)], capture_output=True, timeout=120, check=False)
    if done.returncode < 0:
        pytest.skip("pyvista cannot draw off screen here")
    assert done.returncode == 0, done.stderr.decode()
    from matplotlib.image import imread

    picture = imread(path)
    assert picture.shape[:2] == (300, 400)
    assert len(np.unique(picture.reshape(-1, picture.shape[2]), axis=0)) > 50  # not blank


def test_rendering_says_what_it_cannot_do(cube, plane, tmp_path, monkeypatch):
    with pytest.raises(ProblemError, match=r"bodies in 3D.*plot_solution"):
        render_solution(plane, tmp_path / "plane.png")
    with pytest.raises(ProblemError, match=r"\.png"):
        render_solution(cube, tmp_path / "cube.svg")
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    with pytest.raises(ProblemError, match=r"hemivar\[3d\]"):
        render_solution(cube, tmp_path / "cube.png")
