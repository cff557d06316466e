"""Mixed-mode glue: the law against its own value, closed forms of a point on springs, and bad input."""

from __future__ import annotations

import itertools
from collections.abc import Callable

import numpy as np
import pytest

import hemivar as hv
from hemivar.basics.types import Array
from hemivar.discrete import DiscreteProblem
from hemivar.laws import (
    Adhesive,
    BilinearCohesion,
    Compliance,
    ContactLaw,
    ExponentialCohesion,
    FormulaLaw,
    MixedMode,
    Signorini,
    Softening,
    Superpotential,
    TrapezoidalCohesion,
    Tresca,
    cohesion_table,
    join_laws,
)
from hemivar.laws.registry import normal_law
from hemivar.laws.testing import LawError, check_law, check_vector_law
from tests.bodies import glued_plate, opened_point
from tests.samples import sampled

STRENGTH, ENERGY, STIFFNESS, RATIO = 30.0, 0.5, 1e4, 1.5
SHAPES: dict[str, Superpotential] = {
    "bilinear": BilinearCohesion(STRENGTH, ENERGY, STIFFNESS),
    "exponential": ExponentialCohesion(STRENGTH, ENERGY, STIFFNESS),
    "trapezoidal": TrapezoidalCohesion(STRENGTH, ENERGY, STIFFNESS, 0.005),
    "table": cohesion_table([0.0, 0.001, 0.002, 0.01, 0.02], [0.0, 10.0, 30.0, 20.0, 0.0]),
}

BILINEAR = MixedMode(SHAPES["bilinear"], RATIO)
COULOMB = ContactLaw(Signorini(), Tresca(hv.laws.CoulombBound(0.3))).at(None)


def glue(ratio: float = RATIO, compression: Superpotential | None = None) -> MixedMode:
    return MixedMode(SHAPES["bilinear"], ratio, Signorini() if compression is None else compression).at(None)


@pytest.mark.parametrize("shape", SHAPES)
def test_cohesions_pass_the_kit_of_scalar_laws(shape: str) -> None:
    check_law(SHAPES[shape].at(None), friction=True)


COMPRESSIONS: dict[str, Superpotential] = {"rigid": Signorini(), "soft": Compliance(5e3)}
EVERY = tuple(itertools.product(SHAPES, COMPRESSIONS, (2, 3)))
#: Any two of curve, compression and dimension meet.
PAIRWISE = (
    ("bilinear", "rigid", 2),
    ("bilinear", "soft", 3),
    ("exponential", "rigid", 3),
    ("exponential", "soft", 2),
    ("trapezoidal", "rigid", 2),
    ("trapezoidal", "soft", 3),
    ("table", "rigid", 3),
    ("table", "soft", 2),
)


def test_any_two_of_curve_compression_and_dimension_meet() -> None:
    for first, second in itertools.combinations(range(3), 2):
        assert {(one[first], one[second]) for one in PAIRWISE} == {(one[first], one[second]) for one in EVERY}


@pytest.mark.parametrize(("shape", "compression", "components"), sampled(EVERY, PAIRWISE))
def test_laws_pass_the_kit(shape: str, compression: str, components: int) -> None:
    law = MixedMode(SHAPES[shape], RATIO, COMPRESSIONS[compression]).at(None)
    check_vector_law(law, reach=0.04, components=components)


def test_the_kit_passes_laws_that_split_and_notices_a_wrong_alpha(monkeypatch: pytest.MonkeyPatch) -> None:
    check_vector_law(ContactLaw(Adhesive(5.0, 1.0, 2.0), Tresca(0.3)).at(None), reach=1.5)
    law = glue()
    alpha = law.weak_convexity
    monkeypatch.setattr(MixedMode, "weak_convexity", property(lambda self: (0.5 * alpha[0], 0.5 * alpha[1])))
    with pytest.raises(LawError, match="alpha makes the law convex"):
        check_vector_law(law, reach=0.04)


def test_the_fracture_energy_is_the_area_of_the_curve() -> None:
    for shape in ("bilinear", "exponential", "trapezoidal"):
        law = MixedMode(SHAPES[shape]).at(None)
        assert law.fracture_energy.item() == pytest.approx(ENERGY, rel=1e-12)
        assert law.strength.item() == pytest.approx(STRENGTH, rel=1e-12)
    area = 0.5 * (0.001 * 10.0 + 0.001 * 40.0 + 0.008 * 50.0 + 0.01 * 20.0)
    assert MixedMode(SHAPES["table"]).at(None).fracture_energy.item() == pytest.approx(area, rel=1e-12)


