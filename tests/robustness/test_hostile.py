"""A few hundred hostile inputs, each in a process of its own: nothing may go wrong with any of them.

``python -m tests.robustness --cases 3000 --seed 2`` runs more, and ``--case SEED:NUMBER`` one of them again.
"""

from __future__ import annotations

import os

import pytest

from tests.robustness.generate import FAMILIES, SLOW_TO_MAKE, family_of, make_case
from tests.robustness.judge import FAULTS, table
from tests.robustness.pool import run_cases

CASES = 300


@pytest.mark.slow
@pytest.mark.skipif(not os.path.isdir("/proc/self"), reason="limits and states of processes are those of Linux")
def test_hostile_inputs_end_in_a_clean_error_or_in_a_right_answer() -> None:
    outcomes = list(run_cases(seed=20, numbers=range(CASES), jobs=2))
    print(table(outcomes))
    bad = [o for o in outcomes if o.verdict in FAULTS]
    told = "\n".join(f"{o.name} {o.verdict}: {o.faults[o.verdict][:200]} ({o.family}: {o.note[:100]})" for o in bad)
    assert not bad, f"{table(outcomes)}\n{told}"
    # a harness in which nothing is accepted, or nothing examined, would pass as well
    assert sum(o.verdict == "accepted, examined" for o in outcomes) > CASES // 6
    assert sum(o.verdict == "clean error" for o in outcomes) > CASES // 4


def test_a_case_is_the_same_in_any_order_and_place() -> None:
    numbers = [n for n in range(80) if family_of(7, n) not in SLOW_TO_MAKE]
    forwards = {n: make_case(7, n) for n in numbers}
    assert all(make_case(7, n) == forwards[n] for n in reversed(numbers))
    assert make_case(8, numbers[0]) != forwards[numbers[0]]


def test_every_family_makes_cases() -> None:
    for family in FAMILIES:
        if family in SLOW_TO_MAKE:
            continue
        cases = [make_case(1, n, family) for n in range(40)]
        assert {case.family for case in cases} == {family}
        assert len({case.note for case in cases} | {str(case.files) for case in cases}) > 20
        assert all(case.arguments is not None for case in cases)
