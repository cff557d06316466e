"""Whether a body is held: motions without energy, and what contact and its laws do along them."""

from hemivar.coercivity.recession import Growth, Held, Hold, Verdict, decide
from hemivar.coercivity.rigid_modes import FreeMotions, free_motions, rigid_basis

__all__ = ["FreeMotions", "Growth", "Held", "Hold", "Verdict", "decide", "free_motions", "rigid_basis"]
