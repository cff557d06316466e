"""What machine and interpreter this is, and whether a module can be imported on it."""

from __future__ import annotations

import os
import platform
import subprocess
import sys

__all__ = ["cores", "import_fails", "system"]


def cores() -> int:
    """Processors that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def system() -> str:
    """Name and version of the operating system, and the processor."""
    return f"{platform.system()} {platform.release()} {platform.machine()}"


def import_fails(module: str, limit: float) -> str | None:
    """Why a module cannot be imported, tried in a process of its own; None where it can.

    Parameters
    ----------
    module : str
    limit : float
        Seconds that it may take.
    """
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
