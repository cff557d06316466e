"""Initial stress and initial strain against closed forms, heat, and loads that do the same."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import hemivar as hv
from hemivar.errors import ProblemError
from tests.samples import slow

E, NU = 1000.0, 0.3
RINGS = (1.0, 1.5, 2.5)  # inner radius, radius of the joint, outer radius


def half(dim: int, plane: str = "strain", mesh: hv.Mesh | None = None, **stated: Any) -> hv.ContactProblem:
    """A quarter or an eighth of a block that moves freely."""
    if mesh is None:
        mesh = hv.rectangle((2.0, 1.0), (4, 2)) if dim == 2 else hv.box((2.0, 1.0, 1.0), (2, 1, 1))
    walls = ("left", "bottom", "front")[:dim]
    material = hv.Material.young(E, NU, plane=plane if dim == 2 else "strain")
    return hv.ContactProblem(mesh, material, supports=dict.fromkeys(walls, "roller"), **stated)


@pytest.mark.parametrize(("dim", "order"), [(2, 1), (2, 2), (3, 1), slow(3, 2)])
def test_a_free_body_relaxes_from_its_initial_stress(dim: int, order: int) -> None:
    stress = np.diag([3.0, -1.0, 2.0][:dim])
    solution = hv.solve(half(dim, "stress", initial_stress=stress, order=order))
    np.testing.assert_allclose(solution.stress(), 0.0, atol=1e-12)
    strain = -((1.0 + NU) * stress - NU * np.trace(stress) * np.eye(dim)) / E
    np.testing.assert_allclose(solution.strain(), np.broadcast_to(strain, solution.strain().shape), atol=1e-14)


@pytest.mark.parametrize(
    ("dim", "plane", "along", "mises"), [(2, "strain", 1.0 + NU, E), (2, "stress", 1.0, 0.0), (3, "strain", 1.0, 0.0)]
)
def test_a_free_body_expands(dim: int, plane: str, along: float, mises: float) -> None:
    """In plane strain the third direction cannot, and has the stress ``-E e``."""
    solution = hv.solve(half(dim, plane, initial_strain=1e-3))
    np.testing.assert_allclose(solution.stress(), 0.0, atol=1e-12)
    np.testing.assert_allclose(
        solution.strain(), 1e-3 * along * np.tile(np.eye(dim), (len(solution.strain()), 1, 1)), atol=1e-14
    )
    np.testing.assert_allclose(solution.von_mises(), 1e-3 * mises, atol=1e-12)


def test_a_body_that_cannot_move_keeps_its_initial_stress() -> None:
    mesh, stress = hv.rectangle((1.0, 1.0), 3), np.array([[2.0, 0.5], [0.5, -1.0]])
    supports = dict.fromkeys(mesh.boundaries, "clamped")
    solution = hv.solve(hv.ContactProblem(mesh, hv.Material.young(E, NU), supports=supports, initial_stress=stress))
    np.testing.assert_allclose(solution.stress(), np.broadcast_to(stress, (mesh.number_of_cells, 2, 2)), atol=1e-12)
    np.testing.assert_allclose(solution.displacement, 0.0, atol=1e-16)


def rings(cells: int, scale: float = 1.0) -> tuple[float, float]:
    """The radial displacement of the joint of two rings in axial plane strain, the inner one expanded; and Lame's."""
    a, b, c = (scale * radius for radius in RINGS)
    mesh = hv.rectangle((c - a, 0.25 * scale), (6 * cells, cells)).moved(np.eye(2), (a, 0.0))
    inner = mesh.points[mesh.cells].mean(axis=1)[:, 0] < b
    mesh = hv.Mesh(mesh.points, mesh.cells, mesh.boundaries, {"inner": np.flatnonzero(inner)})
    material, strain = hv.Material.young(E / scale**2, NU, plane="axisymmetric"), 1e-3
    supports = {"bottom": "roller", "top": "roller"}
    stated = hv.ContactProblem(mesh, material, supports=supports, initial_strain={"inner": strain})
    joint = np.abs(mesh.points[:, 0] - b) < 1e-9 * b
    return float(hv.solve(stated).displacement[joint, 0].mean()) / scale, lame(strain)


