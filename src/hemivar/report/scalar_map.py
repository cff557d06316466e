"""Maps of scalar problems: the unknown over its mesh, where foundations act, and what they do there."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from hemivar.basics.types import Array
from hemivar.errors import ProblemError
from hemivar.fem.area_average import area_average, over_area
from hemivar.files.boundary import polylines
from hemivar.mechanics.foundation import Side
from hemivar.mesh.mesh import Mesh
from hemivar.report.certificate_line import FOOT, write_below, write_foot
from hemivar.report.drawn_body import DrawnSurface, flat_axes, flat_map, mark_states
from hemivar.report.law_figures import law_captions
from hemivar.report.picture import new_figure
from hemivar.report.style import MANY_CELLS, body_axes, legend_beside, state_mark, with_unit
from hemivar.solvers import Solution

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["area_maps", "plot_scalar"]


def plot_scalar(
    solution: Solution,
    ax: Axes | None,
    title: str | None,
    note: str,
    unit: str,
    stress_unit: str,
    line: str,
    legend: bool,
) -> Figure:
    """The unknown in colours with its contour lines, and where foundations act.

    Over an area the part in contact is hatched; on boundaries contact points are marked by state.  In space the surface
    is coloured.
    """
    problem = solution.problem
    stated, field = problem.origin, problem.field
    assert field is not None
    mesh, contact = field.mesh, problem.contact
    if mesh.dim == 3:
        return _surface(solution, mesh, field.name if stated is None else stated.unknown, title, unit, line)
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch
    from matplotlib.tri import Triangulation

    fig, ax = body_axes(ax, mesh.points, title, unit, head=1.3, foot=FOOT if line else 0.0)
    values = solution.displacement[: mesh.number_of_nodes, 0]
    grid = Triangulation(mesh.points[:, 0], mesh.points[:, 1], mesh.cells)
    colours = ax.tripcolor(
        grid, values, shading="gouraud", cmap="cividis", rasterized=mesh.number_of_cells > MANY_CELLS
    )
    bar = fig.colorbar(colours, ax=ax, location="bottom", shrink=0.8, pad=0.13, aspect=35)
    named = {"membrane": "deflection u", "antiplane": "displacement u across the plane", "heat": "temperature u"}
    name = field.name if stated is None else named[str(stated.kind)]
    bar.set_label(with_unit(name, "" if stated is not None and stated.thermal else unit))
    if np.ptp(values) > 1e-12 * np.abs(values).max(initial=0.0):
        ax.tricontour(grid, values, 10, colors="white", linewidths=0.5, alpha=0.8, linestyles="solid")
    for edge in polylines(mesh.boundary_facets):
        ax.plot(*mesh.points[edge].T, color="black", lw=0.9, zorder=3)
    handles: list[Artist] = []
    over = over_area(problem)
    touching = over & solution.states.closed
    if touching.any():
        inside = np.zeros(mesh.number_of_nodes)
        nodes = contact.node[touching]
        inside[nodes[nodes < mesh.number_of_nodes]] = 1.0
        ax.tricontourf(grid, inside, [0.5, 1.5], colors="none", hatches=["////"], zorder=4)
        ax.tricontour(grid, inside, [0.5], colors="black", linewidths=0.9, zorder=4)
    if over.any():
        share = float(contact.weights[touching].sum() / contact.weights[over].sum())
        handles.append(
            Patch(facecolor="#d8d8d8", edgecolor="black", hatch="//////", linewidth=0.6,
                  label=f"in contact: {100.0 * share:.3g} % of the area")
        )  # fmt: skip
    beside = np.flatnonzero(~over)
    if len(beside):
        assert contact.points is not None
        for kind, here in solution.states.take(beside).present.items():
            mark_states(ax, kind, contact.points[beside[here]], len(beside))
            handles.append(state_mark(kind, f"{kind.label} ({np.count_nonzero(here)})"))
    if legend:
        sides = set() if stated is None else {one.side for one in stated.contact.values() if not one.rubs}
        lines = [note] if note else []
        lines += law_captions(problem)
        lines += ["foundation below"] if sides == {Side.BELOW} else []
        handles += [Line2D([], [], ls="", label=text) for text in lines]
        legend_beside(ax, handles=handles, handlelength=1.6, handleheight=1.2, labelspacing=0.7)
    if line:
        write_below(bar.ax, line)
    return fig


def _surface(solution: Solution, mesh: Mesh, name: str, title: str | None, unit: str, line: str) -> Figure:
    fig = new_figure((6.3, 5.0))
    extent = mesh.points.min(axis=0), mesh.points.max(axis=0)
    drawn = DrawnSurface(fig, (0.02, 0.06, 0.74, 0.82), mesh.boundary_facets, extent, unit, zoom=1.0)
    drawn.move(mesh.points, solution.displacement[: mesh.number_of_nodes, 0])
    fig.colorbar(drawn.surface, cax=fig.add_axes((0.84, 0.22, 0.022, 0.5))).set_label(name)
    if title:
        drawn.ax.set_title(title)
    if line:
        write_foot(fig, line)
    return fig


def area_maps(solution: Solution, title: str | None, unit: str, stress_unit: str, line: str) -> Figure:
    """Force per area of the foundation, averaged over cells, and the penetration, over an area of contact.

    Not in cells that supports touch.
    """
    from matplotlib.ticker import MaxNLocator

    problem, stated = solution.problem, solution.problem.origin
    assert stated is not None
    mesh, contact = stated.mesh, problem.contact
    if mesh.dim == 3:
        raise ProblemError("contact over a volume is not drawn as a flat map; write it with write_vtu")
    over = np.flatnonzero(over_area(problem))
    rubs = any(not stated.kind or stated.contact[name].rubs for name in stated.areas)
    if stated.kind:  # each point has one of the two
        acts, r = area_average(problem, solution.pressure + solution.friction.sum(axis=1)), solution.local.sum(axis=1)
    else:
        vectors = area_average(problem, solution.friction), solution.slip
        acts, r = (np.linalg.norm(values, axis=1) for values in vectors)
    acts, r = acts[over], r[over]
    supported = np.ones(mesh.number_of_nodes, dtype=bool)
    supported[contact.node[over]] = False
    cells = mesh.cells[(~supported[mesh.cells]).all(axis=1)]
    outline = [mesh.points[edge] for edge in polylines(mesh.boundary_facets)]
    fig = new_figure((8.2, 4.4), layout="constrained")
    panels = fig.subplots(1, 2, sharey=True)
    for panel, values, name in (
        (panels[0], acts, with_unit("friction" if rubs else "force per area of the foundation", stress_unit)),
        (panels[1], r, with_unit("slip" if rubs else "penetration (negative: distance)", unit)),
    ):
        at: Array = np.zeros(mesh.number_of_nodes)
        at[contact.node[over]] = values
        flat_map(panel, mesh.points, cells, at, name, location="bottom", shrink=0.85, aspect=30, ticks=MaxNLocator(5))
        panel.locator_params(nbins=5)
        flat_axes(panel, outline, with_unit("x", unit), with_unit("y", unit) if panel is panels[0] else "")
    if title:
        fig.suptitle(title, fontsize=10)
    write_foot(fig, line)
    return fig
