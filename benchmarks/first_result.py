"""Seconds from a cold process to the first result: ``hemivar solve`` on a 32 x 32 problem, and ``import hemivar``.

Seconds are those of the processor, libraries by one thread, modules compiled before.

    python benchmarks/first_result.py --repeats 7

Medians of processes started one after the other, the two kinds in turn; the first start of each, which may have to read
the files from the disk, is listed apart.
"""

from __future__ import annotations

import argparse
import os
import resource
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

from common import show

_PROBLEM = """
[mesh]
rectangle = [1.0, 1.0]
cells = [32, 32]
pattern = "cross"
[material]
lame = [4.0, 4.0]
[loads]
body = [-0.8, -0.8]
[supports]
left = "clamped"
[contact.bottom]
normal = { law = "survey", q_max = 0.3, p_const = 2.0 }
friction = { law = "tresca", bound = 0.5 }
"""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--repeats", type=int, default=7, help="processes of each kind, after the first")
    parser.add_argument("--json", type=Path, default=None, help="also write the rows to this file")
    options = parser.parse_args()
    environment = {key: value for key, value in os.environ.items() if key != "PYTHONDONTWRITEBYTECODE"}
    environment |= {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "problem.toml").write_text(_PROBLEM)
        commands = {
            "hemivar solve, 32 x 32": ([sys.executable, "-m", "hemivar", "solve", "problem.toml"], 0.7),
            "import hemivar": ([sys.executable, "-c", "import hemivar"], 0.2),
            "libraries": ([sys.executable, "-c", "import numpy, scipy.sparse.linalg, scipy.linalg, skfem"], None),
            "python alone": ([sys.executable, "-c", "pass"], None),
        }
        seconds: dict[str, list[float]] = {name: [] for name in commands}
        for _ in range(options.repeats + 1):
            for name, (command, _) in commands.items():
                before = resource.getrusage(resource.RUSAGE_CHILDREN)
                subprocess.run(command, cwd=folder, check=True, capture_output=True, env=environment)
                after = resource.getrusage(resource.RUSAGE_CHILDREN)
                seconds[name].append(after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime)
    rows = []
    for name, (_, target) in commands.items():
        median = statistics.median(seconds[name][1:])
        rows.append(
            {
                "process": name,
                "median_s": median,
                "least_s": min(seconds[name][1:]),
                "first_s": seconds[name][0],
                "target_s": "" if target is None else target,
                "reached": "" if target is None else median < target,
            }
        )
    show(rows, options.json)


if __name__ == "__main__":
    main()
