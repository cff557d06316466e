"""Output of a march: frames, probes, contact forces, and what strains and glue show."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import scipy.sparse as sp

from hemivar.basics.arguments import expect, name_of, number, whole_number
from hemivar.basics.arrays import COUNTS, SOLVED, real_array
from hemivar.basics.stated import Form, stated
from hemivar.basics.types import Array, IntArray
from hemivar.errors import ProblemError
from hemivar.evolution.discrete import DiscreteEvolution
from hemivar.evolution.history import Frame
from hemivar.evolution.state import TimeState
from hemivar.fem import Deformation, deformation
from hemivar.fem.contact_basis import nodal_depths
from hemivar.fem.elements import barycentric_gradients, shape_values
from hemivar.mechanics.statement import ContactProblem
from hemivar.mesh.mesh import Mesh
from hemivar.solvers.boundary_result import friction_of

__all__ = [
    "Frames",
    "Save",
    "contact_forces",
    "healing",
    "large_deformation",
    "nearest_cell",
    "probe_outside",
    "probe_point",
    "probe_rows",
    "probed",
]


def contact_forces(discrete: DiscreteEvolution, state: TimeState) -> dict[str, float]:
    """Forces and measures of contact, over all and by boundary.

    ``normal_force`` is the resultant of the pressure; ``friction_force`` that of the friction of the foundation on the
    body: its local component in the plane, in space the length of the vector.  ``force_time`` is the time that forces
    belong to.
    """
    shown = state.contact_force
    weights, lam = discrete.problem.contact.weights, shown.multiplier
    columns: dict[str, float] = {}
    boundaries: Mapping[str, IntArray] = dict(discrete.blocks) if len(discrete.blocks) > 1 else {}
    parts: list[tuple[str, IntArray | slice]] = [("", slice(None))]
    parts += [(f"{name}.", index) for name, index in boundaries.items()]
    own, deep = [], []
    force = weights[:, None] * lam
    rubbed = friction_of(force)
    if rubbed.shape[1] > 1:  # the tangents of different points point in different directions
        rubbed = discrete.problem.contact.global_vectors(force * (np.arange(lam.shape[1]) > 0))
    depth = nodal_depths(discrete.problem, state.local.displacement[:, 0])
    summed = np.empty((len(lam), rubbed.shape[1] + 2))
    summed[:, 0], summed[:, 1:-1], summed[:, -1] = force[:, 0], rubbed, np.where(lam[:, 0] > 0.0, weights, 0.0)
    for _, index in parts:
        own += np.add.reduce(summed[index], axis=0).tolist()
        deep.append(float(depth[index].max(initial=-np.inf)))
    sums = discrete.vectors.total(*own).reshape(len(parts), -1)
    deepest = discrete.vectors.largest(*deep)
    for (name, _), total, deepest_here in zip(parts, sums, deepest, strict=True):
        slid = total[1:-1]
        columns[f"{name}normal_force"] = float(total[0])
        columns[f"{name}friction_force"] = float(slid[0]) if slid.size == 1 else float(np.linalg.norm(slid))
        columns[f"{name}contact_measure"] = float(total[-1])
        columns[f"{name}penetration"] = float(deepest_here)
    return columns | {"force_time": shown.time}


def healing(discrete: DiscreteEvolution, before: TimeState, after: TimeState) -> str:
    """The first boundary whose glue is past its strength and closes along the curve that it has opened by, or ""."""
    for name, index in discrete.blocks:
        contact = discrete.contacts[name]
        elastic = not contact.remembers and contact.law.remembers
        if elastic and discrete.vectors.largest(float(_closes(discrete, index, before, after)))[0]:
            return name
    return ""


def _closes(discrete: DiscreteEvolution, index: IntArray, before: TimeState, after: TimeState) -> bool:
    if not index.size:
        return False
    law, places = discrete.problem.law.take(index), [state.local.displacement[index] for state in (before, after)]
    old, new = (law.debonding(r)["damage"] for r in places)
    return bool((law.past_peak(places[0]) & (new < old - SOLVED)).any())


@dataclass(frozen=True)
class Save:
    """Which states are kept, and what is measured at every step.

    Parameters
    ----------
    every : float, optional
        Time between frames; frames are states of the computation, the first at or after each multiple. By default as
        many evenly spread ones as ``most``.
    most : int
        Frames that are kept where ``every`` is not given: when there are more, every second one goes.
    probes : mapping of name to point
        Columns ``name.u_x``, ``name.u_y`` ...: the displacement at each point of the body.
    """

    every: float | None = field(
        default=None, metadata=stated(Form.NUMBER, "time between two states that are kept", above=0.0)
    )
    most: int = 200
    probes: Mapping[str, Any] = field(
        default_factory=dict,
        metadata=stated(
            Form.OWN, "points by name, whose displacement stands in the table: `probes = { tip = [1.0, 1.0] }`"
        ),
    )

    def __post_init__(self) -> None:
        if self.every is not None and not 0.0 < number(self.every, "every of Save") < math.inf:
            raise ProblemError(f"Save(every={self.every:g}): it must be a time > 0")
        whole_number(self.most, "most of Save", 2)
        expect(self.probes, Mapping, "probes of Save", "give points by names, such as {'tip': (1.0, 0.0)}")
        for name in self.probes:
            name_of(name, "a name of probes", "give one that the columns of the table begin with, such as 'tip'")


class Frames:
    """Frames as they come, of constant memory."""

    def __init__(
        self, save: Save, start: float, kept: tuple[Frame, ...] = (), counters: tuple[int, int] = (0, 1)
    ) -> None:
        self.save = save
        self.kept = list(kept)
        self._start = start
        self._count, self._stride = counters

    @property
    def counters(self) -> tuple[int, int]:
        """States offered so far, and which of them are kept."""
        return self._count, self._stride

    def offer(self, discrete: DiscreteEvolution, state: TimeState, last: bool = False) -> Frame | None:
        """Keep a state if it is due; the frame, if so."""
        every = self.save.every
        if every is None:
            due = self._count % self._stride == 0
            self._count += 1
        else:
            behind = (state.time - self._start) / every + 1e-9
            most = 2.0**53  # beyond it whole numbers are not all floats, and every step is a frame
            passed = math.floor(min(behind, most))  # multiples that are behind
            due = passed >= self._count or behind >= most
            self._count = max(self._count, passed + 1)
        if not (due or last):
            return None
        frame = frame_of(discrete, state)
        self.kept.append(frame)
        if every is None and len(self.kept) > self.save.most:
            self.kept = self.kept[::2]
            self._stride *= 2
        return frame


def frame_of(discrete: DiscreteEvolution, state: TimeState) -> Frame:
    """The body in a state."""
    memory: dict[str, Array] = {}
    m = state.multiplier.shape[0]
    index_of = dict(discrete.blocks)
    for name, states in state.memory.items():
        for what, values in states.items():
            whole = memory.setdefault(what, np.full((m, *np.shape(values)[1:]), np.nan))
            whole[index_of[name]] = values
    return Frame(
        state.time,
        discrete.full(state.body.displacement),
        discrete.full(state.body.velocity),
        state.local.displacement,
        state.contact_force.multiplier,
        state.local.velocity,
        state.contact_force.time,
        memory,
        None
        if discrete.heat is None or state.heat is None
        else discrete.heat.temperature(state.heat.state.body.displacement),
        state.time if state.control is None else state.control.factor,
    )


def large_deformation(discrete: DiscreteEvolution, frames: Sequence[Frame]) -> tuple[str, ...]:
    """When strain or rotation of the body are first beyond small ones in frames, and how large they become, if so."""
    stated = discrete.evolution.problem
    if not isinstance(stated, ContactProblem) or stated.kind:
        return ()
    own = [deformation(stated, frame.displacement) for frame in frames]
    largest = discrete.vectors.largest(*(size for one in own for size in (one.strain, one.rotation))).reshape(-1, 2)
    sizes = [Deformation(float(strain), float(rotation), 0.0, 0.0) for strain, rotation in largest]
    beyond = [number for number, one in enumerate(sizes) if one.large]
    if not beyond:
        return ()
    most = max(beyond, key=lambda number: largest[number].max())
    return (
        f"beyond small strains from t = {frames[beyond[0]].time:.6g} on: largest {sizes[beyond[0]].sizes} there, "
        f"{sizes[most].sizes} at t = {frames[most].time:.6g}; linear elasticity is inaccurate: check loads and units, "
        "or take a code with finite strains",
    )


def probed(discrete: DiscreteEvolution, probes: Mapping[str, Any]) -> Callable[[Array], dict[str, Array]]:
    """What gives the displacement (d,) of each probe, of unknowns and prescribed displacements (n + k,)."""
    rows = probe_rows(discrete, probes)
    return lambda x: {name: np.asarray(row @ x) for name, row in rows.items()}


def probe_rows(discrete: DiscreteEvolution, probes: Mapping[str, Any]) -> dict[str, sp.csr_array]:
    """For each probe the matrix (d, n + k) that gives its displacement."""
    mesh, field = discrete.field.mesh, discrete.field
    size = float(np.ptp(mesh.points, axis=0).max())
    moved = sp.csr_array(
        (np.ones(discrete.moved.size), (discrete.moved, np.arange(discrete.moved.size))),
        shape=(field.basis.shape[0], discrete.moved.size),
    )
    full = sp.csr_array(sp.hstack([field.basis, moved]))
    matrices = {}
    for name, coordinates in probes.items():
        point = probe_point(name, coordinates, mesh.dim)
        cell, share, off = nearest_cell(mesh, point)
        if off > COUNTS * size:
            raise probe_outside(name, mesh.points.min(axis=0), mesh.points.max(axis=0))
        nodes = mesh.cell_nodes(field.order)[cell]
        weights = shape_values(field.order, share)
        d = field.components
        rows = np.tile(np.arange(d), len(nodes))
        columns = (nodes[:, None] * d + np.arange(d)).ravel()
        here = sp.csr_array((np.repeat(weights, d), (rows, columns)), shape=(d, field.basis.shape[0]))
        matrices[name] = sp.csr_array(here @ full)
    return matrices


def probe_point(name: str, coordinates: Any, dim: int) -> Array:
    """The point (d,) of a probe."""
    point = real_array(coordinates, f"the probe '{name}'")
    if point.shape != (dim,):
        raise ProblemError(f"the probe '{name}' has shape {point.shape}; give {dim} coordinates")
    return point


def nearest_cell(mesh: Mesh, point: Array) -> tuple[int, Array, float]:
    """The cell that a point (d,) lies in, its barycentric coordinates there, and its distance if it lies in none."""
    corner = mesh.points[mesh.cells[:, 0]]
    share = np.einsum("mkd,md->mk", barycentric_gradients(mesh), point - corner)
    share[:, 0] += 1.0
    cell = int(np.argmax(share.min(axis=1)))
    off = np.clip(share[cell], 0.0, 1.0) @ mesh.points[mesh.cells[cell]] - point
    return cell, share[cell], float(np.linalg.norm(off))


def probe_outside(name: str, low: Array, high: Array) -> ProblemError:
    """That a probe lies outside of a body between two corners (d,)."""
    return ProblemError(
        f"the probe '{name}' lies outside of the body; give a point on it (its coordinates run from {low.tolist()} to "
        f"{high.tolist()})"
    )
