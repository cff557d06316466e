"""Laws with parameters that may vary over the contact boundary: base classes of the named laws."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import fields, replace
from typing import Self

import numpy as np

from hemivar.basics.first_use import cached_property
from hemivar.basics.types import Array, IntArray
from hemivar.laws.parameters import common_rows, field_values, read_formulas
from hemivar.laws.piecewise import PiecewiseQuadratic, TabulatedLaw
from hemivar.laws.superpotential import Superpotential

__all__ = ["NamedLaw", "ParameterLaw", "columns"]


def columns(*values: Array | float) -> Array:
    """Values for each contact point side by side, shape (m or 1, K)."""
    return np.stack(np.broadcast_arrays(*(np.atleast_1d(np.asarray(v, dtype=float)) for v in values)), axis=-1)


class ParameterLaw(Superpotential):
    """A law whose dataclass fields are parameters, which say their limits; ``None`` if left out.

    See :func:`hemivar.laws.parameters.parameter`.
    """

    def __post_init__(self) -> None:
        read_formulas(self, f"law '{self.name}'")  # type: ignore[arg-type]

    def _values(self, points: Array | None) -> dict[str, Array]:
        numbers = field_values(self, points, f"law '{self.name}'")  # type: ignore[arg-type]
        common_rows(f"law '{self.name}'", *(value.size for value in numbers.values()))
        return numbers

    @property
    def stated(self) -> Mapping[str, object]:
        return {"law": self.name} | {f.name: getattr(self, f.name) for f in fields(self)}  # type: ignore[arg-type]

    def at(self, points: Array | None) -> Self:
        values = self._values(points)
        return replace(self, **values)  # type: ignore[type-var]

    def take(self, index: IntArray) -> Self:
        values = self._values(None)
        if all(value.size == 1 for value in values.values()):
            return self  # with what it knows of itself
        taken = {key: value if value.size == 1 else value[index] for key, value in values.items()}
        return replace(self, **taken)  # type: ignore[type-var]


class NamedLaw(ParameterLaw, TabulatedLaw):
    """A named law that is a piecewise-quadratic table once its parameters are known."""

    @abstractmethod
    def _build(self, values: dict[str, Array]) -> PiecewiseQuadratic:
        """The table for checked parameter values."""

    @cached_property
    def table(self) -> PiecewiseQuadratic:  # type: ignore[override]
        """The piecewise-quadratic table of this law."""
        return self._build(self._values(None))
