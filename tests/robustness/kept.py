"""Hostile files of kept work: checkpoints, lines of studies and sweeps, frames; broken, forged or replaced."""

from __future__ import annotations

import hashlib
import io
import json
import random
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tests.robustness.case import Case
from tests.robustness.limited import run_limited
from tests.robustness.toml import leaves, put, spoilt, strange_value

if TYPE_CHECKING:
    from tests.robustness.oracle import Verdict

__all__ = ["examine_kept", "kept_case"]

_PROBLEM = """\
[mesh]
rectangle = [2.0, 1.0]
cells = [{cells}, 1]
[material]
lame = [4.0, 4.0]
density = 1.0
branches = [{{ lame = [1.0, 1.0], time = 0.5 }}]
[loads]
body = [0.0, -0.8]
[supports]
left = "clamped"
[contact.bottom]
normal = {{ law = "survey", q_max = 0.3, p_const = 2.0 }}
friction = {{ law = "tresca", bound = 0.05 }}
[time]
until = 0.3
step = 0.05
inertia = true
"""
_MARCH = ["march", "problem.toml", "--checkpoint", "kept.ckpt", "--minutes", "0", "--json", "answer.json"]
#: What is done, without and with what is kept, and the file that holds what it found.
_WORK: dict[str, tuple[list[str], list[str], str]] = {
    "kept.ckpt": ([*_MARCH, "--until", "0.15"], [*_MARCH, "--resume", "--max-time", "10"], "answer.json"),
    "sweep.jsonl": (
        ["sweep", "problem.toml", "--set", "contact.bottom.normal.q_max=0.1:0.4:3", "--starts", "2"],
        ["--checkpoint", "sweep.jsonl", "--csv", "answer.csv"],
        "answer.csv",
    ),
    "study.jsonl": (
        ["study", "problem.toml", "--refine", "1"],
        ["--checkpoint", "study.jsonl", "--csv", "answer.csv"],
        "answer.csv",
    ),
}
_SPECIAL = ["fifo", "folder", "socket", "unreadable", "sparse 1000000", "sparse 100000000000", "link problem.toml"]
#: Of each file: what it holds, what is found without it, and the same file of another problem.
_MADE: dict[str, tuple[bytes, bytes, bytes]] = {}


def kept_case(rng: random.Random, name: str) -> Case:
    """A command that goes on from a file that is not what it should be."""
    if rng.random() < 0.2:
        return _frames(rng, name)
    file = rng.choice(list(_WORK))
    first, then, found = _WORK[file]
    content, answer, other = _made(file)
    files = {"problem.toml": _PROBLEM.format(cells=2).encode()}
    special: dict[str, str] = {}
    forge = _forged_checkpoint if file.endswith(".ckpt") else _forged_lines
    kind = rng.choices(["damaged", "forged", "cut", "swapped", "replaced"], [20, 50, 10, 8, 12])[0]
    note = kind
    match kind:
        case "damaged":
            content, note = spoilt(content, rng)
        case "forged":
            content, note = forge(content, rng)
        case "cut":
            content = content[: rng.randrange(len(content))]
        case "swapped":
            kept = rng.choice([other, _made(rng.choice(list(_WORK)))[0]])
            content = kept
        case _:
            note = special[file] = rng.choice(_SPECIAL)
    if file not in special:
        files[file] = content
    if kind in ("damaged", "cut"):
        files["expected"] = answer
    words = then if file.endswith(".ckpt") else [*first, *then]
    if kind == "replaced" and rng.random() < 0.3:
        words = [word for word in words if word != "--resume"]
    note = f"{file}: {kind}, {note}"[:200]
    return Case(name, "kept", note, words, files, special, answer=found, rewritten=(file,))


def examine_kept(folder: Path, case: Case, verdict: Verdict) -> None:
    """What went on from a damaged file, and was not refused, found what it finds without it."""
    if "expected" in case.files and case.answer is not None:
        found = (folder / case.answer).read_bytes()
        verdict.demand(found == case.files["expected"], "what went on from a damaged file found something else")


def _frames(rng: random.Random, name: str) -> Case:
    """A march whose frames fall on what is there already."""
    frame = f"run/run_{rng.choice([0, 1, 2, 777]):06d}.vtu"
    kind = rng.choice(["fifo", "folder", "socket", "read-only", "link ../problem.toml", "link ../run.pvd", "bytes"])
    files, special = {"problem.toml": _PROBLEM.format(cells=2).encode(), "run/x": b""}, {}
    if kind == "bytes":
        files[frame] = rng.randbytes(100)
    else:
        if kind == "read-only":
            files[frame] = b"old"
        special[frame] = kind
    words = ["march", "problem.toml", "--fields", "run.pvd", "--until", "0.2"]
    if rng.random() < 0.3:
        files["run.pvd"] = (
            f'<VTKFile type="Collection"><Collection><DataSet timestep="0" file="{frame}"/></Collection></VTKFile>'
        ).encode()
        words = ["animate", "run.pvd", "-o", "film.gif", "--frames", "2"]
    return Case(name, "kept", f"{words[0]}, {frame}: {kind}", words, files, special, rewritten=(frame, "run.pvd"))


