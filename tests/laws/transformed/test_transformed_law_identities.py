"""Identities between transformations, and what is made of laws that are stacked, smooth or of many knots."""

from __future__ import annotations

import re
from collections.abc import Callable

import numpy as np
import pytest

from hemivar.basics.types import Array
from hemivar.laws import (
    Compliance,
    ContactLaw,
    FormulaLaw,
    NoContact,
    PiecewiseQuadratic,
    Signorini,
    SlipWeakening,
    Softening,
    Superpotential,
    ThresholdCompliance,
    affine,
    averaged,
    bonded,
    envelope,
    plus,
    pushing,
    secant,
    slipped,
)
from hemivar.laws.memory import LocalStep, MemoryChain, ViscousFoundation, Wear
from hemivar.laws.minimisers import piece_bounds
from hemivar.laws.piecewise_law import PiecewiseLaw, moved, separated, stack, stacked
from hemivar.laws.superpotential import Interval
from hemivar.laws.testing import check_law
from hemivar.laws.transformed.envelopes import EnvelopeLaw
from hemivar.laws.transformed.law_graph import Region, spliced
from hemivar.laws.transformed.transformed_law import table_of
from hemivar.laws.turns import steepest_fall

#: Convex and not, as tables, smooth, with an end.
SOME: dict[str, Superpotential] = {
    "softening": Softening(2.0, 0.1, 0.5),
    "signorini": Signorini(),
    "power": Compliance(5.0, 2.5),
    "logarithm": FormulaLaw("log(1 + r)", even=True),
}
R = np.array([-2.1, -0.47, -0.11, 0.03, 0.09, 0.16, 0.37, 1.3])


def alike(one: Superpotential, other: Superpotential, r: Array = R, close: float = 1e-9) -> None:
    """The same law, up to rounding and off the kinks."""
    at = r[(r > np.max(other.domain.lower)) & (r < np.min(other.domain.upper))]
    for what in ("value", "derivative", "curvature"):
        np.testing.assert_allclose(
            getattr(one, what)(at), getattr(other, what)(at), rtol=close, atol=close, err_msg=what
        )
    np.testing.assert_allclose(one.weak_convexity.max(), other.weak_convexity.max(), rtol=1e-6, atol=1e-12)
    a = np.geomspace(2.0, 300.0, len(r))
    np.testing.assert_allclose(one.local_argmin(a, a * r), other.local_argmin(a, a * r), rtol=1e-7, atol=1e-9)


@pytest.mark.parametrize("name", SOME)
def test_two_envelopes_in_series_are_one(name: str) -> None:
    """Compliances add up: ``e_a(e_b(j)) = e_{a+b}(j)``, behind a shift as well."""
    law = SOME[name]
    once = envelope(law, 0.35)
    alike(envelope(envelope(law, 0.1), 0.25), once)
    alike(envelope(affine(envelope(law, 0.1), 1.0, -0.07), 0.25), affine(once, 1.0, -0.07))


def test_many_depths_in_series_cost_what_one_does() -> None:
    """A place on the law is sought once for all of them, and not several times for each one."""
    law = made = Compliance(5.0, 2.5)
    for n in range(20):
        made = affine(envelope(made, 0.01), 1.0, -0.001 * n)
    assert isinstance(made, EnvelopeLaw)
    assert not isinstance(made.base, EnvelopeLaw)
    alike(made, affine(envelope(law, 0.2), 1.0, -0.19))


@pytest.mark.parametrize("name", SOME)
def test_an_envelope_of_an_affine_argument_is_one_of_the_envelope(name: str) -> None:
    """``j(t r + c)/t`` with the compliance g is the envelope of j with ``g t``, at ``t r + c``."""
    law = SOME[name]
    alike(envelope(affine(law, 1.7, 0.06), 0.2), affine(envelope(law, 0.34), 1.7, 0.06))


