"""What contact costs on meshes that users bring: a bracket from Gmsh, a cube from arrays, two blocks whose nodes meet
nowhere.

    python benchmarks/own_meshes.py
    python benchmarks/own_meshes.py --only bracket pair --sizes 1 --json rows.json

One row for each body, law and size. ``linear_s`` is the same body without its contact, levels ready, to a relative
residual of 1e-8; ``contact_s`` all of ``hv.solve`` by multigrid to the same, recovery and residual included; ``ratio``
is the second over the first.  Seconds are those of the processor, the least of some turns.  Run it with one thread
(``OMP_NUM_THREADS=1``).
"""

from __future__ import annotations

import argparse
import gc
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from common import show

import hemivar as hv
from hemivar import gallery
from hemivar.systems.body_on_levels import levels_of

TOLERANCE = 1e-8
#: Lengths of the bracket's elements, cells along a side of the cube, and of the blocks along it and across, by size.
LENGTHS, CELLS, PAIRS = (3.2, 2.0, 1.1), (10, 16, 24), ((9, 12), (18, 24), (21, 28))
FRICTIONS: dict[str, hv.laws.Friction] = {"tresca": hv.Tresca(0.05), "coulomb": hv.Coulomb(0.2)}


def bracket(length: float, friction: hv.laws.Friction) -> hv.ContactProblem:
    """An angle of two plates in mm, held at its top, its hole pressed down and aside: a part of its foot touches."""
    import gmsh

    gmsh.initialize(interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        occ = gmsh.model.occ
        angle, _ = occ.fuse([(3, occ.addBox(0, 0, 0, 60, 40, 8))], [(3, occ.addBox(0, 0, 8, 8, 40, 50))])
        occ.cut(angle, [(3, occ.addCylinder(40, 20, -1, 0, 0, 12, 6))])
        occ.synchronize()
        boxes = {tag: gmsh.model.getBoundingBox(2, tag) for _, tag in gmsh.model.getEntities(2)}
        chosen: dict[str, Callable[..., bool]] = {
            "bottom": lambda a, b, c, d, e, f: f < 0.1,
            "top": lambda a, b, c, d, e, f: c > 57.9,
            "hole": lambda a, b, c, d, e, f: a > 33.0 and d < 47.0,
        }
        for name, inside in chosen.items():
            gmsh.model.addPhysicalGroup(2, [tag for tag, box in boxes.items() if inside(*box)], name=name)
        gmsh.model.addPhysicalGroup(3, [tag for _, tag in gmsh.model.getEntities(3)], name="body")
        gmsh.option.setNumber("Mesh.MeshSizeMin", length)
        gmsh.option.setNumber("Mesh.MeshSizeMax", length)
        gmsh.model.mesh.generate(3)
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "bracket.msh"
            gmsh.write(str(path))
            mesh = hv.read_mesh(path)
    finally:
        gmsh.finalize()
    return hv.ContactProblem(
        mesh,
        hv.Material.young(70e3, 0.33),
        {"bottom": hv.Contact(hv.Signorini(), friction)},
        {"top": hv.Clamped()},
        tractions={"hole": (0.3, 0.2, -1.0)},
    )


def pair(cells: tuple[int, int], friction: hv.laws.Friction) -> hv.ContactProblem:
    """A block pressed on another one, which hangs over."""
    up, low = cells
    upper = hv.box(cells=(up, up, up * 5 // 6))
    lower = hv.box((1.5, 1.5, 0.75), cells=(low, low, low // 2), origin=(-0.25, -0.25, -0.75))
    mesh = hv.Mesh.assembled({"u": upper, "l": lower})
    contact = {"u:bottom": hv.Contact(hv.Signorini(), friction, against="l:top")}
    held: dict[str, hv.Support] = {"u:top": hv.Prescribed((0.01, 0.0, -0.05)), "l:bottom": hv.Clamped()}
    return hv.ContactProblem(mesh, hv.Material.lame(4.0, 4.0), contact, held)


def cube(n: int, arrays: bool) -> hv.ContactProblem:
    """The survey's cube, on a mesh that knows the coarser ones or on the same one given by its arrays."""
    from dataclasses import replace

    built = gallery.survey_cube("5.1", n)
    if not arrays:
        return built
    mesh = built.mesh
    plain = hv.Mesh(mesh.points, mesh.cells, boundaries=mesh.boundaries)
    return replace(built, mesh=plain)


def cases(sizes: list[int]) -> dict[str, Callable[[], hv.ContactProblem]]:
    """Every statement by its name."""
    found: dict[str, Callable[[], hv.ContactProblem]] = {}
    for k in sizes:
        for name, friction in FRICTIONS.items():
            found[f"bracket {name} {k}"] = lambda k=k, f=friction: bracket(LENGTHS[k], f)
            found[f"pair {name} {k}"] = lambda k=k, f=friction: pair(PAIRS[k], f)
        for kind in ("built", "arrays"):
            found[f"cube {kind} {k}"] = lambda k=k, kind=kind: cube(CELLS[k], kind == "arrays")
    return found


def measure(name: str, statement: hv.ContactProblem, repeats: int) -> dict[str, Any]:
    """One row of the table."""
    problem, workspace = hv.discretize(statement), hv.systems.Workspace()
    began = time.process_time()
    levels = levels_of(problem, workspace)
    made = time.process_time() - began
    linear, contact = [], []
    for _ in range(repeats):
        gc.collect()
        began = time.process_time()
        _, alone = levels.solve(problem.load, TOLERANCE)
        middle = time.process_time()
        found = hv.solve(problem, "multigrid", rtol=TOLERANCE, workspace=workspace)
        linear.append(middle - began)
        contact.append(time.process_time() - middle)
    return {
        "case": name,
        "unknowns": problem.unknowns,
        "points": problem.contact_points,
        "levels_s": made,
        "linear_s": min(linear),
        "contact_s": min(contact),
        "ratio": min(contact) / min(linear),
        "steps": found.steps,
        "cycles": found.evaluations,
        "linear_cycles": alone,
        "method": found.method,
        "status": found.status.value,
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", nargs="+", default=["bracket", "pair", "cube"], help="beginnings of names")
    parser.add_argument("--sizes", type=int, nargs="+", default=[0, 1], choices=range(3))
    parser.add_argument("--repeats", type=int, default=2)
    parser.add_argument("--json", type=Path, default=None)
    options = parser.parse_args()
    rows = []
    for name, statement in cases(options.sizes).items():
        if name.startswith(tuple(options.only)):
            rows.append(measure(name, statement(), options.repeats))
            print(rows[-1], file=sys.stderr)
    show(rows, options.json)


if __name__ == "__main__":
    main()
