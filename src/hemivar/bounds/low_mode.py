"""A bound that softening along the softest mode alone does not spoil.

``a(e, e) - <alpha e, e> <= R(e)`` for the error e, ``R(v) = L(v) - a(u, v) - <zeta, v>``, and ``|R(v)| <= H |v|_a``,
which gives ``|e|_a <= H / (1 - c)``.  But what R does to a known field psi can be computed, and for one of the discrete
space it is next to nothing, while the quotient ``<alpha v, v> / a(v, v)`` is near c along the softest mode alone.

Let ``a(psi, psi) = 1``, ``theta = <alpha psi, psi>``, ``e = t psi + y w``, w of norm one, ``a(psi, w) = 0``.
With upper bounds ``C1 >= C2`` of the first two eigenvalues, ``tau = <alpha w, w>`` and ``d = <alpha psi, w>``

    tau <= C1 + C2 - theta  (Ky Fan: two orthogonal quotients are at most the sum),    d^2 <= (C1 - theta) (C1 - tau),

so that ``(1 - theta) t^2 - 2 d |t| y + (1 - tau) y^2 <= |R(psi)| |t| + H y`` confines (t, y), and
``|e|_a^2 = t^2 + y^2``.  With the largest d the form is ``(1 - C1) I + v v'``,
``v = (sqrt(C1 - theta), -sqrt(C1 - tau))``.  If psi is the mode and R(psi) vanishes, the bound is
``H / (2 sqrt((C1 - C2) (1 - C1)))``, or ``H / (1 - C2)`` where that is attained first, in place of ``H / (1 - C1)``.  A
gap G is added on the right of both inequalities.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp

from hemivar.basics.first_use import cached_property
from hemivar.basics.types import Array
from hemivar.bounds.bare_body import bare_body
from hemivar.bounds.contact_traces import ContactTraces
from hemivar.certificates.norms import EnergyNorm, energy_norm
from hemivar.discrete.problem import DiscreteProblem
from hemivar.fem.discretize import discretize

__all__ = ["SoftModes", "SoftestMode", "confined_error"]

#: Steps of inverse iteration: each makes the others smaller by the ratio of two eigenvalues.
_STEPS = 6
#: Lagrange multipliers of which the best is taken: each gives a bound.
_MULTIPLIERS = 4000


@dataclass(frozen=True, eq=False)
class SoftestMode:
    """A field near to the softest mode of the discrete space."""

    #: psi, linear on cells, ``a(psi, psi) = 1``.
    field: Array  # (nodes, d)
    #: ``<alpha psi, psi>``, which no right c is below.
    theta: float


@dataclass(frozen=True, eq=False)
class SoftModes:
    """The softest modes of linear elements on the mesh of a displacement, for any constants of the law."""

    #: Their frames are those along which penetration and slip are measured.
    traces: ContactTraces

    @cached_property
    def _body(self) -> tuple[DiscreteProblem, EnergyNorm]:
        bare = replace(bare_body(self.traces.data.problem, coarsest=False), contact={})
        body = discretize(bare, check_coercivity=False)
        return body, energy_norm(body)

    def softest(self, normal: Array, tangential: Array) -> SoftestMode:
        """For constants alpha (k,) of the normal and of the tangential law on the contact facets."""
        traces, table, dim = self.traces, self.traces.data.table, self.traces.data.table.dim
        body, energy = self._body
        assert body.field is not None
        basis, K = body.field.basis, body.stiffness
        weights = np.broadcast_to(np.column_stack([normal, tangential])[:, None], (*traces.weights.shape, 2))
        blocks = replace(traces, shapes=traces.barycentric).mass(weights)
        shape = blocks.shape[0], blocks.shape[1] * dim
        count, size = int(np.prod(shape)), len(table.mesh.points) * dim
        seen: sp.csr_array = sp.csr_array((count, size))
        for nodes, sign in ((table.facets, 1.0), (table.others, -1.0)):
            columns = (nodes[traces.facets][:, :, None] * dim + np.arange(dim)).ravel()
            there = np.repeat((sign > 0.0) | table.cut[traces.facets], shape[1])
            seen = seen + sp.csr_array((np.where(there, sign, 0.0), (np.arange(count), columns)), shape=(count, size))
        start = np.arange(shape[0] + 1)
        of_facets = sp.bsr_array((blocks.reshape(-1, shape[1], shape[1]), start[:-1], start), shape=(count, count))
        seen = sp.csr_array(seen @ basis)
        M = sp.csr_array(seen.T @ sp.csr_array(of_facets) @ seen)
        x = np.random.default_rng(0).normal(size=M.shape[0])
        for _ in range(_STEPS):
            x = energy.riesz(M @ x)[0]
            x /= np.sqrt(float(x @ (K @ x)))
        return SoftestMode(np.asarray(basis @ x).reshape(-1, dim), float(x @ (M @ x)))

    def seen(self, mode: SoftestMode, zeta: Array) -> float:
        """A bound of ``|R(psi)|`` with linear elements, for a zeta (k, q, d) at the points of the contact facets."""
        traces, data, field = self.traces, self.traces.data, mode.field
        table = data.table
        at = field[table.cells]
        strain = np.einsum("mai,maj->mij", at, table.gradients)
        work = float(np.einsum("mai,mai->", data.loads, at))
        work += float(np.einsum("fai,fai->", data.outer_loads, field[table.facets[table.outer]]))
        work -= float(np.einsum("m,mij,mij->", table.volumes, data.stress, strain))
        work -= float(np.einsum("fai,fai->", traces.moments(zeta), data.jump(field, traces.facets)))
        return abs(work) + float(data.varying.unknown @ np.linalg.norm(field, axis=1))


def confined_error(
    total: float, seen: float, theta: float, first: float, second: float, coupling: float, gap: float = 0.0
) -> float:
    """The largest ``|e|_a`` that is left; inf if ``first + coupling`` is not below one."""
    if not first + coupling < 1.0:
        return np.inf
    force, left = np.array([min(seen, total), total]), 1.0 - coupling - first
    spare = max(first - theta, 0.0)
    rest = max(first - second - spare, 0.0)  # C1 - tau for the highest tau
    squares = [_farthest(force, left, spare, one, gap) for one in (rest, first)]
    if spare > 0.0:  # on the arc between, some tau leaves 1 - C1 - coupling only
        ratio = np.clip(force[0] / total if total > 0.0 else 0.0, *np.sqrt([rest / spare, first / spare]))
        along = float(force @ (ratio, 1.0) / np.hypot(ratio, 1.0))
        squares.append(((along + np.sqrt(along**2 + 4.0 * left * gap)) / (2.0 * left)) ** 2)
    return float(np.sqrt(max(squares)))


def _farthest(force: Array, left: float, spare: float, rest: float, gap: float) -> float:
    """A bound of ``|z|^2`` where ``z'Q z <= force . z + G``, ``Q = left I + v v'``, ``v = (sqrt(spare), -sqrt(rest))``.

    For every lambda above ``1 / left``, ``|z|^2 <= lambda G + lambda^2 / 4 force . (lambda Q - I)^-1 force``, and the
    least of them is the supremum.  Along v and across it this is a sum; lambda is ``(1 + x) / left``.
    """
    x, size = np.geomspace(1e-18, 1.0, _MULTIPLIERS), spare + rest
    along = (force[0] * np.sqrt(spare) - force[1] * np.sqrt(rest)) ** 2 / size if size > 0.0 else 0.0
    across = max(float(force @ force) - along, 0.0)
    factor = (1.0 + x) / left
    parts = across / x + along / (x + factor * size)
    return float((factor * gap + 0.25 * factor**2 * parts).min())
