"""The methods by the names that the command, the tables and ``solve(method=...)`` use."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from hemivar.basics.arguments import described, quoted, suggest
from hemivar.errors import MethodError
from hemivar.solvers.base import Solver
from hemivar.solvers.controls import Controls
from hemivar.solvers.multigrid import NonsmoothMultigrid
from hemivar.solvers.newton import NonsmoothNewton
from hemivar.solvers.survey.active_set import ExactInner, NewtonKrylov, PrimalDualActiveSet
from hemivar.solvers.survey.augmented_lagrangian import AugmentedLagrangian, AugmentedLagrangianNewton
from hemivar.solvers.survey.bundle import ProximalBundle
from hemivar.solvers.survey.lbfgs import LBFGS
from hemivar.solvers.survey.powell import Powell

__all__ = ["METHODS", "as_method", "method_named"]

_ALL = (
    NonsmoothNewton(),
    NonsmoothMultigrid(),
    Powell(),
    LBFGS(),
    ProximalBundle(),
    AugmentedLagrangian(),
    AugmentedLagrangianNewton(),
    PrimalDualActiveSet(ExactInner()),
    PrimalDualActiveSet(NewtonKrylov()),
)

#: Every method with its standard options, by the name that the command and the tables use.
METHODS: Mapping[str, Solver] = MappingProxyType({method.name: method for method in _ALL})


def method_named(name: str) -> Solver:
    """The method of a name, with its standard options.

    Parameters
    ----------
    name : str
        A key of ``METHODS``, such as ``"newton"``.

    Returns
    -------
    Solver

    Raises
    ------
    MethodError
        There is no such method; the message lists all.
    """
    if name not in METHODS:
        raise MethodError(f"method {quoted(name)} is not known{suggest(name, list(METHODS))}")
    return METHODS[name]


def as_method(method: object) -> Solver | None:
    """A method given by its name or as an object, as an object; None stays None.

    Parameters
    ----------
    method : Solver, str or None

    Returns
    -------
    Solver or None

    Raises
    ------
    MethodError
        There is no such method, or it is neither a name nor a method.
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
