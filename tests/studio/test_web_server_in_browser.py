"""The page in a browser: Debian's Chromium, driven by playwright; skipped where one of them is missing."""

from __future__ import annotations

import base64
import json
import os
import re
import shutil
import signal
import socket
import statistics
import subprocess
import sys
import time
import urllib.request
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from hemivar.files.sample import template

pytestmark = pytest.mark.slow

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
for _module, _package in (("playwright.sync_api", "playwright"), ("starlette", "starlette"), ("uvicorn", "uvicorn")):
    pytest.importorskip(_module, reason=f"the page is tested with {_package}, which is not installed")
if CHROMIUM is None:
    pytest.skip("the page is tested in chromium, which is not installed", allow_module_level=True)

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Locator, Page, Route

ROOT = Path(__file__).parents[2]
TOKEN = "browser-test-0123456789"
#: Where pictures of the page are kept, if somebody wants to look at them.
KEPT = os.environ.get("HEMIVAR_STUDIO_SHOTS")
TABLE = """
title = "a law of points"
[mesh]
rectangle = [1.0, 1.0]
cells = [12, 12]
[material]
lame = [4.0, 4.0]
[loads]
body = [0.0, -1.0]
[supports]
left = "clamped"
[contact.bottom]
normal = { law = "pressure-table", penetrations = [-0.05, 0.0, 0.05, 0.1], pressures = [0.0, 0.0, 0.5, 0.8] }
friction = { law = "slip-table", bound = 0.5, slips = [0.0, 0.05], values = [1.0, 0.5] }
"""
HELD = """
title = "a block between its load and a foundation"
[mesh]
rectangle = [1.0, 1.0]
cells = [6, 6]
[material]
lame = [4.0, 4.0]
[loads]
body = [0.0, -0.15]
[supports]
top = { displacement = [0.0, -0.1] }
[contact.bottom]
normal = { law = "compliance", stiffness = 5.0 }
"""
#: Notes when a picture was drawn, and what the browser complained of.
WATCH = """
window.drawn = [];
const note = (event) => window.drawn.push([performance.now(), event.detail.generation]);
document.addEventListener("studio-drawn", note, true);
"""


class Server:
    """The command in a process of its own."""

    def __init__(self, port: int, *arguments: str) -> None:
        self.port = port
        self.address = f"http://127.0.0.1:{port}/{TOKEN}/"
        self._arguments = arguments
        self.start()

    def start(self) -> None:
        command = [sys.executable, "-m", "hemivar", "studio", *self._arguments]
        command += ["--no-browser", "--port", str(self.port), "--token", TOKEN]
        self.process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
        for _ in range(300):
            try:
                urllib.request.urlopen(self.address, timeout=1).close()
            except OSError:
                assert self.process.poll() is None, self.process.stderr and self.process.stderr.read()
                time.sleep(0.1)
            else:
                return
        raise AssertionError("the studio does not answer")

    def stop(self, how: signal.Signals = signal.SIGINT) -> str:
        self.process.send_signal(how)
        self.process.wait(20)
        assert self.process.stderr is not None
        return self.process.stderr.read()


def free_port() -> int:
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        return int(one.getsockname()[1])


@pytest.fixture(scope="module")
def server() -> Iterator[Server]:
    one = Server(free_port())
    yield one
    assert "Traceback" not in one.stop()


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        arguments = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
        one = playwright.chromium.launch(executable_path=CHROMIUM, args=arguments)
        yield one
        one.close()


@pytest.fixture
def open_page(browser: Browser) -> Iterator[Callable[..., Page]]:
    """Opens pages at an address, in a window of a size; complaints of the browser fail the test."""
    complaints: list[str] = []
    contexts = []

    def opened(address: str, text: str | None = None, size: tuple[int, int] = (1280, 720), dark: bool = False) -> Page:
        scheme = "dark" if dark else "light"
        context = browser.new_context(
            viewport={"width": size[0], "height": size[1]}, color_scheme=scheme, accept_downloads=True
        )  # type: ignore[arg-type]
        contexts.append(context)
        page = context.new_page()
        page.on("pageerror", lambda error: complaints.append(str(error)))
        page.on("console", lambda line: complaints.append(line.text) if line.type in ("error", "warning") else None)
        page.add_init_script(WATCH)
        page.goto(address)
        ready(page)
        if text is not None:
            write(page, text)
        return page

    yield opened
    for context in contexts:
        context.close()
    bad = [line for line in complaints if "WebGL" not in line and "WebSocket" not in line and "GPU stall" not in line]
    assert not bad, bad


