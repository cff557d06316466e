"""Contact facets: rules between kinks, multipliers of the law, one-sided constants, Fenchel's gap."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from hemivar.basics.types import Array
from hemivar.bounds.body_data import body_data
from hemivar.bounds.contact_traces import PART_RULES, ContactTraces, contact_traces, cut_triangle
from hemivar.bounds.fenchel import fenchel_gap, following, one_sided
from hemivar.bounds.varying_gaps import gap_ranges
from hemivar.formula import Formula
from hemivar.gallery.survey_problems import survey, survey_cube
from hemivar.laws import (
    Compliance,
    ContactLaw,
    Friction,
    Logarithmic,
    PiecewiseQuadratic,
    Signorini,
    SlipWeakening,
    Softening,
    Superpotential,
    ThresholdCompliance,
    Tresca,
)
from hemivar.mechanics import Contact, ContactProblem, Plane

LAWS: dict[str, tuple[Superpotential, Friction]] = {
    "survey": (ThresholdCompliance(0.3, 2.0), Tresca(0.4)),
    "softening": (Softening(4.0, 0.05, 1.5), SlipWeakening(0.8, rate=2.0)),
    "rigid": (Signorini(), Logarithmic(0.5)),
    "springs": (Compliance(3.0), Tresca(0.2)),
}


def bent(problem: ContactProblem, size: float = 0.2) -> Array:
    """A displacement that crosses kinks within facets."""
    x = problem.mesh.points
    d = x.shape[1]
    return np.asarray(size * np.sin(7.0 * (x @ np.arange(1.0, d + 1.0)))[:, None] * np.arange(1.0, d + 1.0) / d)


def traces_of(law: tuple[Superpotential, Friction], dim: int = 2, n: int = 3) -> ContactTraces:
    stated = survey("5.1", n) if dim == 2 else survey_cube("5.1", n)
    problem = replace(stated, contact={"bottom": Contact(*law)})
    u = bent(problem)
    if law[0].at(None).domain.upper.max() < np.inf:
        u[:, -1] = np.abs(u[:, -1])
    found = contact_traces(body_data(problem, u))
    assert found is not None
    return found


@pytest.mark.parametrize("name", LAWS)
def test_rules_in_the_plane_resolve_the_kinks(name: str) -> None:
    """The integral of j' along the boundary, which jumps and bends between the nodes, by a rule with 20 000 points."""
    traces = traces_of(LAWS[name])
    data = traces.data
    zero = np.zeros(traces.local.shape)
    flat = traces.allowed(zero)
    found = np.einsum("fq,fqc->fc", traces.weights, flat)
    t = (np.arange(20_000) + 0.5) / 20_000
    corners = data.table.facets[traces.facets]
    u = (1.0 - t)[None, :, None] * data.displacement[corners[:, :1]] + t[None, :, None] * data.displacement[
        corners[:, 1:]
    ]
    normal = np.array([0.0, -1.0])
    local = np.stack([u @ normal, u @ np.array([1.0, 0.0])], axis=2)
    law = ContactLaw(*LAWS[name]).at(np.zeros((local[..., 0].size, 2)))
    fine = law.nearest_multiplier(local.reshape(-1, 2), np.zeros((local[..., 0].size, 2))).reshape(local.shape)
    expected = data.table.measures[traces.facets, None] * fine.mean(axis=1)
    assert found == pytest.approx(expected, abs=1e-4 * np.abs(fine).max())


@pytest.mark.parametrize("name", ["survey", "softening", "springs"])
def test_rules_in_space_resolve_the_kinks_of_the_normal_law(name: str) -> None:
    """The integral of the pressure, which is linear between its kinks, against a rule on 90 000 parts of each facet."""
    traces = traces_of(LAWS[name], dim=3, n=2)
    data = traces.data
    found = traces.integral(traces.allowed(np.zeros(traces.local.shape))[..., 0])
    point, weight = cut_triangle(300, PART_RULES[3])
    normals = traces.frames[:, 0, 0]
    at_corners = np.einsum("kad,kd->ka", data.displacement[data.table.facets[traces.facets]], normals)
    law = LAWS[name][0].at(np.zeros((1, 3)))
    for facet, r in enumerate(at_corners):
        force = law.derivative(point @ r)
        expected = data.table.measures[traces.facets[facet]] * float(weight @ force)
        assert found[facet] == pytest.approx(expected, abs=1e-4 * np.abs(force).max(initial=1e-3))
    assert traces.weights.sum(axis=1) == pytest.approx(data.table.measures[traces.facets])


