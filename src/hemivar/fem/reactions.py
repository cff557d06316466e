"""Reactions of supports: the nodal residual (internal forces less loads) where Dirichlet conditions hold the body."""

from __future__ import annotations

import numpy as np

from hemivar.basics.arrays import SAME, norm
from hemivar.basics.types import Array, IntArray
from hemivar.discrete.model import quadratic
from hemivar.discrete.potential import Potential
from hemivar.discrete.problem import DiscreteProblem
from hemivar.errors import ProblemError
from hemivar.fem.assembly import stated_load
from hemivar.fem.constitutive import EnergyLaw, constitutive_law
from hemivar.fem.elements import barycentric_gradients, shape_derivatives
from hemivar.fem.energy_integral import NodalEnergy
from hemivar.fem.mass import cell_masses, stated_bedding
from hemivar.fem.plates import Plate, stated_plates
from hemivar.fem.quadrature import quadrature_rule
from hemivar.fem.rings import hoop_matrices
from hemivar.fem.springs import stated_springs
from hemivar.fem.stress_stiffness import nodal_stiffness
from hemivar.fem.supports import Supports, stated_supports, sum_by
from hemivar.mechanics.statement import ContactProblem

__all__ = ["internal_forces", "nodal_contact_forces", "plate_motions", "support_reactions"]


def support_reactions(
    problem: DiscreteProblem, displacement: Array, multiplier: Array, load: Array | None = None
) -> dict[str, Array]:
    """Force of each support on the body, in the coordinates of the mesh; of one component force or heat flow.

    ``load`` (nodes * c,) is that of the nodes where it is not the one that was stated.

    It is the residual of the equations that the supports took away, ``K U - F`` less the contact forces, with K, U and
    F of all nodes.  Loads, contact forces, reactions and the force of a bedding add up to zero in a solution.  Force of
    the foundation at contact nodes that the supports hold entirely, which are no contact points, is part of the
    reactions.

    A node of several supports is counted direction by direction, in the order in which the supports are stated: each
    takes the force along what it fixes and none before it has fixed.  That of a rigid plate is the stated force and
    what holds its prescribed motions.
    """
    forces, plates = _reactions(problem, displacement, multiplier, load)
    assert problem.origin is not None
    none = np.zeros(displacement.shape[1])
    for plate in stated_plates(problem.origin):
        forces[plate.name] = plate.force(plates[plate.name])
    return {name: forces.get(name, none) for name in problem.origin.supports}


def plate_motions(problem: DiscreteProblem, displacement: Array, multiplier: Array) -> dict[str, dict[str, float]]:
    """How each rigid plate moves, and the force and the moment with which it acts on the body, by name.

    Displacements ``x``, ``y``, ``z`` are those of the point that is stated for it, ``turn_z`` is in radians, and
    ``force_x`` and ``moment_z`` go with them; see :class:`hemivar.mechanics.RigidPlate`.
    """
    _, plates = _reactions(problem, displacement, multiplier)
    assert problem.origin is not None
    return {
        plate.name: plate.amounts(displacement) | plate.resultants(plates[plate.name])
        for plate in stated_plates(problem.origin)
    }


