"""Small problems to begin with, as dictionaries; and random ones that state real physics."""

from __future__ import annotations

import copy
import json
import random
from typing import Any

from hemivar.laws.registry import NORMAL_LAWS
from tests.robustness.msh import grid_mesh, write_msh

__all__ = ["FILES", "METHODS", "SEEDS", "known", "random_law", "random_problem", "seed"]

METHODS = (
    "newton", "multigrid", "direct-lbfgs", "direct-powell", "bundle", "augmented-lagrangian",
    "augmented-lagrangian-newton", "active-set", "active-set-krylov",
)  # fmt: skip

#: Files that the seeds name.
FILES: dict[str, bytes] = {
    "law.csv": b"r,derivative\n-0.05,0\n0,0\n0,0.1\n0.1,0.6\n0.1,0.4\n0.5,0.9\n",
    "friction.csv": b"r,derivative\n0,1.0\n0.01,0.8\n0.1,0.6\n",
    "bound.csv": b"s,bound\n0,0.05\n0.05,0.3\n0.2,0.5\n",
    "part.msh": write_msh(grid_mesh(4, 4, regions=2)),
    "old.msh": write_msh(grid_mesh(4, 3), "2.2"),
    "block.msh": write_msh(grid_mesh(2, 2, 2)),
}

_SQUARE = {"rectangle": [1.0, 1.0], "cells": [6, 6], "pattern": "cross"}
_LAME = {"lame": [4.0, 4.0]}
_DOWN = {"body": [-0.8, -0.8]}
_LEFT = {"left": "clamped"}
_SURVEY = {"law": "survey", "q_max": 0.3, "p_const": 2.0}
_TRESCA = {"law": "tresca", "bound": 0.5}


def _block(normal: Any, friction: Any = "none", **others: Any) -> dict[str, Any]:
    problem = {
        "title": "a block", "mesh": _SQUARE, "material": _LAME, "loads": _DOWN, "supports": _LEFT,
        "contact": {"bottom": {"normal": normal, "friction": friction}},
    }  # fmt: skip
    return {**problem, **others}


