"""What every command says and writes, written down, so that a change of the code behind can be held against it.

    python benchmarks/commands.py --write before.json            on the code as it stands
    python benchmarks/commands.py --compare before.json          after the change: exit code 1 if something differs
    python benchmarks/commands.py --write some.json --only study only the commands named

Each command runs with ``--help``, with inputs that are usual, with each of its options set to nonsense, and with files
that are wrong.  Standard output, standard error, the exit code, the names of the files that were written and, for
JSON, CSV and LaTeX, their content are recorded.  Clocks stand still, so that times are the same, but where several
processes work; what differs from one machine to the next is masked.
"""

from __future__ import annotations

import argparse
import contextlib
import difflib
import io
import json
import os
import re
import shutil
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

from typer.main import get_command

from hemivar.cli.app import app, main
from hemivar.files.sample import template

#: Values that most options do not take.
NONSENSE = ("nonsense", "-1")
#: Files whose content is recorded.
PLAIN = (".json", ".csv", ".tex", ".toml", ".jsonl")
#: What each command needs before an option that is nonsense.
FIRST = {
    "history": ["table.csv"],
    "animate": ["frames.pvd", "--output", "film.gif"],
    "identify": ["block.toml", "--data", "curve.csv", "--fit", "contact.bottom.normal.q_max=0.1:1", "--starts", "1"],
    "sweep": ["block.toml", "--set", "contact.bottom.normal.q_max=0.1:0.2:2", "--starts", "2"],
    "study": ["block.toml", "--refine", "1"],
    "steps": ["block.toml", "--until", "1", "--step", "0.5", "--refine", "1"],
    "survey": ["--max-n", "8", "--no-bounds"],
    "march": ["march.toml"],
    "new": [],
    "laws": ["survey"],
    "materials": ["hencky"],
    "methods": [],
    "doctor": [],
    "studio": ["no.toml"],
}
#: Options that would run for long, or open a page, whatever they are set to.
LEFT_OUT = {
    ("doctor", "--quick"),
    ("studio", "--browser"),
    ("survey", "--bounds"),
    ("survey", "--max-time"),
    ("survey", "--output"),
}
#: Usual calls, a word each of a file that is there.
USUAL = """
| methods | doctor --quick | nonsense | solve | --version | solve block.toml block.toml
new | new a.toml --template list | new a.toml --template nonsense | new block.toml | new block.toml --force
new here | new no/a.toml | new a.toml --template bounce
solve block.toml | solve block.toml -q --json a.json --vtu a.vtu --plot a.png --plot-contact b.png --colour stress
solve block.toml --method multigrid -v | solve block.toml --warm-start | solve flat.toml --method direct-powell
solve block.toml --max-steps 1 | solve block.toml --max-steps 1 -q --json a.json | solve block.toml --exact -q
solve block.toml --load-factor 0.5 -q | solve scalar.toml --plot a.png | solve cube.toml -q --plot a.png
solve scalar.toml --colour stress --plot a.png | solve scalar.toml --adaptive 0.1 | solve block.toml --method hidden
solve block.toml --adaptive 0.3 --csv a.csv --json a.json --vtu a.vtu --plot a.png --plot-error b.png --plot-meshes c.png
solve block.toml --adaptive 0.01 --max-unknowns 500 -q | solve block.toml --adaptive 0.3 --goal contact.bottom.force
solve block.toml --adaptive 0.3 --checkpoint a.ckpt | solve block.toml --adaptive 0.3 --engine petsc
solve block.toml --adaptive 0.3 --warm-start | solve block.toml --adaptive 2 | solve block.toml --goal a
solve block.toml --checkpoint a | solve block.toml --resume | solve block.toml --engine petsc --plot a.png
solve block.toml --json block.toml | solve block.toml --json a.json --vtu a.json | solve block.toml --plot no/a.png
solve block.toml --set contact.bottom.gap=0.1 | solve block.toml --set nothing=1 | solve block.toml --set nothing
solve block.toml --colour stress | solve free.toml | solve free.toml --plot-contact a.png | solve units.toml -q
solve loose.toml | solve wrong.toml | solve no.toml | solve here | solve march.toml
solve block.toml --render a.png
certify block.toml | certify block.toml --json a.json --no-exact | certify block.toml --solution solution.json
certify block.toml --solution no.json | certify block.toml --solution curve.csv | certify block.toml --exact
certify cube.toml --solution solution.json | certify block.toml --solution solution.json --json solution.json
certify scalar.toml | certify wrong.toml | certify loose.toml | certify units.toml --json a.json
solutions soft.toml --starts 8 --json a.json --plot a.png | solutions block.toml --starts 2 --plot a.svg --colour none
solutions scalar.toml --starts 2 | solutions wrong.toml | solutions loose.toml | solutions block.toml --colour stress
solutions soft.toml --starts 8 --max-solutions 1 | solutions units.toml --starts 1 --json a.json
path soft.toml --json a.json --plot a.png | path soft.toml --quantity max-opening | path block.toml --max-points 3
path block.toml --load-factor 0 2 --quantity normal-force --plot a.pdf | path scalar.toml | path wrong.toml
bracket soft.toml | bracket block.toml --upto 2 --json a.json --plot a.png --colour stress | bracket wrong.toml
bracket block.toml --colour stress | bracket scalar.toml
march march.toml | march march.toml --output out/a --json a.json --plot a.png --animation a.gif -q
march march.toml --table a.csv --fields a.pvd --checkpoint a.ckpt --minutes 0 | march block.toml
march march.toml --until 0.1 --step 0.01 --scheme generalized-alpha | march march.toml --until 0.1 --adaptive 0.01
march block.toml --until 1 --step 0.5 --rtol 1e-8 | march march.toml --resume | march march.toml --minutes 1
march march.toml --fields march.toml | march march.toml --table a.csv --fields a.csv | march wrong.toml
march march.toml --engine petsc | march march.toml --jump dynamic | march loose.toml --until 1 --step 1
history table.csv | history table.csv --columns time,nothing | history table.csv --columns normal_force
history table.csv --plot a.png | history table.csv --plot a.png --kind loop | history table.csv --plot table.csv
history table.csv --plot a.png --kind columns --columns normal_force --units s,mm,N | history curve.csv | history no.csv
history table.csv --units a,b,c,d,e,f | history table.csv --kind steps --columns time
animate frames.pvd --output a.gif --frames 3 --seconds 1 --colour speed | animate frames.pvd --output frames.pvd
animate march.toml --output a.gif --frames 3 --until 0.05 -q | animate frames.pvd --output a.gif --until 1
animate no.pvd --output a.gif | animate wrong.toml -o a.gif
compare flat.toml --json a.json --csv a.csv --max-time 5 | compare block.toml --methods newton,multigrid
compare block.toml --methods active-set-krylov --max-steps 2 | compare block.toml --methods newton --max-steps 1
compare wrong.toml | compare loose.toml | compare scalar.toml --methods newton,barrier | compare units.toml --methods newton
study block.toml --refine 2 --csv a.csv --latex a.tex --json a.json --plot a.png
study block.toml --refine 1 --coarser 2 --exact --checkpoint a.jsonl | study block.toml --coarser 9
study block.toml --refine 1 --known 0 --known 0 | study block.toml --refine 1 --known 0 | study scalar.toml --refine 1
study scalar.toml --refine 1 --exact | study block.toml --refine 1 --jobs 2 | study wrong.toml | study loose.toml
study block.toml --refine 1 --max-steps 1 | study block.toml --refine 0 | study units.toml --refine 1 --json a.json
study block.toml --refine 1 --checkpoint curve.csv | study block.toml --refine 1 --set contact.bottom.gap=0.1
steps march.toml --until 0.1 --step 0.02 --csv a.csv --latex a.tex --json a.json --plot a.png | steps block.toml
steps march.toml --known 0 --until 0.1 --step 0.05 | steps block.toml --until 1 --step 0.5 --refine 1 | steps wrong.toml
sweep block.toml --set contact.bottom.normal.q_max=0.1:0.4:3 --starts 2 --csv a.csv --latex a.tex --plot a.png
sweep block.toml --set contact.bottom.normal.q_max=0.1:0.4:3:log --set loads.factor=1 --starts 2
sweep block.toml --set contact.bottom.normal.q_max=-1:0.4:2 --set contact.bottom.gap=0.1 --starts 1 --checkpoint a.jsonl
sweep block.toml | sweep block.toml --set nothing=0:1:2 | sweep wrong.toml --set a=0:1:2
sweep block.toml --set contact.bottom.gap=-9:-8:2 --set contact.bottom.normal.q_max=0.1:0.4:2 --starts 1 --jobs 2
sweep block.toml --set contact.bottom.gap=0:1:2 --label a --label b | sweep no.toml --set a=0:1:2
sweep block.toml --set a=0:1:2 --set b=0:1:2 --set c=0:1:2 --plot a.png | sweep block.toml --set contact.bottom.gap=0:1:1
identify block.toml --data curve.csv --fit contact.bottom.normal.q_max=0.1:1 --starts 2 --csv a.csv --latex a.tex
identify block.toml --data curve.csv --law survey --contact bottom --starts 2 --json a.json --plot a.png --noise 0.01
identify block.toml --data curve.csv | identify block.toml --data no.csv --law survey | identify block.toml
identify block.toml --data curve.csv --law winkler | identify wrong.toml --data curve.csv --law survey
identify block.toml --data curve.csv --fit a | identify block.toml --data table.csv --law survey
survey --max-n 8 --output out | survey --max-n 9 | survey --output block.toml
laws | laws survey | laws softening --set stiffness=2 --plot a.png | laws tresca --friction | laws mixed-mode --plot a.png
laws --file law.csv --friction | laws nothing | laws survey --friction | laws --file law.csv --plot a.png | laws --formula r^2 --plot a.svg --reach 2
laws --formula r^2 --friction | laws survey --file law.csv | laws --plot a.png | laws survey --set a=1 | laws survey --set a
laws --file no.csv | laws --file law.csv --plot law.csv | laws table | laws formula | laws coulomb --friction
laws mode-dependent | laws survey --reach 0
materials | materials hencky --plot a.png | materials locking --set strain=0.1 | materials nothing
materials hencky --set a=1 | materials --plot a.png | materials hencky --reach 0
studio --template nothing | studio no.toml
"""  # noqa: E501


