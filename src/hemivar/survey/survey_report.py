"""The survey's section 5 from start to end: Figures 1 to 5, Table 1, and a page, drawn while they are computed."""

from __future__ import annotations

import base64
import html
import itertools
import os
import platform
import time
from collections.abc import Callable, Sequence
from datetime import datetime
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from hemivar.basics.disk import make_folder, write_text
from hemivar.basics.generators import result_of
from hemivar.errors import HemivarError
from hemivar.files import write_csv, write_json
from hemivar.gallery.survey_problems import SURVEY_DATA
from hemivar.report.bodies import plot_solution
from hemivar.report.contact_curves import plot_contact
from hemivar.report.loglog import plot_errors
from hemivar.report.saving import save, svg
from hemivar.report.tables import PAPER_TABLE_1, Table, comparison_table
from hemivar.solvers import Solution, Status
from hemivar.survey.survey_runs import (
    CAPTIONS,
    DATA,
    DEFAULT,
    EXPECTED_FRICTION,
    FIGURE_CELLS,
    SURVEY_METHODS,
    MeshRuns,
    SurveyEvent,
    SurveyOptions,
    SurveyRuns,
    survey,
)
from hemivar.workflows.events import Event, Phase

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["FILES", "SurveyReport", "run_survey"]

#: Names of the files that :func:`run_survey` writes.
FILES = (
    *(f"figure{k}{end}" for k in range(1, 5) for end in (".png", ".pdf", "_contact.png", ".csv", ".json")),
    *("figure3_friction.csv", "figure5.png", "figure5.pdf", "methods.csv", "table1.csv", "table1.md"),
    *("runs.csv", "errors.csv", "orders.csv", "bounds.csv", "report.html"),
)


def run_survey(
    out: str | Path,
    max_n: int = 128,
    method_time_limit: float = 60.0,
    bounds: bool = True,
    progress: Callable[[Phase], None] | None = None,
) -> SurveyReport:
    """Reproduce the simulations of the survey (section 5.3) and write a report.

    Figures 1 to 4 at h = 1/32, each with the method of its caption and checked with all others; Figure 5, the errors
    in the V-norm against references at h = 1/(2 max_n), three methods by three references, and guaranteed bounds of the
    distance to the exact solution; Table 1. As in the
    survey, every method starts at h = 1/2 from zero and on every finer mesh from its own coarser solution, on the
    problem condensed onto the contact boundary.

    Every file is written as soon as its data are there. An interruption (Ctrl-C) ends the run with a report of what
    exists; a file that cannot be written does not, the result tells of it.

    Parameters
    ----------
    out : str or Path
        Folder for ``figure1`` ... ``figure5`` (.png, .pdf), ``figure1_contact`` ... (.png), ``figure1.csv``/``.json``
        ..., ``table1.csv``/``.md``, ``runs.csv``, ``methods.csv``, ``errors.csv``, ``orders.csv``, ``bounds.csv`` and
        ``report.html``.
    max_n : int
        The finest mesh of Table 1 and Figure 5 has h = 1/max_n; a power of two, at least 8.
    method_time_limit : float
        Limit in seconds for one solve; Table 1 says so where a method exceeds it.
    bounds : bool
        Bound the distance of every solution of Figure 5 to the exact one, too.
    progress : function, optional
        Called with every :class:`~hemivar.workflows.Phase` when it begins.

    Returns
    -------
    SurveyReport

    Raises
    ------
    ProblemError
        ``max_n`` is not such a power of two, the limit is not positive, or the folder cannot be made.
    """
    options = SurveyOptions(max_n, method_time_limit, bounds)
    report = SurveyReport(make_folder(out), options)

    def on_event(event: Event) -> None:
        if isinstance(event, Phase) and progress is not None:
            progress(event)
        report(event)

    report.runs = result_of(survey(options), on_event)
    report.page()
    return report


