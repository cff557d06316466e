"""The public names of ``hemivar.bounds`` and where each comes from; loaded on first use."""

from .adaptive import AdaptiveLevel as AdaptiveLevel
from .adaptive import AdaptiveSolution as AdaptiveSolution
from .adaptive import solve_adaptive as solve_adaptive
from .adaptive import solving_adaptive as solving_adaptive
from .adaptive_end import AdaptiveEnd as AdaptiveEnd
from .exact_certificate import distance_to_exact as distance_to_exact
from .exact_distance import DistanceParts as DistanceParts
from .exact_distance import ExactDistance as ExactDistance
from .exact_distance import exact_distance as exact_distance
from .goal_values import GoalValue as GoalValue
from .goal_values import goal_value as goal_value
from .goals import Goal as Goal
from .goals import GoalKind as GoalKind
from .goals import goal_named as goal_named
from .goals import known_goals as known_goals
from .lower_bounds import LowerBound as LowerBound
from .lower_bounds import LowerBounds as LowerBounds
from .lower_bounds import lower_bounds as lower_bounds
from .stated_distance import DistanceToExact as DistanceToExact
from .trace_bounds import body_constants as body_constants
