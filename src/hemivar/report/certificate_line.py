"""What a certificate says, in one quiet line below a picture and as a picture of its own."""

from __future__ import annotations

import math
from textwrap import wrap
from typing import TYPE_CHECKING

from hemivar.bounds.stated_distance import DistanceToExact
from hemivar.certificates import Certificate
from hemivar.report.picture import current, new_figure
from hemivar.report.style import BLUE, GREEN, GREY, RED, drawing, figure_of
from hemivar.solvers import Solution, Status

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["FOOT", "certificate_line", "plot_certificate", "title_of", "with_notes", "write_below", "write_foot"]

#: Room for the line below axes, in inches.
FOOT = 0.22
#: Points of the letters of that line: one line of them, with half a line around it, fits into the room.
_SIZE = 6.5
#: The range of relative sizes that is drawn; what is smaller is rounding.
_LEAST, _MOST = 1e-17, 10.0


def certificate_line(solution: Solution, certificate: Certificate | None, exact: DistanceToExact | None = None) -> str:
    """What a picture says of the worth of its solution: what was certified, or the residual and the distance alone."""
    if certificate is not None:
        line = certificate.brief()
    else:
        known = "" if exact is None else exact.brief()
        line = f"residual {solution.residual.relative:.1e}" + (f"; {known}" if known else ", not certified")
    if solution.deformation is not None and solution.deformation.large:
        line = f"beyond small strains ({solution.deformation.sizes}); {line}"
    return line if solution.status is Status.CONVERGED else f"{solution.status.value}: {line}"


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
        _wrapped(figure_of(ax), line), (0.0, 0.0), (0.0, -points), xycoords="axes fraction",
        textcoords="offset points", fontsize=_SIZE, color=GREY, va="top", annotation_clip=False,
    )  # fmt: skip


def _wrapped(fig: Figure, line: str) -> str:
    """In lines that are no longer than the figure, if letters are half as wide as high."""
    return "\n".join(wrap(line, int(fig.get_figwidth() * 72.0 / (0.5 * _SIZE))))


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
    low = 0.25 * share + _SIZE / 72.0 / fig.get_figheight()  # further lines hang below the figure, which grows as saved
    fig.text(0.01, low, _wrapped(fig, line), fontsize=_SIZE, color=GREY, va="top")


def plot_certificate(certificate: Certificate, *, title: str | None = None) -> Figure:
    """What is known about a pair: above c, which is below 1 if there is one solution; below relative sizes.

    These are how far the pair is from equilibrium and from the graph of the law, with the tolerance, and the distances
    to the exact discrete and continuous solutions.  Filled bars are bounds that hold; open ones are estimates, from
    sampled constants or for reasons that the certificate names.  What is not known is said in words.

    Parameters
    ----------
    certificate : Certificate
    title : str, optional
        The kind of point and whether it is the only solution, by default.
    """
    with drawing():
        fig = new_figure((6.3, 2.9 if certificate.exact is None else 3.3), layout="constrained")
        above, below = fig.subplots(2, 1, height_ratios=(1, 4 if certificate.exact is None else 5))
        _margin(above, certificate)
        _sizes(below, certificate)
        fig.suptitle(title or f"{certificate.kind.value}; {certificate.uniqueness}", fontsize=10)
    return fig


def _margin(ax: Axes, certificate: Certificate) -> None:
    """The constant c with its coupling on a line that ends where uniqueness is no longer proved."""
    left_out = "margin" in certificate.left_out
    used = 1.0 - certificate.margin
    least = 1.6
    shown = used if math.isfinite(used) else 2.0 * least  # beyond the end
    sampled = certificate.smallness.sampled
    unproved = certificate.margin <= 0.0
    if not left_out:
        colour = RED if unproved else GREEN
        ax.barh([0], [max(shown, 0.0)], 0.5, color="none" if sampled else colour, edgecolor=colour, lw=1.0)
    ax.axvline(1.0, color="black", lw=1.0)
    ax.annotate(
        "limit", (1.0, 1.0), xycoords=("data", "axes fraction"), xytext=(0, 1), textcoords="offset points",
        ha="center", va="bottom", fontsize=7.0,
    )  # fmt: skip
    end = max(least, 1.25 * shown) if math.isfinite(used) else least
    ax.set_xlim(0.0, end)
    ax.set_ylim(-0.6, 0.6)
    margin = "not computed, because the time limit was reached" if left_out else f"{certificate.margin:.3g}"
    label = ("c = 0, " if used == 0.0 else "") + f"margin {margin}{' (sampled)' if sampled and not left_out else ''}"
    right = shown < 0.62 * end or left_out
    ax.annotate(
        label, (max(shown, 1.0) if right else 1.0, 0.0), xytext=(5 if right else -5, 0), textcoords="offset points",
        va="center", ha="left" if right else "right", fontsize=8.0,
        bbox={"boxstyle": "square,pad=0.15", "facecolor": "white", "edgecolor": "none", "alpha": 0.85},
    )  # fmt: skip
    ax.set_yticks([0], labels=["c, below 1 if\nunique"])
    ax.tick_params(axis="y", length=0)
    ax.spines["left"].set_visible(False)


def _sizes(ax: Axes, certificate: Certificate) -> None:
    """Relative sizes on a logarithmic scale."""
    exact = certificate.exact
    bound, sampled = certificate.error_bound_relative, certificate.error_bound_sampled
    late = "error bound" in certificate.left_out or "margin" in certificate.left_out
    why = "not computed, because the time limit was reached" if late else "no bound: the margin is not positive"
    rows: list[tuple[str, float, str, bool, str]] = [
        ("out of equilibrium", certificate.equilibrium_relative, GREY, True, "not known"),
        ("off the law", certificate.inclusion_relative, GREY, True, "not known"),
        ("distance to the exact\ndiscrete solution", bound, BLUE, not sampled, why),
    ]
    if exact is not None:
        name = "distance to the exact\ncontinuous solution"
        rows.append((name, exact.relative, BLUE, exact.guaranteed, "not known; see its reasons"))
    for row, (_, value, colour, sure, missing) in enumerate(rows):
        if not math.isfinite(value):
            ax.annotate(missing, (_LEAST, row), xytext=(4, 0), textcoords="offset points", va="center", fontsize=8.0)
            continue
        shown = min(max(value, _LEAST), _MOST)
        ax.barh([row], [shown - _LEAST], 0.55, left=_LEAST, color=colour if sure else "none", edgecolor=colour, lw=1.0)
        kind = "" if colour == GREY else "at most " if sure else "about "
        label = f"{kind}{value:.1e}" if value else "0"
        ax.annotate(label, (shown, row), xytext=(4, 0), textcoords="offset points", va="center", fontsize=8.0)
    ax.plot([certificate.tolerance] * 2, [-0.5, 1.5], color=RED, lw=1.0, ls="--")
    ax.annotate(
        "tolerance", (certificate.tolerance, -0.45), xytext=(3, 0), textcoords="offset points", color=RED, va="top",
        fontsize=8.0,
    )  # fmt: skip
    ax.set(xscale="log", xlim=(_LEAST, _MOST * 300.0), xlabel="relative size")
    ax.set_xticks([10.0**power for power in range(-16, 1, 4)])
    ax.set_yticks(range(len(rows)), labels=[name for name, *_ in rows])
    ax.tick_params(axis="y", length=0)
    ax.set_ylim(len(rows) - 0.4, -0.7)
