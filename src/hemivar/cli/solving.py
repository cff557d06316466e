"""``hemivar solve``, on one mesh or adaptively: meshes are refined until the error estimate is small."""

from __future__ import annotations

import math
import sys
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, TypedDict

from hemivar.basics.disk import same_file
from hemivar.basics.first_use import cached_property
from hemivar.basics.rounding import rounded_up
from hemivar.cli import options as opt
from hemivar.cli.command import Done, OnProblem
from hemivar.cli.engine import Asked, Engine, engine_named
from hemivar.cli.options import (
    ENGINES,
    check_colour,
    check_engine,
    check_load_factors,
    controls_of,
    method_named,
    option,
    written,
)
from hemivar.cli.outputs import Files
from hemivar.cli.printing import SolveView, console, print_not_converged, print_summary, unread
from hemivar.cli.session import Session, naming_file, print_head
from hemivar.errors import ProblemError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from hemivar.bounds import AdaptiveSolution
    from hemivar.certificates import Certificate
    from hemivar.files.problem_file import ProblemFile
    from hemivar.report.deformed import BodyColour
    from hemivar.solvers import Solution
    from hemivar.workflows import AdaptResult, Event, RunResult

__all__ = [
    "SolveCommand",
    "check_drawable",
    "colour_named",
    "label_units",
    "pictures_of",
]

_ADAPTIVE = ("--goal", "--max-unknowns", "--max-memory", "--plot-error", "--plot-meshes")


