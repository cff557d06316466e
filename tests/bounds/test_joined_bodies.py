"""Bodies that touch along facets that coincide: the bound of the distance to the exact solution is guaranteed."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

import hemivar as hv
from hemivar.bounds import solve_adaptive
from hemivar.bounds.admissible_stress import AdmissibleStress, admissible_stress
from hemivar.bounds.body_data import body_data
from hemivar.bounds.conjugate_sweeps import Sweeps
from hemivar.bounds.contact_traces import contact_traces
from hemivar.bounds.convex_distance import _missed
from hemivar.bounds.exact_distance import ExactDistance, exact_distance, improved_stress
from hemivar.bounds.joined_sides import joined_sides
from hemivar.bounds.lower_bounds import lower_bounds
from hemivar.bounds.patches import PatchKind
from hemivar.bounds.touching_bodies import contact_moments
from hemivar.bounds.trace_bounds import discrete_trace_bounds, guaranteed_trace_bounds
from hemivar.mechanics.statement import Geometry
from hemivar.mesh.mesh import Mesh
from tests.samples import sampled, slow

from .admissibility import imbalance
from .bodies import shaken
from .test_touching_bodies import bowl_between, error_on_refined


def opened(mesh: Mesh, *levels: float) -> Mesh:
    """Opened along levels of its last axis, from above: part0 lies on part1, and so on."""
    middle = mesh.points[mesh.cells].mean(axis=1)[:, -1]
    number = sum(middle < level for level in levels)
    names = [f"part{k}" for k in range(len(levels) + 1)]
    mesh = mesh.named(mesh.boundaries, {name: np.flatnonzero(number == k) for k, name in enumerate(names)})
    for k in range(len(levels)):
        mesh = mesh.opened(f"joint{k}", between=(names[k], names[k + 1]))
    return mesh


def contact(k: int, law: hv.laws.Superpotential, friction: hv.laws.Friction | None = None, **more: object) -> object:
    """The upper side of a joint against its lower one."""
    rubs = hv.laws.NoFriction() if friction is None else friction
    return {f"joint{k}:part{k}": hv.Contact(law, rubs, against=f"joint{k}:part{k + 1}", **more)}  # type: ignore[arg-type]


def two(mesh: Mesh, moduli: tuple[float, float], pairs: object, **more: object) -> hv.ContactProblem:
    """Two parts, the lower one clamped and the upper one held at its top."""
    material = hv.Material.by_region({f"part{k}": hv.Material.young(E, 0.3) for k, E in enumerate(moduli)})
    supports = {"bottom": hv.mechanics.Clamped(), "top": hv.mechanics.Clamped()}
    stated = {"supports": supports, "geometry": Geometry.AS_MESHED, **more}
    return hv.ContactProblem(mesh, material, pairs, **stated)  # type: ignore[arg-type]


def random_joint(seed: int) -> hv.ContactProblem:
    """Few cells of bad shape, a joint that is bent, stiffnesses of up to 1000 to 1, any law, either side."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, 5))
    mesh = opened(shaken(hv.rectangle((1.0, 1.0), (n, 4)), seed), 0.5)
    moduli = (1.0, float(10.0 ** rng.choice([-3.0, -1.0, 0.0, 3.0])))
    soft = min(moduli)
    law, friction = [
        (hv.Compliance(10.0 * soft), hv.Tresca(0.01 * soft)),
        (hv.Signorini(), hv.Tresca(0.02 * soft)),
        (hv.Signorini(), hv.laws.NoFriction()),
        (hv.Adhesive(4.0 * soft, 0.03 * soft, softening=0.3 * soft, compression=9.0 * soft), hv.laws.NoFriction()),
    ][seed % 4]
    side = f"joint0:part{int(rng.integers(2))}"
    pushed = tuple(0.03 * rng.normal(size=2) - (0.0, 0.03))
    return two(
        mesh, moduli, contact(0, law, friction, gap=float(rng.choice([0.0, 0.005])), slave=side),
        supports={"bottom": hv.mechanics.Clamped(), "top": hv.Prescribed(pushed)},
        tractions={"right": tuple(0.03 * soft * rng.normal(size=2))}, order=1 + int(seed % 5 == 0),
        body_force=tuple(0.1 * soft * rng.normal(size=2)),
    )  # fmt: skip


def solved_and_bounded(problem: hv.ContactProblem) -> tuple[hv.Solution, ExactDistance]:
    found = hv.solve(problem)
    return found, exact_distance(problem, found.displacement, guaranteed_trace_bounds(hv.discretize(problem)))


@pytest.mark.parametrize("seed", sampled(range(24), 8))
def test_the_bound_is_above_the_error(seed: int) -> None:
    problem = random_joint(seed)
    found, exact = solved_and_bounded(problem)
    error = error_on_refined(found, 4 - problem.order)
    assert exact.guaranteed, exact.reasons
    assert error < exact.distance < 4.0 * error