def lame(strain: float) -> float:
    """``u = A r + B / r`` in either ring; the radial stress is continuous, and zero at the inner and outer radius."""
    a, b, c = RINGS
    lam, mu = E * NU / ((1 + NU) * (1 - 2 * NU)), E / (2 * (1 + NU))
    taken = (3 * lam + 2 * mu) * strain  # by the expansion from the radial stress of the inner ring
    at_a, at_b, at_c = ([2.0 * (lam + mu), -2.0 * mu / r**2] for r in (a, b, c))
    rows = [[*at_a, 0.0, 0.0], [0.0, 0.0, *at_c], [b, 1.0 / b, -b, -1.0 / b], [*at_b, -at_b[0], -at_b[1]]]
    A, B = np.linalg.solve(np.array(rows), np.array([taken, 0.0, 0.0, taken]))[:2]
    return float(A * b + B / b)


def test_thermal_misfit_of_two_rings_is_that_of_lame() -> None:
    (coarse, exact), (fine, _) = rings(2), rings(4)
    assert abs(fine / exact - 1.0) < 2e-4
    assert 3.0 < (coarse - exact) / (fine - exact) < 5.0
    assert rings(2, 1000.0)[0] == pytest.approx(coarse, rel=1e-10)


def hoops(cells: int, strain: bool = False, scale: float = 1.0) -> float:
    """How far the hole of a tube opens under a stress, or a strain, that is there around the axis alone."""
    a, _, c = (scale * radius for radius in RINGS)
    mesh = hv.rectangle((c - a, 0.25 * scale), (6 * cells, cells)).moved(np.eye(2), (a, 0.0))
    material = hv.Material.young(E / scale**2, NU, plane="axisymmetric")
    around = np.diag([0.0, 0.0, 1.0])
    given: dict[str, Any] = {"initial_strain": 1e-3 * around} if strain else {"initial_stress": around / scale**2}
    stated = hv.ContactProblem(mesh, material, supports={"bottom": "roller", "top": "roller"}, **given)
    hole = np.abs(mesh.points[:, 0] - a) < 1e-9 * a
    return float(hv.solve(stated).displacement[hole, 0].mean()) / scale


def opened(stress: tuple[float, float]) -> float:
    """In closed form: ``(lam + 2 mu) (u'' + u'/r - u/r^2) = (s - p) / r`` for initial stresses p along the radius and s
    around the axis, so that ``u = A r + B / r + (s - p) r ln r / (2 (lam + 2 mu))``; both sides are free."""
    (p, s), (a, _, c) = stress, RINGS
    lam, mu = E * NU / ((1 + NU) * (1 - 2 * NU)), E / (2 * (1 + NU))
    k = (s - p) / (2.0 * (lam + 2.0 * mu))
    rows = [[2.0 * (lam + mu), -2.0 * mu / r**2] for r in (a, c)]
    free = [-p - k * ((lam + 2.0 * mu) * (np.log(r) + 1.0) + lam * np.log(r)) for r in (a, c)]
    A, B = np.linalg.solve(np.array(rows), np.array(free))
    return float(A * a + B / a + k * a * np.log(a))


def test_a_stress_around_the_axis_opens_a_tube_as_in_closed_form() -> None:
    lam, mu = E * NU / ((1 + NU) * (1 - 2 * NU)), E / (2 * (1 + NU))
    for strain, exact in ((False, opened((0.0, 1.0))), (True, opened((-1e-3 * lam, -1e-3 * (lam + 2.0 * mu))))):
        coarse, fine = hoops(1, strain), hoops(2, strain)
        assert abs(fine / exact - 1.0) < 2e-3
        assert 3.0 < (coarse - exact) / (fine - exact) < 5.0
    assert hoops(1, scale=1000.0) == pytest.approx(hoops(1), rel=1e-10)


