"""Coulomb's friction on bodies that contact alone holds, on levels and condensed, from wherever they start."""

from __future__ import annotations

import numpy as np
import pytest

import hemivar as hv
from hemivar.basics.types import Array
from hemivar.discrete import DiscreteProblem
from hemivar.laws import ContactLaw, Friction, PenetrationBound
from hemivar.mesh import Mesh
from hemivar.solvers import FixedPoint, NonsmoothMultigrid, SemismoothNewton, Solver, Status
from hemivar.solvers.fallbacks import others
from hemivar.systems.body_on_levels import levels_of, set_up
from hemivar.systems.workspace import Workspace

from .test_sliding_semicoercive import _mesh_on_feet

ON_LEVELS = NonsmoothMultigrid()
FROZEN = FixedPoint(ON_LEVELS)
#: Newton's method on levels, as ``method="multigrid"`` is for such laws.
WHOLE = SemismoothNewton(FROZEN)


def drawn_along(cells: tuple[int, int], unit: float = 1.0) -> DiscreteProblem:
    """A block, 1 by 1/2, that is pressed on its foundation and drawn along it; lengths in some unit."""
    contact = hv.Contact(hv.Signorini(), hv.Coulomb(0.3))
    mesh = hv.rectangle((1.0 * unit, 0.5 * unit), cells)
    return hv.discretize(
        hv.ContactProblem(mesh, hv.Material.young(100.0, 0.3), {"bottom": contact}, tractions={"top": (0.2, -1.0)})
    )


#: Largest slips that the condensed body and an augmented Lagrangian agree on.
SLIPS = {(3, 3): 1.052607e-3, (4, 4): 9.100782e-4, (6, 6): 7.022665e-4, (33, 33): 2.36598e-4}


@pytest.mark.parametrize("unit", [1.0, 1e3])
@pytest.mark.parametrize("cells", SLIPS)
def test_a_block_without_a_coarser_mesh_is_solved_on_levels(cells: tuple[int, int], unit: float) -> None:
    found = hv.solve(drawn_along(cells, unit), WHOLE)
    assert found.status is Status.CONVERGED
    assert found.fallbacks == 0
    assert found.steps <= 6
    assert np.abs(found.slip).max() == pytest.approx(SLIPS[cells] * unit, rel=1e-5)


