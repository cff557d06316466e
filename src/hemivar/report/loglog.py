"""Figures on logarithmic scales: errors over the mesh size or the unknowns, residual and energy over the steps."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from hemivar.basics.arguments import expecting
from hemivar.basics.types import Array, BoolArray
from hemivar.bounds import AdaptiveSolution
from hemivar.bounds.adaptive import AdaptiveLevel
from hemivar.bounds.exact_certificate import statement_of
from hemivar.certificates import Certificate
from hemivar.errors import ProblemError
from hemivar.report.certificate_line import FOOT, certificate_line, title_of, write_below, write_foot
from hemivar.report.picture import new_figure
from hemivar.report.style import (
    BLUE,
    DASHES,
    GREEN,
    GREY,
    LINES,
    ORANGE,
    PURPLE,
    RED,
    SERIES,
    SKY,
    axes,
    axes_on,
    drawing,
    figure_of,
    legend_beside,
    with_unit,
)
from hemivar.report.tables import reciprocal
from hemivar.solvers import Solution
from hemivar.workflows.convergence import Convergence, observed_order

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["plot_adaptive", "plot_errors", "plot_history", "plot_study"]

_CURVES = {"energy": "energy norm", "displacement": r"$L^2$ norm", "pressure": "contact pressure"}
_MARKS = "os^DvP"


# ---- what they share -------------------------------------------------------------------------------------------


def _log_axes(ax: Axes, across: str, up: str) -> None:
    """Logarithmic scales with these names, and a grid."""
    ax.set(xscale="log", yscale="log", xlabel=across, ylabel=up)
    ax.grid(True, which="major", color="#e2e2e2", lw=0.6)
    ax.set_axisbelow(True)
    ax.spines[["top", "right"]].set_visible(False)


def _curve(ax: Axes, x: Array, y: Array, filled: BoolArray, colour: str, mark: str, label: str) -> None:
    """A curve of what is positive, with filled marks (k,) and hollow ones."""
    label += "\n(zero)" if (y == 0.0).all() else ""
    y = np.where(np.isfinite(y) & (y > 0.0), y, np.nan)
    style: dict[str, Any] = {"color": colour, "marker": mark, "ms": 4.8, "mew": 0.9}
    ax.plot(x, y, mfc=colour if filled.any() else "white", label=label, **style)
    if filled.any() and not filled.all():
        ax.plot(x[~filled], y[~filled], ls="", mfc="white", **style)


def _sizes_at_ticks(ax: Axes, sizes: Array) -> None:
    """Mesh sizes as the ticks, as fractions where all are."""
    from matplotlib.ticker import NullFormatter

    whole = all(reciprocal(float(h)) for h in sizes)
    ax.set_xticks(sizes, labels=[f"1/{reciprocal(float(h))}" if whole else f"{h:.3g}" for h in sizes])
    ax.xaxis.set_minor_formatter(NullFormatter())
    ax.xaxis.set_tick_params(which="minor", length=0)


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
    ax: Axes,
    ends: tuple[float, float],
    heights: tuple[float, float],
    slope: float,
    colour: str,
    *,
    above: bool,
    text_of_slope: str = "",
) -> None:
    """A triangle of a slope between two sizes, from a height on by a factor."""
    (left, right), (low, rise) = ends, heights
    flat, upright = (low * rise, left) if above else (low, right)
    ax.plot([left, right, upright, left], [low, low * rise, flat, low], color=colour, lw=0.8)
    for text, at, shift in (
        ("1", (math.sqrt(left * right), flat), (0, 2 if above else -2)),
        (text_of_slope or f"{slope:.2f}", (upright, low * math.sqrt(rise)), (-3 if above else 3, 0)),
    ):
        across = shift[0] != 0
        ax.annotate(
            text, at, xytext=shift, textcoords="offset points", fontsize=8.0, color=colour,
            va="center" if across else "bottom" if above else "top",
            ha="center" if not across else "right" if above else "left",
        )  # fmt: skip


# ---- studies ---------------------------------------------------------------------------------------------------


@expecting(study=Convergence, title=str, unit=str, ax=axes)
def plot_study(study: Convergence, *, title: str | None = None, unit: str = "", ax: Axes | None = None) -> Figure:
    """Relative errors over the mesh size or the step on logarithmic scales, each with a triangle of its slope.

    The slope of a triangle is the fitted order, as in the legend.  Hollow marks stand for a mesh next to the
    reference, with which it shares errors; the fit leaves it out.

    Parameters
    ----------
    study : Study or TimeStudy
    title : str, optional
    unit : str, optional
        Of the mesh size, or the step.
    ax : matplotlib axes, optional
        Where to draw; a new figure, as wide as a column of print, by default.

    Raises
    ------
    ProblemError
        There are no errors to draw.
    """
    from matplotlib.ticker import FuncFormatter

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
            order = study.orders[name]
            text = _CURVES[name] + ("" if math.isnan(order) else f", order {order:.2f}")
            _curve(ax, sizes, values, study.trusted, SERIES[number], _MARKS[number], text)
        drawn = list(curves.values())
        if np.isfinite(study.bounds).any() and study.norms["energy"] > 0.0:
            bounds = np.where(np.isfinite(study.bounds), study.bounds, np.nan) / study.norms["energy"]
            ax.plot(
                sizes, bounds, color=SERIES[0], ls="--", marker="x", ms=5.0, label=f"energy norm, {study.kind_of_bound}"
            )
            drawn.append(bounds)
        _triangles(ax, sizes, curves, study.orders, drawn)
        _log_axes(ax, with_unit(study.measured_by, unit), "relative error")
        shown = sizes[np.isfinite(np.array(drawn)).any(axis=0)]
        _sizes_at_ticks(ax, shown)
        ax.yaxis.set_major_formatter(FuncFormatter(lambda value, _: _decimal(value)))
        ax.set_xlim(shown.min() / 1.35, shown.max() * 1.35)
        low, high = ax.get_ylim()
        ax.set_ylim(low / 1.8, high)
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


# ---- adaptive solves -------------------------------------------------------------------------------------------


@expecting(adaptive=AdaptiveSolution, beside=Mapping, title=str, certificate=Certificate)
def plot_adaptive(
    adaptive: AdaptiveSolution,
    *,
    beside: Mapping[str, AdaptiveSolution] | None = None,
    title: str | None = None,
    certificate: Certificate | None = None,
) -> Figure:
    """Relative error against the number of unknowns, on logarithmic scales.

    Filled marks are guaranteed bounds, open ones estimates; broken lines are the parts that the bound is made of.  With
    a goal half its interval and the spread of its estimate, over its value, are drawn, too.

    With other solves ``beside`` it, such as one on uniform meshes (``solve_adaptive(problem, share=1.0)``), their
    bounds are compared over the unknowns and over the time that they took.

    Parameters
    ----------
    adaptive : AdaptiveSolution
    beside : mapping of name to AdaptiveSolution, optional
        Other solves of the same problem.
    title : str, optional
    certificate : Certificate, optional
        What is known about the last solution, for the line below; without it the line has residual and distance.

    Raises
    ------
    ProblemError
        No mesh has a distance.
    """
    if beside:
        return _compared(adaptive, beside, title, certificate)
    levels = [level for level in adaptive.levels if math.isfinite(level.distance.relative) or level.goal is not None]
    if not levels:
        raise ProblemError("no mesh of this adaptive solve has a distance to draw; see the reasons of its distance")
    unknowns = np.array([level.unknowns for level in levels], dtype=float)
    with drawing():
        high = 3.9 + FOOT
        fig = new_figure((6.3, high))
        ax = fig.add_axes((0.11, (0.507 + FOOT) / high, 0.53, 3.042 / high))
        _bounds(ax, unknowns, levels)
        goal = levels[-1].goal
        if goal is not None:
            name = goal.goal.name
            sure = np.array([level.goal.relative for level in levels if level.goal is not None])
            about = np.array([level.goal.estimated for level in levels if level.goal is not None])
            proved = np.array([level.guaranteed for level in levels])
            _curve(ax, unknowns, sure, proved, RED, "s", f"{name}:\nhalf the interval over the value")
            _curve(
                ax, unknowns, about, np.zeros(len(levels), dtype=bool), GREEN, "D", f"{name}:\nestimate, dual weights"
            )
        ax.axhline(adaptive.rtol, color="black", lw=0.8, ls=(0, (1, 2)), label=f"asked for: {_percent(adaptive.rtol)}")
        _log_axes(ax, "unknowns", "relative error")
        if not any(np.isfinite(line.get_ydata()).any() for line in ax.lines[:-1]):  # errors of zero, as without loads
            ax.set_xlim(unknowns[0] / 10.0, unknowns[-1] * 10.0)
            ax.set_ylim(adaptive.rtol / 10.0, adaptive.rtol * 10.0)
        _slope(ax, unknowns, levels, 1.0 if goal is not None else 0.5)
        _scales(ax, unknowns)
        legend_beside(ax, labelspacing=0.8)
        write_below(ax, certificate_line(adaptive.solution, certificate, statement_of(adaptive.distance)))
        if heading := title_of(adaptive.solution, title):
            ax.set_title(heading)
    return fig


def _scales(ax: Axes, across: Array) -> None:
    """Ticks of logarithmic scales, errors in per cent."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    ax.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    ax.yaxis.set_major_formatter(FuncFormatter(lambda value, _: _percent(value)))
    few = across.max() < 100.0 * across.min()
    ax.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0) if few else (1.0,)))
    ax.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:.6g}"))
    ax.xaxis.set_minor_formatter(NullFormatter())
    ax.yaxis.set_minor_formatter(NullFormatter())


