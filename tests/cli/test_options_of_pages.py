"""Commands that pages, examples and the manuscript write have the options that they write."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from typer.main import get_command

from hemivar.cli.app import app

ROOT = Path(__file__).parents[2]
TEXTS = sorted(
    [*(ROOT / "docs").glob("*.md"), *(ROOT / "docs" / "notebooks").glob("*.ipynb"), ROOT / "README.md",
     ROOT / "CONTRIBUTING.md", ROOT / "paper" / "paper.md", *(ROOT / "examples").rglob("*.toml")]
)  # fmt: skip
KNOWN = {
    name: {option for parameter in command.params for option in (*parameter.opts, *parameter.secondary_opts)}
    for name, command in get_command(app).commands.items()  # type: ignore[attr-defined]
}
_CALL = re.compile(r"\bhemivar (?P<name>[a-z]+)(?P<rest>(?:\\\n|[^`\n])*)")


def wrong(text: str) -> list[str]:
    """Commands with an option that they do not have, as they are written; after a pipe it is another program's."""
    found = []
    for call in _CALL.finditer(text):
        if call["name"] in KNOWN:
            rest = re.split(r"[|#;]", call["rest"])[0]
            options = re.findall(r"(?<![\w-])--[a-z][\w-]*", rest)
            found += [f"hemivar {call['name']} {one}" for one in options if one not in KNOWN[call["name"]] | {"--help"}]
    return found


@pytest.mark.parametrize("path", TEXTS, ids=lambda path: str(path.relative_to(ROOT)))
def test_options_that_are_written_exist(path: Path) -> None:
    assert wrong(path.read_text(encoding="utf-8")) == []


def test_an_option_that_is_gone_is_found() -> None:
    assert wrong("Run `hemivar solve a.toml --adaptive 0.1 --nothing` now.") == ["hemivar solve --nothing"]
    assert wrong("    hemivar sweep a.toml --set a=1 \\\n        --jbs 2  # --no\n") == ["hemivar sweep --jbs"]
