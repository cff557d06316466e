"""Figures are drawn for every kind of problem; the numbers in them are right."""

from __future__ import annotations

import itertools
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest
from matplotlib.text import Text
from PIL import Image

from hemivar.discrete import DiscreteProblem
from hemivar.errors import ProblemError
from hemivar.fem import discretize, von_mises
from hemivar.files import read_solution, write_vtu
from hemivar.gallery import beam, membrane_obstacle, survey, survey_cube
from hemivar.laws import (
    Adhesive,
    BilinearCohesion,
    Compliance,
    ContactLaw,
    CoulombBound,
    Friction,
    MixedMode,
    PenetrationBound,
    Signorini,
    Tresca,
)
from hemivar.mechanics import Clamped, Contact, ContactProblem
from hemivar.mesh import rectangle
from hemivar.report import Arrows, plot_contact, plot_errors, plot_history, plot_solution, save
from hemivar.report.bodies import painted, plot_problem
from hemivar.report.deformed import BodyColour, DeformedBody
from hemivar.report.drawn_body import mesh_lines
from hemivar.report.law_figures import law_captions
from hemivar.solvers import Controls, Solution, Status, solve
from hemivar.solvers.contact_states import KINDS
from tests import bodies
from tests.samples import sampled

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def texts(figure: Figure) -> str:
    """Everything that is written on a figure."""
    return " | ".join(item.get_text() for item in figure.findobj(Text))


@pytest.mark.parametrize("suffix", [".png", ".svg", ".pdf"])
def test_save_by_suffix(plane: Solution, tmp_path: Path, suffix: str) -> None:
    path = save(plot_solution(plane), tmp_path / "new" / f"figure{suffix}")
    start = path.read_bytes()[:5]
    assert start == {".png": b"\x89PNG\r", ".svg": b"<?xml", ".pdf": b"%PDF-"}[suffix]


def test_unknown_suffix_is_refused(plane: Solution, tmp_path: Path) -> None:
    with pytest.raises(ProblemError, match=r"\.png, \.svg or \.pdf"):
        save(plot_contact(plane), tmp_path / "figure.bmp")


def test_solution_names_its_data(plane: Solution) -> None:
    words = texts(plot_solution(plane, title="A title", note="a note", unit="mm"))
    for expected in (
        "A title",
        "a note",
        "x (mm)",
        "q_{max}",
        "= 10",
        "contact, stick (3)",
        "contact, slip (13)",
        "force per area on the body",
    ):
        assert expected in words


@pytest.mark.parametrize(("scale", "arrows"), sampled(itertools.product((0.5, 1.0), Arrows), 4))
def test_solution_with_curved_boundary(curved: Solution, arrows: Arrows, scale: float, tmp_path: Path) -> None:
    """States stand at the displaced contact points, and the forces with them."""
    from matplotlib.quiver import Quiver

    figure = plot_solution(curved, arrows=arrows, scale=scale)
    axes = figure.axes[0]
    marked = np.vstack([line.get_xydata() for line in axes.lines if line.get_linestyle() == "None"])
    places = displaced_points(curved, scale)
    np.testing.assert_allclose(marked[np.lexsort(marked.T)], places[np.lexsort(places.T)], atol=1e-12)
    quivers = axes.findobj(Quiver)
    assert len(quivers) == {Arrows.FORCE: 1, Arrows.COMPONENTS: 2, Arrows.NONE: 0}[arrows]
    for quiver in quivers:
        drawn = np.column_stack([quiver.U, quiver.V]) / quiver.scale
        off = [np.linalg.norm(quiver.XY + part * drawn - places, axis=1) for part in (0.0, 1.0)]
        assert np.minimum(*off).max() < 0.013 * np.linalg.norm(np.ptp(problem_points(curved), axis=0))
    shown = sum(np.linalg.norm(np.column_stack([q.U, q.V]), axis=1) ** 2 for q in quivers)
    if quivers:
        np.testing.assert_allclose(shown, np.linalg.norm(curved.multiplier, axis=1) ** 2, atol=1e-12)
    save(figure, tmp_path / "figure.png", dpi=40)


def problem_points(solution: Solution) -> np.ndarray:
    """Vertices at rest."""
    assert solution.problem.field is not None
    return solution.problem.field.mesh.points


