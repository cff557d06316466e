"""What contact costs on meshes that users bring: a bracket from Gmsh, a cube from arrays, two blocks whose nodes meet
nowhere, and assemblies from Gmsh that friction holds: bolted plates, a wheel on concrete, a vessel on a floor.

    python benchmarks/own_meshes.py
    python benchmarks/own_meshes.py --only flange plates wheel vessel "bracket coulomb" --sizes 0 --json rows.json

One row for each body, law and size. ``linear_s`` is the same body without its contact, levels ready, to a relative
residual of 1e-8, and where nothing but contact holds the body, with its contact points held; ``contact_s`` all of
``hv.solve`` by multigrid to the same, recovery and residual included; ``ratio`` is the second over the first.
``below_rest`` is what the solution has less energy than rest. Seconds are those of the processor, the least of some
turns.
Run it with one thread (``OMP_NUM_THREADS=1``).
"""

from __future__ import annotations

import argparse
import gc
import math
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from common import show

import hemivar as hv
from hemivar import gallery
from hemivar.linear.krylov import conjugate_gradients
from hemivar.linear.levels import LevelMatrix, Preconditioner
from hemivar.linear.threads import one_thread
from hemivar.systems.body_on_levels import ElasticMultigrid, levels_of
from hemivar.systems.free_unknowns import free_unknowns

TOLERANCE = 1e-8
#: Lengths of the bracket's elements, cells along a side of the cube, and of the blocks along it and across, by size.
LENGTHS, CELLS, PAIRS = (3.2, 2.0, 1.1), (10, 16, 24), ((9, 12), (18, 24), (21, 28))
#: Lengths of elements of the plates, above and below, of the wheel where it touches, and of the vessel.
PLATES, TOUCHES, VESSELS = ((4.0, 5.0), (2.2, 2.8), (1.6, 2.0)), (4.0, 2.6, 1.9), (14.0, 9.0, 6.0)
FRICTIONS: dict[str, hv.laws.Friction] = {"tresca": hv.Tresca(0.05), "coulomb": hv.Coulomb(0.2)}


#: Whether a face is within a box (x0, y0, z0, x1, y1, z1).
_Faces = dict[str, Callable[..., bool]]