def test_a_number_is_a_tensor_of_space_in_the_plane() -> None:
    for name in ("initial_stress", "initial_strain"):
        for plane in ("strain", "stress"):
            one: dict[str, Any] = {name: 1e-3}
            other: dict[str, Any] = {name: 1e-3 * np.eye(3)}
            number, tensor = hv.solve(half(2, plane, **one)), hv.solve(half(2, plane, **other))
            assert np.abs(number.displacement - tensor.displacement).max() <= 1e-14 * np.abs(number.displacement).max()
            np.testing.assert_allclose(number.von_mises(), tensor.von_mises(), rtol=1e-12, atol=1e-12)


def test_a_strain_across_the_plane_pushes_within_it() -> None:
    """In plane strain it is held, and pushes by ``lam e`` within the plane; a stress across the plane moves nothing."""
    lam = E * NU / ((1 + NU) * (1 - 2 * NU))
    across = hv.solve(half(2, initial_strain=np.diag([0.0, 0.0, 1e-3])))
    pushed = hv.solve(half(2, initial_stress=np.diag([-1e-3 * lam, -1e-3 * lam])))
    np.testing.assert_allclose(across.displacement, pushed.displacement, atol=1e-16)
    assert not hv.solve(half(2, initial_stress=np.diag([0.0, 0.0, 5.0]))).displacement.any()
    sheared = np.zeros((3, 3))
    sheared[0, 2] = sheared[2, 0] = 1.0
    with pytest.raises(ProblemError, match="initial_stress shears the body across its plane"):
        half(2, initial_stress=sheared)


@pytest.mark.parametrize(("dim", "order"), [(2, 1), (2, 2), (3, 1)])
def test_a_pore_pressure_is_a_force_in_the_body_and_one_on_its_skin(dim: int, order: int) -> None:
    """``-int s div v = int grad s . v - int s v_nu``, of a formula, a function and tensors alike."""
    slope = [0.7, -0.4, 0.2][:dim]
    text = "1.5 + 0.7*x - 0.4*y" + " + 0.2*z" * (dim == 3)
    mesh = half(dim).mesh
    loads: dict[str, Any] = {
        "body_force": slope, "tractions": {name: hv.Pressure(text) for name in mesh.boundaries}
    }  # fmt: skip
    expected = hv.solve(half(dim, order=order, **loads)).displacement
    tensor = [[text if i == k else 0.0 for i in range(dim)] for k in range(dim)]
    for stress in (text, lambda x: 1.5 + x @ np.array(slope), tensor):
        found = hv.solve(half(dim, order=order, initial_stress=stress)).displacement
        np.testing.assert_allclose(found, expected, atol=1e-10 * np.abs(expected).max())


def test_values_of_cells_are_those_of_a_region() -> None:
    mesh = half(2).mesh
    some = np.arange(0, mesh.number_of_cells, 3)
    marked = hv.Mesh(mesh.points, mesh.cells, mesh.boundaries, {"some": some})
    values = np.where(np.isin(np.arange(mesh.number_of_cells), some), -2.0, 0.0)
    wanted = hv.solve(half(2, mesh=marked, initial_stress={"some": -2.0})).displacement
    for stress in (values, values[:, None, None] * np.eye(2)):
        np.testing.assert_allclose(hv.solve(half(2, initial_stress=stress)).displacement, wanted, atol=1e-15)


def on_glue(**stated: Any) -> hv.ContactProblem:
    mesh = hv.rectangle((1.0, 0.5), (8, 4))
    contact = {"bottom": hv.Contact(hv.Compliance(400.0))}
    return hv.ContactProblem(mesh, hv.Material.young(E, NU), contact, {"left": "clamped"}, **stated)


