"""Pictures of scalar problems, and how a notebook shows them."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest

import hemivar as hv
from hemivar import gallery
from hemivar.fem.area_average import area_average
from hemivar.report import plot_contact, plot_solution
from hemivar.report.bodies import plot_problem
from hemivar.report.notebook import html_of
from hemivar.report.scalar_map import over_area

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def texts(figure: Figure) -> str:
    from matplotlib.text import Text

    return " | ".join(item.get_text() for item in figure.findobj(Text))


def test_a_membrane_and_its_foundation() -> None:
    found = hv.solve(gallery.membrane_obstacle(16).problem)
    assert over_area(found.problem).all()
    words = texts(plot_solution(found, title="A title", note="a note", unit="mm"))
    share = 100.0 * found.contact_length / found.problem.contact.weights.sum()
    for expected in ("A title", "a note", "deflection u (mm)", f"in contact: {share:.3g} %", "Signorini law", "below"):
        assert expected in words
    figure = plot_contact(found, unit="mm", stress_unit="MPa")
    assert "force per area of the foundation (MPa)" in texts(figure)
    colours = figure.axes[0].collections[0].get_array()
    assert colours is not None
    assert float(np.max(colours)) == pytest.approx(area_average(found.problem, found.pressure).max())


def test_marks_of_friction() -> None:
    found = hv.solve(gallery.antiplane_friction(8).problem)
    slips = int((found.tangential_state == hv.solvers.TangentialState.SLIP).sum())
    words = texts(plot_solution(found))
    assert f"contact, slip ({slips})" in words
    assert "displacement u across the plane" in words
    assert "None law" not in words
    assert "friction" in texts(plot_contact(found))


def test_heat_in_space() -> None:
    problem = hv.ScalarProblem(
        hv.box((1.0, 1.0, 1.0), 2), 1.0, {"bottom": hv.ScalarContact(hv.laws.ThresholdCompliance(0.1))},
        supports={"top": 1.0},
        kind="heat",  # type: ignore[arg-type]
    )  # fmt: skip
    found = hv.solve(problem)
    assert "temperature" in texts(plot_solution(found))
    with pytest.raises(hv.errors.ProblemError, match="write it with write_vtu"):
        plot_contact(found)
    with pytest.raises(hv.errors.ProblemError, match="write it with write_vtu"):
        plot_contact(hv.solve(replace(problem, contact={"area": hv.ScalarContact(hv.laws.ThresholdCompliance(0.1))})))


def test_what_a_notebook_shows() -> None:
    problem = gallery.antiplane_friction(4).problem
    assert "support: left" in texts(plot_problem(problem))
    over_area = texts(plot_problem(gallery.membrane_obstacle(4).problem))  # its contact is on no boundary
    assert "support: " in over_area
    assert "contact: " not in over_area
    for shown, words in (
        (problem, "shear modulus"), (hv.discretize(problem), "local components"), (hv.solve(problem), "contact length"),
        (hv.solve(gallery.membrane_obstacle(4).problem), "contact area"),
    ):  # fmt: skip
        assert words in html_of(shown)


def test_a_summary_of_antiplane_shear_has_no_pressure() -> None:
    said = hv.solve(gallery.antiplane_friction(8).problem).summary()
    assert "friction force" in str(said)
    assert "normal force" not in str(said)
    assert "pressure" not in str(said)
