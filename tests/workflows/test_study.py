"""Studies of convergence: errors in closed form, orders of theory, the finest mesh as reference."""

from __future__ import annotations

import hashlib
import json
import math
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

import hemivar as hv
from hemivar import gallery
from hemivar.errors import FileError, ProblemError
from hemivar.fem.error_norms import KnownField, error_norms
from hemivar.files.problem_file import parse_problem
from hemivar.report import Table, plot_study
from hemivar.workflows import StartEvent, StudyLevel, StudyOptions, result_of, studying
from tests import bodies
from tests.problem_files import MANUFACTURED, MANUFACTURED_EXACT
from tests.problems import square


@pytest.fixture(scope="module")
def problem() -> hv.ContactProblem:
    found = parse_problem(MANUFACTURED)
    assert isinstance(found, hv.ContactProblem)
    return found


@pytest.fixture(scope="module")
def exact(problem: hv.ContactProblem) -> hv.workflows.Study:
    return hv.study(problem, 3, known=MANUFACTURED_EXACT)


def test_orders_of_linear_elements_are_those_of_theory(exact: hv.workflows.Study) -> None:
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
    found = hv.study(replace(problem, order=2), 2, known=MANUFACTURED_EXACT)
    assert found.orders["energy"] == pytest.approx(2.0, abs=0.1)
    assert found.orders["displacement"] == pytest.approx(3.0, abs=0.15)


