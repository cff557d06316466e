"""The harness itself: faults that are planted are counted, each in its column."""

from __future__ import annotations

import json
import math
import random
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import scipy.sparse.linalg

from tests.robustness.case import CANARY, Case, lay_out, leave_command
from tests.robustness.elasticity import Body, isotropic, load_of_body, load_of_facets, stiffness
from tests.robustness.expression import UnknownError, parse, value
from tests.robustness.graphs import Graph, SenselessError, normal_graph, read_table, slip_graph
from tests.robustness.judge import Outcome, _prints, judge, table
from tests.robustness.limited import Limits, Run, run_limited
from tests.robustness.msh import MalformedError, grid_mesh, read_msh, write_msh
from tests.robustness.oracle import Verdict, examine
from tests.robustness.seeds import FILES, SEEDS, known
from tests.robustness.toml import dump, spoilt
from tests.samples import slow

pytestmark = pytest.mark.skipif(
    not Path("/proc/self").is_dir(), reason="limits and states of processes are those of Linux"
)

_QUICK = Limits(processor=1, idle=0.5, memory=256 << 20, file_size=1 << 20)


def _outcome(tmp_path: Path, command: Callable[[], int], **others: object) -> tuple[Outcome, Run]:
    folder = tmp_path / "case"
    case = Case("0:0", "planted", "a fault", ["solve", "problem.toml"], {"problem.toml": b"title = 1\n"}, **others)
    lay_out(case, folder)
    before = _prints(folder, case.files)
    run = run_limited(command, folder, _QUICK)
    return judge(case, folder, run, before), run


def _say(text: str, code: int) -> Callable[[], int]:
    def command() -> int:
        sys.stderr.write(text)
        return code

    return command


# ---- planted faults ----------------------------------------------------------------------------------------


def _raise() -> int:
    raise ValueError("planted")


def _hog() -> int:
    blocks = [np.ones(1 << 24) for _ in range(100)]
    return len(blocks)


def _hog_that_is_caught() -> int:
    try:
        return _hog()
    except MemoryError:
        sys.stderr.write("hemivar: error: not enough memory for this problem; take fewer cells\n")
        return 2


def _spin() -> int:
    while True:
        pass


def _sleep() -> int:
    time.sleep(60)
    return 0


def _touch() -> int:
    Path(CANARY).touch()
    return 0


def _overwrite() -> int:
    Path("problem.toml").write_text("gone")
    return 0


def _litter() -> int:
    Path(".tmp-1234").write_text("left")
    return 0


def _kill() -> int:
    import os
    import signal

    os.kill(os.getpid(), signal.SIGSEGV)
    return 0


@pytest.mark.parametrize(
    ("command", "column"),
    [
        (_raise, "traceback"),
        (_say("Traceback (most recent call last):\n  x\nValueError: y\n", 2), "traceback"),
        (_hog, "memory"),
        (_hog_that_is_caught, "memory"),
        slow(_spin, "hang"),
        (_sleep, "hang"),
        (_say("/a/b.py:7: RuntimeWarning: overflow encountered in dot\n  x = y\n", 0), "warnings"),
        (_touch, "code run"),
        (_overwrite, "input destroyed"),
        (_litter, "untidy"),
        (_kill, "crash"),
        (_say("hemivar: error: problem.toml: '\x1b[31m' is no name; mend it\n", 2), "terminal escapes"),
        (_say("hemivar: error: one thing is wrong here\nand another\n", 2), "untidy"),
        (_say("something is wrong here and there\n", 2), "untidy"),
        (_say("hemivar: error: \n", 2), "untidy"),
        (_say("left over\n", 0), "untidy"),
        (_say("", 3), "untidy"),
        (_say("hemivar: error: problem.toml: [mesh] is missing; add it\n", 2), "clean error"),
        (_say("hemivar: not converged: stalled\n", 1), "not converged"),
        (_say("", 0), "accepted, not examined"),
    ],
)  # fmt: skip
def test_what_is_planted_is_counted(tmp_path: Path, command: Callable[[], int], column: str) -> None:
    outcome, run = _outcome(tmp_path, command)
    assert outcome.verdict == column, (outcome, run)
    assert column in table([outcome])


