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
from hemivar.evolution import Evolution, March, march, marching
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


def entry(name: str, value: object) -> Callable[[Head, Arrays], None]:
    """Make the first entry of an array another one, or its whole by a function."""

    def change(_: Head, arrays: Arrays) -> None:
        if callable(value):
            arrays[name] = value(arrays[name])
        else:
            arrays[name].ravel()[0] = value

    return change


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
            if part.filename == "body.displacement.npy":
                data[-1] ^= 1
            out.writestr(part.filename, bytes(data))
    with pytest.raises(FileError, match="does not match its digest"):
        resumed(tmp_path / "run.ckpt", stream.getvalue())


FORGED: dict[str, Callable[[Head, Arrays], None]] = {
    "time is nan": put("time", "nan"),
    "time is a list": put("time", [1]),
    "time before the start": put("time", (-1.0).hex()),
    "time of no row": put("time", (0.35).hex()),
    "index is a text": put("index", "3"),
    "index is negative": put("index", -3),
    "index is missing": lambda head, arrays: head.pop("index"),
    "ledger of another kind": put("ledger", {"work": "0x1p0", "gold": "0x1p0"}),
    "ledger is a number": put("ledger", 3),
    "step is 0": put("pace/0", (0.0).hex()),
    "step of nothing": put("pace/0", (1e-300).hex()),
    "step beyond all": put("pace/0", (1e300).hex()),
    "step is inf": put("pace/0", "inf"),
    "rung is a float": put("pace/1", 0.5),
    "rung is huge": put("pace/1", 10**40),
    "pace is short": put("pace", []),
    "columns are others": put("columns/0", "gold"),
    "columns twice": lambda head, arrays: head.update(columns=[head["columns"][0]] * len(head["columns"])),
    "columns are numbers": lambda head, arrays: head.update(columns=list(range(len(head["columns"])))),
    "no frames": put("frames", []),
    "frame at nan": put("frames/0/0", "nan"),
    "frame of no row": put("frames/0/0", (0.05).hex()),
    "stride is 0": put("frame_place", [3, 0]),
    "place is negative": put("frame_place", [-1, 1]),
    "branches are more": put("branches", 2),
    "branches are none": put("branches", 0),
    "branches are a text": put("branches", "1"),
    "memory of another boundary": put("memory/0/0", "top"),
    "memory is gone": put("memory", []),
    "event is a number": put("events", [["0x1p0", 7]]),
    "message is a number": put("messages", [7]),
    "largest is negative": put("largest", (-1.0).hex()),
    "farthest is nan": put("farthest", "nan"),
    "bound is negative": put("bound", (-1.0).hex()),
    "heat that is none": put("heat", {"time": "0x0p0"}),
    "place is nan": entry("body.displacement", np.nan),
    "place is shorter": entry("body.displacement", lambda a: a[:-1]),
    "place is longer": entry("body.displacement", lambda a: np.append(a, 0.0)),
    "place is a table": entry("body.displacement", lambda a: a[:, None]),
    "velocity is inf": entry("body.velocity", np.inf),
    "velocity is a number": entry("body.velocity", lambda a: np.array(1.0)),
    "local of another shape": entry("local.displacement", lambda a: a.T),
    "multiplier is nan": entry("multiplier", np.nan),
    "branch is shorter": entry("branch.0", lambda a: a[1:]),
    "branch is missing": lambda head, arrays: arrays.pop("branch.0"),
    "origin is nan": entry("origin", np.nan),
    "origin is empty": entry("origin", lambda a: a[:0]),
    "rows are fewer": entry("own", lambda a: a[:-1]),
    "rows are none": entry("own", lambda a: a[:0]),
    "rows are narrow": entry("own", lambda a: a[:, :3]),
    "rows run back": entry("own", lambda a: a[::-1]),
    "steps are nan": entry("own", lambda a: np.where(np.arange(a.shape[1]) == 2, np.nan, a)),
    "values are narrow": entry("rows", lambda a: a[:, 1:]),
    "frame is nan": entry("frame.0.displacement", np.nan),
    "frame is shorter": entry("frame.1.velocity", lambda a: a[1:]),
    "frame of another shape": entry("frame.1.local", lambda a: a[:, :1]),
    "truth values": entry("own", lambda a: a > 0),
}


@pytest.mark.parametrize("name", FORGED)
def test_a_forged_checkpoint_is_refused_in_one_sentence(tmp_path: Path, written: bytes, name: str) -> None:
    with pytest.raises(FileError, match=r"run.ckpt: the checkpoint cannot be used \(.+\); start again") as caught:
        resumed(tmp_path / "run.ckpt", forged(written, FORGED[name]))
    assert "\n" not in str(caught.value)


def test_memory_that_is_remembered_is_finite(tmp_path: Path, written: bytes) -> None:
    names = [name for name in read_arrays(written)[0] if name.startswith("memory.")]
    assert names
    for change in (np.nan, lambda a: a[1:]):
        with pytest.raises(FileError, match="cannot be used"):
            resumed(tmp_path / "run.ckpt", forged(written, entry(names[0], change)))


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
