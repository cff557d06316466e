"""Small ones of the problems that the benchmarks time, for both engines."""

from __future__ import annotations

from collections.abc import Callable

import hemivar as hv
from hemivar import gallery
from tests import bodies

__all__ = ["PROBLEMS", "RTOL"]

RTOL = hv.Controls(rtol=1e-9)


def distributed_cube(n: int) -> hv.ContactProblem:
    """The one of benchmarks/distributed.py."""
    return bodies.cube(
        hv.Contact(hv.laws.ThresholdCompliance(q_max=0.3, p_const=2.0), hv.Tresca(0.5)),
        n,
        body_force=(-0.8, -0.4, -0.8),
    )


PROBLEMS: dict[str, tuple[Callable[[int], hv.ContactProblem], int]] = {
    "square": (lambda n: gallery.survey("5.1", n, "right"), 64),
    "square that weakens": (lambda n: gallery.survey_logarithmic(0.3, n, "right"), 64),
    "cube": (distributed_cube, 16),
    "cube that weakens": (lambda n: gallery.survey_cube_logarithmic(0.3, n), 16),
}
