"""Processes that end in the middle of their work: what stands under a final name is whole, or as it was before.

Commands run in children forked from one process that has imported everything, so that most of the time of a child is
work and not imports.
"""

from __future__ import annotations

import csv
import json
import os
import random
import signal
import subprocess
import sys
import time
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from hemivar import cli
from hemivar.files.sample import SAMPLE
from tests.problem_files import block_file
from tests.samples import sampled, slow

PROBLEM = block_file(8)
LONG = block_file(64)
PATH = block_file(8, friction=None)
OLD = b"what was here before"

#: Arguments of every command that writes, and the files it writes.
COMMANDS: dict[str, tuple[list[str], list[str]]] = {
    "solve": (
        ["solve", "p.toml", "--json", "s.json", "--vtu", "s.vtu", "--plot", "s.png", "--plot-contact", "c.pdf"],
        ["s.json", "s.vtu", "s_contact.vtu", "s.png", "c.pdf"],
    ),
    "compare": (
        ["compare", "p.toml", "--methods", "newton,active-set", "--csv", "t.csv", "--json", "t.json"],
        ["t.csv", "t.json"],
    ),
    "certify": (["certify", "p.toml", "--json", "k.json"], ["k.json"]),
    "solutions": (["solutions", "q.toml", "--starts", "2", "--json", "q.json"], ["q.json"]),
    "path": (["path", "q.toml", "--json", "path.json", "--plot", "path.svg"], ["path.json", "path.svg"]),
    "laws": (["laws", "survey", "--plot", "law.svg"], ["law.svg"]),
    "new": (["new", "new.toml", "--force"], ["new.toml"]),
}  # fmt: skip
SURVEY = ["survey", "--max-n", "8", "--output", "out", "--max-time", "5"]

_DRIVER = """
import json, os, resource, signal, sys, time
import hemivar.branches, hemivar.certificates, hemivar.report, hemivar.workflows, meshio, scipy.sparse.linalg
import matplotlib.backends.backend_agg, matplotlib.backends.backend_pdf, matplotlib.backends.backend_svg
from hemivar import cli
resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
for line in sys.stdin:
    job = json.loads(line)
    child = os.fork()
    if child == 0:
        os.chdir(job["folder"])
        nowhere = os.open(os.devnull, os.O_RDWR)
        for number in (0, 1):
            os.dup2(nowhere, number)
        errors = os.open("stderr.txt", os.O_WRONLY | os.O_CREAT)
        os.dup2(errors, 2)
        if job["limit"] is not None:
            signal.signal(signal.SIGXFSZ, signal.SIG_DFL if job["die"] else signal.SIG_IGN)
            resource.setrlimit(resource.RLIMIT_FSIZE, (job["limit"], job["limit"]))
        sys.stdout, sys.stderr = os.fdopen(1, "w"), os.fdopen(2, "w")
        os._exit(cli.main(job["arguments"]))
    began = time.perf_counter()
    if job["after"] is not None:
        time.sleep(job["after"])
        os.kill(child, job["signal"])
    status = os.waitpid(child, 0)[1]
    print(json.dumps([os.waitstatus_to_exitcode(status), time.perf_counter() - began]), flush=True)
"""


class Driver:
    """The process that forks the victims."""

    def __init__(self) -> None:
        source = str(Path(cli.__file__).parents[2])
        self.process = subprocess.Popen(
            [sys.executable, "-c", _DRIVER], env={**os.environ, "PYTHONPATH": source},
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
        )  # fmt: skip

    def __call__(
        self, folder: Path, arguments: list[str], *,
        after: float | None = None, number: int = signal.SIGKILL, limit: int | None = None, die: bool = True,
    ) -> tuple[int, float]:  # fmt: skip
        """Run a command in a folder; exit code (negative: the signal that ended it) and seconds."""
        assert self.process.stdin is not None
        assert self.process.stdout is not None
        job = {
            "folder": str(folder), "arguments": arguments, "after": after, "signal": int(number), "limit": limit,
            "die": die,
        }  # fmt: skip
        self.process.stdin.write(json.dumps(job) + "\n")
        self.process.stdin.flush()
        code, seconds = json.loads(self.process.stdout.readline())
        return code, seconds

    def close(self) -> None:
        self.process.communicate(timeout=60)


@pytest.fixture(scope="module")
def driver() -> Iterator[Driver]:
    one = Driver()
    yield one
    one.close()


