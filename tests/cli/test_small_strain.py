"""Largest strain and rotation, and what is said where they are not small."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from hemivar import cli


def test_the_command_says_so(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = """
        [mesh]
        rectangle = [4.0, 0.5]
        cells = [16, 2]
        [material]
        lame = [40.0, 40.0]
        density = 0.01
        [loads]
        body = [0.0, "-1*min(1, t)"]
        [supports]
        left = "clamped"
        [contact.bottom]
        normal = { law = "compliance", stiffness = 0.01 }
        [time]
        until = 1.0
        step = 0.1
    """
    moving, still = tmp_path / "moving.toml", tmp_path / "still.toml"
    moving.write_text(text, encoding="utf-8")
    still.write_text(text.replace('"-1*min(1, t)"', "-1.0").partition("[time]")[0], encoding="utf-8")
    assert cli.main(["solve", str(still), "-q"]) == 0
    shown = capsys.readouterr().out
    assert shown.count("beyond small strains") == 1
    assert "largest           strain " in shown
    record, other = tmp_path / "path.json", tmp_path / "march.json"
    assert cli.main(["path", str(still), "--json", str(record)]) == 0
    assert capsys.readouterr().out.count("at load factor 1 beyond small strains") == 1
    (warning,) = json.loads(record.read_text(encoding="utf-8"))["warnings"]
    assert "beyond small strains" in warning
    assert cli.main(["solutions", str(still), "--starts", "2"]) == 0
    assert "solution 1: beyond small strains" in capsys.readouterr().out
    assert cli.main(["march", str(moving), "--json", str(other), "-q"]) == 0
    assert capsys.readouterr().out.count("beyond small strains") == 1
    (message,) = json.loads(other.read_text(encoding="utf-8"))["messages"]
    assert message.startswith("beyond small strains from t = ")
