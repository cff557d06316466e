"""The discrete contact problem: what every solver and every certificate works on."""

from hemivar.discrete.bulk import Bulk, Quadratic
from hemivar.discrete.contact import ContactPoints
from hemivar.discrete.loading import Loading
from hemivar.discrete.model import Model
from hemivar.discrete.problem import DiscreteProblem
from hemivar.discrete.residual import residual
from hemivar.discrete.space import Field, Space

__all__ = ["Bulk", "ContactPoints", "DiscreteProblem", "Field", "Loading", "Model", "Quadratic", "Space", "residual"]
