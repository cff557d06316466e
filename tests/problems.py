"""Small problems shared by the tests."""

from __future__ import annotations

import numpy as np

from hemivar.discrete import DiscreteProblem
from hemivar.fem import discretize
from hemivar.laws import Compliance, ContactLaw, Friction, Signorini, Superpotential, ThresholdCompliance, Tresca
from hemivar.mechanics import Contact, ContactProblem, Quadrature
from hemivar.solvers import Solution
from tests import bodies

#: The survey's five data sets: body force, normal law, friction bound (its Figures 1 to 4 and (5.1)).
SURVEY_DATA: dict[str, tuple[tuple[float, float], Superpotential, Friction]] = {
    "figure 1": ((-0.5, -1.0), ThresholdCompliance(0.1, 10.0), Tresca(0.1)),
    "figure 2": ((-0.5, -1.0), ThresholdCompliance(0.7, 0.0), Tresca(0.1)),
    "figure 3": ((-0.5, -1.0), ThresholdCompliance(0.5, 0.0), Tresca(0.5)),
    "figure 4": ((0.5, -1.0), ThresholdCompliance(10.0, 0.0), Tresca(0.1)),
    "data (5.1)": ((-0.8, -0.8), ThresholdCompliance(0.3, 2.0), Tresca(0.5)),
}

#: The same body on other foundations.
OTHER_DATA: dict[str, tuple[tuple[float, float], Superpotential, Friction]] = {
    "rigid": ((0.5, -1.0), Signorini(), Tresca(0.1)),
    "lifting": ((-0.6, 0.3), Signorini(), Tresca(0.05)),
    "power": ((-0.8, -0.8), Compliance(50.0, 2.0), Tresca(0.1)),
}


def square(
    data: str = "data (5.1)",
    n: int = 8,
    pattern: str = "cross",
    quadrature: Quadrature = Quadrature.NODAL,
) -> ContactProblem:
    """The survey's square: clamped on the left, contact at the bottom, lambda = mu = 4."""
    force, normal, friction = {**SURVEY_DATA, **OTHER_DATA}[data]
    return bodies.square(Contact(normal, friction), n, pattern, body_force=force, quadrature=quadrature)  # type: ignore[arg-type]


def discrete_square(data: str = "data (5.1)", n: int = 8, **options: object) -> DiscreteProblem:
    return discretize(square(data, n, **options))  # type: ignore[arg-type]


def bar(load: float, law: Superpotential, elements: int = 8) -> DiscreteProblem:
    """Bar of unit length and stiffness EA = 1, held at x = 0, contact at x = 1, load per length ``load`` (E1)."""
    h = 1.0 / elements
    K = np.zeros((elements, elements))
    for i in range(elements):
        K[i, i] = (2.0 if i < elements - 1 else 1.0) / h
        if i:
            K[i, i - 1] = K[i - 1, i] = -1.0 / h
    f = np.full(elements, load * h)
    f[-1] *= 0.5
    B = np.zeros((1, elements))
    B[0, -1] = 1.0
    return DiscreteProblem.of_arrays(K, f, B, np.ones(1), np.zeros(1), ContactLaw(law))  # type: ignore[arg-type]


def relative_difference(solution: Solution, reference: Solution) -> float:
    """Difference in the energy norm, relative to the reference."""
    K = reference.problem.stiffness
    v = solution.unknowns - reference.unknowns
    return float(np.sqrt((v @ (K @ v)) / (reference.unknowns @ (K @ reference.unknowns))))
