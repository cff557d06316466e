"""A strip torn off its ground (Makela et al. 1998): equilibrium path, and what the load makes of it.

The glue's tension drops three times as it opens, at 0.5, 1 and 2 mm. Where the tip passes these openings the
equilibrium path has its corners: each point of the glue in turn has three, so that on a mesh the path is a zigzag of
folds. Under a prescribed load the strip jumps over them: a first time when the glue at the tip breaks its first
tooth, and a second time off the ground but for the part next to the clamp. The same is computed in m, kN and in mm,
N.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

import hemivar as hv
from hemivar.branches import Path as EquilibriumPath
from hemivar.branches import follow_path
from hemivar.fem import LoadLine
from hemivar.gallery import delamination

TEETH = (0.5e-3, 1e-3, 2e-3)
FACTORS = np.round(np.arange(0.02, 1.3001, 0.02), 2)


def tip_of(problem: hv.DiscreteProblem) -> int:
    """Contact point at the free end."""
    assert problem.contact.points is not None
    return int(np.argmax(problem.contact.points[:, 0]))


def under_load(problem: hv.DiscreteProblem) -> np.ndarray:
    """Tip opening at each of the load factors, each computed from the last one."""
    line, workspace, tip = LoadLine(problem), hv.Workspace(), tip_of(problem)
    guess, opening = None, []
    for factor in FACTORS:
        partial = line.at(float(factor))
        solution = hv.solve(partial, initial=guess, workspace=workspace).raise_for_status()
        guess = solution.unknowns
        opening.append(-solution.penetration[tip])
    return np.array(opening)


def corners(path: EquilibriumPath, tip: int) -> list[float]:
    """Load factors at which the tip opening first passes each tooth along the path."""
    opening = -path.local[:, tip, 0]
    found = []
    for tooth in TEETH:
        i = int(np.argmax(opening >= tooth * (1.0 - 1e-9)))
        part = (tooth - opening[i - 1]) / (opening[i] - opening[i - 1])
        found.append(float(path.load_factor[i - 1] + part * (path.load_factor[i] - path.load_factor[i - 1])))
    return found


def main(out: Path | None = None) -> dict[str, float]:
    """Path and loading curve in two systems of units."""
    n = 2
    si = hv.discretize(delamination(n))
    mm = hv.discretize(delamination(n, length=1e3, stress=1e-3))
    tip = tip_of(si)
    opening, again = under_load(si), under_load(mm) / 1e3
    units = float(np.abs(again / opening - 1.0).max())
    growth = (opening[1:] / opening[:-1]) / (FACTORS[1:] / FACTORS[:-1])
    jumps = np.flatnonzero(growth > 1.3) + 1
    print(f"m, kN against mm, N: relative difference of the tip opening {units:.1e}")
    for i in jumps:
        print(
            f"between {FACTORS[i - 1]:g} and {FACTORS[i]:g} of the load the tip jumps from "
            f"{opening[i - 1] * 1e3:.3f} to {opening[i] * 1e3:.3f} mm"
        )
    path = follow_path(si, (0.0, 1.5))
    teeth = corners(path, tip)
    for tooth, factor in zip(TEETH, teeth, strict=True):
        print(f"equilibrium path: the tip opens {tooth * 1e3:g} mm at {factor:.4f} of the load")
    print(f"{len(path)} corners, {len(path.folds)} folds; {path.ended}")
    if out is not None:
        draw(path, tip, opening, teeth, out / "delamination.png")
    return {
        "units": units,
        "jumps": float(jumps.size),
        "first_jump": float(FACTORS[jumps[0]]),
        "last_jump": float(FACTORS[jumps[-1]]),
        "folds": float(len(path.folds)),
        **{f"tooth_{k}": factor for k, factor in enumerate(teeth)},
    }


def draw(path: EquilibriumPath, tip: int, opening: np.ndarray, teeth: list[float], file: Path) -> None:
    """Load against tip opening."""
    import matplotlib.pyplot as plt

    fig, panels = plt.subplots(1, 2, figsize=(9.0, 3.6), sharey=True, layout="constrained")
    x = -path.local[:, tip, 0] * 1e3
    for ax, right in zip(panels, (2.5, 14.0), strict=True):
        ax.plot(x, path.load_factor, color="0.6", linewidth=1.0, label="equilibrium path")
        ax.plot(opening * 1e3, FACTORS, ".", color="tab:blue", markersize=5, label="load prescribed")
        ax.plot([t * 1e3 for t in TEETH], teeth, "o", color="tab:red", markersize=5, label="tooth of the tip breaks")
        ax.set(xlim=(0.0, right), ylim=(0.0, 1.35), xlabel="opening of the tip (mm)")
        ax.spines[["top", "right"]].set_visible(False)
    panels[0].set(ylabel="load factor", title="the three teeth")
    panels[1].set_title("the whole path")
    panels[1].legend(loc="lower right", frameon=False)
    fig.savefig(file, dpi=160)
    plt.close(fig)


if __name__ == "__main__":
    from _command import run

    run(main)
