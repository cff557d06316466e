"""What users write in files of their own: a normal law, a friction, a scheme and a memory, and a run of the method."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

import hemivar as hv
from hemivar.basics.types import Array
from hemivar.certificates import smallness
from hemivar.evolution.schemes import RateFormula, Scheme, StageRule
from hemivar.laws import FunctionLaw, VectorLaw
from hemivar.laws.memory import Memory
from hemivar.laws.memory.contact_memory import LocalStep, kept
from hemivar.laws.parameters import positive
from hemivar.laws.parametrised import NamedLaw, columns
from hemivar.laws.piecewise import PiecewiseQuadratic

__all__ = ["answers", "numbers"]


@dataclass(frozen=True, eq=False)
class Yielding(NamedLaw):
    """A spring that weakens slowly beyond a limit."""

    stiffness: float = field(metadata=positive("stiffness", "force/length^3", 10.0))
    weakening: float = field(metadata=positive("rate of weakening", "force/length^3", 0.5))
    limit: float = field(metadata=positive("where weakening begins", "length", 0.02))
    name: ClassVar[str] = "yielding"

    def _build(self, v: Mapping[str, Array]) -> PiecewiseQuadratic:
        slopes = columns(np.zeros(1), v["stiffness"], -v["weakening"])
        return PiecewiseQuadratic(columns(np.zeros(1), v["limit"]), slopes, np.zeros((1, 2)), name=self.name)


@dataclass(frozen=True)
class Theta(Scheme):
    """Stages at a part of the step."""

    name: ClassVar[str] = "theta"
    order: ClassVar[int] = 1
    theta: float = 0.6

    def rules(self, step: float, last: float | None = None) -> tuple[StageRule, ...]:
        span = self.theta * step
        end = RateFormula(1.0 / span, 1.0 - 1.0 / self.theta)
        lifted, last_rate = RateFormula(1.0 / span**2, -1.0 / span), RateFormula(1.0 / (span * step), -1.0 / span)
        return (StageRule(self.theta, RateFormula(1.0 / span), lifted, 1.0 / self.theta, end, last_rate),)


@dataclass(frozen=True, eq=False)
class Fading(Memory):
    """A friction bound that fades with the work of friction."""

    rate: float = 5.0
    name: ClassVar[str] = "fading"

    def start(self, law: VectorLaw, r: Array) -> Mapping[str, Array]:
        return kept(work=np.zeros(len(r)))

    def law(self, law: VectorLaw, state: Mapping[str, Array], step: LocalStep) -> VectorLaw:
        parts = self.parts_of(law)
        friction = parts.friction
        bound = np.asarray(friction.bound) * np.exp(-self.rate * state["work"])
        return parts.with_parts(friction=hv.laws.Friction(bound, friction.profile, of=friction.of))

    def advance(
        self, law: VectorLaw, state: Mapping[str, Array], step: LocalStep, r: Array, lam: Array
    ) -> Mapping[str, Array]:
        slip = r[:, 1:] - step.before[:, 1:]
        return kept(work=state["work"] + np.abs((lam[:, 1:] * slip).sum(axis=1)))


WEAKENING = FunctionLaw(derivative=lambda s: 0.4 + 0.6 * np.exp(-30.0 * s), even=True, kinks=(0.0,), reach=1.0)


def pushed(points: Array, time: float) -> Array:
    return np.tile([0.3 * np.sin(6.0 * time), -0.3], (len(points), 1))


def yielding_problem(*memory: Memory, weakening: float = 0.5) -> hv.ContactProblem:
    friction = hv.laws.Friction(0.05, WEAKENING, of="rate" if memory else "slip")
    contact = hv.Contact(Yielding(10.0, weakening, 0.02), friction, memory=memory)
    return hv.ContactProblem(
        hv.rectangle((1.0, 1.0), 2),
        hv.Material.lame(4.0, 4.0),
        contact={"bottom": contact},
        supports={"left": hv.Clamped()},
        tractions={"top": pushed if memory else (0.05, -0.3)},
    )


def march(jump: str = "local", **options: object) -> hv.evolution.History:
    """Of a law that softens more than the body bears, so that every rule of a jump is asked."""
    return hv.march(hv.Evolution(yielding_problem(weakening=9.0), inertia=False), 0.5, step=0.25, jump=jump, **options)  # type: ignore[arg-type]


def numbers() -> dict[str, float]:
    """What the method answers, whatever else is installed."""
    solution = hv.solve(yielding_problem())
    constants = solution.certify().smallness
    evolution = hv.Evolution(yielding_problem(Fading()), inertia=False)
    history = hv.march(evolution, 0.4, step=0.1, scheme=Theta())
    assert (solution.status, history.ended) == (hv.Status.CONVERGED, "finished")
    return {
        "energy": solution.energy,
        "normal force": solution.normal_force,
        "margin": constants.margin,
        "c_gamma": constants.trace_constant or 0.0,
        "elastic": float(history["elastic"][-1]),
        "friction": float(history["friction"][-1]),
    }


def hooks() -> dict[str, Callable[[], object]]:
    """A call for each entry of what the method leaves to packages that use it."""
    solution, history = hv.solve(yielding_problem()), march()
    certificate = solution.certify()
    solutions: dict[str, Callable[[], object]] = {
        f"Solution.{name}": getattr(solution, name) for name in ("summary", "to_dict", "plot")
    }
    return solutions | {
        "ReprMixin._repr_html_": certificate._repr_html_,
        "ReprMixin.plot": certificate.plot,
        "ReprMixin.show": certificate.show,
        "ReprMixin.to_dataframe": certificate.to_dataframe,
        "Solution.to_json": lambda: solution.to_json("solution.json"),
        "Solution.to_vtu": lambda: solution.to_vtu("solution.vtu"),
        "History.write": lambda: history.write("history.csv"),
        "History.to_dict": history.to_dict,
        "History.to_json": lambda: history.to_json("history.json"),
        "History.to_dataframe": history.to_dataframe,
        "History.plot": history.plot,
        "History.animate": lambda: history.animate("film.gif"),
        "certificate.certify": lambda: solution.certify(exact=True),
        "stage_solver.follow_minimisers": lambda: march("arc-length"),
        "stage_solver.find_solutions": lambda: march("global"),
        "methods.further_methods": lambda: hv.solve(yielding_problem(), "powell"),
    }


def answers() -> dict[str, str]:
    """What is said where something is asked for that is not installed: a hook, a name of ``hemivar``, a constant."""
    names = ("follow_path", "read_problem", "report", "survey_report", "Signorin")
    said = {name: sentence(ask) for name, ask in hooks().items()}
    said |= {name: sentence(lambda name=name: getattr(hv, name)) for name in names}  # type: ignore[misc]
    said |= {"direct-powell": sentence(lambda: hv.solve(yielding_problem(), "direct-powell"))}
    constants = smallness(yielding_problem())
    said["smallness.trace_bound"] = f"{constants.trace_bound}, {constants.survey_condition}"
    claims = {claim.label: claim.sentence for claim in hv.solve(yielding_problem()).certify().claims()}
    return said | {"claim": claims["survey's (H_s)"]}


def sentence(asked: Callable[[], object]) -> str:
    try:
        return f"answered {type(asked()).__name__}"
    except (hv.HemivarError, ImportError, AttributeError) as error:
        return str(error)
