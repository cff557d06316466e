"""Secants, slip sums, bonds, envelopes and dampers that cannot pull: the kit, and the definitions by brute force."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from hemivar.errors import ProblemError
from hemivar.laws import (
    Adhesive,
    Bilateral,
    Capped,
    Compliance,
    FormulaLaw,
    NoContact,
    PiecewiseQuadratic,
    Signorini,
    Softening,
    Superpotential,
    ThresholdCompliance,
    affine,
    bonded,
    envelope,
    plus,
    pushing,
    secant,
    slipped,
)
from hemivar.laws.testing import check_law
from tests.samples import sampled, slow

from .catalogue import FRICTION, NORMAL, conforms

STRAIGHT = [
    "softening",
    "finite",
    "softening glue",
    "survey, two points",
    "signorini",
    "bilateral",
    "spring",
    "power",
]


#: Functions of users are sampled: seconds of work.
QUICK = [name for name in list(NORMAL)[::4] if not name.startswith("own")]


@pytest.mark.parametrize("name", sampled(NORMAL, QUICK))
def test_secants_conform(name: str) -> None:
    if name != "survey, two points":
        conforms(secant(NORMAL[name], np.array([0.0, 0.1, 0.7])))


@pytest.mark.parametrize("name", sampled(FRICTION, ["tresca", "static-kinetic", "logarithm"]))
def test_profiles_after_a_slip_conform(name: str) -> None:
    conforms(slipped(FRICTION[name], np.array([0.0, 0.1, 0.7])), friction=True)


@pytest.mark.parametrize("name", STRAIGHT[:-1])
def test_envelopes_conform(name: str) -> None:
    alpha = float(NORMAL[name].weak_convexity.max())
    c = 0.5 / max(alpha, 1.0)
    conforms(envelope(NORMAL[name], c if name == "survey, two points" else np.array([0.0, c])))


@pytest.mark.parametrize(
    "numbers", [(0.1, 0.05, 1.0), (2.0, 0.05, 0.5), (0.1, 0.0, 0.3), (5.0, 0.5, 0.1), (0.1, 0.05, 0)]
)
def test_bonds_conform(numbers: tuple[float, float, float]) -> None:
    tau, energy, field = numbers
    check_law(bonded(NoContact(), 50.0, energy, 0.2, field, tau), reach=1.0)
    check_law(bonded(Adhesive(5.0, 1.0, 2.0, compression=3.0), 50.0, energy, 0.2, field, tau))


def test_bonds_of_points_in_different_states_conform() -> None:
    conforms(bonded(ThresholdCompliance(0.3, 2.0), 50.0, 0.05, 0.2, np.array([1.0, 0.5, 0.0, 0.02]), 0.1))


@pytest.mark.parametrize("c", [0.5, -0.5, 0.0])
@pytest.mark.parametrize(
    "damping", [PiecewiseQuadratic([0.0], [4.0, 4.0], [0.0]), Compliance(3.0, 2.0), ThresholdCompliance(0.2, 1.0)]
)
def test_dampers_that_cannot_pull_conform(c: float, damping: Superpotential) -> None:
    for law in (ThresholdCompliance(0.3, 2.0), Compliance(5.0, 2.5), NORMAL["finite"]):
        made = pushing(law, affine(damping, 3.0, c))
        check_law(made, reach=1.0)
        r = np.linspace(1e-6, 0.19, 50)
        wanted = np.maximum(0.0, law.derivative(r) + damping.derivative(3.0 * r + c))
        np.testing.assert_allclose(made.derivative(r), wanted, atol=1e-12)
        assert (made.derivative(-r) == law.derivative(-r)).all()


def test_a_damper_on_straight_springs_is_a_table() -> None:
    """At every point that of its own: from where it pushes, ``13 r + 4 c`` on springs of stiffness 5."""
    springs, damper, c = (
        ThresholdCompliance(0.0, 5.0),
        PiecewiseQuadratic([0.0], [4.0, 4.0], [0.0]),
        np.array([0.3, -0.6]),
    )
    made = pushing(springs, affine(damper, 2.0, c))
    assert made.straight
    assert made.convex
    r = np.array([0.2, 0.2])
    np.testing.assert_allclose(made.derivative(r), [3.8, 0.2], rtol=1e-13)
    np.testing.assert_allclose(made.value(r), [0.5, 0.5 * 13.0 * (0.2 - 2.4 / 13.0) ** 2], rtol=1e-12)
    np.testing.assert_allclose(made.local_argmin(np.full(2, 3.0), np.array([4.4, 0.8])), [0.2, 3.2 / 16.0], rtol=1e-12)


def test_bond_by_brute_force() -> None:
    gamma, w0, eta, tau = 50.0, 0.05, 0.2, 0.3
    beta = np.linspace(0.0, 0.8, 400001)
    law = bonded(NoContact(), gamma, w0, eta, 0.8, tau)
    for w in (0.01, 0.05, 0.1, 0.3, 1.0):
        energies = 0.5 * gamma * beta**2 * w**2 - w0 * beta + eta * (beta - 0.8) ** 2 / (2.0 * tau)
        best = int(np.argmin(energies))
        assert law.value(np.array([-w]))[0] == pytest.approx(energies[best] + w0 * 0.8, abs=1e-9)
        assert law.derivative(np.array([-w]))[0] == pytest.approx(-gamma * beta[best] ** 2 * w, abs=1e-4)


@pytest.mark.parametrize(("tau", "field"), [(0.1, 1.0), (0.1, 0.05), (3.0, 0.2), (1.0, 0.25)])
def test_alpha_of_a_bond_is_attained(tau: float, field: float) -> None:
    law = bonded(NoContact(), 50.0, 0.05, 0.2, field, tau)
    first = np.sqrt(0.05 / (50.0 * field))  # where it begins to fade
    r = -np.unique(np.concatenate([np.linspace(0.0, 3.0, 300001), first * np.linspace(1.0, 1.001, 20001)]))
    fall = -np.diff(law.derivative(r)) / np.diff(r)
    assert fall.max() == pytest.approx(law.weak_convexity[0], rel=1e-6)
    assert fall.max() <= law.weak_convexity[0] * (1.0 + 1e-6)
    most = field + tau * 0.05 / 0.2
    sharp = tau * 0.05 <= 0.2 * field
    assert law.weak_convexity[0] <= 50.0 * most**2 / 4.0 * (1.0 + 1e-14)
    assert (law.weak_convexity[0] == pytest.approx(50.0 * most**2 / 4.0, rel=1e-13)) == sharp


@pytest.mark.parametrize("name", STRAIGHT)
def test_envelope_by_brute_force(name: str) -> None:
    law = NORMAL[name].take(np.array([0]))
    c = 0.4 / max(float(law.weak_convexity[0]), 1.0)
    made = envelope(law, c)
    s = np.unique(np.concatenate([np.linspace(-2.0, 2.0, 400001), law.knots[0]]))
    s = s[(s >= law.domain.lower[0]) & (s <= law.domain.upper[0])]
    values, base = law.value(s), None
    for r in (0.0, -1.3, -0.3, -0.05, 0.04, 0.11, 0.5, 1.2):
        energies = values + (r - s) ** 2 / (2.0 * c)
        best = int(np.argmin(energies))
        base = energies[best] if base is None else base
        assert made.value(np.array([r]))[0] == pytest.approx(energies[best] - base, abs=1e-8)
        assert made.derivative(np.array([r]))[0] == pytest.approx((r - s[best]) / c, abs=2e-5 / c)
    if 0.0 < law.weak_convexity[0] < np.inf:
        alpha = float(law.weak_convexity[0])
        assert made.weak_convexity[0] == pytest.approx(alpha / (1.0 - c * alpha), rel=1e-12)


def test_secant_by_its_definition() -> None:
    law, opening = Adhesive(5.0, 1.0, 2.0, compression=3.0), 0.4
    made = secant(law, opening)
    tension = 1.0 - 2.0 * (opening - 0.2)
    w = np.linspace(0.0, opening, 11)
    np.testing.assert_allclose(-made.derivative(-w), tension / opening * w, atol=1e-13)
    beyond = np.linspace(-1.0, -opening - 1e-6, 11)
    np.testing.assert_array_equal(made.derivative(beyond), law.derivative(beyond))
    np.testing.assert_array_equal(made.derivative(w + 1e-9), law.derivative(w + 1e-9))
    assert made.weak_convexity[0] == pytest.approx(2.0, rel=1e-13)
    assert secant(law, 0.7).weak_convexity[0] == 0.0  # broken: nothing is left to fall
    brittle = secant(Adhesive(5.0, 1.0), 0.2)  # as far as its strength, and not farther: it holds
    assert brittle.derivative(np.array([-0.1]))[0] == pytest.approx(-0.5)


@pytest.mark.parametrize("glues", [150, slow(1500)])
def test_a_secant_does_not_leave_rounding_as_a_jump_at_zero(glues: int) -> None:
    """Broken glue on springs is convex, whatever rounding its softening has left at zero; a drop stays one."""
    rng = np.random.default_rng(0)
    for k, s, soft, d in rng.uniform([0.1, 0.5, 0.1, 0.001], [100.0, 100.0, 50.0, 1.0], (1500, 4)).tolist()[:glues]:
        end = d + k * d / soft  # where the glue, softening from its strength k d at the opening d, has broken
        glue = PiecewiseQuadratic([-end, -d, 0.0], [0.0, -soft, k, 0.0], [0.0, 0.0, 0.0], start=0.0)
        springs = PiecewiseQuadratic([0.0], [s, s], [0.0])
        for made in (plus(secant(glue, 1.5 * end), springs), secant(plus(glue, springs), end)):
            assert made.weak_convexity[0] == 0.0
            r = np.linspace(-0.9 * end, 0.0, 7)
            np.testing.assert_allclose(made.derivative(r), s * r, atol=1e-12 * (k * d + s * end))
    drop = PiecewiseQuadratic([-1.0, 0.0], [0.0, 1.0, 2.0], [-1.0, -1e-9], start=0.0)
    assert secant(drop, 0.5).weak_convexity[0] == np.inf
    rigid = secant(plus(Adhesive(5.0, 1.0), Signorini()), 0.1)
    assert rigid.subdifferential(np.zeros(1)).upper[0] == np.inf
    assert rigid.at_kink(np.zeros(len(rigid.knots))).all()
    smooth = FormulaLaw("5*(r + 0.1 + 0.2)^2 - 3.0000000000000009*r")
    assert secant(smooth, 0.2).weak_convexity[0] == 0.0


def test_a_secant_ends_on_the_law_without_a_kink_of_rounding() -> None:
    """Where it falls short of the law by an ulp, alpha would be infinite: one opening in forty."""
    law = Adhesive(50.0, 0.5, 5.0, compression=500.0)
    openings = np.random.default_rng(0).uniform(0.0, 0.2, 400)
    made = secant(law, openings)
    assert np.max(made.weak_convexity) == pytest.approx(5.0, rel=1e-12)
    at = -openings
    np.testing.assert_array_equal(made.derivative(np.nextafter(at, -1.0)), law.derivative(np.nextafter(at, -1.0)))


REFUSED: list[tuple[Callable[[], object], str]] = [
    (lambda: secant(Compliance(2.0), -0.1), "must be at least 0"),
    (lambda: secant(PiecewiseQuadratic([0.0], [-1.0, 0.0], [0.0]), 0.2), "pushes with 0.2 at the opening 0.2"),
    (lambda: secant(affine(Bilateral(), 1.0, 0.5), 0.2), "does not allow r = 0"),
    (lambda: slipped(FRICTION["slip weakening"], -1.0), "must be at least 0"),
    (lambda: envelope(Softening(2.0, 0.1, 0.5), 2.0), "keep the compliance below 2, with a shorter step"),
    (lambda: envelope(Capped(2.0, 0.1), 1e-6), "is unstable in series"),
    (lambda: envelope(Signorini(), -1.0), "must be at least 0"),
    (lambda: bonded(NoContact(), 1.0, 1.0, 0.0, 1.0, 0.1), "must be positive"),
    (lambda: bonded(NoContact(), -1.0, 1.0, 1.0, 1.0, 0.1), "must be at least 0"),
    (lambda: bonded(NoContact(), 1.0, 1.0, 1.0, 1.5, 0.1), "must be at most 1"),
    (lambda: pushing(Softening(2.0, 0.1, 0.5), Compliance(1.0)), "is not monotone"),
    (lambda: pushing(Signorini(), Compliance(1.0)), "allows no penetration"),
]


@pytest.mark.parametrize(("make", "words"), REFUSED)
def test_what_makes_no_sense_is_refused(make: Callable[[], object], words: str) -> None:
    with pytest.raises(ProblemError, match=words):
        make()
