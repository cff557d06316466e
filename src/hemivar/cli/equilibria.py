"""``hemivar solutions``, ``path`` and ``bracket``: the equilibria of a problem, at its load and while it grows."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from hemivar.basics.arguments import suggest
from hemivar.cli.options import (
    MOST_STEPS,
    Colour,
    Exit,
    Given,
    Json,
    MaxSolutions,
    MaxTime,
    ProblemPath,
    Rtol,
    Seed,
    Starts,
    check_colour,
    check_load_factors,
)
from hemivar.cli.printing import StageView, console, print_head, print_table
from hemivar.cli.session import Session
from hemivar.cli.solving import check_drawable, draw
from hemivar.errors import ProblemError

if TYPE_CHECKING:
    from hemivar.basics.types import Array
    from hemivar.basics.units import Units
    from hemivar.branches import Path as EquilibriumPath
    from hemivar.branches import SolutionSet
    from hemivar.report.tables import Table

__all__ = ["bracket", "path", "solutions"]

_SHOWN = 12


def solutions(
    problem: ProblemPath,
    json: Json = None,
    plot: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Draw all side by side, and each one as FILE_1, FILE_2 ...")
    ] = None,
    colour: Colour = None,
    starts: Starts = 40,
    max_solutions: MaxSolutions = 100,
    seed: Seed = 0,
    rtol: Rtol = None,
    max_time: MaxTime = None,
    given: Given = None,
) -> int:
    """Find all solutions of a problem, with their energies and kinds; says how far it searched.

    Exit code 0 if at least one was found.
    """
    check_colour(colour, {"--plot": plot})
    session = Session(problem, {"--json": json, "--plot": plot}, rtol=rtol, max_time=max_time, given=given)
    check_drawable(session.stated, None, colour)
    discrete = session.discrete()
    print_head(session.stated, discrete)
    from hemivar.files import solution_record
    from hemivar.workflows import SolutionsOptions, result_of
    from hemivar.workflows import solutions as search

    with StageView(console()) as view:
        found = result_of(search(discrete, SolutionsOptions(starts, max_solutions, seed, session.controls)), view)
    if json is not None:
        record = {
            "problem": session.stated.name,
            "exhaustive": found.exhaustive,
            "searched": found.searched,
            "starts": found.starts,
            "solutions": [{"kind": s.kind, **solution_record(s)} for s in found],
        }
        session.writer.write_record(json, record)
    print(f"solutions         {len(found)}; {'no others exist' if found.exhaustive else 'there may be others'}")
    print(f"searched          {found.searched}")
    if len(found):
        print_table(console(), _solutions_table(found, session.stated.units))
        for number, one in enumerate(found):
            if one.deformation is not None and one.deformation.warning is not None:
                print(f"warning           solution {number + 1}: {one.deformation.warning}")
        if plot is not None:
            _draw(session, found, plot, colour)
    session.writer.tell()
    code = Exit.CONVERGED if len(found) else Exit.NOT_CONVERGED
    return session.writer.ended(Exit.INTERRUPTED if found.interrupted else code)


def _draw(session: Session, found: SolutionSet, file: Path, colour: str | None) -> None:
    """All solutions on one picture, and each on one of its own, named after it."""
    from hemivar.report import BodyColour, plot_solution, plot_solutions, save
    from hemivar.report.solution_pictures import MOST_PICTURES, common_scale
    from hemivar.systems.workspace import Workspace

    shade = None if colour is None else BodyColour(colour)
    units = session.stated.units
    kept, scale, writer = Workspace(), common_scale(found), session.writer

    def one(number: int, path: Path) -> None:
        solution = found[number]
        certificate = solution.certify(trace_constant=False, workspace=kept)
        title = f"{session.title or session.stated.name}, solution {number + 1}: energy {solution.energy:.6g}"
        save(
            plot_solution(
                solution,
                scale=scale,
                title=title,
                colour=shade,
                certificate=certificate,
                unit=units.length,
                stress_unit=units.stress,
            ),
            path,
        )

    def overview(path: Path) -> None:
        save(
            plot_solutions(found, title=session.title, colour=shade, unit=units.length, stress_unit=units.stress), path
        )

    writer.write("--plot", file, overview, picture=True)
    for number in range(min(len(found), MOST_PICTURES)):
        own = file.with_name(f"{file.stem}_{number + 1}{file.suffix}")
        writer.write("--plot", own, lambda path, number=number: one(number, path), picture=True)  # type: ignore[misc]


def _solutions_table(found: SolutionSet, units: Units) -> Table:
    """One line for each solution."""
    from hemivar.report.tables import Table

    glued = any(s.debonding for s in found)
    columns = (
        "",
        "kind",
        units.head("energy", "energy"),
        units.head("max opening" if glued else "max penetration", "length"),
        units.head("normal force", "force"),
        "contact",
        "residual",
    )
    rows = tuple(
        (
            i + 1,
            s.kind,
            f"{s.energy:.10g}",
            f"{(-s.penetration if glued else s.penetration).max(initial=0.0):.6g}",
            f"{s.normal_force:.6g}",
            f"{s.contact_length:.6g}",
            s.residual.relative,
        )
        for i, s in enumerate(found)
    )
    return Table(columns, rows)


def path(
    problem: ProblemPath,
    load_factor: Annotated[
        tuple[float, float], typer.Option(metavar="LOW HIGH", help="Factor of all loads, from low to high.")
    ] = (0.0, 1.0),
    quantity: Annotated[
        str | None,
        typer.Option(
            metavar="NAME",
            help="What is drawn over the load: max-penetration, normal-force, ...; by default what changes most.",
        ),
    ] = None,
    json: Json = None,
    plot: Annotated[Path | None, typer.Option(metavar="FILE", help="Draw the path (.png, .svg or .pdf).")] = None,
    max_points: Annotated[int, typer.Option(metavar="N", min=2, max=MOST_STEPS, help="Limit of points.")] = 2000,
    max_time: MaxTime = None,
    end_at: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME=VALUE", help="End where a quantity has this value: max-opening=0.1."),
    ] = None,
    given: Given = None,
) -> int:
    """Follow the equilibria while the load grows, through folds: limit load, first instability, folds, jumps.

    Exit code 0 if the path reaches an end of the range, or the value of --end-at.
    """
    from hemivar.branches.path_quantities import QUANTITIES, checked_until
    from hemivar.report.path_diagrams import fitting_quantity, path_record, plot_path

    check_load_factors(*load_factor)
    if quantity is not None and quantity not in QUANTITIES:
        raise ProblemError(f"quantity '{quantity}' is not known{suggest(quantity, list(QUANTITIES))}")
    ends = checked_until(dict(_named_value(text) for text in end_at or ()))
    session = Session(problem, {"--json": json, "--plot": plot}, max_time=max_time, given=given)
    writer = session.writer
    print_head(session.stated, session.discrete())
    from hemivar.report.saving import save
    from hemivar.workflows import PathOptions, result_of
    from hemivar.workflows import path as follow

    options = PathOptions(load_factor, max_points, session.controls.max_time, until=ends)
    with StageView(console()) as view:
        found = result_of(follow(session.stated.problem, options), view)
    _print_path(found)
    quantity = fitting_quantity(found) if quantity is None else quantity
    record = path_record(found, quantity)
    for point in record["points"]:
        point["energy"] = point["energy"] if math.isfinite(point["energy"]) else None
    writer.write_record(json, record)

    def draw(file: Path) -> None:
        units = session.stated.units
        unit = units.force if "force" in quantity else units.length
        save(plot_path(found, quantity=quantity, title=session.title, unit=unit), file)

    writer.write("--plot", plot, draw, picture=True)
    writer.tell()
    code = Exit.CONVERGED if found.reached_end else Exit.NOT_CONVERGED
    return writer.ended(Exit.INTERRUPTED if found.interrupted else code)


def _named_value(text: str) -> tuple[str, float]:
    """Of ``NAME=VALUE``."""
    name, _, value = text.partition("=")
    try:
        return name, float(value)
    except ValueError:
        raise ProblemError(f"--end-at is '{text}'; write NAME=VALUE, such as max-opening=0.1") from None


def _print_path(path: EquilibriumPath) -> None:
    """Print what the path meets."""
    print(f"\n{path.failure}")
    print(f"path              {len(path)} points, {len(path.folds)} folds; {path.ended}")
    if path.perturbed:
        print("                  several points of the boundary met an event at once: this is one of several branches")
    folds, jumps = path.main_folds, path.main_jumps
    for fold in folds[:_SHOWN]:
        print(f"fold              load factor {fold.load_factor:.10g}, point {fold.index}")
    for point in path.bifurcations[:_SHOWN]:
        print(f"bifurcation       load factor {point.load_factor:.10g}, point {point.index}")
    for jump in jumps[:_SHOWN]:
        how = "loading" if jump.loading else "unloading"
        where = ", to no stable branch of this path" if jump.local is None else ""
        where = ", to a place that is interpolated" if jump.interpolated else where
        print(f"jump              load factor {jump.load_factor:.10g} while {how}, point {jump.index}{where}")
    if path.snapping is not None:
        print(f"single points     {path.snapping}")
    if len(folds) + len(jumps) < len(path.folds) + len(path.jumps) or max(len(folds), len(jumps)) > _SHOWN:
        print(f"                  (of {len(path.folds)} folds and {len(path.jumps)} jumps; all are in the --json file)")
    low, high = _rounded(path.max_penetration)
    print(f"max penetration   {low:.6g} to {high:.6g}")
    for warning in path.warnings:
        if warning not in path.problem.notes:  # which the head has
            print(f"warning           {warning}")


def _rounded(values: Array) -> tuple[float, float]:
    """Least and largest value, 0 where it is rounding beside the other."""
    ends = float(values.min()), float(values.max())
    small = 1e-12 * max(abs(end) for end in ends)
    low, high = (0.0 if abs(end) <= small else end for end in ends)
    return low, high


def bracket(
    problem: ProblemPath,
    upto: Annotated[float, typer.Option(metavar="X", help="The largest load factor.")] = 5.0,
    json: Json = None,
    plot: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Draw the body at the largest load that it carries.")
    ] = None,
    colour: Colour = None,
    max_time: MaxTime = None,
    given: Given = None,
) -> int:
    """Bracket the load that a body carries: the load grows from zero until no equilibrium is found.

    A load that is not carried is a numerical finding.

    Exit code 0 if the whole load is carried or the bracket is closed.
    """
    from hemivar.files import solution_record
    from hemivar.solvers import Status
    from hemivar.workflows import BracketOptions, result_of
    from hemivar.workflows import bracket as work

    check_colour(colour, {"--plot": plot})
    outputs = {"--json": json, "--plot": plot, "--plot-contact": None}
    session = Session(problem, outputs, max_time=max_time, given=given)
    check_drawable(session.stated, None, colour)
    options = BracketOptions(upto, session.controls.max_time)
    with StageView(console()) as view:
        found = result_of(work(session.stated.problem, options), view)
    print_head(session.stated, found.solution.problem)
    print(f"\n{found}")
    record = {
        "problem": session.stated.name,
        "upto": found.upto,
        "carried": found.carried,
        "not_carried": found.not_carried,
        "ended": found.ended.value,
        "tried": found.tried,
        "solution": solution_record(found.solution),
    }
    session.writer.write_record(json, record)
    draw(session, found.solution, None, colour)
    session.writer.tell()
    code = Exit.CONVERGED if found.complete else Exit.NOT_CONVERGED
    return session.writer.ended(Exit.INTERRUPTED if found.ended is Status.INTERRUPTED else code)
