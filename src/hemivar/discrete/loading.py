"""What changes of a discrete problem: load, offsets and law; a step in time is another loading of the same model."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from hemivar.basics.arguments import expect
from hemivar.basics.arrays import norm, real_array
from hemivar.basics.portable import PickleMixin
from hemivar.basics.types import Array
from hemivar.errors import ProblemError
from hemivar.laws import ContactLaw, VectorLaw

__all__ = ["Loading"]


@dataclass(frozen=True, eq=False)
class Loading(PickleMixin):
    """What acts on a :class:`Model`.  Arrays that may be written to are copied, read-only ones are shared.

    Parameters
    ----------
    load : array, shape (n,)
        ``f``, forces on the unknowns.
    offset : array, shape (m, c)
        Subtracted from ``B u``: column 0 is the gap between body and foundation along the normal, less any prescribed
        displacement, the others a slip that is there already.
    law : VectorLaw
        With parameters resolved at the contact points.
    constant : float
        Energy that does not depend on the unknowns.

    Raises
    ------
    ProblemError
        A number is not finite, or an array has other axes.
    """

    load: Array
    offset: Array
    law: VectorLaw
    constant: float = 0.0

    def __post_init__(self) -> None:
        remedy = "pass ContactLaw(normal, friction), resolved at the contact points"
        if type(self.law) is not ContactLaw:  # looked at in every time step, and abstract classes are slow to ask
            expect(self.law, VectorLaw, "the law of a discrete problem", remedy)
        given = self.constant
        constant = given if type(given) is float else float(real_array(given, "constant", 0, finite=False))
        if not math.isfinite(constant):
            raise ProblemError(f"constant = {self.constant}; the constant part of the energy must be finite")
        object.__setattr__(self, "load", _own(self.load, "load", 1))
        object.__setattr__(self, "offset", _own(self.offset, "offset", 2))
        object.__setattr__(self, "constant", constant)

    @cached_property
    def load_size(self) -> float:
        """Euclidean norm of the load."""
        return norm(self.load)


def _own(value: Array, name: str, ndim: int) -> Array:
    """A read-only array of finite numbers: the one given, where nobody can write to it."""
    plain = type(value) is np.ndarray and value.dtype == float and value.ndim == ndim
    if not plain or not math.isfinite(float(value.sum())):
        return real_array(value, name, ndim, own=True)
    if value.flags.writeable or value.base is not None:
        value = value.copy()
        value.flags.writeable = False
    return value
