"""Memory is predicted before anything large is made: quickly, in one sentence, without making it."""

from __future__ import annotations

import tracemalloc
from collections.abc import Callable

import pytest

import hemivar.basics.memory as machine
from hemivar.errors import ProblemError
from hemivar.fem import discretize
from hemivar.laws import Signorini
from hemivar.mechanics import Clamped, Contact, ContactProblem, Material
from hemivar.mesh import Mesh, box, rectangle


@pytest.mark.parametrize(
    "make",
    [
        lambda: rectangle(cells=10**7),
        lambda: rectangle(cells=10**400),
        lambda: rectangle(cells=(10**9, 1)),
        lambda: box(cells=10**5),
        lambda: rectangle(cells=2).refined(40),
        lambda: box(cells=2).refined(1000),
    ],
)
def test_meshes_that_do_not_fit_are_refused_before_they_are_made(make: Callable[[], object]) -> None:
    tracemalloc.start()
    try:
        with pytest.raises(ProblemError, match=r"a mesh of .* cells needs about .* of memory, and .* free"):
            make()
        assert tracemalloc.get_traced_memory()[1] < 2**20
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize(
    ("make", "cells", "order"), [(rectangle, 300, 1), (box, 30, 1), (rectangle, 80, 2), (box, 10, 2)]
)
def test_prediction_is_what_is_taken(make: Callable[..., Mesh], cells: int, order: int) -> None:
    """The peak of what numpy allocates is not above the prediction, and not far below it."""

    def discretized(count: int) -> Mesh:
        mesh = make(cells=count)
        contact = {} if mesh.dim == 3 and order == 2 else {"bottom": Contact(Signorini())}
        discretize(ContactProblem(mesh, Material.lame(1.0, 1.0), contact, {"top": Clamped()}, order=order))
        return mesh

    discretized(2)
    tracemalloc.start()
    try:
        mesh = discretized(cells)
        taken = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    told = machine.problem_bytes(mesh.dim, mesh.number_of_cells, order)
    assert 0.9 * taken < told < 3.0 * taken
    assert machine.problem_bytes(2, 1e6, parts=4) == machine.problem_bytes(2, 1e6) / 4
