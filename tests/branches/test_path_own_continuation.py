"""Load paths of one to five points of every kind of law, point by point and fold by fold, against a continuation."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
import scipy.sparse as sp

import hemivar as hv
from hemivar.branches import follow_path
from hemivar.branches.path import PathEnd
from hemivar.laws import VectorLaw
from tests.samples import sampled

from .own_continuation import Array, Continuation, Graph, distances, frictional, glue, rigid, turns

L = hv.laws
Random = np.random.Generator
Kind = tuple[VectorLaw, Graph, int]
SPRING, LENGTH, UPTO = 8.0, 0.02, 3.0


def spring_force(r: float) -> float:
    return SPRING * max(r, 0.0)


def tresca(random: Random) -> Kind:
    law = L.ContactLaw(L.Compliance(SPRING), L.Tresca(0.5))
    return law, frictional(spring_force, lambda p, s: 0.5, SPRING), 2


def coulomb(random: Random, components: int = 2) -> Kind:
    mu = float(random.uniform(0.1, 0.3))
    law = L.ContactLaw(L.Compliance(SPRING), L.Tresca(L.CoulombBound(mu)))
    return law, frictional(spring_force, lambda p, s: mu * p, SPRING), components


def weakening_kind(random: Random) -> Kind:
    law = L.ContactLaw(L.Compliance(SPRING), L.SlipWeakening(1.0, static=1.0, kinetic=0.3, rate=5.0))
    return law, frictional(spring_force, lambda p, s: 0.3 + 0.7 * np.exp(-5.0 * s), SPRING), 2


def softening_kind(random: Random) -> Kind:
    alpha = float(random.uniform(3.0, 25.0))

    def off(r: Array, lam: Array) -> Array:
        return np.asarray(lam - (10.0 * max(r[0], 0.0) if r[0] < 0.1 else max(1.0 - alpha * (r[0] - 0.1), 0.0)))

    return L.ContactLaw(L.Softening(stiffness=10.0, limit=0.1, softening=alpha)), off, 1


def adhesive(random: Random) -> Kind:
    alpha = float(random.uniform(3.0, 25.0))

    def off(r: Array, lam: Array) -> Array:
        w = -float(r[0])
        pull = -20.0 * max(-w, 0.0) if w <= 0.0 else 10.0 * w if w < 0.1 else max(1.0 - alpha * (w - 0.1), 0.0)
        return np.append(lam[0] + pull, lam[1:])

    return L.ContactLaw(L.Adhesive(10.0, 1.0, softening=alpha, compression=20.0)), off, 2


def mixed_kind(random: Random, components: int = 2) -> Kind:
    end, ratio = 0.1 + 1.0 / float(random.uniform(3.0, 25.0)), float(random.uniform(0.6, 1.5))
    cohesion = L.BilinearCohesion(strength=1.0, energy=0.5 * end, stiffness=10.0)
    law = L.MixedMode(cohesion, ratio=ratio, compression=L.Compliance(20.0))
    return law, glue(10.0, ratio, 20.0, lambda mode: (0.1, end)), components


def mode_dependent(random: Random) -> Kind:
    """Of Benzeggagh and Kenane, the shear stiffness of Turon: onset and end grow alike with the fracture energy."""
    first = 0.05 + 0.5 / float(random.uniform(3.0, 25.0))
    second = float(random.uniform(1.2, 3.0)) * first
    law = L.ModeDependentGlue(1.0, 1.3, 10.0, L.BenzeggaghKenane(first, second, 2.0), compression=L.Compliance(20.0))

    def ends(mode: float) -> tuple[float, float]:
        energy = first + (second - first) * mode**2
        onset = 0.1 * np.sqrt(energy / first)
        return onset, 2.0 * energy / (10.0 * onset)

    return law, glue(10.0, 1.3 * float(np.sqrt(first / second)), 20.0, ends), 2


KINDS: list[Callable[[Random], Kind]] = [
    lambda random: (L.ContactLaw(L.Signorini()), rigid(10.0), 2),
    tresca,
    coulomb,
    softening_kind,
    weakening_kind,
    adhesive,
    mixed_kind,
    lambda random: coulomb(random, 3),
    lambda random: mixed_kind(random, 3),
    mode_dependent,
]
#: Which way the load acts along the normal: onto the foundation, away from it, or either.
WAYS = [0, 1, 1, 1, 1, -1, -1, 1, -1, -1]


@pytest.mark.parametrize("seed", sampled(range(100), (0, 11, 24, 26, 68)))
def test_a_path_is_that_of_another_continuation(seed: int) -> None:
    random = np.random.default_rng(seed)
    law, graph, c = KINDS[seed % len(KINDS)](random)
    points = int(random.integers(1, 6))
    n = points * c
    root = random.normal(size=(n, n))
    stiffness = root @ root.T / n * 6.0 + 4.0 * np.eye(n)
    load = random.normal(size=n) * 1.5
    if way := WAYS[seed % len(KINDS)]:
        load[::c] = way * np.abs(load[::c])
    weights = random.uniform(0.5, 1.5, points)
    own = Continuation(stiffness, load, weights, graph, c)
    # Where it loses its way at a sharp corner, or turns round: from other guesses, or by smaller steps.
    ways = ((LENGTH, 0), (0.2 * LENGTH, 0), *((LENGTH, draw) for draw in range(1, 8)))
    tries = (own.follow(UPTO, length, most=20000, seed=draw) for length, draw in ways)
    along = next((points for points in tries if points[-1, -1] > UPTO), np.zeros((1, 2 * n + 1)))
    assert along[-1, -1] > UPTO
    problem = hv.DiscreteProblem.of_arrays(
        sp.csr_array(stiffness), load, sp.csr_array(np.eye(n)), weights, np.zeros(points), law.at(None)
    )
    path = follow_path(problem, (0.0, UPTO))
    assert path.ended is PathEnd.UPPER_END
    t = path.load_factor[:, None]
    states = np.hstack([path.local.reshape(len(path), n), path.multiplier.reshape(len(path), n), t])
    assert max(np.abs(own.off(x)).max() for x in states) <= 1e-7  # the load of some is perturbed
    theirs, ours = np.hstack([states[:, :n], t]), np.delete(along, range(n, 2 * n), axis=1)
    assert distances(ours[:-1], theirs).max() <= (5e-3 if path.curved.any() else 1e-8)
    assert distances(theirs, ours).max() <= LENGTH
    folds = turns(path.load_factor, 0.05)
    np.testing.assert_allclose(turns(along[:, -1], 0.05), folds, atol=LENGTH)
    told = [fold.load_factor for fold in path.folds]
    assert all(any(abs(one - other) <= 1e-8 for other in told) for one in folds)


def glued_points(seed: int) -> tuple[hv.DiscreteProblem, Graph, Array]:
    """One to three points of glue in the plane and in space that let go at once, under a load of any direction."""
    random = np.random.default_rng(seed)
    points, c = int(random.integers(1, 4)), int(random.integers(2, 4))
    n, root = points * c, random.normal(size=(points * c, points * c))
    stiffness, load = root @ root.T + 0.3 * n * np.eye(n), random.normal(size=n)
    load[::c] = -np.abs(load[::c])
    law, graph, _ = mixed_kind(random, c) if seed % 2 else mode_dependent(random)
    weights = random.uniform(0.3, 1.0, points)
    trace = sp.csr_array(np.eye(n))
    problem = hv.DiscreteProblem.of_arrays(
        sp.csr_array(stiffness), load, trace, weights, np.zeros(points), law.at(None)
    )
    return problem, graph, stiffness


def forces_at(problem: hv.DiscreteProblem, graph: Graph, stiffness: Array, r: Array) -> Array:
    """Of a body with glue at displacements (n,)."""
    pairs = zip(problem.contact.weights, r.reshape(problem.contact.count, -1), strict=True)
    return stiffness @ r - np.concatenate([weight * graph(one, np.zeros(one.size)) for weight, one in pairs])


@pytest.mark.parametrize("seed", sampled(range(80), (28,)))
def test_stretches_are_as_stable_as_the_forces_say(seed: int) -> None:
    problem, graph, stiffness = glued_points(seed)
    path = follow_path(problem, (0.0, 12.0))
    assert path.ended is PathEnd.UPPER_END
    points, told, own = path.local.reshape(len(path), -1), [], []
    for r, t in zip(points, path.load_factor, strict=True):
        assert np.abs(forces_at(problem, graph, stiffness, r) - t * problem.load).max() <= 1e-7
    for one, other, stable in zip(points[:-1], points[1:], path.stable, strict=True):
        ways, middle = 1e-6 * np.eye(one.size), 0.5 * (one + other)
        columns = [forces_at(problem, graph, stiffness, middle + way) for way in (*ways, *-ways)]
        rates = np.linalg.eigvals(np.stack(columns[: one.size]) - np.stack(columns[one.size :])).real / 2e-6
        if np.abs(other - one).max() > 1e-5 and abs(rates.min()) > 1e-2 * np.abs(rates).max():
            told.append(bool(stable))
            own.append(bool(rates.min() > 0.0))
    assert told == own
