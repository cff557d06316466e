"""Running things under mpirun."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

__all__ = ["environment", "mpirun"]


def environment() -> dict[str, str]:
    """What Open MPI needs to run as root, with more ranks than cores, one thread each."""
    return os.environ | {
        "OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1", "OMP_NUM_THREADS": "1",
        "OMPI_MCA_rmaps_base_oversubscribe": "1", "OMPI_MCA_mpi_yield_when_idle": "1",
    }  # fmt: skip


def mpirun(ranks: int, *arguments: str | Path, limit: float = 120.0) -> subprocess.CompletedProcess[str]:
    """Run Python on so many ranks, with a limit of time."""
    command = ["mpirun", "-n", str(ranks), sys.executable, *map(str, arguments)]
    return subprocess.run(
        command, env=environment(), capture_output=True, text=True, timeout=limit, stdin=subprocess.DEVNULL,
        check=False,
    )  # fmt: skip
