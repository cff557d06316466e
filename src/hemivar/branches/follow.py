"""Path following (numerical continuation): the equilibria of a body while its load grows, through folds."""

from __future__ import annotations

import itertools
from collections.abc import Generator, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from hemivar.basics.arguments import expect, number, whole_number
from hemivar.basics.deadline import Budget
from hemivar.basics.generators import result_of
from hemivar.basics.known_keywords import known_keywords, showing_options
from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.branches.follower import Follower, PathProgress, Quantity, Track
from hemivar.branches.graph_chart import GraphChart, chart_of
from hemivar.branches.graph_follower import GraphFollower, OutOfChartError
from hemivar.branches.nonlinear_follower import NonlinearFollower, tangent_body
from hemivar.branches.path import SAME_LOAD, Bifurcation, Fold, Path, PathEnd, PathJump
from hemivar.branches.path_quantities import PathQuantity, checked_until, quantity_on
from hemivar.discrete.contact import ContactPoints
from hemivar.discrete.model import quadratic
from hemivar.discrete.potential import Potential
from hemivar.discrete.problem import DiscreteProblem
from hemivar.errors import MethodError, ProblemError
from hemivar.fem import LoadLine, deformation
from hemivar.fem.as_discrete import ProblemLike
from hemivar.fem.growing import growing
from hemivar.fem.load_line import load_names
from hemivar.laws.vector_law import splits
from hemivar.solvers import Controls, LoadStepping, Solution, Solver, solve
from hemivar.solvers.status import check_interrupt
from hemivar.systems import CondensedProblem, condense
from hemivar.systems.chain import Chain, chain_of
from hemivar.systems.curves import Curves
from hemivar.systems.workspace import Workspace

__all__ = ["PathOptions", "follow_path", "following"]


#: Part of the range of loads at which a path begins, where all components are off their kinks. 1e-3 and 1e-5 give the
#: same paths in tests/branches.
_FIRST = 1e-4
#: Charts that are tried: each is more than six times as stiff as the last where that failed. 4 and 16 give the same
#: paths in tests/branches.
_CHARTS = 8


@dataclass(frozen=True)
class PathOptions:
    """How far to follow; see :func:`follow_path`.

    Parameters
    ----------
    load_factor : tuple of two floats
        Where the path begins and ends.
    max_points : int
        Limit of the points.
    max_time : float
        Limit in seconds; the path then ends where it is, and says so.
    largest_step : float
        Largest step on curved pieces, relative to the range and to a typical displacement at its largest load, or that
        reached so far if it is larger.
    until : mapping of name to value
        The path ends where one of these quantities passes its value, such as ``{"max-opening": 0.1}``.  Names are those
        of ``hemivar path --quantity``; ``{"opening:tip": 0.1}`` is the largest opening on the contact boundary ``tip``.
        A value that is passed twice within one step is not seen.
    constant : sequence of names
        Loads that do not grow, such as the own weight: ``"body"`` and names of boundaries with a traction.

    Raises
    ------
    ProblemError
        The range is empty, or a number makes no sense.
    """

    load_factor: tuple[float, float] = (0.0, 1.0)
    max_points: int = 2000
    max_time: float = np.inf
    largest_step: float = 0.02
    until: Mapping[str, float] = field(default_factory=dict)
    constant: Sequence[str] = ()

    def __post_init__(self) -> None:
        ends = tuple(self.load_factor) if isinstance(self.load_factor, Iterable) else ()
        if len(ends) != 2:
            raise ProblemError("load_factor must be a pair (low, high), such as (0.0, 1.0)")
        low, high = (number(end, "a load factor") for end in ends)
        if not (np.isfinite(low) and np.isfinite(high) and low < high):
            raise ProblemError(f"the load factors are {low:g} and {high:g}; give a finite range, the lower one first")
        whole_number(self.max_points, "max_points", 2)
        if not number(self.largest_step, "largest_step") > 0.0:
            raise ProblemError(f"largest_step is {self.largest_step}; it must be positive")
        checked_until(self.until)
        object.__setattr__(self, "constant", load_names(self.constant))

    def ends(self, contact: ContactPoints) -> tuple[Quantity, ...]:
        """Numbers that are zero where the path ends."""
        chosen = ((*quantity_on(name, contact), value) for name, value in self.until.items())
        return tuple(_beyond(quantity, points, contact.weights[points], value) for quantity, points, value in chosen)


