"""The last digits of a solution: iterative refinement on the pieces and kinks that it was found on."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from hemivar.basics.types import Array, IntArray
from hemivar.certificates.bound import trace_force
from hemivar.certificates.linear_bodies import at_tangent
from hemivar.discrete.bulk import Quadratic
from hemivar.discrete.model import quadratic
from hemivar.discrete.residual import Residual, residual
from hemivar.laws.vector_law import splits as law_splits
from hemivar.solvers import Controls, NonsmoothNewton, Search, Solution, solve
from hemivar.solvers.controls import Budget
from hemivar.solvers.solve import suited
from hemivar.solvers.status import check_interrupt
from hemivar.systems import CondensedProblem
from hemivar.systems.chain import Chain
from hemivar.systems.dense_newton import newton_matrix
from hemivar.systems.newton_equation import smooth_components
from hemivar.systems.workspace import Workspace

__all__ = ["Polished", "polish", "polish_by_solver"]

_EPS = float(np.finfo(float).eps)
#: Relative residual that is asked of a method at the end. 1e-12 and 1e-14 give the same solutions in tests/branches.
_TIGHT = 1e-13
#: Part of the load that rounding of the residual may reach before it hides the load. 1e-2 and 1e-4 give the same
#: solutions in tests/branches.
_HIDES = 1e-3


@dataclass(frozen=True, eq=False)
class Polished:
    """Unknowns (n,), multiplier (m, d) and their residual; ``rounding`` is what the arithmetic can leave in it."""

    unknowns: Array
    multiplier: Array
    residual: Residual
    rounding: float

    def solves(self, controls: Controls, more: float = 0.0) -> bool:
        """Whether the residual is below the tolerance, or no larger than rounding (``more`` of it from elsewhere).

        Not where rounding hides the load: a body that has run away excuses any residual.
        """
        if not np.isfinite(self.residual.total) or self.rounding > _HIDES * self.residual.scale:
            return False
        allowed = controls.atol + controls.rtol * self.residual.scale + self.residual.rounding + self.rounding + more
        return bool(self.residual.total <= allowed)


def polish(
    system: CondensedProblem, chain: Chain, r: Array, lam: Array, theta: Array, segment: IntArray, controls: Controls
) -> Polished:
    """All unknowns of a point of the graph, refined on the whole problem where the tolerance is not met at once."""
    problem = system.problem
    best = _best(system, system.recover(r, lam)[0], r, lam)
    for _ in range(3):
        if best.residual.below(controls.atol, 0.01 * controls.rtol) or chain.size == 0:
            break
        u, lam = best.unknowns, best.multiplier.copy()
        rest = problem.out_of_balance(u) - problem.contact_force(lam)
        inner, force = system.spread_force(rest, trace_force)
        _, J = chain.balance(theta, segment, chain.force)
        try:
            step = np.linalg.solve(J, force[chain.point, chain.column])
        except np.linalg.LinAlgError:
            break
        theta = theta + step
        _, on_graph, dr, dlam = chain.evaluate(theta, segment)
        change = np.zeros(system.shape)
        change[chain.point, chain.column] = dr * step
        moved = lam[chain.point, chain.column] + dlam * step
        lam[chain.point, chain.column] = np.where(dr == 0.0, moved, on_graph)
        new = _best(system, u + inner + system.follow(change), r + change, lam)
        if not new.residual.total < best.residual.total:
            break
        best = new
    return best


def _best(system: CondensedProblem, u: Array, r: Array, lam: Array) -> Polished:
    """The unknowns, or none where a body is not moved but by rounding, with the better one of two multipliers."""
    problem = system.problem
    nearest = np.where(system.active, system.law_at(r, lam).nearest_multiplier(r, lam), lam)
    bodies = [u]
    bulk = quadratic(problem.bulk, "refinement")
    if not np.any(problem.load):
        bodies.append(np.zeros_like(u))
    pairs = [(body, multiplier) for body in bodies for multiplier in (lam, nearest)]
    residuals = [residual(problem, *pair) for pair in pairs]
    # of equal ones, the element of the law itself
    order = sorted(range(len(pairs)), key=lambda i: (max(residuals[i].total - residuals[i].rounding, 0.0), -i))
    body, multiplier = pairs[order[0]]
    moved = bulk.row_sums * np.abs(body) + np.abs(problem.load) + np.abs(problem.contact_force(np.abs(multiplier)))
    return Polished(body, multiplier, residuals[order[0]], float(8.0 * _EPS * np.linalg.norm(moved)))


def _near(system: CondensedProblem, first: Solution, second: Solution) -> bool:
    """Whether two solutions are the same but for the tolerance: a method goes downhill from a saddle."""
    return bool(np.abs(first.local - second.local).max(initial=0.0) <= 1e-5 * system.length_scale)


def polish_by_solver(
    solution: Solution, system: CondensedProblem, workspace: Workspace, controls: Controls, budget: Budget
) -> tuple[Solution, Array]:
    """A solution, solved on from where it is as far as the arithmetic goes, and an estimate of its error (m, d).

    ``system`` is that of its problem; where its body is not linear, any one of the same contact points.
    """
    problem = solution.problem
    tight = replace(controls, rtol=min(_TIGHT, controls.rtol), atol=0.0, max_time=budget.left, callback=None)
    splits = law_splits(problem.law)
    onward = NonsmoothNewton() if splits else NonsmoothNewton(search=Search.DOWNHILL)  # not to a lower one elsewhere
    again = solve(problem, suited(onward, problem), tight, initial=solution, workspace=workspace)
    check_interrupt(again.status)
    if again.residual.total < solution.residual.total:
        better = replace(again, status=solution.status, method=solution.method)
        near = (isinstance(problem.bulk, Quadratic) and splits) or _near(system, better, solution)
        if near and better.residual.below(controls.atol, controls.rtol):
            solution = better
    if not isinstance(problem.bulk, Quadratic):
        system = Workspace(1).condensed(at_tangent(problem, solution.unknowns))
        problem = system.problem
    r, lam = solution.local, solution.multiplier
    frozen = system.for_problem(problem.with_(law=system.law_at(r, lam)))
    line = frozen.law.linearise(r)
    index = np.flatnonzero(smooth_components(line, frozen.active).ravel())
    length = system.length_scale
    error = np.full(system.shape, 1e-12 * length)
    if index.size:
        H = newton_matrix(frozen, index, line.hessian)
        least = float(np.abs(np.linalg.eigvalsh(H)).min())
        force = solution.residual.total + _EPS * solution.residual.scale
        error += min(10.0 * force / least if least > 0.0 else np.inf, 1e-6 * length)
    return solution, error
