r"""
Friction that weakens with the slip
===================================

Inside the margin there is one answer, beyond it there may be several. The margin is :math:`1 - c` with c the largest
eigenvalue of :math:`(B'W\,\mathrm{diag}(\alpha)\,B,\ K)`: the softening of the laws against the stiffness of the body.
"""

import matplotlib.pyplot as plt
import numpy as np

import hemivar as hv
from hemivar.certificates import certify
from hemivar.gallery import shear_block_slips, shear_column, softening_block, survey_logarithmic

# %%
# The survey's square
# -------------------
# With friction :math:`h \ln(1 + |u_\tau|)` instead of Tresca's its constant is :math:`\alpha_\tau = h`.

BOUNDS = (0.1, 0.25, 0.5, 1.0, 2.0, 4.0)
margins: dict[float, float] = {}
slips: dict[float, float] = {}
print(f"{'h':>6}{'margin':>10}{'slipping':>10}{'largest slip':>14}  kind of point")
for bound in BOUNDS:
    solution = hv.solve(survey_logarithmic(bound, 16)).raise_for_status()
    what = solution.certify()
    slip = np.abs(solution.slip[:, 0])
    moving = int(np.count_nonzero(slip > 1e-12))
    print(f"{bound:>6g}{what.margin:>10.4f}{moving:>10}{slip.max():>14.6f}  {what.kind.value}")
    margins[bound], slips[bound] = what.margin, float(slip.max())

fig, (left, right) = plt.subplots(1, 2, figsize=(7.5, 3.0), layout="constrained")
left.plot(BOUNDS, list(margins.values()), "o-")
left.axhline(0.0, color="0.5", linewidth=0.8)
left.set(xlabel="friction bound h", ylabel="margin")
right.plot(BOUNDS, list(slips.values()), "o-")
right.set(xlabel="friction bound h", ylabel="largest slip")
plt.show()

# %%
# A sheared column
# ----------------
# The survey's :math:`j(r) = 0.7 r - 0.3 e^{-r}` and a steeper one: slips are known by Lambert's W function, inside the
# margin and beyond, where sticking and slipping are solutions of the same load.

worst = 0.0
for bound, rate, free in ((0.5, 1.0, 0.3), (1.0, 20.0, 0.248)):
    exact = shear_block_slips(4.0, free, bound, rate=rate)
    found = hv.find_solutions(shear_column(bound, load=8.0 * free, rate=rate))
    by_slip = sorted(found, key=lambda solution: float(solution.slip[0, 0]))
    for one, known in zip(by_slip, exact, strict=True):
        print(f"rate {rate:g}: {one.slip[0, 0]:.12f} {known:.12f}  {one.kind}, E {one.energy:.8f}")
        worst = max(worst, abs(float(one.slip[0, 0]) - known))

# %%
# A block on softening springs
# ----------------------------
# All its uniform solutions; the margin is negative where there may be several.

roots = []
for softening, top in ((6.0, 0.12), (6.0, 0.2), (6.0, 0.4), (20.0, 0.14)):
    for case in softening_block(softening=softening, top_displacement=top, n=4).solutions:
        problem = hv.discretize(case.problem)
        assert problem.field is not None
        displacement = case.displacement(problem.field.nodes)
        what = certify(problem, problem.field.restrict(displacement))
        s = -float(displacement[:, 1][np.argmin(problem.field.nodes[:, 1])])
        print(f"alpha {softening:g}, top {top:g}: s = {s:.6f}, {what.kind.value}, margin {what.margin:.3f}")
        roots.append(s)
