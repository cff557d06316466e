"""Contact with rigid obstacles against closed forms, on meshes that are refined: errors and observed orders.

    python benchmarks/verification.py --case line-circle line-plane --sizes 4 8 16

Cases: ``line-circle`` (flat body, rigid cylinder), ``line-plane`` (curved body, rigid plane), ``sphere-sphere`` (flat
body, rigid sphere, a quarter in space), ``sphere-plane`` (curved body, rigid plane), ``sphere-full`` (as
``sphere-sphere``, without planes of symmetry), ``cattaneo`` (partial slip, Coulomb), ``cattaneo-bound`` (partial slip,
frozen bound), ``patch`` (exact).  ``--sizes`` are numbers of cells along the half width (or radius) a of the contact.

The bodies are squares and cubes of side 40 a (in space 10 a) about the contact, on whose outer sides the displacement
of a half space under the resultant force is prescribed (Flamant, Boussinesq; K. L. Johnson, Contact Mechanics, 1985,
sections 2.2, 2.3 and 3.2), so that little is cut off; ``--sides`` changes that.  The contact does not know the force:
the depth of the obstacle is given, and force, half width and pressure are compared with the closed form.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import skfem
from common import machine, peak_mib, show

import hemivar as hv

Array = np.ndarray


# ---- closed forms ------------------------------------------------------------------------------------------


def contact_modulus(young: float, poisson: float) -> float:
    """E* of an elastic body on a rigid one."""
    return young / (1.0 - poisson**2)


def flamant(points: Array, force: float, young: float, poisson: float, datum: float) -> Array:
    """Displacement (k, 2) of the half plane y > 0 under a force along +y at the origin (plane strain).

    Vertical displacements of the surface are measured against that at the distance ``datum``.
    """
    x, y = points.T
    square = x**2 + y**2
    scale = force * (1.0 + poisson) / (np.pi * young)
    along = x * y / square - (1.0 - 2.0 * poisson) * np.arctan2(x, y)
    down = y**2 / square - (1.0 - poisson) * np.log(square / datum**2)
    return scale * np.column_stack([along, down])


def flamant_tangential(points: Array, force: float, young: float, poisson: float, datum: float) -> Array:
    """The same under a force along +x."""
    x, y = points.T
    square = x**2 + y**2
    scale = force * (1.0 + poisson) / (np.pi * young)
    along = -(y**2) / square - (1.0 - poisson) * np.log(square / datum**2)
    down = x * y / square + (1.0 - 2.0 * poisson) * np.arctan2(x, y)
    return scale * np.column_stack([along, down])


def boussinesq(points: Array, force: float, young: float, poisson: float) -> Array:
    """Displacement (k, 3) of the half space z > 0 under a force along +z at the origin."""
    x, y, z = points.T
    rho = np.linalg.norm(points, axis=1)
    scale = force * (1.0 + poisson) / (2.0 * np.pi * young)
    outward = z / rho**3 - (1.0 - 2.0 * poisson) / (rho * (rho + z))
    return scale * np.column_stack([x * outward, y * outward, z**2 / rho**3 + 2.0 * (1.0 - poisson) / rho])


@dataclass(frozen=True)
class LineHertz:
    """A cylinder of radius R on a flat, half width a, per unit of length."""

    radius: float
    half_width: float
    modulus: float

    @property
    def force(self) -> float:
        return float(np.pi * self.modulus * self.half_width**2 / (4.0 * self.radius))

    @property
    def peak(self) -> float:
        return 2.0 * self.force / (np.pi * self.half_width)

    def pressure(self, x: Array) -> Array:
        return self.peak * np.sqrt(np.maximum(1.0 - (x / self.half_width) ** 2, 0.0))

    def approach(self, datum: float) -> float:
        """Displacement of the middle against that of the surface at the distance ``datum`` under the point force."""
        return float(2.0 * self.force / (np.pi * self.modulus) * (np.log(2.0 * datum / self.half_width) + 0.5))


@dataclass(frozen=True)
class PointHertz:
    """A sphere of radius R on a flat, contact radius a."""

    radius: float
    half_width: float
    modulus: float

    @property
    def force(self) -> float:
        return 4.0 * self.modulus * self.half_width**3 / (3.0 * self.radius)

    @property
    def peak(self) -> float:
        return float(1.5 * self.force / (np.pi * self.half_width**2))

    def pressure(self, r: Array) -> Array:
        return self.peak * np.sqrt(np.maximum(1.0 - (r / self.half_width) ** 2, 0.0))

    @property
    def approach(self) -> float:
        return self.half_width**2 / self.radius


# ---- meshes ------------------------------------------------------------------------------------------------


def graded(length: float, fine: float, cells: float) -> Array:
    """Points of [0, length], about ``cells`` of them within ``fine`` of 0 and growing steadily from there."""
    steepness = float(np.arcsinh(length / fine))
    count = max(round(cells * steepness), 2)
    return fine * np.sinh(steepness * np.arange(count + 1) / count)


def plane_mesh(side: float, half_width: float, cells: float, patch: float, symmetric: bool) -> hv.Mesh:
    """[0, side]^2, or [-side, side] x [0, side], graded towards the origin; ``contact`` lies within ``patch``."""
    line = graded(side, half_width, cells)
    across = line if symmetric else np.concatenate([-line[:0:-1], line])
    flat = hv.rectangle((1.0, 1.0), (len(across) - 1, len(line) - 1), pattern="cross")
    index = flat.points * [len(across) - 1, len(line) - 1]
    points = np.column_stack(
        [np.interp(column, np.arange(len(axis)), axis) for column, axis in zip(index.T, (across, line), strict=True)]
    )
    mesh = hv.Mesh(points, flat.cells, dict(flat.boundaries))
    outer = {name: mesh.boundaries[name] for name in ("left", "right", "top")}
    return mesh.with_boundaries({**outer, "contact": _touching(patch)})


def box_mesh(side: float, half_width: float, cells: float, patch: float, symmetric: bool) -> hv.Mesh:
    """[0, side]^3, or [-side, side]^2 x [0, side], graded towards the origin; six tetrahedra in each box."""
    line = graded(side, half_width, cells)
    across = line if symmetric else np.concatenate([-line[:0:-1], line])
    raw = skfem.MeshTet.init_tensor(across, across, line)
    mesh = hv.Mesh.oriented(raw.p.T, raw.t.T.astype(int))
    small = 1e-9 * side
    planes = {"left": lambda x: x[:, 0] < small, "front": lambda x: x[:, 1] < small} if symmetric else {}
    return mesh.with_boundaries(
        {
            **planes,
            "far": lambda x: (np.abs(x[:, :2]) > side - small).any(axis=1) | (x[:, 2] > side - small),
            "contact": _touching(patch),
        }
    )


def _touching(patch: float) -> Callable[[Array], Array]:
    return lambda x: (np.abs(x[:, -1]) < 1e-12 * patch) & (np.abs(x[:, :-1]) < patch).all(axis=1)


def rounded(mesh: hv.Mesh, radius: float, side: float) -> hv.Mesh:
    """The mesh with its underside rounded to a cylinder or sphere; the other end stays flat."""
    if np.sqrt(2.0) * side >= radius:
        raise SystemExit("the rounded body is wider than its radius: take --half-width times --sides below 0.7")
    points = mesh.points.copy()
    rise = radius - np.sqrt(radius**2 - (points[:, :-1] ** 2).sum(axis=1))
    points[:, -1] += rise * (1.0 - points[:, -1] / side)
    return hv.Mesh(points, mesh.cells, dict(mesh.boundaries))


# ---- Hertz -------------------------------------------------------------------------------------------------

YOUNG, POISSON, RADIUS = 1.0, 0.3, 1.0


def line_problem(
    cells: float,
    view: str = "circle",
    normals: str = "obstacle",
    half_width: float = 0.001,
    sides: float = 40.0,
    quadrature: hv.mechanics.Quadrature = hv.mechanics.Quadrature.NODAL,
) -> tuple[hv.ContactProblem, LineHertz]:
    """Half of a plane body and a rigid circle pressed into it, or of a round body on a rigid line."""
    known = LineHertz(RADIUS, half_width, contact_modulus(YOUNG, POISSON))
    side = sides * half_width
    mesh = plane_mesh(side, half_width, cells, 2.0 * half_width, symmetric=True)
    depth = known.approach(side)
    obstacle: Any = hv.mechanics.Sphere((0.0, depth - RADIUS), RADIUS)
    if view == "plane":
        mesh, obstacle = rounded(mesh, RADIUS, side), hv.Plane((0.0, depth), (0.0, 1.0))
    far = hv.Prescribed(lambda x: flamant(x, known.force, YOUNG, POISSON, side))
    return (
        hv.ContactProblem(
            mesh,
            hv.Material.young(YOUNG, POISSON),
            contact={"contact": hv.Contact(hv.Signorini(), obstacle=obstacle, normals=hv.mechanics.Normals(normals))},
            supports={"left": hv.Fixed(x=0.0), "right": far, "top": far},
            quadrature=quadrature,
        ),
        known,
    )


def sphere_problem(
    cells: float,
    view: str = "sphere",
    normals: str = "obstacle",
    half_width: float = 0.001,
    sides: float = 10.0,
    symmetric: bool = True,
) -> tuple[hv.ContactProblem, PointHertz]:
    """A body in space (a quarter of it, if ``symmetric``) and a rigid sphere, or a round body and a rigid plane."""
    known = PointHertz(RADIUS, half_width, contact_modulus(YOUNG, POISSON))
    side = sides * half_width
    mesh = box_mesh(side, half_width, cells, 1.5 * half_width, symmetric)
    obstacle: Any = hv.mechanics.Sphere((0.0, 0.0, known.approach - RADIUS), RADIUS)
    if view == "plane":
        mesh, obstacle = rounded(mesh, RADIUS, side), hv.Plane((0.0, 0.0, known.approach), (0.0, 0.0, 1.0))
    supports: dict[str, Any] = {"far": hv.Prescribed(lambda x: boussinesq(x, known.force, YOUNG, POISSON))}
    if symmetric:
        supports |= {"left": hv.Fixed(x=0.0), "front": hv.Fixed(y=0.0)}
    return (
        hv.ContactProblem(
            mesh,
            hv.Material.young(YOUNG, POISSON),
            contact={"contact": hv.Contact(hv.Signorini(), obstacle=obstacle, normals=hv.mechanics.Normals(normals))},
            supports=supports,
        ),
        known,
    )


def hertz_errors(solution: hv.Solution, known: LineHertz | PointHertz) -> dict[str, float]:
    """Relative errors of force, half width, largest pressure and pressure (in the mean square).

    ``worst`` is the largest error of the pressure at a node within 0.8 a, relative to p0. The half width follows from
    the second moment of the pressure: a^2/4 for a line contact, 2 a^2/5 for a point.
    """
    discrete = solution.problem
    points, weights, pressure = discrete.contact.points, discrete.contact.weights, solution.pressure
    distance = np.linalg.norm(points[:, :-1], axis=1)
    line = isinstance(known, LineHertz)
    total = float(weights @ pressure)
    moment = float(weights @ (pressure * distance**2)) / total
    # a symmetric half or quarter carries its share of the force
    force = total * 2.0 ** np.count_nonzero(points[:, :-1].min(axis=0) >= 0.0)
    exact = known.pressure(distance)
    return {
        "force": force / known.force - 1.0,
        "half_width": float(np.sqrt(moment * (4.0 if line else 2.5))) / known.half_width - 1.0,
        "peak": float(pressure.max()) / known.peak - 1.0,
        "pressure": float(np.sqrt(weights @ (pressure - exact) ** 2 / (weights @ exact**2))),
        "worst": float(np.abs(pressure - exact)[distance < 0.8 * known.half_width].max()) / known.peak,
    }


# ---- Cattaneo and Mindlin ----------------------------------------------------------------------------------

FRICTION = 0.2


@dataclass(frozen=True)
class Cattaneo:
    """Partial slip of a line contact: sticking within |x| < c (Johnson, section 7.2)."""

    normal: LineHertz
    tangential_force: float
    friction: float = FRICTION

    @property
    def stick(self) -> float:
        """Half width c of the sticking zone."""
        limit = self.friction * self.normal.force
        return float(self.normal.half_width * np.sqrt(1.0 - self.tangential_force / limit))

    def traction(self, x: Array) -> Array:
        """q(x)."""
        share = self.stick / self.normal.half_width
        within = np.sqrt(np.maximum(1.0 - (x / self.stick) ** 2, 0.0))
        return self.friction * (self.normal.pressure(x) - share * self.normal.peak * within)

    def shift(self, datum: float) -> float:
        """Tangential displacement of the sticking zone against the surface at ``datum`` under the point force."""
        inner = LineHertz(self.normal.radius, self.stick, self.normal.modulus)
        return self.friction * (self.normal.approach(datum) - inner.approach(datum))


#: Two equal cylinders of radius 8, E = 200, nu = 0.3 press with 10 (per length) and are sheared with 0.93616:
#: a = 0.68078, c = 0.49651.
def cattaneo_data(poisson: float) -> tuple[Cattaneo, float]:
    """The closed form, and Young's modulus for this Poisson's ratio.

    Two equal cylinders are one body with the sum of their compliances on a rigid circle of half their radius, provided
    that this body has no coupling between normal and tangential displacement, as two equal ones have none.
    """
    modulus = 200.0 / (1.0 - 0.3**2) / 2.0
    half_width = float(np.sqrt(4.0 * 10.0 * 4.0 / (np.pi * modulus)))
    return Cattaneo(LineHertz(4.0, half_width, modulus), 16 * 0.05851), modulus * (1.0 - poisson**2)


def cattaneo_problem(
    cells: float, poisson: float = 0.4999, order: int = 2, sides: float = 40.0, bound: bool = False
) -> tuple[hv.ContactProblem, Cattaneo]:
    """Full width; Coulomb's law, or (``bound``) the tangential problem alone with the frozen bound mu p(x)."""
    known, young = cattaneo_data(poisson)
    a, side = known.normal.half_width, sides * known.normal.half_width
    mesh = plane_mesh(side, a, cells, 2.0 * a, symmetric=False)
    depth, shift = known.normal.approach(side), known.shift(side)

    def far(x: Array) -> Array:
        moved = flamant_tangential(x, known.tangential_force, young, poisson, side) - [shift, 0.0]
        return moved if bound else moved + flamant(x, known.normal.force, young, poisson, side)

    if bound:
        contact = hv.Contact(hv.laws.NoContact(), hv.Tresca(lambda x: known.friction * known.normal.pressure(x[:, 0])))
    else:
        # Hertz's parabola: a/R = 0.17 is not small, and a circle would differ by (a/R)^2/4
        contact = hv.Contact(
            hv.Signorini(),
            hv.Coulomb(known.friction),
            gap=lambda x: x[:, 0] ** 2 / (2.0 * known.normal.radius) - depth,
        )
    outer = hv.Prescribed(far)
    return (
        hv.ContactProblem(
            mesh,
            hv.Material.young(young, poisson),
            contact={"contact": contact},
            supports={"left": outer, "right": outer, "top": outer},
            order=order,
        ),
        known,
    )


