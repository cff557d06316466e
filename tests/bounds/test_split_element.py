"""The stress element: tractions, moments, divergence, energies; against closed forms and quadrature."""

from __future__ import annotations

import math

import numpy as np
import pytest

from hemivar.basics.types import Array
from hemivar.bounds.facet_table import facet_table, facet_vertices
from hemivar.bounds.split_element import (
    MomentSpace,
    SplitElement,
    pairs_of,
    pulled_back,
    split_element,
    upper_pulled_back,
    voigt,
)
from hemivar.errors import ProblemError
from hemivar.fem.elements import shape_derivatives, shape_values
from hemivar.fem.quadrature import quadrature_rule
from hemivar.mesh.build import box, rectangle
from hemivar.mesh.mesh import Mesh

DIMENSIONS = [2, 3]


def tensors_of(vectors: Array, dim: int) -> Array:
    out = np.empty((*vectors.shape[:-1], dim, dim))
    for component, (i, j) in enumerate(pairs_of(dim)):
        out[..., i, j] = out[..., j, i] = vectors[..., component]
    return out


def simplex(dim: int, seed: int = 3) -> Array:
    """Corners (d + 1, d) of a simplex of no special shape."""
    noise = np.random.default_rng(seed).uniform(-0.3, 0.3, (dim + 1, dim))
    return np.asarray(np.vstack([np.zeros(dim), np.eye(dim)]) * np.array([1.3, 0.7, 2.1])[:dim] + noise)


def piece_corners(corners: Array) -> Array:
    """Corners (pieces, d + 1, d) of the pieces."""
    pieces = np.repeat(corners[None], len(corners), axis=0).copy()
    pieces[range(len(corners)), range(len(corners))] = corners.mean(axis=0)
    return pieces


def mapped(element: SplitElement, corners: Array, degrees: Array) -> Array:
    """Stress tensors (pieces, vertices, d, d) on a simplex of the degrees of freedom on the reference simplex."""
    B = (corners[1:] - corners[0]).T
    reference = tensors_of(element.at_nodes(degrees[None])[0], element.dim)
    return np.asarray(B @ reference @ B.T / abs(np.linalg.det(B)))


@pytest.mark.parametrize("dim", DIMENSIONS)
def test_numbers_of_values_and_degrees_of_freedom(dim: int) -> None:
    element = split_element(dim)
    assert element.values.reshape(-1, element.values.shape[-1]).shape == {2: (27, 15), 3: (96, 42)}[dim]
    assert element.energies.shape[0] == {2: 6, 3: 21}[dim]


@pytest.mark.parametrize("dim", DIMENSIONS)
def test_stress_of_given_moments_on_any_simplex(dim: int) -> None:
    """Continuous tractions inside, the moments and the integral that were given, after the map."""
    element, corners = split_element(dim), simplex(dim)
    B = (corners[1:] - corners[0]).T
    rng = np.random.default_rng(0)
    moments, integral = rng.normal(size=(dim + 1, dim, dim)), rng.normal(size=(dim, dim))
    integral = integral + integral.T
    back = np.linalg.inv(B)
    degrees = np.concatenate([(moments @ back.T).ravel(), voigt(back @ integral @ back.T)])
    stress = mapped(element, corners, degrees)

    centroid = corners.mean(axis=0)
    for i in range(dim + 1):
        for j in range(i):
            others = [a for a in range(dim + 1) if a not in (i, j)]
            normal = np.linalg.svd(corners[others] - centroid)[2][-1]
            jump = np.concatenate([stress[i, others] - stress[j, others], (stress[i, i] - stress[j, j])[None]])
            assert np.abs(jump @ normal).max() < 1e-11

    gradients = np.vstack([-back.sum(axis=0), back])
    volume = abs(np.linalg.det(B)) / math.factorial(dim)
    barycentric, weights = quadrature_rule(dim - 1, 2)
    for i, members in enumerate(facet_vertices(dim)):
        area_normal = -dim * volume * gradients[i]
        traction = np.einsum("qa,acd,d->qc", barycentric, stress[i, members], area_normal)
        assert np.einsum("q,qa,qc->ac", weights, barycentric, traction) == pytest.approx(moments[i], abs=1e-11)
    mean = stress.mean(axis=(0, 1))
    assert mean * volume == pytest.approx(integral, abs=1e-11)