@pytest.mark.parametrize("name", SOME)
def test_an_affine_law_asked_by_itself_is_the_table(name: str) -> None:
    """The class that hands questions on, of laws that need it not too: all answers, minimisers among them."""
    law = SOME[name]
    theta, c = np.array([1.7]), np.array([0.06])
    made = moved(law, theta, c)
    alike(made, affine(law, 1.7, 0.06))
    check_law(made)
    a, b = np.array([3.0]), np.array([0.9])
    points, energies = made.local_minimisers(a, b)
    there = np.isfinite(energies)
    assert there.any()
    for r, energy in zip(points[there], energies[there], strict=True):
        at = np.array([r])
        assert energy == pytest.approx(1.5 * r**2 - 0.9 * r + made.value(at)[0], rel=1e-9, abs=1e-12)
        near = made.subdifferential(at)
        assert near.lower[0] - 1e-8 <= 0.9 - 3.0 * r <= near.upper[0] + 1e-8
    best = float(made.local_argmin(a, b)[0])
    assert energies[there].min() == pytest.approx(1.5 * best**2 - 0.9 * best + made.value(np.array([best]))[0])
    inner, outer = (left != right for left, right in (own.knot_slopes() for own in (made, affine(law, 1.7, 0.06))))
    assert inner.shape == made.knots.shape
    assert inner.sum() == outer.sum()


def test_a_worn_surface_on_a_foundation_that_creeps() -> None:
    """Two depths in series with a smooth law: the law of the step is an envelope of an envelope."""
    law, chain = ContactLaw(Compliance(5.0, 2.5)), MemoryChain((ViscousFoundation(3.0), Wear(0.4)))
    r, lam = np.array([[0.5, 0.2]]), np.array([[0.3, 0.0]])
    state = {"0.depth": np.array([0.05]), "1.depth": np.array([0.02])}
    step = LocalStep(0.3, 1.0 / 0.3, r, r, lam)
    made = chain.law(law, state, step).normal
    c = 0.3 / 3.0 + 0.4 * 0.2  # of the creeping foundation and of wear
    pressure = float(made.derivative(np.array([0.5]))[0])
    assert pressure == pytest.approx(float(envelope(law.normal, c).derivative(np.array([0.43]))[0]), rel=1e-9)
    assert pressure == pytest.approx(5.0 * (0.43 - c * pressure) ** 2.5, rel=1e-9)
    np.testing.assert_allclose(chain.seen(state, r), [[0.43, 0.2]], rtol=1e-15)
    np.testing.assert_allclose(chain.stored(law, state, r), [5.0 * 0.43**3.5 / 3.5], rtol=1e-12)


def test_a_region_without_width_leaves_the_value_continuous() -> None:
    """Two smooth laws, with a third between them at one of two points only: no energy jumps where they meet."""
    first, last = FormulaLaw("r^2 + cos(r)"), FormulaLaw("3*exp(r)")
    cuts = np.array([0.2, 0.2]), np.array([0.2, 0.5])
    everywhere = Interval(np.array([-np.inf]), np.array([np.inf]))
    made = spliced([Region(first), Region(), Region(last)], cuts, everywhere, "spliced")
    assert isinstance(made, PiecewiseLaw)
    for cut in cuts:
        np.testing.assert_allclose(made.value(cut + 1e-9), made.value(cut - 1e-9), atol=1e-8)
    np.testing.assert_allclose(made.value(np.zeros(2)), 0.0, atol=1e-15)
    rise = [3.0 * (np.exp(0.9) - np.exp(cut)) for cut in (0.2, 0.5)]
    np.testing.assert_allclose(made.value(np.full(2, 0.9)), 0.04 + np.cos(0.2) - 1.0 + np.array(rise), rtol=1e-12)


STACKED = stack([(Softening(2.0, 0.1, 0.5), 2), (Compliance(3.0, 2.0), 2), (Softening(1.0, 0.3, 0.2), 1)])
MIXED = stacked(
    [(ThresholdCompliance(0.3, 2.0), np.array([0, 2, 3])), (Compliance(3.0, 2.0), np.array([1, 4]))], "mixed"
)


