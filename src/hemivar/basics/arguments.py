"""Sentences for arguments of the wrong kind, before anything is done with them."""

from __future__ import annotations

import difflib
import functools
import inspect
import math
import numbers
import operator
from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields
from enum import StrEnum
from types import FunctionType, UnionType
from typing import TYPE_CHECKING, Any, ParamSpec, TypeVar, overload

from hemivar.basics.known_statement import ManufacturedProblem
from hemivar.errors import HemivarError, ProblemError

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

__all__ = [
    "UNFIT",
    "answer",
    "check_numbers",
    "described",
    "expect",
    "expecting",
    "name_of",
    "number",
    "one_line",
    "one_of",
    "positive",
    "quoted",
    "shortened",
    "suggest",
    "whole_number",
]

#: Numbers are below this, so that their squares are numbers.
_LARGEST = 1e150

#: What a function that a user gives raises where it does not fit what it is given.
UNFIT = (ValueError, TypeError, LookupError, AttributeError, ArithmeticError, NotImplementedError)

#: What is given in the place of a plain value.
_REMEDIES: dict[object, str] = {str: "give a text", bool: "give True or False", Mapping: "give a dict by names"}

Kind = TypeVar("Kind")
Word = TypeVar("Word", bound=StrEnum)
Given = ParamSpec("Given")
Result = TypeVar("Result")
#: A class, a union of classes, a list of one for lists of its objects, or a function of a value and its name.
_Wanted = type | UnionType | list[type] | Callable[[object, str], None]


def described(value: object) -> str:
    """What a value is, in a few words: ``'newton'``, ``3``, ``None``, ``the class Clamped``, ``a Mesh``."""
    if isinstance(value, type):
        return f"the class {value.__name__}"
    if value is None or isinstance(value, str | bytes | numbers.Number):
        return quoted(value)
    name = type(value).__name__
    return f"{'an' if name[:1] in 'AEIOUaeiou' else 'a'} {name}"


def quoted(value: object) -> str:
    """A value as it would be written, for a message: in one line, and cut where it is long."""
    return shortened(repr(value), 60)


def shortened(value: object, most: int = 150) -> str:
    """The text of a value, an array or an error in one line of a message, cut where it is long."""
    text = " ".join(str(value).split())
    return text if len(text) <= most else text[: most - 3] + "..."


@overload
def expect(value: object, kind: Callable[..., Kind], name: str, remedy: str) -> Kind: ...


@overload
def expect(value: object, kind: UnionType, name: str, remedy: str) -> Any: ...


def expect(value: object, kind: Any, name: str, remedy: str) -> object:
    """The value, if it is of a kind, a class or a union of classes; of a known statement what it states."""
    value = ManufacturedProblem.of(value) if not isinstance(value, kind) else value
    if isinstance(value, kind):
        return value
    if isinstance(value, type) and issubclass(value, kind):
        raise ProblemError(f"{name} is the class {value.__name__}; create an instance: {value.__name__}(...)")
    raise ProblemError(f"{name} is {described(value)}; {remedy}")


def expecting(
    **kinds: _Wanted,
) -> Callable[[Callable[Given, Result]], Callable[Given, Result]]:
    """A function whose arguments are of these classes, or lists of objects of them; others are refused at the call.

    Where the default of an argument is None, None is what it is without one.  ``float`` is a number whose square is
    one, ``int`` a whole number that is not negative; a function is called with the value and its name.
    """

    def wrapped(function: Callable[Given, Result]) -> Callable[Given, Result]:
        signature, shown = inspect.signature(function), function.__name__

        @functools.wraps(function)
        def checked(*args: Given.args, **kwargs: Given.kwargs) -> Result:
            for name, value in signature.bind(*args, **kwargs).arguments.items():
                kind = kinds.get(name)
                if kind is None or (value is None and signature.parameters[name].default is None):
                    continue
                _check(value, kind, f"{shown}: {name}")
            return function(*args, **kwargs)

        return checked

    return wrapped


def _check(value: object, kind: _Wanted, name: str) -> None:
    if isinstance(kind, list):
        _expect_each(value, kind[0], name)
    elif isinstance(kind, FunctionType):
        kind(value, name)
    elif kind is float:
        if not abs(size := number(value, name)) < _LARGEST:
            raise ProblemError(f"{name} is {size:g}, beyond the range of numbers; give a smaller one")
    elif kind is int:
        whole_number(value, name, 0)
    elif not (kind is bool and type(value).__name__ in ("bool", "bool_")):  # NumPy's as well
        expect(value, kind, name, _remedy(kind))