def cattaneo_errors(solution: hv.Solution, known: Cattaneo) -> dict[str, float]:
    """Relative errors of tangential force, width of the sticking zone and friction (in the mean square)."""
    discrete = solution.problem
    x, weights = discrete.contact.points[:, 0], discrete.contact.weights
    friction = solution.multiplier[:, 1] * discrete.contact.frames[:, 1, 0]
    if float(weights @ friction) < 0.0:
        friction = -friction
    exact = known.traction(x)
    touching = np.abs(x) < 1.2 * known.normal.half_width
    sticking = touching & (np.abs(solution.slip[:, 0]) <= 1e-9 * np.abs(solution.slip).max()) & (friction > 0.0)
    width = float(weights[sticking].sum()) / 2.0
    return {
        "tangential": float(weights @ friction) / known.tangential_force - 1.0,
        "stick": width / known.stick - 1.0,
        "friction": float(np.sqrt(weights @ (friction - exact) ** 2 / (weights @ exact**2))),
    }


# ---- patch -------------------------------------------------------------------------------------------------


def patch_error(dim: int, cells: int) -> float:
    """Zero-Poisson block pressed onto a rigid plane, turned in space: largest relative error of the pressure."""
    young, down = 7.0, 0.01
    if dim == 2:
        mesh = hv.rectangle((1.0, 1.0), cells, pattern="cross")
        turn = np.array([[np.cos(0.7), -np.sin(0.7)], [np.sin(0.7), np.cos(0.7)]])
    else:
        grid = np.linspace(0.0, 1.0, cells + 1)
        raw = skfem.MeshTet.init_tensor(grid, grid, grid)
        mesh = hv.Mesh.oriented(raw.p.T, raw.t.T.astype(int)).with_boundaries(
            {"bottom": lambda x: x[:, 2] < 1e-9, "top": lambda x: x[:, 2] > 1 - 1e-9}
        )
        turn = np.linalg.qr(np.array([[0.3, -0.8, 0.2], [0.5, 0.4, -0.6], [0.1, 0.9, 0.7]]))[0]
        turn *= np.sign(np.linalg.det(turn))
    up = turn[:, -1]
    plane = hv.Plane(np.zeros(dim), up)
    problem = hv.ContactProblem(
        mesh.moved(turn),
        hv.Material.young(young, 0.0),
        contact={"bottom": hv.Contact(hv.Signorini(), obstacle=plane)},
        supports={"top": hv.Prescribed(tuple(-down * up))},
    )
    solution = hv.solve(hv.discretize(problem)).raise_for_status()
    return float(np.abs(solution.pressure / (young * down) - 1.0).max())


