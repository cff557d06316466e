"""What there is to say about a material: its law, its constants, and the bounds of its tangent."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from hemivar.basics.arrays import SAME, real_array
from hemivar.basics.types import Array
from hemivar.errors import ProblemError
from hemivar.mechanics.material_words import BoundsBy

__all__ = ["MaterialDescription", "described_point"]


@dataclass(frozen=True, eq=False)
class MaterialDescription:
    """A material at one point; ``str()`` writes it out."""

    name: str
    formula: str = ""  # the stress, or the stored energy W
    constants: Mapping[str, str] = field(default_factory=dict)
    linear: bool = True
    #: C_low and C_up (v, v), below and above the tangent at every strain up to the reach; None where constants vary and
    #: no point was given.
    lower: Array | None = None
    upper: Array | None = None
    bounds_by: BoundsBy = BoundsBy.CLOSED_FORM
    reach: float = math.inf  # the size ``|eps|`` of the strain in space up to which they hold
    parts: Mapping[str, MaterialDescription] = field(default_factory=dict)  # by region; then a name is all of the rest

    @property
    def ratio(self) -> float | None:
        """The largest c with ``C_low >= c C_up``: 1 for linear materials, 0 where no stiffness is sure."""
        if self.lower is None or self.upper is None:
            return None
        whole = np.linalg.cholesky(self.upper)
        part = np.linalg.solve(whole, np.linalg.solve(whole, self.lower).T)
        least = float(np.linalg.eigvalsh(0.5 * (part + part.T))[0])
        return 0.0 if least < SAME else least

    @property
    def lines(self) -> tuple[str, ...]:
        """The description, line by line."""
        if self.parts:
            return tuple(
                f"region '{name}': {line}" for name, part in self.parts.items() for line in str(part).split("\n")
            )
        lines = [self.formula] if self.formula else []
        if self.constants:
            lines.append(", ".join(f"{name} = {value}" for name, value in self.constants.items()))
        if self.lower is None or self.upper is None:
            return (*lines, "its constants vary; describe(point=(x, y)) gives its bounds at a point")
        if self.linear:
            return (*lines, f"linear: C has {_stiffness(self.lower)}")
        where = "at every strain" if math.isinf(self.reach) else f"for |eps| <= {self.reach:.6g}"
        how = {
            BoundsBy.CLOSED_FORM: "closed form",
            BoundsBy.INTERVALS: "proved by intervals",
            BoundsBy.SAMPLED: "sampled, not proved",
        }[self.bounds_by]
        lines += [
            f"bounds of the tangent {where} ({how}):",
            f"    C_low has {_stiffness(self.lower)}",
            f"    C_up has {_stiffness(self.upper)}",
        ]
        if self.ratio:
            lines.append(f"    C_low >= {self.ratio:.6g} C_up: the stress is strongly monotone")
        else:
            lines.append("    C_low is not positive definite: uniqueness and error bounds cannot be shown")
        return tuple(lines)

    def __str__(self) -> str:
        return "\n".join((self.name, *("    " + line for line in self.lines)))


def described_point(point: Sequence[float] | None, dim: int) -> Array:
    """The point where a material is described, shape (1, d); the origin if none is given."""
    if point is None:
        return np.zeros((1, dim))
    given = real_array(point, "point")
    if given.shape not in ((2,), (3,)):
        raise ProblemError(f"point has shape {given.shape}; give two or three coordinates")
    return given[None]


def _stiffness(matrix: Array) -> str:
    """Bulk and shear modulus of an isotropic matrix of space; else the range of its eigenvalues."""
    dim = 2 if len(matrix) == 3 else 3
    lam, shear = float(matrix[0, 1]), float(matrix[-1, -1])
    isotropic = np.diag([2.0 * shear] * dim + [shear] * (len(matrix) - dim))
    isotropic[:dim, :dim] += lam
    if dim == 3 and np.abs(matrix - isotropic).max() <= SAME * np.abs(matrix).max():
        bulk = lam + 2.0 * shear / 3.0
        return f"bulk modulus {_number(bulk, matrix)}, shear modulus {_number(shear, matrix)}"
    once = np.diag([1.0] * dim + [math.sqrt(2.0)] * (len(matrix) - dim))
    values = np.linalg.eigvalsh(once @ matrix @ once)
    return f"stiffness from {_number(values[0], matrix)} to {_number(values[-1], matrix)}"


def _number(value: float, matrix: Array) -> str:
    return f"{0.0 if abs(value) < SAME * np.abs(matrix).max() else value:.6g}"