def _compared(
    adaptive: AdaptiveSolution,
    beside: Mapping[str, AdaptiveSolution],
    title: str | None,
    certificate: Certificate | None,
) -> Figure:
    """Bounds of several solves over their unknowns and over their time."""
    solves = {"adaptive": adaptive, **beside}
    with drawing():
        fig = new_figure((6.3, 3.1), layout="constrained")
        left, right = fig.subplots(1, 2, sharey=True)
        seen: list[Array] = []
        for number, (name, one) in enumerate(solves.items()):
            levels = [level for level in one.levels if math.isfinite(level.relative)]
            proved = np.array([level.guaranteed for level in levels], dtype=bool)
            bound = np.array([level.relative for level in levels])
            seconds = np.array([level.seconds for level in levels])
            unknowns = np.array([level.unknowns for level in levels], dtype=float)
            if not levels:
                raise ProblemError(f"no mesh of '{name}' has a distance to draw; see the reasons of its distance")
            for ax, across in ((left, unknowns), (right, seconds)):
                _curve(ax, across, bound, proved, SERIES[number % len(SERIES)], "osD^vX"[number % 6], name)
            seen += [unknowns, seconds]
        for ax, sizes, label in ((left, seen[::2], "unknowns"), (right, seen[1::2], "time (s)")):
            ax.axhline(
                adaptive.rtol, color="black", lw=0.8, ls=(0, (1, 2)), label=f"asked for: {_percent(adaptive.rtol)}"
            )
            _log_axes(ax, label, "")
            _scales(ax, np.concatenate(sizes))
        sure = all(level.guaranteed for one in solves.values() for level in one.levels)
        left.set_ylabel("relative error, guaranteed bound" if sure else "relative error, bound or estimate")
        left.legend(loc="best")
        if heading := title_of(adaptive.solution, title):
            fig.suptitle(heading, fontsize=10.0)
        write_foot(fig, certificate_line(adaptive.solution, certificate, statement_of(adaptive.distance)))
    return fig