def test_initial_strain_is_what_heat_does_in_time() -> None:
    """The temperature of a body all of whose boundary has it, by the coupled march; and the strain growing in time."""
    warm, expansion = 4.0, 2e-4
    names = hv.rectangle((1.0, 0.5), 1).boundaries
    heat = hv.mechanics.Heat(
        1.0, 1e-9, expansion=expansion, temperature=warm, supports=dict.fromkeys(names, warm)
    )  # fmt: skip
    pushed = {"tractions": {"top": (0.0, -5.0)}}
    march = hv.march(hv.Evolution(on_glue(**pushed), heat=heat), 1.0, step=1.0)
    still = hv.solve(on_glue(**pushed, initial_strain=expansion * warm))
    np.testing.assert_allclose(march.state.body.displacement, still.unknowns, atol=1e-8 * np.abs(still.unknowns).max())
    grown = hv.march(hv.Evolution(on_glue(**pushed, initial_strain=f"{expansion * warm}*t")), 1.0, step=1.0)
    np.testing.assert_allclose(grown.state.body.displacement, still.unknowns, atol=1e-8 * np.abs(still.unknowns).max())


@pytest.mark.parametrize(
    ("stated", "match"),
    [
        ({"initial_stress": [1.0, 2.0, 3.0]}, r"initial_stress has shape \(3,\); give a number, 2 rows of 2"),
        ({"initial_stress": [[1.0, 2.0], [0.0, 1.0]]}, "initial_stress is not symmetric"),
        ({"initial_stress": ["x", 1.0]}, "initial_stress"),
        ({"initial_stress": [["x", 1.0], ["x"]]}, "initial_stress"),
        ({"initial_strain": {"soil": 1.0}}, "names region 'soil', which the mesh does not have"),
        ({"initial_strain": np.nan}, "initial_strain: nan is not finite"),
        ({"initial_stress": 1.0, "stiffening": True}, "not with stiffening"),
    ],
)
def test_what_does_not_fit_is_refused(stated: dict[str, Any], match: str) -> None:
    with pytest.raises(ProblemError, match=match):
        half(2, **stated)


def test_what_is_not_available_says_so() -> None:
    hencky = hv.Material.hencky(bulk=800.0, shear=400.0, softened=0.25, strain=0.05)
    with pytest.raises(ProblemError, match="initial_strain is for linear materials"):
        replace(half(2, initial_strain=1e-3), material=hencky)
    matrix = hv.Material.tensor(np.diag([1.0, 1.0, 0.5]), out_of_plane=(0.3, 0.3, 0.0))
    with pytest.raises(ProblemError, match="give a tensor of the plane"):
        hv.solve(replace(half(2, initial_strain=1e-3), material=matrix))


def test_a_nonlinear_body_has_an_initial_stress() -> None:
    """The uniaxial stress that is left is zero: the strain is what the material answers to the opposite stress."""
    hencky = hv.Material.hencky(bulk=800.0, shear=400.0, softened=0.25, strain=0.05)
    stressed = hv.solve(replace(half(2, initial_stress=np.diag([-30.0, 0.0])), material=hencky))
    pulled = hv.solve(replace(half(2, tractions={"right": (30.0, 0.0)}), material=hencky))
    np.testing.assert_allclose(stressed.displacement, pulled.displacement, atol=1e-9)


def test_a_tensor_of_a_body_of_revolution_is_one_of_space() -> None:
    """A tensor of the half section would leave the hoop stress out."""
    stated = half(2, initial_stress=lambda x: np.zeros((len(x), 2, 2)))
    with pytest.raises(ProblemError, match="leaves out what acts around the axis; give 3 rows of 3"):
        hv.solve(replace(stated, material=hv.Material.young(E, NU, plane="axisymmetric")))


def test_an_array_that_changes_later_does_not_change_the_statement() -> None:
    stress = np.eye(2)
    stated = half(2, initial_stress=stress)
    stress[:] = 0.0
    np.testing.assert_array_equal(np.asarray(stated.initial_stress), np.eye(2))
