"""The stress element: tractions, moments, divergence, energies; against closed forms and quadrature."""

from __future__ import annotations

import math

import numpy as np
import pytest

from hemivar.basics.types import Array
from hemivar.fem.assembly import quadrature_rule
from hemivar.fem.facet_table import facet_table, facet_vertices
from hemivar.fem.split_element import SplitElement, pairs_of, pulled_back, split_element, voigt
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
    reference = tensors_of(element.at_vertices(degrees[None])[0], element.dim)
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
    assert element.energy(element.at_vertices(degrees[None]), back)[0] == pytest.approx(direct)

    moments = rng.normal(size=element.moments)
    stress = element.at_vertices((element.summing @ moments)[None])
    assert moments @ element.matrix(back)[0] @ moments == pytest.approx(element.energy(stress, back)[0])
    assert element.matrix(back)[0] @ moments == pytest.approx(element.slope(stress, back)[0])


@pytest.mark.parametrize("mesh", [rectangle((1.0, 2.0), 3, pattern="cross"), box((1.0, 2.0, 1.0), 2)])
def test_facets_of_a_mesh(mesh: Mesh) -> None:
    table, dim = facet_table(mesh), mesh.dim
    assert table.interior.sum() * 2 + (~table.interior).sum() == len(mesh.cells) * (dim + 1)
    assert (~table.interior).sum() == len(mesh.boundary_facets)
    for name, facets in mesh.boundaries.items():
        number = table.numbers(facets)
        assert np.array_equal(table.facets[number], np.sort(facets, axis=1)), name
        normals, measures = mesh.facet_normals(facets)
        assert table.normals[number] == pytest.approx(normals)
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
