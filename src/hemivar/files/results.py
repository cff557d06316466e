"""Results as files: JSON, CSV, VTU."""

from __future__ import annotations

import contextlib
import csv
import io
import json
import math
from collections.abc import Iterable, Mapping, Sequence
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np

from hemivar.basics.disk import make_folder, open_new, read_text, regular_file, whole_file, write_text
from hemivar.basics.types import Array
from hemivar.certify import Certificate
from hemivar.discrete.problem import DiscreteProblem
from hemivar.discrete.residual import Residual
from hemivar.errors import ProblemError
from hemivar.fem import nodal_average, strain, stress, von_mises
from hemivar.fem.assembly import region_masks
from hemivar.files.boundary import ContactBoundary, contact_boundaries, global_vectors
from hemivar.mechanics.statement import ContactProblem
from hemivar.mesh.mesh import Mesh
from hemivar.solvers import BoundaryResult, ContactState, Progress, Solution
from hemivar.solvers.boundary_result import table_columns

__all__ = [
    "contact_columns",
    "read_json",
    "read_solution",
    "solution_record",
    "write_csv",
    "write_json",
    "write_vtu",
]

_MOST_BYTES = 2**31


# ---- JSON ---------------------------------------------------------------------------------------------------


def iteration_record(
    residual: Residual, steps: int, evaluations: int, timings: Mapping[str, float], history: Sequence[Progress]
) -> dict[str, Any]:
    """The part of a record that tells how the iteration went, the same in serial and on many ranks."""
    return {
        "residual": residual.relative,
        "residual_parts": {
            "equilibrium": residual.equilibrium,
            "inclusion": residual.inclusion,
            "scale": residual.scale,
            "rounding": residual.rounding,
        },
        "steps": steps,
        "evaluations": evaluations,
        "timings": dict(timings),
        "history": [
            {
                "step": line.step,
                "energy": line.energy,
                "residual": line.residual,
                "changed": line.changed,
                "seconds": line.seconds,
            }
            for line in history
        ],
    }


def solution_record(solution: Solution, certificate: Certificate | None = None) -> dict[str, Any]:
    """A solution as plain numbers, lists and strings, ready for JSON.

    Keys: ``hemivar`` (version), ``status``, ``remedy``, ``warnings`` (sentences), ``method``,
    ``unknowns`` (their number), ``contact_points``, ``dim``, ``energy`` (a friction bound that depends on the state is
    taken at this pair), ``residual`` (relative), ``residual_parts`` (equilibrium, inclusion, scale, rounding; units of
    force), ``steps``, ``evaluations``, ``timings`` (seconds), ``history``, ``error_bound``, ``contact_length``,
    ``resultants``, ``boundaries``, ``reactions``, ``contact``, ``displacement`` (vectors of the nodes; the unknowns of
    a problem made of arrays) and, where one is given, ``certificate`` (:meth:`hemivar.certify.Certificate.record`).

    ``resultants`` holds ``normal_force`` (resultant of the pressure), ``friction_force`` (resultant of the friction
    in local components) and ``force``, the global vector of the force of the foundation on the body,
    ``-sum_j w_j (lam_nu nu + lam_tau)``; null where the problem has no frames.  ``boundaries`` holds for each contact
    boundary, by name, its ``normal_force``, ``force`` and ``contact_length``; ``reactions`` the force of each support
    on the body, by name, null where it is not known (:func:`hemivar.fem.support_reactions`).

    ``contact`` holds one entry for each contact point: ``x`` and ``normal`` (vectors; null without points or frames),
    ``boundary`` (name; null if unknown), ``weight``, ``gap`` (that of the obstacle where there is one, less what
    supports prescribe), ``penetration``, ``slip``, ``pressure``, ``friction``, ``state`` ("open", "stick", "slip") and
    ``without_friction`` (whether friction of the law had to be left out there; null if unknown).
    Slip and friction are numbers in 2D (along the normal turned by +90 degrees), vectors of two local components in
    3D, and null in 1D. Numbers that are not finite become null.
    """
    problem = solution.problem
    residual = solution.residual
    record = {
        "hemivar": _version(),
        "status": solution.status.value,
        "remedy": solution.status.remedy,
        "warnings": solution.warnings,
        "method": solution.method,
        "unknowns": problem.unknowns,
        "contact_points": problem.contact_points,
        "dim": problem.dim,
        "energy": solution.energy,
        **iteration_record(residual, solution.steps, solution.evaluations, solution.timings, solution.history),
        "error_bound": solution.error_bound,
        "contact_length": solution.contact_length,
        "resultants": {
            "normal_force": solution.normal_force,
            "friction_force": solution.friction_force,
            "force": None if problem.frames is None else foundation_force(solution),
        },
        "boundaries": {name: _boundary_record(solution.on(name)) for name in problem.contact.names},
        "reactions": _reactions(solution),
        "contact": _contact_record(solution),
        "displacement": solution.displacement,
    }
    if certificate is not None:
        record["certificate"] = certificate.record()
    return {key: _plain(value) for key, value in record.items()}


