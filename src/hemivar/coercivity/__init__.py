"""Whether a body is held: motions without energy, and what contact and its laws do along them."""

from hemivar.coercivity.recession import Coercivity, CoercivityProof, CoercivityResult, RecessionFunction, decide
from hemivar.coercivity.rigid_modes import RigidModes, free_motions, rigid_basis

__all__ = [
    "Coercivity",
    "CoercivityProof",
    "CoercivityResult",
    "RecessionFunction",
    "RigidModes",
    "decide",
    "free_motions",
    "rigid_basis",
]
