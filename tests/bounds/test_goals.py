"""Quantities of interest: intervals hold what fine meshes say, estimates are of second order, names are refused."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import hemivar as hv
from hemivar.basics.rounding import rounded_up
from hemivar.basics.types import Array
from hemivar.bounds import exact_distance, goal_named
from hemivar.bounds.functionals import functionals
from hemivar.bounds.goal_values import GoalValue, goal_value
from hemivar.bounds.goals import known_goals
from hemivar.bounds.trace_bounds import TraceBounds, body_constants, discrete_trace_bounds
from hemivar.errors import ProblemError
from hemivar.formula import Formula
from hemivar.gallery import survey
from hemivar.gallery.known import weighted_block
from hemivar.mesh import rectangle
from tests import bodies

NAMES = ("contact.bottom.force", "support.left.force", "boundary.right.displacement", "boundary.bottom.displacement")


def threshold_square(n: int = 4, **changes: object) -> hv.ContactProblem:
    given: dict[str, Any] = {
        "mesh": rectangle((1.0, 1.0), n, pattern="cross"),
        "contact": hv.Contact(hv.laws.ThresholdCompliance(0.3, 2.0), hv.Tresca(0.5)),
        "body_force": (-0.8, -0.8),
    }
    return bodies.body(**given | changes)


_KNOWN: dict[str, TraceBounds] = {}


def constants_of(problem: hv.ContactProblem) -> TraceBounds:
    """Those of the body, which meshes and laws do not change."""
    key = f"{problem.supports} {problem.material} {list(problem.contact)} {np.ptp(problem.mesh.points, axis=0)}"
    if key not in _KNOWN:
        _KNOWN[key] = body_constants(hv.discretize(problem), hv.systems.Workspace())
    return _KNOWN[key]


def valued(problem: hv.ContactProblem, *names: str, constants: TraceBounds | None = None) -> list[GoalValue]:
    solution = hv.solve(problem).raise_for_status()
    known = constants_of(problem) if constants is None else constants
    distance = exact_distance(problem, solution.displacement, known)
    return [goal_value(goal_named(problem, name), solution, distance, known) for name in names]


def as_if_proved(problem: hv.ContactProblem) -> TraceBounds:
    """Constants of the discrete problem, where it does not matter how large they are."""
    return replace(discrete_trace_bounds(hv.discretize(problem)), guaranteed=True)


def overkill(problem: hv.ContactProblem, names: tuple[str, ...], times: int) -> dict[str, Array]:
    """The quantities on a much finer mesh, from nodal forces and displacements alone.

    The force of the contact facet whose node is held there counts with its neighbour's traction."""
    fine = replace(problem, mesh=problem.mesh.refined(times))
    solution = hv.solve(fine).raise_for_status()
    mesh, on = fine.mesh, solution.on("bottom")
    missing = mesh.facet_normals(mesh.boundaries["bottom"])[1].sum() - on.contact.weights.sum()
    nearest = int(np.argmin(on.contact.points[:, 0]))  # type: ignore[index]
    end = -missing * on.contact.global_vectors(on.multiplier)[nearest]
    found = {}
    for name in names:
        kind, boundary, _ = name.split(".")
        if kind == "contact":
            found[name] = on.force + end
        elif kind == "support":
            found[name] = solution.reactions[boundary] - end
        else:
            facets = mesh.boundaries[boundary]
            _, measures = mesh.facet_normals(facets)
            means = solution.displacement[facets].mean(axis=1)
            found[name] = (measures[:, None] * means).sum(axis=0) / measures.sum()
    return found


def some_laws(count: int) -> list[hv.Contact]:
    rng = np.random.default_rng(4)

    def normal() -> hv.laws.Superpotential:
        return (
            hv.laws.ThresholdCompliance(rng.uniform(0.0, 0.5), rng.uniform(0.5, 4.0)),
            hv.Compliance(rng.uniform(1.0, 20.0)),
        )[rng.integers(2)]

    frictions = (
        lambda: hv.Tresca(rng.uniform(0.05, 0.5)),
        hv.laws.NoFriction,
        lambda: hv.SlipWeakening(0.1, 1.0, 0.5, 20.0),
        lambda: hv.Tresca(hv.laws.PenetrationBound("min(0.4*s, 0.2)", 0.4)),
    )
    return [hv.Contact(normal(), frictions[k % 4](), gap=float(rng.choice([0.0, 0.01]))) for k in range(count)]


