"""Quantities per volume (per area of a plane mesh): numbers, functions of the place, or either by region."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType

import numpy as np

from hemivar.basics.arguments import suggest
from hemivar.basics.arrays import LARGEST
from hemivar.basics.stated import Form, kept, stated
from hemivar.basics.types import Array, BoolArray
from hemivar.errors import ProblemError
from hemivar.mechanics.conditions import DataField, ScalarData, plain_data, require
from hemivar.mechanics.instants import refuse_time

__all__ = [
    "STRESS",
    "Regional",
    "at_place",
    "by_region",
    "checked_per_volume",
    "checked_quantity",
    "constant",
    "constant_of",
    "plain_constant",
    "refuse_uncovered",
    "refuse_unknown",
]

#: The unit of moduli.
STRESS = "force/area"
#: A quantity that may be given by region.
Regional = ScalarData | Mapping[str, ScalarData]


def refuse_unknown(what: str, parts: Mapping[str, object], regions: Sequence[str]) -> None:
    """Refuse a quantity by region that names one which the mesh does not have."""
    for region in parts:
        if region not in regions:
            near = suggest(str(region), regions, "regions")
            raise ProblemError(f"{what} names region '{region}', which the mesh does not have{near}")


def checked_per_volume(value: object, name: str) -> Regional:
    """A quantity that is not negative: a number, a function of the place, or one of these by region."""
    if isinstance(value, Mapping):
        if not value:
            raise ProblemError(f"{name} is an empty mapping; give a number for each region of the mesh")
        parts = {
            region: checked_quantity(quantity, f"{name} of region '{region}'") for region, quantity in value.items()
        }
        return MappingProxyType(parts)
    return checked_quantity(value, name)


def plain_constant(value: object, name: str) -> ScalarData:
    """A number, or a function of the place, as a statement keeps it."""
    refuse_time(value, name)
    return plain_data(value, name, 1)


def constant(says: str = "", unit: str = STRESS, **how: object) -> dict[str, object]:
    """The metadata of a constant of a material."""
    return stated(Form.QUANTITY, says, unit=unit, **how) | kept(plain_constant, shown="material constant {}")


def checked_quantity(value: object, name: str) -> ScalarData:
    """A quantity that is not negative, a number or a function of the place."""
    refuse_time(value, name)
    plain = plain_data(value, name, 1, LARGEST)
    if isinstance(plain, float) and plain < 0.0:
        raise ProblemError(f"{name} = {plain:g}; it must not be negative")
    return plain


def constant_of(value: Regional) -> float | None:
    """The quantity where it is the same everywhere, else None."""
    return None if callable(value) or isinstance(value, Mapping) else float(value)


def at_place(value: Regional, name: str, points: Array, regions: Mapping[str, BoolArray] | None = None) -> Array:
    """A quantity at points (k, d), shape (k,)."""
    return by_region(value, name, lambda one, what, at: _at(one, what, points[at]), points, regions)


def by_region(
    value: object,
    name: str,
    function: Callable[[object, str, BoolArray | slice], Array],
    points: Array,
    regions: Mapping[str, BoolArray] | None,
) -> Array:
    """What a function makes of a quantity, its name and all points, or of that of each region and its points."""
    if not isinstance(value, Mapping):
        return function(value, name, slice(None))
    masks = {region: (regions or {})[region] for region in value}
    refuse_uncovered(masks, points, f"that the {name} names", "mesh")
    whole: Array | None = None
    for region, mask in masks.items():
        if mask.any():
            part = function(value[region], f"{name} of region '{region}'", mask)
            whole = np.zeros((len(points), *part.shape[1:])) if whole is None else whole
            whole[mask] = part
    return np.zeros(0) if whole is None else whole


def refuse_uncovered(masks: Mapping[str, BoolArray], points: Array, which: str, what: str) -> None:
    """Refuse regions that leave points out, or share some."""
    covered = np.sum([np.zeros(len(points), dtype=int), *masks.values()], axis=0)
    if (covered != 1).any():
        bad = int(np.flatnonzero(covered != 1)[0])
        where = "no region" if covered[bad] == 0 else "more than one region"
        raise ProblemError(
            f"the point {points[bad].tolist()} lies in {where} {which}; the regions must cover the {what} without "
            "overlap"
        )


def _at(value: object, name: str, points: Array) -> Array:
    values = DataField(value, name).at(points)
    require(values >= 0.0, points, values, name, "must not be negative")
    return values
