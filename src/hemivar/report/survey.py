"""The survey's section 5 from start to end: Figures 1 to 5, Table 1, and a report."""

from __future__ import annotations

import base64
import contextlib
import html
import itertools
import os
import platform
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from datetime import datetime
from importlib import metadata
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from hemivar.basics.disk import make_folder, read_bytes, write_text
from hemivar.basics.types import Array
from hemivar.discrete import DiscreteProblem
from hemivar.errors import FileError, HemivarError, ProblemError
from hemivar.fem import discretize, interpolate, v_norm
from hemivar.files import write_csv, write_json
from hemivar.gallery import SURVEY_DATA, survey
from hemivar.mesh import Mesh
from hemivar.report.bodies import plot_solution
from hemivar.report.contact_curves import plot_contact
from hemivar.report.histories import observed_order, plot_errors
from hemivar.report.saving import save
from hemivar.report.tables import PAPER_TABLE_1, Table, comparison_table, energy_norm_difference
from hemivar.solvers import METHODS, Controls, Solution, Status, solve, transfer_solution
from hemivar.systems import CondensedProblem, Workspace, condense

__all__ = ["FILES", "MOST_CELLS", "SURVEY_METHODS", "SurveyResult", "run_survey"]

#: Names of the files that :func:`run_survey` writes.
FILES = (
    *(f"figure{k}{end}" for k in range(1, 5) for end in (".png", ".pdf", "_contact.png", ".csv", ".json")),
    *("figure3_friction.csv", "figure5.png", "figure5.pdf", "methods.csv", "table1.csv", "table1.md"),
    *("runs.csv", "errors.csv", "orders.csv", "report.html"),
)
#: Largest number of cells along a side of the finest mesh of Table 1; the references have twice as many.
MOST_CELLS = 1024

#: The survey's methods and the names of ours that are nearest to its implementations.
SURVEY_METHODS: Mapping[str, str] = MappingProxyType(
    {
        "direct optimization": "direct-powell",
        "augmented Lagrangian": "augmented-lagrangian",
        "primal-dual active set": "active-set-krylov",
    }
)
_SHORT = MappingProxyType(
    {"direct optimization": "Direct", "augmented Lagrangian": "AL", "primal-dual active set": "PD"}
)
_DEFAULT = "newton"
_FIGURE_N = 32
#: Which method the captions of the survey's Figures 1 to 4 name.
_CAPTIONS = MappingProxyType(
    {
        "figure1": "augmented Lagrangian",
        "figure2": "direct optimization",
        "figure3": "primal-dual active set",
        "figure4": "direct optimization",
    }
)
#: Largest friction in Figure 3 with this mesh, known from independent computations.
_FIGURE_3 = MappingProxyType({32: 0.4986, 64: 0.4988, 128: 0.4990})
_DATA = "5.1"


@dataclass(frozen=True)
class SurveyResult:
    """What :func:`run_survey` found.

    Attributes
    ----------
    folder : Path
        Where the files are.
    files : tuple of Path
        All files written.
    failed : tuple of str
        One sentence for each file that could not be written; the run goes on without it.
    sizes : tuple of float
        Mesh sizes h of Figure 5.
    errors : mapping of (reference, method) to tuple of float
        V-norm errors for each h; empty if the run was interrupted before.
    orders : mapping of (reference, method) to float
        Observed orders.
    table1, runs, methods : Table
        Table 1; how every run of it ended; every method on Figures 1 to 4.
    largest_friction : mapping of n to float
        max |sigma_tau| in Figure 3 for 1/h = n.
    seconds : float
        Time of the whole run.
    interrupted : bool
        Whether the run was stopped before its end.
    """

    folder: Path
    files: tuple[Path, ...]
    failed: tuple[str, ...]
    sizes: tuple[float, ...]
    errors: Mapping[tuple[str, str], tuple[float, ...]]
    orders: Mapping[tuple[str, str], float]
    table1: Table
    runs: Table
    methods: Table
    largest_friction: Mapping[int, float]
    seconds: float
    interrupted: bool


