"""A brittle bond with plastic slip beside it: energetic mode mixity.

Stored per area, with the opening w, the slip s, the bond beta (1 or 0) and the plastic slip pi:
``beta [k_n <w>^2 + k_t |s - pi|^2]/2 + kappa |pi|^2/2``; lost: ``a0`` for a bond that breaks and ``sigma_y |d pi|``.
Opening breaks the bond at the energy a0.  In shear the plastic slip takes more (Roubicek, Mantic and Panagiotopoulos
2013), ``G_II = a0 + (t_c^2 - sigma_y^2)/(2 kappa)`` with the traction at the break ``t_c = sqrt(2 k_t a0) > sigma_y``.

In a step two parts alternate: with the bonds as they are, displacement and plastic slip minimise the energy; then the
bonds break whose energy has reached a0.  With pi minimised at each point the first part is a law: with ``c = (1 +
kappa/k) pi_n``, ``k = beta k_t`` and ``y = |s - c|``

    j_tau(s) = k y^2/2 - <k y - sigma_y>^2 / (2 (k + kappa)) + kappa pi_n.(s - c),

which is convex, so that the part has one solution in a body that is held.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from hemivar.basics.arguments import number
from hemivar.basics.types import Array, BoolArray, Parameter
from hemivar.errors import ProblemError
from hemivar.laws.contact_law import ContactLaw
from hemivar.laws.coupled.shifted import ShiftedLaw
from hemivar.laws.friction import Friction
from hemivar.laws.memory.contact_memory import Energy, LocalStep, Memory, MemoryState, energy_of, kept, slide
from hemivar.laws.named import LawKind, named
from hemivar.laws.parameters import LINE, PRESSURE, RATE, positive
from hemivar.laws.piecewise import PiecewiseQuadratic
from hemivar.laws.transformed import plus
from hemivar.laws.vector_law import VectorLaw

__all__ = ["PlasticBond"]


@named(
    LawKind.MEMORY,
    "plastic-bond",
    "a brittle bond with plastic slip, beside a normal law",
    "beta (stiffness <w>^2 + shear_stiffness |s - pi|^2)/2 + hardening |pi|^2/2, beta 1 until it breaks",
)
@dataclass(frozen=True, eq=False)
class PlasticBond(Memory):
    """A bond beside a normal law, which breaks and has plastic slip that hardens.

    What it is of the slip counts from the beginning of the march.  A bond that is broken does not heal.  The state is
    ``bond``, 1 or 0, and ``plastic_slip``, pi, one column for each tangent.

    Parameters
    ----------
    stiffness, shear_stiffness : Parameter
        k_n and k_t, > 0 (force per area and length).
    energy : Parameter
        a0, what a bond costs, and the fracture energy in opening, > 0 (force per length).
    yield_traction : Parameter
        sigma_y, > 0 (force per area).
    hardening : Parameter
        kappa, > 0 (force per area and length).
    """

    stiffness: Parameter = field(metadata=positive("stiffness of the bond in opening", RATE))
    shear_stiffness: Parameter = field(metadata=positive("stiffness in shear", RATE))
    energy: Parameter = field(metadata=positive("fracture energy in opening", LINE))
    yield_traction: Parameter = field(metadata=positive("traction from which it slips", PRESSURE))
    hardening: Parameter = field(metadata=positive("hardening of the plastic slip", RATE))
    name: ClassVar[str] = "plastic-bond"
    iterates: ClassVar[bool] = True  # type: ignore[misc]
    couples: ClassVar[bool] = True  # type: ignore[misc]

    def __post_init__(self) -> None:
        if not any(map(callable, vars(self).values())):
            self.values()

    @classmethod
    def of_energies(
        cls, stiffness: float, shear_stiffness: float, energy: float, shear_energy: float, yield_traction: float
    ) -> PlasticBond:
        """The bond with the hardening that makes ``shear_energy`` the fracture energy in shear.

        Raises
        ------
        ProblemError
            The yield traction is not reached before the break, or shear costs no more than opening.
        """
        shear_energy = number(shear_energy, "shear_energy of the plastic bond")
        yield_traction = number(yield_traction, "yield_traction of the plastic bond")
        strength = cls(stiffness, shear_stiffness, energy, yield_traction, 1.0).shear_strength
        if yield_traction >= strength:
            raise ProblemError(
                f"yield_traction = {yield_traction:g} of the plastic bond is not reached before the break at "
                f"{strength:g}; take a lower one"
            )
        if not shear_energy > energy:
            raise ProblemError(
                f"shear_energy = {shear_energy:g} of the plastic bond must exceed the energy of opening, {energy:g}: "
                "plastic slip takes the rest"
            )
        hardening = 0.5 * (strength**2 - yield_traction**2) / (shear_energy - energy)
        return cls(stiffness, shear_stiffness, energy, yield_traction, hardening)

    def _number(self, what: str) -> float:
        """A parameter that is one number."""
        value = self.values()[what]
        if value.size != 1:
            raise ProblemError(f"{what} of memory '{self.name}' differs from point to point; take(index) one of them")
        return float(value[0])

    @property
    def shear_strength(self) -> float:
        """Shear traction t_c at which the bond breaks without opening."""
        return float(np.sqrt(2.0 * self._number("shear_stiffness") * self._number("energy")))

    @property
    def shear_energy(self) -> float:
        """Fracture energy in shear, plastic and hardening parts included; that of opening without plastic slip."""
        more = max(self.shear_strength**2 - self._number("yield_traction") ** 2, 0.0)
        return self._number("energy") + 0.5 * more / self._number("hardening")

    def start(self, law: VectorLaw, r: Array) -> MemoryState:
        friction = self.parts_of(law).friction
        if friction.acts:
            raise ProblemError(
                f"the memory '{self.name}' is combined with the friction '{friction.name}' of the same boundary, "
                f"and a bond already resists slip; leave the friction out"
            )
        return kept(bond=np.ones(len(r)), plastic_slip=np.zeros((len(r), r.shape[1] - 1)))

    def law(self, law: VectorLaw, state: MemoryState, step: LocalStep) -> ShiftedLaw:
        """The law of the whole displacement with the bonds that hold at the last iterate, plastic slip minimised."""
        bonded = self._bonded(state, step.before if step.guess is None else step.guess)
        v, m, plastic = self.values(), len(bonded), state["plastic_slip"]
        shear, opening = (np.where(bonded, v[what], 0.0) for what in ("shear_stiffness", "stiffness"))
        zero, none = np.zeros((m, 1)), np.zeros(m)
        springs = PiecewiseQuadratic(zero, np.stack([opening, none], axis=1), zero, name="bond")
        first = np.broadcast_to(v["yield_traction"] / v["shear_stiffness"], (m,))
        later = shear * v["hardening"] / (shear + v["hardening"])
        knots = np.stack([-first, none, first], axis=1)
        slopes = np.stack([later, shear, shear, later], axis=1)
        profile = PiecewiseQuadratic(knots, slopes, np.zeros((m, 3)), -shear * first, name="plastic slip")
        ratio = np.where(bonded, 1.0 + v["hardening"] / v["shear_stiffness"], 0.0)
        pull = np.where(bonded, v["hardening"], 0.0)
        base = ContactLaw(plus(self.parts_of(law).normal, springs), Friction(1.0, profile))
        return ShiftedLaw(base, ratio[:, None] * plastic, pull[:, None] * plastic)

    def _bonded(self, state: MemoryState, r: Array) -> BoolArray:
        """Bonds (m,) that hold at ``r (m, c)``."""
        energy = self._bond_energy(self._plastic(state, r), r)
        return np.asarray((state["bond"] > 0.0) & (energy < self.values()["energy"]))

    def _plastic(self, state: MemoryState, r: Array) -> Array:
        """The plastic slip (m, c - 1) that minimises the energy at ``r (m, c)`` with the bonds of a state."""
        v, old = self.values(), state["plastic_slip"]
        shear = np.where(state["bond"] > 0.0, v["shear_stiffness"], 0.0)
        drive = shear[:, None] * (r[:, 1:] - old) - v["hardening"][:, None] * old
        size = slide(drive)
        flow = np.maximum(size - v["yield_traction"], 0.0) / (shear + v["hardening"])
        return np.asarray(old + (flow / np.where(size > 0.0, size, 1.0))[:, None] * drive)

    def _bond_energy(self, plastic: Array, r: Array) -> Array:
        """Energy per area of an intact bond at ``r (m, c)``, (m,)."""
        v, opening = self.values(), np.maximum(-r[:, 0], 0.0)
        sheared = v["shear_stiffness"] * slide(r[:, 1:] - plastic) ** 2
        return np.asarray(0.5 * (v["stiffness"] * opening**2 + sheared))

    def advance(self, law: VectorLaw, state: MemoryState, step: LocalStep, r: Array, lam: Array) -> MemoryState:
        """A bond that breaks keeps the plastic slip it had there, on the straight way of the step."""
        end = r.copy()
        bonded = self._bonded(state, end)
        broke = (state["bond"] > 0.0) & ~bonded
        if broke.any():
            end[broke] = self._at_break(state, step.before, end)[broke]
        return kept(bond=bonded.astype(float), plastic_slip=self._plastic(state, end))

    def _at_break(self, state: MemoryState, start: Array, end: Array) -> Array:
        """Where on the way the energy of bonds reaches that of a break, (m, c)."""
        low, high = np.zeros((len(end), 1)), np.ones((len(end), 1))
        for _ in range(60):  # to rounding
            middle = 0.5 * (low + high)
            bonded = self._bonded(state, start + middle * (end - start))[:, None]
            low, high = np.where(bonded, middle, low), np.where(bonded, high, middle)
        return np.asarray(start + high * (end - start))

    def past_peak(self, law: VectorLaw, state: MemoryState) -> BoolArray:
        """Where the bond is broken."""
        return np.asarray(state["bond"] < 1.0)

    def stored(self, law: VectorLaw, state: MemoryState, r: Array, inner: Energy | None = None) -> Array:
        """Energy in the law, in bonds and in hardening at ``r (m, c)`` with the whole slip, (m,)."""
        plastic = state["plastic_slip"]
        hardening = 0.5 * self.values()["hardening"] * slide(plastic) ** 2
        return np.asarray(energy_of(law, inner)(r) + state["bond"] * self._bond_energy(plastic, r) + hardening)

    def dissipated(
        self, law: VectorLaw, old: MemoryState, new: MemoryState, step: LocalStep, r: Array, lam: Array
    ) -> Array:
        """For bonds that broke, and for plastic slip."""
        v, flow = self.values(), slide(new["plastic_slip"] - old["plastic_slip"])
        return np.asarray(v["energy"] * (old["bond"] - new["bond"]) + v["yield_traction"] * flow)

    def describe(self) -> str:
        """Energies and tractions, in words."""
        strength, hardening = self.shear_strength, self._number("hardening")
        plastic = max(strength - self._number("yield_traction"), 0.0) / hardening
        slip = plastic + strength / self._number("shear_stiffness")
        opens = np.sqrt(2.0 * self._number("stiffness") * self._number("energy"))
        return "\n".join(
            (
                "plastic bond",
                f"opening           breaks at the traction {opens:.6g}, costs {self._number('energy'):.6g}",
                f"shear             yields at {self._number('yield_traction'):.6g}, breaks at {strength:.6g}, costs "
                f"{self.shear_energy:.6g}",
                f"hardening         {hardening:.6g}",
                f"at the break      plastic slip {plastic:.8g}, slip {slip:.8g} (shear alone)",
            )
        )
