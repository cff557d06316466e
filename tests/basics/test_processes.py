"""Work shared out to processes."""

from __future__ import annotations

import os
import subprocess
import sys
import textwrap
import time
from pathlib import Path

import pytest

from hemivar.basics.processes import results
from hemivar.errors import MethodError, ProblemError


def squared(number: int) -> int:
    return number * number


def dead(number: int) -> int:
    os._exit(number)


def test_one_process_works_itself_in_order() -> None:
    assert list(results(lambda number: number + 1, [3, 1, 2], 1)) == [4, 2, 3]
    assert list(results(squared, [], 4)) == []


def at_work(seconds: float) -> int:
    end = time.process_time() + seconds
    while time.process_time() < end:
        pass
    return os.getpid()


def test_little_work_is_done_here() -> None:
    assert set(results(at_work, [0.001] * 20, 2, 0.1)) == {os.getpid()}
    assert set(results(at_work, [0.01] * 16, 2, 0.06)) == {os.getpid()}  # after six or seven 0.1 is left
    assert set(results(at_work, [0.01] * 16, 2, 0.03)) == {os.getpid()}  # 0.13 is little beside two beginnings


@pytest.mark.slow
def test_what_is_left_of_much_work_goes_to_processes() -> None:
    found = list(results(at_work, [0.02] * 40, 2, 0.05))
    assert len(found) == 40
    assert set(found[:2]) == {os.getpid()}
    assert os.getpid() not in found[6:]


def test_what_cannot_travel_is_refused() -> None:
    with pytest.raises(ProblemError, match="other processes cannot get the work"):
        list(results(squared, [lambda: 0, lambda: 1], 2))  # type: ignore[list-item]


@pytest.mark.slow
def test_processes_do_all_of_it_and_one_that_dies_is_told() -> None:
    assert sorted(results(squared, range(9), 2)) == [number**2 for number in range(9)]
    with pytest.raises(MethodError, match="a process ended before its work was done"):
        list(results(dead, [1, 1, 1], 2))


STOPPED = """
    import pathlib
    import time
    from hemivar.basics.processes import results

    returning = pathlib.Path("returning")

    def large(task):  # what it returns goes through a pipe for a while
        if task:
            returning.touch()
        return bytes(10**8 * task)

    if __name__ == "__main__":
        for k in range(8):
            returning.unlink(missing_ok=True)
            work = results(large, [0, 1, 1, 1], 2)
            next(work)
            while not returning.exists():
                time.sleep(0.001)
            time.sleep(0.02 * k)
            work.close()
"""


@pytest.mark.slow
def test_processes_that_are_stopped_while_they_write_do_not_hold_the_end(tmp_path: Path) -> None:
    script = tmp_path / "stopped.py"
    script.write_text(textwrap.dedent(STOPPED))
    run = subprocess.run([sys.executable, str(script)], capture_output=True, text=True, timeout=60, cwd=tmp_path)
    assert run.returncode == 0, run.stderr
