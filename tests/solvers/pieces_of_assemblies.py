"""Small assemblies of two or three bodies, and all their equilibria by brute force.

Every contact point is on one of the pieces of its law: open or pressed, glued, softening or broken; sticking or
slipping to either side.  On such a choice the law is linear, so that one dense system for displacements and contact
forces gives the only candidate.  The library states the problem (stiffness, trace, weights, gaps); the laws are written
down here.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
from scipy.optimize import linprog

import hemivar as hv
from hemivar.basics.types import Array
from hemivar.discrete import DiscreteProblem

_FITS = 1e-8


@dataclass(frozen=True)
class Piece:
    """A straight piece of a graph, ``a r + b lam = c`` with ``lower <= r, lam <= upper``."""

    a: float
    b: float
    c: float
    r: tuple[float, float] = (-np.inf, np.inf)
    lam: tuple[float, float] = (-np.inf, np.inf)


OPEN, SHUT = Piece(0.0, 1.0, 0.0, r=(-np.inf, 0.0)), Piece(1.0, 0.0, 0.0, lam=(0.0, np.inf))

#: A boundary that is moved down and sideways.
PUSHED = hv.Prescribed((0.01, -0.02))


@dataclass(frozen=True)
class Law:
    """A normal law and a friction, stated to the library, and as pieces."""

    stated: hv.Contact
    normal: tuple[Piece, ...]
    bound: float = 0.0
    mu: float = 0.0
    glued: bool = False

    @property
    def slips(self) -> tuple[str, ...]:
        return ("stick", "ahead", "back") if self.bound or self.mu else ("free",)


def random_pieces(rng: np.random.Generator, size: float, glue: bool = True) -> Law:
    """Rigid contact, springs or glue that softens; smooth, with a bound of friction, or with Coulomb's law."""
    kind, friction = rng.choice(["rigid", "springs", "glue"] if glue else ["rigid", "springs"]), rng.integers(3)
    stiff, soft = float(10.0 ** rng.uniform(0.0, 3.0)), float(10.0 ** rng.uniform(-1.0, 1.0))
    glued = kind == "glue"
    if kind == "rigid":
        law, normal = hv.Signorini(), (OPEN, SHUT)
    elif kind == "springs":
        law, normal = hv.Compliance(stiff), (OPEN, Piece(-stiff, 1.0, 0.0, r=(0.0, np.inf)))
    else:
        strength, below = float(size * rng.uniform(0.3, 3.0)), float(10.0 ** rng.uniform(1.0, 3.0))
        start = strength / stiff
        end = start + strength / soft
        law = hv.Adhesive(stiff, strength, softening=soft, compression=below)
        normal = (
            Piece(-below, 1.0, 0.0, r=(0.0, np.inf)),
            Piece(-stiff, 1.0, 0.0, r=(-start, 0.0)),
            Piece(soft, 1.0, -soft * end, r=(-end, -start)),
            Piece(0.0, 1.0, 0.0, r=(-np.inf, -end)),
        )
    bound, mu = size * float(rng.uniform(0.05, 1.0)), float(rng.uniform(0.1, 1.0))
    if friction == 0:
        return Law(hv.Contact(law), normal, glued=glued)
    if friction == 1 or glued:
        return Law(hv.Contact(law, hv.Tresca(bound)), normal, bound=bound, glued=glued)
    return Law(hv.Contact(law, hv.Coulomb(mu)), normal, mu=mu)


@dataclass(frozen=True, eq=False)
class Assembly:
    """A statement, and the law of each contact."""

    statement: hv.ContactProblem
    laws: dict[str, Law]

    def law_of(self, problem: DiscreteProblem) -> list[Law]:
        names = problem.contact.names
        return [self.laws[names[k]] for k in problem.contact.boundary]

    @property
    def coulomb(self) -> bool:
        return any(law.mu for law in self.laws.values())

    @property
    def glued(self) -> bool:
        return any(law.glued for law in self.laws.values())


