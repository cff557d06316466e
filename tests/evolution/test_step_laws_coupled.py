"""Laws that couple opening and slip in time: laws of the place, whose marches end where statics does."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

import hemivar as hv
from hemivar.basics.types import Array
from hemivar.laws import VectorLaw
from hemivar.laws.coupled import BilinearCohesion, CoupledFormulaLaw, CoupledFunctionLaw, MixedMode
from tests.samples import sampled

#: What a ramped march moves the top by, along the surface and off it, of a body of height 1/2.
MOVED = (0.02, 0.02)
TIGHT = hv.Controls(rtol=1e-11)


def _tied(r: Array, s: Array) -> Array:
    return np.asarray(5.0 * r**2 + 3.0 * s**2 + 40.0 * r**2 * s**2)


def _tied_slopes(r: Array, s: Array) -> tuple[Array, Array]:
    return 10.0 * r + 80.0 * r * s**2, 6.0 * s + 80.0 * r**2 * s


LAWS: dict[str, VectorLaw] = {
    "mixed-mode": MixedMode(BilinearCohesion(strength=0.05, energy=0.004, stiffness=5.0), ratio=1.5),
    "formula": CoupledFormulaLaw("5*r^2 + 3*s^2 + 40*r^2*s^2", reach=1.0),
    "function": CoupledFunctionLaw(_tied, _tied_slopes, reach=1.0),
}


def body_on_law(law: VectorLaw, moving: bool, dim: int = 2, size: float = 1.0, **more: object) -> hv.ContactProblem:
    """A block on a law of its bottom, its top moved; all lengths are ``size`` times what they are."""

    def move(x: Array, t: float) -> Array:
        way = np.zeros((len(x), dim))
        way[:, 0], way[:, -1] = size * MOVED[0] * min(t, 1.0), size * MOVED[1] * min(t, 1.0)
        return way

    mesh = hv.rectangle((size, 0.5 * size), 6) if dim == 2 else hv.box((size, 0.5 * size, 0.5 * size), 3)
    top: Callable[[Array, float], Array] | Array = move if moving else move(np.zeros((1, dim)), 1.0)[0]
    contact = {"bottom": hv.Contact(law, memory=())}
    return hv.ContactProblem(
        mesh,
        hv.Material.young(10.0, 0.3, **more),
        contact,
        {"top": hv.Prescribed(top)},  # type: ignore[arg-type]
    )


def off_the_balance(history: hv.evolution.History) -> float:
    """What is left of the balance of energy at its worst, as a part of what is done."""
    done = max(abs(row.values["work"] + row.values["moved"]) for row in history.steps)
    return max(abs(row.values["gap"]) for row in history.steps) / done


@pytest.mark.parametrize(
    ("name", "dim"),
    sampled([(name, dim) for name in LAWS for dim in (2, 3)], [("mixed-mode", 2), ("mixed-mode", 3), ("formula", 2)]),
)
def test_a_march_ends_where_statics_does(name: str, dim: int) -> None:
    """A slip counted from the last step closes the balance too, and ends elsewhere."""
    history = hv.march(hv.Evolution(body_on_law(LAWS[name], True, dim)), 1.0, step=0.125, controls=TIGHT)
    assert history.finished
    static = hv.solve(body_on_law(LAWS[name], False, dim), controls=TIGHT).raise_for_status()
    size = np.abs(static.displacement).max()
    np.testing.assert_allclose(history.frames[-1].displacement, static.displacement, atol=1e-8 * size)
    np.testing.assert_allclose(
        history.frames[-1].multiplier, static.multiplier, atol=1e-7 * np.abs(static.multiplier).max()
    )
    assert off_the_balance(history) < 1e-10
    ledger = history.state.ledger
    assert ledger.friction == ledger.memory == 0.0
    assert ledger.elastic + ledger.contact == pytest.approx(static.energy, rel=1e-8)


def test_units_do_not_matter() -> None:
    """Millimetres for metres: glue as stiff per length."""
    small = hv.march(hv.Evolution(body_on_law(LAWS["mixed-mode"], True)), 1.0, step=0.25)
    glue = MixedMode(BilinearCohesion(strength=0.05, energy=4.0, stiffness=5e-3), ratio=1.5)
    large = hv.march(hv.Evolution(body_on_law(glue, True, size=1e3)), 1.0, step=0.25)
    np.testing.assert_allclose(large.frames[-1].displacement, 1e3 * small.frames[-1].displacement, rtol=1e-7, atol=1e-9)


def test_glue_beside_friction_counts_its_slip_from_the_start_and_friction_from_the_step() -> None:
    """Two boundaries: the energy that glue stores stays; what friction takes is lost."""
    law = MixedMode(BilinearCohesion(strength=0.5, energy=0.04, stiffness=5.0), ratio=1.0)
    mesh = hv.rectangle((1.0, 0.5), 4)

    def move(x: Array, t: float) -> Array:
        return np.tile([0.04 * min(t, 1.0), -0.004 * min(4.0 * t, 1.0)], (len(x), 1))

    problem = hv.ContactProblem(
        mesh,
        hv.Material.young(10.0, 0.3),
        {"bottom": hv.Contact(hv.Compliance(20.0), hv.Tresca(0.05)), "left": hv.Contact(law)},
        {"top": hv.Prescribed(move)},
    )
    coarse, fine = (hv.march(hv.Evolution(problem), 1.0, step=step) for step in (0.125, 0.0625))
    assert coarse.finished
    assert off_the_balance(coarse) < 1e-10
    ledger = coarse.state.ledger
    assert ledger.friction > 0.0
    frame, rows = coarse.frames[-1], coarse.discrete.problem.contact.on("left")
    weights = coarse.discrete.problem.contact.weights[rows]
    assert weights @ law.at(None).value(frame.local[rows]) == pytest.approx(
        ledger.contact - float(
            np.delete(coarse.discrete.problem.contact.weights, rows)
            @ hv.Compliance(20.0).at(None).value(np.delete(frame.local[:, 0], rows))
        ),
        rel=1e-10,
    )  # fmt: skip
    np.testing.assert_allclose(frame.displacement, fine.frames[-1].displacement, atol=2e-3 * 0.04)


@pytest.mark.parametrize("scheme", ["implicit-euler", "newmark", "generalized-alpha", "midpoint"])
def test_bodies_with_mass_keep_the_balance(scheme: str) -> None:
    glue = MixedMode(BilinearCohesion(strength=0.05, energy=0.004, stiffness=5.0), 1.5, hv.Compliance(40.0))
    evolution = hv.Evolution(body_on_law(glue, True, density=0.2), inertia=True)
    history = hv.march(evolution, 0.5, step=0.03125, scheme=scheme)
    assert history.finished
    assert off_the_balance(history) < 1e-10


def test_a_body_that_starts_slipped_begins_in_equilibrium() -> None:
    """The forces at the start are those of its place; nothing is out of balance, and nothing moves."""
    glue = MixedMode(BilinearCohesion(strength=0.05, energy=0.004, stiffness=5.0), 1.5)
    static = hv.solve(body_on_law(glue, False), controls=hv.Controls(rtol=1e-12)).raise_for_status()
    evolution = hv.Evolution(body_on_law(glue, False, density=1.0), inertia=True, displacement=static.displacement)
    history = hv.march(evolution, 0.5, step=0.1, scheme="newmark")
    np.testing.assert_allclose(history.frames[0].multiplier, static.multiplier, atol=1e-10)
    assert (
        np.abs(history.frames[-1].displacement - static.displacement).max() < 1e-9 * np.abs(static.displacement).max()
    )


def test_what_is_not_known_beside_coupled_laws_is_refused() -> None:
    contact = hv.Contact(LAWS["mixed-mode"], damping=hv.Compliance(1.0))
    problem = body_on_law(LAWS["mixed-mode"], True)
    damped = hv.ContactProblem(problem.mesh, problem.material, {"bottom": contact}, problem.supports)
    with pytest.raises(hv.HemivarError, match="damping of the normal rate is not known beside it"):
        hv.march(hv.Evolution(damped), 1.0, step=0.5)
    worn = hv.ContactProblem(
        problem.mesh,
        problem.material,
        {"bottom": hv.Contact(LAWS["mixed-mode"], memory=(hv.laws.Wear(0.1),))},
        problem.supports,
    )
    with pytest.raises(hv.HemivarError, match="the memory 'wear' needs a normal law with friction"):
        hv.march(hv.Evolution(worn), 1.0, step=0.5)
