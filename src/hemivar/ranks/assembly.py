"""The discrete problem over ranks: matrix and vectors in PETSc, contact points on the ranks that own their nodes.

Elements and boundary conditions are those of :mod:`hemivar.mechanics`: each rank runs the serial kernels on its own
cells, and on the boundary facets around its nodes, so that every normal and weight is whole where it is used.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.discrete.contact import ContactPoints
from hemivar.errors import MethodError, ProblemError, SupportError
from hemivar.fem.assembly import load_vector
from hemivar.fem.discretize import friction_warning, refuse_evolution
from hemivar.fem.edge_blocks import EdgeBlocks, node_graph
from hemivar.fem.energy_integral import BeddedEnergy, bedded_energy
from hemivar.fem.locking import largest_poisson_ratio, locking_warning
from hemivar.fem.mass import body_blocks
from hemivar.fem.unknowns import NodalConditions, nodal_conditions
from hemivar.mechanics.statement import ContactProblem, Quadrature
from hemivar.mesh.mesh import Mesh
from hemivar.ranks.body_on_ranks import BodyOnRanks, compliance_of
from hemivar.ranks.matrices import assembled, hold, near_null_space, row_sums
from hemivar.ranks.nodes import NodesOnRanks
from hemivar.ranks.pieces import Piece
from hemivar.ranks.preconditioner import Multigrid
from hemivar.ranks.ranks import Ranks, shared
from hemivar.ranks.stiffness import Stiffness
from hemivar.ranks.stored_on_ranks import StoredOnRanks
from hemivar.ranks.support_check import admissible_motions, check_parts, check_supported, supported

__all__ = ["assemble", "assemble_family"]


def assemble_family(
    ranks: Ranks,
    pieces: Sequence[Piece],
    state: Callable[[Mesh], ContactProblem],
    check_coercivity: bool = True,
    evolving: bool = False,
) -> BodyOnRanks:
    """The bodies of all meshes, each with the coarser one below; the finest of them.  See :func:`assemble`."""
    body: BodyOnRanks | None = None
    for piece in pieces:
        check = check_coercivity and piece is pieces[-1]
        body = assemble(ranks, piece, state, coarser=body, check_coercivity=check, evolving=evolving)
    assert body is not None
    return body


def assemble(
    ranks: Ranks, piece: Piece, state: Callable[[Mesh], ContactProblem], *, coarser: BodyOnRanks | None = None,
    check_coercivity: bool = True, evolving: bool = False,
) -> BodyOnRanks:  # fmt: skip
    """Assemble a problem over the ranks.

    Parameters
    ----------
    ranks : Ranks
    piece : Piece
        Of this rank.
    state : function
        Makes the problem on a mesh that has this rank's cells and the boundary facets around its nodes.
    coarser : BodyOnRanks, optional
        The same problem on the mesh that ``piece`` is the refinement of.
    check_coercivity : bool
        Refuse a body that is free to move.
    evolving : bool
        Whether the problem is a moment of an evolution, to which damping and memory of its contacts are left.

    Raises
    ------
    ProblemError
        On all ranks, if the data are refused on one.
    MethodError
        Elements, quadrature or corners that this engine does not treat.
    """
    began = time.perf_counter()
    skin = _with_facets_around(ranks, piece)
    count = piece.mesh.number_of_nodes
    owned = piece.owned(ranks)
    inside = np.zeros(skin.number_of_nodes, dtype=bool)
    inside[:count] = owned

    def conditions() -> tuple[ContactProblem, NodalConditions]:
        stated = state(skin)
        refuse_evolution(stated, evolving)
        _check_suited(stated)
        return stated, nodal_conditions(_present(stated))

    stated, nodal = ranks.agree(conditions)
    contact, offset, law, constant = ranks.agree(lambda: nodal.contact(inside))
    contact = _named(contact, tuple(stated.contact))
    own = _present(stated, piece.mesh)

    prescribed = nodal.supports.value[:count]
    blocks, forces = ranks.agree(lambda: _elements(own, prescribed))
    below = None if coarser is None else coarser.nodes
    nodes = NodesOnRanks.of(ranks, piece, nodal.directions[:count], nodal.free[:count], below)
    constant += forces.energy - float(prescribed.ravel() @ forces.load)
    unknowns, points, constant, stored = ranks.total(
        np.count_nonzero(~nodes.fixed), len(contact.weights), constant, forces.energy
    )  # fmt: skip
    if unknowns == 0:
        raise shared(SupportError("the supports leave the body no freedom; refine the mesh or remove supports"))
    with np.errstate(all="ignore"):  # what is not finite is refused below
        K = assembled(nodes, blocks)
        typical = hold(K, nodes)
        reaction = _reduced(nodes, forces.reaction)
        force = _reduced(nodes, forces.load) - reaction
        sums = row_sums(K, nodes)
    finite = float(np.isfinite(force).all() and np.isfinite(sums).all() and 0.0 < typical < np.inf)
    if ranks.largest(1.0 - finite)[0]:
        raise shared(
            ProblemError(
                "stiffness or load is not finite because numbers of the problem are too large; use other units"
            )
        )
    del blocks
    unknown, sign, active = _contact_unknowns(ranks, contact, nodal, owned)
    elastic = Stiffness(K, ranks, unknown, sign, active)
    admissible, moves = admissible_motions(ranks, nodal, skin, piece, owned)
    if isinstance(stated.bedding, float) and stated.bedding > 0.0:
        admissible = admissible[:, :0]
    dependent = ranks.largest(float(law.state_dependent))[0]  # else a solve may start on the coarser mesh
    body = BodyOnRanks(
        vectors=ranks,
        elastic=elastic,
        law=law,
        weights=contact.weights,
        offset=offset,
        unknown=unknown,
        sign=sign,
        active=active,
        load=force,
        row_sums=sums,
        constant=float(constant),
        compliance=compliance_of(ranks, contact.weights, active, unknown, elastic.matrix_diagonal),
        seconds=time.perf_counter() - began,
        below=None if dependent else coarser,
        nodes=nodes,
        statement=replace(stated, mesh=piece.mesh),
        near=near_null_space(nodes),
        prescribed=prescribed,
        contact=contact,
        typical=typical,
        supported=supported(ranks, piece, state, coarser, evolving) if piece.parts > 1 else admissible.shape[1] == 0,
        unknowns=int(unknowns),
        contact_points=int(points),
        warnings=_warnings(ranks, own, contact, piece),
        cycle=Multigrid,
        coarser=coarser,
        stored=None if stated.material.linear else StoredOnRanks(nodes, forces.stored, float(stored), reaction),
    )
    if check_coercivity:
        apart = piece.parts > 1
        warnings = check_parts(ranks, piece, state, evolving) if apart else check_supported(body, admissible, moves)
        body = replace(body, warnings=(*body.warnings, *warnings))
    _ = body.load_scale  # found by all ranks together, so that each may look at it alone
    return body


@dataclass(frozen=True, eq=False)
class _CellForces:
    """What the cells of a rank add up to, apart from the stiffness."""

    load: Array  # (N d,)
    reaction: Array  # (N d,): internal forces under the prescribed displacements alone
    energy: float  # stored under these
    stored: BeddedEnergy | None = None  # of a body that is not linear


def _elements(own: ContactProblem, prescribed: Array) -> tuple[EdgeBlocks | None, _CellForces]:
    """Stiffness and forces of this rank's cells under prescribed displacements (N, d); no stiffness without cells."""
    mesh, none = own.mesh, np.zeros(prescribed.size)
    if not mesh.number_of_cells:
        return None, _CellForces(none, none, 0.0)
    load = load_vector(mesh, 1, own.body_force, own.tractions)
    if not own.material.linear:
        stored = bedded_energy(own)
        forces = stored.forces(prescribed).ravel()
        return stored.blocks(prescribed), _CellForces(load, forces, stored.value(prescribed), stored)
    blocks = body_blocks(own, node_graph(mesh, 1))
    reaction = blocks.times(prescribed).ravel() if prescribed.any() else none
    return blocks, _CellForces(load, reaction, 0.5 * float(prescribed.ravel() @ reaction))


