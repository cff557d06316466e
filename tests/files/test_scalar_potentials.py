"""Scalar problems whose flux is not linear in the gradient: derivatives, bounds, closed forms."""

from __future__ import annotations

import pytest

import hemivar as hv
from hemivar.discrete.potential import Potential
from hemivar.errors import ProblemError
from hemivar.fem import discretize
from tests.fem.test_scalar_potentials import ENERGIES, strip_on_springs


def test_its_bulk_and_what_refuses_it() -> None:
    problem = strip_on_springs(ENERGIES[0])
    assert not problem.material.linear
    assert isinstance(discretize(problem).bulk, Potential)
    with pytest.raises(ProblemError, match="a problem file cannot express"):
        hv.write_problem(problem, "nowhere.toml")
