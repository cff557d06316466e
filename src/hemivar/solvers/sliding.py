"""Rigid sliding of parts that contact alone holds: how far, and whether the residual tells where they are."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from hemivar.basics.arrays import SOLVED
from hemivar.basics.types import Array
from hemivar.discrete.problem import DiscreteProblem
from hemivar.discrete.residual import contact_compliance
from hemivar.discrete.rigid_modes import admitted
from hemivar.laws import VectorLaw
from hemivar.solvers.contact_states import TangentialState
from hemivar.solvers.solution import Solution
from hemivar.solvers.status import Status

__all__ = ["with_slides"]

#: A slide that is doubled must raise what is out of balance along it by this, for the residual to tell where it ends.
_TOLD = 10.0
#: Parts of a slide by which it is moved on: friction that weakens may be gone at the whole one.
_ON = (1e-3, 1.0)


def with_slides(solution: Solution) -> Solution:
    """A converged solution, with what must be said of parts that contact alone holds.

    A part is moved on along the way that it has slid.  Where that leaves what is out of balance along it as small as it
    is, all of its contact slips, and the load is as near to the limit of friction as the solution is to balance: the
    part may be anywhere on its way.  Where a point sticks nothing slides.
    """
    if solution.status is not Status.CONVERGED:
        return solution
    slides = list(_slides(solution.problem, solution))
    if not all(slide.is_determined(solution) for slide in slides):
        return replace(solution, status=Status.AT_LIMIT)
    far = max((slide.far for slide in slides), default=0.0)
    return replace(solution, remarks=(*solution.remarks, _FAR.format(far))) if far > 1.0 else solution


_FAR = (
    "a part that contact alone holds has slid by {:.3g} of its own size, but it touches what it touched at the start: "
    "check friction, loads and supports"
)


@dataclass(frozen=True, eq=False)
class _Slide:
    """How a group of parts has slid without strain, its contact being kept."""

    motion: Array  # unknowns (n,)
    size: float  # of the group
    slip: float  # its largest one

    @property
    def far(self) -> float:
        """How far, in its own sizes."""
        return float(np.abs(self.motion).max()) / self.size

    def is_determined(self, solution: Solution) -> bool:
        """Whether the balance of the group tells where it is."""
        problem, lam = solution.problem, solution.multiplier
        law = problem.law.frozen(solution.local, lam)
        r = law.fitted(solution.local, lam, contact_compliance(problem))
        there = problem.contact.trace_of(max(1.0, self.slip / float(np.abs(self.motion).max())) * self.motion)
        here, *beyond = (self._off(problem, law, r + part * there, lam) for part in (0.0, *_ON))
        noise = solution.residual.noise
        # Forces within the cones balance the load: what is in balance to rounding is an equilibrium.
        exact = problem.balanced_by_friction and here <= noise and self.far <= 1.0
        return exact or max(beyond) > max(_TOLD * here, noise)

    def _off(self, problem: DiscreteProblem, law: VectorLaw, r: Array, lam: Array) -> float:
        """What friction at local displacements r, under the pressure of a multiplier, leaves of the load on the way."""
        rubs = law.nearest_multiplier(r, lam)
        rubs[:, 0] = lam[:, 0]
        return abs(float(self.motion @ (problem.load - problem.contact_force(rubs)))) / float(
            np.linalg.norm(self.motion)
        )


def _slides(problem: DiscreteProblem, solution: Solution) -> Iterator[_Slide]:
    rigid, field = problem.model.rigid_part, problem.field
    if not rigid.count or field is None or problem.contact.components < 2 or not problem.law.rubs.any():
        return
    free, pressure = problem.model.free_motions, np.abs(solution.multiplier[:, 0])
    bears = np.linalg.norm(solution.multiplier, axis=1)
    sticks = (solution.tangential_state == TangentialState.STICK) & (bears > SOLVED * bears.max(initial=0.0))
    trace = (problem.contact.trace @ rigid.basis).toarray().reshape(*problem.contact.shape, rigid.count)
    pressed = trace[pressure > SOLVED * pressure.max(initial=0.0), 0]
    for group, columns in zip(free.groups, rigid.groups, strict=True):
        motions = rigid.basis[:, columns].toarray() @ admitted(pressed[:, columns])
        motion = motions @ (motions.T @ solution.unknowns)
        own = np.abs(trace[:, 1:, columns]).any(axis=(1, 2))
        slip = float(np.abs(solution.local[own, 1:]).max(initial=0.0))
        if motion.any() and slip > 0.0 and not (own & sticks).any():
            nodes = np.unique(free.motions[:, group.columns].indices // field.components)
            yield _Slide(motion, float(np.ptp(field.nodes[nodes], axis=0).max()), slip)
