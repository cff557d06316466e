"""Figures, tables and files of results."""

from hemivar.report.bodies import plot_solution
from hemivar.report.contact_curves import plot_contact
from hemivar.report.histories import observed_order, plot_errors, plot_history
from hemivar.report.law_figures import plot_law
from hemivar.report.path_diagrams import plot_path
from hemivar.report.plane_body import Arrows
from hemivar.report.saving import save
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
    "plot_law",
    "plot_path",
    "plot_solution",
    "render_solution",
    "run_survey",
    "save",
]
