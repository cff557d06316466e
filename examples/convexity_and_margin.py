r"""
From one solution to several
============================

A block on springs that give way, pushed from above. As long as the springs soften less than the block is stiff,
:math:`\alpha < \kappa`, the certificate proves that the solution is the only one; beyond, the search finds others.
"""

import matplotlib.pyplot as plt

import hemivar as hv


def block(softening: float) -> hv.ContactProblem:
    """One square between frictionless walls: kappa = 12."""
    return hv.ContactProblem(
        mesh=hv.rectangle((1.0, 1.0), 1),
        material=hv.Material.lame(4.0, 4.0),
        supports={"left": hv.Roller(), "right": hv.Roller(), "top": hv.Fixed(y=-0.15)},
        contact={"bottom": hv.Contact(hv.Softening(stiffness=30.0, limit=0.05, softening=softening))},
    )


# %%
# Margins by hand: :math:`1 - \alpha/12` for the uniform motion, the softest one.

margins, counts = {}, {}
for softening in (3.0, 6.0, 9.0, 11.0, 13.0, 16.0, 20.0, 30.0):
    solution = hv.solve(block(softening)).raise_for_status()
    certificate = solution.certify()
    found = hv.find_solutions(hv.discretize(block(softening)))
    margins[softening], counts[softening] = certificate.margin, len(found)
    print(
        f"alpha {softening:>4g}: margin {certificate.margin:+.4f}, unique: {certificate.unique}, "
        f"{len(found)} found, exhaustive: {found.exhaustive}"
    )

# %%
# One solution while the margin is positive.

fig, (above, below) = plt.subplots(2, 1, figsize=(6.0, 4.2), sharex=True, layout="constrained")
above.plot(list(margins), list(margins.values()), "o-")
above.axhline(0.0, color="0.5", linewidth=0.8)
above.set_ylabel("margin")
below.plot(list(counts), list(counts.values()), "s")
below.set(xlabel="softening of the springs", ylabel="solutions")
plt.show()
