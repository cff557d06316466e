"""What the library computes, written down, so that a change that should change no number can be held against it.

    python benchmarks/recording.py --write before.json           on the code as it stands
    python benchmarks/recording.py --compare before.json         after the change: exit code 1 if something differs
    python benchmarks/recording.py --only gallery methods        parts of it

The parts, each with every number of its JSON result:

* ``gallery``: every problem of the gallery, and its certificate; ``methods``: every run of the method table
* ``large``: energies, steps and cycles of the problems that ``overhead.py`` times, and contact over linear solve
* ``files``: every file of examples/problems, solved or marched with the steps that it states; ``examples``: every
  number, solution and march that a script of examples has when it has run
* ``adaptive``: end states and names of events of marches with adaptive steps
* ``bounds``: constants, exact distances, and the last mesh of adaptive ones; ``branches``: paths and all solutions
* ``ranks``: three files on two ranks, where PETSc and ``mpirun`` are

Static problems of ``gallery`` and ``files`` are solved to 1e-12.  Words and counts must agree, energies, forces and
certificates to ``--rtol`` of the largest entry of their kind; residuals and bounds, which are rounding themselves,
within a factor; times are compared by their ratio and never fail.
"""

from __future__ import annotations

import argparse
import contextlib
import importlib.util
import io
import json
import runpy
import shutil
import subprocess
import sys
import tempfile
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import method_table
import numpy as np
import overhead

import hemivar as hv
from hemivar import gallery
from hemivar.basics.generators import result_of
from hemivar.certificates import certify
from hemivar.files import solution_record
from hemivar.files.problem_file import read_problem_file
from hemivar.gallery.survey_problems import SURVEY_DATA
from hemivar.workflows import march as work
from hemivar.workflows.marching import evolution_of, plan_of

ROOT = Path(__file__).resolve().parents[1]
PROBLEMS = sorted((ROOT / "examples" / "problems").glob("*.toml"))
EXAMPLES = sorted((ROOT / "examples").glob("*.py"))
#: What static problems are solved to: far below what is compared.
FINE = hv.Controls(rtol=1e-12)
#: Parts of a record that are times, or tell the version: not compared.
VOLATILE = ("timings", "seconds", "hemivar", "remedy")
#: What is rounding itself: the same size is all that can be asked.
ROUNDING = ("residual", "equilibrium", "inclusion", "error_bound", "history", "rounding", "direction")
PARTS = ("gallery", "methods", "large", "files", "examples", "adaptive", "bounds", "branches", "ranks")


def stated() -> Iterator[tuple[str, Callable[[], hv.DiscreteProblem]]]:
    """Name and problem of everything in the gallery, small enough to take a second."""

    def of(make: Callable[[], hv.ContactProblem]) -> Callable[[], hv.DiscreteProblem]:
        return lambda: hv.discretize(make())

    for data in SURVEY_DATA:
        yield f"survey {data}", of(lambda data=data: gallery.survey(data, 16))
    yield "survey cube", of(lambda: gallery.survey_cube("5.1", 4))
    yield "survey logarithmic", of(lambda: gallery.survey_logarithmic(0.3, 16))
    yield "survey cube logarithmic", of(lambda: gallery.survey_cube_logarithmic(0.3, 4))
    yield "broken foundation", of(lambda: gallery.broken_foundation(8))
    yield "delamination", of(gallery.delamination)
    yield "beam", of(gallery.beam)
    for name in ("manufactured_spring", "manufactured_softening"):
        yield name, of(lambda name=name: getattr(gallery, name)(8).problem)


def numbers(value: Any, path: str = "") -> Iterator[tuple[str, Any]]:
    """Every entry of a record that is compared, with its path; long lists as arrays."""
    if isinstance(value, dict):
        for key, item in value.items():
            if key not in VOLATILE:
                yield from numbers(item, f"{path}/{key}")
    elif isinstance(value, list | tuple) and value and all(isinstance(item, dict) for item in value):
        for k, item in enumerate(value):
            yield from numbers(item, f"{path}/{k}")
    else:
        yield path, value


def record_gallery() -> dict[str, Any]:
    found = {}
    for name, make in stated():
        problem = make()
        found[name] = solved(problem)
    return found


def solved(problem: hv.DiscreteProblem) -> dict[str, Any]:
    """Record of a solution and of its certificate."""
    solution = hv.solve(problem, controls=FINE)
    return solution_record(solution) | {"certificate": certify(solution).record()}


