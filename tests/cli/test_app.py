"""The command: what it prints, what it writes, and how it answers bad input."""

from __future__ import annotations

import csv
import json
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

import hemivar
from hemivar import cli
from hemivar.cli.session import Session
from hemivar.files.sample import SAMPLE
from tests.problem_files import block_file

BASE = block_file(4) + "gap = 0.0\n"


def changed(*pairs: tuple[str, str]) -> str:
    """The base problem with some lines replaced."""
    text = BASE
    for old, new in pairs:
        assert old in text
        text = text.replace(old, new)
    return text


def gmsh(nodes: list[tuple[float, ...]], elements: list[str], groups: list[str]) -> str:
    """A Gmsh file of format 2.2."""
    rows = [f"{i + 1} {' '.join(repr(float(c)) for c in (*node, 0.0, 0.0)[:3])}" for i, node in enumerate(nodes)]
    cells = [f"{i + 1} {element}" for i, element in enumerate(elements)]
    parts = [
        "$MeshFormat", "2.2 0 8", "$EndMeshFormat",
        "$PhysicalNames", str(len(groups)), *groups, "$EndPhysicalNames",
        "$Nodes", str(len(rows)), *rows, "$EndNodes",
        "$Elements", str(len(cells)), *cells, "$EndElements", "",
    ]  # fmt: skip
    return "\n".join(parts)


SQUARE = [(0, 0), (1, 0), (1, 1), (0, 1)]
GROUPS = ['1 1 "left"', '1 2 "bottom"', '2 3 "steel"', '2 4 "rubber"']
LINES = ["1 2 1 1 4 1", "1 2 2 2 1 2"]
TRIANGLES = ["2 2 3 3 1 2 3", "2 2 4 4 1 3 4"]
GOOD_MESH = gmsh(SQUARE, LINES + TRIANGLES, GROUPS)
MESH_FILE = ("rectangle = [1.0, 1.0]\ncells = [4, 4]", 'file = "part.msh"')
TWO_MATERIALS = ("lame = [4.0, 4.0]", "[material.regions.steel]\nlame = [4.0, 4.0]\n[material.regions.rubber]\n")


def run(capsys: pytest.CaptureFixture[str], *arguments: object) -> tuple[int, str, str]:
    """Run the command in this process: exit code, output, errors."""
    code = cli.main([str(argument) for argument in arguments])
    captured = capsys.readouterr()
    return code, captured.out, captured.err


def in_process(*arguments: object, cwd: Path, **environment: str) -> subprocess.CompletedProcess[str]:
    """Run the command as users do."""
    source = str(Path(cli.__file__).parents[2])
    path = os.pathsep.join([source, os.environ.get("PYTHONPATH", "")])
    return subprocess.run(
        [sys.executable, "-m", "hemivar", *map(str, arguments)],
        cwd=cwd, env={**os.environ, "PYTHONPATH": path, **environment}, capture_output=True, text=True,
        timeout=120, check=False,
    )  # fmt: skip


# ---- bad problem files -----------------------------------------------------------------------------------

