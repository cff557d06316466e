"""Bad inputs, disks and checkpoints for the engine ``petsc``: one line, an exit code, no traceback, no hang."""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hemivar.basics.types import Array
from tests.problem_files import block_file
from tests.ranks.running import mpirun

pytest.importorskip("petsc4py")
pytest.importorskip("mpi4py")
if shutil.which("mpirun") is None:
    pytest.skip("mpirun is not installed", allow_module_level=True)

pytestmark = pytest.mark.mpi

_HERE = Path(__file__).parent
_LIMIT = 150.0

_BASE = block_file(12)
_COULOMB = _BASE.replace("bound = 0.5", "bound = { coulomb = 0.2 }")

Change = Callable[[Path], object]


@dataclass(frozen=True)
class Case:
    """A run that must fail.

    Attributes
    ----------
    words : str
        In the one line.
    text : str
        The problem.
    prepare : function
        Of the folder, before the run.
    options : tuple
        ``{}`` stands for the folder.
    conditions : dict
        Of ``hostile.py``; rank -1 is the last one.
    code : int
        The exit code.
    kept : tuple
        Files that must be there, and whole, in spite of it.
    """

    words: str
    text: str = _BASE
    prepare: Change = lambda folder: None
    options: tuple[str, ...] = ()
    conditions: dict[str, Any] = field(default_factory=dict)
    code: int = 2
    kept: tuple[str, ...] = ()


# ---- checkpoints -----------------------------------------------------------------------------------------------


@cache
def _good(folder: Path) -> bytes:
    problem, kept = folder / "good.toml", folder / "good"
    problem.write_text(_BASE, encoding="utf-8")
    done = mpirun(2, "-m", "hemivar", "solve", problem, "--engine", "petsc", "-q", "--checkpoint", kept)
    assert done.returncode == 0, done.stderr
    return kept.read_bytes()


def _parts(data: bytes) -> tuple[dict[str, Any], Array]:
    head, _, rest = data.partition(b"\n")
    return json.loads(head), np.frombuffer(rest, dtype="<f8").copy()


def _joined(record: object, numbers: Array) -> bytes:
    return json.dumps(record).encode() + b"\n" + numbers.astype("<f8").tobytes()


def _with_sums(record: dict[str, Any], numbers: Array) -> bytes:
    """A checkpoint whose sums fit, as one would make it who wants to harm."""
    sums = []
    for vector in numbers.reshape(len(record["head"]["sums"]), -1):
        factors = 2 * np.arange(vector.size, dtype=np.uint64) + np.uint64(1)
        sums.append(f"{int((vector.view(np.uint64) * factors).sum(dtype=np.uint64)):016x}")
    return _joined({**record, "head": {**record["head"], "sums": sums}}, numbers)


def _edited(**changes: object) -> Callable[[bytes], bytes]:
    def edit(data: bytes) -> bytes:
        record, numbers = _parts(data)
        head = record["head"] | {key: value for key, value in changes.items() if key != "format"}
        return _joined({"format": changes.get("format", record["format"]), "head": head}, numbers)

    return edit


def _number(value: float, fitting: bool = False) -> Callable[[bytes], bytes]:
    def edit(data: bytes) -> bytes:
        record, numbers = _parts(data)
        numbers[37] = value
        return _with_sums(record, numbers) if fitting else _joined(record, numbers)

    return edit


def _without(key: str) -> Callable[[bytes], bytes]:
    def edit(data: bytes) -> bytes:
        record, numbers = _parts(data)
        del record["head"][key]
        return _joined(record, numbers)

    return edit


_LINE = {"step": 0, "energy": 0.0, "residual": 1.0, "changed": 0, "seconds": 0.0}

