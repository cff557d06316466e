"""A curved contact boundary on a Gmsh mesh: a half disc pressed onto a rigid plane, against Hertz.

The flat top of the half disc (radius R, plane strain) is moved down by D; its round side may touch the plane y = 0.
The foundation is met along the outward normal of the body, so the gap at a node of height y is ``y/cos(angle)``.
Hertz's formulas for line contact take the resulting force P per length: ``a = sqrt(4 P R/(pi E*))``,
``p0 = 2 P/(pi a)``, ``p(x)^2 = p0^2 (1 - x^2/a^2)``. They are for a half space and neglect tangential displacements, a
term of order ``(1 - 2 nu) a/R``: agreement in per cent is what can be expected.

The mesh is made by ``examples/meshes/make_meshes.py``.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

import hemivar as hv

MESH = Path(__file__).parent / "meshes" / "half_disc.msh"
RADIUS, YOUNG, POISSON, DOWN = 1.0, 1.0, 0.3, 0.002


def gap(x: np.ndarray) -> np.ndarray:
    """Distance to the plane y = 0 along the normal of the disc, at points of shape (k, 2)."""
    return x[:, 1] / (1.0 - x[:, 1] / RADIUS)


def main(out: Path | None = None) -> dict[str, float]:
    """Largest pressure and half width of the contact, against Hertz's."""
    problem = hv.ContactProblem(
        mesh=hv.read_mesh(MESH),
        material=hv.Material.young(YOUNG, POISSON, plane="strain"),
        supports={"top": hv.Prescribed((0.0, -DOWN))},
        contact={"contact": hv.Contact(hv.Signorini(), gap=gap)},
        title="half disc on a rigid plane",
    )
    discrete = hv.discretize(problem)
    solution = hv.solve(discrete).raise_for_status()

    x, pressure = discrete.contact.points[:, 0], solution.pressure
    load = -float(
        (discrete.contact.weights * pressure) @ discrete.contact.frames[:, 0, 1]
    )  # vertical part of the nodal forces
    stiffness = YOUNG / (1.0 - POISSON**2)
    half_width = np.sqrt(4.0 * load * RADIUS / (np.pi * stiffness))
    peak = 2.0 * load / (np.pi * half_width)
    # In Hertz's law p^2 is linear in x^2: a straight line through the computed values gives p0 and a.
    touching = pressure > 0.3 * pressure.max()
    slope, at_zero = np.polyfit(x[touching] ** 2, pressure[touching] ** 2, 1)
    found_peak, found_width = float(np.sqrt(at_zero)), float(np.sqrt(-at_zero / slope))
    print(f"{solution.status.value} in {solution.steps} steps; {discrete.unknowns} unknowns, load P = {load:.6e}")
    print(f"p0: computed {found_peak:.6e}, Hertz {peak:.6e}, relative error {found_peak / peak - 1:+.2%}")
    print(f"a:  computed {found_width:.6e}, Hertz {half_width:.6e}, relative error {found_width / half_width - 1:+.2%}")
    print(f"a/R = {half_width / RADIUS:.3f}, nodes in contact: {np.count_nonzero(pressure > 0)}")
    if out is not None:
        from hemivar.files import write_vtu
        from hemivar.report import plot_contact, save

        save(plot_contact(solution), out / "curved_contact.png")
        write_vtu(solution, out / "curved_contact.vtu")
    return {
        "load": load,
        "peak": found_peak,
        "hertz_peak": peak,
        "half_width": found_width,
        "hertz_half_width": float(half_width),
        "penetration": float(solution.penetration.max()),
    }


if __name__ == "__main__":
    from _command import run

    run(main)