def displaced_points(solution: Solution, scale: float) -> np.ndarray:
    """Contact points displaced, by the interpolated displacement."""
    from hemivar.fem import interpolate

    points = solution.problem.contact.points
    assert points is not None
    problem = solution.problem.origin
    assert problem is not None
    if problem.quadrature == "midpoint":  # the displacement of a facet is the mean of its ends
        bottom = problem.mesh.boundaries["bottom"]
        middle = problem.mesh.points[bottom].mean(axis=1)
        order = np.array([int(np.argmin(np.linalg.norm(middle - point, axis=1))) for point in points])
        return points + scale * solution.displacement[bottom[order]].mean(axis=1)
    return points + scale * interpolate(problem, solution.displacement, points)


def test_auto_scale_makes_small_displacements_visible(plane: Solution, curved: Solution) -> None:
    body = DeformedBody.of(plane, "auto")
    largest = np.linalg.norm(plane.displacement, axis=1).max()
    assert 0.04 < body.factor * largest <= 0.1
    assert body.factor in (0.5, 1.0, 2.0)
    assert DeformedBody.of(curved, "auto").factor == 1.0  # the gap varies


@pytest.mark.parametrize(("gap", "factor"), [(0.03, 2.0), (0.004, 20.0)])
def test_auto_scale_leaves_an_even_gap_in_the_picture(gap: float, factor: float) -> None:
    """A body of size 1 that hardly moves, above ground that would be drawn at ``factor gap``: at most a tenth."""
    problem = bodies.square(Contact(Signorini(), gap=gap), 2, supports={"top": Clamped()}, body_force=(0.0, -1e-4))
    assert DeformedBody.of(solve(discretize(problem)), "auto").factor == factor


def test_contact_is_drawn_in_order_along_the_boundary(curved: Solution) -> None:
    """Values follow the arc length, and belong to their points."""
    upper, _, lower, _ = plot_contact(curved).axes
    points = curved.problem.contact.points
    assert points is not None
    along = np.argsort(points[:, 0])
    for panel, values in ((upper, curved.pressure), (lower, curved.penetration)):
        curve = panel.lines[1]
        where, drawn = curve.get_xdata(), curve.get_ydata()
        assert (np.diff(where) > 0.0).all()
        np.testing.assert_array_equal(drawn, values[along])
    start = np.array([-1.0, 0.35])
    chords = np.linalg.norm(np.diff(np.vstack([start, points[along]]), axis=0), axis=1)
    np.testing.assert_allclose(upper.lines[1].get_xdata(), np.cumsum(chords), rtol=0.02)


@pytest.mark.parametrize("names", [("right", "bottom"), ("bottom", "right")])
def test_each_boundary_has_its_panels(plane: Solution, names: tuple[str, str]) -> None:
    """In the order in which they are stated, under these names, though another name stands for all facets first."""
    stated = plane.problem.origin
    assert stated is not None
    both = dict.fromkeys(names, stated.contact["bottom"])
    mesh = stated.mesh.with_boundaries({"all": stated.mesh.boundary_facets, **stated.mesh.boundaries})
    solution = solve(discretize(replace(stated, mesh=mesh, contact=both)))
    figure = plot_contact(solution)
    assert [panel.get_title() for panel in figure.axes[:2]] == [*names]
    assert [panel.get_xlabel() for panel in figure.axes[-2:]] == [{"right": "y", "bottom": "x"}[name] for name in names]
    points = solution.problem.contact.points
    frames = solution.problem.contact.frames
    assert points is not None
    assert frames is not None
    for panel in figure.axes[:2]:
        axis, side = (1, frames[:, 0, 0] > 0.5) if panel.get_title() == "right" else (0, frames[:, 0, 1] < -0.5)
        where = points[side, axis]
        np.testing.assert_array_equal(panel.lines[1].get_xdata(), np.sort(where))
        np.testing.assert_array_equal(panel.lines[1].get_ydata(), solution.pressure[side][np.argsort(where)])


def test_forces_are_those_on_the_body_and_act_where_they_end(plane: Solution) -> None:
    """Of the foundation below, pressure points upwards; the arrow lies in the foundation and ends at its point."""
    from matplotlib.quiver import Quiver

    (quiver,) = plot_solution(plane).axes[0].findobj(Quiver)
    force = np.stack([quiver.U, quiver.V], axis=1)
    assert np.allclose(force, np.stack([plane.friction[:, 0], plane.pressure], axis=1))
    places = DeformedBody.of(plane, 1.0).contact_places
    short = force / np.linalg.norm(force, axis=1, keepdims=True) * 0.012 * np.sqrt(2.0)  # of the mark
    np.testing.assert_allclose(quiver.XY + force / quiver.scale + short, places, atol=1e-12)


