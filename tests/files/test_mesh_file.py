"""Names of files that no mesh can come from, and formats of meshio."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from hemivar.errors import ProblemError
from hemivar.files.problem_file import parse_problem_file, read_problem
from hemivar.mesh import read_mesh


@pytest.mark.skipif(sys.platform == "win32", reason="needs pipes and links")
@pytest.mark.parametrize("kind", ["pipe", "device", "endless", "folder", "nul", "loop", "long"])
@pytest.mark.parametrize("read", [read_mesh, read_problem])
def test_only_regular_files_are_opened(kind: str, read: Callable[[Path], object], tmp_path: Path) -> None:
    """A pipe would hang, /dev/zero would never end."""
    path = tmp_path / "part.msh"
    if kind == "pipe":
        os.mkfifo(path)
    elif kind == "loop":
        path.symlink_to(path)
    elif kind == "folder":
        path.mkdir()
    else:
        path = {"device": Path("/dev/null"), "endless": Path("/dev/zero"), "nul": Path("a\0b.msh")}.get(
            kind, tmp_path / (5000 * "x")
        )
    with pytest.raises(ProblemError, match=r"regular file|folder|directory|cannot read") as caught:
        read(path)
    assert "\n" not in str(caught.value)
    assert "\0" not in str(caught.value)


def test_problem_files_have_a_limit(tmp_path: Path) -> None:
    path = tmp_path / "large.toml"
    with path.open("wb") as stream:
        stream.truncate(17 * 2**20)
    with pytest.raises(ProblemError, match="has 17 MiB; at most 16 MiB are read"):
        read_problem(path)


def test_problem_files_name_the_mesh_file_and_their_key(tmp_path: Path) -> None:
    (tmp_path / "part.msh").write_text("no mesh")
    text = '[mesh]\nfile = "part.msh"\n[material]\nlame = [4.0, 4.0]\n'
    with pytest.raises(ProblemError, match=r"problem: \[mesh\] file: mesh file '.*part.msh' cannot be read"):
        parse_problem_file(text, tmp_path)
