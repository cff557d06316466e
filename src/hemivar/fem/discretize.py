"""From the statement of a contact problem to its discrete energy.

The displacement is ``U = P u + u0`` with orthonormal columns in P: at contact nodes the normal and the tangents, at
inclined rollers the free tangents, elsewhere the Cartesian axes. Then ``K = P' Kf P`` and ``f = P'(F - Kf u0)``; gap
and slip offset take up u0. Where two bodies touch, unknowns of the slave are its jumps, and its nodes follow the
master at jumps zero. A bedding is part of K, and a body with one has no free motions. A nonlinear body has a
``Potential`` in the place of K, and its internal forces at u0 in that of ``Kf u0``. Its u0 is the displacement of the
linear body without strain that follows the supports: supports that move alone would strain the cells at them, the
more the finer the mesh is.

The normal of a contact node is the normalised sum of the adjacent facet normals times facet measures; at an obstacle
normal and gap are those stated, and points whose normal misses it are no contact points.  With midpoint quadrature the
displacement of a facet is its mean, so that the multiplier is constant on facets.  The energy of points that supports
hold entirely goes into ``constant``.  Where a support fixes a direction oblique to the normal, normal and tangential
motion are one: the point keeps its normal row, and the dependent tangential row is zero.  A node where two contact
boundaries meet smoothly is one point: weights are added, normals averaged, and law and gap are those of the boundary
named first.  Where they meet at more than 45 degrees it is a point of both, without friction.

Of one component the unknowns are the values at free nodes.  Contact points are nodes, those of an area with its lumped
weights.  If any law is friction there are two local components: friction acts on the second, other laws on the first.
"""

from __future__ import annotations

import logging
import math
import sys
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from hemivar.basics.arguments import expect, expecting
from hemivar.basics.known_keywords import known_keywords
from hemivar.basics.known_statement import ManufacturedProblem
from hemivar.basics.types import Array
from hemivar.discrete.bulk import Quadratic
from hemivar.discrete.free_motion import refuse_free_motion
from hemivar.discrete.loading import Loading
from hemivar.discrete.model import Model
from hemivar.discrete.potential import Potential
from hemivar.discrete.problem import DiscreteProblem
from hemivar.discrete.space import Field, Space
from hemivar.errors import ProblemError, SupportError
from hemivar.fem.assembly import stated_load
from hemivar.fem.contact_points import BoundaryContact, refuse_dependent
from hemivar.fem.edge_blocks import EdgeBlocks, node_graph
from hemivar.fem.energy_integral import EnergyIntegral, bedded_energy
from hemivar.fem.lift import lifted
from hemivar.fem.locking import locking_warning
from hemivar.fem.mass import bedding_share, body_blocks, stated_bedding
from hemivar.fem.springs import resisted_directions
from hemivar.fem.stress_stiffness import refuse_stiffening
from hemivar.fem.unknowns import NodalConditions, nodal_conditions
from hemivar.mechanics.instants import depends_on_time
from hemivar.mechanics.obstacles import refuse_inside
from hemivar.mechanics.statement import ContactProblem, Quadrature

__all__ = ["bedding_warning", "coarse_problem", "discretize", "friction_warning", "refuse_evolution"]

#: Contact points named in a warning.
_SHOWN = 8
#: Share of a bedding in the stiffness from which nobody misses the digits it costs: half of those that there are.
_SOFT = 1e-8


@known_keywords
@expecting(check_coercivity=bool, evolving=bool)
def discretize(
    problem: ContactProblem | ManufacturedProblem, *, check_coercivity: bool = True, evolving: bool = False
) -> DiscreteProblem:
    """Discretise a contact problem, or a scalar one, by finite elements: stiffness, load, contact points and their law.

    >>> import hemivar as hv
    >>> problem = hv.discretize(hv.gallery.survey("5.1", 8))
    >>> problem
    DiscreteProblem(272 unknowns, 8 contact points of 2 components on bottom, law survey)
    >>> K, B = problem.stiffness, problem.contact.trace
    >>> K.shape, B.shape
    ((272, 272), (16, 272))

    Unknowns are the displacements that supports leave free; at contact nodes they are along the normal and the
    tangents, so that B selects them.  Contact points are the nodes of the contact boundaries, or with midpoint
    quadrature their facets; weights are the parts of the boundary that belong to them.  Points that supports hold
    entirely are left out, and ``warnings`` name those where supports or a second boundary leave no friction.

    Parameters
    ----------
    problem : ContactProblem
    check_coercivity : bool
        Refuse problems whose energy is not bounded below or not held along a rigid motion. ``False`` lets
        them pass: a local equilibrium may still exist.
    evolving : bool
        The problem is part of one in time, where somebody else takes care of damping and memory of the contact points,
        which otherwise are refused.

    Returns
    -------
    DiscreteProblem

    Raises
    ------
    ProblemError
        If supports contradict each other, data have the wrong shape or are not finite, the material is not
        positive definite, an obstacle lies inside the body, midpoints of contact facets have displacements that
        depend on one another, the body is free to move, or something depends on time.
    """
    given = ManufacturedProblem.of(problem)
    if isinstance(given, DiscreteProblem):
        raise ProblemError("this problem is already discrete; solve it, or discretize its continuous problem")
    remedy = "give a ContactProblem; hemivar.read_problem(path) reads one from a file"
    stated = expect(given, ContactProblem, "what to discretize", remedy)
    if evolving:
        refuse_stiffening(stated, "an evolution")
    return _discretize(stated, check_coercivity, evolving)


