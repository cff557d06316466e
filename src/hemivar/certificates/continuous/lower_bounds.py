"""Guaranteed lower bounds of ``Lambda = inf a(v, v) / |v|^2`` over the contact boundary, no constant unknown.

With ``a(v, v) = int C eps(v) : eps(v)`` over the displacements that vanish where supports hold them, and the norm of
L2 over the contact boundary of v, or of its normal or its tangential part alone.  Normals are those of the contact: of
the facets, or of a plane obstacle.  Where they vary on a facet (a curved obstacle), the norm of the whole v serves for
the parts too: theirs are not above it.  The trace constant of the continuous
problem is ``Lambda^(-1/2)``: values computed with conforming elements approach it from the wrong side.

They are found on a mesh of their own, which begins with the coarsest mesh that the one of the problem was refined from,
and is refined along the contact boundary and where supports end:
:mod:`hemivar.certificates.continuous.trace_flexibility` tells how.

Bounds hold up to rounding: eigenvalues are not enclosed by interval arithmetic.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np
import scipy.sparse as sp

from hemivar.basics.arguments import expect, whole_number
from hemivar.basics.types import Array, IntArray
from hemivar.certificates.continuous.bare_body import bare_body
from hemivar.certificates.continuous.contact_normals import contact_normals, has_constant_normals
from hemivar.certificates.continuous.facet_cover import facet_cover
from hemivar.certificates.continuous.facet_table import FacetTable, facet_table
from hemivar.certificates.continuous.held_facets import held_facets
from hemivar.certificates.continuous.trace_flexibility import TraceFlexibility, TraceRange
from hemivar.errors import ProblemError
from hemivar.fem.constitutive import constitutive_law
from hemivar.mechanics.statement import ContactProblem
from hemivar.mesh.mesh import Mesh
from hemivar.systems.workspace import Workspace

__all__ = ["LowerBound", "LowerBounds", "lower_bounds"]

#: Cells of the mesh that is made for it, at most about so many, by dimension.
_CELLS = {2: 320, 3: 450}


@dataclass(frozen=True)
class LowerBound:
    """Lower bound of ``Lambda`` for one part of the displacement, modulus per length.

    Attributes
    ----------
    lower : float
        Guaranteed up to rounding.
    upper : float
        Value of a conforming approximation: Lambda lies between both. All are inf where supports hold this part.
    simple : float
        The bound without the method of Lehmann.
    """

    lower: float
    upper: float
    simple: float


@dataclass(frozen=True)
class LowerBounds:
    """Bounds for the whole trace, its normal and its tangential part.

    Attributes
    ----------
    both, normal, tangential : LowerBound
    cells : int
        Of the mesh that they were computed on.
    mesh : Mesh, optional
        That mesh.
    flexibility : TraceFlexibility, optional
        The contact boundary of the body, for weights that vary on it.
    whole : bool
        Whether contact normals vary on facets, so that only the whole trace is known and weights count by the larger
        of both.
    """

    both: LowerBound
    normal: LowerBound
    tangential: LowerBound
    cells: int
    mesh: Mesh | None = field(default=None, repr=False, compare=False)
    flexibility: TraceFlexibility | None = field(default=None, repr=False, compare=False)
    whole: bool = False

    def weighted(self, corners: Array, normal: Array, tangential: Array) -> tuple[float, float]:
        """Upper bounds of the first two eigenvalues of ``int alpha |v|^2`` against ``a(v, v)``, weights by facets.

        The first is that of the supremum of the quotient.

        Each facet of the mesh here takes the largest weight of those that lie over it, or near to it in space.

        Parameters
        ----------
        corners : array, shape (k, d, d)
            Of the facets, which cover the contact boundary where the weights do not vanish.
        normal, tangential : arrays, shape (k,)
            Weights of the normal and of the tangential part, >= 0.
        """
        if self.mesh is None or self.flexibility is None:
            return np.inf, np.inf
        if self.whole:
            normal = tangential = np.maximum(normal, tangential)
        over = facet_cover(self.mesh.points[self.flexibility.facets], corners)
        weights = [np.where(over, alpha, 0.0).max(axis=1, initial=0.0) for alpha in (normal, tangential)]
        found = self.flexibility.bound(*weights)
        return found.upper, found.second


def lower_bounds(problem: ContactProblem, cells: int | None = None, workspace: Workspace | None = None) -> LowerBounds:
    """Lower bounds of ``Lambda`` for a problem; its laws and loads do not matter.

    Parameters
    ----------
    problem : ContactProblem
    cells : int, optional
        At most about so many cells are used, 320 in the plane and 450 in space by default.
    workspace : Workspace, optional
        Keeps them for all problems of the body: they belong to its coarsest mesh, its material and where it is held and
        touches, not to refined meshes, laws and loads.

    Returns
    -------
    LowerBounds

    Raises
    ------
    ProblemError
        The problem has no contact boundary, supports do not hold the body without it, its material varies within
        cells, or its coarsest mesh has too many.
    """
    expect(problem, ContactProblem, "the problem of a lower bound", "give the ContactProblem that states the body")
    if cells is not None:
        whole_number(cells, "cells", 1)
    if not problem.contact:
        raise ProblemError("the problem has no contact boundary, and so no trace constant; state Contact(...)")
    bare = bare_body(problem)
    table = facet_table(bare.mesh)
    held = held_facets(bare, table)
    if not _is_held(table, held):
        raise ProblemError(
            "the body is not held by its supports, so that rigid motions move the contact boundary without energy and "
            "no trace constant exists; add a support"
        )
    most = _CELLS[bare.mesh.dim] if cells is None else cells
    if workspace is None:
        return _found(bare, most)
    touching = np.sort(np.concatenate([table.numbers(bare.mesh.boundaries[name]) for name in bare.contact]))
    matrices, _ = constitutive_law(bare).on(bare.mesh, 2)
    kind = np.array([most, not has_constant_normals(bare)])
    normals = contact_normals(bare, table, touching)
    parts = (bare.mesh.points, bare.mesh.cells, matrices, held, touching, normals, kind)
    return workspace.once("lower bounds of trace constants", parts, lambda: _found(bare, most))


def _found(bare: ContactProblem, cells: int) -> LowerBounds:
    own = _graded(bare, cells)
    flexibility = TraceFlexibility(own)
    both, normal, tangential = (
        _inverse(flexibility.bound(*weights)) for weights in ((1.0, 1.0), (1.0, 0.0), (0.0, 1.0))
    )
    whole = not has_constant_normals(own)
    if whole:
        normal = tangential = replace(both, upper=math.inf)
    return LowerBounds(both, normal, tangential, own.mesh.number_of_cells, own.mesh, flexibility, whole)


def _inverse(found: TraceRange) -> LowerBound:
    if found.upper == 0.0:
        return LowerBound(math.inf, math.inf, math.inf)  # supports hold this part everywhere
    return LowerBound(1.0 / found.upper, 1.0 / found.lower, 1.0 / found.simple)


def _is_held(table: FacetTable, held: Array) -> bool:
    """Whether supports resist every rigid motion of every connected part."""
    mesh, dim = table.mesh, table.dim
    inner = table.owners[table.interior]
    graph = sp.coo_array((np.ones(len(inner)), inner.T), shape=2 * (len(table.cells),))
    parts, label = sp.csgraph.connected_components(graph, directed=False)
    x = (mesh.points - mesh.points.mean(axis=0)) / float(np.ptp(mesh.points, axis=0).max())
    spins = []
    for i in range(dim):
        for j in range(i):
            spin = np.zeros((dim, dim))
            spin[i, j], spin[j, i] = 1.0, -1.0
            spins.append(spin)
    some = np.flatnonzero(held.any(axis=(1, 2)))
    at = x[table.facets[some]]
    moved = np.broadcast_to(np.eye(dim), (*at.shape[:2], dim, dim))
    turned = np.stack([at @ spin.T for spin in spins], axis=-1)
    motions = np.einsum("fij,fajr->fair", held[some], np.concatenate([moved, turned], axis=-1))
    grams: Array = np.zeros((parts, motions.shape[-1], motions.shape[-1]))
    measures = table.measures[some] / table.measures.max()
    np.add.at(grams, label[table.owners[some, 0]], np.einsum("f,fair,fais->frs", measures, motions, motions))
    values = np.linalg.eigvalsh(grams)
    return bool((values[:, 0] > 1e-10 * np.maximum(values[:, -1], np.finfo(float).tiny)).all())


def _graded(problem: ContactProblem, cells: int) -> ContactProblem:
    """Refined everywhere, in the plane up to half the cells, there once where it touches, then where supports end."""
    mesh = problem.mesh
    while (finer := mesh.refined()).number_of_cells <= cells // (2 if mesh.dim == 2 else 1):
        mesh = finer
    touching = np.concatenate([mesh.boundaries[name] for name in problem.contact])
    for nodes in (touching, None, None, None) if mesh.dim == 2 else (None, None):
        marked = np.zeros(mesh.number_of_nodes, dtype=bool)
        marked[_ends(problem, mesh) if nodes is None else nodes] = True
        finer = mesh.refined_where(marked[mesh.cells].any(axis=1))
        if finer.number_of_cells > cells:
            break
        mesh = finer
    return replace(problem, mesh=mesh)


def _ends(problem: ContactProblem, mesh: Mesh) -> IntArray:
    """Nodes where a support ends."""
    held = np.unique(np.concatenate([np.sort(mesh.boundaries[name], axis=1) for name in problem.supports]), axis=0)
    every, counts = np.unique(np.concatenate([np.sort(mesh.boundary_facets, axis=1), held]), axis=0, return_counts=True)
    return np.intersect1d(held, every[counts == 1])
