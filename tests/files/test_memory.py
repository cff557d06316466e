"""Memory is predicted before anything large is made: quickly, in one sentence, without making it."""

from __future__ import annotations

import tracemalloc

import pytest

import hemivar.basics.memory as machine
from hemivar.errors import ProblemError
from hemivar.files.problem_file import parse_problem_file
from hemivar.mesh import Mesh, rectangle

MATERIAL = "[material]\nlame = [4.0, 4.0]\n"


@pytest.mark.parametrize(
    ("mesh", "key"),
    [
        ("rectangle = [1.0, 1.0]\ncells = 20000", "cells"),
        ("rectangle = [1.0, 1.0]\ncells = [4, 4]\nrefine = 1000", "refine"),
        ("rectangle = [1.0, 1.0]\ncells = [4, 4]\nrefine = 17", "refine"),
        ("rectangle = [1.0, 1.0]\ncells = 1" + 300 * "0", "cells"),
        ("box = [1.0, 1.0, 1.0]\ncells = 1000", "cells"),
        ("box = [1.0, 1.0, 1.0]\ncells = 200\norder = 2", "cells"),
    ],
)
def test_problem_files_that_do_not_fit_are_refused_before_the_mesh(mesh: str, key: str) -> None:
    tracemalloc.start()
    try:
        with pytest.raises(ProblemError, match=rf"problem: \[mesh\] {key}: a problem on .* needs about .* free"):
            parse_problem_file(f"[mesh]\n{mesh}\n{MATERIAL}")
        assert tracemalloc.get_traced_memory()[1] < 2**20
    finally:
        tracemalloc.stop()


def test_order_and_free_memory_count(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(machine, "available_bytes", lambda: 2.0**29)
    text = f"[mesh]\nrectangle = [1.0, 1.0]\ncells = 300\n{{}}\n{MATERIAL}"
    assert parse_problem_file(text.format("")).problem.mesh.number_of_cells == 180000
    with pytest.raises(ProblemError, match=r"1\.8e\+05 cells of order 2"):
        parse_problem_file(text.format("order = 2"))
    monkeypatch.setattr(machine, "available_bytes", lambda: 2.0**26)
    with pytest.raises(ProblemError, match="free"):
        parse_problem_file(text.format(""))
    square = rectangle(cells=400)
    with pytest.raises(ProblemError, match="320000 cells"):
        Mesh(square.points, square.cells)
    machine.require(2.0**25, "little")
    with pytest.raises(ProblemError, match="little needs about 128 MiB"):
        machine.require(2.0**25, "little", sharers=4)
    monkeypatch.setattr(machine, "available_bytes", lambda: None)
    with pytest.raises(ProblemError, match="about 16 GiB are assumed"):
        rectangle(cells=10**5)
