"""The documentation site: ``make -C docs html`` writes it to ``docs/_build/html``.

Everything a page needs is in the folder that is built: MathJax with its fonts, styles and scripts come from packages.
"""

from __future__ import annotations

import os
import re
import runpy
import sys
import tomllib
import warnings
from pathlib import Path
from typing import Any

DOCS = Path(__file__).parent
ROOT = DOCS.parent
sys.path[:0] = [str(ROOT / "src"), str(DOCS)]
os.environ.setdefault("MPLBACKEND", "Agg")

import figures_3d  # noqa: E402
import site_figures  # noqa: E402
import tutorial_figures  # noqa: E402
from sphinx.util.nodes import make_refnode  # noqa: E402

import hemivar  # noqa: E402

project = "hemivar"
author = "The hemivar developers"
copyright = author
version = hemivar.__version__
#: What the site is of: a release, or (by default) the state between the last one and the next.
_released = os.environ.get("HEMIVAR_SITE_VERSION", "dev").removeprefix("v")
release = version if _released == version else f"{version} dev"

extensions = [
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.mathjax",
    "sphinx-mathjax-offline",
    "numpydoc",
    "myst_nb",
    "sphinx_gallery.gen_gallery",
]
exclude_patterns = ["_build", "README.md", "gallery/*.ipynb", "gallery/**/*.ipynb", "gallery/**/*.py"]
nitpicky = True
#: Another package, whose pages are on another host.
nitpick_ignore_regex = [("py:.*", r"numpy\..*")]

# Markdown: equations in dollars, headings as targets of links.
myst_enable_extensions = ["dollarmath", "amsmath", "colon_fence", "deflist"]
myst_heading_anchors = 4
myst_dmath_double_inline = True

# Notebooks are run here, as pages are built; what they show is not kept in the repository.
nb_execution_mode = "force"
nb_execution_timeout = 300
nb_execution_raise_on_error = True
nb_execution_in_temp = True
nb_merge_streams = True
suppress_warnings = ["config.cache"]

# The reference: docstrings after numpydoc.
autodoc_typehints = "none"
autodoc_member_order = "bysource"
autodoc_class_signature = "mixed"
autosummary_generate = False
numpydoc_show_class_members = False
numpydoc_class_members_toctree = False
default_role = "code"

# The gallery: every script of examples/ is run.
sphinx_gallery_conf = {
    "examples_dirs": [str(ROOT / "examples")],
    "gallery_dirs": ["gallery"],
    "filename_pattern": os.environ.get("HEMIVAR_GALLERY", r"\.py$"),
    "ignore_pattern": r"(^|/)_|/(literature|meshes|own_law)/",
    "within_subsection_order": "site_figures.ReadingOrder",
    "thumbnail_size": (640, 448),
    "download_all_examples": False,
    "show_memory": False,
    "remove_config_comments": True,
    "abort_on_example_error": False,
    "only_warn_on_example_error": True,
    "min_reported_time": 1e9,
    "write_computation_times": False,
    "image_scrapers": ("site_figures",),
    "ignore_repr_types": r"matplotlib|NoneType",
    "matplotlib_animations": False,
    "reference_url": {},
}
warnings.filterwarnings("ignore", message="FigureCanvasAgg is non-interactive")

#: Addresses of the project, which pyproject.toml alone states.
_urls = tomllib.loads((DOCS.parent / "pyproject.toml").read_text(encoding="utf-8"))["project"]["urls"]
html_theme = "pydata_sphinx_theme"
html_title = f"hemivar {release}"
#: three.js, which the studio brings; and the bodies that the build writes.
THREE = ROOT / "src" / "hemivar" / "studio" / "static" / "vendor"
figures_3d.DRAWN.mkdir(parents=True, exist_ok=True)
html_static_path = ["_static", str(figures_3d.DRAWN), str(THREE)]
html_css_files = ["site.css"]
html_js_files = [("figure3d.js", {"type": "module"}), "from_disk.js"]
html_logo = "_static/logo.svg"
html_favicon = "_static/logo.svg"
html_show_sourcelink = False
html_sidebars = {"index": []}
html_theme_options = {
    "logo": {"text": html_title},
    "external_links": [{"name": "Versions", "url": f"{_urls['Documentation']}/versions.html"}],
    "show_prev_next": False,
    "navbar_align": "left",
    "navbar_persistent": ["search-button"],
    "header_links_before_dropdown": 8,
    "secondary_sidebar_items": ["page-toc"],
    "footer_start": ["copyright"],
    "footer_end": [],
    "navigation_with_keys": False,
    "icon_links": [{"name": "Repository", "url": _urls["Repository"], "icon": "fa-brands fa-github"}],
}


