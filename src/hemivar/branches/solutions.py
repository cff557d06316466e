"""All solutions of a problem, as far as enumeration, multistart, deflation and continuation find them."""

from __future__ import annotations

from collections.abc import Generator, Iterator, Sequence
from dataclasses import dataclass, field
from typing import overload

import numpy as np

from hemivar.basics.arguments import expect, whole_number
from hemivar.basics.deadline import Budget, limited
from hemivar.basics.display import ReprMixin
from hemivar.basics.generators import result_of
from hemivar.basics.known_keywords import known_keywords, showing_options
from hemivar.basics.rows import Column, ResultRows
from hemivar.basics.types import Array
from hemivar.branches.enumeration import enumerate_points
from hemivar.branches.search import SearchProgress, SolutionSearch
from hemivar.branches.state_chain import state_chain_of
from hemivar.certificates import smallness
from hemivar.certificates.linear_bodies import at_tangent
from hemivar.certificates.smallness import Smallness, one_solution
from hemivar.discrete.bulk import Quadratic
from hemivar.discrete.point_kind import PointKind
from hemivar.discrete.problem import DiscreteProblem
from hemivar.fem.as_discrete import ProblemLike, as_discrete
from hemivar.laws.vector_law import splits
from hemivar.solvers import Controls, NonsmoothNewton, Solution, Status
from hemivar.systems.chain import Chain, chain_of, segments_at_most
from hemivar.systems.workspace import Workspace

__all__ = ["SolutionSet", "SolutionsOptions", "find_solutions", "finding"]

#: Segments of laws that are laid out before it is known whether there is one solution. It decides on time only: with
#: 2 000 and 200 000 the solutions of tests/branches are the same.
_SEGMENTS = 20_000


@dataclass(frozen=True, eq=False)
class SolutionSet(Sequence[Solution], ReprMixin):
    """The solutions that were found, ordered by energy.

    Attributes
    ----------
    solutions : tuple of Solution
        Each with its energy and its ``kind``, as its certificate finds it: LOCAL_MINIMISER (no lower point nearby),
        GLOBAL_MINIMISER (the law is convex, and others may be as low), SADDLE, MAXIMUM (of the energy as a function of
        the contact displacements alone), CLARKE_STATIONARY, or DIRECTIONALLY_STATIONARY where the curvature does not
        decide, as at the load of a fold.  A point with a component at a downward jump of its law is never a local
        minimiser.
    exhaustive : bool
        Whether there are no others: every combination of pieces and kinks was tried and rounding left none of them
        undecided, or the problem has one solution by its margin.  Solutions nearer to each other than their rounding
        errors count as one.
    combinations : float
        Number of combinations of pieces and kinks; inf where the graph of the law is no curve (three dimensions, laws
        that couple opening and slip, bounds that depend on the solution).
    starts : int
        Number of starting points tried, 0 where all combinations were.
    searched : str
        How far the search went, in words.
    interrupted : bool
        Whether it was stopped from the keyboard; what was found until then is here.
    """

    solutions: tuple[Solution, ...]
    exhaustive: bool
    combinations: float
    starts: int
    searched: str
    interrupted: bool = False

    def __repr__(self) -> str:
        first = self.solutions[:4]
        energies = ", ".join(f"{solution.energy:.6g}" for solution in first)
        more = ", ..." if len(self) > len(first) else ""
        known = "all" if self.exhaustive else "perhaps not all"
        return f"SolutionSet({len(self)} solutions, {known}; energies {energies}{more}; {self.searched})"

    def rows(self) -> ResultRows:
        """A row for each solution: kind, energy, largest penetration or opening, forces, status, residual."""
        glued = any(one.debonding for one in self)
        depths = [(-one.penetration if glued else one.penetration).max(initial=0.0) for one in self]
        lowest = -np.inf
        six = "{:.6g}".format
        columns = (
            Column("", range(1, len(self) + 1)),
            Column("kind", [None if one.kind is None else one.kind.value for one in self], "kind"),
            Column("energy", [one.energy for one in self], "energy", unit="energy", cell="{:.10g}".format),
            Column("max opening" if glued else "max penetration", depths, unit="length", cell=six),
            Column(None, [float(one.penetration.max(initial=lowest)) for one in self], "max_penetration"),
            Column("normal force", [one.normal_force for one in self], "normal_force", unit="force", cell=six),
            Column("contact", [one.contact_length for one in self], "contact", cell=six),
            Column(None, [one.status.value for one in self], "status"),
            Column("residual", [one.residual.relative for one in self], "residual"),
        )
        return ResultRows(columns)

    def __len__(self) -> int:
        return len(self.solutions)

    @overload
    def __getitem__(self, index: int) -> Solution: ...

    @overload
    def __getitem__(self, index: slice) -> tuple[Solution, ...]: ...

    def __getitem__(self, index: int | slice) -> Solution | tuple[Solution, ...]:
        return self.solutions[index]

    def __iter__(self) -> Iterator[Solution]:
        return iter(self.solutions)

    @property
    def energies(self) -> Array:
        """Energies in increasing order."""
        return np.array([solution.energy for solution in self.solutions])

    @property
    def minima(self) -> tuple[Solution, ...]:
        """The minimisers among them, local and global ones."""
        kinds = (PointKind.LOCAL_MINIMISER, PointKind.GLOBAL_MINIMISER)
        return tuple(solution for solution in self.solutions if solution.kind in kinds)


