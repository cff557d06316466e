"""The command ``hemivar path``: the equilibria of a problem while its load grows."""

from __future__ import annotations

import json as json_module
import math
from pathlib import Path

from hemivar.basics.disk import write_text
from hemivar.branches import Path as EquilibriumPath
from hemivar.branches import follow_path
from hemivar.cli.outputs import Writer
from hemivar.fem import LoadLine
from hemivar.mechanics.statement import ContactProblem
from hemivar.report.path_diagrams import path_record, plot_path
from hemivar.report.saving import save

__all__ = ["run_path"]


def run_path(
    problem: ContactProblem,
    line: LoadLine,
    load_factor: tuple[float, float],
    json: Path | None,
    plot: Path | None,
    writer: Writer,
    *,
    quantity: str,
    max_points: int,
    max_time: float = math.inf,
) -> EquilibriumPath:
    """Follow the path, print what it meets, write what was asked for."""
    path = follow_path(line.loaded, load_factor, unloaded=line.unloaded, max_points=max_points, max_time=max_time)
    record = path_record(path, quantity)
    print(f"\npath              {len(path)} points, {len(path.folds)} folds; {path.ended}")
    if path.perturbed:
        print("                  several points of the boundary met an event at once: this is one of several branches")
    shown = 12
    for fold in path.folds[:shown]:
        print(f"fold              load factor {fold.load_factor:.10g}, point {fold.index}")
    for jump in path.jumps[:shown]:
        how = "loading" if jump.loading else "unloading"
        where = "" if jump.local is not None else ", to no stable branch of this path"
        print(f"jump              load factor {jump.load_factor:.10g} while {how}, point {jump.index}{where}")
    if max(len(path.folds), len(path.jumps)) > shown:
        print(f"                  (of {len(path.folds)} folds and {len(path.jumps)} jumps; all are in the --json file)")
    print(f"max penetration   {path.max_penetration.min():.6g} to {path.max_penetration.max():.6g}")
    for point in record["points"]:
        point["energy"] = point["energy"] if math.isfinite(point["energy"]) else None
    title = problem.title.replace("$", r"\$") or None

    def write(file: Path) -> None:
        write_text(file, json_module.dumps(record, indent=1, allow_nan=False) + "\n")

    writer.write("--json", json, write)
    writer.write("--plot", plot, lambda file: save(plot_path(path, quantity=quantity, title=title), file), picture=True)
    return path