def run_survey(
    out: str | Path,
    max_n: int = 128,
    method_time_limit: float = 60.0,
    progress: Callable[[str], None] | None = None,
) -> SurveyResult:
    """Reproduce the simulations of the survey (section 5.3) and write a report.

    Figures 1 to 4 at h = 1/32, each with the method of its caption and checked with all others; Figure 5, the errors
    in the V-norm against references at h = 1/(2 max_n), three methods by three references; Table 1. As in the
    survey, every method starts at h = 1/2 from zero and on every finer mesh from its own coarser solution, on the
    problem condensed onto the contact boundary.

    Every file is written as soon as its data are there. An interruption (Ctrl-C) ends the run with a report of what
    exists; a file that cannot be written does not, the result tells of it.

    Parameters
    ----------
    out : str or Path
        Folder for ``figure1`` ... ``figure5`` (.png, .pdf), ``figure1_contact`` ... (.png), ``figure1.csv``/``.json``
        ..., ``table1.csv``/``.md``, ``runs.csv``, ``methods.csv``, ``errors.csv``, ``orders.csv`` and ``report.html``.
    max_n : int
        The finest mesh of Table 1 and Figure 5 has h = 1/max_n; a power of two, at least 8.
    method_time_limit : float
        Limit in seconds for one solve; Table 1 says so where a method exceeds it.
    progress : function, optional
        Called with a sentence before every stage.

    Raises
    ------
    ProblemError
        ``max_n`` is not such a power of two, the limit is not positive, or the folder cannot be made.
    """
    if not 8 <= max_n <= MOST_CELLS or max_n & (max_n - 1):
        raise ProblemError(
            f"max_n = {max_n}; the meshes are halved from h = 1/2 on: take a power of two from 8 to {MOST_CELLS}"
        )
    if not method_time_limit > 0.0:
        raise ProblemError(f"method_time_limit = {method_time_limit}; give a positive number of seconds")
    run = _Run(make_folder(out), max_n, Controls(max_time=method_time_limit), progress or (lambda message: None))
    try:
        for number in range(1, 5):
            run.figure(f"figure{number}")
        run.levels()
        run.reference()
    except KeyboardInterrupt:
        run.interrupted = True
    run.report()
    return run.result()


@dataclass(frozen=True, eq=False)
class _Level:
    """One mesh of the convergence study: its problem and one solution for each method."""

    n: int
    problem: DiscreteProblem
    solutions: dict[str, Solution]

    @property
    def mesh(self) -> Mesh:
        assert self.problem.field is not None
        return self.problem.field.mesh


