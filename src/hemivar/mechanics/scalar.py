"""The statement of a scalar problem: a membrane, antiplane shear or the flow of heat, with laws of its one component.

    -div(A grad u) + bedding u = source      in the domain,      A grad u . nu = flux  or  u = value  on its boundary,

and on contact boundaries, or over an area, a force ``-lambda`` per length or area with ``lambda in dj(r)``, where r is
u less a level.  A membrane has its tension for A and a deflection for u, antiplane shear the shear modulus and the
displacement across the plane, heat the conductivity and the temperature.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from enum import StrEnum
from types import MappingProxyType
from typing import ClassVar

from hemivar.basics.arguments import described
from hemivar.basics.first_use import cached_property
from hemivar.basics.portable import PickleMixin
from hemivar.basics.stated import Form, stated
from hemivar.basics.units import Units
from hemivar.errors import ProblemError
from hemivar.laws import Friction, NoContact, OrthotropicFriction, Superpotential
from hemivar.laws.consistency import check_own
from hemivar.laws.friction.bounds import StateBound
from hemivar.laws.memory import Memory
from hemivar.mechanics.coefficient import Coefficient, plain_coefficient
from hemivar.mechanics.conditions import LARGEST, ScalarData, plain_data
from hemivar.mechanics.gradient_material import GradientMaterial
from hemivar.mechanics.instants import at_time, depends_on_time, law_at_time, law_depends_on_time, refuse_time
from hemivar.mechanics.per_volume import Regional, checked_per_volume, checked_quantity
from hemivar.mechanics.statement_base import ORDER, Statement
from hemivar.mesh.mesh import Mesh

__all__ = ["AREA", "ScalarContact", "ScalarKind", "ScalarProblem", "Side"]

#: What contact over the whole domain is called beside the contact boundaries.
AREA = "area"


class ScalarKind(StrEnum):
    """What a scalar problem is about; names only, the equations are the same."""

    MEMBRANE = "membrane"
    ANTIPLANE = "antiplane"
    HEAT = "heat"

    @property
    def unknown(self) -> str:
        """What u is called."""
        return {"membrane": "deflection", "antiplane": "displacement", "heat": "temperature"}[self.value]

    @property
    def constant(self) -> str:
        """What the coefficient is called."""
        return {"membrane": "tension", "antiplane": "shear modulus", "heat": "conductivity"}[self.value]

    @property
    def flux(self) -> str:
        """What ``A grad u`` is called."""
        return {"membrane": "force", "antiplane": "shear stress", "heat": "heat flow"}[self.value]


class Side(StrEnum):
    """Where a foundation lies, seen from the membrane."""

    ABOVE = "above"
    """It is met by growing u: ``r = u - level``."""
    BELOW = "below"
    """It is met by falling u: ``r = level - u``."""


@dataclass(frozen=True, eq=False)
class ScalarContact(PickleMixin):
    """What a foundation does to the one component, along a boundary or over an area.

    Attributes
    ----------
    law : Superpotential or Friction
        A law of the penetration ``r = u - level`` (``level - u`` where the foundation lies below), such as
        :class:`~hemivar.Signorini` for an obstacle; or friction, an even law of the slip ``u - level``, whose bound may
        depend on the place but not on the solution.  A law gives a force per length of a boundary, or per area.
    level : float or callable
        Where the foundation stands: height of an obstacle, displacement of the plate that is rubbed, temperature
        outside.  A callable gets points, shape (k, d), and returns shape (k,).
    side : Side
        ``"above"`` (default) or ``"below"``.

    Raises
    ------
    ProblemError
        The law is neither, or its bound depends on the solution.
    """

    law: Superpotential | Friction
    level: ScalarData = field(
        default=0.0, metadata=stated(Form.QUANTITY, "where the foundation stands *(f, t)*", timed=True)
    )
    side: Side = field(default=Side.ABOVE, metadata=stated(Form.TEXT, '`"above"` or `"below"`', choices=tuple(Side)))

    def __post_init__(self) -> None:
        if isinstance(self.law, OrthotropicFriction):
            raise ProblemError("orthotropic friction has a direction, and a scalar problem none; take Tresca")
        if isinstance(self.law, Friction):
            if isinstance(self.law.bound, StateBound):
                raise ProblemError(
                    f"the bound of friction law '{self.law.name}' depends on penetration or pressure, which a scalar "
                    f"problem does not have; give a number, a formula or a function of x"
                )
        elif isinstance(self.law, Superpotential):
            check_own(self.law)
        else:
            raise ProblemError(
                f"the law of a scalar contact is {described(self.law)}; give a superpotential such as Signorini(), or "
                "friction such as Tresca(0.5)"
            )
        object.__setattr__(self, "level", plain_data(self.level, "level", vector=False, most=LARGEST))
        try:
            object.__setattr__(self, "side", Side(self.side))
        except ValueError:
            raise ProblemError(f"side = {self.side!r}; choose 'above' or 'below'") from None

    @property
    def rubs(self) -> bool:
        """Whether the law is friction."""
        return isinstance(self.law, Friction)

    @property
    def normal(self) -> Superpotential:
        """The law of the penetration; none where the law is friction."""
        return NoContact() if isinstance(self.law, Friction) else self.law

    @property
    def time_dependent(self) -> frozenset[str]:
        """What depends on time: "gap" (the level), "law", or both."""
        moves, changes = depends_on_time(self.level), law_depends_on_time(self.law)
        return frozenset((["gap"] if moves else []) + (["law"] if changes else []))

    def at_time(self, t: float) -> ScalarContact:
        """The contact at a time; itself if it does not depend on time."""
        if not self.time_dependent:
            return self
        return replace(self, law=law_at_time(self.law, t), level=at_time(self.level, t))

    @property
    def remembers(self) -> tuple[Memory, ...]:
        """What contact points remember in time: nothing."""
        return ()

    @property
    def damping(self) -> Superpotential | None:
        """The law of the rate of the penetration: none."""
        return None


@dataclass(frozen=True, eq=False)
class ScalarProblem(Statement):
    """A membrane, antiplane shear or heat: one component over a mesh, with laws at boundaries and over areas.

    Attributes
    ----------
    mesh : Mesh
        Plane, or in space for heat.
    coefficient : float, tensor, callable, or mapping of region name to one of these
        A: tension, shear modulus or conductivity, positive.  A tensor has shape (d, d), symmetric positive definite; a
        callable gets points, shape (k, d), and returns shape (k,) or (k, d, d).  A :class:`GradientEnergy` such as
        :class:`PowerLaw` makes a flux that is not linear in the gradient.  The regions of a mapping must cover
        the mesh without overlap.
    contact : mapping of boundary name to ScalarContact
    area : ScalarContact, or mapping of region name to ScalarContact
        Contact over the domain or over regions of it; none by default.
    supports : mapping of boundary name to float or callable
        Values of u.
    source : float or callable
        Per area (volume in space).
    fluxes : mapping of boundary name to float or callable
        ``A grad u . nu``, per length (area in space); zero by default.
    bedding : float or callable
        Elastic bedding ``-bedding u`` per area, not negative.
    kind : ScalarKind
        ``"membrane"`` (default), ``"antiplane"`` or ``"heat"``: what things are called.
    title : str
    order : int
        Polynomial degree of the elements, 1 or 2.
    density : float, callable, mapping of region name to one of these, or None
        Mass per area of a membrane, or per volume in antiplane shear: the factor of u''.
    viscosity : float, callable, mapping or None
        Factor of grad u', beside A grad u: the tension or the shear stress of Kelvin and Voigt.
    capacity : float, callable, mapping or None
        Of heat: heat per volume and degree, the factor of u'.  A problem at rest knows nothing of the three.
    units : Units
        For labels; no number is converted.

    Raises
    ------
    ProblemError
        If a name is unknown, numbers are not finite, conditions exclude each other, heat has a density or a
        viscosity, or something else a capacity.
    """

    load_names: ClassVar[tuple[str, str]] = "source", "fluxes"
    _founded: ClassVar[tuple[str, ...]] = "contact", "area"

    mesh: Mesh
    coefficient: Coefficient | Mapping[str, Coefficient]
    contact: Mapping[str, ScalarContact] = field(default_factory=dict)
    area: ScalarContact | Mapping[str, ScalarContact] = field(default_factory=dict)
    supports: Mapping[str, ScalarData] = field(
        default_factory=dict, metadata=stated(Form.QUANTITY, timed=True, by="boundary")
    )
    source: ScalarData = field(default=0.0, metadata=stated(Form.QUANTITY, timed=True, table="loads"))
    fluxes: Mapping[str, ScalarData] = field(
        default_factory=dict, metadata=stated(Form.QUANTITY, key="flux", timed=True, by="boundary", table="loads")
    )
    bedding: ScalarData = field(default=0.0, metadata=stated(Form.QUANTITY, least=0.0, table="loads"))
    kind: ScalarKind = ScalarKind.MEMBRANE
    title: str = ""
    order: int = field(default=1, metadata=ORDER)
    density: Regional | None = None
    viscosity: Regional | None = None
    capacity: Regional | None = None
    units: Units = field(default_factory=Units)

    def __post_init__(self) -> None:
        put = object.__setattr__
        self._check_frame()
        try:
            put(self, "kind", ScalarKind(self.kind))
        except ValueError:
            raise ProblemError(f"kind = {self.kind!r}; choose 'membrane', 'antiplane' or 'heat'") from None
        if self.mesh.dim == 3 and not self.thermal:
            raise ProblemError(f"kind = '{self.kind}' needs a plane mesh, and this one lies in space; take a rectangle")
        put(self, "coefficient", self._checked_coefficient())
        for name in ("contact", "supports", "fluxes"):
            self._check_boundaries(name)
        put(self, "area", self._checked_area())
        for name in ("supports", "fluxes"):
            values = {
                boundary: plain_data(value, f"{name}['{boundary}']", vector=False, most=LARGEST)
                for boundary, value in getattr(self, name).items()
            }
            put(self, name, MappingProxyType(values))
        put(self, "source", plain_data(self.source, "source", vector=False, most=LARGEST))
        parts = self.coefficient.values() if isinstance(self.coefficient, Mapping) else (self.coefficient,)
        for part in parts:
            refuse_time(part, self.kind.constant)
        put(self, "bedding", checked_quantity(self.bedding, "bedding"))
        for name in ("density", "viscosity", "capacity"):
            if getattr(self, name) is not None:
                put(self, name, checked_per_volume(getattr(self, name), name, list(self.mesh.regions)))
        self._check_rates()
        self._check_contacts()

    def __repr__(self) -> str:
        parts = [repr(self.title)] if self.title else []
        parts += [self.kind.value, repr(self.mesh)]
        parts += [f"contact on {name}: {one.law.name}" for name, one in self.contact.items()]
        parts += [f"contact over {name}: {one.law.name}" for name, one in self.areas.items()]
        parts += [f"held on {name}" for name in self.supports]
        return f"ScalarProblem({', '.join(parts)})"

    @property
    def areas(self) -> Mapping[str, ScalarContact]:
        """Contacts over the area, by region; one over the whole domain is called :data:`AREA`."""
        return {AREA: self.area} if isinstance(self.area, ScalarContact) else self.area

    @property
    def contacts(self) -> Mapping[str, ScalarContact]:
        return {**self.contact, **self.areas}

    @property
    def components(self) -> int:
        return 1

    @property
    def unknown(self) -> str:
        return self.kind.unknown

    @property
    def thermal(self) -> bool:
        return self.kind is ScalarKind.HEAT

    @cached_property
    def material(self) -> GradientMaterial:
        """The coefficient, density and viscosity as what a body has in their place."""
        return GradientMaterial(self.coefficient, self.kind.constant, self.density, self.viscosity)

    def _check_rates(self) -> None:
        for name, meaning in (("density", "has no inertia"), ("viscosity", "has no viscosity")):
            if self.thermal and getattr(self, name) is not None:
                raise ProblemError(f"heat {meaning}; leave the {name} out, what stores heat is its capacity=")
        if not self.thermal and self.capacity is not None:
            raise ProblemError(
                f"a capacity stores heat, and this problem is one of kind '{self.kind}'; give its density= and "
                "viscosity=, or kind='heat'"
            )

    def _checked_coefficient(self) -> Coefficient | Mapping[str, Coefficient]:
        what, dim = self.kind.constant, self.mesh.dim
        if not isinstance(self.coefficient, Mapping):
            return plain_coefficient(self.coefficient, what, dim)
        if not self.coefficient:
            raise ProblemError(f"the {what} is an empty mapping; give one for each region of the mesh")
        for name in self.coefficient:
            self._check_name(what, name, "region", "regions")
        parts = {
            name: plain_coefficient(value, f"{what} of region '{name}'", dim)
            for name, value in self.coefficient.items()
        }
        return MappingProxyType(parts)

    def _checked_area(self) -> ScalarContact | Mapping[str, ScalarContact]:
        if isinstance(self.area, ScalarContact):
            return self.area
        if not isinstance(self.area, Mapping):
            raise ProblemError(
                f"area is {described(self.area)}; give ScalarContact(law, level), or one for each region, "
                "{'patch': ScalarContact(...)}"
            )
        for name in self.area:
            self._check_name("area", name, "region", "regions")
        return MappingProxyType(dict(self.area))

    def _check_contacts(self) -> None:
        for what, contacts in (("contact", self.contact), ("area", self.areas)):
            for name, one in contacts.items():
                if not isinstance(one, ScalarContact):
                    raise ProblemError(
                        f"{what}['{name}'] is {described(one)}; wrap the law: ScalarContact(Signorini(), level=0.1)"
                    )
        for name in self.areas:
            if name in self.contact:
                raise ProblemError(
                    f"'{name}' names a boundary with contact and a region with contact, which results could not tell "
                    "apart; rename one of them in the mesh"
                )
        if self.order == 2 and (self.areas or (self.contact and self.mesh.dim == 3)):
            raise ProblemError(
                "contact over an area (or on a boundary in space) is not available with elements of order 2, "
                "whose corner weights vanish; take order=1"
            )
        self._check_overlaps()
