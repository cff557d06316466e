"""Own arrays with a mesh: displacements of nodes, pictures and VTU as those of a problem that was stated."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import hemivar as hv
from hemivar.discrete import DiscreteProblem
from hemivar.errors import ProblemError
from hemivar.files import write_vtu
from hemivar.files.boundary import contact_boundaries
from hemivar.report import plot_contact, plot_solution
from tests.discrete.test_own_mesh import FRICTION, arrays_of, given_by, rubbing_cube


def test_the_solution_is_drawn_and_written(tmp_path: Path) -> None:
    import meshio

    stated = hv.discretize(FRICTION)
    expected, found = hv.solve(stated), hv.solve(arrays_of(stated))
    assert plot_solution(found, scale="auto").axes
    assert plot_solution(found, colour="displacement").axes
    assert plot_contact(found).axes[0].get_xlabel() == plot_contact(expected).axes[0].get_xlabel()
    assert found.plot().axes
    with pytest.raises(ProblemError, match="take 'displacement'"):
        plot_solution(found, colour="stress")
    one, two = (write_vtu(solution, tmp_path / f"{name}.vtu") for name, solution in (("a", expected), ("b", found)))
    for expected_file, file in zip(one, two, strict=True):
        assert expected_file is not None
        assert file is not None
        reference, read = meshio.read(expected_file), meshio.read(file)
        np.testing.assert_array_equal(read.points, reference.points)
        for name, values in read.point_data.items():
            size = max(np.abs(reference.point_data[name]).max(), 1e-9)
            np.testing.assert_allclose(values, reference.point_data[name], atol=1e-7 * size, err_msg=name)
    assert found.certify(trace_constant=False).residual.relative < 1e-9


def test_a_solid_is_drawn_and_written(tmp_path: Path) -> None:
    found = hv.solve(arrays_of(hv.discretize(rubbing_cube())))
    assert plot_solution(found).axes
    assert plot_contact(found).axes
    assert write_vtu(found, tmp_path / "a.vtu")[1] is not None


def test_contact_points_that_are_no_nodes_are_left_out_of_the_picture(tmp_path: Path) -> None:
    stated = hv.discretize(FRICTION)
    mean = np.array([[0.5, 0.0, 0.5, 0.0], [0.0, 0.5, 0.0, 0.5]])
    law = hv.laws.ContactLaw(hv.Signorini(), hv.Tresca(0.1)).at(None)
    given = given_by(stated) | {"trace": mean @ given_by(stated)["trace"][:4].toarray(), "weights": [1.0], "gap": [0.0]}
    middle = DiscreteProblem.of_arrays(**{**given, "law": law})
    assert contact_boundaries(middle) == []
    found = hv.solve(middle)
    assert plot_solution(found).axes
    assert plot_contact(found).axes
    assert write_vtu(found, tmp_path / "a.vtu")[1] is None