def _bounds(ax: Axes, unknowns: Array, levels: list[AdaptiveLevel]) -> None:
    """The bound of the distance and its parts."""
    size = np.array([level.distance.energy_norm for level in levels])
    proved = np.array([level.distance.guaranteed for level in levels])
    bound = np.array([level.distance.relative for level in levels])
    label = "distance to the exact solution:\n" + ("guaranteed bound" if proved.any() else "estimate")
    _curve(ax, unknowns, bound, proved, BLUE, "o", label)
    parts = (("misfit", "constitutive residual", SKY), ("contact", "contact", ORANGE), ("oscillation", "loads", PURPLE))
    for name, called, colour in parts:
        part = np.array([getattr(level.distance.parts, name) for level in levels])
        share = np.divide(part, size, out=np.full(len(part), np.nan), where=size > 0.0)
        share[~(share > 0.02 * bound)] = np.nan
        if np.isfinite(share).any():
            ax.plot(unknowns, share, color=colour, ls=DASHES, lw=1.1, marker=".", ms=3.0, label=f"  part: {called}")


def _slope(ax: Axes, unknowns: Array, levels: list[AdaptiveLevel], power: float) -> None:
    """A line of the best order that linear elements have, below the last curve: 1/d of the distance, 2/d of a goal."""
    dim = levels[-1].problem.field.mesh.dim  # type: ignore[union-attr]
    order = 2.0 * power / dim
    values = [level.distance.relative if level.goal is None else level.goal.estimated for level in levels]
    if len(levels) < 3 or not (math.isfinite(values[-1]) and values[-1] > 0.0):
        return
    first = max(unknowns[0], unknowns[-1] / 30.0)
    x = np.array([first, unknowns[-1]])
    y = 0.55 * values[-1] * (x / x[-1]) ** -order
    text = {1.0: "1", 0.5: "1/2", 2.0 / 3.0: "2/3", 1.0 / 3.0: "1/3"}.get(order, f"{order:g}")
    ax.plot(x, y, color=GREY, lw=0.8, label=f"order {text} in the unknowns")


