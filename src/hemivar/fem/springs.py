"""Springs of supports: their stiffness by nodes and edges, their forces, and the motions that they resist."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hemivar.basics.types import Array, IntArray
from hemivar.fem.edge_blocks import EdgeBlocks
from hemivar.fem.elements import shape_values
from hemivar.fem.quadrature import quadrature_rule
from hemivar.fem.supports import supported_nodes
from hemivar.mechanics.conditions import DataField, Spring, require
from hemivar.mechanics.statement import ContactProblem
from hemivar.mesh.boundary_rule import boundary_rule

__all__ = ["NodalSprings", "add_springs", "resisted_directions", "stated_springs"]


@dataclass(frozen=True, eq=False)
class NodalSprings:
    """The stiffness of springs on facets, or at nodes, each with n nodes."""

    nodes: IntArray  # (f, n)
    blocks: Array  # (f, n, n, c, c)
    resisted: Array  # (f, c, c): not negative, zero for the displacements that the springs of a facet do not resist

    def forces(self, field: Array) -> Array:
        """Forces (nodes, c) against nodal displacements (nodes, c): their stiffness times these."""
        own, sums = np.einsum("fijcd,fjd->fic", self.blocks, field[self.nodes]), np.zeros(field.shape)
        np.add.at(sums, self.nodes, own)
        return sums


def stated_springs(problem: ContactProblem) -> dict[str, NodalSprings]:
    """The springs of a problem, by the names of their supports."""
    springs = ((name, one) for name, one in problem.supports.items() if isinstance(one, Spring))
    return {
        name: (_on_facets if name in problem.mesh.boundaries else _at_nodes)(problem, name, one)
        for name, one in springs
    }


def add_springs(problem: ContactProblem, blocks: EdgeBlocks) -> None:
    """Add the stiffness of all springs to that of a body, in place."""
    stated, count = stated_springs(problem).values(), len(blocks.diagonal)
    if not stated:
        return
    keys = blocks.edges[:, 0].astype(np.int64) * count + blocks.edges[:, 1]
    for springs in stated:
        size = springs.nodes.shape[1]
        corner = np.arange(size)
        np.add.at(blocks.diagonal, springs.nodes, springs.blocks[:, corner, corner])
        one, other = np.triu_indices(size, 1)
        ends = np.sort(np.stack([springs.nodes[:, one], springs.nodes[:, other]]), axis=0)
        edge = np.searchsorted(keys, ends[0] * count + ends[1])
        np.add.at(blocks.upper, edge, springs.blocks[:, one, other])  # blocks of springs are symmetric


def resisted_directions(problem: ContactProblem) -> tuple[IntArray, Array] | None:
    """Nodes (k,) at springs, and matrices (k, c, c) that are zero along what these do not resist; none without any."""
    springs = stated_springs(problem).values()
    if not springs:
        return None
    nodes = np.concatenate([one.nodes.ravel() for one in springs])
    each = np.concatenate([np.repeat(one.resisted, one.nodes.shape[1], axis=0) for one in springs])
    every, number = np.unique(nodes, return_inverse=True)
    sums = np.zeros((len(every), *each.shape[1:]))
    np.add.at(sums, number.ravel(), each)
    return every, sums


def _tensors(normals: Array, along: Array, across: Array) -> Array:
    """``along nu nu' + across (1 - nu nu')`` of normals (f, d) and stiffness (f, ...), shape (f, ..., d, d)."""
    straight = normals[:, :, None] * normals[:, None, :]
    rest = np.eye(normals.shape[1]) - straight
    shape = (len(normals), *(1,) * (along.ndim - 1), *straight.shape[1:])
    return np.asarray(along[..., None, None] * straight.reshape(shape) + across[..., None, None] * rest.reshape(shape))


def _made(nodes: IntArray, shapes: Array, normals: Array, along: Array, across: Array) -> NodalSprings:
    """Of integrals (f, q) of stiffness at points where functions of the nodes have the values ``shapes (q, n)``."""
    blocks = np.einsum("qi,qj,fqcd->fijcd", shapes, shapes, _tensors(normals, along, across))
    sizes = [(part > 0.0).any(axis=1).astype(float) for part in (along, across)]
    return NodalSprings(nodes, blocks, _tensors(normals, *sizes))


def _along(spring: Spring, normals: Array) -> Array:
    if spring.direction is None:
        return normals
    vector = np.array(spring.direction)
    return np.broadcast_to(vector / np.linalg.norm(vector), normals.shape)


def _on_facets(problem: ContactProblem, name: str, spring: Spring) -> NodalSprings:
    mesh, order, body = problem.mesh, problem.order, problem.kinematics
    rule = boundary_rule(mesh, name, order)
    barycentric, weights = quadrature_rule(mesh.dim - 1, 2 * order + 1)
    points = np.einsum("qk,fkd->fqd", barycentric, mesh.points[rule.facets])
    measure = weights * rule.weights[:, None] * body.measure(points)
    stiffness = _stiffness(name, spring, points.reshape(-1, mesh.dim))
    along, across = (measure * at.reshape(measure.shape) for at in stiffness)
    return _made(rule.nodes, shape_values(order, barycentric), _along(spring, rule.normals), along, across)


def _at_nodes(problem: ContactProblem, name: str, spring: Spring) -> NodalSprings:
    nodes, _ = supported_nodes(problem, name)
    along, across = _stiffness(name, spring, problem.mesh.nodes(problem.order)[nodes])
    any_way = np.eye(problem.mesh.dim)[np.zeros(len(nodes), dtype=np.int64)]
    return _made(nodes[:, None], np.ones((1, 1)), _along(spring, any_way), along[:, None], across[:, None])


def _stiffness(name: str, spring: Spring, points: Array) -> list[Array]:
    """Stiffness (k,) at points (k, d), along and across."""
    given = {"normal": spring.normal, "tangential": spring.tangential}
    values = {f"supports['{name}'], {part}": value for part, value in given.items()}
    stiffness = [DataField(value, what).at(points) for what, value in values.items()]
    for what, one in zip(values, stiffness, strict=True):
        require(one >= 0.0, points, one, what, "must not be negative")
    return stiffness
