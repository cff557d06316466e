"""What a solution says about its contact points."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from hemivar.laws import Bilateral, ContactLaw, Signorini, Tresca
from hemivar.mechanics import Contact
from hemivar.solvers import NormalState, solve
from hemivar.solvers.contact_states import KINDS, Kind, contact_states
from tests.problems import square

OPEN, STICK, SLIP, _, _, BONDED_STICK, BONDED_SLIP, *_ = KINDS
RUBBED = ContactLaw(Bilateral(), Tresca(0.1)).at(None)


@pytest.mark.parametrize(
    ("local", "multiplier", "kind"),
    [
        ((-1.0, 0.0), (0.0, 0.0), OPEN),
        ((-1e-6, 0.0), (0.0, 0.0), OPEN),
        ((-1e-6, 1.0), (0.0, 0.0), OPEN),
        ((-1e-12, 0.0), (0.0, 0.0), STICK),
        ((-1e-6, 0.0), (1e-12, 0.0), OPEN),
        ((-1e-6, 0.0), (1e-6, 0.0), STICK),
        ((-1e-6, 0.0), (-1e-6, 0.0), BONDED_STICK),
        ((-1e-6, 1e-6), (-1e-6, 0.0), BONDED_SLIP),
        ((-1e-6, 0.0), (-1e-12, 0.0), OPEN),
        ((-1e-12, 0.0), (-1e-6, 0.0), BONDED_STICK),
        ((-1e-6, 1e-6), (1e-6, 0.0), SLIP),
        ((1e-6, 0.0), (0.0, 0.0), STICK),
        ((0.0, 1e-6), (1.0, 0.1), SLIP),
        ((0.0, -1e-6), (1.0, 0.1), SLIP),
        ((0.0, 1e-12), (1.0, 0.1), STICK),
    ],
)
@pytest.mark.parametrize("scale", [1.0, 1e-20, 1e20])
def test_a_contact_point_is_judged_by_a_billionth_of_the_largest(
    local: tuple[float, float], multiplier: tuple[float, float], kind: Kind, scale: float
) -> None:
    """Beside it stands a point that moves and presses by one."""
    r, lam = scale * np.array([local, (-1.0, 1.0)]), np.array([multiplier, (-1.0, 0.0)]) / scale
    assert KINDS[contact_states(RUBBED, r, lam).numbers[0]] == kind
    assert KINDS[contact_states(RUBBED, r[:1], lam[:1], (scale, 1.0 / scale)).numbers[0]] == kind


def test_a_slip_in_space_counts_by_its_length() -> None:
    r = np.array([[0.1, 0.0, 0.0], [0.1, 0.8e-9, 0.8e-9], [1.0, 0.0, 0.5e-9]])
    found = contact_states(RUBBED, r, np.zeros((3, 3)))
    assert [KINDS[number] for number in found.numbers] == [STICK, SLIP, STICK]


def test_the_length_of_contact_is_that_of_the_points_that_are_not_open() -> None:
    apart = {"bottom": Contact(Signorini(), Tresca(0.1), gap=lambda x: np.where(x[:, 0] > 0.5, 1.0, 0.0))}
    solution = solve(replace(square("rigid"), contact=apart))
    shut = solution.normal_state != NormalState.OPEN
    assert 0 < shut.sum() < shut.size
    assert solution.contact_length == pytest.approx(solution.problem.contact.weights[shut].sum())
    assert solution.normal_force == pytest.approx(solution.problem.contact.weights @ solution.pressure)
