"""Blocks that contact alone holds, near the limit of their friction: right, or said to be at the limit."""

from __future__ import annotations

import numpy as np
import pytest

import hemivar as hv
from hemivar.discrete import DiscreteProblem
from tests.samples import sampled, slow

from .pieces_of_friction import Points


def drawn_aside(seed: int, k: int) -> tuple[DiscreteProblem, float, float | None]:
    """A block drawn aside by ``1 - 10^-k`` of what friction can hold, its mu, and the stiffness of its foundation."""
    rng = np.random.default_rng([52, seed])
    mu, units, soft = rng.uniform(0.1, 0.7), float(rng.choice([1e-6, 1.0, 1e9])), bool(rng.integers(2))
    length, cells = rng.uniform(0.5, 2.0), (int(rng.integers(2, 4)), 2)
    stiffness = units * 10.0 ** rng.uniform(0.5, 3.0) if soft else None
    normal = hv.Signorini() if stiffness is None else hv.Compliance(stiffness)
    pull = float(rng.choice([-1.0, 1.0])) * mu * (1.0 - 10.0**-k)
    stated = hv.ContactProblem(
        hv.rectangle((length, length * rng.uniform(0.2, 0.6)), cells),
        hv.Material.young(units * 10.0 ** rng.uniform(1.0, 4.0), 0.3),
        {"bottom": hv.Contact(normal, hv.Coulomb(mu))},
        tractions={"top": (units * pull, -units)},
    )
    return hv.discretize(stated), mu, stiffness


def by_hand(problem: DiscreteProblem, mu: float, stiffness: float | None) -> list[np.ndarray]:
    """All solutions, each point open, sticking or slipping, by dense algebra on what contact points see."""
    K, B = problem.stiffness.toarray(), problem.contact.trace.toarray()
    seen = np.flatnonzero(B.any(axis=0))
    inner = np.setdiff1d(np.arange(len(K)), seen)
    follow = np.linalg.solve(K[np.ix_(inner, inner)], np.column_stack([K[np.ix_(inner, seen)], problem.load[inner]]))
    A = K[np.ix_(seen, seen)] - K[np.ix_(seen, inner)] @ follow[:, :-1]
    b = problem.load[seen] - K[np.ix_(seen, inner)] @ follow[:, -1]
    turn = B[:, seen]
    weights, units = problem.contact.weights, float(np.abs(problem.load).max())
    firm = None if stiffness is None else stiffness / units
    points = Points(turn @ A @ turn.T / units, turn @ b / units, weights, np.full(weights.size, mu), firm)
    return points.solutions()


@pytest.mark.parametrize("number", sampled(range(90), [6, 7, 22, 36, 52, 53, 69, 88]))
def test_a_block_near_the_limit_of_its_friction(number: int) -> None:
    k = 1 + number % 15
    found = hv.solve(drawn_aside(number, k)[0])
    if found.status is hv.Status.AT_LIMIT:
        assert k > 8
        return
    assert found.status is hv.Status.CONVERGED, (k, found.status)
    right = by_hand(*drawn_aside(number, min(k, 7)))
    near = min(np.abs(found.slip[:, 0] - one[:, 1]).max() for one in right)
    assert near <= 1e-3 * np.abs(right[0][:, 1]).max() + 1e-12 * np.abs(found.displacement).max(), k


@pytest.mark.parametrize("k", [7, slow(8)])
def test_the_slip_next_to_the_limit_is_that_at_some_distance(k: int) -> None:
    """One point sticks all along, so that what is near the limit hardly moves the others."""
    found = [
        hv.solve(hv.ContactProblem(
            hv.rectangle((1.0, 0.5), (16, 8)), hv.Material.young(100.0, 0.3),
            {"bottom": hv.Contact(hv.Signorini(), hv.Coulomb(0.3))},
            tractions={"top": (0.3 * (1.0 - 10.0**-near), -1.0)},
        ))
        for near in (5, k)
    ]  # fmt: skip
    assert [one.status for one in found] == [hv.Status.CONVERGED] * 2
    largest = [np.abs(one.slip).max() for one in found]
    assert largest[1] == pytest.approx(largest[0], rel=1e-4)


