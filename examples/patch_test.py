r"""
Patch tests
===========

Uniform strain is reproduced to rounding, on a distorted, turned mesh with contact, and in space.
"""

import itertools

import numpy as np

import hemivar as hv
from hemivar import gallery
from hemivar.fem import stress

# %%
# A turned block
# --------------
# A block between frictionless walls, its top moved down by D, on a distorted mesh turned by 30 degrees. At every node
# of the contact boundary :math:`s = (\kappa D - q)/(\kappa + p)`, :math:`\kappa = (\lambda + 2\mu)/b`.

ANGLE = np.pi / 6
flat = hv.rectangle((1.0, 1.0), 6)
points = flat.points.copy()
inside = np.all((points > 1e-9) & (points < 1.0 - 1e-9), axis=1)
points[inside] += np.random.default_rng(5).uniform(-0.04, 0.04, (np.count_nonzero(inside), 2))
problem = hv.ContactProblem(
    mesh=hv.Mesh(points, flat.cells, flat.boundaries).rotated(ANGLE),
    material=hv.Material.lame(4.0, 4.0),
    supports={
        "left": hv.Roller(),
        "right": hv.Roller(),
        "top": hv.Prescribed(0.1 * np.array([np.sin(ANGLE), -np.cos(ANGLE)])),
    },
    contact={"bottom": hv.Contact(hv.laws.ThresholdCompliance(0.3, 2.0), hv.Tresca(0.2))},
    title="turned block",
)
solution = hv.solve(problem).raise_for_status()
exact = 0.9 / 14.0
sunk = float(np.abs(solution.penetration - exact).max())
uneven = float(np.ptp(stress(problem, solution.displacement), axis=0).max())
print(f"penetration {solution.penetration.mean():.15f}, by hand {exact:.15f}")
print(f"largest error {sunk:.1e}, spread of the stress over the cells {uneven:.1e}")
solution.plot()


# %%
# A cube
# ------
# With Poisson's ratio 0, between its top, moved down by D, and a rigid foundation with friction: the pressure is E D
# everywhere, and nothing slips. Each of :math:`n^3` small cubes is cut into six tetrahedra along its diagonal.


def cube(n: int = 3) -> hv.Mesh:
    """The unit cube with the boundaries top and bottom."""
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


young, down = 7.0, 0.01
spatial = hv.ContactProblem(
    mesh=cube(),
    material=hv.Material.young(young, 0.0),
    supports={"top": hv.Prescribed((0.0, 0.0, -down))},
    contact={"bottom": hv.Contact(hv.Signorini(), hv.Tresca(0.1))},
    title="cube on a rigid plane",
)
pressed = hv.solve(spatial).raise_for_status()
off = float(np.abs(pressed.pressure - young * down).max())
print(f"pressure {pressed.pressure.mean():.15f}, by hand {young * down:.15f}, largest error {off:.1e}")
pressed.plot()

# %%
# A cantilever
# ------------
# Without contact: displacements that were computed independently.

beam = hv.discretize(gallery.beam())
bent = hv.solve(beam)
assert beam.field is not None
beam_error = max(
    float(
        np.abs(bent.displacement[np.argmin(np.linalg.norm(beam.field.nodes - where, axis=1))] - np.array(known)).max()
    )
    for where, known in gallery.BEAM_DISPLACEMENTS.items()
)
print(f"largest difference from the displacements computed independently {beam_error:.1e}")
