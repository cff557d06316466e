r"""
Retaining wall: safe from sliding and toppling
==============================================

A concrete wall stands on rock, held by its weight and friction alone. Water presses on its back. The weight stays, the
push of the water grows: at which multiple of it does the wall slide, and when does it topple? Both have closed forms.
"""

from dataclasses import replace

import numpy as np

import hemivar as hv

HEIGHT, CROWN, BASE = 4.0, 1.0, 3.2  # m
WEIGHT, WATER, FRICTION = 24.0, 9.81, 0.7  # kN per m^3, and 1

# %%
# The back of the wall is vertical, its front slopes. Forces are in kN, lengths in m.


def pressure(points: np.ndarray) -> np.ndarray:
    """Traction of the water, which stands to the crown."""
    return np.column_stack([WATER * (HEIGHT - points[:, 1]), np.zeros(len(points))])


plain = hv.rectangle((1.0, HEIGHT), (16, 20), pattern="cross")
x, y = plain.points.T
wall = hv.ContactProblem(
    mesh=hv.Mesh(np.column_stack([x * (BASE + (CROWN - BASE) * y / HEIGHT), y]), plain.cells, plain.boundaries),
    material=hv.Material.young(30e6, 0.2),
    contact={"bottom": hv.Contact(hv.Signorini(), hv.Coulomb(FRICTION))},
    body_force=(0.0, -WEIGHT),
    tractions={"left": pressure},
    title="retaining wall (m, kN)",
)

# %%
# ``constant=["body"]`` keeps the weight. The path ends where the wall slides away, at friction times weight over push.

weight, push = WEIGHT * HEIGHT * (CROWN + BASE) / 2.0, WATER * HEIGHT**2 / 2.0
path = hv.follow_path(wall, (0.0, 5.0), constant=["body"])
sliding = FRICTION * weight / push
print(f"slides at {path.limit_load:.6f} times the push of the water; friction times weight over push: {sliding:.6f}")

# %%
# On a rough base it cannot slide. It topples where the moments of weight and water about the toe are equal.

rough = replace(wall, contact={"bottom": hv.Contact(hv.Signorini(), hv.Coulomb(3.0))})
tipping = hv.follow_path(rough, (0.0, 5.0), constant=["body"])
moment = WEIGHT * HEIGHT * (BASE**2 / 3.0 + BASE * CROWN / 3.0 - CROWN**2 / 6.0)
toppling = moment / (push * HEIGHT / 3.0)
print(f"topples at {tipping.limit_load:.6f}; by the moments about the toe: {toppling:.6f}")

# %%
# For any law and body, in 3D as well, ``load_bracket`` brackets the load to 1 %. The wall is drawn at the largest load
# with an equilibrium: it stands on its toe alone.

found = hv.branches.load_bracket(rough, upto=5.0, constant=["body"])
print(found)
found.solution.plot(scale="auto", unit="m", stress_unit="kPa")

# %%
# The base opens from the heel on, long before the wall topples.

hv.report.plot_path(tipping, quantity="max-opening", unit="m", title="rough base: load factor of the water")
