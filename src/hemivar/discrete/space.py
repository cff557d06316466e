"""Fields over meshes, and how the unknowns of a discrete problem become them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from hemivar.basics.arguments import expect, whole_number
from hemivar.basics.arrays import real_array, real_matrix
from hemivar.basics.first_use import cached_property
from hemivar.basics.portable import PickleMixin
from hemivar.basics.types import Array, IntArray
from hemivar.discrete.constants import free_constants
from hemivar.discrete.rigid_modes import RigidModes, free_motions, linked_motions
from hemivar.errors import ProblemError
from hemivar.mesh.mesh import Mesh

__all__ = ["Field", "Followers", "Space"]


@dataclass(frozen=True, eq=False)
class Followers(PickleMixin):
    """Nodal values that follow others: those U with ``J U = b``, where ``J A = 1``."""

    rows: sp.csr_array  # (k, nodes * components): J
    move: sp.csr_array  # (nodes * components, k): A
    node: IntArray  # (k,): the nodes of what follows
    plates: int  # how many of the first ones follow rigid plates

    def folded(self, forces: Array) -> Array:
        """Forces on nodal values (nodes * components,), those on what is tied handed on to what it follows."""
        amounts = self.move.T @ forces
        amounts[: self.plates] = 0.0
        return np.asarray(forces - self.rows.T @ amounts)


@dataclass(frozen=True, eq=False)
class Field(PickleMixin):
    """A field over a mesh, made of the unknowns u of a discrete problem: ``U = P u + u0``.

    Entry ``node * components + c`` of ``U`` belongs to one node and one component. Nodes of a quadratic field
    (``order == 2``) are the vertices of the mesh followed by its edge midpoints, in the order of :attr:`Mesh.edges`.
    The number of components is that of the field, not of the space: a displacement in space has 3, the deflection of
    a membrane or a temperature 1.

    Parameters
    ----------
    mesh : Mesh
        The mesh the field lives on.
    order : int
        Polynomial degree of the elements, 1 or 2.
    basis : sparse array, shape (nodes * components, n)
        ``P``.
    prescribed : array, shape (nodes * components,)
        ``u0``: what supports prescribe, of a body that is not linear carried on into the body.
    components : int, optional
        Components at each node; by default what the size of ``prescribed`` says.
    name : str
        What the field is.
    lift : sparse array, shape (n, nodes * components), optional
        A left inverse of the basis, ``lift P = 1``; ``P'`` by default, for which the columns of P must be orthonormal.
    constants : bool
        The energy is one of the gradient of one component: its free motions are the constants.
    rigid : bool
        The energy of a displacement vanishes along rigid motions and no others. False where that is not known, as of a
        stiffness that comes from elsewhere.
    partial : bool
        The unknowns say more than the field, such as the slopes of a plate: values give no unknowns back.
    ring : bool
        A displacement of a body of revolution about the second axis, which alone it can follow without strain.
    resisted : int array (k,) and array (k, d, d), optional
        Nodes at springs, and matrices that are not negative and zero for displacements without force of a spring.
    followers : Followers, optional
        What follows other nodal values.

    Raises
    ------
    ProblemError
        Shapes disagree, or ``lift P`` is not the identity.
    """

    mesh: Mesh
    order: int
    basis: sp.csr_array
    prescribed: Array
    components: int = 0
    name: str = "displacement"
    lift: sp.csr_array = None
    constants: bool = False
    rigid: bool = True
    ring: bool = False
    partial: bool = False
    resisted: tuple[IntArray, Array] | None = None
    followers: Followers | None = None

    def __post_init__(self) -> None:
        expect(self.mesh, Mesh, "the mesh of a field", "hemivar.rectangle, hemivar.box and read_mesh make one")
        basis = real_matrix(self.basis, "the basis of the field")
        prescribed = real_array(self.prescribed, "the prescribed values of the field", 1)
        if basis.shape[0] != prescribed.size:
            raise ProblemError(
                f"the basis of the field has {basis.shape[0]} rows; it needs one for each of the "
                f"{prescribed.size} prescribed values"
            )
        nodes = len(self.mesh.points) + (len(self.mesh.edges) if self.order == 2 else 0)
        components = whole_number(self.components, "components of a field", 0) or prescribed.size // nodes
        if components * nodes != prescribed.size:
            raise ProblemError(
                f"the field has {prescribed.size} prescribed values; with {components} component"
                f"{'s' if components > 1 else ''} at each of the {nodes} nodes of order {self.order} it needs "
                f"{components * nodes}"
            )
        lift = basis.T if self.lift is None else real_matrix(self.lift, "the lift of the field")
        if lift.shape != basis.shape[::-1]:
            raise ProblemError(f"the lift of the field has shape {lift.shape}; it must be {basis.shape[::-1]}")
        probe = np.cos(np.arange(basis.shape[1]) ** 1.1)
        if not self.partial and np.abs(lift @ (basis @ probe) - probe).max(initial=0.0) > 1e-9:
            raise ProblemError(
                "lift @ basis is not the identity"
                + (": the columns of the basis are not orthonormal; give a lift" if self.lift is None else "")
            )
        for name, value in (("basis", basis), ("prescribed", prescribed), ("components", components), ("lift", lift)):
            object.__setattr__(self, name, value)

    def __repr__(self) -> str:
        return f"Field({self.name!r}, order {self.order}, {self.number_of_nodes} nodes of {self.components} components)"

    @property
    def moves(self) -> bool:
        """Whether it is a displacement, with a component for each axis of the mesh, so that rigid motions are known."""
        return self.components == self.mesh.dim

    @property
    def kernel_known(self) -> bool:
        """Whether :attr:`free_motions` are known: those of a displacement, or the constants of a gradient's energy."""
        return (self.moves and self.rigid) or self.constants

    @property
    def number_of_nodes(self) -> int:
        """Number of nodes of the field (vertices, and edge midpoints if ``order == 2``)."""
        return len(self.prescribed) // self.components

    @property
    def nodes(self) -> Array:
        """Coordinates of the nodes, shape (nodes, dimension of the mesh)."""
        return self.mesh.nodes(self.order)

    @property
    def origin(self) -> Array:
        """``lift u0``, (n,): what is displaced at unknowns zero in the directions of the unknowns, of a linear body
        nothing."""
        return np.asarray(self.lift @ self.prescribed)

    @cached_property
    def own(self) -> sp.csc_array:
        """The entries of the basis at the nodes of the unknowns themselves, shape (nodes * components, n).

        Where unknowns are jumps between bodies, the nodes of one body follow those of another one besides.
        """
        back = sp.csc_array(self.lift.T)
        there = sp.csc_array((np.ones(back.nnz), back.indices, back.indptr), shape=back.shape)
        return sp.csc_array(self.basis.tocsc() * there)

    @cached_property
    def free_motions(self) -> RigidModes:
        """The motions without strain, or without gradient, that supports leave to a displacement or one component."""
        if self.constants:
            return free_constants(self.mesh, self.basis)
        if self.followers is not None:
            return linked_motions(self.mesh, self.order, self.basis, self.lift, self.ring, self.resisted)
        return free_motions(self.mesh, self.order, self.basis, self.lift, self.own, self.ring, self.resisted)

    def full(self, unknowns: Array) -> Array:
        """Nodal values ``P u + u0`` of a vector of unknowns.

        Parameters
        ----------
        unknowns : array, shape (n,)

        Returns
        -------
        array, shape (nodes, components)
        """
        vector = real_array(unknowns, "the unknowns", finite=False)
        if vector.shape != (self.basis.shape[1],):
            raise ProblemError(f"the unknowns have shape {vector.shape}; they must have ({self.basis.shape[1]},)")
        return np.asarray(self.basis @ vector + self.prescribed).reshape(-1, self.components)

    def restrict(self, values: Array) -> Array:
        """Unknowns of nodal values: ``lift (U - u0)``.

        The result reproduces the values if they fulfil the supports, and is a projection otherwise (orthogonal if the
        columns of the basis are orthonormal).

        Parameters
        ----------
        values : array, shape (nodes, components)

        Returns
        -------
        array, shape (n,)
        """
        if self.partial:
            raise ProblemError(f"the {self.name} does not say all unknowns; give the unknowns themselves")
        field = real_array(values, f"the {self.name}", finite=False)
        if field.shape != (self.number_of_nodes, self.components):
            raise ProblemError(
                f"the {self.name} has shape {field.shape}; it must be ({self.number_of_nodes}, {self.components})"
            )
        return np.asarray(self.lift @ (field.ravel() - self.prescribed))


@dataclass(frozen=True, eq=False)
class Space(PickleMixin):
    """The fields that the unknowns of a discrete problem describe, each over its own mesh.

    Parameters
    ----------
    fields : tuple of Field
        Of the same number of unknowns, with different names.
    """

    fields: tuple[Field, ...]

    def __post_init__(self) -> None:
        fields = tuple(
            expect(field, Field, "a field of a space", "give hemivar.discrete.Field") for field in self.fields
        )
        if not fields:
            raise ProblemError("a space has no fields; give at least one")
        if len({field.basis.shape[1] for field in fields}) > 1:
            raise ProblemError("the bases of the fields of a space differ in columns; give each one for all unknowns")
        if len({field.name for field in fields}) < len(fields):
            raise ProblemError("two fields of a space have the same name; name them apart")
        object.__setattr__(self, "fields", fields)

    @property
    def unknowns(self) -> int:
        """Number of unknowns n."""
        return int(self.fields[0].basis.shape[1])

    def __getitem__(self, name: str) -> Field:
        for field in self.fields:
            if field.name == name:
                return field
        raise ProblemError(f"there is no field '{name}' (known: {', '.join(field.name for field in self.fields)})")
