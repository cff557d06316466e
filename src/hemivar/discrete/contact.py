"""Contact points: where they lie, what they see of the unknowns, and the boundary each belongs to."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
import scipy.sparse as sp

from hemivar.basics.arguments import quoted
from hemivar.basics.arrays import real_array, real_matrix
from hemivar.basics.first_use import cached_property
from hemivar.basics.portable import PickleMixin
from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.errors import ProblemError
from hemivar.linear.vectors import WHOLE, Vectors

__all__ = ["ContactPoints", "components_of", "contact_unknowns", "selects"]


@dataclass(frozen=True, eq=False)
class ContactPoints(PickleMixin):
    """The contact points of a discrete problem, j = 1..m, with c local components each.

    Local component 0 is normal (penetration positive), the others are tangential; a scalar law has the first alone.
    The number c is that of the foundation's answer, not the dimension of the mesh.

    Parameters
    ----------
    trace : sparse array, shape (m * c, n)
        ``B``; row ``j * c + i`` is local component i of contact point j. Rows may be zero where a support fixes them.
    weights : array, shape (m,)
        Quadrature weights ``w_j > 0`` (lengths in 2D, areas in 3D).
    points : array, shape (m, d), or None
        Coordinates.
    frames : array, shape (m, c, d), or None
        ``frames[j, i]`` is the unit vector of local component i; ``frames[j, 0]`` is the outward normal.
    node : int array, shape (m,), optional
        The node of the field that is the contact point; -1 where it is none.
    facet : int array, shape (m,), optional
        The facet of its boundary whose middle it is; -1 where it is none.
    boundary : int array, shape (m,), optional
        Place in ``names`` of the boundary that it belongs to; -1 where it is not known.
    names : tuple of str
        The contact boundaries.
    without_friction : bool array, shape (m,), optional
        Where friction of the law is left out, in one direction at least: at sharp corners of two contact boundaries,
        and where a support fixes a direction oblique to the contact normal.
    components : int, optional
        Number c; what the rows of the trace say by default, and needed where there are no contact points.
    vectors : Vectors, optional
        How the contact points and unknowns of all processes are looked at together, where these are those of one.
    mean : sparse array, shape (m, nodes), optional
        The displacement of a contact point is this mean of those of the nodes of the field; of two bodies, that of the
        side with the contact points less that of the other side.
    pairs : mapping of name to (str, str), optional
        Of a contact of two bodies: the boundary with the contact points, and the one that it touches.

    Raises
    ------
    ProblemError
        Shapes disagree, numbers are not finite, or a weight is not positive.
    """

    trace: sp.csr_array
    weights: Array
    points: Array | None = None
    frames: Array | None = None
    node: IntArray = None  # type: ignore[assignment]
    facet: IntArray = None  # type: ignore[assignment]
    boundary: IntArray = None  # type: ignore[assignment]
    names: tuple[str, ...] = ()
    without_friction: BoolArray = None  # type: ignore[assignment]
    components: int = 0
    vectors: Vectors = WHOLE
    mean: sp.csr_array | None = None
    pairs: Mapping[str, tuple[str, str]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        trace = real_matrix(self.trace, "trace")
        weights = real_array(self.weights, "weights", 1)
        m = weights.shape[0]
        components = components_of(trace.shape[0], weights)
        object.__setattr__(self, "trace", trace)
        object.__setattr__(self, "weights", weights)
        object.__setattr__(self, "components", components or self.components)
        for name, ndim in (("points", 2), ("frames", 3)):
            value = getattr(self, name)
            if value is None:
                continue
            array = real_array(value, name, ndim)
            if array.shape[: ndim - 1] != self.shape[: ndim - 1]:
                expected = f"({m}, d)" if ndim == 2 else f"({m}, {self.components}, d)"
                raise ProblemError(f"{name} has shape {array.shape}; it must be {expected}")
            object.__setattr__(self, name, array)
        for name, unknown in (("node", -1), ("facet", -1), ("boundary", -1), ("without_friction", False)):
            value = getattr(self, name)
            value = np.full(m, unknown) if value is None else np.asarray(value)
            if value.shape != (m,):
                raise ProblemError(f"{name} has shape {value.shape}; it needs one entry per contact point, ({m},)")
            object.__setattr__(self, name, value)
        if m and not (self.boundary.min() >= -1 and self.boundary.max() < len(self.names)):
            raise ProblemError(
                "boundary holds numbers that are not indices into names; give the name of every boundary"
            )

    def __repr__(self) -> str:
        on = f" on {', '.join(self.names)}" if self.names else ""
        return f"ContactPoints({self.count} of {self.components} components{on})"

    @property
    def count(self) -> int:
        """Number of contact points m."""
        return int(self.weights.shape[0])

    @property
    def shape(self) -> tuple[int, int]:
        """Contact points m and local components c: the shape of penetration and slip, of offsets and multipliers."""
        return self.count, self.components

    @property
    def unknowns(self) -> int:
        """Number of unknowns n."""
        return int(self.trace.shape[1])

    def trace_of(self, u: Array) -> Array:
        """``B u`` of unknowns (n,), shape (m, c)."""
        single = self._single
        if single is None:
            return np.asarray(self.trace @ u).reshape(self.shape)
        rows, factor = single
        trace = u.take(rows)
        if factor is not None:
            trace *= factor
        return trace.reshape(self.shape)

    @cached_property
    def _single(self) -> tuple[IntArray, Array | None] | None:
        """The one unknown that each row of the trace sees and its factor, None for 1; None where rows see others."""
        trace = self.trace
        if not (np.diff(trace.indptr) == 1).all():
            return None
        return trace.indices.astype(np.int64), None if (trace.data == 1.0).all() else trace.data

    @cached_property
    def _spread(self) -> sp.csc_array:
        """``B'``, whose arrays are those of the trace."""
        return self.trace.T

    @cached_property
    def sizes(self) -> sp.csr_array:
        """Absolute entries of the trace, by which rounding is estimated."""
        return np.abs(self.trace)

    @cached_property
    def seen(self) -> IntArray:
        """The unknowns (k,) that contact points see."""
        return np.unique(self.trace.indices[self.trace.data != 0.0]).astype(np.int64)

    @cached_property
    def _pressing(self) -> sp.csr_array:
        """``B'`` at the unknowns that contact points see."""
        return sp.csr_array(self.trace[:, self.seen].T)

    def pressed(self, force: Array) -> Array:
        """What forces (m, c) on the contact points are on the unknowns :attr:`seen`, (k,)."""
        single = self._single
        if single is None or single[0].size != self.seen.size:
            return np.asarray(self._pressing @ force.ravel())
        scaled = force.ravel() if single[1] is None else force.ravel() * single[1]
        return scaled.take(self._order)

    @cached_property
    def _order(self) -> IntArray:
        """Which row of the trace sees each of the unknowns that are seen, where each is seen by one."""
        return np.argsort(self.trace.indices)

    def force(self, lam: Array) -> Array:
        """Forces ``B'W lam`` on the unknowns, shape (n,), of a multiplier (m, c)."""
        return np.asarray(self._spread @ (self.weights[:, None] * lam).ravel())

    def take(self, index: IntArray) -> ContactPoints:
        """The contact points of the given numbers, in their order."""
        rows = (np.asarray(index)[:, None] * self.components + np.arange(self.components)).ravel()
        return ContactPoints(
            sp.csr_array(self.trace[rows]),
            self.weights[index],
            None if self.points is None else self.points[index],
            None if self.frames is None else self.frames[index],
            self.node[index],
            self.facet[index],
            self.boundary[index],
            self.names,
            self.without_friction[index],
            self.components,
            self.vectors,
            None if self.mean is None else sp.csr_array(self.mean[index]),
            self.pairs,
        )

    @property
    def places(self) -> tuple[str, ...]:
        """Where contact points lie, in words: ``bottom``, or ``lower:top against upper:bottom``."""
        return tuple(" against ".join(self.pairs.get(name, (name,))) for name in self.names)

    def forces(self, force: Array) -> dict[str, Array]:
        """The force on each boundary (d,), of forces (m, d) on the contact points; that on a body that is touched is
        the opposite."""
        totals: dict[str, Array] = {}
        for name in self.names:
            total, sides = np.asarray(force[self.on(name)].sum(axis=0)), self.pairs.get(name, (name,))
            for side, one in zip(sides, (total, 0.0 - total), strict=False):
                totals[side] = totals.get(side, 0.0) + one
        return totals

    def moved(self, nodal: Array) -> Array:
        """Values (m, ...) at the contact points of those at the nodes of the field; of two bodies on their own side."""
        at = self.node >= 0
        values = np.zeros((self.count, *nodal.shape[1:]))
        values[at] = nodal[self.node[at]]
        if not at.all() and self.mean is not None:
            values[~at] = self.mean[~at] @ nodal
        return values

    def on(self, name: str) -> IntArray:
        """Numbers of the contact points of a boundary.

        Raises
        ------
        ProblemError
            There is no contact boundary of that name.
        """
        if not isinstance(name, str) or name not in self.names:
            known = ", ".join(f"'{known}'" for known in self.names) or "none"
            raise ProblemError(f"there is no contact boundary {quoted(name)} (known: {known})")
        return np.flatnonzero(self.boundary == self.names.index(name))

    def global_vectors(self, local: Array) -> Array:
        """Vectors (m, d) in the coordinates of the mesh of local ones (m, c)."""
        if self.frames is None:
            raise ProblemError(
                "these contact points have no frames, which turn local components into vectors; give frames"
            )
        return np.asarray(np.einsum("mc,mcd->md", local, self.frames))


