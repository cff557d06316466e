"""What is written can be read, and says the same."""

import csv
import json
from dataclasses import replace
from pathlib import Path

import meshio
import numpy as np
import pytest

from hemivar.errors import ProblemError
from hemivar.fem import discretize, von_mises
from hemivar.files import read_solution, solution_record, write_csv, write_json, write_vtu
from hemivar.files.boundary import contact_boundaries
from hemivar.files.record import laid_out, read_json
from hemivar.gallery import beam, survey_cube
from hemivar.laws import Compliance, Signorini
from hemivar.mechanics import Clamped, Contact, ContactProblem, Material, Quadrature, Sphere
from hemivar.mesh import rectangle
from hemivar.solvers import Solution, solve
from tests import bodies


def test_json_holds_the_solution(plane: Solution, tmp_path: Path) -> None:
    record = read_json(write_json(plane, tmp_path / "folder" / "solution.json"))
    assert record == solution_record(plane)
    assert record["status"] == "converged"
    assert record["unknowns"] == plane.problem.unknowns
    assert record["energy"] == plane.energy
    assert record["history"][-1]["residual"] == plane.history[-1].residual
    contact = record["contact"]
    assert set(contact["boundary"]) == {"bottom"}
    assert np.array_equal(contact["x"], plane.problem.contact.points)
    assert np.array_equal(contact["normal"], np.tile([0.0, -1.0], (16, 1)))
    assert contact["pressure"] == plane.pressure.tolist()
    assert contact["friction"] == plane.friction[:, 0].tolist()
    assert set(contact["tangential_state"]) == {"stick", "slip"}
    assert sum(
        w for w, s in zip(contact["weight"], contact["normal_state"], strict=True) if s != "open"
    ) == pytest.approx(record["contact_length"])


def test_arrays_of_a_large_solution_stand_beside_its_json(plane: Solution, tmp_path: Path) -> None:
    path, beside = tmp_path / "solution.json", tmp_path / "solution.npz"
    plane.to_json(path, arrays=beside)
    told = json.loads(path.read_text())
    assert told["arrays"] == "solution.npz"
    assert "displacement" not in told
    assert "pressure" not in told["contact"]
    plain = solution_record(plane)
    with np.load(beside) as arrays:
        assert np.array_equal(arrays["displacement"], plane.displacement)
        assert np.array_equal(arrays["contact.pressure"], plane.pressure)
    record = read_json(path)
    assert record.keys() == plain.keys() | {"arrays"}
    assert record["contact"].keys() == plain["contact"].keys()
    assert all(np.array_equal(one, plain["contact"][key]) for key, one in record["contact"].items())
    unknowns, multiplier = read_solution(path, plane.problem)
    np.testing.assert_allclose(unknowns, plane.unknowns, atol=1e-15)
    assert multiplier is not None
    assert np.array_equal(multiplier, plane.multiplier)


def test_arrays_beside_a_json_that_are_wrong_are_refused(plane: Solution, tmp_path: Path) -> None:
    path, beside = tmp_path / "solution.json", tmp_path / "solution.npz"
    with pytest.raises(ProblemError, match="must be in the folder of"):
        write_json(plane, path, arrays=tmp_path / "other" / "solution.npz")
    write_json(plane, path, arrays=beside)
    whole = beside.read_bytes()
    beside.write_bytes(whole[:-200])
    with pytest.raises(ProblemError, match="holds no arrays of a result"):
        read_json(path)
    number = whole.index(plane.displacement[plane.displacement != 0.0][:1].tobytes())
    beside.write_bytes(whole[:number] + bytes(8) + whole[number + 8 :])
    with pytest.raises(ProblemError, match="write"):
        read_json(path)
    beside.unlink()
    with pytest.raises(ProblemError, match=r"solution\.npz"):
        read_json(path)
    path.write_text(path.read_text().replace('"solution.npz"', '"../solution.npz"'))
    with pytest.raises(ProblemError, match="another folder"):
        read_json(path)


