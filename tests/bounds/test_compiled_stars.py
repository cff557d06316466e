"""Tractions around vertices in the compiled kernels: those of NumPy, and those that dense linear algebra finds."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import hemivar as hv
from hemivar.basics.types import Array
from hemivar.bounds import compiled_stars, facet_table
from hemivar.bounds.body_data import BodyData, body_data
from hemivar.bounds.compiled_stars import CompiledStars
from hemivar.bounds.joined_sides import joined_sides
from hemivar.bounds.touching_bodies import contact_moments
from hemivar.bounds.vertex_moments import Tractions, equilibrated, shared_on_contact
from hemivar.kernels import kernels
from hemivar.mechanics import Clamped, ContactProblem, Fixed, Roller
from hemivar.mesh import box, rectangle
from hemivar.mesh.keys import EDGES
from hemivar.mesh.mesh import Mesh

from .bodies import BODIES, anisotropic, plane_mesh, space_mesh
from .test_compiled_patches import renumbered, uneven
from .test_joined_bodies import contact, opened, two

pytestmark = pytest.mark.skipif(kernels() is None, reason="the kernels are not compiled here")


def joined(order: int) -> ContactProblem:
    mesh = opened(rectangle((1.0, 1.0), 4, pattern="cross"), 0.5)
    return replace(two(mesh, (3.0, 1.0), contact(0, hv.laws.Compliance(5.0))), order=order)  # type: ignore[arg-type]


def sheared() -> ContactProblem:
    """Rollers on two sides with a sharp angle between them."""
    mesh = plane_mesh().moved(np.array([[1.0, 3.0], [0.0, 1.0]]))
    return ContactProblem(mesh, anisotropic(2), supports={"left": Roller(), "bottom": Roller()})


JOINED = {"joined": lambda: joined(1), "joined, quadratic": lambda: joined(2)}
MESHES = {"plane": uneven(), "space": renumbered(space_mesh(3)), "one cell": rectangle((1.0, 1.0), 1)}


def anywhere(problem: ContactProblem, seed: int = 1) -> BodyData:
    """A displacement that is no solution, so that every node lacks something."""
    shape = problem.mesh.nodes(problem.order).shape
    return body_data(problem, np.random.default_rng(seed).normal(size=shape))


def some_pressures(data: BodyData) -> Array:
    touched, out = data.contact >= 0, np.zeros(data.facet_loads.shape)
    out[touched] = np.random.default_rng(2).normal(size=out[touched].shape) * np.abs(data.forces).max()
    return out


def near(found: Tractions, expected: Tractions, by: float = 1e-13) -> None:
    for name in ("moments", "defect", "missed"):
        mine, theirs = getattr(found, name), getattr(expected, name)
        assert mine == pytest.approx(theirs, abs=by * np.abs(theirs).max())


@pytest.mark.parametrize("name", [*BODIES, *JOINED, "sheared"])
def test_kernels_and_numpy_give_the_same(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """With oblique supports, contact, loads that are missed, bodies that touch, and cells around an edge."""
    data = anywhere((BODIES | JOINED | {"sheared": sheared})[name]())
    data = data.under(contact_moments(data)) if name in JOINED else data
    pressures = some_pressures(data)
    found = [equilibrated(data), equilibrated(data, pressures)]
    shared = shared_on_contact(data)
    with monkeypatch.context() as patch:
        patch.setattr(compiled_stars, "kernels", lambda: None)
        for one, given in zip(found, (None, pressures), strict=True):
            near(one, equilibrated(data, given))
        assert shared == pytest.approx(shared_on_contact(data), abs=1e-13 * np.abs(found[0].moments).max())
    assert np.any(found[0].missed) == (name in ("graded", "graded, quadratic", "pulled cube"))


def dense(data: BodyData, vertex: int) -> tuple[Array, Array]:
    """The corner moments that the definition asks for around a vertex: facets and their moments (k, d).

    ``|dm|^2 / ease`` is least under the balance of all cells, once contact facets and loads have taken the rest.
    """
    table, dim = data.table, data.table.dim
    cost = np.linalg.norm(data.compliance, axis=(1, 2)) * table.volumes
    at_vertex = [(cell, list(nodes).index(vertex)) for cell, nodes in enumerate(table.cells) if vertex in nodes]
    place = {cell: k for k, (cell, _) in enumerate(at_vertex)}
    facets = sorted({table.cell_facets[c, i] for c, b in at_vertex for i in range(dim + 1) if i != b})
    start, ease, balance = np.zeros((len(facets), dim)), np.zeros(len(facets)), np.zeros((len(at_vertex), len(facets)))
    takes = []
    for k, facet in enumerate(facets):
        cells = [c for c in table.owners[facet] if c >= 0]
        node = list(table.facets[facet]).index(vertex)
        own = [
            sign * data.cell_moments[c, list(table.cell_facets[c]).index(facet), node]
            for c, sign in zip(cells, (1.0, -1.0), strict=False)
        ]
        price = np.array([cost[c] for c in cells]) / table.measures[facet] ** 2
        ease[k] = 1.0 / price.sum()
        for c, sign in zip(cells, (1.0, -1.0), strict=False):
            balance[place[c], k] = sign
        start[k] = price @ np.array(own) / price.sum()
        if len(cells) == 1:
            given = data.facet_loads[facet, node]
            start[k] = given + data.unknown[facet] @ (own[0] - given)
        takes.append(data.unknown[facet])
    ease = np.maximum(ease / ease.max(), 1e-4)
    lack = np.array([(data.forces - data.loads)[c, b] for c, b in at_vertex]) - balance @ start
    held = sum((part for part, sides in zip(takes, np.abs(balance).sum(axis=0), strict=True) if sides == 1),
               np.zeros((dim, dim)))  # fmt: skip
    free = np.eye(dim) - np.linalg.pinv(held, rcond=1e-9) @ held
    rest = free @ lack.sum(axis=0)
    contact = np.array([data.contact[facet] >= 0 for facet in facets])
    if contact.any():
        share = np.where(contact, table.measures[facets], 0.0) / table.measures[np.array(facets)[contact]].sum()
        start += share[:, None] * rest
        lack -= (balance @ share)[:, None] * rest
    else:
        volumes = table.volumes[[c for c, _ in at_vertex]]
        lack -= (volumes / volumes.sum())[:, None] * rest
    root = np.concatenate([np.kron(balance[:, k : k + 1] * np.sqrt(ease[k]), takes[k]) for k in range(len(facets))], 1)
    change = (np.linalg.pinv(root, rcond=1e-10) @ lack.ravel()).reshape(len(facets), dim)
    return np.array(facets), start + np.sqrt(ease)[:, None] * np.einsum("kij,kj->ki", np.array(takes), change)


@pytest.mark.parametrize("name", ["survey", "turned", "layered", "cube", "turned in space", "pulled cube"])
def test_moments_are_the_nearest_that_balance(name: str) -> None:
    """Against the least change by singular values, around every vertex."""
    data = anywhere(BODIES[name]())
    found, size = equilibrated(data).moments, np.abs(data.cell_moments).max()
    for vertex in range(data.table.mesh.number_of_nodes):
        facets, expected = dense(data, vertex)
        node = np.argmax(data.table.facets[facets] == vertex, axis=1)
        assert found[facets, node] == pytest.approx(expected, abs=1e-9 * size)


@pytest.mark.parametrize("mesh", MESHES.values(), ids=MESHES)
@pytest.mark.parametrize("stretch", [1.0, 1e3])
def test_cells_balance_on_meshes_of_any_shape(mesh: Mesh, stretch: float) -> None:
    """Flat cells, rings of any length, one cell alone: sums of moments are what the cells have to balance."""
    dim = mesh.dim
    mesh = mesh.moved(np.diag([1.0] * (dim - 1) + [stretch]))
    held = {"left": Clamped(), "bottom": Fixed(x=0.0)}
    data = anywhere(ContactProblem(mesh, anisotropic(dim), supports=held))
    found = equilibrated(data)
    moments, table = data.table.of_cells(found.moments), data.table
    left = data.forces - data.loads - found.defect
    for side in range(dim + 1):
        left[:, [a for a in range(dim + 1) if a != side]] -= moments[:, side]
    assert np.abs(left).max() < 1e-10 * np.abs(moments).max()
    assert len(table.facets) == len(found.moments)


def test_bits_do_not_depend_on_the_number_of_threads() -> None:
    library = kernels()
    assert library is not None
    problem = ContactProblem(box((1.0, 1.0, 1.0), 6), anisotropic(3), supports={"left": Clamped()})
    results = []
    for count in (1, 2, 3):
        library.call.hv_set_threads(count)
        data = anywhere(problem)
        found = equilibrated(data)
        results.append([found.moments, found.defect, data.table.cell_facets, data.table.signs, data.table.owners])
    library.call.hv_set_threads(hv.kernels.threads())
    for other in results[1:]:
        assert all(np.array_equal(a, b) for a, b in zip(results[0], other, strict=True))


@pytest.mark.parametrize("name", ["plane", "space", "renumbered", "joined"])
def test_facets_and_stars_are_those_of_numpy(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    meshes = {"plane": plane_mesh(), "space": space_mesh(), "renumbered": renumbered(space_mesh())}
    sides = None
    if name == "joined":
        problem = joined(1)
        sides = joined_sides(problem)
        assert sides is not None
    mesh = problem.mesh if name == "joined" else meshes[name]
    found = facet_table.facet_table(mesh, *(sides or ()))
    monkeypatch.setattr(facet_table, "mesh_facets", lambda *_: None)
    monkeypatch.setattr(facet_table, "mesh_stars", lambda *_: None)
    monkeypatch.setattr(facet_table, "mesh_geometry", lambda *_: None)
    expected = facet_table.facet_table(mesh, *(sides or ()))
    for part in ("cells", "facets", "others", "cell_facets", "signs", "owners", "jacobian"):
        np.testing.assert_array_equal(getattr(found, part), getattr(expected, part))
    for part in ("gradients", "area_normals", "measures", "sizes"):
        size = np.abs(getattr(expected, part)).max()
        np.testing.assert_allclose(getattr(found, part), getattr(expected, part), atol=1e-14 * size)
    for mine, theirs in zip(found.stars, expected.stars, strict=True):
        np.testing.assert_array_equal(mine, theirs)
    assert found.cut.any() == (name == "joined")
    with pytest.raises(ValueError, match="read-only"):
        found.gradients[0] = 0.0


def test_edges_of_cells_are_those_of_their_nodes() -> None:
    for mesh in (plane_mesh(), renumbered(space_mesh())):
        table = facet_table.facet_table(mesh)
        ends = np.array(EDGES[mesh.dim])
        assert np.array_equal(np.sort(mesh.edges[table.cell_edges], axis=2), table.cells[:, ends])


def test_arrays_of_another_body_are_refused() -> None:
    """Facets, owners and pairs that do not belong together are told, and nothing is read beyond an end."""
    library = kernels()
    assert library is not None
    data = anywhere(BODIES["cube"]())
    cost = np.ones(len(data.table.cells))
    whole = CompiledStars.of(data, cost)
    assert whole is not None
    arrays = dict(whole._arrays)
    turned = arrays | {"owners": np.roll(arrays["owners"], 1, axis=0), "interior": np.zeros_like(arrays["interior"])}
    turned["owners"] = np.abs(turned["owners"])
    with pytest.raises(ValueError, match="those of one mesh"):
        CompiledStars(library, len(data.displacement), turned).settled()
    for name, wrong, told in (
        ("forces", arrays["forces"][:-1], "forces must have shape"),
        ("owners", arrays["owners"] + 1000, "owners must be from -1 to"),
        ("start", arrays["start"][::-1], "start must rise"),
        ("interior", np.ones_like(arrays["interior"]), "two owners"),
        ("cell_nodes", arrays["cell_nodes"][:, :2], "no elements"),
    ):
        with pytest.raises(ValueError, match=told):
            CompiledStars(library, len(data.displacement), arrays | {name: wrong})
    with pytest.raises(ValueError, match="vertices must be from 0"):
        whole.on_contact(np.array([10**6]))
