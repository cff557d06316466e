"""What the library computes, written down, so that a change that should change no number can be held against it.

    python benchmarks/recording.py --write before.json           on the code as it stands
    python benchmarks/recording.py --compare before.json         after the change: exit code 1 if something differs
    python benchmarks/recording.py --only gallery methods        parts of it: gallery, methods, large

Recorded are: every problem of the gallery with its solution (energy, residual, steps, evaluations, every number of the
JSON result) and its certificate; every run of the method table; energies, steps and cycles of the problems that
``overhead.py`` times, with the ratio of contact to linear solve.  Words and counts must agree, energies, forces and
certificates to ``--rtol`` of the largest entry of their kind; residuals and bounds, which are rounding themselves,
within a factor; times are compared by their ratio and never fail.
"""

from __future__ import annotations

import argparse
import json
import sys
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import method_table
import numpy as np
import overhead

import hemivar as hv
from hemivar import gallery
from hemivar.certify import certify
from hemivar.files import solution_record

#: Parts of a record that are times, or tell the version: not compared.
VOLATILE = ("timings", "seconds", "hemivar", "remedy")
#: What is rounding itself: the same size is all that can be asked.
ROUNDING = ("residual", "equilibrium", "inclusion", "error_bound", "history", "rounding", "direction")
PARTS = ("gallery", "methods", "large")


def stated() -> Iterator[tuple[str, Callable[[], hv.DiscreteProblem]]]:
    """Name and problem of everything in the gallery, small enough to take a second."""

    def of(make: Callable[[], hv.ContactProblem]) -> Callable[[], hv.DiscreteProblem]:
        return lambda: hv.discretize(make())

    for data in gallery.SURVEY_DATA:
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
        solution = hv.solve(problem)
        certificate = certify(problem, solution.unknowns, solution.multiplier)
        found[name] = solution_record(solution) | {"certificate": certificate.record()}
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
        solution = hv.solve(problem, hv.NonsmoothMultigrid())
        kept = {key: row[key] for key in ("unknowns", "steps", "cycles", "linear_cycles", "status")}
        found[f"{dim}D {law} 1/{n}"] = kept | {"energy": solution.energy, "timings": {"ratio": row["ratio"]}}
    return found


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
    makers = {"gallery": record_gallery, "methods": record_methods, "large": record_large}
    after = {part: makers[part]() for part in options.only}
    after = json.loads(json.dumps(after))
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
