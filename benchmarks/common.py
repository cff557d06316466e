"""What the benchmarks share: machine facts, peak memory, a table, a JSON file."""

from __future__ import annotations

import argparse
import importlib.metadata
import json
import os
import platform
import resource
from collections.abc import Sequence
from pathlib import Path
from typing import Any


def machine() -> dict[str, Any]:
    """Facts without which a time means nothing."""
    packages = ("hemivar", "numpy", "scipy", "scikit-fem", "pypardiso")
    versions = {}
    for name in packages:
        try:
            versions[name] = importlib.metadata.version(name)
        except importlib.metadata.PackageNotFoundError:
            continue
    model = platform.processor()
    info = Path("/proc/cpuinfo")
    if info.exists():
        model = next(
            (line.split(":")[1].strip() for line in info.read_text().splitlines() if "model name" in line), model
        )
    return {"cpu": model, "cores": os.cpu_count(), "python": platform.python_version(), **versions}


def peak_mib() -> float:
    """Largest resident memory of this process so far."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0


def arguments(description: str, sizes: Sequence[int]) -> argparse.Namespace:
    """``--sizes`` and ``--json``."""
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("--sizes", type=int, nargs="+", default=list(sizes), help="cells along a side, 1/h")
    parser.add_argument("--json", type=Path, default=None, help="also write the rows to this file")
    return parser.parse_args()


def show(rows: Sequence[dict[str, Any]], path: Path | None) -> None:
    """Print the rows as a Markdown table, after the facts of the machine, and write them as JSON."""
    facts = machine()
    print(", ".join(f"{key} {value}" for key, value in facts.items()))
    columns = list(rows[0])
    print("| " + " | ".join(columns) + " |")
    print("|" + "---|" * len(columns))
    for row in rows:
        cells = (f"{row[c]:.3g}" if isinstance(row[c], float) else str(row[c]) for c in columns)
        print("| " + " | ".join(cells) + " |")
    if path is not None:
        path.write_text(json.dumps({"machine": facts, "rows": list(rows)}, indent=1))
