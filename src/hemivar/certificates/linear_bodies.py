"""Linear bodies that stand for one that is not linear: the one below it, and the tangent at a point."""

from __future__ import annotations

from dataclasses import replace
from typing import cast

import numpy as np

from hemivar.basics.types import Array
from hemivar.discrete.bulk import Quadratic, Sized
from hemivar.discrete.operator_family import Composition, OperatorFamily
from hemivar.discrete.potential import Potential
from hemivar.discrete.problem import DiscreteProblem
from hemivar.fem.elements import barycentric_gradients
from hemivar.fem.hierarchy import tangent_problem
from hemivar.fem.stress_stiffness import Stressed
from hemivar.mechanics.composed_material import lower_elasticity
from hemivar.mechanics.material_words import BoundsBy
from hemivar.mechanics.statement import ContactProblem

__all__ = [
    "STATED",
    "STRESSED",
    "UNKNOWN",
    "at_tangent",
    "below",
    "convex_body",
    "largest_strain",
    "lower_bound_by",
    "lower_statement",
    "strain_reach",
]

#: What :func:`lower_bound_by` says where no lower bound is known, where the maker of the bulk gave one, and where the
#: stiffness of a linear body has the stress of its load in it.
UNKNOWN, STATED, STRESSED = "unknown", "stated", "under stress"


def below(problem: DiscreteProblem) -> DiscreteProblem:
    """The problem with the linear body of C_low, by which its own is strongly monotone; itself if that is linear.

    In its energy norm errors are bounded. Where no lower bound is known (:func:`lower_bound_by`) the body at rest takes
    its place, and the norm is no more than a measure of sizes.
    """
    bulk = problem.bulk
    if isinstance(bulk, Quadratic):
        return problem
    linear: Quadratic | None = None
    if isinstance(bulk, Potential):
        linear = bulk.lower
    origin, model = None, problem.model
    if linear is not None and isinstance(model.parts, Composition):  # a step in time
        own, family = model.parts, model.parts.family
        lower = cast(OperatorFamily, family.known.once("below", lambda: _family_below(family)))
        return problem.fitted(replace(own, family=lower, place=None).model(model.resisted))
    if linear is None:
        linear = bulk.at_rest if isinstance(bulk, Potential) else Quadratic(bulk.hessian(np.zeros(bulk.unknowns)))
    elif model.origin is not None and model.parts is None:  # the same on coarser meshes
        origin = lower_statement(model.origin)
    return problem.fitted(replace(model, bulk=linear, origin=origin, parts=None))


def _family_below(family: OperatorFamily) -> OperatorFamily:
    return replace(family.below, problem=below(family.problem))


def lower_statement(statement: ContactProblem) -> ContactProblem:
    """The statement of the linear body below that of another one; itself if that is linear."""
    return replace(statement, material=lower_elasticity(statement.material))


def at_tangent(problem: DiscreteProblem, u: Array) -> DiscreteProblem:
    """The problem with the linear body that has the forces and the stiffness of its own at unknowns (n,)."""
    bulk = problem.bulk
    if isinstance(bulk, Quadratic):
        return problem
    if isinstance(bulk, Potential):
        tangent = tangent_problem(problem, u)
    else:
        tangent = problem.under(None, bulk=Quadratic(bulk.hessian(u)))
    return tangent.under(problem.out_of_balance(u) + tangent.bulk.gradient(u))


def lower_bound_by(problem: DiscreteProblem) -> str:
    """How the body below was found: "closed form", "intervals", "sampled", :data:`STATED`, :data:`UNKNOWN`.

    Energies of a gradient state the least derivative of their flux.

    Empty for a linear body, but for one under the stress of its load: :data:`STRESSED`.
    """
    bulk, origin = problem.bulk, problem.origin
    if isinstance(problem.model.parts, Stressed):
        return STRESSED
    lower = bulk.lower if isinstance(bulk, Sized) else None
    if lower is bulk:
        return ""
    if lower is None:
        return UNKNOWN
    return STATED if origin is None or origin.kind else origin.material.bounds_by.value


def strain_reach(problem: DiscreteProblem) -> float:
    """The size of the strain up to which the body below is one; inf where it is one at every strain."""
    origin = problem.origin
    return np.inf if origin is None else float(origin.material.reach)


def largest_strain(problem: DiscreteProblem, u: Array) -> float:
    """An upper bound of the size ``|eps|`` of the strains in space at unknowns (n,) of a body with linear elements.

    In plane stress the strain across the plane is at most the trace of those in it, with an isotropic material whose
    secant moduli are positive; it is counted in plane strain, too, where there is none.
    """
    field = problem.field
    assert field is not None
    gradient = np.einsum("mai,maj->mij", field.full(u)[field.mesh.cells], barycentric_gradients(field.mesh))
    strain = 0.5 * (gradient + gradient.transpose(0, 2, 1))
    square = np.einsum("mij,mij->m", strain, strain)
    if field.mesh.dim == 2:
        square += np.einsum("mii->m", strain) ** 2
    return float(problem.vectors.largest(float(np.sqrt(square.max(initial=0.0))))[0])


def convex_body(problem: DiscreteProblem) -> bool:
    """Whether the energy of the body is shown to be convex; that of one under stress need not be."""
    return (
        lower_bound_by(problem) not in (UNKNOWN, STRESSED, BoundsBy.SAMPLED.value) and strain_reach(problem) == np.inf
    )
