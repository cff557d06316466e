"""Quantities of interest by name: contact forces, reactions of supports, mean displacements of parts of the boundary.

``contact.NAME.force`` is the force of the foundation, or of another body, on that boundary, ``support.NAME.force``
that of a support on the body, and ``boundary.NAME.displacement`` the mean of the displacement over a named part of the
boundary: vectors, in the coordinates of the mesh. With ``.x``, ``.y`` or ``.z`` behind it a name stands for one
component.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

from hemivar.basics.arguments import expect, quoted, suggest
from hemivar.errors import ProblemError
from hemivar.mechanics.statement import ContactProblem, expect_body

__all__ = ["Goal", "GoalKind", "goal_named", "known_goals"]


class GoalKind(StrEnum):
    """What is asked for; the value is what stands in front of the name of the boundary."""

    CONTACT_FORCE = "contact"
    REACTION = "support"
    DISPLACEMENT = "boundary"

    @property
    def quantity(self) -> str:
        """What stands behind the name of the boundary."""
        return "displacement" if self is GoalKind.DISPLACEMENT else "force"


@dataclass(frozen=True)
class Goal:
    """A quantity of interest.

    Attributes
    ----------
    kind : GoalKind
    boundary : str
        The contact boundary, the support or the part of the boundary.
    axes : tuple of int
        The components asked for.
    """

    kind: GoalKind
    boundary: str
    axes: tuple[int, ...]

    @property
    def name(self) -> str:
        """As :func:`goal_named` takes it."""
        axis = f".{'xyz'[self.axes[0]]}" if len(self.axes) == 1 else ""
        return f"{self.kind.value}.{self.boundary}.{self.kind.quantity}{axis}"

    @property
    def labels(self) -> tuple[str, ...]:
        """Names of the components."""
        return tuple("xyz"[axis] for axis in self.axes)

    def __str__(self) -> str:
        return self.name


def known_goals(problem: ContactProblem) -> tuple[str, ...]:
    """The goals of a problem, without the components.

    Parameters
    ----------
    problem : ContactProblem

    Returns
    -------
    tuple of str
    """
    expect_body(problem, "the problem", "give a ContactProblem")
    sides = ((name, contact.against) for name, contact in problem.contact.items())
    touching = [side for pair in sides for side in pair if side]
    parts = (
        (GoalKind.CONTACT_FORCE, dict.fromkeys(touching)),
        (GoalKind.REACTION, problem.supports),
        (GoalKind.DISPLACEMENT, problem.mesh.boundaries),
    )
    return tuple(f"{kind.value}.{name}.{kind.quantity}" for kind, names in parts for name in names)


def goal_named(problem: ContactProblem, name: str) -> Goal:
    """The goal of a name.

    Parameters
    ----------
    problem : ContactProblem
    name : str
        As :func:`known_goals` has them, such as ``contact.bottom.force``, with a component at the end where there
        are several.

    Returns
    -------
    Goal

    Raises
    ------
    ProblemError
        The problem has no such goal; the message lists those that it has.
    """
    text = expect(name, str, "a goal", "name it as in 'contact.bottom.force'")
    dim = problem.mesh.dim
    every = tuple(range(dim))
    known = known_goals(problem)
    for whole in known:
        kind, rest = whole.split(".", 1)
        boundary = rest.rpartition(".")[0]
        if text == whole:
            return Goal(GoalKind(kind), boundary, every)
        for axis in every:
            if text == f"{whole}.{'xyz'[axis]}":
                return Goal(GoalKind(kind), boundary, (axis,))
    ends = ", ".join(f".{'xyz'[axis]}" for axis in every)
    raise ProblemError(f"goal {quoted(text)} is not known{suggest(text, known)}; {ends} behind it take one component")
