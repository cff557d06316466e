"""Bounds do not depend on units, nor on how the body lies: laws that soften, oblique supports, plane and space."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import hemivar as hv
from hemivar.basics.types import Array
from hemivar.bounds import ExactDistance, exact_distance, lower_bounds
from hemivar.bounds.trace_bounds import TraceBounds


def turned_block(dim: int, turn: Array, length: float, modulus: float) -> hv.ContactProblem:
    """A block on rollers at its left and its back, pressed onto a foundation that softens and rubs."""
    mesh = hv.rectangle((1.2, 1.0), (5, 4), pattern="cross") if dim == 2 else hv.box((1.2, 1.0, 0.9), 2)
    mesh = hv.Mesh(length * mesh.points @ turn.T, mesh.cells, dict(mesh.boundaries))
    law = hv.Softening(8.0 * modulus / length, 0.02 * length, 0.4 * modulus / length)
    friction = hv.laws.SlipTable(0.02 * modulus, (0.0, 0.02 * length), (1.0, 0.7))
    supports: dict[str, hv.Roller | hv.Clamped] = {"left": hv.Roller(), "top": hv.Roller()}
    if dim == 3:
        supports["back"] = hv.Roller()
    force = turn @ np.array([0.5, -0.6, -0.8])[:dim] * modulus / length
    traction = turn @ np.array([0.1, -0.2, 0.1])[:dim] * modulus
    return hv.ContactProblem(
        mesh=mesh,
        material=hv.Material.lame(3.0 * modulus, 2.0 * modulus),
        contact={"bottom": hv.Contact(law, friction, gap=0.002 * length)},
        supports=supports,
        tractions={"right": tuple(traction)},
        body_force=tuple(force),
    )


def bound_in_units(problem: hv.ContactProblem, length: float, modulus: float) -> ExactDistance:
    unit = modulus / length
    constants = TraceBounds(1.1 * unit, 1.3 * unit, 1.2 * unit, unit / length, True, "for this test")
    return exact_distance(problem, hv.solve(problem).displacement, constants)


def rotation_of(dim: int) -> Array:
    q = np.linalg.qr(np.random.default_rng(dim).normal(size=(dim, dim)))[0]
    q[:, 0] *= np.linalg.det(q)
    return q


@pytest.mark.parametrize("dim", [2, 3])
def test_distance(dim: int) -> None:
    plain = bound_in_units(turned_block(dim, np.eye(dim), 1.0, 1.0), 1.0, 1.0)
    assert plain.guaranteed, plain.reasons
    assert 0.1 < plain.constant < 0.9
    for turn, length, modulus in (
        (rotation_of(dim), 1.0, 1.0),
        (np.eye(dim), 1e3, 2e-5),
        (rotation_of(dim), 1e-3, 2e11),
    ):
        found = bound_in_units(turned_block(dim, turn, length, modulus), length, modulus)
        assert found.guaranteed
        assert found.constant == pytest.approx(plain.constant, rel=1e-6)
        # in space tangents are chosen by the axes: rules and sweeps see another basis of the same plane
        assert found.relative == pytest.approx(plain.relative, rel=1e-6)
        energy = np.sqrt(modulus * length**dim)
        for part in ("misfit", "contact"):
            there, here = getattr(found.parts, part) / energy, getattr(plain.parts, part)
            assert there == pytest.approx(here, rel=1e-5, abs=1e-6 * plain.distance)


def test_units_may_be_beyond_single_precision() -> None:
    """Sweeps over patches of few kinds have tables of their own, which hold seven digits."""
    relative = []
    for length, modulus in ((1.0, 1.0), (1.0, 1e45), (1e-20, 1.0), (1e20, 1e-45)):
        problem = turned_block(3, np.eye(3), length, modulus)
        problem = replace(problem, mesh=hv.box((1.2 * length, length, 0.9 * length), 4))
        relative.append(bound_in_units(problem, length, modulus).relative)
    assert relative[1:] == pytest.approx([relative[0]] * 3, rel=1e-10)


@pytest.mark.slow
def test_constants_of_the_body_in_space() -> None:
    plain = lower_bounds(turned_block(3, np.eye(3), 1.0, 1.0), 300)
    other = lower_bounds(turned_block(3, rotation_of(3), 1e-3, 2e11), 300)
    for part in ("both", "normal", "tangential"):
        assert getattr(other, part).lower * 1e-3 / 2e11 == pytest.approx(getattr(plain, part).lower, rel=1e-5)
