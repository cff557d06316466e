"""Solutions as VTU, for ParaView and the like."""

from __future__ import annotations

import contextlib
import io
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from xml.sax.saxutils import quoteattr

import numpy as np

from hemivar.basics.disk import read_bytes, whole_file
from hemivar.basics.first_use import IMPORTS
from hemivar.basics.types import Array, IntArray
from hemivar.errors import ProblemError
from hemivar.fem import gradient, nodal_average, stress, von_mises
from hemivar.fem.area_average import area_average, over_area
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
#: Vectors that are opposite on the other side of a contact of two bodies.
_OPPOSITE = ("friction", "slip", "contact_force", "rate")

CELL_TYPES = {(2, 1): "triangle", (2, 2): "triangle6", (3, 1): "tetra", (3, 2): "tetra10"}
_FACET_TYPES = {(2, 1): "line", (2, 2): "line3", (3, 1): "triangle", (3, 2): "triangle6"}


def write_vtu(
    solution: Solution | Snapshot, path: str | Path, cell_values: Mapping[str, Array] | None = None
) -> tuple[Path, Path | None]:
    """Write the body as ``path`` and its contact boundaries as ``*_contact.vtu``, for ParaView and the like.

    Point data of the body: ``displacement`` (3 components), ``stress`` (nodal averages), and on the contact boundary
    ``pressure``, ``gap`` (the clearance that there is, minus the penetration), ``initial_gap`` (as stated, at the time
    of a frame), ``penetration``, ``slip`` (a global vector), ``friction`` (of the foundation on the body, a
    global vector), ``contact_force`` (pressure and friction on the body, force per area, a global vector), ``state`` (0
    open, 1 contact and stick, 2 contact and slip, 3 bonded, 4 softening, 5 debonded, 6 contact without friction),
    ``tangential_state`` (0 free, 1 stick, 2 slip; of bonded and softening points too) and ``boundary`` (number of the
    contact boundary, in the order of the statement; the field data ``boundary NAME`` hold the number of each). Off the
    contact boundary, and at contact nodes that a support holds entirely, these are 0, and states and ``boundary`` are
    -1. A node of two contact boundaries carries the values of the first, and where contact points are midpoints of
    facets the states of one of its facets. Of two bodies that touch, both sides have these data: contact points lie on
    one side, and nodes of the other get means of them, forces and slips with the opposite sign, and the states -1.

    Cell data: ``stress``, six components xx, yy, zz, xy, yz, xz (the order of symmetric tensors in VTK; zz of plane
    models included), ``von_mises``, ``region`` (number of the region in the order of the mesh, -1 in none) and, where
    there are several, ``part`` (number of the body).
    Quadratic fields use quadratic cells, with the stress of the centroid.  Points of contact over an area have their
    data in the body, and ``mean_friction``, the average of the friction over cells.

    A scalar problem is one file. Point data: the unknown by its name (``deflection``, ``temperature``; ``u_z`` in
    antiplane shear), for membranes and antiplane shear ``displacement`` as well, a vector across the plane to warp by,
    and ``velocity`` in time; ``flux`` (``A grad u``, a vector, nodal averages); at contact points, of areas as well,
    what a body has there, with ``friction`` and ``slip`` as numbers where there is friction. ``pressure`` is that of
    the law at each node; with contact over areas ``mean_pressure`` is its average over cells, which is the force per
    area also where nodes of the mesh differ. Cell data: ``gradient``
    and ``flux`` in the middle of each cell.

    Of a state of an evolution the stress is the elastic one, ``velocity`` and ``rate`` (of the contact points, global
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
    parts: dict[str, Array] = {}
    if mesh.parts.count > 1:
        parts["part"] = np.asarray(mesh.parts.cell.astype(np.int32))
    cell_data: dict[str, Array] = {"region": region_numbers(mesh), **parts, **own, **_checked(mesh, cell_values)}
    boundaries = [] if scalar else contact_boundaries(problem)
    direct = np.full(problem.contact_points, True) if scalar else over_area(problem)
    quantities = contact_quantities(solution) if boundaries or direct.any() else {}
    for name, (values, fill) in quantities.items():
        point_data[name] = np.full((len(nodes), *values.shape[1:]), fill)
        point_data[name][problem.contact.node[direct]] = values[direct]
    blocks = [block for boundary in boundaries for block in _blocks(boundary, quantities)]
    for block in sorted(blocks, key=lambda block: block.touched)[::-1]:  # points before means, the first one last
        known = block.data["boundary"] >= 0
        for name, values in block.data.items():
            point_data[name][block.used[known]] = values[known]
    kind = {CELL_TYPES[mesh.dim, field.order]: mesh.cell_nodes(field.order)}
    write_grid(path, three_components(nodes), kind, point_data, cell_data, field_data(solution))
    if not boundaries:
        return path, None
    second = path.with_name(f"{path.stem}_contact.vtu")
    _write_contact(second, solution, blocks)
    return path, second


@dataclass(frozen=True, eq=False)
class _Block:
    """One side of a contact: its facets, and values at its nodes."""

    name: str  # of the contact
    members: IntArray  # (k, q)
    used: IntArray  # (p,), its nodes
    data: Mapping[str, Array]  # (p, ...)
    touched: bool = False


def _blocks(boundary: ContactBoundary, quantities: Mapping[str, tuple[Array, float]]) -> list[_Block]:
    """The side with the contact points, and the one that it touches, on which forces and slips are opposite."""
    data = {name: boundary.at_nodes(values, fill, name in WHOLE) for name, (values, fill) in quantities.items()}
    blocks = [_Block(boundary.name, boundary.members, boundary.used_nodes, data)]
    other = boundary.touched
    if other is not None:
        turned = {name: (-values if name in _OPPOSITE else values, fill) for name, (values, fill) in quantities.items()}
        data = {name: other.at_nodes(values, fill, name in WHOLE) for name, (values, fill) in turned.items()}
        for name in ("state", "tangential_state"):  # those of contact points
            data[name] = np.full(len(data[name]), -1.0)
        blocks.append(_Block(boundary.name, other.members, np.unique(other.members), data, True))
    return blocks


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
    field = solution.problem.field
    assert field is not None
    scalar = field.components == 1  # of a plane, across it
    point_data: dict[str, Array] = {field.name: solution.displacement[:, 0]} if scalar else {}
    point_data["displacement"] = _moved(solution.displacement)
    cell_data: dict[str, Array] = {}
    if isinstance(solution, Snapshot):
        point_data["velocity"] = _moved(solution.velocity)
        if solution.temperature is not None:
            point_data["temperature"] = solution.temperature
    if stated is not None:
        tensor = _symmetric_stress(stated, solution.displacement)
        point_data["stress"] = nodal_average(stated, tensor, summed)
        cell_data |= {"stress": tensor, "von_mises": von_mises(stated, solution.displacement)}
        if stated.areas:
            over, mean = over_area(solution.problem), area_average(solution.problem, solution.friction_vectors)
            point_data["mean_friction"] = np.zeros((len(solution.displacement), 3))
            point_data["mean_friction"][solution.problem.contact.node[over]] = three_components(mean[over])
        if isinstance(solution, Snapshot) and solution.thermal_stress is not None:
            cell_data["thermal_stress"] = solution.thermal_stress.reshape(len(solution.thermal_stress), -1)
    return point_data, cell_data


def _moved(values: Array) -> Array:
    """Vectors in space: one component is that across the plane."""
    return np.hstack([np.zeros((len(values), 2)), values]) if values.shape[1] == 1 else three_components(values)


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
    arrays = {name: np.asarray(value, dtype=float) for name, value in ({} if values is None else values).items()}
    for name, value in arrays.items():
        if value.shape[:1] != (mesh.number_of_cells,):
            raise ProblemError(
                f"cell values '{name}' have shape {value.shape}; the mesh has {mesh.number_of_cells} cells"
            )
    return arrays


def contact_quantities(seen: ContactValues) -> dict[str, tuple[Array, float]]:
    """Values at contact points, and what to write elsewhere."""
    contact = seen.contact
    quantities = {
        "pressure": (seen.pressure, 0.0),
        "gap": (-seen.penetration, 0.0),
        "initial_gap": (seen.gap, 0.0),
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


def _write_contact(path: Path, solution: Solution | Snapshot, blocks: list[_Block]) -> None:
    field, names = solution.problem.field, solution.problem.contact.names
    assert field is not None
    kind = _FACET_TYPES[field.mesh.dim, field.order]
    cells, numbers, start = [], [], 0
    for block in blocks:
        cells.append(start + np.searchsorted(block.used, block.members))
        numbers.append(np.full(len(block.members), names.index(block.name), dtype=np.int32))
        start += len(block.used)
    used = np.concatenate([block.used for block in blocks])
    point_data: dict[str, Array] = {"displacement": three_components(solution.displacement[used])}
    for name in blocks[0].data:
        point_data[name] = np.concatenate([block.data[name] for block in blocks])
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
    field_values: Mapping[str, float],
) -> None:
    """Write a VTU file, silently; states and ``boundary`` become whole numbers, and single values field data."""
    with IMPORTS:
        import meshio

    whole = {name: values.astype(np.int32) for name, values in point_data.items() if name in WHOLE}
    grid = meshio.Mesh(
        points, cells, point_data={**point_data, **whole}, cell_data={k: [v] for k, v in cell_data.items()}
    )
    noise = io.StringIO()
    with whole_file(path) as name, contextlib.redirect_stdout(noise), contextlib.redirect_stderr(noise):
        grid.write(name, file_format="vtu")
        if field_values:  # meshio writes no field data
            arrays = "".join(
                f'<DataArray type="{"Int32" if isinstance(number, int) else "Float64"}" Name={quoteattr(known)} '
                f'NumberOfTuples="1" format="ascii">{number!r}</DataArray>\n'
                for known, number in field_values.items()
            )
            start = b"<UnstructuredGrid>"
            with_data = start + f"<FieldData>\n{arrays}</FieldData>\n".encode()
            name.write_bytes(read_bytes(name, "VTU file", 1 << 62).replace(start, with_data, 1))


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
