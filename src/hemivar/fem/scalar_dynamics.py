"""The matrices of a scalar problem in time, on one sparsity, and what acts on it at a time."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from hemivar.basics.types import Array, IntArray
from hemivar.discrete.operator_family import OperatorFamily
from hemivar.discrete.problem import DiscreteProblem
from hemivar.fem.assembly import stiffness_blocks
from hemivar.fem.constitutive import viscous
from hemivar.fem.dynamics import Reduction
from hemivar.fem.edge_blocks import node_graph
from hemivar.fem.mass import mass_blocks, per_volume
from hemivar.fem.scalar_energy import contact_of, held_values, scalar_blocks, scalar_load
from hemivar.laws import ContactLaw
from hemivar.mechanics.scalar import ScalarKind, ScalarProblem

__all__ = ["scalar_acting", "scalar_family"]


def scalar_family(problem: ScalarProblem, discrete: DiscreteProblem, *, with_mass: bool = True) -> OperatorFamily:
    """Stiffness, viscosity (of heat its capacity) and mass, reduced to the unknowns of :func:`discretize_scalar`.

    Parameters
    ----------
    problem : ScalarProblem
        At one time, where it depends on time.
    discrete : DiscreteProblem
        What :func:`discretize_scalar` made of it.
    with_mass : bool
        Whether the mass is asked for.

    Raises
    ------
    ProblemError
        A density, viscosity or capacity is negative somewhere, or by regions that do not cover the mesh.
    """
    field = discrete.field
    assert field is not None
    graph, moved = node_graph(problem.mesh, problem.order), moved_nodes(problem)
    reduction = Reduction(discrete, moved, np.diff(field.basis.indptr)[:, None] > 0)

    mesh, stiffness = problem.mesh, reduction.stiffness(lambda: scalar_blocks(problem, graph))
    viscosity = mass = None
    if problem.viscosity is not None:
        viscosity = reduction.part(stiffness_blocks(mesh, viscous(problem, mesh.dim), graph), stiffness)
    if problem.capacity is not None:
        capacity = per_volume(problem.capacity, "capacity")
        viscosity = reduction.part(mass_blocks(mesh, capacity, graph, graph.zeros(1)))
    if with_mass and problem.density is not None:
        mass = reduction.part(mass_blocks(mesh, per_volume(problem.density, "density"), graph, graph.zeros(1)))
    return OperatorFamily(discrete, stiffness, viscosity, mass, (), moved)


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
