"""Contact laws by code of our own, from the formulas of docs/laws.md: which forces a law allows near a place.

A law is a function that gets an interval of displacements and returns the least and the largest force that its Clarke
subdifferential holds there.
"""

from __future__ import annotations

import csv
import itertools
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from tests.robustness.expression import UnknownError, parse, value

__all__ = ["Graph", "SenselessError", "normal_graph", "read_table", "slip_graph"]

Number = Callable[[Any], float]


class SenselessError(Exception):
    """The law should have been refused."""


@dataclass
class Graph:
    """A law given by its derivative between knots.

    Attributes
    ----------
    knots : list of float
    pieces : list of functions
        The derivative before the first knot, between the knots, and after the last one.
    lower, upper : float
        Displacements beyond are not possible; the force at the end is any.
    potential : function or None
        Given instead of the pieces: the derivative is that of this function, by differences.
    """

    knots: list[float] = field(default_factory=list)
    pieces: list[Callable[[float], float]] = field(default_factory=list)
    lower: float = -math.inf
    upper: float = math.inf
    potential: Callable[[float], float] | None = None

    def forces(self, low: float, high: float) -> tuple[float, float]:
        """Least and largest force for displacements between ``low`` and ``high``; (inf, -inf) if none is possible."""
        if high < self.lower or low > self.upper:
            return math.inf, -math.inf
        if self.potential is not None:
            found = self._differences(low, high)
        else:
            found = []
            ends = [-math.inf, *self.knots, math.inf]
            for piece, a, b in zip(self.pieces, ends, ends[1:], strict=False):
                x, y = max(a, low), min(b, high)
                if x <= y and a <= high and b >= low:
                    found += [piece(x), piece(0.5 * (x + y)), piece(y)]
        least, largest = min(found), max(found)
        if low <= self.lower:
            least = -math.inf
        if high >= self.upper:
            largest = math.inf
        return least, largest

    def _differences(self, low: float, high: float) -> list[float]:
        """Slopes over steps of the size of one, and of the displacement where rounding lets these be told."""
        size = max(abs(low), abs(high))
        slopes, error = self._slopes(low, high, 1e-6 * max(1.0, size))
        found = [min(slopes) - error, max(slopes) + error]
        if 0.0 < size < 1.0:
            slopes, error = self._slopes(low, high, 1e-6 * size)
            if error <= 1e-3 * max(map(abs, slopes)):
                found += [min(slopes) - error, max(slopes) + error]
        return found

    def _slopes(self, low: float, high: float, step: float) -> tuple[list[float], float]:
        assert self.potential is not None
        step += 0.25 * (high - low)
        start, count = low - 2.0 * step, 13
        width = (high - low + 4.0 * step) / (count - 1)
        values = [self.potential(start + i * width) for i in range(count)]
        error = 1e-15 * max(map(abs, values)) * 4.0 / width
        return [(b - a) / width for a, b in itertools.pairwise(values)], error


def _spring(slope: float, offset: float = 0.0) -> Callable[[float], float]:
    return lambda r: offset + slope * r


def _zero(_: float) -> float:
    return 0.0


def _at_least(name: str, number: float, least: float, above: bool = False) -> float:
    if not (math.isfinite(number) and (number > least if above else number >= least)):
        raise SenselessError(f"{name} = {number}")
    return number


