"""Every method against every law: what it solves, to which accuracy, what it refuses, where it fails.

    python benchmarks/method_table.py                          print the table as Markdown
    python benchmarks/method_table.py --json methods.json      and write every single run
    python benchmarks/method_table.py --docs docs/evidence.md  put its sums between the markers of that page
    python benchmarks/method_table.py --check                  exit with 1 if a method says "converged" and is wrong

Every normal law is put under every friction law, on the survey's square (cross mesh, clamped at x = 0) and, without
friction, on a bar. Each run is judged by the residual of what the method returned, recomputed from the problem; where
the margin shows that there is one solution also by the distance to it in the energy norm. Where there may be several,
any Clarke-stationary point counts as right: which one it is, is another question.
"""

from __future__ import annotations

import argparse
import json
import sys
import warnings
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

import hemivar as hv
from hemivar import gallery, laws
from hemivar.certificates import smallness
from hemivar.discrete import residual
from hemivar.solvers.solve import suited
from hemivar.systems import CondensedProblem, condense

BEGIN, END = "<!-- method table: begin (benchmarks/method_table.py) -->", "<!-- method table: end -->"

#: "Converged" with a larger relative residual, and a larger relative error where the solution is known, is wrong.
WRONG = 1e-6

NORMAL: dict[str, Callable[[], hv.laws.Superpotential]] = {
    "survey": lambda: laws.ThresholdCompliance(0.3, 2.0),
    "signorini": laws.Signorini,
    "bilateral": laws.Bilateral,
    "compliance": lambda: laws.Compliance(50.0, 2.0),
    "finite-penetration": lambda: laws.FinitePenetration(2.0, 0.05),
    "softening, mild": lambda: laws.Softening(2.0, 0.05, 0.3),
    "softening, steep": lambda: laws.Softening(10.0, 0.03, 8.0),
    "capped": lambda: laws.Capped(10.0, 0.03),
    "layered": lambda: laws.Layered([0.02, 0.03], [10.0, 5.0], [0.1, 0.2], base=4.0),
    "adhesive, brittle": lambda: laws.Adhesive(5.0, 0.1),
    "adhesive, softening": lambda: laws.Adhesive(5.0, 0.1, softening=2.0, compression=20.0),
    "saw-tooth": lambda: laws.SawTooth([0.02, 0.05], [10.0, 5.0], [0.0, 0.05], compression=20.0),
    "formula": lambda: laws.FormulaLaw("piecewise((0, r < 0), (0.3*r + 0.1*(1 - exp(-2*r)), True))"),
}

FRICTION: dict[str, Callable[[], hv.laws.Friction]] = {
    "none": laws.NoFriction,
    "tresca": lambda: laws.Tresca(0.2),
    "slip-weakening": lambda: laws.SlipWeakening(0.3, rate=2.0),
    "logarithmic": lambda: laws.Logarithmic(0.3),
    "static-kinetic": lambda: laws.StaticKinetic(0.3, 0.01),
    "slip-table": lambda: laws.SlipTable(0.3, [0.0, 0.05, 0.1], [1.0, 0.8, 0.7]),
    "penetration bound": lambda: laws.Tresca(laws.PenetrationBound(([0.0, 0.1], [0.0, 0.4]))),
    "coulomb": lambda: laws.Tresca(laws.CoulombBound(0.3)),
}


@dataclass(frozen=True)
class Run:
    """One method on one problem."""

    body: str
    normal: str
    friction: str
    method: str
    outcome: str
    words: str
    residual: float | None
    difference: float | None
    unique: bool
    wrong: bool

    @property
    def solved(self) -> bool:
        return self.outcome == "converged"


def bodies(n: int) -> list[tuple[str, str, str, hv.DiscreteProblem]]:
    """Body, normal law, friction law and problem."""
    found = []
    for normal, make in NORMAL.items():
        law = make()
        load = -0.3 if "adhesive" in normal or normal == "saw-tooth" else 0.3
        found.append(("bar", normal, "none", gallery.elastic_bar(law, load=load)))
        for friction, tangential in FRICTION.items():
            pulled = "adhesive" in normal or normal == "saw-tooth"
            problem = hv.ContactProblem(
                mesh=hv.rectangle((1.0, 1.0), n, pattern="cross"),
                material=hv.Material.lame(4.0, 4.0),
                supports={"left": hv.Clamped()},
                contact={"bottom": hv.Contact(law, tangential())},
                body_force=(-0.8, 0.3) if pulled else (-0.8, -0.8),
            )
            found.append(("square", normal, friction, hv.discretize(problem)))
    return found


