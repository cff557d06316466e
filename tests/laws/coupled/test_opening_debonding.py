"""What glue has lost, point by point: closed forms of a point on springs, and where results say it."""

from __future__ import annotations

import numpy as np
import pytest

import hemivar as hv
from hemivar.laws import Adhesive, BilinearCohesion, ContactLaw, MixedMode, Signorini

STRENGTH, ENERGY, STIFFNESS, RATIO = 30.0, 0.5, 1e4, 1.5
FIRST, LAST = STRENGTH / STIFFNESS, 2.0 * ENERGY / STRENGTH


def curve(rho: float) -> tuple[float, float, float]:
    """Traction, damage and dissipated energy of the bilinear curve, by hand."""
    if rho <= FIRST:
        return STIFFNESS * rho, 0.0, 0.0
    traction = max(STRENGTH * (LAST - rho) / (LAST - FIRST), 0.0)
    stored = 0.5 * traction * rho
    return traction, 1.0 - traction / (STIFFNESS * rho), ENERGY - 0.5 * traction * (LAST - rho) * (rho < LAST) - stored


@pytest.mark.parametrize("rho", [0.0, 0.5 * FIRST, FIRST, 2.0 * FIRST, 0.5 * LAST, LAST, 2.0 * LAST])
@pytest.mark.parametrize("angle", [0.0, 0.7, 0.5 * np.pi])
def test_mixed_mode_says_what_it_lost(rho: float, angle: float) -> None:
    law = MixedMode(BilinearCohesion(STRENGTH, ENERGY, STIFFNESS), RATIO).at(None)
    found = law.debonding(np.array([[-rho * np.cos(angle), rho * np.sin(angle) / RATIO]]))
    _, damage, dissipated = curve(rho)
    assert found["damage"][0] == pytest.approx(damage, abs=1e-12)
    assert found["dissipated"][0] == pytest.approx(dissipated, abs=1e-12)
    if rho > 0.0:
        assert found["mode_ratio"][0] == pytest.approx(np.sin(angle) ** 2, abs=1e-12)
    else:
        assert np.isnan(found["mode_ratio"][0])


@pytest.mark.parametrize("rho", [-1.0, 0.0, 0.5 * FIRST, 2.0 * FIRST, 0.5 * LAST, 2.0 * LAST])
def test_an_adhesive_says_what_it_lost(rho: float) -> None:
    law = ContactLaw(Adhesive(STIFFNESS, STRENGTH, compression=10.0, energy=ENERGY)).at(None)
    found = law.debonding(np.array([[-rho, 0.0]]))
    _, damage, dissipated = curve(max(rho, 0.0))
    assert found["damage"][0] == pytest.approx(damage, abs=1e-12)
    assert found["dissipated"][0] == pytest.approx(dissipated, abs=1e-12)
    assert "mode_ratio" not in found


def test_brittle_glue_loses_what_it_stored() -> None:
    found = ContactLaw(Adhesive(STIFFNESS, STRENGTH)).at(None).debonding(np.array([[-0.9 * FIRST], [-1.1 * FIRST]]))
    assert found["damage"] == pytest.approx([0.0, 1.0])
    assert found["dissipated"] == pytest.approx([0.0, 0.5 * STRENGTH * FIRST], abs=1e-12)


def test_laws_without_glue_say_nothing() -> None:
    problem = hv.ContactProblem(
        hv.rectangle((1.0, 0.5), (4, 2)), hv.Material.young(3000.0, 0.3), {"bottom": hv.Contact(Signorini())},
        {"left": hv.Clamped()}, tractions={"top": (0.0, -1.0)},
    )  # fmt: skip
    solution = hv.solve(problem)
    assert solution.debonding == {}
    assert "damage" not in (solution.contact_table.dtype.names or ())
