"""Checkpoints that were damaged or forged: one sentence each, and nothing goes on from them."""

from __future__ import annotations

import io
import json
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hemivar as hv
from hemivar.basics.packed import read_arrays, write_arrays
from hemivar.basics.types import AnyArray
from hemivar.errors import FileError
from hemivar.evolution import Evolution, March, march
from hemivar.evolution.march import marching
from tests import bodies

Head = dict[str, Any]
Arrays = dict[str, AnyArray]


def evolution() -> Evolution:
    """A clamped body with a branch and wear below it."""
    material = hv.Material.lame(4, 4, branches=[hv.materials.Branch(lame=(2, 2), time=0.5)])
    contact = hv.Contact(normal=hv.Compliance(20.0), friction=hv.Tresca(0.05), memory=hv.laws.Wear(0.01))
    problem = bodies.strip(contact, (4, 2), material=material, body_force=(0.0, -0.5))
    return Evolution(problem)


PLAN: dict[str, Any] = {"step": 0.1}


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """The checkpoint of a march in its third step."""
    kept = hv.evolution.Checkpoint(tmp_path_factory.mktemp("kept") / "run.ckpt", 0.0)
    begun = marching(evolution(), March(0.6, checkpoint=kept, **PLAN))
    for _ in range(4):
        next(begun)
    begun.close()
    return kept.file.read_bytes()


def resumed(path: Path, data: bytes) -> hv.evolution.History:
    path.write_bytes(data)
    return march(evolution(), 0.5, checkpoint=hv.evolution.Checkpoint(path), resume=True, **PLAN)


def forged(data: bytes, change: Callable[[Head, Arrays], None]) -> bytes:
    """A checkpoint that was changed, with a digest that is right."""
    arrays, sound = read_arrays(data)
    assert sound
    head = json.loads(arrays["head"].tobytes())
    change(head, arrays)
    arrays["head"] = np.frombuffer(json.dumps(head).encode(), dtype=np.uint8)
    stream = io.BytesIO()
    write_arrays(stream, arrays)
    return stream.getvalue()


def put(name: str, value: object) -> Callable[[Head, Arrays], None]:
    """Put a value into the head, by the path of its keys."""

    def change(head: Head, _: Arrays) -> None:
        *path, last = name.split("/")
        place: Any = head
        for key in path:
            place = place[int(key) if isinstance(place, list) else key]
        place[int(last) if isinstance(place, list) else last] = value

    return change


def array(head: Head, path: str) -> str:
    """The name in the file of the array that stands at a path of the head."""
    place: Any = head
    for key in path.split("/"):
        place = place[int(key) if isinstance(place, list) else key]
    return f"array {place}"


def entry(path: str, value: object) -> Callable[[Head, Arrays], None]:
    """Make the first entry of an array another one, or its whole by a function."""

    def change(head: Head, arrays: Arrays) -> None:
        name = array(head, path)
        if callable(value):
            arrays[name] = value(arrays[name])
        else:
            arrays[name].ravel()[0] = value

    return change


def without(path: str) -> Callable[[Head, Arrays], None]:
    """Take an array out of the file."""

    def change(head: Head, arrays: Arrays) -> None:
        arrays.pop(array(head, path))

    return change


def renamed_columns(change: Callable[[list[str]], object]) -> Callable[[Head, Arrays], None]:
    """Name the columns of the table otherwise."""
    return lambda head, _: head["state"].update(columns=change(head["state"]["columns"]))


def test_a_checkpoint_that_is_as_it_was_is_gone_on_from(tmp_path: Path, written: bytes) -> None:
    assert resumed(tmp_path / "run.ckpt", forged(written, lambda head, arrays: None)).finished


