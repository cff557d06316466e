"""Rigid plates: boundaries whose nodes follow a rigid motion, under the force and the moment on the plate.

The displacement of the nodes is ``U = R (S a + m)``: R are translations and turns about a point, m what supports and
statement prescribe, S what they leave.  So many displacements of the nodes as S has columns stand for a, and the
others follow them (:mod:`hemivar.fem.links`): unknowns are displacements, and levels need not know.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
import scipy.linalg
import scipy.sparse as sp

from hemivar.basics.arrays import SAME
from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.discrete.rigid_modes import admitted
from hemivar.errors import SupportError
from hemivar.fem.supports import Supports
from hemivar.mechanics.conditions import DataField, RigidPlate
from hemivar.mechanics.statement import ContactProblem
from hemivar.mesh.boundary_rule import boundary_rule

__all__ = ["Plate", "plate_load", "stated_plates"]


@dataclass(frozen=True, eq=False)
class Plate:
    """A plate before supports: its nodes, how they move with it, and what is stated of it."""

    name: str
    nodes: IntArray  # (k,)
    names: tuple[str, ...]  # (r,): of its motions
    scale: Array  # (r,): of the angles, of one at which they displace by one
    motions: Array  # (k, c, r): R
    pushed: Array  # (r,): work of force and moment along them
    prescribed: dict[int, float]  # motions that are stated

    @staticmethod
    def of(problem: ContactProblem, name: str, stated: RigidPlate) -> Plate:
        """That of a support."""
        rule, dim, ring = boundary_rule(problem.mesh, name, problem.order), problem.mesh.dim, problem.kinematics.ring
        nodes = np.unique(rule.nodes)
        middles = problem.mesh.points[rule.facets].mean(axis=1)
        about = np.average(middles, axis=0, weights=rule.weights) if stated.about is None else np.array(stated.about)
        arms = problem.mesh.nodes(problem.order)[nodes] - about
        size = float(np.abs(arms).max())
        motions, names = [np.broadcast_to(axis, arms.shape) for axis in np.eye(dim)], list("xyz"[:dim])
        for axis in (2,) if dim == 2 else (0, 1, 2):
            i, j = (axis + 1) % 3, (axis + 2) % 3
            turn = np.zeros(arms.shape)
            turn[:, i], turn[:, j] = -arms[:, j] / size, arms[:, i] / size
            motions.append(turn)
            names.append(f"turn_{'xyz'[axis]}")
        where, at = f"supports['{name}'], ", about[None]
        force = DataField(stated.force, where + "force", dim).at(at)[0]
        moment = np.atleast_1d(DataField(stated.moment, where + "moment", 1 if dim == 2 else 3).at(at)[0])
        scale = np.append(np.ones(dim), np.full(len(names) - dim, size))
        given = {names.index(one): value for one, value in stated.motions.items()}
        values = {k: float(scale[k] * DataField(value, where + names[k]).at(at)[0]) for k, value in given.items()}
        plate = Plate(name, nodes, tuple(names), scale, np.stack(motions, 2), np.append(force, moment) / scale, values)
        return plate.along_axis() if ring else plate

    def along_axis(self) -> Plate:
        """That of a body of revolution: it moves along the axis."""
        given = {k - 1: value for k, value in self.prescribed.items()}
        motions = self.motions[..., 1:2]
        return Plate(self.name, self.nodes, self.names[1:2], self.scale[1:2], motions, self.pushed[1:2], given)

    def held_directions(self, supports: Supports) -> BoolArray:
        """Which of the directions (k, c) that supports know at its nodes they hold."""
        return np.arange(supports.directions.shape[1]) < supports.count[self.nodes][:, None]

    def held(self, supports: Supports) -> tuple[Array, Array]:
        """Conditions (h, r) on its motions, and their values (h,): what is stated of it, then what supports hold."""
        stated = np.eye(len(self.names))[list(self.prescribed)]
        directions, used = supports.directions[self.nodes], self.held_directions(supports)
        rows = np.einsum("kqd,kdr->kqr", directions, self.motions)[used]
        values = np.einsum("kqd,kd->kq", directions, supports.value[self.nodes])[used]
        return np.concatenate([stated, rows]), np.append(list(self.prescribed.values()), values)

    def follow(self, supports: Supports, directions: Array, free: BoolArray) -> tuple[sp.csr_array, Array, IntArray]:
        """Conditions ``J U = b`` of its nodes: J (q, nodes * c), b (q,), and the nodes (q,) that follow."""
        conditions, values = self.held(supports)
        left = admitted(conditions)
        rest = np.linalg.lstsq(conditions, values, rcond=SAME)[0] if len(values) else np.zeros(len(self.names))
        missed = np.abs(conditions @ rest - values)
        if missed.max(initial=0.0) > SAME * np.abs(values).max(initial=0.0):
            raise SupportError(
                f"the rigid plate '{self.name}' cannot move as supports of its nodes demand: they differ by "
                f"{missed.max():.3g}; free some of them"
            )
        own = free[self.nodes]
        turned = directions[self.nodes]
        moved = np.einsum("kqd,kdr->kqr", turned, self.motions)[own]  # (f, r) along free directions
        node, slot = np.nonzero(own)
        dim, size = free.shape[1], free.size
        columns = self.nodes[node][:, None] * dim + np.arange(dim)
        starts = np.arange(0, columns.size + 1, dim)
        along = sp.csr_array((turned[node, slot].ravel(), columns.ravel(), starts), shape=(len(node), size))
        able = moved @ left
        count = left.shape[1]
        pivots = scipy.linalg.qr(able.T, mode="r", pivoting=True)[1][:count] if count else np.zeros(0, dtype=np.int64)
        others = np.setdiff1d(np.arange(len(node)), pivots)
        share = np.linalg.solve(able[pivots].T, able[others].T).T if count else np.zeros((len(others), 0))
        rows = along[others] - sp.csr_array(share) @ along[pivots]
        fixed = moved @ rest
        return sp.csr_array(rows), fixed[others] - share @ fixed[pivots], self.nodes[node[others]]

    def load(self, count: int) -> Array:
        """Forces (count, c) on its nodes with the stated resultants."""
        flat = self.motions.reshape(-1, len(self.names))
        forces = np.zeros((count, self.motions.shape[1]))
        along = flat @ np.linalg.lstsq(flat.T @ flat, self.pushed, rcond=SAME)[0]
        forces[self.nodes] = along.reshape(len(self.nodes), -1)
        return forces

    def resultants(self, pushed: Array) -> dict[str, float]:
        """Force and moment, by name, of what is done along its motions (r,)."""
        named = [f"force_{name}" if len(name) == 1 else f"moment_{name[-1]}" for name in self.names]
        return dict(zip(named, (pushed * self.scale).tolist(), strict=True))

    def force(self, pushed: Array) -> Array:
        """The force (c,) of what is done along its motions (r,)."""
        parts = self.resultants(pushed)
        return np.array([parts.get(f"force_{axis}", 0.0) for axis in "xyz"[: self.motions.shape[1]]])

    def amounts(self, displacement: Array) -> dict[str, float]:
        """Its motions, by name, of nodal displacements (nodes, c)."""
        flat = self.motions.reshape(-1, len(self.names))
        values = np.linalg.lstsq(flat, displacement[self.nodes].ravel(), rcond=None)[0] / self.scale
        return dict(zip(self.names, values.tolist(), strict=True))


def stated_plates(problem: ContactProblem) -> list[Plate]:
    """The plates of a problem, which share no node."""
    stated = problem.supports.items()
    plates = [Plate.of(problem, name, plate) for name, plate in stated if isinstance(plate, RigidPlate)]
    for one, other in itertools.combinations(plates, 2):
        if np.intersect1d(one.nodes, other.nodes).size:
            raise SupportError(
                f"the rigid plates '{one.name}' and '{other.name}' share nodes; name one boundary for both, or let "
                "them end apart"
            )
    return plates


def plate_load(problem: ContactProblem, count: int) -> Array:
    """Forces on all plates, as forces of the nodes (count * c,)."""
    forces = [plate.load(count).ravel() for plate in stated_plates(problem)]
    return np.sum(forces, axis=0) if forces else np.zeros(count * problem.components)
