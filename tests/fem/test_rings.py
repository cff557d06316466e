"""Axial symmetry: closed forms of cylinders, press fits and a punch; integrals are those of the whole ring."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import hemivar as hv
from hemivar.fem.dynamics import body_family
from hemivar.fem.error_norms import error_norms

E, NU = 200.0, 0.3


def steel(nu: float = NU) -> hv.Material:
    return hv.Material.young(E, nu, plane="axisymmetric")


def shaken_mesh(mesh: hv.Mesh) -> hv.Mesh:
    points = mesh.points.copy()
    low, high = points.min(axis=0), points.max(axis=0)
    inner = ((points > low + 1e-9) & (points < high - 1e-9)).all(axis=1)
    points[inner] += 0.04 * np.random.default_rng(1).standard_normal((inner.sum(), 2))
    return hv.Mesh(points, mesh.cells, mesh.boundaries, mesh.regions)


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("nu", [0.3, 0.49])
def test_a_cylinder_under_pressure_has_its_uniform_stress(nu: float, order: int) -> None:
    """u_r = c r, u_z = d z (Lame); it stands on a plane, and nothing else holds it."""
    around, above = 0.5, 1.2
    problem = hv.ContactProblem(
        shaken_mesh(hv.rectangle((1.0, 2.0), (5, 4))),
        steel(nu),
        {"bottom": hv.Contact(hv.Signorini())},
        {},
        tractions={"right": (-around, 0.0), "top": hv.Pressure(above)},
        order=order,
    )
    solution = hv.solve(problem)
    c, d = (nu * (around + above) - around) / E, (2.0 * nu * around - above) / E
    assert solution.problem.field is not None
    exact = solution.problem.field.nodes * [c, d]
    np.testing.assert_allclose(solution.displacement, exact, atol=1e-12 * np.abs(exact).max())
    np.testing.assert_allclose(solution.pressure, above, rtol=1e-11)
    assert solution.normal_force == pytest.approx(above * np.pi, rel=1e-12)
    assert solution.measured == "area"
    stress = solution.stress()
    np.testing.assert_allclose(stress[:, 0, 0], -around, rtol=1e-10)
    np.testing.assert_allclose(stress[:, 1, 1], -above, rtol=1e-10)
    np.testing.assert_allclose(solution.von_mises(), above - around, rtol=1e-10)
    # the work of the loads is that on the whole body
    assert solution.energy == pytest.approx(0.5 * np.pi * 2.0 * (2.0 * around * c + above * d), rel=1e-11)
    norms = error_norms(problem, exact)
    assert norms.energy**2 == pytest.approx(-2.0 * solution.energy, rel=1e-11)


def rings(n: int) -> hv.Mesh:
    height = 0.5
    return hv.Mesh.assembled(
        {
            "inner": hv.rectangle((10.0, height), (n, 1), origin=(10.0, 0.0)),
            "outer": hv.rectangle((10.0, height), (n + n // 4, 2), origin=(20.0, 0.0)),
        }
    )


@pytest.mark.parametrize(
    ("free", "pressure"), [(False, 54.08653846), (True, 49.21875)], ids=["plane strain", "plane stress"]
)
@pytest.mark.parametrize("slave", ["inner:right", "outer:left"])
def test_a_press_fit_of_two_rings(slave: str, free: bool, pressure: float) -> None:
    """Lame's rings 10, 20, 30 with an interference of .02, between rigid plates and with free ends."""
    held = ("inner:bottom", "outer:bottom") if free else ("inner:bottom", "outer:bottom", "inner:top", "outer:top")
    errors = []
    for n in (8, 16, 32):
        contact = {"inner:right": hv.Contact(hv.Signorini(), gap=-0.02, against="outer:left", slave=slave)}
        material = hv.Material.young(210000.0, 0.3, plane="axisymmetric")
        problem = hv.ContactProblem(rings(n), material, contact, {name: hv.Roller() for name in held})
        found = hv.solve(problem)
        mean = found.normal_force / (2.0 * np.pi * 20.0 * 0.5)
        errors.append(abs(mean / pressure - 1.0))
    assert errors[2] < 1e-4
    assert errors[2] < 0.3 * errors[1] < 0.09 * errors[0] * 1.1


