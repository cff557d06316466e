"""The stiffness as contact points see it (rows, blocks, diagonal): one object for every load, gap and law of a body."""

from __future__ import annotations

from abc import ABC, abstractmethod

import numpy as np
import scipy.sparse as sp

from hemivar.basics.first_use import cached_property
from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.linear.products import product
from hemivar.linear.vectors import Vectors
from hemivar.systems.contact_moves import majorant

__all__ = ["ContactStiffness", "embedded"]


class ContactStiffness(ABC):
    """The stiffness matrix K of a body, and what the contact points see of it; arrays are those of this process.

    What is posed on a body holds it by reference, so that each quantity is found once.

    ``vectors``: how the parts of all processes are looked at together; ``unknown, sign (k,)``: the unknown behind each
    active component, and its sign in the local displacement; ``active (m, d)``: components that are free to move.
    """

    def __init__(self, vectors: Vectors, unknown: IntArray, sign: Array, active: BoolArray) -> None:
        self.vectors, self.unknown, self.sign, self.active = vectors, unknown, sign, active

    @abstractmethod
    def multiply(self, x: Array) -> Array:
        """``K x``, (n,)."""

    @abstractmethod
    def pull(self, x: Array) -> Array:
        """``K x`` at the contact unknowns, (k,)."""

    @abstractmethod
    def push(self, values: Array) -> Array:
        """``K x``, (n,), of a vector with these values (k,) at the contact unknowns and zeros elsewhere."""

    @abstractmethod
    def between_contacts(self) -> sp.csr_array:
        """Entries between the contact unknowns of this process, (k, k)."""

    def couple(self, step: Array) -> Array:
        """Elastic force (m, d) that a step (m, d) of the contact points alone takes away."""
        return product(self.own_block, step.ravel()).reshape(step.shape)

    @cached_property
    def own_block(self) -> sp.csr_array:
        """Stiffness between local components of this process, all other unknowns being held, (m d, m d)."""
        return embedded(self.between_contacts(), self.active, self.sign)

    @cached_property
    def stiffness(self) -> Array:
        """Stiffness of each local component when all other unknowns are held, (m, d)."""
        return np.asarray(self.own_block.diagonal().reshape(self.active.shape))

    @cached_property
    def blocks(self) -> Array:
        """Stiffness between the components of each point, (m, d, d)."""
        m, d = self.active.shape
        entries = self.own_block.tocoo()
        own = entries.row // d == entries.col // d
        blocks = np.zeros((m, d, d))
        blocks[entries.row[own] // d, entries.row[own] % d, entries.col[own] % d] = entries.data[own]
        return blocks

    @cached_property
    def diagonal(self) -> Array:
        """The same, positive everywhere, and one number for the tangential components of a point."""
        diagonal = self.stiffness.copy()
        if diagonal.shape[1] > 1:
            diagonal[:, 1:] = diagonal[:, 1:].max(axis=1, keepdims=True)
        return np.where(diagonal > 0.0, diagonal, diagonal.max(initial=1.0))

    @cached_property
    def lambda_max(self) -> float:
        """Largest eigenvalue of the contact block scaled by its diagonal."""
        return majorant(self.vectors, self.active, self.diagonal, self.couple)

    @cached_property
    def _place(self) -> IntArray:
        """Where the active components are among all, (k,): masks are slow to look up."""
        return np.flatnonzero(self.active)

    def spread(self, values: Array) -> Array:
        """Values (k,) of the contact unknowns as (m, d), signs observed."""
        out = np.zeros(self.active.shape)
        out.ravel()[self._place] = self.sign * values
        return out

    def gather(self, values: Array) -> Array:
        """The contrary of :meth:`spread`."""
        return np.asarray(self.sign * values.ravel()[self._place])


def embedded(block: sp.csr_array, active: BoolArray, sign: Array) -> sp.csr_array:
    """A matrix (k, k) between contact unknowns as one between local components, (m d, m d)."""
    free, entries = np.flatnonzero(active.ravel()), block.tocoo()
    data = entries.data * sign[entries.row] * sign[entries.col]
    return sp.csr_array((data, (free[entries.row], free[entries.col])), shape=(active.size, active.size))
