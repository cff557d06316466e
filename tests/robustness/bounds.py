"""``python -m tests.robustness bounds --cases 300 --seed 2``: random bounds against finer solutions.

Plane bodies and some in space, sheared and shaken, with turned planes, spheres and gaps as obstacles, loads by formulas
with narrow features, laws that rise, soften or are rigid, and friction. The reference lives on a nested mesh and shares
no code with the bound: stiffness and loads of :mod:`tests.robustness.elasticity`, obstacles and laws written out here,
contact solved by active sets on the condensed equations. By the orthogonality of Galerkin its distance to the solution
is less than the error, but for contact: a bound below it is wrong.
"""

from __future__ import annotations

import argparse
import dataclasses
import math
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from multiprocessing import get_context

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spla

import hemivar as hv
from hemivar.errors import ProblemError
from hemivar.formula import Formula, FormulaArray
from tests.robustness.elasticity import Body, gauss_rule, isotropic, stiffness

__all__ = ["BoundCase", "Verdict", "judge", "main", "make", "run_bounds"]

#: How often the mesh is cut in halves for the reference, and points an axis of the rule of its loads.
_FINER, _POINTS = {2: 3, 3: 1}, {2: 8, 3: 5}
#: By how much a bound may be below what is found: rounding of both.
_ROUNDING = 1e-8
_ROUNDS = 80


@dataclass
class BoundCase:
    """A statement, and what the reference needs of it.

    Attributes
    ----------
    name : str
        ``seed:number``; it makes the case again.
    note : str
        What is in it.
    problem : ContactProblem
    lam, mu : float
        Of the material.
    gap : callable
        Places (k, d) and outward normals (k, d) to gaps (k,) and contact normals (k, d).
    law : tuple of arrays
        Penetrations and pressures between which the law is linear, constant beyond; none if it is rigid.
    friction : float
        Bound of the friction.
    body, top : callable
        Places (k, d) to forces (k, d).
    """

    name: str
    note: str
    problem: hv.ContactProblem
    lam: float
    mu: float
    gap: Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]
    law: tuple[np.ndarray, np.ndarray] | None
    friction: float
    body: Callable[[np.ndarray], np.ndarray]
    top: Callable[[np.ndarray], np.ndarray]


@dataclass
class Verdict:
    """What became of it: ``held``, ``below`` (a fault), ``estimate``, ``no bound``, ``refused``, ``no reference``."""

    name: str
    note: str
    outcome: str
    bound: float = math.nan
    error: float = math.nan
    reasons: tuple[str, ...] = ()

    @property
    def ratio(self) -> float:
        """Bound over error."""
        return self.bound / self.error if self.error > 0.0 else math.inf


# ---- statements -----------------------------------------------------------------------------------------------------


def _feature(rng: np.random.Generator, dim: int) -> tuple[str, float]:
    """A formula of the place with a narrow feature, and its width."""
    axis = "xyz"[rng.integers(dim)]
    at, width = round(float(rng.uniform(0.0, 1.0)), 3), round(float(10.0 ** rng.uniform(-1.7, -0.3)), 3)
    kind = rng.integers(5)
    if kind == 0:
        return f"max(0, 1 - abs({axis} - {at})/{width})", width
    if kind == 1:
        return f"exp(-(({axis} - {at})/{width})^2)", width
    if kind == 2:
        return f"sin({axis}/{width} + {at})", width
    if kind == 3:
        return f"min(1, ({width}/(abs({axis} - {at}) + {width}/2))^2)", width
    other = "xyz"[rng.integers(dim)]
    return f"{axis}*{other} - {at}", 1.0


