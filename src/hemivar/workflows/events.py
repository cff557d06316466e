"""Events (progress) that a use case yields while it works."""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeAlias, TypeVar

from hemivar.basics.generators import result_of

if TYPE_CHECKING:
    from hemivar.branches import PathProgress, SearchProgress
    from hemivar.certificates import Certificate
    from hemivar.discrete.problem import DiscreteProblem
    from hemivar.solvers import Progress, Solution, Solver
    from hemivar.solvers.load_stepping import Reached

__all__ = [
    "CertificateEvent",
    "Event",
    "FoundEvent",
    "MethodEvent",
    "Notice",
    "Phase",
    "StartEvent",
    "WarningEvent",
    "Work",
    "result_of",
    "until_interrupted",
]


class Notice:
    """Base of all events but the steps of a solve, :class:`~hemivar.solvers.Progress`, the starts of a search, the
    points of a path and the load factors of a bracket: :class:`~hemivar.branches.SearchProgress`,
    :class:`~hemivar.branches.PathProgress` and :class:`~hemivar.branches.Reached`."""


@dataclass(frozen=True, eq=False)
class WarningEvent(Notice):
    """Something that the numbers do not show by themselves, in a sentence.

    Attributes
    ----------
    text : str
        A sentence.
    """

    text: str


@dataclass(frozen=True, eq=False)
class Phase(Notice):
    """A part of long work begins: what it is, and which of how many (from 0).

    Attributes
    ----------
    name : str
        What begins.
    number : int
        Which part, from 0.
    count : int
        Of how many.
    """

    name: str
    number: int
    count: int


@dataclass(frozen=True, eq=False)
class MethodEvent(Notice):
    """The method; the reason is empty if it was given.

    Attributes
    ----------
    solver : Solver
    reason : str
        Why; empty if it was given.
    """

    solver: Solver
    reason: str


@dataclass(frozen=True, eq=False)
class StartEvent(Notice):
    """The solve of a problem begins, the ``number``-th (from 0) of ``count`` on meshes from coarse to fine.

    Attributes
    ----------
    problem : DiscreteProblem
    number : int
        Which mesh, from 0.
    count : int
        Of how many.
    """

    problem: DiscreteProblem
    number: int
    count: int


@dataclass(frozen=True, eq=False)
class FoundEvent(Notice):
    """A solution, or the best iterate of a solve that did not converge.

    Attributes
    ----------
    solution : Solution
    """

    solution: Solution


@dataclass(frozen=True, eq=False)
class CertificateEvent(Notice):
    """What is known about the solution.

    Attributes
    ----------
    certificate : Certificate
    """

    certificate: Certificate


Result = TypeVar("Result")

#: What a use case yields.
Event: TypeAlias = "Progress | SearchProgress | PathProgress | Reached | Notice"
#: A use case at work: it yields events, ends early after a step if it is sent True, and returns its result.
Work: TypeAlias = Generator[Event, bool | None, Result]


def until_interrupted(work: Work[bool]) -> Work[bool]:
    """Work that returns whether it was interrupted; Ctrl-C ends it, with what it has done until then."""
    try:
        return (yield from work)
    except KeyboardInterrupt:
        return True
