"""Laws in figures: subdifferential and potential, tractions of laws that couple opening and slip, and captions."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping
from dataclasses import fields, is_dataclass
from typing import TYPE_CHECKING

import numpy as np

from hemivar.basics.arguments import expect, expecting, positive, quoted, whole_number
from hemivar.basics.types import Array
from hemivar.discrete.problem import DiscreteProblem
from hemivar.errors import ProblemError
from hemivar.laws import (
    ContactLaw,
    CoulombBound,
    Friction,
    MixedMode,
    ModeDependentGlue,
    NoContact,
    OwnCoupledLaw,
    PenetrationBound,
    PiecewiseQuadratic,
    StateBound,
    Superpotential,
)
from hemivar.laws.description import LawDescription
from hemivar.laws.piecewise_law import PiecewiseLaw
from hemivar.report.picture import new_figure
from hemivar.report.style import BLUE, GREY, RED, drawing, with_unit

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = [
    "draw_graph",
    "law_captions",
    "plot_coupled_law",
    "plot_law",
    "plot_laws",
    "plot_mixed_mode",
    "plot_mode_dependent",
]


#: Rise of a force over the last tenth of a piece, from which on that tenth is left out: the rest could not be seen.
_POLE = 20.0


@expecting(law=Superpotential, point=int, reach=positive, title=str, unit=str, stress_unit=str)
def plot_law(
    law: Superpotential,
    *,
    point: int = 0,
    reach: float | None = None,
    title: str | None = None,
    unit: str = "",
    stress_unit: str = "",
) -> Figure:
    """Graph of the Clarke subdifferential and potential of a law; the title names it and its weak convexity alpha.

    Jumps of the derivative are vertical lines: upward ones, where the law holds, in the colour of the graph;
    downward ones, where it gives way, dashed in another. A hatched area lies beyond the end of the domain.

    Parameters
    ----------
    law : Superpotential
        With resolved parameters.
    point : int
        Contact point for which the law is drawn.
    reach : float, optional
        Half width of the picture; 1.6 times the largest knot by default.
    title : str, optional
    unit, stress_unit : str
        Units of length and stress for the labels.

    Raises
    ------
    ProblemError
        If ``reach`` is not a positive number.
    """
    one = law.take(np.array([point]))
    description = one.describe()
    reach = _reach(description, reach)
    with drawing():
        fig = new_figure((6.3, 3.1), layout="constrained")
        graph, potential = fig.subplots(1, 2)
        draw_graph(graph, one, description, reach)
        for r in _pieces(description, reach):
            potential.plot(r, one.value(r), color=BLUE, lw=1.5)
        _finish(potential, reach, description.domain)
        graph.set_ylabel(with_unit(r"subdifferential $\partial j(r)$", stress_unit))
        potential.set_ylabel(with_unit(r"potential $j(r)$", f"{stress_unit} {unit}" if unit and stress_unit else ""))
        for panel in (graph, potential):
            panel.set_xlabel(with_unit("penetration or slip r", unit))
        alpha = "convex" if description.alpha == 0.0 else rf"$\alpha$ = {description.alpha:.4g}"
        fig.suptitle(title if title is not None else f"{description.name} law, {alpha}", fontsize=10.0)
    return fig


@expecting(laws=Mapping, columns=positive)
def plot_laws(
    laws: Mapping[str, Superpotential],
    *,
    columns: int = 4,
    labels: tuple[str, str] = ("penetration or slip (length)", "pressure or friction (force per area)"),
) -> Figure:
    """Graphs of the subdifferentials of several laws side by side, each under its name.

    Parameters
    ----------
    laws : mapping of name to Superpotential
        With resolved parameters; drawn for their first contact point.
    columns : int
        Graphs in a row.
    labels : two str
        What the axes of all graphs show, with their units.

    Raises
    ------
    ProblemError
        There is no law.
    """
    if not laws:
        raise ProblemError("there is no law to draw; give a mapping of names to laws")
    for name, one in laws.items():
        expect(one, Superpotential, f"law {quoted(name)}", "give a law with resolved parameters")
    rows = -(-len(laws) // whole_number(columns, "columns", 1))
    with drawing():
        fig = new_figure((1.9 * columns, 1.75 * rows), layout="constrained")
        panels = fig.subplots(rows, columns, squeeze=False).ravel()
        for panel, (name, law) in zip(panels, laws.items(), strict=False):
            one = law.take(np.array([0]))
            description = one.describe()
            draw_graph(panel, one, description, _reach(description, None))
            panel.set_title(name, fontsize=9.0)
            panel.set_xlabel("")
            panel.tick_params(labelsize=6.5)
        for panel in panels[len(laws) :]:
            panel.set_axis_off()
        fig.supxlabel(labels[0], fontsize=8.0)
        fig.supylabel(labels[1], fontsize=8.0)
    return fig


def _reach(description: LawDescription, reach: float | None) -> float:
    """Half width of a picture."""
    if reach is None:
        largest = max((abs(knot) for knot in description.knots), default=0.0)
        reach = 1.6 * largest if largest > 0.0 else 1.0
    _check_length(reach)
    return reach


def _check_length(reach: float) -> None:
    if not 0.0 < reach < math.inf:
        raise ProblemError(f"reach = {reach}; it must be a positive length")


def _pieces(description: LawDescription, reach: float) -> Iterator[Array]:
    """Places on each piece of a law."""
    low, high = max(-reach, description.domain[0]), min(reach, description.domain[1])
    for start, end in itertools.pairwise([low, *[knot for knot in description.knots if low < knot < high], high]):
        yield _inside(start, end)


def draw_graph(panel: Axes, law: Superpotential, description: LawDescription, reach: float) -> None:
    """The subdifferential of a law, of one point, up to a half width."""
    low, high = max(-reach, description.domain[0]), min(reach, description.domain[1])
    highest = 0.0
    for r in _pieces(description, reach):
        slope = law.derivative(r)
        most = int(0.9 * len(r))
        if len(r) > 1 and abs(slope[-1]) > _POLE * abs(slope[most]):  # as a joint that closes: most of it is drawn
            r, slope = r[:most], slope[:most]
        highest = max(highest, float(np.abs(slope).max()))
        panel.plot(r, slope, color=BLUE, lw=1.5)
    ends = (abs(s) for kink in description.kinks for s in (kink.left, kink.right) if math.isfinite(s))
    highest = highest or max(ends, default=0.0) or 1.0  # a rigid foundation has no size of its own
    for kink in description.kinks:
        if not low <= kink.place <= high:
            continue
        bottom, top = sorted((kink.left, kink.right))
        if bottom > 1.5 * highest:
            continue
        bottom, top = max(bottom, -1.5 * highest), min(top, 1.5 * highest)
        falls = kink.jump < 0.0
        panel.plot(
            [kink.place, kink.place], [bottom, top],
            color=RED if falls else BLUE, ls=(0, (3, 1.5)) if falls else "-", lw=1.5,
        )  # fmt: skip
    _finish(panel, reach, description.domain)


def _inside(start: float, end: float) -> Array:
    """Places of a piece, its ends excluded by a hair, so that one-sided values are drawn."""
    width = end - start
    if width <= 0.0:
        return np.zeros(0) if width < 0.0 else np.array([start])
    return np.linspace(start + 1e-9 * width, end - 1e-9 * width, 200)


def _finish(panel: Axes, reach: float, domain: tuple[float, float]) -> None:
    panel.set_xlim(-reach, reach)
    panel.axhline(0.0, color="#b0b0b0", lw=0.6, zorder=0)
    panel.axvline(0.0, color="#b0b0b0", lw=0.6, zorder=0)
    for side, end in ((-1.0, domain[0]), (1.0, domain[1])):
        if abs(end) < reach:
            a, b = sorted((end, side * reach))
            panel.axvspan(a, b, facecolor="none", edgecolor=GREY, hatch="////", alpha=0.4, lw=0.0)
    panel.set_xlabel("penetration or slip r")


def law_captions(problem: DiscreteProblem) -> list[str]:
    """Names and constants of the laws, for legends."""
    if problem.contact_points == 0:
        return []
    law = problem.law
    if not isinstance(law, ContactLaw):
        return [_proper(law.name)]
    several = [part for part, _ in law.normal.parts] if isinstance(law.normal, PiecewiseLaw) else []
    parts = [part for part in several or [law.normal] if not isinstance(part, NoContact)]
    lines = [f"{_proper(part.name)} law{_constants(part)}" for part in parts]
    if law.state_dependent:
        lines.append(_state_dependent(law.friction))
        return lines
    bound = np.asarray(law.friction.at(None).bound)
    if problem.contact.components > 1 and (bound > 0.0).any():
        name = _proper(law.friction.name).removesuffix("friction").strip()
        lines.append(f"{name} friction: $h_\\tau$ = {_range(bound)}".strip())
    return lines


def _state_dependent(friction: Friction) -> str:
    """Friction whose bound depends on pressure or penetration: Coulomb's by its coefficient."""
    bound, profile = friction.bound, "" if friction.name == "tresca" else f"{friction.name}, "
    if isinstance(bound, CoulombBound):
        name = f"Coulomb friction: {profile}"
        return f"{name}$\\mu$ = {_range(np.asarray(bound.coefficient))}"
    named = {"on penetration": PenetrationBound, "on the state": StateBound}
    what = next(text for text, kind in named.items() if isinstance(bound, kind))
    return f"friction: {profile}$h_\\tau$ depends {what}"


