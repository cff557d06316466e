"""Trace constants of random bodies: the guaranteed ones over what displacements attain, by family of meshes.

    python benchmarks/trace_bodies.py --runs 100 --seed 1
    python benchmarks/trace_bodies.py --dim 3 --runs 30

Families: ``delaunay`` (random points), ``refined`` (locally), ``slab`` (long or flat), ``graded`` (nodes x -> x^g, g up
to 3), ``layers`` (moduli 1 to 20), ``stiff`` (Poisson's ratio 0.49) and, if Gmsh is there, ``gmsh`` (with a hole, or a
corner cut out) and in space ``curved`` (half a ball on its pole, a cylinder on its flank).  The value from above is
that of displacements, quadratic in the plane, on the mesh once refined, or of the library's own ones where these are
less.  ``before`` is the constant of the mesh itself, without parts of the body.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp
import scipy.sparse.linalg as spla
from common import show
from scipy.spatial import Delaunay

import hemivar as hv
from hemivar.bounds.bare_body import bare_body
from hemivar.bounds.lower_bounds import _on, lower_bounds
from hemivar.errors import ProblemError
from hemivar.fem.elements import shape_values
from hemivar.fem.quadrature import quadrature_rule

#: Cells up to which the constant of the mesh itself is computed, too.
_OWN = {2: 5_000, 3: 500}


def sided(mesh: hv.Mesh) -> hv.Mesh:
    facets, low = mesh.boundary_facets, mesh.points.min(axis=0)
    at = np.abs(mesh.points[facets] - low) < 1e-9 * np.ptp(mesh.points, axis=0).max()
    sides = {"left": at[:, :, 0].all(axis=1), "bottom": at[:, :, -1].all(axis=1)}
    bare = hv.Mesh.trusted(mesh.points, mesh.cells, {}, {})  # it knows no coarser one
    return bare.with_boundaries({name: facets[here] for name, here in sides.items()})


def grid(dim: int, n: int, sides: tuple[float, ...] | None = None) -> hv.Mesh:
    lengths = (1.0,) * dim if sides is None else sides
    counts = tuple(max(1, round(n * length)) for length in lengths)
    return hv.rectangle(lengths, counts) if dim == 2 else hv.box(lengths, counts)


def delaunay(rng: np.random.Generator, dim: int) -> hv.Mesh:
    n = int(rng.integers(4, 9 if dim == 2 else 5))
    x = grid(dim, n).points.copy()
    inside = (x > 1e-9) & (x < 1.0 - 1e-9)
    x += inside * rng.uniform(-0.45, 0.45, x.shape) / n
    cells = Delaunay(x).simplices
    size = np.abs(np.linalg.det(x[cells[:, 1:]] - x[cells[:, :1]]))
    return sided(hv.Mesh.oriented(x, cells[size > 1e-10]))


def refined(rng: np.random.Generator, dim: int) -> hv.Mesh:
    mesh = grid(dim, 3)
    for _ in range(3 if dim == 2 else 2):
        at = np.linalg.norm(mesh.points[mesh.cells].mean(axis=1) - rng.integers(0, 2, dim), axis=1)
        mesh = mesh.refined_where(np.argsort(at)[:4])
    return sided(mesh)


def slab(rng: np.random.Generator, dim: int) -> hv.Mesh:
    long = (float(rng.uniform(2.0, 6.0)), 1.0) if dim == 2 else (1.0, 1.0, float(rng.uniform(0.15, 0.4)))
    return sided(grid(dim, 8, long))


def graded(rng: np.random.Generator, dim: int) -> hv.Mesh:
    mesh = grid(dim, int(rng.integers(4, 9 if dim == 2 else 6)))
    return sided(hv.Mesh.trusted(mesh.points ** rng.uniform(1.5, 3.0), mesh.cells, {}, {}))


def gmsh_mesh(rng: np.random.Generator, dim: int) -> hv.Mesh:
    import gmsh

    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    shape = gmsh.model.occ
    a, b = rng.uniform(0.5, 0.7, 2)
    if dim == 2:
        body = shape.addRectangle(0.0, 0.0, 0.0, 1.0, 1.0)
        hole = rng.random() < 0.5
        other = shape.addDisk(a, b, 0.0, 0.2, 0.2) if hole else shape.addRectangle(a, b, 0.0, 1.0, 1.0)
    else:
        body, other = shape.addBox(0.0, 0.0, 0.0, 1.0, 1.0, 1.0), shape.addBox(a, -1.0, b, 1.0, 3.0, 1.0)
    shape.cut([(dim, body)], [(dim, other)])
    return sided(generated(rng.uniform(0.02, 0.08) if dim == 2 else rng.uniform(0.1, 0.2), dim))


def curved(rng: np.random.Generator, dim: int) -> hv.Mesh:
    import gmsh

    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    shape = gmsh.model.occ
    if rng.random() < 0.5:
        shape.cut([(dim, shape.addSphere(0.0, 0.0, 1.0, 1.0))], [(dim, shape.addBox(-2.0, -2.0, 1.0, 4.0, 4.0, 2.0))])
    else:
        shape.addCylinder(0.0, 0.0, 1.0, 0.0, float(rng.uniform(0.7, 2.0)), 0.0, 1.0)
    mesh = generated(float(rng.uniform(0.3, 0.6)), dim)
    facets = mesh.boundary_facets
    height = mesh.points[facets].mean(axis=1)[:, 2]
    high = height > (1.5 if mesh.points[:, 2].max() > 1.5 else 1.0 - 1e-9)
    return mesh.with_boundaries({"left": facets[high], "bottom": facets[height < rng.uniform(0.15, 0.4)]})


def generated(size: float, dim: int) -> hv.Mesh:
    """Of the model that Gmsh has, which is closed."""
    import gmsh

    gmsh.model.occ.synchronize()
    gmsh.option.setNumber("Mesh.MeshSizeMax", size)
    gmsh.model.mesh.generate(dim)
    tags, points, _ = gmsh.model.mesh.getNodes()
    place = np.zeros(int(tags.max()) + 1, dtype=np.int64)
    place[tags.astype(np.int64)] = np.arange(len(tags))
    cells = place[gmsh.model.mesh.getElementsByType(2 if dim == 2 else 4)[1].astype(np.int64)].reshape(-1, dim + 1)
    gmsh.finalize()
    used, cells = np.unique(cells, return_inverse=True)
    return hv.Mesh.oriented(points.reshape(-1, 3)[used, :dim], cells.reshape(-1, dim + 1))


FAMILIES: dict[str, Callable[[np.random.Generator, int], hv.Mesh]] = {
    "delaunay": delaunay,
    "refined": refined,
    "slab": slab,
    "graded": graded,
    "layers": delaunay,
    "stiff": delaunay,
    "gmsh": gmsh_mesh,
    "curved": curved,
}


def body(name: str, dim: int, rng: np.random.Generator) -> hv.ContactProblem:
    mesh = FAMILIES[name](rng, dim)
    material = hv.Material.young(10.0, 0.49 if name == "stiff" else float(rng.uniform(0.0, 0.4)))
    if name == "layers":
        mesh = sided(grid(dim, 6 if dim == 2 else 4))
        low = mesh.points[mesh.cells].mean(axis=1)[:, -1] < 0.5
        parts = {"low": np.flatnonzero(low), "high": np.flatnonzero(~low)}
        mesh = replace(mesh, regions=parts)
        moduli = (1.0, 20.0) if rng.random() < 0.5 else (20.0, 1.0)
        both = dict(zip(parts, (hv.Material.young(modulus, 0.3) for modulus in moduli), strict=True))
        material = hv.Material.by_region(both)
    contact = {"bottom": hv.Contact(hv.laws.NoContact())}
    return hv.ContactProblem(mesh=mesh, material=material, supports={"left": hv.Clamped()}, contact=contact)


def galerkin(problem: hv.ContactProblem) -> float:
    """The least quotient of displacements on the mesh: above Lambda."""
    mesh, dim = problem.mesh, problem.mesh.dim
    order = 4 - dim
    discrete = hv.discretize(replace(problem, order=order), check_coercivity=False)
    assert discrete.field is not None
    nodes, sizes = mesh.facet_nodes(mesh.boundaries["bottom"], order), mesh.facet_normals(mesh.boundaries["bottom"])[1]
    point, weights = quadrature_rule(dim - 1, 4)
    values = shape_values(order, point)
    local = np.einsum("q,qa,qb->ab", weights, values, values) / weights.sum()
    row, column = np.broadcast_arrays(nodes[:, :, None], nodes[:, None, :])
    count = len(mesh.nodes(order))
    mass = sp.csr_array((np.ravel(sizes[:, None, None] * local), (row.ravel(), column.ravel())), shape=(count, count))
    basis = discrete.field.basis
    mass = sp.csc_array(basis.T @ sp.kron(mass, sp.eye_array(dim)) @ basis)
    some = np.flatnonzero(np.diff(mass.indptr))
    root = la.cholesky(mass[some][:, some].toarray(), lower=True)
    loads = np.zeros((mass.shape[0], len(some)))
    loads[some] = root
    answers = spla.splu(sp.csc_array(discrete.stiffness)).solve(loads)
    return float(1.0 / la.eigvalsh(root.T @ answers[some])[-1])


def judged(problem: hv.ContactProblem) -> tuple[float, float, float, float]:
    """Ratio, ratio without parts (nan if not computed), seconds, and seconds of a solve."""
    began = time.process_time()
    found = lower_bounds(problem)
    seconds = time.process_time() - began
    mesh = problem.mesh
    finer = mesh.refined() if mesh.number_of_cells < (4_000 if mesh.dim == 2 else 1_000) else mesh
    above = min(galerkin(replace(problem, mesh=finer)), found.both.upper)
    if found.both.lower > above:
        raise AssertionError(f"{found.both.lower} is above {above}")
    before = np.nan
    if mesh.number_of_cells <= _OWN[mesh.dim]:
        before = _on(bare_body(problem), 800 if mesh.dim == 2 else 600, (("bottom",),)).both.lower / above
    law = {"bottom": hv.Contact(hv.Compliance(5.0))}
    force = (0.0,) * (mesh.dim - 1) + (-1.0,)
    began = time.process_time()
    hv.solve(replace(problem, contact=law, body_force=force))
    return found.both.lower / above, before, seconds, time.process_time() - began


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--dim", type=int, choices=(2, 3), default=2)
    options.add_argument("--runs", type=int, default=100)
    options.add_argument("--seed", type=int, default=1)
    options.add_argument("--json", type=Path, default=None, help="also write the rows to this file")
    chosen = options.parse_args()
    rng = np.random.default_rng(chosen.seed)
    families = list(FAMILIES)[: len(FAMILIES) + chosen.dim - 3]  # curved ones in space
    found: dict[str, list[tuple[float, float, float, float]]] = {}
    for number in range(chosen.runs):
        name = families[number % len(families)]
        try:
            found.setdefault(name, []).append(judged(body(name, chosen.dim, rng)))
        except ImportError:
            continue
        except ProblemError as error:
            print(f"{name}: {error}")
            found.setdefault(name, []).append((0.0, np.nan, np.nan, np.nan))
    every = {**found, "all": [one for values in found.values() for one in values]}
    show([_row(name, np.array(values)) for name, values in every.items()], chosen.json)


def _row(name: str, values: np.ndarray[tuple[int, int], np.dtype[np.float64]]) -> dict[str, object]:
    ratio, before, seconds, solve = values.T
    row: dict[str, object] = {"family": name, "bodies": len(ratio)}
    row |= {"median": f"{np.median(ratio):.3f}", "least": f"{ratio.min():.3f}"}
    known = before[np.isfinite(before)]
    row["before"] = f"{np.median(known):.3f}" if len(known) else "-"
    row["least before"] = f"{known.min():.1e}" if len(known) else "-"
    return row | {"s": f"{np.nanmedian(seconds):.2f}", "solve": f"{np.nanmedian(solve):.2f}"}


if __name__ == "__main__":
    main()
