"""What a problem file says beside the problem: the tables [solver], [time] and [output]."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from hemivar.basics.stated import Form, stated
from hemivar.mechanics.conditions import ScalarData, VectorData
from hemivar.solvers import METHODS

if TYPE_CHECKING:
    from hemivar.evolution.plan import March

__all__ = ["OutputSettings", "SolverSettings", "TimeSettings"]


@dataclass(frozen=True)
class SolverSettings:
    """What the ``[solver]`` table of a problem file asks for; ``None`` where it says nothing."""

    method: str | None = field(
        default=None,
        metadata=stated(
            Form.TEXT,
            "one of those listed by `hemivar methods`",
            choices=tuple(METHODS),
            left_out="`newton` or `multigrid`, by [predicted cost](methods.md#large-problems)",
        ),
    )
    rtol: float | None = field(
        default=None,
        metadata=stated(Form.NUMBER, "tolerance of the residual, relative to the load", above=0.0, left_out="`1e-9`"),
    )
    max_steps: int | None = field(
        default=None, metadata=stated(Form.WHOLE, "limit of steps", least=1, left_out="set by the method")
    )
    max_time: float | None = field(
        default=None,
        metadata=stated(
            Form.NUMBER,
            "limit of the iteration in seconds (`hemivar compare`: for each method)",
            above=0.0,
            left_out="none (60)",
        ),
    )


@dataclass(frozen=True, eq=False)
class TimeSettings:
    """What the tables ``[time]`` and ``[output]`` of a problem file say of the way through time."""

    march: March  # how the evolution is computed, and what is kept of it
    inertia: bool = field(
        default=False, metadata=stated(Form.FLAG, "whether the mass of the body counts, which needs a density")
    )
    initial: Mapping[str, VectorData | ScalarData] = field(
        default_factory=dict,
        metadata=stated(
            Form.OWN,
            "`{ displacement = [...], velocity = [...] }` at the beginning *(f)*; a velocity with inertia only",
            left_out="at rest",
        ),
    )


@dataclass(frozen=True)
class OutputSettings:
    """Files that the table ``[output]`` of a problem file asks for; ``None`` where it says nothing."""

    fields: str | None = field(
        default=None,
        metadata=stated(Form.FILE, "the displacements over time for ParaView: `.pvd`", endings=(".pvd",)),
    )
    animation: str | None = field(
        default=None, metadata=stated(Form.FILE, "`.gif` or `.mp4`", endings=(".gif", ".mp4"))
    )
    table: str | None = field(
        default=None,
        metadata=stated(
            Form.FILE, "a table with a row for each step: `.csv` or `.parquet`", endings=(".csv", ".parquet")
        ),
    )
