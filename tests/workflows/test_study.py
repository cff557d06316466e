"""Studies of convergence: errors in closed form, orders of theory, the finest mesh as reference."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

import hemivar as hv
from hemivar import gallery
from hemivar.errors import ProblemError
from hemivar.fem.error_norms import KnownField, error_norms
from hemivar.files.problem_file import parse_problem
from hemivar.report import plot_study, study_table
from hemivar.workflows import StudyLevel, result_of, studying
from tests.problem_files import MANUFACTURED, MANUFACTURED_EXACT


@pytest.fixture(scope="module")
def problem() -> hv.ContactProblem:
    found = parse_problem(MANUFACTURED)
    assert isinstance(found, hv.ContactProblem)
    return found


@pytest.fixture(scope="module")
def exact(problem: hv.ContactProblem) -> hv.Study:
    return hv.study(problem, 3, exact=MANUFACTURED_EXACT)


def test_orders_of_linear_elements_are_those_of_theory(exact: hv.Study) -> None:
    assert exact.reference == "exact solution"
    assert exact.orders["energy"] == pytest.approx(1.0, abs=0.03)
    assert exact.orders["displacement"] == pytest.approx(2.0, abs=0.05)
    assert exact.orders["pressure"] >= 1.5
    assert np.isnan(exact.steps("energy")[0])
    for level in exact.levels:
        contact = level.solution.contact
        assert contact.points is not None
        off = level.solution.pressure - 0.6 * (2.0 + np.cos(np.pi * contact.points[:, 0]))
        assert level.pressure == pytest.approx(float(np.sqrt(contact.weights @ off**2)), rel=1e-9)
    by_hand = math.log(exact.errors("energy")[1] / exact.errors("energy")[2]) / math.log(2.0)
    assert exact.steps("energy")[2] == pytest.approx(by_hand, rel=1e-12)


def test_orders_of_quadratic_elements_are_one_higher(problem: hv.ContactProblem) -> None:
    found = hv.study(replace(problem, order=2), 2, exact=MANUFACTURED_EXACT)
    assert found.orders["energy"] == pytest.approx(2.0, abs=0.1)
    assert found.orders["displacement"] == pytest.approx(3.0, abs=0.15)


def test_the_finest_mesh_is_a_reference_and_what_it_shares_is_left_out(
    problem: hv.ContactProblem, exact: hv.Study
) -> None:
    found = hv.study(problem, 3)
    assert found.reference == "finest mesh"
    assert np.isnan(found.errors("energy")[-1])
    # by the theorem of Pythagoras, up to the part of the contact boundary, errors are those against the exact solution
    # less that of the finest mesh
    true = exact.errors("energy")
    np.testing.assert_allclose(found.errors("energy")[:-1] ** 2, true[:-1] ** 2 - true[-1] ** 2, rtol=2e-2)
    fine = found.levels[-1].solution
    assert fine.contact.points is not None
    x = fine.contact.points[:, 0]
    for level in found.levels[:-1]:
        assert level.solution.contact.points is not None
        order = np.argsort(level.solution.contact.points[:, 0])
        coarse = np.interp(x, level.solution.contact.points[order, 0], level.solution.pressure[order])
        by_hand = float(np.sqrt(fine.contact.weights @ (coarse - fine.pressure) ** 2))
        assert level.pressure == pytest.approx(by_hand, rel=1e-9)
    assert found.trusted.tolist() == [True, True, False, False]
    assert found.steps("energy")[2] > found.steps("energy")[1] + 0.1  # the error that is shared
    assert found.orders["energy"] == pytest.approx(found.steps("energy")[1], rel=1e-9)


def test_the_finest_mesh_as_reference_for_quadratic_elements_and_one_component() -> None:
    found = hv.study(replace(gallery.survey("5.1", 2), order=2), 2)
    assert (np.diff(found.errors("displacement")[:-1]) < 0.0).all()
    membrane = hv.study(gallery.membrane_obstacle(4).problem, 3)
    assert membrane.orders["displacement"] > 1.5


def test_norms_in_closed_form() -> None:
    problem = hv.ContactProblem(
        hv.rectangle((1.0, 1.0), 2), hv.Material.lame(4.0, 4.0), contact={}, supports={"left": hv.Clamped()}
    )
    zero = np.zeros((problem.mesh.number_of_nodes, 2))
    found = error_norms(problem, zero, KnownField(["x*y", "0"]))
    assert found.energy**2 == pytest.approx(16.0 / 3.0, rel=1e-12)  # 4 y^2 + 8 (y^2 + x^2/2)
    assert found.mean_square**2 == pytest.approx(1.0 / 9.0, rel=1e-12)
    x, y = problem.mesh.points.T
    nodal = np.column_stack([1.0 + 2.0 * x - y, 3.0 * x + 0.5 * y])
    assert error_norms(problem, nodal, KnownField(["1 + 2*x - y", "3*x + 0.5*y"])).energy == pytest.approx(0, abs=1e-14)
    assert error_norms(problem, nodal).energy ** 2 == pytest.approx(4 * 2.5**2 + 8 * (4 + 0.25 + 2 * 1), rel=1e-12)
    assert error_norms(problem, nodal).mean_square ** 2 == pytest.approx(6.5, rel=1e-12)
    curved = np.column_stack([problem.mesh.nodes(2)[:, 0] ** 2, 0.0 * problem.mesh.nodes(2)[:, 0]])
    found = error_norms(replace(problem, order=2), curved)
    assert found.mean_square**2 == pytest.approx(0.2, rel=1e-12)  # x^4
    assert found.energy**2 == pytest.approx(16.0, rel=1e-12)  # 12 (2 x)^2


def test_errors_do_not_depend_on_units(problem: hv.ContactProblem, exact: hv.Study) -> None:
    from tests.problem_files import MANUFACTURED_MM, MANUFACTURED_MM_EXACT

    other = hv.study(parse_problem(MANUFACTURED_MM), 1, exact=MANUFACTURED_MM_EXACT)
    for name in exact.quantities:
        np.testing.assert_allclose(other.relative(name), exact.relative(name)[:2], rtol=1e-6)


def test_an_interruption_keeps_the_meshes_that_are_done(problem: hv.ContactProblem) -> None:
    def stop(event: object) -> None:
        if isinstance(event, StudyLevel) and event.size < 0.5:
            raise KeyboardInterrupt

    found = result_of(studying(problem, hv.workflows.StudyOptions(4)), stop)
    assert found.interrupted
    sizes = found.sizes
    assert all(one == pytest.approx(2.0 * two) for one, two in pairwise(sizes))
    assert len(sizes) == 1 + int(np.argmax(sizes < 0.5))
    assert np.isnan(found.errors("energy")[-1])


def test_what_makes_no_sense_is_refused(problem: hv.ContactProblem) -> None:
    with pytest.raises(ProblemError, match="refine is 0"):
        hv.study(problem, 0)
    with pytest.raises(ProblemError, match="has 1 components and the displacement 2"):
        hv.study(problem, 1, exact=["x"])
    with pytest.raises(ProblemError, match="uses t"):
        hv.study(problem, 1, exact=["t", "0"])
    with pytest.raises(ProblemError, match="exact solution: formula"):
        hv.study(problem, 1, exact=["log(x - 9)", "0"])
    with pytest.raises(ProblemError, match="whose mesh can be refined"):
        hv.study(hv.discretize(problem), 1)  # type: ignore[arg-type]


def test_table_and_figure_show_what_was_found(exact: hv.Study) -> None:
    table = study_table(exact, "a_b & 50%")
    assert len(table.rows) == 4
    errors = [row[table.columns.index("energy error")] for row in table.rows]
    np.testing.assert_allclose(errors, exact.errors("energy"), rtol=1e-15)
    latex = table.latex()
    assert r"\caption{a\_b \& 50\%}" in latex
    assert latex.count(r"\\") == 5
    assert latex.index(r"\toprule") < latex.index(r"\midrule") < latex.index(r"\bottomrule")
    axes = plot_study(exact).axes[0]
    drawn = {line.get_label().split(",")[0]: line for line in axes.get_lines()}
    np.testing.assert_allclose(drawn["energy norm"].get_ydata(), exact.relative("energy"))
    assert axes.get_xlabel() == "mesh size h"
    triangles = [line for line in axes.get_lines() if len(line.get_xdata()) == 4 and line.get_marker() == "None"]
    slopes = [np.ptp(np.log(line.get_ydata())) / np.ptp(np.log(line.get_xdata())) for line in triangles]
    assert min(slopes) == pytest.approx(1.0)
    assert any(slope == pytest.approx(2.0) for slope in slopes)
