"""Formulas that users write: read safely, differentiated, bounded by intervals."""

from hemivar.formula.formula import CONSTANTS, FUNCTIONS, VARIABLES, Formula, FormulaArray, ScalarFormula

__all__ = ["CONSTANTS", "FUNCTIONS", "VARIABLES", "Formula", "FormulaArray", "ScalarFormula"]
