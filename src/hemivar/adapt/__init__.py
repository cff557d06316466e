"""The distance of a computed displacement to the exact one, and meshes that adapt to it."""

from hemivar.adapt.adaptive import AdaptiveLevel, AdaptiveSolution, solve_adaptive, solving_adaptive
from hemivar.adapt.exact_distance import DistanceParts, ExactDistance, exact_distance
from hemivar.certify.lower_bounds import LowerBound, LowerBounds, lower_bounds

__all__ = [
    "AdaptiveLevel",
    "AdaptiveSolution",
    "DistanceParts",
    "ExactDistance",
    "LowerBound",
    "LowerBounds",
    "exact_distance",
    "lower_bounds",
    "solve_adaptive",
    "solving_adaptive",
]
