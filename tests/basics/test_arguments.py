"""Values in messages, and arguments that are checked at the call."""

from __future__ import annotations

from collections.abc import Callable
from enum import StrEnum

import numpy as np
import pytest
import scipy.sparse as sp

from hemivar.basics.arguments import answer, expecting, one_line, one_of, positive, quoted
from hemivar.errors import FileError, ProblemError


class Side(StrEnum):
    LEFT = "left"
    RIGHT = "right"


@expecting(size=positive, count=int, share=float, loud=bool, label=str, sides=[Side])
def shown_values(
    size: object = 1.0, count: object = 1, share: object = 0.0, loud: object = True, label: object = "",
    sides: object = (), missing: object = None,
) -> str:  # fmt: skip
    """What was given, shown."""
    return f"{size} {count} {share} {loud} {label}"


@pytest.mark.parametrize(
    "value", ["two\nlines", np.zeros((3, 2, 2)), "x" * 10**5, np.arange(1e5), sp.eye_array(2).tocsr()]
)
def test_values_are_quoted_in_one_short_line(value: object) -> None:
    assert len(quoted(value)) <= 60
    assert "\n" not in quoted(value)


def test_short_values_are_quoted_as_they_are() -> None:
    assert [quoted(value) for value in (3, "newton", [1, 2.5])] == ["3", "'newton'", "[1, 2.5]"]


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"size": 0.0}, "shown_values: size is 0.0; give a positive number"),
        ({"size": np.ones(2)}, "shown_values: size is a ndarray"),
        ({"size": 1e300}, "beyond the range of numbers"),
        ({"count": -1}, "at least 0"),
        ({"count": 1.5}, "whole number"),
        ({"share": 1j}, "shown_values: share is 1j"),
        ({"loud": np.ones(2)}, "give True or False"),
        ({"label": b"x"}, "shown_values: label is b'x'; give a text"),
        ({"sides": ["left"]}, "an entry of shown_values: sides is 'left'"),
    ],
)
def test_arguments_of_other_kinds_are_refused_at_the_call(given: dict[str, object], words: str) -> None:
    with pytest.raises(ProblemError) as error:
        shown_values(**given)
    assert words in str(error.value)


def test_numbers_of_numpy_and_what_is_not_declared_pass() -> None:
    assert shown_values(np.float32(2.0), np.int64(3), -1.5, np.True_, "a", [Side.LEFT], object()) == "2.0 3 -1.5 True a"


@pytest.mark.parametrize("value", [None, "up", np.zeros(3), sp.eye_array(2).tocsr(), np.array(["left"])])
def test_words_of_a_kind_are_texts(value: object) -> None:
    assert one_of("left", "side", Side) is Side.LEFT
    with pytest.raises(ProblemError, match="choose 'left' or 'right'"):
        one_of(value, "side", Side)


def _refused(_: object) -> None:
    raise FileError("the file is gone; give another one")


@pytest.mark.parametrize("function", [lambda: 0.0, lambda x: x[7], lambda x: x.middle, lambda x: 1 // 0, int])
def test_functions_that_do_not_fit_are_told(function: Callable[..., object]) -> None:
    with pytest.raises(ProblemError, match=r"gap: the function cannot be evaluated .*; give one of x") as error:
        answer(function, (np.zeros(3),), "gap", "give one of x")
    assert error.value.__cause__ is not None
    assert answer(lambda x: 2 * x, (3,), "gap", "") == 6
    with pytest.raises(FileError, match="the file is gone"):
        answer(_refused, (0,), "gap", "")


@pytest.mark.parametrize("value", ["two\nlines", 3, None, np.zeros(2)])
def test_labels_stand_in_one_line(value: object) -> None:
    assert one_line("glue, 2 mm", "the name of a law") == "glue, 2 mm"
    with pytest.raises(ProblemError, match="give a text in one line"):
        one_line(value, "the name of a law")
