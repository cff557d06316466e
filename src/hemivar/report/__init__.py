"""Figures, tables and files of results."""

from hemivar.basics.units import Units
from hemivar.report.adaptive_figures import plot_adaptive, plot_meshes
from hemivar.report.animation import animate
from hemivar.report.bodies import plot_solution
from hemivar.report.body_colour import BodyColour
from hemivar.report.certificate_figure import plot_certificate
from hemivar.report.contact_curves import plot_contact
from hemivar.report.film_pictures import FilmColour
from hemivar.report.histories import plot_errors, plot_history
from hemivar.report.identification_figure import fit_table, plot_fit
from hemivar.report.law_figures import plot_law, plot_laws
from hemivar.report.march_figures import MARCH_FIGURES, plot_march
from hemivar.report.paper import Legend, paper
from hemivar.report.path_diagrams import plot_path
from hemivar.report.plane_body import Arrows
from hemivar.report.saving import save
from hemivar.report.scene import render_solution
from hemivar.report.solution_pictures import plot_solutions
from hemivar.report.statement_figure import plot_problem
from hemivar.report.study_figures import plot_study, plot_sweep
from hemivar.report.study_tables import study_table, sweep_table
from hemivar.report.survey import SurveyReport, run_survey
from hemivar.report.tables import PAPER_TABLE_1, Table, adaptive_table, comparison_table

__all__ = [
    "MARCH_FIGURES",
    "PAPER_TABLE_1",
    "Arrows",
    "BodyColour",
    "FilmColour",
    "Legend",
    "SurveyReport",
    "Table",
    "Units",
    "adaptive_table",
    "animate",
    "comparison_table",
    "fit_table",
    "paper",
    "plot_adaptive",
    "plot_certificate",
    "plot_contact",
    "plot_errors",
    "plot_fit",
    "plot_history",
    "plot_law",
    "plot_laws",
    "plot_march",
    "plot_meshes",
    "plot_path",
    "plot_problem",
    "plot_solution",
    "plot_solutions",
    "plot_study",
    "plot_sweep",
    "render_solution",
    "run_survey",
    "save",
    "study_table",
    "sweep_table",
]
