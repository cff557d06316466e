"""Whether the balance of energy of a step closes to what the residual of its solution allows.

What is left of the balance is the work of the forces that are out of balance on the way of the step, at most the
product of both norms.  A step that counts as solved leaves at most ``rtol`` times the forces that act, rounding aside;
these are the norms of the load, of elastic, viscous and inertial forces, of branches and of the foundation, as they are
where the step ends.  A residual that is measured against larger forces, which cancel, may be small and yet allow more.
"""

from __future__ import annotations

import numpy as np

from hemivar.basics.arrays import norm
from hemivar.basics.types import Array
from hemivar.evolution.discrete import DiscreteEvolution
from hemivar.evolution.energy_balance import EnergyBalance
from hemivar.evolution.stage import Stage, StageState, rounding_size

__all__ = ["allowed_work", "rounding_of"]

#: Rounding of sums, in units of what is added up: of energies, and of forces where a step is solved as well as these
#: are known.
_ENERGIES, _FORCES = 64.0 * float(np.finfo(float).eps), 1024.0 * float(np.finfo(float).eps)


def rounding_of(ledger: EnergyBalance) -> float:
    """How far rounding may take the gap of a ledger, which is a sum of its entries."""
    return _ENERGIES * float(sum(map(abs, vars(ledger).values())))


def allowed_work(
    discrete: DiscreteEvolution,
    stage: Stage,
    reached: StageState,
    multiplier: Array,
    way: Array,
    rtol: float,
) -> float:
    """Most work on a way (n + k,) of the forces that a solved stage may leave out of balance.

    ``multiplier`` is (m, c).
    """
    n = discrete.unknowns
    acting = norm(stage.load[:n]) + norm(discrete.problem.contact_force(multiplier))
    acting += sum(abs(force.factor) * norm(force.vector[:n]) for force in reached.forces.values())
    rounding = rounding_size(discrete, stage, reached.body, 0.0)
    return norm(way[:n]) * (rtol * acting + _FORCES * (acting + rounding))