def files(folder: Path) -> None:
    """The files that the calls name."""
    sample = template("sample")
    small = sample.replace("cells = [32, 32]", "cells = [4, 4]")
    assert small != sample
    texts = {
        "block.toml": small,
        "flat.toml": small.replace("[4, 4]", "[2, 2]"),
        "soft.toml": re.sub(r"cells = \[.*?\]", "cells = [4, 4]", template("softening"), count=1),
        "scalar.toml": re.sub(r"cells = \[.*?\]", "cells = [6, 6]", template("membrane"), count=1),
        "cube.toml": re.sub(r"cells = \[.*?\]", "cells = [2, 2, 2]", template("cube"), count=1),
        "march.toml": re.sub(r"cells = \[.*?\]", "cells = [3, 3]", template("bounce"), count=1),
        "units.toml": f'{small}\n[units]\nlength = "mm"\nforce = "N"\nstress = "MPa"\n',
        "free.toml": small[: small.index("[contact.bottom]")],
        "loose.toml": small.replace('left = "clamped"', ""),
        "wrong.toml": small.replace("lame = [4.0, 4.0]", "lame = [4.0, -4.0]"),
        "curve.csv": "loads.body,normal_force\n-0.4,0.2\n-0.8,0.4\n",
        "law.csv": "r,derivative\n-1,0\n0,0\n1,2\n2,1\n",
    }
    for name, text in texts.items():
        (folder / name).write_text(text, encoding="utf-8")
    (folder / "here").mkdir()


