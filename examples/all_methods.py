"""Every method on one problem: status, time, residual, and distance from the default in the energy norm."""

from __future__ import annotations

from pathlib import Path

import numpy as np

import hemivar as hv
from hemivar import gallery


def main(out: Path | None = None) -> dict[str, dict[str, float | str]]:
    """The survey's data (5.1) at h = 1/16; all methods share one condensation."""
    problem = hv.discretize(gallery.survey("5.1", 16))
    workspace = hv.Workspace()
    condensed = workspace.condensed(problem)
    controls = hv.Controls(max_time=20.0)
    reference = hv.solve(problem, workspace=workspace)  # the default method

    def energy_norm(u: np.ndarray) -> float:
        return float(np.sqrt(u @ (problem.linear.stiffness @ u)))

    size = energy_norm(reference.unknowns)
    rows: dict[str, dict[str, float | str]] = {}
    print(f"{'method':<28}{'status':<12}{'steps':>6}{'eval.':>8}{'seconds':>10}{'residual':>11}{'difference':>12}")
    for name, method in hv.METHODS.items():
        solution = hv.solve(problem, method, controls, workspace=workspace)
        difference = energy_norm(solution.unknowns - reference.unknowns) / size
        seconds = solution.timings["iterate"]
        print(
            f"{name:<28}{solution.status.value:<12}{solution.steps:>6}{solution.evaluations:>8}{seconds:>10.4f}"
            f"{solution.residual.relative:>11.1e}{difference:>12.1e}"
        )
        rows[name] = {
            "status": solution.status.value,
            "energy": solution.energy,
            "residual": solution.residual.relative,
            "difference": difference,
            "seconds": seconds,
        }
    print(f"(condensation, shared: {condensed.seconds:.4f} s)")
    if out is not None:
        lines = [f"{name},{row['status']},{row['seconds']},{row['difference']}" for name, row in rows.items()]
        (out / "all_methods.csv").write_text("\n".join(["method,status,seconds,difference", *lines, ""]))
    return rows


if __name__ == "__main__":
    from _command import run

    run(main)
