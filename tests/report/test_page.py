"""The page that is stapled to a calculation: what was asked, what came out, and forces that are in balance."""

from __future__ import annotations

import html
import re
from pathlib import Path

import numpy as np
import pytest
import scipy.sparse as sp

import hemivar as hv
from hemivar.basics.units import Units
from hemivar.cli.app import main
from hemivar.errors import ProblemError
from hemivar.report.page import write_page

EXAMPLES = Path(__file__).parents[2] / "examples" / "problems"


def table_after(page: str, heading: str) -> list[list[str]]:
    """The cells of the first table below a heading."""
    part = page[page.index(f"<h2>{heading}</h2>") :]
    rows = re.findall(r"<tr>(.*?)</tr>", part[: part.index("</table>")])
    return [[html.unescape(cell) for cell in re.findall(r"<t[dh][^>]*>(.*?)</t[dh]>", row)] for row in rows]


def loaded_bracket(**more: object) -> hv.ContactProblem:
    given = {
        "mesh": hv.rectangle((4.0, 2.0), (8, 4)),
        "material": hv.Material.young(210e3, 0.3),
        "contact": {"bottom": hv.Contact(hv.Signorini(), hv.Coulomb(0.2))},
        "supports": {"left": "clamped"},
        "tractions": {"top": (3.0, -20.0), "right": hv.Pressure(5.0)},
        "body_force": (0.0, -0.5),
        "title": "bracket <1 & 2>",
        **more,
    }
    return hv.ContactProblem(**given)  # type: ignore[arg-type]


def test_a_page_tells_the_statement_the_answer_and_forces_in_balance(tmp_path: Path) -> None:
    solution = hv.solve(loaded_bracket())
    units = Units(length="mm", stress="MPa", force="N")
    page = write_page(solution, tmp_path / "joint.html", solution.certify(), units=units).read_text()
    assert "<h1>bracket &lt;1 &amp; 2&gt;</h1>" in page
    assert "Numbers are in mm (length), N (force), MPa (stress)." in page
    stated = dict(row for row in table_after(page, "Statement") if len(row) == 2)
    assert stated["contact bottom"] == "normal signorini, friction coulomb (coefficient 0.2)"
    assert stated["supports left"] == "clamped"
    assert page.count("data:image/png") == 3
    assert not re.search(r'(src|href)="(?!data:)', page)  # nothing is fetched
    assert "max pressure" in page
    assert "Certificate" in page
    head, *rows = table_after(page, "Forces on the body")
    assert head == ["", "on", "force x (N)", "force y (N)"]
    forces = {(row[0], row[1]): np.array(row[2:], dtype=float) for row in rows}
    np.testing.assert_allclose(forces["load", "top"], [12.0, -80.0])
    np.testing.assert_allclose(forces["load", "right"], [-10.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(forces["load", "body force"], [0.0, -4.0], atol=1e-12)
    np.testing.assert_allclose(forces["support", "left"], solution.reactions["left"], rtol=1e-3)
    np.testing.assert_array_equal(forces["sum", ""], 0.0)


def test_a_force_that_is_missing_shows_in_the_sum(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    solution = hv.solve(loaded_bracket())
    monkeypatch.setitem(vars(solution), "reactions", {"left": np.zeros(2)})
    rows = table_after(write_page(solution, tmp_path / "a.html").read_text(), "Forces on the body")
    assert [float(cell) for cell in rows[-1][2:]] != [0.0, 0.0]


def test_functions_are_told_as_such(tmp_path: Path) -> None:
    problem = loaded_bracket(tractions={"top": lambda x: np.column_stack([0.0 * x[:, 0], -x[:, 0]])})
    page = write_page(hv.solve(problem), tmp_path / "a.html").read_text()
    assert dict(row for row in table_after(page, "Statement") if len(row) == 2)["load: top"] == "varies"


def test_the_command_writes_it_with_a_finer_mesh(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    hv.write_problem(loaded_bracket(), "a.toml")
    assert main(["solve", "a.toml", "-q", "--report", "a.html", "--check-mesh"]) == 0
    page = Path("a.html").read_text()
    head, coarse, fine = table_after(page, "On finer meshes")
    numbers = dict(zip(head, zip(coarse, fine, strict=True), strict=True))
    study = hv.study(loaded_bracket(), 1)
    expected = [one.solution.pressure.max() for one in study.levels]
    np.testing.assert_allclose([float(cell) for cell in numbers["max-pressure"]], expected, rtol=1e-3)
    assert [int(cell) for cell in numbers["unknowns"]] == [one.solution.problem.unknowns for one in study.levels]


@pytest.mark.parametrize("name", ["membrane_obstacle", "antiplane_friction"])
def test_problems_of_one_component_have_a_page(name: str, tmp_path: Path) -> None:
    page = write_page(hv.solve(hv.read_problem(EXAMPLES / f"{name}.toml")), tmp_path / "a.html").read_text()
    assert "Forces on the body" not in page
    assert "<h2>Answer</h2>" in page


def test_what_cannot_be_a_page_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    solution = hv.solve(loaded_bracket())
    with pytest.raises(ProblemError, match=r"ends in \.html"):
        write_page(solution, tmp_path / "a.txt")
    one = sp.csr_array(np.eye(1))
    law = hv.laws.ContactLaw(hv.Compliance(1.0)).at(None)
    arrays = hv.DiscreteProblem.of_arrays(
        stiffness=one, load=np.ones(1), trace=one, weights=np.ones(1), gap=np.zeros(1), law=law
    )
    with pytest.raises(ProblemError, match="made of arrays"):
        write_page(hv.solve(arrays), tmp_path / "a.html")
    assert main(["solve", "x.toml", "--check-mesh"]) == 2
    assert "--check-mesh goes with --report" in capsys.readouterr().err