def punch_force(size: float, cells: int) -> tuple[float, float]:
    """Force of a flat punch of radius 1 on a block of radius and height ``size``, and its pressure in the middle."""
    under = np.sin(0.5 * np.pi * np.linspace(0.0, 1.0, cells + 1))  # finer towards the edge
    grid = np.concatenate([under, 1.0 + (size - 1.0) * np.linspace(0.0, 1.0, 2 * cells + 1)[1:] ** 5])
    n = len(grid) - 1
    square = hv.rectangle((1.0, 1.0), (n, n))
    index = np.rint(square.points * n).astype(int)
    down = np.concatenate([[0.0], size * np.linspace(0.0, 1.0, n + 1)[1:] ** 4])
    points = np.column_stack([grid[index[:, 0]], -down[::-1][index[:, 1]]])
    block = hv.Mesh(points, square.cells).with_boundaries(
        {
            "under": lambda p: (p[:, 1] > -1e-9) & (p[:, 0] < 1.0 + 1e-9),
            "bottom": lambda p: p[:, 1] < -size + 1e-9,
            "right": lambda p: p[:, 0] > size - 1e-9,
        }
    )
    star = 4.395604396 / (2.0 * 1.0 * 0.01)
    material = hv.Material.young(star * (1.0 - NU**2), NU, plane="axisymmetric")
    contact = {"under": hv.Contact(hv.laws.Bilateral(), gap=-0.01)}
    found = hv.solve(hv.ContactProblem(block, material, contact, {"bottom": hv.Roller(), "right": hv.Roller()}))
    near = found.contact.points[:, 0] < 0.3
    weights = found.contact.weights[near]
    # mean of E* d / (pi sqrt(1 - r^2)) over a disc of radius R: (1 - sqrt(1 - R^2)) 2 / R^2 times that in the middle
    disc = float(np.sqrt(weights.sum() / np.pi))
    share = 2.0 * (1.0 - np.sqrt(1.0 - disc**2)) / disc**2
    return found.normal_force, float(weights @ found.pressure[near] / weights.sum()) / share


def test_a_flat_punch_on_a_half_space() -> None:
    """Force 2 E* a d and pressure E* d / (pi a) in the middle (Sneddon), as the block grows."""
    small, _ = punch_force(16.0, 24)
    force, middle = punch_force(64.0, 36)
    assert 0.0 < force - 4.395604396 < 0.35 * (small - 4.395604396)
    assert force == pytest.approx(4.395604396, rel=0.03)
    assert middle / force == pytest.approx(0.6995821674 / 4.395604396, rel=0.02)


def test_masses_and_loads_are_those_of_the_whole_ring() -> None:
    material = hv.Material.young(E, NU, plane="axisymmetric", density=3.0)
    mesh = hv.rectangle((1.0, 2.0), (3, 4), origin=(0.5, 0.0))
    for order in (1, 2):
        problem = hv.ContactProblem(
            mesh, material, {"bottom": hv.Contact(hv.Compliance(5.0))}, {}, body_force=(0.0, -1.0), order=order
        )
        volume = np.pi * (1.5**2 - 0.5**2) * 2.0
        family = body_family(problem, with_mass=True)
        assert family.mass is not None
        discrete = hv.discretize(problem)
        assert discrete.field is not None
        up = discrete.field.restrict(np.tile([0.0, 1.0], (len(discrete.field.nodes), 1)))
        assert up @ (family.combined(0.0, 1.0) @ up - discrete.stiffness @ up) == pytest.approx(3.0 * volume, rel=1e-12)
        assert up @ discrete.load == pytest.approx(-volume, rel=1e-12)
        assert discrete.contact.weights.sum() == pytest.approx(np.pi * (1.5**2 - 0.5**2), rel=1e-12)
        assert np.abs(discrete.stiffness @ up).max() < 1e-11 * E


def test_reactions_balance_the_loads() -> None:
    problem = hv.ContactProblem(
        shaken_mesh(hv.rectangle((1.0, 2.0), (5, 4))),
        steel(),
        {"right": hv.Contact(hv.Compliance(20.0), hv.Tresca(0.1), gap=-0.001)},
        {"bottom": hv.Clamped()},
        tractions={"top": (0.1, -1.0)},
    )
    found = hv.solve(problem)
    rubbed = found.contact.weights @ (found.multiplier[:, 1] * found.contact.frames[:, 1, 1])
    assert found.reactions["bottom"][1] - rubbed == pytest.approx(np.pi, rel=1e-9)


