"""Numbers that a solution has, by name: columns of sweeps and studies, and what two meshes are compared by."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType

import numpy as np

from hemivar.basics.arguments import described, expect, quoted, suggest
from hemivar.basics.types import Array
from hemivar.errors import ProblemError
from hemivar.mechanics.statement import ContactProblem
from hemivar.solvers.solution import Solution
from hemivar.solvers.status import Status

__all__ = ["check_quantity", "checked_names", "parted", "quantity_of", "unit_of"]


def _most(values: Array) -> float:
    return float(values.max(initial=-np.inf)) if values.size else float("nan")


def _carried(solution: Solution) -> float:
    """Up to which part of the load equilibria were found: all of it where the solve converged."""
    if solution.status is Status.CONVERGED:
        return 1.0
    return float("nan") if solution.carried is None else solution.carried[0]


#: Each number, and what it is of.
_NUMBERS: Mapping[str, tuple[Callable[[Solution], float], str]] = MappingProxyType(
    {
        "max-pressure": (lambda one: _most(one.pressure), "stress"),
        "max-penetration": (lambda one: _most(one.penetration), "length"),
        "max-opening": (lambda one: _most(-one.penetration), "length"),
        "max-slip": (lambda one: _most(np.linalg.norm(one.slip, axis=1)), "length"),
        "max-displacement": (lambda one: _most(np.linalg.norm(np.atleast_2d(one.displacement), axis=-1)), "length"),
        "max-stress": (lambda one: _most(one.von_mises()), "stress"),
        "max-damage": (lambda one: _most(one.debonding.get("damage", np.zeros(0))), ""),
        "normal-force": (lambda one: one.normal_force, "force"),
        "friction-force": (lambda one: float(np.linalg.norm(one.friction_force)), "force"),
        "contact-length": (lambda one: one.contact_length, ""),
        "energy": (lambda one: one.energy, "energy"),
        "load-factor": (_carried, ""),
    }
)
_KINDS = ("contact", "support")


def parted(name: str) -> tuple[str, str, int | None] | None:
    """Of ``support.NAME.force.x`` the kind, the name and the component; None where it is no such name."""
    kind, _, rest = name.partition(".")
    boundary, _, end = rest.rpartition(".")
    axis = "xyz".index(end) if end in ("x", "y", "z") else None
    if axis is not None:
        boundary, _, end = boundary.rpartition(".")
    return (kind, boundary, axis) if kind in _KINDS and boundary and end == "force" else None


def check_quantity(name: object, problem: ContactProblem) -> str:
    """The name of a number that solutions of a problem have.

    Parameters
    ----------
    name : str
        ``max-pressure``, ``max-penetration``, ``max-opening``, ``max-slip``, ``max-displacement``, ``max-stress`` (von
        Mises), ``max-damage``, ``normal-force``, ``friction-force``, ``contact-length``, ``energy``, ``load-factor``
        (up to which the load was carried), ``support.NAME.force`` and ``contact.NAME.force``, of which ``.x`` at the
        end takes a component and nothing the size.

    Raises
    ------
    ProblemError
        The name is not known, or there is no such support or contact.
    """
    text = expect(name, str, "a quantity", "name it as in 'max-pressure'")
    sides = ((name, contact.against) for name, contact in problem.contact.items())
    forces = [f"contact.{side}.force" for pair in sides for side in pair if side]
    forces += [f"support.{name}.force" for name in problem.supports]
    parts = parted(text)
    whole = text if parts is None else f"{parts[0]}.{parts[1]}.force"
    if text in _NUMBERS or (whole in forces and (parts is None or (parts[2] or 0) < problem.mesh.dim)):
        return text
    raise ProblemError(f"quantity {quoted(text)} is not known{suggest(text, [*_NUMBERS, *forces])}")


def checked_names(names: object) -> tuple[str, ...]:
    """Names of numbers as options keep them, whatever problem they are of."""
    if isinstance(names, str) or not isinstance(names, Sequence) or not all(isinstance(name, str) for name in names):
        raise ProblemError(f"columns is {described(names)}; give names, such as ['max-pressure']")
    return tuple(names)


def quantity_of(solution: Solution, name: str) -> float:
    """The number of a name, see :func:`check_quantity`; nan where the solution has none."""
    if name in _NUMBERS:
        return _NUMBERS[name][0](solution)
    parts = parted(name)
    assert parts is not None
    kind, boundary, axis = parts
    force = (solution.contact_forces if kind == "contact" else solution.reactions)[boundary]
    return float(np.linalg.norm(force) if axis is None else force[axis])


def unit_of(name: str) -> str:
    """Of what it is: "length", "force", "stress", "energy" or nothing."""
    return _NUMBERS[name][1] if name in _NUMBERS else "force"
