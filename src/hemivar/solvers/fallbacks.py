"""Fallback methods: which are tried next where the one that was chosen fails, at most three, by how it ended."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType

from hemivar.discrete.problem import DiscreteProblem
from hemivar.solvers.base import Solver
from hemivar.solvers.choice import affordable
from hemivar.solvers.fixed_point import FixedPoint
from hemivar.solvers.load_stepping import LoadStepping
from hemivar.solvers.multigrid import NonsmoothMultigrid
from hemivar.solvers.newton import NonsmoothNewton
from hemivar.solvers.proximal_newton import ProximalNewton
from hemivar.solvers.semismooth import SemismoothNewton
from hemivar.solvers.solution import Solution
from hemivar.solvers.status import Status
from hemivar.solvers.truncated_newton import TruncatedNewton
from hemivar.systems.contact_moves import Search

__all__ = ["LOWER", "best_of", "others", "took_over"]

#: What is said of a state downhill from rest beside which there is one of less energy.
LOWER = "a state with lower energy exists, across a barrier; this one was found downhill from the unloaded state"


def others(first: Solver, ended: Status, problem: DiscreteProblem) -> Iterator[Solver]:
    """The methods to be tried after one that failed, in their order; none that refuses the problem.

    ``first``: the method that failed; ``ended``: how it did.
    """
    seen = [first]
    for makes in _NEXT.get(ended, ()):
        other = makes(first, problem)
        if other is not None and other not in seen and other.refuse(problem) is None:
            seen.append(other)
            yield other


def took_over(solution: Solution, failed: Sequence[Solution]) -> str:
    """The sentence of a result by a method that was tried after others."""
    return f"{solution.method} took over: {'; '.join(_ended(one) for one in failed)}"


def best_of(failed: Sequence[Solution]) -> Solution:
    """The result with the least residual of methods that have all failed; it names the others."""
    best = min(failed, key=lambda one: one.residual.relative)
    others = "; ".join(_ended(one) for one in failed if one is not best)
    return replace(best, remarks=(f"{best.method} came nearest: {others}", *best.remarks)) if others else best


def _ended(one: Solution) -> str:
    steps = f"{one.steps} step" + "s" * (one.steps != 1)
    return f"{one.method} ended {one.status.value} after {steps}, relative residual {one.residual.relative:.1e}"


def _frozen(solver: Solver, problem: DiscreteProblem) -> Solver | None:
    """The bound of the law frozen in each step, from the start on."""
    return solver.fallback if isinstance(solver, SemismoothNewton) else None


def _relaxed(solver: Solver, problem: DiscreteProblem) -> Solver | None:
    """The fixed point in smaller steps."""
    fixed = solver.fallback if isinstance(solver, SemismoothNewton) else solver
    return replace(fixed, relaxation=0.3, max_outer=200) if isinstance(fixed, FixedPoint) else None


def _careful(solver: Solver, problem: DiscreteProblem) -> Solver | None:
    """The method, which crosses no barrier of the energy."""
    return solver.local_descent()


def _across(solver: Solver, problem: DiscreteProblem) -> Solver | None:
    """The method, which crosses barriers of the energy: what a walk downhill has lost may lie beyond one."""
    match solver:
        case TruncatedNewton():
            return replace(solver, search=Search.GLOBAL)
        case FixedPoint() | ProximalNewton():
            inner = _across(solver.inner, problem)
            return None if inner is None else replace(solver, inner=inner)
    return None


def _stepped(solver: Solver, problem: DiscreteProblem) -> Solver | None:
    """The method downhill, while the load grows."""
    return LoadStepping(solver.local_descent())


def _elsewhere(solver: Solver, problem: DiscreteProblem) -> Solver | None:
    """The method on all unknowns in the place of the condensed body, or the other way round."""
    match solver:
        case NonsmoothNewton():
            return NonsmoothMultigrid(search=solver.search)
        case NonsmoothMultigrid():
            return NonsmoothNewton(search=solver.search) if affordable(problem) else None
        case FixedPoint() | ProximalNewton():
            inner = _elsewhere(solver.inner, problem)
            return None if inner is None else replace(solver, inner=inner)
        case SemismoothNewton():
            fallback = _elsewhere(solver.fallback, problem)
            return replace(solver, fallback=fallback) if isinstance(fallback, FixedPoint) else None
    return None


def _without_pressure(solver: Solver, problem: DiscreteProblem) -> Solver | None:
    """The method on other unknowns, where friction holds a body only once there is pressure: a way may have lost it."""
    return _elsewhere(solver, problem) if problem.law.state_dependent else None


#: What is tried after each end, first to last.
_NEXT: Mapping[Status, tuple[Callable[[Solver, DiscreteProblem], Solver | None], ...]] = MappingProxyType(
    {
        Status.STALLED: (_frozen, _elsewhere, _stepped),
        Status.MAX_STEPS: (_elsewhere, _frozen, _stepped),
        Status.INACCURATE: (_elsewhere, _stepped),
        Status.CYCLING: (_elsewhere, _stepped),
        Status.NOT_CONTRACTING: (_relaxed, _stepped, _elsewhere),
        Status.AT_LIMIT: (_frozen, _elsewhere, _stepped),
        Status.NONFINITE: (_careful, _elsewhere, _stepped),
        Status.UNBOUNDED: (_without_pressure, _careful, _across, _stepped, _elsewhere),
    }
)
