"""Rigid obstacles: distances and rays against brute force, contact normals, messages."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from hemivar.errors import ProblemError
from hemivar.fem import discretize
from hemivar.laws import Bilateral, Compliance, Signorini, Tresca
from hemivar.mechanics import (
    Clamped,
    Contact,
    ContactProblem,
    Cylinder,
    Material,
    Normals,
    Plane,
    Prescribed,
    Quadrature,
    SignedDistance,
    Sphere,
)
from hemivar.mechanics.obstacles import Obstacle
from hemivar.mesh import rectangle
from hemivar.solvers import solve
from tests import bodies
from tests.samples import sampled

from ..mesh.meshes import cube

SHAPES: dict[str, Obstacle] = {
    "line": Plane((0.2, -0.1), (1.0, 2.0)),
    "plane": Plane((0.2, -0.1, 0.4), (1.0, 2.0, -0.5)),
    "circle": Sphere((0.2, -0.1), 0.7),
    "sphere": Sphere((0.2, -0.1, 0.3), 0.7),
    "hollow sphere": Sphere((0.2, -0.1, 0.3), 0.7, inside=True),
    "cylinder": Cylinder((0.2, -0.1, 0.3), (1.0, 1.0, 0.3), 0.7),
    "hollow cylinder": Cylinder((0.2, -0.1, 0.3), (1.0, 1.0, 0.3), 0.7, inside=True),
}


def cloud(obstacle: Obstacle, count: int = 300) -> np.ndarray:
    assert obstacle.dim is not None
    return np.random.default_rng(7).uniform(-1.5, 1.5, (count, obstacle.dim))


def directions(points: np.ndarray) -> np.ndarray:
    vectors = np.random.default_rng(8).standard_normal(points.shape)
    return vectors / np.linalg.norm(vectors, axis=1)[:, None]


@pytest.mark.parametrize("name", SHAPES)
def test_normal_is_the_gradient_of_the_distance_and_leads_to_the_surface(name: str) -> None:
    obstacle = SHAPES[name]
    points = cloud(obstacle)
    normal = obstacle.normals(points)
    slope = np.column_stack(
        [(obstacle.distance(points + e) - obstacle.distance(points - e)) / 2e-6 for e in 1e-6 * np.eye(points.shape[1])]
    )
    np.testing.assert_allclose(normal, slope, atol=1e-8)
    foot = points - obstacle.distance(points)[:, None] * normal
    np.testing.assert_allclose(obstacle.distance(foot), 0.0, atol=1e-14)


@pytest.mark.parametrize("name", sampled(SHAPES, 3))
def test_distance_along_a_ray_is_that_of_a_search_on_the_ray(name: str) -> None:
    """Ahead of a point outside the first entry, behind a point inside the last; found on a fine grid of the ray."""
    obstacle = SHAPES[name]
    points = cloud(obstacle)
    rays = directions(points)
    found = obstacle.along(points, rays)
    way = np.linspace(0.0, 60.0, 60001)
    for x, v, t in zip(points, rays, found, strict=True):
        outside = obstacle.distance(x[None])[0] > 0
        inside_there = obstacle.distance(x + np.outer(way if outside else -way, v)) < 0
        change = np.flatnonzero(inside_there if outside else ~inside_there)
        if len(change) == 0:
            assert not np.isfinite(t) or abs(t) > 59.0
        else:
            assert abs(t) == pytest.approx(way[change[0]], abs=2e-3)
            assert (t > 0) == outside


@pytest.mark.parametrize("name", SHAPES)
def test_signed_distance_of_a_shape_is_the_shape(name: str) -> None:
    obstacle = SHAPES[name]
    points = cloud(obstacle)
    rays = directions(points)
    numerical = SignedDistance(obstacle.distance)
    exact = SignedDistance(obstacle.distance, obstacle.normals)
    np.testing.assert_allclose(exact.normals(points), obstacle.normals(points), atol=1e-15)
    np.testing.assert_allclose(numerical.normals(points), obstacle.normals(points), atol=1e-8)
    reference = obstacle.along(points, rays)
    meets = np.isfinite(reference)
    hit = points + np.where(meets, reference, 0.0)[:, None] * rays
    grazing = meets & (np.abs(np.einsum("kd,kd->k", obstacle.normals(hit), rays)) < 0.2)
    found = exact.along(points, rays)
    np.testing.assert_allclose(found[~grazing], reference[~grazing], atol=1e-7)


def square_over(obstacle: Obstacle, normals: str | None = None, **options: Any) -> ContactProblem:
    contact = Contact(Signorini(), obstacle=obstacle, normals=normals)  # type: ignore[arg-type]
    return ContactProblem(
        options.get("mesh", rectangle((1.0, 1.0), 8, "cross")),
        Material.young(1.0, 0.3),
        contact={"bottom": contact},
        supports={"top": Prescribed(options.get("top", (0.0, -0.02)))},
        quadrature=options.get("quadrature", Quadrature.NODAL),
    )


@pytest.mark.parametrize("quadrature", list(Quadrature))
def test_gap_and_normal_below_a_flat_body(quadrature: Quadrature) -> None:
    circle = Sphere((0.5, -2.0), 1.9)
    own = discretize(square_over(circle, "obstacle", quadrature=quadrature))
    x = own.contact.points[:, 0] - 0.5
    np.testing.assert_allclose(own.gap, np.hypot(x, 2.0) - 1.9, atol=1e-14)
    np.testing.assert_allclose(own.contact.frames[:, 0], np.column_stack([-x, -2.0 + 0 * x]) / np.hypot(x, 2)[:, None])
    np.testing.assert_allclose(
        own.contact.frames @ own.contact.frames.transpose(0, 2, 1),
        np.broadcast_to(np.eye(2), (len(x), 2, 2)),
        atol=1e-14,
    )
    body = discretize(square_over(circle, "body", quadrature=quadrature))
    np.testing.assert_allclose(body.gap, 2.0 - np.sqrt(1.9**2 - x**2), atol=1e-14)
    np.testing.assert_allclose(body.contact.frames[:, 0], [[0.0, -1.0]] * len(x), atol=1e-14)


def test_a_plane_below_a_flat_body_is_the_gap() -> None:
    by_gap = square_over(Plane((0.0, 0.0), (0.0, 1.0)))
    by_gap = replace(by_gap, contact={"bottom": Contact(Signorini(), gap=0.005)})
    expected = solve(discretize(by_gap)).raise_for_status()
    for normals in Normals:
        found = solve(discretize(square_over(Plane((3.0, -0.005), (0.0, 4.0)), normals))).raise_for_status()
        np.testing.assert_allclose(found.displacement, expected.displacement, atol=1e-12)
        np.testing.assert_allclose(found.pressure, expected.pressure, atol=1e-10)


def test_an_oblique_plane_is_not_crossed() -> None:
    """With normals of the obstacle the linearised contact with a plane is exact for displacements of any size."""
    plane = Plane((0.5, 0.0), (0.2, 1.0))
    found = solve(discretize(square_over(plane, top=(0.05, -0.1)))).raise_for_status()
    mesh = found.problem.field.mesh
    nodes = np.unique(mesh.boundaries["bottom"])
    left = plane.distance((mesh.points + found.displacement)[nodes])
    assert left.min() > -1e-13
    touching = found.pressure > 1e-8
    assert touching.any()
    np.testing.assert_allclose(found.penetration[touching], 0.0, atol=1e-13)


def test_an_overlap_is_an_interference_fit() -> None:
    """A block, zero Poisson's ratio, between a fixed top and a plane that it overlaps by d: pressure E d."""
    contact = Contact(Signorini(), obstacle=Plane((0.0, 0.01), (0.0, 1.0)))
    problem = bodies.square(contact, 4, material=Material.young(7.0, 0.0), supports={"top": Clamped()})
    np.testing.assert_allclose(solve(discretize(problem)).pressure, 0.07, atol=1e-13)


