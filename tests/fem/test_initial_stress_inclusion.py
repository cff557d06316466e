"""A stiff circular inclusion that expands, or changes its shape, in a large body: Eshelby's uniform stress."""

from __future__ import annotations

import numpy as np
import pytest

import hemivar as hv
from hemivar.basics.types import Array

#: Young's modulus and Poisson's ratio of the inclusion, and of the body around it.
INSIDE, AROUND = (3000.0, 0.2), (1000.0, 0.3)
#: Radius of the body, in terms of that of the inclusion.
FAR = 30.0


def body_with_inclusion(cells: int, strain: Array, unit: float = 1.0) -> tuple[hv.ContactProblem, Array]:
    """A quarter of it, and which cells are the inclusion: squares around a corner are drawn out to rings."""
    square = hv.rectangle((1.0, 1.0), cells)
    x, y = square.points.T
    ring, short = np.maximum(x, y), np.minimum(x, y)
    radius = np.where(ring <= 1 / 3 + 1e-9, 3.0 * ring, FAR ** (1.5 * ring - 0.5))
    angle = 0.25 * np.pi * np.divide(short, ring, out=np.zeros(len(x)), where=ring > 0.0)
    along, across = radius * np.cos(angle), radius * np.sin(angle)
    points = unit * np.where(x >= y, [along, across], [across, along]).T
    inside = square.points[square.cells].mean(axis=1).max(axis=1) < 1 / 3
    regions = {"inside": np.flatnonzero(inside), "around": np.flatnonzero(~inside)}
    mesh = hv.Mesh(points, square.cells, square.boundaries, regions)
    parts = {name: hv.Material.young(E / unit**2, nu) for name, (E, nu) in (("inside", INSIDE), ("around", AROUND))}
    walls = {"left": "roller", "bottom": "roller"}
    stated = {"supports": walls, "initial_strain": {"inside": strain}}
    return hv.ContactProblem(mesh, hv.Material.by_region(parts), **stated), inside  # type: ignore[arg-type]


def eshelby(strain: Array) -> Array:
    """The stress inside, in plane strain, by the equivalent strain: ``S`` is 1 / (2 (1 - nu)) of an expansion in the
    plane and (3 - 4 nu) / (4 (1 - nu)) of a change of shape."""
    (lam, mu), (lam_around, mu_around) = (
        (E * nu / ((1 + nu) * (1 - 2 * nu)), E / (2 * (1 + nu))) for E, nu in (INSIDE, AROUND)
    )
    nu = AROUND[1]
    expands, shears = 1.0 / (2.0 * (1.0 - nu)), (3.0 - 4.0 * nu) / (4.0 * (1.0 - nu))
    plane, across = strain[:2, :2], strain[2, 2] if len(strain) == 3 else 0.0
    trace = np.trace(plane)
    shape = plane - 0.5 * trace * np.eye(2)
    bulk, bulk_around = lam + mu, lam_around + mu_around
    wanted = bulk * trace + lam * across
    expanded = expands * wanted / (bulk * expands + bulk_around * (1.0 - expands))
    sheared = shears * mu * shape / (mu * shears + mu_around * (1.0 - shears))
    elastic = 0.5 * (expanded - trace) * np.eye(2) + sheared - shape
    return np.asarray(2.0 * mu * elastic + lam * (expanded - trace - across) * np.eye(2))


def errors_of_inclusion(cells: int, strain: Array) -> tuple[float, float]:
    """Of the mean stress inside, and the largest of a cell, as parts of the stress."""
    stated, inside = body_with_inclusion(cells, strain)
    stress, volumes = hv.solve(stated).stress()[inside], stated.mesh.volumes[inside]
    exact = eshelby(strain)
    mean = np.einsum("kij,k->ij", stress, volumes) / volumes.sum()
    size = np.abs(exact).max()
    return float(np.abs(mean - exact).max() / size), float(np.abs(stress - exact).max() / size)


@pytest.mark.parametrize("cells", [12, 24])
@pytest.mark.parametrize(
    "strain", [1e-3 * np.eye(3), np.diag([1e-3, -1e-3]), np.diag([2e-3, 0.0])], ids=["warm", "shape", "along"]
)
def test_the_stress_in_an_inclusion_is_that_of_eshelby(strain: Array, cells: int) -> None:
    coarse, fine = errors_of_inclusion(cells, strain), errors_of_inclusion(2 * cells, strain)
    assert fine[0] < 0.07 * (12 / cells) ** 2
    assert coarse[0] / fine[0] > 3.5  # of second order
    assert coarse[1] / fine[1] > 1.8  # it is as uniform as the elements let it be


def test_an_inclusion_does_not_depend_on_units() -> None:
    one, _ = body_with_inclusion(6, np.diag([1e-3, -1e-3]))
    other, _ = body_with_inclusion(6, np.diag([1e-3, -1e-3]), 1000.0)
    found, expected = hv.solve(other).displacement, hv.solve(one).displacement
    assert np.abs(found / 1000.0 - expected).max() <= 1e-10 * np.abs(expected).max()
