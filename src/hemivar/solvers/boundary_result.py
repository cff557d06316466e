"""What happens on one contact boundary of a solution, and at all contact points as a table."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from hemivar.basics.first_use import cached_property
from hemivar.basics.portable import PickleMixin
from hemivar.basics.types import AnyArray, Array, IntArray
from hemivar.discrete.contact import ContactPoints
from hemivar.errors import ProblemError
from hemivar.solvers.contact_states import ContactStates

__all__ = ["BoundaryResult", "ContactValues", "contact_table", "friction_of", "table_columns"]


def friction_of(multiplier: Array) -> Array:
    """Friction of the foundation on the body, (..., c - 1), of multipliers (..., c): minus their tangential part."""
    return np.asarray(0.0 - multiplier[..., 1:])  # subtracted from 0: a minus would write zeros as -0


class ContactValues:
    """What displacements and forces at m contact points with c local components say, of one boundary or of all."""

    contact: ContactPoints
    gap: Array  # (m,): distance between body and foundation along the normal
    penetration: Array  # (m,): u_nu - g at each contact point; positive into the foundation
    # (m, c): penetration (column 0) and slip as contact sees them: the former differs from the one at the node in the
    # middle of edges of quadratic tetrahedra
    local: Array
    # (m, c): force per area of the body on the foundation: pressure (column 0), and minus the friction
    multiplier: Array
    states: ContactStates  # what each point does, along the normal and along the foundation
    # (m,): what glue has lost; empty where no law is one of glue, nan at points of other laws. ``damage`` is the share
    # of the initial stiffness that is lost, ``dissipated`` the energy per area that unloading along the secant would
    # not give back, and ``mode_ratio`` (mixed-mode glue) the share of the slip in the square of the effective opening.
    debonding: Mapping[str, Array] = MappingProxyType({})

    @property
    def normal_state(self) -> IntArray:
        """A :class:`hemivar.solvers.NormalState` for each point, (m,): open, contact, bonded, softening or debonded."""
        return self.states.normal

    @property
    def tangential_state(self) -> IntArray:
        """A :class:`hemivar.solvers.TangentialState` for each point, (m,): free, stick or slip."""
        return self.states.tangential

    @property
    def slip(self) -> Array:
        """u_tau at each contact point in local components, (m, c - 1)."""
        return self.local[:, 1:]

    @property
    def pressure(self) -> Array:
        """-sigma_nu at each contact point, force per area, (m,); positive in compression."""
        return self.multiplier[:, 0]

    @property
    def friction(self) -> Array:
        """sigma_tau, the friction of the foundation on the body, force per area in local components, (m, c - 1).

        Where a point slips it points against the slip.  It is ``-multiplier[:, 1:]``.
        """
        return friction_of(self.multiplier)

    @cached_property
    def slip_vectors(self) -> Array:
        """Slip in the coordinates of the mesh, (m, d)."""
        return self.contact.global_vectors(_tangential(self.local))

    @cached_property
    def friction_vectors(self) -> Array:
        """Friction of the foundation on the body, force per area in the coordinates of the mesh, (m, d)."""
        return 0.0 - self.contact.global_vectors(_tangential(self.multiplier))

    @cached_property
    def tractions(self) -> Array:
        """Pressure and friction on the body together, force per area in the coordinates of the mesh, (m, d)."""
        return 0.0 - self.contact.global_vectors(self.multiplier)

    @cached_property
    def normal_force(self) -> float:
        """Resultant of the pressure, positive in compression."""
        return float(self._resultant(self.pressure)[0])

    @cached_property
    def friction_force(self) -> Array:
        """Resultant of the friction on the body in local components, (c - 1,).

        As a vector it is ``contact.weights @ friction_vectors``.
        """
        return self._resultant(self.friction)

    @cached_property
    def force(self) -> Array:
        """Force of the foundation on the body in the coordinates of the mesh, (d,)."""
        return self._resultant(self.tractions)

    @cached_property
    def contact_length(self) -> float:
        """Measure of the part that is neither open nor debonded (length in 2D, area in 3D)."""
        return float(self._resultant(self.states.closed)[0])

    def _resultant(self, values: AnyArray) -> Array:
        """The integral of values (m,) or (m, k) over the points of all processes."""
        return self.contact.vectors.total(*np.atleast_1d(self.contact.weights @ values).tolist())


@dataclass(frozen=True, eq=False)
class BoundaryResult(ContactValues, PickleMixin):
    """Displacements and forces at the m contact points of one boundary.

    Attributes
    ----------
    name : str
        Of the boundary.
    index : int array (m,)
        Numbers of its contact points among those of the problem.
    contact : ContactPoints
        These points.
    gap : array (m,)
        Distance between body and foundation along the normal.
    penetration : array (m,)
        ``u_nu - g``; positive into the foundation.
    local : array (m, c)
        Penetration (column 0) and slip, as contact sees them.
    multiplier : array (m, c)
        Force per area of the body on the foundation: pressure (column 0), and minus the friction.
    states : ContactStates
        What each point does, along the normal and along the foundation.
    debonding : mapping of name to array (m,)
        As above.
    """

    name: str
    index: IntArray
    contact: ContactPoints
    gap: Array
    penetration: Array
    local: Array
    multiplier: Array
    states: ContactStates
    debonding: Mapping[str, Array] = field(default_factory=dict)

    @property
    def points(self) -> Array | None:
        """Coordinates of the contact points, (m, d)."""
        return self.contact.points

    def __repr__(self) -> str:
        force = f"normal force {self.normal_force:.6g}, contact length {self.contact_length:.6g}"
        return f"BoundaryResult({self.name!r}, {len(self.index)} contact points, {force})"

    @property
    def normals(self) -> Array | None:
        """Unit vectors out of the body, (m, d)."""
        return None if self.contact.frames is None else self.contact.frames[:, 0]

    @property
    def weights(self) -> Array:
        """Length (2D) or area (3D) that belongs to each point, (m,)."""
        return self.contact.weights

    def moment(self, about: Array | tuple[float, ...]) -> Array:
        """Moment of the force about a point (d,): a vector in 3D, in 2D a number (positive turns x towards y)."""
        if self.points is None:
            raise ProblemError("these contact points have no places; give the problem its points")
        arms, forces = self.points - np.asarray(about, dtype=float), self.weights[:, None] * self.tractions
        if arms.shape[1] == 3:
            return np.asarray(np.cross(arms, forces).sum(axis=0))
        return np.asarray(arms[:, 0] @ forces[:, 1] - arms[:, 1] @ forces[:, 0])


def contact_table(seen: ContactValues) -> NDArray[np.void]:
    """One row for each contact point, see :attr:`hemivar.Solution.contact_table`."""
    contact, multiplier, states = seen.contact, seen.multiplier, seen.states
    columns: dict[str, NDArray[np.generic]] = {}
    if contact.names:
        columns["boundary"] = np.array([*contact.names, ""])[contact.boundary]
    if contact.points is not None:
        columns["x"] = contact.points
    if contact.frames is not None:
        columns["normal"] = contact.frames[:, 0]
    columns |= {"weight": contact.weights, "gap": seen.gap}
    forces = np.column_stack([multiplier[:, 0], friction_of(multiplier)])
    moves = np.column_stack([seen.penetration, seen.slip])
    for normal, tangential, values in (("penetration", "slip", moves), ("pressure", "friction", forces)):
        columns[normal] = values[:, 0]
        if contact.components > 1:
            columns[tangential] = values[:, 1] if contact.components == 2 else values[:, 1:]
    columns["normal_state"], columns["tangential_state"] = map(np.array, states.names)
    columns |= seen.debonding
    if contact.frames is not None:
        columns["force"] = 0.0 - contact.weights[:, None] * contact.global_vectors(multiplier)
    table = np.zeros(contact.count, dtype=[(name, value.dtype, value.shape[1:]) for name, value in columns.items()])
    for name, value in columns.items():
        table[name] = value
    table.flags.writeable = False
    return table


def table_columns(table: NDArray[np.void]) -> dict[str, NDArray[np.generic]]:
    """The fields of a :func:`contact_table` as columns of numbers: ``x, y``, ``normal_x``, ..., ``slip_1``, ..."""
    columns: dict[str, NDArray[np.generic]] = {}
    for name in table.dtype.names or ():
        values = table[name]
        if values.ndim == 1:
            columns[name] = values
            continue
        ends = "xyz" if name in ("x", "normal", "force") else "12"
        columns |= {
            end if name == "x" else f"{name}_{end}": values[:, k] for k, end in enumerate(ends[: values.shape[1]])
        }
    return columns


def _tangential(local: Array) -> Array:
    return np.where(np.arange(local.shape[1]) > 0, local, 0.0)
