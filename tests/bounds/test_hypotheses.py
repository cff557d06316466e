"""What the theorems ask for: constants that hold on whole facets, straight boundaries, laws that do not vary unseen."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import hemivar as hv
from hemivar.bounds.body_data import body_data
from hemivar.bounds.contact_traces import contact_traces
from hemivar.bounds.exact_distance import exact_distance
from hemivar.bounds.fenchel import one_sided, one_sided_constants
from hemivar.bounds.hypotheses import body_shape, unmet_hypotheses
from hemivar.bounds.trace_bounds import TraceBounds, guaranteed_trace_bounds
from hemivar.errors import ProblemError
from hemivar.gallery import survey, survey_cube
from tests import bodies

PROVED = TraceBounds(2.5, 2.5, 2.5, 2.0, True, "for this test")


def round_plate(n: int) -> hv.Mesh:
    """A quarter of a disc by n rings: the outer boundary is a polygon of n chords, called ``arc``."""
    angle, radius = np.meshgrid(np.linspace(0.0, np.pi / 2.0, n + 1), np.linspace(1.0, 2.0, 3))
    points = np.column_stack([(radius * np.cos(angle)).ravel(), (radius * np.sin(angle)).ravel()])
    at = np.arange(3 * (n + 1)).reshape(3, n + 1)
    a, b, c, d = (part.ravel() for part in (at[:-1, :-1], at[1:, :-1], at[1:, 1:], at[:-1, 1:]))
    mesh = hv.Mesh.oriented(points, np.vstack([np.column_stack([a, b, c]), np.column_stack([a, c, d])]))
    outer = mesh.boundary_facets
    middle = mesh.points[outer].mean(axis=1)
    named = {
        "arc": outer[np.linalg.norm(middle, axis=1) > 1.7],
        "bottom": outer[middle[:, 1] < 1e-9],
        "left": outer[middle[:, 0] < 1e-9],
    }
    return mesh.with_boundaries(named)


def on_mesh(mesh: hv.Mesh) -> hv.ContactProblem:
    foundation = hv.Contact(hv.laws.ThresholdCompliance(0.3, 2.0))
    force = (0.0, -1.0, -0.5)[: mesh.dim]
    return bodies.body(mesh, foundation, body_force=force)


def test_a_polygon_is_told_from_a_curve() -> None:
    box = hv.rectangle((1.0, 1.0), 3)
    sheared = hv.Mesh(box.points @ np.array([[1.0, 0.0], [0.4, 1.0]]), box.cells, dict(box.boundaries))
    for straight in (box, sheared, box.refined(), box.rotated(0.3), hv.box((1.0, 1.0, 1.0), 2)):
        problem = on_mesh(straight)
        assert unmet_hypotheses(problem) == []
    for n in (4, 9):
        reason, inner = unmet_hypotheses(on_mesh(round_plate(n)))
        assert "without a name" in inner
        assert f"the boundary 'arc' looks curved: it turns by up to {90.0 / n:.3g} degrees" in reason
        # who says that the polygon is the body has no reason, and a bound
        meant = replace(on_mesh(round_plate(n)), geometry="as-meshed")
        assert unmet_hypotheses(meant) == []
        # refined, the body is the same polygon; that its boundary stands for a curve is seen still
        assert "looks curved" in unmet_hypotheses(on_mesh(round_plate(n).refined()))[0]
    # one bend of a polygon, as of a ramp, is none
    points = box.points.copy()
    points[:, 1] += np.maximum(points[:, 0] - 1.0 / 3.0, 0.0) * 0.2
    assert unmet_hypotheses(on_mesh(hv.Mesh(points, box.cells, dict(box.boundaries)))) == []


def polygon(sides: int) -> hv.Mesh:
    """A regular polygon of triangles around its centre."""
    turn = 2.0 * np.pi * np.arange(sides) / sides
    points = np.vstack([[[0.0, 0.0]], np.column_stack([np.cos(turn), np.sin(turn)])])
    after = np.arange(1, sides + 1) % sides + 1
    mesh = hv.Mesh(points, np.column_stack([np.zeros(sides, dtype=int), np.arange(1, sides + 1), after]))
    return mesh.with_boundaries({"left": mesh.boundary_facets[:1], "bottom": mesh.boundary_facets[1:2]})


@pytest.mark.parametrize("sides", [5, 11, 12, 40])
def test_what_the_body_is_taken_for_is_said(sides: int) -> None:
    """Up to 11 sides of a regular polygon are corners, from 12 on a curve is suspected: said in either case."""
    problem = on_mesh(polygon(sides).refined())
    found = hv.solve(problem).certify(exact=True).exact
    assert found is not None
    assert found.guaranteed == (sides < 12)
    assert found.geometry == f"a polygon with {sides} straight sides"
    assert f"the body is a polygon with {sides} straight sides" in "\n".join(found.lines())
    assert found.record()["geometry"] == found.geometry


@pytest.mark.parametrize(
    ("mesh", "words"),
    [
        (hv.rectangle((1.0, 1.0), 3), "a polygon with 4 straight sides"),
        (hv.rectangle((1.0, 1.0), 3).rotated(0.3), "a polygon with 4 straight sides"),
        (round_plate(4), "a polygon with 10 straight sides"),
        (hv.box((1.0, 2.0, 1.0), 2), "a polyhedron with 6 plane faces"),
    ],
)
def test_straight_sides_are_counted(mesh: hv.Mesh, words: str) -> None:
    assert body_shape(mesh) == body_shape(mesh.refined()) == words


def test_a_curve_in_space_or_without_a_name() -> None:
    box = hv.box((1.0, 1.0, 1.0), 4)
    points = box.points.copy()
    points[:, 2] += 0.1 * np.sin(np.pi * points[:, 0])
    reasons = unmet_hypotheses(on_mesh(hv.Mesh(points, box.cells, dict(box.boundaries))))
    assert {reason.split("'")[1] for reason in reasons} == {"bottom", "top"}
    plate = round_plate(6)
    bare = plate.with_boundaries({name: plate.boundaries[name] for name in ("bottom", "left")})
    (reason,) = unmet_hypotheses(on_mesh(bare))  # of both arcs
    assert "the boundary without a name looks curved" in reason


@pytest.mark.parametrize("names", [1, 2, 6, 12])
def test_a_circle_is_a_curve_whatever_its_parts_are_called(names: int) -> None:
    mesh = polygon(12)
    parts = np.array_split(mesh.boundary_facets, names)
    mesh = mesh.with_boundaries({f"p{i}": part for i, part in enumerate(parts)})
    for circle in (mesh, mesh.refined()):
        contact = {"p0": hv.Contact(hv.Compliance(1.0))}
        (reason,) = unmet_hypotheses(
            hv.ContactProblem(mesh=circle, material=hv.Material.lame(4.0, 4.0), contact=contact)
        )
        assert "looks curved: it turns by up to 30 degrees" in reason
        assert all(f"'p{i}'" in reason for i in range(names))


@pytest.mark.parametrize("height", [0.1, 0.6])
def test_of_several_curves_the_sharpest_is_named(height: float) -> None:
    """A bump above and below, without names, one of them flatter."""
    box = hv.rectangle((1.0, 1.0), 8)
    points = box.points.copy()
    points[:, 1] += np.abs(points[:, 1] - height) * 0.2 * np.sin(np.pi * points[:, 0])
    upright = {"left": box.boundaries["left"], "bottom": box.boundaries["right"]}
    (reason,) = unmet_hypotheses(on_mesh(hv.Mesh(points, box.cells, upright)))
    x = np.linspace(0.0, 1.0, 9)
    slopes = np.diff(0.2 * max(height, 1.0 - height) * np.sin(np.pi * x)) * 8.0
    steepest = np.degrees(np.abs(np.diff(np.arctan(slopes))).max())
    assert f"without a name looks curved: it turns by up to {steepest:.3g} degrees" in reason


def test_corners_of_two_sides_each_are_no_curve() -> None:
    """Chamfers at 20 degrees on two far sides, under names of their own or not: four directions, two in each chain."""
    box = hv.rectangle((1.0, 1.0), 4)
    points = box.points.copy()
    points[:, 0] += np.where(points[:, 1] > 0.5, np.tan(np.radians(20.0)) * (points[:, 1] - 0.5), 0.0)
    assert unmet_hypotheses(on_mesh(hv.Mesh(points, box.cells, dict(box.boundaries)))) == []


def test_a_curved_boundary_makes_an_estimate() -> None:
    problem = on_mesh(round_plate(6))
    found = exact_distance(problem, hv.solve(problem).displacement, PROVED)
    assert not found.guaranteed
    assert "straight facets" in " ".join(found.reasons)


@pytest.mark.parametrize(
    ("contact", "named"),
    [
        (hv.Contact(hv.laws.ThresholdCompliance(lambda x: 0.3 + x[:, 0], 2.0)), "q_max"),
        (hv.Contact(hv.laws.ThresholdCompliance(0.3, 2.0), hv.Tresca(lambda x: 0.1 + x[:, 0])), "bound"),
        (
            hv.Contact(
                hv.laws.ThresholdCompliance(0.3, 2.0), hv.SlipWeakening(0.1, 1.0, lambda x: 0.7 + 0.0 * x[:, 0], 1.0)
            ),
            "kinetic",
        ),
    ],
)
def test_laws_that_vary_along_the_boundary_make_an_estimate(contact: hv.Contact, named: str) -> None:
    problem = replace(survey("5.1", 3), contact={"bottom": contact})
    found = exact_distance(problem, hv.solve(problem).displacement, PROVED)
    assert found.distance < np.inf
    assert not found.guaranteed
    assert f"the law of contact 'bottom' varies along the boundary ({named})" in found.reasons[0]


@pytest.mark.parametrize(
    ("bound", "proved"),
    [
        ("0.1 + 0.05*max(min(s, 0.5), 0)", True),
        (([0.0, 0.5], [0.1, 0.125]), True),
        (lambda s: 0.1 + 0.05 * np.clip(s, 0.0, 0.5), False),
        (lambda s: np.full(np.shape(s), 0.1), False),  # as far as samples tell
    ],
    ids=["formula", "table", "function", "constant function"],
)
@pytest.mark.parametrize("beside", [False, True], ids=["one law", "two laws"])
def test_friction_that_is_sampled_makes_an_estimate(bound: Any, proved: bool, beside: bool) -> None:
    """Also where it stands beside another law, and in the law that is taken at the solution."""
    problem = survey("5.1", 3)
    contact = {"bottom": hv.Contact(hv.laws.ThresholdCompliance(0.3, 2.0), hv.Tresca(hv.laws.PenetrationBound(bound)))}
    if beside:
        contact = {"right": hv.Contact(hv.Compliance(1.0)), **contact}
        problem = replace(problem, tractions={"top": (0.0, -0.1)})
    problem = replace(problem, contact=contact)
    solution = hv.solve(problem)
    assert solution.certify().unique is (True if proved else None)
    found = exact_distance(problem, solution.displacement, PROVED)
    assert found.distance < np.inf
    assert found.guaranteed == proved
    if not proved:
        assert "how the friction bound depends on the penetration is known from samples only" in found.reasons


def test_parameters_of_contact_points_are_refused() -> None:
    problem = survey("5.1", 3)
    problem = replace(
        problem, contact={"bottom": hv.Contact(hv.laws.ThresholdCompliance(np.linspace(0.1, 0.3, 4), 2.0))}
    )
    u = hv.solve(problem).displacement
    with pytest.raises(ProblemError, match=r"parameter q_max given at 4 contact points.*a number, or a function of x"):
        exact_distance(problem, u, PROVED)


LAWS = {
    "falling": hv.laws.PiecewiseQuadratic([[-0.02, 0.01, 0.03]], [[0.0, 4.0, -2.0, 1.0]], [[0.0, 0.0, 0.0]]),
    "jump up": hv.laws.PiecewiseQuadratic([[0.0, 0.02]], [[0.0, 3.0, -1.5]], [[0.2, 0.05]]),
    "softening": hv.Softening(4.0, 0.02, 2.0),
}


@pytest.mark.parametrize("name", LAWS)
@pytest.mark.parametrize("dim", [2, 3])
def test_constants_hold_on_whole_facets(name: str, dim: int) -> None:
    """Not at the points of a rule alone: against 4001 penetrations between the least and the largest of each facet."""
    law = LAWS[name]
    problem = survey("5.1", 4) if dim == 2 else survey_cube("5.1", 2)
    problem = replace(problem, contact={"bottom": hv.Contact(law)})
    mesh = problem.mesh
    rng = np.random.default_rng(3)
    for _ in range(5):
        u = 0.04 * rng.normal(size=mesh.points.shape)
        traces = contact_traces(body_data(problem, u))
        assert traces is not None
        zeta = traces.allowed(np.zeros((*traces.weights.shape, dim)))
        normal, _ = one_sided_constants(traces, zeta)
        for facet, found in zip(traces.data.table.facets[traces.facets], normal.max(axis=1), strict=True):
            ends = -u[facet, dim - 1]
            r = np.linspace(ends.min(), ends.max(), 4001)[1:-1]
            slope = law.subdifferential(r)
            largest = one_sided(law, r, np.asarray(slope.lower)).max()
            assert found >= largest * (1.0 - 1e-9)
            assert found <= max(
                largest * 1.01 + 0.01, one_sided(law, ends, np.asarray(law.subdifferential(ends).lower)).max()
            )


def test_a_downward_jump_between_points_of_a_rule_is_seen() -> None:
    """However small it is: where the trace passes it no constant is finite."""
    law = hv.laws.PiecewiseQuadratic([[0.0, 0.02]], [[0.0, 2.0, 2.0]], [[0.0, -1e-5]])
    problem = replace(survey("5.1", 4), contact={"bottom": hv.Contact(law)})
    discrete = hv.discretize(problem)
    u = hv.solve(discrete).displacement
    penetration = -u[problem.mesh.points[:, 1] == 0.0, 1]
    assert penetration.min() < 0.02 < penetration.max()
    found = exact_distance(problem, u, guaranteed_trace_bounds(discrete))
    assert found.distance == np.inf
    assert "passes a downward jump of the law on 1 contact facets" in " ".join(found.reasons)
    # before it comes to that, the jump does not matter
    light = replace(problem, body_force=(0.0, -0.05))
    assert exact_distance(light, hv.solve(light).displacement, PROVED).guaranteed


def wedged(degrees: float) -> hv.ContactProblem:
    """A square whose left side, a roller, has two straight halves, pulled up along it."""
    box = hv.rectangle((1.0, 1.0), 4, pattern="cross")
    points = box.points.copy()
    half = np.tan(np.radians(degrees / 2.0)) * np.minimum(points[:, 1], 1.0 - points[:, 1])
    points[:, 0] -= (1.0 - points[:, 0]) * half
    return bodies.body(
        hv.Mesh(points, box.cells, dict(box.boundaries)),
        hv.Compliance(0.2),
        material=hv.Material.young(1.0, 0.0),
        supports={"left": hv.Roller(), "right": hv.Fixed(x=0.0)},
        tractions={"top": (0.0, 1.0)},
    )


@pytest.mark.parametrize("degrees", [10.0, 40.0])
def test_a_roller_that_bends_is_passed_through(degrees: float) -> None:
    """Where two sides meet at less than 45 degrees their normals are averaged: the bound was half the error there."""
    problem = wedged(degrees)
    found = exact_distance(problem, hv.solve(problem).displacement, PROVED)
    assert not found.guaranteed
    assert any("the roller 'left' bends" in reason for reason in found.reasons)
    # at a sharper corner, and along a straight side, facets and nodes hold the same
    plain = replace(wedged(0.0), supports={"left": hv.Roller(), "right": hv.Clamped()})
    for straight in (plain, wedged(50.0), replace(plain, mesh=plain.mesh.rotated(0.3))):
        assert exact_distance(straight, hv.solve(straight).displacement, PROVED).reasons == ()
