"""Errors over the mesh size with triangles of their slope; margin and number of solutions over parameters."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from hemivar.basics.types import Array
from hemivar.errors import ProblemError
from hemivar.report.picture import new_figure
from hemivar.report.style import BLUE, GREY, RED, SERIES, drawing, figure_of, with_unit
from hemivar.report.tables import reciprocal
from hemivar.workflows.study import Study
from hemivar.workflows.sweep import Sweep, SweepAxis

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from hemivar.files.sweep_point import SweepPoint


__all__ = ["plot_study", "plot_sweep"]

_CURVES = {"energy": "energy norm", "displacement": r"$L^2$ norm", "pressure": "contact pressure"}
_MARKS = ("o", "s", "^")
#: Values of a parameter that get a tick each where they are no numbers, or few.
_TICKS = 12


# ---- convergence -----------------------------------------------------------------------------------------------


def plot_study(study: Study, *, title: str | None = None, unit: str = "", ax: Axes | None = None) -> Figure:
    """Relative errors over the mesh size on logarithmic scales, each with a triangle of its slope.

    The slope of a triangle is the fitted order, as in the legend.  Hollow marks stand for a mesh next to the
    reference, with which it shares errors; the fit leaves it out.

    Parameters
    ----------
    study : Study
    title : str, optional
    unit : str, optional
        Of the mesh size.
    ax : matplotlib axes, optional
        Where to draw; a new figure, as wide as a column of print, by default.

    Raises
    ------
    ProblemError
        There are no errors to draw.
    """
    from matplotlib.ticker import FuncFormatter, NullFormatter

    sizes = study.sizes
    curves = {name: study.relative(name) for name in study.quantities}
    curves = {name: np.where(values > 0.0, values, np.nan) for name, values in curves.items()}
    curves = {name: values for name, values in curves.items() if np.isfinite(values).any()}
    if not curves and not any(study.norms[name] > 0.0 for name in study.quantities):
        raise ProblemError("the figure shows errors relative to the reference, which is zero; take the table")
    if not curves:
        raise ProblemError("the study has no errors to draw: take at least one finer mesh")
    with drawing():
        if ax is None:
            fig = new_figure((4.0, 3.4), layout="constrained")
            ax = fig.add_subplot()
        else:
            fig = figure_of(ax)
        for number, (name, values) in enumerate(curves.items()):
            colour, order = SERIES[number], study.orders[name]
            text = _CURVES[name] + ("" if math.isnan(order) else f", order {order:.2f}")
            ax.plot(sizes, values, color=colour, marker=_MARKS[number], ms=5.0, label=text)
            shared = np.logical_not(study.trusted)
            ax.plot(sizes[shared], values[shared], ls="", color=colour, marker=_MARKS[number], ms=5.0, mfc="white")
        drawn = list(curves.values())
        if np.isfinite(study.bounds).any() and study.norms["energy"] > 0.0:
            bounds = np.where(np.isfinite(study.bounds), study.bounds, np.nan) / study.norms["energy"]
            ax.plot(
                sizes, bounds, color=SERIES[0], ls="--", marker="x", ms=5.0, label=f"energy norm, {study.kind_of_bound}"
            )
            drawn.append(bounds)
        _triangles(ax, sizes, curves, study.orders, drawn)
        ax.set_xscale("log")
        ax.set_yscale("log")
        shown = sizes[np.isfinite(np.array(drawn)).any(axis=0)]
        whole = all(reciprocal(float(h)) for h in shown)
        ax.set_xticks(shown, labels=[f"1/{reciprocal(float(h))}" if whole else f"{h:.3g}" for h in shown])
        ax.xaxis.set_minor_formatter(NullFormatter())
        ax.xaxis.set_tick_params(which="minor", length=0)
        ax.yaxis.set_major_formatter(FuncFormatter(lambda value, _: _decimal(value)))
        ax.set_xlim(shown.min() / 1.35, shown.max() * 1.35)
        low, high = ax.get_ylim()
        ax.set_ylim(low / 1.8, high)
        ax.set_xlabel(with_unit("mesh size h", unit))
        ax.set_ylabel("relative error")
        ax.grid(True, which="major", color="#e2e2e2", lw=0.6)
        ax.set_axisbelow(True)
        ax.spines[["top", "right"]].set_visible(False)
        legend = ax.legend(loc="upper left", bbox_to_anchor=(0.0, 1.0), frameon=True, framealpha=0.9, edgecolor="none")
        # room for the legend above the curves
        low, high = ax.get_ylim()
        ax.set_ylim(low, high * (high / low) ** (0.125 * len(legend.get_texts())))
        if title:
            ax.set_title(title)
    return fig


def _decimal(value: float) -> str:
    """A power of ten as it is read most easily."""
    return f"{value:g}" if 1e-3 <= value <= 1e3 else rf"$10^{{{round(math.log10(value))}}}$"


def _triangles(
    ax: Axes, sizes: Array, curves: Mapping[str, Array], orders: Mapping[str, float], drawn: Sequence[Array]
) -> None:
    """Triangles of the fitted orders, each beside its curve where nothing else is; none where there is no such place.

    Taken in turn are the stretches of a curve, the finest but one first, with the triangle below and above it.
    """
    finite = np.concatenate([values[np.isfinite(values)] for values in curves.values()])
    height = max(math.log(float(finite.max() / finite.min())), 1.0)
    gap, letters = 0.05 * height, 0.09 * height
    taken: list[Array] = []
    for number, (name, values) in enumerate(curves.items()):
        good = np.flatnonzero(np.isfinite(values))
        order = orders[name]
        if math.isnan(order) or len(good) < 3 or (slope := round(order, 2)) <= 0.0:
            continue
        stretches = sorted(range(len(good) - 1), key=lambda k: abs(k - (len(good) - 3)))
        for k, above in ((k, above) for k in stretches for above in (False, True)):
            right, left = np.log(sizes[good[k]]), np.log(sizes[good[k + 1]])
            high, low = np.log(values[good[k]]), np.log(values[good[k + 1]])
            rise = slope * (right - left)
            foot = max(low, high - rise) + gap if above else min(low, high - rise) - gap
            wide = 0.22 * (right - left)
            x = np.linspace(left - wide if above else left, right if above else right + wide, 40)
            ramp = foot + np.clip((x - left) / (right - left), 0.0, 1.0) * rise
            flat = np.full(len(x), foot + rise + letters if above else foot - letters)
            band = np.stack([x, ramp, flat] if above else [x, flat, ramp])
            if not any(_meet(band, one) for one in taken + [_line(sizes, other) for other in drawn]):
                taken.append(band)
                ends, heights = (math.exp(left), math.exp(right)), (math.exp(foot), math.exp(rise))
                _triangle(ax, ends, heights, slope, SERIES[number], above=above)
                break


def _line(sizes: Array, values: Array) -> Array:
    """A curve as a band of no height, in logarithms: places, lower and upper ends, (3, k)."""
    good = np.flatnonzero(np.isfinite(values))[np.argsort(sizes[np.isfinite(values)])]
    return np.log(np.stack([sizes[good], values[good], values[good]]))


def _meet(one: Array, other: Array) -> bool:
    """Whether two bands have a point in common."""
    x = one[0]
    inside = (x >= other[0, 0]) & (x <= other[0, -1])
    low, high = (np.interp(x[inside], other[0], part) for part in other[1:])
    return bool(((one[1][inside] < high) & (low < one[2][inside])).any())


def _triangle(
    ax: Axes, ends: tuple[float, float], heights: tuple[float, float], slope: float, colour: str, *, above: bool
) -> None:
    """A triangle of a slope between two sizes, from a height on by a factor."""
    (left, right), (low, rise) = ends, heights
    flat, upright = (low * rise, left) if above else (low, right)
    ax.plot([left, right, upright, left], [low, low * rise, flat, low], color=colour, lw=0.8)
    for text, place, shift in (
        ("1", (math.sqrt(left * right), flat), (0, 2 if above else -2)),
        (f"{slope:.2f}", (upright, low * math.sqrt(rise)), (-3 if above else 3, 0)),
    ):
        across = shift[0] != 0
        ax.annotate(
            text, place, xytext=shift, textcoords="offset points", fontsize=8.0, color=colour,
            va="center" if across else "bottom" if above else "top",
            ha="center" if not across else "right" if above else "left",
        )  # fmt: skip


# ---- parameters ------------------------------------------------------------------------------------------------


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
    x = _places(axis)
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
    for panel in (above, below):
        panel.spines[["top", "right"]].set_visible(False)
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
    told = fig.colorbar(blocks, ax=right, label="number of solutions", ticks=np.arange(0, len(numbers), every))
    told.ax.set_yticklabels([str(number) for number in numbers[::every]])
    told.ax.minorticks_off()
    middles = [_places(axis) for axis in sweep.axes]
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
        for axis, way in zip(sweep.axes, "xy", strict=True):
            if axis.numbers is not None:
                (panel.xaxis if way == "x" else panel.yaxis).set_major_locator(
                    MaxNLocator(nbins=4 if way == "x" else 8)
                )
            _ticks(panel, axis, way)
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


def _places(axis: SweepAxis) -> Array:
    """Where the values of an axis stand: at their numbers, or one after the other."""
    return np.arange(len(axis.values), dtype=float) if axis.numbers is None else axis.numbers


def _edges(axis: SweepAxis) -> Array:
    """Ends of the cells around the values of an axis."""
    x = _places(axis)
    if len(x) == 1:
        half = 0.5 * max(abs(float(x[0])), 1.0)
        return np.array([x[0] - half, x[0] + half])
    between = 0.5 * (x[1:] + x[:-1])
    return np.concatenate([[2 * x[0] - between[0]], between, [2 * x[-1] - between[-1]]])


def _ticks(panel: Axes, axis: SweepAxis, way: str) -> None:
    """Names at the ticks of an axis whose values are no numbers."""
    if axis.numbers is not None:
        return
    every = max(1, len(axis.values) // _TICKS)
    places = range(0, len(axis.values), every)
    names = [str(axis.values[i]).replace("$", r"\$") for i in places]
    (panel.set_xticks if way == "x" else panel.set_yticks)(list(places), labels=names)
