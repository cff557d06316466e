"""Patches by NumPy and in the compiled kernels: the same, and what dense linear algebra finds; admissible always."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
import scipy.linalg as la

from hemivar.basics.types import Array, BoolArray
from hemivar.bounds import compiled_patches
from hemivar.bounds.admissible_stress import AdmissibleStress, admissible_stress
from hemivar.bounds.body_data import BodyData, body_data
from hemivar.bounds.compiled_patches import CompiledPatches, PatchOrder, Prices
from hemivar.bounds.contact_traces import contact_traces
from hemivar.bounds.facet_table import facet_table
from hemivar.bounds.patches import (
    PatchKind,
    cell_patches,
    coloured,
    patch_batches,
    patch_sides,
    rigid_modes,
)
from hemivar.bounds.split_element import split_element
from hemivar.bounds.sweeps import ContactPenalty, PatchSmoother
from hemivar.kernels import kernels
from hemivar.mechanics import Clamped, ContactProblem
from hemivar.mesh import box, rectangle
from hemivar.mesh.mesh import Mesh
from hemivar.solvers import solve
from tests.kernels.test_kernels import printed_by_threads
from tests.samples import sampled, slow

from .admissibility import imbalance
from .bodies import BODIES, anisotropic, plane_mesh, space_mesh

built = pytest.mark.skipif(kernels() is None, reason="the kernels are not compiled here")
KINDS = (PatchKind.FACET, PatchKind.EDGE, PatchKind.VERTEX)


def renumbered(mesh: Mesh, seed: int = 4) -> Mesh:
    """The same mesh with its nodes in another order."""
    order = np.random.default_rng(seed).permutation(mesh.number_of_nodes)
    place = np.argsort(order)
    boundaries = {name: place[facets] for name, facets in mesh.boundaries.items()}
    return Mesh(mesh.points[order], place[mesh.cells], boundaries, dict(mesh.regions))


def uneven() -> Mesh:
    """Rings of three to a dozen cells, refined in a corner."""
    mesh = rectangle((1.0, 1.0), 4, pattern="right")
    for _ in range(2):
        mesh = mesh.refined_where(np.linalg.norm(mesh.points[mesh.cells].mean(axis=1), axis=1) < 0.5)
    return renumbered(mesh)


def pulled(mesh: Mesh, stretch: float = 1.0, seed: int = 2, order: int = 1) -> BodyData:
    """A body that is clamped on the left, with a displacement at random."""
    dim = mesh.dim
    mesh = mesh.moved(np.diag([1.0] * (dim - 1) + [stretch]))
    loads = {"right": (0.3, 0.2, 0.1)[:dim]}
    problem = ContactProblem(mesh, anisotropic(dim), supports={"left": Clamped()}, tractions=loads, order=order)
    field = np.random.default_rng(seed).normal(size=mesh.nodes(order).shape)
    return body_data(problem, field * np.array([1.0] * (dim - 1) + [stretch]))


def alike_apart(monkeypatch: pytest.MonkeyPatch) -> None:
    """No cell counts as a translate of another one."""
    monkeypatch.setattr(
        "hemivar.bounds.cell_kinds.congruent_cells",
        lambda table, _: np.arange(len(table.cells)),
    )


@built
@pytest.mark.parametrize("stretch", [1.0, 1e-2, 1e2])
@pytest.mark.parametrize("mesh", [renumbered(plane_mesh(4)), uneven()], ids=["renumbered", "uneven"])
def test_kernels_and_numpy_give_the_same(mesh: Mesh, stretch: float) -> None:
    """Twice, so that the second sweep starts from what the first has left; on stretched meshes by the misfit."""
    stress = admissible_stress(pulled(mesh, stretch))
    compiled, plain = PatchSmoother(stress), PatchSmoother(stress, compiled=False)
    for _ in range(2):
        for sweeper in (compiled, plain):
            sweeper.sweep(PatchKind.VERTEX)
        found, expected = compiled.stress, plain.stress
        if stretch == 1.0:
            moments = expected.tractions.moments
            assert found.tractions.moments == pytest.approx(moments, abs=1e-11 * np.abs(moments).max())
        assert found.misfit.sum() == pytest.approx(expected.misfit.sum(), rel=1e-6)
    assert compiled.stress.misfit.sum() < 0.9 * stress.misfit.sum()
    assert imbalance(compiled.stress, 1, order=1) < 1e-12


@built
@pytest.mark.parametrize("name", sampled(BODIES, 7))
def test_bodies_with_contact_and_rollers_have_the_same_stress(name: str) -> None:
    """With a price of contact tractions and without one, by every kind of patch; near contact alone, too."""
    problem = BODIES[name]()
    stress = admissible_stress(body_data(problem, solve(problem).displacement))
    traces = contact_traces(stress.data)
    price = None
    if traces is not None:
        price = ContactPenalty(
            traces.facets, traces.moments(traces.allowed(traces.forces(stress.tractions.moments))), 0.5
        )
    compiled, plain = PatchSmoother(stress), PatchSmoother(stress, compiled=False)
    for kind in KINDS:
        for contact, near in ((price, False), (price, True), (None, False)):
            for sweeper in (compiled, plain):
                sweeper.sweep(kind, contact, only_contact=near)
            found, expected = compiled.stress.tractions.moments, plain.stress.tractions.moments
            assert found == pytest.approx(expected, abs=1e-10 * np.abs(expected).max())


@built
@pytest.mark.parametrize("mesh", [rectangle((1.0, 1.0), 12, pattern="right"), box((1.0, 1.0, 1.0), 5)], ids=["", "3D"])
def test_patches_of_one_kind_have_what_each_finds(mesh: Mesh, monkeypatch: pytest.MonkeyPatch) -> None:
    """To single precision, in which a kind is kept; cells stay in balance to double precision."""
    data = pulled(mesh)
    kind = PatchKind.VERTEX if mesh.dim == 2 else PatchKind.EDGE
    found = []
    for apart in (False, True):
        if apart:
            alike_apart(monkeypatch)
        for compiled in (True, False):
            sweeper = PatchSmoother(admissible_stress(replace(data, kept={})), compiled)
            sweeper.sweep(kind)
            found.append((sweeper.stress, sweeper.slopes))
    (alike, slopes), (expected, _), *others = found
    moments = expected.tractions.moments
    for other, _ in others:
        assert other.tractions.moments == pytest.approx(moments, abs=1e-11 * np.abs(moments).max())
    assert alike.tractions.moments == pytest.approx(moments, abs=1e-6 * np.abs(moments).max())
    assert not np.array_equal(alike.tractions.moments, others[0][0].tractions.moments)
    assert alike.misfit.sum() == pytest.approx(expected.misfit.sum(), rel=1e-7)
    assert slopes == pytest.approx(alike.slopes(), abs=1e-6 * np.abs(slopes).max())
    assert imbalance(alike, 1, order=1) < 1e-12


def one_patch(data: BodyData, kind: PatchKind, patch: int) -> PatchOrder:
    patches = cell_patches(data.table, kind)
    seen = np.flatnonzero(patches.ravel() == patch)
    start = np.zeros(int(patches.max()) + 2, dtype=np.int64)
    start[patch + 1 :] = len(seen)
    return PatchOrder(start, seen, np.array([patch]), np.array([0, 1]))


def dense_change(stress: AdmissibleStress, free: BoolArray, prices: Prices, cells: Array) -> Array:
    """Moments (f, n) of the facets that minimise misfit and price, from a null space of all their conditions."""
    data, table, element = stress.data, stress.data.table, stress.element
    facets = np.flatnonzero(free)
    place = np.full(len(free), -1)
    place[facets] = np.arange(len(facets))
    block, dim = element.block, table.dim
    compliance = data.reference_compliance
    energies, slopes = element.matrix(compliance), element.slope(stress.difference, compliance)
    H, b = np.zeros(2 * (len(facets) * block,)), np.zeros(len(facets) * block)
    conditions = []
    for cell in cells:
        seen = np.zeros((element.moments, len(b)))
        force = np.zeros((dim * (dim + 1) // 2, len(b)))
        for side, facet in enumerate(table.cell_facets[cell]):
            if place[facet] < 0:
                continue
            at = slice(place[facet] * block, (place[facet] + 1) * block)
            turn = np.kron(np.eye(block // dim), table.inverse[cell])
            seen[side * block : (side + 1) * block, at] = table.signs[cell, side] * turn
            places = data.places(np.array([facet]))[0] - data.places(facets).mean(axis=(0, 1))
            force[:, at] = table.signs[cell, side] * rigid_modes(places).transpose(1, 0, 2).reshape(len(force), -1)
        H += seen.T @ energies[cell] @ seen
        b += seen.T @ slopes[cell]
        conditions.append(force)
    for facet in facets[prices.rows[facets] >= 0]:
        at, row = slice(place[facet] * block, (place[facet] + 1) * block), prices.rows[facet]
        H[at, at] += prices.matrices[row]
        b[at] += prices.offsets[row] + prices.matrices[row] @ stress.tractions.moments[facet].ravel()
    N = la.null_space(np.vstack(conditions), rcond=1e-11)
    return np.asarray(-N @ np.linalg.solve(N.T @ H @ N, N.T @ b)).reshape(len(facets), -1)


@built
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(("dim", "order"), [(2, 1), (2, 2), (3, 1)])
def test_single_patches_are_what_dense_algebra_finds(kind: PatchKind, dim: int, order: int) -> None:
    """Of meshes without two cells alike, inside and with free facets of the boundary, which have prices at random."""
    rng = np.random.default_rng(7)
    data = pulled(plane_mesh(3) if dim == 2 else space_mesh(2), order=order)
    table, stress = data.table, admissible_stress(data)
    element, block = stress.element, stress.element.block
    compiled = CompiledPatches.of(data, element)
    assert compiled is not None
    outer = np.flatnonzero(~table.interior)
    rows = np.full(len(table.facets), -1)
    rows[outer] = np.arange(len(outer))
    root = rng.normal(size=(len(outer), block, block))
    prices = Prices(rows, 1e-2 * root @ root.transpose(0, 2, 1), 0.1 * rng.normal(size=(len(outer), block)))
    slope = element.slope(stress.difference, data.reference_compliance)
    patches, sides = cell_patches(table, kind), patch_sides(dim, kind)
    for patch in rng.permutation(int(patches.max()) + 1)[:25].tolist():
        at, local = np.nonzero(patches == patch)
        free = np.zeros(len(table.facets), dtype=bool)
        free[table.cell_facets[at[:, None], sides[local]]] = True
        free &= table.interior | (rng.uniform(size=len(free)) < 0.7)
        if not free.any():
            continue
        moments, changed = stress.tractions.moments.copy(), slope.copy()
        compiled.improve(one_patch(data, kind, patch), sides, free, changed, moments, prices)
        expected = dense_change(stress, free, prices, at)
        found = (moments - stress.tractions.moments)[free].reshape(expected.shape)
        assert found == pytest.approx(expected, abs=1e-9 * max(np.abs(expected).max(), 1e-3))
        assert np.array_equal(moments[~free], stress.tractions.moments[~free])
        after = stress.with_moments(moments)
        after_slope = element.slope(after.difference, data.reference_compliance)
        assert changed == pytest.approx(after_slope, abs=1e-10 * np.abs(after_slope).max())


@built
def test_patches_whose_energy_is_not_definite_stay() -> None:
    data = pulled(renumbered(plane_mesh(6)))
    stress, table = admissible_stress(data), data.table
    inner = np.ones(table.mesh.number_of_nodes, dtype=bool)
    inner[table.facets[~table.interior]] = False
    cell = int(np.flatnonzero(inner[table.cells].all(axis=1))[0])
    slope = stress.element.slope(stress.difference, data.reference_compliance)
    bent = np.ones((3, 3))
    bent[0, 1] = 1e4  # its diagonal alone shows nothing
    for spoiled in (-1e3, np.nan, bent):
        compliance = data.kinds.of_cells
        compliance[cell] *= spoiled[np.triu_indices(3)] if np.ndim(spoiled) else spoiled
        library = kernels()
        assert library is not None
        compiled = CompiledPatches(
            library, stress.element, compliance, table.gradients, table.signs, table.cell_facets, data.facet_nodes,
            table.mesh.points, np.arange(len(table.cells)),
        )  # fmt: skip
        order = compiled.ordered(table.cells, inner)
        assert order is not None
        moments, changed = stress.tractions.moments.copy(), slope.copy()
        compiled.improve(order, patch_sides(2, PatchKind.VERTEX), table.interior, changed, moments)
        own = table.cell_facets[cell]
        assert np.array_equal(moments[own], stress.tractions.moments[own])
        assert (moments != stress.tractions.moments).any(axis=(1, 2)).sum() > len(moments) // 2
        assert imbalance(stress.with_moments(moments), 1, order=1) < 1e-13


@pytest.mark.parametrize("compiled", [False, True])
def test_bodies_of_other_units_have_the_same_stress(compiled: bool) -> None:
    data = pulled(uneven())
    base = admissible_stress(data)
    small = data.problem.mesh.moved(1e-6 * np.eye(2))
    problem = replace(data.problem, mesh=small, tractions={"right": (0.3e6, 0.2e6)})
    other = admissible_stress(body_data(problem, data.displacement))
    moments = []
    for stress in (base, other):
        sweeper = PatchSmoother(stress, compiled)
        sweeper.sweep(PatchKind.VERTEX)
        moments.append(sweeper.stress.tractions.moments)
    assert moments[1] == pytest.approx(moments[0], abs=1e-11 * np.abs(moments[0]).max())


def test_patches_that_come_first_take_the_first_colours() -> None:
    table = facet_table(rectangle((1.0, 1.0), 6, pattern="cross"))
    middle = (np.rint(12.0 * table.mesh.points) % 2 == 1).all(axis=1)  # of squares: every cell has one
    assert middle.sum() == 36
    colours = coloured(table.cells, table.mesh.number_of_nodes, first=np.where(middle, 0, 1))
    assert np.array_equal(colours == 0, middle)
    assert all((colours[table.cells[:, i]] != colours[table.cells[:, j]]).all() for i, j in ((0, 1), (0, 2), (1, 2)))


@built
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("mesh", [uneven(), space_mesh(3)], ids=["plane", "space"])
@pytest.mark.parametrize("by_size", [False, True])
def test_colours_of_the_kernels_are_those_of_numpy(mesh: Mesh, kind: PatchKind, by_size: bool) -> None:
    data = pulled(mesh)
    table = data.table
    patches = cell_patches(table, kind)
    count = int(patches.max()) + 1
    chosen = np.random.default_rng(5).uniform(size=count) < 0.8
    first = np.bincount(patches.ravel()) if by_size else None
    expected = coloured(np.where(chosen[patches], patches, -1), count, first=first)
    compiled = CompiledPatches.of(data, split_element(mesh.dim))
    assert compiled is not None
    order = compiled.ordered(patches, chosen, first)
    assert order is not None
    found = np.full(count, -1)
    for colour, (begin, end) in enumerate(pairwise(order.bounds.tolist())):
        found[order.order[begin:end]] = colour
    assert np.array_equal(np.flatnonzero(found >= 0), np.flatnonzero(chosen))
    assert np.array_equal(found[chosen], expected[chosen])
    for patch in np.flatnonzero(chosen)[:20].tolist():
        seen = order.seen[order.start[patch] : order.start[patch + 1]]
        assert np.array_equal(seen, np.flatnonzero(patches.ravel() == patch))
    batches = patch_batches(table, kind, np.ones(len(table.facets), dtype=bool), chosen, first)
    assert sum(len(batch.facets) for batch in batches) == chosen.sum()


@built
def test_more_colours_than_the_kernels_know_are_left_to_numpy(monkeypatch: pytest.MonkeyPatch) -> None:
    """A fan of cells around one edge of each pair of patches: every two of them share a cell."""
    data = pulled(plane_mesh(2))
    compiled = CompiledPatches.of(data, split_element(2))
    assert compiled is not None
    count = len(data.table.cells)
    many = np.arange(300)
    patches = np.zeros((count, 300), dtype=np.int64) + many
    assert compiled.ordered(patches, np.ones(300, dtype=bool)) is None
    assert compiled.ordered(patches[:, :200], np.ones(200, dtype=bool)) is not None
    stress = admissible_stress(data)
    expected = PatchSmoother(stress, compiled=False)
    expected.sweep(PatchKind.VERTEX)
    monkeypatch.setattr(CompiledPatches, "ordered", lambda *_: None)
    found = PatchSmoother(stress)
    found.sweep(PatchKind.VERTEX)
    assert np.array_equal(found.moments, expected.moments)


_RUN = """
import sys, hashlib, numpy as np
from hemivar.bounds.admissible_stress import admissible_stress
from hemivar.bounds.body_data import body_data
from hemivar.bounds.patches import PatchKind
from hemivar.bounds.sweeps import PatchSmoother
from hemivar.gallery.survey_problems import survey, survey_cube
from hemivar.kernels import kernels, threads
from hemivar.mesh.mesh import Mesh
for problem in survey("5.1", 24), survey_cube("5.1", 6):
    u = np.random.default_rng(3).normal(size=problem.mesh.points.shape)
    sweeper = PatchSmoother(admissible_stress(body_data(problem, u)))
    for kind in PatchKind:
        sweeper.sweep(kind)
    print(hashlib.sha256(sweeper.moments.tobytes()).hexdigest())
