"""Bodies by bases and forms of scikit-fem: against the library's own elements, and mixed bodies in closed form."""

from __future__ import annotations

import numpy as np
import pytest

import hemivar as hv
from hemivar.fem import FormBody
from tests.fem.test_forms import incompressible, taylor_hood


def test_couette_flow_over_a_wall_whose_drag_weakens_has_three_states() -> None:
    """mu (U - s)/H = tau(s): the roots of a scalar equation."""
    basis, speed = taylor_hood(1), 1.0
    held = {"top": {"u^1^1": speed, "u^2^1": 0.0}} | {side: {"u^2^1": 0.0} for side in ("bottom", "left", "right")}
    body = FormBody(basis, incompressible, supports=held, fixed=[int(basis.get_dofs("top").all(["u^2"])[0])])
    drag = hv.Softening(stiffness=20.0, limit=0.1, softening=4.0)
    problem = body.problem({"bottom": hv.Contact(drag)}, trace=lambda u, p: u[0])
    # 0.8 (1 - s) is 20 s, 2 - 4 (s - 0.1), and 0
    roots = (0.8 / 20.8, 0.5, 1.0)
    found = hv.find_solutions(problem).solutions
    uniform = sorted(float(one.unknowns.mean()) for one in found if np.ptp(one.unknowns) < 1e-8)
    assert uniform == pytest.approx(roots, abs=1e-9)
