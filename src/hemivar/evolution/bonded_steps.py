"""Bodies on brittle bonds with plastic slip, load by load: energetic mode mixity, without mass."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from hemivar.basics.arguments import expect
from hemivar.basics.arrays import real_array
from hemivar.basics.portable import PickleMixin
from hemivar.basics.types import Array
from hemivar.discrete.problem import DiscreteProblem
from hemivar.errors import ProblemError
from hemivar.fem.discretize import discretize
from hemivar.laws import VectorLaw
from hemivar.laws.coupled import JoinedLaw
from hemivar.laws.memory.plastic_bond import BondState, PlasticBond
from hemivar.mechanics.statement import ContactProblem
from hemivar.solvers import Solution, Solver, Status, solve
from hemivar.systems.workspace import Workspace

__all__ = ["BondedStep", "bonded_steps"]


@dataclass(frozen=True, eq=False)
class BondedStep(PickleMixin):
    """A time at which no more bonds break.

    Attributes
    ----------
    time : float
    solution : Solution
    states : mapping of name to BondState
        By boundary, at the end of the step.
    stored, dissipated : float
        Energy in bonds, hardening and compression, and what bonds and plastic slip have lost since the beginning;
        integrals over the boundaries.
    rounds : int
        Solves.
    """

    time: float
    solution: Solution
    states: Mapping[str, BondState]
    stored: float
    dissipated: float
    rounds: int


def bonded_steps(
    problem: ContactProblem,
    bonds: Mapping[str, PlasticBond],
    times: Sequence[float] | Array,
    method: Solver | str | None = None,
) -> Iterator[BondedStep]:
    """Equilibria of a body on bonds with plastic slip, one time after the other.

    At every time two parts alternate until no bond breaks: displacement and plastic slip minimise the energy with the
    bonds as they are, a convex problem; then the bonds break whose energy has reached that of a break.

    Parameters
    ----------
    problem : ContactProblem
        Its loads, supports and gaps may depend on time. On boundaries with bonds these replace the ``normal`` law.
    bonds : mapping of name to PlasticBond
        By contact boundary.
    times : sequence of float
        Increasing. Plastic slip depends on the way: take small steps.
    method : Solver or str, optional
        As that of :func:`hemivar.solve`.

    Yields
    ------
    BondedStep
        The last one has a solution whose status tells if it did not converge, and its remedy.

    Raises
    ------
    ProblemError
        A boundary has no contact, friction beside the bond, damping or memory; times that do not increase.
    """
    expect(problem, ContactProblem, "problem", "give a ContactProblem")
    moments = real_array(times, "times", 1)
    if moments.size == 0 or (np.diff(moments) <= 0.0).any():
        raise ProblemError(f"times are {moments.tolist()}; give at least one, increasing")
    if not bonds:
        raise ProblemError("bonds are empty; give a PlasticBond for a contact boundary")
    for name, bond in bonds.items():
        _check(problem, name, bond)
    return _stepping(problem, bonds, moments, method)


def _check(problem: ContactProblem, name: str, bond: PlasticBond) -> None:
    if name not in problem.contact:
        known = ", ".join(problem.contact)
        raise ProblemError(
            f"bonds['{name}']: there is no contact on this boundary (contact: {known}); name one of these"
        )
    expect(bond, PlasticBond, f"bonds['{name}']", "give a PlasticBond")
    contact = problem.contact[name]
    if contact.friction.acts or contact.damping is not None or contact.memory:
        raise ProblemError(f"contact['{name}'] has friction, damping or memory beside its bond; leave them out")


def _stepping(
    problem: ContactProblem, bonds: Mapping[str, PlasticBond], times: Array, method: Solver | str | None
) -> Iterator[BondedStep]:
    states = {name: bond.start() for name, bond in bonds.items()}
    workspace, dissipated, last = Workspace(), 0.0, None
    for time in times.tolist():
        now = problem.at_time(time)
        whole = {name: replace(one, normal=bonds[name].step_law(bonds[name].start())) if name in bonds else one
                 for name, one in now.contact.items()}  # fmt: skip
        discrete = discretize(replace(now, contact=whole))
        rounds = 0
        while True:
            rounds += 1
            solution = solve(
                discrete.with_(law=_law(discrete, bonds, states)), method, initial=last, workspace=workspace
            )
            last, broke, stored = solution.unknowns, False, 0.0
            for name, bond in bonds.items():
                rows = solution.contact.on(name)
                weights, r = solution.problem.contact.weights[rows], solution.local[rows]
                new = bond.advance(states[name], r)
                broke |= bool((states[name].bonded & ~new.bonded).any())
                dissipated += float(weights @ bond.dissipated(states[name], new))
                stored += float(weights @ bond.stored(new, r))
                states = {**states, name: new}
            if not broke or solution.status is not Status.CONVERGED:
                break
        yield BondedStep(time, solution, states, stored, dissipated, rounds)
        if solution.status is not Status.CONVERGED:
            return


def _law(discrete: DiscreteProblem, bonds: Mapping[str, PlasticBond], states: Mapping[str, BondState]) -> VectorLaw:
    """The law of all contact points: that of the step on bonds, elsewhere the one stated."""
    rows = {name: discrete.contact.on(name) for name in discrete.contact.names}
    parts = [
        bonds[name].step_law(states[name]) if name in bonds else discrete.law.take(index)
        for name, index in rows.items()
    ]
    return parts[0] if len(parts) == 1 else JoinedLaw(tuple(parts), tuple(rows.values()))
