"""The table [material] of a problem file, read and written."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, cast

import numpy as np

from hemivar.basics.arguments import suggest
from hemivar.basics.stated import stated_fields
from hemivar.basics.types import Array
from hemivar.files.not_expressible import not_expressible
from hemivar.files.quantities import entries_record, quantity_record
from hemivar.files.schema import check_named, read_arguments, read_value, written
from hemivar.files.toml import KEYS, TomlTable, array, context, kind, listed
from hemivar.formula import Formula
from hemivar.mechanics.composed_material import ByRegion
from hemivar.mechanics.function_energy import FunctionEnergy
from hemivar.mechanics.gradient_material import GradientMaterial
from hemivar.mechanics.linear_material import Anisotropic, Isotropic
from hemivar.mechanics.material import Material
from hemivar.mechanics.material_registry import MATERIAL_LAWS
from hemivar.mechanics.material_words import PlaneState, ScalarKind
from hemivar.mechanics.moduli import Branch, InTime, Moduli
from hemivar.mechanics.single_material import SingleMaterial
from hemivar.mechanics.stored_energy import StoredEnergy
from hemivar.mesh import Mesh

__all__ = ["material_record", "read_material"]

_IN_TIME = ("density", "viscosity", "branches")
#: Names of constants in files, where classes have others.
_ATTRIBUTES = {"energy": "text"}

#: Keys of a branch, and the ways to give its spring.
_BRANCH = ("lame", "young", "poisson", "tensor", "time")
_WAYS = ("lame", "young", "tensor")
_LINEAR_KEYS = ("lame", "young", "poisson", "tensor", "out_of_plane", "plane", *_IN_TIME)
_MATRICES = {"tensor": "elasticity", "viscosity": "viscosity"}


def read_material(table: TomlTable, mesh: Mesh, of: ScalarKind | None = None) -> Material:
    """The material, evaluated once in every cell, so that its errors come before everything else."""
    material = _gradient(table, mesh, of) if of else _material(table, mesh)
    if mesh.number_of_cells:  # a rank may have no part of the body
        masks = {}
        for name, cells in mesh.regions.items():
            masks[name] = np.zeros(mesh.number_of_cells, dtype=bool)
            masks[name][cells] = True
        with context(f"{table.source}: [material]"):
            middle = mesh.points[mesh.cells].mean(axis=1)
            material.stiffness_tensor(middle, masks)
            material.lower_tensor(middle, masks)
            material.density_at(middle, masks)
            material.viscosity_tensor(middle, masks)
            for number in range(len(material.relaxation_times)):
                material.branch_tensor(number, middle, masks)
    return material


def _material(table: TomlTable, mesh: Mesh) -> Material:
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
            raise regions.error(name, f"the mesh has no region '{name}'{suggest(name, known, 'regions')}")
        parts[name] = _one_material(regions.table(name, KEYS["material.regions.*"]), mesh.dim)
    with context(f"{table.where('regions')}:"):
        return Material.by_region(parts)


def _gradient(table: TomlTable, mesh: Mesh, of: ScalarKind) -> Material:
    """The material of one component, each of its fields over the whole mesh or in every region of it."""
    stated = stated_fields(GradientMaterial, by=of.value)
    table.only(("regions", *stated))
    regions, found = table.table("regions", None), dict[str, object]()
    for region in regions.data:
        check_named(mesh, regions, region, "region")
    parts = {region: regions.table(region, tuple(stated)) for region in regions.data}
    for key, (field, said) in stated.items():
        inside = [region for region, one in parts.items() if key in one]
        if key in table and inside:
            raise table.error(key, f"is given for the whole and in region '{inside[0]}'; give one of the two")
        if key in table:
            found[field.name] = read_value(table, key, said, mesh.dim)
        elif inside:
            for one in parts.values():
                if key not in one:
                    raise one.error(key, "is missing; give it in every [material.regions.NAME], or in none")
            found[field.name] = {region: read_value(one, key, said, mesh.dim) for region, one in parts.items()}
    if "coefficient" not in found:
        raise table.error(f"{next(iter(stated))}, regions", "none is given; give one of the two")
    with context(f"{table.source}: [material]"):
        return Material.gradient(kind=of, **found)  # type: ignore[arg-type]


def _one_material(table: TomlTable, dim: int) -> Material:
    if "law" in table:
        return _nonlinear(table, dim)
    ways = [way for way in _WAYS if way in table]
    if len(ways) != 1:
        found = f"{' and '.join(ways)} are given" if ways else "no elastic constants are given"
        raise table.error("lame, young, tensor", f"{found}; give lame, or young and poisson, or tensor, or a law")
    for key in table.data:
        if key not in _LINEAR_KEYS:
            owners = [name for name, entry in MATERIAL_LAWS.items() if key in {p.key for p in entry.parameters}]
            raise table.error(key, f"belongs to law = {listed(owners)}; add the law, or remove it")
    owner = {"poisson": ("young",), "out_of_plane": ("tensor",), "plane": ("lame", "young")}
    for key, allowed in owner.items():
        if key in table and ways[0] not in allowed:
            raise table.error(key, f"goes with {' or '.join(allowed)}, not with {ways[0]}; remove it")
    if "plane" in table and dim == 3:
        raise table.error("plane", "is for plane meshes, but this mesh is three-dimensional; remove it")
    plane = table.text("plane", "strain", [state.value for state in PlaneState])
    more = _in_time(table, dim)
    if ways[0] == "tensor":
        return _tensor(table, dim, more)
    if ways[0] == "lame":
        what = "a list of two numbers or formulas, lambda and mu"
        lam, mu = table.items("lame", table.data["lame"], (2,), what)
        first, second = table.quantity("lame", lam, dim), table.quantity("lame", mu, dim)
        if not isinstance(second, Formula) and not second > 0:
            raise table.error("lame", f"mu is {second:g}; it must be positive")
        with context(f"{table.where('lame')}:"):
            return Material.lame(first, second, plane, **more)
    if "poisson" not in table:
        raise table.error("poisson", "is missing; give it along with young")
    young = table.quantity("young", table.data["young"], dim, above=0.0)
    poisson = table.quantity("poisson", table.data["poisson"], dim)
    if not isinstance(poisson, Formula) and not -1 < poisson < 0.5:
        raise table.error("poisson", f"is {poisson:g}; it must lie between -1 and 0.5, both excluded")
    with context(f"{table.where('young, poisson')}:"):
        return Material.young(young, poisson, plane, **more)


def _nonlinear(table: TomlTable, dim: int) -> Material:
    """A material of the registry."""
    name = table.text("law", None, list(MATERIAL_LAWS))
    entry = MATERIAL_LAWS[name]
    known = ("law", *(p.key for p in entry.parameters), *_IN_TIME)
    for key in table.data:
        if key not in known:
            raise table.error(key, f'does not go with law = "{name}"; remove it (known here: {", ".join(known)})')
    if "plane" in table and dim == 3:
        raise table.error("plane", "is for plane meshes, but this mesh is three-dimensional; remove it")
    constants = read_arguments(entry, table, dim)
    with context(f"{table.where('law')}:"):
        return cast(Material, entry.build(**constants, **_in_time(table, dim)))


def _in_time(table: TomlTable, dim: int) -> InTime:
    """Density, viscosity and branches, as the makers of materials take them."""
    found: InTime = {}
    if "density" in table:
        found["density"] = table.quantity("density", table.data["density"], dim, above=0.0)
    if "viscosity" in table:
        value = table.data["viscosity"]
        with context(f"{table.where('viscosity')}:"):
            if isinstance(value, list) and len(value) == 2 and not any(isinstance(one, list) for one in value):
                constants = tuple(table.quantity("viscosity", one, dim) for one in value)
                found["viscosity"] = Moduli(constants, None, False, "viscosity")  # type: ignore[arg-type]
            else:
                what = "two numbers or formulas, lambda and mu, or a matrix as under tensor"
                if not isinstance(value, list) or len(value) != (3 if dim == 2 else 6):
                    raise table.error("viscosity", f"must be {what}, not {kind(value)}")
                found["viscosity"] = Moduli(None, _matrix(table, "viscosity", dim), False, "viscosity")
    if "branches" in table:
        value = table.data["branches"]
        example = "branches = [{ lame = [2.0, 2.0], time = 0.5 }]"
        if not isinstance(value, list) or not all(isinstance(one, dict) for one in value):
            raise table.error("branches", f"must be a list of tables, such as {example}")
        found["branches"] = [_branch(table, number, one, dim) for number, one in enumerate(value)]
    return found


def _branch(table: TomlTable, number: int, value: Mapping[str, object], dim: int) -> Branch:
    one = TomlTable(value, table.source, table.name, _BRANCH, f"{table.prefix}branches[{number}].")
    ways = [way for way in _WAYS if way in one]
    if len(ways) != 1:
        found = f"{' and '.join(ways)} are given" if ways else "no elastic constants are given"
        raise one.error("lame, young, tensor", f"{found}; give lame, or young and poisson, or tensor")
    if "time" not in one:
        raise one.error("time", "is missing; give the relaxation time")
    if ("poisson" in one) != (ways[0] == "young"):
        raise one.error("poisson", "goes with young, and young with poisson; give both or none")
    given: dict[str, Any] = {"time": one.positive("time")}
    with context(f"{one.where(ways[0])}:"):
        if ways[0] == "lame":
            pair = one.items("lame", value["lame"], (2,), "a list of two numbers or formulas, lambda and mu")
            given["lame"] = tuple(one.quantity("lame", constant, dim) for constant in pair)
        elif ways[0] == "young":
            given |= {key: one.quantity(key, value[key], dim) for key in ("young", "poisson")}
        else:
            given["tensor"] = _matrix(one, "tensor", dim)
        return Branch(**given)


def _matrix(table: TomlTable, key: str, dim: int) -> Array | Callable[[Array], object]:
    size = 3 if dim == 2 else 6
    what = f"{size} lists of {size} numbers or formulas, the rows of the {_MATRICES[key]} matrix"
    rows = table.items(key, table.data[key], (size,), what)
    entries = [table.quantity(key, value, dim) for row in rows for value in table.items(key, row, (size,), what)]
    return array(entries, (size, size))


def _tensor(table: TomlTable, dim: int, more: InTime) -> Material:
    matrix = _matrix(table, "tensor", dim)
    out = table.numbers("out_of_plane", 3, "a list of three numbers") if "out_of_plane" in table else None
    with context(f"{table.where('tensor')}:"):
        return Material.tensor(matrix, out, **more)


def material_record(material: Material, where: str = "material") -> dict[str, object]:
    """The table [material] of a material, or of one region of it."""
    match material:
        case GradientMaterial():
            return _gradient_record(material)
        case Isotropic():
            constants = [
                quantity_record(value, f"{where}.{name}")
                for name, value in zip(material.names, (material.first, material.second), strict=True)
            ]
            record: dict[str, object]
            record = {"young": constants[0], "poisson": constants[1]} if material.technical else {"lame": constants}
            record |= {} if material.plane is PlaneState.STRAIN else {"plane": material.plane.value}
            return record | _in_time_record(material, where)
        case Anisotropic():
            record = {"tensor": _rows(material.matrix, f"{where}.C")}
            out = material.out_of_plane
            record |= {} if out is None else {"out_of_plane": np.asarray(out, dtype=float).tolist()}
            return record | _in_time_record(material, where)
        case StoredEnergy() if material.kind in MATERIAL_LAWS and not isinstance(material, FunctionEnergy):
            return _nonlinear_record(material, where) | _in_time_record(material, where)
        case ByRegion() if where == "material":
            return {
                "regions": {name: material_record(part, f"{where}['{name}']") for name, part in material.parts.items()}
            }
    raise not_expressible(where, material, "lame, young, tensor and materials by law, by regions if need be")


def _gradient_record(material: GradientMaterial) -> dict[str, object]:
    record: dict[str, object] = {}
    regions: dict[str, dict[str, object]] = {}
    for key, (field, said) in stated_fields(material, by=material.scalar.value).items():
        value = getattr(material, field.name)
        if isinstance(value, Mapping):
            for region, one in value.items():
                regions.setdefault(region, {})[key] = written(one, said.form, f"{key} of '{region}'")
        elif value is not None:
            record[key] = written(value, said.form, key)
    return record | ({"regions": regions} if regions else {})


def _nonlinear_record(material: StoredEnergy, where: str) -> dict[str, object]:
    record: dict[str, object] = {"law": material.kind}
    for p in MATERIAL_LAWS[material.kind].parameters:
        value = getattr(material, _ATTRIBUTES.get(p.name, p.name), None)
        if value is None or (not callable(value) and value == p.default):
            continue
        record[p.key] = written(value, p.said.form, f"{where}.{p.key}")
    return record


def _in_time_record(material: SingleMaterial, where: str) -> dict[str, object]:
    record: dict[str, object] = {}
    if material.density is not None:
        record["density"] = quantity_record(material.density, f"{where}.density")
    if material.viscosity is not None:
        record["viscosity"] = _moduli_record(material.viscosity, f"{where}.viscosity")
    if material.branches:
        record["branches"] = [
            _branch_record(branch, f"{where}.branches[{number}]") for number, branch in enumerate(material.branches)
        ]
    return record


def _branch_record(branch: Branch, where: str) -> dict[str, object]:
    record: dict[str, object]
    if branch.lame is not None:
        record = {"lame": [quantity_record(value, f"{where}.lame") for value in branch.lame]}
    elif branch.young is not None:
        record = {key: quantity_record(getattr(branch, key), f"{where}.{key}") for key in ("young", "poisson")}
    else:
        record = {"tensor": _rows(branch.tensor, f"{where}.tensor")}
    return record | {"time": branch.time}


def _moduli_record(moduli: Moduli, where: str) -> list[object]:
    if moduli.constants is not None:
        return [quantity_record(value, where) for value in moduli.constants]
    return _rows(moduli.matrix, where)


def _rows(matrix: object, where: str) -> list[object]:
    """The rows of a matrix of numbers and formulas."""
    entries = entries_record(matrix, where)
    size = round(len(entries) ** 0.5)
    return [entries[k * size : (k + 1) * size] for k in range(size)]
