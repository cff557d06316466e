"""Run by mpirun: what is said about checkpoints, as JSON on rank 0.  ``damaged.py PROBLEM.toml FOLDER``."""

import json
import sys
from pathlib import Path

from hemivar.cli.end_on_ranks import all_or_none
from hemivar.cli.on_ranks import read_on_ranks
from hemivar.engines.petsc import read_checkpoint, world
from hemivar.errors import HemivarError

ranks = world()
with all_or_none(ranks):
    body = read_on_ranks(Path(sys.argv[1]), ranks).bodies[-1]
    said: dict[str, str | None] = {}
    for path in sorted(Path(sys.argv[2]).iterdir()):
        try:
            read_checkpoint(path, body)
            said[path.name] = None
        except HemivarError as error:
            said[path.name] = str(error)
    everywhere = ranks.mpi.gather(said)
    if ranks.rank == 0:
        print(json.dumps(everywhere))
