"""Two equal blocks whose meshes do not match.

Unit squares of E = 2e6 and nu = 0 on one another, pressed from above by 1e5 on a fixed base: the contact pressure
is 1e5 everywhere, and the contact moves down by 0.05.
"""

import numpy as np

import hemivar as hv

SOURCE = "SSNP121 of Code_Aster (patch test)"
PRINTED = {"least pressure": 1e5, "largest pressure": 1e5, "u_y of the contact": -0.05}
REASON = "none: the strains are constant"
WITHIN = 1e-9


def computed(fine: bool = False) -> dict[str, float]:
    """One pair of meshes serves."""
    parts = {"upper": hv.rectangle((1.0, 1.0), (7, 6), origin=(0.0, 1.0)), "lower": hv.rectangle((1.0, 1.0), (5, 4))}
    problem = hv.ContactProblem(
        mesh=hv.Mesh.assembled(parts),
        material=hv.Material.young(2e6, 0.0),
        contact={"upper:bottom": hv.Contact(hv.Signorini(), against="lower:top")},
        supports={"lower:bottom": "clamped", "upper:left": "roller", "upper:right": "roller"},
        tractions={"upper:top": hv.Pressure(1e5)},
    )
    solution = hv.solve(problem).raise_for_status()
    down = solution.displacement[np.abs(problem.mesh.points[:, 1] - 1.0) < 1e-9, 1]
    found = (solution.pressure.min(), solution.pressure.max(), down.mean())
    return dict(zip(PRINTED, map(float, found), strict=True))
