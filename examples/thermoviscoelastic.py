"""A warm body that nothing clamps (Bartman, Bartosz, Jureczka, Szafraniec, arXiv:1901.07845).

Pushed harder from the left than from the right it slides on a foundation whose friction weakens with the slip rate, and
warms where it is squeezed and where it rubs: deformation and friction make heat, the foundation takes and gives it.
Two balances are checked that the steps do not ask for: that of momentum along the foundation, and that of heat.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

import hemivar as hv
from hemivar.evolution import History
from hemivar.gallery import thermoviscoelastic

TIMES = (0.0625, 0.25, 1.0)


def balances(history: History) -> dict[str, float]:
    """Momentum from the tractions and the friction of the table against that of the frames; heat likewise."""
    step, friction = history["step"], history["friction_force"]
    frame, discrete = history.frames[-1], history.discrete
    assert discrete.mass is not None
    speed = discrete.restrict(frame.velocity, np.zeros(0))
    rigid = discrete.restrict(np.tile([1.0, 0.0], (len(frame.velocity), 1)), np.zeros(0))
    momentum = float(rigid @ discrete.mass.times(speed))
    pushed = float(np.sum(step * (48.0 / 6.0 - 44.0 / 6.0))) - abs(float(np.sum(step * friction)))
    assert history.moment.heat is not None
    book = history.moment.heat.book
    return {"momentum": momentum, "pushed": pushed, "heat": book.content, "heat_gap": book.gap}


def main(out: Path | None = None) -> dict[str, float]:
    """The motion until t = 1."""
    body = thermoviscoelastic(16)
    evolution = hv.Evolution(body.problem, inertia=True, heat=body.heat)
    history = hv.march(evolution, body.until, step=1.0 / 32.0, save=hv.Save(every=1.0 / 32.0))
    found = balances(history)
    warm = history.frames[-1].temperature
    assert warm is not None
    found |= {"least": float(warm.min()), "greatest": float(warm.max()), "rounds": float(history["rounds"].max())}
    found |= {"margin": history.margin, "slid": float(history.frames[-1].local[:, 1].mean())}
    print(f"momentum {found['momentum']:.6f}, pushed {found['pushed']:.6f}")
    print(f"temperature {found['least']:.4f} to {found['greatest']:.4f}, heat {found['heat']:.6f}")
    print(f"at most {found['rounds']:.0f} rounds of motion and heat in a step; least margin {found['margin']:.3f}")
    if out is not None:
        draw(history, out / "thermoviscoelastic.png")
    return found


def draw(history: History, file: Path) -> None:
    """Temperatures on the deformed body at three times."""
    import matplotlib.pyplot as plt
    from matplotlib.tri import Triangulation

    mesh = history.discrete.field.mesh
    frames = [history.at(time) for time in TIMES]
    temperatures = [frame.temperature for frame in frames]
    low = min(float(np.min(t)) for t in temperatures if t is not None)
    high = max(float(np.max(t)) for t in temperatures if t is not None)
    fig, panels = plt.subplots(1, 3, figsize=(10.5, 3.0), sharey=True, layout="constrained")
    for ax, frame, warm in zip(panels, frames, temperatures, strict=True):
        moved = mesh.points + frame.displacement
        drawn = ax.tripcolor(
            Triangulation(*moved.T, mesh.cells), warm, shading="gouraud", cmap="inferno", vmin=low, vmax=high
        )
        ax.triplot(Triangulation(*moved.T, mesh.cells), color="white", linewidth=0.15, alpha=0.5)
        ax.axhline(0.0, color="0.4", linewidth=1.0)
        ax.set(aspect="equal", title=f"t = {frame.time:g}", xlabel="x", xlim=(-0.1, 1.75), ylim=(-0.05, 1.2))
        ax.spines[["top", "right"]].set_visible(False)
    panels[0].set_ylabel("y")
    fig.colorbar(drawn, ax=panels, label="temperature", shrink=0.9)
    fig.savefig(file, dpi=160, bbox_inches="tight")
    plt.close(fig)


if __name__ == "__main__":
    from _command import run

    run(main)
