"""Pictures that a notebook shows by themselves, and tables for pandas, of every value that has them."""

from __future__ import annotations

import copy
import pickle
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path as FilePath
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import hemivar as hv
from hemivar import report
from hemivar.basics.display import ReprMixin
from hemivar.errors import ProblemError
from hemivar.gallery import survey
from hemivar.report.notebook import picture_of
from hemivar.workflows.sweep import SweepAxis
from tests.problems import bar
from tests.report.test_notebook import Reader, picture_size, shown
from tests.samples import sampled

THREE = bar(0.5, hv.laws.PiecewiseQuadratic([0.0, 0.1, 0.2], [0.0, 2.0, -2.0, 0.0], [0.0, 0.0, 0.0]))


def swept(q_max: float) -> hv.ContactProblem:
    return replace(survey("5.1", 2), contact={"bottom": hv.Contact(hv.laws.ThresholdCompliance(q_max, 2.0))})


MADE: dict[str, Callable[[], Any]] = {
    "problem": lambda: survey("5.1", 2),
    "discrete": lambda: hv.discretize(survey("5.1", 2)),
    "solution": lambda: hv.solve(hv.discretize(survey("5.1", 2))),
    "certificate": lambda: hv.solve(THREE).certify(),
    "path": lambda: hv.follow_path(THREE),
    "solutions": lambda: hv.find_solutions(THREE),
    "history": lambda: hv.march(hv.Evolution(survey("5.1", 2)), 0.1, step=0.1),
    "study": lambda: hv.study(survey("5.1", 2), 2),
    "in time": lambda: hv.workflows.result_of(
        hv.workflows.study_time(
            hv.Evolution(survey("5.1", 2)), hv.evolution.March(0.2, step=0.1), hv.workflows.TimeStudyOptions(2)
        )
    ),
    "sweep": lambda: hv.sweep(swept, {"q_max": [0.0, 0.5]}),
    "adaptive": lambda: hv.bounds.solve_adaptive(survey("5.1", 4), rtol=0.5),
}


@pytest.fixture(scope="module")
def values() -> dict[str, Any]:
    return {name: make() for name, make in MADE.items()}


@pytest.mark.parametrize("name", sampled(MADE, 4))
def test_a_value_shows_a_picture_without_being_told_how(name: str, values: dict[str, Any], tmp_path: FilePath) -> None:
    figure = values[name].plot()
    wide, high = picture_size(figure._repr_png_())
    assert 250 < wide < 1200
    assert 150 < high < 1200
    figure.savefig(tmp_path / "figure.pdf")
    assert (tmp_path / "figure.pdf").read_bytes().startswith(b"%PDF")


@pytest.mark.parametrize("name", sampled(MADE, 3))
def test_a_value_is_shown_by_a_picture_and_a_table(name: str, values: dict[str, Any]) -> None:
    page = shown(values[name])
    assert len(page.pictures) == 1
    assert "table" in page.tags


@pytest.mark.parametrize("name", sampled(MADE, 4))
def test_a_notebook_shows_the_figure_and_no_name_of_it(name: str, values: dict[str, Any]) -> None:
    formatters = pytest.importorskip("IPython.core.formatters")
    data, _ = formatters.DisplayFormatter().format(values[name].plot())
    assert data["image/png"].startswith(b"\x89PNG")
    shown_as, _ = formatters.DisplayFormatter().format(values[name])
    assert "<img" in shown_as["text/html"]


def test_every_class_that_shows_itself_is_tried_here(values: dict[str, Any]) -> None:
    def below(kind: type) -> set[type]:
        return {kind} | {other for one in kind.__subclasses__() for other in below(one)}

    public = {kind for kind in below(ReprMixin) if kind.__module__.startswith("hemivar.")} - {ReprMixin}
    assert {one.__name__ for one in public} <= {type(one).__name__ for one in values.values()} | {
        "Convergence",
        "ScalarProblem",
        "Statement",
    }


def test_figures_are_matplotlibs_and_can_be_kept() -> None:
    from matplotlib.figure import Figure

    figure = survey("5.1", 2).plot()
    assert isinstance(figure, Figure)
    for again in (pickle.loads(pickle.dumps(figure)), copy.deepcopy(figure)):
        assert type(again) is type(figure)
        assert len(again.axes) == len(figure.axes)
        assert again._repr_png_().startswith(b"\x89PNG")


def test_every_figure_is_of_that_kind() -> None:
    """What a function draws on is made by ``new_figure``, which cuts texts that fit into no picture."""
    folder = FilePath(report.__file__).parent
    made = [path.name for path in folder.glob("*.py") if "= Figure(" in path.read_text(encoding="utf-8")]
    assert not made


