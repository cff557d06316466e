"""Parameters of laws from curves: those that made the curve, with intervals that hold them."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from types import SimpleNamespace

import numpy as np
import pytest

import hemivar as hv
from hemivar.basics import deadline
from hemivar.errors import ProblemError
from hemivar.identification import FitOptions, Measurements
from hemivar.identification.fit import Fit, Parameter
from hemivar.solvers import Progress
from tests import bodies
from tests.samples import sampled, slow

from .experiments import BILINEAR, CASES, FORCE, TRILINEAR, Case

#: What a fit says where its time limit ended it.
LIMITS = (
    "was over before the rows of the curve were stated",
    "ended the fit in start 1 of 2, before the body was solved",
    "others may fit better",
    "left none for certificates",
)


def _fit(case: Case, measured: Measurements, **options: float) -> Fit:
    return hv.identification.identify(case.state, measured, case.ranges, FitOptions(**options))  # type: ignore[arg-type]


@pytest.mark.parametrize("name", sampled(CASES, ["bilinear"]))
def test_a_curve_without_noise_gives_its_law(name: str) -> None:
    case = CASES[name]
    found = _fit(case, case.measured())
    for key, value in case.truth.items():
        assert found.value(key) == pytest.approx(value, rel=1e-6)
    assert all(found.identified)
    assert found.misfit < 1e-7


@pytest.mark.parametrize("side", ["upper:bottom", "lower:top"])
def test_the_law_of_a_joint_is_found_by_the_force_on_either_side(side: str) -> None:
    """Two blocks without lateral strain, E = 10, on springs: 1/F = 2 h/E + 1/k per pull."""
    mesh = hv.Mesh.assembled(
        {"upper": hv.rectangle((1.0, 1.0), (3, 1), origin=(0.0, 1.0)), "lower": hv.rectangle((1.0, 1.0), (2, 1))}
    )

    def state(values: Mapping[str, float]) -> hv.ContactProblem:
        return hv.ContactProblem(
            mesh,
            hv.Material.young(10.0, 0.0),
            {"upper:bottom": hv.Contact(hv.Compliance(values["stiffness"]), against="lower:top")},
            {"lower:bottom": hv.Clamped(), "upper:top": hv.Fixed(x=0.0, y=-values["push"])},
        )

    pushed, sign = np.array([0.01, 0.02, 0.03]), 1.0 if side == "upper:bottom" else -1.0
    force = sign * pushed / (2.0 / 10.0 + 1.0 / 7.0)
    measured = Measurements({"push": pushed}, {f"contact.{side}.force.y": force})
    found = hv.identification.identify(state, measured, {"stiffness": (1.0, 50.0)})
    assert found.value("stiffness") == pytest.approx(7.0, rel=1e-6)


@pytest.mark.parametrize("name", sampled(CASES, ["trilinear"]))
def test_one_per_cent_of_noise_gives_it_within_two(name: str) -> None:
    case = CASES[name]
    found = _fit(case, case.measured(0.01, seed=5))
    np.testing.assert_allclose(found.values, list(case.truth.values()), rtol=0.02)
    low, high = found.intervals.T
    assert ((low < found.values) & (found.values < high)).all()
    assert found.noise == pytest.approx(0.01, rel=0.5)


@pytest.mark.slow
def test_intervals_grow_with_the_noise_and_the_confidence() -> None:
    half = {}
    for noise, confidence in ((0.005, 0.95), (0.01, 0.95), (0.01, 0.99)):
        options = FitOptions(starts=1, noise=noise, confidence=confidence)
        found = hv.identification.identify(TRILINEAR.state, TRILINEAR.measured(0.005, 2), TRILINEAR.ranges, options)
        half[noise, confidence] = np.diff(np.log(found.intervals))[:, 0] / 2.0
    np.testing.assert_allclose(half[0.01, 0.95], 2.0 * half[0.005, 0.95], rtol=1e-6)
    np.testing.assert_allclose(half[0.01, 0.99] / half[0.01, 0.95], 2.5758 / 1.95996, rtol=1e-4)


def test_a_curve_that_ends_before_the_peak_leaves_what_comes_after_it_open() -> None:
    early = Measurements({"pull": BILINEAR.pulled[:5]}, {FORCE: BILINEAR.measured(0.01).values[:5, 0]})
    found = _fit(BILINEAR, early)
    assert found.identified == (True, False, False)
    assert any("strength is not identifiable from this curve" in text for text in found.messages)
    np.testing.assert_array_equal(found.intervals[1:], [[0.0, np.inf]] * 2)
    assert found.value("stiffness") == pytest.approx(40.0, rel=0.1)


@pytest.mark.filterwarnings("error")
def test_a_parameter_that_the_curve_does_not_depend_on_is_named_and_no_more_is_printed() -> None:
    """A block without lateral strain slips nowhere, so that the friction bound, whose range reaches zero, is open."""

    def state(values: Mapping[str, float]) -> hv.ContactProblem:
        return hv.ContactProblem(
            hv.rectangle((1.0, 1.0), (3, 1)), hv.Material.young(10.0, 0.0),
            {"bottom": hv.Contact(hv.Compliance(values["stiffness"]), hv.Tresca(values["bound"]))},
            {"left": "roller"}, tractions={"top": (0.0, -values["push"])},
        )  # fmt: skip

    pushed = np.array([0.1, 0.2, 0.3])
    measured = Measurements({"push": pushed}, {"boundary.top.displacement.y": -pushed * (1.0 / 10.0 + 1.0 / 7.0)})
    ranges = {"stiffness": (1.0, 50.0), "bound": (0.0, 5.0)}
    found = hv.identification.identify(state, measured, ranges, FitOptions(starts=1))
    assert found.identified == (True, False)
    assert found.value("stiffness") == pytest.approx(7.0, rel=1e-6)
    assert [text for text in found.messages if "does not depend on it" in text] == [
        "bound is not identifiable from this curve: the curve does not depend on it; leave it out of the fit, or "
        "measure where it acts"
    ]
    assert "bound 2.5 (any), not identifiable" in " ".join(str(found.summary()).split())


@pytest.mark.parametrize("starts", [1, slow(2)])
def test_two_springs_in_a_row_cannot_be_told_apart(starts: int) -> None:
    """The curve depends on the product of two parameters alone: the direction of what it cannot tell is named."""

    def state(values: Mapping[str, float]) -> hv.ContactProblem:
        law = hv.Adhesive(stiffness=40.0 * values["a"] * values["b"], strength=1e3)
        return Case(lambda _: law, {}, BILINEAR.pulled).state(values)

    measured = BILINEAR.measured(0.01)
    early = Measurements({"pull": BILINEAR.pulled[:5]}, {FORCE: measured.values[:5, 0]})
    found = hv.identification.identify(state, early, {"a": (0.5, 2.0), "b": (0.5, 2.0)}, FitOptions(starts=starts))
    assert not any(found.identified)
    assert found.value("a") * found.value("b") == pytest.approx(1.0, rel=0.1)
    np.testing.assert_allclose(np.abs(found.directions[1]), np.sqrt(0.5), atol=1e-3)
    assert any("cannot distinguish a and b" in text for text in found.messages)


def test_a_positive_parameter_has_no_interval_below_zero() -> None:
    """Of a curve so noisy that the error is larger than the parameter."""
    found = _fit(BILINEAR, BILINEAR.measured(0.05, seed=3), starts=1, noise=2.0)
    assert (found.standard_errors > found.values).any()
    assert (found.intervals[:, 0] >= 0.0).all()


def test_the_time_limit_holds_for_the_whole_fit(monkeypatch: pytest.MonkeyPatch) -> None:
    """From the first statement to the last certificate; the clock goes on by a second whenever it is looked at."""
    ticks = itertools.count()
    monkeypatch.setattr(deadline, "time", SimpleNamespace(perf_counter=lambda: float(next(ticks))))

    def state(values: Mapping[str, float]) -> hv.ContactProblem:
        return bodies.square(
            hv.Compliance(values["stiffness"]), 2, supports={"top": hv.Fixed(x=0.0, y=-values["push"])}
        )

    def found(limit: float) -> tuple[Fit | None, str, float]:
        begin, controls = next(ticks), hv.Controls(max_time=limit)
        try:
            fit = hv.identification.identify(
                state, curve, {"stiffness": (1.0, 50.0)}, FitOptions(starts=2), controls=controls
            )
        except ProblemError as error:
            return None, str(error), next(ticks) - begin
        return fit, " ".join(fit.messages), next(ticks) - begin

    curve = Measurements({"push": np.array([0.01, 0.02, 0.03])}, {FORCE: np.array([-0.029, -0.062, -0.089])})
    found(1e9)
    whole, told, asked = found(1e9)
    assert whole is not None
    assert "limit" not in told
    assert not np.isnan(whole.certified).any()
    said = set()
    for limit in (0.0, 0.02 * asked, 0.04 * asked, 0.2 * asked, 0.7 * asked, asked - 10.0):
        fit, told, spent = found(limit)
        assert f"the time limit of {limit:g} s" in told
        assert spent < limit + 12.0
        assert fit is None or np.isnan(fit.certified).all()
        said |= {words for words in LIMITS if words in told}
        if fit is not None and "left none for certificates" in told and "ended the fit" not in told:
            np.testing.assert_array_equal(fit.values, whole.values)
    assert said == set(LIMITS)


@pytest.mark.parametrize("count", [1, 40, 90])
def test_an_interruption_of_one_solve_ends_the_fit(count: int) -> None:
    case, steps = BILINEAR, itertools.count(1)

    def pressed(_: Progress) -> None:
        if next(steps) == count:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        hv.identification.identify(case.state, case.measured(), case.ranges, controls=hv.Controls(callback=pressed))


@pytest.mark.slow
def test_units_do_not_matter() -> None:
    """Lengths in mm and stresses in kPa: the same parameters in these units, the same intervals of them."""
    found = _fit(BILINEAR, BILINEAR.measured(0.01, 4))

    def state(values: Mapping[str, float]) -> hv.ContactProblem:
        law = hv.Adhesive(stiffness=values["stiffness"], strength=values["strength"], softening=values["softening"])
        return hv.ContactProblem(
            mesh=hv.rectangle((1e3, 1e3), 1), material=hv.Material.lame(4e4, 4e4),
            supports={"top": hv.Fixed(x=0.0, y=values["pull"])}, contact={"bottom": hv.Contact(law)},
        )  # fmt: skip

    given, unit = BILINEAR.measured(0.01, 4), np.array([1.0, 1e3, 1.0])
    other = Measurements({"pull": 1e3 * given.inputs["pull"]}, {FORCE: 1e6 * given.values[:, 0]})
    low, high = BILINEAR.ranges["strength"]
    scaled = hv.identification.identify(state, other, {**BILINEAR.ranges, "strength": (1e3 * low, 1e3 * high)})
    np.testing.assert_allclose(scaled.values / unit, found.values, rtol=1e-5)
    np.testing.assert_allclose(scaled.intervals / unit[:, None], found.intervals, rtol=1e-3)


@pytest.mark.parametrize("every", [4, slow(1)])
def test_a_law_of_another_kind_is_doubted(every: int) -> None:
    """A spring that never lets go does not explain a curve with a peak."""
    spring = Case(lambda v: hv.Adhesive(stiffness=v["stiffness"], strength=1e3), {"stiffness": 40.0}, BILINEAR.pulled)
    ranges, once = {"stiffness": (1.0, 200.0)}, FitOptions(starts=1)
    curve = BILINEAR.measured(0.01)
    rows = Measurements({"pull": curve.inputs["pull"][::every]}, {FORCE: curve.values[::every, 0]})
    found = hv.identification.identify(spring.state, rows, ranges, once)
    assert any("use another law" in text for text in found.messages)


@pytest.mark.parametrize(
    ("measured", "parameters", "says"),
    [
        (lambda m: Measurements(m.inputs, {FORCE: 1e3 * m.values[:, 0]}), None, "check the units"),
        (
            lambda m: Measurements({"pull": m.values[:, 0] + 1.0}, {FORCE: m.inputs["pull"]}),
            None,
            "order of the columns",
        ),
        (lambda m: Measurements({"pull": m.inputs["pull"][:3]}, {FORCE: m.values[:3, 0]}), None, "measure at least 4"),
        (lambda m: m, {}, "name at least one"),
        (lambda m: m, {"pull": (1.0, 2.0)}, "column of what was set"),
        (lambda m: Measurements(m.inputs, {"support.top.force": m.values[:, 0]}), None, r"as in support.top.force.x"),
        (lambda m: Measurements(m.inputs, {"support.roof.force.y": m.values[:, 0]}), None, "support.top.force"),
    ],
)
def test_bad_data(measured: object, parameters: object, says: str) -> None:
    given = measured(BILINEAR.measured())  # type: ignore[operator]
    wanted = BILINEAR.ranges if parameters is None else parameters
    with pytest.raises(ProblemError, match=says):
        hv.identification.identify(BILINEAR.state, given, wanted)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("parameter", "says"),
    [
        (("k", 2.0, 1.0), "a lower end and a higher one"),
        (("k", 1.0, np.inf), "a lower end and a higher one"),
        (("k", 1.0, 2.0, 3.0), "widen the range"),
    ],
)
def test_bad_ranges(parameter: tuple[object, ...], says: str) -> None:
    with pytest.raises(ProblemError, match=says):
        Parameter(*parameter)  # type: ignore[arg-type]


@pytest.mark.parametrize("options", [{"starts": 0}, {"confidence": 1.0}, {"noise": -1.0}, {"seed": -1}])
def test_bad_options(options: dict[str, float]) -> None:
    with pytest.raises(ProblemError):
        FitOptions(**options)  # type: ignore[arg-type]


def test_friction_that_depends_on_the_pressure_is_refused() -> None:
    def state(values: Mapping[str, float]) -> hv.ContactProblem:
        law = hv.Compliance(values["stiffness"])
        return hv.ContactProblem(
            mesh=hv.rectangle((1.0, 1.0), 2), material=hv.Material.lame(40.0, 40.0),
            supports={"top": hv.Fixed(x=0.0, y=values["pull"])}, contact={"bottom": hv.Contact(law, hv.Coulomb(0.3))},
        )  # fmt: skip

    with pytest.raises(ProblemError, match="Coulomb"):
        hv.identification.identify(state, BILINEAR.measured(), {"stiffness": (1.0, 100.0)})


@pytest.mark.slow
@pytest.mark.parametrize("name", CASES)
def test_intervals_hold_the_truth_as_often_as_they_say(name: str) -> None:
    """30 curves with 1 % of noise, of which 28 or 29 should hold each parameter: less than 24 are one in 1700.

    ``benchmarks/identification.py`` draws 400.
    """
    case = CASES[name]
    exact, truth = case.exact, np.array(list(case.truth.values()))
    held = np.zeros(truth.size)
    for seed in range(30):
        noise = 0.01 * np.abs(exact).max() * np.random.default_rng(seed).standard_normal(exact.size)
        found = _fit(case, Measurements({"pull": case.pulled}, {FORCE: exact + noise}), starts=1)
        low, high = found.intervals.T
        held += (low <= truth) & (truth <= high)
    assert (held >= 24).all()


def test_values_show_themselves() -> None:
    found = _fit(BILINEAR, BILINEAR.measured(0.01, 1), starts=1)
    assert repr(found).startswith("Fit(stiffness = 40")
    assert [row[0] for row in found.summary().rows] == ["stiffness", "strength", "softening", "misfit", "intervals"]
    assert len(found.plot().axes) == 3
