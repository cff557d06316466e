"""Cases on several processes: each worker imports the library once and copies itself for every case."""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import shutil
import tempfile
import traceback
from collections.abc import Iterable, Iterator
from pathlib import Path

from tests.robustness.case import leave_command
from tests.robustness.generate import make_case
from tests.robustness.judge import FAULTS, Outcome, run_and_judge
from tests.robustness.limited import warm_up

__all__ = ["run_cases"]

_ONE_THREAD = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}


def _begin() -> None:
    warm_up()


def _work(task: tuple[int, int, str | None, Path, Path | None]) -> Outcome:
    seed, number, family, scratch, dump = task
    folder = scratch / f"{seed}-{number}"
    try:
        case = make_case(seed, number, family)
        outcome = run_and_judge(case, folder)
    except Exception:  # a fault of the harness must not end all other cases
        failed = {"oracle failed": traceback.format_exc()[-600:]}
        return Outcome(f"{seed}:{number}", family or "unknown", "the harness failed", "oracle failed", failed)
    if dump is not None and outcome.verdict in FAULTS:
        with contextlib.suppress(OSError, shutil.Error, ValueError):
            leave_command(case, folder)
            target = dump / f"{seed}-{number}"
            shutil.rmtree(target, ignore_errors=True)
            os.makedirs(dump, exist_ok=True)
            os.rename(folder, target) if _same_disk(folder, dump) else shutil.copytree(folder, target, symlinks=True)
            shutil.copy(scratch / f"{seed}-{number}.log", target / "log.txt")
    shutil.rmtree(folder, ignore_errors=True)
    (scratch / f"{seed}-{number}.log").unlink(missing_ok=True)
    return outcome


def _same_disk(first: Path, second: Path) -> bool:
    return first.stat().st_dev == second.stat().st_dev


def run_cases(
    seed: int, numbers: Iterable[int], jobs: int = 2, family: str | None = None, dump: Path | None = None
) -> Iterator[Outcome]:
    """Run cases; the outcomes come in the order of the numbers.

    Parameters
    ----------
    seed : int
    numbers : iterable of int
    jobs : int
        Processes at work at once.
    family : str, optional
        Only cases of this family.
    dump : Path, optional
        Folders of cases with faults are kept here, with the command that repeats them.
    """
    before = {key: os.environ.get(key) for key in _ONE_THREAD}
    os.environ.update(_ONE_THREAD)
    try:
        with tempfile.TemporaryDirectory() as scratch:
            tasks = [(seed, number, family, Path(scratch), dump) for number in numbers]
            with multiprocessing.get_context("spawn").Pool(jobs, _begin) as pool:
                yield from pool.imap(_work, tasks)
    finally:
        for key, value in before.items():
            if value is None:
                os.environ.pop(key, None)
            else:
                os.environ[key] = value
