"""Discrete scalar problems: supports, free constants, contact points, levels, reactions."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import hemivar as hv
from hemivar.discrete.contact import selects
from hemivar.errors import SupportError
from hemivar.fem.hierarchy import coarser
from hemivar.fem.reactions import nodal_contact_forces
from hemivar.mechanics.foundation import Side
from hemivar.mesh import Mesh

MESH = hv.rectangle((1.0, 1.0), 4)
STOP = hv.ScalarContact(hv.Signorini(), 0.1)


def two_squares(joined: bool) -> Mesh:
    """Two squares side by side, which meet at one node or at none."""
    shift = np.array([1.0, 1.0]) if joined else np.array([3.0, 0.0])
    points = np.concatenate([MESH.points, MESH.points + shift])
    cells = np.concatenate([MESH.cells, MESH.cells + len(MESH.points)])
    boundaries = {"left": MESH.boundaries["left"], "other": MESH.boundaries["right"] + len(MESH.points)}
    if joined:
        first = int(np.flatnonzero((MESH.points == 1.0).all(axis=1))[0])
        second = len(MESH.points) + int(np.flatnonzero((MESH.points == 0.0).all(axis=1))[0])
        keep = np.arange(len(points)) != second
        number = np.cumsum(keep) - 1
        number[second] = first
        points, cells = points[keep], number[cells]
        boundaries = {name: number[facets] for name, facets in boundaries.items()}
    return Mesh(points, cells, boundaries)


def test_what_nothing_holds_is_refused() -> None:
    free = hv.ScalarProblem(MESH, 1.0, source=1.0)
    with pytest.raises(SupportError, match="adding a constant"):
        hv.discretize(free)
    pulled = replace(free, contact={"left": STOP}, body_force=-1.0)  # away from the stop
    with pytest.raises(SupportError, match="adding a constant"):
        hv.discretize(pulled)
    pushed = replace(free, contact={"left": STOP})
    found = hv.solve(pushed).raise_for_status()
    assert found.normal_force == pytest.approx(1.0)
    assert found.certify().stationary
    rubbed = replace(
        free, contact={"left": hv.ScalarContact(hv.Tresca(1.1))}, material=hv.Material.gradient(1.0, "antiplane")
    )
    assert hv.solve(rubbed).raise_for_status().friction_force[0] == pytest.approx(-1.0)
    with pytest.raises(SupportError, match="adding a constant"):
        hv.discretize(replace(rubbed, contact={"left": hv.ScalarContact(hv.Tresca(0.9))}))
    for bedding in (2.0, lambda x: x[:, 0]):
        bedded = hv.solve(replace(free, bedding=bedding)).raise_for_status()
        assert bedded.problem.model.free_motions.count == 0
    assert hv.solve(replace(free, bedding=2.0)).displacement[:, 0] == pytest.approx(0.5)


def test_parts_that_hang_at_one_node_share_their_constant() -> None:
    apart = hv.ScalarProblem(two_squares(False), 1.0, supports={"left": 0.0}, source=1.0)
    with pytest.raises(SupportError, match="part 2 of 2"):
        hv.discretize(apart)
    joined = replace(apart, mesh=two_squares(True))
    assert hv.solve(joined).raise_for_status().displacement.max() > 0.0
    both = replace(apart, supports={"left": 0.0, "other": 1.0})
    assert hv.solve(both).raise_for_status().displacement.max() > 1.0


@pytest.mark.parametrize("order", [1, 2])
def test_the_kernel_is_the_constants(order: int) -> None:
    problem = hv.discretize(hv.ScalarProblem(MESH, 2.0, order=order), check_coercivity=False)
    field = problem.field
    assert field is not None
    assert field.free_motions.count == 1
    np.testing.assert_allclose(problem.stiffness @ field.free_motions.motions.toarray(), 0.0, atol=1e-12)
    values = np.linalg.eigvalsh(problem.stiffness.toarray())
    assert values[0] == pytest.approx(0.0, abs=1e-12)
    assert values[1] > 1e-3
    held = hv.discretize(hv.ScalarProblem(MESH, 2.0, order=order, supports={"left": 0.0}))
    assert held.model.free_motions.count == 0


def test_supports_agree_or_are_refused() -> None:
    with pytest.raises(SupportError, match="'left' and 'top' prescribe different values at node"):
        hv.discretize(hv.ScalarProblem(MESH, 1.0, supports={"left": 0.0, "top": 1.0}))
    problem = hv.ScalarProblem(MESH, 1.0, supports={"left": 0.0, "top": lambda x: x[:, 0]})
    found = hv.solve(problem)
    top = MESH.points[:, 1] == 1.0
    np.testing.assert_allclose(found.displacement[top, 0], MESH.points[top, 0])
    assert sum(force[0] for force in found.reactions.values()) == pytest.approx(0.0, abs=1e-14)
    with pytest.raises(SupportError, match="no freedom"):
        hv.discretize(hv.ScalarProblem(hv.rectangle((1.0, 1.0), 1), 1.0, supports=dict.fromkeys(MESH.boundaries, 0.0)))


def test_what_is_held_where_its_law_forbids_it() -> None:
    rim = dict.fromkeys(MESH.boundaries, 0.3)
    with pytest.raises(SupportError, match=r"at penetration 0.2, which its law forbids .contact 'area'.; change"):
        hv.discretize(hv.ScalarProblem(MESH, 1.0, area=STOP, supports=rim))
    # a rim that lies on the obstacle but for rounding is none
    level = 0.3 * (1.0 - 1e-16)
    hv.discretize(hv.ScalarProblem(MESH, 1.0, area=hv.ScalarContact(hv.Signorini(), level), supports=rim))
    # energy of held points counts: springs k r^2/2 over the rim, whose area the nodes share out
    law = hv.ScalarContact(hv.Compliance(2.0), 0.1)
    soft = hv.discretize(hv.ScalarProblem(MESH, 1.0, area=law, supports=rim))
    inner = float(soft.contact.weights.sum())
    free = hv.discretize(hv.ScalarProblem(MESH, 1.0, area=hv.ScalarContact(hv.laws.NoContact()), supports=rim))
    assert soft.constant - free.constant == pytest.approx((1.0 - inner) * 0.2**2)


def test_contact_points_of_boundaries_and_regions() -> None:
    mesh = Mesh(MESH.points, MESH.cells, MESH.boundaries, {"low": np.arange(16), "high": np.arange(16, 32)})
    problem = hv.discretize(
        hv.ScalarProblem(mesh, 1.0, {"left": STOP, "top": STOP}, supports={"right": 0.0}), check_coercivity=False
    )
    contact = problem.contact
    assert contact.components == 1
    assert contact.names == ("left", "top")
    assert selects(contact.trace)
    assert contact.weights.sum() == pytest.approx(2.0 - 0.125)  # less what the node held at the corner has
    corner = np.flatnonzero((contact.points == [0.0, 1.0]).all(axis=1))  # type: ignore[comparison-overlap, union-attr]
    assert contact.boundary[corner].tolist() == [0]
    assert contact.weights[corner].tolist() == [0.25]
    areas = hv.discretize(hv.ScalarProblem(mesh, 1.0, area={"low": STOP, "high": STOP}, bedding=1.0)).contact
    assert areas.weights.sum() == pytest.approx(1.0)
    assert np.unique(areas.node).size == areas.count == len(mesh.points)
    with pytest.raises(hv.errors.ProblemError, match=r"share 3 nodes, the first at x = \(0, 0\); restrict"):
        hv.discretize(hv.ScalarProblem(mesh, 1.0, {"left": STOP}, {"low": STOP}, bedding=1.0))
    both = hv.ScalarProblem(
        mesh, 1.0, {"top": hv.ScalarContact(hv.Tresca(0.5), 0.2)}, {"low": replace(STOP, side=Side.BELOW)}, bedding=1.0
    )
    discrete = hv.discretize(both)
    mixed = discrete.contact
    assert mixed.components == 2
    over = mixed.on("low")
    rows = np.asarray(mixed.trace[2 * over].sum(axis=1))
    np.testing.assert_array_equal(rows, -1.0)
    np.testing.assert_array_equal(discrete.offset[over], np.broadcast_to([-0.1, 0.0], (len(over), 2)))
    np.testing.assert_array_equal(np.diff(mixed.trace.indptr)[2 * over + 1], 0)
    edge = mixed.on("top")
    np.testing.assert_array_equal(discrete.offset[edge], np.broadcast_to([0.0, 0.2], (len(edge), 2)))
    found = {
        method: hv.solve(replace(both, body_force=-1.0), hv.solvers.METHODS[method])
        for method in ("newton", "multigrid")
    }
    np.testing.assert_allclose(found["newton"].displacement, found["multigrid"].displacement, atol=1e-9)
    assert found["newton"].certify().unique


def test_coarser_problems_are_the_same_statement() -> None:
    statement = hv.ScalarProblem(hv.rectangle((1.0, 1.0), 8), 1.0, area=STOP, supports={"left": 0.0}, source=1.0)
    fine = hv.discretize(statement)
    step = coarser(fine)
    assert step is not None
    below = hv.discretize(replace(statement, mesh=hv.rectangle((1.0, 1.0), 4)))
    assert abs(step.problem.stiffness - below.stiffness).max() < 1e-14
    np.testing.assert_allclose(step.problem.offset, below.offset)
    np.testing.assert_allclose(step.problem.contact.weights, below.contact.weights)
    np.testing.assert_allclose(step.problem.load, below.load, atol=1e-14)
    linear = MESH.points[step.problem.contact.node][:, 0]
    fine_points = statement.mesh.points[fine.contact.node][:, 0]
    np.testing.assert_allclose(step.interpolate(linear), fine_points, atol=1e-14)


@pytest.mark.parametrize("order", [1, 2])
def test_reactions_balance_loads_and_contact(order: int) -> None:
    problem = hv.ScalarProblem(
        MESH, lambda x: 1.0 + x[:, 0], {"bottom": hv.ScalarContact(hv.laws.ThresholdCompliance(0.1, 4.0), -0.02)},
        supports={"left": 0.1, "right": lambda x: 0.1 + 0.1 * x[:, 1]}, source=lambda x: x[:, 1], fluxes={"top": 0.3},
        order=order,
    )  # fmt: skip
    found = hv.solve(problem).raise_for_status()
    assert found.normal_force > 0.0
    held = found.problem.contact
    assert held.count < (5 if order == 1 else 9)  # its ends are held: their force is part of the reactions
    total = sum(force[0] for force in found.reactions.values()) - found.normal_force + 0.5 + 0.3
    assert total == pytest.approx(0.0, abs=1e-10)
    assert nodal_contact_forces(found.problem, found.multiplier).sum() == pytest.approx(-found.normal_force)
    assert found.on("bottom").contact_length > 0.0
    other = found.problem.with_(load=2.0 * found.problem.load)
    with pytest.raises(hv.errors.ProblemError, match="under the stated load only"):
        _ = hv.solve(other).reactions