def coarse_problem(problem: ContactProblem, start: Array, pairs: Mapping[str, BoundaryContact]) -> DiscreteProblem:
    """The problem below another one; at unknowns zero a nonlinear body has the nodal values (nodes, c) ``start``.

    ``pairs`` are the contact points of two bodies.
    """
    return _discretize(problem, False, True, start, pairs)


def _discretize(
    problem: ContactProblem,
    check_coercivity: bool,
    evolving: bool,
    start: Array | None = None,
    pairs: Mapping[str, BoundaryContact] | None = None,
) -> DiscreteProblem:
    refuse_evolution(problem, evolving)
    mesh, order = problem.mesh, problem.order
    conditions = nodal_conditions(problem, pairs)
    basis = conditions.basis
    if basis.shape[1] == 0:
        raise SupportError("the supports leave the problem no freedom; refine the mesh or remove supports")

    full_load = stated_load(problem)
    field = Field(
        mesh, order, basis, conditions.prescribed, problem.components, problem.unknown, conditions.lift,
        constants=problem.components == 1, ring=problem.kinematics.ring, resisted=resisted_directions(problem),
        followers=conditions.followers,
    )  # fmt: skip
    contact, offset, law, energy = conditions.contact()
    if problem.material.linear:
        start, body = None, _linear(problem, conditions)
    else:
        integral = _stored(problem, conditions)
        if start is None and integral.prescribed.any():
            start = lifted(integral, field, contact, law, offset)
        if start is not None:
            integral = integral.from_field(start)
            field = replace(field, prescribed=start.ravel())
        body = _nonlinear(problem, integral)
    load = basis.T @ (full_load - body.reaction)
    constant = body.energy - float(field.prescribed @ full_load)

    if check_coercivity:
        for name, stated in problem.contact.items():
            if stated.obstacle is not None:
                at = mesh.points[np.unique(mesh.boundaries[name])]
                refuse_inside(stated.obstacle, mesh, at, f"contact '{name}'")
    if problem.quadrature is Quadrature.MIDPOINT:
        refuse_dependent(contact)
    left_out = None if contact.points is None else friction_warning(contact.points[contact.without_friction])
    soft = bedding_warning(body.bedded, field) if check_coercivity else None
    discrete = DiscreteProblem(
        Model(body.bulk, contact, Space((field,)), problem, body.bedded > 0.0),
        Loading(load, offset, law, constant + energy),
        tuple(
            sentence
            for sentence in (locking_warning(problem), _uncut(problem), left_out, soft, *conditions.warnings)
            if sentence is not None
        ),
    )
    if check_coercivity:
        discrete = refuse_free_motion(discrete, full_load)
        for warning in discrete.notes:
            logging.getLogger("hemivar").info("%s", warning)
    return discrete if start is None else discrete.with_(offset=offset - contact.trace_of(field.origin))


def _uncut(problem: ContactProblem) -> str | None:
    """That linear elements leave out the middles of edges that a file has, in words; None where they do not."""
    if problem.order == 2 or problem.mesh.dim == 2 or problem.mesh.suggested_order == 1:
        return None
    return (
        "linear elements leave out the middles of the edges of tetrahedra of second order, and so are coarse; "
        "read_mesh(path, order=1) cuts the tetrahedra there"
    )


