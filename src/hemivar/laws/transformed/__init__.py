"""Laws made of laws: what a time step, a memory or a second foundation makes of a superpotential.

Each transformation takes laws with resolved parameters and one number for each contact point, and returns a law that
answers every question, its weak convexity among them.  Of piecewise-quadratic laws it makes such a law again, where the
class is closed.
"""

from hemivar.laws.transformed.affine import affine
from hemivar.laws.transformed.averages import averaged
from hemivar.laws.transformed.bonds import bonded
from hemivar.laws.transformed.envelopes import envelope
from hemivar.laws.transformed.pushing import pushing
from hemivar.laws.transformed.secants import secant
from hemivar.laws.transformed.slipped import slipped
from hemivar.laws.transformed.sums import plus

__all__ = ["affine", "averaged", "bonded", "envelope", "plus", "pushing", "secant", "slipped"]
