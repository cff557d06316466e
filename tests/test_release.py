"""What is published: metadata that agree, links that work from anywhere, archives that are complete."""

from __future__ import annotations

import json
import re
import runpy
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


def test_pictures_of_the_readme_are_seen_in_the_repository_and_from_anywhere(monkeypatch: pytest.MonkeyPatch) -> None:
    images = re.compile(r"!\[[^\]]*\]\(([^)]+)\)")
    here = images.findall((ROOT / "README.md").read_text(encoding="utf-8"))
    assert here
    for image in here:
        assert (ROOT / image).exists(), image
    pytest.importorskip("setuptools")
    monkeypatch.setattr("setuptools.setup", lambda **given: None)
    shown = runpy.run_path(str(ROOT / "setup.py"))["readme"]()
    repository = PROJECT["urls"]["Repository"]
    assert images.findall(shown) == [f"{repository}/raw/main/{image}" for image in here]
    links = re.findall(r"(?<!!)\[[^\]]*\]\(([^)]+)\)", shown)
    assert links
    assert all(link.startswith(("https://", "#")) for link in links)


def test_addresses_of_the_project_stand_in_one_place() -> None:
    address = PROJECT["urls"]["Repository"].removeprefix("https://")
    texts = [*(ROOT / "docs").glob("*.md"), *(ROOT / "docs").glob("*.py")]
    assert [path.name for path in texts if address in path.read_text(encoding="utf-8")] == []
    # and once more for who reads the README, which can be cloned
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    assert readme.count(address) == readme.count(f"git clone https://{address}`") == 1


def test_every_command_is_in_the_readme_or_the_docs() -> None:
    from hemivar.cli.app import app

    text = "".join(path.read_text(encoding="utf-8") for path in [ROOT / "README.md", *(ROOT / "docs").glob("*.md")])
    for command in app.registered_commands:
        assert f"hemivar {command.name}" in text, command.name


def test_tests_docs_wheels_and_publication_have_workflows() -> None:
    yaml = pytest.importorskip("yaml")
    found = {path.stem: yaml.safe_load(path.read_text()) for path in (ROOT / ".github" / "workflows").glob("*.yml")}
    assert set(found) >= {"test", "docs", "wheels", "publish"}
    runs = {name: json.dumps(one["jobs"]) for name, one in found.items()}
    for name, command in (
        ("test", "python -m pytest"),
        ("test", ".ci/run"),
        ("docs", "make -C docs html"),
        ("docs", "docs/publish.py"),
        ("wheels", "python -m build"),
        ("wheels", "twine check --strict"),
        ("publish", "gh-action-pypi-publish"),
    ):
        assert command in runs[name], f"{name}: {command}"
    for one in found.values():
        for job in one["jobs"].values():
            for step in job.get("steps", ()):
                for name in re.findall(r"(?:tests|docs)/[\w/]+\.py", step.get("run", "")):
                    assert (ROOT / name).exists(), name


def test_sites_of_versions_stand_beside_each_other(tmp_path: Path) -> None:
    publish = runpy.run_path(str(ROOT / "docs" / "publish.py"))["publish"]
    pages, site = tmp_path / "pages", tmp_path / "site"
    (site / ".doctrees").mkdir(parents=True)
    with pytest.raises(ValueError, match="holds no site"):
        publish(site, pages, "dev")

    def put(version: str, text: str) -> str:
        (site / "index.html").write_text(text)
        publish(site, pages, version)
        return (pages / "index.html").read_text()

    assert "url=dev/index.html" in put("dev", "a")
    assert "url=0.9.0/index.html" in put("v0.9.0", "b")
    assert "url=0.10.0/index.html" in put("0.10.0", "c")  # which is newer than 0.9.0
    assert "url=0.10.0/index.html" in put("0.9.1", "d")
    assert "url=0.10.0/index.html" in put("dev", "e")
    assert {one.name: (one / "index.html").read_text() for one in pages.iterdir() if one.is_dir()} == {
        "dev": "e", "0.9.0": "b", "0.9.1": "d", "0.10.0": "c",
    }  # fmt: skip
    assert not (pages / "dev" / ".doctrees").exists()
    listed = re.findall(r'href="([^"]+)/index.html">([^<]+)<', (pages / "versions.html").read_text())
    assert [name for name, _ in listed] == ["0.10.0", "0.9.1", "0.9.0", "dev"]
    assert listed[0][1] == "0.10.0: newest release"
    with pytest.raises(ValueError, match="neither dev nor a number"):
        publish(site, pages, "../other")


