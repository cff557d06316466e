"""Problems with a softening foundation whose discrete solutions are known."""

from __future__ import annotations

import numpy as np

from hemivar.discrete import DiscreteProblem
from hemivar.fem import discretize
from hemivar.laws import ContactLaw, Friction, PiecewiseQuadratic, Tresca
from hemivar.mechanics import Contact
from tests import bodies
from tests.problems import bar

X = np.linspace(0.0, 1.0, 9)[1:]


def softening(k: float, delta: float, alpha: float) -> PiecewiseQuadratic:
    """Slope k up to delta, then -alpha down to zero (law G of benchmark E1)."""
    return PiecewiseQuadratic([0.0, delta, delta * (1.0 + k / alpha)], [0.0, k, -alpha, 0.0], [0.0, 0.0, 0.0])  # type: ignore[arg-type]


def bar_solution(r0: float, k: float, delta: float, alpha: float) -> float:
    """E1 with kappa = 1 > alpha: the one penetration."""
    if r0 <= 0.0 or r0 >= delta * (1.0 + k / alpha):
        return r0
    if r0 <= delta * (1.0 + k):
        return r0 / (1.0 + k)
    return (r0 - (k + alpha) * delta) / (1.0 - alpha)


def bar_unknowns(r0: float, r: float) -> np.ndarray:
    """Nodal displacements of the bar that ends at penetration r; b = 2 r0."""
    return 2.0 * r0 * (X - 0.5 * X**2) - (r0 - r) * X


def bar_problem(r0: float, k: float, delta: float, alpha: float) -> DiscreteProblem:
    return bar(2.0 * r0, softening(k, delta, alpha))


def brittle(k: float, end: float) -> PiecewiseQuadratic:
    """Slope k, then nothing: one downward jump."""
    return PiecewiseQuadratic([0.0, end], [0.0, k, 0.0], [0.0, -k * end])  # type: ignore[arg-type]


def weakening(drop: float, rate: float) -> PiecewiseQuadratic:
    """Profile |r| that weakens from 1 by ``drop`` at slope ``-rate``, even."""
    s = drop / rate
    return PiecewiseQuadratic(
        [-s, 0.0, s],
        [0.0, -rate, -rate, 0.0],
        [0.0, 2.0, 0.0],
        start=-(1.0 - drop),  # type: ignore[arg-type]
    )


def survey_softening(
    alpha: float, n: int = 6, friction: Friction | None = None, scale: tuple[float, float] = (1.0, 1.0)
) -> DiscreteProblem:
    """The survey's square on a softening foundation; ``scale`` changes the units of length and force."""
    length, force = scale
    pressure, area = force / length**2, length**2
    law = softening(3.0 * pressure / length, 0.02 * length, alpha * pressure / length)
    body = np.array([-0.8, -0.8]) * force / (area * length)
    return discretize(
        bodies.square(
            Contact(law, friction or Tresca(0.05 * pressure)),
            n,
            side=length,
            lame=(4.0 * pressure, 4.0 * pressure),
            body_force=body,
        )
    )


def block_of_arrays(normal: PiecewiseQuadratic, friction: Friction, load: tuple[float, float]) -> DiscreteProblem:
    """One contact point with two components on springs of stiffness 4."""
    K = np.diag([4.0, 4.0])
    return DiscreteProblem.of_arrays(
        K, np.array(load), np.eye(2), np.ones(1), np.zeros(1), ContactLaw(normal, friction)
    )  # type: ignore[arg-type]
