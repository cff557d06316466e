"""The film of the studio on the first page of the site: ``python docs/studio_film.py`` takes it anew.

It needs ``pip install ".[studio]" playwright`` and Chromium.  A block is pushed onto a softening foundation by a slider
until it snaps down; then all solutions are found, and its path is followed.
"""

from __future__ import annotations

import io
import shutil
import socket
import subprocess
import sys
import time
import urllib.request
from pathlib import Path
from typing import TYPE_CHECKING

from PIL import Image
from playwright.sync_api import sync_playwright

if TYPE_CHECKING:
    from playwright.sync_api import Page

DOCS = Path(__file__).resolve().parent
SIZE, SHOWN = (1280, 720), (896, 504)
#: Milliseconds of a picture, and of one that is to be read.
QUICK, LONG = 110, 1800


class Film:
    """Pictures of a page, each with its length."""

    def __init__(self, page: Page) -> None:
        self._page = page
        self._pictures: list[tuple[Image.Image, int]] = []

    def take(self, milliseconds: int = QUICK) -> None:
        """One picture."""
        shot = Image.open(io.BytesIO(self._page.screenshot())).convert("RGB")
        self._pictures.append((shot.resize(SHOWN, Image.Resampling.LANCZOS), milliseconds))

    def write(self, path: Path) -> None:
        """All of them, with the colours that they share."""
        beside = Image.new("RGB", (SHOWN[0], SHOWN[1] * 3))
        for k, place in enumerate((0, len(self._pictures) // 2, -1)):
            beside.paste(self._pictures[place][0], (0, SHOWN[1] * k))
        colours = beside.quantize(96)
        first, *others = [one.quantize(palette=colours, dither=Image.Dither.NONE) for one, _ in self._pictures]
        lengths = [length for _, length in self._pictures]
        first.save(path, save_all=True, append_images=others, duration=lengths, loop=0, optimize=True)


def film(address: str, path: Path) -> None:
    """Drive the page at an address, and write what it shows."""
    chromium = shutil.which("chromium") or shutil.which("chromium-browser")
    with sync_playwright() as playwright:
        arguments = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
        browser = playwright.chromium.launch(executable_path=chromium, args=arguments)
        page = browser.new_page(viewport={"width": SIZE[0], "height": SIZE[1]})
        page.goto(address)
        page.wait_for_selector(".badge:not(.stale):not(.none)")
        shown = Film(page)
        shown.take(LONG)
        slider = page.locator('input[type="range"][data-key="supports.top.displacement.1"]')
        for k in [*range(18), *range(17, 6, -1)]:
            pushed = -0.02 - 0.007 * k
            slider.evaluate(
                "(one, value) => { one.value = value; one.dispatchEvent(new Event('input', { bubbles: true })); }",
                pushed,
            )
            page.wait_for_timeout(250)
            shown.take()
        page.wait_for_selector(".badge:not(.stale):not(.none)")
        shown.take(LONG)
        page.get_by_role("tab", name="All solutions").click()
        page.get_by_role("button", name="Find all solutions").click()
        page.wait_for_selector(".card", timeout=60_000)
        page.wait_for_timeout(400)
        shown.take(LONG)
        for card in page.locator(".card").all():
            card.click()
            page.wait_for_timeout(300)
            shown.take(LONG)
        page.get_by_role("tab", name="Load path").click()
        page.get_by_label("largest load factor").fill("1.3")
        page.get_by_role("button", name="Follow the path").click()
        page.wait_for_selector(".lower .fold", timeout=60_000)
        page.wait_for_timeout(500)
        cursor = page.get_by_label("point of the path")
        last = int(cursor.get_attribute("max") or 0)
        for k in range(4, 16):
            cursor.fill(str(last * k // 15))
            page.wait_for_timeout(350)
            shown.take()
        shown.take(LONG)
        browser.close()
        shown.write(path)


def main() -> None:
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        port = one.getsockname()[1]
    token = "film-0123456789abcdef"
    command = [sys.executable, "-m", "hemivar", "studio", "--template", "softening", "--no-browser"]
    server = subprocess.Popen([*command, "--port", str(port), "--token", token], stdout=subprocess.DEVNULL)
    address = f"http://127.0.0.1:{port}/{token}/"
    try:
        for _ in range(300):
            try:
                urllib.request.urlopen(address, timeout=1).close()
                break
            except OSError:
                time.sleep(0.1)
        film(address, DOCS / "images" / "studio.gif")
    finally:
        server.terminate()
        server.wait()


if __name__ == "__main__":
    main()
