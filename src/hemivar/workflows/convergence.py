"""Convergence: errors of a family of approximations over their size, orders, and the size that an accuracy needs."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from hemivar.basics.display import ReprMixin, brief
from hemivar.basics.first_use import cached_property
from hemivar.basics.portable import PickleMixin
from hemivar.basics.rows import Claim, Column, ResultRows, plain, two_decimals
from hemivar.basics.types import Array, BoolArray, Record
from hemivar.errors import ProblemError
from hemivar.workflows.events import Notice

__all__ = ["QUANTITIES", "Convergence", "ErrorLevel", "observed_order"]

#: Errors that a study tells, by name.
QUANTITIES = ("energy", "displacement", "pressure")


@dataclass(frozen=True, eq=False)
class ErrorLevel(Notice):
    """One approximation.

    Attributes
    ----------
    size : float
        The mesh size h, which is the length of the longest edge, or the step.
    energy, displacement, pressure : float
        Errors; nan while there is nothing to compare with.
    """

    size: float
    energy: float = field(default=math.nan, kw_only=True)
    displacement: float = field(default=math.nan, kw_only=True)
    pressure: float = field(default=math.nan, kw_only=True)

    __repr__ = brief

    @property
    def converged(self) -> bool:
        """Whether it is what was asked for."""
        raise NotImplementedError


@dataclass(frozen=True, eq=False, repr=False)
class Convergence(PickleMixin, ReprMixin):
    """Errors of approximations from coarse to fine, with their orders.

    Attributes
    ----------
    levels : tuple
        One for each approximation, from coarse to fine.
    norms : mapping of quantity to float
        The norms of the reference in which errors are.
    reference : str
        What the errors are against: ``"exact solution"``, or the finest of them.
    interrupted : bool
        Whether the work was stopped from the keyboard; what was done until then is here.
    """

    levels: tuple[ErrorLevel, ...]
    norms: Mapping[str, float]
    reference: str
    interrupted: bool

    #: What one of them is called, and its size.
    each: ClassVar[str]
    measured_by: ClassVar[str]

    def __repr__(self) -> str:
        orders = ", ".join(f"{name} {order:.2f}" for name, order in self.orders.items() if not math.isnan(order))
        sizes, size = self.sizes, self.measured_by.rpartition(" ")[2]
        whole = f"{len(sizes)} {self.each}, {size} {sizes[0]:.3g} to {sizes[-1]:.3g}, against the {self.reference}"
        return f"{type(self).__name__}({whole}; orders: {orders or 'none'}{self.remark})"

    @property
    def sizes(self) -> Array:
        """Mesh sizes h, or steps, from large to small."""
        return np.array([level.size for level in self.levels])

    @property
    def quantities(self) -> tuple[str, ...]:
        """Names of the errors that there are."""
        return tuple(name for name in QUANTITIES if np.isfinite(self.errors(name)).any())

    @property
    def remark(self) -> str:
        """What is said of it in a line, beside its sizes and orders."""
        return ""

    @property
    def bounds(self) -> Array:
        """Bounds of the errors in the energy norm, absolute; nan where none was asked for."""
        return np.full(len(self.levels), np.nan)

    @property
    def kind_of_bound(self) -> str:
        """What the bounds are called."""
        return "guaranteed bound"

    @property
    def converged(self) -> bool:
        """Whether all solves met their tolerances."""
        return all(level.converged for level in self.levels)

    def errors(self, quantity: str) -> Array:
        """The errors of a quantity on each mesh, absolute.

        Raises
        ------
        ProblemError
            The quantity is not known.
        """
        if quantity not in QUANTITIES:
            raise ProblemError(f"quantity '{quantity}' is not known; the quantities are {', '.join(QUANTITIES)}")
        return np.array([getattr(level, quantity) for level in self.levels])

    def relative(self, quantity: str) -> Array:
        """The errors of a quantity over the norm of the reference; nan where that is zero."""
        errors, norm = self.errors(quantity), self.norms[quantity]
        return errors / norm if norm > 0.0 else np.full_like(errors, np.nan)

    def steps(self, quantity: str) -> Array:
        """Observed orders from each mesh to the next, ``log(e_k-1 / e_k) / log(h_k-1 / h_k)``; nan for the first."""
        errors, sizes = self.errors(quantity), self.sizes
        with np.errstate(divide="ignore", invalid="ignore"):
            orders = np.log(errors[:-1] / errors[1:]) / np.log(sizes[:-1] / sizes[1:])
        return np.concatenate([[np.nan], np.where(np.isfinite(orders), orders, np.nan)])

    @cached_property
    def orders(self) -> dict[str, float]:
        """The order of each quantity, fitted to the errors on the finest four meshes that can be trusted.

        Where the finest mesh is the reference, the mesh before it shares much of its error, which makes its own look
        too small: it is left out.  nan with fewer than two meshes.
        """
        return {name: observed_order(self.sizes[self.trusted], self.errors(name)[self.trusted]) for name in QUANTITIES}

    def size_for(self, rtol: float, quantity: str = "energy") -> float:
        """The size for a relative error ``rtol`` of a quantity, by its order; nan where errors hardly fall."""
        errors, order = self.relative(quantity)[self.trusted], self.orders[quantity]
        if not errors.size or not errors[-1] > 0.0 or not order > 0.1:
            return math.nan
        return float(self.sizes[self.trusted][-1] * (rtol / errors[-1]) ** (1.0 / order))

    def rows(self, *, relative: bool = False) -> ResultRows:
        """A row for each approximation.

        ``relative``: errors in tables over the norms of the reference.
        """
        raise NotImplementedError

    def error_columns(self, relative: bool) -> list[Column]:
        """Errors of each quantity, and orders from the row before."""
        columns = [Column(None, [{} for _ in self.levels], name) for name in ("errors", "orders")]
        for name in self.quantities:
            errors = self.relative(name) if relative else self.errors(name)
            columns.append(Column(f"{name} error", errors, name, "errors", brief=name))
            columns.append(Column(f"{name} order", self.steps(name), name, "orders", brief="order", cell=two_decimals))
        return columns

    def claims(self) -> list[Claim]:
        """What the errors are of, and the fitted orders."""
        claims = [Claim("reference", self.reference)]
        for name in self.quantities:
            order = self.orders[name]
            fitted = f"too few {self.each} for an order" if math.isnan(order) else f"order {order:.2f}"
            finest = [value for value in self.relative(name) if not math.isnan(value)]
            claims.append(Claim(name, fitted + (f", relative error {finest[-1]:.3g}" if finest else ""), order))
        return claims

    def record(self) -> Record:
        """Plain numbers, lists and strings for JSON; what is not finite is null."""
        return {
            "reference": self.reference,
            "norms": {name: plain(self.norms[name]) for name in self.quantities},
            "orders": {name: plain(self.orders[name]) for name in self.quantities},
            "interrupted": self.interrupted,
            self.each: plain(self.rows()[:]),
        }

    @property
    def trusted(self) -> BoolArray:
        """Which meshes are far enough from the reference, bool (k,)."""
        count = len(self.levels)
        return np.arange(count) < (count if self.reference == "exact solution" else max(count - 2, 0))


def observed_order(sizes: Array, errors: Array, points: int = 4) -> float:
    """Slope of log(error) against log(h), fitted to the ``points`` smallest sizes; nan with fewer than two."""
    sizes, errors = np.asarray(sizes, dtype=float), np.asarray(errors, dtype=float)
    good = np.isfinite(errors) & (errors > 0.0)
    sizes, errors = sizes[good], errors[good]
    if len(sizes) < 2:
        return math.nan
    chosen = np.argsort(sizes)[:points]
    return float(np.polyfit(np.log(sizes[chosen]), np.log(errors[chosen]), 1)[0])