def one(
    where: tuple[str, str, str],
    problem: hv.DiscreteProblem,
    name: str,
    reference: hv.Solution,
    context: tuple[CondensedProblem, bool, float],
) -> Run:
    """Run a method and judge what it returns."""
    system, unique, seconds = context
    try:
        solver = suited(hv.solvers.METHODS[name], problem)
        found = hv.solve(problem, solver, hv.Controls(max_time=seconds), workspace=hv.systems.Workspace.holding(system))
    except hv.errors.MethodError as error:
        words = str(error).split("cannot solve this problem: ")[-1]
        return Run(*where, name, "refuses", words, None, None, unique, False)
    except hv.HemivarError as error:
        return Run(*where, name, "error", str(error), None, None, unique, False)
    judged = residual(problem, found.unknowns, found.multiplier).relative
    K, v = problem.stiffness, found.unknowns - reference.unknowns
    size = float(np.sqrt(reference.unknowns @ (K @ reference.unknowns)))
    difference = float(np.sqrt(max(v @ (K @ v), 0.0))) / size if size > 0.0 else float(np.linalg.norm(v))
    says = found.status is hv.Status.CONVERGED
    right = judged <= WRONG or (unique and difference <= WRONG)
    if unique and difference > 1e-4:
        right = False
    return Run(*where, name, found.status.value, found.status.remedy, judged, difference, unique, says and not right)


def run_all(n: int, seconds: float) -> list[Run]:
    """All runs."""
    runs = []
    for body, normal, friction, problem in bodies(n):
        system = condense(problem)
        margin = smallness(problem, trace_constant=False).margin
        reference = hv.solve(problem, None, hv.Controls(rtol=1e-13), workspace=hv.systems.Workspace.holding(system))
        context = (system, bool(margin > 0.0), seconds)
        for name in hv.solvers.METHODS:
            runs.append(one((body, normal, friction), problem, name, reference, context))
    return runs


def cell(runs: Sequence[Run]) -> str:
    """What a method does on a group of problems, in a few characters."""
    solved = [run for run in runs if run.solved]
    refused = sum(run.outcome == "refuses" for run in runs)
    if refused == len(runs):
        return "refuses"
    parts = []
    if solved:
        worst = max(run.residual or 0.0 for run in solved)
        parts.append(f"{len(solved)}: {worst:.0e}")
    if refused:
        parts.append(f"{refused} refused")
    failed: dict[str, int] = {}
    for run in runs:
        if not run.solved and run.outcome != "refuses":
            failed[run.outcome] = failed.get(run.outcome, 0) + 1
    parts += [f"{count} {outcome.replace('_', ' ')}" for outcome, count in failed.items()]
    wrong = sum(run.wrong for run in runs)
    if wrong:
        parts.append(f"**{wrong} WRONG**")
    return ", ".join(parts)


def table(title: str, groups: dict[str, list[Run]]) -> list[str]:
    """A Markdown table with one row for each group of problems and one column for each method."""
    names = list(hv.solvers.METHODS)
    lines = [
        f"| {title} | problems (unique) | " + " | ".join(f"`{name}`" for name in names) + " |",
        "|---" * (len(names) + 2) + "|",
    ]
    for group, runs in groups.items():
        first = [run for run in runs if run.method == names[0]]
        unique = sum(run.unique for run in first)
        cells = [cell([run for run in runs if run.method == name]) for name in names]
        lines.append(f"| {group} | {len(first)} ({unique}) | " + " | ".join(cells) + " |")
    return lines