def _beyond(quantity: PathQuantity, points: IntArray, weights: Array, value: float) -> Quantity:
    return lambda r, lam: float(quantity.evaluate(weights, r[None, points], lam[None, points])[0]) - value


@known_keywords
@showing_options(PathOptions)
def follow_path(
    problem: ProblemLike,
    load_factor: tuple[float, float] = PathOptions.load_factor,
    *,
    unloaded: DiscreteProblem | None = None,
    start: Solution | Array | None = None,
    workspace: Workspace | None = None,
    **options: object,
) -> Path:
    """Follow the equilibria of a body while its load grows, also where it must fall again (folds).

    >>> import hemivar as hv
    >>> law = hv.laws.ContactLaw(hv.Softening(stiffness=2.0, limit=0.1, softening=0.9)).at(None)
    >>> spring = hv.DiscreteProblem.of_arrays([[0.5]], [0.225], [[1.0]], [1.0], [0.0], law)
    >>> path = hv.follow_path(spring, (0.0, 2.0))
    >>> [round(fold.load_factor, 3) for fold in path.folds]
    [1.111, 0.716]

    The load factor multiplies loads and prescribed displacements.  The path starts at the first factor of the range and
    ends where it leaves the range.  Where all laws are piecewise quadratic it is a polygon, which is followed exactly
    from corner to corner.  Curved pieces are followed by predictor and corrector in the arc length.

    Parameters
    ----------
    problem : DiscreteProblem
        The problem at load factor 1.
    load_factor : (float, float)
        Range; the path starts at the first one.
    unloaded : DiscreteProblem, optional
        The problem at load factor 0; by default ``problem`` without its loads but the constant ones, and without its
        prescribed displacements (see :class:`LoadLine`).
    start : Solution or array (n,), optional
        Equilibrium near the lower end; by default load stepping from the unloaded body.
    workspace : Workspace, optional
        Keeps what is expensive for other calls on the same body.
    **options

    Returns
    -------
    Path

    Raises
    ------
    MethodError
        A law falls at once, in space, coupled, beside a bound that depends on the solution, or in a nonlinear body.
    ProblemError
        The range is empty, nothing grows, no equilibrium was found at its lower end, or ``until`` names nothing known.
    """
    given = PathOptions(load_factor, **options)  # type: ignore[arg-type]
    return result_of(following(problem, given, unloaded=unloaded, start=start, workspace=workspace))


def following(
    problem: ProblemLike,
    options: PathOptions,
    *,
    unloaded: DiscreteProblem | None = None,
    start: Solution | Array | None = None,
    workspace: Workspace | None = None,
) -> Generator[PathProgress, bool | None, Path]:
    """:func:`follow_path` point by point: yields every point, ends after it if it is sent True, returns the path."""
    line = growing(problem, "follow_path", options.constant)
    problem = line.loaded
    nonlinear = isinstance(problem.bulk, Potential)
    if not nonlinear:
        quadratic(problem.bulk, "follow_path")
    if unloaded is not None:
        expect(unloaded, DiscreteProblem, "the unloaded problem", "discretise it first, hemivar.discretize(problem)")
        if options.constant:
            raise ProblemError("give either unloaded= or constant=: both say what the load factor 0 is")
        line = LoadLine(problem, unloaded)
    line.check_grows()
    kept = Workspace.given(workspace)
    low, high = options.load_factor
    if problem.contact_points == 0:
        raise ProblemError(
            "a path needs contact points; solve once, because without contact the solution is proportional to the load"
        )
    budget = Budget(options.max_time)
    largest = line.at(max(low, high, key=abs))  # by whose displacements steps are measured
    if nonlinear:
        system = condense(tangent_body(largest, np.zeros(problem.unknowns)))
    else:
        system = kept.condensed(problem).for_problem(largest)
    if not system.active.any():
        raise ProblemError("the supports constrain every contact point, so the path has no start; free some of them")
    # A little above the lower end all components are on definite sides of their kinks, which they may not be at rest.
    first = low + _FIRST * (high - low)
    at_start = line.at(first)
    guess = start.unknowns if isinstance(start, Solution) else start
    equilibrium = solve(
        at_start,
        _starting(problem, low, guess is not None),
        Controls(rtol=1e-11, max_time=budget.left),
        initial=guess,
        workspace=kept,
    )
    check_interrupt(equilibrium.status)
    chain = chart_of(system, equilibrium.local, equilibrium.multiplier) if nonlinear else _curves(system, equilibrium)
    for _ in range(_CHARTS):
        try:
            return (yield from _followed(line, chain, equilibrium, options, budget))
        except OutOfChartError as left:
            assert isinstance(chain, GraphChart)
            chain = chart_of(system, *left.pair, chain)
    raise MethodError(
        "the drop of friction with the slip steepens without limit as the pressure grows; use a shorter range"
    )


