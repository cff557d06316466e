"""The site that was built: complete, by itself, with figures. Skipped where nothing has been built."""

from __future__ import annotations

import html
import importlib
import inspect
import json
import re
import runpy
import sys
import zlib
from pathlib import Path
from urllib.parse import unquote

import pytest
from PIL import Image

import hemivar as hv

ROOT = Path(__file__).parents[1]
SITE = ROOT / "docs" / "_build" / "html"
TUTORIALS = ("tutorial-teacher", "tutorial-mathematician", "tutorial-engineer", "tutorial-failure")
EXAMPLES = sorted(path.stem for path in (ROOT / "examples").glob("*.py"))
pytestmark = pytest.mark.skipif(not (SITE / "objects.inv").exists(), reason="make -C docs html has not been run")


def described() -> set[str]:
    """Python names that the site describes."""
    body = (SITE / "objects.inv").read_bytes().split(b"\n", 4)[4]
    lines = zlib.decompress(body).decode().splitlines()
    return {line.split()[0] for line in lines if line.split()[1].startswith("py:")}


def test_every_public_name_is_described() -> None:
    known = described()
    rooms = runpy.run_path(str(ROOT / "docs" / "api.py"))["ROOMS"]
    places: dict[int | str, set[str]] = {}
    for module in (hv, *(importlib.import_module(f"hemivar.{room}") for room in rooms)):
        for name in module.__all__:
            value = getattr(module, name)
            one = inspect.isclass(value) or inspect.isfunction(value)
            key = id(value) if one else name
            places.setdefault(key, set()).add(f"{module.__name__}.{name}")
    places.pop("__version__")
    missing = [sorted(names) for names in places.values() if not names & known]
    assert missing == []
    assert len(places) > 250


def test_a_function_is_shown_with_its_sections() -> None:
    entries: dict[str, str] = {}
    for page in (SITE / "reference").glob("*.html"):
        for entry in page.read_text(encoding="utf-8").split('<dl class="py ')[1:]:
            found = re.search(r'<dt [^>]*id="([^"]+)"', entry)
            if found is not None:
                entries[found[1]] = entry
    shown = 0
    for name, entry in entries.items():
        module, _, last = name.rpartition(".")
        value = getattr(importlib.import_module(module), last) if module in sys.modules else None
        if not inspect.isfunction(value):
            continue
        shown += 1
        for section in ("Parameters", "Returns", "Yields", "Raises"):
            if re.search(rf"^{section}\n-+$", inspect.getdoc(value) or "", re.MULTILINE):
                assert f">{section}<" in entry, f"{name}: {section}"
    assert shown > 120


def test_what_classes_can_do_is_described() -> None:
    known = described()
    for name in ("Solution.certify", "Mesh.refined", "History.plot", "DiscreteProblem.with_", "Status.CONVERGED"):
        assert any(one.endswith(f".{name}") for one in known), name


def test_pages_ask_no_other_host() -> None:
    pages = sorted(SITE.rglob("*.html"))
    assert len(pages) > 60
    loads = re.compile(
        r"""<(?:script|img|iframe|source|video)\b[^>]*\bsrc=["']([^"']+)|<link\b[^>]*\bhref=["']([^"']+)"""
    )
    for page in pages:
        for found in loads.findall(page.read_text(encoding="utf-8")):
            assert not re.match(r"(https?:)?//", "".join(found)), f"{page.name}: {''.join(found)}"
    for style in SITE.rglob("*.css"):
        assert not re.search(r"(url\(|@import)\s*[\"']?(https?:)?//", style.read_text(encoding="utf-8")), style.name


@pytest.mark.parametrize(
    ("page", "least"),
    [
        ("theory/inequality", 110),
        ("theory/certificates", 90),
        ("theory/bounds", 140),
        ("theory/time", 45),
        ("laws", 35),
    ],
)
def test_formulas_are_set_as_formulas(page: str, least: int) -> None:
    text = (SITE / f"{page}.html").read_text(encoding="utf-8")
    body = text[text.index("<article") : text.index("</article>")]
    assert body.count('class="math notranslate nohighlight"') >= least
    words = re.sub(r"<(code|pre)\b.*?</\1>", "", body, flags=re.DOTALL)
    words = re.sub(r'<(span|div) class="math .*?</\1>', "", words, flags=re.DOTALL)
    plain = html.unescape(re.sub(r"<[^>]+>", "", words))
    assert not re.search(r"(?<![\w.\-])(lam|alpha|zeta|xi|dj\()(?![\w.])|\$", plain)


def test_links_inside_the_site_lead_somewhere() -> None:
    pages = {
        page.resolve(): page.read_text(encoding="utf-8") for page in SITE.rglob("*.html") if "_static" not in page.parts
    }
    names = {page: set(re.findall(r'\bid="([^"]+)"', text)) for page, text in pages.items()}
    lost, followed = [], 0
    for page, text in pages.items():
        for link in re.findall(r'<a\b[^>]*\bhref="([^"]*)"', text):
            path, _, anchor = unquote(html.unescape(link)).partition("#")
            if re.match(r"[a-z]+:", path) or (not path and not anchor):
                continue
            target = (page.parent / path).resolve() if path else page
            followed += 1
            if not target.exists() or (anchor and target in names and anchor not in names[target]):
                lost.append(f"{page.name}: {link}")
    assert lost == []
    assert followed > 5000


