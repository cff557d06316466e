"""Laws of penetration and slip by a formula or functions: the kit, other solvers of the same problem, and bad input."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from functools import cache, partial

import numpy as np
import pytest
from scipy.optimize import brentq, minimize

import hemivar as hv
from hemivar.basics.types import Array
from hemivar.laws import (
    BilinearCohesion,
    Compliance,
    CoupledFormulaLaw,
    CoupledFunctionLaw,
    MixedMode,
    Signorini,
    Tresca,
)
from hemivar.laws.coupled import own_coupled
from hemivar.laws.coupled.plane_potential import PlanePotential
from hemivar.laws.registry import COUPLED_LAWS
from hemivar.laws.testing import check_vector_law
from hemivar.laws.vector_law import is_convex
from tests.bodies import glued_plate, opened_point
from tests.samples import sampled

#: Energy, width and ratio of glue whose potential is a Gaussian.
G, WIDTH, BETA = 0.5, 0.01, 2.0
GAUSS = "0.5*(1 - exp(-(min(r, 0)^2 + 4*s^2)/2e-4)) + 5e3*max(r, 0)^2"
RHO = "(min(r, 0)^2 + 2.25*s^2)"
BILINEAR = (
    f"piecewise((5e3*{RHO}, {RHO} < 0.003^2), "
    f"(0.045 + 30*(sqrt({RHO}) - 0.003) - 500*(sqrt({RHO}) - 0.003)^2, {RHO} < 0.033^2), (0.495, True))"
)
#: Made where they are first asked for: their bounds are sought then.
LAWS = {
    "gauss": cache(lambda: CoupledFormulaLaw(GAUSS, reach=0.1)),
    "rigid": cache(lambda: CoupledFormulaLaw("0.5*(1 - exp(-(r^2 + 4*s^2)/2e-4))", reach=0.1, rigid=True)),
    "convex": cache(lambda: CoupledFormulaLaw("1e3*(r^2 + s^2) + 300*r*s^2", reach=0.1)),
    "friction": cache(lambda: CoupledFormulaLaw("20*s + 5e3*max(r, 0)^2 + 2*max(r, 0)", reach=0.1)),
    "rubbing when open": cache(lambda: CoupledFormulaLaw("20*s*(1 + 30*r^2)", reach=0.1, rigid=True)),
    "bilinear": cache(lambda: CoupledFormulaLaw(f"{BILINEAR} + 5e3*max(r, 0)^2", reach=0.1)),
}
#: Laws by name, but for those that have files of their own.
LAWS |= {
    name: partial(entry.make, **entry.example)
    for name, entry in COUPLED_LAWS.items()
    if name not in ("mixed-mode", "mode-dependent", "coupled-formula") and entry.example is not None
}


def mixed() -> MixedMode:
    """What the formula ``BILINEAR`` is, solved by roots on each piece."""
    return MixedMode(BilinearCohesion(30.0, 0.495, 1e4), 1.5, Compliance(1e4)).at(None)


def gauss_potential(r: Array, s: Array) -> Array:
    return G * (1.0 - np.exp(-0.5 * (np.minimum(r, 0.0) ** 2 + 4.0 * s**2) / WIDTH**2)) + 5e3 * np.maximum(r, 0.0) ** 2


def gauss_gradient(r: Array, s: Array) -> tuple[Array, Array]:
    rate = G / WIDTH**2 * np.exp(-0.5 * (np.minimum(r, 0.0) ** 2 + 4.0 * s**2) / WIDTH**2)
    return rate * np.minimum(r, 0.0) + 1e4 * np.maximum(r, 0.0), 4.0 * rate * s


@pytest.mark.parametrize(
    ("name", "components"), sampled(itertools.product(LAWS, (2, 3)), list(zip(LAWS, itertools.cycle((2, 3)))))
)
def test_laws_pass_the_kit(name: str, components: int) -> None:
    check_vector_law(LAWS[name](), reach=0.04, components=components)


def test_functions_are_the_formula() -> None:
    law, formula = CoupledFunctionLaw(gauss_potential, gauss_gradient, reach=0.1), LAWS["gauss"]()
    check_vector_law(law, reach=0.04)
    random = np.random.default_rng(3)
    r, a = random.uniform(-0.03, 0.03, (50, 3)), 10.0 ** random.uniform(2.0, 4.0, (50, 2))
    b = a[:, [0, 1, 1]] * random.uniform(-0.03, 0.03, (50, 3))
    assert law.value(r) == pytest.approx(formula.value(r), abs=1e-12)
    assert law.hessian(r) == pytest.approx(formula.hessian(r), abs=1e-2)  # by differences, of 5e3
    one, two = law.local_argmin(a, b), formula.local_argmin(a, b)
    assert one == pytest.approx(two, abs=1e-9)
    assert not law.proof("alpha").value(0.1, 0.1)[0] < np.inf
    assert not law.proof("alpha").sure
    assert law.proof("alpha").reach == (0.0, 0.0)


def test_alpha_of_a_gaussian_is_enclosed() -> None:
    """The least curvature of G (1 - exp(-w^2/(2 d^2))) is -2 G/d^2 exp(-3/2), at w = sqrt(3) d."""
    exact = 2.0 * G / WIDTH**2 * np.exp(-1.5)
    law = LAWS["rigid"]()
    normal, tangential = (float(alpha[0]) for alpha in law.weak_convexity)
    assert law.proof("alpha").reach == (0.1, 0.1)
    assert exact <= normal <= 1.11 * exact
    assert BETA**2 * exact * (1.0 - 1e-6) <= tangential <= 1.11 * BETA**2 * exact
    sampled = LAWS["bilinear"]()
    assert sampled.proof("alpha").reach == (0.0, 0.0)
    assert sampled.weak_convexity[0][0] == pytest.approx(1000.0, rel=1e-3)
    assert sampled.weak_convexity[1][0] == pytest.approx(2250.0, rel=1e-3)
    assert "sampled" in sampled.describe()
    assert "shown by intervals" in law.describe()


def test_convex_laws_are_called_so_within_the_reach_only() -> None:
    law = LAWS["friction"]()
    assert law.weak_convexity[0][0] == law.weak_convexity[1][0] == 0.0
    assert not is_convex(law)  # nothing is shown beyond the reach


def test_local_problems_have_the_minimisers_of_mixed_mode() -> None:
    """Roots on each piece of the curve, and Newton's method from a grid of the formula, find the same energies."""
    law, roots = LAWS["bilinear"](), mixed()
    random = np.random.default_rng(4)
    for components in (2, 3):
        a = 10.0 ** random.uniform(1.5, 4.0, (300, 2))
        b = a[:, [0, *[1] * (components - 1)]] * random.uniform(-0.05, 0.05, (300, components))
        b += random.uniform(-30.0, 30.0, b.shape)
        one, two = law.local_argmin(a, b), roots.local_argmin(a, b)
        wide = a[:, [0, *[1] * (components - 1)]]
        energies = [(0.5 * wide * r**2 - b * r).sum(axis=1) + roots.value(r) for r in (one, two)]
        assert energies[0] == pytest.approx(energies[1], abs=1e-12)
        assert (law.graph_distance(one, b - wide * one, 1.0 / a) <= 1e-8 * np.abs(b).max(axis=1)).all()


