"""Laws that couple opening and slip in figures: tractions over both, the failure envelope, or the potential."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from hemivar.errors import ProblemError
from hemivar.laws import MixedMode, ModeDependentGlue, OwnCoupledLaw
from hemivar.report.picture import new_figure
from hemivar.report.style import BLUE, GREY, RED, drawing

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["plot_coupled_law", "plot_mixed_mode", "plot_mode_dependent"]

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


def plot_mode_dependent(
    law: ModeDependentGlue, *, point: int = 0, reach: float | None = None, title: str | None = None
) -> Figure:
    """Tractions of both pure modes and an even one over the effective opening, and the energy over the mode.

    Parameters
    ----------
    law : ModeDependentGlue
        With resolved parameters.
    point : int
    reach : float, optional
        Effective opening up to which it is drawn; a little beyond the break by default.
    title : str, optional

    Raises
    ------
    ProblemError
        If ``reach`` is not a positive number.
    """
    one, modes = law.take(np.array([point])), np.linspace(0.0, 1.0, 201)
    ends = [one.at_mode(mode).opening_at_break.item() for mode in modes.tolist()]
    far = 1.1 * max(ends) if reach is None else reach
    if not 0.0 < far < math.inf:
        raise ProblemError(f"reach = {reach}; it must be a positive length")
    with drawing():
        fig = new_figure((8.4, 3.1), layout="constrained")
        traction, energy, break_ = fig.subplots(1, 3)
        for mode, style, name in ((0.0, "-", "opening"), (0.5, "--", "even"), (1.0, ":", "shear")):
            frozen = one.at_mode(mode)
            knots = frozen.curve_knots.ravel()
            rho = np.unique(np.concatenate([[0.0, far], knots[knots <= far]]))
            traction.plot(rho, frozen.cohesion.derivative(rho), color=BLUE, ls=style, label=f"{name}, $B$ = {mode:g}")
        traction.set(xlabel="effective opening $\\rho$", ylabel="traction $\\Phi_B'$")
        energy.plot(modes, one.criterion.energy(modes)[0], color=BLUE)
        energy.set(xlabel="mode $B$ (0 opening, 1 shear)", ylabel="fracture energy $G_c$", ylim=(0.0, None))
        last = np.array(ends)
        break_.plot(last * np.sqrt(1.0 - modes), last * np.sqrt(modes) / one.ratio, color=RED, label="broken")
        break_.set(xlabel="opening $w$", ylabel="slip $s$", xlim=(0.0, None), ylim=(0.0, None))
        for panel in (traction, energy, break_):
            panel.spines[["top", "right"]].set_visible(False)
        for panel in (traction, break_):
            panel.legend(frameon=False, fontsize=7)
        if title:
            fig.suptitle(title, fontsize=9)
    return fig


def plot_coupled_law(law: OwnCoupledLaw, *, reach: float | None = None, title: str | None = None) -> Figure:
    """Normal traction over the opening, shear over the slip, and contours of the potential.

    Parameters
    ----------
    law : OwnCoupledLaw
    reach : float, optional
        Opening and slip up to which it is drawn; where the tractions have fallen to a fiftieth by default.
    title : str, optional

    Raises
    ------
    ProblemError
        If ``reach`` is not a positive number.
    """
    far = _seen_reach(law) if reach is None else reach
    if not 0.0 < far < math.inf:
        raise ProblemError(f"reach = {reach}; it must be a positive length")
    last = 0.0 if law.rigid else 0.3 * far
    along = np.linspace(1e-9, 1.0, 400) * far
    opening = np.linspace(far, -last, 521)
    with drawing():
        fig = new_figure((8.4, 3.1), layout="constrained")
        normal, shear, potential = fig.subplots(1, 3)
        for part, style in zip((0.0, 0.15, 0.3), ("-", "--", ":"), strict=True):
            fixed = np.full(opening.size, part * far)
            pull = -law.slopes_at(-opening, fixed, -1.0)[0]
            normal.plot(opening, pull, color=BLUE, ls=style, label=f"slip {part * far:.3g}")
            fixed = np.full(along.size, -part * far)
            shear.plot(
                along, law.slopes_at(fixed, along, -1.0)[1], color=BLUE, ls=style, label=f"opening {part * far:.3g}"
            )
        normal.set(xlabel="opening $w$ (negative: penetration)", ylabel="normal traction")
        shear.set(xlabel="slip $s$", ylabel="shear traction")
        w, s = np.meshgrid(np.linspace(-last, far, 121), np.linspace(0.0, far, 101))
        stored = law.potential_at(-w.ravel(), s.ravel()).reshape(w.shape)
        lines = potential.contour(w, s, stored, levels=12, colors=[BLUE], linewidths=0.8)
        potential.clabel(lines, fontsize=6)
        potential.set(xlabel="opening $w$", ylabel="slip $s$", title="potential $j$")
        for panel in (normal, shear):
            panel.axhline(0.0, color=GREY, lw=0.6, zorder=0)
            panel.spines[["top", "right"]].set_visible(False)
            panel.legend(frameon=False, fontsize=7)
        if title:
            fig.suptitle(title, fontsize=9)
    return fig


def _seen_reach(law: OwnCoupledLaw) -> float:
    """Where the tractions of opening and slip alone have fallen to a fiftieth; the reach where they do not."""
    at = law.reach * np.geomspace(1e-5, 1.0, 2000)
    zero = np.zeros(at.size)
    pull = np.abs(law.slopes_at(-at, zero, -1.0)[0])
    drag = np.abs(law.slopes_at(zero, at, -1.0)[1])
    ends = [at[part > 0.02 * part.max()].max(initial=at[0]) for part in (pull, drag) if part.any()]
    return float(1.1 * max(ends, default=law.reach))


def _pure(law: MixedMode, r: np.ndarray) -> np.ndarray:
    """Forces of pairs (m, 2) in one mode."""
    return law.nearest_multiplier(r, np.zeros(r.shape))
