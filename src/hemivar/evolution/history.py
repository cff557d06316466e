"""The time series of an evolution: a table with a row for each step, and the body at some times."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, fields
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from hemivar.basics.arguments import number
from hemivar.basics.defined_above import above
from hemivar.basics.display import ReprMixin, brief
from hemivar.basics.first_use import cached_property
from hemivar.basics.portable import PickleMixin
from hemivar.basics.rows import Claim, Column, ResultRows, plain
from hemivar.basics.types import Array, IntArray, Record
from hemivar.errors import ProblemError
from hemivar.evolution.discrete import DiscreteEvolution
from hemivar.evolution.state import EnergyBalance, TimeState
from hemivar.evolution.time_error import TimeError
from hemivar.laws import VectorLaw
from hemivar.laws.memory import MemoryChain
from hemivar.laws.vector_law import weak_convexity_at

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["Frame", "History", "Row", "damage_of", "law_at", "quantity_of", "remembered"]


@dataclass(frozen=True)
class Row:
    """One line of the table."""

    time: float
    step: float
    #: Steps of the method in all stages; those of the last round where a step iterates wear, heat and the like.
    solver_steps: int
    #: Relative residual.
    residual: float
    #: Smallness margin of the step's problem: positive if it has one solution only.
    margin: float
    #: Largest step with a positive margin; nan where it was not looked for.
    largest_step: float
    #: Forces, contact measure, probes and the ledger by name; where a friction bound depends on the solution also
    #: ``fallbacks``, how often Newton's equation alone did not solve the step.
    values: Mapping[str, float]
    jumped: bool = False


@dataclass(frozen=True, eq=False)
class Frame(PickleMixin):
    """The body at one time."""

    time: float
    displacement: Array  # (nodes, d)
    velocity: Array  # (nodes, d)
    #: At the contact points penetration and slip, the force per area of the body on the foundation, which is the
    #: pressure (column 0) and minus the friction, and the velocity of penetration and slip.
    local: Array  # (m, c)
    multiplier: Array  # (m, c)
    rate: Array  # (m, c)
    #: The time that the force belongs to.
    force_time: float
    #: What the contact points remember by name, nan elsewhere. Glue: ``0.opening``, the largest effective opening,
    #: ``0.stiffness``, the secant from there to rest, and of two fracture energies ``0.mode``, that of the onset of
    #: damage, -1 before it. The damage is :attr:`History.damage`.
    memory: Mapping[str, Array] = field(default_factory=dict)  # (m, ...)
    #: Of a body with heat.
    temperature: Array | None = None  # (nodes,)
    #: The time whose loads, supports and gaps act: the time itself, where that is no answer.
    load_factor: float = math.nan

    __repr__ = brief


@dataclass(frozen=True, eq=False)
class History(PickleMixin, ReprMixin):
    """An evolution that was computed.

    ``history["normal_force"]`` is a column of the table; ``history.times`` the times of its rows, the steps.

    Attributes
    ----------
    discrete : DiscreteEvolution
    steps : tuple of Row
        The first is the initial state.
    frames : tuple of Frame
        What was saved.
    state : TimeState
        Where it ended.
    ended : str
        ``"finished"``, or what ended it before: the status of a step that could not be solved, ``"broken"`` where
        contact no longer holds the body and it comes to rest nowhere, ``"refused"`` where the statement makes no sense
        from there on, ``"max_time"``, ``"interrupted"``, ``"margin lost"``, ``"event: NAME"``.
        ``"energy made"``: it reached its end, and the scheme made more than half of the energy that loads, supports and
        the initial state gave, where that moves the body on.
    events : tuple of (time, name)
    messages : tuple of str
        What the numbers do not show by themselves.
    time_error : TimeError
        How far the end is from the solution that is continuous in time, where a theorem says it.
    unkept : str
        Why the checkpoint could not be written in the end; empty if it was, and if none was asked for.

    Examples
    --------
    >>> import hemivar as hv
    >>> history = hv.march(hv.gallery.bouncing_block(), until=0.1, step=0.05)
    >>> history.ended, len(history.steps)
    ('finished', 3)
    """

    discrete: DiscreteEvolution
    steps: tuple[Row, ...]
    frames: tuple[Frame, ...]
    state: TimeState
    ended: str = "finished"
    events: tuple[tuple[float, str], ...] = ()
    messages: tuple[str, ...] = ()
    time_error: TimeError = field(default_factory=lambda: TimeError("", math.nan, "not looked for"))
    unkept: str = ""

    def __repr__(self) -> str:
        return (
            f"History({len(self.taken)} steps to t = {self.state.time:g}, {self.ended}; "
            f"least margin {self.margin:.3g}, largest residual {self.residual:.2g}, {len(self.frames)} frames)"
        )

    @property
    def taken(self) -> tuple[Row, ...]:
        """The rows of steps: all but that of the start, which is the first of load steps."""
        return self.steps if self.discrete.evolution.steps else self.steps[1:]

    @property
    def finished(self) -> bool:
        """Whether it reached its end."""
        return self.ended == "finished"

    @cached_property
    def times(self) -> Array:
        """Times of the rows."""
        return np.array([row.time for row in self.steps])

    @cached_property
    def damage(self) -> Array:
        """Damage of glue by frame and contact point, (frames, m): 0 intact, 1 broken; nan where it is not known.

        It is the share of the first stiffness that is lost, which glue keeps while it closes and opens again.
        """
        return np.array([damage_of(self.discrete, frame) for frame in self.frames])

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of all columns."""
        return (*_OWN, *self.steps[0].values)

    def __getitem__(self, name: str) -> Array:
        if name in _OWN:
            return np.array([getattr(row, name) for row in self.steps], dtype=float)
        if name not in self.steps[0].values:
            raise ProblemError(f"the history has no column '{name}' (known: {', '.join(self.columns)})")
        return np.array([row.values[name] for row in self.steps])

    def rows(self) -> ResultRows:
        """A row for each step, the initial state first; ``solver_steps``, ``fallbacks`` and ``jumped`` are whole."""
        columns = ((name, self[name].astype(np.int64) if name in _WHOLE else self[name]) for name in self.columns)
        return ResultRows(tuple(Column(name, values, name, unit=quantity_of(name)) for name, values in columns))

    @cached_property
    def table(self) -> Any:
        """All rows as a numpy structured array."""
        out = np.empty(len(self.steps), dtype=[(name, float) for name in self.columns])
        for name in self.columns:
            out[name] = self[name]
        return out

    @property
    def ledger(self) -> Mapping[str, float]:
        """Energies at the end, and all work and losses."""
        thermal = {} if self.state.heat is None else {"thermal": self.state.ledger.thermal}
        return {**self.state.ledger.record(), **thermal}

    @property
    def margin(self) -> float:
        """Least margin of all steps; inf if none was taken."""
        return min((row.margin for row in self.taken if not np.isnan(row.margin)), default=np.inf)

    @property
    def uniqueness(self) -> str:
        """What the margins say of the solutions of the steps, in words: whether each has one only is said if proved."""
        margins = np.array([row.margin for row in self.taken])
        if not len(margins):
            return "no step was taken"
        lost = int(np.count_nonzero(~(margins > 0.0)))
        contacts, problem = self.discrete.contacts.values(), self.discrete.problem
        law = problem.law
        if lost:
            why = ""
            if np.isinf(law.lipschitz).any():
                why = ": a friction bound that depends on the pressure, as Coulomb's, or jumps has no uniqueness margin"
            elif any(np.isinf(alpha).any() for alpha in weak_convexity_at(law, -problem.offset)):
                why = ": a law that drops discontinuously has no uniqueness margin"
            return f"{lost} step{'s' if lost > 1 else ''} may have several solutions{why}"
        damped = [one.damping for one in contacts if one.damping is not None]
        known, unsure_bound = law.proof("alpha"), not law.proof("lipschitz").sure
        iterated = [part.name for one in contacts for part in one.remembers if part.iterates]
        if self.discrete.heat is not None:
            iterated.append("heat")
        if iterated:
            what = " and ".join(dict.fromkeys(iterated))
            return f"every step has one solution only for given {what}, which it iterates: the margin is one without it"
        if not known.sure or unsure_bound or any(not one.proof("alpha").sure for one in damped):
            if "reach" in known.doubt and not unsure_bound:
                return f"every step has one solution only if alpha of the law holds, which is {known.doubt}"
            return "every step has one solution only, as far as samples of the law show"
        return "every step has one solution only"

    def claims(self) -> list[Claim]:
        """How it ended, what the margins say, the energy balance, the error in time, events and messages."""
        steps, ledger = len(self.taken), self.ledger
        others = int(self["fallbacks"].sum()) if "fallbacks" in self.columns else 0
        solved = f"{int(self['solver_steps'].sum())} of the solver" + (f", {others} fallbacks" if others else "")
        after = f"at t = {self.state.time:g} after {steps} steps ({solved}), {len(self.frames)} frames"
        claims = [Claim("status", f"{self.ended} {after}", self.ended)]
        if not steps:
            return claims
        claims += self._load_steps()
        claims.append(Claim("worst residual", f"{self.residual:.1e}", self.residual))
        lost = "; " if self.margin <= 0.0 else ", "
        claims.append(Claim("least margin", f"{self.margin:.6g}{lost}{self.uniqueness}", self.margin))
        if "load_factor" in self.columns:
            factors = self["load_factor"]
            claims.append(Claim("load factor", f"{factors[-1]:.6g} at the end, at most {factors.max():.6g}"))
        given = [f"{ledger['work']:.6g} by loads", f"{ledger['moved']:.6g} by moved supports"]
        given += [f"{ledger['thermal']:.6g} by thermal stress"] if ledger.get("thermal") else []
        given += [f"{self.state.ledger.start:.6g} at the start"] if self.state.ledger.start else []
        claims.append(Claim("external work", ", ".join(given)))
        for label, names in _SUMS.items():
            parts = [f"{name.replace('_', ' ')} {ledger[name]:.6g}" for name in names if ledger[name] != 0.0]
            claims.append(Claim(label, ", ".join(parts) or "nothing"))
        largest, gap = max(abs(value) for name, value in ledger.items() if name != "gap"), ledger["gap"]
        part = abs(gap) / largest if largest > 0.0 else 0.0
        claims.append(Claim("balance error", f"{gap:.1e}, {part:.0e} of the largest entry", gap))
        claims.append(Claim("error in time", self.time_error.words, self.time_error.bound))
        if "error_sum" in self.columns:
            sums = self["error_sum"][-1], self["contact_error_sum"][-1]
            words = f"add up to {sums[0]:.2g} in the energy norm, {sums[1]:.2g} at the contact points"
            claims.append(Claim("errors of steps", words, sums))
        claims += [Claim("event", f"{name} at t = {when:.6g}", when) for when, name in self.events]
        return claims + [Claim("note", message) for message in self.messages]

    def _load_steps(self) -> list[Claim]:
        """What contact bears at the end of each load step."""
        ends, claims = {row.time: row for row in self.steps}, list[Claim]()
        for index, step in enumerate(self.discrete.evolution.steps, start=1):
            if (row := ends.get(float(index))) is not None:
                words = f"{index} {step.name}: {_forces(row.values)}; residual {row.residual:.1e}"
                claims.append(Claim("" if claims else "load steps", words))
        return claims

    @property
    def residual(self) -> float:
        """Largest relative residual of all steps."""
        return float(max((row.residual for row in self.taken), default=0.0))

    def at(self, time: float) -> Frame:
        """The body at a time, between two frames on a straight line.

        Raises
        ------
        ProblemError
            The time lies outside of what was saved.
        """
        if not self.frames:
            raise ProblemError("no frames were saved; march(..., save=Save(every=...)) saves them")
        known = np.array([frame.time for frame in self.frames])
        if not known[0] <= number(time, "t") <= known[-1]:
            raise ProblemError(f"t = {time:g} lies outside of what was saved, {known[0]:g} to {known[-1]:g}")
        after = int(np.searchsorted(known, time))
        if known[after] == time:
            return self.frames[after]
        first, second = self.frames[after - 1], self.frames[after]
        part = (time - first.time) / (second.time - first.time)

        def between(a: Array, b: Array) -> Array:
            return (1.0 - part) * a + part * b

        return Frame(
            time,
            between(first.displacement, second.displacement),
            between(first.velocity, second.velocity),
            between(first.local, second.local),
            between(first.multiplier, second.multiplier),
            between(first.rate, second.rate),
            (1.0 - part) * first.force_time + part * second.force_time,
            {name: between(value, second.memory[name]) for name, value in first.memory.items()},
            None if first.temperature is None else between(first.temperature, second.temperature),  # type: ignore[arg-type]
            (1.0 - part) * first.load_factor + part * second.load_factor,
        )

    def write(self, path: str | Path) -> tuple[Path, ...]:
        """Write ``.pvd`` (frames), ``.csv``, ``.parquet`` or ``.json`` (table); returns the files."""
        written: tuple[Path, ...] = above("History.write")(self, path)
        return written

    def to_dict(self) -> Record:
        """Plain numbers, texts and lists for JSON; numbers that are not finite become None.

        ``ended``, ``time`` at the end, ``steps``, ``solver_steps``, least ``margin``, largest ``residual``, ``ledger``,
        ``time_error`` (norm, bound, guaranteed, why), ``events`` (time, name), ``messages``, and ``table``: a list for
        each column; ``load_steps``, their names, where there are some.
        """
        error = self.time_error
        record = {
            "hemivar": version("hemivar"),
            "ended": self.ended,
            "time": self.state.time,
            "steps": len(self.taken),
            "solver_steps": int(self["solver_steps"].sum()),
            "margin": self.margin,
            "residual": self.residual,
            "ledger": dict(self.ledger),
            "time_error": {name: getattr(error, name) for name in ("norm", "bound", "guaranteed", "why")},
            "events": [list(event) for event in self.events],
            "messages": list(self.messages),
            "table": self.rows().by_name(),
        }
        if steps := self.discrete.evolution.steps:
            record["load_steps"] = [step.name for step in steps]
        return {key: plain(value) for key, value in record.items()}

    def to_json(self, path: str | Path) -> Path:
        """Write :meth:`to_dict` to a file that ends in ``.json``; returns its path."""
        written: Path = above("History.to_json")(self, path)
        return written

    def plot(
        self,
        kind: Literal["ledger", "forces", "loop", "map", "steps", "columns"] = "ledger",
        **options: Any,
    ) -> Figure:
        """A figure, see :func:`hemivar.report.plot_march`.

        ``"ledger"`` energies, losses and work; ``"forces"`` on the foundation and the measure of contact; ``"loop"`` a
        force over a displacement; ``"map"`` states and pressure along a boundary over time; ``"steps"`` steps,
        residuals and margins; ``"columns"`` any others.
        """
        figure: Figure = above("History.plot")(self, kind, **options)
        return figure

    def animate(self, path: str | Path, **options: Any) -> Path:
        """Write the frames as a film, ``.gif`` or ``.mp4``, see :func:`hemivar.report.animate`."""
        written: Path = above("History.animate")(self, path, **options)
        return written


