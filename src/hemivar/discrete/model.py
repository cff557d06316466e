"""What stays of a discrete problem whatever load, gap and law: the body, where it may touch, its statement."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np
import scipy.sparse as sp

from hemivar.basics.arguments import expect
from hemivar.basics.arrays import SAME
from hemivar.basics.first_use import cached_property
from hemivar.basics.portable import PickleMixin
from hemivar.discrete.bulk import Bulk, Quadratic
from hemivar.discrete.contact import ContactPoints
from hemivar.discrete.potential import Potential
from hemivar.discrete.rigid_modes import RigidModes, joined, no_motions
from hemivar.discrete.rigid_part import RigidPart
from hemivar.discrete.space import Field, Space
from hemivar.errors import ProblemError

if TYPE_CHECKING:
    from hemivar.mechanics.statement import ContactProblem

__all__ = ["MadeOf", "Model", "quadratic"]

_ARRAYS = "DiscreteProblem.of_arrays(stiffness, load, trace, weights, gap, law) takes plain arrays"


class MadeOf(PickleMixin):
    """What a stiffness is made of beside its statement: a composition in time, a tangent, or the stress of a load."""

    #: Whether no motion makes its energy fall; else contact may have to resist some.
    semidefinite: ClassVar[bool] = True


@dataclass(frozen=True, eq=False)
class Model(PickleMixin):
    """The part of a discrete problem that factors, levels and constants belong to.

    Its identity is what a :class:`hemivar.systems.Workspace` knows it by: problems that share a model share what has
    been paid for it.

    Parameters
    ----------
    bulk : Bulk
        Stored energy of the body; :class:`Quadratic` where it is linear.
    contact : ContactPoints
        The contact points.
    space : Space or None
        The fields that the unknowns describe.
    origin : ContactProblem or None
        What was discretised; the same on a coarser mesh serves multigrid.
    resisted : bool
        Whether an elastic bedding of the body, or its inertia in a step in time, resists every motion.
    parts : MadeOf, optional
        What the stiffness of a step in time, or of a linear body in the place of another one, is made of; the same on a
        coarser mesh serves multigrid.

    Raises
    ------
    ProblemError
        Bulk, contact points and space do not fit one another.
    """

    bulk: Bulk
    contact: ContactPoints
    space: Space | None = None
    origin: ContactProblem | None = None
    resisted: bool = False
    parts: MadeOf | None = None

    def __post_init__(self) -> None:
        if not isinstance(self.bulk, Quadratic | Potential):  # Python 3.11 computes each property of a protocol
            expect(self.bulk, Bulk, "the bulk of a discrete problem", _ARRAYS)
        expect(self.contact, ContactPoints, "the contact of a discrete problem", _ARRAYS)
        n = self.bulk.unknowns
        if self.contact.unknowns != n:
            raise ProblemError(f"trace has {self.contact.unknowns} columns; it needs one per unknown, {n}")
        if self.space is not None and self.space.unknowns != n:
            raise ProblemError(f"space has {self.space.unknowns} unknowns but the bulk has {n}; they must agree")

    @property
    def unknowns(self) -> int:
        """Number of unknowns n."""
        return self.bulk.unknowns

    @property
    def field(self) -> Field | None:
        """The first field of the space, the displacement of the body; None for a model made of arrays."""
        return None if self.space is None else self.space.fields[0]

    @cached_property
    def free_motions(self) -> RigidModes:
        """The motions without energy, of a model whose field knows its motions, by groups of parts that touch."""
        field = self.field
        assert field is not None
        if self.resisted:
            return no_motions(field.mesh, field.prescribed.size)
        motions = field.free_motions
        return motions if len(motions.groups) < 2 else joined(motions, sp.csr_array(self.contact.trace @ field.lift))

    @cached_property
    def free_unknowns(self) -> sp.csr_array | None:
        """Unknowns (n, a) of the motions without deformation, the kernel of K; None where K is not that of a mesh.

        They follow from mesh and supports of a displacement.  A stiffness that resists them is not the one of the mesh
        (springs may have been added), and nothing is known.
        """
        field, bulk = self.field, self.bulk.at_rest if isinstance(self.bulk, Potential) else self.bulk
        known = field is not None and field.kernel_known and self.contact.vectors.alone
        if field is None or not known or not isinstance(bulk, Quadratic):
            return None
        unknowns = sp.csr_array(field.lift @ self.free_motions.motions)
        force = abs(bulk.stiffness @ unknowns).tocsr()
        force.data /= np.repeat(bulk.diagonal, np.diff(force.indptr))
        return unknowns if float(force.data.max(initial=0.0)) <= SAME else None

    @cached_property
    def rigid_part(self) -> RigidPart:
        """The projection of unknowns onto :attr:`free_unknowns`; onto nothing where they are not known."""
        motions = self.free_unknowns
        if motions is None:
            return RigidPart.none(self.unknowns)
        return RigidPart.of(motions, [group.columns for group in self.free_motions.groups])

    @property
    def linear(self) -> Quadratic:
        """The bulk of a linear body.

        Raises
        ------
        ProblemError
            The bulk is not quadratic.
        """
        return quadratic(self.bulk)


def quadratic(bulk: Bulk, what: str = "this") -> Quadratic:
    """The bulk, if it is quadratic."""
    if isinstance(bulk, Potential):
        raise ProblemError(
            f"{what} needs a linear body, and the material of this one is not linear; give a linear one, such as "
            "Material.lame(...)"
        )
    if not isinstance(bulk, Quadratic):
        raise ProblemError(f"{what} needs a linear body; the bulk is a {type(bulk).__name__}: give a Quadratic")
    return bulk
