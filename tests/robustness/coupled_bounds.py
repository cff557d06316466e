"""Random bounds of bodies on laws that couple opening and slip, against finer solutions that are checked here.

Plane bodies, and some in space, sheared and shaken, in units of metres or millimetres, on mixed-mode glue, on glue by a
formula, on orthotropic friction, with a foundation of another law beside. The finer solution lives on a nested mesh. It
is the solver's, and judged by arrays of :mod:`tests.robustness.elasticity` and by tractions that are written out here:
what it lacks for equilibrium, or off the law, is next to nothing. Its distance to the exact solution is left out: it
makes errors look a little smaller.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

import hemivar as hv
from hemivar.fem.assembly import stiffness_matrix
from hemivar.fem.transfer import interpolate
from hemivar.laws import BilinearCohesion, CoupledFormulaLaw, MixedMode, OrthotropicFriction, VectorLaw
from tests.robustness.elasticity import Body, isotropic, stiffness

__all__ = ["KINDS", "CoupledCase", "Judged", "judge_coupled", "make"]

#: The tractions of a law: penetrations (m,), slips (m, t) and computed forces (m, 1 + t) to how far these are off.
Misfit = Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]

KINDS = ("glue", "rigid glue", "formula", "orthotropic", "beside", "quadratic")
#: How often the mesh is cut in halves for the finer solution.
_FINER = {2: 3, 3: 2}


@dataclass
class CoupledCase:
    """A statement, with the laws of its contact boundaries as they are written here."""

    kind: str
    problem: hv.ContactProblem
    lam: float
    mu: float
    laws: dict[str, Misfit]


@dataclass
class Judged:
    """What became of it; ``off`` is what the finer solution lacks, over the largest force or traction."""

    certified: str
    bound: float
    error: float
    constant: float
    off: float
    reasons: tuple[str, ...]

    @property
    def index(self) -> float:
        """Bound over error."""
        return self.bound / self.error


def _glue(stiff: float, first: float, last: float, ratio: float, push: float) -> Misfit:
    def off(r: np.ndarray, s: np.ndarray, force: np.ndarray) -> np.ndarray:
        opening = np.maximum(-r, 0.0)
        rho = np.maximum(np.hypot(opening, ratio * np.linalg.norm(s, axis=1)), 1e-300)
        falls = stiff * first * np.clip((last - rho) / (last - first), 0.0, None) / rho
        secant = np.where(rho < first, stiff, falls)
        return _off(r, s, -secant * opening, secant[:, None] * ratio**2 * s, push, force)

    return off


def _formula(energy: float, width: float, ratio: float, push: float) -> Misfit:
    def off(r: np.ndarray, s: np.ndarray, force: np.ndarray) -> np.ndarray:
        opening = np.minimum(r, 0.0)
        bell = np.exp(-(opening**2 + ratio**2 * (s**2).sum(axis=1)) / width**2)
        secant = 2.0 * energy / width**2 * bell
        return _off(r, s, secant * opening, secant[:, None] * ratio**2 * s, push, force)

    return off


def _plain(bound: np.ndarray, push: float) -> Misfit:
    """Friction in an ellipse with half axes along x and y; a disc in the plane."""

    def off(r: np.ndarray, s: np.ndarray, force: np.ndarray) -> np.ndarray:
        size = np.linalg.norm(bound * s, axis=1)
        moves = size > _rest(r, s) * bound.max()
        along = bound**2 * s / np.where(size > 0.0, size, 1.0)[:, None]
        # at rest: how far outside of the ellipse
        outside = np.linalg.norm(force[:, 1:] / bound, axis=1)
        rest = force[:, 1:] / np.maximum(outside, 1.0)[:, None]
        return _off(r, s, np.zeros(len(r)), np.where(moves[:, None], along, rest), push, force)

    return off


def _rest(r: np.ndarray, s: np.ndarray) -> float:
    """A displacement that is none."""
    return 1e-9 * max(float(np.abs(r).max(initial=0.0)), float(np.abs(s).max(initial=0.0)))


def _off(
    r: np.ndarray, s: np.ndarray, pull: np.ndarray, along: np.ndarray, push: float, force: np.ndarray
) -> np.ndarray:
    """How far forces are off a traction in opening and slip, and a spring (or a rigid foundation) in penetration."""
    normal = pull + (0.0 if push == math.inf else push * np.maximum(r, 0.0))
    if push == math.inf:
        touches = np.abs(r) <= _rest(r, s)
        normal = np.where(touches, np.maximum(force[:, 0], 0.0), pull)
    return np.hypot(force[:, 0] - normal, np.linalg.norm(force[:, 1:] - along, axis=1))


def _mesh(rng: np.random.Generator, dim: int, length: float) -> hv.Mesh:
    sides = rng.uniform(0.7, 1.6, dim) * length
    counts = rng.integers(2, 5, dim) if dim == 2 else rng.integers(1, 3, dim)
    mesh = (hv.rectangle if dim == 2 else hv.box)(tuple(sides), tuple(int(n) for n in counts))
    points = np.array(mesh.points)
    inner = ((points > 1e-9 * length) & (points < sides - 1e-9 * length)).all(axis=1)
    points[inner] += 0.2 * (sides / counts) * rng.uniform(-1.0, 1.0, points[inner].shape)
    points[:, 0] += rng.uniform(-0.4, 0.4) * points[:, -1]  # sheared: bottom and top stay level
    return dataclasses.replace(mesh, points=points, parent=None)


def make(number: int) -> CoupledCase:
    """The case of a number; always the same one."""
    rng = np.random.default_rng([number, 2711])
    kind = KINDS[number % len(KINDS)]
    dim = 3 if kind == "orthotropic" else 2
    length, mu = ((1.0, 1.0), (50.0, 8e4))[number // len(KINDS) % 2]
    lam = mu * float(rng.uniform(0.3, 2.0))
    strain = float(10.0 ** rng.uniform(-3.0, -1.5))
    held = "top" if dim == 3 else ("left", "right", "top")[int(rng.integers(3))]
    loaded = "right" if held == "left" else "left"
    first, ratio = strain * length * float(rng.uniform(0.1, 1.5)), float(rng.uniform(0.6, 1.5))
    falls = mu / length * float(rng.uniform(0.04, 0.25)) / max(ratio, 1.0) ** 2
    stiff = mu / length * float(10.0 ** rng.uniform(-0.5, 1.0))
    push = (
        math.inf if kind in ("rigid glue", "quadratic") or rng.random() < 0.3 else float(rng.uniform(0.5, 5.0)) * stiff
    )
    shut: hv.laws.Superpotential = hv.Signorini() if push == math.inf else hv.Compliance(push)
    friction: hv.laws.Friction = hv.laws.NoFriction()
    normal: VectorLaw | hv.laws.Superpotential
    if kind == "formula":
        width = strain * length * float(rng.uniform(1.5, 4.0))
        energy = falls * width**2 / 0.893
        text = f"{energy:.17g}*(1 - exp(-(min(r, 0)^2 + {ratio:.17g}^2*s^2)/{width:.17g}^2))"
        text += "" if push == math.inf else f" + {0.5 * push:.17g}*max(r, 0)^2"
        normal = CoupledFormulaLaw(text, reach=15.0 * width, rigid=push == math.inf)
        law = _formula(energy, width, ratio, push)
    elif kind == "orthotropic":
        bound = strain * mu * float(rng.uniform(0.05, 1.0))
        normal, friction = shut, OrthotropicFriction(bound, ratio=ratio, axis=(1.0, 0.0, 0.0))
        law = _plain(bound * np.array([1.0, ratio]), push)
    else:
        last = first + stiff * first / falls
        normal = MixedMode(BilinearCohesion(stiff * first, 0.5 * stiff * first * last, stiff), ratio, shut)
        law = _glue(stiff, first, last, ratio, push)
    contact, laws = {"bottom": hv.Contact(normal, friction)}, {"bottom": law}
    if kind == "beside":
        other, bound = ("right", "left")[held == "right"], strain * mu * float(rng.uniform(0.05, 0.5))
        loaded = "top" if held != "top" else ("right", "left")[other == "right"]
        contact[other] = hv.Contact(hv.Compliance(stiff), hv.Tresca(bound))
        laws[other] = _plain(np.array([bound]), stiff)
    load = strain * mu * rng.normal(size=dim)
    problem = hv.ContactProblem(
        mesh=_mesh(rng, dim, length),
        material=hv.Material.lame(lam, mu),
        supports={held: hv.Clamped()},
        contact=contact,
        body_force=tuple(strain * mu / length * rng.normal(size=dim)),
        tractions={loaded: tuple(load)},
        order=2 if kind == "quadratic" else 1,
    )
    return CoupledCase(kind, problem, lam, mu, laws)


def _lumped(nodes: np.ndarray, members: np.ndarray, force: np.ndarray) -> np.ndarray:
    """Loads of nodes by a constant force on simplices."""
    edges = nodes[members[:, 1:]] - nodes[members[:, :1]]
    sizes = np.sqrt(np.linalg.det(np.einsum("mid,mjd->mij", edges, edges))) / math.factorial(edges.shape[1])
    load = np.zeros((len(nodes), len(force)))
    for column in members.T:
        np.add.at(load, column, sizes[:, None] / members.shape[1] * force)
    return load


def _finer(case: CoupledCase, mesh: hv.Mesh) -> tuple[np.ndarray, np.ndarray, float]:
    """Displacement on a mesh, the stiffness there, and what it lacks of a solution."""
    problem = dataclasses.replace(case.problem, mesh=mesh, order=1)
    u = hv.solve(problem, controls=hv.Controls(rtol=1e-10)).raise_for_status().displacement
    nodes, dim = np.asarray(mesh.points), mesh.dim
    matrix = isotropic(case.lam, case.mu, dim, "strain")
    K = stiffness(Body(nodes, np.asarray(mesh.cells)), lambda x: np.broadcast_to(matrix, (len(x), *matrix.shape)), 0)
    load = _lumped(nodes, np.asarray(mesh.cells), np.array(problem.body_force))
    for name, traction in problem.tractions.items():
        load += _lumped(nodes, np.asarray(mesh.boundaries[name]), np.array(traction))
    left = load - (K @ u.ravel()).reshape(u.shape)
    held = np.unique(np.concatenate([mesh.boundaries[name].ravel() for name in problem.supports]))
    left[held] = 0.0
    touching = {name: np.setdiff1d(mesh.boundaries[name], held) for name in case.laws}
    corners = np.concatenate(list(touching.values()))
    corner = np.unique(corners, return_counts=True)
    shared = corner[0][corner[1] > 1]  # two laws at one node: together they balance it
    worst = 0.0
    for name, law in case.laws.items():
        own = np.setdiff1d(touching[name], shared)
        one = mesh.boundaries[name][0]
        tangent = nodes[one[1:]] - nodes[one[0]]
        normal = np.array([tangent[0, 1], -tangent[0, 0]]) if dim == 2 else np.array([0.0, 0.0, 1.0])
        normal = normal / np.linalg.norm(normal)
        normal = normal * np.sign(normal @ (nodes[one[0]] - nodes.mean(axis=0)))
        along = np.array([[-normal[1], normal[0]]]) if dim == 2 else np.eye(3)[:2]
        weight = _lumped(nodes, np.asarray(mesh.boundaries[name]), np.ones(1))[own]
        force = (left[own] @ np.vstack([normal, along]).T) / weight
        off = law(u[own] @ normal, u[own] @ along.T, force)
        worst = max(worst, float(off.max(initial=0.0) / max(np.abs(force).max(initial=0.0), 1e-300)))
        left[own] = 0.0
    left[shared] = 0.0
    return u, K, max(worst, float(np.abs(left).max() / np.abs(load).max()))


def judge_coupled(case: CoupledCase) -> Judged:
    """Solve, bound, and hold the bound against the finer solution."""
    problem = case.problem
    solution = hv.solve(problem, controls=hv.Controls(rtol=1e-10)).raise_for_status()
    found = solution.certify(exact=True).exact
    assert found is not None
    certified = "guaranteed" if found.guaranteed else "conditional" if found.conditions else "estimate"
    certified = certified if math.isfinite(found.bound) else "none"
    mesh, u = problem.mesh, np.asarray(solution.displacement)
    for _ in range(_FINER[mesh.dim]):
        u = np.vstack([u, 0.5 * (u[mesh.edges[:, 0]] + u[mesh.edges[:, 1]])]) if problem.order == 1 else u
        mesh = mesh.refined()
    if problem.order == 1:
        fine, K, off = _finer(case, mesh)
    else:
        finer, off = hv.solve(dataclasses.replace(problem, mesh=mesh)).raise_for_status(), 0.0
        assert solution.problem.field is not None
        assert finer.problem.field is not None
        u = interpolate(solution.problem.field, solution.displacement, finer.problem.field)
        fine, K = finer.displacement, stiffness_matrix(mesh, problem.material, 2)
    e = (fine - u).ravel()
    return Judged(certified, found.bound, math.sqrt(float(e @ (K @ e))), found.constant, off, found.reasons)
