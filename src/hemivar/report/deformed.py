"""The deformed configuration that pictures start from: where its nodes and contact points are, and its colours."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from enum import StrEnum
from numbers import Real

import numpy as np

from hemivar.basics.arguments import one_of, quoted
from hemivar.basics.first_use import cached_property
from hemivar.basics.types import Array, BoolArray
from hemivar.discrete.problem import DiscreteProblem
from hemivar.errors import ProblemError
from hemivar.fem import nodal_average, von_mises
from hemivar.mesh.mesh import Mesh
from hemivar.report.style import MANY_CELLS, with_unit
from hemivar.solvers import Solution
from hemivar.solvers.contact_states import Kind, NormalState, TangentialState

__all__ = ["BodyColour", "DeformedBody", "round_number", "state_label"]


class BodyColour(StrEnum):
    """What colours a body in a figure."""

    STRESS = "stress"
    """The von Mises stress."""
    DISPLACEMENT = "displacement"
    """The size of the displacement."""
    NONE = "none"
    """Nothing."""

    def label(self, unit: str, stress_unit: str) -> str:
        """What the scale of colours says."""
        return with_unit("von Mises stress", stress_unit) if self is BodyColour.STRESS else with_unit(self.value, unit)

    @classmethod
    def of(cls, given: BodyColour | str | None, usual: BodyColour) -> BodyColour:
        """What was asked for, or what is usual; ``ProblemError`` where there is no such colouring."""
        return usual if given is None else one_of(given, "colour", cls)


@dataclass(frozen=True, eq=False)
class DeformedBody:
    """The body of a solution of a problem with a mesh, its displacement drawn ``factor`` times as large."""

    solution: Solution
    factor: float

    @classmethod
    def of(cls, solution: Solution, scale: float | str) -> DeformedBody:
        """With a factor given by number, or chosen (``"auto"``) so that small displacements are visible."""
        field = solution.problem.field
        if field is None:
            raise ProblemError(
                "it was made of arrays and has no mesh; give one, of_arrays(..., mesh=...), or take plot_contact"
            )
        if isinstance(scale, str) and scale == "auto":
            return cls(solution, _visible(solution.problem, field.mesh, solution.displacement))
        if not isinstance(scale, Real) or isinstance(scale, bool) or not 0.0 < scale < 1e150:
            raise ProblemError(f"scale = {quoted(scale)}; give a positive number or 'auto'")
        return cls(solution, float(scale))

    @property
    def problem(self) -> DiscreteProblem:
        """What was solved."""
        return self.solution.problem

    @property
    def mesh(self) -> Mesh:
        """The body at rest."""
        assert self.problem.field is not None
        return self.problem.field.mesh

    @cached_property
    def vertices(self) -> Array:
        """Where the vertices of the mesh are drawn, (N, d)."""
        return self.mesh.points + self.factor * self.solution.displacement[: self.mesh.number_of_nodes]

    @cached_property
    def contact_places(self) -> Array:
        """Where the contact points are drawn, (m, d)."""
        contact = self.problem.contact
        assert contact.points is not None
        return np.asarray(contact.points + self.factor * contact.moved(self.solution.displacement))

    @property
    def magnified(self) -> str:
        """That the displacement is drawn larger than it is, in words; empty if it is not."""
        return "" if self.factor == 1.0 else f"displacement times {self.factor:g}"

    @property
    def label(self) -> str:
        """What a legend says of the body."""
        return f"deformed body, {self.magnified}" if self.magnified else "deformed body"

    def states(self) -> Iterator[tuple[Kind, BoolArray, str]]:
        """Each pair of states that there is, which points are in it, (m,), and what a legend says of it."""
        for kind, here in self.solution.states.present.items():
            yield kind, here, f"{state_label(self.solution, kind, here)} ({np.count_nonzero(here)})"

    def colour(self, given: BodyColour | str | None) -> BodyColour:
        """What colours the body: by itself stress in space and where cells are many, else nothing."""
        material = self.problem.origin is not None and not self.problem.origin.kind
        usual = BodyColour.STRESS if material else BodyColour.DISPLACEMENT
        if self.mesh.dim == 2 and (not material or self.mesh.number_of_cells <= MANY_CELLS):
            usual = BodyColour.NONE
        chosen = BodyColour.of(given, usual)
        if chosen is BodyColour.STRESS and not material:
            raise ProblemError("colour = 'stress': the material of this problem is not known; take 'displacement'")
        return chosen

    def values(self, colour: BodyColour) -> Array:
        """The von Mises stress of the cells in the plane (M,), of the vertices in space (N,); or their displacement."""
        if colour is not BodyColour.STRESS:
            return np.asarray(np.linalg.norm(self.solution.displacement[: self.mesh.number_of_nodes], axis=1))
        assert self.problem.origin is not None
        stress = von_mises(self.problem.origin, self.solution.displacement)
        return stress if self.mesh.dim == 2 else nodal_average(self.mesh, stress)


def state_label(solution: Solution, kind: Kind, here: BoolArray) -> str:
    """What a legend says of the points ``here`` (m,), which are all in one pair of states.

    Glue that is pressed is still bonded, as long as none of these points has broken.
    """
    damage = solution.debonding.get("damage")
    if kind.normal is not NormalState.CONTACT or damage is None or not (damage[here] < 1.0).all():
        return kind.label
    free = kind.tangential is TangentialState.FREE
    return "bonded, compressed" if free else f"bonded, compressed, {kind.tangential.label}"


def _visible(problem: DiscreteProblem, mesh: Mesh, displacement: Array) -> float:
    """A factor that makes displacements visible."""
    gap, contact = problem.gap, problem.contact
    size = float(np.ptp(mesh.points, axis=0).max())
    if gap.size and np.ptp(gap) > 1e-6 * size:
        return 1.0  # blown up with the displacement, a gap around a curved body would bend its foundation
    if any(np.abs(gap[contact.on(name)]).max(initial=0.0) > 1e-6 * size for name in contact.pairs):
        return 1.0  # and bodies that touch would be drawn through one another
    moved = np.linalg.norm(displacement[: mesh.number_of_nodes], axis=1)
    largest = float(moved.max(initial=float(np.abs(gap).max(initial=0.0))))
    wanted = 0.1 * size
    return round_number(wanted / largest) if 0.0 < largest < wanted else 1.0


def round_number(value: float) -> float:
    """The largest of 1, 2, 5 times a power of ten that is at most ``value``."""
    power = 10.0 ** math.floor(math.log10(value))
    digit = max(d for d in (1, 2, 5) if d * power <= value * (1 + 1e-12))
    return float(f"{digit * power:.6g}")
