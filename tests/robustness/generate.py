"""The hostile cases: ``make_case(seed, number)`` is the same on every machine and in any order."""

from __future__ import annotations

import json
import math
import random
from collections.abc import Callable, Mapping
from typing import Any

from tests.robustness.case import CANARY, Case
from tests.robustness.msh import FORMATS, grid_mesh, write_msh
from tests.robustness.seeds import FILES, METHODS, known, random_law, random_problem, seed
from tests.robustness.toml import dump, leaves, put, spoilt, strange_name, strange_number, strange_value

__all__ = ["FAMILIES", "make_case"]

_ATTACKS = [
    f"__import__('os').system('touch {CANARY}')", f"open('{CANARY}','w')", f"exec('open(\"{CANARY}\",\"w\")')",
    "().__class__.__bases__[0].__subclasses__()", f"(lambda: open('{CANARY}','w'))()", f"[open('{CANARY}','w') for _ in [1]]",
    "r.__class__", "x if x else y", "x and y", "x or 1", "not x", "x < 1", "x @ y", "x // 2", "x % 2", "~x", "x[0]", "'a'*10**9",
    "9**9**9", "9**9**9**9", "2**10**10", "1e308*10", "10**400", "x**x**x", "(-1)**0.5", "1/0", "0/0", "log(0)", "log(-1)",
    "sqrt(-1)", "exp(1e9)", "tan(pi/2)", "0*log(0)", "x=1", "x:=1", "import os", "print(1)", "abs", "sin", "sin()", "sin(1,2)",
    "max()", "max(1)", "min(x=1)", "max(*[1])", "1_000", "0x10", "1j", "1e", "1e+", ".", "1..2", "x x", "xx", "π", "x\u2212y",
    "sin(x", "x)", "((", ",", "\"", "None", "True", "...", "f'{x}'", "lambda x: x", "await x", "x;y", "x\ny", "x#y", "\\", "a" * 2000,
    "1" * 500, "1" * 5000, "e", "inf", "nan", "-", "+x", "--x", "x--1", "1/x", "x/0", "x^0.5", "abs(x)^0.5", "z", "r", "s", "t",
]  # fmt: skip


def _nested(rng: random.Random, variable: str) -> str:
    depth = rng.choice([5, 20, 30, 40, 80, 150, 250, 5000])
    kind = rng.choice(["abs", "sin", "brackets", "minus", "sum", "product", "power", "min", "piecewise", "sqrt"])
    inner = variable
    match kind:
        case "abs" | "sin" | "sqrt":
            for i in range(depth):
                inner = f"{kind}({inner} - 0.{i})" if kind == "abs" else f"{kind}({inner})"
        case "brackets":
            inner = "(" * depth + inner + ")" * depth
        case "minus":
            inner = "-" * depth + inner
        case "sum":
            inner = "+".join([inner] * depth)
        case "product":
            inner = "*".join([inner] * depth)
        case "power":
            inner = "^".join([inner] * min(depth, 80))
        case "min":
            inner = f"min({', '.join(f'{variable}+{i}' for i in range(depth))})"
        case "piecewise":
            inner = "piecewise(" + ", ".join(f"({i}*{variable}, {variable} < {i})" for i in range(depth)) + f", {variable})"
    return inner


_LAWS = [
    "abs(sin(100*r))", "sin(1000*r)", "sqrt(abs(r))", "abs(r)^0.9", "-r^2", "r^3", "-abs(r)", "r^4", "exp(r)", "exp(100*r)",
    "-exp(r)", "log(1 + abs(r))", "1/r", "1/(r - 0.01)", "tan(r)", "tan(100*r)", "sin(1/r)", "r*sin(1/r)", "r^2*sin(1/r)",
    "piecewise((0, r < 0), (1, True))", "piecewise((r, True), (2*r, r < 1))", "piecewise((r, r < 0))", "piecewise()",
    "piecewise((1, 2))", "piecewise((r, r < 0), r)", "piecewise((0, r < 0), (1e6*r, r < 1e-9), (1, True))", "abs(abs(abs(r)))",
    "abs(r - 0.1) + abs(r + 0.1)", "max(r, 0)^1.5", "max(r, 0)^0.5", "max(r,0)^2 - max(r - 0.1,0)^2*2", "tanh(1000*r)",
    "tanh(1e6*r)/1e6", "min(r^2, 0.01)", "min(abs(r), 0.1)", "max(r, r^2, r^3)", "abs(r)*r", "1e300*r^2", "1e-300*r^2", "r^0",
    "0*r", "5", "r", "-r", "cos(r)^2 + sin(r)^2", "7/10*abs(r) - 3/10*exp(-abs(r))", "log(abs(r))", "r*log(abs(r))", "r^r",
    "abs(r)^1.0000001", "sqrt(r^2 + 1e-20)", "sqrt(r^2)", "(r^2)^0.5", "abs(r)^2^0.5", "exp(-1/r^2)", "exp(-r^2)*1e3",
    "6e-4*(1+tanh((r-1)/3e-4))", "max(r,0)*1e308", "abs(sin(abs(sin(abs(10*r)))))", "min(max(r,-1),1)^2",
]  # fmt: skip
_BOUNDS = [
    "8*s", "min(8*s, 0.8)", "-1", "-s", "s", "6e-4*(1+tanh((s-1)/3e-4))", "1/s", "sqrt(s)", "sqrt(abs(s))", "abs(sin(100*s))",
    "piecewise((0, s < 0), (1, True))", "1e300*s", "exp(s)", "exp(1000*s)", "log(s)", "tanh(1e6*s)", "max(s, 0)^0.5", "0", "0.2",
    "0.3 - s", "0.3 + 1000*max(s,0)", "x", "r", "nan", "inf", "s^2", "sin(s)", "abs(s)", "max(s - 1e-6, 0)*1e6",
]  # fmt: skip


