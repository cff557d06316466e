"""Histories in files: times and arrays come back, also from a march that did not end."""

from __future__ import annotations

import contextlib
import csv
import json
import xml.etree.ElementTree as ElementTree
from dataclasses import fields, replace
from pathlib import Path
from types import SimpleNamespace

import meshio
import numpy as np
import pytest

import hemivar as hv
from hemivar.basics.csv_text import csv_text
from hemivar.basics.types import Array
from hemivar.errors import FileError, ProblemError
from hemivar.evolution import Evolution, History, March, Save, march
from hemivar.evolution.discrete import DiscreteEvolution
from hemivar.evolution.march import marching
from hemivar.files import history_table
from hemivar.files.film import read_film
from hemivar.files.history_table import HISTORY_FILES, read_history_table
from hemivar.files.series import Series
from hemivar.files.snapshot import moving_states, snapshot
from hemivar.linear.vectors import Whole
from hemivar.solvers import NormalState, TangentialState
from hemivar.solvers.contact_states import KINDS
from tests import bodies


def pressed(gap: object = 0.02) -> Evolution:
    """A block that falls on a foundation and is pushed along it."""
    problem = bodies.strip(
        hv.Contact(hv.Compliance(20.0), hv.Tresca(0.05), gap=gap),
        (6, 3),
        density=1.0,
        viscosity=(0.4, 0.4),
        body_force=(0.0, -0.5),
        tractions={"right": (-0.3, 0.0)},
        title="block",
    )
    return Evolution(problem, inertia=True)


@pytest.fixture(scope="module")
def history() -> History:
    return march(pressed(), 1.0, step=0.05, save=Save(every=0.1, probes={"tip": (2.0, 1.0)}))


def times_of(path: Path) -> tuple[list[float], list[Path]]:
    """What a PVD lists, by the rules of its format and no code of ours."""
    entries = list(ElementTree.parse(path).getroot().iter("DataSet"))
    return [float(e.attrib["timestep"]) for e in entries], [path.parent / e.attrib["file"] for e in entries]


def test_pvd_has_every_frame_at_its_time(history: History, tmp_path: Path) -> None:
    made = history.write(tmp_path / "run.pvd")
    assert made == (tmp_path / "run.pvd", tmp_path / "run_contact.pvd")
    times, files = times_of(made[0])
    assert times == [frame.time for frame in history.frames]
    assert times[-1] == 1.0
    for frame, file in zip(history.frames, files, strict=True):
        read = meshio.read(file)
        assert np.array_equal(read.point_data["displacement"][:, :2], frame.displacement)
        assert np.array_equal(read.point_data["velocity"][:, :2], frame.velocity)
        contact = history.discrete.problem.contact
        assert np.array_equal(read.point_data["pressure"][contact.node], frame.multiplier[:, 0])
        assert np.array_equal(read.point_data["penetration"][contact.node], frame.local[:, 0])
        assert np.abs(read.point_data["rate"][contact.node] - contact_rate(history, frame)).max() < 1e-15
    assert times_of(made[1])[0] == times
    numbers = [int(file.stem.rpartition("_")[2]) for file in files]
    assert np.array_equal(history.times[numbers], times)


def contact_rate(history: History, frame: object) -> np.ndarray:
    """The rate of contact points from the nodal velocity: the foundation of this block is at rest."""
    contact = history.discrete.problem.contact
    velocity = frame.velocity[contact.node]  # type: ignore[attr-defined]
    return np.hstack([velocity, np.zeros((len(velocity), 1))])


def test_frames_are_listed_in_the_order_of_time(history: History, tmp_path: Path) -> None:
    """Also those that come later for earlier steps."""
    series = Series(tmp_path / "run.pvd", history.discrete)
    for step in (8, 2, 5):
        series.add([(step, history.frames[step])])
    times, files = times_of(tmp_path / "run.pvd")
    assert times == [history.frames[step].time for step in (2, 5, 8)]
    assert [file.stem for file in files] == ["run_000002", "run_000005", "run_000008"]


def test_files_of_a_march_that_is_left_are_whole(tmp_path: Path) -> None:
    """Frames are written as they come; the end takes out what the march has thinned."""
    work = marching(pressed(), March(1.0, step=0.05, save=Save(most=4)))
    series: Series | None = None
    seen = []
    for stepped, _ in zip(work, range(9), strict=False):
        if series is None:
            series = Series(tmp_path / "run.pvd", march_discrete(work))
        new = [] if stepped.frame is None else [(stepped.state.index, stepped.frame)]
        series.add([*stepped.earlier, *new])
        seen += [*(f.time for _, f in stepped.earlier), *(f.time for _, f in new)]
        times, files = times_of(tmp_path / "run.pvd")
        assert times == seen
        assert all(len(meshio.read(file).points) for file in files)
    assert seen[0] == 0.0
    work.close()


