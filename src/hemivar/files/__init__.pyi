"""The public names of ``hemivar.files`` and where each comes from; loaded on first use."""

from .changes import Change as Change
from .contact_rows import write_csv as write_csv
from .problem_file import read_problem as read_problem
from .problem_file import read_problem_file as read_problem_file
from .problem_file import write_problem as write_problem
from .record import solution_record as solution_record
from .record import write_json as write_json
from .solution_reader import read_solution as read_solution
from .vtu import write_vtu as write_vtu
