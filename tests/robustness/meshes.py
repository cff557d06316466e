"""Hostile mesh files."""

from __future__ import annotations

import math
import random
from typing import Any

from tests.robustness.toml import spoilt, strange_name

__all__ = ["foreign", "other_model", "renumbered", "tokens"]


def renumbered(mesh: Any, rng: random.Random) -> tuple[Any, str]:
    """The same mesh with other numbers, orders, orientations and places."""
    note = "as it is"
    kind = rng.choice(["as it is", "gaps", "shuffled", "turned over", "shifted", "unused node", "spaces"])
    if kind == "gaps":
        step = rng.choice([2, 1000, 10**6])
        other = {n: step * n + 7 for n in mesh.nodes}
        mesh.nodes = {other[n]: x for n, x in mesh.nodes.items()}
        mesh.elements = [(d, g, e, tuple(other[n] for n in v)) for d, g, e, v in mesh.elements]
        note = f"numbers {step} apart"
    elif kind == "shuffled":
        items = list(mesh.nodes.items())
        rng.shuffle(items)
        mesh.nodes = dict(items)
        rng.shuffle(mesh.elements)
        note = "shuffled"
    elif kind == "turned over":
        mesh.elements = [(d, g, e, v[::-1] if rng.random() < 0.5 else v) for d, g, e, v in mesh.elements]
        note = "some elements turned over"
    elif kind == "shifted":
        mesh.nodes = {n: (x + 100.0, y - 7.0, z + 0.25) for n, (x, y, z) in mesh.nodes.items()}
        note = "shifted"
    elif kind == "unused node":
        mesh.nodes[max(mesh.nodes) + 5] = (50.0, 50.0, 0.0)
        note = "a node that no cell uses"
    elif kind == "spaces":
        mesh.names = {k: v + " of the part" if v == "right" else v for k, v in mesh.names.items()}
        note = "a name with spaces"
    return mesh, note


def other_model(mesh: Any, rng: random.Random) -> tuple[Any, str]:
    """A mesh that states something odd."""
    d = mesh.dim
    cells = [i for i, e in enumerate(mesh.elements) if e[0] == d]
    facets = [i for i, e in enumerate(mesh.elements) if e[0] == d - 1]
    i = rng.choice(cells)
    dim, group, entity, nodes = mesh.elements[i]
    match rng.randrange(18):
        case 0:
            mesh.names = {k: "bottom" if v == "top" else v for k, v in mesh.names.items()}
            note = "two groups of one name"
        case 1:
            mesh.names = {k: "bottom" if k[0] == d else v for k, v in mesh.names.items()}
            note = "region and boundary of one name"
        case 2:
            shift = {n: n - 1 for n in mesh.nodes}
            mesh.nodes = {shift[n]: x for n, x in mesh.nodes.items()}
            mesh.elements = [(a, b, c, tuple(shift[n] for n in v)) for a, b, c, v in mesh.elements]
            note = "numbers of nodes from 0"
        case 3:
            big = rng.choice([10**9, 2**31, 2**62])
            last = max(mesh.nodes)
            mesh.nodes[big] = mesh.nodes.pop(last)
            mesh.elements = [(a, b, c, tuple(big if n == last else n for n in v)) for a, b, c, v in mesh.elements]
            note = f"a node numbered {big}"
        case 4:
            mesh.elements.append(mesh.elements[i])
            note = "a cell twice"
        case 5:
            mesh.elements.append(mesh.elements[rng.choice(facets)])
            note = "a facet twice"
        case 6:
            mesh.elements[i] = (dim, group, entity, (nodes[0],) * len(nodes))
            note = "a cell of one node"
        case 7:
            mesh.elements[i] = (dim, group, entity, (*nodes[:-1], max(mesh.nodes) + 1))
            note = "a node that is not there"
        case 8:
            n = rng.choice(list(mesh.nodes))
            x = list(mesh.nodes[n])
            x[rng.randrange(3)] = rng.choice([math.nan, math.inf, 1e308, 1e160, 1e17, 0.5, -3.0])
            mesh.nodes[n] = tuple(x)
            note = f"node {n} at {x}"
        case 9:
            factor = 10.0 ** rng.choice([-300, -160, -20, 20, 160, 300])
            mesh.nodes = {n: (factor * x, factor * y, factor * z) for n, (x, y, z) in mesh.nodes.items()}
            note = f"coordinates times {factor:g}"
        case 10:
            mesh.names = {}
            note = "no names"
        case 11:
            name = strange_name(rng).replace('"', "").replace("\n", " ").replace("\r", " ")
            mesh.names = {k: name if v == "right" else v for k, v in mesh.names.items()}
            note = f"name {name[:30]!r}"
        case 12:
            mesh.elements = [e for j, e in enumerate(mesh.elements) if j not in cells]
            note = "no cells"
        case 13:
            extra = max(mesh.nodes)
            places = [(5.0, 5.0, 0.0), (6.0, 5.0, 0.0), (5.0, 6.0, 0.0), (5.0, 5.0, 1.0)][: d + 1]
            mesh.nodes |= {extra + 1 + j: p for j, p in enumerate(places)}
            mesh.elements.append((d, group, entity, tuple(range(extra + 1, extra + 2 + d))))
            note = "a second body"
        case 14:
            mesh.elements = [(a, 0 if a == d else b, c, v) for a, b, c, v in mesh.elements]
            note = "cells without a group"
        case 15:
            inner = next((v for _, _, _, v in (mesh.elements[j] for j in cells)), nodes)
            bottom = next(k for k, v in mesh.names.items() if v == "bottom")
            mesh.elements.append((d - 1, bottom[1], bottom[1], tuple(inner[1 : d + 1])))
            note = "a facet of the inside in 'bottom'"
        case 16:
            mesh.elements = [(a, -b, c, v) for a, b, c, v in mesh.elements]
            note = "negative groups"
        case _:
            n = max(mesh.nodes)
            mesh.nodes[n + 1] = mesh.nodes[n]
            mesh.elements[i] = (dim, group, entity, tuple(n + 1 if v == n else v for v in nodes))
            note = "a node doubled (a slit)"
    return mesh, note


