"""Thermomechanics: conduction, capacity, thermal stress, and what contact and friction do to heat.

capacity th' - div(conductivity grad th) + T0 beta : eps(u') = source                   in the body,
sigma = (elastic and viscous stress) - beta (th - stress_free),
heat flow out of the body  h (th - th_R) - share |lam_tau . r_tau'|                     on a contact boundary.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import MappingProxyType

import numpy as np

from hemivar.basics.arguments import described, number, suggest
from hemivar.basics.arrays import LARGEST, real_array
from hemivar.basics.known_keywords import known_keywords
from hemivar.basics.portable import PickleMixin
from hemivar.basics.stated import Form, stated
from hemivar.basics.types import Array
from hemivar.errors import ProblemError
from hemivar.laws import NoContact, PiecewiseQuadratic, Superpotential
from hemivar.laws.consistency import check_own
from hemivar.mechanics.conditions import ScalarData, plain_data
from hemivar.mechanics.foundation import Contact
from hemivar.mechanics.gradient_energy import Coefficient
from hemivar.mechanics.instants import law_depends_on_time, takes_arguments
from hemivar.mechanics.material_words import ScalarKind
from hemivar.mechanics.per_volume import Regional, checked_per_volume, refuse_unknown
from hemivar.mechanics.scalar import ScalarContact, ScalarProblem
from hemivar.mechanics.statement import ContactProblem, Quadrature

__all__ = ["ContactConductance", "Heat", "HeatContact"]

Conductance = float | Callable[..., object]


@dataclass(frozen=True, eq=False)
class HeatContact(PickleMixin):
    """The exchange of heat along one boundary, with a foundation, with another body or with the surroundings.

    Where the contact of the boundary is one against another body, th_R is the temperature of that body on its side:
    what leaves the one enters the other.

    Attributes
    ----------
    conductance : float or callable
        h: heat per area, time and degree. A callable gets penetration and pressure of the contact points, each (m,),
        and the mean temperature of both sides if it takes three arguments, and returns (m,); :meth:`touching` makes
        one that conducts where there is contact only.
    temperature : float or callable
        th_R of the foundation; a callable gets points (k, d), and the time if it takes two arguments.
    share : float or None
        Part of the heat made by friction that goes into the body, between 0 and 1. By default none of it on a
        foundation, and half of it where two bodies touch: the other one takes the rest.
    exchange : Superpotential or None
        In place of the conductance a law of ``th - th_R``, maybe not monotone: heat flow out of the body per area.

    Raises
    ------
    ProblemError
        A number is negative or not finite, the share is outside of [0, 1], conductance and exchange are both given.
    """

    conductance: Conductance = field(
        default=0.0,
        metadata=stated(
            Form.OWN,
            "a number, or `{ closed = 0.5, per_pressure = 0.1, exponent = 1.0 }`, or tables `{ pressures = [0, 10], "
            "conductances = [0, 5], temperatures = [20, 300], factors = [1, 0.7] }`",
        ),
    )
    temperature: ScalarData = field(
        default=0.0, metadata=stated(Form.QUANTITY, "temperature of the foundation *(f, t)*", timed=True)
    )
    share: float | None = field(
        default=None,
        metadata=stated(
            Form.NUMBER,
            "part of the heat made by friction that enters the body; another body that it touches takes the rest",
            left_out="`0.0`; `0.5` where two bodies touch",
        ),
    )
    exchange: Superpotential | None = field(
        default=None, metadata=stated(Form.OWN, "in place of the conductance, `{ law = ... }`")
    )

    def __post_init__(self) -> None:
        if not callable(self.conductance):
            if isinstance(self.conductance, str):
                raise ProblemError(
                    f"the conductance is {described(self.conductance)}; give a number, or a function of penetration "
                    "and pressure"
                )
            given = number(self.conductance, "the conductance of a contact", "give heat per area, time and degree")
            if not 0.0 <= given < LARGEST:
                raise ProblemError(f"conductance = {given:g}; it must be a finite number that is not negative")
            object.__setattr__(self, "conductance", given)
        self._check_share()
        object.__setattr__(self, "temperature", plain_data(self.temperature, "temperature of a foundation", 1, LARGEST))
        if self.exchange is not None:
            if not isinstance(self.exchange, Superpotential):
                raise ProblemError(
                    f"exchange is {described(self.exchange)}; give a law of the difference of temperatures, such as "
                    "Compliance(2.0), or leave it out"
                )
            if callable(self.conductance) or self.conductance:
                raise ProblemError("conductance and exchange are both given; give one of the two")
            if any(np.isneginf(self.exchange.asymptotic_curvature(sign)).any() for sign in (1.0, -1.0)):
                raise ProblemError(
                    f"the exchange '{self.exchange.name}' has a slope without a lower bound, so no conduction "
                    f"balances the heat; give a law whose slope is bounded below"
                )
            if law_depends_on_time(self.exchange):
                raise ProblemError(
                    "the law of an exchange of heat depends on time, which it cannot; give a temperature that does"
                )
            check_own(self.exchange)

    def _check_share(self) -> None:
        if self.share is None:
            return
        share = number(self.share, "the share of the heat of friction", "give a number between 0 and 1")
        if not 0.0 <= share <= 1.0:
            raise ProblemError(
                f"share = {share:g}; give the part of the heat of friction that the body takes, between 0 and 1"
            )
        object.__setattr__(self, "share", share)

    @staticmethod
    @known_keywords
    def touching(
        closed: float = 0.0,
        per_pressure: float = 0.0,
        exponent: float = 1.0,
        *,
        pressures: Sequence[float] = (),
        conductances: Sequence[float] = (),
        temperatures: Sequence[float] = (),
        factors: Sequence[float] = (),
    ) -> ContactConductance:
        """A conductance where the body is pressed on, and none elsewhere.

        It is ``closed + per_pressure p^exponent``, or the table of ``conductances`` at ``pressures``; times that of
        ``factors`` at the mean ``temperatures`` of both sides. Tables are linear between their points.
        """
        return ContactConductance(closed, per_pressure, exponent, pressures, conductances, temperatures, factors)

    @property
    def law(self) -> Superpotential:
        """The law of ``th - th_R`` where it does not depend on the state; that of no exchange where it does."""
        if self.exchange is not None:
            return self.exchange
        if callable(self.conductance) or not self.conductance:
            return NoContact()
        h, zero = np.full(2, self.conductance), np.zeros(1)
        return PiecewiseQuadratic(zero, h, zero, name="conductance")

    @property
    def depends_on_state(self) -> bool:
        """Whether the conductance depends on penetration or pressure."""
        return callable(self.conductance)

    @property
    def depends_on_temperature(self) -> bool:
        """Whether the conductance depends on the temperatures of both sides."""
        if isinstance(self.conductance, ContactConductance):
            return bool(self.conductance.temperatures)
        return callable(self.conductance) and takes_arguments(self.conductance, 3, "temperature")

    def conductances(self, penetration: Array, pressure: Array, temperature: Array) -> Array:
        """h at contact points, shape (m,); the temperature is the mean of both sides.

        Raises
        ------
        ProblemError
            A function returns another shape, or what is negative or not finite.
        """
        if not callable(self.conductance):
            return np.full(penetration.shape, self.conductance)
        state = (penetration, pressure, temperature)[: 3 if self.depends_on_temperature else 2]
        values = real_array(self.conductance(*state), "the conductance", finite=False)
        if values.shape not in ((), penetration.shape):
            raise ProblemError(
                f"the conductance has shape {values.shape} at {penetration.size} points; return one each"
            )
        if not ((values >= 0.0) & (values < LARGEST)).all():
            raise ProblemError(f"the conductance is {float(np.min(values)):g} at some point; it must not be negative")
        return np.broadcast_to(values, penetration.shape)


@dataclass(frozen=True)
class ContactConductance(PickleMixin):
    """A conductance where the body is pressed on: ``closed + per_pressure p^exponent`` for p > 0, or by tables.

    See :meth:`HeatContact.touching`.
    """

    closed: float = field(default=0.0, metadata=stated(Form.NUMBER, "the conductance where there is contact"))
    per_pressure: float = field(default=0.0, metadata=stated(Form.NUMBER))
    exponent: float = field(default=1.0, metadata=stated(Form.NUMBER))
    pressures: Sequence[float] = field(default=(), metadata=stated(Form.LIST))
    conductances: Sequence[float] = field(default=(), metadata=stated(Form.LIST))
    temperatures: Sequence[float] = field(default=(), metadata=stated(Form.LIST))
    factors: Sequence[float] = field(default=(), metadata=stated(Form.LIST))

    def __post_init__(self) -> None:
        for name in ("closed", "per_pressure", "exponent"):
            given = number(getattr(self, name), f"{name} of a conductance")
            if not 0.0 <= given < LARGEST or (name == "exponent" and given == 0.0):
                raise ProblemError(f"{name} = {given:g} of a conductance; it must not be negative")
            object.__setattr__(self, name, given)
        for at, of in (("pressures", "conductances"), ("temperatures", "factors")):
            places, values = (real_array(getattr(self, name), f"{name} of a conductance", 1) for name in (at, of))
            if places.size != values.size or (np.diff(places) <= 0.0).any() or (values < 0.0).any():
                raise ProblemError(
                    f"{at} and {of} of a conductance are {places.size} and {values.size} numbers; give equally many, "
                    f"{at} that increase and {of} that are not negative"
                )
            object.__setattr__(self, at, tuple(places.tolist()))
            object.__setattr__(self, of, tuple(values.tolist()))
        if self.pressures and (self.closed or self.per_pressure):
            raise ProblemError("a conductance has both a table of pressures and closed or per_pressure; give one")

    def __call__(self, penetration: Array, pressure: Array, temperature: Array | None = None) -> Array:
        pressed = np.maximum(pressure, 0.0)
        if self.pressures:
            values = np.interp(pressed, self.pressures, self.conductances)
        else:
            values = self.closed + self.per_pressure * pressed**self.exponent
        if self.temperatures and temperature is not None:
            values = values * np.interp(temperature, self.temperatures, self.factors)
        return np.where(pressure > 0.0, values, 0.0)


@dataclass(frozen=True, eq=False)
class Heat(PickleMixin):
    """Heat in a body of an evolution, coupled with its motion in every step.

    Attributes
    ----------
    conductivity : float, tensor (d, d), callable, or mapping of region name to one of these
    capacity : float, callable, or mapping of region name to one of these
        Heat per volume and degree, positive.
    expansion : float, callable, mapping or None
        Strain per degree, the same in all directions; beta follows from it and the elasticity.
    thermal_stress : float, callable, mapping or None
        In place of the expansion beta itself: pressure per degree of a body that cannot expand.
    coupling : float
        T0, the absolute temperature that deformation makes heat at: ``T0 beta tr eps'`` is taken from the body; zero
        (the default) leaves this out.
    stress_free : float
        Temperature at which there is no thermal stress.
    temperature : float, callable, or array (nodes,)
        At the start.
    supports, fluxes : mapping of boundary name to float or callable
        Prescribed temperatures; heat flow into the body per area.
    source : float or callable
        Heat per volume and time.
    contact : mapping of boundary name to HeatContact
    rtol : float
        How far temperatures of a step may change at last when motion and heat are computed in turns, as a part of the
        largest difference from the stress-free temperature.

    Raises
    ------
    ProblemError
        Expansion and thermal stress are both given, or something is negative, not finite or of the wrong kind.
    """

    conductivity: Coefficient = field(
        metadata=stated(
            Form.TENSOR, "a number, d lists of d numbers, or `{ REGION = ... }` *(f)*", least=0.0, by="region"
        )
    )
    capacity: Regional = field(
        metadata=stated(
            Form.QUANTITY, "heat per volume and degree, or `{ REGION = ... }` *(f)*", least=0.0, by="region"
        )
    )
    expansion: Regional | None = field(
        default=None,
        metadata=stated(Form.QUANTITY, "strain per degree, or `{ REGION = ... }` *(f)*", least=0.0, by="region"),
    )
    thermal_stress: Regional | None = field(
        default=None,
        metadata=stated(
            Form.QUANTITY,
            "pressure per degree in place of the expansion, or `{ REGION = ... }` *(f)*",
            least=0.0,
            by="region",
        ),
    )
    coupling: float = field(
        default=0.0, metadata=stated(Form.NUMBER, "absolute temperature in the heat of deformation")
    )
    stress_free: float = field(default=0.0, metadata=stated(Form.NUMBER, "temperature without thermal stress"))
    temperature: ScalarData = field(default=0.0, metadata=stated(Form.QUANTITY, "temperature at the start *(f)*"))
    supports: Mapping[str, ScalarData] = field(
        default_factory=dict,
        metadata=stated(
            Form.QUANTITY,
            "prescribed temperatures, `{ NAME = ... }` *(f, t)*",
            timed=True,
            by="boundary",
            left_out="none",
        ),
    )
    fluxes: Mapping[str, ScalarData] = field(
        default_factory=dict,
        metadata=stated(
            Form.QUANTITY,
            "heat flow into the body per area, `{ NAME = ... }` *(f, t)*",
            key="flux",
            timed=True,
            by="boundary",
            left_out="none",
        ),
    )
    source: ScalarData = field(
        default=0.0, metadata=stated(Form.QUANTITY, "heat per volume and time *(f, t)*", timed=True)
    )
    contact: Mapping[str, HeatContact] = field(
        default_factory=dict, metadata=stated(Form.OWN, "tables `[heat.contact.NAME]`, see below", left_out="none")
    )
    rtol: float = field(
        default=1e-9,
        metadata=stated(
            Form.NUMBER, "how far temperatures of a step may change at last when motion and heat take turns"
        ),
    )

    def __post_init__(self) -> None:
        if self.expansion is not None and self.thermal_stress is not None:
            raise ProblemError(
                "expansion and thermal_stress are both given; give one, for beta follows from the expansion and the "
                "elasticity"
            )
        for name, least in (("coupling", 0.0), ("stress_free", -LARGEST)):
            given = number(getattr(self, name), f"{name} of Heat")
            if not least <= given < LARGEST:
                raise ProblemError(f"{name} = {given:g} of Heat; give a finite number{' >= 0' if not least else ''}")
            object.__setattr__(self, name, given)
        if not 0.0 < number(self.rtol, "rtol of Heat") < 1.0:
            raise ProblemError(f"rtol = {self.rtol:g} of Heat; it must lie between 0 and 1")
        if not isinstance(self.contact, Mapping):
            raise ProblemError(f"contact of Heat is {described(self.contact)}; give a HeatContact for each boundary")
        for name, exchange in self.contact.items():
            if not isinstance(exchange, HeatContact):
                raise ProblemError(
                    f"contact['{name}'] of Heat is {described(exchange)}; give HeatContact(conductance=..., "
                    "temperature=...)"
                )
        object.__setattr__(self, "contact", MappingProxyType(dict(self.contact)))

    @property
    def stresses(self) -> bool:
        """Whether temperature makes stress."""
        return self.expansion is not None or self.thermal_stress is not None

    def conduction(self, problem: ContactProblem) -> ContactProblem:
        """The heat in the body of a problem, without what its motion does to it.

        Raises
        ------
        ProblemError
            A name is unknown to the mesh, something is of the wrong kind or range, or the two do not go together.
        """
        mesh = problem.mesh
        if problem.kinematics.ring:
            raise ProblemError(
                "plane = 'axisymmetric' has no heat; leave heat out, or model a quarter of the body in 3D"
            )
        for name in problem.ties:
            raise ProblemError(
                f"tie '{name}' joins displacements only, and no heat passes it; mesh the two as one body"
            )
        for name in self.contact:
            if name not in mesh.boundaries:
                near = suggest(str(name), list(mesh.boundaries), "boundaries")
                raise ProblemError(f"contact of Heat names boundary '{name}', which the mesh does not have{near}")
        if problem.quadrature is Quadrature.MIDPOINT:
            raise ProblemError("heat is exchanged at nodes, and this problem has contact at midpoints; take NODAL")
        for name, exchange in self.contact.items():
            _check_sides(problem, name, exchange)
            if name not in problem.contact and (exchange.share or exchange.depends_on_state):
                what = "a share of the heat of friction" if exchange.share else "a conductance that depends on contact"
                raise ProblemError(
                    f"contact['{name}'] of Heat has {what}, but the body has no contact there; name a boundary of its "
                    "contact, or give a conductance that is a number"
                )
        for name in ("expansion", "thermal_stress"):
            value = getattr(self, name)
            if value is not None:
                checked_per_volume(value, name)
                refuse_unknown(name, value if isinstance(value, Mapping) else {}, list(mesh.regions))
        exchanged = {name: self._exchange(problem, name, exchange) for name, exchange in self.contact.items()}
        if isinstance(self.capacity, int | float) and not self.capacity > 0.0:
            raise ProblemError(f"capacity = {self.capacity:g} of Heat; it must be positive")
        joints = {name: exchange for name, exchange in exchanged.items() if exchange.against}
        flowing = ScalarProblem(
            mesh,
            self.conductivity,
            contact={name: exchange for name, exchange in exchanged.items() if name not in joints},
            supports=self.supports,
            fluxes=self.fluxes,
            source=self.source,
            kind=ScalarKind.HEAT,
            title=problem.title,
            order=problem.order,
            capacity=self.capacity,
        )
        return replace(flowing, contact={**flowing.contact, **joints}) if joints else flowing

    def _exchange(self, problem: ContactProblem, name: str, exchange: HeatContact) -> Contact:
        """What acts on the temperatures along a boundary.

        Of two bodies the contact points are those of their motion, but where temperatures of the slave are prescribed.
        """
        contact = ScalarContact(exchange.law, exchange.temperature)
        against = problem.contact[name].against if name in problem.contact else None
        if not against:
            return contact
        mesh, sides = problem.mesh, problem.pair(name)
        fixed = np.zeros(mesh.number_of_nodes, dtype=bool)
        for support in self.supports:
            fixed[mesh.boundaries.get(support, [])] = True
        return replace(contact, against=against, slave=sides[int(fixed[mesh.boundaries[sides[0]]].all(axis=1).any())])


def _check_sides(problem: ContactProblem, name: str, exchange: HeatContact) -> None:
    """Refuse heat of two bodies that is stated on the side that does not state their contact, or with a foundation."""
    for other, contact in problem.contact.items():
        if contact.against == name and name not in problem.contact:
            raise ProblemError(
                f"contact['{name}'] of Heat is the boundary that '{other}' touches; state the heat of the two as "
                f"contact['{other}'], where their contact stands"
            )
    against = problem.contact[name].against if name in problem.contact else None
    if against and (callable(exchange.temperature) or exchange.temperature):
        raise ProblemError(
            f"contact['{name}'] of Heat has the temperature of a foundation, and '{name}' touches '{against}', whose "
            "temperature is computed; leave it out"
        )
