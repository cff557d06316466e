"""What is refused when it is stated: numbers beyond the range, obstacles inside the body, dependent midpoints."""

from __future__ import annotations

import warnings

import pytest

from hemivar.errors import ProblemError
from hemivar.fem import discretize
from hemivar.files.problem_file import parse_problem_file

HEAD = "[mesh]\nrectangle = [1.0, 1.0]\ncells = [4, 4]\n"


TAIL = '[loads]\nbody = [0.0, -0.8]\n[supports]\nleft = "clamped"\n[contact.bottom]\nnormal = { law = "signorini" }\n'


SOFT = "[material]\nlame = [4.0, 4.0]\n"


HUGE = ("1e308", "-1e308", "1e200", "1e155")


TINY = ("5e-324", "1e-308", "1e-200")


@pytest.mark.parametrize(
    "text",
    [
        *[HEAD + f"[material]\nlame = [4.0, {n}]\n" + TAIL for n in HUGE + TINY],
        *[HEAD + f"[material]\nlame = [{n}, 4.0]\n" + TAIL for n in HUGE],
        *[HEAD + f'[material]\nlame = [{n}, {n}]\nplane = "stress"\n' + TAIL for n in HUGE + TINY],
        *[HEAD + f"[material]\nyoung = {n}\npoisson = 0.3\n" + TAIL for n in HUGE + TINY],
        *[HEAD + f'[material]\nlame = [4.0, "{n} * (1 + x)"]\n' + TAIL for n in HUGE + TINY],
        HEAD + "[material]\nyoung = 1.0\npoisson = 0.49999999999999994\n" + TAIL,
        *[HEAD + f"[material]\ntensor = [[{n}, 0, 0], [0, {n}, 0], [0, 0, {n}]]\n" + TAIL for n in HUGE + TINY],
        *[HEAD + SOFT + TAIL + f"gap = {n}\n" for n in HUGE],
        *[HEAD + SOFT + TAIL + f'gap = "{n} * x"\n' for n in HUGE],
        *[HEAD + SOFT + TAIL.replace('"clamped"', f"{{ displacement = [{n}, {n}] }}") for n in HUGE],
        *[
            HEAD + SOFT + TAIL + f'obstacle = {{ {shape} }}\nnormals = "{normals}"\n'
            for n in HUGE
            for normals in ("obstacle", "body")
            for shape in (
                f"sphere = {{ center = [0.5, -2.0], radius = {n} }}",
                f"sphere = {{ center = [0.5, {n}], radius = 1.0 }}",
                f"plane = {{ point = [0.0, {n}], normal = [0.0, 1.0] }}",
                f'distance = "{n} * (y + 1)"',
            )
        ],
        HEAD + SOFT + TAIL + "obstacle = { sphere = { center = [0.5, -2.0], radius = 1e-308 } }\n",
    ],
)
def test_numbers_beyond_the_range_are_one_sentence_without_warnings(text: str) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(ProblemError) as caught:
            discretize(parse_problem_file(text).problem)
    assert "\n" not in str(caught.value)
    assert "stiffness[" not in str(caught.value)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("a = " + 100_000 * "[" + 100_000 * "]", "nested too deeply"),
        ("a = " + 5000 * "{b = " + "1" + 5000 * "}", "nested too deeply"),
        ("a = " + 5000 * "9", "not valid TOML"),
        (HEAD.replace("[4, 4]", 4000 * "9") + SOFT, "cells"),
        (HEAD + "refine = 1e300\n" + SOFT, "refine: a problem on more|refine.*needs about"),
        (
            HEAD.replace("rectangle = [1.0, 1.0]", 'file = "a\\u0000b.msh"').replace("cells = [4, 4]\n", "") + SOFT,
            "file",
        ),
        (HEAD.replace("[4, 4]", f'"{5000 * "x"}"') + SOFT, "cells"),
    ],
)
def test_texts_of_any_kind_are_one_short_sentence(text: str, words: str) -> None:
    with pytest.raises(ProblemError, match=words) as caught:
        parse_problem_file(text)
    assert "\n" not in str(caught.value)
    assert "\0" not in str(caught.value)
    assert len(str(caught.value)) < 400
