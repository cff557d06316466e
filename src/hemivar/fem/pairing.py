"""Contact search and segmentation: for each place of the slave the first facet of the master along its normal.

Ahead the way ends where it meets any part of the mesh, behind at the other side of the slave's own body.  So a place
finds what it faces however far that is, and however deep the bodies overlap; of two layers the nearer one counts.
Facets that coincide, as those of an interface that was opened do, are paired as they are.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import reduce

import numpy as np

from hemivar.basics.arrays import ROUNDED, SAME
from hemivar.basics.first_use import cached_property
from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.errors import ProblemError
from hemivar.fem.facet_tree import FacetTree
from hemivar.mesh.boundary_rule import BoundaryRule, boundary_rule
from hemivar.mesh.keys import facet_keys
from hemivar.mesh.mesh import Mesh
from hemivar.mesh.refine import COVERED

__all__ = ["Pairing", "paired"]

#: Cosines of the angle of two normals: above the first facets do not face each other, below the second they are seen
#: edge on and hide nothing.
_FACING, _EDGE_ON = -0.2, 1e-6
#: Cosine of the angle of two facets from which a corner is sharp.
_SHARP = np.cos(np.radians(40.0))
#: Weights of corners in a place within a polygon that no edge of a regular mesh goes through.
_WITHIN = (1.0, 0.8137, 0.6311)


@dataclass(frozen=True, eq=False)
class Pairing:
    """Simplices of the slave's facets and of those of the master that they meet, by barycentric coordinates of both."""

    sides: tuple[BoundaryRule, BoundaryRule]  # the slave, of f facets, and the master, of g
    slave: IntArray  # (k,)
    master: IntArray  # (k,)
    on_slave: Array  # (k, d, d)
    on_master: Array  # (k, d, d)
    share: Array  # (k,), of the slave's facet
    depth: Array  # (k,), ahead of the slave's facet, in the middle
    slack: Array  # (f,), distance of two places that are one
    lost: IntArray  # slave's facets that lose what their normals meet: something is in between

    @cached_property
    def covered(self) -> Array:
        """The share (f,) of each facet of the slave that meets the master."""
        return np.asarray(np.bincount(self.slave, self.share, len(self.sides[0].facets)), dtype=float)

    @property
    def touches(self) -> BoolArray:
        """Whether a facet (f,) of the slave meets the master with more than rounding."""
        return np.asarray(self.covered > COVERED)

    @property
    def beyond_corners(self) -> BoolArray:
        """Which nodes (f, n) of the slave's facets belong to nearer facets beyond a sharp corner.

        One normal cannot stand for both sides of it.  The other side hands the share of the node on to its other nodes.
        """
        members, normal = self.sides[0].nodes, self.sides[0].normals
        facet, column = np.nonzero(np.broadcast_to(self.touches[:, None], members.shape))
        node, distance = members[facet, column], self.distance[facet]
        ordered = np.lexsort((distance, node))
        _, first, group = np.unique(node[ordered], return_index=True, return_inverse=True)
        nearest = np.empty(len(node), dtype=np.int64)
        nearest[ordered] = ordered[first[group]]
        sharp = np.einsum("kd,kd->k", normal[facet], normal[facet[nearest]]) < _SHARP
        away = np.zeros(members.shape, dtype=bool)
        away[facet, column] = sharp & (distance > distance[nearest] + self.slack[facet])
        return away

    @cached_property
    def distance(self) -> Array:
        """The mean distance (f,) of what each facet of the slave meets, negative where they overlap."""
        summed = np.bincount(self.slave, self.share * self.depth, len(self.sides[0].facets))
        return np.asarray(summed / np.where(self.touches, self.covered, 1.0))


