"""A block under its own weight between frictionless walls, against the solution by hand.

On (0, a) x (0, b) with ``u_x = 0`` at both sides, the top fixed and the body force (0, -g), everything depends on y
alone. With ``M = lam + 2 mu``, ``kappa = M/b`` and ``r0 = g b^2/(2 M)`` the penetration s of the bottom solves
``P = kappa (r0 - s) in dj(s)``: for the survey's law ``s = max(kappa r0 - q, 0)/(kappa + p)``. A light block hangs from
its fixed top and presses with less than q without sinking in; a heavy one sinks in.

Linear elements give these numbers to rounding on the mesh below, because the pattern "cross" shares the weight of a
cell evenly between its left and right nodes. With the pattern "right" they are off by the discretisation error.
"""

from __future__ import annotations

from pathlib import Path

import hemivar as hv

WIDTH, HEIGHT, LAM, MU, Q_MAX, P_CONST = 1.5, 1.0, 4.0, 4.0, 0.3, 2.0


def main(out: Path | None = None) -> dict[float, tuple[float, float]]:
    """Penetration and pressure for several weights."""
    modulus = LAM + 2.0 * MU
    kappa = modulus / HEIGHT
    found: dict[float, tuple[float, float]] = {}
    print(f"{'weight':>8}{'penetration':>16}{'by hand':>16}{'pressure':>16}{'by hand':>16}")
    for weight in (0.3, 0.6, 1.0, 3.0, 10.0):
        problem = hv.ContactProblem(
            mesh=hv.rectangle((WIDTH, HEIGHT), (12, 8), pattern="cross"),
            material=hv.Material.lame(LAM, MU),
            supports={"left": hv.Roller(), "right": hv.Roller(), "top": hv.Clamped()},
            contact={"bottom": hv.Contact(hv.SurveyLaw(Q_MAX, P_CONST))},
            body_force=(0.0, -weight),
            title=f"block of weight {weight:g}",
        )
        solution = hv.solve(hv.discretize(problem)).raise_for_status()
        free = weight * HEIGHT**2 / (2.0 * modulus)
        sunk = max(kappa * free - Q_MAX, 0.0) / (kappa + P_CONST)
        s, pressure = float(solution.penetration.mean()), float(solution.pressure.mean())
        print(f"{weight:>8g}{s:>16.12f}{sunk:>16.12f}{pressure:>16.12f}{kappa * (free - sunk):>16.12f}")
        found[weight] = (s, pressure)
        if out is not None:
            from hemivar.files import write_json

            write_json(solution, out / f"block_{weight:g}.json")
    return found


if __name__ == "__main__":
    from _command import run

    run(main)
