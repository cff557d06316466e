"""The mean of a law over the way from one penetration to another."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import quad

from hemivar.errors import ProblemError
from hemivar.laws import (
    Adhesive,
    Capped,
    Compliance,
    NoContact,
    PiecewiseQuadratic,
    Signorini,
    Softening,
    Superpotential,
    averaged,
)
from hemivar.laws.piecewise_law import stack
from tests.samples import sampled

from .catalogue import conforms

TABLES: dict[str, Superpotential] = {
    "spring": Compliance(3.0),
    "softening": Softening(2.0, 0.1, 0.5),
    "glue": Adhesive(5.0, 1.0, 2.0, compression=3.0),
    "brittle glue": Adhesive(5.0, 1.0, compression=3.0),
    "capped": Capped(2.0, 0.1),
    "none": NoContact(),
    "hardening": PiecewiseQuadratic([0.0, 0.1, 0.3], [0.0, 1.0, 4.0, 2.0], np.zeros(3)),
    "saw": PiecewiseQuadratic([-0.2, 0.0, 0.1], [1.0, 2.0, 1.0, 3.0], [-0.3, 0.4, -0.2]),
    "kink": PiecewiseQuadratic([0.25], [0.5, 1.0], [0.7]),
}


def _slope(r: float, law: Superpotential) -> float:
    return float(law.derivative(np.array([r]))[0])


STARTS = np.array([-0.5, -0.05, 0.0, 0.05, 0.1, 0.17, 0.25, 1.0])


@pytest.mark.parametrize("name", sampled(TABLES, 4))
def test_means_conform(name: str) -> None:
    down = {"capped": (0.1,), "saw": (-0.2, 0.1), "brittle glue": (-0.2,)}.get(name, ())  # alpha is infinite there
    conforms(averaged(TABLES[name], np.array([start for start in STARTS if start not in down])))


@pytest.mark.parametrize("name", TABLES)
def test_the_work_of_a_step_is_the_change_of_energy(name: str) -> None:
    law = TABLES[name]
    for start in STARTS:
        made = averaged(law, start)
        r = np.linspace(-1.2, 1.3, 47) + 1e-3
        wanted = (law.value(r) - law.value(np.array([start]))) / (r - start)
        np.testing.assert_allclose(made.derivative(r), wanted, rtol=1e-11, atol=1e-13)
        near = start + np.array([-1e-9, 1e-9])
        np.testing.assert_allclose(made.derivative(near), law.derivative(near), rtol=1e-7, atol=1e-8)
        for end in (-0.7, 0.02, 0.6):
            points = sorted({start, *law.knots[0][np.isfinite(law.knots[0])].tolist()})
            inside = [p for p in points if min(0.0, end) < p < max(0.0, end)]
            by_hand, _ = quad(_slope, 0.0, end, args=(made,), points=inside or None)
            assert made.value(np.array([end]))[0] == pytest.approx(by_hand, abs=1e-9)


def test_alpha_is_half_that_of_the_law() -> None:
    law = TABLES["softening"]
    assert averaged(law, 0.15).weak_convexity[0] == pytest.approx(0.25)
    assert averaged(law, -10.0).weak_convexity[0] < 0.25
    assert (averaged(TABLES["hardening"], STARTS).weak_convexity == 0.0).all()
    capped = averaged(Capped(2.0, 0.1), 0.0)  # falls by .2 at .1: the mean falls as .01/r there
    assert capped.weak_convexity[0] == pytest.approx(0.01 / 0.1**2)
    assert np.isinf(averaged(Capped(2.0, 0.1), 0.1).weak_convexity[0])


def test_of_stacked_laws_each_part_is_averaged() -> None:
    both = stack([(Softening(2.0, 0.1, 0.5), 2), (Compliance(3.0), 3)])
    start, r = np.linspace(-0.1, 0.2, 5), np.linspace(0.31, -0.2, 5)
    made = averaged(both, start)
    np.testing.assert_allclose(made.derivative(r), (both.value(r) - both.value(start)) / (r - start), rtol=1e-12)


@pytest.mark.parametrize(
    ("law", "words"),
    [(Compliance(3.0, 2.5), "not piecewise quadratic"), (Signorini(), "ends at some penetration")],
)
def test_other_laws_are_refused(law: Superpotential, words: str) -> None:
    with pytest.raises(ProblemError, match=words):
        averaged(law, 0.0)
