"""From the statement of a scalar problem to its discrete energy: one unknown at each free node."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp

from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.coercivity.free_motion import refuse_free_motion
from hemivar.discrete.bulk import Quadratic
from hemivar.discrete.contact import ContactPoints
from hemivar.discrete.loading import Loading
from hemivar.discrete.model import Model, quadratic
from hemivar.discrete.potential import Potential
from hemivar.discrete.problem import DiscreteProblem
from hemivar.discrete.space import Field, Space
from hemivar.errors import ProblemError, SupportError
from hemivar.fem.assembly import Density, integrated_load, stiffness_blocks
from hemivar.fem.constitutive import EnergyLaw, constitutive_law
from hemivar.fem.contact_points import shares
from hemivar.fem.edge_blocks import EdgeBlocks, NodeGraph, node_graph
from hemivar.fem.elements import barycentric_gradients, shape_derivatives
from hemivar.fem.energy_integral import BeddedEnergy, EnergyIntegral, NodalEnergy
from hemivar.fem.mass import mass_blocks, per_volume, resists
from hemivar.fem.quadrature import region_masks
from hemivar.fem.supports import in_words
from hemivar.laws import ContactLaw, Friction, NoContact
from hemivar.mechanics.conditions import LARGEST, ScalarData, evaluate_scalar
from hemivar.mechanics.instants import error_context
from hemivar.mechanics.scalar import ScalarContact, ScalarProblem, Side

__all__ = [
    "contact_of",
    "discretize_scalar",
    "gradient",
    "gradient_norm_problem",
    "held_values",
    "least_coefficient",
    "scalar_blocks",
    "scalar_load",
    "scalar_nodal_energy",
    "scalar_reactions",
]

#: What rounding may put a held node beyond the end of a law by, of the largest level or value there.
_ROUNDED = 1e-12


def discretize_scalar(problem: ScalarProblem, *, check_coercivity: bool = True) -> DiscreteProblem:
    """Finite element energy of a scalar problem.

    Linear elements, or quadratic ones without contact over an area.  Laws act at the nodes, with the lumped weights of
    boundary or area: contact over an area has one contact point for each of its free nodes.  A law of the penetration
    has one local component.  If any law is friction, contact points have two: friction acts on the second one, laws
    of the penetration on the first, and the other one is not there.

    Parameters
    ----------
    problem : ScalarProblem
    check_coercivity : bool
        Refuse problems whose energy is not bounded below along a constant.

    Returns
    -------
    DiscreteProblem

    Raises
    ------
    ProblemError
        Supports contradict each other or fix everything, data are not finite, two contacts meet at a node that do not
        belong together, or nothing holds a part.
    """
    if problem.time_dependent:
        raise ProblemError(
            f"{', '.join(sorted(problem.time_dependent))} of the problem depend on time; take it at one time, "
            "problem.at_time(0.0)"
        )
    mesh, order = problem.mesh, problem.order
    nodes = mesh.nodes(order)
    held, value = held_values(problem, nodes)
    free = ~held
    count = int(free.sum())
    if not count:
        raise SupportError("the supports leave the problem no freedom; refine the mesh or remove supports")
    basis = sp.csr_array((np.ones(count), (np.flatnonzero(free), np.arange(count))), shape=(len(nodes), count))
    full = scalar_load(problem)
    prescribed = np.where(held, value, 0.0)
    reaction = np.zeros(len(nodes))
    bedding, graph = per_volume(problem.bedding, "bedding"), node_graph(mesh, order)
    blocks = scalar_blocks(problem, graph)  # where the gradient is zero, if the flux is not linear
    resisted = resists(mesh, order, bedding, blocks.diagonal[:, 0])
    bulk: Quadratic | Potential
    if problem.linear:
        if prescribed.any():
            reaction = blocks.times(prescribed[:, None]).ravel()
        bulk, stored = Quadratic(blocks.matrix(free[:, None]), assembled=True), 0.5 * float(prescribed @ reaction)
    else:
        energy_of = EnergyIntegral(_bedded(problem), basis, prescribed[:, None], None, free[:, None])
        bulk, reaction = Potential(energy_of), energy_of.forces(np.zeros(count)).ravel()
        stored = bulk.initial_value
    contact, offset, law, energy = contact_of(problem, nodes, basis, prescribed)
    field = Field(mesh, order, basis, prescribed, 1, problem.kind.unknown, constants=True)
    discrete = DiscreteProblem(
        Model(bulk, contact, Space((field,)), problem, resisted),
        Loading(basis.T @ (full - reaction), offset, law, stored - float(prescribed @ full) + energy),
    )
    if check_coercivity:
        return refuse_free_motion(discrete, full)
    return discrete


# ---- supports ---------------------------------------------------------------------------------------------


def held_values(problem: ScalarProblem, nodes: Array) -> tuple[BoolArray, Array]:
    """Which nodes supports hold, shape (N,), and at which value."""
    held, value = np.zeros(len(nodes), dtype=bool), np.zeros(len(nodes))
    owner = np.full(len(nodes), -1)
    for number, (name, given) in enumerate(problem.supports.items()):
        at = np.unique(problem.mesh.facet_nodes(problem.mesh.boundaries[name], problem.order))
        wanted = evaluate_scalar(given, nodes[at], f"supports['{name}']")
        both = held[at]
        size = max(float(np.abs(wanted).max(initial=0.0)), float(np.abs(value).max(initial=0.0)))
        wrong = both & (np.abs(wanted - value[at]) > 1e-9 * size)
        if wrong.any():
            bad = int(np.flatnonzero(wrong)[0])
            other = list(problem.supports)[owner[at[bad]]]
            raise SupportError(
                f"supports '{other}' and '{name}' prescribe different values at node {at[bad]}, "
                f"x = {in_words(nodes[at[bad]])}: {value[at[bad]]:.6g} and {wanted[bad]:.6g}; make them agree there"
            )
        new = at[~both]
        held[new], value[new], owner[new] = True, wanted[~both], number
    return held, value


# ---- matrices and loads -----------------------------------------------------------------------------------


def scalar_blocks(problem: ScalarProblem, graph: NodeGraph) -> EdgeBlocks:
    """``int A grad u . grad v + bedding u v`` by nodes and edges."""
    bedding = per_volume(problem.bedding, "bedding")
    blocks = stiffness_blocks(problem.mesh, constitutive_law(problem), graph)
    return blocks if bedding.none else mass_blocks(problem.mesh, bedding, graph, blocks)


def scalar_nodal_energy(problem: ScalarProblem) -> NodalEnergy:
    """The integral of the stored energy of the gradient, the bedding apart."""
    law = EnergyLaw(np.arange(problem.mesh.dim)[None], problem, problem.homogeneous, problem.uniform)
    return NodalEnergy(problem.mesh, problem.order, law)


def scalar_load(problem: ScalarProblem) -> Array:
    """``int source v + int_boundary flux v`` of the shape functions, shape (nodes,)."""

    def density(value: ScalarData, what: str) -> Density:
        if callable(value):
            return lambda points, _: evaluate_scalar(value, points, what)[:, None]
        return np.array([value])

    fluxes = {name: density(flux, f"fluxes['{name}']") for name, flux in problem.fluxes.items()}
    return integrated_load(problem.mesh, problem.order, 1, density(problem.source, "source"), fluxes)


# ---- contact ----------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class _Place:
    """The nodes of one contact, with their weights."""

    name: str
    contact: ScalarContact
    nodes: IntArray
    weights: Array


def _places(problem: ScalarProblem, count: int) -> list[_Place]:
    """Boundaries, then areas; a node of two boundaries, or of two areas, belongs to the first of them entirely."""
    mesh, order = problem.mesh, problem.order
    found: list[_Place] = []

    def add(name: str, contact: ScalarContact, members: IntArray, parts: Array, rivals: slice) -> None:
        summed = np.bincount(members.ravel(), weights=parts.ravel(), minlength=count)
        for k in range(rivals.start, len(found)):
            own = found[k].nodes
            found[k] = replace(found[k], weights=found[k].weights + summed[own])
            summed[own] = 0.0
        nodes = np.flatnonzero(summed)
        if not len(nodes):
            raise ProblemError(f"every node of contact '{name}' belongs to another one; join the two")
        found.append(_Place(name, contact, nodes, np.asarray(summed[nodes], dtype=float)))

    for name, contact in problem.contact.items():
        facets = mesh.boundaries[name]
        share, measures = shares(order, mesh.dim), mesh.facet_normals(facets)[1]
        add(name, contact, mesh.facet_nodes(facets, order), np.outer(measures, share), slice(0, None))
    boundaries, share = len(found), np.full(mesh.dim + 1, 1.0 / (mesh.dim + 1))
    whole = isinstance(problem.area, ScalarContact)
    for name, contact in problem.areas.items():
        cells = slice(None) if whole else mesh.regions[name]
        add(name, contact, mesh.cells[cells], np.outer(mesh.volumes[cells], share), slice(boundaries, None))
    return found


def _refuse_shared(problem: ScalarProblem, places: list[_Place], nodes: Array, free: BoolArray) -> None:
    """Refuse contact over an area at free nodes of a contact boundary: two laws would act on one unknown."""
    number = len(problem.contact)
    for first in places[:number]:
        for second in places[number:]:
            shared = np.intersect1d(first.nodes, second.nodes)
            shared = shared[free[shared]]
            if len(shared):
                raise ProblemError(
                    f"contacts '{first.name}' (boundary) and '{second.name}' (area) share {len(shared)} nodes, the "
                    f"first at x = {in_words(nodes[shared[0]])}; restrict the area to a region without the cells at "
                    f"'{first.name}'"
                )


def contact_of(
    problem: ScalarProblem, nodes: Array, basis: sp.csr_array, prescribed: Array
) -> tuple[ContactPoints, Array, ContactLaw, float]:
    """Contact points in terms of the unknowns, their offset (m, c) and law; energy of those that supports hold."""
    places = _places(problem, len(nodes))
    moving = np.diff(basis.indptr) > 0
    _refuse_shared(problem, places, nodes, moving)
    components = 2 if any(place.contact.rubs for place in places) else 1
    names = tuple(place.name for place in places)
    unknown = np.cumsum(moving) - 1
    energy = 0.0
    parts: list[tuple[ContactLaw, int]] = []
    kept: list[tuple[IntArray, Array, Array, Array, IntArray]] = []
    for place in places:
        contact, at = place.contact, nodes[place.nodes]
        where = f"level of contact '{place.name}'"
        level = evaluate_scalar(contact.level, at, where)
        if not (np.abs(level) < LARGEST).all():
            raise ProblemError(
                f"{where}: {level[np.argmax(np.abs(level))]:g} is beyond the range of numbers; take another unit"
            )
        sign = 1.0 if contact.side is Side.ABOVE else -1.0
        stated = contact.law
        with error_context(f"contact '{place.name}'", stated):
            law = (ContactLaw(NoContact(), stated) if isinstance(stated, Friction) else ContactLaw(stated)).at(at)
        free = moving[place.nodes]
        energy += _held_energy(place, law, sign, level, prescribed, at, ~free)
        index = np.flatnonzero(free)
        if not len(index):
            continue
        column = int(contact.rubs)
        offset = np.zeros((len(index), components))
        offset[:, column] = sign * level[index]
        rows = np.arange(len(index)) * components + column
        kept.append((place.nodes[index], place.weights[index], offset, np.full(len(index), sign), rows))
        parts.append((law.take(index), len(index)))
    if not kept:
        none = np.zeros(0, dtype=np.int64)
        empty = ContactPoints(
            sp.csr_array((0, basis.shape[1])), np.zeros(0), nodes[:0], None, none, none, none, names,
            np.zeros(0, dtype=bool), components,
        )  # fmt: skip
        return empty, np.zeros((0, components)), ContactLaw(NoContact()).at(None), energy
    counts = [count for _, count in parts]
    start = np.concatenate([[0], np.cumsum(counts)[:-1]]) * components
    at_node = np.concatenate([one[0] for one in kept])
    rows = np.concatenate([one[4] + first for one, first in zip(kept, start, strict=True)])
    shape = (len(at_node) * components, basis.shape[1])
    trace = sp.csr_array((np.concatenate([one[3] for one in kept]), (rows, unknown[at_node])), shape=shape)
    numbers = [k for k, place in enumerate(places) if moving[place.nodes].any()]
    made = ContactPoints(
        trace,
        np.concatenate([one[1] for one in kept]),
        nodes[at_node],
        node=at_node,
        boundary=np.repeat(numbers, counts),
        names=names,
    )
    return made, np.concatenate([one[2] for one in kept]), ContactLaw.concatenate(parts), energy


def _held_energy(
    place: _Place, law: ContactLaw, sign: float, level: Array, prescribed: Array, at: Array, held: BoolArray
) -> float:
    """Energy of the contact points that supports hold; refused where their law forbids what they are held at."""
    index = np.flatnonzero(held)
    if not len(index):
        return 0.0
    own = law.take(index)
    u = prescribed[place.nodes[index]]
    r = sign * (u - level[index])
    rounding = _ROUNDED * np.maximum(np.abs(u), np.abs(level[index])).max()
    one = own.tangential if place.contact.rubs else own.normal
    inside = np.clip(r, one.domain.lower, one.domain.upper)
    r = np.where(np.abs(inside - r) <= rounding, inside, r)
    values = np.broadcast_to(one.value(r), r.shape)
    if not np.isfinite(values).all():
        bad = int(np.flatnonzero(~np.isfinite(values))[0])
        raise SupportError(
            f"the supports hold the contact point x = {in_words(at[index[bad]])} at u = {u[bad]:.6g}, which the law of "
            f"contact '{place.name}' forbids (its level there is {level[index[bad]]:.6g}); change support or level"
        )
    return float(place.weights[index] @ values)


# ---- what follows from a solution ---------------------------------------------------------------------------


def least_coefficient(problem: ScalarProblem) -> float:
    """m_A: the smallest eigenvalue of A, at the quadrature points of the stiffness matrix."""
    tensors, _ = constitutive_law(problem).on(problem.mesh, 2 * problem.order)
    return float(np.linalg.eigvalsh(tensors.reshape(-1, *tensors.shape[2:]))[:, 0].min())


def gradient_norm_problem(problem: ScalarProblem) -> ScalarProblem:
    """The problem whose stiffness is that of ``int grad u . grad v``, the norm of V."""
    return replace(problem, coefficient=1.0, bedding=0.0, density=None, viscosity=None, capacity=None)


def gradient(problem: ScalarProblem, values: Array) -> tuple[Array, Array]:
    """Gradient of nodal values (nodes, 1) in the middle of each cell, and the flux there, each (M, d).

    Parameters
    ----------
    problem : ScalarProblem
    values : array
        Shape (nodes, 1).

    Returns
    -------
    tuple of two arrays
    """
    mesh, order = problem.mesh, problem.order
    middle = np.full(mesh.dim + 1, 1.0 / (mesh.dim + 1))
    shapes = np.einsum("la,kad->kld", shape_derivatives(order, middle), barycentric_gradients(mesh))
    slope = np.einsum("kld,kl->kd", shapes, values.ravel()[mesh.cell_nodes(order)])
    return slope, problem.stress(mesh.points[mesh.cells].mean(axis=1), slope, region_masks(mesh))


def scalar_reactions(problem: DiscreteProblem, values: Array, multiplier: Array) -> dict[str, Array]:
    """Force (heat flow) of each support on the domain, by name, shape (1,): see :func:`support_reactions`.

    A node of several supports is booked under the first of them.
    """
    stated, field = problem.origin, problem.field
    assert isinstance(stated, ScalarProblem)
    assert field is not None
    full = scalar_load(stated)
    if isinstance(problem.bulk, Potential):
        inner = _forces(stated)
    else:
        quadratic(problem.bulk, "the reaction of a support")
        inner = scalar_blocks(stated, node_graph(stated.mesh, stated.order)).matrix().__matmul__
    moved = np.asarray(inner(field.prescribed))
    size = float(np.abs(full).sum() + np.abs(moved).sum())
    if float(np.abs(field.basis.T @ (full - moved) - problem.load).sum()) > 1e-9 * size:
        raise ProblemError(
            "reactions are known under the stated load only, and this problem has another one; state that load"
        )
    force = np.asarray(inner(values.ravel())) - full
    contact = problem.contact
    if contact.count:
        push = contact.weights[:, None] * multiplier
        force += np.asarray(field.lift.T @ (contact.trace.T @ push.ravel()))
    booked = np.zeros(len(force), dtype=bool)
    found = {}
    for name in stated.supports:
        at = np.unique(stated.mesh.facet_nodes(stated.mesh.boundaries[name], stated.order))
        at = at[~booked[at]]
        booked[at] = True
        found[name] = np.array([float(force[at].sum())])
    return found


def _forces(problem: ScalarProblem) -> Callable[[Array], Array]:
    """Internal forces (nodes,), those of the bedding counted, of nodal values (nodes,)."""
    energy = _bedded(problem)
    return lambda values: energy.forces(values.reshape(-1, 1)).ravel()


def _bedded(problem: ScalarProblem) -> BeddedEnergy:
    """The energy of nodal values (nodes, 1), with that of a bedding."""
    energy, bedding = scalar_nodal_energy(problem), per_volume(problem.bedding, "bedding")
    graph = energy.graph
    return BeddedEnergy(energy, None if bedding.none else mass_blocks(problem.mesh, bedding, graph, graph.zeros(1)))
