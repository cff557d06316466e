"""A steel roller on an aluminium block.

A cylinder of the radius 50 mm, E = 210000, on a block of 200 x 200 mm, E = 70000, both nu = 0.3 and in plane
strain, under 35 kN per mm. The benchmark prints the pressure and half width of Hertz.
"""

import numpy as np

import hemivar as hv

SOURCE = "NAFEMS, contact benchmark CGS-1; Hertz"
PRINTED = {"largest pressure": 3585.37, "half width": 6.2146}
REASON = "second order in the cells; a line is fitted to the squares of the pressures"
WITHIN = 0.04
RADIUS, FORCE = 50.0, 35e3


def part(across: int, width: float, height: float, shrunk: float, curved: float) -> hv.Mesh:
    """A body above y = 0, or below it for a negative height, whose cells shrink to the origin."""
    plain = hv.rectangle((2.0, 1.0), (across, across // 2), origin=(-1.0, 0.0))
    s, t = plain.points.T
    x = width * np.sinh(shrunk * s) / np.sinh(shrunk)
    low = curved * (RADIUS - np.sqrt(RADIUS**2 - (curved * x) ** 2))
    y = low + (height - low) * np.expm1(5.0 * t) / np.expm1(5.0)
    cells = plain.cells if height > 0.0 else plain.cells[:, ::-1]
    sides = {name: facets[:, :: int(np.sign(height))] for name, facets in plain.boundaries.items()}
    return hv.Mesh(np.column_stack([x, y]), cells, sides)


def computed(fine: bool = False) -> dict[str, float]:
    """The lower part of the cylinder, loaded from above, and the block."""
    n = 96 if fine else 64
    steel, aluminium = hv.Material.young(210e3, 0.3), hv.Material.young(70e3, 0.3)
    problem = hv.ContactProblem(
        mesh=hv.Mesh.assembled({"roller": part(n, 40.0, 60.0, 4.0, 1.0), "block": part(n, 100.0, -200.0, 5.0, 0.0)}),
        material=hv.Material.by_region({"roller": steel, "block": aluminium}),
        contact={"roller:bottom": hv.Contact(hv.Signorini(), against="block:bottom")},
        supports={"block:top": "clamped", "roller:top": hv.Fixed(x=0.0)},
        tractions={"roller:top": (0.0, -FORCE / 80.0)},
    )
    solution = hv.solve(problem).raise_for_status()
    x, p = solution.contact.points[:, 0], solution.pressure
    near = p > 0.3 * p.max()
    slope, square = np.polyfit(x[near] ** 2, p[near] ** 2, 1)
    return {"largest pressure": float(np.sqrt(square)), "half width": float(np.sqrt(-square / slope))}
