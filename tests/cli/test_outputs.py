"""Outputs of the command: tried first, kept off inputs, written as far as possible; hostile files and terminals."""

from __future__ import annotations

import contextlib
import io
import json
import os
import signal
import subprocess
import sys
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from hemivar import cli
from hemivar.cli import main, terminal
from hemivar.cli.outputs import Writer
from hemivar.cli.session import Session
from hemivar.errors import FileError, ProblemError
from hemivar.workflows import comparison
from tests.problem_files import block_file
from tests.samples import slow

PROBLEM = block_file(
    2, normal='{ law = "table", file = "law.csv" }', friction='{ law = "tresca", bound = { table = "bound.csv" } }'
)
GMSH = """\
$MeshFormat
2.2 0 8
$EndMeshFormat
$PhysicalNames
2
1 1 "left"
1 2 "bottom"
$EndPhysicalNames
$Nodes
4
1 0 0 0
2 1 0 0
3 1 1 0
4 0 1 0
$EndNodes
$Elements
4
1 1 2 1 1 4 1
2 1 2 2 2 1 2
3 2 2 3 3 1 2 3
4 2 2 3 3 1 3 4
$EndElements
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    (tmp_path / "p.toml").write_text(PROBLEM)
    (tmp_path / "law.csv").write_text("r,derivative\n0,0\n1,10\n")
    (tmp_path / "bound.csv").write_text("0,0\n1,1\n")
    (tmp_path / "part.msh").write_text(GMSH)
    (tmp_path / "m.toml").write_text(
        PROBLEM.replace("rectangle = [1.0, 1.0]\ncells = [2, 2]", 'file = "part.msh"\nrefine = 2')
    )
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("HEMIVAR_TRACEBACK", raising=False)
    return tmp_path


def run(capsys: pytest.CaptureFixture[str], *arguments: object) -> tuple[int, str, str]:
    code = cli.main([str(argument) for argument in arguments])
    captured = capsys.readouterr()
    return code, captured.out, captured.err


def in_process(*arguments: str | bytes, cwd: Path, **options: Any) -> subprocess.CompletedProcess[str]:
    source = str(Path(cli.__file__).parents[2])
    env = {**os.environ, "PYTHONPATH": source, **options.pop("env", {})}
    return subprocess.run(
        [sys.executable, "-m", "hemivar", *arguments],
        cwd=cwd, env=env, capture_output=True, text=True, errors="replace", timeout=120, check=False, **options,
    )  # fmt: skip


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir() if path.is_file()}


# ---- before the work -----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("arguments", "read"),
    [
        (["compare", "p.toml", "--csv", "law.csv"], "law.csv"),
        (["compare", "p.toml", "--csv", "bound.csv"], "bound.csv"),
        (["compare", "p.toml", "--csv", "link.csv"], "law.csv"),
        (["compare", "p.toml", "--csv", "../{folder}/./law.csv"], "law.csv"),
        (["certify", "p.toml", "--solution", "s.json", "--json", "s.json"], "s.json"),
        (["certify", "p.toml", "--solution", "s.json", "--json", "same.json"], "s.json"),
        (["solve", "v.toml", "--vtu", "body.vtu"], "body.vtu"),
        (["solve", "w.toml", "--vtu", "b.vtu"], "b_contact.vtu"),
        (["laws", "--file", "law.png", "--plot", "law.png"], "law.png"),
        (["laws", "--set", "file=law.png", "table", "--plot", "law.png"], "law.png"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_no_input_is_overwritten(
    arguments: list[str], read: str, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    import meshio

    assert run(capsys, "solve", "p.toml", "--json", "s.json")[0] == 0
    os.link("s.json", "same.json")
    (folder / "link.csv").symlink_to("law.csv")
    (folder / "law.png").write_bytes((folder / "law.csv").read_bytes())
    square = meshio.Mesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], {"triangle": [[0, 1, 2], [0, 2, 3]]})
    for name, problem in (("body.vtu", "v.toml"), ("b_contact.vtu", "w.toml")):
        square.write(name, file_format="vtu")
        (folder / problem).write_text(f'[mesh]\nfile = "{name}"\n[material]\nlame = [4.0, 4.0]\n')
    before = contents(folder)
    code, out, err = run(capsys, *(a.replace("{folder}", folder.name) for a in arguments))
    assert code == 2
    assert err.count("\n") == 1
    assert f"{read} was read for this problem" in err or "this is the problem file already" in err
    assert "converged" not in out
    assert contents(folder) == before


def test_the_mesh_of_a_problem_is_noted(folder: Path) -> None:
    from hemivar.basics.disk import noting_files_read
    from hemivar.files.problem_file import read_problem_file

    with noting_files_read() as files:
        read_problem_file("m.toml")
    assert {"m.toml", "part.msh", "law.csv", "bound.csv"} <= {file.name for file in files}


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["solve", "p.toml", "--vtu", "."], ["--vtu .", "must end in .vtu"]),
        (["solve", "p.toml", "--plot", "."], ["--plot .", "must end in"]),
        (["solve", "p.toml", "--vtu", "a.vtu"], ["--vtu a_contact.vtu", "this is a folder"]),
        (["solve", "p.toml", "--json", 300 * "a" + ".json"], ["--json", "too long"]),
        (["solve", "p.toml", "--json", "a\0.json"], ["--json", "null byte"]),
        (["solve", "p.toml", "--json", "a\0/b.json"], ["--json", "null byte"]),
        (["solve", "p.toml", "--json", 300 * "a" + "/b.json"], ["--json", "does not exist"]),
        (["survey", "--output", 300 * "a"], ["--output", "too long"]),
        (["solve", "p.toml", "--json", "loop.json"], ["--json", "loop.json", "symbolic links"]),
        (["solve", "p.toml", "--json", "pipe.json"], ["--json", "pipe.json", "it is a pipe"]),
        (["solve", "p.toml", "--plot", "x.png", "--plot-contact", "./x.png"], ["this is --plot already"]),
        (["solve", "loop.json"], ["loop.json", "symbolic links"]),
        (["solve", "a\0b"], ["null byte"]),
        (["solve", "pipe.json"], ["pipe.json", "not a regular file"]),
        (["certify", "p.toml", "--solution", "pipe.json"], ["--solution pipe.json"]),
        (["survey", "--output", "results"], ["--output", "figure3.csv", "it is a directory"]),
        (["survey", "--output", "a\0b"], ["--output", "null byte"]),
        (["survey", "--max-n", "2048"], ["--max-n is 2048", "at most 1024"]),
        (["solve", "p.toml", "--rtol", "1e10"], ["--rtol is 1e+10", "at most 0.01"]),
        (["solve", "p.toml", "--rtol", "inf"], ["--rtol is inf"]),
        (["certify", "p.toml", "--rtol", "1"], ["--rtol is 1", "at most 0.01"]),
        (["solve", "p.toml", "--max-time", "nan"], ["--max-time is nan"]),
        (["solve", "p.toml", "--max-steps", "99999999999999999999"], ["--max-steps", "at most"]),
        (["solutions", "p.toml", "--starts", "99999999999"], ["--starts"]),
        (["path", "p.toml", "--load-factor", "0", "nan"], ["--load-factor is nan"]),
        (["path", "p.toml", "--load-factor", "0", "1e300"], ["--load-factor is 1e+300"]),
        (["laws", "signorini", "--reach", "1e308"], ["--reach is 1e+308"]),
    ],
    ids=lambda value: " ".join(value)[:40].replace("\0", "0"),
)
def test_what_cannot_be_is_refused_before_the_work(
    arguments: list[str], words: list[str], folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (folder / "a_contact.vtu").mkdir()
    (folder / "results" / "figure3.csv").mkdir(parents=True)
    (folder / "loop.json").symlink_to("loop.json")
    os.mkfifo(folder / "pipe.json")
    before = sorted(folder.rglob("*"))
    code, out, err = run(capsys, *arguments)
    assert code == 2
    assert err.startswith("hemivar: error: ")
    assert err.count("\n") == 1
    for word in words:
        assert word in err
    assert "method" not in out
    assert sorted(folder.rglob("*")) == before


def test_a_senseless_tolerance_in_the_file_is_refused(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (folder / "p.toml").write_text(PROBLEM + "[solver]\nrtol = 1e10\n")
    code, _, err = run(capsys, "solve", "p.toml")
    assert code == 2
    assert "p.toml: [solver] rtol is 1e+10" in err


def test_a_certificate_holds_to_the_tolerance_of_the_solve(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """What is called converged is not called 'not stationary' below."""
    code, out, _ = run(capsys, "solve", "p.toml", "--method", "direct-lbfgs", "--rtol", "1e-3", "--json", "s.json")
    record = json.loads((folder / "s.json").read_text())
    assert record["residual"] > 1e-8  # or this shows nothing
    assert (code, record["status"]) == (0, "converged")
    assert "not stationary" not in out


# ---- writing -------------------------------------------------------------------------------------------------


def _failing(error: BaseException) -> Callable[[Path], object]:
    def write(_: Path) -> object:
        raise error

    return write


def test_a_writer_goes_on_and_complains_in_the_end(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    writer = Writer([folder / "law.csv"])
    writer.write("--json", Path("a.json"), _failing(ProblemError("no such thing")))
    writer.write("--vtu", Path("a.vtu"), _failing(ZeroDivisionError("by zero")))
    writer.write("--plot", Path("a.png"), _failing(MemoryError()), picture=True)
    writer.write("--csv", Path("law.csv"), lambda path: path.write_text("gone"))
    writer.write("--csv", Path("b.csv"), lambda path: path.write_text("there"))
    writer.write("--csv", None, _failing(ZeroDivisionError()))
    assert writer.written == [Path("b.csv")]
    assert writer.complain()
    assert writer.complain()
    lines = capsys.readouterr().err.splitlines()
    assert lines == [
        "hemivar: error: --json a.json: no such thing",
        "hemivar: error: --vtu a.vtu: internal error: ZeroDivisionError: by zero; please report it, "
        "HEMIVAR_TRACEBACK=1 shows where",
        "hemivar: error: --plot a.png: not enough memory to write it",
        f"hemivar: error: --csv law.csv: {folder / 'law.csv'} was read for this problem; name another file",
    ]


def test_what_processes_write_together_fails_on_all_of_them_or_ends_them() -> None:
    """A file that one of them alone cannot write would let the others wait for ever."""
    writer = Writer(together=("--vtu",))
    of_all = FileError("the disk is full")
    of_all.shared = True  # type: ignore[attr-defined]
    writer.write("--vtu", Path("a.vtu"), _failing(of_all))
    writer.write("--json", Path("a.json"), _failing(FileError("the disk is full")))
    assert writer.failed == ["--vtu: the disk is full", "--json: the disk is full"]
    for error in (FileError("the disk of one is full"), MemoryError(), ZeroDivisionError()):
        with pytest.raises(type(error)):
            writer.write("--vtu", Path("a.vtu"), _failing(error))


def test_one_voice_is_heard_and_by_no_terminal(capsys: pytest.CaptureFixture[str]) -> None:
    class Terminal(io.StringIO):
        def isatty(self) -> bool:
            return True

    under = Terminal()
    with contextlib.redirect_stdout(terminal.Stream(under)):
        for speaks in (True, False):
            with terminal.one_voice(speaks):
                print(f"speaks: {speaks}")
                print(f"complains: {speaks}", file=sys.stderr)
                assert not sys.stdout.isatty()
                assert not getattr(sys.stdout, "rich_proxied_file").isatty()  # noqa: B009
        assert sys.stdout.isatty()
    assert under.getvalue() == "speaks: True\n"
    assert capsys.readouterr().err == "complains: True\n"


def test_ctrl_c_leaves_out_pictures_but_no_data() -> None:
    writer = Writer()
    done: list[str] = []
    writer.write("--plot", Path("a.png"), _failing(KeyboardInterrupt()), picture=True)
    writer.write("--plot", Path("b.png"), lambda _: done.append("picture"), picture=True)
    writer.write("--json", Path("a.json"), lambda _: done.append("data"))
    assert done == ["data"]
    assert writer.interrupted
    with pytest.raises(KeyboardInterrupt):
        writer.write("--json", Path("b.json"), _failing(KeyboardInterrupt()))


@pytest.mark.parametrize(
    ("arguments", "kept"),
    [
        (["compare", "p.toml", "--methods", "newton", "--csv", "full.csv", "--json", "a.json"], "a.json"),
        (["path", "q.toml", "--json", "full.json", "--plot", "a.svg"], "a.svg"),
        (["solve", "p.toml", "--json", "full.json", "--vtu", "a.vtu"], "a.vtu"),
        (["certify", "p.toml", "--json", "full.json"], None),
        (["solutions", "q.toml", "--json", "full.json", "--starts", "2"], None),
        (["laws", "signorini", "--plot", "full.svg"], None),
        (["new", "full.toml", "--force"], None),
    ],
    ids=lambda value: value[0] if isinstance(value, list) else "",
)
def test_an_output_on_a_full_disk_is_one_line_and_the_others_are_written(
    arguments: list[str], kept: str | None, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (folder / "q.toml").write_text(PROBLEM[: PROBLEM.index("friction")])
    for suffix in ("csv", "json", "svg", "toml"):
        (folder / f"full.{suffix}").symlink_to("/dev/full")
    code, _, err = run(capsys, *arguments)
    assert code == 2
    assert err.count("\n") == 1
    assert "cannot write full." in err
    assert "no space left on device" in err
    assert kept is None or (folder / kept).stat().st_size > 0


def test_the_survey_goes_on_without_a_file(tmp_path: Path) -> None:
    from hemivar.report.tables import Table
    from hemivar.survey import SurveyOptions
    from hemivar.survey.survey_report import SurveyReport

    (tmp_path / "runs.csv").mkdir()
    run = SurveyReport(tmp_path, SurveyOptions())
    run.write(Table(("a",), ((1,),)), "runs.csv")
    run.write(Table(("a",), ((1,),)), "errors.csv")
    run.page()
    assert [file.name for file in run.files] == ["errors.csv", "report.html"]
    assert [text.split("; ")[0] for text in run.failed.values()] == [
        f"cannot write {tmp_path / 'runs.csv'}: it is a directory"
    ]


def test_a_comparison_that_is_interrupted_between_two_methods_keeps_its_table(
    folder: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    original = comparison.attempt

    def second_fails(name: str, *rest: Any) -> Any:
        if name != "newton":
            raise KeyboardInterrupt
        return original(name, *rest)

    monkeypatch.setattr(comparison, "attempt", second_fails)
    code, _, err = run(capsys, "compare", "p.toml", "--methods", "newton,active-set", "--json", "a.json")
    assert (code, err) == (130, "hemivar: interrupted\n")
    assert [row["method"] for row in json.loads((folder / "a.json").read_text())["methods"]] == ["newton"]


# ---- hostile files -------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("record", "words"),
    [
        ("[" * 100_000, "is not JSON"),
        ('{"displacement": ' + "[" * 100_000, "is not JSON"),
        ('{"displacement": ' + 60 * "[" + "1" + 60 * "]" + "}", "another mesh"),
        ('{"displacement": ' + 80 * "[" + "1" + 80 * "]" + "}", "not an array of numbers"),
        ('{"displacement": 1' + "0" * 5000 + "}", "is not JSON"),
        ('{"displacement": 1' + "0" * 400 + "}", "not an array of numbers"),
        ('{"displacement": [["0.0", "0.0"]]}', "not an array of numbers"),
        ('{"displacement": true}', "not an array of numbers"),
        ('{"displacement": {"a": 1}}', "not an array of numbers"),
        ('{"displacement": [[1, 2], [3]]}', "not an array of numbers"),
        ('{"displacement": "abc"}', "not an array of numbers"),
        ('{"displacement": [[1e400, 0]]}', "not finite"),
        ('{"displacement": []}', "another mesh"),
        ("3", "holds no record"),
        ("\x00", "is not JSON"),
        ('{"displacement": ZEROS, "contact": {"pressure": "a"}}', "not an array of numbers"),
        ('{"displacement": ZEROS, "contact": {"pressure": {}}}', "not an array of numbers"),
        ('{"displacement": ZEROS, "contact": {"pressure": [[0, 0]], "x": 3}}', "another mesh"),
        ('{"displacement": ZEROS, "contact": {"pressure": [0, 0], "x": [[0]]}}', "another mesh"),
        ('{"displacement": ZEROS, "contact": {"pressure": [0, 0], "friction": [[[]]]}}', "another mesh"),
    ],
)
def test_a_hostile_solution_file_gives_one_line(
    record: str, words: str, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (folder / "s.json").write_text(record.replace("ZEROS", json.dumps([[0.0, 0.0]] * 9)))
    code, _, err = run(capsys, "certify", "p.toml", "--solution", "s.json")
    assert code == 2
    assert err.startswith("hemivar: error: result file 's.json'")
    assert err.count("\n") == 1
    assert words in err


def test_a_file_that_is_no_text_is_no_solution(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (folder / "s.json").write_bytes(b"\xff{}")
    code, _, err = run(capsys, "certify", "p.toml", "--solution", "s.json")
    assert code == 2
    assert "not UTF-8" in err


# ---- hostile terminals and environments ------------------------------------------------------------------------


def test_names_cannot_steer_the_terminal(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Escape sequences in titles, in names of boundaries, laws and files are shown, not obeyed."""
    escape = "\x1b]0;owned\x07\x9b31m\u202e"
    (folder / f"law{escape}.csv").write_text("0,0\n1,10\n")
    text = PROBLEM.replace('"block"', '"bl\\u001b[31mock"').replace(
        "law.csv", "law\\u001b]0;owned\\u0007\\u009b31m\\u202e.csv"
    )
    (folder / f"p{escape}.toml").write_text(text)
    for arguments in (
        ["solve", f"p{escape}.toml", "--json", f"a{escape}.json"],
        ["compare", f"p{escape}.toml", "--methods", "newton"],
        ["certify", f"p{escape}.toml", "--solution", f"a{escape}.json", "--json", f"b{escape}.json"],
        ["laws", "--file", f"law{escape}.csv", "--plot", f"c{escape}.svg"],
        ["new", f"d{escape}\n.toml"],
        ["solve", f"nowhere{escape}.toml"],
        ["solve", "p.toml", "--method", f"new{escape}ton"],
        ["laws", f"law{escape}"],
        [f"solve{escape}"],
    ):
        _, out, err = run(capsys, *arguments)
        for c in out + err:
            assert c in "\n" or c.isprintable(), arguments
        assert "\n.toml" not in out  # the line end of a name
    assert "written           d\\x1b]0;owned\\x07" in run(capsys, "new", f"d{escape}\n.toml", "--force")[1]


