"""Statements that depend on time, and what they are at one time."""

from __future__ import annotations

import functools
import pickle
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from hemivar.errors import ProblemError
from hemivar.fem import discretize
from hemivar.fem.dynamics import body_family
from hemivar.formula import Formula, FormulaArray
from hemivar.laws import Adhesive, Compliance, CoulombBound, Friction, SlipWeakening, Tresca
from hemivar.laws.memory import Secant
from hemivar.mechanics import (
    Branch,
    Clamped,
    Contact,
    ContactProblem,
    Fixed,
    Material,
    Prescribed,
    Pressure,
    Roller,
    SignedDistance,
    Traction,
)
from hemivar.mechanics.instants import Instant, at_time, depends_on_time, law_at_time, law_depends_on_time
from hemivar.mesh import rectangle

X = np.array([[0.0, 0.0], [1.0, 0.5], [0.2, 0.9]])


def ramp(x: np.ndarray, t: float) -> np.ndarray:
    return t * (1.0 + x[:, 0])


def shape(x: np.ndarray, scale: float = 2.0) -> np.ndarray:
    return scale * x[:, 0]


class Growing:
    """A Python object that can be called with place and time."""

    def __call__(self, x: np.ndarray, t: float) -> np.ndarray:
        return t * x[:, 0]

    def method(self, x: np.ndarray, t: float = 1.0) -> np.ndarray:
        return t * x[:, 0]


@pytest.mark.parametrize(
    ("value", "expected"),
    [
        (ramp, True),
        (Growing(), True),
        (Growing().method, True),
        (functools.partial(ramp, t=2.0), False),
        (functools.partial(lambda s, x, t: s * t * x[:, 0], 2.0), True),
        (shape, False),
        (lambda x: x[:, 0], False),
        (lambda *x: x[0][:, 0], False),
        (np.sin, False),
        (3.0, False),
        (np.ones(2), False),
        (None, False),
        (Formula("x + t"), True),
        (Formula("x + y"), False),
        (Formula("tan(x)"), False),
        (FormulaArray((0.0, Formula("t")), (2,)), True),
        (FormulaArray((0.0, Formula("x")), (2,)), False),
        (Instant(ramp, 2.0), False),
    ],
)
def test_what_depends_on_time(value: object, expected: bool) -> None:
    assert depends_on_time(value) is expected
    assert (at_time(value, 0.5) is value) is not expected


def test_values_at_a_time() -> None:
    np.testing.assert_allclose(at_time(ramp, 0.5)(X), 0.5 * (1 + X[:, 0]))
    np.testing.assert_allclose(at_time(Formula("sin(t) * x"), 0.5)(X), np.sin(0.5) * X[:, 0])
    vector = at_time(FormulaArray((1.0, Formula("t - y")), (2,)), 3.0)
    np.testing.assert_allclose(vector(X), np.column_stack([np.ones(3), 3.0 - X[:, 1]]))


def test_formulas_with_time() -> None:
    formula = Formula("min(t, 1) * x", "load")
    assert formula.variables == {"t", "x"}
    with pytest.raises(ProblemError, match=r"load: formula 'min\(t, 1\) \* x' uses t, but no time is given"):
        formula(X)
    with pytest.raises(ProblemError, match=r"is -?inf at x = 0, y = 0, t = 0; give a formula that is finite"):
        Formula("1 / t")(X, 0.0)
    with pytest.raises(ProblemError, match=r"is -1 at x = 0, y = 0, t = 2; it must be at least 0"):
        Formula("1 - t", minimum=0.0)(X, 2.0)
    np.testing.assert_allclose(Formula("2 * x")(X, 7.0), 2 * X[:, 0])


def problem(**changes: Any) -> ContactProblem:
    parts: dict[str, Any] = {
        "mesh": rectangle((1, 1), 4),
        "material": Material.lame(4.0, 4.0),
        "supports": {"left": Prescribed((0.0, 0.0))},
        "contact": {"bottom": Contact(Compliance(2.0), Tresca(0.1), 0.05)},
        "body_force": (0.1, -0.5),
        "tractions": {"right": Pressure(0.2), "top": (0.0, -0.3)},
    }
    return ContactProblem(**parts | changes)


