"""All combinations, rounding included: nothing is dropped in silence."""

from __future__ import annotations

import numpy as np
import pytest

from hemivar.branches import enumeration, find_solutions, search
from hemivar.branches.enumeration import enumerate_points
from hemivar.branches.polish import polish
from hemivar.discrete import DiscreteProblem
from hemivar.discrete.point_kind import PointKind
from hemivar.laws import Compliance, ContactLaw, PiecewiseQuadratic, Signorini, Tresca, table_law
from hemivar.solvers import Controls, Status, solve
from hemivar.systems import CondensedProblem, Workspace
from hemivar.systems.chain import chain_of

from .random_problems import random_problem

BODY = np.array([[2.0, -1.0], [-1.0, 3.0]])


def two_unknowns(load: tuple[float, ...], law: ContactLaw, gap: float = 0.0) -> DiscreteProblem:
    m = 1 if law.friction.bounds.any() else len(load)
    return DiscreteProblem.of_arrays(BODY, np.array(load), np.eye(2), np.ones(m), np.full(m, gap), law)


@pytest.mark.parametrize("ratio", [1e3, 1e6, 1e9, 1e12, 1e15])
def test_a_bound_far_above_the_load_holds_the_body(ratio: float) -> None:
    found = find_solutions(two_unknowns((0.1, 0.7), ContactLaw(Compliance(1.0), Tresca(ratio))))
    assert found.exhaustive
    assert [s.kind for s in found] == [PointKind.LOCAL_MINIMISER]
    np.testing.assert_allclose(found[0].local, [[0.1 / 3.0, 0.0]], atol=1e-15)
    assert found[0].status is Status.CONVERGED


@pytest.mark.parametrize("gap", [1e-9, 0.1, 0.3, 7.7, 1e6])
def test_an_unloaded_body_above_a_gap_rests(gap: float) -> None:
    for law in (ContactLaw(Compliance(1.0)), ContactLaw(Compliance(1.0), Tresca(0.3))):
        found = find_solutions(two_unknowns((0.0, 0.0), law, gap))
        assert found.exhaustive
        assert len(found) == 1
        np.testing.assert_array_equal(found[0].unknowns, 0.0)
        assert found[0].status is Status.CONVERGED


@pytest.mark.parametrize("size", [3e2, 3e4, 3e6])
def test_minima_between_knots_of_large_pressure_are_all_there(size: float) -> None:
    """A wedge of pressure: below it, on both its sides, and in front of it."""
    r = [0.0, 0.2, 0.4]
    law = ContactLaw(table_law(r, [0.0, size, 0.0]))
    body = DiscreteProblem.of_arrays(np.eye(1), np.array([1.0]), np.eye(1), np.ones(1), np.zeros(1), law)
    found = find_solutions(body)
    assert found.exhaustive
    expected = sorted([1.0, 1.0 / (1.0 + 5.0 * size), (10.0 * size / 5.0 - 1.0) / (5.0 * size - 1.0)])
    np.testing.assert_allclose(sorted(s.penetration[0] for s in found), expected, rtol=1e-9)
    assert sum(s.kind is PointKind.LOCAL_MINIMISER for s in found) == 2


@pytest.mark.parametrize("block", [0, *(pytest.param(k, marks=pytest.mark.slow) for k in range(1, 4))])
def test_what_solve_returns_is_among_them(block: int) -> None:
    exhaustive = 0
    for seed in range(15 * block, 15 * block + 15):
        case = random_problem(4000 + seed)
        found = find_solutions(case, max_solutions=10_000, enumerate_up_to=3000, starts=0)
        solved = solve(case)
        if not found.exhaustive or solved.status is not Status.CONVERGED:
            continue
        exhaustive += 1
        assert min(np.abs(s.local - solved.local).max() for s in found) < 1e-7, f"seed {seed}"
    assert exhaustive > 5


def test_a_candidate_that_is_not_shown_to_be_one_ends_the_claim(monkeypatch: pytest.MonkeyPatch) -> None:
    """Whatever the reason that a candidate is not accepted, exhaustive must not be said."""
    body = two_unknowns((0.1, 0.7), ContactLaw(Compliance(1.0), Tresca(0.2)))
    assert find_solutions(body).exhaustive
    monkeypatch.setattr(search.Polished, "solves", lambda *_: False)
    found = find_solutions(body)
    assert len(found) == 0
    assert not found.exhaustive
    assert "rounding does not tell" in found.searched