@pytest.mark.parametrize("count", [2, pytest.param(40, marks=pytest.mark.slow)])
def test_random_local_problems_against_a_grid(count: int) -> None:
    """Glue of random strength, width and ratio, each on 50 random springs: no place of a fine grid is lower."""
    random = np.random.default_rng(5)
    for _ in range(count):
        energy, width, beta = (
            10.0 ** random.uniform(-2.0, 2.0),
            10.0 ** random.uniform(-3.0, 0.0),
            random.uniform(0.5, 3),
        )
        text = f"{energy}*(1 - (1 + (r^2 + {beta**2}*s^2)/{width**2})*exp(-(r^2 + {beta**2}*s^2)/{width**2}))"
        law = CoupledFormulaLaw(text, reach=10.0 * width, rigid=True)
        stiff = energy / width**2
        a = stiff * 10.0 ** random.uniform(-2.0, 1.0, (50, 2))
        b = a * random.uniform(-5.0, 3.0, (50, 2)) * width + energy / width * random.uniform(-1.0, 1.0, (50, 2))
        r = law.local_argmin(a, b)
        found = (0.5 * a * r**2 - b * r).sum(axis=1) + law.value(r)
        for i in range(50):
            far = np.maximum(np.abs(b[i]) / a[i], 5.0 * width)
            normal = np.unique([*np.linspace(-far[0], 0.0, 150), *np.linspace(-5.0 * width, 0.0, 150)])
            slip = np.unique([*np.linspace(0.0, far[1], 150), *np.linspace(0.0, 5.0 * width, 150)])
            w, s = np.meshgrid(normal, np.sign(b[i, 1]) * slip, indexing="ij")
            places = np.column_stack([w.ravel(), s.ravel()])
            level = (0.5 * a[i] * places**2 - b[i] * places).sum(axis=1) + law.value(places)
            assert found[i] <= level.min() + 1e-9 * (energy + abs(found[i]))


