"""Orthotropic friction: its ellipse by brute force, closed forms of a sheared block, what takes and what refuses it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

import hemivar as hv
from hemivar.basics.types import Array
from hemivar.laws import (
    Adhesive,
    Compliance,
    ContactLaw,
    Coulomb,
    CoulombBound,
    Friction,
    OrthotropicFriction,
    OrthotropicLaw,
    PenetrationBound,
    Signorini,
    Tresca,
)
from hemivar.laws.testing import check_vector_law
from hemivar.laws.vector_law import prox_jacobian, pulls
from tests.samples import slow

YOUNG, FOUNDATION, PUSH = 200.0, 50.0, 0.01
SHEAR, DEPTH = 0.5 * YOUNG, YOUNG * PUSH / (YOUNG + FOUNDATION)
PRESSURE = FOUNDATION * DEPTH
AXIS = np.array([0.6, 0.8, 0.0])


def law(bound: float = 0.4, ratio: float = 2.5, angle: float = 0.6) -> OrthotropicLaw:
    heading = np.array([[np.cos(angle), np.sin(angle)]])
    return replace(
        OrthotropicLaw(Adhesive(5.0, 1.0, 2.0), OrthotropicFriction(bound, ratio=ratio)).at(None), heading=heading
    )


@pytest.mark.parametrize("ratio", [1e-2, 0.4, 1.0, 3.0])
def test_the_law_passes_the_kit(ratio: float) -> None:
    check_vector_law(law(ratio=ratio), reach=1.5, components=3)


def test_projections_on_ellipses_are_the_nearest_points() -> None:
    """The rest is normal to the ellipse at the point and leads outward: with convexity that is the nearest point."""
    random = np.random.default_rng(3)
    for _ in range(2000):
        bound, ratio = 10.0 ** random.uniform(-6.0, 6.0), 10.0 ** random.uniform(-3.0, 3.0)
        angle = random.uniform(0.0, 2.0 * np.pi)
        one, half = law(bound, ratio, angle), bound * np.array([1.0, ratio])
        turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
        z = random.normal(size=(1, 2)) * half.max() * 10.0 ** random.uniform(-3.0, 3.0)
        p, own = turn @ one.project(z)[0], turn @ z[0]
        gauge = float(np.hypot(*(own / half)))
        if gauge <= 1.0:
            assert p == pytest.approx(own, rel=1e-12)
            continue
        assert float(np.hypot(*(p / half))) == pytest.approx(1.0, rel=1e-10)
        rest, outward = own - p, p / half**2
        sine = rest[0] * outward[1] - rest[1] * outward[0]
        assert abs(sine) <= 1e-8 * np.linalg.norm(rest) * np.linalg.norm(outward)
        assert rest @ outward >= 0.0


@pytest.mark.parametrize("laws", [10, slow(100)])
def test_local_problems_against_a_grid(laws: int) -> None:
    random = np.random.default_rng(4)
    turns = np.linspace(0.0, 2.0 * np.pi, 721)
    for _ in range(laws):
        one = law(10.0 ** random.uniform(-1.0, 1.0), 10.0 ** random.uniform(-1.0, 1.0), random.uniform(0.0, 6.0))
        a, b = 10.0 ** random.uniform(-1.0, 1.0, (1, 2)) + 2.0, random.normal(size=(1, 3)) * 3.0
        found = one.local_argmin(a, b)[0]
        sizes = np.linspace(0.0, 2.0 * np.linalg.norm(b) / a[0, 1], 400)
        slips = (sizes[:, None, None] * np.stack([np.cos(turns), np.sin(turns)], axis=1)).reshape(-1, 2)

        def energy(s: Array, one: OrthotropicLaw = one, a: Array = a, b: Array = b, w: float = found[0]) -> Array:
            r = np.column_stack([np.full(len(s), w), s])
            return np.asarray(0.5 * a[0, 1] * (s**2).sum(axis=1) - s @ b[0, 1:] + one.value(r))

        assert energy(found[None, 1:])[0] <= energy(slips).min() + 1e-12


def test_a_ratio_of_one_is_friction_without_direction() -> None:
    random = np.random.default_rng(5)
    mine, plain = law(0.7, 1.0), ContactLaw(Adhesive(5.0, 1.0, 2.0), Tresca(0.7)).at(None)
    r, lam = random.normal(size=(50, 3)), random.normal(size=(50, 3))
    r[:10, 1:] = 0.0
    tau = 10.0 ** random.uniform(-1.0, 0.0, (50, 2))
    for name, given in (
        ("value", (r,)), ("distance", (r, lam)), ("graph_distance", (r, lam, tau)), ("recession", (r,)),
        ("local_argmin", (1.0 / tau + 3.0, lam)),
        ("nearest_multiplier", (r, lam)), ("local_minimiser", (1.0 / tau + 3.0, lam, r)),
        ("admissible", (r,)), ("resistance", (r, lam)), ("clamp", (r, lam)),
    ):  # fmt: skip
        assert getattr(mine, name)(*given) == pytest.approx(getattr(plain, name)(*given), abs=1e-12), name
    turned = [prox_jacobian(law, r, tau / 3.0) for law in (mine, plain)]
    np.testing.assert_allclose(*turned, atol=1e-12)
    np.testing.assert_array_equal(pulls(mine, r), pulls(plain, r))
    lines = mine.linearise(r), plain.linearise(r)
    for part in ("smooth", "gradient", "hessian"):
        assert getattr(lines[0], part) == pytest.approx(getattr(lines[1], part), abs=1e-12)


# ---- a sheared block --------------------------------------------------------------------------------------------


def sheared_cube(shift: Array, friction: Friction) -> hv.ContactProblem:
    """A cube of Poisson's ratio 0 whose top is pushed down and aside, and whose sides let it shear uniformly."""

    def down(x: Array) -> Array:
        return -(DEPTH + (PUSH - DEPTH) * x[:, 2])

    return hv.ContactProblem(
        hv.box((1.0, 1.0, 1.0), (2, 2, 2)),
        hv.Material.young(YOUNG, 0.0),
        {"bottom": hv.Contact(Compliance(FOUNDATION), friction)},
        {"top": hv.Prescribed((*shift, -PUSH))} | dict.fromkeys(("left", "right", "front", "back"), hv.Fixed(z=down)),
    )


