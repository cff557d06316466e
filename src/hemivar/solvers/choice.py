"""The default method: which one solves a problem by predicted time and memory if the user names none."""

from __future__ import annotations

import math

from hemivar.discrete.contact import selects
from hemivar.discrete.problem import DiscreteProblem
from hemivar.fem.hierarchy import has_coarser
from hemivar.laws.vector_law import softens as law_softens
from hemivar.linear.factor_memory import available_bytes, factorisation_bytes
from hemivar.solvers.base import Solver
from hemivar.solvers.multigrid import NonsmoothMultigrid
from hemivar.solvers.newton import NonsmoothNewton

__all__ = ["affordable", "choose", "predicted_seconds", "repaid"]

#: Seconds that :class:`NonsmoothNewton` may take before multigrid is considered: where what it sets up serves many
#: loads, and for laws that are not convex.
_SERVES, _PATIENCE = 0.6, 6.0
#: Seconds that it may take where another method has failed.
_AFFORDABLE = 60.0
#: Bytes that are always there, 16 MiB: to look takes longer than to solve such a problem.
_LITTLE = 2.0**24
#: Part of the free memory that a factorisation may take.
_SHARE = 0.7


def predicted_seconds(problem: DiscreteProblem) -> tuple[float, float]:
    """What :class:`NonsmoothNewton` and :class:`NonsmoothMultigrid` take, roughly.

    Fitted to one core of 2026 and linear elements (``benchmarks/crossover.py``); only their ratio and their order of
    magnitude matter.  Where no coarser mesh is known, multigrid sets up algebraic levels and takes more steps; it takes
    more where two bodies touch as well.
    """
    n, dense = float(problem.unknowns), 5e-10 * float(problem.contact.trace.nnz) ** 3
    unknown, bodies = not has_coarser(problem), 1.25 if problem.contact.pairs else 1.0
    if _dimension(problem) == 3:
        levels = 0.012 + 4e-4 * math.sqrt(n) + (1.5e-6 + 8e-6 * unknown) * n
        return 0.005 + 7e-9 * n**2 + dense, bodies * levels
    levels = 0.012 + 2.5e-4 * math.sqrt(n) + (9e-7 + 3.6e-6 * unknown) * n
    return 0.005 + 2.6e-7 * n**1.31 + dense, bodies * levels


def _dimension(problem: DiscreteProblem) -> int:
    """That of the mesh, which the cost of a factorisation follows; without one, the number of local components."""
    return problem.contact.components if problem.field is None else problem.field.mesh.dim


def _shortage(problem: DiscreteProblem) -> str | None:
    """Why the memory does not suffice for a factorisation, in words; None where it does."""
    needed = factorisation_bytes(problem.unknowns, _dimension(problem), problem.contact.trace.nnz)
    free = available_bytes() if needed > _LITTLE else None
    if free is None or needed <= _SHARE * free:
        return None
    return f"a factorisation would need about {needed / 2**30:.2g} GiB, free are {free / 2**30:.2g} GiB"


def affordable(problem: DiscreteProblem) -> bool:
    """Whether :class:`NonsmoothNewton` has the memory it needs, and is expected to take no longer than a minute."""
    return predicted_seconds(problem)[0] <= _AFFORDABLE and _shortage(problem) is None


def repaid(problem: DiscreteProblem, solves: int) -> bool:
    """Whether :class:`NonsmoothNewton` would have set itself up in the time that multigrid took for so many solves."""
    newton, multigrid = predicted_seconds(problem)
    return solves * multigrid >= newton and affordable(problem) and selects(problem.contact.trace)


def choose(problem: DiscreteProblem, many: bool = False) -> tuple[Solver, str]:
    """The method with its standard options, and why, in words, under the names of ``hemivar.solvers.METHODS``.

    :class:`NonsmoothNewton` where it takes no longer than multigrid, and has the memory it needs.  Where ``many`` loads
    follow it may take a moment, for what it sets up serves all of them; for laws that are not convex it is preferred a
    while longer, for it looks further for a lower energy.
    """
    newton, multigrid = predicted_seconds(problem)
    short = _shortage(problem)
    softens = problem.contact_points > 0 and law_softens(problem.law)
    direct, levels = NonsmoothNewton.name, NonsmoothMultigrid.name
    size = f"{problem.unknowns} unknowns"
    costs = f"predicted: {direct} {newton:.2g} s, {levels} {multigrid:.2g} s"
    if not selects(problem.contact.trace):
        return NonsmoothNewton(), f"{direct} for {size}, for contact points share displacements"
    if short is not None:
        return NonsmoothMultigrid(), f"{levels} for {size}: {short}"
    if newton <= max(multigrid, _PATIENCE if softens else _SERVES if many else 0.0):
        return NonsmoothNewton(), f"{direct} for {size}; {costs}"
    return NonsmoothMultigrid(), f"{levels} for {size}; {costs}"
