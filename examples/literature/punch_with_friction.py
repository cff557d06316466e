"""A flat punch with friction on a half plane.

A rigid punch of the half width 1 is pressed into a half plane; below its middle the surface sticks, outside it
slips. Printed is the half width of the sticking part, of a coupled collocation with 600 cells. The textbook formula
K'(c)/K(c) = beta/mu neglects the vertical motion that shear makes, and has 0.7438 and 0.7071.
"""

import runpy
from pathlib import Path

import numpy as np

import hemivar as hv

SOURCE = "collocation of the coupled integral equations"
PRINTED = {"nu = 0.3, friction 0.3": 0.6901, "nu = 0, friction 0.5": 0.5216}
REASON = "a body of 200 half widths (fine: 1000), and the middle between two points"
WITHIN = 0.03
BLOCK = runpy.run_path(str(Path(__file__).with_name("sphere_and_punch.py")))["block"]


def sticking(n: int, size: float, poisson: float, friction: float) -> float:
    """Half of the body, with n cells below the half of the punch."""
    problem = hv.ContactProblem(
        mesh=BLOCK(np.linspace(0.0, 1.0, n + 1), size),
        material=hv.Material.young(1.0, poisson),
        contact={"under": hv.Contact(hv.Signorini(), hv.Coulomb(friction))},
        supports={"left": "roller", "bottom": hv.Fixed(x=0.0, y=1e-3)},
        order=2,
    )
    solution = hv.solve(problem).raise_for_status()
    x, slip = solution.contact.points[:, 0], np.abs(solution.slip).ravel()
    slides = slip > 1e-9 * slip.max()
    return float(0.5 * (x[slides].min() + x[~slides].max()))


def computed(fine: bool = False) -> dict[str, float]:
    """40 or 96 cells."""
    n, size = (96, 1000.0) if fine else (40, 200.0)
    values = (sticking(n, size, 0.3, 0.3), sticking(n, size, 0.0, 0.5))
    return dict(zip(PRINTED, values, strict=True))
