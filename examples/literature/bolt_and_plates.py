"""A bolt that clamps two plates.

The bolt has 0.4 of the stiffness of bolt and plates. It is tightened by 1000; a working load of 400 then pulls the
plates apart: the bolt takes 1000 + 0.4 x 400 and the plates keep 1000 - 0.6 x 400.
"""

import numpy as np

import hemivar as hv

SOURCE = "joint diagram"
PRINTED = {"bolt": 1160.0, "plates": 760.0}
REASON = "none: the strains are constant"
WITHIN = 1e-9
STEP = hv.mechanics.Step


def computed(fine: bool = False) -> dict[str, float]:
    """Half of the joint: a bolt of the width 4 between plates of 3 and 3, parted by slits, under a stiff cap."""
    plain = hv.rectangle((10.0, 12.0), (10, 12))
    middle = plain.points[plain.cells].mean(axis=1)
    regions = {"joint": np.flatnonzero(middle[:, 1] < 10.0), "cap": np.flatnonzero(middle[:, 1] > 10.0)}
    mesh = hv.Mesh(plain.points, plain.cells, plain.boundaries, regions)
    mesh = mesh.with_interfaces({"slits": lambda x: (np.abs(np.abs(x[:, 0] - 5.0) - 2.0) < 1e-9) & (x[:, 1] < 10.0)})
    mesh = mesh.opened("slits")
    mesh = mesh.marked({"bolt": "y < 1e-9 and abs(x - 5) < 2.01", "plates": "y < 1e-9 and abs(x - 5) > 1.99"})
    problem = hv.ContactProblem(
        mesh=mesh,
        material=hv.Material.by_region({"joint": hv.Material.young(2e5, 0.0), "cap": hv.Material.young(2e8, 0.0)}),
        contact={"bolt": hv.Contact(hv.laws.Bolt()), "plates": hv.Contact(hv.Signorini())},
        supports={"left": "roller", "right": "roller"},
        steps=[STEP("tighten", bolts={"bolt": 1000.0}), STEP("work", tractions={"top": (0.0, 40.0)})],
    )
    history = hv.march(hv.Evolution(problem))
    return {"bolt": -history["bolt.normal_force"][-1], "plates": history["plates.normal_force"][-1]}