def sliding(angle: float, ratio: float, length: float = 0.002) -> tuple[Array, Array]:
    """A slip of the bottom in a direction, and the shift of the top that brings it about."""
    across = np.array([-AXIS[1], AXIS[0]])
    s = length * (np.cos(angle) * AXIS[:2] + np.sin(angle) * across)
    parts = np.array([s @ AXIS[:2], ratio * s @ across])
    force = 0.3 * PRESSURE * (parts[0] * AXIS[:2] + ratio * parts[1] * across) / np.hypot(*parts)
    return s, s + force / SHEAR


@pytest.mark.parametrize("angle", [0.0, 0.5, 1.5, 4.0])
@pytest.mark.parametrize("bound", [0.3 * PRESSURE, CoulombBound(0.3)], ids=["tresca", "coulomb"])
def test_a_block_slides_as_the_ellipse_says(bound: object, angle: float) -> None:
    slip, shift = sliding(angle, 0.4)
    friction = OrthotropicFriction(bound, ratio=0.4, axis=2.0 * AXIS)  # type: ignore[arg-type]
    solution = hv.solve(sheared_cube(shift, friction))
    assert solution.status.name == "CONVERGED"
    bottom = solution.displacement[hv.box((1.0, 1.0, 1.0), (2, 2, 2)).points[:, 2] == 0.0]
    assert bottom[:, :2] == pytest.approx(np.tile(slip, (len(bottom), 1)), rel=1e-6, abs=1e-9)
    assert set(solution.states.names[1]) == {"slip"}
    held = hv.solve(sheared_cube(0.99 * (shift - slip), friction))
    assert set(held.states.names[1]) == {"stick"}
    moved = held.displacement[hv.box((1.0, 1.0, 1.0), (2, 2, 2)).points[:, 2] == 0.0]
    assert np.abs(moved[:, :2]).max() <= 1e-9


