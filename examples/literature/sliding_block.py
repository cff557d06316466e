"""A block that begins to slide.

A block of 40 x 20, pressed down by 300 per area, with friction 0.3 below it, is pushed from the left by a traction.
Springs of 4 in all hold its right side. Friction carries 3600: a push of 178.2 x 20 sticks, and 181.8 x 20 slides
by 36/4.
"""

import hemivar as hv

SOURCE = "SSNV503 of Code_Aster"
PRINTED = {"normal force": 12000.0, "friction at 178.2": 3564.0, "friction at 181.8": 3600.0, "slip at 181.8": 9.0}
REASON = "the springs carry their part of the elastic strain; the modulus is 2.1e5"
WITHIN = 0.02


def pushed(traction: float) -> hv.Solution:
    """The block under a traction from the left."""
    problem = hv.ContactProblem(
        mesh=hv.rectangle((40.0, 20.0), (8, 4)),
        material=hv.Material.young(2.1e5, 0.0),
        contact={"bottom": hv.Contact(hv.Signorini(), hv.Coulomb(0.3))},
        supports={"right": hv.mechanics.Spring(normal=4.0 / 20.0)},
        tractions={"top": hv.Pressure(300.0), "left": (traction, 0.0)},
    )
    return hv.solve(problem).raise_for_status()


def computed(fine: bool = False) -> dict[str, float]:
    """One mesh serves."""
    sticks, slides = pushed(178.2), pushed(181.8)
    slip = float(abs(slides.slip).mean())
    forces = (sticks.normal_force, abs(sticks.friction_force[0]), abs(slides.friction_force[0]), slip)
    return dict(zip(PRINTED, forces, strict=True))