#: What is done to a good checkpoint, and what is said about it.
DAMAGE: dict[str, tuple[str, Callable[[bytes], bytes]]] = {
    "truncated": ("damaged", lambda data: data[:-9]),
    "no vectors": ("damaged", lambda data: data.partition(b"\n")[0] + b"\n"),
    "longer": ("damaged", lambda data: data + b"12345678"),
    "empty": ("is not a checkpoint", lambda data: b""),
    "noise": ("is not a checkpoint", lambda data: bytes(range(256)) * 40),
    "one number": ("numbers in it have changed", _number(0.25)),
    "nan": ("numbers in it have changed", _number(np.nan)),
    "nan that fits": ("numbers in it have changed", _number(np.nan, fitting=True)),
    "1e300": ("numbers in it have changed", _number(1e300)),
    "brackets": ("is not a checkpoint", lambda data: b"[" * 100_000),
    "a list": ("is not a checkpoint", lambda data: b"[1, 2]\n"),
    "a text": ("is not a checkpoint", lambda data: b'"format"\n'),
    "a number": ("is not a checkpoint", lambda data: b"17\n"),
    "no history": ("lacks 'history'", _without("history")),
    "empty history": ("is not a checkpoint", _edited(history=[])),
    "other lines": ("is not a checkpoint", _edited(history=[{"step": 1}])),
    "text in a line": ("is not a checkpoint", _edited(history=[{**_LINE, "energy": "low"}])),
    "unknowns a text": ("'unknowns'", _edited(unknowns="one")),
    "unknowns below zero": ("'unknowns'", _edited(unknowns=-4)),
    "built a number": ("'built'", _edited(built=1)),
    "dependent a list": ("'dependent'", _edited(dependent=[])),
    "energy a list": ("'energy'", _edited(energy=[1.0])),
    "energy nan": ("'energy'", _edited(energy=float("nan"))),
    "energy too long": ("too large", _edited(energy=10**400)),
    "stiffening zero": ("'stiffening'", _edited(stiffening=0.0)),
    "sums a number": ("'sums'", _edited(sums=3)),
    "no sums": ("damaged", _edited(sums=[])),
    "many sums": ("damaged", _edited(sums=["00"] * 1000)),
    "nodes true": ("'nodes'", _edited(nodes=True)),
    "other nodes": ("belongs to another problem", _edited(nodes=170)),
    "other load": ("belongs to another problem", _edited(load=1.0)),
    "other marks": ("belongs to another problem", _edited(marks=[1.0])),
    "other version": ("another version", _edited(format=1)),
    "version a text": ("another version", _edited(format="two")),
}


def _damaged(change: Callable[[bytes], bytes]) -> Change:
    return lambda folder: (folder / "kept").write_bytes(change((folder / "good").read_bytes()))


# ---- all cases -------------------------------------------------------------------------------------------------


def _full(name: str) -> Change:
    return lambda folder: (folder / name).symlink_to("/dev/full")


def _pipe(name: str) -> Change:
    return lambda folder: os.mkfifo(folder / name)


def _law_table(folder: Path) -> None:
    (folder / "law.csv").write_text("r,derivative\n0,0\n1,1\n", encoding="utf-8")


def _two_squares(folder: Path) -> None:
    """Two squares of two triangles that no node joins; the left one is clamped."""
    nodes = [(x + shift, y) for shift in (0, 2) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))]
    lines = ["$MeshFormat", "2.2 0 8", "$EndMeshFormat", "$PhysicalNames", "2", '1 1 "left"', '2 2 "body"']
    lines += ["$EndPhysicalNames", "$Nodes", str(len(nodes))]
    lines += [f"{number} {x} {y} 0" for number, (x, y) in enumerate(nodes, start=1)]
    lines += ["$EndNodes", "$Elements", "5", "1 1 2 1 1 4 1"]
    triangles = ("1 2 3", "1 3 4", "5 6 7", "5 7 8")
    lines += [f"{number} 2 2 2 1 {nodes}" for number, nodes in enumerate(triangles, start=2)]
    (folder / "two.msh").write_text("\n".join([*lines, "$EndElements", ""]), encoding="utf-8")


_TWO = """
[mesh]
file = "two.msh"
[material]
lame = [4.0, 4.0]
[loads]
body = [0.0, -1.0]
[supports]
left = "clamped"
"""