def check_intervals(laws: list[hv.Contact], names: tuple[str, ...], times: int, seed: int) -> None:
    loads = np.random.default_rng(seed)
    right = 0
    for law in laws:
        problem = threshold_square(contact={"bottom": law}, body_force=tuple(loads.uniform(-1.0, 0.5, 2)))
        fine = overkill(problem, names, times)
        for name, found in zip(names, valued(problem, *names), strict=True):
            assert found.guaranteed, found.reasons
            assert np.isfinite(found.upper - found.lower).all()
            assert (found.lower <= fine[name]).all(), name
            assert (fine[name] <= found.upper).all(), name
            right += int((np.abs(found.corrected - fine[name]) <= found.spread + 1e-8).sum())
    assert right >= 0.9 * 2 * len(names) * len(laws)  # estimates


def test_intervals_hold_values_of_a_finer_mesh() -> None:
    check_intervals(some_laws(4)[::3], NAMES[:3], 3, 9)


@pytest.mark.slow
def test_intervals_hold_values_of_a_much_finer_mesh() -> None:
    check_intervals(some_laws(12), NAMES, 4, 10)


def test_second_order() -> None:
    """The corrected value is off by its spread at most, which falls like h^2; the interval like h."""
    fine = overkill(threshold_square(), NAMES, 4)
    name = "boundary.right.displacement"
    coarse, finer = (valued(threshold_square(n), name)[0] for n in (4, 12))
    for found in (coarse, finer):
        assert (np.abs(found.corrected - fine[name]) <= found.spread).all()
    assert (finer.spread < coarse.spread / 5.0).all()  # 9 without the corners of the body
    assert (finer.upper - finer.lower > (coarse.upper - coarse.lower) / 3.5).all()
    # nearer than the mesh itself by far, where the singular end plays no part
    (force,) = valued(threshold_square(8), "contact.bottom.force")
    off, own = (np.abs(value - fine["contact.bottom.force"]) for value in (force.corrected, force.computed))
    assert off[0] < own[0] / 3.0
    assert off[1] < own[1] / 30.0


@pytest.mark.parametrize("n", [2, 4])
def test_block_under_its_weight(n: int) -> None:
    """The force of the foundation is known; walls without friction leave the whole contact boundary to it."""
    known = weighted_block(n=n)
    exact = float(known.pressure(np.array([[0.5, 0.0]]))[0])
    (found,) = valued(known.problem, "contact.bottom.force.y")
    assert found.guaranteed
    assert found.computed == pytest.approx(hv.solve(known.problem).on("bottom").force[1])
    assert found.lower[0] <= exact <= found.upper[0]
    assert found.corrected[0] == pytest.approx(exact, abs=found.spread[0] + 1e-9)


def test_a_patch_is_exact() -> None:
    """A linear displacement is reproduced: intervals are points, up to rounding."""
    known = weighted_block(n=3, top_displacement=0.1)
    names = ("contact.bottom.force.y", "support.top.force.y", "boundary.left.displacement.y")
    values = valued(known.problem, *names, constants=as_if_proved(known.problem))
    for found in values:
        assert found.upper[0] - found.lower[0] < 1e-9
        assert found.corrected[0] == pytest.approx(found.computed[0], abs=1e-9)
    force, reaction = (found.computed[0] for found in values[:2])
    assert force == pytest.approx(-reaction)
    modulus, q, p = 12.0, 0.3, 2.0
    s = (modulus * 0.1 - q) / (modulus + p)
    assert force == pytest.approx(q + p * s)


def test_without_contact_the_estimate_is_the_hypercircle() -> None:
    """A linear problem: the second-order interval holds the value of a fine mesh, too."""
    problem = threshold_square(contact={}, body_force=(0.0, -0.1))
    fine = hv.solve(replace(problem, mesh=problem.mesh.refined(5)))
    facets = fine.problem.field.mesh.boundaries["right"]  # type: ignore[union-attr]
    mean = fine.displacement[facets].mean(axis=(0, 1))
    found, reaction = valued(problem, "boundary.right.displacement", "support.left.force.y")
    assert found.guaranteed
    assert (np.abs(found.corrected - mean) <= found.spread).all()
    assert (found.lower <= mean).all()
    assert (mean <= found.upper).all()
    assert reaction.computed[0] == pytest.approx(0.1)


