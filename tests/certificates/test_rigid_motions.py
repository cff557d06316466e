"""Whether a minimiser of a convex energy is the only one, against the energy along all rigid motions."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pytest
from scipy.optimize import minimize

import hemivar as hv
from hemivar.basics.types import Array
from hemivar.certificates import Certificate, PointKind, certify
from hemivar.discrete import DiscreteProblem
from hemivar.laws import NoFriction, PiecewiseQuadratic, Signorini, ThresholdCompliance
from hemivar.mechanics.conditions import Support
from tests import bodies
from tests.samples import sampled

#: A foundation that pushes by 0.2 wherever it is 0.1 to 0.3 deep.
LEDGE = PiecewiseQuadratic([0.1, 0.3], [0.0, 0.0, 5.0], [0.2, 0.0])  # type: ignore[arg-type]


def certified_block(
    contact: hv.Contact,
    supports: Mapping[str, Support],
    traction: object = (0.0, -1.0),
    *,
    size: tuple[float, float] = (2.0, 1.0),
    cells: tuple[int, int] = (2, 1),
) -> tuple[DiscreteProblem, Array, Certificate]:
    """A block and its certificate; whether contact holds it is not asked."""
    mesh = hv.rectangle(size, cells)
    stated = bodies.body(mesh, contact, lame=(30.0, 30.0), supports=supports, tractions={"top": traction})  # type: ignore[dict-item]
    solution = hv.solve(hv.discretize(stated, check_coercivity=False), rtol=1e-11)
    assert solution.status is hv.Status.CONVERGED
    return solution.problem, solution.unknowns, certify(solution)


def rise(problem: DiscreteProblem, u: Array, size: float) -> float:
    """The least rise of the energy along rigid motions of a size, in units of the load."""
    assert problem.field is not None
    free = np.asarray((problem.field.lift @ problem.model.free_motions.motions).toarray())
    start, load = problem.energy(u), float(np.abs(problem.load).sum())
    count, lowest = free.shape[1], np.inf
    for axis in range(count):
        for sign in (-1.0, 1.0):

            def energy(z: Array, axis: int = axis, sign: float = sign) -> float:
                whole = np.insert(np.clip(z, -1.0, 1.0), axis, sign)
                off = problem.energy(u + size * free @ whole) - start
                return off if np.isfinite(off) else 1e3 * load * (1.0 + float(np.abs(z).max(initial=0.0)))

            starts = [np.zeros(count - 1), *np.random.default_rng(1).uniform(-1.0, 1.0, (6, count - 1))]
            options = {"xatol": 1e-9, "fatol": 1e-16, "maxiter": 400}
            found = [energy(z) if count == 1 else minimize(energy, z, method="Nelder-Mead", options=options).fun
                     for z in starts[: 1 if count == 1 else None]]  # fmt: skip
            lowest = min(lowest, *found)
    return lowest / (load * size)


LAWS = [Signorini(), hv.Compliance(20.0), ThresholdCompliance(0.4, 20.0), LEDGE, hv.Signorini()]
FRICTIONS = [NoFriction(), hv.Tresca(0.1), hv.Tresca(1.0)]


@pytest.mark.parametrize("seed", sampled(range(40), 20))
def test_no_minimiser_that_is_called_the_only_one_has_another_beside_it(seed: int) -> None:
    rng = np.random.default_rng(seed)
    law, which = LAWS[rng.integers(len(LAWS))], int(rng.integers(len(FRICTIONS)))
    curved = float(rng.choice([0.0, 0.0, 0.2]))
    supports: dict[str, Support] = {} if rng.random() < 0.6 else {"left": hv.Fixed(x=0.0)}
    side = float(rng.choice([0.0, 0.05])) if supports or which else 0.0
    off = float(rng.choice([0.0, 0.0, 0.3]))
    contact = hv.Contact(law, FRICTIONS[which], gap=lambda x: curved * (x[:, 0] - 1.0 - off) ** 2)
    cells = (int(rng.integers(1, 4)), 1)
    problem, u, found = certified_block(contact, supports, (side, -1.0), cells=cells)
    assert found.kind in (PointKind.UNIQUE_MINIMISER, PointKind.GLOBAL_MINIMISER)
    assert (found.kind is PointKind.UNIQUE_MINIMISER) == (found.unique is True)
    least = min(rise(problem, u, size) / size for size in (1e-3, 1e-2))
    if found.unique is True:
        assert least > 1e-4, (least, law, which)
    elif least > 1e-2:  # rises along every motion, and not by a little
        pytest.fail(f"not called the only one: {found.uniqueness}, {least:.3g}, {law}, {which}")


def test_the_motion_that_is_left_is_named() -> None:
    """Nothing holds the block along the plane; on a ledge it may sink and turn as well."""
    *_, found = certified_block(hv.Contact(Signorini()), {})
    assert found.uniqueness == "the only one up to a rigid motion, translation (1, 0)"
    assert found.uniqueness in "\n".join(found.lines())
    *_, held = certified_block(hv.Contact(Signorini()), {"left": hv.Fixed(x=0.0)})
    assert held.unique is True
    assert held.kind is PointKind.UNIQUE_MINIMISER
    *_, sinking = certified_block(hv.Contact(LEDGE), {"left": hv.Fixed(x=0.0)}, (0.0, -0.2))
    assert sinking.uniqueness == "the only one up to a rigid motion, translation (0, -1)"


def test_a_block_on_one_edge_rolls_and_on_two_stands() -> None:
    """A gap that leaves one node in touch leaves the rotation about it; two nodes hold it."""
    gap = lambda x: 0.5 * np.abs(x[:, 0] - 1.0)  # noqa: E731
    load = lambda x: np.column_stack([0.0 * x[:, 0], -1.0 + 0.0 * x[:, 0]])  # noqa: E731
    *_, one = certified_block(hv.Contact(Signorini(), hv.Tresca(1.0), gap=gap), {}, load, size=(2.0, 1.0))
    assert one.unique is None
    assert "rotation" in one.free_motion
    high = lambda x: 0.5 * (1.0 - np.abs(x[:, 0] - 1.0))  # noqa: E731
    *_, two = certified_block(hv.Contact(Signorini(), hv.Tresca(1.0), gap=high), {}, load)
    assert two.unique is True


@pytest.mark.parametrize(("length", "force", "part"), [(1.0, 1.0, 0.5), (1e3, 1e6, 0.5), (1.0, 1.0, 1.0)])
def test_in_space_a_cube_on_all_the_friction_there_is_may_go_on(length: float, force: float, part: float) -> None:
    """Drawn by as much as Tresca's friction bears it may slip on; by half of it, it stays."""
    pressure = force / length**2
    contact = {"bottom": hv.Contact(Signorini(), hv.Tresca(0.3 * pressure))}
    material, traction = hv.Material.young(1e3 * pressure, 0.3), {"top": (0.3 * part * pressure, 0.0, -pressure)}
    stated = hv.ContactProblem(hv.box((length,) * 3, 1), material, contact, {}, tractions=traction)
    found = certify(hv.solve(hv.discretize(stated, check_coercivity=False)))
    if part < 1.0:
        assert found.unique is True
    else:
        assert found.unique is None
        assert "translation (1, " in found.free_motion


def test_friction_at_its_bound_lets_a_body_go_that_has_not_moved_yet() -> None:
    """Of all places along the plane the first one: there a node is at rest, with all the friction that it bears."""
    problem, u, found = certified_block(hv.Contact(Signorini(), hv.Tresca(0.1)), {}, (0.1, -1.0))
    assert problem.field is not None
    along = problem.field.lift @ problem.model.free_motions.motions[:, [0]].toarray()[:, 0]
    slips = problem.local(u)[:, 1] / problem.local(along)[:, 1]
    first = certify(problem, u - slips[np.argmin(np.abs(slips))] * along, hv.solve(problem, rtol=1e-11).multiplier)
    assert first.stationary
    assert found.unique is None
    assert found.free_motion
    assert first.free_motion


def test_a_body_at_rest_on_springs_that_only_push_may_rise() -> None:
    *_, found = certified_block(hv.Contact(hv.Compliance(20.0)), {"left": hv.Fixed(x=0.0)}, (0.0, 0.0))
    assert found.uniqueness == "the only one up to a rigid motion, translation (0, 1)"