def test_points_whose_normal_misses_are_no_contact_points() -> None:
    found = discretize(square_over(Sphere((0.5, -0.3), 0.2), "body"))
    np.testing.assert_allclose(found.contact.points[:, 0], [0.375, 0.5, 0.625])  # of a grid of 1/8
    solution = solve(found).raise_for_status()
    assert solution.penetration.max() <= 1e-12


def test_compliance_and_friction_meet_an_obstacle() -> None:
    contact = Contact(Compliance(50.0), Tresca(0.01), obstacle=Sphere((0.5, -2.0), 2.0))
    problem = replace(square_over(Sphere((0.0, 0.0), 1.0)), contact={"bottom": contact})
    solution = solve(discretize(problem)).raise_for_status()
    np.testing.assert_allclose(solution.pressure, 50.0 * np.maximum(solution.penetration, 0.0), atol=1e-9)
    assert np.abs(solution.friction).max() <= 0.01 + 1e-12


def test_units_do_not_matter() -> None:
    first = solve(discretize(square_over(Sphere((0.5, -2.0), 1.99)))).raise_for_status()
    scaled = ContactProblem(
        rectangle((1.0, 1.0), 8, "cross").scaled(1e3),
        Material.young(1e-6, 0.3),
        contact={"bottom": Contact(Signorini(), obstacle=Sphere((500.0, -2000.0), 1990.0))},
        supports={"top": Prescribed((0.0, -20.0))},
    )
    second = solve(discretize(scaled)).raise_for_status()
    np.testing.assert_allclose(second.pressure * 1e6, first.pressure, atol=1e-9 * first.pressure.max())


