"""Rigid obstacles: planes, spheres, cylinders and signed distances, and the gap between them and a body.

An obstacle fills the points where its signed distance ``d`` is negative. To first order in the displacement u the body
stays outside if ``d(x) + grad d . u >= 0``: a contact point with the normal ``nu = -grad d`` and the gap ``d(x)``.
Where the normal ``nu`` is that of the body, the gap is the distance from x to the obstacle along ``nu``.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from typing import ClassVar

import numpy as np

from hemivar.basics.arguments import quoted
from hemivar.basics.arrays import LARGEST, ROUNDED
from hemivar.basics.portable import PickleMixin
from hemivar.basics.stated import CheckedFields, Form, kept, stated
from hemivar.basics.types import Array, BoolArray
from hemivar.errors import ProblemError
from hemivar.mechanics.conditions import DataField, check_finite
from hemivar.mesh.boundary_rule import boundary_rule
from hemivar.mesh.mesh import Mesh

__all__ = ["Cylinder", "Normals", "Obstacle", "Plane", "SignedDistance", "Sphere"]


class Normals(StrEnum):
    """Whose normal is the contact normal where a body meets an obstacle."""

    OBSTACLE = "obstacle"
    """The obstacle's: the gap is the shortest distance, and every contact point has one."""
    BODY = "body"
    """The body's: the gap is measured along its outward normal; where that misses the obstacle there is no contact."""


def _vector(value: object, name: str) -> Array:
    """A vector of the obstacle's own, which does not change with the array it came from."""
    array = check_finite(value, name, LARGEST).copy()
    if array.ndim != 1 or len(array) not in (2, 3):
        raise ProblemError(f"{name} has shape {array.shape}; give 2 or 3 numbers")
    array.setflags(write=False)
    return array


def _radius(value: object, name: str) -> float:
    array = check_finite(value, f"{name}: radius")
    if array.ndim != 0 or not array > 0.0:
        raise ProblemError(f"{name}: radius is {quoted(value)}; give one positive number")
    if not 1.0 / LARGEST < array < LARGEST:
        raise ProblemError(
            f"{name}: radius is {quoted(value)}, beyond the range of numbers; take another unit of length"
        )
    return float(array)


class Obstacle(CheckedFields, PickleMixin, ABC):
    """A rigid obstacle, given by its signed distance: positive outside, zero on the surface, negative inside."""

    @property
    @abstractmethod
    def dim(self) -> int | None:
        """Space dimension, 2 or 3; None if it serves for both."""

    @abstractmethod
    def distance(self, points: Array) -> Array:
        """Signed distance of points (k, d), shape (k,), in units of length."""

    @abstractmethod
    def normals(self, points: Array) -> Array:
        """Gradient of the distance at points (k, d): unit vectors (k, d) out of the obstacle."""

    @abstractmethod
    def along(self, points: Array, directions: Array) -> Array:
        """Distance from points (k, d) along unit vectors (k, d) to where they enter the obstacle, shape (k,).

        For points inside the obstacle it is negative: minus the way back to the surface. Where the line never enters
        the obstacle ahead of the point it is inf.
        """


@dataclass(frozen=True, eq=False)
class Plane(Obstacle):
    """The half space behind a plane (a half plane behind a line in 2D).

    Parameters
    ----------
    point : vector, shape (d,)
        A point of the plane.
    normal : vector, shape (d,)
        Out of the obstacle, towards the body; of any length.

    Examples
    --------
    >>> import hemivar as hv
    >>> slope = hv.Plane(point=(0.0, 0.0), normal=(0.1, 1.0))
    >>> slope.distance([[0.0, 1.0]]).round(3)
    array([0.995])
    """

    point: Sequence[float] | Array = field(metadata=stated(Form.POINT) | kept(_vector, shown="Plane: {}"))
    normal: Sequence[float] | Array = field(metadata=stated(Form.POINT))

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "normal", _direction(self.normal, len(self.point), "Plane: normal"))

    @property
    def dim(self) -> int:
        return len(self.point)

    def distance(self, points: Array) -> Array:
        return np.asarray((points - self.point) @ np.asarray(self.normal))

    def normals(self, points: Array) -> Array:
        return np.broadcast_to(np.asarray(self.normal), points.shape)

    def along(self, points: Array, directions: Array) -> Array:
        approach = -(directions @ np.asarray(self.normal))
        meets = approach > ROUNDED
        return np.where(meets, self.distance(points) / np.where(meets, approach, 1.0), np.inf)