def test_the_exponential_is_one_within_a_millionth_of_the_strength() -> None:
    first = STRENGTH / STIFFNESS
    length = ENERGY / STRENGTH - 0.5 * first
    rho = np.linspace(first, first + 20.0 * length, 200_001)
    curve = ExponentialCohesion(STRENGTH, ENERGY, STIFFNESS).at(None)
    exact = STRENGTH * np.exp((first - rho) / length)
    np.testing.assert_allclose(curve.derivative(rho), exact, rtol=0.0, atol=1e-6 * STRENGTH)


def test_an_adhesive_may_be_stated_by_its_fracture_energy() -> None:
    law = Adhesive(STIFFNESS, STRENGTH, energy=ENERGY).at(None)
    assert law.value(np.array([-1.0]))[0] == pytest.approx(ENERGY, rel=1e-12)
    rate = STRENGTH / (2.0 * ENERGY / STRENGTH - STRENGTH / STIFFNESS)
    assert law.weak_convexity[0] == pytest.approx(rate, rel=1e-12)
    check_law(law)
    varies = Adhesive(STIFFNESS, STRENGTH, energy=lambda x: ENERGY * (1.0 + x[:, 0])).at(np.array([[0.0], [1.0]]))
    assert varies.value(np.full(2, -1.0)) == pytest.approx([ENERGY, 2.0 * ENERGY], rel=1e-12)
    with pytest.raises(hv.HemivarError, match="give one of the two"):
        Adhesive(STIFFNESS, STRENGTH, 900.0, energy=ENERGY)
    with pytest.raises(hv.HemivarError, match="not more than what is stored"):
        _ = Adhesive(STIFFNESS, STRENGTH, energy=0.01).at(None).knots


def test_the_work_to_break_does_not_depend_on_the_way() -> None:
    """Shear to 0.01, opening to separation and back: with Benzeggagh and Kenane's criterion that is more."""
    law = glue()
    corners = np.array([[0.0, 0.0], [0.0, 0.01], [-0.04, 0.01], [-0.04, 0.0]])
    work = 0.0
    nodes, weights = np.polynomial.legendre.leggauss(4)
    for start, end in itertools.pairwise(corners):
        parts = np.linspace(0.0, 1.0, 20001)
        t = (0.5 * (parts[1:] + parts[:-1])[:, None] + 0.5 * np.diff(parts)[:, None] * nodes).ravel()
        force = law.linearise(start + t[:, None] * (end - start)).gradient
        work += float(((force @ (end - start)).reshape(-1, 4) @ weights * 0.5 * np.diff(parts)).sum())
    assert work == pytest.approx(ENERGY, rel=1e-7)


