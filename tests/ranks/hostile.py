"""Run by mpirun: the command under conditions that a test makes.  ``hostile.py CONDITIONS.json ARGUMENTS...``.

Conditions: ``file_limit`` (bytes that a file may have) with ``rank`` (on which), ``signal`` (name), ``at`` (step after
which rank ``rank`` gets it) and ``slow`` (seconds that every step takes longer).
"""

import json
import os
import resource
import signal
import sys
import time
from typing import Any

from mpi4py import MPI

from hemivar.cli import main
from hemivar.solvers import NonsmoothMultigrid

conditions = json.loads(sys.argv[1])
mine = MPI.COMM_WORLD.rank == conditions.get("rank", 0)
if "file_limit" in conditions and mine:
    resource.setrlimit(resource.RLIMIT_FSIZE, (conditions["file_limit"], resource.RLIM_INFINITY))

step, count = NonsmoothMultigrid.step, 0


def stepped(self: Any, *arguments: Any) -> Any:
    global count
    count += 1
    time.sleep(conditions.get("slow", 0.0))
    if mine and "signal" in conditions and count == conditions["at"]:
        os.kill(os.getpid(), getattr(signal, conditions["signal"]))
    return step(self, *arguments)


NonsmoothMultigrid.step = stepped  # type: ignore[method-assign]
sys.exit(main(sys.argv[2:]))