def foundation_force(solution: Solution) -> Array:
    """Resultant force of the foundation on the body, global vector (d,): ``-sum_j w_j (lam_nu nu + lam_tau)``."""
    problem = solution.problem
    return np.asarray(-(problem.weights @ global_vectors(problem, solution.multiplier)))


def _boundary_record(result: BoundaryResult) -> dict[str, Any]:
    return {"normal_force": result.normal_force, "force": result.force, "contact_length": result.contact_length}


def _reactions(solution: Solution) -> dict[str, Array] | None:
    try:
        return dict(solution.reactions)
    except ProblemError:
        return None


def _contact_record(solution: Solution) -> dict[str, Any]:
    problem = solution.problem
    return {
        "x": problem.points,
        "normal": None if problem.frames is None else problem.frames[:, 0],
        "boundary": _boundary_names(problem),
        "weight": problem.weights,
        "gap": problem.gap,
        "penetration": solution.penetration,
        "slip": _tangential(solution.slip),
        "pressure": solution.pressure,
        "friction": _tangential(solution.friction),
        "state": _state_names(solution),
        "without_friction": problem.without_friction,
    }


def _tangential(values: Array) -> Array | None:
    """Tangential components as numbers in 2D, vectors in 3D, and nothing in 1D."""
    if values.shape[1] == 1:
        return values[:, 0]
    return values if values.shape[1] > 1 else None


def _state_names(solution: Solution) -> list[str]:
    return [ContactState(number).label for number in solution.state.tolist()]


def _boundary_names(problem: DiscreteProblem) -> list[str] | None:
    boundaries = _boundaries_or_none(problem)
    if boundaries is None:
        return None
    names = np.empty(problem.contact_points, dtype=object)
    for boundary in boundaries:
        names[boundary.index] = boundary.name
    return list(names)


def _boundaries_or_none(problem: DiscreteProblem) -> list[ContactBoundary] | None:
    try:
        return contact_boundaries(problem)
    except ProblemError:
        return None


def _plain(value: Any) -> Any:
    """Lists, numbers and strings; numbers that are not finite become None."""
    if isinstance(value, np.ndarray):
        return _plain(value.tolist())
    if isinstance(value, dict):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def write_json(solution: Solution, path: str | Path, certificate: Certificate | None = None) -> Path:
    """Write :func:`solution_record` to a JSON file; returns its path."""
    path = _prepared(path, ".json")
    record = solution_record(solution, certificate)
    # the displacement comes last and on one line, for it is long
    displacement = json.dumps(record.pop("displacement"), allow_nan=False)
    head = json.dumps(record, indent=1, allow_nan=False)
    write_text(path, f'{head[:-2]},\n "displacement": {displacement}\n}}\n')
    return path


