"""A block between rigid plates.

A block in plane strain, of Poisson's ratio 0.3, is pressed from above against a smooth rigid plate. Its sides move
by nu/(1 - nu) of what the upper plate does, and its modulus is 1/(1 - nu^2) times Young's.
"""

import hemivar as hv

SOURCE = "V1.01.237 of Code_Aster"
PRINTED = {"side over top": 0.428571, "modulus": 1.098901}
REASON = "the digits printed: strains are constant"
WITHIN = 2e-6


def computed(fine: bool = False) -> dict[str, float]:
    """The unit square, its upper side moved down by 1e-3; Young's modulus 1000. One mesh serves."""
    problem = hv.ContactProblem(
        mesh=hv.rectangle((1.0, 1.0), 4),
        material=hv.Material.young(1e3, 0.3),
        contact={"bottom": hv.Contact(hv.Signorini())},
        supports={"top": hv.Fixed(y=-1e-3), "left": "roller"},
    )
    solution = hv.solve(problem).raise_for_status()
    return {"side over top": solution.displacement[:, 0].max() / 1e-3, "modulus": solution.normal_force}
