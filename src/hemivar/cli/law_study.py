"""``hemivar laws`` and ``hemivar materials``: the laws and materials by name, and one with its constants and graph."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from hemivar.basics.disk import noting_files_read
from hemivar.cli import options as opt
from hemivar.cli.command import Command, Done
from hemivar.cli.options import option, written
from hemivar.cli.outputs import files_of, keep_off
from hemivar.errors import ProblemError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from hemivar.laws import MixedMode, ModeDependentGlue, OwnCoupledLaw, Superpotential
    from hemivar.laws.registry import LawEntry, LawKind
    from hemivar.workflows import LawStudy
    from hemivar.workflows.law_study import Value

__all__ = ["LawsCommand", "MaterialsCommand"]


class LawsCommand(Command):
    """List the laws of foundations, or show one with its constants and graph."""

    name: Annotated[str | None, typer.Argument(metavar="NAME", help="Show this law only.")] = None
    given: Annotated[list[str] | None, option("Set a parameter of the law.", "--set", of="KEY=VALUE")] = None
    file: Annotated[Path | None, option("Show a tabulated law.", of="LAW.csv")] = None
    formula: Annotated[str | None, option("Show the law of this potential of r.", of="TEXT")] = None
    friction: Annotated[
        bool, option("A friction law: table or formula for r >= 0, or the one of two by NAME.", "--friction")
    ] = False
    reach: Annotated[float | None, option("Range of the plot: -X to X (automatic).", of="X")] = None
    plot: Annotated[opt.File, written("Draw graph and potential (.png, .svg or .pdf).")] = None
    allow_code: opt.AllowCode = None

    @property
    def read(self) -> Path | None:
        return self.file

    def check(self) -> None:
        asked = sum(choice is not None for choice in (self.name, self.file, self.formula))
        if not asked and (self.given or self.friction or self.reach is not None or self.plot is not None):
            raise ProblemError("name a law, or give --file or --formula; 'hemivar laws' lists the laws")
        if asked > 1:
            raise ProblemError("give one of NAME, --file and --formula")
        _check_reach(self.reach, "length")

    def work(self) -> Done:
        name = "table" if self.file is not None else "formula" if self.formula is not None else self.name
        if name is None:
            _list_laws()
            return Done()
        from hemivar.laws.registry import FRICTION_LAWS, NORMAL_LAWS
        from hemivar.workflows import result_of, study_law

        values = _values_given(self.given, "bound=0.5")
        values |= {} if self.file is None else {"file": str(self.file)}
        values |= {} if self.formula is None else {"potential": self.formula}
        if self.friction and name in NORMAL_LAWS and name not in FRICTION_LAWS:
            raise ProblemError(f"'{name}' is a normal law; leave out --friction")
        with noting_files_read() as files:
            first, code = self.plot is not None, self.allow_code or ()
            work = study_law(name, values, friction=self.friction, first=first, label="--set ", code=code)
            studies = result_of(work)
        keep_off(files_of(self.outputs), files)
        for study in studies:
            _print_study(study, named=name == self.name)
        curve = studies[0].curve
        return Done({} if curve is None else {"--plot": partial(_drawn, curve, self.reach)})


class MaterialsCommand(Command):
    """List the nonlinear materials, or show one with its constants, bounds and graph."""

    name: Annotated[str | None, typer.Argument(metavar="NAME", help="Show this material only.")] = None
    given: Annotated[list[str] | None, option("Set a constant of the material.", "--set", of="KEY=VALUE")] = None
    reach: Annotated[float | None, option("Range of the plot: -X to X (automatic).", of="X")] = None
    plot: Annotated[opt.File, written("Draw stress over strain with its bounds (.png, .svg or .pdf).")] = None

    def check(self) -> None:
        if self.name is None and (self.given or self.reach is not None or self.plot is not None):
            raise ProblemError("name a material; 'hemivar materials' alone lists them")
        _check_reach(self.reach, "strain")

    def work(self) -> Done:
        if self.name is None:
            _list_materials()
            return Done()
        from hemivar.workflows.material_study import study_material

        study = study_material(self.name, _values_given(self.given, "strain=0.05"), label="--set ")
        _print_entry(study.entry)
        _print_examples(study.examples)
        print(f"\n{study.material.describe()}\n")

        def draw() -> Figure:
            from hemivar.report.material_figures import plot_material

            return plot_material(study.material, reach=self.reach)

        return Done({"--plot": draw})


def _values_given(given: list[str] | None, example: str) -> dict[str, str]:
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
    from hemivar.laws import Friction, Superpotential, VectorLaw
    from hemivar.laws.memory import Memory
    from hemivar.laws.registry import COUPLED_LAWS, FRICTION_LAWS, MEMORIES, NORMAL_LAWS, LawKind

    titles = ("normal laws", "laws of opening and slip together", "friction laws", "memories, in time only")
    for title, entries in zip(titles, (NORMAL_LAWS, COUPLED_LAWS, FRICTION_LAWS, MEMORIES), strict=True):
        print(title)
        for entry in entries.values():
            _print_entry(entry)
        print()
    bases = {LawKind.FRICTION: (Friction,), LawKind.NORMAL: (Superpotential, VectorLaw), LawKind.MEMORY: (Memory,)}
    _list_installed("laws", bases)
    print("Every single number is a number or, in quotes, a formula of x and y (and z).  A friction bound may also be")
    print('{ table = "bound.csv" } or { formula = "8*s" } of the penetration s, or { coulomb = 0.3 } of the pressure.')
    print("'hemivar laws NAME' shows a law with its constants, with --plot FILE its graph.")


def _list_installed(what: str, bases: Mapping[LawKind, tuple[type, ...]]) -> None:
    """Print what installed packages name, each with its package."""
    from hemivar.laws.registry import installed_laws

    title = f"{what} of installed packages\n"
    for package, entry in installed_laws(bases):
        print(title, end="")
        title = ""
        if isinstance(entry, str):
            print(f"\n  {entry} (package {package})")
        else:
            _print_entry(entry, f" (package {package})")
    if not title:
        print()


def _print_study(study: LawStudy, named: bool) -> None:
    print(study.entry.noun if study.entry.noun != "law" else f"{study.entry.kind} law")
    if named:
        _print_entry(study.entry)
    if study.curve is None:
        if study.entry.noun == "law":
            print("\nits graph comes from a file: give it with --file LAW.csv")
        return
    _print_examples(study.examples)
    if study.unit_bound:
        print("\nthe bound depends on the state of the contact point; below, for a bound of 1")
    print(f"\n{study.curve.describe()}\n")


def _check_reach(reach: float | None, what: str) -> None:
    """Refuse a reach of a picture that is none."""
    if reach is not None and not 1e-100 <= reach <= 1e100:
        raise ProblemError(f"--reach is {reach:g}; it must be a positive {what} (1e-100 to 1e100)")


def _print_examples(examples: Mapping[str, Value]) -> None:
    """Say which values are examples."""
    if examples:
        values = "  ".join(
            f"{key}={','.join(f'{x:g}' for x in value) if isinstance(value, tuple) else value}"
            for key, value in examples.items()
        )
        print(f"\nshown with        {values}  (change them with --set)")


def _drawn(curve: Superpotential | MixedMode | ModeDependentGlue | OwnCoupledLaw, reach: float | None) -> Figure:
    from hemivar.laws import MixedMode, ModeDependentGlue, OwnCoupledLaw
    from hemivar.report.law_figures import plot_coupled_law, plot_law, plot_mixed_mode, plot_mode_dependent

    match curve:
        case MixedMode():
            return plot_mixed_mode(curve, reach=reach)
        case ModeDependentGlue():
            return plot_mode_dependent(curve, reach=reach)
        case OwnCoupledLaw():
            return plot_coupled_law(curve, reach=reach)
    return plot_law(curve, reach=reach)


def _print_entry(entry: LawEntry, of: str = "") -> None:
    """Print a law or a material with its parameters, as a problem file writes it."""
    from hemivar.basics.stated import Form

    samples = {Form.LIST: "[...]", Form.FILE: '"law.csv"', Form.TEXT: '"..."'}
    required = "".join(f", {p.key} = {samples.get(p.stated.form, '...')}" for p in entry.parameters if p.required)
    print(f"\n  {entry.name}{of}: {entry.summary}")
    if entry.formula:
        print(f"      {entry.formula}")
    table = f'{{ {entry.key} = "{entry.name}"{required} }}'
    print(f"      {entry.kind} = {f'[{table}]' if entry.noun == 'memory' else table}")
    for p in entry.parameters:
        stated = p.stated
        value = f'"{p.default}"' if isinstance(p.default, str) else f"{p.default:g}" if p.default is not None else ""
        default = f", default {value}" if value else "" if p.required else ", may be left out"
        lowest = ", positive" if stated.above == 0.0 else "" if stated.above is None else f", above {stated.above:g}"
        lowest = lowest if stated.least is None else f", at least {stated.least:g}"
        unit = f" [{stated.unit}]" if stated.unit else ""
        form = "a list, " if stated.form is Form.LIST else ""
        print(f"      {p.key:<11} {form}{stated.says}{unit}{lowest}{default}")


def _list_materials() -> None:
    """Print all materials with their constants."""
    from hemivar.laws.registry import LawKind
    from hemivar.mechanics.material_registry import MATERIAL_LAWS
    from hemivar.mechanics.stored_energy import StoredEnergy

    print("linear materials")
    print("\n  material = { lame = [lambda, mu] }, { young = ..., poisson = ... } or { tensor = [[...], ...] }")
    print("\nnonlinear materials")
    for entry in MATERIAL_LAWS.values():
        _print_entry(entry)
    print()
    _list_installed("materials", {LawKind.MATERIAL: (StoredEnergy,)})
    print("Every number but reach is a number or, in quotes, a formula of x and y (and z).  All take density,")
    print("viscosity and branches as linear materials do, and go into [material] or [material.regions.NAME].")
    print("'hemivar materials NAME' shows a material with its bounds, with --plot FILE its graph.")
