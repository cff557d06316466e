"""Derivatives of solutions by parameters of their law: against differences of whole solves."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

import hemivar as hv
from hemivar.basics.types import Array
from hemivar.identification.experiment import Experiment
from hemivar.identification.law_derivative import derivative_by_law
from hemivar.laws import ContactLaw, VectorLaw

from .experiments import CASES, Case


def _on(experiment: Experiment, contact: hv.Contact) -> VectorLaw:
    return contact.law.at(experiment.problems[0].contact.points)


def _derivatives(
    statement: Callable[[float], hv.ContactProblem], contact: Callable[[Array], hv.Contact], values: Array, load: float
) -> tuple[Array, Array]:
    """By the solution map, and by central differences of whole solves: local displacements (m, d, p)."""
    experiment = Experiment.of([hv.discretize(statement(load))], ["contact.bottom.force.y"], hv.Controls(rtol=1e-13))
    law = _on(experiment, contact(values))
    (found,) = experiment.solutions(law)
    assert found.status is hv.Status.CONVERGED
    changed, slow = [], []
    for place, value in enumerate(values):
        step = 1e-6 * value
        unit = step * np.eye(values.size)[place]
        changed.append((_on(experiment, contact(values + unit)), step))
        ends = [experiment.solutions(_on(experiment, contact(values + sign * unit)))[0].local for sign in (1.0, -1.0)]
        slow.append((ends[0] - ends[1]) / (2.0 * step))
    ours = derivative_by_law(experiment.system(0, law), found.local, found.multiplier, changed)
    return ours, np.stack(slow, axis=2)


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize(
    ("contact", "values"),
    [
        (lambda v: hv.Contact(hv.laws.ThresholdCompliance(v[0], v[1]), hv.Tresca(v[2])), [0.1, 8.0, 0.05]),
        (lambda v: hv.Contact(hv.Softening(v[0], v[1], v[2]), hv.Tresca(0.1)), [40.0, 0.004, 3.0]),
        (lambda v: hv.Contact(hv.Compliance(v[0]), hv.SlipWeakening(v[1], 1.0, 0.5, v[2])), [20.0, 0.06, 5.0]),
    ],
)
def test_derivatives_are_those_of_whole_solves(
    dim: int, contact: Callable[[Array], hv.Contact], values: list[float]
) -> None:
    mesh = hv.rectangle((1.0, 1.0), 4) if dim == 2 else hv.box((1.0, 1.0, 1.0), 3)
    push = (0.4, -0.8) if dim == 2 else (0.4, 0.1, -0.8)

    def statement(load: float) -> hv.ContactProblem:
        side = "left"
        return hv.ContactProblem(
            mesh=mesh, material=hv.Material.lame(40.0, 40.0), supports={side: hv.Clamped()},
            body_force=tuple(load * one for one in push), contact={"bottom": contact(np.array(values))},
        )  # fmt: skip

    ours, slow = _derivatives(statement, contact, np.array(values), 1.0)
    size = np.abs(slow).max(axis=(0, 1))
    assert (size > 0.0).all()
    np.testing.assert_allclose(ours / size, slow / size, atol=2e-5)


def test_a_point_that_is_held_at_a_kink_follows_it() -> None:
    """A rigid foundation whose place is a parameter: the penetration stays zero, and the knot takes the point along."""
    law = ContactLaw(hv.laws.PiecewiseQuadratic([0.0], [0.0, 50.0], [0.0])).at(None)
    problem = hv.DiscreteProblem.of_arrays([[2.0]], [1.0], [[1.0]], [1.0], [0.0], law)
    system = hv.systems.Workspace().condensed(problem, many=True)
    knot = lambda x: ContactLaw(hv.laws.PiecewiseQuadratic([x], [0.0, 0.0], [10.0], -5.0)).at(None)  # noqa: E731
    held = system.with_law(knot(0.1))
    found = hv.solve(held.problem)
    ours = derivative_by_law(held, found.local, found.multiplier, [(knot(0.1 + 1e-6), 1e-6)])
    assert found.local[0, 0] == pytest.approx(0.1)
    assert ours[0, 0, 0] == pytest.approx(1.0, abs=1e-8)


@pytest.mark.parametrize("name", CASES)
def test_what_is_measured_is_affine_in_the_local_displacements(name: str) -> None:
    """The curve of an experiment is that of solves of their own, with reactions of their own."""
    case: Case = CASES[name]
    rows = [hv.discretize(case.state({**case.truth, "pull": float(pull)})) for pull in case.pulled]
    experiment = Experiment.of(rows, ["support.top.force.y", "contact.bottom.force.y", "boundary.right.displacement.y"])
    predicted = experiment.predicted(experiment.solutions(rows[0].law))
    np.testing.assert_allclose(predicted[:, 0], case.exact, atol=1e-8)
    np.testing.assert_allclose(predicted[:, 1], -predicted[:, 0], atol=1e-8)
    last = None
    for row, problem in enumerate(rows):
        last = hv.solve(problem, initial=last)
        side = last.displacement[problem.origin.mesh.points[:, 0] == 1.0, 1]  # type: ignore[union-attr]
        assert predicted[row, 2] == pytest.approx(side.mean(), abs=1e-9)


def test_the_bound_of_what_is_measured_holds_its_error() -> None:
    case = CASES["bilinear"]
    rows = [hv.discretize(case.state({**case.truth, "pull": float(pull)})) for pull in case.pulled[:6]]
    fine = Experiment.of(rows, ["support.top.force.y"], hv.Controls(rtol=1e-13))
    rough = Experiment.of(rows, ["support.top.force.y"], hv.Controls(rtol=1e-3))
    exact = fine.predicted(fine.solutions(rows[0].law))
    found = rough.solutions(rows[0].law)
    bounds = rough.error_bounds(rows[0].law, found)
    assert np.isfinite(bounds).all()
    assert (np.abs(rough.predicted(found) - exact) <= bounds + 1e-13).all()


@pytest.mark.parametrize("pull", [0.4, 0.9])
def test_derivatives_of_a_law_that_couples_opening_and_slip(pull: float) -> None:
    """Its proximal map mixes both, whose steps differ."""

    def contact(values: Array) -> hv.Contact:
        return hv.Contact(hv.laws.MixedMode(hv.laws.BilinearCohesion(values[0], values[1], values[2]), 2.0))

    values = np.array([0.5, 0.2, 40.0])

    def statement(load: float) -> hv.ContactProblem:
        return hv.ContactProblem(
            mesh=hv.rectangle((1.0, 1.0), 3), material=hv.Material.lame(40.0, 5.0), supports={"left": hv.Clamped()},
            body_force=(0.6 * load, load), contact={"bottom": contact(values)},
        )  # fmt: skip

    ours, slow = _derivatives(statement, contact, values, pull)
    np.testing.assert_allclose(ours, slow, atol=1e-5 * np.abs(slow).max())


@pytest.mark.filterwarnings("error")
def test_a_contact_point_that_a_support_holds_along_the_boundary_does_not_hide_the_parameter() -> None:
    """A column beside a roller, on springs: ``u = -p (1/E + 1/k)``, so that du/dk = p/k^2 at every point."""
    k, pressure = 7.0, 0.3

    def statement(load: float) -> hv.ContactProblem:
        return hv.ContactProblem(
            hv.rectangle((1.0, 1.0), (3, 2)), hv.Material.young(10.0, 0.0), {"bottom": hv.Contact(hv.Compliance(k))},
            {"left": "roller"}, tractions={"top": (0.0, -load)},
        )  # fmt: skip

    ours, slow = _derivatives(statement, lambda v: hv.Contact(hv.Compliance(v[0])), np.array([k]), pressure)
    np.testing.assert_allclose(ours[:, 0, 0], -pressure / k**2, rtol=1e-5)
    np.testing.assert_allclose(ours, slow, atol=1e-5 * pressure / k**2)
