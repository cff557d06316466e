"""Run by mpirun: many commands one after the other in the same processes.  ``hostile_batch.py CASES.json FOLDER``.

The cases are a list of ``[name, arguments]``; of each that ends, ``FOLDER/NUMBER.json`` holds the exit codes of all
ranks and what they said.  A command that aborts the run ends this script too: then that file is not there.
"""

import json
import os
import sys
from pathlib import Path

from mpi4py import MPI

from hemivar.cli import main

comm = MPI.COMM_WORLD
folder = Path(sys.argv[2])
streams = [os.dup(1), os.dup(2)]
for number, (_, arguments) in enumerate(json.loads(Path(sys.argv[1]).read_text(encoding="utf-8"))):
    said = folder / f"{number}.{comm.rank}.txt"
    with said.open("wb") as file:
        for stream in (1, 2):
            os.dup2(file.fileno(), stream)
        try:
            code = main(arguments)
        except SystemExit as end:
            code = int(end.code or 0)
        sys.stdout.flush()
        sys.stderr.flush()
        for stream, old in zip((1, 2), streams, strict=True):
            os.dup2(old, stream)
    everything = comm.gather((code, said.read_text(encoding="utf-8", errors="surrogateescape")))
    if comm.rank == 0:
        part = folder / f"{number}.part"
        part.write_text(json.dumps(everything), encoding="utf-8")
        part.rename(folder / f"{number}.json")
    comm.Barrier()
