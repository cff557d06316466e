"""A double cantilever of a laminate.

Two arms of 1.5 mm, 100 long and 20 wide, are glued beyond a crack of 30 and pulled apart; E1 = 135300, E2 = 9000, G
= 5200 MPa, nu = 0.24, fracture energy 0.28 N/mm. Printed are the largest load and the opening at it: finite
elements for a strength of 1.7 MPa, beams for 57. By symmetry one arm is enough.
"""

import hemivar as hv
from hemivar.fem import LoadLine

SOURCE = "Alfano, Crisfield 2001, table I"
PRINTED = {"load, strength 1.7": 49.5, "opening there": 2.90, "load, strength 57": 63.2}
REASON = "theirs are elements with a mesh of their own; beams do not shear"
WITHIN = 0.04


def pulled(strength: float, cells: int, upto: float) -> tuple[float, float]:
    """Largest load, and the opening there; quadratic elements, two across the arm."""
    glue = hv.Adhesive(stiffness=2e6, strength=strength, energy=0.14, compression=2e6)
    along, across, shear, poisson = 135300.0, 9000.0, 5200.0, 0.24
    both = 1.0 - poisson**2 * across / along
    tensor = [
        [along / both, poisson * across / both, 0.0],
        [poisson * across / both, across / both, 0.0],
        [0.0, 0.0, shear],
    ]
    arm = hv.ContactProblem(
        mesh=hv.rectangle((100.0, 1.5), (cells, 2)).marked({"glue": "y < 1e-9 and x > 29.99"}),
        material=hv.Material.tensor(tensor),
        contact={"glue": hv.Contact(glue)},
        supports={"left": hv.Fixed(y=0.5), "right": "clamped"},
        order=2,
    )
    line = LoadLine.of(arm)
    path = hv.follow_path(line.loaded, (0.0, upto), unloaded=line.unloaded)
    load = -20.0 * path.normal_force
    return float(load.max()), float(path.load_factor[load.argmax()])


def computed(fine: bool = False) -> dict[str, float]:
    """Cells of 1 and 0.5 mm, or of half of that: strong glue has a short process zone."""
    weak, strong = pulled(1.7, 200 if fine else 100, 3.5), pulled(57.0, 400 if fine else 200, 2.2)
    return dict(zip(PRINTED, (*weak, strong[0]), strict=True))
