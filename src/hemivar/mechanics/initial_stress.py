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

#: A number, alike in all directions; a symmetric tensor (d, d); one of these for each cell, (M,) or (M, d, d); a
#: function of points (k, d) that returns (k,) or (k, d, d).
OneField = ScalarData | Array | Callable[..., object]
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
    cells, square = (mesh.number_of_cells,), (mesh.dim, mesh.dim)
    if shape not in ((), square, cells, cells + square):
        raise ProblemError(
            f"{name} has shape {shape}; give a number, {mesh.dim} rows of {mesh.dim}, or one of these for each of the "
            f"{cells[0]} cells"
        )
    if ring and len(shape) > 1:
        raise ProblemError(f"{name} of a body of revolution is alike in all directions; give a number or a function")
    if isinstance(value, np.ndarray):
        _refuse_skew(value, name)
        return value if value.ndim else float(value)
    return value  # type: ignore[return-value]


def _refuse_skew(value: Array, name: str) -> None:
    if value.ndim > 1 and (np.abs(value - np.swapaxes(value, -1, -2)) > ROUNDED * np.abs(value).max(initial=0.0)).any():
        raise ProblemError(f"{name} is not symmetric; give a symmetric tensor")


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

    A number is alike in all three directions; a tensor of the plane has nothing across it.
    """
    tensors, across = np.zeros((len(points), points.shape[1], points.shape[1])), np.zeros(len(points))
    parts = value if isinstance(value, Mapping) else {"": value}
    for region, one in parts.items():
        here = regions[region] if region else np.ones(len(points), dtype=bool)
        given = _values(one, f"{name} of region '{region}'" if region else name, points[here])
        if ring and given.ndim > 1:
            raise ProblemError(f"{name} of a body of revolution is alike in all directions; return one number a point")
        if given.ndim == 1:
            across[here] += given
            given = given[:, None, None] * np.eye(points.shape[1])
        tensors[here] += given
    return tensors, across


def _values(value: object, name: str, points: Array) -> Array:
    """Numbers (k,) or tensors (k, d, d) at points (k, d)."""
    count, square = len(points), 2 * points.shape[1:]
    if not callable(value):
        given = np.asarray(value, dtype=float)
        return np.broadcast_to(given, (count, *square[: given.ndim])) if given.ndim in (0, 2) else given
    if depends_on_time(value):
        raise ProblemError(f"{name} depends on time, and no time is given; take the problem at one, .at_time(0.0)")
    remedy = f"give a function of points, shape {points.shape}"
    given = check_finite(answer(value, (points,), name, remedy), name, LARGEST)
    given = np.broadcast_to(given, (count, *given.shape)) if given.shape in ((), square) else given
    if given.shape not in ((count,), (count, *square)):
        raise ProblemError(
            f"{name}: the callable returned shape {given.shape} for points of shape {points.shape}; it must return "
            f"shape {(count,)} or {(count, *square)}"
        )
    _refuse_skew(given, name)
    return given
