"""The physics of one answer: everything is built again from the problem file and held against what the files say."""

from __future__ import annotations

import contextlib
import io
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from tests.robustness.elasticity import Body, isotropic, load_of_body, load_of_facets, stiffness
from tests.robustness.expression import UnknownError, parse, value
from tests.robustness.graphs import Graph, SenselessError, normal_graph, read_table, slip_graph
from tests.robustness.msh import MshMesh, read_msh
from tests.robustness.obstacles import signed_distance, way_along

__all__ = ["Physics", "Verdict", "read_vtu"]

_EPS = float(np.finfo(float).eps)
#: Bounds of relative errors are multiplied by this before they are complained about.
_SLACK = 5.0
_SIDES = {2: ("left", "right", "bottom", "top"), 3: ("left", "right", "front", "back", "bottom", "top")}


@dataclass
class Verdict:
    """What the examination found.

    Attributes
    ----------
    wrong : list of str
        What is wrong with the answer.
    examined : list of str
        What has been looked at.
    left_out : list of str
        What could not be, and why.
    """

    wrong: list[str] = field(default_factory=list)
    examined: list[str] = field(default_factory=list)
    left_out: list[str] = field(default_factory=list)

    def demand(self, holds: Any, message: str) -> None:
        """Note what is wrong unless it holds; a nan does not hold."""
        if not bool(holds):
            self.wrong.append(message)


