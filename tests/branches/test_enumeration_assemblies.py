"""Random assemblies of two and three bodies, held and not, against all their equilibria by brute force."""

from __future__ import annotations

import numpy as np
import pytest

import hemivar as hv
from hemivar.discrete import DiscreteProblem
from tests.solvers.pieces_of_assemblies import (
    Assembly,
    all_equilibria,
    margin,
    misfit,
    number_of_choices,
    random_assembly,
)

MARGIN = 1e-3
MOST = 3000


def posed(number: int) -> tuple[Assembly, DiscreteProblem]:
    """An assembly that brute force can do."""
    rng = np.random.default_rng([44, number])
    while True:
        made = random_assembly(rng)
        problem = hv.discretize(made.statement, check_coercivity=False)
        if number_of_choices(made, problem) <= MOST:
            return made, problem


def looked_at(number: int) -> str:
    """What became of an assembly, and whether that is right."""
    made, bare = posed(number)
    held = margin(made, bare)
    problem, refusal = None, ""
    try:
        problem = hv.discretize(made.statement)
    except hv.errors.SupportError as error:
        refusal = str(error)
    if problem is None:
        assert "free to move" in refusal
        assert "part 'b" in refusal
        assert held < MARGIN, f"{number}: refused, but forces balance the load by {held:.1e}: {refusal}"
        assert made.glued or not len(all_equilibria(made, bare).local), f"{number}: refused, but it has an equilibrium"
        return "refused"
    assert held > -MARGIN or made.glued or problem.idle, f"{number}: nothing balances the load, and nothing is said"
    known = all_equilibria(made, problem)
    found = hv.solve(problem, max_time=60.0)
    if found.status is not hv.Status.CONVERGED:
        assert held < MARGIN, f"{number}: {found.status}, but forces balance the load by {held:.1e}"
        assert not known.more, f"{number}: {found.status}, but there are equilibria"
        assert not len(known.local), f"{number}: {found.status}, but there are equilibria"
        return "beyond its limit"
    assert misfit(made, problem, found.unknowns, found.multiplier) < 1e-7, f"{number}: no equilibrium"
    size = np.abs(found.unknowns).max()
    if not known.more:
        apart = np.abs(known.local - found.local).max(axis=(1, 2))
        assert apart.min() < 1e-5 * size, f"{number}: none of {len(apart)} equilibria"
    certificate = hv.certify(found)
    if certificate.unique is True:
        assert not known.more, f"{number}: not unique"
        assert len(known.local) == 1, f"{number}: not unique"
    if "global" in certificate.kind or "unique minimiser" in certificate.kind:
        lowest = known.energies.min(initial=np.inf)
        assert found.energy - problem.constant <= lowest + 1e-7 * abs(lowest), f"{number}: not the global minimum"
    everything = hv.find_solutions(problem, starts=3, max_solutions=500)
    worst = max(misfit(made, problem, one.unknowns, one.multiplier) for one in everything)
    assert worst < 1e-7, f"{number}: no equilibrium among all"
    if everything.exhaustive and not known.more:
        assert len(everything) == len(known.local), f"{number}: {len(everything)} of {len(known.local)} equilibria"
    return "held" if certificate.unique is True else "held, perhaps not only so"


def test_ten_assemblies_are_solved_as_brute_force_says() -> None:
    seen = [looked_at(number) for number in range(10)]
    assert sum(one.startswith("held") for one in seen) >= 5
    assert seen.count("refused") >= 1


def test_a_body_that_ran_away_is_no_solution() -> None:
    """Deflation sends a block that friction holds a million million lengths off, where rounding hides the load."""
    assert looked_at(70).startswith("held")


@pytest.mark.slow
@pytest.mark.parametrize("block", range(10))
def test_hundreds_of_assemblies_are_solved_as_brute_force_says(block: int) -> None:
    seen = [looked_at(number) for number in range(30 * block, 30 * (block + 1))]
    assert any(one.startswith("held") for one in seen)
