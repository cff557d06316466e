"""Figures, tables and files of results."""

from hemivar.report.figures import (
    Arrows,
    observed_order,
    plot_contact,
    plot_errors,
    plot_history,
    plot_solution,
    save,
)
from hemivar.report.scene import render_solution
from hemivar.report.survey import SURVEY_METHODS, SurveyResult, run_survey
from hemivar.report.tables import PAPER_TABLE_1, Table, comparison_table, energy_norm_difference

__all__ = [
    "PAPER_TABLE_1",
    "SURVEY_METHODS",
    "Arrows",
    "SurveyResult",
    "Table",
    "comparison_table",
    "energy_norm_difference",
    "observed_order",
    "plot_contact",
    "plot_errors",
    "plot_history",
    "plot_solution",
    "render_solution",
    "run_survey",
    "save",
]