def _reduced(nodes: NodesOnRanks, forces: Array) -> Array:
    """Vector (n,) of forces (N d,) that the ranks have on the nodes of their pieces; zero where supports hold."""
    return np.where(nodes.fixed, 0.0, nodes.summed(nodes.along(forces.reshape(nodes.free.shape))))


def _named(contact: ContactPoints, names: tuple[str, ...]) -> ContactPoints:
    """The contact points with the names of all boundaries in place of those that this rank sees."""
    number = np.array([names.index(name) for name in contact.names], dtype=np.int64)
    return replace(contact, names=names, boundary=number[contact.boundary])


def _check_suited(problem: ContactProblem) -> None:
    if problem.kind:
        raise MethodError("the engine 'petsc' has no scalar problems; leave --engine out")
    if problem.areas:
        raise MethodError("the engine 'petsc' has no contact over an area; leave --engine out")
    if problem.order != 1:
        raise MethodError("the engine 'petsc' has linear elements only; write order = 1, or leave --engine out")
    if problem.contact and problem.quadrature is not Quadrature.NODAL:
        raise MethodError("the engine 'petsc' needs quadrature = \"nodal\", or leave --engine out")
    if problem.stiffening:
        raise MethodError("the engine 'petsc' has no stress stiffening; leave --engine out")
    if problem.initially_stressed:
        raise MethodError("the engine 'petsc' has no initial stress or strain; leave --engine out")
    if len(problem.held_boundaries) < len(problem.supports):
        raise MethodError("the engine 'petsc' has neither springs nor supports of points; leave --engine out")
    if problem.ties:
        raise MethodError("the engine 'petsc' has no ties; leave --engine out")
    if problem.kinematics.ring:
        raise MethodError("the engine 'petsc' has no bodies of revolution; leave --engine out")
    for name, contact in problem.contact.items():
        if contact.against:
            raise MethodError(
                f"the engine 'petsc' has foundations only, and contact '{name}' is against '{contact.against}'; "
                "leave --engine out"
            )


