"""Coordinate systems of Nastran: grid points given in systems of three points, one within another."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from hemivar.basics.types import AnyArray, Array, IntArray
from hemivar.errors import ProblemError
from hemivar.mesh.texts import floats, whole

__all__ = ["KINDS_OF_SYSTEMS", "in_basic_system"]

#: Cards that give a system by three points: rectangular, cylindrical and spherical.
KINDS_OF_SYSTEMS = ("CORD2R", "CORD2C", "CORD2S")
#: Kind, origin, and axes (rows) of a system.
_System = tuple[str, Array, Array]


def in_basic_system(ids: IntArray, systems: IntArray, points: Array, cards: Sequence[tuple[str, AnyArray]]) -> Array:
    """Points (N, 3), each given in the system of a number (0: the basic one), in the basic system."""
    if not systems.any():
        return points
    known = _systems(cards)
    placed = points.copy()
    for number in np.unique(systems).tolist():
        own = systems == number
        if number not in known:
            raise ProblemError(
                f"node {ids[own][0]} lies in coordinate system {number}, which no CORD2R, CORD2C or CORD2S gives; "
                "save the mesh in the basic system"
            )
        placed[own] = _placed(known[number], points[own])
    return placed


def _systems(cards: Sequence[tuple[str, AnyArray]]) -> dict[int, _System]:
    """The systems that cards state; each after the one that it is stated in."""
    known: dict[int, _System] = {0: ("CORD2R", np.zeros(3), np.eye(3))}
    waiting: dict[int, tuple[str, int, Array]] = {}
    for card, fields in cards:
        rows = np.hstack([fields, np.full((len(fields), 11), "")])[:, :11]
        numbers = whole(np.where(rows[:, :2] == "", "0", rows[:, :2]).ravel().tolist(), card).reshape(-1, 2)
        places = floats(np.where(rows[:, 2:] == "", "0", rows[:, 2:]).ravel().tolist(), card).reshape(-1, 3, 3)
        for (number, within), three in zip(numbers.tolist(), places, strict=True):
            if waiting.setdefault(number, (card, within, three))[2] is not three:
                raise ProblemError(f"coordinate system {number} is given twice; leave one")
    while waiting:
        ready = [number for number, (_, within, _) in waiting.items() if within in known]
        if not ready:
            number, (_, within, _) = next(iter(waiting.items()))
            what = "those refer to one another in a circle" if within in waiting else "that is not there"
            raise ProblemError(f"coordinate system {number} is stated in system {within}, and {what}; correct it")
        for number in ready:
            card, within, three = waiting.pop(number)
            known[number] = (card, *_frame(number, _placed(known[within], three)))
    return known


def _frame(number: int, three: Array) -> tuple[Array, Array]:
    """Origin and axes from the origin, a point on the third axis and one in the half plane of the first."""
    if not np.isfinite(three).all():
        raise ProblemError(f"coordinate system {number} has points that are not finite; correct it")
    along, aside = three[1] - three[0], three[2] - three[0]
    size = max(float(np.abs(three - three[0]).max()), 1e-300)
    across = np.cross(along / size, aside / size)
    if not np.linalg.norm(across) > 1e-10:
        raise ProblemError(f"the three points of coordinate system {number} lie on a line; correct one of them")
    third, second = along / np.linalg.norm(along), across / np.linalg.norm(across)
    return three[0], np.stack([np.cross(second, third), second, third])


def _placed(system: _System, points: Array) -> Array:
    """Points (k, 3) of a system in the basic one; angles are in degrees."""
    card, origin, axes = system
    first, second, third = points.T
    if card == "CORD2C":
        turn = np.radians(second)
        points = np.column_stack([first * np.cos(turn), first * np.sin(turn), third])
    elif card == "CORD2S":
        down, turn = np.radians(second), np.radians(third)
        flat = first * np.sin(down)
        points = np.column_stack([flat * np.cos(turn), flat * np.sin(turn), first * np.cos(down)])
    return origin + points @ axes