@dataclass(frozen=True, eq=False)
class Sphere(Obstacle):
    """A sphere; a circle, that is a cylinder across the plane, in 2D.

    Parameters
    ----------
    center : vector, shape (d,)
    radius : float
        Units of length.
    inside : bool
        The body lies inside: everything beyond the sphere is the obstacle.

    Examples
    --------
    >>> import hemivar as hv
    >>> hv.mechanics.Sphere((0.0, -5.0), 5.0).distance([[0.0, 0.1]]).round(3)
    array([0.1])
    """

    center: Sequence[float] | Array = field(metadata=stated(Form.POINT) | kept(_vector, shown="Sphere: {}"))
    radius: float = field(metadata=stated(Form.NUMBER, above=0.0) | kept(_radius, shown="Sphere"))
    inside: bool = field(default=False, metadata=stated(Form.FLAG))

    @property
    def dim(self) -> int:
        return len(self.center)

    def distance(self, points: Array) -> Array:
        return _round_distance(points - self.center, self.radius, self.inside)

    def normals(self, points: Array) -> Array:
        return _round_normal(points - self.center, points, self.radius, self.inside, "centre of the sphere")

    def along(self, points: Array, directions: Array) -> Array:
        return _round_along(points - self.center, directions, self.radius, self.inside)


@dataclass(frozen=True, eq=False)
class Cylinder(Obstacle):
    """An infinitely long circular cylinder in space; in 2D a cylinder across the plane is a :class:`Sphere`.

    Parameters
    ----------
    point : vector, shape (3,)
        A point of the axis.
    axis : vector, shape (3,)
        Direction of the axis, of any length.
    radius : float
        Units of length.
    inside : bool
        The body lies inside: everything beyond the cylinder is the obstacle.
    """

    point: Sequence[float] | Array = field(metadata=stated(Form.POINT) | kept(_vector, shown="Cylinder: {}"))
    axis: Sequence[float] | Array = field(metadata=stated(Form.POINT))
    radius: float = field(metadata=stated(Form.NUMBER, above=0.0) | kept(_radius, shown="Cylinder"))
    inside: bool = field(default=False, metadata=stated(Form.FLAG))

    def __post_init__(self) -> None:
        super().__post_init__()
        if len(self.point) != 3:
            raise ProblemError("Cylinder: point has 2 coordinates; in the plane a cylinder is a circle: take Sphere")
        object.__setattr__(self, "axis", _direction(self.axis, 3, "Cylinder: axis"))

    @property
    def dim(self) -> int:
        return 3

    def _across(self, vectors: Array) -> Array:
        """Part of vectors (k, 3) across the axis."""
        axis = np.asarray(self.axis)
        return np.asarray(vectors - (vectors @ axis)[:, None] * axis)

    def distance(self, points: Array) -> Array:
        return _round_distance(self._across(points - self.point), self.radius, self.inside)

    def normals(self, points: Array) -> Array:
        return _round_normal(
            self._across(points - self.point), points, self.radius, self.inside, "axis of the cylinder"
        )

    def along(self, points: Array, directions: Array) -> Array:
        return _round_along(self._across(points - self.point), self._across(directions), self.radius, self.inside)


