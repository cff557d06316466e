"""What a solution says of itself: its summary, its stress, its window."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import hemivar as hv
from hemivar.cli import main
from hemivar.errors import ProblemError
from hemivar.files import read_problem, write_problem
from hemivar.solvers import Solution, solve
from tests.problems import discrete_square, square
from tests.solvers.test_fallbacks import stuck  # noqa: F401


def test_the_summary_is_what_the_command_prints(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "square.toml"
    write_problem(square(n=4), path)
    solution = solve(read_problem(path))
    certified = str(solution.summary(solution.certify(trace_constant=False)))
    assert main(["solve", str(path), "--quiet"]) == 0
    printed = capsys.readouterr().out.splitlines()
    said = [line for line in certified.splitlines() if not line.startswith(("time", "certified"))]
    assert len(said) > 10
    assert said == [line for line in printed if line in said]
    plain = [line for line in str(solution.summary()).splitlines() if not line.startswith(("time", "certified"))]
    assert set(plain) < set(said)


def test_the_summary_has_the_forces_that_balance_and_the_largest_stress() -> None:
    plane = solve(square())
    rows = dict(plane.summary().rows)
    name, _, force = rows["support forces"].partition(" ")
    assert name == "left"
    read = np.array([float(part) for part in force.strip("()").split(",")])
    whole = read + plane.on("bottom").force + square().mesh.volumes.sum() * np.asarray(square().body_force)
    np.testing.assert_allclose(whole, 0.0, atol=1e-5)
    assert float(rows["max von Mises"]) == pytest.approx(plane.von_mises().max(), rel=1e-5)


def test_a_summary_is_text_at_a_prompt_and_a_table_in_a_notebook(plane: Solution) -> None:
    summary = plane.summary()
    assert repr(summary) == str(summary)
    assert summary._repr_html_().count("<tr>") == len(summary.rows)


def test_the_stress_is_that_of_hookes_law(plane: Solution) -> None:
    problem = square()
    solution = solve(problem)
    corners = problem.mesh.nodes()[problem.mesh.cells]
    edges = corners[:, 1:] - corners[:, :1]
    moved = solution.displacement[problem.mesh.cells]
    gradient = np.linalg.solve(edges, moved[:, 1:] - moved[:, :1])
    strain = 0.5 * (gradient + gradient.transpose(0, 2, 1))
    trace = np.trace(strain, axis1=1, axis2=2)
    stress = 8.0 * strain + 4.0 * trace[:, None, None] * np.eye(2)
    np.testing.assert_allclose(solution.strain(), strain, atol=1e-14)
    np.testing.assert_allclose(solution.stress(), stress, atol=1e-13)
    xx, yy, zz, xy = stress[:, 0, 0], stress[:, 1, 1], 4.0 * trace, stress[:, 0, 1]
    mises = np.sqrt(0.5 * ((xx - yy) ** 2 + (yy - zz) ** 2 + (zz - xx) ** 2) + 3.0 * xy**2)
    np.testing.assert_allclose(solution.von_mises(), mises, rtol=1e-12)


def test_there_is_no_stress_of_arrays(bar: Solution) -> None:
    for quantity in (bar.stress, bar.strain, bar.von_mises):
        with pytest.raises(ProblemError, match=r"there is no .*: the problem is made of arrays"):
            quantity()


def test_no_window_where_none_can_be_opened(plane: Solution) -> None:
    with pytest.raises(ProblemError, match=r"no window can be opened here .*savefig"):
        plane.show()


def test_the_window_shows_the_picture(plane: Solution, monkeypatch: pytest.MonkeyPatch) -> None:
    import matplotlib.pyplot as plt

    seen: list[int] = []

    def look() -> None:
        figure = plt.get_current_fig_manager().canvas.figure  # type: ignore[union-attr]
        seen.append(len(figure.axes))
        plt.close("all")

    monkeypatch.setattr(plt, "get_backend", lambda: "qtagg")
    monkeypatch.setattr(plt, "show", look)
    plane.show()
    assert seen
    assert seen[0] > 0


def test_forces_of_rounding_are_shown_as_zero() -> None:
    """A block that is pressed from above without a shear: friction and the force aside are rounding."""
    problem = hv.ContactProblem(
        mesh=hv.rectangle((1.0, 1.0), 8, pattern="cross"),
        material=hv.Material.lame(4.0, 4.0),
        supports={"top": hv.Fixed(x=0.0, y=-0.07)},
        contact={"bottom": hv.Contact(hv.Compliance(60.0), hv.Tresca(0.05))},
    )
    solution = hv.solve(problem).raise_for_status()
    assert 0.0 < abs(solution.friction_force[0]) < 1e-12 * solution.normal_force
    rows = dict(solution.summary().rows)
    assert rows["friction force"] == "0"
    assert rows["support forces"].startswith("top (0, -")
    assert float(rows["normal force"]) == pytest.approx(solution.normal_force, rel=1e-5)


@pytest.mark.usefixtures("stuck")
def test_summary_and_record_say_which_method_took_over() -> None:
    found = solve(discrete_square(n=4))
    assert found.remarks[0].startswith("multigrid took over")
    assert found.remarks[0] in str(found.summary())
    assert found.remarks[0] in found.to_dict()["warnings"]


def test_the_summary_tells_how_a_plate_moves() -> None:
    """A column of Poisson's ratio 0 under a plate that its base does not turn."""
    supports = {"bottom": hv.Roller(), "left": hv.Roller(), "top": hv.mechanics.RigidPlate(force=(0.0, -0.5))}
    column = hv.ContactProblem(hv.rectangle((1.0, 1.0), 2), hv.Material.young(10.0, 0.0), {}, supports)
    assert dict(solve(column).summary().rows)["plate"] == "top moves by x 0, y -0.05, turn_z 0"