def test_pyplot_knows_of_no_figure() -> None:
    code = (
        "import sys\nfrom hemivar.gallery import survey\nfigure = survey('5.1', 2).plot()\nfigure._repr_png_()\n"
        "assert 'matplotlib.pyplot' not in sys.modules\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


# ---- what there is nothing to draw of --------------------------------------------------------------------------


def test_nothing_to_draw_is_said(values: dict[str, Any]) -> None:
    with pytest.raises(ProblemError, match="made of arrays"):
        THREE.plot()
    with pytest.raises(ProblemError, match="no solution was found"):
        replace(values["solutions"], solutions=()).plot()
    with pytest.raises(ProblemError, match="no picture of a str"):
        picture_of("text")


# ---- the certificate -------------------------------------------------------------------------------------------


def bar_ends(figure: Any, panel: int) -> list[tuple[float, bool]]:
    """Where bars end, and whether they are filled."""
    found = figure.axes[panel].patches
    return [(one.get_x() + one.get_width(), one.get_facecolor()[3] > 0.0) for one in found]


def words(figure: Any) -> str:
    texts = [text.get_text() for ax in figure.axes for text in (*ax.texts, *ax.get_yticklabels())]
    return "\n".join([figure.get_suptitle(), *texts])


def test_a_certificate_as_a_picture(values: dict[str, Any]) -> None:
    several = values["certificate"]
    figure = several.plot()
    ((end, filled),) = bar_ends(figure, 0)
    assert end == pytest.approx(1.0 - several.margin)
    assert filled
    assert "no bound: the margin is not positive" in words(figure)
    assert "uniqueness not known" in figure.get_suptitle()

    one = values["solution"].certify(exact=True)
    figure = one.plot()
    equilibrium, _, discrete, exact = bar_ends(figure, 1)
    assert equilibrium[0] == pytest.approx(one.equilibrium_relative)
    assert discrete == (pytest.approx(one.error_bound_relative), True)
    assert exact == (pytest.approx(one.exact.relative), one.exact.guaranteed)
    assert "the only solution" in figure.get_suptitle()


def test_what_is_sampled_or_left_out_looks_so(values: dict[str, Any]) -> None:
    one = values["solution"].certify()
    sampled = replace(one, error_bound_sampled=True, smallness=replace(one.smallness, alpha_sampled=True))
    figure = report.plot_certificate(sampled)
    assert not bar_ends(figure, 0)[0][1]
    assert not bar_ends(figure, 1)[2][1]
    assert "(sampled)" in words(figure)
    assert "about" in words(figure)
    late = replace(one, left_out=("margin", "error bound"), margin=-np.inf, error_bound_relative=np.inf)
    figure = report.plot_certificate(late)
    assert bar_ends(figure, 0) == []
    assert words(figure).count("because the time limit was reached") == 2
    endless = report.plot_certificate(replace(one, margin=-np.inf))
    assert bar_ends(endless, 0)[0][0] > endless.axes[0].get_xlim()[1]


# ---- the certificate beside solutions and problems -------------------------------------------------------------


def test_the_certificate_stands_beside_the_solution(values: dict[str, Any]) -> None:
    solution = values["solution"]
    certificate = solution.certify()
    page = shown(solution)
    assert page.row("kind") == f"{certificate.kind.value}; the only solution"
    assert page.row("distance") == certificate.claim("distance").sentence
    assert "kind" not in shown(replace(solution, status=hv.Status.MAX_STEPS)).texts


def test_whether_a_problem_has_one_solution_stands_beside_it() -> None:
    assert shown(survey("5.1", 2)).row("margin") == "1: one solution"
    several = shown(THREE).row("margin")
    assert "there may be several" in several
    assert float(several.split(":")[0].split(",")[0]) == pytest.approx(
        hv.certificates.smallness(THREE).margin, rel=1e-3
    )
    loose = replace(survey("5.1", 2), supports={}, contact={})
    assert "held" in shown(loose).row("refused") or "support" in shown(loose).row("refused")


def test_a_long_sweep_is_shown_in_part(values: dict[str, Any]) -> None:
    points = tuple(replace(point, place=(k,)) for k in range(23) for point in values["sweep"].points[:1])
    found = replace(values["sweep"], axes=(SweepAxis("q_max", tuple(range(23))),), points=points)
    page = Reader(found._repr_html_())
    assert page.tags.count("tr") == 21
    assert "and 3 more rows" in page.texts


# ---- pandas ----------------------------------------------------------------------------------------------------


class Frame(dict):  # type: ignore[type-arg]
    """What the library asks of pandas: columns of one length."""

    def __init__(self, columns: dict[str, Any]) -> None:
        super().__init__(columns)
        assert len({len(column) for column in columns.values()}) == 1


@pytest.fixture
def columns_only(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pandas", SimpleNamespace(DataFrame=Frame))


@pytest.mark.parametrize("name", MADE)
def test_without_pandas_it_is_said_what_to_do(
    name: str, values: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(ProblemError, match="pip install pandas, or take"):
        values[name].to_dataframe()


@pytest.mark.usefixtures("columns_only")
def test_a_row_for_each_part(values: dict[str, Any]) -> None:
    path, found, study = values["path"], values["solutions"], values["study"]
    frame = path.to_dataframe()
    assert np.array_equal(frame["load_factor"], path.load_factor)
    assert np.array_equal(frame["normal_force"], path.normal_force)
    assert found.to_dataframe()["energy"] == list(found.energies)
    assert list(study.to_dataframe()["energy error"])[:-1] == list(study.errors("energy"))[:-1]
    assert values["sweep"].to_dataframe()["q_max"] == [0.0, 0.5]
    assert len(values["adaptive"].to_dataframe()["unknowns"]) == len(values["adaptive"].levels)
    certificate = values["certificate"].to_dataframe()
    claimed = dict(zip(certificate["label"], certificate["value"], strict=True))
    assert claimed["margin"] == values["certificate"].margin
    problem = values["problem"].to_dataframe()
    assert "support: left" in problem["name"]


def test_dataframes_of_pandas(values: dict[str, Any]) -> None:
    pandas = pytest.importorskip("pandas")
    for name, value in values.items():
        frame = value.to_dataframe()
        assert isinstance(frame, pandas.DataFrame), name
        assert len(frame)
    assert values["study"].to_dataframe()["energy error"].dtype == float
    table = report.Table.of(values["study"].rows())
    assert list(table.to_dataframe().columns) == list(table.columns)
    assert "<table>" in table._repr_html_()