BAD_FILES: dict[str, tuple[str, list[str]]] = {
    # how the file is written
    "TOML syntax": (changed(("lame = [4.0, 4.0]", "lame = [4.0, 4.0")), ["not valid TOML", "line 7"]),
    "empty file": ("", ["[mesh]", "missing", "add it"]),
    "key twice": (BASE + "gap = 1.0\n", ["not valid TOML", "line"]),
    # names
    "misspelt key": (
        changed(("lame = [4.0, 4.0]", "yuong = 10.0\npoisson = 0.3")),
        ["[material] yuong", "did you mean 'young'?"],
    ),
    "misspelt table": (changed(("[supports]", "[suports]")), ["suports", "did you mean 'supports'?"]),
    "key of another table": (
        changed(("cells = [4, 4]", "cells = [4, 4]\ngap = 0.1")),
        ["[mesh] gap", "it belongs in [contact.NAME]"],
    ),
    "unknown key": (changed(("gap = 0.0", "colour = 1")), ["[contact.bottom] colour", "known here: normal"]),
    "unknown boundary, support": (
        changed(('left = "clamped"', 'lft = "clamped"')),
        ["[supports] lft", "did you mean 'left'?", "boundaries: left, right"],
    ),
    "unknown boundary, contact": (
        changed(("[contact.bottom]", "[contact.floor]")),
        ["[contact] floor", "no boundary 'floor'", "boundaries: left"],
    ),
    "unknown boundary, traction": (
        changed(("body = [-0.8, -0.8]", "traction = { topp = [0.0, 1.0] }")),
        ["[loads] traction.topp", "did you mean 'top'?"],
    ),
    "unknown boundary, pressure": (
        changed(("body = [-0.8, -0.8]", "pressure = { side = 1.0 }")),
        ["[loads] pressure.side", "no boundary 'side'"],
    ),
    "unknown region": (
        changed(("lame = [4.0, 4.0]", "[material.regions.steel]\nlame = [4.0, 4.0]")),
        ["[material.regions] steel", "no region 'steel'", "regions: none"],
    ),
    "misspelt region": (
        changed(MESH_FILE, ("lame = [4.0, 4.0]", "[material.regions.stell]\nlame = [4.0, 4.0]")),
        ["[material.regions] stell", "did you mean 'steel'?"],
    ),
    "uncovered region": (
        changed(MESH_FILE, ("lame = [4.0, 4.0]", "[material.regions.steel]\nlame = [4.0, 4.0]")),
        ["[material] the point", "no region that the material names", "cover the body"],
    ),
    "unknown law": (
        changed(('"survey"', '"suvrey"')),
        ["[contact.bottom] normal.law", "did you mean 'survey'?", "signorini"],
    ),
    "law of the other kind": (
        changed(('normal = { law = "survey", q_max = 0.3, p_const = 2.0 }', 'normal = "tresca"')),
        ["[contact.bottom] normal.law", "'tresca' is a friction law", "use it under friction"],
    ),
    "missing normal law": (
        changed(('normal = { law = "survey", q_max = 0.3, p_const = 2.0 }\n', "")),
        ["[contact.bottom] normal", "is missing", "adhesive, barton-bandis"],
    ),
    "law without a name": (
        changed(('law = "tresca", ', "")),
        ["[contact.bottom] friction", "add law"],
    ),
    "law not a text": (changed(('law = "tresca"', "law = 3")), ["[contact.bottom] friction.law", "3"]),
    "missing law parameter": (
        changed(("q_max = 0.3, ", "")),
        ["[contact.bottom] normal.q_max", "is missing", "q_max = ..."],
    ),
    "misspelt law parameter": (
        changed(("q_max", "qmax")),
        ["[contact.bottom] normal.qmax", "did you mean 'q_max'?"],
    ),
    "unknown method": (
        BASE + '[solver]\nmethod = "newtn"\n',
        ["[solver] method", "did you mean 'newton'?"],
    ),
    # numbers
    "nan": (changed(("bound = 0.5", "bound = nan")), ["[contact.bottom] friction.bound", "nan", "finite"]),
    "infinite load": (changed(("-0.8, -0.8", "-0.8, inf")), ["[loads] body", "inf", "finite"]),
    "huge integer": (changed(("gap = 0.0", "gap = 1" + "0" * 400)), ["[contact.bottom] gap", "finite"]),
    "negative mu": (changed(("[4.0, 4.0]", "[4.0, -4.0]")), ["[material] lame", "mu is -4", "positive"]),
    "lambda too small": (changed(("[4.0, 4.0]", "[-5.0, 4.0]")), ["[material] lame", "lam = -5", "exceed"]),
    "nu = 0.5": (
        changed(("lame = [4.0, 4.0]", "young = 10.0\npoisson = 0.5")),
        ["[material] poisson", "is 0.5", "between -1 and 0.5"],
    ),
    "young = 0": (
        changed(("lame = [4.0, 4.0]", "young = 0.0\npoisson = 0.3")),
        ["[material] young", "greater than 0"],
    ),
    "young without poisson": (
        changed(("lame = [4.0, 4.0]", "young = 1.0")),
        ["[material] poisson", "is missing"],
    ),
    "two kinds of constants": (
        changed(("lame = [4.0, 4.0]", "lame = [4.0, 4.0]\nyoung = 1.0")),
        ["[material]", "lame and young are given", "give lame, or young and poisson"],
    ),
    "poisson with lame": (
        changed(("lame = [4.0, 4.0]", "lame = [4.0, 4.0]\npoisson = 0.3")),
        ["[material] poisson", "goes with young", "remove it"],
    ),
    "no constants": (changed(("lame = [4.0, 4.0]\n", "")), ["[material]", "no elastic constants", "give lame"]),
    "unknown plane": (
        changed(("lame = [4.0, 4.0]", 'lame = [4.0, 4.0]\nplane = "stran"')),
        ["[material] plane", "did you mean 'strain'?"],
    ),
    "tensor not definite": (
        changed(("lame = [4.0, 4.0]", "tensor = [[1.0, 2.0, 0.0], [2.0, 1.0, 0.0], [0.0, 0.0, 1.0]]")),
        ["[material] tensor", "not positive definite"],
    ),
    "tensor not symmetric": (
        changed(("lame = [4.0, 4.0]", "tensor = [[3.0, 1.0, 0.0], [0.0, 3.0, 0.0], [0.0, 0.0, 1.0]]")),
        ["[material] tensor", "not symmetric"],
    ),
    "tensor of the wrong shape": (
        changed(("lame = [4.0, 4.0]", "tensor = [[3.0, 1.0], [1.0, 3.0]]")),
        ["[material] tensor", "3 lists of 3"],
    ),
    "negative friction bound": (
        changed(("bound = 0.5", "bound = -0.5")),
        ["[contact.bottom] friction.bound", "-0.5", "at least 0"],
    ),
    "negative bound by formula": (
        changed(("bound = 0.5", 'bound = "x - 0.4"')),
        ["[contact.bottom] friction.bound", "formula 'x - 0.4' is -0.4 at x = 0, y = 0", "at least 0"],
    ),
    "exponent below 1": (
        changed(('law = "survey", q_max = 0.3, p_const = 2.0', 'law = "compliance", stiffness = 1, exponent = 0.5')),
        ["[contact.bottom] normal.exponent", "at least 1"],
    ),
    "vector too long": (changed(("-0.8, -0.8", "0.0, 0.0, 1.0")), ["[loads] body", "3 entries", "list of 2"]),
    "number for a vector": (changed(("[-0.8, -0.8]", "-0.8")), ["[loads] body", "list of 2 numbers", "-0.8"]),
    "text for a number": (
        changed(("[4.0, 4.0]", '["stiff", 4.0]')),
        ["[material] lame", "'stiff'", "not known"],
    ),
    "boolean for a number": (changed(("gap = 0.0", "gap = true")), ["[contact.bottom] gap", "not true"]),
    "date for a number": (changed(("gap = 0.0", "gap = 2024-05-01")), ["[contact.bottom] gap", "2024-05-01"]),
    "list for a gap": (changed(("gap = 0.0", "gap = [0.0, 0.1]")), ["[contact.bottom] gap", "not a list"]),
    "number for a title": (changed(('"block"', "3")), ["title", "must be a text", "quotes"]),
    "text for a table": (
        changed(("[material]\nlame = [4.0, 4.0]\n", ""), ('title = "block"', 'material = "steel"')),
        ["material", "must be a table", "write [material]"],
    ),
    # formulas
    "formula, unknown name": (
        changed(("gap = 0.0", 'gap = "0.1 * q"')),
        ["[contact.bottom] gap", "'0.1 * q' at character 7", "'q' is not known"],
    ),
    "formula, time in statics": (changed(("gap = 0.0", 'gap = "0.1 * t"')), ["gap", "depends on time", "[time]"]),
    "formula, misspelt function": (
        changed(("gap = 0.0", 'gap = "sine(x)"')),
        ["[contact.bottom] gap", "character 1", "did you mean 'sin'?"],
    ),
    "formula, syntax": (changed(("gap = 0.0", 'gap = "0.1 * (x"')), ["[contact.bottom] gap", "character 7"]),
    "formula, Python": (
        changed(("gap = 0.0", "gap = '__import__(\"os\").getcwd()'")),
        ["[contact.bottom] gap", "does not belong in a formula"],
    ),
    "formula, z in the plane": (changed(("gap = 0.0", 'gap = "z"')), ["[contact.bottom] gap", "mesh is plane"]),
    "formula, nan": (
        changed(("gap = 0.0", 'gap = "sqrt(x - 0.3)"')),
        ["[contact.bottom] gap", "is nan at x = 0, y = 0", "finite"],
    ),
    "formula, negative mu somewhere": (
        changed(("[4.0, 4.0]", '[4.0, "x - 0.5"]')),
        ["[material] material constant mu", "at x =", "positive"],
    ),
    # mesh
    "zero width": (changed(("[1.0, 1.0]", "[0.0, 1.0]")), ["[mesh] rectangle", "positive"]),
    "text for a length": (changed(("[1.0, 1.0]", '["wide", 1.0]')), ["[mesh] rectangle", "must be a number"]),
    "no cells": (changed(("cells = [4, 4]\n", "")), ["[mesh] cells", "is missing", "such as [32, 32]"]),
    "half a cell": (changed(("[4, 4]", "[4, 4.5]")), ["[mesh] cells", "4.5", "whole number"]),
    "zero cells": (changed(("[4, 4]", "[0, 4]")), ["[mesh] cells", "at least 1"]),
    "too many cells": (changed(("[4, 4]", "[1000000, 1000000]")), ["[mesh] cells", "take fewer"]),
    "too often refined": (changed(("[4, 4]", "[4, 4]\nrefine = 30")), ["[mesh] refine", "take fewer"]),
    "unknown pattern": (
        changed(("[4, 4]", '[4, 4]\npattern = "crss"')),
        ["[mesh] pattern", "did you mean 'cross'?"],
    ),
    "order 3": (changed(("[4, 4]", "[4, 4]\norder = 3")), ["[mesh] order", "1 or 2"]),
    "unknown quadrature": (
        changed(("[4, 4]", '[4, 4]\nquadrature = "mid-point"')),
        ["[mesh] quadrature", "did you mean 'midpoint'?"],
    ),
    "negative scale": (changed(("[4, 4]", "[4, 4]\nscale = -1.0")), ["[mesh] scale", "positive"]),
    "rectangle and file": (
        changed(("[4, 4]", '[4, 4]\nfile = "part.msh"')),
        ["[mesh] rectangle, box, file", "give one of the three"],
    ),
    "neither rectangle nor file": (
        changed(("rectangle = [1.0, 1.0]\ncells = [4, 4]\n", "")),
        ["[mesh] rectangle, box, file", "none is given"],
    ),
    "cells with a file": (
        changed(("rectangle = [1.0, 1.0]", 'file = "part.msh"')),
        ["[mesh] cells", "comes from a file", "remove it"],
    ),
    "missing mesh file": (
        changed((MESH_FILE[0], 'file = "nowhere.msh"')),
        ["[mesh] file", "nowhere.msh' does not exist", "check the path"],
    ),
    "unreadable mesh": (changed((MESH_FILE[0], 'file = "garbage.msh"')), ["[mesh] file", "cannot be read"]),
    "mesh of unknown format": (changed((MESH_FILE[0], 'file = "mesh.xyz9"')), ["[mesh] file", "cannot be read"]),
    "cells of third order": (
        changed((MESH_FILE[0], 'file = "cubic.msh"')),
        ["[mesh] file", "cells of type triangle10", "of order 1 or 2"],
    ),
    "no cells in the mesh": (changed((MESH_FILE[0], 'file = "lines.msh"')), ["[mesh] file", "no cells of a body"]),
    "degenerate cells": (
        changed((MESH_FILE[0], 'file = "flat.msh"')),
        ["[mesh] file: mesh file 'flat.msh': ", "degenerate (no volume)", "cells 1"],
    ),
    "inner facet as boundary": (
        changed((MESH_FILE[0], 'file = "inner.msh"')),
        ["left", "lies inside the body", "[mesh] opened"],
    ),
    "empty boundary": (
        changed((MESH_FILE[0], 'file = "empty.msh"')),
        ["left", "boundary 'left'"],
    ),
    "nan in the mesh": (changed((MESH_FILE[0], 'file = "nan.msh"')), ["[mesh] file", "must be finite"]),
    # supports and loads
    "no support": (
        changed(('left = "clamped"', 'left = "roller"'), ("bound = 0.5", "bound = 0.0"), ("-0.8, -0.8", "0.0, 0.8")),
        ["[supports] the body is free to move", "translation (0, 1)", "add a support"],
    ),
    "nothing constrains the rigid motion": (
        changed(("[supports]\n", ""), ('left = "clamped"\n', "")),
        ["[supports] the body is free to move", "add a support"],
    ),
    "contact where clamped": (
        changed(('left = "clamped"', 'bottom = "clamped"')),
        ["[contact] contact boundary 'bottom' is clamped", "remove one of the two"],
    ),
    "conflicting supports": (
        changed(('left = "clamped"', 'left = "clamped"\ntop = { displacement = [0.0, -0.1] }')),
        ["[supports] supports 'left' and 'top'", "node", "make them agree"],
    ),
    "unknown support": (changed(('"clamped"', '"clamp"')), ["[supports] left", "did you mean 'clamped'?"]),
    "number for a support": (changed(('"clamped"', "0.0")), ["[supports] left", "must be", "the number 0.0"]),
    "support that fixes nothing": (changed(('"clamped"', "{}")), ["[supports] left", "fixes nothing"]),
    "support in z": (changed(('"clamped"', "{ z = 0.0 }")), ["[supports] left.z", "unknown key", "x, y"]),
    "displacement and component": (
        changed(('"clamped"', "{ x = 0.0, displacement = [0.0, 0.0] }")),
        ["[supports] left.displacement", "remove the single ones"],
    ),
    "traction and pressure": (
        changed(("body = [-0.8, -0.8]", "traction = { top = [0.0, 1.0] }\npressure = { top = 1.0 }")),
        ["[loads] pressure.top", "give one of the two"],
    ),
    "penetration forbidden by a support": (
        changed(
            ('normal = { law = "survey", q_max = 0.3, p_const = 2.0 }', 'normal = "signorini"'),
            ('left = "clamped"', 'left = { displacement = [0.0, -0.1] }'),
        ),
        ["law forbids", "change the support or the gap"],
    ),
    # solver
    "zero tolerance": (BASE + "[solver]\nrtol = 0.0\n", ["[solver] rtol", "positive"]),
    "negative time": (BASE + "[solver]\nmax_time = -1\n", ["[solver] max_time", "positive"]),
    "half a step": (BASE + "[solver]\nmax_steps = 1.5\n", ["[solver] max_steps", "whole number"]),
}  # fmt: skip


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with good and bad meshes, as the current one."""
    meshes = {
        "part.msh": GOOD_MESH,
        "garbage.msh": "this is not a mesh\n",
        "mesh.xyz9": "1 2 3\n",
        "cubic.msh": gmsh(SQUARE, [*LINES, "21 2 3 3 1 2 3 4 1 2 3 4 1 2"], GROUPS),
        "lines.msh": gmsh(SQUARE, LINES, GROUPS),
        "flat.msh": gmsh([*SQUARE[:2], (2, 0), (0, 1)], ["2 2 3 3 1 2 4", "2 2 4 4 1 2 3"], GROUPS),
        "inner.msh": gmsh(SQUARE, ["1 2 1 1 1 3", *TRIANGLES], GROUPS),
        "empty.msh": gmsh(SQUARE, [LINES[1], *TRIANGLES], GROUPS),
        "nan.msh": gmsh([*SQUARE[:3], (float("nan"), 1.0)], LINES + TRIANGLES, GROUPS),
    }
    for name, text in meshes.items():
        (tmp_path / name).write_text(text)
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize("case", BAD_FILES)
def test_bad_problem_file_gives_one_line_that_names_file_key_and_remedy(
    case: str, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text, words = BAD_FILES[case]
    (folder / "part.toml").write_text(text)
    code, out, err = run(capsys, "solve", "part.toml")
    assert code == 2
    assert err.startswith("hemivar: error: part.toml: ")
    assert err.count("\n") == 1
    assert err.endswith("\n")
    for word in words:
        assert word in err
    assert "converged" not in out


def test_a_word_in_a_message_makes_no_trouble_of_supports(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A contact boundary may be called 'support'; the table is named by the kind of the error alone."""
    lines = ["1 2 1 1 4 1", "1 2 1 1 2 3", "1 2 2 2 1 2"]
    groups = [name.replace("bottom", "support") for name in GROUPS]
    (folder / "part.msh").write_text(gmsh(SQUARE, lines + TRIANGLES, groups))
    text = changed(MESH_FILE, ("contact.bottom", "contact.support"))
    (folder / "part.toml").write_text(text.replace('"part.msh"', '"part.msh"\nrefine = 2\nquadrature = "midpoint"'))
    code, _, err = run(capsys, "solve", "part.toml")
    assert code == 2
    assert err.startswith("hemivar: error: part.toml: contact 'support': midpoint quadrature")