def test_weights_and_places() -> None:
    for dim in (2, 3):
        traces = traces_of(LAWS["survey"], dim)
        assert traces.weights.sum(axis=1) == pytest.approx(traces.data.table.measures[traces.facets])
        assert traces.barycentric.sum(axis=2) == pytest.approx(np.ones(traces.weights.shape))
        assert traces.barycentric.min() >= 0.0
        assert traces.weights.min() >= 0.0  # else squares of what has kinks may come out too small
        # moments of a linear force, and back
        linear = traces.barycentric @ np.random.default_rng(2).normal(size=(dim, dim))
        assert traces.forces(traces.on_facets(-traces.moments(linear)) + traces.data.facet_loads) == pytest.approx(
            linear
        )


def test_rounding_beside_a_kink_counts_as_the_kink() -> None:
    problem = survey("5.1", 3)
    u = bent(problem)
    ground = problem.mesh.points[:, 1] == 0.0
    u[ground] = 1e-14 * np.random.default_rng(0).normal(size=(int(ground.sum()), 2))
    traces = contact_traces(body_data(problem, u))
    assert traces is not None
    assert not traces.local.any()
    inside = np.stack([np.full(traces.weights.shape, 0.2), np.full(traces.weights.shape, -0.4)], axis=2)
    assert np.array_equal(traces.allowed(inside), inside)  # within both intervals


def test_penetrations_that_the_law_forbids_are_told() -> None:
    problem = replace(survey("5.1", 3), contact={"bottom": Contact(Signorini())})
    u = np.zeros(problem.mesh.points.shape)
    u[:, 1] = -0.01
    traces = contact_traces(body_data(problem, u))
    assert traces is not None
    assert traces.beyond == pytest.approx(0.01)


def test_gaps_of_obstacles() -> None:
    problem = replace(
        survey("5.1", 4),
        contact={"bottom": Contact(ThresholdCompliance(0.3, 2.0), obstacle=Plane((0.0, -0.1), (0.1, 1.0)))},
    )
    traces = contact_traces(body_data(problem, np.zeros(problem.mesh.points.shape)))
    assert traces is not None
    x = np.einsum("fqa,fai->fqi", traces.barycentric, problem.mesh.points[traces.data.table.facets[traces.facets]])
    normal = np.array([0.1, 1.0]) / np.hypot(0.1, 1.0)
    assert traces.local[..., 0] == pytest.approx(-((x - np.array([0.0, -0.1])) @ normal))
    assert traces.frames[..., 0, :] == pytest.approx(np.broadcast_to(-normal, x.shape))


def kinked_law(knots: list[float], slopes: list[float], jumps: list[float]) -> PiecewiseQuadratic:
    return PiecewiseQuadratic(np.array(knots), np.array(slopes), np.array(jumps))


SCALARS: dict[str, Superpotential] = {
    "softening": Softening(4.0, 0.05, 1.5),
    "rising and falling": kinked_law([-0.2, 0.1, 0.3, 0.7], [0.0, 2.0, -1.5, 3.0, 0.5], [0.1, 0.2, 0.0, 0.3]),
    "a downward jump": kinked_law([0.0, 0.4], [1.0, 2.0, -0.5], [0.2, -0.3]),
    "convex": Compliance(3.0),
}