@pytest.mark.parametrize("dim", DIMENSIONS)
def test_constant_stress_is_of_the_element(dim: int) -> None:
    element, corners = split_element(dim), simplex(dim, 5)
    B = (corners[1:] - corners[0]).T
    back = np.linalg.inv(B)
    gradients = np.vstack([-back.sum(axis=0), back])
    volume = abs(np.linalg.det(B)) / math.factorial(dim)
    sigma = np.random.default_rng(1).normal(size=(dim, dim))
    sigma = sigma + sigma.T
    moments = np.repeat((-volume * gradients @ sigma)[:, None], dim, axis=1)
    degrees = np.concatenate([(moments @ back.T).ravel(), voigt(back @ (volume * sigma) @ back.T)])
    assert mapped(element, corners, degrees) == pytest.approx(np.broadcast_to(sigma, (dim + 1, dim + 1, dim, dim)))
    # it has no divergence, so the moments alone give its integral
    assert element.summing @ degrees[: element.moments] == pytest.approx(degrees)


@pytest.mark.parametrize("dim", DIMENSIONS)
def test_balanced_moments_give_a_stress_without_divergence(dim: int) -> None:
    element, corners = split_element(dim), simplex(dim, 7)
    B = (corners[1:] - corners[0]).T
    at = corners[facet_vertices(dim)].reshape(-1, dim)  # one place for each moment
    spins = [np.eye(dim)[:, [i]] @ np.eye(dim)[[j]] for i in range(dim) for j in range(i)]
    rigid = [np.broadcast_to(e, at.shape) for e in np.eye(dim)] + [at @ (spin - spin.T) for spin in spins]
    C = np.array([field.ravel() for field in rigid])
    free = np.linalg.svd(C)[2][len(C) :]
    moments = (free.T @ np.random.default_rng(2).normal(size=len(free))).reshape(dim + 1, dim, dim)
    degrees = element.summing @ (moments @ np.linalg.inv(B).T).ravel()
    stress = mapped(element, corners, degrees)
    for piece, values in zip(piece_corners(corners), stress, strict=True):
        slopes = np.linalg.inv((piece[1:] - piece[0]).T)
        gradients = np.vstack([-slopes.sum(axis=0), slopes])
        assert np.einsum("aij,aj->i", values, gradients) == pytest.approx(np.zeros(dim), abs=1e-10)


@pytest.mark.parametrize("dim", DIMENSIONS)
def test_energies_in_the_pulled_back_compliance(dim: int) -> None:
    """Against a rule on the pieces of the simplex itself."""
    element, corners = split_element(dim), simplex(dim, 9)
    B = (corners[1:] - corners[0]).T
    rng = np.random.default_rng(3)
    number = len(pairs_of(dim))
    root: Array = rng.normal(size=(number, number))
    compliance = np.asarray(root @ root.T + np.eye(number))
    degrees: Array = rng.normal(size=(element.values.shape[-1],))
    size = np.array([abs(np.linalg.det(B))])
    back = pulled_back(compliance[None], B[None], size)

    barycentric, weights = quadrature_rule(dim, 2)
    at = np.einsum("qa,paij->pqij", barycentric, mapped(element, corners, degrees))
    vector = voigt(at)
    volume = size[0] / math.factorial(dim) / (dim + 1)
    direct = volume * np.einsum("q,pqi,ij,pqj->", weights, vector, compliance, vector)
    assert element.energy(element.at_nodes(degrees[None]), back)[0] == pytest.approx(direct)

    upper = back[:, *element.upper]
    assert element.energy_of(degrees[None], upper)[0] == pytest.approx(direct)
    found = upper_pulled_back(compliance[None], corners, np.arange(dim + 1)[None], size)
    assert found is None or found == pytest.approx(upper, rel=1e-12, abs=1e-12)

    moments = rng.normal(size=element.moments)
    stress = element.at_nodes((element.summing @ moments)[None])
    assert moments @ element.matrix(back)[0] @ moments == pytest.approx(element.energy(stress, back)[0])
    slope = element.slope((element.summing @ moments)[None], back)[0]
    assert element.matrix(back)[0] @ moments == pytest.approx(slope)


