"""Thousands of wrong arrays for the compiled kernels of patches and stars."""

from __future__ import annotations

import pytest

from tests.kernels import test_mesh_sums_fuzz
from tests.samples import slow

_FUZZ_PATCHES = """
from hemivar.bounds.compiled_patches import CompiledPatches, PatchOrder, Prices
from hemivar.bounds.facet_table import facet_table
from hemivar.bounds.patches import PatchKind, cell_patches, patch_sides
from hemivar.bounds.split_element import split_element
from hemivar.mesh import box, rectangle

def body(dim):
    mesh = rectangle((1.0, 1.0), 2) if dim == 2 else box((1.0, 1.0, 1.0), 1)
    table, element = facet_table(mesh), split_element(dim)
    kind = list(PatchKind)[rng.integers(3)]
    v, count, facets = len(element.values[0, 0]), len(table.cells), len(table.facets)
    root = rng.standard_normal((count, v, v))
    upper = (root @ root.transpose(0, 2, 1))[:, *element.upper]
    made = dict(compliance=upper, gradients=table.gradients, signs=table.signs,
                cell_facets=table.cell_facets, facet_nodes=table.facets, points=mesh.points, alike=np.arange(count))
    patches = cell_patches(table, kind)
    ordered = dict(patches=patches, chosen=rng.uniform(size=int(patches.max()) + 1) < 0.9)
    block = element.block
    improved = dict(sides=patch_sides(dim, kind), free=rng.uniform(size=facets) < 0.9,
                    slope=rng.standard_normal((count, element.moments)), moments=np.zeros((facets, dim, dim)))
    rows = np.where(rng.uniform(size=facets) < 0.3, rng.integers(3, size=facets), -1)
    priced = dict(rows=rows, matrices=np.tile(np.eye(block), (3, 1, 1)), offsets=np.ones((3, block)))
    return element, made, ordered, improved, priced

raised = done = 0
for turn in range(int(sys.argv[2])):
    element, made, ordered, improved, priced = body(int(rng.choice([2, 3])))
    def maybe(given):
        if rng.uniform() < 0.3:
            name = list(given)[rng.integers(len(given))]
            given = given | {name: spoiled(given[name])}
        return given
    try:
        patches = CompiledPatches(library, element, **maybe(made))
        order = patches.ordered(**maybe(ordered))
        parts = maybe({name: getattr(order, name) for name in ("start", "seen", "order", "bounds")})
        prices = Prices(**maybe(priced)) if rng.uniform() < 0.5 else None
        patches.improve(PatchOrder(**parts), **maybe(improved), prices=prices)
        done += 1
    except (ValueError, TypeError, OverflowError, IndexError, AttributeError, MemoryError):
        raised += 1
print(raised, done)
"""

_FUZZ_STARS = """
import contextlib
from hemivar.bounds.compiled_stars import CompiledStars
from hemivar.bounds.facet_table import facet_table
from hemivar.kernels.mesh_sums import alike_rows, mesh_facets, mesh_geometry, mesh_stars
from hemivar.mesh import box, rectangle

raised = done = 0
for turn in range(int(sys.argv[2])):
    mesh = rectangle((1.0, 1.0), 2) if rng.uniform() < 0.5 else box((1.0, 1.0, 1.0), 1)
    table, d, N = facet_table(mesh), mesh.dim, mesh.number_of_nodes
    M, F = len(table.cells), len(table.facets)
    start, pairs, place = table.stars
    given = dict(cell_nodes=table.cells, cell_facets=table.cell_facets, owners=table.owners, interior=table.interior,
                 contact=rng.uniform(size=F) < 0.3, measures=table.measures, volumes=table.volumes, dear=np.ones(M),
                 forces=rng.standard_normal((M, d + 1, d)), loads=np.zeros((M, d + 1, d)), given=np.zeros((F, d, d)),
                 outer=np.arange(F), unknown=np.tile(np.eye(d), (F, 1, 1)), start=start, pairs=pairs, place=place)
    if rng.uniform() < 0.5:
        given |= dict(own=np.zeros((M, d + 1, d, d)), pressures=np.zeros((F, d, d)), missed=np.ones((N, d)))
    cells, placed, second = np.array(table.cells), np.array(table.cells), rng.uniform(size=table.cells.shape) < 0.3
    vertices, points, numbers, signs = np.arange(N), np.array(mesh.points), table.cell_facets, table.signs
    for _ in range(rng.integers(3)):
        name = str(rng.choice([*given, "cells", "placed", "second", "vertices", "points", "numbers", "signs"]))
        with contextlib.suppress(Exception):
            if name in given:
                given[name] = spoiled(given[name])
            else:
                vars()[name] = spoiled(vars()[name])
    nodes = int(rng.choice([N, N, N, N, N - 1, 0, -1, N + 1, 2**40]))
    for work in (lambda: CompiledStars(library, N, given).settled(),
                 lambda: CompiledStars(library, N, given).on_contact(vertices),
                 lambda: mesh_facets(cells, placed, nodes, second), lambda: mesh_stars(cells, nodes),
                 lambda: mesh_geometry(points, cells, numbers, signs, F),
                 lambda: alike_rows(points, points * 2.0, 1e-9)):
        try:
            work()
            done += 1
        except (ValueError, TypeError, OverflowError, IndexError, MemoryError, AttributeError):
            raised += 1
print(raised, done)
"""


@test_mesh_sums_fuzz.built
@pytest.mark.parametrize("seed", [1, slow(2)])
@pytest.mark.parametrize(("script", "turns"), [(_FUZZ_PATCHES, 2000), (_FUZZ_STARS, 1000)], ids=["patches", "stars"])
def test_no_wrong_array_ends_the_process(script: str, turns: int, seed: int) -> None:
    test_mesh_sums_fuzz.test_no_wrong_array_ends_the_process(script, turns, seed)
