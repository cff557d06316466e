"""A value is checked where it is stated, and nowhere on the way of a solution."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest

import hemivar as hv
from hemivar.mechanics import conditions
from hemivar.mechanics.conditions import DataField


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
