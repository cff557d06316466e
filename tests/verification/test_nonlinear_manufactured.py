"""A displacement chosen beforehand in a body of Hencky's material on springs: rates in the plane and in space."""

from __future__ import annotations

import numpy as np
import pytest

import hemivar as hv
from hemivar.basics.types import Array
from tests.samples import slow

BULK, SHEAR, LEFT, SIZE = 20 / 3, 4.0, 0.25, 0.05
SPRING, PUSHED, WIDENED, BENT = 10.0, 0.05, 0.02, 0.03


def displacement(x: Array) -> Array:
    """No shear at the bottom: the last component is constant there, the others do not change upwards."""
    up, across = x[:, -1], x[:, 0] * (1.0 - x[:, 0])
    sides = [WIDENED * x[:, k] * (1.0 - x[:, k]) * np.cos(np.pi * up) for k in range(x.shape[1] - 1)]
    return np.column_stack([*sides, -PUSHED * (1.0 + up) + BENT * up**2 * across])


def gradient(x: Array) -> Array:
    up, across = x[:, -1], x[:, 0] * (1.0 - x[:, 0])
    found, last = np.zeros((len(x), x.shape[1], x.shape[1])), x.shape[1] - 1
    for k in range(last):
        found[:, k, k] = WIDENED * (1.0 - 2.0 * x[:, k]) * np.cos(np.pi * up)
        found[:, k, last] = -np.pi * WIDENED * x[:, k] * (1.0 - x[:, k]) * np.sin(np.pi * up)
    found[:, last, last] = -PUSHED + 2.0 * BENT * up * across
    found[:, last, 0] += BENT * up**2 * (1.0 - 2.0 * x[:, 0])
    return found


def stress(x: Array) -> Array:
    """By the formula of the material, in space; written apart from the library."""
    dim = x.shape[1]
    strain = np.zeros((len(x), 3, 3))
    slopes = gradient(x)
    strain[:, :dim, :dim] = 0.5 * (slopes + slopes.transpose(0, 2, 1))
    trace = np.einsum("kii->k", strain)
    deviator = strain - trace[:, None, None] * np.eye(3) / 3.0
    size = np.einsum("kij,kij->k", deviator, deviator)
    phi = 2.0 * SHEAR * (LEFT + (1.0 - LEFT) / np.sqrt(1.0 + size / SIZE**2))
    whole = BULK * trace[:, None, None] * np.eye(3) + phi[:, None, None] * deviator
    return whole[:, :dim, :dim]


def body_force(x: Array) -> Array:
    """``-div sigma``, by differences that are off by 1e-10."""
    force, h = np.zeros(x.shape), 1e-3
    for k in range(x.shape[1]):
        step = np.eye(x.shape[1])[k] * h
        near, far = (stress(x + a * step)[:, :, k] - stress(x - a * step)[:, :, k] for a in (1.0, 2.0))
        force -= (8.0 * near - far) / (12.0 * h)
    return force


def manufactured_problem(dim: int, cells: int, order: int) -> hv.ContactProblem:
    mesh = hv.rectangle((1.0, 1.0), cells) if dim == 2 else hv.box((1.0, 1.0, 1.0), cells)
    others = [name for name in mesh.boundaries if name != "bottom"]

    def gap(x: Array) -> Array:
        return np.asarray(PUSHED + stress(x)[:, -1, -1] / SPRING)

    return hv.ContactProblem(
        mesh,
        hv.Material.hencky(BULK, SHEAR, LEFT, SIZE),
        supports=dict.fromkeys(others, hv.Prescribed(displacement)),
        contact={"bottom": hv.Contact(hv.Compliance(SPRING), gap=gap)},
        body_force=body_force,
        order=order,
    )


@pytest.mark.parametrize(
    ("dim", "order", "sizes", "rate"),
    [(2, 1, (8, 16, 32), 2.0), slow(2, 2, (4, 8, 16), 3.0), slow(3, 1, (4, 8, 12), 2.0)],
)
def test_the_error_falls_at_the_rate_of_the_elements(dim: int, order: int, sizes: tuple[int, ...], rate: float) -> None:
    off = []
    for cells in sizes:
        stated = manufactured_problem(dim, cells, order)
        solution = hv.solve(stated).raise_for_status()
        assert (solution.local[:, 0] > 0.0).all()
        error = solution.displacement - displacement(stated.mesh.nodes(order))
        free = np.abs(error).max(axis=1) > 1e-12 * PUSHED  # supports hold the others exactly
        off.append(np.sqrt(np.mean(error[free] ** 2)))
    found = np.log(off[-2] / off[-1]) / np.log(sizes[-1] / sizes[-2])
    assert found >= rate - 0.15, (off, found)
    assert off[-1] < 2e-3 * PUSHED
