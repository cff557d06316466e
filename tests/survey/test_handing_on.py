"""A method that fails hands on where none was asked for, and what is printed as a remedy is one."""

from __future__ import annotations

import numpy as np
import pytest

from hemivar.laws import ContactLaw, PiecewiseQuadratic, Tresca
from hemivar.solvers import NonsmoothNewton, Status, solve
from hemivar.survey import Powell, PrimalDualActiveSet
from tests.problems import discrete_square
from tests.solvers.test_fallbacks import (
    SOLVING,
    _Stuck,
    stuck,  # noqa: F401
)


@pytest.mark.usefixtures("stuck")
def test_where_all_fail_the_best_iterate_is_returned(monkeypatch: pytest.MonkeyPatch) -> None:
    problem = discrete_square(n=8)
    monkeypatch.setattr(SOLVING, "others", lambda *given: [Powell(ftol=1e-3, xtol=1e-3)])
    found, alone = solve(problem), solve(problem, Powell(ftol=1e-3, xtol=1e-3))
    assert found.status is alone.status is not Status.CONVERGED
    assert found.residual.relative == alone.residual.relative < solve(problem, _Stuck()).residual.relative
    assert found.remarks[0].startswith("direct-powell came nearest: stuck ended stalled after 13 steps")


def test_newton_helps_where_a_method_was_inaccurate_or_left_the_numbers() -> None:
    problem = discrete_square(n=16)
    assert solve(problem, Powell(ftol=1e-3, xtol=1e-3)).status is Status.INACCURATE
    assert solve(problem, NonsmoothNewton()).status is Status.CONVERGED
    assert solve(problem, _Stuck(value=np.nan)).status is Status.NONFINITE


def test_newton_helps_where_active_sets_repeat() -> None:
    softening = PiecewiseQuadratic([0.0, 0.02, 0.05], [0.0, 20.0, -8.0, 0.0], [0.0] * 3)  # type: ignore[arg-type]
    problem = discrete_square(n=4).with_(law=ContactLaw(softening, Tresca(0.1)))
    assert solve(problem, PrimalDualActiveSet()).status is Status.CYCLING
    assert solve(problem, NonsmoothNewton()).status is Status.CONVERGED