@pytest.mark.parametrize("law", ["springs", "glue"])
@pytest.mark.parametrize("moduli", [slow((1.0, 1.0)), (1.0, 1000.0), (1000.0, 1.0)])
def test_the_error_is_that_of_columns_in_series(law: str, moduli: tuple[float, float]) -> None:
    """Two columns on one another have a closed form; any displacement beside it has a known error."""
    k, strength, alpha = 2.0, 0.05, 0.3 * min(moduli)
    pull = -0.1 if law == "springs" else 0.1
    springs, glue = hv.Compliance(k), hv.Adhesive(k, strength, softening=alpha)
    compliance = sum(0.5 / E for E in moduli)
    if law == "springs":
        stress = pull / (compliance + 1.0 / k)
    else:  # stress = strength - alpha (w - strength / k), w = pull - compliance stress
        stress = (strength + alpha * (strength / k - pull)) / (1.0 - alpha * compliance)
    mesh = opened(hv.rectangle((0.25, 1.0), (1, 4)), 0.5)
    material = hv.Material.by_region({f"part{n}": hv.Material.young(E, 0.0) for n, E in enumerate(moduli)})
    supports = {"bottom": hv.mechanics.Clamped(), "top": hv.Prescribed((0.0, pull)),
                "left": hv.mechanics.Roller(), "right": hv.mechanics.Roller()}  # fmt: skip
    problem = two(mesh, moduli, contact(0, springs if law == "springs" else glue), supports=supports)
    problem = replace(problem, material=material)
    found, exact = solved_and_bounded(problem)
    y, upper = mesh.points[:, 1], np.isin(np.arange(mesh.number_of_nodes), mesh.cells[mesh.regions["part0"]])
    height = np.where(upper, pull + stress / moduli[0] * (y - 1.0), stress / moduli[1] * y)
    np.testing.assert_allclose(found.displacement[:, 1], height, atol=1e-9)
    assert exact.guaranteed
    assert exact.distance < 1e-7 * exact.energy_norm
    assert exact.constant == pytest.approx(0.0 if law == "springs" else alpha * compliance, rel=0.02)
    field = found.problem.field
    assert field is not None
    constants = guaranteed_trace_bounds(hv.discretize(problem))
    for seed in range(3):
        off = np.random.default_rng(seed).normal(size=found.problem.unknowns) * 1e-3
        error = float(np.sqrt(off @ (found.problem.stiffness @ off)))
        moved = exact_distance(problem, field.full(field.restrict(found.displacement) + off), constants)
        assert moved.distance > error


@pytest.mark.parametrize("space", [False, True])
@pytest.mark.parametrize("order", [1, 2])
def test_the_stress_works_like_the_loads_and_the_contact_force_on_the_jump(space: bool, order: int) -> None:
    if space and order == 2:
        pytest.skip("linear elements in 3D")
    mesh = hv.box((1.0, 1.0, 1.0), 2) if space else shaken(hv.rectangle((1.0, 1.0), (3, 4)), 3)
    extra = (0.02,) * (mesh.dim - 1)
    problem = two(
        opened(mesh, 0.5), (1.0, 30.0), contact(0, hv.Signorini(), hv.Tresca(0.01)), order=order,
        supports={"bottom": hv.mechanics.Clamped(), "top": hv.Prescribed((*extra, -0.05))}, body_force=(*extra, -0.1),
    )  # fmt: skip
    data = body_data(problem, hv.solve(problem).displacement)
    traces, constants = contact_traces(data), guaranteed_trace_bounds(hv.discretize(problem))
    stresses: list[AdmissibleStress] = [
        improved_stress(data, traces, constants, Sweeps(sweeps))
        for sweeps in ((), (PatchKind.FACET,), (PatchKind.EDGE, PatchKind.VERTEX))
    ]
    for stress in stresses:
        assert max(imbalance(stress, seed) for seed in range(3)) < 1e-12
    misfits = [stress.misfit.sum() for stress in stresses]
    assert misfits[0] > misfits[1] > misfits[2]
    before, after = (stress.tractions.moments[data.contact >= 0] for stress in (stresses[0], stresses[2]))
    assert np.abs(before - after).max() > 1e-3 * np.abs(before).max()  # tractions between the bodies are swept, too