class SurveyReport:
    """Writes the files of a survey that is at work, each as soon as its data are there.

    Attributes
    ----------
    folder : Path
        Where the files are.
    runs : SurveyRuns
        What was found so far.
    files : list of Path
        Those written.
    failed : dict of Path to str
        One sentence for each file that could not be written; the run goes on without it.
    """

    def __init__(self, folder: Path, options: SurveyOptions) -> None:
        self.folder = folder
        self.runs = SurveyRuns(options)
        self.files: list[Path] = []
        self.failed: dict[Path, str] = {}
        self.started = time.perf_counter()
        self._drawn: dict[str, bytes] = {}

    def __call__(self, event: Event) -> None:
        """Write what an event brings."""
        if not isinstance(event, SurveyEvent):
            return
        self.runs = event.runs
        if event.part in CAPTIONS:
            self._figure(event.part)
        elif event.part == "friction":
            self.write(self._friction_table(), "figure3_friction.csv")
        elif event.part == "mesh":
            if event.runs.meshes[-1].n >= 8:
                self.write(self.table1(), "table1.csv")
                self.put("table1.md", lambda path: write_text(path, f"{self.table1().markdown()}\n{_TABLE_NOTE}\n"))
            self.write(Table.of(self.runs.rows()), "runs.csv")
        else:
            if event.part == "bounds":
                self.write(self.bounds_table(), "bounds.csv")
            self._convergence()
        self.page()

    def _figure(self, key: str) -> None:
        shown = self._shown(key)
        x, y = SURVEY_DATA[key].body_force
        title = f"Figure {key[-1]}: {CAPTIONS[key]}"
        certificate = shown.certify()
        note = f"$f_0 = ({x:g}, {y:g})$, h = 1/{FIGURE_CELLS}"
        self.save(plot_solution(shown, title=title, note=note, certificate=certificate), key, ".png", ".pdf")
        self.save(plot_contact(shown, title=title, certificate=certificate), f"{key}_contact", ".png")
        self.put(f"{key}.csv", lambda path: write_csv(shown, path))
        self.put(f"{key}.json", lambda path: write_json(shown, path))
        self.write(self.methods_table(), "methods.csv")

    def _convergence(self) -> None:
        runs = self.runs
        self.write(self._errors_table(), "errors.csv")
        self.write(self._orders_table(), "orders.csv")
        self.write(Table.of(self.runs.rows()), "runs.csv")
        drawn = plot_errors(
            np.array(runs.sizes),
            {key: np.array(values) for key, values in runs.errors.items()},
            title="Figure 5: errors, data (5.1)",
            reference_size=0.5 / runs.options.max_n,
            bounds={key: np.array(values) for key, values in runs.bounds.items()} or None,
        )
        self.save(drawn, "figure5", ".png", ".pdf")

    def _shown(self, key: str) -> Solution:
        """The solution that a figure draws, by the method of its caption."""
        return self.runs.figures[key][SURVEY_METHODS[CAPTIONS[key]]]

    # ---- tables ---------------------------------------------------------------------------------------------

    def table1(self) -> Table:
        """The survey's Table 1 beside ours."""
        columns = [level for level in self.runs.meshes if 8 <= level.n <= self.runs.options.max_n]
        rows: list[tuple[object, ...]] = []
        for label, name in (*SURVEY_METHODS.items(), (DEFAULT, DEFAULT)):
            solutions = [level.solutions[name] for level in columns]
            paper = PAPER_TABLE_1.get(label)
            if paper is not None:
                rows.append((label, "time, s", "survey", *_paper(paper.seconds, columns)))
            rows.append((label, "time, s", "hemivar", *(self._time(s, "iterate") for s in solutions)))
            with_all = (self._time(s, "condense", "iterate", "recover") for s in solutions)
            rows.append((label, "time with condensation, s", "hemivar", *with_all))
            if paper is not None and paper.count_name:
                rows.append((label, paper.count_name, "survey", *_paper(paper.counts, columns)))
            if label == "direct optimization":
                rows.append((label, "functional evaluations", "hemivar", *(s.evaluations for s in solutions)))
            elif label == "primal-dual active set":
                rows.append((label, "set iterations", "hemivar", *(s.steps for s in solutions)))
            elif name == DEFAULT:
                rows.append((label, "steps", "hemivar", *(s.steps for s in solutions)))
        names = ("method", "quantity", "source", *(f"h = 1/{level.n}" for level in columns))
        return Table(names, tuple(rows), "Table 1: computation time and number of iterations, data (5.1)")

    def _time(self, solution: Solution, *stages: str) -> float | str:
        if solution.status is Status.MAX_TIME:
            return f"> {self.runs.options.method_time_limit:g} s"
        return float(f"{sum(solution.timings.get(stage, 0.0) for stage in stages):.3g}")

    def methods_table(self) -> Table:
        """Every method on Figures 1 to 4."""
        tables = {
            key: comparison_table(solutions, reference=solutions[DEFAULT])
            for key, solutions in self.runs.figures.items()
        }
        columns = (
            "figure", "method", "status", "residual", "energy", "difference", "steps", "evaluations", "condense (s)",
            "iterate (s)", "recover (s)",
        )  # fmt: skip
        rows = tuple((key[-1], *row) for key, table in tables.items() for row in table.rows)
        return Table(columns, rows, f"Every method on Figures 1 to 4, h = 1/{FIGURE_CELLS}")

    def _friction_table(self) -> Table:
        rows = tuple((f"1/{n}", value, EXPECTED_FRICTION[n]) for n, value in self.runs.friction.items())
        return Table(("h", "hemivar", "expected"), rows, "Largest friction in Figure 3 (bound 0.5)")

    def _errors_table(self) -> Table:
        columns = ("reference", "method", *(f"h = {_h(h)}" for h in self.runs.sizes))
        rows = tuple((*key, *values) for key, values in self.runs.errors.items())
        return Table(columns, rows, "Figure 5: errors in the V-norm")

    def bounds_table(self) -> Table:
        """Guaranteed bounds of the distance to the exact solution over the errors that are measured."""
        columns = ("method", "", *(f"h = {_h(h)}" for h in self.runs.sizes))
        rows: list[tuple[object, ...]] = []
        for method, bounds in self.runs.bounds.items():
            rows.append((method, "bound", *bounds))
            for (reference, of), errors in self.runs.errors.items():
                if of == method:
                    ratios = (bound / error for bound, error in zip(bounds, errors, strict=True))
                    rows.append((method, f"bound / error against {reference}", *ratios))
        return Table(columns, tuple(rows), "Figure 5: bounds of the distance to the exact solution in the V-norm")

    def _orders_table(self) -> Table:
        columns = (
            "reference", "method", "fitted",
            *(f"{_h(coarse)} to {_h(fine)}" for coarse, fine in itertools.pairwise(self.runs.sizes)),
        )  # fmt: skip
        rows = []
        for key, values in self.runs.errors.items():
            falls = -np.diff(np.log2(np.array(values)))
            rows.append((*key, round(self.runs.orders[key], 3), *(round(float(step), 3) for step in falls)))
        return Table(columns, tuple(rows), "Figure 5: observed orders (fitted without the finest mesh)")

    # ---- files ------------------------------------------------------------------------------------------------

    def put(self, name: str, write: Callable[[Path], object]) -> None:
        """Write a file; one that cannot be written is remembered, and what comes next goes on."""
        path = self.folder / name
        try:
            write(path)
        except (HemivarError, OSError) as error:
            self.failed[path] = str(error)
        else:
            self.files += [] if path in self.files else [path]
            self.failed.pop(path, None)

    def write(self, table: Table, name: str) -> None:
        """Write a table."""
        self.put(name, table.write_csv)

    def save(self, figure: Figure, name: str, *suffixes: str) -> None:
        """Write a figure in several forms, and keep it for the page: lines that a browser shrinks make patterns."""
        self._drawn[name] = svg(figure)
        for suffix in suffixes:
            self.put(f"{name}{suffix}", lambda path: save(figure, path))

    def page(self) -> None:
        """Write ``report.html``, one self-contained page of what there is."""
        runs = self.runs
        parts = [_HEAD, "<h1>Simulations of the survey, recomputed</h1>", f"<p>{_INTRODUCTION}</p>"]
        if runs.interrupted:
            parts.append("<p class=warning>The run was interrupted; this is what existed.</p>")
        for key in runs.figures:
            text = f"Figure {key[-1]}. {SURVEY_DATA[key].text}. Method: {CAPTIONS[key]} ({self._shown(key).method})."
            text += _POWELL if CAPTIONS[key] == "direct optimization" else ""
            parts.append(self._image(key, text))
        if runs.friction:
            parts += [
                self._friction_table().html(),
                "<p>Figure 3 is knife-edge: with linear elements every node sticks, just below the bound.</p>",
            ]
        if runs.figures:
            parts += [self.methods_table().html(), f"<p>{_DIFFERENCE}</p>"]
        if any(level.n >= 8 for level in runs.meshes):
            parts += [self.table1().html(), f"<p>{_TABLE_NOTE}</p>"]
        if runs.errors:
            parts += [
                self._image("figure5", _FIGURE_5.format(2 * runs.options.max_n, SURVEY_DATA[DATA].text)),
                self._orders_table().html(),
                "<p>The orders stay below 1: the corners of the body are singular.</p>",
                self._errors_table().html(),
            ]
        if runs.bounds:
            parts += [self.bounds_table().html(), f"<p>{_BOUNDS}</p>"]
            parts += [
                f"<p class=warning>No bound but an estimate: {html.escape(why)}.</p>" for why in runs.not_guaranteed
            ]
        if runs.meshes:
            parts.append(Table.of(self.runs.rows(), "Every run of Table 1 and Figure 5").html())
        parts += ["<h2>Machine</h2>", _machine(), "</body></html>\n"]
        self.put("report.html", lambda path: write_text(path, "\n".join(parts)))

    def _image(self, name: str, caption: str) -> str:
        pictures = []
        for stem in (name, f"{name}_contact"):
            if stem in self._drawn:
                data = base64.b64encode(self._drawn[stem]).decode("ascii")
                pictures.append(f'<img alt="{html.escape(stem)}" src="data:image/svg+xml;base64,{data}">')
        return f"<figure>{''.join(pictures)}<figcaption>{html.escape(caption)}</figcaption></figure>"


