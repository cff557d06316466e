"""Files: problems as they are stated, results as they are kept."""

from hemivar.files.contact_rows import contact_columns, write_csv
from hemivar.files.earlier import read_solution
from hemivar.files.problem_file import ProblemFile, SolverSettings, read_problem, read_problem_file, write_problem
from hemivar.files.record import read_json, solution_record, write_json
from hemivar.files.vtu import write_vtu

__all__ = [
    "ProblemFile",
    "SolverSettings",
    "contact_columns",
    "read_json",
    "read_problem",
    "read_problem_file",
    "read_solution",
    "solution_record",
    "write_csv",
    "write_json",
    "write_problem",
    "write_vtu",
]
