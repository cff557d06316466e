"""The softest mode by itself: a bound that stays one, and no longer grows like 1 / (1 - c)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from hemivar.bounds.body_data import body_data
from hemivar.bounds.contact_traces import contact_traces
from hemivar.bounds.exact_distance import exact_distance
from hemivar.bounds.low_mode import SoftModes, confined_error
from hemivar.bounds.trace_bounds import guaranteed_trace_bounds
from hemivar.bounds.vertex_moments import shared_on_contact
from hemivar.laws import Logarithmic, Softening, ThresholdCompliance
from hemivar.mechanics import Contact, ContactProblem
from hemivar.solvers import solve
from tests import bodies
from tests.bounds.test_exact_distance import error_of


def softened(alpha: float, normal: bool = False) -> ContactProblem:
    law = Contact(Softening(4.0, 0.1, alpha)) if normal else Contact(ThresholdCompliance(0.3, 2.0), Logarithmic(alpha))
    return bodies.square(law, 6, "cross", body_force=(-0.8, -0.8))


def test_closed_forms() -> None:
    """psi the mode itself and out of sight: a parabola in y, with its top inside or at the end."""
    assert confined_error(2.0, 0.0, 0.8, 0.8, 0.3, 0.0) == pytest.approx(2.0 / (2.0 * np.sqrt(0.5 * 0.2)), rel=1e-4)
    assert confined_error(2.0, 0.0, 0.3, 0.3, 0.1, 0.0) == pytest.approx(2.0 / 0.9, rel=1e-4)
    assert confined_error(1.0, 0.0, 0.6, 0.6, 0.2, 0.1) == pytest.approx(0.5 / np.sqrt(0.4 * 0.3), rel=1e-4)
    assert confined_error(1.0, 1.0, 0.9, 0.9, 0.9, 0.0) >= 10.0
    for left in (1e-3, 1e-8, 1e-13):
        first = 1.0 - left
        near = 0.5 / np.sqrt((first - 0.3) * (1.0 - first))
        assert near * (1.0 - 1e-9) <= confined_error(1.0, 0.0, first, first, 0.3, 0.0) <= near * (1.0 + 1e-3)
    assert confined_error(1.0, 0.0, 0.9, 0.9, 0.2, 0.1) == np.inf


@pytest.mark.parametrize("gap", [0.0, 0.4])
@pytest.mark.parametrize("seed", range(12))
def test_the_bound_is_the_largest_of_all_angles_and_quotients(seed: int, gap: float) -> None:
    """Of ``t`` and ``y`` on the circle, and every tau that Ky Fan's inequality leaves."""
    rng = np.random.default_rng(seed)
    first, coupling = rng.uniform(0.3, 0.8), 0.1
    second, theta = first * rng.uniform(0.1, 0.9), first * rng.uniform(0.4, 1.0)
    total, seen = 1.0, rng.uniform() * rng.choice([0.0, 0.1, 1.0])
    angle, tau = np.linspace(0.0, 0.5 * np.pi, 2001), np.linspace(0.0, min(first, first + second - theta), 801)[:, None]
    t, y = np.cos(angle), np.sin(angle)
    softened = theta * t**2 + 2.0 * np.sqrt((first - theta) * (first - tau)) * t * y + tau * y**2
    left, force = 1.0 - coupling - softened.max(axis=0), seen * t + total * y
    largest = (0.5 * (force + np.sqrt(force**2 + 4.0 * left * gap)) / left).max()
    assert largest * (1.0 - 1e-9) <= confined_error(total, seen, theta, first, second, coupling, gap) < 1.001 * largest


@pytest.mark.parametrize("near", [1.0, 1e-4, 1e-8])
@pytest.mark.parametrize("gap", [0.0, 0.4])
@pytest.mark.parametrize("seed", range(8))
def test_nothing_that_fulfils_the_inequality_is_outside(seed: int, gap: float, near: float) -> None:
    """e'(I - T) e <= R'e + G in four dimensions, psi near to the first mode of T or not."""
    rng = np.random.default_rng(seed)
    turn = np.linalg.qr(rng.normal(size=(4, 4)))[0]
    values = np.sort(rng.uniform(0.0, 0.95, 4))[::-1]
    values[0] = 1.0 - near * (1.0 - values[0])
    T = turn @ np.diag(values) @ turn.T
    psi = turn[:, 0] + 0.3 * np.sqrt(near) * rng.uniform() * rng.normal(size=4)
    psi /= np.linalg.norm(psi)
    force = rng.normal(size=4)
    force -= rng.uniform(0.0, 1.0) * (force @ psi) * psi
    root = np.linalg.cholesky(np.linalg.inv(np.eye(4) - T))
    centre = 0.5 * root.T @ force
    around = rng.normal(size=(20_000, 4))
    around *= np.sqrt(centre @ centre + gap) / np.linalg.norm(around, axis=1, keepdims=True)
    largest = float(np.linalg.norm((centre + around) @ root.T, axis=1).max())
    bound = confined_error(
        float(np.linalg.norm(force)), abs(float(force @ psi)), float(psi @ T @ psi), values[0], values[1], 0.0, gap
    )
    assert largest <= bound


@pytest.mark.parametrize(("alpha", "normal"), [(4.16, False), (3.3, True)])
def test_near_the_margin_the_bound_stays_near_the_error(alpha: float, normal: bool) -> None:
    """c = 0.8 (0.72): by 1 / (1 - c) alone it would be twice as large, more than four times the error."""
    problem = softened(alpha, normal)
    solution = solve(problem)
    constants = guaranteed_trace_bounds(solution.problem)
    found = exact_distance(problem, solution.displacement, constants)
    assert found.guaranteed, found.reasons
    assert 0.65 < found.constant < 0.85
    parts = found.parts
    whole = parts.misfit + parts.oscillation + parts.algebraic + parts.contact
    assert found.distance < 0.6 * whole / (1.0 - found.constant)
    error = error_of(problem, solution.displacement)
    assert error < found.distance < 3.3 * error


def test_the_mode_of_the_discrete_problem_sees_next_to_nothing() -> None:
    problem = softened(3.0)
    solution = solve(problem)
    data = body_data(problem, solution.displacement)
    traces = contact_traces(data)
    assert traces is not None
    count = len(traces.facets)
    zeta = traces.allowed(traces.interpolated(shared_on_contact(data)))
    modes = SoftModes(traces)
    mode = modes.softest(np.zeros(count), np.full(count, 3.0))
    theta, seen = mode.theta, modes.seen(mode, zeta)
    constants = guaranteed_trace_bounds(solution.problem)
    assert theta == pytest.approx(3.0 / constants.tangential, rel=0.08)
    assert theta < 3.0 / constants.tangential
    whole = exact_distance(problem, solution.displacement, constants).parts
    assert seen < 0.3 * (whole.misfit + whole.contact)
    # what is unknown of loads may work against the mode
    hidden = replace(data, varying=replace(data.varying, unknown=np.ones(len(data.displacement))))
    assert SoftModes(replace(traces, data=hidden)).seen(mode, zeta) > seen + 1.0
