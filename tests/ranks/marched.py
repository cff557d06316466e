"""Run by mpirun: evolutions over ranks, as JSON on rank 0.  ``marched.py CASE... [--checkpoint FILE] [--steps N]``."""

import argparse
import json
from pathlib import Path
from typing import Any

import numpy as np

from hemivar.evolution import Checkpoint
from hemivar.ranks import assembly, family, march_on_ranks, world
from hemivar.ranks.evolution import EvolutionOnRanks
from hemivar.ranks.petsc_engine import all_or_none
from hemivar.ranks.preconditioner import Multigrid
from hemivar.ranks.ranks_advance import DescentSolverOnRanks
from tests.ranks.evolutions import CASES, COUPLED, ENDING

parser = argparse.ArgumentParser()
parser.add_argument("cases", nargs="+")
parser.add_argument("--checkpoint", type=Path)
parser.add_argument("--resume", action="store_true")
parser.add_argument("--steps", type=int)
given = parser.parse_args()

done = {"assembled": 0, "set up": 0, "solved": 0}


def counted(owner: Any, name: str, what: str) -> None:
    """Count the calls of a function."""
    function = getattr(owner, name)

    def called(*arguments: Any, **options: Any) -> Any:
        done[what] += 1
        return function(*arguments, **options)

    setattr(owner, name, called)


counted(assembly, "assemble", "assembled")
counted(Multigrid, "build", "set up")
counted(DescentSolverOnRanks, "solved", "solved")

ranks = world()
with all_or_none(ranks):
    said: dict[str, Any] = {}
    for name in given.cases:
        case = (CASES | COUPLED | ENDING)[name]
        pieces = family(ranks, case.mesh, case.halvings)
        kept = None if given.checkpoint is None else Checkpoint(given.checkpoint, 0.0)
        plan = case.plan(checkpoint=kept, resume=given.resume)
        taken = 0
        done.update(dict.fromkeys(done, 0))

        def watch(stepped: object) -> bool:
            global taken
            taken += 1
            return bool(taken == given.steps)

        history = march_on_ranks(ranks, tuple(pieces), case.state, plan, watch=watch)
        discrete, state = history.discrete, history.state
        assert isinstance(discrete, EvolutionOnRanks)
        body, contact = discrete.body, discrete.problem.contact
        assert contact.points is not None
        place, velocity = discrete.full(state.body.displacement), discrete.full(state.body.velocity)
        own = body.owned
        nodes = np.hstack([pieces[-1].mesh.points[own], place[own], velocity[own]])
        marks = np.hstack([contact.boundary[:, None], contact.points, state.local.displacement, state.multiplier])
        nodes, marks = (np.concatenate(ranks.mpi.allgather(part)) for part in (nodes, marks))
        said[name] = {
            "nodes": nodes.tolist(),
            "contact": marks.tolist(),
            "columns": list(history.columns),
            "table": [history[column].tolist() for column in history.columns],
            "events": list(history.events),
            "ended": history.ended,
            "messages": ranks.mpi.allgather(history.messages),
            "levels": len(pieces),
            "done": dict(done),
        }
    if ranks.rank == 0:
        print(json.dumps(said))
