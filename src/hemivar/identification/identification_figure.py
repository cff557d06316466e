"""Figure and table of a fit: the measured curve, the residuals, the intervals of the parameters."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from hemivar.basics.types import BoolArray
from hemivar.errors import ProblemError
from hemivar.identification.fit import Fit
from hemivar.report.picture import new_figure
from hemivar.report.style import BLUE, GREY, RED, drawing
from hemivar.report.summary import Summary

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["fit_summary", "plot_fit"]


def fit_summary(fit: Fit) -> Summary:
    """What the command prints of a fit: parameters with their intervals, misfit, noise, and notes."""
    rows = []
    for parameter, value, ends, sure in zip(fit.parameters, fit.values, fit.intervals, fit.identified, strict=True):
        reach = f"{ends[0]:.4g} to {ends[1]:.4g}" if np.isfinite(ends).all() else "any"
        doubt = "" if sure else ", not identifiable"
        rows.append((parameter.key.rpartition(".")[2], f"{value:.5g} ({reach}){doubt}"))
    rows += [("misfit", f"{fit.misfit:.2%}"), ("intervals", f"{fit.confidence:.0%}, noise {fit.noise:.2%}")]
    rows += [("note", text) for text in fit.messages]
    return Summary(tuple(rows))


def plot_fit(fit: Fit, *, title: str | None = None) -> Figure:
    """The measured curve, the fit, what is left, and the intervals of the parameters."""
    if not isinstance(fit, Fit):
        raise ProblemError("plot_fit draws what hemivar.identification.identify returns; give that")
    from matplotlib.ticker import MaxNLocator

    measured = fit.measurements
    (key, across), *_ = measured.inputs.items()
    count = len(measured.measured)
    with drawing():
        fig = new_figure((3.6 * (count + 1), 3.4), layout="constrained")
        axes = fig.subplots(2, count + 1, height_ratios=(3, 1), squeeze=False, sharex="col")
        for column, name in enumerate(measured.measured):
            above, below = axes[:, column]
            values, scale = measured.values[:, column], measured.scales[column]
            above.plot(across, values, "o", ms=3.5, mfc="white", color=GREY, label="measured")
            above.plot(across, fit.predicted[:, column], color=BLUE, label="fit")
            above.set_ylabel(name)
            above.legend()
            below.axhline(0.0, color="black", lw=0.7)
            below.axhspan(-100.0 * fit.noise, 100.0 * fit.noise, color="#e8eef4", lw=0, zorder=0)
            below.plot(across, 100.0 * (values - fit.predicted[:, column]) / scale, ".", ms=4.0, color=RED)
            below.set_ylabel("left, %")
            below.set_xlabel(key)
            below.xaxis.set_major_locator(MaxNLocator(5))
        for ax in axes[:, count]:
            ax.remove()
        _intervals(fig.add_subplot(axes[0, 0].get_gridspec()[:, count]), fit)
        if title:
            fig.suptitle(title)
    return fig


def _intervals(ax: Axes, fit: Fit) -> None:
    """Intervals of the parameters in units of their values; an open one where the curve says nothing."""
    names = [parameter.key.rpartition(".")[2] for parameter in fit.parameters]
    unit = np.where(fit.values != 0.0, np.abs(fit.values), 1.0)
    reach = (fit.intervals - fit.values[:, None]) / unit[:, None]
    known: BoolArray = np.asarray(np.isfinite(reach).all(axis=1))
    most = max(float(np.abs(reach[known]).max(initial=0.0)), 0.01)
    ax.axvline(0.0, color="black", lw=0.7)
    for number, (name, sure) in enumerate(zip(names, fit.identified, strict=True)):
        height, colour = len(names) - 1 - number, BLUE if sure else RED
        ends = reach[number] if known[number] else np.array([-1.25 * most, 1.25 * most])
        ax.plot(100.0 * ends, (height, height), color=colour, lw=2.5, ls="-" if known[number] else ":")
        ax.plot(0.0, height, "o", color=colour, ms=4.5)
        ax.annotate(
            f"{name} = {fit.values[number]:.4g}" + ("" if sure else ": not identified"), (0.0, height), xytext=(0, 6),
            textcoords="offset points", ha="center", va="bottom", fontsize=8.0, color=colour,
            bbox={"fc": "white", "ec": "none", "pad": 1.0},
        )  # fmt: skip
    ax.set_yticks([])
    ax.set_ylim(-0.6, len(names) - 0.2)
    ax.set_xlabel(f"interval of {fit.confidence:.0%}, % of the value")
