"""Result files that are broken or forged: VTU as meshes and solutions, films (PVD, PVTU), tables of marches."""

from __future__ import annotations

import random
from collections.abc import Callable

import numpy as np

from tests.robustness.case import Case
from tests.robustness.msh import grid_mesh, write_msh
from tests.robustness.toml import dump, spoilt
from tests.robustness.vtu import MODES, Grid, bomb, forged, plate, write_vtu

__all__ = ["result_case"]

_LIST = '<?xml version="1.0"?>\n<VTKFile type="Collection" version="0.1">\n<Collection>\n{}</Collection>\n</VTKFile>\n'
_PARALLEL = (
    '<VTKFile type="PUnstructuredGrid" version="0.1">\n<PUnstructuredGrid>\n{}</PUnstructuredGrid>\n</VTKFile>\n'
)


def result_case(name: str, rng: random.Random) -> Case:
    """A case that reads a result file."""
    make = rng.choices([_mesh_case, _solution, _film, _table], [25, 25, 40, 10])[0]
    return make(name, rng)


def _hostile(grid: Callable[[], Grid], rng: random.Random) -> tuple[bytes, str]:
    """A VTU file that is as it should be, forged, spoilt, or a bomb."""
    mode = rng.choice(MODES)
    match rng.choices(["true", "forged", "spoilt", "bomb"], [10, 50, 30, 10])[0]:
        case "true":
            return write_vtu(grid(), mode), "as it is"
        case "forged":
            made, note = forged(grid(), rng)
            return write_vtu(made, mode), note
        case "spoilt":
            return spoilt(write_vtu(grid(), mode), rng)
        case _:
            return bomb(rng)


def _statement(file: str, names: tuple[str, str]) -> bytes:
    held, pressed = names
    contact = {"normal": {"law": "survey", "q_max": 0.3, "p_const": 2.0}}
    return dump(
        {
            "mesh": {"file": file}, "material": {"lame": [4.0, 4.0]}, "loads": {"body": [-0.2, -0.8]},
            "supports": {held: "clamped"}, "contact": {pressed: contact},
        }
    ).encode()  # fmt: skip


def _mesh_case(name: str, rng: random.Random) -> Case:
    mesh = grid_mesh(rng.randint(1, 3), rng.randint(1, 3))
    number = {n: k for k, n in enumerate(mesh.nodes)}
    group = {text: key[1] for key, text in mesh.names.items()}

    def grid() -> Grid:
        made = plate(np.array(list(mesh.nodes.values())), np.zeros((1, 3), dtype=int))
        cells = [[number[n] for n in nodes] for *_, nodes in mesh.elements]
        made.arrays["Cells", "connectivity"] = np.concatenate([np.array(cell) for cell in cells])
        made.arrays["Cells", "offsets"] = np.cumsum([len(cell) for cell in cells])
        made.arrays["Cells", "types"] = np.array([{2: 3, 3: 5}[len(cell)] for cell in cells])
        made.arrays["CellData", "gmsh:physical"] = np.array([element[1] for element in mesh.elements])
        made.counts["NumberOfCells"] = len(cells)
        return made

    data, note = _hostile(grid, rng)
    files = {"m.vtu": data, "problem.toml": _statement("m.vtu", (str(group["left"]), str(group["bottom"])))}
    words = ["solve", "problem.toml", "--json", "a.json", "--max-time", "5"]
    return Case(name, "results", f"mesh: {note}"[:200], words, files)


def _solution(name: str, rng: random.Random) -> Case:
    mesh = grid_mesh(2, 2)
    places = np.array(list(mesh.nodes.values()))

    def grid() -> Grid:
        return plate(places, np.zeros((1, 3), dtype=int), displacement=np.zeros((len(places), 3)))

    data, note = _hostile(grid, rng)
    files = {"m.msh": write_msh(mesh), "given.vtu": data, "problem.toml": _statement("m.msh", ("left", "bottom"))}
    words = ["certify", "problem.toml", "--solution", "given.vtu", "--json", "a.json"]
    return Case(name, "results", f"solution: {note}"[:200], words, files)


def _frame(time: float, solid: bool) -> Grid:
    """A body of a few cells that sinks, two or more of its nodes touching."""
    mesh = grid_mesh(1, 1, 1) if solid else grid_mesh(2, 1)
    number = {n: k for k, n in enumerate(mesh.nodes)}
    places = np.array(list(mesh.nodes.values()))
    cells = np.array([[number[n] for n in nodes] for d, *_, nodes in mesh.elements if d == mesh.dim])
    if solid:  # those that are turned over
        edges = places[cells[:, 1:]] - places[cells[:, :1]]
        over = np.linalg.det(edges) < 0.0
        cells[over] = cells[over][:, [1, 0, 2, 3]]
    below = places[:, mesh.dim - 1] == 0.0
    down = np.zeros((len(places), 3))
    down[:, mesh.dim - 1] = -0.01 * time * (1.0 + places[:, 0])
    state, force = np.where(below, 1, -1).astype(np.int32), np.where(below[:, None], -20.0 * down, 0.0)
    gap, stress = np.zeros(len(places)), np.zeros((len(places), 6))
    states = {"state": state, "tangential_state": state}
    return plate(places, cells, displacement=down, velocity=down, contact_force=force, gap=gap, stress=stress, **states)


