"""The single lap joint as two beam-columns joined by springs, and in the plane: the moment beside the overlap.

A script of its own: beams of Euler and Bernoulli with the axial force that the last step found, and springs between
their near faces. It prints the factor ``k = 2 M / (F t)`` of Goland and Reissner beside that of plane elements.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spla

import hemivar as hv
from hemivar.basics.types import Array
from hemivar.fem.elements import barycentric_gradients, shape_derivatives
from hemivar.fem.quadrature import quadrature_rule


@dataclass(frozen=True)
class LapJoint:
    """Two plates of one thickness, the upper one clamped at its left end, the lower one pulled at its right end."""

    length: float = 100.0
    thickness: float = 1.6
    overlap: float = 12.5
    young: float = 70e3
    poisson: float = 0.33
    peel: float = 21008.4
    shear: float = 4595.6

    def statement(self, force: float, cells: tuple[int, int], stiffening: bool) -> hv.ContactProblem:
        """The joint in plane strain, its glue elastic; nodes stand at the ends of the overlap."""
        L, t, c = self.length, self.thickness, self.overlap
        springs = hv.laws.BilinearCohesion(stiffness=self.peel, strength=1e4, energy=1e4)
        glue = hv.laws.MixedMode(springs, float(np.sqrt(self.shear / self.peel)), hv.Compliance(self.peel))
        upper = hv.rectangle((L, t), cells).marked({"overlap": f"y < 1e-6 and x > {L - c - 1e-6}"})
        lower = hv.rectangle((L, t), cells, origin=(L - c, -t)).marked({"overlap": f"y > -1e-6 and x < {L + 1e-6}"})
        return hv.ContactProblem(
            hv.Mesh.assembled({"upper": upper, "lower": lower}),
            hv.Material.young(self.young, self.poisson),
            {"upper:overlap": hv.Contact(glue, against="lower:overlap")},
            {"upper:left": hv.Clamped(), "lower:right": hv.Fixed(y=0.0)},
            tractions={"lower:right": (force / t, 0.0)}, order=2, stiffening=stiffening,
        )  # fmt: skip

    def by_elements(self, force: float, cells: tuple[int, int], stiffening: bool = True) -> float:
        """k by plane elements: the moment of the stress in the cells just beside the overlap."""
        solution = hv.solve(self.statement(force, cells, stiffening)).raise_for_status()
        edge = self.length - self.overlap
        return 2.0 * moment(solution, (edge - self.length / cells[0], edge), self.thickness) / (force * self.thickness)

    def by_beams(self, force: float, width: float, stiffening: bool = True, size: float = 0.05) -> float:
        """k by beam-columns: the mean over the same width beside the overlap."""
        L, c, t = self.length, self.overlap, self.thickness
        edge, free = round((L - c) / size), round(c / size)
        count = edge + free + edge + 1  # nodes of the line of both; a beam has its own part of it
        spans = (0, edge + free), (edge, count - 1)
        moduli = self.young / (1.0 - self.poisson**2) * np.array([t, t**3 / 12.0])
        axial = [np.zeros(last - first) for first, last in spans]
        load = np.zeros(6 * count)
        load[3 * (2 * count - 1)] = force
        held = [0, 1, 2, 3 * (2 * count - 1) + 1]
        x = np.zeros(load.size)
        for _ in range(40):
            matrix = sum(
                _beam(3 * (count * b + spans[b][0]), axial[b], moduli, size, load.size) for b in (0, 1)
            ) + self._springs(count, edge, free, size)
            there = np.setdiff1d(np.flatnonzero(matrix.diagonal()), held)
            new = np.zeros(load.size)
            new[there] = spla.spsolve(sp.csc_array(matrix[there][:, there]), load[there])
            change, x = np.abs(new - x).max(), new
            for b, (first, last) in enumerate(spans if stiffening else ()):
                u = x.reshape(2, count, 3)[b, first : last + 1, 0]
                axial[b] = moduli[0] * np.diff(u) / size
            if change <= 1e-10 * np.abs(x).max():
                break
        turned = x.reshape(2, count, 3)[0, :, 2]
        first = edge - round(width / size)
        return abs(float(2.0 * moduli[1] * (turned[edge] - turned[first]) / (size * (edge - first)) / (force * t)))

    def _springs(self, count: int, edge: int, free: int, size: float) -> sp.csr_array:
        """The glue between the faces of both beams, by nodes."""
        nodes, t = np.arange(edge, edge + free + 1), self.thickness
        weight = size * np.where((nodes == edge) | (nodes == edge + free), 0.5, 1.0)
        number, upper, lower = np.arange(nodes.size), 3 * nodes, 3 * (count + nodes)
        ones, shape = np.ones(nodes.size), (nodes.size, 6 * count)

        def rows(*parts: tuple[float, Array]) -> sp.csr_array:
            entries = np.concatenate([factor * ones for factor, _ in parts])
            place = np.tile(number, len(parts)), np.concatenate([at for _, at in parts])
            return sp.csr_array((entries, place), shape=shape)

        opening = rows((1.0, upper + 1), (-1.0, lower + 1))
        slip = rows((1.0, upper), (0.5 * t, upper + 2), (-1.0, lower), (0.5 * t, lower + 2))
        glue = ((self.peel, opening), (self.shear, slip))
        return sp.csr_array(sum(one.T @ sp.diags_array(stiff * weight) @ one for stiff, one in glue))

    def goland_reissner(self, force: float) -> float:
        """k of Goland and Reissner (1944), who take the overlap for one beam of twice the thickness, plates long."""
        stiff = self.young * self.thickness**3 / 12.0 / (1.0 - self.poisson**2)
        along = np.sqrt(force / stiff)
        one = np.cosh(0.5 * self.overlap * along / np.sqrt(8.0))
        return float(one / (one + np.sqrt(8.0) * np.sinh(0.5 * self.overlap * along / np.sqrt(8.0))))


def _beam(start: int, axial: Array, moduli: Array, size: float, unknowns: int) -> sp.csr_array:
    """Stiffness of a beam with axial forces (elements,): unknowns u, w, w' of its nodes from ``start`` on."""
    h, h2 = size, size**2
    bends = np.array([[12, 6 * h, -12, 6 * h], [6 * h, 4 * h2, -6 * h, 2 * h2]])
    pulls = np.array([[36, 3 * h, -36, 3 * h], [3 * h, 4 * h2, -3 * h, -h2]])
    bend = np.vstack([bends, [-12, -6 * h, 12, -6 * h], [6 * h, 2 * h2, -6 * h, 4 * h2]]) * moduli[1] / h**3
    pull = np.vstack([pulls, [-36, -3 * h, 36, -3 * h], [3 * h, -h2, -3 * h, 4 * h2]]) / (30.0 * h)
    local = np.zeros((axial.size, 6, 6))
    local[np.ix_(range(axial.size), (0, 3), (0, 3))] = moduli[0] / h * np.array([[1, -1], [-1, 1]])
    local[np.ix_(range(axial.size), (1, 2, 4, 5), (1, 2, 4, 5))] = bend + axial[:, None, None] * pull
    place = start + 3 * np.arange(axial.size)[:, None] + np.arange(6)
    rows, columns = (np.broadcast_to(one, local.shape).ravel() for one in (place[:, :, None], place[:, None, :]))
    return sp.csr_array((local.ravel(), (rows, columns)), shape=(unknowns, unknowns))