def end_of(history: hv.evolution.History) -> dict[str, Any]:
    """Where a march ends, and what happened on its way: what does not depend on single adaptive steps."""
    state = history.state
    return {
        "place": state.body.displacement, "velocity": state.body.velocity, "multiplier": state.multiplier,
        "ended": history.ended, "events": [type(event).__name__ for event in history.events],
    }  # fmt: skip


def record_files() -> dict[str, Any]:
    """Every problem file, with the steps in time that it states."""
    found = {}
    for path in PROBLEMS:
        read = read_problem_file(path)
        if read.time is None:
            found[path.stem] = solved(hv.discretize(hv.read_problem(path)))
        else:
            history = result_of(work(evolution_of(read), plan_of(read)), lambda event: False)
            found[path.stem] = {"end": end_of(history), "table": history.to_dict()["table"]}
    return found


def kept(value: Any) -> Any:
    """What of a variable of a script is compared; None if nothing is."""
    if isinstance(value, hv.Solution):
        return solution_record(value)
    if isinstance(value, hv.evolution.History):
        return value.to_dict()["table"]
    if isinstance(value, hv.branches.Path):
        return value.to_dataframe().to_dict("list")
    if isinstance(value, dict):
        return {str(key): entry for key, item in value.items() if (entry := kept(item)) is not None} or None
    if isinstance(value, list | tuple):
        parts = [kept(item) for item in value]
        return parts if parts and all(part is not None for part in parts) else None
    if isinstance(value, np.ndarray) and value.dtype.kind in "biuf":
        return value
    return value if isinstance(value, bool | int | float | str | np.number) else None


def record_examples() -> dict[str, Any]:
    """What every script of examples has computed when it has run."""
    import matplotlib as mpl

    mpl.use("Agg")
    found = {}
    for path in EXAMPLES:
        with contextlib.redirect_stdout(io.StringIO()), contextlib.chdir(tempfile.gettempdir()):
            space = runpy.run_path(str(path), run_name="__main__")
        mine = {name: kept(value) for name, value in space.items() if not name.startswith("_")}
        if path.stem == "all_methods":
            del mine["names"]  # in the order of their times
        found[path.stem] = {name: value for name, value in mine.items() if value is not None}
    return found


def record_adaptive() -> dict[str, Any]:
    """Ends of marches with steps as long as the error allows."""
    found = {}
    for name in ("bounce", "delayed_failure", "relaxation", "wear"):
        read = read_problem_file(ROOT / "examples" / "problems" / f"{name}.toml")
        assert read.time is not None
        first = getattr(read.time.march.step, "step", None)
        steps = hv.evolution.AdaptiveStep(1e-3, first_step=first)
        history = hv.march(evolution_of(read), read.time.march.until, step=steps)
        found[name] = end_of(history)
    return found


def record_bounds() -> dict[str, Any]:
    """Constants of the body, distances to the solution of the continuous problem, and adaptive meshes."""
    found: dict[str, Any] = {}
    for name, problem in {
        "survey 5.1": gallery.survey("5.1", 16),
        "survey logarithmic": gallery.survey_logarithmic(0.3, 8),
        "survey cube": gallery.survey_cube("5.1", 2),
    }.items():
        found[name] = certify(hv.solve(problem, controls=FINE), exact=True).record()
    adaptive = hv.bounds.solve_adaptive(gallery.survey("5.1", 4), rtol=0.1)
    last = adaptive.levels[-1]
    found["adaptive survey"] = {
        "unknowns": [level.unknowns for level in adaptive.levels], "energy": adaptive.solution.energy,
        "distance": last.distance.distance, "cells": last.distance.cells,
    }  # fmt: skip
    return found


def record_branches() -> dict[str, Any]:
    """Paths over the load, and all solutions at some."""
    found: dict[str, Any] = {}
    for name, problem in {"survey 5.1": gallery.survey("5.1", 8), "delamination": gallery.delamination()}.items():
        found[f"path of {name}"] = kept(hv.follow_path(problem))
        found[f"solutions of {name}"] = {"energies": np.sort(hv.find_solutions(problem).energies)}
    return found


