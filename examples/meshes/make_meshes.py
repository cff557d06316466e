"""Make the meshes of the examples with Gmsh (``pip install ".[gmsh]"``).

Run ``python examples/meshes/make_meshes.py``. The results are part of the repository: the examples run without Gmsh.
"""

from __future__ import annotations

import math
from pathlib import Path

RADIUS = 1.0
CONTACT_ANGLE = 0.2  # the arc that may touch the plane ends at +- this angle from the bottom
FINE, COARSE = 0.0025, 0.12  # lengths of elements at the bottom and far from it
FINE_WITHIN, COARSE_FROM = 0.075, 1.0  # distances from the bottom


def half_disc(path: Path) -> None:
    """A half disc, flat side up, bottom at the origin: boundaries top, contact and side, region body."""
    import gmsh

    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.model.add("half_disc")
    geo = gmsh.model.geo

    def on_arc(angle: float) -> int:
        return geo.addPoint(RADIUS * math.sin(angle), RADIUS * (1.0 - math.cos(angle)), 0.0)

    centre = geo.addPoint(0.0, RADIUS, 0.0)
    left, foot_left, bottom, foot_right, right = (
        on_arc(angle) for angle in (-math.pi / 2, -CONTACT_ANGLE, 0.0, CONTACT_ANGLE, math.pi / 2)
    )
    arcs = [
        geo.addCircleArc(a, centre, b)
        for a, b in ((left, foot_left), (foot_left, bottom), (bottom, foot_right), (foot_right, right))
    ]
    top = [geo.addLine(right, centre), geo.addLine(centre, left)]
    surface = geo.addPlaneSurface([geo.addCurveLoop([*arcs, *top])])
    geo.synchronize()
    gmsh.model.addPhysicalGroup(1, top, name="top")
    gmsh.model.addPhysicalGroup(1, arcs[1:3], name="contact")
    gmsh.model.addPhysicalGroup(1, [arcs[0], arcs[3]], name="side")
    gmsh.model.addPhysicalGroup(2, [surface], name="body")
    field = gmsh.model.mesh.field
    distance, size = field.add("Distance"), field.add("Threshold")
    field.setNumbers(distance, "PointsList", [bottom])
    for key, value in (
        ("InField", distance),
        ("SizeMin", FINE),
        ("SizeMax", COARSE),
        ("DistMin", FINE_WITHIN),
        ("DistMax", COARSE_FROM),
    ):
        field.setNumber(size, key, value)
    field.setAsBackgroundMesh(size)
    for key in ("MeshSizeExtendFromBoundary", "MeshSizeFromPoints", "MeshSizeFromCurvature"):
        gmsh.option.setNumber(f"Mesh.{key}", 0)
    gmsh.model.mesh.generate(2)
    gmsh.option.setNumber("Mesh.MshFileVersion", 4.1)
    gmsh.write(str(path))
    gmsh.finalize()


def bracket(path: Path) -> None:
    """An angle bracket in mm with a bolt hole and a fillet: boundaries wall, seat, bolt and fillet, region steel."""
    import gmsh

    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.model.add("bracket")
    geo = gmsh.model.geo

    def point(x: float, y: float, size: float) -> int:
        return geo.addPoint(x, y, 0.0, size)

    corners = [(0.0, 0.0), (80.0, 0.0), (80.0, 12.0), (20.0, 12.0), (12.0, 20.0), (12.0, 100.0), (0.0, 100.0)]
    sizes = [2.0, 5.0, 5.0, 1.0, 1.0, 3.0, 3.0]
    points = [point(x, y, size) for (x, y), size in zip(corners, sizes, strict=True)]
    lines = [geo.addLine(points[k], points[k + 1]) for k in (0, 1, 2)]
    fillet = geo.addCircleArc(points[3], point(20.0, 20.0, 1.0), points[4])
    lines += [fillet, geo.addLine(points[4], points[5]), geo.addLine(points[5], points[6])]
    wall = geo.addLine(points[6], points[0])
    middle = point(6.0, 80.0, 1.0)
    around = [point(6.0 + 3.0 * x, 80.0 + 3.0 * y, 1.0) for x, y in ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0))]
    hole = [geo.addCircleArc(around[k], middle, around[(k + 1) % 4]) for k in range(4)]
    surface = geo.addPlaneSurface([geo.addCurveLoop([*lines, wall]), geo.addCurveLoop(hole)])
    geo.synchronize()
    for name, curves in (("wall", [wall]), ("seat", [lines[2]]), ("bolt", hole), ("fillet", [fillet])):
        gmsh.model.addPhysicalGroup(1, curves, name=name)
    gmsh.model.addPhysicalGroup(2, [surface], name="steel")
    gmsh.model.mesh.generate(2)
    gmsh.option.setNumber("Mesh.MshFileVersion", 4.1)
    gmsh.write(str(path))
    gmsh.finalize()