def quarter(n: int) -> hv.Mesh:
    """A quarter of the ring 1 < r < 2, 0 < z < 1 in space."""
    box = hv.box((1.0, 1.0, 1.0), (n, 2 * n, 2))
    r, angle = 1.0 + box.points[:, 0], 0.5 * np.pi * box.points[:, 1]
    return hv.Mesh(np.column_stack([r * np.cos(angle), r * np.sin(angle), box.points[:, 2]]), box.cells, box.boundaries)


def test_a_quarter_in_space_has_the_same_forces() -> None:
    """A ring on a compliant shaft, shrunk from outside: the difference falls with the square of the mesh size."""
    shaft = hv.Contact(hv.Compliance(60.0))
    flat = hv.rectangle((1.0, 1.0), (64, 2), origin=(1.0, 0.0))
    rollers = {"top": hv.Roller(), "bottom": hv.Roller()}
    ring = hv.solve(
        hv.ContactProblem(flat, steel(), {"left": shaft}, rollers, tractions={"right": hv.Pressure(3.0)})
    ).normal_force
    differences = []
    for n in (4, 8):
        held = {name: hv.Roller() for name in ("top", "bottom", "front", "back")}
        mesh = quarter(n)
        problem = hv.ContactProblem(
            mesh, hv.Material.young(E, NU), {"left": shaft}, held, tractions={"right": hv.Pressure(3.0)}
        )
        differences.append(abs(4.0 * hv.solve(problem).normal_force / ring - 1.0))
    assert differences[1] < 0.01
    assert differences[1] < 0.35 * differences[0]


def test_a_march_with_inertia_keeps_its_energy() -> None:
    """A cylinder that falls on a compliant plane and swings."""
    material = hv.Material.young(E, NU, plane="axisymmetric", density=1.0)
    problem = hv.ContactProblem(
        hv.rectangle((1.0, 1.0), (4, 4)),
        material,
        {"bottom": hv.Contact(hv.Compliance(50.0))},
        {},
        body_force=(0.0, -1.0),
    )
    history = hv.march(hv.Evolution(problem, inertia=True), 1.0, step=0.01)
    assert history.ended == "finished"
    assert abs(history.ledger["gap"]) < 1e-9 * max(map(abs, history.ledger.values()))


def test_methods_agree_on_a_sphere() -> None:
    problem = hv.ContactProblem(
        hv.rectangle((1.0, 1.0), (4, 4)).refined(2),
        steel(),
        {"bottom": hv.Contact(hv.Signorini(), hv.Tresca(0.05), gap=lambda x: 0.01 * x[:, 0] ** 2)},
        {"top": hv.Prescribed((0.0, -0.02))},
    )
    one = hv.solve(problem)
    other = hv.solve(problem, hv.solvers.NonsmoothMultigrid())
    np.testing.assert_allclose(one.unknowns, other.unknowns, atol=1e-8 * np.abs(one.unknowns).max())
    assert hv.certify(one).unique


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"mesh": hv.rectangle((1.0, 1.0), (2, 2), origin=(-0.5, 0.0))}, "x >= 0"),
        ({"mesh": hv.box((1.0, 1.0, 1.0), (1, 1, 1))}, "plane meshes"),
        ({"quadrature": hv.mechanics.Quadrature.MIDPOINT}, "Quadrature.NODAL"),
    ],
)
def test_what_is_no_half_section_is_told(change: dict[str, object], words: str) -> None:
    problem = hv.ContactProblem(
        hv.rectangle((1.0, 1.0), (2, 2)), steel(), {"bottom": hv.Contact(hv.Signorini())}, {"top": hv.Clamped()}
    )
    with pytest.raises(hv.errors.ProblemError, match=words):
        replace(problem, **change)  # type: ignore[arg-type]


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("r", [0.0, -1e-12, 1e-12])
def test_contact_on_the_axis_is_told_whatever_rounding_made_of_its_radius(r: float, order: int) -> None:
    mesh = hv.rectangle((1.0, 1.0), (2, 2), origin=(r, 0.0))
    contact = {"left": hv.Contact(hv.Compliance(20.0))}
    problem = hv.ContactProblem(mesh, steel(), contact, {"bottom": hv.Clamped()}, order=order)
    with pytest.raises(hv.errors.ProblemError, match="'left' lies on the axis"):
        hv.discretize(problem)


