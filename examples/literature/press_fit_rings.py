"""A press fit of two rings in plane stress.

Rings of the radii 20 to 40.005 and 40 to 60 are shrunk onto one another: E = 196000, nu = 0.3. Lame's formulas give
the pressure. A quarter of the rings is meshed.
"""

import numpy as np

import hemivar as hv

SOURCE = "CalculiX, report 98; Lame"
PRINTED = {"mean pressure": 5.742}
REASON = "rings are polygons whose nodes do not match; second order in the cells"
WITHIN = 5e-3


def ring(inside: float, outside: float, along: int, around: int) -> hv.Mesh:
    """A quarter of a ring; its boundaries: left (inside), right (outside), bottom and top."""
    plain = hv.rectangle((outside - inside, np.pi / 2.0), (along, around), origin=(inside, 0.0))
    r, angle = plain.points.T
    return hv.Mesh(np.column_stack([r * np.cos(angle), r * np.sin(angle)]), plain.cells, plain.boundaries)


def computed(fine: bool = False) -> dict[str, float]:
    """Four angles on the inner ring for three on the outer one."""
    n = 8 if fine else 2
    parts = {"inner": ring(20.0, 40.0, 4 * n, 16 * n), "outer": ring(40.0, 60.0, 3 * n, 12 * n)}
    problem = hv.ContactProblem(
        mesh=hv.Mesh.assembled(parts),
        material=hv.Material.young(196e3, 0.3, plane="stress"),
        contact={"inner:right": hv.Contact(hv.Signorini(), gap=-0.005, against="outer:left")},
        supports={f"{part}:{side}": "roller" for part in parts for side in ("bottom", "top")},
    )
    solution = hv.solve(problem).raise_for_status()
    return {"mean pressure": solution.normal_force / solution.contact.weights.sum()}
