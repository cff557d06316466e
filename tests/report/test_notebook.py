"""What a notebook shows: pictures and tables, in which all text is escaped, and never an error."""

from __future__ import annotations

import base64
import re
import subprocess
import sys
import warnings
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest

from hemivar.branches import find_solutions, follow_path
from hemivar.certificates import certify
from hemivar.discrete import DiscreteProblem
from hemivar.fem import discretize
from hemivar.gallery import survey, survey_cube
from hemivar.laws import Signorini, Softening
from hemivar.mechanics import Contact, ContactProblem
from hemivar.mesh import rectangle
from hemivar.report.notebook import html_of
from hemivar.solvers import Solution, Status, solve

HOSTILE = "<script>alert('x')</script> & $x_{"


class Reader(HTMLParser):
    """Texts, tags and pictures of a fragment; every tag is closed."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.texts: list[str] = []
        self.tags: list[str] = []
        self.pictures: list[bytes] = []
        self._open: list[str] = []
        self.feed(text)
        self.close()
        assert self._open == []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        if tag == "img":
            source = dict(attrs)["src"] or ""
            self.pictures.append(base64.b64decode(source.removeprefix("data:image/png;base64,"), validate=True))
        else:
            self._open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self._open.pop() == tag

    def handle_data(self, data: str) -> None:
        if data.strip():
            self.texts.append(data)

    def row(self, name: str) -> str:
        return self.texts[self.texts.index(name) + 1]


def picture_size(data: bytes) -> tuple[int, int]:
    assert data.startswith(b"\x89PNG\r")
    return int.from_bytes(data[16:20], "big"), int.from_bytes(data[20:24], "big")


def shown(value: object) -> Reader:
    return Reader(value._repr_html_())  # type: ignore[attr-defined]


def test_solution(plane: Solution) -> None:
    page = shown(plane)
    assert page.row("status").startswith("converged after")
    assert page.row("contact points") == "16 contact; 3 stick, 13 slip"
    assert float(page.row("normal force")) == pytest.approx(plane.normal_force, rel=1e-3)
    assert "what to do" not in page.texts
    assert page.texts[0] == f"Solution: {plane.problem.origin.title}"
    (picture,) = page.pictures
    assert all(100 < pixels < 800 for pixels in picture_size(picture))
    assert len(picture) < 100_000


def test_solution_that_failed(plane: Solution) -> None:
    page = shown(replace(plane, status=Status.MAX_STEPS))
    assert page.row("what to do") == Status.MAX_STEPS.remedy


def test_solid_and_arrays(solid: Solution, bar: Solution) -> None:
    assert len(shown(solid).pictures) == len(shown(bar).pictures) == 1
    assert shown(solid).row("contact area").startswith(f"{solid.contact_length:.6g} of ")


def test_problems(plane: Solution, bar: Solution) -> None:
    stated = plane.problem.origin
    assert stated is not None
    page = shown(stated)
    assert page.row("contact: bottom") == "survey; friction tresca"
    assert page.row("support: left") == "Clamped()"
    assert len(page.pictures) == len(shown(plane.problem).pictures) == 1
    assert shown(plane.problem).row("unknowns") == str(plane.problem.unknowns)
    assert shown(bar.problem).pictures == []
    assert shown(survey_cube("5.1", 2)).row("elements") == "of order 1"


def test_a_card_names_friction_only_where_it_was_stated(plane: Solution) -> None:
    stated = plane.problem.origin
    assert isinstance(stated, ContactProblem)
    smooth = replace(stated, contact={"bottom": Contact(Signorini())})
    assert shown(smooth).row("contact: bottom") == "signorini"
    assert "friction" not in discretize(smooth)._repr_html_()
    assert "friction" in plane.problem._repr_html_()


def test_certificate(plane: Solution) -> None:
    page = shown(certify(plane))
    assert page.row("kind") == "unique minimiser; the only solution"
    assert page.row("equilibrium") == certify(plane).claim("equilibrium").sentence
    sampled = replace(certify(plane), error_bound_sampled=True, unique=None, left_out=("margin",))
    assert "an estimate, from sampled constants" in shown(sampled).row("distance")
    assert shown(sampled).row("kind").endswith("; uniqueness not known")
    assert shown(sampled).row("left out").startswith("margin: ")


@pytest.fixture(scope="module")
def softening() -> DiscreteProblem:
    return discretize(replace(survey("5.1", 4), contact={"bottom": Contact(Softening(10.0, 0.02, 3.0))}))


def test_path_and_solutions(softening: DiscreteProblem) -> None:
    path = follow_path(softening, (0.0, 1.5))
    page = shown(path)
    assert page.texts[0].endswith(path.failure)
    assert page.row("path").startswith(f"{len(path)} points, ")
    assert len(page.pictures) == 1
    found = find_solutions(softening)
    assert shown(found).texts[0] == "1 solution, there are no others"
    assert shown(replace(found, exhaustive=False)).texts[0] == "1 solution, there may be more"
    assert len(shown(replace(found, solutions=found.solutions * 30)).pictures) == 1
    assert shown(replace(found, solutions=())).pictures == []


def test_what_users_write_is_escaped(plane: Solution) -> None:
    stated = plane.problem.origin
    assert stated is not None
    mesh = stated.mesh
    odd = replace(
        stated,
        title=HOSTILE,
        mesh=replace(
            mesh, boundaries={HOSTILE if name == "bottom" else name: f for name, f in mesh.boundaries.items()}
        ),
        contact={HOSTILE: stated.contact["bottom"]},
    )
    discrete = discretize(odd)
    solution = solve(discrete)
    for value in (odd, discrete, solution):
        page = shown(value)
        assert "script" not in page.tags
        assert HOSTILE in page.texts[0]
    assert f"contact: {HOSTILE}" in shown(odd).texts


def test_a_picture_that_fails_leaves_the_table(plane: Solution, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object, **__: object) -> None:
        raise RuntimeError("no picture")

    monkeypatch.setattr("hemivar.report.notebook.plot_solution", fail)
    assert shown(plane).pictures == []
    assert shown(plane).row("status").startswith("converged")


def test_whatever_state_an_object_is_in() -> None:
    class Broken:
        def __repr__(self) -> str:
            raise RuntimeError

    assert "Broken object" in html_of(Broken())
    assert html_of("<b>") == "<pre>&#x27;&lt;b&gt;&#x27;</pre>"
    for kind in (Solution, DiscreteProblem):
        empty = object.__new__(kind)
        assert re.fullmatch(r"<pre>.*</pre>", html_of(empty), re.DOTALL)


def test_numbers_that_are_not_finite(plane: Solution) -> None:
    broken = replace(plane, unknowns=np.full_like(plane.unknowns, np.nan), multiplier=plane.multiplier * np.inf)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert shown(broken).row("status").startswith("converged")


def test_large_bodies_are_shown_by_a_table() -> None:
    large = replace(survey("5.1", 4), mesh=rectangle((1.0, 1.0), 120, pattern="cross"))
    assert large.mesh.number_of_cells > 50_000
    page = shown(large)
    assert page.pictures == []
    assert page.row("mesh").startswith(str(large.mesh.number_of_cells))


def test_nothing_is_drawn_before_it_is_shown() -> None:
    code = (
        "import sys, hemivar as hv\nfrom hemivar.gallery import survey\nhv.solve(hv.discretize(survey('5.1', 2)))\n"
        "sys.exit(any(name in sys.modules for name in ('matplotlib', 'hemivar.report')))"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
