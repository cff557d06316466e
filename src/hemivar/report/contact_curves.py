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
from hemivar.report.certificate_line import FOOT, certificate_line, title_of, with_notes, write_foot
from hemivar.report.contact_maps import contact_maps
from hemivar.report.picture import new_figure
from hemivar.report.scalar_map import area_maps, over_area
from hemivar.report.style import BLUE, GREEN, MARKERS, PURPLE, RED, STYLE, drawing, in_rows, state_mark, with_unit
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
    """Pressure, friction (with its bound), penetration and slip along the contact boundary, each in a panel.

    Slip is left out where the body is away from its foundation.  Several contact boundaries have a column each; the
    coordinate is x or y along straight boundaries parallel to an axis, the arc length otherwise, and the number of the
    contact point for problems made of arrays. Marks tell the contact state. In 3D each boundary is projected along its
    mean normal: colours show the pressure, the magnitude of the friction and the penetration; the fourth panel shows
    the states, with arrows for the slip in the tangent plane. Of a contact over an area, force and penetration are
    drawn as maps.

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
    line, title = certificate_line(solution, certificate), title_of(solution, title)
    with drawing():
        contact = problem.contact
        if over_area(solution).any():
            return area_maps(solution, title, unit, stress_unit, line)
        if problem.origin and problem.origin.kind and problem.origin.mesh.dim == 3:
            raise ProblemError("contact of one component in space is not drawn along a line; write it with write_vtu")
        if contact.components == 3 and problem.field is not None and contact_boundaries(problem):
            return contact_maps(solution, title, unit, stress_unit, line)
        return _contact_lines(solution, title, unit, stress_unit, line)


def _contact_lines(solution: Solution, title: str | None, unit: str, stress_unit: str, line: str) -> Figure:
    from matplotlib.lines import Line2D

    problem = solution.problem
    try:
        boundaries = contact_boundaries(problem)
    except ProblemError:
        boundaries = []
    if boundaries:
        assert problem.contact.points is not None
        parts = [(b.name, b.index, *b.position(problem.contact.points)) for b in boundaries]
    else:
        everything = np.arange(problem.contact_points)
        parts = [("", everything, everything.astype(float), "contact point")]
    local, states = solution.local, solution.states
    slips = local[:, 1:].copy()
    slips[~states.closed] = np.nan  # where a body is away from its foundation nothing slips
    quantities: list[tuple[str, Array, str]] = [
        ("pressure", solution.pressure[:, None], RED),
        ("friction on the body", solution.friction, GREEN),
        ("opening", 0.0 - local[:, :1], BLUE) if solution.debonding else ("penetration", local[:, :1], BLUE),
        ("slip", slips, PURPLE),
    ]
    if not solution.friction.any():  # no friction: what slips freely is left out, too
        quantities = quantities[::2]
    beside = len(parts) == 1 and len(quantities) == 4
    high = 1.0 + (1.05 if beside else 1.5) * len(quantities)
    fig = new_figure((max(6.3, 3.4 * len(parts)), high), layout="constrained")
    shape = (2, 2) if beside else (len(quantities), len(parts))
    panels = fig.subplots(*shape, sharex="col", squeeze=False)
    panels = panels.reshape(4, 1) if beside else panels
    bound = _rest_bound(problem)
    for column, (name, index, where, label) in enumerate(parts):
        order = np.argsort(where, kind="stable")
        index, where = index[order], where[order]
        size = float(np.clip(30.0 / math.sqrt(len(index)), 1.2, 4.0))
        for row, (quantity, values, colour) in enumerate(quantities):
            panel = panels[row, column]
            panel.axhline(0.0, color="#b0b0b0", lw=0.6, zorder=0)
            for k in range(values.shape[1]):
                which = quantity if values.shape[1] == 1 else f"{quantity} {k + 1}"
                dash: LineStyleType = "-" if k == 0 else (0, (5, 1.5))
                _curve(panel, where, values[index, k], states.take(index), size, colour, dash, which)
            if quantity.startswith("friction") and bound is not None and np.isfinite(bound[index]).all():
                for sign in (1.0, -1.0):
                    panel.plot(where, sign * bound[index], color=colour, lw=0.8, ls=":", zorder=1)
            if column == 0:
                panel.set_ylabel(with_unit(quantity, stress_unit if row < len(quantities) // 2 else unit))
            if row == len(quantities) - 1 or (beside and row == 2):
                panel.set_xlabel(with_unit(label, unit if label != "contact point" else ""))
            panel.spines[["top", "right"]].set_visible(False)
            panel.margins(x=0.02)
            panel.ticklabel_format(axis="y", scilimits=(-3, 4), useMathText=True)
        if len(parts) > 1:
            panels[0, column].set_title(name)
    handles = [state_mark(kind, kind.label) for kind in states.present]
    if bound is not None:
        handles.insert(0, Line2D([], [], color=GREEN, ls=":", lw=0.8, label=r"friction bound $\pm h_\tau$"))
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


def _rest_bound(problem: DiscreteProblem) -> Array | None:
    """Largest friction without slip at each contact point, (m,); None without friction."""
    law = problem.law
    if problem.contact.components == 1 or law.state_dependent or not isinstance(law, ContactLaw):
        return None
    rest = law.tangential.subdifferential(np.zeros(problem.contact_points)).upper
    bound = np.broadcast_to(rest, (problem.contact_points,))
    return bound if (bound > 0.0).any() else None