@dataclass(frozen=True, eq=False)
class _View:
    """The facets of the slave with what is seen along their normals."""

    points: Array
    facets: IntArray  # (f, d)
    normal: Array  # (f, d)
    slack: Array  # (f,), distance of two places that are one

    @cached_property
    def _back(self) -> Array:
        corner = self.points[self.facets]
        return np.linalg.inv(np.concatenate([corner[:, 1:] - corner[:, :1], self.normal[:, None]], axis=1))

    def projected(self, first: IntArray, facets: IntArray) -> _Layer:
        """Facets (p, d) as they are seen from facets (p,) of the slave."""
        d = self.points.shape[1]
        offset = self.points[facets] - self.points[self.facets[first, 0]][:, None]
        inner = offset @ self._back[first]
        depth = inner[:, :, d - 1].copy()
        inner[:, :, d - 1] = 1.0 - inner[:, :, : d - 1].sum(axis=2)
        return _Layer(np.roll(inner, 1, axis=2), depth)

    def columns(
        self, tree: FacetTree, which: IntArray, between: tuple[Array, Array] | None = None
    ) -> tuple[IntArray, IntArray]:
        """Pairs of facets of the slave, of those ``which``, and of facets of a tree that may be seen along normals."""
        corner = self.points[self.facets[which]]
        middle = corner.mean(axis=1)
        radius = np.linalg.norm(corner - middle[:, None], axis=2).max(axis=1)
        first, second = tree.near(middle, self.normal[which], radius, between)
        return which[first], second


@dataclass(frozen=True, eq=False)
class _Layer:
    """Simplices seen along the normals of the slave's facets: what hides what is behind them."""

    corners: Array  # (k, d, d), in the barycentric coordinates of the slave's facet
    depths: Array  # (k, d), of the corners

    def __getitem__(self, rows: IntArray | BoolArray) -> _Layer:
        return _Layer(self.corners[rows], self.depths[rows])

    @property
    def over_all(self) -> BoolArray:
        """Whether they are not to one side of an edge of the slave's facet, (k,)."""
        return np.asarray((_largest(self.corners) > ROUNDED).all(axis=1))


@dataclass(frozen=True, eq=False)
class _Pieces:
    """Polygons of the slave's facets, each with the simplex of a layer that it is a part of."""

    slave: IntArray  # (k,)
    master: IntArray  # (k,)
    polygon: Array  # (k, n, 2 d), corners in the barycentric coordinates of both facets
    corners: IntArray  # (k,)
    depths: Array  # (k, d), of the corners of the master's facet
    layer: _Layer  # (k,), of which the polygons are parts

    def take(self, rows: IntArray | BoolArray) -> _Pieces:
        return _Pieces(
            self.slave[rows], self.master[rows], self.polygon[rows], self.corners[rows], self.depths[rows],
            self.layer[rows],
        )  # fmt: skip

    @property
    def depth(self) -> Array:
        """Of the corners (k, n), those beyond the number of a polygon repeating its first one."""
        d = self.depths.shape[1]
        depth = np.einsum("knc,kc->kn", self.polygon[:, :, d:], self.depths)
        there = np.arange(depth.shape[1]) < self.corners[:, None]
        return np.asarray(np.where(there, depth, depth[:, :1]))