def ready(page: Page, level: str = "") -> None:
    """Wait until the badge belongs to the picture."""
    page.wait_for_selector(f".badge{level}:not(.stale):not(.none)", timeout=20_000)


def write(page: Page, text: str) -> None:
    """Put a text into the page by hand."""
    page.get_by_role("tab", name="Problem").click()
    page.locator("textarea").fill(text)
    page.wait_for_timeout(600)
    page.wait_for_selector(".badge:not(.stale)", timeout=20_000)
    page.get_by_role("tab", name="Law").click()


def value_of(page: Page) -> str:
    return page.locator("textarea").input_value()


def pixels(page: Page) -> bytes:
    page.evaluate("document.activeElement.blur()")  # the frame of the focus is no part of the picture
    page.wait_for_timeout(150)
    return page.locator("canvas.body").screenshot()


def drag(page: Page, what: Locator, dx: float, dy: float, steps: int = 12) -> None:
    box = what.bounding_box()
    assert box is not None
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    page.mouse.move(x, y)
    page.mouse.down()
    for k in range(1, steps + 1):
        page.mouse.move(x + dx * k / steps, y + dy * k / steps)
        page.wait_for_timeout(15)
    page.mouse.up()


def keep(page: Page, name: str) -> None:
    if KEPT:
        Path(KEPT).mkdir(parents=True, exist_ok=True)
        page.wait_for_timeout(300)
        page.screenshot(path=Path(KEPT) / f"{name}.png")


@pytest.mark.parametrize(
    ("size", "dark", "name"),
    [((1280, 720), False, "light"), ((1280, 720), True, "dark"), ((390, 844), False, "narrow")],
)
def test_the_page_shows_body_charts_laws_and_badge(
    open_page: Callable[..., Page], server: Server, size: tuple[int, int], dark: bool, name: str
) -> None:
    page = open_page(server.address, size=size, dark=dark)
    ready(page, ".good")
    assert "only solution" in page.locator(".badge").inner_text()
    assert len(set(pixels(page))) > 100  # not one colour
    assert page.locator("svg.plot .line").count() >= 4
    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
    for one in page.locator("header button, header select, .tools select, .tabs button").all():
        box = one.bounding_box()
        assert box is None or (box["x"] >= 0 and box["x"] + box["width"] <= size[0] + 0.5)
    keep(page, name)


def test_a_slider_changes_picture_text_and_undo_brings_them_back(
    open_page: Callable[..., Page], server: Server
) -> None:
    page = open_page(server.address)
    before, text = pixels(page), value_of(page)
    slider = page.locator('input[type="range"][data-key="loads.body.1"]')
    box = slider.bounding_box()
    assert box is not None
    page.mouse.move(box["x"] + 0.3 * box["width"], box["y"] + box["height"] / 2)
    page.mouse.down()
    for k in range(20):
        page.mouse.move(box["x"] + (0.3 - 0.01 * k) * box["width"], box["y"] + box["height"] / 2)
        page.wait_for_timeout(15)
    page.mouse.up()
    ready(page)
    assert pixels(page) != before
    after = value_of(page)
    assert after != text
    assert [a for a, b in zip(text.splitlines(), after.splitlines(), strict=True) if a != b] == ["body = [-0.8, -0.8]"]
    page.locator("canvas.body").focus()
    page.keyboard.press("Control+z")
    ready(page)
    assert value_of(page) == text
    assert pixels(page) == before
    page.keyboard.press("Control+y")
    ready(page)
    assert value_of(page) == after