# ---- tables ------------------------------------------------------------------------------------------------

Row = dict[str, Any]


def hertz_row(case: str, cells: float, normals: str, half_width: float, sides: float | None) -> Row:
    name, view = case.split("-")
    if name == "line":
        problem, known = line_problem(cells, view, normals, half_width, sides or 40.0)
    else:
        full = view == "full"
        problem, known = sphere_problem(
            cells, "sphere" if full else view, normals, half_width, sides or 10.0, symmetric=not full
        )
    return _row(case, cells, problem, lambda solution: hertz_errors(solution, known), {"normals": normals})


def cattaneo_row(case: str, cells: float) -> Row:
    if case == "cattaneo-bound":
        problem, known = cattaneo_problem(cells, poisson=0.3, order=1, bound=True)
    else:
        problem, known = cattaneo_problem(cells)
    return _row(case, cells, problem, lambda solution: cattaneo_errors(solution, known), {})


def _row(
    case: str, cells: float, problem: hv.ContactProblem, errors: Callable[[hv.Solution], dict[str, float]], more: Row
) -> Row:
    start = time.perf_counter()
    discrete = hv.discretize(problem)
    solution = hv.solve(discrete).raise_for_status()
    seconds = time.perf_counter() - start
    facts = {"case": case, **more, "cells": cells, "unknowns": discrete.unknowns, "points": discrete.contact_points}
    return {**facts, **errors(solution), "steps": solution.steps, "seconds": seconds, "peak_mib": peak_mib()}


