"""Random evolutions of small bodies with one to three contact points, stated in problem files."""

from __future__ import annotations

import random
from typing import Any

__all__ = ["random_evolution"]

_STEPS = 6


def random_evolution(rng: random.Random) -> tuple[dict[str, Any], dict[str, str], str]:
    """A problem file, the files it reads, and what it is about in words."""
    scheme = _scheme(rng)
    name = scheme["name"]
    inert = name in ("newmark", "generalized-alpha") or (name != "sdirk2" and rng.random() < 0.5)
    euler = name == "implicit-euler"
    order = 2 if rng.random() < 0.15 else 1
    mesh = {
        "rectangle": [_of(rng, 0.5, 2.0), _of(rng, 0.5, 2.0)],
        "cells": [1, 1] if order == 2 else rng.choice([[1, 1], [2, 1], [1, 2], [2, 1]]),
        "pattern": rng.choice(["right", "left", "cross"]),
        "order": order,
    }
    size = 10.0 ** rng.uniform(-1.0, 2.0)
    material: dict[str, Any] = {"lame": [size * _of(rng, 0.2, 2.0), size * _of(rng, 0.5, 2.0)]}
    if rng.random() < 0.3:
        material = {"young": size * _of(rng, 1.0, 3.0), "poisson": _of(rng, 0.0, 0.45)}
    material["plane"] = rng.choice(["strain", "stress"])
    until = 10.0 ** rng.uniform(-1.0, 0.5)
    if inert:
        material["density"] = size * until**2 * 10.0 ** rng.uniform(-2.5, 0.5)
    if rng.random() < 0.5:
        material["viscosity"] = [size * until * _of(rng, 0.0, 0.3), size * until * _of(rng, 0.02, 0.3)]
    if name != "sdirk2" and rng.random() < 0.25:
        material["branches"] = [{"lame": [0.0, size * _of(rng, 0.2, 1.0)], "time": until * _of(rng, 0.05, 2.0)}]
    step = until / _STEPS
    supports = _supports(rng, inert)
    handing = name in ("newmark", "generalized-alpha")
    moves = euler and not inert and supports == {"top": "clamped"} and rng.random() < 0.3
    pull = 0.05 * min(mesh["rectangle"])  # a displacement
    if moves:
        supports = {"top": {"displacement": [_ramp(rng, pull, until), _ramp(rng, pull, until)]}}
    friction = _friction(rng, 0.05 * size)
    normal, table = _normal(rng, size, pull, handing)
    glued = normal["law"] == "adhesive"
    gap = 0.0 if handing and glued else _of(rng, 0.0, 0.4) * pull
    # The acceleration at the start is that of the load alone where nothing touches or rubs.
    late = handing and friction is None and not glued
    if late and gap == 0.0:
        gap = 0.1 * pull
    force, begins = 0.1 * size, handing and not late
    loads: dict[str, Any] = {"body": [_load_in_time(rng, force, until, begins) for _ in range(2)]}
    if rng.random() < 0.4:
        loads["traction"] = {"right": [_load_in_time(rng, force, until, begins) for _ in range(2)]}
    contact: dict[str, Any] = {"normal": normal, "gap": gap}
    if friction is not None:
        contact["friction"] = friction
    if normal["law"] == "adhesive" and euler and rng.random() < 0.6:
        contact["memory"] = [{"kind": "secant"}]
    elif rng.random() < 0.2:
        contact["damping"] = {"law": "compliance", "stiffness": size * until * _of(rng, 0.05, 1.0)}
    time: dict[str, Any] = {"until": until, "step": step, "scheme": scheme, "inertia": inert}
    if inert and not supports:
        down = 0.0 if handing and (gap == 0.0 or "damping" in contact) else -_of(rng, 0.0, 2.0) * pull / until
        across = 0.0 if handing and friction is not None else _of(rng, -2.0, 2.0) * pull / until
        time["initial"] = {"velocity": [across, down]}
    data = {
        "mesh": mesh, "material": material, "loads": loads, "supports": supports, "contact": {"bottom": contact},
        "time": time, "output": {"every": step / 64.0},
    }  # fmt: skip
    words = f"{name}, {'mass' if inert else 'no mass'}, {normal['law']}, {friction or 'no friction'}"
    return data, {} if table is None else {"law.csv": table}, words


