"""A crack that is opened by a pressure.

A crack of the half length 1 in a large body in plane strain, E = 25 GPa, nu = 0.25, under 10 MPa on its faces: the
opening in the middle is 4 (1 - nu^2) p/E.
"""

import runpy
from pathlib import Path

import numpy as np

import hemivar as hv

SOURCE = "Sneddon 1946; PorePy, GEOS"
PRINTED = {"opening in the middle": 1.5e-3}
REASON = "the body ends at 40 half lengths; the opening is a root at the tips"
WITHIN = 0.01
CRACKED = runpy.run_path(str(Path(__file__).with_name("closed_crack.py")))["cracked"]


def computed(fine: bool = False) -> dict[str, float]:
    """The mesh of the closed crack."""
    problem = hv.ContactProblem(
        mesh=CRACKED(32 if fine else 12, 1.3 if fine else 1.6),
        material=hv.Material.young(25e3, 0.25),
        contact={"crack:1": hv.Contact(hv.Signorini(), against="crack:2")},
        supports={"held": hv.Clamped(at=(-40.0, -40.0)), "guided": hv.Fixed(y=0.0, at=(40.0, -40.0))},
        tractions={"crack:1": hv.Pressure(10.0), "crack:2": hv.Pressure(10.0)},
        order=2,
    )
    solution = hv.solve(problem).raise_for_status()
    return {"opening in the middle": float(np.abs(solution.penetration).max())}