def _constants(law: Superpotential) -> str:
    """``: name = value, ...`` for the numbers that a law states of itself; nothing for tables and laws of laws."""
    if not is_dataclass(law) or type(law) is PiecewiseQuadratic:
        return ""
    house = type(law).__module__.startswith("hemivar.")
    values = [(f.name, getattr(law, f.name)) for f in fields(law) if (f.metadata or not house) and f.name[0] != "_"]
    numbers = [(name, np.asarray(value)) for name, value in values if isinstance(value, int | float | np.ndarray)]
    parts = [f"{_symbol(name)} = {_range(value)}" for name, value in numbers if value.size]
    return ":\n" + ", ".join(parts) if parts else ""


def _proper(name: str) -> str:
    """Laws named after people in capitals."""
    return name.capitalize() if name in ("signorini", "tresca", "coulomb") else name


def _symbol(name: str) -> str:
    """``q_max`` as a symbol with an index."""
    letter, _, index = name.partition("_")
    return f"${letter}_{{{index}}}$" if index and len(letter) == 1 else name


def _range(values: Array) -> str:
    low, high = float(np.min(values)), float(np.max(values))
    return f"{low:g}" if low == high else f"{low:g} to {high:g}"


def plot_mixed_mode(law: MixedMode, *, point: int = 0, reach: float | None = None, title: str | None = None) -> Figure:
    """Normal traction over the opening, shear over the slip, and where the glue begins to soften and lets go.

    For one contact point, up to an effective opening ``reach``: 1.25 times where it lets go by default.
    """
    one = law.take(np.array([point]))
    last, peak = one.opening_at_break.item(), one.opening_at_peak.item()
    beta = float(one.beta[0])
    far = 1.25 * last if reach is None else reach
    _check_length(far)
    rho = np.unique(np.concatenate([np.linspace(0.0, far, 400), one.curve_knots[one.curve_knots <= far]]))
    with drawing():
        fig = new_figure((8.4, 3.1), layout="constrained")
        opening, slipping, envelope = fig.subplots(1, 3)
        for part, style in zip((0.0, 0.4, 0.8), ("-", "--", ":"), strict=True):
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
        _finish_tractions(opening, slipping, envelope)
        label = f"$G_c$ = {one.fracture_energy.item():.4g}, shear over normal strength {beta:g}"
        fig.suptitle(f"{title}\n{label}" if title else label, fontsize=9)
    return fig


