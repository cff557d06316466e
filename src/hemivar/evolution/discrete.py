"""Semi-discrete evolution: stiffness, viscosity and mass over a mesh, what acts at a time, the body of a stage."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np
import scipy.sparse as sp

from hemivar.basics.arrays import ROUNDED
from hemivar.basics.first_use import cached_property
from hemivar.basics.last_used import Recent
from hemivar.basics.portable import PickleMixin
from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.discrete.bulk import Quadratic
from hemivar.discrete.loading import Loading
from hemivar.discrete.model import Model
from hemivar.discrete.operator_family import Composition, OperatorFamily
from hemivar.discrete.operators import Operator, combined
from hemivar.discrete.potential import BodyEnergy, Potential
from hemivar.discrete.problem import DiscreteProblem
from hemivar.discrete.space import Field
from hemivar.errors import ProblemError
from hemivar.evolution.discrete_heat import coupling
from hemivar.evolution.evolution_problem import Evolution, Mass
from hemivar.fem.assembly import stated_load
from hemivar.fem.discretize import discretize
from hemivar.fem.forms import FormProblem
from hemivar.fem.hierarchy import family_of
from hemivar.fem.initial_load import initial_load
from hemivar.fem.quadrature import at_quadrature_points
from hemivar.fem.unknowns import nodal_conditions
from hemivar.laws import ContactLaw, PiecewiseQuadratic, SlipMeasure, Superpotential, VectorLaw
from hemivar.laws.coupled import join_laws
from hemivar.laws.memory import MemoryChain
from hemivar.laws.normal_and_friction import with_friction
from hemivar.laws.transformed.algebra import homogeneous
from hemivar.laws.vector_law import stores_slip
from hemivar.linear.vectors import Vectors
from hemivar.mechanics.foundation import Contact
from hemivar.mechanics.statement import ContactProblem
from hemivar.mechanics.thermal import Heat

__all__ = [
    "KEPT",
    "DiscreteEvolution",
    "DiscreteHeat",
    "ExternalData",
    "StepMatrices",
    "dampings",
    "discretize_evolution",
    "refuse_unmeasured",
]

#: Matrices, operators and loads of different steps that are kept; what is forgotten is computed again, to the last bit.
KEPT = 8


@dataclass(frozen=True, eq=False)
class ExternalData(PickleMixin):
    """What acts on the body at one time."""

    #: Forces on the unknowns and on the prescribed displacements.
    load: Array  # (n + k,)
    #: Displacements of the moved supports.
    prescribed: Array  # (k,)
    #: Gap, less what supports prescribe, and slip that is there already.
    offset: Array  # (m, c)
    law: VectorLaw
    #: Laws of the normal rate, where there are some.
    damping: Mapping[str, Superpotential] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class DiscreteHeat(PickleMixin):
    """Heat over the mesh of a body."""

    heat: Heat
    #: Of heat alone.
    conduction: DiscreteEvolution
    #: Force of nodal temperatures on the unknowns and on the prescribed displacements.
    pull: sp.csr_array  # (n + k, nodes)
    #: Contact point of the body at each contact point of the heat. A node that supports hold altogether is none: it has
    #: the nearest one of the boundary if the conductance there asks for it, and else -1.
    partner: IntArray  # (q,)
    #: Parts of the heat of friction at the contact points of the body that go into the nodes.
    entering: sp.csr_array  # (nodes, m)

    @property
    def fed_back(self) -> bool:
        """Whether the motion says something to the heat."""
        heat = self.heat
        dependent = any(one.depends_on_state for one in heat.contact.values())
        return dependent or bool(heat.coupling and heat.stresses) or self.entering.nnz > 0

    def load(self, temperature: Array) -> Array:
        """Force (n + k,) of nodal temperatures (nodes,)."""
        return np.asarray(self.pull @ (temperature - self.heat.stress_free))

    def temperature(self, unknowns: Array) -> Array:
        """Nodal temperatures (nodes,) of unknowns and prescribed temperatures."""
        return self.conduction.full(unknowns)[:, 0]

    def rubbed(self, heat: Array) -> Array:
        """Nodal heat (nodes,) of heat that friction makes at the contact points of the body (m,)."""
        return np.asarray(self.entering @ heat)

    def deformed(self, change: Array) -> Array:
        """Nodal heat (nodes,) that a change (n + k,) of the displacement makes."""
        return np.asarray(-self.heat.coupling * (self.pull.T @ change))

    @property
    def depends_on_temperature(self) -> bool:
        """Whether a conductance depends on the temperatures of both sides."""
        return any(one.depends_on_temperature for one in self.heat.contact.values())

    def law(self, stated: VectorLaw, penetration: Array, pressure: Array, temperature: Array) -> VectorLaw:
        """The exchange of heat at penetration and pressure (m,) of the body and the mean (q,) of both temperatures."""
        here = self.partner >= 0
        parts: list[tuple[VectorLaw, int]] = []
        for name, index in self.conduction.blocks:
            one = self.heat.contact[name]
            if not one.depends_on_state:
                parts.append((stated.take(index), index.size))
                continue
            met = here[index]
            r, p = np.zeros(index.size), np.zeros(index.size)
            r[met], p[met] = penetration[self.partner[index[met]]], pressure[self.partner[index[met]]]
            h = np.where(met, one.conductances(r, p, temperature[index]), 0.0)[:, None]
            zero = np.zeros_like(h)
            law = PiecewiseQuadratic(zero, np.hstack([h, h]), zero, name="conductance")
            parts.append((ContactLaw(law).at(None), index.size))
        return join_laws(parts) if parts else stated


@dataclass(frozen=True, eq=False)
class DiscreteEvolution(PickleMixin):
    """Matrices and contact points of an evolution."""

    evolution: Evolution
    #: The elastic body at the start.
    problem: DiscreteProblem
    family: OperatorFamily
    #: Contact points of each boundary, in their order.
    blocks: tuple[tuple[str, IntArray], ...]  # (boundary, int array)
    heat: DiscreteHeat | None = field(default=None, kw_only=True)

    @cached_property
    def stiffness(self) -> Operator:
        """Stiffness at the start; of a body that is not linear that at rest, by which sizes are compared."""
        return self.family.stiffness

    @property
    def linear(self) -> bool:
        """Whether the elastic forces are the stiffness times the displacement."""
        return not isinstance(self.problem.bulk, Potential)

    def elastic_force(self, x: Array) -> Array:
        """Elastic forces on the unknowns and on the prescribed displacements, of both, (n + k,)."""
        if self.linear:
            return self.stiffness.times(x)
        force = self._stored.field_forces(self.full(x)).ravel()
        return np.concatenate([self.field.basis.T @ force, force[self.moved]])

    def elastic_energy(self, x: Array, force: Array) -> float:
        """The energy stored at unknowns and prescribed displacements, where these forces act, each (n + k,)."""
        return 0.5 * float(x @ force) if self.linear else self._stored.field_value(self.full(x))

    @property
    def _stored(self) -> BodyEnergy:
        bulk = self.problem.bulk
        assert isinstance(bulk, Potential)
        return bulk.energy

    @cached_property
    def viscosity(self) -> Operator | None:
        """Viscosity; of heat the capacity."""
        return self.family.viscosity

    @cached_property
    def mass(self) -> Operator | None:
        """Mass, if the evolution has inertia."""
        return self.family.mass

    @cached_property
    def branches(self) -> tuple[tuple[float, Operator], ...]:
        """Relaxation time and stiffness of each branch."""
        return self.family.branches

    @cached_property
    def moved(self) -> IntArray:
        """Nodal components (k,) that supports may move."""
        return self.family.moved

    @property
    def vectors(self) -> Vectors:
        """How the parts of all processes are looked at together; arrays are those of this process."""
        return self.problem.vectors

    @property
    def unknowns(self) -> int:
        """Number of unknowns n."""
        return self.problem.unknowns

    @cached_property
    def follows_slip(self) -> BoolArray:
        """Contact points (m,) whose law counts the slip from the beginning of the march."""
        return self._whether(lambda law: law.follows_slip)

    @cached_property
    def stores_slip(self) -> BoolArray:
        """Contact points (m,) that store what slips there work against."""
        return self._whether(stores_slip)

    @cached_property
    def breakable(self) -> int:
        """How many bonds of all processes may break in a step, one after the other."""
        own = sum(index.size for name, index in self.blocks if MemoryChain(self.contacts[name].remembers).couples)
        return int(self.vectors.total(own)[0])

    def _whether(self, chosen: Callable[[VectorLaw], bool]) -> BoolArray:
        mask = np.zeros(self.problem.contact_points, dtype=bool)
        for name, index in self.blocks:
            contact = self.contacts[name]
            mask[index] = MemoryChain(contact.remembers).couples or chosen(contact.law)
        return mask

    def counted(self, local: Array, before: Array, index: IntArray | slice = slice(None)) -> Array:
        """Local displacements (m, c) as laws of a step from ``before (m, c)`` count them, at some contact points.

        That is the penetration, and the slip: the whole one, or of laws of the slip rate the increment.
        """
        r = local[index].copy()
        r[:, 1:] -= np.where(self.follows_slip[index, None], 0.0, before[index, 1:])
        return r

    @property
    def contacts(self) -> Mapping[str, Contact]:
        """What acts on each contact boundary, and over areas."""
        return self.evolution.problem.contact

    @property
    def stores(self) -> bool:
        """Whether it is heat that a capacity stores."""
        return self.evolution.problem.material.capacity is not None

    @property
    def viscous_everywhere(self) -> bool:
        """Whether every strain rate, of a scalar problem every gradient, is resisted in every quadrature point."""
        mesh, material = self.evolution.statement.mesh, self.evolution.statement.material
        if material.homogeneous_in(True):
            tensor = material.viscosity_tensor(mesh.points[:1], {})
        else:
            tensor, _ = at_quadrature_points(mesh, 2 * self.evolution.statement.order, material.viscosity_tensor)
        sizes = np.asarray(np.linalg.eigvalsh(tensor), dtype=float)
        most, least = float(sizes.max(initial=0.0)), float(sizes.min(initial=np.inf))
        largest, small = self.vectors.largest(most, -least).tolist()
        return bool(-small > ROUNDED * largest)

    @property
    def field(self) -> Field:
        """The displacement."""
        field = self.problem.field
        assert field is not None
        return field

    @cached_property
    def damping_time(self) -> float | None:
        """The time t with ``C = t K`` on the unknowns, if viscosity is in proportion to stiffness; else None.

        Then the viscous force of a velocity is known where elastic forces are, without a product of its own.
        """
        if self.viscosity is None or not self.vectors.alone or not self.linear:
            return None
        return self.viscosity.multiple_of(self.stiffness)

    def full(self, x: Array) -> Array:
        """Nodal displacements or velocities (nodes, d) of unknowns and prescribed displacements (n + k,)."""
        n = self.unknowns
        values = self.field.basis @ x[:n]
        values[self.moved] += x[n:]
        return np.asarray(values).reshape(-1, self.field.components)

    @cached_property
    def of_all(self) -> Array:
        """What sums forces (n + k,) over the nodes, (n + k,): 1 for each but where unknowns are jumps."""
        ones = np.ones((self.field.basis.shape[0], 1))
        return self.restrict(ones, np.ones(self.moved.size))

    def restrict(self, values: Array, prescribed: Array) -> Array:
        """Unknowns and prescribed displacements (n + k,) of nodal values (nodes, d)."""
        rest = values.ravel().copy()
        rest[self.moved] -= prescribed
        return np.concatenate([self.field.lift @ rest, prescribed])

    @cached_property
    def _as_stated(self) -> tuple[Array, Array]:
        """What supports prescribe (k,), and offsets (m, c), where neither depends on time."""
        prescribed, offset = self.field.prescribed, self.problem.offset
        if not self.linear:
            origin = self.field.origin
            prescribed, offset = prescribed - self.field.basis @ origin, offset + self.problem.contact.trace_of(origin)
        return prescribed[self.moved], offset

    @cached_property
    def _initial_load(self) -> Array | None:
        """The load of initial stress where it is the same at all times; None where there is none, or it changes."""
        stated = self.evolution.statement
        return initial_load(stated) if stated.initially_stressed and not stated.initially_changing else None

    def data_at(self, time: float) -> ExternalData:
        """What acts at a time."""
        stated = self.evolution.statement
        bound = stated.at_time(time)
        force = stated_load(bound, self._initial_load)
        load = np.concatenate([self.field.basis.T @ force, force[self.moved]])
        if not stated.time_dependent & {"supports", "gap", "law"}:
            return ExternalData(load, *self._as_stated, self.problem.law, dampings(bound.contact))
        conditions = nodal_conditions(bound)
        _, offset, law, _ = conditions.contact()
        return ExternalData(load, conditions.prescribed[self.moved], offset, law, dampings(bound.contact))


@dataclass(frozen=True, eq=False)
class FormEvolution(DiscreteEvolution):
    """Of a body of forms."""

    stated: FormProblem = field(kw_only=True)
    #: Unknowns of the basis that supports may move, in the order of :attr:`moved`.
    dofs: IntArray = field(kw_only=True)  # (k,)

    @property
    def viscous_everywhere(self) -> bool:
        """Whether viscosity is in proportion to stiffness; of other forms nobody knows."""
        return (self.damping_time or 0.0) > 0.0

    def data_at(self, time: float) -> ExternalData:
        """What acts at a time."""
        force, values, offset, law, contacts = self.stated.acting(time)
        load = np.concatenate([force[self.stated.body.free], force[self.dofs]])
        return ExternalData(load, values[self.dofs], offset, law, dampings(contacts))


def dampings(contacts: Mapping[str, Contact]) -> dict[str, Superpotential]:
    """Laws of the normal rate of contacts at one time, by boundary, where there are some."""
    return {name: contact.damping for name, contact in contacts.items() if contact.damping is not None}


def discretize_evolution(evolution: Evolution) -> DiscreteEvolution:
    """Matrices, supports and contact points of an evolution."""
    if isinstance(forms := evolution.problem, FormProblem):
        problem = forms.starting(evolution.start)
        family, dofs = forms.family(problem, evolution.inertia)
        refuse_unmeasured(forms, problem, blocks := _blocks(problem), False)
        return FormEvolution(evolution, problem, family, blocks, stated=forms, dofs=dofs)
    stated = forms.at_time(evolution.start)
    # What stores heat holds a temperature within a step.
    static = not (evolution.inertia or stated.material.capacity is not None)
    problem = discretize(stated, check_coercivity=static, evolving=True)
    family = family_of(problem, evolution.inertia)
    if family.mass is not None and evolution.mass is Mass.REDISTRIBUTED:
        family = replace(family, mass=_redistributed(family.mass, problem, family.moved))
    refuse_unmeasured(stated, problem, blocks := _blocks(problem), evolution.heat is not None)
    return DiscreteEvolution(evolution, problem, family, blocks, heat=_heat(evolution, stated, problem, family.moved))


def _blocks(problem: DiscreteProblem) -> tuple[tuple[str, IntArray], ...]:
    contact = problem.contact
    blocks = tuple((name, contact.on(name)) for name in contact.names if contact.on(name).size)
    for name, index in blocks:
        if np.any(np.diff(index) != 1):
            raise ProblemError(f"contact points of boundary '{name}' do not follow one another; renumber them")
    return blocks


def refuse_unmeasured(
    stated: ContactProblem | FormProblem,
    problem: DiscreteProblem,
    blocks: tuple[tuple[str, IntArray], ...],
    heated: bool,
) -> None:
    """Refuse friction of which nobody knows whether it follows the slip or its rate, and what goes with one only."""
    for name, index in blocks:
        contact = stated.contact[name]
        friction = contact.friction
        where = f"the friction '{friction.name}' of contact '{name}'"
        if friction.of is SlipMeasure.SLIP and (contact.remembers or heated):
            what = "memory" if contact.remembers else "heat"
            raise ProblemError(f"{where} is a law of the slip, and the {what} needs one of its rate; say of = 'rate'")
        known = friction.of is not None or MemoryChain(contact.remembers).of_slip
        if known or not friction.acts or not index.size:
            continue
        if not homogeneous(with_friction(problem.law.take(index), where).friction.profile):
            raise ProblemError(
                f"{where} depends on a length: in time it may be a law of the slip or of its rate; say of = 'slip', as "
                "in statics, or of = 'rate'"
            )


def _heat(
    evolution: Evolution, stated: ContactProblem, problem: DiscreteProblem, moved: IntArray
) -> DiscreteHeat | None:
    """The heat of a body, if there is any."""
    if evolution.heat is None:
        return None
    assert evolution.conduction is not None
    conduction = discretize_evolution(evolution.conduction)
    parts = coupling(stated, evolution.heat, problem, moved, conduction.problem.contact)
    return DiscreteHeat(evolution.heat, conduction, *parts)


def _redistributed(mass: Operator, problem: DiscreteProblem, moved: IntArray) -> Operator:
    """The mass without that of contact unknowns, which goes to what they share cells with, moved supports as well.

    What an unknown shares with a node is a length: that of its entries with all components there, for those of contact
    points are turned along their normals.
    """
    field, n = problem.field, mass.unknowns
    assert field is not None
    whole = (
        sp.csr_array(sp.block_array([[mass.inner, mass.coupling], [mass.coupling.T, mass.held]]))
        if moved.size
        else mass.inner
    )
    massless = np.zeros(whole.shape[0], dtype=bool)
    massless[problem.contact.trace.indices] = True
    own = field.own
    node = np.concatenate([own.indices[own.indptr[:-1]], moved]) // field.components
    spread = _spread(whole, massless, node)
    if not moved.size:
        return replace(mass, inner=spread)
    inner = spread[:n, :n]
    assert inner.nnz == mass.inner.nnz  # nothing is joined that was not, and zeros stay
    return replace(mass, inner=inner, coupling=spread[:n, n:], held=spread[n:, n:])


def _spread(M: sp.csr_array, massless: Array, node: IntArray) -> sp.csr_array:
    """A mass matrix without some of its rows, whose mass goes to the others; ``node`` is that of each row."""
    n = M.shape[0]
    rows = np.repeat(np.arange(n), np.diff(M.indptr))
    inside = ~massless[rows] & ~massless[M.indices]
    kept = np.where(inside, M.data, 0.0)
    squares = sp.csr_array(
        (np.where(inside, 0.0, M.data**2), node[M.indices], M.indptr.copy()), shape=(n, int(node.max(initial=0)) + 1)
    )
    squares.sum_duplicates()
    size, of = np.sqrt(squares.data), np.repeat(np.arange(n), np.diff(squares.indptr))
    # What a row of the kept ones loses to massless columns, and these rows themselves, are given to the diagonal.
    own = np.bincount(of, np.where(massless[of], size, 0.0), minlength=n)
    lost = np.bincount(of, np.where(massless[of], 0.0, size), minlength=n)
    # What a kept row shares with an unknown: the part of its length to the node that lies along it.
    shared, across = np.zeros(M.nnz), ~massless[rows] & massless[M.indices]
    _, group = np.unique(rows[across] * squares.shape[1] + node[M.indices[across]], return_inverse=True)
    length = np.sqrt(np.bincount(group, M.data[across] ** 2))[group]
    np.divide(M.data[across] ** 2, length, out=length, where=length > 0.0)
    shared[across] = length
    share = sp.csr_array((shared, M.indices, M.indptr), shape=M.shape)
    weight = np.asarray(share.sum(axis=0)).ravel()  # of each massless unknown, over its neighbours with mass
    given = share @ np.where(weight > 0.0, own / np.where(weight > 0.0, weight, 1.0), 0.0)
    diagonal = rows == M.indices
    kept[diagonal] += np.where(massless, 0.0, lost + given)[rows[diagonal]]
    return sp.csr_array((kept, M.indices, M.indptr), shape=M.shape)


class StepMatrices:
    """Bodies of stages: one for each set of factors of a step, with a stiffness that a workspace knows again."""

    def __init__(self, discrete: DiscreteEvolution) -> None:
        self.discrete = discrete
        self._slow: tuple[Model, float, Model] | None = None
        self._made: Recent[tuple[float, ...], DiscreteProblem] = Recent(KEPT)
        self._tried: Model | None = None

    def body(self, viscous: float, inert: float, *branches: float, keep: bool = True) -> DiscreteProblem:
        """The problem of a body with stiffness ``K + viscous C + inert M + sum branches_i K_i``, without load."""
        alone = self.discrete.viscosity is None and self.discrete.mass is None
        key = branches if alone else (viscous, inert, *branches)  # an elastic body is the same in all steps

        def make() -> DiscreteProblem:
            return self._make(viscous, inert, branches)

        return self._made.once(key, make) if keep else make()

    def slower(self, problem: DiscreteProblem, resistance: float) -> DiscreteProblem:
        """The problem with a stiffness that is larger by a factor: one step against a resistance in the energy norm."""
        factor = 1.0 + resistance
        if isinstance(problem.bulk, Potential):
            assert isinstance(problem.model.parts, Composition)
            slow = replace(problem.model.parts, scale=factor).model(problem.model.resisted)
        else:
            slow = self._stiffer(problem, resistance, lambda K: combined([(factor, K)]), factor)
        return problem.fitted(slow)

    def on_its_foundation(self, problem: DiscreteProblem, alpha: float) -> tuple[DiscreteProblem, sp.csr_array]:
        """The problem with springs ``alpha`` (force per area and length) at all contact points, and their stiffness."""
        contact = problem.contact

        def with_springs(K: sp.csr_array) -> sp.csr_array:
            weights = np.repeat(alpha * contact.weights, contact.components)
            return sp.csr_array(K + contact.trace.T @ sp.diags_array(weights) @ contact.trace)

        slow = self._stiffer(problem, -alpha, with_springs)
        return problem.fitted(slow), sp.csr_array(slow.linear.stiffness - problem.stiffness)

    def _stiffer(
        self, problem: DiscreteProblem, key: float, make: Callable[[sp.csr_array], sp.csr_array], factor: float = 1.0
    ) -> Model:
        """The model of a problem with another stiffness, on coarser meshes times a factor; the last is known again."""
        known, model = self._slow, problem.model
        if known is None or known[0] is not model or known[1] != key:
            bulk = Quadratic(make(problem.stiffness), assembled=True)
            parts = (
                None
                if not isinstance(model.parts, Composition)
                else replace(model.parts, scale=factor * model.parts.scale)
            )
            known = self._slow = model, key, replace(model, bulk=bulk, parts=parts)
        return known[2]

    def stage_problem(
        self, base: DiscreteProblem, load: Array, offset: Array, law: VectorLaw, displacement: Array
    ) -> DiscreteProblem:
        """One of the bodies under a load (n,), with other offsets (m, c) and another law.

        Load and offset are read-only from now on.  A body that is not linear has its energy from a displacement
        ``displacement`` (n + k,) on, in which it is at unknowns zero.
        """
        load.flags.writeable = offset.flags.writeable = False
        first = self._tried is not base.model  # the first law is tried out; others of the same points follow it
        self._tried = base.model
        model = base.model
        if isinstance(model.bulk, Potential):
            assert isinstance(model.parts, Composition)
            model = replace(model.parts, place=self.discrete.full(displacement)).model(model.resisted)
        problem = base.fitted(model, Loading(load, offset, law))
        return replace(problem) if first else problem

    def _make(self, viscous: float, inert: float, branches: tuple[float, ...]) -> DiscreteProblem:
        discrete = self.discrete
        base = discrete.problem
        # An elastic body asks for neither, whatever the scheme multiplies them with.
        viscous = viscous if discrete.viscosity is not None else 0.0
        inert = inert if discrete.mass is not None else 0.0
        parts = Composition(discrete.family, viscous, inert, branches)
        # The load of each step is another one, and steps go downhill by themselves: nothing is shown.
        return DiscreteProblem(
            parts.model(discrete.mass is not None or discrete.stores),
            Loading(np.zeros(base.unknowns), base.offset, base.law),
            base.warnings,
            None,
            True,
        )
