"""Nine kinds of everyday problems by the default method, with random numbers: each ends with an answer."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import pytest

import hemivar as hv
from hemivar.basics.types import Array


@dataclass(frozen=True)
class Draw:
    """Random numbers of one problem: E, the load, the contact, cells across."""

    rng: np.random.Generator
    stiffness: float
    load: float
    cells: int

    @staticmethod
    def of(seed: int) -> Draw:
        rng = np.random.default_rng([11, seed])
        stiffness = float(10.0 ** rng.uniform(3.0, 5.3))
        load = stiffness * float(10.0 ** rng.uniform(-5.0, -2.7))
        return Draw(rng, stiffness, load, int(rng.choice([4, 8, 12])))

    @property
    def material(self) -> hv.Material:
        ratio, plane = float(self.rng.choice([0.2, 0.3, 0.33])), str(self.rng.choice(["strain", "stress"]))
        return hv.Material.young(self.stiffness, ratio, plane=plane)

    def contact(self, **options: object) -> hv.Contact:
        """No glue that a load by forces could tear off."""
        rng, stiff = self.rng, self.stiffness * float(10.0 ** self.rng.uniform(-2.0, 2.0))
        strong = self.stiffness * float(10.0 ** rng.uniform(-4.0, -2.5))
        normal = (
            hv.Signorini(), hv.Signorini(), hv.Compliance(stiff),
            hv.laws.ThresholdCompliance(q_max=strong / stiff, p_const=1e3 * strong),
        )[rng.integers(4)]  # fmt: skip
        friction = (
            hv.laws.NoFriction(), hv.Tresca(0.3 * strong), hv.Coulomb(float(rng.choice([0.1, 0.3, 0.6]))),
            hv.laws.NoFriction(),
        )[rng.integers(4)]  # fmt: skip
        return replace(hv.Contact(normal, friction), **options)  # type: ignore[arg-type]


def tip(draw: Draw) -> hv.ContactProblem:
    """A cantilever whose tip meets a stop."""
    n = draw.cells
    mesh = hv.rectangle((20.0, 1.0), (10 * n, n // 2 + 1)).with_boundaries({
        "root": lambda x: x[:, 0] < 1e-9, "stop": lambda x: (x[:, 1] < 1e-9) & (x[:, 0] > 18.0),
        "up": lambda x: x[:, 1] > 1.0 - 1e-9,
    })  # fmt: skip
    contact = draw.contact(gap=float(draw.rng.uniform(0.0, 0.05)))
    tractions = {"up": (0.0, -0.02 * draw.load)}
    return hv.ContactProblem(mesh, draw.material, {"stop": contact}, {"root": hv.Clamped()}, tractions=tractions)


def plain_block(draw: Draw) -> hv.ContactProblem:
    """A block on a plane, held sideways."""
    n, load = draw.cells, draw.load
    return hv.ContactProblem(
        hv.rectangle((2.0, 1.0), (2 * n, n)), draw.material, {"bottom": draw.contact()}, {"left": hv.Fixed(x=0.0)},
        tractions={"top": (0.0, -load)}, body_force=(0.0, -0.01 * load),
    )  # fmt: skip


def hertz(draw: Draw) -> hv.ContactProblem:
    """A round foot pressed down by forces."""
    n, radius = draw.cells, float(10.0 ** draw.rng.uniform(0.0, 2.0))

    def gap(x: Array) -> Array:
        return x[:, 0] ** 2 / (2.0 * radius)

    mesh = hv.rectangle((2.0, 1.0), (4 * n, 2 * n), origin=(-1.0, 0.0))
    tractions = {"top": (0.0, -draw.load)}
    contact = {"bottom": draw.contact(gap=gap)}
    return hv.ContactProblem(mesh, draw.material, contact, {"left": hv.Fixed(x=0.0)}, tractions=tractions)


def punch(draw: Draw) -> hv.ContactProblem:
    """A prescribed indentation."""
    mesh = hv.rectangle((2.0, 1.0), (2 * draw.cells, draw.cells))
    contact = draw.contact(gap=lambda x: 0.002 * (x[:, 0] - 1.0) ** 2)
    moved = hv.Prescribed((float(0.002 * draw.rng.normal()), -0.005))
    return hv.ContactProblem(mesh, draw.material, {"bottom": contact}, {"top": moved})


def beam_on_two_supports(draw: Draw) -> hv.ContactProblem:
    """A beam on two round supports."""
    n = draw.cells
    mesh = hv.rectangle((30.0, 2.0), (15 * n // 2, n // 2 + 1)).with_boundaries({
        "a": lambda x: (x[:, 1] < 1e-9) & (x[:, 0] < 6.0), "b": lambda x: (x[:, 1] < 1e-9) & (x[:, 0] > 24.0),
        "middle": lambda x: (x[:, 1] > 2.0 - 1e-9) & (np.abs(x[:, 0] - 15.0) < 2.01),
        "end": lambda x: np.abs(x[:, 0] - 30.0) < 1e-9,
    })  # fmt: skip
    contact = draw.contact()
    supports = {name: hv.mechanics.Sphere((x, -4.0), 4.0) for name, x in (("a", 3.0), ("b", 27.0))}
    return hv.ContactProblem(
        mesh, draw.material, {name: replace(contact, obstacle=round_) for name, round_ in supports.items()},
        {"end": hv.Fixed(x=0.0)}, tractions={"middle": (0.0, -0.1 * draw.load)},
    )  # fmt: skip


def walled_cube(draw: Draw) -> hv.ContactProblem:
    """A block in space between walls."""
    mesh, load = hv.box((1.0, 1.0, 1.0), draw.cells // 2), (0.0, 0.0, -draw.load)
    supports = {"left": hv.Roller(), "front": hv.Roller()}
    material = hv.Material.young(draw.stiffness, 0.3)
    return hv.ContactProblem(mesh, material, {"bottom": draw.contact()}, supports, tractions={"top": load})


def ball(draw: Draw) -> hv.ContactProblem:
    """A block in space pressed on a ball."""
    n = draw.cells
    contact = draw.contact(obstacle=hv.mechanics.Sphere((0.5, 0.5, -2.0), 2.0))
    mesh, moved = hv.box((1.0, 1.0, 0.5), (n, n, n // 2)), hv.Prescribed((0.0, 0.0, -0.005))
    return hv.ContactProblem(mesh, hv.Material.young(draw.stiffness, 0.3), {"bottom": contact}, {"top": moved})


def peel(draw: Draw) -> hv.ContactProblem:
    """A strip on glue, pulled up at one end."""
    n, rng = draw.cells, draw.rng
    mesh = hv.rectangle((20.0, 0.5), (10 * n, max(2, n // 4))).with_boundaries({
        "glue": lambda x: (x[:, 1] < 1e-9) & (x[:, 0] > 3.0), "end": lambda x: x[:, 0] < 1e-9,
    })  # fmt: skip
    stiff, strong = draw.stiffness * float(10.0 ** rng.uniform(-1.5, 0.5)), 1e-3 * draw.stiffness
    glue = hv.Adhesive(stiff, strong, softening=stiff * float(rng.uniform(0.01, 0.1)), compression=10.0 * stiff)
    lifted = hv.Fixed(y=float(10.0 ** rng.uniform(-3.0, -1.0)))
    return hv.ContactProblem(mesh, draw.material, {"glue": hv.Contact(glue, hv.Tresca(strong))}, {"end": lifted})


def thin_plate(draw: Draw) -> hv.ContactProblem:
    """A thin plate on springs."""
    mesh = hv.rectangle((50.0, 1.0), (50 * draw.cells // 4, 2))
    springs = hv.Compliance(draw.stiffness * float(10.0 ** draw.rng.uniform(-4.0, 0.0)))
    friction = hv.Tresca(draw.load) if draw.rng.random() < 0.5 else hv.laws.NoFriction()
    support = hv.Clamped() if draw.rng.random() < 0.5 else hv.Fixed(x=0.0)
    return hv.ContactProblem(
        mesh, draw.material, {"bottom": hv.Contact(springs, friction)}, {"left": support},
        tractions={"top": (0.0, -0.01 * draw.load)},
    )  # fmt: skip


KINDS: tuple[Callable[[Draw], hv.ContactProblem], ...] = (
    tip,
    plain_block,
    hertz,
    punch,
    beam_on_two_supports,
    walled_cube,
    ball,
    peel,
    thin_plate,
)


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS, ids=[kind.__name__ for kind in KINDS])
def test_everyday_problems_end_with_an_answer(kind: Callable[[Draw], hv.ContactProblem]) -> None:
    for seed in range(24):
        found = hv.solve(kind(Draw.of(seed)), max_time=60.0)
        assert found.status is hv.Status.CONVERGED, f"{seed}: {found.status}, {found.method}, {found.steps} steps"