def tokens(content: bytes, rng: random.Random) -> tuple[bytes, str]:
    """One word of an ASCII mesh file made another one, or lines changed."""
    lines = content.decode().split("\n")
    notes = []
    for _ in range(rng.choice([1, 1, 1, 2])):
        row = rng.randrange(len(lines))
        words = lines[row].split(" ")
        place = rng.randrange(len(words))
        old = words[place]
        new = rng.choice(
            ["0", "1", "2", "-1", "3", "99", "1e", "1e5", "nan", "inf", "-inf", "1e308", "1e400", "x", "", "1.5",
            "10000000000", "1,5", "0x2", "1_0",
             "2147483648", "4294967297", "9223372036854775808", "$",
             '"', "\x1b[31m", "\0", f"{old}e", f"{old}x", f"-{old}", f"{old} {old}", f"{old}.0"]
        )  # fmt: skip
        words[place] = new
        lines[row] = " ".join(words)
        notes.append(f"line {row + 1}: {old[:20]!r} is {new[:20]!r}")
    return "\n".join(lines).encode(), "; ".join(notes)


def foreign(mesh: Any, rng: random.Random) -> tuple[str, bytes, str]:
    """Other formats: written here by hand as far as they are text, spoilt, or under a wrong name."""
    nodes = list(mesh.nodes.values())
    number = {n: i for i, n in enumerate(mesh.nodes)}
    cells = [[number[n] for n in e[3]] for e in mesh.elements if e[0] == mesh.dim]
    vtk = "# vtk DataFile Version 3.0\nx\nASCII\nDATASET UNSTRUCTURED_GRID\n"
    vtk += f"POINTS {len(nodes)} double\n" + "".join(f"{x} {y} {z}\n" for x, y, z in nodes)
    vtk += f"CELLS {len(cells)} {sum(len(c) + 1 for c in cells)}\n" + "".join(
        f"{len(c)} {' '.join(map(str, c))}\n" for c in cells
    )
    vtk += f"CELL_TYPES {len(cells)}\n" + f"{5 if mesh.dim == 2 else 10}\n" * len(cells)
    obj = "".join(f"v {x} {y} {z}\n" for x, y, z in nodes) + "".join(
        f"f {' '.join(str(i + 1) for i in c)}\n" for c in cells
    )
    inp = "*NODE\n" + "".join(f"{i + 1}, {x}, {y}, {z}\n" for i, (x, y, z) in enumerate(nodes))
    inp += f"*ELEMENT, TYPE={'CPS3' if mesh.dim == 2 else 'C3D4'}\n"
    inp += "".join(f"{i + 1}, {', '.join(str(j + 1) for j in c)}\n" for i, c in enumerate(cells))
    off = f"OFF\n{len(nodes)} {len(cells)} 0\n" + "".join(f"{x} {y} {z}\n" for x, y, z in nodes)
    off += "".join(f"{len(c)} {' '.join(map(str, c))}\n" for c in cells)
    tec = 'TITLE = "x"\nVARIABLES = "X", "Y", "Z"\n'
    tec += f"ZONE N={len(nodes)}, E={len(cells)}, F=FEPOINT, ET={'TRIANGLE' if mesh.dim == 2 else 'TETRAHEDRON'}\n"
    tec += "".join(f"{x} {y} {z}\n" for x, y, z in nodes)
    tec += "".join(f"{' '.join(str(i + 1) for i in c)}\n" for c in cells)
    bdf = "BEGIN BULK\n" + "".join(f"GRID,{i + 1},,{x},{y},{z}\n" for i, (x, y, z) in enumerate(nodes))
    bdf += rng.choice(["", "INCLUDE 'nowhere.bdf'\n", "include 'm.bdf'\n", "INCLUDE problem.toml\n"])
    card = "CTRIA3" if mesh.dim == 2 else "CTETRA"
    bdf += "".join(f"{card},{i + 1},7,{','.join(str(j + 1) for j in c)}\n" for i, c in enumerate(cells)) + "ENDDATA\n"
    mdpa = "Begin Nodes\n" + "".join(f"{i + 1} {x} {y} {z}\n" for i, (x, y, z) in enumerate(nodes)) + "End Nodes\n"
    mdpa += f"Begin Elements {'Element2D3N' if mesh.dim == 2 else 'Element3D4N'}\n"
    mdpa += "".join(f"{i + 1} 0 {' '.join(str(j + 1) for j in c)}\n" for i, c in enumerate(cells)) + "End Elements\n"
    corners = [", ".join(" ".join(map(str, nodes[i])) for i in (*c[:3], c[0])) for c in cells]
    wkt = f"TIN ({', '.join(f'(({one}))' for one in corners)})"
    fluent = f'(0 "x")\n(2 {mesh.dim})\n(10 (0 1 {len(nodes):x} 0 3))\n(10 (1 1 {len(nodes):x} 1 3)(\n'
    fluent += "".join(f"{x} {y} {z}\n" for x, y, z in nodes) + "))\n"
    texts = {"vtk": vtk, "obj": obj, "inp": inp, "off": off, "tec": tec, "bdf": bdf, "mdpa": mdpa, "wkt": wkt}
    name, content = rng.choice([(f"m.{suffix}", text) for suffix, text in (*texts.items(), ("msh", fluent))])
    data, note = content.encode(), f"{name} as it is"
    if rng.random() < 0.25:
        data, note = data[: rng.randrange(len(data))], f"{name}, cut off"
    if rng.random() < 0.6:
        data, note = spoilt(data, rng)
        note = f"{name}, {note}"
    if rng.random() < 0.3:
        name = rng.choice(
            [
                "m.msh",
                "m.vtu",
                "m.stl",
                "m.med",
                "m.xdmf",
                "m.h5m",
                "m.e",
                "m.cgns",
                "m.unknown",
                "m",
                "m.su2",
                "m.bdf",
                "m.xml",
                "m.node",
            ]
        )
        note += f" under the name {name}"
    return name, data, note