def _paper(values: Sequence[float], columns: list[MeshRuns]) -> list[float | None]:
    """The survey's numbers for the meshes shown; None where it has none."""
    known = dict(zip((8, 16, 32, 64, 128), values, strict=True))
    return [known.get(level.n) for level in columns]


def _h(h: float) -> str:
    return f"1/{round(1.0 / h)}"


def _machine() -> str:
    facts = {
        "date": datetime.now().astimezone().strftime("%Y-%m-%d %H:%M %Z"),
        "machine": f"{platform.system()} {platform.machine()}, {os.cpu_count()} processors",
        "python": platform.python_version(),
    }
    for package in ("hemivar", "numpy", "scipy", "scikit-fem", "matplotlib"):
        try:
            facts[package] = metadata.version(package)
        except metadata.PackageNotFoundError:
            facts[package] = "not installed as a package"
    rows = "".join(f"<tr><td>{html.escape(k)}</td><td>{html.escape(v)}</td></tr>" for k, v in facts.items())
    return f"<table><tbody>{rows}</tbody></table>"


_INTRODUCTION = (
    "Section 5.3 of <em>A survey of numerical methods for hemivariational inequalities with applications to Contact "
    'Mechanics</em> (<a href="https://arxiv.org/abs/2103.14518">arXiv 2103.14518</a>): unit square, clamped at '
    "x = 0, foundation at y = 0, linear elements on squares cut into four triangles, contact laws at the nodes. "
    "Arrows show the force on the body; the survey mirrors them at the contact boundary. Its test law is convex, so "
    "the solution is unique and all methods must agree."
)
_POWELL = (
    " Powell's method stops on small changes of the energy and leaves the displacement inaccurate; the exact solution "
    "is unique."
)
_DIFFERENCE = (
    "Difference: distance to the default method in the energy norm, relative. Direct optimization by Powell's method "
    "ends by its own stopping rule, on small changes of the energy, which leaves it inaccurate in the displacement."
)
_TABLE_NOTE = (
    "Assembly of the stiffness matrix is excluded, as in the survey. The first time is the iteration alone, on the "
    "condensed problem; the second one adds the condensation onto the contact boundary, which all methods share, and "
    "the recovery of the other unknowns. The survey's times are of its authors' machine. Every method starts from its "
    "own solution on the coarser mesh. Iterations differ from the survey's, which takes SciPy's own stopping criteria; "
    "hemivar stops by the residual. Set iterations count how often points are assigned to the sets: the survey solves "
    "a simplified problem for given sets by an inexact Newton method, hemivar the linear problem of the sets exactly."
)
_FIGURE_5 = (
    "Figure 5. Errors in the V-norm against the solutions at h = 1/{0} of each method; {1}. The errors at h = 2/{0} "
    "(shaded) are too small, because the reference shares much of its error with them; they are left out of the orders."
    " The bound of direct optimization jumps where Powell's method stops early: it sees what is left unsolved."
)
_BOUNDS = (
    "The broad lines of Figure 5 are upper bounds of the distance to the exact solution of the continuous problem, in "
    "the V-norm. Each is computed from one solution alone, without a reference, an unknown constant or an assumption "
    "on how smooth the exact solution is. Errors against a reference miss what both share; the bounds miss nothing, so "
    "that on the finest meshes they are farther above. They also see where a method has left a solution unfinished."
)
_HEAD = """<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><title>Simulations of the survey, recomputed</title>
<style>
body { font: 15px/1.5 system-ui, sans-serif; max-width: 62rem; margin: 2rem auto; padding: 0 1rem; color: #1b1b1b; }
h1 { font-size: 1.5rem; } h2 { font-size: 1.15rem; margin-top: 2rem; }
figure { margin: 2rem 0; } figure img { max-width: 49%; height: auto; vertical-align: top; }
figcaption { font-size: 0.9rem; color: #333; margin-top: 0.4rem; }
table { border-collapse: collapse; margin: 1.5rem 0 0.6rem; font-size: 0.82rem; display: block; overflow-x: auto; }
caption { text-align: left; font-weight: 600; padding-bottom: 0.3rem; }
th, td { padding: 0.15rem 0.6rem; border-bottom: 1px solid #ddd; text-align: left; white-space: nowrap; }
.number { text-align: right; font-variant-numeric: tabular-nums; }
.warning { color: #a33; font-weight: 600; }
</style></head><body>"""
