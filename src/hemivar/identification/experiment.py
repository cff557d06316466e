"""An experiment, the forward map of a fit: loads and displacements that are set in rows, and what is measured there."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from hemivar.basics.deadline import check_time
from hemivar.basics.types import Array
from hemivar.bounds.goals import Goal, GoalKind, goal_named
from hemivar.certificates import certify
from hemivar.discrete.model import quadratic
from hemivar.discrete.problem import DiscreteProblem
from hemivar.errors import ProblemError
from hemivar.fem.contact_points import shares
from hemivar.fem.reactions import support_reactions
from hemivar.laws import VectorLaw
from hemivar.mesh.boundary_rule import boundary_rule
from hemivar.solvers import Controls, Solution, solve
from hemivar.solvers.status import check_interrupt
from hemivar.systems.condensed import CondensedProblem
from hemivar.systems.workspace import Workspace

__all__ = ["Experiment"]

#: Part of its entries by which the stiffness of a row may differ from that of the first: the rounding of its assembly.
#: 1e-11 and 1e-13 give the same fits in tests/identification.
_SAME = 1e-12
_WHAT = "identification"


@dataclass(frozen=True, eq=False)
class Experiment:
    """The rows of an experiment on one body, from the first to the last.

    What is measured is affine in the local displacements of the contact points: ``y = L r + c``, L the same for all.
    """

    problems: tuple[DiscreteProblem, ...]  # one for each row, on one model, so that the body is condensed once
    linear: Array  # (q, m, d): L
    constants: Array  # (n, q): c of each row
    workspace: Workspace = field(repr=False)
    controls: Controls = field(default_factory=Controls)

    @classmethod
    def of(
        cls, problems: Sequence[DiscreteProblem], quantities: Sequence[str], controls: Controls | None = None
    ) -> Experiment:
        """Rows of one body, each discretised, and what is measured, with its component, see :func:`.goal_named`."""
        first = problems[0]
        if first.origin is None or first.origin.kind:
            raise ProblemError(f"{_WHAT} needs a ContactProblem of an elastic body; state it, or read it from a file")
        quadratic(first.bulk, _WHAT)
        if not first.contact_points:
            raise ProblemError(f"{_WHAT} needs contact points, and every contact node is held by the supports")
        if first.law.state_dependent:
            raise ProblemError(
                f"{_WHAT} takes no law whose friction bound depends on the solution, such as Coulomb's; "
                "take a given bound, such as Tresca's"
            )
        goals = [goal_named(first.origin, name) for name in quantities]
        for goal in goals:
            if len(goal.axes) > 1:
                raise ProblemError(f"'{goal}' is a vector; name the component that was measured, as in {goal}.x")
        workspace = Workspace()
        shared = tuple(
            first if row is first else _on_the_same_body(first, row, number) for number, row in enumerate(problems, 1)
        )
        system = workspace.condensed(first, many=True)
        measure = [[_measure(row, goal) for goal in goals] for row in problems]
        zero = np.zeros(system.shape)
        constants = np.empty((len(problems), len(goals)))
        for number, problem in enumerate(shared):
            check_time()
            loaded = system.for_problem(problem)
            at = loaded.unknowns(zero), _multiplier(loaded, zero)
            constants[number] = [value(*at) for value in measure[number]]
        linear = np.empty((len(goals), *zero.shape))
        base = system.unknowns(zero), _multiplier(system, zero)
        for component in np.ndindex(zero.shape):
            unit = zero.copy()
            unit[component] = system.length_scale or 1.0
            at = system.unknowns(unit), _multiplier(system, unit)
            linear[(slice(None), *component)] = [(value(*at) - value(*base)) / unit[component] for value in measure[0]]
        return cls(shared, linear, constants, workspace, controls or Controls())

    def system(self, number: int, law: VectorLaw) -> CondensedProblem:
        """The condensed body of a row, with a law."""
        return self.workspace.condensed(self.problems[number].with_(law=law), many=True)

    def solutions(self, law: VectorLaw) -> list[Solution]:
        """The solutions of all rows with a law, each begun at that of the row before it.

        Where the law softens a body may have several; beginning where it was is what one does that is loaded slowly.
        """
        solutions: list[Solution] = []
        for problem in self.problems:
            loaded = problem.with_(law=law)
            before = solutions[-1] if solutions else None
            solutions.append(solve(loaded, None, self.controls, initial=before, workspace=self.workspace))
            check_interrupt(solutions[-1].status)
            check_time()
        return solutions

    def predicted(self, solutions: Sequence[Solution]) -> Array:
        """What would be measured, (n, q)."""
        local = np.stack([solution.local for solution in solutions])
        return np.asarray(np.einsum("qmd,nmd->nq", self.linear, local) + self.constants)

    def error_bounds(self, law: VectorLaw, solutions: Sequence[Solution]) -> Array:
        """By how much what is computed may be off the discrete solution, (n, q): certified; inf where it is not."""
        n, q = len(solutions), len(self.linear)
        bounds = np.full((n, q), np.inf)
        for number, solution in enumerate(solutions):
            check_time()
            bound = certify(self.problems[number].with_(law=law), solution, workspace=self.workspace).error_bound
            if bound is not None:
                bounds[number] = bound
        check_time()  # without time a certificate claims nothing
        system = self.system(0, law)
        free = system.active.ravel()
        flat = self.linear.reshape(q, -1)[:, free]
        A = system.matrix[np.ix_(free, free)]
        sizes = np.sqrt(np.maximum(np.einsum("qk,kq->q", flat, np.linalg.lstsq(A, flat.T, rcond=None)[0]), 0.0))
        return np.asarray(bounds * sizes)


def _on_the_same_body(first: DiscreteProblem, other: DiscreteProblem, row: int) -> DiscreteProblem:
    """The loading of a row on the model of the first."""
    K, other_K = first.stiffness, quadratic(other.bulk, _WHAT).stiffness
    same = K.shape == other_K.shape and first.contact.count == other.contact.count
    if not same or abs(K - other_K).max() > _SAME * abs(K).max():
        raise ProblemError(
            f"in row {row} the body is another one than in row 1; what is set in each row is a load, a prescribed "
            "displacement or a gap"
        )
    return first.with_(load=other.load, offset=other.offset, constant=other.constant, law=first.law)


def _multiplier(system: CondensedProblem, r: Array) -> Array:
    """Forces per area (m, d) that keep the body at local displacements."""
    return np.asarray(system.out_of_balance(r) / system.weights[:, None])


def _measure(problem: DiscreteProblem, goal: Goal) -> Callable[[Array, Array], float]:
    """A measured quantity as a function of the unknowns and the multiplier; affine."""
    stated, space = problem.origin, problem.field
    assert stated is not None
    assert space is not None
    (axis,) = goal.axes
    if goal.kind is GoalKind.REACTION:
        return lambda u, lam: float(support_reactions(problem, space.full(u), lam)[goal.boundary][axis])
    if goal.kind is GoalKind.CONTACT_FORCE:
        contact = problem.contact
        return lambda u, lam: float(
            contact.forces(-contact.weights[:, None] * contact.global_vectors(lam))[goal.boundary][axis]
        )
    mesh, order = stated.mesh, stated.order
    rule = boundary_rule(mesh, goal.boundary, order)
    nodes, share = rule.nodes, rule.weights[:, None] * shares(order, mesh.dim) / rule.weights.sum()
    return lambda u, lam: float((share * space.full(u)[nodes, axis]).sum())
