"""A coarser problem by some of the nodes, where no coarser mesh is known."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import hemivar as hv
from hemivar.fem.hierarchy import Coarser
from hemivar.fem.near_kernel import rigid_motions
from hemivar.fem.node_coarsening import LevelNodes, coarser_by_nodes

SOFT = hv.Material.lame(4.0, 4.0)


@cache
def odd_body(kind: str) -> hv.ContactProblem:
    """Bodies whose meshes have odd numbers of cells."""
    law = hv.Contact(hv.Signorini(), hv.Tresca(0.02))
    if kind in ("box", "loose"):
        touch = {"bottom": law, "left": hv.Contact(hv.Compliance(10.0))}
        held = {"top": hv.Clamped()} if kind == "box" else {}
        return hv.ContactProblem(hv.box(cells=7), SOFT, touch, held, tractions={"right": (-0.1, 0.0, -0.1)})
    mesh = hv.Mesh.assembled({"u": hv.rectangle(cells=25), "l": hv.rectangle(cells=17, origin=(0.0, -1.0))})
    held = {"u:top": hv.Prescribed((0.0, -0.05)), "l:bottom": hv.Clamped()}
    return hv.ContactProblem(mesh, SOFT, {"u:bottom": replace(law, against="l:top")}, held)


@cache
def step(kind: str) -> Coarser:
    problem = hv.discretize(odd_body(kind), check_coercivity=False)
    graph = LevelNodes.of(problem)
    assert graph is not None
    found = coarser_by_nodes(problem, graph)
    assert found is not None
    return found[0]


@pytest.mark.parametrize("kind", ["box", "pair"])
def test_coarse_unknowns_are_some_of_the_fine_ones(kind: str) -> None:
    below = step(kind)
    coarse, fine = below.problem, below.field
    assert coarse.unknowns < 0.4 * below.prolongation.shape[0]
    assert coarse.field is not None
    np.testing.assert_allclose((coarse.field.lift @ coarse.field.basis).toarray(), np.eye(coarse.unknowns), atol=1e-12)
    y = np.cos(np.arange(coarse.unknowns))
    shift = 0.0 if below.shift is None else below.shift
    there = fine.full(below.prolongation @ y + shift)
    np.testing.assert_allclose(coarse.field.full(y), there, atol=1e-12)  # what they displace is the same field


def test_rigid_motions_are_those_of_the_body() -> None:
    """Moving least squares reproduce what is linear, up to what makes them soft."""
    below = step("loose")
    assert below.problem.field is not None
    for fine, coarse in zip(rigid_motions(below.field).T, rigid_motions(below.problem.field).T, strict=True):
        away = below.prolongation @ coarse - fine
        assert np.abs(away).max() <= 0.05 * np.abs(fine).max()


@pytest.mark.parametrize("kind", ["box", "pair"])
def test_contact_points_are_some_of_the_fine_ones_and_share_their_area(kind: str) -> None:
    problem, below = hv.discretize(odd_body(kind)), step(kind)
    fine, coarse = problem.contact, below.problem.contact
    assert 0 < coarse.count < 0.6 * fine.count
    np.testing.assert_array_equal(coarse.points, fine.points[below.shared])
    for name in fine.names:
        assert coarse.weights[coarse.on(name)].sum() == pytest.approx(fine.weights[fine.on(name)].sum(), rel=1e-12)
    y = np.cos(np.arange(below.problem.unknowns))
    there = fine.trace_of(below.prolongation @ y)[below.shared]
    np.testing.assert_allclose(coarse.trace_of(y), there, atol=1e-14)


@pytest.mark.parametrize("kind", ["box", "pair"])
def test_a_boundary_follows_the_nodes_that_were_left_on_it(kind: str) -> None:
    """Where coarse contact points do not move the fine ones do not: a jump of two bodies follows jumps alone."""
    problem, below = hv.discretize(odd_body(kind)), step(kind)
    fine, coarse = problem.contact, below.problem.contact
    for name in fine.names:
        y = np.cos(np.arange(below.problem.unknowns))
        seen = coarse.take(coarse.on(name)).trace
        y[seen.indices] = 0.0
        moved = fine.take(fine.on(name)).trace @ (below.prolongation @ y)
        normal = moved.reshape(-1, fine.components)[:, 0]
        np.testing.assert_allclose(normal, 0.0, atol=1e-12)


def test_what_has_no_nodes_has_no_coarser_problem() -> None:
    law = hv.laws.ContactLaw(hv.Signorini()).at(None)
    assert LevelNodes.of(hv.DiscreteProblem.of_arrays([[2.0]], [1.0], [[1.0]], [1.0], [0.2], law)) is None