def record_ranks() -> dict[str, Any]:
    """Two static files and a march on two ranks; nothing where there are none."""
    if shutil.which("mpirun") is None or importlib.util.find_spec("petsc4py") is None:
        return {}
    found = {}
    begun = ["mpirun", "--allow-run-as-root", "--oversubscribe", "-n", "2", sys.executable, "-m", "hemivar"]
    for verb, name, written in (
        ("solve", "cube_friction", "json"), ("solve", "survey_5_1", "json"), ("march", "bounce", "json"),
    ):  # fmt: skip
        with tempfile.TemporaryDirectory() as folder:
            answer = Path(folder) / f"answer.{written}"
            file = ROOT / "examples" / "problems" / f"{name}.toml"
            line = [*begun, verb, str(file), "--engine", "petsc", "--json", str(answer)]
            subprocess.run(line, check=True, capture_output=True, cwd=folder)
            found[name] = json.loads(answer.read_text())
    return found


def record_methods() -> dict[str, Any]:
    found = {}
    for run in method_table.run_all(4, 5.0):
        found[f"{run.body}, {run.normal}, {run.friction}, {run.method}"] = {
            "outcome": run.outcome, "unique": run.unique, "wrong": run.wrong, "residual": run.residual,
        }  # fmt: skip
    return found


def record_large() -> dict[str, Any]:
    found = {}
    for (dim, law), n in ((key, 128 if key[0] == 2 else 16) for key in overhead.PROBLEMS):
        row, problem = overhead.measure(dim, law, n, 3)
        solution = hv.solve(problem, hv.solvers.NonsmoothMultigrid())
        kept = {key: row[key] for key in ("unknowns", "steps", "cycles", "linear_cycles", "status")}
        found[f"{dim}D {law} 1/{n}"] = kept | {"energy": solution.energy, "timings": {"ratio": row["ratio"]}}
    return found


def plain(value: Any) -> Any:
    """What JSON has no word for."""
    return value.tolist() if isinstance(value, np.ndarray | np.generic) else str(value)


def differs(path: str, before: Any, after: Any, rtol: float) -> str | None:
    """How two entries differ, or None."""
    if isinstance(before, bool | str | int | None) or isinstance(after, bool | str | None):
        return None if before == after else f"{before!r:.80} became {after!r:.80}"
    try:
        one, two = np.asarray(before, dtype=float), np.asarray(after, dtype=float)
    except (TypeError, ValueError):
        return None if before == after else f"{before!r:.80} became {after!r:.80}"
    if one.shape != two.shape:
        return f"shape {one.shape} became {two.shape}"
    with np.errstate(invalid="ignore"):  # what is infinite in both
        size, off = (float(np.nanmax(np.abs(x), initial=0.0)) for x in (one, one - two))
    if any(f"/{word}" in path for word in ROUNDING):
        rounding = max(size, float(np.nanmax(np.abs(two), initial=0.0))) <= 1e-9
        return None if rounding or off <= 10.0 * size else f"{before!r:.40} became {after!r:.40}"
    return None if off <= rtol * size + 1e-300 else f"off by {off:.2e} of {size:.2e}"


def compare(before: dict[str, Any], after: dict[str, Any], rtol: float) -> int:
    """Print what differs; how many entries."""
    count = 0
    for part, cases in before.items():
        for case, old in cases.items():
            new = after.get(part, {}).get(case)
            if new is None:
                print(f"{part}: {case}: missing")
                count += 1
                continue
            fresh = dict(numbers(new))
            for path, value in numbers(old):
                if path not in fresh:
                    print(f"{part}: {case}{path}: missing")
                    count += 1
                elif (how := differs(path, value, fresh[path], rtol)) is not None:
                    print(f"{part}: {case}{path}: {how}")
                    count += 1
            if "timings" in old and "ratio" in old["timings"]:
                print(
                    f"{part}: {case}: contact/linear {old['timings']['ratio']:.2f}, now {new['timings']['ratio']:.2f}"
                )
    return count


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--write", type=Path, default=None)
    parser.add_argument("--compare", type=Path, default=None)
    parser.add_argument("--only", nargs="+", choices=PARTS, default=PARTS)
    parser.add_argument("--rtol", type=float, default=1e-9)
    options = parser.parse_args()
    warnings.simplefilter("ignore")
    after = {}
    for part in options.only:
        print(part, flush=True)
        after[part] = globals()[f"record_{part}"]()
    after = json.loads(json.dumps(after, default=plain))
    if options.write is not None:
        options.write.write_text(json.dumps(after))
    if options.compare is None:
        return 0
    before = {part: cases for part, cases in json.loads(options.compare.read_text()).items() if part in options.only}
    count = compare(before, after, options.rtol)
    print(f"{count} entries differ")
    return 1 if count else 0


if __name__ == "__main__":
    sys.exit(main())