def test_a_search_without_its_grid_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    """The way down from where the springs alone would be leads to the broken state, the bonded one is lower."""
    law, a, b = LAWS["rigid"](), np.array([[300.0, 300.0]]), np.array([[-12.0, 0.0]])

    def energy(r: Array) -> float:
        return float((0.5 * a * r**2 - b * r).sum() + law.value(r)[0])

    whole = energy(law.local_argmin(a, b))
    monkeypatch.setattr(own_coupled.OwnCoupledLaw, "_searched", lambda self, a, b, x: x)
    assert energy(law.local_argmin(a, b)) > whole + 0.1


def test_the_distance_to_the_graph_is_bracketed() -> None:
    law, random = LAWS["gauss"](), np.random.default_rng(6)
    r = random.uniform(-0.03, 0.03, (6, 2))
    lam = law.linearise(r).gradient + random.uniform(-20.0, 20.0, r.shape)
    tau = 10.0 ** random.uniform(-5.0, -3.0, (6, 2))
    low, high = law.graph_distance_bracket(r, lam, tau)
    for i in range(6):

        def off(x: Array, i: int = i) -> float:
            place = r[i] + x * tau[i] * high[i]
            force = law.linearise(place[None]).gradient[0]
            return float(((x * high[i]) ** 2).sum() + ((lam[i] - force) ** 2).sum())

        starts = [np.zeros(2), *random.uniform(-1.0, 1.0, (6, 2))]
        best = min(minimize(off, start, method="Nelder-Mead", options={"fatol": 1e-12}).fun for start in starts) ** 0.5
        assert low[i] <= best * (1.0 + 1e-6)
        assert best <= high[i] * (1.0 + 1e-6)


# ---- a point on springs, and bodies ---------------------------------------------------------------------------


@pytest.mark.parametrize("opening", [True, False])
def test_a_point_on_stiff_springs_is_where_the_scalar_equation_says(opening: bool) -> None:
    springs, load = 12_000.0, 130.0
    beta = 1.0 if opening else BETA
    found = hv.solve(opened_point(springs, (load, 0.0) if opening else (0.0, load), LAWS["rigid"]()))

    def misfit(x: float) -> float:
        return springs * x + beta**2 * G / WIDTH**2 * x * float(np.exp(-0.5 * (beta * x / WIDTH) ** 2)) - load

    exact = float(brentq(misfit, 0.0, 1.0, xtol=1e-15))
    assert np.abs(found.local[0]).max() == pytest.approx(exact, rel=1e-9)
    assert hv.certify(found).kind.name in ("UNIQUE_MINIMISER", "LOCAL_MINIMISER")


def test_the_margin_claims_uniqueness_within_the_reach() -> None:
    law = LAWS["rigid"]()
    stiff = hv.solve(opened_point(50_000.0, (30.0, 20.0), law))
    certificate = hv.certify(stiff)
    assert certificate.margin > 0.5
    assert certificate.smallness.within
    assert certificate.unique is not False


def test_a_small_body_on_a_convex_law_is_solved_by_default() -> None:
    """Springs and a quadratic law: a linear equation, from rest and from elsewhere."""
    law = CoupledFormulaLaw("1e3*r^2 + 500*s^2", reach=0.1)
    problem = opened_point(1000.0, (12.0, 8.0), law)
    exact = np.array([[-12.0 / 3000.0, 8.0 / 2000.0]])
    for start in (None, np.array([0.05, -0.03])):
        assert hv.solve(problem, initial=start).local == pytest.approx(exact, rel=1e-10)


