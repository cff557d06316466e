"""The discrete contact problem: what every solver and every certificate works on."""

from hemivar.discrete.problem import DiscreteProblem, FieldMap
from hemivar.discrete.residual import Residual, residual

__all__ = ["DiscreteProblem", "FieldMap", "Residual", "residual"]