def test_every_page_names_its_version() -> None:
    for page in SITE.rglob("*.html"):
        if "_static" not in page.parts:
            text = page.read_text(encoding="utf-8")
            assert re.search(rf"<title>[^<]*hemivar {re.escape(hv.__version__)}( dev)?</title>", text), page.name


def test_equations_have_their_typesetter() -> None:
    page = (SITE / "theory" / "inequality.html").read_text(encoding="utf-8")
    (source,) = re.findall(r'src="\.\./([^"]*mathjax[^"?]*)', page)
    assert (SITE / source).stat().st_size > 100_000
    assert list((SITE / "_static" / "mathjax").rglob("*.woff"))
    assert page.count('class="math notranslate nohighlight"') > 20
    assert "$$" not in html.unescape(re.sub(r"<[^>]+>", "", page))


@pytest.mark.parametrize("name", EXAMPLES)
def test_the_gallery_shows_each_example(name: str) -> None:
    page = (SITE / "gallery" / f"{name}.html").read_text(encoding="utf-8")
    figures = re.findall(r'src="\.\./_images/(sphx_glr_[^"]+)"', page)
    assert figures
    for figure in figures:
        assert (SITE / "_images" / figure).stat().st_size > 5000
    assert "Traceback" not in page


def test_cards_of_the_gallery_are_square_pictures() -> None:
    page = (SITE / "gallery" / "index.html").read_text(encoding="utf-8")
    cards = dict(re.findall(r'src="\.\./_images/(card_(\w+)_\d{3}\.png)"', page))
    assert sorted(cards.values()) == sorted(EXAMPLES)
    for card in cards:
        with Image.open(SITE / "_images" / card) as picture:
            assert picture.size == (480, 480)


@pytest.mark.parametrize("page", TUTORIALS)
def test_a_tutorial_shows_the_figures_of_its_code(page: str) -> None:
    shown = re.findall(r'src="_images/(tutorial-[^"]+)"', (SITE / f"{page}.html").read_text(encoding="utf-8"))
    assert len(shown) >= 3
    for name in shown:
        drawn = ROOT / "docs" / "drawn" / name  # by this build
        assert (SITE / "_images" / name).read_bytes() == drawn.read_bytes()


@pytest.mark.parametrize("name", sorted(path.stem for path in (ROOT / "docs" / "notebooks").glob("*.ipynb")))
def test_notebooks_stand_with_what_they_show(name: str) -> None:
    page = (SITE / "notebooks" / f"{name}.html").read_text(encoding="utf-8")
    inside = re.findall(r'src="data:image/png;base64,([^"]{2000,})"', page)
    beside = re.findall(r'src="(\.\./_images/[^"]+\.png)"', page)
    assert len(inside) + len(beside) >= 5
    assert len(beside) >= 2
    assert "Traceback" not in page
    assert "&lt;Picture size" not in page


def test_the_gallery_has_sections_and_every_example_once() -> None:
    page = (SITE / "gallery" / "index.html").read_text(encoding="utf-8")
    body = page[page.index("<article") : page.index("</article>")]
    sections = runpy.run_path(str(ROOT / "docs" / "site_figures.py"))["SECTIONS"]
    at = [body.index(f"<h2>{title}<") for title in sections]
    assert at == sorted(at)
    assert sorted(re.findall(r'<a class="reference internal" href="(\w+)\.html"', body)) == EXAMPLES
    assert sorted(name for names in sections.values() for name in names) == EXAMPLES
    assert "<h2>Others<" not in body


@pytest.mark.parametrize(("page", "name"), [("index", "two_equilibria"), ("figures", "dragged_cube")])
def test_bodies_that_turn_have_their_data_and_an_image_beside(page: str, name: str) -> None:
    text = (SITE / f"{page}.html").read_text(encoding="utf-8")
    figure = text[text.index(f'<div class="figure-3d" data-body="{name}.json">') :]
    assert "<img" in figure[:600]  # where there is no WebGL
    assert re.search(r'<script type="module" src="_static/figure3d\.js', text)
    script = (SITE / "_static" / "figure3d.js").read_text(encoding="utf-8")
    assert "three.module.min.js" in script
    assert not re.search(r"https?:", script)
    for file in ("three.module.min.js", "three.core.min.js", "three.LICENSE"):
        assert (SITE / "_static" / file).stat().st_size > 500
    body = json.loads((SITE / "_static" / f"{name}.json").read_text(encoding="utf-8"))
    vertices = len(body["points"]) // 3
    assert max(body["triangles"]) == max(body["edges"]) == vertices - 1
    for one in body["solutions"]:
        assert len(one["displacement"]) == 3 * vertices
        assert len(one["stress"]) == vertices
        assert len(one["states"]) == len(body["contact"])


def test_the_gallery_has_at_least_twenty() -> None:
    assert len(EXAMPLES) >= 20
