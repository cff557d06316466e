"""The survey's section 5, on coarse meshes, and its report."""

import csv
import itertools
import math
from pathlib import Path
from typing import Any

import pytest

from hemivar.errors import ProblemError
from hemivar.survey.survey_report import SurveyReport, run_survey
from hemivar.workflows.events import Phase

#: What a run returned and what it told on the way.
Small = tuple[SurveyReport, list[Phase]]


@pytest.fixture(scope="module", params=[pytest.param(8, marks=pytest.mark.slow)])
def small(tmp_path_factory: pytest.TempPathFactory, request: pytest.FixtureRequest) -> Small:
    said = []
    result = run_survey(tmp_path_factory.mktemp("survey"), max_n=request.param, progress=said.append)
    return result, said


def test_everything_is_written(small: Small) -> None:
    result, said = small
    names = {path.name for path in result.files}
    expected = {f"figure{k}{suffix}" for k in range(1, 6) for suffix in (".png", ".pdf")}
    expected |= {"table1.csv", "table1.md", "errors.csv", "orders.csv", "runs.csv", "methods.csv", "bounds.csv"}
    expected |= {"report.html"}
    assert expected <= names
    begins = {".png": b"\x89PNG\r", ".pdf": b"%PDF-", ".html": b"<!DOCTYPE html>", ".md": b"**Table 1"}
    for path in result.files:
        if path.suffix in begins:
            assert path.read_bytes().startswith(begins[path.suffix]), path
    with (result.files[0].parent / "errors.csv").open() as file:
        header, *rows = csv.reader(file)
    assert header == ["reference", "method", "h = 1/2", "h = 1/4", "h = 1/8"]
    assert {(a, b): [float(value) for value in values] for a, b, *values in rows} == {
        pair: pytest.approx(values, rel=1e-12) for pair, values in result.runs.errors.items()
    }
    assert not result.runs.interrupted
    assert any("Figure 5" in stage.name for stage in said)


def test_nine_curves_fall(small: Small) -> None:
    result, _ = small
    assert len(result.runs.errors) == 9
    assert result.runs.sizes == (0.5, 0.25, 0.125)
    for values in result.runs.errors.values():
        assert all(fine < coarse for coarse, fine in itertools.pairwise(values))
    assert all(0.6 < order < 1.1 for order in result.runs.orders.values())


def test_methods_agree(small: Small) -> None:
    result, _ = small
    runs = result.runs.rows()
    assert len(runs) == sum(len(level.solutions) for level in result.runs.meshes)
    assert {row["method"]: row["difference"] for row in runs}["newton"] == 0.0
    columns = result.methods_table().columns
    for row in result.methods_table().rows:
        cells = dict(zip(columns, row, strict=True))
        if cells["status"] == "converged":
            assert cells["difference"] < 1e-6


def test_table_1_has_the_survey_beside(small: Small) -> None:
    result, _ = small
    rows = {(row[0], row[1], row[2]): row[3:] for row in result.table1().rows}
    assert rows["direct optimization", "functional evaluations", "survey"] == (1027,)
    assert rows["primal-dual active set", "set iterations", "hemivar"][0] >= 1
    times = [row[3] for row in result.table1().rows if row[1:3] == ("time, s", "hemivar")]
    assert len(times) >= 3
    assert all(isinstance(value, float) and 0.0 < value < 60.0 for value in times)


def test_figure_3_friction(small: Small) -> None:
    result, _ = small
    assert result.runs.friction[32] == pytest.approx(0.4986, abs=5e-5)


def test_report_is_one_page(small: Small) -> None:
    result, _ = small
    page = (result.folder / "report.html").read_text()
    assert page.count("data:image/svg+xml;base64,") == 9
    assert 'src="figure' not in page
    assert "Table 1" in page
    assert "numpy" in page


@pytest.mark.slow
def test_interruption_leaves_a_report(tmp_path: Path) -> None:
    def progress(stage: Phase) -> None:
        if stage.name.startswith("Figure 2"):
            raise KeyboardInterrupt

    result = run_survey(tmp_path, max_n=8, progress=progress)
    assert result.runs.interrupted
    page = (tmp_path / "report.html").read_text()
    assert "interrupted" in page
    assert (tmp_path / "figure1.png").exists()
    assert not (tmp_path / "figure2.png").exists()
    assert result.runs.errors == {}


@pytest.mark.slow
def test_time_limit_is_said_and_the_run_goes_on(tmp_path: Path) -> None:
    result = run_survey(tmp_path, max_n=8, method_time_limit=1e-9)
    times = [cell for row in result.table1().rows if row[2] == "hemivar" and "time" in row[1] for cell in row[3:]]
    assert "> 1e-09 s" in times
    assert all(math.isfinite(x) for values in result.runs.errors.values() for x in values)


@pytest.mark.parametrize("options", [{"max_n": 12}, {"max_n": 4}, {"method_time_limit": 0.0}])
def test_options_are_checked(tmp_path: Path, options: dict[str, Any]) -> None:
    with pytest.raises(ProblemError):
        run_survey(tmp_path, **options)


def test_folder_that_cannot_be_made(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(ProblemError, match="cannot be made"):
        run_survey(tmp_path / "file" / "folder")


def test_bounds_are_above_all_nine_curves(small: Small) -> None:
    """Guaranteed, and no error is above; where a method converged they are near."""
    result, _ = small
    runs = result.runs
    assert runs.not_guaranteed == ()
    assert set(runs.bounds) == {"Direct", "AL", "PD"}
    for (_, method), errors in runs.errors.items():
        ratios = [bound / error for bound, error in zip(runs.bounds[method], errors, strict=True)]
        assert min(ratios) > 1.0
        assert method == "Direct" or max(ratios[:-1]) < 1.5  # the last error shares much with its reference
    with (result.folder / "bounds.csv").open() as file:
        header, *rows = csv.reader(file)
    assert header == ["method", "", "h = 1/2", "h = 1/4", "h = 1/8"]
    assert len(rows) == 12
    assert [float(value) for value in rows[0][2:]] == pytest.approx(runs.bounds["Direct"])
    page = (result.folder / "report.html").read_text()
    assert "upper bounds of the distance to the exact solution" in page
    assert "No bound but an estimate" not in page


@pytest.mark.slow
def test_a_survey_without_bounds(tmp_path: Path) -> None:
    result = run_survey(tmp_path, max_n=8, bounds=False)
    assert result.runs.bounds == {}
    assert not (tmp_path / "bounds.csv").exists()
