"""Bodies that glue alone holds: an equilibrium near rest up to a limit, and no minimum of the energy."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scipy.optimize

import hemivar as hv
from hemivar.discrete.held_at_rest import NO_MINIMUM, PERHAPS_NO_MINIMUM
from hemivar.errors import SupportError
from hemivar.fem import LoadLine
from hemivar.mesh import Mesh
from hemivar.solvers import METHODS
from tests import bodies
from tests.samples import slow

GLUE = hv.Adhesive(24.0, 2.0, 6.0, 72.0)
#: Resists the slip by springs 10 up to the stress 1, and then by less.
SHEAR = hv.laws.SlipTable(1.0, [0.0, 0.1, 0.6], [0.0, 1.0, 0.0])


def pulled(tension: float, mesh: Mesh | None = None, **changed: object) -> hv.ContactProblem:
    """A block between frictionless walls, glued to its ground and pulled off it."""
    mesh = hv.rectangle((1.0, 1.0), 4) if mesh is None else mesh
    walls = ("left", "right") if mesh.dim == 2 else ("left", "right", "front", "back")
    stated = {
        "mesh": mesh,
        "material": hv.Material.lame(4.0, 4.0),
        "supports": {name: hv.Roller() for name in walls},
        "contact": {"bottom": hv.Contact(GLUE)},
        "tractions": {"top": (*(0.0,) * (mesh.dim - 1), tension)},
    }
    return hv.ContactProblem(**(stated | changed))  # type: ignore[arg-type]


def lever(part: float = 1.0, stiff: float = 1.0, cells: int = 4) -> hv.ContactProblem:
    """A block that nothing but glue holds, pulled up and sideways at its right side."""
    contact = hv.Contact(GLUE, SHEAR)
    return bodies.square(
        contact, cells, lame=(4.0 * stiff, 4.0 * stiff), supports={}, tractions={"right": (0.3 * part, 1.0 * part)}
    )


def rigid_equilibrium(part: float, cells: int = 4) -> np.ndarray | None:
    """Openings of the same block if it is rigid, from its three motions alone, the load growing; None if it runs away.

    The bottom lies 0.5 below the middle, about which it turns by q[2].
    """
    x = np.linspace(-0.5, 0.5, cells + 1)
    w = np.full(cells + 1, 1.0 / cells)
    w[[0, -1]] *= 0.5

    def out_of_balance(q: np.ndarray, grown: float) -> np.ndarray:
        opening, slip = q[1] + q[2] * x, q[0] + 0.5 * q[2]
        pull = np.where(opening < 0.0, 72.0, 24.0) * opening
        pull = np.where(opening > 1.0 / 12.0, np.maximum(2.0 - 6.0 * (opening - 1.0 / 12.0), 0.0), pull)
        size = abs(slip)
        drag = np.sign(slip) * (10.0 * size if size < 0.1 else max(1.0 - 2.0 * (size - 0.1), 0.0))
        load = part * grown
        return np.array([0.3 * load - drag, load - w @ pull, 0.5 * load - w @ (pull * x) - 0.5 * drag])

    q = np.zeros(3)
    for grown in np.linspace(0.0, 1.0, 60)[1:]:
        found = scipy.optimize.root(out_of_balance, q, args=(grown,), tol=1e-13)
        if np.abs(found.fun).max() > 1e-10 or np.abs(found.x - q).max() > 0.1:
            return None
        q = found.x
    return np.asarray(q[1] + q[2] * x)


PLANE, SPACE = hv.rectangle((1.0, 1.0), 4), hv.box((1.0, 1.0, 1.0), 2)


@pytest.mark.parametrize(
    ("method", "mesh"),
    [("newton", PLANE), ("multigrid", SPACE), slow("multigrid", PLANE), slow("newton", SPACE)],
    ids=["plane-newton", "space-multigrid", "plane-multigrid", "space-newton"],
)
def test_a_block_hangs_on_its_glue_up_to_the_strength(method: str, mesh: Mesh) -> None:
    """In equilibrium every point opens by tension / stiffness, and the most that glue bears is strength times area."""
    for tension in (0.5, 1.99):
        solution = hv.solve(pulled(tension, mesh), METHODS[method]).raise_for_status()
        np.testing.assert_allclose(solution.penetration, -tension / 24.0, rtol=1e-9)
        assert NO_MINIMUM in solution.warnings
    beyond = hv.solve(pulled(2.01, mesh), METHODS[method])
    assert beyond.status is hv.Status.NOT_CARRIED
    with pytest.raises(hv.errors.ProblemError, match=r"equilibria were found up to 0\.99\d+ of it, and none at 1;"):
        beyond.raise_for_status()


def test_friction_after_coulomb_leaves_the_limit_where_it_is() -> None:
    """There is no pressure under a block that is pulled off, and so no friction."""
    contact = {"bottom": hv.Contact(GLUE, hv.Coulomb(0.3))}
    solution = hv.solve(pulled(1.5, contact=contact)).raise_for_status()
    np.testing.assert_allclose(solution.penetration, -1.5 / 24.0, rtol=1e-9)
    assert NO_MINIMUM in solution.warnings
    assert hv.solve(pulled(2.1, contact=contact)).status is hv.Status.NOT_CARRIED


def test_a_stiff_block_opens_as_a_rigid_one() -> None:
    solution = hv.solve(lever(0.4, stiff=1e6)).raise_for_status()
    expected = rigid_equilibrium(0.4)
    assert expected is not None
    np.testing.assert_allclose(-solution.penetration, expected, atol=1e-5)
    assert rigid_equilibrium(3.0) is None
    assert hv.solve(lever(3.0, stiff=1e6)).status is hv.Status.NOT_CARRIED


def test_the_sentence_belongs_to_the_load() -> None:
    problem = hv.discretize(pulled(1.0))
    assert problem.limit == NO_MINIMUM
    assert not problem.held
    line = LoadLine(problem)
    assert line.at(0.5).limit == NO_MINIMUM
    assert line.at(0.0).limit == PERHAPS_NO_MINIMUM  # j is bounded, and so is the energy
    assert line.at(-1.0).limit is None  # the ground is rigid enough
    assert hv.solve(line.at(-0.5)).warnings == ()
    assert hv.discretize(pulled(-1.0)).held
    assert (
        problem.with_(
            law=hv.discretize(
                pulled(1.0, contact={"bottom": hv.Contact(hv.Compliance(1.0))}, tractions={"top": (0.0, -1.0)})
            ).law
        ).limit
        is None
    )


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"supports": {}}, "translation"),  # frictionless: nothing resists a slip
        ({"contact": {"bottom": hv.Contact(GLUE, gap=1.0)}}, "'bottom' begins open by 1 .*give gap = -1"),  # torn off
        ({"contact": {"bottom": hv.Contact(hv.Signorini())}}, "translation"),
        ({"contact": {"bottom": hv.Contact(hv.Softening(10.0, 1.0, 5.0))}}, "translation"),  # pushes only
    ],
)
def test_a_body_that_nothing_holds_at_rest_is_refused(changed: dict[str, object], words: str) -> None:
    with pytest.raises(SupportError, match=rf"free to move.*{words}"):
        hv.discretize(pulled(0.5, **changed))


def test_friction_that_weakens_holds_up_to_a_limit() -> None:
    """Pressed with 1 and pushed with .85: between the friction after a long slip, .7, and that at rest, 1."""
    contact = hv.Contact(hv.Compliance(100.0), hv.SlipWeakening(1.0))
    block = bodies.strip(
        contact, (8, 2), size=(1.0, 0.25), lame=(40.0, 40.0), supports={}, tractions={"top": (0.85, -1.0)}
    )
    solution = hv.solve(block)
    assert solution.status is hv.Status.CONVERGED
    assert NO_MINIMUM in solution.warnings
    assert np.abs(solution.slip).max() < 0.1
    with pytest.raises(SupportError, match="free to move"):
        hv.discretize(replace(block, contact={"bottom": hv.Contact(hv.Compliance(100.0), hv.Tresca(0.7))}))


def test_millimetres_and_megapascals_change_nothing() -> None:
    ours = hv.solve(lever(0.4))
    mesh = hv.rectangle((1e3, 1e3), 4)
    theirs = hv.solve(
        hv.ContactProblem(
            mesh=mesh,
            material=hv.Material.lame(4e-6, 4e-6),
            contact={
                "bottom": hv.Contact(
                    hv.Adhesive(24e-9, 2e-6, 6e-9, 72e-9), hv.laws.SlipTable(1e-6, [0.0, 100.0, 600.0], [0.0, 1.0, 0.0])
                )
            },
            tractions={"right": (0.12e-6, 0.4e-6)},
        )
    )
    assert theirs.warnings == ours.warnings
    np.testing.assert_allclose(theirs.local, 1e3 * ours.local, rtol=1e-8)


@pytest.mark.parametrize("cells", [2, 8])
def test_what_resists_at_rest_is_strength_times_length(cells: int) -> None:
    """A millionth of the load at most: 2 of glue along a side of 1, on every mesh."""
    mesh = hv.rectangle((1.0, 1.0), cells)
    assert hv.discretize(pulled(1.99e6, mesh)).limit is not None
    with pytest.raises(hv.errors.ProblemError, match="free to move"):
        hv.discretize(pulled(2.01e6, mesh))
