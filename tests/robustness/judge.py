"""What a run is counted as, and the table of many."""

from __future__ import annotations

import hashlib
import json
import re
import shutil
import tomllib
import traceback
from collections import Counter
from collections.abc import Iterable
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

from tests.robustness.case import CANARY, Case, lay_out
from tests.robustness.limited import LIMITS, Limits, Run, run_case

if TYPE_CHECKING:
    from tests.robustness.oracle import Verdict

__all__ = ["FAULTS", "Outcome", "judge", "run_and_judge", "table"]

#: What must not happen, the worst first.
FAULTS = (
    "code run", "input destroyed", "wrong acceptance", "traceback", "crash", "hang", "memory", "warnings",
    "terminal escapes", "untidy",
    "oracle failed",
)  # fmt: skip
#: What may.
_GOOD = ("clean error", "accepted, examined", "accepted, not examined", "not converged", "interrupted")

_CONTROL = re.compile(rb"[\x00-\x08\x0b-\x1f\x7f]|\xc2[\x80-\x9f]|\xe2\x80[\xaa-\xae]")
#: What Python says where a program stumbles, which is no sentence for users.
_PYTHON = re.compile(
    rb"index out of range|out of bounds|object has no attribute|object is not|could not convert|invalid literal|"
    rb"values to unpack|NoneType|cannot reshape|broadcast together|must be str|dtype|KeyError|b'"
)
_OUT_OF_MEMORY = re.compile(
    rb"not enough memory|MemoryError|Unable to allocate|Memory allocation|std::bad_alloc|out of memory", re.I
)


@dataclass
class Outcome:
    """What became of a case.

    Attributes
    ----------
    name, family, note : str
        Of the case.
    verdict : str
        One of :data:`FAULTS`, or of the harmless ends.
    faults : dict of fault to detail
        All of them.
    seconds : float
        Of processor time.
    peak : int
        Bytes.
    examined, left_out : list of str
        What the oracle did.
    message : str
        The end of standard error.
    """

    name: str
    family: str
    note: str
    verdict: str = ""
    faults: dict[str, str] = field(default_factory=dict)
    seconds: float = 0.0
    peak: int = 0
    examined: list[str] = field(default_factory=list)
    left_out: list[str] = field(default_factory=list)
    message: str = ""


def _prints(folder: Path, names: Iterable[str]) -> dict[str, str]:
    found = {}
    for name in names:
        path = folder / name
        found[name] = hashlib.sha256(path.read_bytes()).hexdigest() if path.is_file() else "gone"
    return found


def run_and_judge(case: Case, folder: Path, limits: Limits = LIMITS) -> Outcome:
    """Run a case in a folder and judge it; the folder is left as the run leaves it."""
    shutil.rmtree(folder, ignore_errors=True)
    lay_out(case, folder)
    before = _prints(folder, set(case.files) - set(case.rewritten))
    run = run_case(case, folder, limits)
    outcome = judge(case, folder, run, before)
    (folder.parent / f"{folder.name}.log").write_bytes(
        b"---- standard output\n"
        + run.stdout
        + b"\n---- standard error\n"
        + run.stderr
        + b"\n---- stack\n"
        + run.stack.encode()
    )
    return outcome


