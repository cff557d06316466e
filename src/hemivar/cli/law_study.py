"""``hemivar laws``: the laws by name, and one law with its constants and its graph."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from hemivar.basics.disk import noting_files_read
from hemivar.basics.stated import Form
from hemivar.cli.options import Exit
from hemivar.cli.outputs import Writer, check_outputs, files_of, keep_off
from hemivar.errors import ProblemError

if TYPE_CHECKING:
    from hemivar.laws import MixedMode, ModeDependentGlue, OwnCoupledLaw, Superpotential
    from hemivar.laws.registry import LawEntry
    from hemivar.workflows import LawStudy
    from hemivar.workflows.law_study import Value

__all__ = ["check_reach", "laws", "print_entry", "print_examples", "values_given"]


def laws(
    name: Annotated[str | None, typer.Argument(metavar="NAME", help="Show this law only.")] = None,
    given: Annotated[
        list[str] | None, typer.Option("--set", metavar="KEY=VALUE", help="Set a parameter of the law.")
    ] = None,
    file: Annotated[Path | None, typer.Option(metavar="LAW.csv", help="Show a tabulated law.")] = None,
    formula: Annotated[str | None, typer.Option(metavar="TEXT", help="Show the law of this potential of r.")] = None,
    friction: Annotated[
        bool, typer.Option("--friction", help="A friction law: table or formula for r >= 0, or the one of two by NAME.")
    ] = False,
    reach: Annotated[float | None, typer.Option(metavar="X", help="Range of the plot: -X to X (automatic).")] = None,
    plot: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Draw graph and potential (.png, .svg or .pdf).")
    ] = None,
) -> int:
    """List the laws of foundations, or show one with its constants and graph."""
    check_outputs({"--plot": plot}, file)
    if name is None and file is None and formula is None:
        if given or friction or reach is not None or plot is not None:
            raise ProblemError("name a law, or give --file or --formula; 'hemivar laws' alone lists the laws")
        _list_laws()
        return Exit.CONVERGED
    if sum(choice is not None for choice in (name, file, formula)) > 1:
        raise ProblemError("give one of NAME, --file and --formula")
    check_reach(reach, "length")
    from hemivar.laws.registry import FRICTION_LAWS, NORMAL_LAWS
    from hemivar.workflows import result_of, study_law

    values = values_given(given, "bound=0.5")
    if file is not None:
        name, values["file"] = "table", str(file)
    if formula is not None:
        name, values["potential"] = "formula", formula
    assert name is not None
    if friction and name in NORMAL_LAWS and name not in FRICTION_LAWS:
        raise ProblemError(f"'{name}' is a normal law; leave out --friction")
    with noting_files_read() as files:
        work = study_law(name, values, friction=friction, first=plot is not None, label="--set ")
        studies = result_of(work)
    keep_off(files_of({"--plot": plot}), files)
    writer = Writer()
    for study in studies:
        _print_study(study, named=file is None and formula is None)
        if plot is not None and study.curve is not None:
            _draw(study.curve, reach, plot, writer)
    return writer.ended(Exit.CONVERGED)


def values_given(given: list[str] | None, example: str) -> dict[str, str]:
    """The values of ``--set NAME=VALUE``, by name."""
    values: dict[str, str] = {}
    for pair in given or []:
        key, equals, text = pair.partition("=")
        if not equals:
            raise ProblemError(f"--set {pair}: write NAME=VALUE, such as --set {example}")
        values[key.strip()] = text.strip()
    return values


def _list_laws() -> None:
    """Print all laws with their parameters."""
    from hemivar.laws.registry import COUPLED_LAWS, FRICTION_LAWS, NORMAL_LAWS

    titles = ("normal laws", "laws of opening and slip together", "friction laws")
    for title, entries in zip(titles, (NORMAL_LAWS, COUPLED_LAWS, FRICTION_LAWS), strict=True):
        print(title)
        for entry in entries.values():
            print_entry(entry)
        print()
    print("Every single number is a number or, in quotes, a formula of x and y (and z).  A friction bound may also be")
    print('{ table = "bound.csv" } or { formula = "8*s" } of the penetration s, or { coulomb = 0.3 } of the pressure.')
    print("'hemivar laws NAME' shows a law with its constants, with --plot FILE its graph.")


def _print_study(study: LawStudy, named: bool) -> None:
    print(f"{study.entry.kind} law")
    if named:
        print_entry(study.entry)
    if study.curve is None:
        print("\nits graph comes from a file: give it with --file LAW.csv")
        return
    print_examples(study.examples)
    if study.unit_bound:
        print("\nthe bound depends on the state of the contact point; below, for a bound of 1")
    print(f"\n{study.curve.describe()}\n")


def check_reach(reach: float | None, what: str) -> None:
    """Refuse a reach of a picture that is none."""
    if reach is not None and not 1e-100 <= reach <= 1e100:
        raise ProblemError(f"--reach is {reach:g}; it must be a positive {what} (1e-100 to 1e100)")


def print_examples(examples: Mapping[str, Value]) -> None:
    """Say which values are examples."""
    if examples:
        told = "  ".join(
            f"{key}={','.join(f'{x:g}' for x in value) if isinstance(value, tuple) else value}"
            for key, value in examples.items()
        )
        print(f"\nshown with        {told}  (change them with --set)")


def _draw(
    curve: Superpotential | MixedMode | ModeDependentGlue | OwnCoupledLaw,
    reach: float | None,
    plot: Path,
    writer: Writer,
) -> None:
    from hemivar.laws import MixedMode, ModeDependentGlue, OwnCoupledLaw
    from hemivar.report.law_figures import plot_coupled_law, plot_law, plot_mixed_mode, plot_mode_dependent
    from hemivar.report.saving import save

    def draw(path: Path) -> None:
        match curve:
            case MixedMode():
                fig = plot_mixed_mode(curve, reach=reach)
            case ModeDependentGlue():
                fig = plot_mode_dependent(curve, reach=reach)
            case OwnCoupledLaw():
                fig = plot_coupled_law(curve, reach=reach)
            case _:
                fig = plot_law(curve, reach=reach)
        save(fig, path)

    writer.write("--plot", plot, draw, picture=True)
    writer.tell()


def print_entry(entry: LawEntry) -> None:
    """Print a law or a material with its parameters, as a problem file writes it."""
    samples = {Form.LIST: "[...]", Form.FILE: '"law.csv"', Form.TEXT: '"..."'}
    required = "".join(f", {p.key} = {samples.get(p.said.form, '...')}" for p in entry.parameters if p.required)
    print(f"\n  {entry.name}: {entry.summary}")
    print(f"      {entry.formula}")
    print(f'      {entry.kind} = {{ law = "{entry.name}"{required} }}')
    for p in entry.parameters:
        said = p.said
        value = f'"{p.default}"' if isinstance(p.default, str) else f"{p.default:g}" if p.default is not None else ""
        default = f", default {value}" if value else "" if p.required else ", may be left out"
        lowest = ", positive" if said.above is not None else "" if said.least is None else f", at least {said.least:g}"
        form = "a list, " if said.form is Form.LIST else ""
        print(f"      {p.key:<11} {form}{said.says} [{said.unit}]{lowest}{default}")
