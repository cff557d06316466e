"""Everyday problems held by contact only: blocks, rollers, beams on two supports, plates on springs."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

import hemivar as hv
from hemivar.formula import Formula
from hemivar.laws import NoFriction, Signorini, ThresholdCompliance
from hemivar.mechanics.conditions import Support

Touching = Mapping[str, hv.Contact]
KINDS = ("block", "roller", "two supports", "cube", "plate", "steep")


def everyday(seed: int) -> tuple[str, hv.ContactProblem]:
    """A kind of problem with a convex law, of any stiffness, in metres or millimetres."""
    rng = np.random.default_rng(seed)
    kind = KINDS[seed % len(KINDS)]
    E = float(10.0 ** rng.uniform(3.0, 5.3))
    plane = str(rng.choice(["strain", "stress"]))
    material = hv.Material.young(E, float(rng.choice([0.0, 0.2, 0.33, 0.45])), plane=plane)
    q = E * float(10.0 ** rng.uniform(-5.0, -2.7))
    k, n = E * float(10.0 ** rng.uniform(-2.0, 2.0)), int(rng.choice([4, 8]))
    s = E * float(10.0 ** rng.uniform(-4.0, -2.5))
    most = max(s, 2.0 * q)
    law = [Signorini(), Signorini(), hv.Compliance(k), ThresholdCompliance(most / k, most)][rng.integers(4)]
    friction = [NoFriction(), hv.Tresca(0.3 * s), hv.Tresca(0.5 * q), NoFriction()][rng.integers(4)]
    contact = hv.Contact(law, friction)

    def problem(
        mesh: hv.Mesh, touching: Touching, supports: Mapping[str, Support], load: str, force: tuple[float, ...]
    ) -> hv.ContactProblem:
        return hv.ContactProblem(mesh, material, touching, supports, tractions={load: force})

    match kind:
        case "block":  # on a plane, pushed down and a little sideways
            side = {"left": hv.Roller()} if rng.random() < 0.7 else {"left": hv.Fixed(x=0.0)}
            return kind, problem(hv.rectangle((2.0, 1.0), (2 * n, n)), {"bottom": contact}, side, "top", (0.1 * q, -q))
        case "roller":  # a curved bottom by its gap
            radius = float(10.0 ** rng.uniform(0.0, 2.0))
            round_ = hv.Contact(law, friction, gap=Formula(f"x^2 / {2.0 * radius}"))
            mesh = hv.rectangle((2.0, 1.0), (2 * n, n), origin=(-1.0, 0.0))
            return kind, problem(mesh, {"bottom": round_}, {"left": hv.Fixed(x=0.0)}, "top", (0.0, -q))
        case "two supports":  # a beam
            parts = {
                "a": lambda x: (x[:, 1] < 1e-9) & (x[:, 0] < 6.0),
                "b": lambda x: (x[:, 1] < 1e-9) & (x[:, 0] > 24.0),
                "mid": lambda x: (x[:, 1] > 2.0 - 1e-9) & (abs(x[:, 0] - 15.0) < 2.01),
                "pin": lambda x: abs(x[:, 0] - 30.0) < 1e-9,
            }
            mesh = hv.rectangle((30.0, 2.0), (15 * n // 2, n // 2 + 1)).with_boundaries(parts)
            a = hv.Contact(law, friction, gap=Formula("(x - 3)^2 / 8"))
            b = hv.Contact(law, friction, gap=Formula("(x - 27)^2 / 8"))
            return kind, problem(mesh, {"a": a, "b": b}, {"pin": hv.Fixed(x=0.0)}, "mid", (0.0, -0.1 * q))
        case "cube":
            mesh = hv.box((1.0, 1.0, 1.0), (n // 2,) * 3)
            sides = {"left": hv.Roller(), "front": hv.Roller()}
            material = hv.Material.young(E, 0.3)
            return kind, problem(mesh, {"bottom": contact}, sides, "top", (0.05 * q, 0.0, -q))
        case "plate":  # thin, on springs, loaded on a part of it
            mesh = hv.rectangle((50.0, 1.0), (25 * n // 2, 2)).with_boundaries(
                {
                    "load": lambda x: (x[:, 1] > 1.0 - 1e-9) & (x[:, 0] < 10.0),
                    "bottom": lambda x: x[:, 1] < 1e-9,
                    "left": lambda x: x[:, 0] < 1e-9,
                }
            )
            springs = hv.Contact(hv.Compliance(E * float(10.0 ** rng.uniform(-4.0, 0.0))), friction)
            return kind, problem(mesh, {"bottom": springs}, {"left": hv.Fixed(x=0.0)}, "load", (0.0, -0.01 * q))
        case _:  # held by friction alone
            stuck = hv.Contact(law, hv.Tresca(0.5 * q))
            return kind, problem(hv.rectangle((2.0, 1.0), (2 * n, n)), {"bottom": stuck}, {}, "top", (0.2 * q, -q))
