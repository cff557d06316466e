"""Problem files as text: a writer of TOML, values that are refused or should be, and mutations of text."""

from __future__ import annotations

import math
import random
from typing import Any

__all__ = ["dump", "leaves", "put", "spoilt", "strange_name", "strange_number", "strange_value"]

_BARE = frozenset("abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-")


def dump(data: dict[str, Any]) -> str:
    """TOML of nested dictionaries; tables inside tables are written inline."""
    lines = [f"{_key(k)} = {_value(v)}" for k, v in data.items() if not isinstance(v, dict)]
    for key, value in data.items():
        if isinstance(value, dict):
            lines.append(f"\n[{_key(key)}]")
            lines += [f"{_key(k)} = {_value(v)}" for k, v in value.items()]
    return "\n".join(lines) + "\n"


def _key(key: str) -> str:
    return key if key and set(key) <= _BARE else _text(key)


def _text(text: str) -> str:
    short = {'"': '\\"', "\\": "\\\\", "\n": "\\n", "\t": "\\t", "\r": "\\r"}
    return '"' + "".join(short.get(c, c if c.isprintable() else f"\\U{ord(c):08x}") for c in text) + '"'


def _value(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return _text(value)
    if isinstance(value, float):
        if math.isnan(value):
            return "nan"
        if math.isinf(value):
            return "inf" if value > 0 else "-inf"
        return repr(value)
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(_value, value)) + "]"
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{_key(k)} = {_value(v)}" for k, v in value.items()) + " }"
    return str(value)


def leaves(data: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """Paths of everything below the top: tables, lists and single values."""
    found = [path] if path else []
    if isinstance(data, dict):
        for key, value in data.items():
            found += leaves(value, (*path, key))
    elif isinstance(data, list):
        for index, value in enumerate(data):
            found += leaves(value, (*path, index))
    return found


def put(data: Any, path: tuple[Any, ...], value: Any) -> Any:
    """A copy of the data with another value at a path."""
    if not path:
        return value
    copy: Any = dict(data) if isinstance(data, dict) else list(data)
    copy[path[0]] = put(data[path[0]], path[1:], value)
    return copy


def strange_number(rng: random.Random) -> Any:
    """A number at the edge of what numbers can be."""
    return rng.choice(
        [
            0, -0.0, 1, -1, 2, 0.5, 1e-3, -1e-3, 1e-9, 1e9, 1e-17, 1e17, 1e-100, 1e100, 1e154, 1e155, -1e155, 1e160,
            1e200,
            1e-200, 1e300, -1e300, 1e308, -1e308, 1.7976931348623157e308, 5e-324, -5e-324, 2.2e-308, math.inf,
            -math.inf,
            math.nan, 2**31, 2**31 - 1, 2**53 + 1, 2**63, 2**64, 10**30, 10**400, -(10**30), 0.49, 0.4999, 0.5, 1.0,
            -0.999999, 1000, 30, 3.5,
        ]
    )  # fmt: skip


_NAMES = [
    "", " ", "\0", "a\0b", "\x1b[31mred\x1b[0m", "\x1b]0;title\x07", "\x9b31m", "\u202egnp.exe", "\u2028", "\ud7ff",
    "é", "边界",
    "😀", "a" * 300, "x" * 100_000, "../../etc/passwd", "-", "--help", "$(touch CANARY)", "`touch CANARY`",
    "'; touch CANARY",
    "$\\frac{1}{", "$", "\\input{/etc/passwd}", "[bold red]x[/]", "[/]", "{0.__class__}", "%s%n", "__class__", "nan",
    "\r\n",
    "hemivar: error: x\nTraceback (most recent", "\ufeff", "\u200b", "<b>&amp;</b>", "null", "true",
]  # fmt: skip


def strange_name(rng: random.Random) -> str:
    """A text that names nothing, or tries to be more than a text."""
    return rng.choice(_NAMES)


def strange_value(rng: random.Random) -> Any:
    """Anything that TOML can hold."""
    deep: Any = 1.0
    for _ in range(rng.choice([3, 30, 90])):
        deep = [deep] if rng.random() < 0.5 else {"a": deep}
    return rng.choice(
        [
            strange_number(rng), strange_number(rng), strange_number(rng), strange_number(rng), strange_name(rng),
            strange_name(rng), True, False, [], {}, [[]], [1.0], [1, 2, 3], [1.0, "x"], [math.nan, 1.0],
            {"law": "none"},
            {"x": 1.0}, [{}], deep, "1", "x", "1e400", "0*x", "r", [0.0] * 1000,
            "__import__('os').system('touch CANARY')",
        ]
    )  # fmt: skip


def spoilt(text: bytes, rng: random.Random) -> tuple[bytes, str]:
    """Bytes with something done to them, and what."""
    size = len(text)
    place = rng.randrange(size + 1)
    match rng.randrange(14):
        case 0:
            return text[:place], f"cut after {place} bytes"
        case 1:
            data = bytearray(text)
            for _ in range(rng.choice([1, 1, 2, 5, 50])):
                if data:
                    data[rng.randrange(len(data))] = rng.randrange(256)
            return bytes(data), "bytes replaced"
        case 2:
            return text[:place] + rng.randbytes(rng.choice([1, 4, 100])) + text[place:], "bytes put in"
        case 3:
            return text[:place] + text[place + rng.choice([1, 3, 20]) :], "bytes taken out"
        case 4:
            return b"\xef\xbb\xbf" + text, "with a byte order mark"
        case 5:
            return text.replace(b"\n", b"\r\n"), "with line ends of Windows"
        case 6:
            return text.replace(b"\n", b"\r"), "with line ends of old"
        case 7:
            return text.decode("utf-8", "replace").encode("utf-16"), "in UTF-16"
        case 8:
            return text[:place] + b"\0" + text[place:], "with a NUL"
        case 9:
            return text + text, "twice"
        case 10:
            lines = text.splitlines(keepends=True)
            rng.shuffle(lines)
            return b"".join(lines), "lines shuffled"
        case 11:
            lines = text.splitlines(keepends=True) or [b""]
            line = rng.randrange(len(lines))
            return b"".join(lines[:line] + [lines[line]] * 2 + lines[line + 1 :]), f"line {line + 1} doubled"
        case 12:
            lines = text.splitlines(keepends=True) or [b""]
            line = rng.randrange(len(lines))
            return b"".join(lines[:line] + lines[line + 1 :]), f"line {line + 1} left out"
        case _:
            mark = rng.choice(
                [b"#", b'"', b"'", b"[", b"]", b"{", b"}", b",", b"=", b".", b"\\", b"\xff", b"-", b"e", b"\x1b"]
            )
            return text[:place] + mark * rng.choice([1, 1, 3, 10_000]) + text[place:], f"{mark!r} put in"