@pytest.mark.parametrize("kind", ["envelope", "secant", "pushing", "affine", "bonded", "plus"])
def test_of_stacked_laws_each_part_is_transformed(kind: str) -> None:
    numbers = np.array([0.3, 0.1, 0.5, 0.02, 0.4])
    r = np.array([0.2, -0.1, 0.15, -0.3, 0.35])
    damper = PiecewiseQuadratic([0.0], [4.0, 4.0], [0.0])

    def made(law: Superpotential, i: np.ndarray | None) -> Superpotential:
        n = numbers if i is None else numbers[i]
        if kind == "envelope":
            return envelope(law, n)
        if kind == "secant":
            return secant(law, n)
        if kind == "pushing":
            return pushing(law, affine(damper, 2.0, n - 0.3))
        if kind == "bonded":
            return bonded(law, 50.0, 0.05, 0.2, n, 0.1)
        return affine(law, 1.0 + n, n) if kind == "affine" else plus(law, affine(damper, 1.0, n))

    whole = MIXED if kind == "pushing" else STACKED
    stacked = made(whole, None)
    for j in range(5):
        alone = made(whole.take(np.array([j])), np.array([j]))
        for what in ("value", "derivative", "curvature"):
            found = getattr(stacked, what)(r)[j]
            assert found == pytest.approx(getattr(alone, what)(r[j : j + 1])[0], rel=1e-12, abs=1e-15), (what, j)
        assert stacked.weak_convexity[j] == pytest.approx(alone.weak_convexity[0], rel=1e-12)


def test_slips_of_stacked_profiles() -> None:
    first, second = SlipWeakening(2.0, 1.0, 0.4, 3.0).radial, FormulaLaw("log(1 + r)", even=True)
    sums, d = np.array([0.1, 0.5, 0.3]), np.array([0.2, -0.1, 0.4])
    made = slipped(stack([(first, 2), (second, 1)]), sums)
    ends = [(first, 0.1, 0.3), (first, 0.5, 0.6), (second, 0.3, 0.7)]
    wanted = [float((law.value(np.array([b])) - law.value(np.array([a])))[0]) for law, a, b in ends]
    np.testing.assert_allclose(made.value(d), wanted, rtol=1e-12)


def test_the_steepest_fall_inside_a_piece_is_enclosed() -> None:
    """``A e^-s - 1.2 B e^-1.2s`` is largest at ``5 ln(1.44 B/A)``: a cell of a grid is too wide there."""
    A, B = 1.0, 8.0
    weakening = SlipWeakening(1.0, 1.0 + A, 1.0, 1.0).radial
    strengthening = SlipWeakening(1.0, 1.0, 1.0 + B, 1.2).radial
    s = 5.0 * np.log(1.44 * B / A)
    exact = A * np.exp(-s) - 1.2 * B * np.exp(-1.2 * s)
    law = plus(weakening, strengthening)
    assert np.abs(law.knots[0] - s).min() < 1e-5  # where the curvature turns round, least
    alpha = float(law.weak_convexity[0])
    assert exact * (1.0 - 1e-12) <= alpha <= 1.05 * exact
    one, low, high = np.ones(1, dtype=np.int64), np.zeros(1), np.full(1, 30.0)
    whole = float(steepest_fall((weakening, strengthening), (one, one), low, high)[0])  # with the turn inside
    assert exact * (1.0 - 1e-12) <= whole <= 1.2 * exact
    before = float(steepest_fall((weakening, strengthening), (one, one), low, np.full(1, 0.5 * s))[0])
    there = A * np.exp(-0.5 * s) - 1.2 * B * np.exp(-0.6 * s)
    assert max(there, 0.0) * (1.0 - 1e-12) <= max(before, 0.0) <= max(1.05 * there, 1e-3 * A)


def test_a_table_far_away_keeps_its_knots_apart() -> None:
    """Where rounding closes pieces they are left a width of one last place."""
    knots = separated(np.array([[1.0, 1.0, 1.0, np.inf], [0.0, 1.0, 2.0, 3.0]]))
    np.testing.assert_array_equal(knots[0, :3], 1.0 + np.array([0.0, 1.0, 2.0]) * np.finfo(float).eps)
    np.testing.assert_array_equal(knots[1], [0.0, 1.0, 2.0, 3.0])
    assert np.isposinf(knots[0, 3])
    far = affine(Softening(2.0, 0.1, 0.5), 1.0, np.array([1e17, 0.0]))
    assert (np.diff(far.knots[0]) > 0.0).all()
    np.testing.assert_allclose(far.derivative(np.array([0.0, 0.05])), [0.0, 0.1], atol=1e-13)
    ended = affine(Signorini(), 1.0, 1e17)
    assert ended.domain.upper[0] == -1e17


