"""Formulas that users write: read safely, differentiated, bounded by intervals."""

from hemivar.formula.formula import Formula, FormulaArray, ScalarFormula
from hemivar.formula.reader import CONSTANTS, FUNCTIONS, VARIABLES

__all__ = ["CONSTANTS", "FUNCTIONS", "VARIABLES", "Formula", "FormulaArray", "ScalarFormula"]
