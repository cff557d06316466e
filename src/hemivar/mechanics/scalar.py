"""The statement of a scalar problem: a membrane, antiplane shear or the flow of heat, with laws of its one component.

    -div(A grad u) + bedding u = source      in the domain,      A grad u . nu = flux  or  u = value  on its boundary,

and on contact boundaries, or over an area, a force ``-lambda`` per length or area with ``lambda in dj(r)``, where r is
u less a level.  A membrane has its tension for A and a deflection for u, antiplane shear the shear modulus and the
displacement across the plane, heat the conductivity and the temperature.
"""

from __future__ import annotations

import difflib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from enum import StrEnum
from types import MappingProxyType

import numpy as np

from hemivar.basics.arguments import described, expect
from hemivar.basics.display import ReprMixin
from hemivar.basics.portable import PickleMixin
from hemivar.basics.stated import Form, stated
from hemivar.basics.types import Array, BoolArray
from hemivar.basics.units import UNITS_REMEDY, Units
from hemivar.errors import ProblemError
from hemivar.laws import Friction, NoContact, OrthotropicFriction, Superpotential
from hemivar.laws.consistency import check_own
from hemivar.laws.friction.bounds import StateBound
from hemivar.laws.memory import Memory
from hemivar.mechanics.coefficient import Coefficient, flux_density, plain_coefficient
from hemivar.mechanics.conditions import LARGEST, ScalarData, plain_data
from hemivar.mechanics.gradient_energy import FluxDensity, GradientEnergy
from hemivar.mechanics.instants import at_time, depends_on_time, law_at_time, law_depends_on_time, refuse_time
from hemivar.mechanics.per_volume import Regional, checked_per_volume, checked_quantity, constant_of
from hemivar.mechanics.statement import ContactProblem
from hemivar.mesh.keys import facet_keys
from hemivar.mesh.mesh import Mesh

__all__ = ["AREA", "ScalarContact", "ScalarKind", "ScalarProblem", "Side", "Statement"]

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
    def memory(self) -> tuple[Memory, ...]:
        """What contact points remember in time: nothing."""
        return ()

    @property
    def damping(self) -> Superpotential | None:
        """The law of the rate of the penetration: none."""
        return None


