"""Solutions as VTU, for ParaView and the like."""

from __future__ import annotations

import contextlib
import io
import math
from collections.abc import Callable, Mapping
from pathlib import Path
from xml.sax.saxutils import quoteattr

import numpy as np

from hemivar.basics.disk import read_bytes, whole_file
from hemivar.basics.first_use import IMPORTS
from hemivar.basics.types import Array, IntArray
from hemivar.errors import ProblemError
from hemivar.fem import gradient, nodal_average, stress, von_mises
from hemivar.fem.area_average import area_average
from hemivar.fem.fields import out_of_plane_stress
from hemivar.files.boundary import ContactBoundary, contact_boundaries
from hemivar.files.record import prepared
from hemivar.files.snapshot import Snapshot
from hemivar.mechanics.material_words import ScalarKind
from hemivar.mechanics.statement import ContactProblem
from hemivar.mesh import Mesh
from hemivar.solvers import Solution, Status
from hemivar.solvers.boundary_result import ContactValues

__all__ = [
    "CELL_TYPES",
    "WHOLE",
    "body_fields",
    "contact_quantities",
    "field_data",
    "region_numbers",
    "three_components",
    "write_grid",
    "write_vtu",
]


#: Point data that are whole numbers.
WHOLE = ("state", "tangential_state", "boundary")

CELL_TYPES = {(2, 1): "triangle", (2, 2): "triangle6", (3, 1): "tetra", (3, 2): "tetra10"}
_FACET_TYPES = {(2, 1): "line", (2, 2): "line3", (3, 1): "triangle", (3, 2): "triangle6"}


def write_vtu(
    solution: Solution | Snapshot, path: str | Path, cell_values: Mapping[str, Array] | None = None
) -> tuple[Path, Path | None]:
    """Write the body as ``path`` and its contact boundaries as ``*_contact.vtu``, for ParaView and the like.

    Point data of the body: ``displacement`` (3 components), ``stress`` (nodal averages), and on the contact boundary
    ``pressure``, ``gap``, ``penetration``, ``slip`` (a global vector), ``friction`` (of the foundation on the body, a
    global vector), ``contact_force`` (pressure and friction on the body, force per area, a global vector), ``state`` (0
    open, 1 contact and stick, 2 contact and slip, 3 bonded, 4 softening, 5 debonded, 6 contact without friction),
    ``tangential_state`` (0 free, 1 stick, 2 slip; of bonded and softening points too) and ``boundary`` (number of the
    contact boundary, in the order of the statement; the field data ``boundary NAME`` hold the number of each). Off the
    contact boundary, and at contact nodes that a support holds entirely, these are 0, and states and ``boundary`` are
    -1. A node of two contact boundaries carries the values of the first, and where contact points are midpoints of
    facets the states of one of its facets.

    Cell data: ``stress``, six components xx, yy, zz, xy, yz, xz (the order of symmetric tensors in VTK; zz of plane
    models included), ``von_mises`` and ``region`` (number of the region in the order of the mesh, -1 in none).
    Quadratic fields use quadratic cells, with the stress of the centroid.

    A scalar problem is one file. Point data: the unknown by its name (``deflection``, ``temperature``; ``u_z`` in
    antiplane shear), for membranes and antiplane shear ``displacement`` as well, a vector across the plane to warp by,
    and ``velocity`` in time; ``flux`` (``A grad u``, a vector, nodal averages); at contact points, of areas as well,
    what a body has there, with ``friction`` and ``slip`` as numbers where there is friction. ``pressure`` is that of
    the law at each node; with contact over areas ``mean_pressure`` is its average over cells, which is the force per
    area also where nodes of the mesh differ. Cell data: ``gradient``
    and ``flux`` in the middle of each cell.

    Of a moment of an evolution the stress is the elastic one, ``velocity`` and ``rate`` (of the contact points, global
    vectors) join the point data, and so does what contact points remember, by its name; slip follows the
    rate.  Of a body with heat there are ``temperature`` at the points and ``thermal_stress`` in the cells, the rows of
    a matrix (d, d) that the whole stress is smaller by.

    A solve that did not converge is named in the field data: ``NOT A SOLUTION: interrupted``.

    Parameters
    ----------
    solution : Solution or Snapshot
        Of a problem with a mesh.
    path : str or Path
        Must end in ``.vtu``.
    cell_values : mapping of name to array, shape (M,) or (M, k), optional
        More data of the cells, such as the indicator of an adaptive solve.

    Returns
    -------
    body, contact : Path, Path or None
        The files; None if the problem has no contact boundary.

    Raises
    ------
    ProblemError
        The problem was made of arrays and has no mesh.
    """
    path = prepared(path, ".vtu")
    problem = solution.problem
    field = problem.field
    if field is None:
        raise ProblemError(
            "this problem was made of arrays and has no mesh; give one, of_arrays(..., mesh=...), or use write_json"
        )
    mesh, nodes = field.mesh, field.nodes
    scalar = problem.origin is not None and problem.origin.kind is not None
    point_data, own = (_scalar_fields if scalar else body_fields)(solution)
    cell_data: dict[str, Array] = {"region": region_numbers(mesh), **own, **_checked(mesh, cell_values)}
    boundaries = [] if scalar else contact_boundaries(problem)
    quantities = contact_quantities(solution) if boundaries or (scalar and problem.contact.count) else {}
    for name, (values, fill) in quantities.items():
        point_data[name] = np.full((len(nodes), *values.shape[1:]), fill)
        if scalar:
            point_data[name][problem.contact.node] = values
    blocks: list[tuple[ContactBoundary, dict[str, Array]]] = []
    for boundary in reversed(boundaries):
        used = boundary.used_nodes
        data = {
            name: boundary.at_nodes(values, fill, whole=name in WHOLE) for name, (values, fill) in quantities.items()
        }
        for name, values in data.items():
            held = data["state"] < 0
            point_data[name][used[~held]] = values[~held]
        blocks.insert(0, (boundary, data))
    kind = {CELL_TYPES[mesh.dim, field.order]: mesh.cell_nodes(field.order)}
    write_grid(path, three_components(nodes), kind, point_data, cell_data, field_data(solution))
    if not boundaries:
        return path, None
    second = path.with_name(f"{path.stem}_contact.vtu")
    _write_contact(second, solution, blocks)
    return path, second