def test_the_finest_mesh_is_a_reference_and_what_it_shares_is_left_out(
    problem: hv.ContactProblem, exact: hv.workflows.Study
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
    problem = bodies.square(cells=2)
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


def test_errors_do_not_depend_on_units(problem: hv.ContactProblem, exact: hv.workflows.Study) -> None:
    from tests.problem_files import MANUFACTURED_MM, MANUFACTURED_MM_EXACT

    other = hv.study(parse_problem(MANUFACTURED_MM), 1, known=MANUFACTURED_MM_EXACT)
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


def test_every_mesh_begins_with_the_solution_on_the_one_before(exact: hv.workflows.Study) -> None:
    for level in exact.levels[1:]:
        warm, cold = level.solution, hv.solve(level.solution.problem)
        above = [one.history[0].energy - one.energy for one in (warm, cold)]
        assert 0.0 <= above[0] < 0.1 * above[1]


def stopped_after(problem: hv.ContactProblem, count: int, options: StudyOptions) -> hv.workflows.Study:
    """A study that is interrupted after so many meshes."""
    seen: list[StudyLevel] = []

    def view(event: object) -> None:
        if isinstance(event, StudyLevel):
            seen.append(event)
            if len(seen) == count:
                raise KeyboardInterrupt

    return result_of(studying(problem, options), view)


def same_bits(one: hv.workflows.Study, other: hv.workflows.Study) -> None:
    assert len(one.levels) == len(other.levels)
    for mine, theirs in zip(one.levels, other.levels, strict=True):
        for name in ("unknowns", "multiplier", "displacement", "local", "pressure", "normal_state", "tangential_state"):
            np.testing.assert_array_equal(getattr(mine.solution, name), getattr(theirs.solution, name))
        for name in ("status", "method", "steps", "evaluations", "residual", "energy", "error_bound", "kind"):
            assert getattr(mine.solution, name) == getattr(theirs.solution, name), name
    for name in one.norms:
        np.testing.assert_array_equal(one.errors(name), other.errors(name))
        assert one.norms[name] == other.norms[name]


def studied(problem: hv.ContactProblem, options: StudyOptions) -> tuple[list[int], hv.workflows.Study]:
    """Which meshes were solved, and the study."""
    begun: list[int] = []

    def view(event: object) -> None:
        if isinstance(event, StartEvent):
            begun.append(event.number)

    return begun, result_of(studying(problem, options), view)


def test_what_was_interrupted_goes_on_with_the_same_bits(problem: hv.ContactProblem, tmp_path: Path) -> None:
    keep = tmp_path / "a.jsonl"
    whole = hv.study(problem, 3)
    first = stopped_after(problem, 2, StudyOptions(3, checkpoint=keep))
    assert first.interrupted
    lines = keep.read_text().splitlines()
    assert len(lines) == 3
    keep.write_text("\n".join(lines) + "\n" + lines[-1][:50])  # killed while it wrote the next mesh
    begun, last = studied(problem, StudyOptions(3, checkpoint=keep))
    assert begun == [2, 3]
    same_bits(last, whole)
    assert keep.read_text().splitlines()[:3] == lines
    assert studied(problem, StudyOptions(3, checkpoint=keep))[0] == []


def test_more_meshes_and_an_exact_solution_go_on_from_the_same_file(
    problem: hv.ContactProblem, exact: hv.workflows.Study, tmp_path: Path
) -> None:
    keep = tmp_path / "a.jsonl"
    hv.study(problem, 1, checkpoint=keep)
    begun, found = studied(problem, StudyOptions(3, MANUFACTURED_EXACT, checkpoint=keep))
    assert begun == [2, 3]
    same_bits(found, exact)
    fewer = hv.study(problem, 2, known=MANUFACTURED_EXACT, checkpoint=keep)
    np.testing.assert_array_equal(fewer.errors("energy"), exact.errors("energy")[:3])


def test_the_record_of_other_work_is_refused(problem: hv.ContactProblem, tmp_path: Path) -> None:
    keep = tmp_path / "a.jsonl"
    hv.study(problem, 1, checkpoint=keep)
    hv.study(replace(problem, title="another name"), 1, checkpoint=keep)
    before = keep.read_bytes()
    finer = problem.on(problem.mesh.refined())
    for other, options in (
        (replace(problem, body_force=(0.0, -1.0)), StudyOptions(1, checkpoint=keep)),
        (finer, StudyOptions(1, checkpoint=keep)),
        (problem, StudyOptions(1, controls=hv.Controls(rtol=1e-8), checkpoint=keep)),
        (problem, StudyOptions(1, method=hv.solvers.NonsmoothMultigrid(), checkpoint=keep)),
    ):
        with pytest.raises(
            FileError, match=r"a\.jsonl: the file holds another study, or the problem has changed since"
        ):
            result_of(studying(other, options))
    hv.sweep(lambda _: problem, {"none": [0.0]}, checkpoint=tmp_path / "b.jsonl")
    with pytest.raises(FileError, match="is not a record of a study; name another file, or remove it"):
        hv.study(problem, 1, checkpoint=tmp_path / "b.jsonl")
    assert keep.read_bytes() == before


def checked(part: dict[str, object]) -> str:
    """A line of the file, with its check."""
    text = json.dumps({name: value for name, value in part.items() if name != "check"})
    return f'{{"check": "{hashlib.sha256(text.encode()).hexdigest()[:16]}", {text[1:]}\n'


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ('"unknowns"', '"unknown"'), ('"data": "', '"data": "?'), ('"converged"', '"done"'), ('"scale"', '"scales"'),
        # what reads as a mesh, of another solution: energies of hundreds stood in the table
        ('"data": "', '"data": "AAAA'), ('"steps": ', '"steps": 1'), ('"check": "', '"check": "0'),
    ],
)  # fmt: skip
def test_a_line_that_was_changed_is_named(problem: hv.ContactProblem, tmp_path: Path, old: str, new: str) -> None:
    keep = tmp_path / "a.jsonl"
    hv.study(problem, 1, checkpoint=keep)
    head, *lines = keep.read_text().splitlines(keepends=True)
    assert old in lines[1]
    keep.write_text(head + lines[0] + lines[1].replace(old, new))
    with pytest.raises(FileError, match="line 3: this is not a mesh of a study, or it was changed since; remove the"):
        hv.study(problem, 1, checkpoint=keep)
    swapped = [json.loads(line) | {"number": 1 - number} for number, line in enumerate(lines)]
    keep.write_text(head + "".join(map(checked, swapped)))
    with pytest.raises(ProblemError, match="what is kept of mesh 0 is of"):
        hv.study(problem, 1, checkpoint=keep)