def _evaluated(texts: list[str]) -> Callable[[np.ndarray], np.ndarray]:
    """Formulas by numpy, and not by the library's reader."""
    names = {"abs": np.abs, "max": np.maximum, "min": np.minimum, "exp": np.exp, "sin": np.sin}
    codes = [compile(text.replace("^", "**"), "a load", "eval") for text in texts]

    def force(x: np.ndarray) -> np.ndarray:
        at = {**names, **dict(zip("xyz", x.T, strict=False))}
        return np.stack([np.broadcast_to(eval(code, {"__builtins__": {}}, at), len(x)) for code in codes], axis=1)

    return force


def _load(rng: np.random.Generator, dim: int, size: float) -> tuple[object, list[str]]:
    """A load by formulas, with the texts of its components."""
    texts = []
    for _ in range(dim):
        feature, width = _feature(rng, dim)
        factor = size * float(rng.normal()) / math.sqrt(min(4.0 * width, 1.0))
        texts.append(f"{factor:.6g}*({feature})" if rng.random() < 0.7 else f"{size * rng.normal():.6g}")
    return FormulaArray(tuple(Formula(text) for text in texts), (dim,)), texts


def _mesh(rng: np.random.Generator, dim: int) -> hv.Mesh:
    sides = rng.uniform(0.6, 2.0, dim)
    counts = rng.integers(2, 5, dim) if dim == 2 else rng.integers(1, 3, dim)
    mesh = (hv.rectangle if dim == 2 else hv.box)(tuple(sides), tuple(int(n) for n in counts))
    points = np.array(mesh.points)
    inner = ((points > 1e-9) & (points < sides - 1e-9)).all(axis=1)
    points[inner] += 0.2 * (sides / counts) * rng.uniform(-1.0, 1.0, points[inner].shape)
    points[:, 0] += rng.uniform(-0.4, 0.4) * points[:, -1]  # sheared: bottom and top stay level
    return dataclasses.replace(mesh, points=points, parent=None)


