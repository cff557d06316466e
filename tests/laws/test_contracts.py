"""The contracts of laws are as wide as their idea: few members, of which a law of one's own writes at most six."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from hemivar.basics.types import Array, IntArray
from hemivar.laws import Superpotential, VectorLaw
from hemivar.laws.proof import Evidence
from hemivar.laws.testing import check_law


@pytest.mark.parametrize(("contract", "members"), [(Superpotential, 42), (VectorLaw, 52)])
def test_contracts_have_no_more_members(contract: type, members: int) -> None:
    """A member more is a question to every law: what follows from other answers is a function beside the class."""
    stated = {name for name in (*vars(contract), *contract.__annotations__) if not name.startswith("_")}
    assert len(stated) <= members, sorted(stated)
    assert len(contract.__abstractmethods__) <= 6, sorted(contract.__abstractmethods__)  # type: ignore[attr-defined]


@dataclass(frozen=True, eq=False)
class Springs(Superpotential):
    """Linear springs that act in penetration, ``j(r) = stiffness/2 max(r, 0)^2``: six answers."""

    stiffness: Array  # (m,)

    @property
    def knots(self) -> Array:
        return np.zeros((len(self.stiffness), 1))

    def piece_value(self, piece: IntArray, r: Array) -> Array:
        return 0.5 * self.piece_curvature(piece, r) * r**2

    def piece_derivative(self, piece: IntArray, r: Array) -> Array:
        return self.piece_curvature(piece, r) * r

    def piece_curvature(self, piece: IntArray, r: Array) -> Array:
        return np.where(piece > 0, self.stiffness, 0.0)

    @property
    def weak_convexity(self) -> Array:
        return np.zeros(1)

    def recession(self, sign: Array) -> Array:
        return np.where(sign > 0.0, np.inf, 0.0)


def test_a_law_of_six_answers_is_one() -> None:
    law = Springs(np.array([2.0, 5.0]))
    check_law(law)
    assert law.proof("alpha").evidence is Evidence.STATED
    assert law.proof("alpha").sure
    np.testing.assert_allclose(law.prox(np.array([3.0, 6.0]), 1.0), [1.0, 1.0])
    assert law.take(np.array([1])).derivative(np.array([2.0])) == pytest.approx(10.0)
    assert law.scaled(3.0).at(None).derivative(np.array([1.0, 1.0])) == pytest.approx([6.0, 15.0])
    assert np.isinf(law.growth[0]).all()
