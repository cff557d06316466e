"""The discrete problem as an object of its own, built from a user's arrays."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse as sp

from hemivar.discrete import DiscreteProblem, Quadratic
from hemivar.errors import ProblemError
from hemivar.fem import discretize
from hemivar.laws import ContactLaw, NoFriction, Signorini, SurveyLaw, Tresca
from hemivar.mechanics import Clamped, Contact, ContactProblem, Material
from hemivar.mesh import rectangle

LAW = ContactLaw(SurveyLaw(0.3, 2.0), Tresca(0.5))


def arrays(**changes) -> dict:
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
        assert isinstance(problem.linear.stiffness, sp.csr_array)
        assert (problem.unknowns, problem.contact_points, problem.contact.components) == (6, 2, 2)


def test_energy_local_and_force() -> None:
    problem = DiscreteProblem.of_arrays(**arrays(slip_offset=[[0.2], [0.0]], constant=3.0))
    np.testing.assert_array_equal(problem.contact.offset.ravel(), [0.1, 0.2, 0.0, 0.0])
    u = np.array([0.3, 0.1, -0.2, 0.4, 0.5, 0.6])
    r = problem.local(u)
    np.testing.assert_allclose(r, [[0.2, -0.1], [-0.2, 0.4]])
    K, f = problem.linear.stiffness.toarray(), problem.linear.load
    contact = 0.5 * (0.3 * 0.2 + 0.2**2 + 0.5 * 0.1) + 0.25 * (0.5 * 0.4)
    assert np.isclose(problem.energy(u), 0.5 * u @ K @ u - f @ u + contact + 3.0)
    force = problem.contact_force(np.array([[1.0, 2.0], [3.0, 4.0]]))
    np.testing.assert_allclose(force, [0.5, 1.0, 0.75, 1.0, 0.0, 0.0])


def test_scalar_contact() -> None:
    """A bar: one normal component, no slip."""
    problem = DiscreteProblem.of_arrays([[2.0]], [1.0], [[1.0]], [1.0], [0.0], ContactLaw(SurveyLaw(0.3, 2.0)))
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
        ContactProblem(
            mesh=mesh, material=Material.young(3.0, 0.3), contact={"bottom": Contact(SurveyLaw(0.3, 2.0), Tresca(0.5))},
            supports={"left": Clamped()}, body_force=(0.1, -0.4), order=order,
        )
    )  # fmt: skip
    given = problem.bulk
    assert isinstance(given, Quadratic)
    checked = Quadratic(given.stiffness, given.load, given.constant)
    assert abs(checked.stiffness - given.stiffness).nnz == 0
    np.testing.assert_array_equal(checked.load, given.load)
    assert checked.constant == given.constant


def test_with_law_shares_matrices() -> None:
    problem = DiscreteProblem.of_arrays(**arrays())
    other = problem.with_(law=ContactLaw(SurveyLaw(1.0)))
    assert other.linear.stiffness is problem.linear.stiffness
    assert other.law is not problem.law
    assert other.energy(np.ones(6)) != problem.energy(np.ones(6))
    with pytest.raises(ProblemError, match="law"):
        problem.with_(law=ContactLaw(SurveyLaw(np.ones(5))))


UNSYMMETRIC = arrays()["stiffness"] + np.eye(6, k=2) * 1e-6


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"stiffness": np.eye(5)}, "stiffness has shape .5, 5. but load has 6"),
        ({"stiffness": UNSYMMETRIC}, "not symmetric"),
        ({"stiffness": arrays()["stiffness"] * np.nan}, r"stiffness\[0, 0\] = nan"),
        ({"stiffness": arrays()["stiffness"] - 4 * np.eye(6)}, "positive diagonal"),
        ({"stiffness": "stiff"}, "stiffness is no array of numbers: it is text"),
        ({"load": np.ones((6, 1))}, r"load has shape \(6, 1\); it must have 1 axis"),
        ({"load": [1, 2, 3, np.inf, 5, 6]}, r"load\[3\] = inf"),
        ({"load": "heavy"}, "load is no array of numbers: it is text"),
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
        ({"law": ContactLaw(SurveyLaw(lambda x: x[:, 0]))}, r"law.at\(points\)"),
        ({"law": ContactLaw(SurveyLaw(np.ones(3)))}, "law"),
    ],
)
def test_refuses(changes: dict, words: str) -> None:
    with pytest.raises(ProblemError, match=words):
        DiscreteProblem.of_arrays(**arrays(**changes))


def test_field_must_match() -> None:
    problem = ContactProblem(
        rectangle((1, 1), 2),
        Material.lame(4, 4),
        contact={"bottom": Contact(Signorini())},
        supports={"left": Clamped()},
    )
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
