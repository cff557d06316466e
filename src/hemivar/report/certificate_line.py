"""One quiet line below a picture: how exact the solution is, and whether it is the only one."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hemivar.certificates import Certificate, DistanceToExact
from hemivar.report.paper import current
from hemivar.report.style import GREY
from hemivar.solvers import Solution, Status

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["FOOT", "certificate_line", "title_of", "with_notes", "write_below", "write_foot"]

#: Room for the line below axes, in inches.
FOOT = 0.22
_SIZE = 6.5


def certificate_line(solution: Solution, certificate: Certificate | None, exact: DistanceToExact | None = None) -> str:
    """What a picture says of the worth of its solution: what was certified, or the residual and the distance alone."""
    if certificate is not None:
        told = certificate.brief()
    else:
        known = "" if exact is None else exact.brief()
        told = f"residual {solution.residual.relative:.1e}" + (f"; {known}" if known else ", not certified")
    if solution.deformation is not None and solution.deformation.large:
        told = f"beyond small strains ({solution.deformation.sizes}); {told}"
    return told if solution.status is Status.CONVERGED else f"{solution.status.value}: {told}"


def title_of(solution: Solution, title: str | None) -> str | None:
    """The title of a picture; above it, of what is no solution, that it is none and why."""
    if solution.status is Status.CONVERGED:
        return title
    return "\n".join(part for part in (f"NOT A SOLUTION: {solution.status.value}", title) if part)


def with_notes() -> bool:
    """Whether figures have notes here: all have but printed ones."""
    printed = current()
    return printed is None or printed.annotations


def write_below(ax: Axes, line: str, points: float = 36.0) -> None:
    """Write the line so many points below axes, under the name of their scale; not where notes are left out."""
    if not with_notes():
        return
    ax.annotate(
        line, (0.0, 0.0), (0.0, -points), xycoords="axes fraction", textcoords="offset points", fontsize=_SIZE,
        color=GREY, va="top", annotation_clip=False,
    )  # fmt: skip


def write_foot(fig: Figure, line: str) -> None:
    """Write the line at the lower edge of a figure, which keeps room for it where its layout is constrained.

    Nothing is written where notes are left out.
    """
    if not with_notes():
        return
    from matplotlib.layout_engine import ConstrainedLayoutEngine

    engine, share = fig.get_layout_engine(), FOOT / fig.get_figheight()
    if isinstance(engine, ConstrainedLayoutEngine):
        engine.set(rect=(0.0, share, 1.0, 1.0 - share))
    fig.text(0.01, 0.25 * share, line, fontsize=_SIZE, color=GREY, va="bottom")