SEEDS: dict[str, dict[str, Any]] = {
    "survey": _block(_SURVEY, _TRESCA),
    "logarithmic": _block(_SURVEY, {"law": "logarithmic", "bound": 0.25}),
    "rigid": _block("signorini", {"law": "coulomb", "coefficient": 0.3}),
    "between walls": {
        "mesh": _SQUARE, "material": _LAME, "loads": {"body": [0.0, -1.0]},
        "supports": {"left": "roller", "right": "roller", "top": "clamped"}, "contact": {"bottom": {"normal": _SURVEY}},
    },
    "breaks": _block(
        {"law": "capped", "stiffness": 20.0, "limit": 0.1},
        {"law": "logarithmic", "bound": {"formula": "min(max(8*s, 0), 0.8)"}},
        mesh={"rectangle": [2.0, 1.0], "cells": [8, 4]},
    ),
    "softens": _block({"law": "softening", "stiffness": 10.0, "limit": 0.05, "softening": 1.0}, _TRESCA),
    "layers": _block(
        {"law": "layered", "thicknesses": [0.05, 0.1], "stiffnesses": [3.0, 10.0], "drops": [0.0, 0.1], "base": 5.0},
        {"law": "slip-weakening", "bound": 0.2, "rate": 3.0},
    ),
    "ends": _block({"law": "finite-penetration", "stiffness": 4.0, "limit": 0.05},
                   {"law": "static-kinetic", "bound": 0.2, "slip": 0.01}),
    "held": _block("bilateral", {"law": "slip-table", "bound": 0.3, "slips": [0.0, 0.05], "values": [1.0, 0.5]}),
    "from lists": _block(
        {"law": "pressure-table", "penetrations": [-0.02, 0.0, 0.05, 0.05, 0.2], "pressures": [0.0, 0.0, 0.6, 0.4, 1.0],
         "extend": "linear"},
        {"law": "slip-table", "bound": 0.2, "slips": [0.0, 0.05], "values": [1.0, 0.5]},
    ),
    "from tables": _block(
        {"law": "table", "file": "law.csv"},
        {"law": "table", "file": "friction.csv", "bound": {"table": "bound.csv"}},
    ),
    "formulas": _block(
        {"law": "formula", "potential": "piecewise((0, r < 0), (5*r^2, r < 0.1), (0.05 + (r - 0.1), True))"},
        {"law": "formula", "potential": "log(1 + r)", "bound": {"formula": "min(8*s, 0.2)"}},
        loads={"body": ["-0.5*y", "-0.8 - 0.1*sin(pi*x)"], "pressure": {"top": "0.1*x"}},
    ),
    "glued": {
        "title": "a strip", "mesh": {"rectangle": [0.08, 0.01], "cells": [10, 2], "pattern": "cross"},
        "material": {"young": 1.378e8, "poisson": 0.3, "plane": "stress"}, "loads": {"traction": {"top": [0.0,
        26.2e3]}},
        "supports": _LEFT,
        "contact": {"bottom": {"normal": {"law": "saw-tooth", "openings": [0.5e-3, 1e-3, 2e-3],
                                          "slopes": [60e6, 20e6, 10e6], "offsets": [0.0, 10e3, 5e3]}}},
    },
    "adhesive": _block({"law": "adhesive", "stiffness": 30.0, "strength": 0.5, "softening": 2.0},
                       loads={"body": [0.1, 0.5]}),
    "cylinder": {
        "mesh": {"rectangle": [20.0, 20.0], "cells": [8, 8], "pattern": "cross"},
        "material": {"young": 210e3, "poisson": 0.3}, "supports": {"left": {"x": 0.0}, "top": {"displacement": [0.0,
        -0.04]}},
        "contact": {"bottom": {"normal": "signorini", "obstacle": {"sphere": {"center": [0.0, -200.0],
        "radius": 200.0}},
                               "normals": "body"}},
    },
    "plane": _block("signorini", loads={"body": [0.0, -1.0]}) | {
        "contact": {"bottom": {"normal": "signorini", "obstacle": {"plane": {"point": [0.0, -0.01], "normal": [0.1,
        1.0]}}}}
    },
    "distance": _block("signorini", loads={"body": [0.0, -1.0]}) | {
        "contact": {"bottom": {"normal": {"law": "compliance", "stiffness": 50.0, "exponent": 1.5},
                               "obstacle": {"distance": "sqrt((x - 0.5)^2 + (y + 5)^2) - 5"}}}
    },
    "sheet": {
        "title": "sheet on a soft mat", "mesh": {"rectangle": [2.0, 0.5], "cells": [6, 2], "order": 2},
        "material": {"young": 5.0, "poisson": 0.45, "plane": "stress"},
        "loads": {"body": [0.0, -0.05], "pressure": {"top": "0.1 + 0.2 * x"}},
        "supports": {"left": "roller", "right": {"x": -0.01}},
        "contact": {"bottom": {"normal": {"law": "compliance", "stiffness": "8 + 4 * sin(pi * x / 2)"},
                               "friction": {"law": "tresca", "bound": 0.02}}},
        "solver": {"rtol": 1e-8},
    },
    "midpoints": _block(_SURVEY, _TRESCA, mesh={**_SQUARE, "quadrature": "midpoint"}),
    "punch": _block("signorini", {"law": "tresca", "bound": "0.6*exp(-(x/4)^2)"},
                    supports={"top": {"displacement": [0.0, -0.02]}}, loads={}) | {
        "contact": {"bottom": {"normal": "signorini", "gap": "0.05*x^2", "friction": {"law": "tresca", "bound": 0.1}}}
    },
    "two sides": _block(_SURVEY) | {
        "supports": {"left": {"x": 0.0}},
        "contact": {"bottom": {"normal": _SURVEY}, "top": {"normal": {"law": "compliance", "stiffness": 3.0}}},
    },
    "corner": _block(_SURVEY) | {
        "supports": {"left": "clamped"},
        "contact": {"bottom": {"normal": _SURVEY, "friction": _TRESCA}, "right": {"normal": "signorini", "gap": 0.001}},
        "loads": {"body": [0.3, -0.8]},
    },
    "regions": {
        "mesh": {"file": "part.msh"},
        "material": {"regions": {"part1": {"lame": [4.0, 4.0]}, "part2": {"young": 3.0, "poisson": 0.4}}},
        "loads": {"body": [-0.4, -0.8]}, "supports": _LEFT, "contact": {"bottom": {"normal": _SURVEY,
        "friction": _TRESCA}},
    },
    "old mesh": {
        "mesh": {"file": "old.msh", "scale": 0.5, "refine": 0}, "material": _LAME, "loads": {"body": [0.0, -2.0]},
        "supports": {"left": {"x": 0.0}, "right": {"x": 0.0}}, "contact": {"bottom": {"normal": _SURVEY}},
    },
    "cube": {
        "title": "cube", "mesh": {"box": [1.0, 1.0, 1.0], "cells": [3, 3, 2]}, "material": _LAME,
        "loads": {"body": [-0.8, -0.4, -0.8]}, "supports": _LEFT, "contact": {"bottom": {"normal": _SURVEY,
        "friction": _TRESCA}},
    },
    "cube of a file": {
        "mesh": {"file": "block.msh"}, "material": _LAME, "loads": {"body": [-0.8, -0.4, -0.8]}, "supports": _LEFT,
        "contact": {"bottom": {"normal": "signorini", "friction": {"law": "coulomb", "coefficient": 0.2}}},
    },
    "sphere": {
        "mesh": {"box": [12.0, 12.0, 12.0], "cells": [3, 3, 3]}, "material": {"young": 210e3, "poisson": 0.3},
        "supports": {"left": {"x": 0.0}, "front": {"y": 0.0}, "top": {"displacement": [0.0, 0.0, -0.06]}},
        "contact": {"bottom": {"normal": "signorini",
                               "obstacle": {"sphere": {"center": [0.0, 0.0, -200.0], "radius": 200.0}}}},
    },
    "tensor": _block(_SURVEY, _TRESCA, material={"tensor": [[12.0, 4.0, 0.0], [4.0, 12.0, 0.0], [0.0, 0.0, 4.0]]}),
}  # fmt: skip

