"""``hemivar certify``, ``compare`` and ``survey``: what is known about a solution, methods in one table, a survey."""

from __future__ import annotations

import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, ClassVar

from hemivar.basics.disk import shown
from hemivar.basics.first_use import cached_property
from hemivar.cli import options as opt
from hemivar.cli.command import Command, Done, OnProblem
from hemivar.cli.options import check_limits, controls_of, method_named, option
from hemivar.cli.outputs import Files, check_folder, one_line
from hemivar.cli.printing import SolveView, StageView, console, print_table, print_unsaid
from hemivar.cli.terminal import quiet_logging
from hemivar.errors import ProblemError

if TYPE_CHECKING:
    from hemivar.solvers import Solver
    from hemivar.survey.survey_report import SurveyReport
    from hemivar.workflows import Event

__all__ = ["CertifyCommand", "CompareCommand", "SurveyCommand"]

#: Cells up to which the distance to the exact solution is bounded unless that is refused: half a minute.
_CELLS = {2: 300_000, 3: 60_000}


class CertifyCommand(OnProblem):
    """Certify a solution: residuals, uniqueness, guaranteed distances to the discrete and to the exact solution, kind.

    The distance to the exact solution is left out on large meshes, unless --exact asks for it. Exit code 0 if the
    residual is below the tolerance, 1 if not.
    """

    solution: Annotated[Path | None, option("Solution to certify, .json or .vtu (solve first).", of="FILE")] = None
    json: opt.Json = None
    rtol: opt.Rtol = None
    max_time: opt.MaxTime = None
    exact: opt.Exact = None
    given: opt.Given = None

    def check(self) -> None:
        path = self.solution
        if path is not None and path.suffix.lower() not in (".json", ".vtu"):
            raise ProblemError(f"--solution {path}: the name must end in .json or .vtu")
        if path is not None and not path.is_file():
            raise ProblemError(f"--solution {path}: there is no such file; write it with 'hemivar solve'")

    @property
    def read(self) -> Path | None:
        return self.solution

    def work(self) -> Done:
        from hemivar.workflows import CertifyOptions, certify, result_of

        session, discrete = self.session, self.discrete()
        view = SolveView(quiet=True)
        unknowns = multiplier = None
        if self.solution is not None:
            from hemivar.files import read_solution

            unknowns, multiplier = read_solution(self.solution, discrete)
        mesh, rtol = session.stated.problem.mesh, CertifyOptions.tolerance if self.rtol is None else self.rtol
        exact = mesh.number_of_cells <= _CELLS[mesh.dim] if self.exact is None else self.exact
        options = CertifyOptions(rtol, controls_of(session.stated, None, self.max_time), session.method, exact)
        certificate = result_of(certify(discrete, unknowns, multiplier, options), view)
        if view.solution is not None:
            print(f"solution          solved here by {view.solution.method} ({view.solution.status.value})")
        else:
            print(f"solution          {shown(str(self.solution))}")
            print(f"multiplier        {'recomputed from equilibrium' if multiplier is None else 'read from the file'}")
        print_unsaid(certificate.lines(whole=True), discrete.notes)
        if self.exact is None and not exact:
            print("exact solution    its distance is left out because the mesh is large; --exact computes it")
        record = {
            "problem": session.stated.name,
            "solution": None if self.solution is None else str(self.solution),
            "fulfilled": certificate.stationary,
            "certificate": certificate.record(),
        }
        return Done({"--json": record}, certificate.stationary)


#: Seconds that a method has.
_SECONDS = 60.0


