"""The statement (strong form) of a contact problem: what a user writes."""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import StrEnum
from itertools import chain
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from hemivar.basics.arguments import described, expect, number, one_of, quoted, suggest
from hemivar.basics.arrays import LARGEST, SAME
from hemivar.basics.display import ReprMixin
from hemivar.basics.first_use import cached_property
from hemivar.basics.known_keywords import known_fields
from hemivar.basics.portable import PickleMixin
from hemivar.basics.stated import Form, stated, stated_of_one
from hemivar.basics.types import Array, IntArray
from hemivar.basics.units import UNITS_REMEDY, Units
from hemivar.errors import ProblemError
from hemivar.mechanics.conditions import (
    SUPPORTS,
    Clamped,
    Fixed,
    Prescribed,
    Pressure,
    RigidPlate,
    Roller,
    ScalarData,
    Spring,
    Support,
    Traction,
    VectorData,
    condition_at_time,
    plain_data,
    stated_values,
)
from hemivar.mechanics.foundation import Contact, Side
from hemivar.mechanics.initial_stress import InitialField, checked_field, field_at, field_depends_on_time, is_zero
from hemivar.mechanics.instants import depends_on_time, error_context
from hemivar.mechanics.kinematics import BodyKinematics
from hemivar.mechanics.load_steps import (
    Step,
    after_step,
    between_bolts,
    between_conditions,
    between_fields,
    between_values,
    bolted,
    kept_step,
)
from hemivar.mechanics.material import Material
from hemivar.mechanics.material_words import ScalarKind
from hemivar.mechanics.per_volume import checked_quantity
from hemivar.mesh.boundary_rule import boundary_rule
from hemivar.mesh.checks import check_order
from hemivar.mesh.keys import facet_keys
from hemivar.mesh.mesh import Mesh

__all__ = ["AREA", "ContactProblem", "Quadrature", "expect_body", "refuse_areas"]

#: What contact over the whole mesh is called.
AREA = "area"
#: What a body has before anything moves.
INITIAL = ("initial_stress", "initial_strain")
#: How many times softer a body is that has the contact points though its mesh is coarser.
_MUCH_STIFFER = 4.0
#: What scalar problems had, and where it stands.
_RENAMED = {
    "coefficient": "material.coefficient", "density": "material.density", "viscosity": "material.viscosity",
    "capacity": "material.capacity", "area": "contact, by region", "contacts": "contact", "source": "body_force",
    "fluxes": "tractions",
}  # fmt: skip


class Quadrature(StrEnum):
    """Where the contact law is evaluated."""

    NODAL = "nodal"
    """At the nodes of the contact boundary (lumped): the nonsmooth part is separable."""
    MIDPOINT = "midpoint"
    """On the contact facets of plane bodies, at the mean displacement of each (the midpoint for order 1): constant
    multipliers."""


class Geometry(StrEnum):
    """What boundaries that look curved are: facets that follow each other at small angles."""

    CURVED = "curved"
    """The mesh replaces a curve by its facets: bounds of the distance to the exact solution are estimates, and two
    bodies are as far apart as the arcs through their nodes."""
    AS_MESHED = "as-meshed"
    """The body is the polygon or polyhedron of the mesh: its exact solution is meant, and its facets' distance."""


