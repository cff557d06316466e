"""Values as a notebook shows them, a heading, a picture and a table; as a window; and as tables of pandas."""

from __future__ import annotations

import base64
import html
import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from hemivar.basics.first_use import IMPORTS
from hemivar.basics.pandas_frame import data_frame
from hemivar.bounds import AdaptiveSolution
from hemivar.branches import Path, SolutionSet
from hemivar.certificates import Certificate, certify, smallness
from hemivar.certificates.smallness import one_solution
from hemivar.discrete.bulk import Quadratic
from hemivar.discrete.problem import DiscreteProblem
from hemivar.errors import HemivarError, ProblemError
from hemivar.evolution.history import History
from hemivar.fem import discretize
from hemivar.laws import ContactLaw
from hemivar.laws.vector_law import splits
from hemivar.mechanics import Contact, ContactProblem
from hemivar.mechanics.gradient_material import GradientMaterial
from hemivar.mesh.mesh import Mesh
from hemivar.report.bodies import plot_problem, plot_solution
from hemivar.report.certificate_line import plot_certificate
from hemivar.report.contact_curves import plot_contact
from hemivar.report.loglog import plot_adaptive, plot_study
from hemivar.report.march_figures import plot_march
from hemivar.report.path_diagrams import plot_path
from hemivar.report.picture import png
from hemivar.report.solution_pictures import plot_solutions
from hemivar.report.style import MANY_CELLS
from hemivar.report.summary import Summary, summary_of
from hemivar.report.sweep_figures import plot_sweep
from hemivar.report.tables import Table
from hemivar.solvers import Solution, Status
from hemivar.workflows.convergence import Convergence
from hemivar.workflows.sweep import Sweep

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from pandas import DataFrame

__all__ = ["frame_of", "html_of", "picture_of", "show", "table_of"]

#: Larger bodies are shown without a picture, which would take longer than a reader waits.
_MOST_CELLS = 10 * MANY_CELLS
#: Rows of a table.
_MOST_ROWS = 20
#: Dots per inch of figures beside tables: half a screen wide they are still sharp.
_DPI = 76
#: Unknowns up to which a certificate is computed to be shown, and the seconds that it may take.
_MOST_CERTIFIED, _SECONDS = 20_000, 2.0

#: Columns of an adaptive solve that are shown.
_OF_A_MESH = ("unknowns", "cells", "energy", "relative_bound", "guaranteed", "seconds")

_Row = tuple[str, object]
_Shown = tuple[str, Callable[[], Iterable["Figure"]], Table]
#: Backends of matplotlib that write files and open no window.
_FILES_ONLY = ("agg", "cairo", "pdf", "pgf", "ps", "svg", "template")


def html_of(value: object) -> str:
    """A fragment of HTML, in which all text is escaped; never an error: what cannot be drawn is shown as a table, what
    cannot be shown so by its ``repr``."""
    with np.errstate(all="ignore"):
        try:
            heading, draw, table = _parts(value)
        except Exception:  # a notebook must show something, whatever state an object is in
            return f"<pre>{html.escape(_plain(value))}</pre>"
        try:
            pictures = "".join(_image(figure) for figure in draw())
        except Exception:
            pictures = ""
    style = "display:flex;flex-wrap:wrap;gap:1em;align-items:flex-start"
    return f'<div><strong>{html.escape(heading)}</strong><div style="{style}">{pictures}{table.html()}</div></div>'


def picture_of(value: object) -> Figure:
    """The picture of a value that :class:`~hemivar.basics.display.ReprMixin` has."""
    for kind, draw in _PICTURES.items():
        if isinstance(value, kind):
            return draw(value)
    raise ProblemError(f"there is no picture of a {type(value).__name__}")


def table_of(value: object) -> Table:
    """The table that stands beside the picture; of names and values where a value has no rows of its own."""
    return _parts(value)[2]


def _plain(value: object) -> str:
    try:
        return repr(value)
    except Exception:
        return object.__repr__(value)


def _image(figure: Figure) -> str:
    data = base64.b64encode(png(figure, _DPI)).decode("ascii")
    return f'<img alt="figure" style="max-width:32em" src="data:image/png;base64,{data}">'


def _parts(value: object) -> _Shown:
    for kind, parts in _KINDS.items():
        if isinstance(value, kind):
            return parts(value)
    raise TypeError(type(value).__name__)


def _small(mesh: Mesh) -> bool:
    """Whether a picture of the body takes a moment only."""
    return mesh.number_of_cells <= _MOST_CELLS and (mesh.dim == 2 or len(mesh.boundary_facets) <= MANY_CELLS)


def _rows(rows: Iterable[_Row]) -> Table:
    return Table(("", " "), tuple(row for row in rows if row[1] is not None))


def _solution(solution: Solution) -> _Shown:
    table = _rows(summary_of(solution, _certified(solution)).rows)
    return _title("Solution", solution.problem), lambda: _pictures(solution), table


