"""A bracket of the limit load: the load grows from zero until no equilibrium is found."""

from __future__ import annotations

from collections.abc import Generator, Sequence
from dataclasses import dataclass, replace
from typing import cast

import numpy as np

from hemivar.basics.arguments import number
from hemivar.basics.deadline import Budget
from hemivar.basics.display import brief
from hemivar.basics.generators import result_of
from hemivar.basics.known_keywords import known_keywords, showing_options
from hemivar.basics.rows import Column, ResultRows
from hemivar.branches.follow import PathOptions, following
from hemivar.branches.path import SAME_LOAD, Path
from hemivar.errors import MethodError, ProblemError
from hemivar.fem import LoadLine
from hemivar.fem.as_discrete import ProblemLike
from hemivar.fem.growing import growing
from hemivar.fem.load_line import load_names
from hemivar.fem.stress_stiffness import stiffens
from hemivar.linear.threads import one_thread
from hemivar.solvers import Controls, LoadStepping, Solution, Status, solve
from hemivar.solvers.base import SolverSystem, State
from hemivar.solvers.choice import affordable
from hemivar.solvers.load_stepping import Reached, SystemClimb
from hemivar.solvers.solve import default_method, solving
from hemivar.solvers.status import STOPPED
from hemivar.solvers.stiffening import Ordinary, StressedClimb, Tally
from hemivar.systems.workspace import Workspace

__all__ = ["BracketOptions", "LoadBracket", "Reached", "bracketing", "load_bracket"]

#: Ends of a search that say what the body does, not how the iteration failed.
_AWAY = (Status.UNBOUNDED, Status.NOT_CARRIED)


@dataclass(frozen=True)
class BracketOptions:
    """How far the load grows; see :func:`load_bracket`.

    Parameters
    ----------
    upto : float
        The largest load factor, > 0.
    max_time : float
        Limit in seconds; the bracket is then that reached so far.
    constant : sequence of names
        Loads that do not grow, such as the own weight: ``"body"`` and names of boundaries with a traction.

    Raises
    ------
    ProblemError
        ``upto`` is not positive and finite.
    """

    upto: float = 5.0
    max_time: float = np.inf
    constant: Sequence[str] = ()

    def __post_init__(self) -> None:
        if not 0.0 < number(self.upto, "upto", "give the largest load factor") < np.inf:
            raise ProblemError(f"upto is {self.upto}; give the largest load factor, a finite number > 0")
        Budget(self.max_time)
        object.__setattr__(self, "constant", load_names(self.constant))


@dataclass(frozen=True, eq=False)
class LoadBracket:
    """Load factors between which a body fails, see :func:`load_bracket`.

    Attributes
    ----------
    carried : float
        The largest load factor with an equilibrium that was reached from zero load.
    not_carried : float or None
        The least load factor above it at which none was found; None where none failed.
    solution : Solution
        The equilibrium at ``carried``; ``solution.problem`` has that load.
    upto : float
        The largest load factor that was asked for.
    ended : Status
        How the last search ended: CONVERGED where ``upto`` is carried, NOT_CARRIED where a fold lies below
        ``not_carried``, else how the iteration there failed, which is UNBOUNDED where the body ran away. After
        MAX_TIME, INTERRUPTED or OUT_OF_MEMORY the bracket may be wider.
    tried : int
        Load factors that were tried.
    fold : float or None
        The load factor at which the path of equilibria through ``solution`` turns back; None where no such fold was
        found between the two ends of the bracket.
    """

    carried: float
    not_carried: float | None
    solution: Solution
    upto: float
    ended: Status
    tried: int
    fold: float | None = None

    __repr__ = brief

    def rows(self) -> ResultRows:
        """One row: the largest load asked for, the bracket, the fold between, how it ended, and what was tried."""
        columns = (
            Column("up to", [self.upto], "upto"),
            Column("carried", [self.carried], "carried"),
            Column("not carried", [self.not_carried], "not_carried"),
            Column("fold", [self.fold], "fold"),
            Column("ended", [self.ended.value], "ended"),
            Column("tried", [self.tried], "tried"),
        )
        return ResultRows(columns)

    @property
    def complete(self) -> bool:
        """Whether the whole load is carried or the bracket is closed; False after a time limit or an interruption."""
        return self.ended not in STOPPED

    @property
    def wide(self) -> bool:
        """Whether the bracket is open by more than 1 % of its upper end, and that is more than nothing."""
        low, high = self.carried, self.not_carried
        return high is not None and high > SAME_LOAD and high - low > LoadStepping().width * high

    def __str__(self) -> str:
        if self.ended is Status.CONVERGED:
            return f"carries the load up to the factor {self.upto:g}, the largest that was tried"
        carried = f"equilibria up to the load factor {self.carried:.4g}"
        carried = carried if self.carried else "carries nothing" if self.complete else "no equilibrium under load yet"
        if self.fold is not None:
            return f"{carried}, {self.not_carried:.4g} is not carried: the path folds at {self.fold:.4g}"
        none = "" if self.not_carried is None else f", no equilibrium found at {self.not_carried:.4g}"
        how = "the iteration failed there" if self.complete else "the bracket is not closed"
        how = "the body ran away there" if self.ended in _AWAY else how
        return f"{carried}{none} ({how}: {self.ended.value})"


