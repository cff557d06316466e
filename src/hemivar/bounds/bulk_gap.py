"""The gap of Fenchel's inequality inside a body whose material has a stored energy W, from above.

With a displacement of strain e on each cell, an admissible stress s, ``q = s - W'(e)`` and the Bregman distance
``B(d) = W(e + d) - W(e) - W'(e) : d``

    W(e) + W*(s) - s : e  =  sup_d  q : d - B(d)  =:  g(q).

Twice the integral takes the place of the square of the misfit. W is strongly convex with C_low, so that at any d

    g(q) <= q : d - B(d) + |q - (W'(e + d) - W'(e))|^2 / 2,      |.| that of C_low^-1,

and with d = 0 ``g(q) <= |q|^2 / 2``. For the same reason ``|q|^2 / 2 - g(q)`` is convex in q. q is linear on each part
of a piece of a cell, so that by Jensen's inequality, q_c being its value at the centroid,

    int g(q) <= int |q|^2 / 2 - volume (|q_c|^2 / 2 - g(q_c)):

the first integral is that of a polynomial, and g is evaluated at centroids alone. No integral is left to a rule. Where
C_low holds for strains up to a reach only, so must ``e + d``: then g is the supremum over these, for exact solutions
whose strains are within the reach.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from hemivar.basics.types import Array
from hemivar.bounds.body_data import BodyData, CellEnergy
from hemivar.bounds.split_element import SplitElement, voigt_map
from hemivar.mesh.mesh import Mesh

__all__ = ["saved_by_curvature", "strain_sizes"]

#: How often each piece of a cell is cut into halves, and the steps of the search for d.
_HALVINGS = {2: 2, 3: 1}
_STEPS = 3
#: Roundings of energies that are subtracted.
_ROUNDED = 16.0 * float(np.finfo(float).eps)
#: Cells whose numbers are held at a time.
_CELLS = 1 << 12


def saved_by_curvature(data: BodyData, element: SplitElement, difference: Array) -> Array:
    """Lower bounds (M,) of ``int_T |q|^2 - 2 g(q)`` on each cell, none below zero; linear elements.

    ``difference`` is (M, n).
    """
    assert data.stored is not None
    table, centroids, lowered = data.table, _centroids(data.table.dim), np.zeros(len(difference))
    compliance = np.broadcast_to(data.compliance, (len(difference), *data.compliance.shape[1:]))
    for start in range(0, len(lowered), _CELLS):
        part = slice(start, start + _CELLS)
        change = voigt_map(table.jacobian[part]) / table.sizes[part, None, None]
        nodes = element.at_nodes(difference[part])
        q = np.einsum("mvw,ca,mbaw->mbcv", change, centroids, nodes, optimize=True)
        q = q.reshape(len(nodes), -1, q.shape[3])
        strain = data.engineering[part, None]
        reach = data.problem.material.reach
        saved = _saved(data.stored.at(part), strain, q, compliance[part], data.sweep_compliance[part], reach)
        lowered[part] = 2.0 * table.volumes[part] * saved.mean(axis=1)
    return lowered


def strain_sizes(strain: Array, dim: int) -> Array:
    """Upper bounds of the sizes ``|eps|`` in space of strains (..., v) with engineering shear.

    In the plane the strain across it is at most the trace of those in it, as for a linear body.
    """
    square = (strain[..., :dim] ** 2).sum(axis=-1) + 0.5 * (strain[..., dim:] ** 2).sum(axis=-1)
    return np.asarray(np.sqrt(square + (strain[..., :dim].sum(axis=-1) ** 2 if dim == 2 else 0.0)))


def _saved(stored: CellEnergy, strain: Array, q: Array, compliance: Array, start: Array, reach: float) -> Array:
    """Lower bounds (M, p) of ``|q|^2 / 2 - g(q)`` for q (M, p, v), none below zero; ``start`` is W''(e)^-1."""

    def square(stress: Array) -> Array:
        return np.asarray(np.einsum("mpv,mvw,mpw->mp", stress, compliance, stress, optimize=True))

    most, best = 0.5 * square(q), np.zeros(q.shape[:2])
    value, stress = stored.value(strain), stored.stress(strain)
    d, rest = np.zeros(q.shape), q
    for _ in range(_STEPS):
        d = d + np.einsum("mvw,mpw->mpv", start, rest)
        there = strain + d
        energy, work = stored.value(there), np.einsum("mpv,mpv->mp", stress + q, d)
        rest = q - (stored.stress(there) - stress)
        above = work - (energy - value) + 0.5 * square(rest)
        above += _ROUNDED * (np.abs(work) + np.abs(energy) + np.abs(value))
        within = strain_sizes(there, stored.places.shape[2]) <= reach
        best = np.maximum(best, np.where(within, most - above, 0.0))
    return np.asarray(best)


@cache
def _centroids(dim: int) -> Array:
    """Barycentric coordinates (p, d + 1) of the centroids of the parts of a piece, which have the same volume."""
    corners = np.vstack([np.zeros(dim), np.eye(dim)])
    mesh = Mesh.oriented(corners, [list(range(dim + 1))])
    for _ in range(_HALVINGS[dim]):
        mesh = mesh.refined()
    places = mesh.points[mesh.cells].mean(axis=1)
    return np.column_stack([1.0 - places.sum(axis=1), places])
