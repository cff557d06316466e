"""Mixed-mode laws in figures: tractions over opening and slip, and the failure envelope."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from hemivar.errors import ProblemError
from hemivar.laws import MixedMode
from hemivar.report.picture import new_figure
from hemivar.report.style import BLUE, GREY, RED, drawing

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["plot_mixed_mode"]

#: Slips, as parts of the largest one, under which the normal traction is drawn.
_UNDER = (0.0, 0.4, 0.8)


def plot_mixed_mode(law: MixedMode, *, point: int = 0, reach: float | None = None, title: str | None = None) -> Figure:
    """Normal traction over the opening, shear over the slip, and where the glue begins to soften and lets go.

    Parameters
    ----------
    law : MixedMode
        With resolved parameters.
    point : int
        Contact point for which the law is drawn.
    reach : float, optional
        Effective opening up to which it is drawn; 1.25 times where it lets go by default.
    title : str, optional

    Raises
    ------
    ProblemError
        If ``reach`` is not a positive number.
    """
    one = law.take(np.array([point]))
    last, peak = one.opening_at_break.item(), one.opening_at_peak.item()
    beta = float(one.beta[0])
    far = 1.25 * last if reach is None else reach
    if not 0.0 < far < math.inf:
        raise ProblemError(f"reach = {reach}; it must be a positive length")
    rho = np.unique(np.concatenate([np.linspace(0.0, far, 400), one.curve_knots[one.curve_knots <= far]]))
    with drawing():
        fig = new_figure((8.4, 3.1), layout="constrained")
        opening, slipping, envelope = fig.subplots(1, 3)
        for part, style in zip(_UNDER, ("-", "--", ":"), strict=True):
            for panel, column, size in ((opening, 0, last / beta), (slipping, 1, last)):
                r = np.zeros((rho.size, 2))
                r[:, 0] = -rho if column == 0 else -part * size
                r[:, 1] = part * size if column == 0 else rho / beta
                force = one.linearise(r).gradient if part else _pure(one, r)
                name = f"slip {part * size:.3g}" if column == 0 else f"opening {part * size:.3g}"
                pull = -force[:, 0] if column == 0 else force[:, 1]
                panel.plot(rho if column == 0 else rho / beta, pull, color=BLUE, ls=style, label=name)
        opening.set(xlabel="opening $w$", ylabel="normal traction")
        slipping.set(xlabel="slip $s$", ylabel="shear traction")
        angle = np.linspace(0.0, 0.5 * np.pi, 200)
        for size, colour, name in ((peak, BLUE, "strength reached"), (last, RED, "broken")):
            envelope.plot(size * np.cos(angle), size * np.sin(angle) / beta, color=colour, label=name)
        envelope.set(xlabel="opening $w$", ylabel="slip $s$", xlim=(0.0, None), ylim=(0.0, None))
        for panel in (opening, slipping, envelope):
            panel.axhline(0.0, color=GREY, lw=0.6, zorder=0)
            panel.spines[["top", "right"]].set_visible(False)
            panel.legend(frameon=False, fontsize=7)
        told = f"$G_c$ = {one.fracture_energy.item():.4g}, shear over normal strength {beta:g}"
        fig.suptitle(f"{title}\n{told}" if title else told, fontsize=9)
    return fig


def _pure(law: MixedMode, r: np.ndarray) -> np.ndarray:
    """Forces of pairs (m, 2) in one mode."""
    return law.near(r).nearest_multiplier(np.zeros(r.shape))
