"""Figures, tables and files of results."""

from hemivar.report.figures import (
    Arrows,
    plot_contact,
    plot_errors,
    plot_history,
    plot_solution,
    save,
)
from hemivar.report.scene import render_solution
from hemivar.report.survey import SurveyResult, run_survey
from hemivar.report.tables import PAPER_TABLE_1, Table, comparison_table

__all__ = [
    "PAPER_TABLE_1",
    "Arrows",
    "SurveyResult",
    "Table",
    "comparison_table",
    "plot_contact",
    "plot_errors",
    "plot_history",
    "plot_solution",
    "render_solution",
    "run_survey",
    "save",
]
