"""Parts of methods whose faults the answers do not show: they would cost steps, or a tolerance."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import pytest
import scipy.sparse as sp

import hemivar as hv
from hemivar.basics.types import Array
from hemivar.linear import definite
from hemivar.linear.vectors import WHOLE
from hemivar.solvers import SemismoothNewton
from hemivar.solvers.controls import Budget
from hemivar.solvers.proximal_newton import _Line, _state
from hemivar.systems.contact_stiffness import ContactStiffness
from hemivar.systems.nonlinear_body import NonlinearBody
from hemivar.systems.workspace import Workspace
from tests import bodies


def nonlinear(energy: str, pull: float = -0.4) -> NonlinearBody:
    material = hv.Material.potential(energy, reach=10.0)
    block = bodies.square(hv.Compliance(3.0), 2, body_force=(0.3, pull), material=material)
    return NonlinearBody.of(hv.discretize(block), Workspace())


@pytest.mark.parametrize("length", [1.0, 0.5, 0.125])
def test_the_model_of_a_body_that_is_linear_is_its_energy(length: float) -> None:
    body = nonlinear("tr^2 + dev2")
    rng = np.random.default_rng(0)
    x, way = (0.1 * rng.normal(size=body.load.size) for _ in range(2))
    force = body.out_of_balance(x)
    line = _Line.of(body, _state(body, x, 0, force), way, body.tangent_at(x, force))
    new = x + length * way
    contact = float(body.weights @ body.law.value(body.local(new)))
    assert line.fall(length, contact) == pytest.approx(body.energy(new) - body.energy(x), rel=1e-10)


def test_rounding_of_a_nonlinear_body_is_that_of_its_stiffness_and_load() -> None:
    body = nonlinear("tr^2 + dev2 + 0.1*dev2^2")
    x = np.random.default_rng(0).normal(size=body.load.size)
    K = np.abs(body.problem.with_(bulk=body.at_rest).stiffness.toarray())
    np.testing.assert_allclose(body.rounding_sizes(x), K.sum(axis=1) * np.abs(x) + np.abs(body.load), rtol=1e-12)
    np.testing.assert_allclose(body.rounding_sizes(0.0 * x), np.abs(body.load), rtol=1e-12)


@dataclass
class Bound:
    """An equation whose bound is raised: where each part began, and parts that fail."""

    failing: float
    tried: list[tuple[float, float]] = field(default_factory=list)
    part: float = 1.0

    def times(self, part: float) -> Bound:
        return Bound(self.failing, self.tried, part)


def test_a_bound_is_raised_from_the_last_point_that_was_found(monkeypatch: pytest.MonkeyPatch) -> None:
    @dataclass
    class Place:
        x: float

    def solved(self: object, equation: Bound, x: float, budget: Budget) -> Place | None:
        """The point of each part, from near by only."""
        equation.tried.append((equation.part, x))
        return Place(equation.part) if equation.part - x <= equation.failing else None

    monkeypatch.setattr(SemismoothNewton, "_solved", solved)
    bound = Bound(failing=0.3)
    found = SemismoothNewton()._raised(bound, 0.0, Budget(np.inf))  # type: ignore[arg-type]
    assert found is not None
    assert found.x == 1.0
    assert all(x in (0.0, *(part for part, _ in bound.tried[:i])) for i, (_, x) in enumerate(bound.tried))
    assert bound.tried[-1][1] >= 0.7


class Block(ContactStiffness):
    """Two contact points in space, and nothing else."""

    def __init__(self, K: Array) -> None:
        super().__init__(WHOLE, np.arange(6), np.ones(6), np.ones((2, 3), dtype=bool))
        self.K = K

    def multiply(self, x: Array) -> Array:
        return np.asarray(self.K @ x)

    def pull(self, x: Array) -> Array:
        return self.multiply(x)

    def push(self, values: Array) -> Array:
        return self.multiply(values)

    def between_contacts(self) -> sp.csr_array:
        return sp.csr_array(self.K)


def test_one_stiffness_of_each_point_is_that_of_its_stiffer_side() -> None:
    """A step of the slip vector takes one number, and must not be longer than the stiffer of its components allows."""
    block = Block(np.diag([5.0, 1.0, 2.0, 7.0, 4.0, 3.0]))
    np.testing.assert_array_equal(block.diagonal, [[5.0, 2.0, 2.0], [7.0, 4.0, 4.0]])


def test_a_singular_matrix_costs_its_factorisation_only(monkeypatch: pytest.MonkeyPatch) -> None:
    """A chain that nothing holds: zero is an eigenvalue, and what rounding makes of it needs no iteration."""

    def refused(*given: object, **more: object) -> None:
        raise AssertionError("eigenvalues were looked for")

    n = 600
    chain = sp.csr_array(
        sp.diags_array([-np.ones(n - 1), np.r_[1.0, 2.0 * np.ones(n - 2), 1.0], -np.ones(n - 1)], offsets=[-1, 0, 1])
    )
    for name in ("lowest_quotient", "quotient"):
        monkeypatch.setattr(definite, name, refused)
    assert definite.indefinite(chain) is None