def report(runs: list[Run], n: int, seconds: float) -> str:
    """The section of the documentation."""
    by_normal = {name: [run for run in runs if run.normal == name] for name in NORMAL}
    by_friction = {name: [run for run in runs if run.friction == name and run.body == "square"] for name in FRICTION}
    wrong = [run for run in runs if run.wrong]
    problems = len(runs) // len(hv.solvers.METHODS)
    known = sum(run.unique for run in runs) // len(hv.solvers.METHODS)
    converged = [run for run in runs if run.solved]
    far = [run for run in converged if run.unique and run.difference is not None]
    lines = [
        f"`python benchmarks/method_table.py` runs every method on {problems} problems: each normal law under each "
        f"friction law on the survey's square (1/h = {n}), and alone on a bar. A cell counts the problems on which the "
        "method says `CONVERGED`, with the largest relative residual of what it returned, recomputed from the problem; "
        "then those that it refused before any work, and those on which another status says that it failed. "
        f"Limit {seconds:g} s each.",
        "",
        f"For {known} of the problems the margin shows that there is one solution: there the largest relative distance "
        f"to it in the energy norm is {max((run.difference or 0.0) for run in far):.0e}, over all methods that say "
        "`CONVERGED`. For the others there may be several, methods may find different ones, and any "
        "Clarke-stationary point counts. Where a bound depends on the solution, `newton` takes it into its equation, "
        "and every other method runs inside `FixedPoint`.",
        "",
        f"Wrong answers with status `CONVERGED`: {len(wrong)} of {len(converged)}.",
        "",
        *table("normal law", by_normal),
        "",
        *table("friction law", by_friction),
        "",
        "Refusals, in the words of the method:",
        "",
    ]
    words: dict[str, dict[str, set[str]]] = {}
    for run in runs:
        if run.outcome == "refuses":
            words.setdefault(run.words, {}).setdefault(run.method, set()).add(run.normal)
    for text, methods in words.items():
        lines.append(f"* {', '.join(f'`{name}`' for name in methods)}: {text}")
    broken = {(run.method, run.words) for run in runs if run.outcome == "error"}
    if broken:
        lines += ["", "Errors instead of an answer:", "", *(f"* `{name}`: {text}" for name, text in sorted(broken))]
    return "\n".join(lines) + "\n"


def summary(runs: list[Run]) -> str:
    """One row for each method: on how many problems it converged, refused or failed, and how exact it was."""
    lines = [
        "| method | converged | refused | failed | wrong | largest residual | largest distance |",
        "|---|---:|---:|---:|---:|---:|---:|",
    ]
    for name in hv.solvers.METHODS:
        own = [run for run in runs if run.method == name]
        solved = [run for run in own if run.solved]
        refused = sum(run.outcome == "refuses" for run in own)
        worst = max((run.residual or 0.0 for run in solved), default=0.0)
        far = max((run.difference or 0.0 for run in solved if run.unique), default=0.0)
        failed, wrong = len(own) - len(solved) - refused, sum(run.wrong for run in own)
        lines.append(f"| `{name}` | {len(solved)} | {refused} | {failed} | {wrong} | {worst:.0e} | {far:.0e} |")
    return "\n".join(lines) + "\n"


def insert(page: Path, text: str) -> None:
    """Put the text between the markers of a page."""
    before, rest = page.read_text(encoding="utf-8").split(BEGIN, 1)
    after = rest.split(END, 1)[1]
    page.write_text(f"{before}{BEGIN}\n\n{text}\n{END}{after}", encoding="utf-8")


def main() -> int:
    parser = argparse.ArgumentParser(description="Every method against every law.")
    parser.add_argument("--n", type=int, default=4, help="1/h of the square")
    parser.add_argument("--seconds", type=float, default=5.0, help="time limit of each run")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write every run")
    parser.add_argument("--docs", type=Path, metavar="PAGE", help="put the sums of the tables into this page")
    parser.add_argument("--check", action="store_true", help="exit with 1 if an answer called converged is wrong")
    given = parser.parse_args()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)
        runs = run_all(given.n, given.seconds)
    text = report(runs, given.n, given.seconds)
    print(text)
    if given.json is not None:
        given.json.write_text(json.dumps([asdict(run) for run in runs], indent=1) + "\n", encoding="utf-8")
    if given.docs is not None:
        insert(given.docs, summary(runs))
    wrong = [run for run in runs if run.wrong]
    for run in wrong:
        print(f"WRONG: {run}", file=sys.stderr)
    return 1 if given.check and wrong else 0


if __name__ == "__main__":
    sys.exit(main())
