"""Problems with heat of the literature."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hemivar.basics.known_statement import ManufacturedProblem
from hemivar.basics.types import Array
from hemivar.evolution import Evolution
from hemivar.laws import Compliance, Logarithmic
from hemivar.mechanics import Contact, ContactProblem, Heat, HeatContact, Material
from hemivar.mesh import rectangle

__all__ = ["WarmBody", "thermoviscoelastic"]


@dataclass(frozen=True, eq=False)
class WarmBody(ManufacturedProblem):
    """A body in time with its heat; it may be given wherever an evolution is asked for.

    Attributes
    ----------
    problem : ContactProblem
    heat : Heat
    until : float
        End of the time that is looked at.
    """

    problem: ContactProblem
    heat: Heat
    until: float

    @property
    def statement(self) -> Evolution:
        """The evolution, with inertia."""
        return Evolution(self.problem, inertia=True, heat=self.heat)


def thermoviscoelastic(n: int = 16, share: float = 0.1) -> WarmBody:
    """A warm body that nothing clamps, squeezed from both sides, on a foundation that it rubs and gives heat to.

    After Bartman, Bartosz, Jureczka and Szafraniec, *Numerical analysis of a non-clamped dynamic thermoviscoelastic
    contact problem*, arXiv:1901.07845; data of the program that its authors published.  The body (0, 1.5) x (0, 1) has
    ``lam = 105, mu = 45``, viscosity ``(10.5, 4.5)``, density and capacity 1, thermal stress 1/2 per degree (in the
    balance of heat as well), conductivity 0.033 and the temperature 0.25.  It bears (0, -0.981) and is pushed by
    ``48 (1/4 - (y - 1/2)^2)`` from the left and ``44 (...)`` from the right.  Below, the pressure is 1000 times the
    penetration, friction ``1/(1 + |u_tau'|)``, which is not monotone, and heat flows by ``0.1 (th - 0.27)``.

    There the foundation gives heat ``0.1 |u_tau'|``; here it is a share of the power of friction,
    ``share |u_tau'|/(1 + |u_tau'|)``, which is the same for small rates.

    Parameters
    ----------
    n : int
        Cells over the height, an even number.
    share : float

    Returns
    -------
    WarmBody
    """
    sides = {"left": 48.0, "right": -44.0}

    def push(size: float) -> object:
        def at(x: Array) -> Array:
            return np.column_stack([size * (0.25 - (x[:, 1] - 0.5) ** 2), np.zeros(len(x))])

        return at

    problem = ContactProblem(
        mesh=rectangle((1.5, 1.0), (3 * n // 2, n)),
        material=Material.lame(105.0, 45.0, density=1.0, viscosity=(10.5, 4.5)),
        contact={"bottom": Contact(Compliance(1e3), Logarithmic(1.0, of="rate"))},
        tractions={name: push(size) for name, size in sides.items()},  # type: ignore[misc]
        body_force=(0.0, -0.981),
        title="thermoviscoelastic body",
    )
    heat = Heat(
        conductivity=0.033, capacity=1.0, thermal_stress=0.5, coupling=1.0, temperature=0.25,
        contact={"bottom": HeatContact(0.1, 0.27, share)},
    )  # fmt: skip
    return WarmBody(problem, heat, 1.0)