def components_of(rows: int, weights: Array) -> int:
    """Local components of contact points whose trace has so many rows; 0 if there are no points."""
    m = len(weights)
    if m == 0 and rows != 0:
        raise ProblemError(f"trace has {rows} rows but weights is empty; give one weight per point")
    if m > 0 and (rows == 0 or rows % m != 0 or rows // m > 3):
        raise ProblemError(
            f"trace has {rows} rows for {m} contact points (as many as weights); "
            f"it needs 1, 2 or 3 rows per point: one normal, the others tangential"
        )
    if not np.all(weights > 0):
        bad = int(np.flatnonzero(weights <= 0)[0])
        raise ProblemError(f"weights[{bad}] = {weights[bad]:g}; every weight must be positive")
    return rows // m if m else 0


def selects(trace: sp.csr_array) -> bool:
    """Whether every row of a trace is one unknown or its opposite, no unknown in two rows."""
    if (np.diff(trace.indptr) > 1).any() or np.bincount(trace.indices).max(initial=0) > 1:
        return False
    return bool(np.allclose(np.abs(trace.data), 1.0, rtol=1e-12, atol=0.0))


def contact_unknowns(contact: ContactPoints) -> tuple[IntArray, Array, BoolArray, IntArray]:
    """The unknown and the sign of each active component (k,), which are active (m, d), and the points of those (k,)."""
    active = (np.diff(contact.trace.indptr) > 0).reshape(contact.count, contact.components)
    point = np.repeat(np.arange(contact.count), active.sum(axis=1))
    return contact.trace.indices.astype(np.int64), np.sign(contact.trace.data), active, point