def test_the_manuscript_says_what_its_journal_asks_for() -> None:
    text = (ROOT / "paper" / "paper.md").read_text(encoding="utf-8")
    head = re.match(r"---\n(.*?)\n---\n", text, re.DOTALL)
    assert head is not None
    for key in ("title", "tags", "authors", "affiliations", "date", "bibliography"):
        assert re.search(rf"^{key}:", head[1], re.MULTILINE), key
    body = text[head.end() :]
    titles = re.findall(r"^# (.+)$", body, re.MULTILINE)
    assert {"Summary", "Statement of need", "References"} <= set(titles)
    entries = set(
        re.findall(r"^@\w+\{([^,]+),", (ROOT / "paper" / "paper.bib").read_text(encoding="utf-8"), re.MULTILINE)
    )
    cited = set(re.findall(r"(?<![\w.])@([A-Za-z][\w:-]*)", body))
    assert cited == entries
    for image in re.findall(r"!\[[^\]]*\]\(([^)]+)\)", body):
        assert (ROOT / "paper" / image).exists(), image
    assert 250 <= len(body.split()) <= 1750


@pytest.mark.skipif(not (ROOT / ".git").exists(), reason="not a checkout")
def test_no_file_of_a_run_is_kept() -> None:
    tracked = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=True).stdout.split()
    manifest = (ROOT / "MANIFEST.in").read_text(encoding="utf-8")
    named = set(re.search(r"^include (.+)$", manifest, re.MULTILINE)[1].split())  # type: ignore[index]
    top = {name for name in tracked if "/" not in name and not name.startswith(".")}
    assert top == named | {"MANIFEST.in", "pyproject.toml", "setup.py"}


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
def test_the_wheel_shows_the_readme_with_links_that_work_anywhere() -> None:
    with zipfile.ZipFile(WHEELS[-1]) as archive:
        (name,) = [one for one in archive.namelist() if one.endswith(".dist-info/METADATA")]
        text = archive.read(name).decode()
    assert f"({PROJECT['urls']['Repository']}/raw/main/docs/images/" in text
    assert not re.search(r"\]\((?!https?:|#)", text)


@pytest.mark.skipif(not WHEELS, reason="no wheel has been built")
def test_the_wheel_holds_modules_and_templates_and_nothing_else() -> None:
    with zipfile.ZipFile(WHEELS[-1]) as wheel:
        found = {name for name in wheel.namelist() if ".dist-info/" not in name}
    source = ROOT / "src"
    modules = {str(path.relative_to(source)) for path in (source / "hemivar").rglob("*.py")}
    # What packages load on first use.
    names = {str(path.relative_to(source)) for path in (source / "hemivar").rglob("__init__.pyi")}
    templates = {str(path.relative_to(source)) for path in (source / "hemivar/files/templates").glob("*.toml")}
    page = {str(path.relative_to(source)) for path in (source / "hemivar/studio/static").rglob("*.*")}
    # The compiled kernels are in the wheel of a platform, and only there.
    library = {name for name in found if re.fullmatch(r"hemivar/kernels/_compiled\.kernels\.(so|pyd)", name)}
    assert len(library) == (0 if WHEELS[-1].name.endswith("-py3-none-any.whl") else 1)
    assert "-py3-none-" in WHEELS[-1].name
    assert found - library == modules | names | templates | page | {"hemivar/py.typed"}
