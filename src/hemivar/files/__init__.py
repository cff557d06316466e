"""Files: problems as they are stated, results as they are kept."""

from hemivar.files.changes import Change, read_change
from hemivar.files.contact_rows import contact_columns, write_csv
from hemivar.files.film import Film, film_of, read_film
from hemivar.files.history_table import (
    history_frame,
    history_record,
    read_history_table,
    write_history,
    write_history_json,
)
from hemivar.files.problem_file import ProblemFile, read_problem, read_problem_file, write_problem
from hemivar.files.record import read_json, solution_record, write_json
from hemivar.files.settings import SolverSettings
from hemivar.files.solution_reader import read_solution
from hemivar.files.sweep_point import SweepPoint
from hemivar.files.vtu import write_vtu

__all__ = [
    "Change",
    "Film",
    "ProblemFile",
    "SolverSettings",
    "SweepPoint",
    "contact_columns",
    "film_of",
    "history_frame",
    "history_record",
    "read_change",
    "read_film",
    "read_history_table",
    "read_json",
    "read_problem",
    "read_problem_file",
    "read_solution",
    "solution_record",
    "write_csv",
    "write_history",
    "write_history_json",
    "write_json",
    "write_problem",
    "write_vtu",
]
