"""The energy of a body that is not linear: derivatives, linear materials as potentials, and what is made of it."""

from __future__ import annotations

import dataclasses
import pickle

import numpy as np
import pytest

import hemivar as hv
from hemivar.basics.types import Array
from hemivar.discrete import DiscreteProblem
from hemivar.discrete.potential import Potential
from hemivar.fem import discretize
from hemivar.fem.fields import stress, von_mises
from hemivar.mechanics.material import Material
from tests.bodies import BULK, LEFT, SHEAR, SIZE, hencky

KINDS = [(2, 1, "strain"), (2, 1, "stress"), (2, 2, "strain"), (2, 2, "stress"), (3, 1, "strain")]


def statement(material: Material, dim: int, order: int = 1, cells: int = 3, **more: object) -> hv.ContactProblem:
    """A body whose top is moved askew, on springs."""
    mesh = hv.rectangle((1.0, 1.0), cells) if dim == 2 else hv.box((1.0, 1.0, 1.0), cells)
    return hv.ContactProblem(
        mesh,
        material,
        supports={"top": hv.Prescribed((0.03, *(0.02,) * (dim - 2), -0.1))},
        contact={"bottom": hv.Contact(hv.Compliance(5.0))},
        body_force=tuple(0.1 * np.arange(dim)),
        order=order,
        **more,  # type: ignore[arg-type]
    )


def somewhere(problem: DiscreteProblem, seed: int = 0) -> Array:
    return 0.05 * np.random.default_rng(seed).normal(size=problem.unknowns)


@pytest.mark.parametrize(("dim", "order", "plane"), KINDS)
def test_a_linear_material_as_a_potential(dim: int, order: int, plane: str) -> None:
    """Same energy, forces and stiffness of a displacement, entry by entry."""
    linear = discretize(statement(Material.lame(4.0, 4.0, plane), dim, order))
    other = discretize(statement(hencky(1.0, plane=plane), dim, order))
    u = somewhere(linear)
    v = u - other.field.origin
    np.testing.assert_allclose(other.field.full(v), linear.field.full(u), atol=1e-13)
    np.testing.assert_allclose(other.local(v), linear.local(u), atol=1e-13)
    assert other.energy(v) == pytest.approx(linear.energy(u), rel=1e-12)
    np.testing.assert_allclose(other.out_of_balance(v), linear.out_of_balance(u), atol=1e-11)
    stiffness = other.bulk.hessian(u)
    np.testing.assert_array_equal(stiffness.indices, linear.stiffness.indices)
    np.testing.assert_allclose(stiffness.data, linear.stiffness.data, atol=1e-11)
    assert isinstance(other.bulk, Potential)
    assert other.bulk.lower is not None
    for bound in (other.bulk.lower, other.bulk.upper):
        np.testing.assert_allclose(bound.stiffness.data, linear.stiffness.data, atol=1e-11)


@pytest.mark.parametrize(("dim", "order", "plane"), KINDS)
def test_forces_and_stiffness_are_derivatives(dim: int, order: int, plane: str) -> None:
    bulk = discretize(statement(hencky(plane=plane), dim, order, bedding=3.0)).bulk
    assert isinstance(bulk, Potential)
    random, h = np.random.default_rng(1), 1e-5
    u, v = 0.05 * random.normal(size=(2, bulk.unknowns))
    slope = (bulk.value(u + h * v) - bulk.value(u - h * v)) / (2.0 * h)
    assert bulk.gradient(u) @ v == pytest.approx(slope, rel=1e-7)
    bent = (bulk.gradient(u + h * v) - bulk.gradient(u - h * v)) / (2.0 * h)
    np.testing.assert_allclose(bulk.hessian(u) @ v, bent, rtol=1e-6, atol=1e-6 * np.abs(bent).max())
    nothing = np.zeros(bulk.unknowns)
    assert bulk.value(nothing) == 0.0
    np.testing.assert_array_equal(bulk.gradient(nothing), 0.0)
    assert bulk.lower is not None
    work, least, most = v @ bent, bulk.lower.gradient(v) @ v, bulk.upper.gradient(v) @ v
    assert least < work < most


def test_the_energy_of_a_homogeneous_strain() -> None:
    """Of uniaxial strain e: W = k e^2/2 + mu0 (q s + 2 (1 - q) e0^2 (sqrt(1 + s/e0^2) - 1)), s = 2 e^2/3."""
    mesh = hv.rectangle((2.0, 1.0), 3)
    supports = {"top": hv.Fixed(y=-0.1), "left": hv.Roller(), "right": hv.Roller(), "bottom": hv.Roller()}
    problem = discretize(hv.ContactProblem(mesh, hencky(), supports=supports))
    u = hv.solve(problem).unknowns
    s = 2.0 * 0.1**2 / 3.0
    shape = LEFT * s + 2.0 * (1.0 - LEFT) * SIZE**2 * (np.sqrt(1.0 + s / SIZE**2) - 1.0)
    assert problem.energy(u) == pytest.approx(2.0 * (BULK * 0.1**2 / 2.0 + SHEAR * shape), rel=1e-13)


def test_the_stress_is_that_of_the_material() -> None:
    """Of uniaxial strain e in plane strain: stress across k e - phi e / 3, von Mises' phi |e|, phi = F_s."""
    problem = statement(hencky(), 2)
    e = -0.08
    displacement = problem.mesh.points * np.array([0.0, e])
    phi = 2.0 * SHEAR * (LEFT + (1.0 - LEFT) / np.sqrt(1.0 + 2.0 * e**2 / 3.0 / SIZE**2))
    expected = np.diag([BULK * e - phi * e / 3.0, BULK * e + 2.0 * phi * e / 3.0])
    np.testing.assert_allclose(stress(problem, displacement), np.broadcast_to(expected, (18, 2, 2)), atol=1e-13)
    np.testing.assert_allclose(von_mises(problem, displacement), phi * abs(e), rtol=1e-12)


def test_regions_that_are_linear_and_others() -> None:
    """The energy and the forces of a body of two materials are those of its parts."""
    mesh = hv.rectangle((1.0, 1.0), 4)
    high = mesh.points[mesh.cells].mean(axis=1)[:, 1] > 0.5
    mesh = dataclasses.replace(mesh, regions={"high": np.flatnonzero(high), "low": np.flatnonzero(~high)})
    soft, stiff, none = hencky(), Material.lame(8.0, 8.0), Material.lame(1e-12, 1e-12)

    def of(low: Material, top: Material) -> tuple[float, Array]:
        body = discretize(
            hv.ContactProblem(
                mesh,
                Material.by_region({"low": low, "high": top}),
                supports={"top": hv.Clamped()},
                contact={"bottom": hv.Contact(hv.Compliance(1.0))},
            )
        ).bulk
        u = 0.05 * np.random.default_rng(3).normal(size=body.unknowns)
        return body.value(u), body.gradient(u)

    whole, parts = of(soft, stiff), (of(soft, none), of(none, stiff))
    assert whole[0] == pytest.approx(parts[0][0] + parts[1][0], rel=1e-10)
    np.testing.assert_allclose(whole[1], parts[0][1] + parts[1][1], atol=1e-10)


def test_it_travels() -> None:
    problem = discretize(statement(hencky(), 2))
    again = pickle.loads(pickle.dumps(problem))
    u = somewhere(problem)
    assert again.energy(u) == problem.energy(u)
    assert repr(problem.bulk) == f"Potential({problem.unknowns} unknowns)"