def judge(case: Case, folder: Path, run: Run, before: dict[str, str] | None = None) -> Outcome:
    """What a run is counted as."""
    outcome = Outcome(case.name, case.family, case.note, seconds=run.seconds, peak=run.peak)
    outcome.message = run.stderr.decode("utf-8", "replace").strip()[-300:]
    faults = outcome.faults
    overwritten = case.arguments[:1] == ["new"] and "--force" in case.arguments
    if (folder / CANARY).exists():
        faults["code run"] = "a formula or a name ran code"
    if before is not None and not overwritten:
        changed = [name for name, print_ in _prints(folder, before).items() if print_ != before[name]]
        if changed:
            faults["input destroyed"] = ", ".join(changed)
    text = run.stdout + run.stderr
    if b"Traceback (most recent call last)" in run.stderr.replace(case.note.encode("utf-8", "replace"), b""):
        lines = run.stderr.decode("utf-8", "replace").strip().splitlines()
        places = [line.strip() for line in lines if "/hemivar/" in line and line.strip().startswith("File")]
        last = [line for line in lines if not line.startswith("hemivar: ")] or lines
        kind = "memory" if _OUT_OF_MEMORY.search(last[-1].encode()) else "traceback"
        faults[kind] = f"{last[-1][:160]} | {places[-1][-90:] if places else ''}"
    elif run.code == 70 or b"internal error" in run.stderr:
        faults["traceback"] = outcome.message[-200:]
    if run.hung:
        place = [line.strip() for line in run.stack.splitlines() if "/hemivar/" in line]
        faults["hang"] = f"{run.seconds:.0f} s of work; {' < '.join(p[-70:] for p in place[:2])}"
    elif run.signal is not None:
        place = [line.strip() for line in run.stack.splitlines() if "/hemivar/" in line]
        faults["crash"] = f"signal {run.signal} {place[0][-70:] if place else ''}"
    if _OUT_OF_MEMORY.search(text) and not run.hung and run.code != 0:
        faults.setdefault("memory", outcome.message[-160:])
    elif run.peak > 0.8 * LIMITS.memory:
        faults["memory"] = f"{run.peak >> 20} MiB were taken"
    warned = re.search(rb"^.*\b\w*Warning: .*$", run.stderr, re.M)
    if warned and "traceback" not in faults:
        faults["warnings"] = warned.group().decode("utf-8", "replace")[-200:]
    spoken = _PYTHON.search(run.stderr)
    if spoken and "traceback" not in faults:
        faults["untidy"] = f"words of Python: {spoken.group().decode()}"
    escape = _CONTROL.search(text)
    if escape and "/dev/stdout" not in case.arguments:
        faults["terminal escapes"] = repr(text[max(escape.start() - 20, 0) : escape.end() + 20])
    problem = _untidy(case, folder, run)
    if problem and not {"traceback", "hang", "crash", "memory", "warnings"} & set(faults):
        faults["untidy"] = problem
    if run.code == 0 and not faults:
        try:
            _ask_the_oracle(case, folder, outcome)
        except Exception:
            faults["oracle failed"] = traceback.format_exc()[-600:]
    outcome.verdict = next((fault for fault in FAULTS if fault in faults), "") or _harmless(run, outcome)
    return outcome


def _harmless(run: Run, outcome: Outcome) -> str:
    if run.code == 0:
        return (
            "accepted, examined"
            if "laws" in outcome.examined or "certified" in outcome.examined
            else "accepted, not examined"
        )
    return {1: "not converged", 2: "clean error"}.get(run.code or 0, "interrupted")


def _untidy(case: Case, folder: Path, run: Run) -> str:
    """What is wrong with exit code, messages and files."""
    lines = run.stderr.decode("utf-8", "replace").splitlines()
    if "MPLCONFIGDIR" in case.environment:  # matplotlib says itself that it looks for another place
        lines = [line for line in lines if "MPLCONFIGDIR" not in line and "mkdir -p failed" not in line]
    unwritten = re.compile("hemivar: error: (--|standard output|.*cannot write)")
    if len(lines) > 1 and run.code in (1, 2) and any(map(unwritten.match, lines)):
        # every output that failed has its line
        lines = [line for line in lines if not unwritten.match(line)] or lines[-1:]
    if run.code == 2:
        if len(lines) != 1 or not lines[0].startswith("hemivar: error: "):
            return f"{len(lines)} lines with exit code 2: {lines[:2]}"
        if lines[0].rstrip().endswith(":") or len(lines[0]) < 30:
            return f"a message that says nothing: {lines[0]}"
        if len(lines[0]) > 1500:
            return f"a message of {len(lines[0])} characters"
    elif run.code == 1:
        if len(lines) > 1 or (lines and not lines[0].startswith("hemivar: ")):
            return f"{len(lines)} lines with exit code 1: {lines[:2]}"
    elif run.code == 0:
        if lines:
            return f"exit code 0, but: {lines[:2]}"
    elif run.code is not None and not (run.code in (130, 141, 143) and case.streams != "file"):
        return f"exit code {run.code}: {lines[:2]}"
    known = {Path(name).parts[0] for name in (*case.files, *case.special) if Path(name).parts}
    known |= {what.partition(" ")[2] for what in case.special.values() if what.startswith("link ")}
    words = " ".join(case.arguments)
    strange = []
    for path in folder.iterdir():
        stem = path.name.removesuffix("_contact.vtu").removesuffix("_contact.pvd")
        stem = stem.rpartition(".")[0] or stem
        if path.name not in (*known, "problem.toml", "survey-output") and stem not in words:
            strange.append(path.name)
    return f"files left behind: {strange}" if strange else ""