def _followed(
    line: LoadLine, chain: Curves, equilibrium: Solution, options: PathOptions, budget: Budget
) -> Generator[PathProgress, bool | None, Path]:
    """The path on some curves, from the first solution."""
    system, (low, high) = chain.system, options.load_factor
    first = low + _FIRST * (high - low)
    theta, segment = chain.nearest(equilibrium.local, equilibrium.multiplier)
    perturbation = np.zeros(chain.size)
    for attempt in range(2):
        follower = _follower(line, chain, equilibrium, options, perturbation, budget)
        corrected = follower.at_the_load(theta, segment, first)
        if corrected is None or not chain.inside(corrected, segment, 1e-7 * chain.length).all():
            raise ProblemError(
                f"no equilibrium was found at load factor {first:g} ({equilibrium.status.value}); give another start"
            )
        back = yield from follower.running(corrected, segment, first, -1.0)
        follower.until = options.ends(system.problem.contact)
        forth = yield from follower.running(corrected, segment, first, 1.0)
        if not follower.ties or attempt or follower.stopped:
            break
        size = follower.force_size
        perturbation = 1e-9 * size * np.cos(1.0 + np.arange(chain.size) ** 1.7)
    track = back.reversed().joined(forth)
    if follower.stopped is PathEnd.INTERRUPTED and not track.stretches:
        raise KeyboardInterrupt
    if follower.stopped and not track.stretches:
        raise ProblemError(
            f"the time limit of {options.max_time:g} s was reached before the path left its first point; give more time"
        )
    if perturbation.any():
        _unperturb(track, _follower(line, chain, equilibrium, options, np.zeros(chain.size), budget))
    return _assemble(line, follower, track, bool(perturbation.any()))


def _follower(
    line: LoadLine, chain: Curves, equilibrium: Solution, options: PathOptions, perturbation: Array, budget: Budget
) -> Follower:
    """What follows a path on these curves, under a force (n,) besides the load."""
    force0, force1 = (chain.load_of(chain.system.for_problem(line.at(t))) for t in (0.0, 1.0))
    force1 = force1 - force0
    limits = *options.load_factor, options.max_points, options.largest_step, budget
    if isinstance(chain, Chain):
        return Follower(chain, force0 + perturbation, force1, *limits)
    assert isinstance(chain, GraphChart)
    if isinstance(line.loaded.bulk, Potential):
        return NonlinearFollower(chain, perturbation, force1, *limits, line=line, start=equilibrium.unknowns)
    return GraphFollower(chain, force0 + perturbation, force1, *limits)


def _starting(problem: DiscreteProblem, low: float, near: bool) -> Solver | None:
    """The method for the first point of a path, ``near`` a guess or not; None for that of the problem."""
    if problem.law.state_dependent or isinstance(problem.bulk, Potential):
        return None
    return LoadStepping(steps=1).inner if near else LoadStepping(steps=10 if low > 0.0 else 1)


def _curves(system: CondensedProblem, equilibrium: Solution) -> Chain | GraphChart:
    """The graphs of the laws: scalar curves, exact to rounding and with falls, where opening and slip are apart."""
    law = system.law
    if splits(law) and not law.state_dependent and system.shape[1] <= 2:
        return chain_of(system)
    return chart_of(system, equilibrium.local, equilibrium.multiplier)


def _unperturb(track: Track, follower: Follower) -> None:
    """Move the corners of a path that was followed for a perturbed load to where they are for the load itself."""
    for point in track.points:
        event = point.event
        if event is None:
            continue
        goal = point.t if event.of_load else float(event.border[:-1] @ point.theta)
        corner = follower.solve(point.theta, event.segment, point.t, event.border, goal)
        if corner is not None and np.abs(corner[0] - point.theta).max() <= 1e-6 * follower.chain.length:
            point.theta, point.t = corner


