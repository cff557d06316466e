"""The table [material] of a problem file, read and written."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any, cast

import numpy as np

from hemivar.basics.arguments import suggest
from hemivar.basics.stated import Form, Stated, keys_of, stated_fields
from hemivar.basics.user_code import of_user
from hemivar.files.not_expressible import not_expressible
from hemivar.files.quantities import quantity_record
from hemivar.files.schema import check_named, decode, encode, encode_arguments, read_arguments, read_value, written
from hemivar.files.toml import KEYS, LINEAR_KEYS, TomlTable, context, kind, listed
from hemivar.laws.registry import LawKind, entry_named, entry_of
from hemivar.mechanics.composed_material import ByRegion
from hemivar.mechanics.function_energy import FunctionEnergy
from hemivar.mechanics.gradient_material import GradientMaterial
from hemivar.mechanics.linear_material import Anisotropic, Isotropic, Lame, Young
from hemivar.mechanics.material import Material
from hemivar.mechanics.material_registry import MATERIAL_LAWS
from hemivar.mechanics.material_words import ScalarKind
from hemivar.mechanics.moduli import Branch, Moduli
from hemivar.mechanics.single_material import IN_TIME, SingleMaterial
from hemivar.mechanics.stored_energy import StoredEnergy
from hemivar.mesh import Mesh

__all__ = ["material_record", "read_material"]

#: What linear materials are made by.
_LINEAR: Mapping[str, type[SingleMaterial]] = {"lame": Lame, "young": Young, "tensor": Anisotropic}


def read_material(table: TomlTable, mesh: Mesh, of: ScalarKind | None = None, code: Sequence[str] = ()) -> Material:
    """The material, evaluated once in every cell, so that its errors come before everything else."""
    material = _gradient(table, mesh, of) if of else _material(table, mesh, code)
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


def _material(table: TomlTable, mesh: Mesh, code: Sequence[str]) -> Material:
    if "regions" not in table:
        return _one_material(table, mesh.dim, code)
    for key in table.data:
        if key != "regions":
            raise table.error(key, "cannot be combined with regions; state it in every [material.regions.NAME]")
    regions = table.table("regions", None)
    if not regions.data:
        raise table.error("regions", "is empty; add tables [material.regions.NAME]")
    known = list(mesh.regions)
    parts: dict[str, Material] = {}
    for name in regions.data:
        if name not in known:
            raise regions.error(name, f"the mesh has no region '{name}'{suggest(name, known, 'regions')}")
        parts[name] = _one_material(regions.table(name, None), mesh.dim, code)
    with context(f"{table.where('regions')}:"):
        return Material.by_region(parts)


def _gradient(table: TomlTable, mesh: Mesh, of: ScalarKind) -> Material:
    """The material of one component, each of its fields over the whole mesh or in every region of it."""
    schema = stated_fields(GradientMaterial, by=of.value)
    table.only(("regions", *schema))
    regions, values = table.table("regions", None), dict[str, object]()
    for region in regions.data:
        check_named(mesh, regions, region, "region")
    parts = {region: regions.table(region, tuple(schema)) for region in regions.data}
    for key, (field, stated) in schema.items():
        inside = [region for region, part in parts.items() if key in part]
        if key in table and inside:
            raise table.error(key, f"is given for the whole and in region '{inside[0]}'; give one of the two")
        if key in table:
            values[field.name] = read_value(table, key, stated, mesh.dim)
        elif inside:
            for part in parts.values():
                if key not in part:
                    raise part.error(key, "is missing; give it in every [material.regions.NAME], or in none")
            values[field.name] = {region: read_value(part, key, stated, mesh.dim) for region, part in parts.items()}
    if "coefficient" not in values:
        raise table.error(f"{next(iter(schema))}, regions", "none is given; give one of the two")
    with context(f"{table.source}: [material]"):
        return Material.gradient(kind=of, **values)  # type: ignore[arg-type]


def _one_material(table: TomlTable, dim: int, code: Sequence[str]) -> Material:
    if table.data.get("law", "") in ("", *MATERIAL_LAWS):
        table.only(KEYS["material.regions.*" if table.name.startswith("material.") else "material"])
    where, made, given = _by_law(table, dim, code) if "law" in table else _by_constants(table, dim)
    given |= decode(
        SingleMaterial, table, dim, by=IN_TIME, viscosity=partial(_viscosity, dim), branches=partial(_branches, dim)
    )
    with context(f"{table.where(where)}:"):
        return cast(Material, made(**given))


def _by_constants(table: TomlTable, dim: int) -> tuple[str, Callable[..., object], dict[str, object]]:
    """Of a linear material: to what its messages belong, what makes it, and from what."""
    constants = _elastic_constants(table, "lame, or young and poisson, or tensor, or a law")
    for key in table.data:
        if key not in LINEAR_KEYS:
            owners = [name for name, entry in MATERIAL_LAWS.items() if key in {p.key for p in entry.parameters}]
            raise table.error(key, f"belongs to law = {listed(owners)}; add the law, or remove it")
    owner = {"poisson": ("young",), "out_of_plane": ("tensor",), "plane": ("lame", "young")}
    for key, allowed in owner.items():
        if key in table and constants not in allowed:
            raise table.error(key, f"goes with {' or '.join(allowed)}, not with {constants}; remove it")
    if constants == "young" and "poisson" not in table:
        raise table.error("poisson", "is missing; give it along with young")
    _refuse_plane(table, dim)
    given = decode(_LINEAR[constants], table, dim, out_of_plane=_out_of_plane)
    if constants == "lame":
        pair = cast(tuple[float, float], read_value(table, "lame", Stated(Form.PAIR), dim))
        if not callable(pair[1]) and not pair[1] > 0:
            raise table.error("lame", f"mu is {pair[1]:g}; it must be positive")
        given |= dict(zip(("lam", "mu"), pair, strict=True))
    return "young, poisson" if constants == "young" else constants, _LINEAR[constants], given


def _out_of_plane(table: TomlTable) -> tuple[float, ...]:
    return table.numbers("out_of_plane", 3, "a list of three numbers")


def _by_law(table: TomlTable, dim: int, code: Sequence[str]) -> tuple[str, Callable[..., object], dict[str, object]]:
    """Of a material of the registry the same."""
    name, entry = table.data["law"], None
    if isinstance(name, str) and name not in MATERIAL_LAWS:
        with context(f"{table.where('law')}:"):
            entry = entry_named(name, LawKind.MATERIAL, (StoredEnergy,), code)
    entry = entry or MATERIAL_LAWS[table.text("law", None, list(MATERIAL_LAWS))]
    known = ("law", *(p.key for p in entry.parameters), *keys_of(SingleMaterial, by=IN_TIME))
    for key in table.data:
        if key not in known:
            raise table.error(key, f'does not go with law = "{name}"; remove it (known here: {", ".join(known)})')
    _refuse_plane(table, dim)
    return "law", entry.build, read_arguments(entry, table, dim)


def _elastic_constants(table: TomlTable, how: str) -> str:
    """By which constants a table states an elasticity."""
    names = [name for name in _LINEAR if name in table]
    if len(names) != 1:
        problem = f"{' and '.join(names)} are given" if names else "no elastic constants are given"
        raise table.error("lame, young, tensor", f"{problem}; give {how}")
    return names[0]


def _refuse_plane(table: TomlTable, dim: int) -> None:
    if "plane" in table and dim == 3:
        raise table.error("plane", "is for plane meshes, but this mesh is three-dimensional; remove it")


def _viscosity(dim: int, table: TomlTable) -> Moduli:
    value = table.data["viscosity"]
    pair = isinstance(value, list) and len(value) == 2 and not any(isinstance(entry, list) for entry in value)
    if not pair and (not isinstance(value, list) or len(value) != (3 if dim == 2 else 6)):
        what = "two numbers or formulas, lambda and mu, or a matrix as under tensor"
        raise table.error("viscosity", f"must be {what}, not {kind(value)}")
    given: Any = read_value(table, "viscosity", Stated(Form.PAIR if pair else Form.MATRIX, "viscosity"), dim)
    with context(f"{table.where('viscosity')}:"):
        return Moduli(given if pair else None, None if pair else given, False, "viscosity")


def _branches(dim: int, table: TomlTable) -> list[Branch]:
    value = table.data["branches"]
    example = "branches = [{ lame = [2.0, 2.0], time = 0.5 }]"
    if not isinstance(value, list) or not all(isinstance(item, dict) for item in value):
        raise table.error("branches", f"must be a list of tables, such as {example}")
    return [_branch(table, number, item, dim) for number, item in enumerate(value)]


def _branch(table: TomlTable, number: int, value: Mapping[str, object], dim: int) -> Branch:
    branch = TomlTable(value, table.source, table.name, keys_of(Branch), f"{table.prefix}branches[{number}].")
    constants = _elastic_constants(branch, "lame, or young and poisson, or tensor")
    if "time" in branch and ("poisson" in branch) != (constants == "young"):
        raise branch.error("poisson", "goes with young, and young with poisson; give both or none")
    given = decode(Branch, branch, dim)
    with context(f"{branch.where(constants)}:"):
        return Branch(**given)


def material_record(material: Material, where: str = "material") -> dict[str, object]:
    """The table [material] of a material, or of one region of it."""
    match material:
        case GradientMaterial():
            return _gradient_record(material)
        case Isotropic() | Anisotropic() | StoredEnergy() if named := _name_of(material):
            record: dict[str, object] = {} if material.linear else {"law": named}
            if isinstance(material, Lame):
                record["lame"] = [quantity_record(getattr(material, name), f"{where}.{name}") for name in ("lam", "mu")]
            record |= encode(material, where, out_of_plane=np.ndarray.tolist)
            record |= _own_constants(material, where)
            return record | encode(
                material,
                where,
                by=IN_TIME,
                viscosity=lambda one: written(
                    *((one.matrix, Form.MATRIX) if one.constants is None else (one.constants, Form.PAIR)),
                    f"{where}.viscosity",
                ),
                branches=lambda parts: [encode(one, f"{where}.branches[{k}]") for k, one in enumerate(parts)],
            )
        case ByRegion() if where == "material":
            return {
                "regions": {name: material_record(part, f"{where}['{name}']") for name, part in material.parts.items()}
            }
    raise not_expressible(where, material, "lame, young, tensor and materials by law, by regions if need be")


def _gradient_record(material: GradientMaterial) -> dict[str, object]:
    record: dict[str, object] = {}
    regions: dict[str, dict[str, object]] = {}
    for key, (field, stated) in stated_fields(material, by=material.scalar.value).items():
        value = getattr(material, field.name)
        if isinstance(value, Mapping):
            for region, part in value.items():
                regions.setdefault(region, {})[key] = written(part, stated.form, f"{key} of '{region}'")
        elif value is not None:
            record[key] = written(value, stated.form, key)
    return record | ({"regions": regions} if regions else {})


def _name_of(material: SingleMaterial) -> str | None:
    """The name by which files know the material, of a linear one what it is."""
    entry = entry_of(type(material), LawKind.MATERIAL)
    known = material.linear or (material.kind in MATERIAL_LAWS and not isinstance(material, FunctionEnergy))
    known = known and not of_user(type(material))
    return entry.name if entry is not None else material.kind if known else None


def _own_constants(material: SingleMaterial, where: str) -> dict[str, object]:
    """The constants of a material of the user's, those without metadata, too."""
    entry = entry_of(type(material), LawKind.MATERIAL)
    return {} if entry is None else encode_arguments(entry, material, where)
