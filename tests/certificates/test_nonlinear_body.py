"""Certificates of bodies that are not linear, against closed forms and dense matrices."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
import pytest
import scipy.linalg as la
from scipy.optimize import brentq

from hemivar.basics.types import Array, BoolArray
from hemivar.certificates import Certificate, EnergyNorm, certify
from hemivar.certificates.kind import kind_of
from hemivar.certificates.linear_bodies import at_tangent
from hemivar.certificates.norms import energy_norm
from hemivar.discrete import DiscreteProblem
from hemivar.discrete.point_kind import PointKind
from hemivar.fem import discretize
from hemivar.fem.assembly import stiffness_matrix
from hemivar.laws import Compliance, Softening, Superpotential, Tresca
from hemivar.mechanics import (
    Clamped,
    Contact,
    ContactProblem,
    Material,
    PowerLaw,
    Prescribed,
    Roller,
    ScalarContact,
    ScalarProblem,
)
from hemivar.mechanics.material_words import BoundsBy
from hemivar.mechanics.named_energies import Hencky
from hemivar.mesh import rectangle
from hemivar.solvers import solve
from tests import bodies

BULK, SHEAR, SOFTENED, STRAIN = 20.0 / 3.0, 4.0, 0.25, 0.05
HENCKY = Material.hencky(BULK, SHEAR, SOFTENED, STRAIN)
#: C_low of it, in closed form.
BELOW = Material.lame(BULK - 2.0 * SOFTENED * SHEAR / 3.0, SOFTENED * SHEAR)
#: Its alpha is 1.
SOFT = Softening(3.0, 0.02, 1.0)
#: Its alpha is 25, more than the body bears.
SNAP = Softening(40.0, 0.02, 25.0)


def hencky_square(n: int = 16, material: Material = HENCKY, law: Superpotential = SOFT) -> ContactProblem:
    return ContactProblem(
        mesh=rectangle((1.0, 1.0), n),
        material=material,
        contact={"bottom": Contact(law, Tresca(0.05))},
        supports={"left": Clamped()},
        tractions={"top": (0.05, -0.2)},
    )


def matrix(problem: DiscreteProblem, material: Material) -> Array:
    """The stiffness of a linear material over the unknowns."""
    field = problem.field
    assert field is not None
    return np.asarray((field.basis.T @ stiffness_matrix(field.mesh, material, field.order) @ field.basis).toarray())


def both_certificates(problem: DiscreteProblem, u: Array, lam: Array | None = None) -> list[Certificate]:
    """By factorisation and by multigrid."""
    return [certify(problem, u, lam), certify(problem, u, lam, factor=EnergyNorm.by_multigrid(problem))]


def test_the_margin_is_that_of_the_lower_tensor() -> None:
    solution = solve(hencky_square())
    problem = solution.problem
    weights = problem.contact.weights[:, None] * np.array([[1.0, 0.0]])
    trace = problem.contact.trace.toarray()
    top = la.eigvalsh(trace.T @ (weights.ravel()[:, None] * trace), matrix(problem, BELOW))[-1]
    exactly, nearly = both_certificates(problem, solution.unknowns, solution.multiplier)
    assert exactly.margin == pytest.approx(1.0 - top, rel=1e-7)
    assert 1.0 - top - 0.01 < nearly.margin <= 1.0 - top + 1e-9
    for found in (exactly, nearly):
        assert found.equilibrium_relative < 1e-11
        assert found.error_bound_relative < 1e-7
        assert found.unique is True
        assert found.kind is PointKind.UNIQUE_MINIMISER
        assert found.smallness.stiffness_by == "closed form"
        assert "not linear: norms are those of the lower bound of its stiffness, proved" in repr(found)
    assert exactly.smallness.m_A == pytest.approx(2.0 * SOFTENED * SHEAR, rel=1e-12)


@pytest.mark.parametrize("seed", range(6))
def test_no_error_bound_is_below_the_error(seed: int) -> None:
    """The distance to the solution, in the norm of the lower tensor, of what lies near to it and far away."""
    rng = np.random.default_rng(seed)
    solution = solve(hencky_square())
    problem, u = solution.problem, solution.unknowns
    off = rng.normal(size=u.shape) * 10.0 ** rng.uniform(-9.0, 0.0) * np.abs(u).max()
    error = float(np.sqrt(off @ matrix(problem, BELOW) @ off))
    for found in both_certificates(problem, u + off):
        assert error <= found.error_bound < np.inf
        assert not found.error_bound_sampled


def test_it_is_sharp_where_the_body_is_as_soft_as_its_bound() -> None:
    """Without softening the bound is that of the linear material, up to the rounding of the forces."""
    potential = hencky_square(material=Material.hencky(BULK, SHEAR, 1.0, STRAIN))
    linear = hencky_square(material=Material.lame(BULK - 2.0 * SHEAR / 3.0, SHEAR))
    u = solve(linear).unknowns
    u = u + 1e-3 * np.abs(u).max() * np.random.default_rng(1).normal(size=u.shape)
    for one, other in zip(
        both_certificates(discretize(potential), u), both_certificates(discretize(linear), u), strict=True
    ):
        assert one.margin == pytest.approx(other.margin, rel=1e-9)
        assert one.equilibrium == pytest.approx(other.equilibrium, rel=1e-9)
        # the search for a better pair, which linear bodies have, finds one
        assert other.error_bound <= one.error_bound * (1.0 + 1e-9)


def test_scalar_problems_have_certificates_too() -> None:
    """A membrane whose flux grows as a power of the gradient: its margin is that of the least derivative."""
    power = PowerLaw(1.5, 0.1, 2.0, 3.0)
    stated = ScalarProblem(
        rectangle((1.0, 1.0), 32),
        power,
        supports={"top": 0.8},
        contact={"bottom": ScalarContact(Softening(3.0, 0.1, 0.4))},
    )
    solution = solve(stated)
    problem = solution.problem
    linear = discretize(replace(stated, material=Material.gradient(power.least, stated.kind)))
    weighted = problem.contact.trace.T @ (0.4 * problem.contact.weights[:, None] * problem.contact.trace.toarray())
    top = la.eigvalsh(weighted, linear.stiffness.toarray())[-1]
    exactly, nearly = both_certificates(problem, solution.unknowns, solution.multiplier)
    assert 0.0 < exactly.margin == pytest.approx(1.0 - top, rel=1e-7)
    assert 1.0 - top - 0.01 < nearly.margin <= 1.0 - top + 1e-9
    for found in (exactly, nearly):
        assert found.kind is PointKind.UNIQUE_MINIMISER
        assert found.smallness.m_A == pytest.approx(power.least, rel=1e-12)
        assert "lower bound of its stiffness, as stated by its author" in repr(found)


# ---- the kind of a point --------------------------------------------------------------------------------------


def hencky_column(law: Superpotential, down: float) -> ContactProblem:
    """A block of height 1 that can only become lower, its top held at ``-down``."""
    return ContactProblem(
        mesh=rectangle((1.0, 1.0), 16),
        material=HENCKY,
        contact={"bottom": Contact(law)},
        supports={"left": Roller(), "right": Roller(), "top": Prescribed((0.0, -down))},
    )


def slopes(e: float) -> tuple[float, float]:
    """phi and its derivative by ``s = |dev eps|^2`` at a strain e along one axis of space."""
    s = 2.0 * e**2 / 3.0
    root = np.sqrt(1.0 + s / STRAIN**2)
    return 2.0 * SHEAR * (SOFTENED + (1.0 - SOFTENED) / root), -SHEAR * (1.0 - SOFTENED) / (STRAIN**2 * root**3)


def axial_stress(e: float) -> float:
    """Stress along that axis."""
    return BULK * e + slopes(e)[0] * 2.0 * e / 3.0


def tangent(e: float) -> Material:
    """The derivative of the stress at the strain e along y, in plane strain, as a linear material."""
    phi, slope = slopes(e)
    identity, dev = np.array([1.0, 1.0, 0.0]), e * np.array([-1.0, 2.0, 0.0]) / 3.0
    deviator = np.diag([1.0, 1.0, 0.5]) - np.outer(identity, identity) / 3.0
    return Material.tensor(BULK * np.outer(identity, identity) + phi * deviator + 2.0 * slope * np.outer(dev, dev))


def pressure(s: float) -> float:
    return 40.0 * s if s <= 0.02 else max(0.8 - 25.0 * (s - 0.02), 0.0)


@pytest.mark.parametrize(
    ("low", "high", "slope", "kind"),
    [
        (0.0, 0.02, 40.0, PointKind.LOCAL_MINIMISER),
        (0.02, 0.052, -25.0, PointKind.SADDLE),
        (0.06, 0.09, 0.0, PointKind.LOCAL_MINIMISER),
    ],
)
def test_of_three_solutions_the_one_between_is_none_that_stays(
    low: float, high: float, slope: float, kind: PointKind
) -> None:
    """The least curvature is that of the tangent at the solution, which dense matrices tell."""
    down = 0.08
    s = brentq(lambda s: axial_stress(down - s) - pressure(s), low, high, xtol=1e-15)
    problem = discretize(hencky_column(SNAP, down))
    field = problem.field
    assert field is not None
    nodal = np.column_stack([np.zeros(len(field.nodes)), -s + (s - down) * field.nodes[:, 1]])
    lam = np.zeros((problem.contact_points, 2))
    lam[:, 0] = pressure(s)
    u = field.restrict(nodal)
    K, trace = matrix(problem, tangent(s - down)), problem.contact.trace.toarray()[::2]
    curvature = la.eigvalsh(K + slope * trace.T @ (problem.contact.weights[:, None] * trace), K)[0]
    for found in both_certificates(problem, u, lam):
        assert found.residual.relative < 1e-10
        assert found.kind is kind
        assert not found.margin > 0.0
        assert found.unique is (False if kind is PointKind.SADDLE else None)
        if kind is PointKind.SADDLE:
            assert found.curvature == pytest.approx(curvature, rel=1e-3 if found.method == "multigrid" else 1e-8)


# ---- what is not proved -----------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Sampled(Hencky):
    """Its bounds are said to come from samples."""

    @property
    def bounds_by(self) -> BoundsBy:
        return BoundsBy.SAMPLED


@dataclass(frozen=True, eq=False)
class Unbounded(Hencky):
    """It has no lower bound that is known."""

    def lower_tensor(self, points: Array, regions: Mapping[str, BoolArray] | None = None) -> Array:
        return np.zeros((len(points), 3, 3))


@pytest.mark.parametrize("law", [SOFT, Compliance(3.0)])
def test_a_sampled_bound_claims_nothing(law: Superpotential) -> None:
    solution = solve(hencky_square(material=Sampled(BULK, SHEAR, SOFTENED, STRAIN), law=law))
    for found in both_certificates(solution.problem, solution.unknowns, solution.multiplier):
        assert found.margin > 0.0
        assert found.unique is None
        assert found.kind is PointKind.LOCAL_MINIMISER
        assert found.error_bound_sampled
        assert "sampled" in found.brief()
        assert "an estimate, from sampled constants" in repr(found)
        assert "known from samples only" in repr(found)
        assert found.record()["stiffness_by"] == "sampled"
        assert found.record()["error_bound_sampled"] is True


@pytest.mark.parametrize("law", [SOFT, Compliance(3.0)])
def test_without_a_lower_bound_there_is_neither_margin_nor_distance(law: Superpotential) -> None:
    solution = solve(hencky_square(material=Unbounded(BULK, SHEAR, SOFTENED, STRAIN), law=law))
    for found in both_certificates(solution.problem, solution.unknowns, solution.multiplier):
        assert found.stationary
        assert found.margin == -np.inf
        assert found.error_bound == np.inf
        assert found.unique is None
        assert found.kind is PointKind.LOCAL_MINIMISER
        assert "the stiffness of the body has no known lower bound at all strains" in repr(found)


def test_what_is_proved_for_some_strains_is_claimed_for_these() -> None:
    """Hencky's energy as a formula, whose bounds are proved by intervals up to a reach."""
    root = "(sqrt(1 + dev2/0.0025) - 1)"
    formula = f"{0.5 * BULK}*tr^2 + {SOFTENED * SHEAR}*dev2 + {2.0 * (1.0 - SOFTENED) * SHEAR * STRAIN**2}*{root}"
    solution = solve(hencky_square(material=HENCKY, law=Compliance(3.0)))
    for reach, known in ((5.0, True), (0.02, False)):
        problem = discretize(hencky_square(material=Material.potential(formula, reach=reach), law=Compliance(3.0)))
        for found in both_certificates(problem, solution.unknowns, solution.multiplier):
            assert found.stationary
            assert found.kind is PointKind.LOCAL_MINIMISER
            assert found.error_bound_sampled
            if known:
                assert found.unique == "the only one with strains within the reach 5"
                assert "an estimate, for strains within the reach 5 only" in repr(found)
            else:
                assert found.unique is None
                assert found.error_bound == np.inf
                assert "may lie outside of the reach 0.02 of the material" in repr(found)


