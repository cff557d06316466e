"""The patches around the inner vertices of a mesh in the plane: rings of cells, all improved in closed form.

Around a vertex z let ``y_i`` be the other nodes in turn and T_i the cell between the edges ``z y_i`` and ``z y_(i+1)``.
What balances on every cell is, on edge i with ``t = y_i - z``, moments at its two ends

    ``tau_i t, -tau_i t``     (neither force nor moment),
    ``F - M q, M q``          with ``q = R t / |t|^2``, R a quarter of a turn: one force F and couple M on all edges,

seen from T_(i-1), and from T_i with the other sign. On the reference triangle with ``t_i, t_(i+1)`` along its axes

    ``t -> const``,   ``F -> sum_k (grad lambda_k . F) e_k``,
    ``q_i = (t_(i+1) - cot t_i J / |t_i|^2) / J``,   ``q_(i+1) = -(t_i - cot t_(i+1) J / |t_(i+1)|^2) / J``,

``cot = t_i . t_(i+1) / J``, so that five fields fixed once, ``T_in, T_out, f_1, f_2, c``, make those of each cell:
their energies are six numbers of the compliance times fixed matrices. The tau are a cyclic tridiagonal system with
three columns more, eliminated one after the other for all rings of one colour and size at once.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np

from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.certificates.continuous.facet_table import FacetTable, facet_vertices
from hemivar.certificates.continuous.patches import Batch, coloured
from hemivar.certificates.continuous.split_element import split_element, voigt_map

__all__ = ["VertexRings"]

#: Cells whose numbers are held at a time: they fit a cache.
_CELLS = 1 << 12


@dataclass(frozen=True, eq=False)
class VertexRings:
    """Rings of cells around vertices of a mesh in the plane.

    Corners are numbered ``3 cell + k`` with the vertices k of a cell against the clock.

    Attributes
    ----------
    table : FacetTable
    left : bool array, shape (M,)
        Whether the cell has its sorted vertices against the clock.
    nodes : int array, shape (3 M,)
        The vertex at each corner.
    across : int array, shape (3 M,)
        The facet opposite to each corner.
    outward : array, shape (3 M,)
        The sign of the cell on that facet.
    following : int array, shape (3 M,)
        The next corner around the same vertex against the clock; -1 at the boundary.
    batches : tuple of int arrays, each of shape (c, k)
        The corners of k rings of c cells that share no cell, in turn; colour after colour.
    """

    table: FacetTable
    left: BoolArray
    nodes: IntArray
    across: IntArray
    outward: Array
    following: IntArray
    batches: tuple[IntArray, ...]

    @classmethod
    def of(cls, table: FacetTable) -> VertexRings:
        """The rings around all vertices that lie on no facet of the boundary."""
        jacobian = table.jacobian
        left = jacobian[:, 0, 0] * jacobian[:, 1, 1] > jacobian[:, 0, 1] * jacobian[:, 1, 0]
        turn = np.where(left[:, None], [0, 1, 2], [0, 2, 1]) + 3 * np.arange(len(left))[:, None]
        turn = turn.ravel()
        nodes, across, outward = table.cells.ravel()[turn], table.cell_facets.ravel()[turn], table.signs.ravel()[turn]
        sides = np.full((len(table.facets), 2), -1)
        sides.ravel()[2 * across + (outward < 0.0)] = np.arange(len(turn))
        other = sides.ravel()[2 * across + (outward > 0.0)].reshape(-1, 3)[:, [1, 2, 0]].ravel()
        following = np.where(other < 0, -1, _turned(other, 1))

        count = table.mesh.number_of_nodes
        inner = np.ones(count, dtype=bool)
        inner[table.facets[~table.interior]] = False
        size = np.bincount(nodes, minlength=count)
        inner &= size > 0
        patches = np.where(inner[nodes], nodes, -1).reshape(-1, 3)
        colour = coloured(patches, count, first=size)
        start = np.zeros(count, dtype=np.int64)
        start[nodes] = np.arange(len(nodes))
        chosen = np.flatnonzero(inner)
        kind = colour[chosen] * (size.max(initial=0) + 1) + size[chosen]
        batches = []
        for number in np.flatnonzero(np.bincount(kind)):
            vertices = chosen[kind == number]
            ring = [start[vertices]]
            for _ in range(int(size[vertices[0]]) - 1):
                ring.append(following[ring[-1]])
            batches.append(np.stack(ring))
        return cls(table, left, nodes, across, outward, following, tuple(batches))

    @property
    def vertices(self) -> BoolArray:
        """Which vertices have a ring, shape (N,)."""
        there = np.zeros(self.table.mesh.number_of_nodes, dtype=bool)
        for batch in self.batches:
            there[self.nodes[batch[0]]] = True
        return there

    def as_batches(self) -> list[Batch]:
        """The same rings as patches."""
        out = []
        for batch in self.batches:
            cells, k = np.divmod(batch.T, 3)
            around = np.arange(len(batch))
            place = np.full((*cells.shape, 3), len(batch))
            local = np.where(self.left[cells, None], [0, 1, 2], [0, 2, 1])
            for side, behind in ((2, 0), (1, 1)):  # the edge where it enters a cell, and where it leaves
                at = np.take_along_axis(local, ((k + side) % 3)[:, :, None], axis=2)
                np.put_along_axis(place, at, np.broadcast_to((around + behind)[:, None] % len(batch), at.shape), axis=2)
            out.append(Batch(self.across[_turned(batch, 2)].T, cells, place))
        return out

    def improve(self, compliance: Array, difference: Array, moments: Array) -> None:
        """Lower the misfit of a stress ring by ring.

        Parameters
        ----------
        compliance : array, shape (M, 3, 3)
            Pulled back to the reference triangle.
        difference : array, shape (M, 15)
            Degrees of freedom of the difference to the stress that is to be met, changed in place.
        moments : array, shape (F, 2, 2)
            Of the tractions, changed in place.
        """
        corners = self._corners(compliance, difference)
        change = np.zeros((len(self.nodes), 3))
        for number, batch in enumerate(self.batches):
            step = max(_CELLS // len(batch), 1)
            for start in range(0, batch.shape[1], step):
                self._improve(batch[:, start : start + step], number == 0, corners, change, moments)
        change = change.reshape(-1, 9)
        for side, cells in ((0, self.left), (1, ~self.left)):
            difference[cells] += change[cells] @ _fixed().degrees[side]

    def _corners(self, compliance: Array, difference: Array) -> Array:
        """Compliance (6) and slopes of the five fields at each corner, shape (3 M, 11)."""
        fixed = _fixed()
        upper = np.triu_indices(3)
        out = np.empty((len(self.left), 3, 11))
        for start in range(0, len(self.left), _CELLS):
            part = slice(start, start + _CELLS)
            D = compliance[part][:, upper[0], upper[1]]
            slope = (D[:, :, None] * difference[part, None]).reshape(len(D), -1) @ fixed.slopes
            left = self.left[part]
            for side, cells in ((0, left), (1, ~left)):
                if cells.any():
                    chosen = slice(None) if cells.all() else cells
                    out[part][chosen, :, :6] = (D[chosen] @ fixed.frames[side]).reshape(-1, 3, 6)
                    out[part][chosen, :, 6:] = (slope[chosen] @ fixed.named[side]).reshape(-1, 3, 5)
        return out.reshape(-1, 11)

    def _improve(self, ring: IntArray, fresh: bool, corners: Array, change: Array, moments: Array) -> None:
        """Rings (c, k) that share no cell, whose cells may be fresh: without a change so far."""
        fixed = _fixed()
        size, count = ring.shape
        flat = ring.ravel()
        one, two = _turned(flat, 1), _turned(flat, 2)
        ends = self.nodes[one], self.nodes[ring[0]]
        t = np.take(self.table.mesh.points, ends[0], axis=0).T.reshape(2, size, count)
        t = t - np.take(self.table.mesh.points, ends[1], axis=0).T[:, None]
        after = np.roll(t, -1, axis=1)
        J = t[0] * after[1] - t[1] * after[0]
        square = t[0] * t[0] + t[1] * t[1]
        cot = (t[0] * after[0] + t[1] * after[1]) / J
        near, far = cot / square, cot / np.roll(square, -1, axis=0)
        inverse = 1.0 / J
        gradients = np.stack([after[1], -after[0], -t[1], t[0]]).reshape(2, 2, size, count) * inverse

        known = np.ascontiguousarray(np.take(corners, flat, axis=0).T)
        D, slope = known[:6], known[6:]
        moved = np.zeros((9, len(flat)))
        if not fresh:
            for row, corner in ((0, flat), (3, one), (6, two)):
                moved[row : row + 3] = np.take(change, corner, axis=0).T
            slope += fixed.coupling @ (D[:, None] * moved).reshape(54, -1)
        energy = np.empty((5, 6, size, count))  # the slopes are one column more
        energy[:, :5] = (fixed.energy @ D).reshape(5, 5, size, count)
        energy[:, 5] = slope.reshape(5, size, count)

        # from T_in, T_out, f_1, f_2, c to tau_in, tau_out, F, M: rows, then columns
        for table in (energy, energy[:, :5].swapaxes(0, 1)):
            couple = table[4] * inverse
            couple += near * table[0]
            couple -= far * table[1]
            table[4] = couple
            table[2:4] = (gradients[0, :, None] * table[2]) + (gradients[1, :, None] * table[3])
        solved = _solved(energy)
        tau, flow = solved[:size], solved[size:]

        # what the cells see of it, and the facets
        force, couple = flow[:2, None], flow[2]
        seen = moved.reshape(9, size, count)
        seen += fixed.couple[:, None, None] * (inverse * couple)
        seen[1:3] += gradients[:, 0] * flow[0] + gradients[:, 1] * flow[1]
        seen[3] += np.roll(tau, -1, axis=0) - far * couple
        seen[6] -= tau + near * couple
        for row, corner in ((0, flat), (3, one), (6, two)):
            change[corner] = moved[row : row + 3].T
        along = t * tau
        across = np.stack([-t[1], t[0]]) * (couple / square)
        sign = -self.outward[two]
        facet, last = 2 * self.across[two], (ends[1] > ends[0].reshape(size, count)).ravel()
        rows = moments.reshape(-1, 2)
        for place, values in ((facet + last, along + force - across), (facet + ~last, across - along)):
            rows[place] += (values.reshape(2, -1) * sign).T


def _turned(corners: IntArray, by: int) -> IntArray:
    """Corners of the same cells, so many further against the clock."""
    turn = np.array([1, 1, -2] if by == 1 else [2, -1, -1])
    return np.asarray(corners + turn[corners % 3])


def _solved(energy: Array) -> Array:
    """The least energy of rings.

    Parameters
    ----------
    energy : array, shape (5, 6, c, k)
        Of each cell in tau where one enters, tau where one leaves, F and M; the slopes behind them.

    Returns
    -------
    array, shape (c + 3, k)
        tau, F, M; zero for rings whose energy is not definite to rounding.
    """
    size, count = energy.shape[2:]
    diagonal = energy[0, 0].copy()
    diagonal[0] += energy[1, 1, -1]
    diagonal[1:] += energy[1, 1, :-1]
    beside = energy[0, 1]
    # columns of what stays: the last tau, F, M; the slope
    rest = np.zeros((size, 5, count))
    rest[:, 1:] = energy[0, 2:].swapaxes(0, 1)
    rest[0, 1:] += energy[1, 2:, -1]
    rest[1:, 1:] += energy[1, 2:, :-1].swapaxes(0, 1)
    rest[0, 0] = beside[-1]
    rest[-2, 0] += beside[-2]
    core = np.empty((4, 5, count))
    core[0, 0], core[0, 1:] = diagonal[-1], rest[-1, 1:]
    core[1:, 1:] = energy[2:, 2:].sum(axis=2)
    definite = np.ones(count, dtype=bool)
    with np.errstate(all="ignore"):
        for i in range(size - 1):
            definite &= diagonal[i] > 0.0
            if i < size - 2:
                factor = beside[i] / diagonal[i]
                diagonal[i + 1] -= factor * beside[i]
                rest[i + 1] -= factor * rest[i]
        scaled = rest[:-1, :4] / diagonal[:-1, None]
        for row in range(4):
            core[row, row:] -= (scaled[:, row, None] * rest[:-1, row:]).sum(axis=0)
        for row in range(4):
            definite &= core[row, row] > 0.0
            for below in range(row + 1, 4):  # of the upper triangle alone
                core[below, below:] -= core[row, below] / core[row, row] * core[row, below:]
        out = np.empty((size + 3, count))
        ends = out[size - 1 :]
        for row in range(3, -1, -1):
            ends[row] = -(core[row, 4] + (core[row, row + 1 : 4] * ends[row + 1 :]).sum(axis=0)) / core[row, row]
        right = rest[:-1, 4] + (rest[:-1, :4] * ends).sum(axis=1)
        for i in range(size - 2, -1, -1):
            if i < size - 2:
                right[i] += beside[i] * out[i + 1]
            out[i] = -right[i] / diagonal[i]
        definite &= np.isfinite(out).all(axis=0)
    if not definite.all():
        out[:, ~definite] = 0.0
    return out


@dataclass(frozen=True, eq=False)
class _Fixed:
    """Matrices of the element on the reference triangle.

    Fields of a cell that balance are, for k = 0, 1, 2 and its vertices k, k + 1, k + 2 against the clock, T on the edge
    opposite to k and f_1, f_2 at k: nine.

    Attributes
    ----------
    slopes : array, shape (6 * 15, 9)
        Takes products of compliance and degrees of freedom to the slopes of the nine, in the order of sorted vertices.
    frames : array, shape (2, 6, 18)
        Takes the compliance of a cell to those seen from its corners; for sorted vertices against the clock, and not.
    named : array, shape (2, 9, 15)
        Takes slopes of the nine to those of the five fields at its corners.
    energy : array, shape (25, 6)
        Takes the compliance to the energies of the five.
    coupling : array, shape (5, 6 * 9)
        Takes products of compliance and numbers of the nine to the slopes of the five.
    couple : array, shape (9,)
        c in the nine.
    degrees : array, shape (2, 9, 15)
        Takes numbers of the nine, of vertices against the clock, to degrees of freedom, as ``frames``.
    """

    slopes: Array
    frames: Array
    named: Array
    energy: Array
    coupling: Array
    couple: Array
    degrees: Array


@cache
def _fixed() -> _Fixed:
    element = split_element(2)
    corners = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    members = facet_vertices(2).tolist()

    def field(*parts: tuple[int, int, Array]) -> Array:
        """Moments, outward, by facet, vertex and value."""
        out = np.zeros((3, 2, 2))
        for facet, vertex, value in parts:
            out[facet, members[facet].index(vertex)] += value
        return out.ravel()

    def edge(across: int, first: int, last: int) -> Array:
        along = corners[last] - corners[first]
        return field((across, first, along), (across, last, -along))

    def forces(k: int, one: int, two: int) -> list[Array]:
        ways = (corners[one] - corners[k], corners[two] - corners[k])
        return [field((one, k, way), (two, k, -way)) for way in ways]

    def five(k: int, one: int, two: int) -> Array:
        a, b = corners[one] - corners[k], corners[two] - corners[k]
        couple = field((one, k, a), (one, two, -a), (two, k, b), (two, one, -b))
        return np.stack([-edge(two, k, one), edge(one, k, two), *forces(k, one, two), couple], axis=1)

    def nine_at(k: int, one: int, two: int) -> list[Array]:
        return [edge(k, one, two), *forces(k, one, two)]

    turns, orders = [(0, 1, 2), (1, 2, 0), (2, 0, 1)], ([0, 1, 2], [0, 2, 1])
    ways = [
        np.stack([way for turn in turns for way in nine_at(*(order[vertex] for vertex in turn))], axis=1)
        for order in orders
    ]
    nine = ways[0]
    back = np.linalg.pinv(nine)
    local = back @ five(0, 1, 2)
    at = element.values @ (element.ways @ nine)
    rows, columns = np.triu_indices(3)
    slopes = np.stack([
        np.einsum("ban,ac,bck->nk", element.values[:, :, p], element.mass, at[:, :, q])
        + (np.einsum("ban,ac,bck->nk", element.values[:, :, q], element.mass, at[:, :, p]) if p != q else 0.0)
        for p, q in zip(rows, columns, strict=True)
    ])  # fmt: skip
    energies = nine.T @ element.energies @ nine
    frames, named = np.empty((2, 6, 3, 6)), np.empty((2, 9, 3, 5))
    for side, order in enumerate(orders):
        for corner, turn in enumerate(turns):
            k, i, j = (order[vertex] for vertex in turn)
            change = voigt_map(np.stack([corners[i] - corners[k], corners[j] - corners[k]], axis=1))
            for entry, (p, q) in enumerate(zip(rows, columns, strict=True)):
                unit = np.zeros((3, 3))
                unit[p, q] = unit[q, p] = 1.0
                frames[side, entry, corner] = (change.T @ unit @ change)[rows, columns]
            named[side, :, corner] = back @ five(k, i, j)
    return _Fixed(
        slopes.reshape(-1, 9), frames.reshape(2, 6, 18), named.reshape(2, 9, 15),
        (local.T @ energies @ local).reshape(6, 25).T.copy(),
        (local.T @ energies).transpose(1, 0, 2).reshape(5, 54).copy(), local[:, 4].copy(),
        np.stack([(element.ways @ way).T for way in ways]),
    )  # fmt: skip
