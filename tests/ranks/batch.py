"""Run by mpirun: all problems of a plan, each as JSON with its certificate.  ``batch.py FOLDER RESULTS``."""

import json
import sys
from pathlib import Path

from hemivar.ranks import solve_distributed, world
from hemivar.ranks.certificate import certify_on_ranks
from hemivar.ranks.on_ranks import write_json_on_ranks
from hemivar.ranks.petsc_engine import all_or_none
from hemivar.solvers import Controls
from tests.ranks.stated import body_of_file

ranks = world()
with all_or_none(ranks):
    folder, results = map(Path, sys.argv[1:])
    if ranks.rank == 0:
        results.mkdir()
    plan = json.loads((folder / "plan.json").read_text(encoding="utf-8"))
    for name, rtol in plan.items():
        body = body_of_file(folder / f"{name}.toml")
        solution = solve_distributed(body, controls=Controls(rtol=rtol))
        write_json_on_ranks(solution, results / f"{name}.json", certify_on_ranks(solution))
