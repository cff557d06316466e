"""Several solutions of one problem: all of them at one load, and the path that joins them over the load."""

from hemivar.branches.chain import Chain, chain_of
from hemivar.branches.follow import follow_path
from hemivar.branches.path import Fold, Jump, Path, PathEnd
from hemivar.branches.solutions import SolutionSet, find_solutions

__all__ = ["Chain", "Fold", "Jump", "Path", "PathEnd", "SolutionSet", "chain_of", "find_solutions", "follow_path"]
