"""Friction that follows the slip, as in statics, and friction that follows its rate."""

from __future__ import annotations

import numpy as np
import pytest

import hemivar as hv
from hemivar.errors import ProblemError
from hemivar.evolution import BDF2, Evolution, ImplicitEuler, Midpoint, MoreauJean, Scheme, march

STIFF, STRENGTH = 1000.0, 10.0


def glue_in_shear(of: str | None) -> hv.Contact:
    """A table of the slip that rises to its strength and falls: glue in shear."""
    return hv.Contact(hv.laws.Bilateral(), hv.laws.SlipTable(STRENGTH, [0.0, 0.01, 0.035], [0.0, 1.0, 0.0], of=of))


def glued_bar(contact: dict[str, hv.Contact], time: bool = True, dim: int = 2) -> hv.ContactProblem:
    """A stiff bar that is pulled along by half of what the glue bears, within one second."""
    mesh = hv.rectangle((4.0, 1.0), (4, 1)) if dim == 2 else hv.box((4.0, 1.0, 1.0), (2, 1, 1))
    along = np.eye(dim)[0]

    def load(x: np.ndarray, t: float) -> np.ndarray:
        return 20.0 * min(t, 1.0) * along[None] + 0.0 * x

    traction = load if time else tuple(20.0 * along)
    return hv.ContactProblem(mesh, hv.Material.young(7e4, 0.3), contact, tractions={"left": traction})


@pytest.mark.parametrize("scheme", [ImplicitEuler(), BDF2(), Midpoint()], ids=lambda scheme: scheme.name)
@pytest.mark.parametrize("dim", [2, 3])
def test_friction_of_the_slip_is_the_static_law_at_each_time(scheme: Scheme, dim: int) -> None:
    name = "bottom"
    history = march(
        Evolution(glued_bar({name: glue_in_shear("slip")}, dim=dim)), 3.0, step=0.25, scheme=scheme, stops=[1.0]
    )
    static = hv.solve(glued_bar({name: glue_in_shear(None)}, time=False, dim=dim)).raise_for_status()
    assert history.finished
    np.testing.assert_allclose(history.state.local.displacement, static.local, atol=1e-9)
    held = STIFF * static.contact.weights @ static.local[:, 1:]
    assert np.linalg.norm(held) == pytest.approx(20.0, rel=1e-6)
    assert history["friction"][-1] == 0.0  # it dissipates nothing by itself
    stored = STIFF * (static.contact.weights @ (static.local[:, 1:] ** 2).sum(axis=1)) / 2.0
    assert history["contact"][-1] == pytest.approx(stored, rel=1e-8)
    assert abs(history["gap"]).max() < 1e-12 * history["work"][-1] + 1e-14
    if isinstance(scheme, Midpoint):
        assert abs(history["numerical"][-1]) < 1e-12


def test_friction_of_the_rate_creeps() -> None:
    """``10 v/0.01 = 5`` per area: the bar slides at v = 0.005."""
    history = march(Evolution(glued_bar({"bottom": glue_in_shear("rate")})), 3.0, step=0.25, stops=[1.0])
    moved = history.state.local.displacement[:, 1]
    np.testing.assert_allclose(moved, 0.005 * 0.5 + 0.005 * 2.0, rtol=0.1)
    assert history["friction"][-1] > 0.9 * history["work"][-1]


def test_other_boundaries_keep_friction_of_the_rate() -> None:
    """Glue below and Tresca's law above, which is the same stick or slip with and without saying so."""
    found = []
    for of in (None, "rate"):
        above = hv.Contact(hv.laws.Bilateral(), hv.Tresca(1.0, of=of))
        found.append(
            march(Evolution(glued_bar({"bottom": glue_in_shear("slip"), "top": above})), 2.0, step=0.25, stops=[1.0])
        )
    for history in found:
        contact, slip = history.discrete.problem.contact, np.abs(history.state.local.displacement[:, 1])
        bottom, top = contact.on("bottom"), contact.on("top")
        assert STIFF * contact.weights[bottom] @ slip[bottom] == pytest.approx(20.0 - 4.0, rel=1e-6)
        assert history["friction"][-1] == pytest.approx(contact.weights[top] @ slip[top], rel=1e-6)
    np.testing.assert_array_equal(*(one.state.local.displacement for one in found))


def test_friction_with_a_length_has_no_default_in_time() -> None:
    for friction in (
        hv.SlipWeakening(1.0),
        hv.laws.Logarithmic(1.0),
        hv.laws.StaticKinetic(1.0, 0.1),
        hv.laws.SlipTable(1.0, [0.0, 1.0], [1.0, 0.5]),
        hv.laws.Friction(1.0, hv.FormulaLaw("sqrt(1 + r^2)", even=True)),
    ):
        with pytest.raises(ProblemError, match="may be a law of the slip or of its rate; say of = 'slip'"):
            march(Evolution(glued_bar({"bottom": hv.Contact(hv.laws.Bilateral(), friction)})), 1.0)
    with pytest.raises(ProblemError, match="give 'slip' or 'rate'"):
        hv.Tresca(1.0, of="speed")


def test_what_needs_friction_of_the_rate_says_so() -> None:
    sums = hv.Contact(hv.laws.Bilateral(), hv.SlipWeakening(1.0, of="slip"), memory=(hv.laws.SlipSum(),))
    with pytest.raises(ProblemError, match="the memory needs one of its rate"):
        march(Evolution(glued_bar({"bottom": sums})), 1.0)
    heavy = hv.ContactProblem(
        hv.rectangle(), hv.Material.young(1.0, 0.3, density=1.0),
        {"bottom": hv.Contact(hv.Signorini(), hv.Tresca(1.0, of="slip"))}, {"top": "clamped"},
    )  # fmt: skip
    with pytest.raises(ProblemError, match="take another scheme"):
        march(Evolution(heavy, inertia=True), 0.1, scheme=MoreauJean())
    with pytest.raises(ProblemError, match="friction of the slip, which do not"):
        march(Evolution(heavy, inertia=True), 0.1, scheme=Midpoint(conserving=True))


@pytest.mark.parametrize("scheme", ["implicit-euler", "midpoint"])
def test_a_load_that_acts_from_the_start_finds_friction_of_the_slip(scheme: str) -> None:
    """The initial equilibrium is the static solution, and stays where it is."""
    problem = hv.ContactProblem(
        mesh=hv.rectangle((2.0, 1.0), (4, 2)),
        material=hv.Material.lame(400.0, 400.0),
        contact={"bottom": hv.Contact(hv.Compliance(1e3), hv.laws.SlipTable(1.0, [0, 1, 2], [0, 10, 9], of="slip"))},
        supports={},
        tractions={"top": (0.3, -1.0)},
    )
    static = hv.solve(problem).raise_for_status()
    assert 10.0 * static.contact.weights @ static.local[:, 1] == pytest.approx(0.6, rel=1e-6)
    history = march(Evolution(problem), 1.0, step=0.25, scheme=scheme)
    assert history.finished
    for frame in history.frames:
        np.testing.assert_allclose(frame.local, static.local, rtol=1e-6, atol=1e-9)