def made(folder: Path) -> None:
    """The files that commands write and others read."""
    run(folder, ["solve", "block.toml", "--json", "solution.json"])
    run(folder, ["march", "march.toml", "--until", "0.1", "--fields", "frames.pvd", "--table", "table.csv"])


@contextlib.contextmanager
def clocks_stand_still() -> Iterator[None]:
    """Each look at a clock tells the same."""
    before = time.perf_counter, time.monotonic, time.process_time
    time.perf_counter = time.monotonic = time.process_time = lambda: 1000.0
    try:
        yield
    finally:
        time.perf_counter, time.monotonic, time.process_time = before


def masked(text: str, folder: Path) -> str:
    """A text without what differs from one machine or one minute to the next."""
    text = text.replace(str(folder), "FOLDER").replace(sys.executable, "PYTHON")
    text = re.sub(r"\b[0-9a-f]{8}(?=\.(study|sweep)\.jsonl)", "DIGEST", text)
    text = re.sub(r'"digest": "[0-9a-f]+"', '"digest": "DIGEST"', text)
    text = re.sub(r"[\d.]+ [KMGT]i?B\b", "N GiB", text)
    return re.sub(r"[\d.]+(e[-+]\d+)? s\b", "N s", text)


def run(folder: Path, words: list[str]) -> dict[str, object]:
    """What a call said and wrote; the files stay."""
    there = {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}
    out, err = io.StringIO(), io.StringIO()
    clocks = contextlib.nullcontext() if "--jobs" in words else clocks_stand_still()  # processes wait by them
    with clocks, contextlib.chdir(folder), contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            code: object = main(words)
        except SystemExit as end:
            code = f"exit {end.code}"
    written = {}
    for path in sorted(folder.rglob("*")):
        if path.is_file() and there.get(path) != path.read_bytes():
            plain = path.read_text(encoding="utf-8") if path.suffix in PLAIN else f"{path.stat().st_size > 0}"
            written[masked(str(path.relative_to(folder)), folder)] = masked(plain, folder)
    said, complained = masked(out.getvalue(), folder), masked(err.getvalue(), folder)
    if "--jobs" in words or words[:1] == ["doctor"]:  # which process is done first differs, and clocks go on
        said = "\n".join(sorted(said.splitlines()))
        written = dict.fromkeys(written, "")
    return {"code": code, "out": said, "err": complained, "files": written}


