"""The constants that a bound of the distance to the exact solution needs of the body, and where they come from.

``Lambda = inf a(v, v) / |v|^2`` over the fields that vanish where supports hold the body, with the norm of the trace on
the contact boundary (both components, or one kind alone), or with that of v over the body. A bound holds if these are
lower bounds of the continuous problem. Those of a discrete space tend to them as the mesh is refined and are no lower
bounds: what rests on them is an estimate.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp

from hemivar.adapt.lower_bounds import lower_bounds
from hemivar.basics.types import Array, IntArray
from hemivar.certify.norms import EnergyNorm, MultigridNorm, energy_norm
from hemivar.discrete.problem import DiscreteProblem
from hemivar.errors import ProblemError
from hemivar.fem.discretize import discretize
from hemivar.fem.facet_table import FacetTable
from hemivar.mechanics.statement import ContactProblem
from hemivar.systems.workspace import Workspace

__all__ = ["LocalConstants", "TraceBounds", "discrete_trace_bounds", "guaranteed_trace_bounds", "local_constants"]

#: sup |v - P v| / |eps(v)| on the regular simplex of edge 1, P the projection on linear fields, over the simplex and
#: on one facet: by polynomials of rising degree, rounded up by some percent. Computed, not proved.
_CELL = {2: 0.35, 3: 0.32}
_FACET = {2: 0.97, 3: 1.25}


@dataclass(frozen=True)
class TraceBounds:
    """Lower bounds of Lambda.

    Attributes
    ----------
    both, normal, tangential : float
        On the contact boundary: with ``v``, with ``v_nu`` and with ``v_tau`` alone; stiffness per area. inf where
        there is no contact; 0 where nothing but contact holds the body.
    body : float
        Over the body; stiffness per volume.
        That over the body counts only for what a displacement lacks for equilibrium in the discrete space, which is
        rounding after a solve; it may be that of the discrete problem.
    guaranteed : bool
        Whether those on the contact boundary are shown to be lower bounds of the continuous problem.
    source : str
        Where they come from, in words.
    weighted : callable, optional
        Upper bound of ``sup int alpha |v|^2 / a(v, v)`` for constants ``alpha`` of the normal and of the tangential
        law, (k,) each, on contact facets given by their nodes, (k, d).
    """

    both: float
    normal: float
    tangential: float
    body: float
    guaranteed: bool
    source: str
    weighted: Callable[[IntArray, Array, Array], float] | None = None

    def __post_init__(self) -> None:
        for name in ("both", "normal", "tangential", "body"):
            value = getattr(self, name)
            if not value >= 0.0:
                raise ProblemError(f"the trace bound '{name}' is {value}; give a number that is not negative")

    def softening(self, facets: IntArray, normal: Array, tangential: Array) -> float:
        """c, an upper bound of ``sup int alpha |v|^2 / a(v, v)``, for constants (k,) on the contact facets (k, d)."""
        if not (np.any(normal > 0.0) or np.any(tangential > 0.0)):
            return 0.0
        along, across = float(normal.max(initial=0.0)), float(tangential.max(initial=0.0))
        if not np.isfinite(along + across):
            return np.inf
        with np.errstate(divide="ignore", invalid="ignore"):
            together = max(along, across) / self.both if self.both > 0.0 else np.inf
            pairs = ((along, self.normal), (across, self.tangential))
            apart = sum(alpha / bound if bound > 0.0 else np.inf for alpha, bound in pairs if alpha > 0.0)
        weighted = np.inf if self.weighted is None else self.weighted(facets, normal, tangential)
        return float(min(together, apart, weighted))

    def distance(self, normal: Array, tangential: Array) -> float:
        """rho for integrals (k,) of the squares of the normal and of the tangential part of a force on the facets."""
        along, across = float(normal.sum()), float(tangential.sum())

        def over(square: float, bound: float) -> float:
            return 0.0 if square == 0.0 else float(np.sqrt(square / bound)) if bound > 0.0 else np.inf

        return min(over(along + across, self.both), over(along, self.normal) + over(across, self.tangential))


@dataclass(frozen=True, eq=False)
class LocalConstants:
    """Constants of cells and facets for loads that are orthogonal to linear fields.

    Attributes
    ----------
    cell : array, shape (M,)
        ``sup |v - P v|_T / |v|_{a,T}``, P the projection on linear fields.
    facet : array, shape (M, d + 1)
        ``sup |v - P v|_F / |v|_{a,T}`` for each facet of the cell.
    guaranteed : bool
    """

    cell: Array
    facet: Array
    guaranteed: bool


def local_constants(table: FacetTable, stiffness: Array) -> LocalConstants:
    """Constants from those of the regular simplex.

    With B the map from the regular simplex of edge 1 and ``v^ = B'v`` strains are related by ``eps^ = B' eps B``, so
    the constants grow by ``s_max(B)^2 / s_min(B)``, on facets times ``sqrt(|F| / |F^|) sqrt(|T^| / |T|)``.

    Parameters
    ----------
    table : FacetTable
    stiffness : array, shape (M or 1, v, v)
        Elasticity matrices, the least of each cell.
    """
    dim = table.dim
    corners = np.array([[0.0, 0.0], [1.0, 0.0], [0.5, np.sqrt(0.75)]])
    if dim == 3:
        corners = np.array([[0, 0, 0], [1, 0, 0], [0.5, np.sqrt(0.75), 0], [0.5, np.sqrt(1 / 12), np.sqrt(2 / 3)]])
    regular = (corners[1:] - corners[0]).T
    stretch = np.linalg.svd(table.jacobian @ np.linalg.inv(regular), compute_uv=False)
    scale = np.where(np.arange(stiffness.shape[-1]) < dim, 1.0, np.sqrt(2.0))
    least = np.linalg.eigvalsh(stiffness * np.outer(scale, scale))[:, 0]
    factor = stretch[:, 0] ** 2 / stretch[:, -1] / np.sqrt(least)
    measure = 1.0 if dim == 2 else np.sqrt(3.0) / 4.0
    volume = np.prod(stretch, axis=1)
    on_facets = np.sqrt(table.measures[table.cell_facets] / measure / volume[:, None])
    return LocalConstants(_CELL[dim] * factor, _FACET[dim] * factor[:, None] * on_facets, False)


def discrete_trace_bounds(problem: DiscreteProblem, workspace: Workspace | None = None) -> TraceBounds:
    """The constants of a discrete problem, which are no bounds of the continuous ones.

    Traces are lumped at the nodes (or taken at midpoints), as the discretisation does. Of quadratic elements they are
    those of linear ones on the same mesh: constants belong to the body.

    Parameters
    ----------
    problem : DiscreteProblem
        From :func:`hemivar.discretize`.
    workspace : Workspace, optional
        Keeps them for other loads and laws of the body.
    """
    origin = problem.origin
    if isinstance(origin, ContactProblem) and origin.order != 1:
        problem = discretize(replace(origin, order=1), check_coercivity=False)
    kept = Workspace.given(workspace)
    energy = energy_norm(problem, kept)
    source = "from the discrete problem: no bounds of the continuous one"
    if not energy.definite:
        return TraceBounds(0.0, 0.0, 0.0, 0.0, False, source)
    found = kept.once("discrete trace bounds", problem, lambda: _eigenvalues(problem, energy))
    contact = problem.contact

    def weighted(facets: IntArray, normal: Array, tangential: Array) -> float:
        assert problem.field is not None
        mesh = problem.field.mesh
        at = np.zeros((mesh.number_of_nodes, 2))
        for column, values in enumerate((normal, tangential)):
            for corner in facets.T:
                np.maximum.at(at[:, column], corner, values)
        if (contact.node < 0).any():
            return np.inf
        weight = np.repeat(at[contact.node, 1:], contact.components, axis=1)
        weight[:, 0] = at[contact.node, 0]
        rows = (contact.weights[:, None] * weight).ravel()
        return energy.largest_eigenvalue(contact.trace, rows).bound

    return TraceBounds(*found, guaranteed=False, source=source, weighted=weighted)


def guaranteed_trace_bounds(problem: DiscreteProblem, workspace: Workspace | None = None) -> TraceBounds:
    """Lower bounds of the continuous problem, by :func:`hemivar.adapt.lower_bounds.lower_bounds`.

    Parameters
    ----------
    problem : DiscreteProblem
        From :func:`hemivar.discretize`.
    workspace : Workspace, optional
        Keeps them for other loads and laws of the body.

    Raises
    ------
    ProblemError
        The problem was made of arrays, has no contact, is not held without it, or its material varies within cells.
    """
    kept = Workspace.given(workspace)
    origin = problem.origin
    if not isinstance(origin, ContactProblem):
        raise ProblemError("lower bounds of trace constants need the statement of a body; discretize a ContactProblem")
    found = kept.once("lower bounds of trace constants", problem, lambda: lower_bounds(origin))
    body = discrete_trace_bounds(problem, kept).body
    lowest = (found.both.lower, found.normal.lower, found.tangential.lower)
    return TraceBounds(*lowest, body, True, "lower bounds of those of the continuous problem")


def _eigenvalues(problem: DiscreteProblem, energy: EnergyNorm | MultigridNorm) -> tuple[float, float, float, float]:
    contact, field = problem.contact, problem.field
    if field is None:
        raise ProblemError("a problem made of arrays has no mesh, so it has no exact solution to be distant from")
    weights = np.repeat(contact.weights[:, None], contact.components, axis=1)
    along = weights * (np.arange(contact.components) == 0)
    found = []
    for chosen in (weights, along, weights - along):
        top = energy.largest_eigenvalue(contact.trace, chosen.ravel()).bound if chosen.any() else 0.0
        found.append(1.0 / top if top > 0.0 else np.inf)
    mesh = field.mesh
    share = np.repeat(mesh.volumes / (mesh.dim + 1), mesh.dim + 1)
    lumped = np.bincount(mesh.cells.ravel(), weights=share, minlength=mesh.number_of_nodes)
    body = energy.largest_eigenvalue(sp.csr_array(field.basis), np.repeat(lumped, mesh.dim)).bound
    return found[0], found[1], found[2], 1.0 / body
