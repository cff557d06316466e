r"""
The constant of the trace: how much softening does a body bear?
===============================================================

:math:`\Lambda = \inf a(v, v)/\|v\|^2_{L^2(\Gamma_C)}` tells how stiff the body is, seen from the contact boundary. A
law with weak convexity constant :math:`\alpha < \Lambda` leaves one solution, of the continuous problem too. On a mesh
Rayleigh quotients lie above; a lower bound needs more, and is computed here beside the upper one.
"""

import matplotlib.pyplot as plt

import hemivar as hv
from hemivar.bounds import lower_bounds


def strip(length: float) -> hv.ContactProblem:
    """Clamped at the left, in contact below."""
    return hv.ContactProblem(
        mesh=hv.rectangle((length, 1.0), (max(2, round(4 * length)), 4), pattern="cross"),
        material=hv.Material.lame(4.0, 4.0),
        supports={"left": hv.Clamped()},
        contact={"bottom": hv.Contact(hv.Compliance(1.0))},
    )


# %%
# The longer the strip, the softer its free end. Each bound is computed on a mesh of its own, which the meshes of the
# problem do not matter for.

lengths = (0.5, 1.0, 1.5, 2.0)
found = {length: lower_bounds(strip(length), cells=600).both for length in lengths}
for length, bound in found.items():
    print(f"length {length:g}: {bound.lower:.5f} <= Lambda <= {bound.upper:.5f}, without Lehmann {bound.simple:.5f}")

fig, ax = plt.subplots(figsize=(5.6, 3.2), layout="constrained")
ax.fill_between(lengths, [b.lower for b in found.values()], [b.upper for b in found.values()], alpha=0.4)
ax.plot(lengths, [b.lower for b in found.values()], "o-", label="guaranteed lower bound")
ax.plot(lengths, [b.upper for b in found.values()], "s-", label="upper bound")
ax.set(xlabel="length of the strip", ylabel=r"$\Lambda$", yscale="log")
ax.legend()
plt.show()

# %%
# What it is for: the margin that a certificate prints is :math:`1 - \alpha/\Lambda` for one constant law, with the
# constant of the mesh. For the strip of length 1 a softening of half of the bound is safe.

soft = hv.Softening(stiffness=2.0, limit=0.02, softening=0.5 * found[1.0].lower)
problem = hv.ContactProblem(
    mesh=hv.rectangle((1.0, 1.0), 16, pattern="cross"),
    material=hv.Material.lame(4.0, 4.0),
    supports={"left": hv.Clamped()},
    contact={"bottom": hv.Contact(soft)},
    body_force=(0.0, -0.8),
)
certificate = hv.solve(problem).raise_for_status().certify()
print(f"margin {certificate.margin:.4f}, unique: {certificate.unique}")