class SolveCommand(OnProblem):
    """Solve a contact problem."""

    method: opt.MethodName = None
    json: opt.Json = None
    arrays: Annotated[opt.File, written("Write the arrays of --json to this file and not as text.", "FILE.npz")] = None
    vtu: Annotated[opt.File, written("Write the fields, for ParaView.", "FILE.vtu")] = None
    plot: Annotated[opt.File, written("Draw the deformed body (.png, .svg or .pdf).")] = None
    plot_contact: Annotated[opt.File, written("Draw pressure, friction and slip on the contact boundary.")] = None
    colour: opt.Colour = None
    rtol: opt.Rtol = None
    max_time: opt.MaxTime = None
    max_steps: opt.MaxSteps = None
    load_factor: Annotated[float | None, option("Factor of loads and prescribed displacements.", of="X")] = None
    quiet: opt.Quiet = False
    verbose: opt.Verbose = False
    warm_start: Annotated[bool, option("Solve on coarser meshes first, each starting the next.", "--warm-start")] = (
        False
    )
    engine: opt.EngineName = ENGINES[0]
    checkpoint: opt.Checkpoint = None
    resume: opt.Resume = False
    exact: opt.Exact = None
    adaptive: opt.Tolerance = None
    goal: Annotated[
        str | None, option("Refine for this quantity: contact.bottom.force, support.left.force ...", of="NAME")
    ] = None
    max_unknowns: Annotated[int | None, option("Limit of unknowns of adaptive meshes (300000).", of="N")] = None
    max_memory: Annotated[float | None, option("Limit of memory of adaptive meshes (what is free).", of="GIB")] = None
    csv: Annotated[opt.File, written("Write the contact points as CSV; with --adaptive the meshes.", "FILE.csv")] = None
    report: Annotated[
        opt.File, written("Write a page: the problem, pictures, forces and the certificate.", "FILE.html")
    ] = None
    check_mesh: Annotated[bool, option("Solve on the halved mesh too, for --report.", "--check-mesh")] = False
    plot_error: Annotated[opt.File, written("Draw the error against the unknowns (adaptive).")] = None
    plot_meshes: Annotated[opt.File, written("Draw the meshes, coarse to fine (adaptive).")] = None
    given: opt.Given = None

    @cached_property
    def backend(self) -> Engine:
        """The engine that is asked for."""
        return engine_named(self.engine, "--json", "--vtu")

    def run(self) -> int:
        """Run it, adaptively if that is asked for."""
        return super().run() if self.adaptive is None else _AdaptiveCommand(self.problem, self).run()

    def check(self) -> None:
        self.check_shared()
        for name in _ADAPTIVE:
            if self._value(name) is not None:
                raise ProblemError(f"{name} goes with --adaptive; give both, or leave it out")
        if self.engine == "petsc":
            own = ("--method", "--arrays", "--csv", "--report", "--exact", "--load-factor", "--plot", "--plot-contact")
            self.refuse("scipy", *own)
            if self.resume and self.checkpoint is None:
                raise ProblemError("--resume needs a checkpoint; name it by --checkpoint FILE")
        else:
            self.refuse("petsc", "--checkpoint", "--resume")
        if self.method is not None:
            method_named(self.method)

    def check_shared(self) -> None:
        """Refuse what makes no sense, adaptively or not."""
        check_colour(self.colour, {"--plot": self.plot})
        if self.check_mesh and (self.report is None or self.adaptive is not None):
            raise ProblemError("--check-mesh goes with --report on one mesh; give both, or leave it out")
        if self.arrays is not None and self.json is None:
            raise ProblemError("--arrays goes with --json, which names them; give both, or leave it out")
        if self.arrays is not None and self.json is not None and not same_file(self.arrays.parent, self.json.parent):
            raise ProblemError(f"--arrays {self.arrays}: it must be in the folder of --json; name a file there")
        check_load_factors(*(() if self.load_factor is None else (self.load_factor,)))

    def _value(self, name: str) -> object:
        """What an option says; None where it is left out."""
        value = getattr(self, name.removeprefix("--").replace("-", "_"))
        return None if value is False else value

    def refuse(self, engine: str, *names: str) -> None:
        """Refuse options of the other engine."""
        for name in names:
            if self._value(name) is not None:
                raise ProblemError(f"{name} goes with --engine {engine}; leave one of the two out")

    def work(self) -> Done:
        from hemivar.workflows import RunResult

        session, stated = self.session, self.session.stated
        check_drawable(stated, self.plot_contact, self.colour)
        warm = self.warm_start and self.engine == ENGINES[0]  # many ranks always start on coarser meshes
        meshes = stated.coarser_meshes() if warm else []
        if warm and not meshes:
            raise ProblemError(
                f"{stated.name}: --warm-start needs coarser meshes; give even numbers of cells, or [mesh] refine"
            )
        *coarser, discrete = [session.discrete(mesh, self.load_factor) for mesh in (*meshes, None)]
        print_head(session, discrete)
        view = SolveView(self.quiet, self.verbose)
        method, failed = session.solver(self.method), self.writer.failed
        asked = Asked(method, session.controls, bool(self.exact), self.checkpoint, self.resume, failed)
        result: RunResult | None = None
        try:
            result = self.backend.solved(asked, discrete, coarser, view)
            if result.complaint and not result.interrupted:
                self.writer.failed.append(f"the solution could not be certified: {result.complaint}")
            print_summary(console(), result.solution, result.certificate, stated.units, discrete.notes)
        except BaseException:  # whatever happens, what was computed is written
            if view.solution is not None:
                self.write(self._files(result or RunResult(view.solution, None)))
                self.writer.complain()
            raise
        if result.interrupted or result.solution.status.value == "converged":
            return Done(self._files(result), interrupted=result.interrupted)
        return Done(self._files(result), False, last=partial(self._not_converged, result.solution))

    def _files(self, result: RunResult) -> Files:
        """Data before pictures, and what may end the process last."""
        from hemivar.files import write_csv

        solution, certificate, units = result.solution, result.certificate, self.writer.units
        more = {"units": units} if units else None
        return {
            "--json": lambda path: [
                self.backend.write_json(solution, path, certificate, more, self.arrays),
                self.arrays,
            ],
            "--csv": lambda path: write_csv(solution, path, self.session.stated.units),
            "--vtu": lambda path: self.backend.write_vtu(solution, path),
            "--report": lambda path: self._page(solution, certificate, path),
            **pictures_of(self.session, solution, certificate, self.colour),
        }

    def _page(self, solution: Solution, certificate: Certificate | None, path: Path) -> Path:
        from hemivar.report.page import write_page
        from hemivar.workflows import StudyOptions, result_of, studying

        session, finer = self.session, None
        if self.check_mesh and solution.status.value == "converged":
            problem = session.stated.problem
            elastic = () if problem.kind else ("max-pressure", "max-stress", "normal-force")
            columns = (*elastic, *(f"support.{name}.force" for name in problem.supports if elastic))
            options = StudyOptions(1, None, session.solver(self.method), session.controls, columns=columns)
            finer = result_of(studying(problem, options))
        return write_page(solution, path, certificate, units=session.stated.units, finer=finer)

    def _not_converged(self, solution: Solution) -> None:
        self.writer.complain()
        print_not_converged(solution)