@dataclass
class _Run:
    """A run of the survey and what it has found so far."""

    folder: Path
    max_n: int
    controls: Controls
    say: Callable[[str], None]
    started: float = field(default_factory=time.perf_counter)
    files: list[Path] = field(default_factory=list)
    failed: dict[Path, str] = field(default_factory=dict)
    figures: dict[str, str] = field(default_factory=dict)
    method_rows: list[tuple[Any, ...]] = field(default_factory=list)
    friction: dict[int, float] = field(default_factory=dict)
    done: list[_Level] = field(default_factory=list)
    errors: dict[tuple[str, str], tuple[float, ...]] = field(default_factory=dict)
    interrupted: bool = False

    # ---- solving ----------------------------------------------------------------------------------------

    def solve(
        self, problem: DiscreteProblem, condensed: CondensedProblem, method: str, coarser: Solution | None
    ) -> Solution:
        guess = None if coarser is None else transfer_solution(coarser, problem)
        solution = solve(problem, METHODS[method], self.controls, initial=guess, workspace=Workspace.holding(condensed))
        if solution.status is Status.INTERRUPTED:
            raise KeyboardInterrupt
        return solution

    def figure(self, key: str) -> None:
        """One of Figures 1 to 4, and every method on its data."""
        caption = _CAPTIONS[key]
        number = key[-1]
        self.say(f"Figure {number}: h = 1/{_FIGURE_N}, {caption} and all other methods")
        solutions: dict[str, Solution] = {}
        n = 2
        while n <= _FIGURE_N:
            problem = discretize(survey(key, n))
            condensed = condense(problem)
            solutions = {
                name: self.solve(problem, condensed, name, solutions.get(name))
                for name, method in METHODS.items()
                if method.refuse(problem) is None
            }
            n *= 2
        shown = solutions[SURVEY_METHODS[caption]]
        x, y = SURVEY_DATA[key].body_force
        title = f"Figure {number}: {caption}"
        drawn = plot_solution(shown, title=title, note=f"$f_0 = ({x:g}, {y:g})$, h = 1/{_FIGURE_N}")
        self.save(drawn, key, ".png", ".pdf")
        self.save(plot_contact(shown, title=title), f"{key}_contact", ".png")
        self.put(f"{key}.csv", lambda path: write_csv(shown, path))
        self.put(f"{key}.json", lambda path: write_json(shown, path))
        self.figures[key] = f"Figure {number}. {SURVEY_DATA[key].text}. Method: {caption} ({shown.method})."
        table = comparison_table(solutions, reference=solutions[_DEFAULT])
        self.method_rows += [(number, *row) for row in table.rows]
        self.write(self.methods_table(), "methods.csv")
        if key == "figure3":
            self.largest_friction(solutions[_DEFAULT])
        self.report()

    def largest_friction(self, coarse: Solution) -> None:
        """max |sigma_tau| in Figure 3 on three meshes."""
        solution = coarse
        for n in _FIGURE_3:
            if n > self.max_n and n > _FIGURE_N:
                break
            if n > _FIGURE_N:
                problem = discretize(survey("figure3", n))
                solution = self.solve(problem, condense(problem), _DEFAULT, solution)
            self.friction[n] = float(np.abs(solution.friction).max())
        self.write(self.friction_table(), "figure3_friction.csv")

    def level(self, n: int, names: tuple[str, ...]) -> _Level:
        problem = discretize(survey(_DATA, n))
        condensed = condense(problem)
        coarser = self.done[-1].solutions if self.done else {}
        solutions = {name: self.solve(problem, condensed, name, coarser.get(name)) for name in names}
        return _Level(n, problem, solutions)

    def levels(self) -> None:
        """Table 1, mesh by mesh."""
        n = 2
        while n <= self.max_n:
            self.say(f"Table 1 and Figure 5: h = 1/{n}")
            self.done.append(self.level(n, (*SURVEY_METHODS.values(), _DEFAULT)))
            if n >= 8:
                self.write(self.table1(), "table1.csv")
                self.put("table1.md", lambda path: write_text(path, self.table1().markdown()))
            self.write(self.runs_table(), "runs.csv")
            self.report()
            n *= 2

    def reference(self) -> None:
        """Figure 5: errors against the solutions of each method at h = 1/(2 max_n)."""
        n = 2 * self.max_n
        self.say(f"Figure 5: references at h = 1/{n}")
        finest = self.level(n, tuple(SURVEY_METHODS.values()))
        self.say("Figure 5: errors")
        errors = _errors(self.done, finest)
        self.errors = {
            (_SHORT[reference], _SHORT[method]): tuple(errors[SURVEY_METHODS[reference], SURVEY_METHODS[method]])
            for reference in SURVEY_METHODS
            for method in SURVEY_METHODS
        }
        self.done.append(finest)
        self.write(self.errors_table(), "errors.csv")
        self.write(self.orders_table(), "orders.csv")
        self.write(self.runs_table(), "runs.csv")
        drawn = plot_errors(
            np.array(self.sizes()),
            {key: np.array(values) for key, values in self.errors.items()},
            title="Figure 5: errors, data (5.1)",
            reference_size=1.0 / n,
        )
        self.save(drawn, "figure5", ".png", ".pdf")
        self.figures["figure5"] = (
            f"Figure 5. Errors in the V-norm against the solutions at h = 1/{n} of each method; "
            f"{SURVEY_DATA[_DATA].text}. The errors at h = 2/{n} (shaded) are too small, because the reference shares "
            "much of its error with them; they are left out of the orders."
        )

    # ---- tables ---------------------------------------------------------------------------------------------

    def sizes(self) -> tuple[float, ...]:
        return tuple(1.0 / level.n for level in self.done if level.n <= self.max_n)

    def orders(self) -> dict[tuple[str, str], float]:
        sizes = np.array(self.sizes())
        trusted = sizes > 1.5 / self.max_n
        return {key: observed_order(sizes[trusted], np.array(values)[trusted]) for key, values in self.errors.items()}

    def table1(self) -> Table:
        columns = [level for level in self.done if 8 <= level.n <= self.max_n]
        rows: list[tuple[Any, ...]] = []
        for label, name in (*SURVEY_METHODS.items(), (_DEFAULT, _DEFAULT)):
            solutions = [level.solutions[name] for level in columns]
            paper = PAPER_TABLE_1.get(label)
            if paper is not None:
                rows.append((label, "time, s", "survey", *_paper(paper.seconds, columns)))
            rows.append((label, "time, s", "hemivar", *(self.time(s, "iterate") for s in solutions)))
            with_all = (self.time(s, "condense", "iterate", "recover") for s in solutions)
            rows.append((label, "time with condensation, s", "hemivar", *with_all))
            if paper is not None and paper.count_name:
                rows.append((label, paper.count_name, "survey", *_paper(paper.counts, columns)))
            if label == "direct optimization":
                rows.append((label, "functional evaluations", "hemivar", *(s.evaluations for s in solutions)))
            elif label == "primal-dual active set":
                rows.append((label, "set iterations", "hemivar", *(s.steps for s in solutions)))
            elif name == _DEFAULT:
                rows.append((label, "steps", "hemivar", *(s.steps for s in solutions)))
        names = ("method", "quantity", "source", *(f"h = 1/{level.n}" for level in columns))
        return Table(names, tuple(rows), "Table 1: computation time and number of iterations, data (5.1)")

    def time(self, solution: Solution, *stages: str) -> float | str:
        if solution.status is Status.MAX_TIME:
            return f"> {self.controls.max_time:g} s"
        return float(f"{sum(solution.timings.get(stage, 0.0) for stage in stages):.3g}")

    def runs_table(self) -> Table:
        """How every run ended."""
        rows = []
        for level in self.done:
            default = level.solutions.get(_DEFAULT)
            for name, solution in level.solutions.items():
                apart = None if default is None else energy_norm_difference(solution, default)
                rows.append(
                    (
                        f"1/{level.n}", name, solution.status.value, solution.residual.relative, apart,
                        solution.steps, solution.evaluations, solution.timings.get("iterate"),
                        solution.timings.get("condense"),
                    )
                )  # fmt: skip
        columns = (
            "h", "method", "status", "residual", "difference", "steps", "evaluations", "iterate (s)", "condense (s)",
        )  # fmt: skip
        return Table(columns, tuple(rows), "Every run of Table 1 and Figure 5")

    def methods_table(self) -> Table:
        columns = (
            "figure", "method", "status", "residual", "energy", "difference", "steps", "evaluations", "condense (s)",
            "iterate (s)", "recover (s)",
        )  # fmt: skip
        return Table(columns, tuple(self.method_rows), f"Every method on Figures 1 to 4, h = 1/{_FIGURE_N}")

    def friction_table(self) -> Table:
        rows = tuple((f"1/{n}", value, _FIGURE_3[n]) for n, value in self.friction.items())
        return Table(("h", "hemivar", "expected"), rows, "Largest friction in Figure 3 (bound 0.5)")

    def errors_table(self) -> Table:
        columns = ("reference", "method", *(f"h = {_h(h)}" for h in self.sizes()))
        rows = tuple((*key, *values) for key, values in self.errors.items())
        return Table(columns, rows, "Figure 5: errors in the V-norm")

    def orders_table(self) -> Table:
        sizes = self.sizes()
        columns = (
            "reference", "method", "fitted",
            *(f"{_h(coarse)} to {_h(fine)}" for coarse, fine in itertools.pairwise(sizes)),
        )  # fmt: skip
        rows = []
        orders = self.orders()
        for key, values in self.errors.items():
            logs = np.log2(np.array(values))
            rows.append((*key, round(orders[key], 3), *(round(float(step), 3) for step in -np.diff(logs))))
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
            self.files.append(path)
            self.failed.pop(path, None)

    def write(self, table: Table, name: str) -> None:
        self.put(name, table.write_csv)

    def save(self, figure: Any, name: str, *suffixes: str) -> None:
        for suffix in suffixes:
            self.put(f"{name}{suffix}", lambda path: save(figure, path))

    def report(self) -> None:
        """Write ``report.html``, one self-contained page of what there is."""
        parts = [_HEAD, "<h1>Simulations of the survey, recomputed</h1>", f"<p>{_INTRODUCTION}</p>"]
        if self.interrupted:
            parts.append("<p class=warning>The run was interrupted; this is what existed.</p>")
        for key in _CAPTIONS:
            if key in self.figures:
                parts.append(self._image(key, self.figures[key]))
        if self.friction:
            parts += [
                self.friction_table().html(),
                "<p>Figure 3 is knife-edge: with linear elements every node sticks, just below the bound.</p>",
            ]
        if self.method_rows:
            parts += [self.methods_table().html(), f"<p>{_DIFFERENCE}</p>"]
        if any(level.n >= 8 for level in self.done):
            parts += [self.table1().html(), f"<p>{_TABLE_NOTE}</p>"]
        if self.errors:
            parts += [
                self._image("figure5", self.figures.get("figure5", "")),
                self.orders_table().html(),
                "<p>The orders stay below 1: the corners of the body are singular.</p>",
                self.errors_table().html(),
            ]
        if self.done:
            parts.append(self.runs_table().html())
        parts += ["<h2>Machine</h2>", _machine(), "</body></html>\n"]
        self.put("report.html", lambda path: write_text(path, "\n".join(parts)))

    def _image(self, name: str, caption: str) -> str:
        pictures = []
        for stem in (name, f"{name}_contact"):
            path = self.folder / f"{stem}.png"
            if path not in self.files:
                continue
            with contextlib.suppress(FileError):  # it may have been removed since
                data = base64.b64encode(read_bytes(path)).decode("ascii")
                pictures.append(f'<img alt="{html.escape(stem)}" src="data:image/png;base64,{data}">')
        return f"<figure>{''.join(pictures)}<figcaption>{html.escape(caption)}</figcaption></figure>"

    def result(self) -> SurveyResult:
        return SurveyResult(
            folder=self.folder,
            files=tuple(dict.fromkeys(self.files)),
            failed=tuple(self.failed.values()),
            sizes=self.sizes(),
            errors=MappingProxyType(dict(self.errors)),
            orders=MappingProxyType(self.orders()),
            table1=self.table1(),
            runs=self.runs_table(),
            methods=self.methods_table(),
            largest_friction=MappingProxyType(dict(self.friction)),
            seconds=time.perf_counter() - self.started,
            interrupted=self.interrupted,
        )