def test_colours_pass_where_they_are_meant() -> None:
    import io

    under = io.StringIO()
    stream = terminal.Stream(under)
    stream.write("a\x1b[1mb\xa0\u00fc\t\n")
    stream.rich_proxied_file.write("\x1b[1m")
    assert under.getvalue() == "a\\x1b[1mb \u00fc\t\n\x1b[1m"


@pytest.mark.parametrize(
    "env",
    [
        slow({"MPLBACKEND": "nonsense"}),
        slow({"MPLCONFIGDIR": "/dev/null/nowhere"}),
        slow({"MATPLOTLIBRC": "rc"}),
        slow({"HOME": "/dev/null/nowhere"}),
        {"HOME": "/dev/null/nowhere", "XDG_CACHE_HOME": "", "XDG_CONFIG_HOME": "", "MPLCONFIGDIR": "/proc/nowhere"},
    ],
    ids=lambda env: ",".join(env),
)
def test_figures_do_not_depend_on_the_environment(env: dict[str, str], folder: Path) -> None:
    (folder / "rc").mkdir()
    (folder / "rc" / "matplotlibrc").write_text(
        "text.usetex: True\nfigure.dpi: 1e9\nbackend: nonsense\nfont.family: none\n"
    )
    done = in_process("laws", "signorini", "--plot", "a.png", cwd=folder, env=env)
    assert (done.returncode, done.stderr) == (0, "")
    assert (folder / "a.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.slow
def test_a_settings_file_that_matplotlib_cannot_read_is_one_line(folder: Path) -> None:
    (folder / "matplotlibrc").write_bytes(b"\xff\xfe\x80")
    done = in_process("solve", "p.toml", "--plot", "a.png", "--json", "a.json", cwd=folder)
    assert done.returncode in (0, 2)
    assert done.stderr.count("\n") == (1 if done.returncode else 0)
    assert "Traceback" not in done.stderr
    assert (folder / "a.json").exists()
    done = in_process("laws", "signorini", "--plot", "b.png", cwd=folder)
    assert done.returncode == 2
    assert done.stderr.startswith("hemivar: error: ")
    assert "matplotlib cannot read its settings" in done.stderr
    assert done.stderr.count("\n") == 1


@pytest.mark.slow
def test_bytes_that_are_no_text_on_the_command_line(folder: Path) -> None:
    for arguments in (
        ["solve", b"\xff.toml"],
        ["solve", "p.toml", "--method", b"\xff"],
        ["solve", "p.toml", "--json", b"\xff.json"],
        [b"\xff"],
        ["laws", b"\xff"],
        ["laws", "--formula", b"\xff"],
    ):
        done = in_process(*arguments, cwd=folder)
        assert "Traceback" not in done.stderr
        assert done.returncode in (0, 2)
        assert done.stderr.count("\n") == (1 if done.returncode else 0)


def test_a_home_that_is_missing_and_a_stream_that_is_closed(folder: Path) -> None:
    done = in_process("solve", "p.toml", cwd=folder, env={"HOME": ""}, preexec_fn=lambda: os.close(0))
    assert (done.returncode, done.stderr) == (0, "")


def test_warnings_of_libraries_stay_inside(
    folder: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    original = Session.discrete

    def noisy(*arguments: Any) -> Any:
        warnings.warn("overflow encountered", RuntimeWarning, stacklevel=1)
        return original(*arguments)

    monkeypatch.setattr(Session, "discrete", noisy)
    with warnings.catch_warnings(record=True) as seen:
        warnings.simplefilter("always")
        code, _, err = run(capsys, "solve", "p.toml")
    assert (code, err, seen) == (0, "", [])


def test_an_internal_error_can_be_traced(
    folder: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object) -> None:
        raise ZeroDivisionError("by zero")

    monkeypatch.setattr(Session, "discrete", fail)
    monkeypatch.setenv("HEMIVAR_TRACEBACK", "1")
    code, _, err = run(capsys, "solve", "p.toml")
    assert code == 70
    assert "Traceback" in err
    assert "in fail" in err


def test_a_very_long_name_does_not_hide_what_is_wrong(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["solve", "a" * 5000 + ".toml"]) == 2
    message = capsys.readouterr().err
    assert message.startswith("hemivar: error: cannot read problem file aaa")
    assert len(message) < 1100
    assert "aaa ... aaa" in message
    assert "file name too long" in message.lower()


MARCH = """
[mesh]
rectangle = [1.0, 1.0]
cells = [2, 2]
[material]
lame = [4.0, 4.0]
[loads]
body = [0.0, "-t"]
[supports]
top = "clamped"
[time]
until = 0.03
step = 0.01
"""


def test_frames_of_a_march_neither_overwrite_nor_remove_what_was_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The table of a law has the name of a frame, and another frame's name leads to the problem file."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "run").mkdir()
    table, problem = tmp_path / "run" / "run_000777.vtu", tmp_path / "p.toml"
    table.write_text("r,derivative\n0,0\n1,10\n")
    law = '[contact.bottom]\nnormal = { law = "table", file = "run/run_000777.vtu" }\n'
    problem.write_text(MARCH.replace("[time]", law + "[time]"))
    before = table.read_bytes(), problem.read_bytes()
    (tmp_path / "run" / "run_000000.vtu").symlink_to(problem)
    assert main(["march", str(problem), "--fields", "run.pvd", "--quiet"]) == 2
    assert (table.read_bytes(), problem.read_bytes()) == before
    assert "was read for this problem" in capsys.readouterr().err


@contextlib.contextmanager
def ends_within(seconds: int) -> Iterator[None]:
    def late(*_: object) -> None:
        raise TimeoutError

    before = signal.signal(signal.SIGALRM, late)
    signal.alarm(seconds)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes")
def test_a_frame_is_not_written_into_a_pipe(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "run").mkdir()
    os.mkfifo(tmp_path / "run" / "run_000001.vtu")
    (tmp_path / "p.toml").write_text(MARCH)
    with ends_within(20):
        assert main(["march", "p.toml", "--fields", "run.pvd", "--quiet"]) == 2
    assert "it is a pipe" in capsys.readouterr().err


def test_the_folder_of_the_survey_is_not_one_that_holds_this_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    assert main(["survey", "--output", ".."]) == 2
    assert "holds the current folder" in capsys.readouterr().err
    assert sorted(file.name for file in tmp_path.iterdir()) == ["here"]