# ---- a point on springs ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("angle", [0.0, 30.0, 45.0, 90.0])
def test_a_point_on_stiff_springs_softens_and_breaks_where_it_should(angle: float) -> None:
    law, springs = glue(), 5000.0
    way = np.array([np.cos(np.deg2rad(angle)), np.sin(np.deg2rad(angle))])
    if angle == 90.0:
        way[0] = 0.0
    first, last = STRENGTH / STIFFNESS, 2.0 * ENERGY / STRENGTH
    fall = STRENGTH / (last - first)
    elastic = way / (springs + STIFFNESS * np.array([1.0, RATIO**2]))
    onset = first / np.hypot(elastic[0], RATIO * elastic[1])
    free = springs * last / np.hypot(way[0], RATIO * way[1])
    found = hv.solve(opened_point(springs, onset * way, law))
    assert law.effective(found.local)[0] == pytest.approx(first, rel=1e-10)
    assert found.local[0] * [-1.0, 1.0] == pytest.approx(onset * elastic, rel=1e-10)
    assert hv.solve(opened_point(springs, 1.001 * onset * way, law)).states.names[0][0] != "debonded"
    assert law.damage(hv.solve(opened_point(springs, 0.999 * onset * way, law)).local)[0] == pytest.approx(
        0.0, abs=1e-12
    )
    assert law.damage(hv.solve(opened_point(springs, 1.001 * onset * way, law)).local)[0] > 0.0
    broken = hv.solve(opened_point(springs, 1.0001 * free * way, law))
    assert law.damage(broken.local)[0] == 1.0
    assert broken.local[0] * [-1.0, 1.0] == pytest.approx(1.0001 * free * way / springs, rel=1e-10)
    assert law.value(broken.local)[0] == pytest.approx(ENERGY, rel=1e-10)
    assert broken.energy == pytest.approx(ENERGY - 0.5 * (1.0001 * free) ** 2 / springs, rel=1e-10)
    nearly = hv.solve(opened_point(springs, 0.9999 * free * way, law))
    assert 0.99 < law.damage(nearly.local)[0] < 1.0
    if angle in (0.0, 90.0):  # one mode: a line meets a line
        beta = 1.0 if angle == 0.0 else RATIO
        load = 0.5 * (onset + free)
        rho = beta * (load - beta * fall * last) / (springs - beta**2 * fall)
        softened = hv.solve(opened_point(springs, load * way, law))
        assert law.effective(softened.local)[0] == pytest.approx(rho, rel=1e-10)
        assert softened.states.names[0][0] == ("softening" if angle == 0.0 else "contact")
        assert softened.states.names[1][0] == "slip"


def test_equal_strengths_and_springs_make_one_mode_of_all() -> None:
    law, springs, last, first = glue(1.0), 5000.0, 2.0 * ENERGY / STRENGTH, STRENGTH / STIFFNESS
    fall = STRENGTH / (last - first)
    for angle in (30.0, 45.0):
        way = np.array([np.cos(np.deg2rad(angle)), np.sin(np.deg2rad(angle))])
        rho = (80.0 - fall * last) / (springs - fall)
        found = hv.solve(opened_point(springs, 80.0 * way, law))
        assert found.local[0] * [-1.0, 1.0] == pytest.approx(rho * way, rel=1e-10)
        assert law.mode_ratio(found.local)[0] == pytest.approx(way[1] ** 2, rel=1e-10)


def test_the_margin_takes_each_component_with_its_own_alpha() -> None:
    law = glue()
    fall = STRENGTH / (2.0 * ENERGY / STRENGTH - STRENGTH / STIFFNESS)
    problem = DiscreteProblem.of_arrays(
        np.diag([2.0 * fall, 4.0 * fall * RATIO**2]), np.zeros(2), np.eye(2), np.ones(1), np.zeros(1), law
    )
    assert hv.certificates.smallness(problem).margin == pytest.approx(0.5, rel=1e-6)


def test_what_is_bonded_yet_is_pulled_where_floating_point_errors_are_raised() -> None:
    """Downhill from rest, a small force meets the springs of the glue, and a large one tears it off."""
    law, none = glue(), np.zeros((2, 2))
    with np.errstate(all="raise"):
        ends = law.local_minimiser(np.full((2, 2), 1e3), np.array([[-1.0, 0.5], [-1e3, 500.0]]), none)
    assert ends[0] == pytest.approx([-1.0 / (1e3 + STIFFNESS), 0.5 / (1e3 + RATIO**2 * STIFFNESS)])
    assert ends[1] == pytest.approx([-1.0, 0.5])


def test_results_do_not_change_with_units() -> None:
    """Newtons and millimetres, and kilonewtons and metres."""
    load = np.array([40.0, 30.0])
    here = hv.solve(opened_point(2000.0, load, glue()))
    law = MixedMode(BilinearCohesion(STRENGTH * 1e3, ENERGY, STIFFNESS * 1e6), RATIO).at(None)
    there = hv.solve(opened_point(2000.0 * 1e6, load * 1e3, law))
    assert there.local == pytest.approx(here.local * 1e-3, rel=1e-9)
    assert there.states.names == here.states.names


# ---- bodies -----------------------------------------------------------------------------------------------------


def test_newton_and_multigrid_agree_on_a_body() -> None:
    newton = hv.solve(glued_plate(BILINEAR), hv.solvers.NonsmoothNewton())
    multigrid = hv.solve(glued_plate(BILINEAR), hv.solvers.NonsmoothMultigrid())
    assert newton.status.name == multigrid.status.name == "CONVERGED"
    assert multigrid.energy == pytest.approx(newton.energy, rel=1e-8)
    assert {"bonded", "softening"} & set(newton.states.names[0])
    assert hv.certify(newton).kind.name in ("LOCAL_MINIMISER", "UNIQUE_MINIMISER")