def _errors(levels: list[_Level], finest: _Level) -> dict[tuple[str, str], list[float]]:
    """V-norm of the difference of every solution to every reference, by (reference, method).

    The meshes are nested, so all solutions are carried from mesh to mesh, exactly, up to the finest.
    """
    names = list(SURVEY_METHODS.values())
    carried = np.zeros((levels[0].mesh.number_of_nodes, 0, 2))
    for level, finer in zip(levels, [*levels[1:], finest], strict=True):
        own: list[Array] = [level.solutions[name].displacement for name in names]
        carried = np.concatenate([carried, np.stack(own, axis=1)], axis=1)
        carried = interpolate(level.mesh, carried, finer.mesh)
    return {
        (reference, method): [
            v_norm(finest.mesh, finest.solutions[reference].displacement - carried[:, number * len(names) + k])
            for number in range(len(levels))
        ]
        for reference in names
        for k, method in enumerate(names)
    }


def _paper(values: tuple[Any, ...], columns: list[_Level]) -> list[Any]:
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
    "Forces are mirrored with respect to the contact boundary, as in the survey. Its test law is convex, so the "
    "solution is unique and all methods must agree."
)
_DIFFERENCE = (
    "Difference: distance to the default method in the energy norm, relative. Direct optimization by Powell's method "
    "ends by its own stopping rule, on small changes of the energy, which leaves it inaccurate in the displacement."
)
_TABLE_NOTE = (
    "Assembly of the stiffness matrix is excluded, as in the survey. The first time is the iteration alone, on the "
    "condensed problem; the second one adds the condensation onto the contact boundary, which all methods share, and "
    "the recovery of the other unknowns. The survey's times are of its authors' machine. Every method starts from its "
    "own solution on the coarser mesh."
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
