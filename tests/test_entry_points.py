"""Arrays at every entry point: complex, masked, text and dates are refused, and what was given stays the user's."""

from __future__ import annotations

import copy
import datetime
import re
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp

import hemivar as hv
from hemivar.discrete import Field
from hemivar.fem import interpolate, nodal_average, strain, v_norm
from hemivar.fem.transfer import interpolation_matrix
from hemivar.laws import ContactLaw
from tests.problems import discrete_square, square

SOLVED = hv.solve(discrete_square(n=2))
PROBLEM = SOLVED.problem
FIELD = PROBLEM.field
assert FIELD is not None
MESH = FIELD.mesh


def arrays() -> dict[str, Any]:
    """The arguments of a problem of one's own."""
    return {
        "stiffness": PROBLEM.bulk.stiffness.toarray(),
        "load": np.array(PROBLEM.load),
        "trace": PROBLEM.contact.trace.toarray(),
        "weights": np.array(PROBLEM.contact.weights),
        "gap": np.array(PROBLEM.gap),
        "law": PROBLEM.law,
        "slip_offset": np.zeros((PROBLEM.contact_points, 1)),
        "points": np.array(PROBLEM.contact.points),
        "frames": np.array(PROBLEM.contact.frames),
    }


def part(problem: hv.DiscreteProblem, name: str) -> Any:
    """What became of an argument."""
    if name == "slip_offset":
        return problem.offset[:, 1:]
    return getattr(problem if name in ("stiffness", "load", "gap") else problem.contact, name)


def with_(name: str, value: Any) -> hv.DiscreteProblem:
    return hv.DiscreteProblem.of_arrays(**{**arrays(), name: value})


def statement(**changes: Any) -> hv.DiscreteProblem:
    problem = square(n=2)
    given = {name: getattr(problem, name) for name in ("mesh", "material", "contact", "supports", "body_force")}
    return hv.discretize(hv.ContactProblem(**{**given, **changes}))


U, LAM = SOLVED.unknowns, SOLVED.multiplier
NODAL = SOLVED.displacement

#: Where arrays come in, each with a function of the array and an array that it takes.
ENTRIES: dict[str, tuple[Callable[[Any], object], Any]] = {
    **{
        f"DiscreteProblem.of_arrays({name})": (lambda value, name=name: with_(name, value), value)
        for name, value in arrays().items()
        if name != "law"
    },
    "DiscreteProblem.of_arrays(constant)": (lambda value: with_("constant", value), np.array(1.0)),
    "solve(initial)": (lambda value: hv.solve(PROBLEM, initial=value), U),
    "certify(displacement)": (lambda value: hv.certify(PROBLEM, value), U),
    "certify(multiplier)": (lambda value: hv.certify(PROBLEM, U, value), LAM),
    "residual(displacement)": (lambda value: hv.discrete.residual(PROBLEM, value, LAM), U),
    "residual(multiplier)": (lambda value: hv.discrete.residual(PROBLEM, U, value), LAM),
    "energy(unknowns)": (PROBLEM.energy, U),
    "local(unknowns)": (PROBLEM.local, U),
    "contact_force(multiplier)": (PROBLEM.contact_force, LAM),
    "follow_path(start)": (lambda value: hv.follow_path(PROBLEM, (0.5, 1.0), start=value), U),
    "condense().start": (lambda value: hv.systems.condense(PROBLEM).start(value), SOLVED.local),
    "Field(basis)": (lambda value: Field(MESH, 1, value, FIELD.prescribed), FIELD.basis.toarray()),
    "Field(prescribed)": (lambda value: Field(MESH, 1, FIELD.basis, value), FIELD.prescribed),
    "displacement(unknowns)": (FIELD.full, U),
    "restrict(displacement)": (FIELD.restrict, NODAL),
    "strain(displacement)": (lambda value: strain(FIELD, value), NODAL),
    "v_norm(displacement)": (lambda value: v_norm(FIELD, value), NODAL),
    "nodal_average(values)": (lambda value: nodal_average(FIELD, value), np.ones(MESH.number_of_cells)),
    "interpolate(values)": (lambda value: interpolate(FIELD, value, MESH), NODAL),
    "interpolate(target)": (lambda value: interpolate(FIELD, NODAL, value), np.full((1, 2), 0.5)),
    "interpolation_matrix(points)": (lambda value: interpolation_matrix(MESH, 1, value), np.full((1, 2), 0.5)),
    "body_force": (lambda value: statement(body_force=value), np.array([0.0, -1.0])),
    "body_force(x)": (lambda value: statement(body_force=lambda x: value), np.array([0.0, -1.0])),
    "traction": (lambda value: statement(tractions={"top": value}), np.array([0.0, -1.0])),
    "Pressure": (lambda value: hv.Pressure(value), np.array(1.0)),
    "Pressure(x)": (lambda value: statement(tractions={"top": hv.Pressure(lambda x: value)}), np.array(1.0)),
    "Prescribed": (lambda value: hv.Prescribed(value), np.array([0.0, -1.0])),
    "Prescribed(x)": (
        lambda value: statement(supports={"left": hv.Prescribed(lambda x: value)}),
        np.array([0.0, -1e-3]),
    ),
    "Fixed": (lambda value: hv.Fixed(x=value), np.array(1.0)),
    "Fixed(x)": (
        lambda value: statement(supports={"left": hv.Fixed(x=lambda x: value, y=0.0)}),
        np.array(1e-3),
    ),
    "Contact(gap)": (lambda value: hv.Contact(hv.Signorini(), gap=value), np.array(1.0)),
    "Contact(gap of x)": (
        lambda value: statement(contact={"bottom": hv.Contact(hv.Signorini(), gap=lambda x: value)}),
        np.array(1e-3),
    ),
}

