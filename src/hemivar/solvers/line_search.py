"""Search along a direction for less energy, where contact points may be cut back to the pieces they started on."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from hemivar.basics.types import Array
from hemivar.systems.contact_moves import Search
from hemivar.systems.contact_system import ContactSystem
from hemivar.systems.newton_equation import LinearisedPoint

__all__ = ["LineEnd", "SearchLine", "energy_scale"]

#: What rounding makes of the energy along a line, relative to its parts.
_ROUNDED = 1e-15
#: Most cuts of a length until no component leaves its piece.
_CUTS = 60


@dataclass(frozen=True, eq=False)
class LineEnd:
    """The end of a search along a line.

    Attributes
    ----------
    x : array (m, d) or (n,)
    force : array of the shape of x
        Load minus elastic force there.
    gain : float
        Change of the energy, at most zero.
    tries : int
        Evaluations of the energy.
    first : bool
        Whether the first length was the best.
    """

    x: Array
    force: Array
    gain: float
    tries: int = 0
    first: bool = False


@dataclass(frozen=True, eq=False)
class SearchLine:
    """A direction from a point, along which the energy costs no more than a look at the contact points.

    Attributes
    ----------
    system : ContactSystem
    at : LinearisedPoint
        Where it begins.
    direction, bent : arrays of the shape of a point
        The direction, and the elastic force that a unit of it takes away.
    along : array (m, d)
        Its local displacements.
    slope, square : float
        Work of the force along the direction, and its energy ``d'K d``.
    value : array (m,)
        j at the beginning.
    rounding : float
        What the arithmetic alone makes of the energy.
    search : Search
        Whether steps across pieces are candidates.
    """

    system: ContactSystem
    at: LinearisedPoint
    direction: Array
    bent: Array
    along: Array
    slope: float
    square: float
    value: Array
    rounding: float
    search: Search = Search.GLOBAL

    @staticmethod
    def of(
        system: ContactSystem,
        at: LinearisedPoint,
        direction: Array,
        bent: Array,
        search: Search = Search.GLOBAL,
    ) -> SearchLine:
        """The line from a point; ``bent`` is the elastic force that the direction takes away."""
        value, force, way = system.law.value(at.r), at.force.ravel(), direction.ravel()
        slope, square, size = system.vectors.total(
            float(force @ way),
            float(way @ bent.ravel()),
            float(np.abs(force) @ np.abs(at.x.ravel())) + float(system.weights @ np.abs(value)),
        ).tolist()
        along, rounding = system.at_contact(direction), _ROUNDED * (abs(slope) + size)
        return SearchLine(system, at, direction, bent, along, slope, square, value, rounding, search)

    def lowest(
        self, lengths: Iterable[float], every: bool = False, trusted: bool = False, beyond: bool = False
    ) -> LineEnd:
        """The first length that lowers the energy, or the best of all of them.

        Parameters
        ----------
        lengths : iterable of float
        every : bool
            Look at all of them.
        trusted : bool
            A whole step that gains less than the rounding of the energy is taken on trust.
        beyond : bool
            With the first length try also as far as the pieces of the laws go.
        """
        best, better, tries = LineEnd(self.at.x, self.at.force, 0.0), False, 0
        for number, length in enumerate(lengths):
            looks = [(length, candidate) for candidate in self.candidates(length)]
            gains = self.gains(length, *[candidate for _, candidate in looks])
            if beyond and not number:
                room = self.room()
                looks.append((room, self._across(room)))
                gains += self.gains(*looks[-1])
            for (size, candidate), gained in zip(looks, gains, strict=True):
                on_trust = trusted and size == 1.0 and gained <= self.rounding and self.straight(candidate)
                tries += 1
                if gained < best.gain or (on_trust and not better):
                    best = LineEnd(*self.end(size, candidate), min(gained, 0.0), first=number == 0)
                    better = True
            if better and not every:
                break
        return replace(best, tries=tries)

    def candidates(self, length: float) -> tuple[Array, ...]:
        """Local displacements after a step: cut back to their pieces, and, unless only downhill, across them."""
        far = self._across(length)
        near = np.where(self.at.moving, self.at.near.clamp(far), self.at.r)
        return (near, far) if self.search is Search.GLOBAL else (near,)

    def _across(self, length: float) -> Array:
        """Local displacements after a step, whatever pieces they come to."""
        return np.where(self.system.active, self.at.r + length * self.along, self.system.fixed)

    def room(self) -> float:
        """How far the direction can be followed until the first component meets the end of its piece."""
        r, along, moving = self.at.r, self.along, self.at.moving
        far, largest = self.system.vectors.largest(np.abs(r).max(initial=0.0), np.abs(along).max(initial=0.0)).tolist()
        if largest == 0.0:
            return 0.0
        length = 100.0 * (far or 1.0) / largest
        for _ in range(_CUTS):
            aim = r + length * along
            cut = np.where(moving, self.at.near.clamp(aim), aim)
            missed = np.abs(aim - cut) > 1e-14 * (np.abs(aim) + np.abs(r))
            ratio = np.where(missed, np.abs(cut - r) / np.maximum(np.abs(aim - r), 1e-300), 2.0)
            least = -float(self.system.vectors.largest(-ratio.min(initial=2.0))[0])
            if least == 2.0:
                break
            length *= min(max(least, 1e-3), 1.0 - 1e-12)
        return float(length)

    def gains(self, length: float, *candidates: Array) -> list[float]:
        """Changes of the energy, free of the cancellation of two large energies."""
        system = self.system
        own: list[float] = []
        contact = system.at_contact(length * self.bent - self.at.force)
        for candidate in candidates:
            extra = np.where(system.active, candidate - self.at.r - length * self.along, 0.0)
            own += [float(np.vdot(extra, contact)), float(np.vdot(extra, system.couple(extra)))]
            own.append(float(system.weights @ (system.law.value(candidate) - self.value)))
        alone = 0.5 * length**2 * self.square - length * self.slope
        sums = system.vectors.total(*own).reshape(-1, 3).tolist()
        return [alone + work + 0.5 * bent + change for work, bent, change in sums]

    def straight(self, candidate: Array) -> bool:
        """Whether a whole step leads to the candidate, as far as the digits of the local displacements tell."""
        off = np.where(self.system.active, candidate - self.at.r - self.along, 0.0)
        sizes = [np.abs(values).max(initial=0.0) for values in (off, self.along, self.at.r)]
        missed, step, size = self.system.vectors.largest(*sizes).tolist()
        return bool(missed <= 1e-10 * step + 4.0 * np.finfo(float).eps * size)

    def end(self, length: float, candidate: Array) -> tuple[Array, Array]:
        """The point after a step with these local displacements, and the force there."""
        system = self.system
        far = self.at.x + length * self.direction
        near = system.moved(far, candidate)
        return near, self.at.force - length * self.bent - system.multiply_contact(near - far)


def energy_scale(system: ContactSystem, x: Array, value: Array) -> float:
    """What changes of the energy are compared with at a point, where j is ``value (m,)``."""
    own = float(np.abs(system.load) @ np.abs(x.ravel())) + float(system.weights @ np.abs(value))
    return float(system.vectors.total(own)[0])