@pytest.mark.slow
def test_limits_hold(tmp_path: Path) -> None:
    begun = time.monotonic()
    _, spun = _outcome(tmp_path / "a", _spin)
    _, slept = _outcome(tmp_path / "b", _sleep)
    assert spun.hung
    assert slept.hung
    assert 0.5 < spun.seconds < 3.0
    assert slept.seconds < 0.5
    assert "_spin" in spun.stack
    assert "_sleep" in slept.stack
    assert time.monotonic() - begun < 30.0

    def write() -> int:
        Path("large").write_bytes(bytes(2 << 20))
        return 0

    outcome, _ = _outcome(tmp_path / "c", write)
    assert outcome.verdict == "traceback"  # OSError: file too large


def test_grandchildren_end_with_their_parent(tmp_path: Path) -> None:
    import os

    def command() -> int:
        child = os.fork()
        if child == 0:
            time.sleep(60)
        Path("child").write_text(str(child))
        return 0

    folder = tmp_path / "case"
    folder.mkdir()
    run_limited(command, folder, _QUICK)
    child = int((folder / "child").read_text())
    for _ in range(100):
        state = Path(f"/proc/{child}/stat")
        if not state.exists() or state.read_text().rpartition(")")[2].split()[0] == "Z":
            return
        time.sleep(0.02)
    raise AssertionError("a process was left behind")


def test_a_failing_case_can_be_kept(tmp_path: Path) -> None:
    case = Case("3:14", "mesh", "odd", ["solve", "problem.toml"], {"problem.toml": b"x"}, {"a.msh": "fifo"})
    lay_out(case, tmp_path)
    leave_command(case, tmp_path)
    text = (tmp_path / "repeat.sh").read_text()
    assert "-m hemivar solve problem.toml" in text
    assert "--case 3:14" in text
    assert (tmp_path / "a.msh").is_fifo()


# ---- a wrong answer is found -------------------------------------------------------------------------------


def _solved(name: str, folder: Path, capsys: pytest.CaptureFixture[str]) -> dict:
    from hemivar.cli import main

    folder.mkdir(exist_ok=True)
    data = known(name)
    text = dump(data)
    (folder / "problem.toml").write_text(text)
    for file, content in FILES.items():
        if file in text:
            (folder / file).write_bytes(content)
    words = [
        "solve",
        str(folder / "problem.toml"),
        "--json",
        str(folder / "a.json"),
        "--vtu",
        str(folder / "a.vtu"),
        "--quiet",
    ]
    assert main(words) == 0, capsys.readouterr()
    capsys.readouterr()
    return json.loads((folder / "a.json").read_text())