def test_where_nothing_bounds_a_force() -> None:
    rigid = threshold_square(contact={"bottom": hv.Contact(hv.Signorini())})
    (found,) = valued(rigid, "contact.bottom.force")
    assert not found.guaranteed
    assert found.upper[1] == np.inf
    assert any("does not bound the force there" in reason for reason in found.reasons)
    assert "no known bounds" in " ".join(found.lines())
    assert np.isfinite(found.corrected).all()
    assert found.record()["upper"][1] is None  # type: ignore[index]

    two = threshold_square(supports={"left": hv.Clamped(), "top": hv.Clamped()})
    (found,) = valued(two, "support.left.force", constants=as_if_proved(two))
    assert not found.guaranteed
    assert any("meets another one" in reason for reason in found.reasons)
    assert np.isinf(found.upper).all()

    held = threshold_square(supports={"left": hv.Clamped(), "bottom": hv.Fixed(x=0.0)})
    across, along = valued(held, "contact.bottom.force.y", "contact.bottom.force.x", constants=as_if_proved(held))
    assert across.guaranteed
    assert any("where force of both is one" in reason for reason in along.reasons)
    assert np.isinf(along.upper).all()


def test_an_estimated_distance_gives_an_estimated_interval() -> None:
    contact = hv.Contact(
        hv.laws.ThresholdCompliance(0.3, 2.0), hv.Tresca(0.5), gap=lambda x: 0.01 * np.sin(9.0 * x[:, 0])
    )
    (found,) = valued(threshold_square(contact={"bottom": contact}), "contact.bottom.force.y")
    assert not found.guaranteed
    assert any("gap of contact 'bottom' varies" in reason for reason in found.reasons)
    assert "not a bound" in found.lines()[0]


def test_fields_of_least_energy_have_the_trace_that_is_asked_for() -> None:
    problem = threshold_square()
    solution = hv.solve(problem)
    data = exact_distance(problem, solution.displacement, constants_of(problem)).stress.data
    (part,) = functionals(goal_named(problem, "contact.bottom.force.x"), data, solution.problem)
    points = problem.mesh.points
    below = (points[:, 1] == 0.0) & (points[:, 0] > 0.0)
    np.testing.assert_allclose(part.field[below], [[1.0, 0.0]] * below.sum(), atol=1e-12)
    np.testing.assert_allclose(part.field[points[:, 0] == 0.0], 0.0, atol=1e-12)
    assert np.count_nonzero(part.rest.any(axis=(1, 2))) == 1  # the facet at the clamped end


def test_what_the_field_misses_at_the_clamped_end_is_bounded_by_the_law() -> None:
    """Without distance an interval is as long as friction of 0.5 on the last facet, where w falls from 1 to 0."""
    problem = threshold_square()
    solution, known = hv.solve(problem), as_if_proved(threshold_square())
    distance = replace(exact_distance(problem, solution.displacement, known), distance=0.0)
    along = goal_value(goal_named(problem, "contact.bottom.force.x"), solution, distance, known)
    assert along.upper[0] - along.lower[0] == pytest.approx(2.0 * 0.5 * 0.25 / 2.0)
    across = goal_value(goal_named(problem, "contact.bottom.force.y"), solution, distance, known)
    deepest = np.abs(solution.on("bottom").penetration[0])
    least, most = (2.0 * 0.125 * (0.3 + 2.0 * r) for r in (0.0, deepest))
    assert least < across.upper[0] - across.lower[0] < most