def test_the_force_of_the_foundation_balances_the_rest(plane: Solution) -> None:
    """Load, foundation and clamped edge are in equilibrium; the foundation pushes up and holds back the slip."""
    force = solution_record(plane)["resultants"]["force"]
    assert force[1] == pytest.approx(plane.normal_force)
    assert force[0] == pytest.approx(plane.friction_force[0])
    assert force[0] < 0.0 < plane.slip.max()


def test_numbers_that_are_not_finite_become_null(plane: Solution, tmp_path: Path) -> None:
    broken = replace(plane, multiplier=np.full_like(plane.multiplier, np.nan), error_bound=np.inf)
    text = write_json(broken, tmp_path / "broken.json").read_text()
    record = json.loads(text, parse_constant=lambda name: pytest.fail(f"{name} in a JSON file"))
    assert record["error_bound"] is None
    assert record["contact"]["pressure"] == [None] * 16


def test_solid_has_vectors(solid: Solution) -> None:
    contact = solution_record(solid)["contact"]
    assert np.shape(contact["friction"]) == np.shape(contact["slip"]) == (6, 2)
    force = np.array(solution_record(solid)["resultants"]["force"])
    lower = (
        -1.0
        * solid.problem.contact.weights[:, None]
        * np.einsum("mc,mcd->md", solid.multiplier, solid.problem.contact.frames)
    )
    np.testing.assert_allclose(force, lower.sum(axis=0), rtol=1e-12)
    assert force[2] == pytest.approx(solid.normal_force, rel=1e-12)


def test_problem_of_arrays(bar: Solution, tmp_path: Path) -> None:
    record = read_json(write_json(bar, tmp_path / "bar.json"))
    assert record["contact"]["boundary"] is None
    assert record["contact"]["slip"] is None
    assert record["resultants"]["force"] is None
    head = write_csv(bar, tmp_path / "bar.csv").read_text().splitlines()[0]
    assert head == "x,weight,gap,penetration,pressure,normal_state,tangential_state"
    with pytest.raises(ProblemError, match="no mesh"):
        write_vtu(bar, tmp_path / "bar.vtu")


def test_unreadable_records(tmp_path: Path) -> None:
    with pytest.raises(ProblemError, match="cannot read result file"):
        read_json(tmp_path / "missing.json")
    for name, text in (("text.json", "not json"), ("list.json", "[1]")):
        (tmp_path / name).write_text(text)
        with pytest.raises(ProblemError, match="write_json"):
            read_json(tmp_path / name)


def test_suffix_is_checked(plane: Solution, tmp_path: Path) -> None:
    for write in (write_json, write_csv, write_vtu):
        with pytest.raises(ProblemError, match="must end in"):
            write(plane, tmp_path / "solution.txt")


def test_csv_has_a_line_for_each_contact_point(solid: Solution, tmp_path: Path) -> None:
    with write_csv(solid, tmp_path / "contact.csv").open() as stream:
        rows = list(csv.DictReader(stream))
    assert len(rows) == 6
    assert [float(row["friction_2"]) for row in rows] == solid.friction[:, 1].tolist()
    assert {row["boundary"] for row in rows} == {"bottom"}


