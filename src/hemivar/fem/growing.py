"""Load ramps of what a function is given: load factors of a statement or a discrete problem."""

from __future__ import annotations

from collections.abc import Collection

from hemivar.basics.arrays import COUNTS
from hemivar.discrete.free_motion import refuse_free_motion
from hemivar.errors import SupportError
from hemivar.fem.as_discrete import ProblemLike, as_discrete
from hemivar.fem.discretize import discretize
from hemivar.fem.load_line import LoadLine
from hemivar.mechanics.statement import ContactProblem

__all__ = ["growing"]


def growing(problem: ProblemLike, function: str, constant: Collection[str] = ()) -> LoadLine:
    """The load that grows to that of a problem; a body that only a smaller load leaves in its place is let pass."""
    if not isinstance(problem, ContactProblem):
        return LoadLine.to(as_discrete(problem, function), constant)
    try:
        return LoadLine.to(as_discrete(problem, function), constant)
    except SupportError:
        line = LoadLine.to(discretize(problem, check_coercivity=False), constant)
        refuse_free_motion(line.at(COUNTS))
        return line