#: Laws by name that stand in no seed.
_SEEN = {json.dumps(one["contact"]["bottom"]["normal"]) for one in SEEDS.values()}
SEEDS |= {
    name: _block({"law": name, **entry.example})
    for name, entry in NORMAL_LAWS.items()
    if not any(f'"{name}"' in one for one in _SEEN) and entry.example is not None
}


def known(name: str) -> dict[str, Any]:
    """The seed of this name, as a copy: what is done to it must not reach other cases."""
    return copy.deepcopy(SEEDS[name])


def seed(rng: random.Random) -> tuple[str, dict[str, Any]]:
    """One of the seeds, as a copy, and its name."""
    name = rng.choice(list(SEEDS))
    return name, known(name)


def _spread(rng: random.Random, middle: float, decades: float = 1.0) -> float:
    return float(f"{middle * 10.0 ** rng.uniform(-decades, decades):.4g}")


def random_law(rng: random.Random, force: float, length: float) -> dict[str, Any]:
    """A normal law for pressures about ``force`` at penetrations about ``length``."""
    k, d = force / length, 1.5
    brittle = {"law": "adhesive", "stiffness": _spread(rng, k, d), "strength": _spread(rng, force, d)}
    count = rng.randint(1, 3)
    knots = sorted(_spread(rng, length, d) for _ in range(count))
    laws = [
        {"law": "survey", "q_max": _spread(rng, force, d), "p_const": _spread(rng, k, d)},
        {"law": "survey", "q_max": _spread(rng, force, d)},
        {"law": "signorini"},
        {"law": "compliance", "stiffness": _spread(rng, k, d)},
        {"law": "compliance", "stiffness": _spread(rng, k / length**0.5, d), "exponent": rng.choice([1.5, 2.0, 3.0])},
        {"law": "bilateral"},
        {"law": "softening", "stiffness": _spread(rng, k, d), "limit": _spread(rng, length),
        "softening": _spread(rng, k, d)},
        {"law": "capped", "stiffness": _spread(rng, k, d), "limit": _spread(rng, length),
        "residual": rng.choice([0.0, 0.5, 1.0, 2.0])},
        {"law": "finite-penetration", "stiffness": _spread(rng, k, d), "limit": _spread(rng, length, d)},
        brittle,
        {**brittle, "softening": _spread(rng, k, d)},
        {**brittle, "softening": _spread(rng, k, d), "compression": _spread(rng, k, d)},
        {"law": "layered", "thicknesses": knots, "stiffnesses": [_spread(rng, k, d) for _ in knots],
         "drops": [_spread(rng, force) * rng.choice([0.0, 0.1]) for _ in knots], "base": _spread(rng, k, d)},
        {"law": "saw-tooth", "openings": knots, "slopes": [_spread(rng, k, d) for _ in knots]},
        {"law": "formula", "potential": f"{_spread(rng, k)}*max(r, 0)^2/2", "reach": 10.0 * length},
        {"law": "formula", "potential": f"{_spread(rng, force)}*(sqrt(r^2 + {length**2}) + r)", "reach": 10.0 * length},
        {"law": "formula", "reach": 10.0 * length,
         "potential": f"piecewise((0, r < 0), ({k!r}*r^2, r < {length!r}), "
            f"({k * length**2!r} + {_spread(rng, force)!r}*(r - {length!r}), True))"},
    ]  # fmt: skip
    return rng.choice(laws)