def test_tables_that_are_scaled_stay_tables() -> None:
    base = table_of(affine(Softening(2.0, 0.1, 0.5), 1.0, 0.03))
    assert base is not None
    r, factors = np.linspace(-0.2, 0.6, 5), np.array([0.5, 1.0, 2.0, 3.0, 0.0])
    for law in (base.scaled(factors), base.scaled(2.0), ThresholdCompliance(0.3, 2.0).table.scaled(factors)):
        again = table_of(law)
        assert again is not None
        np.testing.assert_allclose(again.derivative(r), law.derivative(r), rtol=1e-14, atol=1e-15)
        np.testing.assert_allclose(again.value(r), law.value(r), rtol=1e-13, atol=1e-15)
    np.testing.assert_allclose(base.scaled(factors).derivative(r), factors * base.derivative(r), rtol=1e-14)


def test_sums_of_tables_with_many_knots_at_many_points() -> None:
    """They are not copied for every point, and are the same law."""
    knots = np.linspace(0.0, 2.0, 60)
    many = PiecewiseQuadratic(knots, np.concatenate([[0.0], 1.0 + np.sin(np.arange(60.0))]), np.zeros(60))
    shift, r = np.array([0.0, 0.3, -0.2]), np.array([0.11, -0.4, 1.9])
    law = plus(many, affine(Softening(2.0, 0.1, 0.5), 1.0, shift))
    assert table_of(law) is None
    for what in ("value", "derivative", "curvature"):
        wanted = getattr(many, what)(r) + getattr(affine(Softening(2.0, 0.1, 0.5), 1.0, shift), what)(r)
        np.testing.assert_allclose(getattr(law, what)(r), wanted, rtol=1e-12, atol=1e-14)


def test_the_mean_of_a_law_is_the_same_on_the_way_back() -> None:
    soft = Softening(2.0, 0.1, 0.5)
    for a, b in ((0.05, 0.3), (-0.2, 0.15), (0.12, 0.25)):
        there, back = (averaged(soft, x).derivative(np.array([y]))[0] for x, y in ((a, b), (b, a)))
        assert there == pytest.approx(back, rel=1e-12)


@pytest.mark.parametrize("kind", ["affine", "envelope", "secant", "slipped", "averaged", "bonded", "plus", "pushing"])
def test_some_points_of_a_transformed_law(kind: str) -> None:
    """Of laws with a row for every point, and one for all: what is taken is the law of these points."""
    numbers = np.array([0.3, 0.1, 0.45])
    for many in (True, False):
        strength = np.array([0.5, 1.0, 0.7]) if many else 0.5
        smooth: Superpotential = SlipWeakening(strength, 1.0, 0.4, 3.0).radial
        power: Superpotential = Compliance(10.0 * strength, 2.5)
        made = {
            "affine": lambda s=smooth: moved(s, 1.0 + numbers, numbers),
            "envelope": lambda p=power: envelope(p, numbers),
            "secant": lambda p=power: secant(affine(p, 1.0, -0.2), numbers),
            "slipped": lambda s=smooth: slipped(s, numbers),
            "averaged": lambda x=strength: averaged(Softening(4.0 * x, 0.1, 0.5), numbers),
            "bonded": lambda x=strength: bonded(Softening(x, 0.1, 0.5), 50.0 * x, 0.05, 0.2, numbers, 0.1),
            "plus": lambda s=smooth, p=power: plus(s, affine(p, 1.0, numbers)),
            "pushing": lambda p=power: pushing(p, affine(Compliance(2.0), 2.0, numbers)),
        }[kind]()
        r = np.array([0.15, -0.2, 0.33])
        for index in (np.array([2, 0]), np.array([1])):
            some = made.take(index)
            for what in ("value", "derivative", "curvature"):
                wanted = getattr(made, what)(r)[index]
                np.testing.assert_allclose(getattr(some, what)(r[index]), wanted, rtol=1e-12, atol=1e-15)
            np.testing.assert_allclose(
                np.broadcast_to(some.weak_convexity, index.shape),
                np.broadcast_to(made.weak_convexity, (3,))[index],
                rtol=1e-12,
            )


