"""How objects show themselves: in a notebook, as a picture, as a table, and in a line at a prompt."""

from __future__ import annotations

import sys
from dataclasses import fields, is_dataclass
from enum import Enum
from types import FunctionType
from typing import TYPE_CHECKING

from hemivar.basics.defined_above import above

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from pandas import DataFrame

__all__ = ["ReprMixin", "brief"]

#: Characters of a field in a short description, and of the whole; numbers of an array that are told.
_FIELD, _WHOLE, _FEW = 90, 400, 6


class ReprMixin:
    """Base of classes that have a picture and a table, and that a notebook shows by both.

    What they show is written in one place, :mod:`hemivar.report.notebook`.
    """

    def _repr_html_(self) -> str:
        html: str = above("ReprMixin._repr_html_", f"{type(self).__name__}._repr_html_")(self)
        return html

    def plot(self) -> Figure:
        """A picture of it, which a notebook shows by itself; ``.savefig(path)`` writes it.

        The functions ``plot_...`` of ``hemivar.report`` draw the same with titles, units and more.

        Raises
        ------
        ProblemError
            There is nothing to draw.
        """
        figure: Figure = above("ReprMixin.plot", f"{type(self).__name__}.plot")(self)
        return figure

    def show(self) -> None:
        """Show :meth:`plot` in a window, or in the notebook.

        Raises
        ------
        ProblemError
            There is nothing to draw, or no window can be opened here.
        """
        above("ReprMixin.show", f"{type(self).__name__}.show")(self)

    def to_dataframe(self) -> DataFrame:
        """A pandas DataFrame of what it holds, a row for each of its parts.

        Raises
        ------
        ProblemError
            pandas is not installed.
        """
        frame: DataFrame = above("ReprMixin.to_dataframe", f"{type(self).__name__}.to_dataframe")(self)
        return frame


def brief(value: object) -> str:
    """The ``__repr__`` of a dataclass in a line or two, arrays by their shape and long entries by their number."""
    if not is_dataclass(value):
        return object.__repr__(value)
    entries = [f"{item.name}={_entry(getattr(value, item.name, None))}" for item in fields(value) if item.repr]
    text = f"{type(value).__name__}({', '.join(entries)})"
    return text if len(text) <= _WHOLE else text[: _WHOLE - 5] + " ...)"


def _entry(value: object) -> str:
    if isinstance(value, bool | int | str | None):
        text = str(value.value) if isinstance(value, Enum) else repr(value)
        return text if len(text) <= _FIELD else text[: _FIELD - 4] + f"...{text[-1]}"
    numpy = sys.modules.get("numpy")  # without it nothing is an array: the command does not load it for its help
    if numpy is not None and isinstance(value, numpy.generic):
        value = value.item()
    if isinstance(value, float):
        text = repr(value)
        return text if len(text) <= 8 else f"{value:.6g}"
    if numpy is not None and isinstance(value, numpy.ndarray):
        few = 0 < value.ndim <= 2 and value.size <= _FEW
        return f"[{', '.join(_entry(one) for one in value)}]" if few else f"array {value.shape}"
    if isinstance(value, tuple | list):
        parts = [_entry(one) for one in value[: _FIELD // 3]]
        text = ", ".join(parts)
        if len(value) <= _FIELD // 3 and len(text) <= _FIELD:
            return f"({text},)" if len(value) == 1 else f"({text})"
        return f"<{len(value)} entries>"
    if isinstance(value, FunctionType):
        return "<function>" if value.__name__ == "<lambda>" else f"<function {value.__name__}>"
    text = repr(value)
    return text if len(text) <= _FIELD and "\n" not in text else f"<{type(value).__name__}>"
