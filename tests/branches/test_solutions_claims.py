"""Whatever is called unique or exhaustive must agree with brute force."""

from __future__ import annotations

import numpy as np
import pytest

from hemivar.branches import find_solutions
from hemivar.certificates import certify
from hemivar.solvers import Status, solve

from .brute_force import Case, random_case


def problems_with(case: Case, starts: int = 2) -> tuple[list[str], bool, bool]:
    """What is wrong with the claims about a problem, and whether anything was claimed exhaustive, unique."""
    wrong: list[str] = []
    known = case.solutions()
    size = 1.0 + max((float(np.abs(r).max()) for r in known), default=0.0)
    solved = solve(case.problem)
    found = find_solutions(case.problem, starts=starts, max_solutions=1000)
    places = [s.local.ravel() for s in found]

    def near(r: np.ndarray, others: list[np.ndarray], reach: float) -> bool:
        return any(np.abs(r - other).max() <= reach for other in others)

    if found.exhaustive:
        wrong += [f"missing {r}" for r in known if not near(r, places, 1e-5 * size)]
        if solved.status is Status.CONVERGED and not near(solved.local.ravel(), places, 1e-5 * size):
            wrong.append(f"missing what solve returns, {solved.local.ravel()}")
    for i, r in enumerate(places):
        if near(r, places[:i], 1e-6 * size):
            wrong.append(f"twice {r}")
    pairs = [(solved.unknowns, solved.multiplier), (np.zeros_like(case.problem.load), None)]
    pairs += [(s.unknowns, s.multiplier) for s in found]
    unique = False
    for u, lam in pairs:
        claim = certify(case.problem, u, lam).unique
        unique |= claim is True
        if claim is True and len(known) > 1:
            wrong.append(f"unique, but {known}")
        if claim is False and len(known) == 1 and found.exhaustive and len(found) == 1:
            wrong.append("not unique, but it is")
    return wrong, found.exhaustive, unique


@pytest.mark.parametrize("block", [0, *(pytest.param(k, marks=pytest.mark.slow) for k in range(1, 25))])
def test_claims_agree_with_brute_force(block: int) -> None:
    exhaustive = unique = 0
    for seed in range(12 * block, 12 * block + 12):
        wrong, complete, one = problems_with(random_case(seed))
        assert not wrong, f"seed {seed}: {wrong}"
        exhaustive += complete
        unique += one
    assert exhaustive > 2
    assert unique > 0
