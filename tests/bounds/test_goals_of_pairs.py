"""Quantities of interest of bodies that touch along facets that coincide; of others they are refused."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import hemivar as hv
from hemivar.basics.types import Array
from hemivar.bounds import goal_named
from hemivar.bounds.exact_distance import exact_distance
from hemivar.bounds.goal_values import GoalValue, goal_value
from hemivar.bounds.goals import known_goals
from hemivar.bounds.trace_bounds import body_constants
from hemivar.errors import ProblemError
from hemivar.systems.workspace import Workspace
from tests.bounds.test_joined_bodies import contact, opened, random_joint, two
from tests.samples import sampled


def goals(problem: hv.ContactProblem, names: list[str]) -> list[GoalValue]:
    solution = hv.solve(problem).raise_for_status()
    known = body_constants(solution.problem, Workspace())
    distance = exact_distance(problem, solution.displacement, known)
    return [goal_value(goal_named(problem, name), solution, distance, known) for name in names]


def value_of_goal(solution: hv.Solution, name: str) -> Array:
    """The value of a goal in a solution."""
    kind, rest = name.split(".", 1)
    boundary = rest.rpartition(".")[0]
    if kind == "boundary":
        assert solution.problem.field is not None
        mesh = solution.problem.field.mesh
        facets = mesh.boundaries[boundary]
        measures = mesh.facet_normals(facets)[1]
        return np.asarray(measures @ solution.displacement[facets].mean(axis=1) / measures.sum())
    return np.asarray((solution.contact_forces if kind == "contact" else solution.reactions)[boundary])


def goals_with_bounds(problem: hv.ContactProblem) -> list[str]:
    """All but mean displacements of the sides along which bodies touch."""
    return [name for name in known_goals(problem) if not name.startswith("boundary.joint")]


@pytest.mark.parametrize("seed", sampled(range(24), 6))
def test_intervals_hold_what_fine_meshes_say(seed: int) -> None:
    """Distorted meshes, moduli up to 1 to 1000, laws that soften, contact points on either side."""
    problem = replace(random_joint(seed), order=1)
    finer = hv.solve(replace(problem, mesh=problem.mesh.refined(3))).raise_for_status()
    names = goals_with_bounds(problem)
    for name, found in zip(names, goals(problem, names), strict=True):
        value, rounding = value_of_goal(finer, name), 1e-12
        assert found.guaranteed, found.reasons
        assert (found.lower - rounding <= value).all(), name
        assert (value <= found.upper + rounding).all(), name


def stack(n: int, *, tall: bool = False) -> hv.ContactProblem:
    """Two blocks, or three of which the one in the middle is held by a roller and its neighbours."""
    mesh = opened(hv.rectangle((1.0, 1.0), (2 * n, 6 * n)), *((2 / 3, 1 / 3) if tall else (0.5,)))
    pairs, moduli = contact(0, hv.Compliance(10.0), hv.Tresca(0.02)), (1.0, 3.0)
    supports = {"bottom": hv.mechanics.Clamped(), "top": hv.Prescribed((0.0 if tall else 0.01, -0.03))}
    if tall:
        pairs, moduli = {**pairs, **contact(1, hv.Signorini())}, (*moduli, 2.0)  # type: ignore[dict-item]
        supports["left"] = hv.mechanics.Roller()
    return two(mesh, moduli, pairs, supports=supports)


def test_estimates_are_as_near_as_they_say() -> None:
    """Corners are singular, so that the spread falls by half where that of smooth solutions falls to a fourth."""
    names = ["contact.joint0:part0.force", "boundary.left.displacement", "support.bottom.force"]
    first, second = (goals(stack(n), names) for n in (2, 4))
    finer = hv.solve(stack(16)).raise_for_status()
    for name, coarse, fine in zip(names, first, second, strict=True):
        assert (np.abs(fine.corrected - value_of_goal(finer, name)) <= fine.spread).all(), name
        assert np.linalg.norm(fine.spread) < 0.55 * np.linalg.norm(coarse.spread), name
        assert np.linalg.norm(fine.spread) < 0.15 * np.linalg.norm(fine.upper - fine.lower), name


def test_chains_of_bodies_and_both_sides_of_a_joint() -> None:
    problem = stack(1, tall=True)
    finer = hv.solve(replace(problem, mesh=problem.mesh.refined(3))).raise_for_status()
    names = goals_with_bounds(problem)
    assert {f"contact.joint{k}:part{k + one}.force" for k in (0, 1) for one in (0, 1)} <= set(names)
    for name, found in zip(names, goals(problem, names), strict=True):
        value = value_of_goal(finer, name)
        assert (found.lower <= value + 1e-12).all(), name
        assert (value - 1e-12 <= found.upper).all(), name
        if name.startswith("contact"):
            assert np.isfinite(found.upper[1]), found.reasons


@pytest.mark.parametrize("moduli", [(1.0, 1.0), (1.0, 1000.0)])
def test_the_force_of_columns_in_series_is_known(moduli: tuple[float, float]) -> None:
    k, pull = 2.0, -0.1
    mesh = opened(hv.rectangle((0.25, 1.0), (1, 4)), 0.5)
    material = hv.Material.by_region({f"part{n}": hv.Material.young(E, 0.0) for n, E in enumerate(moduli)})
    supports = {"bottom": hv.mechanics.Clamped(), "top": hv.Prescribed((0.0, pull)),
                "left": hv.mechanics.Roller(), "right": hv.mechanics.Roller()}  # fmt: skip
    problem = replace(two(mesh, moduli, contact(0, hv.Compliance(k)), supports=supports), material=material)
    force = 0.25 * pull / (sum(0.5 / E for E in moduli) + 1.0 / k)
    upper, lower = goals(problem, ["contact.joint0:part0.force.y", "contact.joint0:part1.force.y"])
    for found, exact in ((upper, -force), (lower, force)):
        assert found.guaranteed
        np.testing.assert_allclose([found.lower, found.corrected, found.upper], exact, rtol=1e-6)
        assert found.spread[0] < 1e-6 * abs(force)


def test_an_adaptive_solve_ends_with_the_interval() -> None:
    found = hv.bounds.solve_adaptive(stack(1), goal="contact.joint0:part1.force", rtol=0.3, max_unknowns=6000)
    assert found.reached
    assert found.goal is not None
    assert found.goal.guaranteed


def test_what_has_no_bound_is_refused() -> None:
    problem = stack(1)
    rubs = replace(problem, contact=contact(0, hv.Compliance(10.0), hv.Coulomb(0.3)))
    with pytest.raises(ProblemError, match="bounded where the distance to the exact solution is, and the friction"):
        hv.bounds.solve_adaptive(rubs, goal="contact.joint0:part0.force")
    with pytest.raises(ProblemError, match="bodies touch on 'joint0:part1', where no mean displacement is bounded"):
        hv.bounds.solve_adaptive(problem, goal="boundary.joint0:part1.displacement")