def _ask_the_oracle(case: Case, folder: Path, outcome: Outcome) -> None:
    from tests.robustness.kept import examine_kept
    from tests.robustness.moving import examine_march
    from tests.robustness.oracle import Verdict, examine, examine_many, examine_record

    if case.family == "kept":
        verdict = Verdict()
        examine_kept(folder, case, verdict)
        outcome.examined = ["certified"] if "expected" in case.files else []
        outcome.left_out = verdict.left_out
        if verdict.wrong:
            outcome.faults["wrong acceptance"] = "; ".join(verdict.wrong)[:600]
        return
    if case.problem is None or case.answer is None or "--help" in case.arguments:
        return
    verdict = Verdict()
    kind = case.arguments[0]
    answer = folder / case.answer
    if kind == "solve":
        examine(folder, case.problem, case.answer, "solve.vtu", _tolerance(case, folder), verdict)
    elif kind == "certify":
        _mesh_of(case, folder)
        record = json.loads(answer.read_text(encoding="utf-8"))
        given = "given.json" if "--solution" in case.arguments else None
        if given and record["fulfilled"]:
            stated = json.loads((folder / given).read_text(encoding="utf-8-sig"))
            contact = stated.get("contact")
            if isinstance(contact, dict) and contact.get("pressure") is not None and (folder / "mesh.vtu").exists():
                # places, normals and gaps are those of the problem; a file need not repeat them
                fresh = json.loads((folder / "mesh.json").read_text(encoding="utf-8"))
                moved = {**fresh["contact"], "pressure": contact["pressure"], "friction": contact.get("friction")}
                moved |= _local(fresh, stated)
                shown = {"displacement": stated["displacement"], "contact": moved}
                examine_record(folder, case.problem, shown, "mesh.vtu", 1e-8, verdict)
                verdict.examined.append("certified")
    elif kind == "solutions":
        mesh = _mesh_of(case, folder)
        verdict = examine_many(folder, case.problem, case.answer, mesh, "mesh.json")
    elif kind == "march":
        examine_march(folder, case.problem, case.answer, "run.pvd", verdict)
    elif kind == "compare":
        _compared(json.loads(answer.read_text(encoding="utf-8")), folder / case.problem, verdict)
    elif kind == "path":
        record = json.loads(answer.read_text(encoding="utf-8"))
        numbers = [p[key] for p in record["points"] for key in ("load_factor", "normal_force", "max_penetration")]
        verdict.demand(all(isinstance(x, float | int) for x in numbers), "the path holds an entry that is not a number")
    outcome.examined, outcome.left_out = verdict.examined, verdict.left_out
    if verdict.wrong:
        outcome.faults["wrong acceptance"] = "; ".join(verdict.wrong)[:600]


