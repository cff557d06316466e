"""The discrete contact problem: what every solver and every certificate works on."""

from hemivar.discrete.bulk import Bulk, Quadratic
from hemivar.discrete.contact import ContactPoints
from hemivar.discrete.problem import DiscreteProblem
from hemivar.discrete.residual import Residual, residual
from hemivar.discrete.space import Field, Space

__all__ = ["Bulk", "ContactPoints", "DiscreteProblem", "Field", "Quadratic", "Residual", "Space", "residual"]
