"""Evolutions that both engines march through."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

import hemivar as hv
from hemivar.basics.types import Array
from hemivar.evolution import (
    SDIRK2,
    AdaptiveStep,
    Evolution,
    GeneralizedAlpha,
    ImplicitEuler,
    March,
    Midpoint,
    MoreauJean,
    Newmark,
    Save,
    Scheme,
    Touch,
)
from hemivar.laws.coupled import BilinearCohesion, MixedMode
from hemivar.mesh.mesh import Mesh
from hemivar.solvers import Controls

__all__ = ["CASES", "COUPLED", "ENDING", "Case"]

_RTOL = Controls(rtol=1e-12)


@dataclass(frozen=True)
class Case:
    """An evolution and how it is computed.

    Attributes
    ----------
    mesh : callable
        The mesh with sizes of cells doubled so many times.
    state : callable
        The evolution on a mesh.
    until : float
    scheme : Scheme
    halvings : int
        How often sizes of cells can be doubled.
    options : dict
        Of the march.
    """

    mesh: Callable[[int], Mesh]
    state: Callable[[Mesh], Evolution]
    until: float
    scheme: Scheme = field(default_factory=ImplicitEuler)
    halvings: int = 0
    options: dict[str, Any] = field(default_factory=dict)

    def plan(self, **more: Any) -> March:
        """The march."""
        options = {"scheme": self.scheme, "controls": _RTOL, **self.options, **more}
        return March(self.until, **options)


def _lowered(x: Array, t: float) -> Array:
    """A support that goes down, and a little to the side."""
    return np.stack([0.01 * t + 0.0 * x[:, 0], -0.05 * t + 0.0 * x[:, 0]], axis=1)


def _turning(x: Array, t: float) -> Array:
    """A traction that presses and pushes to and fro."""
    return np.stack([0.3 * np.sin(6.0 * t) + 0.0 * x[:, 0], -0.2 * t - 0.1 * x[:, 0]], axis=1)


def _block(mesh: Mesh) -> Evolution:
    """Kelvin-Voigt with a branch, pressed by a support that moves and pushed along a foundation with friction."""
    return Evolution(
        hv.ContactProblem(
            mesh=mesh,
            material=hv.Material.lame(
                4.0, 4.0, viscosity=(0.4, 0.3), branches=[hv.materials.Branch(lame=(2.0, 1.0), time=0.3)]
            ),
            supports={"left": hv.Prescribed(_lowered)},
            tractions={"top": _turning},
            contact={"bottom": hv.Contact(hv.Compliance(20.0), hv.Tresca(0.03), gap=0.01)},
        )
    )


def _slider(mesh: Mesh) -> Evolution:
    """Elastic without viscosity or mass: friction in slip increments, on an obstacle that is rigid."""
    return Evolution(
        hv.ContactProblem(
            mesh=mesh,
            material=hv.Material.young(10.0, 0.3),
            supports={"left": hv.Clamped()},
            tractions={"top": _turning},
            contact={"bottom": hv.Contact(hv.Signorini(), hv.Tresca(0.05))},
        )
    )


def _thrown(mesh: Mesh) -> Evolution:
    """A body without supports, thrown down upon two foundations."""
    return Evolution(
        hv.ContactProblem(
            mesh=mesh,
            material=hv.Material.lame(4.0, 4.0, density=2.0, viscosity=(0.02, 0.02)),
            body_force=(0.0, -0.5),
            contact={
                "bottom": hv.Contact(hv.Compliance(50.0), hv.Tresca(0.1), gap=0.02),
                "right": hv.Contact(hv.Compliance(30.0), gap=0.03),
            },
        ),
        inertia=True,
        velocity=(0.4, -0.8),
        displacement=lambda x: 0.01 * np.stack([x[:, 1], 0.0 * x[:, 0]], axis=1),
    )


def _fallen(mesh: Mesh) -> Evolution:
    """A body that falls upon one foundation, which some ranks have no part of."""
    return Evolution(
        hv.ContactProblem(
            mesh=mesh,
            material=hv.Material.lame(4.0, 4.0, density=2.0),
            contact={"bottom": hv.Contact(hv.Compliance(50.0), hv.Tresca(0.1), gap=0.02)},
        ),
        inertia=True,
        velocity=(0.4, -0.8),
    )


def _rising(x: Array, t: float) -> Array:
    """A foundation that comes up, ever more slowly."""
    return 0.02 - 0.05 * t + 0.02 * t**2 + 0.0 * x[:, 0]


def _carried(mesh: Mesh) -> Evolution:
    """A body with mass that sets out with its support, above a foundation that comes towards it."""
    return Evolution(
        hv.ContactProblem(
            mesh=mesh,
            material=hv.Material.lame(4.0, 4.0, density=1.0),
            supports={"left": hv.Prescribed(_lowered)},
            contact={"bottom": hv.Contact(hv.Compliance(20.0), hv.Tresca(0.03), gap=_rising)},
        ),
        inertia=True,
        velocity=(0.01, -0.05),
    )


def _halted(x: Array, t: float) -> Array:
    """A support that goes down and stops all at once."""
    return np.stack([0.0 * x[:, 0], np.full(len(x), -0.05 * min(t, 0.16))], axis=1)


def _braked(mesh: Mesh) -> Evolution:
    """A body with mass and a branch, whose support stops, whose foundation begins to sink and whose guide moves."""
    return Evolution(
        hv.ContactProblem(
            mesh=mesh,
            material=hv.Material.lame(4.0, 4.0, density=1.0, branches=[hv.materials.Branch(lame=(2.0, 1.0), time=0.3)]),
            supports={"left": hv.Prescribed(_halted)},
            contact={
                "bottom": hv.Contact(
                    hv.Compliance(20.0), hv.Tresca(0.003), gap=lambda x, t: -0.01 + np.full(len(x), max(0.0, t - 0.2))
                ),
                "right": hv.Contact(
                    hv.laws.Bilateral(), gap=lambda x, t: 0.05 * (t + max(0.0, t - 0.2)) + 0.0 * x[:, 0]
                ),
            },
        ),
        inertia=True,
        velocity=(0.0, -0.05),
    )


def _cube(mesh: Mesh) -> Evolution:
    """A cube that is hit from the side and slides."""
    return Evolution(
        hv.ContactProblem(
            mesh=mesh,
            material=hv.Material.lame(4.0, 4.0, density=1.0, viscosity=(0.1, 0.1)),
            body_force=(0.0, 0.0, -1.0),
            tractions={"right": lambda x, t: np.array([-2.0 * t, 0.3, 0.0]) + 0.0 * x},
            contact={"bottom": hv.Contact(hv.Compliance(40.0), hv.Tresca(0.1))},
        ),
        inertia=True,
    )


def _hit(mesh: Mesh) -> Evolution:
    """A body that hits a rigid obstacle."""
    return Evolution(
        hv.ContactProblem(
            mesh=mesh,
            material=hv.Material.lame(4.0, 4.0, density=1.0),
            contact={"bottom": hv.Contact(hv.Signorini(), hv.Tresca(0.1), gap=0.02)},
        ),
        inertia=True,
        velocity=(0.2, -0.5),
    )


def _between(mesh: Mesh) -> Evolution:
    """A viscous block between two foundations, one of which resists the rate as well and remembers."""
    return Evolution(
        hv.ContactProblem(
            mesh=mesh,
            material=hv.Material.lame(4.0, 4.0, viscosity=(0.4, 0.3)),
            supports={"left": hv.Clamped()},
            tractions={"top": _turning},
            contact={
                "bottom": hv.Contact(
                    hv.Compliance(20.0), hv.Tresca(0.02), damping=hv.Compliance(3.0), memory=(hv.laws.SlipSum(),)
                ),
                "right": hv.Contact(hv.Compliance(5.0), gap=0.001),
            },
        )
    )


def _lifting(x: Array, t: float) -> Array:
    """A support that goes down and up again."""
    return np.full(len(x), -min(t, 0.8 - t))


def _torn(mesh: Mesh, viscosity: float | None = None) -> Evolution:
    """A block on a foundation that softens faster than the block is stiff: it jumps off, and back."""
    law = hv.laws.PiecewiseQuadratic([0.0, 0.1, 0.2], [0.0, 2.0, -2.0, 0.0], np.zeros(3))
    material = hv.Material.lame(0.0, 0.5, viscosity=None if viscosity is None else (0.0, viscosity))
    return Evolution(
        hv.ContactProblem(
            mesh=mesh,
            material=material,
            supports={"left": hv.Roller(), "right": hv.Roller(), "top": hv.Fixed(y=_lifting)},
            contact={"bottom": hv.Contact(law)},
        )
    )


def _peeled(mesh: Mesh) -> Evolution:
    """A strip that is peeled off glue whose tension falls faster than the strip is stiff, and is held by what falls."""
    glue = hv.Adhesive(stiffness=50.0, strength=0.25, softening=20.0, compression=500.0)
    return Evolution(
        hv.ContactProblem(
            mesh=mesh,
            material=hv.Material.young(100.0, 0.3),
            supports={"left": hv.Clamped()},
            tractions={"right": lambda x, t: np.stack([0.0 * x[:, 0], 0.6 * t + 0.0 * x[:, 0]], axis=1)},
            contact={"bottom": hv.Contact(glue)},
        )
    )


def _weakened(mesh: Mesh) -> Evolution:
    """Friction that follows the slip below, and its direction at the side."""
    below = hv.SlipWeakening(0.03, 1.2, 0.5, 0.5, of="slip")
    return Evolution(
        hv.ContactProblem(
            mesh=mesh,
            material=hv.Material.lame(4.0, 4.0),
            supports={"left": hv.Clamped()},
            tractions={"top": _turning},
            contact={
                "bottom": hv.Contact(hv.Compliance(20.0), below),
                "right": hv.Contact(hv.Compliance(5.0), hv.Tresca(0.002), gap=0.001),
            },
        )
    )


def _rested(mesh: Mesh, push: Callable[[float], float] = lambda t: 0.2 + 0.1 * t, held: bool = True) -> Evolution:
    """A body that begins pressed and pushed on friction that weakens with the rate; some ranks have no part of it."""
    return Evolution(
        hv.ContactProblem(
            mesh=mesh,
            material=hv.Material.lame(4.0, 4.0),
            supports={"left": hv.Clamped()} if held else {},
            tractions={"top": lambda x, t: np.array([push(t), -0.3]) + 0.0 * x},
            contact={"bottom": hv.Contact(hv.Compliance(20.0), hv.SlipWeakening(0.1, 1.2, 0.5, 1.0, of="rate"))},
        )
    )


def _pulled(x: Array, t: float) -> Array:
    """A support that is pulled off and along, and goes back a way."""
    far = min(t, 0.8 - 0.5 * t)
    return np.stack([0.03 * far + 0.0 * x[:, 0], 0.04 * far + 0.0 * x[:, 0]], axis=1)


def _glued(mesh: Mesh, remembers: bool = True) -> Evolution:
    """A block on mixed-mode glue, which remembers how far it was opened or does not, beside a foundation with friction
    that not every rank has."""
    glue = MixedMode(BilinearCohesion(strength=0.05, energy=0.004, stiffness=5.0), ratio=1.5)
    return Evolution(
        hv.ContactProblem(
            mesh=mesh,
            material=hv.Material.young(10.0, 0.3),
            supports={"top": hv.Prescribed(_pulled)},
            contact={
                "bottom": hv.Contact(glue) if remembers else hv.Contact(glue, memory=()),
                "right": hv.Contact(hv.Compliance(5.0), hv.Tresca(0.002), gap=-0.001),
            },
        )
    )


def _grained(mesh: Mesh) -> Evolution:
    """A cube that is dragged over a foundation with orthotropic friction."""
    rubs = hv.laws.OrthotropicFriction(0.05, 0.4, axis=(1.0, 1.0, 0.0))
    return Evolution(
        hv.ContactProblem(
            mesh=mesh,
            material=hv.Material.lame(4.0, 4.0),
            supports={"left": hv.Clamped()},
            body_force=lambda x, t: np.array([-0.5 * t, -0.4 * t * t, -0.5]) + 0.0 * x,
            contact={"bottom": hv.Contact(hv.Compliance(10.0), rubs)},
        )
    )


def _bonded(mesh: Mesh, memory: hv.laws.Memory | None = None) -> Evolution:
    """A block pulled off and along a bond, pressed before, whose memory makes opening and slip act together."""
    glue = hv.Adhesive(24.0, 0.3, 6.0, 72.0)
    remembers = hv.laws.Secant(friction=0.4) if memory is None else memory
    return Evolution(
        hv.ContactProblem(
            mesh=mesh,
            material=hv.Material.young(10.0, 0.3),
            supports={"top": hv.Prescribed(_pressed)},
            contact={"bottom": hv.Contact(glue if memory is None else hv.Compliance(72.0), memory=(remembers,))},
        )
    )


def _pressed(x: Array, t: float) -> Array:
    """A support that goes along, up, and down again."""
    return np.stack([0.05 * t + 0.0 * x[:, 0], 0.04 * np.sin(4.0 * t) + 0.0 * x[:, 0]], axis=1)


#: Laws that couple opening and slip.
COUPLED = {
    "glue": Case(lambda times: hv.rectangle((1.0, 0.5), (8, 4)), _glued, 1.0, options={"step": 0.1}),
    "glue that forgets": Case(
        lambda times: hv.rectangle((1.0, 0.5), (8, 4)), lambda mesh: _glued(mesh, remembers=False), 1.0,
        options={"step": 0.1},
    ),
    "glue with friction": Case(
        lambda times: hv.rectangle((1.0, 0.5), (8, 4)), _bonded, 1.0, options={"step": 0.05}
    ),
    "plastic bond": Case(
        lambda times: hv.rectangle((1.0, 0.5), (8, 4)),
        lambda mesh: _bonded(mesh, hv.laws.PlasticBond(24.0, 12.0, 0.006, 0.05, 3.0)), 1.0, options={"step": 0.05},
    ),
    "orthotropic friction": Case(
        lambda times: hv.box((1.0, 1.0, 1.0), (4, 4, 4)), _grained, 1.0, options={"step": 0.2}
    ),
}  # fmt: skip

CASES = {
    # a coarser mesh below, and a support that moves
    "block": Case(
        lambda times: hv.rectangle((2.0, 1.0), (64 >> times, 32 >> times)),
        _block,
        1.0,
        halvings=1,
        options={"step": 0.1, "save": Save(probes={"tip": (2.0, 0.31)})},
    ),
    # one mesh, steps chosen by their error, an event found by bisection
    "block, adaptive": Case(
        lambda times: hv.rectangle((2.0, 1.0), (12, 6)),
        _block,
        0.5,
        options={"step": AdaptiveStep(0.02, first_step=0.05), "events": [Touch()]},
    ),
    "slider": Case(lambda times: hv.rectangle((2.0, 1.0), (12, 6)), _slider, 1.0, options={"step": 0.125}),
    "thrown": Case(
        lambda times: hv.rectangle((1.0, 1.0), (8, 8)), _thrown, 0.3, GeneralizedAlpha(0.8), options={"step": 0.02}
    ),
    "thrown, implicit Euler": Case(
        lambda times: hv.rectangle((1.0, 1.0), (40 >> times, 40 >> times)), _thrown, 0.2, halvings=1,
        options={"step": 0.02},
    ),
    "two stages, memory": Case(
        lambda times: hv.rectangle((2.0, 1.0), (8, 4)), _between, 0.4, SDIRK2(), options={"step": 0.1}
    ),
    "carried": Case(lambda times: hv.rectangle((1.0, 1.0), (6, 6)), _carried, 0.4, Newmark(), options={"step": 0.04}),
    # speeds of a support and of a foundation that jump
    "braked": Case(
        lambda times: hv.rectangle((1.0, 1.0), (6, 6)), _braked, 0.28, GeneralizedAlpha(0.8),
        options={"step": 0.04, "stops": (0.16, 0.2)},
    ),
    "midpoint": Case(
        lambda times: hv.rectangle((1.0, 1.0), (6, 6)), _thrown, 0.12, Midpoint(), options={"step": 0.02}
    ),
    # a rank without contact points
    "midpoint, conserving": Case(
        lambda times: hv.rectangle((1.0, 1.0), (6, 6)), _fallen, 0.12, Midpoint(True), options={"step": 0.02}
    ),
    "impact": Case(
        lambda times: hv.rectangle((1.0, 1.0), (6, 6)), _hit, 0.1, MoreauJean(0.5), options={"step": 0.02}
    ),
    # jumps of bodies without viscosity, and with too little of it
    "jumps": Case(
        lambda times: hv.rectangle((1.0, 1.0), (6, 6)), _torn, 0.72, options={"step": 0.04, "stops": (0.4,)}
    ),
    "viscous jumps": Case(
        lambda times: hv.rectangle((1.0, 1.0), (6, 6)), lambda mesh: _torn(mesh, 0.01), 0.72, options={"step": 0.04}
    ),
    "peeled": Case(lambda times: hv.rectangle((3.0, 1.0), (12, 4)), _peeled, 0.36, options={"step": 0.12}),
    "friction of the slip": Case(
        lambda times: hv.rectangle((2.0, 1.0), (8, 4)), _weakened, 0.6, options={"step": 0.1}
    ),
    "friction at rest": Case(lambda times: hv.rectangle((1.0, 1.0), (6, 6)), _rested, 0.4, options={"step": 0.1}),
    "cube": Case(
        lambda times: hv.box((1.0, 1.0, 1.0), (4, 4, 4)), _cube, 0.2, GeneralizedAlpha(0.5), options={"step": 0.04}
    ),
}  # fmt: skip

#: What ends before its time: a push that friction does not bear, at once.
ENDING = {
    "slips at once": Case(
        lambda times: hv.rectangle((1.0, 1.0), (6, 6)),
        lambda mesh: _rested(mesh, lambda t: 0.01 if t < 0.2 else 0.5, held=False),
        0.4,
        options={"step": 0.1, "stops": (0.2,), "controls": Controls(rtol=1e-12, max_steps=20)},
    ),
}