def test_two_boundaries_may_have_different_laws() -> None:
    problem = glued_plate(BILINEAR, cells=2)
    both = hv.ContactProblem(
        problem.mesh, problem.material,
        {"bottom": hv.Contact(MixedMode(SHAPES["bilinear"], RATIO)), "right": hv.Contact(Signorini(), Tresca(0.4))},
        problem.supports, tractions={"top": (12.0, 20.0)},
    )  # fmt: skip
    found = hv.solve(both)
    assert found.status.name == "CONVERGED"
    assert hv.certify(found).kind.name in ("LOCAL_MINIMISER", "UNIQUE_MINIMISER")
    alone = hv.solve(both, hv.solvers.NonsmoothMultigrid())
    assert alone.energy == pytest.approx(found.energy, rel=1e-8)


def test_a_joined_law_answers_as_its_parts_do() -> None:
    law, other = glue(), ContactLaw(Adhesive(5e3, 20.0, 900.0), Tresca(3.0)).at(None)
    joined = join_laws([(law, 30), (other, 30)])
    check_vector_law(joined.take(np.arange(30, 60)), reach=0.04)
    random = np.random.default_rng(1)
    r, b, a = random.normal(size=(60, 2)) * 0.02, random.normal(size=(60, 2)) * 40.0, np.full((60, 2), 3e3)
    r[:, 0] = np.minimum(r[:, 0], 0.0)
    together = joined.local_argmin(a, b)
    for part, rows in ((law, slice(0, 30)), (other, slice(30, 60))):
        assert together[rows] == pytest.approx(part.local_argmin(a[rows], b[rows]))
    assert joined.value(r)[:30] == pytest.approx(law.value(r[:30]))
    assert joined.nearest_multiplier(r, b)[30:] == pytest.approx(other.nearest_multiplier(r[30:], b[30:]))


def test_laws_may_vary_over_the_boundary() -> None:
    def strength(x: Array) -> Array:
        return STRENGTH * (1.0 + x[:, 0])

    law = MixedMode(BilinearCohesion(strength, ENERGY, STIFFNESS), RATIO)
    found = hv.solve(glued_plate(law, cells=2))
    assert found.status.name == "CONVERGED"
    resolved = law.at(np.array([[0.0, 0.0], [1.0, 0.0]]))
    assert resolved.strength == pytest.approx([STRENGTH, 2.0 * STRENGTH])
    assert resolved.take(np.array([1])).fracture_energy == pytest.approx([ENERGY])


def slider(gap: float, shear: float = 0.0) -> hv.ContactProblem:
    """A block that rollers guide above its glue: nothing but the glue holds it along the ground."""
    return hv.ContactProblem(
        hv.rectangle((1.0, 0.5), (4, 2)),
        hv.Material.young(3000.0, 0.3),
        {"bottom": hv.Contact(MixedMode(SHAPES["bilinear"], RATIO), gap=gap)},
        {"top": hv.Roller()},
        body_force=(shear, 0.0),
    )


def test_glue_that_is_open_at_rest_holds_as_much_as_is_left_of_it() -> None:
    """Bonded glue holds a block along the ground; glue that its gap has broken holds nothing."""
    last = 2.0 * ENERGY / STRENGTH
    assert hv.discretize(slider(0.0)).limit is not None
    assert hv.discretize(slider(0.5 * last, 1e-3)).limit is not None
    with pytest.raises(hv.errors.SupportError):
        hv.discretize(slider(1.01 * last, 1e-3))


def test_what_resists_at_rest_is_no_more_than_the_law_gives() -> None:
    """Along random ways from rest the steepest rise of j is at least what the law says that it resists."""
    random, law = np.random.default_rng(2), glue()
    last = law.opening_at_break.item()
    for _ in range(200):
        rest = np.array([[-random.choice([0.0, 0.3, 0.9, 1.1]) * last, 0.0]])
        way = np.array([-random.uniform(0.0, 1.0), random.normal()])
        up, down, slip = (float(part[0]) for part in law.strongest(rest, 1.0))
        places = rest + np.linspace(0.0, 3.0 * last / np.linalg.norm(way * [1.0, RATIO]), 20001)[:, None] * way
        rise = np.diff(law.value(places)) / np.linalg.norm(np.diff(places, axis=0)[0]) * np.linalg.norm(way)
        assert down * -way[0] + slip * abs(way[1]) <= rise.max() * (1.0 + 1e-3)
        assert up == np.inf