@pytest.mark.parametrize("r", [0.0, -1e-13, 1e-13])
@pytest.mark.parametrize("slave", ["up:bottom", "lo:top"])
def test_quadratic_bodies_touch_up_to_the_axis(slave: str, r: float) -> None:
    """The corner there has no weight, and is left out; beside it linear elements on a finer mesh press alike."""
    found = []
    for order, n in ((2, 8), (1, 24)):
        upper = hv.rectangle((2.0, 1.0), (n, n // 2), origin=(r, 1.0))
        mesh = hv.Mesh.assembled({"up": upper, "lo": hv.rectangle((4.0, 1.0), (13 * n // 8, n // 2), origin=(r, 0.0))})
        contact = {"up:bottom": hv.Contact(hv.Signorini(), against="lo:top", slave=slave)}
        solution = hv.solve(
            hv.ContactProblem(
                mesh,
                steel(),
                contact,
                {"lo:bottom": hv.Fixed(y=0.0)},
                tractions={"up:top": hv.Pressure(1.0)},
                order=order,
            )
        )
        assert solution.normal_force == pytest.approx(4.0 * np.pi, rel=1e-9)
        points = solution.problem.contact.points
        assert points is not None
        assert (points[:, 0].min() > 1e-9) == (order == 2)
        near = np.argsort(points[:, 0])
        near = near[points[near, 0] > 1e-9]  # linear elements have a peak on the axis
        found.append(np.interp([0.16, 0.3, 0.45], points[near, 0], solution.pressure[near]))
    np.testing.assert_allclose(found[0], found[1], rtol=0.01)


@pytest.mark.parametrize("order", [1, 2])
def test_the_distance_of_spheres_is_that_of_their_arcs(order: int) -> None:
    """Shells about one point, whose nodes do not match; one of them ends on the axis."""
    parts = {}
    for name, (a, b), n in (("in", (1.0, 2.0), 21), ("out", (2.0 + 1e-3, 3.0), 16)):
        flat = hv.rectangle((b - a, 0.5 * np.pi), (2, n))
        r, t = a + flat.points[:, 0], flat.points[:, 1]
        points = np.column_stack([r * np.cos(t), r * np.sin(t)])
        parts[name] = hv.Mesh(np.where(np.abs(points) < 1e-15, 0.0, points), flat.cells, flat.boundaries)
    contact = {"in:right": hv.Contact(hv.Signorini(), against="out:left")}
    held = {"in:bottom": hv.Roller(), "out:bottom": hv.Roller()}
    problem = hv.ContactProblem(hv.Mesh.assembled(parts), steel(), contact, held, order=order)
    np.testing.assert_allclose(hv.discretize(problem).offset[:, 0], 1e-3, atol=1e-5)
    meshed = hv.discretize(replace(problem, geometry="as-meshed"))  # type: ignore[arg-type]
    assert np.abs(meshed.offset[:, 0] - 1e-3).max() > 1e-3


@pytest.mark.parametrize("order", [1, 2])
def test_the_axis_stays_where_it_is_and_its_normal_is_along_it(order: int) -> None:
    """A cone stands on its blunt tip: beside the axis its side is oblique, and so would a mean of one side be."""
    flat = hv.rectangle((1.0, 1.0), (4, 4))
    cone = hv.Mesh(flat.points + flat.points[:, :1] * [0.0, 0.3], flat.cells, flat.boundaries)
    contact = {"bottom": hv.Contact(hv.Compliance(50.0))}
    push = {"top": (0.2, -1.0)}
    found = hv.solve(hv.ContactProblem(cone, steel(), contact, {}, tractions=push, order=order))
    assert found.problem.field is not None
    axis = found.problem.field.nodes[:, 0] == 0.0
    assert axis.sum() == 4 * order + 1
    assert (found.displacement[axis, 0] == 0.0).all()
    assert found.contact.points is not None
    assert found.contact.frames is not None
    tip = found.contact.points[:, 0] == 0.0
    assert tip.sum() == (order == 1)  # the corner of a quadratic facet has no weight there
    assert (found.contact.frames[tip, 0] == [0.0, -1.0]).all()