def _film(name: str, rng: random.Random) -> Case:
    solid, count = rng.random() < 0.2, 3
    parallel = rng.random() < 0.3
    files: dict[str, bytes] = {}
    special: dict[str, str] = {}
    entries = []
    for k in range(count):
        files[f"run/f{k}.vtu"] = write_vtu(_frame(float(k), solid), rng.choice(MODES))
        entries.append((repr(float(k)), f"run/f{k}.{'pvtu' if parallel else 'vtu'}"))
        if parallel:
            files[f"run/f{k}.pvtu"] = _PARALLEL.format(f'<Piece Source="f{k}.vtu"/>\n').encode()
    spot = rng.randrange(count)
    note = "as it is"
    odd = ["run/f0.vtu", "run.pvd", "../run.pvd", "/dev/zero", "run/nothing.vtu", "run", "", "run/\x01", "a" * 300]
    match rng.choices(["vtu", "list", "names", "pieces"], [45, 20, 15, 20])[0]:
        case "vtu":
            files[f"run/f{spot}.vtu"], note = _hostile(lambda: _frame(float(spot), solid), rng)
        case "names":
            new = rng.choice(["time", "file", "twice", "fifo", "many"])
            time, file = entries[spot]
            if new == "time":
                time = rng.choice(["nan", "inf", "-1", "x", "1e308", "", "-1e308", "5"])
            elif new == "file":
                file = rng.choice(odd)
            elif new == "fifo":
                del files[file]
                special[file] = rng.choice(["fifo", "folder", "sparse 17179869184", "link nowhere", "link /dev/zero"])
            entries[spot] = time, file
            note = f"list: frame {spot} at {time} is {file} ({new})"[:120]
            entries *= {"twice": 2, "many": rng.choice([300, 30000])}.get(new, 1)
        case "pieces" if parallel:
            piece = f'<Piece Source="f{spot}.vtu"/>\n'
            inside = rng.choice(
                ["", piece * 2, piece * 10**4, f'<Piece Source="f{spot}.pvtu"/>', '<Piece Source="../run.pvd"/>',
                 '<Piece Source="/dev/zero"/>', "<Piece/>", piece + '<Piece Source="other.vtu"/>',
                 piece + '<Piece Source="solid.vtu"/>', piece + '<Piece Source="bomb.vtu"/>']
            )  # fmt: skip
            other, note = forged(_frame(float(spot), solid), rng)
            files["run/other.vtu"] = write_vtu(other, rng.choice(MODES))
            files["run/solid.vtu"] = write_vtu(_frame(0.0, not solid))
            files["run/bomb.vtu"] = bomb(rng)[0] if "bomb" in inside else b""
            files[f"run/f{spot}.pvtu"] = _PARALLEL.format(inside).encode()
            note = f"pieces {inside[:60]!r}, other {note}"
        case _:
            note = "list"
    lines = "".join(f'<DataSet timestep="{time}" group="" part="0" file="{file}"/>\n' for time, file in entries)
    files["run.pvd"] = _LIST.format(lines).encode("utf-8", "replace")
    if note == "list":
        files["run.pvd"], note = spoilt(files["run.pvd"], rng)
        note = f"list: {note}"
    words = ["animate", "run.pvd", "--output", "film.gif", "--frames", "3", "--dpi", "20"]
    words += rng.choice([[], [], ["--colour", "speed"], ["--colour", "displacement"]])
    return Case(name, "results", f"frames: {note}"[:200], words, files, special)


def _table(name: str, rng: random.Random) -> Case:
    rows = ["time,step,work,residual", *(f"{0.1 * k!r},{k},{k * k}.5,1e-12" for k in range(6))]
    content, note = "\r\n".join([*rows, ""]).encode(), "as it is"
    if rng.random() < 0.8:
        content, note = spoilt(content, rng)
    if rng.random() < 0.5:
        row, column = rng.randrange(1, 7), rng.randrange(4)
        cells = rows[row].split(",")
        cells[column] = rng.choice(["nan", "inf", "-1e308", "", "x", "1_0", "1e400", '"', "\x1b[31m", "0x10"])
        content, note = "\r\n".join([*rows[:row], ",".join(cells), *rows[row + 1 :]]).encode(), f"{cells}"
    file = rng.choice(["t.csv", "t.csv", "t.csv", "t.parquet"])
    more = rng.choice([[], [], ["--plot", "h.png"], ["--plot", "h.png", "--kind", "columns", "--columns", "work"]])
    return Case(name, "results", f"table {file}: {note}"[:200], ["history", file, *more], {file: content})
