"""Run by mpirun: energy, forces and linear bodies of a nonlinear body, as JSON.  ``derivatives.py PROBLEM``."""

import json
import sys

import numpy as np

from hemivar.basics.types import Array
from hemivar.ranks import world
from hemivar.ranks.petsc_engine import all_or_none
from tests.ranks.stated import body_of_file

ranks = world()
with all_or_none(ranks):
    body = body_of_file(sys.argv[1])
    points, step = body.piece.mesh.points, 1e-6

    def moved(size: float, turn: float) -> Array:
        """Unknowns of a smooth field that strains the body by about ``size``."""
        return body.restrict(size * np.sin(2.0 * points + turn) + body.prescribed)

    def dot(one: Array, other: Array) -> float:
        return float(ranks.total(float(one @ other))[0])

    x, way = moved(0.05, 0.3), moved(0.05, 1.2)
    force = body.out_of_balance(x)
    tangent, above, below = body.tangent_at(x, force), body.above_at(x, force), body.below_all()
    assert below is not None
    there = [body.out_of_balance(x + sign * step * way) for sign in (1.0, -1.0)]
    said = {
        "force": dot(force, way),
        "slope of the energy": (body.energy(x + step * way) - body.energy(x - step * way)) / (2.0 * step),
        "tangent": dot(way, tangent.multiply(way)),
        "slope of the force": dot(way, there[1] - there[0]) / (2.0 * step),
        "balance of the tangent": float(ranks.norms(tangent.out_of_balance(x) - force)[0] / ranks.norms(force)[0]),
        "gain": body.energy(x + way) - body.energy(x) + dot(force, way),
        "gain above": 0.5 * dot(way, above.multiply(way)),
        "gain below": 0.5 * dot(way, below.multiply(way)),
    }
    if ranks.rank == 0:
        print(json.dumps(said))
