r"""
A first solution
================

The unit square is clamped on its left side, pushed down and to the left by its body force, and rests on a foundation
that is rigid up to a pressure and yields beyond it, with friction. These are the data (5.1) of the survey of Ochal,
Jureczka and Bartman (arXiv:2103.14518).
"""

import hemivar as hv
from hemivar.report import plot_contact, plot_problem

# %%
# State
# -----
# Every boundary of the rectangle has a name. A contact has a normal law and a friction law; here the pressure is at
# most 0.3 where the body only touches, and grows by 2 per unit of penetration beyond that:
#
# .. math::
#
#    \lambda_\nu \in \partial j_\nu(u_\nu), \qquad
#    \partial j_\nu(r) = \begin{cases} 0 & r < 0 \\ [0, q] & r = 0 \\ q + p\,r & r > 0 \end{cases},
#    \qquad |\lambda_\tau| \le h .

problem = hv.ContactProblem(
    mesh=hv.rectangle((1.0, 1.0), 32, pattern="cross"),
    material=hv.Material.lame(4.0, 4.0),
    supports={"left": hv.Clamped()},
    contact={"bottom": hv.Contact(hv.laws.ThresholdCompliance(q_max=0.3, p_const=2.0), hv.Tresca(0.5))},
    body_force=(-0.8, -0.8),
    title="survey, data (5.1)",
)
plot_problem(problem)

# %%
# Solve
# -----
# What did not converge would be an error here; otherwise the solution has displacement and multiplier.

solution = hv.solve(problem).raise_for_status()
print(f"{solution.status.value} in {solution.steps} steps, energy {solution.energy:.9f}")
print(f"largest penetration {solution.penetration.max():.6f}, largest pressure {solution.pressure.max():.6f}")
print(f"the foundation pushes up with {solution.normal_force:.6f}")

# %%
# Look
# ----
# Arrows show the force of the foundation on the body, per area, and end where it acts.

solution.plot()

# %%
# Along the foundation: pressure, friction with its bound, penetration and slip.

plot_contact(solution)

# %%
# Certify
# -------
# Is it the only solution, and how far can it be from the exact one of this mesh? Everything is recomputed from the
# problem alone.

print(solution.certify())
