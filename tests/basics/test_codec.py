"""Dataclasses as JSON and arrays: every bit comes back, and what is no such value is refused."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any

import numpy as np
import pytest

from hemivar.basics.codec import COMPUTED, array_of_text, decoded, encoded, text_of_array
from hemivar.basics.types import Array


class Colour(StrEnum):
    RED = "red"
    BLUE = "blue"


@dataclass(frozen=True, eq=False)
class Inner:
    number: float
    place: Array | None = None
    known: Array | None = field(default=None, metadata=COMPUTED)


@dataclass(frozen=True, eq=False)
class Outer:
    name: str
    count: int
    sure: bool
    colour: Colour
    inner: Inner
    others: tuple[Inner, ...]
    pair: tuple[int, str]
    memory: Mapping[str, Mapping[str, Array]]
    perhaps: float | None


def outer(**change: Any) -> Outer:
    some = np.random.default_rng(0).standard_normal(5) / 3.0
    memory = {"a.b": {"c": some[:2]}, "a": {"b.c": some[2:], "": np.zeros((0, 2))}}
    given = {
        "name": "x", "count": 3, "sure": True, "colour": Colour.BLUE, "inner": Inner(math.pi, some, some),
        "others": (Inner(math.nan), Inner(-math.inf, np.arange(6).reshape(2, 3))), "pair": (1, "y"), "memory": memory,
        "perhaps": 5e-324,
    }  # fmt: skip
    return Outer(**(given | change))


def through_json(value: object) -> tuple[Any, list[Any]]:
    arrays: list[Any] = []
    return json.loads(json.dumps(encoded(value, arrays), allow_nan=False)), arrays


def test_every_bit_comes_back() -> None:
    for value in (outer(), outer(perhaps=None), outer(others=()), outer(perhaps=-0.0)):
        head, arrays = through_json(value)
        back = decoded(Outer, head, arrays)
        again, twice = through_json(back)
        assert again == head
        assert len(arrays) == len(twice) > 0
        for one, other in zip(arrays, twice, strict=True):
            assert (one.dtype, one.shape, one.tobytes()) == (other.dtype, other.shape, other.tobytes())
        assert back.colour is Colour.BLUE
        assert back.memory["a.b"].keys() == {"c"}
        assert back.memory["a"].keys() == {"b.c", ""}
        assert back.inner.known is None  # computed again
        assert repr(back.perhaps) == repr(value.perhaps)


@pytest.mark.parametrize(
    "change",
    [
        {"name": 3}, {"count": True}, {"count": 1.0}, {"count": "1"}, {"sure": 1}, {"colour": "green"}, {"inner": None},
        {"inner": {}}, {"inner": {"number": 1.0, "place": None, "gold": 1}}, {"inner": {"number": True, "place": None}},
        {"inner": {"number": "long", "place": None}}, {"inner": {"number": 1.0, "place": 99}},
        {"inner": {"number": 1.0, "place": -1}}, {"inner": {"number": 1.0, "place": True}},
        {"inner": {"number": 1.0, "place": [1.0]}}, {"others": {}}, {"others": [1]}, {"pair": [1]},
        {"pair": [1, "y", 2]}, {"memory": []}, {"memory": {"a": 1}}, {"perhaps": []}, {"gold": 1},
    ],
)  # fmt: skip
def test_what_is_no_such_value_is_refused(change: dict[str, object]) -> None:
    head, arrays = through_json(outer())
    with pytest.raises((ValueError, KeyError, TypeError)):
        decoded(Outer, head | change, arrays)


def test_arrays_as_text() -> None:
    array = np.random.default_rng(1).standard_normal((3, 2))
    array[0, 0], array[1, 1] = np.nan, -0.0
    assert array_of_text(json.loads(json.dumps(text_of_array(array)))).tobytes() == array.tobytes()
    for wrong in ({"shape": [-1]}, {"shape": [7]}, {"shape": [2.0]}, {"shape": "6"}, {"data": "?"}, {"data": ""}):
        with pytest.raises((ValueError, KeyError, TypeError)):
            array_of_text(text_of_array(array) | wrong)
