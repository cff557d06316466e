"""A law of no contact points at all, as a rank without any has; parameters of different numbers of points."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from hemivar.errors import ProblemError
from hemivar.laws import Adhesive, Capped, Compliance, Signorini, Superpotential, affine, bonded, envelope, plus, secant
from hemivar.laws.piecewise_law import moved
from hemivar.laws.transformed import pushing
from hemivar.laws.transformed.averages import averaged


@pytest.mark.parametrize("law", [Signorini(), Compliance(20.0)], ids=str)
def test_a_law_moved_at_no_points_has_no_rows(law: Superpotential) -> None:
    made = moved(law, np.full(1, 2.0), np.zeros(0))
    assert made.rows == 0
    assert made.knots.shape[0] == 0
    assert np.broadcast_to(made.domain.upper, (0,)).size == 0
    assert made.value(np.zeros(0)).shape == (0,)


@pytest.mark.parametrize("law", [Capped(20.0, 0.1), Compliance(20.0, 2.0)], ids=lambda law: law.name)
def test_sums_with_laws_of_no_points_are_made(law: Superpotential) -> None:
    nowhere = affine(Capped(3.0, 0.2), 2.0, np.zeros(0))
    for made in (plus(law, nowhere), plus(nowhere, law), bonded(law, 1.0, 0.1, 1.0, np.zeros(0), 0.1)):
        assert made.value(np.zeros(0)).shape == (0,)
        assert made.local_argmin(np.zeros(0), np.zeros(0)).shape == (0,)


EMPTY, SHORT, LONG = np.zeros(0), [0.1, 0.2], [0.1, 0.2, 0.3]


@pytest.mark.parametrize(
    "law", [Capped(20.0, 0.1), Adhesive(5.0, 0.1), Compliance(20.0, 2.0)], ids=lambda law: law.name
)
@pytest.mark.parametrize(
    "make",
    [
        lambda law: bonded(law, EMPTY, 0.1, 1.0, 1.0, 0.1),
        lambda law: bonded(law, 1.0, EMPTY, 1.0, 1.0, 0.1),
        lambda law: bonded(law, 1.0, 0.1, EMPTY, 1.0, 0.1),
        lambda law: bonded(law, 1.0, 0.1, 1.0, 1.0, EMPTY),
        lambda law: affine(law, EMPTY),
        lambda law: envelope(law, EMPTY),
    ],
)
def test_empty_parameters_are_refused(law: Superpotential, make: Callable[[Superpotential], object]) -> None:
    with pytest.raises(ProblemError, match=r"shape \(0,\)|is a ndarray; give a positive number"):
        make(law)


@pytest.mark.parametrize(
    "make",
    [
        lambda: bonded(Compliance(20.0), SHORT, LONG, 1.0, 1.0, 0.1),
        lambda: bonded(Compliance(SHORT), 1.0, 0.1, 1.0, LONG, 0.1),
        lambda: affine(Compliance(SHORT), LONG),
        lambda: affine(Compliance(20.0), SHORT, LONG),
        lambda: envelope(Compliance(SHORT), LONG),
        lambda: secant(Adhesive(SHORT, 0.1), LONG),
        lambda: averaged(Compliance(SHORT), np.array(LONG)),
        lambda: plus(Compliance(SHORT), Capped(LONG, 0.1)),
    ],
)
def test_parameters_of_different_numbers_of_points_are_refused(make: Callable[[], object]) -> None:
    with pytest.raises(ProblemError, match=r"given for \[2, 3\] contact points; make them equal"):
        make()


def test_damping_that_cannot_pull_is_made_at_no_points() -> None:
    made = pushing(Compliance(20.0), affine(Compliance(3.0), 2.0, np.zeros(0)))
    assert made.value(np.zeros(0)).shape == made.local_argmin(np.zeros(0), np.zeros(0)).shape == (0,)
