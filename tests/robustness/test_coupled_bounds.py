"""No guaranteed or conditional bound is below the distance to a finer solution."""

from __future__ import annotations

import pytest

from tests.robustness.coupled_bounds import judge_coupled, make
from tests.samples import sampled


@pytest.mark.parametrize("number", sampled(range(72), range(6)))
def test_bounds_of_random_bodies_on_laws_that_couple(number: int) -> None:
    case = make(number)
    found = judge_coupled(case)
    assert found.off < 1e-7  # the finer solution is one, by arrays that are not the library's
    assert found.certified != "estimate" or any("sampled" in one or "samples" in one for one in found.reasons)
    assert found.certified != "none" or found.constant >= 1.0
    if found.certified in ("guaranteed", "conditional"):
        assert found.error <= found.bound * (1.0 + 1e-8)
        coarse = 3.0 if case.problem.mesh.dim == 2 else 5.0  # of boxes of a cell or two
        assert found.index <= coarse / (1.0 - found.constant)
