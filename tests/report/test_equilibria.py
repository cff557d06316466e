"""Pictures of several solutions and of paths."""

from __future__ import annotations

import numpy as np
from matplotlib.quiver import Quiver

import hemivar as hv
from hemivar.gallery import elastic_bar
from hemivar.report import plot_path, plot_solutions, plot_study
from hemivar.report.loglog import _line, _meet
from hemivar.report.path_diagrams import fitting_quantity


def softening_square(law: hv.Softening) -> hv.ContactProblem:
    """Pushed onto a foundation that softens."""
    return hv.ContactProblem(
        mesh=hv.rectangle((1.0, 1.0), 2),
        material=hv.Material.lame(4.0, 4.0),
        supports={"left": hv.Roller(), "right": hv.Roller(), "top": hv.Fixed(y=-0.07)},
        contact={"bottom": hv.Contact(law)},
        body_force=(0.0, -1.0),
    )


def test_each_solution_stands_on_its_law() -> None:
    found = hv.find_solutions(softening_square(hv.Softening(60.0, 0.02, 16.0)))
    assert len(found) > 1
    figure = plot_solutions(found, unit="mm", stress_unit="MPa")
    graphs = [panel for panel in figure.axes if panel.get_xlabel() == "penetration (mm)"]
    assert len(graphs) == min(len(found), 6)
    for graph, solution in zip(graphs, found, strict=False):
        assert graph.get_ylabel() == "pressure (MPa)"
        marks = np.vstack([line.get_xydata() for line in graph.lines if line.get_linestyle() == "None"])
        np.testing.assert_allclose(np.sort(marks[:, 0]), np.sort(solution.penetration))
        np.testing.assert_allclose(np.sort(marks[:, 1]), np.sort(solution.pressure))
    bodies = [panel for panel in figure.axes if panel.get_title()]
    assert len({(*panel.get_xlim(), *panel.get_ylim()) for panel in bodies}) == 1  # one scale, also of the arrows
    scales = {quiver.scale for panel in bodies for quiver in panel.findobj(Quiver)}
    assert len(scales) == 1
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["contact"]


def test_laws_that_vary_over_the_boundary_are_not_drawn_as_one() -> None:
    found = hv.find_solutions(softening_square(hv.Softening(lambda x: 60.0 + x[:, 0], 0.02, 10.0)))
    assert not any(panel.get_xlabel().startswith("penetration") for panel in plot_solutions(found).axes)


def test_a_path_is_drawn_over_what_changes_most() -> None:
    pressed = hv.follow_path(elastic_bar(hv.Softening(2.0, 0.1, 0.9), length=2.0, load=0.225), (0.0, 1.5))
    assert fitting_quantity(pressed) == "max-penetration"
    pulled = hv.follow_path(elastic_bar(hv.laws.Adhesive(2.0, 0.2, 0.9, 2.0), length=2.0, load=-0.225), (0.0, 1.5))
    assert fitting_quantity(pulled) == "max-opening"
    figure = plot_path(pulled)
    assert figure.axes[0].get_xlabel() == "largest opening"


def test_the_first_instability_is_labelled_where_the_path_goes_on() -> None:
    path = hv.follow_path(elastic_bar(hv.Softening(2.0, 0.1, 0.9), length=2.0, load=0.225), (0.0, 1.5))
    assert path.limit_load is None
    assert path.first_instability is not None
    words = [text.get_text() for text in plot_path(path).axes[0].texts]
    assert f"first instability {path.first_instability:.4g}" in words


def test_triangles_meet_neither_curves_nor_each_other() -> None:
    """Two curves that lie close: what stands beside one must not cover the other."""
    study = hv.study(hv.gallery.survey("5.1", 4), 3)
    axes = plot_study(study).axes[0]
    curves = [
        _line(line.get_xdata(), line.get_ydata())
        for line in axes.lines
        if len(line.get_xdata()) == 4 and line.get_marker() not in ("None", None)
    ]
    triangles = [line for line in axes.lines if line.get_marker() in ("None", None) and len(line.get_xdata()) == 4]
    assert len(curves) == len(triangles) == 3
    for line in triangles:
        x, y = np.log(line.get_xdata()), np.log(line.get_ydata())  # left, right, the upright side, left
        across = np.linspace(x[0], x[1], 20)
        ramp, flat = np.interp(across, x[:2], y[:2]), np.full(20, y[2])
        band = np.stack([across, np.minimum(ramp, flat), np.maximum(ramp, flat)])
        assert not any(_meet(band, curve) for curve in curves)
