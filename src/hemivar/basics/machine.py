"""What machine and interpreter this is, and whether a module can be imported on it."""

from __future__ import annotations

import os
import platform
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

__all__ = ["control_groups", "cores", "import_fails", "lines_of", "system"]


def cores() -> int:
    """Processors that this process may use: those that it is bound to, or as many as its control groups let it."""
    bound = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return max(min([bound, *(int(share) for share in _quotas())]), 1)


def _quotas() -> Iterator[float]:
    """Processors that each control group of the process, and each above it, may use at a time."""
    for folder, second in control_groups("cpu"):
        if second:
            numbers = next(iter(lines_of(folder / "cpu.max")), "").split()
        else:
            numbers = [*lines_of(folder / "cpu.cfs_quota_us"), *lines_of(folder / "cpu.cfs_period_us")]
        if len(numbers) == 2 and all(number.isdigit() and int(number) > 0 for number in numbers):  # not max, not -1
            yield int(numbers[0]) / int(numbers[1])


def control_groups(controller: str) -> Iterator[tuple[Path, bool]]:
    """Folders of the control groups of this process and of those above them, and whether they are of version 2."""
    for line in lines_of(Path("/proc/self/cgroup")):
        number, controllers, path = [*line.split(":", 2), "", ""][:3]
        second = number == "0" and not controllers
        if not second and controller not in controllers.split(","):
            continue
        root = Path("/sys/fs/cgroup") if second else Path("/sys/fs/cgroup") / controller
        group = root / path.lstrip("/")
        for folder in (group, *group.parents):
            yield folder, second
            if folder == root:
                break


def lines_of(path: Path) -> list[str]:
    """Lines of a file of the system; none where it cannot be read."""
    try:
        return path.read_text().splitlines()
    except (OSError, UnicodeDecodeError):
        return []


def system() -> str:
    """Name and version of the operating system, and the processor."""
    return f"{platform.system()} {platform.release()} {platform.machine()}"


def import_fails(module: str, limit: float) -> str | None:
    """Why a module cannot be imported, tried in a process of its own; None where it can."""
    try:
        done = subprocess.run(
            [sys.executable, "-c", f"import {module}"],
            capture_output=True, text=True, timeout=limit, stdin=subprocess.DEVNULL, check=False,
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        return f"its import takes more than {limit:g} s"
    if done.returncode == 0:
        return None
    lines = done.stderr.strip().splitlines()
    return lines[-1] if lines else f"its import ends the process with code {done.returncode}"