def test_a_force_that_pulls_begins_where_it_acts() -> None:
    from matplotlib.quiver import Quiver

    glue = Adhesive(stiffness=10.0, strength=1.0, softening=1.0, compression=10.0)
    body = replace(survey("5.1", 4), contact={"bottom": Contact(glue)}, body_force=(0.0, 0.1))
    solution = solve(discretize(body))
    (quiver,) = plot_solution(solution).axes[0].findobj(Quiver)
    pulled = solution.pressure < 0.0
    assert pulled.any()
    places = DeformedBody.of(solution, 1.0).contact_places
    assert np.linalg.norm(quiver.XY - places, axis=1)[pulled] == pytest.approx(0.012 * np.sqrt(2.0))
    assert (quiver.XY[pulled, 1] < places[pulled, 1]).all()  # into the foundation


def test_glue_that_is_pressed_is_bonded_and_its_shear_is_no_friction() -> None:
    glue = MixedMode(BilinearCohesion(stiffness=24.0, strength=2.4, energy=0.6), 1.5, Compliance(100.0))
    pressed = replace(survey("5.1", 4), contact={"bottom": Contact(glue)})
    solution = solve(discretize(pressed))
    assert (solution.pressure > 0.0).any()
    assert "bonded, compressed" in texts(plot_solution(solution))
    words = texts(plot_contact(solution))
    assert "shear on the body" in words
    assert "bonded, compressed" in words
    assert "friction" not in words
    rubbed = texts(plot_contact(solve(discretize(survey("5.1", 4)))))
    assert "friction on the body" in rubbed
    assert "bonded" not in rubbed


def test_many_cells_are_coloured_instead_of_lined(tmp_path: Path) -> None:
    figure = plot_solution(solve(discretize(survey("figure2", 40))))
    assert "von Mises stress" in texts(figure)
    save(figure, tmp_path / "figure.png", dpi=40)


def test_few_cells_are_coloured_on_demand(plane: Solution) -> None:
    """By the stress of each cell, or by the displacement of each vertex; nothing by itself, and no other colours."""
    from matplotlib.collections import PolyCollection, TriMesh

    stated = plane.problem.origin
    assert isinstance(stated, ContactProblem)
    plain = plot_solution(plane, arrows="none")
    assert all(one.get_array() is None for one in plain.findobj(PolyCollection))  # type: ignore[attr-defined]
    (cells,) = plot_solution(plane, colour="stress", arrows="none").axes[0].findobj(PolyCollection)
    np.testing.assert_array_equal(cells.get_array(), von_mises(stated, plane.displacement))
    assert "von Mises stress (MPa)" in texts(plot_solution(plane, colour=BodyColour.STRESS, stress_unit="MPa"))
    figure = plot_solution(plane, colour="displacement", unit="mm")
    (mesh,) = figure.axes[0].findobj(TriMesh)
    np.testing.assert_allclose(mesh.get_array(), np.linalg.norm(plane.displacement, axis=1))
    assert "displacement (mm)" in texts(figure)


def test_many_cells_need_no_colours() -> None:
    from matplotlib.collections import PolyCollection

    dense = solve(discretize(survey("figure2", 40)))
    plain = plot_solution(dense, colour="none", arrows="none")
    assert all(one.get_array() is None for one in plain.findobj(PolyCollection))  # type: ignore[attr-defined]


@pytest.mark.parametrize("colour", [*BodyColour])
def test_a_solid_has_the_same_colours(solid: Solution, colour: BodyColour) -> None:
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

    figure = plot_solution(solid, colour=colour)
    (surface,) = figure.findobj(Poly3DCollection)
    assert (surface.get_array() is None) == (colour is BodyColour.NONE)
    assert ("von Mises stress" in texts(figure)) == (colour is BodyColour.STRESS)
    assert ("displacement" in texts(figure)) == (colour is BodyColour.DISPLACEMENT)


def test_a_scalar_problem_keeps_its_own_colours() -> None:
    with pytest.raises(ProblemError, match="scalar problem"):
        plot_solution(solve(membrane_obstacle(6).problem), colour="stress")


