"""What a checkpoint keeps: every number, to the last bit, whatever there is to remember."""

from __future__ import annotations

import io
import math
from collections.abc import Mapping
from dataclasses import fields, is_dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hemivar.basics.types import Array
from hemivar.errors import FileError, ProblemError
from hemivar.evolution import Checkpoint, march
from hemivar.evolution.digest import differences
from hemivar.evolution.history import Frame, Row
from hemivar.evolution.march_state import MarchState
from hemivar.evolution.state import (
    ContactForce,
    EnergyBalance,
    HeatBalance,
    Kinematics,
    LastStep,
    Rates,
    ThermalState,
    TimeState,
)
from hemivar.evolution.steps import StepSizeState
from tests.evolution.test_march import beam


class Numbers:
    """Numbers of which no two are the same, none of them one that decimals could write."""

    def __init__(self) -> None:
        self._random = np.random.default_rng(5)

    def __call__(self, *shape: int) -> Array:
        return np.asarray(self._random.standard_normal(shape) / 3.0)

    def one(self) -> float:
        return float(self(1)[0])

    def motion(self, *shape: int) -> Kinematics:
        return Kinematics(self(*shape), self(*shape), self(*shape))

    def all_of(self, kind: Any) -> Any:
        return kind(**{one.name: self.one() for one in fields(kind)})


def march_state(heat: bool, last: LastStep | None = None) -> MarchState:
    """A march in its third step, of a body with two branches and memories on two boundaries."""
    some = Numbers()

    def state(**more: Any) -> TimeState:
        return TimeState(
            some.one(), 3, some.motion(7), some.motion(4, 2), some(4, 2), ledger=some.all_of(EnergyBalance), **more
        )  # fmt: skip

    memory = {"bottom": {"0.opening": some(3), "1.depth": some(3)}, "right": {"slip": some(1), "opening": some(1)}}
    warm = ThermalState(replace(state(), index=4), some.all_of(HeatBalance), 5, some.one()) if heat else None
    values = [{"normal_force": some.one(), "tip.u_x": some.one(), "time_error": math.nan} for _ in range(3)]
    frames = [
        Frame(
            some.one(), some(5, 2), some(5, 2), *(some(4, 2) for _ in range(3)), some.one(),
            {"opening": some(4), "slip": some(4)}, some(5) if heat else None,
        )
        for _ in range(2)
    ]  # fmt: skip
    return MarchState(
        state(
            branches=(some(7), some(7)),
            memory=memory,
            heat=warm,
            history=last,
            shown=ContactForce(some.one(), some(4, 2)),
        ),
        StepSizeState(some.one(), -2, 1),
        tuple(
            Row(some.one(), some.one(), i + 6, some.one(), some.one(), math.inf, one, i == 1)
            for i, one in enumerate(values)
        ),
        tuple(frames),
        (9, 4),
        ((some.one(), "touch"), (some.one(), "release")),
        ("the body jumped", "and again"),
        some.one(),
        some.one(),
        some(7),
        some.one() ** 2,
        False,
    )


def same(one: Any, other: Any, where: str = "state") -> None:
    if is_dataclass(one) and not isinstance(one, type):
        assert type(one) is type(other), where
        for part in fields(one):
            same(getattr(one, part.name), getattr(other, part.name), f"{where}.{part.name}")
    elif isinstance(one, Mapping):
        assert list(one) == list(other), where
        for key in one:
            same(one[key], other[key], f"{where}[{key}]")
    elif isinstance(one, tuple):
        assert len(one) == len(other), where
        for i, (first, second) in enumerate(zip(one, other, strict=True)):
            same(first, second, f"{where}[{i}]")
    elif isinstance(one, float | np.ndarray):
        np.testing.assert_array_equal(np.asarray(one), np.asarray(other), err_msg=where)
    else:
        assert type(one) is type(other), where
        assert one == other, where


@pytest.mark.parametrize("last", ["nothing", "force", "rates"])
@pytest.mark.parametrize("heat", [False, True])
def test_what_was_packed_is_unpacked(heat: bool, last: str) -> None:
    some = Numbers()
    history = {
        "nothing": None,
        "force": LastStep(some.one(), some(7), some(4, 2)),
        "rates": LastStep(some.one(), None, some(4, 2), Rates(some(7), some(7)), Rates(some(4, 2), some(4, 2))),
    }[last]
    kept, stream, written = Checkpoint(Path("run.ckpt")), io.BytesIO(), march_state(heat, history)
    kept.pack(stream, written, "mine")
    same(written, kept.unpack(stream.getvalue(), "mine"))
    with pytest.raises(FileError, match="another evolution"):
        kept.unpack(stream.getvalue(), "yours")
    for broken in (b"", stream.getvalue()[:200], b"not a checkpoint"):
        with pytest.raises(FileError, match="not a checkpoint"):
            kept.unpack(broken, "mine")


def test_a_file_that_is_not_there_and_one_that_is(tmp_path: Path) -> None:
    kept = Checkpoint(tmp_path / "run.ckpt", 0.0)
    assert kept.read("mine") is None
    kept.write(march_state(False), "mine")
    found = kept.read("mine")
    same(march_state(False), found)
    with pytest.raises(ProblemError, match="time >= 0"):
        Checkpoint(tmp_path / "run.ckpt", -1.0)
    with pytest.raises(ProblemError, match="time >= 0"):
        Checkpoint(tmp_path / "run.ckpt", math.nan)


def test_the_message_says_what_differs(tmp_path: Path) -> None:
    one = "1.0|evolution|scheme|method|steps"
    for other, words in (
        ("1.1|evolution|scheme|method|steps", "version"),
        ("1.0|other|scheme|method|other", "evolution"),
        ("1.0|evolution|other|other|steps", "scheme and method"),
        ("1.1|evolution|other|other|steps", "version, scheme and method"),
        ("0123456789abcdef", "evolution, scheme, method or version"),
    ):
        assert differences(one, other) == words


@pytest.mark.parametrize("cut", [3, 6, 11])
def test_a_run_that_goes_on_ends_its_steps_at_the_same_times(cut: int, tmp_path: Path) -> None:
    """Sums of steps gather rounding, multiples of them do not: 0.1 + 0.1 + ... is not 1.2."""
    kept = Checkpoint(tmp_path / "run.ckpt", 0.0)
    whole = march(beam(), 1.6, step=0.1)
    march(beam(), cut / 10.0, step=0.1, checkpoint=kept)
    resumed = march(beam(), 1.6, step=0.1, checkpoint=kept, resume=True)
    np.testing.assert_array_equal(resumed.times[cut + 1 :], whole.times[cut + 1 :])
    np.testing.assert_array_equal(whole.times[:-1], 0.1 * np.arange(16))
