"""``--set key=value``: what is put into a problem file, and what is refused."""

from __future__ import annotations

from pathlib import Path

import pytest

from hemivar.errors import ProblemError
from hemivar.files.changes import Change, changed, read_change
from hemivar.files.problem_file import parse_problem_file, read_problem_file
from hemivar.files.sample import SAMPLE

DATA = {
    "mesh": {"cells": [4, 4]},
    "contact": {"bottom": {"normal": {"law": "survey", "q_max": 0.3}, "friction": "none"}},
    "loads": {"body": [0.0, -1.0]},
}


def test_a_value_goes_where_its_key_says_and_nowhere_else() -> None:
    made = changed(DATA, [read_change("contact.bottom.normal.q_max = 0.7")], "file")
    assert made["contact"]["bottom"]["normal"] == {"law": "survey", "q_max": 0.7}  # type: ignore[index]
    assert {**made, "contact": 0} == {**DATA, "contact": 0}
    assert DATA["contact"]["bottom"]["normal"]["q_max"] == 0.3  # type: ignore[index]


@pytest.mark.parametrize(
    ("text", "path", "value"),
    [
        ("loads.body.1=-2", ("loads", "body", "1"), -2),
        ("mesh.cells=[2, 3]", ("mesh", "cells"), [2, 3]),
        ('title="a = b"', ("title",), "a = b"),
        ('contact."a b".gap=1e-3', ("contact", "a b", "gap"), 1e-3),
        ("solver.rtol=1e-6", ("solver", "rtol"), 1e-6),
        ('contact.bottom.normal={law="survey"}', ("contact", "bottom", "normal"), {"law": "survey"}),
    ],
)
def test_keys_and_values_are_those_of_toml(text: str, path: tuple[str, ...], value: object) -> None:
    change = read_change(text)
    assert (change.path, change.value) == (path, value)


def test_entries_of_lists_and_tables_that_are_left_out() -> None:
    made = changed(DATA, [read_change("loads.body.1=-2"), read_change("solver.rtol=1e-6")], "file")
    assert made["loads"] == {"body": [0.0, -2]}
    assert made["solver"] == {"rtol": 1e-6}
    assert changed(DATA, [Change("loads.traction.top", [0, 1])], "f")["loads"]["traction"] == {"top": [0, 1]}  # type: ignore[index]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("contact.bottom", "write KEY=VALUE"),
        ("contact..bottom=1", "not a key"),
        ("a\nb=1", "not a key"),
        ("=1", "not a key"),
        ("title=plain", "--set 'title=\"plain\"'"),
        ("mesh.cells=[1", "not valid TOML"),
        ("mesh.cells=1\nmesh.refine=2", "not valid TOML"),
        ("contact.botom.normal.q_max=1", "there is no table 'botom' in [contact]; did you mean 'bottom'?"),
        ("contct.bottom.gap=1", "there is no table 'contct'; did you mean 'contact'?"),
        ("contact.bottom.friction.bound=1", "is the text 'none', not a table"),
        ("loads.body.2=1", "is a list of 2; name an entry by a number from 0 to 1"),
        ("loads.body.x=1", "is a list of 2"),
        ("tilte=1", "there is no key 'tilte'"),
    ],
)
def test_what_makes_no_sense_is_refused_with_its_key(text: str, words: str) -> None:
    with pytest.raises(ProblemError) as caught:
        changed(DATA, [read_change(text)], "file.toml")
    assert words in str(caught.value)
    assert "--set" in str(caught.value)


def test_a_wrong_value_is_refused_as_if_it_stood_in_the_file(tmp_path: Path) -> None:
    file = tmp_path / "problem.toml"
    for key, value, line, wrong in (
        ("contact.bottom.normal.q_max", "-1.0", "q_max = 0.3", "q_max = -1.0"),
        ("contact.bottom.normal.q_mx", "1.0", 'law = "survey"', 'law = "survey", q_mx = 1.0'),
        ("material.lame", '"soft"', "lame = [4.0, 4.0]", 'lame = "soft"'),
        ("mesh.refin", "1", "cells = [32, 32]", "cells = [32, 32]\nrefin = 1"),
    ):
        file.write_text(SAMPLE)
        with pytest.raises(ProblemError) as by_change:
            read_problem_file(file, [read_change(f"{key}={value}")])
        file.write_text(SAMPLE.replace(line, wrong, 1))
        with pytest.raises(ProblemError) as by_hand:
            read_problem_file(file)
        assert str(by_change.value) == str(by_hand.value)


def test_a_file_with_changes_is_the_file_that_says_so() -> None:
    by_change = parse_problem_file(SAMPLE, changes=[Change("mesh.cells", [4, 2]), Change("loads.body.0", 0.25)])
    by_hand = parse_problem_file(SAMPLE.replace("[32, 32]", "[4, 2]").replace("[-0.8, -0.8]", "[0.25, -0.8]"))
    assert by_change.problem.mesh.points.tolist() == by_hand.problem.mesh.points.tolist()
    assert by_change.problem.body_force == by_hand.problem.body_force  # type: ignore[union-attr]
    assert [str(change) for change in by_change.changes] == ["mesh.cells = [4, 2]", "loads.body.0 = 0.25"]


def test_one_number_in_place_of_a_vector_names_its_components() -> None:
    for key in ("loads.body", "loads.traction.top"):
        with pytest.raises(ProblemError, match=rf"one of them alone is {key}\.0"):
            parse_problem_file(SAMPLE, Path(), "p.toml", changes=[Change(key, 2.0)])
