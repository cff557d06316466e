"""Boundary conditions and loads of a body: Dirichlet supports, tractions (Neumann), and checked data fields."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from types import MappingProxyType
from typing import Literal, TypeVar, cast, overload

import numpy as np

from hemivar.basics.arguments import answer, quoted
from hemivar.basics.arrays import LARGEST, real_array
from hemivar.basics.portable import PickleMixin
from hemivar.basics.stated import CheckedFields, Form, kept, stated
from hemivar.basics.types import Array, BoolArray
from hemivar.errors import ProblemError
from hemivar.formula import Formula, FormulaArray
from hemivar.mechanics.instants import Instant, at_time, depends_on_time

__all__ = [
    "SUPPORTS",
    "Clamped",
    "DataField",
    "Fixed",
    "Prescribed",
    "Pressure",
    "RigidPlate",
    "Roller",
    "ScalarData",
    "Spring",
    "Support",
    "Traction",
    "VectorData",
]

VectorData = Sequence[float | str] | Array | Callable[[Array], object] | Callable[[Array, float], object]
ScalarData = float | str | Callable[[Array], object] | Callable[[Array, float], object]
Points = Sequence[float] | Sequence[Sequence[float]] | Array


def check_finite(value: object, name: str, most: float = np.inf) -> Array:
    array = real_array(value, name, finite=False)
    if not np.all(np.isfinite(array)):
        raise ProblemError(f"{name}: {quoted(value)} is not finite; give finite numbers")
    if not (np.abs(array) <= most).all():
        raise ProblemError(f"{name}: {quoted(value)} is beyond the range of numbers ({most:.0e}); take other units")
    return array


@overload
def plain_data(value: object, name: str, components: Literal[1], most: float = np.inf) -> ScalarData: ...


@overload
def plain_data(
    value: object, name: str, components: int | None = None, most: float = np.inf
) -> VectorData | ScalarData: ...


def plain_data(
    value: object, name: str, components: int | None = None, most: float = np.inf
) -> VectorData | ScalarData:
    """A quantity as a statement keeps it, checked: a callable as it is, a number as a float, a vector as floats.

    ``components`` is None where it is not known how many a vector needs.  The number 0 means no vector.
    """
    if isinstance(value, str):
        value = Formula(value, name)
    elif isinstance(value, list | tuple) and any(isinstance(one, str | Formula) for one in value):
        value = _formulas(value, name)
    if callable(value):
        return value
    array = check_finite(value, name, most)
    if components == 1 and array.ndim:
        raise ProblemError(f"{name} takes one number or a callable, not shape {array.shape}")
    if components and components > 1:
        _refuse_shape(array, name, components)
    return tuple(array.tolist()) if array.ndim else float(array)


def _formulas(entries: Sequence[object], name: str) -> FormulaArray:
    """A vector some entries of which are formulas."""
    read = (Formula(entry, name) if isinstance(entry, str) else entry for entry in entries)
    kept = [entry if isinstance(entry, Formula) else float(check_finite(entry, name)) for entry in read]
    return FormulaArray(kept, (len(kept),))


def _refuse_shape(array: Array, name: str, components: int) -> None:
    """Refuse what is neither a vector of so many components nor zero."""
    if array.shape != (components,) and (array.ndim or array != 0.0):
        raise ProblemError(f"{name} has shape {array.shape}; on this mesh it needs {components} components")


def _points(value: object, name: str) -> tuple[tuple[float, ...], ...]:
    """Points as a support keeps them: a tuple for each."""
    points = check_finite(value, name)
    if points.ndim not in (1, 2) or points.shape[-1] not in (2, 3) or not points.size:
        raise ProblemError(f"{name} has shape {points.shape}; give a point, such as (0.0, 1.0), or a list of points")
    return tuple(tuple(point) for point in np.atleast_2d(points).tolist())


_AT = stated(Form.POINTS) | kept(_points)


class _Support(CheckedFields, PickleMixin):
    """A support, shown by what is given of it."""

    def __repr__(self) -> str:
        given = {one.name: getattr(self, one.name) for one in fields(self)}  # type: ignore[arg-type]
        shown = (f"{name}={value!r}" for name, value in given.items() if value is not None)
        return f"{type(self).__name__}({', '.join(shown)})"


@dataclass(frozen=True, repr=False)
class Clamped(_Support):
    """No displacement: ``u = 0``.

    Attributes
    ----------
    at : point, shape (d,), or points, shape (k, d), optional
        Points whose nearest nodes are held in the place of a boundary; how far they are is said.  The support then has
        a name of its own.  Nodes at one place are all held.

    Examples
    --------
    >>> import hemivar as hv
    >>> supports = {"left": hv.Clamped()}  # or the word: {"left": "clamped"}
    >>> supports = {"pin": hv.Clamped(at=(0.0, 0.0)), "slide": hv.Fixed(y=0.0, at=(1.0, 0.0))}
    """

    at: Points | None = field(default=None, metadata=_AT)


@dataclass(frozen=True)
class Roller:
    """No displacement along the normal, ``u_nu = 0``: the body slides freely along the boundary.

    Where facets of one boundary meet at less than 45 degrees their normals are averaged at the common node;
    where they meet at a sharper corner both are fixed.

    Examples
    --------
    >>> import hemivar as hv
    >>> supports = {"left": hv.Roller(), "top": hv.Fixed(y=-0.1)}
    """


_COMPONENT = stated(Form.QUANTITY, timed=True) | kept(plain_data, 1, LARGEST, shown="Fixed({}=...)")


@dataclass(frozen=True, repr=False)
class Fixed(_Support):
    """Prescribed single Cartesian components of the displacement; ``None`` leaves a component free.

    Attributes
    ----------
    x, y, z : float, callable or None
        Value of the component, or a function of points, shape (k, d), that returns shape (k,); it may depend on time,
        ``f(x, t)``.
    at : point or points, optional
        As of :class:`Clamped`.

    Examples
    --------
    >>> import hemivar as hv
    >>> hv.Fixed(y="-0.1*t")  # x is free
    Fixed(y=Formula(text='-0.1*t', where='Fixed(y=...)', minimum=None))
    """

    x: ScalarData | None = field(default=None, metadata=_COMPONENT)
    y: ScalarData | None = field(default=None, metadata=_COMPONENT)
    z: ScalarData | None = field(default=None, metadata=_COMPONENT)
    at: Points | None = field(default=None, metadata=_AT)

    def __post_init__(self) -> None:
        if self.x is None and self.y is None and self.z is None:
            raise ProblemError("Fixed() fixes nothing; give x, y or z, or leave the support out")
        super().__post_init__()


@dataclass(frozen=True, repr=False)
class Prescribed(_Support):
    """Prescribed displacement ``u = value``.

    Attributes
    ----------
    value : vector, shape (d,), or callable
        A callable gets points, shape (k, d), and returns displacements, shape (k, d); it may depend on time,
        ``f(x, t)``.
    at : point or points, optional
        As of :class:`Clamped`.

    Examples
    --------
    >>> import hemivar as hv
    >>> hv.Prescribed((0.0, -0.1))
    Prescribed(value=(0.0, -0.1))
    """

    value: VectorData = field(
        metadata=stated(Form.VECTOR, key="displacement", timed=True)
        | kept(plain_data, None, LARGEST, shown="Prescribed(...)")
    )
    at: Points | None = field(default=None, metadata=_AT)

    def refuse_shape(self, name: str, components: int) -> None:
        """Refuse a vector of other components."""
        if not callable(self.value):
            shape = np.shape(self.value)
            if shape != (components,):
                raise ProblemError(f"{name} has shape {shape}; on this mesh it needs {components} components")


def _stiffness(value: object, name: str) -> ScalarData:
    stiffness = plain_data(value, name, 1, LARGEST)
    if depends_on_time(stiffness):
        raise ProblemError(f"{name} depends on time, which the stiffness of a spring cannot; give a function of x")
    if not callable(stiffness) and not float(stiffness) >= 0.0:
        raise ProblemError(f"{name} = {stiffness}; give a stiffness that is not negative")
    return stiffness


def _point(value: object, name: str) -> tuple[float, ...]:
    point = check_finite(value, name)
    if point.shape not in ((2,), (3,)):
        raise ProblemError(f"{name} has shape {point.shape}; give a point, such as (0.0, 1.0)")
    return tuple(point.tolist())


def _direction(value: object, name: str) -> tuple[float, ...]:
    vector = check_finite(value, name)
    if vector.shape not in ((2,), (3,)) or not vector.any():
        raise ProblemError(f"{name} is {quoted(value)}; give a vector that is not zero, such as (0.0, 1.0)")
    return tuple(vector.tolist())


_STIFFNESS = stated(Form.QUANTITY, least=0.0) | kept(_stiffness, shown="Spring({}=...)")


@dataclass(frozen=True, repr=False)
class Spring(_Support):
    """Linear springs between a boundary and the ground, which push and pull: ``-normal u_nu nu - tangential u_tau``.

    They are part of the stiffness of the body and hold it.

    Attributes
    ----------
    normal, tangential : float or callable
        Stiffness along the normal and across it, not negative: force per area and displacement; at a point force per
        displacement, of a body of revolution that of the whole ring.  A callable gets points, shape (k, d), and returns
        shape (k,).
    direction : vector, shape (d,), optional
        What stands for the normal, along a line of anchors for example; at a point with two different stiffnesses it is
        needed.
    at : point or points, optional
        As of :class:`Clamped`: a spring at each.

    Examples
    --------
    >>> import hemivar as hv
    >>> supports = {"bottom": hv.mechanics.Spring(normal=100.0), "pin": hv.mechanics.Spring(50.0, 50.0, at=(0.0, 0.0))}
    """

    normal: ScalarData = field(default=0.0, metadata=_STIFFNESS)
    tangential: ScalarData = field(default=0.0, metadata=_STIFFNESS)
    direction: tuple[float, ...] | None = field(
        default=None, metadata=stated(Form.POINT) | kept(_direction, shown="Spring({}=...)")
    )
    at: Points | None = field(default=None, metadata=_AT)

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.normal == 0.0 and self.tangential == 0.0:
            raise ProblemError("Spring() has no stiffness; give normal or tangential, or leave the support out")
        if self.at is not None and self.direction is None and self.normal != self.tangential:
            raise ProblemError(
                "a Spring at a point has no normal; give direction, or normal and tangential of one size"
            )


_PUSH = kept(plain_data, None, LARGEST, shown="RigidPlate({}=...)")
_MOTION = stated(Form.QUANTITY, timed=True) | kept(plain_data, 1, LARGEST, shown="RigidPlate({}=...)")


@dataclass(frozen=True, repr=False)
class RigidPlate(_Support):
    """A boundary that moves as a rigid body: displaced at ``about`` and turned by small angles, under a stated force.

    Attributes
    ----------
    force : vector, shape (d,), or 0
        Total force on the plate; of a body of revolution that on the whole ring.
    moment : number, in space vector, shape (3,)
        Total moment about the same point.
    about : point, shape (d,), optional
        The point that ``force``, ``moment`` and the motions are of; by default the middle of the boundary.
    x, y, z : number, optional
        Prescribed displacements of that point; None leaves one free.
    turn_x, turn_y, turn_z : number, optional
        Prescribed angles about axes through it, in radians; in the plane ``turn_z``, counterclockwise.

    Everything but ``about`` may depend on time, ``"-2*t"``.  A body of revolution moves along its axis only.

    Examples
    --------
    >>> import hemivar as hv
    >>> supports = {"top": hv.mechanics.RigidPlate(force=(0.0, -5.0), about=(0.5, 1.0))}
    >>> supports = {"top": hv.mechanics.RigidPlate(y=-0.1, turn_z=0.0)}  # slides freely along x
    """

    force: VectorData | float = field(default=0.0, metadata=stated(Form.VECTOR, timed=True) | _PUSH)
    moment: VectorData | ScalarData = field(default=0.0, metadata=stated(Form.TORQUE, timed=True) | _PUSH)
    about: Sequence[float] | None = field(
        default=None, metadata=stated(Form.POINT) | kept(_point, shown="RigidPlate({}=...)")
    )
    x: ScalarData | None = field(default=None, metadata=_MOTION)
    y: ScalarData | None = field(default=None, metadata=_MOTION)
    z: ScalarData | None = field(default=None, metadata=_MOTION)
    turn_x: ScalarData | None = field(default=None, metadata=_MOTION)
    turn_y: ScalarData | None = field(default=None, metadata=_MOTION)
    turn_z: ScalarData | None = field(default=None, metadata=_MOTION)

    @property
    def loads(self) -> dict[str, object]:
        """Force and moment."""
        return {"force": self.force, "moment": self.moment}

    @property
    def motions(self) -> dict[str, ScalarData]:
        """What is prescribed, by name."""
        given = {name: getattr(self, name) for name in ("x", "y", "z", "turn_x", "turn_y", "turn_z")}
        return {name: value for name, value in given.items() if value is not None}

    def refuse_shape(self, name: str, dim: int, ring: bool) -> None:
        """Refuse vectors of other components, and motions that a body does not have."""
        able = ("y",) if ring else ("x", "y", "turn_z") if dim == 2 else ("x", "y", "z", "turn_x", "turn_y", "turn_z")
        for motion in self.motions:
            if motion not in able:
                raise ProblemError(
                    f"{name} prescribes {motion}, which such a body does not have; give {', '.join(able)}"
                )
        about = () if self.about is None else self.about
        if len(about) not in (0, dim):
            raise ProblemError(f"{name}: about has {len(about)} coordinates, the mesh has {dim}")
        for what, value, count in (("force", self.force, dim), ("moment", self.moment, 1 if dim == 2 else 3)):
            shape = np.shape(value) if not callable(value) else (count,)  # type: ignore[arg-type]
            if shape not in ((count,), ()) or (shape == () and count > 1 and value != 0.0):
                raise ProblemError(f"{name}: {what} has shape {shape}; it needs {count} component{'s' * (count > 1)}")


@dataclass(frozen=True)
class Pressure(CheckedFields, PickleMixin):
    """Traction ``-value nu``: a positive pressure pushes into the body.

    Attributes
    ----------
    value : float or callable
        A callable gets points, shape (k, d), and returns shape (k,); it may depend on time, ``f(x, t)``.

    Examples
    --------
    >>> import hemivar as hv
    >>> tractions = {"top": hv.Pressure(2.0), "right": (0.0, "-x")}
    """

    value: ScalarData = field(
        metadata=stated(
            Form.QUANTITY,
            "force per area against the outward normal, by name: `pressure = { right = 2.0 }` *(f, t)*",
            key="pressure", timed=True, by="boundary", table="loads",
        ) | kept(plain_data, 1, shown="Pressure(...)")
    )  # fmt: skip


#: A support, a pressure or a traction.
Condition = TypeVar("Condition")

Support = Clamped | Roller | Fixed | Prescribed | Spring | RigidPlate
#: Supports by the words for them, in ``ContactProblem(supports={"left": "clamped"})`` as in files.
SUPPORTS: Mapping[str, Support] = MappingProxyType({"clamped": Clamped(), "roller": Roller()})
Traction = VectorData | Pressure


def place_of(bad: BoolArray, points: Array, where: str | None) -> str:
    """``at x = ...`` of the first bad one of points, or what is said in its place."""
    return f" at x = {points[int(np.argmax(bad))].tolist()}" if where is None else where


def require(ok: BoolArray, points: Array, value: Array, name: str, what: str, where: str | None = None) -> None:
    """Refuse values (k,) at points of which something does not hold; ``where`` stands for the place if it is given."""
    if not ok.all():
        raise ProblemError(f"{name} = {value[np.argmin(ok)]:g}{place_of(~ok, points, where)}; it {what}")


@dataclass(frozen=True, eq=False)
class DataField:
    """What a statement has checked, as a function of the place: a number, or a vector of several components."""

    value: object
    name: str
    components: int = 1

    @property
    def alike(self) -> bool:
        """Whether the value is known to be the same at every place: a number, or a formula of nothing but the time."""
        value = self.value.value if isinstance(self.value, Instant) else self.value
        return not callable(value) or (isinstance(value, Formula | FormulaArray) and value.variables <= {"t"})

    def at(self, points: Array, time: float | None = None) -> Array:
        """Values at points (k, d), of a number shape (k,), of a vector (k, components)."""
        vector = (self.components,) if self.components > 1 else ()
        shape = points.shape[:1] + vector
        if not callable(self.value):
            plain: Array = np.asarray(self.value, dtype=float)  # type: ignore[arg-type]
            if vector:
                _refuse_shape(plain, self.name, self.components)
            return np.broadcast_to(plain, shape)
        if time is None and depends_on_time(self.value):
            raise ProblemError(
                f"{self.name} depends on time, and no time is given; take the problem at one, problem.at_time(0.0)"
            )
        given = (points, time) if depends_on_time(self.value) else (points,)
        values = answer(self.value, given, self.name, f"give a function of points, shape {points.shape}")
        return _checked_result(values, shape, points, self.name, vector)


def _checked_result(
    value: object, shape: tuple[int, ...], points: Array, name: str, constant: tuple[int, ...]
) -> Array:
    result = real_array(value, f"{name}: what the callable returns", finite=False)
    if result.shape == constant and shape != constant:
        result = np.broadcast_to(result, shape)
    if result.shape != shape:
        raise ProblemError(
            f"{name}: the callable returned shape {result.shape} for points of shape {points.shape}; "
            f"it must return shape {shape}"
        )
    finite = np.isfinite(result)
    if not finite.all():  # of all numbers at once: place by place it costs as much as the function
        bad = int(np.argwhere(~finite)[0, 0])
        raise ProblemError(f"{name}: the callable returned {result[bad]} at x = {points[bad].tolist()}")
    return result


def stated_values(condition: Support | Traction | ScalarData) -> dict[str, VectorData | ScalarData]:
    """What a support, a pressure or a traction prescribes, by the names of its fields; "" for plain data."""
    if isinstance(condition, Spring):
        return {}
    if isinstance(condition, RigidPlate):
        return {**condition.motions}
    if not isinstance(condition, Clamped | Roller | Fixed | Prescribed | Pressure):
        return {"": condition}
    values = {part.name: getattr(condition, part.name) for part in fields(condition) if part.name != "at"}
    return {name: value for name, value in values.items() if value is not None}


def at_rest(support: Support | ScalarData, dim: int) -> Support | ScalarData:
    """The support with its prescribed displacements taken away; itself if it has none."""
    if isinstance(support, Prescribed):
        return replace(support, value=np.zeros(dim))
    if isinstance(support, Fixed):
        values = (support.x, support.y, support.z)
        x, y, z = (None if value is None else 0.0 for value in values)
        moves = any(callable(value) or (value is not None and np.any(value)) for value in values)
        return replace(support, x=x, y=y, z=z) if moves else support
    if isinstance(support, RigidPlate):
        moves = any(callable(value) or value for value in support.motions.values())
        return replace(support, **dict.fromkeys(support.motions, 0.0)) if moves else support  # type: ignore[arg-type]
    if isinstance(support, Clamped | Roller | Spring):
        return support
    return 0.0 if callable(support) or support else support


def condition_at_time(condition: Condition, t: float) -> Condition:
    """A support, a pressure or a traction at a time; itself if it does not depend on time."""
    values = stated_values(condition) | (condition.loads if isinstance(condition, RigidPlate) else {})  # type: ignore[arg-type]
    changed = {name: at_time(one, t) for name, one in values.items() if depends_on_time(one)}
    if "" in changed:
        return cast(Condition, changed[""])
    return replace(condition, **changed) if changed else condition  # type: ignore[type-var]
