"""The public names of ``hemivar.certificates.continuous`` and where each comes from; loaded on first use."""

from .exact_certificate import distance_to_exact as distance_to_exact
from .exact_distance import DistanceParts as DistanceParts
from .exact_distance import ExactDistance as ExactDistance
from .exact_distance import exact_distance as exact_distance
from .lower_bounds import LowerBound as LowerBound
from .lower_bounds import LowerBounds as LowerBounds
from .lower_bounds import lower_bounds as lower_bounds
from .trace_bounds import body_constants as body_constants