# ---- forged, with digests that are right -----------------------------------------------------------------------


def _forged_checkpoint(content: bytes, rng: random.Random) -> tuple[bytes, str]:
    from hemivar.basics.packed import read_arrays, write_arrays

    arrays, _ = read_arrays(content)
    head: Any = json.loads(arrays["head"].tobytes())
    if rng.random() < 0.5:
        path = rng.choice(leaves(head))
        new = strange_value(rng)
        head, note = put(head, path, new), f"{'.'.join(map(str, path))} = {str(new)[:50]!r}"
    else:
        which = rng.choice([name for name in arrays if name != "head"])
        change, note = rng.choice(_CHANGES)
        arrays[which], note = change(arrays[which]), f"{which} {note}"
    arrays["head"] = np.frombuffer(json.dumps(head).encode("utf-8", "surrogatepass"), dtype=np.uint8)
    stream = io.BytesIO()
    write_arrays(stream, arrays)
    return stream.getvalue(), note


def _small(a: Any) -> Any:
    with np.errstate(invalid="ignore"):  # what is not finite, or huge
        return np.asarray(a).astype(np.int8)


_CHANGES: list[tuple[Callable[[Any], Any], str]] = [
    (lambda a: np.full_like(a, np.nan, dtype=float), "nan"),
    (lambda a: np.full_like(a, np.inf, dtype=float), "infinite"),
    (lambda a: np.full_like(a, 1e300, dtype=float), "huge"),
    (lambda a: np.full_like(a, 1e-300, dtype=float), "tiny"),
    (lambda a: -np.asarray(a, dtype=float), "with the other sign"),
    (lambda a: np.zeros((0,)), "empty"),
    (lambda a: np.zeros((1,) * 40), "of 40 axes"),
    (lambda a: a.ravel(), "flat"),
    (lambda a: a[..., None], "with one axis more"),
    (lambda a: np.asarray(a)[:1], "too short"),
    (lambda a: np.repeat(a, 2, axis=0) if np.ndim(a) else np.zeros(2), "too long"),
    (_small, "of small integers"),
    (lambda a: np.asarray(a).astype(bool), "of truth values"),
    (lambda a: np.asarray(a).astype(np.float16), "of half precision"),
    (lambda a: np.zeros((1000, 1000)), "of a million numbers"),
]


def _forged_lines(content: bytes, rng: random.Random) -> tuple[bytes, str]:
    head, *lines = content.decode().splitlines()
    if rng.random() < 0.2:
        first = json.loads(head)
        path = rng.choice(leaves(first))
        new = strange_value(rng)
        head, note = json.dumps(put(first, path, new)), f"head, {path} = {str(new)[:50]!r}"
    else:
        at = rng.randrange(len(lines))
        line = json.loads(lines[at])
        line.pop("check")
        path = rng.choice(leaves(line))
        new = strange_value(rng)
        line = put(line, path, new)
        if rng.random() < 0.1:
            line.pop(rng.choice(list(line)))
        text = json.dumps(line)
        check = hashlib.sha256(text.encode("utf-8", "surrogatepass")).hexdigest()[:16]
        lines[at] = f'{{"check": "{check}", {text[1:]}'
        note = f"{'.'.join(map(str, path))} = {str(new)[:50]!r}"
    if rng.random() < 0.2:
        lines = rng.choice([lines * 2, lines[::-1], lines[1:], [*lines, lines[0]]])
        note += ", lines in disorder"
    return ("\n".join([head, *lines]) + "\n").encode("utf-8", "surrogatepass"), note


# ---- what is kept of work that nobody disturbed ------------------------------------------------------------------


def _made(file: str) -> tuple[bytes, bytes, bytes]:
    if file not in _MADE:
        first, then, found = _WORK[file]
        checkpoint = file.endswith(".ckpt")
        commands = [first, then] if checkpoint else [[*first, *then]]
        kept, answer = _run(file, found, commands, 2)
        other, _ = _run(file, found, commands, 3)
        _MADE[file] = kept, answer, other
    return _MADE[file]


def _run(file: str, found: str, commands: list[list[str]], cells: int) -> tuple[bytes, bytes]:
    """What a command keeps, and what it finds in the end."""
    kept = b""
    with tempfile.TemporaryDirectory() as scratch:
        place = Path(scratch) / "work"
        place.mkdir()
        (place / "problem.toml").write_text(_PROBLEM.format(cells=cells))
        for words in commands:

            def work(words: list[str] = words) -> int:
                from hemivar.cli import main

                return main(words)

            run = run_limited(work, place)
            if run.code != 0:
                raise RuntimeError(f"{words} ended: {run}")
            kept = kept or (place / file).read_bytes()
        return kept, (place / found).read_bytes()
