"""The study of a stationary point in the plane and in space, against the second derivative of the energy by hand."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
import scipy.linalg as la

from hemivar.basics.types import Array
from hemivar.certificates import EnergyNorm, PointKind, certify, kind
from hemivar.certificates.bound import Point
from hemivar.certificates.kind import study
from hemivar.discrete import DiscreteProblem
from hemivar.laws import Compliance, ContactLaw, Friction, NoFriction, PiecewiseQuadratic, Tresca
from tests.certificates.problems import brittle, softening, weakening

STIFF, BOUND, RATE, DROP = 6.0, 1.0, 2.0, 0.4


@dataclass
class Made:
    """A stationary pair that was chosen, and the load that goes with it."""

    problem: DiscreteProblem
    u: Array
    lam: Array

    def point(self) -> Point:
        return Point(self.problem, EnergyNorm(self.problem.stiffness), self.u, self.lam)


def made(K: Array, B: Array, w: Array, law: ContactLaw, u: Array, lam: Array) -> Made:
    d = lam.shape[1]
    load = K @ u + B.T @ (np.repeat(w, d) * lam.ravel())
    return Made(DiscreteProblem.of_arrays(K, load, B, w, np.zeros(len(w)), law), u, lam)


def positive(n: int, rng: np.random.Generator, size: float = 8.0) -> Array:
    root = rng.normal(size=(n, n))
    return np.asarray(root @ root.T + size * np.eye(n))


STATES = ("slides", "sticks", "slides far", "open")


def random_state(d: int, states: tuple[str, ...], seed: int) -> tuple[Made, float]:
    """Points that press and slide on weakening friction, stick, or are open; with the least curvature by hand."""
    rng = np.random.default_rng(seed)
    m = len(states)
    n, w = m * d + 2, rng.uniform(0.5, 2.0, m)
    K, B = positive(n, rng), np.hstack([np.eye(m * d), 0.3 * rng.normal(size=(m * d, 2))])
    law = ContactLaw(Compliance(STIFF), Friction(BOUND, weakening(DROP, RATE)))
    r, lam, bend, held = np.zeros((m, d)), np.zeros((m, d)), np.zeros((m * d, m * d)), []
    for j, state in enumerate(states):
        r[j, 0] = -0.2 if state == "open" else 0.3
        lam[j, 0] = STIFF * max(r[j, 0], 0.0)
        way = rng.normal(size=d - 1)
        way /= np.linalg.norm(way)
        size = {"slides": 0.1, "sticks": 0.0, "slides far": 0.5, "open": 0.1}[state]
        force, radial = (BOUND - RATE * size, -RATE) if size < DROP / RATE else (BOUND - DROP, 0.0)
        r[j, 1:], lam[j, 1:] = size * way, (0.5 if state == "sticks" else force) * way
        at = slice(j * d, (j + 1) * d)
        block = np.zeros((d, d))
        block[0, 0] = STIFF if r[j, 0] > 0.0 else 0.0
        if state == "sticks":
            held += list(range(j * d + 1, (j + 1) * d))
        else:
            block[1:, 1:] = radial * np.outer(way, way) + force / size * (np.eye(d - 1) - np.outer(way, way))
        bend[at, at] = w[j] * block
    u = np.concatenate([r.ravel(), np.zeros(2)])
    Z = la.null_space(B[held]) if held else np.eye(n)
    least = la.eigh(Z.T @ (K + B.T @ bend @ B) @ Z, Z.T @ K @ Z, eigvals_only=True)[0]
    return made(K, B, w, law, u, lam), float(least)


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize(
    "states",
    [("slides",), ("slides", "sticks"), ("slides", "open", "slides far"), ("sticks", "slides", "slides"), STATES],
)
@pytest.mark.parametrize("few", [200, 0])
def test_the_least_curvature_of_points_that_slide_and_stick(
    d: int, states: tuple[str, ...], few: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """All curvatures of a few components, the least alone of many."""
    monkeypatch.setattr(kind, "_FEW", few)
    for seed in range(4):
        pair, least = random_state(d, states, seed)
        found = study(pair.point())
        assert found.curvature == pytest.approx(min(least, 1.0), abs=1e-7)
        assert found.kind is PointKind.LOCAL_MINIMISER
        assert found.direction is None


@pytest.mark.parametrize("few", [200, 0])
@pytest.mark.parametrize("d", [2, 3])
def test_a_body_too_soft_for_its_friction_sits_on_a_saddle(d: int, few: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """The direction that is shown is that of the slip, and the energy falls along it."""
    monkeypatch.setattr(kind, "_FEW", few)
    law = ContactLaw(Compliance(STIFF), Friction(BOUND, weakening(DROP, RATE)))
    way = np.array([0.6, 0.8])[: d - 1] / np.linalg.norm(np.array([0.6, 0.8])[: d - 1])
    w = np.array([1.5])
    K = np.diag([4.0, 1.0, 1.0][:d])
    r = np.concatenate([[0.3], 0.1 * way])
    pair = made(K, np.eye(d), w, law, r, np.concatenate([[1.8], 0.8 * way])[None])
    found = study(pair.point())
    assert found.kind is PointKind.SADDLE
    assert found.curvature == pytest.approx(1.0 - 1.5 * RATE, abs=1e-7)
    assert found.direction is not None
    along = found.direction[0]
    assert np.abs(along).max() == pytest.approx(1.0)
    np.testing.assert_allclose(along / np.linalg.norm(along) * np.sign(along[1]), [0.0, *way], atol=1e-6)
    for step in (1e-3, -1e-3):
        assert pair.problem.energy(r + step * along) < pair.problem.energy(r)
    assert certify(pair.problem, r, pair.lam).kind is PointKind.SADDLE


def test_a_slip_that_a_support_confines_does_not_turn() -> None:
    """In space, with one tangent held: across the slip nothing moves, and the curvature is that along it."""
    law = ContactLaw(Compliance(STIFF), Friction(BOUND, weakening(DROP, RATE)))
    B = np.array([[1.0, 0.0], [0.0, 1.0], [0.0, 0.0]])
    for soft in (3.0, 10.0):
        K = np.diag([4.0, soft])
        pair = made(K, B, np.array([1.5]), law, np.array([0.3, 0.1]), np.array([[1.8, 0.8, 0.0]]))
        assert study(pair.point()).curvature == pytest.approx(1.0 - 1.5 * RATE / soft)


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize(
    ("part", "soft", "expected"),
    [
        (0.5, 4.0, 1.0),  # inside the bound it sticks, however soft the body
        (0.5, 1.0, 1.0),
        (1.0, 4.0, 1.0 - 1.5 * RATE / 4.0),  # at the bound it may start to slip, and weaken
        (1.0, 1.0, None),
    ],
)
def test_a_point_at_rest_sticks_inside_its_bound(d: int, part: float, soft: float, expected: float | None) -> None:
    law = ContactLaw(Compliance(STIFF), Friction(BOUND, weakening(DROP, RATE)))
    way = np.array([0.6, 0.8])[: d - 1]
    way = way / np.linalg.norm(way)
    r = np.concatenate([[0.3], np.zeros(d - 1)])
    lam = np.concatenate([[1.8], part * BOUND * way])[None]
    found = study(made(soft * np.eye(d), np.eye(d), np.array([1.5]), law, r, lam).point())
    if expected is None:
        assert found.kind is PointKind.DIRECTIONALLY_STATIONARY
    else:
        assert found.kind is PointKind.LOCAL_MINIMISER
        assert found.curvature == pytest.approx(expected)


@pytest.mark.parametrize("d", [2, 3])
def test_without_friction_every_slip_is_free(d: int) -> None:
    """The load is along the normal, the law softens there, and a spring couples the normal with the slip."""
    K = np.eye(d) * 4.0
    K[0, 1] = K[1, 0] = 1.5
    law = ContactLaw(softening(8.0, 0.1, 2.0), NoFriction())
    r = np.zeros(d)
    r[0] = 0.2
    pair = made(K, np.eye(d), np.array([1.0]), law, r, np.array([[0.8 - 2.0 * 0.1, *np.zeros(d - 1)]]))
    expected = la.eigh(K - np.diag([2.0, *np.zeros(d - 1)]), K, eigvals_only=True)[0]
    found = study(pair.point())
    assert found.curvature == pytest.approx(expected)
    assert expected < 0.5  # less than 1 - 2 / 4 of a slip that were held


def test_a_kink_between_two_slopes_counts_with_the_side_to_which_it_may_move() -> None:
    """Slopes meet at the knot with a jump up from 1 to 2; the law is concave on the left, convex on the right."""
    law = ContactLaw(PiecewiseQuadratic([0.5], [-6.0, 3.0], [1.0], start=4.0), NoFriction())  # type: ignore[arg-type]
    left = float(law.normal.knot_slopes()[0].ravel()[0])
    w, K = np.array([1.0]), np.array([[4.0]])
    for force, kind_expected in (
        (left + 0.5, PointKind.LOCAL_MINIMISER),  # held at the kink
        (left, PointKind.DIRECTIONALLY_STATIONARY),  # may move to the left, where it softens by more than K
        (left + 1.0, PointKind.LOCAL_MINIMISER),  # may move to the right
    ):
        pair = made(K, np.eye(1), w, law, np.array([0.5]), np.array([[force]]))
        found = study(pair.point())
        assert found.kind is kind_expected, force


@pytest.mark.parametrize(("force", "way"), [(0.0, -1.0), (0.3, 1.0), (0.1, None)])
def test_at_a_downward_jump_the_energy_falls_to_one_side_or_to_both(force: float, way: float | None) -> None:
    """A foundation that breaks at 0.15 under a pressure of 0.3: at both ends of the jump, and inside it."""
    law = ContactLaw(brittle(2.0, 0.15), NoFriction())
    found = study(made(np.eye(1), np.eye(1), np.ones(1), law, np.array([0.15]), np.array([[force]])).point())
    assert found.curvature == -np.inf
    assert found.direction is not None
    if way is None:
        assert found.kind is PointKind.MAXIMUM
    else:
        assert found.kind is PointKind.CLARKE_STATIONARY
        assert found.direction[0, 0] == way


def test_a_maximum_falls_along_every_contact_displacement() -> None:
    """Two points on falling slopes; a third that sticks, or that is convex, makes a saddle of it."""
    soft, K = softening(8.0, 0.1, 8.0), 4.0 * np.eye(3)
    law = ContactLaw(soft, NoFriction())
    r, lam = np.array([0.15, 0.12, 0.13]), 0.8 - 8.0 * (np.array([0.15, 0.12, 0.13]) - 0.1)
    every = made(K, np.eye(3), np.ones(3), law, r, lam[:, None])
    found = study(every.point())
    assert found.kind is PointKind.MAXIMUM
    assert found.curvature == pytest.approx(-1.0)
    rising = r.copy()
    rising[2], lam[2] = 0.05, 0.4
    assert study(made(K, np.eye(3), np.ones(3), law, rising, lam[:, None]).point()).kind is PointKind.SADDLE
    kinked = r.copy()
    kinked[2], lam[2] = 0.0, 0.0  # where it comes into touch
    assert study(made(K, np.eye(3), np.ones(3), law, kinked, lam[:, None]).point()).kind is PointKind.SADDLE
    sticking = made(
        4.0 * np.eye(2), np.eye(2), np.ones(1), ContactLaw(soft, Tresca(0.5)), np.array([0.15, 0.0]),
        np.array([[0.4, 0.2]]),
    )  # fmt: skip
    assert study(sticking.point()).kind is PointKind.SADDLE


@pytest.mark.parametrize(
    ("others", "expected"),
    [
        ((), PointKind.MAXIMUM),
        ((0.18, 0.16), PointKind.MAXIMUM),  # both on the falling slope
        ((0.18, 0.05), PointKind.SADDLE),  # one on the rising one
        ((0.18, 0.0), PointKind.SADDLE),  # one that comes into touch
    ],
)
def test_beside_a_downward_jump_every_other_point_must_fall_too(others: tuple[float, ...], expected: PointKind) -> None:
    """Slope 8 up to 0.1, then -2 up to 0.2, where it breaks under what is left, 0.6; the body has stiffness 1."""
    broken = PiecewiseQuadratic([0.0, 0.1, 0.2], [0.0, 8.0, -2.0, 0.0], [0.0, 0.0, -0.6])  # type: ignore[arg-type]
    r = np.array([0.2, *others])
    lam = np.where(r <= 0.1, 8.0 * r, 0.8 - 2.0 * (r - 0.1))
    lam[0] = 0.3
    m = len(r)
    found = study(made(np.eye(m), np.eye(m), np.ones(m), ContactLaw(broken, NoFriction()), r, lam[:, None]).point())
    assert found.kind is expected
    assert found.curvature == -np.inf
    assert found.direction is not None
    np.testing.assert_array_equal(np.abs(found.direction[:, 0]), np.eye(m)[0])
