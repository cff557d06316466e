"""What statements of contact problems have in common, be their fields displacements or of one component."""

from __future__ import annotations

import copy
from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import TYPE_CHECKING, ClassVar, Self

import numpy as np

from hemivar.basics.arguments import described, expect, number, suggest
from hemivar.basics.display import ReprMixin
from hemivar.basics.portable import PickleMixin
from hemivar.basics.stated import Form, stated
from hemivar.basics.units import UNITS_REMEDY, Units
from hemivar.errors import ProblemError
from hemivar.mechanics.conditions import (
    Clamped,
    Fixed,
    Roller,
    ScalarData,
    Support,
    Traction,
    VectorData,
    condition_at_time,
    prescribed_values,
    traction_value,
)
from hemivar.mechanics.instants import depends_on_time
from hemivar.mechanics.per_volume import Regional
from hemivar.mesh.keys import facet_keys
from hemivar.mesh.mesh import Mesh

if TYPE_CHECKING:
    from hemivar.mechanics.material import Material
    from hemivar.mechanics.scalar import ScalarContact
    from hemivar.mechanics.statement import Contact

__all__ = ["ORDER", "Statement"]

#: What a file says of the order of the elements.
ORDER = stated(
    Form.WHOLE, "1: linear elements; 2: quadratic ones (contact in 3D needs 1)", least=1, most=2, table="mesh"
)


class Statement(PickleMixin, ReprMixin):
    """What :func:`hemivar.discretize` takes: a :class:`ContactProblem`, or a :class:`ScalarProblem` of one component.

    A mesh, a material, and by boundary supports, loads and contact.
    """

    #: What the load per volume and the loads by boundary are called.
    load_names: ClassVar[tuple[str, str]]
    #: The fields that hold contacts.
    _founded: ClassVar[tuple[str, ...]] = ("contact",)

    if TYPE_CHECKING:  # fields of the dataclasses

        @property
        def mesh(self) -> Mesh: ...
        @property
        def material(self) -> Material: ...
        @property
        def contact(self) -> Mapping[str, Contact] | Mapping[str, ScalarContact]: ...
        @property
        def supports(self) -> Mapping[str, Support] | Mapping[str, ScalarData]: ...
        @property
        def title(self) -> str: ...
        @property
        def order(self) -> int: ...
        @property
        def bedding(self) -> ScalarData: ...
        @property
        def units(self) -> Units: ...

    @property
    def components(self) -> int:
        """Components of the field: those of a displacement, or 1."""
        return self.mesh.dim

    @property
    def unknown(self) -> str:
        """What the field is called."""
        return "displacement"

    @property
    def capacity(self) -> Regional | None:
        """What stores the field, the factor of its rate: that of heat."""
        return None

    @property
    def thermal(self) -> bool:
        """Whether the field is a temperature."""
        return False

    @property
    def contacts(self) -> Mapping[str, Contact | ScalarContact]:
        """Contact of all kinds by name: on boundaries, and over areas."""
        return dict(self.contact)

    @property
    def volume_load(self) -> VectorData | ScalarData:
        """The load per volume, or per area of a plane mesh."""
        found: VectorData | ScalarData = getattr(self, self.load_names[0])
        return found

    @property
    def boundary_loads(self) -> Mapping[str, Traction]:
        """Loads by boundary."""
        found: Mapping[str, Traction] = getattr(self, self.load_names[1])
        return found

    def on(self, mesh: Mesh) -> Self:
        """The same problem on another mesh, which must have the same names."""
        return replace(self, mesh=mesh)  # type: ignore[type-var]

    @property
    def time_dependent(self) -> frozenset[str]:
        """What depends on time: some of "load", "supports", "gap" and "law"; empty at rest."""
        found = {part for contact in self.contacts.values() for part in contact.time_dependent}
        loads = (self.volume_load, *map(traction_value, self.boundary_loads.values()))
        held = (value for support in self.supports.values() for value in prescribed_values(support))
        found |= {"load"} if any(map(depends_on_time, loads)) else set()
        return frozenset(found | ({"supports"} if any(map(depends_on_time, held)) else set()))

    def at_time(self, t: float) -> Self:
        """The problem at a time: itself if nothing depends on time.

        Raises
        ------
        ProblemError
            The time is not a finite number.
        """
        if not np.isfinite(number(t, "the time", "give a finite number")):
            raise ProblemError(f"the time is {t!r}; give a finite number")
        if not self.time_dependent:
            return self
        bound = copy.copy(self)  # what holds of the statement holds at every time, and is not checked again
        for names, now in (((*self.load_names, "supports"), condition_at_time), (self._founded, _contact_at_time)):
            for name in names:
                value = getattr(self, name)
                parts = {key: now(one, float(t)) for key, one in value.items()} if isinstance(value, Mapping) else None
                found = now(value, float(t)) if parts is None else MappingProxyType(parts)
                object.__setattr__(bound, name, found)
        return bound

    # ---- what is checked ------------------------------------------------------------------------------------

    def _check_frame(self) -> None:
        """Refuse what is no mesh, no order or no units."""
        expect(self.units, Units, "units", UNITS_REMEDY)
        if not isinstance(self.mesh, Mesh):
            raise ProblemError(f"mesh is {described(self.mesh)}; pass a hemivar Mesh, from read_mesh or rectangle")
        if not isinstance(self.order, int | np.integer) or self.order not in (1, 2):
            raise ProblemError(f"order = {self.order!r}; give 1 or 2")

    def _check_boundaries(self, name: str) -> None:
        """Refuse a field that does not map boundaries of the mesh to conditions."""
        given = getattr(self, name)
        if not isinstance(given, Mapping):
            raise ProblemError(
                f"{name} must map boundary names to conditions, {{'left': ...}}; it is {described(given)}"
            )
        for boundary in given:
            self._check_name(name, boundary, "boundary", "boundaries")
        object.__setattr__(self, name, MappingProxyType(dict(given)))

    def _check_name(self, what: str, name: object, one: str, many: str) -> None:
        """Refuse the name of a boundary or region that the mesh does not have."""
        known = list(getattr(self.mesh, many))
        if name not in known:
            near = suggest(str(name), known, many)
            raise ProblemError(f"{what} names {one} '{name}', which the mesh does not have{near}")

    def _check_overlaps(self) -> None:
        """Refuse facets of two foundations, and of one where a support holds everything."""
        used = [*{*self.contact, *self.supports}]
        facets = [self.mesh.boundaries[name] for name in used]
        nodes = np.unique(np.concatenate([np.zeros(0, dtype=np.int64), *(part.ravel() for part in facets)]))
        keys = {
            name: facet_keys(np.searchsorted(nodes, part), len(nodes)) for name, part in zip(used, facets, strict=True)
        }
        names = list(self.contact)
        for i, first in enumerate(names):
            for second in names[i + 1 :]:
                shared = int(np.isin(keys[first], keys[second]).sum())
                if shared:
                    raise ProblemError(
                        f"contact boundaries '{first}' and '{second}' share {shared} facets; a facet can "
                        f"touch one foundation only: separate them"
                    )
            for other, support in self.supports.items():
                shared = int(np.isin(keys[first], keys[other]).sum())
                if shared and not isinstance(support, Roller | Fixed):
                    how = "clamped" if isinstance(support, Clamped) else f"held by a prescribed {self.unknown}"
                    raise ProblemError(
                        f"contact boundary '{first}' is {how} (support '{other}', {shared} common facets), so no "
                        "contact can happen there; remove one of the two"
                    )


def _contact_at_time(contact: Contact | ScalarContact, t: float) -> Contact | ScalarContact:
    return contact.at_time(t)