def check_drawable(stated: ProblemFile, plot_contact: Path | None, colour: str | None = None) -> None:
    """Refuse pictures that this problem has not."""
    if plot_contact is not None and not (stated.problem.contact or getattr(stated.problem, "areas", {})):
        raise ProblemError(f"{stated.name}: --plot-contact draws contact boundaries, and there is none; take --plot")

    scalar = stated.problem.kind is not None
    if scalar and plot_contact is not None and stated.problem.mesh.dim == 3:
        raise ProblemError(f"{stated.name}: --plot-contact draws contact of one component in the plane; take --vtu")
    if scalar and colour is not None:
        raise ProblemError(
            f"{stated.name}: --colour is of elastic bodies, and a scalar problem has its own; leave it out"
        )


class LabelUnits(TypedDict):
    """Units for the labels of a picture of a body."""

    unit: str
    stress_unit: str


def label_units(session: Session) -> LabelUnits:
    """The units that a problem file states."""
    return {"unit": session.stated.units.length, "stress_unit": session.stated.units.stress}


def colour_named(name: str | None) -> BodyColour | None:
    """The colouring of a name."""
    from hemivar.report.deformed import BodyColour

    return None if name is None else BodyColour(name)


def pictures_of(session: Session, solution: Solution, certificate: Certificate | None, colour: str | None) -> Files:
    """The pictures of a solution by option, with a line each that tells what was certified."""

    def body() -> Figure:
        from hemivar.report import plot_solution

        return plot_solution(
            solution,
            scale="auto",
            title=session.title,
            colour=colour_named(colour),
            certificate=certificate,
            **label_units(session),
        )

    def contact() -> Figure:
        from hemivar.report import plot_contact

        return plot_contact(solution, title=session.title, certificate=certificate, **label_units(session))

    return {"--plot": body, "--plot-contact": contact}


#: Parts of the whole below which a share is shown as 0 %: machine precision times thousands of operations.
_ROUNDING = 1e-12


class _AdaptView:
    """Shows an adaptive solve: a row for each mesh, unless ``quiet``."""

    def __init__(self, quiet: bool = False) -> None:
        self.quiet = quiet

    def __call__(self, event: Event) -> bool:
        """Show an event; returns whether to stop."""
        from hemivar.workflows import Refined

        if not isinstance(event, Refined) or self.quiet:
            return False
        level = event.level
        distance, goal = level.distance, level.goal
        if event.number == 0:
            head = (
                f"\n{'mesh':>6}  {'unknowns':>9}  {'error':>9}  {'misfit':>9}  {'contact':>9}  {'loads':>9}  {'c':>6}"
            )
            more = "" if goal is None else f"  {'interval':>9}  {'estimate':>9}"
            print(f"{head}{more}  {'seconds':>8}", flush=True)
        parts = (distance.parts.misfit, distance.parts.contact, distance.parts.oscillation)
        shares = "".join(f"  {_percent(distance.over_norm(part)):>9}" for part in parts)
        bound = ("" if distance.guaranteed else "~") + _percent(distance.relative)
        more = "" if goal is None else f"  {_percent(goal.relative):>9}  {'~' + _percent(goal.estimated):>9}"
        line = f"{event.number + 1:>6}  {level.unknowns:>9}  {bound:>9}{shares}  {distance.constant:>6.3g}"
        print(f"{line}{more}  {level.seconds:>8.3g}", flush=True)
        return unread()


