"""Path following: the equilibria of a body while its load grows, through folds."""

from __future__ import annotations

import numpy as np

from hemivar.basics.arguments import expect, number, whole_number
from hemivar.basics.deadline import Budget, limited
from hemivar.basics.types import Array
from hemivar.branches.chain import Chain, chain_of
from hemivar.branches.follower import Follower, Track
from hemivar.branches.path import Fold, Jump, Path, PathEnd
from hemivar.discrete.problem import DiscreteProblem
from hemivar.errors import MethodError, ProblemError
from hemivar.fem import LoadLine
from hemivar.fem.posed import posed
from hemivar.mechanics.statement import ContactProblem
from hemivar.solvers import Controls, LoadStepping, Solution, Status, solve
from hemivar.systems import CondensedProblem
from hemivar.systems.workspace import Workspace

__all__ = ["follow_path"]


def follow_path(
    problem: DiscreteProblem | ContactProblem,
    load_factor: tuple[float, float] = (0.0, 1.0),
    *,
    unloaded: DiscreteProblem | None = None,
    start: Solution | Array | None = None,
    max_points: int = 2000,
    largest_step: float = 0.02,
    max_time: float = np.inf,
    workspace: Workspace | None = None,
) -> Path:
    """Follow the equilibria from the lower load factor, through folds, until the range is left.

    The graph of the law is taken as a curve with a parameter of its own, so that kinks and jumps are corners of the
    path like all others.  Where all laws are piecewise quadratic the path is a polygon, and it is followed exactly,
    from one corner to the next; on curved pieces by predictor and corrector in the arc length.

    Parameters
    ----------
    problem : DiscreteProblem
        The problem at load factor 1, in one or two dimensions.
    load_factor : (float, float)
        Range; the path starts at the first one.
    unloaded : DiscreteProblem, optional
        The problem at load factor 0; by default ``problem`` with its load taken away (see :class:`LoadLine`).
    start : Solution or array (n,), optional
        Equilibrium near the lower end; by default load stepping from the unloaded body.
    max_points : int
        Limit of points.
    largest_step : float
        Largest step on curved pieces, relative to the range and to a typical displacement.
    max_time : float
        Limit in seconds; the path then ends where it is, and says so.
    workspace : Workspace, optional
        Keeps what is expensive for other calls on the same body.

    Raises
    ------
    MethodError
        The slip is a vector (3D), or a bound depends on the solution.
    ProblemError
        The range is empty, or no equilibrium was found at its lower end.
    """
    problem = posed(problem, "follow_path")
    if unloaded is not None:
        expect(unloaded, DiscreteProblem, "the unloaded problem", "discretise it first, hemivar.discretize(problem)")
    kept = (
        Workspace()
        if workspace is None
        else expect(workspace, Workspace, "the workspace", "make one, hemivar.Workspace(), and pass it to every call")
    )
    try:
        low, high = (number(end, "a load factor") for end in load_factor)
    except (TypeError, ValueError) as error:
        if isinstance(error, ProblemError):
            raise
        raise ProblemError("the load factors are no pair; give a range such as (0.0, 1.0)") from None
    whole_number(max_points, "max_points", 2)
    number(largest_step, "largest_step")
    if not (np.isfinite(low) and np.isfinite(high) and low < high):
        raise ProblemError(f"the load factors are {low:g} and {high:g}; give a finite range, the lower one first")
    if not largest_step > 0.0:
        raise ProblemError(f"largest_step is {largest_step}; it must be positive")
    if problem.contact_points == 0:
        raise ProblemError("a path needs contact points; without contact the solution is proportional to the load")
    if problem.law.state_dependent:
        raise MethodError("path following needs a friction bound that does not depend on the solution")
    budget = Budget(max_time)
    line = LoadLine(problem, unloaded)
    system = kept.condensed(problem)
    chain: Chain = chain_of(system)
    if chain.size == 0:
        raise ProblemError("the supports hold every contact point, so that no path starts; free some of them")
    # A little above the lower end all components are on definite sides of their kinks, which they may not be at rest.
    first = low + 1e-4 * (high - low)
    at_start = line.at(first)
    guess = start.unknowns if isinstance(start, Solution) else start
    begun = solve(
        at_start,
        LoadStepping(steps=10 if low > 0.0 else 1) if guess is None else LoadStepping(steps=1).inner,
        Controls(rtol=1e-11, max_time=budget.left),
        initial=guess,
        workspace=kept,
    )
    if begun.status is Status.INTERRUPTED:
        raise KeyboardInterrupt
    force0 = _chain_force(system, chain, line, 0.0)
    force1 = _chain_force(system, chain, line, 1.0) - force0
    theta, segment = chain.nearest(begun.local, begun.multiplier)
    perturbation = np.zeros(chain.size)
    follower: Follower | None = None
    for attempt in range(2):
        follower = Follower(chain, force0 + perturbation, force1, low, high, max_points, largest_step)
        corrected = chain.correct(theta, segment, follower.force(first))
        if corrected is None or not chain.inside(corrected, segment, 1e-7 * chain.length).all():
            raise ProblemError(
                f"no equilibrium was found at load factor {first:g} ({begun.status.value}); give another start"
            )
        with limited(budget):
            back = follower.run(corrected, segment, first, -1.0)
            forth = follower.run(corrected, segment, first, 1.0)
        if not follower.ties or attempt or follower.stopped:
            break
        size = float(np.abs(force0 + force1).max()) or float(np.abs(force1).max())
        perturbation = 1e-9 * size * np.cos(1.0 + np.arange(chain.size) ** 1.7)
    assert follower is not None
    turned = back.reversed().joined(forth)
    if follower.stopped is PathEnd.INTERRUPTED and not turned.segment:
        raise KeyboardInterrupt
    if follower.stopped and not turned.segment:
        raise ProblemError(f"the time limit of {max_time:g} s was reached before the path left its first point")
    if perturbation.any():
        _unperturb(turned, Follower(chain, force0, force1, low, high, max_points, largest_step))
    return _assemble(line, chain, turned, follower, bool(perturbation.any()))


