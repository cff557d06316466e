"""A cube on a rigid plane.

The unit cube, E = 90 and nu = 1/4, stands on a rigid plane between two planes of symmetry; its top bears the
pressure 10.
"""

import hemivar as hv

SOURCE = "JuliaFEM, problem 21"
PRINTED = {"u_x of the free corner": 1 / 36, "u_y": 1 / 36, "u_z": -1 / 9}
REASON = "none: the strains are constant"
WITHIN = 1e-9


def computed(fine: bool = False) -> dict[str, float]:
    """One mesh serves."""
    problem = hv.ContactProblem(
        mesh=hv.box((1.0, 1.0, 1.0), 2),
        material=hv.Material.young(90.0, 0.25),
        contact={"bottom": hv.Contact(hv.Signorini())},
        supports={"left": "roller", "front": "roller"},
        tractions={"top": hv.Pressure(10.0)},
    )
    corner = problem.mesh.points.sum(axis=1).argmax()
    return dict(zip(PRINTED, map(float, hv.solve(problem).displacement[corner]), strict=True))
