"""``hemivar laws``: the laws by name, and one law with its constants and its graph."""

from __future__ import annotations

import difflib
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from hemivar.basics.disk import noting_files_read
from hemivar.cli.outputs import Writer, keep_off
from hemivar.errors import ProblemError
from hemivar.formula import Formula
from hemivar.laws import Friction, Superpotential
from hemivar.laws.registry import FRICTION_LAWS, NORMAL_LAWS, LawEntry, LawKind, LawParameter, ParameterForm

__all__ = ["list_laws", "show_law"]


def list_laws() -> None:
    """Print all laws with their parameters."""
    for entries in (NORMAL_LAWS, FRICTION_LAWS):
        print(f"{next(iter(entries.values())).kind} laws")
        for entry in entries.values():
            _print_entry(entry)
        print()
    print("Every single number is a number or, in quotes, a formula of x and y (and z).  A friction bound may also be")
    print('{ table = "bound.csv" } or { formula = "8*s" } of the penetration s, or { coulomb = 0.3 } of the pressure.')
    print("'hemivar laws NAME' shows a law with its constants, with --plot FILE its graph.")


def show_law(
    name: str | None,
    given: Sequence[str],
    file: Path | None,
    formula: str | None,
    friction: bool,
    reach: float | None,
    plot: Path | None,
    writer: Writer,
) -> None:
    """Print the constants of one law, and draw it.

    Parameters
    ----------
    name : str or None
        A name of the registry; ``file`` and ``formula`` stand for the laws ``table`` and ``formula``.
    given : sequence of str
        Parameters, ``NAME=VALUE``.
    file : Path or None
    formula : str or None
    friction : bool
        Take the friction law of this name.
    reach : float or None
    plot : Path or None
    writer : Writer
        What writes the figure.
    """
    if sum(choice is not None for choice in (name, file, formula)) > 1:
        raise ProblemError("give one of NAME, --file and --formula")
    if reach is not None and not 1e-100 <= reach <= 1e100:
        raise ProblemError(f"--reach is {reach:g}; it must be a positive length (1e-100 to 1e100)")
    values: dict[str, str] = {}
    for pair in given:
        key, equals, text = pair.partition("=")
        if not equals:
            raise ProblemError(f"--set {pair}: write NAME=VALUE, such as --set bound=0.5")
        values[key.strip()] = text.strip()
    if file is not None:
        name, values["file"] = "table", str(file)
    if formula is not None:
        name, values["potential"] = "formula", formula
    assert name is not None
    found = [laws[name] for laws in (NORMAL_LAWS, FRICTION_LAWS) if name in laws]
    if not found:
        known = list(dict.fromkeys([*NORMAL_LAWS, *FRICTION_LAWS]))
        close = difflib.get_close_matches(name, known, n=1)
        guess = f"; did you mean '{close[0]}'?" if close else ""
        raise ProblemError(f"law '{name}' is not known{guess} (known: {', '.join(known)})")
    if friction:
        found = [entry for entry in found if entry.kind is LawKind.FRICTION]
        if not found:
            raise ProblemError(f"'{name}' is a normal law; leave out --friction")
    elif (plot or values) and len(found) > 1:
        found = found[:1]
    for entry in found:
        with noting_files_read() as files:
            law, note = _build(entry, values)
        keep_off({"--plot": plot}, files)
        print(f"{entry.kind} law")
        if file is None and formula is None:
            _print_entry(entry)
        if note:
            print(note)
        if law is None:
            continue
        scalar: Superpotential
        if isinstance(law, Friction):
            scalar = law.profile if law.state_dependent else law.radial
            if law.state_dependent:
                print("\nthe bound depends on the state of the contact point; below, for a bound of 1")
        else:
            scalar = law
        print(f"\n{scalar.describe()}\n")
        if plot is not None:
            from hemivar.report.law_figures import plot_law
            from hemivar.report.saving import save

            def draw(path: Path, scalar: Superpotential = scalar) -> None:
                save(plot_law(scalar, reach=reach), path)

            writer.write("--plot", plot, draw, picture=True)
            writer.tell()


def _print_entry(entry: LawEntry) -> None:
    required = "".join(f", {p.name} = {_sample(p)}" for p in entry.parameters if p.required)
    print(f"\n  {entry.name}: {entry.summary}")
    print(f"      {entry.formula}")
    print(f'      {entry.kind} = {{ law = "{entry.name}"{required} }}')
    for p in entry.parameters:
        default = ", may be left out" if p.optional else "" if p.default is None else f", default {_text(p.default)}"
        lowest = "" if p.minimum == -math.inf else f", at least {p.minimum:g}"
        form = "a list, " if p.form is ParameterForm.NUMBERS else ""
        print(f"      {p.name:<12}{form}{p.meaning} [{p.unit}]{lowest}{default}")


def _sample(p: LawParameter) -> str:
    return {ParameterForm.NUMBERS: "[...]", ParameterForm.FILE: '"law.csv"', ParameterForm.TEXT: '"..."'}.get(
        p.form, "..."
    )


def _text(value: Any) -> str:
    return f'"{value}"' if isinstance(value, str) else f"{value:g}"


def _build(entry: LawEntry, given: dict[str, str]) -> tuple[Any, str]:
    """The law with the values given and example values for the others, ``None`` if it needs a file; and a note."""
    known = {p.name: p for p in entry.parameters}
    for key in given:
        if key not in known:
            raise ProblemError(
                f"law '{entry.name}' has no parameter '{key}' (parameters: {', '.join(known) or 'none'})"
            )
    values: dict[str, Any] = {}
    shown: list[str] = []
    for p in entry.parameters:
        if p.name in given:
            values[p.name] = _value(p, given[p.name])
        elif p.form is ParameterForm.FILE:
            return None, "\nits graph comes from a file: give it with --file LAW.csv"
        elif p.shown is not None:
            values[p.name] = p.shown
            if p.default is None:
                value = p.shown
                shown.append(f"{p.name}={','.join(f'{x:g}' for x in value) if isinstance(value, tuple) else value}")
    law = entry.make(**values).at(None)
    note = f"\nshown with        {'  '.join(shown)}  (change them with --set)" if shown else ""
    return law, note


def _value(p: LawParameter, text: str) -> Any:
    if p.form in (ParameterForm.FILE, ParameterForm.TEXT):
        if p.choices and text not in p.choices:
            raise ProblemError(f"--set {p.name}={text}: write one of {', '.join(p.choices)}")
        return text
    where = f"--set {p.name}"
    parts = text.strip("[]").split(",") if p.form is ParameterForm.NUMBERS else [text]
    numbers = []
    for part in parts:
        formula = Formula(part, where)
        if formula.variables:
            raise ProblemError(f"{where}={text}: give a number here; a formula of x belongs in a problem file")
        numbers.append(float(formula([[0.0, 0.0]])[0]))  # type: ignore[arg-type]
    return numbers if p.form is ParameterForm.NUMBERS else numbers[0]