@pytest.mark.parametrize("mesh", [rectangle((1.0, 2.0), 3, pattern="cross"), box((1.0, 2.0, 1.0), 2)])
def test_facets_of_a_mesh(mesh: Mesh) -> None:
    table, dim = facet_table(mesh), mesh.dim
    assert table.interior.sum() * 2 + (~table.interior).sum() == len(mesh.cells) * (dim + 1)
    assert (~table.interior).sum() == len(mesh.boundary_facets)
    for name, facets in mesh.boundaries.items():
        number = table.numbers(facets)
        assert np.array_equal(table.facets[number], np.sort(facets, axis=1)), name
        normals, measures = mesh.facet_normals(facets)
        assert table.normals_of(number) == pytest.approx(normals)
        assert table.measures[number] == pytest.approx(measures)
    linear = mesh.points @ np.arange(1.0, dim + 1.0)
    slopes = np.einsum("ma,mad->md", linear[table.cells], table.gradients)
    assert slopes == pytest.approx(np.broadcast_to(np.arange(1.0, dim + 1.0), slopes.shape))
    # outward tractions of a constant stress balance on every cell, and those of two cells are opposite
    sigma = np.diag(np.arange(1.0, dim + 1.0)) + 0.5
    moments = np.repeat((table.area_normals @ sigma / dim)[:, None], dim, axis=1)
    outward = table.of_cells(moments)
    assert np.abs(outward.sum(axis=(1, 2))).max() < 1e-13
    expected = -np.einsum("m,mad,dc->mac", mesh.volumes, table.gradients, sigma)
    assert outward[:, :, 0] == pytest.approx(expected)


# ---- degree 2 in the plane -----------------------------------------------------------------------------------------


def quadratic_stress(corners: Array, seed: int) -> tuple[Array, Array, Array]:
    """A stress (pieces, nodes, 2, 2) of random moments (facet, node, component) and a linear load in balance with them.

    The load is given by its values (3, 2) at the corners.
    """
    rng = np.random.default_rng(seed)
    B, centroid = (corners[1:] - corners[0]).T, corners.mean(axis=0)
    back = np.linalg.inv(B)
    moments, load = rng.normal(size=(3, 3, 2)), rng.normal(size=(3, 2))
    mass = abs(np.linalg.det(B)) / 24.0 * (np.ones((3, 3)) + np.eye(3))
    members = facet_vertices(2)
    places = corners[members] - centroid
    places = np.concatenate([places, places.mean(axis=1, keepdims=True)], axis=1)

    def work(m: Array, f: Array) -> Array:
        force = m.sum(axis=(0, 1)) + (mass @ f).sum(axis=0)
        x, g = corners - centroid, mass @ f
        turn = (places[..., 0] * m[..., 1] - places[..., 1] * m[..., 0]).sum()
        return np.array([*force, turn + (x[:, 0] * g[:, 1] - x[:, 1] * g[:, 0]).sum()])

    ways = [np.eye(6)[k].reshape(3, 2) for k in range(6)]
    matrix = np.stack([work(0.0 * moments, way) for way in ways], axis=1)
    fix, *_ = np.linalg.lstsq(matrix, -work(moments, load), rcond=None)
    load = load + fix.reshape(3, 2)
    assert np.abs(work(moments, load)).max() < 1e-12
    element = split_element(2, 2)
    degrees = np.concatenate([(moments @ back.T).ravel(), (mass @ load @ back.T).ravel(), rng.normal(size=3)])
    reference = tensors_of(element.at_nodes(degrees[None])[0], 2)
    return np.asarray(B @ reference @ B.T / abs(np.linalg.det(B))), moments, load


def test_numbers_of_the_quadratic_element() -> None:
    element = split_element(2, 2)
    assert element.values.reshape(-1, element.values.shape[-1]).shape == (54, 27)
    assert np.linalg.matrix_rank(element.values.reshape(54, 27)) == 24  # loads are put into balance: 18 + 3 + 3
    assert element.ways.shape == (27, 21)
    with pytest.raises(ProblemError, match="in the plane only"):
        split_element(3, 2)


