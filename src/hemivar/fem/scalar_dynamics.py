"""The matrices of a scalar problem in time, on one sparsity, and what acts on it at a time."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy.sparse as sp

from hemivar.basics.types import Array, IntArray
from hemivar.discrete.contact import ContactPoints
from hemivar.discrete.problem import DiscreteProblem
from hemivar.errors import ProblemError
from hemivar.fem.dynamics import BodyMatrices, BodyMatrix
from hemivar.fem.scalar_energy import contact_of, full_matrix, held_values, scalar_load
from hemivar.fem.unknowns import pattern_of_nodes, spread
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
    basis, stiffness = field.basis, discrete.linear.stiffness
    moved = moved_nodes(problem)
    pick = sp.csr_array((np.ones(moved.size), (moved, np.arange(moved.size))), shape=(basis.shape[0], moved.size))
    pattern = pattern_of_nodes(problem.mesh, problem.order, basis)

    def part(full: sp.csr_array, inner: sp.csr_array | None = None) -> BodyMatrix:
        if inner is None:
            found = spread(sp.csr_array(basis.T @ full @ basis), pattern)
            inner = sp.csr_array((found.data, stiffness.indices, stiffness.indptr), shape=stiffness.shape)
        columns = sp.csr_array(full @ pick)
        return BodyMatrix(inner, sp.csr_array(basis.T @ columns), sp.csr_array(pick.T @ columns))

    if not (np.array_equal(pattern.indptr, stiffness.indptr) and np.array_equal(pattern.indices, stiffness.indices)):
        raise ProblemError("the discrete problem is not made of this statement; discretize the statement")
    viscosity = mass = None
    if problem.viscosity is not None:
        viscosity = part(full_matrix(replace(problem, bedding=0.0, shares=Shares(viscous=1.0, elastic=0.0))))
    if problem.capacity is not None:
        viscosity = part(full_matrix(replace(problem, bedding=0.0, shares=Shares(viscous=1.0)), only_mass=True))
    if problem.density is not None:
        mass = part(full_matrix(replace(problem, bedding=0.0, shares=Shares(inert=1.0)), only_mass=True))
    return BodyMatrices(part(full_matrix(problem), stiffness), viscosity, mass, (), moved)


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


def scalar_acting(problem: ScalarProblem, basis: sp.csr_array) -> tuple[Array, Array, ContactPoints, ContactLaw]:
    """Load (nodes,), prescribed values (nodes,), contact points and law of a problem at one time."""
    nodes = problem.mesh.nodes(problem.order)
    held, value = held_values(problem, nodes)
    prescribed = np.where(held, value, 0.0)
    contact, law, _ = contact_of(problem, nodes, basis, prescribed)
    return scalar_load(problem), prescribed, contact, law