# ---- bad command lines -----------------------------------------------------------------------------------

BAD_COMMANDS: dict[str, tuple[list[str], list[str]]] = {
    "no argument": (["solve"], ["Missing argument", "--help"]),
    "unknown command": (["slove", "part.toml"], ["slove", "--help"]),
    "unknown option": (["solve", "part.toml", "--metod", "newton"], ["--metod", "--help"]),
    "not a number": (["solve", "part.toml", "--rtol", "small"], ["--rtol", "--help"]),
    "missing problem file": (["solve", "nowhere.toml"], ["nowhere.toml", "does not exist", "hemivar new"]),
    "folder as problem file": (["solve", "."], ["this is a folder"]),
    "binary problem file": (["solve", "binary.toml"], ["binary.toml", "UTF-8"]),
    "mesh as problem file": (["solve", "part.msh"], ["part.msh", "not valid TOML"]),
    "unknown method": (["solve", "part.toml", "--method", "newtn"], ["'newtn'", "did you mean 'newton'?"]),
    "unknown methods": (["compare", "part.toml", "--methods", "newton,bundel"], ["did you mean 'bundle'?"]),
    "unknown law": (["laws", "signorin"], ["did you mean 'signorini'?"]),
    "digits apart": (["solve", "part.toml", "--max-steps", "1_5"], ["--max-steps is '1_5'", "not a number"]),
    "seed in a word": (["solve", "part.toml", "--max-time=1_0.5e0"], ["--max-time is '1_0.5e0'", "not a number"]),
    "negative rtol": (["solve", "part.toml", "--rtol", "-1"], ["--rtol is -1", "positive"]),
    "rtol nan": (["solve", "part.toml", "--rtol", "nan"], ["--rtol is nan", "positive"]),
    "zero time": (["solve", "part.toml", "--max-time", "0"], ["--max-time is 0", "positive"]),
    "zero steps": (["solve", "part.toml", "--max-steps", "0"], ["--max-steps is 0", "at least 1"]),
    "output folder missing": (["solve", "part.toml", "--json", "out/a.json"], ["--json", "folder 'out'", "make it"]),
    "file as output folder": (["solve", "part.toml", "--vtu", "part.msh/a.vtu"], ["--vtu", "not a folder"]),
    "folder as output": (["solve", "part.toml", "--plot", "results.png"], ["--plot", "this is a folder"]),
    "figure suffix": (["solve", "part.toml", "--plot", "a.gif"], ["--plot a.gif", ".png or .svg or .pdf"]),
    "JSON suffix": (["solve", "part.toml", "--json", "a.txt"], ["--json a.txt", ".json"]),
    "arrays without JSON": (["solve", "part.toml", "--arrays", "a.npz"], ["--arrays goes with --json"]),
    "arrays suffix": (["solve", "part.toml", "--json", "a.json", "--arrays", "a.npy"], ["--arrays a.npy", ".npz"]),
    "arrays elsewhere": (
        ["solve", "part.toml", "--json", "a.json", "--arrays", "../a.npz"],
        ["--arrays ../a.npz", "in the folder of --json"],
    ),
    "VTU suffix": (["solve", "part.toml", "--vtu", "a.vtk"], ["--vtu a.vtk", ".vtu"]),
    "CSV suffix": (["compare", "part.toml", "--csv", "a.xls"], ["--csv a.xls", ".csv"]),
    "odd cells for a warm start": (["solve", "odd.toml", "--warm-start"], ["odd.toml", "--warm-start", "even"]),
    "an option that was removed": (["solve", "part.toml", "--render", "a.png"], ["--render was removed", "--plot"]),
    "contact figure without contact": (
        ["solve", "free.toml", "--plot-contact", "a.png"],
        ["free.toml: --plot-contact", "there is none", "--plot"],
    ),
    "survey into a file": (["survey", "--output", "part.msh"], ["--output part.msh", "name a folder"]),
    "survey with a strange mesh": (["survey", "--max-n", "100"], ["--max-n is 100", "power of two"]),
    "new over a file": (["new", "part.toml"], ["part.toml", "exists", "--force"]),
    "new in a missing folder": (["new", "a/b.toml"], ["folder 'a' does not exist"]),
    "new over a folder": (["new", "results.png"], ["this is a folder"]),
}  # fmt: skip


