"""The tables [material], [loads] and [supports] of a problem file, read and written."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from hemivar.files.toml import KEYS, Table, array, context, hint, kind
from hemivar.files.unsaid import unsaid
from hemivar.formula import VARIABLES, Formula, FormulaArray
from hemivar.mechanics.conditions import Clamped, Fixed, Prescribed, Pressure, Roller, Support, Traction, VectorData
from hemivar.mechanics.material import Anisotropic, ByRegion, Isotropic, Material, PlaneState
from hemivar.mesh import Mesh

__all__ = [
    "check_boundary",
    "loads_record",
    "material_record",
    "quantity_record",
    "read_loads",
    "read_material",
    "read_supports",
    "supports_record",
]


def check_boundary(mesh: Mesh, table: Table, name: str) -> None:
    """Refuse the name of a boundary that the mesh does not have."""
    known = list(mesh.boundaries)
    if name not in known:
        raise table.error(name, f"the mesh has no boundary '{name}'{hint(name, known, 'boundaries')}")


# ---- material ---------------------------------------------------------------------------------------------


def read_material(table: Table, mesh: Mesh) -> Material:
    """The material, evaluated once in every cell, so that its errors come before everything else."""
    material = _material(table, mesh)
    if mesh.number_of_cells:  # a rank may have no part of the body
        masks = {}
        for name, cells in mesh.regions.items():
            masks[name] = np.zeros(mesh.number_of_cells, dtype=bool)
            masks[name][cells] = True
        with context(f"{table.source}: [material]"):
            material.stiffness_tensor(mesh.points[mesh.cells].mean(axis=1), masks)
    return material


def _material(table: Table, mesh: Mesh) -> Material:
    if "regions" not in table:
        return _one_material(table, mesh.dim)
    for key in table.data:
        if key != "regions":
            raise table.error(key, "cannot stand beside regions; state it in every [material.regions.NAME]")
    regions = table.table("regions", None)
    if not regions.data:
        raise table.error("regions", "is empty; add tables [material.regions.NAME]")
    known = list(mesh.regions)
    parts: dict[str, Material] = {}
    for name in regions.data:
        if name not in known:
            raise regions.error(name, f"the mesh has no region '{name}'{hint(name, known, 'regions')}")
        parts[name] = _one_material(regions.table(name, KEYS["material.regions.*"]), mesh.dim)
    return Material.by_region(parts)


def _one_material(table: Table, dim: int) -> Material:
    ways = [way for way in ("lame", "young", "tensor") if way in table]
    if len(ways) != 1:
        found = f"{' and '.join(ways)} are given" if ways else "no elastic constants are given"
        raise table.error("lame, young, tensor", f"{found}; give lame, or young and poisson, or tensor")
    owner = {"poisson": ("young",), "out_of_plane": ("tensor",), "plane": ("lame", "young")}
    for key, allowed in owner.items():
        if key in table and ways[0] not in allowed:
            raise table.error(key, f"goes with {' or '.join(allowed)}, not with {ways[0]}; remove it")
    if "plane" in table and dim == 3:
        raise table.error("plane", "is for plane meshes, but this mesh is three-dimensional; remove it")
    plane = table.text("plane", "strain", [state.value for state in PlaneState])
    if ways[0] == "tensor":
        return _tensor(table, dim)
    if ways[0] == "lame":
        what = "a list of two numbers or formulas, lambda and mu"
        lam, mu = table.items("lame", table.data["lame"], (2,), what)
        first, second = table.quantity("lame", lam, dim), table.quantity("lame", mu, dim)
        if not isinstance(second, Formula) and not second > 0:
            raise table.error("lame", f"mu is {second:g}; it must be positive")
        with context(f"{table.where('lame')}:"):
            return Material.lame(first, second, plane)
    if "poisson" not in table:
        raise table.error("poisson", "is missing; give it along with young")
    young = table.quantity("young", table.data["young"], dim, above=0.0)
    poisson = table.quantity("poisson", table.data["poisson"], dim)
    if not isinstance(poisson, Formula) and not -1 < poisson < 0.5:
        raise table.error("poisson", f"is {poisson:g}; it must lie between -1 and 0.5, both excluded")
    with context(f"{table.where('young, poisson')}:"):
        return Material.young(young, poisson, plane)


def _tensor(table: Table, dim: int) -> Material:
    size = 3 if dim == 2 else 6
    what = f"{size} lists of {size} numbers or formulas, the rows of the elasticity matrix"
    rows = table.items("tensor", table.data["tensor"], (size,), what)
    entries = [
        table.quantity("tensor", value, dim) for row in rows for value in table.items("tensor", row, (size,), what)
    ]
    out = table.numbers("out_of_plane", 3, "a list of three numbers") if "out_of_plane" in table else None
    with context(f"{table.where('tensor')}:"):
        return Material.tensor(array(entries, (size, size)), out)


def material_record(material: Material, where: str = "material") -> dict[str, object]:
    """The table [material] of a material, or of one region of it."""
    match material:
        case Isotropic():
            constants = [
                quantity_record(value, f"{where}.{name}")
                for name, value in zip(material.names, (material.first, material.second), strict=True)
            ]
            record: dict[str, object]
            record = {"young": constants[0], "poisson": constants[1]} if material.technical else {"lame": constants}
            return record if material.plane is PlaneState.STRAIN else record | {"plane": material.plane.value}
        case Anisotropic():
            entries = _entries(material.matrix, f"{where}.C")
            size = round(len(entries) ** 0.5)
            record = {"tensor": [entries[k * size : (k + 1) * size] for k in range(size)]}
            out = material.out_of_plane
            return record if out is None else record | {"out_of_plane": np.asarray(out, dtype=float).tolist()}
        case ByRegion() if where == "material":
            return {
                "regions": {name: material_record(part, f"{where}['{name}']") for name, part in material.parts.items()}
            }
    raise unsaid(where, material, "lame, young and tensor, by regions if need be")


def _entries(value: object, where: str) -> list[object]:
    """The entries of a vector or matrix of numbers and formulas, in row-major order."""
    if isinstance(value, FormulaArray):
        return [quantity_record(entry, where) for entry in value.entries]
    if callable(value):
        raise unsaid(where, value)
    return np.asarray(value, dtype=float).ravel().tolist()


def quantity_record(value: object, where: str) -> object:
    """A number, or the text of a formula."""
    if isinstance(value, Formula):
        return value.text
    if callable(value):
        raise unsaid(where, value)
    numbers = np.asarray(value, dtype=float)
    if numbers.size != 1:
        raise unsaid(where, f"given as {numbers.size} numbers, one for each contact point")
    return float(numbers.ravel()[0])


# ---- loads and supports -----------------------------------------------------------------------------------


def read_loads(table: Table, mesh: Mesh) -> tuple[VectorData | float, dict[str, Traction]]:
    """The body force, and tractions by boundary."""
    body: VectorData | float = table.vector("body", table.data["body"], mesh.dim) if "body" in table else 0.0
    traction = table.table("traction", None, inline=True)
    pressure = table.table("pressure", None, inline=True)
    tractions: dict[str, Traction] = {}
    for name, value in traction.data.items():
        check_boundary(mesh, traction, name)
        tractions[name] = traction.vector(name, value, mesh.dim)
    for name, value in pressure.data.items():
        check_boundary(mesh, pressure, name)
        if name in tractions:
            raise pressure.error(name, "this boundary has a traction too; give one of the two")
        tractions[name] = Pressure(pressure.quantity(name, value, mesh.dim))
    return body, tractions


def loads_record(body: VectorData | float, tractions: Mapping[str, Traction], dim: int) -> dict[str, object]:
    """The table [loads]."""

    def vector(value: object, where: str) -> list[object]:
        none = isinstance(value, float)  # the number 0 means no vector
        return [0.0] * dim if none else _entries(value, where)

    record: dict[str, object] = {}
    if not isinstance(body, float):
        record["body"] = vector(body, "body_force")
    pressure, traction = {}, {}
    for name, value in tractions.items():
        where = f"tractions['{name}']"
        if isinstance(value, Pressure):
            pressure[name] = quantity_record(value.value, where)
        else:
            traction[name] = vector(value, where)
    return record | ({"traction": traction} if traction else {}) | ({"pressure": pressure} if pressure else {})


def read_supports(table: Table, mesh: Mesh) -> dict[str, Support]:
    """Supports by boundary."""
    found: dict[str, Support] = {}
    for name, value in table.data.items():
        check_boundary(mesh, table, name)
        if isinstance(value, str):
            chosen = table.text(name, None, ["clamped", "roller"])
            found[name] = Clamped() if chosen == "clamped" else Roller()
            continue
        if not isinstance(value, dict):
            ways = '"clamped", "roller", { x = 0.0 } or { displacement = [...] }'
            raise table.error(name, f"must be {ways}, not {kind(value)}")
        axes = VARIABLES[: mesh.dim]
        held = table.table(name, (*axes, "displacement"), inline=True)
        if "displacement" in held:
            if len(held.data) > 1:
                raise held.error("displacement", "fixes every direction; remove the single ones")
            found[name] = Prescribed(held.vector("displacement", value["displacement"], mesh.dim))
        elif not held.data:
            raise table.error(name, 'fixes nothing; give x, y or displacement, or write "clamped"')
        else:
            found[name] = Fixed(**{axis: held.quantity(axis, v, mesh.dim) for axis, v in value.items()})
    return found


def supports_record(supports: Mapping[str, Support]) -> dict[str, object]:
    """The table [supports]."""
    record: dict[str, object] = {}
    for name, support in supports.items():
        where = f"supports['{name}']"
        match support:
            case Clamped():
                record[name] = "clamped"
            case Roller():
                record[name] = "roller"
            case Prescribed(value=value):
                record[name] = {"displacement": _entries(value, where)}
            case Fixed():
                given = {axis: getattr(support, axis) for axis in VARIABLES}
                record[name] = {
                    axis: quantity_record(value, f"{where}.{axis}")
                    for axis, value in given.items()
                    if value is not None
                }
    return record
