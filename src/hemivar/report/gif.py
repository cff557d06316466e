"""GIF files of drawings: one palette for all frames and no dithering, so that what rests costs nothing."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from hemivar.basics.first_use import IMPORTS
from hemivar.basics.types import Array

if TYPE_CHECKING:
    from PIL.Image import Image

__all__ = ["palette_of", "write_gif"]


def palette_of(samples: Sequence[Array], colours: int = 255, keep: Sequence[str] = ()) -> Image:
    """Colours for all frames of a film, from some of them.

    Parameters
    ----------
    samples : sequence of arrays (rows, columns, 3)
        Red, green and blue, 0 to 255, of one size.
    colours : int
        At most so many.
    keep : sequence of str
        Names of colours that must be met exactly, as matplotlib knows them.

    Returns
    -------
    Image
        Of Pillow, with the palette.
    """
    with IMPORTS:
        from matplotlib.colors import to_rgb
        from PIL import Image

    sheet = Image.fromarray(np.ascontiguousarray(np.vstack(list(samples)), dtype=np.uint8), "RGB")
    exact = [round(255.0 * part) for name in keep for part in to_rgb(name)]
    found = sheet.quantize(colors=colours - len(keep), method=Image.Quantize.MAXCOVERAGE, dither=Image.Dither.NONE)
    palette = Image.new("P", (1, 1))
    palette.putpalette(exact + list(found.getpalette() or [])[: 3 * (colours - len(keep))])
    return palette


def write_gif(path: str | Path, frames: Iterable[Array], palette: Image, seconds: float) -> None:
    """Write frames as a film that begins again at its end.

    Parameters
    ----------
    path : str or Path
    frames : iterable of arrays (rows, columns, 3)
        As the samples of :func:`palette_of`.
    palette : Image
    seconds : float
        That a frame is shown, to hundredths and at least 0.02.
    """
    with IMPORTS:
        from PIL import Image

    images = [
        Image.fromarray(np.ascontiguousarray(frame, dtype=np.uint8), "RGB").quantize(
            palette=palette, dither=Image.Dither.NONE
        )
        for frame in frames
    ]
    duration = 10 * max(2, round(100.0 * seconds))
    images[0].save(path, "GIF", save_all=True, append_images=images[1:], duration=duration, loop=0, disposal=1)