def law_at(discrete: DiscreteEvolution, time: float) -> VectorLaw:
    """The law of the contact points at a time."""
    timed = "law" in discrete.evolution.problem.time_dependent
    return discrete.data_at(time).law if timed else discrete.problem.law


def remembered(discrete: DiscreteEvolution, frame: Frame) -> Iterator[tuple[IntArray, MemoryChain, dict[str, Array]]]:
    """Numbers of the contact points of each boundary that remembers, its memory, and what these points remember."""
    for name, index in discrete.blocks:
        known = {what: values[index] for what, values in frame.memory.items()}
        state = {what: values for what, values in known.items() if not np.isnan(values).any()}
        if index.size and state:
            yield index, MemoryChain(discrete.contacts[name].remembers), state


def damage_of(discrete: DiscreteEvolution, frame: Frame) -> Array:
    """Damage (m,) of glue in a frame: what is remembered, else that of the displacement; nan where it is not known."""
    law = law_at(discrete, frame.time)
    damage = law.debonding(frame.local).get("damage", np.full(len(frame.local), np.nan)).copy()
    for index, memory, state in remembered(discrete, frame):
        own = memory.damage(law.take(index), state)
        damage[index] = damage[index] if own is None else own
    return damage


def quantity_of(column: str) -> str:
    """What a column measures, as :class:`Units` names it; empty where it is a number, or a measure of the contact."""
    name = column.rpartition(".")[2]
    if name.startswith("u_") or name == "penetration":
        return "length"
    if name in ("time", "step", "largest_step", "force_time"):
        return "time"
    return "force" if name.endswith("_force") else "energy" if name in _ENERGIES else ""


#: Columns of the energy balance.
_ENERGIES = {part.name for part in fields(EnergyBalance)} - {"start"}
#: What is stored at the end, and what was dissipated until then.
_SUMS = {
    "stored": ("elastic", "branches", "contact", "kinetic"),
    "dissipated": ("viscous", "branch_loss", "friction", "damping", "memory", "numerical", "jumps"),
}
_WHOLE = ("solver_steps", "jumped", "fallbacks")
_OWN = ("time", "step", "solver_steps", "residual", "margin", "largest_step", "jumped")


def _forces(values: Mapping[str, float]) -> str:
    """Normal force and friction, on each boundary where there are several."""
    ends = ("normal_force", "friction_force")
    names = [name.removesuffix(f".{ends[0]}") for name in values if name.endswith(f".{ends[0]}")]
    if not names:
        return f"normal force {values[ends[0]]:.6g}, friction {values[ends[1]]:.6g}"
    parts = (f"{name} {values[f'{name}.{ends[0]}']:.6g}, {values[f'{name}.{ends[1]}']:.6g}" for name in names)
    return f"normal force and friction of {'; '.join(parts)}"
