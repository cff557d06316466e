"""Contact over an area of a plane body: a sheet that slides on a table, against closed forms and against itself."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hemivar as hv
from hemivar.basics.types import Array
from hemivar.bounds import solve_adaptive
from hemivar.files import write_vtu
from hemivar.files.problem_file import parse_problem, problem_text
from hemivar.laws import BilinearCohesion, MixedMode, NoContact
from hemivar.laws.friction.friction_law import Friction
from hemivar.laws.registry import friction_law
from hemivar.mechanics import Clamped, Contact, Quadrature, Roller
from hemivar.mesh import Mesh
from hemivar.report import plot_contact, plot_solution
from hemivar.solvers import Solution, TangentialState

E = 1000.0  # MPa
PULL = 2.0
LENGTH = 100.0  # mm


def over(friction: Friction, **more: Any) -> Contact:
    return Contact(NoContact(), friction, **more)


def springs(stiffness: float) -> Friction:
    """Force per area that is in proportion to the displacement."""
    found = friction_law("formula", derivative=f"{stiffness}*r", reach=1e9)
    assert isinstance(found, Friction)
    return found


def bar_on_foundation(n: int, contact: Contact, length: float = 1.0, stress: float = 1.0) -> hv.ContactProblem:
    """A strip between rollers, pulled at its right end: a bar on its foundation. Units of so many mm and MPa."""
    return hv.ContactProblem(
        hv.rectangle((LENGTH / length, 0.1 * LENGTH / length), (n, max(1, n // 10))),
        hv.Material.young(E / stress, 0.0), {"area": contact}, {"bottom": Roller(), "top": Roller()},
        tractions={"right": (PULL / stress, 0.0)},
    )  # fmt: skip


def off(solution: Solution, exact: Array) -> float:
    """Largest error of the displacement along the bar, over the largest displacement."""
    u = solution.displacement
    return float(np.abs(u - np.column_stack([exact, np.zeros(len(u))])).max() / np.abs(exact).max())


def lag(x: Array, k: float) -> Array:
    """E u'' = k u with u'(0) = 0 and E u'(L) = PULL."""
    m = np.sqrt(k / E)
    return np.asarray(PULL / (E * m) * np.cosh(m * x) / np.sinh(m * LENGTH))


def slid(x: Array, tau: float) -> Array:
    """E u'' = tau where it slides, over the length PULL / tau from the end that is pulled; it sticks elsewhere."""
    return np.asarray(tau / (2.0 * E) * np.maximum(x - (LENGTH - PULL / tau), 0.0) ** 2)


def test_springs_over_an_area_are_shear_lag() -> None:
    found = []
    for n in (20, 40, 80):
        problem = bar_on_foundation(n, over(springs(0.4)))
        found.append(off(hv.solve(problem).raise_for_status(), lag(problem.mesh.points[:, 0], 0.4)))
    assert found[0] < 3e-3
    assert found[1] < found[0] / 2.5
    assert found[2] < found[1] / 2.5


def test_friction_over_an_area_slides_over_pull_over_bound() -> None:
    tau, found = 0.04, []
    for n in (20, 40, 80):
        problem = bar_on_foundation(n, over(hv.Tresca(tau)))
        solution = hv.solve(problem).raise_for_status()
        x = problem.mesh.points[solution.contact.node, 0]
        slips = solution.tangential_state == TangentialState.SLIP
        h = LENGTH / n
        assert x[slips].min() == pytest.approx(LENGTH - PULL / tau, abs=1.5 * h)
        found.append(off(solution, slid(problem.mesh.points[:, 0], tau)))
        assert solution.on("area").force[0] == pytest.approx(-PULL * 0.1 * LENGTH)
    assert found[0] < 4e-3
    assert found[1] < found[0] / 2.0
    assert found[2] < found[1] / 2.0


def test_units_do_not_matter() -> None:
    """mm and MPa against m and Pa, with a law that has a length of its own.

    What acts over an area of a plane body is a force per area and per thickness, as a body force is.
    """
    law = hv.laws.SlipWeakening(0.06, rate=0.5)
    mm = hv.solve(bar_on_foundation(20, over(law))).raise_for_status()
    m = hv.solve(bar_on_foundation(20, over(hv.laws.SlipWeakening(0.06e9, rate=0.5e3)), 1e3, 1e-6)).raise_for_status()
    np.testing.assert_allclose(
        m.displacement * 1e3, mm.displacement, rtol=0.0, atol=1e-9 * np.abs(mm.displacement).max()
    )
    assert m.states.counts == mm.states.counts


def sheet(degrees: float = 0.0, **changes: Any) -> tuple[hv.ContactProblem, Array]:
    """A sheet that is clamped on the left, on rollers below, and pulled, turned by some angle; and the turn."""
    a = np.deg2rad(degrees)
    turn = np.array([[np.cos(a), -np.sin(a)], [np.sin(a), np.cos(a)]])
    plain = hv.rectangle((2.0, 1.0), (8, 4))
    mesh = Mesh(plain.points @ turn.T, plain.cells, plain.boundaries)
    contact = over(hv.Tresca(2.0), belt=tuple(turn @ [0.0, 0.001]))
    problem = hv.ContactProblem(
        mesh, hv.Material.young(1000.0, 0.3), {"area": contact}, {"bottom": Roller(), "left": Clamped()},
        tractions={"right": tuple(turn @ [5.0, 1.0])},
    )  # fmt: skip
    return replace(problem, **changes), turn


def test_a_sheet_may_be_turned() -> None:
    """Friction that has no direction acts along rollers that are oblique to the axes as it does along the axes."""
    plain, turned = sheet(), sheet(33.0)
    here, there = (hv.solve(problem).raise_for_status() for problem, _ in (plain, turned))
    assert not there.contact.without_friction.any()
    u = here.displacement
    np.testing.assert_allclose(there.displacement @ turned[1], u, rtol=0.0, atol=1e-10 * np.abs(u).max())
    np.testing.assert_allclose(there.on("area").force @ turned[1], here.on("area").force, rtol=1e-9)


def test_every_method_finds_the_same() -> None:
    stated, _ = sheet()
    problem = hv.discretize(replace(stated, contact={"area": over(hv.Tresca(2.0))}))
    u = hv.solve(problem, method="newton").raise_for_status().unknowns
    for method in ("multigrid", "augmented-lagrangian-newton", "active-set"):
        other = hv.solve(problem, method=method).raise_for_status()
        np.testing.assert_allclose(other.unknowns, u, rtol=0.0, atol=1e-7 * np.abs(u).max())


def test_the_energy_is_least() -> None:
    """The energy, integrated by hand, rises from the solution in every direction that is tried."""
    problem, _ = sheet(0.0, supports={"left": Clamped()})
    found = hv.solve(problem).raise_for_status()
    discrete = found.problem
    weights = np.bincount(problem.mesh.cells.ravel(), np.repeat(problem.mesh.volumes / 3.0, 3))
    belt = np.array([0.0, 0.001])

    def energy(u: Array) -> float:
        full = discrete.field.full(u)  # type: ignore[union-attr]
        slip = np.linalg.norm(full - belt, axis=1)
        return float(0.5 * u @ (discrete.stiffness @ u) - discrete.load @ u + 2.0 * weights @ slip)

    held = np.linalg.norm(belt) * 2.0 * weights[problem.mesh.points[:, 0] == 0.0].sum()
    assert found.energy == pytest.approx(energy(found.unknowns), rel=1e-10)
    assert held > 0.0  # nodes that the support holds slide on the belt, too
    rng = np.random.default_rng(3)
    for size in (1e-2, 1e-4, 1e-6):
        for _ in range(20):
            step = size * rng.normal(size=found.unknowns.size) * np.abs(found.unknowns).max()
            assert energy(found.unknowns + step) > energy(found.unknowns)


@pytest.mark.parametrize("share", [0.99, 1.01])
def test_a_sheet_that_nothing_else_holds(share: float) -> None:
    """It sticks as it is while the load on each part is below the bound, and no longer."""
    problem = hv.ContactProblem(
        hv.rectangle((1.0, 1.0), 4), hv.Material.young(E, 0.3), {"area": over(hv.Tresca(2.0))},
        body_force=(2.0 * share * 0.6, 2.0 * share * 0.8),
    )  # fmt: skip
    if share > 1.0:
        with pytest.raises(hv.errors.SupportError, match="free to move"):
            hv.solve(problem)
        return
    solution = hv.solve(problem).raise_for_status()
    np.testing.assert_allclose(solution.on("area").force, [-1.2 * share, -1.6 * share])
    assert np.abs(solution.displacement).max() < 1e-12


def halves() -> Mesh:
    mesh = hv.rectangle((2.0, 1.0), (16, 8))
    upper = mesh.points[mesh.cells][..., 1].mean(axis=1) > 0.6
    return mesh.named(mesh.boundaries, {"glued": np.flatnonzero(upper), "rest": np.flatnonzero(~upper)})


def mixed(area: str = "glued") -> hv.ContactProblem:
    """Contact over a region and on a boundary of one body."""
    return hv.ContactProblem(
        halves(), hv.Material.young(1000.0, 0.3),
        {"bottom": Contact(hv.Signorini(), hv.Tresca(0.3), gap=0.001), area: over(hv.Tresca(2.0))},
        {"left": Clamped()}, tractions={"top": (1.0, -8.0)},
    )  # fmt: skip


def test_an_area_beside_a_contact_boundary() -> None:
    """Both act on the one body; the forces balance, and the boundary alone has a pressure."""
    solution = hv.solve(mixed()).raise_for_status()
    total = sum(solution.on(name).force for name in ("bottom", "glued")) + solution.reactions["left"]
    np.testing.assert_allclose(total, [-2.0, 16.0])
    assert solution.on("bottom").normal_force > 1.0
    assert solution.on("glued").normal_force == 0.0
    assert np.linalg.norm(solution.on("glued").friction_vectors, axis=1).max() == pytest.approx(2.0)
    assert solution.measured == "measure"
    with pytest.raises(hv.errors.ProblemError, match=r"'bottom' \(boundary\) and 'rest' \(area\) share 16 nodes"):
        hv.discretize(mixed("rest"))


def test_glue_over_an_area_shears() -> None:
    """A law that couples opening and slip, without an opening: that of the slip alone."""
    strength, stiffness, last = 0.04, 0.4, 1.0
    glue = MixedMode(BilinearCohesion(strength, 0.5 * strength * last, stiffness))
    falling = f"piecewise(({stiffness}*r, r < 0.1), ({strength}*({last} - r)/0.9, r < {last}), (0, r >= {last}))"
    table = friction_law("formula", derivative=falling, reach=10.0)
    assert isinstance(table, Friction)
    problems = (bar_on_foundation(20, Contact(glue, memory=())), bar_on_foundation(20, over(table)))
    ours, theirs = (hv.solve(one).raise_for_status() for one in problems)
    assert 0.1 < np.abs(ours.displacement).max() < last
    np.testing.assert_allclose(ours.displacement, theirs.displacement, atol=1e-7 * np.abs(theirs.displacement).max())


def test_a_table_that_moves_drags_a_sheet_along() -> None:
    """In time: a belt moves off, and friction stretches the sheet, which its support holds: E u'' = -tau."""
    problem = parse_problem("""
    mesh.rectangle = [10.0, 1.0]
    mesh.cells = [20, 2]
    material = { young = 1000.0, poisson = 0.0 }
    supports.left = "clamped"
    [area]
    friction = { law = "tresca", bound = 0.5 }
    belt = ["t", 0.0]
    """)
    assert problem.time_dependent == {"gap"}
    history = hv.march(hv.Evolution(problem), 1.0, step=0.25)
    x, u = problem.mesh.points[:, 0], history.frames[-1].displacement
    exact = 0.5 / 1000.0 * (10.0 * x - 0.5 * x**2)
    np.testing.assert_allclose(u[:, 0], exact, rtol=0.0, atol=0.01 * exact.max())


def test_problem_files_state_areas() -> None:
    problem = replace(mixed(), mesh=halves())
    text = """
    title = "two"
    [mesh]
    rectangle = [2.0, 1.0]
    cells = [4, 2]
    [material]
    young = 1000.0
    poisson = 0.3
    [supports]
    left = "clamped"
    [area]
    friction = { law = "tresca", bound = "2*x" }
    belt = [0.1, 0.0]
    """
    stated = parse_problem(text)
    again = parse_problem(problem_text(stated))
    assert list(again.areas) == list(stated.areas) == ["area"]
    one, other = (hv.discretize(found) for found in (stated, again))
    np.testing.assert_array_equal(one.offset, other.offset)
    for given, words in (
        ("[area.left]", r"\[area\] left: is neither of normal, friction, belt, memory nor a region"),
        ('[area]\nnormal = "signorini"', "its points only slide"),
        ('[area]\nfriction = { law = "coulomb", coefficient = 0.3 }', "depends on penetration or pressure"),
        ("[area]\ngap = 0.1", r"\[area\] gap: unknown key|gap: is neither"),
    ):
        with pytest.raises(hv.errors.ProblemError, match=words):
            parse_problem(text.partition("[area]")[0] + given)
    assert problem.areas.keys() == {"glued"}


def test_files_and_pictures_show_areas(tmp_path: Path) -> None:
    solution = hv.solve(mixed()).raise_for_status()
    body, contact = write_vtu(solution, tmp_path / "a.vtu")
    assert contact is not None
    import meshio

    found = meshio.read(body).point_data
    on = solution.on("glued")
    np.testing.assert_allclose(found["friction"][on.contact.node, :2], on.friction_vectors, atol=1e-12)
    assert set(found["boundary"][on.contact.node]) == {1}
    assert np.linalg.norm(found["mean_friction"], axis=1).max() <= 2.0 + 1e-9
    assert found["state"][on.contact.node].min() >= 0
    for figure in (plot_solution(solution), plot_contact(solution)):
        figure.canvas.draw()
    assert any("friction" in ax.get_xlabel() for ax in plot_contact(solution).axes)


@pytest.mark.parametrize(
    ("contact", "words"),
    [
        (Contact(hv.Signorini()), "the law 'signorini' of a penetration and the friction 'tresca', .* only slide"),
        (Contact(hv.Signorini(), hv.Tresca(1.0)), "the law 'signorini' of a penetration and the friction 'tresca'"),
        (Contact(NoContact()), "give NoContact\\(\\) and friction"),
        (over(hv.Coulomb(0.3)), "depends on penetration or pressure, which contact over an area does not have"),
        (
            over(hv.Tresca(1.0), against="left"),
            "is an area with against = 'left', and bodies",
        ),
        (over(hv.Tresca(1.0), gap=0.1), "has a gap, which needs a normal"),
        (over(hv.Tresca(1.0), obstacle=hv.Plane((0.0, -1.0), (0.0, 1.0))), "has an obstacle, which needs a normal"),
        (over(hv.Tresca(1.0), damping=hv.Compliance(1.0)), "has damping of the penetration"),
    ],
)
def test_what_an_area_of_a_body_refuses(contact: Contact, words: str) -> None:
    with pytest.raises(hv.errors.ProblemError, match=f"contact 'area': .*{words}"):
        sheet(contact={"area": contact})


def test_where_areas_are_refused() -> None:
    problem, _ = sheet()
    with pytest.raises(hv.errors.ProblemError, match="use order = 1"):
        replace(problem, order=2)
    with pytest.raises(hv.errors.ProblemError, match="'axisymmetric' has no contact over an area"):
        replace(problem, mesh=hv.rectangle((1.0, 1.0), 2), material=hv.Material.young(1.0, 0.3, plane="axisymmetric"))
    with pytest.raises(hv.errors.ProblemError, match="acts at the nodes; take Quadrature"):
        replace(problem, quadrature=Quadrature.MIDPOINT)
    with pytest.raises(hv.errors.ProblemError, match="this body is 3D; use a bedding"):
        hv.ContactProblem(hv.box((1.0, 1.0, 1.0), 1), hv.Material.young(1.0, 0.3), {"area": over(hv.Tresca(1.0))})
    with pytest.raises(hv.errors.ProblemError, match="'aera', which the mesh does not have"):
        replace(problem, contact={"aera": over(hv.Tresca(1.0))})
    with pytest.raises(hv.errors.ProblemError, match="orthotropic friction needs a surface"):
        hv.discretize(replace(problem, contact={"area": over(hv.laws.OrthotropicFriction(1.0, ratio=2.0))}))
    said = hv.solve(problem).certify(exact=True).exact
    assert said is not None
    assert "'area' is over an area" in said.reasons[0]
    with pytest.raises(hv.errors.ProblemError, match="'area' is over an area"):
        solve_adaptive(problem, rtol=0.1)
