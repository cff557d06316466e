"""The statement of an evolution: a contact problem in time with its initial values."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import Any

import numpy as np

from hemivar.basics.arguments import expect, number, one_of, quoted
from hemivar.basics.arrays import real_array
from hemivar.basics.first_use import cached_property
from hemivar.basics.portable import PickleMixin
from hemivar.basics.types import Array
from hemivar.errors import ProblemError
from hemivar.fem.forms import FormProblem
from hemivar.mechanics.conditions import DataField
from hemivar.mechanics.load_steps import Step
from hemivar.mechanics.statement import ContactProblem
from hemivar.mechanics.thermal import Heat

__all__ = ["Evolution", "Mass"]


class Mass(StrEnum):
    """How the mass of the body is spread over the nodes."""

    CONSISTENT = "consistent"
    """As the shape functions say."""
    REDISTRIBUTED = "redistributed"
    """Contact nodes carry none, what they had goes to the nodes beside them: contact with a rigid obstacle does not
    ring (singular mass: Dabaghi, Petrov, Pousin, Renard, 10.1051/m2an/2013133).  Inertia no longer helps the uniqueness
    of a step there: not for laws that soften steeply."""


@dataclass(frozen=True, eq=False)
class Evolution(PickleMixin):
    """A contact problem in time, from an initial state on; :func:`hemivar.march` solves it step by step.

    >>> import hemivar as hv
    >>> block = hv.ContactProblem(
    ...     hv.rectangle((1.0, 1.0), 2), hv.Material.young(10.0, 0.3, density=1.0),
    ...     {"bottom": hv.Contact(hv.Compliance(9.0))})
    >>> drop = hv.Evolution(block, inertia=True, velocity=(0.0, -1.0))
    >>> hv.march(drop, until=0.1, step=0.05).times
    array([0.  , 0.05, 0.1 ])

    The equation is ``M u'' + C u' + K u + B'W lambda = f(t)``, with lambda the forces of contact; without inertia M is
    left out.  Loads, supports, gaps and parameters of laws that are formulas of ``t`` follow the time.  The normal law
    sees the penetration, friction the slip or its rate, as the law says.  In a problem of heat C is the capacity.

    Parameters
    ----------
    problem : ContactProblem or FormProblem
        With a density where inertia acts; viscosity and branches of its material act by themselves.  Of forms mass and
        viscosity are those of the body.
    inertia : bool
        Whether the body has mass; otherwise it is always in equilibrium (quasistatic).
    displacement : vector (d,), callable, or array (nodes, d), optional
        At the start; zero by default. A callable gets points (k, d). Of a scalar problem the deflection or temperature:
        a number, a callable that returns (k,), or an array (nodes,); where a support holds a temperature, that counts.
    velocity : likewise, optional
        At the start, with inertia; zero by default.
    start : float
        Time at which it begins. Of a problem with load steps it is 1, the end of the first one.
    mass : Mass
    heat : Heat, optional
        Heat in a body, coupled with its motion in every step.

    Raises
    ------
    ProblemError
        Inertia without density, a velocity without inertia, heat in a material that is not linear, or data that do
        not fit the mesh.
    """

    problem: ContactProblem | FormProblem
    inertia: bool = False
    displacement: Any = None
    velocity: Any = None
    start: float = 0.0
    mass: Mass = Mass.CONSISTENT
    heat: Heat | None = None

    def __post_init__(self) -> None:
        remedy = "give a ContactProblem or a ScalarProblem; hemivar.read_problem(path) reads one from a file"
        problem = expect(self.problem, ContactProblem | FormProblem, "the problem of an evolution", remedy)
        expect(self.inertia, bool, "inertia", "write True or False")
        start = number(self.start, "the start of an evolution", "give a time")
        if not np.isfinite(start):
            raise ProblemError(f"the evolution starts at {start}; give a finite time")
        object.__setattr__(self, "start", 1.0 if self.steps else start)
        object.__setattr__(self, "mass", one_of(self.mass, "mass", Mass))
        if self.heat is not None and not self.linear and not problem.kind:
            raise ProblemError(
                "heat is coupled with the motion of linear materials only, and this material is not linear; leave heat "
                "out, or give Material.lame(...) or the like"
            )
        if problem.kind:
            self._check_scalar(self.statement)
        if self.inertia and not problem.material.inert:
            raise ProblemError(f"the evolution has inertia, but {problem.without_mass}, or take inertia=False")
        if self.heat is not None or self.mass is Mass.REDISTRIBUTED:
            what = "heat" if self.heat is not None else "redistributed mass"
            self._assembled(what, "; leave it out of a body of forms")
        if self.velocity is not None and not self.inertia:
            raise ProblemError(
                "an initial velocity is given, but the body has no inertia, so it would have no effect; use "
                "inertia=True with a density, or leave the velocity out"
            )
        if self.steps:
            self._check_steps(start)
        for name in ("displacement", "velocity"):
            self.initial(name)
        _ = self.conduction

    def __repr__(self) -> str:
        kind = "with inertia" if self.inertia else "quasistatic"
        return f"Evolution({self.problem!r}, {kind} from t = {self.start:g})"

    @property
    def linear(self) -> bool:
        """Whether the stress, or the flux, is linear in the strain or gradient."""
        return self.problem.material.linear

    @property
    def steps(self) -> tuple[Step, ...]:
        """The load steps of the problem, step k ending at t = k; empty where it goes through time itself."""
        return () if isinstance(self.problem, FormProblem) else tuple(self.problem.steps)

    def _check_steps(self, start: float) -> None:
        """Refuse load steps beside what needs durations."""
        heated = "heat" if self.heat is not None else ""
        if what := heated or ("mass or viscosity" if self.resists else ""):
            raise ProblemError(f"load steps have no duration, which {what} needs; leave it out, or state loads in time")
        if start != 0.0:
            raise ProblemError(f"load steps begin with the first one, and start is {start:g}; leave start out")

    @property
    def resists(self) -> bool:
        """Whether the body has mass, viscosity or a capacity, so that a step is no equilibrium."""
        material = self.problem.material
        return self.inertia or material.viscous or material.capacity is not None

    @property
    def statement(self) -> ContactProblem:
        """The problem of a body that hemivar assembles.

        Raises
        ------
        ProblemError
            It is one of forms.
        """
        return self._assembled("this", ", and it is one of forms")

    def _assembled(self, what: str, otherwise: str) -> ContactProblem:
        if isinstance(self.problem, FormProblem):
            raise ProblemError(f"{what} needs a body that hemivar assembles itself{otherwise}")
        return self.problem

    @cached_property
    def _places(self) -> tuple[Array, int]:
        return self.problem.places(self.start)

    @cached_property
    def conduction(self) -> Evolution | None:
        """The evolution of the heat in a body, without what its motion does to it; None where there is no heat.

        Raises
        ------
        ProblemError
            Heat does not go with the problem.
        """
        if self.heat is None:
            return None
        heat = expect(self.heat, Heat, "the heat of an evolution", "give Heat(conductivity, capacity, ...)")
        if self.statement.kind:
            raise ProblemError(
                "heat= goes with a body, and this is a scalar problem; for heat alone state ScalarProblem(kind='heat')"
            )
        return Evolution(heat.conduction(self.statement), displacement=heat.temperature, start=self.start)

    @property
    def body(self) -> ContactProblem:
        """The contact problem of a body.

        Raises
        ------
        ProblemError
            It is a scalar problem.
        """
        if self.statement.kind:
            raise ProblemError(
                f"this is a scalar problem ({self.statement.unknown}), and an evolution of a body is needed; leave "
                "the engine out"
            )
        return self.statement

    def _check_scalar(self, problem: ContactProblem) -> None:
        if self.inertia and problem.thermal:
            raise ProblemError(
                "heat has no inertia; take inertia=False, what stores heat is the capacity of the problem"
            )
        if self.mass is Mass.REDISTRIBUTED and problem.areas:
            raise ProblemError(
                "redistributed mass leaves contact nodes without any, and contact over an area has no nodes beside "
                "them; take mass='consistent' with MoreauJean() or a compliant foundation"
            )
        rubs = [name for name, one in problem.contact.items() if one.rubs]
        if problem.thermal and rubs:
            raise ProblemError(
                f"contact '{rubs[0]}' has friction, which acts on a rate, and heat that is exchanged depends on the "
                "temperature; give a law of the temperature, such as Compliance(h)"
            )

    def initial(self, name: str) -> Array:
        """Initial displacement or velocity at the nodes, shape (nodes, d), or (nodes, 1) of one component.

        Parameters
        ----------
        name : str
            ``"displacement"`` or ``"velocity"``.
        """
        if not isinstance(name, str) or name not in ("displacement", "velocity"):
            raise ProblemError(f"there is no initial {quoted(name)}; choose 'displacement' or 'velocity'")
        value, what, (nodes, components) = getattr(self, name), f"initial {name}", self._places
        shape = (len(nodes), components)
        if value is None:
            return np.zeros(shape)
        if callable(value):
            return np.array(DataField(value, what, components).at(nodes).reshape(shape))
        given = real_array(value, what)
        if components == 1 and given.shape in ((), shape[:1]):
            given = given[..., None]
        if given.shape not in (shape[1:], shape):
            kind = "a number" if components == 1 else f"a vector of {components} components"
            raise ProblemError(
                f"the {what} has shape {given.shape}; give {kind}, a function of points, or "
                f"one for each of the {len(nodes)} nodes"
            )
        return np.array(np.broadcast_to(given, shape))
