"""Tractions, gaps and slips along the contact boundary: curves in the plane, flat maps of boundaries in space."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from hemivar.basics.arguments import expecting
from hemivar.basics.types import Array, IntArray
from hemivar.certificates import Certificate
from hemivar.discrete.problem import DiscreteProblem
from hemivar.errors import ProblemError
from hemivar.fem.area_average import over_area
from hemivar.files.boundary import ContactBoundary, contact_boundaries
from hemivar.laws import ContactLaw
from hemivar.report.certificate_line import FOOT, certificate_line, title_of, with_notes, write_foot
from hemivar.report.deformed import state_label
from hemivar.report.drawn_body import flat_axes, flat_map
from hemivar.report.picture import BELOW, new_figure
from hemivar.report.scalar_map import area_maps
from hemivar.report.style import (
    BLUE,
    GREEN,
    GREY,
    MARKERS,
    ORANGE,
    PURPLE,
    RED,
    STATE_COLOURS,
    STYLE,
    drawing,
    in_rows,
    state_mark,
    with_unit,
)
from hemivar.report.summary import seen_local
from hemivar.solvers import Solution, TangentialState
from hemivar.solvers.contact_states import ContactStates

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.typing import LineStyleType

__all__ = ["contact_maps", "plot_contact"]


@expecting(solution=Solution, title=str, unit=str, stress_unit=str, certificate=Certificate)
def plot_contact(
    solution: Solution,
    *,
    title: str | None = None,
    unit: str = "",
    stress_unit: str = "",
    certificate: Certificate | None = None,
) -> Figure:
    """Pressure, friction (with its bound), penetration and slip along the contact boundary, each in a panel.

    Of glue its damage is drawn as well.

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
        if over_area(problem).any():
            return area_maps(solution, title, unit, stress_unit, line)
        if problem.origin and problem.origin.kind and problem.origin.mesh.dim == 3:
            raise ProblemError("contact of one component in 3D is not drawn along a line; write it with write_vtu")
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
        parts = [(b.title, b.index, *b.position(problem.contact.points)) for b in boundaries]
    else:
        everything = np.arange(problem.contact_points)
        parts = [("", everything, everything.astype(float), "contact point")]
    local, states = seen_local(solution), solution.states
    slips = local[:, 1:].copy()
    slips[~states.closed] = np.nan  # where a body is away from its foundation nothing slips
    depth = ("opening", 0.0 - local[:, :1]) if solution.debonding else ("penetration", local[:, :1])
    quantities: list[tuple[str, Array, str, str]] = [
        ("pressure", solution.pressure[:, None], RED, stress_unit),
        (f"{_shear(problem)} on the body", solution.friction, GREEN, stress_unit),
        (*depth, BLUE, unit),
        ("slip", slips, PURPLE, unit),
    ]
    if not solution.friction.any():  # no friction: what slips freely is left out, too
        quantities = quantities[::2]
    if solution.debonding:
        quantities.append(("damage", solution.debonding["damage"][:, None], ORANGE, ""))
    count = len(quantities)
    beside = len(parts) == 1 and count > 3
    high = 1.0 + (2.1 * math.ceil(count / 2) if beside else 1.5 * count)
    fig = new_figure((max(6.3, 3.4 * len(parts)), high), layout="constrained")
    shape = (math.ceil(count / 2), 2) if beside else (count, len(parts))
    panels = fig.subplots(*shape, sharex="col", squeeze=False)
    if beside:
        panels = panels.reshape(-1, 1)
        for empty in panels[count:, 0]:
            empty.remove()
    bound = _rest_bound(problem)
    for column, (name, index, where, label) in enumerate(parts):
        order = np.argsort(where, kind="stable")
        index, where = index[order], where[order]
        size = float(np.clip(30.0 / math.sqrt(len(index)), 1.2, 4.0))
        for row, (quantity, values, colour, of) in enumerate(quantities):
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
                panel.set_ylabel(with_unit(quantity, of))
            if row == count - 1 or (beside and row == count - 2):
                panel.tick_params(labelbottom=True)
                panel.set_xlabel(with_unit(label, unit if label != "contact point" else ""))
            panel.margins(x=0.02)
            panel.ticklabel_format(axis="y", scilimits=(-3, 4), useMathText=True)
        if len(parts) > 1:
            panels[0, column].set_title(name)
    handles = [state_mark(kind, state_label(solution, kind, here)) for kind, here in states.present.items()]
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


