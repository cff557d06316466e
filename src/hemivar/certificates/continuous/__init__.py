"""The distance of a computed displacement to the exact solution: equilibrated stresses and trace constants."""

from hemivar.certificates.continuous.body_constants import body_constants
from hemivar.certificates.continuous.exact_certificate import distance_to_exact
from hemivar.certificates.continuous.exact_distance import DistanceParts, ExactDistance, exact_distance
from hemivar.certificates.continuous.lower_bounds import LowerBound, LowerBounds, lower_bounds

__all__ = [
    "DistanceParts",
    "ExactDistance",
    "LowerBound",
    "LowerBounds",
    "body_constants",
    "distance_to_exact",
    "exact_distance",
    "lower_bounds",
]
