"""What an admissible stress of a body must fulfil: loads of cells and facets, and what the supports leave unknown.

All integrals are those of the discretisation, rule by rule, so that the equilibrium of the nodes that a discrete
solution fulfils is that of the data here.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from hemivar.basics.arrays import real_array
from hemivar.basics.types import Array, IntArray
from hemivar.errors import ProblemError
from hemivar.fem.assembly import quadrature_rule, tensors
from hemivar.fem.elements import voigt_index
from hemivar.fem.facet_table import FacetTable, facet_table
from hemivar.fem.held_facets import held_facets
from hemivar.fem.split_element import pulled_back
from hemivar.mechanics.bedding import bedding_of
from hemivar.mechanics.conditions import Pressure, evaluate_scalar, evaluate_vector
from hemivar.mechanics.statement import ContactProblem

__all__ = ["BodyData", "body_data"]

#: Part of a modulus by which it may vary within a cell and count as constant.
_CONSTANT = 1e-13


@dataclass(frozen=True, eq=False)
class BodyData:
    """Data of a body for the stresses of one displacement.

    Attributes
    ----------
    problem : ContactProblem
    table : FacetTable
    displacement : array, shape (N, d)
    strain : array, shape (M, d, d)
        Of the displacement, constant on cells.
    stress : array, shape (M, d, d)
        Mean over each cell of ``C eps``.
    tensors : array, shape (M or 1, q or 1, v, v)
        Elasticity matrices at the points of the rule of degree 2, and ``weights``, shape (q or 1,), of the rule.
    weights : array, shape (q or 1,)
    loads : array, shape (M, d + 1, d)
        ``int_T f0 phi_a``.
    facet_loads : array, shape (F, d, d)
        ``int_F f_N phi_a`` of the tractions that are given.
    unknown : array, shape (F, d, d)
        Projections on the components of the traction that nothing prescribes: all of them inside, those along which
        supports hold the body on its boundary.
    contact : int array, shape (F,)
        The place of the contact boundary in ``problem.contact``, or -1.
    """

    problem: ContactProblem
    table: FacetTable
    displacement: Array
    strain: Array
    stress: Array
    tensors: Array
    weights: Array
    loads: Array
    facet_loads: Array
    unknown: Array
    contact: IntArray

    @cached_property
    def varies(self) -> bool:
        """Whether the elasticity matrix varies within cells."""
        first = self.tensors[:, :1]
        return bool(np.abs(self.tensors - first).max() > _CONSTANT * np.abs(first).max())

    @cached_property
    def compliance(self) -> Array:
        """Inverses of the mean elasticity matrices, shape (M or 1, v, v)."""
        return np.linalg.inv(np.einsum("q,mqvw->mvw", self.weights, self.tensors))

    @cached_property
    def reference_compliance(self) -> Array:
        """The same on the reference simplex, shape (M, v, v)."""
        return pulled_back(self.compliance, self.table.jacobian, self.table.sizes)

    @property
    def cell_moments(self) -> Array:
        """Moments of the tractions of the mean stress on the facets of each cell, outward, shape (M, d + 1, d)."""
        table = self.table
        return np.asarray(
            -np.einsum("m,mij,maj->mai", table.volumes, self.stress, table.gradients, optimize=True)
        )  # int_F s nu phi = |F| s nu / d, and |F| nu = -d |T| grad


def body_data(problem: ContactProblem, displacement: Array) -> BodyData:
    """The data of a problem with linear elements, and a displacement, shape (N, d).

    Raises
    ------
    ProblemError
        Elements are quadratic, the body has a bedding, or the displacement has another shape.
    """
    if problem.order != 1:
        raise ProblemError("admissible stresses are made of linear elements; take order = 1")
    if not bedding_of(problem.bedding).none:
        raise ProblemError("admissible stresses are made of bodies without bedding; leave the bedding out")
    u = real_array(displacement, "the displacement")
    mesh = problem.mesh
    if u.shape != mesh.points.shape:
        raise ProblemError(f"the displacement has shape {u.shape}; a field of order 1 on this mesh has shape "
                           f"{mesh.points.shape}")  # fmt: skip
    table = facet_table(mesh)
    gradient = np.einsum("mai,maj->mij", u[table.cells], table.gradients)
    strain = 0.5 * (gradient + gradient.transpose(0, 2, 1))
    matrices, weights = tensors(mesh, problem.material, 2)
    index = voigt_index(mesh.dim)
    mean = np.einsum("q,mqvw->mvw", weights, matrices)[:, index[:, :, None, None], index]
    stress = np.einsum("mijkl,mkl->mij", np.broadcast_to(mean, (len(strain), *mean.shape[1:])), strain, optimize=True)
    contact = np.full(len(table.facets), -1, dtype=np.int64)
    for number, name in enumerate(problem.contact):
        contact[table.numbers(mesh.boundaries[name])] = number
    return BodyData(
        problem, table, u, strain, stress, matrices, weights,
        _cell_loads(problem, table), _facet_loads(problem, table), _unknown(problem, table), contact,
    )  # fmt: skip


def _cell_loads(problem: ContactProblem, table: FacetTable) -> Array:
    mesh, force = problem.mesh, problem.body_force
    dim = mesh.dim
    if not callable(force):
        value = evaluate_vector(force, mesh.points[:1], "body_force")[0]
        return np.asarray(
            np.broadcast_to((table.volumes / (dim + 1))[:, None, None] * value, (*table.cells.shape, dim))
        )
    barycentric, weights = quadrature_rule(dim, 4)
    places = np.einsum("qa,mad->mqd", barycentric, mesh.points[mesh.cells])
    values = evaluate_vector(force, places.reshape(-1, dim), "body_force").reshape(places.shape)
    local = np.einsum("q,qa,mqd,m->mad", weights, barycentric, values, table.volumes, optimize=True)
    order = np.argsort(mesh.cells, axis=1, kind="stable")
    return np.asarray(np.take_along_axis(local, order[:, :, None], axis=1))


def _facet_loads(problem: ContactProblem, table: FacetTable) -> Array:
    mesh = problem.mesh
    dim = mesh.dim
    loads = np.zeros((len(table.facets), dim, dim))
    barycentric, weights = quadrature_rule(dim - 1, 5)
    for name, traction in problem.tractions.items():
        facets = mesh.boundaries[name]
        normals, measures = mesh.facet_normals(facets)
        places = np.einsum("qa,kad->kqd", barycentric, mesh.points[facets])
        flat, what = places.reshape(-1, dim), f"tractions['{name}']"
        if isinstance(traction, Pressure):
            values = -evaluate_scalar(traction.value, flat, what)[:, None] * np.repeat(normals, len(weights), axis=0)
        else:
            values = evaluate_vector(traction, flat, what)
        local = np.einsum("q,qa,kqd,k->kad", weights, barycentric, values.reshape(places.shape), measures)
        order = np.argsort(facets, axis=1, kind="stable")
        loads[table.numbers(facets)] += np.take_along_axis(local, order[:, :, None], axis=1)
    return loads


def _unknown(problem: ContactProblem, table: FacetTable) -> Array:
    unknown = held_facets(problem, table)
    unknown[table.interior] = np.eye(table.dim)
    return unknown