def test_keys_move_sliders_and_tabs(open_page: Callable[..., Page], server: Server) -> None:
    page = open_page(server.address)
    slider = page.locator('input[type="range"][data-key="contact.bottom.friction.bound"]')
    slider.focus()
    for _ in range(4):
        page.keyboard.press("ArrowRight")
    ready(page)
    assert "bound = 0.52" in value_of(page)
    page.get_by_role("tab", name="Contact boundary").focus()
    page.keyboard.press("ArrowRight")
    assert page.get_by_role("button", name="Follow the path").is_visible()


def test_points_of_a_law_are_dragged(open_page: Callable[..., Page], server: Server) -> None:
    page = open_page(server.address, TABLE)
    page.wait_for_function("document.querySelector('.status').innerText.includes('312 unknowns')")
    ready(page)
    handles = page.locator('.lawpanel:has-text("normal") .handle')
    assert handles.count() == 4
    force = page.locator(".status").inner_text()
    for _ in range(5):  # on a busy machine the panel may move between the look for the point and the grip
        if page.locator(".status").inner_text() != force:
            break
        drag(page, handles.nth(2), 0.0, -40.0)
        page.wait_for_timeout(700)
    ready(page)
    pressures = re.search(r"pressures = \[(.*?)\]", value_of(page))
    assert pressures is not None
    numbers = [float(x) for x in pressures[1].split(",")]
    assert numbers[2] > 0.55
    assert numbers[:2] + numbers[3:] == [0.0, 0.0, 0.8]
    assert page.locator(".status").inner_text() != force
    friction = page.locator('.lawpanel:has-text("friction") .handle')
    assert friction.count() == 2
    friction.nth(1).focus()
    page.keyboard.press("ArrowDown")
    page.wait_for_function("document.querySelector('textarea').value.match(/values = \\[1.0, 0.5\\]/) === null")
    ready(page)
    page.wait_for_timeout(300)
    assert friction.nth(1).evaluate("node => node === document.activeElement")  # the answer takes no focus
    values = re.search(r"values = \[1.0, (.*?)\]", value_of(page))
    assert values is not None
    assert float(values[1]) < 0.5
    keep(page, "law")


def test_a_body_in_space_is_turned(open_page: Callable[..., Page], server: Server) -> None:
    page = open_page(server.address, template("cube"))
    before = pixels(page)
    drag(page, page.locator("canvas.body"), 90.0, 30.0)
    turned = pixels(page)
    assert turned != before
    page.locator("canvas.body").focus()
    page.keyboard.press("+")
    assert pixels(page) != turned
    keep(page, "space")
    page.locator("canvas.body").focus()
    page.keyboard.press("0")
    assert pixels(page) == before