def test_every_picture_of_a_solution_tells_what_it_is_worth(plane: Solution, solid: Solution) -> None:
    """The certificate in one line, or the residual and that nothing was certified; inside the figure's own edges."""
    scalar = solve(membrane_obstacle(6).problem)
    for solution in (plane, solid, scalar):
        certificate = solution.certify()
        for draw in (plot_solution, plot_contact):
            assert certificate.brief() in texts(draw(solution, certificate=certificate)).replace("\n", " ")
            assert f"residual {solution.residual.relative:.1e}, not certified" in texts(draw(solution))
    figure = plot_solution(plane, colour="stress")
    figure.draw_without_rendering()
    (line,) = figure.findobj(lambda part: isinstance(part, Text) and "not certified" in part.get_text())
    extent = line.get_window_extent()
    assert extent.y0 >= 0.0
    assert extent.x1 <= figure.bbox.x1


def test_a_solution_that_did_not_converge_says_so_in_its_picture() -> None:
    stopped = solve(discretize(survey("figure4", 8)), controls=Controls(max_steps=1))
    (line,) = re.findall(r"[a-z_]+: [^|]*residual [^|]*not certified", texts(plot_solution(stopped)))
    assert line.startswith(f"{stopped.status.value}: ")


def test_lines_of_a_mesh_are_one_path_and_fade_with_their_density() -> None:
    points = rectangle((1.0, 1.0), 4).points
    edges = rectangle((1.0, 1.0), 4).edges
    few, many = (mesh_lines(points, edges, cells, 3.0) for cells in (32, 4000))
    np.testing.assert_array_equal(few.get_path().vertices.reshape(-1, 2, 2), points[edges])
    assert many.get_linewidth() < few.get_linewidth()
    assert many.get_alpha() < few.get_alpha() == 1.0


def test_own_axes_are_used(plane: Solution) -> None:
    from matplotlib.figure import Figure

    own = Figure()
    axes = own.add_subplot()
    assert plot_solution(plane, ax=axes, legend=False) is own
    assert axes.get_xlabel() == "x"
    assert axes.get_legend() is None


def test_body_without_contact() -> None:
    solution = solve(discretize(beam()))
    words = texts(plot_solution(solution))
    assert "deformed body" in words
    assert "foundation" not in words
    with pytest.raises(ProblemError, match="no contact point"):
        plot_contact(solution)


def test_solid(solid: Solution) -> None:
    figure = plot_solution(solid, scale="auto")
    for number, kind in enumerate(KINDS):
        count = np.count_nonzero(solid.states.numbers == number)
        assert (f"{kind.label} ({count})" in texts(figure)) == (count > 0)
    assert "friction, magnitude" in texts(plot_contact(solid))


def test_problem_of_arrays(bar: Solution) -> None:
    with pytest.raises(ProblemError, match="no mesh"):
        plot_solution(bar)
    figure = plot_contact(bar)
    assert figure.axes[1].get_xlabel() == "contact point"
    assert figure.axes[0].lines[1].get_ydata().tolist() == bar.pressure.tolist()


def test_history_shows_every_step(plane: Solution, bar: Solution) -> None:
    residuals, energies = plot_history([plane, bar], title="A title").axes
    for line, solution in zip(residuals.lines, (plane, bar), strict=True):
        expected = [entry.residual for entry in solution.history if entry.residual > 0.0]
        assert line.get_ydata().tolist() == expected
    lowest = min(entry.energy for entry in plane.history)
    above = np.array([entry.energy - lowest for entry in plane.history])
    np.testing.assert_array_equal(energies.lines[0].get_ydata(), above[above > 0.0])


@pytest.mark.parametrize(
    "options", [{"scale": -1.0}, {"scale": "big"}, {"scale": np.nan}, {"arrows": "long"}, {"colour": "strain"}]
)
def test_options_are_checked(plane: Solution, options: dict[str, object]) -> None:
    with pytest.raises(ProblemError, match=next(iter(options))):
        plot_solution(plane, **options)  # type: ignore[arg-type]


def test_friction_bound_is_drawn(plane: Solution) -> None:
    above, beside = plot_contact(plane).axes[:2]
    drawn = [line.get_ydata() for line in beside.lines if len(line.get_ydata()) == 16]
    assert any(np.allclose(values, 0.1) for values in drawn)
    assert any(np.allclose(values, -0.1) for values in drawn)
    assert any(np.allclose(line.get_ydata(), plane.pressure) for line in above.lines if len(line.get_ydata()) == 16)