def test_every_knot_is_met_in_spite_of_rounding() -> None:
    """At the place of a knot the law of an affine argument has its kink, the last one as the first one."""
    law = PiecewiseQuadratic([0.0, 0.1, 0.3], [0.0, 1.0, 2.0, 0.0], [0.5, 0.25, 1.0])
    many = PiecewiseQuadratic(np.array([[0.0, 0.1, 0.3], [0.1, 0.2, 0.7]]), [0.0, 1.0, 2.0, 0.0], [0.5, 0.25, 1.0])
    random = np.random.default_rng(2)
    for theta, c in random.uniform(0.1, 3.0, (40, 2)):
        made = moved(law, np.array([theta]), np.array([c]))
        for k in range(3):
            at = made.knots[:, k]
            assert made.at_kink(at).all()
            interval = made.subdifferential(at)
            assert interval.upper[0] - interval.lower[0] == pytest.approx([0.5, 0.25, 1.0][k], rel=1e-12)
        rows = moved(many, np.array([theta]), np.array([c]))
        assert all(rows.at_kink(rows.knots[:, k]).all() for k in range(3))


def test_a_profile_that_grows_keeps_to_its_growth_after_it_has_slipped() -> None:
    profile = plus(SlipWeakening(0.5, 1.0, 0.4, 3.0).radial, PiecewiseQuadratic([0.0], [3.0, 3.0], [0.2], -0.1))
    made = slipped(profile, 0.3)
    r = np.linspace(1e-9, 50.0, 1001)
    c0, c1 = made.growth
    assert made.take(np.zeros(r.size, dtype=np.int64)).derivative(r) == pytest.approx(profile.derivative(0.3 + r))
    assert (np.abs(profile.derivative(0.3 + r)) <= c0 + c1 * r).all()
    assert float(c0[0] + c1[0] * 50.0) < 160.0


def test_a_profile_that_ends_remembers_how_far_it_has_slipped() -> None:
    """It is no multiple of the size of the slip: what is left of its way is what has not been slipped yet."""
    ends = PiecewiseQuadratic([-0.5, 0.0, 0.5], np.zeros(4), [0.0, 2.0, 0.0], -1.0, lower=-0.5, upper=0.5)
    assert ends.derivative(np.array([0.1]))[0] == 1.0
    made = slipped(ends, 0.2)
    assert made.domain.upper[0] == pytest.approx(0.3)
    assert made.domain.lower[0] == pytest.approx(-0.3)
    assert made.value(np.array([0.31]))[0] == np.inf
    free = PiecewiseQuadratic([0.0], [0.0, 0.0], [2.0], -1.0)
    assert slipped(free, 0.2) is free


@pytest.mark.parametrize("smooth", [False, True])
def test_kinks_of_an_envelope_become_springs(smooth: bool) -> None:
    """``s = prox(r)`` of a law with upward jumps at several places: held at a knot on the way, beside it between."""
    jumps = PiecewiseQuadratic([-0.2, 0.0, 0.1], [1.0, 2.0, 1.0, 3.0], [0.3, 0.4, 0.2], -0.7)
    law = plus(jumps, FormulaLaw("log(1 + r)", even=True).scaled(0.1)) if smooth else jumps
    c, made = 0.25, envelope(law, np.array([0.25, 0.5]))
    s = np.unique(np.concatenate([np.linspace(-1.5, 1.5, 300001), law.knots[0][np.isfinite(law.knots[0])]]))
    values = law.value(s)
    r = np.array([-0.9, -0.4, -0.33, -0.25, -0.21, -0.1, -0.02, 0.03, 0.12, 0.2, 0.23, 0.3, 0.8])
    one = made.take(np.array([0]))
    lowest = np.array([np.min(values + (x - s) ** 2 / (2.0 * c)) for x in (0.0, *r)])
    where = np.array([s[np.argmin(values + (x - s) ** 2 / (2.0 * c))] for x in r])
    np.testing.assert_allclose(one.value(r), lowest[1:] - lowest[0], atol=1e-9)
    np.testing.assert_allclose(one.derivative(r), (r - where) / c, atol=1e-4)
    held = np.isin(where, law.knots[0])
    assert held.sum() >= 3  # one at every knot
    np.testing.assert_allclose(one.curvature(r)[held], 1.0 / c, rtol=1e-9)