@pytest.mark.parametrize("name", SCALARS)
def test_one_sided_constants_by_trying_all_points(name: str) -> None:
    law = SCALARS[name].at(np.zeros((1, 2)))
    rng = np.random.default_rng(3)
    r = np.concatenate([rng.uniform(-1.0, 1.5, 60), law.knots[0]])
    many = law.take(np.zeros(len(r), dtype=np.int64)) if len(law.knots) > 1 else law
    interval = many.subdifferential(r)
    zeta = interval.lower + rng.uniform(size=len(r)) * (interval.upper - interval.lower)
    found = one_sided(many, r, zeta)
    far = np.logspace(1.0, 6.0, 200)
    s = np.concatenate([np.linspace(-10.0, 10.0, 20_001), far, -far, law.knots[0] + 1e-9, law.knots[0] - 1e-9])
    slopes = law.derivative(s)
    apart = s[None] - r[:, None]
    with np.errstate(all="ignore"):
        ratio = np.where(np.abs(apart) > 1e-7, -(slopes[None] - zeta[:, None]) / apart, -np.inf)
    tried = np.maximum(ratio.max(axis=1), 0.0)
    finite = np.isfinite(found)
    assert (tried[finite] <= found[finite] * (1.0 + 1e-6) + 1e-6).all()
    sharp = np.maximum(tried, -np.minimum(law.curvature(r + 1e-12), law.curvature(r - 1e-12)))
    assert found[finite] == pytest.approx(sharp[finite], rel=1e-3, abs=1e-3)
    if name == "a downward jump":
        assert not finite[-1]  # on the jump itself
        assert finite[:-1].all()
    else:
        assert finite.all()
        assert (found <= law.weak_convexity.max() * (1 + 1e-12)).all()


@pytest.mark.parametrize("name", LAWS)
@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("weight", [0.03, 1.0])
def test_gap_against_a_search(name: str, dim: int, weight: float) -> None:
    """The conjugate is what a search over many points finds, and no other multiplier costs less."""
    traces = traces_of(LAWS[name], dim, 2)
    rng = np.random.default_rng(1)
    forces = 0.3 * rng.normal(size=traces.local.shape)
    gap = fenchel_gap(traces, forces, weight)
    law, r = traces.law, traces.local.reshape(-1, dim)
    xi, zeta = forces.reshape(-1, dim), gap.multiplier.reshape(-1, dim)
    alpha = float(np.max(law.normal.weak_convexity))
    scan = np.linspace(-60.0, 60.0, 40_001)
    scalar = law.normal.take(np.zeros(len(scan), dtype=np.int64))
    curve = scalar.value(scan) + 0.5 * alpha * scan**2
    own = law.normal.value(r[:, 0]) + 0.5 * alpha * r[:, 0] ** 2

    def price(zeta: Array) -> Array:
        y = zeta + alpha * r[:, 0]
        return np.asarray(own + np.array([np.max(value * scan - curve) for value in y]) - y * r[:, 0])

    found = price(zeta[:, 0])
    total = traces.integral(np.maximum(found, 0.0).reshape(traces.weights.shape))
    assert total == pytest.approx(gap.normal_gap, rel=2e-2, abs=2e-5)
    cost = (xi[:, 0] - zeta[:, 0]) ** 2 / (2.0 * weight) + found
    for _ in range(2):
        other = zeta[:, 0] + 0.1 * rng.normal(size=len(r))
        assert ((xi[:, 0] - other) ** 2 / (2.0 * weight) + price(other) > cost - 1e-5).all()
    assert (gap.tangential_gap >= 0.0).all()
    assert np.isfinite(gap.tangential_gap).all()


@pytest.mark.parametrize("name", LAWS)
@pytest.mark.parametrize("dim", [2, 3])
def test_multipliers_between_the_force_and_the_law(name: str, dim: int) -> None:
    """For a large weight the nearest one that the law allows, for a small one the force, as far as it can be one."""
    traces = traces_of(LAWS[name], dim, 2)
    forces = 0.05 * np.random.default_rng(5).normal(size=traces.local.shape)
    assert fenchel_gap(traces, forces, 1e9).multiplier == pytest.approx(traces.allowed(forces), abs=1e-5)
    slack = fenchel_gap(traces, forces, 1e-9)
    if name in ("survey", "springs"):  # friction up to 0.4 and 0.2 bears all of it
        assert slack.tangential == pytest.approx(0.0, abs=1e-12)
    rates = following(forces, lambda xi: fenchel_gap(traces, xi, 0.3).multiplier)
    moved = fenchel_gap(traces, 1.0001 * forces, 0.3).multiplier - fenchel_gap(traces, forces, 0.3).multiplier
    if dim == 2:
        clear = np.abs(forces) > 1e-3
        expected = np.divide(moved, 0.0001 * forces, where=clear, out=rates.copy())
        assert np.mean(np.abs(expected - rates) < 1e-3) > 0.97  # but where a kink lies between
    assert ((rates >= 0.0) & (rates <= 1.0)).all()


