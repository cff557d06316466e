"""Films of bodies in contact: GIF without other software, MP4 where ffmpeg is installed."""

from __future__ import annotations

import math
import shutil
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Literal

import numpy as np

from hemivar.basics.arguments import quoted
from hemivar.basics.disk import make_folder, path_of, shown, try_output, whole_file
from hemivar.basics.first_use import IMPORTS
from hemivar.basics.types import Array
from hemivar.errors import ProblemError
from hemivar.evolution.history import History
from hemivar.files.film import Film, FilmFrame, film_of
from hemivar.report.drawn_body import GROUND
from hemivar.report.film_pictures import FilmColour, FilmPicture, PlanePicture, SolidPicture
from hemivar.report.style import BLUE, GREY, ORANGE, RED, drawing

__all__ = ["FILMS", "animate", "check_film", "write_gif"]

FILMS = (".gif", ".mp4")
#: Seconds that one frame can be shown: a GIF counts hundredths of a second, up to 65535 of them.
_LONGEST_FRAME = 655.0
#: Colours that a GIF must meet.
_EXACT = ("white", "black", BLUE, ORANGE, RED, GREY, GROUND, "#eef4f9")  # the last is that of a plain body


def check_film(path: str | Path) -> None:
    """Refuse, before the work, a film that could not be written: another suffix, MP4 without ffmpeg."""
    suffix = path_of(path).suffix.lower()
    if suffix not in FILMS:
        raise ProblemError(f"'{shown(path)}': films are written as {' or '.join(FILMS)}, not {quoted(suffix)}")
    if suffix == ".mp4":
        with IMPORTS:
            from matplotlib.animation import FFMpegWriter

        if not FFMpegWriter.isAvailable():
            raise ProblemError(f"'{path}': ffmpeg is not installed, which MP4 needs; install it, or write a .gif")


def animate(
    history: History | Film,
    path: str | Path,
    *,
    scale: float | Literal["auto"] = "auto",
    seconds: float = 6.0,
    frames: int = 200,
    title: str | None = None,
    unit: str = "",
    time_unit: str = "",
    colour: FilmColour | str | None = None,
    dpi: int = 100,
    progress: Callable[[int, int], object] | None = None,
) -> Path:
    """Write the deformed body over time, all frames with the same axes and scales.

    Plane bodies show the mesh, contact points by state, and the force per area of the foundation on the body as
    arrows. Of bodies in 3D the surface is shown, coloured, and contact points by state.

    Parameters
    ----------
    history : History or Film
        What :func:`hemivar.march` returned, or :func:`hemivar.files.film.read_film` read.
    path : str or Path
        Ends in ``.gif`` or ``.mp4``.
    scale : float or "auto"
        Factor of the displacement; ``"auto"`` makes small displacements visible.
    seconds : float
        Length of the film.
    frames : int
        At most so many; the time between those that are shown follows the time of the evolution.
    title, unit, time_unit : str
        Text above, and units for the labels.
    colour : FilmColour or str, optional
        What colours the body, on one scale for all frames; by default plane bodies have none, others that of the
        displacement.
    dpi : int
        Dots per inch, 10 to 600; the film is about 6.3 inches wide.
    progress : function, optional
        Called with the number of frames that are drawn, and of all.

    Returns
    -------
    Path

    Raises
    ------
    ProblemError
        Another suffix, MP4 without ffmpeg, a number out of range, an unknown colour, or no frame.
    FileError
        The file cannot be written.
    """
    path = path_of(path)
    check_film(path)
    if not (math.isfinite(seconds) and seconds > 0.0):
        raise ProblemError(f"seconds = {seconds:g}; give a positive length of the film")
    if frames < 1:
        raise ProblemError(f"frames = {frames}; give 1 or more")
    if not 10 <= dpi <= 600:
        raise ProblemError(f"dpi = {dpi}; give a resolution from 10 to 600 dots per inch")
    if scale != "auto" and not (math.isfinite(scale) and scale > 0.0):
        raise ProblemError(f"scale = {quoted(scale)}; give a positive number or 'auto'")
    try:
        coloured = None if colour is None else FilmColour(colour)
    except ValueError:
        known = ", ".join(kind.value for kind in FilmColour)
        raise ProblemError(f"colour = {quoted(colour)}: a film has no such colour; choose one of {known}") from None
    film = film_of(history) if isinstance(history, History) else history
    shown = _shown(film.times, frames)
    if seconds / len(shown) > _LONGEST_FRAME:
        raise ProblemError(
            f"seconds = {seconds:g} is too long for {len(shown)} frames; give at most {_LONGEST_FRAME * len(shown):g}"
        )
    make_folder(path.parent)
    try_output(path)
    with drawing(), TemporaryDirectory(prefix="hemivar-film-") as aside:  # it takes a while, and may be killed
        name = Path(aside) / path.name
        plane = film.points.shape[1] == 2
        if coloured is None:
            coloured = FilmColour.NONE if plane else FilmColour.DISPLACEMENT
        picture = (PlanePicture if plane else SolidPicture)(film, shown, scale, (unit, time_unit), coloured)
        if title or film.title:
            picture.ax.set_title(title or film.title)
        picture.fig.set_dpi(dpi)

        def played() -> Iterator[FilmFrame]:
            for number, at in enumerate(shown):
                yield film.frame(at)
                if progress is not None:
                    progress(number + 1, len(shown))

        if path.suffix.lower() == ".gif":
            samples = np.unique(np.linspace(0, len(shown) - 1, 8).astype(int)).tolist()
            sheet = np.vstack([picture.image(film.frame(shown[k])) for k in samples])
            colours = 64 if coloured is FilmColour.NONE else 255
            write_gif(name, map(picture.image, played()), sheet, colours, seconds / len(shown))
        else:
            _write_mp4(name, picture, played(), min(50.0, round(len(shown) / seconds, 3)), dpi)
        with whole_file(path) as kept:
            shutil.copyfile(name, kept)
    return path


