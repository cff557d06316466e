"""Several solutions of one problem side by side, each with its kind and its energy."""

from __future__ import annotations

import io
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from hemivar.basics.types import Array
from hemivar.branches import SolutionSet
from hemivar.errors import ProblemError
from hemivar.laws import ContactLaw, Superpotential
from hemivar.report.bodies import plot_solution
from hemivar.report.certificate_line import FOOT, with_notes, write_foot
from hemivar.report.contact_curves import plot_contact
from hemivar.report.deformed import BodyColour, DeformedBody
from hemivar.report.law_figures import draw_graph
from hemivar.report.picture import new_figure, png
from hemivar.report.style import BESIDE, MARKERS, STYLE, drawing, in_rows, state_mark, with_unit
from hemivar.solvers import Solution

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["MOST_PICTURES", "common_scale", "plot_solutions"]

#: Solutions that are drawn, those of least energy.
MOST_PICTURES = 4 * BESIDE
#: Up to so many the law is drawn below each.
_MOST_LAWS = 2 * BESIDE


def plot_solutions(
    solutions: SolutionSet,
    *,
    title: str | None = None,
    unit: str = "",
    stress_unit: str = "",
    colour: BodyColour | Literal["stress", "displacement", "none"] | None = None,
) -> Figure:
    """The solutions side by side by their energy, up to twelve, with one scale of the displacement for all.

    Below up to six of them the law in which they differ most, with the contact points of each on it; not where contact
    points have different laws.

    Parameters
    ----------
    solutions : SolutionSet
    title : str, optional
    unit, stress_unit : str
        Units of length and stress for the labels.
    colour : BodyColour, optional
        What colours the bodies, as in :func:`plot_solution`.

    Raises
    ------
    ProblemError
        No solution was found, or there are no such colours.
    """

    if not len(solutions):
        raise ProblemError("no solution was found that could be drawn; search from more starts")
    shown, scale = solutions[:MOST_PICTURES], common_scale(solutions)
    curve = _LawCurve.of(solutions) if len(shown) <= _MOST_LAWS else None
    columns = min(len(shown), BESIDE)
    rows = -(-len(shown) // columns)
    high, low = 2.7, 0.0 if curve is None else 1.5
    largest = max(float(np.linalg.norm(solution.multiplier, axis=1).max(initial=0.0)) for solution in shown) or None
    kinds = {kind: None for solution in shown for kind in solution.states.present}
    with drawing():
        fig = new_figure((max(2.6 * columns, 3.4), (high + low) * rows + 0.7), layout="constrained")
        ratios = [part for _ in range(rows) for part in (high, low) if part]
        panels = fig.subplots(len(ratios), columns, squeeze=False, height_ratios=ratios)
        bodies, graphs = panels[:: len(ratios) // rows].ravel(), panels[1::2].ravel() if low else np.array([])
        for number, (panel, solution) in enumerate(zip(bodies, shown, strict=False), start=1):
            _draw(panel, solution, scale, largest, unit, stress_unit, colour)
            kind = "" if solution.kind is None else f", {solution.kind}"
            panel.set_title(f"{number}{kind}\nenergy {solution.energy:.6g}", fontsize=8.0)
        _alike(list(bodies[: len(shown)]))
        if curve is not None:
            for graph, solution in zip(graphs, shown, strict=False):
                curve.draw(graph, solution, unit, stress_unit)
        for panel in (*bodies[len(shown) :], *graphs[len(shown) :]):
            panel.set_axis_off()
        if title:
            fig.suptitle(title, fontsize=10.0)
        above = 0.5 + (72.0 * FOOT / STYLE["legend.fontsize"] if with_notes() else 0.0)
        if kinds:
            fig.legend(
                handles=[state_mark(kind, kind.label) for kind in kinds], loc="outside lower center",
                borderaxespad=above, ncols=in_rows(len(kinds)), columnspacing=1.4,
            )  # fmt: skip
        many = f"{len(solutions)} solutions" if len(solutions) > 1 else "one solution"
        worst = max(solution.residual.relative for solution in solutions)
        least = "" if len(shown) == len(solutions) else f", {len(shown)} of least energy shown"
        others = "no others exist" if solutions.exhaustive else "there may be others"
        times = "" if scale == 1.0 else f"; displacement times {scale:g}"
        write_foot(fig, f"{many}{least}; {others}; residuals at most {worst:.1e}{times}")
    return fig


@dataclass(frozen=True)
class _LawCurve:
    """The law in which several solutions differ most, of one point, and from where to where it is drawn."""

    law: Superpotential
    component: int  # 0 for the normal law, 1 for friction over the size of the slip
    least: float
    most: float

    @classmethod
    def of(cls, solutions: SolutionSet) -> _LawCurve | None:
        """None where contact points have different laws, or laws of several components at once."""
        problem = solutions[0].problem
        law = problem.law
        if not isinstance(law, ContactLaw) or law.state_dependent or problem.contact_points == 0:
            return None
        parts = law.scalar_laws(problem.contact.components)
        depths = [np.array([_depth_or_slip(solution, k) for solution in solutions]) for k in range(len(parts))]
        component = int(np.argmax([float(np.ptp(depth, axis=0).max(initial=0.0)) for depth in depths]))
        least, most = float(depths[component].min()), float(depths[component].max())
        room = 0.12 * (most - least) or 1.0
        least, most = min(least, 0.0) - room, max(most, 0.0) + room
        part = parts[component]
        samples = [part.derivative(np.full(problem.contact_points, r)) for r in np.linspace(least, most, 23)]
        if any(np.ptp(value) > 1e-9 * np.abs(value).max(initial=0.0) for value in samples):
            return None
        return cls(part.take(np.array([0])), component, least, most)

    def draw(self, panel: Axes, solution: Solution, unit: str, stress_unit: str) -> None:
        """The graph of the law, and the contact points of a solution on it by their states."""
        draw_graph(panel, self.law, self.law.describe(), max(-self.least, self.most))
        force = solution.pressure if self.component == 0 else np.linalg.norm(solution.friction, axis=1)
        depth = _depth_or_slip(solution, self.component)
        for kind, here in solution.states.present.items():
            panel.plot(depth[here], force[here], ls="", ms=4.0, mew=0.6, zorder=6, clip_on=False, **MARKERS[kind])
        names = (("penetration", "pressure"), ("slip", "friction"))[self.component]
        panel.set_xlabel(with_unit(names[0], unit))
        panel.set_ylabel(with_unit(names[1], stress_unit))
        panel.set_xlim(self.least, self.most)
        panel.locator_params(nbins=4)
        panel.tick_params(labelsize=7.0)


def _depth_or_slip(solution: Solution, component: int) -> Array:
    """Penetrations, or sizes of the slip, (m,)."""
    return solution.penetration if component == 0 else np.linalg.norm(solution.slip, axis=1)


def common_scale(solutions: SolutionSet) -> float:
    """A factor of the displacement for the pictures of all solutions: that of the one that moves farthest."""
    bodies = [solution for solution in solutions if solution.problem.field is not None]
    return min((DeformedBody.of(solution, "auto").factor for solution in bodies), default=1.0)


def _alike(panels: list[Axes]) -> None:
    """Give pictures the same limits, so that what is alike looks alike."""
    ends = np.array([[*panel.get_xlim(), *panel.get_ylim()] for panel in panels if panel.axison])
    if len(ends):
        low, high = ends.min(axis=0), ends.max(axis=0)
        for panel in panels:
            panel.set(xlim=(low[0], high[1]), ylim=(low[2], high[3]))


def _draw(
    panel: Axes,
    solution: Solution,
    scale: float,
    largest: float | None,
    unit: str,
    stress_unit: str,
    colour: BodyColour | str | None,
) -> None:
    """One solution: in the plane on these axes, otherwise as a picture of its own figure."""
    field = solution.problem.field
    if field is not None and field.mesh.dim == 2:
        plot_solution(
            solution, ax=panel, scale=scale, legend=False, unit=unit, stress_unit=stress_unit, colour=colour,  # type: ignore[arg-type]
            largest_force=largest,
        )  # fmt: skip
        panel.tick_params(labelsize=7.0)
        return
    from matplotlib.image import imread

    if field is None:
        own = plot_contact(solution, unit=unit, stress_unit=stress_unit)
    else:
        own = plot_solution(solution, scale=scale, unit=unit, stress_unit=stress_unit, colour=colour)  # type: ignore[arg-type]
    panel.imshow(imread(io.BytesIO(png(own)), format="png"))
    panel.set_axis_off()


def plot_body_or_points(
    solution: Solution, *, scale: float | Literal["auto"], title: str | None, unit: str, stress_unit: str
) -> Figure:
    """The deformed body; the contact points of a problem without a mesh."""
    if solution.problem.field is None:
        return plot_contact(solution, title=title, unit=unit, stress_unit=stress_unit)
    return plot_solution(solution, scale=scale, title=title, unit=unit, stress_unit=stress_unit)