def test_the_load_path_has_folds_and_a_cursor(open_page: Callable[..., Page], server: Server) -> None:
    page = open_page(server.address, template("delamination"))
    page.get_by_role("tab", name="Load path").click()
    page.get_by_role("button", name="Follow the path").click()
    page.wait_for_selector(".lower .fold", timeout=60_000)
    assert page.locator(".lower .fold").count() >= 1
    end = pixels(page)
    cursor = page.get_by_label("point of the path")
    cursor.fill(str(int(cursor.get_attribute("max") or 0) // 3))
    page.wait_for_timeout(600)
    assert "load factor" in page.locator(".status").inner_text()
    assert "stable part of the path" in page.locator(".badge").inner_text()
    assert pixels(page) != end
    keep(page, "path")


def test_all_solutions_stand_side_by_side(open_page: Callable[..., Page], server: Server) -> None:
    page = open_page(server.address, template("softening"))
    page.get_by_role("tab", name="All solutions").click()
    page.get_by_role("button", name="Find all solutions").click()
    page.wait_for_selector(".card", timeout=30_000)
    cards = page.locator(".card").all_inner_texts()
    assert len(cards) == 3
    assert sum("local minimiser" in text for text in cards) == 2
    keep(page, "solutions")
    before = pixels(page)
    page.locator(".card").nth(2).click()
    assert "saddle" in page.locator(".badge").inner_text()
    assert pixels(page) != before


def test_a_slider_plays_until_it_is_stopped(open_page: Callable[..., Page], server: Server) -> None:
    page = open_page(server.address)
    text, before = value_of(page), pixels(page)
    play = page.locator(".slider", has=page.locator('[data-key="loads.body.1"]')).locator("button.play")
    play.click()
    drawn = page.evaluate("window.drawn.length")
    for _ in range(100):
        page.wait_for_timeout(100)
        if page.evaluate("window.drawn.length") > drawn + 12:
            break
    assert play.inner_text() == "\N{DOUBLE VERTICAL BAR}"
    page.locator("canvas.body").focus()
    play.click()
    ready(page)
    moved = value_of(page)
    assert [a for a, b in zip(text.splitlines(), moved.splitlines(), strict=True) if a != b] == ["body = [-0.8, -0.8]"]
    page.wait_for_timeout(500)
    assert value_of(page) == moved  # it no longer moves
    assert pixels(page) != before
    page.keyboard.press("Control+z")  # all of it is one step
    ready(page)
    assert value_of(page) == text


def test_the_energy_over_a_slider_has_a_valley_in_which_the_ball_rolls(
    open_page: Callable[..., Page], server: Server
) -> None:
    page = open_page(server.address, HELD)
    page.get_by_role("tab", name="Energy").click()
    page.get_by_label("slider of the energy").select_option("supports.top.displacement.1")
    page.get_by_role("button", name="Draw the energy").click()
    page.wait_for_selector(".lower .ball", timeout=30_000)
    assert page.locator(".lower .valley").count() == 1
    valley = page.locator(".lower .valley").bounding_box()
    ball = page.locator(".lower .ball").bounding_box()
    keep(page, "energy")
    assert valley is not None
    assert ball is not None
    assert abs(ball["x"] - valley["x"]) > 20
    page.locator(".lower .fill:visible").click(position={"x": 80, "y": 60})  # the slider goes there
    page.wait_for_timeout(700)
    ready(page)
    moved = page.locator(".lower .ball").bounding_box()
    assert moved is not None
    assert moved["x"] != ball["x"]
    page.locator('input[type="range"][data-key="loads.body.1"]').fill("0.5")
    page.wait_for_timeout(700)
    assert page.locator(".lower .ball").count() == 0  # another problem


def test_a_state_is_kept_as_a_ghost(open_page: Callable[..., Page], server: Server) -> None:
    page = open_page(server.address)
    before = pixels(page)
    page.get_by_role("button", name="Keep as ghost").click()
    page.locator('input[type="range"][data-key="loads.body.1"]').fill("-1.5")
    page.wait_for_timeout(500)
    ready(page)
    haunted = pixels(page)
    keep(page, "ghost")
    page.get_by_role("button", name="Remove ghost").click()
    assert pixels(page) != haunted
    page.locator('input[type="range"][data-key="loads.body.1"]').fill("-0.8")
    page.wait_for_timeout(500)
    ready(page)
    assert pixels(page) == before


def test_the_contact_of_a_body_in_space_is_a_flat_map(open_page: Callable[..., Page], server: Server) -> None:
    page = open_page(server.address, template("cube"))
    page.get_by_role("tab", name="Contact boundary").click()
    page.wait_for_timeout(300)
    places = page.locator(".lower svg.plot:visible title").all_inner_texts()
    texts = page.eval_on_selector_all(".lower svg.plot title", "all => all.map((one) => one.textContent)")
    assert len(texts) > 20
    assert all(text.startswith("pressure ") for text in texts), places
    assert page.eval_on_selector_all(".lower .label", "all => all.slice(0, 2).map((one) => one.textContent)") == [
        "x",
        "y",
    ]
    keep(page, "map")


def test_a_broken_problem_is_mended(open_page: Callable[..., Page], server: Server) -> None:
    page = open_page(server.address)
    field = page.get_by_label("contact.bottom.normal.q_max", exact=True)
    field.fill("-1")
    field.press("Enter")
    error = page.locator(".slider.wrong .error")
    error.wait_for(timeout=10_000)
    assert "at least 0" in error.inner_text()
    assert "no solution" in page.locator(".badge").inner_text()
    keep(page, "broken")
    field.fill("0.25")
    field.press("Enter")
    ready(page, ".good")
    assert page.locator(".slider.wrong").count() == 0
    text = value_of(page)
    write(page, text.replace("[material]", "[material"))
    page.get_by_role("tab", name="Problem").click()
    assert "not valid TOML" in page.locator(".side .error").inner_text()
    write(page, text)
    ready(page, ".good")


def test_two_pages_do_not_disturb_each_other(open_page: Callable[..., Page], server: Server) -> None:
    first, second = open_page(server.address), open_page(server.address, template("softening"))
    for k in range(6):
        for page, key in ((first, "loads.body.0"), (second, "supports.top.displacement.1")):
            page.locator(f'input[type="range"][data-key="{key}"]').focus()
            page.keyboard.press("ArrowRight" if k % 2 else "ArrowLeft")
    ready(first)
    ready(second)
    assert "survey" in first.locator("h1").inner_text()
    assert "softening" in second.locator("h1").inner_text()
    assert first.locator(".slider.wrong, .status.wrong").count() == 0


def test_a_page_goes_on_when_its_program_is_back(open_page: Callable[..., Page]) -> None:
    own = Server(free_port())
    page = open_page(own.address)
    page.locator('input[type="range"][data-key="loads.body.1"]').focus()
    page.keyboard.press("ArrowRight")
    ready(page)
    text = value_of(page)
    own.stop(signal.SIGKILL)
    page.wait_for_selector(".lost:not([hidden])", timeout=10_000)
    page.keyboard.press("ArrowRight")  # what is changed meanwhile is not lost
    own.start()
    page.wait_for_selector(".lost", state="hidden", timeout=20_000)
    ready(page, ".good")
    assert value_of(page) != text
    page.keyboard.press("ArrowLeft")
    ready(page, ".good")
    assert value_of(page) == text
    own.stop()


def test_a_link_restores_text_and_view(open_page: Callable[..., Page], server: Server) -> None:
    page = open_page(server.address)
    field = page.get_by_label("contact.bottom.normal.q_max", exact=True)
    field.fill("0.125")
    field.press("Enter")
    ready(page)
    page.get_by_label("colour of the body").select_option("stress")
    drag(page, page.locator("canvas.body"), 40.0, 20.0)
    page.get_by_role("tab", name="Certificate").click()
    page.wait_for_timeout(600)
    address, picture = page.url, pixels(page)
    again = open_page(address)
    assert "q_max = 0.125" in value_of(again)
    assert again.get_by_label("colour of the body").input_value() == "stress"
    assert again.get_by_role("tab", name="Certificate").get_attribute("aria-selected") == "true"
    assert pixels(again) == picture
    broken = open_page(server.address + "#p=dnonsense&v=a,b&c=x,y,z&s=nan")
    assert "q_max = 0.3" in value_of(broken)


def test_pictures_and_text_are_saved(open_page: Callable[..., Page], server: Server, tmp_path: Path) -> None:
    page = open_page(server.address)
    for button, name in (("PNG", "survey.png"), ("SVG", "survey.svg")):
        with page.expect_download() as saved:
            page.get_by_role("button", name=button, exact=True).click()
        assert saved.value.suggested_filename == name
        saved.value.save_as(tmp_path / name)
        if KEPT:
            Path(KEPT).mkdir(parents=True, exist_ok=True)
            saved.value.save_as(Path(KEPT) / f"saved-{name}")
    assert (tmp_path / "survey.png").read_bytes().startswith(b"\x89PNG")
    svg = (tmp_path / "survey.svg").read_text(encoding="utf-8")
    assert svg.count("<path") > 4096
    assert "survey, data" in svg
    assert "only solution" in svg
    page.get_by_role("tab", name="Problem").click()
    with page.expect_download() as saved:
        page.get_by_role("button", name="Download").click()
    saved.value.save_as(tmp_path / "a.toml")
    assert (tmp_path / "a.toml").read_text(encoding="utf-8") == value_of(page)


def test_a_run_in_time_is_played(open_page: Callable[..., Page], server: Server) -> None:
    page = open_page(server.address)
    page.get_by_label("examples").select_option("bounce")
    page.wait_for_selector("output:has-text('t =')", timeout=30_000)
    page.wait_for_selector(".lower .quiet:has-text('finished')", timeout=60_000)
    bar = page.get_by_label("time", exact=True)
    assert int(bar.get_attribute("max") or 0) > 50
    assert bar.input_value() == bar.get_attribute("max")  # the last frame is shown
    before = pixels(page)
    page.get_by_role("button", name="Play").click()
    page.wait_for_timeout(1500)
    page.get_by_role("button", name="Pause").click()
    assert int(bar.input_value()) > 5
    assert pixels(page) != before
    keep(page, "time")
    page.get_by_label("examples").select_option("survey")
    ready(page, ".good")


def test_an_emoji_in_the_text_moves_no_slider(open_page: Callable[..., Page], server: Server) -> None:
    page = open_page(server.address, template("survey").replace("survey, data", "🙂 survey 🙂"))
    field = page.get_by_label("contact.bottom.normal.q_max", exact=True)
    field.fill("0.25")
    field.press("Enter")
    ready(page, ".good")
    assert "q_max = 0.25," in value_of(page)


def test_undo_is_the_same_in_fields_text_and_picture(open_page: Callable[..., Page], server: Server) -> None:
    page = open_page(server.address)
    text = value_of(page)
    field = page.get_by_label("contact.bottom.normal.q_max", exact=True)
    for value in ("0.25", "0.2"):
        field.fill(value)
        field.press("Enter")
        ready(page, ".good")
    field.fill("0.1")  # not yet told: it is the last step
    field.press("Control+z")
    assert "q_max = 0.2," in value_of(page)
    field.press("Control+z")
    assert "q_max = 0.25," in value_of(page)
    page.get_by_role("tab", name="Problem").click()
    page.locator("textarea").press("Control+z")
    assert value_of(page) == text
    page.locator("textarea").press("Control+y")
    assert "q_max = 0.25," in value_of(page)


def test_a_changed_problem_has_no_sentence_on_its_solutions(open_page: Callable[..., Page], server: Server) -> None:
    page = open_page(server.address, template("softening"))
    page.get_by_role("tab", name="All solutions").click()
    page.get_by_role("button", name="Find all solutions").click()
    page.wait_for_selector(".card", timeout=30_000)
    words = page.locator(".lower .panel:not([hidden]) .quiet")
    assert "3 solutions" in words.inner_text()
    page.locator('input[type="range"][data-key="supports.top.displacement.1"]').press("ArrowRight")
    ready(page)
    assert page.locator(".card").count() == 0
    assert "solutions" not in words.inner_text()


def test_the_factor_of_the_deformation_is_found_for_each_example(
    open_page: Callable[..., Page], server: Server
) -> None:
    page = open_page(server.address)
    slide, told = page.get_by_label("deformation scale"), page.locator(".tools output")
    own = told.inner_text()
    slide.press("End")
    assert told.inner_text() != own
    page.get_by_role("button", name="auto").click()
    assert told.inner_text() == own
    slide.press("End")
    page.get_by_label("examples").select_option("survey")  # the same body
    page.get_by_label("examples").select_option("hertz")
    page.wait_for_selector("h1:has-text('steel block')")
    ready(page)
    fresh = open_page(server.address, template("hertz"))
    fresh.get_by_role("button", name="auto").click()
    assert told.inner_text() == fresh.locator(".tools output").inner_text()


def test_warnings_are_marked_on_their_tab(open_page: Callable[..., Page], server: Server) -> None:
    page = open_page(server.address, template("cube"))
    ready(page)
    marked = page.locator(".tabs .marked")
    assert marked.inner_text() == "Certificate"
    assert marked.get_attribute("title") == "1 warning"
    page.get_by_label("examples").select_option("survey")
    page.wait_for_selector(".tabs .marked", state="detached")


@pytest.mark.parametrize(
    ("name", "cells", "finer", "unknowns"),
    [
        ("survey", "cells = [32, 32]", "cells = [50, 50]", 10100),
        ("cube", "cells = [8, 8, 8]", "cells = [14, 14, 14]", 9450),
    ],
)
def test_how_long_a_slider_takes(
    open_page: Callable[..., Page], server: Server, name: str, cells: str, finer: str, unknowns: int
) -> None:
    """From a change of a slider to the picture, with 10^4 unknowns; printed, and kept if wanted."""
    assert cells in template(name)
    page = open_page(server.address, template(name).replace(cells, finer))
    ready(page)
    assert f"{unknowns} unknowns" in page.locator(".status").inner_text()
    times = []
    for k in range(60):
        times.append(
            page.evaluate(
                """(value) => new Promise((done) => {
                  const slider = document.querySelector('input[data-key="loads.body.1"]');
                  const from = performance.now();
                  const before = window.drawn.length ? window.drawn[window.drawn.length - 1][1] : 0;
                  const look = () => {
                    const last = window.drawn[window.drawn.length - 1];
                    if (last && last[1] > before) done(last[0] - from);
                    else requestAnimationFrame(look);
                  };
                  slider.value = String(value);
                  slider.dispatchEvent(new Event("input", { bubbles: true }));
                  look();
                })""",
                -0.4 - 0.02 * (k % 30),
            )
        )
        page.wait_for_timeout(60)
    times = sorted(times[5:])
    told = {"median_ms": statistics.median(times), "p95_ms": times[int(0.95 * len(times))], "most_ms": times[-1]}
    print(json.dumps(told))
    if KEPT:
        Path(KEPT).mkdir(parents=True, exist_ok=True)
        (Path(KEPT) / f"latency-{name}.json").write_text(json.dumps(told), encoding="utf-8")


NOTEBOOK = """<!doctype html><meta charset="utf-8"><div id="cell"></div><script type="module">
import widget from "/widget.js";
const heard = [];
window.deliver = (head, parts) => {
  const buffers = parts.map((text) => new DataView(Uint8Array.from(atob(text), (c) => c.charCodeAt(0)).buffer));
  for (const hear of heard) hear(head, buffers);
};
const modules = await (await fetch("/modules.json")).json();
const model = {
  get: () => modules, on: (name, hear) => heard.push(hear), off: () => heard.splice(0),
  send: (content) => window.toKernel(content),
};
widget.render({ model, el: document.getElementById("cell") });
</script>"""


def test_the_widget_of_a_notebook_shows_the_same(browser: Browser, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its modules are made of their texts, and its messages go to the widget's own end in Python."""
    pytest.importorskip("anywidget", reason="the widget needs anywidget")
    from hemivar.files.problem_file import parse_problem
    from hemivar.studio import show
    from hemivar.studio.notebook_widget import module_texts
    from hemivar.studio.web_server import STATIC
    from tests.studio.test_notebook_widget import Kernel

    kernel = Kernel(show(parse_problem(template("survey"))), monkeypatch)
    asked: list[object] = []
    parts = {
        "/": (NOTEBOOK, "text/html"),
        "/widget.js": ((STATIC / "widget.js").read_text(encoding="utf-8"), "text/javascript"),
        "/modules.json": (json.dumps(module_texts()), "application/json"),
        "/studio.css": ((STATIC / "studio.css").read_text(encoding="utf-8"), "text/css"),
    }
    page = browser.new_page()
    complaints: list[str] = []
    page.on("pageerror", lambda error: complaints.append(str(error)))
    page.expose_function("toKernel", lambda content: asked.append(content))

    def serve(route: Route) -> None:
        name = route.request.url.removeprefix("http://notebook.test")
        body, kind = parts.get(name, ("", "text/plain"))
        route.fulfill(status=200 if name in parts else 404, body=body, content_type=kind)

    page.route("http://notebook.test/**", serve)
    page.goto("http://notebook.test/")
    page.add_style_tag(url="http://notebook.test/studio.css")
    for _ in range(300):
        page.wait_for_timeout(50)
        while asked:
            kernel.ask(asked.pop(0))
        while kernel.got:
            head, buffers = kernel.got.pop(0)
            page.evaluate("([h, p]) => deliver(h, p)", [head, [base64.b64encode(one).decode() for one in buffers]])
        if page.locator(".badge.good:not(.stale)").count():
            break
    assert "only solution" in page.locator(".badge").inner_text()
    assert len(set(pixels(page))) > 100
    assert not complaints
    keep(page, "widget")
    page.close()
    kernel.widget.close()  # type: ignore[attr-defined]