WRONG: dict[str, tuple[Callable[[Any], Any], str]] = {
    "complex": (lambda a: a * (1.0 + 1.0j), "is complex"),
    "complex without imaginary part": (lambda a: a.astype(complex), "is complex"),
    "complex objects": (lambda a: (a * 1j).astype(object), "is complex"),
    "numpy complex objects": (lambda a: _objects(a, np.complex64), "is complex"),
    "masked": (lambda a: np.ma.masked_array(a, mask=np.zeros(a.shape, bool)), "is a masked array"),
    "text": (lambda a: a.astype(str), "is text"),
    "text objects": (lambda a: a.astype(str).astype(object), "it holds '"),
    "nothing": (lambda a: np.full(a.shape, None), "it holds None"),
    "dates": (lambda a: np.full(a.shape, np.datetime64("2020-01-01")), "datetime64"),
    "spans of time": (lambda a: np.full(a.shape, datetime.timedelta(1)).astype("timedelta64[s]"), "timedelta64"),
    "ragged": (lambda a: [[1.0], [1.0, 2.0]], "not an array of numbers"),
    "mappings": (lambda a: {"a": 1}, "not an array of numbers"),
}


def _objects(array: Any, kind: type) -> Any:
    out = np.empty(array.shape, dtype=object)
    for place in np.ndindex(array.shape):
        out[place] = kind(array[place])
    return out


def taken(call: Callable[[Any], object], array: Any) -> Iterator[str]:
    """The wrong arrays that are not refused in their words."""
    for wrong, (spoil, message) in WRONG.items():
        given = spoil(array)
        try:
            call(given)
        except hv.errors.ProblemError as error:
            if not re.search(message, str(error)):
                yield f"{wrong}: not {message!r}, but {error}"
        except Exception as error:
            yield f"{wrong}: {error!r}"
        else:
            yield f"{wrong}: no error"


@pytest.mark.parametrize("entry", ENTRIES)
def test_what_is_no_array_of_real_numbers_is_refused(entry: str) -> None:
    assert list(taken(*ENTRIES[entry])) == []


def test_an_array_that_is_not_refused_is_named() -> None:
    def half(value: Any) -> None:
        if np.ma.isMaskedArray(value):
            raise hv.errors.ProblemError("load is wrong; give another")
        if isinstance(value, dict):
            raise TypeError
        if not isinstance(value, np.ndarray) or value.dtype != complex:
            with_("load", value)

    assert list(taken(half, arrays()["load"])) == [
        "complex: no error",
        "complex without imaginary part: no error",
        "masked: not 'is a masked array', but load is wrong; give another",
        "mappings: TypeError()",
    ]


@pytest.mark.parametrize("entry", ENTRIES)
def test_what_is_right_is_taken(entry: str) -> None:
    call, array = ENTRIES[entry]
    call(array)
    call(array.astype(object))
    call(array.tolist())
    call(np.array(array, order="F"))


