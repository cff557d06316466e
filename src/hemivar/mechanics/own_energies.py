"""User-defined stored energies by formulas, of invariants or of components of the strain."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Unpack

import numpy as np

from hemivar.basics.arguments import one_of
from hemivar.basics.known_keywords import known_fields
from hemivar.basics.stated import Form, stated, stating
from hemivar.basics.types import Array, BoolArray
from hemivar.errors import ProblemError
from hemivar.formula.curvature import enclosed_range
from hemivar.formula.graph import Graph
from hemivar.formula.poles import pole_in_box, pole_words
from hemivar.formula.reader import Reader, shown
from hemivar.laws.named import LawKind, named
from hemivar.mechanics.energy_bounds import (
    FoundRange,
    component_derivatives,
    invariant_derivatives,
    once,
    strain_text,
)
from hemivar.mechanics.function_energy import REACH, ROUNDING, FunctionEnergy, RelativeEnergy, refuse_at_zero
from hemivar.mechanics.material_words import PLANE_OF_ENERGY, BoundsBy, PlaneState
from hemivar.mechanics.moduli import InTime
from hemivar.mechanics.per_volume import STRESS
from hemivar.mechanics.stored_energy import InvariantEnergy, Invariants, IsotropicBounds, StoredEnergy

__all__ = ["COMPONENTS", "INVARIANTS", "ComponentEnergy", "FormulaEnergy", "own_energy"]

#: Variables of formulas: invariants of the strain of space, or its components.
INVARIANTS = ("tr", "dev2")
COMPONENTS = ("exx", "eyy", "ezz", "eyz", "exz", "exy")

#: Which components a strain in the plane or in space has, in the order of the matrices.
_OF_DIM = {2: (0, 1, 5), 3: (0, 1, 2, 3, 4, 5)}


#: What formulas of a stored energy are stated by.
_TEXT = stated(
    Form.TEXT,
    "formula of the stored energy",
    key="energy",
    unit=STRESS,
    example="3.3*tr^2 + dev2 + 0.015*(sqrt(1 + 400*dev2) - 1)",
)


@named(
    LawKind.MATERIAL,
    "potential",
    "stored energy as a formula of tr and dev2 = |dev eps|^2, or of exx, eyy, ezz, eyz, exz, exy",
    "W(eps) = energy",
)
@stating(energy=_TEXT, reach=REACH, plane=PLANE_OF_ENERGY)  # type: ignore[arg-type]
def own_energy(
    energy: object,
    stress: object = None,
    tangent: object = None,
    *,
    reach: float,
    plane: PlaneState | str = PlaneState.STRAIN,
    **in_time: Unpack[InTime],
) -> StoredEnergy:
    """What :meth:`Material.potential` makes."""
    if isinstance(energy, str):
        if stress is not None or tangent is not None:
            raise ProblemError("stress and tangent are found from a formula of the energy; leave them out")
        graph, node = Reader(energy, "energy: ", (*INVARIANTS, *COMPONENTS)).graph()
        if graph.names(node) & set(COMPONENTS):
            if one_of(plane, "plane", PlaneState) is PlaneState.STRESS:
                raise ProblemError(
                    "plane stress is for energies of tr and dev2; write the energy by these, or take plane strain"
                )
            return ComponentEnergy(energy, reach, **in_time)  # type: ignore[arg-type]
        return FormulaEnergy(energy, reach, plane, **in_time)  # type: ignore[arg-type]
    if not (callable(energy) and callable(stress) and callable(tangent)):
        raise ProblemError(
            "give the energy as a formula in quotes, or three functions of the strain: energy, stress and tangent"
        )
    if one_of(plane, "plane", PlaneState) is PlaneState.STRESS:
        raise ProblemError("plane is for formulas; leave it out, for functions of strains in the plane have their own")
    return FunctionEnergy(energy, stress, tangent, reach, **in_time)  # type: ignore[arg-type]


@known_fields
@dataclass(frozen=True, eq=False)
class FormulaEnergy(InvariantEnergy):
    """An isotropic energy by a formula of ``tr`` and ``dev2``.

    With ``q = tr / sqrt(3)`` and ``t = |dev eps|`` the tangent has the second derivatives by q and t, and across them
    W_t / t, which is a mean of W_tt between 0 and t. So bounds of the former bound it.
    """

    text: str = field(metadata=_TEXT)
    reach: float = field(default=np.inf, metadata=REACH)
    plane: PlaneState = field(default=PlaneState.STRAIN, metadata=PLANE_OF_ENERGY)
    _graph: Graph = field(init=False, repr=False, compare=False)
    _nodes: tuple[int, ...] = field(init=False, repr=False, compare=False)
    _bounds: tuple[IsotropicBounds, BoundsBy] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        super().__post_init__()
        graph, node = Reader(self.text, "energy: ", INVARIANTS).graph()
        by_p, by_s = (graph.derivative(node, name) for name in INVARIANTS)
        nodes = (node, by_p, by_s, graph.derivative(by_p, "tr"), graph.derivative(by_p, "dev2"))
        object.__setattr__(self, "_graph", graph)
        object.__setattr__(self, "_nodes", (*nodes, graph.derivative(by_s, "dev2")))
        zero = self.invariants(np.zeros((1, 3)), np.zeros(1), np.zeros(1))
        refuse_at_zero(self.text, float(zero.value[0]), float(abs(zero.p[0])))
        _refuse_pole(self.text, graph, node, {"tr": np.sqrt(3.0) * self.reach, "dev2": self.reach**2}, {"dev2": 0.0})
        object.__setattr__(self, "_bounds", self._found())

    @property
    def kind(self) -> str:
        return "potential"

    @property
    def formula(self) -> str:
        return f"W = {shown(self.text)}"

    def stated(self) -> Mapping[str, object]:
        return {"reach": self.reach, "plane": self.plane.value if self._in_plane_stress else None}

    @property
    def homogeneous(self) -> bool:
        return True

    @property
    def bounds_by(self) -> BoundsBy:
        return self._bounds[1]

    def invariants(self, points: Array, p: Array, s: Array) -> Invariants:
        at = {"tr": p, "dev2": s}
        with np.errstate(all="ignore"):
            values = [
                np.broadcast_to(np.asarray(self._graph.value(node, at), dtype=float), p.shape) for node in self._nodes
            ]
        bad = ~np.isfinite(values).all(axis=0)
        if bad.any():
            i = int(np.argmax(bad))
            raise ProblemError(
                f"energy: formula '{shown(self.text)}' or a derivative is not finite at tr = {p[i]:.6g}, dev2 = "
                f"{s[i]:.6g}; give one that is finite there"
            )
        value, by_p, by_s, pp, ps, ss = values
        return Invariants(value, by_p, by_s, pp, ps, ss)

    def bounds(self, points: Array) -> IsotropicBounds:
        bounds = self._bounds[0]
        parts = (bounds.bulk, bounds.shear, bounds.largest_bulk, bounds.largest_shear)
        return IsotropicBounds(*(np.broadcast_to(part, (len(points),)) for part in parts))

    def _second(self, low: Array, high: Array) -> tuple[Array, Array]:
        """Bounds (3, k) of W_qq, W_qt and W_tt on boxes (k, 2) of q and t."""
        return invariant_derivatives(self._graph, self._nodes[0], low, high)

    def _found(self) -> tuple[IsotropicBounds, BoundsBy]:
        reach = self.reach
        low, high = np.array([-reach, 0.0]), np.array([reach, reach])

        def inside(at: Array) -> BoolArray:
            return np.asarray(np.hypot(at[:, 0], at[:, 1]) <= reach)

        def one(row: int) -> FoundRange:
            def of(first: Array, last: Array) -> tuple[Array, Array]:
                below, above = self._second(first, last)
                return below[row], above[row]

            return FoundRange(enclosed_range(of, low, high, inside), ROUNDING)

        if self._graph.constant(self._nodes[4]):
            bulk, shear = one(0), one(2)
            self._refuse_concave(bulk, shear)
            proof = BoundsBy.INTERVALS if bulk.proved and shear.proved else BoundsBy.SAMPLED
            numbers = (bulk.lower / 3.0, 0.5 * shear.lower, bulk.upper / 3.0, 0.5 * shear.upper)
            return IsotropicBounds(*(np.array([number]) for number in numbers)), proof
        zero = self.invariants(np.zeros((1, 3)), np.zeros(1), np.zeros(1))
        first = np.array([3.0 * zero.pp[0], 2.0 * zero.s[0]])
        if not (first > 0.0).all():
            raise ProblemError(
                f"energy: formula '{shown(self.text)}' has no positive stiffness at zero strain; add one, such as "
                "0.01*tr^2 + 0.01*dev2"
            )

        def relative(lows: Array, highs: Array) -> tuple[Array, Array]:
            """Bounds of the eigenvalues of the second derivatives, relative to those at zero strain."""
            below, above = self._second(lows, highs)
            scale = np.array([1.0 / first[0], 1.0 / np.sqrt(first[0] * first[1]), 1.0 / first[1]])[:, None]
            mid, off = 0.5 * (below + above) * scale, 0.5 * (above - below) * scale
            shift = off + off[1]  # entries that are off move the matrix by no more than the diagonal of their sums
            ends = []
            for sign in (-1.0, 1.0):
                first_one, last_one = mid[0] + sign * shift[0], mid[2] + sign * shift[2]
                reach_of = np.hypot(0.5 * (first_one - last_one), mid[1])
                ends.append(0.5 * (first_one + last_one) + sign * reach_of * (1.0 + 1e-14))
            sure = np.isfinite(ends[0]) & np.isfinite(ends[1])
            return np.where(sure, ends[0], -np.inf), np.where(sure, ends[1], np.inf)

        # the range of all eigenvalues: the smallest from below, the largest from above
        tangents = FoundRange(enclosed_range(relative, low, high, inside), ROUNDING)
        self._refuse_concave(tangents, tangents)
        ends = (tangents.lower, tangents.lower, tangents.upper, tangents.upper)
        relative_to = (first[0] / 3.0, 0.5 * first[1], first[0] / 3.0, 0.5 * first[1])
        proof = BoundsBy.INTERVALS if tangents.proved else BoundsBy.SAMPLED
        return IsotropicBounds(*(np.array([end * of]) for end, of in zip(ends, relative_to, strict=True))), proof

    def _refuse_concave(self, *ranges: FoundRange) -> None:
        for curvature in ranges:
            if curvature.concave:
                q, t = curvature.least_at
                raise ProblemError(
                    f"energy: formula '{shown(self.text)}' is not convex: at tr = {np.sqrt(3.0) * q:.6g}, dev2 = "
                    f"{t * t:.6g} a second derivative is {curvature.least:.6g}; take a smaller reach, or another energy"
                )


def _refuse_pole(text: str, graph: Graph, node: int, largest: Mapping[str, float], least: Mapping[str, float]) -> None:
    """Refuse a pole up to the largest values of the variables, whose negatives are the least ones but where told."""
    sizes = np.array([size * size if name not in least else size for name, size in largest.items()])
    if not np.isfinite(sizes).all():
        return

    def inside(at: Array) -> BoolArray:
        squares = [at[:, i] ** (1.0 if name in least else 2.0) / sizes[i] for i, name in enumerate(largest)]
        return np.asarray(np.sum(squares, axis=0) <= 1.0)

    pole = pole_in_box(graph, node, {name: (least.get(name, -size), size) for name, size in largest.items()}, inside)
    if pole is not None:
        raise ProblemError(f"energy: formula '{shown(text)}' {pole_words(pole)}; or take a smaller reach")


@known_fields
@dataclass(frozen=True, eq=False)
class ComponentEnergy(RelativeEnergy):
    """An energy by a formula of components of the strain, ``exx`` to ``exy``; shear components are halves of angles."""

    text: str = field(metadata=_TEXT)
    reach: float = field(default=np.inf, metadata=REACH)
    _graph: Graph = field(init=False, repr=False, compare=False)
    _node: int = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        super().__post_init__()
        graph, node = Reader(self.text, "energy: ", COMPONENTS).graph()
        object.__setattr__(self, "_graph", graph)
        object.__setattr__(self, "_node", node)
        dim = self._natural_dim
        zero = np.zeros((1, dim * (dim + 1) // 2)), np.zeros((1, dim))
        stress = self.stress(zero[1], zero[0])
        refuse_at_zero(self.text, float(self.energy(zero[1], zero[0])[0]), float(np.abs(stress).max()))
        _refuse_pole(self.text, graph, node, dict.fromkeys(sorted(graph.names(node)), self.reach), {})
        _ = self.bounds_by

    @property
    def formula(self) -> str:
        return f"W = {shown(self.text)}"

    def stated(self) -> Mapping[str, object]:
        return {"reach": self.reach}

    @property
    def _natural_dim(self) -> int:
        return 3 if self._graph.names(self._node) & {"ezz", "eyz", "exz"} else 2

    @property
    def bounds_by(self) -> BoundsBy:
        return BoundsBy.INTERVALS if self.factors(self._natural_dim).proved else BoundsBy.SAMPLED

    def _value(self, node: int, strain: Array) -> Array:
        dim = 2 if strain.shape[1] == 3 else 3
        at = {name: np.zeros(len(strain)) for name in COMPONENTS}
        for column, which in enumerate(_OF_DIM[dim]):
            at[COMPONENTS[which]] = strain[:, column] * (0.5 if column >= dim else 1.0)
        with np.errstate(all="ignore"):
            value = np.asarray(self._graph.value(node, at), dtype=float)
        values = np.broadcast_to(value, (len(strain),))
        bad = ~np.isfinite(values)
        if bad.any():
            where = strain_text(strain[int(np.argmax(bad))] / np.diag(once(dim)), dim)
            raise ProblemError(
                f"energy: formula '{shown(self.text)}' or a derivative is not finite at the strain {where}; give one "
                "that is finite there"
            )
        return values

    def _rates(self, dim: int) -> list[int]:
        return [self._graph.derivative(self._node, COMPONENTS[which]) for which in _OF_DIM[dim]]

    def energy(self, points: Array, strain: Array, regions: Mapping[str, BoolArray] | None = None) -> Array:
        return self._value(self._node, strain)

    def stress(self, points: Array, strain: Array, regions: Mapping[str, BoolArray] | None = None) -> Array:
        dim = points.shape[1]
        stress = np.stack([self._value(node, strain) for node in self._rates(dim)], axis=1)
        stress[:, dim:] *= 0.5
        return stress

    def tangent(self, points: Array, strain: Array, regions: Mapping[str, BoolArray] | None = None) -> Array:
        dim, size = points.shape[1], strain.shape[1]
        tangent = np.empty((len(strain), size, size))
        for i, node in enumerate(self._rates(dim)):
            for j in range(i, size):
                second = self._graph.derivative(node, COMPONENTS[_OF_DIM[dim][j]])
                factor = (0.5 if i >= dim else 1.0) * (0.5 if j >= dim else 1.0)
                tangent[:, i, j] = tangent[:, j, i] = factor * self._value(second, strain)
        return tangent

    def out_of_plane_stress(
        self, points: Array, strain: Array, regions: Mapping[str, BoolArray] | None = None
    ) -> Array:
        voigt = np.column_stack([strain[:, 0, 0], strain[:, 1, 1], 2.0 * strain[:, 0, 1]])
        return np.array(self._value(self._graph.derivative(self._node, "ezz"), voigt))

    def _found(self, dim: int) -> FoundRange:
        first, reach = self._first(dim), self.reach
        half = np.linalg.inv(np.linalg.cholesky(once(dim) @ first @ once(dim)))
        size = len(half)
        rows, columns = np.triu_indices(size)
        names = [COMPONENTS[which] for which in _OF_DIM[dim]]

        def relative(lows: Array, highs: Array) -> tuple[Array, Array]:
            below, above = component_derivatives(self._graph, self._node, names, 1.0 / np.diag(once(dim)), lows, highs)
            sure = np.isfinite(below + above).all(axis=0)
            below, above = np.where(sure, below, 0.0), np.where(sure, above, 0.0)
            mid, off = np.zeros((len(lows), size, size)), np.zeros((len(lows), size, size))
            mid[:, rows, columns] = mid[:, columns, rows] = (0.5 * (below + above)).T
            off[:, rows, columns] = off[:, columns, rows] = (0.5 * (above - below)).T
            # entries that are off by so much move the matrix by no more than the diagonal one of their sums
            shift = off.sum(axis=2)[:, :, None] * np.eye(size)
            least = np.linalg.eigvalsh(half @ (mid - shift) @ half.T)[:, 0]
            largest = np.linalg.eigvalsh(half @ (mid + shift) @ half.T)[:, -1]
            slack = 1e-13 * np.maximum(np.abs(least), np.abs(largest))
            return np.where(sure, least - slack, -np.inf), np.where(sure, largest + slack, np.inf)

        def inside(at: Array) -> BoolArray:
            return np.asarray(np.linalg.norm(at, axis=1) <= reach)

        box = np.full(size, reach)
        return self._checked(FoundRange(enclosed_range(relative, -box, box, inside), ROUNDING), dim)
