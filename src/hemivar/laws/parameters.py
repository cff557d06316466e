"""Law parameters (numbers, one per contact point, formulas, functions of x): metadata, limits, evaluation."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from hemivar.basics.arguments import answer, number
from hemivar.basics.arrays import real_array
from hemivar.basics.stated import Form, Stated, stated
from hemivar.basics.types import Array, Parameter
from hemivar.errors import ProblemError
from hemivar.formula import Formula

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

__all__ = [
    "COMPRESSION",
    "FRICTION",
    "LENGTH",
    "LINE",
    "PRESSURE",
    "RATE",
    "checked_reach",
    "common_rows",
    "evaluate",
    "field_values",
    "numbers",
    "parameter",
    "positive",
    "read_formulas",
    "word",
]

#: The farthest that an own law may reach, and its inverse the nearest: the fourth power, 1e300, is still a number.
_FARTHEST = 1e75

#: Units.
PRESSURE, RATE, LENGTH, LINE = "force/area", "force/area/length", "length", "force/length"


def parameter(
    says: str,
    unit: str,
    example: object = None,
    *,
    least: float | None = None,
    above: float | None = None,
    most: float | None = None,
) -> Mapping[str, Stated]:
    """The metadata of a parameter: a number or a formula of place and time; ``above`` itself is excluded."""
    return stated(Form.QUANTITY, says, unit=unit, example=example, least=least, above=above, most=most, timed=True)


def numbers(says: str, unit: str, example: object = None) -> Mapping[str, Stated]:
    """The metadata of a list of numbers."""
    return stated(Form.LIST, says, unit=unit, example=example)


def word(says: str, *choices: str) -> dict[str, Stated]:
    """The metadata of a parameter that is one of some words."""
    unit = f"{', '.join(choices[:-1])} or {choices[-1]}"
    return stated(Form.TEXT, says, unit=unit, choices=tuple(str(choice) for choice in choices))


#: The metadata of a parameter that must be above zero.
positive = partial(parameter, above=0.0)
#: What a normal law of glue does in penetration.
COMPRESSION = parameter("stiffness in penetration; left out: rigid", RATE, least=0.0)
#: What a friction bound is, and what friction may be a law of: of every friction law.
FRICTION = {
    "bound": stated(Form.OWN, "friction bound h_tau", unit=PRESSURE, least=0.0, example=1.0),
    "of": word("what it is a law of in time", "slip", "rate"),
}


def read_formulas(owner: DataclassInstance, whose: str) -> None:
    """Make formulas of the texts among the stated parameters of a dataclass that is being made."""
    for parameter in fields(owner):
        value, stated = getattr(owner, parameter.name), parameter.metadata.get("stated")
        if isinstance(value, str) and stated is not None and stated.form is Form.QUANTITY:
            object.__setattr__(owner, parameter.name, Formula(value, f"{parameter.name} of {whose}"))


def evaluate(
    parameter: Parameter,
    points: Array | None,
    what: str,
    minimum: float | None = None,
    *,
    above: float | None = None,
    most: float | None = None,
) -> Array:
    """The values (1,) or (m,) of a parameter at ``points (m, d)``, finite, within its limits; ``above`` is excluded.

    Without points functions are refused; messages name ``what`` it is, such as ``"q_max of law 'survey'"``.
    """
    if callable(parameter):
        if points is None:
            raise ProblemError(f"{what} is a function of x: evaluate the law with law.at(points) first")
        values = answer(parameter, (points,), what, f"give a function of points, shape {points.shape}")
    else:
        values = parameter
    result = np.atleast_1d(real_array(values, what, finite=False))
    if result.ndim != 1 or not result.size or (points is not None and result.size not in (1, len(points))):
        expected = "a number" if points is None else f"a number or {len(points)} numbers, one for each contact point"
        raise ProblemError(f"{what} has shape {result.shape}; give {expected}")
    bad = ~np.isfinite(result)
    if bad.any():
        raise ProblemError(f"{what} is {result[bad][0]}{_where(bad, points)}; give a finite number")
    if minimum is not None and (result < minimum).any():
        bad = result < minimum
        raise ProblemError(f"{what} is {result[bad][0]:g}{_where(bad, points)}; it must be at least {minimum:g}")
    if above is not None and (result <= above).any():
        raise ProblemError(f"{what} is {result.min():g}; it must be positive")
    if most is not None and (result > most).any():
        bad = result > most
        raise ProblemError(f"{what} is {result[bad][0]:g}{_where(bad, points)}; it must be at most {most:g}")
    return result


def field_values(owner: DataclassInstance, points: Array | None, whose: str) -> dict[str, Array]:
    """The parameters that the fields of a law or a memory are, by name, within the limits that they state.

    A field that is left out, None, is none of them.
    """
    values: dict[str, Array] = {}
    for parameter in fields(owner):
        given, stated = getattr(owner, parameter.name), parameter.metadata.get("stated", Stated(Form.QUANTITY))
        if given is not None or parameter.default is not None:
            values[parameter.name] = evaluate(
                given, points, f"{parameter.name} of {whose}", stated.least, above=stated.above, most=stated.most
            )
    return values


def common_rows(whose: str, *sizes: int) -> int:
    """For how many contact points numbers and laws of these sizes are together: 1 for all, 0 on a rank without any."""
    rows = set(sizes) - {1}
    if len(rows) > 1:
        raise ProblemError(f"{whose}: its parameters are given for {sorted(rows)} contact points; make them equal")
    return rows.pop() if rows else 1


def _where(bad: np.ndarray, points: Array | None) -> str:
    if points is None or bad.size != len(points):
        return ""
    return f" at x = {np.array2string(points[np.argmax(bad)], precision=6)}"


def checked_reach(reach: object, of: str) -> float:
    """The reach of a law or a bound, a positive length whose powers are numbers."""
    far = number(reach, f"reach of {of}", "give a length")
    if not 0.0 < far < np.inf:
        raise ProblemError(f"reach of {of} is {far}; it must be a positive length")
    if not 1.0 / _FARTHEST <= far <= _FARTHEST:
        raise ProblemError(
            f"reach of {of} is {far:g}; it must lie between {1.0 / _FARTHEST:g} and {_FARTHEST:g}: take another unit "
            "of length"
        )
    return far
