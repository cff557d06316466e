"""Random marches under loads that begin like t^p, over gaps and from contact, with every friction and mass."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

import hemivar as hv
from hemivar import laws
from hemivar.basics.types import Array

#: Where bodies are held; the last two by contact alone, in some direction.
_SUPPORTS = (
    {"top": hv.Clamped()},
    {"left": hv.Clamped()},
    {"left": hv.Roller()},
    {"left": hv.Fixed(x=0.0)},
)
_FRICTIONS = (
    laws.NoFriction(),
    laws.Tresca(0.1),
    laws.Coulomb(0.3),
    laws.SlipWeakening(0.1, 1.0, 0.7, 1.0, of="rate"),
    laws.SlipWeakening(laws.CoulombBound(0.3), 1.0, 0.7, 1.0, of="rate"),
    laws.Logarithmic(0.1, 1.0, of="rate"),
    laws.SlipTable(0.1, [0.0, 1.0, 3.0], [1.0, 0.9, 0.8], of="rate"),
)
_NORMALS = (hv.Signorini(), hv.Compliance(400.0), laws.ThresholdCompliance(0.1, 50.0))
#: Largest power of the time with which a load begins, and of ten of a mass.
_POWERS, _HEAVY = 8, 6.0


@dataclass(frozen=True)
class RandomMarch:
    """An evolution, the length of its steps, a method, and what it is in words."""

    evolution: hv.Evolution
    step: float
    method: str | None
    words: str

    def run(self) -> hv.evolution.History:
        """The march, ten steps long."""
        return hv.march(self.evolution, until=10.0 * self.step, step=self.step, method=self.method)


def random_march(seed: int) -> RandomMarch:
    """The march of a seed: half of them under loads that stay tiny, half under such that close a gap on the way."""
    rng = np.random.default_rng(seed)
    power, step = int(rng.integers(1, _POWERS + 1)), float(10.0 ** rng.uniform(-3.0, -1.0))
    size = float(10.0 ** rng.uniform(-2.0, 1.0))
    if rng.random() < 0.5:
        size = float(10.0 ** rng.uniform(-1.0, 2.0)) / (10.0 * step) ** power
    held, friction, normal = (int(rng.integers(len(kind))) for kind in (_SUPPORTS, _FRICTIONS, _NORMALS))
    gap = float(rng.choice([0.0, 1e-3, 0.05, 1.0])) if held < 2 else 0.0
    mass = float(rng.choice([0.0, 10.0 ** rng.uniform(-3.0, _HEAVY)]))
    viscosity = None if rng.random() < 0.5 else (0.2, 0.2)
    dim, method = (3 if rng.random() < 0.25 else 2), ("multigrid" if rng.random() < 0.25 else None)
    sideways = float(rng.uniform(-0.2, 0.2)) if held < 2 else 0.0

    def load(points: Array, t: float) -> Array:
        return np.tile([sideways * size * t**power, *[0.0] * (dim - 2), -size * t**power], (len(points), 1))

    material = hv.Material.lame(400.0, 400.0, density=mass or None, viscosity=viscosity)
    contact = {"bottom": hv.Contact(_NORMALS[normal], _FRICTIONS[friction], gap=gap)}
    mesh = hv.rectangle((2.0, 1.0), (4, 2)) if dim == 2 else hv.box((1.0, 1.0, 1.0), (2, 2, 2))
    supports = _SUPPORTS[held] if dim == 2 or held < 2 else _SUPPORTS[held] | {"front": hv.Fixed(y=0.0)}
    problem = hv.ContactProblem(mesh, material, contact, supports, body_force=load)
    words = (
        f"seed {seed}: {size:.3g} t^{power}, steps {step:.3g}, in {dim}D, held {held}, {_NORMALS[normal].name}, "
        f"friction {friction}, gap {gap:g}, mass {mass:.3g}, viscosity {viscosity}, {method or 'by default'}"
    )
    return RandomMarch(hv.Evolution(problem, inertia=mass > 0.0), step, method, words)
