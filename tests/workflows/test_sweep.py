"""Sweeps over parameters: numbers of solutions in closed form, records that go on, ranges, pictures."""

from __future__ import annotations

import json
import math
import sys
from pathlib import Path

import numpy as np
import pytest

import hemivar as hv
from hemivar.discrete.problem import DiscreteProblem
from hemivar.errors import FileError, ProblemError
from hemivar.files.changes import Change
from hemivar.files.sweep_point import SweepPoint
from hemivar.report import Table, plot_sweep
from hemivar.workflows import SweepEvent, SweepOptions, result_of, sweeping
from hemivar.workflows.sweep import SweepAxis, read_axis
from tests.problem_files import block_file
from tests.problems import bar

STIFFNESS, LIMIT = 2.0, 0.1
LOADS, SOFTENINGS = (0.1, 0.17, 0.25, 0.35), (0.5, 1.6, 2.0, 4.0)
AXES = {"r0": LOADS, "alpha": SOFTENINGS}


def softening_bar(r0: float, alpha: float) -> DiscreteProblem:
    """A bar of stiffness kappa = 1 that would penetrate by r0 without its foundation."""
    return bar(2.0 * r0, hv.Softening(STIFFNESS, LIMIT, alpha), 2)


def solutions_by_hand(r0: float, alpha: float) -> list[float]:
    """Penetrations at all solutions of the bar: on the rising part, on the falling part, beyond."""
    k, end = STIFFNESS, LIMIT * (1.0 + STIFFNESS / alpha)
    found = [r0 / (1.0 + k)] if r0 / (1.0 + k) <= LIMIT else []
    falling = (r0 - (k + alpha) * LIMIT) / (1.0 - alpha)
    found += [falling] if LIMIT < falling < end else []
    return [*found, *([r0] if r0 >= end else [])]


def stopped_after(count: int, keep: Path) -> hv.workflows.Sweep:
    """A sweep that is interrupted after so many points of its own."""
    seen: list[SweepPoint] = []

    def view(event: object) -> None:
        if isinstance(event, SweepEvent):
            seen.append(event.point)
            if len(seen) == count:
                raise KeyboardInterrupt

    return result_of(sweeping(softening_bar, AXES, SweepOptions(checkpoint=keep)), view)


@pytest.fixture(scope="module")
def whole() -> hv.workflows.Sweep:
    return hv.sweep(softening_bar, AXES)


def test_the_number_of_solutions_is_that_by_hand(whole: hv.workflows.Sweep) -> None:
    assert whole.complete
    assert whole.shape == (4, 4)
    assert (whole.exhaustive == 1.0).all()
    for point in whole.points:
        by_hand = solutions_by_hand(*whole.values(point))  # type: ignore[arg-type]
        assert point.count == len(by_hand)
        assert sorted(point.penetrations) == pytest.approx(sorted(by_hand), rel=1e-9)
        assert point.minima == (1 if len(by_hand) == 1 else 2)
    assert set(whole.count.ravel()) == {1.0, 3.0}


def test_the_margin_is_that_by_hand(whole: hv.workflows.Sweep) -> None:
    np.testing.assert_allclose(whole.margin, np.broadcast_to(1.0 - np.array(SOFTENINGS), (4, 4)), atol=1e-9)


def test_what_was_interrupted_goes_on_with_the_same_bits(whole: hv.workflows.Sweep, tmp_path: Path) -> None:
    keep = tmp_path / "a.jsonl"
    first = stopped_after(5, keep)
    assert first.interrupted
    assert not first.complete
    assert len(first.points) == 5
    lines = keep.read_text().splitlines()
    assert len(lines) == 6
    keep.write_text("\n".join(lines) + "\n" + lines[-1][:20])  # killed while it wrote the next point
    second = stopped_after(3, keep)
    assert len(second.points) == 8
    assert keep.read_text().splitlines()[:6] == lines
    last = hv.sweep(softening_bar, AXES, checkpoint=keep)
    assert last.complete
    assert last.points == whole.points
    assert keep.read_text().count("\n") == 17
    again = hv.sweep(softening_bar, AXES, checkpoint=keep)
    assert again.points == whole.points


def test_only_what_is_not_done_is_computed(tmp_path: Path) -> None:
    keep = tmp_path / "a.jsonl"
    stopped_after(5, keep)
    computed = [e for e in sweeping(softening_bar, AXES, SweepOptions(checkpoint=keep)) if isinstance(e, SweepEvent)]
    assert len(computed) == 16 - 5


