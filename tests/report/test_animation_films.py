"""What films show: bodies, states, forces and the foundation, on one scale for all frames."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from PIL import Image

import hemivar as hv
from hemivar.basics.types import Array
from hemivar.cli import main
from hemivar.errors import ProblemError
from hemivar.evolution import History
from hemivar.files.film import Film, FilmFrame, film_of, read_film
from hemivar.report import animate
from hemivar.report.animation import write_gif
from hemivar.report.film_pictures import FilmColour, PlanePicture, SolidPicture
from hemivar.report.style import BLUE
from hemivar.solvers.contact_states import KINDS, ContactStates
from tests import bodies
from tests.samples import slow


@cache
def worn() -> History:
    """A block is rubbed along a hump, which wears."""
    problem = bodies.strip(
        hv.Contact(
            hv.Compliance(1000.0),
            hv.Tresca(0.05),
            gap=lambda x: 0.1 * (x[:, 0] - 1.0) ** 2,
            memory=(hv.laws.Wear(0.1),),
        ),
        (6, 3),
        material=hv.Material.young(100.0, 0.3),
        supports={"top": hv.Fixed(x=lambda x, t: 0.3 * t + 0.0 * x[:, 0])},
        body_force=(0.0, -1.0),
        title="hump",
    )
    return hv.march(hv.Evolution(problem), 0.4, step=0.1, save=hv.evolution.Save(every=0.1))


def flying(dim: int, frames: int = 4) -> Film:
    """A body that flies and turns not, pushed by forces that grow, made without a march."""
    mesh = hv.rectangle((2.0, 1.0), (2, 1)) if dim == 2 else hv.box((4.0, 1.0, 1.0), (4, 1, 1))
    side = mesh.points[:, 1] == 0.0 if dim == 2 else mesh.points[:, 0] == 0.0
    places = mesh.points[side]
    way, normal = np.eye(dim)[0], -np.eye(dim)[1 if dim == 2 else 0]

    def frame(number: int) -> FilmFrame:
        moved = 0.5 * number * way
        speed = np.arange(len(mesh.points), dtype=float)[:, None] * way * number
        states = ContactStates.of_codes(np.arange(len(places)) % 3)
        return FilmFrame(
            0.25 * number,
            np.tile(moved, (len(mesh.points), 1)),
            speed,
            places,
            np.tile(moved, (len(places), 1)),
            np.tile(-number * normal, (len(places), 1)),
            states,
            np.full(len(places), 0.1),
        )

    return Film(mesh.points, mesh.cells, 0.25 * np.arange(frames), "flight", frame)


def plane(film: Film, colour: FilmColour = FilmColour.NONE, scale: float = 1.0) -> PlanePicture:
    return PlanePicture(film, list(range(len(film.times))), scale, ("mm", "s"), colour)


def test_the_room_of_a_film_holds_all_its_frames() -> None:
    film = flying(2)
    picture = plane(film)
    (left, right), (bottom, top) = picture.ax.get_xlim(), picture.ax.get_ylim()
    for number in range(4):
        frame = film.frame(number)
        moved = film.points + frame.displacement
        tails = frame.places + frame.moved - picture.length * frame.force / 3.0
        for x, y in (*moved, *tails):
            assert left < x < right
            assert bottom < y < top
    assert bottom > -picture.length - 0.2  # and no more room than they need
    assert top < 1.3
    assert picture.strongest == 3.0
    limits = (left, right, bottom, top)
    scales = set()
    for number in range(4):
        picture.show(film.frame(number))
        scales.add(picture.arrows.scale)
    assert scales == {3.0 / picture.length}
    assert (*picture.ax.get_xlim(), *picture.ax.get_ylim()) == limits


def test_a_frame_shows_the_body_where_it_is() -> None:
    film = flying(2)
    picture = plane(film, scale=2.0)
    picture.show(film.frame(3))
    drawn = np.concatenate(picture.drawn.border.get_segments())
    assert drawn[:, 0].min() == pytest.approx(3.0)
    assert drawn[:, 0].max() == pytest.approx(5.0)
    assert picture.drawn.lines is not None
    across = np.asarray(picture.drawn.lines.get_path().vertices)[:, 0]
    assert (across.min(), across.max()) == pytest.approx((3.0, 5.0))
    assert picture.label.get_text() == "t = 0.750 s     displacement times 2"
    frame = film.frame(3)
    for kind, mark in picture.marks.items():
        assert np.array_equal(mark.get_xydata(), (frame.places + 2.0 * frame.moved)[frame.states.present[kind]])
    assert {len(mark.get_xdata()) for mark in picture.marks.values()} == {1}
    heads = picture.arrows.get_offsets() + frame.force / picture.arrows.scale
    below = frame.places + 2.0 * frame.moved - [0.0, 0.012 * picture.size]  # they push, and end at the marks
    np.testing.assert_allclose(heads, below, atol=1e-12)
    assert np.array_equal(np.stack([picture.arrows.U, picture.arrows.V], axis=1), frame.force)
    for name in ("x (mm)", "y (mm)"):
        assert name in (picture.ax.get_xlabel(), picture.ax.get_ylabel())
    told = [text.get_text() for text in picture.fig.legends[0].get_texts()]
    assert told == ["open", "contact, stick", "contact, slip", "force per area, at most 3"]


def test_a_straight_foundation_is_one_line_as_far_as_the_body_goes() -> None:
    film = flying(2)
    picture = plane(film)
    for number in (0, 3):
        picture.show(film.frame(number))
        (surface,) = picture.foundation.surfaces
        line = np.asarray(surface.get_xydata())
        assert line[:, 1] == pytest.approx(-0.1)
        assert -0.2 < line[:, 0].min() < 0.0
        assert 3.5 < line[:, 0].max() < 3.7
        ((ground, hatch),) = picture.foundation.grounds
        assert ground.get_xy()[:, 1].max() == pytest.approx(-0.1)
        assert ground.get_xy()[:, 1].min() > picture.ax.get_ylim()[0] - 1e-12  # none of it is cut off
        assert hatch.get_hatch()


def test_a_body_that_goes_too_far_is_refused() -> None:
    picture = plane(flying(2), scale=1e6)
    picture.show(flying(2).frame(3))
    assert np.asarray(picture.foundation.surfaces[0].get_xdata()).max() > 1.5e6
    for scale in (1e12, 1e308):
        with pytest.raises(ProblemError, match=r"cannot be drawn: the body has size 2\.24, and its displacement"):
            plane(flying(2), scale=scale)
    film = flying(2)
    point = Film(0.0 * film.points, film.cells, film.times, "", film.frame)
    with pytest.raises(ProblemError, match="the body has size 0,"):
        plane(point)


def curved(places: Array) -> PlanePicture:
    """A body with a bent lower side and these contact points, 0.2 above its foundation."""
    corners = np.array([[0.0, 0.0], [1.0, 0.0], [2.0, 0.5], [1.0, 1.5]])
    lifted = ContactStates.of_codes(np.zeros(len(places), dtype=np.int64))

    def frame(number: int) -> FilmFrame:
        none, rest = np.zeros((len(places), 2)), np.zeros((4, 2))
        return FilmFrame(float(number), rest, rest, places, none, none, lifted, np.full(len(places), 0.2))

    picture = plane(Film(corners, np.array([[0, 1, 3], [1, 2, 3]]), np.arange(2.0), "", frame))
    picture.show(frame(1))
    assert picture.time(frame(1)) == "t = 1.00 s"
    return picture


@pytest.mark.parametrize("middles", [False, True])
def test_the_foundation_of_a_bent_body_follows_it(middles: bool) -> None:
    """Whether contact points are vertices or the middles of edges: as far away as the gap, and a little longer."""
    corners = np.array([[0.0, 0.0], [1.0, 0.0], [2.0, 0.5]])
    picture = curved(0.5 * (corners[1:] + corners[:-1]) if middles else corners)
    (surface,) = picture.foundation.surfaces
    line = np.asarray(surface.get_xydata())
    assert line[1] == pytest.approx(corners[1] + 0.2 * np.array([0.5, -2.0]) / np.hypot(0.5, 2.0))
    assert line[0, 1] == pytest.approx(-0.2, abs=0.02)
    assert -0.1 < line[0, 0] < 0.0
    assert 2.0 < line[-1, 0] < 2.2
    assert len(picture.normal) == (2 if middles else 3)
    assert picture.normal[0] == pytest.approx([0.0, -1.0])


def test_a_single_contact_point_has_a_foundation() -> None:
    picture = curved(np.array([[0.0, 0.0]]))
    (surface,) = picture.foundation.surfaces
    to_corner = np.linalg.norm(np.asarray(surface.get_xydata()), axis=1)
    assert 0.19 < to_corner.min() < 0.21


def test_a_frame_is_drawn_over_what_rests_as_it_is_drawn_at_once() -> None:
    """Whatever was shown before: the same points as a picture that is drawn whole."""
    for film, kind in ((flying(2), PlanePicture), (flying(3), SolidPicture)):
        picture = kind(film, [0, 1, 2, 3], 1.0, ("", ""), FilmColour.SPEED)
        picture.image(film.frame(3))
        again = picture.image(film.frame(1))
        whole = kind(film, [0, 1, 2, 3], 1.0, ("", ""), FilmColour.SPEED)
        whole.show(film.frame(1))
        canvas = FigureCanvasAgg(whole.fig)
        canvas.draw()
        other = np.array(canvas.buffer_rgba())[:, :, :3]
        assert (np.abs(again.astype(int) - other).max(axis=2) > 40).mean() < 2e-3


@pytest.mark.parametrize("colour", [FilmColour.SPEED, FilmColour.DISPLACEMENT])
def test_colours_have_one_scale(colour: FilmColour) -> None:
    film = flying(2)
    picture = plane(film, colour)
    limits = picture.drawn.fill.get_clim()
    frame = film.frame(2)
    picture.show(frame)
    speeds = np.linalg.norm(frame.velocity if colour is FilmColour.SPEED else frame.displacement, axis=1)
    assert np.asarray(picture.drawn.fill.get_array()) == pytest.approx(speeds)
    assert picture.drawn.fill.get_clim() == limits
    most = np.linalg.norm(film.frame(3).velocity, axis=1) if colour is FilmColour.SPEED else np.full(1, 1.5)
    assert limits == (0.0, pytest.approx(np.quantile(most, 0.98)))
    (bar,) = [ax for ax in picture.fig.axes if ax is not picture.ax]
    assert bar.get_ylabel() == ("speed (mm/s)" if colour is FilmColour.SPEED else "displacement (mm)")


def test_a_body_in_space_shows_the_face_that_touches() -> None:
    film = flying(3)
    picture = SolidPicture(film, [0, 1, 2, 3], 2.0, ("m", "s"), FilmColour.SPEED)
    picture.show(film.frame(2))
    azimuth = np.radians(picture.ax.azim)
    assert np.cos(azimuth) < -0.3  # seen from x < 0
    assert 0.0 < picture.ax.elev < 60.0
    speeds = np.linalg.norm(film.frame(2).velocity, axis=1)
    assert np.asarray(picture.drawn.surface.get_array()) == pytest.approx(speeds[picture.drawn.facets].mean(axis=1))
    assert picture.ax.get_xlim3d() == pytest.approx((0.0, 4.0 + 2.0 * 1.5))
    data = np.array(picture.marks[KINDS[0]].get_data_3d()).T
    assert np.array_equal(data, (film.frame(2).places + 2.0 * np.eye(3)[0])[~film.frame(2).states.closed])
    assert picture.ax.get_xlabel() == "x (m)"
    assert picture.ax.get_zlabel() == ""  # too short for a scale
    plain = SolidPicture(film, [0], 1.0, ("", ""), FilmColour.NONE)
    assert plain.drawn.surface.get_array() is None
    assert len(plain.fig.axes) == 1


def test_the_title_above_a_long_body_in_space_is_whole() -> None:
    """Of a film that is 3 inches high, as those of long bodies are."""
    picture = SolidPicture(flying(3), [0, 1, 2, 3], 1.0, ("", ""), FilmColour.DISPLACEMENT)
    title = picture.ax.set_title("a bar against a wall")
    FigureCanvasAgg(picture.fig).draw()
    assert picture.fig.get_figheight() == 3.0
    assert title.get_window_extent().y1 < picture.fig.bbox.y1


def test_what_is_worn_is_taken_off_the_foundation(tmp_path: Path) -> None:
    history = worn()
    made = film_of(history)
    gap = 0.1 * (made.frame(0).places[:, 0] - 1.0) ** 2
    begun, depth = (
        next(values for name, values in history.frames[number].memory.items() if name.endswith("depth"))
        for number in (0, -1)
    )
    assert begun.max() < 1e-3  # by what slips at once under the load of the start
    assert depth.max() > 0.01
    assert made.frame(0).gap == pytest.approx(gap + begun)
    assert made.frame(4).gap == pytest.approx(gap + depth)
    read = read_film(history.write(tmp_path / "run.pvd")[0])
    assert np.sort(read.frame(4).gap) == pytest.approx(np.sort(gap + depth), rel=1e-14)
    assert np.array_equal(read.frame(4).velocity, history.frames[4].velocity)
    assert np.array_equal(made.frame(4).velocity, history.frames[4].velocity)


@pytest.mark.parametrize(
    ("times", "most", "shown"),
    [
        slow(np.arange(5.0), 200, [0, 1, 2, 3, 4]),
        slow(np.arange(9.0), 5, [0, 2, 4, 6, 8]),
        (np.array([0.0, 1.0, 2.0, 3.0, 3.1, 3.2, 4.0]), 200, [0, 1, 2, 3, 6]),
        slow(np.array([0.0, 0.9, 2.2, 3.0]), 4, [0, 1, 2, 3]),
        slow(np.arange(9.0), 1, [8]),
        (np.zeros(1), 10, [0]),
    ],
)
def test_frames_are_taken_at_even_times(times: Array, most: int, shown: list[int], tmp_path: Path) -> None:
    film, asked, told = flying(2), [], []

    def frame(number: int) -> FilmFrame:
        asked.append(number)
        return film.frame(number)

    watched = replace(film, times=times, frame=frame)
    animate(watched, tmp_path / "film.gif", frames=most, dpi=10, progress=lambda done, of: told.append((done, of)))
    assert told == [(k + 1, len(shown)) for k in range(len(shown))]
    assert sorted(set(asked)) == sorted(set(shown))
    assert asked[-len(shown) :] == shown


# ---- files -----------------------------------------------------------------------------------------------------


def test_a_gif_meets_its_colours(tmp_path: Path) -> None:
    blue = np.array([0, 114, 178], dtype=np.uint8)
    assert f"#{blue[0]:02X}{blue[1]:02X}{blue[2]:02X}" == BLUE
    rng = np.random.default_rng(0)
    frames = []
    for k in range(3):
        frame = np.full((40, 60, 3), 255, dtype=np.uint8)
        frame[:20] = rng.integers(100, 140, (20, 60, 3))
        frame[30, 5 + k] = blue  # one point only: a rare colour
        frames.append(frame)
    write_gif(tmp_path / "a.gif", frames, frames[0], 16, 0.123)
    with Image.open(tmp_path / "a.gif") as film:
        assert film.n_frames == 3  # type: ignore[attr-defined]
        for k in range(3):
            film.seek(k)
            assert film.info["duration"] == 120
            again = np.asarray(film.convert("RGB"))
            assert (again[30, 5 + k] == blue).all()
            assert (again[25] == 255).all()
            assert len(np.unique(again.reshape(-1, 3), axis=0)) <= 16
            assert np.abs(again[:20].astype(int) - frames[k][:20]).mean() < 20.0
        assert film.info["loop"] == 0
    write_gif(tmp_path / "b.gif", frames, frames[0], 16, 1e-6)
    with Image.open(tmp_path / "b.gif") as film:
        assert film.info["duration"] == 20


def test_a_film_lasts_as_long_as_is_asked_for(tmp_path: Path) -> None:
    told: list[tuple[int, int]] = []
    path = animate(
        flying(2), tmp_path / "a.gif", seconds=2.0, dpi=50, colour="speed", progress=lambda *p: told.append(p)
    )
    assert told == [(1, 4), (2, 4), (3, 4), (4, 4)]
    with Image.open(path) as film:
        assert film.n_frames == 4  # type: ignore[attr-defined]
        assert film.info["duration"] == 500
        assert film.size[0] == round(6.3 * 50)
    with pytest.raises(ProblemError, match="choose one of none, displacement, speed"):
        animate(flying(2), tmp_path / "b.gif", colour="velocity")
    assert not (tmp_path / "b.gif").exists()


def test_mp4_is_written_where_ffmpeg_is(tmp_path: Path) -> None:
    from matplotlib.animation import FFMpegWriter

    if not FFMpegWriter.isAvailable():
        pytest.skip("ffmpeg is not installed")
    path = animate(flying(2), tmp_path / "a.mp4", seconds=2.0, dpi=51)
    assert path.read_bytes()[4:8] == b"ftyp"
    assert [file.name for file in tmp_path.iterdir()] == ["a.mp4"]


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (["--colour", "sped"], "did you mean 'speed'"),
        (["--units", "a,b,c,d,e,f"], "--units a,b,c,d,e,f: give five at most"),
        (["--scale", "0"], "scale = 0.0; give a positive number"),
        (["--seconds", "-1"], "seconds = -1"),
        (["--seconds", "1e300"], "give at most"),
        (["--dpi", "5000"], "dpi = 5000"),
    ],
)
def test_bad_options(
    options: list[str],
    says: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    worn().write("run.pvd")
    assert main(["animate", "run.pvd", "-o", "a.gif", *options]) == 2
    err = capsys.readouterr().err
    assert says in err
    assert err.count("\n") == 1
    assert not Path("a.gif").exists()


def test_the_command_takes_units_and_colours(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    worn().write("run.pvd")
    worn().write("run.csv")
    assert main(["animate", "run.pvd", "-o", "a.gif", "--dpi", "40", "--colour", "speed", "--units", "s,mm"]) == 0
    assert main(["history", "run.csv", "--plot", "a.svg", "--kind", "forces", "--units", "s,mm,N"]) == 0
    text = Path("a.svg").read_text()
    assert "force (N)" in text
    assert "time (s)" in text


def test_a_film_that_is_killed_leaves_nothing_beside_its_place(tmp_path: Path) -> None:
    """While it is drawn its folder holds no file: a process that is killed cannot remove one."""
    seen: list[str] = []
    animate(flying(2), tmp_path / "film.gif", progress=lambda *_: seen.extend(one.name for one in tmp_path.iterdir()))
    assert not seen
    assert [one.name for one in tmp_path.iterdir()] == ["film.gif"]