def make(seed: int, number: int) -> BoundCase:
    """The case of a seed and a number; always the same one."""
    rng = np.random.default_rng([seed, number, 2409])
    dim = 3 if number % 6 == 5 else 2
    mesh = _mesh(rng, dim)
    lam, mu = (float(x) for x in 10.0 ** rng.uniform(-0.3, 1.2, 2))
    contact_side = "bottom"
    held = ["left", "right", "top"][int(rng.integers(3))] if dim == 2 else "top"
    loaded = "right" if held != "right" else "left"

    bottom = mesh.points[np.unique(mesh.boundaries[contact_side])]
    centre, extent = bottom.mean(axis=0), float(np.ptp(bottom[:, 0]))
    gap = round(float(rng.choice([0.0, 0.02, -0.02]) * rng.random()), 5)
    shape = ("gap", "turned", "turned", "sphere", "body's")[number % 5]
    normal = np.zeros(dim)
    normal[-1] = 1.0
    obstacle: hv.Plane | hv.mechanics.Sphere | None = None
    if shape in ("turned", "body's"):
        angle = rng.uniform(-1.3, 1.3) if shape == "turned" else rng.uniform(-0.3, 0.3)
        normal[0], normal[-1] = math.sin(angle), math.cos(angle)
        lowest = bottom[np.argmin(bottom @ normal)]
        obstacle = hv.Plane(tuple(lowest - abs(gap) * normal), tuple(normal))
    elif shape == "sphere":
        radius = extent * rng.uniform(1.0, 4.0)
        obstacle = hv.mechanics.Sphere(tuple(centre - (radius + abs(gap)) * normal), radius)
    own = hv.mechanics.Normals.BODY if shape == "body's" else None

    def gaps(places: np.ndarray, outward: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        if obstacle is None:
            return np.full(len(places), gap), outward
        if isinstance(obstacle, hv.mechanics.Sphere):
            arm = places - np.array(obstacle.center)
            size = np.linalg.norm(arm, axis=1)
            return size - obstacle.radius, -arm / size[:, None]
        distance = (places - np.array(obstacle.point)) @ normal
        if own is None:
            return distance, np.broadcast_to(-normal, places.shape)
        return distance / -(outward @ normal), outward

    stiff = mu * 10.0 ** rng.uniform(-1.0, 1.0)
    kind = int(rng.integers(4))
    reach = 0.05
    if kind == 0:
        law, table = hv.Compliance(stiff), (np.array([0.0, 1e3]), np.array([0.0, 1e3 * stiff]))
    elif kind == 1:
        fall = float(rng.uniform(0.02, 0.3)) * mu
        table = (np.array([0.0, reach, 3.0 * reach]), np.array([0.0, 2.0 * reach * fall, 0.0]))
        law = hv.table_law(*table)
    elif kind == 2:
        pull = float(rng.uniform(0.02, 0.3)) * mu * reach  # glue, which softens when it is pulled
        knots = np.array([-3.0 * reach, -reach, 0.0, 10.0])
        table = (knots, np.array([0.0, -pull, 0.0, 10.0 * stiff]))
        law = hv.table_law(*table)
    else:
        law, table = hv.Signorini(), None
    slip = float(rng.choice([0.0, 0.05, 0.5])) * mu * 0.05 if dim == 2 else 0.0
    friction = hv.Tresca(slip) if slip > 0.0 else hv.laws.NoFriction()
    where = {"gap": gap} if obstacle is None else {"obstacle": obstacle, "normals": own}
    body, texts = _load(rng, dim, mu * 0.05)
    top, others = _load(rng, dim, mu * 0.05)
    problem = hv.ContactProblem(
        mesh=mesh,
        material=hv.Material.lame(lam, mu),
        supports={held: hv.Clamped()},
        contact={contact_side: hv.Contact(law, friction, **where)},
        body_force=body,
        tractions={loaded: top},
    )
    note = f"{dim}D, {shape}, law {kind}, friction {slip:.3g}, body {texts}, {loaded} {others}"
    made = _evaluated(texts), _evaluated(others)
    return BoundCase(f"{seed}:{number}", note, problem, lam, mu, gaps, table, slip, *made)


# ---- the reference --------------------------------------------------------------------------------------------------


def _forces(
    nodes: np.ndarray, members: np.ndarray, measures: np.ndarray, force: Callable[[np.ndarray], np.ndarray], points: int
) -> np.ndarray:
    """Loads of nodes, with a rule on each of many simplices."""
    load = np.zeros(nodes.shape)
    places, weights = gauss_rule(members.shape[1] - 1, points)
    for place, weight in zip(places, weights, strict=True):
        values = weight * measures[:, None] * force(np.einsum("k,mkd->md", place, nodes[members]))
        for column, part in enumerate(place):
            np.add.at(load, members[:, column], part * values)
    return load


def _facets(mesh: hv.Mesh, name: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Facets of a boundary, their measures and outward normals, by geometry alone."""
    facets = np.asarray(mesh.boundaries[name])
    corners = mesh.points[facets]
    if mesh.dim == 2:
        edge = corners[:, 1] - corners[:, 0]
        normal = np.stack([edge[:, 1], -edge[:, 0]], axis=1)
    else:
        normal = 0.5 * np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    measures = np.linalg.norm(normal, axis=1)
    normal = normal / measures[:, None]
    outward = np.einsum("fd,fd->f", normal, corners.mean(axis=1) - mesh.points.mean(axis=0))
    return facets, measures, normal * np.sign(outward)[:, None]


def _reference(case: BoundCase, mesh: hv.Mesh) -> tuple[np.ndarray, sp.csr_array] | None:
    """Displacement (n d,) and stiffness on a mesh; None where the active sets do not settle."""
    problem, dim = case.problem, mesh.dim
    nodes, cells = np.asarray(mesh.points), np.asarray(mesh.cells)
    body = Body(nodes, cells)
    matrix = isotropic(case.lam, case.mu, dim, "strain")
    K = stiffness(body, lambda x: np.broadcast_to(matrix, (len(x), *matrix.shape)), 0)
    load = _forces(nodes, cells, body.volumes, case.body, _POINTS[dim])
    for name in problem.tractions:
        facets, measures, _ = _facets(mesh, name)
        load += _forces(nodes, facets, measures, case.top, 3 * _POINTS[dim])
    held = np.zeros(nodes.shape, dtype=bool)
    for name in problem.supports:
        held[np.unique(mesh.boundaries[name])] = True
    free = np.flatnonzero(~held.ravel())
    (name,) = problem.contact
    facets, measures, outward = _facets(mesh, name)
    touching = np.unique(facets)
    touching = touching[~held[touching].any(axis=1)]
    weight = np.bincount(facets.ravel(), np.repeat(measures / dim, dim), minlength=len(nodes))[touching]
    gap, normal = case.gap(nodes[touching], np.broadcast_to(outward[0], (len(touching), dim)))
    rows = [normal]
    if dim == 2:
        rows.append(np.stack([-normal[:, 1], normal[:, 0]], axis=1))
    B = np.zeros((len(rows) * len(touching), nodes.size))
    for part, direction in enumerate(rows):
        for i, node in enumerate(touching):
            B[part * len(touching) + i, node * dim : node * dim + dim] = direction[i]
    factor = spla.splu(sp.csc_matrix(K[free][:, free]))
    flexible = factor.solve(B[:, free].T)
    F = B[:, free] @ flexible
    start = B[:, free] @ factor.solve(load.ravel()[free])
    start[: len(touching)] -= gap
    forces = _active_sets(case, F, start, weight)
    if forces is None:
        return None
    u = np.zeros(nodes.size)
    u[free] = factor.solve(load.ravel()[free]) - flexible @ (np.tile(weight, len(rows)) * forces)
    return u, K


def _active_sets(case: BoundCase, F: np.ndarray, start: np.ndarray, weight: np.ndarray) -> np.ndarray | None:
    """Forces l with ``r + F W l = start`` and l in the law of r, point by point."""
    m = len(weight)
    size = len(start)
    W = np.tile(weight, size // m)
    rho = 1.0 / max(float(np.abs(F * W).sum(axis=1).max()), 1e-300)
    r, force, seen = start.copy(), np.zeros(size), None
    for _ in range(_ROUNDS):
        # each point: force = a + s r, or r = 0 where it is held
        a, s, stuck = np.zeros(size), np.zeros(size), np.zeros(size, dtype=bool)
        if case.law is None:
            stuck[:m] = force[:m] + rho * r[:m] > 0.0
        else:
            knots, values = case.law
            piece = np.searchsorted(knots, r[:m])
            slopes = np.concatenate([[0.0], np.diff(values) / np.diff(knots), [0.0]])
            at, base = np.concatenate([knots[:1], knots]), np.concatenate([values[:1], values])
            s[:m] = slopes[piece]
            a[:m] = base[piece] - s[:m] * at[piece]
        pushed = force[m:] + rho * r[m:]
        stuck[m:] = np.abs(pushed) < case.friction
        a[m:] = np.where(stuck[m:], 0.0, np.sign(pushed) * case.friction)
        now = np.concatenate([stuck, s, a])
        if seen is not None and np.allclose(now, seen, rtol=0.0, atol=1e-14 * np.abs(now).max(initial=1e-300)):
            return force
        seen = now
        # unknowns: forces of what is held, else r
        A = np.where(stuck, F * W, np.eye(size) + F * (W * s))
        b = start - F @ (W * a)
        try:
            x = np.linalg.solve(A, b)
        except np.linalg.LinAlgError:
            return None
        force = np.where(stuck, x, a + s * x)
        r = np.where(stuck, 0.0, x)
    return None


def _carried(mesh: hv.Mesh, u: np.ndarray, places: np.ndarray) -> np.ndarray:
    """A linear field on a mesh at places inside."""
    corners = mesh.points[mesh.cells]
    inverse = np.linalg.inv((corners[:, 1:] - corners[:, :1]).transpose(0, 2, 1))
    rest = np.einsum("mij,mpj->mpi", inverse, places[None] - corners[:, :1])
    barycentric = np.concatenate([1.0 - rest.sum(axis=2, keepdims=True), rest], axis=2)
    cell = np.argmax(barycentric.min(axis=2), axis=0)
    own = barycentric[cell, np.arange(len(places))]
    return np.einsum("pa,pad->pd", own, u[mesh.cells[cell]])


# ---- judging --------------------------------------------------------------------------------------------------------


def judge(case: BoundCase) -> Verdict:
    """Solve, bound, and hold the bound against the reference."""
    try:
        solution = hv.solve(case.problem)
        if solution.status is not hv.Status.CONVERGED:
            return Verdict(case.name, case.note, "refused", reasons=(str(solution.status),))
        found = solution.certify(exact=True).exact
    except ProblemError as error:
        return Verdict(case.name, case.note, "refused", reasons=(str(error),))
    assert found is not None
    if not math.isfinite(found.bound):
        return Verdict(case.name, case.note, "no bound", reasons=found.reasons)
    mesh = case.problem.mesh.refined(_FINER[case.problem.mesh.dim])
    reference = _reference(case, mesh)
    if reference is None:
        return Verdict(case.name, case.note, "no reference", found.bound)
    u, K = reference
    off = u - _carried(case.problem.mesh, np.asarray(solution.displacement), mesh.points).ravel()
    error = math.sqrt(max(float(off @ (K @ off)), 0.0))
    size = math.sqrt(max(float(u @ (K @ u)), 0.0))
    outcome = "held" if found.guaranteed else "estimate"
    if found.guaranteed and found.bound < error - _ROUNDING * size:
        outcome = "below"
    return Verdict(case.name, case.note, outcome, found.bound, error, found.reasons)


def _judged(task: tuple[int, int]) -> Verdict:
    return judge(make(*task))


def run_bounds(seed: int, numbers: range, jobs: int = 1) -> Iterator[Verdict]:
    """Judge cases one after the other, or in several processes; in the order of the numbers."""
    tasks = [(seed, number) for number in numbers]
    if jobs == 1:
        yield from map(_judged, tasks)
        return
    with get_context("spawn").Pool(jobs) as pool:
        yield from pool.imap(_judged, tasks)


def main(arguments: Sequence[str]) -> int:
    """The command line: run cases and print what became of them."""
    parser = argparse.ArgumentParser(prog="python -m tests.robustness bounds", description=__doc__)
    parser.add_argument("--cases", type=int, default=100, help="how many (100)")
    parser.add_argument("--seed", type=int, default=1, help="of the random numbers (1)")
    parser.add_argument("--first", type=int, default=0, help="number of the first case (0)")
    parser.add_argument("--jobs", type=int, default=2, help="processes at work at once (2)")
    given = parser.parse_args(arguments)
    begun, verdicts = time.monotonic(), []
    for one in run_bounds(given.seed, range(given.first, given.first + given.cases), given.jobs):
        verdicts.append(one)
        print(
            f"{one.name:>8} {one.outcome:12} {one.bound:10.4g} {one.error:10.4g} {one.ratio:8.2f}  {one.note}",
            flush=True,
        )
        if one.outcome in ("refused", "no bound"):
            print(f"{'':10}{' | '.join(one.reasons)[:200]}")
    ratios = np.array([one.ratio for one in verdicts if one.outcome == "held"])
    print(Counter(one.outcome for one in verdicts), f"in {time.monotonic() - begun:.0f} s")
    if len(ratios):
        print(f"guaranteed bound over error: median {np.median(ratios):.2f}, least {ratios.min():.2f}")
    return int(any(one.outcome == "below" for one in verdicts))
