"""Evolutions of blocks with uniform strain, one degree of freedom each, with closed forms derived in the docstrings.

A block is a unit square of linear elements.  Its top is held or moved, its bottom is in contact, and either its sides
slide between rollers or its Lame constant lam vanishes, so that its stress is uniform.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import atan, exp, log, pi, sqrt

import numpy as np
from scipy.integrate import solve_ivp

from hemivar.basics.arguments import expecting, positive
from hemivar.basics.known_statement import ManufacturedProblem
from hemivar.basics.types import Array
from hemivar.errors import ProblemError
from hemivar.evolution import Evolution
from hemivar.laws import (
    Bilateral,
    Bonding,
    Compliance,
    DampedContact,
    NoContact,
    PenetrationMemory,
    PiecewiseQuadratic,
    RateAndState,
    SlipTable,
    Softening,
    Tresca,
    Wear,
)
from hemivar.mechanics import Branch, Contact, ContactProblem, Fixed, Material, Prescribed, Roller
from hemivar.mechanics.conditions import ScalarData, Support
from hemivar.mechanics.moduli import Number
from hemivar.mesh import rectangle

__all__ = [
    "EarthquakeSlider",
    "KnownEvolution",
    "StickSlip",
    "VelocityStep",
    "bonded_block",
    "bounce",
    "bouncing_block",
    "jumping_block",
    "penetration_memory_block",
    "relaxing_block",
    "sliding_block",
    "wearing_block",
]

#: What happens at the start happens at the end of a step of this length, in units of the whole time.
AT_ONCE = 1e-9


@dataclass(frozen=True, eq=False)
class KnownEvolution(ManufacturedProblem):
    """An evolution with a closed form; it may be given wherever an evolution is asked for.

    Attributes
    ----------
    evolution : Evolution
    until : float
        Time at which it is to end.
    quantity : str
        A column of the history, or what the docstring of the problem says.
    exact : callable
        That quantity at a time.
    stops : tuple of float
        Times at which a step must end: for ``march(..., stops=known.stops)``.
    """

    evolution: Evolution
    until: float
    quantity: str
    exact: Callable[[float], float]
    stops: tuple[float, ...] = ()

    @property
    def statement(self) -> Evolution:
        """The evolution."""
        return self.evolution


def _block(
    contact: Contact,
    top: ScalarData | None,
    modulus: float,
    density: Number | None = None,
    viscosity: tuple[Number, Number] | None = None,
    branches: Sequence[Branch] = (),
) -> ContactProblem:
    """A unit square between rollers, ``lam + 2 mu = modulus``."""
    supports: dict[str, Support] = {"left": Roller(), "right": Roller()}
    if top is not None:
        supports["top"] = Fixed(y=top)
    return ContactProblem(
        mesh=rectangle((1.0, 1.0), 1),
        material=Material.lame(0.0, 0.5 * modulus, density=density, viscosity=viscosity, branches=branches),
        supports=supports,
        contact={"bottom": contact},
    )


def _pushed(depth: float) -> Callable[[Array, float], Array]:
    """The top is moved down at once, right after the start."""
    return lambda x, t: np.full(len(x), -depth if t > 0.0 else 0.0)


def relaxing_block(
    modulus: float = 6.0, branch: float = 6.0, time: float = 0.5, stiffness: float = 2.0, depth: float = 0.1
) -> KnownEvolution:
    """A standard solid that is pushed onto a spring at once and relaxes: the normal force.

    With ``k0 = modulus + branch`` and ``k = modulus`` the pressure falls from ``P0 = k0 p D/(k0 + p)`` to
    ``P = k p D/(k + p)`` with the time ``T (k0 + p)/(k + p)``: the branch ``h' + h/T = k1 e'``, the strain
    ``e = D - P/p`` and ``P = k e + h`` give ``P' (1 + (k + k1)/p) + P (1 + k/p)/T = k D/T``.

    Parameters
    ----------
    modulus, branch, time : float
        Uniaxial moduli of spring and branch, relaxation time T.
    stiffness, depth : float
        p and D.

    Returns
    -------
    KnownEvolution
    """
    quick, p = modulus + branch, stiffness
    first, last = (k * p * depth / (k + p) for k in (quick, modulus))
    slow = time * (quick + p) / (modulus + p)
    problem = _block(
        Contact(Compliance(p)), _pushed(depth), modulus, branches=[Branch(lame=(0.0, 0.5 * branch), time=time)]
    )
    return KnownEvolution(
        Evolution(problem), 1.0, "normal_force", lambda t: last + (first - last) * exp(-t / slow), (AT_ONCE,)
    )


def penetration_memory_block(
    modulus: float = 12.0, stiffness: float = 24.0, weight: float = 30.0, time: float = 0.4, depth: float = 0.1
) -> KnownEvolution:
    """A foundation that remembers the penetration: ``kappa (r0 - r) = k r + int b exp(-(t - s)/T) r ds``.

    The integral q obeys ``q' = b r - q/T``; eliminated, r goes from ``kappa r0/(kappa + k)`` to
    ``kappa r0/(kappa + k + b T)`` at the rate ``1/T + b/(kappa + k)``.

    Parameters
    ----------
    modulus, stiffness, weight, time, depth : float
        kappa, k, b, T, r0.

    Returns
    -------
    KnownEvolution
    """
    kappa, k, b = modulus, stiffness, weight
    rate = 1.0 / time + b / (kappa + k)
    first, last = kappa * depth / (kappa + k), kappa * depth / (kappa + k + b * time)
    contact = Contact(Compliance(k), memory=(PenetrationMemory(b, time),))
    return KnownEvolution(
        Evolution(_block(contact, _pushed(depth), kappa)),
        0.5,
        "penetration",
        lambda t: last + (first - last) * exp(-rate * t),
        (AT_ONCE,),
    )


def wearing_block(
    modulus: float = 24.0, stiffness: float = 24.0, coefficient: float = 0.02, speed: float = 0.5, depth: float = 0.1
) -> KnownEvolution:
    """A block that is pressed down at once and drawn over a foundation that wears (Archard): the normal force.

    Body and foundation in series have the stiffness ``S = kappa p/(kappa + p)``; the worn depth w relieves them,
    ``P = S (D - w)``, ``w' = k P V``: ``P = S D exp(-S k V t)``.  Without friction and with lam = 0 the whole block
    moves along with its top.

    Parameters
    ----------
    modulus, stiffness, coefficient, speed, depth : float
        kappa, p, k, V, D.

    Returns
    -------
    KnownEvolution
    """
    series = modulus * stiffness / (modulus + stiffness)

    def top(x: Array, t: float) -> Array:
        return np.tile([speed * t, -depth if t > 0.0 else 0.0], (len(x), 1))

    problem = ContactProblem(
        mesh=rectangle((1.0, 1.0), 1),
        material=Material.lame(0.0, 0.5 * modulus),
        supports={"top": Prescribed(top)},
        contact={"bottom": Contact(Compliance(stiffness), memory=(Wear(coefficient),))},
    )
    return KnownEvolution(
        Evolution(problem),
        4.0,
        "normal_force",
        lambda t: series * depth * exp(-series * coefficient * speed * t),
        (AT_ONCE,),
    )


def bonded_block(
    stiffness: float = 50.0, opening: float = 0.1, energy: float = 0.05, viscosity: float = 0.2
) -> KnownEvolution:
    """A bond that is held open and fades: the bonding field beta, state ``bond`` of the contact points.

    ``eta beta' = w0 - gamma beta r^2`` at the opening r: ``beta = b + (1 - b) exp(-gamma r^2 t/eta)``,
    ``b = w0/(gamma r^2)``.  The block is so stiff that its own strain does not matter (1e-6 of the opening).

    Parameters
    ----------
    stiffness, opening, energy, viscosity : float
        gamma, r, w0, eta.

    Returns
    -------
    KnownEvolution

    Raises
    ------
    ProblemError
        The bond would not break.
    """
    pull = stiffness * opening**2
    rest = energy / pull
    if not 0.0 < rest < 1.0:
        raise ProblemError(f"the bond tends to {rest:g}; take an energy below stiffness opening^2 = {pull:g}")
    contact = Contact(NoContact(), memory=(Bonding(stiffness, energy, viscosity),))
    return KnownEvolution(
        Evolution(_block(contact, _pushed(-opening), 2e6)),
        1.0,
        "bond",
        lambda t: rest + (1.0 - rest) * exp(-pull * t / viscosity),
        (AT_ONCE,),
    )


@expecting(stiffness=positive, damping=float, speed=float)
def bouncing_block(stiffness: float = 100.0, damping: float = 4.0, speed: float = 0.5) -> KnownEvolution:
    """A block of mass 1 meets a spring with a damper that cannot pull: the velocity, upwards, after it has left.

    In contact ``r'' + c r' + k r = 0``, with ``d = c/2``, ``w = sqrt(k - d^2)``: the force ``k r + c r'`` vanishes at
    the t of (0, pi/w) with ``tan w t = -2 d w/(w^2 - d^2)``, where the body leaves with
    ``r'(t) = v0 exp(-d t) (cos w t - d/w sin w t)``.

    Parameters
    ----------
    stiffness, damping, speed : float
        k, c, v0; with ``c^2 < 4 k``.

    Returns
    -------
    KnownEvolution

    Raises
    ------
    ProblemError
        The damper stops the block.
    """
    if not 0.0 <= damping**2 < 4.0 * stiffness:
        raise ProblemError("the damper stops the block: take damping^2 < 4 stiffness")
    duration, restitution = bounce(stiffness, damping)
    law = DampedContact(PiecewiseQuadratic(np.zeros(1), np.array([damping, damping]), np.zeros(1), name="damper"))
    problem = _block(Contact(Compliance(stiffness), memory=(law,)), None, 1e7, density=1.0)
    return KnownEvolution(
        Evolution(problem, inertia=True, velocity=(0.0, -speed)),
        0.4,
        "velocity",
        lambda t: restitution * speed if t >= duration else float("nan"),
    )


def bounce(stiffness: float, damping: float) -> tuple[float, float]:
    """Time in contact and restitution of a mass 1 on a spring and a damper that cannot pull.

    Parameters
    ----------
    stiffness : float
        Of the spring.
    damping : float
        Of the damper.

    Returns
    -------
    tuple of two floats
    """
    d = 0.5 * damping
    w = sqrt(stiffness - d**2)
    # k r + c r' = exp(-d t)/w ((k - c d) sin w t + c w cos w t) = 0
    duration = (pi - atan(2.0 * d * w / (w**2 - d**2)) if w > d else atan(2.0 * d * w / (d**2 - w**2))) / w
    return duration, -exp(-d * duration) * (np.cos(w * duration) - d / w * np.sin(w * duration))


def sliding_block(speed: float = 1.0, friction: float = 0.3, density: float = 5.0) -> KnownEvolution:
    """A block 1 x 0.2 that slides to rest: the velocity of its middle, ``max(v0 - F t/m, 0)``.

    Friction F acts on its base while its top keeps it level.  The velocities of implicit Euler are exact as long as the
    whole of a step is slid.

    Parameters
    ----------
    speed, friction, density : float
        v0, the bound F per length, and the density, of mass m = density/5.

    Returns
    -------
    KnownEvolution
    """
    slowing = friction / (0.2 * density)
    problem = ContactProblem(
        mesh=rectangle((1.0, 0.2), (5, 1)),
        material=Material.lame(1e4, 1e4, density=density),
        supports={"top": Fixed(y=0.0)},
        contact={"bottom": Contact(Bilateral(), Tresca(friction))},
    )
    return KnownEvolution(
        Evolution(problem, inertia=True, velocity=(speed, 0.0)),
        1.5 * speed / slowing,
        "velocity",
        lambda t: max(speed - slowing * t, 0.0),
    )


def jumping_block(
    modulus: float = 1.0,
    stiffness: float = 2.0,
    limit: float = 0.1,
    softening: float = 2.0,
    viscosity: float | None = None,
) -> KnownEvolution:
    """A block pushed down by ``r0 = min(t, 0.8 - t)`` on springs that give way faster than it is stiff.

    ``kappa (r0 - r) in dj(r)`` of :class:`~hemivar.laws.Softening`, alpha > kappa.  Followed without a leap it jumps at
    ``R1 = delta (1 + k/kappa)`` on the way in and at ``R2 = delta (1 + k/alpha)`` on the way out; the lowest energy
    changes sides at ``sqrt(R1 R2)`` both ways.  ``exact`` is the energy that the jumps of a cycle lose,
    ``kappa k (R1^2 - R2^2)/(2 (kappa + k))``: what the body and its springs, in series, keep at R1 and get at R2.

    Parameters
    ----------
    modulus, stiffness, limit, softening : float
        kappa, k, delta, alpha.
    viscosity : float, optional
        Of the body, uniaxial.

    Returns
    -------
    KnownEvolution

    Raises
    ------
    ProblemError
        There is no jump.
    """
    if not softening > modulus:
        raise ProblemError(f"softening = {softening:g} makes no jump; take more than the modulus {modulus:g}")
    up, down = limit * (1.0 + stiffness / modulus), limit * (1.0 + stiffness / softening)
    lost = modulus * stiffness * (up**2 - down**2) / (2.0 * (modulus + stiffness))
    problem = _block(
        Contact(Softening(stiffness, limit, softening)),
        lambda x, t: np.full(len(x), -min(t, 0.8 - t)),
        modulus,
        viscosity=None if viscosity is None else (0.0, 0.5 * viscosity),
    )
    return KnownEvolution(Evolution(problem), 0.8, "jumps", lambda t: lost, (0.4,))


@dataclass(frozen=True)
class StickSlip:
    """A mass on a spring on a belt: it sticks until the spring pulls with Fs, and slips under Fk.

    In the frame of the belt the spring's end moves away at the speed V.  It slips from rest at the belt while the
    spring is stretched by Fs/k: about ``Fk/k`` it swings with ``x = dF/k cos w t + V/w sin w t``, dF = Fs - Fk, until
    its velocity is the belt's again, after ``(2/w) (pi - atan(dF/(V sqrt(k m))))``; by symmetry the spring is then
    stretched by ``(Fk - dF)/k``, and pulled for ``2 dF/(k V)`` until it slips again.  Relative to the belt it moves at
    ``V + sqrt(V^2 + dF^2/(k m))`` at most.  In a period the belt moves by V times the period, all of it under Fk.

    Attributes
    ----------
    mass, stiffness, speed, static, kinetic : float
        m, k, V, Fs, Fk.
    """

    mass: float = 1.0
    stiffness: float = 4.0
    speed: float = 0.1
    static: float = 1.0
    kinetic: float = 0.6

    @property
    def sticks(self) -> float:
        """Time for which it sticks."""
        return 2.0 * (self.static - self.kinetic) / (self.stiffness * self.speed)

    @property
    def slips(self) -> float:
        """Time for which it slips."""
        fall = (self.static - self.kinetic) / (self.speed * sqrt(self.stiffness * self.mass))
        return 2.0 * sqrt(self.mass / self.stiffness) * (pi - atan(fall))

    @property
    def peak(self) -> float:
        """Largest slip rate."""
        fall = (self.static - self.kinetic) ** 2 / (self.stiffness * self.mass)
        return self.speed + sqrt(self.speed**2 + fall)

    @property
    def loss(self) -> float:
        """Heat of a period."""
        return self.kinetic * self.speed * (self.sticks + self.slips)

    @property
    def begins(self) -> float:
        """When it slips first, the spring being loose at the start."""
        return self.static / (self.stiffness * self.speed)

    def evolution(self, decay: float = 0.002) -> Evolution:
        """The problem, with friction that falls from Fs to Fk over slip rates up to ``decay``.

        A step has one solution if it is shorter than ``mass decay/(Fs - Fk)``.  The spring is the bedding of a stiff
        block; the belt's frame moves, so that its end is a load that grows.
        """
        pull = self.stiffness * self.speed

        def growing(x: Array, t: float) -> Array:
            return np.tile([pull * t, 0.0], (len(x), 1))

        problem = ContactProblem(
            mesh=rectangle((1.0, 1.0), 1),
            material=Material.lame(0.0, 1e6, density=self.mass),
            supports={"top": Fixed(y=0.0)},
            body_force=growing,
            bedding=self.stiffness,
            contact={
                "bottom": Contact(Bilateral(), SlipTable(1.0, [0.0, decay], [self.static, self.kinetic], of="rate"))
            },
        )
        return Evolution(problem, inertia=True)


@dataclass(frozen=True)
class VelocityStep:
    """Rate-and-state friction after a step of the slip rate from V1 to V2, the ageing law of Dieterich.

    At the constant rate V2 the age goes as ``theta = L/V2 + (L/V1 - L/V2) exp(-V2 t/L)``, and the coefficient is
    ``f0 + a ln(V2/V0) + b ln(V0 theta/L)``.

    Attributes
    ----------
    direct, evolve, length, first, second, rate, reference : float
        a, b, L, V1, V2, V0, f0.
    """

    direct: float = 0.01
    evolve: float = 0.015
    length: float = 8e-3
    first: float = 1e-9
    second: float = 1e-8
    rate: float = 1e-6
    reference: float = 0.6

    def coefficient(self, time: float) -> float:
        """Friction over the normal pressure, a time after the step."""
        new, old = self.length / self.second, self.length / self.first
        age = new + (old - new) * exp(-self.second * time / self.length)
        aged = self.evolve * log(self.rate * age / self.length)
        return self.reference + self.direct * log(self.second / self.rate) + aged

    def evolution(self, pressure: float = 50.0, modulus: float = 1e12) -> Evolution:
        """A stiff block that slips steadily at V1 at the start, and whose top goes at V2 from there on."""
        memory = RateAndState(
            self.direct, self.evolve, self.length, self.reference, self.rate, self.length / self.first
        )
        contact = Contact(Bilateral(), Tresca(pressure), memory=(memory,))
        steady = self.reference + (self.direct - self.evolve) * log(self.first / self.rate)
        ahead = pressure * steady / modulus
        problem = _sheared(contact, modulus, self.second, ahead=ahead)
        return Evolution(problem, displacement=lambda x: np.stack([ahead * x[:, 1], 0.0 * x[:, 0]], axis=1))


@dataclass(frozen=True)
class EarthquakeSlider:
    """A slider on a spring whose end creeps, with rate-and-state friction and radiation damping.

    ``tau' = k (Vp - V)`` and ``tau = sigma a asinh(V/(2 V0) exp((f0 + b ln(V0 theta/L))/a)) + mu V/(2 cs)``,
    ``theta' = 1 - V theta/L``, ``k = sigma (b - a)/(2 L)``: half of the stiffness below which steady slip is unstable.

    The period of the limit cycle and the extremes of V and tau were computed from these equations alone.

    Attributes
    ----------
    pressure, creep, modulus, wave, direct, evolve, length, rate, reference : float
        sigma, Vp, mu, cs, a, b, L, V0, f0.
    """

    pressure: float = 50e6
    creep: float = 1e-9
    modulus: float = 32.04e9
    wave: float = 3464.0
    direct: float = 0.01
    evolve: float = 0.015
    length: float = 8e-3
    rate: float = 1e-6
    reference: float = 0.6

    @property
    def stiffness(self) -> float:
        """k."""
        return self.pressure * (self.evolve - self.direct) / (2.0 * self.length)

    @property
    def damping(self) -> float:
        """mu/(2 cs)."""
        return self.modulus / (2.0 * self.wave)

    def cycle(self, rtol: float = 1e-10) -> tuple[float, float, float, float]:
        """Period, largest V, least and largest stress of the limit cycle, of the equations alone.

        In ``y = ln V`` and ``ln theta``: ``(sigma a s + eta V) y' = k (Vp - V) - sigma b s theta'/theta``, s the slope
        of asinh over its logarithm.

        Parameters
        ----------
        rtol : float
            Tolerance of the integrator.

        Raises
        ------
        ProblemError
            No cycle: the spring is so stiff that steady slip is stable.
        """
        a, b, sigma, eta = self.direct, self.evolve, self.pressure, self.damping

        def inner(y: Array, aged: Array) -> Array:
            psi = self.reference + b * (log(self.rate / self.length) + aged)
            return np.asarray(y - log(2.0 * self.rate) + psi / a)

        def change(t: float, x: Array) -> Array:
            y, aged = x
            speed, slope = np.exp(y), 1.0 / np.sqrt(1.0 + np.exp(-2.0 * inner(y, aged)))
            older = np.exp(-aged) - speed / self.length
            pulled = self.stiffness * (self.creep - speed) - sigma * b * slope * older
            return np.array([pulled / (sigma * a * slope + eta * speed), older])

        def fast(t: float, x: Array) -> float:
            return float(x[0] - log(1e-3 * self.rate / 1e-6))

        def creeps(t: float, x: Array) -> float:  # the stress is at an extreme
            return float(x[0] - log(self.creep))

        def fastest(t: float, x: Array) -> float:
            return float(change(t, x)[0])

        fast.direction, fastest.direction = 1.0, -1.0  # type: ignore[attr-defined]
        start = [log(self.creep), log(self.length / self.creep) - 0.05]
        events = (fast, creeps, fastest)
        critical = sigma * (b - a) / self.length
        if not 0.0 < self.stiffness < critical:
            raise ProblemError(
                f"the slider has no limit cycle: its stiffness is {self.stiffness:.3g}, and steady slip is unstable "
                f"between 0 and sigma (b - a)/L = {critical:.3g}; take one in between"
            )
        span = 6e9 * (0.5 * critical / self.stiffness)  # a period is about as long as the spring takes to be loaded
        cycle = solve_ivp(
            change, (0.0, span), start, method="LSODA", rtol=rtol, atol=1e-12, events=events, max_step=2e7
        )
        if not cycle.success or cycle.t_events[0].size < 2:
            raise ProblemError(
                f"the slider with the stiffness {self.stiffness:.3g} shows no limit cycle up to t = {span:.3g}; take "
                f"another between 0 and sigma (b - a)/L = {critical:.3g}"
            )
        first, last = cycle.t_events[0][-2:]
        turned, peaks = (
            cycle.y_events[k][(cycle.t_events[k] >= first) & (cycle.t_events[k] <= last + 1e3)] for k in (1, 2)
        )
        z = inner(turned[:, 0], turned[:, 1])
        stress = sigma * a * np.logaddexp(z, 0.5 * np.logaddexp(2.0 * z, 0.0)) + eta * self.creep
        return float(last - first), float(np.exp(peaks[:, 0].max())), float(stress.min()), float(stress.max())

    def evolution(self, delay: float = 0.0) -> Evolution:
        """A sheared block of stiffness k and viscosity mu/(2 cs), whose top creeps; the slip is that of its bottom.

        The viscosity takes ``mu (V - Vp)/(2 cs)`` from the spring's force, so that the stress of the closed form is the
        friction plus ``mu V/(2 cs)``; the constant ``mu Vp/(2 cs)`` is a shift of the origin of the spring.

        Parameters
        ----------
        delay : float
            Slip by which the spring starts short of steady creep.
        """
        memory = RateAndState(
            self.direct, self.evolve, self.length, self.reference, self.rate, self.length / self.creep
        )
        contact = Contact(Bilateral(), Tresca(self.pressure), memory=(memory,))
        steady = self.reference + (self.direct - self.evolve) * log(self.creep / self.rate)
        ahead = self.pressure * steady / self.stiffness - delay
        problem = _sheared(contact, self.stiffness, self.creep, self.damping, ahead)
        return Evolution(problem, displacement=lambda x: np.stack([ahead * x[:, 1], 0.0 * x[:, 0]], axis=1))


def _sheared(
    contact: Contact, modulus: float, speed: float, viscosity: float = 0.0, ahead: float = 0.0
) -> ContactProblem:
    """A unit square in simple shear: its nodes move along x only, its top at a speed."""

    def creeping(x: Array, t: float) -> Array:
        return np.tile([ahead + speed * t, 0.0], (len(x), 1))

    return ContactProblem(
        mesh=rectangle((1.0, 1.0), 1),
        material=Material.lame(0.0, modulus, viscosity=(0.0, viscosity) if viscosity else None),
        supports={
            "left": Fixed(y=0.0),
            "right": Fixed(y=0.0),
            "top": Prescribed(creeping),
        },
        contact={"bottom": contact},
    )
