"""Run by mpirun: problems of the benchmarks solved over ranks, as JSON on rank 0.  ``agree.py [CELLS PER RANK]``."""

import json
import sys
from typing import Any

from hemivar.mesh.mesh import Mesh
from hemivar.ranks import assemble, family, solve_distributed, world
from hemivar.ranks.body_on_ranks import BodyOnRanks
from hemivar.ranks.petsc_engine import all_or_none
from tests.ranks.benchmark_problems import PROBLEMS, RTOL

ranks = world()
with all_or_none(ranks):
    said = {}
    for name, (state, size) in PROBLEMS.items():
        halvings = (size & -size).bit_length() - 2  # down to two cells or three
        coarsest = {"cells_per_rank": int(sys.argv[1])} if len(sys.argv) > 1 else {}

        def begin(times: int, state: Any = state, size: int = size) -> Mesh:
            return state(size >> times).mesh  # type: ignore[no-any-return]

        body: BodyOnRanks | None = None
        for piece in family(ranks, begin, halvings, **coarsest):
            body = assemble(ranks, piece, state(size).on, coarser=body)
        assert body is not None
        found = solve_distributed(body, controls=RTOL)
        said[name] = [found.status.value, found.steps, found.evaluations, found.energy]
    if ranks.rank == 0:
        print(json.dumps(said))
