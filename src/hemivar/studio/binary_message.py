"""Messages with arrays: a header in JSON, and behind it the numbers as they lie in memory."""

from __future__ import annotations

import json
import struct
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from hemivar.basics.types import AnyArray

__all__ = ["Message", "unpacked"]

#: Types of numbers that go to a page, little endian.
_TYPES = {"f": "<f4", "i": "<u4", "u": "<u4", "b": "<f4"}


@dataclass(frozen=True, eq=False)
class Message:
    """What goes to a page.

    Attributes
    ----------
    head : mapping
        ``type``, ``generation`` and whatever else, for JSON; numbers that are not finite become null.
    arrays : mapping of name to array
        Floats go as float32, whole numbers as uint32.
    """

    head: Mapping[str, object]
    arrays: Mapping[str, AnyArray] = field(default_factory=dict)

    def buffers(self) -> tuple[dict[str, object], list[bytes]]:
        """The head, which lists the arrays with their shapes and types, and the bytes of each."""
        listed, parts = [], []
        for name, values in self.arrays.items():
            plain = np.ascontiguousarray(values, dtype=_TYPES[np.asarray(values).dtype.kind])
            listed.append({"name": name, "shape": list(plain.shape), "type": plain.dtype.str})
            parts.append(plain.tobytes())
        return {**_finite(dict(self.head)), "arrays": listed}, parts  # type: ignore[dict-item]

    def packed(self) -> bytes:
        """One run of bytes: the length of the head (uint32), the head, blanks up to a multiple of 4, the arrays."""
        head, parts = self.buffers()
        text = json.dumps(head, allow_nan=False).encode()
        text += b" " * (-len(text) % 4)
        return struct.pack("<I", len(text)) + text + b"".join(parts)


def unpacked(data: bytes) -> tuple[dict[str, object], dict[str, AnyArray]]:
    """What :meth:`Message.packed` made, as the page reads it."""
    (length,) = struct.unpack_from("<I", data)
    head = json.loads(data[4 : 4 + length])
    at, arrays = 4 + length, {}
    for entry in head["arrays"]:
        count = int(np.prod(entry["shape"], dtype=np.int64))
        kind = np.dtype(entry["type"])
        arrays[entry["name"]] = np.frombuffer(data, kind, count, at).reshape(entry["shape"])
        at += count * kind.itemsize
    return head, arrays


def _finite(value: object) -> object:
    """The value for JSON, which has neither nan nor infinity."""
    if isinstance(value, Mapping):
        return {str(key): _finite(inner) for key, inner in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(inner) for inner in value]
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, np.ndarray):
        return _finite(value.tolist())
    return value if not isinstance(value, float) or np.isfinite(value) else None