def _present(problem: ContactProblem, mesh: Mesh | None = None) -> ContactProblem:
    """The problem with those conditions only whose boundary this rank has a part of."""
    mesh = problem.mesh if mesh is None else mesh
    here = {name for name, facets in mesh.boundaries.items() if len(facets)}
    return replace(
        problem,
        mesh=mesh,
        contact={name: value for name, value in problem.contact.items() if name in here},
        supports={name: value for name, value in problem.supports.items() if name in here},
        tractions={name: value for name, value in problem.tractions.items() if name in here},
    )


def _with_facets_around(ranks: Ranks, piece: Piece) -> Mesh:
    """The mesh of the piece with all boundary facets at its nodes, those of other ranks' cells included.

    Further nodes stand at the end.  Facets are in the same order on every rank, so that sums over them are the same.
    """
    mesh, dim = piece.mesh, piece.mesh.dim
    count = mesh.number_of_nodes
    names = list(mesh.boundaries)
    rows, destinations = [], []
    pair_start = np.searchsorted(np.sort(piece.sharing[:, 0]), np.arange(count + 1))
    partners = piece.sharing[np.argsort(piece.sharing[:, 0], kind="stable"), 1]
    for number, name in enumerate(names):
        facets = mesh.boundaries[name]
        if not len(facets):
            continue
        corner = facets.ravel()
        times = np.diff(pair_start)[corner]
        which = np.repeat(np.arange(len(corner)), times)
        within = np.arange(len(which)) - np.repeat(np.cumsum(times) - times, times)
        destination = partners[pair_start[corner[which]] + within]
        pairs = np.unique(np.column_stack([which // dim, destination]), axis=0)
        sent = facets[pairs[:, 0]]
        rows.append(
            np.column_stack(
                [
                    np.full(len(pairs), float(number)),
                    piece.numbers[sent].astype(float),
                    mesh.points[sent].reshape(len(pairs), dim * dim),
                ]
            )
        )
        destinations.append(pairs[:, 1])
    width = 1 + dim + dim * dim
    received, _, _ = ranks.exchange(
        np.concatenate([*destinations, np.zeros(0, dtype=np.int64)]), np.concatenate([*rows, np.zeros((0, width))])
    )
    ids = received[:, 1 : 1 + dim].astype(np.int64)
    fresh, first = np.unique(ids.ravel(), return_index=True)
    new = ~np.isin(fresh, piece.numbers)
    numbers = np.concatenate([piece.numbers, fresh[new]])
    points = np.concatenate([mesh.points, received[:, 1 + dim :].reshape(-1, dim)[first[new]]])
    order = np.argsort(numbers)
    boundaries = {}
    for number, name in enumerate(names):
        others = order[np.searchsorted(numbers, ids[received[:, 0] == number], sorter=order)]
        facets = np.concatenate([mesh.boundaries[name], others.reshape(-1, dim)]).astype(np.int64)
        if len(facets):
            key = np.sort(numbers[facets], axis=1)
            _, chosen = np.unique(key, axis=0, return_index=True)
            facets = facets[chosen]
        boundaries[name] = facets
    return Mesh.trusted(points, mesh.cells, boundaries, mesh.regions)


def _contact_unknowns(
    ranks: Ranks, contact: ContactPoints, nodal: NodalConditions, owned: BoolArray
) -> tuple[IntArray, Array, BoolArray]:
    """Place in the local vector, sign and activity of the contact components."""
    m, dim = contact.shape
    trace = contact.trace

    def check() -> None:
        if m and ((np.diff(trace.indptr) > 1).any() or np.unique(trace.indices).size < trace.indices.size):
            raise MethodError(
                "the engine 'petsc' cannot treat this problem: some contact points share displacements; contact "
                "boundaries must meet smoothly or at a right angle"
            )

    ranks.agree(check)
    active = (np.diff(trace.indptr) > 0).reshape(m, dim) if m else np.zeros((0, dim), dtype=bool)
    node, slot = np.nonzero(nodal.free)
    position = np.full(len(nodal.free), -1, dtype=np.int64)
    position[: len(owned)][owned] = np.arange(int(owned.sum()))
    column = trace.indices if m else np.zeros(0, dtype=np.int64)
    unknown = position[node[column]] * dim + slot[column]
    return unknown.astype(np.int64), np.sign(trace.data) if m else np.zeros(0), active


def _warnings(ranks: Ranks, own: ContactProblem, contact: ContactPoints, piece: Piece) -> tuple[str, ...]:
    """Locking, of the rank whose part is closest to incompressible, and friction left out."""
    mine: tuple[float, str] = (-np.inf, "")
    if own.mesh.number_of_cells:
        mine = largest_poisson_ratio(own), locking_warning(own) or ""
    text = max(ranks.mpi.allgather(mine))[1]
    assert contact.points is not None
    points = np.column_stack([contact.boundary, piece.numbers[contact.node], contact.points])[contact.without_friction]
    points = np.concatenate(ranks.mpi.allgather(points))
    left_out = friction_warning(points[np.lexsort((points[:, 1], points[:, 0])), 2:])
    return tuple(sentence for sentence in (text, left_out) if sentence)
