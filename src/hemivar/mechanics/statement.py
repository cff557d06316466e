"""The statement of a contact problem: what a user writes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from enum import StrEnum
from types import MappingProxyType
from typing import ClassVar, get_args

from hemivar.basics.arguments import described, suggest
from hemivar.basics.first_use import cached_property
from hemivar.basics.known_keywords import known_fields
from hemivar.basics.portable import PickleMixin
from hemivar.basics.stated import Form, stated
from hemivar.basics.units import Units
from hemivar.errors import ProblemError
from hemivar.laws import (
    ContactLaw,
    Friction,
    NoFriction,
    OrthotropicFriction,
    OrthotropicLaw,
    Superpotential,
    VectorLaw,
)
from hemivar.laws.memory import Memory, Secant
from hemivar.mechanics.conditions import (
    LARGEST,
    SUPPORTS,
    Fixed,
    Prescribed,
    Pressure,
    ScalarData,
    Support,
    Traction,
    VectorData,
    check_finite,
    plain_data,
)
from hemivar.mechanics.instants import at_time, depends_on_time, law_at_time, law_depends_on_time
from hemivar.mechanics.material import Material
from hemivar.mechanics.obstacles import Normals, Obstacle, SignedDistance
from hemivar.mechanics.per_volume import checked_quantity
from hemivar.mechanics.statement_base import ORDER, Statement
from hemivar.mesh.mesh import Mesh

__all__ = ["Contact", "ContactProblem", "Quadrature"]


class Quadrature(StrEnum):
    """Where the contact law is evaluated."""

    NODAL = "nodal"
    """At the nodes of the contact boundary (lumped): the nonsmooth part is separable."""
    MIDPOINT = "midpoint"
    """On the contact facets of plane bodies, at the mean displacement of each (the midpoint for order 1): constant
    multipliers."""


@known_fields
@dataclass(frozen=True, eq=False)
class Contact(PickleMixin):
    """What the foundation does along one contact boundary.

    Attributes
    ----------
    normal : Superpotential
        Law of the penetration ``r_nu = u_nu - gap``.
    friction : Friction
        Law of the slip ``u_tau``; none by default.
    gap : float or callable
        Distance between body and foundation along the outward normal; a callable gets points, shape (k, d),
        and returns shape (k,). Negative values mean initial interpenetration. It may depend on time, ``gap(x, t)``,
        and so may the parameters of both laws.
    obstacle : Obstacle or None
        A rigid surface in place of the gap: :class:`Plane`, :class:`Sphere`, :class:`Cylinder` or
        :class:`SignedDistance`. Gaps are those of the undeformed body; where it overlaps the obstacle they are negative
        (an interference fit, or an indentation stated by the place of the obstacle). One that lies inside the body is
        refused by :func:`discretize`.
    normals : Normals or None
        Contact normals of the obstacle (``"obstacle"``, the default with an obstacle) or of the body (``"body"``, the
        default, and all there is, without one).
    belt : vector, shape (d,), or callable
        Displacement of the foundation along its surface, from which the slip is counted; its part along the normal does
        not count. A belt that runs with the velocity v is ``lambda x, t: v * t``; it may vary over the boundary, as on
        a turning disc.
    damping : Superpotential or None
        Law of the rate of the penetration, ``r_nu'``, whose pressure adds to that of the normal law; what does not
        depend on time refuses it.
    memory : tuple of Memory or None
        What the contact points remember, one after the other: wear, a bond, the largest opening so far (see
        ``hemivar.laws.memory``); what does not depend on time refuses it.  Glue remembers its largest opening by
        default (``Secant()``), and ``memory=()`` keeps it elastic; any other law remembers nothing.

    Raises
    ------
    ProblemError
        If gap and obstacle are both given, or normals of an obstacle that is not; if damping is no law, or memory no
        memory.
    """

    normal: Superpotential | VectorLaw
    friction: Friction = field(default_factory=NoFriction)
    gap: ScalarData = field(
        default=0.0,
        metadata=stated(
            Form.QUANTITY,
            "distance between body and foundation along the outward normal *(f, t)*; negative: they overlap at the "
            "start",
            timed=True,
        ),
    )
    obstacle: Obstacle | None = None
    normals: Normals | None = None
    damping: Superpotential | None = None
    memory: tuple[Memory, ...] | None = None
    belt: VectorData | float = field(
        default=0.0,
        metadata=stated(
            Form.VECTOR,
            "displacement of the foundation along its surface, a list of numbers or formulas *(f, t)*: slip is counted "
            'from it. A belt that runs at 2 along x: `["2*t", 0]`',
            timed=True,
            left_out="at rest",
        ),
    )

    def __post_init__(self) -> None:
        _ = self.law
        self._check_evolving()
        object.__setattr__(self, "gap", plain_data(self.gap, "gap", vector=False, most=LARGEST))
        belt = plain_data(self.belt, "belt", most=LARGEST)
        if isinstance(belt, float) and belt != 0.0:
            raise ProblemError(f"belt = {belt:g} has no direction; give a vector, such as belt=({belt:g}, 0.0)")
        object.__setattr__(self, "belt", belt)
        self._check_obstacle()

    def _check_evolving(self) -> None:
        if self.damping is not None:
            if not isinstance(self.damping, Superpotential):
                raise ProblemError(
                    f"damping is {described(self.damping)}; give a law of the rate of the penetration, such as "
                    "Compliance(2.0)"
                )
            _ = ContactLaw(self.damping)
        if self.memory is None:
            return
        memory = self.memory if isinstance(self.memory, Sequence) else (self.memory,)
        for one in memory:
            if not isinstance(one, Memory):
                raise ProblemError(
                    f"memory holds {described(one)}; give what contact points may remember, a list of Secant(), "
                    "Wear(...) and the like"
                )
            for part in fields(one):  # type: ignore[arg-type]
                if law_depends_on_time(getattr(one, part.name)) or depends_on_time(getattr(one, part.name)):
                    raise ProblemError(
                        f"{part.name} of memory '{one.name}' depends on time, which it cannot; of a foundation that "
                        "changes with time state the law, the damping or the gap so"
                    )
        object.__setattr__(self, "memory", tuple(memory))

    def _check_obstacle(self) -> None:
        if self.obstacle is None:
            if self.normals not in (None, Normals.BODY):
                raise ProblemError(f"normals = {self.normals!r} needs an obstacle; give one or leave normals out")
            object.__setattr__(self, "normals", Normals.BODY)
            return
        if not isinstance(self.obstacle, Obstacle):
            raise ProblemError(
                f"obstacle is {described(self.obstacle)}; pass Plane(...), Sphere(...), Cylinder(...) or "
                f"SignedDistance(...)"
            )
        if callable(self.gap) or self.gap != 0.0:
            raise ProblemError("gap and obstacle are both given; the gap follows from the obstacle: leave one out")
        if isinstance(self.obstacle, SignedDistance) and depends_on_time(self.obstacle.function):
            raise ProblemError(
                "the signed distance of an obstacle depends on time, which it cannot; for a foundation that moves "
                "state a gap that depends on t"
            )
        try:
            object.__setattr__(self, "normals", Normals(self.normals or Normals.OBSTACLE))
        except ValueError:
            raise ProblemError(f"normals = {self.normals!r}; choose Normals.OBSTACLE or Normals.BODY") from None

    @property
    def law(self) -> VectorLaw:
        """Normal and friction law together; a law that couples opening and slip stands for both."""
        if not isinstance(self.normal, VectorLaw):
            if isinstance(self.friction, OrthotropicFriction):
                return OrthotropicLaw(self.normal, self.friction)
            return ContactLaw(self.normal, self.friction)
        if isinstance(self.normal, ContactLaw):
            raise ProblemError("a contact is given a ContactLaw; give its parts, Contact(normal, friction)")
        if self.friction.acts:
            damaged = ", or in time let its damaged share rub, memory=(Secant(friction=0.5),)"
            raise ProblemError(
                f"law '{self.normal.name}' couples opening and slip, and is the law of both components; leave "
                f"the friction '{self.friction.name}' out{damaged if self.normal.remembers else ''}"
            )
        return self.normal

    @cached_property
    def remembers(self) -> tuple[Memory, ...]:
        """What the contact points remember in time: what is stated, and of glue by default its largest opening."""
        if self.memory is None:
            return (Secant(),) if self.law.remembers else ()
        return self.memory

    @property
    def time_dependent(self) -> frozenset[str]:
        """What depends on time: "gap" (of which the way of a belt is a part), "law", or both."""
        laws = any(law_depends_on_time(law) for law in (self.normal, self.friction, self.damping))
        moves = depends_on_time(self.gap) or depends_on_time(self.belt)
        return frozenset((["gap"] if moves else []) + (["law"] if laws else []))

    def at_time(self, t: float) -> Contact:
        """The contact at a time; itself if it does not depend on time."""
        if not self.time_dependent:
            return self
        return replace(
            self,
            normal=law_at_time(self.normal, t),
            friction=law_at_time(self.friction, t),
            gap=at_time(self.gap, t),
            damping=law_at_time(self.damping, t),
            belt=at_time(self.belt, t),
        )


@known_fields
@dataclass(frozen=True, eq=False)
class ContactProblem(Statement):
    """An elastic body, its supports and loads, and the foundations it may touch.

    Loads, prescribed displacements, gaps and the parameters of laws may depend on time: as functions of place and time,
    ``f(x, t)``, or as formulas with t. :meth:`at_time` gives the problem at one time, which is what
    :func:`discretize` takes.

    Attributes
    ----------
    mesh : Mesh
    material : Material
    contact : mapping of boundary name to Contact
    supports : mapping of boundary name to Support
        :class:`Clamped`, :class:`Roller`, :class:`Fixed` or :class:`Prescribed`; ``"clamped"`` and ``"roller"`` are
        turned into the first two.
    body_force : vector, shape (d,), or callable
        Force per volume; a callable gets points, shape (k, d), and returns shape (k, d).
    tractions : mapping of boundary name to vector, callable or Pressure
        Force per area.
    title : str
    order : int
        Polynomial degree of the elements, 1 or 2.
    quadrature : Quadrature
        Where the contact laws are evaluated.
    bedding : float or callable
        An elastic bedding of the whole body, a force ``-bedding u`` per volume (Winkler), not negative; a callable gets
        points, shape (k, d), and returns shape (k,).
    units : Units
        For labels; no number is converted.

    Raises
    ------
    ProblemError
        If a boundary name is unknown, numbers are not finite, or boundaries overlap in a way that makes no
        sense.
    """

    load_names: ClassVar[tuple[str, str]] = "body_force", "tractions"

    mesh: Mesh
    material: Material
    contact: Mapping[str, Contact] = field(default_factory=dict)
    supports: Mapping[str, Support] = field(default_factory=dict)
    body_force: VectorData | float = field(
        default=0.0,
        metadata=stated(
            Form.VECTOR, "force per volume, one number for each direction *(f, t)*",
            key="body", timed=True, table="loads",
        ),
    )  # fmt: skip
    tractions: Mapping[str, Traction] = field(
        default_factory=dict,
        metadata=stated(
            Form.VECTOR, "force per area of boundary, by name: `traction = { top = [0.0, -2.0] }` *(f, t)*",
            key="traction", timed=True, by="boundary", table="loads",
        ),
    )  # fmt: skip
    title: str = ""
    order: int = field(default=1, metadata=ORDER)
    quadrature: Quadrature = field(
        default=Quadrature.NODAL,
        metadata=stated(
            Form.TEXT,
            'where the contact laws act: `"nodal"` at the nodes of the contact boundary, `"midpoint"` at the midpoints '
            "of its facets (piecewise constant pressure; plane meshes only; a contact boundary held at both ends has "
            "more midpoints than free nodes and is refused)",
            choices=tuple(Quadrature), table="mesh",
        ),
    )  # fmt: skip
    bedding: ScalarData = field(
        default=0.0,
        metadata=stated(
            Form.QUANTITY,
            "stiffness per volume of springs all over the body, a force `-bedding u` per volume (Winkler), >= 0 *(f)*; "
            "such a body needs no support, and a warning says what digits a soft one costs",
            least=0.0, table="loads",
        ),
    )  # fmt: skip
    units: Units = field(default_factory=Units)

    def __post_init__(self) -> None:
        self._check_frame()
        if not isinstance(self.material, Material) or type(self.material) is Material:
            raise ProblemError(
                f"material is {described(self.material)}; pass Material.lame(...), Material.young(...) or the like"
            )
        try:
            object.__setattr__(self, "quadrature", Quadrature(self.quadrature))
        except ValueError as error:
            raise ProblemError(f"quadrature = {self.quadrature!r}; choose Quadrature.NODAL or MIDPOINT") from error
        for name in ("contact", "supports", "tractions"):
            self._check_boundaries(name)
        if self.contact and self.order == 2 and self.mesh.dim == 3:
            raise ProblemError(
                "contact with elements of order 2 in 3D is not available (corner weights vanish); take order=1"
            )
        if self.contact and self.quadrature is Quadrature.MIDPOINT and self.mesh.dim == 3:
            raise ProblemError(
                "quadrature at midpoints is for plane bodies: in 3D a contact boundary has about twice as many facets "
                "as nodes, more pressures than displacements can tell apart; take Quadrature.NODAL"
            )
        stated = {name: SUPPORTS.get(one, one) if isinstance(one, str) else one for name, one in self.supports.items()}
        object.__setattr__(self, "supports", MappingProxyType(stated))
        self._check_values()
        object.__setattr__(self, "body_force", plain_data(self.body_force, "body_force"))
        object.__setattr__(self, "bedding", checked_quantity(self.bedding, "bedding"))
        forces = {
            name: value if isinstance(value, Pressure) else plain_data(value, f"tractions['{name}']")
            for name, value in self.tractions.items()
        }
        object.__setattr__(self, "tractions", MappingProxyType(forces))
        self._check_overlaps()

    def __repr__(self) -> str:
        parts = [repr(self.title)] if self.title else []
        parts += [repr(self.mesh), type(self.material).__name__.lstrip("_").lower() + " material"]
        parts += [f"contact on {name}: {contact.law.name}" for name, contact in self.contact.items()]
        parts += [f"{type(support).__name__} on {name}" for name, support in self.supports.items()]
        return f"ContactProblem({', '.join(parts)})"

    def _check_values(self) -> None:
        dim = self.mesh.dim
        _check_vector(self.body_force, dim, "body_force", allow_zero=True)
        for name, contact in self.contact.items():
            if not isinstance(contact, Contact):
                raise ProblemError(f"contact['{name}'] is {described(contact)}; wrap the law: Contact(law, friction)")
            if contact.obstacle is not None and contact.obstacle.dim not in (None, dim):
                raise ProblemError(
                    f"the obstacle of contact['{name}'] has {contact.obstacle.dim} coordinates, the mesh has {dim}; "
                    f"give its vectors {dim} components"
                )
        for name, support in self.supports.items():
            if not isinstance(support, get_args(Support)):
                near = suggest(support, list(SUPPORTS), "words") if isinstance(support, str) else ""
                raise ProblemError(
                    f"supports['{name}'] is {described(support)}{near}; "
                    "pass Clamped(), Roller(), Fixed(...) or Prescribed(...)"
                )
            if isinstance(support, Prescribed):
                _check_vector(support.value, dim, f"supports['{name}']")
            if isinstance(support, Fixed) and dim == 2 and support.z is not None:
                raise ProblemError(f"supports['{name}'] fixes z, but the mesh is plane; remove z")
        for name, traction in self.tractions.items():
            if not isinstance(traction, Pressure):
                _check_vector(traction, dim, f"tractions['{name}']", allow_zero=True)


def _check_vector(value: object, dim: int, name: str, allow_zero: bool = False) -> None:
    if callable(value):
        return
    array = check_finite(value, name)
    if allow_zero and array.ndim == 0 and array == 0.0:
        return
    if array.shape != (dim,):
        raise ProblemError(f"{name} has shape {array.shape}; on this mesh it needs {dim} components")
