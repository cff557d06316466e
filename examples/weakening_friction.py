"""Friction that weakens with the slip: one answer inside the margin, several beyond it.

First the survey's square with friction h ln(1 + |u_tau|) instead of Tresca's: its constant is alpha_tau = h, and while
the margin is positive there is one solution. Then a block sheared along its base (survey's j(r) = 0.7 r - 0.3 exp(-r),
and a steeper one): slips in closed form by Lambert's W function, sticking and slipping at the same load. Last a block
pushed onto springs that soften.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

import hemivar as hv
from hemivar.branches import find_solutions
from hemivar.certify import certify
from hemivar.gallery import shear_block_slips, shear_column, softening_block, survey_logarithmic

BOUNDS = (0.1, 0.25, 0.5, 1.0, 2.0, 4.0)


def square(n: int = 16) -> dict[float, dict[str, float]]:
    """Margin and slip for several friction bounds."""
    print("survey's square, friction h ln(1 + |u_tau|)")
    print(f"{'h':>6}{'margin':>10}{'slipping':>10}{'largest slip':>14}  kind of point")
    found = {}
    for bound in BOUNDS:
        solution = hv.solve(hv.discretize(survey_logarithmic(bound, n))).raise_for_status()
        what = certify(solution.problem, solution.unknowns, solution.multiplier)
        slip = np.abs(solution.slip[:, 0])
        moving = int(np.count_nonzero(slip > 1e-12))
        print(f"{bound:>6g}{what.margin:>10.4f}{moving:>10}{slip.max():>14.6f}  {what.kind.value}")
        found[bound] = {"margin": what.margin, "slipping": float(moving), "slip": float(slip.max())}
    return found


def column() -> float:
    """The sheared block, inside the margin and beyond; the largest error of any solution found."""
    worst = 0.0
    print("sheared block, slips found and by Lambert's W")
    for bound, rate, free in ((0.5, 1.0, 0.3), (1.0, 20.0, 0.248)):
        exact = shear_block_slips(4.0, free, bound, rate=rate)
        found = find_solutions(shear_column(bound, load=8.0 * free, rate=rate))
        by_slip = sorted(found, key=lambda solution: float(solution.slip[0, 0]))
        for solution, slip in zip(by_slip, exact, strict=True):
            print(f"  rate {rate:g}: {solution.slip[0, 0]:.12f} {slip:.12f}  {solution.kind}, E {solution.energy:.8f}")
            worst = max(worst, abs(float(solution.slip[0, 0]) - slip))
    return worst


def springs() -> list[float]:
    """Uniform penetrations of the block on softening springs, found from starts at the exact ones."""
    found = []
    print("block on softening springs, kappa = 12")
    for softening, top in ((6.0, 0.12), (6.0, 0.2), (6.0, 0.4), (20.0, 0.14)):
        for known in softening_block(softening=softening, top_displacement=top, n=4):
            problem = hv.discretize(known.problem)
            assert problem.field is not None
            exact = known.displacement(problem.field.nodes)
            what = certify(problem, problem.field.restrict(exact))
            s = -float(exact[:, 1][np.argmin(problem.field.nodes[:, 1])])
            print(f"  alpha {softening:g}, top {top:g}: s = {s:.6f}, {what.kind.value}, margin {what.margin:.3f}")
            found.append(s)
    return found


def main(out: Path | None = None) -> dict[str, float]:
    """All three."""
    margins = square()
    worst = column()
    roots = springs()
    if out is not None:
        from hemivar.report import plot_contact, save

        for bound in (0.1, 0.5):
            solution = hv.solve(hv.discretize(survey_logarithmic(bound, 32))).raise_for_status()
            save(plot_contact(solution, title=f"h = {bound:g}"), out / f"survey_logarithmic_{bound:g}.png")
    return {
        "lambert": worst,
        "roots": float(len(roots)),
        **{f"margin_{bound:g}": values["margin"] for bound, values in margins.items()},
        **{f"slip_{bound:g}": values["slip"] for bound, values in margins.items()},
    }


if __name__ == "__main__":
    from _command import run

    run(main)
