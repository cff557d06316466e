"""The public names of ``hemivar.bounds`` and where each comes from; loaded on first use."""

from .adaptive import AdaptiveSolution as AdaptiveSolution
from .adaptive import solve_adaptive as solve_adaptive
from .exact_distance import ExactDistance as ExactDistance
from .exact_distance import exact_distance as exact_distance
from .goals import goal_named as goal_named
from .goals import known_goals as known_goals
from .lower_bounds import lower_bounds as lower_bounds
