"""Blocks that contact alone holds, near the limit of their friction: right, or said to be at the limit."""

from __future__ import annotations

import numpy as np
import pytest

import hemivar as hv
from hemivar.discrete import DiscreteProblem
from tests.samples import sampled

from .pieces_of_friction import Points


def block(seed: int, k: int) -> tuple[DiscreteProblem, float, float | None]:
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


@pytest.mark.parametrize("number", sampled(range(90), 9))
def test_a_block_near_the_limit_of_its_friction(number: int) -> None:
    k = 1 + number % 15
    found = hv.solve(block(number, k)[0])
    if found.status is hv.Status.AT_LIMIT:
        assert k > 8
        return
    assert found.status is hv.Status.CONVERGED, (k, found.status)
    right = by_hand(*block(number, min(k, 7)))
    size = max(np.abs(found.slip).max(), np.abs(right[0][:, 1]).max())
    near = min(np.abs(found.slip[:, 0] - one[:, 1]).max() for one in right)
    assert near <= 1e-3 * size, (k, near / size)