@pytest.mark.parametrize("method", [WHOLE, FROZEN], ids=lambda method: method.name)
@pytest.mark.parametrize("lift", [0.0, 1.0, -0.01])
def test_it_does_not_matter_where_the_first_iterate_has_contact(lift: float, method: Solver) -> None:
    """From rest, from far above its foundation, and from within it."""
    problem = drawn_along((5, 5))
    start = np.tile([0.0, lift], problem.unknowns // 2)
    found, usual = (hv.solve(problem, method, initial=one) for one in (start, None))
    assert found.status is usual.status is Status.CONVERGED
    np.testing.assert_allclose(found.unknowns, usual.unknowns, atol=1e-8 * np.abs(usual.unknowns).max())


def test_a_free_block_in_space_on_another_body() -> None:
    """Two bodies whose meshes do not match; what presses and draws the upper one reaches the lower one by contact."""
    mesh = Mesh.assembled({
        "u": hv.box((2.0, 2.0, 1.0), (4, 4, 2), origin=(0.5, 0.5, 0.0)),
        "l": hv.box((3.0, 3.0, 1.0), (5, 5, 2), origin=(0.0, 0.0, -1.0)),
    })  # fmt: skip
    contact = hv.Contact(hv.Signorini(), hv.Coulomb(0.3), against="l:top")
    problem = hv.discretize(
        hv.ContactProblem(
            mesh, hv.Material.young(1e3, 0.3), {"u:bottom": contact}, {"l:bottom": hv.Clamped()},
            tractions={"u:top": (0.1, 0.05, -1.0)},
        )
    )  # fmt: skip
    found, reference = (hv.solve(problem, method) for method in ("multigrid", "newton"))
    assert found.status is reference.status is Status.CONVERGED
    assert found.method == "semismooth-multigrid"
    assert found.energy < 0.0
    np.testing.assert_allclose(found.unknowns, reference.unknowns, atol=1e-7 * np.abs(reference.unknowns).max())


def random_feet(number: int) -> DiscreteProblem | None:
    """A body on feet, perhaps beside a wall, with gaps or none; None where nothing holds it."""
    rng = np.random.default_rng([77, number])
    space = bool(rng.random() < 0.4)
    mesh = _mesh_on_feet(rng, space)
    size = float(np.ptp(mesh.points[:, 0]))
    feet = [("left foot", "right foot"), ("left foot",), ("left foot", "right foot", "wall")][rng.integers(3)]
    contact = {}
    for foot in feet:
        stiffness = float(10.0 ** rng.uniform(1.0, 5.0))
        law = (hv.Signorini(), hv.Signorini(), hv.Compliance(stiffness), hv.Softening(1e3, 0.01, 50.0))[rng.integers(4)]
        friction, even = hv.Coulomb(float(rng.uniform(0.1, 0.8))), float(rng.uniform(0.0, 0.02)) * size
        gap = (0.0, even, lambda x: (x[:, 0] - 0.3 * size) ** 2 / (20.0 * size))[rng.integers(3)]
        contact[foot] = hv.Contact(law, friction, gap=gap)
    supports = {"back": hv.Fixed(y=0.0)} if space and rng.random() < 0.5 else {}
    supports |= {"end": hv.Fixed(x=0.0)} if rng.random() < 0.2 else {}
    pull = rng.normal(size=3 if space else 2) * 0.1
    pull[-1] -= 1.0
    material = hv.Material.young(float(10.0 ** rng.uniform(2.0, 5.0)), 0.3)
    alone = Mesh(mesh.points, mesh.cells, dict(mesh.boundaries))
    try:
        return hv.discretize(hv.ContactProblem(alone, material, contact, supports, tractions={"roof": tuple(pull)}))
    except hv.HemivarError:
        return None


def agree(numbers: range | tuple[int, ...]) -> int:
    """Random bodies on which both ways to Newton's equation agree; how many there were."""
    seen = 0
    for number in numbers:
        problem = random_feet(number)
        if problem is None or problem.limit is not None:
            continue
        found, reference = (hv.solve(problem, method, max_time=60.0) for method in ("multigrid", "newton"))
        assert found.status is reference.status is Status.CONVERGED, f"{number}: {found.status}, {reference.status}"
        assert found.energy <= max(found.history[0].energy, 0.0)
        size = np.abs(reference.unknowns).max()
        np.testing.assert_allclose(found.unknowns, reference.unknowns, atol=1e-6 * size, err_msg=str(number))
        seen += 1
    return seen


def test_random_bodies_are_solved_on_levels_as_condensed() -> None:
    """Some are lost where a bound is only frozen at the first pressures, which hold nothing; in the fourth |F| is
    rounding while a pair still misses its law by more than the tolerance."""
    assert agree((2, 7, 19, 80, 191, 206)) == 6


@pytest.mark.slow
@pytest.mark.parametrize("block", range(4))
def test_many_random_bodies_are_solved_on_levels_as_condensed(block: int) -> None:
    assert agree(range(60 * block, 60 * (block + 1))) >= 20


def test_levels_are_given_back_once() -> None:
    problem, workspace = drawn_along((4, 4)), Workspace()
    matrix = set_up(problem, workspace).truncation()
    matrix.release()
    matrix.release()
    assert len(levels_of(problem, workspace).levels._idle) == 1  # two solves would change the same ones


def test_a_body_that_friction_lost_on_levels_is_condensed_next() -> None:
    assert next(iter(others(WHOLE, Status.UNBOUNDED, drawn_along((4, 4))))).condenses


# ---- bounds of glue ----------------------------------------------------------------------------------------

GLUED = [  # stiffness, load, (strength, softening, compression), bounds at penetrations 0 and 0.2
    ([[1.76, -0.32], [-0.32, 0.28]], [0.04, 0.9], (0.85, 0.58, 6.9), (0.13, 4.09)),
    ([[1.19, -1.49], [-1.49, 2.57]], [-0.46, 1.38], (0.46, 0.63, 9.58), (0.05, 16.63)),
]


@pytest.mark.parametrize(("stiffness", "load", "glue", "bounds"), GLUED)
def test_the_default_follows_a_bound_beside_glue(
    stiffness: list[list[float]],
    load: list[float],
    glue: tuple[float, float, float],
    bounds: tuple[float, float],
) -> None:
    """One point that is pressed in and slips ahead: two linear equations, which a fixed point does not contract to."""
    strength, softening, compression = glue
    law = hv.Adhesive(2.0, strength, softening=softening, compression=compression)
    bound = PenetrationBound([[0.0, 0.2, 0.5], [*bounds, 2.0 * bounds[1]]])
    K: Array = np.array(stiffness)
    problem = DiscreteProblem.of_arrays(
        K, np.array(load), np.eye(2), np.ones(1), np.zeros(1),
        ContactLaw(law, Friction(bound, hv.Tresca(1.0).profile)).at(None),
    )  # fmt: skip
    slope = (bounds[1] - bounds[0]) / 0.2
    pressed = np.array([[compression, 0.0], [slope, 0.0]])
    right = np.linalg.solve(K + pressed, np.array(load) - np.array([0.0, bounds[0]]))
    assert 0.0 < right[0] < 0.2
    assert right[1] > 0.0
    found = hv.solve(problem)
    assert found.status is Status.CONVERGED
    np.testing.assert_allclose(found.unknowns, right, rtol=1e-9)
