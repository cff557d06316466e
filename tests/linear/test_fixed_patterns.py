"""How algebraic levels follow contact points: products on fixed patterns against products of whole matrices."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp

import hemivar as hv
from hemivar.kernels import kernels
from hemivar.kernels.library import Kernels
from hemivar.linear import fixed_patterns
from hemivar.linear.levels import Levels
from hemivar.linear.truncated_level import TruncatedLevel
from hemivar.systems.body_on_levels import levels_of


@pytest.fixture(scope="module")
def levels() -> Levels:
    touch = {"bottom": hv.Contact(hv.Signorini(), hv.Tresca(0.1))}
    stated = hv.ContactProblem(hv.box(cells=(12, 12, 9)), hv.Material.lame(4.0, 4.0), touch, {"left": hv.Clamped()})
    return levels_of(hv.discretize(stated), hv.systems.Workspace()).levels


def expected(levels: Levels, held: np.ndarray, added: np.ndarray) -> list[sp.csr_array]:
    """Galerkin products of what is changed, from the finest algebraic level down."""
    change = levels.coarse_change.of(held, levels.levels[levels.algebraic].coupling.matrix(added))
    found = []
    for k in range(levels.algebraic - 1, -1, -1):
        level = TruncatedLevel(levels.levels[k])
        level.shift(change)
        found.append(level.matrix)
        if k:
            P = levels.transfers[k - 1].prolongation
            change = sp.csr_array(P.T @ change @ P)
    return found


@pytest.mark.skipif(kernels() is None, reason="the compiled kernels are not there")
@pytest.mark.parametrize("dense", [0.0, np.inf])
@pytest.mark.parametrize("part", [0.0, 0.3, 1.0])
def test_levels_follow_as_by_whole_products(
    levels: Levels, part: float, dense: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert levels.algebraic >= 2
    assert levels.compiled is not None
    monkeypatch.setattr(fixed_patterns, "_DENSE", dense)
    transfers = [one.prolongation for one in levels.transfers[: levels.algebraic]]
    change = fixed_patterns.FixedChange(levels.compiled.kernels, levels.levels[: levels.algebraic + 1], transfers)
    top, rng = levels.levels[levels.algebraic], np.random.default_rng(2)
    held = rng.random(top.contact.size) < part
    free = ~held[top.coupling.rows] & ~held[top.coupling.columns]
    added: Any = np.where(free, 3.0 * (top.coupling.rows == top.coupling.columns) + 0.5, 0.0)
    found = change.of(held, added)
    for k, numbers, matrix in zip(
        range(levels.algebraic - 1, -1, -1), found, expected(levels, held, added), strict=True
    ):
        known = levels.matrix(k)
        mine = sp.csr_array((numbers, known.indices, known.indptr), shape=known.shape)
        assert abs(mine - matrix).max() <= 1e-12 * abs(matrix).max()
        assert part == 0.0 or abs(matrix - known).max() > 1e-3 * abs(matrix).max()


@pytest.mark.skipif(kernels() is None, reason="the compiled kernels are not there")
def test_what_is_not_held_costs_nothing(levels: Levels, monkeypatch: pytest.MonkeyPatch) -> None:
    spent, product = 0, Kernels.add_product

    def counted(self: Kernels, left: sp.csr_array, right: sp.csr_array, *given: Any) -> None:
        nonlocal spent
        spent += int(np.diff(right.indptr)[left.indices[left.data != 0.0]].sum())
        product(self, left, right, *given)

    costs, top, change = [], levels.levels[levels.algebraic], levels.fixed_change
    assert change is not None
    monkeypatch.setattr(Kernels, "add_product", counted)
    for part in (0.1, 1.0):
        spent = 0
        change.of(np.arange(top.contact.size) < part * top.contact.size, np.zeros(top.coupling.keys.size))
        costs.append(spent)
    assert 0 < costs[0] <= 0.15 * costs[1]


@pytest.mark.skipif(kernels() is None, reason="the compiled kernels are not there")
def test_a_product_refuses_what_it_has_no_place_for() -> None:
    library = kernels()
    assert library is not None
    one = sp.csr_array(np.ones((3, 3)))
    one.indices, one.indptr = one.indices.astype(np.int32), one.indptr.astype(np.int32)
    few = np.arange(4, dtype=np.int32), np.arange(3, dtype=np.int32), np.zeros(3)
    with pytest.raises(ValueError, match="cannot hold"):
        library.add_product(one, one, few, 3)
    with pytest.raises(ValueError, match="must have 3 columns"):
        library.add_product(one, one, few, 4)
    with pytest.raises(ValueError, match="int32"):
        library.add_product(one, one, (few[0].astype(np.int64), *few[1:]), 3)
