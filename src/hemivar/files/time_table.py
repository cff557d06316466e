"""The tables [time] and [output] of a problem file, read and written: how it goes through time, and what is kept."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType

from hemivar.basics.stated import keys_of, stated_fields
from hemivar.evolution.control import DISSIPATION, Control
from hemivar.evolution.march_state import Checkpoint
from hemivar.evolution.plan import March
from hemivar.evolution.save import Save
from hemivar.evolution.schemes import Scheme
from hemivar.evolution.schemes.by_name import SCHEMES
from hemivar.evolution.steps import AdaptiveStep, FixedStep, StepSizeController
from hemivar.files.not_expressible import not_expressible
from hemivar.files.quantities import entries_record, quantity_record
from hemivar.files.schema import decode, encode, read_value
from hemivar.files.settings import OutputSettings, TimeSettings
from hemivar.files.toml import KEYS, TomlTable, context, kind
from hemivar.mechanics.material_words import ScalarKind
from hemivar.mesh import Mesh

__all__ = ["output_record", "read_in_time", "time_record"]

#: Lengths of adaptive steps by key and by field, in their order.
_LENGTHS = (("min", "least"), ("first", "first_step"), ("max", "most"))
#: What the state at the beginning is called: of a body, and of scalar problems.
_INITIAL: Mapping[ScalarKind | None, tuple[str, ...]] = MappingProxyType(
    {
        None: ("displacement", "velocity"),
        ScalarKind.MEMBRANE: ("deflection", "velocity"),
        ScalarKind.ANTIPLANE: ("displacement", "velocity"),
        ScalarKind.HEAT: ("temperature",),
    }
)


def read_in_time(
    top: TomlTable, mesh: Mesh, inert: bool, scalar: ScalarKind | None = None
) -> tuple[TimeSettings | None, OutputSettings]:
    """The tables [time] and [output] of a body that has a density or not, or of a scalar problem of some kind."""
    if "steps" in top:
        return _in_steps(top, mesh)
    if "time" not in top:
        if "output" in top:
            raise top.error("output", "says what is saved during time integration; add a table [time], or remove it")
        return None, OutputSettings()
    table = top.table("time", KEYS["time"])
    if "until" not in table:
        raise table.error("until", "is missing; give the end of time, which begins at 0")
    plan = decode(March, table, step=_step, scheme=_scheme, stops=_stops, control=_control)
    begin = decode(TimeSettings, table, initial=lambda given: _initial(given, mesh.dim, scalar))
    _check(table, plan.get("scheme"), begin.get("inertia", False), inert, scalar)
    if "velocity" in begin.get("initial", ()) and not begin.get("inertia"):
        what = "is given to bodies with inertia only; add inertia = true, or remove it"
        raise table.error("initial.velocity", what)
    march, files = _with_output(top, mesh, March(**plan))
    return TimeSettings(march, **begin), files


def _in_steps(top: TomlTable, mesh: Mesh) -> tuple[TimeSettings, OutputSettings]:
    """The way through the load steps of a file."""
    if "time" in top:
        raise top.error("time", "goes without steps, which have no duration; remove one of the two")
    given = top.data["steps"]
    march, files = _with_output(top, mesh, March(float(len(given)) if isinstance(given, list) else 1.0))
    return TimeSettings(march), files


def _with_output(top: TomlTable, mesh: Mesh, plan: March) -> tuple[March, OutputSettings]:
    """A plan with what the table [output] says."""
    output = top.table("output", KEYS["output"])
    kept = decode(Save, output, probes=lambda given: _probes(given, mesh.dim))
    checkpoint = _checkpoint(output) if "checkpoint" in output else None
    march = replace(plan, save=Save(**kept), checkpoint=checkpoint)
    return march, OutputSettings(**decode(OutputSettings, output))


def _check(table: TomlTable, scheme: Scheme | None, inertia: bool, inert: bool, scalar: ScalarKind | None) -> None:
    """Refuse inertia where there is no mass, and what needs it where there is none."""
    if inertia:
        if scalar is ScalarKind.HEAT:
            raise table.error(
                "inertia", "is for bodies, and heat has none; remove it, and give a capacity in [material]"
            )
        if not inert:
            raise table.error("inertia", "needs a density; add density to [material], to every region of it")
        if scheme is not None and not scheme.takes_mass:
            what = "is for bodies without inertia; write generalized-alpha or midpoint"
            raise table.error("scheme", f"'{scheme.name}' {what}")
        return
    if scheme is not None and scheme.needs_mass:
        what = "is for bodies with inertia; add inertia = true, or write sdirk2"
        raise table.error("scheme", f"'{scheme.name}' {what}")


def _initial(table: TomlTable, dim: int, scalar: ScalarKind | None) -> dict[str, object]:
    """What there is at the beginning, by the names of :class:`Evolution`."""
    start = table.table("initial", _INITIAL[scalar], inline=True)
    read = start.vector if scalar is None else start.quantity
    return {
        name: read(key, start.data[key], dim)
        for key, name in zip(_INITIAL[scalar], _INITIAL[None], strict=False)
        if key in start
    }


def _stops(table: TomlTable) -> tuple[float, ...]:
    value, until = table.data["stops"], table.positive("until")
    if not isinstance(value, list):
        raise table.error("stops", f"must be a list of times, not {kind(value)}")
    stops = tuple(table.number("stops", time) for time in value)
    for stop in stops:
        if not 0.0 < stop < until:
            raise table.error("stops", f"names {stop:g}; give times between 0 and until = {until:g}")
    return stops


def _step(table: TomlTable) -> StepSizeController:
    value, until = table.data["step"], table.positive("until")
    if not isinstance(value, dict):
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise table.error("step", f"must be a number or {{ rtol = 1e-3, ... }}, not {kind(value)}")
        step = table.positive("step")
        if step > until:
            raise table.error("step", f"is {step:g}, longer than the whole time {until:g}; give a shorter one")
        return FixedStep(step)
    given = table.table("step", keys_of(AdaptiveStep), inline=True)
    if "rtol" not in given:
        raise given.error("rtol", "is missing; give the tolerance of a step's error, or write step = NUMBER")
    values = decode(AdaptiveStep, given)
    lengths = [(key, values[name]) for key, name in _LENGTHS if name in values]
    for (name, less), (other, more) in itertools.pairwise(lengths):
        if less > more:
            raise given.error(name, f"is {less:g}, more than {other} = {more:g}; exchange them")
    for key, length in lengths:
        if key != "max" and length > until:
            raise given.error(key, f"is {length:g}, longer than the whole time {until:g}; give a shorter one")
    with context(f"{table.where('step')}:"):
        return AdaptiveStep(**values)


def _scheme(table: TomlTable) -> Scheme:
    value = table.data["scheme"]
    if isinstance(value, str):
        return SCHEMES[table.text("scheme", None, list(SCHEMES))]
    if not isinstance(value, dict):
        raise table.error("scheme", f'must be a name or {{ name = "generalized-alpha", rho = 0.8 }}, not {kind(value)}')
    given = table.table("scheme", None, inline=True)
    if "name" not in given:
        raise given.error("name", f"is missing; write one of {', '.join(SCHEMES)}")
    scheme = SCHEMES[given.text("name", None, list(SCHEMES))]
    given.only(("name", *keys_of(scheme)))
    with context(f"{table.where('scheme')}:"):
        return replace(scheme, **decode(scheme, given))


def _control(table: TomlTable) -> Control:
    value = table.data["control"]
    if not isinstance(value, dict):
        if not isinstance(value, str):
            raise table.error("control", f'must be "{DISSIPATION}" or {{ opening = "boundary" }}, not {kind(value)}')
        table.text("control", None, [DISSIPATION])
        return Control()
    given = table.table("control", ("opening",), inline=True)
    if "opening" not in given:
        raise given.error("opening", "is missing; name a contact boundary")
    return Control(given.text("opening", None))


def _probes(table: TomlTable, dim: int) -> Mapping[str, tuple[float, ...]]:
    probes = table.table("probes", None, inline=True)
    what = f"a list of {dim} numbers, the place of the probe"
    return MappingProxyType({name: probes.numbers(name, dim, what) for name in probes.data})


def _checkpoint(table: TomlTable) -> Checkpoint:
    if isinstance(table.data["checkpoint"], dict):
        given = table.table("checkpoint", keys_of(Checkpoint), inline=True)
        return Checkpoint(**decode(Checkpoint, given))
    _, stated = stated_fields(Checkpoint)["file"]
    return Checkpoint(read_value(table, "checkpoint", stated))  # type: ignore[arg-type]


def time_record(time: TimeSettings, scalar: ScalarKind | None = None) -> dict[str, object]:
    """The table [time]."""

    def initial(start: Mapping[str, object]) -> dict[str, object]:
        write = entries_record if scalar is None else quantity_record
        names = dict(zip(_INITIAL[None], _INITIAL[scalar], strict=False))
        return {names[name]: write(value, f"time.{names[name]}") for name, value in start.items()}

    march = encode(
        time.march,
        "time",
        step=_step_record,
        scheme=lambda one: {"name": one.name} | own if (own := encode(one)) else one.name,
        stops=list,
        control=lambda given: given.stated,
    )
    return march | encode(time, "time", initial=initial)


def _step_record(step: StepSizeController) -> object:
    if isinstance(step, FixedStep):
        return step.step
    if isinstance(step, AdaptiveStep):
        return {"rtol": step.rtol} | encode(step)
    raise not_expressible("time.step", step, "a length, or an error control by rtol, first, min and max")


def output_record(march: March, files: OutputSettings) -> dict[str, object]:
    """The table [output]."""
    record = encode(march.save, probes=lambda points: {name: list(point) for name, point in points.items()})
    record |= encode(files)
    if isinstance(march.checkpoint, Checkpoint):
        kept = encode(march.checkpoint)
        record["checkpoint"] = kept if len(kept) > 1 else kept["file"]
    return record
