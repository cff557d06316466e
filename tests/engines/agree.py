"""Run by mpirun: problems of the benchmarks solved over ranks, as JSON on rank 0."""

import json

from hemivar.cli.ending import all_or_none
from hemivar.engines.petsc import BodyOnRanks, assemble, family, solve_distributed, world
from tests.engines.benchmark_problems import PROBLEMS, RTOL

ranks = world()
with all_or_none(ranks):
    said = {}
    for name, (state, size) in PROBLEMS.items():
        halvings = (size & -size).bit_length() - 2  # down to two cells or three
        body: BodyOnRanks | None = None
        for piece in family(ranks, lambda times, state=state, size=size: state(size >> times).mesh, halvings):  # type: ignore[misc]
            body = assemble(ranks, piece, state(size).on, coarser=body)
        assert body is not None
        found = solve_distributed(body, controls=RTOL)
        said[name] = [found.status.value, found.steps, found.cycles, found.energy]
    if ranks.rank == 0:
        print(json.dumps(said))