def _local(fresh: dict, stated: dict) -> dict:
    """Penetration and slip of a displacement at contact points that are nodes, from those of another displacement."""
    import numpy as np

    contact = fresh["contact"]
    moved = np.array(stated["displacement"], dtype=float) - np.array(fresh["displacement"], dtype=float)
    if not np.abs(moved).max() > 0.0:
        return {}
    # the displacement differs: penetration is that of the fresh solution and the change along the normal
    x = np.array(contact["x"])
    import meshio

    grid = meshio.read(Path(fresh["_folder"]) / "mesh.vtu")
    nodes = grid.points[:, : x.shape[1]]
    where = np.array([int(np.abs(nodes - p).max(axis=1).argmin()) for p in x])
    normal = np.array(contact["normal"])
    shift = np.einsum("kd,kd->k", normal, moved[where])
    found = {"penetration": (np.array(contact["penetration"]) + shift).tolist()}
    if x.shape[1] == 2:
        tangent = np.column_stack([-normal[:, 1], normal[:, 0]])
        found["slip"] = (np.array(contact["slip"]) + np.einsum("kd,kd->k", tangent, moved[where])).tolist()
    return found


def _mesh_of(case: Case, folder: Path) -> str | None:
    """A VTU file of the same problem, from a solve in a process of its own."""
    words = ["solve", str(case.problem), "--json", "mesh.json", "--vtu", "mesh.vtu", "--max-time", "5"]
    run_case(replace(case, arguments=words), folder)
    path = folder / "mesh.json"
    if path.exists():
        record = json.loads(path.read_text(encoding="utf-8"))
        path.write_text(json.dumps({**record, "_folder": str(folder)}), encoding="utf-8")
    return "mesh.vtu" if (folder / "mesh.vtu").exists() else None


_CONVEX = {
    "survey", "signorini", "compliance", "bilateral", "finite-penetration", "barton-bandis", "none", "bolt", "tresca",
}  # fmt: skip


def _compared(record: dict, problem: Path, verdict: Verdict) -> None:
    """Methods that converged agree where the energy is convex."""
    data = tomllib.loads(problem.read_text(encoding="utf-8-sig"))
    laws = []
    for one in data.get("contact", {}).values():
        for key in ("normal", "friction"):
            law = one.get(key, "none")
            bound = law.get("bound") if isinstance(law, dict) else None
            laws.append("state" if isinstance(bound, dict) else law if isinstance(law, str) else law["law"])
    converged = [m for m in record["methods"] if m["status"] == "converged"]
    if set(laws) <= _CONVEX:
        for method in converged:
            difference = method["difference"]
            fine = isinstance(difference, float | int) and difference <= 1e-4
            verdict.demand(fine, f"{method['method']} converged {difference} away from {record['reference']}")
    failed = [m for m in record["methods"] if m["status"] == "failed"]
    verdict.demand(not failed, f"{[(m['method'], m['note'][:80]) for m in failed]}")


def _tolerance(case: Case, folder: Path) -> float:
    """The tolerance that the command line or the problem file ask for."""
    words = list(case.arguments)
    if "bundle" in words:  # which may certify its error instead (docs/theory/inequality.md)
        return 1e-6
    if "--rtol" in words:
        return float(words[words.index("--rtol") + 1])
    try:
        data = tomllib.loads((folder / str(case.problem)).read_text(encoding="utf-8-sig"))
        return float(data.get("solver", {}).get("rtol", 1e-9))
    except (OSError, ValueError, TypeError, AttributeError):
        return 1e-9


def table(outcomes: list[Outcome]) -> str:
    """Counts of verdicts by family, as text."""
    families = sorted({o.family for o in outcomes})
    columns = [*_GOOD, *FAULTS]
    counts = {family: Counter(o.verdict for o in outcomes if o.family == family) for family in families}
    total = Counter(o.verdict for o in outcomes)
    shown = [c for c in columns if total[c] or c in FAULTS]
    width = max(len(f) for f in [*families, "all"])
    lines = [f"{'':{width}}  {'cases':>6}  " + "  ".join(shown)]
    for family in [*families, "all"]:
        row = total if family == "all" else counts[family]
        cells = "  ".join(f"{row[c]:>{len(c)}}" for c in shown)
        lines.append(f"{family:{width}}  {sum(row.values()):>6}  {cells}")
    return "\n".join(lines)


def as_record(outcome: Outcome) -> dict:
    """Plain data of an outcome."""
    return asdict(outcome)