#: What depends on time, which part of the statement that is, and what it is at t = 1/2.
CHANGES: dict[str, tuple[dict[str, Any], str, dict[str, Any]]] = {
    "body force": (
        {"body_force": lambda x, t: np.column_stack([t * x[:, 0], -(t**2) * x[:, 1]])},
        "load",
        {"body_force": lambda x: np.column_stack([0.5 * x[:, 0], -0.25 * x[:, 1]])},
    ),
    "traction": (
        {"tractions": {"top": FormulaArray((0.0, Formula("-2 * t")), (2,))}},
        "load",
        {"tractions": {"top": (0.0, -1.0)}},
    ),
    "pressure": (
        {"tractions": {"right": Pressure(Formula("t * y"))}},
        "load",
        {"tractions": {"right": Pressure(lambda x: 0.5 * x[:, 1])}},
    ),
    "prescribed": (
        {"supports": {"left": Prescribed(lambda x, t: 0.1 * t * x)}},
        "supports",
        {"supports": {"left": Prescribed(lambda x: 0.05 * x)}},
    ),
    "fixed": (
        {"supports": {"left": Fixed(x=Formula("0.1 * t"), y=0.0)}},
        "supports",
        {"supports": {"left": Fixed(x=0.05, y=0.0)}},
    ),
    "gap": (
        {"contact": {"bottom": Contact(Compliance(2.0), Tresca(0.1), lambda x, t: 0.1 * t * x[:, 0])}},
        "gap",
        {"contact": {"bottom": Contact(Compliance(2.0), Tresca(0.1), lambda x: 0.05 * x[:, 0])}},
    ),
    "law": (
        {"contact": {"bottom": Contact(Compliance(Formula("2 + t")), Tresca(0.1))}},
        "law",
        {"contact": {"bottom": Contact(Compliance(2.5), Tresca(0.1))}},
    ),
    "bound": (
        {"contact": {"bottom": Contact(Compliance(2.0), Tresca(ramp))}},
        "law",
        {"contact": {"bottom": Contact(Compliance(2.0), Tresca(lambda x: 0.5 + 0.5 * x[:, 0]))}},
    ),
}


@pytest.mark.parametrize("name", CHANGES)
def test_a_problem_at_a_time(name: str) -> None:
    """It is the problem that statics would state, in load, gap, law and prescribed displacements."""
    moving, part, still = CHANGES[name]
    stated = problem(**moving)
    assert stated.time_dependent == {part}
    with pytest.raises(ProblemError, match=r"of the problem depends on time; take the problem at one time"):
        discretize(stated)
    bound = stated.at_time(0.5)
    assert bound.time_dependent == frozenset()
    assert bound.at_time(7.0) is bound
    one, other = discretize(bound), discretize(problem(**still))
    np.testing.assert_allclose(one.load, other.load, atol=1e-15)
    np.testing.assert_allclose(one.offset, other.offset, atol=1e-15)
    assert one.field is not None
    assert other.field is not None
    np.testing.assert_allclose(one.field.prescribed, other.field.prescribed, atol=1e-15)
    r = np.array([[0.3, 0.2]] * one.contact_points)
    np.testing.assert_allclose(one.law.value(r), other.law.value(r))
    assert np.array_equal(discretize(stated.at_time(2.0)).load, one.load) is (part in ("gap", "law"))


def test_a_problem_without_time_is_itself() -> None:
    plain = problem()
    assert plain.time_dependent == frozenset()
    assert plain.at_time(3.0) is plain
    with pytest.raises(ProblemError, match="the time is nan; give a finite number"):
        plain.at_time(float("nan"))
    with pytest.raises(ProblemError, match="the time is 'now'"):
        plain.at_time("now")  # type: ignore[arg-type]


def test_supports_at_a_time_count_as_moved() -> None:
    """Also at a time at which they are at zero: the matrices serve every time."""
    stated = problem(supports={"left": Fixed(x=Formula("0.1 * t"), y=0.0), "right": Clamped()})
    assert len(body_family(stated.at_time(0.0)).moved) == 10
    assert len(body_family(problem(supports={"left": Fixed(x=0.0)})).moved) == 0


def test_everything_at_once() -> None:
    parts = {part: CHANGES[name][0] for name, part in (("traction", "load"), ("fixed", "supports"))}
    both = problem(**parts["load"], **parts["supports"], contact={"bottom": Contact(Compliance(ramp), gap=ramp)})
    assert both.time_dependent == {"load", "supports", "gap", "law"}
    with pytest.raises(ProblemError, match="a load and a support and a gap and a law of the problem depend on time"):
        discretize(both)


@pytest.mark.parametrize(
    "law",
    [
        Compliance(ramp),
        Adhesive(1.0, Formula("1 + t"), 0.5),
        Friction(CoulombBound(Formula("0.1 * t"))),
        SlipWeakening(ramp),
        SlipWeakening(1.0, static=Formula("1 + t")),
        Friction(ramp, SlipWeakening(1.0).profile),
    ],
    ids=lambda law: type(law).__name__,
)
def test_parameters_of_laws(law: Any) -> None:
    assert law_depends_on_time(law)
    bound = law_at_time(law, 0.5)
    assert not law_depends_on_time(bound)
    assert law_at_time(bound, 1.0) is bound
    bound.at(X)