def calls() -> Iterator[list[str]]:
    """All calls."""
    for line in USUAL.strip().splitlines():
        yield from (call.split() for call in line.split("|"))
    for name, command in get_command(app).commands.items():  # type: ignore[attr-defined]
        yield [name, "--help"]
        for option in command.params:
            if option.param_type_name != "option" or (name, option.opts[0]) in LEFT_OUT or option.opts[0] == "--help":
                continue
            values: list[list[str]] = [[]] if option.is_flag else [[text] for text in NONSENSE]
            if name in ("survey", "studio", "new", "doctor"):
                values = values[:1]
            yield from ([name, *FIRST.get(name, ["block.toml"]), option.opts[0], *value] for value in values)


def recorded(only: list[str]) -> dict[str, dict[str, object]]:
    """Every call, each in a folder of its own."""
    found = {}
    with tempfile.TemporaryDirectory() as place:
        begin = Path(place) / "begin"
        begin.mkdir()
        files(begin)
        made(begin)
        for words in calls():
            if only and (not words or words[0] not in only):
                continue
            folder = Path(place) / "now"
            sys.stderr.write(f"{os.times().user:7.1f} s  hemivar {' '.join(words)}\n")
            shutil.copytree(begin, folder)
            found[" ".join(words)] = run(folder, words)
            shutil.rmtree(folder)
    return found


def differences(before: dict[str, dict[str, object]], now: dict[str, dict[str, object]]) -> Iterator[str]:
    """What differs, a call at a time."""
    for call, was in before.items():
        if call not in now:
            yield f"{call}: it was not run"
        elif now[call] != was:
            one, other = (json.dumps(record, indent=1).replace("\\n", "\n").splitlines() for record in (was, now[call]))
            yield "\n".join([f"hemivar {call}", *difflib.unified_diff(one, other, "before", "now", lineterm="", n=0)])


def command_line() -> int:
    """Write or compare."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--write", type=Path)
    parser.add_argument("--compare", type=Path)
    parser.add_argument("--only", nargs="*", default=[])
    asked = parser.parse_args()
    os.environ.update(COLUMNS="100", TERMINAL_WIDTH="100", MPLBACKEND="agg", OMP_NUM_THREADS="1")
    now = recorded(asked.only)
    if asked.write is not None:
        asked.write.write_text(json.dumps(now, indent=1), encoding="utf-8")
    if asked.compare is None:
        return 0
    before = json.loads(asked.compare.read_text(encoding="utf-8"))
    if asked.only:
        before = {call: was for call, was in before.items() if call.split(" ")[0] in asked.only}
    found = list(differences(before, json.loads(json.dumps(now))))
    print("\n\n".join([*found, f"{len(found)} of {len(before)} calls differ"]))
    return int(bool(found))


if __name__ == "__main__":
    raise SystemExit(command_line())
