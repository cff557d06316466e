"""The quadratic bulk and what acts on it: sums, sizes, what they own and what they refuse."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse as sp

from hemivar.discrete import DiscreteProblem, Quadratic, bulk
from hemivar.discrete.bulk import without_zeros
from hemivar.errors import ProblemError
from hemivar.laws import ContactLaw, NoContact

K = np.array([[4.0, -1.0, 0.0], [-1.0, 3.0, -2.0], [0.0, -2.0, 5.0]])
F = np.array([1.0, -2.0, 3.0])


def under(load: np.ndarray, constant: float = 0.0, K: np.ndarray = K) -> DiscreteProblem:
    """The body under a load, without contact points."""
    nothing = np.zeros((0, len(load)))
    return DiscreteProblem.of_arrays(K, load, nothing, [], [], ContactLaw(NoContact()), constant)


def test_energy_and_sizes_by_hand() -> None:
    body, problem = Quadratic(K), under(F, 7.0)
    u = np.array([1.0, 2.0, -1.0])
    # u'K u = 4 + 12 + 5 - 2 * 2 + 2 * 2 * 2, f'u = 1 - 4 - 3
    assert body.value(u) == 0.5 * 25.0
    assert problem.energy(u) == 0.5 * 25.0 + 6.0 + 7.0
    np.testing.assert_array_equal(body.gradient(u), [2.0, 7.0, -9.0])
    np.testing.assert_array_equal(problem.out_of_balance(u), [-1.0, -9.0, 12.0])
    # |K||u| + |f| = (4 + 2, 1 + 6 + 2, 4 + 5) + (1, 2, 3), with row sums (5, 12, 7) + (1, 2, 3)
    assert body.rounding_scale(u, F) == pytest.approx(np.sqrt(6.0**2 + 14.0**2 + 10.0**2))
    np.testing.assert_array_equal(body.diagonal, [4.0, 3.0, 5.0])
    np.testing.assert_array_equal(body.row_sums, [5.0, 6.0, 7.0])
    assert repr(body) == "Quadratic(3 unknowns, 7 entries)"
    assert under(F).constant == 0.0


@pytest.mark.parametrize("portion", [1, 2, 3, 4])
def test_sums_of_rows_do_not_depend_on_how_many_are_summed_in_one_go(
    portion: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(bulk, "PORTION", portion)
    np.testing.assert_array_equal(Quadratic(K).row_sums, [5.0, 6.0, 7.0])


@pytest.mark.parametrize("sparse", [False, True])
def test_a_body_of_arrays_owns_them(sparse: bool) -> None:
    """Later changes of what was given do not reach it, nor the load."""
    matrix, load = sp.csr_array(K) if sparse else K.copy(), F.copy()
    body, problem = Quadratic(matrix), under(load)
    load[:] = 9.0
    if sparse:
        matrix.data[:] = 9.0
    else:
        matrix[:] = 9.0
    np.testing.assert_array_equal(problem.load, F)
    np.testing.assert_array_equal(body.stiffness.toarray(), K)
    other = np.array([5.0, 6.0, 7.0])
    loaded = problem.with_(load=other)
    other[:] = 0.0
    np.testing.assert_array_equal(loaded.load, [5.0, 6.0, 7.0])
    assert not loaded.load.flags.writeable


def test_the_same_model_under_another_load() -> None:
    problem = under(F, 7.0)
    loaded = problem.with_(load=2.0 * F)
    assert loaded.model is problem.model
    assert loaded.constant == 7.0
    assert problem.with_(load=2.0 * F, constant=0.0).constant == 0.0
    np.testing.assert_array_equal(loaded.load, 2.0 * F)
    with pytest.raises(ProblemError, match="load has 2 entries"):
        problem.with_(load=np.ones(2))
    with pytest.raises(ProblemError, match=r"load\[1\] = nan"):
        problem.with_(load=np.array([0.0, np.nan, 0.0]))


def test_a_load_that_nobody_can_change_is_not_copied() -> None:
    """A read-only view of an array that can be changed is."""
    load = 2.0 * F
    view = load[:]
    view.flags.writeable = False
    assert under(view).load is not view
    load.flags.writeable = False
    assert under(load).load is load


@pytest.mark.parametrize("size", [1.0, 1e-130, 1e130, 0.0])
def test_the_size_of_a_load_is_its_own(size: float) -> None:
    """Also where its square is not a number that tells anything."""
    problem = under(F)
    assert problem.loading.load_size == pytest.approx(np.sqrt(14.0), rel=1e-15)
    loaded = problem.with_(load=size * np.array([2.0, -1.0, 2.0]))
    assert loaded.loading.load_size == pytest.approx(3.0 * size, rel=1e-15)
    assert loaded.with_(load=F).loading.load_size == problem.loading.load_size


@pytest.mark.parametrize(
    ("matrix", "words"),
    [
        (np.ones((3, 2)), r"shape \(3, 2\); it must be square"),
        (np.diag([1.0, 0.0, 1.0]), r"stiffness\[1, 1\] = 0; .*positive diagonal"),
        (np.diag([-1.0, 2.0, 3.0]), r"stiffness\[0, 0\] = -1"),
        (K + np.triu(K, 1) * 1e-8, "max |K - K'| = 2e-08"),
    ],
)
def test_what_a_stiffness_may_not_be(matrix: np.ndarray, words: str) -> None:
    with pytest.raises(ProblemError, match=words.replace("|", r"\|")):
        Quadratic(matrix)


def test_what_is_unsymmetric_by_rounding_is_symmetric() -> None:
    """Relative to the largest entry: 1e-10 of it may be missing."""
    for size in (1e-6, 1.0, 1e6):
        Quadratic(size * (K + np.triu(K, 1) * 1e-11))
        with pytest.raises(ProblemError, match="not symmetric"):
            Quadratic(size * (K + np.triu(K, 1) * 1e-9))


@pytest.mark.parametrize("constant", [np.nan, np.inf, -np.inf])
def test_the_constant_part_of_the_energy_is_finite(constant: float) -> None:
    with pytest.raises(ProblemError, match="the constant part of the energy must be finite"):
        under(F, constant)


@pytest.mark.parametrize(
    ("stiffness", "load", "words"),
    [
        (1.0, 1e-134, None),
        (1e-100, 1e-180, None),  # f^2 / k = 1e-260, though f^2 k is nothing
        (1e100, 1e180, None),
        (1e-200, 1e30, None),
        (1e200, 1e-30, None),
        (1.0, 0.0, None),
        (1e300, 0.0, None),
        (1.0, 1e-136, "underflow"),
        (1.0, 1e136, "overflow"),
        (1e-200, 1e40, "overflow"),
        (1e200, 1e-40, "underflow"),
    ],
)
def test_loads_are_refused_whose_work_is_no_number(stiffness: float, load: float, words: str | None) -> None:
    """The work of the load on the displacement that it causes, f^2 / k, and not the load alone."""
    if words is None:
        under([load], K=[[stiffness]])  # type: ignore[arg-type]
        return
    with pytest.raises(ProblemError, match=f"energies of that size {words}"):
        under([load], K=[[stiffness]])  # type: ignore[arg-type]


def test_an_assembled_matrix_is_taken_as_it_is() -> None:
    matrix = sp.csr_array(K)
    body = Quadratic(matrix, assembled=True)
    assert body.stiffness is matrix
    skew = sp.csr_array(K + np.triu(K, 1))
    assert Quadratic(skew, assembled=True).stiffness is skew  # whoever assembled it answers for it
    with pytest.raises(ProblemError, match="positive diagonal"):
        Quadratic(sp.csr_array(-K), assembled=True)


def test_a_body_without_unknowns() -> None:
    nothing = Quadratic(np.zeros((0, 0)))
    assert (nothing.unknowns, nothing.value(np.zeros(0))) == (0, 0.0)
    assert nothing.row_sums.shape == (0,)


@pytest.mark.parametrize(("zeros", "kept"), [(0, True), (2, True), (10, False), (50, False), (100, False)])
def test_stored_zeros_are_left_out_unless_they_are_few(zeros: int, kept: bool) -> None:
    data = np.ones(100)
    data[:zeros] = 0.0
    matrix = sp.csr_array((data, np.tile(np.arange(10), 10), np.arange(0, 101, 10)), shape=(10, 10))
    found = without_zeros(matrix)
    assert (found is matrix) is kept
    assert found.nnz == (100 if kept else 100 - zeros)
    np.testing.assert_array_equal(found.toarray(), data.reshape(10, 10))
    assert matrix.nnz == 100
