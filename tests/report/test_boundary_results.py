"""Results by boundary: forces by name, reactions in equilibrium, tables of contact points."""

from __future__ import annotations

import sys
from types import SimpleNamespace

import numpy as np
import pytest

from hemivar.errors import ProblemError
from hemivar.fem import discretize
from hemivar.solvers import solve
from tests.solvers.test_boundary_results import CUBE, PLANE

COLUMNS = {
    2: "boundary x y normal_x normal_y weight gap penetration slip pressure friction "
    "normal_state tangential_state force_x force_y",
    3: "boundary x y z normal_x normal_y normal_z weight gap penetration slip_1 slip_2 pressure friction_1 friction_2 "
    "normal_state tangential_state force_x force_y force_z",
}


@pytest.mark.parametrize("dim", [2, 3])
def test_dataframe(dim: int, monkeypatch: pytest.MonkeyPatch) -> None:
    solution = solve(discretize(PLANE if dim == 2 else CUBE))
    monkeypatch.setitem(sys.modules, "pandas", SimpleNamespace(DataFrame=dict))
    columns = dict(solution.to_dataframe())  # type: ignore[call-overload]
    assert list(columns) == COLUMNS[dim].split()
    assert all(np.shape(column) == (solution.problem.contact_points,) for column in columns.values())
    np.testing.assert_array_equal(columns["force_y"], solution.contact_table["force"][:, 1])


def test_dataframe_of_pandas() -> None:
    pytest.importorskip("pandas")
    frame = solve(discretize(PLANE)).to_dataframe()
    assert list(frame.columns) == COLUMNS[2].split()
    assert frame.groupby("boundary")["force_y"].sum()["bottom"] > 0.0


def test_dataframe_without_pandas(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(ProblemError, match="pip install pandas"):
        solve(discretize(PLANE)).to_dataframe()
