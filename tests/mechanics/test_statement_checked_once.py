"""A value is checked where it is stated, and nowhere on the way of a solution."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest

import hemivar as hv
from hemivar.basics.arguments import one_of
from hemivar.basics.stated import CheckedFields, kept
from hemivar.mechanics import Branch, Cylinder, Pressure, conditions
from hemivar.mechanics.conditions import DataField
from hemivar.mechanics.material_words import PlaneState


def test_a_value_is_checked_once(monkeypatch: pytest.MonkeyPatch) -> None:
    checked: Counter[str] = Counter()
    whole = conditions.check_finite

    def counted(value: object, name: str, most: float = np.inf) -> np.ndarray:
        checked[name] += 1
        return whole(value, name, most)

    monkeypatch.setattr(conditions, "check_finite", counted)
    problem = hv.ContactProblem(
        hv.rectangle((1.0, 1.0), 2), hv.Material.young(10.0, 0.3, density=1.0),
        {"bottom": hv.Contact(hv.Compliance(3.0), hv.Tresca(0.1), gap=0.01)}, {"left": hv.Prescribed((0.0, 0.1))},
        body_force=(0.0, -1.0), tractions={"top": (0.0, -1.0), "right": hv.Pressure(0.1)},
    )  # fmt: skip
    names = [
        "material constant E", "material constant nu", "density", "gap", "belt", "Prescribed(...)", "body_force",
        "tractions['top']", "Pressure(...)", "bedding",
    ]  # fmt: skip
    assert checked == Counter(names)
    hv.solve(problem).raise_for_status()
    assert checked == Counter(names)


def _halved(value: float, name: str, least: float) -> float:
    if value < least:
        raise hv.errors.ProblemError(f"{name} is {value}")
    return value / 2.0


@dataclass(frozen=True)
class _Kept(CheckedFields):
    word: PlaneState = field(default=PlaneState.STRAIN, metadata=kept(one_of, PlaneState))
    half: float | None = field(default=None, metadata=kept(_halved, 1.0, shown="the {}"))
    needed: float = field(default=2.0, metadata=kept(_halved, 1.0))
    free: object = None
    made: object = field(init=False, repr=False, compare=False)


def test_a_field_is_kept_as_its_metadata_say() -> None:
    assert _Kept() == _Kept(PlaneState.STRAIN, None, 2.0)
    assert (_Kept("stress", 3.0).word, _Kept("stress", 3.0).half, _Kept(needed=8.0).needed) == ("stress", 1.5, 4.0)  # type: ignore[arg-type]
    assert isinstance(_Kept("stress").word, PlaneState)  # type: ignore[arg-type]
    for wrong, words in [
        ({"word": "strian"}, "word = 'strian'; choose 'strain', 'stress'"), ({"half": 0.5}, "the half is 0.5"),
    ]:  # fmt: skip
        with pytest.raises(hv.errors.ProblemError, match=words):
            _Kept(**wrong)  # type: ignore[arg-type]
    with pytest.raises(TypeError):  # None is kept where it is the default only
        _Kept(needed=None)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: hv.Contact(hv.Signorini(), obstacle=hv.Plane((0, 0), (0, 1)), normals=0), "normals = 0; choose"),  # type: ignore[arg-type]
        (lambda: Branch(lame=np.array(3.0), time=1.0), r"lame = array\(3.\); give two constants"),  # type: ignore[arg-type]
        (lambda: Branch(lame=(1.0, 1.0), time=10**400), "relaxation time of a branch is 1000.*it must lie between"),
    ],
)
def test_what_is_no_value_gets_a_sentence(make: Callable[[], object], words: str) -> None:
    with pytest.raises(hv.errors.ProblemError, match=words):
        make()


@pytest.mark.parametrize(("value", "components"), [(2.0, 1), ((1.0, -2.0), 2), (0.0, 2)])
def test_a_value_and_a_function_of_it_are_one_field(value: object, components: int) -> None:
    points = np.random.default_rng(0).random((5, 2))
    shape = (5, components) if components > 1 else (5,)
    expected = np.broadcast_to(np.asarray(value, dtype=float), shape)
    steady = DataField(value, "v", components)
    moving = DataField(lambda x, t: t * np.broadcast_to(np.asarray(value), shape), "v", components)
    np.testing.assert_array_equal(steady.at(points), expected)
    np.testing.assert_array_equal(steady.at(points, 3.0), expected)
    np.testing.assert_array_equal(moving.at(points, 3.0), 3.0 * expected)
    with pytest.raises(hv.errors.ProblemError, match="v depends on time, and no time is given"):
        moving.at(points)


@pytest.mark.parametrize(
    ("condition", "values"),
    [
        (hv.Fixed(y=0.5), {"y": 0.5}), (hv.Clamped(), {}), (hv.Prescribed((0.0, 1.0)), {"value": (0.0, 1.0)}),
        (Pressure(2.0), {"value": 2.0}), (3.0, {"": 3.0}),
    ],
)  # fmt: skip
def test_what_a_condition_prescribes(condition: Any, values: dict[str, object]) -> None:
    assert conditions.stated_values(condition) == values
    assert conditions.condition_at_time(condition, 2.0) is condition


def test_a_condition_at_a_time_keeps_what_does_not_move() -> None:
    moved = conditions.condition_at_time(hv.Fixed(x=lambda x, t: t * x[:, 0], y=0.5), 2.0)
    assert moved.y == 0.5
    np.testing.assert_array_equal(moved.x(np.array([[3.0, 0.0]])), [6.0])  # type: ignore[operator, misc, arg-type, call-arg]


def test_a_cylinder_has_a_radius() -> None:
    with pytest.raises(hv.errors.ProblemError, match=r"Cylinder: radius is -1\.0; give one positive number"):
        Cylinder((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), -1.0)
