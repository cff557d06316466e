"""The constants that a bound of the distance to the exact solution needs of the body, and where they come from.

``Lambda = inf a(v, v) / |v|^2`` over the fields that vanish where supports hold the body, with the norm of the trace on
the contact boundary (both components, or one kind alone), or with that of v over the body. A bound holds if these are
lower bounds of the continuous problem. Those of a discrete space tend to them as the mesh is refined and are no lower
bounds: what rests on them is an estimate.

That over the body is rough on purpose. For a load f in L2 let t be a stress of the split element whose divergence has
the moments of ``-f`` against linear fields of every cell. The rest is orthogonal to these, at most ``theta |f|``, and
seen by the oscillation of v alone:

    |w(f)|_a <= |t| + theta kappa |f|,      1 / Lambda <= (sqrt(mu) + theta kappa)^2,

mu the largest least energy of such t for cellwise linear loads of norm one, kappa the largest constant of a cell.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp
import scipy.sparse.linalg as spla

from hemivar.basics.arguments import expect
from hemivar.basics.types import Array
from hemivar.bounds.bare_body import (
    PART,
    bare_body,
    cell_tensors,
    contact_sides,
    facet_cover,
    held_facets,
    part_of_body,
    too_many_cells,
)
from hemivar.bounds.coarsening import LOSS
from hemivar.bounds.facet_constants import equilibrated_blocks, mass_root
from hemivar.bounds.facet_table import facet_table
from hemivar.bounds.joined_sides import joined_sides, touch
from hemivar.bounds.lower_bounds import ATTAINED, LowerBounds, lower_bounds
from hemivar.bounds.oscillation import local_constants
from hemivar.bounds.split_element import pulled_back
from hemivar.certificates.norms import EnergyNorm, energy_norm
from hemivar.discrete.problem import DiscreteProblem
from hemivar.errors import ProblemError
from hemivar.fem.directed_matrix import directed_matrix
from hemivar.fem.discretize import discretize
from hemivar.mechanics.statement import ContactProblem
from hemivar.systems.workspace import Workspace

__all__ = [
    "TraceBounds",
    "body_bound",
    "body_constants",
    "discrete_trace_bounds",
    "guaranteed_trace_bounds",
    "missed_part",
]

#: The coarsest mesh of the body with at least so many cells is taken.
_CELLS = {2: 32, 3: 48}
#: Cells beyond which a mesh of fewer is made, and beyond which the systems would be too large.
_MANY, _MOST = {2: 2_000, 3: 400}, {2: 20_000, 3: 2_500}


@dataclass(frozen=True)
class TraceBounds:
    """Lower bounds of Lambda."""

    #: On the contact boundary: with ``v``, with ``v_nu`` and with ``v_tau`` alone; stiffness per area. inf where there
    #: is no contact; 0 where contact only constrains the body.
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
    #: What they take for granted, one sentence each.
    conditions: tuple[str, ...] = ()

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
    if origin is not None and not origin.kind and origin.order != 1:
        problem = discretize(replace(origin, order=1), check_coercivity=False)
    kept = Workspace.given(workspace)
    energy = energy_norm(problem, kept)
    source = "from the discrete problem: no bounds of the continuous one"
    if not energy.definite:
        return TraceBounds(0.0, 0.0, 0.0, 0.0, False, source)
    constants = kept.once("discrete trace bounds", problem.model, lambda: _eigenvalues(problem, energy))
    contact = problem.contact

    def weighted(facets: Array, normal: Array, tangential: Array) -> tuple[float, float]:
        assert problem.field is not None
        mesh = problem.field.mesh
        at = np.zeros((mesh.number_of_nodes, 2))
        assert problem.origin is not None
        own = np.concatenate(
            [mesh.boundaries[contact_sides(problem.origin, name)[0]] for name in problem.origin.contact]
        )
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

    return TraceBounds(*constants, guaranteed=False, source=source, weighted=weighted)


def guaranteed_trace_bounds(problem: DiscreteProblem, workspace: Workspace | None = None) -> TraceBounds:
    """Lower bounds of the continuous problem, by :func:`hemivar.bounds.lower_bounds`."""
    expect(problem, DiscreteProblem, "the problem of the constants", "give hemivar.discretize(problem)")
    kept = Workspace.given(workspace)
    origin = problem.origin
    if origin is None or origin.kind:
        raise ProblemError("lower bounds of trace constants need a continuous problem; discretize a ContactProblem")
    body = body_bound(origin, kept)  # the quicker one first: it may be refused
    bounds: LowerBounds | None
    try:
        bounds = lower_bounds(origin, workspace=kept)
    except ProblemError:
        if origin.trace_constant is None:
            raise
        bounds = None
    source = "lower bounds of those of the continuous problem"
    own = TraceBounds(0.0, 0.0, 0.0, body, True, source)
    if bounds is not None:
        lowest = (bounds.both.lower, bounds.normal.lower, bounds.tangential.lower)
        own = TraceBounds(*lowest, body, True, source, bounds.weighted)
    if origin.trace_constant is None:
        return own
    return _stated(origin, own, math.inf if bounds is None else bounds.both.upper)


def _stated(problem: ContactProblem, own: TraceBounds, upper: float) -> TraceBounds:
    """With the trace constant of a statement where that is better: ``a(v, v) >= m_a |eps(v)|^2``."""
    constant = problem.trace_constant
    assert constant is not None
    tensors, _ = cell_tensors(bare_body(problem))
    scale = np.sqrt(np.where(np.arange(tensors.shape[1]) < problem.mesh.dim, 1.0, 2.0))  # shear counts twice
    least = float(np.linalg.eigvalsh(scale[:, None] * tensors * scale).min()) / constant**2
    if least > upper * (1.0 + ATTAINED):
        raise ProblemError(
            f"trace_constant = {constant:g} is too small: displacements of the body have more on the contact boundary; "
            "leave it out"
        )
    if least <= own.both:
        return own
    both, normal, tangential = (max(least, one) for one in (own.both, own.normal, own.tangential))
    given = f"the trace constant of the body is at most {constant:g}, as the statement says"
    return replace(own, both=both, normal=normal, tangential=tangential, conditions=(given,))


def _eigenvalues(problem: DiscreteProblem, energy: EnergyNorm) -> tuple[float, float, float, float]:
    contact, field = problem.contact, problem.field
    if field is None:
        raise ProblemError("a problem made of arrays has no mesh, so it has no exact solution to be distant from")
    weights = np.repeat(contact.weights[:, None], contact.components, axis=1)
    along = weights * (np.arange(contact.components) == 0)
    constants = []
    for chosen in (weights, along, weights - along):
        top = energy.largest_eigenvalue(contact.trace, chosen.ravel()).bound if chosen.any() else 0.0
        constants.append(1.0 / top if top > 0.0 else np.inf)
    mesh = field.mesh
    share = np.repeat(mesh.volumes / (mesh.dim + 1), mesh.dim + 1)
    lumped = np.bincount(mesh.cells.ravel(), weights=share, minlength=mesh.number_of_nodes)
    body = energy.largest_eigenvalue(sp.csr_array(field.basis), np.repeat(lumped, mesh.dim)).bound
    return constants[0], constants[1], constants[2], 1.0 / body


def body_bound(problem: ContactProblem, workspace: Workspace | None = None) -> float:
    """Lower bound of ``inf a(v, v) / |v|^2`` over the displacements that vanish where supports hold them."""
    bare = bare_body(problem)
    tensors, groups = cell_tensors(bare)
    parts = (bare.mesh.points, bare.mesh.cells, tensors, groups, held_facets(bare, facet_table(bare.mesh)))

    def find() -> float:
        few = _of_few_cells(bare, workspace)
        table = facet_table(few.mesh)
        tensors, groups = cell_tensors(few)
        stiffness = tensors if len(tensors) == 1 else tensors[groups]
        held = held_facets(few, table)
        dim, count = table.dim, len(table.cells)
        compliance = pulled_back(np.asarray(np.linalg.inv(stiffness), dtype=float), table.jacobian, table.sizes)
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
        kappa = float(local_constants(table, stiffness).cell.max())
        return (math.sqrt(mu) + missed_part(dim) * kappa) ** -2

    return find() if workspace is None else workspace.once("lower bound over the body", parts, find)


def _of_few_cells(bare: ContactProblem, workspace: Workspace | None) -> ContactProblem:
    """The same body on some cells."""
    dim, count = bare.mesh.dim, bare.mesh.number_of_cells
    if count > _MANY[dim]:
        part, whole = part_of_body(bare, PART[dim], LOSS, kept=workspace)
        bare = part if whole else part_of_body(bare, PART[dim], 0.0)[0]
    if bare.mesh.number_of_cells > _MOST[dim]:
        raise ProblemError(too_many_cells(count, bare.mesh.number_of_cells, _MOST[dim]))
    while bare.mesh.number_of_cells < _CELLS[dim]:
        bare = replace(bare, mesh=bare.mesh.refined())
    return bare


def body_constants(problem: DiscreteProblem, workspace: Workspace) -> TraceBounds:
    """Guaranteed constants of the contact boundary; where there are none those of the discrete problem, and why.

    Parameters
    ----------
    problem : DiscreteProblem
        From :func:`hemivar.discretize` of a body.
    workspace : Workspace
        Keeps them.

    Returns
    -------
    TraceBounds
    """
    stated = problem.origin
    known = discrete_trace_bounds(problem, workspace)
    if stated is not None and not stated.kind and not stated.contact:
        return replace(known, guaranteed=True)
    if known.both == 0.0 or (stated is not None and touch(stated) and joined_sides(stated) is None):
        return known  # there is no bound, whatever they are
    try:
        return guaranteed_trace_bounds(problem, workspace)
    except (ProblemError, np.linalg.LinAlgError, RuntimeError) as error:  # ARPACK raises the last
        return replace(known, source=f"{known.source} ({error})")


def missed_part(dim: int) -> float:
    """theta, at least ``|f + div t| / |f|`` for loads f and stresses t whose divergence has their linear moments."""
    n = dim + 1
    mass = (np.eye(n) + 1.0) / (n * (n + 1))
    on_pieces = (1.0 - np.eye(n) + 1.0 / n) / n**2  # integral of phi_a over a piece
    constant = np.linalg.solve(on_pieces, mass)  # its moments are those of a linear function: values (piece, a)
    eigenvalues = la.eigh(constant.T @ constant / n - mass, mass, eigvals_only=True)
    return math.hypot(1.0, math.sqrt(float(eigenvalues[-1])))
