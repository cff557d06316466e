"""Figures and films of evolutions: what is drawn are the numbers of the table."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from matplotlib.collections import LineCollection, QuadMesh

import hemivar as hv
from hemivar.errors import ProblemError
from hemivar.evolution import Evolution, History, Save, march
from hemivar.files.film import film_of, read_film
from hemivar.files.history_table import read_history_table
from hemivar.report import Units, animate, plot_march, save
from hemivar.report.animation import check_film
from hemivar.report.march_figures import MARCH_FIGURES
from tests import bodies


@pytest.fixture(scope="module")
def history() -> History:
    contact = hv.Contact(hv.Compliance(20.0), hv.Tresca(0.05), gap=0.02)
    problem = bodies.strip(contact, (6, 3), density=1.0, viscosity=(0.4, 0.4), body_force=(0.0, -0.5))
    return march(Evolution(problem, inertia=True), 1.0, step=0.05, save=Save(every=0.1, probes={"tip": (2.0, 1.0)}))


def keywords_of(kind: str) -> dict[str, object]:
    return {"columns": ("tip.u_y", "residual")} if kind == "columns" else {}


@pytest.mark.parametrize("kind", MARCH_FIGURES)
def test_every_figure_is_drawn_and_labelled(kind: str, history: History, tmp_path: Path) -> None:
    units = Units("s", "mm", "N/mm", "MPa", "mJ/mm")
    fig = plot_march(history, kind, units=units, title="block", **keywords_of(kind))  # type: ignore[arg-type]
    path = save(fig, tmp_path / f"{kind}.png", dpi=50)
    assert path.stat().st_size > 3000
    labels = [axis.get_label_text() for ax in fig.axes for axis in (ax.xaxis, ax.yaxis)]
    assert any("(s)" in label for label in labels)
    assert fig.get_suptitle() == "block"


def test_the_ledger_stacks_to_what_was_put_in(history: History) -> None:
    """The upper edge of the highest area is the line of the work, up to the gap."""
    upper = plot_march(history).axes[0]
    put_in = next(line for line in upper.lines if line.get_label() == "external work").get_ydata()
    top = np.full(len(history.times), -np.inf)
    for area in upper.collections:
        vertices = area.get_paths()[0].vertices
        for k, time in enumerate(history.times):
            here = vertices[np.isclose(vertices[:, 0], time), 1]
            top[k] = max(top[k], here.max(initial=-np.inf))
    assert top == pytest.approx(np.asarray(put_in), rel=1e-3, abs=1e-4 * float(np.max(put_in)))


def test_the_ledger_of_a_warm_body_closes() -> None:
    """Work of thermal stress is put in, too: what is left of the balance is that of the table."""
    problem = bodies.square(hv.Compliance(20.0), 2, viscosity=(0.4, 0.4))
    heat = hv.mechanics.Heat(1.0, 1.0, expansion=0.01, source=1.0, supports={"left": 0.0})
    warm = march(Evolution(problem, heat=heat), 1.0, step=0.25)
    table = warm.rows().by_name()
    upper, lower = plot_march(table).axes
    put_in = next(line for line in upper.lines if line.get_label() == "external work").get_ydata()
    assert table["thermal"][-1] > 1e-5
    assert np.asarray(put_in) == pytest.approx(table["thermal"], rel=1e-12)
    assert np.asarray(lower.lines[0].get_ydata()).max() < 1e-9
    labelled = plot_march(table, "columns", columns=("thermal",), units=Units(energy="mJ"))
    assert labelled.axes[0].get_ylabel() == "thermal (mJ)"


def test_what_was_stored_at_first_was_put_in(history: History) -> None:
    """And the balance below holds whatever the body began with."""
    table = {name: np.array(values) for name, values in history.rows().by_name().items()}
    table["kinetic"] = table["kinetic"] + 5.0
    upper, lower = plot_march(table).axes[:2]
    put_in = next(line for line in upper.lines if line.get_label() == "external work").get_ydata()
    assert np.asarray(put_in) == pytest.approx(5.0 + table["work"] + table["moved"])
    assert np.max(lower.lines[0].get_ydata()) < 1e-12


def test_the_length_of_a_step_is_drawn_before_its_end(history: History) -> None:
    first, _, third = plot_march(history, "steps").axes[:3]
    assert first.lines[0].get_drawstyle() == "steps-pre"
    assert np.array_equal(first.lines[0].get_xdata(), history.times[1:])
    table = {name: np.array(values) for name, values in history.rows().by_name().items()}
    table["margin"][1:] = -np.inf
    third = plot_march(table, "steps").axes[2]
    assert [text.get_text() for text in third.texts] == ["no bound: -inf"]
    assert np.isfinite(third.get_ylim()).all()
    loop = plot_march(table, "loop", units=Units(force="N")).axes[0]
    assert loop.get_ylabel() == "normal force (N)"
    table["tip.u_z"] = table["tip.u_y"]
    units = Units("s", "mm", "N")
    assert plot_march(table, "forces", units=units).axes[1].get_ylabel() == "contact\narea (mm\N{SUPERSCRIPT TWO})"


def test_a_loop_goes_through_the_moments(history: History) -> None:
    lines = next(c for c in plot_march(history, "loop").axes[0].collections if isinstance(c, LineCollection))
    ends = np.array([segment[1] for segment in lines.get_segments()])
    assert np.array_equal(ends[:, 0], history["tip.u_y"][1:])
    assert np.array_equal(ends[:, 1], history["normal_force"][1:])
    assert np.array_equal(lines.get_array(), history.times[1:])
    table = dict(history.rows().by_name())
    table["tip.u_x"] = 10.0 * np.arange(len(table["time"]))
    table["friction_force"] = 3.0 * table["normal_force"]
    moving = plot_march(table, "loop").axes[0]
    assert (moving.get_xlabel(), moving.get_ylabel()) == ("displacement x, tip", "friction force")
    other = plot_march(history, "loop", columns=("penetration", "kinetic")).axes[0]
    assert (other.get_xlabel(), other.get_ylabel()) == ("penetration", "kinetic")


def test_the_map_shows_states_and_pressure(history: History) -> None:
    left, right = plot_march(history, "map").axes[:2]
    pressure = next(c for c in right.collections if isinstance(c, QuadMesh)).get_array()
    given = np.array([frame.multiplier[:, 0] for frame in history.frames])
    order = np.argsort(history.discrete.problem.contact.points[:, 0])  # type: ignore[index]
    assert np.array_equal(np.asarray(pressure).reshape(given.shape), given[:, order])
    states = next(c for c in left.collections if isinstance(c, QuadMesh)).get_array()
    assert set(np.unique(np.asarray(states))) >= {0, 2}


def test_a_table_that_was_read_back_is_drawn_as_the_history(history: History, tmp_path: Path) -> None:
    (path,) = history.write(tmp_path / "run.csv")
    table = read_history_table(path)
    for kind in ("ledger", "forces", "loop", "steps"):
        one, other = plot_march(history, kind), plot_march(table, kind)
        assert [len(ax.lines) for ax in one.axes] == [len(ax.lines) for ax in other.axes]


@pytest.mark.parametrize(
    ("call", "says"),
    [
        (lambda h: h.plot("nothing"), "choose one of ledger, forces"),
        (lambda h: h.plot("columns"), "name 1 to 8 columns"),
        (lambda h: h.plot("columns", columns=("nothing",)), "no column 'nothing'"),
        (lambda h: h.plot("loop", columns=("time",)), "a loop is drawn of two columns"),
        (lambda h: h.plot("map", boundary="top"), "no contact boundary 'top' .known: bottom"),
        (lambda h: plot_march({"time": h.times}, "map"), "the map needs frames"),
        (lambda h: plot_march({"time": h.times}, "ledger"), "has no energy balance"),
        (lambda h: plot_march({"time": h.times}, "forces"), "holds no forces"),
        (lambda h: plot_march({"time": h.times, "step": h["step"]}, "steps"), "holds no steps .column 'residual'"),
        (lambda h: h.animate("run.avi"), "films are written as .gif or .mp4"),
        (lambda h: h.animate("run.gif", seconds=0.0), "seconds = 0"),
        (lambda h: h.animate("run.gif", frames=0), "frames = 0"),
        (lambda h: h.animate("run.gif", dpi=1), "dpi = 1"),
        (lambda h: h.animate("run.gif", scale=-1.0), "scale = -1"),
    ],
)
def test_bad_input(call: Callable[[History], object], says: str, history: History) -> None:
    with pytest.raises(ProblemError, match=says):
        call(history)


def test_a_film_has_its_frames_and_one_size(history: History, tmp_path: Path) -> None:
    from PIL import Image

    told: list[tuple[int, int]] = []
    path = animate(history, tmp_path / "a.gif", frames=5, dpi=40, progress=lambda now, all: told.append((now, all)))
    assert told == [(k, 5) for k in range(1, 6)]
    with Image.open(path) as film:
        assert film.n_frames == 5  # type: ignore[attr-defined]


def test_a_film_from_files_is_that_of_the_history(history: History, tmp_path: Path) -> None:
    """Frames of both are the same, and so are the pictures."""
    made = film_of(history)
    read = read_film(history.write(tmp_path / "run.pvd")[0])
    assert np.array_equal(made.times, read.times)
    for number in range(len(made.times)):
        one, other = made.frame(number), read.frame(number)
        assert np.array_equal(one.displacement, other.displacement)
        order = np.lexsort(one.places.T)
        again = np.lexsort(other.places.T)
        for name in ("places", "moved", "force", "gap"):
            assert np.array_equal(getattr(one, name)[order], getattr(other, name)[again])
        assert np.array_equal(one.states.take(order).numbers, other.states.take(again).numbers)
    first = animate(made, tmp_path / "a.gif", frames=3, dpi=40).read_bytes()
    assert first == animate(read, tmp_path / "b.gif", frames=3, dpi=40).read_bytes()


def test_a_film_in_three_dimensions(tmp_path: Path) -> None:
    contact = hv.Contact(hv.Compliance(50.0), hv.Tresca(0.01), gap=0.1)
    problem = bodies.cube(
        contact, (2, 2, 1), size=(1.0, 1.0, 0.5), density=1.0, supports={}, body_force=(0.0, 0.0, -1.0)
    )
    found = march(Evolution(problem, inertia=True, velocity=(0.2, 0.0, -0.5)), 0.4, step=0.1)
    assert animate(found, tmp_path / "a.gif", frames=2, dpi=40).stat().st_size > 3000


def test_mp4_needs_ffmpeg(history: History, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import shutil

    from matplotlib.animation import FFMpegWriter

    if shutil.which("ffmpeg"):
        assert animate(history, tmp_path / "a.mp4", frames=3, dpi=40).stat().st_size > 1000
    monkeypatch.setattr(FFMpegWriter, "isAvailable", classmethod(lambda cls: False))
    with pytest.raises(ProblemError, match="ffmpeg is not installed"):
        check_film("a.mp4")


def test_a_notebook_shows_a_history(history: History) -> None:
    shown = history._repr_html_()
    assert "data:image/png" in shown
    assert "not known" in shown
    assert "finished at t = 1 after" in shown
