"""The two states of contact points, told apart at 1e-9 of the largest displacement and multiplier."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse as sp

import hemivar as hv
from hemivar.discrete.problem import DiscreteProblem
from hemivar.laws.scalar_graph import past_peak
from hemivar.solvers import NormalState, TangentialState
from hemivar.solvers.contact_states import KINDS, ContactStates, contact_states

OPEN, BONDED, SOFTENING, DEBONDED, CONTACT = NormalState
FREE, STICK, SLIP = TangentialState
LARGE = (0.02, 50.0)  # displacement and multiplier of the point that sets the sizes
RIGID = hv.laws.ContactLaw(hv.Signorini(), hv.Tresca(0.5)).at(None)
#: The glue carries 4 up to the opening 0.5, nothing from 2.5 on.
GLUE = hv.Adhesive(stiffness=8.0, strength=4.0, softening=2.0)


def states(*points: tuple[float, float, float]) -> list[tuple[NormalState, TangentialState]]:
    """Of points (penetration, slip, pressure) in parts of the largest, which comes first and sticks."""
    rows = np.array([(1.0, 0.0, 1.0), *points])
    local = np.column_stack([rows[:, 0], rows[:, 1]]) * LARGE[0]
    multiplier = np.column_stack([rows[:, 2], np.zeros(len(rows))]) * LARGE[1]
    found = contact_states(RIGID, local, multiplier)
    return [KINDS[number] for number in found.numbers[1:]]


@pytest.mark.parametrize("slip", [1e-8, -1e-8, 1e-4, 0.5])
def test_points_that_moved_by_more_than_rounding_slip(slip: float) -> None:
    assert states((0.0, slip, 0.5)) == [(CONTACT, SLIP)]


@pytest.mark.parametrize("slip", [0.0, 1e-10, -5e-10])
def test_points_that_moved_by_rounding_stick(slip: float) -> None:
    assert states((0.0, slip, 0.5)) == [(CONTACT, STICK)]


@pytest.mark.parametrize(
    ("penetration", "pressure", "is_open"),
    [(-1e-8, 0.0, True), (-1e-4, 1e-10, True), (-1e-10, 0.0, False), (-0.5, 1e-8, False), (0.0, 0.0, False)],
)
def test_points_that_lifted_and_bear_nothing_are_open_and_free(
    penetration: float, pressure: float, is_open: bool
) -> None:
    assert states((penetration, 0.5, pressure)) == [(OPEN, FREE) if is_open else (CONTACT, SLIP)]


@pytest.mark.parametrize("slip", [0.0, 1e-4])
def test_points_that_lifted_and_are_pulled_back_are_bonded_and_stick_or_slip(slip: float) -> None:
    assert states((-1e-4, slip, -1e-4)) == [(BONDED, SLIP if slip else STICK)]


def test_points_pulled_where_they_touch_are_bonded_if_the_law_pulls_there() -> None:
    local, multiplier = np.zeros((1, 2)), np.array([[-1.0, 0.0]])
    for normal, state in ((hv.laws.Bilateral(), BONDED), (hv.Signorini(), CONTACT)):
        assert contact_states(hv.laws.ContactLaw(normal).at(None), local, multiplier).normal.tolist() == [state]


def test_sizes_of_all_points_count_where_these_are_not_all() -> None:
    local, multiplier = np.array([[0.0, 1e-8]]), np.array([[1.0, 0.0]])
    assert contact_states(RIGID, local, multiplier).tangential.tolist() == [SLIP]
    assert contact_states(RIGID, local, multiplier, (100.0, 1.0)).tangential.tolist() == [STICK]


def test_friction_whose_bound_is_rounding_is_none() -> None:
    """Of Coulomb's law, at a point that touches and hardly presses."""
    law = hv.laws.ContactLaw(hv.Signorini(), hv.Coulomb(0.3)).at(None)
    local, multiplier = np.array([[0.0, 1.0]] * 2), np.array([[1.0, 0.3], [1e-12, 0.0]])
    assert contact_states(law, local, multiplier).tangential.tolist() == [SLIP, FREE]


@pytest.mark.parametrize("components", [2, 3])
def test_where_friction_is_left_out_in_the_plane_there_is_none(components: int) -> None:
    """In space one direction of two may be left."""
    local, multiplier = np.eye(1, components, 1), np.eye(1, components)
    found = contact_states(RIGID, local, multiplier, without_friction=np.ones(1, dtype=bool))
    assert found.tangential.tolist() == [FREE if components == 2 else SLIP]


