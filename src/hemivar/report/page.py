"""A solution on one page of HTML that needs no network: statement, pictures, forces, certificate, finer mesh."""

from __future__ import annotations

import base64
import html
import tomllib
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from hemivar.basics.arguments import expect, expecting
from hemivar.basics.disk import make_folder, path_of, write_text
from hemivar.basics.types import Array
from hemivar.basics.units import Units
from hemivar.certificates import Certificate
from hemivar.errors import HemivarError, ProblemError
from hemivar.fem.assembly import load_vector
from hemivar.files.problem_file import problem_text
from hemivar.mechanics import ContactProblem
from hemivar.report.bodies import plot_problem, plot_solution
from hemivar.report.contact_curves import plot_contact
from hemivar.report.notebook import table_of
from hemivar.report.picture import png
from hemivar.report.summary import summary_of
from hemivar.report.tables import Table
from hemivar.solvers import Solution
from hemivar.workflows.study import Study

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["write_page"]

#: Dots per inch of figures: the widest are as wide as the page.
_DPI = 110
#: Part of the largest force up to which the sum of all is what rounding and the tolerance of a solve leave.
_ROUNDING = 1e-7
_STYLE = """
body { font: 15px/1.45 system-ui, sans-serif; color: #222; max-width: 60em; margin: 2em auto; padding: 0 1em }
h1 { font-size: 1.5em } h2 { font-size: 1.15em; margin-top: 2em; border-bottom: 1px solid #ccc }
table { border-collapse: collapse; margin: .8em 0 } td, th { padding: .15em .8em .15em 0; text-align: left; vertical-align: top }
th { border-bottom: 1px solid #888 } .number { text-align: right } img { max-width: 100% } footer { color: #777; margin-top: 3em }
"""  # noqa: E501 - lines of another language
#: What tables of a problem file are called on the page, in this order.
_PARTS = ("mesh", "material", "loads", "supports", "contact", "heat")


@expecting(solution=Solution, certificate=Certificate, title=str, units=Units, finer=Study)
def write_page(
    solution: Solution,
    path: str | Path,
    certificate: Certificate | None = None,
    *,
    title: str | None = None,
    units: Units | None = None,
    finer: Study | None = None,
) -> Path:
    """Write a page to staple to a calculation: one file of HTML, with its pictures inside; returns the path.

    Parameters
    ----------
    solution : Solution
        Of a problem with a mesh.
    path : str or Path
        Name of the file, which ends in ``.html``.
    certificate : Certificate, optional
        What ``solution.certify()`` returned.
    title : str, optional
        That of the problem by default.
    units : Units, optional
        Those of the problem by default; numbers are not converted.
    finer : Study, optional
        The same problem on this mesh and on finer ones: they stand side by side.

    Raises
    ------
    ProblemError
        The problem was made of arrays, or the name has another ending.
    FileError
        The file or its folder cannot be made.
    """
    path = path_of(path)
    if path.suffix.lower() not in (".html", ".htm"):
        raise ProblemError(f"{path}: a page ends in .html; give it such a name")
    stated = solution.problem.origin
    if stated is None:
        raise ProblemError("the problem was made of arrays, and a page shows its mesh; use solution.to_json")
    units = expect(stated.units if units is None else units, Units, "units", "give Units(...)")
    heading = title or stated.title or "Contact problem"
    parts = [
        *_section("Statement", _statement(stated, units)),
        *_section("Answer", _answer(solution, certificate, units)),
        *_section("Forces on the body", _forces(solution, stated, units)),
        *_section("How sure it is", [] if certificate is None else [_lines(str(certificate))]),
        *_section("On finer meshes", [] if finer is None else [_finer(finer, units)]),
    ]
    body = "\n".join([f"<h1>{html.escape(heading)}</h1>", *parts, "<footer>computed by hemivar</footer>"])
    head = f'<meta charset="utf-8"><title>{html.escape(heading)}</title><style>{_STYLE}</style>'
    make_folder(path.parent)
    write_text(path, f'<!doctype html>\n<html lang="en"><head>{head}</head>\n<body>\n{body}\n</body></html>\n')
    return path


def _section(name: str, parts: list[str]) -> Iterator[str]:
    if parts:
        yield f"<h2>{name}</h2>"
        yield from parts


