"""Figures and tables of adaptive solves."""

from __future__ import annotations

import csv
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import hemivar as hv
from hemivar.basics.rounding import rounded_up
from hemivar.bounds import AdaptiveSolution, adaptive
from hemivar.bounds.adaptive_end import AdaptiveEnd
from hemivar.bounds.exact_certificate import statement_of
from hemivar.bounds.trace_bounds import TraceBounds, discrete_trace_bounds
from hemivar.errors import ProblemError
from hemivar.files import write_vtu
from hemivar.gallery import survey, survey_cube
from hemivar.report import plot_adaptive, plot_meshes, save
from hemivar.report.tables import Table
from tests import bodies

from .test_picture_figures import texts


def estimated(discrete: hv.DiscreteProblem, workspace: hv.systems.Workspace) -> TraceBounds:
    """Constants of the discrete problem, which cost little."""
    return discrete_trace_bounds(discrete, workspace)


@pytest.fixture(scope="module")
def found() -> AdaptiveSolution:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(adaptive, "body_constants", estimated)
        convex = sys.modules["hemivar.bounds.exact_distance"]
        patch.setattr(convex, "_without_constants", lambda *_: None)  # its law is convex: none are needed
        return hv.bounds.solve_adaptive(survey("5.1", 4), rtol=0.12, goal=None)


def labels(figure: object) -> list[str]:
    return [text.get_text() for text in figure.axes[0].get_legend().get_texts()]  # type: ignore[attr-defined]


def test_error_against_unknowns(found: AdaptiveSolution, tmp_path: Path) -> None:
    figure = plot_adaptive(found, title="title")
    axes = figure.axes[0]
    assert (axes.get_xlabel(), axes.get_ylabel(), axes.get_title()) == ("unknowns", "relative error", "title")
    assert (axes.get_xscale(), axes.get_yscale()) == ("log", "log")
    curve = axes.lines[0]
    np.testing.assert_allclose(curve.get_xdata(), [level.unknowns for level in found.levels])
    np.testing.assert_allclose(curve.get_ydata(), [level.distance.relative for level in found.levels])
    assert curve.get_markerfacecolor() == "white"  # an estimate
    assert any("estimate" in label for label in labels(figure))
    assert not any("guaranteed" in label for label in labels(figure))
    assert "asked for: 12 %" in labels(figure)
    assert "order 1/2 in the unknowns" in labels(figure)
    assert save(figure, tmp_path / "a.pdf").stat().st_size > 3000


def test_meshes_from_coarse_to_fine(found: AdaptiveSolution) -> None:
    figure = plot_meshes(found, unit="mm")
    *panels, enlarged, bar = figure.axes
    titles = [axes.get_title() for axes in panels]
    assert titles[0].startswith(f"{found.levels[0].unknowns} unknowns")
    assert titles[-1].startswith(f"{found.levels[-1].unknowns} unknowns\nestimate")
    assert panels[0].get_ylabel() == "y (mm)"
    (edges,) = (patch.get_path() for patch in panels[-1].patches if not patch.get_fill())
    mesh = found.solution.problem.field.mesh  # type: ignore[union-attr]
    np.testing.assert_array_equal(edges.vertices.reshape(-1, 2, 2), mesh.points[mesh.edges])
    assert bar.get_xlabel() == "part of a cell in the square of the bound"
    colours = panels[-1].collections[0].get_array()
    indicator = found.levels[-1].indicator
    np.testing.assert_allclose(colours, indicator / indicator.sum())
    assert np.ptp(enlarged.get_xlim()) < 0.5  # of the unit square
    assert "times larger" in enlarged.get_title()


def test_solves_beside_are_compared_over_unknowns_and_time(found: AdaptiveSolution) -> None:
    few = replace(found, levels=found.levels[:2])
    figure = plot_adaptive(found, beside={"few": few}, title="both")
    left, right = figure.axes
    assert (left.get_xlabel(), right.get_xlabel()) == ("unknowns", "time (s)")
    assert labels(figure)[:2] == ["adaptive", "few"]
    for ax, name in ((left, "unknowns"), (right, "seconds")):
        for line, one in zip(ax.lines, (found, few), strict=False):
            np.testing.assert_allclose(line.get_xdata(), [getattr(level, name) for level in one.levels])
            np.testing.assert_allclose(line.get_ydata(), [level.relative for level in one.levels])


def test_figures_tell_how_far_the_last_solution_is(found: AdaptiveSolution) -> None:
    certificate = replace(found.solution.certify(), exact=statement_of(found.distance))
    assert "from the exact solution" in certificate.brief()
    for draw in (plot_adaptive, plot_meshes):
        assert certificate.brief() in texts(draw(found, certificate=certificate))
        assert f"about {rounded_up(100.0 * found.distance.relative)} % from the exact" in texts(draw(found))


def test_a_goal_has_curves_of_its_own(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(adaptive, "body_constants", estimated)
    found = hv.bounds.solve_adaptive(survey("5.1", 4), goal="contact.bottom.force.y", rtol=1e-3, max_unknowns=100)
    figure = plot_adaptive(found)
    assert sum("contact.bottom.force.y" in label for label in labels(figure)) == 2
    assert "order 1 in the unknowns" in labels(figure)
    assert plot_meshes(found).get_suptitle() == "contact.bottom.force.y"


def test_in_space(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(adaptive, "body_constants", estimated)
    found = hv.bounds.solve_adaptive(survey_cube("5.1", 2), rtol=0.1, max_unknowns=60)
    figure = plot_meshes(found)
    assert len(figure.axes) == len(found.levels)
    assert all("unknowns" in axes.get_title() for axes in figure.axes)


def test_the_table(found: AdaptiveSolution, tmp_path: Path) -> None:
    file = Table.of(found.rows()).write_csv(tmp_path / "a.csv")
    rows = list(csv.DictReader(file.open()))
    assert [int(row["unknowns"]) for row in rows] == [level.unknowns for level in found.levels]
    assert float(rows[-1]["relative_bound"]) == found.distance.relative
    assert {row["guaranteed"] for row in rows} == {"0.0"}


def test_values_of_cells_that_do_not_fit_are_refused(found: AdaptiveSolution, tmp_path: Path) -> None:
    with pytest.raises(ProblemError, match="cell values 'indicator' have shape"):
        write_vtu(found.solution, tmp_path / "a.vtu", {"indicator": np.zeros(3)})


def test_nothing_to_draw() -> None:
    problem = bodies.square(hv.Contact(hv.Compliance(10.0), hv.Coulomb(0.2)), 4, body_force=(0.1, -0.3))
    found = hv.bounds.solve_adaptive(problem)
    assert found.ended is AdaptiveEnd.NO_BOUND
    with pytest.raises(ProblemError, match="no mesh of this adaptive solve has a distance"):
        plot_adaptive(found)
    assert "no bound of the error" in plot_meshes(found).axes[0].get_title()
