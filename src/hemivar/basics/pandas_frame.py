"""Tables for pandas, where it is installed."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from hemivar.basics.first_use import IMPORTS
from hemivar.errors import ProblemError

if TYPE_CHECKING:
    from pandas import DataFrame

__all__ = ["data_frame"]


def data_frame(columns: Mapping[str, object], instead: str) -> DataFrame:
    """Columns as a pandas DataFrame."""
    try:
        with IMPORTS:
            import pandas
    except ImportError as error:
        raise ProblemError(f"pandas is not installed; pip install pandas, or take {instead}") from error
    return pandas.DataFrame(dict(columns))
