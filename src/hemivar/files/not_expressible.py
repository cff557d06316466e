"""What a problem file cannot express, in one sentence; and where two statements differ."""

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


def difference(given: object, found: object, where: str = "") -> str | None:
    """Where two statements, or parts of them, differ; None if they say the same.

    Numbers are compared to the last digit. The order of the facets' nodes, of the cells of a region, and where
    formulas stood are no part of a statement.
    """
    if given is found:
        return None
    if isinstance(given, Mesh) and isinstance(found, Mesh):
        return where if _mesh(given) != _mesh(found) else None
    if isinstance(given, Formula) and isinstance(found, Formula):
        looser = given.minimum is not None and (found.minimum is None or found.minimum < given.minimum)
        return where if given.text != found.text or looser else None
    if isinstance(given, ScalarFormula) and isinstance(found, ScalarFormula):
        return None if (given.text, given.variable) == (found.text, found.variable) else where
    if is_dataclass(given) and not isinstance(given, type):
        if type(given) is not type(found):
            return where
        parts = [f.name for f in fields(given) if f.init and f.compare and f.name != "where"]
        pairs = [(getattr(given, part), getattr(found, part), f"{where}.{part}".lstrip(".")) for part in parts]
    elif isinstance(given, Mapping) and isinstance(found, Mapping):
        if set(given) != set(found):
            return where
        pairs = [(value, found[key], f"{where}['{key}']") for key, value in given.items()]
    elif isinstance(given, tuple | list) and any(isinstance(entry, Formula) or _is_part(entry) for entry in given):
        if not isinstance(found, tuple | list) or len(found) != len(given):
            return where
        pairs = [(one, other, f"{where}[{k}]") for k, (one, other) in enumerate(zip(given, found, strict=True))]
    elif callable(given) or callable(found) or given is None or found is None or isinstance(given, str):
        return None if given == found else where
    else:
        return None if _numbers(given, found) else where
    return next((place for one, other, path in pairs if (place := difference(one, other, path))), None)


def _is_part(entry: object) -> bool:
    return is_dataclass(entry) and not isinstance(entry, type)


def _numbers(given: object, found: object) -> bool:
    """Whether numbers or arrays are the same, a number and an array of one entry taken for the same."""
    try:
        one, other = (np.squeeze(np.asarray(value, dtype=object)) for value in (given, found))
    except ValueError:
        one, other = (np.asarray(value, dtype=object) for value in (given, found))
    none = {one.ndim, other.ndim} == {0, 1} and not np.any(one) and not np.any(other)  # 0 means no vector
    return none or (one.shape == other.shape and bool(np.all(one == other)))


def _mesh(mesh: Mesh) -> tuple[object, ...]:
    """All that a mesh says, to be compared."""
    facets = {name: np.sort(part, axis=1).tobytes() for name, part in mesh.boundaries.items()}
    regions = {name: np.sort(part).tobytes() for name, part in mesh.regions.items()}
    return mesh.points.tobytes(), mesh.cells.tobytes(), facets, regions
