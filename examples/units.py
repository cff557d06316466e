"""Any consistent units: the same bracket in metres and pascals, and in millimetres and megapascals.

hemivar has no units of its own. Lengths, forces per area and what is made of them (force per volume, stiffness of a
foundation in force per area and length) have to fit together, and results come in the same units. Inside, methods work
on scaled unknowns, and tolerances are relative to the load, so that they take the same steps in both systems.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

import hemivar as hv


def bracket(length: float, pressure: float) -> hv.DiscreteProblem:
    """A rubber bracket 0.2 m x 0.1 m on a bed; ``length`` is a metre and ``pressure`` a pascal in the units used."""
    return hv.discretize(
        hv.ContactProblem(
            mesh=hv.rectangle((0.2 * length, 0.1 * length), (40, 20), pattern="cross"),
            material=hv.Material.young(5e6 * pressure, 0.4, plane="stress"),
            supports={"left": hv.Clamped()},
            contact={
                "bottom": hv.Contact(
                    hv.SurveyLaw(q_max=1e4 * pressure, p_const=2e7 * pressure / length),
                    hv.Tresca(6e3 * pressure),
                    gap=0.5e-3 * length,
                )
            },
            body_force=(0.0, -1.2e4 * pressure / length),
            tractions={"top": hv.Pressure(2.0e4 * pressure), "right": (1.5e4 * pressure, 0.0)},
            title="bracket",
        )
    )


def main(out: Path | None = None) -> dict[str, float]:
    """Solve in both systems and compare."""
    si = hv.solve(bracket(length=1.0, pressure=1.0)).raise_for_status()
    mm = hv.solve(bracket(length=1e3, pressure=1e-6)).raise_for_status()
    displacement = np.abs(mm.displacement / 1e3 - si.displacement).max() / np.abs(si.displacement).max()
    pressure = np.abs(mm.multiplier / 1e-6 - si.multiplier).max() / np.abs(si.multiplier).max()
    energy = abs(mm.energy / (1e-6 * 1e6) / si.energy - 1.0)  # force x length per thickness: Pa m^2, MPa mm^2
    for name, found in (("m, Pa", si), ("mm, MPa", mm)):
        largest = float(np.abs(found.displacement).max())
        print(f"{name}: displacement {largest:.6e}, pressure {found.pressure.max():.6e}, {found.steps} steps")
    print(f"relative differences: displacement {displacement:.1e}, multiplier {pressure:.1e}, energy {energy:.1e}")
    touching = np.count_nonzero(si.state != hv.ContactState.OPEN)
    print(f"{touching} of {si.state.size} nodes touch, {np.count_nonzero(si.state == hv.ContactState.SLIP)} slip")
    if out is not None:
        from hemivar.files import write_json

        write_json(si, out / "bracket_m_Pa.json")
        write_json(mm, out / "bracket_mm_MPa.json")
    return {
        "displacement": float(displacement),
        "pressure": float(pressure),
        "energy": float(energy),
        "steps": float(si.steps),
        "steps_mm": float(mm.steps),
        "touching": float(touching),
    }


if __name__ == "__main__":
    from _command import run

    run(main)
