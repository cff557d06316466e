"""Laws of the user's own: tables, formulas and Python functions."""

from hemivar.laws.own.columns import BOUND_COLUMNS, LAW_COLUMNS, read_columns
from hemivar.laws.own.formula_law import FormulaLaw
from hemivar.laws.own.function_law import FunctionLaw
from hemivar.laws.own.table_law import read_law_table, table_law

__all__ = [
    "BOUND_COLUMNS",
    "LAW_COLUMNS",
    "FormulaLaw",
    "FunctionLaw",
    "read_columns",
    "read_law_table",
    "table_law",
]