def test_what_a_time_limit_ended_is_tried_again(problem: hv.ContactProblem, tmp_path: Path) -> None:
    keep = tmp_path / "a.jsonl"
    options = StudyOptions(1, controls=hv.Controls(max_time=0.0), checkpoint=keep)
    begun, found = studied(problem, options)
    assert not found.converged
    assert keep.read_text().count("\n") == 1
    assert studied(problem, options)[0] == begun == [0, 1]


@pytest.mark.slow
@pytest.mark.parametrize("jobs", [2, 5])
def test_processes_find_the_same_bits(
    problem: hv.ContactProblem, exact: hv.workflows.Study, tmp_path: Path, jobs: int
) -> None:
    same_bits(hv.study(problem, 3, known=MANUFACTURED_EXACT, jobs=jobs), exact)
    keep = tmp_path / "a.jsonl"
    stopped_after(problem, 1, StudyOptions(3, checkpoint=keep, jobs=jobs))
    assert keep.read_text().count("\n") == 2
    same_bits(hv.study(problem, 3, known=MANUFACTURED_EXACT, jobs=jobs, checkpoint=keep), exact)
    assert keep.read_text().count("\n") == 5


def test_what_makes_no_sense_is_refused(problem: hv.ContactProblem) -> None:
    with pytest.raises(ProblemError, match="refine is 0"):
        hv.study(problem, 0)
    with pytest.raises(ProblemError, match="jobs is 0"):
        hv.study(problem, 1, jobs=0)
    with pytest.raises(ProblemError, match="calls no function"):
        hv.study(problem, 1, jobs=2, controls=hv.Controls(callback=lambda _: None))
    with pytest.raises(ProblemError, match="has 1 components and the displacement 2"):
        hv.study(problem, 1, known=["x"])
    with pytest.raises(ProblemError, match="uses t"):
        hv.study(problem, 1, known=["t", "0"])
    with pytest.raises(ProblemError, match="exact solution: formula"):
        hv.study(problem, 1, known=["log(x - 9)", "0"])
    with pytest.raises(ProblemError, match="whose mesh can be refined"):
        hv.study(hv.discretize(problem), 1)  # type: ignore[arg-type]


def test_table_and_figure_show_what_was_found(exact: hv.workflows.Study) -> None:
    table = Table.of(exact.rows(), "a_b & 50%")
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
    orders = [order for order in exact.orders.values() if order > 0.0]
    assert sorted(slopes) == pytest.approx(sorted(orders), abs=0.005)  # two decimals, as the legend has them


def test_the_guaranteed_bound_is_a_column_and_no_bound_is_below_its_error() -> None:
    found = hv.study(square(n=2), 3, exact=True, method="newton")
    errors = found.errors("energy")
    assert np.isfinite(found.bounds).all()
    assert (found.bounds[:-1] >= errors[:-1]).all()
    assert found.bounds[-1] < found.bounds[0]
    column = [row[Table.of(found.rows()).columns.index("guaranteed bound")] for row in Table.of(found.rows()).rows]
    assert column == found.bounds.tolist()
    assert "guaranteed bound" not in Table.of(hv.study(square(n=2), 1).rows()).columns
    labels = [text.get_text() for text in plot_study(found).axes[0].get_legend().get_texts()]
    assert "energy norm, guaranteed bound" in labels


def test_no_bound_says_why() -> None:
    coulomb = {"bottom": hv.Contact(hv.Signorini(), hv.Coulomb(0.2))}
    found = hv.study(replace(square(n=2), contact=coulomb), 1, exact=True)
    assert np.isinf(found.bounds).all()
    assert all(level.unbounded for level in found.levels)
    table = Table.of(found.rows())
    assert [row[table.columns.index("guaranteed bound")] for row in table.rows] == [None, None]