@pytest.mark.parametrize("case", BAD_COMMANDS)
def test_bad_command_line_gives_one_line(case: str, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (folder / "part.toml").write_text(BASE)
    (folder / "odd.toml").write_text(changed(("[4, 4]", "[5, 4]")))
    (folder / "free.toml").write_text(BASE[: BASE.index("[contact")])
    (folder / "binary.toml").write_bytes(b"\xff\xfe\x00\x80")
    (folder / "results.png").mkdir()
    before = sorted(folder.rglob("*"))
    arguments, words = BAD_COMMANDS[case]
    code, out, err = run(capsys, *arguments)
    assert code == 2
    assert err.startswith("hemivar: error: ")
    assert err.count("\n") == 1
    for word in words:
        assert word in err
    assert "step" not in out
    assert sorted(folder.rglob("*")) == before


def test_same_file_twice_is_refused(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (folder / "part.json").write_text(BASE)
    assert "this is the problem file already" in run(capsys, "solve", "part.json", "--json", "part.json")[2]
    assert (folder / "part.json").read_text() == BASE


def test_an_odd_size_of_the_survey_is_refused_before_anything_is_made(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(capsys, "survey", "--max-n", "4")[0] == 2
    assert not (folder / "survey-output").exists()


@pytest.mark.slow
def test_survey_writes_its_report(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, out, err = run(capsys, "survey", "--max-n", "8", "--output", "results", "--max-time", "20")
    assert (code, err) == (0, "")
    assert "results/report.html" in out
    assert len(re.findall(r"^    +\d\.\d\d   ", out, re.MULTILINE)) == 9
    begins = {"figure1.png": b"\x89PNG", "figure5.pdf": b"%PDF", "report.html": b"<!DOCTYPE html>"}
    for name, begin in begins.items():
        assert (folder / "results" / name).read_bytes().startswith(begin)


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() == 0, reason="the superuser may write everywhere")
def test_write_protected_places_are_refused(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (folder / "part.toml").write_text(BASE)
    (folder / "locked").mkdir()
    (folder / "locked").chmod(0o500)
    (folder / "kept.json").write_text("")
    (folder / "kept.json").chmod(0o400)
    for path in ("locked/a.json", "kept.json"):
        code, _, err = run(capsys, "solve", "part.toml", "--json", path)
        assert code == 2
        assert "write-protected" in err


# ---- what works ------------------------------------------------------------------------------------------


def test_solve_prints_a_summary_and_writes_files(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (folder / "part.toml").write_text(BASE)
    code, out, err = run(
        capsys, "solve", "part.toml", "--json", "a.json", "--vtu", "a.vtu", "--plot", "a.png",
        "--plot-contact", "c.pdf", "--rtol", "1e-8",
    )  # fmt: skip
    assert (code, err) == (0, "")
    assert out.startswith("block\n")
    for line in (
        r"mesh +25 nodes, 32 triangles, h = 0\.3536",
        r"unknowns +40",
        r"contact points +4 on bottom",
        r"method +newton",
        r"chosen +newton for 40 unknowns",
        r" +step +residual +energy +changed points",
        r" +0 +\S+ +\S+ +0",
        r" +[1-9] +\S+ +-0\.\d+ +\d+",
        r"status +converged after \d+ steps, .*",
        r"time +condense \S+ s, iterate \S+ s, recover \S+ s",
        r"normal force +0\.\d+",
        r"friction force +0\.\d+",
        r"contact length +\S+ of 0\.875",
        r"contact points +(\d open, )?\d contact; .*",
        r"max penetration +\S+",
        r"max pressure +\S+",
        r"written +a\.json, a\.vtu, a_contact\.vtu, a\.png, c\.pdf",
    ):
        assert re.search(rf"^{line}$", out, re.MULTILINE), line
    _, told, _ = run(capsys, "solve", "part.toml", "--verbose")
    predicted = r"^chosen +newton for 40 unknowns; predicted: newton \S+ s, multigrid \S+ s$"
    assert re.search(predicted, told, re.MULTILINE)
    record = json.loads((folder / "a.json").read_text())
    for key in ("status", "method", "unknowns", "energy", "residual", "steps", "timings", "contact"):
        assert key in record
    assert record["status"] == "converged"
    assert record["unknowns"] == 40
    assert len(record["contact"]["x"]) == 4
    assert (folder / "a.png").read_bytes().startswith(b"\x89PNG")
    assert (folder / "c.pdf").read_bytes().startswith(b"%PDF")


def test_arrays_stand_beside_the_json(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (folder / "part.toml").write_text(BASE)
    code, out, err = run(capsys, "solve", "part.toml", "--json", "a.json", "--arrays", "a.npz")
    assert (code, err) == (0, "")
    assert re.search(r"^written +a\.json, a\.npz$", out, re.MULTILINE)
    assert "displacement" not in json.loads((folder / "a.json").read_text())
    code, out, _ = run(capsys, "certify", "part.toml", "--solution", "a.json")
    assert code == 0


def test_quiet_prints_no_steps(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (folder / "part.toml").write_text(BASE)
    code, out, _ = run(capsys, "solve", "part.toml", "--quiet")
    assert code == 0
    assert "changed points" not in out
    assert "converged" in out


def test_warm_start_ends_at_the_same_solution(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (folder / "part.toml").write_text(changed(("[4, 4]", "[4, 8]\nrefine = 1")))
    energies = []
    for extra in ([], ["--warm-start"]):
        code, out, _ = run(capsys, "solve", "part.toml", "--json", "a.json", *extra)
        assert code == 0
        energies.append(json.loads((folder / "a.json").read_text())["energy"])
    assert out.count("changed points") == 3
    assert energies[0] == pytest.approx(energies[1], rel=1e-10)


def test_not_converged_writes_results_and_says_what_to_do(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (folder / "part.toml").write_text(BASE + '[solver]\nmethod = "direct-lbfgs"\nmax_steps = 1\n')
    code, out, err = run(capsys, "solve", "part.toml", "--json", "a.json")
    assert code == 1
    assert err.count("\n") == 1
    assert "max_steps" in err
    assert "raise" in err
    assert "direct-lbfgs" in out
    assert json.loads((folder / "a.json").read_text())["status"] == "max_steps"


def test_the_command_line_overrides_the_file(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (folder / "part.toml").write_text(BASE + '[solver]\nmethod = "direct-lbfgs"\nmax_steps = 1\n')
    code, out, _ = run(capsys, "solve", "part.toml", "--method", "newton", "--max-steps", "50")
    assert code == 0
    assert re.search(r"method +newton", out)
    assert "chosen" not in out


def test_without_a_method_the_cheapest_that_fits_is_taken(
    folder: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """With no memory for a factorisation it is multigrid, on every mesh of a warm start and for a certificate too."""
    (folder / "part.toml").write_text(changed(("[4, 4]", "[8, 8]")))
    run(capsys, "solve", "part.toml", "--method", "newton", "--json", "a.json")
    expected = json.loads((folder / "a.json").read_text())["energy"]
    monkeypatch.setattr("hemivar.solvers.choice.available_bytes", lambda: 1e3)
    monkeypatch.setattr("hemivar.solvers.choice._LITTLE", 0.0)
    for extra in ([], ["--warm-start"]):
        code, out, err = run(capsys, "solve", "part.toml", "--json", "a.json", *extra)
        assert (code, err) == (0, "")
        assert re.search(r"^method +multigrid\nchosen +multigrid for 144 unknowns: .* GiB", out, re.MULTILINE)
        record = json.loads((folder / "a.json").read_text())
        assert record["method"] == "multigrid"
        assert record["energy"] == pytest.approx(expected, rel=1e-10)
    code, out, _ = run(capsys, "certify", "part.toml")
    assert code == 0
    assert "solved here by multigrid (converged)" in out


def test_compare_takes_multigrid_for_reference_where_no_factorisation_fits(
    folder: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    (folder / "part.toml").write_text(BASE)
    monkeypatch.setattr("hemivar.linear.factor_memory.available_bytes", lambda: 1e3)
    code, out, err = run(capsys, "compare", "part.toml", "--methods", "newton,bundle", "--json", "a.json")
    assert (code, err) == (0, "")
    assert re.search(r"^condensation +none: the factorisation of 40 unknowns.* are free", out, re.MULTILINE)
    record = json.loads((folder / "a.json").read_text())
    assert record["reference"] == "multigrid"
    assert [(row["method"], row["status"]) for row in record["methods"]] == [
        ("multigrid", "converged"), ("newton", "refused"), ("bundle", "refused"),
    ]  # fmt: skip


def test_regions_and_mesh_file(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    stiff = (TWO_MATERIALS[0], TWO_MATERIALS[1] + "young = 1.0\npoisson = 0.4\n")
    (folder / "part.toml").write_text(changed(MESH_FILE, stiff).replace("part.msh", 'part.msh"\nrefine = 3 #'))
    code, out, err = run(capsys, "solve", "part.toml", "--vtu", "a.vtu", "--warm-start")
    assert (code, err) == (0, "")
    assert "81 nodes, 128 triangles" in out


def test_elasticity_without_contact(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (folder / "part.toml").write_text(BASE[: BASE.index("[contact")])
    code, out, err = run(capsys, "solve", "part.toml", "--json", "a.json", "--plot", "a.svg", "--vtu", "a.vtu")
    assert (code, err) == (0, "")
    assert re.search(r"contact points +0$", out, re.MULTILINE)


def test_dollars_and_brackets_in_a_title(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (folder / "part.toml").write_text(changed(('"block"', '"[red]costs $_{ and $"')))
    code, out, _ = run(capsys, "solve", "part.toml", "--plot", "a.png")
    assert code == 0
    assert out.startswith("[red]costs $_{ and $\n")


def test_compare_has_a_row_for_every_method(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from hemivar.solvers import METHODS

    (folder / "part.toml").write_text(BASE)
    code, out, err = run(capsys, "compare", "part.toml", "--json", "a.json", "--csv", "a.csv")
    assert (code, err) == (0, "")
    data = json.loads((folder / "a.json").read_text())
    assert [row["method"] for row in data["methods"]] == list(METHODS)
    assert data["reference"] == "newton"
    for row in data["methods"]:
        assert re.search(rf"^ *{row['method']} +{row['status']}", out, re.MULTILINE)
        assert row["difference"] < 0.1
    with (folder / "a.csv").open() as stream:
        rows = list(csv.DictReader(stream))
    assert [row["method"] for row in rows] == list(METHODS)


def test_compare_tells_of_refusals_and_failures(
    folder: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    from hemivar import solvers
    from hemivar.solvers import NonsmoothNewton

    class Refusing(NonsmoothNewton):
        def refuse(self, problem: object) -> str:
            return "it is Monday"

    class Failing(NonsmoothNewton):
        def step(self, *_: object) -> None:  # type: ignore[override]
            raise ZeroDivisionError("by zero")

    table = {"newton": NonsmoothNewton(), "refusing": Refusing(), "failing": Failing()}
    monkeypatch.setattr(solvers, "METHODS", table)
    monkeypatch.setattr("hemivar.solvers.methods.METHODS", table)
    (folder / "part.toml").write_text(BASE)
    code, out, err = run(capsys, "compare", "part.toml", "--json", "a.json")
    assert (code, err) == (0, "")
    assert re.search(r"refusing +refused", out)
    assert "it is Monday" in out
    assert re.search(r"failing +failed", out)
    assert "ZeroDivisionError: by zero" in out
    assert json.loads((folder / "a.json").read_text())["methods"][1]["energy"] is None


def test_new_writes_a_sample_that_solves(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(capsys, "new")[0] == 0
    assert run(capsys, "new")[0] == 2
    assert run(capsys, "new", "--force")[0] == 0
    assert "hemivar solve problem.toml" in (folder / "problem.toml").read_text()
    assert SAMPLE.splitlines()[-1] == (folder / "problem.toml").read_text().splitlines()[-1]
    code, out, _ = run(capsys, "solve", "problem.toml")
    assert code == 0
    assert "2113 nodes" in out


def test_laws_and_methods_are_listed(capsys: pytest.CaptureFixture[str]) -> None:
    from hemivar.laws.registry import FRICTION_LAWS, NORMAL_LAWS
    from hemivar.solvers import METHODS

    code, out, _ = run(capsys, "laws")
    assert code == 0
    for name in (*NORMAL_LAWS, *FRICTION_LAWS):
        assert f"  {name}: " in out
    code, out, _ = run(capsys, "laws", "tresca")
    assert code == 0
    assert "bound" in out
    assert "survey" not in out
    code, out, _ = run(capsys, "methods")
    assert code == 0
    for name in METHODS:
        assert name in out


def test_help_tells_the_default_tolerance(capsys: pytest.CaptureFixture[str]) -> None:
    from hemivar.solvers import Controls

    code, out, _ = run(capsys, "solve", "--help")
    assert code == 0
    shown = re.search(r"\((1e-\d+), certify", " ".join(out.replace("│", " ").split()))
    assert shown is not None
    assert float(shown.group(1)) == Controls().rtol
    words = " ".join(re.sub(r"[^\w().']+", " ", out).split())  # the frame is drawn with other characters
    assert "Method see 'hemivar methods' (by predicted cost)." in words
    assert "Limit of iterations (set by the method)." in words


# ---- as a process ----------------------------------------------------------------------------------------


def test_the_module_runs_and_prints_its_version(tmp_path: Path) -> None:
    done = in_process("--version", cwd=tmp_path)
    assert done.returncode == 0
    assert done.stdout == f"hemivar {hemivar.__version__}\n"
    done = in_process(cwd=tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    assert [word in done.stdout for word in ("hemivar new", "hemivar solve", "hemivar certify")] == [True] * 3
    assert max(map(len, done.stdout.splitlines())) <= 80


def test_the_shell_completes_commands(tmp_path: Path) -> None:
    words = {"_HEMIVAR_COMPLETE": "complete_bash", "COMP_WORDS": "hemivar so", "COMP_CWORD": "1"}
    assert in_process(cwd=tmp_path, **words).stdout.split() == ["solve", "solutions"]


def test_help_imports_neither_numpy_nor_the_library(tmp_path: Path) -> None:
    code = (
        "import sys; from hemivar.cli import main; main(['--help']); "
        "print([m for m in sys.modules if m in ('numpy', 'scipy', 'matplotlib', 'meshio', 'hemivar.laws')])"
    )
    source = str(Path(cli.__file__).parents[2])
    done = subprocess.run(
        [sys.executable, "-c", code],
        cwd=tmp_path, env={**os.environ, "PYTHONPATH": source}, capture_output=True, text=True, check=True,
    )  # fmt: skip
    assert done.stdout.splitlines()[-1] == "[]"


def test_output_to_a_file_has_no_control_codes(tmp_path: Path) -> None:
    (tmp_path / "part.toml").write_text(changed(('"block"', '"Würfel"')), encoding="utf-8")
    done = in_process("solve", "part.toml", cwd=tmp_path, PYTHONIOENCODING="ascii")
    assert done.returncode == 0
    assert "\x1b" not in done.stdout
    assert done.stdout.startswith("W?rfel")


@pytest.mark.slow
def test_a_table_in_a_file_has_no_control_codes(tmp_path: Path) -> None:
    (tmp_path / "part.toml").write_text(changed(('"block"', '"Würfel"')), encoding="utf-8")
    done = in_process("compare", "part.toml", "--methods", "newton,active-set", cwd=tmp_path)
    assert done.returncode == 0
    assert "\x1b" not in done.stdout


def test_bad_input_as_a_process(tmp_path: Path) -> None:
    done = in_process("solve", "nowhere.toml", cwd=tmp_path)
    assert done.returncode == 2
    assert done.stderr.startswith("hemivar: error: nowhere.toml: ")
    assert done.stderr.count("\n") == 1


def test_a_full_disk_is_reported_in_one_line(tmp_path: Path) -> None:
    if not Path("/dev/full").exists():
        pytest.skip("no /dev/full here")
    (tmp_path / "part.toml").write_text(BASE)
    (tmp_path / "a.json").symlink_to("/dev/full")
    done = in_process("solve", "part.toml", "--json", "a.json", cwd=tmp_path)
    assert done.returncode == 2
    assert done.stderr.startswith("hemivar: error: ")
    assert done.stderr.count("\n") == 1


@pytest.mark.parametrize("raised", [KeyboardInterrupt, MemoryError, ZeroDivisionError, RecursionError])
def test_interrupts_and_the_like_before_the_iteration(
    raised: type[BaseException],
    folder: Path,
    capfd: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def stop(*_: object) -> None:
        raise raised

    monkeypatch.delenv("HEMIVAR_TRACEBACK", raising=False)
    monkeypatch.setattr(Session, "discrete", stop)
    (folder / "part.toml").write_text(BASE)
    code = cli.main(["solve", "part.toml"])
    err = capfd.readouterr().err.strip()
    expected = {
        KeyboardInterrupt: (130, "hemivar: interrupted"),
        MemoryError: (2, "hemivar: error: not enough memory for this problem; take --method multigrid, or fewer cells"),
        **{
            kind: (
                70,
                f"hemivar: error: internal error: {kind.__name__}; please report it, HEMIVAR_TRACEBACK=1 shows where",
            )
            for kind in (ZeroDivisionError, RecursionError)
        },
    }
    assert (code, err) == expected[raised]


@pytest.mark.slow
def test_interrupt_exits_with_130(tmp_path: Path) -> None:
    (tmp_path / "part.toml").write_text(changed(("[4, 4]", "[64, 64]")))
    source = str(Path(cli.__file__).parents[2])
    process = subprocess.Popen(
        [sys.executable, "-m", "hemivar", "solve", "part.toml", "--method", "direct-powell", "--json", "a.json"],
        cwd=tmp_path, env={**os.environ, "PYTHONPATH": source}, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        text=True, preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )  # fmt: skip
    assert process.stdout is not None
    while process.stdout.readline().split()[:1] != ["0"]:  # the start; the one step of Powell's method takes long
        assert process.poll() is None
    time.sleep(0.3)
    process.send_signal(signal.SIGINT)
    _, err = process.communicate(timeout=60)
    assert process.returncode == 130
    assert err.strip() == "hemivar: interrupted"
    assert json.loads((tmp_path / "a.json").read_text())["status"] == "interrupted"


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--colour", "stres", "--plot", "a.png"], "--colour stres: it is not known; did you mean 'stress'?"),
        (["--colour", "stress"], "--colour goes with --plot"),
    ],
)
def test_colours_are_checked_before_the_work(
    folder: Path, options: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    (folder / "part.toml").write_text(BASE)
    code, _, err = run(capsys, "solve", "part.toml", *options)
    assert code == 2
    assert message in err


def test_the_picture_of_a_solve_has_the_colours_asked_for(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (folder / "part.toml").write_text(BASE)
    for colour, words in (("stress", "von Mises stress<"), ("displacement", ">displacement<")):
        code, _, _ = run(capsys, "solve", "part.toml", "--quiet", "--plot", "a.svg", "--colour", colour)
        assert code == 0
        assert words in (folder / "a.svg").read_text()


def test_the_picture_tells_the_kind_that_was_certified(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (folder / "part.toml").write_text(BASE)
    code, out, _ = run(capsys, "solve", "part.toml", "--quiet", "--plot", "a.svg")
    assert code == 0
    told = re.search(r"^kind +(.*); (.*)$", out, re.MULTILINE)
    distance = re.search(r"^distance .*relative (\S+), to the exact discrete solution$", out, re.MULTILINE)
    assert told is not None
    assert distance is not None
    picture = (folder / "a.svg").read_text()
    (line,) = re.findall(r">residual .*exact discrete solution<", picture)
    assert told[1] in line
    drawn = re.search(r"at most (\S+) \(relative\)", line)
    assert drawn is not None
    assert float(drawn[1]) == pytest.approx(float(distance[1]), rel=0.1)  # with two digits there


@pytest.mark.parametrize("command", ["solve", "march", "sweep"])
def test_commands_say_how_a_mesh_file_was_read(
    command: str, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Cells that were split, and groups that were not taken; in one line each."""
    monkeypatch.chdir(tmp_path)
    lines = [f'{dim} {number} "{name}"' for dim, number, name in ((1, 1, "left"), (1, 2, "bottom"), (0, 3, "corner"))]
    (tmp_path / "part.msh").write_text(gmsh(SQUARE, [*LINES, "15 2 3 1 2", "3 2 4 3 1 2 3 4"], lines))
    path = tmp_path / "part.toml"
    path.write_text(changed(MESH_FILE) + ("\n[time]\nuntil = 1.0\nstep = 0.5\n" if command == "march" else ""))
    code, out, err = run(
        capsys, command, path, *(["--set", "contact.bottom.gap=0:0.1:2"] if command == "sweep" else [])
    )
    assert (code, err) == (0, ""), err + out
    assert out.count("mesh file         1 quadrilaterals were split into 4 triangles\n") == 1
    assert (
        out.count("mesh file         group 'corner' holds points only; it is a set of nodes, which supports may name\n")
        == 1
    )
