"""The pair of mixed-mode glue in a chart: found by its piece, without a search."""

from __future__ import annotations

import numpy as np
import pytest

import hemivar as hv
from hemivar.basics.types import Array
from hemivar.laws import BilinearCohesion, MixedMode
from hemivar.laws.coupled.opening import rising_roots


@pytest.mark.parametrize("seed", range(8))
def test_a_pair_comes_back_from_its_place_in_the_chart(seed: int) -> None:
    """Elastic, softening, broken and pressed points, at knots and beside them; units of any size."""
    rng = np.random.default_rng(seed)
    strength, first = 10.0 ** rng.uniform(-3.0, 6.0), 10.0 ** rng.uniform(-6.0, 0.0)
    last = first * rng.uniform(1.5, 50.0)
    cohesion = BilinearCohesion(strength, 0.5 * strength * last, strength / first)
    law = MixedMode(cohesion, float(rng.uniform(0.3, 3.0)), hv.Compliance(strength / first)).at(None)
    alphas = np.array([float(alpha.max()) for alpha in law.weak_convexity])
    a = alphas * (1.0 + 10.0 ** rng.uniform(-2.0, 2.0, (80, 2)))
    r = last * rng.uniform(-2.0, 1.0, (80, 2)) * 10.0 ** rng.uniform(-3.0, 0.5, (80, 1))
    r[:3] = 0.0
    r[3:12] = np.outer(-np.repeat([first, last, 2.0 * last], 3) * np.tile([1.0, 1.0 - 1e-9, 1.0 + 1e-9], 3), [1.0, 0.0])
    lam = law.nearest_multiplier(r, np.zeros_like(r))
    found = law.on_graph(a * r + lam, a)
    np.testing.assert_allclose(found.r, r, atol=1e-11 * last)
    np.testing.assert_allclose(found.multiplier, lam, atol=1e-9 * float((a * last).max()))


def two_energies(rng: np.random.Generator, seed: int, strength: float, first: float) -> hv.laws.ModeDependentGlue:
    """Glue of two energies, of which half the points remember the mode at which they began to soften."""
    energy = strength * first * rng.uniform(1.0, 5.0)
    make = hv.laws.BenzeggaghKenane if seed % 2 else hv.laws.PowerCriterion
    criterion = make(energy, energy * rng.uniform(0.8, 3.0), rng.uniform(1.1, 3.0))
    push = hv.Signorini() if seed % 3 else hv.Compliance(strength / first)
    law = hv.laws.ModeDependentGlue(
        strength, strength * rng.uniform(0.8, 1.2), strength / first, criterion, compression=push
    ).at(None)
    if seed < 4:
        return law
    kept, reached = np.where(rng.random(80) < 0.5, rng.random(80), -1.0), first * rng.uniform(0.0, 8.0, 80)
    return law.unloading({"mode": kept, "opening": reached})


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("components", [2, 3])
def test_glue_of_two_energies_finds_its_mode_with_the_pair(seed: int, components: int) -> None:
    """The law says the traction in the mode of the place itself; how the pair moves is told by differences."""
    rng = np.random.default_rng(seed)
    strength, first = 10.0 ** rng.uniform(-3.0, 6.0), 10.0 ** rng.uniform(-6.0, 0.0)
    law = two_energies(rng, seed, strength, first)
    a = law.curve_above[0].max() * (1.0 + 10.0 ** rng.uniform(-1.0, 1.0, (80, 1))) * np.ones((1, 2))
    r = first * rng.uniform(-10.0, 2.0, (80, components)) * 10.0 ** rng.uniform(-2.0, 0.5, (80, 1))
    rigid = np.isfinite(law.penetrations.upper)
    r[:, 0] = np.where(rigid, np.minimum(r[:, 0], 0.0), r[:, 0])
    pushed = np.column_stack([np.where(rigid, strength, 0.0) * np.ones(80), np.zeros((80, components - 1))])
    p = a[:, :1] * r + law.nearest_multiplier(r, pushed)
    found, size = law.on_graph(p, a), first * np.maximum(np.abs(r / first).max(axis=1), 1.0)
    assert (np.abs(found.r - r).max(axis=1) <= 1e-11 * size).all()
    step = 1e-6 * a[:, :1] * size[:, None] * rng.normal(size=r.shape)
    ahead, back = (law.on_graph(p + side * step, a).r for side in (0.5, -0.5))
    told = np.einsum("mij,mj->mi", found.jacobian, step)
    smooth = np.abs(ahead - 2.0 * found.r + back).max(axis=1) <= 1e-3 * np.abs(step / a[:, :1]).max(axis=1)
    assert smooth.sum() >= 70
    np.testing.assert_allclose((ahead - back)[smooth] / size[smooth, None], (told / size[:, None])[smooth], atol=1e-9)


def test_a_root_that_rounding_hides_is_not_sought_on() -> None:
    """Two large parts cancel: the root is known to their rounding and no better."""
    asked: list[Array] = []

    def value(m: Array) -> tuple[Array, Array, Array]:
        asked.append(m)
        return (1e8 + m) - (1e8 + 0.3), np.ones(m.size), 2e8 + m

    root = rising_roots(value, np.zeros(1), np.full(1, 4.0))
    np.testing.assert_allclose(root, 0.3, atol=1e-6)
    assert len(asked) <= 4
