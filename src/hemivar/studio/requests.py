"""What a page may ask for, read from JSON with every field checked."""

from __future__ import annotations

import contextlib
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass

from hemivar.errors import ProblemError

__all__ = ["KINDS_OF_REQUEST", "MOST_CHARACTERS", "Request", "read_request", "request_of"]

#: What a page may ask for; "cancel" ends what is at work.
KINDS_OF_REQUEST = ("solve", "solutions", "path", "point", "energies", "cancel")
#: Characters of a message from a page.
MOST_CHARACTERS = 2**20


@dataclass(frozen=True)
class Request:
    """One request of a page.

    Attributes
    ----------
    kind : str
        One of :data:`KINDS_OF_REQUEST`.
    generation : int
        Its number, which every message of the answer has; the newest wins.
    text : str
        The problem file.
    shape : str
        Key of the shape that the page has, so that it is not sent again.
    index : int
        Point of the load path.
    upper : float
        Load factor up to which the path is followed.
    key : str
        The number of the text over which the energy is asked for, by its path joined by dots.
    low, high : float
        The range of its values.
    """

    kind: str
    generation: int
    text: str = ""
    shape: str = ""
    index: int = 0
    upper: float = 1.0
    key: str = ""
    low: float = 0.0
    high: float = 1.0


def read_request(message: str) -> Request:
    """A request from its JSON."""
    if len(message) > MOST_CHARACTERS:
        raise ProblemError(f"a message of {len(message)} characters; a page sends at most {MOST_CHARACTERS}")
    try:
        data = json.loads(message)
    except (ValueError, RecursionError):
        raise ProblemError("a message that is not JSON; send an object with type and generation") from None
    return request_of(data)


def request_of(data: object) -> Request:
    """A request from an object of JSON; raises as :func:`read_request`."""
    if not isinstance(data, Mapping):
        raise ProblemError("a message that is not an object; send one with type and generation")
    kind = data.get("type")
    if not isinstance(kind, str) or kind not in KINDS_OF_REQUEST:
        raise ProblemError(f"type is not a request; send one of {', '.join(KINDS_OF_REQUEST)}")
    text = _text(data, "text")
    if len(text) > MOST_CHARACTERS:
        raise ProblemError(f"text has {len(text)} characters; a page sends at most {MOST_CHARACTERS}")
    upper, low, high = (_real(data, name, usual) for name, usual in (("upper", 1.0), ("low", 0.0), ("high", 1.0)))
    if not 0.0 < upper < 1e9:
        raise ProblemError("upper must be a load factor; give a number greater than 0")
    if not low < high:
        raise ProblemError("low must lie below high; give the two ends of a range")
    generation, index = _whole(data, "generation", None), _whole(data, "index", 0)
    return Request(kind, generation, text, _text(data, "shape"), index, upper, _text(data, "key"), low, high)


def _text(data: Mapping[str, object], name: str) -> str:
    value = data.get(name, "")
    if not isinstance(value, str):
        raise ProblemError(f"{name} must be a text")
    return value


def _real(data: Mapping[str, object], name: str, usual: float) -> float:
    value = data.get(name, usual)
    if not isinstance(value, bool) and isinstance(value, int | float) and abs(value) < math.inf:
        with contextlib.suppress(OverflowError):  # a whole number of JSON may have hundreds of digits
            return float(value)
    raise ProblemError(f"{name} must be a number; give a finite one")


def _whole(data: Mapping[str, object], name: str, usual: int | None) -> int:
    value = data.get(name, usual)
    if (
        isinstance(value, bool) or not isinstance(value, int) or not 0 <= value < 2**53
    ):  # to which numbers of a page are whole
        raise ProblemError(f"{name} must be a whole number of at least 0")
    return value