def _of(rng: random.Random, low: float, high: float) -> float:
    return round(rng.uniform(low, high), 4)


def _scheme(rng: random.Random) -> dict[str, Any]:
    name = rng.choices(["implicit-euler", "midpoint", "newmark", "generalized-alpha", "sdirk2"], [8, 3, 2, 3, 2])[0]
    if name == "newmark":
        beta, gamma = rng.choice([(0.25, 0.5), (0.3025, 0.6)])
        return {"name": name, "beta": beta, "gamma": gamma}
    return {"name": name, "rho": _of(rng, 0.0, 1.0)} if name == "generalized-alpha" else {"name": name}


def _supports(rng: random.Random, inert: bool) -> dict[str, Any]:
    held: list[dict[str, Any]] = [
        {"top": "clamped"}, {"left": "clamped"}, {"top": "clamped", "left": "roller"}, {"top": "clamped"},
    ]  # fmt: skip
    return rng.choice([*held, {}, {}] if inert else held)


def _ramp(rng: random.Random, size: float, until: float) -> str:
    """A quantity that begins with zero, with a kink at the end of a step or none."""
    most = _of(rng, -1.0, 1.0) * size
    kind = rng.randrange(3)
    if kind == 0:
        return f"{most:.6g} * min(t / {0.5 * until!r}, 1)"
    if kind == 1:
        return f"{most:.6g} * sin({_of(rng, 2.0, 9.0) / until!r} * t)"
    return f"{most:.6g} * t / {until!r}"


def _load_in_time(rng: random.Random, size: float, until: float, begins: bool) -> float | str:
    return _of(rng, -2.0, 1.0) * size if not begins and rng.random() < 0.5 else _ramp(rng, 2.0 * size, until)


def _normal(rng: random.Random, size: float, length: float, free: bool) -> tuple[dict[str, Any], str | None]:
    """A law that is straight on its pieces, some of which fall, and its table; ``free`` of force at 0 if asked for."""
    stiff = size * 10.0 ** rng.uniform(-0.5, 1.0)
    fall = stiff * _of(rng, 0.1, 1.5)
    glue = {"law": "adhesive", "stiffness": stiff, "strength": 0.05 * stiff * length, "softening": fall}
    kind = rng.randrange(7)
    if kind == 4 and not free:
        knots = sorted(rng.uniform(-0.5, 0.5) * length for _ in range(rng.randrange(1, 4)))
        forces, r = [0.0], [knots[0] - 0.2 * length]
        for knot in knots:
            forces.append(forces[-1] + rng.choice([1.0, 1.0, -0.5]) * stiff * rng.uniform(0.0, 1.0) * (knot - r[-1]))
            r.append(knot)
        rows = zip([*r, 0.6 * length], [*forces, forces[-1] + 0.2 * stiff * length], strict=True)
        return {"law": "table", "file": "law.csv"}, "".join(f"{a!r},{b!r}\n" for a, b in rows)
    found: dict[int, dict[str, Any]] = {
        0: {"law": "signorini"},
        1: {"law": "compliance", "stiffness": stiff},
        2: {"law": "survey", "q_max": 0.02 * size, "p_const": stiff},
        3: {"law": "softening", "stiffness": stiff, "limit": 0.1 * length, "softening": fall},
        4: {"law": "none"},
        5: glue,
        6: {**glue, "compression": stiff},
    }
    return found[kind], None


def _friction(rng: random.Random, size: float) -> dict[str, Any] | None:
    kind = rng.randrange(6)
    if kind == 0:
        return None
    if kind == 1:
        return {"law": "tresca", "bound": size * _of(rng, 0.05, 1.0)}
    if kind == 2:
        values = [1.0, _of(rng, 0.5, 1.2), 0.5]
        return {
            "law": "slip-table",
            "of": "rate",
            "bound": size * _of(rng, 0.05, 1.0),
            "slips": [0.0, 0.1, 0.2],
            "values": values,
        }
    if kind == 3:
        return {"law": "tresca", "bound": {"formula": f"{size * _of(rng, 1.0, 20.0):.4f}*s"}}
    return {"law": "coulomb", "coefficient": _of(rng, 0.05, 1.0)}
