"""The bound of the distance to the exact solution on meshes and bodies of every kind: how sharp, and at what price.

    python benchmarks/bound_families.py [--dim 2 3] [--bodies 9] [--order 1] [--price] [--families NAME ...]

Each family is a kind of mesh or of body; its bodies are drawn at random: sides, cells, loads, one of three sorts of
supports, and one of three laws: a compliant one, a rigid one, both with friction, and one that softens.  The index is
the bound over the error against a reference (``bounds.py``): the median, the largest of nine in ten bodies, and the
largest; ``none`` counts bodies without a guaranteed bound.  ``misfit of it`` is the median of the share of the misfit
in the bound.  The price, with ``--price``, is seconds of the processor of the bound over those of the solve, on a body
with 8 times as many cells along a side in the plane, twice in space; constants of the body are not in it.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from bounds import constants_of, error_of
from common import show
from random_statements import Array
from scipy.spatial import Delaunay

import hemivar as hv
from hemivar.bounds import ExactDistance, exact_distance
from hemivar.mesh import Mesh, box, rectangle

Rng = np.random.Generator


def _named(points: Array, cells: Array, size: Array) -> Mesh:
    """A mesh of a box, its sides by name."""
    bare = Mesh.oriented(points, cells)
    outer = bare.boundary_facets
    middle = bare.points[outer].mean(axis=1) / size
    sides = {"left": (0, 0.0), "right": (0, 1.0), "bottom": (len(size) - 1, 0.0), "top": (len(size) - 1, 1.0)}
    named = {name: outer[np.abs(middle[:, axis] - at) < 1e-9] for name, (axis, at) in sides.items()}
    return Mesh(bare.points, bare.cells, named)


def _regular(size: Array, count: int) -> Mesh:
    n = tuple(int(np.clip(round(count * side / size.max()), 2, None)) for side in size)
    return rectangle(tuple(size), n, pattern="cross") if len(size) == 2 else box(tuple(size), n)


def _delaunay(size: Array, count: int, rng: Rng) -> Mesh:
    """Points at random, apart, inside of a box whose sides have regular ones."""
    dim, h = len(size), size.max() / count
    axes = [np.linspace(0.0, side, max(round(side / h), 2) + 1) for side in size]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, dim)
    edge = ((grid < 1e-12) | (grid > size - 1e-12)).any(axis=1)
    inside = grid[~edge] + rng.uniform(-0.35, 0.35, grid[~edge].shape) * h
    points = np.vstack([grid[edge], inside])
    cells = Delaunay(points).simplices
    corners = points[cells]
    volumes = np.abs(np.linalg.det(corners[:, 1:] - corners[:, :1])) / (2 if dim == 2 else 6)
    return _named(points, cells[volumes > 1e-3 * h**dim / 6], size)


def _gmsh(size: Array, count: int) -> Mesh:
    import gmsh

    gmsh.initialize(interruptible=False)
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.option.setNumber("Mesh.MeshSizeMax", (1.0 if len(size) == 2 else 1.6) * size.max() / count)
    if len(size) == 2:
        gmsh.model.occ.addRectangle(0, 0, 0, *size)
    else:
        gmsh.model.occ.addBox(0, 0, 0, *size)
    gmsh.model.occ.synchronize()
    gmsh.model.mesh.generate(len(size))
    tags, flat, _ = gmsh.model.mesh.getNodes()
    place = np.zeros(int(tags.max()) + 1, dtype=np.int64)
    place[tags.astype(np.int64)] = np.arange(len(tags))
    _, _, nodes = gmsh.model.mesh.getElements(len(size))
    gmsh.finalize()
    cells = place[nodes[0].astype(np.int64)].reshape(-1, len(size) + 1)
    used, cells = np.unique(cells, return_inverse=True)
    return _named(flat.reshape(-1, 3)[used, : len(size)], cells.reshape(-1, len(size) + 1), size)


def _graded(mesh: Mesh, power: float, axes: tuple[int, ...]) -> Mesh:
    size, points = mesh.points.max(axis=0), mesh.points.copy()
    for axis in axes:
        points[:, axis] = size[axis] * (points[:, axis] / size[axis]) ** power
    return Mesh(points, mesh.cells, dict(mesh.boundaries), dict(mesh.regions))


def _locally_refined(mesh: Mesh) -> Mesh:
    """Refined three times at the end of the contact boundary."""
    for _ in range(3):
        mesh = mesh.refined_where((np.linalg.norm(mesh.points[mesh.cells], axis=2) < 1e-9).any(axis=1))
    return Mesh(mesh.points, mesh.cells, dict(mesh.boundaries))


def _layered(mesh: Mesh) -> Mesh:
    height = mesh.points[mesh.cells].mean(axis=1)[:, -1] / mesh.points[:, -1].max()
    thirds = np.minimum((3 * height).astype(int), 2)
    return mesh.named(
        dict(mesh.boundaries), {"stiff": np.flatnonzero(thirds != 1), "soft": np.flatnonzero(thirds == 1)}
    )


STEEL = hv.Material.young(10.0, 0.3)
SOFT = hv.Material.young(10.0, 0.49)
LAYERS = hv.Material.by_region({"stiff": hv.Material.young(40.0, 0.3), "soft": hv.Material.young(2.0, 0.3)})

#: A mesh of a box of this size with so many cells along its longest side, and a material.
FAMILIES: dict[str, Callable[[Array, int, Rng], tuple[Mesh, hv.Material]]] = {
    "regular": lambda size, n, rng: (_regular(size, n), STEEL),
    "gmsh": lambda size, n, rng: (_gmsh(size, n), STEEL),
    "delaunay": lambda size, n, rng: (_delaunay(size, n, rng), STEEL),
    "locally refined": lambda size, n, rng: (_locally_refined(_regular(size, n)), STEEL),
    "slabs 1:10": lambda size, n, rng: (
        _regular(size * np.append(np.ones(len(size) - 1), 0.1 * size.max() / size[-1]), 2 * n), STEEL),
    "flat cells 1:10": lambda size, n, rng: (_flat(_regular(size, n)), STEEL),
    "graded x^2": lambda size, n, rng: (_graded(_regular(size, n), 2.0, tuple(range(len(size)))), STEEL),
    "graded x^3": lambda size, n, rng: (_graded(_regular(size, n), 3.0, (0,)), STEEL),
    "layers 1:20": lambda size, n, rng: (_layered(_regular(size, max(n, 6))), LAYERS),
    "nu .49": lambda size, n, rng: (_regular(size, n), SOFT),
}  # fmt: skip


def _flat(mesh: Mesh) -> Mesh:
    scale = np.append(np.ones(mesh.dim - 1), 0.1)
    return Mesh(mesh.points * scale, mesh.cells, dict(mesh.boundaries))


LAWS = (
    hv.Contact(hv.laws.ThresholdCompliance(0.3, 2.0), hv.Tresca(0.05)),
    hv.Contact(hv.Signorini(), hv.Tresca(0.05)),
    hv.Contact(hv.Softening(2.0, 0.02, 0.3)),
)
SUPPORTS: tuple[dict[str, Any], ...] = (
    {"left": hv.Clamped()},
    {"left": hv.Clamped(), "right": hv.Roller()},
    {"top": hv.Clamped()},
)


def statement(family: str, dim: int, seed: int, finer: int = 1, order: int = 1) -> hv.ContactProblem:
    """A body of a family, drawn from a number; ``finer`` multiplies the cells along its longest side."""
    rng = np.random.default_rng([list(FAMILIES).index(family), dim, seed])
    size = rng.uniform(0.7, 1.5, dim)
    count = int(rng.integers(6, 13) if dim == 2 else rng.integers(3, 5))
    load = np.append(rng.uniform(-0.3, 0.3, dim - 1), rng.uniform(-0.6, -0.2))
    supports, law = SUPPORTS[seed % 3], LAWS[seed // 3 % 3]
    mesh, material = FAMILIES[family](size, finer * count, rng)
    pulled = {} if "right" in supports else {"right": tuple(0.5 * load)}
    return hv.ContactProblem(
        mesh, material, {"bottom": law}, supports, body_force=tuple(load), tractions=pulled, order=order
    )


def judged(problem: hv.ContactProblem) -> tuple[float, ExactDistance]:
    """The index of a body, inf without a guaranteed bound, and the bound."""
    solution = hv.solve(problem)
    found = exact_distance(problem, solution.displacement, constants_of(solution.problem))
    if not (found.guaranteed and np.isfinite(found.distance)):
        return np.inf, found
    error = error_of(problem, solution.displacement)
    if found.distance < error.whole:
        raise AssertionError(f"a bound below the error: {found.distance:.6g} and {error.whole:.6g}")
    return found.distance / error.measured, found


def price(family: str, dim: int, order: int) -> tuple[int, float]:
    """Cells, and what the bound costs over the solve; the least of three of either."""
    problem = statement(family, dim, 0, finer=8 if dim == 2 else 2, order=order)
    constants = constants_of(hv.discretize(statement(family, dim, 0), check_coercivity=False))
    times = []
    for _ in range(3):
        began = time.process_time()
        solution = hv.solve(problem)
        solved = time.process_time()
        exact_distance(problem, solution.displacement, constants)
        times.append((solved - began, time.process_time() - solved))
    return problem.mesh.number_of_cells, min(own for _, own in times) / min(own for own, _ in times)


def row(dim: int, family: str, found: list[tuple[float, ExactDistance]]) -> dict[str, Any]:
    """A line of the table."""
    index = np.sort([each for each, _ in found])
    shares = [distance.parts.misfit / distance.distance for each, distance in found if np.isfinite(each)]
    return {
        "dim": dim,
        "family": family,
        "bodies": len(index),
        "none": int(np.isinf(index).sum()),
        "index, median": float(np.median(index)),
        "nine in ten": float(index[int(np.ceil(0.9 * len(index))) - 1]),
        "largest": float(index[-1]),
        "misfit of it": float(np.median(shares)) if shares else np.nan,
    }


def table(dim: int, options: argparse.Namespace) -> list[dict[str, Any]]:
    """Lines of all families, and one of all bodies together."""
    rows, every = [], []
    for family in options.families:
        found = [judged(statement(family, dim, seed, order=options.order)) for seed in range(options.bodies)]
        every += found
        rows.append(row(dim, family, found))
        if options.price:
            cells, ratio = price(family, dim, options.order)
            rows[-1] |= {"cells": cells, "bound/solve": ratio}
        print(rows[-1], file=sys.stderr, flush=True)
    return [*rows, row(dim, "all", every) | ({"cells": "", "bound/solve": ""} if options.price else {})]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--dim", type=int, nargs="+", choices=[2, 3], default=[2, 3])
    parser.add_argument("--bodies", type=int, default=9)
    parser.add_argument("--order", type=int, choices=[1, 2], default=1, help="in the plane")
    parser.add_argument("--price", action="store_true")
    parser.add_argument("--json", type=Path, default=None, help="also write the rows to this file")
    parser.add_argument("--families", nargs="+", choices=list(FAMILIES), default=list(FAMILIES))
    options = parser.parse_args()
    show([line for dim in options.dim for line in table(dim, options)], options.json)


if __name__ == "__main__":
    main()