CASES: dict[str, Case] = {
    **{f"checkpoint: {name}": Case(
        DAMAGE[name][0], prepare=_damaged(DAMAGE[name][1]), options=("--checkpoint", "{}/kept", "--resume")
       ) for name in ("truncated", "noise", "nan", "a list")},
    "checkpoint: missing name": Case("--resume needs a checkpoint", options=("--resume",)),
    "checkpoint: folder": Case("this is a folder", options=("--checkpoint", "{}", "--resume")),
    "checkpoint: pipe": Case("it is a pipe", prepare=_pipe("pipe"), options=("--checkpoint", "{}/pipe", "--resume")),
    "checkpoint: other law": Case(
        "laws differ", _BASE.replace("bound = 0.5", "bound = 0.6"), _damaged(lambda data: data),
        ("--checkpoint", "{}/kept", "--resume"),
    ),
    "checkpoint: other kind of law": Case(
        "belongs to another problem", _COULOMB, _damaged(lambda data: data), ("--checkpoint", "{}/kept", "--resume")
    ),
    "checkpoint: huge numbers that fit": Case(
        "not converged", prepare=_damaged(_number(1e300, fitting=True)), code=1,
        options=("--checkpoint", "{}/kept", "--resume", "--max-steps", "3"),
    ),
    "problem: missing": Case("does not exist", "", lambda folder: (folder / "p.toml").unlink()),
    "problem: pipe": Case(
        "not a regular file", "", lambda folder: ((folder / "p.toml").unlink(), os.mkfifo(folder / "p.toml"))
    ),
    "problem: endless": Case(
        "not a regular file", "",
        lambda folder: ((folder / "p.toml").unlink(), (folder / "p.toml").symlink_to("/dev/zero")),
    ),
    "problem: noise": Case("UTF-8", "", lambda folder: (folder / "p.toml").write_bytes(b"\xff\xfe\x00" * 99)),
    "problem: nested": Case("nested too deeply", "a = " + "[" * 100_000),
    "table: pipe": Case(
        "regular file", _BASE.replace('law = "survey", q_max = 0.3, p_const = 2.0', 'law = "table", file = "pipe"'),
        _pipe("pipe"),
    ),
    "mesh: refined without end": Case("of memory", _BASE.replace("[12, 12]", "[12, 12]\nrefine = 1000")),
    "mesh: refined often": Case("of memory", _BASE.replace("[12, 12]", "[12, 12]\nrefine = 15")),
    "mesh: even numbers of cells": Case("of memory", _BASE.replace("[12, 12]", "[262144, 262144]")),
    "mesh: odd numbers of cells": Case("of memory", _BASE.replace("[12, 12]", "[99999, 99999]")),
    "mesh: a part that nothing holds": Case("part 2 of 2", _TWO, _two_squares),
    "numbers: stiffness": Case("must lie between", _BASE.replace("[4.0, 4.0]", "[1e308, 1e308]")),
    "numbers: load": Case("", _BASE.replace("[-0.8, -0.8]", "[-1e200, -1e200]"), code=1),
    "numbers: larger load": Case("", _BASE.replace("[-0.8, -0.8]", "[-1e308, -1e308]"), code=1),
    "output: full disk": Case(
        "no space left", prepare=_full("r.json"), options=("--json", "{}/r.json", "--vtu", "{}/r.vtu"),
        kept=("r.pvtu", "r_contact.pvtu", "r_0.vtu"),
    ),
    "output: file too large": Case(
        "r.json: file too large", options=("--json", "{}/r.json"), conditions={"file_limit": 2_000}
    ),
    "output: piece too large": Case(
        ".vtu: file too large", options=("--json", "{}/r.json", "--vtu", "{}/r.vtu"),
        conditions={"file_limit": 2_000, "rank": -1},
        prepare=lambda folder: (folder / "r.json").symlink_to("/dev/null"),
    ),
    "output: piece is a folder": Case(
        "it is a directory", prepare=lambda folder: (folder / "r_0.vtu").mkdir(), options=("--vtu", "{}/r.vtu")
    ),
    "output: index is a folder": Case(
        "it is a directory", prepare=lambda folder: (folder / "r_contact.pvtu").mkdir(),
        options=("--vtu", "{}/r.vtu"),
    ),
    "output: no folder": Case("does not exist", options=("--vtu", "{}/nowhere/r.vtu")),
    "output: wrong suffix": Case("must end in", options=("--vtu", "{}/r.txt")),
    "output: a law table": Case(
        "was read for this problem", _BASE.replace('law = "survey", q_max = 0.3, p_const = 2.0',
        'law = "table", file = "law.csv"'), _law_table, ("--checkpoint", "{}/law.csv"), kept=("law.csv",),
    ),
    "output: the problem": Case("problem file", options=("--checkpoint", "{}/p.toml"), kept=("p.toml",)),
    "output: what it goes on from": Case(
        "already", prepare=lambda folder: shutil.copy(folder / "good", folder / "c.json"),
        options=("--checkpoint", "{}/c.json", "--resume", "--json", "{}/c.json"), kept=("c.json",),
    ),
    "output: one name twice": Case("already", options=("--checkpoint", "{}/r_0.vtu", "--vtu", "{}/r.vtu")),
    "checkpoint: full disk": Case(
        "no space left", options=("--checkpoint", "/dev/full", "--json", "{}/r.json"), kept=("r.json",)
    ),
    "checkpoint: no folder": Case("does not exist", options=("--checkpoint", "{}/nowhere/kept")),
    "name with an escape": Case("x1b", options=("--vtu", "{}/\x1b[31m.txt")),
}  # fmt: skip