def prepared(folder: Path, files: list[str], content: bytes | None = OLD) -> Path:
    """A folder with the problems, and old files under the names of the outputs."""
    folder.mkdir(exist_ok=True)
    (folder / "p.toml").write_text(PROBLEM)
    (folder / "q.toml").write_text(PATH.replace("[8, 8]", "[2, 2]"))
    (folder / "long.toml").write_text(LONG)
    for file in files:
        if content is None:
            (folder / file).unlink(missing_ok=True)
        else:
            (folder / file).write_bytes(content)
    return folder


# ---- whole files ---------------------------------------------------------------------------------------------


def _whole_table(data: bytes) -> None:
    rows = list(csv.reader(data.decode().splitlines()))
    assert data.endswith(b"\r\n")
    assert len({len(row) for row in rows}) == 1


def _ends(data: bytes, end: bytes) -> None:
    assert data.rstrip().endswith(end)


_WHOLE: dict[str, Callable[[bytes], Any]] = {
    ".json": json.loads,
    ".vtu": ElementTree.fromstring,
    ".svg": ElementTree.fromstring,
    ".csv": _whole_table,
    # Table 1 has a note below
    ".md": lambda data: _ends(data, b"sets exactly." if b"\n\nAssembly" in data else b"|"),
    ".png": lambda data: _ends(data, b"IEND\xaeB`\x82"),
    ".pdf": lambda data: _ends(data, b"%%EOF"),
    ".html": lambda data: _ends(data, b"</html>"),
    ".toml": lambda data: _ends(data, SAMPLE[-200:].rstrip().encode()),
}


def whole(file: Path) -> bool:
    """Whether a file is new and whole; False if it is missing or the old one; fails if it is neither."""
    if not file.exists():
        return False
    data = file.read_bytes()
    if data == OLD:
        return False
    try:
        _WHOLE[file.suffix](data)
    except Exception as error:
        pytest.fail(f"{file.name} is cut off after {len(data)} bytes: {error}")
    return True