def orders(rows: list[Row], quantities: Sequence[str]) -> dict[str, float]:
    """Observed orders of convergence: slopes of a straight line through log |error| over log h."""
    size = np.log([row["cells"] for row in rows])
    return {name: -float(np.polyfit(size, np.log([abs(row[name]) for row in rows]), 1)[0]) for name in quantities}


CASES = (
    "line-circle",
    "line-plane",
    "sphere-sphere",
    "sphere-plane",
    "sphere-full",
    "cattaneo",
    "cattaneo-bound",
    "patch",
)
SIZES = {"line": (4, 6, 8, 12, 16, 24, 32, 48), "sphere": (3, 4, 5, 6), "cattaneo": (4, 6, 8, 12, 16, 24)}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--case", nargs="+", choices=CASES, default=list(CASES))
    parser.add_argument("--sizes", type=float, nargs="+", default=None, help="cells along a")
    parser.add_argument("--normals", choices=["obstacle", "body"], nargs="+", default=["obstacle", "body"])
    parser.add_argument("--sides", type=float, default=None, help="side of the body, in units of a (Hertz)")
    parser.add_argument("--half-width", type=float, default=0.001, help="a/R (Hertz)")
    parser.add_argument("--json", type=Path, default=None, help="also write all rows to this file")
    options = parser.parse_args()
    tables: list[list[Row]] = []
    for case in options.case:
        sizes = options.sizes or SIZES.get(case.split("-")[0], ())
        if case == "patch":
            tables.append([{"case": f"patch {dim}D", "error": patch_error(dim, 4)} for dim in (2, 3)])
        elif case.startswith("cattaneo"):
            tables.append([cattaneo_row(case, n) for n in sizes])
        else:
            tables += [
                [hertz_row(case, n, way, options.half_width, options.sides) for n in sizes] for way in options.normals
            ]
    for table in tables:
        print()
        show(table, None)
        known = [name for name in ("force", "pressure", "worst", "tangential", "friction") if name in table[0]]
        if len(table) > 2:
            print("fitted orders: " + ", ".join(f"{name} {o:.2f}" for name, o in orders(table, known).items()))
    if options.json is not None:
        rows = [row for table in tables for row in table]
        options.json.write_text(json.dumps({"machine": machine(), "rows": rows}, indent=1))


if __name__ == "__main__":
    main()