class CompareCommand(OnProblem):
    """Solve a contact problem by several methods and compare them in one table.

    A method ends after 60 s unless --max-time says otherwise. The reference is newton, or multigrid where no
    factorisation fits into the memory. Exit code 0 if it converged,
    whatever the others did.
    """

    methods: Annotated[str | None, option("Methods to compare (all).", of="A,B,...")] = None
    json: opt.Json = None
    csv: opt.Csv = None
    rtol: opt.Rtol = None
    max_time: opt.MaxTime = None
    max_steps: opt.MaxSteps = None
    given: opt.Given = None
    names_files: ClassVar = False

    @cached_property
    def solvers(self) -> dict[str, Solver]:
        """The methods to compare, by name."""
        from hemivar.solvers import METHODS

        names = METHODS if self.methods is None else [name.strip() for name in self.methods.split(",")]
        return {name: method_named(name) for name in names}

    def check(self) -> None:
        _ = self.solvers  # a name that is not known is refused

    def work(self) -> Done:
        from hemivar.report.tables import Table
        from hemivar.workflows import CompareOptions, Condensed, compare, result_of

        stated = self.session.stated
        most = self.max_time or stated.solver.max_time or _SECONDS
        controls = controls_of(stated, self.rtol, most, self.max_steps)
        discrete = self.discrete()
        with StageView(console()) as stages:

            def show(event: Event) -> None:
                if not isinstance(event, Condensed):
                    return stages(event)
                if event.seconds is None:
                    print(f"condensation      none: {event.reason}")
                else:
                    print(f"condensation      {event.seconds:.3g} s, shared by all methods, not in the times below")
                limits = f"{controls.max_time:g} s for each method, relative residual {controls.rtol:.0e}"
                return print(f"limits            {limits}\n")

            comparison = result_of(compare(discrete, CompareOptions(self.solvers, controls)), show)
        table = Table.of(comparison.rows(), units=stated.units)
        print_table(console(), table)
        if comparison.reference is not None:
            print(f"difference: relative, in the energy norm, to {comparison.reference.name}")
        for attempt in comparison.attempts:
            if attempt.note:
                print(f"{attempt.name}: {attempt.note}")
        reference = comparison.reference
        record = {
            "problem": stated.name,
            "title": stated.problem.title,
            "unknowns": comparison.problem.unknowns,
            "contact_points": comparison.problem.contact_points,
            "reference": None if reference is None else reference.name,
            "methods": comparison.rows()[:],
        }
        files: Files = {"--csv": table.write_csv, "--json": record}
        if comparison.interrupted or comparison.attempts[0].status == "converged":
            return Done(files, interrupted=comparison.interrupted)
        first = comparison.attempts[0]
        line = f"hemivar: the reference method {first.name} did not converge: {one_line(first.note)}\n"
        return Done(files, False, last=lambda: sys.stderr.write(line))


class SurveyCommand(Command):
    """Reproduce the survey's numerical section: its Figures 1 to 5 and its Table 1.

    A method ends after 60 s on each mesh unless --max-time says otherwise.
    """

    output: Annotated[
        Path, option("Write figures, tables and report.html in a folder.", "--output", "-o", of="DIR")
    ] = Path("survey-output")
    max_n: Annotated[int, option("Finest mesh size is 1/N; a power of two.", of="N")] = 128
    max_time: opt.MaxTime = None
    bounds: Annotated[bool, option("Bound the distance to the exact solution in Figure 5.")] = True
    names_files: ClassVar = False

    @property
    def _limit(self) -> float:
        return _SECONDS if self.max_time is None else self.max_time

    def check(self) -> None:
        from hemivar.survey.survey_report import FILES

        check_limits(max_time=self._limit)
        if not 8 <= self.max_n <= 1024 or self.max_n & (self.max_n - 1):
            raise ProblemError(f"--max-n is {self.max_n}; it must be a power of two, at least 8 and at most 1024")
        check_folder(self.output, FILES)

    def work(self) -> Done:
        from hemivar.survey.survey_report import run_survey

        with StageView(console()) as stages, quiet_logging():
            result = run_survey(
                self.output,
                max_n=self.max_n,
                method_time_limit=self._limit,
                bounds=self.bounds,
                progress=stages,
            )
        self._print(result)
        self.writer.failed += result.failed.values()
        return Done(interrupted=result.runs.interrupted)

    def _print(self, result: SurveyReport) -> None:
        table, runs = result.table1(), result.runs
        if table.rows:
            print_table(console(), table)
        if runs.orders:
            print("observed orders of convergence in the V-norm (reference, method)")
            for (reference, method), order in runs.orders.items():
                print(f"    {order:5.2f}   {reference}, {method}")
        if runs.bounds:
            kind = "estimates" if runs.not_guaranteed else "guaranteed bounds"
            size = f"h = 1/{self.max_n}; over the errors of Figure 5"
            print(f"{kind} of the distance to the exact solution in the V-norm, {size}")
            for method, bounds in runs.bounds.items():
                ratios = [bounds[-2] / errors[-2] for (_, of), errors in runs.errors.items() if of == method]
                least, most = min(ratios), max(ratios)
                print(f"    {bounds[-1]:.3g}   {method}, at h = 1/{self.max_n // 2} {least:.2f} to {most:.2f}")
        report = self.output / "report.html"
        others = len(result.files) - (report in result.files)
        print(f"\nwritten           {f'{shown(report)} and ' if report in result.files else ''}{others} other files")
        print(f"time              {time.perf_counter() - result.started:.3g} s")
        if runs.interrupted:
            print("interrupted: the report contains what was finished by then")