@dataclass(frozen=True, eq=False)
class _DiscreteBody:
    """The body by its unknowns; ``reaction (nodes * d,)`` and ``energy`` are those at unknowns zero; see
    :func:`bedding_share`."""

    bulk: Quadratic | Potential
    reaction: Array
    energy: float
    bedded: float


def _linear(problem: ContactProblem, conditions: NodalConditions) -> _DiscreteBody:
    mesh, order, prescribed = problem.mesh, problem.order, conditions.prescribed
    reaction = np.zeros_like(prescribed)
    blocks = body_blocks(problem, node_graph(mesh, order))
    bedded = _bedded(problem, blocks)
    if prescribed.any():
        reaction = blocks.times(prescribed.reshape(conditions.free.shape)).ravel()
    bulk = Quadratic(conditions.matrix(blocks), assembled=True)
    return _DiscreteBody(bulk, reaction, 0.5 * float(prescribed @ reaction), bedded)


def _stored(problem: ContactProblem, conditions: NodalConditions) -> EnergyIntegral:
    """The energy by the unknowns, zero where supports alone are displaced."""
    energy, start = bedded_energy(problem), conditions.prescribed.reshape(conditions.free.shape)
    return EnergyIntegral(energy, conditions.basis, start, conditions.directions, conditions.free, conditions.jumps)


def _nonlinear(problem: ContactProblem, integral: EnergyIntegral) -> _DiscreteBody:
    bulk = Potential(integral)
    bedded = 0.0 if integral.body.ground is None else _bedded(problem, integral.body.blocks(integral.prescribed))
    reaction = integral.forces(np.zeros(integral.unknowns)).ravel()
    return _DiscreteBody(bulk, reaction, bulk.initial_value, bedded)


def _bedded(problem: ContactProblem, blocks: EdgeBlocks) -> float:
    bedding = stated_bedding(problem)
    diagonal = np.einsum("ncc->nc", blocks.diagonal)
    return bedding_share(problem.mesh, problem.order, bedding, diagonal)


def bedding_warning(share: float, field: Field) -> str | None:
    """How many digits motions lose that a soft bedding alone holds, in words; None where it is stiff, or none is so."""
    if not 0.0 < share < _SOFT or not (field.kernel_known and field.free_motions.count):
        return None
    digits = sys.float_info.dig + 1
    lost = min(round(-math.log10(share)), digits)
    return (
        f"the bedding is {share:.0e} of the stiffness of the elements: motions that only the bedding resists lose "
        f"about {lost} "
        f"of {digits} digits; add a support, or state a stiffer bedding"
    )


def refuse_evolution(problem: ContactProblem, evolving: bool = False) -> None:
    """Refuse a statement that depends on time, and, unless it is part of an evolution, damping and memory."""
    gaps = [contact.gap for contact in problem.contact.values()]
    gap = "a level" if problem.components == 1 else "a gap" if any(map(depends_on_time, gaps)) else "a belt"
    words = {"load": "a load", "supports": "a support", "gap": gap, "law": "a law"}
    depends = [word for part, word in words.items() if part in problem.time_dependent]
    if problem.steps:
        raise ProblemError(
            f"the problem has {len(problem.steps)} load steps, and this is for one; take one of them alone, "
            f"problem.at_time({len(problem.steps)}.0), or go through them by hemivar.march or 'hemivar march'"
        )
    if depends:
        raise ProblemError(
            f"{' and '.join(depends)} of the problem depend{'s' if len(depends) == 1 else ''} on time; take the "
            "problem at one time, problem.at_time(0.0), or go through time (a table [time] in a problem file)"
        )
    for name, contact in problem.contact.items():
        if (contact.damping is not None or contact.memory) and not evolving:
            what = "damping" if contact.damping is not None else "memory"
            raise ProblemError(
                f"contact '{name}' has {what}, which means something in time only; leave it out, or go through time (a "
                "table [time] in a problem file)"
            )


def friction_warning(where: Array) -> str | None:
    """That friction is left out at points (k, d), in words; None if there are none."""
    if not len(where):
        return None
    places = ", ".join("(" + ", ".join(f"{x + 0.0:.6g}" for x in point) + ")" for point in where[:_SHOWN])
    more = f" and {len(where) - _SHOWN} more" if len(where) > _SHOWN else ""
    return (
        f"friction is left out, in at least one direction, at {len(where)} contact point"
        f"{'s' if len(where) > 1 else ''}, x = {places}{more}: two contact boundaries meet there at more than 45 "
        "degrees, or a support fixes a direction oblique to the contact normal"
    )