@pytest.mark.parametrize("seed", range(3))
def test_quadratic_stress_of_given_moments_and_load_on_any_triangle(seed: int) -> None:
    """Continuous tractions inside, the moments of the edges and the divergence that were given, after the map."""
    corners = simplex(2, seed + 3)
    stress, moments, load = quadratic_stress(corners, seed)
    centroid = corners.mean(axis=0)
    rng = np.random.default_rng(seed)
    for i, own in enumerate(piece_corners(corners)):
        inverse = np.linalg.inv((own[1:] - own[0]).T)
        slopes = np.vstack([-inverse.sum(axis=0), inverse])
        for point in rng.dirichlet(np.ones(3), 4):
            divergence = np.einsum("aij,aj->i", stress[i], shape_derivatives(2, point) @ slopes)
            back = np.linalg.solve(np.vstack([corners.T, np.ones(3)]), [*(point @ own), 1.0])
            assert divergence == pytest.approx(-back @ load, abs=1e-9)
        members = [a for a in range(3) if a != i]
        along = corners[members[1]] - corners[members[0]]
        normal = np.array([along[1], -along[0]])
        normal *= np.sign(normal @ (corners[members[0]] - centroid))
        at, weights = quadrature_rule(1, 4)
        inside = np.zeros((len(at), 3))
        inside[:, members] = at
        traction = np.einsum("qa,aij,j->qi", shape_values(2, inside), stress[i], normal)
        found = np.einsum("q,qa,qi->ai", weights, shape_values(2, at), traction)
        assert found == pytest.approx(moments[i], abs=1e-9)
        for a in members:  # the edge from vertex a to the centroid, seen from both pieces
            other = next(b for b in members if b != a)
            side = np.array([1.0, -1.0]) * (centroid - corners[a])[::-1]
            values = []
            for piece in (i, other):
                on = np.zeros((len(at), 3))
                on[:, a], on[:, piece] = at.T
                values.append(np.einsum("qa,aij,j->qi", shape_values(2, on), stress[piece], side))
            assert values[0] == pytest.approx(values[1], abs=1e-9)


def test_settled_stresses_have_the_least_energy() -> None:
    element = split_element(2, 2)
    rng = np.random.default_rng(1)
    root = rng.normal(size=(2, 3, 3))
    compliance = np.eye(3) + root @ root.transpose(0, 2, 1)
    degrees = rng.normal(size=(2, 27))

    def energy(of: Array) -> Array:
        return element.energy(element.at_nodes(of), compliance)

    assert element.energy_of(degrees, compliance[:, *element.upper]) == pytest.approx(energy(degrees))
    settled = element.settled(degrees, compliance)
    assert np.array_equal(settled[:, :24], degrees[:, :24])
    for _ in range(5):
        other = settled + np.concatenate([np.zeros((2, 24)), rng.normal(size=(2, 3))], axis=1)
        assert (energy(other) > energy(settled)).all()
    # the energy of moments is that of settled stresses, its slope the derivative
    moments = rng.normal(size=(2, 18))
    lifted = element.settled(moments @ element.summing.T, compliance)
    assert np.einsum("mp,mpq,mq->m", moments, element.matrix(compliance), moments) == pytest.approx(energy(lifted))
    whole = element.settled(degrees + 1e-3 * moments @ element.summing.T, compliance)
    less = element.settled(degrees - 1e-3 * moments @ element.summing.T, compliance)
    slope = np.einsum("mp,mp->m", element.slope(degrees, compliance), moments)
    assert slope == pytest.approx((energy(whole) - energy(less)) / 4e-3)
    fields = rng.normal(size=(18, 4))
    some = MomentSpace(element, fields)
    assert some.matrix(compliance) == pytest.approx(fields.T @ element.matrix(compliance) @ fields)
    assert some.slope(degrees, compliance) == pytest.approx(element.slope(degrees, compliance) @ fields)
    assert some.summing == pytest.approx(element.summing @ fields)
