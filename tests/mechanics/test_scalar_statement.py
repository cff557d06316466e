"""Scalar statements: what they hold, and what they refuse in words."""

from __future__ import annotations

import copy
import pickle
from typing import Any

import numpy as np
import pytest

import hemivar as hv
from hemivar.mechanics.foundation import Side
from hemivar.mechanics.material_words import ScalarKind
from hemivar.mesh import Mesh

MESH = hv.rectangle((1.0, 1.0), 4)
HALVES = Mesh(MESH.points, MESH.cells, MESH.boundaries, {"low": np.arange(16), "high": np.arange(16, 32)})
STOP = hv.ScalarContact(hv.Signorini(), 0.1)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"mesh": "square"}, "mesh is the text 'square'|mesh is 'square'|mesh is"),
        ({"kind": "plate"}, "choose 'membrane', 'antiplane' or 'heat'"),
        ({"mesh": hv.box((1.0, 1.0, 1.0), 1)}, "needs a plane mesh"),
        ({"order": 3}, "order = 3"),
        ({"coefficient": -1.0}, "the tension is -1; it must be positive"),
        ({"coefficient": np.nan}, "the tension is nan"),
        ({"coefficient": 1e120}, "between 1e-100 and 1e\\+100"),
        ({"coefficient": [1.0, 2.0]}, r"shape \(2,\); on this mesh it is one number or a tensor of shape \(2, 2\)"),
        ({"coefficient": [[1.0, 2.0], [0.0, 1.0]]}, "symmetric and positive definite"),
        ({"coefficient": [[1.0, 2.0], [2.0, 1.0]]}, "symmetric and positive definite"),
        ({"coefficient": {"low": 1.0}}, r"tension names region 'low', which the mesh does not have \(regions: none\)"),
        ({"coefficient": {}}, "empty mapping"),
        ({"mesh": HALVES, "coefficient": {"low": 1.0, "high": -2.0}}, "tension of region 'high' is -2"),
        ({"kind": "heat", "coefficient": 0.0}, "the conductivity is 0"),
        ({"kind": "antiplane", "coefficient": 0.0}, "the shear modulus is 0"),
        ({"supports": {"lft": 0.0}}, "did you mean 'left'"),
        ({"supports": 0.0}, "supports must map boundary names"),
        ({"supports": {"left": (0.0, 1.0)}}, r"supports\['left'\] takes one number or a callable"),
        ({"supports": {"left": np.inf}}, r"supports\['left'\]: inf is not finite"),
        ({"fluxes": {"left": np.nan}}, r"fluxes\['left'\]: nan is not finite"),
        ({"source": (1.0, 2.0)}, "source takes one number"),
        ({"bedding": -1.0}, "bedding = -1; it must not be negative"),
        ({"density": -1.0}, "density = -1; it must not be negative"),
        ({"viscosity": -1.0}, "viscosity = -1; it must not be negative"),
        ({"density": lambda x, t: 1.0 + t}, "density depends on time"),
        ({"density": {"low": 1.0}}, "density names region 'low'"),
        ({"viscosity": {}}, "viscosity is an empty mapping"),
        ({"mesh": HALVES, "density": {"low": 1.0, "high": -2.0}}, "density of region 'high' = -2"),
        ({"capacity": 1.0}, "a capacity stores heat, and this problem is one of kind 'membrane'"),
        ({"kind": "heat", "density": 1.0}, "heat has no inertia"),
        ({"kind": "heat", "viscosity": 1.0}, "heat has no viscosity"),
        ({"kind": "heat", "capacity": -1.0}, "capacity = -1; it must not be negative"),
        ({"contact": {"left": hv.Signorini()}}, r"contact\['left'\] is .*; wrap the law: ScalarContact"),
        ({"contact": {"left": hv.Contact(hv.Signorini(), hv.Tresca(1.0))}}, "contact 'left': .* give one of the two"),
        ({"contact": {"left": hv.Contact(hv.Signorini(), obstacle=hv.Plane((0.0, 0.0), (0.0, 1.0)))}}, "an obstacle"),
        ({"contact": {"left": hv.Contact(hv.Signorini(), belt=(0.0, 1.0))}}, "a belt, which needs directions"),
        (
            {"area": hv.Contact(hv.Compliance(1.0), memory=(hv.laws.Wear(0.1),))},
            "contact 'area': the memory 'wear' needs slip and penetration",
        ),
        (
            {"area": hv.Contact(hv.Adhesive(1.0, 0.1, softening=0.1), memory=(hv.laws.Secant(friction=0.2),))},
            "the memory 'secant' needs slip",
        ),
        (
            {"area": hv.Contact(hv.laws.NoContact(), hv.Tresca(0.1), damping=hv.Compliance(1.0))},
            "with friction has damping, which is of the penetration",
        ),
        ({"area": hv.Signorini()}, "area is .*; give ScalarContact"),
        ({"area": {"low": STOP}}, "area names region 'low'"),
        ({"mesh": HALVES, "area": {"low": hv.Signorini()}}, r"contact\['low'\] is .*; wrap the law"),
        ({"area": STOP, "order": 2}, "whose corner weights vanish; use order = 1"),
        (
            {"contact": {"left": STOP}, "supports": {"left": 0.0}},
            r"is constrained by a prescribed deflection \(support 'left', 4 common facets\)",
        ),
    ],
)
def test_what_a_scalar_statement_refuses(changes: dict[str, Any], words: str) -> None:
    with pytest.raises(hv.errors.ProblemError, match=words):
        hv.ScalarProblem(**{"mesh": MESH, "coefficient": 1.0} | changes)


