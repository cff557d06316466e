"""Fixed points by Anderson's mixing."""

from __future__ import annotations

import numpy as np
import pytest

from hemivar.basics.anderson import Anderson


@pytest.mark.parametrize("rates", [(0.5,), (-3.0, 0.9), (-40.0, -3.0, 0.1, 7.0)])
def test_an_affine_map_takes_as_many_places_as_it_has_rates(rates: tuple[float, ...]) -> None:
    """However strongly it repels: one more evaluation than GMRES has steps, and one that confirms."""
    rng = np.random.default_rng(1)
    turn, _ = np.linalg.qr(rng.normal(size=(30, 30)))
    matrix = turn @ np.diag(np.resize(rates, 30)) @ turn.T
    shift, place = rng.normal(size=30), np.zeros(30)
    exact = np.linalg.solve(np.eye(30) - matrix, shift)
    mixing = Anderson()
    for _ in range(len(rates) + 1):
        place = mixing.after(place, matrix @ place + shift - place)
    assert np.abs(place - exact).max() < 1e-8 * np.abs(exact).max()
    assert np.abs(matrix @ place + shift - place).max() < 1e-7


def test_a_place_that_the_map_leaves_stays() -> None:
    mixing, place = Anderson(), np.array([1.0, 2.0])
    for _ in range(3):
        place = mixing.after(place, np.zeros(2))
    assert place.tolist() == [1.0, 2.0]


def test_contact_makes_a_map_that_is_only_piecewise_affine() -> None:
    """``x = 3 - 4 max(x, 0)`` and ``y = -2 y - 1 + x``: x = 3/5, y = -2/15."""
    mixing, place = Anderson(), np.array([-5.0, 9.0])
    for _ in range(40):
        x, y = place
        place = mixing.after(place, np.array([3.0 - 4.0 * max(x, 0.0), -2.0 * y - 1.0 + x]) - place)
    assert place == pytest.approx([0.6, -2.0 / 15.0], abs=1e-9)


def test_kinks_do_not_lead_it_in_circles() -> None:
    """A cooled rod whose points push back as the square of how far they are pressed: 1 - 1000 G max(x - gap, 0)^2."""
    k = np.arange(1.0, 9.0)
    green = np.minimum.outer(k, k) / 9.0 - np.outer(k, k) / 81.0
    mixing, place = Anderson(), np.zeros(8)
    for _ in range(200):
        change = 1.0 - 1000.0 * green @ np.maximum(place - 0.1 * np.cos(k), 0.0) ** 2 - place
        if np.abs(change).max() < 1e-9:
            break
        place = mixing.after(place, change)
    assert np.abs(change).max() < 1e-9
