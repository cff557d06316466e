"""The Brazilian test: a disc between smooth rigid platens.

Under the force P per thickness the middle of a disc of the diameter D has the stress 2P/(pi D) across the load and
-6P/(pi D) along it. Hertz gives the half width and the pressure at the platens. All four are stated over the
theory's.
"""

from pathlib import Path

import numpy as np

import hemivar as hv

SOURCE = "Hertz 1883"
PRINTED = {"stress across": 1.0, "stress along": 1.0, "half width": 1.0, "pressure": 1.0}
REASON = "stresses are means of the cells around the middle, which fall off to the sides"
WITHIN = 0.02
MESH = Path(__file__).parents[1] / "meshes" / "half_disc.msh"


def computed(fine: bool = False) -> dict[str, float]:
    """Half of the disc, R = 1, E = 1000 and nu = 0.3, below a plane of symmetry that is moved down."""
    mesh = hv.read_mesh(MESH).refined() if fine else hv.read_mesh(MESH)
    problem = hv.ContactProblem(
        mesh=mesh,
        material=hv.Material.young(1e3, 0.3),
        contact={"contact": hv.Contact(hv.Signorini(), obstacle=hv.mechanics.Plane((0.0, 0.0), (0.0, 1.0)))},
        supports={"top": hv.Fixed(y=-5e-3), "held": hv.Fixed(x=0.0, at=(0.0, 1.0))},
        order=2,
    )
    solution = hv.solve(problem).raise_for_status()
    force, star = solution.normal_force, 1e3 / (1.0 - 0.3**2)
    half_width, x, p = np.sqrt(4.0 * force / (np.pi * star)), solution.contact.points[:, 0], solution.pressure
    near = p > 0.3 * p.max()
    slope, square = np.polyfit(x[near] ** 2, p[near] ** 2, 1)
    inside = np.linalg.norm(mesh.points[mesh.cells].mean(axis=1) - (0.0, 1.0), axis=1) < (0.05 if fine else 0.1)
    across, along = np.average(solution.stress()[inside], axis=0, weights=mesh.volumes[inside]).diagonal()
    return {
        "stress across": across * np.pi / force,
        "stress along": -along * np.pi / (3.0 * force),
        "half width": np.sqrt(-square / slope) / half_width,
        "pressure": np.sqrt(square) * np.pi * half_width / (2.0 * force),
    }
