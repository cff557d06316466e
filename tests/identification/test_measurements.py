"""Measured curves as files: what is read, and what is refused in one sentence."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from hemivar.errors import HemivarError
from hemivar.identification import Measurements, read_measurements

HEAD = "supports.top.y,support.top.force.y\n"


def test_a_file_is_read(tmp_path: Path) -> None:
    path = tmp_path / "curve.csv"
    path.write_text("# a test of Tuesday\n" + HEAD + "0.01,1.5\n0.02,2.5\n")
    found = read_measurements(path)
    np.testing.assert_array_equal(found.inputs["supports.top.y"], [0.01, 0.02])
    np.testing.assert_array_equal(found.values, [[1.5], [2.5]])
    assert found.row(1) == {"supports.top.y": 0.02}


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "a head and a row"),
        (HEAD, "a head and a row"),
        ("0.1,0.2\n0.3,0.4\n", "names of the columns"),
        (HEAD.replace(",", ";") + "0,1;0,2\n", "commas between columns, points in numbers"),
        (HEAD + "0,1,0,2\n", "commas between columns, points in numbers"),
        (HEAD + '"0,1","0,2"\n', "commas between columns, points in numbers"),
        (HEAD + '"' + "x" * 140_000 + "\n", "line 2: this is not a line of a table"),
        (HEAD + "0.1\n", "row 1 has 1 entries, the head 2"),
        (HEAD + "0.1,0.2,0.3\n", "row 1 has 3 entries"),
        (HEAD + "0.1,x\n", "'x' in row 1; give a number"),
        (HEAD + "0.1,1_5\n", "'1_5' in row 1; give a number"),
        (HEAD + "0.1,0x10\n", "'0x10' in row 1; give a number"),
        (HEAD + "0.1,\n", "in row 1; give a number"),
        (HEAD + "0.1,nan\n", r"is nan in row 1"),
        (HEAD + "inf,0.1\n", "is inf in row 1"),
        (HEAD + "0.1,1.0\n0.2,1.0\n", "1 in every row"),
        ("supports.top.y,load\n0.1,0.2\n", "no column of values that were measured"),
        ("support.top.force.y\n0.2\n", "no column of values that were set"),
        ("supports.top.y,support.top.force.y,supports.top.y\n1,2,3\n", "two columns have one name"),
        ('supports.top.y;support.top.force.y\n"0,1";"0,2"\n', r"commas between columns, points in numbers"),
    ],
)
def test_bad_files(text: str, says: str, tmp_path: Path) -> None:
    path = tmp_path / "curve.csv"
    path.write_text(text)
    with pytest.raises(HemivarError, match=says) as caught:
        read_measurements(path)
    assert str(caught.value).startswith(str(path))
    assert "\n" not in str(caught.value)


def test_a_file_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(HemivarError, match=r"no\.csv"):
        read_measurements(tmp_path / "no.csv")


def test_columns_of_different_lengths() -> None:
    with pytest.raises(HemivarError, match=r"different lengths: 'a' 2, 'support.top.force.y' 3"):
        Measurements({"a": np.ones(2)}, {"support.top.force.y": np.arange(3.0)})


def test_a_file_in_utf_16_says_so(tmp_path: Path) -> None:
    path = tmp_path / "curve.csv"
    path.write_text(HEAD + "0.1,0.2\n", encoding="utf-16")
    with pytest.raises(HemivarError, match="UTF-16 text; save it as UTF-8"):
        read_measurements(path)