def _shear(problem: DiscreteProblem) -> str:
    """What the traction along the foundation is called: that of a coupled law is not all friction."""
    return "friction" if isinstance(problem.law, ContactLaw) else "shear"


def _rest_bound(problem: DiscreteProblem) -> Array | None:
    """Largest friction without slip at each contact point, (m,); None without friction."""
    law = problem.law
    if problem.contact.components == 1 or law.state_dependent or not isinstance(law, ContactLaw):
        return None
    rest = law.tangential.subdifferential(np.zeros(problem.contact_points)).upper
    bound = np.broadcast_to(rest, (problem.contact_points,))
    return bound if (bound > 0.0).any() else None


def contact_maps(solution: Solution, title: str | None, unit: str, stress_unit: str, line: str) -> Figure:
    """Pressure, friction, penetration and states of each contact boundary, projected along its mean normal.

    Where only a small part of a boundary touches, that part is shown, with as much again around it.
    """

    boundaries = contact_boundaries(solution.problem)
    fig = new_figure((6.3, 5.6 * len(boundaries)), layout="constrained")
    subfigures = fig.subfigures(len(boundaries), 1, squeeze=False)[:, 0]
    for part, boundary in zip(subfigures, boundaries, strict=True):
        panels = part.subplots(2, 2)
        name = boundary.title + _maps(solution, boundary, panels, unit, stress_unit)
        heading = [text for text in (title if part is subfigures[0] else "", name) if text]
        part.suptitle(": ".join(heading), fontsize=10)
    write_foot(fig, line)
    return fig


def _maps(
    solution: Solution, boundary: ContactBoundary, panels: NDArray[np.object_], unit: str, stress_unit: str
) -> str:
    """Draw the four panels; returns a remark if they show a part of the boundary only."""
    assert solution.problem.contact.points is not None
    axes, labels = _projection(solution.problem, boundary)
    corners = boundary.corners
    flat = boundary.mesh.points @ axes.T
    outline = _outline(corners)
    window = _window(solution, boundary, solution.problem.contact.points[boundary.index] @ axes.T)
    if window is not None:
        corners = corners[((flat[corners] >= window[0]) & (flat[corners] <= window[1])).all(axis=2).any(axis=1)]
    shear = with_unit(f"{_shear(solution.problem)}, magnitude", stress_unit)
    quantities = [
        (panels[0, 0], solution.pressure, with_unit("pressure", stress_unit)),
        (panels[0, 1], np.linalg.norm(solution.friction, axis=1), shear),
        (panels[1, 0], *_depth(solution, unit)),
    ]
    corner_rows = np.searchsorted(boundary.used_nodes, corners)
    for panel, values, name in quantities:
        at_corners = boundary.at_nodes(values, np.nan)[corner_rows]
        known = np.isfinite(at_corners)
        seen = known.any(axis=1)
        mean = np.where(known, at_corners, 0.0)[seen].sum(axis=1) / known[seen].sum(axis=1)
        shown = np.where(known[seen], at_corners[seen], mean[:, None])  # clamped corners are as their facets
        apart = flat[corners[seen]].reshape(-1, 2)
        flat_map(panel, apart, np.arange(len(apart)).reshape(-1, 3), shown.ravel(), name, shrink=0.85)
    _state_map(solution, boundary, panels[1, 1], axes, unit, window)
    for panel in panels.ravel():
        flat_axes(panel, flat[outline], *(with_unit(label, unit) for label in labels))
        if window is not None:
            panel.set(xlim=window[:, 0], ylim=window[:, 1])
    return "" if window is None else ", part that touches"


def _window(solution: Solution, boundary: ContactBoundary, places: Array) -> Array | None:
    """Corners (2, 2) of a square about the points that touch, or None if they take more than half of the width."""
    index = boundary.index
    touching = places[solution.states.closed[index] | (solution.pressure[index] != 0.0)]
    if len(touching) < 2:
        return None
    low, high = touching.min(axis=0), touching.max(axis=0)
    half = float((high - low).max())
    if half > 0.5 * float(np.ptp(places, axis=0).max()):
        return None
    middle = 0.5 * (low + high)
    return np.array([middle - half, middle + half])