def _assemble(line: LoadLine, follower: Follower, track: Track, perturbed: bool) -> Path:
    chain, system = follower.chain, follower.chain.system
    if not track.stretches:
        raise ProblemError(f"the path ends at its first point ({track.ended}); give another start or range")
    t = track.load_factors
    stable = [stretch.stable for stretch in track.stretches]
    segments = [stretch.segment for stretch in (track.stretches[0], *track.stretches)]
    local, multiplier = chain.every_local([point.theta for point in track.points], segments)
    fixed, ends = ~system.active, [system.for_problem(line.at(factor)).fixed for factor in (0.0, 1.0)]
    for i, factor in enumerate(t):
        local[i][fixed] = ((1.0 - factor) * ends[0] + factor * ends[1])[fixed]
    snaps, snap_size = _snaps(follower, track)
    folds = tuple(Fold(float(t[i]), i, bool(snaps[i])) for i in range(1, t.size - 1) if track.points[i].fold)
    return Path(
        line=line,
        load_factor=t,
        local=local,
        multiplier=multiplier,
        energy=_energies(line, follower, t, local, multiplier),
        stable=np.array(stable, dtype=bool),
        curved=np.array([stretch.curved for stretch in track.stretches], dtype=bool),
        folds=folds,
        jumps=tuple(replace(jump, snaps=bool(snaps[jump.index])) for jump in _jumps(follower, track, local)),
        bifurcations=_bifurcations(track),
        ended=track.ended,
        perturbed=perturbed,
        snap_size=snap_size,
        warnings=(
            *line.loaded.notes,
            *_strained(line, follower, t, local, multiplier),
            *(_process_zone(local, multiplier) if snap_size != 0.0 else ()),  # 0: laws that drop have none
        ),
    )


def _energies(line: LoadLine, follower: Follower, t: Array, local: Array, multiplier: Array) -> Array:
    """E(u) at points (k,) of a path; nan where a law depends on the state."""
    system = follower.chain.system
    if system.law.state_dependent:
        return np.full(t.size, np.nan)
    if isinstance(follower, NonlinearFollower):
        return np.array([line.at(s).energy(follower.unknowns(r, s)) for s, r in zip(t, local, strict=True)])
    # The constant part is quadratic in the load factor, force and held displacements are linear.
    systems = [system.for_problem(line.at(factor)) for factor in (0.0, 0.5, 1.0)]
    constant = np.polyval(np.polyfit([0.0, 0.5, 1.0], [s.constant for s in systems], 2), t)
    x = local.reshape(t.size, -1)
    forces = (1.0 - t)[:, None] * systems[0].load + t[:, None] * systems[2].load
    answer = np.array([system.weights @ system.law.value(r) for r in local])
    return np.asarray(0.5 * (x * (x @ system.matrix)).sum(axis=1) - (forces * x).sum(axis=1) + answer + constant)


def _bifurcations(track: Track) -> tuple[Bifurcation, ...]:
    """Where falling directions come or go by another number than that of the folds there."""
    t = track.load_factors
    moves = np.flatnonzero(np.abs(np.diff(t)) > SAME_LOAD * np.ptp(t))
    bifurcations = []
    for before, after in itertools.pairwise(moves):
        came = abs(track.stretches[after].negative - track.stretches[before].negative)
        turned = (t[before + 1] - t[before]) * (t[after + 1] - t[after]) < 0.0
        if came > int(turned):
            bifurcations.append(Bifurcation(float(t[after]), int(after)))
    return tuple(bifurcations)


def _snaps(follower: Follower, track: Track) -> tuple[BoolArray, float | None]:
    """Points (k,) of a path beside which one contact point lets go alone; and the size of facets at which none does.

    A component lets go alone where its law falls by more than the stiffness of the body with all others held: on an
    unstable stretch on which the Hessian has a negative diagonal entry, or a law jumps down.
    """
    alone, steepest = np.zeros(len(track.stretches), dtype=bool), 0.0
    for i, stretch in enumerate(track.stretches):
        if stretch.stable:
            continue
        before, after = track.points[i], track.points[i + 1]
        middle = 0.5 * (before.theta + after.theta)
        chain = follower.body_at(middle, 0.5 * (before.t + after.t))[0]
        fall = chain.falls_beside(middle, stretch.segment)
        alone[i] = (chain.weights * fall > 1.0).any()
        steepest = max(steepest, float(fall[chain.weights * fall > 1.0].max(initial=0.0)))
    beside = np.concatenate([[False], alone]) | np.concatenate([alone, [False]])
    return beside, 1.0 / steepest if alone.any() else None


