"""A matrix from another finite element code: plain scikit-fem here, FEniCS or NGSolve work alike.

What hemivar needs of such a code: the stiffness matrix and the load on the free unknowns, and where in the vector of
unknowns the normal and tangential displacement of each contact node stand. The block is pressed onto the foundation
by moving its top down by D; the solution by hand is linear: ``s = (kappa D - q)/(kappa + p)``, ``kappa = lam + 2 mu``.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import scipy.sparse as sp
import skfem
from skfem.models.elasticity import linear_elasticity

import hemivar as hv

LAM, MU, DOWN, Q_MAX, P_CONST = 4.0, 4.0, 0.1, 0.3, 2.0


def main(out: Path | None = None) -> dict[str, float]:
    """Assemble elsewhere, wrap, solve."""
    # --- the other code: quadrilaterals, which hemivar itself does not have
    mesh = skfem.MeshQuad.init_tensor(np.linspace(0, 1, 9), np.linspace(0, 1, 7)).with_defaults()
    basis = skfem.Basis(mesh, skfem.ElementVector(skfem.ElementQuad1()))
    full = sp.csr_array(linear_elasticity(LAM, MU).assemble(basis))
    value = np.zeros(full.shape[0])  # prescribed displacement, zero elsewhere
    top = basis.get_dofs("top").all("u^2")
    value[top] = -DOWN
    held = np.union1d(basis.get_dofs({"left", "right"}).all("u^1"), top)
    free = np.setdiff1d(np.arange(full.shape[0]), held)

    # --- the contact nodes: penetration is displacement along the outward normal (0, -1), slip along (1, 0), which is
    #     the normal turned by +90 degrees
    nodes = mesh.facets[:, mesh.boundaries["bottom"]]
    nodes = np.unique(nodes)[np.argsort(mesh.p[0, np.unique(nodes)])]
    m = nodes.size
    spacing = np.diff(mesh.p[0, nodes])
    weights = 0.5 * (np.append(spacing, 0.0) + np.insert(spacing, 0, 0.0))  # half of the adjacent facets
    rows, columns = np.arange(2 * m), basis.nodal_dofs[::-1, nodes].T.ravel()  # u_y, u_x of node 1, u_y, u_x of ...
    signs = np.tile([-1.0, 1.0], m)
    trace = sp.csr_array((signs, (rows, columns)), shape=(2 * m, full.shape[0]))

    problem = hv.DiscreteProblem.of_arrays(
        stiffness=full[free][:, free],
        load=-(full @ value)[free],
        trace=trace[:, free],  # rows of u_x at the two corners are zero: the walls hold them
        weights=weights,
        gap=np.zeros(m),
        law=hv.ContactLaw(hv.SurveyLaw(Q_MAX, P_CONST), hv.Tresca(0.1)).at(mesh.p[:, nodes].T),
        constant=0.5 * float(value @ (full @ value)),  # so that E is the whole elastic energy
    )
    solution = hv.solve(problem).raise_for_status()
    displacement = value.copy()
    displacement[free] = solution.unknowns

    kappa = LAM + 2.0 * MU
    sunk = (kappa * DOWN - Q_MAX) / (kappa + P_CONST)
    s, spread = float(solution.penetration.mean()), float(np.ptp(solution.penetration))
    print(f"penetration {s:.15f} (by hand {sunk:.15f}), its spread over the nodes {spread:.1e}")
    print(f"energy {solution.energy:.12f}, normal force {solution.normal_force:.12f}")
    if out is not None:
        np.savetxt(out / "own_matrix.csv", np.c_[mesh.p.T, displacement[basis.nodal_dofs].T], delimiter=",")
    return {"penetration": s, "spread": spread, "energy": solution.energy, "normal_force": solution.normal_force}


if __name__ == "__main__":
    from _command import run

    run(main)
