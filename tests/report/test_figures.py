"""Figures are drawn for every kind of problem; the numbers in them are right."""

import subprocess
import sys

import numpy as np
import pytest

from hemivar.errors import ProblemError
from hemivar.fem import discretize
from hemivar.gallery import beam, survey
from hemivar.report import plot_contact, plot_errors, plot_history, plot_solution, save
from hemivar.solvers import solve


def texts(figure):
    from matplotlib.text import Text

    return " | ".join(item.get_text() for item in figure.findobj(Text))


@pytest.mark.parametrize("suffix", [".png", ".svg", ".pdf"])
def test_save_by_suffix(plane, tmp_path, suffix):
    path = save(plot_solution(plane), tmp_path / "new" / f"figure{suffix}")
    start = path.read_bytes()[:5]
    assert start in (b"\x89PNG\r", b"<?xml", b"%PDF-")


def test_unknown_suffix_is_refused(plane, tmp_path):
    with pytest.raises(ProblemError, match=r"\.png, \.svg or \.pdf"):
        save(plot_contact(plane), tmp_path / "figure.bmp")


def test_solution_names_its_data(plane):
    words = texts(plot_solution(plane, title="A title", note="a note", unit="mm"))
    for expected in ("A title", "a note", "x (mm)", "q_{max}", "= 10", "stick (3)", "slip (13)", "newton: converged"):
        assert expected in words


@pytest.mark.parametrize("arrows", ["force", "components", "none"])
@pytest.mark.parametrize("scale", [0.5, "auto"])
def test_solution_with_curved_boundary(curved, arrows, scale, tmp_path):
    save(plot_solution(curved, arrows=arrows, scale=scale), tmp_path / "figure.png", dpi=40)
    save(plot_contact(curved), tmp_path / "contact.png", dpi=40)


def test_forces_are_mirrored(plane):
    """Arrows point out of the body: along the normal as the pressure, along the tangent as the traction."""
    from matplotlib.quiver import Quiver

    (quiver,) = plot_solution(plane).axes[0].findobj(Quiver)
    assert np.allclose(quiver.V, -plane.pressure)
    assert np.allclose(quiver.U, -plane.friction[:, 0])


def test_many_cells_are_coloured_instead_of_lined(tmp_path):
    figure = plot_solution(solve(discretize(survey("figure2", 40))))
    assert "von Mises stress" in texts(figure)
    save(figure, tmp_path / "figure.png", dpi=40)


def test_own_axes_are_used(plane):
    from matplotlib.figure import Figure

    own = Figure()
    axes = own.add_subplot()
    assert plot_solution(plane, ax=axes, legend=False) is own
    assert axes.get_xlabel() == "x"
    assert axes.get_legend() is None


def test_body_without_contact(tmp_path):
    solution = solve(discretize(beam()))
    save(plot_solution(solution), tmp_path / "figure.png", dpi=40)
    with pytest.raises(ProblemError, match="no contact point"):
        plot_contact(solution)


def test_solid(solid, tmp_path):
    save(plot_solution(solid, scale="auto"), tmp_path / "figure.png", dpi=40)
    words = texts(plot_contact(solid))
    assert "friction, magnitude" in words


def test_problem_of_arrays(bar, tmp_path):
    with pytest.raises(ProblemError, match="no mesh"):
        plot_solution(bar)
    save(plot_contact(bar), tmp_path / "contact.png", dpi=40)
    save(plot_history([bar, bar]), tmp_path / "history.png", dpi=40)


@pytest.mark.parametrize("options", [{"scale": -1.0}, {"scale": "big"}, {"scale": np.nan}, {"arrows": "long"}])
def test_options_are_checked(plane, options):
    with pytest.raises(ProblemError):
        plot_solution(plane, **options)


def test_friction_bound_is_drawn(plane):
    upper = plot_contact(plane).axes[0]
    drawn = [line.get_ydata() for line in upper.lines if len(line.get_ydata()) == 16]
    assert any(np.allclose(values, 0.1) for values in drawn)
    assert any(np.allclose(values, -0.1) for values in drawn)
    assert any(np.allclose(values, plane.pressure) for values in drawn)


def test_history_needs_a_solution():
    with pytest.raises(ProblemError, match="no solution"):
        plot_history([])


def test_errors_leave_out_the_mesh_next_to_the_reference(tmp_path):
    sizes = 0.5 ** np.arange(1, 6)
    error = sizes**0.9
    error[-1] *= 0.5
    figure = plot_errors(sizes, {("A", "A"): error, ("A", "B"): 1.1 * error}, reference_size=1 / 64)
    assert "B against A: 0.90" in texts(figure)
    save(figure, tmp_path / "errors.png", dpi=40)


def test_drawing_is_imported_late():
    code = "import sys, hemivar.report; sys.exit(any(m in sys.modules for m in ('matplotlib', 'meshio', 'rich')))"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
