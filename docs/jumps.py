"""The picture of jumps in evolution.md: ``python docs/jumps.py`` writes images/jumps.png."""

from __future__ import annotations

from pathlib import Path

import matplotlib
import numpy as np

import hemivar as hv

matplotlib.use("Agg")
import matplotlib.pyplot as plt

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
    figure, frames = plt.subplots(1, 5, figsize=(13, 3), sharey=True, layout="constrained")
    for frame, jump in zip(frames, ("local", "viscous", "arc-length", "dynamic", "global"), strict=True):
        history = loop(jump, 0.04)
        pushed, force = np.minimum(history.times, 0.8 - history.times), history["normal_force"]
        # All equilibria: kappa (r0 - r) = j'(r).
        frame.plot([0.0, 0.3, 0.2, 0.4], [0.0, 0.2, 0.0, 0.0], color="0.75", lw=4, label="equilibria")
        half = int(np.argmax(history.times >= 0.4 - 1e-12)) + 1
        frame.plot(pushed[:half], force[:half], ".-", label="in")
        frame.plot(pushed[half - 1 :], force[half - 1 :], ".-", label="out")
        frame.set(title=f"{jump}\nlost in jumps {history.ledger['jumps']:.4f}", xlabel="push r0")
    frames[0].set_ylabel("force")
    frames[0].legend()
    figure.savefig(Path(__file__).parent / "images" / "jumps.png", dpi=80)


if __name__ == "__main__":
    main()