def march_discrete(work: object) -> object:
    """The discrete evolution of a march, from inside of its generator."""
    return work.gi_frame.f_locals["discrete"]  # type: ignore[attr-defined]


def test_the_end_of_a_series_names_what_was_kept(tmp_path: Path) -> None:
    history = march(pressed(), 1.0, step=0.05, save=Save(most=4))
    series = Series(tmp_path / "run.pvd", history.discrete)
    extra = history.frames[1]
    series.add([(0, history.frames[0]), (17, extra)])
    assert (tmp_path / "run" / "run_000017.vtu").exists()
    from hemivar.files.series import numbered

    series.finish(numbered(history))
    times, files = times_of(tmp_path / "run.pvd")
    assert times == [frame.time for frame in history.frames]
    assert sorted(files) == sorted(file for file in (tmp_path / "run").iterdir() if "contact" not in file.name)


def test_what_a_killed_march_had_begun_to_write_is_removed(history: History, tmp_path: Path) -> None:
    begun = [
        f".run_000003{part}-0123456789ab.{kind}" for part, kind in (("", "vtu"), ("_contact", "vtu"), ("", "pvtu"))
    ]
    others = [".run_000003-0123.vtu", ".walk_000003-0123456789ab.vtu", "run_old.vtu"]
    folder = tmp_path / "run"
    folder.mkdir()
    for name in (*begun, *others):
        (folder / name).write_text("")
    history.write(tmp_path / "run.pvd")
    left = {file.name for file in folder.iterdir()}
    assert left.isdisjoint(begun)
    assert left.issuperset(others)


def test_csv_keeps_every_bit(history: History, tmp_path: Path) -> None:
    (path,) = history.write(tmp_path / "run.csv")
    with path.open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert len(rows) == len(history.steps)
    for name in history.columns:
        given = np.array([float(row[name]) for row in rows])
        assert np.array_equal(given, history[name], equal_nan=True)
    assert rows[3]["jumped"] == "0"
    again = read_history_table(path)
    assert list(again) == list(history.columns)
    assert np.array_equal(again["tip.u_y"], history["tip.u_y"])


def test_a_row_for_each_step_has_names_whole_numbers_and_units(history: History) -> None:
    rows = history.rows()
    assert [row["time"] for row in rows] == [step.time for step in history.steps]
    assert isinstance(rows[2]["solver_steps"], int)
    assert rows[2]["tip.u_y"] == history["tip.u_y"][2]
    units = {column.key: column.unit for column in rows.columns}
    assert (units["time"], units["tip.u_y"], units["normal_force"], units["work"]) == (
        "time", "length", "force", "energy",
    )  # fmt: skip
    assert units["residual"] == ""


def test_names_of_columns_are_no_formulas_and_come_back(tmp_path: Path) -> None:
    columns = {"time": [1.0], "step": [-1.0], "=1+1": [-2.0], "'@a": [3.0]}
    (tmp_path / "t.csv").write_text(csv_text(columns, zip(*columns.values(), strict=True)))
    assert (tmp_path / "t.csv").read_text().splitlines() == ["time,step,'=1+1,''@a", "1.0,-1.0,-2.0,3.0"]
    assert list(read_history_table(tmp_path / "t.csv")) == list(columns)


def test_parquet_keeps_every_bit_or_says_what_is_missing(history: History, tmp_path: Path) -> None:
    try:
        import pyarrow  # noqa: F401
    except ImportError:
        with pytest.raises(ProblemError, match=r"pyarrow is not installed; .*\.csv"):
            history.write(tmp_path / "run.parquet")
        return
    (path,) = history.write(tmp_path / "run.parquet")
    again = read_history_table(path)
    assert all(np.array_equal(again[name], history[name], equal_nan=True) for name in history.columns)