def test_slip_has_an_axis_of_its_own_and_is_left_out_where_the_body_is_away() -> None:
    """Three points on springs, the last of which lifts off."""
    law, one = ContactLaw(Compliance(1.0), Tresca(1e-3)), np.ones(3)
    load = np.array([2.0, 0.003, 1.0, -0.004, -1.0, 0.5])
    problem = DiscreteProblem.of_arrays(np.eye(6), load, np.eye(6), one, np.zeros(3), law)
    figure = plot_contact(solve(problem))
    assert [panel.get_ylabel() for panel in figure.axes] == ["pressure", "friction on the body", "penetration", "slip"]
    across, along = (panel.lines[1].get_ydata() for panel in figure.axes[2:])
    np.testing.assert_allclose(across, [1.0, 0.5, -1.0], rtol=1e-6)
    np.testing.assert_allclose(along, [0.002, -0.003, np.nan], rtol=1e-6)
    assert not figure.axes[3].get_title()


def test_without_friction_there_are_two_panels(bar: Solution) -> None:
    assert [panel.get_ylabel() for panel in plot_contact(bar).axes] == ["pressure", "penetration"]


def test_marks_and_arrows_do_not_pile_up() -> None:
    """A tall block: 64 points on a small part of the picture, the same points on a flat one."""
    from matplotlib.quiver import Quiver

    for height, most in ((0.5, 64), (20.0, 10)):
        block = survey("5.1", 4)
        mesh = rectangle((2.0, height), (64, 4))
        solution = solve(discretize(replace(block, mesh=mesh)))
        figure = plot_solution(solution, arrows=Arrows.FORCE)
        (quiver,) = (one for one in figure.findobj(Quiver) if len(one.U) > 0)
        apart = np.diff(np.sort(quiver.XY[:, 0]))
        assert 2 < len(quiver.U) <= most
        assert len(quiver.U) > 30 or apart.mean() > 0.2
        drawn = DeformedBody.of(solution, 1.0).contact_places
        force = np.stack([quiver.U, quiver.V], axis=1)
        beside = 0.012 * np.hypot(2.0, height) * force / np.linalg.norm(force, axis=1, keepdims=True)  # of the marks
        ends = np.stack([quiver.XY - beside, quiver.XY + force / quiver.scale + beside])
        away = np.linalg.norm(drawn - ends[:, :, None], axis=3).min(axis=0)
        assert away.min(axis=1).max() < 1e-9  # each ends, or begins, at a point
        index = away.argmin(axis=1)
        assert solution.problem.contact.points is not None
        at_rest = np.diff(np.sort(solution.problem.contact.points[index, 0]))
        np.testing.assert_allclose(at_rest, at_rest[0])  # even on the body
        for kind, here in solution.states.present.items():
            assert f"{kind.label} ({np.count_nonzero(here)})" in texts(figure)


@pytest.mark.parametrize("reach", [0.05, 0.5])
def test_a_small_part_that_bears_is_enlarged(reach: float) -> None:
    """Beside the body, where arrows would lie on each other; with all its points and their forces."""
    from matplotlib.quiver import Quiver

    flat = Contact(Compliance(5.0), gap=lambda x: np.where(np.abs(x[:, 0] - 1.0) < reach, 0.0, 1.0))
    block = replace(survey("5.1", 4), mesh=rectangle((2.0, 1.0), (128, 4)), contact={"bottom": flat})
    solution = solve(discretize(replace(block, body_force=(0.0, -0.01)))).raise_for_status()
    enlarged = [panel for panel in plot_solution(solution).axes if panel.get_title() == "the part that bears"]
    bears = solution.pressure > 0.0
    assert len(enlarged) == (reach < 0.1)
    for panel in enlarged:
        (quiver,) = panel.findobj(Quiver)
        assert np.count_nonzero(bears) == 7
        assert np.count_nonzero(np.hypot(quiver.U, quiver.V) > 1e-9) == 7
        low, high = panel.get_xlim()
        assert low < 0.95 < 1.05 < high < low + 0.3


