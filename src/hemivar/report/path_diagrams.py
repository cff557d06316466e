"""The equilibrium path as a figure."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from hemivar.basics.arguments import expecting
from hemivar.basics.types import Array
from hemivar.branches import Path
from hemivar.branches.path_quantities import QUANTITIES
from hemivar.report.style import BLUE, GREY, ORANGE, RED, axes, axes_on, drawing, legend_beside, with_unit

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["fitting_quantity", "plot_path"]


#: What is drawn unless asked for otherwise: that of them which changes most along the path.
_DISPLACEMENTS = ("max-penetration", "max-opening", "max-slip")


def fitting_quantity(path: Path) -> str:
    """The largest penetration, opening or slip, whichever changes most along a path: glue opens, friction slips."""
    values = {name: path.along(name) for name in _DISPLACEMENTS}
    return max(values, key=lambda name: float(np.ptp(np.maximum(values[name], 0.0))) if len(path) else 0.0)


@expecting(path=Path, quantity=str, title=str, unit=str, ax=axes)
def plot_path(
    path: Path,
    *,
    quantity: str | None = None,
    title: str | None = None,
    unit: str = "",
    ax: Axes | None = None,
) -> Figure:
    """The load factor over a displacement or a resultant.

    Stable equilibria are drawn solid, unstable ones dashed; folds are dots, and arrows show where the body jumps when
    the load is prescribed.  They are left out for resultants, and where there are many, those of single contact points.
    A line marks the limit load, or the first instability where the path goes on to higher loads.

    Parameters
    ----------
    path : Path
    quantity : str
        A name in :data:`QUANTITIES`, or ``support.NAME.force``, of which ``.x`` takes a component; by default the
        largest penetration, opening or slip, whichever changes most.
    title, unit : str, optional
        Title, and unit of the quantity.
    ax : matplotlib axes, optional
        Where to draw; a new figure by default.
    """
    quantity = fitting_quantity(path) if quantity is None else quantity
    x, chosen = path.along(quantity), QUANTITIES.get(quantity)
    t = path.load_factor
    with drawing():
        fig, ax = axes_on(ax, (5.6, 3.6))
        for stable, colour, style in ((True, BLUE, "-"), (False, GREY, "--")):
            at = np.flatnonzero(path.stable == stable)
            label = "stable" if stable else "unstable"
            for run in np.split(at, np.flatnonzero(np.diff(at) > 1) + 1):
                if run.size:
                    ends = np.append(run, run[-1] + 1)
                    ax.plot(x[ends], t[ends], label=label, color=colour, linestyle=style)
                    label = "_nolegend_"
        for load, name in ((path.limit_load, "limit load factor"), (path.first_instability, "first instability")):
            if load is None or (name != "limit load factor" and path.limit_load is not None):
                continue
            ax.axhline(load, color=GREY, linewidth=0.6, zorder=0)
            ax.annotate(
                f"{name} {load:.4g}", (1.0, load), (-3.0, 3.0), xycoords=("axes fraction", "data"),
                textcoords="offset points", ha="right", va="bottom", color="black", fontsize="small", zorder=5,
                bbox={"boxstyle": "square,pad=0.1", "facecolor": "white", "edgecolor": "none", "alpha": 0.8},
            )  # fmt: skip
        index = [fold.index for fold in path.main_folds]
        if index:
            ax.plot(x[index], t[index], "o", color="black", markersize=2.5, label="fold", zorder=4)
        index = [point.index for point in path.bifurcations]
        if index:
            ax.plot(x[index], t[index], "D", color="black", markersize=3.0, label="bifurcation", zorder=4)
        if chosen is not None and chosen.of_displacement:
            _draw_jumps(ax, path, quantity, x)
        ax.set_xlabel(with_unit(quantity if chosen is None else chosen.label, unit))
        ax.set_ylabel("load factor")
        ax.locator_params(axis="x", nbins=6)
        ax.ticklabel_format(scilimits=(-3, 4), useMathText=True)
        ax.margins(0.04)
        ax.spines[["top", "right"]].set_visible(False)
        if title:
            ax.set_title(title)
        legend_beside(ax)
    return fig


def _draw_jumps(ax: Axes, path: Path, quantity: str, x: Array) -> None:
    labels = {True: "jump while loading", False: "jump while unloading"}
    for jump in path.main_jumps:
        if jump.local is None:
            continue
        end = path.along(quantity, jump.local[None], np.zeros((1, *jump.local.shape)))[0]
        colour = ORANGE if jump.loading else RED
        start = x[jump.index]
        ax.plot([], [], "-", linewidth=0.8, color=colour, label=labels.pop(jump.loading, "_nolegend_"))
        ax.annotate(
            "",
            xy=(end, jump.load_factor),
            xytext=(start, jump.load_factor),
            arrowprops={"arrowstyle": "->", "color": colour, "linewidth": 0.8, "shrinkA": 2.0, "shrinkB": 0.0},
        )
