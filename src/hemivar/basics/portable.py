"""Pickling and copies of frozen objects: what was stated travels, what was computed from it on the way does not."""

from __future__ import annotations

import copy
import functools
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from types import FunctionType, MappingProxyType, MethodType
from typing import TYPE_CHECKING, Self

from hemivar.basics.display import brief
from hemivar.errors import ProblemError

if TYPE_CHECKING:
    from hemivar.basics.types import AnyArray

__all__ = ["PickleMixin"]


class PickleMixin:
    """Base of frozen classes whose objects can be pickled and copied.

    Cached properties are left behind and computed again when they are asked for; read-only arrays and mappings
    arrive read-only. :func:`copy.copy` shares everything, caches included: the object
    is frozen.

    Raises
    ------
    ProblemError
        When pickled: an attribute is a function that another process could not import, a lambda for instance.  With
        cloudpickle or dill, which send such functions, they are left to these.
    """

    def __init_subclass__(cls, **options: object) -> None:
        """A dataclass is shown in a line or two: the decorator leaves a ``__repr__`` that is there."""
        super().__init_subclass__(**options)
        if "__repr__" not in vars(cls) and cls.__repr__ in (object.__repr__, brief):
            cls.__repr__ = brief  # type: ignore[method-assign]

    def _stated(self) -> dict[str, object]:
        """The attributes that travel."""
        dropped: set[str] = set()
        for base in type(self).__mro__:
            dropped.update(name for name, value in vars(base).items() if isinstance(value, cached_property))
        return {name: _packed(value) for name, value in vars(self).items() if name not in dropped}

    def __getstate__(self) -> dict[str, object]:
        state = self._stated()
        if not {"cloudpickle", "dill"} & sys.modules.keys():
            if not _importable(type(self)):
                raise ProblemError(
                    f"{type(self).__qualname__} objects cannot be pickled: the class is not at the top level of a "
                    "module, where another process could import it; move it there"
                )
            for name, value in state.items():
                _check_functions(self, name, value)
        return state

    def __setstate__(self, state: dict[str, object]) -> None:
        for name, value in state.items():
            object.__setattr__(self, name, _unpacked(value))

    def __copy__(self) -> Self:
        other = object.__new__(type(self))
        vars(other).update(vars(self))
        return other

    def __deepcopy__(self, memo: dict[int, object]) -> Self:
        other = object.__new__(type(self))
        memo[id(self)] = other
        other.__setstate__(copy.deepcopy(self._stated(), memo))
        return other


@dataclass(frozen=True, eq=False)
class _ReadOnly:
    """An array or a dictionary that was read-only."""

    value: AnyArray | dict[object, object]


def _packed(value: object) -> object:
    if isinstance(value, MappingProxyType):
        return _ReadOnly({key: _packed(item) for key, item in value.items()})
    if isinstance(value, dict):
        return {key: _packed(item) for key, item in value.items()}
    numpy = sys.modules.get("numpy")  # without it nothing is an array: the command does not load it for its help
    if numpy is not None and isinstance(value, numpy.ndarray) and not value.flags.writeable:
        return _ReadOnly(value)
    return value


def _unpacked(value: object) -> object:
    if isinstance(value, dict):
        return {key: _unpacked(item) for key, item in value.items()}
    if not isinstance(value, _ReadOnly):
        return value
    if isinstance(value.value, dict):
        return MappingProxyType({key: _unpacked(item) for key, item in value.value.items()})
    value.value.flags.writeable = False
    return value.value


def _check_functions(owner: PickleMixin, name: str, value: object) -> None:
    """Refuse functions that plain pickle cannot send, in the words of who gave them."""
    if isinstance(value, _ReadOnly):
        value = value.value
    if isinstance(value, Mapping):
        for key, item in value.items():
            _check_functions(owner, f"{name}[{key!r}]", item)
    elif isinstance(value, tuple | list):
        for item in value:
            _check_functions(owner, name, item)
    elif isinstance(value, functools.partial):
        _check_functions(owner, name, (value.func, *value.args, *value.keywords.values()))
    elif isinstance(value, FunctionType) and not _importable(value):
        called = getattr(owner, "name", None)
        which = f" '{called}'" if isinstance(called, str) else ""
        raise ProblemError(
            f"{type(owner).__name__.lstrip('_')}{which} cannot be pickled: its {name.lstrip('_')} is the "
            f"function {value.__qualname__}; define it with def at the top level of a module, or give a formula as text"
        )
    elif isinstance(value, MethodType):
        _check_functions(owner, name, value.__func__)


def _importable(function: type | FunctionType) -> bool:
    reached: object = sys.modules.get(function.__module__)
    for part in function.__qualname__.split("."):
        reached = getattr(reached, part, None)
    return reached is function