@pytest.mark.parametrize("method", [hv.solvers.NonsmoothNewton(), hv.solvers.NonsmoothMultigrid()])
def test_a_body_on_the_formula_is_that_on_mixed_mode(method: hv.solvers.Solver) -> None:
    here, there = hv.solve(glued_plate(LAWS["bilinear"]()), method), hv.solve(glued_plate(mixed()), method)
    assert here.status.name == there.status.name == "CONVERGED"
    assert here.energy == pytest.approx(there.energy, rel=1e-8)
    assert here.local == pytest.approx(there.local, abs=1e-7 * np.abs(there.local).max())


def test_a_block_in_space() -> None:
    law = CoupledFormulaLaw("2*sqrt(s^2 + 1e-6) + 5e3*max(r, 0)^2 + 10*s^2*max(r, 0)", reach=1.0)
    found = hv.solve(
        hv.ContactProblem(
            hv.box((1.0, 1.0, 0.5), (3, 3, 2)), hv.Material.young(1000.0, 0.3), {"bottom": hv.Contact(law)},
            {"top": hv.Prescribed((0.05, 0.02, -0.05))},
        )
    )  # fmt: skip
    assert found.status.name == "CONVERGED"
    assert found.local[:, 0].max() > 0.0


def test_results_do_not_change_with_units() -> None:
    """Newtons and millimetres, and kilonewtons and metres."""
    here = hv.solve(opened_point(12_000.0, (40.0, 50.0), LAWS["rigid"]()))
    law = CoupledFormulaLaw("0.5*(1 - exp(-(r^2 + 4*s^2)/2e-10))", reach=1e-4, rigid=True)
    there = hv.solve(opened_point(12_000.0 * 1e6, (40.0 * 1e3, 50.0 * 1e3), law))
    assert there.local == pytest.approx(here.local * 1e-3, rel=1e-8)


# ---- what is refused, files, the command ------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: CoupledFormulaLaw("r^2 + ", reach=1.0), "formula 'r"),
        (lambda: CoupledFormulaLaw("r^2 + t", reach=1.0), "'t'"),
        (lambda: CoupledFormulaLaw(3.0, reach=1.0), "the potential is 3.0"),  # type: ignore[arg-type]
        (lambda: CoupledFormulaLaw("r^2 + s^2", reach=0.0), "positive length"),
        (lambda: CoupledFormulaLaw("r^2 + s^2", reach="far"), "reach of law"),  # type: ignore[arg-type]
        (lambda: CoupledFormulaLaw("r^2 + s^2", reach=np.inf), "positive length"),
        (lambda: CoupledFormulaLaw("r^2 + s^2", reach=1e-300), "is 1e-300; it must lie between 1e-75 and"),
        (lambda: hv.FormulaLaw("r^2", reach=1e-300), "is 1e-300; it must lie between 1e-75 and"),
        (lambda: hv.laws.FunctionLaw(derivative=np.square, reach=1e300), r"is 1e\+300; it must lie between 1e-75 and"),
        (lambda: CoupledFormulaLaw("r^2", reach=1.0, rigid="yes"), "rigid of law"),  # type: ignore[arg-type]
        (lambda: CoupledFormulaLaw("1/(r - 0.5)", reach=1.0), "a pole, or no value, at r = 0.5"),
        (lambda: CoupledFormulaLaw("log(r)", reach=1.0), "no value, at r = -"),
        (lambda: CoupledFormulaLaw("sqrt(s)", reach=1.0), "not finite|rises|jumps"),
        (lambda: CoupledFormulaLaw("r^2 - s", reach=1.0), "falls with the slip at s = 0"),
        (lambda: CoupledFormulaLaw("s*r", reach=1.0), "falls with the slip at s = 0"),
        (lambda: CoupledFormulaLaw("-abs(r) + s^2", reach=1.0), "falls by 2 at r = 0"),
        (lambda: CoupledFormulaLaw("abs(r + 0.3)", reach=1.0), "may jump at r = 0 only"),
        (lambda: CoupledFormulaLaw("abs(s - 0.3)*s", reach=1.0), "may jump at r = 0 only"),
        (lambda: CoupledFormulaLaw("abs(s + r)", reach=1.0), "jumps|falls"),
        (lambda: CoupledFormulaLaw("piecewise((r^2, r < -0.2), (1, True))", reach=1.0), "does not jump|may jump"),
        (lambda: CoupledFormulaLaw("piecewise((1, r < 0), (2, True))", reach=1.0), "jumps at r = 0"),
        (lambda: CoupledFormulaLaw("exp(1e4*r)", reach=1.0), "not finite"),
        (lambda: CoupledFunctionLaw(gauss_potential, None, reach=1.0), "the gradient of law"),  # type: ignore[arg-type]
        (lambda: CoupledFunctionLaw("r^2", gauss_gradient, reach=1.0), "the potential of law"),  # type: ignore[arg-type]
        (lambda: CoupledFunctionLaw(gauss_potential, lambda r, s: r, reach=0.1), "must return 2 arrays"),
        (lambda: CoupledFunctionLaw(lambda r, s: np.zeros(3), gauss_gradient, reach=0.1), "one array"),
        (lambda: CoupledFunctionLaw(lambda r, s: 1j * r, gauss_gradient, reach=0.1), "complex"),
        (lambda: CoupledFunctionLaw(gauss_potential, lambda r, s: (r, s), reach=0.1), "its gradient says"),
        (lambda: CoupledFunctionLaw(lambda r, s: 1 / 0, gauss_gradient, reach=0.1), "division by zero"),
        (lambda: CoupledFunctionLaw(lambda r, s: r * np.nan, gauss_gradient, reach=0.1), "not finite"),
        (lambda: hv.Contact(LAWS["gauss"](), Tresca(0.3)), "leave the friction 'tresca' out"),
        (lambda: hv.ScalarContact(LAWS["gauss"]()), "law"),
    ],
)  # fmt: skip
def test_bad_input_is_named(make: Callable[[], object], words: str) -> None:
    with pytest.raises(hv.HemivarError, match=words) as caught:
        make()
    assert str(caught.value).count("\n") == 0


