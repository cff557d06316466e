"""The stored energy of a body that is not linear, shifted so that it and its derivative are zero at u = 0."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
import scipy.sparse as sp

from hemivar.basics.arrays import norm
from hemivar.basics.first_use import cached_property
from hemivar.basics.last_used import Recent
from hemivar.basics.portable import PickleMixin
from hemivar.basics.types import Array
from hemivar.discrete.bulk import Quadratic, Sized
from hemivar.discrete.operators import combined
from hemivar.errors import ProblemError
from hemivar.linear.products import diagonal

__all__ = ["BodyEnergy", "Potential", "Softened", "SumEnergy"]


class Softened(ProblemError):  # noqa: N818 - a state of the body, which methods go around
    """A body that is not linear has no positive stiffness at some displacement."""


class BodyEnergy(Protocol):
    """Stored energy of a body by its unknowns, prescribed displacements included."""

    @property
    def unknowns(self) -> int:
        """Number of unknowns n."""

    @property
    def origin(self) -> Array:
        """What is displaced at unknowns zero, in their directions (n,)."""

    def value(self, u: Array) -> float:
        """The energy at the unknowns u (n,)."""

    def gradient(self, u: Array) -> Array:
        """Its derivative (n,)."""

    def hessian(self, u: Array) -> sp.csr_array:
        """Its second derivative (n, n), symmetric, on one sparsity for all u."""

    def lower(self) -> sp.csr_array | None:
        """A matrix (n, n) below every second derivative and positive where they are; None if none is known."""

    def upper(self) -> sp.csr_array:
        """A matrix (n, n) above every second derivative."""

    def from_field(self, values: Array) -> BodyEnergy:
        """The same energy by the change of the unknowns from nodal values (nodes, c) on."""

    def field_value(self, values: Array) -> float:
        """The energy of nodal values (nodes, c)."""

    def field_forces(self, values: Array) -> Array:
        """Internal forces (nodes, c) of nodal values (nodes, c)."""


@dataclass(frozen=True, eq=False)
class SumEnergy(PickleMixin):
    """A stored energy and a quadratic one, such as those of viscosity and mass in a step in time: ``W(u) + u'Qu/2``."""

    energy: BodyEnergy  # W
    quadratic: sp.csr_array  # (n, n)

    @property
    def unknowns(self) -> int:
        """Number of unknowns n."""
        return self.energy.unknowns

    @property
    def origin(self) -> Array:
        """What is displaced at unknowns zero, in their directions (n,)."""
        return self.energy.origin

    def value(self, u: Array) -> float:
        """The energy at the unknowns u (n,)."""
        return self.energy.value(u) + 0.5 * float(u @ (self.quadratic @ u))

    def gradient(self, u: Array) -> Array:
        """Its derivative (n,)."""
        return np.asarray(self.energy.gradient(u) + self.quadratic @ u)

    def hessian(self, u: Array) -> sp.csr_array:
        """Its second derivative (n, n)."""
        return self._added(self.energy.hessian(u))

    def lower(self) -> sp.csr_array | None:
        """A matrix (n, n) below every second derivative; None if none is known."""
        lower = self.energy.lower()
        return None if lower is None else self._added(lower)

    def upper(self) -> sp.csr_array:
        """A matrix (n, n) above every second derivative."""
        return self._added(self.energy.upper())

    def from_field(self, values: Array) -> SumEnergy:
        """The same energy by the change of the unknowns from nodal values (nodes, c) on."""
        return SumEnergy(self.energy.from_field(values), self.quadratic)

    def field_value(self, values: Array) -> float:
        """Of nodal values the stored energy alone."""
        return self.energy.field_value(values)

    def field_forces(self, values: Array) -> Array:
        """Of nodal values the internal forces alone."""
        return self.energy.field_forces(values)

    def _added(self, matrix: sp.csr_array) -> sp.csr_array:
        return combined([(1.0, matrix), (1.0, self.quadratic)])


