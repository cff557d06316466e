"""The discrete problem as an object of its own, built from a user's arrays."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp

import hemivar as hv
from hemivar.discrete import DiscreteProblem, Quadratic
from hemivar.errors import ProblemError
from hemivar.fem import discretize
from hemivar.laws import (
    Bilateral,
    Compliance,
    ContactLaw,
    CoulombBound,
    FinitePenetration,
    Friction,
    NoFriction,
    Signorini,
    ThresholdCompliance,
    Tresca,
)
from hemivar.mechanics import Contact, Material
from hemivar.mesh import rectangle
from tests import bodies

LAW = ContactLaw(ThresholdCompliance(0.3, 2.0), Tresca(0.5))


def arrays(**changes: Any) -> dict:
    """Two contact points in the plane, six unknowns."""
    K = 4.0 * np.eye(6) - np.eye(6, k=1) - np.eye(6, k=-1)
    data = {
        "stiffness": K,
        "load": np.arange(6.0),
        "trace": np.eye(6)[:4],
        "weights": [0.5, 0.25],
        "gap": [0.1, 0.0],
        "law": LAW,
    }
    return data | changes


def test_accepts_dense_and_sparse() -> None:
    for convert in (np.asarray, sp.csc_matrix, sp.coo_array, sp.bsr_array):
        problem = DiscreteProblem.of_arrays(**arrays(stiffness=convert(arrays()["stiffness"])))
        assert isinstance(problem.stiffness, sp.csr_array)
        assert (problem.unknowns, problem.contact_points, problem.contact.components) == (6, 2, 2)


def test_energy_local_and_force() -> None:
    problem = DiscreteProblem.of_arrays(**arrays(slip_offset=[[0.2], [0.0]], constant=3.0))
    np.testing.assert_array_equal(problem.offset.ravel(), [0.1, 0.2, 0.0, 0.0])
    u = np.array([0.3, 0.1, -0.2, 0.4, 0.5, 0.6])
    r = problem.local(u)
    np.testing.assert_allclose(r, [[0.2, -0.1], [-0.2, 0.4]])
    K, f = problem.stiffness.toarray(), problem.load
    contact = 0.5 * (0.3 * 0.2 + 0.2**2 + 0.5 * 0.1) + 0.25 * (0.5 * 0.4)
    assert np.isclose(problem.energy(u), 0.5 * u @ K @ u - f @ u + contact + 3.0)
    force = problem.contact_force(np.array([[1.0, 2.0], [3.0, 4.0]]))
    np.testing.assert_allclose(force, [0.5, 1.0, 0.75, 1.0, 0.0, 0.0])


def test_scalar_contact() -> None:
    """A bar: one normal component, no slip."""
    problem = DiscreteProblem.of_arrays(
        [[2.0]], [1.0], [[1.0]], [1.0], [0.0], ContactLaw(ThresholdCompliance(0.3, 2.0))
    )
    assert problem.contact.components == 1
    assert np.isclose(problem.energy(np.array([0.1])), 0.01 - 0.1 + 0.03 + 0.01)


def test_no_contact() -> None:
    problem = DiscreteProblem.of_arrays(np.eye(3), np.ones(3), np.zeros((0, 3)), [], [], LAW)
    assert problem.contact_points == 0
    assert problem.energy(np.ones(3)) == -1.5
    assert problem.local(np.ones(3)).shape == (0, 2)


@pytest.mark.parametrize("order", [1, 2])
def test_assembled_problems_pass_the_checks_they_are_spared(order: int) -> None:
    mesh = rectangle((2, 1), (4, 2)).rotated(0.3)
    problem = discretize(
        bodies.body(
            mesh,
            Contact(ThresholdCompliance(0.3, 2.0), Tresca(0.5)),
            material=Material.young(3.0, 0.3),
            body_force=(0.1, -0.4),
            order=order,
        )
    )
    given = problem.bulk
    assert isinstance(given, Quadratic)
    assert abs(Quadratic(given.stiffness).stiffness - given.stiffness).nnz == 0


def test_with_law_shares_matrices() -> None:
    problem = DiscreteProblem.of_arrays(**arrays())
    other = problem.with_(law=ContactLaw(ThresholdCompliance(1.0)))
    assert other.stiffness is problem.stiffness
    assert other.law is not problem.law
    assert other.energy(np.ones(6)) != problem.energy(np.ones(6))
    with pytest.raises(ProblemError, match="law"):
        problem.with_(law=ContactLaw(ThresholdCompliance(np.ones(5))))


UNSYMMETRIC = arrays()["stiffness"] + np.eye(6, k=2) * 1e-6


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"stiffness": np.eye(5)}, "trace has 6 columns; it needs one per unknown, 5"),
        ({"stiffness": UNSYMMETRIC}, "not symmetric"),
        ({"stiffness": arrays()["stiffness"] * np.nan}, r"stiffness\[0, 0\] = nan"),
        ({"stiffness": arrays()["stiffness"] - 4 * np.eye(6)}, "positive diagonal"),
        ({"stiffness": "stiff"}, "stiffness is not an array of numbers: it is text"),
        ({"load": np.ones((6, 1))}, r"load has shape \(6, 1\); it must have 1 axis"),
        ({"load": [1, 2, 3, np.inf, 5, 6]}, r"load\[3\] = inf"),
        ({"load": "heavy"}, "load is not an array of numbers: it is text"),
        ({"trace": np.eye(5)[:4]}, "trace has 5 columns"),
        ({"trace": np.eye(6)[:3]}, "trace has 3 rows for 2 contact points"),
        ({"trace": np.ones((8, 6))}, "trace has 8 rows"),
        ({"trace": np.full((4, 6), np.nan)}, r"trace\[0, 0\] = nan"),
        ({"weights": [1.0, 0.0]}, r"weights\[1\] = 0; every weight must be positive"),
        ({"weights": []}, "weights is empty"),
        ({"gap": [0.0]}, "gap has shape"),
        ({"gap": [0.0, np.nan]}, r"gap\[1\] = nan"),
        ({"constant": np.inf}, "constant"),
        ({"slip_offset": [0.0, 0.0]}, r"slip_offset has shape \(2,\); it must have 2 axes"),
        ({"slip_offset": [[0.0, 0.0]]}, "slip_offset has shape"),
        ({"points": [[0.0, 0.0]]}, "points has shape"),
        ({"frames": np.zeros((2, 3, 3))}, "frames has shape"),
        ({"law": ContactLaw(ThresholdCompliance(lambda x: x[:, 0]))}, r"law.at\(points\)"),
        ({"law": ContactLaw(ThresholdCompliance(np.ones(3)))}, "law"),
    ],
)
def test_refuses(changes: dict, words: str) -> None:
    with pytest.raises(ProblemError, match=words):
        DiscreteProblem.of_arrays(**arrays(**changes))


def test_field_must_match() -> None:
    problem = bodies.square(Signorini(), 2)
    discrete = discretize(problem)
    with pytest.raises(ProblemError, match="space has"):
        DiscreteProblem.of_arrays(**arrays(field=discrete.field))
    assert discrete.field is not None
    with pytest.raises(ProblemError, match="unknowns have shape"):
        discrete.field.full(np.zeros(3))
    with pytest.raises(ProblemError, match="displacement has shape"):
        discrete.field.restrict(np.zeros((3, 2)))


def test_energy_forgives_the_rounding_of_displacements_that_cancel() -> None:
    """A mean of two displacements that misses the end of a rigid law by the rounding of these, and by more."""
    law = ContactLaw(Signorini(), NoFriction())
    problem = DiscreteProblem.of_arrays(np.eye(2), np.zeros(2), [[0.5, 0.5]], [1.0], [0.0], law)  # type: ignore[arg-type]
    assert problem.energy(np.array([1.0, -1.0 + 1e-14])) == pytest.approx(1.0)
    assert problem.energy(np.array([1.0, -1.0 + 1e-9])) == np.inf


def test_three_components_and_no_points() -> None:
    slips = [[1.0, 2.0], [3.0, 4.0]]
    problem = DiscreteProblem.of_arrays(**arrays(trace=np.eye(6), slip_offset=slips, points=[[0, 0, 1], [1, 0, 2]]))
    np.testing.assert_array_equal(problem.offset, [[0.1, 1.0, 2.0], [0.0, 3.0, 4.0]])
    np.testing.assert_array_equal(problem.contact.points, [[0, 0, 1], [1, 0, 2]])
    empty = {"trace": np.zeros((0, 6)), "weights": [], "gap": []}
    for points, components in ((None, 2), (np.zeros((0, 3)), 3), (np.zeros((0, 2)), 2)):
        alone = DiscreteProblem.of_arrays(**arrays(**empty, points=points, slip_offset=np.zeros((0, 7))))
        assert alone.offset.shape == (0, components)
    scalar = discretize(bodies.square(cells=2, body_force=(0, -1)))
    field = scalar.field
    assert field is not None
    own = DiscreteProblem.of_arrays(
        scalar.stiffness, scalar.load, np.zeros((0, scalar.unknowns)), [], [], LAW, field=field
    )
    assert own.field is field
    assert own.contact.components == 2


def test_a_problem_of_arrays_owns_them() -> None:
    """What happens to the arrays afterwards does not reach it, and its own cannot be written to."""
    names = ("load", "weights", "gap", "slip_offset", "points", "frames", "trace", "stiffness")
    frames = np.stack([np.eye(2), np.eye(2)])
    given = arrays(points=[[0.0, 1.0], [2.0, 3.0]], frames=frames, slip_offset=[[0.2], [0.3]])
    given |= {name: np.array(given[name], dtype=float) for name in names}
    problem = DiscreteProblem.of_arrays(**given)
    energy = problem.energy(np.ones(6))
    for name in names:
        given[name][...] = 77.0
    contact = problem.contact
    assert problem.energy(np.ones(6)) == energy
    np.testing.assert_array_equal(contact.points, [[0.0, 1.0], [2.0, 3.0]])
    np.testing.assert_array_equal(contact.frames, frames)
    for array in (problem.load, contact.weights, problem.offset, contact.points, contact.frames):
        assert array is not None
        assert not array.flags.writeable


def test_with_changes_what_is_given_and_nothing_else() -> None:
    problem = DiscreteProblem.of_arrays(**arrays(constant=3.0))
    moved = problem.with_(offset=[[0.5, 0.1], [0.6, 0.2]])  # type: ignore[arg-type]
    np.testing.assert_array_equal(moved.gap, [0.5, 0.6])
    assert (moved.bulk, moved.law) == (problem.bulk, problem.law)
    assert moved.contact.trace is problem.contact.trace
    loaded = problem.with_(load=2.0 * np.arange(6.0))
    np.testing.assert_array_equal(loaded.load, 2.0 * np.arange(6.0))
    assert loaded.constant == 3.0
    assert loaded.contact is problem.contact
    bulk = Quadratic(np.eye(6))
    stiffer = problem.with_(bulk=bulk, load=np.ones(6))
    assert stiffer.bulk is bulk
    assert (stiffer.contact, stiffer.law, stiffer.constant) == (problem.contact, problem.law, 3.0)
    np.testing.assert_array_equal(stiffer.load, np.ones(6))
    with pytest.raises(ProblemError, match="offset has shape"):
        problem.with_(offset=np.zeros((2, 3)))
    with pytest.raises(ProblemError, match="trace has 6 columns; it needs one per unknown, 5"):
        problem.with_(bulk=Quadratic(np.eye(5)))
    without = DiscreteProblem.of_arrays(**arrays(trace=np.zeros((0, 6)), weights=[], gap=[]))
    with pytest.raises(ProblemError, match=r"offset has shape \(0, 3\); .*, \(0, 2\)"):
        without.with_(offset=np.zeros((0, 3)))


def test_the_energy_of_a_bound_that_depends_on_the_state_is_that_of_the_pair() -> None:
    """Coulomb's bound is 0.5 times the pressure: of the multiplier where one is given, of the normal law where not."""
    law = ContactLaw(Compliance(2.0), Friction(CoulombBound(0.5)))
    problem = DiscreteProblem.of_arrays(np.eye(2), np.zeros(2), np.eye(2), [3.0], [0.0], law)
    u = np.array([0.4, -0.25])
    bulk, normal = 0.5 * (0.4**2 + 0.25**2), 3.0 * 2.0 * 0.4**2 / 2
    assert problem.energy(u) == pytest.approx(bulk + normal + 3.0 * 0.5 * (2.0 * 0.4) * 0.25)
    assert problem.energy(u, np.array([[7.0, 0.0]])) == pytest.approx(bulk + normal + 3.0 * 0.5 * 7.0 * 0.25)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_energy_at_both_ends_of_a_law(side: float) -> None:
    """A point held on both sides: as far off as the gap and the displacement are rounded, and farther."""
    law = ContactLaw(Bilateral(), NoFriction())
    problem = DiscreteProblem.of_arrays([[2.0]], [0.0], [[1.0]], [1.0], [100.0], law)
    assert problem.energy(np.array([100.0 + side * 1e-11])) == pytest.approx(1e4)
    assert problem.energy(np.array([100.0 + side * 1e-9])) == np.inf
    near = problem.with_(offset=np.array([[0.0]]))
    assert near.energy(np.array([side * 1e-11])) == np.inf
    assert near.energy(np.zeros(1)) == 0.0


