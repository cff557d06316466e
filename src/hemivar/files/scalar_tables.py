"""The tables of a problem file whose ``kind`` is a scalar problem, read and written.

[mesh], [supports], [contact.NAME] and [solver] stand where they stand for a body; [material] holds one coefficient,
[loads] a source and fluxes, and [area] a contact over the mesh or over regions of it.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from hemivar.basics.stated import Form, Stated, keys_of
from hemivar.files.contact_table import SideFiles, _friction_record, _law_record, _Reader
from hemivar.files.schema import check_named, decode, encode, read_value, written
from hemivar.files.toml import TomlTable, context, kind
from hemivar.laws import Friction, Superpotential
from hemivar.laws.registry import FRICTION_LAWS, NORMAL_LAWS
from hemivar.mechanics.conditions import SUPPORTS
from hemivar.mechanics.scalar import ScalarContact, ScalarKind, ScalarProblem
from hemivar.mesh import Mesh

__all__ = ["SCALAR_KEYS", "read_scalar", "scalar_record"]

#: What the coefficient is called in [material].
_COEFFICIENTS = {
    ScalarKind.MEMBRANE: "tension",
    ScalarKind.ANTIPLANE: "shear_modulus",
    ScalarKind.HEAT: "conductivity",
}
#: What matters in time only.
_RATES = {
    ScalarKind.MEMBRANE: ("density", "viscosity"),
    ScalarKind.ANTIPLANE: ("density", "viscosity"),
    ScalarKind.HEAT: ("capacity",),
}
_CONTACT = ("normal", "friction", *keys_of(ScalarContact))

#: Keys of the top of such a file.
SCALAR_KEYS = (
    "kind", "title", "mesh", "material", "loads", "supports", "contact", "area", "time", "output", "solver", "units",
)  # fmt: skip


def read_scalar(top: TomlTable, mesh: Mesh, order: int, folder: Path) -> ScalarProblem:
    """The problem that a file states on its mesh; tables of laws are looked for in a folder."""
    chosen = ScalarKind(top.text("kind", None, [one.value for one in ScalarKind]))
    if mesh.dim == 3 and chosen is not ScalarKind.HEAT:
        raise top.error("kind", f"'{chosen}' needs a plane mesh; write a rectangle in [mesh]")
    reader = _Reader(mesh.dim, folder)
    material = _read_material(top.table("material", ("regions", *_material_keys(chosen))), chosen, mesh)
    loads = top.table("loads", keys_of(ScalarProblem, table="loads"))
    supports, contact = top.table("supports", None), top.table("contact", None)
    for table in (supports, contact):
        for name in table.data:
            check_named(mesh, table, name)
    for name, value in supports.data.items():
        if isinstance(value, dict) or value in SUPPORTS:
            raise supports.error(name, f"must be the value of u, a number or a formula, not {kind(value)}; write 0.0")
    with context(f"{top.source}: [contact]"):
        problem = ScalarProblem(
            mesh,
            contact={name: _read_contact(contact.table(name, _CONTACT), reader) for name in contact.data},
            area=_read_area(top, mesh, reader),
            kind=chosen,
            title=top.text("title", ""),
            order=order,
            **material,  # type: ignore[arg-type]
            **decode(ScalarProblem, top, mesh),
            **decode(ScalarProblem, loads, mesh, "loads"),
        )
    masks = {name: np.isin(np.arange(mesh.number_of_cells), cells) for name, cells in mesh.regions.items()}
    with context(f"{top.source}: [material]"):
        problem.material.stiffness_tensor(mesh.points[mesh.cells].mean(axis=1), masks)
    return problem


def _material_keys(chosen: ScalarKind) -> dict[str, tuple[str, Stated]]:
    """The keys of [material]: of which field each of them is, and what it may be."""
    rates = {key: (key, Stated(Form.QUANTITY, least=0.0)) for key in _RATES[chosen]}
    return {_COEFFICIENTS[chosen]: ("coefficient", Stated(Form.TENSOR, above=0.0)), **rates}


def _read_material(table: TomlTable, chosen: ScalarKind, mesh: Mesh) -> dict[str, object]:
    """Each over the whole mesh, or in every region of it."""
    regions, keys = table.table("regions", None), _material_keys(chosen)
    for region in regions.data:
        check_named(mesh, regions, region, "region")
    parts = {region: regions.table(region, keys) for region in regions.data}
    found: dict[str, object] = {}
    for key, (name, said) in keys.items():
        inside = [region for region, one in parts.items() if key in one]
        if key in table and inside:
            raise table.error(key, f"is given for the whole and in region '{inside[0]}'; give one of the two")
        if key in table:
            found[name] = read_value(table, key, said, mesh.dim)
        elif inside:
            for one in parts.values():
                if key not in one:
                    raise one.error(key, "is missing; give it in every [material.regions.NAME], or in none")
            found[name] = {region: read_value(one, key, said, mesh.dim) for region, one in parts.items()}
    if "coefficient" not in found:
        raise table.error(f"{_COEFFICIENTS[chosen]}, regions", "none is given; give one of the two")
    return found


def _read_contact(table: TomlTable, reader: _Reader) -> ScalarContact:
    if ("normal" in table) == ("friction" in table):
        given = "both are given" if "normal" in table else "none is given"
        raise table.error("normal, friction", f"{given}; name one law, of the penetration or of the slip")
    key = "normal" if "normal" in table else "friction"
    law = reader.law(table, key, NORMAL_LAWS if key == "normal" else FRICTION_LAWS)
    assert isinstance(law, Superpotential | Friction)
    place = decode(ScalarContact, table, reader.dim)
    with context(f"{table.where(key)}:"):
        return ScalarContact(law, **place)


def _read_area(top: TomlTable, mesh: Mesh, reader: _Reader) -> ScalarContact | dict[str, ScalarContact]:
    area = top.table("area", None)
    if any(key in area for key in _CONTACT):
        area.only(_CONTACT)
        return _read_contact(area, reader)
    for name in area.data:
        if name not in mesh.regions:
            known = f"{', '.join(mesh.regions) or 'none'}"
            raise area.error(
                name, f"is neither of normal, friction, level, side nor a region of the mesh (regions: {known})"
            )
    return {name: _read_contact(area.table(name, _CONTACT), reader) for name in area.data}


# ---- writing ----------------------------------------------------------------------------------------------


def scalar_record(problem: ScalarProblem, aside: SideFiles) -> dict[str, object]:
    """The tables of a scalar problem but for title, mesh and solver."""
    contact = {one: _contact_record(one, value, f"contact['{one}']", aside) for one, value in problem.contact.items()}
    area: dict[str, object]
    if isinstance(problem.area, ScalarContact):
        area = _contact_record("area", problem.area, "area", aside)
    else:
        area = {one: _contact_record(one, value, f"area['{one}']", aside) for one, value in problem.area.items()}
    loads = encode(problem, part="loads")
    return {"material": _material_record(problem), "loads": loads, **encode(problem), "contact": contact, "area": area}


def _material_record(problem: ScalarProblem) -> dict[str, object]:
    material: dict[str, object] = {}
    regions: dict[str, dict[str, object]] = {}
    for key, (name, said) in _material_keys(problem.kind).items():
        value = getattr(problem, name)
        if isinstance(value, Mapping):
            for region, one in value.items():
                regions.setdefault(region, {})[key] = written(one, said.form, f"{key} of '{region}'")
        elif value is not None:
            material[key] = written(value, said.form, key)
    return material | ({"regions": regions} if regions else {})


def _contact_record(name: str, contact: ScalarContact, where: str, aside: SideFiles) -> dict[str, object]:
    record: dict[str, object] = {}
    if isinstance(contact.law, Friction):
        record["friction"] = _friction_record(contact.law, f"{where}.law", name, aside)
    else:
        record["normal"] = _law_record(contact.law, f"{where}.law", name, aside, NORMAL_LAWS)
    return record | encode(contact, where)