@dataclass(frozen=True, eq=False)
class SignedDistance(Obstacle):
    """An obstacle of any shape, given by its signed distance.

    Parameters
    ----------
    function : callable
        Gets points, shape (k, d), and returns signed distances, shape (k,): positive outside the obstacle. Near the
        body its gradient must have length 1 (within 2 per cent); a level set function ``f`` that has not may be
        divided by ``|grad f|``.
    gradient : callable, optional
        Gets points and returns gradients, shape (k, d). Without it, central difference quotients are taken, which
        give normals to about 1e-9.

    Raises
    ------
    ProblemError
        When it is evaluated: if values have the wrong shape or are not finite, or the gradient is not of length 1.
    """

    function: Callable[[Array], object]
    gradient: Callable[[Array], object] | None = None

    _near: ClassVar[float] = 0.1  # of the extent of the points: closer than that the gradient is checked
    _length: ClassVar[float] = 0.02  # by how much its length may differ from 1 there
    _step: ClassVar[float] = (
        1e-6  # of the extent: of difference quotients, whose error is then 1e-12, and rounding 1e-10
    )
    _march: ClassVar[int] = 200  # steps along a ray up to the obstacle
    _newton: ClassVar[int] = 20  # and those of Newton's method there
    _landed: ClassVar[float] = 1e-10  # of the extent: a ray this close has met the obstacle

    def __post_init__(self) -> None:
        for name in ("function", "gradient"):
            value = getattr(self, name)
            if not callable(value) and not (name == "gradient" and value is None):
                raise ProblemError(
                    f"SignedDistance: {name} is {quoted(value)}; give a function of points, shape (k, d)"
                )

    @property
    def dim(self) -> None:
        return None

    def distance(self, points: Array) -> Array:
        with np.errstate(over="ignore", invalid="ignore"):  # what comes of it is checked
            distance = DataField(self.function, "distance of the obstacle").at(points)
        if not (np.abs(distance) < LARGEST).all():
            worst = float(distance[np.argmax(np.abs(distance))])
            raise ProblemError(f"distance of the obstacle: {worst:g} is beyond the range of numbers; take other units")
        return distance

    def normals(self, points: Array) -> Array:
        slope, distance = self._slope(points), self.distance(points)
        size = np.linalg.norm(slope, axis=1)
        near = np.abs(distance) <= self._near * _extent(points)
        bad = ~(size > 0.1) | (near & (np.abs(size - 1.0) > self._length))
        if bad.any():
            first = int(np.flatnonzero(bad)[0])
            raise ProblemError(
                f"the distance of the obstacle has a gradient of length {size[first]:.4g}, not 1, at x = "
                f"{points[first].tolist()}; divide the function by it, or restrict the contact boundary"
            )
        return np.asarray(slope / size[:, None])

    def along(self, points: Array, directions: Array) -> Array:
        self.normals(points)  # checks
        distance = self.distance(points)
        extent = _extent(points) + float(np.abs(distance).max(initial=0.0))
        travel, result = np.zeros(len(points)), np.full(len(points), np.inf)
        active = np.arange(len(points))
        # No point of the obstacle's surface is nearer than the distance: steps of that size never cross it.
        for _ in range(self._march):
            step = self.distance(points[active] + travel[active, None] * directions[active])
            travel[active] += step
            active = active[(np.abs(step) > 1e-3 * extent) & (np.abs(travel[active]) < 4.0 * extent)]
            if active.size == 0:
                break
        active = np.flatnonzero(np.abs(travel) < 4.0 * extent)
        for _ in range(self._newton):
            point = points[active] + travel[active, None] * directions[active]
            approach = -np.einsum("kd,kd->k", self._slope(point), directions[active])
            left = self.distance(point)
            landed = (np.abs(left) <= self._landed * extent) & (approach > 0.0)
            result[active[landed]] = travel[active[landed]] + left[landed] / approach[landed]
            going = ~landed & (approach > 0.0)
            travel[active[going]] += left[going] / approach[going]
            active = active[going]
            if active.size == 0:
                break
        # Ahead of a point outside, or behind a point inside.
        return np.where(result * np.sign(distance) >= -self._landed * extent, result, np.inf)

    def _slope(self, points: Array) -> Array:
        if self.gradient is not None:
            return DataField(self.gradient, "gradient of the obstacle's distance", points.shape[1]).at(points)
        step = self._step * _extent(points)
        columns = [
            (self.distance(points + shift) - self.distance(points - shift)) / (2.0 * step)
            for shift in step * np.eye(points.shape[1])
        ]
        return np.column_stack(columns)


