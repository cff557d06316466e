"""The matrices of a body that moves in time: stiffness, viscosity, mass and those of its branches, on one sparsity."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from hemivar.basics.arguments import expect
from hemivar.basics.portable import Portable
from hemivar.basics.types import Array, IntArray
from hemivar.discrete.problem import DiscreteProblem
from hemivar.errors import ProblemError
from hemivar.fem.edge_blocks import node_graph
from hemivar.fem.mass import body_blocks, mass_blocks
from hemivar.fem.supports import Supports
from hemivar.fem.unknowns import nodal_conditions
from hemivar.mechanics.bedding import Bedding, bedding_of
from hemivar.mechanics.composed_material import Combination
from hemivar.mechanics.conditions import Support, prescribed_values
from hemivar.mechanics.material import Material
from hemivar.mechanics.statement import ContactProblem

__all__ = ["BodyMatrices", "BodyMatrix", "body_matrices", "moved_components"]


@dataclass(frozen=True, eq=False)
class BodyMatrix(Portable):
    """A symmetric matrix A of nodal displacements ``U = P u + E z``, z the displacements that supports prescribe.

    Attributes
    ----------
    matrix : sparse array, shape (n, n)
        ``P'A P``.
    coupling : sparse array, shape (n, k)
        ``P'A E``.
    held : sparse array, shape (k, k)
        ``E'A E``.
    """

    matrix: sp.csr_array
    coupling: sp.csr_array
    held: sp.csr_array

    def energy(self, u: Array, z: Array) -> float:
        """``U'A U / 2`` of unknowns (n,) and prescribed displacements (k,)."""
        return 0.5 * float(u @ (self.matrix @ u)) + float(u @ (self.coupling @ z)) + 0.5 * float(z @ (self.held @ z))

    def times(self, u: Array, z: Array) -> Array:
        """``P'A U``, shape (n,)."""
        return np.asarray(self.matrix @ u + self.coupling @ z)


@dataclass(frozen=True, eq=False)
class BodyMatrices(Portable):
    """What a body is made of, reduced to the unknowns of :func:`discretize`; the arrays of the sparsity are shared.

    Attributes
    ----------
    stiffness : BodyMatrix
        With the bedding that is stated.
    viscosity : BodyMatrix or None
    mass : BodyMatrix or None
    branches : tuple of (relaxation time, BodyMatrix)
        In the order of :attr:`Material.relaxation_times`.
    moved : int array, shape (k,)
        Nodal components, ``node * d + c``, whose prescribed displacements z may differ from zero.
    """

    stiffness: BodyMatrix
    viscosity: BodyMatrix | None
    mass: BodyMatrix | None
    branches: tuple[tuple[float, BodyMatrix], ...]
    moved: IntArray

    def effective(self, viscous: float = 0.0, branches: Sequence[float] = (), inertia: float = 0.0) -> BodyMatrix:
        """``K + viscous C + inertia M + sum_i branches_i K_i``; the sparsity is shared.

        Parameters
        ----------
        viscous, inertia : float
        branches : sequence of float
            One for each branch; none leaves them out.
        """
        parts = [(viscous, self.viscosity), (inertia, self.mass)]
        parts += [(share, part) for share, (_, part) in zip(branches, self.branches, strict=True)] if branches else []
        stiffness = self.stiffness
        data = stiffness.matrix.data.copy()
        coupling, held = stiffness.coupling, stiffness.held
        for factor, part in parts:
            if factor and part is not None:
                data += factor * part.matrix.data
                coupling, held = coupling + factor * part.coupling, held + factor * part.held
        return BodyMatrix(_like(stiffness.matrix, data), sp.csr_array(coupling), sp.csr_array(held))


def body_matrices(problem: ContactProblem, discrete: DiscreteProblem | None = None) -> BodyMatrices:
    """The matrices of a body: its stiffness is that of :func:`discretize`, the others stand on the same sparsity.

    Parameters
    ----------
    problem : ContactProblem
        At one time, where it depends on time.
    discrete : DiscreteProblem, optional
        What :func:`discretize` made of the same problem: its stiffness is taken, and the arrays of its sparsity.

    Raises
    ------
    ProblemError
        A density is not positive, a viscosity or a branch not positive semidefinite, or as in :func:`discretize`.
    """
    problem = expect(problem, ContactProblem, "what to make matrices of", "give the ContactProblem")
    material, bedding = problem.material, bedding_of(problem.bedding)
    conditions = nodal_conditions(problem)
    maker = _Maker(problem, conditions.supports)
    known = None if discrete is None else discrete.stiffness
    if known is not None and known.shape[0] != conditions.basis.shape[1]:
        raise ProblemError("the discrete problem is not made of this statement; discretize the statement")
    mesh, graph = problem.mesh, node_graph(problem.mesh, problem.order)

    def make(elastic: Material | None, dense: Bedding, like: sp.csr_array | None) -> BodyMatrix:
        blocks = mass_blocks(mesh, dense, graph) if elastic is None else body_blocks(mesh, elastic, dense, graph)
        coupling, held = maker.coupled(blocks.columns(maker.moved), conditions.basis)
        if elastic is material and known is not None:
            return BodyMatrix(known, coupling, held)
        blocks.turn(conditions.directions)
        matrix = blocks.matrix(conditions.free)
        return BodyMatrix(matrix if like is None else _like(like, matrix.data), coupling, held)

    stiffness = make(material, bedding, None)
    like = stiffness.matrix
    times = material.relaxation_times
    none = (0.0,) * len(times)
    viscosity = make(Combination(material, 0.0, 1.0, none), Bedding(), like) if material.viscous else None
    mass = make(None, Bedding(0.0, material, 1.0), like) if material.inert else None
    branches = tuple(
        (time, make(Combination(material, 0.0, 0.0, (*none[:i], 1.0, *none[i + 1 :])), Bedding(), like))
        for i, time in enumerate(times)
    )
    return BodyMatrices(stiffness, viscosity, mass, branches, maker.moved)


def _like(matrix: sp.csr_array, data: Array) -> sp.csr_array:
    """A matrix of other entries that shares the arrays of the sparsity."""
    made = sp.csr_array(matrix.shape)
    made.data, made.indices, made.indptr = data, matrix.indices, matrix.indptr
    made.has_sorted_indices = made.has_canonical_format = True
    return made


class _Maker:
    """What the displacements that supports prescribe take of a matrix."""

    def __init__(self, problem: ContactProblem, supports: Supports) -> None:
        self.moved = moved_components(problem, supports)

    def coupled(self, columns: sp.csr_array, basis: sp.csr_array) -> tuple[sp.csr_array, sp.csr_array]:
        return sp.csr_array(basis.T @ columns), sp.csr_array(columns[self.moved])


def moved_components(problem: ContactProblem, supports: Supports) -> IntArray:
    """Nodal components along which a support may move its node."""
    names = [name for name, support in problem.supports.items() if _moves(support)]
    if not names:
        return np.zeros(0, dtype=np.int64)
    nodes = np.unique(
        np.concatenate(
            [problem.mesh.facet_nodes(problem.mesh.boundaries[name], problem.order).ravel() for name in names]
        )
    )
    held = np.abs(supports.directions[nodes]).max(axis=1) > 0.0
    node, component = np.nonzero(held)
    return np.asarray(nodes[node] * supports.nodes.shape[1] + component, dtype=np.int64)


def _moves(support: Support) -> bool:
    """Whether a support may displace what it holds."""
    return any(callable(value) or bool(np.any(np.asarray(value))) for value in prescribed_values(support))
