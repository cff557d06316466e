"""Supports (Dirichlet conditions): fixed directions and prescribed displacements of the nodes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hemivar.basics.arrays import SAME
from hemivar.basics.types import Array, IntArray
from hemivar.errors import SupportError
from hemivar.mechanics.conditions import (
    Clamped,
    DataField,
    Fixed,
    Prescribed,
    RigidPlate,
    Roller,
    ScalarData,
    Spring,
    Support,
    at_rest,
)
from hemivar.mechanics.statement import ContactProblem
from hemivar.mesh.boundary_rule import BoundaryRule, boundary_rule
from hemivar.mesh.mesh import Mesh

__all__ = [
    "DEPENDENT",
    "SHARP",
    "Supports",
    "in_words",
    "movable",
    "nodes_at",
    "on_coarser",
    "stated_supports",
    "sum_by",
    "supported_nodes",
    "unit",
]

#: Part of a unit vector below which it depends on others.
DEPENDENT = 1e-8
#: Cosine of the angle from which facets or boundaries meet sharply.
SHARP = np.cos(np.pi / 4)
#: Nodes at one place that a point finds, as many as an opened interface has where sides meet.
_AT_ONCE = 8


class Supports:
    """Fixed directions and prescribed displacements at every node, accumulated support by support."""

    def __init__(self, nodes: Array, components: int) -> None:
        count, dim = len(nodes), components
        self.nodes = nodes
        self.directions = np.zeros((count, dim, dim))
        self.count = np.zeros(count, dtype=np.int64)
        self.value = np.zeros((count, dim))
        self.owner = np.full((count, dim), -1)
        self.names: list[str] = []
        self.notes: list[str] = []  # points that are no nodes

    def fix(self, name: str, nodes: IntArray, directions: Array, values: Array) -> None:
        """Demand ``directions . u = values`` at (distinct) nodes; directions (k, d) are unit vectors."""
        if name not in self.names:
            self.names.append(name)
        known = self.directions[nodes]
        along = np.einsum("kqd,kd->kq", known, directions)
        rest = directions - np.einsum("kq,kqd->kd", along, known)
        size = np.linalg.norm(rest, axis=1)
        missing = values - np.einsum("kd,kd->k", directions, self.value[nodes])
        independent = size > DEPENDENT
        tolerance = SAME * max(float(np.abs(part).max(initial=0.0)) for part in (values, self.value))
        conflict = ~independent & (np.abs(missing) > tolerance)
        if conflict.any():
            bad = int(np.flatnonzero(conflict)[0])
            node = int(nodes[bad])
            scalar = self.value.shape[1] == 1
            what, along_which = ("values", "") if scalar else ("displacements", f" along {in_words(directions[bad])}")
            other = self.names[int(self.owner[node, int(np.argmax(np.abs(along[bad])))])]
            raise SupportError(
                f"supports '{other}' and '{name}' prescribe different {what} at node {node}, "
                f"x = {in_words(self.nodes[node])}: they differ by {missing[bad]:.3g}{along_which}; make them agree "
                "there or free one of them"
            )
        nodes, rest, size, missing = (
            nodes[independent],
            rest[independent],
            size[independent],
            missing[independent],
        )
        unit = rest / size[:, None]
        unit[np.abs(unit) < 1e-15] = 0.0
        slot = self.count[nodes]
        self.directions[nodes, slot] = unit
        self.owner[nodes, slot] = self.names.index(name)
        self.value[nodes] += unit * (missing / size)[:, None]
        self.count[nodes] += 1


def stated_supports(problem: ContactProblem) -> Supports:
    """What the supports of a problem demand, in the order in which they are stated."""
    supports = Supports(problem.mesh.nodes(problem.order), problem.components)
    for name, support in problem.supports.items():
        _impose(supports, problem, name, support)
    middle = np.flatnonzero(problem.kinematics.on_axis(supports.nodes))
    if middle.size:
        supports.fix("the axis", middle, np.broadcast_to([1.0, 0.0], (len(middle), 2)), np.zeros(len(middle)))
    return supports


def supported_nodes(problem: ContactProblem, name: str) -> tuple[IntArray, str | None]:
    """The nodes of a support, and how far the points that it states are from them, in words."""
    mesh, order, at = problem.mesh, problem.order, getattr(problem.supports[name], "at", None)
    if at is not None:
        nodes, far = nodes_at(mesh.nodes(order), np.array(at))
        where = f"support '{name}': the nearest node of x = {in_words(np.array(at[int(np.argmax(far))]))} is"
        size = float(np.ptp(mesh.points, axis=0).max())
        return nodes, f"{where} {far.max():.3g} away, which is taken" if far.max() > SAME * size else None
    if name in mesh.boundaries:
        return np.unique(boundary_rule(mesh, name, order).nodes), None
    inside = np.zeros(mesh.number_of_nodes, dtype=bool)
    inside[mesh.node_sets[name]] = True
    return np.flatnonzero(inside if order == 1 else np.append(inside, inside[mesh.edges].all(axis=1))), None


def on_coarser(problem: ContactProblem, mesh: Mesh) -> ContactProblem:
    """The problem with linear elements on a coarser mesh, where points that are no nodes are held at nearby ones.

    They are at rest there, and let go where a support holds the node already: nothing contradicts itself.
    """
    coarse = replace(problem, mesh=mesh, order=1)
    off = {name: one for name, one in problem.supports.items() if supported_nodes(coarse, name)[1] is not None}
    if not off:
        return coarse
    supports = {name: one for name, one in problem.supports.items() if name not in off}
    taken = np.flatnonzero(stated_supports(replace(coarse, supports=supports)).count)
    for name, one in off.items():
        nodes, _ = supported_nodes(coarse, name)
        if not np.isin(nodes, taken).any():
            supports[name] = at_rest(one, mesh.dim)
        taken = np.append(taken, nodes)
    return replace(coarse, supports=supports)


def nodes_at(nodes: Array, points: Array) -> tuple[IntArray, Array]:
    """Nodes (k,) nearest to points (p, d), all of those at one place, and distances (p,) of the points from them."""
    from scipy.spatial import KDTree  # only here: SciPy takes long to load it

    tolerance = SAME * float(np.ptp(nodes, axis=0).max())
    far, near = KDTree(nodes).query(points, k=min(_AT_ONCE, len(nodes)))
    first = np.where(far <= far[:, :1] + tolerance, near, len(nodes)).min(axis=1)  # whatever rounding makes of a tie
    there = np.linalg.norm(nodes[near] - nodes[first][:, None], axis=2) <= tolerance
    return np.unique(near[there]), far[:, 0]


def _impose(supports: Supports, problem: ContactProblem, name: str, support: Support | ScalarData) -> None:
    """Demand what a support demands at its nodes."""
    ids, note = supported_nodes(problem, name)
    supports.notes += [] if note is None else [note]
    points, components = supports.nodes[ids], supports.value.shape[1]
    what = f"supports['{name}']"
    if isinstance(support, Spring | RigidPlate):
        return
    if isinstance(support, Roller):
        for members, normals in _smooth_normals(boundary_rule(problem.mesh, name, problem.order)):
            supports.fix(name, members, normals, np.zeros(len(members)))
        return
    if isinstance(support, Fixed):
        columns = {
            axis: DataField(value, f"{what}, {'xyz'[axis]}").at(points)
            for axis, value in enumerate((support.x, support.y, support.z))
            if value is not None
        }
    elif isinstance(support, Clamped | Prescribed):
        value = support.value if isinstance(support, Prescribed) else 0.0
        columns = dict(enumerate(DataField(value, what, components).at(points).T))
    else:
        columns = {0: DataField(support, what).at(points)}
    for axis, column in columns.items():
        supports.fix(name, ids, np.broadcast_to(np.eye(components)[axis], (len(ids), components)), column)


def _smooth_normals(rule: BoundaryRule) -> list[tuple[IntArray, Array]]:
    """Averaged facet normals at the nodes of a boundary; facets that meet sharply are averaged separately.

    Returns up to d pairs of nodes (distinct in each pair) and unit normals.
    """
    ids, often = rule.nodes.ravel(), rule.nodes.shape[1]
    normal, weight = np.repeat(rule.normals, often, axis=0), np.repeat(rule.weights, often)
    remaining = np.arange(len(ids))
    groups = []
    for _ in range(normal.shape[1]):
        if len(remaining) == 0:
            break
        nodes, first, number = np.unique(ids[remaining], return_index=True, return_inverse=True)
        seed = normal[remaining[first]]
        alike = np.einsum("kd,kd->k", normal[remaining], seed[number]) > SHARP
        chosen = remaining[alike]
        groups.append((nodes, unit(sum_by(number[alike], normal[chosen] * weight[chosen, None], len(nodes)))))
        remaining = remaining[~alike]
    return groups


def sum_by(index: IntArray, values: Array, count: int) -> Array:
    """Sums (count, d) of the rows of values (k, d) with the same index (k,)."""
    return np.column_stack([np.bincount(index, weights=column, minlength=count) for column in values.T])


def unit(vectors: Array) -> Array:
    """Vectors of length one in the same directions; components that are rounding become zero."""
    scaled = vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)
    scaled[np.abs(scaled) < 1e-15] = 0.0
    return np.asarray(scaled)


def movable(vectors: Array, fixed: Array) -> Array:
    """Part of vectors (k, c, d) orthogonal to the orthonormal rows of ``fixed`` (k, q, d), which may be zero."""
    along = np.einsum("kcd,kqd->kcq", vectors, fixed)
    return np.asarray(vectors - np.einsum("kcq,kqd->kcd", along, fixed))


def in_words(values: Array) -> str:
    """A place or a direction for a message."""
    return "(" + ", ".join(f"{value + 0.0:.6g}" for value in values) + ")"