def _random_friction(rng: random.Random, force: float, length: float) -> dict[str, Any]:
    bound: Any = rng.choice(
        [
            _spread(rng, force, 1.5), f"{force:.3g}*(1 + x)", {"coulomb": rng.choice([0.1, 0.5, 1.0])},
            {"formula": f"min({force / length:.3g}*max(s, 0), {force:.3g})"},
            {"formula": f"{force:.3g}*(1 + tanh(s/{length:.3g}))"},
        ]
    )  # fmt: skip
    laws = [
        {"law": "none"},
        {"law": "tresca", "bound": bound},
        {"law": "tresca", "bound": _spread(rng, force, 1.5)},
        {"law": "coulomb", "coefficient": rng.choice([0.05, 0.3, 1.0])},
        {"law": "slip-weakening", "bound": bound, "rate": _spread(rng, 1.0 / length, 2.0)},
        {"law": "logarithmic", "bound": _spread(rng, force * length), "scale": _spread(rng, length)},
        {"law": "static-kinetic", "bound": bound, "slip": _spread(rng, length), "kinetic": 0.6},
        {"law": "slip-table", "bound": bound, "slips": [0.0, length, 3.0 * length], "values": [1.0, 0.7,
        rng.choice([0.2, 1.5])]},
        {"law": "formula", "potential": f"r + log(1 + r/{length:.3g})*{length:.3g}", "bound": bound},
    ]  # fmt: skip
    return rng.choice(laws)


def random_problem(rng: random.Random) -> dict[str, Any]:
    """A problem with numbers that make sense together, in units from tiny to huge."""
    dim = 3 if rng.random() < 0.2 else 2
    length = 10.0 ** rng.choice([0, 0, 0, 0, -3, 3, -9, 9, -60, 60])
    modulus = 10.0 ** rng.choice([0, 0, 0, 1, 5, -6, 11, -60, 60])
    strain = 10.0 ** rng.uniform(-4, -1)
    force, motion = modulus * strain, length * strain
    sides = ["left", "right", "bottom", "top"] + (["front", "back"] if dim == 3 else [])
    size = [float(f"{length * rng.choice([1.0, 1.0, 2.0, 0.5, 8.0]):.4g}") for _ in range(dim)]
    mesh: dict[str, Any] = {"box" if dim == 3 else "rectangle": size}
    mesh["cells"] = [rng.randint(1, 3 if dim == 3 else 7) for _ in range(dim)]
    if dim == 2:
        mesh["pattern"] = rng.choice(["right", "left", "cross"])
        mesh["order"] = rng.choice([1, 1, 2])
        if rng.random() < 0.15:
            mesh["quadrature"] = "midpoint"
    if rng.random() < 0.2:
        mesh["origin"] = [rng.choice([-1.0, 0.0, 3.0, 1e3]) * length for _ in range(dim)]
    if rng.random() < 0.15:
        mesh["refine"] = 1
    nu = rng.choice([0.0, 0.25, 0.3, 0.45, 0.49, 0.4999, -0.5, -0.95, rng.uniform(-0.9, 0.49)])
    material = rng.choice(
        [
            {"young": modulus, "poisson": nu},
            {"lame": [modulus * rng.uniform(0.0, 3.0), modulus]},
            {"young": f"{modulus!r}*(1 + x/{length!r})", "poisson": 0.3},
        ]
    )
    if dim == 2 and rng.random() < 0.3:
        material["plane"] = rng.choice(["strain", "stress"])
    touching = rng.choice(sides)
    others = [s for s in sides if s != touching]
    contact: dict[str, Any] = {
        touching: {"normal": random_law(rng, force, motion), "friction": _random_friction(rng, force, motion)}
    }
    if rng.random() < 0.5:
        contact[touching]["gap"] = rng.choice(
            [0.1 * motion, -0.1 * motion, motion, f"{motion!r}*(x/{length!r})^2", 1e6 * length, 0.0]
        )
    supports: dict[str, Any] = {}
    for side in rng.sample(others, rng.choice([0, 1, 1, 1, 1, 2, 2])):
        supports[side] = rng.choice(["clamped", "clamped", "clamped", "roller", {rng.choice("xyz"[:dim]): 0.0}])
    if rng.random() < 0.25:
        supports = {others[-1]: {"displacement": [round(rng.uniform(-1, 1), 3) * motion for _ in range(dim)]}}
    if rng.random() < 0.15:
        free = [s for s in others if s not in supports]
        if free:
            contact[rng.choice(free)] = {"normal": random_law(rng, force, motion)}
    loads: dict[str, Any] = {}
    if rng.random() < 0.8:
        loads["body"] = [round(rng.uniform(-1, 1), 3) * force / length for _ in range(dim)]
        if rng.random() < 0.2:
            loads["body"][0] = f"{force / length!r}*sin(x/{length!r})"
    if rng.random() < 0.4:
        side = rng.choice(others)
        loads["traction"] = {side: [round(rng.uniform(-1, 1), 3) * force for _ in range(dim)]}
    elif rng.random() < 0.3:
        loads["pressure"] = {rng.choice(sides): round(rng.uniform(-1, 1), 3) * force}
    return {"mesh": mesh, "material": material, "loads": loads, "supports": supports, "contact": contact}