def test_a_point_is_a_global_minimiser_only_where_the_body_is_proved_convex() -> None:
    for material, law in ((HENCKY, Compliance(3.0)), (Sampled(BULK, SHEAR, SOFTENED, STRAIN), Compliance(3.0))):
        solution = solve(hencky_square(4, material=material, law=law))
        problem = solution.problem
        kind = kind_of(problem, solution.unknowns, solution.multiplier, energy_norm(problem))
        assert kind is PointKind.LOCAL_MINIMISER


def test_units_do_not_matter() -> None:
    """Lengths in mm, stresses in Pa, for m and MPa."""
    one = solve(hencky_square(4))
    other = replace(
        hencky_square(4, Material.hencky(1e6 * BULK, 1e6 * SHEAR, SOFTENED, STRAIN), Softening(3e3, 20.0, 1e3)),
        mesh=rectangle((1e3, 1e3), 4),
        contact={"bottom": Contact(Softening(3e3, 20.0, 1e3), Tresca(0.05e6))},
        tractions={"top": (0.05e6, -0.2e6)},
    )
    first, second = one.certify(), solve(other).certify()
    assert second.margin == pytest.approx(first.margin, rel=1e-9)
    assert second.kind is first.kind


def test_the_body_at_the_tangent_has_the_forces_and_the_stiffness_of_its_own() -> None:
    material = Material.potential("tr^2 + 0.1*tr^4 + dev2 + 0.3*dev2^2", reach=1.0)
    problem = discretize(bodies.square(Compliance(3.0), 2, body_force=(0.3, -0.4), material=material))
    rng = np.random.default_rng(0)
    u, way = (0.05 * rng.normal(size=problem.unknowns) for _ in range(2))
    tangent = at_tangent(problem, u)
    np.testing.assert_allclose(tangent.out_of_balance(u), problem.out_of_balance(u), atol=1e-14)
    change = (problem.out_of_balance(u + 1e-6 * way) - problem.out_of_balance(u - 1e-6 * way)) / 2e-6
    np.testing.assert_allclose(tangent.out_of_balance(u + way) - tangent.out_of_balance(u), change, atol=1e-8)
