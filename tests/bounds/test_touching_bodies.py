"""Bodies that touch: each part in equilibrium under its own contact tractions, and how far the answer is from exact."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import hemivar as hv
from hemivar.bounds import solve_adaptive
from hemivar.bounds.body_data import body_data
from hemivar.bounds.touching_bodies import touching_bodies
from hemivar.laws import Superpotential
from hemivar.laws.friction import Friction
from hemivar.solvers import transfer_solution
from tests.samples import sampled

LAWS: dict[str, tuple[Superpotential, Friction]] = {
    "rigid": (hv.Signorini(), hv.laws.NoFriction()),
    "tresca": (hv.Signorini(), hv.Tresca(0.02)),
    "coulomb": (hv.Signorini(), hv.Coulomb(0.3)),
    "springs": (hv.Compliance(40.0), hv.laws.NoFriction()),
    "glue": (hv.Adhesive(40.0, 0.5, softening=2.0, compression=60.0), hv.laws.NoFriction()),
}


def bowl_between(law: str, cells: int = 2, order: int = 1, held: str = "pushed") -> hv.ContactProblem:
    """Two blocks whose nodes do not match, with a bowl between them."""
    mesh = hv.Mesh.assembled({
        "upper": hv.rectangle((1.0, 0.5), (3 * cells, cells), origin=(0.0, 0.5)),
        "lower": hv.rectangle((1.0, 0.5), (2 * cells, cells)),
    })  # fmt: skip
    normal, friction = LAWS[law]
    contact = {
        "upper:bottom": hv.Contact(normal, friction, gap=lambda x: 0.02 * (x[:, 0] - 0.3) ** 2, against="lower:top")
    }
    supports = {
        "pushed": {"lower:bottom": hv.mechanics.Clamped(), "upper:top": hv.Prescribed((0.01, -0.03))},
        "by contact": {"lower:bottom": hv.mechanics.Clamped(), "upper:top": hv.Fixed(x=0.0)},
        "on a foundation": {"lower:left": hv.Fixed(x=0.0), "upper:top": hv.Fixed(x=0.0)},
    }[held]
    loads = {} if held == "pushed" else {"upper:right": (0.0, -0.05), "upper:left": (0.0, -0.05)}
    if held == "on a foundation":
        contact["lower:bottom"] = hv.Contact(hv.Compliance(30.0), hv.Tresca(0.01))
    return hv.ContactProblem(mesh, hv.Material.young(10.0, 0.3), contact, supports, tractions=loads, order=order)  # type: ignore[arg-type]


def error_on_refined(solution: hv.Solution, times: int) -> float:
    """Distance to the solution on a mesh refined so often."""
    problem = solution.problem.origin
    assert problem is not None
    moved = solution
    for _ in range(times):
        problem = replace(problem, mesh=problem.mesh.refined())
        finer = hv.discretize(problem)
        moved = replace(moved, problem=finer, unknowns=transfer_solution(moved, finer))
    off = moved.unknowns - hv.solve(problem).unknowns
    return float(np.sqrt(off @ (moved.problem.stiffness @ off)))


@pytest.mark.parametrize(
    ("law", "held"),
    sampled(
        [
            ("rigid", "pushed"), ("tresca", "pushed"), ("coulomb", "pushed"), ("springs", "pushed"), ("glue", "pushed"),
            ("rigid", "by contact"), ("tresca", "on a foundation"),
        ],
        3,
    ),
)  # fmt: skip
def test_estimates_are_near_to_the_error(law: str, held: str) -> None:
    for cells in (2, 4):
        found = hv.solve(bowl_between(law, cells, held=held))
        exact = hv.certify(found, exact=True).exact
        assert exact is not None
        assert not exact.guaranteed
        assert "facets of bodies that touch do not coincide" in exact.reasons[0]
        assert 1.0 < exact.bound / error_on_refined(found, 3) < 1.7


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("held", ["pushed", "by contact", "on a foundation"])
def test_each_part_is_in_equilibrium_under_its_tractions(order: int, held: str) -> None:
    found = hv.solve(bowl_between("tresca", 3, order, held))
    problem = found.problem.origin
    assert problem is not None
    data, c = touching_bodies(problem, found.displacement)
    assert c == 0.0
    left = np.zeros_like(found.displacement)
    np.add.at(left, data.cell_nodes, data.loads - data.forces)
    np.add.at(left, data.facet_nodes, data.facet_loads)
    size = np.abs(data.forces).max()
    basis = found.problem.field.basis  # type: ignore[union-attr]
    assert np.abs(basis.T @ left.ravel()).max() < 1e-12 * size
    bare = body_data(replace(problem, contact={}), found.displacement)
    touched = data.facet_loads - bare.facet_loads
    on = {
        name: touched[data.table.numbers(problem.mesh.boundaries[name])].sum(axis=(0, 1))
        for name in ("upper:bottom", "lower:top")
    }
    np.testing.assert_allclose(on["upper:bottom"], -on["lower:top"], atol=1e-14)
    assert np.abs(on["upper:bottom"]).max() > 0.01


@pytest.mark.parametrize("space", [False, True])
def test_a_uniform_pressure_is_exact(space: bool) -> None:
    sizes, n = ((1.0, 1.0, 0.5), (2, 3)) if space else ((1.0, 0.5), (4, 6))
    build = hv.box if space else hv.rectangle
    mesh = hv.Mesh.assembled({
        "upper": build(sizes, n[1], origin=(*(0.0,) * (len(sizes) - 1), 0.5)), "lower": build(sizes, n[0]),
    })  # fmt: skip
    contact = {"upper:bottom": hv.Contact(hv.Compliance(40.0), gap=0.001, against="lower:top")}
    down = (*(0.0,) * (len(sizes) - 1), -0.02)
    supports = {"lower:bottom": hv.mechanics.Clamped(), "upper:top": hv.Prescribed(down)}
    found = hv.solve(hv.ContactProblem(mesh, hv.Material.young(10.0, 0.0), contact, supports))
    exact = hv.certify(found, exact=True).exact
    assert exact is not None
    assert exact.relative < 1e-10


def test_meshes_adapt_on_both_sides() -> None:
    found = solve_adaptive(bowl_between("tresca", 4), rtol=0.06, max_unknowns=4000)
    last = found.levels[-1]
    assert last.distance.relative <= 0.06
    assert not last.distance.guaranteed
    rate = np.log(last.distance.relative / found.levels[0].distance.relative) / np.log(
        last.unknowns / found.levels[0].unknowns
    )
    assert rate < -0.45
    mesh = last.solution.problem.field.mesh  # type: ignore[union-attr]
    middle = mesh.points[mesh.cells].mean(axis=1)[:, 1]
    assert np.count_nonzero((middle > 0.5) & (middle < 0.55)) > 40
    assert np.count_nonzero((middle > 0.45) & (middle < 0.5)) > 40
    with pytest.raises(hv.errors.ProblemError, match="facets of these two do not coincide; give no goal"):
        solve_adaptive(bowl_between("tresca", 2), goal="contact.upper:bottom.force")


def test_no_trace_constant_of_one_side_stands_for_the_jump() -> None:
    """The survey's condition needs that of the jump: a bound of the trace on one side would be too good."""
    found = hv.certify(hv.solve(bowl_between("glue", 3))).smallness
    assert found.trace_constant is not None
    assert found.trace_bound is None