def field_data(solution: Solution | Snapshot) -> dict[str, float]:
    """What a file says of the whole: numbers of boundaries, the time of forces, and whether this is no equilibrium."""
    names: dict[str, float] = {f"boundary {name}": number for number, name in enumerate(solution.problem.contact.names)}
    if isinstance(solution, Snapshot):
        return {**names, "force_time": solution.force_time}
    return names if solution.status is Status.CONVERGED else {**names, f"NOT A SOLUTION: {solution.status.value}": 1}


def body_fields(
    solution: Solution | Snapshot, summed: Callable[[Array], Array] | None = None
) -> tuple[dict[str, Array], dict[str, Array]]:
    """Point data and cell data of a body; ``summed`` as in :func:`hemivar.fem.nodal_average`."""
    stated = solution.problem.origin
    point_data: dict[str, Array] = {"displacement": three_components(solution.displacement)}
    cell_data: dict[str, Array] = {}
    if isinstance(solution, Snapshot):
        point_data["velocity"] = three_components(solution.velocity)
        if solution.temperature is not None:
            point_data["temperature"] = solution.temperature
    if stated is not None:
        tensor = _symmetric_stress(stated, solution.displacement)
        point_data["stress"] = nodal_average(stated, tensor, summed)
        cell_data |= {"stress": tensor, "von_mises": von_mises(stated, solution.displacement)}
        if isinstance(solution, Snapshot) and solution.thermal_stress is not None:
            cell_data["thermal_stress"] = solution.thermal_stress.reshape(len(solution.thermal_stress), -1)
    return point_data, cell_data


def _scalar_fields(solution: Solution | Snapshot) -> tuple[dict[str, Array], dict[str, Array]]:
    """Point data and cell data of a scalar problem."""
    stated, values = solution.problem.origin, solution.displacement[:, 0]
    assert stated is not None
    slope, flux = map(three_components, gradient(stated, solution.displacement))
    point_data: dict[str, Array] = {"u_z" if stated.kind is ScalarKind.ANTIPLANE else stated.unknown: values}
    if not stated.thermal:
        if isinstance(solution, Snapshot):
            point_data["velocity"] = solution.velocity[:, 0]
        point_data["displacement"] = np.column_stack([np.zeros((len(values), 2)), values])
    if stated.areas:
        point_data["mean_pressure"] = np.zeros(len(values))
        mean = area_average(solution.problem, solution.pressure)
        point_data["mean_pressure"][solution.problem.contact.node] = mean
    return point_data | {"flux": nodal_average(stated, flux)}, {"gradient": slope, "flux": flux}


def _checked(mesh: Mesh, values: Mapping[str, Array] | None) -> dict[str, Array]:
    """More data of the cells, one value or row for each of them."""
    found = {name: np.asarray(value, dtype=float) for name, value in ({} if values is None else values).items()}
    for name, value in found.items():
        if value.shape[:1] != (mesh.number_of_cells,):
            raise ProblemError(
                f"cell values '{name}' have shape {value.shape}; the mesh has {mesh.number_of_cells} cells"
            )
    return found


