"""Files: problems as they are stated, results as they are kept."""

from hemivar.files.problem_file import ProblemFile, SolverSettings, read_problem, read_problem_file, write_problem
from hemivar.files.results import contact_columns, read_json, solution_record, write_csv, write_json, write_vtu

__all__ = [
    "ProblemFile",
    "SolverSettings",
    "contact_columns",
    "read_json",
    "read_problem",
    "read_problem_file",
    "solution_record",
    "write_csv",
    "write_json",
    "write_problem",
    "write_vtu",
]