def paired(mesh: Mesh, sides: tuple[BoundaryRule, BoundaryRule], names: str) -> Pairing:
    """What the facets (f, d) of the first side, the slave, meet of those of the second one along their normals.

    ``names`` is what messages call the two.  Raises ProblemError: nothing faces the slave.
    """
    slave, master, normal = sides[0].facets, sides[1].facets, sides[0].normals
    rounding = 8.0 * np.finfo(float).eps * float(np.abs(mesh.points).max())
    view = _View(mesh.points, slave, normal, COVERED * sides[0].widths + rounding)
    first, second = view.columns(FacetTree(mesh.points[master]), np.arange(len(slave)))
    facing = np.einsum("pd,pd->p", normal[first], sides[1].normals[second]) < _FACING
    first, second = first[facing], second[facing]
    same, turn = _coinciding(view, first, master[second])
    rest, d = ~np.isin(first, first[same]), mesh.dim
    pieces, lost = _visible(mesh, view, master, _clipped_pieces(view, master, first[rest], second[rest]))
    simplices, of = _fanned(pieces.polygon, pieces.corners, d)
    share = np.abs(np.linalg.det(simplices[:, :, :d]))  # of barycentric corners: the share of the facet's measure
    big = share > ROUNDED
    simplices, of = simplices[big], of[big]
    whole = np.broadcast_to(np.eye(d), turn.shape)
    pairing = Pairing(
        sides,
        np.concatenate([first[same], pieces.slave[of]]),
        np.concatenate([second[same], pieces.master[of]]),
        np.concatenate([whole, simplices[:, :, :d]]),
        np.concatenate([turn, simplices[:, :, d:]]),
        np.concatenate([np.ones(len(turn)), share[big]]),
        np.concatenate([np.zeros(len(turn)), np.einsum("kcb,kb->k", simplices[:, :, d:], pieces.depths[of]) / d]),
        view.slack,
        lost,
    )
    if not pairing.touches.any():
        raise ProblemError(_nothing(mesh, names, slave[lost]))
    return replace(pairing, lost=lost[pairing.covered[lost] < 1.0 - COVERED])


def _nothing(mesh: Mesh, names: str, lost: IntArray) -> str:
    message = f"{names}: no facet of the one faces the other along its normals; check names, places and units"
    if not len(lost):
        return message
    point = ", ".join(f"{x:.6g}" for x in mesh.points[lost[0]].mean(axis=0))
    return f"{message}: at ({point}) another part of the mesh is in between, or the overlap is deeper than the body"


def _coinciding(view: _View, first: IntArray, facets: IntArray) -> tuple[IntArray, Array]:
    """Pairs whose two facets are one, and the coordinates (k, d, d) of the slave's corners in the master's."""
    middle = view.points[view.facets].mean(axis=1)[first]
    near = np.flatnonzero(np.abs(view.points[facets].mean(axis=1) - middle).max(axis=1) <= view.slack[first])
    own, other = view.points[view.facets[first[near]]], view.points[facets[near]]
    far = np.abs(own[:, :, None] - other[:, None]).max(axis=3)
    turn = (far <= view.slack[first[near]][:, None, None]).astype(float)
    same = (turn.sum(axis=1) == 1.0).all(axis=1) & (turn.sum(axis=2) == 1.0).all(axis=1)
    _, once = np.unique(first[near[same]], return_index=True)
    return near[same][once], turn[same][once]


def _clipped_pieces(view: _View, master: IntArray, first: IntArray, second: IntArray) -> _Pieces:
    """What each facet of the slave and each of the master have in common, seen along the normal of the slave's."""
    layer = view.projected(first, master[second])
    some = np.flatnonzero(layer.over_all)
    some = some[np.argsort(first[some], kind="stable")]
    layer = layer[some]
    d = layer.depths.shape[1]
    both = np.concatenate([layer.corners, np.broadcast_to(np.eye(d), layer.corners.shape)], axis=2)
    polygon, corners = _clipped(both, np.full(len(both), d), range(d), d)
    pieces = _Pieces(first[some], second[some], polygon, corners, layer.depths, layer)
    return pieces.take(corners >= d)


# ---- layers ----------------------------------------------------------------------------------------------------------


def _visible(mesh: Mesh, view: _View, master: IntArray, pieces: _Pieces) -> tuple[_Pieces, IntArray]:
    """What is left of pieces where nothing is in between, and the facets of the slave that lose something."""
    count, lost = len(view.facets), np.zeros(0, dtype=np.int64)
    low, high = _range(pieces, count)
    if ((low < -view.slack) | (high > view.slack)).any():
        pieces, lost = _Surroundings(mesh, view, master).unhidden(pieces, low, high)
        low, high = _range(pieces, count)
    covered = np.bincount(pieces.slave, _shares(pieces.polygon, pieces.corners, pieces.depths.shape[1]), count)
    several = (high - low > view.slack) | (covered > 1.0 + SAME)
    return _nearest(view, pieces, np.flatnonzero(several[pieces.slave])), lost