def moment(solution: hv.Solution, between: tuple[float, float], thickness: float) -> float:
    """The moment of the stress along x of a plate about its middle, its mean between two places of the upper plate."""
    stated, u = solution.problem.origin, solution.displacement
    assert stated is not None
    mesh = stated.mesh
    middle = mesh.points[mesh.cells].mean(axis=1)
    cells = np.flatnonzero((middle[:, 0] > between[0]) & (middle[:, 0] < between[1]) & (middle[:, 1] > 0.0))
    nodes, slopes, total = mesh.cell_nodes(2)[cells], barycentric_gradients(mesh, cells), 0.0
    for place, weight in zip(*quadrature_rule(2, 4), strict=True):
        shapes = np.einsum("la,kad->kld", shape_derivatives(2, place), slopes)
        gradient = np.einsum("kld,klc->kcd", shapes, u[nodes])
        strain = np.column_stack([gradient[:, 0, 0], gradient[:, 1, 1], gradient[:, 0, 1] + gradient[:, 1, 0]])
        points = np.einsum("c,kcd->kd", place, mesh.points[mesh.cells[cells]])
        along = stated.material.stress(points, strain)[:, 0] * (points[:, 1] - 0.5 * thickness)
        total += float(weight * mesh.volumes[cells] @ along)
    return abs(total) / (between[1] - between[0])


if __name__ == "__main__":
    joint = LapJoint()
    for pull in (-5.0, 15.0, 60.0, 120.0, 200.0):
        for held in (False, True):
            meshes = [joint.by_elements(pull, cells, held) for cells in ((80, 2), (160, 3), (320, 4))]
            beams = joint.by_beams(pull, 1.25, held), joint.by_beams(pull, 0.05, held)
            print(pull, held, *(f"{k:.4f}" for k in (*meshes, *beams)), f"{joint.goland_reissner(abs(pull)):.4f}")
