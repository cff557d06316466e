"""``hemivar materials``: the nonlinear materials by name, and one with its constants, its bounds and its graph."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from hemivar.cli.law_study import check_reach, print_entry, print_examples, values_given
from hemivar.cli.options import Exit
from hemivar.cli.outputs import Writer, check_outputs
from hemivar.errors import ProblemError

__all__ = ["materials"]


def materials(
    name: Annotated[str | None, typer.Argument(metavar="NAME", help="Show this material only.")] = None,
    given: Annotated[
        list[str] | None, typer.Option("--set", metavar="KEY=VALUE", help="Set a constant of the material.")
    ] = None,
    reach: Annotated[float | None, typer.Option(metavar="X", help="Range of the plot: -X to X (automatic).")] = None,
    plot: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Draw stress over strain with its bounds (.png, .svg or .pdf).")
    ] = None,
) -> int:
    """List the nonlinear materials, or show one with its constants, bounds and graph."""
    check_outputs({"--plot": plot})
    if name is None:
        if given or reach is not None or plot is not None:
            raise ProblemError("name a material; 'hemivar materials' alone lists them")
        _list_materials()
        return Exit.CONVERGED
    check_reach(reach, "strain")
    from hemivar.workflows.material_study import study_material

    study = study_material(name, values_given(given, "strain=0.05"), label="--set ")
    print_entry(study.entry)
    print_examples(study.examples)
    print(f"\n{study.material.describe()}\n")
    writer = Writer()
    if plot is not None:
        from hemivar.report.material_figures import plot_material
        from hemivar.report.saving import save

        writer.write("--plot", plot, lambda path: save(plot_material(study.material, reach=reach), path), picture=True)
        writer.tell()
    return writer.ended(Exit.CONVERGED)


def _list_materials() -> None:
    """Print all materials with their constants."""
    from hemivar.mechanics.material_registry import MATERIAL_LAWS

    print("linear materials")
    print("\n  material = { lame = [lambda, mu] }, { young = ..., poisson = ... } or { tensor = [[...], ...] }")
    print("\nnonlinear materials")
    for entry in MATERIAL_LAWS.values():
        print_entry(entry)
    print("\nEvery number but reach is a number or, in quotes, a formula of x and y (and z).  All take density,")
    print("viscosity and branches as linear materials do, and stand in [material] or [material.regions.NAME].")
    print("'hemivar materials NAME' shows a material with its bounds, with --plot FILE its graph.")
