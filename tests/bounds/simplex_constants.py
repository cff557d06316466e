"""Constants of a simplex for what is orthogonal to linear fields, proved by the energies of finitely many shapes.

    kappa_T = sup |v - P v|_T / |v|_{a,T},      kappa_F = sup |v - P v|_F / |v|_{a,T},

P the projections on linear fields of T and of F.  Let T be cut into parts, N along each edge, of finitely many shapes.
A load f on T, orthogonal to linear fields, has its projection f_h on fields linear on the parts answered by
stresses t of the split element, T free, with ``div t`` of the same linear moments; what is left, ``f + div t``, is
orthogonal to linear fields of the parts and at most ``theta |f|``:

    kappa_T <= sqrt(mu_N(T)) + theta / N max kappa,      max kappa <= max sqrt(mu_N) / (1 - theta / N)

over all shapes, of volume one.  ``div t`` is constant on the pieces of the split, and determined by its moments:
``theta^2 = 1 + sup |f_h + div t|^2 / |f_h|^2``, the same for all shapes.  For a facet see
:mod:`hemivar.bounds.facet_constants`.
"""

from __future__ import annotations

import math

import numpy as np
import scipy.linalg as la

from hemivar.basics.types import Array
from hemivar.bounds.facet_constants import _of_cells, equilibrated_blocks
from hemivar.bounds.facet_table import facet_table
from hemivar.bounds.split_element import pulled_back
from hemivar.bounds.trace_bounds import missed_part
from hemivar.mesh.mesh import Mesh

#: How often a simplex is cut in halves, by dimension.
_HALVINGS = {2: 3, 3: 2}
_DIGITS = 9


def simplex_constants(corners: Array, compliance: Array) -> tuple[float, float]:
    """Upper bounds of ``kappa_T`` and of the largest ``kappa_F`` of a simplex, up to rounding.

    ``corners`` is (d + 1, d); ``compliance`` is (v, v).
    """
    dim = corners.shape[1]
    theta, parts = missed_part(dim), 2 ** _HALVINGS[dim]
    size = _volume(corners) ** (1.0 / dim)
    waiting, known = [corners / size], {}
    while waiting:
        shape = waiting.pop()
        if (name := _key(shape)) in known:
            continue
        one = Mesh.oriented(shape, [list(range(dim + 1))])
        known[name] = math.sqrt(_free_energy(one.refined(_HALVINGS[dim]), shape, compliance))
        children = one.refined()
        if dim == 3:  # in the plane all parts are similar to the whole
            waiting += [2.0 * children.points[cell] for cell in children.cells]
    worst = max(known.values()) / (1.0 - theta / parts)
    cell = (known[_key(corners / size)] + theta / parts * worst) * size

    table = facet_table(Mesh.oriented(corners, [list(range(dim + 1))]))
    squares = _of_cells(table, compliance[None], np.arange(dim + 1))
    return cell, math.sqrt(max(squares))


def _volume(corners: Array) -> float:
    return abs(float(np.linalg.det(corners[1:] - corners[0]))) / math.factorial(corners.shape[1])


def _key(corners: Array) -> bytes:
    """The same for shapes that a translation or a reflection at a point makes one."""
    middle = corners - corners.mean(axis=0)
    ways = (tuple(sorted(map(tuple, (np.round(sign * middle, _DIGITS) + 0.0).tolist()))) for sign in (1.0, -1.0))
    return repr(min(ways)).encode()


def _free_energy(mesh: Mesh, whole: Array, compliance: Array) -> float:
    """The largest energy of a free body under cellwise linear loads that no linear field on it sees."""
    dim, table = mesh.dim, facet_table(mesh)
    n = dim + 1
    blocks = equilibrated_blocks(
        pulled_back(compliance[None], table.jacobian, table.sizes), table.jacobian, loaded=True
    )
    count, first = len(blocks), len(table.facets) * dim
    own = first + np.arange(count * n).reshape(count, n)
    nodes = np.hstack([(table.cell_facets[:, :, None] * dim + np.arange(dim)).reshape(count, -1), own])
    place = (nodes[:, :, None] * dim + np.arange(dim)).reshape(count, -1)
    size = (first + count * n) * dim
    K = np.zeros((size, size))
    for at, block in zip(place, blocks, strict=True):
        K[np.ix_(at, at)] += block
    unit, ones = np.eye(n), np.full((n, n), 1.0 / n)
    root = ones / math.sqrt(n) + (unit - ones) / math.sqrt(n * (n + 1))
    weight = np.sqrt(table.volumes)
    loads = np.zeros((size, count * n * dim))
    block = np.einsum("c,ab,ij->caibj", weight, root, np.eye(dim)).reshape(count, n * dim, n * dim)
    for cell, values in enumerate(block):
        loads[np.ix_(place[cell, -n * dim :], np.arange(cell * n * dim, (cell + 1) * n * dim))] = values
    corners = mesh.points[table.cells]
    functions = np.concatenate([np.ones((count, n, 1)), corners - whole.mean(axis=0)], axis=2)
    linear = np.einsum("c,ab,cbk,ij->caikj", weight, root, functions, np.eye(dim)).reshape(count * n * dim, -1)
    free = la.null_space(linear.T, rcond=1e-10)
    # rigid motions are the kernel of K, and loads are in balance: any displacement that answers them will do
    at = np.concatenate([mesh.points[table.facets].reshape(-1, dim), corners.reshape(-1, dim)])
    motions: list[Array] = [np.tile(e, len(at)).astype(float) for e in np.eye(dim)]
    for i in range(dim):
        for j in range(i):
            turned: Array = np.zeros(at.shape)
            turned[:, i], turned[:, j] = at[:, j], -at[:, i]
            motions.append(turned.ravel())
    rigid = np.linalg.qr(np.array(motions).T)[0]
    K += np.trace(K) / size * rigid @ rigid.T
    forces = loads @ free
    energy = forces.T @ la.cho_solve(la.cho_factor(K), forces)
    return float(la.eigvalsh(0.5 * (energy + energy.T))[-1])
