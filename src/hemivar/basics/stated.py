"""Metadata of the fields of a statement: what each is in a problem file, beside the field.

    rho: float = field(default=0.8, metadata=stated(Form.NUMBER, "spectral radius", least=0.0, most=1.0))

:mod:`hemivar.files.schema` reads and writes such fields, and the page of the problem file is held against them.  What
is made by a function has its arguments stated by :func:`stating`, above it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import Field, dataclass, fields, is_dataclass
from enum import StrEnum
from functools import cache
from inspect import Parameter, signature
from typing import TYPE_CHECKING, TypeVar

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

__all__ = [
    "OF_ONE",
    "Argument",
    "CheckedFields",
    "Form",
    "Stated",
    "arguments_of",
    "kept",
    "keys_of",
    "stated",
    "stated_fields",
    "stated_of_one",
    "stating",
]

#: The metadata of fields in files of one component.
OF_ONE = "one component"

Made = TypeVar("Made", bound=Callable[..., object])


class Form(StrEnum):
    """How a value is written."""

    NUMBER = "number"
    WHOLE = "whole"
    """A whole number."""
    FLAG = "flag"
    """true or false."""
    TEXT = "text"
    """A text, one of the choices if there are any."""
    FILE = "file"
    """The name of a file, with one of the endings if there are any."""
    POINT = "point"
    """A number for each direction."""
    POINTS = "points"
    """A point, or a list of points."""
    QUANTITY = "quantity"
    """A number, or a formula of the place."""
    VECTOR = "vector"
    """A number or a formula for each direction."""
    TORQUE = "torque"
    """A number or a formula, in space one for each direction."""
    LIST = "list"
    """A list of numbers."""
    TENSOR = "tensor"
    """A quantity, or a row of them for each direction."""
    STRESS = "stress"
    """Of a stress or a strain: such rows, or three rows of three, of the plane as well."""
    PAIR = "pair"
    """Two quantities, Lame's constants."""
    MATRIX = "matrix"
    """Rows of quantities between strain and stress; what is said is its name."""
    OWN = "own"
    """Read and written by a function of its own."""


@dataclass(frozen=True)
class Stated:
    """What a field is in a problem file."""

    form: Form
    says: str = ""  # what the page of the problem file says of it
    key: str = ""  # its name in files, if it has another one there
    above: float | None = None
    below: float | None = None
    least: float | None = None
    most: float | None = None
    choices: tuple[str, ...] = ()  # texts that are known
    endings: tuple[str, ...] = ()  # endings of names of files
    timed: bool = False  # whether a formula may use the time
    left_out: str = ""  # what the page says of a file that leaves it out
    by: str = ""  # "boundary" or "region" where there is a value for each that is named
    table: str = ""  # of a class that several tables state: which of them states it
    unit: str = ""  # in terms of force and length
    example: object = None  # A value that shows what it does
    instead: str = ""  # the argument that it takes the place of, if there is one

    @property
    def lowest(self) -> float:
        """The lower limit of a number, be it allowed or not; -inf if there is none."""
        return next((limit for limit in (self.least, self.above) if limit is not None), -math.inf)


def stated(form: Form, says: str = "", **how: object) -> dict[str, Stated]:
    """The metadata of a field that a problem file states; ``how`` are other attributes of :class:`Stated`."""
    return {"stated": Stated(form, says, **how)}  # type: ignore[arg-type]


def stated_of_one(form: Form, says: str = "", **how: object) -> dict[str, Stated]:
    """What a file of one component says of a field, beside :func:`stated` or without it."""
    return {OF_ONE: Stated(form, says, **how)}  # type: ignore[arg-type]


def stated_fields(
    kind: DataclassInstance | type[DataclassInstance], table: str = "", by: str = "stated"
) -> dict[str, tuple[Field[object], Stated]]:
    """The fields of a dataclass that a problem file states, in one of several tables, by their keys in files.

    ``by`` is the name of their metadata: files of one component have :data:`OF_ONE`, their materials the kind.
    """
    stated = {one.metadata[by].key or one.name: (one, one.metadata[by]) for one in fields(kind) if by in one.metadata}
    return {key: both for key, both in stated.items() if both[1].table == table}


def keys_of(
    *kinds: DataclassInstance | type[DataclassInstance], table: str = "", by: str = "stated"
) -> tuple[str, ...]:
    """The keys of dataclasses in a table of a problem file."""
    return tuple(key for kind in kinds for key in stated_fields(kind, table, by))


def kept(check: Callable[..., object], *how: object, shown: str = "{}") -> dict[str, object]:
    """The metadata of a field that :class:`CheckedFields` keeps as ``check(value, name, *how)`` returns it.

    The name is that of the field as messages show it.
    """
    return {"kept": lambda value, name: check(value, shown.format(name), *how)}


class CheckedFields:
    """A frozen dataclass, each field of which is checked once and kept as its metadata say; None as a default is."""

    def __post_init__(self) -> None:
        for one in fields(self):  # type: ignore[arg-type]
            keep = one.metadata.get("kept")
            if keep and not (getattr(self, one.name) is None is one.default):
                object.__setattr__(self, one.name, keep(getattr(self, one.name), one.name))


# ---- what makes something by name ---------------------------------------------------------------------------


@dataclass(frozen=True)
class Argument:
    """A stated argument of what makes a law or a material."""

    key: str  # its name in files
    name: str  # its name in Python
    stated: Stated
    default: object  # none if there is none
    required: bool  # whether it must be given

    @property
    def shown(self) -> object:
        """A value to show what is made with; None to leave the argument out."""
        if self.stated.example is not None:
            return self.stated.example
        return 1.0 if self.required else self.default


def stating(*kinds: type[DataclassInstance], **own: Mapping[str, Stated]) -> Callable[[Made], Made]:
    """Say what the arguments of a function are in problem files: what dataclasses say of fields so named, or more."""
    metadata = {one.name: one.metadata for kind in kinds for one in fields(kind)} | own

    def mark(maker: Made) -> Made:
        maker.__stated__ = metadata  # type: ignore[attr-defined]
        return maker

    return mark


@cache
def arguments_of(maker: Callable[..., object]) -> tuple[Argument, ...]:
    """The stated arguments of a dataclass, or of a function under :func:`stating`, in their order."""
    metadata = (
        {one.name: one.metadata for one in fields(maker)} if is_dataclass(maker) else getattr(maker, "__stated__", {})
    )
    return tuple(
        _argument(one, metadata[name]["stated"])
        for name, one in signature(maker).parameters.items()
        if "stated" in metadata.get(name, ())
    )


def _argument(one: Parameter, stated: Stated) -> Argument:
    required = one.default is Parameter.empty
    none = required or one.default == ()
    return Argument(stated.key or one.name, one.name, stated, None if none else one.default, required)
