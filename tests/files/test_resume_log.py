"""Files that keep the parts of long work: what was damaged or forged is refused with the number of its line."""

from __future__ import annotations

import base64
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hemivar as hv
from hemivar.errors import FileError
from hemivar.files import resume_log
from hemivar.files.resume_log import ResumeLog
from hemivar.files.stored_solution import StoredSolution
from hemivar.files.sweep_point import SweepPoint
from tests import bodies

POINT = SweepPoint((2, 0), 0.5, (-1.0, 2.0), ("minimiser", ""), (0.1, 0.2), (3.0, 4.0), True, "all", False)

Data = dict[str, Any]


def solution_line() -> str:
    problem = bodies.square(hv.Compliance(20.0), 2, body_force=(0.0, -0.5))
    return StoredSolution.of(0, hv.solve(problem)).line()


def refused(path: Path, line: str, read: Callable[[str], Any]) -> str:
    """What is said of a file with a line whose check is right."""
    ResumeLog(path, "sweep", "point", "abc", read)
    with path.open("a") as stream:
        stream.write(f'{{"check": "{resume_log._check(line)}", {line[1:]}\n')
    with pytest.raises(FileError) as caught:
        ResumeLog(path, "sweep", "point", "abc", read)
    return str(caught.value)


POINTS: dict[str, Callable[[Data], object]] = {
    "place is a text": lambda data: data.update(place="20"),
    "place is a float": lambda data: data.update(place=[1.5, 0]),
    "place is negative": lambda data: data.update(place=[-1, 0]),
    "place is infinite": lambda data: data.update(place=[float("inf"), 0]),
    "more energies": lambda data: data["energies"].append(1.0),
    "energy is nan": lambda data: data.update(energies=["nan", 1.0]),
    "kinds are a text": lambda data: data.update(kinds="ab"),
    "kinds are numbers": lambda data: data.update(kinds=[1, 2]),
    "forces are a number": lambda data: data.update(forces=1),
    "note is a list": lambda data: data.update(note=[]),
    "exhaustive is a text": lambda data: data.update(exhaustive="yes"),
    "nothing": lambda data: data.clear(),
}


@pytest.mark.parametrize("name", POINTS)
def test_a_point_that_makes_no_sense_is_refused(tmp_path: Path, name: str) -> None:
    data = json.loads(POINT.line())
    POINTS[name](data)
    assert "line 2: this is not a point" in refused(tmp_path / "a.jsonl", json.dumps(data), SweepPoint.of_line)


def test_a_point_comes_back() -> None:
    assert SweepPoint.of_line(POINT.line()) == POINT


def test_brackets_a_million_deep_are_refused(tmp_path: Path) -> None:
    deep = '{"place": ' + "[" * 100_000
    assert "line 2: this is not a point" in refused(tmp_path / "a.jsonl", deep, SweepPoint.of_line)


def packed(*numbers: float) -> Data:
    return {"shape": [len(numbers)], "data": base64.b64encode(np.array(numbers).tobytes()).decode()}


SOLUTIONS: dict[str, Callable[[Data], object]] = {
    "unknown is nan": lambda data: data["arrays"].__setitem__(0, packed(1.0, np.nan)),
    "multiplier is inf": lambda data: data["arrays"].__setitem__(1, packed(np.inf)),
    "shape is negative": lambda data: data["arrays"][0].update(shape=[-1]),
    "shape is huge": lambda data: data["arrays"][0].update(shape=[10**30]),
    "shape is a float": lambda data: data["arrays"][0].update(shape=[2.0]),
    "number is negative": lambda data: data.update(number=-1),
    "number is a text": lambda data: data.update(number="0"),
    "status of nothing": lambda data: data.update(status="splendid"),
    "steps are negative": lambda data: data.update(steps=-3),
    "method is a list": lambda data: data.update(method=[]),
    "bound is a list": lambda data: data.update(error_bound=[]),
    "residual of another kind": lambda data: data.update(residual={"gold": 1.0}),
    "seconds are a text": lambda data: data.update(timings={"iterate": "long"}),
    "arrays are missing": lambda data: data.pop("arrays"),
    "unknowns are missing": lambda data: data.pop("unknowns"),
    "unknowns are nowhere": lambda data: data.update(unknowns=7),
    "unknowns are numbers": lambda data: data.update(unknowns=[1.0]),
}


@pytest.mark.parametrize("name", SOLUTIONS)
def test_a_solution_that_makes_no_sense_is_refused(tmp_path: Path, name: str) -> None:
    data = json.loads(solution_line())
    SOLUTIONS[name](data)
    assert "line 2: this is not a point" in refused(tmp_path / "a.jsonl", json.dumps(data), StoredSolution.of_line)


def test_a_damaged_byte_is_noticed(tmp_path: Path) -> None:
    file = tmp_path / "a.jsonl"
    ResumeLog(file, "sweep", "point", "abc", SweepPoint.of_line).add(POINT)
    assert list(ResumeLog(file, "sweep", "point", "abc", SweepPoint.of_line)) == [POINT]
    whole = file.read_bytes()
    for spot in np.random.default_rng(1).integers(0, len(whole) - 1, 40).tolist():
        data = bytearray(whole)
        data[spot] ^= 1
        file.write_bytes(bytes(data))
        with pytest.raises(FileError, match=r"a\.jsonl"):
            ResumeLog(file, "sweep", "point", "abc", SweepPoint.of_line)
