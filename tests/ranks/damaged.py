"""Run by mpirun: what is said about checkpoints, as JSON on rank 0.  ``damaged.py PROBLEM.toml FOLDER``."""

import json
import sys
from pathlib import Path

from hemivar.errors import HemivarError
from hemivar.ranks import world
from hemivar.ranks.checkpoint import read_checkpoint
from hemivar.ranks.petsc_engine import all_or_none
from tests.ranks.stated import body_of_file

ranks = world()
with all_or_none(ranks):
    body = body_of_file(sys.argv[1])
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
