"""Bodies that contact alone holds, under no load: rest is an equilibrium, one of many."""

from __future__ import annotations

import numpy as np
import pytest

import hemivar as hv
from hemivar.errors import SupportError
from hemivar.laws import Superpotential, ThresholdCompliance
from tests.samples import slow

METHODS = [None, hv.solvers.NonsmoothNewton(), hv.solvers.NonsmoothMultigrid()]
SOFTENS = hv.Softening(1e4, 1e-3, 1e3)
NOTE = "no load presses the body"


def upheld_block(
    law: Superpotential,
    load: tuple[float, ...] = (0.0, 0.0),
    gap: object = 0.0,
    unit: float = 1.0,
    supports: dict[str, object] | None = None,
) -> hv.ContactProblem:
    """A block in the plane on a foundation that holds it upwards only, lengths in some unit."""
    mesh = hv.rectangle((2.0 * unit, unit), (8, 4))
    held = {"left": hv.Fixed(x=0.0)} if supports is None else supports
    contact = {"bottom": hv.Contact(law, gap=gap)}
    return hv.ContactProblem(mesh, hv.Material.young(1e3, 0.3), contact, held, tractions={"top": load})


@pytest.mark.parametrize("method", METHODS, ids=lambda method: "default" if method is None else method.name)
@pytest.mark.parametrize(
    "law", [hv.Signorini(), hv.Compliance(1e4), hv.Softening(1e4, 1e-3, 1e3)], ids=lambda x: x.name
)
@pytest.mark.parametrize("gap", [0.0, 0.1, lambda x: 0.01 * x[:, 0] ** 2])
@pytest.mark.parametrize("unit", [1.0, 1e-3])
def test_a_body_without_load_rests(
    law: Superpotential, method: hv.solvers.Solver | None, gap: object, unit: float
) -> None:
    found = hv.solve(upheld_block(law, gap=gap, unit=unit), method)
    assert found.status is hv.Status.CONVERGED
    assert not found.unknowns.any()
    assert not found.multiplier.any()
    assert any(said.startswith(NOTE) for said in found.warnings)


def test_in_space_and_on_an_obstacle_that_touches_up_to_rounding() -> None:
    mesh = hv.box((1.0, 1.0, 1.0), (3, 3, 3))
    supports = {"left": hv.Fixed(x=0.0), "front": hv.Fixed(y=0.0)}
    sphere = hv.mechanics.Sphere((0.3, 0.3, -0.7), 0.7)
    for law in (hv.Signorini(), hv.Compliance(1e6), hv.Softening(1e3, 1e-3, 1e2)):
        contact = {"bottom": hv.Contact(law, obstacle=sphere)}
        problem = hv.discretize(hv.ContactProblem(mesh, hv.Material.young(1e3, 0.3), contact, supports))
        assert problem.unmoved
        assert problem.idle is not None
        assert not hv.solve(problem).unknowns.any()


def test_what_nothing_holds_either_way_is_refused_as_before() -> None:
    for supports in ({}, {"left": hv.Fixed(y=0.0)}):
        with pytest.raises(SupportError, match=r"translation \(1, 0\)"):
            hv.discretize(upheld_block(hv.Signorini(), supports=supports))


def test_a_body_that_its_obstacle_presses_is_no_body_at_rest() -> None:
    with pytest.raises(SupportError, match="in balance"):
        hv.discretize(upheld_block(hv.Compliance(1e4), gap=-0.01))
    with pytest.raises(SupportError, match="energy falls"):
        hv.discretize(upheld_block(hv.Signorini(), load=(0.0, 1e-9)))


def test_the_note_belongs_to_the_load() -> None:
    problem = hv.discretize(upheld_block(hv.Signorini()))
    loaded = hv.discretize(upheld_block(hv.Signorini(), load=(0.0, -1.0)))
    assert not problem.held
    assert loaded.held
    assert loaded.idle is None
    assert problem.with_(load=loaded.load).idle is None
    assert not hv.solve(problem.with_(load=loaded.load)).warnings


def test_glue_and_softening_keep_their_limit_under_another_load() -> None:
    """What rests under no load may be held up to a limit under another, as if that load had been stated."""
    for law in (ThresholdCompliance(1e-3, 0.5), hv.Softening(1e4, 1e-3, 1e3), hv.Adhesive(1e4, 1.0)):
        rest, loaded = (hv.discretize(upheld_block(law, load=(0.0, -size))) for size in (0.0, 1e-3))
        assert rest.with_(load=loaded.load).limit == loaded.limit


@pytest.mark.parametrize("method", METHODS, ids=lambda method: "default" if method is None else method.name)
@pytest.mark.parametrize(
    "friction", [hv.laws.NoFriction(), hv.Tresca(0.3), hv.Coulomb(0.3)], ids=["smooth", "tresca", "coulomb"]
)
@pytest.mark.parametrize("softening", [500.0, slow(5e3)])
def test_a_bond_that_snaps_leaves_the_body_as_it_was_made(
    softening: float, friction: hv.laws.Friction, method: hv.solvers.Solver | None
) -> None:
    """Its foundation is drawn away: nothing else acts, and where the bond has let go nothing acts at all."""

    def drawn(way: float) -> hv.DiscreteProblem:
        law = hv.Adhesive(1e3, 10.0, softening=softening, compression=1e3)
        contact = {"bottom": hv.Contact(law, friction, gap=way)}
        mesh = hv.rectangle((1.0, 0.5), (8, 4))
        return hv.discretize(hv.ContactProblem(mesh, hv.Material.young(100.0, 0.3), contact, {"top": hv.Clamped()}))

    given = method if method is None else method.name
    bonded = hv.solve(drawn(0.005), given).raise_for_status()
    assert np.abs(bonded.unknowns).max() > 1e-5
    for way in (0.05, 10.0):
        found = hv.solve(drawn(way), given, initial=bonded.unknowns)
        assert found.status is hv.Status.CONVERGED
        assert found.residual.total == 0.0
        np.testing.assert_array_equal(found.unknowns, 0.0)
        assert found.steps <= 40
