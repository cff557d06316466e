"""The round trip through a problem file: what it cannot express, in one sentence; where two statements differ."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, is_dataclass

import numpy as np

from hemivar.basics.arguments import described, shortened
from hemivar.errors import ProblemError
from hemivar.formula import Formula
from hemivar.formula.formula import ScalarFormula
from hemivar.mesh import Mesh

__all__ = ["difference", "not_expressible"]


def not_expressible(
    where: str, value: object, can: str = "numbers, and formulas as text (hemivar.formula.Formula)"
) -> ProblemError:
    """The error that says that a problem file cannot hold a value, and what it holds there."""
    if isinstance(value, str):
        what = shortened(value)
    elif callable(value) and not isinstance(value, type):
        what = f"the Python function {getattr(value, '__qualname__', type(value).__name__)}"
    else:
        what = described(value)
    return ProblemError(f"{where} is {what}, which a problem file cannot express; it can express {can}")


def difference(given: object, read: object, where: str = "") -> str | None:
    """Where two statements, or parts of them, differ; None if they say the same.

    Numbers are compared to the last digit. The order of the facets' nodes, of the cells of a region, and where
    formulas stood are no part of a statement.
    """
    if given is read:
        return None
    if isinstance(given, Mesh) and isinstance(read, Mesh):
        return where if _mesh(given) != _mesh(read) else None
    if isinstance(given, Formula) and isinstance(read, Formula):
        looser = given.minimum is not None and (read.minimum is None or read.minimum < given.minimum)
        return where if given.text != read.text or looser else None
    if isinstance(given, ScalarFormula) and isinstance(read, ScalarFormula):
        return None if (given.text, given.variable) == (read.text, read.variable) else where
    if is_dataclass(given) and not isinstance(given, type):
        if type(given) is not type(read):
            return where
        parts = [f.name for f in fields(given) if f.init and f.compare and f.name != "where"]
        pairs = [(getattr(given, part), getattr(read, part), f"{where}.{part}".lstrip(".")) for part in parts]
    elif isinstance(given, Mapping) and isinstance(read, Mapping):
        if set(given) != set(read):
            return where
        pairs = [(value, read[key], f"{where}['{key}']") for key, value in given.items()]
    elif isinstance(given, tuple | list) and any(isinstance(entry, Formula) or _is_part(entry) for entry in given):
        if not isinstance(read, tuple | list) or len(read) != len(given):
            return where
        pairs = [(first, second, f"{where}[{k}]") for k, (first, second) in enumerate(zip(given, read, strict=True))]
    elif callable(given) or callable(read) or given is None or read is None or isinstance(given, str):
        return None if given == read else where
    else:
        return None if _numbers(given, read) else where
    return next((differs for first, second, path in pairs if (differs := difference(first, second, path))), None)


def _is_part(entry: object) -> bool:
    return is_dataclass(entry) and not isinstance(entry, type)


def _numbers(given: object, read_back: object) -> bool:
    """Whether numbers or arrays are the same, a number and an array of one entry taken for the same."""
    try:
        first, second = (np.squeeze(np.asarray(value, dtype=object)) for value in (given, read_back))
    except ValueError:
        first, second = (np.asarray(value, dtype=object) for value in (given, read_back))
    none = {first.ndim, second.ndim} == {0, 1} and not np.any(first) and not np.any(second)  # 0 means no vector
    return none or (first.shape == second.shape and bool(np.all(first == second)))


def _mesh(mesh: Mesh) -> tuple[object, ...]:
    """All that a mesh says, to be compared."""
    facets = {name: np.sort(part, axis=1).tobytes() for name, part in mesh.boundaries.items()}
    regions = {name: np.sort(part).tobytes() for name, part in mesh.regions.items()}
    return mesh.points.tobytes(), mesh.cells.tobytes(), facets, regions