def value_of_text(text: str, r: float, slope: float) -> float:
    """What a formula of a piece says at r; ``slope`` is what it calls j'."""
    depth, place, opened, inner = 0, None, 0, []
    for i, sign in enumerate(text):
        opened = i if sign == "(" and depth == 0 else opened
        depth += (sign == "(") - (sign == ")")
        if depth == 0 and text.startswith(" at ", i):
            place = i
        elif depth == 0 and sign == ")" and " at " in text[opened:i]:
            inner.append(text[opened + 1 : i])
    if place is not None:
        return value_of_text(text[:place], value_of_text(text[place + 4 :], r, slope), slope)
    for part in inner:
        text = text.replace(f"({part})", f"({value_of_text(part, r, slope)})")
    text = re.sub(r"\|(.*?)\|", r"abs(\1)", text).replace("^", "**").replace("j'", f"({slope})")
    return float(eval(re.sub(r"([\d)]) (?=[\d(a-z])", r"\1*", text), {"exp": np.exp, "r": r}))


DAMPER = PiecewiseQuadratic([0.0], [4.0, 4.0], [0.0])
#: Made for two points: the formulas are those of the first.
MADE: dict[str, tuple[Callable[[Superpotential], Superpotential], str]] = {
    "affine": (
        lambda law: affine(law, np.array([1.3, 0.7]), np.array([0.3, -0.1])),
        "softening signorini power logarithm",
    ),
    "scaled": (lambda law: law.scaled(np.array([2.0, 3.0])), "softening signorini power logarithm"),
    "secant": (lambda law: secant(law, np.array([0.3, 0.1])), "softening signorini power logarithm"),
    "slipped": (lambda law: slipped(law, np.array([0.3, 0.1])), "softening power logarithm"),
    "envelope": (lambda law: envelope(law, np.array([0.3, 0.1])), "softening signorini power logarithm"),
    "averaged": (lambda law: averaged(law, np.array([0.1, -0.1])), "softening"),
    "sum": (lambda law: plus(law, Compliance(np.array([2.0, 3.0]), 2.0)), "softening signorini power logarithm"),
    "pushing": (lambda law: pushing(law, affine(DAMPER, 2.0, np.array([0.3, -0.1]))), "power"),
    "bonded": (lambda law: bonded(law, 50.0, 0.05, 0.2, np.array([0.3, 0.1]), 0.1), "none"),
}


@pytest.mark.parametrize(
    ("kind", "name"), [(kind, name) for kind, (_, names) in MADE.items() for name in names.split()]
)
def test_the_formula_of_each_piece_says_what_the_piece_does(kind: str, name: str) -> None:
    made = MADE[kind][0]({**SOME, "none": NoContact()}[name])
    count = made.knots.shape[-1] + 1
    spoken = 0
    for piece in range(count):
        index = np.full(2, piece)
        low, high = (float(np.clip(end[0], -2.0, 2.0)) for end in piece_bounds(made, index))
        text = made.piece_formula(piece)
        assert text
        for r in (low + share * (high - low) for share in (0.2, 0.5, 0.9) if low < high):
            slope = float(made.piece_derivative(index, np.full(2, r))[0])
            assert value_of_text(text, r, slope) == pytest.approx(slope, rel=1e-4, abs=1e-5), (text, r)
            spoken += abs(slope) > 1e-3
    assert spoken or name == "signorini"
