"""Laws of contact points in the compiled kernels against the same laws in NumPy."""

from __future__ import annotations

import pickle
from dataclasses import replace

import numpy as np
import pytest

import hemivar as hv
from hemivar import gallery
from hemivar.basics.types import Array
from hemivar.kernels import kernels
from hemivar.laws import Friction, PiecewiseQuadratic, Superpotential
from hemivar.laws.compiled_law import lay_out
from hemivar.laws.contact_law import ContactLaw
from hemivar.laws.friction.profiles import LogarithmicWeakening
from hemivar.laws.piecewise_law import stack

built = pytest.mark.skipif(kernels() is None, reason="the kernels are not compiled here")

M = 60
NORMAL: dict[str, Superpotential] = {
    "threshold": hv.laws.ThresholdCompliance(0.3, 2.0),
    "springs": hv.laws.Compliance(3.0),
    "rigid": hv.laws.Signorini(),
    "held": hv.laws.Bilateral(),
    "nothing": hv.laws.NoContact(),
    "glue": hv.laws.Adhesive(5.0, 1.0, 2.0),
    "brittle": hv.laws.Adhesive(5.0, 1.0),
    "layers": hv.laws.Layered([0.1, 0.2], [3.0, 10.0], [0.1, 0.5]),
    "saw-tooth": hv.laws.SawTooth([0.5, 1.0, 2.0], [6.0, 2.0, 1.0], [0.0, 1.0, 0.5]),
    "ends": hv.laws.FinitePenetration(3.0, 0.2),
    "varied": hv.laws.ThresholdCompliance(np.linspace(0.0, 0.4, M), np.linspace(1.0, 9.0, M)),
    "several": stack([(hv.laws.Signorini(), M // 3), (hv.laws.Adhesive(5.0, 1.0, 2.0), M - M // 3)]),
    "moved": hv.laws.Softening(2.0, 0.1, 0.5).scaled(np.linspace(0.0, 2.0, M)),
}
FRICTION: dict[str, Friction] = {
    "none": hv.laws.NoFriction(),
    "tresca": hv.laws.Tresca(0.5),
    "varied": hv.laws.Tresca(np.maximum(np.linspace(-0.5, 2.0, M), 0.0)),
    "table": hv.laws.SlipTable(1.0, [0.0, 0.1, 0.1, 0.4], [1.0, 0.8, 0.5, 0.2]),
    "drop": hv.laws.StaticKinetic(0.5, 0.1),
    "logarithmic": hv.laws.Logarithmic(np.linspace(0.0, 0.6, M), 0.7),
    "weakening": hv.laws.SlipWeakening(0.5),
    "strengthening": hv.laws.SlipWeakening(0.5, 0.7, 1.0, 3.0),
}


def random_table(seed: int) -> Superpotential:
    """A table with jumps up and down, pieces that fall, and ends here and there."""
    rng = np.random.default_rng(seed)
    count, rows = int(rng.integers(1, 7)), int(rng.choice([1, M]))
    knots = np.cumsum(rng.uniform(0.05, 0.5, (rows, count)), axis=1) - 0.8
    slopes = np.where(rng.random((rows, count + 1)) < 0.3, 0.0, rng.normal(1.0, 3.0, (rows, count + 1)))
    jumps = np.where(rng.random((rows, count)) < 0.4, 0.0, rng.normal(0.5, 1.0, (rows, count)))
    lower = np.where(rng.random(rows) < 0.3, knots[:, 0], -np.inf)
    upper = np.where(rng.random(rows) < 0.3, knots[:, -1], np.inf) if count > 1 else np.full(rows, np.inf)
    return PiecewiseQuadratic(knots, slopes, jumps, rng.normal(size=rows), lower, upper)


def both(law: ContactLaw) -> tuple[ContactLaw, ContactLaw]:
    """The law in the kernels, and the same in NumPy."""
    law = law.at(np.zeros((M, 2)))
    plain = replace(law)
    vars(plain)["_compiled"] = None
    assert law._compiled is not None
    return law, plain


def places(law: ContactLaw, d: int, seed: int) -> tuple[Array, Array]:
    """Displacements on pieces, exactly at knots, at rest, and beyond the domain; multipliers."""
    rng = np.random.default_rng(seed)
    r, lam = rng.normal(0.0, 0.6, (M, d)), rng.normal(0.0, 1.5, (M, d))
    knots = np.broadcast_to(law.normal.knots, (M, law.normal.knots.shape[1]))
    chosen = knots[np.arange(M), rng.integers(0, knots.shape[1], M)]
    r[::3, 0] = np.where(np.isfinite(chosen), chosen, 0.0)[::3]
    if d > 1:
        r[::4, 1:] = 0.0
        slips = np.broadcast_to(law.tangential.knots, (M, law.tangential.knots.shape[1]))[:, -1]
        at = (np.arange(M) % 5 == 1) & np.isfinite(slips)
        r[at, 1:] = np.abs(slips[at, None]) * np.eye(d - 1)[0]
        lam[1::7, 1:] = 0.0
    return r, lam


def compare(law: ContactLaw, d: int, seed: int) -> int:
    """All that both say of some places; how many local problems the kernels solved."""
    fast, plain = both(law)
    r, lam = places(plain, d, seed)
    other, rng = places(plain, d, seed + 1)[0], np.random.default_rng(seed)
    tau = rng.uniform(0.1, 3.0, (M, 2))
    near = {"rtol": 1e-12, "atol": 1e-12}
    np.testing.assert_allclose(fast.value(r), plain.value(r), **near)
    for mine, theirs in zip(vars(fast.linearise(r)).values(), vars(plain.linearise(r)).values(), strict=True):
        assert mine.dtype == theirs.dtype
        np.testing.assert_allclose(mine, theirs, **near)
    np.testing.assert_allclose(fast.nearest_multiplier(r, lam), plain.nearest_multiplier(r, lam), **near)
    np.testing.assert_allclose(fast.clamp(r, other), plain.clamp(r, other), **near)
    np.testing.assert_allclose(fast.graph_distance(r, lam, tau), plain.graph_distance(r, lam, tau), **near)
    on_graph = plain.nearest_multiplier(r, lam)
    np.testing.assert_allclose(fast.graph_distance(r, on_graph, tau), plain.graph_distance(r, on_graph, tau), **near)
    solved = 0
    for stiffness in (0.5, 60.0):
        a = stiffness * rng.uniform(0.5, 2.0, (M, 2))
        b = np.repeat(a, [1, max(d - 1, 1)], axis=1)[:, :d] * r + lam
        b[::9] = 0.0
        assert fast._compiled is not None
        found = fast._compiled.local_argmin(a, b)
        if found is not None:
            solved += 1
            np.testing.assert_allclose(found, plain.local_argmin(a, b), **near)
        np.testing.assert_allclose(fast.local_argmin(a, b), plain.local_argmin(a, b), **near)
    return solved


@built
@pytest.mark.parametrize("friction", FRICTION)
@pytest.mark.parametrize("normal", NORMAL)
def test_named_laws_answer_as_in_numpy(normal: str, friction: str) -> None:
    law = ContactLaw(NORMAL[normal], FRICTION[friction])
    for d in (1, 2, 3) if friction == "none" else (2, 3):
        solved = compare(law, d, 7)
        alphas = law.at(np.zeros((M, 2))).weak_convexity
        assert solved == 2 or any(alpha.any() for alpha in alphas)


@built
@pytest.mark.parametrize("seed", range(40))
def test_random_tables_answer_as_in_numpy(seed: int) -> None:
    bound = np.random.default_rng(seed).uniform(0.0, 2.0, M)
    compare(
        ContactLaw(random_table(seed), hv.laws.SlipTable(bound, [0.0, 0.2, 0.2], [1.0, 0.9, 0.3])), 2 + seed % 2, seed
    )


@built
def test_a_bound_that_follows_the_pressure_is_a_factor_of_one_table() -> None:
    law = ContactLaw(hv.laws.ThresholdCompliance(0.1, 3.0), hv.laws.Coulomb(0.4)).at(np.zeros((M, 2)))
    r, lam = np.random.default_rng(3).normal(size=(2, M, 3))
    assert law._compiled is None
    first, second = law.frozen(r, lam), law.frozen(r, 2.0 * lam)
    assert first._compiled is not None
    assert second._compiled is not None
    assert first.friction.profile.laid_out is second.friction.profile.laid_out
    for one in (first, second):
        compare(one, 3, 5)


@built
@pytest.mark.parametrize(
    "law",
    [
        ContactLaw(hv.laws.Compliance(3.0, 1.5)),
        ContactLaw(hv.laws.FormulaLaw("0.3*cos(5*r) + 0.1*r^2/2", reach=4.0)),
        ContactLaw(hv.laws.FunctionLaw(derivative=lambda r: r)),
        ContactLaw(hv.laws.Signorini(), Friction(0.5, hv.laws.FormulaLaw("log(1 + r)", even=True))),
        ContactLaw(stack([(hv.laws.Compliance(3.0, 2.0), 30), (hv.laws.Signorini(), 30)])),
        ContactLaw(PiecewiseQuadratic(np.linspace(0.0, 1.0, 60), np.ones(61), np.zeros(60))),
    ],
)
def test_other_laws_are_left_to_numpy(law: ContactLaw) -> None:
    law = law.at(np.zeros((M, 2)))
    assert law._compiled is None
    assert np.isfinite(law.nearest_multiplier(np.zeros((M, 2)), np.ones((M, 2)))).all()


@built
def test_points_whose_energy_has_hills_or_no_end_are_left_to_numpy() -> None:
    law, _ = both(ContactLaw(hv.laws.Adhesive(5.0, 1.0, 2.0)))
    assert law._compiled is not None
    b = np.linspace(-8.0, 8.0, M)[:, None]
    assert law._compiled.local_argmin(np.full((M, 2), 0.1), b) is None
    free, _ = both(ContactLaw(hv.laws.NoContact()))
    assert free._compiled is not None
    assert free._compiled.local_argmin(np.zeros((M, 2)), b) is None
    assert np.isnan(free.local_argmin(np.zeros((M, 2)), b)).all()


@built
def test_what_is_no_number_stays_none() -> None:
    law, plain = both(ContactLaw(hv.laws.ThresholdCompliance(0.3, 2.0), hv.laws.Logarithmic(0.5, 0.7)))
    r, lam = np.random.default_rng(1).normal(size=(2, M, 3))
    r[0], r[1, 0], r[2, 1], lam[3], lam[4, 2] = np.nan, np.nan, np.nan, np.nan, np.nan
    tau = np.ones((M, 2))
    for name, given in (
        ("value", (r,)),
        ("nearest_multiplier", (r, lam)),
        ("clamp", (lam, r)),
        ("graph_distance", (r, lam, tau)),
        ("local_argmin", (tau, r)),
    ):
        with np.errstate(invalid="ignore"):
            mine, theirs = getattr(law, name)(*given), getattr(plain, name)(*given)
        np.testing.assert_array_equal(np.isnan(mine), np.isnan(theirs), err_msg=name)


@built
def test_arrays_are_read_as_they_lie() -> None:
    law, plain = both(ContactLaw(hv.laws.ThresholdCompliance(0.3, 2.0), hv.laws.Tresca(0.5)))
    r = np.random.default_rng(1).normal(size=(2 * M, 6))[::2, ::2]
    np.testing.assert_allclose(law.value(r), plain.value(r), rtol=1e-14)
    np.testing.assert_allclose(law.value(np.asfortranarray(r)), plain.value(r), rtol=1e-14)
    varied = ContactLaw(NORMAL["varied"]).at(np.zeros((M, 2)))
    with pytest.raises(ValueError, match=f"{M} contact points"):
        varied.value(np.zeros((M + 1, 2)))
    with pytest.raises(ValueError, match="broadcast"):
        law.nearest_multiplier(r, r[:, :2])
    one, lam = np.full((M, 1), 0.7), np.ones((M, 1))
    np.testing.assert_allclose(law.graph_distance(one, lam, one), plain.graph_distance(one, lam, one), rtol=1e-14)


@built
def test_a_factor_that_overflows_is_left_to_those_that_refuse_it() -> None:
    stiff = PiecewiseQuadratic([0.0], [0.0, 1e200], [1e200])
    law = ContactLaw(hv.laws.Signorini(), Friction(1e200, hv.laws.SlipTable(1.0, [0.0, 0.1], [1e150, 1e149]).profile))
    assert law.at(np.zeros((M, 2)))._compiled is None
    assert ContactLaw(stiff).at(np.zeros((M, 2)))._compiled is not None


@built
def test_a_law_is_pickled_without_its_compiled_form() -> None:
    law, _ = both(ContactLaw(hv.laws.ThresholdCompliance(0.3, 2.0), hv.laws.Tresca(0.5)))
    r = np.random.default_rng(1).normal(size=(M, 2))
    sent = pickle.loads(pickle.dumps(law))
    np.testing.assert_array_equal(sent.value(r), law.value(r))
    with pytest.raises(TypeError, match="belong to this process"):
        pickle.dumps(law._compiled)


def test_a_law_without_points_is_not_laid_out() -> None:
    none = LogarithmicWeakening(1.0).scaled(np.zeros(0))
    assert lay_out(none) is None


@built
@pytest.mark.parametrize("friction", [hv.laws.Tresca(0.3), hv.laws.Logarithmic(0.3), hv.laws.Coulomb(0.3)])
def test_solutions_do_not_depend_on_it(friction: Friction, monkeypatch: pytest.MonkeyPatch) -> None:
    statement = gallery.survey_cube("5.1", 4)
    contact = {name: replace(each, friction=friction) for name, each in statement.contact.items()}
    problem = hv.discretize(replace(statement, contact=contact))
    fast = hv.solve(problem, "multigrid", rtol=1e-12)
    monkeypatch.setattr("hemivar.laws.compiled_law.kernels", lambda: None)
    plain = hv.solve(hv.discretize(replace(statement, contact=contact)), "multigrid", rtol=1e-12)
    assert fast.status is plain.status is hv.Status.CONVERGED
    assert fast.steps == plain.steps
    size = np.abs(plain.displacement).max()
    np.testing.assert_allclose(fast.displacement, plain.displacement, rtol=0.0, atol=1e-10 * size)
