"""What the bound takes for granted of a statement and a displacement: supports that are fulfilled, a problem at rest,
laws that are the same along a boundary, straight boundaries.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import fields, is_dataclass

import numpy as np
import scipy.sparse as sp

from hemivar.basics.types import Array, IntArray
from hemivar.bounds.body_data import BodyData
from hemivar.bounds.bulk_gap import strain_sizes
from hemivar.bounds.contact_traces import ContactTraces
from hemivar.bounds.varying_gaps import unknown_gap
from hemivar.errors import ProblemError
from hemivar.fem.discretize import refuse_evolution
from hemivar.fem.stress_stiffness import refuse_stiffening
from hemivar.fem.supports import stated_supports
from hemivar.laws import CoulombBound, Friction, PiecewiseQuadratic, Superpotential, VectorLaw
from hemivar.laws.coupled.criteria import FractureCriterion
from hemivar.laws.friction.bounds import StateBound
from hemivar.laws.parametrised import ParameterLaw
from hemivar.mechanics.conditions import Roller
from hemivar.mechanics.obstacles import Plane
from hemivar.mechanics.statement import ContactProblem, Geometry, expect_body, refuse_areas
from hemivar.mesh.boundary_rule import boundary_rule
from hemivar.mesh.mesh import Mesh
from hemivar.mesh.smooth_chains import STRAIGHT, chains, facet_angles

__all__ = [
    "body_shape",
    "check_supports",
    "inexact_data",
    "law_doubts",
    "stated_conditions",
    "unmet_hypotheses",
]

#: Part of the largest displacement by which supports may be missed, and up to which that is rounding.
_HELD, _ROUNDING = 1e-8, 1e-15


def body_shape(mesh: Mesh) -> str:
    """The body of a mesh in words, such as ``"a polygon with 11 straight sides"``: what a bound is one for."""
    facets = mesh.boundary_facets
    pairs, angles = facet_angles(boundary_rule(mesh, None))
    flat = pairs[angles <= STRAIGHT]
    graph = sp.coo_array((np.ones(len(flat)), flat.T), shape=2 * (len(facets),))
    count = sp.csgraph.connected_components(graph, directed=False)[0]
    return f"a polygon with {count} straight sides" if mesh.dim == 2 else f"a polyhedron with {count} plane faces"


def unmet_hypotheses(problem: ContactProblem, displacement: Array | None = None) -> list[str]:
    """Why a bound for this statement is an estimate only, one sentence each.

    Parameters of laws that are functions of the place are known at the points of a rule of integration only, and with
    them constants that must hold everywhere.  Facets of three directions or more that follow each other at angles of
    up to 30 degrees are taken for a curve that the mesh replaces by its own, whatever boundaries they belong to.

    ``displacement`` is (nodes, d).
    """
    remedy = "give the ContactProblem that states it: bounds are for elastic bodies at rest"
    expect_body(problem, "the problem of the bound", remedy)
    refuse_areas(problem, "a bound of the distance to the exact solution")
    refuse_evolution(problem)
    refuse_stiffening(problem, "a bound of the distance to the exact solution")
    if problem.kinematics.ring:
        raise ProblemError(
            "the body is one of revolution: distances to the exact solution are bounded for plane and 3D bodies; "
            "compare with a finer mesh"
        )
    unmet: list[str] = []
    if displacement is not None and _well_formed(problem, displacement):
        check_supports(problem, displacement)
        unmet += _passed_rollers(problem, displacement)
    return unmet + law_doubts(problem)


def law_doubts(problem: ContactProblem) -> list[str]:
    """Laws whose parameters vary, and parts of the surface that look curved, one sentence each."""
    doubts: list[str] = []
    for name, contact in problem.contact.items():
        values = list(_parameters(contact.normal)) + list(_parameters(contact.friction))
        for what, value in values:
            count = len(np.ravel(value)) if isinstance(value, np.ndarray | list | tuple) else 1
            if count > 1:
                raise ProblemError(
                    f"the law of contact '{name}' has a parameter {what} given at {count} contact points; the exact "
                    "solution needs it everywhere: give a number, or a function of x"
                )
        names = [what for what, value in values if callable(value)]
        if names:
            doubts.append(
                f"the law of contact '{name}' varies along the boundary ({', '.join(names)}), where it is "
                f"evaluated at quadrature points only"
            )
    if problem.geometry is Geometry.AS_MESHED:
        return doubts
    doubts += [
        f"the boundary {words} looks curved: it turns by up to {angle:.3g} degrees from facet to facet; the bound is "
        "one for the body with straight facets"
        for words, angle in _curved(problem.mesh)
    ]
    return doubts


def fixed_gaps(problem: ContactProblem) -> bool:
    """Whether no gap varies along a contact boundary, but for those of plane obstacles."""
    return not any(callable(one.gap) or not isinstance(one.obstacle, Plane | None) for one in problem.contact.values())


def inexact_data(data: BodyData, formulas: bool = False) -> list[str]:
    """What of the statement the mesh and its rules of integration do not represent exactly.

    Gaps that are ``formulas`` may be known between the points, too.
    """
    problem = data.problem
    doubts = data.varying.doubts
    if not problem.material.bounds_by.proved:
        doubts.append("the lower bound of the stiffness of the material is sampled")
    if data.varies:
        doubts.append("the material varies within cells, where it is evaluated by a quadrature rule")
    elif not problem.material.uniform:
        doubts.append("the material is a function of the place, which is evaluated at quadrature points")
    parts = ("value", "x", "y", "z")
    prescribed = [getattr(support, part, None) for support in problem.supports.values() for part in parts]
    if any(callable(value) for value in prescribed):
        doubts.append("prescribed displacements are functions, which the mesh interpolates")
    for name, contact in problem.contact.items():
        if why := unknown_gap(data, name, contact, formulas):
            doubts.append(why)
        if callable(contact.belt):
            doubts.append(f"the belt of contact '{name}' varies, and is evaluated by a quadrature rule")
    return doubts


def stated_conditions(data: BodyData, traces: ContactTraces | None) -> tuple[list[str], list[str]]:
    """Why constants do not hold at the displacement itself, and the conditions under which they hold for a solution.

    They are constants of the material and of the law that are proved up to a reach.
    """
    outside, conditions, reach = [], [], data.problem.material.reach
    if reach < np.inf:
        size = float(strain_sizes(data.engineering, data.table.dim).max())
        if not size <= reach:
            outside.append(f"strains of up to {size:.3g} may lie outside of the reach {reach:g} of the material")
        conditions.append(f"strains of the exact solution are within the reach {reach:g} of the material")
    limits = (np.inf,) if traces is None else traces.law.proof("alpha").reach
    if traces is None or min(limits) in (0.0, np.inf):
        return outside, conditions
    # a quadratic trace is at most six times as large as at the points
    sizes = np.abs(traces.local[..., 0]).max(), np.linalg.norm(traces.local[..., 1:], axis=2).max()
    for what, size, limit in zip(("penetration", "slip"), sizes, limits, strict=True):
        if not size * (1.0 if data.order == 1 else 6.0) <= limit:
            outside.append(f"the {what} {size:.4g} may lie outside of the reach {limit:g} of its law")
        if limit < np.inf:
            conditions.append(f"{what}s of the exact solution are within the reach {limit:g} of the law")
    return outside, conditions


def _well_formed(problem: ContactProblem, displacement: Array) -> bool:
    """Whether it has a number for every node and component; what has not is refused in other words."""
    try:
        u = np.asarray(displacement)
    except ValueError:
        return False
    return u.shape == problem.mesh.nodes(problem.order).shape and u.dtype.kind in "fiu" and bool(np.isfinite(u).all())


def check_supports(problem: ContactProblem, displacement: Array) -> Array:
    """The displacement, put where supports hold it: the theorems compare displacements of the same supports."""
    u, supports = np.asarray(displacement, dtype=float), stated_supports(problem)
    missed = np.einsum("nqd,nd->nq", supports.directions, u - supports.value)
    off = np.abs(missed).max(axis=1)
    worst, size = int(np.argmax(off)), max(float(np.abs(u).max()), float(np.abs(supports.value).max()))
    if off[worst] > _HELD * size:
        x = ", ".join(f"{part:g}" for part in supports.nodes[worst])
        raise ProblemError(
            f"the displacement differs from the prescribed one by {off[worst]:.3g} at node {worst}, x = ({x}); "
            "give that of a solution of this problem, on this mesh"
        )
    if off[worst] <= _ROUNDING * size:
        return displacement
    return np.asarray(u - np.einsum("nq,nqd->nd", missed, supports.directions))


def _passed_rollers(problem: ContactProblem, displacement: Array) -> Iterator[str]:
    """Rollers that the displacement passes through: nodes where they bend are held along a mean normal only."""
    u, mesh = np.asarray(displacement), problem.mesh
    size = float(np.abs(u).max(initial=0.0))
    for name, support in problem.supports.items():
        if not isinstance(support, Roller):
            continue
        rule = boundary_rule(mesh, name, problem.order)
        off = float(np.abs(np.einsum("fad,fd->fa", u[rule.nodes], rule.normals)).max())
        if off > _HELD * size:
            yield (
                f"the roller '{name}' bends, and holds the nodes there along the mean of the normals: the displacement "
                f"passes through its facets by {off:.3g}"
            )


def _parameters(law: object) -> Iterator[tuple[str, object]]:
    """Names and values of all that may vary along the boundary."""
    if not is_dataclass(law) or isinstance(law, PiecewiseQuadratic):
        return
    places = isinstance(law, ParameterLaw | CoulombBound | FractureCriterion | VectorLaw)
    for one in fields(law):
        if not one.init or one.name.startswith("_"):
            continue
        value = getattr(law, one.name)
        if isinstance(value, Superpotential | StateBound | FractureCriterion):
            yield from _parameters(value)
        elif value is not None and (places or (isinstance(law, Friction) and one.name in ("bound", "ratio"))):
            yield one.name, value


def _curved(mesh: Mesh) -> Iterator[tuple[str, float]]:
    """Parts of the surface that look curved, in words, with the largest angle from facet to facet in degrees.

    The surface is asked, whatever its parts are called: chains of facets that follow each other smoothly.
    """
    facets = mesh.boundary_facets
    angles: dict[str, float] = {}
    of = chains(boundary_rule(mesh, None))
    turning, number = of.turning, of.chain[of.pairs[:, 0]]
    for one in np.unique(of.chain[of.curved]):
        words = _called(mesh, facets[of.chain == one])
        steepest = float(of.angle[turning & (number == one)].max())
        angles[words] = max(angles.get(words, 0.0), steepest)
    yield from ((words, float(np.degrees(steepest))) for words, steepest in angles.items())


def _called(mesh: Mesh, facets: IntArray) -> str:
    """The names of the boundaries to which facets belong, in words."""
    weights = mesh.number_of_nodes ** np.arange(mesh.dim, dtype=float)
    keys = np.sort(facets, axis=1) @ weights
    named = {name: np.isin(keys, np.sort(of, axis=1) @ weights) for name, of in mesh.boundaries.items()}
    words = [f"'{name}'" for name, part in named.items() if part.any()]
    bare = ~np.any([np.zeros(len(keys), dtype=bool), *named.values()], axis=0)
    return " and ".join([*words, "without a name"] if bare.any() else words)