def _pictures(solution: Solution) -> list[Figure]:
    field = solution.problem.field
    if field is not None:
        return [plot_solution(solution, scale="auto", legend=False)] if _small(field.mesh) else []
    return [plot_contact(solution)] if 0 < solution.problem.contact_points <= MANY_CELLS else []


def _certified(solution: Solution) -> Certificate | None:
    """What certifies a solution, where that takes a moment only."""
    if solution.problem.unknowns > _MOST_CERTIFIED or solution.status is not Status.CONVERGED:
        return None
    try:
        return certify(solution, trace_constant=False, max_time=_SECONDS)
    except HemivarError:
        return None


def _margin(problem: DiscreteProblem) -> list[_Row]:
    """Whether a problem has one solution, where that takes a moment only."""
    if problem.unknowns > _MOST_CERTIFIED:
        return []
    try:
        constants = smallness(problem, trace_constant=False)
    except HemivarError:
        return []
    margin = _number(constants.margin)
    if one_solution(problem, constants):
        return [("margin", f"{margin}: one solution")]
    if constants.margin > 0.0:
        return [("margin", f"{margin} (alpha is {problem.law.proof('alpha').doubt or 'sampled'})")]
    return [("margin", f"{margin}, not positive: there may be several solutions")]


def _certificate(certificate: Certificate) -> _Shown:
    claims = [replace(claim, whole=False) for claim in certificate.claims()]
    return "Certificate", lambda: [plot_certificate(certificate)], _rows(Summary.of(claims).rows)


def _path(path: Path) -> _Shown:
    heading = f"{_title('Path', path.problem)}: {path.failure}"
    return heading, lambda: [plot_path(path)] if len(path) else [], _rows(Summary.of(path.claims()).rows)


def _solution_set(solutions: SolutionSet) -> _Shown:
    rows = tuple(
        (number, solution.kind, solution.energy, solution.normal_force, solution.contact_length, solution.status.value)
        for number, solution in enumerate(solutions.solutions[:_MOST_ROWS])
    )
    table = Table(("", "kind", "energy", "normal force", "contact", "status"), rows, solutions.searched)
    count = f"{len(solutions)} solution{'s' if len(solutions) != 1 else ''}"
    heading = f"{count}, {'there are no others' if solutions.exhaustive else 'there may be more'}"
    field = solutions.solutions[0].problem.field if solutions.solutions else None
    drawn = solutions.solutions and (field is None or _small(field.mesh))
    return heading, lambda: [plot_solutions(solutions)] if drawn else [], table


def _problem(problem: ContactProblem) -> _Shown:
    material = problem.material
    what, value = "material", type(material).__name__.strip("_").lower()
    if isinstance(material, GradientMaterial):
        by_region = isinstance(material.coefficient, Mapping)
        what, value = material.scalar.constant, "by region" if by_region else _short_text(material.coefficient)
    rows: list[_Row] = [
        ("mesh", f"{problem.mesh.number_of_cells} cells, {problem.mesh.number_of_nodes} vertices"),
        ("elements", f"of order {problem.order}"),
        (what, value),
        (problem.load_names[0].replace("_", " "), _short_text(problem.body_force)),
        ("bedding", None if problem.bedding == 0.0 else _short_text(problem.bedding)),
        ("stiffening", "by the stress of the load" if problem.stiffening else None),
        *((f"support: {name}", _short_text(support)) for name, support in problem.supports.items()),
        *((f"load: {name}", _short_text(load)) for name, load in problem.tractions.items()),
        *((f"contact: {name}", _laws(contact)) for name, contact in problem.contact.items()),
        *_stated_margin(problem),
    ]
    heading = problem.title or (f"Scalar problem: {problem.kind}" if problem.kind else "Contact problem")
    return heading, lambda: [plot_problem(problem)] if _small(problem.mesh) else [], _rows(rows)


def _laws(contact: Contact) -> str:
    rubs = f"friction {contact.friction.name}" if contact.friction.acts else ""
    return rubs if contact.rubs else "; ".join(filter(None, (contact.normal.name, rubs)))


def _stated_margin(problem: ContactProblem) -> list[_Row]:
    if problem.mesh.number_of_cells > MANY_CELLS:
        return []
    try:
        return _margin(discretize(problem))
    except HemivarError as error:  # what is stated cannot be solved
        return [("refused", str(error))]


def _discrete(problem: DiscreteProblem) -> _Shown:
    law = problem.law
    split = isinstance(law, ContactLaw) and problem.contact.components > 1
    friction = law.friction if isinstance(law, ContactLaw) and split and law.friction.acts else None
    rows: list[_Row] = [
        ("unknowns", problem.unknowns),
        ("contact points", problem.contact_points),
        ("local components", problem.contact.components),
        ("normal law" if splits(law) else "law", law.name if problem.contact_points else None),
        ("friction", friction.name if friction and problem.contact_points else None),
        ("entries of the stiffness", problem.bulk.stiffness.nnz if isinstance(problem.bulk, Quadratic) else None),
        *_margin(problem),
        *(("warning", sentence) for sentence in problem.notes),
    ]
    stated = problem.origin
    shown = stated is not None and _small(stated.mesh)
    return _title("Discrete problem", problem), lambda: [plot_problem(stated)] if stated and shown else [], _rows(rows)


