"""Experiments of the tests: a block on glue that is pulled off, with laws of two to four parameters."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

import hemivar as hv
from hemivar.basics.types import Array
from hemivar.identification import Measurements

FORCE = "support.top.force.y"


@dataclass(frozen=True)
class Case:
    """A law by its parameters, their true values, and how far the block is pulled in each row."""

    law: Callable[[Mapping[str, float]], hv.laws.Superpotential]
    truth: Mapping[str, float]
    pulled: Array

    def state(self, values: Mapping[str, float]) -> hv.ContactProblem:
        """The block, pulled by the input ``pull``."""
        return hv.ContactProblem(
            mesh=hv.rectangle((1.0, 1.0), 1),
            material=hv.Material.lame(40.0, 40.0),
            supports={"top": hv.Fixed(x=0.0, y=values["pull"])},
            contact={"bottom": hv.Contact(self.law(values))},
        )

    @property
    def ranges(self) -> dict[str, tuple[float, float]]:
        return {key: (value / 3.0, value * 3.0) for key, value in self.truth.items()}

    @cached_property
    def exact(self) -> Array:
        """The force on the top in each row, from solves of their own."""
        forces, last = [], None
        for pull in self.pulled:
            last = hv.solve(self.state({**self.truth, "pull": float(pull)}), rtol=1e-12, initial=last)
            forces.append(float(last.reactions["top"][1]))
        return np.array(forces)

    def measured(self, noise: float = 0.0, seed: int = 0) -> Measurements:
        """The curve with normal noise, relative to its largest value."""
        force = self.exact
        off = noise * np.abs(force).max() * np.random.default_rng(seed).standard_normal(force.size)
        return Measurements({"pull": self.pulled}, {FORCE: force + off})


def _bilinear(values: Mapping[str, float]) -> hv.laws.Superpotential:
    return hv.Adhesive(stiffness=values["stiffness"], strength=values["strength"], softening=values["softening"])


def _trilinear(values: Mapping[str, float]) -> hv.laws.Superpotential:
    """Tension over opening: up to ``first``, on to ``strength`` with a lower slope, down to zero."""
    opening = np.cumsum([values["first"] / 60.0, 0.05, 0.08])
    tension = np.array([values["first"], values["strength"], 0.0])
    r = np.concatenate([-opening[::-1], [0.0, 1.0]])
    return hv.table_law(r, np.concatenate([-tension[::-1], [0.0, 60.0]]))


def _exponential(values: Mapping[str, float]) -> hv.laws.Superpotential:
    """``t(w) = s e w/d exp(-w/d)`` in opening, by 60 chords up to 12 d; springs of the same slope in compression."""
    strength, length = values["strength"], values["length"]
    w = np.concatenate([np.linspace(0.0, 4.0, 41), np.linspace(4.4, 12.0, 20)])
    t = np.e * w * np.exp(-w)
    r = np.concatenate([-length * w[::-1], [length]])
    return hv.table_law(r, np.concatenate([-strength * t[::-1], [strength * np.e]]))


BILINEAR = Case(_bilinear, {"stiffness": 40.0, "strength": 2.0, "softening": 25.0}, np.linspace(0.005, 0.2, 20))
TRILINEAR = Case(_trilinear, {"first": 1.2, "strength": 2.0}, np.linspace(0.005, 0.22, 20))
EXPONENTIAL = Case(_exponential, {"strength": 2.0, "length": 0.06}, np.linspace(0.01, 0.35, 20))
CASES = {"bilinear": BILINEAR, "trilinear": TRILINEAR, "exponential": EXPONENTIAL}