def test_friction_is_named_after_its_bound() -> None:
    """A bound that depends on the state is not Tresca's."""

    def caption(friction: Friction) -> str:
        law = ContactLaw(Compliance(2.0), friction)
        one = np.ones(1)
        problem = DiscreteProblem.of_arrays(np.eye(2), np.ones(2), np.eye(2), one, np.zeros(1), law)
        return law_captions(problem)[-1]

    assert caption(Tresca(0.5)) == r"Tresca friction: $h_\tau$ = 0.5"
    assert caption(Friction(CoulombBound(0.3))) == r"Coulomb friction: $\mu$ = 0.3"
    assert caption(Friction(PenetrationBound(lambda s: 0.1 * s))) == r"friction: $h_\tau$ depends on penetration"


def test_history_needs_a_solution() -> None:
    with pytest.raises(ProblemError, match="no solution"):
        plot_history([])


def test_statement_shows_its_conditions(plane: Solution) -> None:
    from matplotlib.collections import LineCollection

    stated = plane.problem.origin
    assert stated is not None
    figure = plot_problem(stated, unit="mm")
    for words in ("support: left", "contact: bottom", "x (mm)"):
        assert words in texts(figure)
    _, *lines = [part.get_segments() for part in figure.findobj(LineCollection)]  # the first is the outline
    np.testing.assert_array_equal(lines[0], stated.mesh.points[stated.mesh.boundaries["left"]])
    np.testing.assert_array_equal(lines[1], stated.mesh.points[stated.mesh.boundaries["bottom"]])


def test_statement_of_a_solid() -> None:
    """The last of the boundaries that hold a facet paints it."""
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

    problem = survey_cube("5.1", 2)
    (surface,) = plot_problem(problem).findobj(Poly3DCollection)
    assert len(surface.get_facecolor()) == 6 * 2 * 2 * 2
    facets, colours = painted(problem, [("left", "#0000ff", 1.0), ("front", "#00ff00", 1.0), ("left", "#ff0000", 1.0)])
    middles = problem.mesh.points[facets].mean(axis=1)
    expected = np.where(middles[:, 0] < 1e-9, "#ff0000c0", np.where(middles[:, 1] < 1e-9, "#00ff00c0", "plain"))
    painted_only = [colour if colour in expected else "plain" for colour in colours]
    assert painted_only == expected.tolist()
    assert len(facets) == 48


def test_errors_leave_out_the_mesh_next_to_the_reference(tmp_path: Path) -> None:
    sizes = 0.5 ** np.arange(1, 6)
    error = sizes**0.9
    error[-1] *= 0.5
    figure = plot_errors(sizes, {("A", "A"): error, ("A", "B"): 1.1 * error}, reference_size=1 / 64)
    assert "B against A: 0.90" in texts(figure)
    save(figure, tmp_path / "errors.png", dpi=40)


def test_drawing_is_imported_late() -> None:
    code = "import sys, hemivar.report; sys.exit(any(m in sys.modules for m in ('matplotlib', 'meshio', 'rich')))"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_texts_that_fit_into_no_picture_are_cut(plane: Solution, tmp_path: Path) -> None:
    for number, title in enumerate(("x" * 1_000_000, "y\n" * 100_000)):
        fig = plot_solution(plane, title=title)
        file = save(fig, tmp_path / f"{number}.png", dpi=20)
        assert max(Image.open(file).size) < 2000
        assert 200 < len(fig.axes[0].get_title()) < 300 if number == 0 else len(fig.axes[0].get_title()) < 300


def test_what_is_no_solution_says_so_above_its_picture(plane: Solution, tmp_path: Path) -> None:
    stopped = replace(plane, status=Status.INTERRUPTED)
    for draw in (plot_solution, plot_contact):
        for title in (None, "a block"):
            texts = [text.get_text() for text in draw(stopped, title=title).findobj(Text)]
            assert any(text.split("\n")[0] == f"NOT A SOLUTION: {Status.INTERRUPTED.value}" for text in texts)
            assert not any("NOT A SOLUTION" in text.get_text() for text in draw(plane, title=title).findobj(Text))
    write_vtu(stopped, tmp_path / "stopped.vtu")
    assert "NOT A SOLUTION: interrupted" in (tmp_path / "stopped.vtu").read_bytes().decode(errors="replace")
    write_vtu(plane, tmp_path / "plane.vtu")
    assert "NOT A SOLUTION" not in (tmp_path / "plane.vtu").read_bytes().decode(errors="replace")
    np.testing.assert_array_equal(
        read_solution(tmp_path / "stopped.vtu", plane.problem)[0],
        read_solution(tmp_path / "plane.vtu", plane.problem)[0],
    )
