"""Jumps of one degree of freedom in few steps: where they happen, and what every way of jumping books."""

from __future__ import annotations

import numpy as np
import pytest

import hemivar as hv
from hemivar.basics.types import Array
from hemivar.errors import MethodError
from hemivar.evolution import Evolution, History, march
from hemivar.solvers import Solver
from tests import bodies
from tests.evolution.messages import said_of

#: kappa (r0 - r) in dj(r): j' = 2 r up to 0.1, falls with slope -2 to zero at 0.2; up at 0.3, down at 0.2.
KAPPA, STIFF, DELTA, FALL = 1.0, 2.0, 0.1, 2.0
LAW = hv.laws.PiecewiseQuadratic([0.0, DELTA, DELTA * (1 + STIFF / FALL)], [0.0, STIFF, -FALL, 0.0], np.zeros(3))


def cycle(jump: str, step: float, solver: Solver | None = None, until: float = 0.8) -> tuple[History, Array]:
    """The top of a block pushed down by r0 = t up to 0.4 and back; r0 at every row."""
    problem = bodies.column(LAW, KAPPA, top=hv.Fixed(y=lambda x, t: np.full(len(x), -min(t, 0.8 - t))))
    history = march(Evolution(problem), until, step=step, stops=(0.4,), jump=jump, method=solver)
    return history, np.minimum(history.times, 0.8 - history.times)


def test_a_viscous_jump_books_the_resistance_it_was_found_against() -> None:
    """``kappa (r0 - r) - rho kappa (r - r_n) = j'(r)``, rho above c - 1 = 1; ``rho kappa (r - r_n)^2`` is lost."""
    history, pushed = cycle("viscous", 0.034)
    r, force = history["penetration"], history["normal_force"]
    way = np.diff(r)
    resisted = KAPPA * (pushed - r)[1:] - force[1:]
    rho = resisted / (KAPPA * way)
    assert rho == pytest.approx(rho[0], rel=1e-6)
    assert 1.0 < rho[0] < 1.5
    jumped = history["jumped"][1:].astype(bool)
    assert jumped.any()
    assert (np.diff(history["numerical"])[jumped] <= 0.0).all()  # where the body jumps, all that is lost is lost so
    np.testing.assert_allclose(np.diff(history["jumps"])[~jumped], (rho * KAPPA * way**2)[~jumped], rtol=1e-6)
    assert (np.diff(history["jumps"])[jumped] > (rho * KAPPA * way**2)[jumped] - 1e-9).all()
    (message,) = (one for one in history.messages if "jumped" in one)
    assert f"t = {history.times[1:][jumped][0]:.8g}" in message
    assert np.abs(history["gap"]).max() < 1e-10
    np.testing.assert_allclose(force, LAW.derivative(r), atol=1e-8)


def pushed_block(contact: hv.Contact, material: hv.Material | None = None, hold: float = np.inf) -> hv.ContactProblem:
    """The block of :func:`cycle`, its top pushed down by ``min(t, hold)``."""
    return bodies.column(
        contact,
        top=hv.Fixed(y=lambda x, t: np.full(len(x), -min(t, hold))),
        material=hv.Material.lame(0.0, 0.5 * KAPPA) if material is None else material,
    )


@pytest.mark.parametrize(("jump", "up"), [("local", 0.3), ("viscous", 0.3)])
def test_friction_after_coulomb_does_not_change_where_the_body_jumps(jump: str, up: float) -> None:
    """Nothing slides; bounds that depend on the pressure leave the choice what it is."""
    contact = hv.Contact(LAW, hv.Coulomb(0.3))
    step = 0.048
    history = march(Evolution(pushed_block(contact)), 0.384, step=step, jump=jump)
    assert history.finished
    free = march(Evolution(pushed_block(hv.Contact(LAW))), 0.384, step=step, jump=jump)
    np.testing.assert_allclose(history["normal_force"], free["normal_force"], atol=1e-8)
    np.testing.assert_allclose(history["jumps"], free["jumps"], atol=1e-8)
    np.testing.assert_array_equal(history["jumped"], free["jumped"])
    assert up < history.times[history["jumped"].astype(bool)][0] <= up + 1.01 * step


@pytest.mark.parametrize("jump", ["global", "arc-length"])
def test_choices_by_energy_refuse_friction_that_has_none(jump: str) -> None:
    material = hv.Material.lame(0.0, 0.5 * KAPPA, density=1.0)
    contact = hv.Contact(LAW, hv.Coulomb(0.3))
    with pytest.raises(MethodError, match=r"\(Coulomb\); take jump = 'local'"):
        march(Evolution(pushed_block(contact, material)), 0.4, jump=jump)
    still = hv.Contact(hv.Compliance(STIFF), hv.Coulomb(0.3))
    assert march(Evolution(pushed_block(still, material)), 0.1, step=0.05, jump=jump).finished


@pytest.mark.parametrize("scheme", [hv.evolution.Midpoint(), hv.evolution.SDIRK2()])
def test_viscous_jumps_are_booked_by_schemes_whose_stages_lie_within_the_step(scheme: hv.Scheme) -> None:
    history = march(Evolution(pushed_block(hv.Contact(LAW))), 0.4, step=0.02, scheme=scheme, jump="viscous")
    assert history["jumped"].any()
    assert history.ledger["jumps"] > 0.0
    assert np.abs(history["gap"]).max() < 1e-12
    assert any("oscillate after a jump" in message for message in history.messages) == isinstance(
        scheme, hv.evolution.Midpoint
    )


def test_what_a_branch_holds_together_does_not_jump() -> None:
    """A spring of 1/2 beside a branch of 1 on a law that falls by 1.2 up to 0.3, and by 3 only beyond it.

    The margin is lost for what lies beyond; the body follows the fall: ``1.5 r + 0.4 - 1.2 (r - 0.1) = 0.58`` at last.
    """
    law = hv.table_law([0.0, 0.1, 0.3, 0.3 + 0.16 / 3.0], [0.0, 0.4, 0.16, 0.0])
    material = hv.Material.lame(0.0, 0.25, branches=[hv.materials.Branch(lame=(0.0, 0.5), time=1e6)])
    problem = bodies.column(
        law,
        top=hv.Clamped(),
        material=material,
        tractions={"bottom": lambda x, t: np.tile([0.0, -0.58 * t], (len(x), 1))},
    )
    history = march(Evolution(problem), 1.0, step=0.05)
    assert history.finished
    assert history["penetration"][-1] == pytest.approx(0.2, rel=1e-5)
    assert history.margin == pytest.approx(1.0 - 3.0 / 1.5, rel=1e-5)
    assert not history["jumped"].any()
    assert not said_of(history)