def test_what_unknowns_and_multipliers_must_be() -> None:
    problem = DiscreteProblem.of_arrays(**arrays())
    for call in (problem.local, problem.energy):
        with pytest.raises(ProblemError, match=r"unknowns have shape \(5,\); this problem has \(6,\)"):
            call(np.ones(5))
    with pytest.raises(ProblemError, match=r"multiplier has shape \(4,\); this problem has \(2, 2\)"):
        problem.contact_force(np.ones(4))
    assert repr(problem) == "DiscreteProblem(6 unknowns, 2 contact points of 2 components, law survey)"


@pytest.mark.parametrize("end", [0.2, 3.0])
def test_energy_where_a_law_ends_beyond_touching(end: float) -> None:
    """A stiffness of 5 up to a largest penetration: there the energy is that of the end, beyond it infinite."""
    law = ContactLaw(FinitePenetration(5.0, end), NoFriction())
    problem = DiscreteProblem.of_arrays([[2.0]], [0.0], [[1.0]], [3.0], [0.0], law)
    at_end = problem.energy(np.array([end]))
    assert np.isfinite(at_end)
    assert problem.energy(np.array([end * (1.0 + 1e-13)])) == pytest.approx(at_end, rel=1e-9)
    assert problem.energy(np.array([end * (1.0 + 1e-11)])) == np.inf
    assert problem.energy(np.array([0.5 * end])) < at_end
    assert problem.energy(np.array([-end])) == pytest.approx(end**2)


