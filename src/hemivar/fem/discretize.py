"""From the statement of a contact problem to its discrete energy."""

from __future__ import annotations

import logging

import numpy as np

from hemivar.basics.arguments import expect
from hemivar.basics.types import Array
from hemivar.discrete.bulk import Quadratic
from hemivar.discrete.problem import DiscreteProblem
from hemivar.discrete.space import Field, Space
from hemivar.errors import ProblemError, SupportError
from hemivar.fem.assembly import linear_stiffness, load_vector, stiffness_matrix
from hemivar.fem.contact_points import refuse_dependent
from hemivar.fem.free_motion import refuse_free_motion
from hemivar.fem.locking import locking_warning
from hemivar.fem.unknowns import nodal_conditions, reduced
from hemivar.mechanics.obstacles import refuse_inside
from hemivar.mechanics.statement import ContactProblem, Quadrature

__all__ = ["discretize", "friction_warning"]

#: Contact points named in a warning.
_SHOWN = 8


def discretize(problem: ContactProblem, *, check_coercivity: bool = True) -> DiscreteProblem:
    """Discretise a contact problem by finite elements.

    The displacement is ``U = P u + u0`` with orthonormal columns in ``P``: at the nodes of a contact
    boundary (nodal quadrature) they are the normal and the tangents, so that the trace selects unknowns; at
    inclined rollers the free tangents; elsewhere the Cartesian axes. ``K = P' Kf P``, ``f = P'(F - Kf u0)``;
    gap and slip offset take up ``u0``.

    With nodal quadrature, contact point j is a node; its normal is the normalised sum of the adjacent facet
    normals times facet measures, its weight the integral of its shape function over the contact boundary.
    Where the foundation is an obstacle, normal and gap are those stated in :class:`Contact`; points whose normal misses
    it are no contact points.
    With midpoint quadrature, contact point j is a facet, its displacement the mean over the facet (for
    order 1 that of the midpoint), so that the multiplier is constant on every facet. Contact points that
    the supports hold entirely are dropped and their energy goes into ``constant``. Where a support fixes a
    direction oblique to the contact normal, normal and tangential motion are one: the point keeps its
    normal row, and the dependent tangential row is set to zero (no friction in that direction). A node where
    two contact boundaries meet smoothly is one contact point, with the law and gap of the boundary named
    first, which it belongs to, the weights added and the normals averaged; where they meet at more than 45 degrees it
    is a point of both, with their normal laws and without friction. Where friction is left out so,
    ``contact.without_friction`` and ``warnings`` of the discrete problem say it, with the points.

    Parameters
    ----------
    problem : ContactProblem
    check_coercivity : bool
        Refuse problems whose energy is not bounded below or not held along a rigid motion. ``False`` lets
        them pass: a local equilibrium may exist all the same.

    Returns
    -------
    DiscreteProblem

    Raises
    ------
    ProblemError
        If supports contradict each other, data have the wrong shape or are not finite, the material is not
        positive definite, an obstacle lies inside the body, midpoints of contact facets have displacements that
        depend on one another, or the body is free to move.
    """
    if isinstance(problem, DiscreteProblem):
        raise ProblemError("this problem is discrete already; solve it, or discretize its statement")
    remedy = "give a ContactProblem; hemivar.read_problem(path) reads one from a file"
    problem = expect(problem, ContactProblem, "what to discretize", remedy)
    mesh, order = problem.mesh, problem.order
    conditions = nodal_conditions(problem)
    supports, basis = conditions.supports, conditions.basis
    if basis.shape[1] == 0:
        raise SupportError("the supports leave the body no freedom; refine the mesh or remove supports")

    full_load = load_vector(mesh, order, problem.body_force, problem.tractions)
    prescribed = conditions.prescribed
    reaction = np.zeros_like(prescribed)
    if order == 1:
        blocks = linear_stiffness(mesh, problem.material)
        if prescribed.any():
            reaction = blocks.times(supports.value).ravel()
        blocks.turn(conditions.directions)
        stiffness = blocks.matrix(conditions.free)
        del blocks
    else:
        full_stiffness = stiffness_matrix(mesh, problem.material, order)
        if prescribed.any():
            reaction = full_stiffness @ prescribed
        stiffness = reduced(full_stiffness, basis)
    load = basis.T @ (full_load - reaction)
    constant = float(prescribed @ (0.5 * reaction - full_load))

    if check_coercivity:
        for name, stated in problem.contact.items():
            if stated.obstacle is not None:
                at = mesh.points[np.unique(mesh.boundaries[name])]
                refuse_inside(stated.obstacle, mesh, at, f"contact '{name}'")
    contact, law, energy = conditions.contact()
    if problem.quadrature is Quadrature.MIDPOINT:
        refuse_dependent(contact)
    left_out = None if contact.points is None else friction_warning(contact.points[contact.without_friction])
    discrete = DiscreteProblem(
        Quadratic(stiffness, load, constant + energy, assembled=True),
        contact,
        law,
        Space((Field(mesh, order, basis, prescribed),)),
        problem,
        tuple(sentence for sentence in (locking_warning(problem), left_out) if sentence is not None),
    )
    if check_coercivity:
        for warning in discrete.warnings:
            logging.getLogger("hemivar").info("%s", warning)
        refuse_free_motion(discrete, full_load)
    return discrete


def friction_warning(where: Array) -> str | None:
    """That friction is left out at points (k, d), in words; None if there are none."""
    if not len(where):
        return None
    places = ", ".join("(" + ", ".join(f"{x + 0.0:.6g}" for x in point) + ")" for point in where[:_SHOWN])
    more = f" and {len(where) - _SHOWN} more" if len(where) > _SHOWN else ""
    return (
        f"friction is left out, in one direction at least, at {len(where)} contact point"
        f"{'s' if len(where) > 1 else ''}, x = {places}{more}: two contact boundaries meet there at more than 45 "
        "degrees, or a support fixes a direction oblique to the contact normal"
    )