@pytest.mark.parametrize("told", [{"rows": 10**9}, {"size": 10**9}, {"rows": 4, "group_rows": 10**9}])
def test_parquet_is_held_against_what_it_says_before_it_is_read(
    told: dict[str, int], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A stand-in for pyarrow, which may not be here: a file that says too much is never read."""

    class Metadata:
        num_columns, num_row_groups, num_rows = 2, 1, told.get("rows", 0)

        def row_group(self, number: int) -> SimpleNamespace:
            return SimpleNamespace(num_rows=told.get("group_rows", 0), total_byte_size=told.get("size", 0))

    class ParquetFile(contextlib.nullcontext):
        metadata = Metadata()

        def __init__(self, path: Path) -> None:
            super().__init__(self)

        def read(self) -> None:
            pytest.fail("it was read")

    monkeypatch.setattr(history_table, "_arrow", lambda: (None, SimpleNamespace(ParquetFile=ParquetFile)))
    path = tmp_path / "t.parquet"
    path.write_bytes(b"PAR1")
    with pytest.raises(FileError, match="the table would take more than 256 MiB"):
        read_history_table(path)
    folder = tmp_path / "folder.parquet"
    folder.mkdir()
    with pytest.raises(FileError, match="it is a directory"):
        read_history_table(folder)


def test_parquet_of_no_numbers_is_one_line(tmp_path: Path) -> None:
    pyarrow = pytest.importorskip("pyarrow")
    parquet = pytest.importorskip("pyarrow.parquet")
    path = tmp_path / "t.parquet"
    parquet.write_table(pyarrow.table({"time": ["a", "b"], "step": [1, 2]}), path)
    with pytest.raises(FileError, match="this is not the table of a run"):
        read_history_table(path)
    path.write_bytes(path.read_bytes()[:-9])
    with pytest.raises(FileError, match="this is not the table of a run"):
        read_history_table(path)


def test_dataframe(history: History) -> None:
    try:
        import pandas  # noqa: F401
    except ImportError:
        with pytest.raises(ProblemError, match=r"pandas is not installed; .*history\.table"):
            history.to_dataframe()
        return
    frame = history.to_dataframe()
    assert list(frame.columns) == list(history.columns)
    assert np.array_equal(frame["normal_force"].to_numpy(), history["normal_force"])


def test_json(history: History, tmp_path: Path) -> None:
    record = json.loads(history.to_json(tmp_path / "run.json").read_text())
    assert record == history.to_dict()
    assert record["ended"] == "finished"
    assert record["table"]["time"] == history.times.tolist()
    assert record["table"]["margin"][0] is None
    assert record["ledger"]["work"] == history.ledger["work"]
    assert (record["steps"], record["time"]) == (20, 1.0)
    assert record["solver_steps"] == sum(record["table"]["solver_steps"])
    assert record["residual"] == max(record["table"]["residual"][1:])
    assert record["margin"] == min(record["table"]["margin"][1:])
    assert record["table"].keys() == set(history.columns)
    assert record["time_error"]["guaranteed"] is history.time_error.guaranteed
    told = replace(history, events=((0.3, "touch"),), messages=("it jumped",)).to_dict()
    assert (told["events"], told["messages"]) == ([[0.3, "touch"]], ["it jumped"])


def test_other_names_are_refused(history: History, tmp_path: Path) -> None:
    with pytest.raises(ProblemError, match="a history is written as"):
        history.write(tmp_path / "run.txt")
    assert ".pvd" in HISTORY_FILES


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "this is not the table of a run"),
        ("a,b\r\n1,2\r\n", "has columns 'time' and 'step'"),
        ("time,step\r\n", "this is not the table of a run"),
        ("time,step\r\n1\r\n", "row 2 has 1 entries, the head 2"),
        ("time,step\r\n1,SECRET\r\n", "column 2 holds an entry that is not a number"),
    ],
)
def test_tables_that_are_none(text: str, says: str, tmp_path: Path) -> None:
    (tmp_path / "t.csv").write_text(text)
    with pytest.raises(FileError, match=says) as caught:
        read_history_table(tmp_path / "t.csv")
    assert "SECRET" not in str(caught.value)


def test_lists_of_frames_that_are_none(history: History, tmp_path: Path) -> None:
    path = tmp_path / "run.pvd"
    for text, says in (
        ("<VTKFile", "this is not a PVD file"),
        ("<VTKFile><Collection></Collection></VTKFile>", "has no frame"),
        ('<VTKFile><DataSet timestep="x" file="a.vtu"/></VTKFile>', "this is not a PVD file"),
        ('<VTKFile><DataSet timestep="0" file="a.vtu"/></VTKFile>', r"a\.vtu"),
    ):
        path.write_text(text)
        with pytest.raises(FileError, match=says):
            read_film(path)
    with pytest.raises(FileError, match=r"^cannot read PVD file .*nothing\.pvd: no such file"):
        read_film(tmp_path / "nothing.pvd")
    history.write(path)
    with pytest.raises(FileError, match=r"pass the \.pvd of the body"):
        read_film(tmp_path / "run_contact.pvd")
    other = march(pressed(), 0.1, step=0.1)
    small = replace(other.discrete.evolution.problem, mesh=hv.rectangle((2.0, 1.0), (2, 1)))
    march(Evolution(small, inertia=True), 0.1, step=0.1).write(tmp_path / "small.pvd")
    last = sorted((tmp_path / "run").glob("run_0*[0-9].vtu"))[-1]
    last.write_bytes(sorted((tmp_path / "small").glob("small_0*[0-9].vtu"))[-1].read_bytes())
    with pytest.raises(FileError, match="not a frame of the same body"):
        read_film(path).frame(len(history.frames) - 1)
    (tmp_path / "run" / "run_000000.vtu").write_text("<nothing")
    with pytest.raises(FileError, match=r"frame .* is not readable XML"):
        read_film(path)


# ---- states ----------------------------------------------------------------------------------------------------


def test_slip_is_told_by_the_rate(history: History) -> None:
    """Contact points that were carried along and rest now stick, whatever slip they have behind them."""
    frame = history.frames[-1]
    found = moving_states(history.discrete, frame)
    assert np.array_equal(moving_states(history.discrete, history.at(1.0)).numbers, found.numbers)
    rest = replace(frame, rate=np.zeros_like(frame.rate), velocity=np.zeros_like(frame.velocity))
    touched = frame.local[:, 0] > 0.0
    assert touched.any()
    assert np.abs(frame.local[touched, 1]).min() > 1e-6
    assert (moving_states(history.discrete, rest).tangential[touched] == TangentialState.STICK).all()
    moving = replace(rest, rate=np.ones_like(frame.rate), velocity=np.ones_like(frame.velocity))
    assert (moving_states(history.discrete, moving).tangential[touched] == TangentialState.SLIP).all()
    opened = replace(rest, local=frame.local - 1.0, multiplier=np.zeros_like(frame.multiplier))
    assert moving_states(history.discrete, opened).present.keys() == {KINDS[0]}


def test_what_a_solver_leaves_of_rest_is_no_slip(history: History) -> None:
    """Rates are held against the largest speed, and where nothing moves against displacement over time."""
    frame = history.frames[-1]
    speed, place = np.abs(frame.velocity).max(), np.abs(frame.displacement).max()
    touched = frame.local[:, 0] > 0.0

    def states(rate: float, start: float = 0.0, moving: bool = True) -> np.ndarray:
        velocity = frame.velocity if moving else np.zeros_like(frame.velocity)
        given = replace(frame, rate=np.full_like(frame.rate, rate), velocity=velocity)
        begun = replace(history.discrete, evolution=replace(history.discrete.evolution, start=start))
        return moving_states(begun, given).tangential[touched]

    assert (states(1e-7 * speed) == TangentialState.STICK).all()
    assert (states(1e-4 * speed) == TangentialState.SLIP).all()
    assert (states(1e-10 * place, moving=False) == TangentialState.STICK).all()
    assert (states(1e-8 * place, moving=False) == TangentialState.SLIP).all()
    assert (states(1e-8 * place, start=frame.time - 0.01, moving=False) == TangentialState.STICK).all()


def test_glue_that_pulls_is_not_open(history: History) -> None:
    frame = history.frames[-1]
    lifted = replace(frame, local=frame.local - 1.0, multiplier=np.full_like(frame.multiplier, -0.1))
    assert (moving_states(history.discrete, lifted).normal == NormalState.BONDED).all()


def test_a_gap_that_moves_is_that_of_its_time() -> None:
    found = march(pressed(gap=lambda x, t: 0.02 + 0.1 * t + 0.0 * x[:, 0]), 0.4, step=0.1)
    gaps = [snapshot(found.discrete, frame).problem.gap for frame in found.frames]
    for frame, gap in zip(found.frames, gaps, strict=True):
        assert gap == pytest.approx(np.full_like(gap, 0.02 + 0.1 * frame.time), rel=1e-14)


def test_states_are_told_by_the_sizes_of_all_processes(history: History) -> None:
    """A process whose points hardly move sees rounding, and must not take it for pressure or slip."""

    class All(Whole):
        """What a process with nothing but rounding learns from another."""

        def largest(self, *values: float) -> Array:
            return np.maximum(values, 1.0)

    class Together(DiscreteEvolution):
        @property
        def vectors(self) -> All:
            return All()

    def told(discrete: DiscreteEvolution, **changed: Array) -> set[str]:
        still = {name: np.zeros_like(getattr(frame, name)) for name in ("displacement", "velocity", "rate")}
        return {kind.label for kind in moving_states(discrete, replace(frame, **{**still, **changed})).present}

    frame, alone = history.frames[-1], history.discrete
    together = Together(**{part.name: getattr(alone, part.name) for part in fields(alone)})
    rows = np.ones((len(frame.local), 1))
    noise, lifted, pressed = (rows * row for row in ([-1e-16, 1e-16], [-1e-3, 0.0], [1e-3, 0.0]))
    assert told(together, local=lifted, multiplier=noise) == {"open"}
    assert told(alone, local=lifted, multiplier=noise) == {"bonded, stick"}
    assert told(together, local=pressed, multiplier=pressed, rate=noise) == {"contact, stick"}
    assert told(alone, local=pressed, multiplier=pressed, rate=noise) == {"contact, slip"}