@pytest.mark.parametrize("shape", ["sphere", "distance"])
def test_a_turned_body_and_obstacle_give_the_same_pressure(shape: str) -> None:
    turn = np.linalg.qr(np.random.default_rng(2).standard_normal((3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))

    def pressed(matrix: np.ndarray) -> np.ndarray:
        sphere = Sphere(matrix @ [0.5, 0.4, -2.0], 1.99)
        obstacle = sphere if shape == "sphere" else SignedDistance(sphere.distance)
        return solve(
            discretize(square_over(obstacle, mesh=cube(3).moved(matrix), top=tuple(matrix @ [0.0, 0.0, -0.05])))
        ).pressure

    straight = pressed(np.eye(3))
    assert 0 < np.count_nonzero(straight) < len(straight)
    np.testing.assert_allclose(pressed(turn), straight, atol=(1e-9 if shape == "sphere" else 1e-6) * straight.max())


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Sphere((0.0, 0.0), -1.0), "radius is -1.0; give one positive number"),
        (lambda: Sphere((0.0,), 1.0), "center has shape (1,)"),
        (lambda: Plane((0.0, 0.0), (0.0, 0.0)), "normal is zero; give a direction"),
        (lambda: Plane((0.0, 0.0), (0.0, 0.0, 1.0)), "give equally many"),
        (lambda: Plane((0.0, np.nan), (0.0, 1.0)), "not finite"),
        (lambda: Cylinder((0.0, 0.0), (0.0, 1.0), 1.0), "take Sphere"),
        (lambda: SignedDistance(3.0), "give a function of points"),  # type: ignore[arg-type]
        (lambda: Contact(Signorini(), gap=0.1, obstacle=Sphere((0.0, 0.0), 1.0)), "leave one out"),
        (lambda: Contact(Signorini(), normals=Normals.OBSTACLE), "needs an obstacle"),
        (lambda: Contact(Signorini(), obstacle=3.0), "obstacle is 3.0; pass Plane"),  # type: ignore[arg-type]
        (lambda: square_over(Sphere((0.0, 0.0), 1.0), "mine"), "choose Normals.OBSTACLE or Normals.BODY"),
        (lambda: square_over(Sphere((0.0, 0.0, -2.0), 1.0)), "has 3 coordinates, the mesh has 2"),
        (lambda: discretize(square_over(Plane((0.0, 0.0), (0.0, -1.0)))), "wrong side"),
        (
            lambda: discretize(square_over(Plane((0.0, 0.0), (0.0, -1.0)), "body")),
            "no outward normal of the body meets",
        ),
        (lambda: discretize(square_over(Sphere((0.5, 0.0), 1.0))), "lies at the centre of the sphere"),
        (lambda: discretize(square_over(Sphere((5.0, 0.5), 1.0), "body")), "no outward normal of the body meets"),
        (lambda: discretize(square_over(SignedDistance(lambda x: 2.0 * x[:, 1]))), "gradient of length 2"),
        (lambda: discretize(square_over(SignedDistance(lambda x: x))), "returned shape"),
        (lambda: discretize(square_over(SignedDistance(lambda x: x[:, 1] * np.nan))), "returned nan"),
        (
            lambda: discretize(
                replace(
                    square_over(Sphere((0.5, -0.3), 0.25)),
                    contact={"bottom": Contact(Bilateral(), obstacle=Sphere((0.5, -0.3), 0.25), normals=Normals.BODY)},
                )
            ),
            "allows no opening",
        ),
    ],
)
def test_bad_obstacles_are_refused_in_words(make: Callable[[], object], words: str) -> None:
    with pytest.raises(ProblemError, match=re.escape(words)) as caught:
        make()
    assert "\n" not in str(caught.value)


# ---- problem files -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("normals", ["body", "obstacle"])
def test_supports_may_hold_every_point_that_could_touch(normals: str) -> None:
    for obstacle in (SignedDistance(lambda x: x[:, 1] + 0.1), Plane((0.0, -0.1), (0.0, 1.0)), Sphere((0.5, -2.0), 1.9)):
        problem = square_over(obstacle, normals, mesh=rectangle((1.0, 1.0), 1, "cross"))
        problem = replace(problem, supports={"left": Clamped(), "right": Clamped()})
        assert discretize(problem).contact_points == 0


@pytest.mark.parametrize(("given", "then"), [(None, "obstacle"), ("body", "body")])
def test_an_obstacle_that_is_put_in_later_brings_its_normals(given: str | None, then: str) -> None:
    sphere = Sphere((0.5, -1.0), 0.9)
    contact = replace(Contact(Signorini(), normals=given), obstacle=sphere)
    assert contact.normals == then == Contact(Signorini(), obstacle=sphere, normals=given).normals