def random_assembly(rng: np.random.Generator) -> Assembly:
    """Two or three rectangles: on top of one another, or two of them on one; on supports or on a foundation."""
    size = float(10.0 ** rng.uniform(-1.0, 1.0))
    count = int(rng.integers(2, 4))
    side_by_side = count == 3 and rng.random() < 0.4
    meshes, height = {}, 0.0
    wide = float(rng.uniform(1.0, 2.0))
    for k in range(count):
        width, tall = float(rng.uniform(0.6, 1.0)) * wide, float(rng.uniform(0.3, 1.0))
        left = float(rng.uniform(-0.3, 0.3)) if k else 0.0
        if side_by_side and k:
            width, left = 0.4 * wide, (0.05 if k == 1 else 0.55) * wide
        if not k:
            width = wide
        cells = (int(rng.integers(1, 3 if count == 2 else 2)), int(rng.integers(1, 3)))
        lift = height if not side_by_side or k < 2 else meshes["b0"].points[:, 1].max()
        meshes[f"b{k}"] = hv.rectangle((width, tall), cells, origin=(left, float(lift)))
        height = float(lift) + tall
    mesh = hv.Mesh.assembled(meshes)
    laws: dict[str, Law] = {}
    for k in range(1, count):
        below = 0 if side_by_side else k - 1
        law = random_pieces(rng, size)
        gap = float(rng.choice([0.0, 0.02, -0.02])) * float(rng.random())
        master, slave = f"b{below}:top", f"b{k}:bottom"
        laws[slave] = _against(law, master, gap, slave if rng.random() < 0.5 or side_by_side else None)
    supports: dict[str, hv.mechanics.Clamped | hv.Fixed | hv.Prescribed] = {}
    if rng.random() < 0.35:
        laws["b0:bottom"] = random_pieces(rng, size, glue=False)
        if rng.random() < 0.5:
            supports["b0:left"] = hv.Fixed(x=0.0)
    else:
        supports["b0:bottom"] = hv.mechanics.Clamped()
    for k in range(1, count):
        if side_by_side or k == count - 1:
            supports |= [{}, {f"b{k}:top": hv.Fixed(x=0.0)}, {f"b{k}:top": PUSHED}][rng.integers(3)]
    tractions = {}
    for k in range(1, count):
        name = f"b{k}:top"
        if supports.get(name) is PUSHED:
            continue
        if side_by_side or k == count - 1:
            down = -1.0 if rng.random() < 0.85 else 0.5
            side = float(rng.choice([0.0, 0.1, 0.4])) * float(rng.normal())
            tractions[name] = (size * side, size * down)
        elif rng.random() < 0.3:
            tractions[f"b{k}:right"] = (size * float(rng.normal()) * 0.2, -0.1 * size)
    if "b0:left" not in supports and rng.random() < 0.2:
        tractions["b0:right"] = (-0.1 * size, 0.0)
    stiff = float(size * 10.0 ** rng.uniform(1.0, 3.0))
    turn, c = float(rng.choice([0.0, 0.5])), {name: law.stated for name, law in laws.items()}
    if not turn or any(not isinstance(one, hv.mechanics.Clamped) for one in supports.values()):
        return Assembly(hv.ContactProblem(mesh, hv.Material.young(stiff, 0.3), c, supports, tractions=tractions), laws)
    R = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    turned = {name: tuple((R @ np.array(load)).tolist()) for name, load in tractions.items()}
    return Assembly(
        hv.ContactProblem(mesh.moved(R), hv.Material.young(stiff, 0.3), c, supports, tractions=turned), laws
    )


def _against(law: Law, master: str, gap: float, slave: str | None) -> Law:
    stated = law.stated
    return Law(
        hv.Contact(stated.normal, stated.friction, gap=gap, against=master, slave=slave),
        law.normal,
        law.bound,
        law.mu,
        law.glued,
    )


# ---- what holds it -------------------------------------------------------------------------------------------------


def margin(assembly: Assembly, problem: DiscreteProblem) -> float:
    """Part of the load that may be added to it along any rigid motion, glue being broken; negative where none balances.

    The cone of contact forces of each point is that of Coulomb's law, or of its bound.
    """
    K = problem.stiffness.toarray()
    values, vectors = np.linalg.eigh(K)
    rigid = vectors[:, values < 1e-10 * values[-1]]
    load = rigid.T @ problem.load
    if not load.size:
        return 1.0
    size = float(np.linalg.norm(load))
    if size < 1e-12 * np.linalg.norm(problem.load):
        size, load = 1.0, np.zeros_like(load)
    trace = (problem.contact.trace @ rigid).reshape(*problem.contact.shape, -1)
    laws, weights = assembly.law_of(problem), problem.contact.weights
    # the force on each point is a sum of ends: (1, +mu), (1, -mu) without bound, and (0, +-bound), shares of one
    far, near = [], []
    for j, law in enumerate(laws):
        for sign in (1.0, -1.0):
            far.append(weights[j] * (trace[j, 0] + sign * law.mu * trace[j, 1]))
            near.append(weights[j] * sign * law.bound / size * trace[j, 1])
    sides = np.array(far + near).T
    shares = np.zeros((len(laws), sides.shape[1]))
    for j in range(len(laws)):
        shares[j, len(far) + 2 * j : len(far) + 2 * j + 2] = 1.0
    least = np.inf
    for way in itertools.chain(np.eye(load.size), -np.eye(load.size)):
        matrix = np.column_stack([sides, -way])
        cost = np.zeros(matrix.shape[1])
        cost[-1] = -1.0
        bounds = [(0.0, None)] * (matrix.shape[1] - 1) + [(None, 1.0)]
        found = linprog(
            cost, np.column_stack([shares, np.zeros(len(laws))]), np.ones(len(laws)), matrix, load / size, bounds
        )
        least = min(least, -float(found.fun) if found.status == 0 else -1.0)
    return least