def test_the_record_of_other_work_is_refused(tmp_path: Path) -> None:
    keep, problem = tmp_path / "a.jsonl", tmp_path / "problem.toml"
    problem.write_text(block_file(2))
    axes = {"contact.bottom.normal.q_max": (0.1, 0.3)}
    hv.sweep(problem, axes, checkpoint=keep)
    hv.sweep(problem, axes, checkpoint=keep)
    for other in (
        lambda: hv.sweep(problem, {"contact.bottom.normal.q_max": (0.1, 0.2)}, checkpoint=keep),
        lambda: hv.sweep(problem, axes, checkpoint=keep, seed=1),
        lambda: hv.sweep(problem, axes, checkpoint=keep, changes=[Change("loads.body.0", 0.0)]),
    ):
        with pytest.raises(FileError, match="holds another sweep, or the problem has changed"):
            other()
    problem.write_text(block_file(3))
    with pytest.raises(FileError, match="holds another sweep, or the problem has changed"):
        hv.sweep(problem, axes, checkpoint=keep)
    keep.write_text("text\n")
    with pytest.raises(FileError, match="is not a record of a sweep"):
        hv.sweep(problem, axes, checkpoint=keep)


def test_a_line_that_was_changed_is_named(tmp_path: Path) -> None:
    keep = tmp_path / "a.jsonl"
    stopped_after(2, keep)
    keep.write_text(keep.read_text().replace('"margin"', '"mrgin"', 1))
    with pytest.raises(FileError, match="line 2: this is not a point"):
        hv.sweep(softening_bar, AXES, checkpoint=keep)


def test_points_of_a_file_are_those_of_the_file_that_says_so(tmp_path: Path) -> None:
    problem = tmp_path / "problem.toml"
    problem.write_text(block_file(2))
    found = hv.sweep(problem, {"contact.bottom.normal.q_max": [0.1, 0.3], "loads.body.1": [-0.8, -0.4]})
    for point in found.points:
        q, load = found.values(point)
        text = block_file(2).replace("q_max = 0.3", f"q_max = {q}").replace("[-0.8, -0.8]", f"[-0.8, {load}]")
        problem.write_text(text)
        by_hand = hv.solve(hv.read_problem(problem))
        assert point.energies == pytest.approx([by_hand.energy], rel=1e-9)
        assert point.forces == pytest.approx([by_hand.normal_force], rel=1e-6)


def test_a_point_that_cannot_be_stated_has_failed_and_says_why(tmp_path: Path) -> None:
    problem = tmp_path / "problem.toml"
    problem.write_text(block_file(2))
    found = hv.sweep(problem, {"contact.bottom.friction.bound": [-1.0, 0.5]})
    assert [point.failed for point in found.points] == [True, False]
    assert "[contact.bottom] friction.bound" in found.points[0].note
    assert np.isnan(found.count[0])
    assert Table.of(found.rows()).rows[0][-1] == found.points[0].note
    with pytest.raises(ProblemError, match=r"no point has a solution; the first: .*friction.bound"):
        hv.sweep(problem, {"contact.bottom.friction.bound": [-1.0, -2.0]})


@pytest.mark.parametrize(
    ("text", "values"),
    [
        ("a.b=0:1:5", (0.0, 0.25, 0.5, 0.75, 1.0)),
        ("a.b=0:0.3:4", (0.0, 0.1, 0.2, 0.3)),
        ("a=1:3:3", (1, 2, 3)),
        ("a=-2e-3:2e-3:2", (-2e-3, 2e-3)),
        ("a=1:100:3:log", (1, 10, 100)),
        ("a=0.01:1:3:log", (0.01, 0.1, 1.0)),
    ],
)
def test_ranges(text: str, values: tuple[float, ...]) -> None:
    axis = read_axis(text)
    assert isinstance(axis, SweepAxis)
    assert axis.values == values
    assert all(type(one) is type(other) for one, other in zip(axis.values, values, strict=True))


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("a=0:1:1", "at least two values"),
        ("a=1:1:5", "two different ends"),
        ("a=0:1:5:log", "positive"),
        ("a=0:1:9999999", "at most"),
        ("a=0:1", "not valid TOML"),
        ("=0:1:5", "not a key"),
        ("a", "write KEY=VALUE"),
    ],
)
def test_ranges_that_make_no_sense(text: str, words: str) -> None:
    with pytest.raises(ProblemError, match=words):
        read_axis(text)


def test_what_is_no_range_is_a_value() -> None:
    assert read_axis("mesh.cells=[2, 2]") == Change("mesh.cells", [2, 2])


