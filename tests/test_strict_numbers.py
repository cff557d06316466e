"""Callers who make NumPy raise, or Python take warnings for errors, get the same answers."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import hemivar as hv

EXAMPLES = Path(__file__).parents[1] / "examples"
#: Matplotlib and Matplotlib's dependencies underflow where they draw: only what they do is let alone.
_STRICT = """
import runpy, sys, warnings
import matplotlib
import matplotlib.figure
matplotlib.use("Agg")
matplotlib.figure.Figure.savefig = lambda *_, **__: None
import numpy as np
np.seterr(all="raise")
runpy.run_path(sys.argv[1], run_name="__main__")
"""


def loaded_square(law: hv.laws.Superpotential, friction: hv.laws.Friction | None = None) -> hv.ContactProblem:
    return hv.ContactProblem(
        mesh=hv.rectangle((1.0, 1.0), 4, pattern="cross"),
        material=hv.Material.lame(4.0, 4.0),
        supports={"left": hv.Clamped()},
        contact={"bottom": hv.Contact(law) if friction is None else hv.Contact(law, friction)},
        body_force=(0.3, -1.0),
    )


TASKS: dict[str, Callable[[hv.ContactProblem], object]] = {
    "certify": lambda problem: hv.solve(problem).certify(exact=True),
    "find": lambda problem: hv.find_solutions(problem),
    "march": lambda problem: hv.march(hv.Evolution(problem), 0.2, step=0.1),
    "multigrid": lambda problem: hv.solve(problem, method="multigrid"),
    "path": lambda problem: hv.follow_path(problem),
}


@pytest.mark.parametrize("task", TASKS)
def test_nothing_raises_where_numpy_raises(task: str) -> None:
    with np.errstate(all="raise"):
        problems = {
            "softening": loaded_square(hv.Softening(stiffness=60.0, limit=0.02, softening=16.0)),
            "coulomb": loaded_square(hv.Signorini(), hv.Coulomb(0.3)),
            "tresca": loaded_square(hv.laws.ThresholdCompliance(0.3, 2.0), hv.Tresca(0.1)),
            "glue": loaded_square(hv.laws.Adhesive(40.0, 1.0)),
            "formula": loaded_square(hv.laws.FormulaLaw(derivative="r*exp(-r^2)", reach=2.0)),
        }
        for name, problem in problems.items():
            try:
                TASKS[task](problem)
            except hv.HemivarError:
                continue  # in words, as without
            except FloatingPointError as error:
                raise AssertionError(f"{name}: {error}") from error


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(path.stem for path in EXAMPLES.glob("*.py")))
def test_examples_run_where_warnings_are_errors(name: str, tmp_path: Path) -> None:
    """``-W error``, and NumPy's floating point errors raised."""
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", _STRICT, str(EXAMPLES / f"{name}.py")],
        capture_output=True,
        text=True,
        cwd=tmp_path,
    )
    assert done.returncode == 0, done.stderr[-3000:]
