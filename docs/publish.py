"""Put a built site beside those of other versions: ``python docs/publish.py docs/_build/html PAGES VERSION``.

PAGES is what is served.  Every version has its folder, ``dev`` is that of the main branch; the first page leads to the
newest release, or to ``dev`` where there is none, and ``versions.html`` lists all.
"""

from __future__ import annotations

import html
import re
import shutil
import sys
from pathlib import Path

_VERSION = re.compile(r"v?(\d+(?:\.\d+)*)")


def publish(site: Path, pages: Path, version: str) -> None:
    """Put a site into its folder, and write the list and the first page anew.

    Parameters
    ----------
    site : Path
        What ``make -C docs html`` wrote.
    pages : Path
        All that is served; made if it is not there.
    version : str
        ``dev``, or a number such as ``0.2.1``, with or without a ``v``.

    Raises
    ------
    ValueError
        The version is neither, or there is no site.
    """
    found = _VERSION.fullmatch(version)
    if version != "dev" and found is None:
        raise ValueError(f"version '{version}' is neither dev nor a number such as 0.2.1")
    if not (site / "index.html").exists():
        raise ValueError(f"{site} holds no site; run make -C docs html")
    folder = pages / (found[1] if found else "dev")
    if folder.exists():
        shutil.rmtree(folder)
    shutil.copytree(site, folder, ignore=shutil.ignore_patterns(".doctrees", ".buildinfo"))
    there = [one.name for one in pages.iterdir() if (one / "index.html").exists() and not one.name.startswith(".")]
    numbers = sorted((one for one in there if one != "dev"), key=_order, reverse=True)
    first = numbers[0] if numbers else "dev"
    listed = [*numbers, *(["dev"] if "dev" in there else [])]
    rows = "\n".join(
        f'<li><a href="{html.escape(one)}/index.html">{html.escape(_told(one, first))}</a></li>' for one in listed
    )
    head = '<!doctype html>\n<html lang="en">\n<meta charset="utf-8">\n'
    (pages / "versions.html").write_text(
        f"{head}<title>hemivar: versions</title>\n<h1>Documentation of hemivar</h1>\n<ul>\n{rows}\n</ul>\n</html>\n",
        encoding="utf-8",
    )
    (pages / "index.html").write_text(
        f'{head}<title>hemivar</title>\n<meta http-equiv="refresh" content="0; url={first}/index.html">\n'
        f'<a href="{first}/index.html">hemivar {first}</a>\n</html>\n',
        encoding="utf-8",
    )
    (pages / ".nojekyll").touch()


def _order(version: str) -> tuple[int, ...]:
    return tuple(int(part) for part in version.split("."))


def _told(version: str, first: str) -> str:
    if version == "dev":
        return "dev: the main branch, not released"
    return f"{version}: newest release" if version == first else version


if __name__ == "__main__":
    publish(Path(sys.argv[1]), Path(sys.argv[2]), sys.argv[3])
