"""Figures for print have the width, the letters and the legends that a journal asks for."""

from __future__ import annotations

import itertools
from pathlib import Path

import pytest
from matplotlib.text import Text
from PIL import Image

import hemivar as hv
from hemivar import gallery
from hemivar.errors import ProblemError
from hemivar.report import paper, plot_contact, plot_study, save
from tests.samples import sampled

INCH = 25.4


@pytest.fixture(scope="module")
def solution() -> hv.Solution:
    return hv.solve(gallery.survey("5.1", 8))


@pytest.mark.parametrize(
    ("legend", "width"),
    sampled(
        itertools.product(("outside", "inside", "none"), (60.0, 84.0, 174.0)), [("outside", 60.0), ("inside", 84.0)]
    ),
)
def test_width_is_met_and_letters_have_one_size(
    solution: hv.Solution, width: float, legend: str, tmp_path: Path
) -> None:
    with paper(f"{width}mm", font=7.0, legend=legend):
        for number, figure in enumerate((solution.plot(), plot_contact(solution))):
            path = save(figure, tmp_path / f"{number}.png", dpi=150)
            with Image.open(path) as picture:
                assert picture.size[0] / 150 * INCH == pytest.approx(width, rel=0.03)
            texts = [one for one in figure.findobj(Text) if one.get_text() and one.get_visible()]
            assert max(text.get_fontsize() for text in texts) == pytest.approx(7.0)
            legends = [*figure.legends, *(ax.get_legend() for ax in figure.axes if ax.get_legend())]
            assert bool(legends) == (legend != "none")


def test_notes_are_left_out_unless_asked_for(solution: hv.Solution) -> None:
    def words(**options: bool) -> str:
        with paper("84mm", **options):
            return " ".join(one.get_text() for one in solution.plot(title="named").findobj(Text))

    assert "residual" in words(annotations=True)
    assert "named" in words(annotations=True).split()
    assert not {"residual", "survey", "named"} & set(words().split())


def test_outside_of_it_nothing_is_changed(solution: hv.Solution) -> None:
    before = solution.plot().get_size_inches()
    with paper("60mm"):
        assert solution.plot().get_size_inches()[0] < before[0]
    assert solution.plot().get_size_inches() == pytest.approx(before)


def test_triangles_have_the_slope_that_the_legend_says() -> None:
    study = hv.study(gallery.survey("5.1", 4), 3)
    with paper("84mm", legend="inside"):
        ax = plot_study(study).axes[0]
    said = {f"{order:.2f}" for order in study.orders.values()}
    assert said <= {text.get_text() for text in ax.texts}
    assert all(any(value in one.get_text() for one in ax.get_legend().get_texts()) for value in said)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"width": "84"}, None),
        ({"width": "wide"}, "width = 'wide'"),
        ({"width": "5mm"}, "from 20 to 500 mm"),
        ({"width": "nanmm"}, "from 20 to 500 mm"),
        ({"font": 1.0}, "from 4 to 24 points"),
        ({"legend": "below"}, "'outside', 'inside' or 'none'"),
    ],
)
def test_bad_wishes_are_refused(options: dict[str, object], words: str | None) -> None:
    if words is None:
        with paper(**options):
            return
    with pytest.raises(ProblemError, match=words), paper(**options):
        pass


@pytest.mark.parametrize("kind", ["body", "membrane", "maps"])
def test_a_legend_covers_no_name_of_an_axis(kind: str) -> None:
    """Nor a scale of colours; whatever the height of the axes above it."""
    if kind == "membrane":
        found = hv.solve(gallery.membrane_obstacle(8).problem)
    else:
        found = hv.solve(gallery.survey_cube("5.1", 3) if kind == "maps" else gallery.survey("5.1", 4))
    with paper("84mm", legend="inside"):
        figure = plot_contact(found) if kind == "maps" else found.plot()
    figure.draw_without_rendering()
    (legend,) = (one for ax in figure.axes if (one := ax.get_legend()) is not None)
    covered = legend.get_window_extent()
    for name in (axis.label for ax in figure.axes for axis in (ax.xaxis, ax.yaxis) if axis.label.get_text()):
        assert not covered.overlaps(name.get_window_extent()), name
