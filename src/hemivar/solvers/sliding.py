"""Whether a solution is a slide: friction is at its limit, as nearly as its residual tells."""

from __future__ import annotations

import numpy as np

from hemivar.basics.types import Array
from hemivar.discrete.problem import DiscreteProblem
from hemivar.discrete.residual import contact_compliance, load_scale, residuals
from hemivar.solvers.solution import Solution

__all__ = ["slides"]

#: Part of the largest pressure from which a contact point presses.
_PRESSED = 1e-9
#: A residual this many times as large is the same.
_SAME = 2.0
#: Part of the load below which a residual does not tell where a part is that has moved by more than its size.
_UNTOLD = 1e-6


def slides(solution: Solution) -> bool:
    """Whether a part that contact alone holds might as well be elsewhere along its contact.

    It is moved on along the way that it has slid; that leaves the residual as it is where all of its contact slips, and
    the load is as near to the limit of friction as the residual tells.  Of a part that has moved by more than its own
    size more is asked.
    """
    problem, found = solution.problem, solution.residual
    rigid = problem.model.rigid_part
    if not rigid.count or problem.contact.components < 2 or not problem.law.rubs.any():
        return False
    compliance = contact_compliance(problem)
    scale = load_scale(problem, compliance)
    same = _SAME * max(found.total, found.noise)
    for way, size in _ways(problem, solution):
        u, moved = solution.unknowns + way, float(np.abs(way).max())
        r = problem.local(u)
        of_law = problem.law.frozen(r, solution.multiplier).nearest_multiplier(r, solution.multiplier)
        there = min(one.total for one in residuals(problem, u, [solution.multiplier, of_law], compliance, scale))
        if there <= same or (moved > size and there <= _UNTOLD * found.scale):
            return True
    return False


def _ways(problem: DiscreteProblem, solution: Solution) -> list[tuple[Array, float]]:
    """How each group of parts has slid, as unknowns (n,), by the largest slip at least; and the size of the group."""
    motions, rigid, field = problem.model.free_motions, problem.model.rigid_part, problem.field
    assert field is not None
    m, d = problem.contact.shape
    trace = np.asarray((problem.contact.trace @ rigid.basis).toarray()).reshape(m, d, rigid.count)
    pressure = np.abs(solution.multiplier[:, 0])
    normal = trace[pressure > _PRESSED * pressure.max(initial=0.0), 0]
    found = []
    for group, columns in zip(motions.groups, rigid.groups, strict=True):
        own = rigid.basis[:, columns]
        along, rows = own.T @ solution.unknowns, normal[:, columns]
        along = along - np.linalg.lstsq(rows, rows @ along, rcond=_PRESSED)[0]
        way, slip = np.asarray(own @ along), solution.local[np.abs(trace[:, 1:, columns]).any(axis=(1, 2)), 1:]
        moved, slipped = float(np.abs(way).max(initial=0.0)), float(np.abs(slip).max(initial=0.0))
        if moved == 0.0 or slipped == 0.0:
            continue
        nodes = np.unique(motions.motions[:, group.columns].indices) // field.components
        size = float(np.ptp(field.nodes[np.unique(nodes)], axis=0).max())
        found.append((way * max(1.0, slipped / moved), size))
    return found