def test_every_damaged_byte_is_noticed(tmp_path: Path, written: bytes) -> None:
    spots = np.random.default_rng(3).integers(0, len(written), 60)
    for spot in [*spots.tolist(), 0, len(written) - 1]:
        data = bytearray(written)
        data[spot] ^= 0x10
        kept = hv.evolution.Checkpoint(tmp_path / "run.ckpt")
        try:
            arrays, sound = read_arrays(bytes(data))
        except ValueError:
            pass
        else:  # a byte that holds no content, such as a date of the archive
            first = read_arrays(written)[0]
            assert not sound or all(first[name].tobytes() == arrays[name].tobytes() for name in first)
        kept.file.write_bytes(bytes(data))
        with pytest.raises(FileError, match="checkpoint"):
            kept.read("another")
    for end in (0, 1, 100, len(written) // 2, len(written) - 1):
        with pytest.raises(FileError, match="not a checkpoint"):
            resumed(tmp_path / "run.ckpt", written[:end])


def test_content_that_changed_does_not_match_its_digest(tmp_path: Path, written: bytes) -> None:
    archive, stream = zipfile.ZipFile(io.BytesIO(written)), io.BytesIO()
    with zipfile.ZipFile(stream, "w") as out:
        for part in archive.infolist():
            data = bytearray(archive.read(part))
            if part.filename == "array 0.npy":
                data[-1] ^= 1
            out.writestr(part.filename, bytes(data))
    with pytest.raises(FileError, match="does not match its digest"):
        resumed(tmp_path / "run.ckpt", stream.getvalue())


FORGED: dict[str, Callable[[Head, Arrays], None]] = {
    "time is nan": put("state/march/state/time", "nan"),
    "time is a list": put("state/march/state/time", [1]),
    "time before the start": put("state/march/state/time", -1.0),
    "time of no row": put("state/march/state/time", 0.35),
    "index is a text": put("state/march/state/index", "3"),
    "index is negative": put("state/march/state/index", -3),
    "index is missing": lambda head, arrays: head["state"]["march"]["state"].pop("index"),
    "ledger of another kind": put("state/march/state/ledger", {"work": 1.0, "gold": 1.0}),
    "ledger is a number": put("state/march/state/ledger", 3),
    "step is 0": put("state/march/pace/step", 0.0),
    "step of nothing": put("state/march/pace/step", 1e-300),
    "step beyond all": put("state/march/pace/step", 1e300),
    "step is inf": put("state/march/pace/step", "inf"),
    "rung is a float": put("state/march/pace/rung", 0.5),
    "rung is huge": put("state/march/pace/rung", 10**40),
    "pace is short": put("state/march/pace", []),
    "columns are others": put("state/columns/0", "gold"),
    "columns twice": lambda head, arrays: head["state"].update(
        columns=[head["state"]["columns"][0]] * len(head["state"]["columns"])
    ),
    "columns are numbers": lambda head, arrays: head["state"].update(
        columns=list(range(len(head["state"]["columns"])))
    ),
    "a number is an array": put("state/march/state/body/displacement", 0.5),
    "an array that is not there": put("state/march/state/body/displacement", 10**6),
    "an array before the first": put("state/march/state/body/displacement", -1),
    "a field too many": put("state/march/state/gold", 1.0),
    "straight is a number": put("state/march/straight", 1),
    "no frames": put("state/march/frames", []),
    "frame at nan": put("state/march/frames/0/time", "nan"),
    "frame at a text": put("state/march/frames/0/time", "x"),
    "frame of no row": put("state/march/frames/0/time", 0.05),
    "stride is 0": put("state/march/frame_counters", [3, 0]),
    "place is negative": put("state/march/frame_counters", [-1, 1]),
    "branches are more": put("state/march/state/branches", [0, 0]),
    "branches are none": put("state/march/state/branches", []),
    "branches are a text": put("state/march/state/branches", "1"),
    "memory of another boundary": put("state/march/state/memory", {"top": {}}),
    "memory is gone": put("state/march/state/memory", {}),
    "event is a number": put("state/march/events", [[1.0, 7]]),
    "message is a number": put("state/march/messages", [7]),
    "largest is negative": put("state/march/largest", -1.0),
    "farthest is nan": put("state/march/farthest", "nan"),
    "bound is negative": put("state/march/bound", -1.0),
    "heat that is none": put("state/march/state/heat", {"time": 0.0}),
    "place is nan": entry("state/march/state/body/displacement", np.nan),
    "place is shorter": entry("state/march/state/body/displacement", lambda a: a[:-1]),
    "place is longer": entry("state/march/state/body/displacement", lambda a: np.append(a, 0.0)),
    "place is a table": entry("state/march/state/body/displacement", lambda a: a[:, None]),
    "velocity is inf": entry("state/march/state/body/velocity", np.inf),
    "velocity is a number": entry("state/march/state/body/velocity", lambda a: np.array(1.0)),
    "local of another shape": entry("state/march/state/local/displacement", lambda a: a.T),
    "multiplier is nan": entry("state/march/state/multiplier", np.nan),
    "branch is shorter": entry("state/march/state/branches/0", lambda a: a[1:]),
    "branch is missing": without("state/march/state/branches/0"),
    "origin is nan": entry("state/march/origin", np.nan),
    "origin is empty": entry("state/march/origin", lambda a: a[:0]),
    "rows are fewer": entry("state/own", lambda a: a[:-1]),
    "rows are none": entry("state/own", lambda a: a[:0]),
    "rows are narrow": entry("state/own", lambda a: a[:, :3]),
    "rows run back": entry("state/own", lambda a: a[::-1]),
    "steps are nan": entry("state/own", lambda a: np.where(np.arange(a.shape[1]) == 2, np.nan, a)),
    "values are narrow": entry("state/values", lambda a: a[:, 1:]),
    "frame is nan": entry("state/march/frames/0/displacement", np.nan),
    "frame is shorter": entry("state/march/frames/1/velocity", lambda a: a[1:]),
    "frame of another shape": entry("state/march/frames/1/local", lambda a: a[:, :1]),
    "truth values": entry("state/own", lambda a: a > 0),
}


@pytest.mark.parametrize("name", FORGED)
def test_a_forged_checkpoint_is_refused_in_one_sentence(tmp_path: Path, written: bytes, name: str) -> None:
    with pytest.raises(FileError, match=r"run.ckpt: the checkpoint cannot be used \(.+\); start again") as caught:
        resumed(tmp_path / "run.ckpt", forged(written, FORGED[name]))
    assert "\n" not in str(caught.value)


def test_memory_that_is_remembered_is_finite(tmp_path: Path, written: bytes) -> None:
    head = json.loads(read_arrays(written)[0]["head"].tobytes())
    memory = head["state"]["march"]["state"]["memory"]
    path = next(f"state/march/state/memory/{name}/{one}" for name, states in memory.items() for one in states)
    for change in (np.nan, lambda a: a[1:]):
        with pytest.raises(FileError, match="cannot be used"):
            resumed(tmp_path / "run.ckpt", forged(written, entry(path, change)))


@pytest.mark.parametrize("name", ["factor", "pace", "largest", "carried", "step", "moved", "spent", "slid", "pressed"])
def test_what_a_control_of_the_load_remembers_is_finite(tmp_path: Path, name: str) -> None:
    contact = hv.Contact(hv.Adhesive(24.0, 2.4, 6.0, 72.0))
    pulled = Evolution(bodies.column(contact, stiffness=12.0, top=None, tractions={"top": lambda x, t: [0.0, t]}))
    kept = hv.evolution.Checkpoint(tmp_path / "run.ckpt", 0.0)
    plan: dict[str, Any] = {"step": 0.5, "control": "dissipation", "checkpoint": kept}
    begun = marching(pulled, March(4.0, **plan))
    for _ in range(4):
        next(begun)
    begun.close()
    path, data = f"state/march/state/control/{name}", kept.file.read_bytes()
    kept.file.write_bytes(forged(data, entry(path, np.nan) if name in ("slid", "pressed") else put(path, "nan")))
    with pytest.raises(FileError, match=rf"cannot be used \(control.{name} .+\); start again"):
        march(pulled, 4.0, resume=True, **plan)
    kept.file.write_bytes(forged(data, put("state/march/state/control/step", -0.5)))
    with pytest.raises(FileError, match=r"cannot be used \(control.step is -0.5\)"):
        march(pulled, 4.0, resume=True, **plan)
    kept.file.write_bytes(data)
    assert march(pulled, 4.0, resume=True, **plan).finished


def test_no_array_is_larger_than_its_bytes() -> None:
    def packed(name: str, data: bytes, how: int = zipfile.ZIP_STORED) -> bytes:
        stream = io.BytesIO()
        with zipfile.ZipFile(stream, "w", how) as archive:
            archive.writestr(name, data)
        return stream.getvalue()

    huge = io.BytesIO()
    np.lib.format.write_array_header_1_0(huge, {"descr": "<f8", "fortran_order": False, "shape": (1 << 40,)})
    with pytest.raises(ValueError, match="another size than it declares"):
        read_arrays(packed("a.npy", huge.getvalue() + bytes(8)))
    with pytest.raises(ValueError, match="compressed"):
        read_arrays(packed("a.npy", bytes(1 << 20), zipfile.ZIP_DEFLATED))
    objects = io.BytesIO()
    np.lib.format.write_array_header_1_0(objects, {"descr": "|O", "fortran_order": False, "shape": (1,)})
    with pytest.raises(ValueError, match="another size"):
        read_arrays(packed("a.npy", objects.getvalue() + bytes(8)))
