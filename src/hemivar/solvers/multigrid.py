"""Nonsmooth multigrid (TNNMG): contact at the price of a linear elastic solve, on one machine or on many."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from hemivar.basics.types import Array
from hemivar.discrete.contact import selects
from hemivar.discrete.problem import DiscreteProblem
from hemivar.errors import ProblemError
from hemivar.laws.vector_law import frozen_at
from hemivar.solvers.base import Solver, State
from hemivar.solvers.controls import NESTED, Budget
from hemivar.solvers.line_search import SearchLine
from hemivar.solvers.loop import iterate
from hemivar.solvers.newton import NonsmoothNewton
from hemivar.solvers.newton_on_graph import FEW_ROUNDS, NewtonCache, active_set_newton, small_and_convex
from hemivar.solvers.status import STOPPED, Status
from hemivar.solvers.truncated_newton import TruncatedNewton
from hemivar.systems.body import Body
from hemivar.systems.body_on_levels import BodyProblem, set_up
from hemivar.systems.condensed import CondensedProblem
from hemivar.systems.contact_moves import snap_to_kinks
from hemivar.systems.newton_equation import Accuracy, LinearisedPoint, NewtonEquation
from hemivar.systems.workspace import Workspace

__all__ = ["TIGHTEST", "NonsmoothMultigrid", "nested_guess"]

#: Tightest tolerance of Newton's equation, relative to the load: what products in double precision leave.
TIGHTEST = 1e-13
#: Ends of a coarser body that lead nowhere.
_LOST = (Status.UNBOUNDED, Status.NONFINITE)


@dataclass(frozen=True)
class NonsmoothMultigrid(TruncatedNewton):
    """Truncated nonsmooth Newton multigrid (Graeser, Sack, Sander 2009; Graeser, Sander 2019).

    The steps of :class:`TruncatedNewton` on all unknowns.  Contact points minimise their energy while the rest of the
    body is held; Newton's equation is solved for all unknowns but those at a kink, by conjugate gradients with a
    multigrid cycle that leaves these out.  Conjugate gradients end as soon as the contact conditions are further from
    being fulfilled than the equation, so that little is spent before the contact set is known, and go on to the end
    once it is.

    It starts from the solution on the next coarser mesh, which starts from the one below it, and so on.  On meshes that
    are refinements of coarser ones (built in with even numbers of cells, or refined) the cycle is geometric; below the
    coarsest of them it is algebraic, with the rigid motions as near null space, and where the laws are convex some of
    the nodes stand for a coarser mesh.

    For laws that are not convex it ends at a point that no contact point can leave downhill on its own, all else being
    held; :class:`NonsmoothNewton` looks further.  ``Solution.evaluations`` counts the cycles on the finest mesh.

    Parameters
    ----------
    sweeps : int
        Diagonal minimisations of the contact points before each Newton step.
    iterations : int
        Most iterations of conjugate gradients in one step.
    tolerance : float, optional
        Where conjugate gradients end, relative to the load; a tenth of ``Controls.rtol`` by default.
    nested : bool
        Start from the solution on the next coarser mesh.
    absolute : float
        What conjugate gradients may leave in addition, in units of force.
    settled : bool
        The contact points of the initial guess lie on the pieces of their laws and at the kinks where they are expected
        in the end: the first step begins with Newton's equation.
    search : Search
        Whether contact points cross barriers of their own energy (GLOBAL), or only walk downhill (DOWNHILL).
    """

    sweeps: int = 3
    iterations: int = 60
    tolerance: float | None = None
    nested: bool = True
    absolute: float = 0.0
    settled: bool = False
    name: ClassVar[str] = "multigrid"
    trusts: ClassVar[bool] = True

    @property
    def condenses(self) -> bool:
        return False

    def refuse(self, problem: DiscreteProblem) -> str | None:
        if not selects(problem.contact.trace):
            return (
                "some contact points share displacements; it needs quadrature at the nodes, and contact boundaries "
                "that meet smoothly or at a right angle. Use NonsmoothNewton"
            )
        return None

    def for_tolerance(self, rtol: float) -> Solver:
        return self if self.tolerance is not None else replace(self, tolerance=max(0.1 * rtol, TIGHTEST))

    @property
    def direct(self) -> NonsmoothNewton:
        """What solves in its place on a condensed body."""
        return NonsmoothNewton(search=self.search)

    @property
    def accuracy(self) -> Accuracy:
        target = TIGHTEST if self.tolerance is None else self.tolerance
        return Accuracy(target, self.absolute, self.iterations)

    @property
    def starts_settled(self) -> bool:
        return self.settled

    def _evaluations(self, tries: int, cycles: int) -> int:
        """What counts as an evaluation: cycles."""
        return cycles

    def prepare(self, problem: DiscreteProblem, workspace: Workspace) -> BodyProblem:
        return set_up(problem, workspace)

    def first_guess(self, system: Body, budget: Budget) -> tuple[Array, Status | None]:
        if not self.nested:
            return system.start(), None
        rough = replace(self, tolerance=0.1 * NESTED.rtol, absolute=0.0, sweeps=min(self.sweeps, 2), settled=False)
        return nested_guess(rough, self.direct, system, budget)

    def on_pieces(self, system: Body, x: Array) -> Array | None:
        """The bottom of the pieces of the laws on which a place lies, with the points at kinks held there.

        Newton's equation leads straight to it where the laws are quadratic on their pieces.  Nothing is crossed on the
        way, for the energy is convex as far as conjugate gradients see.

        Parameters
        ----------
        system : Body
        x : array (n,)
            The place.

        Returns
        -------
        array (n,) or None
            None if the energy is not convex there, or falls beyond the ends of the pieces.
        """
        equation = system.newton_equation()
        try:
            return self._bottom(system, equation, x)
        finally:
            equation.release()

    def _bottom(self, system: Body, equation: NewtonEquation, x: Array) -> Array | None:
        x = system.moved(x, snap_to_kinks(system, system.local(x)))
        for _ in range(2):  # once more for what rounding leaves
            at = LinearisedPoint.of(system, x, system.local(x), system.out_of_balance(x))
            correction = equation.solve(at, self.accuracy)
            line = SearchLine.of(system, at, correction.step, correction.bent)
            near = line.cut(1.0)
            if correction.negative is not None or not line.straight(near):
                return None
            x, _ = line.end(1.0, near)
        return x


def nested_guess(rough: Solver, direct: Solver, system: Body, budget: Budget) -> tuple[Array, Status | None]:
    """The solution on the next coarser mesh, which starts from the one below it, and so on; and a status where the
    search for it was stopped.

    Where some nodes stand for a coarser mesh, laws whose force falls at rest do without it: what it finds may choose
    the branch.  Friction that softens under a bound which is zero at rest starts there, too.  A level on which
    contact does not hold the body, or whose solution has more energy here than rest, is passed over.

    ``rough, direct``: what solves on coarser meshes: on levels, and on a body that is small enough to be condensed,
    where it ends.
    """
    convex = not _bent(system)
    shift = system.carried if convex else None
    shifted = system if shift is None else system.beyond(shift)
    below = None if system.thins and not convex else shifted.coarse_system()
    x, stopped = None, None
    try:
        if below is not None:
            x, stopped = _solution_below(rough, direct, below, budget)
    except ProblemError:
        if not system.thins:
            raise
    if x is not None:
        x = shifted.from_below(x) if shift is None else shift + shifted.from_below(x)
    elif convex:
        x = system.untouched()
    start = system.start(x)
    if x is None or not convex or system.law.state_dependent or not (system.thins or below is None):
        return start, stopped
    rest = system.start()
    return (start if system.energy(start) <= system.energy(rest) else rest), stopped


def _solution_below(rough: Solver, direct: Solver, below: Body, budget: Budget) -> tuple[Array | None, Status | None]:
    """All unknowns of a coarser body, None where it is lost, and a status where the search for them was stopped."""
    small = below.condensed()
    if small is not None:
        return _solved(direct, small, budget)
    x, stopped = nested_guess(rough, direct, below, budget)
    if stopped is not None:
        return x, stopped
    end, status, _ = iterate(rough, below, State(x, below.multiplier(x)), NESTED, budget)
    rough.release(end)
    return None if status in _LOST else end.r, status if status in STOPPED else None


def _solved(direct: Solver, system: CondensedProblem, budget: Budget) -> tuple[Array | None, Status | None]:
    """The same of a small body."""
    r = system.start()
    lam = system.multiplier(r)
    if small_and_convex(system):
        quick = active_set_newton(system, r, lam, NESTED, NewtonCache(), rounds=FEW_ROUNDS)
        if quick is not None:
            return quick.unknowns, None
    end, status, _ = iterate(direct, system, State(r, lam), NESTED, budget)
    direct.release(end)
    return None if status in _LOST else system.unknowns(end.r), status if status in STOPPED else None


def _bent(system: Body) -> bool:
    """Whether the force of a law falls somewhere: a start may choose which solution is found.

    From rest points lift a few at a time, and are put back all at once: where it does not matter, a body starts without
    its contact."""
    law = frozen_at(system.law, system.local(np.zeros(system.load.shape)))
    return bool(system.vectors.largest(float(any((alpha != 0.0).any() for alpha in law.weak_convexity)))[0])