def normal_graph(law: Mapping[str, Any] | str, number: Number, folder: Path) -> Graph:
    """The graph of a normal law of a problem file; ``number`` evaluates a parameter at the contact point."""
    if isinstance(law, str):
        law = {"law": law}

    def get(name: str, default: float | None = None, least: float = -math.inf, above: bool = False) -> float:
        given = law.get(name, default)
        return _at_least(name, number(given), least, above)

    match law["law"]:
        case "none":
            return Graph([], [_zero])
        case "survey":
            q, p = get("q_max", None, 0.0), get("p_const", 0.0, 0.0)
            return Graph([0.0], [_zero, _spring(p, q)])
        case "signorini":
            return Graph([], [_zero], upper=0.0)
        case "bilateral":
            return Graph([], [_zero], lower=0.0, upper=0.0)
        case "bolt":
            tension = get("tension", 0.0)
            held = get("held", 0.0, 0.0) > 0.0
            return Graph([], [_zero], lower=0.0, upper=0.0) if held else Graph([], [_spring(0.0, -tension)])
        case "compliance":
            c, p = get("stiffness", None, 0.0), get("exponent", 1.0, 1.0)
            return Graph([0.0], [_zero, lambda r: c * max(r, 0.0) ** p])
        case "softening":
            k, limit = get("stiffness", None, 0.0, True), get("limit", None, 0.0, True)
            fall = get("softening", None, 0.0)
            top = k * limit
            if fall == 0.0:
                return Graph([0.0, limit], [_zero, _spring(k), lambda r: top])
            return Graph(
                [0.0, limit, limit + top / fall], [_zero, _spring(k), lambda r: top - fall * (r - limit), _zero]
            )
        case "capped":
            k, limit = get("stiffness", None, 0.0, True), get("limit", None, 0.0, True)
            rest = get("residual", 0.0, 0.0) * k * limit
            return Graph([0.0, limit], [_zero, _spring(k), lambda r: rest])
        case "finite-penetration":
            k, limit = get("stiffness", None, 0.0), get("limit", None, 0.0, True)
            return Graph([0.0], [_zero, _spring(k)], upper=limit)
        case "barton-bandis":
            k, most = get("stiffness", None, 0.0, True), get("closure", None, 0.0, True)
            return Graph([0.0], [_zero, lambda r: k * r * most / (most - r) if r < most else math.inf], upper=most)
        case "adhesive":
            k, strength = get("stiffness", None, 0.0, True), get("strength", None, 0.0, True)
            rigid = "compression" not in law
            push = 0.0 if rigid else get("compression", None, 0.0)
            w = strength / k
            upper = 0.0 if rigid else math.inf
            if "softening" not in law:
                return Graph([-w, 0.0], [_zero, _spring(k), _spring(push)], upper=upper)
            fall = get("softening", None, 0.0, True)
            end = w + strength / fall
            # tension strength - fall (w' - w) at the opening w' = -r
            return Graph(
                [-end, -w, 0.0],
                [_zero, lambda r: -(strength - fall * (-r - w)), _spring(k), _spring(push)],
                upper=upper,
            )
        case "layered":
            return _layered(law)
        case "saw-tooth":
            return _saw_tooth(law)
        case "pressure-table":
            r, derivative = _numbers(law["penetrations"]), _numbers(law["pressures"])
            if len(r) != len(derivative):
                raise SenselessError("lists of different lengths")
            return _table(r, derivative, law.get("extend", "constant"))
        case "table":
            r, derivative = read_table(folder / law["file"], ("r", "derivative"))
            return _table(r, derivative, law.get("extend", "constant"))
        case "formula":
            tree = parse(law["potential"])
            return Graph(potential=lambda r: value(tree, {"r": r}))
    raise UnknownError(f"law {law['law']}")


def _numbers(given: Any) -> list[float]:
    numbers = [float(x) for x in given]
    if not numbers or not all(map(math.isfinite, numbers)):
        raise SenselessError(f"numbers {numbers[:3]}")
    return numbers


def _layered(law: Mapping[str, Any]) -> Graph:
    thick, stiff = _numbers(law["thicknesses"]), _numbers(law["stiffnesses"])
    drops = _numbers(law["drops"]) if "drops" in law else [0.0] * len(thick)
    if not len(thick) == len(stiff) == len(drops) or min(thick) <= 0.0 or min(drops) < 0.0:
        raise SenselessError("layers")
    knots, pieces, pressure, top = [0.0], [_zero], 0.0, 0.0
    for t, k, drop in zip(thick, stiff, drops, strict=True):
        pieces.append(lambda r, k=k, p=pressure, top=top: p + k * (r - top))
        pressure += k * t - drop
        top += t
        knots.append(top)
    if "base" not in law:
        return Graph(knots[:-1], pieces, upper=top)
    base = float(law["base"])
    pieces.append(lambda r: pressure + base * (r - top))
    return Graph(knots, pieces)


def _saw_tooth(law: Mapping[str, Any]) -> Graph:
    ends, slopes = _numbers(law["openings"]), _numbers(law["slopes"])
    offsets = _numbers(law["offsets"]) if "offsets" in law else [0.0] * len(ends)
    rising = all(a < b for a, b in zip([0.0, *ends], ends, strict=False))
    if not len(ends) == len(slopes) == len(offsets) or not rising:
        raise SenselessError("teeth")
    rigid = "compression" not in law
    push = 0.0 if rigid else float(law["compression"])
    teeth = [lambda r, s=s, o=o: -(s * -r + o) for s, o in zip(slopes, offsets, strict=True)]
    knots = [-e for e in reversed(ends)] + [0.0]
    return Graph(knots, [_zero, *reversed(teeth), _spring(push)], upper=0.0 if rigid else math.inf)


