"""Sensitivities of a quantity to parameters of the statement, by the adjoint of the equations of a solution.

A solution has ``f_int(u) + B'W lam = f`` and, at each contact point, ``r = R(a r + lam)``: R is the displacement on the
graph of the law (Minty's chart), which is smooth but at kinks.  Both are linearised; one transposed solve gives the
derivative of a quantity by any number of parameters, by which the equations themselves are differenced.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, is_dataclass, replace
from types import MappingProxyType
from typing import TypeVar, cast

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spla

from hemivar.basics.arguments import described, expect, number, quoted, suggest
from hemivar.basics.arrays import real_array
from hemivar.basics.first_use import cached_property
from hemivar.basics.known_keywords import known_keywords
from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.discrete.problem import DiscreteProblem
from hemivar.errors import ProblemError
from hemivar.fem import discretize
from hemivar.fem.reactions import internal_forces, support_reactions
from hemivar.fem.supports import stated_supports
from hemivar.laws.vector_law import Chart, VectorLaw, spread
from hemivar.mechanics import ContactProblem
from hemivar.solvers import Solution, Status

__all__ = ["Sensitivity", "sensitivity"]

#: Part of a parameter by which equations are differenced: errors of its square and of rounding over it are 1e-10.
_STEP = 1e-5
#: How much softer than the body the law is seen: any value from 2 to 10 gives the same derivatives in the tests.
_ABOVE = 2.5
#: A pivot that is this part of the largest, or less, is none: the solution is not isolated.
_SINGULAR = 1e-13
#: Rounds until a one-sided derivative is on the pieces that it goes to; three are seen in the tests.
_ROUNDS = 50
#: Part of a derivative by which those of both sides may differ and be one: what differences leave.
_SAME = 1e-6

Stated = TypeVar("Stated")


@dataclass(frozen=True, eq=False)
class Sensitivity:
    """What :func:`sensitivity` found.

    Attributes
    ----------
    value : float
        The quantity.
    derivatives : mapping of parameter to float
    gap : array (m,)
        Derivative by the gap of each contact point.
    load : array (nodes, d)
        Derivative by a force at each node.
    kinks : int array
        Contact points nearer to a kink of their law than the stated distance: there the derivative is of one side.
    sides : mapping of parameter to (float, float)
        Derivatives to the left and to the right where these differ, at kinks.
    """

    value: float
    derivatives: Mapping[str, float]
    gap: Array
    load: Array
    kinks: IntArray
    sides: Mapping[str, tuple[float, float]]

    def __getitem__(self, parameter: str) -> float:
        return self.derivatives[parameter]


Parameter = tuple[float, Callable[[float], ContactProblem]]


@known_keywords
def sensitivity(
    solution: Solution,
    quantity: str | tuple[Array, Array],
    parameters: Sequence[str] | Mapping[str, Parameter] = (),
    *,
    near: float = 1e-6,
    direction: Mapping[str, float] | None = None,
) -> Sensitivity:
    """Derivatives of a quantity of a solution by parameters of its problem, through contact.

    >>> import hemivar as hv
    >>> problem = hv.gallery.survey("5.1", 4)
    >>> found = hv.sensitivity(hv.solve(problem), "normal-force", ["body_force.1"])
    >>> round(found["body_force.1"], 3)  # more weight, more pressure
    -0.159

    The cost is one linear solve more, whatever the number of parameters, and two assemblies for each of them.

    Parameters
    ----------
    solution : Solution
        Converged, of a :class:`ContactProblem`.
    quantity : str or pair of arrays
        ``energy``, ``normal-force``, ``max-pressure``, ``max-penetration``, ``contact.NAME.force.x``,
        ``support.NAME.force.x``, ``displacement.NODE.x``; or its derivatives by the unknowns (n,) and by the multiplier
        (m, c), as for a function of one's own.
    parameters : sequence of str, or mapping of name to (value, function)
        Numbers in the statement, such as ``"material.E"``, ``"contact.bottom.normal.stiffness"``,
        ``"contact.bottom.gap"``, ``"tractions.top.1"``, ``"supports.right.y"``; or a value and a function that makes
        the problem of it, as for the shape of a mesh with the same cells.
    near : float
        Distance to a kink, relative to the largest force, up to which a contact point is listed.
    direction : mapping of parameter to float, optional
        A change of the parameters: ``derivatives`` then has one entry, ``"direction"``, the derivative to that side,
        which is right at kinks as well.

    Returns
    -------
    Sensitivity

    Raises
    ------
    ProblemError
        A name is not known, the solution did not converge or is not isolated (a fold), or a friction bound has no
        derivative.
    """
    expect(solution, Solution, "solution", "give what hemivar.solve returned")
    if not 0.0 <= number(near, "near") < 1.0:
        raise ProblemError(f"near = {near:g}; give a part of the largest force, from 0 to 1")
    if direction is not None:
        expect(direction, Mapping, "direction", "give changes by parameter, such as {'material.E': 1.0}")
        direction = {name: number(by, f"the change of '{name}'") for name, by in direction.items()}
    equations = _Equations.of(solution)
    given = _parameters(equations.stated, parameters)
    values = _quantity(equations, quantity)
    adjoint_u, adjoint_r = equations.adjoint(values.by_unknowns, values.by_multiplier)
    kinks, derivatives, sides = equations.near_kinks(near), dict[str, float](), dict[str, tuple[float, float]]()
    for name in direction or ():
        if name not in given:
            raise ProblemError(
                f"direction names {quoted(name)}, which is none of the parameters{suggest(name, list(given))}"
            )
    changes = {name: equations.changed_by(one, values) for name, one in given.items()}
    for name, change in changes.items():
        if np.any(change.graph[kinks]):
            raise ProblemError(
                f"{quoted(name)} changes the law of a contact point that lies at a kink of it, where there is no "
                "derivative; change the parameter a little"
            )
        off = equations.off_graph(change, equations.slopes)
        derivatives[name] = change.quantity - float(adjoint_u @ change.forces + (adjoint_r * off).sum())
        if kinks.size:
            left, right = (side * equations.towards(values, [(change, side)]) for side in (-1.0, 1.0))
            if abs(left - right) > _SAME * max(abs(left), abs(right)):
                sides[name] = left, right
    if direction is not None:
        derivatives = {"direction": equations.towards(values, [(changes[name], by) for name, by in direction.items()])}
    field = equations.problem.field
    assert field is not None
    return Sensitivity(
        values.value,
        MappingProxyType(derivatives),
        equations.by_gap(adjoint_r) - values.by_local[:, 0],
        np.asarray(field.basis @ (adjoint_u + values.by_load)).reshape(-1, field.components),
        kinks,
        MappingProxyType(sides),
    )


@dataclass(frozen=True, eq=False)
class _Values:
    """A quantity at a solution: its value, its slopes, and what it is at the same solution of another problem."""

    value: float
    by_unknowns: Array  # (n,)
    by_multiplier: Array  # (m, c)
    at: Callable[[DiscreteProblem], float]
    by_local: Array  # (m, c): explicitly, of the energy
    by_load: Array  # (n,)


@dataclass(frozen=True, eq=False)
class _Change:
    """Derivatives of the equations by a parameter, at a solution that stays."""

    forces: Array  # (n,)
    local: Array  # (m, c): of the local displacements, as by a gap
    graph: Array  # (m, c): of the displacements on the graph of the law
    quantity: float


@dataclass(frozen=True, eq=False)
class _Equations:
    """The equations of a solution, and their derivatives by it."""

    solution: Solution
    problem: DiscreteProblem
    stated: ContactProblem
    #: Stiffness (m, 2) of the chart of each point.
    a: Array
    u: Array
    lam: Array

    @classmethod
    def of(cls, solution: Solution) -> _Equations:
        problem, stated = solution.problem, solution.problem.origin
        if stated is None:
            raise ProblemError("sensitivities are those of a stated problem, and this one was made of arrays; state it")
        if solution.status is not Status.CONVERGED:
            raise ProblemError(f"the solution ended as '{solution.status.value}'; sensitivities need a converged one")
        contact, diagonal = problem.contact, problem.bulk.hessian(solution.unknowns).diagonal()
        trace = contact.trace
        soft = np.asarray(trace.multiply(trace) @ (1.0 / diagonal)).reshape(contact.shape) * contact.weights[:, None]
        stiff = 1.0 / np.where(soft > 0.0, soft, soft.max(initial=0.0) or 1.0)
        pair = np.column_stack([stiff[:, 0], stiff[:, 1:].max(axis=1) if stiff.shape[1] > 1 else stiff[:, 0]])
        law = problem.law
        alphas = law.curve_above if law.depends_on_whole_state else law.weak_convexity
        above = np.column_stack([np.broadcast_to(one, len(pair)) for one in alphas])
        needed = np.where(np.isfinite(above), _ABOVE * above, 1e3 * pair.max(initial=0.0))
        return cls(solution, problem, stated, np.maximum(pair, needed), solution.unknowns, solution.multiplier)

    @cached_property
    def r(self) -> Array:
        return self.problem.local(self.u)

    @cached_property
    def p(self) -> Array:
        """Places (m, c) of the chart."""
        return spread(self.a, self.r.shape[1]) * self.r + self.lam

    def chart(self, law: VectorLaw) -> Chart:
        """The graph of a law over :attr:`p`."""
        chart = law.chart(self.a, self.r.shape[1])
        return Chart(law, self.a) if chart is None and not law.state_dependent else _known(chart)

    @cached_property
    def size(self) -> float:
        """The largest force per area that a contact point has, or that its displacement and its gap stand for."""
        wide, moved = spread(self.a, self.r.shape[1]), self.problem.contact.trace_of(self.u)
        parts = (self.lam, wide * moved, wide * self.problem.offset)
        return max(float(np.abs(part).max(initial=0.0)) for part in parts) or 1.0

    @cached_property
    def _still(self) -> BoolArray:
        """Components that supports hold where the law holds them as well, bool (m, c)."""
        held = np.asarray(np.diff(self.problem.contact.trace.indptr) == 0).reshape(self.r.shape)
        return np.asarray(held & ~self.slopes.any(axis=2))

    @cached_property
    def slopes(self) -> Array:
        """How the displacement on the graph follows its place, (m, c, c)."""
        return self.chart(self.problem.law).at(self.p).jacobian

    def matrix(self, slopes: Array) -> sp.csc_array:
        """Derivative of the equations by displacements and scaled multipliers, ``a`` times each of them."""
        contact, m, c = self.problem.contact, *self.r.shape
        wide = spread(self.a, c)
        rows = np.arange(m * c).reshape(m, c)
        index = (np.repeat(rows, c, axis=1).ravel(), np.tile(rows, (1, c)).ravel())
        own = sp.csr_array((slopes.ravel(), index), shape=(m * c, m * c))
        scale = sp.diags_array(wide.ravel())
        pressed = contact.trace.T @ sp.diags_array(np.repeat(contact.weights, c) * wide.ravel())
        along = (sp.eye_array(m * c) - own @ scale) @ contact.trace
        still = sp.diags_array(self._still.ravel().astype(float))  # whatever the force is there, it stays
        whole = [[self.problem.bulk.hessian(self.u), pressed], [along - still @ along, -own @ scale - still]]
        return sp.csc_array(sp.block_array(whole))

    def factor(self, slopes: Array) -> spla.SuperLU:
        """The factors of :meth:`matrix`."""
        try:
            factor = spla.splu(self.matrix(slopes))
        except RuntimeError:
            raise _fold() from None
        pivots = np.abs(factor.U.diagonal())
        if not pivots.min(initial=np.inf) > _SINGULAR * pivots.max(initial=0.0):
            raise _fold()
        return factor

    @cached_property
    def _factor(self) -> spla.SuperLU:
        return self.factor(self.slopes)

    def adjoint(self, by_unknowns: Array, by_multiplier: Array) -> tuple[Array, Array]:
        """The transposed solve, (n,) and (m, c)."""
        wide = spread(self.a, self.r.shape[1])
        right = np.concatenate([by_unknowns, (by_multiplier * wide).ravel()])
        solved = self._factor.solve(right, "T")
        return solved[: self.u.size], solved[self.u.size :].reshape(self.r.shape)

    def by_gap(self, adjoint: Array) -> Array:
        """Derivative (m,) by gaps of what has the adjoint (m, c): a gap moves the local displacement alone."""
        moved = np.eye(self.r.shape[1]) - self.slopes * spread(self.a, self.r.shape[1])[:, None, :]
        return np.asarray(np.einsum("mi,mi->m", adjoint, moved[:, :, 0]))

    def changed_by(self, parameter: Parameter, values: _Values) -> _Change:
        """Derivatives of the equations by a parameter, by differences from both sides."""
        value, make = parameter
        step = _STEP * abs(value) or _STEP * (self.problem.extent or 1.0)
        ends = []
        for moved in (value + step, value - step):
            other = discretize(make(moved), check_coercivity=False)
            if other.unknowns != self.u.size or other.contact.shape != self.r.shape:
                raise ProblemError("a parameter changes the number of unknowns; give one that leaves the mesh as it is")
            forces = other.bulk.gradient(self.u) - other.load + other.contact.force(self.lam)
            ends.append((forces, other.local(self.u), self.chart(other.law).at(self.p).r, values.at(other)))
        return _Change(*((one - two) / (2.0 * step) for one, two in zip(*ends, strict=True)))

    def off_graph(self, change: _Change, slopes: Array) -> Array:
        """How far a change takes the local displacements off the graph (m, c), on the pieces of these slopes."""
        along = change.local - np.einsum("mij,mj->mi", slopes, spread(self.a, self.r.shape[1]) * change.local)
        return np.where(self._still, 0.0, along - change.graph)

    def towards(self, values: _Values, changes: Sequence[tuple[_Change, float]]) -> float:
        """The derivative to one side: the linearised inequality, on the pieces that the solution goes to."""
        parts = ("forces", "local", "graph", "quantity")
        whole = _Change(*(sum(by * getattr(one, part) for one, by in changes) for part in parts))
        wide, n, slopes = spread(self.a, self.r.shape[1]), self.u.size, self.slopes
        for _ in range(_ROUNDS):
            moved = self.factor(slopes).solve(-np.concatenate([whole.forces, self.off_graph(whole, slopes).ravel()]))
            du, dlam = moved[:n], moved[n:].reshape(self.r.shape) * wide
            dr = (self.problem.contact.trace @ du).reshape(self.r.shape) + whole.local
            dp = wide * dr + dlam
            ahead = self.p + 1e-9 * self.size / max(float(np.abs(dp).max(initial=0.0)), 1e-300) * dp
            onward = self.chart(self.problem.law).at(ahead).jacobian
            if np.allclose(onward, slopes, rtol=1e-6, atol=1e-9 / float(self.a.max(initial=1.0))):
                break
            slopes = onward
        return float(values.by_unknowns @ du + (values.by_multiplier * dlam).sum() + whole.quantity)

    def near_kinks(self, near: float) -> IntArray:
        """Contact points whose graph turns within a distance."""
        chart, turns = self.chart(self.problem.law), np.zeros(len(self.p), dtype=bool)
        for axis in range(self.r.shape[1]):
            for side in (-1.0, 1.0):
                beside = self.p.copy()
                beside[:, axis] += side * near * self.size
                off = np.abs(chart.at(beside).jacobian - self.slopes).max(axis=(1, 2), initial=0.0)
                turns |= off * self.a.max(axis=1) > 1e-3
        return np.flatnonzero(turns)


def _known(chart: Chart | None) -> Chart:
    if chart is None:
        raise ProblemError("a friction bound has no derivative by the state; give a formula or a table without jumps")
    return chart


def _fold() -> ProblemError:
    return ProblemError(
        "the solution is not isolated, as at a fold, and has no derivative there; follow the path, hv.follow_path"
    )


# ---- parameters ------------------------------------------------------------------------------------------------------


def _parameters(stated: ContactProblem, given: Sequence[str] | Mapping[str, Parameter]) -> dict[str, Parameter]:
    if isinstance(given, Mapping):
        pairs = {
            name: one for name, one in given.items() if isinstance(one, tuple) and len(one) == 2 and callable(one[1])
        }
        if len(pairs) < len(given):
            raise ProblemError("a parameter with a function is (value, function); give such a pair for each name")
        return {name: (number(value, f"the value of '{name}'"), make) for name, (value, make) in pairs.items()}
    if isinstance(given, str) or not isinstance(given, Sequence) or not all(isinstance(name, str) for name in given):
        raise ProblemError(f"parameters is {described(given)}; give a list of names")
    return {name: _in_statement(stated, name) for name in given}


def _in_statement(stated: ContactProblem, name: str) -> Parameter:
    keys = name.split(".")
    value = _value(stated, keys, name)
    if isinstance(value, bool) or not isinstance(value, int | float | np.number):
        raise ProblemError(f"parameter {quoted(name)} is {described(value)} in the problem; name a number")
    return float(value), lambda moved: _with(stated, keys, moved)


def _value(part: object, keys: Sequence[str], name: str) -> object:
    for depth, key in enumerate(keys):
        try:
            if isinstance(part, Mapping):
                part = part[key]
            elif isinstance(part, list | tuple | np.ndarray):
                part = part[int(key)]
            else:
                part = getattr(part, key)
        except (KeyError, IndexError, ValueError, AttributeError):
            where = ".".join(keys[:depth]) or "the problem"
            raise ProblemError(
                f"parameter {quoted(name)}: {quoted(where)} has no {quoted(key)}; name it as in 'material.E'"
            ) from None
    return part


def _with(part: Stated, keys: Sequence[str], value: float) -> Stated:
    """A part of a statement with one number in it changed."""
    if not keys:
        return cast(Stated, value)
    key, rest = keys[0], keys[1:]
    if isinstance(part, Mapping):
        return cast(Stated, {**part, key: _with(part[key], rest, value)})
    if isinstance(part, list | tuple | np.ndarray):
        entries = [_with(one, rest, value) if k == int(key) else one for k, one in enumerate(part)]
        return cast(Stated, np.array(entries) if isinstance(part, np.ndarray) else type(part)(entries))
    if not is_dataclass(part):
        raise ProblemError(f"a {type(part).__name__} cannot be changed in its '{key}'; give a function of the value")
    return replace(part, **{key: _with(getattr(part, key), rest, value)})  # type: ignore[type-var]


# ---- quantities ------------------------------------------------------------------------------------------------------


def _quantity(equations: _Equations, quantity: str | tuple[Array, Array]) -> _Values:
    """A quantity by its name, or by its slopes."""
    u, lam, problem = equations.u, equations.lam, equations.problem
    nothing = _Values(np.nan, np.zeros_like(u), np.zeros_like(lam), lambda _: 0.0, np.zeros_like(lam), np.zeros_like(u))
    if not isinstance(quantity, str):
        if not isinstance(quantity, tuple | list) or len(quantity) != 2:
            raise ProblemError(f"quantity is {described(quantity)}; give a name, or slopes by unknowns and multiplier")
        by_u, by_lam = (real_array(one, "the slopes of a quantity", finite=False) for one in quantity)
        if by_u.shape != u.shape or by_lam.shape != lam.shape:
            raise ProblemError(
                f"the slopes of a quantity have shapes {by_u.shape} and {by_lam.shape}; give {u.shape} and {lam.shape}"
            )
        return replace(nothing, by_unknowns=by_u, by_multiplier=by_lam)
    contact, field_ = problem.contact, problem.field
    assert field_ is not None
    if quantity == "energy":
        return _energy(equations, nothing)
    if quantity == "normal-force":
        slopes = np.zeros_like(lam)
        slopes[:, 0] = contact.weights

        def pressed(other: DiscreteProblem) -> float:
            return float(other.contact.weights @ lam[:, 0])

        return replace(nothing, value=pressed(problem), by_multiplier=slopes, at=pressed)
    if quantity in ("max-pressure", "max-penetration") and contact.count:
        values = lam[:, 0] if quantity == "max-pressure" else equations.r[:, 0]
        most = int(np.argmax(values))
        if quantity == "max-pressure":
            slopes = np.zeros_like(lam)
            slopes[most, 0] = 1.0
            return replace(nothing, value=float(values[most]), by_multiplier=slopes)
        row = np.asarray(contact.trace[[most * lam.shape[1]]].todense()).ravel()
        return replace(
            nothing, value=float(values[most]), by_unknowns=row, at=lambda other: float(other.local(u)[most, 0])
        )
    kind, _, rest = quantity.partition(".")
    name, axis = rest, None
    if rest[-2:] in (".x", ".y", ".z"):
        name, axis = rest[:-2], "xyz".index(rest[-1])
    if axis is not None and axis < field_.components:
        if kind == "displacement" and name.isdecimal() and int(name) < field_.number_of_nodes:
            return _displacement(equations, nothing, int(name), axis)
        boundary = name.removesuffix(".force")
        if kind == "contact" and boundary != name and boundary in equations.solution.contact_forces:
            return _contact_force(equations, nothing, boundary, axis)
        if kind == "support" and boundary != name and boundary in stated_supports(equations.stated).names:
            if field_.followers is not None:
                raise ProblemError(
                    "the force of a support has no derivative here beside ties and plates; take that of a contact"
                )
            return _support_force(equations, nothing, boundary, axis)
    raise ProblemError(
        f"quantity {quoted(quantity)} is not known; give energy, normal-force, max-pressure, max-penetration, "
        "contact.NAME.force.x, support.NAME.force.x or displacement.NODE.x"
    )


def _energy(equations: _Equations, nothing: _Values) -> _Values:
    """The energy of the solution, which changes as the equations change and not by the solution itself."""
    problem, u, lam = equations.problem, equations.u, equations.lam
    if problem.law.state_dependent:
        raise ProblemError("the energy depends on a friction bound of the solution and has no derivative; take a force")
    wide, p, r = spread(equations.a, lam.shape[1]), equations.p, equations.r

    def value(other: DiscreteProblem) -> float:
        pair = equations.chart(other.law).at(p).r
        envelope = other.law.value(pair) + 0.5 * (wide * (pair - p / wide) ** 2).sum(axis=1)
        own = other.contact.weights @ (envelope + ((other.local(u) - r) * lam).sum(axis=1))
        return float(other.bulk.value(u) - other.load @ u + other.constant + own)

    by_local = problem.contact.weights[:, None] * lam
    return replace(nothing, value=equations.solution.energy, at=value, by_local=by_local, by_load=-u)


def _displacement(equations: _Equations, nothing: _Values, node: int, axis: int) -> _Values:
    def value(other: DiscreteProblem) -> float:
        assert other.field is not None
        return float(other.field.full(equations.u)[node, axis])

    field_ = equations.problem.field
    assert field_ is not None
    row = np.asarray(field_.basis[[node * field_.components + axis]].todense()).ravel()
    return replace(nothing, value=value(equations.problem), by_unknowns=row, at=value)


def _contact_force(equations: _Equations, nothing: _Values, boundary: str, axis: int) -> _Values:
    """A component of the force on one boundary by what it touches; of two bodies one side has the other's opposite."""
    contact, lam = equations.problem.contact, equations.lam
    assert contact.frames is not None
    on = np.zeros(contact.count)
    for name in contact.names:
        sides = contact.pairs.get(name, (name,))
        if boundary in sides:
            on[contact.on(name)] = -1.0 if boundary == sides[0] else 1.0
    slopes = (on * contact.weights)[:, None] * contact.frames[:, :, axis]

    def value(other: DiscreteProblem) -> float:
        forces = other.contact.weights[:, None] * (0.0 - other.contact.global_vectors(lam))
        return float(other.contact.forces(forces)[boundary][axis])

    return replace(nothing, value=value(equations.problem), by_multiplier=slopes, at=value)