@pytest.mark.parametrize("name", ["stiffness", "trace"])
@pytest.mark.parametrize("form", ["csr", "csc", "coo", "bsr", "lil", "dok", "dia"])
def test_sparse_matrices(name: str, form: str) -> None:
    matrix = sp.coo_array(arrays()[name]).asformat(form)
    np.testing.assert_array_equal(part(with_(name, matrix), name).toarray(), arrays()[name])
    with pytest.raises(hv.errors.ProblemError, match=f"{name} is complex"):
        with_(name, sp.coo_array(arrays()[name] * (1.0 + 1.0j)).asformat(form))
    spoilt = arrays()[name]
    row, column = np.argwhere(spoilt)[0]
    spoilt[row, column] = np.nan
    with pytest.raises(hv.errors.ProblemError, match=rf"{name}\[{row}, {column}\] = nan"):
        with_(name, sp.coo_array(spoilt).asformat(form))


def test_sparse_where_dense_is_wanted() -> None:
    with pytest.raises(hv.errors.ProblemError, match="load is a sparse matrix"):
        with_("load", sp.csr_array(arrays()["load"][None, :]))


def test_integers_are_numbers() -> None:
    problem = hv.DiscreteProblem.of_arrays(
        np.diag([2, 2]),
        np.array([1, 0]),
        np.eye(2, dtype=int),
        np.array([1]),
        np.array([0]),
        ContactLaw(hv.Signorini()),
    )
    assert problem.load.dtype == float
    assert problem.bulk.stiffness.dtype == float


@pytest.mark.parametrize("name", [name for name in arrays() if name != "law"])
@pytest.mark.parametrize("sparse", [False, True])
def test_later_changes_of_what_was_given_do_not_reach_the_problem(name: str, sparse: bool) -> None:
    given = arrays()
    if sparse:
        given |= {key: sp.csr_array(given[key]) for key in ("stiffness", "trace")}
    kept = copy.deepcopy(given)
    problem = hv.DiscreteProblem.of_arrays(**given)
    target = given[name].data if sp.issparse(given[name]) else given[name]
    target[...] = 7.0  # the user's array is writable still
    found = part(problem, name)
    expected = kept[name]
    np.testing.assert_array_equal(
        found.toarray() if sp.issparse(found) else found,
        expected.toarray() if sp.issparse(expected) else expected,
    )


@pytest.mark.parametrize("name", ["load", "weights", "gap", "slip_offset", "points", "frames"])
def test_arrays_of_a_problem_are_read_only(name: str) -> None:
    array = part(hv.DiscreteProblem.of_arrays(**arrays()), name)
    with pytest.raises(ValueError, match="read-only"):
        array[...] = 0.0


def test_nothing_writes_into_the_users_arrays() -> None:
    given = arrays()
    kept = copy.deepcopy(given)
    problem = hv.DiscreteProblem.of_arrays(**given)
    start, lam = np.array(U), np.array(LAM)
    for method in hv.solvers.METHODS.values():
        hv.solve(problem, method, hv.Controls(max_steps=3), initial=start)
    hv.certify(problem, start, lam)
    hv.discrete.residual(problem, start, lam)
    hv.follow_path(problem, (0.5, 1.0), start=start)
    for name in set(given) - {"law"}:
        np.testing.assert_array_equal(given[name], kept[name])
    np.testing.assert_array_equal(start, U)
    np.testing.assert_array_equal(lam, LAM)


@pytest.mark.parametrize("make", [list, np.array])
def test_later_changes_of_vectors_do_not_reach_the_statement(make: Any) -> None:
    force, moved, pull = make([0.0, -1.0]), make([0.0, -1e-3]), make([0.1, 0.0])
    problem = square(n=2)
    problem = hv.ContactProblem(
        mesh=problem.mesh,
        material=problem.material,
        contact=problem.contact,
        supports={"left": hv.Prescribed(moved)},
        body_force=force,
        tractions={"top": pull},
    )
    before = hv.discretize(problem)
    for vector in (force, moved, pull):
        vector[1] = 5.0
    after = hv.discretize(problem)
    np.testing.assert_array_equal(before.load, after.load)
    np.testing.assert_array_equal(before.gap, after.gap)


def test_conditions_compare_and_hash() -> None:
    assert hv.Prescribed(np.array([0.0, 1.0])) == hv.Prescribed([0, 1])
    assert len({hv.Prescribed(np.array([0.0, 1.0])), hv.Prescribed((0.0, 1.0)), hv.Clamped(), hv.Fixed(x=0.0)}) == 3
    assert hv.Pressure(np.array(2.0)) == hv.Pressure(2)
    assert hv.Fixed(x=np.float64(1.0)) == hv.Fixed(x=np.array(1.0))