def _verdict(folder: Path, record: dict | None = None) -> Verdict:
    if record is not None:
        (folder / "a.json").write_text(json.dumps(record))
    return examine(folder, "problem.toml", "a.json", "a.vtu", 1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("name", list(SEEDS))
def test_answers_of_the_seeds_pass(name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    _solved(name, tmp_path, capsys)
    verdict = _verdict(tmp_path)
    sampled = [w for w in verdict.wrong if "sampled" in w]
    assert verdict.wrong == sampled
    assert {"balance", "supports", "laws"} <= set(verdict.examined), verdict


def _contact(key: str, change: Callable[[np.ndarray], np.ndarray]) -> Callable[[dict], None]:
    def spoil(record: dict) -> None:
        record["contact"][key] = change(np.array(record["contact"][key], dtype=float)).tolist()

    return spoil


def _top(key: str, value: object) -> Callable[[dict], None]:
    return lambda record: record.update({key: value})


def _one_more(values: np.ndarray) -> np.ndarray:
    values = values.copy()
    values[len(values) // 2] *= 1.0 + 1e-4
    return values


def _move(record: dict) -> None:
    u = np.array(record["displacement"])
    record["displacement"] = (u * (1.0 + 1e-5)).tolist()


def _swap(record: dict) -> None:
    # pressures exchanged so that their resultant is the same
    p = record["contact"]["pressure"]
    p[1], p[-2] = p[-2], p[1]


@pytest.mark.parametrize(
    ("name", "spoil", "complaint"),
    [
        ("survey", _contact("pressure", _one_more), "out of balance"),
        ("survey", _contact("friction", lambda t: -t), "out of balance"),
        ("survey", _swap, "out of balance"),
        ("survey", _move, "VTU"),
        ("survey", _contact("penetration", lambda r: r + 1e-4), "penetration differs"),
        ("survey", _contact("slip", lambda s: s + 1e-4), "slip differs"),
        ("survey", _contact("weight", lambda w: 2.0 * w), "weight"),
        ("survey", _contact("x", lambda x: x + np.array([0.03, 0.0])), "beside"),
        ("survey", _contact("normal", lambda n: -n), "normal"),
        ("survey", _top("residual", 1e-3), "residual"),
        ("survey", _top("residual", None), "residual"),
        ("survey", _top("energy", None), "finite"),
        ("survey", lambda r: r["residual_parts"].update(scale=math.inf), "residual"),
        ("survey", lambda r: r["resultants"].update(normal_force=0.1), "normal force"),
        ("survey", lambda r: r["resultants"].update(force=[0.0, 0.1]), "force of the foundation"),
        ("survey", lambda r: r["certificate"].update(unique=True, alpha_sampled=True), "sampled"),
        ("cube", _contact("pressure", _one_more), "out of balance"),
        ("sheet", _contact("pressure", _one_more), "out of balance"),
        ("midpoints", _contact("pressure", _one_more), "out of balance"),
    ],
)  # fmt: skip
def test_a_spoilt_answer_is_found(
    name: str, spoil: Callable[[dict], None], complaint: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    record = _solved(name, tmp_path, capsys)
    spoil(record)
    verdict = _verdict(tmp_path, record)
    assert any(complaint in wrong for wrong in verdict.wrong), verdict


@pytest.mark.parametrize(
    ("name", "change"),
    [
        ("survey", lambda d: d["loads"].update(body=[-0.8, -0.79])),
        ("survey", lambda d: d["material"].update(lame=[4.0, 4.001])),
        ("survey", lambda d: d["contact"]["bottom"]["normal"].update(p_const=2.01)),
        ("survey", lambda d: d["contact"]["bottom"]["friction"].update(bound=0.01)),
        ("survey", lambda d: d["contact"]["bottom"].update(gap=1e-3)),
        ("survey", lambda d: d["mesh"].update(cells=[6, 5])),
        ("survey", lambda d: d["mesh"].update(rectangle=[1.0, 1.1])),
        ("survey", lambda d: d.update(supports={"right": "clamped"})),
        ("rigid", lambda d: d["contact"]["bottom"]["friction"].update(coefficient=0.29)),
        ("layers", lambda d: d["contact"]["bottom"]["normal"].update(stiffnesses=[3.1, 10.0])),
        ("sheet", lambda d: d["material"].update(plane="strain")),
        ("formulas", lambda d: d["contact"]["bottom"]["friction"].update(potential="log(1 + 1.1*r)")),
        ("formulas", lambda d: d["loads"].update(pressure={"top": "0.1*x^2"})),
        ("punch", lambda d: d["supports"].update(top={"displacement": [0.0, -0.021]})),
        ("glued", lambda d: d["material"].update(poisson=0.31)),
        ("cylinder", lambda d: d["contact"]["bottom"]["obstacle"]["sphere"].update(radius=199.0)),
        ("breaks", lambda d: d["contact"]["bottom"]["normal"].update(limit=0.001)),
        ("survey", lambda d: d["contact"]["bottom"]["friction"].update(bound=-0.5)),
    ],
)  # fmt: skip
def test_the_answer_of_another_problem_is_found(
    name: str, change: Callable[[dict], None], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    _solved(name, tmp_path, capsys)
    data = known(name)
    change(data)
    (tmp_path / "problem.toml").write_text(dump(data))
    assert _verdict(tmp_path).wrong


def test_a_mesh_that_lost_a_group_is_found(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    record = _solved("old mesh", tmp_path, capsys)
    assert not _verdict(tmp_path).wrong
    # in truth the side at the bottom had a second part, on the top
    mesh = grid_mesh(4, 3)
    mesh.names = {k: "bottom" if v == "top" else v for k, v in mesh.names.items()}
    (tmp_path / "old.msh").write_bytes(write_msh(mesh, "2.2"))
    assert any("no contact point" in wrong for wrong in _verdict(tmp_path, record).wrong)
    (tmp_path / "old.msh").write_bytes(write_msh(grid_mesh(4, 3), "2.2").replace(b"1.0", b"1e", 1))
    assert any("malformed" in wrong for wrong in _verdict(tmp_path, record).wrong)


# ---- the tools of the oracle, against closed forms ------------------------------------------------------------


def _unit(dim: int, order: int) -> Body:
    mesh = grid_mesh(2, 2, 2 if dim == 3 else 0)
    nodes = np.array(list(mesh.nodes.values()))[:, :dim]
    cells = np.array([[n - 1 for n in e[3]] for e in mesh.elements if e[0] == dim])
    if order == 1:
        return Body(nodes, cells)
    pairs = {2: [(0, 1), (1, 2), (0, 2)], 3: [(0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3)]}[dim]
    known_edges: dict[tuple[int, int], int] = {}
    places = list(nodes)
    rows = []
    for cell in cells:
        row = list(cell)
        for a, b in pairs:
            key = tuple(sorted((int(cell[a]), int(cell[b]))))
            if key not in known_edges:
                known_edges[key] = len(places)
                places.append(0.5 * (nodes[key[0]] + nodes[key[1]]))
            row.append(known_edges[key])
        rows.append(row)
    return Body(np.array(places), np.array(rows))


@pytest.mark.parametrize(("dim", "order"), [(2, 1), (2, 2), (3, 1), (3, 2)])
def test_stiffness_has_rigid_motions_and_the_energy_of_linear_fields(dim: int, order: int) -> None:
    body = _unit(dim, order)
    lam, mu = 3.0, 2.0
    K = stiffness(body, lambda x: np.repeat(isotropic(lam, mu, dim, "strain")[None], len(x), axis=0), 0)
    rng = np.random.default_rng(1)
    skew = rng.standard_normal((dim, dim))
    rigid = body.nodes @ (skew - skew.T).T + rng.standard_normal(dim)
    assert np.abs(K @ rigid.ravel()).max() < 1e-12
    G = rng.standard_normal((dim, dim))
    u = (body.nodes @ G.T).ravel()
    eps = 0.5 * (G + G.T)
    energy = 0.5 * lam * np.trace(eps) ** 2 + mu * np.sum(eps**2)
    assert 0.5 * u @ (K @ u) == pytest.approx(energy, rel=1e-12)
    assert np.abs(body.volumes.sum() - 1.0) < 1e-12


@pytest.mark.parametrize(("dim", "order"), [(2, 1), (2, 2), (3, 1), (3, 2)])
def test_loads_have_the_work_of_their_force(dim: int, order: int) -> None:
    body = _unit(dim, order)
    F = load_of_body(body, lambda x: np.full(dim, x[0] ** 2)).reshape(-1, dim)
    assert F.sum(axis=0) == pytest.approx(np.full(dim, 1.0 / 3.0), rel=1e-12)
    assert F[:, 0] @ body.nodes[:, 0] == pytest.approx(0.25, rel=1e-12)  # x is a linear field


def test_a_bar_under_its_weight() -> None:
    # clamped at x = 0 with nu = 0: the middle of the free end moves by rho/(2 E) for linear elements, too
    body = _unit(2, 2)
    K = stiffness(body, lambda x: np.repeat(isotropic(0.0, 0.5, 2, "strain")[None], len(x), axis=0), 0)
    F = load_of_body(body, lambda x: np.array([1.0, 0.0]))
    held = np.repeat(body.nodes[:, 0] == 0.0, 2)
    u = np.zeros(len(F))
    free = np.flatnonzero(~held)
    u[free] = scipy.sparse.linalg.spsolve(K[free][:, free].tocsc(), F[free])
    assert u.reshape(-1, 2)[body.nodes[:, 0] == 1.0][:, 0] == pytest.approx(0.5, rel=1e-12)


def test_loads_of_facets() -> None:
    body = _unit(2, 1)
    facets = np.array([[i, j] for i in range(len(body.nodes)) for j in range(i) if body.nodes[i, 1] == body.nodes[j,
    1] == 1.0
                       and abs(body.nodes[i, 0] - body.nodes[j, 0]) == 0.5])  # fmt: skip
    F = load_of_facets(body, facets, np.full(2, 0.5), lambda x, _: np.array([0.0, x[0]])).reshape(-1, 2)
    assert F.sum(axis=0) == pytest.approx([0.0, 0.5])


def test_plane_stress_of_a_stretched_square() -> None:
    C = isotropic(1.0, 1.0, 2, "stress")  # E = 2.5, nu = 0.25
    assert np.linalg.inv(C)[0, 0] == pytest.approx(1.0 / 2.5)
    assert -np.linalg.inv(C)[0, 1] * 2.5 == pytest.approx(0.25)


_GRAPHS = [
    ({"law": "survey", "q_max": 0.3, "p_const": 2.0}, -0.1, (0.0, 0.0)),
    ({"law": "survey", "q_max": 0.3, "p_const": 2.0}, 0.0, (0.0, 0.3)),
    ({"law": "survey", "q_max": 0.3, "p_const": 2.0}, 0.1, (0.5, 0.5)),
    ("signorini", -1.0, (0.0, 0.0)),
    ("signorini", 0.0, (0.0, math.inf)),
    ("bilateral", 0.0, (-math.inf, math.inf)),
    ({"law": "bolt", "tension": 2.0}, 0.1, (-2.0, -2.0)),
    ({"law": "bolt", "tension": 2.0, "held": 1.0}, 0.0, (-math.inf, math.inf)),
    ({"law": "compliance", "stiffness": 2.0, "exponent": 3.0}, 0.5, (0.25, 0.25)),
    ({"law": "softening", "stiffness": 10.0, "limit": 0.1, "softening": 5.0}, 0.2, (0.5, 0.5)),
    ({"law": "softening", "stiffness": 10.0, "limit": 0.1, "softening": 5.0}, 0.4, (0.0, 0.0)),
    ({"law": "capped", "stiffness": 20.0, "limit": 0.1}, 0.1, (0.0, 2.0)),
    ({"law": "finite-penetration", "stiffness": 4.0, "limit": 0.5}, 0.5, (2.0, math.inf)),
    ({"law": "barton-bandis", "stiffness": 10.0, "closure": 0.2}, 0.1, (2.0, 2.0)),
    ({"law": "adhesive", "stiffness": 4.0, "strength": 2.0}, -0.5, (-2.0, 0.0)),
    ({"law": "adhesive", "stiffness": 4.0, "strength": 2.0}, -0.25, (-1.0, -1.0)),
    ({"law": "adhesive", "stiffness": 4.0, "strength": 2.0, "softening": 1.0}, -1.5, (-1.0, -1.0)),
    ({"law": "layered", "thicknesses": [0.1, 0.2], "stiffnesses": [3.0, 10.0], "drops": [0.1, 0.5], "base": 2.0},
    0.1, (0.2, 0.3)),
    ({"law": "layered", "thicknesses": [0.1, 0.2], "stiffnesses": [3.0, 10.0], "drops": [0.1, 0.5], "base": 2.0},
    0.4, (1.9, 1.9)),
    ({"law": "saw-tooth", "openings": [1.0, 2.0], "slopes": [3.0, 1.0]}, -1.0, (-3.0, -1.0)),
    ({"law": "saw-tooth", "openings": [1.0, 2.0], "slopes": [3.0, 1.0]}, -3.0, (0.0, 0.0)),
    ({"law": "formula", "potential": "3*abs(r)"}, 0.0, (-3.0, 3.0)),
    ({"law": "formula", "potential": "r^2"}, 1.0, (2.0, 2.0)),
]  # fmt: skip


@pytest.mark.parametrize(("law", "r", "forces"), _GRAPHS)
def test_graphs_of_laws_by_hand(law: object, r: float, forces: tuple[float, float], tmp_path: Path) -> None:
    graph = normal_graph(law, float, tmp_path)
    assert graph.forces(r, r) == pytest.approx(forces, abs=1e-5)


def test_slip_graphs_by_hand(tmp_path: Path) -> None:
    def at(law: dict, s: float) -> tuple[float, float]:
        return slip_graph(law, float, tmp_path).forces(s, s)

    assert at({"law": "logarithmic", "scale": 2.0}, 3.0) == pytest.approx((0.2, 0.2))
    assert at({"law": "slip-weakening"}, 0.0) == pytest.approx((1.0, 1.0))
    fast = at({"law": "exponential-decay", "static": 0.5, "kinetic": 0.25, "decay": 1.0}, math.log(4.0))
    assert fast == pytest.approx((0.3125, 0.3125))
    assert at({"law": "static-kinetic", "slip": 0.1}, 0.1) == pytest.approx((0.7, 1.0))
    assert at({"law": "slip-table", "slips": [0.0, 1.0], "values": [1.0, 0.5]}, 0.5) == pytest.approx((0.75, 0.75))
    with pytest.raises(SenselessError):
        at({"law": "slip-table", "slips": [0.0, 1.0], "values": [1.0, -0.5]}, 0.5)


def test_tables_are_read_by_their_names(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    for text in (
        "0,1\n2,3\n",
        "r,derivative\n0,1\n2,3\n",
        "derivative,r\n1,0\n3,2\n",
        "0;1\n2;3\n",
        "note,r,derivative\nx,0,1\ny,2,3\n",
    ):
        path.write_text(text)
        assert read_table(path, ("r", "derivative")) == ([0.0, 2.0], [1.0, 3.0]), text
    for text in ("0,1,2,5\n1,0,3,5\n", "0,x\n", "0,nan\n", ""):
        path.write_text(text)
        with pytest.raises(SenselessError):
            read_table(path, ("r", "derivative"))


def test_formulas() -> None:
    assert value(parse("2*x^2 - min(y, 1)"), {"x": 3.0, "y": 2.0}) == 17.0
    assert value(parse("piecewise((0, r < 0), (r, 0 <= r < 1), 5)"), {"r": 0.5}) == 0.5
    assert value(parse("piecewise((0, r < 0), (r, 0 <= r < 1), (5, True))"), {"r": 1.0}) == 5.0
    assert math.isnan(value(parse("1/x"), {"x": 0.0}))
    for attack in ("__import__('os')", "x.real", "(lambda: 1)()", "[1 for _ in x]"):
        with pytest.raises(UnknownError):
            value(parse(attack), {"x": 1.0})


@pytest.mark.parametrize("version", ["2.2", "4.0", "4.1"])
def test_meshes_are_read_as_they_are_written(version: str) -> None:
    for mesh in (grid_mesh(3, 2, regions=2), grid_mesh(2, 1, 1)):
        read = read_msh(write_msh(mesh, version))
        assert read.nodes == mesh.nodes
        assert read.names == mesh.names
        assert sorted(read.elements) == sorted(mesh.elements)
        assert len(read.group(mesh.dim - 1, "bottom")) == (3 if mesh.dim == 2 else 4)


def test_meshes_are_those_of_gmsh(tmp_path: Path) -> None:
    gmsh = pytest.importorskip("gmsh")
    for version, binary in (("2.2", False), ("2.2", True), ("4.0", False), ("4.1", False), ("4.1", True)):
        mesh = grid_mesh(3, 2, regions=2)
        path = tmp_path / "a.msh"
        path.write_bytes(write_msh(mesh, version, binary))
        gmsh.initialize()
        try:
            gmsh.option.setNumber("General.Verbosity", 1)
            gmsh.open(str(path))
            assert len(gmsh.model.mesh.getNodes()[0]) == len(mesh.nodes)
            assert sum(map(len, gmsh.model.mesh.getElements()[1])) == len(mesh.elements)
            names = {gmsh.model.getPhysicalName(*group) for group in gmsh.model.getPhysicalGroups()}
            assert names == set(mesh.names.values())
            gmsh.option.setNumber("Mesh.MshFileVersion", 4.1)
            gmsh.write(str(tmp_path / "b.msh"))
        finally:
            gmsh.finalize()
        again = read_msh((tmp_path / "b.msh").read_bytes())
        assert {tuple(np.round(p, 9)) for p in again.nodes.values()} == {
            tuple(np.round(p, 9)) for p in mesh.nodes.values()
        }


def test_malformed_meshes_are_refused() -> None:
    good = write_msh(grid_mesh(2, 2), "4.1").decode()
    for old, new in (
        ("$EndNodes", ""),
        ("0.5", "0.5e"),
        ("0.5", "nan"),
        ("$Elements", "$Elephants"),
        ("4.1 0 8", "4.7 0 8"),
        ("\n1\n", "\n0\n"),
    ):
        assert old in good
        with pytest.raises(MalformedError):
            read_msh(good.replace(old, new, 1).encode())


def test_toml_is_written_as_it_is_read() -> None:
    import tomllib

    for data in SEEDS.values():
        assert tomllib.loads(dump(data)) == data
    odd = {"a b": {"\x1b[": 'x"\\\n', "n": math.inf, "l": [1, [2.5, "y"]]}, "": 1}
    assert tomllib.loads(dump(odd)) == odd


def test_text_is_spoilt_in_every_way() -> None:
    rng = random.Random(1)
    notes = {spoilt(b"one = 1\ntwo = 2\n", rng)[1].split()[0] for _ in range(300)}
    assert len(notes) >= 10


def test_a_graph_without_a_way_out() -> None:
    assert Graph([], [lambda r: 0.0], upper=0.0).forces(0.1, 0.2) == (math.inf, -math.inf)
