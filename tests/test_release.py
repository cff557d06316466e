"""What is published: metadata that agree, links that work from anywhere, archives that are complete."""

from __future__ import annotations

import re
import subprocess
import tarfile
import tomllib
import zipfile
from pathlib import Path

import pytest

import hemivar

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
#: Made by ``python -m build``; where nothing has been built there is nothing to look at.
SDISTS, WHEELS = sorted((ROOT / "dist").glob("*.tar.gz")), sorted((ROOT / "dist").glob("*.whl"))


def test_one_version() -> None:
    assert PROJECT["version"] == hemivar.__version__
    citation = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert f"\nversion: {hemivar.__version__}\n" in citation
    assert f"\nlicense: {PROJECT['license']}\n" in citation


def test_images_of_the_readme_are_seen_from_anywhere() -> None:
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    images = re.findall(r"!\[[^\]]*\]\(([^)]+)\)", text)
    assert images
    begin = "https://raw.githubusercontent.com/hemivar/hemivar/main/"
    for image in images:
        assert image.startswith(begin), image
        assert (ROOT / image.removeprefix(begin)).exists(), image


def test_every_command_is_in_the_readme_or_the_docs() -> None:
    from hemivar.cli.app import app

    text = "".join(path.read_text(encoding="utf-8") for path in [ROOT / "README.md", *(ROOT / "docs").glob("*.md")])
    for command in app.registered_commands:
        assert f"hemivar {command.name}" in text, command.name


@pytest.mark.skipif(not SDISTS, reason="no archive has been built")
def test_the_source_archive_is_complete() -> None:
    with tarfile.open(SDISTS[-1]) as archive:
        found = {name.partition("/")[2] for name in archive.getnames()}
    tracked = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=True).stdout.split(
        "\n"
    )
    wanted = {name for name in tracked if name and not name.startswith((".ci/", ".github/", ".git", ".pre-commit"))}
    assert wanted - found == set()


@pytest.mark.skipif(not WHEELS, reason="no wheel has been built")
def test_the_wheel_holds_modules_and_templates_and_nothing_else() -> None:
    with zipfile.ZipFile(WHEELS[-1]) as wheel:
        found = {name for name in wheel.namelist() if ".dist-info/" not in name}
    source = ROOT / "src"
    modules = {str(path.relative_to(source)) for path in (source / "hemivar").rglob("*.py")}
    templates = {str(path.relative_to(source)) for path in (source / "hemivar/files/templates").glob("*.toml")}
    assert found == modules | templates | {"hemivar/py.typed"}