def _finish_tractions(*panels: Axes) -> None:
    for panel in panels:
        panel.axhline(0.0, color=GREY, lw=0.6, zorder=0)
        panel.legend(fontsize=7)


def plot_mode_dependent(
    law: ModeDependentGlue, *, point: int = 0, reach: float | None = None, title: str | None = None
) -> Figure:
    """Tractions of both pure modes and an even one over the effective opening, and the energy over the mode.

    For one contact point, up to an effective opening ``reach``: a little beyond the break by default.
    """
    one, modes = law.take(np.array([point])), np.linspace(0.0, 1.0, 201)
    ends = [one.at_mode(mode).opening_at_break.item() for mode in modes.tolist()]
    far = 1.1 * max(ends) if reach is None else reach
    _check_length(far)
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
        _finish_tractions(traction, break_)
        if title:
            fig.suptitle(title, fontsize=9)
    return fig


def plot_coupled_law(law: OwnCoupledLaw, *, reach: float | None = None, title: str | None = None) -> Figure:
    """Normal traction over the opening, shear over the slip, and contours of the potential.

    Up to an opening and slip ``reach``: by default where the tractions have fallen to a fiftieth.
    """
    far = _seen_reach(law) if reach is None else reach
    _check_length(far)
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
        _finish_tractions(normal, shear)
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