def obstacle_contact(
    obstacle: Obstacle, normals: Normals, points: Array, body_normals: Array, what: str
) -> tuple[Array, Array]:
    """Contact normals (k, d) and gaps (k,) of points (k, d) of a body with outward normals (k, d).

    The gap is inf where the body's normal misses the obstacle.
    """
    _check_reach(obstacle, points, what)
    if normals is Normals.BODY:
        gap = obstacle.along(points, body_normals)
        if not np.isfinite(gap).any():
            raise ProblemError(
                f"{what}: no outward normal of the body meets the obstacle; reverse the obstacle (its free side is "
                f"where its distance is positive), move it, or take normals = 'obstacle'"
            )
        return body_normals, gap
    gap, contact_normals = obstacle.distance(points), -obstacle.normals(points)
    facing = np.einsum("kd,kd->k", contact_normals, body_normals)
    wrong = (gap <= 1e-9 * _extent(points)) & (facing <= 0.0)
    if wrong.any():
        first = int(np.flatnonzero(wrong)[0])
        raise ProblemError(
            f"{what}: the body lies on the wrong side of the obstacle at x = {points[first].tolist()}; move or reverse "
            "the obstacle (its distance must be positive on the free side)"
        )
    return contact_normals, gap


def refuse_inside(obstacle: Obstacle, mesh: Mesh, contact_points: Array, what: str) -> None:
    """Refuse an obstacle that lies inside the body, where no motion of the contact boundary leads away from it.

    So it does if the body holds its centre, if the whole body lies in it, or if a node of the body lies deeper in a
    round obstacle, or one given by its distance, than every point of the contact boundary.

    Shapes: ``contact_points`` (k, d).
    """
    remedy = "reverse the obstacle (inside = true), or move it out of the body"
    depth = -obstacle.distance(mesh.points)
    if depth.min() > 0.0:
        raise ProblemError(f"{what}: the whole body lies inside the obstacle; {remedy}")
    if isinstance(obstacle, Plane) or getattr(obstacle, "inside", False) or not len(contact_points):
        return
    if isinstance(obstacle, Sphere) and _holds(mesh, np.asarray(obstacle.center)):
        centre = ", ".join(f"{value:g}" for value in obstacle.center)
        raise ProblemError(f"{what}: the centre ({centre}) of the obstacle lies inside the body; {remedy}")
    known = max(float(-obstacle.distance(contact_points).min()), 0.0)
    deepest = int(np.argmax(depth))
    if depth[deepest] > known + 1e-9 * _extent(mesh.points):
        raise ProblemError(
            f"{what}: the obstacle lies {depth[deepest]:.3g} inside the body at x = {mesh.points[deepest].tolist()} "
            f"(on the contact boundary at most {known:.3g}); {remedy}, or add all facets that touch it to the boundary"
        )


def _holds(mesh: Mesh, point: Array) -> bool:
    """Whether a point lies in the interior of a cell, or between cells."""
    low, high = mesh.points.min(axis=0), mesh.points.max(axis=0)
    if not ((low < point) & (point < high)).all():
        return False
    corners = mesh.points[mesh.cells]
    near = ((corners.min(axis=1) <= point) & (point <= corners.max(axis=1))).all(axis=1)
    side = corners[near, 1:] - corners[near, :1]
    share = np.linalg.solve(side.transpose(0, 2, 1), (point - corners[near, 0])[:, :, None])[:, :, 0]
    share = np.column_stack([1.0 - share.sum(axis=1), share])
    inside = (share > -1e-9).all(axis=1)
    if not inside.any():
        return False
    # on the outer boundary the point is not inside: some facet that holds it belongs to one cell only
    outer = mesh.points[mesh.boundary_facets]
    height = np.abs(np.einsum("kd,kd->k", boundary_rule(mesh, None).normals, point - outer[:, 0]))
    slack = 1e-9 * float((high - low).max())
    boxed = ((outer.min(axis=1) - slack <= point) & (point <= outer.max(axis=1) + slack)).all(axis=1)
    return not bool((boxed & (height <= slack)).any())


