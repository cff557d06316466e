"""What moves in a march: a body of a problem file and its schemes, set up by code of our own."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from tests.robustness.elasticity import Body, isotropic, load_of_body, load_of_facets, mass, stiffness
from tests.robustness.expression import UnknownError, parse, value
from tests.robustness.graphs import normal_graph, slip_graph
from tests.robustness.pieces import Friction, Line, lines_of, mirrored

__all__ = ["Motion", "Stage", "State", "combined", "stages"]


@dataclass(frozen=True)
class Stage:
    """``v* = rate . (u* - u_n, v, w)`` and so on; ``u_{n+1} - u_n = reach (u* - u_n)``."""

    at: float
    rate: tuple[float, float, float]
    acceleration: tuple[float, float, float]
    reach: float
    velocity: tuple[float, float, float]
    last: tuple[float, float, float]


def stages(scheme: Mapping[str, Any], tau: float, massive: bool) -> list[Stage]:
    """The schemes of the textbooks."""
    name = scheme["name"]
    if name == "implicit-euler":
        v, w = (1.0 / tau, 0.0, 0.0), (1.0 / tau**2, -1.0 / tau, 0.0)
        return [Stage(1.0, v, w, 1.0, v, w)]
    if name == "midpoint":
        v, w = (2.0 / tau, 0.0, 0.0), (4.0 / tau**2, -2.0 / tau, 0.0)
        end = (2.0 / tau, -1.0, 0.0), (2.0 / tau**2, -2.0 / tau, 0.0)
        return [Stage(0.5, v, w, 2.0, *end)]
    if name == "sdirk2" and not massive:
        g = 1.0 - math.sqrt(0.5)
        none = (0.0, 0.0, 0.0)
        first, second = (1.0 / (g * tau), 0.0, 0.0), (1.0 / (g * tau), -(1.0 - g) / g, 0.0)
        return [Stage(g, first, none, 1.0 / g, first, none), Stage(1.0, second, none, 1.0, second, none)]
    if name not in ("newmark", "generalized-alpha"):
        raise UnknownError(f"scheme {name}")
    if name == "newmark":
        beta, gamma, am, af = float(scheme.get("beta", 0.25)), float(scheme.get("gamma", 0.5)), 0.0, 0.0
    else:
        rho = float(scheme.get("rho", 0.8))
        am, af = (2.0 * rho - 1.0) / (rho + 1.0), rho / (rho + 1.0)
        gamma, beta = 0.5 - am + af, 0.25 * (1.0 - am + af) ** 2
    # of the difference u_{n+1} - u_n
    v = np.array([gamma / (beta * tau), 1.0 - gamma / beta, tau * (1.0 - 0.5 * gamma / beta)])
    w = np.array([1.0 / (beta * tau**2), -1.0 / (beta * tau), 1.0 - 0.5 / beta])
    reach = 1.0 / (1.0 - af)
    of_stage = np.array([reach, 1.0, 1.0])
    rate = ((1.0 - af) * v + af * np.array([0.0, 1.0, 0.0])) * of_stage
    acceleration = ((1.0 - am) * w + am * np.array([0.0, 0.0, 1.0])) * of_stage
    return [Stage(1.0 - af, tuple(rate), tuple(acceleration), reach, tuple(v), tuple(w))]


def combined(factors: tuple[float, float, float], difference: Any, velocity: Any, acceleration: Any) -> Any:
    return factors[0] * difference + factors[1] * velocity + factors[2] * acceleration


@dataclass(frozen=True)
class State:
    """Place, velocity, acceleration and strains of branches (n,) each, and the largest openings (m,)."""

    time: float
    u: np.ndarray
    v: np.ndarray
    w: np.ndarray
    branches: tuple[np.ndarray, ...]
    opening: np.ndarray


class Motion:
    """A body of a problem file, and what acts on it."""

    def __init__(self, folder: Path, data: Mapping[str, Any], body: Body) -> None:
        self.folder, self.data, self.body = folder, data, body
        self.time = data["time"]
        material = data["material"]
        self.plane = material.get("plane", "strain")
        self.K = self._elastic(material)
        self.inert = bool(self.time.get("inertia", False))
        count = self.K.shape[0]
        self.M = float(material.get("density", 0.0)) * mass(body).toarray() if self.inert else np.zeros((count, count))
        viscosity = material.get("viscosity")
        self.C = np.zeros((count, count)) if viscosity is None else self._elastic({"lame": viscosity})
        self.branches = [(self._elastic(one), float(one["time"])) for one in material.get("branches", [])]
        self.yields_at_once = not self.inert and not self.C.any()
        self._hold()
        self._touch()

    def _elastic(self, given: Mapping[str, Any]) -> np.ndarray:
        if "lame" in given:
            lam, mu = map(float, given["lame"])
        else:
            young, poisson = float(given["young"]), float(given["poisson"])
            mu = young / (2.0 * (1.0 + poisson))
            lam = 2.0 * mu * poisson / (1.0 - 2.0 * poisson)
        C = isotropic(lam, mu, 2, self.plane)
        cells = len(self.body.cells)
        return np.asarray(stiffness(self.body, lambda _: np.broadcast_to(C, (cells, 3, 3)), 2).toarray())

    def side(self, name: str) -> np.ndarray:
        """Nodes of a side of the rectangle, (k,)."""
        axis, far = {"left": (0, False), "right": (0, True), "bottom": (1, False), "top": (1, True)}[name]
        x = self.body.nodes[:, axis]
        end = x.max() if far else x.min()
        return np.flatnonzero(np.abs(x - end) <= 1e-9 * np.ptp(x))

    def facets(self, name: str) -> np.ndarray:
        """Facets of a side, with the nodes in their middles for order 2, (k, 2 or 3)."""
        on = np.isin(self.body.cells, self.side(name))
        found = []
        for cell, here in zip(self.body.cells, on, strict=True):
            for place, (a, b) in enumerate([(0, 1), (1, 2), (0, 2)]):
                if here[a] and here[b]:
                    found.append([cell[a], cell[b], *([cell[3 + place]] if self.body.order == 2 else [])])
        return np.array(found)

    def number(self, given: Any, t: float, x: np.ndarray | None = None) -> float:
        if not isinstance(given, str):
            return float(given)
        at = {} if x is None else dict(zip("xy", map(float, x), strict=True))
        return float(value(parse(given), {"t": t, **at}))

    def _hold(self) -> None:
        self.held: dict[int, Any] = {}
        for name, how in self.data.get("supports", {}).items():
            axis = 0 if name in ("left", "right") else 1
            for node in self.side(name):
                if how == "clamped":
                    self.held |= {2 * node: 0.0, 2 * node + 1: 0.0}
                elif how == "roller":
                    self.held[2 * node + axis] = 0.0
                else:
                    self.held |= {2 * node + k: part for k, part in enumerate(how["displacement"])}
        self.free = np.setdiff1d(np.arange(self.K.shape[0]), list(self.held))

    def prescribed(self, t: float) -> np.ndarray:
        """Displacements of supports (n,), 0 where the body is free."""
        found = np.zeros(self.K.shape[0])
        for place, given in self.held.items():
            found[place] = self.number(given, t)
        return found

    def _touch(self) -> None:
        """Contact points on the bottom: nodes, weights, and what they obey."""
        ((name, self.law),) = self.data["contact"].items()
        if name != "bottom":
            raise UnknownError(f"contact on {name}")
        weights = np.zeros(len(self.body.nodes))
        for facet in self.facets("bottom"):
            size = float(np.ptp(self.body.nodes[facet[:2], 0]))
            share = [0.5, 0.5] if len(facet) == 2 else [1.0 / 6.0, 1.0 / 6.0, 2.0 / 3.0]
            weights[facet] += size * np.array(share)
        nodes = [int(n) for n in self.side("bottom") if weights[n] and not {2 * n, 2 * n + 1} <= set(self.held)]
        if any(2 * n + 1 in self.held for n in nodes):
            raise UnknownError("a support that holds the normal direction of contact")
        self.nodes, self.weights = np.array(nodes), weights[nodes]
        self.B = np.zeros((2 * len(nodes), self.K.shape[0]))
        for row, node in enumerate(nodes):
            self.B[2 * row, 2 * node + 1] = -1.0  # the outward normal is (0, -1)
            self.B[2 * row + 1, 2 * node] = 1.0
        self.slides = np.array([2 * n not in self.held for n in nodes])
        where = self.body.nodes[self.nodes]
        graphs = [normal_graph(self.law["normal"], lambda p, x=x: self.number(p, 0.0, x), self.folder) for x in where]
        self.normal = [lines_of(graph) for graph in graphs]
        self.damping = float(self.law.get("damping", {}).get("stiffness", 0.0))
        glued = isinstance(self.law["normal"], dict) and self.law["normal"].get("law") == "adhesive"
        memory = self.law.get("memory", [{"kind": "secant"}] if glued else [])
        self.secant = memory == [{"kind": "secant"}]
        if memory and not self.secant:
            raise UnknownError("memory")

    def gap(self, t: float) -> np.ndarray:
        """Gaps in the place of penetrations, 0 in that of slips, (2 m,)."""
        found = np.zeros(2 * len(self.nodes))
        found[::2] = [self.number(self.law.get("gap", 0.0), t, self.body.nodes[n]) for n in self.nodes]
        return found

    def load(self, t: float) -> np.ndarray:
        given = self.data.get("loads", {})

        def force(parts: Any) -> Callable[..., np.ndarray]:
            return lambda x, *_: np.array([self.number(part, t, x) for part in parts])

        total = np.zeros(self.K.shape[0])
        if "body" in given:
            at = force(given["body"])
            total += load_of_body(self.body, at)
        for name, parts in given.get("traction", {}).items():
            facets = self.facets(name)
            ends = self.body.nodes[facets[:, :2]]
            total += load_of_facets(self.body, facets, np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1), force(parts))
        return total

    # -- laws of a stage

    def friction(self, point: int, rate: float) -> Friction | None:
        """That of a slip ``s`` whose rate is ``rate s``; None where a support holds it."""
        if not self.slides[point]:
            return None
        law = self.law.get("friction", "none")
        law = {"law": law} if isinstance(law, str) else law
        if law["law"] == "none":
            return Friction([Line(-math.inf, math.inf, 0.0, 0.0)])
        pressed = law["law"] in ("coulomb", "exponential-decay")
        bound = {"coulomb": law.get("coefficient", 1.0)} if pressed else law.get("bound", 1.0)
        plain = law["law"] in ("tresca", "coulomb")
        if isinstance(bound, dict):
            if not plain:
                raise UnknownError("friction whose bound and size both vary")
            ((kind, size),) = bound.items()
            if kind == "coulomb":
                return Friction(None, pressure=float(size))
            found = re.fullmatch(r"([0-9.e+-]+)\*s", str(size))
            if kind != "formula" or found is None:
                raise UnknownError(f"a friction bound {bound}")
            return Friction(None, penetration=float(found[1]))
        x = self.body.nodes[self.nodes[point]]
        size = self.number(bound, 0.0, x)
        lines = lines_of(slip_graph(law, lambda p: self.number(p, 0.0, x), self.folder))
        slopes = [None if line.slope is None else size * line.slope * rate for line in lines]
        scaled = [
            Line(line.low / rate, size * line.high, size * line.base) if slope is None
            else Line(line.low / rate, line.high / rate, size * line.base, slope)
            for line, slope in zip(lines, slopes, strict=True)
        ]  # fmt: skip
        return Friction(mirrored(scaled))

    def glue(self, point: int, opening: float) -> list[Line]:
        """The normal law of a point, along the secant up to the largest opening so far."""
        lines = self.normal[point]
        if not self.secant or opening <= 0.0:
            return lines
        (at,) = [line for line in lines if line.slope is not None and line.low < -opening <= line.high]
        force = at.base - at.slope * opening
        rest = [line for line in lines if line.low >= 0.0]
        beyond = [replace(line, high=min(line.high, -opening)) if line.slope is not None else line
                  for line in lines if line.low < -opening]  # fmt: skip
        return [*beyond, Line(-opening, 0.0, 0.0, -force / opening), *rest]