def test_arguments_that_make_no_sense() -> None:
    for axes, words in (
        ({}, "there is no parameter"),
        ({"a": []}, "has no values"),
        ([SweepAxis("a", (1,)), SweepAxis("a", (2,))], "is there twice"),
    ):
        with pytest.raises(ProblemError, match=words):
            hv.sweep(softening_bar, axes)  # type: ignore[arg-type]
    with pytest.raises(ProblemError, match="give the path of a problem file"):
        hv.sweep(softening_bar(0.1, 1.0), AXES)  # type: ignore[arg-type]
    with pytest.raises(ProblemError, match="write its function with def at the top level of a module"):
        hv.sweep(lambda a: softening_bar(a, 1.0), {"a": LOADS}, jobs=2)
    with pytest.raises(ProblemError, match="jobs is 0"):
        SweepOptions(jobs=0)


def test_a_point_keeps_every_bit_in_its_line() -> None:
    point = SweepPoint((3, 1), -math.inf, (0.1 + 0.2, -1e-300), ("saddle", ""), (1 / 3, 2.0), (0.0, -0.0), True, "é")
    assert SweepPoint.of_line(point.line()) == point
    before = {key: value for key, value in json.loads(point.line()).items() if key != "numbers"}
    assert SweepPoint.of_line(json.dumps(before)) == point  # of a version whose points had no numbers
    assert json.loads(point.line())["margin"] == "-inf"
    assert math.isnan(SweepPoint.of_line(SweepPoint((0,)).line()).margin)


def test_figures_show_margin_and_number(whole: hv.workflows.Sweep) -> None:
    fig = plot_sweep(whole, labels=["load (m)"])
    left, right = fig.axes[:2]
    assert (left.get_xlabel(), left.get_ylabel()) == ("load (m)", "alpha")
    shown = np.ma.getdata(left.collections[0].get_array())
    np.testing.assert_allclose(shown.reshape(4, 4), whole.margin.T)
    kinds = np.asarray(right.collections[0].get_array()).reshape(4, 4)
    np.testing.assert_array_equal(np.array([1, 3])[kinds.astype(int)], whole.count.T)
    line = hv.sweep(softening_bar, {"r0": [0.25], "alpha": [0.5]})
    plot_sweep(line)
    one = hv.sweep(lambda alpha: softening_bar(0.25, alpha), {"alpha": SOFTENINGS})
    above, below = plot_sweep(one).axes[:2]
    np.testing.assert_allclose(above.get_lines()[1].get_ydata(), one.margin)
    np.testing.assert_array_equal(below.get_lines()[0].get_ydata(), one.count)
    three = hv.sweep(lambda a, b, c: softening_bar(0.25, a), {"a": [0.5], "b": [1], "c": ["x"]})
    with pytest.raises(ProblemError, match="3 parameters cannot be drawn"):
        plot_sweep(three)


def test_a_table_has_a_line_for_each_point(whole: hv.workflows.Sweep, tmp_path: Path) -> None:
    table = Table.of(whole.rows())
    assert table.columns[:3] == ("r0", "alpha", "solutions")
    assert [row[2] for row in table.rows] == whole.count.ravel().tolist()
    text = table.write_csv(tmp_path / "a.csv").read_text().splitlines()
    assert len(text) == 17


@pytest.mark.slow
def test_processes_find_the_same_bits(
    whole: hv.workflows.Sweep, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys.modules["hemivar.workflows.sweep"], "_BEGIN", 0.0)  # else this process would do all of it
    found = hv.sweep(softening_bar, AXES, jobs=2, checkpoint=tmp_path / "a.jsonl")
    assert found.points == whole.points


def rubbing_point(mu: float) -> DiscreteProblem:
    """One point, whose friction weakens with the slip and grows with the penetration."""
    friction = hv.SlipWeakening(hv.laws.PenetrationBound(([0.0, 1.0], [0.0, 4.0 * mu])), 1.0, 0.5, 1.5)
    law = hv.laws.ContactLaw(hv.Compliance(4.0), friction)
    stiffness, load = np.diag([3.0, 2.0]), np.array([1.0, 0.7])
    return DiscreteProblem.of_arrays(stiffness, load, np.eye(2), np.array([0.5]), np.zeros(1), law)


def test_where_friction_depends_on_the_state_the_margin_is_that_at_the_solution() -> None:
    """By hand: ``1 - w (alpha_tau h(r) / k_tau + h' / sqrt(k_nu k_tau))`` with ``r = 1 / (3 + w 4)`` and w = 1/2.

    At any other penetration the friction may be larger, and so may its weakening: nothing bounds the margin there.
    """
    found = hv.sweep(rubbing_point, {"mu": (0.1, 0.3)})
    mu, r = np.array([0.1, 0.3]), 1.0 / (3.0 + 0.5 * 4.0)
    by_hand = 1.0 - 0.5 * (0.5 * 1.5 * 4.0 * mu * r / 2.0 + 4.0 * mu / np.sqrt(3.0 * 2.0))
    np.testing.assert_allclose(found.margin, by_hand, atol=1e-6)
    assert (found.count == 1.0).all()