assert kernels() is not None
print(threads(), file=sys.stderr)
"""


@built
@pytest.mark.parametrize("counts", [("1", "3"), slow(("1", "2", "3"))], ids=",".join)
def test_bits_of_patches_do_not_depend_on_the_number_of_threads(counts: tuple[str, ...]) -> None:
    assert len(printed_by_threads(_RUN, counts)) == 1


def _arrays() -> tuple[dict[str, Array], dict[str, Array], CompiledPatches, PatchOrder]:
    """What the door is given for a small body: to make the patches, and to improve them."""
    data = pulled(plane_mesh(2))
    table, stress = data.table, admissible_stress(data)
    made = {
        "compliance": data.kinds.of_cells, "gradients": table.gradients, "signs": table.signs,
        "cell_facets": table.cell_facets, "facet_nodes": data.facet_nodes, "points": table.mesh.points,
        "alike": np.arange(len(table.cells)),
    }  # fmt: skip
    library = kernels()
    assert library is not None
    compiled = CompiledPatches(library, stress.element, **made)
    order = compiled.ordered(table.cells, np.ones(table.mesh.number_of_nodes, dtype=bool))
    assert order is not None
    improved = {
        "sides": patch_sides(2, PatchKind.VERTEX), "free": table.interior,
        "slope": stress.slopes(),
        "moments": stress.tractions.moments.copy(),
    }  # fmt: skip
    return made, improved, compiled, order


def _entry(value: int) -> Callable[[Array], Array]:
    def spoiled(array: Array) -> Array:
        out = array.copy()
        out.flat[out.size // 2] = value
        return out

    return spoiled


@built
def test_wrong_arrays_of_patches_are_refused_at_the_door() -> None:
    made, improved, compiled, order = _arrays()
    library, element = kernels(), split_element(2)
    assert library is not None
    shapes: tuple[Callable[[Array], Array], ...] = (lambda x: x[:-1], lambda x: x[None], lambda x: x[..., None])
    for name, array in made.items():
        ends = [_entry(-1), _entry(2**40)] if array.dtype.kind == "i" else []
        kinds = [lambda x: x.astype(float)] if array.dtype.kind == "i" else []
        for wrong in (*shapes, *ends, *kinds):
            if (
                name == "points"
                and len(wrong(array)) == len(array) - 1
                and (made["facet_nodes"] < len(array) - 1).all()
            ):
                continue
            with pytest.raises(ValueError, match=r"must (have|be)"):
                CompiledPatches(library, element, **(made | {name: wrong(array)}))
    for name, array in improved.items():
        ends = [_entry(-1), _entry(3)] if name == "sides" else []
        for wrong in (*shapes[name == "sides" :], *ends, lambda x: x.astype(np.float32)):
            with pytest.raises(ValueError, match="must be"):
                compiled.improve(order, **(improved | {name: wrong(array)}))
    fixed = improved["slope"].copy()
    fixed.flags.writeable = False
    with pytest.raises(ValueError, match="writeable"):
        compiled.improve(order, **(improved | {"slope": fixed}))
    for change in (
        {"start": order.start[:-1]}, {"start": order.start[::-1]}, {"start": order.start + 1},
        {"seen": _entry(10**6)(order.seen)}, {"seen": _entry(-1)(order.seen)}, {"order": order.order + 1},
        {"order": np.zeros_like(order.order)}, {"bounds": order.bounds[1:]}, {"bounds": order.bounds[:-1]},
        {"bounds": order.bounds[:0]}, {"bounds": order.bounds[[0, -1]]},
    ):  # fmt: skip
        with pytest.raises(ValueError, match=r"must (be|rise|not)"):
            compiled.improve(replace(order, **change), **improved)
    count, block = len(improved["moments"]), element.block
    rows = np.full(count, -1)
    rows[0] = 0
    good = Prices(rows, np.zeros((1, block, block)), np.zeros((1, block)))
    for bad in (
        {"rows": rows + 1}, {"rows": rows - 1}, {"rows": rows[:-1]}, {"matrices": np.zeros((2, block, block))[:, 1:]},
        {"offsets": np.zeros((2, block))},
    ):  # fmt: skip
        with pytest.raises(ValueError, match="must"):
            compiled.improve(order, **improved, prices=replace(good, **bad))
    with pytest.raises(ValueError, match="patches"):
        compiled.ordered(np.full((3, 3), 10**6), np.ones(5, dtype=bool))
    with pytest.raises(ValueError, match="bool"):
        compiled.ordered(np.zeros((len(made["alike"]), 3), dtype=int), np.ones(5))
    with pytest.raises(TypeError, match="this process"):
        compiled.__reduce__()
    compiled.improve(order, **improved, prices=good)
    assert np.isfinite(improved["moments"]).all()
    assert compiled_patches.__all__