def test_what_resists_at_rest_is_no_more_than_the_law_gives() -> None:
    random = np.random.default_rng(2)
    for law in (LAWS["gauss"](), LAWS["rubbing when open"]()):
        for _ in range(60):
            rest = np.array([[-random.choice([0.0, 0.3, 0.9, 3.0]) * WIDTH, 0.0]])
            way = np.array([-random.uniform(0.0, 1.0), random.normal()])
            _, down, slip = (float(part[0]) for part in law.strongest(rest, 1.0))
            if not np.isfinite([down, slip]).all():
                continue
            places = rest + np.linspace(0.0, 8.0 * WIDTH / np.linalg.norm(way), 20001)[:, None] * way
            rise = np.diff(law.value(places)) / np.linalg.norm(np.diff(places, axis=0)[0]) * np.linalg.norm(way)
            assert down * -way[0] + slip * abs(way[1]) <= rise.max() * (1.0 + 0.05) + 1e-9


def test_signorini_is_a_formula_too() -> None:
    """Rigid contact with Tresca friction as a coupled formula: the same solution as of the laws by name."""
    pressed = {"tractions": {"top": (6.0, -20.0)}}
    plain = glued_plate(mixed())
    both = [
        hv.solve(hv.ContactProblem(plain.mesh, plain.material, {"bottom": contact}, plain.supports, **pressed))  # type: ignore[arg-type]
        for contact in (
            hv.Contact(CoupledFormulaLaw("3*s", reach=1.0, rigid=True)), hv.Contact(Signorini(), Tresca(3.0))
        )
    ]  # fmt: skip
    assert both[0].energy == pytest.approx(both[1].energy, rel=1e-9)
    assert both[0].multiplier == pytest.approx(both[1].multiplier, abs=1e-6 * np.abs(both[1].multiplier).max())


def test_points_that_are_found_are_not_searched_on(monkeypatch: pytest.MonkeyPatch) -> None:
    """Newton's method takes a handful of steps to a place in the chart, and as many energies."""
    law = hv.laws.CoupledFormulaLaw("0.05*(1 - exp(-30*(r^2 + 0.6*s^2)))", reach=1.0).at(None)
    a, b = np.full((3, 2), 6.5), np.array([[-0.7, 0.2], [-0.3, 0.1], [-0.05, 0.01]])
    energies: list[int] = []
    value = type(law.plane).value

    def counted(plane: PlanePotential, r: Array, s: Array) -> Array:
        energies.append(r.size)
        return value(plane, r, s)

    monkeypatch.setattr(type(law.plane), "value", counted)
    x = law.local_argmin(a, b)
    np.testing.assert_allclose(a * x + law.nearest_multiplier(x, np.zeros_like(x)), b, atol=1e-14)
    assert len(energies) <= 20