@dataclass(frozen=True, eq=False)
class Potential(PickleMixin, Sized):
    """Stored energy of a body that is not linear, a :class:`Bulk`: ``W(u) - W(0) - W'(0) u``.

    What is taken away, which prescribed displacements leave, belongs to load and constant of the loading, as for a
    linear body.

    Parameters
    ----------
    energy : BodyEnergy
        W.
    """

    energy: BodyEnergy

    def __repr__(self) -> str:
        return f"Potential({self.unknowns} unknowns)"

    @property
    def unknowns(self) -> int:
        """Number of unknowns n."""
        return self.energy.unknowns

    @cached_property
    def initial_value(self) -> float:
        """``W(0)``, the energy of the prescribed displacements alone."""
        return self.energy.value(np.zeros(self.unknowns))

    @cached_property
    def initial_forces(self) -> Array:
        """``W'(0)``, (n,): internal forces at unknowns zero."""
        return self.energy.gradient(np.zeros(self.unknowns))

    @cached_property
    def initial_sizes(self) -> Array:
        """Sizes of what is added up in ``W'(0)``, (n,), by the stiffness at rest of the stored energy alone."""
        energy, own = self.energy, self.at_rest.stiffness
        if isinstance(energy, SumEnergy):
            own = combined([(1.0, own), (-1.0, energy.quadratic)])
        return np.asarray(np.abs(self.initial_forces) + abs(own) @ np.abs(energy.origin))

    def value(self, u: Array) -> float:
        """``W(u) - W(0) - W'(0) u``."""
        return self.energy.value(u) - self.initial_value - float(self.initial_forces @ u)

    def gradient(self, u: Array) -> Array:
        """``W'(u) - W'(0)``, shape (n,)."""
        return np.asarray(self.energy.gradient(u) - self.initial_forces)

    def hessian(self, u: Array) -> sp.csr_array:
        """``W''(u)``, (n, n)."""
        return self.energy.hessian(u)

    def tangent(self, u: Array) -> Quadratic:
        """The linear body with the stiffness ``W''(u)``.

        Raises
        ------
        Softened
            It has a diagonal entry that is not positive.
        """
        return self._initial if not u.any() else _stiff(self.hessian(u))

    @cached_property
    def _initial(self) -> Quadratic:
        return _stiff(self.hessian(np.zeros(self.unknowns)))

    @cached_property
    def at_rest(self) -> Quadratic:
        """The linear body with the stiffness at u = 0, by which sizes are compared; that above where it is negative."""
        try:
            return self._initial
        except Softened:
            return self.upper

    @cached_property
    def lower(self) -> Quadratic | None:
        """A linear body below, by which this one is strongly monotone; None if no bound is known."""
        lower = self.energy.lower()
        return None if lower is None else Quadratic(lower, assembled=True)

    @cached_property
    def upper(self) -> Quadratic:
        """A linear body above: no second derivative exceeds its stiffness."""
        return Quadratic(self.energy.upper(), assembled=True)

    def resisting(self) -> Quadratic:
        """By which sizes of motions are measured: the linear body below, or that at rest where none is known."""
        return self.at_rest if self.lower is None else self.lower

    @cached_property
    def known(self) -> Recent[str, object]:
        """What others found out about it: its coarser level."""
        return Recent(1)

    @property
    def diagonal(self) -> Array:
        """Diagonal of the stiffness at u = 0, shape (n,)."""
        return self.at_rest.diagonal

    @property
    def row_sums(self) -> Array:
        """Sums of the absolute entries of the rows of the stiffness at u = 0, shape (n,)."""
        return self.at_rest.row_sums

    def rounding_scale(self, u: Array, load: Array) -> float:
        """Norm of the sizes of what is added up in ``f - W'(u)``, entry by entry, by the stiffness at u = 0."""
        return norm(self.row_sums * np.abs(u) + np.abs(load) + self.initial_sizes)


def _stiff(stiffness: sp.csr_array) -> Quadratic:
    """The linear body of a second derivative."""
    if not (diagonal(stiffness) > 0.0).all():
        raise Softened(
            "the stored energy is not convex at this displacement: its strains soften the material; take smaller loads "
            "or displacements, or a material that is stiffer there"
        )
    return Quadratic(stiffness, assembled=True)
