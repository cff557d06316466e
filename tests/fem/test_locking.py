"""Nearly incompressible bodies are warned of, in every result."""

from __future__ import annotations

import numpy as np
import pytest

from hemivar.discrete import DiscreteProblem
from hemivar.fem import discretize
from hemivar.fem.locking import LOCKING, largest_poisson_ratio
from hemivar.laws import Compliance
from hemivar.mechanics import Material
from hemivar.mesh import box, rectangle
from hemivar.solvers import solve
from tests import bodies


def on_springs(material: Material, order: int = 1, dim: int = 2, n: int = 4) -> DiscreteProblem:
    mesh = rectangle((1.0, 1.0), n) if dim == 2 else box((1.0, 1.0, 1.0), 2)
    return discretize(
        bodies.body(
            mesh,
            Compliance(5.0),
            material=material,
            body_force=(0.2, -1.0) if dim == 2 else (0.2, 0.0, -1.0),
            order=order,
        )
    )


@pytest.mark.parametrize("nu", [0.0, 0.3, 0.489, 0.49, 0.4999])
@pytest.mark.parametrize("dim", [2, 3])
def test_poissons_ratio_of_isotropic_bodies(nu: float, dim: int) -> None:
    problem = on_springs(Material.young(10.0, nu), dim=dim)
    assert problem.origin is not None
    assert largest_poisson_ratio(problem.origin) == pytest.approx(nu, abs=1e-12)
    assert bool(problem.warnings) == (nu >= LOCKING)


def test_who_is_warned() -> None:
    soft = Material.young(10.0, 0.4999)
    assert "Poisson's ratio is 0.4999" in on_springs(soft).warnings[0]
    assert "order = 2" in on_springs(soft).warnings[0]
    assert not on_springs(soft, order=2).warnings
    assert not on_springs(Material.young(10.0, 0.4999, plane="stress")).warnings
    assert on_springs(Material.young(10.0, lambda x: 0.3 + 0.195 * x[:, 0])).warnings == ()  # 0.4787 at most
    assert on_springs(Material.young(10.0, lambda x: 0.3 + 0.1999 * x[:, 0]), n=40).warnings
    assert on_springs(Material.tensor(np.diag([1.0, 1.0, 0.5]) + 1e4 * np.pad(np.ones((2, 2)), (0, 1)))).warnings


def test_the_warning_is_deserved_and_the_remedy_helps() -> None:
    """Energy of linear and quadratic elements on one mesh, and of quadratic ones on a finer mesh."""
    soft = Material.young(10.0, 0.4999)
    linear, quadratic, fine = (solve(on_springs(soft, *how)).energy for how in ((1, 2, 8), (2, 2, 8), (2, 2, 32)))
    assert abs(linear / fine - 1.0) > 0.1
    assert abs(quadratic / fine - 1.0) < 0.02
