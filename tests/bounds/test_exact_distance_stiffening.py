"""A body that the stress of its load stiffens has no bound of the distance to the exact solution."""

from __future__ import annotations

import hemivar as hv
from tests.solvers.test_stiffening import pressed_bar


def test_the_certificate_says_why_there_is_no_bound() -> None:
    certificate = hv.solve(pressed_bar()).certify(exact=True)
    assert "not available with stress stiffening" in certificate.exact.reasons[0]
