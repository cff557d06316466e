"""Contact conditions: the laws of a foundation or another body, where it stands, and memory of contact points."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, fields, replace
from enum import StrEnum

import numpy as np

from hemivar.basics.arguments import described, name_of, one_of, quoted
from hemivar.basics.arrays import LARGEST
from hemivar.basics.first_use import cached_property
from hemivar.basics.known_keywords import known_fields
from hemivar.basics.portable import PickleMixin
from hemivar.basics.stated import CheckedFields, Form, kept, stated, stated_of_one
from hemivar.errors import ProblemError
from hemivar.laws import (
    ContactLaw,
    Friction,
    NoContact,
    NoFriction,
    OrthotropicFriction,
    OrthotropicLaw,
    Superpotential,
    Tie,
    VectorLaw,
)
from hemivar.laws.friction.bounds import StateBound
from hemivar.laws.memory import Bonding, Memory, PenetrationMemory, Secant, ViscousFoundation
from hemivar.laws.memory.shortening import Shortening
from hemivar.laws.normal.bolts import Bolt
from hemivar.mechanics.conditions import ScalarData, VectorData, plain_data
from hemivar.mechanics.instants import at_time, depends_on_time, law_at_time, law_depends_on_time
from hemivar.mechanics.obstacles import Normals, Obstacle, SignedDistance

__all__ = ["Contact", "Side"]


_NAMED = kept(name_of, "give the name of a boundary")
#: Memories of the penetration alone.
_OF_PENETRATION = (Bonding, PenetrationMemory, Secant, ViscousFoundation)


class Side(StrEnum):
    """Where a foundation lies, seen from the membrane."""

    ABOVE = "above"
    """It is met by growing u: ``r = u - level``."""
    BELOW = "below"
    """It is met by falling u: ``r = level - u``."""


@known_fields
@dataclass(frozen=True, eq=False)
class Contact(CheckedFields, PickleMixin):
    """What the foundation does along one contact boundary, or over one region of a body.

    Of one component, as of a membrane, a law acts on the penetration ``u - gap``, or ``gap - u`` where the foundation
    lies below, and friction on the slip ``u - gap``; one of the two acts.  There is no obstacle and no belt.

    Over an area of a plane body there is no penetration: ``Contact(NoContact(), friction)``, or a law that couples
    opening and slip, acts on the displacement less that of the belt.

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
    against : str or None
        The boundary of another body, or of another side of an interface that was opened, which this one touches; there
        is no foundation then.  The gap is the distance along the normal, to which ``gap`` is added; where the two
        overlap it is negative (an interference fit).
    slave : str or None
        Which of the two boundaries has the contact points: by default that of a body that is four times softer, else
        the finer one, else the one with fewer supports.
    side : Side
        Of one component: where the foundation lies, ``"above"`` (default) or ``"below"``.

    Raises
    ------
    ProblemError
        If gap and obstacle are both given, or normals of an obstacle that is not; if damping is no law, or memory no
        memory.

    Examples
    --------
    >>> import hemivar as hv
    >>> floor = hv.Contact(hv.Signorini(), hv.Coulomb(0.3), gap=0.01)
    >>> ball = hv.Contact(hv.Signorini(), obstacle=hv.mechanics.Sphere((0.0, -5.0), 5.0))
    >>> pair = hv.Contact(hv.Signorini(), against="lower:top")
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
        )
        | stated_of_one(Form.QUANTITY, "where the foundation stands *(f, t)*", key="level", timed=True)
        | kept(plain_data, 1, LARGEST),
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
        )
        | kept(plain_data, None, LARGEST),
    )
    against: str | None = field(
        default=None,
        metadata=stated(
            Form.TEXT,
            "the boundary of another body that this one touches, in place of a foundation; `gap` adds to the distance "
            "of the two",
            left_out="a foundation",
        )
        | _NAMED,
    )
    slave: str | None = field(
        default=None,
        metadata=stated(
            Form.TEXT,
            "which of the two boundaries has the contact points",
            left_out="that of a body four times softer, else the finer one, else the one with fewer supports",
        )
        | _NAMED,
    )
    side: Side = field(
        default=Side.ABOVE,
        metadata=stated_of_one(Form.TEXT, '`"above"` or `"below"`', choices=tuple(Side)) | kept(one_of, Side),
    )

    def __post_init__(self) -> None:
        _ = self.law
        self._check_evolving()
        super().__post_init__()
        if isinstance(self.belt, float) and (v := self.belt):
            raise ProblemError(f"belt = {v:g} has no direction; give a vector, such as belt=({v:g}, 0.0)")
        self._check_obstacle()
        self._check_pair()
        self._check_tie()

    def refuse_directions(self) -> None:
        """Refuse what is there in several components only.

        Raises
        ------
        ProblemError
        """
        if isinstance(self.friction, OrthotropicFriction):
            raise ProblemError("orthotropic friction has a direction, and a scalar problem none; take Tresca")
        if isinstance(self.friction.bound, StateBound):
            raise ProblemError(
                f"the bound of friction law '{self.friction.name}' depends on penetration or pressure, which a scalar "
                f"problem does not have; give a number, a formula or a function of x"
            )
        if not isinstance(self.normal, Superpotential):
            raise ProblemError(
                f"the law of a scalar contact is {described(self.normal)}; give a superpotential such as Signorini(), "
                "or friction such as Tresca(0.5)"
            )
        if self.friction.acts and not self.rubs:
            raise ProblemError(
                f"a scalar contact has the law '{self.normal.name}' and the friction '{self.friction.name}', but a "
                f"scalar contact has one component; give one of the two"
            )
        if self.obstacle is not None or callable(self.belt) or np.any(self.belt):
            what = "a belt" if self.obstacle is None else "an obstacle"
            raise ProblemError(f"a scalar contact has {what}, which needs directions; give gap, where it stands")
        self._refuse_memory_of_slip()

    def _refuse_memory_of_slip(self) -> None:
        """Refuse what needs penetration and slip at one point, or the penetration where there is slip alone."""
        if self.rubs and (self.damping is not None or self.memory):
            what = "damping" if self.damping is not None else "memory"
            raise ProblemError(f"a scalar contact with friction has {what}, which is of the penetration; leave it out")
        for variable in self.remembers:
            rubs = getattr(variable, "friction", 0.0)
            if not isinstance(variable, (*_OF_PENETRATION, Shortening)) or callable(rubs) or np.any(rubs):
                raise ProblemError(
                    f"the memory '{variable.name}' needs slip and penetration, but a scalar contact has one component; "
                    f"give one of {', '.join(kind.__name__ for kind in _OF_PENETRATION)}, without friction"
                )

    def refuse_normals(self, dim: int) -> None:
        """Refuse what acts along a normal, which contact over an area of a body does not have.

        Raises
        ------
        ProblemError
        """
        if dim != 2:
            raise ProblemError("contact over a region is for plane bodies, and this body is 3D; use a bedding")
        if isinstance(self.normal, Superpotential) and not self.rubs:
            raise ProblemError(
                f"contact over an area has the law '{self.normal.name}' of a penetration and the friction "
                f"'{self.friction.name}', and its points only slide; give NoContact() and friction"
            )
        if isinstance(self.friction.bound, StateBound):
            raise ProblemError(
                f"the bound of friction law '{self.friction.name}' depends on penetration or pressure, which contact "
                f"over an area does not have; give a number, a formula or a function of x"
            )
        beyond = {
            "an obstacle": self.obstacle is not None,
            "a gap": callable(self.gap) or self.gap != 0.0,
            "damping of the penetration": self.damping is not None,
        }
        for what in (what for what, given in beyond.items() if given):
            raise ProblemError(f"contact over an area has {what}, which needs a normal; leave it out")

    @property
    def rubs(self) -> bool:
        """Whether there is friction and nothing else."""
        return self.friction.acts and isinstance(self.normal, NoContact)

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
        if isinstance(self.normal, Bolt):
            raise ProblemError("a bolt remembers by how much it was shortened, and nothing else; leave memory out")
        memory = self.memory if isinstance(self.memory, Sequence) else (self.memory,)
        for variable in memory:
            if not isinstance(variable, Memory):
                raise ProblemError(
                    f"memory holds {described(variable)}; give a list of internal variables, such as Secant(), "
                    "Wear(...) and the like"
                )
            for part in fields(variable):  # type: ignore[arg-type]
                if law_depends_on_time(getattr(variable, part.name)) or depends_on_time(getattr(variable, part.name)):
                    raise ProblemError(
                        f"{part.name} of memory '{variable.name}' depends on time, which it cannot; for a foundation "
                        f"that changes with time make the law, the damping or the gap depend on it"
                    )
        object.__setattr__(self, "memory", tuple(memory))

    def _check_obstacle(self) -> None:
        if self.obstacle is None:
            if self.normals is not None and not (isinstance(self.normals, str) and self.normals == Normals.BODY):
                raise ProblemError(f"normals = {quoted(self.normals)} needs an obstacle; give one or leave normals out")
            return  # and an obstacle that is put in later brings its own
        if not isinstance(self.obstacle, Obstacle):
            raise ProblemError(
                f"obstacle is {described(self.obstacle)}; pass Plane(...), Sphere(...), Cylinder(...) or "
                f"SignedDistance(...)"
            )
        if callable(self.gap) or self.gap != 0.0:
            raise ProblemError("gap and obstacle are both given; the gap follows from the obstacle: leave one out")
        if isinstance(self.obstacle, SignedDistance) and depends_on_time(self.obstacle.function):
            raise ProblemError(
                "the signed distance of an obstacle depends on time, which it cannot; for a moving foundation give "
                "a gap that depends on t"
            )
        given = Normals.OBSTACLE if self.normals is None else self.normals
        object.__setattr__(self, "normals", one_of(given, "normals", Normals, "Normals.OBSTACLE or Normals.BODY"))

    @property
    def ties(self) -> bool:
        """Whether it joins two bodies for good."""
        return isinstance(self.normal, Tie)

    def _check_tie(self) -> None:
        more = {
            "against, the boundary that it is joined to": not self.against,
            "no friction": self.friction.acts,
            "no gap": callable(self.gap) or self.gap != 0.0,
            "no damping and no memory": self.damping is not None or bool(self.memory),
        }
        for what in (what for what, wrong in more.items() if self.ties and wrong):
            raise ProblemError(f"a tie takes {what}: Contact(Tie(), against='lower:top')")

    def _check_pair(self) -> None:
        if not self.against:
            if self.slave:
                raise ProblemError(
                    f"slave = {quoted(self.slave)} goes with against, the boundary that is touched; give both"
                )
            return
        if self.obstacle is not None:
            raise ProblemError("against and obstacle are both given; a boundary touches one of the two: leave one out")
        if callable(self.belt) or np.any(self.belt):
            raise ProblemError("against and belt are both given; move the other body in place of a belt")

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
            return (Shortening(),) if isinstance(self.normal, Bolt) else (Secant(),) if self.law.remembers else ()
        return self.memory

    @cached_property
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
