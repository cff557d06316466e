"""The public names of ``hemivar.files`` and where each comes from; loaded on first use."""

from .changes import Change as Change
from .changes import read_change as read_change
from .contact_rows import contact_columns as contact_columns
from .contact_rows import write_csv as write_csv
from .film import Film as Film
from .film import film_of as film_of
from .film import read_film as read_film
from .history_table import history_frame as history_frame
from .history_table import history_record as history_record
from .history_table import read_history_table as read_history_table
from .history_table import write_history as write_history
from .history_table import write_history_json as write_history_json
from .problem_file import ProblemFile as ProblemFile
from .problem_file import read_problem as read_problem
from .problem_file import read_problem_file as read_problem_file
from .problem_file import write_problem as write_problem
from .record import read_json as read_json
from .record import solution_record as solution_record
from .record import write_json as write_json
from .settings import SolverSettings as SolverSettings
from .solution_reader import read_solution as read_solution
from .sweep_point import SweepPoint as SweepPoint
from .vtu import write_vtu as write_vtu
