"""Numbers that an equilibrium has, by name: what a bifurcation diagram draws over the load, and where a path ends."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from hemivar.basics.arguments import expect, number, suggest
from hemivar.basics.types import Array, IntArray
from hemivar.discrete.contact import ContactPoints
from hemivar.errors import ProblemError
from hemivar.solvers.boundary_result import friction_of

__all__ = ["QUANTITIES", "PathQuantity", "checked_until", "quantity_on"]


@dataclass(frozen=True)
class PathQuantity:
    """A number that an equilibrium has.

    Attributes
    ----------
    label : str
        On the axis.
    evaluate : callable
        From weights (m,), local displacements and multipliers (k, m, d) to (k,).
    of_displacement : bool
        Whether the displacement alone determines it.
    """

    label: str
    evaluate: Callable[[Array, Array, Array], Array]
    of_displacement: bool = True


#: What can be drawn over the load, by name.
QUANTITIES: Mapping[str, PathQuantity] = MappingProxyType(
    {
        "max-penetration": PathQuantity("largest penetration", lambda w, r, lam: r[:, :, 0].max(axis=1)),
        "max-opening": PathQuantity("largest opening", lambda w, r, lam: -r[:, :, 0].min(axis=1)),
        "mean-penetration": PathQuantity("mean penetration", lambda w, r, lam: r[:, :, 0] @ w / w.sum()),
        "max-slip": PathQuantity(
            "largest slip", lambda w, r, lam: np.linalg.norm(r[:, :, 1:], axis=2).max(axis=1, initial=0.0)
        ),
        "mean-slip": PathQuantity("mean slip", lambda w, r, lam: r[:, :, 1:].sum(axis=2) @ w / w.sum()),
        "normal-force": PathQuantity("normal force", lambda w, r, lam: lam[:, :, 0] @ w, False),
        "friction-force": PathQuantity("friction force", lambda w, r, lam: friction_of(lam).sum(axis=2) @ w, False),
    }
)


def quantity_on(name: str, contact: ContactPoints) -> tuple[PathQuantity, IntArray]:
    """The quantity of a name, and the contact points (k,) that it sees: all, or those of ``quantity:boundary``."""
    known, _, boundary = name.partition(":")
    points = contact.on(boundary) if boundary else np.arange(contact.count)
    return QUANTITIES[known if known in QUANTITIES else f"max-{known}"], points


def checked_until(until: object) -> Mapping[str, float]:
    """Values of quantities by name, as they are given."""
    given: Mapping[str, float] = expect(until, Mapping, "until", "give values by names, such as {'max-opening': 0.1}")
    for name, value in given.items():
        known, on, _ = str(name).partition(":")
        if known not in QUANTITIES and not (on and f"max-{known}" in QUANTITIES):
            raise ProblemError(
                f"until names the quantity '{name}', which is not known{suggest(str(name), list(QUANTITIES))}"
            )
        if not np.isfinite(number(value, f"until of '{name}'")):
            raise ProblemError(f"until of '{name}' is {value}; give a finite number")
    return given
