"""Run by mpirun: what each rank holds of a problem, as JSON on rank 0.  ``probe.py PROBLEM.toml [how to die]``."""

import json
import os
import signal
import sys

from hemivar.errors import ProblemError
from hemivar.ranks import solve_distributed, world
from hemivar.ranks.petsc_engine import all_or_none
from tests.ranks.stated import body_of_file

ranks = world()
with all_or_none(ranks):
    body = body_of_file(sys.argv[1])
    ranks = body.ranks
    calls = 0

    def watch(*_: object) -> None:
        global calls
        calls += 1
        if len(sys.argv) < 3 or calls != 2 or ranks.rank != ranks.size - 1:
            return
        match sys.argv[2]:
            case "exit":
                os._exit(7)
            case "kill":
                os.kill(os.getpid(), signal.SIGKILL)
            case "bug":
                raise RuntimeError("something broke")
            case "refusal":
                raise ProblemError("the bound of friction is negative")

    before = dict(ranks.counts)
    solution = solve_distributed(body, watch=watch)
    info = body.K.getInfo(1)  # of this rank
    mine = {
        "cells": body.piece.mesh.number_of_cells,
        "nodes": body.piece.mesh.number_of_nodes,
        "owned": int(body.owned.sum()),
        "entries": int(info["nz_used"]),
        "contact": body.points,
        "laws": 0 if body.points == 0 else len(body.law.value(solution.local)),
    }
    told = ranks.mpi.gather(mine)
    if ranks.rank == 0:
        print(
            json.dumps(
                {
                    "ranks": told,
                    "cycles": solution.evaluations,
                    "counts": {key: ranks.counts[key] - before[key] for key in before},
                }
            )
        )