@dataclass(frozen=True, eq=False)
class ScalarProblem(PickleMixin, ReprMixin):
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

    mesh: Mesh
    coefficient: Coefficient | Mapping[str, Coefficient]
    contact: Mapping[str, ScalarContact] = field(default_factory=dict)
    area: ScalarContact | Mapping[str, ScalarContact] = field(default_factory=dict)
    supports: Mapping[str, ScalarData] = field(default_factory=dict)
    source: ScalarData = 0.0
    fluxes: Mapping[str, ScalarData] = field(default_factory=dict)
    bedding: ScalarData = 0.0
    kind: ScalarKind = ScalarKind.MEMBRANE
    title: str = ""
    order: int = 1
    density: Regional | None = None
    viscosity: Regional | None = None
    capacity: Regional | None = None
    units: Units = field(default_factory=Units)

    def __post_init__(self) -> None:
        put = object.__setattr__
        expect(self.units, Units, "units", UNITS_REMEDY)
        if not isinstance(self.mesh, Mesh):
            raise ProblemError(f"mesh is {described(self.mesh)}; pass a hemivar Mesh, from read_mesh or rectangle")
        try:
            put(self, "kind", ScalarKind(self.kind))
        except ValueError:
            raise ProblemError(f"kind = {self.kind!r}; choose 'membrane', 'antiplane' or 'heat'") from None
        if self.mesh.dim == 3 and self.kind is not ScalarKind.HEAT:
            raise ProblemError(f"kind = '{self.kind}' needs a plane mesh, and this one lies in space; take a rectangle")
        if not isinstance(self.order, int | np.integer) or self.order not in (1, 2):
            raise ProblemError(f"order = {self.order!r}; give 1 or 2")
        put(self, "coefficient", self._checked_coefficient())
        for name in ("contact", "supports", "fluxes"):
            given = getattr(self, name)
            if not isinstance(given, Mapping):
                raise ProblemError(
                    f"{name} must map boundary names to conditions, {{'left': ...}}; it is {described(given)}"
                )
            for boundary in given:
                _check_name(name, boundary, "boundary", list(self.mesh.boundaries))
            put(self, name, MappingProxyType(dict(given)))
        put(self, "area", self._checked_area())
        for name in ("supports", "fluxes"):
            values = {
                boundary: plain_data(value, f"{name}['{boundary}']", vector=False, most=LARGEST)
                for boundary, value in getattr(self, name).items()
            }
            put(self, name, MappingProxyType(values))
        put(self, "source", plain_data(self.source, "source", vector=False, most=LARGEST))
        parts = self.coefficient.values() if isinstance(self.coefficient, Mapping) else (self.coefficient,)
        for name, value in (("bedding", self.bedding), *((self.kind.constant, part) for part in parts)):
            refuse_time(value, name)
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
    def homogeneous(self) -> bool:
        """Whether the coefficient is the same everywhere."""
        return not callable(self.coefficient) and not isinstance(self.coefficient, Mapping)

    @property
    def time_dependent(self) -> frozenset[str]:
        """What depends on time: ``"load"``, ``"supports"``, ``"gap"`` (a level) and ``"law"``; empty at rest."""
        contacts = (*self.contact.values(), *self.areas.values())
        given = {
            "load": any(map(depends_on_time, (self.source, *self.fluxes.values()))),
            "supports": any(map(depends_on_time, self.supports.values())),
            "gap": any(depends_on_time(one.level) for one in contacts),
            "law": any(law_depends_on_time(one.law) for one in contacts),
        }
        return frozenset(name for name, depends in given.items() if depends)

    def at_time(self, t: float) -> ScalarProblem:
        """The problem at a time; itself if nothing depends on time."""
        if not self.time_dependent:
            return self

        def now(one: ScalarContact) -> ScalarContact:
            return replace(one, law=law_at_time(one.law, t), level=at_time(one.level, t))

        return replace(
            self,
            contact={name: now(one) for name, one in self.contact.items()},
            area=now(self.area) if isinstance(self.area, ScalarContact) else {k: now(v) for k, v in self.area.items()},
            supports={name: at_time(value, t) for name, value in self.supports.items()},
            source=at_time(self.source, t),
            fluxes={name: at_time(value, t) for name, value in self.fluxes.items()},
        )

    def on(self, mesh: Mesh) -> ScalarProblem:
        """The same problem on another mesh, which must have the same names."""
        return replace(self, mesh=mesh)

    def coefficients(self, points: Array, regions: Mapping[str, BoolArray] | None = None) -> Array:
        """The tensors A at points, shape (k, d, d); a broadcast view (first stride zero) if A is the same everywhere.

        Parameters
        ----------
        points : array, shape (k, d)
        regions : mapping of name to bool array, shape (k,)
            Which points lie in which region; needed by coefficients by region only.

        Raises
        ------
        ProblemError
            A is not positive definite at some point, or the regions do not cover the points; the message names one.
        """
        return self._of_parts(lambda part, at: part.at_rest(points[at]), points, regions)

    def _of_parts(
        self,
        function: Callable[[FluxDensity, BoolArray | slice], Array],
        points: Array,
        regions: Mapping[str, BoolArray] | None,
    ) -> Array:
        """What a function makes of the coefficient, or of that of each region for the points there."""
        what = self.kind.constant
        if not isinstance(self.coefficient, Mapping):
            return function(flux_density(self.coefficient, what), slice(None))
        found: Array | None = None
        covered = np.zeros(len(points), dtype=int)
        for name, value in self.coefficient.items():
            mask = (regions or {})[name]
            covered += mask
            if mask.any():
                part = function(flux_density(value, f"{what} of region '{name}'"), mask)
                found = np.zeros((len(points), *part.shape[1:])) if found is None else found
                found[mask] = part
        if (covered != 1).any():
            bad = int(np.flatnonzero(covered != 1)[0])
            where = "no region" if covered[bad] == 0 else "more than one region"
            raise ProblemError(
                f"the point {points[bad].tolist()} lies in {where} that the {what} names; the regions must cover the "
                "mesh without overlap"
            )
        assert found is not None
        return found

    @property
    def linear(self) -> bool:
        """Whether the flux is linear in the gradient everywhere."""
        parts = self.coefficient.values() if isinstance(self.coefficient, Mapping) else (self.coefficient,)
        return not any(isinstance(part, GradientEnergy) for part in parts)

    @property
    def uniform(self) -> bool:
        """Whether the coefficient of every region is the same all over it."""
        parts = self.coefficient.values() if isinstance(self.coefficient, Mapping) else (self.coefficient,)
        return not any(callable(part) for part in parts)

    def energy(self, points: Array, strain: Array, regions: Mapping[str, BoolArray] | None = None) -> Array:
        """The stored energy W per area (volume in space) of gradients ``strain`` (k, d), shape (k,)."""
        return self._of_parts(lambda part, at: part.energy(points[at], strain[at]), points, regions)

    def stress(self, points: Array, strain: Array, regions: Mapping[str, BoolArray] | None = None) -> Array:
        """The flux (k, d) of gradients ``strain`` (k, d), the derivative of :meth:`energy`."""
        return self._of_parts(lambda part, at: part.stress(points[at], strain[at]), points, regions)

    def tangent(self, points: Array, strain: Array, regions: Mapping[str, BoolArray] | None = None) -> Array:
        """Derivatives (k, d, d) of the flux by the gradient."""
        return self._of_parts(lambda part, at: part.tangent(points[at], strain[at]), points, regions)

    def lower_tensor(self, points: Array, regions: Mapping[str, BoolArray] | None = None) -> Array:
        """Matrices (k, d, d) below all derivatives of the flux."""
        return self._of_parts(lambda part, at: part.lower_tensor(points[at]), points, regions)

    def upper_tensor(self, points: Array, regions: Mapping[str, BoolArray] | None = None) -> Array:
        """Matrices (k, d, d) above all derivatives of the flux."""
        return self._of_parts(lambda part, at: part.upper_tensor(points[at]), points, regions)

    @property
    def inert(self) -> bool:
        """Whether it has a density."""
        return self.density is not None and constant_of(self.density) != 0.0

    @property
    def resisted(self) -> bool:
        """Whether a rate is resisted: by viscosity, or by the capacity for heat."""
        return self.viscosity is not None or self.capacity is not None

    def _check_rates(self) -> None:
        heat = self.kind is ScalarKind.HEAT
        for name, meaning in (("density", "has no inertia"), ("viscosity", "has no viscosity")):
            if heat and getattr(self, name) is not None:
                raise ProblemError(f"heat {meaning}; leave the {name} out, what stores heat is its capacity=")
        if not heat and self.capacity is not None:
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
            _check_name(what, name, "region", list(self.mesh.regions))
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
            _check_name("area", name, "region", list(self.mesh.regions))
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
        used = {name: self.mesh.boundaries[name] for name in {*self.contact, *self.supports}}
        nodes = np.unique(np.concatenate([np.zeros(0, dtype=np.int64), *(part.ravel() for part in used.values())]))
        keys = {name: facet_keys(np.searchsorted(nodes, part), len(nodes)) for name, part in used.items()}
        names = list(self.contact)
        for i, first in enumerate(names):
            for other in (*names[i + 1 :], *self.supports):
                shared = int(np.isin(keys[first], keys[other]).sum())
                if not shared:
                    continue
                if other in self.supports:
                    raise ProblemError(
                        f"contact boundary '{first}' is held by support '{other}' ({shared} common facets), so no "
                        "contact can happen there; remove one of the two"
                    )
                raise ProblemError(
                    f"contact boundaries '{first}' and '{other}' share {shared} facets; a facet can touch one "
                    "foundation only: separate them"
                )


def _check_name(what: str, name: str, kind: str, known: list[str]) -> None:
    if name not in known:
        close = difflib.get_close_matches(str(name), known, n=1)
        hint = f"; did you mean '{close[0]}'?" if close else ""
        listed = "boundaries" if kind == "boundary" else "regions"
        raise ProblemError(
            f"{what} names {kind} '{name}', which the mesh does not have{hint} ({listed}: {', '.join(known) or 'none'})"
        )


#: What :func:`hemivar.discretize` takes.
Statement = ContactProblem | ScalarProblem
