"""Parameter studies in figures: the margin and the number of solutions over parameters."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from hemivar.basics.types import Array
from hemivar.errors import ProblemError
from hemivar.report.picture import new_figure
from hemivar.report.style import BLUE, GREY, RED, drawing
from hemivar.workflows.sweep import Sweep, SweepAxis

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from hemivar.files.sweep_point import SweepPoint

__all__ = ["plot_sweep"]

#: Values of a parameter that get a tick each where they are no numbers, or few.
_TICKS = 12


def plot_sweep(sweep: Sweep, *, labels: Sequence[str] = (), title: str | None = None) -> Figure:
    """The margin and the number of solutions over one parameter, or as two maps over two.

    Where the margin is positive there is one solution.  Hollow marks (one parameter) and dots (two) stand for searches
    after which there may be more solutions; crosses for points without a result.

    Parameters
    ----------
    sweep : Sweep
        Of one or two parameters; what is not done stays blank.
    labels : sequence of str, optional
        Of the axes, with units; the keys by default.
    title : str, optional

    Raises
    ------
    ProblemError
        There are more parameters, or nothing is done.
    """
    if len(sweep.axes) > 2:
        raise ProblemError(f"a sweep over {len(sweep.axes)} parameters cannot be drawn; sweep one or two")
    if not any(point.count for point in sweep.points):
        raise ProblemError("no point of the sweep has a result to draw; see its notes")
    names = [*labels, *(axis.key for axis in sweep.axes[len(labels) :])]
    with drawing():
        return _curves(sweep, names[0], title) if len(sweep.axes) == 1 else _maps(sweep, names, title)


def _curves(sweep: Sweep, name: str, title: str | None) -> Figure:
    from matplotlib.ticker import MaxNLocator

    fig = new_figure((4.0, 3.8), layout="constrained")
    above, below = fig.subplots(2, 1, sharex=True, height_ratios=(3, 2))
    (axis,) = sweep.axes
    x = _positions(axis)
    order = np.argsort(x)
    margin, count = sweep.margin[order], sweep.count[order]
    x, sure = x[order], sweep.exhaustive[order] == 1.0
    finite = np.isfinite(margin)
    above.axhline(0.0, color="black", lw=0.7)
    above.plot(x[finite], margin[finite], color=BLUE, marker="o", ms=3.2)
    if not finite.any():
        above.text(0.5, 0.5, "no margin: $-\\infty$ everywhere", ha="center", va="center", transform=above.transAxes)
        above.set_yticks([0.0])
    low, high = above.get_ylim()
    if low < 0.0:
        above.axhspan(low, 0.0, color="#f3ead7", lw=0, zorder=0)
        above.set_ylim(low, high)
    above.set_ylabel("margin $1 - c$")
    done = np.isfinite(count)
    below.plot(x[done], count[done], color=GREY, lw=0.8, drawstyle="steps-mid", zorder=1)
    for these, fill, text in ((done & sure, RED, "all solutions"), (done & ~sure, "white", "at least")):
        if these.any():
            below.plot(x[these], count[these], ls="", color=RED, marker="o", ms=4.2, mfc=fill, label=text)
    failed = np.array([axis.values[p.place[0]] if axis.numbers is not None else p.place[0] for p in _failed(sweep)])
    if failed.size:
        below.plot(failed.astype(float), np.zeros(failed.size), "x", color="black", ms=4.0, label="no result")
    most = np.nanmax(count)
    below.set_ylim(-0.4 if failed.size else 0.4, most + 0.6)
    below.yaxis.set_major_locator(MaxNLocator(integer=True, nbins=6, min_n_ticks=1))
    below.set_ylabel("solutions")
    below.set_xlabel(name)
    if done.any() and not (done & ~sure == 0).all():
        below.legend(loc="best")
    _ticks(below, axis, "x")
    if title:
        above.set_title(title)
    return fig


def _failed(sweep: Sweep) -> list[SweepPoint]:
    return [point for point in sweep.points if point.failed]


def _maps(sweep: Sweep, names: Sequence[str], title: str | None) -> Figure:
    import matplotlib
    from matplotlib.colors import BoundaryNorm, ListedColormap, TwoSlopeNorm
    from matplotlib.lines import Line2D
    from matplotlib.ticker import MaxNLocator

    fig = new_figure((6.3, 3.1), layout="constrained")
    left, right = fig.subplots(1, 2, sharex=True, sharey=True)
    x, y = (_edges(axis) for axis in sweep.axes)
    margin, count = sweep.margin, sweep.count
    finite = margin[np.isfinite(margin)]
    reach = float(np.abs(finite).max(initial=1e-300))
    bound = max(-float(finite.min(initial=0.0)), 1e-3 * reach), max(float(finite.max(initial=0.0)), 1e-3 * reach)
    shown = np.ma.masked_invalid(np.where(margin == -np.inf, -bound[0], margin))
    norm = TwoSlopeNorm(0.0, -bound[0], bound[1])
    drawn = left.pcolormesh(x, y, shown.T, cmap="PuOr", norm=norm, rasterized=margin.size > 2500)
    bar = fig.colorbar(drawn, ax=left, label="margin $1 - c$")
    bar.ax.axhline(0.0, color="black", lw=0.8)
    numbers = np.unique(count[np.isfinite(count) & (count > 0)]).astype(int)
    kind = np.searchsorted(numbers, np.where(np.isfinite(count) & (count > 0), count, numbers[0])).astype(float)
    kind[~(count > 0)] = np.nan
    shades = matplotlib.colormaps["viridis_r"](np.linspace(0.12, 1.0, max(len(numbers) - 1, 1)))
    colours = [(0.95, 0.95, 0.95, 1.0), *shades][: len(numbers)]
    blocks = right.pcolormesh(
        x, y, np.ma.masked_invalid(kind).T, cmap=ListedColormap(colours),
        norm=BoundaryNorm(np.arange(-0.5, len(numbers)), len(numbers)), rasterized=count.size > 2500,
    )  # fmt: skip
    every = max(1, len(numbers) // 10)
    count_bar = fig.colorbar(blocks, ax=right, label="number of solutions", ticks=np.arange(0, len(numbers), every))
    count_bar.ax.set_yticklabels([str(number) for number in numbers[::every]])
    count_bar.ax.minorticks_off()
    middles = [_positions(axis) for axis in sweep.axes]
    if _zero(left, middles, margin) and _zero(right, middles, margin):
        handle = Line2D([], [], color="black", lw=1.0, ls="--", label="margin zero: one solution where it is positive")
        fig.legend(handles=[handle], loc="outside lower center")
    for point in sweep.points:
        mark = "x" if point.failed else "" if point.exhaustive else "."
        if mark:
            at = [middle[i] for middle, i in zip(middles, point.place, strict=True)]
            right.plot(*at, mark, color="black", ms=2.5 if mark == "." else 4.0)
    for panel in (left, right):
        panel.set_xlabel(names[0])
        for axis, letter in zip(sweep.axes, "xy", strict=True):
            if axis.numbers is not None:
                (panel.xaxis if letter == "x" else panel.yaxis).set_major_locator(
                    MaxNLocator(nbins=4 if letter == "x" else 8)
                )
            _ticks(panel, axis, letter)
    left.set_ylabel(names[1])
    if title:
        fig.suptitle(title, fontsize=10)
    return fig


def _zero(panel: Axes, middles: Sequence[Array], margin: Array) -> bool:
    """Draw the line at which the margin is zero; returns whether there is one."""
    finite = np.isfinite(margin)
    if min(margin.shape) < 2 or not finite.all() or margin.min() >= 0.0 or margin.max() <= 0.0:
        return False
    panel.contour(middles[0], middles[1], margin.T, levels=[0.0], colors="black", linewidths=1.0, linestyles="--")
    return True


def _positions(axis: SweepAxis) -> Array:
    """Where the values of an axis stand: at their numbers, or one after the other."""
    return np.arange(len(axis.values), dtype=float) if axis.numbers is None else axis.numbers


def _edges(axis: SweepAxis) -> Array:
    """Ends of the cells around the values of an axis."""
    x = _positions(axis)
    if len(x) == 1:
        half = 0.5 * max(abs(float(x[0])), 1.0)
        return np.array([x[0] - half, x[0] + half])
    between = 0.5 * (x[1:] + x[:-1])
    return np.concatenate([[2 * x[0] - between[0]], between, [2 * x[-1] - between[-1]]])


def _ticks(panel: Axes, axis: SweepAxis, letter: str) -> None:
    """Names at the ticks of an axis whose values are no numbers."""
    if axis.numbers is not None:
        return
    every = max(1, len(axis.values) // _TICKS)
    numbers = range(0, len(axis.values), every)
    names = [str(axis.values[i]).replace("$", r"\$") for i in numbers]
    (panel.set_xticks if letter == "x" else panel.set_yticks)(list(numbers), labels=names)
