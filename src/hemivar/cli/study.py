"""``hemivar study`` and ``sweep``: a problem on meshes that are halved, and over one or more of its parameters."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Annotated

from hemivar.basics.first_use import cached_property
from hemivar.cli import options as opt
from hemivar.cli.command import Done, OnProblem, watched
from hemivar.cli.options import check_limits, option, written
from hemivar.cli.outputs import Files
from hemivar.cli.printing import console, print_table, print_title
from hemivar.cli.session import Session, naming_file
from hemivar.errors import FileError, HemivarError, ProblemError

if TYPE_CHECKING:
    from hemivar.basics.types import Record
    from hemivar.files.changes import Change
    from hemivar.workflows import Study, SweepAxis
    from hemivar.workflows.study import StudyLevel

__all__ = ["StudyCommand", "SweepCommand"]


class StudyCommand(OnProblem):
    """Solve on meshes that are halved; errors, and observed orders; goes on where it was interrupted.

    Exit code 0 if every solve converged.
    """

    refine: Annotated[int, option("Number of refinements, each halving the mesh.", of="N")] = 3
    coarser: Annotated[int, option("Number of coarser meshes to begin with.", of="N", least=0)] = 0
    known: Annotated[
        list[str] | None,
        option("Known solution in x and y, once for each component (the finest mesh).", of="FORMULA"),
    ] = None
    exact: opt.Exact = None
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
        from hemivar.report.loglog import plot_study
        from hemivar.report.tables import study_table
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
        )
        options = replace(options, checkpoint=session.kept("study", lambda: study_digest(first, options)))
        print_title(stated, stated.changes)
        try:
            found = watched(studying(first, options))
        except FileError:
            raise
        except HemivarError as error:
            raise naming_file(error, stated.name) from error
        print()
        print_table(console(), study_table(found, brief=True, units=stated.units))
        _print_orders(found)
        _print_bounds(found)
        draw = partial(plot_study, found, title=session.title, unit=stated.units.length)
        files: Files = {
            "--csv": study_table(found, units=stated.units).write_csv,
            "--latex": study_table(found, stated.problem.title, units=stated.units).write_latex,
            "--json": _record(found, stated.name),
            **({"--plot": draw} if found.quantities else {}),
        }
        done = f"{len(found.levels)} of {self.refine + 1} meshes are done"
        reached = found.converged and len(found.levels) == self.refine + 1
        return Done(files, reached, found.interrupted, partial(session.tell_kept, found, done))


def _print_orders(found: Study) -> None:
    """Print what the errors are of, and the fitted orders."""
    print(f"reference         {found.reference}")
    for name in found.quantities:
        order = found.orders[name]
        told = "too few meshes for an order" if math.isnan(order) else f"order {order:.2f}"
        finest = [value for value in found.relative(name) if not math.isnan(value)]
        print(f"{name:<18}{told}" + (f", relative error {finest[-1]:.3g}" if finest else ""))


def _print_bounds(found: Study) -> None:
    """Print the bound on the finest mesh, or why there is none."""
    level = found.levels[-1]
    if math.isnan(level.bound):
        return
    if math.isfinite(level.bound):
        norm = found.norms["energy"]
        relative = f", relative {level.bound / norm:.3g}" if norm > 0.0 else ""
        print(f"{found.kind_of_bound:<18}{level.bound:.3g} in the energy norm on the finest mesh{relative}")
        if level.conditions:
            print(f"                  if {' and '.join(level.conditions)}")
        return
    print("guaranteed bound  none on the finest mesh")
    for reason in level.unbounded:
        print(f"                  because {reason}")


def _bound_record(level: StudyLevel) -> Record:
    """The bound as plain numbers and strings; nothing where none was asked for."""
    if math.isnan(level.bound):
        return {}
    if level.conditions:
        return {"conditional_bound": level.bound, "conditions": list(level.conditions)}
    return {"guaranteed_bound": level.bound if math.isfinite(level.bound) else None}


def _record(found: Study, name: str) -> Record:
    """A study as plain numbers and lists."""

    def plain(value: float) -> float | None:
        return float(value) if math.isfinite(value) else None

    levels = [
        {
            "h": level.size,
            "unknowns": level.solution.problem.unknowns,
            "status": level.solution.status.value,
            "errors": {quantity: plain(getattr(level, quantity)) for quantity in found.quantities},
            "orders": {quantity: plain(found.steps(quantity)[number]) for quantity in found.quantities},
            **_bound_record(level),
            "energy": plain(level.solution.energy),
            "normal_force": plain(level.solution.normal_force) if level.solution.problem.contact_points else None,
        }
        for number, level in enumerate(found.levels)
    ]
    return {
        "problem": name,
        "reference": found.reference,
        "norms": {quantity: plain(found.norms[quantity]) for quantity in found.quantities},
        "orders": {quantity: plain(found.orders[quantity]) for quantity in found.quantities},
        "interrupted": found.interrupted,
        "meshes": levels,
    }


_SHOWN = 40


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
    jobs: opt.Jobs = 1
    checkpoint: opt.Checkpoint = None
    csv: opt.Csv = None
    latex: opt.Latex = None
    plot: Annotated[opt.File, written("Draw margin and number of solutions (.png, .svg or .pdf).")] = None
    label: Annotated[list[str] | None, option("Name of a parameter in the picture, with its unit.", of="TEXT")] = None
    starts: opt.Starts = 40
    max_solutions: opt.MaxSolutions = 100
    seed: opt.Seed = 0
    rtol: opt.Rtol = None
    max_time: opt.MaxTime = None

    @cached_property
    def ranges(self) -> tuple[tuple[SweepAxis, ...], tuple[Change, ...]]:
        """What ``--set`` gives a range, and what one value."""
        from hemivar.workflows import SweepAxis, read_axis

        read = [read_axis(text) for text in self.given or ()]
        axes = tuple(one for one in read if isinstance(one, SweepAxis))
        return axes, tuple(one for one in read if not isinstance(one, SweepAxis))

    def check(self) -> None:
        check_limits(self.rtol, self.max_time)
        axes, _ = self.ranges
        if not axes:
            raise ProblemError("sweep: give a range with --set, as in --set contact.bottom.normal.q_max=0:1:21")
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

    def _at(self, place: int) -> Session:
        from hemivar.files.changes import Change

        axes, changes = self.ranges
        values = [*changes, *(Change(axis.key, axis.values[place]) for axis in axes)]
        return Session(self.problem, self.outputs, self.rtol, self.max_time, given=values)

    def work(self) -> Done:
        from hemivar.report.sweep_figures import plot_sweep
        from hemivar.report.tables import sweep_table
        from hemivar.workflows import SolutionsOptions, SweepOptions, sweeping
        from hemivar.workflows.sweep import sweep_digest

        axes, changes = self.ranges
        session = self.session
        search = SolutionsOptions(self.starts, self.max_solutions, self.seed, session.controls)
        options = SweepOptions(search, self.jobs, None, changes, must_keep=self.checkpoint is not None)
        digest = partial(sweep_digest, self.problem, axes, options)
        options = replace(options, checkpoint=session.kept("sweep", digest))
        print_title(session.stated, changes)
        told = ", ".join(f"{axis.key} ({len(axis.values)})" for axis in axes)
        print(f"parameters        {told}: {math.prod(len(axis.values) for axis in axes)} points")
        found = watched(sweeping(self.problem, axes, options))
        table = sweep_table(found, units=session.stated.units)
        if len(table.rows) <= _SHOWN:
            print_table(console(), table, keys=len(found.axes))
        else:
            print(f"                  {len(table.rows)} points are done; --csv writes their table")
        failed = [point for point in found.points if point.failed]
        if failed:
            print(f"without result    {len(failed)} point{'s' if len(failed) > 1 else ''}; the first: {failed[0].note}")
        title, units = session.stated.problem.title, session.stated.units
        draw = partial(plot_sweep, found, labels=self.label or (), title=session.title)
        files: Files = {
            "--csv": table.write_csv,
            "--latex": sweep_table(found, title, units=units).write_latex,
            **({"--plot": draw} if found.points else {}),
        }
        done = f"{len(found.points)} of {math.prod(found.shape)} points are done"
        return Done(files, not failed, found.interrupted, partial(session.tell_kept, found, done))