def write_gif(path: Path, frames: Iterable[Array], sheet: Array, colours: int, seconds: float) -> None:
    """Frames (rows, columns, 3) as a film that begins again at its end; each is shown for 0.02 seconds at least.

    All have one palette, of the colours of a ``sheet`` of some of them and the exact ones, so that what rests costs
    nothing.
    """
    with IMPORTS:
        from matplotlib.colors import to_rgb
        from PIL import Image

    def image(pixels: Array) -> Image.Image:
        return Image.fromarray(np.ascontiguousarray(pixels, dtype=np.uint8), "RGB")

    exact, few = [round(255.0 * part) for name in _EXACT for part in to_rgb(name)], colours - len(_EXACT)
    sampled = image(sheet).quantize(few, method=Image.Quantize.MAXCOVERAGE, dither=Image.Dither.NONE)
    palette = Image.new("P", (1, 1))
    palette.putpalette(exact + list(sampled.getpalette() or [])[: 3 * few])
    first, *others = [image(frame).quantize(palette=palette, dither=Image.Dither.NONE) for frame in frames]
    duration = 10 * max(2, round(100.0 * seconds))
    first.save(path, "GIF", save_all=True, append_images=others, duration=duration, loop=0, disposal=1)


def _write_mp4(name: Path, picture: FilmPicture, frames: Iterator[FilmFrame], rate: Any, dpi: int) -> None:
    with IMPORTS:
        from matplotlib.animation import FFMpegWriter

    writer = FFMpegWriter(fps=rate)
    with writer.saving(picture.fig, str(name), dpi):
        for frame in frames:
            picture.show(frame)
            writer.grab_frame()


def _shown(times: Array, most: int) -> list[int]:
    """Which frames are shown: at even times, the nearest frame to each."""
    if len(times) == 1 or most == 1:
        return [len(times) - 1]
    span = float(times[-1] - times[0])
    gaps = np.diff(times)
    even = max(float(np.median(gaps)), span / (most - 1)) if span > 0.0 else 1.0
    wanted = np.linspace(times[0], times[-1], max(2, min(most, round(span / even) + 1)))
    after = np.clip(np.searchsorted(times, wanted), 1, len(times) - 1)
    nearer = np.where(wanted - times[after - 1] < times[after] - wanted, after - 1, after)
    return [int(k) for k in nearer]