# ---- what is refused, and files ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: MixedMode(3.0), "the cohesion of law 'mixed-mode' is 3.0"),  # type: ignore[arg-type]
        (lambda: MixedMode(SHAPES["bilinear"], compression="hard"), "the compression of law"),  # type: ignore[arg-type]
        (lambda: MixedMode(SHAPES["bilinear"], 0.0), "ratio of law 'mixed-mode' is 0"),
        (lambda: MixedMode(SHAPES["bilinear"], -1.0), "it must be positive"),
        (lambda: MixedMode(SHAPES["bilinear"], np.nan), "finite number"),
        (lambda: MixedMode(FormulaLaw("r^2/2")), "not piecewise linear"),
        (lambda: MixedMode(Adhesive(5.0, 1.0, 2.0)).at(None), "not even"),
        (lambda: MixedMode(Signorini()).at(None), "not even"),
        (lambda: MixedMode(SHAPES["bilinear"], compression=Softening(2.0, 0.1, 0.5)).at(None), "not convex"),
        (lambda: MixedMode(SHAPES["bilinear"], compression=Adhesive(5.0, 1.0, 2.0)).at(None), "acts in opening"),
        (lambda: BilinearCohesion(0.0, 1.0, 1.0).at(None), "strength of law 'bilinear cohesion' is 0"),
        (lambda: BilinearCohesion(1.0, 0.0, 1.0).at(None), "energy"),
        (lambda: BilinearCohesion(1.0, 1.0, -1.0).at(None), "stiffness"),
        (lambda: BilinearCohesion(30.0, 0.01, 1e4).at(None).knots, "must exceed the elastic energy"),
        (lambda: ExponentialCohesion(30.0, 0.045, 1e4).at(None).knots, "must exceed the elastic energy"),
        (lambda: TrapezoidalCohesion(30.0, 0.5, 1e4, -1.0).at(None), "at least 0"),
        (lambda: TrapezoidalCohesion(30.0, 0.5, 1e4, 1.0).at(None).knots, "takes more than the fracture energy"),
        (lambda: cohesion_table([0.0, 1.0], [0.0, 0.0]), "at least three"),
        (lambda: cohesion_table([0.0, 1.0, 2.0], [0.0, 1.0]), "3 openings and 2 tractions"),
        (lambda: cohesion_table([0.1, 1.0, 2.0], [0.0, 1.0, 0.0]), "they must increase, from 0"),
        (lambda: cohesion_table([0.0, 2.0, 1.0], [0.0, 1.0, 0.0]), "they must increase, from 0"),
        (lambda: cohesion_table([0.0, 1.0, 2.0], [0.0, -1.0, 0.0]), "at least 0"),
        (lambda: cohesion_table([0.0, 1.0, 2.0], [1.0, 1.0, 0.0]), "0 at the first and at the last opening"),
        (lambda: cohesion_table([0.0, 1.0, 2.0], [0.0, 1.0, 1.0]), "0 at the first and at the last opening"),
        (lambda: cohesion_table([0.0, 1.0, np.inf], [0.0, 1.0, 0.0]), "openings"),
        (lambda: hv.Contact(glue(), Tresca(0.3)), "leave the friction 'tresca' out"),
        (lambda: hv.Contact(ContactLaw(Signorini())), "give its parts"),
        (lambda: hv.Contact(Signorini(), damping=glue()), "damping is"),  # type: ignore[arg-type]
        (lambda: hv.ScalarContact(glue()), "law"),  # type: ignore[arg-type]
        (lambda: normal_law("mixed-mode"), "not known"),
        (lambda: join_laws([]), "no contact point"),
    ],
)  # fmt: skip
def test_bad_input_is_named(make: Callable[[], object], words: str) -> None:
    with pytest.raises(hv.HemivarError, match=words):
        make()