def read_json(path: str | Path) -> dict[str, Any]:
    """A record written by :func:`write_json`.

    Raises
    ------
    ProblemError
        The file is missing, or is not JSON with an object in it.
    """
    path = Path(path)
    text = read_text(path, "result file", _MOST_BYTES)
    try:
        record = json.loads(text)
    except (ValueError, RecursionError) as error:  # also numbers of too many digits, and brackets nested too deep
        raise ProblemError(f"result file '{path}' is not JSON ({error}); write it with write_json") from error
    if not isinstance(record, dict):
        raise ProblemError(f"result file '{path}' holds no record of a solution; write it with write_json")
    return record


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


def _numbers(value: Any, what: str, path: Path) -> Array:
    try:
        array = np.asarray(value)
        if array.dtype.kind not in "iuf" and array.size:  # texts and truth values are none, nor are numbers beyond 2^64
            raise ValueError
        array = array.astype(float)
    except (TypeError, ValueError, OverflowError):
        raise ProblemError(f"result file '{path}': '{what}' is not an array of numbers") from None
    if not np.isfinite(array).all():
        raise ProblemError(f"result file '{path}': '{what}' holds entries that are not finite numbers")
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
            f"result file '{path}': the displacement misses the supports of this problem by {moved:.3g}; "
            f"take the problem file it was computed from"
        )
    return unknowns


def _other_mesh(path: Path, why: str) -> ProblemError:
    return ProblemError(
        f"result file '{path}' belongs to another mesh: {why}; take the problem file it was computed from"
    )


def _read_multiplier(contact: Mapping[str, Any], problem: DiscreteProblem, path: Path) -> Array | None:
    m, d = problem.contact_points, problem.dim
    pressure = _numbers(contact["pressure"], "contact.pressure", path)
    if pressure.shape != (m,):
        raise _other_mesh(path, f"it has {pressure.size} contact points, not {m}")
    if contact.get("x") is not None and problem.points is not None:
        points = _numbers(contact["x"], "contact.x", path)
        if points.shape != problem.points.shape or not _same_points(points, problem.points):
            raise _other_mesh(path, "its contact points lie elsewhere")
    multiplier = np.zeros((m, d))
    multiplier[:, 0] = pressure
    if d > 1:
        if contact.get("friction") is None:
            return None
        friction = _numbers(contact["friction"], "contact.friction", path)
        if friction.size != m * (d - 1):
            raise _other_mesh(path, f"its friction has shape {friction.shape}")
        multiplier[:, 1:] = friction.reshape(m, d - 1)
    return multiplier


def _same_points(first: Array, second: Array) -> bool:
    size = float(np.ptp(second, axis=0).max(initial=0.0)) or 1.0
    return bool(np.abs(first - second).max(initial=0.0) <= 1e-6 * size)


def _vtu_displacement(path: Path, problem: DiscreteProblem) -> Array:
    import meshio

    field = problem.field
    if field is None:
        raise ProblemError(f"'{path}': a problem made of arrays has no mesh; give its solution as JSON")
    regular_file(path, "result file", _MOST_BYTES)
    noise = io.StringIO()
    try:
        with contextlib.redirect_stdout(noise), contextlib.redirect_stderr(noise):
            grid = meshio.read(path, file_format="vtu")
    except (Exception, SystemExit) as error:  # meshio raises many kinds of errors on broken files
        reason = " ".join(str(error).split()) or type(error).__name__
        raise ProblemError(f"result file '{path}' is not a readable VTU file ({reason})") from error
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


# ---- CSV ----------------------------------------------------------------------------------------------------


def contact_columns(solution: Solution) -> dict[str, list[Any]]:
    """The contact points of a solution as columns of a table.

    ``boundary, x, y, (z,) normal_x, ..., weight, gap, penetration, slip, pressure, friction, state``; in 3D slip and
    friction have two columns each, ``slip_1, slip_2``. Columns that the problem does not know are left out.
    """
    columns = table_columns(solution.contact_table)
    return {name: values.tolist() for name, values in columns.items() if not name.startswith("force")}


