"""Solutions shared by the tests of reports and files."""

from __future__ import annotations

import os
from typing import TypedDict, Unpack

import numpy as np
import pytest
from threadpoolctl import ThreadpoolController

from hemivar.basics.types import Array
from hemivar.fem import discretize
from hemivar.gallery import elastic_bar, survey
from hemivar.laws import Signorini, ThresholdCompliance, Tresca
from hemivar.mechanics import Contact, ContactProblem, Material, Prescribed, Quadrature
from hemivar.mesh import Mesh, rectangle
from hemivar.solvers import Solution, solve
from tests import bodies


def pytest_configure() -> None:
    """One thread of BLAS for each worker, and for what it starts: threads of several wait for one another's cores."""
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(name, "1")
    for library in ThreadpoolController().select(user_api="blas").lib_controllers:
        library.set_num_threads(1)


@pytest.fixture(scope="session")
def plane() -> Solution:
    """The survey's Figure 4, in which some points stick and some slip."""
    return solve(discretize(survey("figure4", 16))).raise_for_status()


@pytest.fixture(scope="session")
def bar() -> Solution:
    return solve(elastic_bar()).raise_for_status()


class Discretisation(TypedDict, total=False):
    order: int
    quadrature: Quadrature


def below(points: Array) -> Array:
    """The gap to a flat foundation at y = 0."""
    return np.asarray(points[:, 1])


def curved_problem(**options: Unpack[Discretisation]) -> ContactProblem:
    square = rectangle((2.0, 1.0), 8, origin=(-1.0, 0.0))
    x, y = square.points.T
    points = np.column_stack([x, y + (1.0 - y) * 0.35 * x**2])
    left = np.flatnonzero(x[square.cells].mean(axis=1) < 0.0)
    mesh = Mesh(points, square.cells, dict(square.boundaries), {"left half": left})
    return ContactProblem(
        mesh,
        Material.lame(4.0, 4.0),
        contact={"bottom": Contact(Signorini(), Tresca(0.05), gap=below)},
        supports={"top": Prescribed((0.03, -0.1))},
        **options,
    )


CURVED: dict[str, Discretisation] = {"P1": {}, "P2": {"order": 2}, "midpoint": {"quadrature": Quadrature.MIDPOINT}}


@pytest.fixture(scope="session", params=CURVED)
def curved(request: pytest.FixtureRequest) -> Solution:
    """A curved contact boundary with a gap."""
    return solve(discretize(curved_problem(**CURVED[request.param]))).raise_for_status()


@pytest.fixture(scope="session")
def solid() -> Solution:
    """A brick of 2 x 2 x 1 cubes, clamped at x = 0, on its bottom."""
    x, y, z = (np.linspace(0.0, 1.0, k) for k in (3, 3, 2))
    points = np.stack(np.meshgrid(x, y, z, indexing="ij"), axis=-1).reshape(-1, 3)
    number = np.arange(18).reshape(3, 3, 2)
    corner = [number[i : i + 2, j : j + 2, 0:2].reshape(8) for i in range(2) for j in range(2)]
    six = [(0, 1, 3, 7), (0, 1, 5, 7), (0, 2, 3, 7), (0, 2, 6, 7), (0, 4, 5, 7), (0, 4, 6, 7)]
    cells = np.array([[c[k] for k in tetra] for c in corner for tetra in six])
    mesh = Mesh.oriented(points, cells).with_boundaries(
        {"left": lambda p: p[:, 0] < 1e-9, "bottom": lambda p: p[:, 2] < 1e-9}
    )
    problem = bodies.body(mesh, Contact(ThresholdCompliance(0.3, 2.0), Tresca(0.1)), body_force=(0.4, 0.2, -1.0))
    return solve(discretize(problem)).raise_for_status()


@pytest.fixture(scope="session", params=["plane", "solid", *CURVED])
def body(request: pytest.FixtureRequest) -> Solution:
    """All of the problems with a mesh."""
    if request.param in CURVED:
        return solve(discretize(curved_problem(**CURVED[request.param]))).raise_for_status()
    solution: Solution = request.getfixturevalue(request.param)
    return solution