# ---- all solutions -------------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Found:
    """Local displacements (k, m, 2) of the equilibria, their energies, and whether a singular choice is possible."""

    local: Array
    energies: Array
    more: bool


def choices(assembly: Assembly, problem: DiscreteProblem) -> list[tuple[tuple[int, str], ...]]:
    """What one point each may do."""
    return [tuple((k, slip) for k in range(len(law.normal)) for slip in law.slips) for law in assembly.law_of(problem)]


def number_of_choices(assembly: Assembly, problem: DiscreteProblem) -> int:
    return int(np.prod([len(one) for one in choices(assembly, problem)]))


def misfit(assembly: Assembly, problem: DiscreteProblem, u: Array, lam: Array) -> float:
    """How far a pair (n,), (m, 2) is from an equilibrium, against load and displacement."""
    K, B = problem.stiffness.toarray(), problem.contact.trace.toarray()
    scale = np.abs(problem.load).max() + np.abs(problem.contact.weights[:, None] * lam).max()
    worst = float(np.abs(K @ u + B.T @ (problem.contact.weights[:, None] * lam).ravel() - problem.load).max()) / scale
    r = (B @ u).reshape(-1, 2) - problem.offset
    force = np.abs(lam).max() + np.abs(problem.load).sum() / problem.contact.weights.sum()
    length = np.abs(r).max() + np.abs(u).max() + 1e-300
    free = ~_active(problem)
    for j, law in enumerate(assembly.law_of(problem)):
        fits = min(_off(piece, r[j, 0], lam[j, 0], length, force) for piece in law.normal)
        bound = law.bound + law.mu * max(lam[j, 0], 0.0)
        slip = 0.0 if free[j, 1] else min(
            max(abs(r[j, 1]) / length, (abs(lam[j, 1]) - bound) / force),
            max(abs(lam[j, 1] - bound) / force, -r[j, 1] / length),
            max(abs(lam[j, 1] + bound) / force, r[j, 1] / length),
        )  # fmt: skip
        worst = max(worst, fits, slip)
    return worst


def _off(piece: Piece, r: float, lam: float, length: float, force: float) -> float:
    steep = abs(piece.a) * length + abs(piece.b) * force + abs(piece.c)
    on = abs(piece.a * r + piece.b * lam - piece.c) / max(steep, 1e-300)
    ranges = [(piece.r[0] - r) / length, (r - piece.r[1]) / length]
    ranges += [(piece.lam[0] - lam) / force, (lam - piece.lam[1]) / force]
    return max(on, *ranges)


def _active(problem: DiscreteProblem) -> Array:
    return (np.diff(problem.contact.trace.indptr) > 0).reshape(problem.contact.shape)