def positive(value: object, name: str) -> None:
    """Refuse what is not a positive number, for :func:`expecting`."""
    _check(value, float, name)
    if not number(value, name) > 0.0:
        raise ProblemError(f"{name} is {quoted(value)}; give a positive number")


def _remedy(kind: object) -> str:
    if kind in _REMEDIES:
        return _REMEDIES[kind]
    kinds: tuple[object, ...] = kind.__args__ if isinstance(kind, UnionType) else (kind,)
    return "pass " + " or ".join(f"{getattr(one, '__name__', one)}(...)" for one in kinds)


def _expect_each(values: object, kind: type, name: str) -> None:
    if isinstance(values, str | bytes) or not isinstance(values, Sequence):
        raise ProblemError(f"{name} is {described(values)}; give a list of {kind.__name__}(...)")
    for value in values:
        expect(value, kind, f"an entry of {name}", _remedy(kind))


def suggest(name: object, known: Sequence[str], what: str = "known") -> str:
    """The name that was perhaps meant, and all that there are, for the end of a message."""
    close = difflib.get_close_matches(name, known, n=1) if isinstance(name, str) else []
    guess = f"; did you mean '{close[0]}'?" if close else ""
    return f"{guess} ({what}: {', '.join(known) or 'none'})"


def one_of(value: object, name: str, kind: type[Word], choices: str = "") -> Word:
    """The word of a kind that a value is, or a text of it; ``choices`` is how a message lists them."""
    try:
        if not isinstance(value, str):  # of which arrays are compared with every word
            raise ValueError
        return kind(value)
    except ValueError:
        *most, last = (f"'{one}'" for one in kind)
        listed = choices or f"{', '.join(most)} or {last}"
        raise ProblemError(f"{name} = {quoted(value)}; choose {listed}") from None


def name_of(value: object, name: str, remedy: str) -> str:
    """A text that names something: an empty one names nothing, and is refused."""
    if isinstance(value, str) and value.strip():
        return value
    raise ProblemError(f"{name} is {described(value)}; {remedy}")


def answer(function: Callable[..., object], given: Sequence[object], name: str, remedy: str) -> object:
    """What a function that a user gave answers; that it does not fit what it is given is said in words."""
    try:
        return function(*given)
    except HemivarError:
        raise
    except UNFIT as error:
        raise ProblemError(f"{name}: the function cannot be evaluated ({shortened(error)}); {remedy}") from error


def one_line(value: object, name: str) -> str:
    """A text in one line, for labels: messages repeat it."""
    if isinstance(value, str) and value.isprintable():
        return value
    raise ProblemError(f"{name} is {described(value)}; give a text in one line")


def whole_number(value: object, name: str, least: int) -> int:
    """An integer that is at least ``least``, NumPy's included; booleans and floats are refused."""
    try:
        if isinstance(value, bool):
            raise TypeError
        whole = operator.index(value)  # type: ignore[arg-type]
    except TypeError:
        raise ProblemError(f"{name} is {described(value)}; give a whole number >= {least}") from None
    if whole < least:
        raise ProblemError(f"{name} is {whole}; it must be at least {least}")
    return whole


def number(value: object, name: str, what: str = "give a real number") -> float:
    """A real number, NumPy's included, not nan."""
    if type(value) is float and not math.isnan(value):
        return value
    try:
        real = float(value) if isinstance(value, numbers.Real) and not isinstance(value, bool) else math.nan
    except OverflowError:  # an integer beyond all floats
        real = math.nan
    if math.isnan(real):
        raise ProblemError(f"{name} is {described(value)}; {what}")
    return real


def check_numbers(options: DataclassInstance) -> None:
    """Refuse options, a dataclass, of which a field declared as ``float`` or ``int`` holds anything else."""
    for one in fields(options):
        name = f"{type(options).__name__}.{one.name}"
        if one.type == "float":
            number(getattr(options, one.name), name)
        elif one.type == "int":
            whole_number(getattr(options, one.name), name, 0)
