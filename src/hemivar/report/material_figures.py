"""Materials in figures: stress over strain, with the lines between which the bounds of the tangent keep it."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from hemivar.basics.arguments import expecting, positive
from hemivar.basics.types import Array
from hemivar.errors import ProblemError
from hemivar.mechanics import Material
from hemivar.report.picture import new_figure
from hemivar.report.style import BLUE, GREY, RED, drawing

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["plot_material"]

#: Strains among which the one is looked for at which the material is half way from one stiffness to another.
_SIZES = np.geomspace(1e-8, 1.0, 400)


@expecting(material=Material, reach=positive, title=str)
def plot_material(
    material: Material, *, reach: float | None = None, point: tuple[float, ...] | None = None, title: str | None = None
) -> Figure:
    """Stress over strain in shear and in compression and tension, with C_low and C_up, and the description below.

    On the left the shear stress over the angle; on the right the stress along one strain, all others zero (a block
    between rollers). The stress lies between the lines of C_low and C_up, since at zero strain it is zero. ``reach`` is
    the largest strain, by default one that shows how the stiffness changes; constants that vary are those at ``point``.
    """
    description = material.describe(point)
    if description.lower is None or description.upper is None:
        raise ProblemError("materials by regions or with constants that vary: draw one material, at a point")
    dim = 2 if len(description.lower) == 3 else 3
    at = np.zeros((1, dim)) if point is None else np.asarray([point], dtype=float)
    shear = len(description.lower) - 1

    def stress(component: int, strain: Array) -> Array:
        whole = np.zeros((len(strain), shear + 1))
        whole[:, component] = strain
        return np.asarray(material.stress(np.broadcast_to(at, (len(strain), dim)), whole)[:, component])

    if reach is None:
        reach = _reach_of(stress(shear, _SIZES) / _SIZES, stress(0, _SIZES) / _SIZES, description.reach)
    if not 0.0 < reach < math.inf:
        raise ProblemError(f"reach = {reach}; it must be a positive strain")
    strain = np.linspace(-reach, reach, 801)
    lines = [line.strip() for line in description.lines]
    with drawing():
        fig = new_figure((6.6, 3.4 + 0.17 * len(lines)), layout="constrained")
        panels = fig.subplots(1, 2)
        for panel, component, names in (
            (panels[0], shear, (r"shear strain $\gamma$", r"shear stress $\tau$")),
            (panels[1], 0, (r"strain $\varepsilon$, the others zero", r"stress $\sigma$ along it")),
        ):
            low, up = description.lower[component, component], description.upper[component, component]
            _draw(panel, strain, stress(component, strain), (low, up), names)
        panels[0].legend(loc="upper left")
        fig.suptitle(title if title is not None else description.name)
        text = "\n".join(line.replace("$", r"\$") for line in lines)
        fig.supxlabel(text, fontsize=7.5, x=0.02, ha="left")
    return fig


def _draw(panel: Axes, strain: Array, stress: Array, bounds: tuple[float, float], names: tuple[str, str]) -> None:
    low, up = bounds
    panel.axhline(0.0, color="#b0b0b0", lw=0.6, zorder=0)
    panel.axvline(0.0, color="#b0b0b0", lw=0.6, zorder=0)
    panel.fill_between(strain, low * strain, up * strain, color=GREY, alpha=0.12, lw=0.0)
    panel.plot(strain, up * strain, color=GREY, ls=(0, (4, 2)), lw=1.0, label=r"$C_{up}$")
    panel.plot(strain, low * strain, color=RED, ls=(0, (4, 2)), lw=1.0, label=r"$C_{low}$")
    panel.plot(strain, stress, color=BLUE, lw=1.8, label="stress")
    panel.set_xlim(strain[0], strain[-1])
    highest = 1.25 * float(np.abs(stress).max())
    panel.set_ylim(-highest, highest)
    panel.set_xlabel(names[0])
    panel.set_ylabel(names[1])


def _reach_of(shear: Array, along: Array, limit: float) -> float:
    """Four times the strain at which the secants are half way from one end of the range to the other."""
    sizes = []
    for secant in (shear, along):
        kept = secant[limit >= _SIZES]
        change = np.abs(kept - kept[0])
        if change.max(initial=0.0) > 1e-3 * abs(kept[0]):
            sizes.append(float(_SIZES[int(np.argmax(change >= 0.5 * change.max()))]))
    return min(4.0 * min(sizes), limit) if sizes else min(0.01, limit)
