"""Contact points by themselves: what they see, what is taken of them, what they refuse."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import numpy as np
import pytest
import scipy.sparse as sp

from hemivar.basics.types import Array
from hemivar.discrete import ContactPoints
from hemivar.errors import ProblemError

B = np.arange(1.0, 31.0).reshape(6, 5) % 7.0


def turned(angle: float) -> Array:
    """Normal and tangent of a boundary at an angle."""
    return np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])


def three() -> ContactPoints:
    """Three points of two components, on two boundaries."""
    return ContactPoints(
        sp.csr_array(B),
        np.array([0.5, 2.0, 1.5]),
        points=np.array([[0.0, 1.0], [2.0, 3.0], [4.0, 5.0]]),
        frames=np.stack([turned(0.3), turned(1.2), turned(-2.0)]),
        node=np.array([7, -1, 9]),
        facet=np.array([-1, 4, -1]),
        boundary=np.array([1, 0, 1]),
        names=("left", "bottom"),
        without_friction=np.array([False, True, False]),
    )


def bare(m: int = 3, components: int = 2) -> ContactPoints:
    """Points of which nothing but the numbers is known."""
    return ContactPoints(sp.csr_array((m * components, 5)), np.ones(m), components=components)


def test_sizes() -> None:
    contact = three()
    assert (contact.count, contact.components, contact.unknowns) == (3, 2, 5)
    assert contact.shape == (3, 2)
    assert repr(contact) == "ContactPoints(3 of 2 components on left, bottom)"
    assert repr(bare()) == "ContactPoints(3 of 2 components)"


def test_local_displacements_and_forces_are_those_of_the_matrices() -> None:
    contact, rng = three(), np.random.default_rng(1)
    u, lam = rng.normal(size=5), rng.normal(size=(3, 2))
    np.testing.assert_allclose(contact.trace_of(u), (B @ u).reshape(3, 2), rtol=1e-14)
    W = np.diag([0.5, 0.5, 2.0, 2.0, 1.5, 1.5])
    np.testing.assert_allclose(contact.force(lam), B.T @ W @ lam.ravel(), rtol=1e-14)


@pytest.mark.parametrize("index", [[2, 0], [1], [0, 1, 2], [1, 1, 0], []])
def test_points_that_are_taken_bring_everything_along(index: list[int]) -> None:
    contact, chosen = three(), np.array(index, dtype=int)
    some = contact.take(chosen)
    rows = [row for j in index for row in (2 * j, 2 * j + 1)]
    np.testing.assert_array_equal(some.trace.toarray(), B[rows])
    for name in ("weights", "points", "frames", "node", "facet", "boundary", "without_friction"):
        np.testing.assert_array_equal(getattr(some, name), getattr(contact, name)[chosen], err_msg=name)
    assert (some.names, some.count, some.components, some.unknowns) == (contact.names, len(index), 2, 5)


def test_what_is_not_known_stays_unknown() -> None:
    contact = bare().take(np.array([2, 1]))
    assert contact.points is None
    assert contact.frames is None
    for name in ("node", "facet", "boundary"):
        np.testing.assert_array_equal(getattr(contact, name), [-1, -1])
    np.testing.assert_array_equal(contact.without_friction, [False, False])
    with pytest.raises(ProblemError, match="no frames"):
        contact.global_vectors(np.zeros((2, 2)))
    with pytest.raises(ProblemError, match=r"no contact boundary 'left' \(known: none\)"):
        contact.on("left")


def test_local_components_are_turned_into_the_coordinates_of_the_mesh() -> None:
    """A pressure along the normal and a friction along the tangent of each point."""
    local = np.array([[1.0, 0.0], [0.0, 1.0], [2.0, -3.0]])
    expected = [turned(0.3)[0], turned(1.2)[1], 2.0 * turned(-2.0)[0] - 3.0 * turned(-2.0)[1]]
    np.testing.assert_allclose(three().global_vectors(local), expected, rtol=1e-14)


def test_the_points_of_a_boundary() -> None:
    contact = three()
    np.testing.assert_array_equal(contact.on("bottom"), [0, 2])
    np.testing.assert_array_equal(contact.on("left"), [1])


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"boundary": np.array([0, 2, 1])}, "not indices into names"),
        ({"boundary": np.array([0, -2, 1])}, "not indices into names"),
        ({"boundary": np.array([0, 1])}, r"boundary has shape \(2,\); it needs one entry per contact point, \(3,\)"),
        ({"node": np.zeros((3, 1), dtype=int)}, "node has shape"),
        ({"facet": np.zeros(4, dtype=int)}, "facet has shape"),
        ({"without_friction": np.zeros(2, dtype=bool)}, "without_friction has shape"),
        ({"points": np.zeros((2, 2))}, r"points has shape \(2, 2\); it must be \(3, d\)"),
        ({"points": np.zeros(3)}, "points has shape"),
        ({"frames": np.zeros((2, 2, 2))}, r"frames has shape \(2, 2, 2\); it must be \(3, 2, d\)"),
        ({"frames": np.zeros((3, 3, 2))}, r"frames has shape \(3, 3, 2\); it must be \(3, 2, d\)"),
        ({"weights": np.array([1.0, 0.0, 1.0])}, r"weights\[1\] = 0; every weight must be positive"),
        ({"weights": np.ones(4)}, "trace has 6 rows for 4 contact points"),
        ({"weights": np.zeros(0)}, "trace has 6 rows but weights is empty"),
        ({"trace": sp.csr_array((0, 5))}, "trace has 0 rows for 3 contact points"),
        ({"trace": sp.csr_array((12, 5))}, "trace has 12 rows for 3 contact points"),
    ],
)
def test_what_contact_points_refuse(change: dict[str, Array], words: str) -> None:
    with pytest.raises(ProblemError, match=words):
        dataclasses.replace(three(), **change)  # type: ignore[arg-type]


@pytest.mark.parametrize("components", [1, 2, 3])
def test_a_point_has_up_to_three_components(components: int) -> None:
    contact = bare(2, components)
    assert contact.components == components
    assert contact.trace_of(np.ones(5)).shape == (2, components)


@pytest.mark.parametrize("make", [lambda: bare(0), lambda: three().take(np.zeros(0, dtype=int))])
def test_no_points_keep_their_components(make: Callable[[], ContactPoints]) -> None:
    contact = make()
    assert (contact.count, contact.components) == (0, 2)
    assert contact.trace_of(np.ones(5)).shape == (0, 2)
    np.testing.assert_array_equal(contact.force(np.zeros((0, 2))), np.zeros(5))
    for change in ({"points": np.zeros((1, 2))}, {"frames": np.zeros((1, 2, 2))}):
        with pytest.raises(ProblemError, match=next(iter(change))):
            dataclasses.replace(contact, **change)  # type: ignore[arg-type]


def test_the_last_of_the_names_is_a_place() -> None:
    contact = dataclasses.replace(bare(), boundary=np.array([-1, 0, 1]), names=("left", "bottom"))
    np.testing.assert_array_equal(contact.on("bottom"), [2])


@pytest.mark.parametrize(
    "change",
    [
        {"points": np.zeros((2, 2))},
        {"frames": np.zeros((1, 3, 2))},
        {"boundary": np.array([0])},
        {"boundary": np.array([-2])},
    ],
)
def test_a_single_point_is_checked_as_many_are(change: dict[str, Array]) -> None:
    with pytest.raises(ProblemError, match=next(iter(change))):
        dataclasses.replace(bare(1), **change)  # type: ignore[arg-type]


@pytest.mark.parametrize("factors", [(1.0, 1.0, 1.0), (2.0, -3.0, 0.5)])
@pytest.mark.parametrize("columns", [(2, 0, 3), (2, 0, 2)])
def test_forces_on_what_points_see(columns: tuple[int, ...], factors: tuple[float, ...]) -> None:
    """``B'`` at the unknowns seen, where each point sees its own and where two see the same."""
    trace = sp.csr_array((np.array(factors), (np.arange(3), np.array(columns))), shape=(3, 5))
    contact = ContactPoints(trace, np.ones(3))
    force = np.array([[1.0], [2.0], [4.0]])
    assert contact.seen.tolist() == sorted(set(columns))
    np.testing.assert_allclose(contact.pressed(force), (trace.toarray().T @ force.ravel())[contact.seen])