def all_equilibria(assembly: Assembly, problem: DiscreteProblem) -> Found:
    """Each choice tried; batches of dense systems for (u, lam)."""
    K, B, w = problem.stiffness.toarray(), problem.contact.trace.toarray(), problem.contact.weights
    n, m = K.shape[0], w.size
    stiff = np.abs(np.diag(K)).max()
    laws, active, every = assembly.law_of(problem), _active(problem), choices(assembly, problem)
    rows: list[
        list[tuple[Array, float]]
    ] = []  # of each point and choice: two rows over (r_n, r_t, lam_n, lam_t) and sides
    for j, law in enumerate(laws):
        mine = []
        for k, slip in every[j]:
            piece = law.normal[k]
            row, side = np.zeros((2, 4)), np.zeros(2)
            row[0], side[0] = (piece.a, 0.0, piece.b, 0.0), piece.c
            if not active[j, 1]:
                row[1] = (0.0, 0.0, 0.0, 1.0)
            elif slip == "stick":
                row[1] = (0.0, 1.0, 0.0, 0.0)
            else:
                sign = {"ahead": 1.0, "back": -1.0, "free": 0.0}[slip]
                pressed = not (piece.b == 1.0 and piece.a == 0.0)
                row[1], side[1] = (0.0, 0.0, -sign * law.mu * pressed, 1.0), sign * law.bound
            mine.append((row, side))
        rows.append(mine)
    local, energies, more = [], [], False
    product = list(itertools.product(*(range(len(one)) for one in every)))
    W = np.repeat(w, 2)
    for start in range(0, len(product), 2000):
        chosen = product[start : start + 2000]
        system = np.zeros((len(chosen), n + 2 * m, n + 2 * m))
        side = np.zeros((len(chosen), n + 2 * m))
        system[:, :n, :n], system[:, :n, n:] = K / stiff, B.T * W / stiff
        side[:, :n] = problem.load / stiff
        for i, choice in enumerate(chosen):
            for j, c in enumerate(choice):
                row, value = rows[j][c]
                own = slice(n + 2 * j, n + 2 * j + 2)
                scale = np.abs(row).max(axis=1)
                system[i, own, :n] = (row[:, :2] @ B[2 * j : 2 * j + 2]) / scale[:, None]
                system[i, own, own] = row[:, 2:] / scale[:, None]
                side[i, own] = (value + row[:, :2] @ problem.offset[j]) / scale
        condition = np.linalg.cond(system)
        regular = np.isfinite(condition) & (condition < 1e12)
        answers = np.full(side.shape, np.nan)
        answers[regular] = np.linalg.solve(system[regular], side[regular][:, :, None])[:, :, 0]
        for i, choice in enumerate(chosen):
            x = answers[i]
            if not regular[i]:
                x, *_ = np.linalg.lstsq(system[i], side[i], rcond=1e-11)
                if np.abs(system[i] @ x - side[i]).max() > 1e-9 * np.abs(side[i]).max():
                    continue
                more = more or _possible(assembly, problem, choice, every, system[i], x)
                continue
            u, lam = x[:n], x[n:].reshape(-1, 2)
            if misfit(assembly, problem, u, lam) > _FITS:
                continue
            r = (B @ u).reshape(-1, 2) - problem.offset
            if any(np.abs(r - one).max() <= 1e-6 * np.abs(u).max() for one in local):
                continue
            local.append(r)
            energies.append(_energy(assembly, problem, u, r))
    shaped = np.array(local).reshape(-1, m, 2)
    return Found(shaped, np.array(energies), more)


def _possible(
    assembly: Assembly,
    problem: DiscreteProblem,
    choice: tuple[int, ...],
    every: list[tuple[tuple[int, str], ...]],
    system: Array,
    x: Array,
) -> bool:
    """Whether a line of solutions of a singular choice meets its inequalities."""
    _, values, right = np.linalg.svd(system)
    kernel = right[values < 1e-11 * values[0]].T
    n, B = problem.unknowns, problem.contact.trace.toarray()
    on_r, on_lam = B @ kernel[:n], kernel[n:]
    r, lam = B @ x[:n] - problem.offset.ravel(), x[n:]
    upper, bound = [], []
    for j, law in enumerate(assembly.law_of(problem)):
        k, slip = every[j][choice[j]]
        piece, i, t = law.normal[k], 2 * j, 2 * j + 1
        for sign, edge, value, row in (
            (-1.0, piece.r[0], r[i], on_r[i]), (1.0, piece.r[1], r[i], on_r[i]),
            (-1.0, piece.lam[0], lam[i], on_lam[i]), (1.0, piece.lam[1], lam[i], on_lam[i]),
        ):  # fmt: skip
            if np.isfinite(edge):
                upper.append(sign * row)
                bound.append(sign * (edge - value))
        if slip == "stick":
            for sign in (1.0, -1.0):
                upper.append(sign * on_lam[t] - law.mu * on_lam[i])
                bound.append(law.bound + law.mu * lam[i] - sign * lam[t])
        elif slip != "free":
            sign = 1.0 if slip == "ahead" else -1.0
            upper.append(-sign * on_r[t])
            bound.append(sign * r[t])
    slack = 1e-9 * (np.abs(x).max() + np.abs(r).max())
    found = linprog(
        np.zeros(kernel.shape[1]), np.array(upper), np.array(bound) + slack, bounds=[(None, None)] * kernel.shape[1]
    )
    return bool(found.status == 0)


def _energy(assembly: Assembly, problem: DiscreteProblem, u: Array, r: Array) -> float:
    """Stored energy, less the work of the load, and that of the laws as the area under their graphs."""
    total = 0.5 * float(u @ (problem.stiffness @ u)) - float(problem.load @ u)
    for j, law in enumerate(assembly.law_of(problem)):
        total += problem.contact.weights[j] * (_area(law.normal, r[j, 0]) + law.bound * abs(r[j, 1]))
    return total


def _area(pieces: tuple[Piece, ...], r: float) -> float:
    """Area under a graph from zero to r, its pieces being force laws or rigid."""
    area = 0.0
    for piece in pieces:
        if not piece.b:
            continue
        low, high = max(piece.r[0], min(r, 0.0)), min(piece.r[1], max(r, 0.0))
        if high > low:
            force = piece.c - 0.5 * piece.a * (low + high)
            area += force * (high - low) * (1.0 if r > 0.0 else -1.0)
    return area
