"""Small random problems with nonmonotone piecewise-quadratic laws."""

from __future__ import annotations

import numpy as np

from hemivar.basics.types import Array
from hemivar.discrete import DiscreteProblem
from hemivar.laws import ContactLaw, Friction, PiecewiseQuadratic


def random_law(random: np.random.Generator, m: int, even: bool = False) -> PiecewiseQuadratic:
    """A table with up and down jumps and softening pieces, another for each contact point; coercive."""
    count = int(random.integers(1, 4))
    knots = np.sort(random.uniform(-1.0, 1.0, size=(m, count)), axis=1)
    knots += 0.02 * np.arange(count)
    slopes = random.normal(size=(m, count + 1)) * random.choice([0.0, 1.0, 3.0], size=(m, count + 1))
    slopes[:, [0, -1]] = np.abs(slopes[:, [0, -1]])
    jumps = random.normal(size=(m, count)) * random.choice([0.0, 0.5, 1.0], size=(m, count))
    if not even:
        return PiecewiseQuadratic(knots, slopes, jumps, start=random.normal(size=m) * 0.3)
    # Mirrored: j(-r) = j(r), with a kink at rest.
    half = np.abs(knots) + 0.02
    half = np.sort(half, axis=1) + 0.02 * np.arange(count)
    rest = random.uniform(0.0, 1.0, size=(m, 1))
    inner = slopes[:, :-1] if count > 1 else slopes[:, :1]
    widths = np.diff(half, axis=1, prepend=0.0)
    first = -(rest[:, 0] + (inner * widths).sum(axis=1) + jumps.sum(axis=1))
    return PiecewiseQuadratic(
        np.concatenate([-half[:, ::-1], np.zeros((m, 1)), half], axis=1),
        np.concatenate([slopes[:, -1:], inner[:, ::-1], inner, slopes[:, -1:]], axis=1),
        np.concatenate([jumps[:, ::-1], 2.0 * rest, jumps], axis=1),
        start=first,
        name="even",
    )


def random_problem(seed: int, interior: bool = True) -> DiscreteProblem:
    """Up to three contact points in one or two dimensions, with some unknowns off the contact boundary."""
    random = np.random.default_rng(seed)
    m, d = int(random.integers(1, 4)), int(random.integers(1, 3))
    inner = int(random.integers(0, 3)) if interior else 0
    n = m * d + inner
    root = random.normal(size=(n, n))
    K = root @ root.T / n + np.diag(random.uniform(0.1, 1.0, size=n))
    B = np.zeros((m * d, n))
    B[:, : m * d] = np.eye(m * d)
    friction = Friction(random.uniform(0.0, 0.5, size=m), random_law(random, m, even=True)) if d == 2 else None
    normal = random_law(random, m)
    law = ContactLaw(normal) if friction is None else ContactLaw(normal, friction)
    load = random.normal(size=n) * random.choice([0.3, 1.0, 3.0])
    gap: Array = random.normal(size=m) * 0.2
    return DiscreteProblem.of_arrays(K, load, B, random.uniform(0.5, 2.0, size=m), gap, law)  # type: ignore[arg-type]