def _chain_force(system: CondensedProblem, chain: Chain, line: LoadLine, factor: float) -> Array:
    """g on the free components at a load factor."""
    return np.asarray(system.for_problem(line.at(factor)).force[system.free])


def _unperturb(track: Track, follower: Follower) -> None:
    """Move the corners of a path that was followed for a perturbed load to where they are for the load itself."""
    for i, event in enumerate(track.event):
        if event is None:
            continue
        goal = track.t[i] if event.component is None else float(track.theta[i][event.component])
        found = follower.solve(track.theta[i], event.segment, track.t[i], event.component, goal)
        if found is not None and np.abs(found[0] - track.theta[i]).max() <= 1e-6 * follower.chain.length:
            track.theta[i], track.t[i] = found


def _assemble(line: LoadLine, chain: Chain, track: Track, follower: Follower, perturbed: bool) -> Path:
    system = chain.system
    t = np.array(track.t)
    segments = [track.segment[max(i - 1, 0)] for i in range(t.size)] if track.segment else []
    if not segments:
        raise ProblemError("the path ends where it begins; give another start or range")
    pairs = [chain.local(theta, segment) for theta, segment in zip(track.theta, segments, strict=True)]
    local, multiplier = np.array([p[0] for p in pairs]), np.array([p[1] for p in pairs])
    # The constant part of the energy is quadratic in the load factor, force and held displacements are linear.
    systems = [system.for_problem(line.at(factor)) for factor in (0.0, 0.5, 1.0)]
    constants = [s.constant for s in systems]
    curve = np.polyfit([0.0, 0.5, 1.0], constants, 2)
    energy = np.empty(t.size)
    held = ~system.active
    for i, factor in enumerate(t):
        fixed = (1.0 - factor) * systems[0].fixed + factor * systems[2].fixed
        local[i][held] = fixed[held]
        x = local[i].ravel()
        force = (1.0 - factor) * systems[0].force + factor * systems[2].force
        answer = float(system.weights @ system.law.value(local[i]))
        energy[i] = 0.5 * x @ (system.matrix @ x) - force @ x + answer + np.polyval(curve, factor)
    folds = tuple(Fold(float(t[i]), i) for i in range(1, t.size - 1) if track.fold[i])
    return Path(
        line=line,
        load_factor=t,
        local=local,
        multiplier=multiplier,
        energy=energy,
        stable=np.array(track.stable, dtype=bool),
        curved=np.array(track.curved, dtype=bool),
        folds=folds,
        jumps=_jumps(t, local, track.stable),
        ended=track.ended,
        perturbed=perturbed,
    )


def _jumps(t: Array, local: Array, stable: list[bool]) -> tuple[Jump, ...]:
    """Where stability is lost while the load goes up, or down, and where the next stable stretch at that load is."""
    jumps: list[Jump] = []
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
        for k in stretches:
            if stable[k] and (t[k] - t[i]) * (t[k + 1] - t[i]) <= 0.0 and t[k] != t[k + 1]:
                part = (t[i] - t[k]) / (t[k + 1] - t[k])
                landing = local[k] + part * (local[k + 1] - local[k])
                break
        jumps.append(Jump(float(t[i]), i, loading, landing))
    return tuple(jumps)
