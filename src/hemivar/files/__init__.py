"""Files: problems as they are stated, results as they are kept."""

from hemivar.files.problem import read_problem
from hemivar.files.results import contact_columns, read_json, solution_record, write_csv, write_json, write_vtu

__all__ = ["contact_columns", "read_json", "read_problem", "solution_record", "write_csv", "write_json", "write_vtu"]
