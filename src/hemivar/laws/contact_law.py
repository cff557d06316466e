"""Contact law of a point: a normal superpotential and radial friction, split into normal and tangential parts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from hemivar.basics.arguments import described
from hemivar.basics.first_use import cached_property
from hemivar.basics.types import Array, BoolArray
from hemivar.errors import MethodError, ProblemError
from hemivar.laws.compiled_law import CompiledLaw
from hemivar.laws.consistency import check_own
from hemivar.laws.contact_chart import ContactChart, GraphTables, follow
from hemivar.laws.crossings import Crossings, crossings, length_places, level_places
from hemivar.laws.friction import Friction, NoFriction, OrthotropicFriction
from hemivar.laws.friction.bounds import StateBound, stack_bounds
from hemivar.laws.minimisers import nearest_pair, piece_bounds
from hemivar.laws.normal_and_friction import NormalAndFriction
from hemivar.laws.piecewise_law import stack
from hemivar.laws.proof import Constant, Proof
from hemivar.laws.scalar_graph import (
    is_continuous,
    kink_within,
    local_minimiser,
    one_sided,
    prox_slope,
    radial_sides,
    steepest,
)
from hemivar.laws.superpotential import Superpotential
from hemivar.laws.vector_law import Chart, Linearisation, OnGraph, Sides, VectorLaw, lengths, polar, spread

__all__ = ["ContactLaw", "separable"]


@dataclass(frozen=True, eq=False)
class ContactLaw(NormalAndFriction):
    """The law that splits: j(r) = j_nu(r_nu) + h_tau j_tau(|r_tau|) at every contact point.

    The bound h_tau may depend on penetration or pressure (:class:`~hemivar.laws.StateBound`); then only the parts
    that do not need it answer, until :meth:`frozen` evaluates it.

    With one local component (a bar, a membrane) there is no slip, and friction answers nothing.

    Parameters
    ----------
    normal : Superpotential
        Normal law j_nu.
    friction : Friction
        Friction law h_tau j_tau; none by default.

    Examples
    --------
    >>> import hemivar as hv
    >>> law = hv.laws.ContactLaw(hv.Signorini(), hv.Tresca(0.5)).at(None)
    >>> law.state_dependent
    False
    """

    normal: Superpotential
    friction: Friction = field(default_factory=NoFriction)

    def __post_init__(self) -> None:
        if isinstance(self.normal, Friction) and isinstance(self.friction, Superpotential):
            raise ProblemError("the normal law and the friction law are swapped; give the normal law first")
        if not isinstance(self.normal, Superpotential):
            raise ProblemError(
                f"the normal law must be a superpotential such as ThresholdCompliance, not {described(self.normal)}"
            )
        if not isinstance(self.friction, Friction):
            raise ProblemError(
                f"the friction law must be a Friction such as Tresca(0.5), not {described(self.friction)}"
            )
        if isinstance(self.friction, OrthotropicFriction):
            raise ProblemError(
                "orthotropic friction depends on the direction of the slip; take OrthotropicLaw(normal, friction)"
            )
        check_own(self.normal)

    @property
    def tangential_name(self) -> str:
        return self.tangential.name

    @property
    def not_separable(self) -> str:
        return ""

    @cached_property
    def tangential(self) -> Superpotential:
        """The even scalar law h_tau j_tau."""
        return self.friction.radial

    @cached_property
    def _compiled(self) -> CompiledLaw | None:
        """The law in the compiled kernels; None where these are not there, or do not know it."""
        friction = self.friction
        return None if self.state_dependent else CompiledLaw.of(self.normal, friction.profile, friction.bounds)

    def scalar_laws(self, components: int) -> tuple[Superpotential, ...]:
        """The normal law, and the tangential one where there are tangents."""
        return (self.normal,) if components == 1 else (self.normal, self.tangential)

    @property
    def follows_state(self) -> bool:
        """Whether Newton's equation can contain how the friction bound depends on the state.

        The bound has derivatives, and the profile goes on for ever and falls nowhere at once.
        """
        bound, profile = self.friction.bound, self.friction.profile
        if not isinstance(bound, StateBound) or not bound.differentiable:
            return False
        return bool(np.isfinite(profile.weak_convexity).all() and np.isposinf(profile.domain.upper).all())

    def is_function(self, components: int) -> bool:
        return not self.state_dependent and all(is_continuous(law) for law in self.scalar_laws(components))

    @staticmethod
    def concatenate(laws: Sequence[tuple[ContactLaw, int]]) -> ContactLaw:
        """One law from laws for consecutive blocks of contact points, given as ``(law, number of points)``."""
        laws = [(law, count) for law, count in laws if count > 0]
        if len(laws) == 1:
            return laws[0][0]
        if not laws:
            raise ProblemError("no contact point is left for a law; choose at least one")
        bound: Array | StateBound
        if any(law.state_dependent for law, _ in laws):
            bound = stack_bounds(
                [
                    (law.friction.bound if isinstance(law.friction.bound, StateBound) else law.friction.bounds, count)
                    for law, count in laws
                ]
            )
        else:
            bound = np.concatenate([np.broadcast_to(law.friction.bounds, (count,)) for law, count in laws])
        profiles = [(law.friction.profile, count) for law, count in laws]
        same = all(profile is profiles[0][0] for profile, _ in profiles)
        return ContactLaw(
            stack([(law.normal, count) for law, count in laws]),
            Friction(bound, profiles[0][0] if same else stack(profiles)),
        )

    # ---- scalar questions, answered for the vector r ---------------------------------------------------

    def value(self, r: Array) -> Array:
        if self._compiled is not None:
            return self._compiled.value(r)
        value = self.normal.value(r[:, 0])
        return value + self.tangential.value(lengths(r[:, 1:])) if r.shape[1] > 1 else value

    def distance(self, r: Array, lam: Array) -> Array:
        normal = self.normal.distance(r[:, 0], lam[:, 0])
        if r.shape[1] == 1:
            return normal
        size, direction = polar(r[:, 1:])
        along = np.einsum("mi,mi->m", direction, lam[:, 1:])
        across = lengths(lam[:, 1:] - along[:, None] * direction)
        moving = np.hypot(self.tangential.distance(size, along), across)
        resting = self.tangential.distance(size, lengths(lam[:, 1:]))
        return np.hypot(normal, np.where(size > 0.0, moving, resting))

    def graph_distance(self, r: Array, lam: Array, tau: Array) -> Array:
        if self._compiled is not None:
            return self._compiled.graph_distance(r, lam, tau)
        normal = self.normal.graph_distance(r[:, 0], lam[:, 0], tau[:, 0])
        if r.shape[1] == 1:
            return normal
        size, direction = polar(r[:, 1:])
        along = np.einsum("mi,mi->m", direction, lam[:, 1:])
        across = lengths(lam[:, 1:] - along[:, None] * direction)
        moving = np.hypot(self.tangential.graph_distance(size, along, tau[:, 1]), across)
        to_rest = self.tangential.distance(np.zeros_like(size), lengths(lam[:, 1:]))
        resting = np.hypot(size / tau[:, 1], to_rest)
        return np.hypot(normal, np.minimum(np.where(size > 0.0, moving, np.inf), resting))

    def nearest_multiplier(self, r: Array, lam: Array) -> Array:
        if self._compiled is not None:
            return self._compiled.nearest_multiplier(r, lam)
        out, law = np.empty_like(lam), self.normal
        interval = law.subdifferential(np.clip(r[:, 0], law.domain.lower, law.domain.upper))
        out[:, 0] = np.clip(lam[:, 0], interval.lower, np.maximum(interval.lower, interval.upper))
        if r.shape[1] > 1:
            size, direction = polar(r[:, 1:])
            law = self.tangential
            interval = law.subdifferential(np.minimum(size, law.domain.upper))
            along = np.clip(np.einsum("mi,mi->m", direction, lam[:, 1:]), interval.lower, interval.upper)
            length, heading = polar(lam[:, 1:])
            rest = np.minimum(length, np.maximum(interval.upper, 0.0))
            out[:, 1:] = np.where((size > 0.0)[:, None], along[:, None] * direction, rest[:, None] * heading)
        return out

    def clamp(self, start: Array, end: Array) -> Array:
        if self._compiled is not None:
            return self._compiled.clamp(start, end)
        out, law = end.copy(), self.normal
        out[:, 0] = np.clip(end[:, 0], *piece_bounds(law, law.piece_of(start[:, 0])))
        if end.shape[1] > 1:
            law, (length, heading), (size, own) = self.tangential, polar(end[:, 1:]), polar(start[:, 1:])
            low, high = piece_bounds(law, law.piece_of(size))
            forwards = np.einsum("mi,mi->m", own, end[:, 1:]) > 0.0
            out[:, 1:] = np.where(
                forwards[:, None], np.clip(length, low, high)[:, None] * heading, np.maximum(low, 0.0)[:, None] * own
            )
        return out

    def crossings(self, r: Array, direction: Array) -> Crossings | None:
        rubs = r.shape[1] > 1 and bool(self.rubs.any())
        laws = self.scalar_laws(2 if rubs else 1)
        if (rubs and r.shape[1] > 2) or not all(law.straight for law in laws):
            return None
        return Crossings.joined([crossings(law, r[:, c], direction[:, c]) for c, law in enumerate(laws)])

    def kinks_along(self, start: Array, end: Array, bend: Array) -> Array:
        normal = super().kinks_along(start, end, bend)
        if start.shape[1] == 1:
            return normal
        knots = (self.friction.profile if self.state_dependent else self.tangential).knots
        if start.shape[1] > 2:
            return np.concatenate([normal, length_places(np.abs(knots), start[:, 1:], end[:, 1:])], axis=1)
        both = np.concatenate([knots, -knots], axis=1)
        return np.concatenate([normal, level_places(both, start[:, 1], end[:, 1], bend[:, 1])], axis=1)

    def local_argmin(self, a: Array, b: Array) -> Array:
        minimiser = None if self._compiled is None else self._compiled.local_argmin(a, b)
        if minimiser is not None:
            return minimiser
        r = np.empty(b.shape)
        r[:, 0] = self.normal.local_argmin(a[:, 0], b[:, 0])
        if b.shape[1] > 1:
            size, direction = polar(b[:, 1:])
            length = np.abs(self.tangential.local_argmin(a[:, 1], size))
            r[:, 1:] = length[:, None] * np.where(size[:, None] > 0.0, direction, _first_axis(direction))
        return r

    def on_graph(self, p: Array, a: Array) -> OnGraph:
        bound = self.friction.bound
        if not isinstance(bound, StateBound):
            each = spread(a, p.shape[1])
            r = self.local_argmin(a, p)
            return OnGraph(r, p - each * r, self._prox_jacobian(p / each, 1.0 / a) / each[:, None, :])
        normal = ContactLaw(self.normal).on_graph(p[:, :1], a)
        penetration, pressure = normal.r[:, 0], normal.multiplier[:, 0]
        at_bound = ContactLaw(self.normal, self.friction.frozen(penetration, pressure)).on_graph(p, a)
        if p.shape[1] == 1 or not self.follows_state:
            return at_bound
        size, slopes = bound.value(penetration, pressure), bound.slopes(penetration, pressure)
        follow(at_bound.jacobian, at_bound.multiplier, size, slopes, a[:, 0], normal.jacobian[:, 0, 0])
        return at_bound

    @property
    def curve_above(self) -> tuple[Array, Array]:
        return (self.normal.weak_convexity, np.zeros(1)) if self.state_dependent else self.weak_convexity

    def chart(self, a: Array, components: int) -> Chart | None:
        """As of every law, by tables; where a law is no curve these follow the piece that p lies on."""
        if self.state_dependent and not self.follows_state:
            return None
        apart = self.state_dependent and components > 1
        tables = GraphTables.of((self.normal,) if apart else self.scalar_laws(components), a)
        slip = GraphTables.of((self.friction.profile,), a[:, 1:]) if apart else None
        if tables is None or (apart and slip is None):
            return super().chart(a, components)
        bound = self.friction.bound
        if not (apart and isinstance(bound, StateBound)):
            return ContactChart(self, a, tables, slip)
        return ContactChart(self, a, tables, slip, bound, (self.normal, self.friction.profile))

    def _prox_jacobian(self, x: Array, tau: Array) -> Array:
        m, d = x.shape
        jacobian = np.zeros((m, d, d))
        jacobian[:, 0, 0] = prox_slope(self.normal, x[:, 0], tau[:, 0])
        if d > 1:
            size, direction = polar(x[:, 1:])
            length = self.tangential.prox(size, tau[:, 1])
            slope = prox_slope(self.tangential, size, tau[:, 1])
            ratio = np.where(size > 0.0, length / np.where(size > 0.0, size, 1.0), slope)
            outer = np.einsum("mi,mj->mij", direction, direction)
            jacobian[:, 1:, 1:] = ratio[:, None, None] * (np.eye(d - 1) - outer) + slope[:, None, None] * outer
        return jacobian

    def linearise(self, r: Array) -> Linearisation:
        if self._compiled is not None:
            return Linearisation(*self._compiled.linearise(r))
        m, d = r.shape
        smooth = np.zeros((m, 2), dtype=bool)
        gradient = np.zeros((m, d))
        hessian = np.zeros((m, d, d))
        smooth[:, 0] = ~self.normal.at_kink(r[:, 0])
        gradient[:, 0] = np.where(smooth[:, 0], self.normal.derivative(r[:, 0]), 0.0)
        hessian[:, 0, 0] = np.where(smooth[:, 0], self.normal.curvature(r[:, 0]), 0.0)
        if d > 1:
            size, direction = polar(r[:, 1:])
            smooth[:, 1] = ~self.tangential.at_kink(size)
            slope = np.where(smooth[:, 1], self.tangential.derivative(size), 0.0)
            curvature = np.where(smooth[:, 1], self.tangential.curvature(size), 0.0)
            gradient[:, 1:] = slope[:, None] * direction
            outer = np.einsum("mi,mj->mij", direction, direction)
            across = np.where(size > 0.0, slope / np.where(size > 0.0, size, 1.0), curvature)
            hessian[:, 1:, 1:] = across[:, None, None] * (np.eye(d - 1) - outer) + curvature[:, None, None] * outer
        return Linearisation(smooth, gradient, hessian)

    def recession(self, direction: Array) -> Array:
        rate = self.normal.recession(direction[:, 0])
        if direction.shape[1] == 1:
            return rate
        return rate + self._sure_friction.recession(lengths(direction[:, 1:]))

    def proof(self, constant: Constant) -> Proof:
        known = super().proof(constant)
        return replace(known, values=(known.values[0], self._alpha_of_slip)) if constant == "alpha" else known

    def _alpha_of_slip(self, reach: float) -> Array:
        if not self.state_dependent:
            return self.tangential.proof("alpha").value(reach)[0]
        return np.where(self.friction.profile.proof("alpha").value(reach)[0] > 0.0, np.inf, 0.0)  # whatever the bound

    @property
    def weak_convexity(self) -> tuple[Array, Array]:
        if self.friction.profile.convex:  # whatever the bound
            return self.normal.weak_convexity, np.zeros(1)
        return self.normal.weak_convexity, self._alpha_of_slip(np.inf)

    @property
    def growth(self) -> tuple[tuple[Array, Array], tuple[Array, Array]]:
        return self.normal.growth, self.tangential.growth

    # ---- far away ---------------------------------------------------------------------------------------

    def strongest(self, rest: Array, size: float) -> tuple[Array, Array, Array]:
        up, down = (steepest(self.normal, rest[:, 0], sign, size) for sign in (1.0, -1.0))
        if rest.shape[1] == 1:
            return up, down, np.zeros(len(rest))
        return up, down, steepest(self._sure_friction, lengths(rest[:, 1:]), 1.0, size)

    def rubbed(self, slips: Array, size: float = np.inf) -> Array:
        bound, profile = self.friction.bound, self.friction.profile
        if not isinstance(bound, StateBound):
            return np.zeros_like(slips)
        most = profile.recession(np.ones(1)) if size == np.inf else steepest(profile, np.zeros(1), 1.0, size)
        return np.asarray((bound.per_pressure * most)[:, None, None] * slips)

    @property
    def _sure_friction(self) -> Superpotential:
        """The part of the slip with the friction bound that is there in every state."""
        bound = self.friction.bound
        return replace(self.friction, bound=bound.least).radial if isinstance(bound, StateBound) else self.tangential

    def asymptotic_curvature(self, sign: float) -> tuple[Array, Array]:
        return self.normal.asymptotic_curvature(sign), self.tangential.asymptotic_curvature(sign)

    # ---- where a pair lies ------------------------------------------------------------------------------

    def local_minimiser(self, a: Array, b: Array, r: Array) -> Array:
        out = np.empty(r.shape)
        out[:, 0] = local_minimiser(self.normal, a[:, 0], b[:, 0], r[:, 0])
        if r.shape[1] == 2:
            out[:, 1] = local_minimiser(self.tangential, a[:, 1], b[:, 1], r[:, 1])
        elif r.shape[1] > 2:
            # Turning the slip into the direction of the force lowers the energy; what is left is radial.
            (size, towards), (old, own) = polar(b[:, 1:]), polar(r[:, 1:])
            own[:, 0] = np.where(old > 0.0, own[:, 0], 1.0)
            heading = np.where(size[:, None] > 0.0, towards, own)
            out[:, 1:] = np.maximum(local_minimiser(self.tangential, a[:, 1], size, old), 0.0)[:, None] * heading
        return out

    def kinks(self, r: Array) -> tuple[Array, Array]:
        size = lengths(r[:, 1:])
        knot = kink_within(self.tangential, size, np.inf)
        scale = np.where(size > 0.0, knot / np.where(size > 0.0, size, 1.0), 1.0)
        return kink_within(self.normal, r[:, 0], np.inf), r[:, 1:] * scale[:, None]

    def fitted(self, r: Array, lam: Array, tau: Array) -> Array:
        out = r.copy()
        out[:, 0] = nearest_pair(self.normal, r[:, 0], lam[:, 0], tau[:, 0])[0]
        if r.shape[1] > 1:
            (size, direction), force = polar(r[:, 1:]), lengths(lam[:, 1:])
            along = np.where(size > 0.0, np.einsum("mi,mi->m", direction, lam[:, 1:]), force)
            length = np.maximum(nearest_pair(self.tangential, size, along, tau[:, 1], at_least=0.0)[0], 0.0)
            # at rest the friction may point anywhere
            stays = self.tangential.distance(np.zeros_like(size), force)
            moves = np.hypot((size - length) / tau[:, 1], self.tangential.distance(length, along))
            length = np.where(np.hypot(size / tau[:, 1], stays) <= moves, 0.0, length)
            out[:, 1:] = length[:, None] * direction
        return out

    def sides(self, r: Array, lam: Array, active: BoolArray, tau: Array, slack: float) -> list[Sides]:
        d, unit = r.shape[1], np.eye(r.shape[1])
        index = np.flatnonzero(active[:, 0])
        axis = np.broadcast_to(unit[0], (index.size, d))
        normal = one_sided(self.normal, r[:, 0], tau[:, 0], slack)
        sides = [Sides(index, axis, lam[index, 0], *(values[index] for values in normal))]
        return sides if d == 1 else sides + radial_sides(self.tangential, r, lam, active, tau[:, 1], slack)


def separable(law: VectorLaw, what: str) -> ContactLaw:
    """The law as one that splits into a normal law and friction.

    Parameters
    ----------
    law : VectorLaw
    what : str
        Who asks for it, as the subject of the message.

    Returns
    -------
    ContactLaw
        The law itself.

    Raises
    ------
    MethodError
        It couples opening and slip.
    """
    if isinstance(law, ContactLaw):
        return law
    raise MethodError(
        f"{law.not_separable}, and {what} needs a normal law with separate radial friction; use a separable law, "
        f"such as Adhesive with Tresca"
    )


def _first_axis(direction: Array) -> Array:
    axis = np.zeros_like(direction)
    axis[:, 0] = 1.0
    return axis
