"""What a field of a statement is in a problem file: told once, beside the field.

    rho: float = field(default=0.8, metadata=stated(Form.NUMBER, "spectral radius", least=0.0, most=1.0))

:mod:`hemivar.files.schema` reads and writes such fields, and the page of the problem file is held against them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import Field, dataclass, fields
from enum import StrEnum
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

__all__ = ["Form", "Stated", "keys_of", "stated", "stated_fields"]


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
    QUANTITY = "quantity"
    """A number, or a formula of the place."""
    VECTOR = "vector"
    """A number or a formula for each direction."""
    TENSOR = "tensor"
    """A quantity, or a row of them for each direction."""
    OWN = "own"
    """Read and written by a function of its own."""


@dataclass(frozen=True)
class Stated:
    """What a field is in a problem file.

    Attributes
    ----------
    form : Form
    says : str
        What the page of the problem file says of it.
    key : str
        Its name in files, if it has another one there.
    above, below, least, most : float or None
        Limits of a number, the first two excluded.
    choices : tuple of str
        Texts that are known.
    endings : tuple of str
        Endings of names of files.
    timed : bool
        Whether a formula may use the time.
    left_out : str
        What the page says of a file that leaves it out; its default is shown if this is empty.
    by : str
        "boundary" or "region" where there is a value for each that is named; one for all regions may stand in their
        place.
    table : str
        Of a class that several tables state: which of them states it.
    """

    form: Form
    says: str = ""
    key: str = ""
    above: float | None = None
    below: float | None = None
    least: float | None = None
    most: float | None = None
    choices: tuple[str, ...] = ()
    endings: tuple[str, ...] = ()
    timed: bool = False
    left_out: str = ""
    by: str = ""
    table: str = ""


def stated(form: Form, says: str = "", **how: object) -> Mapping[str, Stated]:
    """The metadata of a field that a problem file states; ``how`` are other attributes of :class:`Stated`."""
    return {"stated": Stated(form, says, **how)}  # type: ignore[arg-type]


def stated_fields(
    kind: DataclassInstance | type[DataclassInstance], table: str = ""
) -> dict[str, tuple[Field[object], Stated]]:
    """The fields of a dataclass that a problem file states, in one of several tables, by their keys in files."""
    found = {one.metadata["stated"].key or one.name: one for one in fields(kind) if "stated" in one.metadata}
    stated = {key: (one, one.metadata["stated"]) for key, one in found.items()}
    return {key: both for key, both in stated.items() if both[1].table == table}


def keys_of(*kinds: DataclassInstance | type[DataclassInstance], table: str = "") -> tuple[str, ...]:
    """The keys of dataclasses in a table of a problem file."""
    return tuple(key for kind in kinds for key in stated_fields(kind, table))