class _AdaptiveCommand(OnProblem):
    """``hemivar solve`` with ``--adaptive``."""

    asked: SolveCommand

    @property
    def outputs(self) -> dict[str, Path | None]:
        """Those of the command."""
        return self.asked.outputs

    @property
    def session(self) -> Session:
        """That of the command."""
        return self.asked.session

    def check(self) -> None:
        asked, tolerance = self.asked, self._tolerance
        check_engine(asked.engine)
        asked.check_shared()
        asked.refuse("petsc", "--checkpoint", "--resume")
        if asked.warm_start or asked.load_factor is not None or asked.engine != ENGINES[0]:
            engine = f"--engine {asked.engine}" if asked.load_factor is None else "--load-factor"
            other = "--warm-start" if asked.warm_start else engine
            raise ProblemError(f"--adaptive and {other} exclude one another; leave one of the two out")
        if not 0.0 < tolerance < 1.0:
            raise ProblemError(f"--adaptive is {tolerance:g}; it must be a positive number below 1, such as 0.02")
        for name, value, unit in (
            ("--max-unknowns", asked.max_unknowns, "whole number"),
            ("--max-memory", asked.max_memory, "number of GiB"),
        ):
            if value is not None and not value > 0:
                raise ProblemError(f"{name} is {value:g}; it must be a positive {unit}")
        if asked.method is not None:
            method_named(asked.method)

    @property
    def _tolerance(self) -> float:
        assert self.asked.adaptive is not None
        return self.asked.adaptive

    def work(self) -> Done:
        from hemivar.bounds.adaptive_end import AdaptiveEnd
        from hemivar.workflows import AdaptOptions, adapt, result_of

        session, asked = self.session, self.asked
        stated = session.stated
        check_drawable(stated, asked.plot_contact)
        if stated.problem.kind:
            raise ProblemError(
                f"{stated.name}: --adaptive is for elastic bodies, and this is a scalar problem; leave it out"
            )
        options = AdaptOptions(
            self._tolerance,
            asked.goal,
            max_unknowns=asked.max_unknowns or AdaptOptions.max_unknowns,
            max_time=asked.max_time or math.inf,
            max_memory=(asked.max_memory or math.inf) * 2.0**30,
            method=session.solver(asked.method),
            controls=controls_of(stated, asked.rtol, max_steps=asked.max_steps),
        )
        print_head(session, session.discrete())
        try:
            result = result_of(adapt(stated.problem, options), _AdaptView(asked.quiet))
        except ProblemError as error:
            raise naming_file(error, stated.name) from error
        if result.complaint and not result.interrupted:
            self.writer.failed.append(f"the solution could not be certified: {result.complaint}")
        try:
            self._print(result)
        except BaseException:  # whatever happens, what was computed is written
            self.write(self._files(result))
            self.writer.complain()
            raise
        reached = result.interrupted or result.adaptive.ended in (AdaptiveEnd.REACHED, AdaptiveEnd.ESTIMATED)
        last = self.writer.complain if reached else partial(self._not_reached, result.adaptive)
        return Done(self._files(result), reached, result.interrupted, last)

    def _print(self, result: AdaptResult) -> None:
        """What was found on the last mesh, and how it ended."""
        adaptive = result.adaptive
        print_summary(console(), adaptive.solution, result.certificate, self.session.stated.units)
        if result.certificate is None:
            from hemivar.bounds.exact_certificate import statement_of

            print("\n".join(statement_of(adaptive.distance).lines()))
        if adaptive.goal is not None:
            label = "goal"
            for line in adaptive.goal.lines():
                print(f"{label:<18}{line}")
                label = ""
            for reason in adaptive.goal.reasons:
                print(f"{'':<18}because {reason}")
        order = f", bound of order {adaptive.rate:.2g} in the unknowns" if math.isfinite(adaptive.rate) else ""
        print(f"adaptive          {adaptive.ended} after {len(adaptive.levels)} meshes{order}")
        print(f"{'':<18}{adaptive.remedy}", flush=True)

    def _files(self, result: AdaptResult) -> Files:
        from hemivar.files import write_json, write_vtu
        from hemivar.report import plot_adaptive, plot_meshes
        from hemivar.report.tables import Table

        adaptive, certificate, title = result.adaptive, result.certificate, self.session.title
        arrays = self.asked.arrays
        more, cells = {"adaptive": adaptive.record()}, {"indicator": adaptive.levels[-1].indicator}
        return {
            "--csv": Table.of(adaptive.rows()).write_csv,
            "--json": lambda path: [write_json(adaptive.solution, path, certificate, more, arrays), arrays],
            "--vtu": lambda path: write_vtu(adaptive.solution, path, cells),
            "--plot-error": partial(plot_adaptive, adaptive, title=title, certificate=certificate),
            "--plot-meshes": partial(plot_meshes, adaptive, title=title, certificate=certificate),
            **pictures_of(self.session, adaptive.solution, certificate, self.asked.colour),
        }

    def _not_reached(self, adaptive: AdaptiveSolution) -> None:
        """Say on standard error what was not reached."""
        self.writer.complain()
        last = adaptive.levels[-1]
        what = "distance" if last.goal is None else last.goal.goal.name
        size = f"{what} within {_percent(last.relative)}" if math.isfinite(last.relative) else f"{what} not bounded"
        sys.stderr.write(
            f"hemivar: not reached: {adaptive.ended} with {last.unknowns} unknowns, {size}, asked for "
            f"{_percent(adaptive.rtol)}: {adaptive.remedy}\n"
        )


def _percent(ratio: float) -> str:
    if not math.isfinite(ratio):
        return "-"
    return f"{rounded_up(100.0 * ratio) if ratio > _ROUNDING else '0'} %"