class _Maker:
    """Makes the cases of one name."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.rng = random.Random(f"hemivar {name}")

    # -- command lines

    def command(self) -> tuple[list[str], str | None]:
        """A command on problem.toml, and the JSON file it writes."""
        rng = self.rng
        kind = rng.choices(["solve", "solutions", "certify", "path", "compare"], [80, 7, 6, 4, 3])[0]
        json_file = f"{kind}.json"
        words = [kind, "problem.toml", "--json", json_file]
        if kind == "solve":
            words += ["--vtu", "solve.vtu", "--max-time", "5"]
            if rng.random() < 0.4:
                words += ["--method", rng.choice(METHODS)]
            if rng.random() < 0.05:
                words += ["--plot", rng.choice(["a.png", "a.svg", "a.pdf"])]
            if rng.random() < 0.04:
                words += ["--plot-contact", "b.png"]
            if rng.random() < 0.05:
                words += ["--warm-start"]
            if rng.random() < 0.1:
                words += ["--quiet"]
        elif kind == "compare":
            words += ["--max-time", "1", "--csv", "compare.csv"]
        elif kind == "path":
            words += ["--max-points", "60"] + (["--plot", "path.png"] if rng.random() < 0.2 else [])
        elif kind == "solutions":
            words += ["--starts", "5"] if rng.random() < 0.5 else []
        return words, json_file

    def problem(
        self, family: str, note: str, text: bytes | str, files: Mapping[str, bytes] | None = None, **others: Any
    ) -> Case:
        """A case about a problem file."""
        text = text.encode("utf-8", "surrogatepass") if isinstance(text, str) else text
        words, answer = self.command()
        named = {name: content for name, content in FILES.items() if name.encode() in text}
        every = {**named, **(files or {}), "problem.toml": text}
        return Case(self.name, family, note, words, every, problem="problem.toml", answer=answer, **others)

    # -- problem files

    def physics(self) -> Case:
        data = random_problem(self.rng)
        return self.problem("physics", "random problem that makes sense", dump(data))

    def values(self) -> Case:
        rng = self.rng
        name, data = seed(rng)
        notes = []
        for _ in range(rng.choice([1, 1, 1, 2, 4])):
            path = rng.choice(leaves(data))
            old: Any = data
            for key in path:
                old = old[key]
            if isinstance(old, bool | str) or (isinstance(old, dict | list) and rng.random() < 0.5):
                new = strange_value(rng)
            elif isinstance(old, int | float):
                new = rng.choice(
                    [
                        strange_number(rng), strange_number(rng), -old, old * 10.0 ** rng.randint(-12, 12), old * rng.uniform(0, 3),
                        old * 10.0 ** rng.choice([-300, -160, -100, 100, 150]), strange_value(rng), f"{old} + 0*x", str(old),
                    ]
                )  # fmt: skip
            else:
                new = strange_value(rng)
            data = put(data, path, new)
            notes.append(f"{'.'.join(map(str, path))} = {str(new)[:60]!r}")
        return self.problem("values", f"{name}: {'; '.join(notes)}", dump(data))

    def structure(self) -> Case:
        rng = self.rng
        name, data = seed(rng)
        tables = [path for path in [(), *leaves(data)] if isinstance(_at(data, path), dict)]
        path = rng.choice(tables)
        table = dict(_at(data, path))
        key = rng.choice(list(table)) if table else "x"
        match rng.randrange(7):
            case 0:
                table.pop(key, None)
                note = f"{key} left out"
            case 1:
                table[key[:-1] or "q"] = table.pop(key, 1)
                note = f"{key} misspelt"
            case 2:
                new = strange_name(rng)
                table[new] = strange_value(rng)
                note = f"key {new[:30]!r}"
            case 3:
                new = strange_name(rng)
                table[new] = table.pop(key, 1)
                note = f"{key} renamed to {new[:30]!r}"
            case 4:
                _, other = seed(rng)
                taken = rng.choice(list(other))
                table[taken] = other[taken]
                note = f"with {taken} of another problem"
            case 5:
                other_path = rng.choice(leaves(data))
                table[str(other_path[-1])] = _at(data, other_path)
                note = f"with a copy of {other_path}"
            case _:
                table = {str(i): 1.0 for i in range(3000)} if rng.random() < 0.3 else {}
                note = "replaced"
        data = put(data, path, table)
        return self.problem("structure", f"{name}, {'.'.join(map(str, path)) or 'top'}: {note}"[:200], dump(data))

    def text(self) -> Case:
        rng = self.rng
        name, data = seed(rng)
        text = dump(data).encode()
        if rng.random() < 0.1:
            depth = rng.choice([50, 500, 5000, 100_000])
            text = rng.choice(
                [
                    b"a = " + b"[" * depth + b"]" * depth, b"a = " + b"{a=" * depth + b"1" + b"}" * depth,
                    b"[" + b".".join([b"a"] * depth) + b"]\n", b"\n".join(b"[t%d]" % i for i in range(depth)),
                    b'title = "' + b"x" * depth * 10 + b'"\n' + text, b"#" * depth + b"\n" + text,
                    b"title = 1" + b"0" * depth, b"", b"\0" * depth, b"a.b.c = 1\na.b = 2\n",
                ]
            )  # fmt: skip
            return self.problem("text", f"{name}: deep or large, {text[:20]!r}", text)
        for _ in range(rng.choice([1, 1, 2])):
            text, note = spoilt(text, rng)
        return self.problem("text", f"{name}: {note}", text)

    def formula(self) -> Case:
        rng = self.rng
        name, data = seed(rng)
        where = rng.choice(["gap", "body", "pressure", "lame", "young", "bound", "support", "stiffness", "distance"])
        variable = rng.choice("xy")
        text = rng.choice([rng.choice(_ATTACKS), rng.choice(_ATTACKS), _nested(rng, variable), f"{variable}^{rng.uniform(-2, 5):.2f}"])
        boundary = next(iter(data["contact"]))
        dim = 3 if "box" in data["mesh"] or data["mesh"].get("file") == "block.msh" else 2
        match where:
            case "gap":
                data["contact"][boundary].pop("obstacle", None)
                data["contact"][boundary].pop("normals", None)
                data["contact"][boundary]["gap"] = text
            case "body":
                data["loads"] = {"body": [text] + [0.0] * (dim - 1)}
            case "pressure":
                data["loads"] = {"pressure": {"top": text}}
            case "lame":
                data["material"] = {"lame": [1.0, text]}
            case "young":
                data["material"] = {"young": text, "poisson": 0.3}
            case "bound":
                data["contact"][boundary]["friction"] = {"law": "tresca", "bound": text}
            case "support":
                data["supports"] = {"top": {"displacement": [text] + [0.0] * (dim - 1)}}
            case "stiffness":
                data["contact"][boundary]["normal"] = {"law": "compliance", "stiffness": text}
            case _:
                data["contact"][boundary].pop("gap", None)
                data["contact"][boundary]["obstacle"] = {"distance": text}
        return self.problem("formula", f"{name}: {where} = {text[:80]!r}", dump(data))

    def law_formula(self) -> Case:
        rng = self.rng
        text = rng.choice([rng.choice(_LAWS), rng.choice(_LAWS), _nested(rng, "r"), rng.choice(_ATTACKS), _random_formula(rng, "r", 3)])
        if rng.random() < 0.12:
            words = ["laws", "--formula", text] + rng.choice([[], ["--friction"], ["--plot", "law.png"], ["--reach", "1e-3"]])
            return Case(self.name, "law formula", f"laws --formula {text[:80]!r}", words)
        friction: Any = "none"
        normal: Any = {"law": "formula", "potential": text}
        if rng.random() < 0.2:
            normal["reach"] = rng.choice([1e-9, 1e-3, 1.0, 1e9, 1e300, strange_number(rng)])
        if rng.random() < 0.2:
            normal["kinks"] = [rng.choice([0.0, 0.1, 1e300, math.nan, -1.0]) for _ in range(rng.choice([1, 2, 1000]))]
        if rng.random() < 0.4:
            normal, friction = known("survey")["contact"]["bottom"]["normal"], {"law": "formula", "potential": text, "bound": 0.2}
        if rng.random() < 0.3:
            bound = rng.choice([rng.choice(_BOUNDS), _random_formula(rng, "s", 3), _nested(rng, "s")])
            friction = {"law": "tresca", "bound": {"formula": bound}}
            text = f"{text[:60]}, bound {bound[:60]}"
        data = dict(known("survey"), contact={"bottom": {"normal": normal, "friction": friction}})
        return self.problem("law formula", text[:160], dump(data))

    # -- tables

    def table(self) -> Case:
        rng = self.rng
        which = rng.choice(["law.csv", "friction.csv", "bound.csv"])
        content, note = _table(rng, which)
        if rng.random() < 0.1:
            words = ["laws", "--file", which] + rng.choice([[], ["--friction"], ["--plot", "law.png"]])
            return Case(self.name, "table", f"laws --file: {note}", words, {which: content})
        data = dict(known("from tables"))
        contact = json.loads(json.dumps(data["contact"]))
        if which == "law.csv" and rng.random() < 0.5:
            contact["bottom"]["friction"] = "none"
        elif which != "law.csv":
            contact["bottom"]["normal"] = known("survey")["contact"]["bottom"]["normal"]
            if which == "friction.csv" and rng.random() < 0.5:
                contact["bottom"]["friction"]["bound"] = 0.2
        if rng.random() < 0.2:
            contact["bottom"]["normal"]["extend"] = rng.choice(["linear", "constant", "quadratic"])
        return self.problem("table", f"{which}: {note}", dump({**data, "contact": contact}), {which: content})

    # -- meshes

    def mesh(self) -> Case:
        rng = self.rng
        solid = rng.random() < 0.2
        base = grid_mesh(2, 2, 1) if solid else grid_mesh(rng.randint(1, 4), rng.randint(1, 4), regions=rng.choice([1, 1, 2]))
        version, binary = rng.choice(FORMATS)
        files: dict[str, bytes] = {}
        name = "mesh.msh"
        match rng.choices(["true", "model", "tokens", "bytes", "foreign"], [15, 25, 35, 15, 10])[0]:
            case "true":
                base, note = _renumbered(base, rng)
                content = write_msh(base, version, binary)
                files["reference.msh"] = write_msh(base)
            case "model":
                base, note = _other_model(base, rng)
                content = write_msh(base, version, False)
                binary = False
            case "tokens":
                content, note = _tokens(write_msh(base, version, False), rng)
                binary = False
            case "bytes":
                content, note = spoilt(write_msh(base, version, binary), rng)
            case _:
                name, content, note = _foreign(base, rng)
        data = {
            "mesh": {"file": name}, "material": {"lame": [4.0, 4.0]},
            "loads": {"body": [-0.2, -0.3, -0.8] if solid else [-0.2, -0.8]}, "supports": {"left": "clamped"},
            "contact": {"bottom": {"normal": {"law": "survey", "q_max": 0.3, "p_const": 2.0}}},
        }  # fmt: skip
        if rng.random() < 0.1:
            data["mesh"]["refine"] = 1
        note = f"{version} {'binary' if binary else 'ASCII'}, {note}"
        return self.problem("mesh", note[:200], dump(data), {**files, name: content})

    # -- solutions for certify

    def solution(self) -> Case:
        rng = self.rng
        _, data, record = _known_solution(rng)
        text = json.dumps(record).encode()
        kind = rng.choice(["bytes", "value", "value", "value", "value", "scaled", "scaled", "deep", "structure"])
        note = kind
        if kind == "bytes":
            text, note = spoilt(text, rng)
        elif kind == "deep":
            depth = rng.choice([100, 1000, 100_000])
            text = rng.choice(
                [b"[" * depth, b'{"displacement":' * depth, b'{"displacement":' + b"[" * depth + b"]" * depth + b"}",
                 b'{"displacement": 1' + b"0" * depth + b"}", b"[]", b"null", b"{}", b"1e999", b"NaN", b'{"displacement": null}']
            )  # fmt: skip
            note = f"deep: {text[:20]!r}"
        elif kind == "scaled":
            factor = rng.choice([0.0, 1.0, 1.0 + 1e-15, 1.0 + 1e-6, -1.0, 2.0, 1e300, 1e-300, 1e8])
            which = rng.choice(["displacement", "pressure", "friction"])
            if which == "displacement":
                record[which] = [[factor * c for c in row] for row in record[which]]
            elif record["contact"][which] is not None:
                record["contact"][which] = [factor * c if isinstance(c, float | int) else c for c in record["contact"][which]]
            text, note = json.dumps(record).encode(), f"{which} times {factor}"
        else:
            paths = [p for p in leaves(record) if p[0] in ("displacement", "contact") or rng.random() < 0.1]
            path = rng.choice(paths if kind == "value" else [p for p in paths if len(p) < 3] or paths)
            new = strange_value(rng)
            record = put(record, path, new)
            text, note = json.dumps(record).encode("utf-8", "surrogatepass"), f"{'.'.join(map(str, path))} = {str(new)[:50]!r}"
        words = ["certify", "problem.toml", "--solution", "given.json", "--json", "certificate.json"]
        files = {"problem.toml": dump(data).encode(), "given.json": text}
        return Case(self.name, "solution", note[:200], words, files, problem="problem.toml", answer="certificate.json")

    # -- options

    def options(self) -> Case:
        rng = self.rng
        number = str(rng.choice([strange_number(rng), strange_number(rng), "x", "", "1e-3", "0x10", "1,5", "١", "1_0", "--"]))
        file = rng.choice(
            ["a.json", "a.txt", "", ".", "/", "nowhere/a.json", "problem.toml", "problem.toml/a.json", "a\0.json", "a" * 300 + ".json",
             "\x1b[31m.json", "/dev/null", "/dev/full", "/dev/stdout", "/proc/self/mem", ".json", "-", "~", "a.JSON", "law.csv", "part.msh",
             "./problem.toml", "b.vtu", "a.vtu", "../a.json", "$HOME.json", "*.json"]
        )  # fmt: skip
        extra = rng.choice(
            [
                ["--json", file], ["--vtu", file], ["--plot", file], ["--rtol", number], ["--max-time", number], ["--max-steps", number],
                ["--method", rng.choice([strange_name(rng), *METHODS])], ["--json", "b.json", "--vtu", "b.json"], ["--engine", strange_name(rng)],
                ["--warm-start"], ["--render", "r.png"], ["--plot-contact", file], ["--checkpoint", file], ["--restart", file], ["--rtol"],
                [strange_name(rng)], ["--unknown"], ["--json", "a.json", "--json", "b.json"], ["--vtu", "a.vtu", "--plot", "a_contact.vtu"],
                ["--help"], ["--rtol", "1e-300"], ["--rtol", "1"], ["--rtol", "1e10"], ["--max-steps", "1"], ["--max-time", "1e-9"],
            ]
        )  # fmt: skip
        name, data = seed(rng)
        text = dump(data).encode()
        files = {"problem.toml": text, "law.csv": FILES["law.csv"], **{n: c for n, c in FILES.items() if n.encode() in text}}
        kind = rng.choice(["solve", "solve", "solve", "certify", "solutions", "path", "compare", "survey", "new", "laws", "methods", "none"])
        answer = None
        match kind:
            case "solve":
                words = ["solve", "problem.toml", *extra]
                if "--json" not in extra and "--vtu" not in extra:
                    words += ["--json", "solve.json", "--vtu", "solve.vtu"]
                    answer = "solve.json"
            case "certify":
                words = ["certify", "problem.toml", *rng.choice([["--rtol", number], ["--json", file], ["--solution", file], extra])]
            case "solutions":
                words = ["solutions", "problem.toml", *rng.choice([["--starts", number], ["--seed", number], ["--max-solutions", number],
                                                                   ["--json", file], extra])]  # fmt: skip
            case "path":
                words = ["path", "problem.toml", "--max-points", "20", *rng.choice(
                    [["--load-factor", number, "1"], ["--load-factor", "0", number], ["--quantity", strange_name(rng)], ["--max-points", number],
                     ["--json", file], ["--plot", file]])]  # fmt: skip
            case "compare":
                words = ["compare", "problem.toml", "--max-time", "1", *rng.choice(
                    [["--methods", rng.choice(["", ",", "newton,", "newton,newton", strange_name(rng)])], ["--csv", file], ["--json", file]])]  # fmt: skip
            case "survey":
                words = ["survey", *rng.choice([["--max-n", rng.choice(["0", "7", "-8", "1e9", "9", "x"])], ["--max-time", rng.choice(["0", "-1", "nan"])],
                                                ["--out", "problem.toml"], ["--out", "nowhere/deep"], ["--max-n", "8", "--out", "a\0b"]])]  # fmt: skip
            case "new":
                words = ["new", *rng.choice([[], [file], ["problem.toml"], ["--force"], ["a.toml", "b.toml"], ["\x1b[2J.toml"]])]
            case "laws":
                law = random_law(rng, 1.0, 1.0)["law"]
                words = ["laws", rng.choice([law, "tresca", strange_name(rng)]), *rng.choice(
                    [["--set", f"stiffness={number}"], ["--set", strange_name(rng)], ["--set", "="], ["--set", "a=b=c"], ["--reach", number],
                     ["--plot", file], ["--friction"], []])]  # fmt: skip
            case "methods":
                words = ["methods", *rng.choice([[], ["x"], ["--help"]])]
            case _:
                words = rng.choice([[], ["--version"], ["--help"], [strange_name(rng)], ["solve"], ["solve", "a", "b"], ["solve", strange_name(rng)]])
        note = f"{name}: {' '.join(words)}"
        return Case(self.name, "options", note[:200], words, files, problem="problem.toml" if answer else None, answer=answer)

    # -- things that are not regular files

    def files(self) -> Case:
        rng = self.rng
        role = rng.choice(["problem", "mesh", "law", "bound", "solution", "output", "output", "vtu solution"])
        kind = rng.choice(["fifo", "folder", "socket", "link loop", "link nowhere", "device", "device", "endless", "sparse", "empty", "long", "nul", "proc"])
        files: dict[str, bytes] = {}
        special: dict[str, str] = {}
        suffix = {"problem": ".toml", "mesh": ".msh", "law": ".csv", "bound": ".csv", "solution": ".json", "output": ".json"}.get(role, ".vtu")
        name = f"odd{suffix}"
        match kind:
            case "fifo" | "folder" | "socket":
                special[name] = kind
            case "link loop":
                special |= {name: f"link other{suffix}", f"other{suffix}": f"link {name}"}
            case "link nowhere":
                special[name] = "link nowhere"
            case "device":
                name = rng.choice(["/dev/null", "/dev/full", "/dev/tty", "/dev/stdin", "/dev/random"])
            case "endless":
                name = rng.choice(["/dev/zero", "/dev/urandom"])
            case "sparse":
                special[name] = f"sparse {rng.choice([1 << 20, 1 << 28, 1 << 31, 1 << 35])}"
            case "empty":
                files[name] = b""
            case "long":
                name = "a" * rng.choice([256, 5000]) + suffix
            case "nul":
                name = f"a\0b{suffix}"
            case _:
                name = rng.choice(["/proc/self/mem", "/proc/self/fd/0", "/proc/kmsg", "/proc/self/environ", "/sys/kernel/notes"])
        if role in ("problem", "output", "solution", "vtu solution"):
            data = known("survey")
        elif role == "mesh":
            data = dict(known("regions"), mesh={"file": name})
        elif role == "law":
            data = dict(known("survey"), contact={"bottom": {"normal": {"law": "table", "file": name}}})
        else:
            friction = {"law": "tresca", "bound": {"table": name}}
            data = dict(known("survey"), contact={"bottom": {"normal": "signorini", "friction": friction}})
        if role != "problem":
            files["problem.toml"] = dump(data).encode()
        words = ["solve", name if role == "problem" else "problem.toml"]
        if role == "output":
            words += rng.choice([["--json", name], ["--json", "a.json", "--vtu", name.replace(".json", ".vtu")], ["--plot", name.replace(".json", ".png")]])
        elif "solution" in role:
            words = ["certify", "problem.toml", "--solution", name]
        else:
            words += ["--json", "a.json"]
        return Case(self.name, "files", f"{role}: {kind}, {name[:60]!r}", words, files, special)

    # -- the surroundings of the process

    def surroundings(self) -> Case:
        rng = self.rng
        name, data = seed(rng)
        text = dump(data).encode()
        files = {"problem.toml": text, **{n: c for n, c in FILES.items() if n.encode() in text}}
        kind = rng.choice(["closed", "full", "gone", "backend", "usetex", "ascii", "limit", "limit", "limit", "home", "broken rc"])
        words = rng.choice(
            [["solve", "problem.toml", "--json", "a.json", "--vtu", "a.vtu", "--plot", "a.png"], ["certify", "problem.toml", "--json", "a.json"],
             ["compare", "problem.toml", "--max-time", "1", "--methods", "newton", "--csv", "a.csv"], ["laws"], ["methods"],
             ["path", "problem.toml", "--max-points", "20", "--json", "a.json", "--plot", "a.png"], ["solutions", "problem.toml", "--json", "a.json"]]
        )  # fmt: skip
        plot = ["solve", "problem.toml", "--plot", "a.png"]
        others: dict[str, Any] = {"fresh": True}
        match kind:
            case "closed" | "full" | "gone":
                others["streams"] = kind
            case "backend":
                others["environment"] = {"MPLBACKEND": rng.choice(["nonsense", "TkAgg", "module://nothing", ""])}
                words = plot
            case "usetex" | "broken rc":
                files["matplotlibrc"] = b"text.usetex: True\n" if kind == "usetex" else rng.randbytes(200)
                others["environment"] = {"MATPLOTLIBRC": "matplotlibrc"}
                words = plot
            case "ascii":
                data["title"] = "Körper auf Grund \u2192 \x1b[31m"
                files["problem.toml"] = dump(data).encode()
                others["environment"] = {"PYTHONIOENCODING": "ascii", "LC_ALL": "C", "PYTHONUTF8": "0"}
            case "limit":
                others = {"file_size": rng.choice([0, 1, 100, 4096, 20_000])}
                if words[0] in ("laws", "methods"):
                    words = plot
            case _:
                others["environment"] = {"HOME": "/nonexistent", "XDG_CACHE_HOME": "/proc", "MPLCONFIGDIR": rng.choice(["/proc/x", "problem.toml"])}
                words = plot
        return Case(self.name, "surroundings", f"{name}, {kind}: {' '.join(words)}"[:200], words, files, **others)


#: Generators with their weights.
FAMILIES: dict[str, tuple[Callable[[_Maker], Case], int]] = {
    "physics": (_Maker.physics, 22),
    "values": (_Maker.values, 16),
    "structure": (_Maker.structure, 7),
    "text": (_Maker.text, 5),
    "formula": (_Maker.formula, 7),
    "law formula": (_Maker.law_formula, 9),
    "table": (_Maker.table, 8),
    "mesh": (_Maker.mesh, 12),
    "solution": (_Maker.solution, 5),
    "options": (_Maker.options, 7),
    "files": (_Maker.files, 5),
    "surroundings": (_Maker.surroundings, 3),
}


def make_case(seed_number: int, number: int, family: str | None = None) -> Case:
    """The case of this seed and number; of one family, or of one that the number chooses."""
    if family is None:
        names, weights = list(FAMILIES), [weight for _, weight in FAMILIES.values()]
        family = random.Random(f"family {seed_number}:{number}").choices(names, weights)[0]
    return FAMILIES[family][0](_Maker(f"{seed_number}:{number}"))


def _at(data: Any, path: tuple[Any, ...]) -> Any:
    for key in path:
        data = data[key]
    return data


def _random_formula(rng: random.Random, variable: str, depth: int) -> str:
    if depth == 0 or rng.random() < 0.15:
        return rng.choice([variable, variable, f"{rng.uniform(-2, 2):.3g}", "0", "1", "1e-3", "pi"])
    inner = _random_formula(rng, variable, depth - 1)
    if rng.random() < 0.5:
        return f"{rng.choice(['sin', 'cos', 'tanh', 'exp', 'log', 'sqrt', 'abs', '-', ''])}({inner})"
    other = _random_formula(rng, variable, depth - 1)
    return rng.choice(
        [f"({inner}) + ({other})", f"({inner}) * ({other})", f"({inner}) / ({other})", f"min({inner}, {other})",
         f"max({inner}, {other})", f"({inner})^{rng.choice([2, 3, 0.5, -1])}",
         f"piecewise(({inner}, {variable} < {rng.uniform(-0.1, 0.2):.3g}), {other})"]
    )  # fmt: skip


# ---- tables ------------------------------------------------------------------------------------------------


def _table(rng: random.Random, which: str) -> tuple[bytes, str]:
    """A CSV file and what is odd about it."""
    columns = {"law.csv": ["r", "derivative"], "friction.csv": ["r", "derivative"], "bound.csv": ["s", "bound"]}[which]
    rows = [line.split(",") for line in FILES[which].decode().splitlines()[1:]]
    head: list[str] | None = list(columns)
    separator, note = ",", ""
    match rng.randrange(24):
        case 0:
            head, rows, note = head[::-1], [row[::-1] for row in rows], "columns swapped, with their names"
        case 1:
            head, note = head[::-1], "names swapped"
        case 2:
            head = rng.choice([["x", "y"], ["derivative", "r"], ["Penetration", "Pressure"], ["r"], ["r", "r"], ["", ""], [strange_name(rng)] * 2])
            note = f"names {str(head)[:40]}"
        case 3:
            rows, head, note = [[c.replace(".", ",") for c in row] for row in rows], None, "decimal commas"
        case 4:
            separator, rows, note = ";", [[c.replace(".", ",") for c in row] for row in rows], "decimal commas, semicolons"
        case 5:
            separator = rng.choice([";", "\t", " ", "|", "  ", " ; ", ", "])
            note = f"separator {separator!r}"
        case 6:
            rows = [[*row, str(rng.random())] for row in rows]
            head = rng.choice([None, [*columns, "note"], ["note", *columns]])
            note = f"three columns, names {head}"
        case 7:
            rng.shuffle(rows)
            note = "unsorted"
        case 8:
            rows = rows + [rows[-1]] * rng.choice([1, 2, 5])
            note = "last row repeated"
        case 9:
            i, j = rng.randrange(len(rows)), rng.randrange(2)
            rows[i][j] = rng.choice(["nan", "inf", "-inf", "", "x", "1e400", "1e308", "-1e308", "1e-320", "0x1", "1_0", "١", "1e", "NULL", "-5"])
            note = f"cell {rows[i][j]!r}"
        case 10:
            count = rng.choice([0, 1])
            rows, note = rows[:count], f"{count} rows"
        case 11:
            count = rng.choice([1000, 3000, 20_000, 100_000])
            rows = [[f"{0.5 * i / count:.8f}", f"{0.1 + 0.8 * i / count + 0.01 * (i % 2):.6f}"] for i in range(count)]
            note = f"{count} rows"
        case 12:
            rows[rng.randrange(len(rows))][rng.randrange(2)] = "1" * rng.choice([200_000, 2_000_000])
            note = "a huge field"
        case 13:
            head = ["a" * 200_000, "b"]
            note = "a huge name"
        case 14:
            rows = [[c, str(-float(d))] for c, d in rows]
            note = "values negative"
        case 15:
            factor = 10.0 ** rng.choice([-300, -100, -20, 20, 100, 155, 300])
            rows = [[c, repr(float(d) * factor)] for c, d in rows]
            note = f"values times {factor:g}"
        case 16:
            factor = 10.0 ** rng.choice([-300, -20, 20, 100, 300])
            rows = [[repr(float(c) * factor), d] for c, d in rows]
            note = f"places times {factor:g}"
        case 17:
            rows.insert(rng.randrange(len(rows)), rng.choice([["# comment"], [""], ["r", "derivative"], ['"0.1', '0.2"'], ["1"]]))
            note = "a row of another kind"
        case 18:
            head, note = None, "without names"
        case 19:
            rows = [[f'"{c}"' for c in row] for row in rows]
            note = "quoted"
        case 20:
            rows = [[repr(math.nextafter(float(rows[0][0]), math.inf)) if i == 1 else row[0], row[1]] for i, row in enumerate(rows)]
            rows.sort(key=lambda row: float(row[0]))
            note = "places one rounding apart"
        case 21:
            rows = [[row[0], repr(float(row[1]) * rng.uniform(-2, 2))] for row in rows]
            note = "values at random"
        case 22:
            rows = [[c, d] for c, d in rows for _ in range(2)]
            note = "every row twice"
        case _:
            content, note = spoilt(FILES[which], rng)
            return content, note
    lines = [separator.join(row) for row in ([head] if head else []) + rows]
    return ("\n".join(lines) + "\n").encode("utf-8", "surrogatepass"), note


# ---- meshes ------------------------------------------------------------------------------------------------


def _renumbered(mesh: Any, rng: random.Random) -> tuple[Any, str]:
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


def _other_model(mesh: Any, rng: random.Random) -> tuple[Any, str]:
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


def _tokens(content: bytes, rng: random.Random) -> tuple[bytes, str]:
    """One word of an ASCII mesh file made another one, or lines changed."""
    lines = content.decode().split("\n")
    notes = []
    for _ in range(rng.choice([1, 1, 1, 2])):
        row = rng.randrange(len(lines))
        words = lines[row].split(" ")
        place = rng.randrange(len(words))
        old = words[place]
        new = rng.choice(
            ["0", "1", "2", "-1", "3", "99", "1e", "1e5", "nan", "inf", "-inf", "1e308", "1e400", "x", "", "1.5", "10000000000", "1,5", "0x2", "1_0",
             "2147483648", "4294967297", "9223372036854775808", "$", '"', "\x1b[31m", "\0", f"{old}e", f"{old}x", f"-{old}", f"{old} {old}", f"{old}.0"]
        )  # fmt: skip
        words[place] = new
        lines[row] = " ".join(words)
        notes.append(f"line {row + 1}: {old[:20]!r} is {new[:20]!r}")
    return "\n".join(lines).encode(), "; ".join(notes)


def _foreign(mesh: Any, rng: random.Random) -> tuple[str, bytes, str]:
    """Other formats: written here by hand as far as they are text, spoilt, or under a wrong name."""
    nodes = list(mesh.nodes.values())
    number = {n: i for i, n in enumerate(mesh.nodes)}
    cells = [[number[n] for n in e[3]] for e in mesh.elements if e[0] == mesh.dim]
    vtk = "# vtk DataFile Version 3.0\nx\nASCII\nDATASET UNSTRUCTURED_GRID\n"
    vtk += f"POINTS {len(nodes)} double\n" + "".join(f"{x} {y} {z}\n" for x, y, z in nodes)
    vtk += f"CELLS {len(cells)} {sum(len(c) + 1 for c in cells)}\n" + "".join(f"{len(c)} {' '.join(map(str, c))}\n" for c in cells)
    vtk += f"CELL_TYPES {len(cells)}\n" + f"{5 if mesh.dim == 2 else 10}\n" * len(cells)
    obj = "".join(f"v {x} {y} {z}\n" for x, y, z in nodes) + "".join(f"f {' '.join(str(i + 1) for i in c)}\n" for c in cells)
    inp = "*NODE\n" + "".join(f"{i + 1}, {x}, {y}, {z}\n" for i, (x, y, z) in enumerate(nodes))
    inp += f"*ELEMENT, TYPE={'CPS3' if mesh.dim == 2 else 'C3D4'}\n"
    inp += "".join(f"{i + 1}, {', '.join(str(j + 1) for j in c)}\n" for i, c in enumerate(cells))
    off = f"OFF\n{len(nodes)} {len(cells)} 0\n" + "".join(f"{x} {y} {z}\n" for x, y, z in nodes)
    off += "".join(f"{len(c)} {' '.join(map(str, c))}\n" for c in cells)
    name, content = rng.choice([("m.vtk", vtk), ("m.obj", obj), ("m.inp", inp), ("m.off", off)])
    data, note = content.encode(), f"{name} as it is"
    if rng.random() < 0.6:
        data, note = spoilt(data, rng)
        note = f"{name}, {note}"
    if rng.random() < 0.3:
        name = rng.choice(["m.msh", "m.vtu", "m.stl", "m.med", "m.xdmf", "m.h5m", "m.e", "m.cgns", "m.unknown", "m", "m.su2", "m.bdf", "m.xml", "m.node"])
        note += f" under the name {name}"
    return name, data, note


# ---- solutions ---------------------------------------------------------------------------------------------

_SOLVED: dict[str, str] = {}


def _known_solution(rng: random.Random) -> tuple[str, dict[str, Any], dict[str, Any]]:
    """A seed, and its solution by the library as a record."""
    name = rng.choice(["survey", "logarithmic", "rigid", "between walls", "cube", "glued"])
    if name not in _SOLVED:
        import tempfile
        from pathlib import Path

        from tests.robustness.limited import run_limited

        with tempfile.TemporaryDirectory() as folder:
            place = Path(folder) / "solve"
            place.mkdir()
            (place / "problem.toml").write_text(dump(known(name)))

            def solve() -> int:
                from hemivar.cli import main

                return main(["solve", "problem.toml", "--json", "a.json", "--method", "newton", "--rtol", "1e-10"])

            run = run_limited(solve, place)
            if run.code != 0:
                raise RuntimeError(f"the problem '{name}' was not solved: {run}")
            _SOLVED[name] = (place / "a.json").read_text()
    return name, known(name), json.loads(_SOLVED[name])
