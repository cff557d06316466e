"""Largest strain and rotation, and what is said where they are not small."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import hemivar as hv
from hemivar import cli
from hemivar.basics.types import Array
from hemivar.evolution import march
from hemivar.fem import LoadLine, deformation
from hemivar.fem.small_strain import SMALL
from hemivar.mesh.mesh import Mesh
from hemivar.report import plot_contact, plot_solution
from hemivar.report.path_diagrams import path_record
from tests import bodies
from tests.report.test_figures import texts


def field(mesh: Mesh, order: int, gradient: Array) -> Array:
    return np.asarray(mesh.nodes(order) @ gradient.T + 0.3)


def meshes(dim: int) -> Mesh:
    return hv.rectangle((2.0, 1.0), (4, 3)) if dim == 2 else hv.box((2.0, 1.0, 1.0), (2, 2, 1))


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("dim", [2, 3])
def test_of_uniform_gradients(dim: int, order: int) -> None:
    rng = np.random.default_rng(dim + order)
    for size in (1e-6, 0.02, 0.2):
        gradient = size * rng.standard_normal((dim, dim))
        found = deformation(meshes(dim), field(meshes(dim), order, gradient))
        assert found.strain == pytest.approx(np.abs(np.linalg.eigvalsh(0.5 * (gradient + gradient.T))).max())
        skew = 0.5 * (gradient - gradient.T)
        assert found.rotation == pytest.approx(np.abs(np.linalg.eigvals(skew)).max())
        assert found.whole == pytest.approx(2.0)
        assert found.volume == pytest.approx(2.0 if found.large else 0.0)


def test_a_small_turn_is_an_angle() -> None:
    for angle in (1e-3, 0.099, 0.101):
        mesh = meshes(3)
        axis = np.array([1.0, -2.0, 2.0]) / 3.0
        turn = np.cross(np.eye(3), axis) * angle
        np.testing.assert_allclose(turn, Rotation.from_rotvec(angle * axis).as_matrix() - np.eye(3), atol=angle**2)
        found = deformation(mesh, field(mesh, 1, turn))
        assert found.rotation == pytest.approx(angle)
        assert found.strain < 1e-12
        assert found.large == (angle > SMALL)


def test_quadratic_elements_have_their_largest_strain_at_a_corner() -> None:
    """u_x = a x^2/2 on (0, 2): strain a x, 2 a at most, and SMALL beyond x = SMALL/a."""
    mesh = hv.rectangle((2.0, 1.0), (20, 4))
    x = mesh.nodes(2)[:, 0]
    found = deformation(mesh, np.column_stack([0.5 * 0.06 * x**2, 0.0 * x]))
    assert found.strain == pytest.approx(0.12)
    assert found.volume == pytest.approx(2.0 - 1.6, abs=0.11)  # cells that begin before x = 5/3 and end beyond it
    assert found.large


def test_the_part_beyond_is_the_same_whichever_corner_comes_first() -> None:
    mesh = hv.rectangle((2.0, 1.0), (5, 2))
    found = []
    for first in range(3):
        turned = Mesh(mesh.points, np.roll(mesh.cells, first, axis=1))
        x = turned.nodes(2)[:, 0]
        found.append(deformation(turned, np.column_stack([0.5 * 0.06 * x**2, 0.0 * x])).volume)
    assert found == pytest.approx([0.4] * 3)  # the last cells, which end beyond x = 5/3


def test_the_largest_of_many_in_space() -> None:
    """Brute force over all cells of a rough field."""
    mesh = hv.box((1.0, 1.0, 1.0), 4)
    for size in (1e-4, 0.01, 0.03):
        u = size * np.random.default_rng(3).standard_normal(mesh.points.shape)
        gradients = []
        for cell in mesh.cells:
            edges = mesh.points[cell[1:]] - mesh.points[cell[0]]
            gradients.append(np.linalg.solve(edges, u[cell[1:]] - u[cell[0]]).T)
        strains = [np.abs(np.linalg.eigvalsh(0.5 * (g + g.T))).max() for g in gradients]
        turns = [np.abs(np.linalg.eigvals(0.5 * (g - g.T))).max() for g in gradients]
        found = deformation(mesh, u)
        assert found.strain == pytest.approx(max(strains))
        assert found.rotation == pytest.approx(max(turns))
        beyond = (np.array(strains) >= SMALL) | (np.array(turns) >= SMALL)
        assert found.volume == pytest.approx(mesh.volumes[beyond].sum())


def shelf(load: float, **changes: object) -> hv.ContactProblem:
    stated: dict[str, object] = {
        "supports": {"left": hv.Clamped()},
        "contact": {"bottom": hv.Contact(hv.Compliance(0.01))},
        "body_force": (0.0, -load),
    }
    return hv.ContactProblem(hv.rectangle((4.0, 0.5), (16, 2)), hv.Material.lame(40.0, 40.0), **(stated | changes))  # type: ignore[arg-type]


def test_a_soft_shelf_warns_and_a_stiff_one_does_not(tmp_path: Path) -> None:
    soft, stiff = hv.solve(shelf(1.0)).raise_for_status(), hv.solve(shelf(1e-4)).raise_for_status()
    assert soft.deformation is not None
    assert soft.deformation.rotation > 0.3
    (warning,) = soft.warnings
    assert warning.startswith("beyond small strains")
    squeezed = deformation(meshes(2), field(meshes(2), 1, np.diag([0.0, -0.2]))).warning
    assert squeezed is not None
    assert "strain 20 %, rotation 0 rad, above 10 % in 100 % of the body" in squeezed
    assert soft.certify().warnings == (warning,)
    assert not stiff.warnings
    assert not stiff.certify().warnings
    record = json.loads(soft.to_json(tmp_path / "r.json").read_text(encoding="utf-8"))
    assert record["warnings"] == [warning]
    assert record["deformation"] == {
        "strain": soft.deformation.strain, "rotation": soft.deformation.rotation, "large": True,
    }  # fmt: skip
    assert not json.loads(stiff.to_json(tmp_path / "s.json").read_text(encoding="utf-8"))["deformation"]["large"]
    for draw in (plot_solution, plot_contact):
        assert "beyond small strains" in texts(draw(soft))
        assert "beyond small strains" not in texts(draw(stiff))
    assert warning in repr(soft)


def test_the_command_says_so(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = """
        [mesh]
        rectangle = [4.0, 0.5]
        cells = [16, 2]
        [material]
        lame = [40.0, 40.0]
        density = 0.01
        [loads]
        body = [0.0, "-1*min(1, t)"]
        [supports]
        left = "clamped"
        [contact.bottom]
        normal = { law = "compliance", stiffness = 0.01 }
        [time]
        until = 1.0
        step = 0.1
    """
    moving, still = tmp_path / "moving.toml", tmp_path / "still.toml"
    moving.write_text(text, encoding="utf-8")
    still.write_text(text.replace('"-1*min(1, t)"', "-1.0").partition("[time]")[0], encoding="utf-8")
    assert cli.main(["solve", str(still), "-q"]) == 0
    shown = capsys.readouterr().out
    assert shown.count("beyond small strains") == 1
    assert "largest           strain " in shown
    record, other = tmp_path / "path.json", tmp_path / "march.json"
    assert cli.main(["path", str(still), "--json", str(record)]) == 0
    assert capsys.readouterr().out.count("at load factor 1 beyond small strains") == 1
    (warning,) = json.loads(record.read_text(encoding="utf-8"))["warnings"]
    assert "beyond small strains" in warning
    assert cli.main(["solutions", str(still), "--starts", "2"]) == 0
    assert "solution 1: beyond small strains" in capsys.readouterr().out
    assert cli.main(["march", str(moving), "--json", str(other), "-q"]) == 0
    assert capsys.readouterr().out.count("beyond small strains") == 1
    (message,) = json.loads(other.read_text(encoding="utf-8"))["messages"]
    assert message.startswith("beyond small strains from t = ")


def test_a_march_names_the_time() -> None:
    """The top moves by t on height 1, so that the strain is t; 10 % is exceeded at the step after t = 0.09."""
    problem = bodies.square(
        cells=2,
        lame=(0.0, 1.0),
        supports={"top": hv.Fixed(y=lambda x, t: np.full(len(x), t)), "left": hv.Roller(), "bottom": hv.Roller()},
    )
    history = march(hv.Evolution(problem, inertia=False), until=0.3, step=0.03)
    (message,) = history.messages
    assert message.startswith("beyond small strains from t = 0.12 on: largest strain 12 %, rotation ")
    assert "strain 30 %" in message
    assert "at t = 0.3;" in message
    assert not march(hv.Evolution(problem, inertia=False), until=0.09, step=0.03).messages


@pytest.mark.parametrize("named", [True, False])
@pytest.mark.parametrize("prescribed", [True, False])
def test_paths(prescribed: bool, named: bool) -> None:
    """Where supports move, too, half of the load is half of the strain; the foundation hardly matters."""
    changes: dict[str, object] = {}
    if prescribed:
        changes = {"supports": {"left": hv.Clamped(), "right": hv.Fixed(y=-0.3)}, "body_force": (0.0, 0.0)}
    line = LoadLine.of(shelf(0.1, **changes))

    def followed(*ends: float) -> hv.branches.Path:
        return hv.follow_path(line.loaded, ends or (0.0, 1.0), unloaded=line.unloaded if named else None)  # type: ignore[arg-type]

    path, whole = followed(), hv.solve(line.loaded).raise_for_status()
    assert whole.deformation is not None
    assert whole.deformation.large
    (warning,) = path.warnings
    assert warning == f"at load factor 1 {whole.deformation.warning}"
    assert path_record(path)["warnings"] == [warning]
    part = SMALL / max(whole.deformation.strain, whole.deformation.rotation)
    assert not followed(0.0, 0.95 * part).warnings
    assert followed(0.0, 1.02 * part).warnings


def test_what_has_no_strain() -> None:
    membrane = hv.ScalarProblem(hv.rectangle((1.0, 1.0), 4), 1.0, supports={"left": 0.0}, source=5.0)
    assert hv.solve(membrane).deformation is None
    assert not hv.solve(membrane).warnings