@known_keywords
@showing_options(BracketOptions)
def load_bracket(
    problem: ProblemLike, upto: float = BracketOptions.upto, *, workspace: Workspace | None = None, **options: object
) -> LoadBracket:
    """Bracket the load that a body carries to 1 %.

    The load grows from zero, with the prescribed displacements; each equilibrium is the start of the next. Where none
    is found the step is halved, until the largest load factor with an equilibrium and one without differ by 1 %.  This
    works for every law and every body that :func:`hemivar.solve` treats, as :class:`hemivar.solvers.LoadStepping` does.

    That a load is *not carried* is a numerical finding, not a proof: the method found no equilibrium downhill from that
    of a slightly smaller load.  A short path from there tells whether the load turns back between the two: ``fold``.
    Where it finds no fold the iteration has failed.  A body that jumps to another equilibrium carries its load there.

    Parameters
    ----------
    problem : DiscreteProblem or ContactProblem
        The problem at load factor 1.
    upto : float
        The largest load factor.
    workspace : Workspace, optional
        Keeps what is expensive for other calls on the same body.
    **options

    Returns
    -------
    LoadBracket

    Raises
    ------
    SupportError
        Nothing holds the body even against a small part of its load.
    MethodError, ProblemError
        As :func:`hemivar.solve`.

    Examples
    --------
    >>> import hemivar as hv
    >>> block = hv.ContactProblem(
    ...     hv.rectangle((1.0, 1.0), 2), hv.Material.young(10.0, 0.3),
    ...     {"bottom": hv.Contact(hv.Adhesive(100.0, 1.0, 50.0))}, {"left": "roller", "right": "roller"},
    ...     tractions={"top": (0.0, 0.5)})
    >>> bracket = hv.branches.load_bracket(block, upto=5.0)
    >>> round(bracket.carried, 2), round(bracket.not_carried, 2)
    (1.98, 2.0)
    """
    given = BracketOptions(upto, **options)  # type: ignore[arg-type]
    return result_of(bracketing(problem, given, workspace=workspace))


def bracketing(
    problem: ProblemLike, options: BracketOptions, *, workspace: Workspace | None = None
) -> Generator[Reached, bool | None, LoadBracket]:
    """:func:`load_bracket` load by load: yields every load factor, ends after it if it is sent True."""
    line, kept, budget = (
        growing(problem, "load_bracket", options.constant),
        Workspace.given(workspace),
        Budget(options.max_time),
    )
    line.check_grows()
    bracket = yield from _within(line, options.upto, kept, budget, options, 0)
    while bracket.complete and bracket.wide:  # steps that are parts of a smaller load are small enough
        assert bracket.not_carried is not None
        bracket = yield from _within(line, bracket.not_carried, kept, budget, options, bracket.tried)
    try:
        fold = _fold(line, bracket, kept, budget)
        return bracket if fold is None else replace(bracket, fold=fold, ended=Status.NOT_CARRIED)
    except KeyboardInterrupt:
        return replace(bracket, ended=Status.INTERRUPTED)


def _fold(line: LoadLine, bracket: LoadBracket, kept: Workspace, budget: Budget) -> float | None:
    """Where the load turns back within a bracket that is closed; None where that was not found."""
    low, high = bracket.carried, bracket.not_carried
    if not bracket.complete or high is None or not low or not affordable(line.loaded) or stiffens(line.loaded):
        return None
    short = PathOptions((low, high), max_points=200, max_time=budget.left)
    running = following(line.loaded, short, unloaded=line.unloaded, start=bracket.solution, workspace=kept)
    forth, highest, turned = False, low, False
    try:
        while True:  # first back to the lower end, then forth until the load turns
            at = running.send(turned or None).load_factor
            forth, turned = forth or at <= low, forth and at < highest
            highest = max(highest, at) if forth else low
    except StopIteration as ended:
        path: Path = ended.value
    except (MethodError, ProblemError):  # a law that falls at once in space, for instance
        return None
    if path.interrupted and not turned:
        raise KeyboardInterrupt
    return next((fold.load_factor for fold in path.folds if fold.load_factor > low), None)


def _within(
    line: LoadLine, upto: float, kept: Workspace, budget: Budget, options: BracketOptions, tried: int
) -> Generator[Reached, bool | None, LoadBracket]:
    """The bracket by steps that are parts of a load factor."""
    loaded = line.at(upto)
    if stiffens(loaded):
        return (yield from _stressed(replace(line, loaded=loaded), upto, kept, budget, options, tried))
    method = LoadStepping(default_method(loaded, kept)).for_tolerance(Controls().rtol)
    assert isinstance(method, LoadStepping)
    with one_thread(not method.condenses):
        system = cast(SolverSystem, method.prepare(loaded, kept))
        r = system.start()
        climb = SystemClimb(method, replace(line, loaded=loaded), budget, upto, system=system)
        reached = yield from climb.up(State(r, system.multiplier(r)))
        unknowns = system.recover(reached.at.r, reached.at.lam)[0]
    solution = solve(line.at(reached.carried), method.inner, initial=unknowns, workspace=kept)
    ended = Status.INTERRUPTED if solution.status is Status.INTERRUPTED else reached.status
    return LoadBracket(reached.carried, reached.not_carried, solution, options.upto, ended, tried + reached.tried)


def _stressed(
    line: LoadLine, upto: float, kept: Workspace, budget: Budget, options: BracketOptions, tried: int
) -> Generator[Reached, bool | None, LoadBracket]:
    """The same of a body that the stress of its load stiffens."""
    method, limits = LoadStepping(), Controls(max_time=budget.left)
    ordinary, tally = Ordinary(solving, None, kept), Tally(replace(limits, rtol=method.rtol), budget)
    climb = StressedClimb(method, line, budget, upto, ordinary=ordinary, tally=tally)
    reached = yield from climb.up(climb.at_rest)
    solution = climb.solved(reached.at) or solve(line.at(reached.low), workspace=kept)
    return LoadBracket(
        reached.carried, reached.not_carried, solution, options.upto, reached.status, tried + reached.tried
    )
