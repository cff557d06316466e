"""Meshes that adapt to the distance to the exact solution, and quantities of interest."""

from hemivar.adapt.adaptive import AdaptiveLevel, AdaptiveSolution, solve_adaptive, solving_adaptive
from hemivar.adapt.adaptive_end import AdaptiveEnd
from hemivar.adapt.goal_values import GoalValue, goal_value
from hemivar.adapt.goals import Goal, GoalKind, goal_named, known_goals

__all__ = [
    "AdaptiveEnd",
    "AdaptiveLevel",
    "AdaptiveSolution",
    "Goal",
    "GoalKind",
    "GoalValue",
    "goal_named",
    "goal_value",
    "known_goals",
    "solve_adaptive",
    "solving_adaptive",
]