def _process_zone(local: Array, multiplier: Array) -> tuple[str, ...]:
    """That less than three points soften at a time on a path (k, m, d) on which some of many points break.

    A point softens, or is broken, while it is farther from rest than ever before and bears less than it has.
    """
    size = np.linalg.norm(multiplier, axis=2)
    least = 1e-6 * size.max()
    distance = np.linalg.norm(local * (np.abs(multiplier) > least).any(axis=0), axis=2)  # of what bears
    farthest = distance >= (1.0 - 1e-9) * np.maximum.accumulate(distance, axis=0)
    weaker, none = farthest & (size < np.maximum.accumulate(size, axis=0) - least), size <= least
    most, beside = int((weaker & ~none).sum(axis=1).max()), weaker.any(axis=0)
    if most > 2 or len(beside) < 10 or beside.all() or not (weaker & none).any():
        return ()
    return (
        f"at most {most} contact point{'s' * (most != 1)} soften{'s' * (most == 1)} at a time, so the loads at which "
        "points break depend on the mesh and may be several per cent too large: make the cells of the contact smaller, "
        "until three soften",
    )


def _strained(line: LoadLine, follower: Follower, t: Array, local: Array, multiplier: Array) -> tuple[str, ...]:
    """That strains or rotations are large at the points of a path where that is to be expected first, if so."""
    stated, end = line.loaded.origin, line.loaded.field
    if stated is None or stated.kind or end is None:
        return ()
    nothing = np.zeros(line.loaded.unknowns)
    moved = end.full(nothing)  # prescribed displacements, which grow with the load
    if line.unloaded is not None and line.unloaded.field is not None:
        moved = moved - line.unloaded.field.full(nothing)
    size = np.linalg.norm(local.reshape(t.size, -1), axis=1)
    worst, warning = 0.0, ""
    for i in sorted({int(np.argmax(np.abs(t))), int(np.argmax(size)), t.size - 1}):
        u = _unknowns(line, follower, float(t[i]), local[i], multiplier[i])
        deformed = deformation(stated, end.full(u) - (1.0 - t[i]) * moved)
        if deformed.warning is not None and max(deformed.strain, deformed.rotation) > worst:
            worst, warning = max(deformed.strain, deformed.rotation), f"at load factor {t[i]:.6g} {deformed.warning}"
    return (warning,) if warning else ()


def _unknowns(line: LoadLine, follower: Follower, t: float, r: Array, lam: Array) -> Array:
    """All unknowns (n,) of a point of a path."""
    if isinstance(follower, NonlinearFollower):
        return follower.unknowns(r, t)
    return follower.chain.system.for_problem(line.at(t)).recover(r, lam)[0]


def _jumps(follower: Follower, track: Track, local: Array) -> tuple[PathJump, ...]:
    """Where stability is lost while the load goes up, or down, and where the next stable stretch at that load is."""
    t = track.load_factors
    stable = [stretch.stable for stretch in track.stretches]
    jumps: list[PathJump] = []
    for i in range(1, t.size - 1):
        if stable[i - 1] == stable[i]:
            continue
        onward = stable[i - 1]  # the stable stretch comes before the point: the body arrives along the path
        # Points that met several events at once lie on top of each other: look back to one at another load.
        arrival = np.arange(i - 1, -1, -1) if onward else np.arange(i + 1, t.size)
        elsewhere = arrival[np.abs(t[arrival] - t[i]) > 1e-9 * (1.0 + abs(t[i]))]
        if elsewhere.size == 0:
            continue
        loading = bool(t[i] > t[elsewhere[0]])
        stretches = range(i + 1, t.size - 1) if onward else range(i - 2, -1, -1)
        landing: Array | None = None
        interpolated = False
        for k in stretches:
            if stable[k] and (t[k] - t[i]) * (t[k + 1] - t[i]) <= 0.0 and t[k] != t[k + 1]:
                part = (t[i] - t[k]) / (t[k + 1] - t[k])
                landing = local[k] + part * (local[k + 1] - local[k])
                if track.stretches[k].curved:
                    landing, interpolated = _landing(follower, track, k, part, float(t[i]), landing)
                break
        jumps.append(PathJump(float(t[i]), i, loading, landing, interpolated=interpolated))
    return tuple(jumps)


def _landing(follower: Follower, track: Track, k: int, part: float, t: float, between: Array) -> tuple[Array, bool]:
    """The solution (m, d) on a curved stretch, and False; if none is found the point ``between`` its ends, and True."""
    chain, segment = follower.chain, track.stretches[k].segment
    first, last = track.points[k].theta, track.points[k + 1].theta
    theta = follower.at_the_load(first + part * (last - first), segment, t)
    if theta is None or not chain.inside(theta, segment, 1e-7 * chain.length).all():
        return between, True
    return np.where(chain.system.active, chain.local(theta, segment)[0], between), False
