"""Convergence in time, on a body whose motion is an exponential."""

from __future__ import annotations

import math

import numpy as np
import pytest

import hemivar as hv
from hemivar.errors import ProblemError
from hemivar.evolution import March
from hemivar.report import Table, plot_study
from hemivar.workflows import Phase, TimeStudy, TimeStudyOptions, result_of, study_time

#: Young's modulus 10 and viscosity 10 along the stress: it creeps to a strain of 0.1 in the time 1.
CREEP = ("0.1*x*(1 - exp(-t))", "0*x")


def creeping(gap: float | None = None) -> hv.Evolution:
    contact = {} if gap is None else {"right": hv.Contact(hv.Compliance(1000.0), gap=gap)}
    return hv.Evolution(
        hv.ContactProblem(
            hv.rectangle((1.0, 1.0), 2),
            hv.Material.young(10.0, 0.0, viscosity=(0.0, 5.0)),
            contact,
            {"left": hv.Roller(), "bottom": hv.Roller()},
            body_force=(0.0, 0.0),
            tractions={"right": (1.0, 0.0)} if gap is None else {},
        )
    )


def studied(plan: March, known: tuple[str, ...] | None = CREEP, refine: int = 3) -> TimeStudy:
    return result_of(study_time(creeping(), plan, TimeStudyOptions(refine, known)))


@pytest.mark.parametrize(("scheme", "order"), [("implicit-euler", 1.0), ("bdf2", 2.0), ("sdirk2", 2.0)])
def test_schemes_have_their_orders(scheme: str, order: float) -> None:
    study = studied(March(1.0, step=0.125, scheme=scheme))
    assert study.steps("energy")[-1] == pytest.approx(order, abs=0.07)
    assert study.steps("displacement")[-1] == pytest.approx(order, abs=0.07)
    assert study.quantities == ("energy", "displacement")
    # E |eps|^2 of the strain 0.1 (1 - exp(-1)) at the end
    assert study.norms["energy"] == pytest.approx(0.1 * (1.0 - math.exp(-1.0)) * math.sqrt(10.0))


def test_implicit_euler_errs_as_its_recursion() -> None:
    """u_k = u_k-1 + h (0.1 - u_k) by hand."""
    study = studied(March(1.0, step=0.25), refine=1)
    for level in study.levels:
        u, errors = 0.0, [0.0]
        for k in range(1, round(1.0 / level.size) + 1):
            u = (u + level.size * 0.1) / (1.0 + level.size)
            errors.append(abs(u - 0.1 * (1.0 - math.exp(-k * level.size))))
        compared = errors[:: round(0.25 / level.size)]
        assert level.energy == pytest.approx(math.sqrt(10.0) * max(compared), rel=1e-6)
        assert level.displacement == pytest.approx(max(compared) / math.sqrt(3.0), rel=1e-6)


def test_the_step_that_an_accuracy_needs_gives_it() -> None:
    needed = studied(March(1.0, step=0.125)).size_for(2e-3)
    count = round(1.0 / needed)
    error = studied(March(1.0, step=1.0 / count), refine=1).relative("energy")[0]
    assert error == pytest.approx(2e-3, rel=0.15)
    assert math.isnan(studied(March(1.0, step=0.25), refine=1, known=None).size_for(1e-3))


def test_without_a_known_solution_the_shortest_step_is_the_reference() -> None:
    study = studied(March(1.0, step=0.25, scheme="sdirk2"), known=None)
    known = studied(March(1.0, step=0.25, scheme="sdirk2"))
    assert study.reference == "finest run"
    assert math.isnan(study.errors("energy")[-1])
    assert study.errors("energy")[:2] == pytest.approx(known.errors("energy")[:2], rel=0.08)
    assert not study.trusted[-2:].any()


def test_pressure_is_compared_where_bodies_touch() -> None:
    evolution = creeping(gap=-0.01)
    study = result_of(study_time(evolution, March(1.0, step=0.25), TimeStudyOptions(3)))
    assert "pressure" in study.quantities
    assert 0.0 < study.errors("pressure")[2] < study.errors("pressure")[0]


def test_a_study_in_time_says_itself_as_other_results_do() -> None:
    study = studied(March(1.0, step=0.25), refine=2)
    assert [row["steps"] for row in study.rows()] == [4, 8, 16]
    record = study.record()
    assert record["runs"][1]["errors"]["energy"] == study.levels[1].energy
    assert record["reference"] == "exact solution"
    assert Table.of(study.rows(), brief=True).columns[:4] == ("step", "steps", "energy", "order")
    assert plot_study(study, unit="s").axes[0].get_xlabel() == "time step (s)"
    assert [claim.label for claim in study.claims()] == ["reference", "energy", "displacement"]
    assert repr(study).startswith("TimeStudy(3 runs, step 0.25 to 0.0625, against the exact solution; orders: energy ")
    assert "<img" in study._repr_html_()


def test_it_ends_after_a_run_if_it_is_told_so() -> None:
    work = study_time(creeping(), March(1.0, step=0.25), TimeStudyOptions(5, CREEP))
    study = result_of(work, lambda event: not isinstance(event, Phase) and event.size < 0.2)
    assert np.array_equal(study.sizes, [0.25, 0.125])
    assert study.interrupted


def test_what_makes_no_sense_is_refused() -> None:
    with pytest.raises(ProblemError, match="1 components and the displacement 2"):
        studied(March(1.0, step=0.25), known=("t",))
    with pytest.raises(ProblemError, match="give 12 halvings"):
        TimeStudyOptions(13)
    with pytest.raises(ProblemError, match="refine is 0"):
        TimeStudyOptions(0)
    with pytest.raises(ProblemError, match="ended at t = 0"):
        studied(March(1.0, step=0.25, max_time=0.0))
