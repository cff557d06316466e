"""A first solution: the survey's body on its foundation, with its data (5.1).

The unit square is clamped on its left side, pushed down and to the left by its body force, and rests on a foundation
that is rigid up to a pressure and yields beyond it, with friction.
"""

from __future__ import annotations

from pathlib import Path

import hemivar as hv


def main(out: Path | None = None) -> dict[str, float]:
    """State, discretise, solve, look."""
    problem = hv.ContactProblem(
        mesh=hv.rectangle((1.0, 1.0), 32, pattern="cross"),
        material=hv.Material.lame(4.0, 4.0),
        supports={"left": hv.Clamped()},
        contact={"bottom": hv.Contact(hv.SurveyLaw(q_max=0.3, p_const=2.0), hv.Tresca(0.5))},
        body_force=(-0.8, -0.8),
        title="survey, data (5.1)",
    )
    solution = hv.solve(hv.discretize(problem))
    print(f"{solution.status.value} in {solution.steps} steps, energy {solution.energy:.9f}")
    print(f"largest penetration {solution.penetration.max():.6f}, largest pressure {solution.pressure.max():.6f}")
    print(f"the foundation pushes up with {solution.normal_force:.6f}")

    if out is not None:
        from hemivar.files import write_vtu
        from hemivar.report import plot_solution, save

        save(plot_solution(solution), out / "first_solution.png")
        write_vtu(solution, out / "first_solution.vtu")
    return {
        "energy": solution.energy,
        "penetration": float(solution.penetration.max()),
        "pressure": float(solution.pressure.max()),
        "normal_force": solution.normal_force,
    }


if __name__ == "__main__":
    from _command import run

    run(main)