def test_vtu_can_be_read(body: Solution, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    solution = body
    path, contact = write_vtu(solution, tmp_path / "solution.vtu")
    assert capfd.readouterr() == ("", "")
    field = solution.problem.field
    grid, skin = meshio.read(path), meshio.read(contact)
    assert np.allclose(grid.points[:, : field.mesh.dim], field.nodes, atol=1e-15)
    (block,) = grid.cells
    assert block.type == {(2, 1): "triangle", (2, 2): "triangle6", (3, 1): "tetra"}[field.mesh.dim, field.order]
    assert np.array_equal(grid.point_data["displacement"][:, : field.mesh.dim], solution.displacement)
    assert np.allclose(grid.cell_data["von_mises"][0], von_mises(solution.problem.origin, solution.displacement))
    stress = grid.cell_data["stress"][0]
    xx, yy, zz, xy, yz, xz = stress.T
    mises = np.sqrt(0.5 * ((xx - yy) ** 2 + (yy - zz) ** 2 + (zz - xx) ** 2) + 3.0 * (xy**2 + yz**2 + xz**2))
    assert np.allclose(mises, grid.cell_data["von_mises"][0])
    (facets,) = skin.cells
    assert facets.type == {(2, 1): "line", (2, 2): "line3", (3, 1): "triangle"}[field.mesh.dim, field.order]
    assert len(facets.data) == len(field.mesh.boundaries["bottom"])
    assert skin.point_data["pressure"].max() <= solution.pressure.max() * (1 + 1e-12)
    assert skin.point_data["pressure"].max() == grid.point_data["pressure"].max()
    off = grid.point_data["state"] == -1
    assert off.sum() >= len(grid.points) - len(skin.points)
    assert not grid.point_data["contact_force"][off].any()


def test_vtu_at_the_contact_nodes(plane: Solution, tmp_path: Path) -> None:
    body, _ = write_vtu(plane, tmp_path / "solution.vtu")
    grid = meshio.read(body)
    points = plane.problem.contact.points
    nodes = [int(np.argmin(np.linalg.norm(grid.points[:, :2] - x, axis=1))) for x in points]
    assert np.array_equal(grid.point_data["pressure"][nodes], plane.pressure)
    assert np.array_equal(grid.point_data["state"][nodes], plane.tangential_state)  # all in contact
    assert np.array_equal(grid.point_data["tangential_state"][nodes], plane.tangential_state)
    assert np.array_equal(grid.point_data["friction"][nodes, 0], plane.friction[:, 0])
    assert np.array_equal(grid.point_data["contact_force"][nodes, 1], plane.pressure)
    assert np.count_nonzero(grid.point_data["state"] >= 0) == 16


def test_the_gap_is_the_distance_to_the_obstacle(tmp_path: Path) -> None:
    centre, radius = np.array([0.5, 0.4, -2.0]), 1.97
    block = survey_cube("5.1", 3)
    contact = {"bottom": Contact(Compliance(5.0), obstacle=Sphere(tuple(centre), radius))}
    solution = solve(discretize(replace(block, contact=contact))).raise_for_status()
    record = solution_record(solution)["contact"]
    np.testing.assert_allclose(
        record["gap"], np.linalg.norm(np.array(record["x"]) - centre, axis=1) - radius, atol=1e-14
    )
    with write_csv(solution, tmp_path / "a.csv").open() as stream:
        assert [float(row["gap"]) for row in csv.DictReader(stream)] == record["gap"]
    skin = meshio.read(write_vtu(solution, tmp_path / "a.vtu")[1])
    known = skin.point_data["state"] >= 0
    distance = np.linalg.norm(skin.points[known] - centre, axis=1) - radius
    np.testing.assert_allclose(skin.point_data["initial_gap"][known], distance, atol=1e-14)
    inwards = (centre - skin.points[known]) / (distance + radius)[:, None]
    left = distance - np.sum(skin.point_data["displacement"][known] * inwards, axis=1)
    np.testing.assert_allclose(skin.point_data["gap"][known], left, atol=1e-14)
    assert np.abs(left - distance).max() > 1e-3


def test_regions_are_numbered(curved: Solution, tmp_path: Path) -> None:
    grid = meshio.read(write_vtu(curved, tmp_path / "solution.vtu")[0])
    region = grid.cell_data["region"][0]
    assert np.array_equal(np.flatnonzero(region == 0), curved.problem.field.mesh.regions["left half"])
    assert set(region) == {-1, 0}


def test_body_without_contact_has_no_contact_file(tmp_path: Path) -> None:
    solution = solve(discretize(beam()))
    body, contact = write_vtu(solution, tmp_path / "beam.vtu")
    assert contact is None
    assert "pressure" not in meshio.read(body).point_data


@pytest.mark.parametrize(("order", "quadrature"), [(1, "nodal"), (2, "nodal"), (1, "midpoint"), (2, "midpoint")])
def test_files_name_the_boundary_of_each_contact_point(order: int, quadrature: str, tmp_path: Path) -> None:
    """Two boundaries of a bent body, stated against the order of the mesh, each with its own foundation."""
    mesh = rectangle((2.0, 1.0), (4, 2), "cross")
    names = {"right": mesh.boundaries["right"], "under <&>": mesh.boundaries["bottom"], "left": mesh.boundaries["left"]}
    problem = discretize(
        bodies.body(
            mesh.with_boundaries(names),
            {"under <&>": Contact(Compliance(9.0)), "right": Contact(Signorini(), gap=0.01)},
            body_force=(0.4, -0.8),
            order=order,
            quadrature=Quadrature(quadrature),
        )
    )
    solution = solve(problem)
    x = problem.contact.points
    under = np.isclose(x[:, 1], 0.0)
    record = solution_record(solution)["contact"]
    if quadrature == "midpoint":
        assert record["boundary"] == np.where(under, "under <&>", "right").tolist()
    assert {record["boundary"][i] for i in np.flatnonzero(under & (x[:, 0] < 2.0))} == {"under <&>"}
    assert {record["boundary"][i] for i in np.flatnonzero(~under)} == {"right"}
    parts = {part.name: part for part in contact_boundaries(problem)}
    assert list(parts) == ["under <&>", "right"]
    assert np.array_equal(parts["under <&>"].position(x)[0], x[parts["under <&>"].index, 0])
    body, skin = (meshio.read(path) for path in write_vtu(solution, tmp_path / "a.vtu"))
    for grid in (body, skin):
        assert {name: value.tolist() for name, value in grid.field_data.items()} == {
            "boundary under <&>": [0],
            "boundary right": [1],
        }
        number, state = grid.point_data["boundary"], grid.point_data["state"]
        assert np.array_equal(number < 0, state < 0)
        place = grid.points
        assert set(number[(number >= 0) & (place[:, 1] > 0.0)]) == {1}
        assert set(number[(number >= 0) & (place[:, 0] < 2.0)]) == {0}
    (facets,) = skin.cells
    middle = skin.points[facets.data[:, :2]].mean(axis=1)
    assert np.array_equal(skin.cell_data["boundary"][0], np.where(middle[:, 1] > 0.0, 1, 0))


@pytest.mark.parametrize(("order", "quadrature"), [(1, "nodal"), (2, "nodal"), (1, "midpoint")])
def test_places_along_a_bent_boundary(order: int, quadrature: str) -> None:
    mesh = rectangle((2.0, 1.0), (4, 2), "cross")
    bent = mesh.with_boundaries(
        {
            "top": mesh.boundaries["top"],
            "around": np.vstack([mesh.boundaries["right"], mesh.boundaries["bottom"][::-1]]),
        }
    )
    contact = {"around": Contact(Compliance(9.0))}
    problem = discretize(
        ContactProblem(
            bent, Material.lame(4.0, 4.0), contact, {"top": Clamped()}, order=order, quadrature=Quadrature(quadrature)
        )
    )
    (part,) = contact_boundaries(problem)
    where, name = part.position(problem.contact.points)
    x = problem.contact.points[part.index]
    assert name == "arc length"
    np.testing.assert_allclose(where, np.where(np.isclose(x[:, 1], 0.0), x[:, 0], 2.0 + x[:, 1]), atol=1e-14)


def test_vectors_stand_in_a_file_as_lists_of_them_would() -> None:
    vectors = np.concatenate([np.random.default_rng(0).standard_normal((20, 3)) * 1e-9, [[0.0, -0.0, 1e300]]])
    assert laid_out(vectors) == json.dumps(vectors.tolist())
    assert laid_out(vectors[:0]) == "[]"
