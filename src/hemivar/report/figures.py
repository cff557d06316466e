"""Figures of solutions, at print size; matplotlib is imported when the first one is drawn."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import fields, is_dataclass
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from hemivar.basics.disk import make_folder, whole_file
from hemivar.basics.types import Array, IntArray
from hemivar.discrete.problem import DiscreteProblem
from hemivar.errors import ProblemError
from hemivar.fem import von_mises
from hemivar.files.boundary import ContactBoundary, contact_boundaries, global_vectors, polylines
from hemivar.laws import ContactLaw
from hemivar.mesh.mesh import Mesh
from hemivar.report._solid import contact_maps, draw_solid
from hemivar.report._style import BLUE, GREEN, GREY, MARKERS, ORANGE, PURPLE, RED, SKY, drawing, with_unit
from hemivar.solvers import Solution
from hemivar.workflows.survey_runs import observed_order

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = [
    "Arrows",
    "plot_contact",
    "plot_errors",
    "plot_history",
    "plot_solution",
    "save",
]

_MANY_CELLS = 5000
_MANY_POINTS = 70


class Arrows(StrEnum):
    """What the arrows at the contact nodes show."""

    FORCE = "force"
    """The force of the foundation on the body."""
    COMPONENTS = "components"
    """Pressure and friction apart."""
    NONE = "none"
    """No arrows."""


# ---- the deformed body ----------------------------------------------------------------------------------------


def plot_solution(
    solution: Solution,
    *,
    ax: Axes | None = None,
    scale: float | Literal["auto"] = 1.0,
    arrows: Arrows | Literal["force", "components", "none"] = Arrows.FORCE,
    title: str | None = None,
    note: str = "",
    unit: str = "",
    stress_unit: str = "",
    legend: bool = True,
) -> Figure:
    """The deformed body on its foundation, with contact states and contact forces.

    The deformed mesh (from 5000 cells on: the outline and the von Mises stress of the cells), the outline of the
    body at rest (dashed), the foundation (hatched) and the contact nodes by state. The forces of the foundation on
    the body are mirrored with respect to the contact boundary, as in the survey's Figures 1 to 4: they are drawn
    inside the foundation. A 3D body is drawn by its surface, coloured by the von Mises stress, without forces.

    Parameters
    ----------
    solution : Solution
        Of a problem with a mesh.
    ax : matplotlib Axes, optional
        Draw here rather than on a new figure.
    scale : float or "auto"
        Factor of the displacement; gaps are drawn with the same factor, so that contact looks closed.  ``"auto"``
        makes small displacements visible, unless the gap varies.
    arrows : Arrows
        ``"force"`` (default), ``"components"`` (pressure and friction apart) or ``"none"``.
    title : str, optional
        Title above the figure.
    note : str
        Data of the problem in words, added to the legend; the constants of the laws are there anyway.
    unit, stress_unit : str
        Units of length and stress for the labels.
    legend : bool
        Write the legend, the data and the scale of the arrows to the right of the axes.

    Raises
    ------
    ProblemError
        The problem was made of arrays and has no mesh; or ``scale`` is not a positive number.
    """
    problem = solution.problem
    if problem.field is None:
        raise ProblemError("this problem was made of arrays and has no mesh to draw; use plot_contact or plot_history")
    arrows = _member(Arrows, arrows, "arrows")
    mesh = problem.field.mesh
    displacement = solution.displacement[: mesh.number_of_nodes]
    factor = magnification(scale, mesh, displacement, solution.problem.gap)
    with drawing():
        if mesh.dim == 3:
            return draw_solid(solution, mesh.points + factor * displacement, factor, title, unit, stress_unit)
        width, height = np.ptp(mesh.points, axis=0)
        fig, ax = _axes(ax, (6.3, 0.9 + float(np.clip(3.5 * (height / width + 0.25), 2.3, 5.0))))
        shown = _Plane(solution, mesh, displacement, factor, stress_unit)
        shown.draw(ax, arrows, note, legend)
        ax.set_xlabel(with_unit("x", unit))
        ax.set_ylabel(with_unit("y", unit))
        if title:
            ax.set_title(title)
    return fig


class _Plane:
    """Everything that is drawn of one plane solution."""

    def __init__(self, solution: Solution, mesh: Mesh, displacement: Array, factor: float, stress_unit: str) -> None:
        self.solution = solution
        self.problem: DiscreteProblem = solution.problem
        self.mesh = mesh
        self.factor = factor
        self.stress_unit = stress_unit
        self.moved = mesh.points + factor * displacement
        self.boundaries = contact_boundaries(self.problem)
        self.size = float(np.linalg.norm(np.ptp(mesh.points, axis=0)))
        self.handles: list[Any] = []
        self.keys: list[tuple[Any, str, float, float]] = []

    def draw(self, ax: Axes, arrows: Arrows, note: str, legend: bool) -> None:
        from matplotlib.lines import Line2D

        self._body(ax)
        outline = polylines(self.mesh.boundary_facets)
        dashes = (0, (4, 3))
        for line in outline:
            ax.plot(*self.mesh.points[line].T, color=GREY, lw=0.8, ls=dashes, zorder=2.5)
        self.handles.append(Line2D([], [], color=GREY, lw=0.8, ls=dashes, label="body at rest"))
        ax.set_aspect("equal")
        if self.boundaries:
            longest = self._forces(ax, arrows) if arrows is not Arrows.NONE else 0.0
            for boundary in self.boundaries:
                self._foundation(ax, boundary, longest)
            self._states(ax)
        ax.spines[["top", "right"]].set_visible(False)
        if legend:
            self._legend(ax, note)

    def _body(self, ax: Axes) -> None:
        from matplotlib.collections import LineCollection
        from matplotlib.lines import Line2D
        from matplotlib.tri import Triangulation

        magnified = "" if self.factor == 1.0 else f", displacement times {self.factor:g}"
        self.handles.append(Line2D([], [], color="black", lw=0.9, label=f"deformed body{magnified}"))
        if self.mesh.number_of_cells <= _MANY_CELLS:
            for line in polylines(self.mesh.boundary_facets):
                ax.fill(*self.moved[line].T, color="#d9e6f2", alpha=0.45, lw=0.0, zorder=1.5)
            width = float(np.clip(12.0 / math.sqrt(self.mesh.number_of_cells), 0.25, 0.6))
            ax.add_collection(
                LineCollection(list(self.moved[self.mesh.edges]), colors="#8f8f8f", linewidths=width, zorder=2)
            )
        elif self.problem.field is not None and self.problem.field.material is not None:
            stress = von_mises(self.problem.field, self.solution.displacement)
            colours = ax.tripcolor(
                Triangulation(self.moved[:, 0], self.moved[:, 1], self.mesh.cells), facecolors=stress, cmap="cividis",
                vmax=float(np.quantile(stress, 0.999)), zorder=2, rasterized=True,
            )  # fmt: skip
            bar = ax.figure.colorbar(colours, ax=ax, location="bottom", shrink=0.7, pad=0.16, aspect=35, extend="max")
            bar.set_label(with_unit("von Mises stress", self.stress_unit))
        for line in polylines(self.mesh.boundary_facets):
            ax.plot(*self.moved[line].T, color="black", lw=0.9, zorder=3)

    def _foundation(self, ax: Axes, boundary: ContactBoundary, reach: float) -> None:
        """The foundation down to a depth of ``reach`` and some more, hatched along its surface."""
        from matplotlib.patches import Polygon

        corners = boundary.corners
        normals, lengths = self.mesh.facet_normals(corners)
        used, place = np.unique(corners, return_inverse=True)
        summed = np.zeros((len(used), 2))
        np.add.at(summed, place.ravel(), np.repeat(normals * lengths[:, None], 2, axis=0))
        normal = np.full(self.moved.shape, np.nan)
        normal[used] = summed / np.linalg.norm(summed, axis=1)[:, None]
        nearest = _nearest(self.mesh.points[used], self.problem, boundary)
        if boundary.nodes is not None and self.problem.frames is not None:
            normal[used] = self.problem.frames[nearest, 0]  # that of an obstacle may differ from the body's
        gap = np.full(len(self.moved), np.nan)
        gap[used] = self.problem.gap[nearest]
        deepest = self.factor * float(self.solution.penetration[boundary.index].max(initial=0.0))
        for line in boundary.lines:
            surface = self.mesh.points[line] + self.factor * gap[line, None] * normal[line]
            if line[0] != line[-1]:
                surface[0] += 0.02 * self.size * _unit(surface[0] - surface[1])
                surface[-1] += 0.02 * self.size * _unit(surface[-1] - surface[-2])
            for depth, style in (
                (max(deepest, 0.0) + reach + 0.03 * self.size, {"facecolor": "#f0f0f0", "linewidth": 0.0}),
                (0.022 * self.size, {"facecolor": "none", "edgecolor": "#8a8a8a", "hatch": "//////", "linewidth": 0.0}),
            ):
                below = surface + depth * normal[line]
                ax.add_patch(Polygon(np.vstack([surface, below[::-1]]), closed=True, zorder=0.5, **style))
            ax.plot(*surface.T, color="#3a3a3a", lw=1.0, zorder=1)

    def _places(self) -> Array:
        """Deformed places of the contact points, (m, 2)."""
        assert self.problem.points is not None
        moved = self.problem.points.copy()
        for boundary in self.boundaries:
            if boundary.nodes is not None:
                moved[boundary.index] += self.factor * self.solution.displacement[boundary.nodes]
            else:
                assert boundary.facets is not None
                moved[boundary.index] = self.moved[boundary.corners[boundary.facets]].mean(axis=1)
        return moved

    def _states(self, ax: Axes) -> None:
        from matplotlib.lines import Line2D

        places, state = self._places(), self.solution.state
        size = float(np.clip(30.0 / math.sqrt(max(len(places), 1)), 1.4, 4.4))
        for kind, marker in MARKERS.items():
            here = state == kind
            if here.any():
                ax.plot(*places[here].T, ls="", ms=size, mew=0.6, zorder=6, clip_on=False, **marker)
            label = f"{kind.label} ({np.count_nonzero(here)})"
            self.handles.append(Line2D([], [], ls="", ms=4.4, mew=0.7, label=label, **marker))

    def _forces(self, ax: Axes, arrows: Arrows) -> float:
        """Mirrored forces: the part along the normal is turned round, so that arrows lie in the foundation.

        Returns the length of the longest arrow.
        """
        problem, multiplier = self.problem, self.solution.multiplier
        outward = global_vectors(problem, multiplier, tangential=False)
        along = -global_vectors(problem, multiplier, normal=False)
        places = self._places()
        step = max(1, len(places) // _MANY_POINTS)
        sets = (
            [("force", outward + along, RED)]
            if arrows is Arrows.FORCE
            else [("pressure", outward, RED), ("friction", along, GREEN)]
        )
        largest = max(float(np.linalg.norm(vectors, axis=1).max()) for _, vectors, _ in sets)
        if largest == 0.0:
            return 0.0
        reference = _round_number(largest)
        length = 0.16 * self.size
        for row, (name, vectors, colour) in enumerate(sets):
            quiver = ax.quiver(
                *places[::step].T, *vectors[::step].T, angles="xy", scale_units="xy", scale=largest / length,
                color=colour, width=0.0028, headwidth=3.6, headlength=4.6, headaxislength=4.2, zorder=5 + 0.1 * row,
            )  # fmt: skip
            quiver.set_in_layout(False)
            self.keys.append((quiver, f"{name} = {reference:g} (mirrored)", reference, reference * length / largest))
            ax.update_datalim(places[::step] + vectors[::step] * (length / largest))
        ax.autoscale_view()
        return length

    def _legend(self, ax: Axes, note: str) -> None:
        from matplotlib.patches import Patch

        if self.boundaries:
            self.handles.append(
                Patch(facecolor="#f0f0f0", edgecolor="#8a8a8a", hatch="//////", linewidth=0.0, label="foundation")
            )
        lines = [line for line in (note, *_law_text(self.problem)) if line]
        lines += [f"{self.problem.unknowns} unknowns", f"{self.solution.method}: {self.solution.status.value}"]
        fig = _figure_of(ax)
        box = ax.legend(
            handles=self.handles, loc="upper left", bbox_to_anchor=(1.02, 1.0), borderaxespad=0.0, handlelength=1.6
        )
        fig.draw_without_rendering()
        # Places in fractions of the figure survive the cropping of saved files; heights are meant in inches.
        fraction = fig.transFigure.inverted()
        width, height = fig.get_size_inches()
        frame = ax.get_window_extent().transformed(fraction)
        written = box.get_window_extent().transformed(fraction)
        left, bottom = written.x0 + 0.06 / width, written.y0 - 0.05 / height
        text = fig.text(left, bottom, "\n".join(lines), va="top", fontsize=8, linespacing=1.45)
        bottom = text.get_window_extent().transformed(fraction).y0 - 0.2 / height
        per_length = frame.width / float(np.ptp(ax.get_xlim()))
        for quiver, name, reference, length in self.keys:
            tip = left + length * per_length
            key = ax.quiverkey(quiver, tip, bottom, reference, "", labelpos="E", coordinates="figure")
            key.set_in_layout(False)
            fig.text(tip + 0.08 / width, bottom, name, va="center", fontsize=8)
            bottom -= 0.2 / height


def _unit(vector: Array) -> Array:
    return np.asarray(vector / np.linalg.norm(vector))


def _nearest(points: Array, problem: DiscreteProblem, boundary: ContactBoundary) -> IntArray:
    from scipy.spatial import KDTree

    assert problem.points is not None
    _, found = KDTree(problem.points[boundary.index]).query(points)
    return np.asarray(boundary.index[found])


def magnification(scale: float | str, mesh: Mesh, displacement: Array, gap: Array) -> float:
    """The factor of the displacement that ``scale`` asks for."""
    if scale == "auto":
        size = float(np.ptp(mesh.points, axis=0).max())
        if gap.size and np.ptp(gap) > 1e-6 * size:
            return 1.0  # blown up with the displacement, a gap around a curved body would bend its foundation
        largest = float(np.linalg.norm(displacement, axis=1).max(initial=float(np.abs(gap).max(initial=0.0))))
        wanted = 0.1 * size
        return _round_number(wanted / largest) if 0.0 < largest < wanted else 1.0
    if isinstance(scale, str) or not (math.isfinite(scale) and scale > 0.0):
        raise ProblemError(f"scale = {scale!r}; give a positive number or 'auto'")
    return float(scale)


def _round_number(value: float) -> float:
    """The largest of 1, 2, 5 times a power of ten that is at most ``value``."""
    power = 10.0 ** math.floor(math.log10(value))
    digit = max(d for d in (1, 2, 5) if d * power <= value * (1 + 1e-12))
    return float(f"{digit * power:.6g}")


# ---- along the contact boundary -------------------------------------------------------------------------------


def plot_contact(solution: Solution, *, title: str | None = None, unit: str = "", stress_unit: str = "") -> Figure:
    """Pressure, friction (with its bound), penetration and slip along the contact boundary.

    One column of panels for each contact boundary; the coordinate is x or y along straight boundaries parallel to an
    axis, the arc length otherwise, and the number of the contact point for problems made of arrays. Marks tell the
    contact state. In 3D each boundary is projected along its mean normal: colours show the pressure, the magnitude of
    the friction and the penetration; the fourth panel shows the states, with arrows for the slip in the tangent plane.

    Parameters
    ----------
    solution : Solution
    title : str, optional
    unit, stress_unit : str
        Units of length and stress for the labels.

    Raises
    ------
    ProblemError
        The problem has no contact point.
    """
    problem = solution.problem
    if problem.contact_points == 0:
        raise ProblemError("the problem has no contact point; draw it with plot_solution")
    with drawing():
        if problem.dim == 3 and problem.points is not None and problem.frames is not None:
            return contact_maps(solution, title, unit, stress_unit)
        return _contact_lines(solution, title, unit, stress_unit)


def _contact_lines(solution: Solution, title: str | None, unit: str, stress_unit: str) -> Figure:
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

    problem = solution.problem
    try:
        boundaries = contact_boundaries(problem)
        assert problem.points is not None
        parts = [(b.name, b.index, *b.position(problem.points)) for b in boundaries]
    except ProblemError:
        everything = np.arange(problem.contact_points)
        parts = [("", everything, everything.astype(float), "contact point")]
    fig = Figure(figsize=(max(6.3, 3.4 * len(parts)), 5.0), layout="constrained")
    panels = fig.subplots(2, len(parts), sharex="col", squeeze=False)
    bound = _rest_bound(problem)
    multiplier, local, state = solution.multiplier, solution.local, solution.state
    for column, (name, index, where, label) in enumerate(parts):
        order = np.argsort(where, kind="stable")
        index, where = index[order], where[order]
        upper, lower = panels[:, column]
        size = float(np.clip(30.0 / math.sqrt(len(index)), 1.2, 4.0))
        curves = [(upper, multiplier, "pressure", "friction"), (lower, local, "penetration", "slip")]
        for panel, values, normal_name, tangential_name in curves:
            panel.axhline(0.0, color="#b0b0b0", lw=0.6, zorder=0)
            _curve(panel, where, values[index, 0], state[index], size, RED, "-", normal_name)
            for k in range(1, problem.dim):
                which = tangential_name if problem.dim == 2 else f"{tangential_name} {k}"
                _curve(panel, where, values[index, k], state[index], size, GREEN, (0, (5, 1.5)), which)
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
        Line2D([], [], color=GREEN, ls=(0, (5, 1.5)), label="friction; slip"),
    ]
    if bound is not None:
        handles.append(Line2D([], [], color=GREEN, ls=":", lw=0.8, label=r"friction bound $\pm h_\tau$"))
    present = [kind for kind in MARKERS if (state == kind).any()]
    handles += [Line2D([], [], ls="", ms=4.4, mew=0.7, label=kind.label, **MARKERS[kind]) for kind in present]
    fig.legend(handles=handles, loc="outside lower center", ncols=len(handles), columnspacing=1.4, handlelength=1.8)
    if title:
        fig.suptitle(title, fontsize=10)
    return fig


def _curve(
    panel: Any, where: Array, values: Array, state: IntArray, size: float, colour: str, dash: Any, label: str
) -> None:
    panel.plot(where, values, color=colour, ls=dash, lw=1.1, label=label, zorder=2)
    for kind, marker in MARKERS.items():
        here = state == kind
        panel.plot(where[here], values[here], ls="", ms=size, mew=0.5, zorder=3, **marker)


def _rest_bound(problem: DiscreteProblem) -> Array | None:
    """Largest friction without slip at each contact point, (m,); None without friction."""
    if problem.dim == 1 or problem.law.state_dependent:
        return None
    rest = problem.law.tangential.subdifferential(np.zeros(problem.contact_points)).upper
    bound = np.broadcast_to(rest, (problem.contact_points,))
    return bound if (bound > 0.0).any() else None


# ---- errors and history ---------------------------------------------------------------------------------------


def plot_errors(
    sizes: Array,
    errors: Mapping[tuple[str, str], Array],
    *,
    ax: Axes | None = None,
    title: str | None = None,
    reference_size: float | None = None,
) -> Figure:
    """Errors against h on logarithmic scales, one curve for each pair of reference and method (survey, Figure 5).

    A second panel below shows by how much each curve is above the lowest of them.

    Parameters
    ----------
    sizes : array (k,)
        Mesh sizes h.
    errors : mapping of (reference, method) to array (k,)
        V-norm errors; entries that are nan are left out.
    ax : matplotlib Axes, optional
        Draw the errors here rather than on a new figure, and leave out the second panel.
    title : str, optional
    reference_size : float, optional
        h of the reference solutions. Errors at twice this size are too small, because the reference shares most of
        its error with them: they are shaded, and left out of the fitted orders.
    """
    from matplotlib.ticker import FuncFormatter, LogLocator

    sizes = np.asarray(sizes, dtype=float)
    references = list(dict.fromkeys(reference for reference, _ in errors))
    methods = list(dict.fromkeys(method for _, method in errors))
    colours = [BLUE, RED, GREEN, PURPLE, ORANGE, SKY]
    dashes = ["-", (0, (6, 2)), (0, (1.5, 1.5)), (0, (6, 2, 1.5, 2))]
    marks = ["o", "s", "^", "D", "v", "P"]
    trusted = np.ones(len(sizes), dtype=bool)
    if reference_size is not None:
        trusted = sizes > 2.0 * reference_size * (1 + 1e-9)
    with drawing():
        below = None
        if ax is None:
            fig, ax = _axes(ax, (6.3, 5.6))
            ax.set_position((0.1, 0.38, 0.54, 0.56))
            below = fig.add_axes((0.1, 0.09, 0.54, 0.22), sharex=ax)
        else:
            fig, ax = _axes(ax, (6.3, 4.6))
        least = np.nanmin(np.array([np.asarray(values, dtype=float) for values in errors.values()]), axis=0)
        for (reference, method), values in errors.items():
            r, m = references.index(reference), methods.index(method)
            values = np.where(np.asarray(values, dtype=float) > 0.0, values, np.nan)
            order = observed_order(sizes[trusted], values[trusted])
            style: dict[str, Any] = {
                "color": colours[m % len(colours)],
                "ls": dashes[r % len(dashes)],
                "lw": 1.1,
                "marker": marks[m % len(marks)],
                "markerfacecolor": colours[m % len(colours)] if r % 3 == 2 else "none",
                "ms": 8.0 - 2.2 * (r % 3),
                "mew": 0.9,
                "zorder": 3 - 0.1 * r,
            }
            ax.plot(sizes, values, label=f"{method} against {reference}: {order:.2f}", **style)
            if below is not None:
                below.plot(sizes, 100.0 * (values / least - 1.0), **style)
        ax.set_xscale("log", base=2)
        ax.set_yscale("log")
        ax.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        ax.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        ax.set_ylabel(r"$\| u - u^h \|_V$")
        lowest = below or ax
        lowest.set_xlabel("h")
        lowest.set_xticks(sizes, labels=[_fraction(h) for h in sizes])
        if below is not None:
            below.set_ylabel("above the\nleast (%)")
            ax.tick_params(labelbottom=False)
        for panel in (ax, below):
            if panel is None:
                continue
            panel.minorticks_off()
            panel.grid(True, which="major", color="#e2e2e2", lw=0.6)
            panel.set_axisbelow(True)
            if reference_size is not None and not trusted.all():
                panel.axvspan(0.1 * reference_size, 2.8 * reference_size, color="#f3ead7", lw=0, zorder=0)
        ax.set_xlim(sizes.min() / 1.5, sizes.max() * 1.3)
        _slope_triangle(ax, sizes, errors)
        ax.legend(
            loc="upper left", bbox_to_anchor=(1.02, 1.0), borderaxespad=0.0, title="method against reference: order",
            title_fontsize=8, alignment="left",
        )  # fmt: skip
        if title:
            ax.set_title(title)
    return fig


def _slope_triangle(ax: Axes, sizes: Array, errors: Mapping[tuple[str, str], Array]) -> None:
    """A triangle of slope 1 below the curves."""
    if len(sizes) < 3:
        return
    order = np.argsort(sizes)
    lowest = np.nanmin(np.array([np.asarray(v, dtype=float) for v in errors.values()]), axis=0)[order]
    left, right = sizes[order][1], sizes[order][2]
    base = 0.55 * lowest[1]
    if not np.isfinite(base):
        return
    ax.plot([left, right, right, left], [base, base, base * right / left, base], color="black", lw=0.8)
    ax.annotate("1", (math.sqrt(left * right), base), xytext=(0, -3), textcoords="offset points", va="top", ha="center")
    ax.annotate("1", (right, base * math.sqrt(right / left)), xytext=(4, 0), textcoords="offset points", va="center")


def plot_history(solutions: Solution | Sequence[Solution], *, title: str | None = None) -> Figure:
    """Residual and energy of each step, for one solution or several.

    The energy is shown above the lowest of the same problem. Steps whose difference is zero are not drawn.

    Parameters
    ----------
    solutions : Solution or sequence of Solution
    title : str, optional
    """
    from matplotlib.figure import Figure

    solutions = [solutions] if isinstance(solutions, Solution) else list(solutions)
    if not solutions:
        raise ProblemError("there is no solution to draw the history of")
    colours = [BLUE, RED, GREEN, PURPLE, ORANGE, SKY]
    with drawing():
        fig = Figure(figsize=(6.3, 3.2), layout="constrained")
        left, right = fig.subplots(1, 2, sharex=True)
        for number, solution in enumerate(solutions):
            lowest = min(min((line.energy for line in s.history), default=np.inf) for s in _same(solutions, solution))
            steps = np.array([line.step for line in solution.history])
            residual = np.array([line.residual for line in solution.history])
            above = np.array([line.energy for line in solution.history]) - lowest
            dash = "-" if number < 6 else (0, (4, 2))
            style = {"color": colours[number % 6], "marker": "os^Dv"[number % 5], "ms": 3.2, "lw": 1.0, "ls": dash}
            for panel, values in ((left, residual), (right, above)):
                shown = np.isfinite(values) & (values > 0.0)
                panel.plot(steps[shown], values[shown], label=solution.method, **style)
        for panel, name in ((left, "relative residual"), (right, "energy above the lowest")):
            panel.set_yscale("log")
            panel.set_xlabel("step")
            panel.set_ylabel(name)
            panel.spines[["top", "right"]].set_visible(False)
            panel.xaxis.get_major_locator().set_params(integer=True)
        fig.legend(*left.get_legend_handles_labels(), loc="outside lower center", ncols=min(len(solutions), 4))
        if title:
            fig.suptitle(title, fontsize=10)
    return fig


def _same(solutions: Sequence[Solution], one: Solution) -> list[Solution]:
    return [solution for solution in solutions if solution.problem is one.problem]


# ---- helpers ---------------------------------------------------------------------------------------------------


def save(fig: Figure, path: str | Path, *, dpi: int = 200) -> Path:
    """Write a figure as PNG, SVG or PDF, by the suffix of ``path``; returns the path.

    Parameters
    ----------
    fig : matplotlib Figure
    path : str or Path
    dpi : int
        Dots per inch, 10 to 2400.

    Raises
    ------
    ProblemError
        Another suffix, or a resolution out of range.
    FileError
        The file or its folder cannot be made.
    """
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix not in (".png", ".svg", ".pdf"):
        raise ProblemError(f"'{path}': figures are written as .png, .svg or .pdf, not '{path.suffix}'")
    if not 10 <= dpi <= 2400:
        raise ProblemError(f"dpi = {dpi}; give a resolution from 10 to 2400 dots per inch")
    make_folder(path.parent)
    metadata = {"pdf": {"CreationDate": None}, "svg": {"Date": None}}.get(suffix[1:])
    with drawing(), whole_file(path) as name:
        fig.savefig(name, dpi=dpi, metadata=metadata, bbox_inches="tight", pad_inches=0.05)
    return path


def _axes(ax: Axes | None, size: tuple[float, float]) -> tuple[Figure, Axes]:
    from matplotlib.figure import Figure

    if ax is not None:
        return _figure_of(ax), ax
    fig = Figure(figsize=size)
    return fig, fig.add_axes((0.09, 0.12, 0.56, 0.8))


def _figure_of(ax: Axes) -> Figure:
    fig = ax.get_figure(root=True)
    if fig is None:
        raise ProblemError("the axes given belong to no figure; make them by Figure().add_subplot()")
    return fig


def _fraction(h: float) -> str:
    inverse = 1.0 / h
    return f"1/{round(inverse)}" if abs(inverse - round(inverse)) < 1e-9 * inverse else f"{h:.3g}"


def _member(kind: type[Arrows], value: str, name: str) -> Arrows:
    try:
        return kind(value)
    except ValueError as error:
        raise ProblemError(f"{name} = {value!r}; choose one of {', '.join(kind)}") from error


def _law_text(problem: DiscreteProblem) -> list[str]:
    """Names and constants of the laws, for legends."""
    if problem.contact_points == 0:
        return []
    law: ContactLaw = problem.law
    lines = [f"{_proper(part.name)} law{_constants(part)}" for part in getattr(law.normal, "parts", (law.normal,))]
    if law.state_dependent:
        lines.append(f"{_proper(law.friction.name)} friction, $h_\\tau$ depends on the state")
        return lines
    bound = np.asarray(law.friction.at(None).bound)
    if problem.dim > 1 and (bound > 0.0).any():
        lines.append(f"{_proper(law.friction.name)} friction: $h_\\tau$ = {_range(bound)}")
    return lines


def _constants(law: Any) -> str:
    """``: name = value, ...`` for the numeric fields of a named law; nothing for tables."""
    if not is_dataclass(law) or law.__class__.__name__ == "PiecewiseQuadratic":
        return ""
    values = [(f.name, getattr(law, f.name)) for f in fields(law) if not f.name.startswith("_")]
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