def test_the_constant_of_the_jump_is_that_of_springs_in_series() -> None:
    """Each part is a column of stiffness E / h for uniform tractions, and stiffer for others."""
    mesh = opened(hv.rectangle((0.25, 1.0), (1, 4)), 0.25)
    material = hv.Material.by_region({"part0": hv.Material.young(2.0, 0.0), "part1": hv.Material.young(5.0, 0.0)})
    sides = {"left": hv.mechanics.Roller(), "right": hv.mechanics.Roller()}
    problem = two(mesh, (2.0, 5.0), contact(0, hv.Compliance(1.0)))
    problem = replace(problem, material=material, supports={**problem.supports, **sides})
    found = lower_bounds(problem)
    exact = 1.0 / (0.75 / 2.0 + 0.25 / 5.0)
    assert found.normal.lower <= exact < 1.01 * found.normal.lower
    assert exact < 2.0 / 0.75  # of the upper part alone


def test_three_bodies_and_a_middle_one_that_floats() -> None:
    mesh = opened(hv.rectangle((1.0, 1.5), (3, 6)), 1.0, 0.5)
    pairs = {**contact(0, hv.Compliance(20.0), hv.Tresca(0.02)), **contact(1, hv.Signorini(), hv.Tresca(0.05))}  # type: ignore[dict-item]
    material = hv.Material.by_region({f"part{k}": hv.Material.young(E, 0.3) for k, E in enumerate((10.0, 3.0, 30.0))})
    down = {"bottom": hv.mechanics.Clamped(), "top": hv.Prescribed((0.02, -0.03))}
    for held in ({}, {"left": hv.mechanics.Roller()}, {"left": hv.mechanics.Clamped()}):
        supports = {**down, **held} if not held else {**down, "top": hv.Fixed(y=-0.03), **held}
        if "left" in held and isinstance(held["left"], hv.mechanics.Clamped):
            supports = {"bottom": hv.mechanics.Clamped(), "left": hv.mechanics.Clamped()}
        weight = (0.0, -0.3) if held else (0.0, 0.0)  # a body between others needs no load of its own
        problem = hv.ContactProblem(mesh, material, pairs, supports, body_force=weight)
        found = hv.solve(problem)
        exact = hv.certify(found, exact=True).exact
        assert exact is not None
        assert exact.guaranteed, exact.reasons
        error = error_on_refined(found, 3)
        assert error < exact.bound < 2.5 * error
        assert bool(exact.unseen) == (not isinstance(held.get("left"), hv.mechanics.Clamped))


@pytest.mark.parametrize("order", [1, 2])
def test_a_body_that_another_one_holds(order: int) -> None:
    for law in (hv.Compliance(40.0), hv.Signorini()):
        problem = two(
            opened(hv.rectangle((1.0, 1.0), (3, 4)), 0.5), (10.0, 3.0), contact(0, law, hv.Tresca(0.02)),
            supports={"bottom": hv.mechanics.Clamped(), "top": hv.Fixed(x=0.0)}, tractions={"top": (0.0, -0.3)},
            order=order,
        )  # fmt: skip
        found = hv.solve(problem)
        exact = hv.certify(found, exact=True).exact
        assert exact is not None
        assert exact.guaranteed
        assert exact.unseen
        error = error_on_refined(found, 4 - order)
        assert error < exact.bound < 1.5 * error


def test_a_bound_in_space() -> None:
    problem = two(
        opened(hv.box((1.0, 1.0, 1.0), 2), 0.5), (10.0, 0.1), contact(0, hv.Signorini(), hv.Tresca(0.001)),
        supports={"bottom": hv.mechanics.Clamped(), "top": hv.Prescribed((0.02, 0.01, -0.04))},
    )  # fmt: skip
    found, exact = solved_and_bounded(problem)
    assert exact.guaranteed
    error = error_on_refined(found, 2)
    assert error < exact.distance < 3.0 * error


def test_what_has_no_bound_keeps_its_estimate() -> None:
    """Facets that do not coincide, and Coulomb's friction; each is said."""
    assert joined_sides(bowl_between("rigid")) is None
    problem = two(
        opened(hv.rectangle((1.0, 1.0), (3, 4)), 0.5), (10.0, 3.0), contact(0, hv.Signorini(), hv.Coulomb(0.3)),
        supports={"bottom": hv.mechanics.Clamped(), "top": hv.Prescribed((0.01, -0.03))},
    )  # fmt: skip
    found = hv.solve(problem)
    exact = hv.certify(found, exact=True).exact
    assert exact is not None
    assert not exact.guaranteed
    assert "depends on the pressure" in exact.why
    assert 1.0 < exact.bound / error_on_refined(found, 3) < 1.7


@pytest.mark.parametrize("order", [1, 2])
def test_the_side_with_the_contact_points_does_not_matter(order: int) -> None:
    found = [
        solved_and_bounded(
            two(
                opened(hv.rectangle((1.0, 1.0), (4, 4)), 0.5), (100.0, 1.0), contact(0, hv.Signorini(), slave=side),
                supports={"bottom": hv.mechanics.Clamped(), "top": hv.Prescribed((0.02, -0.03))},
                body_force=(0.0, -0.1), order=order,
            )
        )
        for side in ("joint0:part0", "joint0:part1")
    ]  # fmt: skip
    assert found[0][1].distance == pytest.approx(found[1][1].distance, rel=1e-6)
    assert found[0][1].distance < 1.6 * error_on_refined(
        found[0][0], 3 - order
    )  # the softer body gives way between its nodes