def write_csv(solution: Solution, path: str | Path) -> Path:
    """Write one line for each contact point, columns as in :func:`contact_columns`; returns the path."""
    path = _prepared(path, ".csv")
    columns = contact_columns(solution)
    _write_rows(path, list(columns), zip(*columns.values(), strict=True))
    return path


def _write_rows(path: Path, header: list[str], rows: Iterable[Iterable[Any]]) -> None:
    with whole_file(path) as name, open_new(name) as stream:
        writer = csv.writer(stream)
        writer.writerow(header)
        writer.writerows(rows)


def _prepared(path: str | Path, suffix: str) -> Path:
    """The path with its folder made; only the expected suffix is accepted."""
    path = Path(path)
    if path.suffix.lower() != suffix:
        raise ProblemError(f"'{path}' must end in '{suffix}'")
    make_folder(path.parent)
    return path


# ---- VTU ----------------------------------------------------------------------------------------------------

_CELL_TYPES = {(2, 1): "triangle", (2, 2): "triangle6", (3, 1): "tetra", (3, 2): "tetra10"}
_FACET_TYPES = {(2, 1): "line", (2, 2): "line3", (3, 1): "triangle", (3, 2): "triangle6"}


def write_vtu(solution: Solution, path: str | Path) -> tuple[Path, Path | None]:
    """Write the body as ``path`` and its contact boundaries as ``*_contact.vtu``, for ParaView and the like.

    Point data of the body: ``displacement`` (3 components), ``stress`` (nodal averages), and on the contact boundary
    ``pressure``, ``gap``, ``penetration``, ``friction`` and ``slip`` (global vectors), ``contact_force`` (force per
    area of the foundation on the body, global vector) and ``state`` (0 open, 1 stick, 2 slip). Off the contact
    boundary, and at contact nodes that a support holds entirely, these are 0 and ``state`` is -1. A node of two contact
    boundaries carries the values of the first.

    Cell data: ``stress``, six components xx, yy, zz, xy, yz, xz (the order of symmetric tensors in VTK; zz of plane
    models included), ``von_mises`` and ``region`` (number of the region in the order of the mesh, -1 in none).
    Quadratic fields use quadratic cells, with the stress of the centroid.

    Parameters
    ----------
    solution : Solution
        Of a problem with a mesh.
    path : str or Path
        Must end in ``.vtu``.

    Returns
    -------
    body, contact : Path, Path or None
        The files; None if the problem has no contact boundary.

    Raises
    ------
    ProblemError
        The problem was made of arrays and has no mesh.
    """
    path = _prepared(path, ".vtu")
    problem = solution.problem
    field = problem.field
    if field is None:
        raise ProblemError("this problem was made of arrays and has no mesh to draw on; use write_json or write_csv")
    mesh, order = field.mesh, field.order
    boundaries = contact_boundaries(problem)
    nodes = field.nodes
    point_data: dict[str, Array] = {"displacement": _three(solution.displacement)}
    cell_data: dict[str, Array] = {"region": _region_numbers(mesh)}
    if problem.origin is not None:
        tensor = _symmetric_stress(problem.origin, solution.displacement)
        point_data["stress"] = nodal_average(problem.origin, tensor)
        cell_data |= {"stress": tensor, "von_mises": von_mises(problem.origin, solution.displacement)}
    quantities = _contact_quantities(solution)
    for name, (_, fill) in quantities.items():
        point_data[name] = np.full((len(nodes), *quantities[name][0].shape[1:]), fill)
    blocks: list[tuple[ContactBoundary, dict[str, Array]]] = []
    for boundary in reversed(boundaries):
        used = boundary.used_nodes
        data = {name: boundary.at_nodes(values, fill) for name, (values, fill) in quantities.items()}
        for name, values in data.items():
            held = data["state"] < 0
            point_data[name][used[~held]] = values[~held]
        blocks.insert(0, (boundary, data))
    _write_grid(path, _three(nodes), {_CELL_TYPES[mesh.dim, order]: mesh.cell_nodes(order)}, point_data, cell_data)
    if not boundaries:
        return path, None
    second = path.with_name(f"{path.stem}_contact.vtu")
    _write_contact(second, solution, blocks)
    return path, second