def _range(pieces: _Pieces, count: int) -> tuple[Array, Array]:
    """The least and the largest depth of what each facet of the slave meets; inf and -inf where that is nothing."""
    low, high, depth = np.full(count, np.inf), np.full(count, -np.inf), pieces.depth
    np.minimum.at(low, pieces.slave, depth.min(axis=1))
    np.maximum.at(high, pieces.slave, depth.max(axis=1))
    return low, high


def _nearest(view: _View, pieces: _Pieces, some: IntArray) -> _Pieces:
    """Pieces without what nearer ones, all among ``some``, hide."""
    one, other = (some[rows] for rows in _side_by_side(pieces.take(some)))
    over = ~_apart(pieces.layer, one, pieces.layer, other)
    one, other = np.concatenate([one[over], other[over]]), np.concatenate([other[over], one[over]])
    mine, theirs, common = _depths(pieces.take(one), pieces.layer[other])
    slack, farther = view.slack[pieces.slave[one]], np.abs(mine) - np.abs(theirs)
    hides = common & ((farther > slack) | ((np.abs(farther) <= slack) & (other < one)))
    return _without(pieces, one[hides], pieces.layer[other[hides]])


class _Surroundings:
    """The whole boundary of the mesh, which hides what is behind it.

    Ahead all of it does, and behind that of the slave's own body where the normals leave it.
    """

    def __init__(self, mesh: Mesh, view: _View, master: IntArray) -> None:
        self.view, rule = view, boundary_rule(mesh, None)
        self.facets, self.corners, self.normal = rule.facets, mesh.points[rule.facets], rule.normals
        self.tree = FacetTree(self.corners)
        every, sought = (facet_keys(facets, mesh.number_of_nodes) for facets in (self.facets, master))
        self.sought = np.isin(every, sought)
        label = np.full(mesh.number_of_nodes, mesh.parts.count)
        np.minimum.at(label, mesh.cells.ravel(), np.repeat(mesh.parts.cell, mesh.dim + 1))
        self.part, self.own, self.other = (label[facets].max(axis=1) for facets in (self.facets, view.facets, master))

    def unhidden(self, pieces: _Pieces, low: Array, high: Array) -> tuple[_Pieces, IntArray]:
        """What is left of pieces, and the facets of the slave that lose something.

        ``low`` and ``high`` (f,) are the depths of what they meet.  A piece behind belongs to a body that overlaps:
        where it is of the slave's own, the place must be within it.
        """
        own = self.own[pieces.slave]
        back = pieces.depth.mean(axis=1) < -self.view.slack[pieces.slave]
        unreal = back & (own == self.other[pieces.master])
        unreal[unreal] = ~self._within(pieces.take(unreal))
        pieces = pieces.take(~unreal)
        owner, facet, layer = self._between(low, high)
        which, by = _couples(pieces.slave, owner)
        met = ~_apart(pieces.layer, which, layer, by)
        which, by = which[met], by[met]
        mine, theirs, common = _depths(pieces.take(which), layer[by])
        slack, same = self.view.slack[owner[by]], self.part[facet[by]] == self.own[owner[by]]
        along = np.einsum("pd,pd->p", self.view.normal[owner[by]], self.normal[facet[by]])
        hides = common & ((mine > 0.0) | same & (along < 0.0)) & (theirs * mine > 0.0) & (np.abs(theirs) > slack)
        # where a body ends ahead, what begins at the same place is behind it
        hides &= np.abs(theirs) < np.abs(mine) + np.where((mine > 0.0) & (along > 0.0), slack, -slack)
        which, by, mine, theirs, same = which[hides], by[hides], mine[hides], theirs[hides], same[hides]
        nearest = np.lexsort((np.abs(theirs), which))
        nearest = nearest[np.unique(which[nearest], return_index=True)[1]]
        lost = (mine[nearest] > 0.0) & ~same[nearest]
        back = mine[nearest] < 0.0
        lost[back] = self._within(pieces.take(which[nearest[back]]))
        return _without(pieces, which, layer[by]), np.unique(pieces.slave[which[nearest[lost]]])

    def _between(self, low: Array, high: Array) -> tuple[IntArray, IntArray, _Layer]:
        """What may be between facets of the slave and what they meet: these, facets of the mesh, and how it is seen."""
        slack = self.view.slack
        behind, ahead = (low < -slack), (high > slack) & (low < np.inf)
        away = np.flatnonzero(behind | ahead)
        start, end = np.where(behind, low + slack, slack)[away], np.where(ahead, high + slack, -slack)[away]
        owner, facet = self.view.columns(self.tree, away, (start, end))
        cosine = np.einsum("pd,pd->p", self.view.normal[owner], self.normal[facet])
        hides = (np.abs(cosine) > _EDGE_ON) & ~(self.sought[facet] & (cosine < _FACING))
        owner, facet = owner[hides], facet[hides]
        layer = self.view.projected(owner, self.facets[facet])
        seen = layer.over_all & (np.abs(layer.depths).max(axis=1) > self.view.slack[owner])
        return owner[seen], facet[seen], layer[seen]

    def _within(self, pieces: _Pieces) -> BoolArray:
        """Whether places of the slave are within the body that a piece of the master belongs to, (k,)."""
        d, view = self.corners.shape[2], self.view
        weights = np.array(_WITHIN[:d]) / sum(_WITHIN[:d])
        point = np.einsum("c,kcb,kbd->kd", weights, pieces.polygon[:, :d, :d], view.points[view.facets[pieces.slave]])
        normal, still = view.normal[pieces.slave], np.zeros(len(point))
        column, facet = self.tree.near(point, normal, still, (still, still + np.inf))
        out = np.einsum("pd,pd->p", normal[column], self.normal[facet])
        some = (self.part[facet] == self.other[pieces.master[column]]) & (np.abs(out) > _EDGE_ON)
        column, facet, out = column[some], facet[some], out[some]
        corner = self.corners[facet]
        frame = np.concatenate([corner[:, 1:] - corner[:, :1], -normal[column][:, None]], axis=1)
        at = np.linalg.solve(frame.transpose(0, 2, 1), (point[column] - corner[:, 0])[:, :, None])[:, :, 0]
        inner, depth = at[:, : d - 1], at[:, d - 1]
        hit = (inner >= 0.0).all(axis=1) & (inner.sum(axis=1) <= 1.0) & (depth > view.slack[pieces.slave[column]])
        return np.bincount(column, np.where(hit, np.sign(out), 0.0), len(point)) > 0.5


