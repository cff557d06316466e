"""Every door to a problem file asks whether the code of a law that it names is allowed."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

import hemivar as hv
from hemivar import cli
from hemivar.cli.app import COMMANDS
from hemivar.cli.command import OnProblem
from hemivar.errors import FileError, ProblemError
from hemivar.files.problem_file import parse_problem
from hemivar.identification import FitOptions, identify
from hemivar.identification.identifying import parameters_of_law
from hemivar.studio.jobs import Bench
from hemivar.studio.requests import Request

EXAMPLE = Path(__file__).parents[2] / "examples" / "own_law"
REFUSED = (
    "is code of your own, which runs when it is read; if you trust it, add --allow-code two_springs or --allow-code"
)
KEY = "contact.bottom.normal.first"
ALLOWED = ["./two_springs.py"]
#: What commands need beside the problem.
NEEDED = {
    "sweep": ["--set", f"{KEY}=10:20:2", "--starts", "0"],
    "identify": ["--data", "curve.csv", "--fit", f"{KEY}=5:20"],
    "animate": ["-o", "film.gif"],
}
TIME = '[time]\nuntil = 0.4\nstep = 0.1\nscheme = "implicit-euler"\ninertia = false\n'


@pytest.fixture(autouse=True)
def files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.chdir(tmp_path)
    text = (EXAMPLE / "two_springs.toml").read_text().replace("cells = [8, 8]", "cells = [2, 2]")
    Path("p.toml").write_text(text)
    Path("t.toml").write_text(text + TIME)
    Path("two_springs.py").write_text((EXAMPLE / "two_springs.py").read_text())
    Path("curve.csv").write_text("loads.traction.top.1,contact.bottom.force.y\n-0.2,0.2\n-0.4,0.4\n-0.8,0.8\n")
    yield
    sys.modules.pop("two_springs", None)


def test_the_example_solves_by_hand() -> None:
    """Between rollers every column presses by the load 0.4: 0.2 on the first spring, and 0.2 over 40 on both."""
    problem = hv.read_problem(EXAMPLE / "two_springs.toml", code=[str(EXAMPLE / "two_springs.py")])
    assert hv.solve(problem).penetration == pytest.approx(0.02 + 0.2 / 40.0, abs=1e-12)


DOORS = [name for name, kind in COMMANDS.items() if issubclass(kind, OnProblem) or name == "animate"]


@pytest.mark.parametrize("command", DOORS)
def test_every_command_asks(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main([command, "p.toml", *NEEDED.get(command, [])]) == 2
    assert REFUSED in capsys.readouterr().err
    assert "two_springs" not in sys.modules
    if command in ("sweep", "animate"):
        return
    given = {"data": Path("curve.csv")} if command == "identify" else {}
    own = COMMANDS[command](problem=Path("p.toml"), allow_code=ALLOWED, **given)  # type: ignore[call-arg]
    assert type(own.session.stated.problem.contact["bottom"].normal).__name__ == "TwoSprings"  # type: ignore[attr-defined]


def test_every_command_with_a_problem_has_the_option() -> None:
    assert {"solve", "certify", "solutions", "path", "bracket", "march", "compare", "study", "steps", "sweep",
            "identify", "animate"} == set(DOORS)  # fmt: skip
    assert "allow_code" in COMMANDS["studio"].__dataclass_fields__  # type: ignore[attr-defined]


def test_a_stored_solution_is_certified_with_the_same_permission(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["solve", "p.toml", "--allow-code", "./two_springs.py", "--json", "s.json", "--quiet"]) == 0
    assert "two_springs" not in Path("s.json").read_text()  # names no code
    capsys.readouterr()
    assert cli.main(["certify", "p.toml", "--solution", "s.json", "--no-exact"]) == 2
    assert REFUSED in capsys.readouterr().err
    assert (
        cli.main(["certify", "p.toml", "--solution", "s.json", "--no-exact", "--allow-code", "./two_springs.py"]) == 0
    )


def test_a_march_is_resumed_with_the_same_permission(capsys: pytest.CaptureFixture[str]) -> None:
    march = ["march", "t.toml", "--checkpoint", "t.ckpt", "--quiet"]
    assert cli.main([*march, "--until", "0.2", "--allow-code", "./two_springs.py"]) == 0
    capsys.readouterr()
    assert cli.main([*march, "--resume"]) == 2
    assert REFUSED in capsys.readouterr().err
    assert cli.main([*march, "--resume", "--allow-code", "./two_springs.py"]) == 0


def test_a_sweep_is_resumed_with_the_same_permission() -> None:
    axes = {KEY: [10.0, 20.0]}
    with pytest.raises(ProblemError, match=REFUSED):
        hv.sweep("p.toml", axes, checkpoint="s.jsonl", starts=0)
    Path("s.jsonl").unlink()
    first = hv.sweep("p.toml", axes, checkpoint="s.jsonl", starts=0, code=ALLOWED)
    assert hv.sweep("p.toml", axes, checkpoint="s.jsonl", starts=0, code=ALLOWED).points == first.points
    assert len(Path("s.jsonl").read_text().splitlines()) == 3
    Path("p.toml").write_text(Path("p.toml").read_text().replace("10.0", "11.0"))
    with pytest.raises(FileError, match="holds another sweep, or the problem has changed since"):
        hv.sweep("p.toml", axes, checkpoint="s.jsonl", starts=0, code=ALLOWED)


def test_a_study_reads_with_permission() -> None:
    with pytest.raises(ProblemError, match=REFUSED):
        hv.study("p.toml", 1)
    assert hv.study("p.toml", 1, code=ALLOWED).converged


@pytest.mark.slow
def test_other_processes_have_the_law_of_a_file(capsys: pytest.CaptureFixture[str]) -> None:
    alone = hv.study("p.toml", 2, code=ALLOWED)
    assert (hv.study("p.toml", 2, code=ALLOWED, jobs=2).errors("energy") == alone.errors("energy"))[:-1].all()
    sweep = ["sweep", "p.toml", "--set", f"{KEY}=10:20:40", "--starts", "2", "--jobs", "2"]
    assert cli.main([*sweep, "--allow-code", "./two_springs.py"]) == 0
    assert "without result" not in capsys.readouterr().out


def test_a_law_is_identified_with_permission() -> None:
    with pytest.raises(ProblemError, match=REFUSED):
        identify("p.toml", "curve.csv", {KEY: (5.0, 20.0)})
    with pytest.raises(ProblemError, match=REFUSED):
        parameters_of_law("p.toml", "two_springs:TwoSprings")
    fit = identify("p.toml", "curve.csv", {KEY: (5.0, 20.0)}, FitOptions(starts=1), code=ALLOWED)
    assert fit.measurements.count == 3
    (found,) = parameters_of_law("p.toml", "two_springs:TwoSprings", code=ALLOWED)
    assert (found.key, found.middle) == (KEY, 10.0)


def test_an_error_of_a_law_names_its_line(capsys: pytest.CaptureFixture[str]) -> None:
    law = Path("two_springs.py").read_text().replace("zero = np.zeros(1)", "zero = np.zeros(1) / (1 // 0)")
    Path("two_springs.py").write_text(law)
    line = 1 + law[: law.index("1 // 0")].count("\n")
    assert cli.main(["solve", "p.toml", "--allow-code", "./two_springs.py"]) == 2
    said = capsys.readouterr().err
    assert f"two_springs.py, line {line}: ZeroDivisionError: integer division or modulo by zero; correct this" in said


def test_a_law_is_shown_with_permission(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["laws", "two_springs:TwoSprings"]) == 2
    assert REFUSED in capsys.readouterr().err
    assert cli.main(["laws", "two_springs:TwoSprings", "--set", "first=5", "--allow-code", "./two_springs.py"]) == 0
    shown = capsys.readouterr().out
    assert "stiffness of the first spring [force/area/length], positive" in shown
    assert 'normal = { law = "two_springs:TwoSprings", first = ... }' in shown


def test_the_studio_follows_the_same_rule() -> None:
    text = Path("p.toml").read_text()

    def heads(bench: Bench) -> list[dict[str, object]]:
        return [message.head for message in bench.answer(Request("solve", 7, text), lambda: False)]  # type: ignore[arg-type]

    (error,) = heads(Bench(Path()))
    assert error["type"] == "error"
    assert REFUSED in str(error["message"])
    found = {str(head["type"]): head for head in heads(Bench(Path(), code=ALLOWED))}
    assert "error" not in found
    (slider,) = [one for one in found["problem"]["sliders"] if one["key"] == KEY]  # type: ignore[attr-defined]
    assert slider["meaning"] == "stiffness of the first spring (force/area/length)"


def test_the_laws_beside_a_page_stay_out_unless_allowed() -> None:
    """What stands in the folder of the problem is not found by its being there."""
    with pytest.raises(ProblemError, match=REFUSED):
        parse_problem(Path("p.toml").read_text(), Path())
    with pytest.raises(ProblemError, match="there is no module 'two_springs'; install it, or allow its file"):
        parse_problem(Path("p.toml").read_text(), Path(), code=["two_springs"])


def test_permission_is_kept_in_no_file() -> None:
    assert cli.main(["sweep", "p.toml", *NEEDED["sweep"], "--checkpoint", "s.jsonl", "--allow-code", *ALLOWED]) == 0
    assert "two_springs.py" not in json.dumps(Path("s.jsonl").read_text())
