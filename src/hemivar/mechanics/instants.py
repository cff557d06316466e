"""Time-dependent data, and what they are at one time.

A formula depends on time if ``t`` occurs in it, a Python function if it takes two arguments, ``(x, t)``.  At one time
it is a function of the place alone, as statics knows it.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, fields, is_dataclass, replace
from typing import TypeVar, cast

from hemivar.basics.portable import PickleMixin
from hemivar.basics.types import Array
from hemivar.errors import ProblemError
from hemivar.formula import Formula, FormulaArray
from hemivar.laws import CoulombBound, Friction, MixedMode, ModeDependentGlue, Superpotential
from hemivar.laws.friction.bounds import StateBound
from hemivar.laws.parametrised import ParameterLaw

__all__ = [
    "Instant",
    "at_time",
    "depends_on_time",
    "error_context",
    "law_at_time",
    "law_depends_on_time",
    "refuse_time",
    "takes_arguments",
]

Quantity = TypeVar("Quantity")


def depends_on_time(value: object) -> bool:
    """Whether a quantity of a statement, a number, an array, a formula or a function, depends on time."""
    if isinstance(value, Formula | FormulaArray):
        return "t" in value.variables
    return callable(value) and not isinstance(value, Instant) and takes_arguments(value, 2, "t")


def takes_arguments(function: Callable[..., object], count: int, name: str) -> bool:
    """Whether a function wants that many arguments: the last has no default, or this name."""
    try:
        parameters = list(inspect.signature(function).parameters.values())
    except (TypeError, ValueError):  # some functions of compiled modules tell nothing of themselves
        return False
    places = (inspect.Parameter.POSITIONAL_ONLY, inspect.Parameter.POSITIONAL_OR_KEYWORD)
    taken = [parameter for parameter in parameters if parameter.kind in places]
    last = taken[count - 1] if len(taken) >= count else None
    return last is not None and (last.default is inspect.Parameter.empty or last.name == name)


@dataclass(frozen=True)
class Instant(PickleMixin):
    """A quantity that depends on time, at one time: a function of points, shape (k, d)."""

    value: Callable[[Array, float], object]  # of points and time
    time: float

    def __call__(self, points: Array) -> object:
        return self.value(points, self.time)


def at_time(value: Quantity, t: float) -> Quantity | Instant:
    """A quantity at a time: itself if it does not depend on time."""
    return Instant(cast(Callable[[Array, float], object], value), t) if depends_on_time(value) else value


def refuse_time(value: object, name: str) -> None:
    """Refuse a quantity that depends on time where only the place counts."""
    if depends_on_time(value):
        raise ProblemError(f"{name} depends on time, which it cannot; give a number, or a function of x alone")


# ---- laws -------------------------------------------------------------------------------------------------


def _parts(law: object) -> Iterator[tuple[str, object, bool]]:
    """What a law is made of: name, value, and whether it is a parameter, which may be a function of place and time."""
    if not is_dataclass(law):
        return
    parameters = isinstance(law, ParameterLaw | CoulombBound | MixedMode | ModeDependentGlue)
    for part in fields(law):
        if part.init and not part.name.startswith("_"):
            yield (
                part.name,
                getattr(law, part.name),
                parameters or (isinstance(law, Friction) and part.name in ("bound", "ratio")),
            )


def law_depends_on_time(law: object) -> bool:
    """Whether a parameter of a law, or of what it is made of, depends on time."""
    for _, value, parameter in _parts(law):
        if isinstance(value, Superpotential | StateBound):
            if law_depends_on_time(value):
                return True
        elif parameter and depends_on_time(value):
            return True
    return False


def law_at_time(law: Quantity, t: float) -> Quantity:
    """A law, a friction law or a friction bound at a time: itself if it does not depend on time."""
    changed: dict[str, object] = {}
    for name, value, parameter in _parts(law):
        if isinstance(value, Superpotential | StateBound):
            if law_depends_on_time(value):
                changed[name] = law_at_time(value, t)
        elif parameter and depends_on_time(value):
            changed[name] = at_time(value, t)
    return replace(law, **changed) if changed else law  # type: ignore[type-var]


def _instants(law: object) -> Iterator[Instant]:
    """Parameters of a law, and of what it is made of, that are those of one time."""
    for _, value, _ in _parts(law):
        if isinstance(value, Instant):
            yield value
        elif isinstance(value, Superpotential | StateBound):
            yield from _instants(value)


@contextmanager
def error_context(where: str, *laws: object) -> Iterator[None]:
    """Where laws are evaluated at contact points: a complaint says where and, if they change, at what time."""
    try:
        yield
    except ProblemError as error:
        time = next((instant.time for law in laws for instant in _instants(law)), None)
        when = "" if time is None else f" at t = {time:.10g}"
        raise type(error)(f"{where}{when}: {error}") from error
