"""Memory of meshes and of their discretisation: measured against the prediction of ``hemivar.basics.memory``.

Each case runs in a process of its own, so that its peak is its own; Linux and macOS.

    python benchmarks/mesh_memory.py
"""

from __future__ import annotations

import subprocess
import sys
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import hemivar as hv

CASES = (
    ("rectangle", 700, 1),
    ("cross", 500, 1),
    ("refined rectangle", 700, 1),
    ("given rectangle", 700, 1),
    ("box", 50, 1),
    ("refined box", 50, 1),
    ("given box", 50, 1),
    ("rectangle", 300, 2),
    ("box", 20, 2),
)


def mesh(kind: str, cells: int) -> hv.Mesh:
    """The mesh of a case."""
    import hemivar as hv

    flat = not kind.endswith("box")
    if kind.startswith("refined"):
        return (hv.rectangle(cells=cells // 2) if flat else hv.box(cells=cells // 2)).refined()
    made = hv.rectangle(cells=cells, pattern="cross" if kind == "cross" else "right") if flat else hv.box(cells=cells)
    return hv.Mesh(made.points, made.cells, dict(made.boundaries)) if kind.startswith("given") else made


def measure(kind: str, cells: int, order: int, stage: str) -> None:
    """Print number of cells and bytes taken at the peak, of this process."""
    import resource

    import hemivar as hv

    def problem(body: hv.Mesh) -> hv.ContactProblem:
        contact = {} if body.dim == 3 and order == 2 else {"bottom": hv.Contact(hv.Signorini())}
        supports = {"top": hv.Clamped()}
        return hv.ContactProblem(body, hv.Material.lame(1.0, 1.0), contact, supports, order=order)

    def peak() -> int:
        unit = 1 if sys.platform == "darwin" else 1024
        return unit * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss

    hv.discretize(problem(mesh(kind, 2)))  # loads what is needed
    before = peak()
    body = mesh(kind, cells)
    if stage == "problem":
        hv.discretize(problem(body))
    print(body.dim, body.number_of_cells, peak() - before)


def main() -> None:
    """Print the table."""
    from hemivar.basics.memory import mesh_bytes, problem_bytes

    print("| mesh | order | cells | stage | measured, bytes a cell | predicted/measured |")
    print("|---|---:|---:|---|---:|---:|")
    for kind, cells, order in CASES:
        for stage in ("mesh", "problem") if order == 1 else ("problem",):
            code = f"import mesh_memory; mesh_memory.measure({kind!r}, {cells}, {order}, {stage!r})"
            done = subprocess.run(
                [sys.executable, "-c", code], cwd=sys.path[0], capture_output=True, check=True, text=True
            )
            dim, count, taken = map(int, done.stdout.split())
            checked = kind.startswith("given")
            told = mesh_bytes(dim, count, checked=checked) if stage == "mesh" else problem_bytes(dim, count, order)
            print(f"| {kind} | {order} | {count} | {stage} | {taken / count:.0f} | {told / taken:.2f} |", flush=True)


if __name__ == "__main__":
    main()