def test_what_grows_with_the_same_part_of_the_error_adds_up() -> None:
    """Normal force and a friction bound both grow with the penetration: on a side at 45 degrees both count in full."""
    stiffness, rate = 3.0, 0.7
    friction = hv.Tresca(hv.laws.PenetrationBound(f"min({rate}*s, 0.2)", rate))
    problem = threshold_square(
        mesh=rectangle((1.0, 1.0), 4, pattern="cross").rotated(np.pi / 4.0),
        contact={"bottom": hv.Contact(hv.Compliance(stiffness), friction)},
    )
    solution, known = hv.solve(problem), as_if_proved(problem)
    near = exact_distance(problem, solution.displacement, known)
    goal = goal_named(problem, "contact.bottom.force.x")
    (part,) = functionals(goal, near.stress.data, solution.problem)
    gradient = np.einsum("mai,maj->mij", part.field[near.stress.data.table.cells], near.stress.data.table.gradients)
    strain = 0.5 * (gradient + gradient.transpose(0, 2, 1))
    stress = 8.0 * strain + 4.0 * np.einsum("mii,jk->mjk", strain, np.eye(2))
    size = np.sqrt(np.einsum("m,mij,mij->", problem.mesh.volumes, strain, stress))
    halves = []
    for distance in (0.0, 1.0):
        found = goal_value(goal, solution, replace(near, distance=distance), known)
        halves.append(0.5 * (found.upper[0] - found.lower[0]))
    # on the last facet, of length 1/4, the field falls linearly to zero
    missed = np.sqrt((stiffness + rate) ** 2 / 2.0 * 0.25 / 3.0 / known.both)
    assert halves[1] - halves[0] == pytest.approx(size + missed, rel=1e-6)


def test_units_do_not_matter() -> None:
    """Lengths in mm, stresses in MPa instead of m and Pa: forces per depth change as they must."""
    (small,) = valued(threshold_square(), "contact.bottom.force", constants=as_if_proved(threshold_square()))
    law = hv.Contact(hv.laws.ThresholdCompliance(0.3e-6, 2.0e-9), hv.Tresca(0.5e-6))
    problem = threshold_square(
        mesh=rectangle((1e3, 1e3), 4, pattern="cross"), material=hv.Material.lame(4e-6, 4e-6),
        contact={"bottom": law}, body_force=(-0.8e-9, -0.8e-9),
    )  # fmt: skip
    (other,) = valued(problem, "contact.bottom.force", constants=as_if_proved(problem))
    for name in ("computed", "lower", "upper", "corrected", "spread"):
        np.testing.assert_allclose(1e3 * getattr(other, name), getattr(small, name), rtol=1e-6)


def test_names() -> None:
    problem = survey("5.1", 4)
    for name in known_goals(problem):
        assert goal_named(problem, name).name == name
        assert goal_named(problem, f"{name}.y").labels == ("y",)
    with pytest.raises(ProblemError, match=r"did you mean 'contact.bottom.force'.*known: contact.bottom.force, supp"):
        goal_named(problem, "contact.botom.force")
    with pytest.raises(ProblemError, match=r"goal \'contact\.bottom\.force\.z\' is not known"):
        goal_named(problem, "contact.bottom.force.z")
    with pytest.raises(ProblemError, match="name it as in"):
        goal_named(problem, 3)  # type: ignore[arg-type]
    with pytest.raises(ProblemError, match="is not known"):
        hv.bounds.solve_adaptive(problem, goal="pressure")
    dotted = replace(
        problem, mesh=problem.mesh.named({**problem.mesh.boundaries, "a.force.x": problem.mesh.boundaries["top"]}, {})
    )
    assert goal_named(dotted, "boundary.a.force.x.displacement.x").boundary == "a.force.x"


@pytest.mark.slow
def test_a_goal_decides_where_the_mesh_is_fine() -> None:
    """For the mean displacement of the right side few cells are spent where the energy needs them; the estimate is met
    with fewer unknowns than by bounding the whole solution."""
    found = hv.bounds.solve_adaptive(
        threshold_square(), goal="boundary.right.displacement", rtol=0.03, max_unknowns=2000
    )
    assert found.ended == "estimated"
    assert not found.reached
    assert found.goal is not None
    assert found.goal.relative > 0.03
    assert f"within {rounded_up(100.0 * found.goal.relative, 2)} % of the value; within 3 % takes" in found.remedy
    fine = overkill(threshold_square(), ("boundary.right.displacement",), 4)["boundary.right.displacement"]
    assert np.linalg.norm(found.goal.corrected - fine) < 0.03 * np.linalg.norm(fine)
    assert (found.goal.lower <= fine).all()
    assert (fine <= found.goal.upper).all()
    rows = found.rows()
    assert rows[-1]["corrected_x"] == found.goal.corrected[0]
    assert found.record()["goal"]["goal"] == "boundary.right.displacement"


