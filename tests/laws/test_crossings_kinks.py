"""Where laws bend along a way, against the jumps of the second derivative that are seen along it."""

from __future__ import annotations

import numpy as np
import pytest

from hemivar.basics.types import Array
from hemivar.laws import (
    Adhesive,
    BilinearCohesion,
    Compliance,
    ContactLaw,
    CoupledFormulaLaw,
    Friction,
    MixedMode,
    OrthotropicFriction,
    PenetrationBound,
    Softening,
    StaticKinetic,
    Tresca,
    VectorLaw,
)
from hemivar.laws.coupled.joined import JoinedLaw, join_laws
from hemivar.laws.coupled.orthotropic import OrthotropicLaw
from hemivar.laws.coupled.shifted import ShiftedLaw
from hemivar.laws.vector_law import frozen_at

#: Parts of a way.
_STEPS = 20_000

_GLUE = MixedMode(BilinearCohesion(0.3, 0.09, 3.0), 1.5, Compliance(2.0))
_FORMULA = CoupledFormulaLaw("0.02*(1 - exp(-(min(r, 0)^2 + 4*s^2)/0.09)) + 2*max(r, 0)^2 + 0.05*s", reach=2.0)
_PLAIN = ContactLaw(Softening(4.0, 0.2, 1.5), StaticKinetic(0.3, 0.1, 0.2))
LAWS: dict[str, tuple[VectorLaw, int]] = {
    "normal and friction": (_PLAIN, 2),
    "normal and friction in space": (_PLAIN, 3),
    "a bound of the penetration": (
        ContactLaw(Compliance(1.0), Friction(PenetrationBound(([0.0, 9.0], [0.1, 1.0])))),
        2,
    ),
    "glue": (_GLUE, 2),
    "glue in space": (_GLUE, 3),
    "formula": (_FORMULA, 2),
    "orthotropic": (OrthotropicLaw(Compliance(2.0), OrthotropicFriction(0.4, ratio=2.0)), 3),
    "shifted": (ShiftedLaw(ContactLaw(Adhesive(3.0, 0.2, 0.9), Tresca(0.3)), np.array([[0.1]]), np.array([[0.2]])), 2),
    "joined": (join_laws([(_GLUE.at(np.zeros((4, 2))), 4), (_PLAIN.at(np.zeros((4, 2))), 4)]), 2),
}


def ways(c: int, count: int = 8) -> tuple[Array, Array]:
    """Ways that cross r = 0, the first with a slip that turns round."""
    rng = np.random.default_rng(5)
    start, end = rng.uniform(-1.0, 1.0, (2, count, c))
    start[:, 0], end[:, 0] = -np.abs(start[:, 0]), np.abs(end[:, 0])
    end[::2, 1:] = -rng.uniform(0.3, 1.0, (count // 2, 1)) * start[::2, 1:]
    return start, end


@pytest.mark.parametrize("name", LAWS)
def test_no_bend_is_left_out(name: str) -> None:
    law, c = LAWS[name]
    start, end = ways(c)
    law = law if isinstance(law, JoinedLaw) else law.at(np.zeros((len(start), c)))
    found = law.kinks_along(start, end, np.zeros(start.shape))
    t = np.linspace(0.0, 1.0, _STEPS + 1)
    seen = 0
    for way, (first, last) in enumerate(zip(start, end, strict=True)):
        one = law.take(np.full(_STEPS + 1, way))
        r = first + t[:, None] * (last - first)
        lam = frozen_at(one, r).nearest_multiplier(r, np.zeros(r.shape))
        slope = (lam * (last - first)).sum(axis=1)
        bend = np.diff(slope) * _STEPS
        jump = np.abs(np.diff(bend))
        smooth = np.maximum(np.roll(jump, 3), np.roll(jump, -3))
        at = t[1:-1][(jump > 20.0 * smooth) & (jump > 0.02 * np.abs(bend).mean())]
        inside = at[(at > 0.001) & (at < 0.999)]
        seen += inside.size
        for place in inside:
            assert np.nanmin(np.abs(found[way] - place)) < 3.0 / _STEPS, place
    assert seen >= len(start)


def test_a_way_that_bends_meets_the_knots_of_laws_that_split() -> None:
    law = _PLAIN.at(np.zeros((1, 2)))
    start, end, bend = np.array([[-0.3, 0.2]]), np.array([[0.5, -0.4]]), np.array([[1.2, -0.7]])
    found = law.kinks_along(start, end, bend)[0]
    found = found[(found > 0.0) & (found < 1.0)]
    place = start + found[:, None] * (end - start) - (found * (1.0 - found))[:, None] * bend
    normal = np.abs(place[:, :1] - law.normal.knots).min(axis=1)
    slip = np.abs(np.abs(place[:, 1:]) - np.abs(law.tangential.knots)).min(axis=1)
    assert (np.minimum(normal, slip) < 1e-12).all()
    assert found.size >= 3
