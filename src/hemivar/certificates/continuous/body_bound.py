"""A guaranteed lower bound of ``inf a(v, v) / |v|^2`` over a body, rough on purpose.

For a load f in L2 let t be a stress of the split element whose divergence has the moments of ``-f`` against linear
fields of every cell. The rest is orthogonal to these, at most ``theta |f|``, and seen by the oscillation of v alone:

    |w(f)|_a <= |t| + theta kappa |f|,      1 / Lambda <= (sqrt(mu) + theta kappa)^2,

mu the largest least energy of such t for cellwise linear loads of norm one, kappa the largest constant of a cell.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import scipy.sparse.linalg as spla

from hemivar.basics.types import Array
from hemivar.certificates.continuous.bare_body import bare_body
from hemivar.certificates.continuous.equilibrated_blocks import equilibrated_blocks
from hemivar.certificates.continuous.facet_constants import mass_root
from hemivar.certificates.continuous.facet_table import facet_table
from hemivar.certificates.continuous.held_facets import held_facets
from hemivar.certificates.continuous.local_constants import local_constants
from hemivar.certificates.continuous.simplex_constants import missed_part
from hemivar.certificates.continuous.split_element import pulled_back
from hemivar.errors import ProblemError
from hemivar.fem.constitutive import constitutive_law
from hemivar.fem.directed_matrix import directed_matrix
from hemivar.mechanics.statement import ContactProblem
from hemivar.systems.workspace import Workspace

__all__ = ["body_bound"]

#: The coarsest mesh of the body with at least so many cells is taken.
_CELLS = {2: 32, 3: 48}


def body_bound(problem: ContactProblem, workspace: Workspace | None = None) -> float:
    """Lower bound of ``inf a(v, v) / |v|^2`` over the displacements that vanish where supports hold them."""
    bare = bare_body(problem)
    while bare.mesh.number_of_cells < _CELLS[bare.mesh.dim]:
        bare = replace(bare, mesh=bare.mesh.refined())
    table = facet_table(bare.mesh)
    matrices, _ = constitutive_law(bare).on(bare.mesh, 2)
    if np.abs(matrices - matrices[:, :1]).max() > 1e-13 * np.abs(matrices).max():
        raise ProblemError("the material varies inside cells; bounds of constants of a body need it constant on each")
    held = held_facets(bare, table)

    def find() -> float:
        dim, count = table.dim, len(table.cells)
        compliance = pulled_back(np.asarray(np.linalg.inv(matrices[:, 0]), dtype=float), table.jacobian, table.sizes)
        blocks = equilibrated_blocks(compliance, table.jacobian, loaded=True)
        own = len(table.facets) * dim + np.arange(count * (dim + 1)).reshape(count, -1)
        nodes = np.hstack([(table.cell_facets[:, :, None] * dim + np.arange(dim)).reshape(count, -1), own])
        fixed = np.concatenate([np.repeat(held, dim, axis=0), np.zeros((own.size, dim, dim))])
        system = directed_matrix(blocks, nodes, fixed)
        weights = np.einsum("c,ab,ij->caibj", np.sqrt(table.volumes), mass_root(dim + 1), np.eye(dim))
        R = system.rows(own, weights.reshape(count, -1, dim + 1, dim))
        factor = system.factor()

        def times(f: Array) -> Array:
            return np.asarray(R @ factor.solve(R.T @ f.ravel()))

        operator = spla.LinearOperator((R.shape[0], R.shape[0]), matvec=times, dtype=float)
        start = np.random.default_rng(0).normal(size=R.shape[0])
        values, vectors = spla.eigsh(operator, 1, which="LA", v0=start, tol=1e-4)
        value, vector = float(values[0]), vectors[:, 0]
        mu = value + float(np.linalg.norm(times(vector) - value * vector))
        kappa = float(local_constants(table, matrices[:, 0]).cell.max())
        return (math.sqrt(mu) + missed_part(dim) * kappa) ** -2

    if workspace is None:
        return find()
    parts = (bare.mesh.points, bare.mesh.cells, matrices, held)
    return workspace.once("lower bound over the body", parts, find)