def test_a_cut_file_is_found_out(tmp_path: Path) -> None:
    """The judge itself: half of every kind of file is no whole file."""
    samples = {
        "a.json": b'{"a": [1, 2]}', "a.vtu": b"<VTKFile><a/></VTKFile>", "a.csv": b"a,b\r\n1,2\r\n3,4\r\n",
        "a.png": b"\x89PNG....IEND\xaeB`\x82", "a.pdf": b"%PDF....%%EOF\n", "a.html": b"<html></html>\n",
        "a.toml": SAMPLE.encode(),
    }  # fmt: skip
    for name, data in samples.items():
        (tmp_path / name).write_bytes(data)
        assert whole(tmp_path / name)
        (tmp_path / name).write_bytes(data[: len(data) // 2])
        with pytest.raises(pytest.fail.Exception, match="is cut off"):
            whole(tmp_path / name)


# ---- ended in the middle of writing --------------------------------------------------------------------------


@pytest.mark.parametrize("command", sampled(COMMANDS, ["solve", "new"]))
def test_whoever_dies_in_the_middle_of_a_file_leaves_the_old_one(command: str, driver: Driver, tmp_path: Path) -> None:
    """The system ends the process as soon as one of its files grows beyond a size, whatever it does just then."""
    arguments, files = COMMANDS[command]
    died = 0
    for limit in (0, 3000, 10_000):  # the last lets the JSON of "solve" through, not its VTU
        folder = prepared(tmp_path, files)
        code, _ = driver(folder, arguments, limit=limit)
        died += code == -signal.SIGXFSZ
        made = [whole(folder / file) for file in files]
        if code == 0:
            assert all(made)
    assert died


@pytest.mark.parametrize("old", [True, False])
def test_a_file_that_fails_does_not_stop_the_others(old: bool, driver: Driver, tmp_path: Path) -> None:
    """A limit of sizes that lets the small files through: they are written, each of the others has its complaint."""
    arguments, files = COMMANDS["solve"]
    folder = prepared(tmp_path, files, OLD if old else None)
    assert driver(folder, arguments)[0] == 0
    sizes = {file: (folder / file).stat().st_size for file in files}
    limit = sorted(sizes.values())[2]
    prepared(tmp_path, files, OLD if old else None)
    code, _ = driver(folder, arguments, limit=limit + 100, die=False)
    assert code == 2
    too_large = [file for file, size in sizes.items() if size > limit + 1000]
    assert 0 < len(too_large) < len(files)
    for file in files:
        if file in too_large:
            assert (folder / file).read_bytes() == OLD if old else not (folder / file).exists()
        elif sizes[file] <= limit:
            assert whole(folder / file)
    complaints = (folder / "stderr.txt").read_text().splitlines()
    assert len(complaints) == len(too_large)
    for file in too_large:
        assert sum(f"cannot write {file}: file too large" in line for line in complaints) == 1
    assert not [name for name in os.listdir(folder) if name.startswith(".")]


def _kill_at_random(driver: Driver, folder: Path, arguments: list[str], files: list[str], kills: int, seed: int) -> int:
    """Kill a command so many times; returns how many had written nothing or something, not all."""
    rng = random.Random(seed)
    prepared(folder, files, None)
    assert driver(folder, arguments)[0] == 0
    code, seconds = driver(folder, arguments)
    assert code == 0
    killed = 0
    for number in range(kills):
        prepared(folder, files, OLD if number % 2 else None)
        code, _ = driver(folder, arguments, after=rng.uniform(0.0, 0.9) * seconds)
        killed += code == -signal.SIGKILL
        for file in files:
            whole(folder / file)
    return killed


@pytest.mark.parametrize("command", ["solve", slow("certify")])
def test_kill_at_random_moments(command: str, driver: Driver, tmp_path: Path) -> None:
    arguments, files = COMMANDS[command]
    assert _kill_at_random(driver, tmp_path, arguments, files, 2, seed=1) > 0


@pytest.mark.slow
@pytest.mark.parametrize("command", COMMANDS)
def test_kill_at_many_random_moments(command: str, driver: Driver, tmp_path: Path) -> None:
    arguments, files = COMMANDS[command]
    assert _kill_at_random(driver, tmp_path, arguments, files, 60, seed=2) > 10


@pytest.mark.slow
def test_kill_the_survey_at_random_moments(driver: Driver, tmp_path: Path) -> None:
    from hemivar.survey.survey_report import FILES

    out = tmp_path / "out"
    code, seconds = driver(prepared(tmp_path, []), SURVEY)
    assert code == 0
    assert all(whole(out / name) for name in FILES)
    rng = random.Random(3)
    for _ in range(6):
        driver(tmp_path, SURVEY, after=rng.uniform(0.0, 1.0) * seconds)
        assert all(whole(out / name) for name in FILES)


@pytest.mark.parametrize("rounds", [1, slow(30)])
def test_two_writers_of_one_file(rounds: int, driver: Driver, tmp_path: Path) -> None:
    arguments, files = COMMANDS["solve"]
    arguments, files = arguments[:6], files[:3]
    drivers = [driver, Driver()]
    folder = prepared(tmp_path, files)
    try:
        for _ in range(rounds):
            for one in drivers:
                assert one.process.stdin is not None
                job = {"folder": str(folder), "arguments": arguments, "after": None, "limit": None, "die": False}
                one.process.stdin.write(json.dumps(job) + "\n")
                one.process.stdin.flush()
            for one in drivers:
                assert one.process.stdout is not None
                assert json.loads(one.process.stdout.readline())[0] == 0
            assert all(whole(folder / file) for file in files)
    finally:
        drivers[1].close()
    assert not [name for name in os.listdir(folder) if name.startswith(".")]


# ---- asked to end --------------------------------------------------------------------------------------------


def _started(folder: Path, arguments: list[str], **options: Any) -> subprocess.Popen[str]:
    source = str(Path(cli.__file__).parents[2])

    def default() -> None:
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            signal.signal(number, signal.SIG_DFL)

    return subprocess.Popen(
        [sys.executable, "-m", "hemivar", *arguments],
        **{
            "cwd": folder, "env": {**os.environ, "PYTHONPATH": source}, "stdout": subprocess.PIPE,
            "stderr": subprocess.PIPE, "text": True, "preexec_fn": default, **options,
        },
    )  # fmt: skip


_POWELL = ["solve", "long.toml", "--method", "direct-powell"]


@pytest.mark.parametrize("number", [slow(signal.SIGINT), signal.SIGTERM, slow(signal.SIGHUP)])
def test_signals_end_a_solve_with_the_iterate_and_the_files(number: signal.Signals, tmp_path: Path) -> None:
    folder = prepared(tmp_path, ["s.json", "s.vtu", "s.png"])
    process = _started(folder, [*_POWELL, "--json", "s.json", "--vtu", "s.vtu", "--plot", "s.png"])
    assert process.stdout is not None
    while process.stdout.readline().split()[:1] != ["0"]:  # the one step of Powell's method takes long
        assert process.poll() is None
    time.sleep(0.3)
    process.send_signal(number)
    if number != signal.SIGINT:  # as shells and terminals do: several at once
        process.send_signal(number)
    _, err = process.communicate(timeout=60)
    assert (process.returncode, err) == (130, "hemivar: interrupted\n")
    assert json.loads((folder / "s.json").read_text())["status"] == "interrupted"
    assert all(whole(folder / file) for file in ("s.json", "s.vtu", "s.png"))


@pytest.mark.slow
def test_a_signal_that_was_to_be_ignored_is_ignored(tmp_path: Path) -> None:
    """As under nohup."""
    folder = prepared(tmp_path, [])
    process = _started(
        folder, ["solve", "p.toml", "--json", "s.json"], preexec_fn=lambda: signal.signal(signal.SIGHUP, signal.SIG_IGN)
    )  # fmt: skip
    time.sleep(0.5)
    process.send_signal(signal.SIGHUP)
    _, err = process.communicate(timeout=60)
    assert (process.returncode, err) == (0, "")


@pytest.mark.slow
def test_head_ends_a_solve_with_the_iterate_and_the_files(tmp_path: Path) -> None:
    folder = prepared(tmp_path, ["s.json", "s.vtu"])
    arguments = ["solve", "long.toml", "--method", "direct-lbfgs", "--json", "s.json", "--vtu", "s.vtu"]
    process = _started(folder, arguments)
    assert process.stdout is not None
    process.stdout.readline()
    process.stdout.close()
    assert process.stderr is not None
    err = process.stderr.read()
    assert process.wait(timeout=60) == 130
    assert err == "hemivar: interrupted: standard output is no longer read\n"
    assert json.loads((folder / "s.json").read_text())["status"] == "interrupted"
    assert whole(folder / "s.vtu")


def test_a_full_standard_output_ends_a_solve_with_the_files(tmp_path: Path) -> None:
    folder = prepared(tmp_path, ["s.json"])
    with Path("/dev/full").open("w") as full:
        process = _started(folder, ["solve", "long.toml", "--method", "direct-lbfgs", "--json", "s.json"], stdout=full)
        _, err = process.communicate(timeout=60)
    assert process.returncode == 130
    assert "standard output cannot be written (No space left on device)" in err
    assert "Traceback" not in err
    assert whole(folder / "s.json")


@pytest.mark.parametrize(
    "arguments", [["laws"], *map(slow, (["methods"], ["--help"], ["--version"], ["laws", "survey"]))]
)
def test_lists_survive_any_standard_output(arguments: list[str], tmp_path: Path) -> None:
    with Path("/dev/full").open("w") as full:
        process = _started(tmp_path, arguments, stdout=full)
        _, err = process.communicate(timeout=60)
    assert process.returncode == 2
    assert err == "hemivar: error: standard output cannot be written (No space left on device)\n"
    process = _started(tmp_path, arguments, stdout=None, preexec_fn=lambda: os.close(1))
    _, err = process.communicate(timeout=60)
    assert (process.returncode, err) == (0, "")


@pytest.mark.slow
def test_work_survives_closed_streams(tmp_path: Path) -> None:
    """No file gets the number of a stream that was closed, and what is printed goes nowhere."""
    folder = prepared(tmp_path, [])

    def close() -> None:
        for number in (0, 1, 2):
            os.close(number)

    streams: dict[str, Any] = {"stdout": None, "stderr": None, "preexec_fn": close}
    process = _started(folder, ["solve", "p.toml", "--json", "s.json", "--vtu", "s.vtu"], **streams)
    assert process.wait(timeout=60) == 0
    assert whole(folder / "s.json")
    assert whole(folder / "s.vtu")
    process = _started(folder, ["solve", "nowhere.toml"], **streams)
    assert process.wait(timeout=60) == 2


def test_a_solution_that_cannot_be_certified_is_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Neither a lack of memory for the certificate nor Ctrl-C there costs the solution."""
    folder = prepared(tmp_path, [])
    monkeypatch.chdir(folder)
    from hemivar.workflows import solving

    for raised, code, line in (
        (MemoryError, 2, "hemivar: error: the solution could not be certified: not enough memory\n"),
        (KeyboardInterrupt, 130, "hemivar: interrupted\n"),
    ):
        prepared(folder, ["s.json"])

        def stop(*_: object, raised: type[BaseException] = raised) -> None:
            raise raised

        monkeypatch.setattr(solving, "certificate_of", stop)
        assert cli.main(["solve", "p.toml", "--json", "s.json"]) == code
        assert capsys.readouterr().err == line
        assert json.loads((folder / "s.json").read_text())["status"] == "converged"