def _contact_quantities(solution: Solution) -> dict[str, tuple[Array, float]]:
    """Values at contact points, and what to write elsewhere."""
    problem = solution.problem
    if problem.contact_points == 0:
        return {}
    friction = global_vectors(problem, solution.multiplier, normal=False)
    return {
        "pressure": (solution.pressure, 0.0),
        "gap": (problem.gap, 0.0),
        "penetration": (solution.penetration, 0.0),
        "friction": (_three(friction), 0.0),
        "slip": (_three(global_vectors(problem, solution.local, normal=False)), 0.0),
        "contact_force": (_three(-global_vectors(problem, solution.multiplier)), 0.0),
        "state": (solution.state.astype(float), -1.0),
    }


def _write_contact(path: Path, solution: Solution, blocks: list[tuple[ContactBoundary, dict[str, Array]]]) -> None:
    field = solution.problem.field
    assert field is not None
    kind = _FACET_TYPES[field.mesh.dim, field.order]
    cells, numbers, start = [], [], 0
    for number, (boundary, _) in enumerate(blocks):
        cells.append(start + np.searchsorted(boundary.used_nodes, boundary.members))
        numbers.append(np.full(len(boundary.members), number, dtype=np.int32))
        start += len(boundary.used_nodes)
    used = np.concatenate([boundary.used_nodes for boundary, _ in blocks])
    point_data: dict[str, Array] = {"displacement": _three(solution.displacement[used])}
    for name in blocks[0][1]:
        point_data[name] = np.concatenate([data[name] for _, data in blocks])
    data = {"boundary": np.concatenate(numbers)}
    _write_grid(path, _three(field.nodes[used]), {kind: np.vstack(cells)}, point_data, data)


def _write_grid(
    path: Path, points: Array, cells: dict[str, Any], point_data: dict[str, Array], cell_data: Mapping[str, Any]
) -> None:
    import meshio

    states = {name: np.ceil(values).astype(np.int32) for name, values in point_data.items() if name == "state"}
    grid = meshio.Mesh(
        points, cells, point_data={**point_data, **states}, cell_data={k: [v] for k, v in cell_data.items()}
    )
    noise = io.StringIO()
    with whole_file(path) as name, contextlib.redirect_stdout(noise), contextlib.redirect_stderr(noise):
        grid.write(name, file_format="vtu")


def _symmetric_stress(field: ContactProblem, displacement: Array) -> Array:
    """Stress of each cell as xx, yy, zz, xy, yz, xz, shape (M, 6)."""
    sigma = stress(field, displacement)
    out = np.zeros((len(sigma), 6))
    out[:, 0], out[:, 1], out[:, 3] = sigma[:, 0, 0], sigma[:, 1, 1], sigma[:, 0, 1]
    mesh = field.mesh
    if mesh.dim == 3:
        out[:, 2], out[:, 4], out[:, 5] = sigma[:, 2, 2], sigma[:, 1, 2], sigma[:, 0, 2]
    else:
        centroids = mesh.points[mesh.cells].mean(axis=1)
        out[:, 2] = field.material.out_of_plane_stress(centroids, strain(field, displacement), region_masks(mesh))
    return out


def _region_numbers(mesh: Mesh) -> Array:
    numbers = np.full(mesh.number_of_cells, -1, dtype=np.int32)
    for number, cells in enumerate(mesh.regions.values()):
        numbers[cells] = number
    return np.asarray(numbers)


def _three(vectors: Array) -> Array:
    """Vectors with two or three components as vectors with three."""
    out = np.zeros((len(vectors), 3))
    out[:, : vectors.shape[1]] = vectors
    return out


def _version() -> str:
    try:
        return metadata.version("hemivar")
    except metadata.PackageNotFoundError:
        return "unknown"