@dataclass(frozen=True)
class SolutionsOptions:
    """How far to search; see :func:`find_solutions`.

    Parameters
    ----------
    starts : int
        Random starts of each kind.
    max_solutions : int
        Stop after so many.
    seed : int
        Of the random starts; any will do.
    controls : Controls
        Tolerances of the solves; ``max_time`` limits the whole search.
    enumerate_up_to : int
        Largest number of combinations of pieces of the law that are all tried; 0 for the search from many starts.

    Raises
    ------
    ProblemError
        The numbers make no sense.
    """

    starts: int = 40
    max_solutions: int = 100
    seed: int = 0
    controls: Controls = field(default_factory=Controls)
    enumerate_up_to: int = 20_000

    def __post_init__(self) -> None:
        for name, least in (("starts", 0), ("max_solutions", 1), ("seed", 0), ("enumerate_up_to", 0)):
            whole_number(getattr(self, name), name, least)
        expect(self.controls, Controls, "controls", "pass Controls(rtol=..., max_time=...)")


@known_keywords
@showing_options(SolutionsOptions)
def find_solutions(problem: ProblemLike, *, workspace: Workspace | None = None, **options: object) -> SolutionSet:
    """Find the equilibria of a problem; ``exhaustive`` on the result says whether all were found.

    >>> import hemivar as hv
    >>> law = hv.laws.ContactLaw(hv.Softening(stiffness=2.0, limit=0.1, softening=0.9)).at(None)
    >>> spring = hv.DiscreteProblem.of_arrays([[0.5]], [0.225], [[1.0]], [1.0], [0.0], law)
    >>> found = hv.find_solutions(spring)
    >>> len(found), found.exhaustive
    (3, True)
    >>> [f"{one.penetration[0]:.4f}" for one in found]
    ['0.4500', '0.0900', '0.1625']

    Up to ``enumerate_up_to`` combinations of pieces and kinks of piecewise quadratic laws are all tried: no solution is
    missed.  Where the margin of :func:`hemivar.certificates.smallness` is positive there is one solution, which is
    solved for.  Otherwise the search is from many starts, and more solutions may exist.  It starts from zero, by load
    stepping, beside every kink and from random points.  From what was found it goes on by deflation, along load paths
    and to both sides of every saddle.

    Parameters
    ----------
    problem : DiscreteProblem
    workspace : Workspace, optional
        Keeps what is expensive for other calls on the same body.
    **options

    Returns
    -------
    SolutionSet

    Raises
    ------
    ProblemError
        ``starts`` or ``max_solutions`` make no sense, or the problem cannot be solved as stated.
    """
    return result_of(finding(problem, SolutionsOptions(**options), workspace))  # type: ignore[arg-type]


def finding(
    problem: ProblemLike, options: SolutionsOptions, workspace: Workspace | None = None
) -> Generator[SearchProgress, bool | None, SolutionSet]:
    """:func:`find_solutions` start by start: yields each, ends after it if it is sent True, returns the solutions."""
    kept = Workspace.given(workspace)
    problem = as_discrete(problem, "find_solutions")
    budget = Budget(options.controls.max_time)
    if not isinstance(problem.bulk, Quadratic):
        return (yield from _of_nonlinear_body(problem, options, kept, budget))
    system = kept.condensed(problem)
    chain: Chain | None = None
    dependent = bool(problem.contact_points and problem.law.state_dependent)
    plane = problem.contact.components <= 2 and problem.contact_points > 0 and splits(problem.law)
    if plane and (dependent or segments_at_most(system) <= _SEGMENTS):
        chain = state_chain_of(system) if dependent else chain_of(system)
    random = np.random.default_rng(options.seed)
    search = SolutionSearch(system, kept, chain, options.controls, options.max_solutions, random, budget)
    if chain is not None and not dependent and chain.combinations <= options.enumerate_up_to and _affine(chain):
        return (yield from _enumerated(search, chain))
    constants: Smallness | None = None
    with search.stopped_cleanly():
        if (yield search.progress):
            raise KeyboardInterrupt
        budget.check()
        with limited(budget):
            if not dependent:
                constants = smallness(problem, trace_constant=False, workspace=kept)
            if constants is None or one_solution(problem, constants):
                search.run(NonsmoothNewton())
            if constants is None and len(search.solutions) == 1:
                u, lam = search.solutions[0].unknowns, search.solutions[0].multiplier
                constants = smallness(problem, displacement=u, multiplier=lam, trace_constant=False, workspace=kept)
            proved = constants is not None and one_solution(problem, constants)
            if plane and chain is None and not (proved and search.solutions):
                chain = chain_of(system)
                search.follow(chain)
        if not (proved and search.solutions):
            search.plan(options.starts)
            yield from search.working(search.from_solvers(options.starts))
            if chain is not None:
                yield from search.working(search.from_deflation(options.starts))
                yield from search.working(search.from_paths_and_saddles())
    combinations = chain.combinations if chain is not None and not dependent else np.inf
    if constants is not None and one_solution(problem, constants) and len(search.solutions) == 1:
        searched = f"the margin {constants.margin:.3g} is positive, so there is one solution"
        return SolutionSet(search.sorted(), True, combinations, search.starts, searched, search.interrupted)
    if chain is None:
        searched = f"{search.starts} starts of minimising methods; there may be more solutions, saddles above all"
    elif dependent:
        searched = f"{search.starts} starts, the found ones deflated; the friction bound depends on the solution, "
        searched += "so that there may be more"
    else:
        searched = (
            f"{search.starts} starts and the load paths through what they found, where there are {combinations:.3g} "
            "combinations of pieces and kinks; there may be more"
        )
    if constants is not None and constants.sampled and constants.margin > 0.0:
        doubt = problem.law.proof("alpha").doubt
        why = f"alpha is {doubt}" if "reach" in doubt else "rests on sampled constants"
        searched += f"; the margin {constants.margin:.3g} is positive, but {why}"
    if not search.carried:
        searched += "; as it grows from rest, the load is not carried"
    if search.full:
        searched += f"; stopped at {search.limit} solutions"
    if search.stopped:
        searched += f"; {search.stopped}"
    return SolutionSet(search.sorted(), False, combinations, search.starts, searched, search.interrupted)


