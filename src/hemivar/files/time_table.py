"""The tables [time] and [output] of a problem file, read and written: how it goes through time, and what is kept."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

from hemivar.evolution.jumps import SelectionRule
from hemivar.files.quantities import entries_record, quantity_record
from hemivar.files.toml import TomlTable, kind
from hemivar.mechanics.conditions import ScalarData, VectorData
from hemivar.mechanics.scalar import ScalarKind
from hemivar.mesh import Mesh

__all__ = [
    "INITIAL",
    "JUMPS",
    "SCHEMES",
    "CheckpointSettings",
    "OutputSettings",
    "SchemeSettings",
    "StepSettings",
    "TimeSettings",
    "output_record",
    "read_output",
    "read_time",
    "time_record",
]

#: Schemes by name, with the ranges of their parameters.
SCHEMES: Mapping[str, Mapping[str, tuple[float, float]]] = MappingProxyType(
    {
        "implicit-euler": {},
        "midpoint": {},
        "newmark": {"beta": (0.0, 0.5), "gamma": (0.5, 1.0)},
        "generalized-alpha": {"rho": (0.0, 1.0)},
        "sdirk2": {},
        "bdf2": {},
        "moreau-jean": {"restitution": (0.0, 1.0), "theta": (0.5, 1.0)},
    }
)
#: What may happen where the margin is lost with nothing viscous.
JUMPS = tuple(jump.value for jump in SelectionRule)
#: What the state at the beginning is called: of a body, and of scalar problems.
INITIAL: Mapping[ScalarKind | None, tuple[str, ...]] = MappingProxyType(
    {
        None: ("displacement", "velocity"),
        ScalarKind.MEMBRANE: ("deflection", "velocity"),
        ScalarKind.ANTIPLANE: ("displacement", "velocity"),
        ScalarKind.HEAT: ("temperature",),
    }
)
_FIELDS = (".pvd", ".xdmf")
_ANIMATIONS = (".gif", ".mp4")
_TABLES = (".csv", ".parquet")


@dataclass(frozen=True)
class StepSettings:
    """Steps whose length follows an error control.

    Attributes
    ----------
    rtol : float
        Relative tolerance of the error of a step.
    first, min, max : float or None
        Lengths of the first step, and of the smallest and the largest one.
    """

    rtol: float
    first: float | None = None
    min: float | None = None
    max: float | None = None


@dataclass(frozen=True)
class SchemeSettings:
    """A scheme by name, with those of its parameters that are given.

    Attributes
    ----------
    name : str
        One of :data:`SCHEMES`.
    parameters : mapping of name to float
    """

    name: str
    parameters: Mapping[str, float] = field(default_factory=lambda: MappingProxyType({}))


@dataclass(frozen=True, eq=False)
class TimeSettings:
    """What the table ``[time]`` of a problem file says; ``None`` where it says nothing.

    Attributes
    ----------
    until : float
        The end of time, which begins at 0.
    step : float, StepSettings or None
        Length of all steps, or their control.
    scheme : SchemeSettings or None
    inertia : bool
    displacement, velocity : vector, shape (d,), callable or None
        At the beginning; of one component a number or a function of the place.
    jump : str or None
        One of :data:`JUMPS`.
    stops : tuple of float
        Times at which a step ends exactly.
    """

    until: float
    step: float | StepSettings | None = None
    scheme: SchemeSettings | None = None
    inertia: bool = False
    displacement: VectorData | ScalarData | None = None
    velocity: VectorData | ScalarData | None = None
    jump: str | None = None
    stops: tuple[float, ...] = ()


@dataclass(frozen=True)
class CheckpointSettings:
    """Where and how often the state is kept, so that a run can be resumed.

    Attributes
    ----------
    file : str
    minutes : float or None
    """

    file: str
    minutes: float | None = None


@dataclass(frozen=True)
class OutputSettings:
    """What the table ``[output]`` of a problem file asks for; ``None`` where it says nothing.

    Attributes
    ----------
    every : float or None
        Time between two states that are kept.
    fields, animation, table : str or None
        Names of files.
    checkpoint : CheckpointSettings or None
    probes : mapping of name to point
    """

    every: float | None = None
    fields: str | None = None
    animation: str | None = None
    table: str | None = None
    checkpoint: CheckpointSettings | None = None
    probes: Mapping[str, tuple[float, ...]] = field(default_factory=lambda: MappingProxyType({}))


# ---- [time] -----------------------------------------------------------------------------------------------


def read_time(table: TomlTable, mesh: Mesh, inert: bool, scalar: ScalarKind | None = None) -> TimeSettings:
    """The table [time] of a body that has a density or not, or of a scalar problem of some kind."""
    if "until" not in table:
        raise table.error("until", "is missing; give the end of time, which begins at 0")
    until = table.positive("until")
    step = _step(table, until)
    scheme = _scheme(table) if "scheme" in table else None
    inertia = table.data.get("inertia", False)
    if not isinstance(inertia, bool):
        raise table.error("inertia", f"must be true or false, not {kind(inertia)}")
    if inertia and scalar is ScalarKind.HEAT:
        raise table.error("inertia", "is for bodies, and heat has none; remove it, and give a capacity in [material]")
    if inertia and not inert:
        raise table.error("inertia", "needs a density; add density to [material], to every region of it")
    if scheme is not None and scheme.name == "sdirk2" and inertia:
        raise table.error("scheme", "'sdirk2' is for bodies without inertia; write generalized-alpha or midpoint")
    if scheme is not None and scheme.name in ("newmark", "moreau-jean") and not inertia:
        raise table.error("scheme", f"'{scheme.name}' is for bodies with inertia; add inertia = true, or write sdirk2")
    names = INITIAL[scalar]
    start = table.table("initial", names, inline=True)
    found = {
        key: start.vector(key, value, mesh.dim) if scalar is None else start.quantity(key, value, mesh.dim)
        for key, value in start.data.items()
    }
    if "velocity" in found and not inertia:
        raise start.error("velocity", "is given to bodies with inertia only; add inertia = true, or remove it")
    jump = table.text("jump", None, JUMPS) if "jump" in table else None
    stops = _stops(table, until) if "stops" in table else ()
    return TimeSettings(until, step, scheme, inertia, found.get(names[0]), found.get("velocity"), jump, stops)


def _stops(table: TomlTable, until: float) -> tuple[float, ...]:
    value = table.data["stops"]
    if not isinstance(value, list):
        raise table.error("stops", f"must be a list of times, not {kind(value)}")
    stops = tuple(table.number("stops", time) for time in value)
    for stop in stops:
        if not 0.0 < stop < until:
            raise table.error("stops", f"names {stop:g}; give times between 0 and until = {until:g}")
    return stops


def _step(table: TomlTable, until: float) -> float | StepSettings | None:
    value = table.data.get("step")
    if value is None:
        return None
    if not isinstance(value, dict):
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise table.error("step", f"must be a number or {{ rtol = 1e-3, ... }}, not {kind(value)}")
        step = table.positive("step")
        if step > until:
            raise table.error("step", f"is {step:g}, longer than the whole time {until:g}; give a shorter one")
        return step
    given = table.table("step", ("rtol", "first", "min", "max"), inline=True)
    if "rtol" not in given:
        raise given.error("rtol", "is missing; give the tolerance of a step's error, or write step = NUMBER")
    found = {key: given.positive(key) for key in given.data}
    if not found["rtol"] < 1.0:
        raise given.error("rtol", f"is {found['rtol']:g}; it must be smaller than 1")
    order = [key for key in ("min", "first", "max") if key in found]
    for one, other in itertools.pairwise(order):
        if found[one] > found[other]:
            raise given.error(one, f"is {found[one]:g}, more than {other} = {found[other]:g}; exchange them")
    for key in order[:-1] if "max" in found else order:
        if found[key] > until:
            raise given.error(key, f"is {found[key]:g}, longer than the whole time {until:g}; give a shorter one")
    return StepSettings(found["rtol"], found.get("first"), found.get("min"), found.get("max"))


def _scheme(table: TomlTable) -> SchemeSettings:
    value = table.data["scheme"]
    if isinstance(value, str):
        return SchemeSettings(table.text("scheme", None, list(SCHEMES)))
    if not isinstance(value, dict):
        raise table.error("scheme", f'must be a name or {{ name = "generalized-alpha", rho = 0.8 }}, not {kind(value)}')
    given = table.table("scheme", None, inline=True)
    if "name" not in given:
        raise given.error("name", f"is missing; write one of {', '.join(SCHEMES)}")
    name = given.text("name", None, list(SCHEMES))
    given.only(("name", *SCHEMES[name]))
    parameters = {}
    for key, (least, most) in SCHEMES[name].items():
        if key in given:
            number = given.number(key, value[key])
            if not least <= number <= most:
                raise given.error(key, f"is {number:g}; it must lie between {least:g} and {most:g}")
            parameters[key] = number
    return SchemeSettings(name, MappingProxyType(parameters))


def time_record(time: TimeSettings, scalar: ScalarKind | None = None) -> dict[str, object]:
    """The table [time]."""
    record: dict[str, object] = {"until": time.until}
    if isinstance(time.step, StepSettings):
        record["step"] = {key: value for key, value in vars(time.step).items() if value is not None}
    elif time.step is not None:
        record["step"] = time.step
    if time.scheme is not None:
        parameters = dict(time.scheme.parameters)
        record["scheme"] = {"name": time.scheme.name} | parameters if parameters else time.scheme.name
    if time.inertia:
        record["inertia"] = True
    initial = {
        key: entries_record(value, f"time.{key}") if scalar is None else quantity_record(value, f"time.{key}")
        for key, value in zip(INITIAL[scalar], (time.displacement, time.velocity), strict=False)
        if value is not None
    }
    if initial:
        record["initial"] = initial
    if time.jump is not None:
        record["jump"] = time.jump
    return record | {"stops": list(time.stops)} if time.stops else record


# ---- [output] ---------------------------------------------------------------------------------------------


def read_output(table: TomlTable, mesh: Mesh) -> OutputSettings:
    """The table [output]."""
    probes = table.table("probes", None, inline=True)
    what = f"a list of {mesh.dim} numbers, the place of the probe"
    return OutputSettings(
        every=table.positive("every") if "every" in table else None,
        fields=_file(table, "fields", _FIELDS),
        animation=_file(table, "animation", _ANIMATIONS),
        table=_file(table, "table", _TABLES),
        checkpoint=_checkpoint(table) if "checkpoint" in table else None,
        probes=MappingProxyType({name: probes.numbers(name, mesh.dim, what) for name in probes.data}),
    )


def _file(table: TomlTable, key: str, endings: tuple[str, ...]) -> str | None:
    if key not in table:
        return None
    name = table.text(key)
    if not any(name.endswith(ending) and name != ending for ending in endings):
        raise table.error(key, f"is '{name}'; give the name of a file that ends in {' or '.join(endings)}")
    return name


def _checkpoint(table: TomlTable) -> CheckpointSettings:
    value = table.data["checkpoint"]
    if isinstance(value, dict):
        given = table.table("checkpoint", ("file", "minutes"), inline=True)
        if "file" not in given:
            raise given.error("file", "is missing; give the name of the checkpoint")
        minutes = given.number("minutes", value["minutes"]) if "minutes" in given else None
        if minutes is not None and minutes < 0.0:
            raise given.error("minutes", f"is {minutes:g}; give a time of at least 0, which is after every step")
        found = CheckpointSettings(given.text("file"), minutes)
    else:
        found = CheckpointSettings(table.text("checkpoint"))
    if not found.file.strip():
        raise table.error("checkpoint", "has an empty name; give the name of a file")
    return found


def output_record(output: OutputSettings) -> dict[str, object]:
    """The table [output]."""
    names = ("every", "fields", "animation", "table")
    record: dict[str, object] = {key: getattr(output, key) for key in names if getattr(output, key) is not None}
    if output.checkpoint is not None:
        kept = {key: value for key, value in vars(output.checkpoint).items() if value is not None}
        record["checkpoint"] = kept if len(kept) > 1 else output.checkpoint.file
    if output.probes:
        record["probes"] = {name: list(place) for name, place in output.probes.items()}
    return record
