"""Laws made of laws: what a time step, a memory or a second foundation makes of a superpotential.

Each transformation takes laws with resolved parameters and one number for each contact point, and returns a law that
answers every question, its weak convexity among them.  Of piecewise-quadratic laws it makes such a law again, where the
class is closed.
"""

from hemivar.laws.transformed.algebra import affine, plus, pushing, secant, slipped
from hemivar.laws.transformed.averages import averaged
from hemivar.laws.transformed.bonds import bonded
from hemivar.laws.transformed.envelopes import envelope

__all__ = ["affine", "averaged", "bonded", "envelope", "plus", "pushing", "secant", "slipped"]
