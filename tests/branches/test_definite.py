"""A stiffness with an eigenvalue below zero has no search for solutions."""

from __future__ import annotations

import pytest

import hemivar as hv
from tests.certificates.test_definite import indefinite_arrays


@pytest.mark.parametrize("scale", [1.0, 1e-9, 1e12])
def test_indefinite_arrays_are_refused(scale: float) -> None:
    for problem in indefinite_arrays(scale):
        with pytest.raises(hv.errors.ProblemError, match=r"not positive semidefinite.*eigenvalue is at most -"):
            hv.find_solutions(problem)
