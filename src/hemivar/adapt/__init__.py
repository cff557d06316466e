"""The distance of a computed displacement to the exact one, meshes that adapt to it, and quantities of interest."""

from hemivar.adapt.adaptive import AdaptiveLevel, AdaptiveSolution, solve_adaptive, solving_adaptive
from hemivar.adapt.adaptive_end import AdaptiveEnd
from hemivar.adapt.body_constants import body_constants
from hemivar.adapt.exact_certificate import distance_to_exact
from hemivar.adapt.exact_distance import DistanceParts, ExactDistance, exact_distance
from hemivar.adapt.goal_values import GoalValue, goal_value
from hemivar.adapt.goals import Goal, GoalKind, goal_named, known_goals
from hemivar.certify.lower_bounds import LowerBound, LowerBounds, lower_bounds

__all__ = [
    "AdaptiveEnd",
    "AdaptiveLevel",
    "AdaptiveSolution",
    "DistanceParts",
    "ExactDistance",
    "Goal",
    "GoalKind",
    "GoalValue",
    "LowerBound",
    "LowerBounds",
    "body_constants",
    "distance_to_exact",
    "exact_distance",
    "goal_named",
    "goal_value",
    "known_goals",
    "lower_bounds",
    "solve_adaptive",
    "solving_adaptive",
]
