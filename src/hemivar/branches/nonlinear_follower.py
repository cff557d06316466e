"""Continuation of a body that is not linear: at each point of the path, the linear body with its tangent stiffness."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import cast

import numpy as np

from hemivar.basics.first_use import cached_property
from hemivar.basics.last_used import Recent
from hemivar.basics.types import AnyArray, Array
from hemivar.branches.follower import FollowedPoint
from hemivar.branches.graph_chart import GraphChart
from hemivar.branches.graph_follower import GraphFollower
from hemivar.branches.path import PathEnd
from hemivar.discrete.potential import Potential
from hemivar.discrete.problem import DiscreteProblem
from hemivar.errors import ProblemError
from hemivar.fem import LoadLine
from hemivar.systems.condensed import CondensedProblem, condense
from hemivar.systems.nonlinear_body import linear_bulk

__all__ = ["NonlinearFollower", "tangent_body"]

#: Part of the range of loads over which the rate of the forces is taken by a difference: exact but for rounding where
#: loads are linear in the factor. 1e-5 and 1e-7 give the same paths in tests/branches.
_BESIDE = 1e-6
#: Corrections of the inside with one stiffness; one that does not halve what is left ends them before. 15 and 60 give
#: the same paths in tests/branches.
_CORRECTIONS = 30
#: Stiffnesses that are tried, each at the last point reached: Newton's method. 5 and 80 give the same paths in
#: tests/branches.
_STIFFNESSES = 20
#: Part of the largest displacement below which a correction is rounding: a few units in the last place.
_ROUNDED = 1e-15
#: Part of the largest displacement below which corrections that no longer shrink are rounding of the body. 1e-9 and
#: 1e-11 give the same paths in tests/branches.
_LEFT = 1e-10


class _LostError(Exception):
    """The inside of the body has no equilibrium near, for displacements of its contact points."""


@dataclass(frozen=True, eq=False)
class _TangentBody:
    """A body where it is: all its unknowns (n,), and the linear body with its forces and stiffness there."""

    unknowns: Array
    system: CondensedProblem


@dataclass(eq=False)
class NonlinearFollower(GraphFollower):
    """Follows the equilibria of ``line``, near the unknowns ``start``; ``force0`` is a force that does not grow."""

    line: LoadLine = field(kw_only=True)
    start: Array = field(kw_only=True)

    @cached_property
    def _known(self) -> Recent[tuple[bytes, float], tuple[GraphChart, Array, Array]]:
        return Recent(8)  # a step asks for its two ends and a few points between them

    @cached_property
    def _last(self) -> list[_TangentBody]:
        """Where the body was last."""
        return [_TangentBody(self.start, self.chain.system)]

    def advance(
        self, theta: Array, segment: AnyArray, t: float, v: Array, length: float
    ) -> tuple[FollowedPoint | PathEnd, bool]:
        self.check_chart(theta)
        return self.curved_step(theta, segment, t, v, length), True

    def newton(
        self, theta: Array, t: float, border: Array, segment: AnyArray, steps: int
    ) -> tuple[Array, float, int] | None:
        try:
            return super().newton(theta, t, border, segment, steps)
        except _LostError:
            return None

    def tangent(self, theta: Array, segment: AnyArray, t: float, border: Array) -> Array | None:
        try:
            return super().tangent(theta, segment, t, border)
        except _LostError:
            return None

    def unknowns(self, r: Array, t: float) -> Array:
        """All unknowns (n,) for displacements (m, d) of the contact points and a load."""
        self._last[:] = [self._inside(self.line.at(t), r)]
        return self._last[0].unknowns

    def body_at(self, theta: Array, t: float) -> tuple[GraphChart, Array, Array]:
        return self._known.once((theta.tobytes(), t), lambda: self._body_at(theta, t))

    def _body_at(self, theta: Array, t: float) -> tuple[GraphChart, Array, Array]:
        u = self.unknowns(self.chain.local(theta, self.chain.here)[0], t)
        self._last[:] = [_TangentBody(u, _condensed(self.line.at(t), u))]
        chart = replace(self.chain, system=self._last[0].system)
        force, beside = chart.load_of(chart.system), _BESIDE * (self.high - self.low)
        after = chart.load_of(_under(self._last[0], self.line.at(t + beside)))
        return chart, force + self.force0, (after - force) / beside

    def _inside(self, problem: DiscreteProblem, r: Array) -> _TangentBody:
        """The body in equilibrium but for its contact points: by a stiffness near, or by its own."""
        body = self._last[0]
        for _ in range(_STIFFNESSES):
            u, converged = _balanced(body, problem, r)
            if converged:
                return _TangentBody(u, body.system)
            body = _TangentBody(u, _condensed(problem, u))
        raise _LostError


def tangent_body(problem: DiscreteProblem, u: Array) -> DiscreteProblem:
    """The linear body that has the forces and the stiffness of a body at unknowns (n,)."""
    bulk = linear_bulk(problem.bulk, u)
    return problem.under(problem.out_of_balance(u) + bulk.gradient(u), bulk=bulk)


def _condensed(problem: DiscreteProblem, u: Array) -> CondensedProblem:
    try:
        return condense(tangent_body(problem, u))
    except ProblemError:  # the material has softened
        raise _LostError from None


def _under(body: _TangentBody, problem: DiscreteProblem) -> CondensedProblem:
    """The linear body of a place with the forces that another load leaves there."""
    own, u = body.system.problem, body.unknowns
    load = problem.out_of_balance(u) + own.linear.gradient(u)
    return body.system.for_problem(own.under(load, offset=problem.offset))


def _balanced(body: _TangentBody, problem: DiscreteProblem, r: Array) -> tuple[Array, bool]:
    """The unknowns after corrections by the stiffness of a place, and whether they stand; the last good ones if not."""
    bulk, last = cast(Potential, problem.bulk), np.inf
    extent = float(np.abs(bulk.energy.origin).max())
    for _ in range(_CORRECTIONS):
        u = _under(body, problem).unknowns(r)
        if not np.isfinite(u).all():
            break
        moved, size = float(np.abs(u - body.unknowns).max()), max(float(np.abs(u).max()), extent)
        body = _TangentBody(u, body.system)
        if moved <= _ROUNDED * size or (moved >= 0.5 * last and moved <= _LEFT * size):
            return u, True
        if moved >= 0.5 * last:
            break
        last = moved
    return body.unknowns, False