def _table(r: list[float], derivative: list[float], extend: str = "constant", even: bool = False) -> Graph:
    if even:
        if min(r) < 0.0:
            raise SenselessError("negative slips")
        if r[0] > 0.0:
            r, derivative = [0.0, *r], [derivative[0], *derivative]
        elif len(r) > 1 and r[1] == 0.0:
            r, derivative = r[1:], derivative[1:]
    if any(b < a for a, b in itertools.pairwise(r)) or not all(map(math.isfinite, [*r, *derivative])):
        raise SenselessError("table falls or holds an entry that is not a number")
    knots, pieces = [], []

    def line(i: int) -> Callable[[float], float]:
        a, b, p, q = r[i], r[i + 1], derivative[i], derivative[i + 1]
        slope = (q - p) / (b - a)
        return lambda x: p + slope * (x - a) if abs(x - a) <= abs(x - b) else q + slope * (x - b)

    lines = [(i, line(i)) for i in range(len(r) - 1) if r[i + 1] > r[i]]
    knots = [r[i] for i, _ in lines] + [r[-1]]
    pieces = [f for _, f in lines]
    first: Callable[[float], float] = lambda x: derivative[0]  # noqa: E731
    last: Callable[[float], float] = lambda x: derivative[-1]  # noqa: E731
    if extend == "linear" and pieces:
        last = pieces[-1]
        first = pieces[0]
    if not lines:
        return Graph([r[0]], [first, last])
    return Graph(knots, [first, *pieces, last])


def read_table(path: Path, columns: tuple[str, str]) -> tuple[list[float], list[float]]:
    """Two columns of a CSV file; names are honoured where they are those of the columns.

    Raises
    ------
    SenselessError
        More than two columns without names, or rows that are not numbers.
    """
    try:
        text = path.read_bytes().decode("utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise SenselessError(f"the file cannot be read: {error}") from None
    rows = [line for line in text.splitlines() if line.strip() and not line.lstrip().startswith("#")]
    split = []
    for line in rows:
        separator = next((c for c in ";,\t" if c in line), None)
        cells = next(csv.reader([line], delimiter=separator)) if separator else line.split()
        split.append([cell.strip() for cell in cells])
    place = [0, 1]
    if split and not any(_is_number(cell) for cell in split[0]):
        names = [cell.lower() for cell in split.pop(0)]
        if names[:2] == list(reversed(columns)):
            place = [1, 0]
        elif set(columns) <= set(names):
            place = [names.index(columns[0]), names.index(columns[1])]
    elif split and len([cell for cell in split[0] if cell]) > 2:
        raise SenselessError("more than two columns without names")
    try:
        x = [float(row[place[0]]) for row in split]
        y = [float(row[place[1]]) for row in split]
    except (ValueError, IndexError):
        raise SenselessError("a row is not two numbers") from None
    if len(x) < 1 or not all(map(math.isfinite, x + y)):
        raise SenselessError("no rows, or what is no finite number")
    return x, y


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True


def slip_graph(law: Mapping[str, Any], number: Number, folder: Path) -> Graph:
    """The graph of a friction law for slips >= 0, without its bound."""

    def get(name: str, default: float | None = None, least: float = 0.0, above: bool = False) -> float:
        return _at_least(name, number(law.get(name, default)), least, above)

    match law["law"]:
        case "none" | "tresca" | "coulomb":
            return Graph([], [lambda s: 1.0])
        case "slip-weakening":
            static, kinetic = get("static", 1.0), get("kinetic", 0.7)
            rate = get("rate", 1.0, 0.0, True)
            return Graph([], [lambda s: kinetic + (static - kinetic) * math.exp(-rate * max(s, 0.0))])
        case "exponential-decay":
            static, kinetic, decay = get("static"), get("kinetic"), get("decay", None, 0.0, True)
            return Graph([], [lambda s: kinetic + (static - kinetic) * math.exp(-decay * max(s, 0.0))])
        case "logarithmic":
            scale = get("scale", 1.0, 0.0, True)
            return Graph([], [lambda s: 1.0 / (scale + max(s, 0.0))])
        case "static-kinetic":
            slip, static, kinetic = get("slip", None, 0.0, True), get("static", 1.0), get("kinetic", 0.7)
            return Graph([slip], [lambda s: static, lambda s: kinetic])
        case "slip-table":
            slips, values = _numbers(law["slips"]), _numbers(law["values"])
            if len(slips) != len(values) or min(values) < 0.0:
                raise SenselessError("a negative friction, or lists of different lengths")
            return _table(slips, values, even=True)
        case "table":
            slips, values = read_table(folder / law["file"], ("r", "derivative"))
            if min(values) < 0.0:
                raise SenselessError("a negative friction")
            return _table(slips, values, law.get("extend", "constant"), even=True)
        case "formula":
            tree = parse(law["potential"])
            return Graph(potential=lambda r: value(tree, {"r": abs(r)}))
    raise UnknownError(f"law {law['law']}")
