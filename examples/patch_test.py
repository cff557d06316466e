"""Patch tests: uniform strain is reproduced to rounding, on a distorted mesh, rotated in the plane, and in space.

1. A block between frictionless walls, its top moved down by D, on a distorted mesh turned by 30 degrees:
   ``s = (kappa D - q)/(kappa + p)`` at every node of the contact boundary, ``kappa = (lam + 2 mu)/b``.
2. A cube with Poisson's ratio 0 between its top, moved down by D, and a rigid foundation with friction: pressure E D
   everywhere, nothing slips.
3. Without contact: a cantilever whose displacement was computed independently.
"""

from __future__ import annotations

import itertools
from pathlib import Path

import numpy as np

import hemivar as hv
from hemivar import gallery
from hemivar.fem import stress


def turned_block(angle: float = np.pi / 6) -> hv.ContactProblem:
    """The block on a distorted mesh, turned by an angle."""
    flat = hv.rectangle((1.0, 1.0), 6)
    points = flat.points.copy()
    inside = np.all((points > 1e-9) & (points < 1.0 - 1e-9), axis=1)
    points[inside] += np.random.default_rng(5).uniform(-0.04, 0.04, (np.count_nonzero(inside), 2))
    mesh = hv.Mesh(points, flat.cells, flat.boundaries).rotated(angle)
    down = 0.1 * np.array([np.sin(angle), -np.cos(angle)])
    return hv.ContactProblem(
        mesh=mesh,
        material=hv.Material.lame(4.0, 4.0),
        supports={"left": hv.Roller(), "right": hv.Roller(), "top": hv.Prescribed(down)},
        contact={"bottom": hv.Contact(hv.SurveyLaw(0.3, 2.0), hv.Tresca(0.2))},
        title="turned block",
    )


def cube(n: int = 3) -> hv.Mesh:
    """The unit cube, each of n^3 small cubes cut into six tetrahedra along its diagonal; boundaries top and bottom."""
    grid = np.linspace(0.0, 1.0, n + 1)
    points = np.stack(np.meshgrid(grid, grid, grid, indexing="ij"), axis=-1).reshape(-1, 3)
    corner = np.arange((n + 1) ** 3).reshape(n + 1, n + 1, n + 1)[:n, :n, :n].ravel()
    steps = np.array([(n + 1) ** 2, n + 1, 1])
    walks = [np.cumsum([0, *steps[list(order)]]) for order in itertools.permutations(range(3))]
    cells = np.concatenate([corner[:, None] + walk for walk in walks])
    mesh = hv.Mesh.oriented(points, cells)
    facets = mesh.boundary_facets
    height = points[facets][:, :, 2]
    named = {"bottom": facets[np.all(height == 0.0, axis=1)], "top": facets[np.all(height == 1.0, axis=1)]}
    return mesh.with_boundaries(named)


def main(out: Path | None = None) -> dict[str, float]:
    """The three tests."""
    problem = turned_block()
    solution = hv.solve(hv.discretize(problem)).raise_for_status()
    exact = 0.9 / 14.0
    sunk = float(np.abs(solution.penetration - exact).max())
    sigma = stress(problem, solution.displacement)
    uneven = float(np.ptp(sigma, axis=0).max())
    print(f"1. turned block: penetration {solution.penetration.mean():.15f}, by hand {exact:.15f}")
    print(f"   largest error {sunk:.1e}, spread of the stress over the cells {uneven:.1e}")

    young, down = 7.0, 0.01
    spatial = hv.ContactProblem(
        mesh=cube(),
        material=hv.Material.young(young, 0.0),
        supports={"top": hv.Prescribed((0.0, 0.0, -down))},
        contact={"bottom": hv.Contact(hv.Signorini(), hv.Tresca(0.1))},
        title="cube on a rigid plane",
    )
    pressed = hv.solve(hv.discretize(spatial)).raise_for_status()
    off = float(np.abs(pressed.pressure - young * down).max())
    print(f"2. cube: pressure {pressed.pressure.mean():.15f}, by hand {young * down:.15f}, largest error {off:.1e}")

    beam = hv.discretize(gallery.beam())
    bent = hv.solve(beam)
    assert beam.field is not None
    nodes = beam.field.nodes
    misses = [
        np.abs(bent.displacement[np.argmin(np.linalg.norm(nodes - where, axis=1))] - np.array(known)).max()
        for where, known in gallery.BEAM_DISPLACEMENTS.items()
    ]
    print(f"3. cantilever: largest difference from the displacements computed independently {max(misses):.1e}")
    if out is not None:
        from hemivar.files import write_vtu

        write_vtu(solution, out / "turned_block.vtu")
        write_vtu(pressed, out / "cube.vtu")
    return {"penetration": sunk, "stress": uneven, "cube": off, "beam": float(max(misses))}


if __name__ == "__main__":
    from _command import run

    run(main)
