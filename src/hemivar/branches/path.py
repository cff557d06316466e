"""A path of equilibria: its points, folds and jumps, and why it ends."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property

import numpy as np

from hemivar.basics.display import Displayed
from hemivar.basics.portable import Portable
from hemivar.basics.types import Array, BoolArray
from hemivar.discrete.problem import DiscreteProblem
from hemivar.fem import LoadLine

__all__ = ["Fold", "Jump", "Path", "PathEnd"]


class PathEnd(StrEnum):
    """Why a path ends where it does; the value is the sentence."""

    UPPER_END = "the upper end of the load factors was reached"
    LOWER_END = "the lower end of the load factors was reached"
    MAX_POINTS = "the limit of points was reached"
    MAX_TIME = "the time limit was reached"
    INTERRUPTED = "interrupted"
    NOT_UNIQUE = "the path is not unique beyond this point"
    NOT_CORRECTED = "the corrector did not converge"
    UNBOUNDED = "the branch goes on for ever at this load"


@dataclass(frozen=True)
class Fold:
    """A point where the load turns.

    Attributes
    ----------
    load_factor : float
    index : int
        Number of the point on the path.
    """

    load_factor: float
    index: int


@dataclass(frozen=True, eq=False)
class Jump:
    """Where the body leaves a branch when the load is prescribed.

    Attributes
    ----------
    load_factor : float
    index : int
        Number of the point on the path from which it jumps.
    loading : bool
        Whether it happens while the load grows (else while it falls).
    local : array (m, d) or None
        Local displacement on the stable branch of this path that is met at the same load; None if there is none.
    """

    load_factor: float
    index: int
    loading: bool
    local: Array | None


@dataclass(frozen=True, eq=False)
class Path(Portable, Displayed):
    """Equilibria in the order in which they are met.

    Attributes
    ----------
    line : LoadLine
        The problem at each load factor.
    load_factor : array (k,)
    local, multiplier : arrays (k, m, d)
        Local displacement r, and pressure and friction.
    energy : array (k,)
        E(u) at the load of the point.
    stable : bool array (k - 1,)
        Whether the equilibria between a point and the next are local minimisers.
    curved : bool array (k - 1,)
        Whether the path between them is curved; otherwise r is exactly linear there.
    folds : tuple of Fold
    jumps : tuple of Jump
    ended : PathEnd
        Why the path ends where it does, in a sentence.
    perturbed : bool
        Whether several components met an event at once, so that the load was perturbed by 1e-9 of itself to order them;
        the path is then one of several that meet.
    """

    line: LoadLine
    load_factor: Array
    local: Array
    multiplier: Array
    energy: Array
    stable: BoolArray
    curved: BoolArray
    folds: tuple[Fold, ...]
    jumps: tuple[Jump, ...]
    ended: PathEnd
    perturbed: bool = False

    @property
    def reached_end(self) -> bool:
        """Whether the path was followed until it left the range of load factors."""
        return self.ended in (PathEnd.UPPER_END, PathEnd.LOWER_END)

    @property
    def interrupted(self) -> bool:
        """Whether it was stopped from the keyboard; the points until then are here."""
        return self.ended is PathEnd.INTERRUPTED

    def __repr__(self) -> str:
        t, folds, jumps = self.load_factor, len(self.folds), len(self.jumps)
        size = f"{len(self)} points from load factor {t[0]:.6g} to {t[-1]:.6g}, {folds} folds, {jumps} jumps"
        return f"Path({size}; {self.ended})"

    def __len__(self) -> int:
        return self.load_factor.size

    @property
    def problem(self) -> DiscreteProblem:
        """The problem at load factor 1."""
        return self.line.loaded

    @cached_property
    def max_penetration(self) -> Array:
        """Largest penetration, (k,)."""
        return np.asarray(self.local[:, :, 0].max(axis=1, initial=-np.inf))

    @cached_property
    def normal_force(self) -> Array:
        """Resultant of the pressure, (k,)."""
        return np.asarray(self.multiplier[:, :, 0] @ self.problem.contact.weights)

    @cached_property
    def friction_force(self) -> Array:
        """Resultant of the friction, (k, d - 1)."""
        return np.asarray(np.einsum("m,kmc->kc", self.problem.contact.weights, self.multiplier[:, :, 1:]))

    def at(self, load_factor: float) -> list[tuple[Array, bool]]:
        """Local displacements (m, d) where the path crosses a load, in order, and whether they are stable.

        Interpolated linearly: exact where the path is not curved.
        """
        found: list[tuple[Array, bool]] = []
        t = self.load_factor
        for i in range(len(self) - 1):
            first = i == 0 or t[i] != load_factor
            between = (t[i] - load_factor) * (t[i + 1] - load_factor) <= 0.0 and t[i] != t[i + 1]
            if between and first:
                part = (load_factor - t[i]) / (t[i + 1] - t[i])
                found.append((self.local[i] + part * (self.local[i + 1] - self.local[i]), bool(self.stable[i])))
        return found
