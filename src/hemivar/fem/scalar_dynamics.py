"""The matrices of a scalar problem in time, on one sparsity, and what acts on it at a time."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy.sparse as sp

from hemivar.basics.types import Array, IntArray
from hemivar.discrete.problem import DiscreteProblem
from hemivar.errors import ProblemError
from hemivar.fem.dynamics import BodyMatrices, BodyMatrix
from hemivar.fem.edge_blocks import node_graph
from hemivar.fem.scalar_energy import contact_of, held_values, scalar_blocks, scalar_load
from hemivar.laws import ContactLaw
from hemivar.mechanics.scalar import ScalarKind, ScalarProblem, Shares

__all__ = ["scalar_acting", "scalar_matrices"]


def scalar_matrices(problem: ScalarProblem, discrete: DiscreteProblem) -> BodyMatrices:
    """Stiffness, viscosity (of heat its capacity) and mass, reduced to the unknowns of :func:`discretize_scalar`.

    Parameters
    ----------
    problem : ScalarProblem
        At one time, where it depends on time.
    discrete : DiscreteProblem
        What :func:`discretize_scalar` made of it.

    Raises
    ------
    ProblemError
        A density, viscosity or capacity is negative somewhere, or by regions that do not cover the mesh.
    """
    field = discrete.field
    assert field is not None
    basis, stiffness = field.basis, discrete.stiffness
    graph, moved = node_graph(problem.mesh, problem.order), moved_nodes(problem)
    free = np.diff(basis.indptr)[:, None] > 0
    if stiffness.shape[0] != basis.shape[1]:
        raise ProblemError("the discrete problem is not made of this statement; discretize the statement")

    def part(shares: Shares | None = None, only_mass: bool = False) -> BodyMatrix:
        stated = problem if shares is None else replace(problem, bedding=0.0, shares=shares)
        blocks = scalar_blocks(stated, graph, only_mass=only_mass)
        data = stiffness.data if shares is None else blocks.matrix(free).data
        inner = sp.csr_array((data, stiffness.indices, stiffness.indptr), shape=stiffness.shape)
        columns = blocks.columns(moved)
        return BodyMatrix(inner, sp.csr_array(basis.T @ columns), sp.csr_array(columns[moved]))

    viscosity = mass = None
    if problem.viscosity is not None:
        viscosity = part(Shares(viscous=1.0, elastic=0.0))
    if problem.capacity is not None:
        viscosity = part(Shares(viscous=1.0), only_mass=True)
    if problem.density is not None:
        mass = part(Shares(inert=1.0), only_mass=True)
    return BodyMatrices(part(), viscosity, mass, (), moved)


def moved_nodes(problem: ScalarProblem) -> IntArray:
    """Nodes that supports may hold at values other than zero, or that change; of heat all that are held."""
    heat = problem.kind is ScalarKind.HEAT  # whose balance asks for all of them
    mesh, order = problem.mesh, problem.order
    members = [
        mesh.facet_nodes(mesh.boundaries[name], order).ravel()
        for name, value in problem.supports.items()
        if heat or callable(value) or value != 0.0
    ]
    return np.unique(np.concatenate([np.zeros(0, dtype=np.int64), *members])).astype(np.int64)


def scalar_acting(problem: ScalarProblem, basis: sp.csr_array) -> tuple[Array, Array, Array, ContactLaw]:
    """Load (nodes,), prescribed values (nodes,), offset (m, c) and law of a problem at one time."""
    nodes = problem.mesh.nodes(problem.order)
    held, value = held_values(problem, nodes)
    prescribed = np.where(held, value, 0.0)
    _, offset, law, _ = contact_of(problem, nodes, basis, prescribed)
    return scalar_load(problem), prescribed, offset, law
