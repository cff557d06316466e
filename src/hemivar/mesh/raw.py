"""Mesh data as files hold them (nodes, elements, groups), put together from their blocks."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from hemivar.basics.types import Array, IntArray
from hemivar.errors import ProblemError
from hemivar.mesh.kinds import CODES, ElementKind

__all__ = ["MOST_GROUPS", "Block", "RawMesh", "put_together"]

#: What numbers more groups than these counts cells rather than groups.
MOST_GROUPS = 256


@dataclass(frozen=True, eq=False)
class RawMesh:
    """What a mesh file holds, before it is a mesh."""

    points: Array  # (N, 2 or 3)
    cells: dict[int, IntArray]  # (k, n): nodes of the elements, in the order of :mod:`hemivar.mesh.kinds`
    kinds: dict[int, IntArray]  # (k,): kinds of the elements, by their places in ``KINDS``
    groups: dict[tuple[int, str], IntArray] = field(default_factory=dict)  # (k,)
    at_nodes: dict[str, IntArray] = field(default_factory=dict)  # (k,): named groups of nodes
    notes: list[str] = field(default_factory=list)  # what the file has and could not be taken


@dataclass(frozen=True, eq=False)
class Block:
    """Elements of one kind: their nodes, and the groups of all of them or the group and entity of each (0: none)."""

    kind: ElementKind
    nodes: IntArray
    groups: list[int] | IntArray
    entities: IntArray | None = None

    def padded(self, width: int) -> IntArray:
        """The nodes, filled to so many columns with the first one."""
        over = np.broadcast_to(self.nodes[:, :1], (len(self.nodes), width - self.nodes.shape[1]))
        return np.hstack([self.nodes, over]) if over.size else self.nodes

    def members(self) -> Iterator[tuple[int, IntArray]]:
        """Groups, and their rows."""
        if isinstance(self.groups, list):
            for group in self.groups:
                yield group, np.arange(len(self.nodes))
            return
        for group in np.unique(self.groups[_changes(self.groups)]).tolist():
            if group:
                yield group, np.flatnonzero(self.groups == group)


def put_together(
    ids: IntArray, points: Array, blocks: Sequence[Block], names: Mapping[tuple[int, int], str], *, repeated: bool
) -> RawMesh:
    """The mesh of the nodes and elements of a file.

    Shapes: ``ids`` (N,), ``points`` (N, 3).
    """
    infinite = ~np.isfinite(points).all(axis=1)
    if infinite.any():
        bad = int(np.argmax(infinite))
        raise ProblemError(f"node {ids[bad]} has the coordinates {points[bad].tolist()}; all must be finite")
    number = _numbering(ids)
    cells: dict[int, IntArray] = {}
    kinds: dict[int, IntArray] = {}
    groups: dict[tuple[int, str], IntArray] = {}
    for dim in range(4):
        own = [block for block in blocks if block.kind.dim == dim and len(block.nodes)]
        if not own:
            continue
        members: dict[int, list[IntArray]] = {}
        start = 0
        for block in own:
            for group, rows in block.members():
                members.setdefault(group, []).append(start + rows)
            start += len(block.nodes)
        width = max(block.kind.nodes for block in own)
        nodes = number(np.concatenate([block.padded(width) for block in own]))
        kinds[dim] = np.repeat([CODES[block.kind.name] for block in own], [len(block.nodes) for block in own])
        together = {group: np.concatenate(rows) for group, rows in members.items()}
        if repeated:
            nodes, kinds[dim], together = _united(nodes, kinds[dim], together, own)
        cells[dim] = nodes
        for group, rows in sorted(together.items()):
            name = names.get((dim, group), "")
            name = name if name.strip() else str(group)
            groups[dim, name] = _merged([groups.get((dim, name), rows), rows], len(nodes))
    return RawMesh(points, cells, kinds, groups)


def _changes(values: IntArray) -> IntArray:
    """Where entries (k,) differ from the one before: far fewer than k, as elements of a group follow each other."""
    return np.flatnonzero(np.concatenate([[True], values[1:] != values[:-1]]))


def _merged(parts: list[IntArray], count: int) -> IntArray:
    """All numbers below ``count`` in some lists, sorted, each once."""
    mask = np.zeros(count, dtype=bool)
    for part in parts:
        mask[part] = True
    return np.flatnonzero(mask)


def _united(
    nodes: IntArray, kinds: IntArray, members: dict[int, IntArray], blocks: list[Block]
) -> tuple[IntArray, IntArray, dict[int, IntArray]]:
    """Elements that format 2 repeats for each of their groups, made into one."""
    group = np.concatenate([np.asarray(block.groups) for block in blocks])
    entity = np.concatenate([np.asarray(block.entities) for block in blocks])
    new = np.union1d(_changes(entity), _changes(group))
    pairs = np.unique(np.column_stack([entity[new], group[new]]), axis=0)
    several = pairs[1:, 0][pairs[1:, 0] == pairs[:-1, 0]]
    doubtful = np.flatnonzero(np.isin(entity, several))
    if not doubtful.size:
        return nodes, kinds, members
    _, first, which = np.unique(np.sort(nodes[doubtful], axis=1), axis=0, return_index=True, return_inverse=True)
    which = which.ravel()
    if len(np.unique(np.column_stack([which, group[doubtful]]), axis=0)) < len(doubtful):
        return nodes, kinds, members  # repeated without need: an error that the mesh reports with its place
    stands_for = np.arange(len(nodes))
    stands_for[doubtful] = doubtful[first[which]]
    kept = stands_for == np.arange(len(nodes))
    number = np.cumsum(kept) - 1
    return nodes[kept], kinds[kept], {key: number[stands_for[rows]] for key, rows in members.items()}


def _numbering(ids: IntArray) -> Callable[[IntArray], IntArray]:
    """The function from numbers of nodes in the file to their places."""
    count, largest = len(ids), int(ids.max(initial=0))
    if largest <= 8 * count + 1024:
        table = np.full(largest + 2, -1, dtype=np.int64)
        table[ids] = np.arange(count)
        twice = table[ids] != np.arange(count)
        if twice.any():
            raise ProblemError(f"node {ids[int(np.argmax(twice))]} occurs twice; save the mesh again")

        def look_up(wanted: IntArray) -> IntArray:
            if wanted.min(initial=1) < 1 or wanted.max(initial=1) > largest:
                wanted = np.where((wanted < 1) | (wanted > largest), largest + 1, wanted)
            return table[wanted]
    else:
        order = np.argsort(ids)
        ordered = ids[order]
        same = ordered[1:] == ordered[:-1]
        if same.any():
            raise ProblemError(f"node {ordered[int(np.argmax(same))]} occurs twice; save the mesh again")

        def look_up(wanted: IntArray) -> IntArray:
            slot = np.minimum(np.searchsorted(ordered, wanted), count - 1)
            return np.where(ordered[slot] == wanted, order[slot], -1)

    def number(wanted: IntArray) -> IntArray:
        rows = look_up(wanted)
        if (rows < 0).any():
            bad = wanted[rows < 0].ravel()[0]
            raise ProblemError(f"an element refers to node {bad}, which is not in the file; save the mesh again")
        return rows

    return number
