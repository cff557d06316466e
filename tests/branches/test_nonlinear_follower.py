"""Load paths of bodies that are not linear: a column in closed form, and solutions at the ends of paths."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq

import hemivar as hv
from hemivar.branches import follow_path
from hemivar.fem import LoadLine
from tests.samples import sampled, slow

L = hv.laws
BULK, SHEAR, STRAIN = 20.0 / 3.0, 8.0, 0.05


def column_material(unit: float = 1.0) -> hv.Material:
    """Stress (bulk + 2/3 secant) e of a column between rollers; the secant, 2 G, falls to a quarter."""
    return hv.Material.hencky(bulk=BULK * unit, shear=0.5 * SHEAR * unit, softened=0.25, strain=STRAIN)


def stress(e: float) -> float:
    secant = SHEAR * (0.25 + 0.75 / np.sqrt(1.0 + 2.0 / 3.0 * e**2 / STRAIN**2))
    return float((BULK + 2.0 / 3.0 * secant) * e)


def far_end(s: float, pressure: float) -> float:
    """How far the end of a column of length 1 is moved, whose other end has moved by s against a pressure."""
    return s + brentq(lambda e: stress(e) - pressure, -1.0, 1.0, xtol=1e-15)


STIFF, LIMIT = 40.0, 0.02
REST = BULK + 2.0 / 3.0 * SHEAR


def tangent_of(e: float) -> float:
    """Derivative of the stress."""
    root = np.sqrt(1.0 + 2.0 / 3.0 * e**2 / STRAIN**2)
    return float(BULK + 2.0 / 3.0 * SHEAR * (0.25 + 0.75 / root**3))


@pytest.mark.parametrize(
    ("space", "alpha", "length"),
    [slow(False, 11.0, 1e3), (False, 11.0, 1.0), slow(False, 25.0, 1.0), slow(True, 11.0, 1.0)],
)
def test_a_column_turns_where_the_closed_form_does(space: bool, alpha: float, length: float) -> None:
    """Its end is pushed, and the foundation falls by alpha: faster than the compressed column can follow.

    At rest its stiffness is 12: alpha = 11 is followed again where the pressure has fallen enough.
    """
    unit = 1.0 / length  # of stress
    law = L.Softening(STIFF * unit / length, LIMIT * length, alpha * unit / length)
    sides = ("left", "right", "front", "back") if space else ("left", "right")
    top = hv.Fixed(z=-0.12 * length) if space else hv.Fixed(y=-0.12 * length)
    stated = hv.ContactProblem(
        mesh=hv.box((length,) * 3, 1) if space else hv.rectangle((length, length), 1),
        material=column_material(unit),
        contact={"bottom": hv.Contact(law)},
        supports={**dict.fromkeys(sides, "roller"), "top": top},
    )
    line = LoadLine.of(stated)
    path = follow_path(line.loaded, unloaded=line.unloaded, largest_step=0.3)
    assert path.reached_end, path.ended

    def pressure(s: float) -> float:
        return STIFF * s if s < LIMIT else max(STIFF * LIMIT - alpha * (s - LIMIT), 0.0)

    def energy(e: float, s: float) -> float:
        knots = [LIMIT, LIMIT + STIFF * LIMIT / alpha]
        return float(quad(stress, 0.0, e)[0] + quad(pressure, 0.0, s, points=[x for x in knots if x < s])[0])

    s = path.local[:, :, 0] / length
    assert np.ptp(s, axis=1).max() <= 1e-9
    ends = np.array([far_end(x, pressure(x)) for x in s[:, 0]])
    np.testing.assert_allclose(path.load_factor * 0.12, ends, atol=1e-10)
    area = length**2 if space else length
    expected = [energy(end - x, x) for end, x in zip(ends, s[:, 0], strict=True)]
    np.testing.assert_allclose(path.energy / (area * unit * length), expected, atol=1e-9)
    e = brentq(lambda e: tangent_of(e) - alpha, 0.0, 1.0) if alpha < REST else 0.0
    turns = [far_end(LIMIT, STIFF * LIMIT), e + LIMIT + (STIFF * LIMIT - stress(e)) / alpha]
    np.testing.assert_allclose([0.12 * fold.load_factor for fold in path.folds], turns, rtol=1e-8)
    assert path.first_instability == pytest.approx(turns[0] / 0.12, rel=1e-8)


GLUE = L.MixedMode(L.BilinearCohesion(strength=1.0, energy=0.05, stiffness=60.0), ratio=1.5)
CONTACTS = {
    "compliance": hv.Contact(L.Compliance(20.0)),
    "tresca": hv.Contact(L.Softening(stiffness=60.0, limit=0.05, softening=1.0), L.Tresca(0.1)),
    "coulomb": hv.Contact(L.Compliance(200.0), L.Tresca(L.CoulombBound(0.2))),
    "glue": hv.Contact(GLUE),
}


@pytest.mark.parametrize("contact", sampled(CONTACTS, 2))
@pytest.mark.parametrize("mesh", [hv.rectangle((2.0, 1.0), (6, 3)), slow(hv.box((2.0, 1.0, 1.0), (3, 2, 2)))])
@pytest.mark.parametrize("unit", [1.0, slow(1e-6)])
def test_the_end_of_a_path_is_the_solution(contact: str, mesh: hv.mesh.Mesh, unit: float) -> None:
    """A block that is pressed, or pulled, on its foundation, and pushed along it; loads are forces."""
    law = CONTACTS[contact]
    along, down = 0.15, (0.2 if contact == "glue" else -0.6)
    traction = (along, down) if mesh.dim == 2 else (along, 0.05, down)
    stated = hv.ContactProblem(
        mesh=mesh,
        material=column_material(),
        contact={"bottom": law},
        supports={"left": "clamped"},
        tractions={"top": traction},
    )
    path = follow_path(stated, largest_step=0.1)
    solved = hv.solve(stated, controls=hv.Controls(rtol=1e-11)).raise_for_status()
    assert path.load_factor[-1] == 1.0
    assert path.curved.all()
    np.testing.assert_allclose(path.local[-1], solved.local, atol=1e-7 * np.abs(solved.local).max())
    np.testing.assert_allclose(path.energy[-1], np.nan if contact == "coulomb" else solved.energy, rtol=1e-8)


def test_a_linear_energy_has_the_path_of_the_linear_body() -> None:
    """The same material as a formula and as moduli: folds and points of the scalar curves."""

    def block(material: hv.Material) -> hv.ContactProblem:
        return hv.ContactProblem(
            mesh=hv.rectangle((2.0, 1.0), (4, 2)),
            material=material,
            contact={"bottom": hv.Contact(L.Adhesive(24.0, 1.0, 6.0, 30.0))},
            supports={"left": "clamped"},
            tractions={"top": (0.0, 1.0)},
        )

    lame = hv.Material.lame(4.0, 4.0)
    formula = hv.Material.potential("2 * tr**2 + 4 * (dev2 + tr**2 / 3)", reach=1.0)
    one, other = (follow_path(block(one), (0.0, 3.0), largest_step=0.1) for one in (lame, formula))
    assert one.ended is other.ended
    assert len(one.folds) > 0
    loads = [[fold.load_factor for fold in path.folds] for path in (one, other)]
    np.testing.assert_allclose(loads[1], loads[0], rtol=1e-7)
