"""The matrices of a body in time on one sparsity, and the matrix of a step as a combination of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sp

from hemivar.basics.first_use import cached_property
from hemivar.basics.portable import PickleMixin
from hemivar.basics.recent import Recent
from hemivar.basics.types import IntArray
from hemivar.discrete.bulk import Quadratic
from hemivar.discrete.model import Model
from hemivar.discrete.operators import Multiple, Operator, of_arrays
from hemivar.discrete.space import Space

if TYPE_CHECKING:
    from hemivar.discrete.problem import DiscreteProblem

__all__ = ["Composition", "OperatorFamily"]


@dataclass(frozen=True, eq=False)
class OperatorFamily(PickleMixin):
    """Stiffness, viscosity, mass and branches of a body, reduced to its unknowns, on the sparsity of the stiffness.

    A viscosity in proportion to the stiffness is a :class:`Multiple`, and zeros are not stored, so that the mass of
    several components is that of one.

    Attributes
    ----------
    problem : DiscreteProblem
        The elastic body, whose stiffness it is.
    stiffness : Operator
        With the bedding that is stated.
    viscosity, mass : Operator or None
    branches : tuple of (relaxation time, Operator)
        In the order of :attr:`Material.relaxation_times`.
    moved : int array, shape (k,)
        Nodal components, ``node * d + c``, whose prescribed displacements z may differ from zero.
    """

    problem: DiscreteProblem
    stiffness: Operator
    viscosity: Operator | None
    mass: Operator | None
    branches: tuple[tuple[float, Operator], ...]
    moved: IntArray

    def combined(self, viscous: float = 0.0, inertia: float = 0.0, branches: Sequence[float] = ()) -> sp.csr_array:
        """``K + viscous C + inertia M + sum_i branches_i K_i`` of the unknowns; they share the sparsity.

        Parameters
        ----------
        viscous, inertia : float
        branches : sequence of float
            One for each branch; none leaves them out.
        """
        parts = [(viscous, self.viscosity), (inertia, self.mass)]
        parts += [(share, part) for share, (_, part) in zip(branches, self.branches, strict=True)] if branches else []
        there = [(factor, part) for factor, part in parts if factor and part is not None]
        base = self.stiffness
        own = 1.0 + sum(factor * part.factor for factor, part in there if isinstance(part, Multiple))
        if not there:
            return base.inner
        data = own * base.inner.data
        for factor, part in there:
            if not isinstance(part, Multiple):
                part.add_to(data, factor)
        return of_arrays(data, base.inner.indices, base.inner.indptr)

    @cached_property
    def space(self) -> Space:
        """The fields of the body, which no support displaces."""
        space = self.problem.space
        assert space is not None
        return Space(tuple(replace(one, prescribed=np.zeros_like(one.prescribed)) for one in space.fields))

    @cached_property
    def known(self) -> Recent[str, object]:
        """What others found out about it: its coarser level."""
        return Recent(1)


@dataclass(frozen=True, eq=False)
class Composition(PickleMixin):
    """What a stiffness matrix is made of; on a coarser mesh it is made of the matrices there.

    Attributes
    ----------
    family : OperatorFamily
    viscous, inertia : float
    branches : tuple of float
        See :meth:`OperatorFamily.combined`.
    scale : float
        What all of it is multiplied by.
    """

    family: OperatorFamily
    viscous: float = 0.0
    inertia: float = 0.0
    branches: tuple[float, ...] = ()
    scale: float = 1.0

    def matrix(self) -> sp.csr_array:
        """The stiffness."""
        whole = self.family.combined(self.viscous, self.inertia, self.branches)
        return whole if self.scale == 1.0 else sp.csr_array(self.scale * whole)

    def model(self, resisted: bool) -> Model:
        """The body with this stiffness, whose supports move nothing.

        Parameters
        ----------
        resisted : bool
            Whether it resists every motion, beside what the elastic body does.
        """
        elastic = self.family.problem.model
        bulk = Quadratic(self.matrix(), assembled=True)
        return Model(bulk, elastic.contact, self.family.space, elastic.origin, resisted or elastic.resisted, self)

    def of(self, family: OperatorFamily) -> Composition:
        """The same of other matrices."""
        return replace(self, family=family)
