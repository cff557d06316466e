"""Content hashing: what a value is made of, as bytes that are the same in every process."""

from __future__ import annotations

import functools
import hashlib
import sys
import types
from collections.abc import Iterator, Mapping
from dataclasses import fields, is_dataclass
from enum import Enum
from pathlib import Path

import numpy as np

from hemivar.basics.types import AnyArray

__all__ = ["content", "digest_of"]

#: Fields that say where something stands or what it is called, and not what it is.
_ASIDE = ("where", "title", "units")
#: What counts of the names of a module that a function uses; of other things there only the kind.
_PLAIN = (int, float, complex, str, bytes, type(None), np.ndarray, np.generic, tuple, list, dict)
_CODE = (types.FunctionType, types.ModuleType)


def content(value: object) -> Iterator[bytes]:
    """The content of a value, piece by piece.

    Numbers and arrays by all their bits, dataclasses by their class's name and their fields (not by its code),
    functions by their code: names, constants, values that they enclose, defaults, and the numbers, arrays and
    functions of their module that they name, or of a module of the user's that they name. Addresses, names of files,
    what is kept for speed, installed packages, and what code reaches by other ways than by its name (imports within a
    function, files that it reads) do not count.
    """
    yield from _of(value, ())


def digest_of(*values: object) -> str:
    """The digest of the content of some values."""
    digest = hashlib.sha256()
    for value in values:
        for piece in content(value):
            digest.update(piece)
    return digest.hexdigest()


def _of(value: object, inside: tuple[int, ...]) -> Iterator[bytes]:
    if id(value) in inside:
        yield b"<again>"
        return
    kind = type(value)
    yield b"(" + _called(kind).encode()
    if isinstance(value, Enum):
        yield str(value.value).encode()
    elif isinstance(value, float):
        yield float(value).hex().encode()
    elif isinstance(value, bytes):
        yield value
    elif isinstance(value, int | complex | str | bool | type(None) | type(Ellipsis)):
        yield repr(value).encode()
    elif isinstance(value, np.ndarray | np.generic):
        yield from _array(np.asarray(value), inside)
    elif isinstance(value, types.ModuleType | type):
        yield getattr(value, "__qualname__", value.__name__).encode()
    else:
        for part in _parts(value):
            yield from _of(part, (*inside, id(value)))
    yield b")"


def _called(kind: type) -> str:
    """The name of a class, with its module where that is the user's; a script has another name in other processes."""
    root = kind.__module__.partition(".")[0]
    ours = root in ("hemivar", "numpy", "scipy") or root in sys.stdlib_module_names or root.startswith("__")
    return kind.__qualname__ if ours else f"{kind.__module__}:{kind.__qualname__}"


def _array(array: AnyArray, inside: tuple[int, ...]) -> Iterator[bytes]:
    yield f"{array.dtype.str}{array.shape}".encode()
    if array.dtype.hasobject:
        for entry in array.ravel().tolist():
            yield from _of(entry, inside)
    else:
        yield np.ascontiguousarray(array).tobytes()


def _parts(value: object) -> Iterator[object]:
    """What a composed value is made of."""
    if isinstance(value, Mapping):
        for key, entry in value.items():
            yield key
            yield entry
    elif isinstance(value, tuple | list):
        yield from value
    elif isinstance(value, set | frozenset):
        yield from sorted(value, key=repr)
    elif isinstance(value, types.FunctionType):
        yield from _function(value)
    elif isinstance(value, types.MethodType):
        yield value.__func__
        yield value.__self__
    elif isinstance(value, functools.partial):
        yield value.func
        yield value.args
        yield value.keywords
    elif isinstance(value, types.CodeType):
        yield from (value.co_code, value.co_names, value.co_varnames, value.co_freevars, value.co_consts)
    elif isinstance(value, types.BuiltinFunctionType | np.ufunc):
        yield value.__name__
    elif is_dataclass(value):
        for one in fields(value):
            if one.init and not one.name.startswith("_") and one.name not in _ASIDE:
                yield one.name
                yield getattr(value, one.name, None)
    elif callable(getattr(value, "tocsr", None)):
        matrix = value.tocsr()  # type: ignore[attr-defined]
        yield from (matrix.shape, matrix.indptr, matrix.indices, matrix.data)
    else:
        yield next((vars(one)["__call__"] for one in type(value).__mro__ if "__call__" in vars(one)), None)
        yield from sorted((name, entry) for name, entry in _own(value).items() if not name.startswith("__"))


def _own(value: object) -> dict[str, object]:
    names = [name for one in type(value).__mro__ for name in getattr(one, "__slots__", ())]
    return {**{name: getattr(value, name, None) for name in names}, **getattr(value, "__dict__", {})}


def _function(function: types.FunctionType) -> Iterator[object]:
    code = function.__code__
    yield function.__name__
    yield code
    yield function.__defaults__
    yield function.__kwdefaults__
    for cell in function.__closure__ or ():
        try:
            yield cell.cell_contents
        except ValueError:  # not bound yet
            yield None
    names = _named(code)
    for name in names:
        if name in function.__globals__:
            used = function.__globals__[name]
            yield _used(name, used)
            if isinstance(used, types.ModuleType):
                yield from _used_of(used, names, ())


def _used(name: str, value: object) -> tuple[str, object]:
    """What counts of something that a function names."""
    return name, value if isinstance(value, (*_PLAIN, *_CODE)) else type(value).__qualname__


def _used_of(module: types.ModuleType, names: list[str], inside: tuple[types.ModuleType, ...]) -> Iterator[object]:
    """What a function with these names uses of a module of the user's; packages that are installed do not change."""
    if module in inside or _installed(module):
        return
    for name in names:
        if name in vars(module):
            used = vars(module)[name]
            yield _used(name, used)
            if isinstance(used, types.ModuleType):
                yield from _used_of(used, names, (*inside, module))


def _installed(module: types.ModuleType) -> bool:
    """Whether a module belongs to Python, to this library or to a package that is installed."""
    root, file = module.__name__.partition(".")[0], getattr(module, "__file__", None) or ""
    parts = Path(file).parts
    return (
        root in sys.stdlib_module_names or root == "hemivar" or not {"site-packages", "dist-packages"}.isdisjoint(parts)
    )


def _named(code: types.CodeType) -> list[str]:
    """Names of a function and of those within it."""
    inner = [one for const in code.co_consts if isinstance(const, types.CodeType) for one in _named(const)]
    return sorted({*code.co_names, *inner})
