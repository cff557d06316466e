"""Several solutions of one problem: all of them at one load, and the path that joins them over the load."""

from hemivar.branches.chain import Chain, chain_of
from hemivar.branches.follow import PathOptions, follow_path, following
from hemivar.branches.follower import PathProgress
from hemivar.branches.path import Fold, Path, PathEnd, PathJump
from hemivar.branches.search import SearchProgress
from hemivar.branches.solutions import SolutionSet, SolutionsOptions, find_solutions, finding

__all__ = [
    "Chain",
    "Fold",
    "Path",
    "PathEnd",
    "PathJump",
    "PathOptions",
    "PathProgress",
    "SearchProgress",
    "SolutionSet",
    "SolutionsOptions",
    "chain_of",
    "find_solutions",
    "finding",
    "follow_path",
    "following",
]