def _reactions(
    problem: DiscreteProblem, displacement: Array, multiplier: Array, load: Array | None = None
) -> tuple[dict[str, Array], dict[str, Array]]:
    """Forces of supports on the body, by name, and what plates do along their motions."""
    stated, field = problem.origin, problem.field
    if stated is None or field is None:
        raise ProblemError("this problem was made of arrays: its supports are not known; state it and discretize it")
    if not isinstance(problem.bulk, Potential):
        quadratic(problem.bulk, "the reaction of a support")
    supports = stated_supports(stated)
    fixed = supports.count > 0
    mesh, order = stated.mesh, stated.order
    near = fixed.copy()
    if field.followers is not None:  # what follows the nodes of supports hands its forces on to them
        near[np.unique(field.followers.rows.indices) // displacement.shape[1]] = True
    cells = np.flatnonzero(near[mesh.cell_nodes(order)].any(axis=1))
    load = (stated_load(stated) if load is None else load).reshape(displacement.shape)
    if isinstance(problem.bulk, Potential):
        moved, size = problem.bulk.initial_forces, norm(problem.bulk.initial_sizes)
    else:
        forces = internal_forces(stated, field.full(np.zeros(problem.unknowns)), cells).ravel()
        moved, size = field.basis.T @ forces, norm(forces)
    if norm(field.basis.T @ load.ravel() - moved - problem.load) > SAME * max(norm(load.ravel()), size):
        raise ProblemError(
            "reactions are known under the stated load only, and this problem has another one; state that load"
        )
    force = internal_forces(stated, displacement, cells) - load - nodal_contact_forces(problem, multiplier)
    if stated.stiffening:
        force += nodal_stiffness(stated, displacement) @ displacement
    plates = stated_plates(stated)
    if field.followers is not None:
        force = field.followers.folded(force.ravel()).reshape(force.shape)
    pushed = {plate.name: _by_plate(plate, supports, force) for plate in plates}
    amounts = np.einsum("kqd,kd->kq", supports.directions, force)
    springs = {name: -one.forces(displacement).sum(axis=0) for name, one in stated_springs(stated).items()}
    held = {
        name: np.einsum("kq,kqd->d", np.where(supports.owner == number, amounts, 0.0), supports.directions)
        for number, name in enumerate(supports.names)
    }
    return {**held, **springs}, pushed


def _by_plate(plate: Plate, supports: Supports, force: Array) -> Array:
    """What a plate does along its motions (r,): the stated loads, and what holds prescribed motions.

    The forces (nodes, c) at its nodes, which hold it together, are replaced by those of supports there, in place.
    """
    conditions, _ = plate.held(supports)
    left = np.einsum("kdr,kd->r", plate.motions, force[plate.nodes])
    shares = np.linalg.lstsq(conditions.T, left, rcond=SAME)[0] if len(conditions) else np.zeros(0)
    along = np.zeros((len(plate.nodes), supports.directions.shape[1]))
    along[plate.held_directions(supports)] = shares[len(plate.prescribed) :]
    force[plate.nodes] = np.einsum("kq,kqd->kd", along, supports.directions[plate.nodes])
    total = plate.pushed.copy()
    total[list(plate.prescribed)] += shares[: len(plate.prescribed)]
    return total


def nodal_contact_forces(problem: DiscreteProblem, multiplier: Array) -> Array:
    """Forces of the foundation, or of another body, on the nodes, (nodes, c): ``-w_j (lam_nu nu + lam_tau)``."""
    field, contact = problem.field, problem.contact
    if field is None:
        raise ProblemError("this problem was made of arrays: it has no nodes; use contact_force")
    if not contact.count:
        return np.zeros((field.number_of_nodes, field.components))
    if contact.frames is None or contact.mean is None:
        return -np.asarray(field.lift.T @ contact.force(multiplier)).reshape(field.number_of_nodes, field.components)
    between = np.isin(contact.boundary, [contact.names.index(name) for name in contact.pairs])
    still = between[:, None] & (np.diff(contact.trace.indptr) == 0).reshape(contact.shape)
    force = contact.weights[:, None] * contact.global_vectors(np.where(still, 0.0, multiplier))
    return -np.asarray(contact.mean.T @ force)


def internal_forces(problem: ContactProblem, displacement: Array, cells: IntArray) -> Array:
    """Forces that some cells exert on the nodes against a displacement, shape (nodes, c): their part of ``K U``.

    That of a bedding, and of springs, is counted."""
    mesh, order = problem.mesh, problem.order
    forces = _of_material(problem, displacement, cells)
    for springs in stated_springs(problem).values():
        forces = forces + springs.forces(displacement)
    bedding = stated_bedding(problem)
    if not bedding.none:
        nodes = mesh.cell_nodes(order)[cells]
        own = cell_masses(mesh, order, bedding, cells) @ displacement[nodes]
        forces = forces + sum_by(nodes.ravel(), own.reshape(-1, own.shape[2]), len(displacement))
    return forces


def _of_material(problem: ContactProblem, displacement: Array, cells: IntArray) -> Array:
    mesh, order = problem.mesh, problem.order
    if not problem.material.linear:
        energy = NodalEnergy(mesh, order, EnergyLaw.of(problem.material, mesh.dim))
        return energy.forces(displacement, cells)
    law = constitutive_law(problem)
    matrices, _ = law.on(mesh, 2 * order, cells)
    barycentric, weights = quadrature_rule(mesh.dim, max(2 * (order - 1), 1) if law.homogeneous else 2 * order)
    gradients, nodes = barycentric_gradients(mesh, cells), mesh.cell_nodes(order)[cells]
    values, volumes = displacement[nodes], mesh.volumes[cells]
    forces: Array = np.zeros(values.shape)
    for q, (point, weight) in enumerate(zip(barycentric, weights, strict=True)):
        shapes = np.einsum("la,kad->kld", shape_derivatives(order, point), gradients)
        strain = problem.kinematics.strain(np.einsum("kld,klc->kcd", shapes, values))
        stress = (matrices[:, min(q, matrices.shape[1] - 1)] @ strain[:, :, None])[:, :, 0]
        forces += np.einsum("k,kcd,kld->klc", weight * volumes, stress[:, law.strains], shapes)
    if law.hoop is not None:
        forces += np.einsum("kicjd,kjd->kic", hoop_matrices(mesh, order, law.hoop, law.strains, cells), values)
    return sum_by(nodes.ravel(), forces.reshape(-1, forces.shape[2]), len(displacement))
