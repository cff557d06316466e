"""Random laws with upward and downward jumps and softening pieces, on random small bodies."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from hemivar.branches import find_solutions
from hemivar.solvers import NonsmoothNewton, Search, Status, solve
from hemivar.systems import Workspace, condense
from hemivar.systems.chain import chain_of

from .random_problems import random_problem


def _newton_never_fails(seeds: range) -> tuple[int, int, int]:
    """Problems, problems enumerated, and how often the method ends at the global minimum."""
    counted = lowest = 0
    for seed in seeds:
        problem = random_problem(seed)
        system = condense(problem)
        found = solve(problem, NonsmoothNewton(), workspace=Workspace.holding(system))
        assert found.status is Status.CONVERGED, f"seed {seed}: {found.status}, {found.residual.relative}"
        energies = np.array([line.energy for line in found.history])
        assert (np.diff(energies) <= 1e-12 * (1.0 + np.abs(energies[0]))).all(), f"seed {seed}: the energy rises"
        if chain_of(system).combinations > 20_000:
            continue
        known = find_solutions(problem, max_solutions=10_000, workspace=Workspace.holding(system))
        if not known.exhaustive:
            continue
        counted += 1
        assert found.energy >= known[0].energy - 1e-9 * (1.0 + abs(known[0].energy)), f"seed {seed}: below all known"
        minima = np.array([s.local for s in known.minima])
        assert np.abs(minima - found.local).max(axis=(1, 2)).min() < 1e-6, f"seed {seed}: no local minimum"
        downhill = solve(problem, NonsmoothNewton(search=Search.DOWNHILL), workspace=Workspace.holding(system))
        assert downhill.status is Status.CONVERGED
        assert np.abs(minima - downhill.local).max(axis=(1, 2)).min() < 1e-6
        lowest += found.energy <= known[0].energy + 1e-9 * (1.0 + abs(known[0].energy))
    return len(seeds), counted, lowest


def test_newton_ends_at_a_local_minimum_every_time() -> None:
    total, counted, lowest = _newton_never_fails(range(60))
    assert counted > 0.8 * total
    assert lowest > 0.9 * counted


@pytest.mark.slow
def test_newton_ends_at_a_local_minimum_on_a_thousand_problems(
    record_property: Callable[[str, object], None],
) -> None:
    total, counted, lowest = _newton_never_fails(range(1000))
    record_property("problems", total)
    record_property("rate of global minimisers found by newton", lowest / counted)
    print(f"{total} problems, {counted} enumerated, newton at the global minimum in {lowest / counted:.1%}")
    assert lowest > 0.95 * counted


def _rates(seeds: range, starts: int) -> tuple[float, float, int]:
    """Of enumerated problems, how often the search from many starts finds the global minimiser; part of all found."""
    lowest, found, existing, counted = 0, 0, 0, 0
    for seed in seeds:
        problem = random_problem(seed)
        system = condense(problem)
        if chain_of(system).combinations > 20_000:
            continue
        known = find_solutions(problem, max_solutions=10_000, workspace=Workspace.holding(system))
        search = find_solutions(
            problem, max_solutions=10_000, enumerate_up_to=0, starts=starts, workspace=Workspace.holding(system)
        )
        assert len(search) <= len(known)
        counted += 1
        lowest += search[0].energy <= known[0].energy + 1e-9 * (1.0 + abs(known[0].energy))
        found += len(search)
        existing += len(known)
    return lowest / counted, found / existing, counted


def test_search_from_many_starts_finds_the_global_minimum() -> None:
    lowest, found, _ = _rates(range(6), 5)
    assert lowest == 1.0
    assert found > 0.9


@pytest.mark.slow
def test_search_from_many_starts_finds_the_global_minimum_in_most_cases(
    record_property: Callable[[str, object], None],
) -> None:
    lowest, found, counted = _rates(range(3000, 3080), 10)
    record_property("rate of global minimisers", lowest)
    record_property("part of all solutions", found)
    print(f"{counted} problems: global minimiser found in {lowest:.1%}, {found:.1%} of all solutions")
    assert lowest >= 0.95
