"""The public names of ``hemivar.branches`` and where each comes from; loaded on first use."""

from .bracket import LoadBracket as LoadBracket
from .bracket import Reached as Reached
from .bracket import load_bracket as load_bracket
from .follow import PathOptions as PathOptions
from .follow import follow_path as follow_path
from .follower import PathProgress as PathProgress
from .path import Path as Path
from .search import SearchProgress as SearchProgress
from .solutions import SolutionSet as SolutionSet
from .solutions import SolutionsOptions as SolutionsOptions
from .solutions import find_solutions as find_solutions
