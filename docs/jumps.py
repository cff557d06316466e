"""The picture of jumps in evolution.md: ``python docs/jumps.py`` writes images/jumps.png."""

from __future__ import annotations

from pathlib import Path

import numpy as np

import hemivar as hv
from hemivar.report import save
from hemivar.report.picture import new_figure
from hemivar.report.style import BLUE, RED, drawing

#: A block of stiffness 1 on a foundation that rises with slope 2 to 0.1 and falls with slope -2 to nothing at 0.2.
LAW = hv.laws.PiecewiseQuadratic([0.0, 0.1, 0.2], [0.0, 2.0, -2.0, 0.0], np.zeros(3))


def loop(jump: str, step: float) -> hv.evolution.History:
    """The top is pushed down by 0.4 and drawn back."""
    problem = hv.ContactProblem(
        mesh=hv.rectangle((1.0, 1.0), 1),
        material=hv.Material.lame(0.0, 0.5, density=1.0),
        supports={
            "left": hv.Roller(),
            "right": hv.Roller(),
            "top": hv.Fixed(y=lambda x, t: np.full(len(x), -min(t, 0.8 - t))),
        },
        contact={"bottom": hv.Contact(LAW)},
    )
    return hv.march(hv.Evolution(problem), 0.8, step=step, stops=(0.4,), jump=jump)


def main() -> None:
    with drawing():
        figure = new_figure((6.6, 4.9), layout="constrained")
        panels = figure.subplots(2, 2, sharex=True, sharey=True).ravel()
        for panel, jump in zip(panels, ("local", "viscous", "arc-length", "global"), strict=False):
            history = loop(jump, 0.04)
            pushed, force = np.minimum(history.times, 0.8 - history.times), history["normal_force"]
            # All equilibria: kappa (r0 - r) = j'(r).
            panel.plot([0.0, 0.3, 0.2, 0.4], [0.0, 0.2, 0.0, 0.0], color="#d0d0d0", lw=5, label="all equilibria")
            half = int(np.argmax(history.times >= 0.4 - 1e-12)) + 1
            panel.plot(pushed[:half], force[:half], ".-", color=BLUE, label="pushed down")
            panel.plot(pushed[half - 1 :], force[half - 1 :], ".-", color=RED, label="drawn back")
            panel.set_title(f"{jump}, lost in jumps {history.ledger['jumps']:.4f}", fontsize=8.5)
            panel.spines[["top", "right"]].set_visible(False)
        for panel in panels[2:]:
            panel.set_xlabel("push of the top")
        for panel in panels[::2]:
            panel.set_ylabel("force")
        figure.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=3)
    save(figure, Path(__file__).parent / "images" / "jumps.png", dpi=120)


if __name__ == "__main__":
    main()
