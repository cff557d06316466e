"""The tables of a problem file whose ``kind`` is a scalar problem, read and written.

[mesh], [supports], [contact.NAME] and [solver] stand where they stand for a body; [material] holds one coefficient,
[loads] a source and fluxes, and [area] a contact over the mesh or over regions of it.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import cast

import numpy as np

from hemivar.basics.arguments import suggest
from hemivar.basics.stated import keys_of
from hemivar.files.body_table import check_boundary
from hemivar.files.contact_table import SideFiles, _friction_record, _law_record, _Reader
from hemivar.files.not_expressible import not_expressible
from hemivar.files.quantities import entries_record, quantity_record
from hemivar.files.schema import decode, encode
from hemivar.files.toml import TomlTable, array, context, kind
from hemivar.formula import Formula
from hemivar.laws import Friction, Superpotential
from hemivar.laws.registry import FRICTION_LAWS, NORMAL_LAWS
from hemivar.mechanics.coefficient import Coefficient
from hemivar.mechanics.conditions import ScalarData
from hemivar.mechanics.gradient_energy import GradientEnergy
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
    more = _RATES[chosen]
    material = top.table("material", (_COEFFICIENTS[chosen], "regions", *more))
    coefficient = _read_coefficient(material, _COEFFICIENTS[chosen], more, mesh)
    rates = {key: found for key in more if (found := _read_rate(material, key, mesh)) is not None}
    loads = top.table("loads", ("source", "flux", "bedding"))
    supports = top.table("supports", None)
    contact = top.table("contact", None)
    for table in (supports, contact, flux := loads.table("flux", None, inline=True)):
        for name in table.data:
            check_boundary(mesh, table, name)
    for name, value in supports.data.items():
        if isinstance(value, dict) or value in ("clamped", "roller"):
            raise supports.error(name, f"must be the value of u, a number or a formula, not {kind(value)}; write 0.0")
    with context(f"{top.source}: [contact]"):
        problem = ScalarProblem(
            mesh,
            cast(Coefficient | Mapping[str, Coefficient], coefficient),
            contact={name: _read_contact(contact.table(name, _CONTACT), reader) for name in contact.data},
            area=_read_area(top, mesh, reader),
            supports={name: _quantity(supports, name, mesh.dim, timed=True) for name in supports.data},
            source=_quantity(loads, "source", mesh.dim, timed=True) if "source" in loads else 0.0,
            fluxes={name: _quantity(flux, name, mesh.dim, timed=True) for name in flux.data},
            bedding=_quantity(loads, "bedding", mesh.dim, 0.0) if "bedding" in loads else 0.0,
            kind=chosen,
            title=top.text("title", ""),
            order=order,
            **rates,  # type: ignore[arg-type]
        )
    masks = {name: np.isin(np.arange(mesh.number_of_cells), cells) for name, cells in mesh.regions.items()}
    with context(f"{top.source}: [material]"):
        problem.material.stiffness_tensor(mesh.points[mesh.cells].mean(axis=1), masks)
    return problem


def _quantity(table: TomlTable, key: str, dim: int, minimum: float = -np.inf, timed: bool = False) -> ScalarData:
    return table.quantity(key, table.data[key], dim, minimum, timed=timed)


def _read_rate(table: TomlTable, key: str, mesh: Mesh) -> object:
    """Density, viscosity or capacity: over the whole mesh, or in every region of it."""
    regions = table.data.get("regions")
    inside = [name for name, one in regions.items() if key in one] if isinstance(regions, dict) else []
    if key in table:
        if inside:
            raise table.error(key, f"is given for the whole and in region '{inside[0]}'; give one of the two")
        return _quantity(table, key, mesh.dim, 0.0)
    if not inside:
        return None
    parts = table.table("regions", None)
    for name in parts.data:
        if name not in inside:
            raise parts.table(name, None).error(key, "is missing; give it in every [material.regions.NAME], or in none")
    return {name: _quantity(parts.table(name, None), key, mesh.dim, 0.0) for name in inside}


def _read_coefficient(table: TomlTable, name: str, more: tuple[str, ...], mesh: Mesh) -> object:
    if (name in table) == ("regions" in table):
        given = "both are given" if name in table else "none is given"
        raise table.error(f"{name}, regions", f"{given}; give one of the two")
    if name in table:
        return _one_coefficient(table, name, mesh.dim)
    regions = table.table("regions", None)
    found = {}
    for region in regions.data:
        if region not in mesh.regions:
            raise regions.error(
                region, f"the mesh has no region '{region}'{suggest(region, list(mesh.regions), 'regions')}"
            )
        one = regions.table(region, (name, *more))
        if name not in one:
            raise one.error(name, "is missing; give it in every [material.regions.NAME]")
        found[region] = _one_coefficient(one, name, mesh.dim)
    if not found:
        raise table.error("regions", "is empty; add tables [material.regions.NAME]")
    return found


def _one_coefficient(table: TomlTable, name: str, dim: int) -> object:
    value = table.data[name]
    if not isinstance(value, list):
        return table.quantity(name, value, dim, above=0.0)
    what = f"a number, a formula, or {dim} lists of {dim} of these"
    rows = [table.items(name, row, (dim,), what) for row in table.items(name, value, (dim,), what)]
    entries = [table.quantity(name, entry, dim) for row in rows for entry in row]
    return array(entries, (dim, dim))


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
    name = _COEFFICIENTS[problem.kind]
    material: dict[str, object]
    if isinstance(problem.coefficient, Mapping):
        parts = problem.coefficient.items()
        material = {"regions": {one: {name: _coefficient_record(value, f"{name} of '{one}'")} for one, value in parts}}
    else:
        material = {name: _coefficient_record(problem.coefficient, name)}
    for key in _RATES[problem.kind]:
        value = getattr(problem, key)
        if isinstance(value, Mapping):
            if not isinstance(problem.coefficient, Mapping) or set(value) != set(problem.coefficient):
                raise not_expressible(
                    key, "given by regions", f"{key} by the regions that the {name} is given by, or for all"
                )
            for region, one in value.items():
                material["regions"][region][key] = quantity_record(one, f"{key} of '{region}'")  # type: ignore[index]
        elif value is not None:
            material[key] = quantity_record(value, key)
    loads: dict[str, object] = {}
    for key in ("source", "bedding"):
        value = getattr(problem, key)
        if callable(value) or value != 0.0:
            loads[key] = quantity_record(value, key)
    if problem.fluxes:
        loads["flux"] = {one: quantity_record(value, f"fluxes['{one}']") for one, value in problem.fluxes.items()}
    supports = {one: quantity_record(value, f"supports['{one}']") for one, value in problem.supports.items()}
    contact = {one: _contact_record(one, value, f"contact['{one}']", aside) for one, value in problem.contact.items()}
    area: dict[str, object]
    if isinstance(problem.area, ScalarContact):
        area = _contact_record("area", problem.area, "area", aside)
    else:
        area = {one: _contact_record(one, value, f"area['{one}']", aside) for one, value in problem.area.items()}
    return {"material": material, "loads": loads, "supports": supports, "contact": contact, "area": area}


def _coefficient_record(value: object, where: str) -> object:
    if isinstance(value, GradientEnergy):
        raise not_expressible(where, f"a {type(value).__name__}", "a number, a formula or a tensor")
    if isinstance(value, Formula | float) or (not callable(value) and np.ndim(value) == 0):  # type: ignore[arg-type]
        return quantity_record(value, where)
    entries = entries_record(value, where)
    size = round(len(entries) ** 0.5)
    return [entries[k * size : (k + 1) * size] for k in range(size)]


def _contact_record(name: str, contact: ScalarContact, where: str, aside: SideFiles) -> dict[str, object]:
    record: dict[str, object] = {}
    if isinstance(contact.law, Friction):
        record["friction"] = _friction_record(contact.law, f"{where}.law", name, aside)
    else:
        record["normal"] = _law_record(contact.law, f"{where}.law", name, aside, NORMAL_LAWS)
    return record | encode(contact, where)
