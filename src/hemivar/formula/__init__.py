"""Formulas that users write: read safely, differentiated, bounded by intervals."""

from hemivar.formula.condition import Condition
from hemivar.formula.formula import Formula, FormulaArray, ScalarFormula
from hemivar.formula.reader import CONSTANTS, FUNCTIONS, TIME, VARIABLES

__all__ = ["CONSTANTS", "FUNCTIONS", "TIME", "VARIABLES", "Condition", "Formula", "FormulaArray", "ScalarFormula"]