def test_methods_agree_and_the_minimum_is_the_only_one() -> None:
    problem = hv.ContactProblem(
        hv.box((1.0, 1.0, 0.5), (4, 4, 2)),
        hv.Material.young(200.0, 0.3),
        {"bottom": hv.Contact(Signorini(), OrthotropicFriction(1.5, ratio=0.3, axis=(1.0, 1.0, 0.0)))},
        {"left": hv.Clamped()},
        tractions={"top": (0.5, 0.3, -3.0)},
    )
    newton = hv.solve(problem, hv.solvers.NonsmoothNewton())
    assert set(newton.states.names[1]) == {"stick", "slip"}
    other = hv.solve(problem, hv.solvers.NonsmoothMultigrid())
    assert other.status.name == "CONVERGED"
    assert other.energy == pytest.approx(newton.energy, rel=1e-9)
    found = hv.certify(newton)
    assert found.kind.name == "UNIQUE_MINIMISER"
    assert found.unique is True
    assert hv.certificates.smallness(newton.problem).margin == pytest.approx(1.0)
    plain = hv.solve(replace(problem, contact={"bottom": hv.Contact(Signorini(), Tresca(1.5))}))
    assert plain.energy > newton.energy  # more friction stores more


def test_coulombs_law_in_an_ellipse_is_certified_as_far_as_coulombs_law_is() -> None:
    _, shift = sliding(0.5, 0.4)
    found = hv.certify(hv.solve(sheared_cube(shift, OrthotropicFriction(CoulombBound(0.3), ratio=0.4, axis=AXIS))))  # type: ignore[arg-type]
    plain = hv.certify(hv.solve(sheared_cube(shift, Coulomb(0.3))))
    assert found.unique is not True
    assert found.kind is plain.kind
    bound = PenetrationBound((np.array([0.0, 1.0]), np.array([0.0, 20.0])))
    wide = sheared_cube(shift, OrthotropicFriction(bound, ratio=3.0))
    narrow = sheared_cube(shift, Friction(bound))
    margins = [hv.certificates.smallness(hv.discretize(one)).margin for one in (wide, narrow)]
    assert 1.0 - margins[0] == pytest.approx(3.0 * (1.0 - margins[1]), rel=1e-6)


def test_sides_of_many_points_are_those_of_each() -> None:
    """Some on the move, some at rest, with axes of their own."""
    random = np.random.default_rng(3)
    angle = random.uniform(0.0, 6.0, 9)
    heading = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    many = OrthotropicLaw(Adhesive(5.0, 1.0, 2.0), OrthotropicFriction(0.4, ratio=random.uniform(0.3, 3.0, 9)), heading)
    r, lam = random.normal(size=(2, 9, 3))
    r[[0, 4, 5], 1:] = 0.0
    active, tau = np.ones((9, 3), dtype=bool), np.ones((9, 2))
    found = many.sides(r, lam, active, tau, 0.0)
    for k in range(9):
        one = np.array([k])
        for there, alone in zip(
            found, many.take(one).sides(r[one], lam[one], active[one], tau[one], 0.0), strict=False
        ):
            here = there.where(there.point == k)
            np.testing.assert_allclose(here.curvature_below, alone.curvature_below, rtol=1e-12, atol=1e-12)
            np.testing.assert_allclose(here.above, alone.above, rtol=1e-12, atol=1e-12)
            np.testing.assert_allclose(np.abs(here.axis), np.abs(alone.axis), atol=1e-9)


