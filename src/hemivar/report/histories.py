"""Figures of how errors and iterations go: errors over the mesh size, residual and energy of each step."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from hemivar.basics.types import Array
from hemivar.errors import ProblemError
from hemivar.report.picture import new_figure
from hemivar.report.style import SERIES, axes_on, drawing
from hemivar.solvers import Solution
from hemivar.workflows.survey_runs import observed_order

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["plot_errors", "plot_history"]


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
    dashes = ["-", (0, (6, 2)), (0, (1.5, 1.5)), (0, (6, 2, 1.5, 2))]
    marks = ["o", "s", "^", "D", "v", "P"]
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
                    sizes, heights, color=colour, ls=dashes[r % len(dashes)], lw=1.1, marker=marks[m % len(marks)],
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
        lowest.set_xticks(sizes, labels=[_fraction(h) for h in sizes])
        if below is not None:
            below.set_ylabel("above the\nleast (%)")
            ax.tick_params(labelbottom=False)
        for panel in (ax,) if below is None else (ax, below):
            panel.minorticks_off()
            panel.grid(True, which="major", color="#e2e2e2", lw=0.6)
            panel.set_axisbelow(True)
            if reference_size is not None and not trusted.all():
                said = "too small: next to\nthe reference" if panel is ax else "_nolegend_"
                panel.axvspan(0.1 * reference_size, 2.8 * reference_size, color="#f3ead7", lw=0, zorder=0, label=said)
        ax.set_xlim(sizes.min() / 1.5, sizes.max() * 1.3)
        _slope_triangle(ax, sizes, least)
        ax.legend(
            loc="upper left", bbox_to_anchor=(1.02, 1.0), borderaxespad=0.0, title="method against reference: order",
            title_fontsize=8, alignment="left",
        )  # fmt: skip
        if title:
            ax.set_title(title)
    return fig


def _slope_triangle(ax: Axes, sizes: Array, lowest: Array) -> None:
    """A triangle of slope 1 below the curves, of which ``lowest`` is the lowest at each size."""
    if len(sizes) < 3:
        return
    order = np.argsort(sizes)
    left, right = sizes[order][1], sizes[order][2]
    base = 0.55 * lowest[order][1]
    if not np.isfinite(base):
        return
    ax.plot([left, right, right, left], [base, base, base * right / left, base], color="black", lw=0.8)
    ax.annotate("1", (math.sqrt(left * right), base), xytext=(0, -3), textcoords="offset points", va="top", ha="center")
    ax.annotate("1", (right, base * math.sqrt(right / left)), xytext=(4, 0), textcoords="offset points", va="center")


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
        raise ProblemError("there is no solution to draw the history of; give at least one")
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
            panel.spines[["top", "right"]].set_visible(False)
            panel.xaxis.get_major_locator().set_params(integer=True)
        fig.legend(*left.get_legend_handles_labels(), loc="outside lower center", ncols=min(len(solutions), 4))
        if title:
            fig.suptitle(title, fontsize=10)
    return fig


def _fraction(h: float) -> str:
    inverse = 1.0 / h
    return f"1/{round(inverse)}" if abs(inverse - round(inverse)) < 1e-9 * inverse else f"{h:.3g}"