def _bars(app: Any, what: str, name: str, obj: object, options: Any, lines: list[str]) -> None:
    """In docstrings ``|r|`` is a modulus, not a substitution of reStructuredText."""
    block = -1
    for i, line in enumerate(lines):
        indent = len(line) - len(line.lstrip())
        if line.strip() and indent <= block:
            block = -1
        if block < 0:
            parts = line.split("``")
            parts[::2] = [part.replace("|", r"\|") for part in parts[::2]]
            lines[i] = "``".join(parts)
        if line.rstrip().endswith("::"):
            block = indent


def _reference(app: Any, env: Any, node: Any, text: Any) -> Any:
    """Docstrings name things as their module knows them: where the site describes them, or that they exist at all."""
    if node.get("refdomain") != "py":
        return None
    last = node["reftarget"].rpartition(".")[2]
    known = env.get_domain("py").objects
    places = [(name.count("."), name) for name in known if name.rpartition(".")[2] == last]
    kind = node.get("py:class") if "." not in node["reftarget"] else node["reftarget"].rpartition(".")[0]
    inside = [place for place in places if kind and place[1].endswith(f"{kind}.{last}")]
    if node["reftype"] == "attr" and not inside and kind:
        modules = [module for name, module in list(sys.modules.items()) if name.startswith("hemivar")]
        classes = [vars(module).get(kind.rpartition(".")[2]) for module in modules]
        fields = (getattr(one, "__annotations__", {}) for one in classes)
        return text if any(last in one for one in fields) else None
    if inside or places:
        target = known[min(inside or places)[1]]
        return make_refnode(app.builder, node["refdoc"], target.docname, target.node_id, text)
    modules = [module for name, module in list(sys.modules.items()) if name.startswith("hemivar.")]
    return text if any(last in vars(module) for module in modules) else None  # not public, so on no page


def _drawn(app: Any) -> None:
    """Figures of the tutorials, from the code that stands in them; the files in images/ are for readers elsewhere."""
    figures_3d.main()
    if os.environ.get("HEMIVAR_GALLERY") is None:
        for page in tutorial_figures.PAGES:
            tutorial_figures.draw(page, DOCS / "drawn")


def _shown(app: Any, page: str, source: list[str]) -> None:
    """Figures that the build has drawn are shown as drawn, on every page."""
    if os.environ.get("HEMIVAR_GALLERY") is None:
        source[0] = re.sub(r"(\]\(|\{image\} )images/(tutorial|figure)-", r"\1drawn/\2-", source[0])
        source[0] = re.sub(r"images/card-(\w+)\.png", lambda found: _card(found[1]), source[0])


def _card(example: str) -> str:
    return f"gallery/images/{site_figures.card_of(example)}"


def _sections(app: Any) -> None:
    site_figures.into_sections(DOCS / "gallery" / "index.rst")


def setup(app: Any) -> None:
    app.connect("builder-inited", _drawn)
    app.connect("builder-inited", _sections, priority=900)  # after the gallery is made
    app.connect("source-read", _shown)
    app.connect("autodoc-process-docstring", _bars, priority=900)
    app.connect("missing-reference", _reference)


# One page of the reference for each room, with every public name.
_page = runpy.run_path(str(DOCS / "api.py"))["room_pages"]
for _name, _text in _page().items():
    _file = DOCS / "reference" / f"{_name}.rst"
    _file.parent.mkdir(exist_ok=True)
    if not _file.exists() or _file.read_text(encoding="utf-8") != _text:
        _file.write_text(_text, encoding="utf-8")
