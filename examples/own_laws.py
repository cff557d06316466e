r"""
Laws of your own: a table, a formula, a function
================================================

The same foundation four times: springs of stiffness 30 that give way beyond the penetration 0.05 until nothing is left
(:class:`hemivar.Softening`). All that methods and certificates need of a law is derived from what is given: kinks,
proximal map, and the weak convexity constant :math:`\alpha`, the smallest number for which
:math:`j(r) + \tfrac{\alpha}{2} r^2` is convex.
"""

import numpy as np

import hemivar as hv
from hemivar.report import plot_law

named = hv.Softening(stiffness=30.0, limit=0.05, softening=2.0)
end = 0.05 + 30.0 * 0.05 / 2.0  # nothing is left from here on

# %%
# A table of pressures, as measured; straight lines between.

table = hv.table_law([-1.0, 0.0, 0.05, end, 1.0], [0.0, 0.0, 1.5, 0.0, 0.0])

# %%
# A formula for the potential j; it is differentiated symbolically.

lost = 0.5 * 1.5 * end  # the work until nothing is left
formula = hv.FormulaLaw(
    f"piecewise((0, r < 0), (15*r^2, r < 0.05), (0.0375 + 1.5*(r - 0.05) - (r - 0.05)^2, r < {end}), ({lost}, True))",
    kinks=(0.0, 0.05, end),
)


# %%
# A Python function for the pressure.


def pressure(r: np.ndarray) -> np.ndarray:
    """j' at penetrations of shape (m,)."""
    return np.interp(r, [0.0, 0.05, end], [0.0, 1.5, 0.0], left=0.0, right=0.0)


function = hv.laws.FunctionLaw(derivative=pressure, kinks=(0.0, 0.05, end))

# %%
# The graph of the law: a falling branch, hence :math:`\alpha = 2`.

plot_law(hv.laws.ContactLaw(named).at(None).normal, reach=1.2)

# %%
# The same body on each of them. Those of a Python function are known from samples only: then
# nothing is called unique.

laws = {"named": named, "table": table, "formula": formula, "function": function}
depths = {}
for name, law in laws.items():
    problem = hv.ContactProblem(
        mesh=hv.rectangle((1.0, 1.0), 16, pattern="cross"),
        material=hv.Material.lame(4.0, 4.0),
        supports={"left": hv.Clamped()},
        contact={"bottom": hv.Contact(law)},
        body_force=(0.0, -1.0),
    )
    solution = hv.solve(problem).raise_for_status()
    certificate = solution.certify()
    depths[name] = float(solution.penetration.max())
    print(
        f"{name:<9} largest penetration {depths[name]:.9f}, margin {certificate.margin:.4f}, "
        f"unique: {certificate.unique}, sampled: {certificate.error_bound_sampled}"
    )
solution.plot()
