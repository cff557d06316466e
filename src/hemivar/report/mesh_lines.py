"""The lines of a mesh: thinner and paler the denser they stand, so that print and screen show a mesh and no pattern."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from hemivar.basics.types import Array, IntArray

if TYPE_CHECKING:
    from matplotlib.patches import PathPatch
    from matplotlib.path import Path

__all__ = ["mesh_lines", "mesh_path"]

#: Distance of lines in points from which on they are drawn in full.
_WIDE = 9.0


def mesh_lines(
    points: Array, edges: IntArray, cells: int, inches: float, colour: str = "#8f8f8f", pale: float = 1.0
) -> PathPatch:
    """The edges (k, 2) of a mesh with these vertices (N, 2), as one path, which keeps vector files small.

    Parameters
    ----------
    points, edges
    cells : int
        How many cells they bound.
    inches : float
        Width of the drawn body, about.
    colour : str
    pale : float
        Below 1 they are as much paler, over colours.
    """
    from matplotlib.patches import PathPatch

    apart = 72.0 * inches / math.sqrt(0.5 * max(cells, 1))
    return PathPatch(
        mesh_path(points, edges), fill=False, edgecolor=colour, zorder=2,
        linewidth=float(np.clip(0.06 * apart, 0.1, 0.6)), alpha=pale * float(np.clip(apart / _WIDE, 0.3, 1.0)),
    )  # fmt: skip


def mesh_path(points: Array, edges: IntArray) -> Path:
    """The edges (k, 2) between vertices (N, 2) as one path."""
    from matplotlib.path import Path

    codes = np.tile(np.array([Path.MOVETO, Path.LINETO], dtype=np.uint8), len(edges))
    return Path(points[edges].reshape(-1, 2), codes)