def test_nearby_solutions_are_told_apart() -> None:
    """Two minima 2e-9 apart are two solutions."""
    width = 1e-9
    law = PiecewiseQuadratic([0.5 - width, 0.5, 0.5 + width], [0.0, 0.0, 0.0, 0.0], [0.2, -0.2, 0.2])  # type: ignore[arg-type]
    body = DiscreteProblem.of_arrays(np.eye(1), np.array([0.6]), np.eye(1), np.ones(1), np.zeros(1), ContactLaw(law))
    found = find_solutions(body)
    assert found.exhaustive
    np.testing.assert_allclose(sorted(s.penetration[0] - 0.5 for s in found), [-width, 0.0, width], atol=1e-14)


def test_a_continuum_away_from_its_middle_is_seen() -> None:
    """Two springs that soften as fast as the body is stiff: the solutions fill a piece, wherever it begins."""
    law = table_law([0.0, 0.1, 1.1], [0.0, 0.0, -1.0])
    body = DiscreteProblem.of_arrays(np.eye(1), np.array([0.1]), np.eye(1), np.ones(1), np.zeros(1), ContactLaw(law))
    found = find_solutions(body)
    assert not found.exhaustive
    assert "continuum" in found.searched


def test_too_many_singular_combinations_are_left_undecided(monkeypatch: pytest.MonkeyPatch) -> None:
    law = table_law([0.0, 0.1, 1.1], [0.0, 0.0, -1.0])
    body = DiscreteProblem.of_arrays(np.eye(1), np.array([0.1]), np.eye(1), np.ones(1), np.zeros(1), ContactLaw(law))
    monkeypatch.setattr(enumeration, "_LINES", 0)
    found = find_solutions(body)
    assert not found.exhaustive


def yielding_beside_rigid(load: tuple[float, float]) -> CondensedProblem:
    """A point that softens as fast as the body is stiff, from 0.1 to 0.3, and one on rigid ground."""
    law = PiecewiseQuadratic([0.0, 0.1, 0.3], [0.0, 2.0, -1.0, 0.0], [0.0, 0.0, 0.0])
    laws = ContactLaw.concatenate([(ContactLaw(law), 1), (ContactLaw(Signorini()), 1)])
    stiffness = np.array([[1.0, 0.5], [0.5, 2.0]])
    body = DiscreteProblem.of_arrays(stiffness, np.array(load), np.eye(2), np.ones(2), np.zeros(2), laws)
    return Workspace().condensed(body)


def test_the_point_of_a_continuum_has_forces_that_its_kinks_bear() -> None:
    """``r + lam = 0.3`` all along the falling piece; the rigid point is pressed by ``(0.12 - r) / 2``, up to 0.12."""
    chain = chain_of(yielding_beside_rigid((0.3, 0.06)))
    found = enumerate_points(chain)
    assert found.continuum
    inside = [one for one in found.candidates if one.r[1] == 0.0 and 0.1 < one.r[0] < 0.12]
    assert len(inside) == 1
    r, lam = inside[0].r, inside[0].lam
    np.testing.assert_allclose(lam, [0.3 - r[0], 0.5 * (0.12 - r[0])], atol=1e-12)


def test_refinement_moves_forces_at_kinks() -> None:
    """From a force of the rigid ground that is 2e-3 off: that of ``3 r = 0.05`` is ``0.5 - r / 2``."""
    system = yielding_beside_rigid((0.05, 0.5))
    chain = chain_of(system)
    (known,) = enumerate_points(chain).candidates
    segment, kink = known.segment, chain.pick(chain.kink, known.segment)
    assert kink.tolist() == [False, True]
    at = np.where(
        kink, (known.lam - chain.pick(chain.value, segment)) * chain.tau, known.r - chain.pick(chain.value, segment)
    )
    theta = chain.pick(chain.origin, segment) + at + np.array([0.0, 1e-3])
    r, lam = chain.local(theta, segment)
    assert abs(lam[1, 0] - (0.5 - 0.05 / 6.0)) > 1e-3
    found = polish(system, chain, r, lam, theta, segment, Controls())
    np.testing.assert_allclose(found.unknowns, [0.05 / 3.0, 0.0], atol=1e-15)
    np.testing.assert_allclose(found.multiplier[:, 0], [0.1 / 3.0, 0.5 - 0.05 / 6.0], rtol=1e-12)