def _of_nonlinear_body(
    problem: DiscreteProblem, options: SolutionsOptions, workspace: Workspace, budget: Budget
) -> Generator[SearchProgress, bool | None, SolutionSet]:
    """From many starts, which the linear body at rest tells, and from between what was found."""
    system = workspace.condensed(at_tangent(problem, np.zeros(problem.unknowns)))
    random = np.random.default_rng(options.seed)
    search = SolutionSearch(system, workspace, None, options.controls, options.max_solutions, random, budget, problem)
    constants: Smallness | None = None
    with search.stopped_cleanly():
        if (yield search.progress):
            raise KeyboardInterrupt
        budget.check()
        with limited(budget):
            if not (problem.contact_points and problem.law.state_dependent):
                constants = smallness(problem, trace_constant=False, workspace=workspace)
                if one_solution(problem, constants):
                    search.run(NonsmoothNewton())
        if not search.solutions:
            search.plan(options.starts)
            yield from search.working(search.from_solvers(options.starts))
            yield from search.working(search.from_between())
    proved = constants is not None and one_solution(problem, constants) and len(search.solutions) == 1
    searched = f"{search.starts} starts of a body that is not linear; there may be more solutions, saddles above all"
    if proved and constants is not None:
        searched = f"the margin {constants.margin:.3g} is positive, so there is one solution"
    elif search.full:
        searched += f"; stopped at {search.limit} solutions"
    if search.stopped:
        searched += f"; {search.stopped}"
    return SolutionSet(search.sorted(), proved, np.inf, search.starts, searched, search.interrupted)


def _enumerated(search: SolutionSearch, chain: Chain) -> Generator[SearchProgress, bool | None, SolutionSet]:
    """All combinations of pieces and kinks."""
    count = f"{chain.combinations:.0f} combinations"
    with search.stopped_cleanly():
        points = enumerate_points(chain, search.budget.check)
        yield from search.working(search.from_candidates(points.candidates))
    if search.stopped:
        searched = f"not all of the {count} were tried; {search.stopped}"
        return SolutionSet(search.sorted(), False, chain.combinations, 0, searched, search.interrupted)
    undecided = search.left_out + points.undecided
    law = search.system.law
    sampled = not (law.proof("alpha").sure and law.proof("growth").sure)
    limit = search.system.problem.limit
    complete = not (points.continuum or search.full_and_more or undecided or sampled or limit)
    searched = f"all {count} of pieces and kinks were tried"
    if limit:
        searched += f"; the body is {limit}"
    if points.continuum:
        searched += "; there is a continuum of solutions, of which some are listed"
    if undecided:
        searched += f"; rounding does not tell whether {undecided} of them hold other solutions"
    if sampled:
        searched += "; a law is known from samples only"
    if search.full_and_more:
        searched += f"; stopped at {search.limit} solutions"
    inaccurate = sum(solution.status is not Status.CONVERGED for solution in search.solutions)
    if inaccurate:
        searched += f"; {inaccurate} of the solutions meet the tolerance up to rounding only"
    return SolutionSet(search.sorted(), complete, chain.combinations, 0, searched)


def _affine(chain: Chain) -> bool:
    law = chain.system.law
    if not law.proof("alpha").sure:
        return False  # that its pieces are straight, and all of them, was only seen at samples
    used = np.arange(chain.kink.shape[1])[None, :] < chain.count[:, None]
    return bool((chain.affine | chain.kink)[used].all())