def meshed(build: Callable[[Any], dict[str, tuple[int, _Faces]]], length: Callable[..., float]) -> hv.Mesh:
    """The mesh of what ``build`` makes of boxes and cylinders: volumes by their names, each with the names of its
    faces, the first that fits; ``length(x, y, z)`` is that of the elements."""
    import gmsh

    gmsh.initialize(interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        bodies = build(gmsh.model.occ)
        gmsh.model.occ.synchronize()
        for body, (volume, chosen) in bodies.items():
            gmsh.model.addPhysicalGroup(3, [volume], name=body)
            groups: dict[str, list[int]] = {}
            for _, tag in gmsh.model.getBoundary([(3, volume)], oriented=False):
                box = gmsh.model.getBoundingBox(2, tag)
                name = next((name for name, inside in chosen.items() if inside(*box)), None)
                if name is not None:
                    groups.setdefault(name, []).append(tag)
            for name, tags in groups.items():
                gmsh.model.addPhysicalGroup(2, tags, name=name)
        for source in ("ExtendFromBoundary", "FromPoints", "FromCurvature"):
            gmsh.option.setNumber(f"Mesh.MeshSize{source}", 0)
        gmsh.model.mesh.setSizeCallback(lambda dim, tag, x, y, z, given: length(x, y, z))
        gmsh.model.mesh.generate(3)
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "body.msh"
            gmsh.write(str(path))
            return hv.read_mesh(path)
    finally:
        gmsh.finalize()


def bracket(length: float, friction: hv.laws.Friction) -> hv.ContactProblem:
    """An angle of two plates in mm, held at its top, its hole pressed down and aside: a part of its foot touches."""

    def build(occ: Any) -> dict[str, tuple[int, _Faces]]:
        angle, _ = occ.fuse([(3, occ.addBox(0, 0, 0, 60, 40, 8))], [(3, occ.addBox(0, 0, 8, 8, 40, 50))])
        whole, _ = occ.cut(angle, [(3, occ.addCylinder(40, 20, -1, 0, 0, 12, 6))])
        faces: _Faces = {
            "bottom": lambda a, b, c, d, e, f: f < 0.1,
            "top": lambda a, b, c, d, e, f: c > 57.9,
            "hole": lambda a, b, c, d, e, f: a > 33.0 and d < 47.0,
        }
        return {"body": (whole[0][1], faces)}

    return hv.ContactProblem(
        meshed(build, lambda x, y, z: length),
        hv.Material.young(70e3, 0.33),
        {"bottom": hv.Contact(hv.Signorini(), friction)},
        {"top": hv.Clamped()},
        tractions={"hole": (0.3, 0.2, -1.0)},
    )


def plates(lengths: tuple[float, float]) -> hv.ContactProblem:
    """Two plates of steel in mm, one on the other, pressed together round two holes, the lower one held at an end; the
    upper one is pulled at the other, and friction holds it."""

    def build(occ: Any) -> dict[str, tuple[int, _Faces]]:
        bodies = {}
        for name, low, out in (("upper", 0.0, 10.0), ("lower", -10.0, -10.0)):
            holes = [(3, occ.addCylinder(x, 30, low - 1, 0, 0, 12, 5.5)) for x in (30, 90)]
            whole, _ = occ.cut([(3, occ.addBox(0, 0, low, 120, 60, 10))], holes)
            parts, _ = occ.fragment(whole, [(2, occ.addDisk(x, 30, out, 10, 10)) for x in (30, 90)])
            faces: _Faces = {
                f"{name}_joint": lambda a, b, c, d, e, f: max(abs(c), abs(f)) < 1e-3,
                f"{name}_washers": lambda a, b, c, d, e, f, z=out: max(abs(c - z), abs(f - z)) < 1e-3 and d - a < 25.0,
                f"{name}_left": lambda a, b, c, d, e, f: d < 1e-3,
                f"{name}_right": lambda a, b, c, d, e, f: a > 119.9,
            }
            bodies[name] = (next(tag for dim, tag in parts if dim == 3), faces)
        return bodies

    bolts = hv.Pressure(45.6)
    return hv.ContactProblem(
        meshed(build, lambda x, y, z: lengths[z < 0.0]),
        hv.Material.young(210e3, 0.3),
        {"upper_joint": hv.Contact(hv.Signorini(), hv.Coulomb(0.15), against="lower_joint")},
        {"lower_left": hv.Clamped()},
        tractions={"upper_washers": bolts, "lower_washers": bolts, "upper_right": (2.0, 0.0, 2.0)},
    )


def wheel(length: float) -> hv.ContactProblem:
    """A wheel of steel in mm, pressed by its axle on a block of concrete and pushed along it."""

    def build(occ: Any) -> dict[str, tuple[int, _Faces]]:
        disk = (3, occ.addCylinder(0, -20, 100, 0, 40, 0, 100))
        steel, _ = occ.cut([disk], [(3, occ.addCylinder(0, -21, 100, 0, 42, 0, 25))])
        faces: _Faces = {
            "bore": lambda a, b, c, d, e, f: d < 30.0,
            "rim": lambda a, b, c, d, e, f: e - b > 39.0,
        }
        block: _Faces = {
            "ground": lambda a, b, c, d, e, f: f < -59.0,
            "top": lambda a, b, c, d, e, f: c > -1e-3,
        }
        return {"steel": (steel[0][1], faces), "concrete": (occ.addBox(-80, -50, -60, 160, 100, 60), block)}

    def near(x: float, y: float, z: float) -> float:
        return length * min(1.0 + max(math.hypot(x, z) - 20.0, 0.0) / 40.0, 3.0)

    materials = {"steel": hv.Material.young(210e3, 0.3), "concrete": hv.Material.young(30e3, 0.2)}
    return hv.ContactProblem(
        meshed(build, near),
        hv.Material.by_region(materials),
        {"rim": hv.Contact(hv.Signorini(), hv.Coulomb(0.5), against="top")},
        {"ground": hv.Clamped(), "bore": hv.Fixed(x=0.02, y=0.0)},
        tractions={"bore": (0.0, 0.0, -3.0)},
    )


def vessel(length: float) -> hv.ContactProblem:
    """A pot of steel in mm under inner pressure that stands on a floor, pushed aside at its rim."""

    def build(occ: Any) -> dict[str, tuple[int, _Faces]]:
        pot = (3, occ.addCylinder(0, 0, 0, 0, 0, 150, 100))
        whole, _ = occ.cut([pot], [(3, occ.addCylinder(0, 0, 10, 0, 0, 141, 92))])
        faces: _Faces = {
            "foot": lambda a, b, c, d, e, f: f < 1e-3,
            "rim": lambda a, b, c, d, e, f: c > 149.0,
            "inside": lambda a, b, c, d, e, f: d < 93.0,
        }
        return {"steel": (whole[0][1], faces)}

    return hv.ContactProblem(
        meshed(build, lambda x, y, z: length),
        hv.Material.young(210e3, 0.3),
        {"foot": hv.Contact(hv.Signorini(), hv.Coulomb(0.3))},
        tractions={"inside": hv.Pressure(0.2), "rim": (0.3, 0.0, 0.0)},
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
        found[f"flange {k}" if k else "plates"] = lambda k=k: plates(PLATES[k])
        found[f"wheel {k}"] = lambda k=k: wheel(TOUCHES[k])
        found[f"vessel {k}"] = lambda k=k: vessel(VESSELS[k])
        for kind in ("built", "arrays"):
            found[f"cube {kind} {k}"] = lambda k=k, kind=kind: cube(CELLS[k], kind == "arrays")
    return found


def alone(problem: hv.DiscreteProblem, levels: ElasticMultigrid, repeats: int) -> tuple[float, int]:
    """Seconds and cycles of the body without its contact; its contact points are held where nothing else holds it."""
    free = free_unknowns(problem)
    if free is not None and not free.shape[1]:
        found = [timed(lambda: levels.solve(problem.load, TOLERANCE)[1]) for _ in range(repeats)]
        return min(found)
    stack, top, load = levels.levels, len(levels.levels.sizes) - 1, problem.load.copy()
    held, nothing = np.ones(stack.own[top].size, dtype=bool), np.zeros(stack.levels[top].coupling.keys.size)
    load[stack.levels[top].contact[stack.own[top]]] = 0.0
    changed = stack.borrow(top)
    changed.change_values(held, nothing)
    changed.prepare()

    def solved() -> int:
        A, cycle, size = LevelMatrix(changed, top), Preconditioner(changed, top), TOLERANCE * np.linalg.norm(load)
        diagonal = stack.diagonal(top)
        return conjugate_gradients(A, diagonal, load, cycle, float(size), 200, flexible=cycle.flexible).iterations

    with one_thread():
        found = [timed(solved) for _ in range(repeats)]
    stack.give_back(changed)
    return min(found)


def timed(work: Callable[[], int]) -> tuple[float, int]:
    began = time.process_time()
    cycles = work()
    return time.process_time() - began, cycles


def measure(name: str, statement: hv.ContactProblem, repeats: int) -> dict[str, Any]:
    """One row of the table."""
    problem, workspace = hv.discretize(statement), hv.systems.Workspace()
    began = time.process_time()
    levels = levels_of(problem, workspace)
    made = time.process_time() - began
    linear, cycles = alone(problem, levels, repeats + 1)
    contact = []
    for _ in range(repeats):
        gc.collect()
        began = time.process_time()
        found = hv.solve(problem, "multigrid", rtol=TOLERANCE, workspace=workspace)
        contact.append(time.process_time() - began)
    return {
        "case": name,
        "unknowns": problem.unknowns,
        "points": problem.contact_points,
        "levels_s": made,
        "linear_s": linear,
        "contact_s": min(contact),
        "ratio": min(contact) / linear,
        "steps": found.steps,
        "cycles": found.evaluations,
        "linear_cycles": cycles,
        "below_rest": problem.energy(np.zeros(problem.unknowns)) - found.energy,
        "method": found.method,
        "status": found.status.value,
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", nargs="+", default=[""], help="beginnings of names")
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
