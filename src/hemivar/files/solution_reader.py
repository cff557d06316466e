"""Solutions of earlier runs, read from JSON or VTU as a problem on the same mesh needs them."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from hemivar.basics.types import Array
from hemivar.discrete.problem import DiscreteProblem
from hemivar.errors import ProblemError
from hemivar.files.record import MOST_BYTES, read_json
from hemivar.mesh.vtu_grid import read_vtu

__all__ = ["read_solution"]


def read_solution(path: str | Path, problem: DiscreteProblem) -> tuple[Array, Array | None]:
    """A displacement, and a multiplier if the file has one, as a problem on the same mesh needs them.

    From JSON: the key ``displacement``, and ``pressure`` and ``friction`` under ``contact``. From VTU: the point data
    ``displacement``.

    Parameters
    ----------
    path : str or Path
        A file written by :func:`write_json` or :func:`write_vtu`, or another one with these data.
    problem : DiscreteProblem
        The problem it is to be a solution of.

    Returns
    -------
    unknowns : array (n,)
    multiplier : array (m, d) or None

    Raises
    ------
    ProblemError
        The file cannot be read, holds no displacement, belongs to another mesh, or moves what a support holds.
    """
    path = Path(path)
    if path.suffix.lower() == ".vtu":
        displacement = _vtu_displacement(path, problem)
        return _unknowns(displacement, problem, path), None
    record = read_json(path)
    if record.get("displacement") is None:
        raise ProblemError(
            f"result file '{path}' has no key 'displacement' (of the nodes); write it with 'hemivar solve --json'"
        )
    unknowns = _unknowns(_numbers(record["displacement"], "displacement", path), problem, path)
    contact = record.get("contact")
    if not isinstance(contact, dict) or contact.get("pressure") is None:
        return unknowns, None
    return unknowns, _read_multiplier(contact, problem, path)


def _numbers(value: object, what: str, path: Path) -> Array:
    try:
        array = np.asarray(value)
        if array.dtype.kind not in "iuf" and array.size:  # texts and truth values are none, nor are numbers beyond 2^64
            raise ValueError
        array = array.astype(float)
    except (TypeError, ValueError, OverflowError):
        raise ProblemError(f"result file '{path}': '{what}' is not an array of numbers; write it again") from None
    if not np.isfinite(array).all():
        raise ProblemError(f"result file '{path}': '{what}' holds entries that are not finite numbers; solve again")
    return array


def _unknowns(displacement: Array, problem: DiscreteProblem, path: Path) -> Array:
    field = problem.field
    if field is None:
        if displacement.shape != problem.load.shape:
            raise _other_mesh(path, f"its displacement has shape {displacement.shape}, not {problem.load.shape}")
        return displacement
    expected = (field.number_of_nodes, field.components)
    if displacement.shape != expected:
        raise _other_mesh(path, f"its displacement has shape {displacement.shape}, not {expected}")
    unknowns = field.restrict(displacement)
    moved = float(np.abs(field.full(unknowns) - displacement).max(initial=0.0))
    if moved > 1e-6 * float(np.abs(displacement).max(initial=0.0)):
        raise ProblemError(
            f"result file '{path}': the displacement violates the supports of this problem by {moved:.3g}; "
            f"take the problem file it was computed from"
        )
    return unknowns


def _other_mesh(path: Path, why: str) -> ProblemError:
    return ProblemError(
        f"result file '{path}' belongs to another mesh: {why}; take the problem file it was computed from"
    )


def _read_multiplier(contact: Mapping[str, object], problem: DiscreteProblem, path: Path) -> Array | None:
    m, d = problem.contact_points, problem.contact.components
    pressure = _numbers(contact["pressure"], "contact.pressure", path)
    if pressure.shape != (m,):
        raise _other_mesh(path, f"it has {pressure.size} contact points, not {m}")
    if contact.get("x") is not None and problem.contact.points is not None:
        points = _numbers(contact["x"], "contact.x", path)
        if points.shape != problem.contact.points.shape or not _same_points(points, problem.contact.points):
            raise _other_mesh(path, "its contact points lie elsewhere")
    multiplier = np.zeros((m, d))
    multiplier[:, 0] = pressure
    if d > 1:
        if contact.get("friction") is None:
            return None
        friction = _numbers(contact["friction"], "contact.friction", path)
        if friction.size != m * (d - 1):
            raise _other_mesh(path, f"its friction has shape {friction.shape}")
        multiplier[:, 1:] = 0.0 - friction.reshape(m, d - 1)  # the record holds the friction on the body
    return multiplier


def _same_points(first: Array, second: Array) -> bool:
    size = float(np.ptp(second, axis=0).max(initial=0.0)) or 1.0
    return bool(np.abs(first - second).max(initial=0.0) <= 1e-6 * size)


def _vtu_displacement(path: Path, problem: DiscreteProblem) -> Array:
    """Displacements of the nodes of the same mesh from a VTU file."""
    field = problem.field
    if field is None:
        raise ProblemError(f"'{path}': a problem made of arrays has no mesh; give its solution as JSON")
    grid = read_vtu(path, "result file", MOST_BYTES)
    if "displacement" not in grid.point_data:
        raise ProblemError(f"result file '{path}' has no point data 'displacement'; write it by 'hemivar solve --vtu'")
    points, nodes, d = np.asarray(grid.points, dtype=float), field.nodes, field.mesh.dim
    if points.ndim != 2 or len(points) != len(nodes) or points.shape[1] < d:
        raise _other_mesh(path, f"it has {len(points)} nodes, not {len(nodes)}")
    if not _same_points(points[:, :d], nodes):
        raise _other_mesh(path, "its nodes lie elsewhere")
    values = _numbers(grid.point_data["displacement"], "displacement", path)
    if values.ndim != 2 or values.shape[1] < d:
        raise _other_mesh(path, f"its displacement has shape {values.shape}")
    return np.ascontiguousarray(values[:, :d])
