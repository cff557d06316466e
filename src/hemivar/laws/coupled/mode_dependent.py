"""Mode-dependent cohesive law: fracture energy by the mode mixity, J(w, v) with the mode of a state w."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from typing import ClassVar, NoReturn, Self

import numpy as np

from hemivar.basics.arguments import described
from hemivar.basics.arrays import ROUNDED
from hemivar.basics.first_use import cached_property
from hemivar.basics.stated import stating
from hemivar.basics.types import Array, BoolArray, IntArray, Parameter
from hemivar.errors import ProblemError
from hemivar.laws.coupled.cohesion import BilinearCohesion
from hemivar.laws.coupled.criteria import BenzeggaghKenane, FractureCriterion, PowerCriterion
from hemivar.laws.coupled.mixed_mode import MixedMode, stated_compression
from hemivar.laws.coupled.opening import rising_roots
from hemivar.laws.glue import Glue
from hemivar.laws.named import LawKind, named
from hemivar.laws.normal import Compliance, Signorini
from hemivar.laws.parameters import COMPRESSION, LINE, PRESSURE, RATE, evaluate, positive, read_formulas, word
from hemivar.laws.proof import SAMPLED, Constant, Proof, beside, of_alpha
from hemivar.laws.superpotential import Interval, Superpotential
from hemivar.laws.vector_law import Linearisation, OnGraph, lengths, polar, spread

__all__ = ["KeptModeGlue", "ModeDependentGlue"]

#: Modes at which constants are looked for.
_MODES = np.linspace(0.0, 1.0, 2001)


@dataclass(frozen=True, eq=False)
class ModeDependentGlue(Glue):
    """Bilinear glue with a fracture energy for opening and another one for shear, as ``J(w, v)``.

    In a state w the mode is ``B(w) = ratio^2 s^2 / max(rho, rho_min)^2`` with the effective opening
    ``rho = sqrt(<w_n>^2 + ratio^2 |s|^2)`` and ``ratio^2 = shear stiffness / stiffness``; rho_min is the least rho at
    which any mode is damaged; below it the mode has no effect. The law in v is :class:`MixedMode` with the fracture
    energy G_c(B) and the first damage of that mode.  A solution is a fixed point, w = v; :class:`FixedPoint` finds it.

    There is no potential of both modes: a superpotential that debonds has one fracture energy.  The work to break
    depends on the way.  The shear stiffness is by default that of Turon, Camanho, Costa and Renart (2010),
    ``stiffness (G_Ic/G_IIc) (shear strength / strength)^2``: the damage at a given rho/rho_0 is then the same in all
    modes of Benzeggagh and Kenane's criterion.

    Parameters
    ----------
    strength, shear_strength : Parameter
        Largest tractions in opening and in shear, > 0 (force per area).
    stiffness : Parameter
        Initial stiffness in opening, > 0 (force per area and length).
    criterion : FractureCriterion
        :class:`BenzeggaghKenane` or :class:`PowerCriterion`.
    shear_stiffness : Parameter, optional
    compression : Superpotential
        As that of :class:`MixedMode`.

    Raises
    ------
    ProblemError
        A parameter is not positive, or the fracture energy of a mode is less than what is stored at its strength.

    Examples
    --------
    >>> import hemivar as hv
    >>> criterion = hv.laws.BenzeggaghKenane(opening=0.4, shear=1.2, exponent=2.0)
    >>> epoxy = hv.laws.ModeDependentGlue(strength=20.0, shear_strength=18.0, stiffness=7490.0, criterion=criterion)
    """

    strength: Parameter = field(metadata=positive("largest traction in opening", PRESSURE, 80.0))
    shear_strength: Parameter = field(metadata=positive("largest traction in shear", PRESSURE, 100.0))
    stiffness: Parameter = field(metadata=positive("initial stiffness in opening", RATE, 1e6))
    criterion: FractureCriterion
    shear_stiffness: Parameter | None = field(
        default=None, metadata=positive("initial stiffness in shear; left out: as Turon et al.", RATE)
    )
    compression: Superpotential = field(default_factory=Signorini)
    name: ClassVar[str] = "mode-dependent"  # type: ignore[misc]

    def __post_init__(self) -> None:
        read_formulas(self, f"law '{self.name}'")
        if not isinstance(self.criterion, FractureCriterion):
            raise ProblemError(
                f"the criterion of law '{self.name}' is {described(self.criterion)}; give "
                "BenzeggaghKenane(opening, shear, exponent) or PowerCriterion(opening, shear, exponent)"
            )
        MixedMode(BilinearCohesion(1.0, 1.0, 1.0), compression=self.compression)  # refuses another compression

    _numbers: ClassVar[tuple[str, ...]] = ("strength", "shear_strength", "stiffness", "shear_stiffness")

    def _values(self, points: Array | None) -> dict[str, Array]:
        given = {what: getattr(self, what) for what in self._numbers if getattr(self, what) is not None}
        return {what: evaluate(v, points, f"{what} of law '{self.name}'", above=0.0) for what, v in given.items()}

    def at(self, points: Array | None) -> ModeDependentGlue:
        made = replace(
            self,
            **self._values(points),  # type: ignore[arg-type]
            criterion=self.criterion.at(points),
            compression=self.compression.at(points),
        )
        first, last = made._table[0], made._table[2]
        if (last <= first).any():
            mode = float(_MODES[int(np.argmax((last <= first).any(axis=1)))])
            raise ProblemError(
                f"law '{self.name}': in the mode {mode:g} (0 opening, 1 shear) the fracture energy is less than is "
                "stored at the strength; take a lower strength or more energy"
            )
        made._frozen(np.zeros(1))
        return made

    def take(self, index: IntArray) -> Self:
        taken = {key: value if value.size == 1 else value[index] for key, value in self._values(None).items()}
        return replace(
            self,
            **taken,  # type: ignore[arg-type]
            criterion=self.criterion.take(index),
            compression=self.compression.take(index),
        )

    @property
    def stated(self) -> Mapping[str, object] | None:
        """The law by its name and parameters, as problem files have it; None where a part has no name."""
        known, pushes = stated_compression(self.compression)
        if not known:
            return None
        energies = self.criterion
        return {
            "law": self.name,
            **{what: getattr(self, what) for what in self._numbers},
            "energy": energies.opening,
            "shear_energy": energies.shear,
            "exponent": energies.exponent,
            "criterion": energies.name,
            "compression": pushes,
        }

    @property
    def not_separable(self) -> str:
        return f"law '{self.name}' couples opening and slip, and depends on the mode"

    # ---- the mode ----------------------------------------------------------------------------------------

    @cached_property
    def _own(self) -> dict[str, Array]:
        """Parameters at the contact points, (m or 1,)."""
        return self._values(None)

    @cached_property
    def ratio(self) -> Array:
        """Root of the shear stiffness over the stiffness, (m or 1,)."""
        own = self._own
        if "shear_stiffness" in own:
            return np.sqrt(own["shear_stiffness"] / own["stiffness"])
        opening, shear, _ = self.criterion.values()
        return np.asarray(np.sqrt(opening / shear) * own["shear_strength"] / own["strength"])

    @cached_property
    def _first(self) -> tuple[Array, Array]:
        """rho of first damage in opening and in shear, (m or 1,) each."""
        own = self._own
        return own["strength"] / own["stiffness"], own["shear_strength"] / (self.ratio * own["stiffness"])

    @property
    def least_damage(self) -> Array:
        """rho_min, the least effective opening at which some mode is damaged, (m or 1,)."""
        return np.minimum(*self._first)

    def _curve(self, mode: Array) -> tuple[Array, Array, Array, Array]:
        """rho of first damage and of the break, each with its derivative by the mode."""
        stiffness, (first, second) = self._own["stiffness"], self._first
        first_damage, rate = self.criterion.onset(mode, first, second)
        energy, energy_rate = self.criterion.energy(mode)
        last = 2.0 * energy / (stiffness * first_damage)
        with np.errstate(invalid="ignore"):
            return first_damage, rate, last, last * (energy_rate / energy - rate / first_damage)

    @cached_property
    def _table(self) -> tuple[Array, Array, Array, Array]:
        """:meth:`_curve` at the modes that are looked at, (k, m or 1)."""
        place, rate, last, last_rate = self._curve(_MODES[:, None])
        return place, rate, last, last_rate

    def effective(self, r: Array) -> Array:
        """rho of local displacements (m, c)."""
        opening = np.maximum(-r[:, 0], 0.0)
        return opening if r.shape[1] == 1 else np.hypot(opening, self.ratio * lengths(r[:, 1:]))

    def mode(self, r: Array) -> Array:
        """B of states (m, c): 0 in opening, 1 in shear; below the first damage of any mode it falls to 0."""
        if r.shape[1] == 1:
            return np.zeros(len(r))
        rho = np.maximum(self.effective(r), self.least_damage)
        return np.asarray(np.minimum((self.ratio * lengths(r[:, 1:]) / rho) ** 2, 1.0))

    def at_mode(self, mode: float) -> MixedMode:
        """The law of all states of one mode, 0 in opening and 1 in shear.

        Raises
        ------
        ProblemError
            The mode is not between 0 and 1.
        """
        if not 0.0 <= mode <= 1.0:
            raise ProblemError(f"mode = {mode}; give a number between 0, opening, and 1, shear")
        return self._frozen(np.full(1, float(mode)))

    def _frozen(self, mode: Array) -> MixedMode:
        stiffness = self._own["stiffness"]
        onset, _, _, _ = self._curve(mode)
        cohesion = BilinearCohesion(stiffness * onset, self.criterion.energy(mode)[0], stiffness)
        return MixedMode(cohesion, self.ratio, self.compression).at(None)

    @property
    def state_dependent(self) -> bool:
        return True

    @property
    def depends_on_whole_state(self) -> bool:
        return True

    @property
    def follows_state(self) -> bool:
        """Where the Lipschitz constant is finite: then a scalar equation tells the mode."""
        return bool(np.isfinite(self.lipschitz).all())

    def frozen(self, r: Array, lam: Array) -> MixedMode:
        return self._frozen(self.mode(r))

    def traction(self, r: Array) -> Array:
        """Multipliers (m, c) of states whose mode is their own; where the compression leaves a choice, the least."""
        return self.nearest_multiplier(r, np.zeros(r.shape))

    @property
    def lipschitz(self) -> Array:
        return self._steers

    @cached_property
    def _steers(self) -> Array:
        """Lipschitz constant of the tractions of J(w, v) in the state w, (m or 1,): for the smallness condition (H_s).

        The traction changes with the mode by ``max((K + k) |rho_0'|, k |rho_f'|)`` at most, the mode with the state by
        ``max(2 ratio, 1) / rho_min``.  Sampled over the modes; infinite for a Benzeggagh-Kenane exponent below 1.
        """
        onset, rate, last, last_rate = self._table
        stiffness, largest = self._own["stiffness"], np.maximum(self.ratio, 1.0)
        fall = stiffness * onset / (last - onset)
        by_mode = np.maximum((stiffness + fall) * np.abs(rate), fall * np.abs(last_rate)).max(axis=0)
        lipschitz = np.asarray(largest * by_mode * np.maximum(2.0 * self.ratio, largest) / self.least_damage)
        return np.where(np.isnan(lipschitz), np.inf, lipschitz)

    def describe(self, point: int = 0) -> str:
        """Energies, openings and constants at one contact point, in words."""
        single = self.take(np.array([point]))
        onset, _, last, _ = single._table
        energies = single.criterion.values()
        alphas = [float(alpha[0]) for alpha in single.weak_convexity]
        return "\n".join(
            (
                f"law {self.name}: {self.criterion.name}, exponent {float(energies[2][0]):g}; in penetration "
                f"{self.compression.name}",
                f"fracture energy   {float(energies[0][0]):.6g} in opening, {float(energies[1][0]):.6g} in shear",
                f"shear stiffness   {float((single.ratio**2 * single._own['stiffness'])[0]):.6g}",
                f"softens           from the opening {onset[0, 0]:.6g} on, or the slip "
                f"{onset[-1, 0] / float(single.ratio[0]):.6g}",
                f"lets go           at the opening {last[0, 0]:.6g}, or the slip "
                f"{last[-1, 0] / float(single.ratio[0]):.6g}",
                f"alpha             {alphas[0]:.6g} for the opening, {alphas[1]:.6g} for the slip, whatever the mode",
                f"m_L               {float(single.lipschitz[0]):.6g}, Lipschitz constant in the state (sampled)",
            )
        )

    # ---- there is no potential ---------------------------------------------------------------------------

    def _refuse(self) -> NoReturn:
        raise ProblemError(
            f"law '{self.name}' has no potential: a superpotential that debonds has one fracture energy, "
            "and this one depends on the mode; freeze the mode, frozen(r, lam), or take MixedMode"
        )

    def value(self, r: Array) -> Array:
        self._refuse()

    def stored_energy(self, r: Array) -> Array:
        raise ProblemError(
            f"law '{self.name}' has no potential in time without its memory, the mode of onset; leave memory = () out, "
            "or take MixedMode"
        )

    # ---- glue that remembers ----------------------------------------------------------------------------

    def damaged(self, known: Mapping[str, Array] | None, r: Array) -> dict[str, Array]:
        """Beside the opening and the stiffness the ``mode`` at which damage began, -1 where it has not.

        From then on the law is a potential Phi_m of rho, of the energy G_c(m) of this mode, along the secant k(D) up
        to the largest rho, D.  Every way r(t) to the break dissipates G_c(m), whatever its modes are:

        1. stored is ``k rho^2/2`` for rho <= D, and the power of the traction is ``k rho rho'``, as that is what it
           stores while D stays;
        2. while D = rho grows the power is ``Phi_m'(D) D'``, for ``k(D) D = Phi_m'(D)``, so that
           ``(Phi_m - k D^2/2)'`` is what is lost;
        3. from the onset, where ``Phi_m = k D^2/2``, to the break, where ``k = 0``, this is ``Phi_m(rho_f) = G_c(m)``.
        """
        rho, last = self.effective(r), np.full(len(r), -1.0) if known is None else known["mode"]
        mode = np.where(last >= 0.0, last, self.mode(r))
        glue = self._frozen(mode)
        began = (last >= 0.0) | (rho > glue.opening_at_peak * (1.0 + ROUNDED))
        opening = np.minimum(rho if known is None else np.maximum(rho, known["opening"]), glue.opening_at_break)
        stiffness = np.where(began, glue.secant_stiffness(opening), self._own["stiffness"])
        return {"opening": opening, "stiffness": stiffness, "mode": np.where(began, mode, -1.0)}

    def unloading(self, known: Mapping[str, Array]) -> KeptModeGlue:
        own = {parameter.name: getattr(self, parameter.name) for parameter in fields(ModeDependentGlue)}
        return KeptModeGlue(**own, kept=known["mode"], reached=known["opening"])

    def spent_by(self, known: Mapping[str, Array]) -> Array:
        spent = self._frozen(np.maximum(known["mode"], 0.0)).spent_by(known)
        return np.where(known["mode"] >= 0.0, spent, 0.0)

    def softened(self, known: Mapping[str, Array]) -> BoolArray:
        return np.asarray(known["mode"] >= 0.0)

    def local_argmin(self, a: Array, b: Array) -> Array:
        self._refuse()

    def local_minimiser(self, a: Array, b: Array, r: Array) -> Array:
        self._refuse()

    def on_graph(self, p: Array, a: Array) -> OnGraph:
        """The pair whose mode is its own, for ``p = a r + lam``: a scalar equation in the mode.

        Raises
        ------
        ProblemError
            ``a`` is too small: there may be several such pairs.
        """
        enough = self.curve_above[0]
        if not (a > enough[:, None]).all():
            raise ProblemError(
                f"law '{self.name}' is a curve for stiffnesses above {float(enough.max()):.6g}, its weak convexity "
                f"plus the Lipschitz constant of its mode, and {float(a.min()):.6g} is not; give a larger a"
            )
        ratio, opens, (pull, heading) = self.ratio, p[:, 0] < 0.0, polar(p[:, 1:])
        flat = np.stack(np.broadcast_arrays(a[:, 0], a[:, 1] / ratio**2), axis=1)
        force = np.column_stack([np.where(opens, -p[:, 0], 0.0), pull / ratio])
        m, by = self._secants(flat, force)
        loose = 1.0 / (flat + m[:, None])
        opening, turned = force * loose, -(force * loose**2)[:, :, None] * by[:, None, :]
        pressed = np.maximum(self.compression.local_argmin(a[:, 0], np.maximum(p[:, 0], 0.0)), 0.0)
        bend = self.compression.curvature(np.maximum(pressed, np.finfo(float).tiny))
        give = np.where(self.compression.at_kink(pressed), 0.0, 1.0 / (a[:, 0] + bend))
        r = np.column_stack([np.where(opens, -opening[:, 0], pressed), (opening[:, 1] / ratio)[:, None] * heading])
        jacobian = np.zeros((*p.shape, p.shape[1]))
        jacobian[:, 0, 0] = np.where(opens, loose[:, 0] + turned[:, 0, 0], give)
        for (row, column), turn in (((0, slice(1, None)), turned[:, 0, 1]), ((slice(1, None), 0), turned[:, 1, 0])):
            jacobian[:, row, column] = np.where(opens, -turn / ratio, 0.0)[:, None] * heading
        outer = heading[:, :, None] * heading[:, None, :]
        jacobian[:, 1:, 1:] = (loose[:, 1] / ratio**2)[:, None, None] * np.eye(p.shape[1] - 1)
        jacobian[:, 1:, 1:] += (turned[:, 1, 1] / ratio**2)[:, None, None] * outer
        return OnGraph(r, p - spread(a, p.shape[1]) * r, jacobian)

    def _secants(self, flat: Array, force: Array) -> tuple[Array, Array]:
        """The secant ``m = T/rho`` (m,) of pairs in their own modes, and how it moves with the force, (m, 2).

        In opening and effective slip: ``force (m, 2)`` over stiffnesses ``flat + m`` is where they are, so that one
        equation in m tells rho and the mode.
        """
        intact, reached = self._until
        rho, mode = self._where(force / (flat + intact[:, None]))
        elastic = rho <= np.maximum(self._curve(mode)[0], reached)
        rho, mode = self._where(force / flat)
        broken = rho >= self._curve(mode)[2]
        high = np.where(broken & ~elastic, 0.0, intact)
        low = np.where(elastic, high, 0.0)
        m = rising_roots(lambda m: self._missed(flat, force, m)[:3], low, high)
        _, rate, _, by_force = self._missed(flat, force, m)
        softening = ~elastic & ~broken
        return m, -np.where(softening[:, None], by_force, 0.0) / np.where(softening, rate, 1.0)[:, None]

    def _missed(self, flat: Array, force: Array, m: Array) -> tuple[Array, Array, Array, Array]:
        """``m rho - T`` (m,) where glue softens, its derivative by m, the size of both parts, and that by the force."""
        loose = 1.0 / (flat + m[:, None])
        opening = force * loose
        rho, mode = self._where(opening)
        some, stiffness = np.where(rho > 0.0, rho, 1.0), self._own["stiffness"]
        first, first_rate, last, last_rate = self._curve(mode)
        wide, steers = last - first, self._steering
        left, fall = (last - rho) / wide, stiffness * first / wide
        by_mode = stiffness * (first_rate * left + first * (last_rate - left * (last_rate - first_rate)) / wide)
        share = opening / some[:, None]  # of rho by opening and slip

        def rate(direction: Array) -> Array:
            """The derivative along a direction (m, 2) of opening and slip, m rho counted at fixed m."""
            along = np.einsum("mi,mi->m", share, direction)
            turn = 2.0 * (share[:, 1] * direction[:, 1] - mode * along) / some
            return np.asarray((m + fall) * along - np.where(steers, by_mode, 0.0) * turn)

        none = np.zeros(len(m))
        by_force = [rate(np.column_stack(direction)) for direction in ((loose[:, 0], none), (none, loose[:, 1]))]
        pull = stiffness * first * left
        return m * rho - pull, rho + rate(-opening * loose), m * rho + np.abs(pull), np.stack(by_force, axis=1)

    def _where(self, opening: Array) -> tuple[Array, Array]:
        """rho and the mode of an opening and an effective slip (m, 2)."""
        rho = np.hypot(opening[:, 0], opening[:, 1])
        return rho, np.minimum((opening[:, 1] / np.maximum(rho, self.least_damage)) ** 2, 1.0)

    @property
    def _steering(self) -> BoolArray:
        """Where the mode is that of the state, (m or 1,)."""
        return np.ones(1, dtype=bool)

    @property
    def _until(self) -> tuple[Array, Array]:
        """The secant stiffness, and the effective opening up to which it holds where that is past the first damage."""
        return self._own["stiffness"], np.zeros(1)

    # ---- what is asked of a state, in its own mode -------------------------------------------------------

    def nearest_multiplier(self, r: Array, lam: Array) -> Array:
        return self._frozen(self.mode(r)).nearest_multiplier(r, lam)

    def clamp(self, start: Array, end: Array) -> Array:
        return self._frozen(self.mode(start)).clamp(start, end)

    def linearise(self, r: Array) -> Linearisation:
        """At the mode of r, which counts as constant."""
        return self._frozen(self.mode(r)).linearise(r)

    def moves(self, r: Array, small: float) -> BoolArray:
        return self._frozen(self.mode(r)).moves(r, small)

    def past_peak(self, r: Array, pull: Array | None = None, near: float = 0.0, slack: float = 0.0) -> BoolArray:
        return self._frozen(self.mode(r)).past_peak(r, pull, near, slack)

    def debonding(self, r: Array) -> dict[str, Array]:
        return self._frozen(self.mode(r)).debonding(r)

    def resistance(self, r: Array, lam: Array) -> Array:
        return self._frozen(self.mode(r)).resistance(r, lam)

    # ---- whatever the mode -------------------------------------------------------------------------------

    @property
    def _pure(self) -> tuple[MixedMode, MixedMode]:
        return self._frozen(np.zeros(1)), self._frozen(np.ones(1))

    def recession(self, direction: Array) -> Array:
        return self._pure[0].recession(direction)

    def strongest(self, rest: Array, size: float) -> tuple[Array, Array, Array]:
        opening, shear = (law.strongest(rest, size) for law in self._pure)
        return np.minimum(opening[0], shear[0]), np.minimum(opening[1], shear[1]), np.minimum(opening[2], shear[2])

    def asymptotic_curvature(self, sign: float) -> tuple[Array, Array]:
        return self._pure[0].asymptotic_curvature(sign)

    @cached_property
    def _falls(self) -> Array:
        onset, _, last, _ = self._table
        return np.asarray(self._own["stiffness"] * onset / (last - onset))

    @property
    def weak_convexity(self) -> tuple[Array, Array]:
        fall = self._falls.max(axis=0)
        return fall, np.asarray(fall * self.ratio**2)

    def proof(self, constant: Constant) -> Proof:
        turon = self.shear_stiffness is None and isinstance(self.criterion, BenzeggaghKenane)  # one rate in all modes
        known = Proof() if constant == "growth" or (constant == "alpha" and turon) else SAMPLED
        return of_alpha(beside(known, known), lambda part: self.weak_convexity[part]) if constant == "alpha" else known

    @property
    def penetrations(self) -> Interval:
        return self.compression.domain

    @property
    def penetration_knots(self) -> Array:
        return self._pure[0].penetration_knots


@dataclass(frozen=True, eq=False)
class KeptModeGlue(ModeDependentGlue):
    """The law of a step of glue that keeps the mode at which damage began: :meth:`ModeDependentGlue.damaged`."""

    kept: Array = field(kw_only=True)  # the mode of each contact point, (m,); -1 where it is that of the state still
    reached: Array = field(kw_only=True)  # largest effective opening so far, (m,)

    def take(self, index: IntArray) -> Self:
        return replace(super().take(index), kept=self.kept[index], reached=self.reached[index])

    @cached_property
    def _keeps(self) -> BoolArray:
        return np.asarray(self.kept >= 0.0)

    @cached_property
    def _damage(self) -> dict[str, Array]:
        return {"opening": np.where(self._keeps, self.reached, 0.0)}

    def mode(self, r: Array) -> Array:
        return np.where(self._keeps, self.kept, super().mode(r))

    def _frozen(self, mode: Array) -> MixedMode:
        law = super()._frozen(mode)
        return law if len(mode) < len(self.kept) else law.unloading(self._damage)

    def _where(self, opening: Array) -> tuple[Array, Array]:
        rho, mode = super()._where(opening)
        return rho, np.where(self._keeps, self.kept, mode)

    @property
    def _steering(self) -> BoolArray:
        return ~self._keeps

    @property
    def _until(self) -> tuple[Array, Array]:
        known, kept = self._damage["opening"], self._frozen(np.maximum(self.kept, 0.0))
        return np.asarray(kept.secant_stiffness(known)), known

    def stored_energy(self, r: Array) -> Array:
        return self._frozen(self.mode(r)).value(r)

    @property
    def lipschitz(self) -> Array:
        return np.where(self._keeps, 0.0, self._steers)

    @property
    def weak_convexity(self) -> tuple[Array, Array]:
        live, kept = super().weak_convexity, self._frozen(np.maximum(self.kept, 0.0)).weak_convexity
        normal, tangential = (np.where(self._keeps, own, free) for own, free in zip(kept, live, strict=True))
        return normal, tangential


@named(
    LawKind.NORMAL,
    "mode-dependent",
    "bilinear glue with separate fracture energies in opening and shear, by the mode of the solution "
    "(no potential: solved by fixed point); includes friction",
    "J(w, v) = Phi_B(w)(rho(v)), with the mode B of the state w",
)
@stating(
    ModeDependentGlue,
    energy=positive("fracture energy in opening, G_Ic", LINE, 0.969),
    shear_energy=positive("fracture energy in shear, G_IIc", LINE, 1.719),
    exponent=positive("eta or p of the criterion", "1", 2.284),
    criterion=word("how modes mix", BenzeggaghKenane.name, PowerCriterion.name),
    compression=COMPRESSION,
)
def _by_values(
    strength: Parameter,
    shear_strength: Parameter,
    energy: Parameter,
    shear_energy: Parameter,
    stiffness: Parameter,
    exponent: Parameter,
    criterion: str = "benzeggagh-kenane",
    shear_stiffness: Parameter | None = None,
    compression: Parameter | None = None,
) -> ModeDependentGlue:
    of = PowerCriterion if criterion == PowerCriterion.name else BenzeggaghKenane
    shut = Signorini() if compression is None else Compliance(compression)
    return ModeDependentGlue(
        strength, shear_strength, stiffness, of(energy, shear_energy, exponent), shear_stiffness, shut
    )
