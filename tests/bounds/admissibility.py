"""How far a stress is from equilibrium with its loads: its work against quadratic fields."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hemivar.basics.types import Array
from hemivar.bounds.admissible_stress import AdmissibleStress
from hemivar.bounds.split_element import pairs_of
from hemivar.fem.elements import shape_derivatives, shape_values
from hemivar.fem.quadrature import quadrature_rule
from hemivar.fem.supports import stated_supports
from hemivar.mechanics import ContactProblem


def held_part_removed(problem: ContactProblem, field: Array, order: int) -> Array:
    """Nodal values (nodes, d) of a field of that order without what the supports hold."""
    supports = stated_supports(replace(problem, order=order, contact={}))
    along = np.einsum("nqd,nd->nq", supports.directions, field)
    return np.asarray(field - np.einsum("nq,nqd->nd", along, supports.directions))


def imbalance(stress: AdmissibleStress, seed: int, order: int = 2) -> float:
    """``int s : eps(v) - int f0 . v - int f_N . v + <xi, v>`` for a random v of degree 2 (or 1), over the sum of sizes.

    v is continuous, quadratic on every cell, and vanishes where supports hold it; on contact facets of two bodies it is
    the jump that counts. Loads are taken by their moments
    for v of degree 1, as constants for degree 2.
    """
    data, table = stress.data, stress.data.table
    mesh, dim = table.mesh, table.dim
    nodes = mesh.cell_nodes(order)
    field = np.random.default_rng(seed).normal(size=(len(mesh.nodes(order)), dim))
    field = held_part_removed(data.problem, field, order)

    # stresses stand in the order of sorted vertices, fields in that of the mesh
    rank = np.argsort(np.argsort(table.places[mesh.cells], axis=1), axis=1)
    barycentric, weights = quadrature_rule(dim, 2 + data.order)
    work, size = 0.0, 0.0
    gradients = np.take_along_axis(table.gradients, rank[:, :, None], axis=1)
    for piece in range(dim + 1):
        corners = np.eye(dim + 1)
        corners[piece] = 1.0 / (dim + 1)
        for point, weight in zip(barycentric, weights, strict=True):
            vector = np.einsum("a,map->mp", shape_values(data.order, point), stress.stresses[:, piece])
            tensor = np.empty((len(vector), dim, dim))
            for component, (i, j) in enumerate(pairs_of(dim)):
                tensor[:, i, j] = tensor[:, j, i] = vector[:, component]
            at = (point @ corners)[rank]  # barycentric coordinates in the order of the mesh, cell by cell
            for place in np.unique(at, axis=0):
                cells = np.flatnonzero((at == place).all(axis=1))
                shapes = np.einsum("la,mad->mld", shape_derivatives(order, place), gradients[cells])
                slope = np.einsum("mlc,mld->mcd", field[nodes[cells]], shapes)
                local = weight * table.volumes[cells] / (dim + 1) * np.einsum("mij,mij->m", tensor[cells], slope)
                work, size = work + local.sum(), size + np.abs(local).sum()
    if order == 1:
        work -= np.einsum("mac,mac->", data.linear(data.loads + stress.tractions.defect), field[table.cells])
    else:
        force = (data.loads + stress.tractions.defect).sum(axis=1) / table.volumes[:, None]
        point, weights = quadrature_rule(dim, 2)
        mean = weights @ shape_values(2, point)
        work -= np.einsum("mc,m,l,mlc->", force, table.volumes, mean, field[nodes])

    # on the boundary: tractions that are given, and what acts on contact facets; both are in the moments
    outer = np.flatnonzero(~table.interior)
    facets = table.facets[outer]
    point, weights = quadrature_rule(dim - 1, 4)
    shapes = shape_values(data.order, point)
    mass = table.measures[outer, None, None] * np.einsum("q,qa,qb->ab", weights, shapes, shapes)
    traction = np.linalg.solve(mass, stress.tractions.moments[outer])
    loose = np.eye(dim) - data.unknown[outer]
    given = np.linalg.solve(mass, data.facet_loads[outer])
    prescribed = np.einsum("fij,faj->fai", loose, np.where((data.contact[outer] >= 0)[:, None, None], traction, given))
    across = field[mesh.facet_nodes(table.others[outer], order)] * table.cut[outer, None, None]
    values = field[mesh.facet_nodes(facets, order)] - across
    values = np.einsum("ql,flc->fqc", shape_values(order, point), values)
    values = np.einsum("fij,fqj->fqi", loose, values)
    on = np.einsum("qa,fac->fqc", shapes, prescribed)
    local = np.einsum("q,f,fqc,fqc->f", weights, table.measures[outer], on, values)
    return float(abs(work - local.sum()) / (size + np.abs(local).sum()))