@pytest.fixture(scope="module")
def good(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """A checkpoint of a run on two ranks."""
    return _good(tmp_path_factory.mktemp("good"))


@pytest.mark.parametrize("ranks", [1, 2])
def test_damaged_checkpoints_are_refused_on_all_ranks(tmp_path: Path, good: bytes, ranks: int) -> None:
    problem, folder = tmp_path / "p.toml", tmp_path / "checkpoints"
    problem.write_text(_BASE, encoding="utf-8")
    folder.mkdir()
    (folder / "good").write_bytes(good)
    for name, (_, change) in DAMAGE.items():
        (folder / name).write_bytes(change(good))
    done = mpirun(ranks, "-m", "tests.ranks.damaged", problem, folder, limit=_LIMIT)
    assert done.returncode == 0, done.stderr
    everywhere = json.loads(done.stdout.splitlines()[-1])
    assert len(everywhere) == ranks
    for said in everywhere:
        assert said.pop("good") is None
        assert set(said) == set(DAMAGE)
        for name, (words, _) in DAMAGE.items():
            assert words in (said[name] or ""), (name, said[name])


def _prepared(case: Case, folder: Path, good: bytes) -> list[str]:
    """Write what a case needs into a folder; returns the arguments of the command."""
    problem = folder / "p.toml"
    problem.write_text(case.text, encoding="utf-8")
    (folder / "good").write_bytes(good)
    case.prepare(folder)
    options = [option.replace("{}", str(folder)) for option in case.options]
    return ["solve", str(problem), "--engine", "petsc", "-q", *options]


@dataclass(frozen=True)
class Run:
    """What became of a case: exit code, what was said, and the kept files as they were before."""

    folder: Path
    before: dict[str, bytes]
    code: int
    said: str


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory, good: bytes) -> Callable[[str, int], Run]:
    """Runs of all cases: those without conditions share processes, as long as none of them aborts these."""
    done: dict[tuple[str, int], Run] = {}
    prepared: dict[tuple[str, int], tuple[Path, list[str], dict[str, bytes]]] = {}

    def prepare(name: str, ranks: int) -> None:
        case, folder = CASES[name], tmp_path_factory.mktemp("case")
        arguments = _prepared(case, folder, good)
        before = {file: (folder / file).read_bytes() for file in case.kept if (folder / file).exists()}
        prepared[name, ranks] = folder, arguments, before

    def alone(name: str, ranks: int) -> None:
        folder, arguments, before = prepared[name, ranks]
        conditions = {**CASES[name].conditions}
        if conditions.get("rank") == -1:
            conditions["rank"] = ranks - 1
        end = mpirun(ranks, _HERE / "hostile.py", json.dumps(conditions), *arguments, limit=_LIMIT)
        done[name, ranks] = Run(folder, before, end.returncode, end.stdout + end.stderr)

    def together(names: list[str], ranks: int) -> None:
        while names:
            results = tmp_path_factory.mktemp("batch")
            cases = results / "cases.json"
            cases.write_text(json.dumps([(name, prepared[name, ranks][1]) for name in names]), encoding="utf-8")
            mpirun(ranks, _HERE / "hostile_batch.py", cases, results, limit=4.0 * _LIMIT)
            ended = 0
            for number, name in enumerate(names):
                if not (results / f"{number}.json").exists():
                    break
                of_ranks = json.loads((results / f"{number}.json").read_text(encoding="utf-8"))
                folder, _, before = prepared[name, ranks]
                code = max(code for code, _ in of_ranks)
                done[name, ranks] = Run(folder, before, code, "".join(said for _, said in of_ranks))
                ended += 1
            if ended < len(names):
                shutil.rmtree(prepared[names[ended], ranks][0])
                prepare(names[ended], ranks)
                alone(names[ended], ranks)
            names = names[ended + 1 :]

    def run(name: str, ranks: int) -> Run:
        if (name, ranks) not in done:
            if CASES[name].conditions:
                prepare(name, ranks)
                alone(name, ranks)
            else:
                plain = [other for other, case in CASES.items() if not case.conditions]
                for other in plain:
                    prepare(other, ranks)
                together(plain, ranks)
        return done[name, ranks]

    return run


@pytest.mark.parametrize("ranks", [1, 2])
@pytest.mark.parametrize("name", CASES)
def test_one_line_and_an_exit_code(runs: Callable[[str, int], Run], name: str, ranks: int) -> None:
    case, run = CASES[name], runs(name, ranks)
    lines = [line for line in run.said.splitlines() if line.startswith("hemivar: ") and "hemivar: warning" not in line]
    assert run.code == case.code, run.said
    assert len(lines) == 1, run.said
    assert case.words in lines[0]
    assert "/." not in lines[0], "the name of a temporary file"
    assert "Traceback" not in run.said
    assert "Warning" not in run.said
    assert "\x1b" not in run.said
    for file in case.kept:
        found = (run.folder / file).read_bytes()
        assert found
        assert run.before.get(file, found) == found
        if file == "r.json":
            assert json.loads(found)["status"] == "converged"
    assert not [file for file in run.folder.iterdir() if file.name.startswith(".")], "a temporary file was left"