def drawn_askew(k: int, friction: hv.laws.Friction) -> hv.ContactProblem:
    """A block in space, drawn askew by ``1 - 10^-k`` of a friction of 0.3."""
    pull = 0.3 * (1.0 - 10.0**-k)
    return hv.ContactProblem(
        hv.box((1.0, 1.0, 0.3), (2, 2, 1)), hv.Material.young(100.0, 0.3),
        {"bottom": hv.Contact(hv.Signorini(), friction)}, tractions={"top": (0.8 * pull, 0.6 * pull, -1.0)},
    )  # fmt: skip


@pytest.mark.parametrize("friction", [hv.Coulomb(0.3), hv.Tresca(0.3)], ids=["coulomb", "tresca"])
def test_in_space_a_slide_grows_with_the_root_of_what_is_near(friction: hv.laws.Friction) -> None:
    """All points slip: their directions differ by angles t, friction loses t^2/2, and t falls as the slide grows."""
    near, nearer = (hv.solve(drawn_askew(k, friction)) for k in (6, 8))
    assert near.status is nearer.status is hv.Status.CONVERGED
    assert np.abs(nearer.slip).max() == pytest.approx(10.0 * np.abs(near.slip).max(), rel=1e-2)
    said = [any("has slid by" in line for line in found.warnings) for found in (near, nearer)]
    assert said == [np.abs(found.displacement).max() > 1.0 for found in (near, nearer)]
    assert said[1]


def test_a_slide_is_never_converged() -> None:
    """Whatever its length: the residual of a slide at 1 - 10^-12 of the limit is below the tolerance."""
    problem, *_ = drawn_aside(11, 12)
    found = hv.solve(problem, "newton")
    assert found.status is hv.Status.AT_LIMIT
    assert "limit of friction" in found.remedy
    assert found.residual.below(0.0, 1e-9)


def test_a_slide_excuses_nothing() -> None:
    """What rounding may leave is that of the answer, wherever a body that nothing holds sideways is put."""
    problem, *_ = drawn_aside(7, 7)
    found = hv.solve(problem)
    assert problem.field is not None
    along = problem.field.lift @ np.tile([1.0, 0.0], problem.field.number_of_nodes)
    for slid in (1.0, 1e5):
        gone = hv.discrete.residual(problem, found.unknowns + slid * along, found.multiplier)
        assert gone.noise <= 2.0 * found.residual.noise
        assert not gone.below(0.0, 1e-9)


def test_the_rounding_of_what_is_clamped_is_excused_as_ever() -> None:
    """Eight units in the last place of ``|K| |u| + |f|``: slender, of two materials, or far from its foundation."""
    clamped = {"left": hv.mechanics.Clamped()}
    contact = {"bottom": hv.Contact(hv.Signorini(), hv.Coulomb(0.3), gap=1e-3)}
    for size, cells in (((1000.0, 1.0), (250, 1)), ((1.0, 1.0), (4, 4))):
        stated = hv.ContactProblem(
            hv.rectangle(size, cells), hv.Material.young(1e5, 0.3), contact, clamped, tractions={"top": (0.0, -1e-6)}
        )
        problem = hv.discretize(stated)
        u = np.cos(np.arange(problem.unknowns))
        sizes = abs(problem.stiffness) @ np.ones(problem.unknowns) * np.abs(u) + np.abs(problem.load)
        found = hv.discrete.residual(problem, u, np.zeros(problem.contact.shape))
        assert found.noise == pytest.approx(8.0 * np.finfo(float).eps * np.linalg.norm(sizes), rel=1e-12)


@pytest.mark.parametrize("friction", [hv.Coulomb(0.3), hv.Tresca(0.3)], ids=["coulomb", "tresca"])
def test_a_stiff_block_on_a_soft_bed_converges_and_says_what_rounding_leaves(friction: hv.laws.Friction) -> None:
    """It sinks 1e7 times as far as it is compressed: the law asks for that, so its rounding is that of an answer."""
    found = hv.solve(hv.ContactProblem(
        hv.rectangle((1.0, 0.5), (8, 4)), hv.Material.young(1e9, 0.3),
        {"bottom": hv.Contact(hv.Compliance(1e2), friction)}, tractions={"top": (0.1, -1.0)},
    ))  # fmt: skip
    assert found.status is hv.Status.CONVERGED
    assert found.residual.relative > 1e-9
    assert any("the residual is above the tolerance" in line for line in found.warnings)
    np.testing.assert_allclose(found.on("bottom").force, [-0.1, 1.0], rtol=1e-6)