def test_what_one_side_cannot_give_way_the_other_one_does() -> None:
    """A held node of the side with the contact points has none, and the other body penetrates there."""
    mesh = opened(hv.rectangle((1.0, 1.0), (4, 4)), 0.5)
    left = mesh.boundaries["left"]
    above = mesh.points[left].mean(axis=1)[:, 1] > 0.5
    mesh = mesh.with_boundaries({**mesh.boundaries, "left": left[above], "free": left[~above]})
    problem = two(
        mesh, (10.0, 3.0), contact(0, hv.Signorini(), slave="joint0:part0"), body_force=(0.0, 0.5),
        supports={"bottom": hv.mechanics.Clamped(), "left": hv.mechanics.Clamped()},
    )  # fmt: skip
    found, exact = solved_and_bounded(problem)
    traces = contact_traces(body_data(problem, found.displacement))
    assert traces is not None
    assert traces.beyond > 1e-4
    assert exact.guaranteed, exact.reasons
    assert exact.parts.correction > 0.0
    error = error_on_refined(found, 3)
    assert error < exact.distance < 3.0 * error


def test_any_displacement_has_a_stress_where_the_rest_is_a_load() -> None:
    mesh = shaken(hv.rectangle((1.0, 1.0), (3, 4)), 2)
    for order in (1, 2):
        problem = two(opened(mesh, 0.5), (1.0, 3.0), contact(0, hv.Compliance(1.0)), order=order)
        u = np.random.default_rng(5).normal(size=problem.mesh.nodes(order).shape)
        data = body_data(problem, u)
        stress = replace(admissible_stress(data.under(contact_moments(data))), data=data)
        assert np.abs(stress.tractions.defect).max() > 1e-3
        assert imbalance(stress, 1, order=1) < 1e-12


def test_what_tractions_miss_counts_on_both_sides() -> None:
    """Of a quadratic multiplier the cells on both sides see what is no polynomial of degree 1, each by its constant."""
    problem = two(opened(hv.rectangle((1.0, 1.0), (2, 2)), 0.5), (1.0, 100.0), contact(0, hv.Compliance(1.0)))
    data = body_data(problem, np.zeros(problem.mesh.points.shape))
    traces = contact_traces(data)
    assert traces is not None
    along = traces.barycentric[..., :1] * np.ones(2)
    missed = _missed(traces, along**2)
    first, second = data.table.owners[traces.facets].T
    assert missed[first].min() > 0.0
    np.testing.assert_allclose(missed[first], 10.0 * missed[second], rtol=1e-10)
    assert np.count_nonzero(missed) == 2 * len(traces.facets)
    np.testing.assert_array_equal(_missed(traces, along), 0.0)


@pytest.mark.parametrize("space", [False, True])
def test_adaptive_meshes_stay_the_same_on_both_sides(space: bool) -> None:
    mesh = hv.box((1.0, 1.0, 1.0), 2) if space else hv.rectangle((1.0, 1.0), (4, 4))
    down = (*(0.02,) * (mesh.dim - 1), -0.03)
    problem = two(
        opened(mesh, 0.5), (100.0, 1.0), contact(0, hv.Signorini(), hv.Tresca(0.05)),
        supports={"bottom": hv.mechanics.Clamped(), "top": hv.Prescribed(down)},
    )  # fmt: skip
    found = solve_adaptive(problem, rtol=1e-6 if space else 0.08, max_unknowns=400 if space else 2000)
    sizes = [level.distance.relative for level in found.levels]
    assert len(sizes) > 2
    assert all(level.distance.guaranteed for level in found.levels)
    assert all(after < before for before, after in pairwise(sizes))


def test_constants_of_the_mesh_weigh_the_side_with_the_contact_points() -> None:
    """Whichever side the contact is named after."""
    found = []
    for side in ("joint0:part0", "joint0:part1"):
        problem = two(
            opened(hv.rectangle((1.0, 1.0), (4, 4)), 0.5), (2.0, 5.0), contact(0, hv.Compliance(1.0), slave=side)
        )
        corners = problem.mesh.points[problem.mesh.boundaries[side]]
        weights = np.full(len(corners), 0.7)
        constants = discrete_trace_bounds(hv.discretize(problem))
        assert constants.weighted is not None
        found.append(constants.weighted(corners, weights, weights)[0])
        assert found[-1] == pytest.approx(0.7 / constants.both, rel=1e-6)
    assert found[0] == pytest.approx(found[1], rel=1e-9)
