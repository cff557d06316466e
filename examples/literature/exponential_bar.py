"""A bar on an exponential cohesive zone.

Length, section and modulus are 1. The zone at one end, of strength 1.1 and fracture energy 0.9, is rigid at first
and then pulls with sigma = 1.1 exp(-1.1 w/0.9) at the opening w. The other end is moved by U, so w = U - sigma.
"""

import hemivar as hv

SOURCE = "SSNP118 of Code_Aster; the root of one equation"
PRINTED = {"stress at U = 0.5": 0.5, "at 1": 1.0, "at 1.5": 0.2341348, "at 2": 0.1090623, "at 3": 0.0291371}
REASON = "the zone is 1e3 (fine: 1e6) times stiffer than the bar, not rigid; chords stand for the curve"
WITHIN = 5e-3


def computed(fine: bool = False) -> dict[str, float]:
    """One square between rollers without a Poisson's ratio; ``fine`` has the stiffness 1e6."""
    zone = hv.laws.ExponentialCohesion(strength=1.1, energy=0.9, stiffness=1e6 if fine else 1e3)
    found, before = {}, None
    for name, moved in zip(PRINTED, (0.5, 1.0, 1.5, 2.0, 3.0), strict=True):
        problem = hv.ContactProblem(
            mesh=hv.rectangle((1.0, 1.0), 1),
            material=hv.Material.young(1.0, 0.0),
            contact={"left": hv.Contact(hv.laws.MixedMode(zone))},
            supports={"right": hv.Fixed(x=moved), "bottom": "roller", "top": "roller"},
        )
        solution = hv.solve(problem, initial=before).raise_for_status()
        found[name], before = -solution.normal_force, solution.unknowns
    return found