def _support_force(equations: _Equations, nothing: _Values, boundary: str, axis: int) -> _Values:
    """A component of the force of a support: the residual of the equations that it takes away."""
    problem, stated, u, lam = equations.problem, equations.stated, equations.u, equations.lam
    field_, contact, supports = problem.field, problem.contact, stated_supports(stated)
    assert field_ is not None
    own = supports.owner == supports.names.index(boundary)
    unit = np.einsum("kq,kqd->kd", np.where(own, supports.directions[:, :, axis], 0.0), supports.directions)
    whole, every = field_.full(u), np.arange(stated.mesh.number_of_cells)
    step = 1e-4 * (float(np.abs(whole).max(initial=0.0)) or problem.extent)
    ahead, behind = (internal_forces(stated, whole + side * step * unit, every) for side in (1.0, -1.0))
    row = field_.basis.T @ ((ahead - behind) / (2.0 * step)).ravel()
    slopes = np.zeros_like(lam)
    if contact.count:
        assert contact.frames is not None
        assert contact.mean is not None
        slopes = contact.weights[:, None] * np.einsum("mid,md->mi", contact.frames, contact.mean @ unit)

    def value(other: DiscreteProblem) -> float:
        assert other.field is not None
        return float(support_reactions(other, other.field.full(u), lam)[boundary][axis])

    return replace(nothing, value=value(problem), by_unknowns=np.asarray(row), by_multiplier=slopes, at=value)
