"""Initial stress and initial strain (eigenstrain) of a body: the stress that it has before anything moves."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType

import numpy as np

from hemivar.basics.arguments import answer
from hemivar.basics.arrays import LARGEST, ROUNDED
from hemivar.basics.types import Array, BoolArray
from hemivar.errors import ProblemError
from hemivar.formula import Formula, FormulaArray
from hemivar.mechanics.conditions import ScalarData, check_finite, plain_data
from hemivar.mechanics.instants import at_time, depends_on_time
from hemivar.mechanics.per_volume import refuse_unknown
from hemivar.mesh.mesh import Mesh

__all__ = ["InitialField", "checked_field", "field_at", "field_depends_on_time", "is_zero", "tensors_at"]

#: A number, alike in all directions; a symmetric tensor (d, d), or (3, 3) of which the last direction is that across
#: the plane; one of these for each cell, (M,) or (M, d, d); a function of points (k, d) that returns (k,) or (k, d, d).
OneField = ScalarData | Array | Callable[..., object]
_HOOP = (
    "of a body of revolution leaves out what acts around the axis; give 3 rows of 3, of the radius, the axis and the "
    "direction around it"
)
#: Such a field, or one for each of some regions, with zero in the others.
InitialField = OneField | Mapping[str, OneField]


def checked_field(value: object, name: str, mesh: Mesh, ring: bool) -> InitialField:
    """An initial stress or strain as a statement keeps it."""
    if isinstance(value, Mapping):
        refuse_unknown(name, value, list(mesh.regions))
        lists = [list(mesh.regions[region]) for region in value]
        if sum(map(len, lists)) > len(set().union(*lists)):
            raise ProblemError(f"{name} names regions that share cells; name each cell once")
        parts = {region: _checked(one, f"{name} of region '{region}'", mesh, ring) for region, one in value.items()}
        return MappingProxyType(parts)
    return _checked(value, name, mesh, ring)


def _checked(value: object, name: str, mesh: Mesh, ring: bool) -> OneField:
    if isinstance(value, str):
        return Formula(value, name)
    if isinstance(value, list | tuple) and all(isinstance(row, list | tuple) for row in value):
        entries = [one for row in value for one in row]
        if len({len(row) for row in value}) == 1 and any(isinstance(one, str | Formula) for one in entries):
            value = FormulaArray([plain_data(one, name, 1) for one in entries], (len(value), len(value[0])))  # type: ignore[misc]
    if not callable(value):
        value = np.array(check_finite(value, name, LARGEST))  # that does not change with what it came from
        value.setflags(write=False)
    shape = value.shape if isinstance(value, FormulaArray | np.ndarray) else ()
    cells, squares = (mesh.number_of_cells,), [(size, size) for size in sorted({mesh.dim, 3})]
    if shape not in ((), cells, *squares, *(cells + square for square in squares)):
        rows = " or ".join(f"{size} rows of {size}" for size, _ in squares)
        raise ProblemError(
            f"{name} has shape {shape}; give a number, {rows}, or one of these for each of the {cells[0]} cells"
        )
    if ring and len(shape) > 1 and shape[-1] == 2:
        raise ProblemError(f"{name} {_HOOP}")
    if isinstance(value, np.ndarray):
        _refuse_skew(value, name)
        _refuse_twist(value, name, mesh.dim)
        return value if value.ndim else float(value)
    return value  # type: ignore[return-value]


def _refuse_skew(value: Array, name: str) -> None:
    if value.ndim > 1 and (np.abs(value - np.swapaxes(value, -1, -2)) > ROUNDED * np.abs(value).max(initial=0.0)).any():
        raise ProblemError(f"{name} is not symmetric; give a symmetric tensor")


def _refuse_twist(value: Array, name: str, dim: int) -> None:
    """Refuse a tensor of space that shears a plane body across its plane."""
    if dim == 2 and value.ndim > 1 and value.shape[-1] == 3 and value[..., :2, 2].any():
        raise ProblemError(f"{name} shears the body across its plane, which has no such motion; give zeros there")


def is_zero(value: InitialField) -> bool:
    """Whether there is no such stress or strain."""
    return isinstance(value, float) and value == 0.0


def field_depends_on_time(value: InitialField | None) -> bool:
    """Whether an initial field, or that of one region, depends on time."""
    parts = value.values() if isinstance(value, Mapping) else [value]
    return any(map(depends_on_time, parts))


def field_at(value: InitialField | None, t: float) -> InitialField | None:
    """An initial field at a time; itself if it does not depend on time."""
    if isinstance(value, Mapping):
        return MappingProxyType({region: field_at(one, t) for region, one in value.items()})  # type: ignore[misc]
    return at_time(value, t) if depends_on_time(value) else value  # type: ignore[arg-type, return-value]


def tensors_at(
    value: InitialField, name: str, points: Array, regions: Mapping[str, BoolArray], ring: bool
) -> tuple[Array, Array]:
    """Tensors (M, d, d) of an initial field at a point (M, d) of each cell, and their parts across the plane (M,).

    A number is alike in all three directions; a tensor of the plane has nothing across it, one of space has its last
    direction there.
    """
    tensors, across = np.zeros((len(points), points.shape[1], points.shape[1])), np.zeros(len(points))
    parts = value if isinstance(value, Mapping) else {"": value}
    for region, one in parts.items():
        here = regions[region] if region else np.ones(len(points), dtype=bool)
        given = _values(one, f"{name} of region '{region}'" if region else name, points[here])
        if ring and given.ndim > 1 and given.shape[-1] == 2:
            raise ProblemError(f"{name} {_HOOP}")
        if given.ndim == 1:
            given = given[:, None, None] * np.eye(3)
        if given.shape[-1] > points.shape[1]:
            across[here] += given[:, 2, 2]
        tensors[here] += given[:, : points.shape[1], : points.shape[1]]
    return tensors, across


def _values(value: object, name: str, points: Array) -> Array:
    """Numbers (k,) or tensors (k, d, d) at points (k, d)."""
    count, squares = len(points), [(size, size) for size in sorted({points.shape[1], 3})]
    if not callable(value):
        given = np.asarray(value, dtype=float)
        return np.broadcast_to(given, (count, *given.shape)) if given.ndim in (0, 2) else given
    if depends_on_time(value):
        raise ProblemError(f"{name} depends on time, and no time is given; take the problem at one, .at_time(0.0)")
    remedy = f"give a function of points, shape {points.shape}"
    given = check_finite(answer(value, (points,), name, remedy), name, LARGEST)
    given = np.broadcast_to(given, (count, *given.shape)) if given.shape in ((), *squares) else given
    shapes = [(count,), *((count, *square) for square in squares)]
    if given.shape not in shapes:
        raise ProblemError(
            f"{name}: the callable returned shape {given.shape} for points of shape {points.shape}; it must return "
            f"shape {' or '.join(map(str, shapes))}"
        )
    _refuse_skew(given, name)
    _refuse_twist(given, name, points.shape[1])
    return given