def test_what_counts_as_rounding_is_a_part_of_the_largest_displacement_or_gap() -> None:
    law = ContactLaw(Signorini(), NoFriction())
    for gaps, u, forgiven in (
        ([0.0, 100.0], [1e-11, 0.0], True),
        ([0.0, 1.0], [1e-11, 0.0], False),
        ([0.0, 200.0], [1e-11, 100.0], True),
        ([0.0, 0.0], [1e-11, -100.0], True),
        ([0.0, 0.0], [1e-11, 0.0], False),
    ):
        problem = DiscreteProblem.of_arrays(np.eye(2), np.zeros(2), np.eye(2), [1.0, 1.0], gaps, law)
        assert np.isfinite(problem.energy(np.array(u))) == forgiven


def test_the_slip_offset_of_a_single_point() -> None:
    one = {"trace": np.eye(6)[:2], "weights": [1.0], "gap": [0.3]}
    np.testing.assert_array_equal(DiscreteProblem.of_arrays(**arrays(**one)).offset, [[0.3, 0.0]])
    moved = DiscreteProblem.of_arrays(**arrays(**one, slip_offset=[[0.4]]))
    np.testing.assert_array_equal(moved.offset, [[0.3, 0.4]])
    for wrong in ([[0.1, 0.2]], [[0.1], [0.2]]):
        with pytest.raises(ProblemError, match=r"slip_offset has shape .*; it must be \(1, 1\)"):
            DiscreteProblem.of_arrays(**arrays(**one, slip_offset=wrong))


def test_what_was_shown_of_a_problem_holds_with_the_model_of_the_same_body() -> None:
    """And no further: of another load nothing is known."""
    kept, fresh = (discretize(hv.gallery.survey("5.1", 2)) for _ in range(2))
    found = fresh.on_the_same(kept.model)
    assert found.model is kept.model
    assert found.held
    assert not fresh.fitted(kept.model).held
    assert not found.with_(load=2.0 * found.load).held
