"""``method=``: a name or an object, with the same result wherever it is taken."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import hemivar as hv
from hemivar.solvers import METHODS
from hemivar.solvers.methods import as_method
from hemivar.solvers.solve import method_for
from tests.problems import square

COULOMB = replace(square(n=4), contact={"bottom": hv.Contact(normal=hv.Signorini(), friction=hv.Coulomb(0.3))})


@pytest.mark.parametrize("name", METHODS)
def test_a_name_is_the_object_of_that_name(name: str) -> None:
    assert as_method(name) is METHODS[name]
    assert as_method(METHODS[name]) is METHODS[name]
    assert as_method(None) is None


def test_a_name_is_suited_to_the_problem_and_an_object_stays() -> None:
    problem = hv.discretize(COULOMB)
    chosen = method_for("newton", problem)
    assert chosen is not None
    assert chosen.handles_state
    assert method_for(METHODS["newton"], problem) is METHODS["newton"]


def test_a_march_takes_a_name() -> None:
    evolution = hv.Evolution(square(n=4))
    last = [hv.march(evolution, 0.2, step=0.1, method=method)["elastic"]
            for method in ("multigrid", METHODS["multigrid"])]  # fmt: skip
    np.testing.assert_array_equal(*last)
    assert hv.march(hv.Evolution(COULOMB), 0.1, step=0.1, method="newton").ended == "finished"
