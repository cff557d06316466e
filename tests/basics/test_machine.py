"""How many processors a process may use."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from hemivar.basics import machine


@pytest.mark.parametrize(
    ("files", "expected"),
    [
        ({"cpu.max": "max 100000\n"}, 8),
        ({"cpu.max": "200000 100000\n"}, 2),
        ({"cpu.max": "250000 100000\n"}, 2),
        ({"cpu.max": "50000 100000\n"}, 1),
        ({"cpu.max": "9900000 100000\n"}, 8),
        ({"cpu.max": "nonsense\n"}, 8),
        ({}, 8),
    ],
)
def test_the_quota_of_a_control_group_counts(
    files: dict[str, str], expected: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name, text in files.items():
        (tmp_path / name).write_text(text)
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: set(range(8)), raising=False)
    monkeypatch.setattr(machine, "control_groups", lambda _: iter([(tmp_path / "none", True), (tmp_path, True)]))
    assert machine.cores() == expected


def test_the_quota_of_the_first_version_counts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: set(range(8)), raising=False)
    monkeypatch.setattr(machine, "control_groups", lambda _: iter([(tmp_path, False)]))
    (tmp_path / "cpu.cfs_period_us").write_text("100000\n")
    for quota, expected in (("-1", 8), ("300000", 3)):
        (tmp_path / "cpu.cfs_quota_us").write_text(f"{quota}\n")
        assert machine.cores() == expected


def test_control_groups_are_those_of_the_process_and_above(monkeypatch: pytest.MonkeyPatch) -> None:
    lines = {"/proc/self/cgroup": ["4:memory:/a/b", "1:cpu,cpuacct:/c", "0::/d"]}
    monkeypatch.setattr(machine, "lines_of", lambda path: lines.get(str(path), []))
    found = [(str(folder), second) for folder, second in machine.control_groups("cpu")]
    root = "/sys/fs/cgroup"
    assert found == [(f"{root}/cpu/c", False), (f"{root}/cpu", False), (f"{root}/d", True), (root, True)]
    assert [str(folder) for folder, second in machine.control_groups("memory") if not second] == [
        f"{root}/memory/a/b", f"{root}/memory/a", f"{root}/memory"
    ]  # fmt: skip
