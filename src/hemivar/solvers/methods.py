"""The registry of methods by the names that the command, the tables and ``solve(method=...)`` use."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from hemivar.basics.arguments import described, quoted, suggest
from hemivar.basics.defined_above import MISSING, defined_above
from hemivar.basics.first_use import cached_property
from hemivar.errors import MethodError
from hemivar.solvers.base import Solver
from hemivar.solvers.controls import Controls
from hemivar.solvers.multigrid import NonsmoothMultigrid
from hemivar.solvers.newton import NonsmoothNewton

__all__ = ["METHODS", "as_method", "method_named"]


class _Methods(Mapping[str, Solver]):
    """The two methods of this package, and those of :mod:`hemivar.survey` where it is installed."""

    @cached_property
    def _known(self) -> dict[str, Solver]:
        further = defined_above("methods.further_methods")
        methods = (NonsmoothNewton(), NonsmoothMultigrid(), *(() if further is None else further()))
        return {method.name: method for method in methods}

    def __getitem__(self, name: str) -> Solver:
        return self._known[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._known)

    def __len__(self) -> int:
        return len(self._known)


#: Every method with its standard options, by the name that the command and the tables use.
METHODS: Mapping[str, Solver] = _Methods()


def method_named(name: str) -> Solver:
    """The method of a name, with its standard options.

    Raises MethodError: there is no such method; the message lists all.
    """
    if name not in METHODS:
        rest = f"; the methods of the survey are part of hemivar.survey, which is {MISSING}"
        missing = defined_above("methods.further_methods") is None
        raise MethodError(f"method {quoted(name)} is not known{suggest(name, list(METHODS))}{rest if missing else ''}")
    return METHODS[name]


def as_method(method: object) -> Solver | None:
    """A method given by its name or as an object, as an object; None stays None.

    Raises MethodError: there is no such method, or it is neither a name nor a method.
    """
    if method is None or isinstance(method, Solver):
        return method
    if isinstance(method, str):
        return method_named(method)
    if isinstance(method, Controls):
        raise MethodError("the controls are given instead of the method; pass them by name, controls=...")
    if isinstance(method, type) and issubclass(method, Solver):
        raise MethodError(f"the method is the class {method.__name__}; pass one with its options, {method.__name__}()")
    raise MethodError(f"the method is {described(method)}; pass NonsmoothNewton(), 'newton' or the like")
