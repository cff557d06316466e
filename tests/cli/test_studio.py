"""``hemivar studio``: what it says before it serves, and how it ends."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import urllib.request
from pathlib import Path

import pytest

from hemivar import cli
from hemivar.cli import main


def test_without_the_extra_it_says_in_a_sentence_what_to_install(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("importlib.util.find_spec", lambda name, package=None: None)
    assert main(["studio"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.endswith("run pip install starlette uvicorn websockets tomlkit")


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["missing.toml"], "does not exist"),
        (["--template", "softning"], "did you mean"),
        (["--token", "short"], "at least 16"),
        (["--port", "70000"], "65535"),
    ],
)
def test_mistakes_are_told_before_anything_is_served(
    arguments: list[str],
    words: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("hemivar.studio.web_server.refuse_missing", lambda: None)
    assert main(["studio", "--no-browser", *arguments]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert words in line


def test_it_serves_the_file_and_ends_with_ctrl_c(tmp_path: Path) -> None:
    for module in ("starlette", "uvicorn", "websockets"):
        pytest.importorskip(module, reason=f"{module} is not installed")
    from hemivar.files.sample import template

    (tmp_path / "mine.toml").write_text(template("softening"), encoding="utf-8")
    source = str(Path(cli.__file__).parents[2])
    process = subprocess.Popen(
        [sys.executable, "-m", "hemivar", "studio", "mine.toml", "--no-browser"],
        cwd=tmp_path, env={**os.environ, "PYTHONPATH": source}, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        text=True,
    )  # fmt: skip
    try:
        assert process.stdout is not None
        address = re.search(r"http://127\.0\.0\.1:\d+/[\w-]{20,}/", process.stdout.readline())
        assert address is not None
        with urllib.request.urlopen(address[0], timeout=20) as answer:
            assert b"hemivar studio" in answer.read()
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=20)
    finally:
        process.kill()
    assert "Traceback" not in out + err
    assert process.returncode in (0, 130)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["mine.toml"]