def test_a_goal_ends_with_the_guaranteed_interval() -> None:
    """The estimate is as asked meshes before; where a limit lies between, the end says how wide the interval is."""
    options = {"goal": "contact.bottom.force", "rtol": 0.2}
    found = hv.bounds.solve_adaptive(threshold_square(), **options)
    assert found.ended == "reached"
    assert found.goal is not None
    assert found.goal.guaranteed
    assert found.goal.relative <= 0.2
    early = next(level for level in found.levels if level.estimated(0.2))
    assert early.goal is not None
    assert early.goal.relative > 0.3
    last = found.levels[-1].unknowns
    assert 0.3 * last < early.needed(0.2) < 3.0 * last
    for limit in ({"max_unknowns": 120}, {"max_memory": early.unknowns * 2e4}, {"max_time": early.seconds * 1e-3}):
        stopped = hv.bounds.solve_adaptive(threshold_square(), **options, **limit)
        assert not stopped.reached
        assert stopped.goal is not None
        assert (stopped.ended == "estimated") == (stopped.goal.estimated <= 0.2)
        assert stopped.ended != "estimated" or "the guaranteed interval is within" in stopped.remedy


@pytest.mark.slow
def test_a_goal_converges_at_twice_the_rate() -> None:
    found = hv.bounds.solve_adaptive(threshold_square(), goal="contact.bottom.force", rtol=1e-6, max_unknowns=4000)
    assert found.ended == "max_unknowns"
    assert 0.85 < found.rate < 1.2


def test_an_interval_of_a_mean_displacement_counts_what_its_dual_solution_misses() -> None:
    """Half of it is ``B |z|_a``, at least that of the solution z of the unit traction on a mesh eight times finer."""
    problem = threshold_square(2, contact={"bottom": hv.Contact(hv.Compliance(10.0))})
    constants = as_if_proved(problem)
    solution = hv.solve(problem).raise_for_status()
    distance = exact_distance(problem, solution.displacement, constants)
    value = goal_value(goal_named(problem, "boundary.right.displacement"), solution, distance, constants)
    pulled = replace(problem, mesh=problem.mesh.refined(3), body_force=(0.0, 0.0), contact={})
    for axis in range(2):
        pull = hv.solve(replace(pulled, tractions={"right": tuple(np.eye(2)[axis])})).raise_for_status()
        size = np.sqrt(-2.0 * pull.energy)  # at the solution the energy is -|z|^2 / 2
        half = 0.5 * float(value.upper[axis] - value.lower[axis])
        assert size <= half / distance.distance <= 1.2 * size


def test_of_a_body_that_contact_holds_forces_are_bounded_and_displacements_are_not() -> None:
    """The foundation bears the whole load; how far a rigid motion takes the top, the energy does not see."""
    problem = hv.ContactProblem(
        rectangle((2.0, 1.0), (8, 4)),
        hv.Material.young(1e3, 0.3),
        {"bottom": hv.Contact(hv.Compliance(500.0), hv.Tresca(0.3), gap=Formula("0.002 * (x - 1)^2"))},
        {},
        tractions={"top": (0.1, -1.0)},
    )
    force, top = valued(problem, "contact.bottom.force", "boundary.top.displacement")
    assert force.guaranteed
    (along, down) = zip(force.lower, force.upper, strict=True)
    assert along[0] <= 0.2 <= along[1] or along[0] <= -0.2 <= along[1]
    assert down[0] <= -2.0 <= down[1] or down[0] <= 2.0 <= down[1]
    assert not top.guaranteed
    assert not np.isfinite(top.upper).any()
    assert any("it changes under rigid motions that only contact restrains" in reason for reason in top.reasons)


def test_adaptive_solves_of_a_body_that_contact_holds_reach_their_bound() -> None:
    contact = {"bottom": hv.Contact(hv.Signorini(), hv.Tresca(0.3), gap=Formula("0.002 * (x - 1)^2"))}
    mesh, material = rectangle((2.0, 1.0), (8, 4)), hv.Material.young(1e3, 0.3)
    found = hv.bounds.solve_adaptive(
        hv.ContactProblem(mesh, material, contact, {}, tractions={"top": (0.1, -1.0)}), rtol=0.1
    )
    assert found.levels[-1].distance.relative <= 0.1
    assert found.levels[-1].distance.guaranteed
    assert found.levels[-1].solution.problem.unknowns < 1500