def _check_reach(obstacle: Obstacle, points: Array, what: str) -> None:
    """Refuse obstacles so large or so far away that distances to them are rounding errors."""
    reach = max(
        (float(np.abs(np.asarray(getattr(obstacle, name))).max()) for name in ("center", "point", "radius")
         if hasattr(obstacle, name)),
        default=0.0,
    )  # fmt: skip
    extent = _extent(points)
    if reach * 2.0**-52 > 1e-6 * extent:
        raise ProblemError(
            f"{what}: coordinates or radius of {reach:.3g} round distances to {reach * 2.0**-52:.2g}, too coarse for a "
            f"body of size {extent:.3g}; take a plane, or move the obstacle"
        )


def _extent(points: Array) -> float:
    """Largest extent of points along an axis; their distance from the origin if it is a single place; 1 for none."""
    if not len(points):
        return 1.0
    extent = float(np.ptp(points, axis=0).max())
    return extent if extent > 0.0 else max(float(np.abs(points).max(initial=0.0)), 1e-300)


def _round_distance(arm: Array, radius: float, inside: bool) -> Array:
    distance = np.linalg.norm(arm, axis=1) - radius
    return np.asarray(-distance if inside else distance)


def _round_normal(arm: Array, points: Array, radius: float, inside: bool, middle: str) -> Array:
    size = np.linalg.norm(arm, axis=1)
    lost = size <= ROUNDED * radius
    if lost.any():
        point = points[int(np.flatnonzero(lost)[0])].tolist()
        raise ProblemError(
            f"the contact point x = {point} lies at the {middle}, where the obstacle has no normal; move the obstacle"
        )
    unit = arm / size[:, None]
    return np.asarray(-unit if inside else unit)


def _round_along(arm: Array, directions: Array, radius: float, inside: bool) -> Array:
    """Root t of ``|arm + t direction| = radius`` where the line enters the obstacle."""
    a = np.einsum("kd,kd->k", directions, directions)
    b = np.einsum("kd,kd->k", arm, directions)
    c = np.einsum("kd,kd->k", arm, arm) - radius**2
    within: BoolArray = c < (ROUNDED if inside else -ROUNDED) * radius**2
    discriminant = b**2 - a * c
    # Outside a full sphere the line must approach it; outside a hollow one it must come from it.
    meets = (a > ROUNDED) & (discriminant >= 0.0) & (within | ((b > 0.0) if inside else (b < 0.0)))
    root = np.sqrt(np.where(meets, discriminant, 1.0))
    # Vieta's form of the root that would be a difference of like numbers
    if inside:
        travel = np.where(b > 0.0, -c / np.where(meets, b + root, 1.0), (root - b) / np.where(meets, a, 1.0))
    else:
        travel = np.where(b < 0.0, c / np.where(meets, root - b, 1.0), -(b + root) / np.where(meets, a, 1.0))
    return np.where(meets, travel, np.inf)


def _direction(value: object, dim: int, name: str) -> Array:
    given = _vector(value, name)
    if len(given) != dim:
        raise ProblemError(f"{name} has {len(given)} components but its point has {dim}; give equally many")
    if abs(float(given @ given) - 1.0) <= 1e-15:  # a unit vector stays what it is, to the last digit
        return given
    array = given / max(float(np.abs(given).max()), 1e-300)
    size = float(np.linalg.norm(array))
    if size == 0.0:
        raise ProblemError(f"{name} is zero; give a direction")
    array /= size
    array.setflags(write=False)
    return array