def _statement(stated: ContactProblem, units: Units) -> list[str]:
    """The problem in words, and its picture with supports, loads and contact."""
    known = ", ".join(f"{unit} ({quantity})" for quantity, unit in units.record().items())
    sentence = f"Numbers are in {known}." if known else "No units are stated; all numbers are in one system of them."
    try:
        rows = tuple(_rows(tomllib.loads(problem_text(stated))))
        table = Table(("", " "), rows)
    except ProblemError:  # what a problem file cannot say, such as a function
        table = table_of(stated)
    picture = _picture(lambda: plot_problem(stated, unit=units.length))
    return [f"<p>{html.escape(sentence)}</p>", table.html(), picture]


def _rows(data: Mapping[str, object]) -> Iterator[tuple[str, str]]:
    """What a problem file says, a row for each table and each of its named parts."""
    for name in _PARTS:
        value = data.get(name)
        if not isinstance(value, Mapping) or not value:
            continue
        several = name in ("supports", "contact") or all(isinstance(part, Mapping) for part in value.values())
        if several:
            yield from ((f"{name} {part}", _words(what)) for part, what in value.items())
        else:
            yield name, _words(value)


def _words(value: object, inner: bool = False) -> str:
    """A value of a problem file: a law by its name with its parameters, other tables as their keys with values."""
    if isinstance(value, Mapping):
        law = value.get("law", value.get("kind"))
        rest = ", ".join(f"{key} {_words(one, True)}" for key, one in value.items() if key not in ("law", "kind"))
        if law is None:
            return f"({rest})" if inner else rest
        return f"{law} ({rest})" if rest else str(law)
    if isinstance(value, list):
        return f"({', '.join(_words(one, True) for one in value)})"
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def _answer(solution: Solution, certificate: Certificate | None, units: Units) -> list[str]:
    """What was computed: status and numbers, and the pictures of the body and of its contact."""
    unit, stress = units.length, units.stress

    def body() -> Figure:
        return plot_solution(solution, scale="auto", certificate=certificate, unit=unit, stress_unit=stress)

    def contact() -> Figure:
        return plot_contact(solution, certificate=certificate, unit=unit, stress_unit=stress)

    pictures = [_picture(draw) for draw in (body, *([contact] if solution.problem.contact_points else []))]
    return [summary_of(solution, certificate, units)._repr_html_(), *pictures]


def _forces(solution: Solution, stated: ContactProblem, units: Units) -> list[str]:
    """The force of each load, support and contact on the body; together they are in balance."""
    if stated.kind:
        return []
    loads = {name: _load(stated, name) for name in ("body force", *stated.tractions)}
    if not loads["body force"].any():
        del loads["body force"]
    try:
        kinds = {"load": loads, "contact": solution.contact_forces, "support": solution.reactions}
    except ProblemError as error:
        return [f"<p>{html.escape(str(error))}</p>"]
    named = [(kind, name, force) for kind, forces in kinds.items() for name, force in forces.items()]
    if not named:
        return []
    forces = np.array([force for _, _, force in named])
    total = forces.sum(axis=0)
    total[np.abs(total) <= _ROUNDING * np.abs(forces).max()] = 0.0
    rows = [(kind, name, *force.tolist()) for kind, name, force in named]
    heads = [units.head(f"force {axis}", "force") for axis in "xyz"[: total.size]]
    return [Table(("", "on", *heads), (*rows, ("sum", "", *total.tolist()))).html()]


def _load(stated: ContactProblem, name: str) -> Array:
    """The resultant of a traction, or of the body force."""
    inside = stated.body_force if name not in stated.tractions else np.zeros(stated.components)
    on = {name: stated.tractions[name]} if name in stated.tractions else {}
    how = (stated.components, stated.load_names, stated.kinematics)
    load = load_vector(stated.mesh, stated.order, inside, on, *how)
    return np.asarray(load.reshape(-1, stated.components).sum(axis=0))


def _finer(study: Study, units: Units) -> str:
    """Sizes, errors against the finest mesh and numbers of the solutions; columns without an entry are left out."""
    whole = Table.of(study.rows(relative=True), brief=True, units=units)
    filled = [k for k in range(len(whole.columns)) if any(row[k] is not None for row in whole.rows)]
    columns, rows = ((tuple(line[k] for k in filled) for line in lines) for lines in ([whole.columns], whole.rows))
    return Table(next(columns), tuple(rows)).html()  # type: ignore[arg-type]


def _lines(text: str) -> str:
    return f"<pre>{html.escape(text)}</pre>"


def _picture(draw: Callable[[], Figure]) -> str:
    """A picture inside the page; nothing where there is none of this problem."""
    try:
        data = base64.b64encode(png(draw(), _DPI)).decode("ascii")
    except HemivarError:
        return ""
    return f'<p><img alt="figure" src="data:image/png;base64,{data}"></p>'
