"""Statements at random for ``bounds.py``: bodies, meshes, materials, supports, laws, loads and units of every kind.

A body is drawn from one random number, the laws and loads on it from another: constants of the body, which cost more
than anything else, serve all statements on it.  Laws that soften are scaled by the trace constant of the body, so
that there is a margin in most.  All numbers are in units of a length and a modulus that are drawn too.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

import hemivar as hv
from hemivar.formula import Formula, FormulaArray
from hemivar.laws.friction import PenetrationBound
from hemivar.mesh import Mesh, box, rectangle

Array = np.ndarray[Any, np.dtype[np.float64]]


@dataclass(frozen=True)
class Body:
    """A body without laws and loads.

    ``length`` and ``modulus`` are its units; ``turn`` the matrix that the body was turned by; ``words`` say what it is.
    """

    problem: hv.ContactProblem
    length: float
    modulus: float
    turn: Array
    words: str


# ---- meshes --------------------------------------------------------------------------------------------------------


def _shaken(mesh: Mesh, rng: np.random.Generator) -> Mesh:
    inner = np.setdiff1d(np.arange(mesh.number_of_nodes), np.unique(mesh.boundary_facets))
    points = mesh.points.copy()
    lengths = np.linalg.norm(points[mesh.edges[:, 1]] - points[mesh.edges[:, 0]], axis=1)
    points[inner] += 0.2 * lengths.min() * rng.uniform(-1.0, 1.0, (len(inner), mesh.dim))
    return Mesh(points, mesh.cells, dict(mesh.boundaries))


def _graded(mesh: Mesh, rng: np.random.Generator) -> Mesh:
    """Cells that shrink towards one side, or one corner."""
    size = mesh.points.max(axis=0)
    power = np.where(rng.uniform(size=mesh.dim) < 0.7, rng.uniform(1.2, 2.0, mesh.dim), 1.0)
    return Mesh(size * (mesh.points / size) ** power, mesh.cells, dict(mesh.boundaries))


def _cut(mesh: Mesh) -> Mesh:
    """An L: without the quarter right above; its two new sides are ``notch``."""
    size = mesh.points.max(axis=0)
    away = (mesh.points[mesh.cells].mean(axis=1) > 0.5 * size).all(axis=1)
    used, cells = np.unique(mesh.cells[~away], return_inverse=True)
    bare = Mesh(mesh.points[used], cells.reshape(-1, 3))
    outer = bare.boundary_facets
    middle = bare.points[outer].mean(axis=1) / size
    named = {
        "left": outer[middle[:, 0] < 1e-9],
        "right": outer[middle[:, 0] > 1 - 1e-9],
        "bottom": outer[middle[:, 1] < 1e-9],
        "top": outer[middle[:, 1] > 1 - 1e-9],
        "notch": outer[((middle > 1e-9) & (middle < 1 - 1e-9)).all(axis=1)],
    }
    return Mesh(bare.points, bare.cells, named)


def _locally_refined(mesh: Mesh, rng: np.random.Generator) -> Mesh:
    for _ in range(2):
        mesh = mesh.refined_where(rng.uniform(size=mesh.number_of_cells) < 0.15)
    return Mesh(mesh.points, mesh.cells, dict(mesh.boundaries))


def _sheared(mesh: Mesh, rng: np.random.Generator) -> Mesh:
    matrix = np.eye(mesh.dim)
    matrix[0, 1] = rng.uniform(-0.5, 0.5)
    return Mesh(mesh.points @ matrix.T, mesh.cells, dict(mesh.boundaries))


_CHANGES: dict[str, Callable[[Mesh, np.random.Generator], Mesh]] = {
    "plain": lambda mesh, rng: mesh,
    "shaken": _shaken,
    "graded": _graded,
    "refined in places": _locally_refined,
    "sheared": _sheared,
}


def _mesh(rng: np.random.Generator, dim: int) -> tuple[Mesh, str]:
    words = str(rng.choice(list(_CHANGES)))
    if dim == 3:
        words = words if words in ("plain", "sheared", "graded") else "plain"
        cells = tuple(int(n) for n in rng.integers(2, 4, 3))
        return _CHANGES[words](box(tuple(rng.uniform(0.7, 1.5, 3)), cells), rng), f"box, {words}"
    pattern = str(rng.choice(["cross", "left", "right"]))
    size = (float(rng.uniform(0.7, 2.0)), float(rng.uniform(0.7, 1.5)))
    if rng.uniform() < 0.2:
        mesh = _cut(rectangle(size, (4, 4), pattern=pattern))  # type: ignore[arg-type]
        words = "shaken" if words == "shaken" else "plain"
        return _CHANGES[words](mesh, rng), f"L, {pattern}, {words}"
    cells = (int(rng.integers(3, 8)), int(rng.integers(3, 7)))
    mesh = rectangle(size, cells, pattern=pattern)  # type: ignore[arg-type]
    return _CHANGES[words](mesh, rng), f"rectangle, {pattern}, {words}"


# ---- materials and supports ----------------------------------------------------------------------------------------


def _isotropic(rng: np.random.Generator, E: float) -> tuple[hv.Material, str]:
    kind = rng.integers(0, 4)
    if kind == 0:
        return hv.Material.lame(*(E * rng.uniform(1.0, 6.0, 2))), "Lame"
    modulus = E * float(rng.uniform(2.0, 8.0))
    if kind == 1:
        return hv.Material.young(modulus, float(rng.choice([0.45, 0.49, 0.499]))), "nearly incompressible"
    return hv.Material.young(modulus, float(rng.uniform(0.0, 0.4))), "Young"


def _material(rng: np.random.Generator, mesh: Mesh, E: float) -> tuple[hv.Material, Mesh, str]:
    kind = rng.uniform()
    if kind < 0.25:
        root = rng.normal(size=(3, 3) if mesh.dim == 2 else (6, 6))
        return hv.Material.tensor(E * (3.0 * np.eye(len(root)) + root @ root.T)), mesh, "anisotropic"
    if kind < 0.5:
        height = mesh.points[mesh.cells].mean(axis=1)[:, rng.integers(0, mesh.dim)]
        below = np.flatnonzero(height < np.median(height))
        above = np.setdiff1d(np.arange(mesh.number_of_cells), below)
        mesh = Mesh(mesh.points, mesh.cells, dict(mesh.boundaries), {"soft": below, "stiff": above})
        contrast = 10.0 ** rng.uniform(0.5, 2.5)
        parts = {"soft": E, "stiff": E * contrast}
        material = hv.Material.by_region({name: hv.Material.lame(3.0 * m, 2.0 * m) for name, m in parts.items()})
        return material, mesh, f"two materials, 1 to {contrast:.0f}"
    found, words = _isotropic(rng, E)
    return found, mesh, words


def _supports(rng: np.random.Generator, dim: int, length: float) -> tuple[dict[str, Any], str]:
    """Supports that hold the body, in its own directions; ``left`` and ``top`` of it."""
    kind = int(rng.integers(0, 5))
    if kind == 0:
        return {"top": hv.Prescribed(tuple(length * rng.uniform(-0.06, 0.02, dim)))}, "top moved"
    if kind == 1 and dim == 2:
        return {"left": hv.Roller(), "top": hv.Roller()}, "rollers"
    if kind == 1:
        return {"left": hv.Roller(), "top": hv.Roller(), "back": hv.Roller()}, "rollers"
    if kind == 2:
        return {"left": hv.Clamped(), "right": hv.Roller()}, "clamped and roller"
    return {"left": hv.Clamped()}, "clamped"


def _turn(rng: np.random.Generator, dim: int) -> Array:
    if rng.uniform() < 0.6:
        return np.eye(dim)
    q = np.linalg.qr(rng.normal(size=(dim, dim)))[0]
    return q * (1.0 if np.linalg.det(q) > 0.0 else np.array([-1.0] + [1.0] * (dim - 1)))


def random_body(seed: int, space: float = 0.2) -> Body:
    """A body, in space with a given probability."""
    rng = np.random.default_rng([seed, 1])
    dim = 3 if rng.uniform() < space else 2
    length, modulus = float(rng.choice([1.0, 1.0, 1e-3, 2e3])), float(rng.choice([1.0, 1.0, 1e5, 2e11]))
    mesh, shape = _mesh(rng, dim)
    material, mesh, made = _material(rng, mesh, modulus)
    supports, held = _supports(rng, dim, length)
    turn = _turn(rng, dim)
    mesh = Mesh(length * mesh.points @ turn.T, mesh.cells, dict(mesh.boundaries), dict(mesh.regions))
    touching = {"bottom": hv.Contact(hv.laws.NoContact())}
    if "right" not in supports and rng.uniform() < 0.2:
        touching["right"] = hv.Contact(hv.laws.NoContact())
    problem = hv.ContactProblem(mesh, material, touching, supports)
    units = "" if (length, modulus) == (1.0, 1.0) else f", units {length:g} and {modulus:g}"
    turned = "" if (turn == np.eye(dim)).all() else ", turned"
    return Body(problem, length, modulus, turn, f"{shape}, {made}, {held}{turned}{units}")


def softened(body: Body, seed: int) -> Body:
    """The same body of a material that softens as it changes shape (Hencky), in plane strain, plane stress or space."""
    rng = np.random.default_rng([seed, 3])
    bulk, shear = body.modulus * rng.uniform(1.0, 8.0), body.modulus * rng.uniform(0.5, 4.0)
    q, strain = rng.uniform(0.15, 1.0), 10.0 ** rng.uniform(-2.0, -0.5)
    plane = "stress" if body.problem.mesh.dim == 2 and rng.uniform() < 0.4 else "strain"
    material = hv.Material.hencky(bulk, shear, q, strain, plane)
    words = f"Hencky (q = {q:.2f}, strain {strain:.3g}, plane {plane}) in place of: {body.words}"
    return replace(body, problem=replace(body.problem, material=material), words=words)


# ---- laws and loads ------------------------------------------------------------------------------------------------


def _table(rng: np.random.Generator, p: float, L: float, soft: float) -> hv.laws.PiecewiseQuadratic:
    """Slopes that rise and fall, with jumps up, and down in places."""
    count = int(rng.integers(1, 5))
    knots = np.sort(rng.uniform(-0.03, 0.05, count)) * L + 1e-4 * L * np.arange(count)
    slopes = np.concatenate([[0.0], rng.uniform(-0.6, 1.0, count)])
    slopes = np.where(slopes < 0.0, slopes * soft, slopes * 10.0 * p / L)
    slopes[-1] = abs(slopes[-1])
    jumps = rng.uniform(0.0, 0.1, count) * p * (rng.uniform(size=count) < 0.4)
    jumps *= np.where(rng.uniform(size=count) < 0.3, -0.2, 1.0)
    return hv.laws.PiecewiseQuadratic(
        knots[None], slopes[None], jumps[None], start=-float(min(jumps.min(), 0.0)) * count
    )


def _normal(rng: np.random.Generator, p: float, L: float, soft: float) -> tuple[hv.laws.Superpotential, str]:
    """A law of the penetration: ``p`` a pressure, ``L`` a length, ``soft`` the softening that the body nearly bears."""
    kind = int(rng.integers(0, 11))
    u = rng.uniform
    if kind == 0:
        return hv.laws.ThresholdCompliance(0.1 * p * u(0.1, 4.0), p / L * u(0.0, 5.0)), "survey"
    if kind == 1:
        return hv.Softening(p / L * u(1.0, 10.0), 0.03 * L * u(0.2, 2.0), soft * u(0.05, 0.8)), "softening"
    if kind == 2:
        return hv.Signorini(), "signorini"
    if kind == 3:
        return hv.Compliance(p / L * u(1.0, 20.0)), "compliance"
    if kind == 4:
        return hv.Compliance(p / L**2 * u(20.0, 200.0), 2.0), "compliance of degree 2"
    if kind == 5:
        return hv.laws.FinitePenetration(p / L * u(1.0, 10.0), 0.03 * L), "finite penetration"
    if kind == 6:
        stiffness = p / L * u(1.0, 5.0)
        return hv.Adhesive(stiffness, stiffness * L * 0.01 * u(0.3, 3.0), soft * u(0.05, 0.7)), "adhesive"
    if kind == 7:
        return hv.laws.Bilateral(), "bilateral"
    if kind == 8:
        return hv.laws.Capped(
            p / L * u(1.0, 8.0), 0.03 * L * u(0.3, 2.0), 0.02 * p * u(0.5, 1.0)
        ), "capped (a downward jump)"
    return _table(rng, p, L, soft), "table"


def _friction(rng: np.random.Generator, p: float, L: float, soft: float) -> tuple[hv.laws.Friction, str]:
    kind = int(rng.integers(0, 8))
    u = rng.uniform
    bound = p * 0.1 * u(0.1, 3.0)
    if kind <= 1:
        return hv.laws.NoFriction(), "none"
    if kind <= 3:
        return hv.Tresca(bound), "tresca"
    if kind == 4:
        weak = min(bound, soft * u(0.05, 0.6) * L / (0.3 * 50.0))
        return hv.SlipWeakening(weak, 1.0, 0.7, 50.0 / L), "slip weakening"
    if kind == 5:
        return hv.laws.SlipTable(
            soft * u(0.05, 0.6) * 0.01 * L, (0.0, 0.01 * L, 0.04 * L), (1.0, 0.5, 0.4)
        ), "slip table"
    if kind == 6:
        return hv.Tresca(PenetrationBound(([0.0, 0.05 * L], [0.0, soft * u(0.1, 0.5) * 0.05 * L]))), "by penetration"
    return hv.laws.Logarithmic(min(bound, soft * u(0.05, 0.6) * L), 1.0 / L), "logarithmic"


def _varying(function: str, slope: Array, shift: float, vector: Array) -> FormulaArray:
    """A vector times a function of a linear one, as formulas."""
    inner = " + ".join(f"{float(a)!r}*{name}" for a, name in zip(slope, "xyz", strict=False))
    entries = tuple(Formula(f"{float(v)!r}*{function}({inner} + {shift!r})") for v in vector)
    return FormulaArray(entries, (len(vector),))


def _loads(rng: np.random.Generator, body: Body) -> tuple[dict[str, Any], str]:
    """Loads that press onto the foundation, and along it."""
    dim, turn = body.problem.mesh.dim, body.turn
    p, L = body.modulus, body.length
    size = 10.0 ** rng.uniform(-1.5, 0.0)
    own = rng.uniform(-1.0, 1.0, dim)
    own[1] = -abs(own[1])
    force = turn @ own * size * 0.5 * p / L
    found: dict[str, Any] = {"body_force": tuple(force)}
    words = "constant"
    if rng.uniform() < 0.12:
        wave = rng.uniform(-3.0, 3.0, dim) / L
        found["body_force"] = _varying("sin", wave, 1.0, force)
        words = "varying"
    free = [name for name in ("top", "right", "notch") if name in body.problem.mesh.boundaries]
    free = [name for name in free if name not in body.problem.supports and name not in body.problem.contact]
    for name in free:
        if rng.uniform() > 0.5:
            continue
        value = turn @ rng.uniform(-1.0, 1.0, dim) * size * 0.3 * p
        if rng.uniform() < 0.1:
            slope = rng.uniform(-1.0, 1.0, dim) / L
            found.setdefault("tractions", {})[name] = _varying("exp", slope, 0.0, value)
            words += f", varying on {name}"
        elif rng.uniform() < 0.3:
            found.setdefault("tractions", {})[name] = hv.Pressure(float(size * 0.3 * p * rng.uniform(-0.5, 1.0)))
            words += f", pressure on {name}"
        else:
            found.setdefault("tractions", {})[name] = tuple(value)
            words += f", on {name}"
    return found, words


def random_statement(body: Body, seed: int, trace: float) -> tuple[hv.ContactProblem, str]:
    """Laws, gaps and loads on a body whose trace constant is ``trace`` (modulus per length)."""
    rng = np.random.default_rng([seed, 2])
    contact, said = {}, []
    for name in body.problem.contact:
        normal, first = _normal(rng, body.modulus, body.length, trace)
        friction, second = _friction(rng, body.modulus, body.length, trace)
        rigid = bool(np.isfinite([*np.ravel(normal.domain.lower), *np.ravel(normal.domain.upper)]).any())
        gap = float(rng.choice([0.0, 0.0, 0.01, -0.005])) * body.length
        if rigid and (gap < 0.0 or isinstance(normal, hv.laws.Bilateral)):
            gap = 0.0  # supports would hold the body where the law forbids it
        contact[name] = hv.Contact(normal, friction, gap=gap)
        said.append(f"{name}: {first}, {second}" + (f", gap {gap:g}" if gap else ""))
    loads, words = _loads(rng, body)
    return replace(body.problem, contact=contact, **loads), f"{'; '.join(said)}; loads {words}"
