"""Sweeps as the preconditioner of conjugate gradients, until the misfit is of the size of the error.

A sweep changes the tractions by the preconditioned residual d of a quadratic, the sum of misfit and price. With p the
direction of the step before, the next one is ``p' = d - (d, A p) / (p, A p) p``, A being the matrix of the quadratic,
and its length is the one at which the quadratic is least. So a step gains at least what its sweep does. ``A d`` is what
the sweep adds to the slopes of the cells.

How many sweeps are worth their price the misfit does not tell by itself. Let an error fulfil ``a(e, v) = r(v)``. Tested
with the bubbles of the edges inside, each by itself, the residual r shows about what the elements do not resolve
(R. E. Bank and R. K. Smith, SIAM J. Numer. Anal. 30, 1993). A misfit of some times that is unfinished; the guarantee
does not depend on it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.bounds.admissible_stress import AdmissibleStress
from hemivar.bounds.body_data import BodyData
from hemivar.bounds.compiled_cells import bubble_square
from hemivar.bounds.compiled_patches import Prices
from hemivar.bounds.facet_table import FacetTable
from hemivar.bounds.patches import PatchKind, cell_patches
from hemivar.bounds.sweeps import ContactPenalty, PatchSmoother
from hemivar.mechanics.kinematics import voigt_index
from hemivar.mesh.keys import EDGES

__all__ = ["Sweeps", "unresolved"]

#: By default, in the plane and in space, with linear elements; with quadratic ones, which cost less in proportion.
_LINEAR: dict[int, tuple[PatchKind, ...]] = {2: (PatchKind.VERTEX,), 3: (PatchKind.EDGE,)}
_QUADRATIC = (PatchKind.VERTEX, PatchKind.VERTEX)

#: A misfit of so many times what is not resolved is finished, in the plane and in space.
_ENOUGH = {2: 3.0, 3: 4.0}
#: Part of the square of the misfit that a step must gain for another one to follow; where the misfit is larger still by
#: so many times.
_GAIN, _FAR, _GAIN_FAR = 0.06, 3.0, 0.015
#: Part that the last sweep must have gained with quadratic elements for steps to follow.
_LAST = 0.25
#: Steps at most, and after how many of them contact tractions are priced anew.
_MOST, _RENEWED = 24, 4
#: Cells whose numbers are held at a time.
_CELLS = 1 << 12

#: The ends of the edges of a cell, as :func:`cell_patches` numbers them.
_ENDS = {2: ((1, 2), (0, 2), (0, 1)), 3: EDGES[3]}

_Price = Callable[[], ContactPenalty | None]


@dataclass(frozen=True, eq=False)
class _Direction:
    """A step: what it changes, and its square ``(p, A p)``."""

    moments: Array  # (F, k, d)
    slopes: Array  # (M, n)
    square: float
    #: The part of the square that is misfit.
    own: float


@dataclass(frozen=True)
class Sweeps:
    """Sweeps over patches of some kinds, and whether steps over the last kind follow where they are worth it."""

    kinds: tuple[PatchKind, ...]
    on: bool = False

    @classmethod
    def usual(cls, dim: int, order: int = 1) -> Sweeps:
        """Those by default."""
        return cls(_LINEAR[dim] if order == 1 else _QUADRATIC, on=True)

    def sweeper(self, stress: AdmissibleStress) -> PatchSmoother:
        """What improves a stress in place; what steps need to know of the displacement is found before."""
        if self.on and stress.data.order == 1:
            unresolved(stress.data)
        return PatchSmoother(stress, own=True)

    def lower(self, sweeper: PatchSmoother, price: _Price | None = None) -> AdmissibleStress:
        """The stress of a sweeper with less misfit, its contact tractions freed at a price."""
        before = 0.0
        for kind in self.kinds:
            before = sweeper.misfit if self.on and sweeper.data.order > 1 else before
            sweeper.sweep(kind, None if price is None else price())
        if self.on:
            _go_on(sweeper, self.kinds[-1], price, before)
        return sweeper.stress


def _go_on(sweeper: PatchSmoother, kind: PatchKind, price: _Price | None, before: float) -> int:
    """Steps until the misfit is small enough, or they gain little; their number."""
    data = sweeper.data
    square = sweeper.misfit
    if data.order > 1:
        least = np.inf if before - square < _LAST * square else square / _FAR**2
    else:
        least = (_ENOUGH[data.table.dim] * unresolved(data)) ** 2
    prices: Prices | None = None
    last: _Direction | None = None
    for number in range(_MOST):
        if not square > least:
            return number
        if number % _RENEWED == 0 and price is not None:
            penalty, last = price(), None
            prices = None if penalty is None else sweeper.prices(penalty)
        last, gain, change = _step(sweeper, kind, prices, last)
        square += change
        if not gain > (_GAIN if square < _FAR**2 * least else _GAIN_FAR) * square:
            return number + 1
    return _MOST


def _step(
    sweeper: PatchSmoother, kind: PatchKind, prices: Prices | None, last: _Direction | None
) -> tuple[_Direction | None, float, float]:
    """The direction, by how much misfit and price fall, and how the misfit alone changes."""
    moments, slopes = sweeper.moments.copy(), sweeper.slopes.copy()
    sweeper.sweep(kind, prices)
    change, bent = sweeper.moments - moments, sweeper.slopes - slopes
    paid = _Paid(prices, moments)
    own, falls, *along = _works(sweeper.data, change, [bent, slopes, *([] if last is None else [last.slopes])])
    if last is not None:
        part = (along[0] + paid.both(last.moments, change)) / last.square
        own += part * (part * last.own - 2.0 * along[0])
        falls += part * paid.slope(last.moments)  # misfit and price have no slope along the last direction
        change -= part * last.moments
        bent -= part * last.slopes
    square = own + paid.both(change, change)
    if not square > 0.0:
        return None, 0.0, 0.0
    size = -(falls + paid.slope(change)) / square
    sweeper.move(moments + size * change, slopes + size * bent)
    return _Direction(change, bent, square, own), size * size * square, size * (2.0 * falls + size * own)


@dataclass(frozen=True, eq=False)
class _Paid:
    """What changes of moments cost on the contact facets, where these have a price."""

    prices: Prices | None
    moments: Array  # (F, k, d)

    def both(self, one: Array, two: Array) -> float:
        """``m . P n``."""
        return 0.0 if self.prices is None else self.prices.work(one, self.prices.bent(two))

    def slope(self, change: Array) -> float:
        """Of the price at ``moments``."""
        return 0.0 if self.prices is None else self.prices.work(change, self.prices.slope(self.moments))


def _works(data: BodyData, moments: Array, slopes: list[Array]) -> list[float]:
    """``sum m . b`` over the cells for moments (F, k, d) and each of some slopes (M, n) by them."""
    table, total = data.table, np.zeros(len(slopes))
    for start in range(0, len(table.cells), _CELLS):
        part = slice(start, start + _CELLS)
        own = table.of_cells(moments, part)
        turned = (own.reshape(len(own), -1, table.dim) @ table.inverse[part].transpose(0, 2, 1)).reshape(len(own), -1)
        total += [np.vdot(turned, each[part]) for each in slopes]
    return [float(each) for each in total]


def unresolved(data: BodyData) -> float:
    """About the size of the error of linear elements, in the energy norm, by the bubbles ``l_a l_b`` of edges inside.

    Of their ``r(v)^2 / a(v, v)``, with the r of the displacement and v in all directions of a bubble, the sum.
    """
    known = vars(data)
    if "unresolved" not in known:
        known["unresolved"] = _unresolved(data)
    return float(known["unresolved"])


def _unresolved(data: BodyData) -> float:
    table, dim = data.table, data.table.dim
    compiled = bubble_square(data, cell_patches(table, PatchKind.EDGE), np.array(_ENDS[dim]))
    if compiled is not None:
        return float(np.sqrt(compiled))
    edges = cell_patches(table, PatchKind.EDGE).T
    count = int(edges.max()) + 1
    pairs = [(a, b) for a in range(dim) for b in range(a, dim)]
    residual, square = np.zeros((dim, count)), np.zeros((len(pairs), count))
    stiffness, index = np.linalg.inv(data.compliance), voigt_index(dim)
    tensor = stiffness[:, index[:, :, None, None], index]  # C_ikjl
    alike = len(tensor) == 1
    if not alike:
        square, pairs = np.zeros((dim * dim, count)), list(np.ndindex(dim, dim))
        wide = np.ascontiguousarray(tensor.transpose(0, 1, 3, 2, 4)).reshape(len(tensor), dim * dim, dim * dim)
    gradients = np.ascontiguousarray(table.gradients.transpose(1, 2, 0))  # cells last
    stress = np.ascontiguousarray(data.stress.transpose(1, 2, 0)) * (table.volumes / (dim + 1))
    load = data.loads.sum(axis=1).T / ((dim + 1) * (dim + 2))
    size = table.volumes / ((dim + 1) * (dim + 2))
    for edge, (one, two) in zip(edges, _ENDS[dim], strict=True):
        out = gradients[one] + gradients[two]
        for i in range(dim):
            residual[i] += np.bincount(edge, load[i] - sum(stress[i, j] * out[j] for j in range(dim)), count)
        three = (gradients[one], gradients[two], out)
        entries = [size * sum(each[i] * each[j] for each in three) for i, j in pairs]
        if not alike:
            entries = list((wide @ np.stack(entries, axis=1)[:, :, None])[:, :, 0].T)
        for row, each in zip(square, entries, strict=True):
            row += np.bincount(edge, each, count)
    matrix = np.empty((count, dim, dim))
    for row, (i, j) in zip(square, pairs, strict=True):
        matrix[:, i, j] = row
        if alike:
            matrix[:, j, i] = row
    if alike:
        wide = tensor[0].transpose(0, 2, 1, 3).reshape(dim * dim, dim * dim)
        matrix = (matrix.reshape(count, -1) @ wide.T).reshape(matrix.shape)
    inside = _inside(table, edges, count)
    right = residual.T[inside]
    solution = np.linalg.solve(matrix[inside], right[:, :, None])[:, :, 0]
    return float(np.sqrt(max(np.vdot(solution, right), 0.0)))


def _inside(table: FacetTable, edges: IntArray, count: int) -> BoolArray:
    """Which edges, given by those of cells (e, M), are inside of the body."""
    inside = np.bincount(edges.ravel(), minlength=count) > 0
    cell, opposite = np.nonzero(~table.interior[table.cell_facets])
    for edge, ends in zip(edges, _ENDS[table.dim], strict=True):
        inside[edge[cell[~np.isin(opposite, ends)]]] = False
    return inside
