"""``hemivar solutions``, ``path`` and ``bracket``: all equilibria at a load, the equilibrium path, the limit load."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Annotated

from hemivar.basics.arguments import suggest
from hemivar.basics.first_use import cached_property
from hemivar.cli import options as opt
from hemivar.cli.command import Done, OnProblem, watched
from hemivar.cli.options import MOST_STEPS, check_colour, check_load_factors, option, written
from hemivar.cli.outputs import Files
from hemivar.cli.printing import console, print_table, print_unsaid
from hemivar.cli.session import print_head
from hemivar.cli.solving import check_drawable, colour_named, label_units, pictures_of
from hemivar.errors import ProblemError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from hemivar.branches import SolutionSet

__all__ = ["BracketCommand", "PathCommand", "SolutionsCommand"]


class SolutionsCommand(OnProblem):
    """Find all solutions of a problem, with their energies and kinds; says how far it searched.

    Exit code 0 if at least one was found.
    """

    json: opt.Json = None
    plot: Annotated[opt.File, written("Draw all side by side, and each one as FILE_1, FILE_2 ...")] = None
    colour: opt.Colour = None
    starts: opt.Starts = 40
    max_solutions: opt.MaxSolutions = 100
    seed: opt.Seed = 0
    rtol: opt.Rtol = None
    max_time: opt.MaxTime = None
    given: opt.Given = None

    def check(self) -> None:
        check_colour(self.colour, {"--plot": self.plot})

    def work(self) -> Done:
        from hemivar.files import solution_record
        from hemivar.report.tables import Table
        from hemivar.workflows import SolutionsOptions, solutions

        session = self.session
        check_drawable(session.stated, None, self.colour)
        options = SolutionsOptions(self.starts, self.max_solutions, self.seed, session.controls)
        equilibria = watched(solutions(self.discrete(), options))
        others = "no others exist" if equilibria.exhaustive else "there may be others"
        print(f"solutions         {len(equilibria)}; {others}")
        print(f"searched          {equilibria.searched}")
        if len(equilibria):
            print_table(console(), Table.of(equilibria.rows(), units=session.stated.units))
        for number, solution in enumerate(equilibria):
            if solution.deformation is not None and solution.deformation.warning is not None:
                print(f"warning           solution {number + 1}: {solution.deformation.warning}")
        record = {
            "problem": session.stated.name,
            "exhaustive": equilibria.exhaustive,
            "searched": equilibria.searched,
            "starts": equilibria.starts,
            "solutions": [{"kind": s.kind, **solution_record(s)} for s in equilibria] if self.json else [],
        }
        return Done({"--json": record, **self._pictures(equilibria)}, len(equilibria) > 0, equilibria.interrupted)

    def _pictures(self, equilibria: SolutionSet) -> Files:
        """All solutions on one picture, and each on one of its own, named after it."""
        file, session = self.plot, self.session
        if file is None or not len(equilibria):
            return {}
        from hemivar.report import plot_solution, plot_solutions
        from hemivar.report.solution_pictures import MOST_PICTURES, common_scale
        from hemivar.systems.workspace import Workspace

        kept, scale, colour, units = (
            Workspace(),
            common_scale(equilibria),
            colour_named(self.colour),
            label_units(session),
        )

        def picture(number: int) -> Figure:
            solution = equilibria[number]
            certificate = solution.certify(trace_constant=False, workspace=kept)
            title = f"{session.title or session.stated.name}, solution {number + 1}: energy {solution.energy:.6g}"
            return plot_solution(solution, scale=scale, title=title, colour=colour, certificate=certificate, **units)

        own = [file.with_name(f"{file.stem}_{number + 1}{file.suffix}") for number in range(len(equilibria))]
        return {
            "--plot": partial(plot_solutions, equilibria, title=session.title, colour=colour, **units),
            **{path: partial(picture, number) for number, path in enumerate(own[:MOST_PICTURES])},
        }


class PathCommand(OnProblem):
    """Follow the equilibria while the load grows, through folds: limit load, first instability, folds, jumps.

    Exit code 0 if the path reaches an end of the range, or the value of --end-at.
    """

    load_factor: Annotated[tuple[float, float], option("Factor of the loads, from low to high.", of="LOW HIGH")] = (
        0.0,
        1.0,
    )
    quantity: Annotated[
        str | None,
        option(
            "Quantity over the load: max-penetration, support.tip.force, ... (the one that changes most).", of="NAME"
        ),
    ] = None
    json: opt.Json = None
    plot: Annotated[opt.File, written("Draw the path (.png, .svg or .pdf).")] = None
    max_points: Annotated[int, option("Limit of points.", of="N", least=2, most=MOST_STEPS)] = 2000
    max_time: opt.MaxTime = None
    end_at: Annotated[
        list[str] | None, option("End where a quantity has this value: max-opening=0.1.", of="NAME=VALUE")
    ] = None
    constant: opt.Constant = None
    given: opt.Given = None

    @cached_property
    def ends(self) -> dict[str, float]:
        """Values at which the path ends."""
        from hemivar.branches.path_quantities import checked_until

        return dict(checked_until(dict(map(_named_value, self.end_at or ()))))

    def check(self) -> None:
        from hemivar.branches.path_quantities import QUANTITIES
        from hemivar.solvers.numbers_by_name import parted

        check_load_factors(*self.load_factor)
        parts = None if self.quantity is None else parted(self.quantity)
        if self.quantity is not None and self.quantity not in QUANTITIES and (parts is None or parts[0] != "support"):
            raise ProblemError(f"quantity '{self.quantity}' is not known{suggest(self.quantity, list(QUANTITIES))}")
        _ = self.ends  # one that is not known is refused

    def work(self) -> Done:
        from hemivar.report.path_diagrams import fitting_quantity, plot_path
        from hemivar.report.summary import Summary
        from hemivar.solvers.numbers_by_name import check_quantity, parted
        from hemivar.workflows import PathOptions, path

        session = self.session
        if self.quantity is not None and parted(self.quantity) is not None:
            check_quantity(self.quantity, session.stated.problem)
        options = PathOptions(
            self.load_factor,
            self.max_points,
            session.controls.max_time,
            until=self.ends,
            constant=tuple(self.constant or ()),
        )
        load_path = watched(path(session.stated.problem, options))
        print_head(session, load_path.problem)
        print(f"\n{load_path.failure}")
        print_unsaid(Summary.of(load_path.claims()).lines(), load_path.problem.notes)
        quantity = fitting_quantity(load_path) if self.quantity is None else self.quantity
        record = load_path.record(quantity)
        units = session.stated.units
        unit = units.force if "force" in quantity else units.length
        if self.quantity is not None:
            values = load_path.along(quantity)
            peak = max(range(len(values)), key=lambda k: abs(values[k]))
            size = f"{quantity} {values[peak]:.6g}{unit and ' ' + unit}"
            print(f"peak              {size} at load factor {load_path.load_factor[peak]:.6g}, point {peak}")
        draw = partial(plot_path, load_path, quantity=quantity, title=session.title, unit=unit)
        return Done({"--json": record, "--plot": draw}, load_path.reached_end, load_path.interrupted)


def _named_value(text: str) -> tuple[str, float]:
    """Of ``NAME=VALUE``."""
    name, _, value = text.partition("=")
    try:
        return name, float(value)
    except ValueError:
        raise ProblemError(f"--end-at is '{text}'; write NAME=VALUE, such as max-opening=0.1") from None


class BracketCommand(OnProblem):
    """Bracket the load that a body carries: the load grows from zero until no equilibrium is found.

    A load that is not carried is a numerical finding.

    Exit code 0 if the whole load is carried or the bracket is closed.
    """

    upto: Annotated[float, option("The largest load factor.", of="X")] = 5.0
    json: opt.Json = None
    plot: Annotated[opt.File, written("Draw the body at the largest load that it carries.")] = None
    colour: opt.Colour = None
    max_time: opt.MaxTime = None
    constant: opt.Constant = None
    given: opt.Given = None

    def check(self) -> None:
        check_colour(self.colour, {"--plot": self.plot})

    def work(self) -> Done:
        from hemivar.files import solution_record
        from hemivar.solvers import Status
        from hemivar.workflows import BracketOptions, bracket

        session = self.session
        check_drawable(session.stated, None, self.colour)
        options = BracketOptions(self.upto, session.controls.max_time, tuple(self.constant or ()))
        load_bracket = watched(bracket(session.stated.problem, options))
        print_head(session, load_bracket.solution.problem)
        print(f"\n{load_bracket}")
        record = {
            "problem": session.stated.name,
            **load_bracket.rows()[0],
            "solution": solution_record(load_bracket.solution),
        }
        pictures = pictures_of(session, load_bracket.solution, None, self.colour)
        return Done({"--json": record, **pictures}, load_bracket.complete, load_bracket.ended is Status.INTERRUPTED)
