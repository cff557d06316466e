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

from hemivar.basics.arguments import expect
from hemivar.basics.types import Array
from hemivar.certificates.continuous.body_bound import body_bound
from hemivar.certificates.continuous.facet_cover import facet_cover
from hemivar.certificates.continuous.lower_bounds import lower_bounds
from hemivar.certificates.norms import EnergyNorm, energy_norm
from hemivar.discrete.problem import DiscreteProblem
from hemivar.errors import ProblemError
from hemivar.fem.discretize import discretize
from hemivar.mechanics.statement import ContactProblem
from hemivar.systems.workspace import Workspace

__all__ = ["TraceBounds", "discrete_trace_bounds", "guaranteed_trace_bounds"]


@dataclass(frozen=True)
class TraceBounds:
    """Lower bounds of Lambda."""

    #: On the contact boundary: with ``v``, with ``v_nu`` and with ``v_tau`` alone; stiffness per area. inf where there
    #: is no contact; 0 where nothing but contact holds the body.
    both: float
    normal: float
    tangential: float
    #: Over the body; stiffness per volume. It counts for what a displacement lacks for equilibrium in the discrete
    #: space, which is rounding after a solve.
    body: float
    #: Whether they are shown to be lower bounds of the continuous problem.
    guaranteed: bool
    #: Where they come from, in words.
    source: str
    #: Upper bounds of the first two eigenvalues of ``int alpha |v|^2`` against ``a(v, v)``, inf if not known, for
    #: constants ``alpha`` of the normal and of the tangential law, (k,) each, on contact facets given by their corners,
    #: (k, d, d).
    weighted: Callable[[Array, Array, Array], tuple[float, float]] | None = None

    def __post_init__(self) -> None:
        for name in ("both", "normal", "tangential", "body"):
            value = getattr(self, name)
            if not (isinstance(value, float | int | np.floating) and value >= 0.0):
                raise ProblemError(f"the trace bound '{name}' is {value}; give a number that is not negative")

    def softening(self, facets: Array, normal: Array, tangential: Array) -> float:
        """c, an upper bound of ``sup int alpha |v|^2 / a(v, v)``; constants (k,), corners of facets (k, d, d)."""
        if not (np.any(normal > 0.0) or np.any(tangential > 0.0)):
            return 0.0
        along, across = float(normal.max(initial=0.0)), float(tangential.max(initial=0.0))
        if not np.isfinite(along + across):
            return np.inf
        with np.errstate(divide="ignore", invalid="ignore"):
            together = max(along, across) / self.both if self.both > 0.0 else np.inf
            pairs = ((along, self.normal), (across, self.tangential))
            apart = sum(alpha / bound if bound > 0.0 else np.inf for alpha, bound in pairs if alpha > 0.0)
        weighted = np.inf if self.weighted is None else self.weighted(facets, normal, tangential)[0]
        return float(min(together, apart, weighted))

    def distance(self, normal: Array, tangential: Array) -> float:
        """rho for integrals (k,) of the squares of the normal and of the tangential part of a force on the facets."""
        along, across = float(normal.sum()), float(tangential.sum())

        def over(square: float, bound: float) -> float:
            return 0.0 if square == 0.0 else float(np.sqrt(square / bound)) if bound > 0.0 else np.inf

        return min(over(along + across, self.both), over(along, self.normal) + over(across, self.tangential))


def discrete_trace_bounds(problem: DiscreteProblem, workspace: Workspace | None = None) -> TraceBounds:
    """The constants of a discrete problem, which are no bounds of the continuous ones.

    Traces are lumped at the nodes (or taken at midpoints), as the discretisation does. Of quadratic elements they are
    those of linear ones on the same mesh: constants belong to the body.
    """
    origin = problem.origin
    if isinstance(origin, ContactProblem) and origin.order != 1:
        problem = discretize(replace(origin, order=1), check_coercivity=False)
    kept = Workspace.given(workspace)
    energy = energy_norm(problem, kept)
    source = "from the discrete problem: no bounds of the continuous one"
    if not energy.definite:
        return TraceBounds(0.0, 0.0, 0.0, 0.0, False, source)
    found = kept.once("discrete trace bounds", problem.model, lambda: _eigenvalues(problem, energy))
    contact = problem.contact

    def weighted(facets: Array, normal: Array, tangential: Array) -> tuple[float, float]:
        assert problem.field is not None
        mesh = problem.field.mesh
        at = np.zeros((mesh.number_of_nodes, 2))
        assert isinstance(problem.origin, ContactProblem)
        own = np.concatenate([mesh.boundaries[name] for name in problem.origin.contact])
        over = facet_cover(mesh.points[own], facets)
        for column, values in enumerate((normal, tangential)):
            largest = np.where(over, values, 0.0).max(axis=1, initial=0.0)
            for corner in own.T:
                np.maximum.at(at[:, column], corner, largest)
        if (contact.node < 0).any():
            return np.inf, np.inf
        weight = np.repeat(at[contact.node, 1:], contact.components, axis=1)
        weight[:, 0] = at[contact.node, 0]
        rows = (contact.weights[:, None] * weight).ravel()
        return energy.largest_eigenvalue(contact.trace, rows).bound, np.inf

    return TraceBounds(*found, guaranteed=False, source=source, weighted=weighted)


def guaranteed_trace_bounds(problem: DiscreteProblem, workspace: Workspace | None = None) -> TraceBounds:
    """Lower bounds of the continuous problem, by :func:`hemivar.certificates.continuous.lower_bounds`."""
    expect(problem, DiscreteProblem, "the problem of the constants", "give hemivar.discretize(problem)")
    kept = Workspace.given(workspace)
    origin = problem.origin
    if not isinstance(origin, ContactProblem):
        raise ProblemError("lower bounds of trace constants need the statement of a body; discretize a ContactProblem")
    found = lower_bounds(origin, workspace=kept)
    body = body_bound(origin, kept)
    lowest = (found.both.lower, found.normal.lower, found.tangential.lower)
    source = "lower bounds of those of the continuous problem"
    return TraceBounds(*lowest, body, True, source, found.weighted)


def _eigenvalues(problem: DiscreteProblem, energy: EnergyNorm) -> tuple[float, float, float, float]:
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