def _side_by_side(pieces: _Pieces) -> tuple[IntArray, IntArray]:
    """Pairs (p,) and (p,) of pieces of one facet of the slave whose first coordinates have something in common."""
    first = np.clip(pieces.layer.corners[:, :, 0], 0.0, 1.0)
    low, high = pieces.slave + 0.5 * first.min(axis=1), pieces.slave + 0.5 * first.max(axis=1)
    order = np.argsort(low, kind="stable")
    count = np.searchsorted(low[order], high[order], "right") - np.arange(len(order)) - 1
    one = np.repeat(np.arange(len(order)), count)
    other = one + 1 + np.arange(len(one)) - np.repeat(np.cumsum(count) - count, count)
    return order[one], order[other]


def _couples(one: IntArray, other: IntArray) -> tuple[IntArray, IntArray]:
    """Rows (p,) and (p,) of equal numbers: of ``one``, which rise, and of ``other``."""
    start, end = np.searchsorted(one, other, "left"), np.searchsorted(one, other, "right")
    count = end - start
    second = np.repeat(np.arange(len(other)), count)
    return np.arange(len(second)) - np.repeat(np.cumsum(count) - count - start, count), second


def _apart(one: _Layer, i: IntArray, other: _Layer, j: IntArray) -> BoolArray:
    """Whether an edge of one of two simplices, those ``i (p,)`` and ``j (p,)``, has the other one on its far side."""
    apart = np.zeros(len(i), dtype=bool)
    for a, b, at, by in ((one, other, i, j), (other, one, j, i)):
        left = np.flatnonzero(~apart)
        inside = a.corners[at[left]] @ np.linalg.inv(b.corners)[by[left]]
        apart[left] = (_largest(inside) <= SAME).any(axis=1)
    return apart