def contact_quantities(seen: ContactValues) -> dict[str, tuple[Array, float]]:
    """Values at contact points, and what to write elsewhere."""
    contact = seen.contact
    quantities = {
        "pressure": (seen.pressure, 0.0),
        "gap": (seen.gap, 0.0),
        "penetration": (seen.penetration, 0.0),
    }
    if contact.frames is not None:
        quantities |= {
            "friction": (three_components(seen.friction_vectors), 0.0),
            "slip": (three_components(seen.slip_vectors), 0.0),
            "contact_force": (three_components(seen.tractions), 0.0),
        }
    elif contact.components > 1:
        quantities |= {"friction": (seen.friction[:, 0], 0.0), "slip": (seen.slip[:, 0], 0.0)}
    quantities |= {
        "state": (seen.states.codes.astype(float), -1.0),
        "tangential_state": (seen.tangential_state.astype(float), -1.0),
        "boundary": (contact.boundary.astype(float), -1.0),
    }
    for name, values in seen.debonding.items():
        fill = -1.0 if name == "mode_ratio" else 0.0
        quantities[name] = (np.where(np.isnan(values), fill, values), fill)
    if isinstance(seen, Snapshot) and contact.frames is not None:
        quantities["rate"] = (three_components(contact.global_vectors(seen.rate)), 0.0)
        for name, values in seen.memory.items():
            kept = np.asarray(values, dtype=float)
            free = name if name not in (*quantities, "displacement", "velocity", "stress") else f"memory of {name}"
            quantities[free] = (kept.reshape(len(kept), math.prod(kept.shape[1:])) if kept.ndim > 1 else kept, 0.0)
    return quantities


def _write_contact(
    path: Path, solution: Solution | Snapshot, blocks: list[tuple[ContactBoundary, dict[str, Array]]]
) -> None:
    field, names = solution.problem.field, solution.problem.contact.names
    assert field is not None
    kind = _FACET_TYPES[field.mesh.dim, field.order]
    cells, numbers, start = [], [], 0
    for boundary, _ in blocks:
        cells.append(start + np.searchsorted(boundary.used_nodes, boundary.members))
        numbers.append(np.full(len(boundary.members), names.index(boundary.name), dtype=np.int32))
        start += len(boundary.used_nodes)
    used = np.concatenate([boundary.used_nodes for boundary, _ in blocks])
    point_data: dict[str, Array] = {"displacement": three_components(solution.displacement[used])}
    for name in blocks[0][1]:
        point_data[name] = np.concatenate([data[name] for _, data in blocks])
    data: dict[str, Array] = {"boundary": np.asarray(np.concatenate(numbers))}
    write_grid(
        path, three_components(field.nodes[used]), {kind: np.vstack(cells)}, point_data, data, field_data(solution)
    )


def write_grid(
    path: Path,
    points: Array,
    cells: Mapping[str, IntArray],
    point_data: Mapping[str, Array],
    cell_data: Mapping[str, Array],
    told: Mapping[str, float],
) -> None:
    """Write a VTU file, silently; states and ``boundary`` become whole numbers, and what is told field data."""
    with IMPORTS:
        import meshio

    whole = {name: values.astype(np.int32) for name, values in point_data.items() if name in WHOLE}
    grid = meshio.Mesh(
        points, cells, point_data={**point_data, **whole}, cell_data={k: [v] for k, v in cell_data.items()}
    )
    noise = io.StringIO()
    with whole_file(path) as name, contextlib.redirect_stdout(noise), contextlib.redirect_stderr(noise):
        grid.write(name, file_format="vtu")
        if told:  # meshio writes no field data
            arrays = "".join(
                f'<DataArray type="{"Int32" if isinstance(number, int) else "Float64"}" Name={quoteattr(known)} '
                f'NumberOfTuples="1" format="ascii">{number!r}</DataArray>\n'
                for known, number in told.items()
            )
            start = b"<UnstructuredGrid>"
            begun = start + f"<FieldData>\n{arrays}</FieldData>\n".encode()
            name.write_bytes(read_bytes(name, "VTU file", 1 << 62).replace(start, begun, 1))


def _symmetric_stress(stated: ContactProblem, displacement: Array) -> Array:
    """Stress of each cell as xx, yy, zz, xy, yz, xz, shape (M, 6)."""
    sigma = stress(stated, displacement)
    out = np.zeros((len(sigma), 6))
    out[:, 0], out[:, 1], out[:, 3] = sigma[:, 0, 0], sigma[:, 1, 1], sigma[:, 0, 1]
    mesh = stated.mesh
    if mesh.dim == 3:
        out[:, 2], out[:, 4], out[:, 5] = sigma[:, 2, 2], sigma[:, 1, 2], sigma[:, 0, 2]
    else:
        out[:, 2] = out_of_plane_stress(stated, displacement)
    return out


def region_numbers(mesh: Mesh) -> Array:
    """The number of the region of each cell, in the order of the mesh; -1 in none."""
    numbers = np.full(mesh.number_of_cells, -1, dtype=np.int32)
    for number, cells in enumerate(mesh.regions.values()):
        numbers[cells] = number
    return np.asarray(numbers)


def three_components(vectors: Array) -> Array:
    """Vectors with two or three components as vectors with three."""
    out = np.zeros((len(vectors), 3))
    out[:, : vectors.shape[1]] = vectors
    return out
