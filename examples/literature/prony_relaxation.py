"""A block with two Prony branches is pushed onto a spring and held.

A column of modulus 6 with branches (6, T = 0.5) and (3, T = 2), above a spring p = 2, whose top moves down by 0.1
until t = 0.5 and stays. Exact: the matrix exponential of the strains of the two dashpots.
"""

import numpy as np
from scipy.linalg import expm

import hemivar as hv

SOURCE = "matrix exponential of two dashpots"
MODULI, TIMES, SPRING, DEPTH, RAMP = np.array([6.0, 3.0]), np.array([0.5, 2.0]), 2.0, 0.1, 0.5


def exact(until: float) -> float:
    """``h' + h/T = k e'`` with ``e = d - P/p`` and ``P = 6 e + sum h``: linear in h and d, on and after the ramp."""
    total, state = 6.0 + SPRING, np.array([0.0, 0.0, 0.0, 1.0])
    for rate, time in ((DEPTH / RAMP, RAMP), (0.0, until - RAMP)):
        mass = np.eye(4)
        mass[:2, :2] += np.outer(MODULI, np.ones(2)) / total
        motion = np.zeros((4, 4))
        motion[:2, :2], motion[:2, 3], motion[2, 3] = -np.diag(1.0 / TIMES), MODULI * SPRING * rate / total, rate
        state = expm(np.linalg.solve(mass, motion) * time) @ state
    strain = (SPRING * state[2] - state[:2].sum()) / total
    return float(SPRING * (state[2] - strain))


PRINTED = {"pressure at the end of the ramp": exact(RAMP), "at t = 2": exact(2.0)}
REASON = "order two in the step"
WITHIN = 1e-4


def computed(fine: bool = False) -> dict[str, float]:
    """40 steps of implicit Euler, whose branches are exact for strains linear in a step; 320 on ``fine``."""
    branches = [hv.mechanics.Branch(lame=(0.0, 0.5 * k), time=T) for k, T in zip(MODULI, TIMES, strict=True)]
    problem = hv.ContactProblem(
        mesh=hv.rectangle((1.0, 1.0), 1),
        material=hv.Material.lame(0.0, 3.0, branches=branches),
        contact={"bottom": hv.Contact(hv.Compliance(SPRING))},
        supports={"left": "roller", "right": "roller", "top": hv.Fixed(y="-0.2*min(t, 0.5)")},
    )
    history = hv.march(hv.Evolution(problem), 2.0, step=2.0 / (320 if fine else 40))
    pressures = np.interp([RAMP, 2.0], history.times, history["normal_force"])
    return dict(zip(PRINTED, map(float, pressures), strict=True))