def _state_map(
    solution: Solution, boundary: ContactBoundary, panel: Axes, axes: Array, unit: str, window: Array | None
) -> None:
    """States of the contact points, and the slip as arrows."""
    from matplotlib.lines import Line2D

    problem = solution.problem
    assert problem.contact.points is not None
    places = problem.contact.points[boundary.index] @ axes.T
    states = solution.states.take(boundary.index)
    seen = np.ones(len(places), dtype=bool) if window is None else ((places > window[0]) & (places < window[1])).all(1)
    size = float(np.clip(0.5 * 150.0 / math.sqrt(np.count_nonzero(seen)), 0.7, 7.0))
    extent = float(np.ptp(places if window is None else window, axis=0).max())
    handles = []
    for kind, here in states.present.items():
        everywhere = np.isin(np.arange(problem.contact_points), boundary.index[here])
        label = f"{state_label(solution, kind, everywhere)} ({np.count_nonzero(here)})"
        colour = STATE_COLOURS[kind]
        panel.plot(*places[here].T, "s", color=colour, mec=GREY, mew=0.3, ms=size, zorder=1)
        handles.append(Line2D([], [], marker="s", ls="", color=colour, mec=GREY, mew=0.3, ms=5.0, label=label))
    slip = solution.slip_vectors[boundary.index] @ axes.T
    length = np.linalg.norm(slip, axis=1)
    sliding = _thinned(places, np.flatnonzero(states.tangential == TangentialState.SLIP), extent)
    if len(sliding) and (largest := float(length[sliding].max())) > 0.0:
        panel.quiver(
            *places[sliding].T, *slip[sliding].T, angles="xy", scale_units="xy", scale=largest / (0.14 * extent),
            width=0.006, headwidth=3.6, headlength=4.6, headaxislength=4.2, color="black", zorder=4,
        )  # fmt: skip
        label = f"slip up to {largest:.3g} {unit}".rstrip()
        handles.append(Line2D([], [], color="black", marker=r"$\rightarrow$", ms=9, ls="", mew=0.1, label=label))
    # one column: two are wider than the panel, and push the scale of the panel above it aside
    panel.legend(handles=handles, loc="upper center", bbox_to_anchor=(0.5, 0.0), borderaxespad=BELOW, handlelength=1.0)


def _thinned(places: Array, chosen: IntArray, extent: float) -> IntArray:
    """At most one of the chosen places in each square of a grid over a width of ``extent``."""
    side = 14
    if len(chosen) <= side**2:
        return chosen
    low = places[chosen].min(axis=0)
    square = np.floor((places[chosen] - low) / extent * side).astype(np.int64)
    _, first = np.unique(square[:, 0] * (side + 2) + square[:, 1], return_index=True)
    return np.asarray(chosen[first])


def _depth(solution: Solution, unit: str) -> tuple[Array, str]:
    """Penetration with its label, or the opening of glue."""
    depth = seen_local(solution)[:, 0]
    return (0.0 - depth, with_unit("opening", unit)) if solution.debonding else (depth, with_unit("penetration", unit))


def _projection(problem: DiscreteProblem, boundary: ContactBoundary) -> tuple[Array, tuple[str, str]]:
    """Two unit vectors (2, 3) that span the plane across the mean normal, and their names."""
    assert problem.contact.frames is not None
    weights = problem.contact.weights[boundary.index]
    mean = weights @ problem.contact.frames[boundary.index, 0]
    if np.linalg.norm(mean) < 1e-6 * weights.sum():
        mean = np.array([0.0, 0.0, 1.0])  # a closed surface has no mean normal
    normal = np.abs(mean / np.linalg.norm(mean))
    main = int(np.argmax(normal))
    first, second = (axis for axis in range(3) if axis != main)
    if normal[main] > 1.0 - 1e-9:
        return np.eye(3)[[first, second]], ("xyz"[first], "xyz"[second])
    unit = mean / np.linalg.norm(mean)
    one = np.eye(3)[first] - unit[first] * unit
    one /= np.linalg.norm(one)
    other = np.cross(unit, one) * (1.0 if unit[main] > 0 else -1.0)
    return np.vstack([one, other]), (_direction(one), _direction(other))


def _direction(axis: Array) -> str:
    """A direction in space as the label of an axis: ``along (0.71, 0, -0.71)``."""
    return f"along ({', '.join(f'{0.0 if abs(part) < 5e-3 else part:.2g}' for part in axis)})"


def _outline(corners: IntArray) -> IntArray:
    """Edges of a surface that belong to one of its facets only, (k, 2)."""
    pairs = np.sort(np.vstack([corners[:, [0, 1]], corners[:, [1, 2]], corners[:, [0, 2]]]), axis=1)
    distinct, counts = np.unique(pairs, axis=0, return_counts=True)
    return np.asarray(distinct[counts == 1])