def _history(history: History) -> _Shown:
    drawn, heading = len(history.steps) > 1, _title("History", history.discrete.problem)
    return heading, lambda: [plot_march(history)] if drawn else [], _rows(Summary.of(history.claims()).rows)


def _study(study: Convergence) -> _Shown:
    drawn = len(study.levels) > 1
    heading = f"{type(study).__name__}: {len(study.levels)} {study.each}, errors against the {study.reference}"
    return heading, lambda: [plot_study(study)] if drawn else [], Table.of(study.rows(relative=True), brief=True)


def _sweep(sweep: Sweep) -> _Shown:
    drawn = len(sweep.axes) <= 2 and any(point.count for point in sweep.points)
    table = Table.of(sweep.rows())
    left = len(table.rows) - _MOST_ROWS
    if left > 0:
        table = Table(table.columns, table.rows[:_MOST_ROWS], f"and {left} more rows")
    heading = f"Sweep: {', '.join(axis.key for axis in sweep.axes)}"
    return heading, lambda: [plot_sweep(sweep)] if drawn else [], table


def _adaptive(adaptive: AdaptiveSolution) -> _Shown:
    whole = Table.of(adaptive.rows())
    kept = [k for k, name in enumerate(whole.columns) if name in _OF_A_MESH]
    table = Table(tuple(whole.columns[k] for k in kept), tuple(tuple(row[k] for k in kept) for row in whole.rows))
    heading = f"Adaptive solution: {adaptive.ended}, asked for {_number(adaptive.rtol)}"
    return heading, lambda: [plot_adaptive(adaptive)], table


def _stated_of(problem: DiscreteProblem) -> Figure:
    """The picture of what a discrete problem was made of."""
    if problem.origin is None:
        raise ProblemError("the problem was made of arrays and has no mesh to draw; draw its solution, solution.plot()")
    return plot_problem(problem.origin)


def _title(what: str, problem: DiscreteProblem) -> str:
    stated = problem.origin
    return f"{what}: {stated.title}" if stated is not None and stated.title else what


def _short_text(value: object) -> str:
    """A condition in a few words."""
    if callable(value):
        return "varies"
    inner = getattr(value, "value", None)
    if inner is not None and callable(inner):
        return f"{type(value).__name__}, varies"
    text = str(value)
    return text if len(text) <= 80 else text[:77] + "..."


def _number(value: float) -> str:
    return f"{value:.4g}" if math.isfinite(value) else str(value)


_KINDS: Mapping[type, Callable[..., _Shown]] = {
    Solution: _solution,
    Certificate: _certificate,
    Path: _path,
    SolutionSet: _solution_set,
    ContactProblem: _problem,
    DiscreteProblem: _discrete,
    History: _history,
    Convergence: _study,
    Sweep: _sweep,
    AdaptiveSolution: _adaptive,
}

_PICTURES: Mapping[type, Callable[..., Figure]] = {
    Solution: plot_solution,
    Certificate: plot_certificate,
    Path: plot_path,
    SolutionSet: plot_solutions,
    ContactProblem: plot_problem,
    DiscreteProblem: _stated_of,
    History: plot_march,
    Convergence: plot_study,
    Sweep: plot_sweep,
    AdaptiveSolution: plot_adaptive,
}


def show(value: object) -> None:
    """Show the picture of a value, and wait until its window is closed.

    Parameters
    ----------
    value : object
        What has a picture, such as a solution.

    Raises
    ------
    ProblemError
        There is no picture of it, or no window can be opened here.
    """
    figure = picture_of(value)
    with IMPORTS:
        import matplotlib.pyplot as plt
    backend = plt.get_backend().lower()
    if backend in _FILES_ONLY:
        raise ProblemError(
            f"no window can be opened here (matplotlib's backend is '{backend}'); write the picture to a file, "
            ".plot().savefig('figure.png')"
        )
    manager = plt.figure().canvas.manager
    assert manager is not None
    manager.canvas.figure = figure
    figure.set_canvas(manager.canvas)
    plt.show()


def frame_of(value: object) -> DataFrame:
    """A pandas DataFrame.

    What has ``rows()`` has these: a path a row for each point, a history one for each step. A certificate has a row for
    each claim; anything else has rows of ``name`` and ``value``, as a notebook shows it.
    """
    rows = getattr(value, "rows", None)
    if rows is not None:
        return data_frame(rows().by_name(), f"rows() of the {type(value).__name__}")
    if isinstance(value, Certificate):
        claims = value.claims()
        names = ("label", "sentence", "value", "doubt")
        return data_frame({name: [getattr(claim, name) for claim in claims] for name in names}, "certificate.claims()")
    table = table_of(value).record()
    return data_frame(dict(zip(("name", "value"), table.values(), strict=True)), "repr(value)")