def wheel(path: Path) -> None:
    """A railway wheel in mm, seen from the side, on a piece of rail that it touches at the origin.

    Regions wheel and rail, which share no node; boundaries hub and tread, head and foot.
    """
    import gmsh

    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.model.add("wheel")
    geo, radius, bore, length, height, angle = gmsh.model.geo, 460.0, 90.0, 400.0, 150.0, 0.06
    middle = geo.addPoint(0.0, radius, 0.0)

    def on_circle(size: float, turn: float) -> int:
        return geo.addPoint(size * math.sin(turn), radius - size * math.cos(turn), 0.0)

    def ring(size: float, turns: list[float]) -> list[int]:
        points = [on_circle(size, turn) for turn in turns]
        ends = zip(points, [*points[1:], points[0]], strict=True)
        return [geo.addCircleArc(one, middle, other) for one, other in ends]

    rim = ring(radius, [-angle, 0.0, angle, math.pi / 2, math.pi, -math.pi / 2])
    hub = ring(bore, [0.0, math.pi / 2, math.pi, -math.pi / 2])
    disc = geo.addPlaneSurface([geo.addCurveLoop(rim), geo.addCurveLoop(hub)])
    near = radius * math.sin(angle)
    corners = [
        (-length, -height),
        (length, -height),
        (length, 0.0),
        (near, 0.0),
        (0.0, 0.0),
        (-near, 0.0),
        (-length, 0.0),
    ]
    points = [geo.addPoint(x, y, 0.0) for x, y in corners]
    lines = [geo.addLine(one, other) for one, other in zip(points, [*points[1:], points[0]], strict=True)]
    rail = geo.addPlaneSurface([geo.addCurveLoop(lines)])
    geo.synchronize()
    for name, curves in (("tread", rim[:2]), ("hub", hub), ("head", lines[3:5]), ("foot", lines[:1])):
        gmsh.model.addPhysicalGroup(1, curves, name=name)
    for name, surface in (("wheel", disc), ("rail", rail)):
        gmsh.model.addPhysicalGroup(2, [surface], name=name)
    field = gmsh.model.mesh.field
    field.add("MathEval", 1)
    field.setString(1, "F", "Min(50, 0.8 + 0.2*Max(Sqrt(x*x + y*y) - 7, 0))")
    field.setAsBackgroundMesh(1)
    for key in ("MeshSizeExtendFromBoundary", "MeshSizeFromPoints", "MeshSizeFromCurvature"):
        gmsh.option.setNumber(f"Mesh.{key}", 0)
    gmsh.model.mesh.generate(2)
    gmsh.option.setNumber("Mesh.MshFileVersion", 4.1)
    gmsh.write(str(path))
    gmsh.finalize()


if __name__ == "__main__":
    half_disc(Path(__file__).parent / "half_disc.msh")
    bracket(Path(__file__).parent / "bracket.msh")
    wheel(Path(__file__).parent / "wheel.msh")