# ---- solutions ---------------------------------------------------------------------------------------------------


def springs(law: hv.laws.ContactLaw, loads: np.ndarray, stiffness: float = 10.0) -> DiscreteProblem:
    """Independent points (p, 2) on springs of their own, each loaded along the normal and the tangent."""
    size, count = loads.size, len(loads)
    matrix, trace = stiffness * sp.eye_array(size, format="csr"), sp.eye_array(size, format="csr")
    return DiscreteProblem.of_arrays(matrix, loads.ravel(), trace, np.ones(count), np.zeros(count), law)


@pytest.mark.parametrize("friction", [hv.laws.NoFriction(), hv.Tresca(0.0), hv.Coulomb(0.0)])
def test_points_without_friction_are_neither_stuck_nor_slipping(friction: hv.laws.Friction) -> None:
    loads = np.array([[1.0, 0.0], [1.0, 3.0], [-1.0, 3.0]])
    found = hv.solve(springs(hv.laws.ContactLaw(GLUE, friction), loads))
    assert found.states.present.keys() == {(CONTACT, FREE), (BONDED, FREE)}
    assert found.states.codes.tolist() == [6, 6, 3]


@pytest.mark.parametrize("pull", [0.5, 6.0, 8.9, 9.1, 16.0, 24.9, 25.1, 40.0])
def test_glue_under_a_growing_pull(pull: float) -> None:
    """A spring of stiffness 10 and glue: 18 w up to w = 1/2, then 10 w + 5 - 2 w up to w = 5/2, then 10 w."""
    found = hv.solve(springs(hv.laws.ContactLaw(GLUE, hv.Tresca(0.5)), np.array([[-pull, 0.0]]))).raise_for_status()
    opening = pull / 18.0 if pull < 9.0 else (pull - 5.0) / 8.0 if pull < 25.0 else pull / 10.0
    assert found.penetration == pytest.approx([-opening])
    expected = BONDED if pull < 9.0 else SOFTENING if pull < 25.0 else DEBONDED
    assert found.normal_state.tolist() == [expected]
    assert found.tangential_state.tolist() == [FREE if expected is DEBONDED else STICK]
    assert found.contact_length == (0.0 if expected is DEBONDED else 1.0)


@pytest.mark.parametrize(
    ("law", "openings", "past"),
    [
        (hv.laws.SawTooth([1.0, 2.0], [4.0, 1.0]), [0.5, 1.0 - 1e-6, 1.0 + 1e-6, 1.9, 2.1], [0, 0, 1, 1, 1]),
        (hv.laws.SawTooth([1.0, 2.0], [4.0, 3.0]), [0.5, 1.1, 1.4, 1.9, 2.1], [0, 1, 0, 0, 1]),  # 4, then from 3 to 6
        (hv.FormulaLaw("(r - 1)*exp(r)", reach=8.0), [0.5, 0.99, 1.01, 1.5, 2.5, 5.0], [0, 0, 1, 1, 1, 1]),
        (hv.Compliance(3.0), [0.5, 2.0], [0, 0]),
        (hv.laws.Bilateral(), [0.0, 1e-9], [0, 0]),
    ],
    ids=["teeth", "a stronger tooth", "w exp(-w)", "never pulls", "rigid"],
)
def test_the_peak_of_the_pull(law: hv.laws.Superpotential, openings: list[float], past: list[int]) -> None:
    one = law.at(None)
    assert [bool(past_peak(one, np.array([-w]))[0]) for w in openings] == [bool(p) for p in past]


def test_codes_of_files() -> None:
    """Each pair has its number; those of files without the second field keep their meaning."""
    normal, tangential = (np.array(part) for part in zip(*KINDS, strict=True))
    all_of_them = ContactStates(normal, tangential)
    assert all_of_them.codes.tolist() == [0, 1, 2, 6, 3, 3, 3, 4, 4, 4, 5]
    again = ContactStates.of_codes(all_of_them.codes, all_of_them.tangential)
    assert again.numbers.tolist() == list(range(len(KINDS)))
    old = ContactStates.of_codes(np.array([0, 1, 2, 3]))
    assert [KINDS[number].label for number in old.numbers] == ["open", "contact, stick", "contact, slip", "bonded"]


# ---- in time -----------------------------------------------------------------------------------------------------


# ---- files -------------------------------------------------------------------------------------------------------
