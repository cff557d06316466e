"""The tutorial notebooks: kept without results, one line a line, and run to the end with their pictures."""

from __future__ import annotations

import base64
import io
import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

ROOT = Path(__file__).parents[1]
FOLDER = ROOT / "docs" / "notebooks"
NOTEBOOKS = sorted(FOLDER.glob("*.ipynb"))
METADATA = {
    "kernelspec": {"display_name": "Python 3", "language": "python", "name": "python3"},
    "language_info": {"name": "python"},
}


def test_there_is_one_for_each_reader() -> None:
    assert len(NOTEBOOKS) >= 3
    page = (ROOT / "docs" / "notebooks.md").read_text(encoding="utf-8")
    for path in NOTEBOOKS:
        assert f"notebooks/{path.name}" in page, "link it"
        assert re.search(rf"^notebooks/{path.stem}$", page, re.M), "name it in the toctree"


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_it_is_kept_without_results(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    book = json.loads(text)
    assert text == json.dumps(book, indent=1, ensure_ascii=False) + "\n", "as nbformat writes it"
    assert (book["nbformat"], book["nbformat_minor"], book["metadata"]) == (4, 5, METADATA)
    for number, cell in enumerate(book["cells"], start=1):
        assert cell["id"] == f"{number:02d}"
        assert cell["metadata"] == {}
        assert cell.get("outputs", []) == []
        assert cell.get("execution_count") is None
        lines = "".join(cell["source"]).split("\n")
        assert cell["source"] == [line + "\n" for line in lines[:-1]] + lines[-1:], "one line a line"
        assert all(len(line) <= 150 for line in lines)


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_its_links_lead_somewhere(path: Path) -> None:
    texts = ["".join(cell["source"]) for cell in json.loads(path.read_text())["cells"] if cell["cell_type"] != "code"]
    links = re.findall(r"\]\(((?!https?:)[^)#]+)", "\n".join(texts))
    assert links
    for link in links:
        assert (FOLDER / link).exists(), link


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_it_needs_no_magic(path: Path) -> None:
    for cell in json.loads(path.read_text())["cells"]:
        if cell["cell_type"] == "code":
            code = "".join(cell["source"])
            compile(code, path.name, "exec")
            assert "pyplot" not in code


def pictures(output: dict[str, Any]) -> list[bytes]:
    """What an output shows, as PNG: by itself, or inside HTML."""
    data = output.get("data", {})
    inside = re.findall(r'src="data:image/png;base64,([^"]+)"', data.get("text/html", ""))
    return [base64.b64decode(one) for one in [*([data["image/png"]] if "image/png" in data else []), *inside]]


def not_blank(picture: bytes) -> bool:
    """Whether there is something on it."""
    from matplotlib.image import imread

    pixels = imread(io.BytesIO(picture), format="png")[..., :3]
    return bool(min(pixels.shape[:2]) > 50 and np.mean(pixels.min(axis=-1) < 0.9) > 0.005)


def wrong(cells: list[Any]) -> list[str]:
    """What stands in a notebook that was run and should not."""
    found = []
    for cell in cells:
        for output in cell.get("outputs", ()):
            data, text = output.get("data", {}), "".join(output.get("text", ""))
            plain = data.get("text/plain", "")
            if output["output_type"] == "error" or output.get("name") == "stderr":
                found.append(f"{output.get('ename', 'stderr')}: {text}")
            if "data" in output and not pictures(output) and re.match(r"<.*(size|object at|\bat 0x)", plain):
                found.append(f"a name in place of a picture: {plain}")
            if len(text) > 2000 or (not pictures(output) and len(plain) > 800):
                found.append("a page of text")
            found += ["an empty picture" for one in pictures(output) if not not_blank(one)]
    return found


@pytest.mark.slow
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_it_runs_and_shows_its_pictures(path: Path, tmp_path: Path) -> None:
    nbformat, nbclient = pytest.importorskip("nbformat"), pytest.importorskip("nbclient")
    pytest.importorskip("ipykernel")
    book = nbformat.read(path, as_version=4)
    nbformat.validate(book)
    client = nbclient.NotebookClient(
        book, timeout=300, kernel_name="python3", resources={"metadata": {"path": str(tmp_path)}}
    )
    client.execute()
    assert wrong(book.cells) == []
    shown = [one for cell in book.cells for output in cell.get("outputs", ()) for one in pictures(output)]
    own = [output for cell in book.cells for output in cell.get("outputs", ()) if "image/png" in output.get("data", {})]
    assert len(shown) >= 5
    assert len(own) >= 2


def test_a_name_in_place_of_a_picture_is_found() -> None:
    def cell(**output: Any) -> list[Any]:
        return [{"outputs": [{"output_type": "execute_result", **output}]}]

    from matplotlib.figure import Figure

    stream = io.BytesIO()
    Figure(figsize=(3.0, 3.0)).savefig(stream, format="png")
    empty = base64.b64encode(stream.getvalue()).decode()
    assert wrong(cell(data={"text/plain": "<Figure size 630x500 with 2 Axes>"}))
    assert wrong(cell(data={"text/plain": "<hemivar.report.picture.Picture object at 0x7f>"}))
    assert wrong(cell(data={"text/plain": "<Picture size 300x300>", "image/png": empty})) == ["an empty picture"]
    assert wrong([{"outputs": [{"output_type": "stream", "name": "stderr", "text": "a warning"}]}])
    assert wrong(cell(data={"text/plain": "x" * 900}))
    assert wrong(cell(data={"text/plain": "array([1.0])"})) == []