def test_boundaries_that_share_facets_are_refused() -> None:
    both = Mesh(MESH.points, MESH.cells, dict(MESH.boundaries) | {"again": MESH.boundaries["left"]})
    with pytest.raises(hv.errors.ProblemError, match="'left' and 'again' share 4 facets"):
        hv.ScalarProblem(both, 1.0, contact={"left": STOP, "again": STOP})


def test_a_region_and_a_boundary_of_one_name_are_told_apart() -> None:
    mesh = Mesh(MESH.points, MESH.cells, MESH.boundaries, {"left": np.arange(32)})
    with pytest.raises(hv.errors.ProblemError, match="names 'left', a boundary and a region"):
        hv.ScalarProblem(mesh, 1.0, area={"left": STOP})
    with pytest.raises(hv.errors.ProblemError, match="'left' names a boundary with contact and a region"):
        hv.ScalarProblem(mesh, 1.0, contact={"left": STOP}, area={"left": STOP})


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("signorini",), "give a superpotential such as Signorini"),
        ((hv.Coulomb(0.3),), "depends on penetration or pressure"),
        ((hv.Signorini(), (1.0, 2.0)), "level takes one number"),
        ((hv.Signorini(), np.nan), "level: nan is not finite"),
        ((hv.Signorini(), 0.0, "beside"), "choose 'above' or 'below'"),
    ],
)
def test_what_a_scalar_contact_refuses(arguments: tuple[Any, ...], words: str) -> None:
    with pytest.raises(hv.errors.ProblemError, match=words):
        hv.ScalarContact(*arguments)


def test_coefficients_at_points() -> None:
    points = np.array([[0.1, 0.2], [0.6, 0.9], [0.3, 0.3]])
    one = hv.ScalarProblem(MESH, 3.0)
    np.testing.assert_array_equal(one.material.stiffness_tensor(points), np.broadcast_to(3.0 * np.eye(2), (3, 2, 2)))
    assert one.material.homogeneous
    tensor = np.array([[2.0, 0.5], [0.5, 1.0]])
    np.testing.assert_array_equal(hv.ScalarProblem(MESH, tensor).material.stiffness_tensor(points)[1], tensor)
    for given in (lambda x: 1.0 + x[:, 0], lambda x: (1.0 + x[:, 0])[:, None, None] * np.eye(2)):
        found = hv.ScalarProblem(MESH, given)
        assert not found.material.homogeneous
        np.testing.assert_allclose(found.material.stiffness_tensor(points), (1.0 + points[:, :1, None]) * np.eye(2))
    with pytest.raises(hv.errors.ProblemError, match=r"the tension is -0.1 at x = \[0.6, 0.9\]"):
        hv.ScalarProblem(MESH, lambda x: 0.5 - x[:, 0]).material.stiffness_tensor(points)
    with pytest.raises(hv.errors.ProblemError, match=r"at 3 points it has shape \(3,\), or \(3, 2, 2\)"):
        hv.ScalarProblem(MESH, lambda x: np.ones((len(x), 2))).material.stiffness_tensor(points)
    parts = hv.ScalarProblem(HALVES, {"low": 1.0, "high": tensor})
    masks = {"low": np.array([True, False, False]), "high": np.array([False, True, True])}
    np.testing.assert_array_equal(parts.material.stiffness_tensor(points, masks)[:, 0, 0], [1.0, 2.0, 2.0])
    with pytest.raises(hv.errors.ProblemError, match=r"the point \[0.3, 0.3\] lies in no region"):
        parts.material.stiffness_tensor(points, masks | {"high": np.array([False, True, False])})


