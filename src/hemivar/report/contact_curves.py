"""Figures along the contact boundary: pressure, friction, penetration, slip and states."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from hemivar.basics.types import Array
from hemivar.certificates import Certificate
from hemivar.discrete.problem import DiscreteProblem
from hemivar.errors import ProblemError
from hemivar.files.boundary import contact_boundaries
from hemivar.laws import ContactLaw
from hemivar.mechanics.scalar import ScalarProblem
from hemivar.report.certificate_line import FOOT, certificate_line, with_notes, write_foot
from hemivar.report.contact_maps import contact_maps
from hemivar.report.deformed import round_number
from hemivar.report.picture import new_figure
from hemivar.report.scalar_map import area_maps, over_area
from hemivar.report.style import GREEN, MARKERS, RED, STYLE, drawing, in_rows, state_mark, with_unit
from hemivar.solvers import ContactStates, Solution

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.typing import LineStyleType

__all__ = ["plot_contact"]


def plot_contact(
    solution: Solution,
    *,
    title: str | None = None,
    unit: str = "",
    stress_unit: str = "",
    certificate: Certificate | None = None,
) -> Figure:
    """Pressure, friction (with its bound), penetration and slip along the contact boundary.

    One column of panels for each contact boundary; the coordinate is x or y along straight boundaries parallel to an
    axis, the arc length otherwise, and the number of the contact point for problems made of arrays. Marks tell the
    contact state. In 3D each boundary is projected along its mean normal: colours show the pressure, the magnitude of
    the friction and the penetration; the fourth panel shows the states, with arrows for the slip in the tangent plane.
    Of a contact over an area, force and penetration are drawn as maps.

    Parameters
    ----------
    solution : Solution
    title : str, optional
    unit, stress_unit : str
        Units of length and stress for the labels.
    certificate : Certificate, optional
        What is known about the solution, for the line below; without it the line has the residual only.

    Raises
    ------
    ProblemError
        The problem has no contact point.
    """
    problem = solution.problem
    if problem.contact_points == 0:
        raise ProblemError("the problem has no contact point; draw it with plot_solution")
    line = certificate_line(solution, certificate)
    with drawing():
        contact = problem.contact
        if over_area(solution).any():
            return area_maps(solution, title, unit, stress_unit, line)
        if isinstance(problem.origin, ScalarProblem) and problem.origin.mesh.dim == 3:
            raise ProblemError("contact of one component in space is not drawn along a line; write it with write_vtu")
        if contact.components == 3 and contact.points is not None and contact.frames is not None:
            return contact_maps(solution, title, unit, stress_unit, line)
        return _contact_lines(solution, title, unit, stress_unit, line)


def _contact_lines(solution: Solution, title: str | None, unit: str, stress_unit: str, line: str) -> Figure:
    from matplotlib.lines import Line2D

    problem = solution.problem
    try:
        boundaries = contact_boundaries(problem)
        assert problem.contact.points is not None
        parts = [(b.name, b.index, *b.position(problem.contact.points)) for b in boundaries]
    except ProblemError:
        everything = np.arange(problem.contact_points)
        parts = [("", everything, everything.astype(float), "contact point")]
    fig = new_figure((max(6.3, 3.4 * len(parts)), 5.0), layout="constrained")
    panels = fig.subplots(2, len(parts), sharex="col", squeeze=False)
    bound = _rest_bound(problem)
    local, states = solution.local, solution.states
    forces = np.column_stack([solution.pressure, solution.friction])
    factor = _slip_factor(local)
    drawn = local * np.array([1.0] + [factor] * (problem.contact.components - 1))
    for column, (name, index, where, label) in enumerate(parts):
        order = np.argsort(where, kind="stable")
        index, where = index[order], where[order]
        upper, lower = panels[:, column]
        size = float(np.clip(30.0 / math.sqrt(len(index)), 1.2, 4.0))
        curves = [(upper, forces, "pressure", "friction"), (lower, drawn, "penetration", "slip")]
        for panel, values, normal_name, tangential_name in curves:
            panel.axhline(0.0, color="#b0b0b0", lw=0.6, zorder=0)
            _curve(panel, where, values[index, 0], states.take(index), size, RED, "-", normal_name)
            for k in range(1, problem.contact.components):
                which = tangential_name if problem.contact.components == 2 else f"{tangential_name} {k}"
                _curve(panel, where, values[index, k], states.take(index), size, GREEN, (0, (5, 1.5)), which)
        if bound is not None and np.isfinite(bound[index]).all():
            for sign in (1.0, -1.0):
                upper.plot(where, sign * bound[index], color=GREEN, lw=0.8, ls=":", zorder=1)
        lower.set_xlabel(with_unit(label, unit if label != "contact point" else ""))
        if len(parts) > 1:
            upper.set_title(name)
        for panel in (upper, lower):
            panel.spines[["top", "right"]].set_visible(False)
            panel.margins(x=0.02)
    panels[0, 0].set_ylabel(with_unit("force per area", stress_unit))
    panels[1, 0].set_ylabel(with_unit("displacement", unit))
    handles = [
        Line2D([], [], color=RED, label="pressure; penetration"),
        Line2D(
            [],
            [],
            color=GREEN,
            ls=(0, (5, 1.5)),
            label="friction; slip" if factor == 1.0 else f"friction; slip times {factor:g}",
        ),
    ]
    if bound is not None:
        handles.append(Line2D([], [], color=GREEN, ls=":", lw=0.8, label=r"friction bound $\pm h_\tau$"))
    handles += [state_mark(kind, kind.label) for kind in states.present]
    above = 0.5 + (72.0 * FOOT / STYLE["legend.fontsize"] if with_notes() else 0.0)  # the line at the foot, in letters
    fig.legend(
        handles=handles, loc="outside lower center", borderaxespad=above, ncols=in_rows(len(handles)),
        columnspacing=1.4, handlelength=1.8,
    )  # fmt: skip
    if title:
        fig.suptitle(title, fontsize=10)
    write_foot(fig, line)
    return fig


def _curve(
    panel: Axes,
    where: Array,
    values: Array,
    states: ContactStates,
    size: float,
    colour: str,
    dash: LineStyleType,
    label: str,
) -> None:
    panel.plot(where, values, color=colour, ls=dash, lw=1.1, label=label, zorder=2)
    for kind, here in states.present.items():
        panel.plot(where[here], values[here], ls="", ms=size, mew=0.5, zorder=3, **MARKERS[kind])


def _slip_factor(local: Array) -> float:
    """A factor by which the slip is seen beside the penetration; 1 where it is seen as it is, or is rounding only."""
    across, along = np.abs(local[:, 0]).max(initial=0.0), np.abs(local[:, 1:]).max(initial=0.0)
    if not 1e-9 * across < along < 0.1 * across:
        return 1.0
    return round_number(float(0.5 * across / along))


def _rest_bound(problem: DiscreteProblem) -> Array | None:
    """Largest friction without slip at each contact point, (m,); None without friction."""
    law = problem.law
    if problem.contact.components == 1 or law.state_dependent or not isinstance(law, ContactLaw):
        return None
    rest = law.tangential.subdifferential(np.zeros(problem.contact_points)).upper
    bound = np.broadcast_to(rest, (problem.contact_points,))
    return bound if (bound > 0.0).any() else None
