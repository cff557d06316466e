"""Formulas that users write: read safely, differentiated, bounded by intervals."""

from hemivar.formula.formula import Formula, FormulaArray

__all__ = ["Formula", "FormulaArray"]
