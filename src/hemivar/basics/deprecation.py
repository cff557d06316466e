"""Names that go: how a user is told, and when."""

from __future__ import annotations

import functools
import warnings
from collections.abc import Callable
from typing import ParamSpec, TypeVar

__all__ = ["deprecated"]

Parameters = ParamSpec("Parameters")
Result = TypeVar("Result")


def deprecated(
    since: str, removed: str, instead: str
) -> Callable[[Callable[Parameters, Result]], Callable[Parameters, Result]]:
    """Mark a function that goes: calling it warns once for each place, and its docstring says it.

    Parameters
    ----------
    since, removed : str
        Versions: from which it warns, and in which it is gone; two minor versions lie between them at least.
    instead : str
        What to write instead, as the reader would.

    Raises
    ------
    ValueError
        If less than two minor versions lie between ``since`` and ``removed`` and it is no new major one.
    """
    first, last = _numbers(since), _numbers(removed)
    if not (last[0] > first[0] or (last[0] == first[0] and last[1] >= first[1] + 2)):
        raise ValueError(f"{removed} comes too soon after {since}: two minor versions lie between warning and removal")

    def mark(function: Callable[Parameters, Result]) -> Callable[Parameters, Result]:
        words = f"{function.__name__} is deprecated since hemivar {since} and goes in {removed}; use {instead}"

        @functools.wraps(function)
        def warned(*arguments: Parameters.args, **named: Parameters.kwargs) -> Result:
            warnings.warn(words, DeprecationWarning, stacklevel=2)
            return function(*arguments, **named)

        warned.__doc__ = f"{(function.__doc__ or '').rstrip()}\n\n    .. deprecated:: {since}\n        Use {instead}.\n"
        return warned

    return mark


def _numbers(version: str) -> tuple[int, int]:
    major, minor = version.split(".")[:2]
    return int(major), int(minor)
