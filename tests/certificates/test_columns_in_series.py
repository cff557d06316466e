"""Two columns on one another: compliances add up, and with them margin, uniqueness and kind have a closed form."""

from __future__ import annotations

import numpy as np
import pytest

import hemivar as hv

PULL, STIFFNESS, STRENGTH = 0.1, 2.0, 0.05


def columns(moduli: tuple[float, float], softening: float, matching: bool, order: int) -> hv.ContactProblem:
    """Glued columns, of height 1/2 each, between rollers; the upper one is pulled."""
    upper, lower = ((3, 6), (2, 4)) if not matching else ((2, 4), (2, 4))
    parts = {"upper": hv.rectangle((0.25, 0.5), upper, origin=(0.0, 0.5)), "lower": hv.rectangle((0.25, 0.5), lower)}
    materials = {name: hv.Material.young(E, 0.0) for name, E in zip(parts, moduli, strict=True)}
    supports = {f"{name}:{side}": hv.mechanics.Roller() for name in parts for side in ("left", "right")}
    glue = hv.Adhesive(STIFFNESS, STRENGTH, softening=softening)
    return hv.ContactProblem(
        hv.Mesh.assembled(parts), hv.Material.by_region(materials),  # type: ignore[arg-type]
        {"upper:bottom": hv.Contact(glue, against="lower:top")},
        {**supports, "lower:bottom": hv.mechanics.Clamped(), "upper:top": hv.Prescribed((0.0, PULL))}, order=order,
    )  # fmt: skip


@pytest.mark.parametrize(("matching", "order"), [(True, 1), (False, 1), (True, 2)])
@pytest.mark.parametrize("moduli", [(1.0, 1.0), (1.0, 1000.0), (1000.0, 1.0), (3.0, 0.5)])
@pytest.mark.parametrize("c", [0.3, 0.9, 1.1])
def test_margin_uniqueness_and_kind(moduli: tuple[float, float], c: float, matching: bool, order: int) -> None:
    compliance = sum(0.5 / E for E in moduli)
    softening = c / compliance
    problem = columns(moduli, softening, matching, order)
    assert softening * 0.5 / max(moduli) < 1.0  # the stiffer column alone would have a margin
    found = hv.certify(hv.solve(problem))
    assert found.smallness.constant == pytest.approx(c, rel=1e-9)
    assert found.margin == pytest.approx(1.0 - c, rel=1e-8)
    assert found.unique is (True if c < 1.0 else None)


@pytest.mark.parametrize("moduli", [(1.0, 1000.0), (1000.0, 1.0), (1.0, 1.0)])
def test_the_three_solutions_beyond_the_margin(moduli: tuple[float, float]) -> None:
    """With c = 2 the glue holds elastically, softens, or is broken; the one that softens is a saddle."""
    compliance = sum(0.5 / E for E in moduli)
    softening = 2.0 / compliance
    onset, broken = STRENGTH / STIFFNESS, STRENGTH / STIFFNESS + STRENGTH / softening
    pull = 0.5 * (broken + onset * (1.0 + STIFFNESS * compliance))  # beyond breaking, below where the glue gives way
    assert broken < pull < onset * (1.0 + STIFFNESS * compliance)
    problem = columns(moduli, softening, True, 1)
    supports = {**problem.supports, "upper:top": hv.Prescribed((0.0, pull))}
    discrete = hv.discretize(hv.ContactProblem(problem.mesh, problem.material, problem.contact, supports))
    opening = [
        pull / (1.0 + STIFFNESS * compliance),
        (pull - compliance * (STRENGTH + softening * onset)) / (1.0 - softening * compliance),
        pull,
    ]
    kinds = []
    for w in opening:
        stress = (pull - w) / compliance
        x = problem.mesh.points
        above = np.isin(np.arange(len(x)), problem.mesh.cells[problem.mesh.regions["upper"]])
        height = np.where(above, pull + stress / moduli[0] * (x[:, 1] - 1.0), stress / moduli[1] * x[:, 1])
        assert discrete.field is not None
        unknowns = discrete.field.restrict(np.column_stack([np.zeros(len(x)), height]))
        kinds.append(str(hv.certify(discrete, unknowns).kind))
    assert kinds == ["local minimiser", "saddle", "local minimiser"]