class Physics:
    """The examination of one answer."""

    def __init__(
        self,
        folder: Path,
        data: dict[str, Any],
        record: Mapping[str, Any],
        fields: str,
        rtol: float,
        verdict: Verdict,
        together: bool,
    ) -> None:
        self.folder, self.data, self.record, self.verdict = folder, data, record, verdict
        self.rtol = rtol
        verdict.demand(rtol < 1.0, f"a tolerance of {rtol:g} was accepted")
        self.body, shown = read_vtu(folder / fields)
        if self.body.nodes.size > 60_000:
            raise UnknownError("the mesh is large")
        self.dim = self.body.dim
        self.u = np.array(record["displacement"], dtype=float)
        if self.u.shape != self.body.nodes.shape:
            raise SenselessError(f"a displacement of shape {self.u.shape} on {self.body.nodes.shape} nodes")
        if together and shown is not None:
            close = np.abs(shown - self.u).max() <= 1e-9 * np.abs(self.u).max() + 1e-300
            verdict.demand(close, "the VTU file holds another displacement than the JSON file")
        self.size = float(np.ptp(self.body.nodes, axis=0).max())
        self.reference: MshMesh | None = None
        self.sides: dict[str, np.ndarray] = {}
        self.looked_at: set[int] = set()  # contacts whose obstacle has been looked at
        self._outer = self._outer_facets()

    # -- values

    def number(self, given: Any, x: np.ndarray) -> float:
        """A number, or a formula at a place."""
        if isinstance(given, str):
            return value(parse(given), dict(zip("xyz", map(float, x), strict=False)))
        if isinstance(given, bool) or not isinstance(given, int | float):
            raise SenselessError(f"{given!r} stands for a number")
        return float(given)

    def numbers(self, given: Any, x: np.ndarray) -> np.ndarray:
        if not isinstance(given, list) or len(given) != self.dim:
            raise SenselessError(f"{given!r} stands for a vector")
        return np.array([self.number(one, x) for one in given])

    # -- geometry

    def _outer_facets(self) -> np.ndarray:
        """Facets of the outer boundary, with the nodes on their edges for order 2; (k, nodes)."""
        d, cells = self.dim, self.body.cells
        edges = {
            2: {(0, 1): 3, (1, 2): 4, (0, 2): 5},
            3: {(0, 1): 4, (1, 2): 5, (0, 2): 6, (0, 3): 7, (1, 3): 8, (2, 3): 9},
        }
        local = [[j for j in range(d + 1) if j != i] for i in range(d + 1)]
        facets, inner = [], []
        for number, chosen in enumerate(local):
            columns = list(chosen)
            if self.body.order == 2:
                pairs = [(0, 1)] if d == 2 else [(0, 1), (1, 2), (0, 2)]
                columns += [edges[d][tuple(sorted((chosen[a], chosen[b])))] for a, b in pairs]
            facets.append(cells[:, columns])
            inner.append(cells[:, number])
        every, opposite = np.concatenate(facets), np.concatenate(inner)
        _, first, counts = np.unique(np.sort(every[:, :d], axis=1), axis=0, return_index=True, return_counts=True)
        chosen_rows = first[counts == 1]
        self._behind = opposite[chosen_rows]
        return np.asarray(every[chosen_rows])

    def normals(self, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Outward unit normals and measures of outer facets."""
        corner = self.body.nodes[self._outer[rows][:, : self.dim]]
        first = corner[:, 1] - corner[:, 0]
        if self.dim == 2:
            normal, factor = np.column_stack([first[:, 1], -first[:, 0]]), 1.0
        else:
            normal, factor = np.cross(first, corner[:, 2] - corner[:, 0]), 0.5
        size = np.linalg.norm(normal, axis=1)
        normal = normal / size[:, None]
        inward = np.einsum("kd,kd->k", normal, self.body.nodes[self._behind[rows]] - corner[:, 0]) > 0.0
        normal[inward] *= -1.0
        return normal, factor * size

    def place_boundaries(self) -> None:
        """Named boundaries as numbers of outer facets, and the extent of the mesh, from the problem file alone."""
        mesh = self.data.get("mesh", {})
        d = self.dim
        middles = self.body.nodes[self._outer[:, :d]].mean(axis=1)
        scale = float(mesh.get("scale", 1.0))
        if "file" in mesh:
            self._place_groups(mesh, scale, middles)
            return
        size = np.array(mesh["box" if d == 3 else "rectangle"], dtype=float) * scale
        origin = np.array(mesh.get("origin", [0.0] * d), dtype=float) * scale
        near = 1e-9 * np.maximum(size, np.abs(origin))
        low, high = self.body.nodes.min(axis=0), self.body.nodes.max(axis=0)
        self.verdict.demand(
            (np.abs(low - origin) <= near).all() and (np.abs(high - origin - size) <= near).all(),
            f"the mesh reaches from {low} to {high}, not from {origin} to {origin + size}",
        )
        volume = float(self.body.volumes.sum())
        self.verdict.demand(abs(volume / size.prod() - 1.0) < 1e-9, f"the mesh covers {volume:g}, not {size.prod():g}")
        counts = mesh["cells"] if isinstance(mesh["cells"], list) else [mesh["cells"]] * d
        pieces = 6 if d == 3 else 4 if mesh.get("pattern") == "cross" else 2
        expected = pieces * math.prod(map(int, counts)) * 2 ** (d * int(mesh.get("refine", 0)))
        self.verdict.demand(len(self.body.cells) == expected, f"{len(self.body.cells)} cells, not {expected}")
        for name in _SIDES[d]:
            axis = {"left": 0, "right": 0, "front": 1, "back": 1, "bottom": d - 1, "top": d - 1}[name]
            end = origin[axis] + (size[axis] if name in ("right", "back", "top") else 0.0)
            self.sides[name] = np.flatnonzero(np.abs(middles[:, axis] - end) <= near[axis])
        self.verdict.examined.append("mesh")

    def _place_groups(self, mesh: Mapping[str, Any], scale: float, middles: np.ndarray) -> None:
        """Boundaries and regions from a Gmsh file, read by code of our own."""
        path = self.folder / mesh["file"]
        known = path.with_name("reference.msh")
        if known.exists():
            path = known
        if path.suffix != ".msh" or mesh.get("refine", 0):
            raise UnknownError("a mesh that is not read here")
        try:
            stated = read_msh(path.read_bytes())
        except NotImplementedError:
            raise UnknownError("a binary mesh that is not read here") from None
        d = self.dim
        if stated.dim != d:
            raise SenselessError(f"a mesh of dimension {stated.dim} was taken for one of {d}")
        self.reference = stated
        places = {n: scale * np.array(x) for n, x in stated.nodes.items()}
        near = 1e-9 * float(np.abs(self.body.nodes).max())
        cells = {tuple(sorted(e[3])) for e in stated.elements if e[0] == d}
        middle = np.array([np.mean([places[n] for n in cell], axis=0)[:d] for cell in cells])
        mine = self.body.corners.mean(axis=1)
        same = len(middle) == len(mine) and _matches(middle, mine, near)
        self.verdict.demand(same, f"the mesh has {len(mine)} cells, the file {len(middle)}, or they lie elsewhere")
        if stated.dim == 2:
            heights = [places[n][2] for cell in cells for n in cell]
            self.verdict.demand(np.ptp(heights) <= 1e-6 * self.size, "a mesh that is not plane was taken for one")
        used = set(self.data.get("supports", {})) | set(self.data.get("contact", {}))
        used |= set(self.data.get("loads", {}).get("traction", {})) | set(
            self.data.get("loads", {}).get("pressure", {})
        )
        for name in used:
            members = stated.group(d - 1, name)
            if not members:
                raise SenselessError(f"a boundary '{name}' that the mesh does not have was accepted")
            where = np.array([np.mean([places[n] for n in m], axis=0)[:d] for m in {tuple(sorted(m)) for m in members}])
            apart = np.abs(where[:, None] - middles[None]).max(axis=2)
            self.verdict.demand(apart.min(axis=1).max() <= near, f"facets of '{name}' that do not bound the body")
            self.sides[name] = np.unique(apart.argmin(axis=1))
        self.verdict.examined.append("mesh of the file")

    # -- the examination

    def examine(self) -> None:
        self.place_boundaries()
        d, body = self.dim, self.body
        K = stiffness(body, self.material, 0)
        F, doubt = self.loads()
        if _has_formula(self.data["material"]):
            # which rule is taken is not said anywhere: what depends on it is allowed for
            fine = stiffness(body, self.material, 3)
            doubt += 3.0 * float(np.linalg.norm((K - fine) @ self.u.ravel()))
        if not (np.isfinite(K.data).all() and np.isfinite(F).all() and K.diagonal().min() > 1e-290):
            raise UnknownError("forces or stiffnesses beyond what this arithmetic holds")
        held, prescribed = self.supports()
        contact = self.contact(held)
        force = np.zeros(body.nodes.shape)
        for nodes, shares, vector in contact:
            for node, share in zip(nodes, shares, strict=True):
                force[node] += share * vector
        C = force.ravel()
        u, u0 = self.u.ravel(), prescribed.ravel()
        rest = (K @ u + C - F).reshape(-1, d)
        pull = (F - K @ u0).reshape(-1, d)
        rigid = np.abs(rest.sum(axis=0) - (C - F).reshape(-1, d).sum(axis=0)).max()
        sizes = float((abs(K) @ np.abs(u)).sum())
        self.verdict.demand(rigid <= 1e-8 * sizes + 1e-300, "the reactions do not balance: the oracle errs")
        for node, directions in held.items():
            Q = np.array(directions)
            rest[node] -= Q.T @ (Q @ rest[node])
            pull[node] -= Q.T @ (Q @ pull[node])
        shown = np.array([vector for _, _, vector in contact]).reshape(-1, d)
        weight = np.array([sum(shares) for _, shares, _ in contact])
        contact_size = float(np.linalg.norm(C))
        scale = max(float(np.linalg.norm(pull)), contact_size)
        rounding = 200.0 * _EPS * float(np.linalg.norm(abs(K) @ (np.abs(u) + np.abs(u0))) + np.linalg.norm(F))
        allowed = _SLACK * self.rtol * scale + rounding + doubt
        size = float(np.linalg.norm(rest))
        self.verdict.demand(
            size <= allowed,
            f"out of balance by {size:.3g}, relative {size / scale if scale else math.inf:.2g}; allowed: {allowed:.3g}",
        )
        self.verdict.examined.append("balance")
        self._resultants(shown, weight)
        self._laws(K, allowed)

    def material(self, places: np.ndarray) -> np.ndarray:
        """Elasticity matrices at one place in each cell."""
        given = self.data["material"]
        owner = [given] * len(places)
        if "regions" not in given and not _has_formula(given):
            return np.repeat(self._matrix(given, places[0])[None], len(places), axis=0)
        if "regions" in given:
            centroids = self.body.corners.mean(axis=1)
            if self.reference is None:
                raise UnknownError("regions of a built-in mesh")
            nodes = self.reference.coordinates()
            scale = float(self.data["mesh"].get("scale", 1.0))
            owner = [{}] * len(places)
            for name, one in given["regions"].items():
                cells = self.reference.group(self.dim, name)
                if not cells:
                    raise SenselessError(f"a region '{name}' that the mesh does not have was accepted")
                for cell in cells:
                    middle = scale * np.mean([nodes[n] for n in cell], axis=0)[: self.dim]
                    owner[int(np.abs(centroids - middle).max(axis=1).argmin())] = one
            if not all(owner):
                raise SenselessError("cells without a material")
        return np.array([self._matrix(one, x) for one, x in zip(owner, places, strict=True)])

    def _matrix(self, given: Mapping[str, Any], x: np.ndarray) -> np.ndarray:
        d = self.dim
        if "tensor" in given:
            C = np.array([[self.number(c, x) for c in row] for row in given["tensor"]])
            if not np.allclose(C, C.T, rtol=1e-9) or np.linalg.eigvalsh(C).min() <= 0.0:
                raise SenselessError("an elasticity matrix that is not positive definite")
            return C
        plane = given.get("plane", "strain")
        if "lame" in given:
            lam, mu = (self.number(c, x) for c in given["lame"])
        else:
            E, nu = self.number(given["young"], x), self.number(given["poisson"], x)
            if not (E > 0.0 and -1.0 < nu < 0.5):
                raise SenselessError(f"young {E}, poisson {nu}")
            lam, mu = E * nu / ((1.0 + nu) * (1.0 - 2.0 * nu)), 0.5 * E / (1.0 + nu)
        if not (mu > 0.0 and 3.0 * lam + 2.0 * mu > 0.0) and not (d == 2 and plane == "strain" and mu > 0.0 < lam + mu):
            raise SenselessError(f"Lame's constants {lam}, {mu}")
        return isotropic(lam, mu, d, plane)

    def loads(self) -> tuple[np.ndarray, float]:
        """Load vector, and how far it depends on the rule of integration."""
        given = self.data.get("loads", {})
        F = np.zeros(self.body.nodes.size)
        doubt = 0.0

        def add(make: Any, formula: bool) -> None:
            nonlocal F, doubt
            fine = make(5)
            F = F + fine
            if formula:
                doubt += 3.0 * float(np.linalg.norm(make(2) - fine))

        if "body" in given:
            body = given["body"]
            formula = any(isinstance(c, str) for c in body) if isinstance(body, list) else False
            add(lambda n: load_of_body(self.body, lambda x: self.numbers(body, x), n), formula)
        for name, one in given.get("traction", {}).items():
            rows, formula = self.sides[name], any(isinstance(c, str) for c in one)
            measures = self.normals(rows)[1]
            facets = self._outer[rows]
            add(
                lambda n, facets=facets, measures=measures, one=one: load_of_facets(
                    self.body, facets, measures, lambda x, _: self.numbers(one, x), n
                ),
                formula,
            )
        for name, one in given.get("pressure", {}).items():
            if name in given.get("traction", {}):
                raise SenselessError("a traction and a pressure on one boundary")
            rows = self.sides[name]
            normals, measures = self.normals(rows)
            facets = self._outer[rows]
            add(
                lambda n, facets=facets, measures=measures, normals=normals, one=one: load_of_facets(
                    self.body, facets, measures, lambda x, i: -self.number(one, x) * normals[i], n
                ),
                isinstance(one, str),
            )
        return F, doubt

    def supports(self) -> tuple[dict[int, list[np.ndarray]], np.ndarray]:
        """Directions in which nodes are held, and the prescribed displacements."""
        held: dict[int, list[np.ndarray]] = {}
        u0 = np.zeros(self.u.shape)
        largest = 0.0
        wanted: list[tuple[int, np.ndarray, float, str]] = []
        for name, one in self.data.get("supports", {}).items():
            rows = self.sides[name]
            for node in np.unique(self._outer[rows]):
                x = self.body.nodes[node]
                if one == "clamped":
                    conditions = [(axis, 0.0) for axis in range(self.dim)]
                elif one == "roller":
                    normals = self.normals(rows)[0]
                    if np.abs(normals - normals[0]).max() > 1e-9:
                        raise UnknownError("a curved roller")
                    wanted.append((int(node), normals[0], 0.0, name))
                    continue
                elif "displacement" in one:
                    conditions = list(enumerate(self.numbers(one["displacement"], x)))
                else:
                    conditions = [("xyz".index(axis), self.number(v, x)) for axis, v in one.items()]
                wanted += [(int(node), np.eye(self.dim)[axis], float(v), name) for axis, v in conditions]
        for node, direction, amount, _ in wanted:
            largest = max(largest, abs(amount))
            rest = direction - sum((q * (q @ direction) for q in held.get(node, [])), np.zeros(self.dim))
            if np.linalg.norm(rest) > 1e-8:
                unit = rest / np.linalg.norm(rest)
                u0[node] += unit * (amount - direction @ u0[node]) / (unit @ direction)
                held.setdefault(node, []).append(unit)
        for node, direction, amount, name in wanted:
            missing = abs(direction @ self.u[node] - amount)
            near = 1e-7 * largest + 1e-9 * float(np.abs(self.u).max()) + 1e-300
            if missing > near:
                self.verdict.wrong.append(f"the support '{name}' is missed by {missing:.3g} at node {node}")
                break
        self.verdict.examined.append("supports")
        return held, u0

    def contact(self, held: Mapping[int, Any]) -> list[tuple[list[int], list[float], np.ndarray]]:
        """Forces of the contact points on the nodes; checks their places, normals, weights, gaps and displacements."""
        stated, given = self.data.get("contact", {}), self.record["contact"]
        d, verdict = self.dim, self.verdict
        places = np.array(given["x"] or [], dtype=float).reshape(-1, d)
        names = given["boundary"] or []
        count = len(places)
        normal = np.array(given["normal"] or [], dtype=float).reshape(-1, d)
        weight, gap = np.array(given["weight"], dtype=float), np.array(given["gap"], dtype=float)
        penetration, pressure = (np.array(given[key], dtype=float) for key in ("penetration", "pressure"))
        slip, friction = (
            np.zeros((count, 0)) if given[key] is None else np.array(given[key], dtype=float).reshape(count, d - 1)
            for key in ("slip", "friction")
        )
        midpoint = self.data["mesh"].get("quadrature") == "midpoint"
        self.points: list[dict[str, Any]] = []
        result = []
        near = 1e-9 * max(self.size, float(np.abs(self.body.nodes).max()))
        expected = self._expected_points(midpoint)
        if set(names) - set(stated):
            verdict.wrong.append(f"contact points on {set(names) - set(stated)}, which are none")
            return []
        shared = {n for e in expected.values() for n in e if sum(n in f for f in expected.values()) > 1}
        seen: set[tuple[str, int]] = set()
        worst_gap = worst_slip = worst_place = 0.0
        for i in range(count):
            own = expected[names[i]]
            where = np.array([e["x"] for e in own.values()])
            key = list(own)[int(np.abs(where - places[i]).max(axis=1).argmin())]
            seen.add((names[i], key))
            point = own[key]
            worst_place = max(worst_place, float(np.abs(point["x"] - places[i]).max()))
            one = stated[names[i]]
            corner = key in shared
            if not corner:
                verdict.demand(abs(weight[i] / point["weight"] - 1.0) < 1e-8, f"weight {weight[i]} at {places[i]}")
                own_normal, own_gap = self._foundation(one, point)
                if own_normal is not None:
                    wrong = float(np.abs(own_normal - normal[i]).max())
                    verdict.demand(wrong < 1e-6, f"normal {normal[i]} at {places[i]}, not {own_normal}")
            else:
                own_gap = None
            if corner and not midpoint:
                # at a sharp corner each boundary has a point; a smooth joint one, with the gap of the first
                alike = [e[key]["normal"] for e in expected.values() if key in e]
                corner = bool(alike[0] @ alike[1] < 0.75)
            moved = self.u[point["nodes"]].T @ np.array(point["shares"])
            if own_gap is not None:
                worst_gap = max(worst_gap, abs(float(normal[i] @ moved) - own_gap - penetration[i]))
            if d == 2:
                tangents = np.array([[-normal[i, 1], normal[i, 0]]])
            else:
                axis = np.eye(3)[np.argmin(np.abs(normal[i]))]
                first = np.cross(axis, normal[i])
                first[np.abs(first) < 1e-15] = 0.0
                first /= np.linalg.norm(first)
                tangents = np.array([first, np.cross(normal[i], first)])
            supported = any(n in held for n in point["nodes"])
            clear = not supported and not corner
            vector = pressure[i] * normal[i]
            if clear or d == 2:
                vector = vector - friction[i] @ tangents  # of the body on the foundation
            if clear:
                worst_slip = max(worst_slip, float(np.abs(tangents @ moved - slip[i]).max(initial=0.0)))
            if not clear and d == 3:
                # the tangents were turned to what the support leaves free, which the record does not tell
                for node in held.keys() & set(point["nodes"]):
                    held[node][:] = list(np.eye(3))
            result.append((point["nodes"], [weight[i] * s for s in point["shares"]], vector))
            self.points.append(
                {
                    "x": places[i], "law": one, "weight": weight[i], "normal": normal[i], "r": penetration[i],
                    "p": pressure[i], "s": slip[i], "t": friction[i], "clear": clear, "nodes": point["nodes"],
                    "shares": point["shares"], "gap": gap[i], "tangents": tangents,
                }
            )  # fmt: skip
        motion = float(np.abs(self.u).max(initial=0.0))
        reach = float(np.abs(gap).max(initial=0.0))
        error = 1e-8 * motion + 1e-7 * reach + 1e-8 * min(self.size, max(reach, motion)) + near * 1e-3
        verdict.demand(worst_place <= near, f"a contact point lies {worst_place:.2g} beside the boundary")
        verdict.demand(worst_gap <= error, f"penetration differs from u.n - gap by {worst_gap:.3g}")
        verdict.demand(worst_slip <= error, f"slip differs from the tangential displacement by {worst_slip:.3g}")
        for name, own in expected.items():
            for key, point in own.items():
                every = all(len(held.get(n, [])) == d for n in point["nodes"])
                off = self.data["contact"][name].get("obstacle") and self.data["contact"][name].get("normals") == "body"
                merged = key in shared
                if (name, key) not in seen and not every and not off and not merged:
                    verdict.wrong.append(f"there is no contact point at {point['x']} on '{name}'")
                    return result
        verdict.examined.append(f"{count} contact points")
        return result

    def _expected_points(self, midpoint: bool) -> dict[str, dict[int, dict[str, Any]]]:
        found: dict[str, dict[int, dict[str, Any]]] = {}
        d = self.dim
        for name in self.data.get("contact", {}):
            rows = self.sides[name]
            facets = self._outer[rows]
            normals, measures = self.normals(rows)
            share = np.full(d, 1.0 / d) if self.body.order == 1 else np.array([1.0, 1.0, 4.0]) / 6.0
            own: dict[int, dict[str, Any]] = {}
            for row, facet, normal, measure in zip(rows, facets, normals, measures, strict=True):
                if midpoint:
                    x = self.body.nodes[facet[:d]].mean(axis=0)
                    own[-1 - int(row)] = {
                        "x": x, "weight": measure, "normal": normal, "nodes": list(map(int, facet)),
                        "shares": list(share),
                    }  # fmt: skip
                    continue
                for node, part in zip(facet, share, strict=True):
                    empty = {
                        "x": self.body.nodes[node],
                        "weight": 0.0,
                        "normal": np.zeros(d),
                        "nodes": [int(node)],
                        "shares": [1.0],
                    }
                    point = own.setdefault(int(node), empty)
                    point["weight"] += part * measure
                    point["normal"] = point["normal"] + normal * measure
            for point in own.values():
                point["normal"] = point["normal"] / np.linalg.norm(point["normal"])
            found[name] = own
        return found

    def _foundation(self, one: Mapping[str, Any], point: Mapping[str, Any]) -> tuple[np.ndarray | None, float | None]:
        """Normal and gap at a contact point; None where they are not known here."""
        x, outward = point["x"], point["normal"]
        if "obstacle" not in one:
            return outward, self.number(one.get("gap", 0.0), x)
        distance = signed_distance(one["obstacle"])
        self._no_obstacle_inside(distance, one)
        if one.get("normals", "obstacle") == "body":
            return outward, way_along(distance, x, outward, self.size)
        step = 1e-5 * float(np.ptp(self.body.nodes, axis=0).min())
        slope = np.array([(distance(x + step * e) - distance(x - step * e)) / (2.0 * step) for e in np.eye(self.dim)])
        return -slope / np.linalg.norm(slope), distance(x)

    def _no_obstacle_inside(self, distance: Any, one: Mapping[str, Any]) -> None:
        """An obstacle that the body has in its inside, and not at the contact boundary, is none."""
        if id(one) in self.looked_at:
            return
        self.looked_at.add(id(one))
        outer = np.unique(self._outer)
        inner = np.setdiff1d(np.arange(len(self.body.nodes)), outer)
        bound = min((distance(x) for x in self.body.nodes[outer]), default=0.0)
        inside = min((distance(x) for x in self.body.nodes[inner]), default=0.0)
        self.verdict.demand(not (inside < -1e-9 * self.size and bound > 0.0), "the obstacle lies inside the body")

    def _resultants(self, vectors: np.ndarray, weight: np.ndarray) -> None:
        stated = self.record.get("resultants")
        if stated is None or not self.points:
            return
        pressure = np.array([p["p"] for p in self.points])
        total, size = float(weight @ pressure), float(weight @ np.abs(pressure))
        self.verdict.demand(
            abs(total - stated["normal_force"]) <= 1e-9 * size + 1e-300, "the normal force is another one"
        )
        if all(p["clear"] for p in self.points) and stated["force"] is not None:
            force = -(weight @ vectors)
            size = float(weight @ np.linalg.norm(vectors, axis=1))
            wrong = float(np.abs(force - np.array(stated["force"], dtype=float)).max())
            self.verdict.demand(
                wrong <= 1e-9 * size + 1e-300, f"the force of the foundation is another one, by {wrong:.3g}"
            )
        self.verdict.examined.append("resultants")

    def _laws(self, K: Any, allowed: float) -> None:
        """Every contact point lies on the graph of its law."""
        d = self.dim
        diagonal = K.diagonal().reshape(-1, d)
        motion = float(np.abs(self.u).max(initial=0.0))
        skipped = set()
        for point in self.points:
            weight = point["weight"]
            give = _SLACK * allowed / weight
            flexible = sum(s**2 / diagonal[n].min() for n, s in zip(point["nodes"], point["shares"], strict=True))
            shift = weight * flexible * give + 4.0 * _EPS * (motion + abs(point["gap"])) + 1e-14 * abs(point["r"])
            number = lambda given, x=point["x"]: self.number(given, x)  # noqa: E731
            law = point["law"]
            if not (math.isfinite(shift) and math.isfinite(give)):
                raise UnknownError("forces or displacements beyond what this arithmetic holds")
            try:
                graph = normal_graph(law["normal"], number, self.folder)
                if not self._fits(graph, point["r"], point["p"], shift, give):
                    low, high = graph.forces(point["r"] - shift, point["r"] + shift)
                    self.verdict.wrong.append(
                        f"pressure {point['p']:.6g} at penetration {point['r']:.6g}, x = {point['x']}: the law allows "
                        f"{low:.6g} to {high:.6g}"
                    )
                    return
            except UnknownError as error:
                skipped.add(f"normal law: {error}")
            try:
                if not self._friction(point, law.get("friction", "none"), number, shift, give):
                    return
            except UnknownError as error:
                skipped.add(f"friction law: {error}")
        self.verdict.left_out += sorted(skipped)
        if self.points:
            self.verdict.examined.append("laws")

    @staticmethod
    def _fits(graph: Graph, r: float, p: float, shift: float, give: float) -> bool:
        low, high = graph.forces(r - shift, r + shift)
        size = max((abs(x) for x in (low, high) if math.isfinite(x)), default=0.0)
        give += 1e-12 * size + 1e-13 * abs(p)
        if graph.potential is not None:
            give += 1e-5 * max(size, abs(p))
        return bool(low - give <= p <= high + give)

    def _friction(self, point: dict[str, Any], law: Any, number: Any, shift: float, give: float) -> bool:
        if isinstance(law, str):
            law = {"law": law}
        t, s = point["t"], point["s"]
        if not point["clear"] or not t.size:
            return True
        size, slid = float(np.linalg.norm(t)), float(np.linalg.norm(s))
        bounds = [self._bound(law, point, number, point["r"] + e, point["p"] + f) for e, f in
                  ((0.0, 0.0), (-shift, -give), (shift, give))]  # fmt: skip
        low_bound, high_bound = min(bounds), max(bounds)
        graph = slip_graph(law, number, self.folder)
        low, high = graph.forces(max(slid - shift, 0.0), slid + shift)
        if high < -1e-4 * max(abs(low), 1e-300) and high_bound > 0.0:
            raise SenselessError(f"negative friction, {high:.3g} at slip {slid:.3g}")
        if graph.potential is not None:
            give += 1e-5 * high * high_bound
        give += 1e-11 * high * high_bound
        if size > high * high_bound + give:
            self.verdict.wrong.append(
                f"friction {size:.6g} at slip {slid:.6g}, x = {point['x']}: the law allows {high * high_bound:.6g}"
            )
            return False
        if slid > 2.0 * shift + 1e-7 * float(np.abs(self.u).max()):
            along = -float(t @ s) / slid
            across = float(np.linalg.norm(t + along * s / slid))
            turned = high * high_bound * min(1.0, 2.0 * shift / slid)
            if along < low * low_bound - give - turned or across > give + turned:
                self.verdict.wrong.append(
                    f"friction {t} at slip {s}, x = {point['x']}: the law asks for {low * low_bound:.6g} against it"
                )
                return False
        return True

    def _bound(self, law: Mapping[str, Any], point: Mapping[str, Any], number: Any, r: float, p: float) -> float:
        """The friction bound in a state."""
        if law["law"] == "none":
            return 0.0
        if law["law"] in ("coulomb", "exponential-decay"):
            coefficient = number(law.get("coefficient", 1.0))
            if not coefficient >= 0.0:
                raise SenselessError(f"a coefficient of friction {coefficient}")
            return coefficient * max(p, 0.0)
        given = law.get("bound", 1.0)
        if not isinstance(given, dict):
            bound = number(given)
        elif "coulomb" in given:
            coefficient = number(given["coulomb"])
            if not coefficient >= 0.0:
                raise SenselessError(f"a coefficient of friction {coefficient}")
            return coefficient * max(p, 0.0)
        elif "formula" in given:
            bound = value(parse(str(given["formula"])), {"s": r})
            bound = max(bound, 0.0) if r < 0.0 or bound > -1e-9 else bound
        else:
            s, h = read_table(self.folder / given["table"], ("s", "bound"))
            if min(h) < 0.0:
                raise SenselessError("a negative friction bound")
            bound = float(np.interp(r, s, h))
        if not bound >= 0.0:
            raise SenselessError(f"a friction bound {bound}")
        return float(bound)


def _has_formula(given: Any) -> bool:
    """Whether there is a text in it that is no word of the format."""
    if isinstance(given, dict):
        return any(_has_formula(v) for k, v in given.items() if k != "plane")
    if isinstance(given, list):
        return any(map(_has_formula, given))
    return isinstance(given, str)


def _matches(first: np.ndarray, second: np.ndarray, near: float) -> bool:
    order = [np.lexsort(np.round(a / max(near * 100.0, 1e-300)).T) for a in (first, second)]
    if np.abs(first[order[0]] - second[order[1]]).max() <= near:
        return True
    apart = np.abs(first[:, None] - second[None]).max(axis=2)
    return bool(apart.min(axis=0).max() <= near and apart.min(axis=1).max() <= near)


def read_vtu(path: Path) -> tuple[Body, np.ndarray | None]:
    """Nodes, cells and displacement of a VTU file."""
    import meshio

    try:
        with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
            grid = meshio.read(path, file_format="vtu")
    except (Exception, SystemExit) as error:
        raise SenselessError(f"the VTU file cannot be read: {error}") from None
    block = grid.cells[0]
    dim = 2 if block.type.startswith("triangle") else 3
    shown = grid.point_data.get("displacement")
    nodes = np.asarray(grid.points, dtype=float)[:, :dim]
    return Body(nodes, np.asarray(block.data)), None if shown is None else np.asarray(shown, dtype=float)[:, :dim]