def _largest(corners: Array) -> Array:
    """The largest of each coordinate (k, c) of corners (k, n, c)."""
    return reduce(np.maximum, corners.transpose(1, 0, 2))


def _depths(pieces: _Pieces, layer: _Layer) -> tuple[Array, Array, BoolArray]:
    """Depths (p,) of pieces and of layers in the middle of what they have in common, and whether that is anything."""
    d = layer.depths.shape[1]
    polygon, corners = _clipped(_beside(pieces.polygon, layer), pieces.corners, range(2 * d, 3 * d), d)
    there = np.arange(polygon.shape[1]) < corners[:, None]
    middle = np.where(there[:, :, None], polygon, 0.0).sum(axis=1) / np.maximum(corners, 1)[:, None]
    mine = np.einsum("pc,pc->p", middle[:, d : 2 * d], pieces.depths)
    theirs = np.einsum("pc,pc->p", middle[:, 2 * d :], layer.depths)
    return mine, theirs, _shares(polygon, corners, d) > ROUNDED


def _beside(polygon: Array, layer: _Layer) -> Array:
    """Polygons (p, n, 3 d) with the barycentric coordinates of their corners in the simplices of layers at the end."""
    d = layer.depths.shape[1]
    return np.concatenate([polygon, polygon[:, :, :d] @ np.linalg.inv(layer.corners)], axis=2)


def _without(pieces: _Pieces, which: IntArray, layer: _Layer) -> _Pieces:
    """Pieces, of which those ``which (p,)`` lose what is under the layers (p,); what is left of them is simplices."""
    if not len(which):
        return pieces
    order = np.argsort(which, kind="stable")
    count = np.bincount(which, minlength=len(pieces.slave))
    start, touched = np.cumsum(count) - count, np.flatnonzero(count)
    left = pieces.take(touched)
    for k in range(int(count.max())):
        now = np.flatnonzero(count[touched] > k)
        fresh, of = _outside(left.take(now), layer[order[start[touched[now]] + k]])
        rest = np.flatnonzero(count[touched] <= k)
        left, touched = _joined(left.take(rest), fresh), np.concatenate([touched[rest], touched[now[of]]])
    visible = _joined(pieces.take(count == 0), left)
    return visible.take(np.argsort(visible.slave, kind="stable"))


def _outside(pieces: _Pieces, layer: _Layer) -> tuple[_Pieces, IntArray]:
    """Simplices that are left of pieces (p,) outside of the simplices of layers (p,), and the piece of each."""
    d = layer.depths.shape[1]
    inside, corners = _beside(pieces.polygon, layer), pieces.corners
    parts, owners = [], []
    for axis in range(2 * d, 3 * d):
        flipped = inside.copy()
        flipped[:, :, axis] *= -1.0
        simplices, of = _fanned(*_cut(flipped, corners, axis, closed=d == 3), d)
        parts.append(simplices[:, :, : 2 * d])
        owners.append(of)
        inside, corners = _cut(inside, corners, axis, closed=d == 3)
    polygon, of = np.concatenate(parts), np.concatenate(owners)
    big = np.abs(np.linalg.det(polygon[:, :, :d])) > ROUNDED
    polygon, of = polygon[big], of[big]
    depths = np.einsum("kcb,kb->kc", polygon[:, :, d:], pieces.depths[of])
    own = _Layer(polygon[:, :, :d], depths)
    whole = np.full(len(of), d)
    return _Pieces(pieces.slave[of], pieces.master[of], polygon, whole, pieces.depths[of], own), of