def test_other_boundaries_may_have_friction_without_direction() -> None:
    problem = hv.ContactProblem(
        hv.box((1.0, 1.0, 0.5), (3, 3, 2)),
        hv.Material.young(200.0, 0.3),
        {
            "bottom": hv.Contact(Signorini(), OrthotropicFriction(CoulombBound(0.3), ratio=0.3, axis=(0.0, 1.0, 0.0))),
            "right": hv.Contact(Signorini(), Tresca(0.4)),
        },
        {"left": hv.Clamped()},
        tractions={"top": (2.0, 0.7, -3.0)},
    )
    found = hv.solve(problem)
    assert found.status.name == "CONVERGED"
    assert isinstance(found.problem.law, OrthotropicLaw)
    index = found.problem.contact.on("right")
    force, r = np.linalg.norm(found.multiplier[index, 1:], axis=1), found.local[index]
    assert (force <= 0.4 * (1.0 + 1e-9)).all()
    slides = np.linalg.norm(r[:, 1:], axis=1) > 1e-6 * np.abs(found.local).max()
    assert slides.any()
    assert force[slides] == pytest.approx(0.4, rel=1e-6)
    assert np.einsum("ki,ki->k", found.multiplier[index, 1:], r[:, 1:]).min() >= -1e-12


def test_results_do_not_change_with_the_frame() -> None:
    """The body turned by 90 degrees about the vertical, with its load and its axis."""
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    energies = []
    for way in (np.eye(3), turn):
        load = way @ np.array([2.0, 0.7, -3.0])
        friction = OrthotropicFriction(0.5, ratio=0.3, axis=way @ np.array([1.0, 0.4, 0.0]))  # type: ignore[arg-type]
        problem = hv.ContactProblem(
            hv.box((1.0, 1.0, 0.5), (3, 3, 2)), hv.Material.young(200.0, 0.3),
            {"bottom": hv.Contact(Compliance(500.0), friction)},
            tractions={"top": load}, bedding=3.0,
        )  # fmt: skip
        energies.append(hv.solve(problem).energy)
    assert energies[1] == pytest.approx(energies[0], rel=2e-2)  # the diagonals of the mesh do not turn with it


# ---- what is refused, and files ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: OrthotropicFriction(1.0, ratio=0.0), "ratio of the orthotropic friction is 0; it must be positive"),
        (lambda: OrthotropicFriction(1.0, ratio=-2.0), "must be positive"),
        (lambda: OrthotropicFriction(1.0, ratio=np.nan), "ratio of the orthotropic friction"),
        (lambda: OrthotropicFriction(1.0, axis=(0.0, 0.0, 0.0)), "give a direction in 3D"),
        (lambda: OrthotropicFriction(1.0, axis=(1.0, 0.0)), "give a direction in 3D"),
        (lambda: OrthotropicFriction(1.0, axis=(np.inf, 0.0, 0.0)), "axis of the orthotropic friction"),
        (lambda: OrthotropicFriction(-1.0).at(None), "bound"),
        (lambda: ContactLaw(Signorini(), OrthotropicFriction(1.0)), "take OrthotropicLaw"),
        (lambda: hv.ScalarContact(OrthotropicFriction(1.0)), "a scalar problem none"),
        (lambda: law().value(np.zeros((1, 2))), "needs two tangential components"),
        (
            lambda: hv.discretize(sheared_cube(np.zeros(2), OrthotropicFriction(1.0, axis=(0.0, 0.0, 1.0)))),
            "contact 'bottom': the axis .* is normal to the surface",
        ),
        (
            lambda: hv.discretize(
                hv.ContactProblem(
                    hv.rectangle((1.0, 1.0), (2, 2)), hv.Material.young(1.0, 0.3),
                    {"bottom": hv.Contact(Signorini(), OrthotropicFriction(1.0))}, {"top": hv.Clamped()},
                )
            ),
            "the mesh is plane",
        ),
    ],
)  # fmt: skip
def test_bad_input_is_named(make: Callable[[], object], words: str) -> None:
    with pytest.raises(hv.HemivarError, match=words):
        make()
