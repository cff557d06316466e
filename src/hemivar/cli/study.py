"""``hemivar study``, ``steps``, ``sweep``, ``identify``: convergence, parameter sweeps, fits to a measured curve."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from hemivar.basics.first_use import cached_property
from hemivar.cli import options as opt
from hemivar.cli.command import Done, OnProblem, Result, watched
from hemivar.cli.options import check_limits, option, written
from hemivar.cli.outputs import Files
from hemivar.cli.printing import console, print_table, print_title, print_unsaid
from hemivar.cli.session import Session, naming_file
from hemivar.errors import FileError, HemivarError, ProblemError

if TYPE_CHECKING:
    from hemivar.files.changes import Change
    from hemivar.identification import FitOptions
    from hemivar.identification.fit import Parameter
    from hemivar.workflows import Work
    from hemivar.workflows.convergence import Convergence
    from hemivar.workflows.sweep import SweepAxis

__all__ = ["IdentifyCommand", "StepsCommand", "StudyCommand", "SweepCommand"]


class StudyCommand(OnProblem):
    """Solve on meshes that are halved; errors, and observed orders; goes on where it was interrupted.

    Exit code 0 if every solve converged.
    """

    refine: opt.Refine = 3
    coarser: Annotated[int, option("Number of coarser meshes to begin with.", of="N", least=0)] = 0
    known: opt.Known = None
    exact: opt.Exact = None
    columns: opt.Columns = None
    method: opt.MethodName = None
    jobs: opt.Jobs = 1
    checkpoint: opt.Checkpoint = None
    csv: opt.Csv = None
    latex: opt.Latex = None
    json: opt.Json = None
    plot: Annotated[opt.File, written("Draw the errors over h (.png, .svg or .pdf).")] = None
    rtol: opt.Rtol = None
    max_time: opt.MaxTime = None
    max_steps: opt.MaxSteps = None
    given: opt.Given = None

    def work(self) -> Done:
        from hemivar.workflows import StudyOptions, studying
        from hemivar.workflows.study import study_digest

        session, stated = self.session, self.session.stated
        solver = session.solver(self.method)
        meshes = [*stated.coarser_meshes(), stated.problem.mesh]
        if self.coarser >= len(meshes):
            raise ProblemError(
                f"--coarser is {self.coarser}, and {stated.name} describes {len(meshes) - 1} coarser meshes; give even "
                "numbers of cells, or [mesh] refine"
            )
        first = stated.problem.on(meshes[-1 - self.coarser])
        options = StudyOptions(
            self.refine,
            self.known or None,
            solver,
            session.controls,
            self.jobs,
            must_keep=self.checkpoint is not None,
            exact=bool(self.exact),
            columns=opt.columns_of(self.columns, first),
        )
        options = replace(options, checkpoint=session.kept("study", lambda: study_digest(first, options)))
        print_title(stated, stated.changes)
        study = _watched(studying(first, options), stated.name)
        files = _studied(study, session, stated.units.length)
        done = f"{len(study.levels)} of {self.refine + 1} meshes are done"
        reached = study.converged and len(study.levels) == self.refine + 1
        return Done(files, reached, study.interrupted, partial(session.print_kept, study, done))


def _watched(work: Work[Result], name: str) -> Result:
    """The result of long work on a problem file, which its errors name."""
    try:
        return watched(work)
    except FileError:
        raise
    except HemivarError as error:
        raise naming_file(error, name) from error


def _studied(study: Convergence, session: Session, unit: str) -> Files:
    """Print the table of a study and what it claims; returns its files."""
    from hemivar.report import Table, plot_study
    from hemivar.report.summary import Summary

    stated = session.stated
    table = Table.of(study.rows(), stated.problem.title, units=stated.units)
    print()
    print_table(console(), Table.of(study.rows(), brief=True, units=stated.units))
    print_unsaid(Summary.of(study.claims()).lines(), ())
    draw = partial(plot_study, study, title=session.title, unit=unit)
    files: Files = {"--csv": table.write_csv, "--latex": table.write_latex}
    return (
        files | {"--json": {"problem": stated.name, **study.record()}} | ({"--plot": draw} if study.quantities else {})
    )


class StepsCommand(OnProblem):
    """March with steps that are halved; errors, observed orders, and the step that an accuracy needs.

    Exit code 0 if there is an order.
    """

    refine: opt.Refine = 3
    known: opt.Known = None
    accuracy: Annotated[float, option("Relative error whose step is printed.", of="X")] = 1e-3
    until: opt.Until = None
    step: opt.StepLength = None
    scheme: opt.SchemeName = None
    csv: opt.Csv = None
    latex: opt.Latex = None
    json: opt.Json = None
    plot: Annotated[opt.File, written("Draw the errors over the step (.png, .svg or .pdf).")] = None
    rtol: opt.Rtol = None
    given: opt.Given = None

    def work(self) -> Done:
        from hemivar.workflows import TimeStudyOptions, study_time
        from hemivar.workflows.marching import evolution_of, plan_of

        session, stated = self.session, self.session.stated
        given = {"until": self.until, "step": self.step, "scheme": self.scheme, "method": session.method}
        given = {name: value for name, value in given.items() if value is not None}
        plan = plan_of(stated, every=None, controls=session.controls, **given)
        print_title(stated, stated.changes)
        options = TimeStudyOptions(self.refine, self.known)
        study = _watched(study_time(evolution_of(stated), plan, options), stated.name)
        files = _studied(study, session, stated.units.time)
        step = study.size_for(self.accuracy)
        print(f"step for {self.accuracy:<9g}{'not known' if math.isnan(step) else f'{step:.3g}, by the energy norm'}")
        return Done(files, not math.isnan(study.orders["energy"]), study.interrupted)


class SweepCommand(OnProblem):
    """Count the solutions, and compute the margin, over ranges of parameters; goes on where it was interrupted.

    Exit code 0 if every point has a result.
    """

    given: Annotated[
        list[str] | None,
        option(
            "Set a range of a value of the file (:log for logarithmic steps), or one value KEY=VALUE.",
            "--set",
            of="KEY=LOW:HIGH:COUNT",
        ),
    ] = None
    values: Annotated[str | None, option("The values of the parameter that --set KEY names alone.", of="X,Y,...")] = (
        None
    )
    columns: opt.Columns = None
    jobs: opt.Jobs = 1
    checkpoint: opt.Checkpoint = None
    csv: opt.Csv = None
    latex: opt.Latex = None
    plot: Annotated[opt.File, written("Draw margin and number of solutions (.png, .svg or .pdf).")] = None
    label: Annotated[list[str] | None, option("Name of a parameter in the figure, with its unit.", of="TEXT")] = None
    starts: opt.Starts = 40
    max_solutions: opt.MaxSolutions = 100
    seed: opt.Seed = 0
    rtol: opt.Rtol = None
    max_time: opt.MaxTime = None

    @cached_property
    def ranges(self) -> tuple[tuple[SweepAxis, ...], tuple[Change, ...]]:
        """What ``--set`` gives a range, and what one value."""
        from hemivar.workflows.sweep import SweepAxis, read_axis

        texts = list(self.given or ())
        if self.values is not None:
            alone = [k for k, text in enumerate(texts) if "=" not in text]
            if len(alone) != 1:
                raise ProblemError("--values belongs to one --set KEY without a value; give both")
            texts[alone[0]] += f"={self.values}"
        read = [read_axis(text) for text in texts]
        axes = tuple(axis for axis in read if isinstance(axis, SweepAxis))
        return axes, tuple(axis for axis in read if not isinstance(axis, SweepAxis))

    def check(self) -> None:
        check_limits(self.rtol, self.max_time)
        axes, _ = self.ranges
        if not axes:
            raise ProblemError("sweep: give a range with --set, as in --set contact.bottom.normal.q_max=0:1:21")
        if self.plot is not None and self.columns is not None:
            raise ProblemError(
                "--plot draws numbers of solutions and margins, which --columns leaves out; leave one out"
            )
        if self.plot is not None and len(axes) > 2:
            raise ProblemError(f"--plot draws one or two parameters, and {len(axes)} have ranges; leave it out")
        if len(self.label or ()) > len(axes):
            raise ProblemError(
                f"--label is there {len(self.label or ())} times, and {len(axes)} parameters have a range; give one "
                "for each"
            )

    @cached_property
    def session(self) -> Session:
        """The problem file at the first point, or the last: one end of the ranges may make no sense."""
        try:
            return self._at(0)
        except ProblemError as error:
            try:
                return self._at(-1)
            except ProblemError:
                raise error from None

    def _at(self, index: int) -> Session:
        from hemivar.files.changes import Change

        axes, changes = self.ranges
        values = [*changes, *(Change(axis.key, axis.values[index]) for axis in axes)]
        return Session(self.problem, self.outputs, self.rtol, self.max_time, given=values, code=self.allow_code)

    def work(self) -> Done:
        from hemivar.report import Table, plot_sweep
        from hemivar.workflows import SolutionsOptions, SweepOptions, sweeping
        from hemivar.workflows.sweep import sweep_digest

        axes, changes = self.ranges
        session = self.session
        search = SolutionsOptions(self.starts, self.max_solutions, self.seed, session.controls)
        kept, code = self.checkpoint is not None, tuple(self.allow_code or ())
        columns = opt.columns_of(self.columns, session.stated.problem)
        options = SweepOptions(search, self.jobs, None, changes, must_keep=kept, code=code, columns=columns)
        digest = partial(sweep_digest, self.problem, axes, options)
        options = replace(options, checkpoint=session.kept("sweep", digest))
        print_title(session.stated, changes)
        ranged = ", ".join(f"{axis.key} ({len(axis.values)})" for axis in axes)
        print(f"parameters        {ranged}: {math.prod(len(axis.values) for axis in axes)} points")
        swept = watched(sweeping(self.problem, axes, options))
        table = Table.of(swept.rows(), units=session.stated.units)
        if len(table.rows) <= 40:  # which a screen shows
            print_table(console(), table, keys=len(swept.axes))
        else:
            print(f"                  {len(table.rows)} points are done; --csv writes their table")
        failed = [point for point in swept.points if point.failed]
        if failed:
            print(f"without result    {len(failed)} point{'s' if len(failed) > 1 else ''}; the first: {failed[0].note}")
        title, units = session.stated.problem.title, session.stated.units
        draw = partial(plot_sweep, swept, labels=self.label or (), title=session.title)
        files: Files = {
            "--csv": table.write_csv,
            "--latex": Table.of(swept.rows(), title, units=units).write_latex,
            **({"--plot": draw} if swept.points and not columns else {}),
        }
        done = f"{len(swept.points)} of {math.prod(swept.shape)} points are done"
        return Done(files, not failed, swept.interrupted, partial(session.print_kept, swept, done))


_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_RANGE = re.compile(rf"\s*(?P<key>.+?)\s*=\s*(?P<low>{_NUMBER})\s*:\s*(?P<high>{_NUMBER})\s*")


class IdentifyCommand(OnProblem):
    """Find the parameters of a contact law from a measured curve, with intervals and what the curve leaves open.

    Exit code 1 if a parameter is not identifiable.
    """

    data: Annotated[
        Path, option("The measured curve: a head with keys of the file and quantities, and rows.", of="CURVE.csv")
    ]
    law: Annotated[
        str | None, option("Fit every number of this normal law, around its value in the file.", of="NAME")
    ] = None
    contact: Annotated[str | None, option("The contact boundary of --law.", of="NAME")] = None
    fitted: Annotated[
        list[str] | None, option("A key of the file to fit, and its range.", "--fit", of="KEY=LOW:HIGH")
    ] = None
    given: opt.Given = None
    noise: Annotated[float | None, option("Standard deviation, relative to the largest value (estimated).", of="X")] = (
        None
    )
    confidence: Annotated[float, option("Confidence of the intervals.", of="X")] = 0.95
    starts: opt.Starts = 6
    seed: opt.Seed = 0
    rtol: opt.Rtol = None
    max_time: opt.MaxTime = None
    csv: opt.Csv = None
    latex: opt.Latex = None
    json: opt.Json = None
    plot: Annotated[opt.File, written("Draw data, fit and intervals (.png, .svg or .pdf).")] = None

    @property
    def read(self) -> Path:
        return self.data

    @cached_property
    def options(self) -> FitOptions:
        """How to fit."""
        from hemivar.identification import FitOptions

        return FitOptions(self.starts, self.seed, self.confidence, self.noise)

    @cached_property
    def ranges(self) -> list[Parameter]:
        """What ``--fit`` names."""
        return [_read(text) for text in self.fitted or ()]

    def check(self) -> None:
        check_limits(self.rtol, self.max_time)
        _ = self.options
        if not self.ranges and self.law is None:
            raise ProblemError(
                "identify: say what to fit, by --law NAME or by --fit KEY=LOW:HIGH, once for each parameter"
            )

    def work(self) -> Done:
        from hemivar.files.changes import read_change
        from hemivar.identification.identification_figure import plot_fit
        from hemivar.identification.identifying import identifying, parameters_of_law
        from hemivar.report.tables import Table

        changes, wanted, session = [read_change(text) for text in self.given or ()], self.ranges, self.session
        code = self.allow_code or ()
        if self.law is not None:
            named = {parameter.key for parameter in wanted} | {
                parameter.key for parameter in changes
            }  # what is set stays as it is set
            of_law = parameters_of_law(self.problem, self.law, self.contact, code)
            wanted = [*(parameter for parameter in of_law if parameter.key not in named), *wanted]
        print_title(session.stated)
        ranges = ", ".join(f"{parameter.key} ({parameter.low:.4g} to {parameter.high:.4g})" for parameter in wanted)
        print(f"fit               {ranges}")
        work = identifying(
            self.problem, self.data, wanted, self.options, changes=changes, controls=session.controls, code=code
        )
        fit = watched(work)
        print_table(console(), Table.of(fit.rows()), keys=1)
        print(f"misfit            {fit.misfit:.2%} of the largest measured value, {fit.measurements.count} rows")
        estimated = " (estimated)" if self.noise is None else ""
        print(f"intervals         {fit.confidence:.0%}, noise {fit.noise:.2%}{estimated}")
        for message in fit.messages:
            print(f"note              {message}")
        files: Files = {
            "--csv": Table.of(fit.rows()).write_csv,
            "--latex": Table.of(fit.rows(), session.stated.problem.title).write_latex,
            "--json": fit.record(),
            "--plot": partial(plot_fit, fit, title=session.title),
        }
        return Done(files, all(fit.identified))


def _read(text: str) -> Parameter:
    from hemivar.identification.fit import Parameter

    match = _RANGE.fullmatch(text)
    if match is None:
        raise ProblemError(f"--fit {text}: give KEY=LOW:HIGH, as in contact.bottom.normal.strength=0.5:5")
    return Parameter(match["key"], float(match["low"]), float(match["high"]))