def _percent(ratio: float) -> str:
    return f"{100.0 * ratio:.6g} %"


# ---- methods -----------------------------------------------------------------------------------------------------


def plot_errors(
    sizes: Array,
    errors: Mapping[tuple[str, str], Array],
    *,
    ax: Axes | None = None,
    title: str | None = None,
    reference_size: float | None = None,
    bounds: Mapping[str, Array] | None = None,
) -> Figure:
    """Errors against h on logarithmic scales, one curve for each pair of reference and method (survey, Figure 5).

    A second panel below shows by how much each curve is above the lowest of them.

    Parameters
    ----------
    sizes : array (k,)
        Mesh sizes h.
    errors : mapping of (reference, method) to array (k,)
        V-norm errors; entries that are nan are left out.
    ax : matplotlib Axes, optional
        Draw the errors here rather than on a new figure, and leave out the second panel.
    title : str, optional
    reference_size : float, optional
        h of the reference solutions. Errors at twice this size are too small, because the reference shares most of
        its error with them: they are shaded, and left out of the fitted orders.
    bounds : mapping of method to array (k,), optional
        Upper bounds of the distance to the exact solution, drawn above the errors of the method.
    """
    from matplotlib.ticker import FuncFormatter, LogLocator

    sizes = np.asarray(sizes, dtype=float)
    references = list(dict.fromkeys(reference for reference, _ in errors))
    methods = list(dict.fromkeys(method for _, method in errors))
    trusted = np.ones(len(sizes), dtype=bool)
    if reference_size is not None:
        trusted = sizes > 2.0 * reference_size * (1 + 1e-9)
    with drawing():
        below = None
        if ax is None:
            fig, ax = axes_on(ax, (6.3, 5.6))
            ax.set_position((0.1, 0.38, 0.54, 0.56))
            below = fig.add_axes((0.1, 0.09, 0.54, 0.22), sharex=ax)
        else:
            fig, ax = axes_on(ax, (6.3, 4.6))
        least = np.nanmin(np.array([np.asarray(values, dtype=float) for values in errors.values()]), axis=0)
        for (reference, method), values in errors.items():
            r, m = references.index(reference), methods.index(method)
            values = np.where(np.asarray(values, dtype=float) > 0.0, values, np.nan)
            order = observed_order(sizes[trusted], values[trusted])
            curves = [(ax, values, f"{method} against {reference}: {order:.2f}")]
            if below is not None:
                curves.append((below, 100.0 * (values / least - 1.0), "_nolegend_"))
            colour = SERIES[m % len(SERIES)]
            for panel, heights, label in curves:
                panel.plot(
                    sizes, heights, color=colour, ls=LINES[r % len(LINES)], lw=1.1, marker=_MARKS[m % len(_MARKS)],
                    markerfacecolor=colour if r % 3 == 2 else "none", ms=8.0 - 2.2 * (r % 3), mew=0.9,
                    zorder=3 - 0.1 * r, label=label,
                )  # fmt: skip
        for method, values in ({} if bounds is None else bounds).items():
            colour = SERIES[methods.index(method) % len(SERIES) if method in methods else -1]
            order = observed_order(sizes, np.asarray(values, dtype=float))
            ax.plot(
                sizes, values, color=colour, lw=4.0, alpha=0.35, solid_capstyle="round", zorder=2,
                label=f"{method}, guaranteed bound: {order:.2f}",
            )  # fmt: skip
        ax.set_xscale("log", base=2)
        ax.set_yscale("log")
        ax.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        ax.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        ax.set_ylabel(r"$\| u - u^h \|_V$")
        lowest = below or ax
        lowest.set_xlabel("h")
        lowest.set_xticks(sizes, labels=[f"1/{n}" if (n := reciprocal(float(h))) else f"{h:.3g}" for h in sizes])
        if below is not None:
            below.set_ylabel("above the\nleast (%)")
            ax.tick_params(labelbottom=False)
        for panel in (ax,) if below is None else (ax, below):
            panel.minorticks_off()
            panel.grid(True, which="major", color="#e2e2e2", lw=0.6)
            panel.set_axisbelow(True)
            if reference_size is not None and not trusted.all():
                shade = "too small: next to\nthe reference" if panel is ax else "_nolegend_"
                panel.axvspan(0.1 * reference_size, 2.8 * reference_size, color="#f3ead7", lw=0, zorder=0, label=shade)
        ax.set_xlim(sizes.min() / 1.5, sizes.max() * 1.3)
        _triangle_of_one(ax, sizes, least)
        legend_beside(ax, title="method against reference: order", title_fontsize=8, alignment="left")
        if title:
            ax.set_title(title)
    return fig


