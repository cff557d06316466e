"""Bodies by bases and forms of scikit-fem: against the library's own elements, and mixed bodies in closed form."""

from __future__ import annotations

from pathlib import Path

import meshio
import numpy as np
import pytest
import skfem

import hemivar as hv
from hemivar.fem import FormBody
from tests.fem.test_forms import BED, LOAD, RUBBED, bending_plate, grid, pressed_form


def test_pictures_of_forms_show_body_and_states(tmp_path: Path) -> None:
    plane = skfem.Basis(grid(skfem.MeshQuad, 3), skfem.ElementVector(skfem.ElementQuad2()))
    space = skfem.Basis(grid(skfem.MeshHex, 2), skfem.ElementVector(skfem.ElementHex1()))
    for basis in (plane, space):
        figure = hv.solve(pressed_form(basis).problem({"bottom": RUBBED})).plot()
        legends = [*figure.legends, *(axes.get_legend() for axes in figure.axes if axes.get_legend())]
        labels = [text.get_text() for legend in legends for text in legend.get_texts()]
        figure.savefig(tmp_path / "picture.png")
        assert any("stick" in label or "slip" in label for label in labels), labels


def test_the_deflection_of_a_plate_is_drawn_and_written(tmp_path: Path) -> None:
    basis, bending = bending_plate(8)
    weight = skfem.LinearForm(lambda v, w: LOAD * v)
    body = FormBody(basis, bending, load=weight, supports={"ends": 0.0, "long": {"u_n": 0.0}})
    problem = body.problem({"plate": hv.Contact(hv.Compliance(BED))})
    found = hv.solve(problem)
    written = meshio.read(found.to_vtu(tmp_path / "plate.vtu"))
    whole = body.full(problem, found.unknowns)
    np.testing.assert_allclose(written.point_data["deflection"].ravel(), whole[basis.nodal_dofs[0]], atol=1e-15)
    np.testing.assert_allclose(written.point_data["displacement"][:, 2], whole[basis.nodal_dofs[0]], atol=1e-15)
    np.testing.assert_allclose(written.point_data["pressure"][problem.contact.node], found.pressure, atol=1e-15)
    figure = found.plot()
    figure.savefig(tmp_path / "plate.png")
    assert "deflection" in [axes.get_xlabel() for axes in figure.axes]
    assert any("100 % of the area" in text.get_text() for text in figure.axes[0].get_legend().get_texts())
    assert problem.field is not None
    with pytest.raises(hv.errors.ProblemError, match="does not say all"):
        problem.field.restrict(found.displacement)
