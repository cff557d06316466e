"""The hostile cases: ``make_case(seed, number)`` is the same on every machine and in any order."""

from __future__ import annotations

import json
import math
import random
from collections.abc import Callable, Mapping
from typing import Any

from tests.robustness.case import Case
from tests.robustness.evolutions import random_evolution
from tests.robustness.formulas import ATTACKS, BOUNDS, LAWS, nested, random_formula
from tests.robustness.kept import kept_case
from tests.robustness.meshes import foreign, other_model, renumbered, tokens
from tests.robustness.msh import FORMATS, grid_mesh, write_msh
from tests.robustness.results import result_case
from tests.robustness.seeds import FILES, METHODS, known, random_law, random_problem, seed
from tests.robustness.tables import odd_table
from tests.robustness.toml import dump, leaves, put, spoilt, strange_name, strange_number, strange_value

__all__ = ["FAMILIES", "SLOW_TO_MAKE", "family_of", "make_case"]


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
        words = [kind, "problem.toml", "--json", json_file, "--max-time", "1" if kind == "compare" else "5"]
        if kind == "solve":
            words += ["--vtu", "solve.vtu"]
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
            words += ["--csv", "compare.csv"]
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
                        strange_number(rng), strange_number(rng), -old, old * 10.0 ** rng.randint(-12, 12),
                        old * rng.uniform(0, 3),
                        old * 10.0 ** rng.choice([-300, -160, -100, 100, 150]), strange_value(rng), f"{old} + 0*x",
                        str(old),
                    ]
                )  # fmt: skip
            else:
                new = strange_value(rng)
            changed = put(data, path, new)
            if _merely_large(changed):
                continue
            data = changed
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
        text = rng.choice(
            [rng.choice(ATTACKS), rng.choice(ATTACKS), nested(rng, variable), f"{variable}^{rng.uniform(-2, 5):.2f}"]
        )
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
        text = rng.choice(
            [
                rng.choice(LAWS),
                rng.choice(LAWS),
                nested(rng, "r"),
                rng.choice(ATTACKS),
                random_formula(rng, "r", 3),
            ]
        )
        if rng.random() < 0.12:
            more = rng.choice([[], ["--friction"], ["--plot", "law.png"], ["--reach", "1e-3"]])
            words = ["laws", "--formula", text, *more]
            return Case(self.name, "law formula", f"laws --formula {text[:80]!r}", words)
        friction: Any = "none"
        normal: Any = {"law": "formula", "potential": text}
        if rng.random() < 0.2:
            normal["reach"] = rng.choice([1e-300, 1e-9, 1e-3, 1.0, 1e9, 1e300, strange_number(rng)])
        if rng.random() < 0.2:
            normal["kinks"] = [rng.choice([0.0, 0.1, 1e300, math.nan, -1.0]) for _ in range(rng.choice([1, 2, 1000]))]
        if rng.random() < 0.4:
            normal, friction = (
                known("survey")["contact"]["bottom"]["normal"],
                {"law": "formula", "potential": text, "bound": 0.2},
            )
        if rng.random() < 0.3:
            bound = rng.choice([rng.choice(BOUNDS), random_formula(rng, "s", 3), nested(rng, "s")])
            friction = {"law": "tresca", "bound": {"formula": bound}}
            text = f"{text[:60]}, bound {bound[:60]}"
        data = dict(known("survey"), contact={"bottom": {"normal": normal, "friction": friction}})
        return self.problem("law formula", text[:160], dump(data))

    # -- tables

    def table(self) -> Case:
        rng = self.rng
        which = rng.choice(["law.csv", "friction.csv", "bound.csv"])
        content, note = odd_table(rng, which)
        if rng.random() < 0.1:
            words = ["laws", "--file", which, *rng.choice([[], ["--friction"], ["--plot", "law.png"]])]
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
        base = (
            grid_mesh(2, 2, 1)
            if solid
            else grid_mesh(rng.randint(1, 4), rng.randint(1, 4), regions=rng.choice([1, 1, 2]))
        )
        version, binary = rng.choice(FORMATS)
        files: dict[str, bytes] = {}
        name = "mesh.msh"
        match rng.choices(["true", "model", "tokens", "bytes", "foreign"], [15, 20, 30, 15, 20])[0]:
            case "true":
                base, note = renumbered(base, rng)
                content = write_msh(base, version, binary)
                files["reference.msh"] = write_msh(base)
            case "model":
                base, note = other_model(base, rng)
                content = write_msh(base, version, False)
                binary = False
            case "tokens":
                content, note = tokens(write_msh(base, version, False), rng)
                binary = False
            case "bytes":
                content, note = spoilt(write_msh(base, version, binary), rng)
            case _:
                name, content, note = foreign(base, rng)
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
                 b'{"displacement": 1' + b"0" * depth + b"}", b"[]", b"null", b"{}", b"1e999", b"NaN",
                 b'{"displacement": null}']
            )  # fmt: skip
            note = f"deep: {text[:20]!r}"
        elif kind == "scaled":
            factor = rng.choice([0.0, 1.0, 1.0 + 1e-15, 1.0 + 1e-6, -1.0, 2.0, 1e300, 1e-300, 1e8])
            which = rng.choice(["displacement", "pressure", "friction"])
            if which == "displacement":
                record[which] = [[factor * c for c in row] for row in record[which]]
            elif record["contact"][which] is not None:
                record["contact"][which] = [
                    factor * c if isinstance(c, float | int) else c for c in record["contact"][which]
                ]
            text, note = json.dumps(record).encode(), f"{which} times {factor}"
        else:
            paths = [p for p in leaves(record) if p[0] in ("displacement", "contact") or rng.random() < 0.1]
            path = rng.choice(paths if kind == "value" else [p for p in paths if len(p) < 3] or paths)
            new = strange_value(rng)
            record = put(record, path, new)
            text, note = (
                json.dumps(record).encode("utf-8", "surrogatepass"),
                f"{'.'.join(map(str, path))} = {str(new)[:50]!r}",
            )
        words = ["certify", "problem.toml", "--solution", "given.json", "--json", "certificate.json"]
        files = {"problem.toml": dump(data).encode(), "given.json": text}
        return Case(self.name, "solution", note[:200], words, files, problem="problem.toml", answer="certificate.json")

    # -- options

    def options(self) -> Case:
        rng = self.rng
        number = str(
            rng.choice(
                [strange_number(rng), strange_number(rng), "x", "", "1e-3", "0x10", "1,5", "\u0661", "1_0", "--"]
            )
        )
        file = rng.choice(
            ["a.json", "a.txt", "", ".", "/", "nowhere/a.json", "problem.toml", "problem.toml/a.json", "a\0.json",
            "a" * 300 + ".json",
             "\x1b[31m.json", "/dev/null", "/dev/full", "/dev/stdout", "/proc/self/mem", ".json", "-", "~", "a.JSON",
             "law.csv", "part.msh",
             "./problem.toml", "b.vtu", "a.vtu", "../a.json", "$HOME.json", "*.json"]
        )  # fmt: skip
        extra = rng.choice(
            [
                ["--json", file], ["--vtu", file], ["--plot", file], ["--rtol", number], ["--max-time", number],
                ["--max-steps", number],
                ["--method", rng.choice([strange_name(rng), *METHODS])], ["--json", "b.json", "--vtu", "b.json"],
                ["--engine", strange_name(rng)],
                ["--warm-start"], ["--plot-contact", file], ["--checkpoint", file],
                ["--checkpoint", file, "--resume"], ["--rtol"],
                [strange_name(rng)], ["--unknown"], ["--json", "a.json", "--json", "b.json"], ["--vtu", "a.vtu",
                "--plot", "a_contact.vtu"],
                ["--help"], ["--rtol", "1e-300"], ["--rtol", "1"], ["--rtol", "1e10"], ["--max-steps", "1"],
                ["--max-time", "1e-9"],
            ]
        )  # fmt: skip
        table = file if file != "law.csv" else "a.csv"  # which may be overwritten where the problem does not read it
        name, data = seed(rng)
        text = dump(data).encode()
        files = {
            "problem.toml": text,
            "law.csv": FILES["law.csv"],
            **{n: c for n, c in FILES.items() if n.encode() in text},
        }
        kind = rng.choice(
            [
                "solve",
                "solve",
                "solve",
                "certify",
                "solutions",
                "path",
                "compare",
                "study",
                "sweep",
                "set",
                "survey",
                "new",
                "laws",
                "methods",
                "none",
            ]
        )
        answer = None
        match kind:
            case "solve":
                words = ["solve", "problem.toml", *extra]
                if "--json" not in extra and "--vtu" not in extra:
                    words += ["--json", "solve.json", "--vtu", "solve.vtu"]
                    answer = "solve.json"
            case "certify":
                words = [
                    "certify",
                    "problem.toml",
                    *rng.choice([["--rtol", number], ["--json", file], ["--solution", file], extra]),
                ]
            case "solutions":
                words = ["solutions", "problem.toml", "--max-time", "5", *rng.choice([["--starts", number],
                ["--seed", number],
                ["--max-solutions", number],
                                                                   ["--json", file], extra])]  # fmt: skip
            case "path":
                words = ["path", "problem.toml", "--max-points", "20", *rng.choice(
                    [["--load-factor", number, "1"], ["--load-factor", "0", number], ["--quantity",
                    strange_name(rng)], ["--max-points", number],
                     ["--json", file], ["--plot", file]])]  # fmt: skip
            case "compare":
                words = ["compare", "problem.toml", "--max-time", "1", *rng.choice(
                    [["--methods", rng.choice(["", ",", "newton,", "newton,newton", strange_name(rng)])], ["--csv",
                    table], ["--json", file]])]  # fmt: skip
            case "study":
                words = ["study", "problem.toml", "--max-time", "1", *rng.choice(
                    [["--refine", number], ["--refine", "1", "--known", rng.choice(["", "x", "t", "1/x", "sqrt(x)"])],
                     ["--refine", "1", "--coarser", number], ["--refine", "1", "--csv", table],
                     ["--refine", "1", "--latex", file], ["--refine", "1", "--plot", file],
                     ["--refine", "1", "--checkpoint", file], ["--refine", "1", "--jobs", number]])]  # fmt: skip
            case "sweep":
                ranges = ["1e-9:1e-8:2", f"{number}:1:2", f"1:{number}:2", f"1:2:{number}", "0:1:2:log", "1:2:3:4"]
                key = rng.choice(["solver.rtol", "contact.bottom.gap", "loads.body.0", strange_name(rng)])
                words = ["sweep", "problem.toml", "--max-time", "1", "--starts", "1", "--set",
                         f"{key}={rng.choice(ranges)}", *rng.choice([[], ["--checkpoint", file], ["--csv", table],
                         ["--latex", file], ["--plot", file], ["--jobs", number], ["--label", "$x"]])]  # fmt: skip
            case "set":
                path = rng.choice(
                    ["title", "mesh", "mesh.cells", "mesh.cells.0", "contact", "contact.bottom.normal", "loads.body.9",
                    "supports.left", "solver.rtol", "a.b.c.d", "", ".", "mesh.", '"', strange_name(rng)]
                )  # fmt: skip
                value = rng.choice(
                    [number, '"x"', "[]", "{}", "[[[1]]]", "true", "1979-05-27", "nan", "", strange_name(rng)]
                )
                words = [rng.choice(["solve", "certify"]), "problem.toml", "--set", f"{path}={value}"]
            case "survey":
                words = ["survey", *rng.choice([["--max-n", rng.choice(["0", "7", "-8", "1e9", "9", "x"])],
                ["--max-time", rng.choice(["0", "-1", "nan"])],
                                                ["--output", "problem.toml"], ["--output", "nowhere/deep"], ["--max-n",
                                                "8", "--output", "a\0b"]])]  # fmt: skip
            case "new":
                words = [
                    "new",
                    *rng.choice([[], [file], ["problem.toml"], ["--force"], ["a.toml", "b.toml"], ["\x1b[2J.toml"]]),
                ]
            case "laws":
                law = random_law(rng, 1.0, 1.0)["law"]
                words = ["laws", rng.choice([law, "tresca", strange_name(rng)]), *rng.choice(
                    [["--set", f"stiffness={number}"], ["--set", strange_name(rng)], ["--set", "="], ["--set",
                    "a=b=c"], ["--reach", number],
                     ["--plot", file], ["--friction"], []])]  # fmt: skip
            case "methods":
                words = ["methods", *rng.choice([[], ["x"], ["--help"]])]
            case _:
                words = rng.choice(
                    [
                        [],
                        ["--version"],
                        ["--help"],
                        [strange_name(rng)],
                        ["solve"],
                        ["solve", "a", "b"],
                        ["solve", strange_name(rng)],
                    ]
                )
        note = f"{name}: {' '.join(words)}"
        return Case(
            self.name, "options", note[:200], words, files, problem="problem.toml" if answer else None, answer=answer
        )

    # -- things that are not regular files

    def files(self) -> Case:
        rng = self.rng
        role = rng.choice(["problem", "mesh", "law", "bound", "solution", "output", "output", "vtu solution"])
        kind = rng.choice(
            [
                "fifo",
                "folder",
                "socket",
                "link loop",
                "link nowhere",
                "device",
                "device",
                "endless",
                "sparse",
                "empty",
                "long",
                "nul",
                "proc",
            ]
        )
        files: dict[str, bytes] = {}
        special: dict[str, str] = {}
        suffix = {
            "problem": ".toml",
            "mesh": ".msh",
            "law": ".csv",
            "bound": ".csv",
            "solution": ".json",
            "output": ".json",
        }.get(role, ".vtu")
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
                name = rng.choice(
                    ["/proc/self/mem", "/proc/self/fd/0", "/proc/kmsg", "/proc/self/environ", "/sys/kernel/notes"]
                )
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
            words += rng.choice(
                [
                    ["--json", name],
                    ["--json", "a.json", "--vtu", name.replace(".json", ".vtu")],
                    ["--plot", name.replace(".json", ".png")],
                ]
            )
        elif "solution" in role:
            words = ["certify", "problem.toml", "--solution", name]
        else:
            words += ["--json", "a.json"]
        rewritten = (name,) if role == "output" else ()
        return Case(self.name, "files", f"{role}: {kind}, {name[:60]!r}", words, files, special, rewritten=rewritten)

    # -- the surroundings of the process

    def surroundings(self) -> Case:
        rng = self.rng
        name, data = seed(rng)
        text = dump(data).encode()
        files = {"problem.toml": text, **{n: c for n, c in FILES.items() if n.encode() in text}}
        kind = rng.choice(
            ["closed", "full", "gone", "backend", "usetex", "ascii", "limit", "limit", "limit", "home", "broken rc"]
        )
        words = rng.choice(
            [["solve", "problem.toml", "--json", "a.json", "--vtu", "a.vtu", "--plot", "a.png"], ["certify",
            "problem.toml", "--json", "a.json"],
             ["compare", "problem.toml", "--max-time", "1", "--methods", "newton", "--csv", "a.csv"], ["laws"],
             ["methods"],
             ["path", "problem.toml", "--max-points", "20", "--json", "a.json", "--plot", "a.png"], ["solutions",
             "problem.toml", "--max-time", "5", "--json", "a.json"]]
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
                others["environment"] = {
                    "HOME": "/nonexistent",
                    "XDG_CACHE_HOME": "/proc",
                    "MPLCONFIGDIR": rng.choice(["/proc/x", "problem.toml"]),
                }
                words = plot
        return Case(self.name, "surroundings", f"{name}, {kind}: {' '.join(words)}"[:200], words, files, **others)

    def evolution(self) -> Case:
        """An evolution of a small body, every step of which can be enumerated."""
        data, tables, note = random_evolution(self.rng)
        words = ["march", "problem.toml", "--json", "march.json", "--fields", "run.pvd", "--max-time", "10"]
        files = {"problem.toml": dump(data).encode(), **{name: text.encode() for name, text in tables.items()}}
        return Case(self.name, "evolution", note, words, files, problem="problem.toml", answer="march.json")

    def kept(self) -> Case:
        """A command that goes on from a hostile file."""
        return kept_case(self.rng, self.name)

    def results(self) -> Case:
        """A result file that is broken or forged."""
        return result_case(self.name, self.rng)


#: Families whose cases begin with runs of the command, which take seconds.
SLOW_TO_MAKE = frozenset({"solution", "kept"})
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
    "evolution": (_Maker.evolution, 6),
    "kept": (_Maker.kept, 6),
    "results": (_Maker.results, 8),
}


def make_case(seed_number: int, number: int, family: str | None = None) -> Case:
    """The case of this seed and number; of one family, or of one that the number chooses."""
    family = family_of(seed_number, number) if family is None else family
    return FAMILIES[family][0](_Maker(f"{seed_number}:{number}"))


def family_of(seed_number: int, number: int) -> str:
    """The family that a number chooses."""
    names, weights = list(FAMILIES), [weight for _, weight in FAMILIES.values()]
    return random.Random(f"family {seed_number}:{number}").choices(names, weights)[0]


def _merely_large(data: Any) -> bool:
    """Whether a problem is large but of a size that may be solved: work, and nothing odd."""
    try:
        mesh = data["mesh"]
        cells = mesh["cells"] if isinstance(mesh["cells"], list) else [mesh["cells"]] * 3
        return bool(5e3 < math.prod(map(float, cells)) * 4.0 ** float(mesh.get("refine", 0)) < 1e9)
    except (KeyError, TypeError, ValueError, OverflowError, AttributeError):
        return False


def _at(data: Any, path: tuple[Any, ...]) -> Any:
    for key in path:
        data = data[key]
    return data


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
