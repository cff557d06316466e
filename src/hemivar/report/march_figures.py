"""Figures of evolutions over time: energies and losses, forces, loops, steps, and any column of the table."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from hemivar.basics.arguments import quoted
from hemivar.basics.types import Array
from hemivar.basics.units import Units
from hemivar.errors import ProblemError
from hemivar.evolution.history import History, quantity_of
from hemivar.files.boundary import contact_boundaries
from hemivar.files.snapshot import moving_states
from hemivar.report.picture import new_figure
from hemivar.report.style import (
    BLUE,
    GREEN,
    GREY,
    LINES,
    ORANGE,
    PURPLE,
    RED,
    SERIES,
    SKY,
    STATE_COLOURS,
    drawing,
    in_rows,
    legend_beside,
    with_unit,
)
from hemivar.solvers.contact_states import KINDS

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["MARCH_FIGURES", "Units", "draw_map", "plot_march"]

#: Entries of the ledger in the order in which they are stacked, with label and colour: what is stored, then losses.
_STORED = (
    ("elastic", "elastic", BLUE),
    ("branches", "branches", "#8fbfe0"),
    ("contact", "foundation", SKY),
    ("kinetic", "kinetic", GREEN),
)
_LOST = (
    ("viscous", "viscous", ORANGE),
    ("branch_loss", "lost in branches", "#f5d08a"),
    ("friction", "friction", RED),
    ("damping", "damping", "#8c4a1f"),
    ("memory", "bonds and wear", PURPLE),
    ("numerical", "numerical", "#bdbdbd"),
    ("jumps", "jumps", "#4d4d4d"),
)
#: What was put in; work of thermal stress where there is heat.
_GIVEN = ("work", "moved", "thermal")
_OF_STEPS = ("time", "step", "residual", "margin", "largest_step", "jumped")
#: Below this part of the largest energy an entry of the ledger is left out: it would be thinner than a line.
_SEEN = 1e-4
#: Columns that one figure shows, in panels of an inch and a half each: more are longer than a screen.
_MOST_COLUMNS = 8
_COLOURS = ["#f2f2f2", *(STATE_COLOURS[kind] for kind in KINDS[1:])]  # open first


def plot_march(
    history: History | Mapping[str, Array],
    kind: str = "ledger",
    *,
    columns: Sequence[str] = (),
    boundary: str | None = None,
    units: Units | None = None,
    title: str | None = None,
) -> Figure:
    """A figure of an evolution over time.

    ``"ledger"``: stored energies and losses stacked, with the external work as a line, and below the error
    of the balance. ``"forces"``: resultants of pressure and friction, and the measure of contact. ``"loop"``: the
    second of two columns over the first; by default the force that changes most over the displacement of a probe that
    changes most, or over the largest penetration. ``"steps"``: lengths of steps, residuals and margins. ``"columns"``:
    each in a panel. ``"map"``: states and pressure along a plane contact boundary over time, from the frames of a
    history.

    Parameters
    ----------
    history : History, or mapping of name to array
        Or the table of one, as read from a file.
    kind : str
    columns : sequence of str
        For ``"loop"`` two, for ``"columns"`` those to draw.
    boundary : str, optional
        For ``"map"``; the first contact boundary by default.
    units : Units, optional
    title : str, optional

    Raises
    ------
    ProblemError
        The kind or a column is not known, or there is nothing to draw.
    """
    if not isinstance(kind, str) or kind not in MARCH_FIGURES:
        raise ProblemError(f"there is no figure {quoted(kind)} of a history; choose one of {', '.join(MARCH_FIGURES)}")
    units = Units() if units is None else units
    with drawing():
        if kind == "map":
            if not isinstance(history, History):
                raise ProblemError("the map needs frames, which a table does not have; march(...).plot('map') draws it")
            fig = draw_map(history, boundary, units.time, units.length, units.stress)
        else:
            table = history.rows().by_name() if isinstance(history, History) else dict(history)
            for name in ("time", *columns):
                if name not in table:
                    raise ProblemError(f"the history has no column '{name}' (known: {', '.join(table)})")
            fig = _DRAWN[kind](table, columns, units)
        if title:
            fig.suptitle(title, fontsize=10)
    return fig


def _panels(count: int, height: float, ratios: Sequence[float] | None = None) -> tuple[Figure, list[Axes]]:
    """A column of panels over one axis of time."""

    fig = new_figure((6.3, height), layout="constrained")
    panels = list(fig.subplots(count, 1, sharex=True, squeeze=False, height_ratios=ratios)[:, 0])
    for panel in panels:
        panel.margins(x=0.0)
    return fig, panels


# ---- the ledger ------------------------------------------------------------------------------------------------


def _ledger(table: Mapping[str, Array], columns: Sequence[str], units: Units) -> Figure:
    missing = [name for name, _, _ in (*_STORED, *_LOST) if name not in table]
    if missing or "work" not in table or "moved" not in table:
        raise ProblemError(
            f"the table has no energy balance (column '{(*missing, 'work')[0]}' is missing); draw other columns"
        )
    time = table["time"]
    stored = sum((table[name] for name, _, _ in _STORED), np.zeros(len(time)))
    given = stored[0] + sum((table[name] for name in _GIVEN if name in table), np.zeros(len(time)))
    largest = max(float(np.abs(table[name]).max()) for name, _, _ in (*_STORED, *_LOST))
    largest = max(largest, float(np.abs(given).max()))
    seen = [e for e in (*_STORED, *_LOST) if float(np.abs(table[e[0]]).max()) > _SEEN * largest]
    fig, (upper, lower) = _panels(2, 4.6, (4.0, 1.0))
    above, below = np.zeros(len(time)), np.zeros(len(time))
    for name, label, colour in seen:
        losses = any(name == other for other, _, _ in _LOST)
        style: dict[str, Any] = {"facecolor": colour, "linewidth": 0.4, "edgecolor": "white"}
        if losses:
            style["hatch"] = "...."
        for start, part in ((above, np.maximum(table[name], 0.0)), (below, np.minimum(table[name], 0.0))):
            if np.any(part != 0.0):
                upper.fill_between(time, start, start + part, label=label, **style)
                label = "_nolegend_"
            start += part
    upper.plot(time, given, color="black", lw=1.4, label="external work")
    upper.axhline(0.0, color=GREY, lw=0.6)
    upper.set_ylabel(with_unit("energy", units.energy))
    handles, labels = upper.get_legend_handles_labels()
    legend_beside(
        upper, handles=handles[::-1], labels=labels[::-1], title="energy, stored\nor lost (dotted)", title_fontsize=8,
        alignment="left",
    )  # fmt: skip
    gap = np.abs(given - stored - sum((table[name] for name, _, _ in _LOST), np.zeros(len(time))))
    part = gap / largest if largest > 0.0 else gap
    lower.semilogy(time, np.maximum(part, 1e-17), color=GREY, lw=1.0)
    lower.set_ylim(1e-17, max(1e-6, 10.0 * float(part.max())))
    lower.set_ylabel("relative\nbalance error")
    lower.set_xlabel(with_unit("time", units.time))
    fig.align_ylabels()
    return fig


# ---- forces, loops, steps, columns -----------------------------------------------------------------------------


def _boundaries(table: Mapping[str, Array], quantity: str) -> list[tuple[str, str]]:
    """Columns of a quantity: those of the boundaries where they are several, else that of all."""
    parts = [(name.removesuffix(f".{quantity}"), name) for name in table if name.endswith(f".{quantity}")]
    return parts or [("", quantity)]


def _forces(table: Mapping[str, Array], columns: Sequence[str], units: Units) -> Figure:
    if "normal_force" not in table:
        raise ProblemError("the table holds no forces (column 'normal_force' is missing); draw other columns")
    time = table["time"]
    friction = np.any(table["friction_force"] != 0.0)
    fig, (upper, lower) = _panels(2, 4.2, (2.0, 1.0))
    forces = [("normal_force", "pressure", RED), *([("friction_force", "friction", GREEN)] if friction else [])]
    parts = _boundaries(table, "normal_force")
    for quantity, label, colour in forces:
        for number, (boundary, name) in enumerate(_boundaries(table, quantity)):
            entry = f"{label}, {boundary}" if boundary else label
            upper.plot(time, table[name], color=colour, ls=LINES[number % len(LINES)], label=entry)
    for number, (boundary, name) in enumerate(_boundaries(table, "contact_measure")):
        lower.plot(time, table[name], color=BLUE, ls=LINES[number % len(LINES)], label=boundary or "contact")
    for panel in (upper, lower):
        panel.axhline(0.0, color="#b0b0b0", lw=0.6, zorder=0)
    if len(parts) > 1 or friction:
        legend_beside(upper, handlelength=1.6)
    if len(parts) > 1:
        legend_beside(lower, handlelength=1.6)
    upper.set_ylabel(with_unit("force", units.force))
    solid = any(name.endswith(".u_z") for name in table)
    if solid and units.length:
        lower.set_ylabel(with_unit("contact\narea", f"{units.length}\N{SUPERSCRIPT TWO}"))
    else:
        lower.set_ylabel(with_unit("contact\nmeasure", units.length))
    lower.set_xlabel(with_unit("time", units.time))
    fig.align_ylabels()
    return fig


def _loop(table: Mapping[str, Array], columns: Sequence[str], units: Units) -> Figure:
    from matplotlib.collections import LineCollection

    if len(columns) not in (0, 2):
        raise ProblemError(f"a loop is drawn of two columns, and {len(columns)} are given; name two, or none")
    if columns:
        across, up = columns
    else:
        moves = [name for name in table if ".u_" in name] or [name for name in table if name == "penetration"]
        forces = [name for name in ("normal_force", "friction_force") if name in table]
        if not moves or not forces:
            raise ProblemError("the table holds neither probes nor forces; name two columns for the loop")
        across, up = (max(names, key=lambda name: _range(table[name])) for names in (moves, forces))
    x, y, time = table[across], table[up], table["time"]
    seen = np.isfinite(x) & np.isfinite(y)
    fig = new_figure((5.2, 3.6), layout="constrained")
    ax = fig.add_subplot()
    ends = np.stack([x[seen], y[seen]], axis=1)
    if len(ends) < 2:
        raise ProblemError(f"there are no two moments at which '{across}' and '{up}' are numbers; name other columns")
    lines = LineCollection(
        list(np.stack([ends[:-1], ends[1:]], axis=1)), array=time[seen][1:], cmap="cividis", linewidths=1.4,
        capstyle="round",
    )  # fmt: skip
    ax.add_collection(lines)
    ax.plot(*ends[0], "o", ms=4.5, mfc="white", mec="black", mew=0.9, label="start")
    ax.plot(*ends[-1], "o", ms=4.5, mfc="black", mec="black", mew=0.9, label="end")
    ax.axhline(0.0, color="#b0b0b0", lw=0.6, zorder=0)
    ax.axvline(0.0, color="#b0b0b0", lw=0.6, zorder=0)
    ax.autoscale_view()
    ax.margins(0.05)
    fig.legend(loc="outside lower right", ncols=2)
    fig.colorbar(lines, ax=ax, shrink=0.85, pad=0.02).set_label(with_unit("time", units.time))
    ax.set_xlabel(_column_label(across, units))
    ax.set_ylabel(_column_label(up, units))
    return fig


def _steps(table: Mapping[str, Array], columns: Sequence[str], units: Units) -> Figure:
    missing = [name for name in _OF_STEPS if name not in table]
    if missing:
        raise ProblemError(f"the table holds no steps (column '{missing[0]}' is missing); draw other columns")
    time = table["time"][1:]
    if not len(time):
        raise ProblemError("the history has no step; run hv.march first")
    fig, (first, second, third) = _panels(3, 5.2)
    first.semilogy(time, table["step"][1:], color=BLUE, drawstyle="steps-pre", label="step")
    limit = table["largest_step"][1:]
    if np.any(np.isfinite(limit)):
        first.semilogy(time, limit, color=ORANGE, ls=LINES[1], label="largest with a\npositive margin")
        legend_beside(first, handlelength=1.6)
    first.set_ylabel(with_unit("length of step", units.time))
    residual = table["residual"][1:]
    second.semilogy(time, np.maximum(residual, 1e-17), color=GREEN)
    for panel, values in ((first, np.concatenate([table["step"][1:], limit])), (second, residual)):
        known = values[np.isfinite(values) & (values > 0.0)]
        if known.size:  # two powers of ten at least, so that what is constant looks so
            panel.set_ylim(0.3 * float(known.min()), max(3.0 * float(known.max()), 30.0 * float(known.min())))
    second.set_ylabel("relative residual")
    margin = table["margin"][1:]
    third.plot(time, np.where(np.isfinite(margin), margin, np.nan), color=PURPLE)
    unbounded = np.isneginf(margin)
    if np.any(margin <= 0.0):
        known = margin[np.isfinite(margin)]
        least = min(float(known.min(initial=0.0)), -0.25 if unbounded.any() else 0.0)
        third.axhspan(least, 0.0, color="#f3ead7", lw=0, zorder=0)
        if unbounded.any():
            third.plot(time[unbounded], np.full(int(unbounded.sum()), 0.5 * least), ".", color=PURPLE, ms=2.0)
            third.text(
                0.02, 0.5 * least, "no bound: -inf", va="bottom", fontsize=8, transform=third.get_yaxis_transform()
            )
            third.set_ylim(top=max(0.25, float(known.max(initial=0.0)) * 1.05))
    third.axhline(0.0, color="#b0b0b0", lw=0.6, zorder=0)
    jumped = table["jumped"][1:] > 0
    if jumped.any():
        third.plot(time[jumped], margin[jumped], "v", color=RED, ms=5, label="jump")
        legend_beside(third, handlelength=1.6)
    third.set_ylabel("margin")
    third.set_xlabel(with_unit("time", units.time))
    fig.align_ylabels()
    return fig


def _columns(table: Mapping[str, Array], columns: Sequence[str], units: Units) -> Figure:
    if not 1 <= len(columns) <= _MOST_COLUMNS:
        raise ProblemError(f"name 1 to {_MOST_COLUMNS} columns to draw (known: {', '.join(table)})")
    fig, panels = _panels(len(columns), 1.0 + 1.5 * len(columns))
    for number, (panel, name) in enumerate(zip(panels, columns, strict=True)):
        panel.plot(table["time"], table[name], color=SERIES[number % len(SERIES)])
        panel.axhline(0.0, color="#b0b0b0", lw=0.6, zorder=0) if _near_zero(table[name]) else None
        panel.set_ylabel(_column_label(name, units))
    panels[-1].set_xlabel(with_unit("time", units.time))
    fig.align_ylabels()
    return fig


def _range(values: Array) -> float:
    known = values[np.isfinite(values)]
    return float(np.ptp(known)) if known.size else 0.0


def _near_zero(values: Array) -> bool:
    known = values[np.isfinite(values)]
    return bool(known.size) and bool(known.min() <= 0.0 <= known.max())


def _column_label(name: str, units: Units) -> str:
    """A column as a label says it, with its unit."""
    part, _, quantity = name.rpartition(".")
    at = f", {part}" if part else ""
    what = f"displacement {quantity[2:]}" if quantity.startswith("u_") else quantity.replace("_", " ")
    return with_unit(what + at, getattr(units, quantity_of(name) or "none", ""))


_DRAWN: Mapping[str, Callable[[Mapping[str, Array], Sequence[str], Units], Figure]] = {
    "ledger": _ledger,
    "forces": _forces,
    "loop": _loop,
    "steps": _steps,
    "columns": _columns,
}
#: What :func:`plot_march` draws.
MARCH_FIGURES = ("ledger", "forces", "loop", "map", "steps", "columns")


def draw_map(history: History, boundary: str | None, time_unit: str, unit: str, stress_unit: str) -> Figure:
    """Two panels with the coordinate along the boundary across and the time upwards: states, and pressure."""
    from matplotlib.colors import BoundaryNorm, ListedColormap
    from matplotlib.patches import Patch

    problem = history.discrete.problem
    boundaries = {side.name: side for side in contact_boundaries(problem)} if problem.contact_points else {}
    if not boundaries:
        raise ProblemError("the evolution has no contact point; draw kind 'ledger'")
    name = next(iter(boundaries)) if boundary is None else boundary
    if name not in boundaries:
        raise ProblemError(f"there is no contact boundary '{name}' (known: {', '.join(boundaries)})")
    side = boundaries[name]
    if side.mesh.dim != 2:
        raise ProblemError("states are drawn along the boundaries of plane bodies; animate a body in 3D")
    if len(history.frames) < 2:
        raise ProblemError("a map needs at least two frames; march(..., save=Save(every=...)) saves them")
    assert problem.contact.points is not None
    along, label = side.position(problem.contact.points)
    order = np.argsort(along, kind="stable")
    index, along = side.index[order], along[order]
    times = np.array([frame.time for frame in history.frames])
    state = np.array([moving_states(history.discrete, frame).numbers[index] for frame in history.frames])
    pressure = np.array([frame.multiplier[index, 0] for frame in history.frames])
    fig = new_figure((6.3, 3.8), layout="constrained")
    left, right = fig.subplots(1, 2, sharex=True, sharey=True)
    across, up = _edges(along), _edges(times)
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