def _joined(one: _Pieces, other: _Pieces) -> _Pieces:
    most = max(part.polygon.shape[1] for part in (one, other))
    polygons = [np.pad(part.polygon, ((0, 0), (0, most - part.polygon.shape[1]), (0, 0))) for part in (one, other)]
    layer = _Layer(
        np.concatenate([one.layer.corners, other.layer.corners]), np.concatenate([one.layer.depths, other.layer.depths])
    )
    return _Pieces(
        np.concatenate([one.slave, other.slave]),
        np.concatenate([one.master, other.master]),
        np.concatenate(polygons),
        np.concatenate([one.corners, other.corners]),
        np.concatenate([one.depths, other.depths]),
        layer,
    )


# ---- polygons --------------------------------------------------------------------------------------------------------


def _clipped(polygon: Array, corners: IntArray, axes: Iterable[int], d: int) -> tuple[Array, IntArray]:
    """Polygons (p, n, c) cut to where their coordinates along ``axes`` are not negative, and their numbers of corners.

    After Sutherland and Hodgman (1974), all polygons at once; a segment is a polygon of two corners.
    """
    for axis in axes:
        polygon, corners = _cut(polygon, corners, axis, closed=d == 3)
    return polygon, corners


def _cut(polygon: Array, corners: IntArray, axis: int, *, closed: bool) -> tuple[Array, IntArray]:
    count, most, width = polygon.shape
    corner = np.arange(most)
    there = corner < corners[:, None]
    following = np.where(corner + 1 < corners[:, None], corner + 1, 0)
    after = np.take_along_axis(polygon, following[:, :, None], axis=1)
    value, ahead = polygon[:, :, axis], after[:, :, axis]
    inside = there & (value >= 0.0)
    crosses = there & ((value >= 0.0) != (ahead >= 0.0)) & (closed | (corner + 1 < corners[:, None]))
    part = np.where(crosses, value / np.where(crosses, value - ahead, 1.0), 0.0)
    cut = polygon + part[:, :, None] * (after - polygon)
    cut[:, :, axis] = np.where(crosses, 0.0, cut[:, :, axis])
    every = np.stack([polygon, cut], axis=2).reshape(count, 2 * most, width)
    kept = np.stack([inside, crosses], axis=2).reshape(count, 2 * most)
    order = np.argsort(~kept, axis=1, kind="stable")
    number = kept.sum(axis=1)
    room = max(int(number.max(initial=0)), 3 if closed else 2)
    return np.take_along_axis(every, order[:, :room, None], axis=1), number


def _fanned(polygon: Array, corners: IntArray, d: int) -> tuple[Array, IntArray]:
    """The simplices (k, d, c) of polygons from their first corners, and the polygon of each."""
    if d == 2:
        whole = np.flatnonzero(corners == 2)
        return polygon[whole][:, :2], whole
    pieces, owners = [], []
    for k in range(1, polygon.shape[1] - 1):
        here = np.flatnonzero(corners > k + 1)
        pieces.append(polygon[here][:, [0, k, k + 1]])
        owners.append(here)
    if not pieces:
        return np.zeros((0, d, polygon.shape[2])), np.zeros(0, dtype=np.int64)
    return np.concatenate(pieces), np.concatenate(owners)


def _shares(polygon: Array, corners: IntArray, d: int) -> Array:
    """Shares (k,) of the slave's facets that polygons (k, n, c) are."""
    corner = polygon[:, :, :d]
    size = np.where(corners >= d, np.linalg.det(corner[:, :d]), 0.0)
    for k in range(d, polygon.shape[1]):
        size += np.where(corners > k, np.linalg.det(corner[:, [0, k - 1, k]]), 0.0) if d == 3 else 0.0
    return np.abs(size)