@known_fields
@dataclass(frozen=True, eq=False)
class ContactProblem(PickleMixin, ReprMixin):
    """An elastic body, its supports and loads, and the foundations it may touch.

    With :meth:`Material.gradient` it has one component: a membrane, antiplane shear or heat, which
    :func:`ScalarProblem` states in its own words.

    Loads, prescribed displacements, gaps and the parameters of laws may depend on time: as functions of place and time,
    ``f(x, t)``, or as formulas with t. :meth:`at_time` gives the problem at one time, which is what
    :func:`discretize` takes.

    Attributes
    ----------
    mesh : Mesh
    material : Material
    contact : mapping of name to Contact
        By boundary, or by region for contact over an area; :data:`AREA` is the whole mesh. Over an area of a plane
        body, such as a sheet that lies on a table, friction acts on the whole displacement.
    supports : mapping of boundary name to Support
        :class:`Clamped`, :class:`Roller`, :class:`Fixed`, :class:`Prescribed`, :class:`Spring` or
        :class:`RigidPlate`; ``"clamped"`` and ``"roller"`` are turned into the first two.  Sets of nodes of the mesh
        may be named as well, and points, by any name, ``hv.Clamped(at=(0.0, 0.0))``.  Of one component a number or a
        callable that returns shape (k,), as the loads are.
    body_force : vector, shape (d,), or callable
        Force per volume; a callable gets points, shape (k, d), and returns shape (k, d).
    tractions : mapping of boundary name to vector, callable or Pressure
        Force per area.
    title : str
    order : int, optional
        Polynomial degree of the elements, 1 or 2.
    quadrature : Quadrature
        Where the contact laws are evaluated.
    bedding : float or callable
        An elastic bedding of the whole body, a force ``-bedding u`` per volume (Winkler), not negative; a callable gets
        points, shape (k, d), and returns shape (k,).
    stiffening : bool
        Whether the stress of the load itself stiffens or softens the body: its geometric stiffness is added. Loads at
        rest, linear materials. Stretch by deflection, of bodies held at both ends, is not counted.
    units : Units
        For labels; no number is converted.
    geometry : Geometry
        What boundaries that look curved are, for the distance of two bodies and bounds of that to the exact solution.
    trace_constant : float, optional
        A c that you know, with ``|v| <= c |eps(v)|`` for all displacements v that supports allow, the norms those of L2
        on the contact boundary and in the body; root of a length. Bounds of the distance to the exact solution
        that need it name it as a condition.
    initial_stress : float, array, callable or mapping of region to these
        Stress of the body before anything moves, tension positive: a number, alike in all directions (a pore pressure
        p is ``-b*p``), a symmetric tensor (d, d), or one of these for each cell, (M,) or (M, d, d); a callable gets
        points, shape (k, d), and returns (k,) or (k, d, d). In the plane a tensor may be (3, 3), the last direction
        across it; of a body of revolution, around the axis, it must. Regions that a mapping leaves out have none.
    initial_strain : float, array, callable or mapping of region to these
        Strain of the body without stress (eigenstrain), in the same forms: ``alpha*dT`` of a change of temperature.
        Linear materials.
    initial_scaled : bool
        Whether initial stress and strain grow with the load factor on a load path, as the misfit of a body that is
        warmed; by default they have their full size from the start on, as what is in a rock.
    steps : sequence of Step
        Load steps: a sequence of static problems, each of which begins with the friction history of the one before.
        The problem then depends on time, which counts the steps: step k ends at t = k. :class:`hemivar.Evolution` goes
        through them.
    ties : mapping of boundary name to Contact
        The contacts with :class:`~hemivar.laws.Tie`: bodies joined for good, along which nothing touches.  State them
        in ``contact``, from where they are put here.

    Raises
    ------
    ProblemError
        If a boundary name is unknown, numbers are not finite, or boundaries overlap in a way that makes no
        sense.

    Examples
    --------
    >>> import hemivar as hv
    >>> problem = hv.ContactProblem(
    ...     mesh=hv.rectangle((1.0, 1.0), 4), material=hv.Material.young(10.0, 0.3),
    ...     contact={"bottom": hv.Contact(hv.Signorini(), hv.Coulomb(0.3))}, supports={"left": "clamped"},
    ...     tractions={"top": (0.0, -1.0)})
    >>> hv.solve(problem).status.value
    'converged'
    """

    mesh: Mesh
    material: Material
    contact: Mapping[str, Contact] = field(default_factory=dict)
    supports: Mapping[str, Support | ScalarData] = field(
        default_factory=dict, metadata=stated_of_one(Form.QUANTITY, timed=True, by="boundary")
    )
    body_force: VectorData | ScalarData = field(
        default=0.0,
        metadata=stated(
            Form.VECTOR, "force per volume, one number for each direction *(f, t)*",
            key="body", timed=True, table="loads",
        ) | stated_of_one(Form.QUANTITY, key="source", timed=True, table="loads"),
    )  # fmt: skip
    tractions: Mapping[str, Traction] = field(
        default_factory=dict,
        metadata=stated(
            Form.VECTOR, "force per area of boundary, by name: `traction = { top = [0.0, -2.0] }` *(f, t)*",
            key="traction", timed=True, by="boundary", table="loads",
        ) | stated_of_one(Form.QUANTITY, key="flux", timed=True, by="boundary", table="loads"),
    )  # fmt: skip
    title: str = ""
    order: int = field(
        default=None,  # type: ignore[assignment]  # it is a number once the problem is made
        metadata=stated(
            Form.WHOLE, "1: linear elements; 2: quadratic ones", least=1, most=2, table="mesh",
            left_out="`1`; `2` for mesh files of tetrahedra of second order, and of plane cells of second order with "
            "straight edges",
        ),
    )  # fmt: skip
    quadrature: Quadrature = field(
        default=Quadrature.NODAL,
        metadata=stated(
            Form.TEXT,
            'where the contact laws act: `"nodal"` at the nodes of the contact boundary, `"midpoint"` at the midpoints '
            "of its facets (piecewise constant pressure; plane meshes only; a contact boundary constrained at both "
            "ends has more midpoints than free nodes and is rejected)",
            choices=tuple(Quadrature), table="mesh",
        ),
    )  # fmt: skip
    bedding: ScalarData = field(
        default=0.0,
        metadata=stated(
            Form.QUANTITY,
            "stiffness per volume of springs throughout the body, a force `-bedding u` per volume (Winkler), >= 0 "
            "*(f)*; "
            "such a body needs no support; a warning says how many digits a soft bedding costs",
            least=0.0, table="loads",
        ) | stated_of_one(Form.QUANTITY, least=0.0, table="loads"),
    )  # fmt: skip
    stiffening: bool = field(
        default=False,
        metadata=stated(
            Form.FLAG,
            "`true`: the stress of the load itself stiffens or softens the body, as tension straightens a lap joint; "
            "for single loads at rest, linear materials, 2D and 3D; not the stretch of a body held at both ends",
            table="loads",
        ),
    )  # fmt: skip
    units: Units = field(default_factory=Units)
    geometry: Geometry = field(
        default=Geometry.CURVED,
        metadata=stated(
            Form.TEXT,
            '`"as-meshed"`: the body is the polygon or polyhedron of the mesh, so that bounds of the distance to the '
            "exact solution hold for it, and the distance of two bodies is that of their facets; "
            '`"curved"`: facets that follow each other at small angles stand for a curve, bounds are estimates, and '
            "that distance is that of arcs through the nodes, as is that of quadratic tetrahedra from an obstacle",
            choices=tuple(Geometry), table="mesh",
        ),
    )  # fmt: skip
    trace_constant: float | None = field(
        default=None,
        metadata=stated(
            Form.NUMBER,
            "a c that you know: the norm of v on the contact boundary is at most c times that of eps(v) in the body, "
            "for all displacements v that supports allow; norms of L2, root of a length, > 0; bounds that need it name "
            "it as a condition",
            above=0.0, table="mesh",
        ),
    )  # fmt: skip

    initial_stress: InitialField = field(
        default=0.0,
        metadata=stated(
            Form.STRESS,
            "stress of the body before anything moves, tension positive: a number, d lists of d numbers (or 3 of "
            "3: the last direction is across the plane), or `{ REGION = ... }` *(f, t)*",
            key="stress", timed=True, by="region", table="loads",
        ),
    )  # fmt: skip
    initial_strain: InitialField = field(
        default=0.0,
        metadata=stated(
            Form.STRESS,
            "strain of the body without stress, such as `alpha dT` of heat: as `stress`, of linear materials *(f, t)*",
            key="strain", timed=True, by="region", table="loads",
        ),
    )  # fmt: skip
    initial_scaled: bool = field(
        default=False,
        metadata=stated(
            Form.FLAG, "`true`: on a load path initial stress and strain grow with the load factor", key="scaled",
            table="loads",
        ),
    )  # fmt: skip
    steps: Sequence[Step] = ()

    ties: Mapping[str, Contact] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self._check_frame()
        for name in ("supports", "tractions"):
            self._check_boundaries(name)
        self._check_contacts()
        self._put_ties_aside()
        self._check_values()
        self._check_overlaps()
        self._check_steps()

    def __repr__(self) -> str:
        parts = [repr(self.title)] if self.title else []
        what = self.kind.value if self.kind else type(self.material).__name__.lstrip("_").lower() + " material"
        parts += [what, repr(self.mesh)] if self.kind else [repr(self.mesh), what]
        for name, contact in self.contact.items():
            law = contact.friction if self.kind and contact.rubs else contact.law
            parts.append(f"contact {'over' if name in self.areas else 'on'} {name}: {law.name}")
        parts += [f"tie of {name} and {one.against}" for name, one in self.ties.items()]
        for name, support in self.supports.items():
            parts.append(f"{'held' if self.kind else type(support).__name__} on {name}")
        parts += [f"{len(self.steps)} load steps"] if self.steps else []
        return f"{'Scalar' if self.kind else 'Contact'}Problem({', '.join(parts)})"

    if not TYPE_CHECKING:

        def __getattr__(self, name: str) -> object:
            now = f"; it is {_RENAMED[name]}" if name in _RENAMED else ""
            raise AttributeError(f"a ContactProblem has no attribute '{name}'{now}")

    @property
    def kind(self) -> ScalarKind | None:
        """What the field is where it has one component; None of a displacement."""
        return self.material.scalar

    @property
    def components(self) -> int:
        """Components of the field: those of a displacement, or 1."""
        return 1 if self.kind else self.mesh.dim

    @property
    def unknown(self) -> str:
        """What the field is called."""
        return self.kind.unknown if self.kind else "displacement"

    @property
    def thermal(self) -> bool:
        """Whether the field is a temperature."""
        return self.kind is ScalarKind.HEAT

    @property
    def without_mass(self) -> str:
        """What is said where it moves and has no density."""
        what, maker = (self.kind, "ScalarProblem") if self.kind else ("material", "Material.lame")
        return f"the {what} has no density; give {maker}(..., density=rho)"

    def places(self, time: float) -> tuple[Array, int]:
        """The nodes (k, d) of the field and its components, the same at any time."""
        return self.mesh.nodes(self.order), self.components

    @property
    def load_names(self) -> tuple[str, str]:
        """What the load per volume and the loads by boundary are called."""
        return ("source", "fluxes") if self.kind else ("body_force", "tractions")

    @cached_property
    def kinematics(self) -> BodyKinematics:
        """The strains of the field, and the measure of integrals over the body."""
        return BodyKinematics.of(self.material, self.mesh.dim)

    @property
    def held_boundaries(self) -> Mapping[str, Support | ScalarData]:
        """The supports that fix displacements of boundaries: none of points, no springs, no plates."""
        return {
            name: support
            for name, support in self.supports.items()
            if name in self.mesh.boundaries and not isinstance(support, Spring | RigidPlate)
        }

    @cached_property
    def areas(self) -> Mapping[str, IntArray]:
        """The cells of contacts over areas, by name, in their order."""
        regions = {AREA: np.arange(self.mesh.number_of_cells), **self.mesh.regions}
        return {name: regions[name] for name in self.contact if name not in self.mesh.boundaries}

    def on(self, mesh: Mesh) -> ContactProblem:
        """The same problem on another mesh, which must have the same names."""
        return replace(self, mesh=mesh)

    @cached_property
    def time_dependent(self) -> frozenset[str]:
        """What depends on time: some of "load", "supports", "gap" and "law"; empty at rest."""
        if self.steps:
            also = {"supports": "supports", "bolts": "law"}
            return frozenset(
                {"load", *(part for name, part in also.items() if any(s.changes(name) for s in self.steps))}
            )
        parts = {part for contact in self.contact.values() for part in contact.time_dependent}
        loads = (self.body_force, *chain(*(stated_values(one).values() for one in self.tractions.values())))
        prescribed = chain(*(stated_values(one).values() for one in self.supports.values()))
        pushed = chain(*(one.loads.values() for one in self.supports.values() if isinstance(one, RigidPlate)))
        changing = self.initially_changing or any(map(depends_on_time, chain(loads, pushed)))
        parts |= {"load"} if changing else set()
        return frozenset(parts | ({"supports"} if any(map(depends_on_time, prescribed)) else set()))

    @property
    def initially_changing(self) -> bool:
        """Whether initial stress or initial strain depends on time."""
        return any(field_depends_on_time(getattr(self, name)) for name in INITIAL)

    def at_time(self, t: float) -> ContactProblem:
        """The problem at a time: itself if nothing depends on time.

        Raises
        ------
        ProblemError
            The time is not a finite number.
        """
        t = number(t, "the time", "give a finite number")
        if not np.isfinite(t):
            raise ProblemError(f"the time is {quoted(t)}; give a finite number")
        if not self.time_dependent:
            return self
        if self.steps:
            return self._in_step(t)
        bound = copy.copy(self)  # what holds of the statement holds at every time, and is not checked again

        def put(name: str, value: object) -> None:
            object.__setattr__(bound, name, value)

        bound.__dict__.pop("time_dependent", None)
        put("body_force", condition_at_time(self.body_force, t))
        for name in INITIAL:
            put(name, field_at(getattr(self, name), t))
        put("contact", MappingProxyType({name: one.at_time(t) for name, one in self.contact.items()}))
        for name in ("supports", "tractions"):
            parts = {key: condition_at_time(one, t) for key, one in getattr(self, name).items()}
            put(name, MappingProxyType(parts))
        return bound

    # ---- load steps -----------------------------------------------------------------------------------------

    @cached_property
    def _stages(self) -> tuple[ContactProblem, ...]:
        """The problem before the first step, and at the end of each."""
        stages = [replace(self, steps=())]
        for step in self.steps:
            before = stages[-1]
            with error_context(f"step '{step.name}'"):
                contact = bolted(before.contact, step, self._area)
                stages.append(replace(before, contact=contact, **after_step(vars(before), step)))  # type: ignore[arg-type]
        return tuple(stages)

    def _area(self, boundary: str) -> float:
        """The area of a boundary, of the whole ring of a body of revolution."""
        rule = boundary_rule(self.mesh, boundary)
        return float((rule.weights * self.kinematics.measure(self.mesh.points[rule.facets].mean(axis=1))).sum())

    def _in_step(self, t: float) -> ContactProblem:
        """The problem at a time, within a step or at its end."""
        number = int(np.clip(np.ceil(t), 1, len(self.steps)))
        before, after = self._stages[number - 1], self._stages[number]
        share = float(np.clip(t - (number - 1), 0.0, 1.0)) if self.steps[number - 1].ramp else 1.0
        bound, moved = copy.copy(after), {name for step in self.steps for name in step.supports}
        changed: dict[str, object] = {"body_force": between_values(before.body_force, after.body_force, share)}
        for name in INITIAL:
            changed[name] = between_fields(getattr(before, name), getattr(after, name), share, name)
        for name in ("supports", "tractions"):
            parts = between_conditions(getattr(before, name), getattr(after, name), share, name, moved)
            changed[name] = MappingProxyType(parts)
        changed["contact"] = MappingProxyType(between_bolts(before.contact, after.contact, share))
        for name, value in changed.items():
            object.__setattr__(bound, name, value)
        return bound

    # ---- what is checked ------------------------------------------------------------------------------------

    def _check_steps(self) -> None:
        """Refuse load steps that do not follow one another, or of what has no steps."""
        given: Sequence[object] = expect(self.steps, Sequence, "steps", "give a list of Step(...)")
        steps = tuple(expect(step, Step, "a step", "give Step('clamp', tractions={...})") for step in given)
        object.__setattr__(self, "steps", steps)
        if not steps:
            return
        if self.kind:
            raise ProblemError("steps are for bodies, and this has one component; state it in time, by formulas of t")
        if len(steps) == 1:
            raise ProblemError("a single step is a static problem; state its loads without steps, or give two")
        names = [step.name for step in steps]
        if len(set(names)) < len(names):
            twice = next(name for name in names if names.count(name) > 1)
            raise ProblemError(f"two steps are called '{twice}'; give each a name of its own")
        for step in steps:
            if new := next((name for name in step.supports if name not in self.supports), None):
                raise ProblemError(
                    f"step '{step.name}' supports '{new}', which the problem does not; state the support there, and "
                    "its values in steps"
                )
        stated = zip(steps, self._stages[1:], strict=True)
        object.__setattr__(self, "steps", tuple(kept_step(step, vars(stage)) for step, stage in stated))
        if any(stage.time_dependent for stage in self._stages):
            raise ProblemError("something depends on t beside the steps; leave t out, or state all of it in time")
        for before, step in enumerate(steps):
            with error_context(f"step '{step.name}'"):
                self._in_step(before + 0.5)

    def _check_frame(self) -> None:
        """Refuse what is no mesh, no order, no units or no material."""
        expect(self.units, Units, "units", UNITS_REMEDY)
        expect(self.title, str, "title", "give a text")
        if not isinstance(self.mesh, Mesh):
            raise ProblemError(f"mesh is {described(self.mesh)}; pass a hemivar Mesh, from read_mesh or rectangle")
        if self.order is None:
            object.__setattr__(self, "order", self.mesh.suggested_order)
        check_order(self.order)
        if not isinstance(self.material, Material) or type(self.material) is Material:
            raise ProblemError(
                f"material is {described(self.material)}; pass Material.lame(...), Material.young(...) or the like"
            )
        if self.kind not in (None, ScalarKind.HEAT) and self.mesh.dim == 3:
            raise ProblemError(f"kind = '{self.kind}' needs a plane mesh, and this one is 3D; use a rectangle")
        self.material.check_on(self.mesh.dim, list(self.mesh.regions))
        if self.kinematics.ring:
            self._check_half_section()
        rule = one_of(self.quadrature, "quadrature", Quadrature, "Quadrature.NODAL or MIDPOINT")
        object.__setattr__(self, "quadrature", rule)
        object.__setattr__(self, "geometry", one_of(self.geometry, "geometry", Geometry))
        if self.trace_constant is not None:
            constant = number(self.trace_constant, "trace_constant")
            if not 0.0 < constant < np.inf:
                raise ProblemError(f"trace_constant is {constant:g}; give a finite number above 0, or None")
        self._check_stiffening()

    def _check_stiffening(self) -> None:
        """Refuse stress stiffening of what is no linear body in the plane or in space."""
        if not expect(self.stiffening, bool, "stiffening", "give True or False"):
            return
        if what := beyond_stiffening(self):
            raise ProblemError(f"stiffening is for linear bodies in 2D and in 3D, not for {what}; leave it out")

    def _check_half_section(self) -> None:
        """Refuse what is no half of a section of a body of revolution."""
        if self.mesh.dim == 3:
            raise ProblemError("plane = 'axisymmetric' is for plane meshes, and this one is 3D; leave it out")
        radius = self.mesh.points[:, 0]
        if radius.min() < -SAME * radius.max():
            raise ProblemError(
                f"plane = 'axisymmetric', but the mesh reaches x = {radius.min():.6g}; x is the radius: mesh the half "
                "of the section with x >= 0"
            )
        if Quadrature(self.quadrature) is not Quadrature.NODAL:
            raise ProblemError("plane = 'axisymmetric' has contact at the nodes; take Quadrature.NODAL")

    def _check_contacts(self) -> None:
        """Refuse contact that is none, or that the mesh, the order or the field does not take."""
        self._check_mapping("contact")
        for name, contact in self.contact.items():
            self._check_contact(name, contact)
        if self.areas and self.kinematics.ring:
            raise ProblemError("plane = 'axisymmetric' has no contact over an area; leave it out")
        if self.order == 2 and self.areas:
            raise ProblemError(
                "contact over an area is not available with elements of order 2, whose corner weights vanish; use "
                "order = 1"
            )
        midpoint = self.quadrature is Quadrature.MIDPOINT
        if self.kind and midpoint:
            raise ProblemError("a scalar problem has its laws at the nodes; take Quadrature.NODAL")
        if self.areas and midpoint:
            raise ProblemError("contact over an area acts at the nodes; take Quadrature.NODAL")
        if self.contact and midpoint and self.mesh.dim == 3:
            raise ProblemError(
                "quadrature at midpoints is for plane bodies: in 3D a contact boundary has about twice as many facets "
                "as nodes, more pressures than displacements can tell apart; take Quadrature.NODAL"
            )

    def _put_ties_aside(self) -> None:
        """Keep ties apart from what touches."""
        self._check_mapping("ties")
        ties = {name: one for name, one in self.contact.items() if one.ties} | dict(self.ties)
        rest = {name: one for name, one in self.contact.items() if not one.ties}
        for name, one in ties.items():
            self._check_contact(name, one)
            if not one.ties or self.kind:
                what = "bodies" if self.kind else f"Contact(Tie(), against=...), not {described(one)},"
                raise ProblemError(f"ties['{name}']: a tie is of {what}; leave it out")
        object.__setattr__(self, "contact", MappingProxyType(rest))
        object.__setattr__(self, "ties", MappingProxyType(ties))

    @property
    def tied(self) -> ContactProblem:
        """The same statement with its ties as contacts, and no others."""
        problem = copy.copy(self)
        for name, value in (("contact", self.ties), ("ties", MappingProxyType({}))):
            object.__setattr__(problem, name, value)
        for known in ("areas", "time_dependent", "_pairs"):
            problem.__dict__.pop(known, None)
        return problem

    def _check_contact(self, name: str, contact: object) -> None:
        on_boundary = name in self.mesh.boundaries
        in_region = name == AREA or name in self.mesh.regions
        if on_boundary and not self.kind:
            in_region = False  # files of meshes name both alike, and bodies mostly touch along boundaries
        if not in_region and not on_boundary:
            self._refuse_inside("contact", name)
            near = suggest(str(name), [*self.mesh.boundaries, *self.mesh.regions], "boundaries and regions")
            raise ProblemError(f"contact names boundary '{name}', which the mesh does not have{near}")
        if in_region and on_boundary:
            raise ProblemError(f"contact names '{name}', a boundary and a region; rename one of them in the mesh")
        if not isinstance(contact, Contact):
            wrap = "ScalarContact(Signorini(), level=0.1)" if self.kind else "Contact(law, friction)"
            raise ProblemError(f"contact['{name}'] is {described(contact)}; wrap the law: {wrap}")
        if self.kind:
            with error_context(f"contact '{name}'"):
                contact.refuse_directions()
        elif contact.side is not Side.ABOVE:
            raise ProblemError(f"contact['{name}'] has a side, which is for one component; leave it out")
        elif in_region:
            if contact.against:
                own = ", ".join(side for side in self.mesh.boundaries if side.startswith(f"{name}:"))
                raise ProblemError(
                    f"contact '{name}': it is an area with against = '{contact.against}', and bodies touch along "
                    f"boundaries; {f'give one of {own}' if own else 'leave against out'}"
                )
            with error_context(f"contact '{name}'"):
                contact.refuse_normals(self.mesh.dim)
        if contact.against:
            self._check_pair(name, contact, contact.against)
        dim = self.mesh.dim
        if contact.obstacle is not None and contact.obstacle.dim not in (None, dim):
            raise ProblemError(
                f"the obstacle of contact['{name}'] has {contact.obstacle.dim} coordinates, the mesh has {dim}; "
                f"give its vectors {dim} components"
            )

    def _check_values(self) -> None:
        """Refuse supports and loads that do not fit the field, and keep them as plain data."""
        loads = self.load_names
        supports = {name: self._support(f"supports['{name}']", one) for name, one in self.supports.items()}
        tractions = {
            name: one if isinstance(one, Pressure) and not self.kind else self._plain(f"{loads[1]}['{name}']", one)
            for name, one in self.tractions.items()
        }
        for name, value in {
            "supports": MappingProxyType(supports),
            "tractions": MappingProxyType(tractions),
            "body_force": self._plain(loads[0], self.body_force),
            "bedding": checked_quantity(self.bedding, "bedding"),
        }.items():
            object.__setattr__(self, name, value)
        expect(self.initial_scaled, bool, "initial_scaled", "give True or False")
        for name in INITIAL:
            object.__setattr__(self, name, checked_field(getattr(self, name), name, self.mesh, self.kinematics.ring))
        if self.initially_stressed and (self.kind or self.stiffening):
            what = "one component" if self.kind else "stiffening"
            raise ProblemError(f"initial stress and strain are for bodies, not with {what}; leave one of the two out")
        if not is_zero(self.initial_strain) and not self.material.linear:
            raise ProblemError("initial_strain is for linear materials; give the initial_stress that it makes")

    @property
    def initially_stressed(self) -> bool:
        """Whether the body has a stress, or a strain without stress, before anything moves."""
        return not all(is_zero(getattr(self, name)) for name in INITIAL)

    def _plain(self, name: str, value: object) -> VectorData | ScalarData:
        """A load as plain data of as many components as the field has."""
        return plain_data(value, name, self.components, LARGEST if self.kind else np.inf)

    def _support(self, name: str, given: object) -> Support | ScalarData:
        if self.kind:
            return plain_data(given, name, 1, LARGEST)
        support = SUPPORTS.get(given, given) if isinstance(given, str) else given
        if not isinstance(support, Support):
            near = suggest(support, list(SUPPORTS), "words") if isinstance(support, str) else ""
            raise ProblemError(
                f"{name} is {described(support)}{near}; pass Clamped(), Roller(), Fixed(...), Prescribed(...) or "
                "Spring(...)"
            )
        if isinstance(support, Prescribed):
            support.refuse_shape(name, self.mesh.dim)
        if isinstance(support, RigidPlate):
            support.refuse_shape(name, self.mesh.dim, self.kinematics.ring)
        if isinstance(support, Spring) and support.direction is not None and len(support.direction) != self.mesh.dim:
            raise ProblemError(
                f"{name} has a direction of {len(support.direction)} numbers; on this mesh it needs {self.mesh.dim}"
            )
        if isinstance(support, Fixed) and self.mesh.dim == 2 and support.z is not None:
            raise ProblemError(f"{name} fixes z, but the mesh is plane; remove z")
        return support

    def _check_boundaries(self, name: str) -> None:
        """Refuse a field that does not map boundaries of the mesh to conditions; supports may name nodes, too."""
        self._check_mapping(name)
        for boundary, one in getattr(self, name).items():
            if getattr(one, "at", None) is not None and name == "supports":
                self._check_points(boundary, np.array(one.at))
            elif name == "tractions" or boundary not in self.mesh.node_sets or isinstance(one, Roller | RigidPlate):
                self._check_name(name, boundary, "boundary", "boundaries")

    def _check_points(self, name: str, at: Array) -> None:
        if at.shape[1] != self.mesh.dim:
            raise ProblemError(
                f"supports['{name}'] is at points of {at.shape[1]} coordinates, the mesh has {self.mesh.dim}"
            )
        if name in self.mesh.boundaries:
            raise ProblemError(
                f"supports['{name}'] is at points, and '{name}' is a boundary; give the points another name"
            )

    def _check_mapping(self, name: str) -> None:
        given = getattr(self, name)
        if not isinstance(given, Mapping):
            raise ProblemError(
                f"{name} must map boundary names to conditions, {{'left': ...}}; it is {described(given)}"
            )
        object.__setattr__(self, name, MappingProxyType(dict(given)))

    def _refuse_inside(self, what: str, name: object) -> None:
        if name in self.mesh.interfaces:
            raise ProblemError(
                f"{what} names '{name}', which lies inside the body; take mesh.opened('{name}') and one of its sides"
            )

    def _check_name(self, what: str, name: object, one: str, many: str) -> None:
        """Refuse the name of a boundary or region that the mesh does not have."""
        known = list(getattr(self.mesh, many))
        if many == "boundaries":
            self._refuse_inside(what, name)
        if name not in known:
            own = [side for side in known if side.startswith(f"{name}:")] if many == "boundaries" else []
            if own:
                raise ProblemError(f"{what} names '{name}', which is not a boundary; give one of {', '.join(own)}")
            near = suggest(str(name), known, many)
            raise ProblemError(f"{what} names {one} '{name}', which the mesh does not have{near}")

    def _check_pair(self, name: str, contact: Contact, other: str) -> None:
        """Refuse a pair whose boundaries are not two, or that the field or the quadrature does not take."""
        where = f"contact '{name}' against '{other}'"
        if self.kind and not self.thermal:
            raise ProblemError(f"{where}: of scalar problems heat alone crosses from body to body; leave against out")
        if self.kind and (contact.side is not Side.ABOVE or callable(contact.gap) or contact.gap):
            raise ProblemError(f"{where}: the law is one of the difference of temperatures; leave level and side out")
        self._check_name(f"{where}:", other, "boundary", "boundaries")
        if other in self.contact and self.contact[other].against == name != other:
            raise ProblemError(
                f"{where}: contact '{other}' states the same two boundaries; state them once, under either name"
            )
        if contact.slave not in (None, name, other):
            raise ProblemError(f"{where}: slave = '{contact.slave}'; give '{name}' or '{other}'")
        count = self.mesh.number_of_nodes
        one, two = (facet_keys(self.mesh.boundaries[side], count) for side in (name, other))
        if np.isin(one, two).any():
            raise ProblemError(
                f"{where}: the two share facets, and self-contact is not available; name two separate boundaries"
            )
        if self.quadrature is not Quadrature.NODAL:
            raise ProblemError(f"{where}: quadrature at midpoints is for foundations; take Quadrature.NODAL")

    def pair(self, name: str) -> tuple[str, str]:
        """The boundary with the contact points, and the one that it touches, of a contact with another body.

        The boundary of a body that is several times softer has the contact points: jumps of a stiff body against a soft
        one are stiff, and multigrid takes many cycles where the two part.  Else the finer one has them, else the one of
        which supports hold fewer nodes, else the one that the contact is named after.
        """
        contact = self.contact.get(name) if isinstance(name, str) else None
        if contact is None or contact.against is None:
            raise ProblemError(f"there is no contact of two bodies {quoted(name)}; name one with against=")
        return self._pairs[name]

    @cached_property
    def _pairs(self) -> dict[str, tuple[str, str]]:
        """:meth:`pair` of every contact of two bodies."""
        return {name: self._paired(name, one.against) for name, one in self.contact.items() if one.against is not None}

    def _paired(self, name: str, other: str) -> tuple[str, str]:
        slave = self.contact[name].slave
        if slave:
            return (name, other) if slave == name else (other, name)
        fixed = np.zeros(self.mesh.number_of_nodes, dtype=bool)
        for support in self.held_boundaries:
            fixed[self.mesh.boundaries[support]] = True
        size, share, stiff = {}, {}, {}
        for side in (name, other):
            facets, stiff[side] = self.mesh.boundaries[side], self.stiffness_at(side)
            size[side] = float(boundary_rule(self.mesh, side).weights.mean())
            share[side] = float(fixed[np.unique(facets)].mean())
        if max(share.values()) == 1.0 > min(share.values()):
            first = min(share, key=lambda side: share[side])
        elif max(stiff.values()) > _MUCH_STIFFER * min(stiff.values()):
            first = min(stiff, key=lambda side: stiff[side])
        elif abs(size[name] - size[other]) > 0.01 * size[name]:
            first = min(size, key=lambda side: size[side])
        else:
            first = name if share[name] <= share[other] else other
        return (name, other) if first == name else (other, name)

    def stiffness_at(self, boundary: str) -> float:
        """Mean size of the elasticity in the cells along a boundary, nearly Young's modulus."""
        mesh = self.mesh
        if not isinstance(boundary, str) or boundary not in mesh.boundaries:
            raise ProblemError(f"boundary is {described(boundary)}; give one of {', '.join(mesh.boundaries)}")
        on = np.zeros(mesh.number_of_nodes, dtype=bool)
        on[mesh.boundaries[boundary]] = True
        cells = np.flatnonzero(np.count_nonzero(on[mesh.cells], axis=1) >= mesh.dim)
        masks = {name: np.isin(cells, members) for name, members in mesh.regions.items()}
        tensors = self.material.stiffness_tensor(mesh.points[mesh.cells[cells]].mean(axis=1), masks)
        return float(np.einsum("kvv->kv", tensors).mean())

    def _check_overlaps(self) -> None:
        """Refuse facets of two foundations, and of one where a support holds everything."""
        on_boundaries = [name for name in self.contact if name not in self.areas]
        plates = {name: one for name, one in self.supports.items() if isinstance(one, RigidPlate)}
        holding = {**self.held_boundaries, **plates}
        used = [*{*on_boundaries, *self.ties, *holding}]
        facets = [self.mesh.boundaries[name] for name in used]
        nodes = np.unique(np.concatenate([np.zeros(0, dtype=np.int64), *(part.ravel() for part in facets)]))
        keys = {
            name: facet_keys(np.searchsorted(nodes, part), len(nodes)) for name, part in zip(used, facets, strict=True)
        }
        names = [*on_boundaries, *self.ties]
        for i, first in enumerate(names):
            for second in names[i + 1 :]:
                shared = int(np.isin(keys[first], keys[second]).sum())
                if shared:
                    raise ProblemError(
                        f"contact boundaries '{first}' and '{second}' share {shared} facets; a facet can "
                        f"touch one foundation only: separate them"
                    )
            for other, support in holding.items():
                shared = int(np.isin(keys[first], keys[other]).sum())
                if shared and not isinstance(support, Roller | Fixed):
                    how = "clamped" if isinstance(support, Clamped) else f"constrained by a prescribed {self.unknown}"
                    how = "a rigid plate" if other in plates else how
                    raise ProblemError(
                        f"contact boundary '{first}' is {how} (support '{other}', {shared} common facets), so no "
                        "contact can happen there; remove one of the two"
                    )


def expect_body(problem: object, what: str, remedy: str) -> ContactProblem:
    """The problem, if it is one of an elastic body."""
    body = expect(problem, ContactProblem, what, remedy)
    if body.kind:
        raise ProblemError(f"{what} is a ScalarProblem; {remedy}")
    return body


def beyond_stiffening(problem: ContactProblem) -> str:
    """What of a problem stress stiffening is not for, in words; empty where there is none."""
    if problem.kind:
        return "one component"
    if problem.kinematics.ring:
        return "a body of revolution"
    return "" if problem.material.linear else "a material that is not linear"


def refuse_areas(problem: ContactProblem, what: str) -> None:
    """Refuse contact over an area where there is contact on boundaries only."""
    for name in problem.areas:
        raise ProblemError(
            f"'{name}' is over an area, and {what} is for contact on boundaries; leave one of the two out"
        )