def test_functions_of_the_displacement_are_no_functions_of_time() -> None:
    from hemivar.laws import FunctionLaw, PenetrationBound

    law = FunctionLaw(derivative=lambda r, k=2.0: k * r)
    friction = Tresca(PenetrationBound(lambda s: np.abs(s)))
    assert not law_depends_on_time(law)
    assert not law_depends_on_time(friction)


def test_pickling() -> None:
    stated = problem(contact={"bottom": Contact(Compliance(2.0), gap=ramp)})
    again = pickle.loads(pickle.dumps(stated.at_time(0.5)))
    np.testing.assert_array_equal(discretize(again).offset, discretize(stated.at_time(0.5)).offset)


def _traction(value: Traction) -> ContactProblem:
    return problem(tractions={"top": value})


BAD: dict[str, tuple[Callable[[], Any], str]] = {
    "elasticity": (lambda: Material.lame(ramp, 1.0), "material constant lam depends on time, which it cannot"),
    "young": (lambda: Material.young(1.0, Formula("0.1 * t")), "material constant nu depends on time"),
    "tensor": (lambda: Material.tensor(lambda x, t: np.eye(3)), "elasticity matrix depends on time"),
    "density": (lambda: Material.lame(1.0, 1.0, density=ramp), "density depends on time"),
    "viscosity": (lambda: Material.lame(1.0, 1.0, viscosity=(ramp, 1.0)), "viscosity of a material depends on time"),
    "branch": (lambda: Branch(lame=(1.0, Formula("t")), time=1.0), "branch of a material depends on time"),
    "bedding": (lambda: problem(bedding=ramp), "bedding depends on time"),
    "obstacle": (
        lambda: Contact(Compliance(1.0), obstacle=SignedDistance(Formula("y + t"))),
        "signed distance of an obstacle depends on time.*give a gap that depends on t",
    ),
    "shape of a load": (
        lambda: discretize(_traction(lambda x, t: np.ones(7)).at_time(0.5)),
        r"tractions\['top'\]: the callable returned shape \(7,\)",
    ),
    "load that is not finite": (
        lambda: discretize(_traction(lambda x, t: x + np.inf * t).at_time(1.0)),
        r"tractions\['top'\]: the callable returned",
    ),
    "damping without time": (
        lambda: discretize(problem(contact={"bottom": Contact(Compliance(1.0), damping=Compliance(1.0))})),
        "contact 'bottom' has damping, which means something in time only",
    ),
    "damping that is no law": (
        lambda: Contact(Compliance(1.0), damping=2.0),  # type: ignore[arg-type]
        "damping is .*; give a law of the rate",
    ),
    "damping that is friction": (
        lambda: Contact(Compliance(1.0), damping=Tresca(1.0)),  # type: ignore[arg-type]
        "damping is .*; give a law of the rate",
    ),
    "memory that is none": (
        lambda: Contact(Compliance(1.0), memory=(3.0,)),
        "memory holds .*; give a list of internal variables",
    ),
    "memory that is a class": (
        lambda: Contact(Compliance(1.0), memory=(Secant,)),  # type: ignore[arg-type]
        "memory holds the class Secant",
    ),
    "memory by name": (lambda: Contact(Compliance(1.0), memory="secant"), "memory holds"),  # type: ignore[arg-type]
}


@pytest.mark.parametrize("name", BAD)
def test_refused_in_words(name: str) -> None:
    make, message = BAD[name]
    with pytest.raises(ProblemError, match=message):
        make()


def test_memory_is_refused_where_nothing_evolves() -> None:
    stated = problem(contact={"bottom": Contact(Compliance(1.0), memory=[Secant()])})
    assert isinstance(stated.contact["bottom"].memory, tuple)
    with pytest.raises(ProblemError, match="contact 'bottom' has memory, which means something in time only"):
        discretize(stated)
    plain = replace(stated, contact={"bottom": Contact(Compliance(1.0))})
    one, other = discretize(stated, evolving=True), discretize(plain)
    assert abs(one.stiffness - other.stiffness).max() == 0.0
    assert np.array_equal(one.load, other.load)


def test_damping_may_depend_on_time() -> None:
    contact = Contact(Compliance(1.0), damping=Compliance(Formula("1 + t")))
    assert contact.time_dependent == {"law"}
    damping = contact.at_time(2.0).damping
    assert damping is not None
    np.testing.assert_allclose(damping.at(X).derivative(np.array([0.5])), 1.5)


def test_rollers_do_not_move() -> None:
    stated = problem(supports={"left": Roller()}, body_force=lambda x, t: t * np.ones_like(x))
    assert stated.at_time(1.0).supports["left"] is stated.supports["left"]