def test_a_problem_at_one_time() -> None:
    """What depends on time is told, and bound to a time; at rest a problem that depends on it is refused."""
    from hemivar.formula import Formula

    def warm(x: Any, t: float) -> Any:
        return t * x[:, 1]

    moving = hv.ScalarProblem(
        MESH, 1.0, {"bottom": hv.ScalarContact(hv.Tresca(Formula("0.1 + t")), Formula("t*x"))},
        {}, {"left": warm}, Formula("2*t"), {"top": warm},
    )  # fmt: skip
    assert moving.time_dependent == {"load", "supports", "gap", "law"}
    with pytest.raises(
        hv.errors.ProblemError,
        match=r"a load and a support and a level and a law of the problem depend on time.*at_time",
    ):
        hv.discretize(moving)
    then = moving.at_time(0.5)
    still = hv.ScalarProblem(
        MESH, 1.0, {"bottom": hv.ScalarContact(hv.Tresca(0.6), lambda x: 0.5 * x[:, 0])}, {},
        {"left": lambda x: 0.5 * x[:, 1]}, 1.0, {"top": lambda x: 0.5 * x[:, 1]},
    )  # fmt: skip
    assert not then.time_dependent
    assert still.at_time(3.0) is still
    np.testing.assert_allclose(hv.solve(then).displacement, hv.solve(still).displacement, atol=1e-14)
    over = hv.ScalarProblem(MESH, 1.0, area=hv.ScalarContact(hv.Signorini(), Formula("1 + t")), bedding=1.0)
    assert hv.discretize(over.at_time(2.0)).gap[0] == 3.0
    for changes in ({"bedding": Formula("t")}, {"coefficient": Formula("1 + t")}):
        with pytest.raises(hv.errors.ProblemError, match="depends on time, which it cannot"):
            hv.ScalarProblem(**{"mesh": MESH, "coefficient": 1.0} | changes)


def test_words_and_copies() -> None:
    problem = hv.ScalarProblem(
        HALVES,
        1.0,
        {"top": hv.ScalarContact(hv.Tresca(0.2))},
        {"low": STOP},
        {"left": -1},
        title="t",
        kind="antiplane",
    )  # type: ignore[arg-type]
    assert repr(problem).startswith("ScalarProblem('t', antiplane, Mesh(")
    for words in ("contact on top: tresca", "contact over low: signorini", "held on left"):
        assert words in repr(problem)
    assert problem.kind is ScalarKind.ANTIPLANE
    assert problem.supports["left"] == -1.0
    assert STOP.side is Side.ABOVE
    again = pickle.loads(pickle.dumps(problem))
    assert hv.discretize(again).load.tolist() == hv.discretize(problem).load.tolist()
    assert copy.deepcopy(problem).title == "t"
    finer = problem.on(HALVES.refined())
    assert finer.mesh.number_of_cells == 4 * problem.mesh.number_of_cells
    # density and viscosity say nothing at rest
    moving = hv.ScalarProblem(MESH, 1.0, supports={"left": 0.0}, source=1.0, density=3.0, viscosity=0.5)
    still = hv.ScalarProblem(MESH, 1.0, supports={"left": 0.0}, source=1.0)
    np.testing.assert_array_equal(hv.solve(moving).displacement, hv.solve(still).displacement)


def test_regions_of_one_component_are_stated_at_its_material() -> None:
    one = hv.Material.gradient(1.0)
    with pytest.raises(
        hv.errors.ProblemError, match=r"region 'low': .* takes its regions itself; give Material\.gradient"
    ):
        hv.Material.by_region({"low": one, "high": one})
    assert "tension = 2.0" in str(hv.Material.gradient(2.0).describe())
    with pytest.raises(AttributeError, match="has no attribute 'source'; it is body_force"):
        _ = hv.ScalarProblem(MESH, 1.0).source
