"""States and pressure along a plane contact boundary over time."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from hemivar.basics.types import Array
from hemivar.errors import ProblemError
from hemivar.evolution.history import History
from hemivar.files.boundary import contact_boundaries
from hemivar.files.snapshot import moving_states
from hemivar.report.picture import new_figure
from hemivar.report.style import GREY, STATE_COLOURS, in_rows, with_unit
from hemivar.solvers.contact_states import KINDS

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["draw_map"]

_COLOURS = ["#f2f2f2", *(STATE_COLOURS[kind] for kind in KINDS[1:])]  # open first


def draw_map(history: History, boundary: str | None, time_unit: str, unit: str, stress_unit: str) -> Figure:
    """Two panels with the coordinate along the boundary across and the time upwards: states, and pressure.

    Raises
    ------
    ProblemError
        The boundary is not known, the body is not plane, or there are not two frames.
    """
    from matplotlib.colors import BoundaryNorm, ListedColormap
    from matplotlib.patches import Patch

    problem = history.discrete.problem
    boundaries = {found.name: found for found in contact_boundaries(problem)} if problem.contact_points else {}
    if not boundaries:
        raise ProblemError("the evolution has no contact point; draw kind 'ledger'")
    name = next(iter(boundaries)) if boundary is None else boundary
    if name not in boundaries:
        raise ProblemError(f"there is no contact boundary '{name}' (known: {', '.join(boundaries)})")
    found = boundaries[name]
    if found.mesh.dim != 2:
        raise ProblemError("states are drawn along the boundaries of plane bodies; animate a body in 3D")
    if len(history.frames) < 2:
        raise ProblemError("a map needs two frames at least; march(..., save=Save(every=...)) saves them")
    assert problem.contact.points is not None
    place, label = found.position(problem.contact.points)
    order = np.argsort(place, kind="stable")
    index, place = found.index[order], place[order]
    times = np.array([frame.time for frame in history.frames])
    state = np.array([moving_states(history.discrete, frame).numbers[index] for frame in history.frames])
    pressure = np.array([frame.multiplier[index, 0] for frame in history.frames])
    fig = new_figure((6.3, 3.8), layout="constrained")
    left, right = fig.subplots(1, 2, sharex=True, sharey=True)
    across, up = _edges(place), _edges(times)
    norm = BoundaryNorm(np.arange(len(KINDS) + 1) - 0.5, len(KINDS))
    left.pcolormesh(across, up, state, cmap=ListedColormap(_COLOURS), norm=norm, rasterized=True)
    most = float(pressure.max())
    least = float(pressure.min())
    limit = max(abs(most), abs(least)) or 1.0
    signed = least < -1e-9 * limit
    mesh = right.pcolormesh(
        across, up, pressure, rasterized=True, cmap="RdBu_r" if signed else "cividis",
        vmin=-limit if signed else 0.0, vmax=limit,
    )  # fmt: skip
    fig.colorbar(mesh, ax=right, shrink=0.85, pad=0.02).set_label(with_unit("pressure", stress_unit))
    handles = [
        Patch(facecolor=_COLOURS[number], edgecolor=GREY, linewidth=0.4, label=KINDS[number].label)
        for number in np.unique(state).tolist()
    ]
    fig.legend(handles=handles, loc="outside lower left", ncols=in_rows(len(handles)), handlelength=1.2)
    left.set_title(f"states on {name}", fontsize=9)
    right.set_title(f"pressure on {name}", fontsize=9)
    left.set_ylabel(with_unit("time", time_unit))
    for panel in (left, right):
        panel.set_xlabel(with_unit(label, unit))
    return fig


def _edges(middles: Array) -> Array:
    """Edges (k + 1,) of cells about given places, half way between them; the first and the last place are edges."""
    between = 0.5 * (middles[1:] + middles[:-1])
    return np.concatenate([middles[:1], between, middles[-1:]])
