"""Laws from tables of (r, derivative): any graph, with vertical jumps."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from enum import StrEnum
from pathlib import Path
from types import MappingProxyType

import numpy as np

from hemivar.basics.arguments import one_line, one_of
from hemivar.basics.arrays import real_array
from hemivar.basics.disk import shown
from hemivar.basics.known_keywords import known_keywords
from hemivar.basics.stated import Form, stated, stating
from hemivar.basics.types import Array, BoolArray
from hemivar.errors import ProblemError
from hemivar.laws.named import LawKind, named
from hemivar.laws.own.columns import read_columns
from hemivar.laws.parameters import LENGTH, PRESSURE, numbers, word
from hemivar.laws.piecewise import PiecewiseQuadratic

__all__ = ["EXTEND", "TABLE", "Extension", "check_points", "even_table", "read_law_table", "table_law"]


class Extension(StrEnum):
    """How the derivative of a tabulated law goes on beyond the ends of its table."""

    CONSTANT = "constant"
    """It keeps its last value."""
    LINEAR = "linear"
    """It keeps its last slope."""


def check_points(
    r: Sequence[float] | Array, derivative: Sequence[float] | Array, where: str, *, friction: bool
) -> tuple[Array, Array]:
    """The columns of a law table as arrays, checked; errors name the row, counted from 1."""
    try:
        x, y = real_array(r, "r", finite=False), real_array(derivative, "the derivative", finite=False)
    except ProblemError as error:
        raise ProblemError(f"{where}: not all entries are numbers; give two lists of numbers ({error})") from None
    if x.ndim != 1 or x.shape != y.shape:
        raise ProblemError(
            f"{where}: r has shape {x.shape} and the derivative {y.shape}; give two lists of equal length"
        )
    if x.size < 2:
        raise ProblemError(f"{where}: {x.size} row{'' if x.size == 1 else 's'}; a law table needs at least 2")
    third = np.append([False, False], x[2:] == x[:-2])
    rules: list[tuple[BoolArray, Callable[[int], str]]] = [
        (~(np.isfinite(x) & np.isfinite(y)), lambda i: f"{x[i]:g}, {y[i]:g}; both must be finite numbers"),
        (
            np.append(False, x[1:] < x[:-1]),
            lambda i: f"r = {x[i]:g} comes after {x[i - 1]:g}; r must not fall (sort the rows)",
        ),
        (third, lambda i: f"r = {x[i]:g} a third time; two rows with the same r make a jump"),
    ]
    if friction:
        rules += [
            (
                x < 0.0,
                lambda i: (
                    f"r = {x[i]:g} is negative; a friction law is given for slips r >= 0 and is the same in both "
                    f"directions"
                ),
            ),
            (y < 0.0, lambda i: f"the friction {y[i]:g} is negative; it must be at least 0 to oppose the slip"),
        ]
    broken = [(int(np.argmax(bad)), words) for bad, words in rules if bad.any()]
    if broken:
        i, words = min(broken, key=lambda fault: fault[0])
        raise ProblemError(f"{where}, row {i + 1}: {words(i)}")
    return x, y


#: What a problem file says of a table.
TABLE = stated(Form.FILE, "the CSV file", key="file", unit="path")
EXTEND = word("how the derivative continues beyond the table", *Extension)


@known_keywords
def table_law(
    r: Sequence[float] | Array,
    derivative: Sequence[float] | Array,
    *,
    extend: str = Extension.CONSTANT,
    friction: bool = False,
    name: str = "table",
    where: str = "law table",
    file: Path | None = None,
) -> PiecewiseQuadratic:
    """The law whose derivative is linear between the points ``(r, derivative)``.

    Parameters
    ----------
    r : sequence of float (K,)
        Not falling; a repeated r is a jump of the derivative, upwards or downwards.
    derivative : sequence of float (K,)
        j' at these places (force per area). j is its integral with j(0) = 0.
    extend : {"constant", "linear"}
        How j' goes on beyond the ends.
    friction : bool
        The points are given for r >= 0 only, and j is even; j' at the first point is the resistance against the
        first slip.
    name, where : str
        Used in messages.
    file : Path, optional
        Where the points come from.

    Returns
    -------
    PiecewiseQuadratic

    Raises
    ------
    ProblemError
        Fewer than two rows, entries that are not numbers, falling r (with the row).

    Examples
    --------
    >>> import hemivar as hv
    >>> law = hv.table_law([-1.0, 0.0, 0.1, 0.3], [0.0, 0.0, 0.5, 0.2])
    >>> law.derivative([0.05, 0.2])
    array([0.25, 0.35])
    >>> float(law.weak_convexity[0].round(12))  # the steepest fall
    1.5
    """
    one_line(name, "the name of a law"), one_line(where, "where")
    extend = one_of(extend, f"{where}: extend", Extension)
    x, y = check_points(r, derivative, where, friction=friction)
    if friction and extend == Extension.LINEAR and y[-1] < y[-2]:
        raise ProblemError(
            f"{where}, row {y.size}: with extend = linear the falling friction becomes negative farther out; "
            f"end the table with a constant or rising friction, or write extend = constant"
        )
    stated = MappingProxyType({"law": "table", "extend": extend, "rows": (x, y), "file": file})
    if friction:
        return even_table(x, y, extend=extend, name=name, stated=stated)
    knots = np.unique(x)
    left = y[np.searchsorted(x, knots, side="left")]
    right = y[np.searchsorted(x, knots, side="right") - 1]
    inner = (left[1:] - right[:-1]) / np.diff(knots)
    ends = inner[[0, -1]] if extend == Extension.LINEAR and inner.size else np.zeros(2)
    slopes = np.concatenate([ends[:1], inner, ends[1:]])
    return PiecewiseQuadratic(knots, slopes, right - left, start=float(left[0]), name=name, stated=stated)


@named(
    LawKind.NORMAL,
    "table",
    "any graph: j' is linear between the points of a CSV file with the columns r and derivative; a "
    "repeated r is a jump",
    "j' from a table",
)
@stating(path=TABLE, extend=EXTEND)
def read_law_table(
    path: str | Path, *, extend: str = Extension.CONSTANT, friction: bool = False, name: str = "table"
) -> PiecewiseQuadratic:
    """Like :func:`table_law`, from a CSV file with the columns r and derivative; see :func:`read_columns`.

    Parameters
    ----------
    path : str or Path
        Name of the file.
    extend : str
        How the law goes on beyond the table, as in :func:`table_law`.
    friction : bool
        Whether the table is of friction over the slip.
    name : str
        What the law is called in messages.

    Returns
    -------
    PiecewiseQuadratic

    Raises
    ------
    ProblemError
        If the file cannot be read or is not such a table; the message names file and line.
    """
    r, derivative = read_columns(path)
    file = Path(path).absolute()
    return table_law(r, derivative, extend=extend, friction=friction, name=name, where=shown(path), file=file)


def even_table(
    slips: Array,
    values: Array,
    *,
    extend: str = "constant",
    name: str = "table",
    stated: Mapping[str, object] | None = None,
) -> PiecewiseQuadratic:
    """The even law whose derivative for r >= 0 is linear between the points ``(slips, values)``, (K,) each.

    Slips are >= 0 and do not fall, a repeated one is a jump; before the first one j' is constant, beyond the last one
    it goes on by ``extend``. The value at r = 0+ is half the jump at zero: the resistance against the first slip.
    """
    slips, values = np.asarray(slips, dtype=float), np.asarray(values, dtype=float)
    if slips[0] > 0.0:
        slips, values = np.concatenate([[0.0], slips]), np.concatenate([values[:1], values])
    knots = np.unique(slips)
    first = np.searchsorted(slips, knots, side="left")
    last = np.searchsorted(slips, knots, side="right") - 1
    left, right = values[first], values[last]
    inner = (left[1:] - right[:-1]) / np.diff(knots)
    end = inner[-1] if extend == "linear" and inner.size else 0.0
    jumps = (right - left)[1:]
    return PiecewiseQuadratic(
        np.concatenate([-knots[:0:-1], knots]),
        np.concatenate([[end], inner[::-1], inner, [end]]),
        np.concatenate([jumps[::-1], [2.0 * right[0]], jumps]),
        start=-float(right[-1]),
        name=name,
        stated=stated,
    )


@named(
    LawKind.NORMAL,
    "pressure-table",
    "any graph: the pressure is linear between the points of two lists; a repeated penetration is a jump",
    "j' from a table",
)
@stating(
    penetrations=numbers("not falling; negative ones are openings", LENGTH, (0.0, 0.1)),
    pressures=numbers("pressures there; negative ones are tension", PRESSURE, (0.0, 1.0)),
    extend=EXTEND,
)
def _pressure_table(
    penetrations: Sequence[float], pressures: Sequence[float], extend: str = "constant"
) -> PiecewiseQuadratic:
    law = table_law(penetrations, pressures, extend=extend, name="pressure-table", where="pressure-table")
    stated = {"penetrations": tuple(penetrations), "pressures": tuple(pressures), "extend": extend}
    return replace(law, stated=MappingProxyType({"law": "pressure-table", **stated}))
