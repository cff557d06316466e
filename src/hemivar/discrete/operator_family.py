"""The matrices of a body in time on one sparsity, and the matrix of a step as a combination of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp

from hemivar.basics.first_use import cached_property
from hemivar.basics.last_used import Recent
from hemivar.basics.portable import PickleMixin
from hemivar.basics.types import Array, IntArray
from hemivar.discrete.bulk import Quadratic
from hemivar.discrete.model import MadeOf, Model
from hemivar.discrete.operators import Multiple, Operator, combined, of_arrays
from hemivar.discrete.potential import Potential, SumEnergy
from hemivar.discrete.problem import DiscreteProblem
from hemivar.discrete.space import Space

__all__ = ["Composition", "OperatorFamily", "Tangent"]


@dataclass(frozen=True, eq=False)
class OperatorFamily(PickleMixin):
    """Stiffness, viscosity, mass and branches of a body, reduced to its unknowns, on the sparsity of the stiffness.

    A viscosity in proportion to the stiffness is a :class:`Multiple`, and zeros are not stored, so that the mass of
    several components is that of one.
    """

    problem: DiscreteProblem  # the elastic body, whose stiffness it is
    stiffness: Operator  # with the bedding that is stated
    viscosity: Operator | None
    mass: Operator | None
    branches: tuple[tuple[float, Operator], ...]  # in the order of :attr:`Material.relaxation_times`
    moved: IntArray  # (k,): nodal components, ``node * d + c``, whose prescribed displacements z may differ from zero

    def combined(self, viscous: float = 0.0, inertia: float = 0.0, branches: Sequence[float] = ()) -> sp.csr_array:
        """``K + viscous C + inertia M + sum_i branches_i K_i`` of the unknowns; they share the sparsity."""
        return self._combined(1.0, viscous, inertia, branches)

    def resistance(self, viscous: float = 0.0, inertia: float = 0.0, branches: Sequence[float] = ()) -> sp.csr_array:
        """:meth:`combined` without the stiffness, on the same sparsity."""
        return self._combined(0.0, viscous, inertia, branches)

    def _combined(self, own: float, viscous: float, inertia: float, branches: Sequence[float]) -> sp.csr_array:
        parts = [(viscous, self.viscosity), (inertia, self.mass)]
        parts += [(share, part) for share, (_, part) in zip(branches, self.branches, strict=True)] if branches else []
        there = [(factor, part) for factor, part in parts if factor and part is not None]
        base = self.stiffness
        if own and not there:
            return base.inner
        own += sum(factor * part.factor for factor, part in there if isinstance(part, Multiple))
        data = own * base.inner.data
        for factor, part in there:
            if not isinstance(part, Multiple):
                part.add_to(data, factor)
        return of_arrays(data, base.inner.indices, base.inner.indptr)

    def pulled(
        self, change: Array, viscous: float = 0.0, inertia: float = 0.0, branches: Sequence[float] = ()
    ) -> Array:
        """Forces (n,) of a change (k,) of the prescribed displacements, by the matrix of :meth:`combined`."""
        parts = [(1.0, self.stiffness), (viscous, self.viscosity), (inertia, self.mass)]
        parts += [(share, part) for share, (_, part) in zip(branches, self.branches, strict=True)] if branches else []
        return np.asarray(sum(factor * (part.coupling @ change) for factor, part in parts if part is not None))

    @cached_property
    def space(self) -> Space:
        """The fields of the body, which no support displaces."""
        space = self.problem.space
        assert space is not None
        return Space(tuple(replace(one, prescribed=np.zeros_like(one.prescribed)) for one in space.fields))

    @cached_property
    def below(self) -> OperatorFamily:
        """That of the linear body by which this one is strongly monotone; itself where this one is linear."""
        bulk = self.problem.bulk
        if not isinstance(bulk, Potential):
            return self

        def apart(part: Operator) -> Operator:  # from the stiffness, which is another one now
            return Operator(part.inner, part.coupling, part.held) if isinstance(part, Multiple) else part

        return replace(
            self,
            stiffness=replace(self.stiffness, inner=bulk.resisting().stiffness),
            viscosity=None if self.viscosity is None else apart(self.viscosity),
            branches=tuple((time, apart(part)) for time, part in self.branches),
        )

    @cached_property
    def known(self) -> Recent[str, object]:
        """What others found out about it: its coarser level, and that of the linear body below it."""
        return Recent(2)


@dataclass(frozen=True, eq=False)
class Composition(MadeOf):
    """What the body of a step in time is made of; on a coarser mesh it is made of the matrices there."""

    family: OperatorFamily
    viscous: float = 0.0
    inertia: float = 0.0
    branches: tuple[float, ...] = ()  # see :meth:`OperatorFamily.combined`
    scale: float = 1.0  # what all of it is multiplied by
    place: Array | None = None  # (nodes, c): nodal values at unknowns zero, of a body that is not linear

    def matrix(self) -> sp.csr_array:
        """The stiffness of a linear body."""
        whole = self.family.combined(self.viscous, self.inertia, self.branches)
        return whole if self.scale == 1.0 else sp.csr_array(self.scale * whole)

    def pulled(self, change: Array) -> Array:
        """Forces (n,) of a change (k,) of the prescribed displacements on the linear body."""
        return self.family.pulled(change, self.viscous, self.inertia, self.branches)

    def bulk(self) -> Quadratic | Potential:
        """The stored energy, with those of viscosity, mass and branches."""
        elastic = self.family.problem.bulk
        if not isinstance(elastic, Potential):
            return Quadratic(self.matrix(), assembled=True)
        family, energy = self.family, elastic.energy
        if self.place is not None:
            energy = energy.from_field(self.place)
        resists = family.resistance(self.viscous, self.inertia, self.branches)
        if self.scale != 1.0:
            whole = family.below.combined(self.viscous, self.inertia, self.branches)
            resists = combined([(1.0, resists), (self.scale - 1.0, whole)])
        return Potential(SumEnergy(energy, resists) if resists.data.any() else energy)

    def model(self, resisted: bool) -> Model:
        """The body with this stiffness, whose supports move nothing."""
        elastic = self.family.problem.model
        return Model(
            self.bulk(), elastic.contact, self.family.space, elastic.origin, resisted or elastic.resisted, self
        )

    def of(self, family: OperatorFamily, shared: IntArray) -> Composition:
        """The same of a body on a coarser mesh, whose nodes are some (shared) of the nodes of this one."""
        field = None if self.place is None else self.place[shared]
        return replace(self, family=family, place=field)


@dataclass(frozen=True, eq=False)
class Tangent(MadeOf):
    """Where a linear body has its stiffness from: a body that is not linear, and the place; on a coarser mesh it is
    made of the body there.
    """

    problem: DiscreteProblem  # of the body that is not linear
    unknowns: Array  # (n,): the place