@pytest.mark.parametrize("name", LAWS)
@pytest.mark.parametrize("dim", [2, 3])
def test_a_multiplier_of_the_law_has_no_gap(name: str, dim: int) -> None:
    traces = traces_of(LAWS[name], dim, 2)
    allowed = traces.allowed(0.2 * np.random.default_rng(5).normal(size=traces.local.shape))
    gap = fenchel_gap(traces, allowed, 0.1)
    size = traces.weights.sum()
    for part in (gap.normal, gap.tangential, gap.normal_gap, gap.tangential_gap):
        assert np.abs(part).max() < 1e-12 * size
    assert gap.multiplier == pytest.approx(allowed, abs=1e-12)


@pytest.mark.parametrize("dim", [2, 3])
def test_one_frame_for_a_facet_gives_what_frames_at_its_points_give(dim: int) -> None:
    """A slip, a belt and forces turned once for each facet, and at every point by obstacles with these normals."""
    stated = survey("5.1", 3) if dim == 2 else survey_cube("5.1", 2)
    contact = Contact(ThresholdCompliance(0.3, 2.0), Tresca(0.4), belt=(0.7, 0.2, 0.1)[:dim])
    problem = replace(stated, contact={"bottom": contact})
    data = body_data(problem, bent(problem))
    traces = contact_traces(data)
    assert traces is not None
    assert traces.axes.shape[1] == 1
    moments = np.random.default_rng(0).normal(size=data.facet_loads.shape)
    parts = np.random.default_rng(1).uniform(size=(*traces.weights.shape, 2))
    other = replace(traces, axes=np.array(traces.frames))
    forces = traces.forces(moments)
    for one, two in (
        (forces, other.forces(moments)),
        (traces.interpolated(moments), other.interpolated(moments)),
        (traces.moments(forces), other.moments(forces)),
        (traces.mass(parts), other.mass(parts)),
    ):
        assert one == pytest.approx(two, abs=1e-13 * np.abs(two).max())
    # by hand: the trace less the belt along the tangents, the rest by the definition of each
    places = np.einsum("kqa,kai->kqi", traces.barycentric, data.displacement[data.facet_nodes[traces.facets]])
    slip = np.einsum("kqci,kqi->kqc", traces.frames[:, :, 1:], places - np.array(contact.belt))
    assert traces.local[..., 1:] == pytest.approx(slip, abs=1e-12)
    nodal = np.linalg.solve(
        (np.ones((dim, dim)) + np.eye(dim)) / (dim * (dim + 1)),
        (data.facet_loads - moments)[traces.facets] / data.table.measures[traces.facets, None, None],
    )
    expected = np.einsum("kqa,kai,kqci->kqc", traces.barycentric, nodal, traces.frames)
    assert forces == pytest.approx(expected, abs=1e-12 * np.abs(expected).max())


def test_a_gap_that_is_a_number_has_the_range_of_its_formula() -> None:
    """A linear penetration is largest at the corners of a facet."""
    for stated in (survey("5.1", 3), survey_cube("5.1", 2)):
        ranges = []
        for gap in (0.05, Formula("0.05")):
            contact = Contact(Signorini(), Tresca(0.4), gap=gap)
            problem = replace(stated, contact={"bottom": contact})
            ranges += gap_ranges(body_data(problem, bent(problem)))
        number, formula = ranges
        for part in ("unknown", "above", "below"):
            assert getattr(number, part) == pytest.approx(getattr(formula, part), abs=1e-12)