def _triangle_of_one(ax: Axes, sizes: Array, lowest: Array) -> None:
    """A triangle of slope 1 below the curves, of which ``lowest`` is the lowest at each size."""
    order = np.argsort(sizes)[1:3]
    if len(sizes) > 2 and np.isfinite(base := 0.55 * lowest[order[0]]):
        left, right = sizes[order]
        _triangle(ax, (left, right), (base, right / left), 1.0, "black", above=False, text_of_slope="1")


def plot_history(solutions: Solution | Sequence[Solution], *, title: str | None = None) -> Figure:
    """Residual and energy of each step, for one solution or several.

    The energy is shown above the lowest of the same problem. Steps whose difference is zero are not drawn.

    Parameters
    ----------
    solutions : Solution or sequence of Solution
    title : str, optional

    Raises
    ------
    ProblemError
        There is no solution.
    """

    solutions = [solutions] if isinstance(solutions, Solution) else list(solutions)
    if not solutions:
        raise ProblemError("there is no solution whose history could be drawn; give at least one")
    with drawing():
        fig = new_figure((6.3, 3.2), layout="constrained")
        left, right = fig.subplots(1, 2, sharex=True)
        for number, solution in enumerate(solutions):
            alike = [other for other in solutions if other.problem is solution.problem]
            lowest = min((line.energy for other in alike for line in other.history), default=np.inf)
            steps = np.array([line.step for line in solution.history])
            residual = np.array([line.residual for line in solution.history])
            above = np.array([line.energy for line in solution.history]) - lowest
            dash = "-" if number < 6 else (0, (4, 2))
            style = {"color": SERIES[number % 6], "marker": "os^Dv"[number % 5], "ms": 3.2, "lw": 1.0, "ls": dash}
            for panel, values in ((left, residual), (right, above)):
                shown = np.isfinite(values) & (values > 0.0)
                panel.plot(steps[shown], values[shown], label=solution.method, **style)
        for panel, name in ((left, "relative residual"), (right, "energy above the lowest")):
            panel.set_yscale("log")
            panel.set_xlabel("step")
            panel.set_ylabel(name)
            panel.xaxis.get_major_locator().set_params(integer=True)
        fig.legend(*left.get_legend_handles_labels(), loc="outside lower center", ncols=min(len(solutions), 4))
        if title:
            fig.suptitle(title, fontsize=10)
    return fig
